//! `OnlinePvs` never hides an object that is visible from the box that answers, while the scene changes, is
//! swapped and cloned. Its answers come when they are due.

use crate::common::{World, random_world};
use std::collections::BTreeSet;
use visibility_core::bits::Bits;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::pvs::{HiddenSets, Residency, Transfer, Viewcell};
use visibility_core::view::Eye;
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, Object, ObjectId, OccluderMesh, Pose, RegionCuller, Scene, View,
    VisibleSet,
};
use visibility_region::{OnlinePvs, SamplingCuller};
use visibility_testing::allocations::ALLOCATIONS;
use visibility_testing::swapped::{Swapped, hold_against_fresh};
use visibility_testing::{Random, SlotScene, judged, told_enough};

/// Budget that is enough for a step to finish any direction.
const WHOLE: u32 = u32::MAX;

/// Removes an occluder or makes it see-through, or moves a target, or adds an object.
fn change(world: &mut World, rng: &mut Random, scale: f64) {
    let number = rng.below(world.bounds.len());
    let id = world.bounds[number].0;
    let triangles =
        |world: &World, id| world.scene.occluder(id).map_or(0, |(mesh, _)| mesh.triangles().len());
    let near = (rng.direction() * (scale * rng.range(2.0, 12.0))).as_vec3();
    let size = (scale * rng.range(0.1, 1.0)) as f32;
    let bounds = Aabb::new(near - size, near + size);
    match rng.below(4) {
        0 | 1 if triangles(world, id) > 0 => {
            let before: usize = world.bounds[..number].iter().map(|(id, _)| triangles(world, *id)).sum();
            world.triangles.drain(before..before + triangles(world, id));
            if rng.one_in(2) {
                world.scene.remove(id).unwrap();
                world.bounds.remove(number);
            } else {
                world.scene.set_occluder(id, false).unwrap();
            }
        }
        2 => _ = world.add_box(bounds.min.to_array(), bounds.max.to_array()),
        _ if triangles(world, id) == 0 => {
            world.scene.set_bounds(id, bounds).unwrap();
            world.bounds[number].1 = bounds;
        }
        _ => _ = world.add_target(bounds),
    }
    world.scene.maintain(rng.below(3));
}

/// Walks through random worlds that change. Fails if a ray from a box reaches an object that the box hides.
/// Returns the number of answers, and the number of objects hidden in them.
fn search(seed: u64, worlds: usize, rays: usize) -> [usize; 2] {
    let (mut rng, mut answers, mut hidden_objects) = (Random(seed), 0, 0);
    for number in 0..worlds {
        let scale = rng.pick(&[1.0, 1.0, 1e-3, 1e4]);
        let (mut world, _) = random_world(&mut rng, scale);
        let size = scale * 0.6;
        let mut online = OnlinePvs::new(DVec3::splat(size), DVec3::new(4.0, 4.0, 1.0) * scale).unwrap();
        let (mut eye, way) = (rng.vector(scale), rng.vector(0.2 * scale));
        for frame in 0..12 {
            eye += way;
            let places: Vec<DVec3> = (0..rng.below(6)).map(|i| eye + way * i as f64).collect();
            // Steps that finish a direction, and steps that do a part of one.
            let (steps, budget) = rng.pick(&[(16, WHOLE), (100, 20), (1000, 1)]);
            for _ in 0..rng.below(steps) {
                online.step(&world.scene, &places, budget);
                if rng.one_in(2 * steps) {
                    change(&mut world, &mut rng, scale);
                }
            }
            let part = rng.vector(0.1 * size);
            let (min, max) = (eye - part.abs(), eye + part.abs());
            let Some(bits) = online.hidden_from(&world.scene, min, max) else { continue };
            let hidden: BTreeSet<ObjectId> =
                world.scene.ids().filter(|id| bits.contains(id.index())).collect();
            answers += 1;
            hidden_objects += hidden.len();
            let cell = Viewcell::from_box(min, max);
            if let Err((id, from, along)) = world.search(&mut rng, &cell, &hidden, rays) {
                panic!(
                    "seed {seed}, world {number}, frame {frame}: {id} is seen from {from} along {along} but hidden"
                );
            }
        }
    }
    [answers, hidden_objects]
}

#[test]
fn no_ray_from_a_box_reaches_what_is_hidden_from_it_while_the_scene_changes() {
    let [answers, hidden] = search(11, 20, 200);
    judged(200 * answers as u64);
    told_enough(answers > 100 && hidden > 400, format_args!("{answers} answers, {hidden} hidden objects"));
}

/// What the boxes made online for a viewcell hide from all of it.
struct OfRegion;

