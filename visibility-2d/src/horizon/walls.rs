//! Walls in a mesh that is not convex: chains of upright panels.
//!
//! Houses with a yard, a bay or a hipped roof are not convex, but their walls stand upright. A *panel* is a
//! pair of triangles that share an edge and whose corners are over two points of the plan: a trapezoid
//! between two upright sides. It stops each line of sight that passes between its upper and its lower edge.
//! Panels that follow each other around corners are a wall, and occlude as one.
//!
//! # Why no gap opens between panels
//! Panels follow each other if they have a bit-identical point of the plan in common, in mesh coordinates.
//! The transform must map upright lines to upright lines, which is decided without rounding. So the exact
//! transformed panels also have a point of the plan in common.

use super::extract::{Shape, Solids, placed};
use super::frame::UpAxis;
use super::outline::Post;
use alloc::vec::Vec;
use core::cmp::Ordering;
use visibility_core::OccluderMesh;
use visibility_core::glam::{Affine3A, Vec3};

/// Maximum number of panels of a wall. A longer chain is cut, which loses one column of the picture.
const MAX_PANELS: usize = 64;

/// Least height of a panel as a fraction of the height of its mesh. Lower panels, such as the edge of a
/// table, hide next to nothing and take as much time.
const MIN_HEIGHT: f32 = 1.0 / 4.0;

/// Maximum number of panels, of those that begin where a wall's last panel ends, that are tried as its next
/// panel. With this limit, many panels at one point of the plan take linear time.
const MAX_BESIDE: usize = 16;

/// Upright trapezoid in mesh coordinates. Its front is to the right when walking from its first side to its
/// second.
#[derive(Clone, Copy, Debug)]
struct Panel {
    sides: [Side; 2],
}

/// Upright side of a panel.
#[derive(Clone, Copy, Debug)]
struct Side {
    /// Position of the side on the plan, in mesh coordinates.
    at: [f32; 2],
    /// Height of the lower end of the side, in mesh coordinates.
    low: f32,
    /// Height of the upper end of the side, in mesh coordinates.
    high: f32,
}

impl Side {
    fn new(a: [f32; 3], b: [f32; 3]) -> Self {
        Self { at: [a[0], a[1]], low: a[2].min(b[2]), high: a[2].max(b[2]) }
    }

    /// Returns the length of the common height range of two sides at one point of the plan. Negative if they
    /// have none.
    fn overlap(&self, other: &Self) -> f32 {
        self.high.min(other.high) - self.low.max(other.low)
    }
}

/// Compares points of the plan. Zero equals negative zero.
fn compare(a: &[f32; 2], b: &[f32; 2]) -> Ordering {
    a.partial_cmp(b).unwrap_or(Ordering::Equal)
}

impl Solids {
    /// Adds the walls among some triangles of a mesh with its transform. Adds none if the transform does not
    /// keep upright lines upright, or collapses the plan to a line.
    pub(super) fn add_walls(
        &mut self,
        mesh: &OccluderMesh,
        triangles: &[u32],
        transform: &Affine3A,
        up: UpAxis,
    ) {
        let Some(is_mirrored) = is_mirrored_on_plan(transform, up) else { return };
        let panels = panels(mesh, triangles, up);
        for mut chain in chains(&panels) {
            // In a mirror image, the front is on the other side, so the chain is reversed.
            if is_mirrored {
                chain.reverse();
            }
            let (first, mut size) = (self.posts.len(), 0.0f64);
            for index in chain {
                let [from, to] = panels[index].sides;
                for side in if is_mirrored { [to, from] } else { [from, to] } {
                    let mut place = |height: f32| {
                        let p = up.join([side.at[0], side.at[1], height].map(f64::from));
                        let (p, by) = placed(p, transform);
                        size = size.max(by);
                        up.split(p)
                    };
                    let ([x, y, a], [_, _, b]) = (place(side.low), place(side.high));
                    self.posts.push(Post { x, y, low: a.min(b), high: a.max(b) });
                }
            }
            let shape = Shape::Wall { two_sided: mesh.is_two_sided() };
            self.finish(first, transform, [size, 0.0], shape, f64::NEG_INFINITY);
        }
    }
}

