//! Volumetric visibility from a region: blockers are boxes of opaque space, which are extended into opaque
//! and hidden space around them.
//!
//! This work is based on: Schaufler, Dorsey, Decoret and Sillion, "Conservative Volumetric Visibility with
//! Occluder Fusion", 2000. An octree stores which of its cells lie inside solids. From a viewcell, the opaque
//! cells that look largest become blockers. A blocker is extended, one side after another, while the whole
//! slab that would be added is opaque or already found hidden: a line of sight through the slab is blocked
//! there or earlier. This fuses blockers. Cells found hidden are marked in the octree for the next blocker.
//!
//! Walls thinner than the octree's cells contain no opaque cell and hide nothing.

use crate::blocker::Blocker;
use crate::extent::quantile;
use crate::remove::{cell_box, remove_hidden};
use crate::solids::occluding;
use crate::solids::{Solid, Solids};
use crate::umbra::{Umbra, is_closed_from};
use alloc::vec::Vec;
use visibility_core::geometry::Containment;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Accuracy, CullStats, RegionCuller, Scene, VisibleSet};

/// Greatest number of cells of the octree, which take 1 MiB.
const NODES: usize = 1 << 17;

/// Limit on the cells' lists of nearby solids: their total length is at most this number (8 MiB) plus 16 for
/// each solid. Once a division would exceed it, a cell is not divided. This happens where the surfaces of
/// many solids pass through the same cells.
const LISTED: usize = 1 << 21;

/// Greatest number of blockers of a viewcell.
const BLOCKERS: usize = 256;

/// Index that stands for no node and for no solid.
const NONE: u32 = u32::MAX;

/// A cell of the octree.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// Index of the first of eight children, or `NONE` for a leaf.
    children: u32,
    /// Index of a solid that contains the whole cell, or `NONE`.
    solid: u32,
}

/// The octree over the solids of a scene.
#[derive(Clone, Debug)]
struct Octree {
    min: DVec3,
    max: DVec3,
    nodes: Vec<Node>,
}

/// Removes the objects that boxes of opaque space hide from every point of a viewcell. Conservative.
///
/// Space is opaque inside the convex solids of occluder meshes. Solids that meet the viewcell do not count.
/// The octree has at most 131,072 cells, around nine tenths of the solids, and is built again when occluders
/// of the scene have changed.
///
/// ```
/// use visibility_core::{glam::{Affine3A, DVec3}, pvs::Viewcell};
/// use visibility_core::{Aabb, OccluderMesh, RegionCuller, Scene, VisibleSet};
/// use visibility_region::VolumetricCuller;
/// let mut scene = Scene::new();
/// let bounds = Aabb::from_arrays([4.0, -9.0, -9.0], [7.0, 9.0, 9.0]);
/// let house = scene.insert(bounds);
/// let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds)?);
/// scene.set_mesh(house, mesh, Affine3A::IDENTITY)?;
/// scene.set_occluder(house, true)?;
/// let behind = scene.insert(Aabb::from_arrays([8.0, -1.0, -1.0], [9.0, 1.0, 1.0]));
/// let mut visible = VisibleSet::new();
/// let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
/// VolumetricCuller::new().cull(&scene, &cell, &mut visible);
/// assert!(visible.contains(&scene, house) && !visible.contains(&scene, behind));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct VolumetricCuller {
    solids: Solids,
    octree: Octree,
    blockers: Vec<[DVec3; 2]>,
}

impl Default for VolumetricCuller {
    fn default() -> Self {
        Self::new()
    }
}

impl VolumetricCuller {
    /// Makes a culler without an octree. The first call builds it.
    pub const fn new() -> Self {
        let octree = Octree { min: DVec3::ZERO, max: DVec3::ZERO, nodes: Vec::new() };
        Self { solids: Solids::new(), octree, blockers: Vec::new() }
    }

