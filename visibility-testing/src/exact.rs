//! Exact signs of sums of products (Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust
//! Geometric Predicates", 1997: two-product and grow-expansion).

use visibility_core::glam::DVec3;

/// Returns the sign (-1, 0 or 1) of the exact sum of the products `a * b`. Panics if a nonzero
/// product's magnitude is not within 1e-270 (inclusive) to 1e300 (exclusive). May panic for more than 48
/// nonzero products.
pub fn sign_of_sum(products: impl IntoIterator<Item = (f64, f64)>) -> i32 {
    // An expansion: numbers that do not overlap, by increasing magnitude. The last nonzero number has the
    // sign of the sum.
    let (mut expansion, mut length) = ([0.0f64; 96], 0);
    for (a, b) in products {
        if a == 0.0 || b == 0.0 {
            continue;
        }
        let high = a * b;
        assert!((1e-270..1e300).contains(&high.abs()), "{a} * {b} is beyond the oracle");
        for mut q in [a.mul_add(b, -high), high] {
            if q == 0.0 {
                continue;
            }
            for h in &mut expansion[..length] {
                let sum = q + *h;
                let other = sum - q;
                *h = (q - (sum - other)) + (*h - other);
                q = sum;
            }
            expansion[length] = q;
            length += 1;
        }
    }
    let sign = |&x: &f64| if x > 0.0 { 1 } else { -1 };
    expansion[..length].iter().rev().find(|&&x| x != 0.0).map_or(0, sign)
}

/// Returns the sign of det(b - a, c - a, d - a): 1 if `d` is on the side of the plane through `a`, `b` and
/// `c` from which these are counter-clockwise. Panics for coordinates of more than 24 bits, like
/// [`sign_of_sum`].
pub fn orientation_sign(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> i32 {
    assert!([a, b, c, d].iter().all(|x| x.as_vec3().as_dvec3() == *x), "a coordinate of more than 24 bits");
    // The determinant is the sum, over the four points, of the six products of the other three points'
    // coordinates.
    let minor = |a: DVec3, b: DVec3, c: DVec3, sign: f64| {
        let orders = [
            (0, 1, 2, 1.0),
            (1, 2, 0, 1.0),
            (2, 0, 1, 1.0),
            (0, 2, 1, -1.0),
            (2, 1, 0, -1.0),
            (1, 0, 2, -1.0),
        ];
        orders.map(|(i, j, k, s)| (a[i] * b[j], c[k] * s * sign))
    };
    let all = [minor(a, b, c, -1.0), minor(a, b, d, 1.0), minor(a, d, c, 1.0), minor(d, b, c, 1.0)];
    sign_of_sum(all.into_iter().flatten())
}
