//! Check of a hierarchy against the rules of [`BoxHierarchy`].

use super::{BoxHierarchy, Child};
use crate::{Aabb, Scene};
use alloc::{collections::BTreeSet, vec};

/// Returns a child that breaks the rules of [`BoxHierarchy`]: an object whose present bounds are not within
/// its own box and the boxes of all nodes above it, or a node that is listed a second time. `None` if there
/// is no such child: the hierarchy then hides nothing visible. For tests of hierarchies and for debug builds:
/// a walk does not check its hierarchy.
///
/// Unknown objects count as visible, as do nodes and objects with an inverted or NaN box; none of these
/// breaks a rule. Allocates; time is linear in the number of objects, and O(n log n) in the number of nodes.
///
/// ```
/// use visibility_core::walk::{BoxHierarchy, Child, SceneHierarchy, first_misplaced};
/// use visibility_core::{Aabb, ObjectId, Scene};
/// /// All objects below one node, with the box that they had when the hierarchy was made.
/// struct Stale(Vec<ObjectId>, Aabb);
/// impl BoxHierarchy for Stale {
///     fn for_each_child(&self, scene: &Scene, node: Option<usize>, each: &mut dyn FnMut(Child, Aabb)) {
///         match node {
///             None => each(Child::Node(0), self.1),
///             Some(_) => self.0.iter().for_each(|&id| each(Child::Object(id), scene.bounds(id).unwrap())),
///         }
///     }
/// }
/// let mut scene = Scene::new();
/// let bounds = Aabb::from_arrays([0.0; 3], [1.0; 3]);
/// let id = scene.insert(bounds);
/// let stale = Stale(vec![id], bounds);
/// assert_eq!(first_misplaced(&scene, &stale), None);
/// scene.set_bounds(id, Aabb::from_arrays([0.0; 3], [2.0; 3]))?;
/// assert_eq!(first_misplaced(&scene, &stale), Some(Child::Object(id)));
/// assert_eq!(first_misplaced(&scene, &SceneHierarchy), None);
/// # Ok::<(), visibility_core::scene::SceneError>(())
/// ```
pub fn first_misplaced(scene: &Scene, hierarchy: &impl BoxHierarchy) -> Option<Child> {
    const EVERYWHERE: Aabb = Aabb::new(glam::Vec3::NEG_INFINITY, glam::Vec3::INFINITY);
    let (mut opened, mut misplaced) = (BTreeSet::new(), None);
    // Nodes to open, each with the intersection of its own box and the boxes of all nodes above it.
    let mut waiting = vec![(None, EVERYWHERE)];
    while let Some((node, within)) = waiting.pop().filter(|_| misplaced.is_none()) {
        hierarchy.for_each_child(scene, node, &mut |child, bounds| {
            let within = match bounds.is_proper() {
                true => Aabb::new(within.min.max(bounds.min), within.max.min(bounds.max)),
                false => within,
            };
            let is_right = match child {
                Child::Node(below) => {
                    let is_new = opened.insert(below);
                    if is_new {
                        waiting.push((Some(below), within));
                    }
                    is_new
                }
                Child::Object(id) => match scene.bounds(id) {
                    Ok(of) if of.is_proper() => {
                        within.min.cmple(of.min).all() && of.max.cmple(within.max).all()
                    }
                    _ => true,
                },
            };
            if !is_right && misplaced.is_none() {
                misplaced = Some(child);
            }
        });
    }
    misplaced
}
