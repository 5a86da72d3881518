//! Tests that cullers of this crate give the results of fresh cullers after their scenes were swapped, mixed,
//! cloned, reverted or dropped.

use visibility_core::glam::DVec3;
use visibility_core::{Aabb, Culler, Pose, Scene, View, VisibleSet, scene::DrawRange};
use visibility_frame::backface::BackfaceCuller;
use visibility_frame::casters::{CasterCuller, Light};
use visibility_frame::lod::ContributionCuller;
use visibility_testing::swapped::{Swapped, hold_against_fresh};
use visibility_testing::{Random, judged, told_enough};

/// Culler of casters with a box of receivers, which is measured relative to the scene's origin at the time.
struct Casters;

impl Swapped for Casters {
    type Culler = CasterCuller;
    /// Least and greatest corner of the receivers in world coordinates.
    type Source = [DVec3; 2];

    fn derive(&self, _: &Scene, rng: &mut Random) -> [DVec3; 2] {
        let [a, b] = [rng.vector(8.0), rng.vector(8.0)];
        [a.min(b), a.max(b)]
    }

    fn make(&self, _: &[DVec3; 2]) -> CasterCuller {
        CasterCuller::new(Light::Point { position: DVec3::new(3.0, 2.0, 1.0), range: 9.0 }).unwrap()
    }

    fn give(&self, culler: &mut CasterCuller, receivers: &[DVec3; 2], scene: &Scene) {
        let [min, max] = receivers.map(|corner| (corner - scene.origin()).as_vec3());
        culler.set_receivers(Aabb::new(min, max), scene.origin());
    }
}

struct Backface;

impl Swapped for Backface {
    type Culler = BackfaceCuller;
    type Source = ();

    fn derive(&self, _: &Scene, _: &mut Random) {}

    fn make(&self, (): &()) -> BackfaceCuller {
        BackfaceCuller::new()
    }

    fn give(&self, culler: &mut BackfaceCuller, (): &(), scene: &Scene) {
        culler.sync(scene);
    }
}

/// Contribution culler of objects with draw ranges. It is reset when it is given its source: then it answers
/// like a fresh one. In other frames it keeps what a fresh one keeps, and what hysteresis keeps beside that.
struct Contribution;

impl Swapped for Contribution {
    type Culler = ContributionCuller;
    type Source = ();

    fn derive(&self, _: &Scene, _: &mut Random) {}

    fn make(&self, (): &()) -> ContributionCuller {
        ContributionCuller::new(100.0, 5.0)
    }

    fn give(&self, culler: &mut ContributionCuller, (): &(), _: &Scene) {
        culler.reset();
    }

    fn prepare(&self, scene: &mut Scene) {
        for id in scene.ids().collect::<Vec<_>>() {
            // Ranges by index, which a new object takes over from the one before: the bands of 5 % at their
            // ends hold many of the distances, which are up to 30 m.
            let begin = [0.0, 8.0, 12.0, 20.0][id.index() % 4];
            let range = DrawRange { begin, end: begin + 10.0, ..DrawRange::ALWAYS };
            if scene.draw_range(id).unwrap() != range {
                scene.set_draw_range(id, range).unwrap();
            }
        }
    }
}

fn hold<S: Swapped>(kind: &S, frames: usize) {
    let hidden: usize = (0..4).map(|seed| hold_against_fresh(kind, seed, frames)).sum();
    judged(hidden as u64);
    told_enough(hidden > frames, format_args!("{hidden} objects in {frames} frames are no test"));
}

#[test]
fn casters() {
    hold(&Casters, 300);
}

#[test]
fn contribution() {
    hold(&Contribution, 300);
}

/// Tests that the hysteresis of draw ranges belongs to one scene: it does not carry over to a clone, which
/// has the same ids.
#[test]
fn hysteresis_of_ranges_is_of_one_scene() {
    let mut scene = Scene::new();
    let id = scene.insert(Aabb::from_arrays([97.0, 0.0, 0.0], [98.0, 1.0, 1.0]));
    scene.set_draw_range(id, DrawRange { begin: 100.0, ..DrawRange::ALWAYS }).unwrap();
    let copy = scene.clone();
    let mut culler = ContributionCuller::new(100.0, 0.0);
    let mut sees = |scene: &Scene, x: f64| {
        let pose = Pose::look_at(DVec3::X * x, DVec3::X * 200.0, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, 0.1, 1e3).unwrap();
        let mut visible = VisibleSet::new();
        visible.fill(scene, &view);
        culler.cull(scene, &view, &mut visible);
        visible.contains(scene, id)
    };
    assert_eq!(
        [-9.0, 0.0].map(|x| sees(&scene, x)),
        [true, true],
        "the object is drawn beyond 100 m, and stays within the band"
    );
    assert!(!sees(&copy, 0.0), "in the clone, it begins at 100 m");
    assert!(!sees(&scene, 0.0), "the first scene counts as another again");
}

#[test]
fn backface() {
    hold(&Backface, 250);
}
