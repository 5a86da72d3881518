//! Tests that cullers of this crate give the results of fresh cullers after their scenes and shared data were
//! swapped, mixed, cloned, reverted or dropped.

use std::sync::Arc;
use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, OcclusionCuller, Scene,
    pvs::{Pvs, PvsCuller, PvsTargets, ScenePvs, Viewcell, Viewcells},
    scene::SceneCursor,
    walk::{BoxHierarchy, Child},
};
use visibility_testing::swapped::{Swapped, hold_against_fresh};
use visibility_testing::{Octree, PlainMap, Random, judged, told_enough};

/// A PVS culler over eight random viewcells, whose targets are objects by index.
struct Sets;

impl Swapped for Sets {
    type Culler = PvsCuller<Arc<ScenePvs>>;
    type Source = Arc<ScenePvs>;

    fn derive(&self, scene: &Scene, rng: &mut Random) -> Arc<ScenePvs> {
        let count = scene.index_limit() as u32;
        let rows: Vec<Vec<u32>> = (0..8).map(|_| (0..count).filter(|_| rng.one_in(3)).collect()).collect();
        let pvs = Pvs::new(PvsTargets::Objects, count as usize, &rows, |_| []).unwrap();
        let half = rng.range(10.0, 30.0);
        let viewcells = (0..8).map(|i| {
            let min = DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * half - half;
            Viewcell::from_box(min, min + half)
        });
        let pairs = scene.ids().map(|id| (id, id.index() as u32));
        Arc::new(ScenePvs::new(scene, pvs, Viewcells::new(viewcells), pairs))
    }

    fn make(&self, sets: &Arc<ScenePvs>) -> Self::Culler {
        PvsCuller::new(sets.clone())
    }

    fn give(&self, culler: &mut Self::Culler, sets: &Arc<ScenePvs>, _: &Scene) {
        *culler.shared_mut() = sets.clone();
    }
}

/// Work limit of a frame at which the search for occluders ends before it has come to all walls of the
/// harness: they are ten boxes, and half of the work is kept for tests.
const SCARCE_WORK: u32 = 100;

/// The occlusion driver over a plain depth map, with a limit on the work of a frame. Objects that remain with
/// all occluders drawn must not be hidden.
struct Occlusion(u32);

impl Swapped for Occlusion {
    type Culler = OcclusionCuller<PlainMap>;
    type Source = ();

    fn derive(&self, _: &Scene, _: &mut Random) {}

    fn make(&self, (): &()) -> Self::Culler {
        OcclusionCuller::new(PlainMap::new(18, 12)).with_work_limit(self.0)
    }

    fn give(&self, _: &mut Self::Culler, (): &(), _: &Scene) {}

    fn truth(&self, (): &()) -> Self::Culler {
        OcclusionCuller::new(PlainMap::new(18, 12)).with_price(u32::MAX)
    }
}

/// An octree that lists nothing for another scene, or once its scene has changed.
#[derive(Clone)]
struct DatedOctree(Arc<Octree>, SceneCursor);

impl BoxHierarchy for DatedOctree {
    fn for_each_child(&self, scene: &Scene, node: Option<usize>, each: &mut dyn FnMut(Child, Aabb)) {
        if self.1.is_current(scene) {
            self.0.for_each_child(scene, node, each);
        }
    }
}

/// The driver over another hierarchy, with a limit on the work of a frame.
struct ForeignHierarchy(u32);

impl Swapped for ForeignHierarchy {
    type Culler = OcclusionCuller<PlainMap, DatedOctree>;
    type Source = DatedOctree;

    fn derive(&self, scene: &Scene, _: &mut Random) -> DatedOctree {
        DatedOctree(Arc::new(Octree::new(scene, 4)), SceneCursor::at(scene))
    }

    fn make(&self, octree: &DatedOctree) -> Self::Culler {
        OcclusionCuller::over(PlainMap::new(18, 12), octree.clone()).with_work_limit(self.0)
    }

    fn give(&self, culler: &mut Self::Culler, octree: &DatedOctree, _: &Scene) {
        *culler.hierarchy_mut() = octree.clone();
    }
}

fn hold<S: Swapped>(kind: &S, frames: usize) {
    let hidden: usize = (0..4).map(|seed| hold_against_fresh(kind, seed, frames)).sum();
    judged(hidden as u64);
    told_enough(hidden > frames, format_args!("{hidden} objects in {frames} frames are no test"));
}

#[test]
fn pvs() {
    hold(&Sets, 1000);
}

#[test]
fn occlusion() {
    hold(&Occlusion(u32::MAX), 150);
    hold(&Occlusion(SCARCE_WORK), 150);
}

#[test]
fn occlusion_over_another_hierarchy() {
    hold(&ForeignHierarchy(u32::MAX), 50);
    hold(&ForeignHierarchy(SCARCE_WORK), 50);
}
