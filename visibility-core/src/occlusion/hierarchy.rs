//! What the driver walks: anything that is a hierarchy of boxes.

use crate::{Aabb, ObjectId, Scene};

/// What is below a node of a [`BoxHierarchy`].
///
/// ```
/// use visibility_core::Child;
/// let child = Child::Node(3);
/// assert!(matches!(child, Child::Node(3)));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Child {
    /// Another node.
    Node(usize),
    /// An object of the scene.
    Object(ObjectId),
}

/// A hierarchy of boxes over the objects of a scene: an octree, a BSP tree, the scene's own.
///
/// A box must contain everything below it. Objects that have moved since the hierarchy was brought up to date
/// must not be listed, unless still within the boxes above them, and nothing of another scene than the one
/// that the hierarchy was made for, which a [`SceneCursor`](crate::SceneCursor) tells. What is not listed
/// counts as visible.
///
/// ```
/// use visibility_core::{Aabb, BoxHierarchy, Child, ObjectId, Scene};
/// /// Every object by itself.
/// struct Flat(Vec<ObjectId>);
/// impl BoxHierarchy for Flat {
///     fn for_each_child(&self, scene: &Scene, node: Option<usize>, each: &mut dyn FnMut(Child, Aabb)) {
///         for &id in self.0.iter().filter(|_| node.is_none()) {
///             if let Ok(bounds) = scene.bounds(id) {
///                 each(Child::Object(id), bounds);
///             }
///         }
///     }
/// }
/// ```
pub trait BoxHierarchy {
    /// Calls `each` for everything directly below a node, or, for `None`, for what is at the top.
    fn for_each_child(&self, scene: &Scene, node: Option<usize>, each: &mut dyn FnMut(Child, Aabb));

    /// Whether this is the scene's own hierarchy, which the driver walks by masks instead.
    fn is_of_scene(&self) -> bool {
        false
    }
}

/// The hierarchy that every scene has.
///
/// ```
/// use visibility_core::{BoxHierarchy, SceneHierarchy};
/// assert!(SceneHierarchy.is_of_scene());
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct SceneHierarchy;

impl BoxHierarchy for SceneHierarchy {
    fn for_each_child(&self, scene: &Scene, node: Option<usize>, each: &mut dyn FnMut(Child, Aabb)) {
        scene.for_each_child(node, each);
    }

    fn is_of_scene(&self) -> bool {
        true
    }
}
