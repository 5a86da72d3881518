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
                let rank = (high - low).length_squared() / gap.length_squared().max(f64::MIN_POSITIVE);
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
