//! Computes visibility on a plan: from walls, houses, hills and trees that stand on a ground.
#![no_std]
#![forbid(unsafe_code)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;
