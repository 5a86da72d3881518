//! Taking opaque polygons away from a polygon of the same plane.

use crate::clip_polygon::clip_into;
use alloc::vec::Vec;
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;

/// Distances below which differences mean nothing, in world units, all parts of one tolerance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lengths {
    /// A polygon whose vertices are all within this of a plane lies in it.
    pub(super) plane: f64,
    /// Opaque polygons are widened by this, so that two that share an edge leave no gap. A corner is cut off
    /// where it would stick out more than 1.42 times as far.
    pub(super) widen: f64,
    /// What is narrower than this is no portal.
    pub(super) sliver: f64,
    /// Points nearer to each other are one, and points nearer to a plane are on it. Some thousand times the
    /// rounding of coordinates.
    pub(super) merge: f64,
}

impl Lengths {
    /// Half of the tolerance for being off the plane and 1.42 quarters for being widened make 0.86 of it:
    /// nothing opaque reaches farther from the polygon that it stands for.
    pub(super) fn new(tolerance: f64, extent: f64) -> Self {
        let merge = extent / (1u64 << 40) as f64;
        Self { plane: tolerance * 0.5, widen: tolerance * 0.25, sliver: tolerance * 0.25, merge }
    }

    /// The least tolerance that leaves room for rounding.
    pub(super) fn least_tolerance(extent: f64) -> f64 {
        extent / (1u64 << 36) as f64
    }
}

/// Appends planes at right angles to that of a polygon, inner side first, whose common part is the polygon
/// widened by `by`.
pub(super) fn around(cover: &[DVec3], normal: DVec3, by: f64, out: &mut Vec<Plane>) {
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
            // A corner sharper than a right angle. In the middle between the sides; where they are opposite,
            // back along the edge.
            let cut = (before + side).try_normalize().unwrap_or(side.cross(inward));
            out.push(Plane::new(cut, by - cut.dot(a)));
        }
    }
}

/// Takes what is inside of all the planes away from polygons. Returns how much area that was.
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
            clip_into(&rest, &plane.flipped(), lengths.merge, &mut outer);
            clip_into(&rest, plane, lengths.merge, &mut inner);
            if width(&outer, normal) > lengths.sliver {
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

/// The area of a polygon, projected along a unit normal.
pub(super) fn area(polygon: &[DVec3], normal: DVec3) -> f64 {
    let sum = polygon
        .windows(2)
        .fold(DVec3::ZERO, |sum, pair| sum + (pair[0] - polygon[0]).cross(pair[1] - polygon[0]));
    (sum.dot(normal) * 0.5).abs()
}

/// The width of a convex polygon: the least distance of two parallel lines with the polygon between them.
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
        // Turned against each other, and the second with a T-junction in the shared edge.
        let middle = (s[0] + s[2]) * 0.5;
        for cover in
            [alloc::vec![s[0], s[1], s[2]], alloc::vec![s[0], s[3], middle], alloc::vec![middle, s[3], s[2]]]
        {
            around(&cover, DVec3::Z, lengths.widen, &mut planes);
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
            around(&square(x, y, 5.0), DVec3::NEG_Z, lengths.widen, &mut planes);
            subtract(&mut pieces, &planes, DVec3::Z, &lengths);
        }
        assert!((left(&pieces) - 25.0).abs() < 1e-3, "{}", left(&pieces));
        // Far away nothing is cut.
        around(&square(50.0, 50.0, 5.0), DVec3::Z, lengths.widen, &mut planes);
        let before = pieces.clone();
        assert_eq!(subtract(&mut pieces, &planes, DVec3::Z, &lengths), 0.0);
        assert_eq!(pieces, before);
    }

    #[test]
    fn a_needle_covers_no_more_than_beside_itself() {
        let lengths = Lengths::new(1e-2, 100.0);
        let needle = [[0.0, 0.0], [10.0, 0.0], [10.0, 1e-3]].map(|[x, y]| DVec3::new(x, y, 0.0));
        let mut planes = Vec::new();
        around(&needle, DVec3::Z, lengths.widen, &mut planes);
        let inside = |p: DVec3| planes.iter().all(|plane| plane.signed_distance(p) >= 0.0);
        assert!(inside(DVec3::new(-0.002, 0.0, 0.0)) && !inside(DVec3::new(-0.004, 0.0, 0.0)));
        assert!(inside(DVec3::new(5.0, -0.002, 0.0)) && !inside(DVec3::new(5.0, -0.003, 0.0)));
    }
}
