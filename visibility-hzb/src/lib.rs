//! Occlusion culling in image space: a software hierarchical z-buffer that never hides what is visible.
//!
//! [`Hzb`] is an [`OcclusionMap`](visibility_core::OcclusionMap): occluders are drawn into it, boxes are tested against it.
//! [`HzbCuller`] is core's driver with that map, for a pipeline after the frustum. (Greene, Kass and Miller, "Hierarchical Z-Buffer
//! Visibility", 1993; Cohen-Or, Chrysanthou, Silva and Durand, "A Survey of Visibility for Walkthrough Applications", 2003, section 6.1.)
//!
//! ```
//! use visibility_core::{glam::{Affine3A, DVec3}, Aabb, FrustumCuller, Object, OccluderMesh, Pipeline, Pose, Scene, View, VisibleSet};
//! use visibility_hzb::{Hzb, HzbCuller};
//!
//! let mut scene = Scene::new();
//! let wall = Aabb::from_arrays([5.0, -4.0, -4.0], [5.2, 4.0, 4.0]);
//! let wall_id = scene.insert(Object { occluder: true, ..Object::new(wall) });
//! let mesh = scene.add_mesh(OccluderMesh::cuboid(&wall)?);
//! scene.set_mesh(wall_id, mesh, Affine3A::IDENTITY)?;
//! scene.insert(Aabb::from_arrays([8.0, -1.0, -1.0], [9.0, 1.0, 1.0])); // behind the wall
//!
//! let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(HzbCuller::new(Hzb::new(320, 180)?));
//! let mut visible = VisibleSet::new();
//! let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
//! let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, f64::INFINITY)?;
//! pipeline.cull(&scene, &view, &mut visible);
//! assert!(visible.iter(&scene).eq([wall_id]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Why nothing visible is hidden
//! - A pixel counts as covered only if all of it is, up to its corners, and rounding cannot change that; it holds the farthest
//!   depth that what covers it can have. Boxes and other convex solids go by their outline, whose proof is in `shape.rs`; meshes of any
//!   form by the rule of `mesh.rs`. Both are tested by rays through the corners of covered pixels.
//! - A box is hidden only if each pixel that it can meet, rounded outwards, holds something strictly nearer than the box's nearest
//!   point, rounded nearer.
//! - So the size of the buffer costs or saves time and tightness, never correctness: 512 x 288 is a good size for a picture of any size.
//!
//! [`Coverage::Sampled`] gives the first of these up, as other cullers do, and the accuracy is then *approximate*.
//!
//! # Cost
//! A box or convex occluder costs some 20 ns if it is hidden by nearer ones or out of view, 100 to 300 ns and a few for each tile of
//! its outline if not: so occluders should come roughly front to back, as the driver adds them. Other meshes cost about 100 ns a triangle, and
//! what falls apart into boxes ([`OccluderMesh::parts`](visibility_core::OccluderMesh::parts)) as much as these. Testing 64 boxes takes
//! 100 to 200 ns.
//!
//! # Features
//! `std` (default) chooses SIMD at run time; without it, `libm` stands in for the few functions that core needs.
#![no_std]
// Loops over lanes by index are what compiles to SIMD; and negated comparisons say what becomes of a NaN.
#![allow(clippy::needless_range_loop, clippy::neg_cmp_op_on_partial_ord)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod buffer;
mod buffer_size;
mod coverage;
#[cfg(test)]
mod exact_screen;
mod hom;
mod hzb;
mod lanes;
mod query;
#[cfg(test)]
mod random;
mod raster;
mod rounding;
mod setup;
mod simd;
mod vector;

pub use buffer_size::{MAX_SIDE, MIN_SIDE, SizeError};
pub use coverage::Coverage;
pub use hom::{DepthEstimate, Hom, OccluderCriteria, OccluderDatabase};
pub use hzb::Hzb;

/// Culls what a z-buffer finds hidden behind a scene's occluders, after the frustum: `HzbCuller::new(Hzb::default())`.
///
/// ```
/// use visibility_core::{Culler, Selection};
/// use visibility_hzb::{Hzb, HzbCuller};
/// let culler = HzbCuller::new(Hzb::default()).with_selection(Selection::LastVisible).with_budget(20_000);
/// assert!(culler.accuracy().never_hides());
/// ```
pub type HzbCuller = visibility_core::OcclusionCuller<Hzb>;

/// Culls what occlusion maps find hidden behind a scene's occluders, after the frustum: `HomCuller::new(Hom::default())`.
///
/// ```
/// use visibility_core::{Accuracy, Culler};
/// use visibility_hzb::{Hom, HomCuller};
/// assert!(HomCuller::new(Hom::default()).accuracy().never_hides());
/// assert_eq!(HomCuller::new(Hom::default().with_threshold(0.9)).accuracy(), Accuracy::Approximate);
/// ```
pub type HomCuller = visibility_core::OcclusionCuller<Hom>;
