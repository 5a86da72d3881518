//! Occlusion map that draws every occluder of a scene, for tests: more occluders are more likely to reveal an
//! error, and maps of different kinds are comparable if they contain the same occluders.

use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::{
    Aabb, Accuracy, OccluderMesh, OcclusionCuller, OcclusionMap, Scene, View,
    occlusion::{Occlusion, Occlusion64},
    scene::Boxes64,
};

/// Occlusion map that begins each frame by drawing all occluders of a scene, whatever the view.
pub(crate) struct AllOccluders<M> {
    map: M,
    occluders: Vec<(OccluderMesh, Affine3A)>,
}

/// Returns a culler that draws all occluders of `scene`, in their present state, into `map` in each frame.
pub(crate) fn all_occluders<M: OcclusionMap>(scene: &Scene, map: M) -> OcclusionCuller<AllOccluders<M>> {
    let occluders = scene.ids().filter_map(|id| scene.occluder(id));
    let occluders = occluders.map(|(mesh, transform)| (mesh.clone(), transform)).collect();
    OcclusionCuller::new(AllOccluders { map, occluders }).with_price(0)
}

impl<M: OcclusionMap> OcclusionMap for AllOccluders<M> {
    fn name(&self) -> &str {
        self.map.name()
    }

    fn accuracy(&self) -> Accuracy {
        self.map.accuracy()
    }

    fn begin(&mut self, view: &View, origin: DVec3) {
        self.map.begin(view, origin);
        self.occluders.iter().for_each(|(mesh, transform)| self.map.add(mesh, transform));
    }

    fn add(&mut self, _: &OccluderMesh, _: &Affine3A) {}

    fn flush(&mut self) {
        self.map.flush();
    }

    fn test(&self, bounds: &Aabb) -> Occlusion {
        self.map.test(bounds)
    }

    fn test_64(&self, boxes: &Boxes64, candidates: u64) -> Occlusion64 {
        self.map.test_64(boxes, candidates)
    }
}
