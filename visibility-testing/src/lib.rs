//! What the tests of the visibility crates share.
//!
//! A crate that takes this as a dev-dependency can use all of it in integration tests and doc tests. Unit
//! tests inside `visibility-core` can use [`Random`] and whatever else has no type of core in its signature:
//! cargo compiles core twice for them, and the types of the two differ.

pub mod allocations;
pub mod cameras;
mod exact;
mod hash;
mod octree;
mod plain_map;
mod random;
pub mod swapped;

pub use exact::sign_of_sum;
pub use hash::{FNV_START, fnv};
pub use octree::Octree;
pub use plain_map::PlainMap;
pub use random::Random;
