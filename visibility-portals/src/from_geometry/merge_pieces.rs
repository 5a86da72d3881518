//! Merging of coplanar convex polygons into fewer polygons that cover at least the same area.
//!
//! Subtracting opaque polygons from a portal leaves more pieces than necessary. Two pieces are replaced by
//! their convex hull if the hull is hardly larger than both, or where there are too many. A little opaque
//! area then counts as open, which is conservative, and chains of portals become far fewer.

use super::subtract_polygons::{area, bounds};
use alloc::vec::Vec;
use visibility_core::geometry::{ConvexPolygon, PolygonError};
use visibility_core::glam::{DVec2, DVec3};

/// Maximum fraction of the area of the convex hull of two or more pieces that the pieces may leave uncovered
/// for the hull to replace them.
const WASTE: f64 = 0.1;

/// Maximum number of pieces that are left. More are merged in pairs, first the pair whose hull wastes least.
const MAX_PIECES: usize = 8;

/// Maximum number of pieces that are compared in pairs. Of more pieces, neighbours along the longest side of
/// their bounds are merged first.
const MAX_PAIRWISE_PIECES: usize = 48;

/// Merges coplanar convex pieces and replaces `pieces` by the result, at most [`MAX_PIECES`] convex polygons
/// that cover at least all points of the input. `normal` is the unit normal of the common plane.
pub(super) fn merge_pieces(pieces: &mut Vec<Vec<DVec3>>, normal: DVec3) {
    if pieces.len() < 2 {
        return;
    }
    let open: f64 = pieces.iter().map(|piece| area(piece, normal)).sum();
    let whole = hull(pieces.iter().flatten().copied(), normal);
    if area(&whole, normal) * (1.0 - WASTE) <= open {
        pieces.clear();
        pieces.push(whole);
        return;
    }
    while pieces.len() > MAX_PAIRWISE_PIECES {
        merge_neighbours(pieces, normal);
    }
    let mut i = 0;
    while i < pieces.len() {
        let joined = (i + 1..pieces.len()).find_map(|j| {
            let (both, waste) = join(&pieces[i], &pieces[j], normal);
            (waste <= WASTE * area(&both, normal)).then_some((j, both))
        });
        match joined {
            // The merged piece may now fit pieces that were passed over, so the search starts again.
            Some((j, both)) => {
                pieces.swap_remove(j);
                pieces[i] = both;
                i = 0;
            }
            None => i += 1,
        }
    }
    while pieces.len() > 3 * MAX_PIECES {
        merge_neighbours(pieces, normal);
    }
    while pieces.len() > MAX_PIECES {
        let pairs = (1..pieces.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
        let joined = pairs.map(|(i, j)| (i, j, join(&pieces[i], &pieces[j], normal)));
        let Some((i, j, (both, _))) = joined.min_by(|a, b| a.2.1.total_cmp(&b.2.1)) else { return };
        pieces.swap_remove(j);
        pieces[i] = both;
    }
}

/// Returns the convex hull of two coplanar convex pieces, and the area of the hull less the areas of both:
/// what the hull adds, if they do not overlap. `normal` is the unit normal of their plane.
fn join(a: &[DVec3], b: &[DVec3], normal: DVec3) -> (Vec<DVec3>, f64) {
    let both = hull(a.iter().chain(b).copied(), normal);
    let waste = area(&both, normal) - area(a, normal) - area(b, normal);
    (both, waste)
}

/// Halves the number of coplanar convex pieces, rounding up: sorts them along the longest side of their
/// bounds, and replaces each two that follow each other by their hull. `normal` is the unit normal of their
/// plane.
fn merge_neighbours(pieces: &mut Vec<Vec<DVec3>>, normal: DVec3) {
    let (min, max) = bounds(pieces.iter().flatten());
    let size = max - min;
    let axis = (0..3).fold(0, |longest, axis| if size[axis] > size[longest] { axis } else { longest });
    let middle = |piece: &[DVec3]| piece.iter().map(|p| p[axis]).sum::<f64>() / piece.len() as f64;
    pieces.sort_by(|a, b| middle(a).total_cmp(&middle(b)));
    *pieces = pieces.chunks(2).map(|pair| hull(pair.iter().flatten().copied(), normal)).collect();
}

/// Returns the convex hull of coplanar points, counter-clockwise around the unit `normal` of their plane
/// (Andrew, "Another Efficient Algorithm for Convex Hulls in Two Dimensions", 1979).
pub(super) fn hull(points: impl Iterator<Item = DVec3>, normal: DVec3) -> Vec<DVec3> {
    let u = normal.any_orthonormal_vector();
    let v = normal.cross(u);
    let mut flat: Vec<(f64, f64, DVec3)> = points.map(|p| (u.dot(p), v.dot(p), p)).collect();
    flat.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut hull: Vec<(f64, f64, DVec3)> = Vec::new();
    let count = flat.len();
    // Along the lower side, and back along the upper.
    for lower in [true, false] {
        let base = hull.len();
        for i in 0..count {
            let p = flat[if lower { i } else { count - 1 - i }];
            while hull.len() >= base + 2 {
                let (a, b) = (hull[hull.len() - 2], hull[hull.len() - 1]);
                if (b.0 - a.0) * (p.1 - a.1) - (b.1 - a.1) * (p.0 - a.0) > 0.0 {
                    break;
                }
                hull.pop();
            }
            hull.push(p);
        }
        // The last point of each side is the first of the other.
        hull.pop();
    }
    hull.into_iter().map(|(_, _, p)| p).collect()
}

/// Returns the open `pieces` of a `section` between two leaves as convex polygons that cover at least the
/// same area, up to rounding. Pieces without area are left out. `normal` is the unit normal of all.
///
/// Vertices that should be one are often two, and the edge between them has any direction: to the others, it
/// makes a polygon that is not convex. Edges of at most `short` world units become a point, in which the
/// edges beside them meet. The whole section takes the place of a piece that is not convex even so.
pub(super) fn convex_polygons(
    pieces: Vec<Vec<DVec3>>,
    section: &[DVec3],
    normal: DVec3,
    short: f64,
) -> impl Iterator<Item = ConvexPolygon> {
    pieces.into_iter().filter_map(move |piece| {
        let mut mended = piece.clone();
        drop_short_edges(&mut mended, normal, short);
        match ConvexPolygon::new(mended) {
            Ok(polygon) => Some(polygon),
            // Not much larger than its short edges, or without area.
            Err(PolygonError::NoPlane | PolygonError::TooFewVertices { .. }) => {
                ConvexPolygon::new(piece).ok()
            }
            Err(_) => {
                let mut section = section.to_vec();
                drop_short_edges(&mut section, normal, short);
                ConvexPolygon::new(section.iter().copied())
                    .or_else(|_| ConvexPolygon::new(rectangle_around(&section, normal)))
                    .ok()
            }
        }
    })
}

/// Replaces each edge of at most `short` world units, the shortest first, by the point where the lines along
/// the edges before and after it meet. A short edge across a sharp corner stays.
fn drop_short_edges(polygon: &mut Vec<DVec3>, normal: DVec3, short: f64) {
    while polygon.len() > 3 {
        let count = polygon.len();
        let at = |i: usize| polygon[i % count];
        let sides = |i: usize| (at(i) - at(i + count - 1), at(i + 2) - at(i + 1));
        let is_blunt = |&i: &usize| {
            let (before, after) = sides(i);
            before.dot(after) > -0.9 * before.length() * after.length()
        };
        let length = |i: usize| at(i).distance(at(i + 1));
        let shortest = (0..count).filter(is_blunt).min_by(|&i, &j| length(i).total_cmp(&length(j)));
        let Some(i) = shortest.filter(|&i| length(i) <= short) else { return };
        let (before, after) = sides(i);
        let along = (at(i + 1) - at(i)).cross(after).dot(normal) / before.cross(after).dot(normal);
        let meeting = at(i) + before * along;
        // Edges along one line meet anywhere on it by rounding alone: either end of the short edge will do.
        let point = if meeting.distance(at(i)) <= 4.0 * short { meeting } else { at(i) };
        polygon[i] = point;
        polygon.remove((i + 1) % count);
    }
}

/// Returns the vertices of a rectangle around points in a plane with the unit normal `normal`.
fn rectangle_around(points: &[DVec3], normal: DVec3) -> [DVec3; 4] {
    let u = normal.any_orthonormal_vector();
    let v = normal.cross(u);
    let first = points.first().copied().unwrap_or_default();
    let flat = points.iter().map(|&p| DVec2::new(u.dot(p - first), v.dot(p - first)));
    let (min, max) = flat.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(a, b), p| (a.min(p), b.max(p)));
    [min, DVec2::new(max.x, min.y), max, DVec2::new(min.x, max.y)].map(|p| first + u * p.x + v * p.y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec;

    fn rectangle(x: [f64; 2], y: [f64; 2]) -> Vec<DVec3> {
        [[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]].map(|[x, y]| DVec3::new(x, y, 7.0)).to_vec()
    }

    #[test]
    fn strips_side_by_side_become_one_and_windows_apart_stay_two() {
        let mut pieces: Vec<_> =
            (0..9).map(|i| rectangle([f64::from(i), f64::from(i) + 1.0], [0.0, 3.0])).collect();
        pieces.push(rectangle([20.0, 21.0], [0.0, 3.0]));
        merge_pieces(&mut pieces, DVec3::Z);
        let mut areas: Vec<f64> = pieces.iter().map(|piece| area(piece, DVec3::Z)).collect();
        areas.sort_unstable_by(f64::total_cmp);
        assert_eq!(areas, [3.0, 27.0], "areas of the nine joined strips and of the window apart");
        assert!(pieces.iter().all(|piece| piece.len() == 4), "{pieces:?}");
    }

    #[test]
    fn many_windows_become_few_that_cover_them_all() {
        // A lattice of 20 x 7 panes, half of which is frame.
        let panes: Vec<_> = (0..140)
            .map(|i| (f64::from(i % 20), f64::from(i / 20)))
            .map(|(x, y)| rectangle([x, x + 0.7], [y, y + 0.7]))
            .collect();
        let mut pieces = panes.clone();
        merge_pieces(&mut pieces, DVec3::Z);
        assert!(!pieces.is_empty() && pieces.len() <= MAX_PIECES, "{}", pieces.len());
        for &corner in panes.iter().flatten() {
            let inside = |piece: &Vec<DVec3>| {
                (0..piece.len()).all(|i| {
                    let (a, b) = (piece[i], piece[(i + 1) % piece.len()]);
                    (b - a).cross(corner - a).z >= -1e-9
                })
            };
            assert!(pieces.iter().any(inside), "{corner} is not covered");
        }
    }

    fn only(piece: Vec<DVec3>) -> Option<ConvexPolygon> {
        let section = rectangle([-5.0, 25.0], [-5.0, 15.0]);
        convex_polygons(vec![piece], &section, DVec3::Z, 1e-3).next()
    }

    /// Two vertices 1e-14 apart, between which an edge leads anywhere, at a corner and along a side.
    #[test]
    fn edges_without_a_direction_leave_a_polygon_convex() {
        let off = DVec3::new(3e-15, -9e-15, 0.0);
        let [a, b, c, d] = rectangle([0.0, 20.0], [0.0, 10.0])[..] else { unreachable!() };
        let middle = (a + b) * 0.5;
        let pieces =
            [vec![a, b, b + off, c, d], vec![a, middle, middle + off, b, c, d], vec![a, a - off, b, c, d]];
        for piece in pieces {
            assert!(ConvexPolygon::new(piece.clone()).is_err(), "{piece:?}");
            let polygon = only(piece).unwrap();
            assert!((polygon.area() - 200.0).abs() < 1e-9, "{polygon:?}");
        }
    }

    /// A corner that is cut off by less than the length of short edges, and a tip as narrow.
    #[test]
    fn short_edges_are_left_out_outwards() {
        let [x, y] = [DVec3::X, DVec3::Y];
        let polygon = only(vec![x * 1e-4, x, x + y, y, y * 1e-4]).unwrap();
        assert!(polygon.vertices().len() == 4 && (polygon.area() - 1.0).abs() < 1e-12, "{polygon:?}");
        let tip = vec![y * -5e-5, x * 9.0 - y, x * 9.0 + y, y * 5e-5];
        assert_eq!(only(tip.clone()).unwrap().vertices(), tip, "a narrow tip");
    }

    #[test]
    fn the_whole_section_takes_the_place_of_what_is_not_convex() {
        let [x, y] = [DVec3::X, DVec3::Y];
        let arrow = vec![DVec3::ZERO, x * 4.0 - y * 3.0, x * 2.0, x * 4.0 + y * 3.0];
        assert_eq!(only(arrow.clone()).unwrap().area(), 600.0, "the area of the section");
        let around = convex_polygons(vec![arrow.clone()], &arrow, DVec3::Z, 1e-3).next().unwrap();
        assert!((around.area() - 24.0).abs() < 1e-9, "{around:?} around a section that is not convex either");
        assert_eq!(only(vec![x, x * 2.0, x * 3.0]), None, "a piece without area");
    }
}
