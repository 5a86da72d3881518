//! Extraction of upright convex solids from an occluder mesh.
//!
//! Closed convex meshes, and convex parts of meshes, are used as they are. Houses of city models often have
//! no floor. They are found among the other triangles, by shared vertices, as prisms that are open only at
//! the bottom. Upright panels among the remaining triangles make walls, in `walls.rs`. All other triangles
//! are ignored here.

use super::frame::UpAxis;
use super::kernel::Kernel;
use super::outline::Post;
use alloc::vec::Vec;
use visibility_core::OccluderMesh;
use visibility_core::geometry::keeps_orientation;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::union_find::root;

/// Maximum number of posts (upright segments) of a solid. Solids with more are rare, and cost more than they
/// hide.
const MAX_POSTS: usize = 32;

/// Least size of a solid's upright face, width times height, as a fraction of the largest face in the same
/// mesh. Smaller solids are left out: posts and rails of a house hide next to nothing compared with its
/// walls.
const MIN_FACE: f64 = 1.0 / 16.0;

/// Shape that the posts of a [`Solid`] span.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Shape {
    /// The convex hull of all posts.
    Convex,
    /// Upright panels, each between two successive posts. A panel's front is to the right when walking from
    /// its first post to its second; its back only hides if `two_sided`.
    Wall { two_sided: bool },
}

/// Convex hull of posts, or a wall.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Solid {
    pub(crate) shape: Shape,
    /// Index of the solid's first post in the list `posts` of [`Solids`].
    pub(crate) first: u32,
    /// Number of the solid's posts, which follow each other.
    pub(crate) count: u32,
    /// Bound on the distance in metres of each post from a point of the exact solid.
    pub(crate) error: f64,
    /// Greatest distance in metres, rounded, between a vertex of the mesh and the post that stands for it:
    /// the posts of a mesh with notches are inside of the solid. 0 for prisms and walls.
    pub(crate) moved: f64,
    /// Height in metres below which the eye must not be, because the solid has no face there. Negative
    /// infinity for a closed solid.
    pub(crate) open_below: f64,
    /// Area in square metres of the largest upright face of the solid's bounding box: its longer side on the
    /// plan times its height.
    pub(crate) face: f64,
}

/// Solids extracted so far, with their posts.
#[derive(Clone, Debug, Default)]
pub(crate) struct Solids {
    pub(crate) solids: Vec<Solid>,
    pub(crate) posts: Vec<Post>,
    /// Solids whose upright face is smaller than this, in square metres, are left out.
    pub(crate) least_face: f64,
}

impl Solids {
    /// Returns the posts of a solid.
    pub(crate) fn posts(&self, solid: &Solid) -> &[Post] {
        &self.posts[solid.first as usize..][..solid.count as usize]
    }

    pub(crate) fn clear(&mut self) {
        self.solids.clear();
        self.posts.clear();
    }

    /// Adds the convex solids of a mesh with its transform. If `walls`, also adds its
    /// [`walls`](super::walls).
    pub(crate) fn add_mesh(&mut self, mesh: &OccluderMesh, transform: &Affine3A, up: UpAxis, walls: bool) {
        let begin = self.solids.len();
        let pieces = if mesh.parts().is_empty() { core::slice::from_ref(mesh) } else { mesh.parts() };
        for piece in pieces {
            if piece.is_convex() {
                self.add_convex(piece, transform, up);
            } else {
                let mut rest = components(piece);
                rest.retain(|triangles| self.add_open_prism(piece, triangles, transform, up).is_none());
                if walls {
                    self.add_walls(piece, &rest.concat(), transform, up);
                }
            }
        }
        self.drop_small(begin);
    }

