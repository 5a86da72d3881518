//! Scratch memory for growing chains of triangles.

use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// Bit of an edge's state: an odd number of the edge's triangles is in the chain (the surface that is being
/// grown), so the edge is on the chain's boundary.
pub(crate) const ODD: u8 = 1;
/// Bit of an edge's state: no segment of the node at work meets the edge. Valid if [`KNOWN`] is set.
pub(crate) const MISSED: u8 = 2;
/// Bit of an edge's state: the edge was tested against the segments, with the result in [`MISSED`].
pub(crate) const KNOWN: u8 = 4;

/// Ends, in scene coordinates, of an edge that kept a chain of triangles from becoming a surface that blocks
/// all segments. The segments are best divided near this edge.
pub(crate) type Obstacle = [DVec3; 2];

/// Scratch memory for growing one chain after the other. Each entry of `triangles` and `edges` holds the
/// epoch in which it was set. It is valid only if that equals `epoch`, which is increased to clear all
/// entries at once.
#[derive(Default)]
pub(crate) struct ChainScratch {
    /// Number of the present chain. 0 before the first chain.
    epoch: u32,
    /// For each triangle of the scene, the epoch in which it was last added to a chain.
    triangles: Vec<u32>,
    /// For each edge of the scene, the epoch in which its state was last set, and the state: the bits
    /// [`ODD`], [`MISSED`] and [`KNOWN`].
    edges: Vec<(u32, u8)>,
    /// Indices of the chain's triangles, in the order in which they were added.
    pub(crate) chain: Vec<u32>,
    /// Edges of the chain's boundary that segments may meet: the index of a triangle of the chain, and the
    /// number (0, 1 or 2) of the edge in it.
    pub(crate) open: Vec<(u32, usize)>,
    /// Vertices of the chain's boundary that were moved outwards: the index of a vertex, and its new position
    /// in scene coordinates.
    pub(crate) moved: Vec<(u32, DVec3)>,
}

impl ChainScratch {
    pub(crate) fn new(triangles: usize, edges: usize) -> Self {
        Self { triangles: alloc::vec![0; triangles], edges: alloc::vec![(0, 0); edges], ..Self::default() }
    }

    pub(crate) fn begin(&mut self) {
        self.epoch = self.epoch.wrapping_add(1);
        if self.epoch == 0 {
            self.triangles.fill(0);
            self.edges.fill((0, 0));
            self.epoch = 1;
        }
        self.chain.clear();
        self.open.clear();
        self.moved.clear();
    }

    pub(crate) fn state(&self, edge: u32) -> u8 {
        let (epoch, state) = self.edges[edge as usize];
        if epoch == self.epoch { state } else { 0 }
    }

    pub(crate) fn set_state(&mut self, edge: u32, state: u8) {
        self.edges[edge as usize] = (self.epoch, state);
    }

    pub(crate) fn holds(&self, triangle: u32) -> bool {
        self.triangles[triangle as usize] == self.epoch
    }

    pub(crate) fn push(&mut self, triangle: u32, edges: [u32; 3]) {
        self.triangles[triangle as usize] = self.epoch;
        self.chain.push(triangle);
        for edge in edges {
            self.set_state(edge, self.state(edge) ^ ODD);
        }
    }
}
