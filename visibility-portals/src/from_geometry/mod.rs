//! Cells and portals from geometry.
//!
//! - [`from_walls`] divides space by a kd-tree along the larger walls: for buildings along the axes and for
//!   floor plans.
//! - [`from_polygons`] divides it by a BSP tree along the planes of polygons: for everything else.
//!
//! # Promises
//! Both are conservative: wherever the cells are, a line that stays farther than the tolerance from all
//! polygons is never stopped. Opaque is what polygons certainly cover. Where they leave a gap, there is a
//! portal. Polygons too small to divide space by cover nothing, except in planes that were chosen for other
//! polygons. So more and smaller cells make the answer tighter, never wrong.
//!
//! Portals narrower than the tolerance are left out, since any line through one passes within the tolerance
//! of its edges.

mod bsp;
mod join;
mod kd;
mod leaves;
mod subdivision;
mod subtract;

pub use bsp::{PolygonSettings, Solid, from_polygons};
pub use kd::{WallSettings, floor_plan, from_walls};
pub use subdivision::{GeometryError, Subdivision};
