//! Occludees, the nodes and objects of the scene's hierarchy that are tested. Each is assigned to the
//! direction in which it is farthest.

use super::direction::{Direction, LocalBox};
use crate::extent::contains;
use alloc::vec::Vec;
use visibility_core::bits::Bits;
use visibility_core::walk::{BoxHierarchy, Child, SceneHierarchy};
use visibility_core::{Aabb, ObjectId, Scene, VisibleSet};

/// A node or an object to be tested, in local coordinates of its assigned direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item {
    pub(crate) child: Child,
    pub(crate) bounds: LocalBox,
    /// Bounds in scene coordinates.
    pub(crate) scene_bounds: Aabb,
}

impl Item {
    /// Returns the item cut to the boxes of another. `None` if nothing is left of it.
    pub(super) fn within(self, other: &Self) -> Option<Self> {
        let (lo, hi) = (self.bounds.lo.max(other.bounds.lo), self.bounds.hi.min(other.bounds.hi));
        let [a, b] = [self.scene_bounds, other.scene_bounds];
        let (min, max) = (a.min.max(b.min), a.max.min(b.max));
        let is_left = lo.cmple(hi).all() && min.cmple(max).all();
        is_left.then(|| Self { bounds: LocalBox { lo, hi }, scene_bounds: Aabb::new(min, max), ..self })
    }
}

/// Greatest slope of rays that a map holds, in lateral metres per metre of depth. Objects that are farther to
/// the side count as visible.
const STEEPEST: f64 = 4.0;

/// Greatest slope of rays to objects that are asked [beside](Asked::Beside) their farthest direction: across
/// a whole storey.
pub(super) const STEEPEST_BESIDE: f64 = 64.0;

/// Greatest width of the viewcell's front in depths of an object. What is nearer counts as visible: rays to
/// it from the opposite side would be steeper than the margins allow.
pub(super) const ACROSS: f64 = 40.0;

