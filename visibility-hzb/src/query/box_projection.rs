//! Boxes projected to the screen in `f32`, several at a time: the pixels that each box can meet, rounded
//! outwards, and bounds on its depth keys.
//!
//! # The error bound
//! With `u = 2^-24`, take a coordinate `p` less the anchor: `d = (p - high) - low`, where `high` is the `f32`
//! nearest to the anchor's coordinate and `low` the rest. If `p - high` is exact, rounding `low`, which is at
//! most `|d|`, and the second difference costs `2u |d|`. Otherwise `p` and `high` differ by more than a
//! factor of two, and `low` is less than `2u |d|`, so the two differences cost `2u |d|`. The value of a row
//! with coefficients `a`, `b`, `c` is `((a d.x + b d.y) + c d.z) + constant`. Its coefficients, products and
//! up to three sums are rounded once each: `5u` more of the terms' magnitudes, `7u` in all. `11u` are
//! allowed. The rest covers the two roundings of a quotient `x / w` or `1 / (w - e_w)`, that of the sum of a
//! quotient and its margin, and those of the magnitudes.
//!
//! Let `e_x` and `e_w < w` be bounds on the errors of a corner's computed `x` and `w`, and `c` the column
//! where the corner appears. Then `x - c w` is off zero by at most `e_x + |c| e_w`, so the quotient `x / w`
//! is off `c` by at most that divided by the computed `w`. In the picture, `c` is at most its `width`. A
//! corner to the left of the picture has a quotient of at most `e_x / w`, and a corner to the right of it one
//! of at least `width - (e_x + width e_w) / w`, so the same margin keeps both from narrowing the bounds.

use crate::buffer::tile_layout::Rectangle;
use crate::lanes::{WIDTH, greatest, least, round_to_i32};
use crate::setup::screen_projection::{ScreenProjection, ScreenRow};
use crate::setup::screen_shape::ScreenExtent;

/// Eleven times the unit round-off of `f32`: error bound of the value of a [`ScreenRow32`] (a linear function
/// of points), relative to the sum of the magnitudes of its terms.
const MARGIN: f32 = 5.5 * f32::EPSILON;

/// A [`ScreenRow`] rounded to `f32`: one homogeneous screen coordinate as a linear function `linear . p +
/// constant` of a point `p` relative to the anchor (the eye of a perspective view).
#[derive(Clone, Copy, Debug, Default)]
struct ScreenRow32 {
    /// Coefficients of the linear function: the change of its value for each metre along the scene's x, y
    /// and z axis.
    linear: [f32; 3],
    /// Value of the linear function at the anchor (the eye of a perspective view).
    constant: f32,
    /// Absolute upper bound on the part of the value's error that does not grow with the point: the error of
    /// the constant, and losses to flushed denormals.
    constant_error: f32,
}

impl ScreenRow32 {
    /// Rounds `row` to `f32`.
    fn new(row: ScreenRow) -> Self {
        let linear = row.linear.map(|a| a as f32);
        let constant_error = row.error + row.constant.abs() * f64::from(MARGIN);
        const MIN_NORMAL: f64 = f32::MIN_POSITIVE as f64;
        // Bound on losses to flushed denormals: of coordinates relative to the anchor, and of products.
        let tiny = MIN_NORMAL * (16.0 + 8.0 * row.linear.iter().map(|a| a.abs()).sum::<f64>());
        // A denormal coefficient may be flushed to zero, a loss of the coefficient times the greatest
        // difference of two coordinates. The largest coefficient of `w` is about 1, so no coefficient is
        // denormal unless axes differ in scale by 2^126.
        let lost: f64 = row.linear.iter().map(|a| a.abs()).filter(|&a| a < MIN_NORMAL).sum();
        let constant_error = constant_error + tiny + lost * 2.0 * f64::from(f32::MAX);
        Self { linear, constant: row.constant as f32, constant_error: constant_error as f32 * 1.001 }
    }
}

