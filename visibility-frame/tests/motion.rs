//! Tests of motion volumes: no mover is missing that a scene with exact bounds in each frame would show.

use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::scene::{DrawRange, SharedTriangles};
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, FrustumCuller, Object, ObjectId, OccluderMesh, Pipeline, Pose, Scene,
    View, VisibleSet,
};
use visibility_frame::lod::ContributionCuller;
use visibility_frame::motion::{Motion, MotionVolumes};
use visibility_testing::Random;
use visibility_testing::allocations::ALLOCATIONS;

/// A wall in the plane x = 20 from y = -15 to 15, seen from an eye at the origin: hides boxes entirely behind
/// the wall.
struct Wall;

impl Culler for Wall {
    fn name(&self) -> &str {
        "wall"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn cull(&mut self, scene: &Scene, _: &View, visible: &mut VisibleSet) -> CullStats {
        visible.retain(scene, |_, bounds| {
            let behind = |c: Vec3| c.x > 20.0 && c.y.abs() < 0.75 * c.x;
            !bounds.corners().into_iter().all(behind)
        })
    }
}

/// A mover on a circle in the plane z = 0, whose exact position is known at every time.
#[derive(Clone, Copy)]
struct Orbit {
    center: DVec3,
    radius: f64,
    speed: f64,
    phase: f64,
}

impl Orbit {
    fn random(rng: &mut Random) -> Self {
        let center = DVec3::new(rng.range(-100.0, 150.0), rng.range(-100.0, 100.0), 0.0);
        let speed = rng.pick(&[0.0, 1.0, 5.0, 30.0]);
        Self { center, radius: rng.range(0.5, 30.0), speed, phase: rng.range(0.0, 6.0) }
    }

    fn at(&self, time: f64) -> Aabb {
        let angle = self.phase + time * self.speed / self.radius;
        let p = self.center + DVec3::new(angle.cos(), angle.sin(), 0.0) * self.radius;
        Aabb::new((p - 0.5).as_vec3(), (p + 0.5).as_vec3())
    }

