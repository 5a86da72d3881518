//! Visibility culling in object space: occluders are planes through the eye, at no resolution, and nothing is
//! drawn.
//!
//! | What it does | Type | Needs | Promise |
//! |---|---|---|---|
//! | Hides boxes behind large walls, which fuse | [`OcclusionTreeCuller`] | meshes | conservative |
//! | The same by one wall or two, and remembers why | [`LargeOccludersCuller`] | meshes | conservative |
//! | The same by walls chosen in advance for a region | [`ShadowFrustaCuller`] | meshes | conservative |
//! | Hides every object of which nothing is seen | [`NaylorCuller`] | triangles | exact |
//! | Puts objects in the order of depth | [`BspOrderCuller`] | triangles | conservative |
//! | Tests boxes against occluders, for a driver of your own | [`OcclusionTree`] | meshes | conservative |
//!
//! The first three share [`Occluders`], large polygons made when a scene is loaded; the next two share a
//! [`SceneTree`]. Each has a `sync` for scenes that change; an object that has changed since neither hides
//! anything nor is hidden by mistake. Below these are [`BspTree`], the partition of any polygons, and
//! [`Solid`], set operations on closed meshes.
//!
//! ```
//! use visibility_bsp::{Occluders, OcclusionTreeCuller};
//! use visibility_core::glam::{Affine3A, DVec3};
//! use visibility_core::{
//!     Aabb, FrustumCuller, Object, OccluderMesh, Pipeline, Pose, Scene, View, VisibleSet,
//! };
//! let mut scene = Scene::new();
//! let bounds = Aabb::from_arrays([4.0, -5.0, -5.0], [4.5, 5.0, 5.0]);
//! let wall = scene.insert(Object { occluder: true, ..Object::new(bounds) });
//! let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds)?);
//! scene.set_mesh(wall, mesh, Affine3A::IDENTITY)?;
//! let behind = scene.insert(Aabb::from_arrays([8.0, -1.0, -1.0], [9.0, 1.0, 1.0]));
//!
//! let occluders = std::sync::Arc::new(Occluders::new(&scene)); // once, for all views
//! let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(OcclusionTreeCuller::new(occluders));
//! let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
//! let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY)?;
//! let mut visible = VisibleSet::new();
//! pipeline.cull(&scene, &view, &mut visible);
//! assert!(visible.contains(&scene, wall) && !visible.contains(&scene, behind));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Features
//! `std` (default), or `libm` without it.
#![no_std]
#![forbid(unsafe_code)]
// `!(a > b)` is meant: it also holds where one is not a number.
#![allow(clippy::neg_cmp_op_on_partial_ord)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod bsp_order_culler;
mod clip_projection;
mod large_occluders;
mod merge;
mod naylor;
mod occluders;
mod occlusion_tree;
mod polygon_cut;
mod scene_tree;
mod shadow;
mod shadow_frusta;
pub mod tree;
mod view_volume;

pub use bsp_order_culler::BspOrderCuller;
pub use large_occluders::LargeOccludersCuller;
pub use merge::{Solid, SolidError};
pub use naylor::{NaylorCuller, Witness};
pub use occluders::Occluders;
pub use occlusion_tree::{OcclusionTree, OcclusionTreeCuller};
pub use scene_tree::SceneTree;
pub use shadow_frusta::{ShadowFrusta, ShadowFrustaCuller};
pub use tree::{BspError, BspTree, Fragment, Fragments, Leaf, Order, Subtree, Walk};
