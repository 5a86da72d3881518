//! State of a proof's check: the scene, the proof's remaining steps and the bounds on errors of positions.

use crate::proof::Step;
use crate::triangles::SceneTriangles;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// Position of a point, and the number (0, 1 or 2) of the target triangle's corner that it is equal to, if
/// any.
pub(super) type Corner = (DVec3, Option<usize>);

/// An edge, and the sign (1 or -1) of the side on which lines are required to pass it.
pub(super) type Divider = ([Corner; 2], f64);

/// A proof while it is checked. The *node at work*, a set of segments, is the one being checked.
pub(super) struct Check<'a> {
    pub(super) triangles: &'a SceneTriangles,
    pub(super) clearance: f64,
    /// Bound on the error of each coordinate of a position, in metres.
    pub(super) delta: f64,
    /// Indices of the three vertices of the target triangle in proofs without clearance. Empty otherwise.
    pub(super) target_vertices: Vec<u32>,
    /// Nodes of the proof, in depth-first order, that are not checked yet.
    pub(super) steps: core::slice::Iter<'a, Step>,
    /// Number of cuts by planes of one-sided triangles that made the viewcell polygon of the node at work.
    pub(super) splits: u32,
}

impl Check<'_> {
    /// Returns which corner of the target triangle (0, 1 or 2) the vertex with index `vertex` is. `None` for
    /// all other vertices, and in proofs with clearance.
    pub(super) fn tag(&self, vertex: u32) -> Option<usize> {
        self.target_vertices.iter().position(|&v| v == vertex)
    }
}
