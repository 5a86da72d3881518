//! The memory of sorting polygons into a tree.

use alloc::vec::Vec;
use visibility_core::{
    Aabb,
    geometry::{Plane, PolygonSide},
    glam::DVec3,
};

/// A polygon that is being sorted in.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub(super) owner: u32,
    /// Its number among those given together.
    pub(super) number: u32,
    pub(super) plane: Plane,
}

/// A part of a polygon on its way down the tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) source: u32,
    pub(super) start: u32,
    pub(super) len: u32,
    pub(super) bounds: Aabb,
}

/// Pieces to be sorted into what is on one side of a node (or, for `NONE`, into the whole tree): those from
/// `begin` to the end of the stack.
#[derive(Clone, Copy, Debug)]
pub(super) struct Task {
    pub(super) begin: usize,
    pub(super) parent: u32,
    pub(super) side: u8,
    /// Number of nodes above.
    pub(super) level: u32,
}

/// The memory of the sorting, kept by the tree so that an object that moves every frame allocates nothing.
#[derive(Clone, Debug, Default)]
pub(super) struct Builder {
    pub(super) sources: Vec<Source>,
    /// All pieces under way: a stack whose top belongs to the topmost task.
    pub(super) pieces: Vec<Piece>,
    pub(super) tasks: Vec<Task>,
    pub(super) sides: Vec<PolygonSide>,
    pub(super) front: Vec<Piece>,
    pub(super) back: Vec<Piece>,
    pub(super) cut: [Vec<DVec3>; 3],
}

impl Builder {
    pub(super) fn memory(&self) -> usize {
        self.sources.capacity() * size_of::<Source>()
            + (self.pieces.capacity() + self.front.capacity() + self.back.capacity()) * size_of::<Piece>()
    }
}
