//! Vectors of three numbers in `f64` as arrays, always inlined: into functions compiled for wider
//! instructions glam's own are not.

/// `x`, `y` and `w` of a corner, or a difference of two.
pub(crate) type Point = [f64; 3];

/// The cross product.
#[inline(always)]
pub(crate) fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The dot product.
#[inline(always)]
pub(crate) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `x`, `y` and `w` of a corner given as `x`, `y`, `w`, `n` and the distance beyond the near plane.
#[inline(always)]
pub(crate) fn point(corner: &[f64; 5]) -> Point {
    [corner[0], corner[1], corner[2]]
}

/// The difference `a - b` of all five values of two corners.
#[inline(always)]
pub(crate) fn less(a: &[f64; 5], b: &[f64; 5]) -> [f64; 5] {
    let mut out = [0.0; 5];
    for i in 0..5 {
        out[i] = a[i] - b[i];
    }
    out
}
