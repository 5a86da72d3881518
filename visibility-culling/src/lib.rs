//! Visibility culling for engines and viewers: returns the objects that a camera can see.
//!
//! This crate bundles the family of `visibility` crates into one dependency. The types that every program
//! needs are at the root: the [`Scene`], the [`View`], the [`Pipeline`] of cullers and the [`VisibleSet`]
//! that the pipeline narrows down. Helpers around culling are here too: [levels of detail](lod), [casters],
//! [backface], [clusters], [motion], [queries], [draw lists](draw_list). Each further family of cullers is a
//! module behind a feature of the same name.
//!
//! # Which culler for which scene
//!
//! | scene | culler | feature | accuracy | requires |
//! |---|---|---|---|---|
//! | any scene; always first | [`FrustumCuller`] | | conservative | bounding boxes |
//! | rooms and corridors | `portals::PortalCuller` | `portals` | conservative | cells and portals, or walls to make them from |
//! | rooms and corridors, if frame time matters more than the last hidden object | [`PvsCuller`](pvs::PvsCuller) | `portals` bakes its visible sets | conservative | a PVS baked beforehand from cells and portals |
//! | streets, terrain, any large opaque objects | `hzb::HzbCuller` | `hzb` | conservative | occluder meshes; the scene's own triangles suffice |
//! | houses and towers on the ground, seen from the street | `two_d::horizon::HorizonCuller` | `two_d` | conservative | occluder meshes |
//! | what can be seen from anywhere in a region | `region::ExtendedProjectionCuller` | `region` | conservative | occluder meshes |
//! | the same, with a line of sight or a proof for each object | `exact::ExactCuller` | `exact` | exact | triangles |
//! | walls on a floor plan: fog of war, guards | `two_d::cdt::Plan` | `two_d` | exact | segments |
//! | few, large, flat occluders | `bsp::OcclusionTreeCuller` | `bsp` | conservative | occluder meshes |
//! | a fixed budget of triangles | `plp::PlpCuller` | `plp` | approximate | triangles, and a tessellation made from them |
//! | exact visibility, at higher cost | `bsp::NaylorCuller` | `bsp` | exact | triangles |
//! | clusters of one-sided triangles | [`BackfaceCuller`](backface::BackfaceCuller) | | conservative | triangles |
//! | shadow maps: objects that cast a shadow into the view | [`CasterCuller`](casters::CasterCuller) | | conservative | bounding boxes and a light |
//!
//! Conservative and exact cullers never hide a visible object, whatever the rounding. `measure::Advisor`
//! (feature `measure`) measures cullers on a given scene and chooses among them.
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
//! // Each frame: report moved objects, cull, draw.
//! scene.set_bounds(ids[7], Aabb::from_arrays([7.1, 0.0, 0.0], [7.6, 1.0, 1.0]))?;
//! let pose = Pose::look_at(DVec3::new(-1.0, 0.5, 0.5), DVec3::new(1.0, 0.5, 0.5), DVec3::Z);
//! let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, 50.0)?;
//! pipeline.cull(&scene, &view, &mut visible);
//! assert!(visible.contains(&scene, ids[7]) && !visible.contains(&scene, ids[99]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//! The [`guide`] continues from here, chapter by chapter, with all features: `guide::first_engine` leads to a
//! first engine in 15 minutes, `guide::wrong_picture` helps when the picture is empty or wrong.
#![no_std]

pub mod guide;

pub use visibility_core::*;
pub use visibility_frame::*;

/// Bakes: long computations in rounds over many items and threads. With the feature `bake`, also bakes of a
/// level from its scene to a file.
pub mod bake {
    #[cfg(feature = "bake")]
    pub use visibility_bake::*;
    pub use visibility_core::bake::*;
}

#[cfg(feature = "two_d")]
pub use visibility_2d as two_d;
#[cfg(feature = "bsp")]
pub use visibility_bsp as bsp;
#[cfg(feature = "exact")]
pub use visibility_exact as exact;
#[cfg(feature = "hzb")]
pub use visibility_hzb as hzb;
#[cfg(feature = "measure")]
pub use visibility_measure as measure;
#[cfg(feature = "hzb")]
pub use visibility_occluders as occluders;
#[cfg(feature = "plp")]
pub use visibility_plp as plp;
#[cfg(feature = "portals")]
pub use visibility_portals as portals;
#[cfg(feature = "region")]
pub use visibility_region as region;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
