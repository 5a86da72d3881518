//! Occluders of a level, drawn at the beginning of a frame: nearest clusters first, each polygon by its
//! outline, at one plane of depth.
//!
//! # The rule
//! A polygon covers the pixels whose centre has an odd number of the outline's edges to the left, and that no
//! edge comes near: within the *slack* of the closed pixel. Its depth key is that of the plane at the side of
//! the polygon's slab that is away from the eye. Pixels along an edge that two polygons share would stay
//! bare: the edge's *seam* (`seams.rs`). It is covered by the two together once both are drawn. Covered are
//! pixels that the shared edge comes near and no other edge of either polygon does, and whose centre one of
//! them winds round an odd number of times and the other an even number. Their key is the lesser of the two
//! planes'. Pixels around a vertex stay bare.
//!
//! # Why it is sound
//! An outline winds round a line as often as the line goes through faces from front to back, less the times
//! from back to front ([`LevelOccluders`](visibility_occluders::LevelOccluders)). It does so for all lines
//! through a pixel that no edge meets alike, and if the number is odd it is not 0: each of the lines goes
//! through a face, within the slab. The same holds for two polygons together, whose numbers are added. In a
//! pixel of a seam the shared edge is in the sum twice, and no other edge comes near: the parity of the sum
//! is the same for all lines through the pixel. If it is odd, each of them goes through a face of one or the
//! other. Both polygons must agree on which centres have the shared edge to their left, also where a centre
//! is nearer to it than rounding. They do: they take the same `f32` for its ends, in the same order, and
//! round the same column at a row to the same whole number. Each limits it to its own columns first, which
//! changes nothing for pixels that both have.
//!
//! Polygons need not be flat: their outlines run through the vertices of the level, and all that is said of
//! windings holds for closed curves in space. What is not flat matters in four places.
//!
//! *Sides*: a polygon that hides from its front alone must not count where a line goes through a face from
//! the back. There is no such line if the eye is in front of all its faces. The eye is if its height above
//! the slab is more than its distance from each point of the polygon times the sine of the greatest angle
//! between the normals of slab and faces. Else the outline must be nearly flat. On the plane it winds round a
//! point at least 0 times, since all faces are turned to the front by less than a right angle. Moving each
//! vertex from the plane to its place moves the outline on the screen by no more than the *bend*, which is
//! part of the slack, so the same holds for the lines of a pixel: an odd number means that more faces are
//! gone through from the front. Two such polygons run through an edge that they share in opposite directions,
//! so that it is gone from the sum of their numbers. The sum is the same for all lines through a pixel of the
//! seam, and at least 0 for those that are farther from the edge than the bend. Polygons that hide from both
//! sides may run through it either way: their parity is enough.
//!
//! *Depth*: the eye is outside the slab, and a ray reaches the far side of the slab after the face.
//!
//! *Near plane*: a face inside an outline may be nearer than all of the outline. It is beyond the near plane
//! if the polygon's slab is no thicker than the eye's distance from it: a ray crosses the slab between half
//! the distance of the far side and that distance, and outlines lie beyond twice the near distance of the
//! eye. It is so too if the eye's *window*, a rectangle across the picture beyond that distance, is on the
//! eye's side of the slab: a ray is past the window when it comes to the slab. Other polygons are not drawn.
//!
//! *Cuts*: outlines are cut at twice the near distance of the eye. The faces end there along a curve in the
//! slab that is not known. A straight edge takes its place. If the window is on the eye's side of the slab,
//! the part of the slab at that distance, which is convex and holds both curve and edge, is beside the
//! picture, so that they wind round the lines of its pixels alike. Else all vertices of edges that are cut
//! are moved into the plane of the far side of the slab, by no more than the bend: there the curve is that
//! edge.
//!
//! *Guard band*: what is above, below or to the right of it has no pixel to the right, so that these edges
//! are left out. An outline with edges at the right counts as reaching as far as the guard band, since it may
//! cover all pixels up to there. What is to its left becomes an edge along its side, in the same rows.
//!
//! # The error bound
//! With `u = 2^-24` and `L` the greatest coordinate of the guard band: vertices are off by up to 1/64 pixel
//! (`points` of `box_projection.rs`, or the bounds of `screen_projection.rs` for outlines that are cut). The
//! column of an edge at a row is a quotient, a product and a sum: `12u L`; rounding rows, and the sums that
//! are rounded to whole columns, takes `4u L`. The slack is twice the first, the greatest bend, and `64u L`.
//!
//! Both ends of an edge are the same `f32` in all outlines that have the vertex, of whatever cluster, and
//! where it is cut, in both parts; an edge that is cut has no seam. So an outline crosses each row of centres
//! an even number of times, and away from its edges the number to the left of a centre is that of the exact
//! outline.

mod bands;
mod clip;
mod draw;
mod edges;
mod fill;
mod frame;
mod open_tiles;
mod prepared;
mod seams;
mod vertices;
mod window;

pub(crate) use bands::LevelRaster;
pub(crate) use draw::{Candidate, LevelScratch, begin_cluster, find_candidates};
pub(crate) use edges::Edges;
pub(crate) use fill::{FillScratch, fill};
pub(crate) use frame::{LevelFrame, sides};
pub(crate) use open_tiles::{TileKeys, find_open_tiles};
pub(crate) use prepared::PreparedEdge;
pub use prepared::PreparedLevel;
pub(crate) use seams::Seams;
