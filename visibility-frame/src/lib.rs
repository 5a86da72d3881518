//! What an engine does around culling, over the scene and the visible sets of `visibility-core`.
//!
//! | before and beside the frame | |
//! |---|---|
//! | [`motion`] | which hidden movers need no update yet |
//! | [`queries`] | objects in a sphere, a box or a volume, along a ray, nearest to a point, lit by a lamp |
//!
//! | cullers | |
//! |---|---|
//! | [`casters::CasterCuller`] | objects whose shadow may fall into the view; conservative |
//! | [`lod::ContributionCuller`] | objects of few pixels, out of range, or stood in for; approximate |
//! | [`backface::BackfaceCuller`] | objects of which only back faces show; conservative |
//!
//! | what is drawn of the visible set | |
//! |---|---|
//! | [`lod::LodSelector`] | the level of detail of each object |
//! | [`clusters::ClusterView`] | the visible clusters of each object; conservative |
//! | [`draw_list::DrawList`] | groups of objects by mesh, with the commands that draw them |
//!
//! ```
//! use visibility_core::{glam::DVec3, Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
//! use visibility_frame::{DrawList, lod::ContributionCuller};
//!
//! let mut scene = Scene::new();
//! let boxes = [2.0f32, 1.0, 0.01].map(|size| Aabb::from_arrays([90.0; 3], [90.0 + size; 3]));
//! scene.insert_batch(boxes);
//! let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(ContributionCuller::new(1080.0, 2.0));
//! let (mut visible, mut list) = (VisibleSet::new(), DrawList::new());
//!
//! // Each frame: cull, then group by mesh.
//! let pose = Pose::look_at(DVec3::ZERO, DVec3::ONE, DVec3::Z);
//! let view = View::perspective(pose, 1.0, 1.5, 0.1, 200.0)?;
//! pipeline.cull(&scene, &view, &mut visible);
//! let meshes = [7, 4, 7]; // by object index
//! list.group(visible.iter(&scene), |id| meshes[id.index()]);
//! // Only two objects are drawn: the third is smaller than two pixels.
//! assert!(list.groups().iter().map(|group| (group.key, group.count)).eq([(4, 1), (7, 1)]));
//! # Ok::<(), visibility_core::view::ViewError>(())
//! ```
//!
//! # Features
//! Feature `std` (default) chooses SIMD at run time. Without it, `libm` is needed for a few elementary
//! functions. Feature `bytemuck` makes the [draw commands](draw_list) `Pod`.
#![no_std]
#![warn(missing_debug_implementations)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

pub mod backface;
pub mod casters;
pub mod clusters;
pub mod draw_list;
pub mod lod;
pub mod motion;
pub mod queries;
mod simd_dispatch;

pub use draw_list::DrawList;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
