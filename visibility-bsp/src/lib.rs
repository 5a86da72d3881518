//! Visibility culling in object space. An occluder's shadow is bounded by planes through the eye and the
//! occluder's edges, so tests are independent of image resolution and nothing is rasterized.
//!
//! | Task | Type | Needs | Accuracy |
//! |---|---|---|---|
//! | Culls boxes behind fused shadows of polygons | [`OcclusionTreeCuller`] | meshes | conservative |
//! | Culls boxes behind one or two polygons, caching | `LargeOccludersCuller` (feature `papers`) | meshes | conservative |
//! | Culls boxes behind polygons chosen by region | [`ShadowFrustaCuller`] | meshes | conservative |
//! | Culls objects without a visible triangle part | [`NaylorCuller`] | triangles | exact |
//! | Culls by the view volume, sorts front to back | [`BspOrderCuller`] | triangles | conservative |
//! | Tests boxes, for a traversal of your own | [`OcclusionTree`] | meshes | conservative |
//!
//! The picture `docs/guide/town-occlusion-tree.png` in the repository shows what an occlusion tree leaves of
//! a town.
//!
//! The first three cullers share [`Occluders`], large polygons made when a scene is loaded. `NaylorCuller`
//! and `BspOrderCuller` share a [`SceneTree`]. `Occluders` and `SceneTree` have a `sync` method for scenes
//! that change. An object that has changed since the last `sync` hides nothing, and is never culled by its
//! old state. The lower layer is public too: [`BspTree`], a binary space partition of any convex polygons.
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
//! `std` (default). Without `std`, the feature `libm` supplies the floating-point functions. `papers` adds
//! `LargeOccludersCuller`, which loses on every scene measured (`docs/papers.md` in the repository).
#![no_std]
#![warn(missing_debug_implementations)]
#![forbid(unsafe_code)]
// Negated comparisons such as `!(a > b)` are deliberate: unlike `a <= b`, they also hold if an operand is
// NaN.
#![allow(clippy::neg_cmp_op_on_partial_ord)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod bsp_order_culler;
mod clip_projection;
#[cfg(test)]
mod frame_rules;
#[cfg(feature = "papers")]
mod large_occluders;
mod lazy_queue;
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
#[cfg(feature = "papers")]
pub use large_occluders::LargeOccludersCuller;
pub use naylor::{NaylorCuller, VisiblePoint};
pub use occluders::Occluders;
pub use occlusion_tree::{OcclusionTree, OcclusionTreeCuller};
pub use scene_tree::SceneTree;
pub use shadow_frusta::{ShadowFrusta, ShadowFrustaCuller};
pub use tree::{BspError, BspTree, Fragment, Fragments, Subtree, TraversalStack, TreeVisitor};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
