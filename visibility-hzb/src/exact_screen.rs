//! Homogeneous screen coordinates in double-double arithmetic, for tests of the error bounds of the `f64` and
//! `f32` code.

use crate::setup::screen_projection::ScreenProjection;
use visibility_core::geometry::DoubleDouble;
use visibility_core::glam::{Affine3A, DVec4};

/// Returns `x`, `y` (pixel coordinates times `w`) and `w` of a point `p` of the scene, as
/// [`ScreenProjection`](crate::setup::screen_projection::ScreenProjection) defines them, for a picture of the
/// given width and height in pixels. `rows` are the first, second and fourth row of the clip matrix.
pub(crate) fn on_screen(rows: [DVec4; 3], p: [f64; 3], [width, height]: [f64; 2]) -> [DoubleDouble; 3] {
    let [x, y, w] = rows.map(|row| {
        (0..3).fold(DoubleDouble::from(row.w), |sum, i| sum.plus(DoubleDouble::product(row[i], p[i])))
    });
    let half = |sum: DoubleDouble, side: f64| sum.times(DoubleDouble::from(0.5 * side));
    [half(w.plus(x), width), half(w.plus(y.negated()), height), w]
}

/// Returns the exact values of the five rows of `projection` at the point `p` of an object, which `transform`
/// maps to the scene: `x` and `y` (pixel coordinates times `w`), `w`, `n` (depth key times `w`), and the
/// distance beyond the near plane (positive beyond, in the unit of clip space). The coefficients of the rows
/// are taken as exact.
pub(crate) fn exact_values(
    projection: &ScreenProjection,
    transform: &Affine3A,
    p: [f32; 3],
) -> [DoubleDouble; 5] {
    let [a, b, c] = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis];
    let (shift, anchor) = (transform.translation, projection.anchor.to_array());
    let place: [DoubleDouble; 3] = core::array::from_fn(|i| {
        let terms = [(a[i], p[0]), (b[i], p[1]), (c[i], p[2])];
        let start = DoubleDouble::difference(f64::from(shift[i]), anchor[i]);
        terms
            .into_iter()
            .fold(start, |sum, (m, p)| sum.plus(DoubleDouble::product(f64::from(m), f64::from(p))))
    });
    let [x, y, w, n] = projection.rows;
    [x, y, w, n, projection.near].map(|row| {
        (0..3).fold(DoubleDouble::from(row.constant), |sum, i| sum.plus(place[i].times(row.linear[i].into())))
    })
}
