//! T-junctions: vertices that lie exactly on an edge of another face are inserted into that edge, so that
//! both faces share the edge's parts.
//!
//! A vertex that lies on an edge only up to rounding is not inserted: objects may be visible through the gap
//! between vertex and edge, however narrow it is.

use crate::faces::{Faces, Side};
use alloc::vec::Vec;
use robust::{Coord, orient2d};
use visibility_core::glam::{DVec3, Vec3};

/// Maximum number of points in a leaf of a [`PointTree`].
const LEAF: usize = 8;
/// Maximum number of corners inserted, as a multiple of the number of sides. It bounds memory and time for
/// levels in which vertices lie on very many sides each.
const MAX_INSERTS_PER_SIDE: usize = 16;
/// Maximum number of looks at boxes and points of the [`PointTree`], as a multiple of the number of sides,
/// beyond [`MIN_LOOKS`]. It bounds time for levels in which very many points are near long edges. Scenes of
/// games, buildings, towns and parts of machines take 20 to 30 looks for each side.
const MAX_LOOKS_PER_SIDE: usize = 256;
/// Number of looks that are allowed in any level.
const MIN_LOOKS: usize = 4096;

/// Tests whether `p` lies on the open segment from `a` to `b`, in exact arithmetic. False for the ends.
pub(crate) fn is_between(a: Vec3, b: Vec3, p: Vec3) -> bool {
    let [a, b, p] = [a, b, p].map(|v| v.as_dvec3().to_array());
    let turn = |i: usize, j: usize| {
        let [a, b, p] = [a, b, p].map(|v| Coord { x: v[i], y: v[j] });
        orient2d(a, b, p)
    };
    let inside = (0..3).all(|i| a[i].min(b[i]) <= p[i] && p[i] <= a[i].max(b[i]));
    inside && p != a && p != b && turn(0, 1) == 0.0 && turn(1, 2) == 0.0 && turn(2, 0) == 0.0
}

/// A tree of boxes over points, which finds the points along a segment.
struct PointTree {
    /// Indices of the points. The points of a node are adjacent.
    points: Vec<u32>,
    /// Box around the points of each node: least and greatest coordinates. The children of node `i` are
    /// `2 i + 1` and `2 i + 2`, each with half of its points.
    boxes: Vec<[Vec3; 2]>,
}

impl PointTree {
    fn new(points: Vec<u32>, positions: &[Vec3]) -> Self {
        let mut tree = Self { points, boxes: Vec::new() };
        tree.divide(0, [0, tree.points.len()], positions);
        tree
    }

    /// Sorts the points `first..end` into the subtree of `node`.
    fn divide(&mut self, node: usize, [first, end]: [usize; 2], positions: &[Vec3]) {
        let points = &mut self.points[first..end];
        let at = |point: &u32| positions[*point as usize];
        let low = points.iter().map(at).fold(Vec3::INFINITY, Vec3::min);
        let high = points.iter().map(at).fold(Vec3::NEG_INFINITY, Vec3::max);
        if self.boxes.len() <= node {
            self.boxes.resize(node + 1, [Vec3::INFINITY, Vec3::NEG_INFINITY]);
        }
        self.boxes[node] = [low, high];
        if points.len() <= LEAF {
            return;
        }
        let (axis, middle) = ((high - low).max_position(), points.len() / 2);
        points.select_nth_unstable_by(middle, |a, b| at(a)[axis].total_cmp(&at(b)[axis]));
        self.divide(2 * node + 1, [first, first + middle], positions);
        self.divide(2 * node + 2, [first + middle, end], positions);
    }

    /// Calls `each` with the points of every leaf whose box the segment from `a` to `b` may meet. Takes one
    /// from `looks` for each box and each point looked at. The search ends when `looks` is 0; points may then
    /// be missing.
    fn along(&self, a: Vec3, b: Vec3, looks: &mut usize, each: &mut impl FnMut(u32)) {
        self.search(0, [0, self.points.len()], [a, b].map(Vec3::as_dvec3), looks, each);
    }

