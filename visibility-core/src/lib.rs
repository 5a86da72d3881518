//! Visibility culling for game engines: which objects can this camera see?
//!
//! This crate is the core of the `visibility` crates. It defines the [`Scene`] of objects with its hierarchy,
//! the [`View`] in any engine's convention, the [`VisibleSet`] that passes through a [`Pipeline`] of
//! [`Culler`]s each frame, and the [`FrustumCuller`]. The crate `visibility-measure` computes reference
//! visibility, against which every culler can be judged.
//!
//! ```
//! use visibility_core::{glam::DVec3, Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
//!
//! let mut scene = Scene::new();
//! let crate_ = scene.insert(Aabb::from_arrays([4.0, -1.0, 0.0], [6.0, 1.0, 2.0]));
//! let mut pipeline = Pipeline::new().with(FrustumCuller::new());
//! let mut visible = VisibleSet::new();
//!
//! // Each frame: tell the scene what moved, cull, draw.
//! scene.set_bounds(crate_, Aabb::from_arrays([4.5, -1.0, 0.0], [6.5, 1.0, 2.0]))?;
//! let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
//! let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, f64::INFINITY)?;
//! pipeline.cull(&scene, &view, &mut visible);
//! for id in visible.iter(&scene) {
//!     println!("draw object {}", id.index());
//! }
//! # assert_eq!(visible.count(&scene), 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Promises
//! - A conservative culler never hides a visible object, whatever the rounding, at any magnitude of
//!   coordinates.
//! - The same clip matrix gives the same answer on every processor, with any SIMD path, on any number of
//!   threads.
//! - No allocation per frame once buffers have grown, no panic on any input.
//!
//! # Features
//! Feature `std` (default) chooses SIMD at run time. Without it, `libm` is needed for a few elementary
//! functions. Feature `bytemuck` makes [`Aabb`] and [`ObjectId`] `Pod`, and glam's vectors and matrices too.
//! None of the next three needs `std`.
//!
//! - `serde`: ids, boxes, [`Object`], [`View`] and settings are `Serialize` and `Deserialize`, and glam's
//!   types too. What is read passes the checks of the constructors. An improper box is refused, also when
//!   written. Ids keep their generation, which another run of the program does not know.
//! - `mint`: types of `mint` where arrays are taken: clip matrices ([`view::ClipMatrix`]), transforms
//!   ([`scene::ToAffine`]), boxes.
//! - `tracing`: a span `cull` for each frame, in it a span `stage` for each culler, a span `bake_round` for
//!   each round of a [`bake`] and in it a span `bake_item` for each item. Their fields are the counters
//!   [`CullStats`] and [`bake::Progress`]. Level `DEBUG`, target `visibility`.
#![no_std]
#![warn(missing_debug_implementations)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

#[cfg(not(any(feature = "std", feature = "libm")))]
compile_error!("visibility-core needs floating point: enable the feature `std` or the feature `libm`");

pub mod bake;
pub mod binary_format;
pub mod bits;
pub mod cells;
mod cull_stats;
pub mod culler;
mod float;
pub mod frustum;
pub mod geometry;
pub mod jobs;
mod kept_answer;
pub mod level_version;
#[cfg(feature = "mint")]
mod mint_conversions;
pub mod occlusion;
pub mod pipeline;
pub mod pvs;
pub mod random;
mod region_culler;
pub mod scene;
#[cfg(feature = "serde")]
mod serde_records;
mod serial;
pub mod simd;
mod spans;
pub mod stamp;
mod test_plane;
pub mod union_find;
pub mod view;
pub mod visible_set;
pub mod walk;
pub mod who_sees;

pub use cull_stats::CullStats;
pub use culler::{Accuracy, Culler};
pub use frustum::FrustumCuller;
pub use geometry::Aabb;
pub use glam;
pub use level_version::level_version;
pub use occlusion::{OccluderMesh, OcclusionCuller, OcclusionMap};
pub use pipeline::Pipeline;
pub use region_culler::RegionCuller;
pub use scene::{Object, ObjectId, Scene};
pub use view::{Pose, View};
pub use visible_set::VisibleSet;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