    fn motion(&self, with_region: bool) -> Motion {
        let motion = Motion::new(self.speed as f32);
        let reach = self.radius + 0.6;
        let region = Aabb::new((self.center - reach).as_vec3(), (self.center + reach).as_vec3());
        if with_region { motion.within(region) } else { motion }
    }
}

fn view(time: f64) -> View {
    let toward = DVec3::new((time * 0.3).cos(), (time * 0.3).sin(), 0.0);
    View::perspective(Pose::look_at(DVec3::ZERO, toward, DVec3::Z), 0.9, 1.5, 0.1, 300.0).unwrap()
}

fn pipeline() -> Pipeline {
    Pipeline::new().with(FrustumCuller::new()).with(Wall)
}

/// Numbers of movers, summed over the frames of a run.
#[derive(Default)]
struct Outcome {
    updates: usize,
    seen: usize,
    shown: usize,
}

/// Runs `frames` frames from `first` on. Each frame is compared with the scene `exact`, in which all bounds
/// are exact.
fn run(
    orbits: &mut [(ObjectId, Orbit)],
    scene: &mut Scene,
    exact: &mut Scene,
    volumes: &mut MotionVolumes,
    frames: std::ops::Range<usize>,
    mut disturb: impl FnMut(&mut Scene, &mut [(ObjectId, Orbit)], usize, f64),
) -> Outcome {
    let (mut pipeline, mut visible) = (pipeline(), VisibleSet::new());
    let (mut due, mut seen, mut outcome) = (Vec::new(), Vec::new(), Outcome::default());
    for frame in frames {
        let time = frame as f64 / 60.0;
        disturb(scene, orbits, frame, time);
        volumes.begin_frame(scene, time, &mut due);
        outcome.updates += due.len();
        for id in &due {
            let (_, orbit) = orbits.iter().find(|(other, _)| other == id).unwrap();
            scene.set_bounds(*id, orbit.at(time)).unwrap();
        }
        pipeline.cull(scene, &view(time), &mut visible);
        volumes.end_frame(scene, &visible, &mut seen);
        outcome.seen += seen.len();
        for (id, orbit) in orbits.iter() {
            exact.set_bounds(*id, orbit.at(time)).unwrap();
        }
        let mut truth = VisibleSet::new();
        self::pipeline().cull(exact, &view(time), &mut truth);
        for (id, orbit) in orbits.iter() {
            let (held, bounds) = (scene.bounds(*id).unwrap(), orbit.at(time));
            assert!(
                held.min.cmple(bounds.min).all() && bounds.max.cmple(held.max).all(),
                "{held:?} {bounds:?}"
            );
            if truth.contains(exact, *id) {
                outcome.shown += 1;
                assert!(visible.contains(scene, *id), "{id} is seen too late in frame {frame}");
            }
        }
    }
    outcome
}

/// Makes movers, of which about one in two has a region if `regions` is set.
fn world(
    count: usize,
    rng: &mut Random,
    regions: bool,
) -> (Vec<(ObjectId, Orbit)>, Scene, Scene, MotionVolumes) {
    let (mut scene, mut volumes) = (Scene::new(), MotionVolumes::new());
    let orbits: Vec<Orbit> = (0..count).map(|_| Orbit::random(rng)).collect();
    let ids = scene.insert_batch(orbits.iter().map(|orbit| orbit.at(0.0)));
    let exact = scene.clone(); // with the same ids
    for (&id, orbit) in ids.iter().zip(&orbits) {
        volumes.insert(id, orbit.motion(regions && rng.one_in(2)));
    }
    (ids.into_iter().zip(orbits).collect(), scene, exact, volumes)
}

#[test]
fn no_mover_is_seen_too_late_and_most_updates_are_saved() {
    let mut rng = Random(31);
    let (mut orbits, mut scene, mut exact, mut volumes) = world(600, &mut rng, true);
    let outcome = run(&mut orbits, &mut scene, &mut exact, &mut volumes, 0..900, |_, _, _, _| {});
    let share = outcome.updates as f64 / (600.0 * 900.0);
    assert!(share < 0.35, "{share} of all updates are made");
    assert!(outcome.shown > 10_000 && outcome.seen > 500, "{} {}", outcome.shown, outcome.seen);
    // Each visible mover was updated or found seen, in each frame.
    assert!(
        outcome.updates + outcome.seen >= outcome.shown,
        "{} updated, {} found seen, {} shown",
        outcome.updates,
        outcome.seen,
        outcome.shown
    );
}

#[test]
fn teleports_other_scenes_and_time_that_jumps_lose_no_mover() {
    let mut rng = Random(37);
    let (mut orbits, mut scene, mut exact, mut volumes) = world(200, &mut rng, false);
    let mut other = Random(5);
    run(&mut orbits, &mut scene, &mut exact, &mut volumes, 0..400, |scene, orbits, frame, time| {
        if frame % 7 == 3 {
            let (id, orbit) = &mut orbits[other.below(200)];
            *orbit = Orbit { radius: orbit.radius, speed: orbit.speed, ..Orbit::random(&mut other) };
            scene.set_bounds(*id, orbit.at(time)).unwrap();
            if frame % 2 == 0 {
                // After this, the scene's log no longer lists the teleport.
                scene.set_origin(DVec3::ZERO).unwrap();
            }
        }
        if frame % 50 == 20 {
            *scene = scene.clone();
        }
    });
    for frames in [100..150, 20..60, 5000..5050] {
        run(&mut orbits, &mut scene, &mut exact, &mut volumes, frames, |_, _, _, _| {});
    }
}

#[test]
fn movers_that_are_in_no_scene_are_dropped_whenever_they_come() {
    let mut scene = Scene::new();
    let unit = Aabb::from_arrays([0.0; 3], [1.0; 3]);
    let [stays, goes] = [(); 2].map(|()| scene.insert(unit));
    let mut volumes = MotionVolumes::new();
    volumes.insert(stays, Motion::new(1.0));
    let (mut pipeline, mut visible) = (pipeline(), VisibleSet::new());
    let (mut due, mut seen) = (Vec::new(), Vec::new());
    for frame in 0..6 {
        match frame {
            1 => scene.remove(goes).unwrap(),
            2 => volumes.insert(goes, Motion::new(1.0)),
            4 => volumes.insert(ObjectId::PLACEHOLDER, Motion::new(1.0)),
            _ => {}
        }
        volumes.begin_frame(&mut scene, f64::from(frame), &mut due);
        assert!(due.iter().all(|&id| id == stays), "movers that are due in frame {frame}: {due:?}");
        assert_eq!(volumes.len(), 1, "movers in frame {frame}");
        let bounds: Vec<_> = due.iter().map(|&id| (id, unit)).collect();
        volumes.set_bounds_batch(&mut scene, &bounds).unwrap();
        pipeline.cull(&scene, &view(0.0), &mut visible);
        volumes.end_frame(&scene, &visible, &mut seen);
    }
}

#[test]
fn movers_without_a_volume_are_due_in_every_frame() {
    let mut scene = Scene::new();
    let far = Aabb::from_arrays([-900.0; 3], [-899.0; 3]);
    let ids = scene.insert_batch([far; 6]);
    let inside = Aabb::from_arrays([-1000.0; 3], [-800.0; 3]);
    let mut volumes = MotionVolumes::new();
    volumes.insert(ids[0], Motion::new(f32::NAN));
    volumes.insert(ids[1], Motion::new(-1.0));
    volumes.insert(ids[2], Motion::new(f32::INFINITY));
    volumes.insert(ids[3], Motion::new(f32::INFINITY).within(inside));
    volumes.insert(ids[4], Motion::new(1.0).within(Aabb::new(Vec3::NAN, Vec3::NAN)));
    // No object of any scene, with the greatest index that there is.
    volumes.insert(ObjectId::PLACEHOLDER, Motion::new(1.0));
    assert!(volumes.remove(ObjectId::PLACEHOLDER), "the mover with the greatest index");
    volumes.insert(ObjectId::PLACEHOLDER, Motion::new(1.0));
    let (mut pipeline, mut visible) = (pipeline(), VisibleSet::new());
    let (mut due, mut seen) = (Vec::new(), Vec::new());
    let mut counts = [0; 6];
    for frame in 0..100 {
        let time = f64::from(frame);
        volumes.begin_frame(&mut scene, time, &mut due);
        due.iter().for_each(|id| counts[id.index()] += 1);
        due.iter().for_each(|&id| scene.set_bounds(id, far).unwrap());
        pipeline.cull(&scene, &view(0.0), &mut visible);
        volumes.end_frame(&scene, &visible, &mut seen);
    }
    assert_eq!(counts[..3], [100; 3], "movers of unknown or infinite speed are due in each frame");
    assert!(counts[3] < 20 && counts[4] < 20 && counts[5] == 0, "{counts:?}");
    // Times that are NaN or stand still, while objects and movers are removed.
    for time in [f64::NAN, 100.0, 100.0, f64::INFINITY, f64::INFINITY, -5.0] {
        volumes.begin_frame(&mut scene, time, &mut due);
        assert!(due.len() >= 3, "time {time}: {} movers are due", due.len());
        volumes.end_frame(&scene, &visible, &mut seen);
    }
    scene.remove(ids[0]).unwrap();
    assert!(
        volumes.remove(ids[1]) && !volumes.remove(ids[1]) && !volumes.remove(ids[5]),
        "a mover is removed once"
    );
    volumes.begin_frame(&mut scene, 1.0, &mut due);
    assert!(
        volumes.len() == 3 && !due.contains(&ids[0]) && !due.contains(&ids[1]),
        "movers left, without the removed ones"
    );
    let again = scene.insert(far);
    assert_eq!(again.index(), ids[0].index(), "the new object takes the index of the old");
    volumes.insert(again, Motion::new(1.0));
    volumes.insert(again, Motion::new(2.0));
    volumes.begin_frame(&mut scene, 2.0, &mut due);
    assert_eq!(due.iter().filter(|&&id| id == again).count(), 1, "a mover inserted twice is due once");
    assert_eq!(volumes.len(), 4, "movers after one was inserted twice");
}

#[test]
fn frames_allocate_nothing_once_warm() {
    let mut rng = Random(41);
    let (orbits, mut scene, _, mut volumes) = world(5000, &mut rng, true);
    let (mut pipeline, mut visible) = (pipeline(), VisibleSet::new());
    let (mut due, mut seen, mut before) = (Vec::new(), Vec::new(), 0);
    for frame in 0..1500 {
        if frame == 1200 {
            before = ALLOCATIONS.get();
        }
        // Repeats the same motion while the clock runs on.
        let time = f64::from(frame) / 60.0;
        volumes.begin_frame(&mut scene, time, &mut due);
        for &id in &due {
            scene.set_bounds(id, orbits[id.index()].1.at(time)).unwrap();
        }
        scene.maintain(16);
        pipeline.cull(&scene, &view(time), &mut visible);
        volumes.end_frame(&scene, &visible, &mut seen);
    }
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations in 300 warm frames");
}

/// Tests movers that run straight at exactly their greatest speed: their bounds, rounded to f32 at both
/// times, stay within the volumes.
#[test]
fn volumes_hold_at_the_greatest_speed() {
    let mut rng = Random(43);
    for _ in 0..300 {
        let start = DVec3::new(-rng.range(1e3, 1e5), rng.range(-100.0, 100.0), rng.range(-100.0, 100.0));
        let speed = rng.range(0.0, 0.1) as f32;
        let side = rng.pick(&[DVec3::Y, DVec3::NEG_Y, DVec3::X, DVec3::Z]) * f64::from(speed);
        let at = |time: f64| {
            let center = start + side * time;
            Aabb::new((center - 0.3).as_vec3(), (center + 0.3).as_vec3())
        };
        let mut scene = Scene::new();
        let id = scene.insert(at(0.0));
        let mut volumes = MotionVolumes::new();
        volumes.insert(id, Motion::new(speed));
        let (mut pipeline, mut visible) = (pipeline(), VisibleSet::new());
        let (mut due, mut seen, mut updates) = (Vec::new(), Vec::new(), 0);
        for frame in 0..200 {
            let time = f64::from(frame) / 60.0;
            volumes.begin_frame(&mut scene, time, &mut due);
            due.iter().for_each(|&id| scene.set_bounds(id, at(time)).unwrap());
            updates += due.len();
            pipeline.cull(&scene, &view(0.0), &mut visible);
            volumes.end_frame(&scene, &visible, &mut seen);
            let (held, exact) = (scene.bounds(id).unwrap(), at(time));
            assert!(held.min.cmple(exact.min).all() && exact.max.cmple(held.max).all(), "{held:?} {exact:?}");
        }
        assert!(updates < 30, "{updates} updates in 200 frames of a mover behind the eye");
    }
}

/// Tests frames in which so many objects change that the scene's log does not list them.
#[test]
fn volumes_outlast_frames_in_which_most_objects_move() {
    for through_volumes in [false, true] {
        let (mut scene, mut volumes) = (Scene::new(), MotionVolumes::new());
        // Of three movers, two are in front of the eye and one is behind it.
        let at = |index: usize, time: f64| {
            let x = if index.is_multiple_of(3) { -1000.0 } else { 10.0 };
            let center = DVec3::new(x + time.sin(), 0.0, 0.0);
            Aabb::new((center - 0.5).as_vec3(), (center + 0.5).as_vec3())
        };
        let ids = scene.insert_batch((0..6000).map(|index| at(index, 0.0)));
        ids.iter().for_each(|&id| volumes.insert(id, Motion::new(1.0)));
        let (mut pipeline, mut visible) = (Pipeline::new().with(FrustumCuller::new()), VisibleSet::new());
        let (mut due, mut seen, mut hidden_due) = (Vec::new(), Vec::new(), 0);
        for frame in 0..200 {
            let time = f64::from(frame) / 60.0;
            volumes.begin_frame(&mut scene, time, &mut due);
            hidden_due += due.iter().filter(|id| id.index().is_multiple_of(3)).count();
            let mut moved: Vec<_> = due.iter().map(|&id| (id, at(id.index(), time))).collect();
            // The mover is hidden before and after: only the call below reveals the teleport.
            let teleported = (ids[3], Aabb::from_arrays([-1500.0; 3], [-1499.0; 3]));
            if frame == 150 {
                assert!(!due.contains(&ids[3]), "the teleport would be one of a due mover");
                moved.push(teleported);
            }
            if frame == 151 {
                assert!(
                    due.contains(&ids[3]) && due.len() < 4500,
                    "the teleported mover is due, and {} in all",
                    due.len()
                );
            }
            if through_volumes {
                volumes.set_bounds_batch(&mut scene, &moved).unwrap();
            } else {
                scene.set_bounds_batch(&moved).unwrap();
            }
            pipeline.cull(&scene, &view(0.0), &mut visible);
            assert!(visible.contains(&scene, ids[1]), "frame {frame}: a mover before the eye is hidden");
            volumes.end_frame(&scene, &visible, &mut seen);
            assert!(frame == 0 || due.contains(&ids[1]), "a visible mover is due in every frame");
        }
        assert!(hidden_due < 2000 * 20, "{hidden_due} updates of 400,000 for what is hidden");
    }
}

/// A mover behind the camera stays in its place in the world while the origin moves past it: it must be due
/// and visible.
#[test]
fn a_mover_behind_a_moved_origin_is_due_and_visible() {
    let world = DVec3::new(-500.0, 0.0, 0.0);
    let mut scene = Scene::new();
    let at = |origin: DVec3| Aabb::from_world(world, world + 1.0, origin);
    let mover = scene.insert(at(DVec3::ZERO));
    let mut volumes = MotionVolumes::new();
    volumes.insert(mover, Motion::new(2.0));
    let (mut pipeline, mut visible) = (Pipeline::new().with(FrustumCuller::new()), VisibleSet::new());
    let (mut due, mut seen) = (Vec::new(), Vec::new());
    for frame in 0..12 {
        if frame == 10 {
            assert!(due.is_empty(), "the mover has a volume before the origin moves");
            scene.set_origin(DVec3::X * 1000.0).unwrap();
        }
        volumes.begin_frame(&mut scene, f64::from(frame) / 60.0, &mut due);
        let moved: Vec<_> = due.iter().map(|&id| (id, at(scene.origin()))).collect();
        volumes.set_bounds_batch(&mut scene, &moved).unwrap();
        let towards = if frame < 10 { DVec3::X } else { DVec3::NEG_X };
        let pose = Pose::look_at(DVec3::ZERO, towards, DVec3::Z);
        pipeline.cull(&scene, &View::perspective(pose, 1.0, 1.0, 0.1, 1e4).unwrap(), &mut visible);
        volumes.end_frame(&scene, &visible, &mut seen);
        assert_eq!(visible.contains(&scene, mover), frame >= 10, "frame {frame}");
    }
    assert_eq!(due, [mover], "the visible mover is due");
}

/// A region belongs to the origin that it was given for: after a move of the origin, it must not restrict
/// volumes.
#[test]
fn regions_do_not_outlast_the_origin() {
    let mut scene = Scene::new();
    let at = |x: f64, origin: DVec3| Aabb::from_world(DVec3::X * x, DVec3::X * x + 1.0, origin);
    let mover = scene.insert(at(-500.0, DVec3::ZERO));
    let mut volumes = MotionVolumes::new();
    // The region is from -530 to -470 along x, relative to the origin that it is given for.
    let region = |origin: DVec3| Aabb::from_world(DVec3::X * -530.0 - 9.0, DVec3::X * -470.0 + 9.0, origin);
    volumes.insert(mover, Motion::new(1.0).within(region(DVec3::ZERO)));
    let (mut pipeline, mut visible) = (Pipeline::new().with(FrustumCuller::new()), VisibleSet::new());
    let (mut due, mut seen) = (Vec::new(), Vec::new());
    let mut run = |volumes: &mut MotionVolumes, scene: &mut Scene, frames: std::ops::Range<u32>| {
        let mut updates = 0;
        for frame in frames {
            let time = f64::from(frame);
            volumes.begin_frame(scene, time, &mut due);
            updates += due.len();
            let origin = scene.origin();
            due.iter().for_each(|&id| scene.set_bounds(id, at(-500.0 + 0.9 * time, origin)).unwrap());
            pipeline.cull(scene, &view(0.0), &mut visible);
            volumes.end_frame(scene, &visible, &mut seen);
            let (held, exact) = (scene.bounds(mover).unwrap(), at(-500.0 + 0.9 * time, origin));
            assert!(held.min.cmple(exact.min).all() && exact.max.cmple(held.max).all(), "frame {frame}");
        }
        updates
    };
    run(&mut volumes, &mut scene, 0..15);
    // The coordinates of the mover are still within those of the region, which now ends 4 m ahead of it.
    scene.set_origin(DVec3::X * -20.0).unwrap();
    run(&mut volumes, &mut scene, 15..33);
    // A region given after the origin has moved counts, even before the next frame.
    scene.set_origin(DVec3::ZERO).unwrap();
    volumes.insert(mover, Motion::new(f32::INFINITY).within(region(DVec3::ZERO)));
    assert!(
        run(&mut volumes, &mut scene, 33..43) < 10,
        "a mover with a new region is due in too many frames"
    );
}

/// Movers with positions in `f64` world coordinates, in scenes whose origin moves between any two calls.
struct MovedOrigin {
    scene: Scene,
    volumes: MotionVolumes,
    /// Id, position in the world at time 0, velocity, and whether the mover has a region.
    movers: Vec<(ObjectId, DVec3, DVec3, bool)>,
    /// Whether the origin has moved since due movers were last listed.
    is_moved: bool,
}

impl MovedOrigin {
    fn at(place: DVec3, velocity: DVec3, time: f64) -> [DVec3; 2] {
        [place + velocity * time - 0.5, place + velocity * time + 0.5]
    }

