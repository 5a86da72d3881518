//! Tests of long motion: with maintenance, culling costs about as much as after a rebuild. Cost is measured
//! by culling counters, which are the same on every machine.

use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, FrustumCuller, ObjectId, Pipeline, Pose, Scene, View, VisibleSet};
use visibility_testing::Random;

/// Half the side of the cube in which everything moves, in metres.
const REACH: f32 = 100.0;
const COUNT: usize = 20_000;
/// Budget of maintenance per frame, in blocks; the scene has about 313.
const BUDGET: usize = 64;

/// How the objects of a test move.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Motion {
    /// Each object takes a new random direction in every frame.
    Walk,
    /// Each object keeps its direction until it bounces off a wall of the cube. In the end, objects that
    /// started as neighbours are anywhere.
    Bounce,
    /// Each object follows one of a few leaders, which bounce off the walls.
    Swarm,
}

struct World {
    rng: Random,
    motion: Motion,
    ids: Vec<ObjectId>,
    boxes: Vec<Aabb>,
    speeds: Vec<Vec3>,
    leaders: Vec<(Vec3, Vec3)>,
}

/// Returns a random displacement of up to `size` metres on each axis.
fn random_step(rng: &mut Random, size: f64) -> Vec3 {
    rng.vector(size).as_vec3()
}

fn bounced(at: Vec3, speed: Vec3) -> Vec3 {
    Vec3::select((at + speed).abs().cmpgt(Vec3::splat(REACH)), -at.signum() * speed.abs(), speed)
}

impl World {
    fn new(motion: Motion, scene: &mut Scene) -> Self {
        let mut rng = Random(3);
        let mut boxes = Vec::new();
        for _ in 0..COUNT {
            let (center, half) = (rng.vector(f64::from(REACH)).as_vec3(), rng.vector(1.0).as_vec3().abs());
            boxes.push(Aabb::new(center - half, center + half));
        }
        Self {
            motion,
            ids: scene.insert_batch(boxes.iter().copied()),
            speeds: boxes.iter().map(|_| random_step(&mut rng, 0.25)).collect(),
            leaders: (0..20)
                .map(|_| (random_step(&mut rng, f64::from(REACH)), random_step(&mut rng, 0.25)))
                .collect(),
            boxes,
            rng,
        }
    }

    /// Advances all objects by one frame and returns their new bounds.
    fn step(&mut self) -> Vec<(ObjectId, Aabb)> {
        for (at, speed) in &mut self.leaders {
            *speed = bounced(*at, *speed);
            *at += *speed;
        }
        for (number, (b, speed)) in self.boxes.iter_mut().zip(&mut self.speeds).enumerate() {
            let center = b.center();
            match self.motion {
                Motion::Walk => *speed = random_step(&mut self.rng, 0.5),
                Motion::Bounce => {}
                Motion::Swarm => {
                    let (leader, _) = self.leaders[number % self.leaders.len()];
                    *speed += (leader - center).normalize_or_zero() * 0.01;
                    *speed = speed.clamp_length_max(0.25);
                }
            }
            *speed = bounced(center, *speed);
            *b = Aabb::new(b.min + *speed, b.max + *speed);
        }
        self.ids.iter().copied().zip(self.boxes.iter().copied()).collect()
    }
}

/// Returns the numbers of visited nodes, of tests and of visible objects, summed over several views.
fn cost(scene: &Scene) -> [f64; 3] {
    let mut sum = [0.0; 3];
    let mut pipeline = Pipeline::new().with(FrustumCuller::new());
    let mut visible = VisibleSet::new();
    for number in 0..12 {
        let angle = f64::from(number) * 0.55;
        let eye = DVec3::new(angle.cos(), angle.sin(), 0.1) * f64::from(number * 6);
        let pose = Pose::look_at(eye, eye + DVec3::new(angle.sin(), angle.cos(), 0.2), DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.6, 0.1, 150.0).unwrap();
        let stats = pipeline.cull(scene, &view, &mut visible);
        for (sum, count) in sum.iter_mut().zip([stats.nodes, stats.tests, stats.visible]) {
            *sum += count as f64;
        }
    }
    sum
}

