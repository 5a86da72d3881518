//! Helpers for tests of boxes against a finished occlusion map.

use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{
    Aabb, Accuracy, OccluderMesh, OcclusionMap, View,
    occlusion::{Occlusion, Occlusion64},
    scene::Boxes64,
};
use visibility_testing::Random;

use super::{Face, Occluder, Ray};

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

/// Returns huge, tiny or nearly degenerate triangles, for which rays are too imprecise. `None` if
/// [`OccluderMesh`] rejects the triangles.
pub fn extreme(random: &mut Random) -> Option<Occluder> {
    let scale = [1e-20, 1e-6, 1e3, 1e6, 1e12, 1e30][random.below(6)] as f32;
    let triangles: Vec<_> = (0..random.below(3) + 1)
        .map(|_| {
            let a = random.vec3(-1.0, 1.0) * scale;
            [a, random.vec3(-1.0, 1.0) * scale, a + random.vec3(-1.0, 1.0) * 1e-7 * scale]
        })
        .collect();
    let mesh = OccluderMesh::from_triangles(&triangles).ok()?;
    Some(Occluder { mesh: mesh.with_two_sided(random.below(2) == 0), transform: Affine3A::IDENTITY })
}

/// Returns a random box around a point within 9 m of the origin on each axis.
pub fn random_box(random: &mut Random) -> Aabb {
    let middle = random.vec3(-9.0, 9.0);
    let most = if random.below(4) == 0 { 3.0 } else { 0.4 };
    let half = random.vec3(0.0, most);
    Aabb::new(middle - half, middle + half)
}

/// Asserts that view rays to points of a hidden box meet one of `faces` in front of the box. Points outside
/// the picture, of `size` pixels, or nearer than the near plane cannot be seen and are skipped. Returns the
/// number of rays. `what` names the case in messages.
pub fn assert_hidden(
    random: &mut Random,
    view: &View,
    size: [usize; 2],
    bounds: &Aabb,
    faces: &[Face],
    what: &str,
) -> u64 {
    let (matrix, mut rays) = (view.clip_from(DVec3::ZERO), 0);
    for p in points(random, bounds) {
        let clip = matrix * p.extend(1.0);
        let (x, y) = (clip.x / clip.w, clip.y / clip.w);
        if clip.w <= 0.0 || x.abs() > 0.999_999 || y.abs() > 0.999_999 {
            continue;
        }
        let pixel = [(x + 1.0) * 0.5 * size[0] as f64, (1.0 - y) * 0.5 * size[1] as f64];
        let ray = Ray::new(view, size, pixel[0], pixel[1]);
        if ray.is_before_near(p) {
            continue;
        }
        rays += 1;
        let (own, met) = (ray.depth_key(p), ray.nearest(faces));
        assert!(
            met > own - 1e-6 * own.abs(),
            "{what}: {bounds:?} seen at {p}: met {met}, own {own}, {view:?}"
        );
    }
    rays
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
