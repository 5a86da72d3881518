//! Virtual occluders on the plan: a few upright rectangles that stand for all that houses hide from a
//! viewcell.
//!
//! This work is based on: Koltun, Chrysanthou and Cohen-Or, "Virtual Occluders: An Efficient Intermediate PVS
//! Representation", 2000. As in that paper, virtual occluders grow from seeds, the solids that look largest
//! from the viewcell. A line is laid behind a seed, and others farther away. Along each line the segment that
//! no line of sight reaches grows from its middle to both sides: where the solids that hide it only just meet
//! (the paper's active supporting and separating lines), a further solid has to close the gap, or the segment
//! ends. A few slices of height are grown apart, each by solids that are high enough, and a greedy choice
//! keeps the virtual occluders that hide the most objects.
//!
//! # Why nothing visible is hidden
//! - A *slice* is a slope: how much lines of sight may rise per metre on the plan. A post of a solid is high
//!   enough if a line that rises from the highest viewpoint, at the farthest corner of the viewcell, meets
//!   it. The height of the hull of two posts is linear between them, the distance from a viewpoint is convex,
//!   so what holds for both posts holds between them.
//! - A line of sight to a box within the slope, which is the least over the viewcell, meets the solids on the
//!   plan below their tops, and above their lower ends if it stays above the greatest of these.
//! - Whether solids hide a point of the plan from the viewcell is decided by the side of lines that points
//!   certainly are on (`lines.rs`, `chain.rs`). No line of sight passes between two solids that share a
//!   corner, or one of which has a corner in the other, if their meshes place them exactly.

mod cell_solids;
mod chain;
mod choose;
mod culler;
mod grow;
mod lines;
mod solids;
#[cfg(test)]
mod tests;
mod umbra;

pub use culler::VirtualOccluderCuller;

use crate::horizon::UpAxis;
use umbra::Umbra;
use visibility_core::glam::DVec3;

/// An upright rectangle that no line of sight from its viewcell reaches: solids are in the way of all of
/// them. A plain value, which hides no more from the viewcell than the solids do: other methods may take the
/// rectangle as an occluder of that viewcell. Coordinates are rounded to the nearest `f64`.
///
/// ```
/// use visibility_2d::{horizon::UpAxis, virtual_occluders::VirtualOccluder};
/// let ends = [[-4.0, 20.0], [6.0, 20.0]];
/// let occluder = VirtualOccluder { up: UpAxis::Z, ends, bottom: 0.0, top: 9.0 };
/// assert_eq!(occluder.corners()[2].to_array(), [6.0, 20.0, 9.0]);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct VirtualOccluder {
    /// Axis of the scene that points up.
    pub up: UpAxis,
    /// Ends on the plan in world space, in metres: the two coordinates of [`UpAxis`]. The first is the left
    /// one, seen from the viewcell.
    pub ends: [[f64; 2]; 2],
    /// Height of the lower side in metres in world space.
    pub bottom: f64,
    /// Height of the upper side in metres in world space.
    pub top: f64,
}

impl VirtualOccluder {
    fn new(umbra: &Umbra, origin: DVec3, up: UpAxis) -> Self {
        let ((ends, bottom, top), [ox, oy, height]) = (umbra.rectangle(), up.split(origin));
        Self { up, ends: ends.map(|[x, y]| [x + ox, y + oy]), bottom: bottom + height, top: top + height }
    }

    /// Returns the corners in world space, in metres, in order around the rectangle.
    pub fn corners(&self) -> [DVec3; 4] {
        let [[ax, ay], [bx, by]] = self.ends;
        let at = |x: f64, y: f64, height: f64| self.up.join([x, y, height]);
        [at(ax, ay, self.bottom), at(bx, by, self.bottom), at(bx, by, self.top), at(ax, ay, self.top)]
    }
}
