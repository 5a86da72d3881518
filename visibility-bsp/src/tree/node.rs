//! The nodes of a tree.

use visibility_core::{Aabb, geometry::SidePlane, glam::DVec3};

/// No node, no fragment.
pub(super) const NONE: u32 = u32::MAX;
/// In place of a child: a leaf outside all solids.
pub(super) const EMPTY: u32 = u32::MAX;
/// In place of a child: a leaf inside a solid.
pub(super) const SOLID: u32 = u32::MAX - 1;

/// Whether a child is a leaf.
pub(super) const fn is_leaf(child: u32) -> bool {
    child >= SOLID
}

/// A plane, what lies in it, and what is on either side of it. One cache line.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Node {
    pub(super) plane: SidePlane,
    /// Behind the plane, and in front of it.
    pub(super) children: [u32; 2],
    /// The first fragment in the plane; `NONE` for a plane that only divides.
    pub(super) first: u32,
    pub(super) parent: u32,
}

/// The smallest box in `f32` around points in `f64`.
pub(super) fn bounds_of(points: &[DVec3]) -> Aabb {
    let mut bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    for &p in points {
        bounds = [bounds[0].min(p), bounds[1].max(p)];
    }
    Aabb::from_world(bounds[0], bounds[1], DVec3::ZERO)
}
