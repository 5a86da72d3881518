//! Visibility culling for engines and viewers: which objects can this camera see?
//!
//! This crate is the family of `visibility` crates as one dependency. What every program needs is at the
//! root: the [`Scene`], the [`View`], the [`Pipeline`] of cullers and the [`VisibleSet`] that goes through
//! them. Each further family of cullers is a module behind a feature of the same name.
//!
//! # Which culler for which scene
//!
//! | your scene | take | feature | accuracy | it needs |
//! |---|---|---|---|---|
//! | any; always first | [`FrustumCuller`] | | conservative | boxes |
//! | rooms and corridors | `portals::PortalCuller` | `portals` | conservative | cells and portals, or walls to make them from |
//! | the same, when each frame counts more than the last object | [`PvsCuller`](pvs::PvsCuller) | `portals` bakes its sets | conservative | the same, baked beforehand |
//! | streets, terrain, anything with large opaque things | `hzb::HzbCuller` | `hzb` | conservative | occluder meshes: the scene's own triangles will do |
//! | few, large, flat occluders | `bsp::OcclusionTreeCuller` | `bsp` | conservative | occluder meshes |
//! | a fixed budget of triangles | `plp::PlpCuller` | `plp` | approximate | triangles, and a tessellation made from them |
//! | the exact answer, slowly | `bsp::NaylorCuller` | `bsp` | exact | triangles |
//! | clusters of one-sided triangles | [`BackfaceCuller`](backface::BackfaceCuller) | | conservative | triangles |
//! | shadow maps: what throws a shadow into the view | [`CasterCuller`](casters::CasterCuller) | | conservative | boxes and a light |
//!
//! Conservative and exact cullers never hide a visible object, whatever the rounding. `measure::Advisor`
//! (feature `measure`) tries cullers on your own scene and says which to take.
//!
//! # A frame
//! ```
//! use visibility_culling::glam::DVec3;
//! use visibility_culling::{Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
//!
//! let mut scene = Scene::new();
//! let boxes = (0..100).map(|i| Aabb::from_arrays([i as f32, 0.0, 0.0], [i as f32 + 0.5, 1.0, 1.0]));
//! let ids = scene.insert_batch(boxes);
//! let mut pipeline = Pipeline::new().with(FrustumCuller::new());
//! let mut visible = VisibleSet::new();
//! // Each frame: say what moved, cull, draw.
//! scene.set_bounds(ids[7], Aabb::from_arrays([7.1, 0.0, 0.0], [7.6, 1.0, 1.0]))?;
//! let pose = Pose::look_at(DVec3::new(-1.0, 0.5, 0.5), DVec3::new(1.0, 0.5, 0.5), DVec3::Z);
//! let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, 50.0)?;
//! pipeline.cull(&scene, &view, &mut visible);
//! assert!(visible.contains(&scene, ids[7]) && !visible.contains(&scene, ids[99]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![no_std]

pub use visibility_core::*;

#[cfg(feature = "bsp")]
pub use visibility_bsp as bsp;
#[cfg(feature = "hzb")]
pub use visibility_hzb as hzb;
#[cfg(feature = "measure")]
pub use visibility_measure as measure;
#[cfg(feature = "plp")]
pub use visibility_plp as plp;
#[cfg(feature = "portals")]
pub use visibility_portals as portals;