impl RegionCuller for OfRegion {
    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn cull(&mut self, scene: &Scene, cell: &Viewcell, visible: &mut VisibleSet) -> CullStats {
        let size = (cell.max - cell.min).max(DVec3::splat(1e-3)) * 1.01;
        let mut online = OnlinePvs::new(size, size * DVec3::new(3.0, 2.0, 1.5)).unwrap().with_margin(0.0);
        let middle = (cell.min + cell.max) * 0.5;
        while online.step(scene, &[middle], WHOLE).is_some() {}
        let hidden = online.hidden_from(scene, cell.min, cell.max).expect("a viewcell around the region");
        visible.retain(scene, |id, _| !hidden.contains(id.index()))
    }
}

#[test]
fn boxes_hide_nothing_that_is_seen_through_a_slot() {
    let found = SlotScene::search(&mut OfRegion, 7, 1000);
    assert!(found.wrong.is_empty(), "targets of scenes {:?} are seen and hidden", found.wrong);
    assert!(found.seen > 500 && found.hidden > 10, "{found:?}");
}

/// Returns whether long walls above the ceiling of the eye's room are hidden, by the height of the ceiling:
/// a wall wholly above it, and one that begins below it outside of the house.
fn hidden_upstairs(ceiling: Option<f32>) -> [bool; 2] {
    let mut world = World::new();
    if let Some(z) = ceiling {
        world.add_box([-20.0, -20.0, z], [40.0, 20.0, z + 0.2]);
    }
    // Seen from the eye both are farthest along x, and reach back over a third of the way to the eye.
    let above = world.add_target(Aabb::from_arrays([9.0, -4.0, 2.5], [15.0, -3.9, 5.0]));
    let outside = world.add_target(Aabb::from_arrays([50.0, -4.0, 1.0], [60.0, -3.9, 5.0]));
    let mut online = OnlinePvs::new(DVec3::splat(0.6), DVec3::new(4.0, 4.0, 1.0)).unwrap();
    while online.step(&world.scene, &[DVec3::ZERO], WHOLE).is_some() {}
    let hidden = online.hidden_from(&world.scene, DVec3::ZERO, DVec3::ZERO).expect("a viewcell");
    [above, outside].map(|id| hidden.contains(id.index()))
}

#[test]
fn a_ceiling_hides_long_walls_of_the_next_storey() {
    assert_eq!(hidden_upstairs(Some(2.0)), [true, false], "a ceiling between the eye and the wall");
    assert_eq!(hidden_upstairs(Some(3.0)), [false, false], "a ceiling that the wall passes");
    assert_eq!(hidden_upstairs(None), [false, false], "no ceiling");
}

#[test]
fn what_did_not_pay_is_tried_again_with_the_objects_that_were_seen() {
    let mut world = World::new();
    world.add_box([3.0, -20.0, 2.0], [40.0, 20.0, 2.2]);
    let above = world.add_target(Aabb::from_arrays([9.0, -4.0, 2.5], [15.0, -3.9, 5.0]));
    let mut online = OnlinePvs::new(DVec3::splat(0.6), DVec3::new(4.0, 4.0, 1.0)).unwrap();
    // The wide box holds both places. Only from the first one the wall is seen, past the end of the ceiling.
    let [start, end] = [-1.6, 1.6].map(|x| DVec3::X * x);
    while online.step(&world.scene, &[start, end], WHOLE).is_some() {}
    let mut is_hidden = |place: DVec3| {
        while online.step(&world.scene, &[place], WHOLE).is_some() {}
        online.hidden_from(&world.scene, place, place).expect("a viewcell").contains(above.index())
    };
    assert!(!is_hidden(start), "the wall is seen past the end of the ceiling");
    let mut places =
        (0..12).map(|i| DVec3::new(1.0 + 0.6 * f64::from(i / 6), 0.6 * f64::from(i % 6) - 1.6, 0.0));
    assert!(places.any(is_hidden), "no viewcell of twelve asks upwards for a wall that the last one saw");
}

#[test]
fn sweeps_that_ask_nothing_are_not_given_up() {
    let (scene, mut online) =
        (Scene::new(), OnlinePvs::new(DVec3::splat(0.6), DVec3::new(4.0, 4.0, 1.0)).unwrap());
    let mut steps = |x: f64| core::iter::from_fn(|| online.step(&scene, &[DVec3::X * x], WHOLE)).count();
    assert_eq!([steps(0.0), steps(1.0)], [24, 12], "steps for a wide box and a viewcell, and for a viewcell");
}

/// `OnlinePvs` that makes all that the eye needs in each frame; or what rays see from around the eye.
enum Subject {
    Online(Box<OnlinePvs>),
    Rays(Box<SamplingCuller>),
}

