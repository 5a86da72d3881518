//! Cells and portals made from geometry.
//!
//! - [`from_walls`] divides space by a kd-tree along the larger walls, for buildings along the axes and for
//!   floor plans.
//! - [`from_polygons`] divides it by a BSP tree along the planes of polygons, for everything else.
//!
//! # What is promised
//! Both are conservative: no line that stays farther than the tolerance from all polygons is ever stopped,
//! wherever the cells are. What is opaque is what polygons surely cover; where they leave a gap, the gap is
//! open, and a portal. Polygons too small to divide space by cover nothing but what lies in a plane that was
//! chosen for other reasons. So more and smaller cells make a tighter answer, never a wrong one.
//!
//! Portals narrower than the tolerance are left out: a line through one passes within the tolerance of the
//! portal's edges.

mod bsp;
mod join;
mod kd;
mod leaves;
mod subdivision;
mod subtract;

pub use bsp::{PolygonSettings, Solid, from_polygons};
pub use kd::{WallSettings, floor_plan, from_walls};
pub use subdivision::{GeometryError, Subdivision};
