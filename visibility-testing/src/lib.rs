//! What the tests of the visibility crates share.
//!
//! A crate that takes this as a dev-dependency can use all of it in integration tests and doc tests. Unit
//! tests inside `visibility-core` can use [`Random`] and whatever else has no type of core in its signature:
//! cargo compiles core twice for them, and the types of the two differ.

mod random;

pub use random::Random;
