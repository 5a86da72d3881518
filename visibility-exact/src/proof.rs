//! Proofs, as data, that a target cannot be seen from a viewcell.

use crate::sight::{CellBox, Target};
use crate::triangles::SceneTriangles;
use alloc::{boxed::Box, vec::Vec};
use visibility_core::glam::DVec3;

/// A proof that every segment from a viewcell to a target is blocked or, if made with a clearance, comes
/// closer to an occluder than the distance that [`Effort::Exact`](crate::Effort::Exact) defines. Made by
/// [`ExactCuller`](crate::ExactCuller). [`check`](Self::check) verifies it with code and arithmetic that the
/// search does not use.
///
/// The segments from P, a face of the viewcell, to Q, a face of the target, are divided into nodes: P or Q is
/// halved, P is cut by the plane of a one-sided occluder, or the segments are divided by the sides on which
/// they pass the edges of an occluder. Each undivided node has one of four reasons:
/// - A surface of occluding triangles. No segment of the node meets the surface's boundary, and one of them
///   crosses the surface an odd number of times: so all of them cross it.
/// - A closed loop on an occluder whose edges all segments of the node pass on one side: the loop winds
///   around them.
/// - Weights of the node's dividing edges that make the weighted sum of sides negative at all pairs of
///   corners: no segment is in the node (the lemma of Farkas).
/// - Three dividing edges around a corner, with a weighted sum of sides that is negative for all directions:
///   no segment is in the node.
#[derive(Clone, PartialEq, Debug)]
pub struct Proof {
    pub(crate) cell: CellBox,
    pub(crate) target: Target,
    pub(crate) clearance: f64,
    /// The nodes of all pairs of polygons, pair after pair. A pair is a face of the viewcell (P) and a face
    /// of the target (Q) that face each other. The nodes of a pair are in depth-first order: each node
    /// precedes its parts.
    pub(crate) steps: Vec<Step>,
}

impl Proof {
    /// Returns the number of nodes (sets of segments) of the proof, a measure of how hard it was to find.
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Returns the size of the proof in bytes.
    pub(crate) fn memory(&self) -> usize {
        size_of::<Self>() + self.steps.iter().map(Step::memory).sum::<usize>()
    }

    /// Calls `visit` with the position of each object whose triangles the proof rests on, in the list of
    /// objects of the [`SceneTriangles`]. An object may be visited several times.
    pub(crate) fn occluders(&self, triangles: &SceneTriangles, mut visit: impl FnMut(u32)) {
        for step in &self.steps {
            step.triangles(triangles).iter().for_each(|&t| visit(triangles.object_of(t) as u32));
        }
    }

    /// Returns whether the proof has no nodes: the target has no area that faces the viewcell.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }
}

impl Step {
    /// Returns the indices of the triangles that the step names, not counting the steps that follow it. Those
    /// of a loop are all triangles of its convex polygon.
    pub(crate) fn triangles<'a>(&'a self, all: &'a SceneTriangles) -> &'a [u32] {
        match self {
            Self::Split { triangle } => core::slice::from_ref(triangle),
            Self::Surface { triangles, .. } => triangles,
            Self::Loop { piece, .. } => all.piece_triangles(*piece).unwrap_or_default(),
            Self::Halves { .. } | Self::Empty { .. } | Self::Corner { .. } => &[],
        }
    }

    /// Returns the size of the step in bytes.
    fn memory(&self) -> usize {
        let weights = |edge: &LoopEdge| match edge {
            LoopEdge::Never { weights } => size_of_val(&weights[..]),
            LoopEdge::Inside | LoopEdge::Divides => 0,
        };
        let parts = match self {
            Self::Surface { triangles, moved, .. } => size_of_val(&triangles[..]) + size_of_val(&moved[..]),
            Self::Empty { weights } => size_of_val(&weights[..]),
            Self::Loop { ring, edges, .. } => {
                size_of_val(&ring[..]) + size_of_val(&edges[..]) + edges.iter().map(weights).sum::<usize>()
            }
            Self::Halves { .. } | Self::Split { .. } | Self::Corner { .. } => 0,
        };
        size_of::<Self>() + parts
    }

