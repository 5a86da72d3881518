//! Which objects can this camera see?
#![no_std]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

#[cfg(not(any(feature = "std", feature = "libm")))]
compile_error!("visibility-core needs floating point: enable the feature `std` or the feature `libm`");

mod float;
pub mod geometry;
pub mod view;

pub use geometry::{Aabb, Containment, ConvexPolygon, Plane, PolygonError, Sphere};
pub use glam;
pub use view::{ClipMatrix, Depth, Eye, MAX_PLANES, Pose, View, ViewError, ViewPlane, ViewPlanes, Window};