/// The projection of one frame's view to homogeneous screen coordinates, in `f32` with error bounds. The
/// `f64` form is [`ScreenProjection`].
#[derive(Clone, Debug, Default)]
pub(crate) struct ScreenProjection32 {
    /// Anchor (the eye of a perspective view) in scene coordinates, rounded to `f32`.
    high: [f32; 3],
    /// Difference between the exact anchor (the eye of a perspective view) and its rounded coordinates
    /// `high`, in metres, rounded to `f32`.
    low: [f32; 3],
    /// Rows (linear functions of a point) that give `x` and `y` (pixel coordinates times `w`), `w`, `n`
    /// (depth key times `w`) and the distance beyond the near plane (positive beyond, in the unit of clip
    /// space).
    rows: [ScreenRow32; 5],
    /// Rows (linear functions of a point) that give `width * w - x` and `height * w - y`, with `width` and
    /// `height` of the picture in pixels: negative to the right of the picture and below it.
    right_bottom: [ScreenRow32; 2],
    /// Width and height of the picture in pixels.
    picture: [f32; 2],
    /// True if the view is perspective, so that depth keys are `1 / w`. False if it is parallel: depth keys
    /// are then `n / w`, clip depth signed so that nearer is greater.
    perspective: bool,
}

impl ScreenProjection32 {
    /// Rounds a projection to `f32`. Its rounding errors become part of the error bounds of the rows.
    pub(crate) fn new(projection: &ScreenProjection) -> Self {
        let anchor = projection.anchor.to_array();
        let high = anchor.map(|a| a as f32);
        let low = core::array::from_fn(|i| (anchor[i] - f64::from(high[i])) as f32);
        let [x, y, w, n] = projection.rows;
        let right_bottom = core::array::from_fn(|i| {
            // Each term of the row is a difference of those of `w` and of `x` or `y`.
            let error = projection.picture[i] * w.error + projection.rows[i].error;
            ScreenRow32::new(ScreenRow { error, ..projection.right_bottom[i] })
        });
        Self {
            high,
            low,
            rows: [x, y, w, n, projection.near].map(ScreenRow32::new),
            right_bottom,
            picture: projection.picture.map(|side| side as f32),
            perspective: projection.perspective,
        }
    }
}

impl ScreenProjection32 {
    /// Returns the width and height of the picture in whole pixels.
    #[inline(always)]
    pub(crate) fn picture_size(&self) -> [u32; 2] {
        self.picture.map(|side| side as u32)
    }
}

/// [`WIDTH`] points projected to the screen, one in each lane.
pub(crate) struct ScreenPoints {
    /// Columns of the points in pixels. All values of a lane are meaningless where its `error` is infinite.
    pub(crate) x: [f32; WIDTH],
    /// Rows of the points in pixels.
    pub(crate) y: [f32; WIDTH],
    /// Lower bounds on the clip coordinate `w` of the points.
    pub(crate) w: [f32; WIDTH],
    /// Upper bounds on the clip coordinate `w` of the points.
    pub(crate) most_w: [f32; WIDTH],
    /// Upper bounds on the error of columns and rows in pixels. Infinite for points at or behind the eye.
    pub(crate) error: [f32; WIDTH],
    /// Lower bounds on the distance beyond the near plane, in the unit of clip space.
    pub(crate) near: [f32; WIDTH],
}

impl ScreenProjection32 {
    /// Projects points, given by x, y and z in scene coordinates, each by lane. The errors are bounded as for
    /// boxes, but also for points outside the picture: with a computed quotient `q` of magnitude `|q|`,
    /// `x - q w` is off zero by at most `e_x + |q| e_w`, so `q` is off by that divided by the least `w`.
    #[inline(always)]
    pub(crate) fn points(&self, p: &[[f32; WIDTH]; 3]) -> ScreenPoints {
        let mut d = [[0.0; WIDTH]; 3];
        for axis in 0..3 {
            for i in 0..WIDTH {
                d[axis][i] = (p[axis][i] - self.high[axis]) - self.low[axis];
            }
        }
        let (x, x_error) = values(&self.rows[0], &d);
        let (y, y_error) = values(&self.rows[1], &d);
        let (w, w_error) = values(&self.rows[2], &d);
        let (near, near_error) = values(&self.rows[4], &d);
        let mut out = ScreenPoints {
            x: [0.0; WIDTH],
            y: [0.0; WIDTH],
            w: [0.0; WIDTH],
            most_w: [0.0; WIDTH],
            error: [0.0; WIDTH],
            near: [0.0; WIDTH],
        };
        for i in 0..WIDTH {
            let over = 1.0 / w[i];
            let (column, row) = (x[i] * over, y[i] * over);
            let size = greatest(column.abs(), row.abs());
            (out.w[i], out.most_w[i]) = (w[i] - w_error[i], w[i] + w_error[i]);
            let off = (greatest(x_error[i], y_error[i]) + size * w_error[i]) / out.w[i];
            // `known` is false for NaN.
            let known = (out.w[i] > 0.0) & (off < f32::INFINITY);
            out.error[i] = if known { off } else { f32::INFINITY };
            (out.x[i], out.y[i]) = (column, row);
            out.near[i] = near[i] - near_error[i];
        }
        out
    }
}

