//! Solids as BSP trees, with union, intersection and difference by merging trees (Naylor, Amanatides and
//! Thibault, "Merging BSP Trees Yields Polyhedral Set Operations", 1990).
//!
//! The plane of one tree's root splits the other tree in two. Each half is merged with the first tree's child
//! on that side. The recursion ends where one of the two trees is a leaf, which decides the result.

mod partition;

use crate::tree::{BspError, BspTree, EMPTY, SOLID};
use core::fmt;
use partition::{Arena, MOST_LEVELS};
use visibility_core::glam::DVec3;

/// A bounded solid: the points inside a closed boundary, stored as a BSP tree with empty and solid leaves.
/// Coordinates are `f64` in any unit.
///
/// A set operation takes time proportional to the number of nodes in whose regions both boundaries lie, at
/// worst to the product of the two trees' sizes.
///
/// ```
/// use visibility_bsp::{BspTree, Solid};
/// use visibility_core::glam::DVec3;
/// /// The faces of the box from `(x, 0, 0)` to `(x + 2, 1, 1)`, counter-clockwise as seen from outside.
/// let faces = |x: f64| {
///     let at = |i: u32| DVec3::new(x + f64::from(i & 1) * 2.0, f64::from(i >> 1 & 1), f64::from(i >> 2));
///     let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
///     faces.map(|face| face.map(at))
/// };
/// let [a, b] = [Solid::new(faces(0.0))?, Solid::new(faces(1.0))?];
/// let middle = DVec3::new(1.5, 0.5, 0.5);
/// assert!(a.union(&b)?.contains(middle) && a.intersection(&b)?.contains(middle));
/// assert!(!a.difference(&b)?.contains(middle) && a.difference(&a)?.is_empty());
/// # Ok::<(), visibility_bsp::SolidError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Solid {
    /// Nodes of the solid's tree.
    arena: Arena,
    /// Root of the tree: a node index in `arena`, or the leaf `EMPTY` or `SOLID`.
    root: u32,
    /// Upper bound on the absolute coordinates of the solid's points, on each axis.
    magnitude: DVec3,
}

/// Reason why a solid cannot be made or merged.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum SolidError {
    /// No tree could be built from the boundary, for the enclosed reason.
    Boundary(BspError),
    /// A tree has more levels than the limit for merging, which bounds the recursion.
    TooDeep {
        /// Number of levels of the offending tree, more than 1000.
        levels: usize,
    },
}

impl fmt::Display for SolidError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Boundary(error) => error.fmt(f),
            Self::TooDeep { levels } => {
                write!(f, "a tree of {levels} levels is too deep to be merged: {MOST_LEVELS} are the most")
            }
        }
    }
}

impl core::error::Error for SolidError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Boundary(error) => Some(error),
            _ => None,
        }
    }
}

impl From<BspError> for SolidError {
    fn from(error: BspError) -> Self {
        Self::Boundary(error)
    }
}

/// A set operation on a first and a second solid.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Operation {
    /// All points in the first or the second solid, or both.
    Union,
    /// All points in both solids.
    Intersection,
    /// All points in the first solid that are not in the second.
    Difference,
}

impl Solid {
    /// Builds the solid inside a closed boundary of convex polygons in `f64` coordinates of any unit, each
    /// counter-clockwise as seen from outside. Polygons that are not [accepted](BspTree::accepts) are left
    /// out. No polygons give an empty solid.
    ///
    /// # Errors
    /// [`SolidError::Boundary`] if the polygons cut each other into too many fragments;
    /// [`SolidError::TooDeep`] if the tree has more than 1000 levels.
    pub fn new<P: AsRef<[DVec3]>>(boundary: impl IntoIterator<Item = P>) -> Result<Self, SolidError> {
        let tree = BspTree::build_solid(boundary.into_iter().map(|polygon| (0, polygon)))?;
        check(tree.depth())?;
        let bounds = tree.bounds();
        let magnitude =
            if tree.is_empty() { DVec3::ZERO } else { bounds.min.abs().max(bounds.max.abs()).as_dvec3() };
        let mut arena = Arena::default();
        let root = tree.copy_planes(&mut |plane, children| arena.push_plane(plane, children));
        Ok(Self { arena, root, magnitude })
    }

