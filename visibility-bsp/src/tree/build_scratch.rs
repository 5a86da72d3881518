//! Scratch memory for sorting polygons into a tree.

use alloc::vec::Vec;
use visibility_core::{
    Aabb,
    geometry::{Plane, PolygonSide},
    glam::DVec3,
};

/// A polygon that is being inserted into the tree, in the tree's coordinates.
#[derive(Clone, Debug)]
pub(super) struct Source {
    /// Number of the owner that the polygon belongs to.
    pub(super) owner: u32,
    /// Index of the polygon among those of the same `build` or `insert` call.
    pub(super) number: u32,
    /// Plane of the polygon, its unit normal to the polygon's front.
    pub(super) plane: Plane,
}

/// A part of a polygon on its way down the tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// Index in `Builder::sources` of the polygon that the piece is a part of.
    pub(super) source: u32,
    /// Index in the store's vertices of the piece's first vertex.
    pub(super) start: u32,
    /// Number of the piece's vertices.
    pub(super) len: u32,
    /// Box around the piece's vertices, in the tree's coordinates, rounded outwards to `f32`.
    pub(super) bounds: Aabb,
}

/// A set of pieces that is to be sorted into one child of a node, or into the root.
#[derive(Clone, Copy, Debug)]
pub(super) struct Task {
    /// Index in `Builder::pieces` of the set's first piece; the set extends to the end of that stack.
    pub(super) begin: usize,
    /// Index of the node whose child receives the pieces, `NONE` for the root of the tree.
    pub(super) parent: u32,
    /// Child of `parent`: 0 behind the plane, 1 in front.
    pub(super) side: u8,
    /// Depth of the child: number of nodes above it.
    pub(super) level: u32,
}

/// Scratch memory for sorting polygons in. The tree keeps it, so that an object that moves every frame
/// allocates nothing.
#[derive(Clone, Debug, Default)]
pub(super) struct Builder {
    /// Polygons of the present `build` or `insert` call.
    pub(super) sources: Vec<Source>,
    /// Pieces of all tasks that are not finished: a stack whose top belongs to the topmost task.
    pub(super) pieces: Vec<Piece>,
    /// Stack of tasks that are not finished.
    pub(super) tasks: Vec<Task>,
    /// By piece of the present task: the side of the node's plane on which the piece lies.
    pub(super) sides: Vec<PolygonSide>,
    /// Scratch: pieces of the present task in front of the node's plane.
    pub(super) front: Vec<Piece>,
    /// Scratch: pieces of the present task behind the node's plane.
    pub(super) back: Vec<Piece>,
    /// Scratch for cutting a polygon: the vertices of the whole, of the front part and of the back part, in
    /// the tree's coordinates.
    pub(super) cut: [Vec<DVec3>; 3],
}
