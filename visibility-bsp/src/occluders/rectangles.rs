//! Joining of axis-aligned faces into maximal covered rectangles.
//!
//! Two triangles that form an axis-aligned rectangle are replaced by it. Rectangles that lie in exactly the
//! same plane, bit for bit, and are connected are laid out on the grid of their sides. Of the grid's cells,
//! all maximal covered rectangles are found. Coordinates are only compared, never computed, so a joined
//! rectangle covers only what its parts cover. Joined rectangles may overlap, so that fewer are needed and no
//! crack runs between them.

use super::cover::join_group;
use super::outline::{OccluderTriangle, Outline};
use super::overlaps::{Rectangle, groups};
use alloc::collections::BTreeMap;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// An axis-aligned plane: the axis that it is perpendicular to (0 to 2), its coordinate on that axis as
/// [`ordered`] bits, and the way its faces look (0 along the negative axis, 1 along the positive axis, 2
/// both).
pub(super) type Level = (usize, u64, u8);
/// The rectangles in each axis-aligned plane. The two coordinates of a rectangle are along the two axes that
/// follow the plane's axis cyclically.
pub(super) type Levels = BTreeMap<Level, Vec<Rectangle>>;

/// Joins the rectangles of each plane into fewer and larger ones. Returns them as polygons that cover exactly
/// the same points, or fewer where a group exceeds the limits of the module `cover`.
pub(super) fn join(levels: &Levels) -> Vec<Outline> {
    let mut outlines = Vec::new();
    for (&(axis, bits, facing), rectangles) in levels {
        let at = from_ordered(bits);
        for group in groups(rectangles) {
            join_group(&group, |low, high, sources| {
                outlines.push(Outline {
                    vertices: corners(axis, at, low, high, facing == 0),
                    inner: Vec::new(),
                    sources,
                    solids: Vec::new(),
                    two_sided: facing == 2,
                });
            });
        }
    }
    outlines
}

/// Returns the bits of a number that is not NaN, mapped so that their unsigned order is the order of the
/// numbers. Positive and negative zero map to the same bits.
pub(super) fn ordered(x: f64) -> u64 {
    let bits = (x + 0.0).to_bits();
    if bits >> 63 != 0 { !bits } else { bits | 1 << 63 }
}

/// Returns the number that [`ordered`] maps to `bits`; the inverse of `ordered`, except that -0 becomes 0.
pub(super) fn from_ordered(bits: u64) -> f64 {
    f64::from_bits(if bits >> 63 != 0 { bits & !(1 << 63) } else { !bits })
}

/// Returns the corners of a rectangle in the plane at coordinate `at` of `axis`, in metres relative to
/// `Scene::origin`. `low` and `high` are its minimum and maximum along the two axes after `axis`, cyclically.
/// Corners run counter-clockwise as seen from the positive end of `axis`, or from the negative end if `down`.
pub(super) fn corners(axis: usize, at: f64, low: [f64; 2], high: [f64; 2], down: bool) -> Vec<DVec3> {
    let mut around = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]];
    if down {
        around.reverse();
    }
    around
        .map(|p| {
            let mut v = DVec3::ZERO;
            v[axis] = at;
            v[(axis + 1) % 3] = p[0];
            v[(axis + 2) % 3] = p[1];
            v
        })
        .into()
}

