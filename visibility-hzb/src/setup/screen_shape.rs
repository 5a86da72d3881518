//! The screen shape of an occluder: half-planes that its covered pixels satisfy, and planes that bound its
//! depth key from below.
//!
//! # Why it is sound
//! Take any set of triangles that all run in the same sense on the screen. Their *contour* is the set of
//! their directed edges that are not cancelled by the opposite edge of another triangle. If a point lies
//! strictly to the left of the line of every contour edge, each edge sweeps a positive angle about the point.
//! So the contour winds round the point at least once. Since all triangles wind in the same sense, at least
//! one of them covers the point. The same holds on the sphere of directions about the eye: corners may lie
//! behind the eye, and where triangles are cut at the near plane, the cuts join the contour. Nothing here
//! assumes a convex solid. For a convex solid, no pixel inside its outline is lost.
//!
//! A triangle that covers a point lies in its own depth plane. So the depth key there is at least the least
//! value of all drawn triangles' planes, and at least that of the farthest corner. (Durand, "A
//! Multidisciplinary Survey of Visibility", 2000, chapter 6, on why conservative maps need both parts:
//! coverage rounded inwards, depth rounded away.)
//!
//! # The error bound
//! Coordinates, edges and planes are computed in `f64` with running bounds
//! ([`ObjectProjection`](super::screen_projection::ObjectProjection)). Half-planes are moved inwards and
//! depth planes away by these bounds. [`ScreenShape::add_edge`] and [`ScreenShape::add_depth_plane`] then
//! round to `f32` and derive the cost of that rounding. All later steps compare integers exactly.

use crate::buffer::tile_layout::SIDE;
use crate::coverage::Coverage;
use crate::rounding::{FloorCeil, down, up};

/// Bound on the columns that a shape covers in a row of pixels: `x >= slope * row + offset` for a bound on
/// the left, `x <= slope * row + offset` for a bound on the right. `x` is a column in pixels. `row` is the
/// index of the row of pixels, 0 for the topmost row; no half pixel is added. The bound is already moved
/// inwards for the whole height of the row and for rounding, so the shape covers every pixel between a left
/// and a right bound entirely (with sampled coverage: its centre).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RowBound {
    /// Change of the bound, in columns of pixels, from one row of pixels to the next row below.
    pub(crate) slope: f32,
    /// Column, in pixels, of this left or right bound in the topmost row of pixels (row index 0). Moved
    /// inwards (to the right for a left bound, to the left for a right bound) to allow for rounding.
    pub(crate) offset: f32,
}

impl RowBound {
    /// Rounds `slope` and `offset` of a bound to the nearest `f32`; the caller has moved `offset` inwards by
    /// more than that rounding. If a number overflows or is NaN, the slope becomes 0 and the offset becomes
    /// `nothing`: an infinity (positive for a left bound, negative for a right one) so that no pixel
    /// satisfies the bound.
    #[inline(always)]
    fn new(slope: f64, offset: f64, nothing: f32) -> Self {
        let (slope, offset) = (slope as f32, offset as f32);
        if slope.abs() + offset.abs() < f32::INFINITY {
            Self { slope, offset }
        } else {
            Self { slope: 0.0, offset: nothing }
        }
    }
}

/// Maximum number of row bounds (bounds on the columns in each row of pixels) on each side, left and right,
/// of a shape.
pub(crate) const MAX_EDGES: usize = 32;
/// Maximum number of depth planes of a shape.
pub(crate) const MAX_PLANES: usize = 16;

/// An occluder on the screen, ready to be filled into tiles. A pixel is covered if it satisfies all row
/// bounds and lies within `columns` and `lines`. The default shape covers no pixel.
#[derive(Clone, Debug, Default)]
pub(crate) struct ScreenShape {
    /// Left row bounds: bounds on the columns in each row of pixels. The first `lefts` are in use, the rest
    /// stale.
    pub(crate) left: [RowBound; MAX_EDGES],
    /// Right row bounds: bounds on the columns in each row of pixels. The first `rights` are in use, the
    /// rest stale.
    pub(crate) right: [RowBound; MAX_EDGES],
    /// Number of row bounds (bounds on the covered columns) on the left of the shape, at most [`MAX_EDGES`].
    pub(crate) lefts: usize,
    /// Number of row bounds (bounds on the covered columns) on the right of the shape, at most
    /// [`MAX_EDGES`].
    pub(crate) rights: usize,
    /// Depth planes `[a, b, c]`: `a * column + b * row + c` is a lower bound on the depth key of the
    /// occluder's face in the tile at that tile column and row, never NaN. The first `plane_count` are in
    /// use, the rest stale.
    pub(crate) planes: [[f32; 3]; MAX_PLANES],
    /// Number of depth planes, at most [`MAX_PLANES`].
    pub(crate) plane_count: usize,
    /// Lower bound on the depth keys (greater is nearer) of the whole shape.
    pub(crate) floor: f32,
    /// Upper bound on the depth keys (greater is nearer) of the whole shape.
    pub(crate) ceiling: f32,
    /// Column range in pixels of the buffer, half-open.
    pub(crate) columns: [f32; 2],
    /// Row range in pixels, half-open.
    pub(crate) lines: [usize; 2],
}

