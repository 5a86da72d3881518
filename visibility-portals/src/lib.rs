//! Architectural visibility: cells and portals.
//!
//! A building is divided into convex cells, and each cell sees other cells only through portals. This gives
//! two methods:
//! - Each frame, [`PortalCuller`] walks from the cell of the eye through open portals and removes the objects
//!   that cannot be seen through them.
//! - Before run time, [`CellBaker`] and [`ObjectBaker`] compute which cells and which objects can be seen
//!   from anywhere in a cell. The result, a [`Pvs`](visibility_core::pvs::Pvs), limits the walk or culls
//!   without it ([`PvsCuller`](visibility_core::pvs::PvsCuller)).
//!
//! The picture `docs/guide/office-cells.png` in the repository shows a frame: three cells seen through a
//! door.
//!
//! Cells and portals are made by [`from_geometry`] or read by [`prt`].
//!
//! ```
//! use visibility_core::bake::Bake;
//! use visibility_core::glam::{DVec2, DVec3};
//! use visibility_core::{
//!     Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet,
//! };
//! use visibility_portals::from_geometry::{WallSettings, floor_plan, from_walls};
//! use visibility_portals::{CellBaker, PortalCuller, SceneCells, BakerSettings};
//!
//! // The walls of two rooms, 3 m high, with a door between them from y = 1 to 2.
//! let wall = |a: [f64; 2], b: [f64; 2]| [DVec2::from(a), DVec2::from(b)];
//! let plan = [
//!     wall([0.0, 0.0], [8.0, 0.0]), wall([0.0, 4.0], [8.0, 4.0]),
//!     wall([0.0, 0.0], [0.0, 4.0]), wall([8.0, 0.0], [8.0, 4.0]),
//!     wall([4.0, 0.0], [4.0, 1.0]), wall([4.0, 2.0], [4.0, 4.0]),
//! ];
//! let rooms = from_walls(&floor_plan(&plan, 0.0, 3.0)?, &WallSettings::default())?;
//! // Before the first frame: which cells see which.
//! let matrix = Bake::new(CellBaker::new(&rooms.graph, BakerSettings::default())?).run().matrix;
//! let pvs = matrix.to_pvs(&rooms.graph)?;
//!
//! let mut scene = Scene::new();
//! let seen = scene.insert(Aabb::from_arrays([6.0, 1.2, 0.0], [6.5, 1.8, 1.0]));
//! let hidden = scene.insert(Aabb::from_arrays([4.5, 3.0, 0.0], [5.0, 3.5, 1.0]));
//! let cells = SceneCells::new(rooms.graph, rooms.viewcells, 1e-6)?.with_pvs(pvs)?;
//! let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(PortalCuller::new(cells));
//! let mut visible = VisibleSet::new();
//!
//! // Each frame:
//! let pose = Pose::look_at(DVec3::new(1.0, 1.5, 1.5), DVec3::new(7.0, 1.5, 1.0), DVec3::Z);
//! pipeline.cull(&scene, &View::perspective(pose, 1.5, 1.5, 0.1, 100.0)?, &mut visible);
//! assert!(visible.contains(&scene, seen) && !visible.contains(&scene, hidden));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Guarantees
//! - A bake never calls two cells hidden from each other if a line passes between them that stays at least
//!   the [clearance](BakerSettings::with_clearance) away from all portal edges, and as much more as vertices
//!   of a portal are off its plane, whatever the rounding. A frame without a bake removes no object that a
//!   line of sight reaches. A frame allows for the
//!   [misplacement](visibility_core::pvs::Viewcells::misplacement) of portals, a bake does not: the line must
//!   stay the clearance and the misplacement away from the edges of the true openings.
//! - Bakes and frames give the same result on every machine, with any number of threads.
//! - No panic on any input. A bake can be stopped at any time; its result up to then is conservative too.
//!
//! # Features
//! `std` (default), or else `libm`. `rayon`: bakes on all threads of the current pool.
#![no_std]
#![warn(missing_debug_implementations)]
#![forbid(unsafe_code)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod bake_settings;
mod cell_baker;
mod cell_matrix;
mod clip_polygon;
mod coplanar_portals;
mod culler;
mod directed_portals;
pub mod from_geometry;
#[cfg(test)]
mod integer_vectors;
mod object_baker;
mod pluecker;
mod portal_chain;
mod portal_flow;
mod portal_pairs;
pub mod prt;
mod separating_planes;
#[cfg(feature = "serde")]
mod serde_records;

pub use bake_settings::{BakeError, BakerSettings, ChainTest};
pub use cell_baker::{CellBaker, Fallback, Outcome};
pub use cell_matrix::CellMatrix;
#[cfg(feature = "std")]
pub use culler::SharedPortalCuller;
pub use culler::{
    MirrorId, Narrowing, NotCulled, Passage, PortalCuller, PortalEye, PortalStats, Reflection, SceneCells,
    SceneCellsError,
};
pub use object_baker::{ObjectBaker, ObjectOutcome};
pub use portal_pairs::PortalPairs;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
