//! Merging of coplanar convex polygons into fewer polygons that cover at least the same area.
//!
//! Subtracting opaque polygons from a portal leaves more pieces than necessary. Two pieces are replaced by
//! their convex hull if the hull is hardly larger than both. A little opaque area then counts as open, which
//! is conservative, and chains of portals become far fewer.

use super::subtract_polygons::area;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// Maximum fraction of the area of the convex hull of two or more pieces that the pieces may leave uncovered
/// for the hull to replace them.
const WASTE: f64 = 0.1;

/// Maximum number of pieces that are merged in pairs. With more pieces, only the hull of all pieces is tried.
const MAX_PAIRWISE_PIECES: usize = 48;

/// Merges coplanar convex pieces and replaces `pieces` by the result, convex polygons that cover at least all
/// points of the input. `normal` is the unit normal of the common plane.
pub(super) fn merge_pieces(pieces: &mut Vec<Vec<DVec3>>, normal: DVec3) {
    if pieces.len() < 2 {
        return;
    }
    let open: f64 = pieces.iter().map(|piece| area(piece, normal)).sum();
    let whole = hull(pieces.iter().flatten().copied(), normal);
    if area(&whole, normal) * (1.0 - WASTE) <= open
        || pieces.len() > MAX_PAIRWISE_PIECES && area(&whole, normal) <= 2.0 * open
    {
        pieces.clear();
        pieces.push(whole);
        return;
    }
    if pieces.len() > MAX_PAIRWISE_PIECES {
        return;
    }
    let mut i = 0;
    while i < pieces.len() {
        let joined = (i + 1..pieces.len()).find_map(|j| {
            let both = hull(pieces[i].iter().chain(&pieces[j]).copied(), normal);
            let open = area(&pieces[i], normal) + area(&pieces[j], normal);
            (area(&both, normal) * (1.0 - WASTE) <= open).then_some((j, both))
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
}

/// Returns the convex hull of coplanar points, counter-clockwise around the unit `normal` of their plane
/// (Andrew, "Another Efficient Algorithm for Convex Hulls in Two Dimensions", 1979).
fn hull(points: impl Iterator<Item = DVec3>, normal: DVec3) -> Vec<DVec3> {
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

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(areas, [3.0, 27.0]);
        assert!(pieces.iter().all(|piece| piece.len() == 4), "{pieces:?}");
    }
}