/// Screen bounds, rounded outwards, of a box that lies wholly in front of the eye.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScreenExtent {
    /// Half-open range of the pixel columns of the buffer that the box can meet.
    pub(crate) columns: [usize; 2],
    /// Row range in pixels, half-open.
    pub(crate) lines: [usize; 2],
    /// Lower bound and upper bound on the depth keys (greater is nearer) of the box.
    pub(crate) depth_keys: [f32; 2],
}

/// Eight times the unit round-off of `f32` (2^-24): the margin, relative to a sum of magnitudes, by which row
/// bounds are moved inwards and depth planes lowered.
const EIGHT_U32: f64 = 4.0 * f32::EPSILON as f64;

impl ScreenShape {
    /// Resets the shape to a rectangle of pixels without row bounds or depth planes. `columns` and `lines`
    /// are half-open ranges in pixels. `floor` and `ceiling` are a lower and an upper bound on the shape's
    /// depth keys (greater is nearer). They are rounded to `f32` outwards, `floor` down and `ceiling` up.
    #[inline(always)]
    pub(crate) fn begin(&mut self, columns: [f64; 2], lines: [f64; 2], floor: f64, ceiling: f64) {
        self.lefts = 0;
        self.rights = 0;
        self.plane_count = 0;
        self.columns = columns.map(|x| x as f32);
        // Float-to-integer casts saturate, and NaN becomes zero.
        self.lines = lines.map(|y| y as usize);
        self.floor = down(floor);
        self.ceiling = up(ceiling);
    }

    /// Resets the shape to the pixel rectangle and the bounds on depth keys of `extent`, without row bounds
    /// or depth planes.
    #[inline(always)]
    pub(crate) fn begin_within(&mut self, extent: &ScreenExtent) {
        (self.lefts, self.rights, self.plane_count) = (0, 0, 0);
        (self.columns, self.lines) = (extent.columns.map(|x| x as f32), extent.lines);
        [self.floor, self.ceiling] = extent.depth_keys;
    }

    /// Restricts the shape to pixels all of whose points satisfy `a x + b y + c >= 0` in pixel coordinates.
    /// With sampled coverage, only the centre of the pixel must satisfy it. A NaN coefficient leaves no
    /// pixel. `size` is the width and height of the buffer in pixels. Returns false, without a change, if the
    /// shape already has [`MAX_EDGES`] row bounds on the side that the half-plane bounds, left (`a > 0`) or
    /// right.
    ///
    /// The bound on the points of a row is `x >= s y + t`, where `s` is `-b / a` and `t` is `-c / a`. The
    /// worst point of the row is at its top or bottom. In `f32`, `s`, `t`, the product and the sum are each
    /// rounded once, so the result is off by at most `4u (|s| H + |t|)`, with `u = 2^-24` and `W` and `H` the
    /// width and height of the buffer. The offset is moved inwards by `8u` of that, and by another `16u (W +
    /// 2)` for the error of rounding to whole pixels.
    #[inline(always)]
    pub(crate) fn add_edge(&mut self, [a, b, c]: [f64; 3], size: [f64; 2], coverage: Coverage) -> bool {
        if a == 0.0 {
            // A horizontal edge bounds rows instead of columns.
            let (mut first, mut end) = (self.lines[0] as f64, self.lines[1] as f64);
            let y = -c / b;
            let half = if coverage == Coverage::Sampled { 0.5 } else { 0.0 };
            if b == 0.0 && c >= 0.0 {
                // With `a` and `b` zero and `c` not negative, all points satisfy the bound.
            } else if b == 0.0 || y.is_nan() {
                end = 0.0;
            } else if b > 0.0 {
                let y = y * (1.0 + 8.0 * f64::EPSILON.copysign(y));
                first = first.max((y - half).ceil_());
            } else {
                let y = y * (1.0 - 8.0 * f64::EPSILON.copysign(y));
                end = end.min((y + half).floor_());
            }
            self.lines = [first as usize, end as usize];
            return true;
        }
        let over = -1.0 / a;
        let (s, t) = (b * over, c * over);
        let slack = EIGHT_U32 * (s.abs() * size[1] + t.abs())
            + 2.0 * EIGHT_U32 * (size[0] + 2.0)
            + f64::from(f32::MIN_POSITIVE);
        if a > 0.0 {
            if self.lefts == MAX_EDGES {
                return false;
            }
            let worst = if coverage == Coverage::Sampled { 0.5 * s - 0.5 } else { s.max(0.0) };
            self.left[self.lefts] = RowBound::new(s, t + worst + slack, f32::INFINITY);
            self.lefts += 1;
        } else {
            if self.rights == MAX_EDGES {
                return false;
            }
            // A NaN `a` also ends up here, and covers no pixel.
            let worst = if coverage == Coverage::Sampled { 0.5 * s + 0.5 } else { s.min(0.0) };
            self.right[self.rights] = RowBound::new(s, t + worst - slack, f32::NEG_INFINITY);
            self.rights += 1;
        }
        true
    }

