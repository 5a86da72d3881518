//! Arithmetic with twice the precision, in two numbers each, for tests (Dekker, "A Floating-Point Technique for Extending the Available
//! Precision", 1971).

use visibility_core::glam::DVec4;

pub(crate) fn sum(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    let s = a[0] + b[0];
    let v = s - a[0];
    let e = (a[0] - (s - v)) + (b[0] - v) + a[1] + b[1];
    [s + e, e - ((s + e) - s)]
}

pub(crate) fn product(a: [f64; 2], b: f64) -> [f64; 2] {
    let p = a[0] * b;
    let e = a[0].mul_add(b, -p) + a[1] * b;
    [p + e, e - ((p + e) - p)]
}

/// `x`, `y` and `w` of a point, as a [`Lens`](crate::lens::Lens) has them, on a picture of `size`; `rows` are those of the clip matrix but for `z`.
pub(crate) fn on_screen(rows: [DVec4; 3], p: [f64; 3], [width, height]: [f64; 2]) -> [[f64; 2]; 3] {
    let [x, y, w] =
        rows.map(|row| (0..3).fold([row.w, 0.0], |all, i| sum(all, product([row[i], 0.0], p[i]))));
    [product(sum(w, x), 0.5 * width), product(sum(w, y.map(|y| -y)), 0.5 * height), w]
}
