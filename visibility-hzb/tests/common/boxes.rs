//! Helpers for tests of boxes against a finished occlusion map.

use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{
    Aabb, Accuracy, OccluderMesh, OcclusionMap, View,
    occlusion::{Occlusion, Occlusion64},
    scene::Boxes64,
};
use visibility_testing::Random;

/// A finished occlusion map whose [`test_64`](OcclusionMap::test_64) asserts that all answers are equal to
/// those of [`test`](OcclusionMap::test). The methods `begin`, `add` and `flush` do nothing.
pub struct Checked<M>(pub M);

impl<M: OcclusionMap> OcclusionMap for Checked<M> {
    fn name(&self) -> &str {
        "checked"
    }
    fn accuracy(&self) -> Accuracy {
        self.0.accuracy()
    }
    fn begin(&mut self, _: &View, _: DVec3) {}
    fn add(&mut self, _: &OccluderMesh, _: &Affine3A) {}
    fn flush(&mut self) {}
    fn test(&self, bounds: &Aabb) -> Occlusion {
        self.0.test(bounds)
    }
    fn test_64(&self, boxes: &Boxes64, candidates: u64) -> Occlusion64 {
        let answer = self.0.test_64(boxes, candidates);
        for lane in (0..64).filter(|lane| candidates >> lane & 1 != 0) {
            let own = match self.test(&boxes.get(lane)) {
                Occlusion::Hidden => (1, 0),
                Occlusion::Partial => (0, 0),
                Occlusion::Visible => (0, 1),
            };
            assert_eq!((answer.hidden >> lane & 1, answer.visible >> lane & 1), own, "{:?}", boxes.get(lane));
        }
        answer
    }
}

/// Returns the eight corners of a box and eight random points on its faces.
pub fn points(random: &mut Random, bounds: &Aabb) -> Vec<DVec3> {
    let mut points: Vec<Vec3> = bounds.corners().into();
    for _ in 0..8 {
        let mut p = bounds.min + (bounds.max - bounds.min) * random.vec3(0.0, 1.0);
        let axis = random.below(3);
        p[axis] = if random.below(2) == 0 { bounds.min[axis] } else { bounds.max[axis] };
        points.push(p);
    }
    points.into_iter().map(|p| p.as_dvec3()).collect()
}
