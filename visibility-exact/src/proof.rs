//! Proofs that a target cannot be seen from a viewcell, as data.

use crate::sight::{CellBox, Target};
use alloc::{boxed::Box, vec::Vec};
use visibility_core::glam::DVec3;

/// A proof that no segment from a viewcell to a target is unblocked or, if made with a clearance, that none
/// stays as far from all occluders as [`Effort::Exact`](crate::Effort::Exact) says. Made by
/// [`ExactCuller`](crate::ExactCuller). Checked by [`check`](Self::check) with code and arithmetic that the
/// search does not use.
///
/// The segments from P, a face of the viewcell, to Q, a face of the target, are divided into nodes: P or Q is
/// halved, P is cut by the plane of a one-sided occluder, or the node is divided by the sides on which lines
/// pass the edges of an occluder. Each node without further division has one of four reasons:
/// - A surface of occluding triangles whose boundary no segment of the node meets, and which one of the
///   segments crosses an odd number of times: all segments cross it.
/// - A closed loop on an occluder that all segments of the node have on one side: it winds around them.
/// - Weights of the node's dividing edges for which the weighted sum of sides is negative at all pairs of
///   corners: no segment is in the node (the lemma of Farkas).
/// - Three dividing edges around a corner, of which a certain weighted sum of sides is negative for all
///   directions: no segment is in the node.
#[derive(Clone, PartialEq, Debug)]
pub struct Proof {
    pub(crate) cell: CellBox,
    pub(crate) target: Target,
    pub(crate) clearance: f64,
    /// The nodes of all pairs of polygons, pair after pair. A pair is a face of the viewcell (P) and a face
    /// of the target (Q) that face each other. The nodes of a pair are in depth-first order: each node comes
    /// before its parts.
    pub(crate) steps: Vec<Step>,
}

impl Proof {
    /// Returns the number of nodes, a measure of how hard the proof was.
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Returns whether there are no nodes: the target has no area that faces the viewcell.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }
}

/// A node of a proof.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum Step {
    /// A polygon is halved. The nodes of the two halves follow. `of_p`: true if P is halved, false if Q is.
    /// `across`: of a quadrilateral, true if its shorter pair of opposite sides is halved, false if its
    /// longer pair is. Other polygons have one halving only.
    Halves { of_p: bool, across: bool },
    /// P is cut by the plane of a one-sided triangle. Two nodes follow: first that of the part of P in front
    /// of the triangle, then that of the other part.
    Split { triangle: u32 },
    /// All segments cross a surface.
    Surface {
        triangles: Box<[u32]>,
        /// Vertices of the surface's boundary that were moved outwards, by ascending vertex index, with their
        /// new positions in scene coordinates.
        moved: Box<[(u32, DVec3)]>,
        /// Ends, on P and on Q, of a segment of the node that crosses the surface an odd number of times.
        line: [DVec3; 2],
    },
    /// No segment is in the node: with these weights of its dividing edges, the weighted sum of sides is
    /// negative.
    Empty { weights: Box<[f64]> },
    /// No segment is in the node: these three of its dividing edges, around a corner, exclude all lines.
    Corner { edges: [u32; 3] },
    /// The node is divided by the edges of a loop. For each [`LoopEdge::Divides`] the node of the segments
    /// that pass outside of the edge, and inside of all dividing edges before it, follows. The rest is
    /// blocked.
    Loop {
        /// Index of the occluder: a convex polygon of triangles.
        piece: u32,
        /// Corners of the loop: position in scene coordinates, and which corner of the target triangle it is
        /// (0, 1 or 2), or 3 for none.
        ring: Box<[(DVec3, u8)]>,
        /// Sign (1 or -1) of the side on which blocked segments pass all edges.
        side: f64,
        /// Outcome of each edge of the ring, from each corner to the next.
        edges: Box<[LoopEdge]>,
    },
}

/// Outcome of the segments that pass outside an edge of a loop.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum LoopEdge {
    /// All segments between the polygons pass inside.
    Inside,
    /// No segment of the node passes outside, by weights of its dividing edges and, last, of this edge.
    Never { weights: Box<[f64]> },
    /// The segments outside are a node of their own.
    Divides,
}