/// Objects to be assigned to directions.
#[derive(Clone, Copy)]
pub(crate) enum Asked<'a> {
    /// All objects of the scene, also those on no layer, each in the direction along which it is farthest.
    /// Whole nodes of the hierarchy are assigned where that is possible.
    All,
    /// The objects of a set, assigned as those of [`All`](Self::All).
    Set(&'a VisibleSet),
    /// Objects of the scene, one by one, each in the direction along which it is farthest.
    Objects(&'a [ObjectId]),
    /// Objects of the scene, one by one, in the direction with the given index, except those that are
    /// farthest along it. A long wall of the next storey is farthest along the floor, where it begins before
    /// the plane at which the ceiling hides its far end; upwards, the ceiling alone hides it.
    Beside(&'a [ObjectId], usize),
}

impl Asked<'_> {
    /// Returns whether whole nodes of the hierarchy are tested.
    pub(crate) fn is_by_node(&self) -> bool {
        matches!(self, Self::All | Self::Set(_))
    }

    /// Returns whether an object of a node that is tested is asked.
    fn holds(&self, scene: &Scene, id: ObjectId) -> bool {
        !matches!(self, Self::Set(visible) if !visible.contains(scene, id))
    }
}

/// Assigns the objects of `asked` to the six directions, as [`Asked`] says. Where all objects of a set that
/// are below a node are farthest along one direction, or nearly, the whole node is assigned. Objects that
/// reach out of `usable_bounds`, into the box of the viewcell, or too far aside of it, are left out: they
/// count as visible. Returns the number of nodes visited.
pub(crate) fn assign(
    scene: &Scene,
    asked: Asked<'_>,
    usable_bounds: &Aabb,
    directions: &[Direction; 6],
    lists: &mut [Vec<Item>; 6],
    stack: &mut Vec<Option<usize>>,
) -> u64 {
    lists.iter_mut().for_each(Vec::clear);
    match asked {
        Asked::All | Asked::Set(_) => {}
        Asked::Objects(ids) | Asked::Beside(ids, _) => {
            for &id in ids {
                let (Ok(object), Ok(scene_bounds)) = (scene.object(id), scene.bounds(id)) else { continue };
                if object.is_unculled() {
                    continue;
                }
                let farthest = || farthest(&directions.map(|d| d.local_box(&scene_bounds)));
                let (index, steepest, is_beside) = match asked {
                    Asked::Beside(_, index) => (index, STEEPEST_BESIDE, true),
                    _ => (farthest(), STEEPEST, false),
                };
                let bounds = directions[index].local_box(&scene_bounds);
                if is_usable(usable_bounds, &directions[index], &bounds, &scene_bounds, steepest)
                    && !(is_beside && index == farthest())
                {
                    lists[index].push(Item { child: Child::Object(id), bounds, scene_bounds });
                }
            }
            return 0;
        }
    }
    let mut nodes = 0;
    stack.push(None);
    while let Some(node) = stack.pop() {
        nodes += 1;
        SceneHierarchy.for_each_child(scene, node, &mut |child, scene_bounds| {
            let boxes = directions.each_ref().map(|direction| direction.local_box(&scene_bounds));
            let farthest = farthest(&boxes);
            let bounds = boxes[farthest];
            let usable = is_usable(usable_bounds, &directions[farthest], &bounds, &scene_bounds, STEEPEST);
            match child {
                Child::Object(id) => {
                    if usable && asked.holds(scene, id) {
                        lists[farthest].push(Item { child, bounds, scene_bounds });
                    }
                }
                Child::Node(below) => {
                    // An object below the node may be as far along another direction as the far side of the
                    // node's box is.
                    let others = (0..6).filter(|&i| i != farthest).map(|i| boxes[i].hi.z);
                    if usable && others.fold(0.0, f64::max) * 0.75 <= bounds.lo.z {
                        lists[farthest].push(Item { child, bounds, scene_bounds });
                    } else {
                        stack.push(Some(below));
                    }
                }
            }
        });
    }
    nodes
}

/// Returns the index of the direction along which the near side of a box is farthest away. `boxes` is the box
/// in the local coordinates of each direction.
fn farthest(boxes: &[LocalBox; 6]) -> usize {
    (1..6).fold(0, |best, i| if boxes[i].lo.z > boxes[best].lo.z { i } else { best })
}

/// Tests whether a box may be an occludee of a direction. `local` is the box in local coordinates, `bounds`
/// in scene coordinates. `steepest` is the greatest slope of rays to the box.
fn is_usable(
    usable_bounds: &Aabb,
    direction: &Direction,
    local: &LocalBox,
    bounds: &Aabb,
    steepest: f64,
) -> bool {
    contains(usable_bounds, bounds) && local.lo.z > direction.guard() && is_ahead(direction, local, steepest)
}

/// Tests whether rays from the nearest side of the viewcell's front to a box have a slope of at most
/// `steepest`, and those from the opposite side one of at most [`ACROSS`] more.
fn is_ahead(direction: &Direction, b: &LocalBox, steepest: f64) -> bool {
    (0..2).all(|lat| {
        let half = direction.half[lat];
        let is_steep = b.lo[lat].abs().max(b.hi[lat].abs()) - half > steepest * b.lo.z;
        !is_steep && 2.0 * half <= ACROSS * b.lo.z
    })
}

/// Calls `each` with the children of a node, in local coordinates. Objects that are not asked are left out.
pub(crate) fn for_each_child(
    scene: &Scene,
    asked: &Asked<'_>,
    direction: &Direction,
    node: usize,
    mut each: impl FnMut(Item),
) {
    SceneHierarchy.for_each_child(scene, Some(node), &mut |child, bounds| {
        if !matches!(child, Child::Object(id) if !asked.holds(scene, id)) {
            each(Item { child, bounds: direction.local_box(&bounds), scene_bounds: bounds });
        }
    });
}

/// Adds to `bits` the indices of all objects below a node, or the index of an object.
pub(crate) fn mark(scene: &Scene, child: Child, bits: &mut Bits) {
    match child {
        Child::Object(id) => {
            bits.insert(id.index());
        }
        Child::Node(node) => {
            SceneHierarchy.for_each_child(scene, Some(node), &mut |child, _| mark(scene, child, bits));
        }
    }
}
