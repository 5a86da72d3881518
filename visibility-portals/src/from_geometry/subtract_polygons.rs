//! Subtraction of opaque polygons from a coplanar polygon.

use crate::clip_polygon::clip_into;
use alloc::vec::Vec;
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;

/// Distances below which differences are ignored, in world units. `merge` is derived from the size of the
/// coordinates, the others from the tolerance of the settings.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lengths {
    /// Tolerance of coplanarity: a polygon whose vertices are all within this distance of a plane lies in
    /// the plane.
    pub(super) plane: f64,
    /// Opaque polygons are widened by this distance, so that two polygons that share an edge leave no gap. A
    /// corner of a widened polygon is cut off where it would extend more than 1.42 times this distance
    /// beyond the corner of the input polygon.
    pub(super) widen: f64,
    /// Minimum width: an input polygon no wider than this covers nothing.
    pub(super) sliver: f64,
    /// Points no farther apart than this become one, and points no farther from a plane are on it. About a
    /// thousand times the rounding of the coordinates.
    pub(super) merge: f64,
    /// Distance that an opaque polygon may be from the plane in which it divides cells, rounding included.
    pub(super) misplacement: f64,
}

impl Lengths {
    /// Returns the lengths for a tolerance and for coordinates of at most `extent` in absolute value, all in
    /// world units. An opaque point is off its input polygon by at most 1/2 of the tolerance across the plane
    /// and by at most 1.42/2 along it: by less than the tolerance.
    pub(super) fn new(tolerance: f64, extent: f64) -> Self {
        let merge = extent / (1u64 << 40) as f64;
        let [plane, widen, sliver] = [0.5, 0.5, 0.25].map(|share| share * tolerance);
        Self { plane, widen, sliver, merge, misplacement: plane + 4.0 * merge }
    }

    /// Returns the smallest tolerance, in world units, that exceeds the rounding of coordinates of at most
    /// `extent` in absolute value, with a margin.
    pub(super) fn least_tolerance(extent: f64) -> f64 {
        extent / (1u64 << 36) as f64
    }
}

/// Replaces `out` by planes perpendicular to the plane of `cover`, with normals to the inside, whose common
/// inner side is the convex polygon `cover` widened by `by` world units. `normal` is the unit normal of the
/// polygon's plane, in either orientation.
pub(super) fn widened_sides(cover: &[DVec3], normal: DVec3, by: f64, out: &mut Vec<Plane>) {
    out.clear();
    let doubled =
        cover.windows(2).fold(DVec3::ZERO, |sum, pair| sum + (pair[0] - cover[0]).cross(pair[1] - cover[0]));
    let inward = if doubled.dot(normal) < 0.0 { -normal } else { normal };
    let mut edges: Vec<(DVec3, DVec3)> = Vec::with_capacity(cover.len());
    for (i, &a) in cover.iter().enumerate() {
        let b = cover[(i + 1) % cover.len()];
        if let Some(side) = inward.cross(b - a).try_normalize() {
            edges.push((a, side));
        }
    }
    for (i, &(a, side)) in edges.iter().enumerate() {
        out.push(Plane::new(side, by - side.dot(a)));
        let (_, before) = edges[(i + edges.len() - 1) % edges.len()];
        if before.dot(side) < 0.0 {
            // A corner sharper than a right angle is cut off perpendicular to its bisector. Where the two
            // sides are opposite, the cut is perpendicular to the edge.
            let cut = (before + side).try_normalize().unwrap_or(side.cross(inward));
            out.push(Plane::new(cut, by - cut.dot(a)));
        }
    }
}

/// Subtracts the region on the inner side of all `planes` from the convex polygons `pieces`, and replaces
/// `pieces` by the remaining parts. Returns the subtracted area in square world units. `normal` is the unit
/// normal of the pieces.
///
/// A narrow part beside the line of an edge remains: the line leaves its polygon behind, so that the part may
/// be far from all polygons, and beside the lines of many polygons lie many parts.
pub(super) fn subtract(
    pieces: &mut Vec<Vec<DVec3>>,
    planes: &[Plane],
    normal: DVec3,
    lengths: &Lengths,
) -> f64 {
    let (mut left, mut covered) = (Vec::with_capacity(pieces.len()), 0.0);
    let (mut inner, mut outer) = (Vec::new(), Vec::new());
    for piece in pieces.drain(..) {
        let outside = |plane: &Plane| piece.iter().all(|&p| plane.signed_distance(p) <= lengths.merge);
        if planes.len() < 3 || planes.iter().any(outside) {
            left.push(piece);
            continue;
        }
        let mut rest = piece;
        for plane in planes {
            // What is lost of a cut is lost once for each polygon of a row: no more than rounding, 2^-51 of
            // the greatest coordinate, of which hundreds are less than vertices may be merged elsewhere.
            let rounding = lengths.merge / 2048.0;
            clip_into(&rest, &plane.flipped(), rounding, &mut outer);
            clip_into(&rest, plane, rounding, &mut inner);
            if !outer.is_empty() {
                left.push(core::mem::take(&mut outer));
            }
            core::mem::swap(&mut rest, &mut inner);
            if rest.is_empty() {
                break;
            }
        }
        covered += area(&rest, normal);
    }
    *pieces = left;
    covered
}

