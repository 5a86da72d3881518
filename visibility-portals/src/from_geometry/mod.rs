//! Cells and portals from geometry.
//!
//! - [`from_walls`] divides space by a kd-tree along the larger walls: for axis-aligned buildings and for
//!   floor plans.
//! - [`from_polygons`] divides space by a BSP tree along the planes of polygons: for all other geometry.
//!
//! # Guarantees
//! Both functions are conservative. Wherever the cell boundaries lie, a line that stays farther than the
//! tolerance from all polygons is never blocked. Only the area that polygons certainly cover is opaque, and
//! every gap between polygons becomes a portal. Polygons too small to divide space cover nothing, except in
//! planes that were chosen for other polygons. More and smaller cells therefore make the result tighter, and
//! fewer cells never make it wrong.
//!
//! Portals narrower than the tolerance are left out, since any line through such a portal passes within the
//! tolerance of its edges.

mod bsp_portals;
mod from_polygons;
mod from_walls;
mod merge_pieces;
mod subdivision;
mod subtract_polygons;

pub use from_polygons::{PolygonSettings, SolidRule, from_polygons};
pub use from_walls::{WallSettings, floor_plan, from_walls};
pub use subdivision::{GeometryError, Subdivision};