/// Returns the values of the linear function `row` at points relative to the anchor, and upper bounds on
/// their absolute errors.
#[inline(always)]
fn values(row: &ScreenRow32, d: &[[f32; WIDTH]; 3]) -> ([f32; WIDTH], [f32; WIDTH]) {
    let (mut out, mut error) = ([0.0; WIDTH], [0.0; WIDTH]);
    let [a, b, c] = row.linear;
    for i in 0..WIDTH {
        let (x, y, z) = (a * d[0][i], b * d[1][i], c * d[2][i]);
        out[i] = ((x + y) + z) + row.constant;
        error[i] = MARGIN * ((x.abs() + y.abs()) + z.abs()) + row.constant_error;
    }
    (out, error)
}

/// Screen bounds of `N` boxes, one lane for each. Bounds of improper boxes (a least coordinate above the
/// greatest, or NaN) are meaningless.
#[derive(Clone, Debug)]
pub(crate) struct ProjectedBoxes<const N: usize> {
    /// First column, end column, first row and end row of the pixels in the picture that each box can meet,
    /// half-open and never empty. Meaningless unless `known`.
    pub(crate) sides: [[i32; N]; 4],
    /// Upper bound on the depth keys (greater is nearer) of each box. Meaningless unless `known`.
    pub(crate) nearest: [f32; N],
    /// Lower bound on the depth keys of each box. Meaningless unless `known`.
    pub(crate) farthest: [f32; N],
    /// Whether each box is certainly out of view: beyond a side of the picture or, if the box is not `known`,
    /// nearer than the near plane. False means undecided.
    pub(crate) outside: [bool; N],
    /// True if the box lies certainly in front of the plane of the eye, so that its other bounds are valid.
    /// False if it reaches that plane or rounding leaves this open; its other bounds are then meaningless.
    pub(crate) known: [bool; N],
    /// True if the box lies certainly beyond the near plane.
    pub(crate) uncut: [bool; N],
    /// True if the box lies certainly within the picture and beyond the near plane. False means undecided.
    pub(crate) inside: [bool; N],
}

impl<const N: usize> ProjectedBoxes<N> {
    /// Boxes without known bounds: neither outside nor inside nor `known`.
    pub(crate) const NONE: Self = Self {
        sides: [[0; N]; 4],
        nearest: [0.0; N],
        farthest: [0.0; N],
        outside: [false; N],
        known: [false; N],
        uncut: [false; N],
        inside: [false; N],
    };

    /// Returns the screen bounds of box `i`, rounded outwards, or `None` if they are not known because the
    /// box may reach the plane of the eye. `picture` is the width and height of the picture, `padded` that of
    /// the buffer of whole tiles, in pixels. Bounds that end at the right or lower border of the picture are
    /// extended to the border of the buffer.
    #[inline(always)]
    pub(crate) fn extent(&self, i: usize, picture: [usize; 2], padded: [usize; 2]) -> Option<ScreenExtent> {
        let [left, right, top, bottom] = [0, 1, 2, 3].map(|side| self.sides[side][i] as usize);
        let right = if right == picture[0] { padded[0] } else { right };
        let bottom = if bottom == picture[1] { padded[1] } else { bottom };
        let depth_keys = [self.farthest[i], self.nearest[i]];
        self.known[i].then_some(ScreenExtent { columns: [left, right], lines: [top, bottom], depth_keys })
    }

    /// Returns the pixels of the picture that box `i` can meet. Meaningless unless `known[i]`.
    #[inline(always)]
    pub(crate) fn rectangle(&self, i: usize) -> Rectangle {
        let [left, right, top, bottom] = &self.sides;
        Rectangle { columns: [left[i] as u32, right[i] as u32], lines: [top[i] as u32, bottom[i] as u32] }
    }
}

/// Replaces `out` by the screen bounds of [`WIDTH`] boxes, given by their least x, y, z and greatest x, y, z
/// in scene coordinates.
#[inline(always)]
pub(crate) fn project_boxes(
    projection: &ScreenProjection32,
    boxes: &[[f32; WIDTH]; 6],
    out: &mut ProjectedBoxes<WIDTH>,
) {
    *out = project(projection, boxes);
}

