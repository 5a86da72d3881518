//! Large occluders, used singly and in pairs, with temporal coherence (Coorg and Teller, "Temporally Coherent
//! Conservative Visibility", 1996, and "Real-Time Occlusion Culling for Models with Large Occluders", 1997).
//!
//! # When a polygon hides a box
//! A polygon hides a box if the box is behind the polygon's plane, the eye is in front of that plane, and the
//! box is on the inner side of each plane through the eye and an edge. Equivalently, the eye must be on the
//! inner side of each *supporting plane*. A supporting plane passes through an edge and the first corner of
//! the box that a plane turned about the edge touches. Supporting planes depend on the edge and the box, not
//! on the eye.
//!
//! # Joined occluders
//! Two polygons that share an edge together hide everything that is behind both and inside all their other
//! edges. A view ray on one side of the shared edge is inside all edges of one polygon; a ray on the other
//! side is inside all edges of the other polygon.
//!
//! # Coherence
//! The answer for a box holds until the eye crosses one of the supporting planes that certify it. For a
//! hidden box these are the planes of the occluder that hides it. For a box that is not hidden, it is one
//! plane per occluder that the eye is outside of. The cache keeps, for each box, a ball around the eye that
//! crosses none of these planes. While the eye is inside the ball, the box costs one comparison. In each
//! frame the map determines which side of each occluder the eye is on, and clears the cache if any side has
//! changed. The choice of occluders depends on the eye rounded to a coarse grid, so it seldom changes.

mod cached_occlusion_map;
mod culler;
mod group;

pub use culler::LargeOccludersCuller;