impl Culler for Subject {
    fn name(&self) -> &str {
        "online or rays"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Approximate
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let Eye::Point(eye) = view.eye(DVec3::ZERO) else { panic!("the views of this harness have an eye") };
        match self {
            Self::Online(online) => {
                while online.step(scene, &[eye], WHOLE).is_some() {}
                online.cull(scene, view, visible)
            }
            Self::Rays(rays) => rays.cull(scene, &Viewcell::from_box(eye - 0.01, eye + 0.01), visible),
        }
    }
}

struct Online;

impl Swapped for Online {
    type Culler = Subject;
    type Source = ();

    fn derive(&self, _: &Scene, _: &mut Random) {}

    fn make(&self, (): &()) -> Subject {
        let online = OnlinePvs::new(DVec3::ONE, DVec3::new(4.0, 4.0, 1.0)).unwrap().with_margin(0.3);
        Subject::Online(Box::new(online))
    }

    fn give(&self, _: &mut Subject, (): &(), _: &Scene) {}

    fn truth(&self, (): &()) -> Subject {
        Subject::Rays(Box::new(SamplingCuller::new().with_rays(2000)))
    }

    /// Answers depend on when each box was made, so memory of earlier frames is allowed.
    fn is_free_of_memory(&self) -> bool {
        false
    }
}

#[test]
fn scenes_are_swapped_cloned_and_changed_under_kept_boxes() {
    let hidden: usize = (0..2).map(|seed| hold_against_fresh(&Online, seed, 150)).sum();
    judged(hidden as u64);
    told_enough(hidden > 1000, format_args!("{hidden} objects are no test"));
}

/// A wall, with a post in front of it and one behind it.
struct Street {
    world: World,
    wall: ObjectId,
    front: ObjectId,
    back: ObjectId,
    online: OnlinePvs,
}

impl Street {
    fn new() -> Self {
        let mut world = World::new();
        let wall = world.add_box([5.0, -30.0, -30.0], [5.2, 30.0, 30.0]);
        let front = world.add_target(Aabb::from_arrays([3.0, 0.0, 0.0], [3.5, 0.5, 1.0]));
        let back = world.add_target(Aabb::from_arrays([20.0, 0.0, 0.0], [20.5, 0.5, 1.0]));
        let online = OnlinePvs::new(DVec3::splat(0.6), DVec3::new(4.0, 4.0, 1.0)).unwrap();
        Self { world, wall, front, back, online }
    }

    /// Makes every box that an eye at height `z` needs. Returns the number of steps.
    fn make(&mut self, z: f64) -> usize {
        let mut steps = 0;
        while self.online.step(&self.world.scene, &[DVec3::new(0.0, 0.0, z)], WHOLE).is_some() {
            steps += 1;
            assert!(steps <= 24, "two boxes have twelve sweeps each");
        }
        steps
    }

    /// Returns which objects are visible in a frame: the wall, the post in front of it, the post behind it.
    fn frame(&mut self, z: f64, layers: u32) -> [bool; 3] {
        let eye = DVec3::new(0.0, 0.0, z);
        let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, 0.05, 100.0).unwrap().with_layers(layers);
        let mut visible = VisibleSet::new();
        visible.fill(&self.world.scene, &view);
        self.online.cull(&self.world.scene, &view, &mut visible);
        [self.wall, self.front, self.back].map(|id| visible.contains(&self.world.scene, id))
    }
}

/// Visible objects in a frame that hides nothing, and in a frame that hides the post behind the wall.
const ALL: [bool; 3] = [true; 3];
const HIDDEN: [bool; 3] = [true, true, false];

#[test]
fn answers_come_from_the_best_box_that_is_made() {
    let mut street = Street::new();
    assert_eq!((street.frame(0.0, 1), street.online.answer()), (ALL, None), "nothing is made");
    let eye = [DVec3::ZERO];
    for step in 1..=24 {
        let done = street.online.step(&street.world.scene, &eye, WHOLE).expect("a box is missing");
        assert_eq!((done.is_wide, done.is_last), (step <= 12, step % 12 == 0), "step {step}");
        let expected = if step < 12 { ALL } else { HIDDEN };
        assert_eq!(street.frame(0.0, 1), expected, "after step {step}");
        assert_eq!(street.online.is_ready(), step == 24, "after step {step}");
        let width = street.online.answer().map(|cell| cell.max.x - cell.min.x);
        assert_eq!(width.map(|width| width.round()), [None, Some(4.0), Some(1.0)][step / 12], "step {step}");
    }
    assert!(street.online.step(&street.world.scene, &eye, WHOLE).is_none(), "all is made");
    let odd = [DVec3::NAN, DVec3::new(0.0, f64::INFINITY, 0.0)];
    assert!(
        street.online.step(&street.world.scene, &odd, WHOLE).is_none(),
        "places that are not finite are left out"
    );
    assert_eq!(street.frame(9.0, 1), ALL, "an eye elsewhere");
}