/// Returns `v` clamped to the range from 0 to `size`. NaN becomes 0.
#[inline(always)]
fn clamped(v: f32, size: f32) -> f32 {
    least(greatest(v, 0.0), size)
}

/// Returns the values of the linear function `row` at the eight corners of each box, and an upper bound on
/// the absolute error of these values for each box. `low` and `high` are the boxes' least and greatest
/// coordinates relative to the anchor. Bits 0, 1 and 2 of a corner's index select the greatest x, y and z.
///
/// A side at infinity makes the error infinite, or NaN. If the side's coefficient is 0, the error may also be
/// finite: the corners at infinity are then NaN, and all others have the right values.
#[inline(always)]
fn corners<const N: usize>(
    row: &ScreenRow32,
    low: &[[f32; N]; 3],
    high: &[[f32; N]; 3],
) -> ([[f32; N]; 8], [f32; N]) {
    let mut out = [[0.0; N]; 8];
    let mut error = [0.0; N];
    for i in 0..N {
        let [a, b, c] = row.linear;
        let (x, y) = ([a * low[0][i], a * high[0][i]], [b * low[1][i], b * high[1][i]]);
        let z = [c * low[2][i], c * high[2][i]];
        for (corner, out) in out.iter_mut().enumerate() {
            out[i] = ((x[corner & 1] + y[corner >> 1 & 1]) + z[corner >> 2 & 1]) + row.constant;
        }
        let reach = (greatest(x[0].abs(), x[1].abs()) + greatest(y[0].abs(), y[1].abs()))
            + greatest(z[0].abs(), z[1].abs());
        error[i] = MARGIN * reach + row.constant_error;
    }
    (out, error)
}

/// Returns an upper bound, errors included, on `sign` times the value of the linear function `row` over each
/// box. `sign` is 1 or -1. `low` and `high` are the boxes' least and greatest coordinates relative to the
/// anchor.
#[inline(always)]
fn most<const N: usize>(row: &ScreenRow32, low: &[[f32; N]; 3], high: &[[f32; N]; 3], sign: f32) -> [f32; N] {
    let mut out = [0.0; N];
    for i in 0..N {
        let (mut sum, mut reach) = (sign * row.constant, row.constant_error);
        for axis in 0..3 {
            let (a, b) = (sign * row.linear[axis] * low[axis][i], sign * row.linear[axis] * high[axis][i]);
            sum += greatest(a, b);
            reach += MARGIN * greatest(a.abs(), b.abs());
        }
        out[i] = sum + reach;
    }
    out
}

