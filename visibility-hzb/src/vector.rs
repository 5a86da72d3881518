//! Vectors of three `f64` as arrays, with functions that are always inlined. They stand in for glam's, which
//! are not inlined into functions compiled for wider instruction sets.

/// Homogeneous screen coordinates `x`, `y` (pixel coordinates times `w`) and `w` of a corner, or a difference
/// or cross product of two such vectors.
pub(crate) type Point = [f64; 3];

/// Returns the cross product `a x b`.
#[inline(always)]
pub(crate) fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Returns the dot product of `a` and `b`.
#[inline(always)]
pub(crate) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns `x`, `y` and `w` of a corner's homogeneous screen coordinates. The fourth and fifth value are `n`
/// (depth key times `w`) and the distance beyond the near plane.
#[inline(always)]
pub(crate) fn point(corner: &[f64; 5]) -> Point {
    [corner[0], corner[1], corner[2]]
}

/// Returns the difference `a - b` of two corners in all five values: `x` and `y` (pixel coordinates times
/// `w`), `w`, `n` (depth key times `w`), and the distance beyond the near plane.
#[inline(always)]
pub(crate) fn less(a: &[f64; 5], b: &[f64; 5]) -> [f64; 5] {
    let mut out = [0.0; 5];
    for i in 0..5 {
        out[i] = a[i] - b[i];
    }
    out
}
