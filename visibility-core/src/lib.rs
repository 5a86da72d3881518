//! Core of the visibility crates.
#![no_std]
extern crate alloc;
#[cfg(feature = "std")]
extern crate std;