#[test]
fn a_path_needs_few_boxes() {
    let (mut street, mut boxes) = (Street::new(), [0; 2]);
    for i in 0..200 {
        let places: Vec<DVec3> = (0..10).map(|ahead| DVec3::Y * (0.02 * f64::from(i + 5 * ahead))).collect();
        while let Some(step) = street.online.step(&street.world.scene, &places, WHOLE) {
            boxes[usize::from(step.is_wide)] += usize::from(step.is_last);
        }
    }
    let [near, wide] = boxes;
    assert!((8..=15).contains(&near) && (1..=3).contains(&wide), "4.9 m took {near} viewcells, {wide} wide");
}

#[test]
fn a_viewcell_ends_at_the_side_of_its_wide_box() {
    let mut street = Street::new();
    street.make(0.0);
    let mut viewcell = |places: &[DVec3]| {
        let steps = core::iter::from_fn(|| street.online.step(&street.world.scene, places, WHOLE)).count();
        let pose = Pose::look_at(places[0], places[0] + DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, 0.05, 100.0).unwrap();
        street.online.cull(&street.world.scene, &view, &mut VisibleSet::new());
        (steps, street.online.answer().map(|cell| [cell.min.y, cell.max.y]))
    };
    // Asking beside did not pay in the boxes before: each box tries one direction again.
    assert_eq!(viewcell(&[DVec3::Y * 1.8]), (7, Some([1.5, 2.0])), "the wide box ends at 2 m");
    let (steps, ends) = viewcell(&[DVec3::NEG_Y * 1.9, DVec3::NEG_Y * 2.3]);
    assert_eq!(steps, 14, "too little of the viewcell is in the wide box, so that another is made");
    assert!(ends.is_some_and(|[low, high]| low < -2.0 && high > -1.9), "a whole viewcell: {ends:?}");
}

#[test]
fn what_moves_is_seen_at_once_and_hidden_again_at_rest() {
    let mut street = Street::new();
    street.make(0.0);
    assert_eq!(street.frame(0.0, 1), HIDDEN, "at rest");
    let moved = Aabb::from_arrays([25.0, 0.0, 0.0], [25.5, 0.5, 1.0]);
    street.world.scene.set_bounds(street.back, moved).unwrap();
    assert_eq!((street.frame(0.0, 1), street.online.came()), (ALL, &[street.back][..]), "it moved");
    assert_eq!(street.make(0.0), 0, "a mover that hides nothing costs no box");
    let inserted = street.world.add_target(moved);
    assert_eq!(street.frame(0.0, 1), ALL, "another comes");
    street.make(9.0);
    assert_eq!(street.frame(9.0, 1), HIDDEN, "the next wide box knows its place");
    let came: Vec<_> = street.online.came().to_vec();
    assert_eq!((came, street.online.went()), (vec![], &[street.back, inserted][..]), "both are out of sight");
}

#[test]
fn what_comes_and_goes_is_in_order_of_size_over_distance() {
    let mut street = Street::new();
    let mut post = |x: f32, size: f32| {
        let min = [x, 0.0, 0.0];
        street.world.add_target(Aabb::from_arrays(min, min.map(|at| at + size)))
    };
    // Ratios of diagonal to distance from the viewcell, which ends at x = 0.3: 0.026, 0.087, 0.052 and 0.087.
    let far = post(200.3, 3.0);
    let [near, middle, same] = [post(10.3, 0.5), post(20.3, 0.6), post(10.3, 0.5)];
    street.make(0.0);
    street.frame(0.0, 1);
    let expected = [near, same, street.back, middle, far];
    assert_eq!(street.online.went(), expected, "out of sight, the most important first");
    street.world.scene.set_origin(DVec3::splat(4.0)).unwrap();
    street.frame(0.0, 1);
    assert_eq!(street.online.came(), expected, "all come again, in coordinates of another origin");
    assert_eq!(street.online.went(), [], "none is out of sight");
}