    /// Moves the origin in one of several ways, or does nothing. Bounds keep their coordinates unless they
    /// are set: then to the mover's place in the world, or to equal coordinates.
    fn disturb(&mut self, rng: &mut Random, time: f64) {
        if !rng.one_in(12) {
            return;
        }
        let old = self.scene.origin();
        match rng.below(6) {
            0 => {
                let far = rng.pick(&[20.0, 20.0, 2000.0]);
                self.scene.set_origin(old + rng.vector(far)).unwrap();
            }
            // The origin moves by an amount that rounds both origin and coordinates.
            1 => self.scene.set_origin(old + rng.vector(1e-4) + rng.pick(&[0.0, 1e7, -1e7])).unwrap(),
            // The origin moves there and back, and the bounds of some movers are set in between.
            2 => {
                self.scene.set_origin(old + rng.vector(500.0)).unwrap();
                self.set_some(rng, time);
                self.scene.set_origin(old).unwrap();
            }
            3 => {
                self.scene = self.scene.clone();
                self.scene.set_origin(rng.vector(300.0)).unwrap();
            }
            // All movers are set to their old coordinates: the world moves along.
            4 => {
                self.scene.set_origin(rng.vector(300.0)).unwrap();
                let same: Vec<_> =
                    self.movers.iter().map(|&(id, ..)| (id, self.scene.bounds(id).unwrap())).collect();
                self.scene.set_bounds_batch(&same).unwrap();
            }
            // Coordinates are set so that all movers keep their places in the world.
            _ => {
                self.scene.set_origin(rng.vector(300.0)).unwrap();
                let shift = (old - self.scene.origin()).as_vec3();
                for &(id, ..) in &self.movers {
                    let Aabb { min, max, .. } = self.scene.bounds(id).unwrap();
                    self.scene.set_bounds(id, Aabb::new(min + shift, max + shift)).unwrap();
                }
            }
        }
        if rng.one_in(2) {
            // The caller gives new regions after the move, relative to the new origin.
            self.insert_movers(time);
        }
        self.is_moved = true;
    }