    fn add_convex(&mut self, mesh: &OccluderMesh, transform: &Affine3A, up: UpAxis) {
        if mesh.positions().len() <= MAX_POSTS {
            let Some(kernel) = Kernel::new(mesh) else { return };
            let first = self.posts.len();
            let (mut size, mut moved) = (0.0f64, 0.0f64);
            for (vertex, at) in (0u32..).zip(mesh.positions().iter().map(|p| p.as_dvec3())) {
                let Some(inside) = kernel.nearest(vertex) else {
                    self.posts.truncate(first);
                    return;
                };
                let (p, by) = placed(inside, transform);
                size = size.max(by);
                if inside != at {
                    let (at, by) = placed(at, transform);
                    (size, moved) = (size.max(by), moved.max(p.distance(at)));
                }
                let [x, y, z] = up.split(p);
                self.add_post(first, Post { x, y, low: z, high: z });
            }
            self.finish(first, transform, [size, moved], Shape::Convex, f64::NEG_INFINITY);
        }
    }

    /// Adds a post to the solid whose first post has the index `first` in `posts`. A post at the same point
    /// of the plan as an earlier post of the solid is merged with it.
    fn add_post(&mut self, first: usize, post: Post) {
        for other in &mut self.posts[first..] {
            if other.x == post.x && other.y == post.y {
                (other.low, other.high) = (other.low.min(post.low), other.high.max(post.high));
                return;
            }
        }
        self.posts.push(post);
    }

    /// Adds the solid of the posts from index `first` on. Drops these posts if there are fewer than two or
    /// one is not finite. `size` is the greatest sum of magnitudes that [`placed`] returned for these posts
    /// and their vertices, `moved` the greatest distance between the two.
    pub(crate) fn finish(
        &mut self,
        first: usize,
        transform: &Affine3A,
        [size, moved]: [f64; 2],
        shape: Shape,
        open_below: f64,
    ) {
        let count = self.posts.len() - first;
        let is_finite = self.posts[first..]
            .iter()
            .all(|p| p.x.is_finite() && p.y.is_finite() && p.low.is_finite() && p.high.is_finite());
        if count < 2 || !is_finite || first > u32::MAX as usize {
            self.posts.truncate(first);
            return;
        }
        let error = rounding(transform, size);
        let face = face(&self.posts[first..]);
        let (first, count) = (first as u32, count as u32);
        self.solids.push(Solid { shape, first, count, error, moved, open_below, face });
    }

    /// Removes solids, from index `begin` on, whose upright face is smaller than [`MIN_FACE`] of the largest
    /// of them, or smaller than [`least_face`](Self::least_face).
    fn drop_small(&mut self, begin: usize) {
        let largest = self.solids[begin..].iter().map(|solid| solid.face).fold(0.0, f64::max);
        let least = self.least_face.max(MIN_FACE * largest);
        let (mut kept, mut posts) = (begin, self.solids.get(begin).map_or(0, |solid| solid.first as usize));
        for index in begin..self.solids.len() {
            let solid = self.solids[index];
            if solid.face >= least {
                let (from, count) = (solid.first as usize, solid.count as usize);
                self.posts.copy_within(from..from + count, posts);
                self.solids[kept] = Solid { first: posts as u32, ..solid };
                (kept, posts) = (kept + 1, posts + count);
            }
        }
        if kept > begin || self.solids.len() > begin {
            self.solids.truncate(kept);
            self.posts.truncate(posts);
        }
    }

