//! Finds the objects that can be seen from anywhere in a viewcell: quickly, and never one too few.
#![no_std]
#![forbid(unsafe_code)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod blocker;
mod convex_blockers;
mod remove;
mod sampling;
mod shrunk;
mod solids;
mod sweep;
mod umbra;
mod virtual_occluders;
mod volumetric;

pub use convex_blockers::ConvexBlockersCuller;
pub use sampling::{SamplingCuller, SightLine};
pub use shrunk::ShrunkCuller;
pub use sweep::ExtendedProjectionCuller;
pub use virtual_occluders::{VirtualOccluder, VirtualOccluders};
pub use volumetric::VolumetricCuller;