/// Returns whether a transform mirrors the plan. `None` if it does not map upright lines to upright lines, or
/// collapses the plan to a line. Decided without rounding.
fn is_mirrored_on_plan(transform: &Affine3A, up: UpAxis) -> Option<bool> {
    let m = transform.matrix3;
    let axes = [m.x_axis, m.y_axis, m.z_axis];
    let [x, y, z] = up.rows().map(|row| up.split_f32(Vec3::from(axes[row])).map(f64::from));
    // Products of two `f32` are exact in `f64`, so their comparison is exact too.
    let (a, b) = (x[0] * y[1], x[1] * y[0]);
    (z[0] == 0.0 && z[1] == 0.0 && a != b).then_some(a < b)
}

/// Returns the panels among the triangles of a mesh with the indices `triangles`, in mesh coordinates.
fn panels(mesh: &OccluderMesh, triangles: &[u32], up: UpAxis) -> Vec<Panel> {
    let at = |vertex: u32| up.split_f32(mesh.positions()[vertex as usize]);
    let is_over = |a: [f32; 3], b: [f32; 3]| a[0] == b[0] && a[1] == b[1];
    let [_, _, least] = up.split_f32((mesh.bounds().max - mesh.bounds().min) * MIN_HEIGHT);
    let mut panels = Vec::new();
    for &index in triangles {
        let (t, edges) = (mesh.triangles()[index as usize], mesh.triangle_edges()[index as usize]);
        for corner in 0..3 {
            let edge = &mesh.edges()[edges[corner] as usize];
            // Each pair of triangles is visited once, from the triangle on the left of the edge.
            let Some(right) = edge.right.filter(|_| edge.left == index) else { continue };
            let [u, v, w] = [t[corner], t[(corner + 1) % 3], t[(corner + 2) % 3]];
            let other = mesh.triangles()[right as usize];
            let Some(x) = other.into_iter().find(|&i| i != u && i != v) else { continue };
            let [u, v, w, x] = [u, v, w, x].map(at);
            let sides = match () {
                () if is_over(u, v) => continue,
                () if is_over(w, u) && is_over(x, v) => [[u, w], [v, x]],
                () if is_over(w, v) && is_over(x, u) => [[u, x], [v, w]],
                () => continue,
            };
            // In a trapezoid, one triangle's corner is above the edge and the other's is below. Otherwise,
            // the triangles are folded onto each other.
            let (over_u, over_v) = (sides[0][1][2] > sides[0][0][2], sides[1][1][2] > sides[1][0][2]);
            let is_proper = sides.iter().all(|[a, b]| a[2] != b[2]);
            if !is_proper || over_u == over_v {
                continue;
            }
            let [a, b] = sides.map(|[a, b]| Side::new(a, b));
            if (a.high - a.low).max(b.high - b.low) < least {
                continue;
            }
            // A triangle that runs from `u` to `v` and then up has its front to the right of this direction.
            let is_up = if is_over(w, u) { over_u } else { over_v };
            panels.push(Panel { sides: if is_up { [a, b] } else { [b, a] } });
        }
    }
    panels
}

