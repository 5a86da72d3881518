//! Culling to a budget: keeps the objects or triangles that are most likely visible, up to a given number.
//!
//! Prioritized-layered projection (PLP) estimates visibility instead of computing it. A scene is partitioned
//! once into convex cells: the leaves of an [octree](OctreeTessellation) or the
//! [tetrahedra](DelaunayTessellation) of a Delaunay triangulation. Each frame visits cells outwards from the
//! eye. The next cell is always the one that is least likely to be hidden. The objects of each visited cell
//! are kept until the budget is spent.
//!
//! - [`PlpCuller`] keeps the objects that are most likely visible, highest priority first, up to a
//!   [`Budget`]. Approximate. Needs a tessellation.
//! - `ConservativePlpCuller` (feature `papers`, see `docs/papers.md` in the repository) keeps every object
//!   that may be visible. Needs a tessellation, occluder meshes in the scene and an occlusion map.
//!
//! In a city of 522,504 triangles, 791 are visible from the street. A budget of 2 % of all triangles contains
//! 98.1 % of the visible ones. The nearest 2 % contain 62.2 %. The picture `docs/plp-plpcity.svg` in the
//! repository shows the order of cells.
//!
//! ```
//! use std::sync::Arc;
//! use visibility_core::{glam::DVec3, Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
//! use visibility_plp::{Budget, OctreeTessellation, PlpCuller};
//!
//! // A wall in front of forty posts, and one post before the wall.
//! let mut scene = Scene::new();
//! scene.insert(Aabb::from_arrays([10.0, -50.0, -50.0], [11.0, 50.0, 50.0]));
//! let before = scene.insert(Aabb::from_arrays([5.0, -0.5, -1.0], [5.5, 0.5, 1.0]));
//! let post = |y: f32| Aabb::from_arrays([30.0, y, -1.0], [30.5, y + 0.5, 1.0]);
//! scene.insert_batch((-20..20).map(|i| post(i as f32)));
//!
//! // Once, and again when much of the scene has changed. `sync` handles small changes.
//! let cells = Arc::new(OctreeTessellation::new(&scene));
//!
//! // One culler for each view.
//! let plp = PlpCuller::new(cells, Budget::Objects(2));
//! let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(plp);
//!
//! // Each frame.
//! let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
//! let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, f64::INFINITY)?;
//! let mut visible = VisibleSet::new();
//! pipeline.cull(&scene, &view, &mut visible);
//! assert_eq!(visible.count(&scene), 2);
//! assert!(visible.contains(&scene, before));
//! # Ok::<(), visibility_core::view::ViewError>(())
//! ```
//!
//! Based on: James T. Klosowski and Claudio T. Silva, "The Prioritized-Layered Projection Algorithm for
//! Visible Set Estimation", 2000; "Efficient Conservative Visibility Culling Using the Prioritized-Layered
//! Projection Algorithm", 2001.
#![no_std]
#![warn(missing_debug_implementations)]
#![forbid(unsafe_code)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod cell_frustum;
#[cfg(feature = "papers")]
mod conservative;
mod content;
mod culler;
mod delaunay;
mod front;
mod grid;
mod index_lists;
mod layers;
mod normal_bins;
mod octree;
mod openness;
mod overlap;
mod pace;
mod ray_coverage;
#[cfg(feature = "serde")]
mod serde_records;
mod shape;
mod solidity;
mod surface_class;
mod tessellation;
#[cfg(test)]
mod test_exact;
mod walk;

#[cfg(feature = "papers")]
pub use conservative::{ConservativePlpCuller, ConservativeStats};
pub use content::Content;
pub use culler::PlpCuller;
pub use delaunay::DelaunayTessellation;
pub use octree::{Fineness, OctreeTessellation};
pub use pace::Pace;
pub use solidity::Solidity;
pub use tessellation::{Face, Tessellation};
pub use walk::Budget;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
