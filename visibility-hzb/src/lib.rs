//! Occlusion culling in image space, in software: a hierarchical z-buffer and hierarchical occlusion maps
//! that never hide what is visible.
//!
//! [`Hzb`] is an [`OcclusionMap`](visibility_core::OcclusionMap): occluders are drawn into it, boxes are
//! tested against it. [`HzbCuller`] is core's occlusion culler over that map, which draws and tests from
//! front to back; it follows the frustum culler in a pipeline. [`Hom`] and [`HomCuller`] are the same for
//! hierarchical occlusion maps, which can be set to ignore small holes. (Greene, Kass and Miller,
//! "Hierarchical Z-Buffer Visibility", 1993; Zhang, Manocha, Hudson and Hoff, "Visibility Culling using
//! Hierarchical Occlusion Maps", 1997; Cohen-Or, Chrysanthou, Silva and Durand, "A Survey of Visibility for
//! Walkthrough Applications", 2003, section 6.)
//!
//! ```
//! use visibility_core::glam::{Affine3A, DVec3};
//! use visibility_core::{
//!     Aabb, FrustumCuller, Object, OccluderMesh, Pipeline, Pose, Scene, View, VisibleSet,
//! };
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
//! - A pixel counts as covered only if its whole square is covered, corners included, despite all rounding. A
//!   covered pixel holds the farthest depth that the occluder can have in the pixel. Boxes and other convex
//!   solids are drawn by their outlines (proof in `setup/screen_shape.rs`), meshes of any form by the rule in
//!   `raster/mesh_raster.rs`, occluders of a level by that in `level/mod.rs`. Tests cast rays through the
//!   corners of covered pixels.
//! - A box is hidden only if every pixel that it can meet, rounded outwards, holds an occluder strictly
//!   nearer than the nearest point of the box, rounded nearer.
//! - So the size of the buffer affects time and tightness, never correctness. 512 x 288 is a good size for
//!   pictures of any size; a larger buffer hides more.
//!
//! [`Coverage::Sampled`] gives up the first guarantee: a pixel counts as covered if its centre is covered, so
//! the accuracy is *approximate*.
//!
//! # Cost
//! - A box or another convex occluder takes some 20 ns if it is out of view or hidden by nearer ones,
//!   otherwise 100 to 300 ns, plus a few nanoseconds for each tile of its outline. So occluders should come
//!   roughly from front to back, as the driver adds them.
//! - The occluders of a level ([`Hzb::with_level`]), which are made of its triangles beforehand, take about a
//!   quarter of that time. They hide more, since pixels along edges that two objects share are covered too.
//!   Several levels, such as sectors of a world that is streamed, are drawn together ([`Hzb::add_level`]).
//! - Other meshes take about 100 ns a triangle. Meshes that consist of boxes
//!   ([`OccluderMesh::parts`](visibility_core::OccluderMesh::parts)) take as long as these boxes.
//! - 64 boxes are tested in 100 to 200 ns.
//!
//! # How the code is laid out
//! - `setup`: an occluder becomes a shape on the screen, with bounds on rounding.
//! - `raster`: shapes and meshes are drawn into tiles.
//! - `level`: the occluders of a level are drawn into tiles.
//! - `buffer`: tiles of 8 x 8 pixels, and the pyramid above them.
//! - `query`: boxes are projected and tested.
//! - `hom`: occlusion maps over the same tiles.
//! - `simd_dispatch.rs`: the functions that are compiled for several instruction sets.
//!
//! # Features
//! - `std` (default) finds out at run time which vector instructions the processor has.
//! - `libm` stands in for `std` in the few functions that core needs.
//! - `papers` adds `DepthEstimate`, the coarser depth estimates of occlusion maps. They lose on every scene
//!   measured (`docs/papers.md` in the repository).
#![no_std]
#![warn(missing_debug_implementations)]
// Index loops over lanes compile to vector instructions. Negated comparisons make the treatment of NaN
// explicit.
#![allow(clippy::needless_range_loop, clippy::neg_cmp_op_on_partial_ord)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod buffer;
mod buffer_size;
mod coverage;
#[cfg(test)]
mod covered_boxes;
#[cfg(test)]
mod exact_outline;
#[cfg(test)]
mod exact_screen;
mod hom;
mod hzb;
mod lanes;
mod level;
#[cfg(test)]
mod pixel_borders;
mod query;
#[cfg(test)]
mod random;
mod raster;
mod rounding;
#[cfg(feature = "serde")]
mod serde_records;
mod setup;
mod simd_dispatch;
mod vector;

pub use buffer_size::{MAX_SIDE, MIN_SIDE, SizeError};
pub use coverage::Coverage;
#[cfg(feature = "papers")]
pub use hom::DepthEstimate;
pub use hom::Hom;
pub use hzb::Hzb;
pub use level::PreparedLevel;

/// Occlusion culler over a hierarchical z-buffer ([`Hzb`]), to be run after a frustum culler. It draws a
/// scene's occluders roughly from front to back and removes from the visible set the objects whose bounding
/// boxes they certainly hide. Undecided objects stay visible. With [`Coverage::Sampled`] it is approximate
/// instead.
///
/// ```
/// use visibility_core::Culler;
/// use visibility_hzb::{Hzb, HzbCuller};
/// let culler = HzbCuller::new(Hzb::default());
/// assert!(culler.accuracy().never_hides());
/// ```
pub type HzbCuller = visibility_core::OcclusionCuller<Hzb>;

/// Occlusion culler over hierarchical occlusion maps ([`Hom`]), to be run after a frustum culler. It draws a
/// scene's occluders and removes from the visible set the objects that they hide. Conservative by default.
/// With an opacity threshold below 1 it also removes objects that are visible only through small holes, and
/// is approximate.
///
/// ```
/// use visibility_core::{Accuracy, Culler};
/// use visibility_hzb::{Hom, HomCuller};
/// assert!(HomCuller::new(Hom::default()).accuracy().never_hides());
/// assert_eq!(HomCuller::new(Hom::default().with_threshold(0.9)).accuracy(), Accuracy::Approximate);
/// ```
pub type HomCuller = visibility_core::OcclusionCuller<Hom>;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
