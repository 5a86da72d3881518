//! Where the corners of an occluder are on the screen: bounds in pixels and in depth key, rounded outwards.

use super::screen_projection::{ObjectProjection, ScreenProjection};
use crate::rounding::FloorCeil;
use alloc::vec::Vec;

/// The extent on the screen of points before the eye: least and greatest column, least and greatest row, least and greatest depth key,
/// each moved
/// outwards. `None` for points too near.
#[inline(always)]
pub(crate) fn extent<const N: usize>(
    x: &[f64; N],
    y: &[f64; N],
    w: &[f64; N],
    n: &[f64; N],
    object: &ObjectProjection,
) -> Option<[f64; 6]> {
    let mut least_w = f64::INFINITY;
    for i in 0..N {
        least_w = if w[i] < least_w { w[i] } else { least_w };
    }
    // Below this the relative error of w would no longer be small.
    if !(least_w > 1024.0 * object.error[2]) {
        return None;
    }
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for i in 0..N {
        let over = 1.0 / w[i];
        for (axis, value) in [x[i] * over, y[i] * over, n[i] * over].into_iter().enumerate() {
            low[axis] = if value < low[axis] { value } else { low[axis] };
            high[axis] = if value > high[axis] { value } else { high[axis] };
        }
    }
    // A quotient q = a / w is off by (e_a + |q| e_w) / w, more or less, and by two roundings.
    let [ex, ey, ew, en, _] = object.error;
    let mut out = [0.0; 6];
    for (axis, error) in [ex, ey, en].into_iter().enumerate() {
        let most = low[axis].abs().max(high[axis].abs());
        let margin = 2.0 * ((error + most * ew) / least_w + 2.0 * f64::EPSILON * most);
        out[2 * axis] = low[axis] - margin;
        out[2 * axis + 1] = high[axis] + margin;
    }
    Some(out)
}

/// The pixels of the buffer that an extent meets; `None` if there is none.
#[inline(always)]
pub(crate) fn pixels(extent: &[f64; 6], projection: &ScreenProjection) -> Option<([f64; 2], [f64; 2])> {
    let limit =
        |low: f64, high: f64, size: f64| [low.max(0.0).min(size).floor_(), high.max(0.0).min(size).ceil_()];
    let columns = limit(extent[0], extent[1], projection.size[0]);
    let lines = limit(extent[2], extent[3], projection.size[1]);
    (columns[0] < columns[1] && lines[0] < lines[1]).then_some((columns, lines))
}

/// As [`extent`](crate::cuboid::extent), for any number of corners, and where each is on the screen.
#[inline(always)]
pub(crate) fn extent_of(
    corners: &[[f64; 5]],
    screen: &mut Vec<[f64; 3]>,
    object: &ObjectProjection,
) -> Option<[f64; 6]> {
    screen.clear();
    let [ex, ey, ew, en, _] = object.error;
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let mut least_w = f64::INFINITY;
    for c in corners {
        least_w = if c[2] < least_w { c[2] } else { least_w };
        let over = 1.0 / c[2];
        let at = [c[0] * over, c[1] * over, c[3] * over];
        for axis in 0..3 {
            low[axis] = if at[axis] < low[axis] { at[axis] } else { low[axis] };
            high[axis] = if at[axis] > high[axis] { at[axis] } else { high[axis] };
        }
        screen.push(at);
    }
    if !(least_w > 1024.0 * ew) {
        return None;
    }
    let mut out = [0.0; 6];
    for (axis, error) in [ex, ey, en].into_iter().enumerate() {
        let most = low[axis].abs().max(high[axis].abs());
        let margin = 2.0 * ((error + most * ew) / least_w + 2.0 * f64::EPSILON * most);
        out[2 * axis] = low[axis] - margin;
        out[2 * axis + 1] = high[axis] + margin;
    }
    Some(out)
}
