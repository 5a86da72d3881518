//! Solids as trees, and what two of them have in common, together, or one without the other, by merging the
//! trees (Naylor, Amanatides and Thibault, "Merging BSP Trees Yields Polyhedral Set Operations", 1990).
//!
//! One tree's root divides the other tree in two; each half is merged with what the first tree has on that
//! side, until one of the two is a leaf, which decides.

mod partition;

use crate::tree::{BspError, BspTree};
use core::fmt;
use partition::{Arena, EMPTY, MOST_LEVELS, SOLID};
use visibility_core::glam::DVec3;

/// A bounded solid: the points inside a closed boundary, as a tree of planes.
///
/// The operations cost time proportional to the number of nodes that the boundaries of the two share space
/// with, at the worst to the product of the two trees.
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
    arena: Arena,
    root: u32,
    /// Upper bound on the magnitude of the solid's coordinates, by axis.
    reach: DVec3,
}

/// Why there is no such solid.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SolidError {
    /// No tree can be built of the boundary.
    Boundary(BspError),
    /// A tree is too deep to be merged.
    TooDeep {
        /// Number of levels of the tree.
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

impl core::error::Error for SolidError {}

impl From<BspError> for SolidError {
    fn from(error: BspError) -> Self {
        Self::Boundary(error)
    }
}

/// A set operation on two solids.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Operation {
    Union,
    Intersection,
    Difference,
}

impl Solid {
    /// The solid inside a closed boundary of convex polygons, each counter-clockwise as seen from outside.
    ///
    /// # Errors
    /// [`SolidError::Boundary`] and [`SolidError::TooDeep`].
    pub fn new<P: AsRef<[DVec3]>>(boundary: impl IntoIterator<Item = P>) -> Result<Self, SolidError> {
        Self::from_tree(&BspTree::build_solid(boundary.into_iter().map(|polygon| (0, polygon)))?)
    }

    /// The solid made of the solid leaves of a tree that was [built of solids](BspTree::build_solid).
    ///
    /// # Errors
    /// [`SolidError::TooDeep`].
    pub fn from_tree(tree: &BspTree) -> Result<Self, SolidError> {
        check(tree.depth())?;
        let bounds = tree.bounds();
        let reach =
            if tree.is_empty() { DVec3::ZERO } else { bounds.min.abs().max(bounds.max.abs()).as_dvec3() };
        let mut arena = Arena::default();
        let root = tree.copy_planes(&mut |plane, children| arena.push_plane(plane, children));
        Ok(Self { arena, root, reach })
    }

    /// Whether the solid has no points.
    pub fn is_empty(&self) -> bool {
        self.root == EMPTY
    }

    /// Number of nodes of its tree.
    pub fn node_count(&self) -> usize {
        self.arena.len()
    }

    /// Whether a point is inside. On the boundary, within rounding, it may be or not.
    pub fn contains(&self, p: DVec3) -> bool {
        if !p.abs().cmple(self.reach).all() {
            return false;
        }
        self.arena.locate(self.root, p) == SOLID
    }

    /// The union: all points in either solid.
    ///
    /// # Errors
    /// [`SolidError::TooDeep`], here and in the other operations.
    pub fn union(&self, other: &Self) -> Result<Self, SolidError> {
        self.merge(other, Operation::Union)
    }

    /// The intersection: all points in both solids.
    ///
    /// # Errors
    /// [`SolidError::TooDeep`].
    pub fn intersection(&self, other: &Self) -> Result<Self, SolidError> {
        self.merge(other, Operation::Intersection)
    }

    /// The difference: all points in this solid and not in the other.
    ///
    /// # Errors
    /// [`SolidError::TooDeep`].
    pub fn difference(&self, other: &Self) -> Result<Self, SolidError> {
        self.merge(other, Operation::Difference)
    }

    fn merge(&self, other: &Self, operation: Operation) -> Result<Self, SolidError> {
        check(self.arena.depth(self.root))?;
        check(other.arena.depth(other.root))?;
        let reach = self.reach.max(other.reach);
        let mut arena = Arena::default();
        let a = arena.load(&self.arena, self.root, reach);
        let b = arena.load(&other.arena, other.root, reach);
        let merged = merge(&mut arena, operation, a, b);
        // What was made on the way is left behind.
        let mut result = Arena::default();
        let root = result.load(&arena, merged, reach);
        Ok(Self { arena: result, root, reach })
    }
}

fn check(levels: usize) -> Result<(), SolidError> {
    if levels <= MOST_LEVELS { Ok(()) } else { Err(SolidError::TooDeep { levels }) }
}

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
