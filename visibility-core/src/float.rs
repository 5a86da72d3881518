//! The elementary functions that Rust's `core` lacks, from `std` or `libm`.
//!
//! These functions are used only to set up views and scenes, never to decide what is visible: their last bit
//! may differ between platforms, and visibility results must not.

#[cfg(feature = "std")]
pub(crate) fn tan(x: f64) -> f64 {
    x.tan()
}

#[cfg(all(not(feature = "std"), feature = "libm"))]
pub(crate) fn tan(x: f64) -> f64 {
    libm::tan(x)
}

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
