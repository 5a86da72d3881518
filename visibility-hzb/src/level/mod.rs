//! Occluders of a level, drawn at the beginning of a frame: nearest clusters first, each polygon by its
//! outline, at one plane of depth.
//!
//! # The rule
//! A polygon covers a pixel if the pixel's centre has an odd number of outline edges to its left and no edge
//! comes near the pixel: within the *slack* of the closed pixel. The depth key is that of the plane at the
//! far side of the polygon's *slab*, the thin layer that holds its vertices. This alone leaves uncovered the
//! *seam* (`seams.rs`): the pixels along an edge that two polygons share. The two polygons cover the seam
//! together once both are drawn. It consists of the pixels that the shared edge comes near and no other edge
//! of either polygon does, and whose centre one polygon winds round an odd number of times and the other an
//! even number. Their depth key is the lesser of the two planes'. Pixels around a vertex stay uncovered.
//!
//! # Why it is sound
//! Coverage: an outline winds round a line as often as the line passes through faces from front to back, less
//! the passes from back to front ([`LevelOccluders`](visibility_occluders::LevelOccluders)). This number is
//! the same for all lines through a pixel that no edge meets. If it is odd, it is not 0: each of the lines
//! passes through a face, within the slab. The same holds for the sum of the numbers of two polygons. In a
//! pixel of a seam the shared edge is in the sum twice, and no other edge comes near, so the parity of the
//! sum is the same for all lines through the pixel. If it is odd, each line passes through a face of one of
//! the two polygons. Both polygons must agree on which centres have the shared edge to their left, even if a
//! centre is nearer to the edge than rounding. They agree because they take the same `f32` ends of the edge,
//! in the same order, and round the same column at a row to the same whole number. Each first limits that
//! column to its own columns, which changes nothing for pixels that both have.
//!
//! Polygons need not be flat: their outlines run through the vertices of the level, and the statements about
//! winding hold for all closed curves in space. Four points need care if a polygon is not flat:
//!
//! *Sides*: a polygon that occludes from its front alone must not count where a line passes through a face
//! from behind. No line does so if the eye is in front of all faces. That is certain if the eye's height
//! above the slab exceeds its distance from each point of the polygon times the sine of the greatest angle
//! between the normals of slab and faces. Otherwise the outline must be nearly flat. Projected onto the
//! plane, it winds round each point at least 0 times, since all faces are within a right angle of the plane's
//! front. Moving each vertex from the plane to its place moves the outline on the screen by no more than the
//! *bend*, which is part of the slack. So the same holds for the lines of a pixel, and an odd number means
//! that more faces are passed from the front. Two such polygons traverse a shared edge in opposite
//! directions, so it cancels in the sum of their numbers. The sum is the same for all lines through a pixel
//! of the seam, and at least 0 for lines farther from the edge than the bend. Polygons that occlude from both
//! sides may traverse it in either direction: parity suffices.
//!
//! *Depth*: the eye is outside the slab, so a ray passes the face before it reaches the far side of the slab.
//!
//! *Near plane*: a face inside an outline may be nearer than every point of the outline, but must be beyond
//! the near plane. This is certain in two cases. The polygon's slab is no thicker than the eye's distance
//! from it: a ray then crosses the slab between half the distance of the far side and that distance, and
//! outlines lie beyond twice the near distance of the eye. Or the eye's *window*, a rectangle across the
//! picture beyond that distance, is on the eye's side of the slab: a ray then passes the window before it
//! reaches the slab. Other polygons are not drawn.
//!
//! *Cuts*: outlines are cut at twice the near distance of the eye. The faces end there along an unknown curve
//! in the slab; a straight edge replaces the curve. If the window is on the eye's side of the slab, the part
//! of the slab at that distance is outside the picture. It is convex and contains both curve and edge, so
//! these wind alike round the lines through pixels. Otherwise all vertices of cut edges are moved into the
//! plane of the slab's far side, by no more than the bend; in that plane the curve is the straight edge.
//!
//! *Guard band*: edges above, below or to the right of the band have no pixel to their right and are left
//! out. An outline with edges to the right of the band counts as reaching the band's right side, since it may
//! cover all pixels up to there. An edge to the left of the band is replaced by an edge along the band's left
//! side, in the same rows.
//!
//! # The error bound
//! Rounding: let `u = 2^-24` and `L` be the greatest coordinate of the guard band. Vertices are off by up to
//! 1/64 pixel (`points` of `box_projection.rs`, or the bounds of `screen_projection.rs` for outlines that are
//! cut). The column of an edge at a row is a quotient, a product and a sum: `12u L`. Rounding of rows, and of
//! the sums that are rounded to whole columns, takes `4u L`. The slack is twice the error of vertices, plus
//! the greatest bend, plus `64u L`.
//!
//! All outlines that have a vertex, in whatever cluster, use the same `f32` numbers for it. Where an edge is
//! cut, both parts use the same point; a cut edge has no seam. So an outline crosses each row of centres an
//! even number of times, and away from its edges the number of edges to the left of a centre is that of the
//! exact outline.

mod bands;
mod clip;
mod draw;
mod drawn_objects;
mod edges;
mod fill;
mod frame;
mod open_tiles;
#[cfg(test)]
mod outline_rule;
mod prepared;
mod seams;
mod slab;
mod vertices;
mod window;

pub(crate) use bands::LevelRaster;
pub(crate) use draw::{Candidate, LevelScratch, begin_cluster, find_candidates};
pub(crate) use drawn_objects::DrawnObjects;
pub(crate) use edges::Edges;
pub(crate) use fill::{FillScratch, fill};
pub(crate) use frame::{LevelFrame, sides};
pub(crate) use open_tiles::{TileKeys, find_open_tiles};
pub(crate) use prepared::PreparedEdge;
pub use prepared::PreparedLevel;
pub(crate) use seams::Seams;