/// Returns the minimum and the maximum corner of the box around points.
pub(super) fn bounds<'a>(points: impl IntoIterator<Item = &'a DVec3>) -> (DVec3, DVec3) {
    let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    points.into_iter().fold(empty, |(min, max), &p| (min.min(p), max.max(p)))
}

/// Returns the area of a polygon projected along a unit normal, in square world units, for vertices in
/// clockwise or counter-clockwise order. 0 for an empty polygon.
pub(super) fn area(polygon: &[DVec3], normal: DVec3) -> f64 {
    let sum = polygon
        .windows(2)
        .fold(DVec3::ZERO, |sum, pair| sum + (pair[0] - polygon[0]).cross(pair[1] - polygon[0]));
    (sum.dot(normal) * 0.5).abs()
}

/// Returns the width of a convex polygon: the smallest distance of two parallel lines with the polygon
/// between them. `normal` is the unit normal of its plane. 0 if the polygon is empty or all its vertices
/// coincide.
pub(super) fn width(polygon: &[DVec3], normal: DVec3) -> f64 {
    let mut least = f64::INFINITY;
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        if let Some(side) = normal.cross(b - a).try_normalize() {
            let most = polygon.iter().fold(0.0, |most: f64, &p| most.max(side.dot(p - a).abs()));
            least = least.min(most);
        }
    }
    if least.is_finite() { least } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x: f64, y: f64, side: f64) -> Vec<DVec3> {
        [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
            .map(|[a, b]| DVec3::new(x + a * side, y + b * side, 0.0))
            .to_vec()
    }

    fn left(pieces: &[Vec<DVec3>]) -> f64 {
        pieces.iter().map(|piece| area(piece, DVec3::Z)).sum()
    }

    #[test]
    fn triangles_that_share_an_edge_leave_nothing_between_them() {
        let lengths = Lengths::new(1e-4, 100.0);
        let s = square(3.1, 4.7, 10.0 / 3.0);
        let mut pieces = alloc::vec![s.clone()];
        let mut planes = Vec::new();
        // The triangles have opposite orientations, and the second diagonal has a T-junction.
        let middle = (s[0] + s[2]) * 0.5;
        for cover in
            [alloc::vec![s[0], s[1], s[2]], alloc::vec![s[0], s[3], middle], alloc::vec![middle, s[3], s[2]]]
        {
            widened_sides(&cover, DVec3::Z, lengths.widen, &mut planes);
            subtract(&mut pieces, &planes, DVec3::Z, &lengths);
        }
        assert!(pieces.is_empty(), "{pieces:?}");
    }

    #[test]
    fn a_window_stays_open() {
        let lengths = Lengths::new(1e-4, 100.0);
        let mut pieces = alloc::vec![square(0.0, 0.0, 10.0)];
        let mut planes = Vec::new();
        for (x, y) in [(0.0, 0.0), (5.0, 5.0), (0.0, 5.0)] {
            widened_sides(&square(x, y, 5.0), DVec3::NEG_Z, lengths.widen, &mut planes);
            subtract(&mut pieces, &planes, DVec3::Z, &lengths);
        }
        assert!((left(&pieces) - 25.0).abs() < 1e-3, "{}", left(&pieces));
        // A distant polygon subtracts nothing.
        widened_sides(&square(50.0, 50.0, 5.0), DVec3::Z, lengths.widen, &mut planes);
        let before = pieces.clone();
        assert_eq!(
            subtract(&mut pieces, &planes, DVec3::Z, &lengths),
            0.0,
            "the area that a distant polygon subtracts"
        );
        assert_eq!(pieces, before, "a distant polygon changes no piece");
    }

    /// Each cover of a column ends a little before the one below it. The narrow strip that it leaves is as
    /// long as the whole piece, and is open above.
    #[test]
    fn strips_narrower_than_merged_vertices_are_left() {
        let lengths = Lengths::new(1e-4, 100.0);
        let mut pieces = alloc::vec![square(0.0, 0.0, 10.0)];
        for i in 0..50 {
            let [low, right] = [0.1 * f64::from(i), 10.0 - 0.9 * lengths.merge * f64::from(i + 1)];
            let x = [Plane::new(DVec3::NEG_X, right), Plane::new(DVec3::X, 1.0)];
            let y = [Plane::new(DVec3::Y, -low), Plane::new(DVec3::NEG_Y, low + 0.1)];
            subtract(&mut pieces, &[x, y].concat(), DVec3::Z, &lengths);
        }
        let (min, max) = bounds(pieces.iter().flatten());
        assert_eq!((min, max), (DVec3::ZERO, DVec3::new(10.0, 10.0, 0.0)), "bounds of what is left");
    }

    #[test]
    fn a_needle_covers_no_more_than_beside_itself() {
        let lengths = Lengths::new(1e-2, 100.0);
        let needle = [[0.0, 0.0], [10.0, 0.0], [10.0, 1e-3]].map(|[x, y]| DVec3::new(x, y, 0.0));
        let mut planes = Vec::new();
        widened_sides(&needle, DVec3::Z, lengths.widen, &mut planes);
        let inside = |p: DVec3| planes.iter().all(|plane| plane.signed_distance(p) >= 0.0);
        assert!(
            inside(DVec3::new(-0.004, 0.0, 0.0)) && !inside(DVec3::new(-0.006, 0.0, 0.0)),
            "the needle's tip, 4 mm and 6 mm beyond"
        );
        assert!(
            inside(DVec3::new(5.0, -0.004, 0.0)) && !inside(DVec3::new(5.0, -0.006, 0.0)),
            "the needle's side, 4 mm and 6 mm beyond"
        );
    }

    #[test]
    fn less_than_three_sides_cover_nothing() {
        let lengths = Lengths::new(1e-4, 100.0);
        let sides = [Plane::new(DVec3::X, 1.0), Plane::new(DVec3::Y, 1.0), Plane::new(-DVec3::X, 9.0)];
        for (count, expected) in [(0, 100.0), (1, 100.0), (2, 100.0), (3, 10.0)] {
            let mut pieces = alloc::vec![square(0.0, 0.0, 10.0)];
            let covered = subtract(&mut pieces, &sides[..count], DVec3::Z, &lengths);
            assert_eq!((left(&pieces), covered), (expected, 100.0 - expected), "{count} sides");
        }
    }

    #[test]
    fn corners_sharper_than_a_right_angle_are_cut_off() {
        let count = |corners: &[[f64; 2]]| {
            let cover: Vec<DVec3> = corners.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect();
            let [mut planes, mut turned] = [Vec::new(), Vec::new()];
            widened_sides(&cover, DVec3::Z, 0.5, &mut planes);
            widened_sides(&cover, -DVec3::Z, 0.5, &mut turned);
            assert_eq!(planes, turned, "planes for a normal of either sense");
            for (plane, p) in planes.iter().flat_map(|plane| cover.iter().map(move |&p| (plane, p))) {
                assert!(plane.signed_distance(p) > 0.4999, "{p} is as far within {plane:?} as the widening");
            }
            planes.len()
        };
        assert_eq!(count(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]), 4, "a square");
        assert_eq!(count(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0]]), 5, "a triangle with a right angle");
        assert_eq!(count(&[[0.0, 0.0], [0.0, 4.0], [4.0, 4.0]]), 5, "a triangle that is clockwise");
        assert_eq!(
            count(&[[0.0, 0.0], [4.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]),
            4,
            "an edge without length"
        );
    }

    #[test]
    fn the_width_is_the_least_of_all_directions() {
        let of = |corners: &[[f64; 2]]| {
            let polygon: Vec<DVec3> = corners.iter().map(|&[x, y]| DVec3::new(x, y, 7.0)).collect();
            width(&polygon, DVec3::Z)
        };
        assert_eq!(of(&[[0.0, 0.0], [9.0, 0.0], [9.0, 2.0], [0.0, 2.0]]), 2.0, "a rectangle");
        assert_eq!(of(&[[0.0, 0.0], [3.0, 0.0], [3.0, 9.0], [0.0, 9.0]]), 3.0, "a rectangle that is upright");
        assert!(
            (of(&[[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]]) - 2.4).abs() < 1e-12,
            "a triangle, across its longest side"
        );
        assert_eq!((of(&[]), of(&[[1.0, 1.0], [1.0, 1.0]])), (0.0, 0.0), "no polygon, and a point");
    }
}
