//! Exact visibility among walls on a plan, by a constrained Delaunay triangulation.
//!
//! A [`Plan`] is made once from [`Wall`]s. Each query expands cones of sight from its eye through triangles
//! until they end at walls, so its time is proportional to the number of triangles seen. Every decision is on
//! which side of the line through two wall ends a third wall end lies, and is exact: see `predicates.rs`.
//! Only the corners of visibility polygons are rounded.
//!
//! - [`Plan::look`]: the visibility polygon and the walls seen, within a range or a sector, through glass,
//!   one-way walls and a number of opaque ones.
//! - [`Plan::look_at`]: which of many objects are seen, in time proportional to the triangles and objects
//!   seen.
//! - [`Wall::with_heights`], [`Plan::sees_at`], [`PlanView::with_heights`]: low walls, and eyes above them.
//! - [`Plan::sees`], [`Plan::ray`]: lines of sight between two points, the first wall on a ray.
//! - [`Plan::look_from_region`]: the walls and triangles seen from anywhere in a triangle, on a segment, in a
//!   convex cell.
//! - [`VisibilityGraph`], [`ShortestPath`]: shortest paths among walls, for robots, and for sound that bends
//!   around corners.
//! - [`UnseenRegion`], [`HidingPlaces`]: what a set of eyes does not see, its connected parts, and where an
//!   evader may be when watchers change posts.
//! - [`Guards`]: few eyes that together see all of a region, and a lower bound on their number.
//! - [`PlanCells`]: which of many movers see each other.
//! - [`Plan::set_opacity`]: doors that open and close.

pub(crate) mod constrain;
mod convex_piece;
mod error;
mod expand;
mod guards;
mod hilbert;
mod line_crossing;
mod locate;
mod objects;
mod plan;
mod plan_cells;
pub(crate) mod predicates;
mod range;
mod reach;
mod region;
mod shortest_path;
mod sight;
#[cfg(test)]
mod tests;
pub(crate) mod triangulation;
mod unseen;
mod view;
mod visibility;
mod visibility_graph;
mod wall;

pub use error::PlanError;
pub use guards::Guards;
pub use objects::PlanObjects;
pub use plan::Plan;
pub use plan_cells::PlanCells;
pub use region::RegionVisibility;
pub use shortest_path::ShortestPath;
pub use sight::WallHit;
pub use unseen::{HidingPlaces, UnseenRegion};
pub use view::PlanView;
pub use visibility::Visibility;
pub use visibility_graph::VisibilityGraph;
pub use wall::{Opacity, Wall};
