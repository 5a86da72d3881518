//! Summary of a subtree: the bounds and the common owner of its fragments.

use super::node::NONE;
use visibility_core::Aabb;

/// Bounds and owner of all fragments in a node and below it. Passed to
/// [`TreeVisitor::enter`](crate::TreeVisitor::enter).
///
/// ```
/// use visibility_bsp::{BspTree, Fragments, Subtree, TraversalStack, TreeVisitor};
/// use visibility_core::{glam::{DVec3, Vec3}, view::Eye, Aabb};
/// struct Root(Option<Subtree>);
/// impl TreeVisitor for Root {
///     fn enter(&mut self, subtree: &Subtree, _: u32) -> Option<u32> {
///         self.0 = Some(*subtree);
///         None
///     }
///     fn visit(&mut self, _: Fragments<'_>, _: u32) {}
/// }
/// let tree = BspTree::build([(7, [DVec3::ZERO, DVec3::X, DVec3::Y])])?;
/// let mut walk = Root(None);
/// tree.walk(Eye::Point(DVec3::ONE), &mut TraversalStack::new(), &mut walk);
/// let subtree = walk.0.unwrap();
/// assert_eq!(subtree.owner(), Some(7));
/// // Boxes are rounded outwards.
/// assert!(subtree.bounds().max.cmpge(Vec3::new(1.0, 1.0, 0.0)).all());
/// # Ok::<(), visibility_bsp::BspError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Subtree {
    /// Box around all fragments of the subtree in the tree's coordinates, rounded outwards to `f32`;
    /// [`Aabb::EMPTY`] without fragments.
    pub(super) bounds: Aabb,
    /// The common owner of all fragments, `NONE` without fragments, `MANY` for two or more owners.
    owner: u32,
}

/// Value of `Subtree::owner` that stands for two or more different owners.
const MANY: u32 = u32::MAX - 1;

impl Subtree {
    /// Summary of a subtree without fragments: empty bounds and no owner.
    pub(super) const NOTHING: Self = Self { bounds: Aabb::EMPTY, owner: NONE };

    /// Returns the summary of fragments of one owner within `bounds`, a box in the tree's coordinates. An
    /// owner number too large to be stored (from `u32::MAX - 1`) counts as several owners.
    pub(super) fn of(bounds: Aabb, owner: u32) -> Self {
        Self { bounds, owner: owner.min(MANY) }
    }

    /// Returns the summary of the fragments of two subtrees together: the union of the bounds, and the owner
    /// if it is the same.
    pub(super) fn union(&self, other: &Self) -> Self {
        let owner = match (self.owner, other.owner) {
            (NONE, owner) | (owner, NONE) => owner,
            (a, b) if a == b => a,
            _ => MANY,
        };
        Self { bounds: self.bounds.union(&other.bounds), owner }
    }

    /// Returns a box around all fragments of the subtree in the tree's coordinates, rounded outwards to
    /// `f32`; [`Aabb::EMPTY`] without fragments.
    #[inline]
    pub fn bounds(&self) -> &Aabb {
        &self.bounds
    }

    /// Returns the owner of all fragments of the subtree. `None` if they have several owners or there are
    /// none.
    #[inline]
    pub fn owner(&self) -> Option<u32> {
        (self.owner < MANY).then_some(self.owner)
    }
}
