//! Horizons: how high occluders that stand upright reach, by direction on the plan.
//!
//! A person in a street sees a row of houses, the roofs of higher ones behind, a tower above these. For each
//! direction on the plan that is a staircase of steps (distance, height in the picture): what is farther than
//! a step and lower than its top is hidden. Such a horizon is a picture of one row instead of a thousand, so
//! a frame costs microseconds. (The horizon is the occlusion of 2.5-D scenes in Cohen-Or, Chrysanthou, Silva
//! and Durand, "A Survey of Visibility for Walkthrough Applications", 2003, section 7.4.)
//!
//! # Picture
//! The picture is that of a level cube around the eye without top and bottom: four faces, the columns of each
//! of even width. In the face towards +x, a point at `(x, y, z)` relative to the eye is in column `y / x`, at
//! height `z / x`. Straight lines stay straight, so a convex solid is a convex polygon. A column holds steps
//! `(1 / x, top, bottom)`: every line of sight of the column that passes between bottom and top has met an
//! occluder at depth `x` at the latest.
//!
//! # Why nothing visible is hidden
//! - A step of a column holds for all of its width: its top is the lowest of the polygon's upper outline
//!   between the sides of the column, its bottom the highest of the lower outline, its depth the farthest of
//!   both. Within the polygon, `1 / depth` of the entry into a convex solid is a concave function, so it is
//!   nowhere less than at the outlines.
//! - Nothing stands on a ground by assumption. A wall that begins above the street hides what is above its
//!   lower edge only.
//! - A wall that is no convex solid counts where its panels follow each other without a gap: see `walls.rs`
//!   and `outline.rs`.
//! - Hills hide where a line of sight is above the ground first and below it later: see `terrain.rs`.
//! - Boxes are rounded outwards and nearer, outlines inwards and farther, by bounds derived in `outline.rs`
//!   and `column_query.rs`.

mod column_query;
mod columns;
mod crowns;
mod culler;
mod extract;
mod frame;
mod map;
mod occluders;
mod outline;
mod terrain;
mod terrain_columns;
mod walls;

pub use culler::HorizonCuller;
pub(crate) use extract::{Solids, convex_hull};
pub use frame::UpAxis;
pub use map::Horizon;
pub use occluders::HorizonOccluders;
pub(crate) use outline::Post;