    fn search(
        &self,
        node: usize,
        [first, end]: [usize; 2],
        segment: [DVec3; 2],
        looks: &mut usize,
        each: &mut impl FnMut(u32),
    ) {
        if *looks == 0 {
            return;
        }
        #[cfg(test)]
        visibility_testing::step();
        *looks -= 1;
        if is_apart(segment, self.boxes[node].map(Vec3::as_dvec3)) {
            return;
        }
        if end - first <= LEAF {
            #[cfg(test)]
            (first..end).for_each(|_| visibility_testing::step());
            *looks = looks.saturating_sub(end - first);
            return self.points[first..end].iter().for_each(|&point| each(point));
        }
        let middle = first + (end - first) / 2;
        self.search(2 * node + 1, [first, middle], segment, looks, each);
        self.search(2 * node + 2, [middle, end], segment, looks, each);
    }
}

/// Tests whether a segment certainly misses a closed box: whether they are apart along an axis, or along a
/// direction perpendicular to the segment and to an axis. False if uncertain.
fn is_apart([a, b]: [DVec3; 2], [low, high]: [DVec3; 2]) -> bool {
    if a.max(b).cmplt(low).any() || a.min(b).cmpgt(high).any() {
        return true;
    }
    let (along, half, from) = (b - a, (high - low) * 0.5, (low + high) * 0.5 - a);
    let across = along.cross(from).abs();
    let reach = DVec3::new(
        half.y * along.z.abs() + half.z * along.y.abs(),
        half.z * along.x.abs() + half.x * along.z.abs(),
        half.x * along.y.abs() + half.y * along.x.abs(),
    );
    // Rounding is about 2^-50 of the products in `across`. A point found needlessly is tested exactly later.
    let rounding = 1e-14 * along.abs().max_element() * (from.abs() + half).max_element();
    across.cmpgt(reach + rounding).any()
}

/// Inserts into each edge the vertices that lie on it. `sides` are the sides of the faces, sorted by edge,
/// before the call. Returns the number of corners inserted, and the number of edges that stay as they are
/// because of [`max_inserts`] or [`max_looks`]: their faces share no edges with those that end on them, which
/// only makes polygons smaller. Takes some microseconds for an edge, and [`max_looks`] bounds their sum.
///
/// Edges that two faces share are included, not only open edges: in a level of closed pieces side by side,
/// such as those of a modular kit, all edges are shared.
pub(crate) fn insert_t_junctions(faces: &mut Faces, sides: &[Side]) -> [usize; 2] {
    let tree = PointTree::new((0..faces.vertices.len() as u32).collect(), &faces.vertices);
    let at = |vertex: u32| faces.vertices[vertex as usize];
    // For each vertex found: the corner at which the side starts, and the vertex.
    let mut found: Vec<(u32, u32)> = Vec::new();
    let mut between: Vec<u32> = Vec::new();
    let mut edges = sides.chunk_by(|a, b| a.edge == b.edge);
    let (mut left, mut looks) = (0, max_looks(sides.len()));
    while let Some(same) = edges.next() {
        let [a, b] = same[0].edge.map(at);
        between.clear();
        tree.along(a, b, &mut looks, &mut |vertex| {
            if is_between(a, b, at(vertex)) {
                between.push(vertex);
            }
        });
        if looks == 0 || found.len() + between.len() * same.len() > max_inserts(sides.len()) {
            left = 1 + edges.count();
            break;
        }
        // Points of one line are in order along the axis in which the line is longest.
        let axis = (b - a).abs().max_position();
        between.sort_unstable_by(|&p, &q| at(p)[axis].total_cmp(&at(q)[axis]));
        if b[axis] < a[axis] {
            between.reverse();
        }
        for side in same {
            let from_start = between.iter().map(|&vertex| (side.corner, vertex));
            if side.forward { found.extend(from_start) } else { found.extend(from_start.rev()) }
        }
    }
    let count = found.len();
    // A stable sort keeps the order along each side.
    found.sort_by_key(|&(corner, _)| corner);
    let mut inserts = found.iter().peekable();
    let old = core::mem::take(&mut faces.corners);
    faces.corners.reserve(old.len() + count);
    for face in &mut faces.faces {
        let [first, end] = face.corners;
        face.corners[0] = faces.corners.len() as u32;
        for corner in first..end {
            faces.corners.push(old[corner as usize]);
            while let Some((_, vertex)) = inserts.next_if(|insert| insert.0 == corner) {
                faces.corners.push(*vertex);
            }
        }
        face.corners[1] = faces.corners.len() as u32;
    }
    [count, left]
}