    /// Adds an upright prism that may be open at the bottom. The triangles must be connected by shared
    /// vertices, and all vertices must lie at two heights. Triangles that touch both heights must be upright
    /// and lie on the sides of the convex hull that all vertices have on the plan. Every edge must join two
    /// triangles, except edges at the lower height. `None`, and nothing is added, if a condition fails.
    fn add_open_prism(
        &mut self,
        mesh: &OccluderMesh,
        triangles: &[u32],
        transform: &Affine3A,
        up: UpAxis,
    ) -> Option<()> {
        if triangles.len() > 4 * MAX_POSTS {
            return None;
        }
        let mut size = 0.0f64;
        let mut vertex = |index: u32| {
            let (p, by) = placed(mesh.positions()[index as usize].as_dvec3(), transform);
            size = size.max(by);
            up.split(p)
        };
        let corners: Vec<[[f64; 3]; 3]> =
            triangles.iter().map(|&t| mesh.triangles()[t as usize].map(&mut vertex)).collect();
        let all = || corners.iter().flatten();
        let low = all().map(|p| p[2]).fold(f64::INFINITY, f64::min);
        let high = all().map(|p| p[2]).fold(f64::NEG_INFINITY, f64::max);
        if !all().all(|p| p[2] == low || p[2] == high) || low == high {
            return None;
        }
        // Edges of only one triangle must lie at the lower height.
        for &t in triangles {
            for edge in mesh.triangle_edges()[t as usize] {
                let edge = &mesh.edges()[edge as usize];
                let mut is_low = || edge.vertices.iter().all(|&v| vertex(v)[2] == low);
                if edge.right.is_none() && !is_low() {
                    return None;
                }
            }
        }
        let mut plan: Vec<[f64; 2]> = all().map(|p| [p[0], p[1]]).collect();
        plan.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        plan.dedup();
        let hull = convex_hull(&plan);
        if hull.len() < 3 || hull.len() > MAX_POSTS {
            return None;
        }
        // Each triangle must be level, or a part of a side between neighbouring corners of the hull.
        let position = |p: &[f64; 3]| hull.iter().position(|q| q[0] == p[0] && q[1] == p[1]);
        for t in &corners {
            if t.iter().all(|p| p[2] == low) || t.iter().all(|p| p[2] == high) {
                continue;
            }
            let [a, b, c] = [position(&t[0])?, position(&t[1])?, position(&t[2])?];
            let is_side =
                |a: usize, b: usize| a == b || (a + 1) % hull.len() == b || (b + 1) % hull.len() == a;
            let is_upright = a == b || b == c || c == a;
            if !(is_upright && is_side(a, b) && is_side(b, c) && is_side(c, a)) {
                return None;
            }
        }
        // All edges except the lowest join two triangles in opposite directions. So the number of triangles
        // over a point of the hull's surface (inward-facing triangles counted negative) is the same
        // everywhere above the lower height. At the top this number is the quotient of the areas.
        let area = |p: &[[f64; 2]]| {
            let around = (0..p.len()).map(|i| (p[i], p[(i + 1) % p.len()]));
            around
                .map(|(a, b)| (a[0] - p[0][0]) * (b[1] - p[0][1]) - (a[1] - p[0][1]) * (b[0] - p[0][0]))
                .sum::<f64>()
        };
        let top = corners.iter().filter(|t| t.iter().all(|p| p[2] == high));
        let covered: f64 = top.map(|t| area(&t.map(|p| [p[0], p[1]]))).sum::<f64>() / area(&hull);
        // A one-sided mesh only occludes from outside if it faces outwards.
        let is_mirrored = keeps_orientation(transform) != Some(true);
        let is_covered = if mesh.is_two_sided() { covered.abs() } else { covered } > 0.5;
        if !is_covered || is_mirrored && !mesh.is_two_sided() {
            return None;
        }
        let first = self.posts.len();
        self.posts.extend(hull.iter().map(|p| Post { x: p[0], y: p[1], low, high }));
        self.finish(first, transform, [size, 0.0], Shape::Convex, low);
        Some(())
    }
}

/// Returns the area in square metres of the largest upright face of the bounding box of posts: its longer
/// side on the plan times its height.
fn face(posts: &[Post]) -> f64 {
    let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in posts {
        for (axis, (a, b)) in [(p.x, p.x), (p.y, p.y), (p.low, p.high)].into_iter().enumerate() {
            (min[axis], max[axis]) = (min[axis].min(a), max[axis].max(b));
        }
    }
    (max[0] - min[0]).max(max[1] - min[1]) * (max[2] - min[2])
}

/// Returns a point under a transform, and the sum of the magnitudes of the terms of one of its coordinates:
/// the greatest of the three sums.
pub(crate) fn placed(p: DVec3, transform: &Affine3A) -> (DVec3, f64) {
    if *transform == Affine3A::IDENTITY {
        return (p, p.abs().max_element());
    }
    let columns = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis]
        .map(|axis| visibility_core::glam::Vec3::from(axis).as_dvec3());
    let translation = visibility_core::glam::Vec3::from(transform.translation).as_dvec3();
    let terms = [columns[0] * p.x, columns[1] * p.y, columns[2] * p.z, translation];
    let sum = terms[0] + terms[1] + terms[2] + terms[3];
    let size = terms[0].abs() + terms[1].abs() + terms[2].abs() + terms[3].abs();
    (sum, size.max_element())
}