    /// Returns the number of parts of the node, whose steps follow.
    pub(crate) fn parts(&self) -> usize {
        match self {
            Self::Halves { .. } | Self::Split { .. } => 2,
            Self::Loop { edges, .. } => edges.iter().filter(|&edge| *edge == LoopEdge::Divides).count(),
            Self::Surface { .. } | Self::Empty { .. } | Self::Corner { .. } => 0,
        }
    }
}

/// A node of a proof: a set of segments, and why all of them are blocked.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum Step {
    /// A polygon is halved, and the nodes of its two halves follow. `of_p`: true if the viewcell polygon is
    /// halved, false if the target polygon is. `across`: true if the shorter pair of opposite sides of a
    /// quadrilateral is halved, false if the longer pair is. Other polygons are halved in one way only.
    Halves { of_p: bool, across: bool },
    /// The viewcell polygon is cut by the plane of a one-sided triangle, given by its index in
    /// [`SceneTriangles`](crate::SceneTriangles). Two nodes follow: that of the part in front of the
    /// triangle, then that of the other part.
    Split { triangle: u32 },
    /// All segments cross this surface, given by the indices of its triangles in
    /// [`SceneTriangles`](crate::SceneTriangles).
    Surface {
        triangles: Box<[u32]>,
        /// Vertices of the surface's boundary that were moved outwards, by ascending vertex index, with their
        /// new positions in scene coordinates.
        moved: Box<[(u32, DVec3)]>,
        /// Ends, on the viewcell and target polygons, of a segment of the node that crosses the surface an
        /// odd number of times.
        line: [DVec3; 2],
    },
    /// The node has no segment. `weights` has one weight for each of its dividing edges, in the order in
    /// which they were added: for all lines between the two polygons, the weighted sum of the sides on which
    /// the line passes these edges is negative.
    Empty { weights: Box<[f64]> },
    /// The node has no segment: three of its dividing edges, around a corner, exclude all lines. `edges` are
    /// their indices among the node's dividing edges, in the order in which these were added.
    Corner { edges: [u32; 3] },
    /// The edges of a loop on an occluder divide the node. For each [`LoopEdge::Divides`] a node follows,
    /// with the segments that pass outside of this edge and inside of all dividing edges before it. The
    /// remaining segments are blocked.
    Loop {
        /// Index of the occluder in `SceneTriangles::pieces`: a convex polygon of coplanar triangles.
        piece: u32,
        /// Corners of the loop: the position in scene coordinates, and the number of the target triangle's
        /// corner that it is (0, 1 or 2), or 3 for none.
        ring: Box<[(DVec3, u8)]>,
        /// Sign (1 or -1) of the side on which blocked segments pass all edges.
        side: f64,
        /// For each edge of the ring, from each corner to the next, why no segment that passes outside it is
        /// left unblocked.
        edges: Box<[LoopEdge]>,
    },
}

/// Reason why no segment that passes outside an edge of a loop is left unblocked. Outside is the side
/// opposite to `side` of [`Step::Loop`].
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum LoopEdge {
    /// No segment between the viewcell and target polygons passes outside the edge: on the side opposite to
    /// `side` of the loop. The sides on which the lines between the polygons' corners pass the edge show
    /// this.
    Inside,
    /// No segment of the node passes outside the edge: on the side opposite to `side` of the loop. `weights`
    /// prove this as in [`Step::Empty`]: one for each dividing edge of the node, then one for this edge. For
    /// all lines between the two polygons, the weighted sum of the sides on which a line passes these edges
    /// is negative.
    Never { weights: Box<[f64]> },
    /// The segments of the node that pass outside the edge, and inside all dividing edges of the loop before
    /// it, are a node of their own, which follows in the proof.
    Divides,
}
