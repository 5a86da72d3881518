//! What is below a node, summed up: where it is, and whose.

use super::node::NONE;
use visibility_core::Aabb;

/// Bounds and owner of all fragments in a node and below it.
///
/// ```
/// use visibility_bsp::{BspTree, Fragments, Order, Subtree, Walk};
/// use visibility_core::{glam::{DVec3, Vec3}, view::Eye, Aabb};
/// struct Root(Option<Subtree>);
/// impl Walk for Root {
///     fn enter(&mut self, subtree: &Subtree, _: u32) -> Option<u32> {
///         self.0 = Some(*subtree);
///         None
///     }
///     fn visit(&mut self, _: Fragments<'_>, _: u32) {}
/// }
/// let tree = BspTree::build([(7, [DVec3::ZERO, DVec3::X, DVec3::Y])])?;
/// let mut walk = Root(None);
/// tree.walk(Eye::Point(DVec3::ONE), &mut Order::new(), &mut walk);
/// let subtree = walk.0.unwrap();
/// assert_eq!(subtree.owner(), Some(7));
/// // Boxes are rounded outwards.
/// assert!(subtree.bounds().max.cmpge(Vec3::new(1.0, 1.0, 0.0)).all());
/// # Ok::<(), visibility_bsp::BspError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Subtree {
    pub(super) bounds: Aabb,
    /// The owner of all fragments, `NONE` if there is no fragment, `MANY` if there is more than one owner.
    owner: u32,
}

/// In place of an owner: there is more than one.
const MANY: u32 = u32::MAX - 1;

impl Subtree {
    pub(super) const NOTHING: Self = Self { bounds: Aabb::EMPTY, owner: NONE };

    pub(super) fn of(bounds: Aabb, owner: u32) -> Self {
        Self { bounds, owner: owner.min(MANY) }
    }

    pub(super) fn union(&self, other: &Self) -> Self {
        let owner = match (self.owner, other.owner) {
            (NONE, owner) | (owner, NONE) => owner,
            (a, b) if a == b => a,
            _ => MANY,
        };
        Self { bounds: self.bounds.union(&other.bounds), owner }
    }

    /// A box around all fragments, rounded outwards.
    #[inline]
    pub fn bounds(&self) -> &Aabb {
        &self.bounds
    }

    /// The owner of all fragments, `None` if there are several.
    #[inline]
    pub fn owner(&self) -> Option<u32> {
        (self.owner < MANY).then_some(self.owner)
    }
}