#[test]
fn a_residency_drops_by_sets_that_are_made_and_nothing_while_they_are_late() {
    let mut street = Street::new();
    let (wall, front, back) = (street.wall, street.front, street.back);
    // Room for two of the three objects.
    let mut residency = Residency::new(20);
    let mut update = |street: &mut Street, x: f64| {
        let place = [DVec3::X * x - 0.05, DVec3::X * x + 0.05];
        residency.update(&street.world.scene, &mut street.online, &[u32::MAX], &[place], |_| 10, 100);
        let ids = |list: &[Transfer]| list.iter().map(|transfer| transfer.object).collect::<Vec<_>>();
        (ids(residency.loads()), ids(residency.drops()), residency.is_complete())
    };
    assert_eq!(update(&mut street, 0.0), (vec![wall, front], vec![], false), "all may be visible");
    street.make(0.0);
    assert_eq!(update(&mut street, 0.0), (vec![], vec![], true), "the post behind the wall is not needed");
    // Between the wall and the post behind it.
    assert_eq!(update(&mut street, 15.0), (vec![], vec![], false), "no box there: nothing is dropped");
    while street.online.step(&street.world.scene, &[DVec3::X * 15.0], WHOLE).is_some() {}
    assert_eq!(update(&mut street, 15.0), (vec![back], vec![front], true), "the posts change places");
    let before_eye = Aabb::from_arrays([12.0, 0.0, 0.0], [12.5, 0.5, 1.0]);
    street.world.scene.set_bounds(front, before_eye).unwrap();
    assert_eq!(update(&mut street, 15.0), (vec![], vec![], false), "what moves may be visible at once");
}

#[test]
fn what_moves_while_a_box_is_made_is_seen() {
    for budget in [WHOLE, 1] {
        let mut steps = 1;
        loop {
            let mut street = Street::new();
            let mut step = || street.online.step(&street.world.scene, &[DVec3::ZERO], budget).is_some();
            if !(0..steps).all(|_| step()) {
                break;
            }
            let near = Aabb::from_arrays([3.0, 2.0, 0.0], [3.5, 2.5, 1.0]);
            street.world.scene.set_bounds(street.back, near).unwrap();
            street.make(0.0);
            assert_eq!(street.frame(0.0, 1), ALL, "the post came before the wall after {steps} steps");
            steps += 1;
        }
        assert!(steps > if budget == 1 { 30 } else { 12 }, "{steps} steps of {budget} us");
    }
}

#[test]
fn small_steps_find_what_whole_directions_find() {
    let (mut rng, mut hidden, mut steps) = (Random(5), 0, [0; 2]);
    for number in 0..10 {
        let (mut world, _) = random_world(&mut rng, 1.0);
        (0..100).for_each(|_| change(&mut world, &mut rng, 1.0));
        let mut answer = |budget: u32| {
            let mut online = OnlinePvs::new(DVec3::splat(0.6), DVec3::new(4.0, 4.0, 1.0)).unwrap();
            let places = [DVec3::ZERO, DVec3::X];
            steps[usize::from(budget == 1)] +=
                core::iter::from_fn(|| online.step(&world.scene, &places, budget)).count();
            places.map(|place| online.hidden_from(&world.scene, place, place).unwrap().clone())
        };
        let [whole, small] = [WHOLE, 1].map(&mut answer);
        hidden += whole[1].count();
        assert_eq!(whole, small, "objects hidden in world {number}");
    }
    assert!(hidden > 100 && steps[1] > 20 * steps[0], "{hidden} hidden objects, {steps:?} steps");
}

#[test]
fn boxes_are_made_while_the_hierarchy_changes_at_each_step() {
    let Street { mut world, front, mut online, .. } = Street::new();
    let mut rng = Random(3);
    // Posts in front of the wall and behind it, which move to other places in the hierarchy.
    let posts: Vec<_> = (0..600)
        .map(|number| {
            let x = if number % 2 == 0 { 4.0 } else { rng.range(10.0, 30.0) as f32 };
            let [y, z] = [0, 1].map(|_| rng.range(-3.0, 3.0) as f32);
            (world.add_target(Aabb::from_arrays([x, y, z], [x + 0.1, y + 0.1, z + 0.1])), x < 5.0)
        })
        .collect();
    for (z, budget) in [(0.0, 1), (9.0, 1), (18.0, WHOLE)] {
        let mut steps = 0;
        while online.step(&world.scene, &[DVec3::Z * z], budget).is_some() {
            let away = 100.0 + (steps % 7) as f32;
            world.scene.set_bounds(front, Aabb::from_arrays([away; 3], [away + 1.0; 3])).unwrap();
            world.scene.rebuild();
            steps += 1;
            assert!(steps < 10_000, "a box at height {z} is made in {steps} steps of {budget} us");
        }
        let hidden = online.hidden_from(&world.scene, DVec3::Z * z, DVec3::Z * z).expect("a viewcell");
        for &(post, is_before) in &posts {
            assert_eq!(hidden.contains(post.index()), !is_before, "a post, seen from a height of {z} m");
        }
    }
}

