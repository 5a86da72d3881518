//! Finds the objects that can be seen from anywhere in a viewcell. All methods but [`SamplingCuller`] are
//! conservative: an object that can be seen is never removed.
//!
//! All methods are [`RegionCuller`](visibility_core::RegionCuller)s: they take a viewcell instead of a view.
//!
//! - [`ExtendedProjectionCuller`] is the one to start with: conservative, fuses any number of occluders, and
//!   takes a fraction of a second.
//! - [`OnlinePvs`] keeps results for a moving eye and computes the next ones ahead of it, in a scene that
//!   changes.
//! - [`SamplingCuller`] is aggressive: it gives a lower bound with which to judge the other methods.
//! - [`ConvexBlockersCuller`] is conservative, and finds objects that one convex occluder hides alone. In
//!   rooms it is the fastest, and often sufficient.
//! - `VolumetricCuller` and `ShrunkCuller` (feature `papers`, see `docs/papers.md` in the repository) are the
//!   methods of other papers, conservative: octrees of opaque cells, shrunk occluders from sample points.
//!
//! # Which objects occlude
//! The occluders of a conservative method are the *candidates* that are flagged as occluders and have a mesh,
//! as for the occlusion culler of `visibility-core`: see
//! [`VisibleSet::for_each_occluder`](visibility_core::VisibleSet::for_each_occluder). An object hides
//! nothing, since it may not be drawn, if an earlier stage has removed it, if it is on no layer [of all
//! views](visibility_core::VisibleSet::common_layers) of the set, if it is not [always
//! drawn](visibility_core::Scene::is_always_drawn), or if it is never culled. The aggressive
//! [`SamplingCuller`] errs the other way: every occluder that is always drawn and can be culled blocks its
//! rays, candidate or not.
//!
//! ```
//! use visibility_core::{glam::{Affine3A, DVec3}, pvs::Viewcell};
//! use visibility_core::{Aabb, Object, OccluderMesh, RegionCuller, Scene, VisibleSet};
//! use visibility_region::ExtendedProjectionCuller;
//! let mut scene = Scene::new();
//! // Two walls that touch, neither of which hides the post by itself.
//! for (y, end) in [(-9.0, 0.2), (0.2, 9.0)] {
//!     let wall = Aabb::from_arrays([5.0, y, -9.0], [5.2, end, 9.0]);
//!     let id = scene.insert(Object { occluder: true, ..Object::new(wall) });
//!     let mesh = scene.add_mesh(OccluderMesh::cuboid(&wall)?);
//!     scene.set_mesh(id, mesh, Affine3A::IDENTITY)?;
//! }
//! let post = scene.insert(Aabb::from_arrays([20.0, 0.0, 0.0], [20.5, 0.5, 1.0]));
//! let mut visible = VisibleSet::new(); // holds every object until culled
//! let cell = Viewcell::from_box(DVec3::splat(-0.5), DVec3::splat(0.5));
//! ExtendedProjectionCuller::new().cull(&scene, &cell, &mut visible);
//! assert!(!visible.contains(&scene, post));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![no_std]
#![warn(missing_debug_implementations)]
#![forbid(unsafe_code)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod blocker;
mod convex_blockers;
mod extent;
mod online;
mod online_cells;
mod remove;
mod sampling;
#[cfg(feature = "papers")]
mod shrunk;
mod sight_start;
mod solids;
mod sweep;
mod umbra;
#[cfg(feature = "papers")]
mod volumetric;

pub use convex_blockers::ConvexBlockersCuller;
pub use online::{OnlinePvs, OnlineSizeError, OnlineStep};
pub use online_cells::OnlineCells;
pub use sampling::{SamplingCuller, SightLine};
#[cfg(feature = "papers")]
pub use shrunk::ShrunkCuller;
pub use sweep::{ExtendedProjectionCuller, ProjectionPlane};
#[cfg(feature = "papers")]
pub use volumetric::VolumetricCuller;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
