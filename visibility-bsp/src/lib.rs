//! Object-space visibility: BSP trees, occlusion trees, shadow frusta and large occluders.
#![no_std]
#![forbid(unsafe_code)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;
