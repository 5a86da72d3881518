//! Finds the objects that can be seen from anywhere in a viewcell: quickly, and never one too few.
#![no_std]
#![forbid(unsafe_code)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod sweep;

pub use sweep::ExtendedProjectionCuller;