    /// Adds a depth plane, which bounds the shape's depth key from below: the plane `a x + b y + c` in pixel
    /// coordinates, which the caller has lowered by the error of its coefficients. Where a shape has several
    /// depth planes, the least of their values is the bound. `size` is the width and height of the buffer in
    /// pixels. Returns false, without a change, if the shape has [`MAX_PLANES`] planes.
    #[inline(always)]
    pub(crate) fn add_depth_plane(&mut self, [a, b, c]: [f64; 3], size: [f64; 2]) -> bool {
        if self.plane_count == MAX_PLANES {
            return false;
        }
        self.planes[self.plane_count] = tile_minimum_plane([a, b, c], size);
        self.plane_count += 1;
        true
    }
}

/// Returns a plane `p column + q row + r` over tile columns and rows, as coefficients `[p, q, r]`. Its value
/// for a tile is at most the least value of the plane `a x + b y + c` (pixel coordinates) in that tile.
/// `size` is the width and height of the buffer in pixels.
///
/// In `f32`, with `u = 2^-24`, three coefficients, two products and two sums are rounded: `4u` of the sum of
/// magnitudes at most, and `8u` are taken off. A plane that might overflow in the buffer, or has a NaN
/// coefficient, becomes negative infinity everywhere. So no value is NaN, and a minimum over planes need not
/// consider NaN.
#[inline(always)]
pub(crate) fn tile_minimum_plane([a, b, c]: [f64; 3], size: [f64; 2]) -> [f32; 3] {
    let side = SIDE as f64;
    let worst = c + side * (a.min(0.0) + b.min(0.0));
    let most = a.abs() * (size[0] + side) + b.abs() * (size[1] + side) + c.abs();
    // The comparison is false for NaN. The factor leaves room for rounding.
    if !(most < 0.5 * f64::from(f32::MAX)) {
        return [0.0, 0.0, f32::NEG_INFINITY];
    }
    let slack = EIGHT_U32 * most + f64::from(f32::MIN_POSITIVE);
    [(a * side) as f32, (b * side) as f32, (worst - slack) as f32]
}

/// Outcome of setting up an occluder as a [`ScreenShape`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum ShapeResult {
    /// The shape is complete.
    Ready,
    /// The occluder covers no pixel, or rounding leaves open whether it does. It is not drawn.
    Nothing,
    /// No shape is possible: the occluder is too close to the eye, has too many edges or planes, or does not
    /// look convex. It must be drawn as a mesh.
    DrawAsMesh,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::random;
    use visibility_core::geometry::DoubleDouble;

    /// Returns the whole buffer, 64 pixels wide and high, with one half-plane added.
    fn shape(half_plane: [f64; 3]) -> ScreenShape {
        let mut shape = ScreenShape::default();
        shape.begin([0.0, 64.0], [0.0, 64.0], 1.0, 2.0);
        assert!(shape.add_edge(half_plane, [64.0; 2], Coverage::Conservative), "{half_plane:?} is added");
        shape
    }

    /// A half-plane without direction is everything or nothing. A bound that overflows leaves no pixel.
    #[test]
    fn half_planes_without_an_edge_cover_all_or_nothing() {
        for (c, lines) in [(0.0, [0, 64]), (1.0, [0, 64]), (-1e-9, [0, 0]), (f64::NAN, [0, 0])] {
            assert_eq!(shape([0.0, 0.0, c]).lines, lines, "0 x + 0 y + {c}");
        }
        let right = shape([-1e-30, 0.0, 1e30]);
        assert_eq!((right.rights, right.right[0].offset), (1, f32::NEG_INFINITY), "a bound on the right");
        let left = shape([1e-30, 0.0, 1e30]);
        assert_eq!((left.lefts, left.left[0].offset), (1, f32::INFINITY), "a bound on the left");
    }

    /// A horizontal edge within rounding of the border between two rows leaves out the row that it enters.
    #[test]
    fn rows_are_within_horizontal_edges_to_the_last_digit() {
        let (mut random, mut beside) = (random(71), 0);
        for trial in 0..20_000 {
            let (b, row) = (random(-2.0, 2.0), random(1.0, 63.0) as usize);
            let mut c = -b * row as f64;
            for _ in 0..random(0.0, 3.0) as usize {
                c = if trial % 2 == 0 { c.next_up() } else { c.next_down() };
            }
            let [first, end] = shape([0.0, b, c]).lines;
            // Sign of the function at the border: below 0, the border is left out.
            let at = DoubleDouble::product(b, row as f64).plus(c.into()).hi;
            let is_covered = if b > 0.0 { first <= row } else { end >= row };
            assert!(!is_covered || at >= 0.0, "trial {trial}: {at} at row {row} of {b} y + {c}");
            let around = if b > 0.0 { [first, row + 1] } else { [row - 1, end] };
            assert!(around[0] <= around[1], "trial {trial}: {first}..{end} of {b} y + {c} at {row}");
            beside += u32::from(at < 0.0);
        }
        assert!(beside > 5_000, "{beside} borders are outside");
    }
}