#[test]
fn a_hierarchy_that_shrinks_while_a_viewcell_is_made_is_not_read() {
    for steps in 1..8 {
        let mut street = Street::new();
        let posts: Vec<_> = (0..6000)
            .map(|number| {
                let (y, z) = ((number % 77) as f32 * 0.1, (number / 77) as f32 * 0.1);
                street.world.add_target(Aabb::from_arrays([4.0, y, z], [4.1, y + 0.05, z + 0.05]))
            })
            .collect();
        while !street.online.step(&street.world.scene, &[DVec3::ZERO], WHOLE).unwrap().is_last {}
        for _ in 0..steps {
            street.online.step(&street.world.scene, &[DVec3::ZERO], 1).expect("a viewcell is missing");
        }
        street.world.scene.remove_batch(&posts).unwrap();
        street.world.scene.rebuild();
        street.make(0.0);
        assert_eq!(street.frame(0.0, 1), HIDDEN, "the hierarchy changed after {steps} steps");
    }
}

#[test]
fn what_is_flagged_but_has_no_mesh_costs_no_box_when_it_moves() {
    let mut street = Street::new();
    street.world.scene.set_occluder(street.back, true).unwrap();
    street.make(0.0);
    let moved = Aabb::from_arrays([25.0, 0.0, 0.0], [25.5, 0.5, 1.0]);
    street.world.scene.set_bounds(street.back, moved).unwrap();
    assert_eq!((street.make(0.0), street.frame(0.0, 1)), (0, ALL), "steps, and the frame after the move");
}

#[test]
fn a_wall_that_changes_hides_nothing_until_it_rests() {
    let mut street = Street::new();
    street.make(0.0);
    street.world.scene.set_cost(street.wall, 2).unwrap();
    assert_eq!((street.frame(0.0, 1), street.online.answer()), (ALL, None), "all boxes are forgotten");
    // Asking beside did not pay in the boxes before: each of the two tries one direction again.
    assert_eq!(street.make(0.0), 14, "both boxes are made anew");
    assert_eq!(street.frame(0.0, 1), ALL, "a mover is no occluder");
    street.world.scene.set_cost(street.wall, 3).unwrap();
    assert_eq!(street.make(0.0), 0, "a mover costs no boxes");
    for z in [9.0, 18.0] {
        street.make(z);
        assert_eq!(street.frame(z, 1), if z == 9.0 { ALL } else { HIDDEN }, "height {z}");
    }
    street.world.scene.remove(street.wall).unwrap();
    assert_eq!(street.frame(18.0, 1), [false, true, true], "a wall that is gone");
}

#[test]
fn a_view_that_does_not_draw_an_occluder_keeps_what_is_behind() {
    let mut street = Street::new();
    street.world.scene.set_layers(street.wall, 4).unwrap();
    street.world.scene.set_layers(street.back, 1).unwrap();
    for z in [0.0, 9.0, 18.0] {
        street.make(z);
    }
    assert_eq!(street.frame(18.0, 5), HIDDEN, "a view that draws the wall");
    assert_eq!(street.frame(18.0, 1), [false, true, true], "a view that leaves the wall out");
    let (mut hidden, eye) = (Bits::EMPTY, DVec3::new(0.0, 0.0, 18.0));
    for (layers, is_known) in
        [(&[5][..], true), (&[4, 5], true), (&[1], false), (&[5, 1], false), (&[], true)]
    {
        let known = street.online.write_hidden(&street.world.scene, layers, eye, eye, &mut hidden);
        assert_eq!(known, is_known, "views of the layers {layers:?}");
    }
    assert!(hidden.contains(street.back.index()), "the post behind the wall");
    assert!(street.online.hides_behind_undrawn(), "the wall is not asked for in the set");
}

#[test]
fn a_warm_frame_allocates_nothing() {
    let mut street = Street::new();
    street.make(0.0);
    let view = |y: f64| {
        let eye = DVec3::new(0.0, y, 0.0);
        View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 1.0, 1.0, 0.05, 100.0).unwrap()
    };
    let mut visible = VisibleSet::new();
    let mut frame = |y: f64| {
        visible.fill(&street.world.scene, &view(y));
        street.online.cull(&street.world.scene, &view(y), &mut visible);
        assert!(!visible.contains(&street.world.scene, street.back), "y = {y}: the post is behind the wall");
    };
    frame(0.0);
    let before = ALLOCATIONS.get();
    (0..20).for_each(|number| frame(0.001 * f64::from(number)));
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations in 20 warm frames");
}