    /// Returns the extended blockers of the last call, in world space, as minimum and maximum corners. Empty
    /// before the first call.
    pub fn blockers(&self) -> &[[DVec3; 2]] {
        &self.blockers
    }
}

impl RegionCuller for VolumetricCuller {
    /// Returns [`Accuracy::Conservative`].
    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    /// Removes the candidates that one blocker hides, and those for which all cells of the octree that they
    /// meet or touch are opaque or hidden. For a viewcell with planes, its whole box counts. A viewcell that
    /// is inverted or not finite removes nothing.
    fn cull(&mut self, scene: &Scene, cell: &Viewcell, visible: &mut VisibleSet) -> CullStats {
        if self.solids.sync(scene) {
            self.octree = Octree::new(&self.solids.list);
        }
        self.blockers.clear();
        let Some((min, max)) = cell_box(cell, scene.origin()) else {
            return visible.retain(scene, |_, _| true);
        };
        let occluding = occluding(scene, visible);
        let is_usable = |solid: &Solid| {
            occluding.contains(solid.id.index())
                && !solid.meets(min, max)
                && is_closed_from(&solid.blocker, min, max)
        };
        let usable: Vec<bool> = self.solids.list.iter().map(is_usable).collect();
        let mut space = Space::new(&self.octree, &usable);
        let mut umbrae = Vec::new();
        // Opaque cells, largest as seen from the viewcell first, are extended through opaque and hidden cells
        // to boxes. The umbra of each box makes further cells hidden, through which later boxes may extend.
        for leaf in space.largest(min, max) {
            if umbrae.len() == BLOCKERS {
                break;
            }
            let is_inside = |[min, max]: &[DVec3; 2]| min.cmple(leaf.min).all() && leaf.max.cmple(*max).all();
            if space.hidden[leaf.node as usize] || self.blockers.iter().any(is_inside) {
                continue;
            }
            let [low, high] = space.extended(leaf.min, leaf.max);
            if let Some(umbra) = Umbra::new(&Blocker::cuboid(low, high), min, max) {
                self.blockers.push([low, high]);
                space.hide(&umbra);
                umbrae.push(umbra);
            }
        }
        let in_hidden_space = |bounds: &Aabb| {
            bounds.is_proper() && space.is_blocked(bounds.min.as_dvec3(), bounds.max.as_dvec3(), true)
        };
        let mut stats = remove_hidden(scene, visible, &umbrae, Some(&in_hidden_space));
        stats.occluders += umbrae.len() as u64;
        self.blockers.iter_mut().flatten().for_each(|corner| *corner += scene.origin());
        stats
    }
}

/// Returns the box of child number `child` (0 to 7) of a cell. Bit k of the number says whether the child is
/// in the upper half along axis k.
fn child_box(min: DVec3, max: DVec3, child: usize) -> [DVec3; 2] {
    let middle = min * 0.5 + max * 0.5;
    let [mut low, mut high] = [min, max];
    for axis in 0..3 {
        if child >> axis & 1 != 0 { low[axis] = middle[axis] } else { high[axis] = middle[axis] }
    }
    [low, high]
}

