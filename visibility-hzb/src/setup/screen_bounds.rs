//! Screen bounds of an occluder: columns, rows and depth keys of its corners, rounded outwards.

use super::screen_projection::{ObjectProjection, ScreenProjection};
use crate::rounding::FloorCeil;
use alloc::vec::Vec;

/// Returns screen bounds of `N` points given by `x` and `y` (pixel coordinates times `w`), `w` and `n` (depth
/// key times `w`). The bounds are least column, greatest column, least row, greatest row (in pixels, not
/// rounded to whole pixels), least depth key and greatest depth key, each moved outwards by its error. `None`
/// if a point is behind the plane of the eye, or too close to it for a bound on its error.
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
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for i in 0..N {
        let over = 1.0 / w[i];
        for (axis, value) in [x[i] * over, y[i] * over, n[i] * over].into_iter().enumerate() {
            low[axis] = if value < low[axis] { value } else { low[axis] };
            high[axis] = if value > high[axis] { value } else { high[axis] };
        }
    }
    rounded_outwards(low, high, least_w, object)
}

/// Returns screen bounds from computed extremes, each moved outwards by its error: least and greatest column
/// in pixels, least and greatest row, least and greatest depth key. `low` and `high` hold the computed least
/// and greatest column, row and depth key. `least_w` is the least `w` of the points. `None` if `least_w` is
/// at most 1024 times the error bound of `w`.
///
/// A quotient `q = a / w` is off by `(e_a + |q| e_w) / (w - e_w)` at most, with absolute errors `e_a` and
/// `e_w`. Errors are 16 units of round-off at least. Corners that are sums of three steps are off by up to
/// 17, and a quotient by two of its own and one of the margin: the factor 1.25 makes 20 of 16, less a
/// thousandth for the divisor, since `w` exceeds `1024 e_w`.
#[inline(always)]
fn rounded_outwards(
    low: [f64; 3],
    high: [f64; 3],
    least_w: f64,
    object: &ObjectProjection,
) -> Option<[f64; 6]> {
    let [ex, ey, ew, en, _] = object.error;
    if !(least_w > 1024.0 * ew) {
        return None;
    }
    let mut out = [0.0; 6];
    for (axis, error) in [ex, ey, en].into_iter().enumerate() {
        let most = low[axis].abs().max(high[axis].abs());
        let margin = 1.25 * (error + most * ew) / least_w;
        out[2 * axis] = low[axis] - margin;
        out[2 * axis + 1] = high[axis] + margin;
    }
    Some(out)
}

/// Returns the range of columns and the range of rows of the pixels of the buffer that screen bounds meet:
/// two half-open ranges `[first, end]`, whole numbers of pixels kept as `f64` for the arithmetic that
/// follows. `extent` holds the bounds as [`extent()`] returns them: least column, greatest column, least row
/// and greatest row, in pixels. The depth keys after these are not read. `None` if the bounds meet no pixel.
#[inline(always)]
pub(crate) fn pixels(extent: &[f64; 6], projection: &ScreenProjection) -> Option<([f64; 2], [f64; 2])> {
    let limit =
        |low: f64, high: f64, size: f64| [low.max(0.0).min(size).floor_(), high.max(0.0).min(size).ceil_()];
    let columns = limit(extent[0], extent[1], projection.size[0]);
    let lines = limit(extent[2], extent[3], projection.size[1]);
    (columns[0] < columns[1] && lines[0] < lines[1]).then_some((columns, lines))
}

