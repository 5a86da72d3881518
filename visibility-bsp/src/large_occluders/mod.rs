//! Large occluders, one by one and in pairs, with temporal coherence (Coorg and Teller, "Temporally Coherent
//! Conservative Visibility", 1996, and "Real-Time Occlusion Culling for Models with Large Occluders", 1997).
//!
//! # When a polygon hides a box
//! If the box is behind the polygon's plane, the eye before it, and the box on the inner side of each plane
//! through the eye and an edge. Turned round: if the eye is on the inner side of each *supporting plane*,
//! through an edge and that corner of the box which the plane, turned about the edge, touches first. These
//! planes depend on the edge and the box, and not on the eye.
//!
//! # Joined occluders
//! Two polygons that share an edge hide together what is behind both and inside all their other edges: a line
//! of sight to the one side of the shared edge is inside all edges of the one polygon, to the other side of
//! the other's.
//!
//! # Coherence
//! An answer for a box holds until the eye crosses one of the supporting planes that certify it: those of the
//! occluder that hides it, or, for each occluder that does not, one that the eye is beyond. What is kept for
//! a box is a ball about the eye that crosses none of them; while the eye is in the ball, one comparison is
//! all that the box costs. Which side of each occluder the eye is before is looked at each frame, and all is
//! forgotten when that changes. Which occluders are used depends on where the eye is to a coarse grid only,
//! so that it seldom changes.

mod culler;
mod group;
mod group_map;

pub use culler::LargeOccludersCuller;