impl Octree {
    /// Divides space around the solids: the largest cells through which a solid's surface passes are divided
    /// first.
    fn new(solids: &[Solid]) -> Self {
        let around = solids.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[min, max], solid| {
            [min.min(solid.min), max.max(solid.max)]
        });
        // If a few solids reach much farther than the others, only the space near the others is divided.
        let reach = |solid: &Solid| solid.min.abs().max(solid.max.abs()).max_element();
        let most =
            quantile(&mut solids.iter().map(reach).collect::<Vec<_>>(), 0.9).map_or(0.0, |most| most * 1.25);
        let [min, max] = around.map(|corner| corner.clamp(DVec3::splat(-most), DVec3::splat(most)));
        let behind: Vec<_> = solids.iter().map(|solid| Umbra::interior(&solid.blocker)).collect();
        // A cube, slightly larger than the solids. Its planes should not coincide with planes of solids, such
        // as a floor through its middle: a cell that touches the surface of a solid does not count as inside.
        let (middle, half) = (min * 0.5 + max * 0.5, (max - min).max_element() * 0.5);
        let mut octree = Self { min: middle - 1.017 * half, max: middle + 1.041 * half, nodes: Vec::new() };
        octree.nodes.push(Node { children: NONE, solid: NONE });
        let mut queue = alloc::collections::VecDeque::new();
        queue.push_back((0usize, [octree.min, octree.max], (0..solids.len() as u32).collect::<Vec<_>>()));
        let mut listed = solids.len();
        let most = LISTED + 16 * solids.len();
        while let Some((node, [min, max], near)) = queue.pop_front() {
            // A cell inside a solid is opaque. Any other cell that a solid meets is divided while memory
            // allows, breadth first, so that the limits prevent only the smallest cells.
            let contains =
                |&solid: &u32| behind[solid as usize].classify_box(min, max) == Containment::Inside;
            if let Some(solid) = near.iter().copied().find(contains) {
                octree.nodes[node].solid = solid;
            } else if !near.is_empty()
                && octree.nodes.len() + 8 <= NODES
                && listed + 8 * near.len() <= most
                && min.cmplt(max).all()
            {
                let first = octree.nodes.len();
                octree.nodes[node].children = first as u32;
                for child in 0..8 {
                    octree.nodes.push(Node { children: NONE, solid: NONE });
                    let [min, max] = child_box(min, max, child);
                    let meets = |&solid: &u32| solids[solid as usize].meets(min, max);
                    let near: Vec<u32> = near.iter().copied().filter(meets).collect();
                    listed += near.len();
                    queue.push_back((first + child, [min, max], near));
                }
            }
        }
        octree
    }
}

/// An opaque leaf of the octree.
struct Leaf {
    node: u32,
    min: DVec3,
    max: DVec3,
    rank: f64,
}

/// State of the octree's cells as seen from one viewcell.
struct Space<'a> {
    octree: &'a Octree,
    /// Whether each solid may occlude, by the solid's index.
    usable: &'a [bool],
    /// Whether all of each node is hidden from the viewcell, by the node's index.
    hidden: Vec<bool>,
}

impl<'a> Space<'a> {
    fn new(octree: &'a Octree, usable: &'a [bool]) -> Self {
        Self { octree, usable, hidden: alloc::vec![false; octree.nodes.len()] }
    }

    fn is_opaque(&self, node: usize) -> bool {
        self.usable.get(self.octree.nodes[node].solid as usize).is_some_and(|&usable| usable)
    }

    /// Returns the opaque leaves, first those that look largest from the box between two corners.
    fn largest(&self, min: DVec3, max: DVec3) -> Vec<Leaf> {
        let mut leaves = Vec::new();
        let mut stack = alloc::vec![(0usize, [self.octree.min, self.octree.max])];
        while let Some((node, [low, high])) = stack.pop() {
            let children = self.octree.nodes[node].children;
            if children != NONE {
                let child = |i: usize| (children as usize + i, child_box(low, high, i));
                stack.extend((0..8).map(child));
            } else if self.is_opaque(node) {
                let gap = (low - max).max(min - high).max(DVec3::ZERO);
                let rank = (high - low).length_squared() / gap.length_squared();
                leaves.push(Leaf { node: node as u32, min: low, max: high, rank });
            }
        }
        leaves.sort_unstable_by(|a, b| b.rank.total_cmp(&a.rank).then(a.node.cmp(&b.node)));
        leaves
    }

    /// Returns whether all cells that a box meets are opaque or hidden. With `closed`, cells that the box
    /// only touches count too. False for a box that reaches out of the octree.
    fn is_blocked(&self, min: DVec3, max: DVec3, closed: bool) -> bool {
        let root = [self.octree.min, self.octree.max];
        root[0].cmple(min).all()
            && max.cmple(root[1]).all()
            && self.is_blocked_in(0, root, [min, max], closed)
    }

