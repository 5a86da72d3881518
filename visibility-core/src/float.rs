//! The elementary functions that Rust's `core` lacks, from `std` or `libm`.
//!
//! Except for the square root, these functions are used only to set up views and scenes, never to decide what
//! is visible: their last bit may differ between platforms, and visibility results must not.

/// Returns the tangent of an angle in radians. The last bit may differ between platforms, so decisions need a
/// margin. Uses `std` if that feature is on, otherwise `libm`: for crates that work without the standard
/// library.
///
/// ```
/// assert_eq!(visibility_core::geometry::tan(0.0), 0.0);
/// ```
#[cfg(any(feature = "std", feature = "libm"))]
pub fn tan(x: f64) -> f64 {
    #[cfg(feature = "std")]
    let result = x.tan();
    #[cfg(not(feature = "std"))]
    let result = libm::tan(x);
    result
}

/// Returns the square root, rounded to the nearest `f64` on every platform, as IEEE 754 demands; NaN for
/// negative numbers. Uses `std` if that feature is on, otherwise `libm`: for crates that work without the
/// standard library.
///
/// ```
/// assert_eq!(visibility_core::geometry::sqrt(2.25), 1.5);
/// ```
#[cfg(any(feature = "std", feature = "libm"))]
pub fn sqrt(x: f64) -> f64 {
    #[cfg(feature = "std")]
    let result = x.sqrt();
    #[cfg(not(feature = "std"))]
    let result = libm::sqrt(x);
    result
}