/// Removes from `triangles` all pairs of triangles of one object that form an axis-aligned rectangle. Returns
/// the rectangles by plane.
pub(super) fn take_rectangles(triangles: &mut Vec<OccluderTriangle>) -> Levels {
    let mut levels = Levels::new();
    // Triangles whose other half of a rectangle was not found yet. For each plane, rectangle and source: the
    // indices of the triangles that lack corner 0, 1, 2 or 3.
    type Key = (Level, [u64; 4], u32);
    let mut halves: BTreeMap<Key, [Option<usize>; 4]> = BTreeMap::new();
    let mut taken = alloc::vec![false; triangles.len()];
    for (number, triangle) in triangles.iter().enumerate() {
        let [a, b, c] = triangle.corners;
        let Some(axis) = (0..3).find(|&axis| a[axis] == b[axis] && b[axis] == c[axis]) else { continue };
        let flat = triangle.corners.map(|p| [p[(axis + 1) % 3], p[(axis + 2) % 3]]);
        let low = [0, 1].map(|i| flat[0][i].min(flat[1][i]).min(flat[2][i]));
        let high = [0, 1].map(|i| flat[0][i].max(flat[1][i]).max(flat[2][i]));
        // Each vertex must be at a corner of the rectangle, and all corners but one must be taken. Without an
        // area, at least two corners are not.
        let mut missing = 0b1111u32;
        for p in flat {
            let at = [0, 1].map(|i| (p[i] == low[i], p[i] == high[i]));
            if (at[0].0 || at[0].1) && (at[1].0 || at[1].1) {
                missing &= !(1 << (usize::from(at[0].1) + 2 * usize::from(at[1].1)));
            }
        }
        if missing.count_ones() != 1 {
            continue;
        }
        let missing = missing.trailing_zeros() as usize;
        let turn = (flat[1][0] - flat[0][0]) * (flat[2][1] - flat[0][1])
            - (flat[1][1] - flat[0][1]) * (flat[2][0] - flat[0][0]);
        let facing = if triangle.two_sided { 2 } else { u8::from(turn > 0.0) };
        let level = (axis, ordered(a[axis]), facing);
        let key = (level, [low[0], low[1], high[0], high[1]].map(ordered), triangle.source);
        let unpaired = halves.entry(key).or_default();
        if let Some(other) = unpaired[3 - missing].take() {
            (taken[number], taken[other]) = (true, true);
            levels.entry(level).or_default().push(Rectangle { low, high, source: triangle.source });
        } else {
            unpaired[missing] = Some(number);
        }
    }
    let mut taken = taken.iter();
    triangles.retain(|_| !taken.next().copied().unwrap_or(false));
    levels
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the two triangles of the rectangle from (y, z) = `low` to `high` in the plane x = 1, facing
    /// +x, with `source` as their object.
    fn quad(low: [f64; 2], high: [f64; 2], source: u32) -> [OccluderTriangle; 2] {
        let p = |y: f64, z: f64| DVec3::new(1.0, y, z);
        let [a, b, c, d] = [p(low[0], low[1]), p(high[0], low[1]), p(high[0], high[1]), p(low[0], high[1])];
        [[a, b, c], [a, c, d]].map(|corners| OccluderTriangle { corners, source, two_sided: false })
    }

    #[test]
    fn a_wall_with_a_window_becomes_the_four_strips_around_it() {
        // Full-height strips beside the window, one triangle below it and one above.
        let parts = [
            ([0.0, 0.0], [2.0, 3.0]),
            ([2.0, 0.0], [3.0, 1.0]),
            ([2.0, 2.0], [3.0, 3.0]),
            ([3.0, 0.0], [5.0, 3.0]),
        ];
        let mut triangles: Vec<OccluderTriangle> =
            parts.iter().zip(0..).flat_map(|(&(low, high), source)| quad(low, high, source)).collect();
        let outlines = join(&take_rectangles(&mut triangles));
        assert!(triangles.is_empty(), "all triangles belong to rectangles");
        let mut boxes: Vec<_> = outlines.iter().map(|o| (o.vertices[0].truncate(), o.vertices[2])).collect();
        boxes.sort_by(|a, b| (a.0.y, a.1.z).partial_cmp(&(b.0.y, b.1.z)).unwrap());
        assert_eq!(outlines.len(), 4, "strips around the window");
        let open = |y: f64, z: f64| (2.0..3.0).contains(&y) && (1.0..2.0).contains(&z);
        for o in &outlines {
            let (low, high) = (o.vertices[0], o.vertices[2]);
            assert!(
                low.y < high.y && low.z < high.z && low.x == 1.0,
                "{o:?} has an area in the plane of the wall"
            );
            let middle = (low + high) * 0.5;
            assert!(!open(middle.y, middle.z), "the middle of {o:?} is not in the window");
            assert!(!(low.y < 3.0 && high.y > 2.0 && low.z < 2.0 && high.z > 1.0), "{o:?} covers the window");
        }
        let widest = outlines.iter().find(|o| o.sources.len() == 3).expect("below the window, all along");
        assert!(
            widest.vertices.iter().any(|v| v.y == 5.0) && widest.vertices.iter().any(|v| v.y == 0.0),
            "the strip of three parts runs along the whole wall"
        );
    }

    #[test]
    fn what_lies_in_another_plane_or_only_touches_a_corner_is_not_joined() {
        let mut triangles: Vec<OccluderTriangle> = quad([0.0, 0.0], [1.0, 1.0], 0).into();
        triangles.extend(quad([1.0, 1.0], [2.0, 2.0], 1));
        let mut shifted = quad([1.0, 0.0], [2.0, 1.0], 2);
        shifted.iter_mut().flat_map(|p| &mut p.corners).for_each(|p| p.x = 1.0 + f64::EPSILON);
        triangles.extend(shifted);
        assert_eq!(
            join(&take_rectangles(&mut triangles)).len(),
            3,
            "squares that touch in a corner or lie in another plane"
        );
    }

    #[test]
    fn numbers_keep_their_order_as_bits() {
        for pair in [-1e30, -2.0, -1e-30, 0.0, 1e-30, 5.0, 1e30].windows(2) {
            assert!(ordered(pair[0]) < ordered(pair[1]), "{pair:?} keep their order");
            assert_eq!(from_ordered(ordered(pair[0])), pair[0], "the number from its bits");
        }
        assert_eq!(ordered(-0.0), ordered(0.0), "both zeros are one number");
    }

    #[test]
    fn triangles_with_a_vertex_beside_the_corners_are_no_half_of_a_rectangle() {
        let p = |[y, z]: [f64; 2]| DVec3::new(1.0, y, z);
        let [low, right, high, left] = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        for (half, other, taken) in [
            ([low, right, high], [low, high, left], 1),
            ([low, right, high], [low, high, [1.0, 2.0]], 0),
            ([low, right, high], [low, high, [0.0, 1.0]], 0),
            ([low, high, left], [low, [2.0, 1.0], high], 0),
            ([low, high, left], [low, [1.0, 0.0], high], 0),
            // Triangles without an area.
            ([low, right, high], [low, left, [0.0, 1.0]], 0),
            ([low, right, high], [low, right, [1.0, 0.0]], 0),
            ([low, right, high], [low; 3], 0),
        ] {
            let triangle =
                |flat: [[f64; 2]; 3]| OccluderTriangle { corners: flat.map(p), source: 0, two_sided: false };
            let mut triangles = alloc::vec![triangle(half), triangle(other)];
            let found: usize = take_rectangles(&mut triangles).values().map(Vec::len).sum();
            assert_eq!((found, triangles.len()), (taken, 2 - 2 * taken), "{half:?} and {other:?}");
        }
    }
}
