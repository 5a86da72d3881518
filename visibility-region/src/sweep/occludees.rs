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

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::DVec3;

    /// A direction of a viewcell of 2 by 6 by 1 metres, whose coordinates are off by 1/64: its guard is 1/8.
    fn direction() -> Direction {
        let rows = [DVec3::X, DVec3::Y, DVec3::Z];
        let (half, error) = ([1.0, 3.0], 1.0 / 64.0);
        Direction { rows, offset: [0.0; 3], half, exact: [None; 2], depth: 1.0, error }
    }

    fn aabb(min: [f32; 3], max: [f32; 3]) -> Aabb {
        Aabb::from_arrays(min, max)
    }

    /// Boxes at the limits of what a sweep can test: within the usable bounds, beyond the front of the
    /// viewcell by more than the guard, not too far to the side, and not too near for the viewcell's width.
    #[test]
    fn boxes_are_occludees_up_to_the_limits_of_slopes_and_distances() {
        let (direction, usable) = (direction(), aabb([-50.0; 3], [50.0; 3]));
        let is_usable = |min, max, steepest| {
            let bounds = aabb(min, max);
            is_usable(&usable, &direction, &direction.local_box(&bounds), &bounds, steepest)
        };
        let near = |z: f32| is_usable([0.0, 0.0, z], [1.0, 1.0, 9.0], 64.0);
        assert_eq!(
            [0.0, 0.125, 0.14].map(near),
            [false, false, false],
            "before the guard, and nearer than 6 / 40"
        );
        assert_eq!(
            [0.149, 0.15, 0.16].map(near),
            [false, true, true],
            "a fortieth of the greater width away"
        );
        let narrow = Direction { half: [1.0, 1.0], ..direction };
        let after = |z: f32| {
            let bounds = aabb([0.0, 0.0, z], [1.0, 1.0, 9.0]);
            super::is_usable(&usable, &narrow, &narrow.local_box(&bounds), &bounds, 64.0)
        };
        assert_eq!([0.1, 0.125, 0.126].map(after), [false, false, true], "beyond the guard");
        // At a depth of 2 m, slopes up to 4 lead 8 m beside the viewcell.
        for (lat, half) in [(0, 1.0), (1, 3.0)] {
            for sign in [1.0, -1.0] {
                for (beside, expected) in [(7.9, true), (8.0, true), (8.1, false)] {
                    let mut ends = [0.0, sign * (half + beside)];
                    ends.sort_by(f32::total_cmp);
                    let (mut min, mut max) = ([0.0, 0.0, 2.0], [1.0, 1.0, 3.0]);
                    (min[lat], max[lat]) = (ends[0], ends[1]);
                    assert_eq!(is_usable(min, max, 4.0), expected, "{beside} m beside along {lat}, {sign}");
                }
            }
        }
        assert!(is_usable([0.0, 0.0, 2.0], [1.0, 1.0, 50.0], 4.0), "up to the usable bounds");
        assert!(!is_usable([0.0, 0.0, 2.0], [1.0, 1.0, 50.1], 4.0), "out of the usable bounds");
    }

    /// Items that are cut to others: what both boxes have in common, in both coordinates.
    #[test]
    fn items_are_cut_to_what_both_have_in_common() {
        let child = Child::Node(0);
        let item = |min: [f32; 3], max: [f32; 3], by: f64| {
            let scene_bounds = aabb(min, max);
            let bounds = direction().local_box(&scene_bounds);
            let bounds = LocalBox { lo: bounds.lo - by, hi: bounds.hi - by };
            Item { child, bounds, scene_bounds }
        };
        let all = item([0.0; 3], [4.0; 3], 0.5);
        let cut = item([-1.0, 1.0, 2.0], [3.0, 5.0, 4.0], 0.5).within(&all).unwrap();
        assert_eq!(cut.scene_bounds, aabb([0.0, 1.0, 2.0], [3.0, 4.0, 4.0]), "in the scene");
        assert_eq!(
            [cut.bounds.lo, cut.bounds.hi],
            [[-0.5, 0.5, 1.5], [2.5, 3.5, 3.5]].map(DVec3::from),
            "along the direction"
        );
        assert!(item([4.0; 3], [5.0; 3], 0.5).within(&all).is_some(), "a corner is left");
        assert!(item([4.5; 3], [5.0; 3], 0.5).within(&all).is_none(), "nothing is left");
        // Of boxes that differ in one of the two coordinates alone.
        assert!(item([1.0; 3], [2.0; 3], 9.0).within(&all).is_none(), "nothing along the direction");
        let elsewhere = Item { scene_bounds: aabb([8.0; 3], [9.0; 3]), ..all };
        assert!(elsewhere.within(&all).is_none(), "nothing in the scene");
    }

    /// Objects asked one by one are in the direction along which they are farthest; those asked beside a
    /// direction are in it, unless it is the farthest.
    #[test]
    fn objects_are_asked_in_their_farthest_direction_or_beside_it() {
        use crate::sweep::cell_extent::CellExtent;
        use crate::sweep::direction::CellBox;
        use visibility_core::pvs::Viewcell;
        let mut scene = Scene::new();
        let boxes = [
            aabb([9.0, 0.0, 3.0], [10.0, 1.0, 4.0]),
            aabb([1.0, 0.0, 9.0], [2.0, 1.0, 10.0]),
            aabb([1.0, 0.0, -9.0], [2.0, 1.0, -8.0]),
            aabb([0.0, 0.0, 3.0], [500.0, 1.0, 4.0]),
        ];
        let ids = boxes.map(|bounds| scene.insert(bounds));
        let usable = aabb([-100.0; 3], [100.0; 3]);
        let cell = Viewcell::from_box(DVec3::splat(-1.0), DVec3::splat(1.0));
        let extent = CellExtent::new(&cell, DVec3::ZERO).unwrap();
        let cell = CellBox::new(&extent, &usable, DVec3::AXES).unwrap();
        let directions = core::array::from_fn(|index| cell.direction(index));
        let up = directions.iter().position(|d| d.rows[2] == DVec3::Z).unwrap();
        let listed = |asked: Asked<'_>| {
            let mut lists: [Vec<Item>; 6] = Default::default();
            assign(&scene, asked, &usable, &directions, &mut lists, &mut Vec::new());
            lists.map(|list| {
                let index = |item: &Item| boxes.iter().position(|b| *b == item.scene_bounds);
                list.iter().filter_map(index).collect::<Vec<_>>()
            })
        };
        let of = |axis: DVec3| directions.iter().position(|d| d.rows[2] == axis).unwrap();
        let mut expected: [Vec<usize>; 6] = Default::default();
        expected[up] = alloc::vec![1];
        expected[of(DVec3::X)] = alloc::vec![0];
        expected[of(DVec3::NEG_Z)] = alloc::vec![2];
        assert_eq!(
            listed(Asked::Objects(&ids)),
            expected,
            "one by one, the last is beyond the usable bounds"
        );
        let mut expected: [Vec<usize>; 6] = Default::default();
        expected[up] = alloc::vec![0];
        assert_eq!(listed(Asked::Beside(&ids, up)), expected, "upwards, except what is farthest there");
    }
}
