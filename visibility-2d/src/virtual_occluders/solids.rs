//! Upright convex solids of a scene as rings on the plan, updated when the scene changes.

use crate::horizon::{Post, Solids, UpAxis, convex_hull};
use alloc::vec::Vec;
use visibility_core::Scene;
use visibility_core::scene::SceneCursor;

/// Convex solids of all occluders of a scene that are [always drawn](Scene::is_always_drawn). Each is a ring
/// of posts, the corners of its hull on the plan.
#[derive(Clone, Debug)]
pub(crate) struct PlanSolids {
    up: UpAxis,
    cursor: SceneCursor,
    pub(crate) solids: Vec<PlanSolid>,
    posts: Vec<Post>,
}

/// Convex solid of an occluder.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlanSolid {
    /// Index of the object in the scene.
    pub(crate) object: u32,
    first: u32,
    count: u32,
    /// Bound in metres on the distance between each post and a point of the exact solid. 0 if the hull of the
    /// posts is inside the solid.
    pub(crate) error: f64,
    /// Greatest distance in metres, rounded, between a vertex of the solid and the post that stands for it.
    pub(crate) moved: f64,
    /// Least corner of the bounds on the plan, in metres.
    pub(crate) min: [f64; 2],
    /// Greatest corner of the bounds on the plan, in metres.
    pub(crate) max: [f64; 2],
    /// Greatest height of a post, in metres.
    pub(crate) high: f64,
}

impl PlanSolids {
    pub(crate) const fn new(up: UpAxis) -> Self {
        Self { up, cursor: SceneCursor::START, solids: Vec::new(), posts: Vec::new() }
    }

    pub(crate) fn up(&self) -> UpAxis {
        self.up
    }

    /// Returns the posts of a solid, counter-clockwise: the corners of its hull on the plan.
    pub(crate) fn ring(&self, solid: &PlanSolid) -> &[Post] {
        &self.posts[solid.first as usize..][..solid.count as usize]
    }

    /// Finds the solids again if the scene has changed.
    pub(crate) fn sync(&mut self, scene: &Scene) {
        if self.cursor.is_current(scene) {
            return;
        }
        self.cursor = SceneCursor::at(scene);
        self.solids.clear();
        self.posts.clear();
        let (mut found, mut plan) = (Solids::default(), Vec::new());
        for id in scene.ids() {
            let Some((mesh, ref transform)) = scene.occluder(id).filter(|_| scene.is_always_drawn(id)) else {
                continue;
            };
            found.clear();
            found.add_mesh(mesh, transform, self.up, false);
            for solid in &found.solids {
                self.add(id.index() as u32, found.posts(solid), [solid.error, solid.moved], &mut plan);
            }
        }
    }

    fn add(&mut self, object: u32, posts: &[Post], [error, moved]: [f64; 2], plan: &mut Vec<[f64; 2]>) {
        plan.clear();
        plan.extend(posts.iter().map(|post| [post.x, post.y]));
        plan.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        plan.dedup();
        let hull = convex_hull(plan);
        let first = self.posts.len();
        if hull.len() < 3 || first > u32::MAX as usize - hull.len() {
            return;
        }
        let at = |p: &[f64; 2]| posts.iter().find(|post| post.x == p[0] && post.y == p[1]);
        self.posts.extend(hull.iter().filter_map(at));
        let fold =
            |f: fn(f64, f64) -> f64, start: f64, of: fn(&Post) -> f64| posts.iter().map(of).fold(start, f);
        self.solids.push(PlanSolid {
            object,
            first: first as u32,
            count: (self.posts.len() - first) as u32,
            error,
            moved,
            min: [fold(f64::min, f64::INFINITY, |p| p.x), fold(f64::min, f64::INFINITY, |p| p.y)],
            max: [fold(f64::max, f64::NEG_INFINITY, |p| p.x), fold(f64::max, f64::NEG_INFINITY, |p| p.y)],
            high: fold(f64::max, f64::NEG_INFINITY, |p| p.high),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::{Affine3A, Vec3};
    use visibility_core::scene::Triangle;
    use visibility_core::{Aabb, Object, OccluderMesh};

    fn solids_of(mesh: OccluderMesh, transform: Affine3A) -> PlanSolids {
        let mut scene = Scene::new();
        let bounds = Aabb::from_arrays([-1e7; 3], [1e7; 3]);
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        let mesh = scene.add_mesh(mesh);
        scene.set_mesh(id, mesh, transform).unwrap();
        let mut solids = PlanSolids::new(UpAxis::Z);
        solids.sync(&scene);
        solids
    }

    /// An upright prism over a ring of points of the plan.
    fn prism(ring: &[[f32; 2]]) -> OccluderMesh {
        let at = |i: usize, z: f32| Vec3::new(ring[i % ring.len()][0], ring[i % ring.len()][1], z);
        let mut triangles: Vec<Triangle> = Vec::new();
        for i in 0..ring.len() {
            let [a, b, c, d] = [at(i, 0.0), at(i + 1, 0.0), at(i + 1, 8.0), at(i, 8.0)];
            triangles.extend([[a, b, c], [a, c, d]]);
            if i > 0 && i + 1 < ring.len() {
                triangles.push([at(0, 8.0), at(i, 8.0), at(i + 1, 8.0)]);
                triangles.push([at(0, 0.0), at(i + 1, 0.0), at(i, 0.0)]);
            }
        }
        OccluderMesh::from_triangles(&triangles).unwrap()
    }

    /// Rings have one post for each corner, which is known up to the error of the transform.
    #[test]
    fn solids_are_rings_of_three_posts_at_least() {
        let three = [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]];
        let four = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        for corners in [&three[..], &four[..]] {
            let far = Affine3A::from_translation(Vec3::new(1e6, 0.0, 0.0));
            for (transform, x) in [(Affine3A::IDENTITY, 0.0), (far, 1e6)] {
                let all = solids_of(prism(corners), transform);
                assert_eq!(all.solids.len(), 1, "a prism over {corners:?}");
                let solid = &all.solids[0];
                let ring: Vec<[f64; 2]> = all.ring(solid).iter().map(|post| [post.x - x, post.y]).collect();
                assert_eq!(ring.len(), corners.len(), "posts {ring:?} over {corners:?}");
                for corner in corners {
                    let at = corner.map(f64::from);
                    assert!(ring.contains(&at), "{at:?} is among {ring:?}");
                }
                // Four roundings of a sum of two terms of 1e6 are the least that must be allowed for.
                let is_known =
                    if x > 0.0 { solid.error >= 4.0 * f64::EPSILON * x } else { solid.error == 0.0 };
                assert!(is_known, "the error {} of posts at {x}", solid.error);
            }
        }
        let flat = prism(&[[0.0, 0.0], [4.0, 0.0]]);
        assert!(solids_of(flat, Affine3A::IDENTITY).solids.is_empty(), "a wall without thickness");
    }
}