/// Returns a bound in metres on the error of a point from [`placed`], given the sum of magnitudes that it
/// returned. A coordinate is a sum of four terms, each rounded at most four times, so it is wrong by about
/// `4u` of that sum, and the point by less than `8u`, with `u = 2^-53`. The bound is `16u`; 0 for the
/// identity, which does not round.
fn rounding(transform: &Affine3A, size: f64) -> f64 {
    if *transform == Affine3A::IDENTITY { 0.0 } else { 8.0 * f64::EPSILON * size }
}

/// Returns the indices of a mesh's triangles in groups: triangles that share a vertex are in one group.
fn components(mesh: &OccluderMesh) -> Vec<Vec<u32>> {
    let mut parent: Vec<u32> = (0..mesh.positions().len() as u32).collect();
    for t in mesh.triangles() {
        for &other in &t[1..] {
            let (a, b) = (root(&mut parent, t[0]), root(&mut parent, other));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut order: Vec<(u32, u32)> =
        (0..).zip(mesh.triangles()).map(|(i, t)| (root(&mut parent, t[0]), i)).collect();
    order.sort_unstable();
    order.chunk_by(|a, b| a.0 == b.0).map(|group| group.iter().map(|&(_, t)| t).collect()).collect()
}

/// Returns the convex hull, counter-clockwise, of points on the plan that are sorted by x, then y, without
/// repetition. A point is left out if it lies on a side of the hull, up to rounding.
pub(crate) fn convex_hull(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let cross =
        |o: [f64; 2], a: [f64; 2], b: [f64; 2]| (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
    let mut hull: Vec<[f64; 2]> = Vec::with_capacity(points.len() + 1);
    let half = |hull: &mut Vec<[f64; 2]>, points: &mut dyn Iterator<Item = [f64; 2]>| {
        let base = hull.len();
        for p in points {
            while hull.len() > base + 1 && cross(hull[hull.len() - 2], hull[hull.len() - 1], p) <= 0.0 {
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop();
    };
    half(&mut hull, &mut points.iter().copied());
    half(&mut hull, &mut points.iter().rev().copied());
    if hull.is_empty() { points.to_vec() } else { hull }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;
    use visibility_core::glam::{Mat3, Vec3};

    /// Returns the number of solids found in a mesh of triangles.
    fn count(triangles: &[[Vec3; 3]], two_sided: bool, transform: Affine3A) -> usize {
        let mesh = OccluderMesh::from_triangles(triangles).unwrap().with_two_sided(two_sided);
        let mut solids = Solids::default();
        solids.add_mesh(&mesh, &transform, UpAxis::Z, false);
        solids.solids.len()
    }

    /// Makes an upright prism without a floor. Its top is a fan around the first corner.
    fn prism(plan: &[[f32; 2]]) -> Vec<[Vec3; 3]> {
        let at = |i: usize, z: f32| Vec3::new(plan[i % plan.len()][0], plan[i % plan.len()][1], z);
        let sides = (0..plan.len()).flat_map(|i| {
            let (a, b) = (at(i, 0.0), at(i + 1, 0.0));
            [[a, b, at(i + 1, 3.0)], [a, at(i + 1, 3.0), at(i, 3.0)]]
        });
        let top = (1..plan.len() - 1).map(|i| [at(0, 3.0), at(i, 3.0), at(i + 1, 3.0)]);
        sides.chain(top).collect()
    }

    const SQUARE: [[f32; 2]; 4] = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];

    #[test]
    fn a_prism_without_a_floor_is_a_solid_from_outside() {
        let house = prism(&SQUARE);
        let turned: Vec<_> = house.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        assert_eq!(count(&house, false, Affine3A::IDENTITY), 1, "a house without a floor");
        assert_eq!(count(&house, true, Affine3A::IDENTITY), 1, "a house without a floor, two-sided");
        // The inside of a room occludes only if both sides do.
        assert_eq!(count(&turned, false, Affine3A::IDENTITY), 0, "a room, turned inside out");
        assert_eq!(count(&turned, true, Affine3A::IDENTITY), 1, "a room, two-sided");
        let mirror = Affine3A::from_mat3(Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0)));
        assert_eq!(count(&house, false, mirror), 0, "the front of a mirrored triangle stays its front");
        assert_eq!(count(&turned, false, mirror), 0, "a mirrored room is a room");
        assert_eq!(count(&house, true, mirror), 1, "a mirrored house, two-sided");
        let tiny = Vec3::splat(1e-16);
        assert_eq!(count(&house, false, Affine3A::from_scale(tiny)), 1, "a house of scales that underflow");
        let mirror = Affine3A::from_scale(tiny * Vec3::new(-1.0, 1.0, 1.0));
        assert_eq!(count(&house, false, mirror), 0, "a mirrored house of scales that underflow");
    }

    #[test]
    fn a_prism_with_a_hole_or_a_dent_is_none() {
        let house = prism(&SQUARE);
        for missing in 0..house.len() {
            let mut holed = house.clone();
            holed.remove(missing);
            assert_eq!(count(&holed, true, Affine3A::IDENTITY), 0, "without triangle {missing}");
        }
        // A plan with a dent. Its top, a fan around the first corner, still has no overlap.
        let dented = prism(&[[1.0, 0.5], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [0.0, 0.0]]);
        assert_eq!(count(&dented, true, Affine3A::IDENTITY), 0, "a house with a dent");
    }

    /// Two triangles back to back: every edge joins two triangles, but they cover only half of their hull.
    #[test]
    fn a_flap_of_two_triangles_is_no_solid() {
        let [a, b, c] = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 0.0, 3.0)];
        assert_eq!(count(&[[a, b, c], [a, c, b]], true, Affine3A::IDENTITY), 0, "a flap of two triangles");
        // The same flap, attached to the top of a square whose other half is open.
        let mut house = prism(&SQUARE);
        let last = house.len() - 1;
        let [a, b, c] = house[last];
        house.truncate(last - 1);
        house.extend([[a, b, c], [a, c, b]]);
        assert_eq!(count(&house, true, Affine3A::IDENTITY), 0, "a flap on the top of a house");
    }

    /// Posts of placed meshes are within the solid's error of the exact vertices. Compared in double-double
    /// numbers.
    #[test]
    fn posts_are_within_their_error() {
        use visibility_core::Aabb;
        use visibility_core::geometry::DoubleDouble;
        let mut random = visibility_testing::Random(1);
        let (min, max) = (Vec3::new(-0.3, -0.7, -0.1), Vec3::new(0.9, 0.4, 0.6));
        let mesh = OccluderMesh::cuboid(&Aabb::new(min, max)).unwrap();
        let mut off_at_all = 0;
        for trial in 0..2_000 {
            let columns = [0; 3].map(|_| random.vec3(-9.0, 9.0));
            let far = [0.0, 1e5][trial % 2];
            let transform = Affine3A::from_mat3_translation(
                Mat3::from_cols(columns[0], columns[1], columns[2]),
                random.vec3(-far, far),
            );
            let mut solids = Solids::default();
            solids.add_mesh(&mesh, &transform, UpAxis::Z, false);
            let [solid] = solids.solids[..] else { panic!("trial {trial}: {} solids", solids.solids.len()) };
            for vertex in mesh.positions() {
                let at = [0, 1, 2].map(|k| {
                    let [x, y, z] =
                        [0, 1, 2].map(|i| DoubleDouble::product(columns[i][k].into(), vertex[i].into()));
                    x.plus(y).plus(z).plus(f64::from(transform.translation[k]).into())
                });
                let off = |post: &Post| {
                    let by = [post.x, post.y, post.low].map(|x| DoubleDouble::from(-x));
                    let off = [0, 1, 2].map(|k| at[k].plus(by[k]).hi);
                    off.iter().map(|x| x * x).sum::<f64>().sqrt()
                };
                let least = solids.posts(&solid).iter().map(off).fold(f64::INFINITY, f64::min);
                off_at_all += usize::from(least > 0.0);
                assert!(least <= solid.error, "trial {trial}: {vertex} off by {least}, not {}", solid.error);
            }
        }
        assert!(off_at_all > 1_000, "{off_at_all} vertices are rounded");
    }

    /// Posts of a mesh with a notch are inside of it: each vertex is within the solid's `moved` of a post,
    /// and one is that far. Vertices of a convex mesh are its posts.
    #[test]
    fn posts_are_as_far_from_their_vertices_as_they_are_moved() {
        let stretched = Affine3A::from_scale_rotation_translation(
            Vec3::new(1.0, 2.0, 0.5),
            visibility_core::glam::Quat::from_rotation_z(0.3),
            Vec3::new(40.0, 0.0, 0.0),
        );
        for transform in [Affine3A::IDENTITY, stretched] {
            for (notch, most) in [(0.0, 0.0), (0.5, 9.0)] {
                let mesh = visibility_testing::notched_blade(0.0, 1.0, 20.0, notch);
                let mut solids = Solids::default();
                solids.add_convex(&mesh, &transform, UpAxis::Z);
                let solid = solids.solids[0];
                let far = |vertex: &Vec3| {
                    let at = placed(vertex.as_dvec3(), &transform).0;
                    let to = |p: &Post| DVec3::new(p.x, p.y, at.z.clamp(p.low, p.high)).distance(at);
                    solids.posts(&solid).iter().map(to).fold(f64::INFINITY, f64::min)
                };
                let farthest = mesh.positions().iter().map(far).fold(0.0, f64::max);
                assert_eq!(solid.moved, farthest, "a notch of {notch} under {transform:?}");
                let sizes = mesh.positions().iter().map(|p| placed(p.as_dvec3(), &transform).1);
                let least = rounding(&transform, sizes.fold(0.0, f64::max));
                assert!(solid.error >= least, "a notch of {notch}: the error {} of vertices", solid.error);
                assert!(farthest <= most && (notch == 0.0 || farthest > 0.1), "a notch of {notch}");
            }
        }
    }

    /// Vertices over each other are one post, from the lowest to the highest; others are posts of their own.
    #[test]
    fn vertices_over_each_other_are_one_post() {
        let mut solids = Solids::default();
        let level = |x: f64, y: f64, z: f64| Post { x, y, low: z, high: z };
        for (x, y, z) in [(1.0, 2.0, 5.0), (1.0, 3.0, 9.0), (4.0, 2.0, 8.0), (1.0, 2.0, 7.0), (1.0, 2.0, 3.0)]
        {
            solids.add_post(0, level(x, y, z));
        }
        let expected =
            [Post { x: 1.0, y: 2.0, low: 3.0, high: 7.0 }, level(1.0, 3.0, 9.0), level(4.0, 2.0, 8.0)];
        assert_eq!(solids.posts, expected, "posts of five vertices");
    }

    /// Fewer than two posts, or one that is not finite, are no solid, and leave no posts.
    #[test]
    fn posts_that_are_few_or_not_finite_are_no_solid() {
        let good = Post { x: 1.0, y: 2.0, low: 3.0, high: 7.0 };
        let finish = |posts: &[Post]| {
            let mut solids = Solids::default();
            solids.posts.extend([good]);
            solids.posts.extend(posts);
            solids.finish(1, &Affine3A::IDENTITY, [9.0, 0.0], Shape::Convex, 0.0);
            (solids.solids.first().map(|solid| (solid.first, solid.count, solid.error)), solids.posts.len())
        };
        assert_eq!(finish(&[good, good]), (Some((1, 2, 0.0)), 3), "two posts, not off under the identity");
        assert_eq!(finish(&[good]), (None, 1), "one post");
        let not = f64::INFINITY;
        let others = [
            Post { x: not, ..good },
            Post { y: not, ..good },
            Post { low: -not, ..good },
            Post { high: f64::NAN, ..good },
        ];
        for other in others {
            assert_eq!(finish(&[good, other]), (None, 1), "{other:?}");
            assert_eq!(finish(&[other, good]), (None, 1), "{other:?}");
        }
    }

    /// The largest upright face: the longer side on the plan times the height.
    #[test]
    fn faces_are_those_of_the_bounds() {
        let post = |x, y| Post { x, y, low: 1.0, high: 3.0 };
        let posts = [post(0.0, 0.0), post(5.0, 1.0), Post { low: 0.0, high: 4.0, ..post(2.0, 2.0) }];
        assert_eq!(face(&posts), 20.0, "5 m by 4 m");
        let turned = posts.map(|p| Post { x: p.y, y: p.x, ..p });
        assert_eq!(face(&turned), 20.0, "5 m along y by 4 m");
    }

    /// A prism of which one side is across the hull of the plan, since its floor reaches farther.
    #[test]
    fn a_side_across_the_hull_is_no_side_of_a_prism() {
        let at = |[x, y]: [f32; 2], z: f32| Vec3::new(x, y, z);
        let side = |a, b| [[at(a, 0.0), at(b, 0.0), at(b, 3.0)], [at(a, 0.0), at(b, 3.0), at(a, 3.0)]];
        let ([p, q, r, _], s) = (SQUARE, [0.5, 1.5]);
        let half = [side(p, q), side(q, r), side(r, p)].concat();
        let top = [[at(p, 3.0), at(q, 3.0), at(r, 3.0)]];
        let prism = [half.clone(), top.to_vec()].concat();
        assert_eq!(count(&prism, true, Affine3A::IDENTITY), 1, "a prism over a triangle");
        let beyond = [[at(p, 0.0), at(s, 0.0), at(r, 0.0)]];
        let wider = [prism, beyond.to_vec()].concat();
        assert_eq!(count(&wider, true, Affine3A::IDENTITY), 0, "a side is across the hull of the plan");
    }

    /// Conditions of prisms, one at a time.
    #[test]
    fn shapes_that_are_nearly_prisms_are_none() {
        let identity = Affine3A::IDENTITY;
        let house = prism(&SQUARE);
        let at = |i: usize, z: f32| Vec3::new(SQUARE[i][0], SQUARE[i][1], z);
        let floor = [house.clone(), vec![[at(0, 0.0), at(1, 0.0), at(2, 0.0)]]].concat();
        assert_eq!(count(&floor, true, identity), 1, "a house with half a floor");
        let flat = [[at(0, 0.0), at(1, 0.0), at(2, 0.0)], [at(0, 0.0), at(2, 0.0), at(3, 0.0)]];
        assert_eq!(count(&flat, true, identity), 0, "a flat square");
        // The top is lifted at one corner.
        let lifted: Vec<_> =
            house.iter().map(|t| t.map(|p| if p == at(2, 3.0) { at(2, 4.0) } else { p })).collect();
        assert_eq!(count(&lifted, true, identity), 0, "a house with three heights");
        for (sides, expected) in [(31, 1), (32, 1), (33, 0), (40, 0)] {
            let plan: Vec<[f32; 2]> = (0..sides)
                .map(|i| 100.0 * core::f32::consts::TAU * i as f32 / sides as f32 / 100.0)
                .map(|angle| [100.0 * angle.cos(), 100.0 * angle.sin()])
                .collect();
            assert_eq!(count(&prism(&plan), true, identity), expected, "a prism of {sides} sides");
        }
        // Three corners, of which each two are neighbours: all faces but the top lean across the plan.
        let [p, q, r] = [0, 1, 2].map(|i| at(i, 0.0));
        let [a, b, c] = [0, 1, 2].map(|i| at(i, 3.0));
        let across = [[a, b, c], [b, a, r], [c, b, p], [a, c, q], [r, a, q], [p, b, r], [q, c, p]];
        assert_eq!(count(&across, true, identity), 0, "faces across the plan");
        // The error of a prism far away.
        let mesh = OccluderMesh::from_triangles(&house).unwrap();
        let mut solids = Solids::default();
        solids.add_mesh(&mesh, &Affine3A::from_translation(Vec3::new(1e5, 0.0, 0.0)), UpAxis::Z, false);
        assert!(solids.solids[0].error >= 8.0 * f64::EPSILON * 1e5, "the error of a house far away");
    }
}
