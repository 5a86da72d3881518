//! The elementary functions that `core` lacks, from `std` or `libm`.
//!
//! They are used when a view or a scene is set up, never to decide what is visible: their last digit differs
//! between platforms, and answers must not.

#[cfg(feature = "std")]
pub(crate) fn tan(x: f64) -> f64 {
    x.tan()
}

#[cfg(all(not(feature = "std"), feature = "libm"))]
pub(crate) fn tan(x: f64) -> f64 {
    libm::tan(x)
}
