//! Horizons: the heights up to which upright occluders hide everything behind them, by direction on the plan.
//!
//! A person in a street sees a row of houses, the roofs of higher houses behind, and a tower above these. For
//! each direction on the plan this is a staircase of steps (distance, height in the picture): everything
//! farther than a step and lower than its top is hidden. A horizon is thus a picture with one row of pixels
//! instead of a thousand, and a frame takes microseconds. (The horizon is the occlusion of 2.5-D scenes in
//! Cohen-Or, Chrysanthou, Silva and Durand, "A Survey of Visibility for Walkthrough Applications", 2003,
//! section 7.4.)
//!
//! # Picture
//! The picture is a level cube around the eye without top and bottom: four faces, each divided into columns
//! of equal width. In the face towards +x, a point at `(x, y, z)` relative to the eye is in column `y / x`,
//! at height `z / x`. Straight lines stay straight, so a convex solid is a convex polygon. A column holds
//! steps `(1 / x, top, bottom)`: every line of sight of the column that passes between bottom and top has met
//! an occluder at depth `x` at the latest.
//!
//! # Why nothing visible is hidden
//! - A step of a column is valid across the column's whole width: its top is the minimum of the polygon's
//!   upper outline within the column, its bottom the maximum of the lower outline, and its depth the farthest
//!   depth of both. Within the polygon, `1 / depth` of the entry into a convex solid is a concave function,
//!   so it is nowhere less than at the outlines.
//! - No occluder is assumed to stand on a ground. A wall that begins above the street only hides above its
//!   lower edge.
//! - A wall that is not a convex solid only occludes where its panels join without a gap: see `walls.rs` and
//!   `outline.rs`.
//! - A hill hides a point if the line of sight is above the ground first and below it later: see
//!   `terrain/mod.rs`.
//! - Boxes are rounded outwards and nearer, outlines inwards and farther, by bounds derived in `outline.rs`
//!   and `column_query.rs`.

mod column_query;
mod columns;
mod crowns;
mod culler;
mod extract;
mod frame;
mod kernel;
mod map;
mod occluders;
mod outline;
mod terrain;
mod terrain_columns;
mod upward_triangles;
mod walls;

pub use culler::HorizonCuller;
pub(crate) use extract::{Solids, convex_hull};
pub use frame::UpAxis;
pub use map::Horizon;
pub use occluders::HorizonOccluders;
pub(crate) use outline::Post;