    fn is_blocked_in(&self, node: usize, [low, high]: [DVec3; 2], part: [DVec3; 2], closed: bool) -> bool {
        let [min, max] = part;
        let apart = if closed {
            low.cmpgt(max).any() || min.cmpgt(high).any()
        } else {
            low.cmpge(max).any() || min.cmpge(high).any()
        };
        if apart || self.hidden[node] || self.is_opaque(node) {
            return true;
        }
        let children = self.octree.nodes[node].children;
        children != NONE
            && (0..8)
                .all(|i| self.is_blocked_in(children as usize + i, child_box(low, high, i), part, closed))
    }

    /// Extends a box of opaque space on one side after another, by slabs that are opaque or hidden all
    /// through. Each slab is tested over the whole side that the box has by then. Two sides are not extended
    /// at once, since the space at the edge between the two slabs would not be tested.
    fn extended(&self, min: DVec3, max: DVec3) -> [DVec3; 2] {
        let size = max - min;
        let mut bounds = [min, max];
        let mut grew = true;
        while grew {
            grew = false;
            for side in 0..6 {
                let (axis, upper) = (side % 3, side / 3);
                let mut by = size[axis];
                loop {
                    let (mut slab, mut wider) = (bounds, bounds);
                    slab[1 - upper][axis] = bounds[upper][axis];
                    slab[upper][axis] += if upper == 1 { by } else { -by };
                    wider[upper][axis] = slab[upper][axis];
                    // A slab without volume would prove nothing, and the loop would not end.
                    if !(slab[0].cmplt(slab[1]).all() && self.is_blocked(slab[0], slab[1], false)) {
                        break;
                    }
                    (bounds, grew) = (wider, true);
                    by *= 2.0;
                }
            }
        }
        bounds
    }

    /// Marks the cells that an umbra contains as hidden.
    fn hide(&mut self, umbra: &Umbra) {
        let root = [self.octree.min, self.octree.max];
        self.hide_in(0, root, umbra);
    }