    fn insert_movers(&mut self, time: f64) {
        let origin = self.scene.origin();
        for &(id, place, velocity, has_region) in &self.movers {
            if has_region {
                let [low, high] = Self::at(place, velocity, time);
                let region = Aabb::from_world(low - 40.0, high + 40.0, origin);
                self.volumes.insert(id, Motion::new(f32::INFINITY).within(region));
            } else {
                self.volumes.insert(id, Motion::new(velocity.length() as f32 * 1.01 + 1e-3));
            }
        }
    }

    fn set_some(&mut self, rng: &mut Random, time: f64) {
        for &(id, place, velocity, _) in &self.movers {
            if rng.one_in(2) {
                let [low, high] = Self::at(place, velocity, time);
                self.scene.set_bounds(id, Aabb::from_world(low, high, self.scene.origin())).unwrap();
            }
        }
    }

    /// Sets the exact bounds of the due movers.
    fn set(&mut self, due: &[ObjectId], time: f64, through_volumes: bool) {
        let origin = self.scene.origin();
        let of = |id: &ObjectId| self.movers.iter().find(|mover| mover.0 == *id).unwrap();
        let moved: Vec<_> = due
            .iter()
            .map(of)
            .map(|&(id, place, velocity, _)| {
                let [low, high] = Self::at(place, velocity, time);
                (id, Aabb::from_world(low, high, origin))
            })
            .collect();
        if through_volumes {
            self.volumes.set_bounds_batch(&mut self.scene, &moved).unwrap();
        } else {
            moved.iter().for_each(|&(id, bounds)| self.scene.set_bounds(id, bounds).unwrap());
        }
    }
}

/// Runs movers while the origin moves between any two calls. In every frame in which the origin stayed from
/// [`MotionVolumes::begin_frame`] on, the bounds of each mover contain its place in the world: compared in
/// `f64`. Returns the number of bounds compared and of those that were not due.
fn run_moved_origins(seed: u64, frames: usize) -> (usize, usize) {
    let mut rng = Random(seed);
    let mut world = MovedOrigin {
        scene: Scene::new(),
        volumes: MotionVolumes::new(),
        movers: Vec::new(),
        is_moved: false,
    };
    for _ in 0..20 {
        let (place, has_region) = (rng.vector(200.0), rng.one_in(3));
        // In 1,000 frames a mover with a region moves by less than the 40 m to the sides of the region.
        let velocity = rng.vector(1.0) * rng.pick(if has_region { &[0.0, 1.0] } else { &[1.0, 10.0] });
        let [low, high] = MovedOrigin::at(place, velocity, 0.0);
        let id = world.scene.insert(Aabb::from_world(low, high, DVec3::ZERO));
        world.movers.push((id, place, velocity, has_region));
    }
    world.insert_movers(0.0);
    let (mut pipeline, mut visible) = (Pipeline::new().with(FrustumCuller::new()), VisibleSet::new());
    let (mut due, mut seen, mut compared, mut saved) = (Vec::new(), Vec::new(), 0, 0);
    for frame in 0..frames {
        let time = frame as f64 / 60.0;
        world.disturb(&mut rng, time);
        world.volumes.begin_frame(&mut world.scene, time, &mut due);
        world.is_moved = false;
        world.disturb(&mut rng, time);
        world.set(&due, time, rng.one_in(2));
        world.disturb(&mut rng, time);
        let eye = DVec3::new(0.0, 0.0, 1e4);
        let pose = Pose::look_at(eye, eye + DVec3::Z, DVec3::X);
        pipeline.cull(&world.scene, &View::perspective(pose, 1.0, 1.0, 0.1, 1e4).unwrap(), &mut visible);
        for &(id, place, velocity, _) in world.movers.iter().filter(|_| !world.is_moved) {
            let (held, origin) = (world.scene.bounds(id).unwrap(), world.scene.origin());
            let [low, high] = MovedOrigin::at(place, velocity, time);
            let is_held = (held.min.as_dvec3() + origin).cmple(low + 1e-6).all()
                && (held.max.as_dvec3() + origin).cmpge(high - 1e-6).all();
            assert!(is_held, "seed {seed}, frame {frame}: {id} is not within its bounds");
            (compared, saved) = (compared + 1, saved + usize::from(!due.contains(&id)));
        }
        world.disturb(&mut rng, time);
        world.volumes.end_frame(&world.scene, &visible, &mut seen);
    }
    (compared, saved)
}

#[test]
fn movers_are_within_their_bounds_wherever_the_origin_moves() {
    let (mut compared, mut saved) = (0, 0);
    for seed in 0..60 {
        let (all, not_due) = run_moved_origins(seed, 200);
        (compared, saved) = (compared + all, saved + not_due);
    }
    assert!(compared > 100_000 && saved > compared / 8, "{saved} of {compared}");
}

#[test]
#[ignore = "a minute"]
fn movers_are_within_their_bounds_wherever_the_origin_moves_in_long_runs() {
    for seed in 100..1500 {
        let _ = run_moved_origins(seed, 1000);
    }
}

/// A mover behind the camera whose volume could come near, but which stays beyond the begin of its draw
/// range: it is visible as soon as the camera turns to it.
#[test]
fn no_volume_is_nearer_than_the_begin_of_a_draw_range() {
    let mut scene = Scene::new();
    let bounds = Aabb::from_arrays([-31.0, -1.0, -1.0], [-30.0, 1.0, 1.0]);
    let mover = scene.insert(bounds);
    scene.set_draw_range(mover, DrawRange { begin: 10.0, ..DrawRange::ALWAYS }).unwrap();
    let mut volumes = MotionVolumes::new();
    volumes.insert(mover, Motion::new(1.0));
    let toward = |x: f64| {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X * x, DVec3::Z);
        View::perspective(pose, 1.0, 1.0, 0.1, 100.0).unwrap()
    };
    let (mut due, mut seen) = (Vec::new(), Vec::new());
    for frame in 0..60 {
        volumes.begin_frame(&mut scene, f64::from(frame), &mut due);
        let moved: Vec<_> = due.iter().map(|&id| (id, bounds)).collect();
        volumes.set_bounds_batch(&mut scene, &moved).unwrap();
        let shows = |x| {
            let culler = ContributionCuller::new(1080.0, 0.0);
            let mut visible = VisibleSet::new();
            Pipeline::new().with(FrustumCuller::new()).with(culler).cull(&scene, &toward(x), &mut visible);
            visible
        };
        assert!(shows(-1.0).contains(&scene, mover), "frame {frame}: the mover is 30 m away");
        volumes.end_frame(&scene, &shows(1.0), &mut seen);
    }
}