fn check(motion: Motion, frames: usize) {
    let mut scene = Scene::new();
    let mut world = World::new(motion, &mut scene);
    let mut worst = [0.0f64; 2];
    for frame in 1..=frames {
        scene.set_bounds_batch(&world.step()).unwrap();
        let done = scene.maintain(BUDGET);
        assert!(
            done.budget_used <= BUDGET,
            "{motion:?}, frame {frame}: {} blocks, the budget is {BUDGET}",
            done.budget_used
        );
        if frame % 50 == 0 {
            let mut rebuilt = scene.clone();
            rebuilt.rebuild();
            let [nodes, tests, visible] = cost(&scene);
            let [fresh_nodes, fresh_tests, fresh_visible] = cost(&rebuilt);
            assert_eq!(visible, fresh_visible, "{motion:?}, frame {frame}");
            worst = [worst[0].max(nodes / fresh_nodes), worst[1].max(tests / fresh_tests)];
        }
        assert!(scene.memory() <= 64 * COUNT, "{motion:?}, frame {frame}: {} bytes", scene.memory());
    }
    println!("{motion:?}: {worst:?}");
    assert!(
        worst.iter().all(|&ratio| ratio <= 1.3),
        "{motion:?}: {worst:?} of what culling takes after a rebuild"
    );
}

#[test]
fn culling_stays_cheap_on_a_random_walk() {
    check(Motion::Walk, 1000);
}

#[test]
fn culling_stays_cheap_while_everything_mixes() {
    check(Motion::Bounce, 1000);
}

#[test]
fn culling_stays_cheap_in_swarms() {
    check(Motion::Swarm, 1000);
}

/// Tests that repeated maintenance without motion empties the queue, after which nothing is left to do, and
/// that it lowers the cost of culling.
#[test]
fn maintaining_comes_to_an_end() {
    let mut scene = Scene::new();
    let mut world = World::new(Motion::Bounce, &mut scene);
    assert_eq!(scene.maintain(usize::MAX).budget_used, 0, "nothing has moved");
    for _ in 0..200 {
        scene.set_bounds_batch(&world.step()).unwrap();
    }
    let loose = cost(&scene);
    let mut calls = 0;
    while scene.maintain(BUDGET).waiting > 0 {
        calls += 1;
        assert!(calls < 200, "there is an end");
    }
    assert_eq!(scene.maintain(usize::MAX).budget_used, 0, "blocks of work when all is done");
    let tidy = cost(&scene);
    assert!(tidy[0] < 0.8 * loose[0] && tidy[2] == loose[2], "{tidy:?} instead of {loose:?}");
}

/// Tests that nodes left sparse by removals are merged.
#[test]
fn sparse_blocks_are_merged() {
    let mut scene = Scene::new();
    let world = World::new(Motion::Bounce, &mut scene);
    let (gone, kept): (Vec<_>, Vec<_>) = world.ids.iter().partition(|id| id.index() % 8 != 0);
    scene.remove_batch(&gone).unwrap();
    for _ in 0..4 {
        scene.maintain(usize::MAX);
        let here: Vec<_> = kept.iter().map(|&id| (id, scene.bounds(id).unwrap())).collect();
        scene.set_bounds_batch(&here).unwrap();
    }
    let mut rebuilt = scene.clone();
    rebuilt.rebuild();
    let (nodes, fresh) = (cost(&scene)[0], cost(&rebuilt)[0]);
    assert!(nodes < 1.5 * fresh, "{nodes} nodes instead of {fresh}");
}

/// Tests batches in which objects occur twice, cross the world, get non-finite bounds and finite ones again:
/// the result is that of the moves in order.
#[test]
fn batches_of_moves_count_in_their_order() {
    for size in [1, 30, 800, 5000, 15_000] {
        let mut scene = Scene::new();
        let mut world = World::new(Motion::Walk, &mut scene);
        let rng = &mut world.rng;
        for _ in 0..30 {
            let mut moved = Vec::new();
            for _ in 0..size {
                let among = if rng.one_in(3) { 50 } else { COUNT };
                let number = rng.below(among);
                let size = rng.pick(&[0.1, 3.0, 150.0]);
                let step = random_step(rng, size);
                let b = &mut world.boxes[number];
                *b = match rng.below(50) {
                    0 => Aabb::new(step, step * f32::NAN),
                    _ => Aabb::new(step, step + 1.0),
                };
                moved.push((world.ids[number], *b));
            }
            scene.set_bounds_batch(&moved).unwrap();
            scene.maintain(20);
        }
        for (&id, b) in world.ids.iter().zip(&world.boxes) {
            let bits = |b: &Aabb| [b.min, b.max].map(|v| v.to_array().map(f32::to_bits));
            assert_eq!(
                bits(&scene.bounds(id).unwrap()),
                bits(b),
                "the bounds of {id} after batches of {size}"
            );
        }
        let mut rebuilt = scene.clone();
        rebuilt.rebuild();
        assert_eq!(cost(&scene)[2], cost(&rebuilt)[2], "as much is in view");
    }
}