    fn hide_in(&mut self, node: usize, [min, max]: [DVec3; 2], umbra: &Umbra) {
        if self.hidden[node] {
            return;
        }
        match umbra.classify_box(min, max) {
            Containment::Inside => self.hidden[node] = true,
            Containment::Outside => {}
            Containment::Crossing => {
                let children = self.octree.nodes[node].children;
                if children != NONE {
                    let first = children as usize;
                    (0..8).for_each(|i| self.hide_in(first + i, child_box(min, max, i), umbra));
                    self.hidden[node] = self.hidden[first..first + 8].iter().all(|&hidden| hidden);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::Affine3A;
    use visibility_core::{Object, OccluderMesh};

    fn space_of(boxes: &[([f32; 3], [f32; 3])]) -> Octree {
        let mut scene = Scene::new();
        for &(min, max) in boxes {
            let bounds = Aabb::from_arrays(min, max);
            let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        }
        let mut solids = Solids::new();
        solids.sync(&scene);
        Octree::new(&solids.list)
    }

    #[test]
    fn blockers_grow_through_opaque_space_only() {
        // An L of two boxes: a blocker must not take the corner between its legs.
        let octree = space_of(&[([0.0, 0.0, 0.0], [16.0, 4.0, 8.0]), ([0.0, 3.0, 0.0], [4.0, 16.0, 8.0])]);
        let usable = [true; 2];
        let space = Space::new(&octree, &usable);
        for leaf in space.largest(DVec3::splat(-9.0), DVec3::splat(-8.0)).iter().take(500) {
            let [min, max] = space.extended(leaf.min, leaf.max);
            assert!(
                min.cmple(leaf.min).all() && leaf.max.cmple(max).all(),
                "the blocker {min} to {max} holds its leaf"
            );
            assert!(min.min_element() > 0.0 && max.z < 8.0, "{min} {max}");
            assert!(max.x < 4.0 || max.y < 4.0, "{min} {max} holds the corner");
        }
        let most = space.extended(DVec3::new(2.0, 1.0, 3.0), DVec3::new(2.5, 1.5, 3.5));
        let size = most[1] - most[0];
        assert!(size.max_element() > 12.0 && size.z > 6.0, "{size}");
    }

    /// Returns an octree of eight cells in the box from 0 to 2, without solids.
    fn eight_cells() -> Octree {
        let mut nodes = alloc::vec![Node { children: NONE, solid: NONE }; 9];
        nodes[0].children = 1;
        Octree { min: DVec3::ZERO, max: DVec3::splat(2.0), nodes }
    }

    /// Returns a box of which the given axis has another range than the others, which lie in one cell.
    fn along(axis: usize, low: f64, high: f64) -> [DVec3; 2] {
        let mut bounds = [DVec3::splat(0.2), DVec3::splat(0.8)];
        (bounds[0][axis], bounds[1][axis]) = (low, high);
        bounds
    }

    /// A box is blocked if all cells are that it meets, and with their borders those that it touches, and if
    /// it is in the octree.
    #[test]
    fn boxes_are_blocked_by_the_cells_that_they_meet() {
        let octree = eight_cells();
        for axis in 0..3 {
            for upper in [false, true] {
                let mut space = Space::new(&octree, &[]);
                // Four cells on one side are hidden.
                (0..8).for_each(|child| space.hidden[1 + child] = (child >> axis & 1 != 0) == upper);
                let within = |low: f64, high: f64| {
                    let [min, max] =
                        if upper { along(axis, 2.0 - high, 2.0 - low) } else { along(axis, low, high) };
                    [true, false].map(|closed| space.is_blocked(min, max, closed))
                };
                let case = (axis, upper);
                assert_eq!(within(0.25, 0.75), [true; 2], "{case:?}: a box in a hidden cell");
                assert_eq!(within(0.25, 1.0), [false, true], "{case:?}: a box that touches another cell");
                assert_eq!(within(0.25, 1.0f64.next_up()), [false; 2], "{case:?}: a box that meets another");
                assert_eq!(within(1.0, 1.5), [false; 2], "{case:?}: a box in a cell that is not hidden");
                assert_eq!(within(0.0, 0.5), [true; 2], "{case:?}: a box up to the side of the octree");
                assert_eq!(within(-1e-9, 0.5), [false; 2], "{case:?}: a box beyond the octree");
            }
        }
    }

    /// A box without volume is not extended, and one in hidden space up to the sides of the octree at most.
    #[test]
    fn boxes_are_extended_within_the_octree() {
        let octree = eight_cells();
        let mut space = Space::new(&octree, &[]);
        space.hidden[0] = true;
        let bounds = [DVec3::ONE, DVec3::splat(1.25)];
        let [min, max] = space.extended(bounds[0], bounds[1]);
        assert_eq!([min, max], [DVec3::ZERO, DVec3::splat(2.0)], "all of the octree");
        for axis in 0..3 {
            let flat = along(axis, 1.0, 1.0);
            assert_eq!(space.extended(flat[0], flat[1]), flat, "a box without volume");
        }
    }

    /// Cells that no solid meets are not divided, and there are no more of them than may be.
    #[test]
    fn only_cells_that_meet_solids_are_divided() {
        let octree = space_of(&[([0.0; 3], [1.0; 3]), ([30.0; 3], [31.0; 3])]);
        assert!(octree.nodes.len() > 10_000 && octree.nodes.len() <= NODES, "{} cells", octree.nodes.len());
        let mut stack = alloc::vec![(0usize, [octree.min, octree.max])];
        while let Some((node, [min, max])) = stack.pop() {
            let Node { children, solid } = octree.nodes[node];
            let meets =
                |low: f64| max.cmpge(DVec3::splat(low)).all() && min.cmple(DVec3::splat(low + 1.0)).all();
            let is_near = meets(0.0) || meets(30.0);
            assert!(children == NONE || is_near && solid == NONE, "{min} to {max} is divided");
            if children != NONE {
                stack.extend((0..8).map(|i| (children as usize + i, child_box(min, max, i))));
            }
        }
    }

    /// Leaves come by the square of their size in that of their distance.
    #[test]
    fn large_leaves_nearby_come_first() {
        let octree = space_of(&[([0.0; 3], [8.0; 3]), ([20.0, 0.0, 0.0], [21.0, 8.0, 8.0])]);
        let space = Space::new(&octree, &[true; 2]);
        for cell in [[-9.0, -8.0], [30.0, 31.0]] {
            let [min, max] = cell.map(|x| DVec3::new(x, 3.0, 3.0));
            let leaves = space.largest(min, max);
            assert!(leaves.len() > 100, "{} leaves", leaves.len());
            let rank = |leaf: &Leaf| {
                let gap = (leaf.min.x - max.x).max(min.x - leaf.max.x);
                let aside = [1, 2].map(|i| (leaf.min[i] - 3.0).max(3.0 - leaf.max[i]).max(0.0));
                let gap = gap * gap + aside[0] * aside[0] + aside[1] * aside[1];
                (leaf.max - leaf.min).length_squared() / gap
            };
            for pair in leaves.windows(2) {
                let [a, b] = [rank(&pair[0]), rank(&pair[1])];
                assert!(a >= b * (1.0 - 1e-12), "a leaf of {a} before one of {b}, from {cell:?}");
            }
        }
    }

    /// Returns which of some small boxes solids leave visible from a viewcell, and the blockers.
    fn seen(
        solids: &[OccluderMesh],
        [min, max]: [DVec3; 2],
        small: &[Aabb],
        change: impl Fn(&mut Scene, visibility_core::ObjectId),
    ) -> (Vec<bool>, Vec<[DVec3; 2]>) {
        let mut scene = Scene::new();
        for mesh in solids {
            let id = scene.insert(Object { occluder: true, ..Object::new(*mesh.bounds()) });
            let mesh = scene.add_mesh(mesh.clone());
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
            change(&mut scene, id);
        }
        let ids: Vec<_> = small.iter().map(|bounds| scene.insert(*bounds)).collect();
        let (mut visible, mut culler) = (VisibleSet::new(), VolumetricCuller::new());
        culler.cull(&scene, &Viewcell::from_box(min, max), &mut visible);
        (ids.iter().map(|&id| visible.contains(&scene, id)).collect(), culler.blockers().to_vec())
    }

    fn cuboid(min: [f32; 3], max: [f32; 3]) -> OccluderMesh {
        OccluderMesh::cuboid(&Aabb::from_arrays(min, max)).unwrap()
    }

    /// Solids hide if they are always drawn, do not meet the viewcell, and do not show it a hole.
    #[test]
    fn solids_that_may_be_open_or_absent_hide_nothing() {
        let house = cuboid([0.0; 3], [8.0; 3]);
        let small = |x: f32| Aabb::from_arrays([x, 4.0, 4.0], [x + 0.1, 4.1, 4.1]);
        let (within, behind) = (small(6.0), small(9.0));
        let cell = |low: f64, high: f64| [DVec3::new(low, 3.9, 3.9), DVec3::new(high, 4.1, 4.1)];
        let unchanged = |_: &mut Scene, _| {};
        let of = |house: &OccluderMesh, cell: [DVec3; 2]| {
            seen(core::slice::from_ref(house), cell, &[within, behind], unchanged).0
        };
        assert_eq!(of(&house, cell(-4.0, -3.0)), [false, false], "within the house and behind it");
        assert_eq!(of(&house, cell(-4.0, 0.0)), [true, true], "from a cell that touches the house");
        assert_eq!(of(&house, cell(1.0, 2.0)), [true, true], "from a cell in the house");
        for change in visibility_testing::NOT_ALWAYS_DRAWN {
            let seen = seen(core::slice::from_ref(&house), cell(-4.0, -3.0), &[within, behind], change).0;
            assert_eq!(seen, [true, true], "a house that may not be there");
        }
        let sides = house.triangles().iter().map(|t| t.map(|i| house.positions()[i as usize]));
        let open: Vec<_> = sides.filter(|t| t.iter().any(|p| p.x > 0.0)).collect();
        let open = OccluderMesh::from_triangles(&open).unwrap();
        assert_eq!(of(&open, cell(-4.0, -3.0)), [true, true], "through the side that is missing");
        assert!(!of(&open, cell(12.0, 13.0))[0], "from the other side");
    }

    /// Blockers begin in leaves that are in no other blocker and are not hidden.
    #[test]
    fn blockers_are_made_where_none_is() {
        let solids = [
            cuboid([10.0, -8.0, -8.0], [14.0, 8.0, 8.0]),
            cuboid([20.0, -2.0, -2.0], [22.0, 2.0, 2.0]),
            cuboid([-14.0, -8.0, -8.0], [-10.0, 8.0, 8.0]),
            cuboid([-8.0, 10.0, -8.0], [8.0, 14.0, 8.0]),
        ];
        let small = |at: [f32; 3]| Aabb::from_arrays(at, at.map(|x| x + 0.1));
        let hidden = [[16.0, 0.0, 0.0], [-16.0, 0.0, 0.0], [0.0, 16.0, 0.0]].map(small);
        let cell = [DVec3::splat(-0.5), DVec3::splat(0.5)];
        let (seen, blockers) = seen(&solids, cell, &hidden, |_, _| {});
        assert_eq!(seen, [false; 3], "behind each of three walls");
        assert!(blockers.len() < BLOCKERS, "{} blockers", blockers.len());
        let umbra = Umbra::new(
            &Blocker::cuboid(DVec3::new(10.0, -8.0, -8.0), DVec3::new(14.0, 8.0, 8.0)),
            cell[0],
            cell[1],
        );
        let umbra = umbra.unwrap();
        for (i, [min, max]) in blockers.iter().enumerate() {
            assert!(
                umbra.classify_box(*min, *max) != Containment::Inside || min.x < 14.0,
                "{min} to {max} is hidden"
            );
            let around =
                blockers[..i].iter().filter(|[low, high]| low.cmple(*min).all() && max.cmple(*high).all());
            assert_eq!(around.count(), 0, "{min} to {max} is in another blocker");
        }
    }

    #[test]
    fn unusable_solids_are_not_opaque() {
        let octree = space_of(&[([0.0; 3], [8.0; 3])]);
        assert!(
            Space::new(&octree, &[false]).largest(DVec3::ZERO, DVec3::ONE).is_empty(),
            "a solid that may not be used is opaque"
        );
        let space = Space::new(&octree, &[true]);
        assert!(space.is_blocked(DVec3::splat(3.0), DVec3::splat(4.0), true), "a box within the solid");
        assert!(!space.is_blocked(DVec3::splat(3.0), DVec3::splat(8.0), true), "the surface is not opaque");
        assert!(!space.is_blocked(DVec3::splat(3.0), DVec3::splat(80.0), true), "nor is what is outside");
    }

    #[test]
    fn cells_list_few_solids_in_all() {
        // The surfaces of all solids pass the same cells.
        let boxes: Vec<_> = (0..2000).map(|i| ([0.0; 3], [8.0 + i as f32 * 1e-5; 3])).collect();
        let octree = space_of(&boxes);
        assert!((9..8 * LISTED / boxes.len()).contains(&octree.nodes.len()), "{}", octree.nodes.len());
        assert!(space_of(&boxes[..1]).nodes.len() > 10_000, "one solid divides the space further");
    }
}
