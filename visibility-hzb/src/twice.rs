//! A sum and a product with twice the precision, as two numbers each, for tests (Dekker, "A Floating-Point Technique for Extending the
//! Available Precision", 1971).

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