/// Movers that must never get a volume: one whose HLOD parent measures the end of its draw range, one that is
/// moved by its transform, and one with an occluder mesh. All are due in each frame, and keep what they have.
#[test]
fn movers_with_parents_or_shapes_get_no_volume() {
    let mut scene = Scene::new();
    let bounds = Aabb::from_arrays([190.0, 3.5, 0.0], [191.0, 4.5, 2.0]);
    let block = scene.insert(Aabb::from_arrays([0.0, -5.0, 0.0], [200.0, 5.0, 20.0]));
    scene.set_draw_range(block, DrawRange { begin: 128.0, ..DrawRange::ALWAYS }).unwrap();
    let movers = scene.insert_batch((0..6).map(|_| Object { occluder: true, ..Object::new(bounds) }));
    let [child, parent, local, meshed, drawn, plain] = movers[..] else { unreachable!("six movers") };
    let outside = scene.insert(Aabb::from_arrays([192.0, 3.5, 0.0], [193.0, 4.5, 2.0]));
    scene.set_hlod_parent(outside, Some(parent)).unwrap();
    let triangle = [bounds.min, bounds.max, bounds.center()];
    scene.set_triangles(drawn, SharedTriangles::from([triangle])).unwrap();
    scene.set_draw_range(child, DrawRange { end: 128.0, ..DrawRange::ALWAYS }).unwrap();
    scene.set_hlod_parent(child, Some(block)).unwrap();
    scene.set_local_bounds(local, bounds).unwrap();
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
    scene.set_mesh(meshed, mesh, Affine3A::IDENTITY).unwrap();
    let mut volumes = MotionVolumes::new();
    movers.iter().for_each(|&id| volumes.insert(id, Motion::new(1.5)));
    let (eye, mut due, mut seen) = (DVec3::new(10.0, 0.0, 1.0), Vec::new(), Vec::new());
    for frame in 0..60 {
        volumes.begin_frame(&mut scene, f64::from(frame), &mut due);
        assert!(movers[..5].iter().all(|id| due.contains(id)), "frame {frame}: only {due:?} are due");
        let set: Vec<_> = due.iter().filter(|&&id| id != local).map(|&id| (id, bounds)).collect();
        volumes.set_bounds_batch(&mut scene, &set).unwrap();
        assert!(scene.set_transform(local, Affine3A::IDENTITY).is_ok() && scene.has_mesh(meshed), "kept");
        let cull = |toward: f64| {
            let pose = Pose::look_at(eye, eye + DVec3::X * toward, DVec3::Z);
            let view = View::perspective(pose, 1.0, 1.0, 0.1, 500.0).unwrap();
            let (culler, mut visible) = (ContributionCuller::new(1080.0, 0.0), VisibleSet::new());
            Pipeline::new().with(FrustumCuller::new()).with(culler).cull(&scene, &view, &mut visible);
            visible
        };
        assert!(movers.iter().all(|&id| cull(1.0).contains(&scene, id)), "frame {frame}: all are in view");
        volumes.end_frame(&scene, &cull(-1.0), &mut seen);
    }
    assert_ne!(scene.bounds(plain), Ok(bounds), "a mover with bounds alone has a volume");
}