/// Returns the maximum number of corners inserted into faces with `sides` sides, and as many corners: at most
/// [`MAX_INSERTS_PER_SIDE`] for each side, and no more than 32-bit indices of corners allow.
fn max_inserts(sides: usize) -> usize {
    MAX_INSERTS_PER_SIDE.saturating_mul(sides).min((u32::MAX as usize).saturating_sub(sides))
}

/// Returns the maximum number of looks at boxes and points in search of the vertices on all edges of faces
/// with `sides` sides: at most [`MAX_LOOKS_PER_SIDE`] for each side, and [`MIN_LOOKS`] in any level.
fn max_looks(sides: usize) -> usize {
    MAX_LOOKS_PER_SIDE.saturating_mul(sides).saturating_add(MIN_LOOKS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faces::LevelTriangle;
    use visibility_testing::{Random, steps_of};

    /// Points and segments between small whole numbers, whose products `i32` holds.
    #[test]
    fn points_between_ends_are_exactly_on_the_segment() {
        let (mut random, mut counts) = (Random(7), [0; 2]);
        for round in 0..100_000 {
            let whole = [(); 3].map(|()| [(); 3].map(|()| random.between(-2, 2)));
            let [a, b, p] = whole;
            let [along, from, to] = [[a, b], [a, p], [p, b]].map(|[a, b]| [0, 1, 2].map(|i| b[i] - a[i]));
            let is_on_line =
                [(1, 2), (2, 0), (0, 1)].iter().all(|&(i, j)| along[i] * from[j] == along[j] * from[i]);
            let dot = |a: [i32; 3], b: [i32; 3]| (0..3).map(|i| a[i] * b[i]).sum::<i32>();
            let expected = is_on_line && dot(along, from) > 0 && dot(along, to) > 0;
            let [a, b, p] = whole.map(|at| Vec3::from_array(at.map(|x| x as f32)));
            assert_eq!(is_between(a, b, p), expected, "round {round}: {p} between {a} and {b}");
            counts[usize::from(expected)] += 1;
        }
        assert!(counts.iter().all(|&count| count > 100), "points beside and on segments: {counts:?}");
    }

    /// No box is apart from a segment that has a corner of the box or a point in it, at whatever scale and
    /// however long the segment is, but most boxes beside a segment are.
    #[test]
    fn boxes_that_a_segment_meets_are_not_apart_from_it() {
        let (mut random, mut rounded, mut apart) = (Random(8), 0, 0);
        for round in 0..100_000 {
            // The ends are multiples of one direction, of very different lengths.
            let direction = [(); 3].map(|()| f64::from(random.between(-(1 << 23), 1 << 23)));
            let [low, high] = [-random.between(0, 60), random.between(0, 60)];
            let at = |exponent: i32| DVec3::from(direction) * f64::from(exponent).exp2();
            let (a, b) = (-at(low - 1), at(high));
            // A point of the segment with coordinates of `f32`, as the ends have.
            let on = if round % 3 == 0 { DVec3::ZERO } else { at(random.between(low, high)) };
            let size = [0.0, 1.0, 1e9][random.below(3)];
            let [less, more] = [(); 2].map(|()| {
                let by = DVec3::new(random.unit(), random.unit(), random.unit()) * size;
                if random.one_in(2) { by.round() } else { DVec3::ZERO }
            });
            let bounds = [(on - less).as_vec3().as_dvec3(), (on + more).as_vec3().as_dvec3()];
            let holds = bounds[0].cmple(on).all() && on.cmple(bounds[1]).all();
            assert!(
                !holds || !is_apart([a, b], bounds),
                "round {round}: {bounds:?} holds {on}, from {a} to {b}"
            );
            let across = (b - a).cross((bounds[0] + bounds[1]) * 0.5 - a);
            rounded += usize::from(bounds == [on; 2] && across != DVec3::ZERO);
            // The same box far enough beside the segment.
            let beside = (b - a).any_orthonormal_vector()
                * ((bounds[1] - bounds[0]).length() + at(high).length() * 1e-6);
            apart += usize::from(is_apart([a, b], bounds.map(|corner| corner + beside)));
        }
        assert!(rounded > 1_000, "{rounded} points on segments seem to be beside them, by rounding alone");
        assert!(apart > 50_000, "{apart} boxes are apart");
    }

    /// Triangles of which each has a side along x, on which the corners of all shorter ones lie. Of 97, there
    /// are just as many as 16 for each side.
    #[test]
    fn as_many_corners_are_inserted_as_are_allowed() {
        for count in [97, 98] {
            let triangles: Vec<LevelTriangle> = (1..=count)
                .map(|i| {
                    let corners = [Vec3::ZERO, Vec3::X * i as f32, Vec3::new(0.0, 1.0, i as f32)];
                    LevelTriangle { corners, two_sided: true }
                })
                .collect();
            let mut faces = Faces::weld(&triangles);
            let sides = faces.sides();
            let [inserted, left] = insert_t_junctions(&mut faces, &sides);
            assert!(inserted <= 48 * count, "{inserted} corners in {count} triangles");
            let is_all = inserted == count * (count - 1) / 2 && left == 0;
            assert_eq!(is_all, count == 97, "{inserted} corners in {count} triangles, {left} edges are left");
        }
    }

    /// Tests that the corners of the largest levels, with those inserted, have indices of 32 bits.
    #[test]
    fn corners_have_indices_of_32_bits() {
        assert_eq!(max_inserts(30), 480, "a small level");
        for sides in [252_645_135, 252_645_136, 1 << 31, 3 << 30, u32::MAX as usize] {
            let corners = max_inserts(sides) + sides;
            assert!(corners <= u32::MAX as usize, "{sides} sides: {corners} corners");
        }
    }

    /// Returns `count` long triangles of a tube of 1 m, and as many small ones across the tube.
    fn tube_with_bolts(count: usize) -> Vec<LevelTriangle> {
        let mut random = Random(3);
        let mut triangles = Vec::new();
        for i in 0..count {
            let mut across = || random.vec3(0.0, 1.0) * Vec3::new(0.0, 1.0, 1.0);
            let far = Vec3::X * 4000.0;
            triangles.push([across(), far + across(), far + across()]);
            let x = 4000.0 * (i as f32 + 0.5) / count as f32;
            triangles.push([[x, -1.0, -1.0], [x + 0.01, 2.0, -1.0], [x, 0.5, 2.0]].map(Vec3::from_array));
        }
        triangles.into_iter().map(|corners| LevelTriangle { corners, two_sided: true }).collect()
    }

    #[test]
    fn steps_grow_as_triangles_do() {
        let mut left = Vec::new();
        let steps = [100, 500, 1000, 2000].map(|count| {
            let mut faces = Faces::weld(&tube_with_bolts(count));
            let sides = faces.sides();
            steps_of(|| left.push(insert_t_junctions(&mut faces, &sides)[1])) as f64
        });
        std::println!("steps for 100, 500, 1000 and 2000 long triangles: {steps:?}, not split: {left:?}");
        assert!(steps[2] < 2.6 * steps[1] && steps[3] < 2.6 * steps[2], "{steps:?}");
        assert!(left[0] == 0 && left[1] > 0, "edges that are not split: {left:?}");
    }
}
