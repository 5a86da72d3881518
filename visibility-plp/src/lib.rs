//! Visibility for a budget: prioritized-layered projection, and its conservative form.
#![no_std]
#![forbid(unsafe_code)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;
