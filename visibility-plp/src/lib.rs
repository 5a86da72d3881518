//! Visibility for a budget: prioritized-layered projection, and its conservative form.
#![no_std]
#![forbid(unsafe_code)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod conservative;
mod content;
mod cover;
mod culler;
mod front;
mod grid;
mod grouped;
mod octree;
mod overlap;
mod parts;
mod sight;
mod solidity;
mod tessellation;
mod walk;

pub use conservative::{ConservativePlpCuller, Report};
pub use content::{Content, Primitives};
pub use culler::PlpCuller;
pub use front::{Entry, Front};
pub use octree::{Fineness, OctreeTessellation};
pub use solidity::Solidity;
pub use tessellation::{Face, Tessellation};
pub use walk::Budget;