/// Returns chains of panels, as indices into `panels`. The panels of a chain share a common range of heights,
/// and each begins where the one before ends. Each panel is in one chain.
fn chains(panels: &[Panel]) -> Vec<Vec<usize>> {
    let sorted = |side: usize| {
        let mut order: Vec<usize> = (0..panels.len()).collect();
        order.sort_unstable_by(|&a, &b| compare(&panels[a].sides[side].at, &panels[b].sides[side].at));
        order
    };
    let (by_begin, by_end) = (sorted(0), sorted(1));
    let range = |order: &[usize], side: usize, at: &[f32; 2]| {
        let place = |i: &usize| compare(&panels[*i].sides[side].at, at);
        order.partition_point(|i| place(i).is_lt())..order.partition_point(|i| place(i).is_le())
    };
    let mut is_used = alloc::vec![false; panels.len()];
    let mut chains = Vec::new();
    // Chains with a first panel come before rings.
    let has_former = |&i: &usize| range(&by_end, 1, &panels[i].sides[0].at).is_empty();
    let firsts = (0..panels.len()).filter(has_former).chain(0..panels.len());
    for first in firsts {
        if is_used[first] {
            continue;
        }
        let mut chain = alloc::vec![first];
        is_used[first] = true;
        let mut end = panels[first].sides[1];
        while chain.len() < MAX_PANELS {
            let next = by_begin[range(&by_begin, 0, &end.at)]
                .iter()
                .take(MAX_BESIDE)
                .filter(|&&i| !is_used[i])
                .map(|&i| (end.overlap(&panels[i].sides[0]), i))
                .filter(|(overlap, _)| *overlap > 0.0)
                .max_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, next)) = next else { break };
            chain.push(next);
            is_used[next] = true;
            end = panels[next].sides[1];
        }
        chains.push(chain);
    }
    chains
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;
    use visibility_core::glam::Mat3;
    use visibility_core::scene::Triangle;

    #[test]
    fn transforms_that_keep_lines_upright_mirror_the_plan_or_not() {
        let of = |x: [f32; 3], y: [f32; 3], z: [f32; 3]| {
            let transform = Affine3A::from_mat3(Mat3::from_cols(x.into(), y.into(), z.into()));
            is_mirrored_on_plan(&transform, UpAxis::Z)
        };
        let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert_eq!(of(x, y, z), Some(false), "the identity");
        assert_eq!(of(y, x, z), Some(true), "x and y exchanged");
        assert_eq!(of([0.0, 2.0, 1.0], [-3.0, 0.0, 1.0], [0.0, 0.0, -1.0]), Some(false), "turned, z down");
        assert_eq!(of(x, y, [1e-30, 0.0, 1.0]), None, "leaning along x");
        assert_eq!(of(x, y, [0.0, 1e-30, 1.0]), None, "leaning along y");
        assert_eq!(of([1.0, 2.0, 0.0], [2.0, 4.0, 1.0], z), None, "a plan of a line");
        let y_up = is_mirrored_on_plan(&Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0)), UpAxis::Y);
        assert_eq!(y_up, Some(true), "mirrored, y up");
    }

    /// Panels of a mesh: the points of the plan of their sides, and the least and greatest heights there.
    fn found(triangles: &[Triangle]) -> Vec<[([f32; 2], f32, f32); 2]> {
        let mesh = OccluderMesh::from_triangles(triangles).unwrap();
        let all: Vec<u32> = (0..mesh.triangles().len() as u32).collect();
        let side = |side: Side| (side.at, side.low, side.high);
        panels(&mesh, &all, UpAxis::Z).into_iter().map(|panel| panel.sides.map(side)).collect()
    }

    /// Two triangles are a panel if two pairs of their corners stand over each other. Its front is to the
    /// right on the way from its first side to its second.
    #[test]
    fn panels_are_upright_trapezoids() {
        let [a, b] = [Vec3::ZERO, Vec3::new(2.0, 1.0, 0.5)];
        let (c, d) = (b + Vec3::Z * 3.0, a + Vec3::Z * 2.0);
        let (left, right) = (([0.0, 0.0], 0.0, 2.0), ([2.0, 1.0], 0.5, 3.5));
        assert_eq!(found(&[[a, b, c], [a, c, d]]), [[left, right]], "a front to the right");
        assert_eq!(found(&[[b, d, a], [b, c, d]]), [[left, right]], "the other diagonal");
        assert_eq!(found(&[[a, c, b], [a, d, c]]), [[right, left]], "a front to the left");
        assert_eq!(found(&[[b, a, d], [b, d, c]]), [[right, left]], "the same with the other diagonal");
        for axis in [Vec3::X, Vec3::Y] {
            for by in [0.25, -0.25] {
                for (b, d) in [(b + axis * by, d), (b, d + axis * by)] {
                    for mesh in [[[a, b, c], [a, c, d]], [[b, d, a], [b, c, d]]] {
                        assert!(found(&mesh).is_empty(), "one side leans, {axis} {by}");
                    }
                }
            }
        }
        assert!(found(&[[a, b, d], [b, a, c]]).is_empty(), "triangles that are folded onto each other");
        assert!(found(&[[a, b, c]]).is_empty(), "one triangle");
        // A wide level triangle with the height of the panel at its greatest.
        let tall =
            |height: f32| [Vec3::new(9.0, 9.0, 0.0), Vec3::new(9.0, 8.0, 0.0), Vec3::new(9.0, 9.0, height)];
        assert_eq!(found(&[[a, b, c], [a, c, d], tall(11.9)]).len(), 1, "more than a quarter of the height");
        assert_eq!(found(&[[a, b, c], [a, c, d], tall(12.1)]).len(), 0, "less than a quarter of the height");
    }

    fn panel(from: [f32; 2], to: [f32; 2], [low, high]: [f32; 2]) -> Panel {
        Panel { sides: [from, to].map(|at| Side { at, low, high }) }
    }

    /// Panels follow each other if one begins where the other ends, at a common height.
    #[test]
    fn chains_are_panels_that_follow_each_other_at_common_heights() {
        let [p, q, r, s] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let all = [0.0, 3.0];
        let row = [panel(q, r, all), panel(p, q, all), panel(r, s, all)];
        assert_eq!(chains(&row), [vec![1, 0, 2]], "a row of three");
        let ring = [panel(p, q, all), panel(q, r, all), panel(r, s, all), panel(s, p, all)];
        assert_eq!(chains(&ring), [vec![0, 1, 2, 3]], "a ring");
        for (heights, expected) in [([2.0, 4.0], 1), ([3.0, 4.0], 2), ([3.5, 4.0], 2), ([-1.0, 0.0], 2)] {
            let two = [panel(p, q, all), panel(q, r, heights)];
            assert_eq!(chains(&two).len(), expected, "chains of heights {all:?} and {heights:?}");
        }
        assert_eq!(chains(&[panel(p, q, all), panel(s, r, all)]).len(), 2, "panels apart");
        assert_eq!(chains(&[panel(p, q, all), panel(r, q, all)]).len(), 2, "panels that end at one point");
        // Of several panels that begin at one point, the panel with the greatest common height follows.
        let several = [panel(p, q, all), panel(q, r, [2.0, 3.0]), panel(q, s, [1.0, 4.0])];
        assert_eq!(chains(&several)[0], [0, 2], "the greater common height");
        let long: Vec<Panel> = (0..70).map(|i| panel([i as f32, 0.0], [i as f32 + 1.0, 0.0], all)).collect();
        let lengths: Vec<usize> = chains(&long).iter().map(Vec::len).collect();
        assert_eq!(lengths, [64, 6], "a long row is cut");
    }

    /// The posts of a wall: in order, or in reverse under a transform that mirrors the plan.
    #[test]
    fn walls_are_reversed_in_a_mirror() {
        let [a, b] = [Vec3::ZERO, Vec3::X * 2.0];
        let (c, d) = (b + Vec3::Z * 3.0, a + Vec3::Z * 3.0);
        let mesh = OccluderMesh::from_triangles(&[[a, b, c], [a, c, d]]).unwrap();
        for (scale, x) in [([1.0, 1.0, 1.0], [0.0, 2.0]), ([-1.0, 1.0, -1.0], [-2.0, 0.0])] {
            let mut solids = Solids::default();
            let far = Vec3::new(1e5, 0.1, 0.0);
            let transform = Affine3A::from_scale_rotation_translation(scale.into(), Default::default(), far);
            solids.add_walls(&mesh, &[0, 1], &transform, UpAxis::Z);
            let posts: Vec<f64> = solids.posts.iter().map(|post| post.x - 1e5).collect();
            assert_eq!(posts, x, "posts under a scale of {scale:?}");
            let z = f64::from(scale[2]) * 3.0;
            for post in &solids.posts {
                assert_eq!([post.low, post.high], [z.min(0.0), z.max(0.0)], "heights under {scale:?}");
            }
            let [solid] = solids.solids[..] else { panic!("{} walls", solids.solids.len()) };
            assert!(solid.error >= 1e5 * f64::EPSILON, "the error of a wall far away: {}", solid.error);
        }
    }
}