/// Returns screen bounds of any number of corners, in the order of [`extent()`]. Each corner is a point in
/// homogeneous screen coordinates, `[x, y, w, n, near]` as in [`ObjectProjection`]. Replaces the content of
/// `screen` by `[column, row, depth key]` of each corner, without error bounds. `None` if a corner is behind
/// the plane of the eye, or too close to it.
#[inline(always)]
pub(crate) fn extent_of(
    corners: &[[f64; 5]],
    screen: &mut Vec<[f64; 3]>,
    object: &ObjectProjection,
) -> Option<[f64; 6]> {
    screen.clear();
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
    rounded_outwards(low, high, least_w, object)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact_screen::exact_values;
    use crate::random::random;
    use crate::setup::depth_plane::plane;
    use visibility_core::geometry::DoubleDouble;
    use visibility_core::glam::{Affine3A, DVec3, Vec3};
    use visibility_core::{Pose, View};

    /// Bounds hold whichever way the values of corners are off by their errors, which are large here, so that
    /// half of one would not do.
    #[test]
    fn bounds_hold_for_corners_that_are_off_by_their_errors() {
        let mut random = random(13);
        let mut bounded = 0;
        for trial in 0..20_000 {
            let mut object = ObjectProjection::default();
            for (error, most) in object.error.iter_mut().zip([0.5, 0.5, 0.002, 0.5, 0.0]) {
                *error = 1e-13 + if random(-1.0, 1.0) > 0.0 { random(0.0, most) } else { 0.0 };
            }
            let [x, y, n] = [0; 3].map(|_| [random(-50.0, 50.0), random(-50.0, 50.0)]);
            let w = [random(1.0, 2.0), random(1.0, 2.0)];
            let Some(bounds) = extent(&x, &y, &w, &n, &object) else { continue };
            bounded += 1;
            for (i, signs) in (0..2).flat_map(|i| (0..16).map(move |signs| (i, signs))) {
                let off = [0, 1, 2, 3]
                    .map(|row| if signs >> row & 1 == 0 { 1.0 } else { -1.0 } * object.error[row]);
                let w = w[i] + off[2];
                for (axis, value) in [x[i] + off[0], y[i] + off[1], n[i] + off[3]].into_iter().enumerate() {
                    let is_in = bounds[2 * axis] <= value / w && value / w <= bounds[2 * axis + 1];
                    assert!(
                        is_in,
                        "trial {trial}, corner {i}, signs {signs:b}: {} on axis {axis}",
                        value / w
                    );
                }
            }
        }
        assert!(bounded > 5_000, "{bounded} pairs of corners have bounds");
    }

    /// Exact corners of triangles lie within the bounds of the computed corners, and no farther than their
    /// depth plane.
    #[test]
    fn bounds_and_depth_planes_hold_at_exact_corners() {
        let mut random = random(12);
        let (mut bounded, mut planes) = (0, 0);
        for trial in 0..40_000 {
            let mut vector = |size: f64| Vec3::from_array([0; 3].map(|_| (size * random(-1.0, 1.0)) as f32));
            let pose = Pose::look_at(DVec3::ZERO, vector(1.0).as_dvec3(), DVec3::Z);
            let view = View::perspective(pose, 1.0, 1.7, 0.01, f64::INFINITY).unwrap();
            let projection = ScreenProjection::new(&view, DVec3::ZERO, [640, 360], [640, 360]);
            let points = [vector(20.0), vector(20.0), vector(20.0)];
            let reach = points.into_iter().fold(Vec3::ZERO, |most, p| most.max(p.abs()));
            let object = projection.project_object(&Affine3A::IDENTITY, reach.to_array().map(f64::from));
            let corners = points.map(|p| object.at(p.to_array().map(f64::from)));
            let exact = points.map(|p| exact_values(&projection, &Affine3A::IDENTITY, p.to_array()));
            let [x, y, w, n] = [0, 1, 2, 3].map(|i| corners.map(|corner| corner[i]));
            let Some(bounds) = extent(&x, &y, &w, &n, &object) else { continue };
            assert_eq!(
                extent_of(&corners, &mut Vec::new(), &object),
                Some(bounds),
                "trial {trial}: both ways bound alike"
            );
            for [x, y, w, n, _] in exact {
                for (i, value) in [x, y, n].into_iter().enumerate() {
                    let beyond = |side: f64| value.plus(w.times((-side).into())).hi;
                    assert!(
                        beyond(bounds[2 * i]) >= 0.0 && beyond(bounds[2 * i + 1]) <= 0.0,
                        "trial {trial}"
                    );
                    bounded += 1;
                }
            }
            let errors = [object.determinant_error(), object.cross_error(projection.size)];
            let [a, b, c] = plane(corners.each_ref(), &object, &projection, &errors);
            for [x, y, w, n, _] in exact {
                let inside = x.hi >= 0.0 && x.hi <= 640.0 * w.hi && y.hi >= 0.0 && y.hi <= 360.0 * w.hi;
                let terms = [x.times(a.into()), y.times(b.into()), w.times(c.into())];
                let key = terms.into_iter().fold(DoubleDouble::ZERO, DoubleDouble::plus);
                if inside && key.hi.is_finite() {
                    assert!(n.plus(key.negated()).hi >= 0.0, "trial {trial}: a corner is behind its plane");
                    planes += 1;
                }
            }
        }
        assert!(bounded > 10_000 && planes > 1_000, "{bounded} bounds, {planes} planes");
    }
}
