//! Exact signs of sums of products (Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust
//! Geometric Predicates", 1997: two-product and grow-expansion).

/// Returns the sign (-1, 0 or 1) of the exact sum of the products `a * b`. Panics if a nonzero
/// product's magnitude is not within 1e-270 (inclusive) to 1e300 (exclusive). May panic for more than 48
/// nonzero products.
pub fn sign_of_sum(products: impl IntoIterator<Item = (f64, f64)>) -> i32 {
    // An expansion: numbers that do not overlap, in order of increasing magnitude. The last nonzero number
    // has the sign of the sum.
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
