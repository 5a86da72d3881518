//! The BSP tree's data structure and its simple queries.

use super::build_scratch::Builder;
use super::node::{EMPTY, Node, is_leaf};
use super::store::Store;
use super::subtree::Subtree;
use alloc::vec::Vec;
use core::fmt;
use visibility_core::{Aabb, glam::DVec3};

/// A binary space partition of convex polygons in `f64` coordinates. Each polygon belongs to an owner,
/// identified by a number, such as an object's index.
///
/// [`build`](Self::build) makes a tree of many polygons at once. [`insert`](Self::insert) and
/// [`remove`](Self::remove) change the polygons of single owners without a rebuild.
///
/// # Robustness
/// Sides are decided with the margin of [`SidePlane`](visibility_core::geometry::SidePlane). A polygon is cut
/// by a plane only if it extends beyond the margin on both sides of the plane. So rounding makes no slivers,
/// and polygons in one plane share a node. A cut point depends only on the plane and the two ends of the cut
/// edge, so two polygons that share an edge are cut in bit-identical points.
///
/// The margin is up to 2e-14 of the greatest coordinate that the tree has held since it was built or empty,
/// times two if that came by `insert`. Polygons nearer to each other than that may come in the wrong order,
/// and share a plane. Removing a polygon that is far from all others does not lessen the margin: build the
/// tree anew, as [`SceneTree`](crate::SceneTree) does.
///
/// # Cost
/// Building takes some microseconds per polygon. The time is quadratic for polygons that no plane separates
/// without cutting half of them, such as nested shells. Memory is about 64 bytes per node, 36 per fragment
/// and 24 per vertex.
///
/// ```
/// use visibility_bsp::{BspTree, TraversalStack};
/// use visibility_core::{glam::DVec3, view::Eye};
/// // Three squares across the x axis, owned by 10, 11 and 12.
/// let square = |x: f64| [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(y, z)| DVec3::new(x, y, z));
/// let squares = [square(5.0), square(1.0), square(3.0)];
/// let tree = BspTree::build((10..).zip(squares.iter().map(|s| &s[..])))?;
/// let (mut stack, mut seen) = (TraversalStack::new(), Vec::new());
/// tree.front_to_back(Eye::Point(DVec3::new(2.0, 0.5, 0.5)), &mut stack, |fragments| {
///     seen.extend(fragments.map(|fragment| fragment.owner()));
/// });
/// // From x = 2, the square at 1 hides neither of the others, and the one at 3 is before the one at 5.
/// assert_eq!(seen.len(), 3);
/// assert!(seen.iter().position(|&o| o == 12) < seen.iter().position(|&o| o == 10));
/// # Ok::<(), visibility_bsp::BspError>(())
/// ```
#[derive(Clone, Debug)]
pub struct BspTree {
    /// Root of the tree: a node index, or [`EMPTY`].
    pub(super) root: u32,
    /// Inner nodes by index, unused ones included.
    pub(super) nodes: Vec<Node>,
    /// By node index: bounds and common owner of all fragments in the node and below it.
    pub(super) subtrees: Vec<Subtree>,
    /// Indices in `nodes` of unused nodes.
    /// Nodes that are not in use: each is its own parent.
    pub(super) free_nodes: Vec<u32>,
    /// Scratch of [`remove`](Self::remove): the nodes of the polygons that are removed.
    pub(super) touched: Vec<u32>,
    /// Fragments of all polygons, with their vertices.
    pub(super) store: Store,
    /// Upper bound on the absolute value of coordinates, by axis. The margins of all planes are valid up to
    /// it.
    pub(super) magnitude: DVec3,
    /// Upper bound on the number of levels; it does not shrink when nodes are removed.
    pub(super) most_levels: u32,
    /// Scratch memory for inserting polygons.
    pub(super) builder: Builder,
}

/// Reason why a tree cannot be built, or polygons not be inserted.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum BspError {
    /// The polygons were cut more often than the limit, so that a tree of them would be too large.
    TooManyFragments {
        /// Number of accepted polygons in the failed `build` or `insert` call.
        polygons: usize,
        /// Maximum number of cuts for that number of polygons: 4,096, and 256 for each.
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
    /// Creates a tree without polygons: a single empty leaf.
    pub fn new() -> Self {
        Self {
            root: EMPTY,
            nodes: Vec::new(),
            subtrees: Vec::new(),
            free_nodes: Vec::new(),
            touched: Vec::new(),
            store: Store::default(),
            magnitude: DVec3::ZERO,
            most_levels: 0,
            builder: Builder::default(),
        }
    }

    /// Returns the number of inner nodes, each of which has one plane. O(1).
    pub fn node_count(&self) -> usize {
        self.nodes.len() - self.free_nodes.len()
    }

    /// Returns the number of fragments, which equals the number of polygons if none was cut. O(1).
    pub fn fragment_count(&self) -> usize {
        self.store.len()
    }

    /// Tests whether the tree contains no polygon. O(1). False if there is a polygon.
    pub fn is_empty(&self) -> bool {
        self.fragment_count() == 0
    }

    /// Returns the greatest number of planes on a path from the root to a leaf; 0 for a tree without planes.
    /// Visits every node.
    pub fn depth(&self) -> usize {
        let (mut open, mut deepest) = (Vec::from([(self.root, 0)]), 0);
        while let Some((child, depth)) = open.pop() {
            deepest = deepest.max(depth);
            if !is_leaf(child) {
                open.extend(self.nodes[child as usize].children.map(|child| (child, depth + 1)));
            }
        }
        deepest
    }

    /// Returns the upper bound on the absolute value of coordinates, by axis, for which the margins of all
    /// planes are made.
    pub(crate) fn magnitude(&self) -> DVec3 {
        self.magnitude
    }

    /// Returns a bound on the distance from any point of a polygon to the nearest fragment of the polygon, in
    /// the tree's coordinates. A cut rounds each coordinate of a point by up to `6 u` of the greatest
    /// coordinate, beside what the ends of the cut edge are off by, and each level cuts once.
    pub(crate) fn cut_error(&self) -> f64 {
        3.0 * f64::EPSILON * f64::from(self.most_levels) * self.magnitude.element_sum()
    }

    /// Returns a box around all fragments in the tree's coordinates, rounded outwards to `f32`;
    /// [`Aabb::EMPTY`] for a tree without polygons. O(1).
    pub fn bounds(&self) -> Aabb {
        if is_leaf(self.root) { Aabb::EMPTY } else { self.subtrees[self.root as usize].bounds }
    }
}
