//! Virtual occluders on the plan: a few upright rectangles that stand for the occlusion of all houses around
//! a viewcell.
//!
//! This work is based on: Koltun, Chrysanthou and Cohen-Or, "Virtual Occluders: An Efficient Intermediate PVS
//! Representation", 2000. As in that paper, virtual occluders grow from seeds, the solids that look largest
//! from the viewcell. Lines are laid behind each seed, at growing distances. On each line, a segment that no
//! line of sight reaches grows from its middle to both sides. Where the solids that hide it only just meet
//! (the paper's active supporting and separating lines), another solid has to close the gap, or the segment
//! ends. Separate segments are grown for a few slices of height, each with solids that are high enough. A
//! greedy choice keeps the virtual occluders that hide the most objects.
//!
//! # Why nothing visible is hidden
//! - A *slice* is a slope: how much lines of sight may rise per metre on the plan. A post is high enough if
//!   it is met by a line that rises with this slope from the highest viewpoint at the farthest corner of the
//!   viewcell. Between two posts, the height of their hull is linear and the distance from a viewpoint is
//!   convex, so if both posts are high enough, so is the hull between them.
//! - A line of sight to a box within the slope passes the solids below their tops, and above their lower ends
//!   if it stays above the greatest of these.
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

/// Upright rectangle that no line of sight from its viewcell reaches, because solids block all of them. It
/// hides no more from the viewcell than the solids do, so other methods may use it as an occluder for this
/// viewcell. Coordinates are rounded to the nearest `f64`.
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
    /// end as seen from the viewcell.
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
