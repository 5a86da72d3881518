//! Points on the screen in double-double arithmetic, for tests of bounds on rounding.

use visibility_core::geometry::DoubleDouble;
use visibility_core::glam::DVec4;

/// `x`, `y` and `w` of a point `p` as [`ScreenProjection`](crate::setup::screen_projection::ScreenProjection)
/// has them, for a picture of the given size in pixels. `rows` are the first, second and fourth of the clip
/// matrix.
pub(crate) fn on_screen(rows: [DVec4; 3], p: [f64; 3], [width, height]: [f64; 2]) -> [DoubleDouble; 3] {
    let [x, y, w] = rows.map(|row| {
        (0..3).fold(DoubleDouble::from(row.w), |sum, i| sum.plus(DoubleDouble::product(row[i], p[i])))
    });
    let half = |sum: DoubleDouble, side: f64| sum.times(DoubleDouble::from(0.5 * side));
    [half(w.plus(x), width), half(w.plus(y.negated()), height), w]
}
