//! Finds for a viewcell and an object an unblocked line of sight, or proves that there is none.
#![no_std]
#![forbid(unsafe_code)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;
