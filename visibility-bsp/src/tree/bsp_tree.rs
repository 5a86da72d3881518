//! The tree as it is kept, and what can be asked of it at once.

use super::builder::Builder;
use super::node::{EMPTY, Node, is_leaf};
use super::store::Store;
use super::subtree::Subtree;
use alloc::vec::Vec;
use core::fmt;
use visibility_core::{Aabb, glam::DVec3};

/// What a convex region at the bottom of a tree is.
///
/// ```
/// use visibility_bsp::{BspTree, Leaf};
/// use visibility_core::glam::DVec3;
/// assert_eq!(BspTree::new().locate(DVec3::ZERO), Leaf::Empty);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum Leaf {
    /// Free space.
    Empty,
    /// The inside of a solid.
    Solid,
}

/// A binary space partition of convex polygons, each of which belongs to an owner: an object, or anything
/// with a number.
///
/// Built at once from many polygons ([`build`](Self::build)), it is later changed by owners that come and go
/// ([`insert`](Self::insert), [`remove`](Self::remove)) without being built anew.
///
/// # Robustness
/// Sides are told by [`SidePlane`](visibility_core::geometry::SidePlane): a polygon that reaches no
/// farther than
/// rounding to one side of a plane goes whole to the other, so cuts make no slivers out of rounding, and
/// polygons in one plane share a node. Cut points depend on nothing but the two ends of the edge and the
/// plane, so that two polygons that share an edge are cut in the same points, to the last bit.
///
/// # Cost
/// Building sorts: some microseconds a polygon; quadratic time for polygons that no plane parts without
/// cutting half of them, such as nested shells. Around 64 bytes a node, 36 a fragment and 24 a vertex.
///
/// ```
/// use visibility_bsp::{BspTree, Order};
/// use visibility_core::{glam::DVec3, view::Eye};
/// // Three squares across the x axis, owned by 10, 11 and 12.
/// let square = |x: f64| [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(y, z)| DVec3::new(x, y, z));
/// let squares = [square(5.0), square(1.0), square(3.0)];
/// let tree = BspTree::build((10..).zip(squares.iter().map(|s| &s[..])))?;
/// let (mut order, mut seen) = (Order::new(), Vec::new());
/// tree.front_to_back(Eye::Point(DVec3::new(2.0, 0.5, 0.5)), &mut order, |fragments| {
///     seen.extend(fragments.map(|fragment| fragment.owner()));
/// });
/// // From x = 2, the square at 1 hides neither of the others, and the one at 3 is before the one at 5.
/// assert_eq!(seen.len(), 3);
/// assert!(seen.iter().position(|&o| o == 12) < seen.iter().position(|&o| o == 10));
/// # Ok::<(), visibility_bsp::BspError>(())
/// ```
#[derive(Clone, Debug)]
pub struct BspTree {
    pub(super) root: u32,
    pub(super) nodes: Vec<Node>,
    /// By node: bounds and owner of everything in it and below.
    pub(super) subtrees: Vec<Subtree>,
    pub(super) free_nodes: Vec<u32>,
    pub(super) store: Store,
    /// Upper bound on the magnitude of coordinates, by axis; the margins of the planes hold up to it.
    pub(super) magnitude: DVec3,
    /// The leaf behind a polygon where nothing else is: `SOLID` in trees of solids, else `EMPTY`.
    pub(super) behind: u32,
    /// Upper bound on the depth of the tree: removing nodes does not lower it.
    pub(super) most_levels: u32,
    pub(super) builder: Builder,
}

/// Why a tree cannot be built.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum BspError {
    /// The polygons cut each other into so many parts that a tree of them is of no use.
    TooManyFragments {
        /// Number of polygons.
        polygons: usize,
        /// Maximum number of cuts for so many polygons.
        limit: usize,
    },
}

impl fmt::Display for BspError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooManyFragments { polygons, limit } => {
                write!(f, "{polygons} polygons cut each other into more than {limit} fragments")
            }
        }
    }
}

impl core::error::Error for BspError {}

impl Default for BspTree {
    fn default() -> Self {
        Self::new()
    }
}

impl BspTree {
    /// A tree without polygons: one empty leaf.
    pub fn new() -> Self {
        Self {
            root: EMPTY,
            nodes: Vec::new(),
            subtrees: Vec::new(),
            free_nodes: Vec::new(),
            store: Store::default(),
            magnitude: DVec3::ZERO,
            behind: EMPTY,
            most_levels: 0,
            builder: Builder::default(),
        }
    }

    /// Number of nodes, each of which has a plane.
    pub fn node_count(&self) -> usize {
        self.nodes.len() - self.free_nodes.len()
    }

    /// Number of fragments: that of the polygons if none was cut.
    pub fn fragment_count(&self) -> usize {
        self.store.len()
    }

    /// Whether there is no polygon in the tree.
    pub fn is_empty(&self) -> bool {
        self.fragment_count() == 0
    }

    /// Greatest number of planes between the root and a leaf. Visits every node.
    pub fn depth(&self) -> usize {
        let mut deepest = 0;
        let mut open = Vec::from([(self.root, 0)]);
        while let Some((child, depth)) = open.pop() {
            deepest = deepest.max(depth);
            if !is_leaf(child) {
                open.extend(self.nodes[child as usize].children.map(|child| (child, depth + 1)));
            }
        }
        deepest
    }

    /// A box around all fragments, rounded outwards; [`Aabb::EMPTY`] if there are none.
    pub fn bounds(&self) -> Aabb {
        if is_leaf(self.root) { Aabb::EMPTY } else { self.subtrees[self.root as usize].bounds }
    }

    /// Bytes of memory held.
    pub fn memory(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>()
            + self.subtrees.capacity() * size_of::<Subtree>()
            + self.store.memory()
            + self.builder.memory()
    }
}
