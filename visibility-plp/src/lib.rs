//! Visibility for a budget: prioritized-layered projection, and its conservative form.
//!
//! A scene is cut into convex cells, by an [octree](OctreeTessellation) or into [tetrahedra](DelaunayTessellation), once. Each frame the cells are
//! walked through from the eye outwards, those first that are least likely to be hidden, and what they hold is kept until a budget is spent:
//! [`PlpCuller`], approximate. [`ConservativePlpCuller`] goes on from there, with an occlusion map of what was kept, until nothing visible can
//! be missing. (Klosowski and Silva, "The Prioritized-Layered Projection Algorithm for Visible Set Estimation", 2000; "Efficient Conservative
//! Visibility Culling Using the Prioritized-Layered Projection Algorithm", 2001.)
#![no_std]
#![forbid(unsafe_code)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod conservative;
mod content;
mod cover;
mod culler;
mod delaunay;
mod facing;
mod front;
mod grid;
mod grouped;
mod layers;
mod octree;
mod openness;
mod overlap;
mod parts;
mod sight;
mod solidity;
mod stored;
mod surface_class;
mod tessellation;
mod walk;
#[cfg(test)]
mod whole;

pub use conservative::{ConservativePlpCuller, Report};
pub use content::{Content, Primitives};
pub use culler::PlpCuller;
pub use delaunay::DelaunayTessellation;
pub use octree::{Fineness, OctreeTessellation};
pub use solidity::Solidity;
pub use tessellation::{Face, Tessellation};
pub use walk::Budget;