#[test]
fn an_occluder_that_moved_after_a_wide_box_saw_it_hides_from_its_new_place() {
    let Street { mut world, wall, back, mut online, .. } = Street::new();
    let between = world.add_target(Aabb::from_arrays([10.0, 0.0, 0.0], [10.5, 0.5, 1.0]));
    let scene = &mut world.scene;
    let make_wide = |online: &mut OnlinePvs, scene: &Scene, z: f64| {
        let mut step = || online.step(scene, &[DVec3::Z * z], WHOLE).filter(|step| step.is_wide);
        while !step().expect("a wide box at this height is missing").is_last {}
    };
    assert!(online.hidden_from(scene, DVec3::ZERO, DVec3::ZERO).is_none(), "takes in the scene");
    // The wall has just changed, so the first wide box sees it and does not use it as an occluder.
    scene.set_cost(wall, 2).unwrap();
    make_wide(&mut online, scene, 0.0);
    let moved = Aabb::from_arrays([15.0, -30.0, -30.0], [15.2, 30.0, 30.0]);
    scene.set_bounds(wall, moved).unwrap();
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&moved).unwrap());
    scene.set_mesh(wall, mesh, Affine3A::IDENTITY).unwrap();
    // After two more wide boxes the wall is an occluder again.
    [9.0, 18.0].into_iter().for_each(|z| make_wide(&mut online, scene, z));
    let steps = core::iter::from_fn(|| online.step(scene, &[DVec3::ZERO], WHOLE)).count();
    assert_eq!(steps, 12, "the first wide box is kept, so a viewcell alone is made");
    let hidden = online.hidden_from(scene, DVec3::splat(-0.01), DVec3::splat(0.01)).expect("a viewcell");
    let hidden = [between, back].map(|id| hidden.contains(id.index()));
    assert_eq!(hidden, [false, true], "the wall is between the posts now");
}

#[test]
fn a_wall_of_a_level_that_has_moved_leaves_no_surface_behind() {
    let mut world = World::new();
    // Two walls that touch, with a post behind each.
    let [moving, _] =
        [[0.0, 30.0], [-30.0, 0.0]].map(|[y0, y1]| world.add_box([5.0, y0, -30.0], [5.2, y1, 30.0]));
    let posts = [2.0, -2.0].map(|y| world.add_target(Aabb::from_arrays([9.0, y, 0.0], [9.1, y + 0.1, 0.1])));
    let mut online = OnlinePvs::new(DVec3::splat(0.6), DVec3::new(4.0, 4.0, 1.0)).unwrap();
    let mut hidden = |scene: &Scene, z: f64| {
        while online.step(scene, &[DVec3::Z * z], WHOLE).is_some() {}
        let hidden = online.hidden_from(scene, DVec3::Z * z, DVec3::Z * z).expect("a viewcell");
        posts.map(|post| hidden.contains(post.index()))
    };
    assert_eq!(hidden(&world.scene, 0.0), [true, true], "behind both walls");
    let moved = Aabb::from_arrays([15.0, 0.0, -30.0], [15.2, 30.0, 30.0]);
    world.scene.set_bounds(moving, moved).unwrap();
    let mesh = world.scene.add_mesh(OccluderMesh::cuboid(&moved).unwrap());
    world.scene.set_mesh(moving, mesh, Affine3A::IDENTITY).unwrap();
    // At the third wide box the moved wall is an occluder again.
    for z in [0.0, 2.0, 4.0] {
        assert_eq!(hidden(&world.scene, z), [false, true], "one wall is away, at a height of {z} m");
    }
}

#[test]
fn what_is_hidden_comes_again_when_the_boxes_are_forgotten() {
    let mut street = Street::new();
    street.make(0.0);
    assert_eq!(street.frame(0.0, 1), HIDDEN, "at rest");
    street.world.scene.set_origin(DVec3::splat(4.0)).unwrap();
    assert_eq!((street.frame(0.0, 1), street.online.came()), (ALL, &[street.back][..]), "other coordinates");
}

#[test]
fn boxes_of_any_places_are_made_at_last() {
    let mut street = Street::new();
    for place in [1e15, 1e16, 1e300, f64::MAX, f64::NAN] {
        let places = [DVec3::splat(place), DVec3::splat(-place)];
        let steps =
            core::iter::from_fn(|| street.online.step(&street.world.scene, &places, WHOLE)).take(100).count();
        assert!(steps < 100, "boxes around places at {place} m are made in {steps} steps");
    }
}

#[test]
fn a_box_with_swapped_ends_has_no_answer() {
    let mut street = Street::new();
    street.make(0.0);
    let scene = &street.world.scene;
    let mut hidden_from = |min, max| street.online.hidden_from(scene, min, max).is_some();
    assert!(hidden_from(DVec3::splat(-0.01), DVec3::splat(0.01)), "a box in the viewcell");
    assert!(!hidden_from(DVec3::splat(0.01), DVec3::splat(-0.01)), "its ends are swapped");
    assert!(!hidden_from(DVec3::NAN, DVec3::NAN), "no numbers");
}

