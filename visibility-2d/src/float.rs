//! The elementary functions that Rust's `core` lacks, from `std` or `libm`.

/// Returns the square root, rounded to the nearest `f64` on every platform, as IEEE 754 demands.
#[cfg(feature = "std")]
pub(crate) fn sqrt(x: f64) -> f64 {
    x.sqrt()
}

/// Returns the square root, rounded to the nearest `f64` on every platform, as IEEE 754 demands.
#[cfg(all(not(feature = "std"), feature = "libm"))]
pub(crate) fn sqrt(x: f64) -> f64 {
    libm::sqrt(x)
}