/// Computes the screen bounds of boxes given by their least x, y, z and greatest x, y, z in scene
/// coordinates. Bounds of boxes at or behind the plane of the eye are undecided, except that the box may be
/// `outside`.
#[inline(always)]
pub(crate) fn project<const N: usize>(
    projection: &ScreenProjection32,
    boxes: &[[f32; N]; 6],
) -> ProjectedBoxes<N> {
    // Coordinates relative to the anchor. The anchor is the sum of two `f32`, subtracted one after the other,
    // so that a box near the eye keeps its digits far from the origin.
    let (mut low, mut high) = ([[0.0; N]; 3], [[0.0; N]; 3]);
    for axis in 0..3 {
        for i in 0..N {
            low[axis][i] = (boxes[axis][i] - projection.high[axis]) - projection.low[axis];
            high[axis][i] = (boxes[axis + 3][i] - projection.high[axis]) - projection.low[axis];
        }
    }
    let (w, w_error) = corners(&projection.rows[2], &low, &high);
    let (x, x_error) = corners(&projection.rows[0], &low, &high);
    let (y, y_error) = corners(&projection.rows[1], &low, &high);
    // Screen bounds are those of the eight projected corners, as the perspective map of a convex body before
    // the eye is convex.
    let mut out = ProjectedBoxes::NONE;
    let [width, height] = projection.picture;
    let mut bounds = [[f32::INFINITY; N], [f32::NEG_INFINITY; N], [f32::INFINITY; N], [f32::NEG_INFINITY; N]];
    let (mut w_least, mut w_most) = ([f32::INFINITY; N], [f32::NEG_INFINITY; N]);
    for corner in 0..8 {
        for i in 0..N {
            let over = 1.0 / w[corner][i];
            let (px, py) = (x[corner][i] * over, y[corner][i] * over);
            bounds[0][i] = least(px, bounds[0][i]);
            bounds[1][i] = greatest(px, bounds[1][i]);
            bounds[2][i] = least(py, bounds[2][i]);
            bounds[3][i] = greatest(py, bounds[3][i]);
            w_least[i] = least(w[corner][i], w_least[i]);
            w_most[i] = greatest(w[corner][i], w_most[i]);
        }
    }
    let (mut unknown, mut any) = ([false; N], false);
    for i in 0..N {
        let over = 1.0 / w_least[i];
        let x_margin = (x_error[i] + width * w_error[i]) * over;
        let y_margin = (y_error[i] + height * w_error[i]) * over;
        let known = w_least[i] > w_error[i];
        let (left, right) = (bounds[0][i] - x_margin, bounds[1][i] + x_margin);
        let (top, bottom) = (bounds[2][i] - y_margin, bounds[3][i] + y_margin);
        out.known[i] = known && left <= right && top <= bottom;
        out.outside[i] = known && (right < 0.0 || left > width || bottom < 0.0 || top > height);
        out.inside[i] = known && left >= 0.0 && right <= width && top >= 0.0 && bottom <= height;
        // Pixel columns and rows that the bounds meet: rounded outwards, at least one of each, inside the
        // picture.
        out.sides[0][i] = round_to_i32(clamped(left, width - 1.0) - 0.5).max(0);
        out.sides[1][i] =
            round_to_i32(clamped(right, width) + 0.5).max(out.sides[0][i] + 1).min(width as i32);
        out.sides[2][i] = round_to_i32(clamped(top, height - 1.0) - 0.5).max(0);
        out.sides[3][i] =
            round_to_i32(clamped(bottom, height) + 0.5).max(out.sides[2][i] + 1).min(height as i32);
        out.nearest[i] = 1.0 / (w_least[i] - w_error[i]);
        out.farthest[i] = 1.0 / (w_most[i] + w_error[i]);
        unknown[i] = !known;
        any |= !known;
    }
    // In a parallel view `w` is the same everywhere, and depth keys come from the row of the depth.
    if !projection.perspective {
        let (n, n_error) = corners(&projection.rows[3], &low, &high);
        for i in 0..N {
            let (mut a, mut b) = (f32::INFINITY, f32::NEG_INFINITY);
            for corner in 0..8 {
                let depth_key = n[corner][i] / w[corner][i];
                a = least(depth_key, a);
                b = greatest(depth_key, b);
            }
            let most = greatest(a.abs(), b.abs());
            let margin = (n_error[i] + most * w_error[i]) / (w_least[i] - w_error[i]);
            (out.farthest[i], out.nearest[i]) = (a - margin, b + margin);
        }
    }
    // A box through the eye's plane is outside the picture only if all of it lies beyond one side plane or
    // nearer than the near plane.
    if any {
        let tests = [
            most(&projection.rows[0], &low, &high, 1.0),
            most(&projection.rows[1], &low, &high, 1.0),
            most(&projection.right_bottom[0], &low, &high, 1.0),
            most(&projection.right_bottom[1], &low, &high, 1.0),
            most(&projection.rows[4], &low, &high, 1.0),
        ];
        for test in tests {
            for i in 0..N {
                out.outside[i] |= unknown[i] & (test[i] < 0.0);
            }
        }
    }
    // A box that the near plane cuts is not inside.
    let before = most(&projection.rows[4], &low, &high, -1.0);
    for i in 0..N {
        out.uncut[i] = before[i] < 0.0;
        out.inside[i] &= out.uncut[i];
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact_screen::exact_values;
    use crate::random::random;
    use alloc::format;
    use visibility_core::geometry::DoubleDouble;
    use visibility_core::glam::{Affine3A, DMat4, DVec3, DVec4};
    use visibility_core::view::{Depth, Window};
    use visibility_core::{Aabb, Pose, View};

    /// Values of [`ScreenRow32`]s (linear functions of points) with denormal coefficients are within their
    /// error bounds, compared with `f64`, whose own rounding is far below these bounds.
    #[test]
    fn rows_are_within_their_error_where_coefficients_are_denormal() {
        let mut random = random(5);
        let mut off = 0;
        for _ in 0..20_000 {
            let linear = core::array::from_fn(|_| random(-1.0, 1.0) * 10f64.powf(random(-46.0, -36.0)));
            let row = ScreenRow { linear, constant: 0.0, error: 0.0 };
            let row32 = ScreenRow32::new(row);
            let mut coordinate = || (random(-1.0, 1.0) * 10f64.powf(random(0.0, 30.0))) as f32;
            let p = [0, 1, 2].map(|_| [coordinate()]);
            let exact: f64 = (0..3).map(|i| linear[i] * f64::from(p[i][0])).sum();
            let (values, [error]) = corners(&row32, &p, &p);
            let wrong = (f64::from(values[0][0]) - exact).abs();
            assert!(wrong <= f64::from(error), "{linear:?} at {p:?}: off by {wrong}, not {error}");
            assert!(f64::from(most(&row32, &p, &p, 1.0)[0]) >= exact, "{linear:?} at {p:?}");
            assert!(f64::from(most(&row32, &p, &p, -1.0)[0]) >= -exact, "{linear:?} at {p:?}");
            off += u32::from(wrong > f64::from(MARGIN * values[0][0].abs()));
        }
        assert!(off > 100, "something is lost: {off}");
    }

    /// Values of [`ScreenRow32`]s (linear functions of points) are within their error bounds close to an
    /// anchor far from the origin. One `f32` is too coarse for the coordinates of such an anchor, so each is
    /// stored as the sum of two.
    #[test]
    fn rows_are_within_their_error_close_to_a_far_anchor() {
        let mut random = random(7);
        for _ in 0..100_000 {
            let (far, steps) = (10f64.powf(random(0.0, 12.0)), [0.0, 2.0, 1e5][random(0.0, 3.0) as usize]);
            let anchor = [0; 3].map(|_| far * random(-1.0, 1.0));
            let row = ScreenRow { linear: [0; 3].map(|_| random(-1.0, 1.0)), constant: 0.0, error: 0.0 };
            let high = anchor.map(|a| a as f32);
            let points = high.map(|a| {
                let step = random(-steps, steps) as i32;
                f32::from_bits(a.to_bits().wrapping_add_signed(step))
            });
            let d = [0, 1, 2].map(|i| {
                let low = (anchor[i] - f64::from(high[i])) as f32;
                [(points[i] - high[i]) - low]
            });
            let exact = (0..3).fold(DoubleDouble::ZERO, |sum, i| {
                let d = DoubleDouble::difference(f64::from(points[i]), anchor[i]);
                sum.plus(d.times(row.linear[i].into()))
            });
            let (values, [error]) = corners(&ScreenRow32::new(row), &d, &d);
            let wrong = exact.plus(f64::from(-values[0][0]).into()).hi.abs();
            assert!(wrong <= f64::from(error), "{anchor:?} at {points:?}: off by {wrong}, not {error}");
        }
    }

    /// Depth-key bounds hold for boxes far to the side and close to the eye's plane, where most digits of `w`
    /// cancel.
    #[test]
    fn depth_keys_hold_where_w_cancels() {
        let mut random = random(6);
        let (mut known, mut total) = (0, 0);
        for trial in 0..20_000 {
            let mut unit = || random(-1.0, 1.0);
            let along = DVec3::new(unit(), unit(), unit()).normalize();
            let pose = Pose::look_at(DVec3::ZERO, along, DVec3::new(unit(), unit(), unit()));
            let view = View::perspective(pose, 1.0, 1.7, 1e-6, f64::INFINITY).unwrap();
            let projection = ScreenProjection::new(&view, DVec3::ZERO, [640, 360], [640, 360]);
            let aside = along.cross(DVec3::new(unit(), unit(), unit())).normalize() * 1000.0;
            let middle = (aside + along * 10f64.powf(2.0 * unit() - 2.0)).as_vec3();
            let bounds = Aabb::new(middle - 1e-4, middle + 1e-4);
            let [low, high] = [bounds.min.to_array(), bounds.max.to_array()];
            let boxes = [low[0], low[1], low[2], high[0], high[1], high[2]].map(|side| [side]);
            let projected = project(&ScreenProjection32::new(&projection), &boxes);
            total += 1;
            if !projected.known[0] {
                continue;
            }
            known += 1;
            for corner in bounds.corners() {
                let [_, _, w, n, _] = exact_values(&projection, &Affine3A::IDENTITY, corner.to_array());
                let beyond = |key: f32| w.times(f64::from(key).into()).plus(n.negated()).hi;
                assert!(w.hi > 0.0, "trial {trial}: behind the eye");
                assert!(beyond(projected.nearest[0]) >= 0.0, "trial {trial}: nearer");
                assert!(beyond(projected.farthest[0]) <= 0.0, "trial {trial}: farther");
            }
        }
        assert!(known > 1000 && known < total, "{known} of {total}");
    }

    /// Values of rows are within their error bounds where every rounding goes the same way: each of the
    /// roundings loses almost half a unit in the last place. Half of the bound would not do.
    #[test]
    fn rows_are_within_their_error_where_all_roundings_add_up() {
        let mut random = random(11);
        let mut worst = 0.0f64;
        for trial in 0..20_000 {
            // A number of `f32` a little above 1, and what is lost when nearly half a unit is added to it.
            let mut one = || 1.0 + f64::from(random(0.0, 4096.0) as i32) * f64::from(f32::EPSILON);
            let (a, p, c) = (one(), one(), one());
            let mut lost = || random(0.9, 0.999) * f64::from(f32::EPSILON / 2.0);
            let (coefficient, high, y, z, tiny) = (lost(), -lost() as f32, lost(), lost(), lost());
            let linear = [a + coefficient, y, z];
            let constant = if trial % 2 == 0 { tiny } else { 1024.0 * (c + tiny) };
            let row = ScreenRow32::new(ScreenRow { linear, constant, error: 0.0 });
            let d = [[p as f32 - high], [1.0], [1.0]];
            let exact = linear[0] * (p - f64::from(high)) + linear[1] + linear[2] + constant;
            let points = d.map(|d| [d[0]; WIDTH]);
            for (value, error) in [
                {
                    let (values, [error]) = corners(&row, &d, &d);
                    (values[0][0], error)
                },
                {
                    let (values, error) = values(&row, &points);
                    (values[0], error[0])
                },
            ] {
                let (wrong, error) = ((f64::from(value) - exact).abs(), f64::from(error));
                assert!(wrong <= error, "trial {trial}: off by {wrong}, not {error}");
                worst = worst.max(wrong / error);
            }
            assert!(f64::from(most(&row, &d, &d, 1.0)[0]) >= exact, "trial {trial}: upper bound");
            assert!(f64::from(most(&row, &d, &d, -1.0)[0]) >= -exact, "trial {trial}: lower bound");
        }
        assert!(worst > 0.5, "the worst error is {worst} of its bound");
    }

    /// Coefficients of the rows for the right and the lower side of the picture are as exact as others where
    /// `x` and `width * w` nearly cancel, so that what is just inside of the picture is not outside.
    #[test]
    fn rows_of_the_right_and_the_lower_side_are_not_differences_of_rounded_rows() {
        let least = 2f64.powi(-53);
        let rows = [[0.75 - least, 1.5, 0.25, 0.0], [least - 0.75, 1.5, 0.25, 0.0]];
        let [w, z] = [[0.75, 0.5, 0.25, 0.0], [0.0, 0.0, 0.0, 0.1]].map(DVec4::from);
        let matrix = DMat4::from_cols(rows[0].into(), rows[1].into(), z, w).transpose();
        let view = View::from_clip_from_world(matrix, Depth::ReversedInfinite).unwrap();
        let projection = ScreenProjection::new(&view, DVec3::ZERO, [640, 360], [640, 360]);
        let projection = ScreenProjection32::new(&projection);
        for (row, size) in projection.right_bottom.iter().zip([640.0, 360.0]) {
            let exact = [2f64.powi(-54) * size, if size == 640.0 { -0.5 * size } else { size }];
            for (computed, exact) in row.linear.iter().zip(exact) {
                let wrong = (f64::from(*computed) - exact).abs();
                assert!(wrong <= exact.abs() * 2f64.powi(-23), "{computed} for {exact}, size {size}");
            }
        }
    }

    /// Bounds hold whichever way each row of the projection is off by its error. These errors are made large
    /// here, so that half of one would not do.
    #[test]
    fn bounds_hold_for_projections_that_are_off_by_their_errors() {
        let mut random = random(12);
        let (mut counts, mut points_known) = ([0; 5], 0);
        let [width, height] = [640.0, 360.0];
        for trial in 0..6_000 {
            let mut unit = || random(-1.0, 1.0);
            let along = DVec3::new(unit(), unit(), unit()).normalize();
            let eye = DVec3::new(unit(), unit(), unit()) * 8.0;
            let pose = Pose::look_at(eye, eye + along, DVec3::new(unit(), unit(), unit()));
            let view = match trial % 3 {
                0 => View::orthographic(
                    pose,
                    Window { left: -2.0, right: 2.0, bottom: -1.0, top: 1.0 },
                    0.5,
                    9.0,
                ),
                _ => View::perspective(pose, 1.0, 16.0 / 9.0, 0.5, 9.0),
            };
            let mut projection = ScreenProjection::new(&view.unwrap(), DVec3::ZERO, [640, 360], [640, 360]);
            // Errors in the unit of each row, for pictures a metre away. Other errors are far smaller.
            let mut off = [0.0; 5];
            for (i, off) in off.iter_mut().enumerate() {
                let size = [width, height, 1.0, 0.1, 0.5][i];
                if unit() > 0.0 && (i != 3 || !projection.perspective) {
                    *off = size * 10f64.powf(1.5 * unit() - 1.6);
                }
                let row = if i < 4 { &mut projection.rows[i] } else { &mut projection.near };
                row.error += *off;
            }
            // Half of the boxes are close to the plane of the eye.
            let ahead = if unit() > 0.0 { 2.0 + 2.5 * unit() } else { 0.3 * unit() };
            let middle = eye + along * ahead + DVec3::new(unit(), unit(), unit()) * 1.5;
            let half = DVec3::new(unit(), unit(), unit()).abs() * 0.3;
            let bounds = Aabb::new((middle - half).as_vec3(), (middle + half).as_vec3());
            let [low, high] = [bounds.min.to_array(), bounds.max.to_array()];
            let boxes = [low[0], low[1], low[2], high[0], high[1], high[2]].map(|side| [side]);
            let projection32 = ScreenProjection32::new(&projection);
            let seen = project(&projection32, &boxes);
            let corners = bounds.corners();
            let points = projection32
                .points(&[0, 1, 2].map(|axis| core::array::from_fn(|i| corners[i % 8].to_array()[axis])));
            let [left, right, top, bottom] = [0, 1, 2, 3].map(|side| f64::from(seen.sides[side][0]));
            for (at, corner) in corners.iter().enumerate() {
                let p = corner.as_dvec3() - projection.anchor;
                for signs in 0..32 {
                    let [x, y, w, n, near] = [0, 1, 2, 3, 4].map(|i| {
                        let row = if i < 4 { &projection.rows[i] } else { &projection.near };
                        let sign = if signs >> i & 1 == 0 { 1.0 } else { -1.0 };
                        DVec3::from(row.linear).dot(p) + row.constant + sign * off[i]
                    });
                    let in_picture = w > 0.0 && x >= 0.0 && x <= width * w && y >= 0.0 && y <= height * w;
                    let case = format!("trial {trial}, corner {at}, signs {signs:b}");
                    assert!(!seen.outside[0] || !in_picture || near < 0.0, "{case}: in view");
                    assert!(!seen.uncut[0] || near > 0.0, "{case}: before the near plane");
                    assert!(!seen.inside[0] || in_picture && near > 0.0, "{case}: not inside");
                    if seen.known[0] {
                        assert!(w > 0.0, "{case}: behind the eye");
                        assert!(n <= w * f64::from(seen.nearest[0]), "{case}: nearer");
                        assert!(n >= w * f64::from(seen.farthest[0]), "{case}: farther");
                        let is_met = left * w <= x && x <= right * w && top * w <= y && y <= bottom * w;
                        assert!(is_met || !in_picture, "{case}: beside its pixels");
                    }
                    let ScreenPoints { w: least_w, most_w, error, near: least_near, .. } = &points;
                    assert!(w >= f64::from(least_w[at]) && w <= f64::from(most_w[at]), "{case}: w");
                    assert!(near >= f64::from(least_near[at]), "{case}: distance beyond the near plane");
                    if error[at] < f32::INFINITY {
                        let wrong = (x / w - f64::from(points.x[at]))
                            .abs()
                            .max((y / w - f64::from(points.y[at])).abs());
                        assert!(w > 0.0 && wrong <= f64::from(error[at]), "{case}: off by {wrong} pixels");
                        points_known += 1;
                    }
                }
            }
            for (i, is) in
                [seen.outside[0], seen.known[0], seen.uncut[0], seen.inside[0]].into_iter().enumerate()
            {
                counts[i] += u32::from(is);
            }
            counts[4] += u32::from(seen.outside[0] && !seen.known[0]);
        }
        assert!(
            counts.iter().all(|&count| count > 300) && points_known > 100_000,
            "{counts:?} {points_known}"
        );
    }
}
