//! Cells and portals from geometry.
//!
//! - [`from_walls`] divides space by a kd-tree along the larger walls: for axis-aligned buildings and for
//!   floor plans.
//! - [`from_polygons`] divides space by a BSP tree along the planes of polygons: for all other geometry.
//!
//! # Guarantees
//! Both functions are conservative. What a segment from an eye reaches counts as seen if the segment passes
//! no polygon, and stays farther than the tolerance from all but those before which it begins or ends, such
//! as the wall that a picture hangs on, and those to which an end is nearer than a quarter of the tolerance.
//! Only the area that polygons certainly cover is opaque, and every gap between polygons becomes a portal;
//! gaps narrower than the tolerance may be closed. Polygons too small to divide space cover nothing, except
//! in planes that were chosen for other polygons. More and smaller cells therefore make the result tighter,
//! and fewer cells never make it wrong.
//!
//! Polygons in nearly the same plane become one plane, so that cells and portals are not quite where polygons
//! and openings are. [`Subdivision::viewcells`] knows how far they may be misplaced, and all that is made
//! from it reckons with that: objects and eyes that are so near to a cell are in it, and in a frame, lines
//! that pass a portal so nearly pass it. The bakers take portals as they are: what is seen only by lines that
//! pass an edge of an opening nearer than misplacement and clearance together may be missing from their sets.
//!
//! Lines of sight leave the divided box through the cells at its sides. An object that reaches out of the box
//! is therefore in all cells at the sides that it reaches beyond, and is hidden only where none of these is
//! seen. An eye outside of the box, or in what is no cell, sees everything.

mod bsp_portals;
mod from_polygons;
mod from_walls;
mod merge_pieces;
mod subdivision;
mod subtract_polygons;

pub use from_polygons::{PolygonSettings, SolidRule, from_polygons};
pub use from_walls::{WallSettings, floor_plan, from_walls};
pub use subdivision::{GeometryError, Subdivision};