    /// Tests whether the solid contains no point: its tree is a single empty leaf. False if some leaf is
    /// solid.
    pub fn is_empty(&self) -> bool {
        self.root == EMPTY
    }

    /// Returns the number of inner nodes of the solid's tree; 0 for an empty solid.
    pub fn node_count(&self) -> usize {
        self.arena.len()
    }

    /// Tests whether a point in the solid's coordinates is inside. For a point on the boundary, within
    /// rounding, either answer is possible. False for NaN.
    pub fn contains(&self, p: DVec3) -> bool {
        if !p.abs().cmple(self.magnitude).all() {
            return false;
        }
        self.arena.locate(self.root, p) == SOLID
    }

    /// Returns the union: all points in either solid.
    ///
    /// # Errors
    /// [`SolidError::TooDeep`] if the tree of either operand has more than 1000 levels.
    pub fn union(&self, other: &Self) -> Result<Self, SolidError> {
        self.merge(other, Operation::Union)
    }

    /// Returns the intersection: all points in both solids.
    ///
    /// # Errors
    /// [`SolidError::TooDeep`] if the tree of either operand has more than 1000 levels.
    pub fn intersection(&self, other: &Self) -> Result<Self, SolidError> {
        self.merge(other, Operation::Intersection)
    }

    /// Returns the difference: all points in this solid and not in the other.
    ///
    /// # Errors
    /// [`SolidError::TooDeep`] if the tree of either operand has more than 1000 levels.
    pub fn difference(&self, other: &Self) -> Result<Self, SolidError> {
        self.merge(other, Operation::Difference)
    }

    /// Returns the result of a set operation on this solid (first) and `other` (second). `Err` if either tree
    /// has more than 1000 levels.
    fn merge(&self, other: &Self, operation: Operation) -> Result<Self, SolidError> {
        check(self.arena.depth(self.root))?;
        check(other.arena.depth(other.root))?;
        let magnitude = self.magnitude.max(other.magnitude);
        let mut arena = Arena::default();
        let a = arena.load(&self.arena, self.root, magnitude);
        let b = arena.load(&other.arena, other.root, magnitude);
        let merged = merge(&mut arena, operation, a, b);
        // Only the nodes of the result are copied; the merge's intermediate nodes are dropped.
        let mut result = Arena::default();
        let root = result.load(&arena, merged, magnitude);
        Ok(Self { arena: result, root, magnitude })
    }
}

/// Returns an error if a tree of `levels` levels exceeds [`MOST_LEVELS`].
fn check(levels: usize) -> Result<(), SolidError> {
    if levels <= MOST_LEVELS { Ok(()) } else { Err(SolidError::TooDeep { levels }) }
}

/// Merges the trees with roots `a` and `b`, which belong to one region, by a set operation. Returns the
/// result's root in `arena`: a node index, or the leaf `EMPTY` or `SOLID`.
fn merge(arena: &mut Arena, operation: Operation, a: u32, b: u32) -> u32 {
    match (operation, a, b) {
        (Operation::Union, SOLID, _) | (Operation::Union, _, SOLID) => return SOLID,
        (Operation::Union, EMPTY, rest) | (Operation::Union, rest, EMPTY) => return rest,
        (Operation::Intersection, EMPTY, _) | (Operation::Intersection, _, EMPTY) => return EMPTY,
        (Operation::Intersection, SOLID, rest) | (Operation::Intersection, rest, SOLID) => return rest,
        (Operation::Difference, EMPTY, _) | (Operation::Difference, _, SOLID) => return EMPTY,
        (Operation::Difference, rest, EMPTY) => return rest,
        (Operation::Difference, SOLID, rest) => return arena.complement(rest),
        _ => {}
    }
    let node = arena.node(a);
    let [behind, ahead] = arena.partition(b, &node);
    let [back, front] = node.children;
    let children = [merge(arena, operation, back, behind), merge(arena, operation, front, ahead)];
    arena.push(node.with(children))
}