/// A field of posts behind a wall, of which one grows in the middle of a direction until its box reaches
/// behind the eyes, and with it the boxes of the nodes above.
#[test]
fn what_grows_past_the_box_while_it_is_made_hides_none_of_its_neighbours() {
    let (mut rng, mut world) = (Random(8), World::new());
    world.add_box([10.0, -10.0, -20.0], [10.2, 7.0, 20.0]);
    let posts: Vec<_> = (0..8200)
        .map(|number| {
            let [x, y] = [rng.range(22.0, 60.0) as f32, rng.range(-24.0, 24.0) as f32];
            // Few are tall; the others are well within the pixels that these need.
            let z = if number < 8 { 12.0 } else { 1.0 };
            let bounds = Aabb::from_arrays([x, y, -z], [x + 0.2, y + 0.2, z]);
            (world.add_target(bounds), bounds)
        })
        .collect();
    world.scene.rebuild();
    let eye = DVec3::new(-1.9, 1.9, 0.2);
    // The ray to the far end of a post passes the wall on the left.
    let is_seen = |post: &Aabb| {
        let ray = DVec3::new(post.max.x.into(), post.max.y.into(), 0.3) - eye;
        [10.0, 10.2].iter().all(|x| eye.y + ray.y * (x - eye.x) / ray.x > 7.0)
    };
    // Posts about the end of the wall's shadow.
    let is_beside = |x: f32, y: f32| x > 30.0 && (0.4..0.6).contains(&(y / x));
    let beside: Vec<_> = posts.iter().filter(|(_, b)| is_beside(b.min.x, b.min.y)).copied().collect();
    let mut hidden_posts = 0;
    for trial in 0..40 {
        let (mut scene, mut online) =
            (world.scene.clone(), OnlinePvs::new(DVec3::splat(0.2), DVec3::new(4.0, 4.0, 0.6)).unwrap());
        for _ in 0..trial % 10 {
            online.step(&scene, &[DVec3::ZERO], 1);
        }
        let (grown, bounds) = beside[rng.below(beside.len())];
        let (middle, half) = (bounds.center(), Vec3::new(rng.range(50.0, 99.0) as f32, 21.0, 0.5));
        scene.set_bounds(grown, Aabb::new(middle - half, middle + half)).unwrap();
        while online.step(&scene, &[DVec3::ZERO], 1).is_some() {}
        let hidden = online.hidden_from(&scene, eye, eye).expect("the wide box holds the eye");
        for (post, bounds) in &posts {
            let is_hidden = hidden.contains(post.index());
            assert!(!(is_hidden && is_seen(bounds)), "{bounds:?} is hidden, trial {trial}");
            hidden_posts += usize::from(is_hidden);
        }
    }
    assert!(hidden_posts > 10_000, "{hidden_posts} posts were hidden");
}

/// Viewcells of `OnlineCells` are objects on no layer.
#[test]
fn a_wide_box_asks_objects_on_no_layer() {
    let mut street = Street::new();
    let behind = Aabb::from_arrays([20.0, 0.0, 0.0], [20.5, 0.5, 1.0]);
    let cell = street.world.scene.insert(Object { layers: 0, ..Object::new(behind) });
    let scene = &street.world.scene;
    while !street.online.step(scene, &[DVec3::ZERO], WHOLE).expect("a wide box").is_last {}
    let place = DVec3::Y;
    let hidden = street.online.hidden_from(scene, place, place).expect("the wide box holds the place");
    assert!(hidden.contains(cell.index()), "the wall hides it");
}

#[test]
fn sizes_that_no_box_can_have_are_refused() {
    let [one, two] = [DVec3::ONE, DVec3::splat(2.0)];
    let of = |x: f64| DVec3::new(x, 1.0, 1.0);
    for (viewcell, wide) in
        [(two, one), (of(0.0), two), (of(-1.0), two), (of(f64::NAN), two), (one, of(f64::NAN))]
    {
        let error = OnlinePvs::new(viewcell, wide).expect_err("sizes");
        let sizes = [error.viewcell, error.wide].map(|v| v.to_string());
        assert_eq!(sizes, [viewcell, wide].map(|v| v.to_string()), "the error has the sizes");
    }
    assert!(OnlinePvs::new(one, of(f64::INFINITY)).is_err(), "an infinite wide box");
    assert!(OnlinePvs::new(one, one).is_ok(), "a viewcell as large as its wide box");
}