/// A mover that gets a draw range while it has a volume is due again, though the scene's log has lost the
/// change.
#[test]
fn a_mover_loses_its_volume_by_a_change_that_the_log_has_lost() {
    let mut scene = Scene::new();
    let bounds = Aabb::from_arrays([-31.0, -1.0, -1.0], [-30.0, 1.0, 1.0]);
    let mover = scene.insert(bounds);
    let mut volumes = MotionVolumes::new();
    volumes.insert(mover, Motion::new(1.0));
    let (mut nothing, mut due, mut seen) = (VisibleSet::new(), Vec::new(), Vec::new());
    nothing.retain(&scene, |_, _| false);
    for frame in 0..3 {
        volumes.begin_frame(&mut scene, f64::from(frame), &mut due);
        let set: Vec<_> = due.iter().map(|&id| (id, bounds)).collect();
        volumes.set_bounds_batch(&mut scene, &set).unwrap();
        volumes.end_frame(&scene, &nothing, &mut seen);
    }
    assert!(due.is_empty() && scene.bounds(mover) != Ok(bounds), "the mover has a volume");
    scene.set_draw_range(mover, DrawRange { begin: 10.0, ..DrawRange::ALWAYS }).unwrap();
    scene.insert_batch((0..3000).map(|_| bounds));
    volumes.begin_frame(&mut scene, 3.0, &mut due);
    assert_eq!(due, [mover], "the mover may have no volume any more");
}
