//! Vectors of three numbers in `f64`: glam's own are not inlined into functions compiled for other instructions.

/// A point as its `x`, `y` and `w`.
pub(crate) type Point = [f64; 3];

#[inline(always)]
pub(crate) fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
pub(crate) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn point(corner: &[f64; 5]) -> Point {
    [corner[0], corner[1], corner[2]]
}

#[inline(always)]
pub(crate) fn less(a: &[f64; 5], b: &[f64; 5]) -> [f64; 5] {
    let mut out = [0.0; 5];
    for i in 0..5 {
        out[i] = a[i] - b[i];
    }
    out
}
