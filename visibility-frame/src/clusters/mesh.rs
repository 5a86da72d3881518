//! The clusters of one mesh, in a hierarchy that all instances of the mesh share.

use crate::backface::{Cones64, NormalCone};
use alloc::vec::Vec;
use core::ops::Range;
use visibility_core::Aabb;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::scene::{Boxes64, FAN_OUT, morton_order};

/// Boxes and normal cones of the clusters of a mesh, in mesh coordinates, in blocks of 64 along a
/// space-filling curve. One value serves all instances of the mesh and all threads: share it by reference or
/// by `Arc`.
///
/// Memory: 80 bytes per cluster, rounded up to blocks of 64 clusters, and 24 bytes per block.
///
/// ```
/// use visibility_core::glam::Vec3;
/// use visibility_frame::{backface::cluster_mesh, clusters::ClusterMesh};
/// // Clusters of this crate or of meshoptimizer, each with the box and the cone of its triangles.
/// let clusters = cluster_mesh(&[Vec3::ZERO, Vec3::X, Vec3::Y], &[[0, 1, 2]])?;
/// let mesh = ClusterMesh::new(clusters.iter().map(|cluster| (cluster.bounds, cluster.cone)));
/// assert_eq!(mesh.len(), 1);
/// # Ok::<(), visibility_frame::backface::ClusterError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ClusterMesh {
    /// Boxes of all levels, leaves first. Lane `i` of block `b` of a level holds the hull of block `64 b +
    /// i` of the level below; at the leaves, the box of a cluster.
    boxes: Vec<Boxes64>,
    /// Index in `boxes` of the first block of each level, leaves first. Empty without clusters.
    levels: Vec<usize>,
    /// Cones of the clusters, one block for each leaf block.
    cones: Vec<Cones64>,
    /// Number of each cluster in the caller's order: that of lane `i` of leaf block `b` is at `64 b + i`.
    clusters: Vec<u32>,
    /// Greatest magnitude of each coordinate of the finite boxes, in mesh units.
    reach: DVec3,
}

impl ClusterMesh {
    /// Builds the hierarchy of fewer than 2^32 clusters, each given by the bounding box and the normal cone
    /// of its triangles in mesh coordinates. Clusters are numbered from 0 in the order given.
    ///
    /// A cluster with an inverted, NaN or infinite box is never dropped. Clusters that are drawn two-sided
    /// must have [`NormalCone::OPEN`]. Cost: `n log n` for `n` clusters.
    pub fn new(clusters: impl IntoIterator<Item = (Aabb, NormalCone)>) -> Self {
        let given: Vec<(Aabb, NormalCone)> = clusters.into_iter().collect();
        let center = |bounds: &Aabb| if bounds.is_finite() { bounds.center() } else { Vec3::ZERO };
        let order = morton_order(given.iter().map(|(bounds, _)| center(bounds)));

        let (mut boxes, mut cones) = (Vec::new(), Vec::new());
        let mut reach = Vec3::ZERO;
        for block in order.chunks(FAN_OUT) {
            let (mut block_boxes, mut block_cones) = (Boxes64::EMPTY, Cones64::OPEN);
            for (lane, &cluster) in block.iter().enumerate() {
                let (bounds, cone) = given[cluster as usize];
                if bounds.is_finite() {
                    reach = reach.max(bounds.min.abs()).max(bounds.max.abs());
                    block_boxes.set(lane, &bounds);
                    block_cones.set(lane, &cone);
                } else {
                    block_boxes.set(lane, &Aabb::new(Vec3::NEG_INFINITY, Vec3::INFINITY));
                }
            }
            boxes.push(block_boxes);
            cones.push(block_cones);
        }
        let levels = add_levels(&mut boxes);
        Self { boxes, levels, cones, clusters: order, reach: reach.as_dvec3() }
    }

    /// Returns the number of clusters.
    pub fn len(&self) -> usize {
        self.clusters.len()
    }

    /// Returns whether the mesh has no cluster.
    pub fn is_empty(&self) -> bool {
        self.clusters.is_empty()
    }

    /// Returns the bytes of memory that the mesh uses on the heap.
    pub fn memory(&self) -> usize {
        size_of_val(&self.boxes[..])
            + size_of_val(&self.levels[..])
            + size_of_val(&self.cones[..])
            + size_of_val(&self.clusters[..])
    }

    /// Returns the number of levels of blocks, 0 without clusters.
    pub(super) fn level_count(&self) -> usize {
        self.levels.len()
    }

    /// Returns the boxes of a block, and a mask of its lanes in use. At level 0 a box is that of a cluster,
    /// at other levels that of a block of the level below.
    pub(super) fn block(&self, level: usize, block: usize) -> (&Boxes64, u64) {
        let below = match level {
            0 => self.clusters.len(),
            _ => self.level(level - 1).len(),
        };
        let used = (below - FAN_OUT * block).min(FAN_OUT);
        (&self.boxes[self.levels[level] + block], u64::MAX >> (FAN_OUT - used))
    }

    /// Returns the range of a level's blocks in `boxes`.
    fn level(&self, level: usize) -> Range<usize> {
        self.levels[level]..self.levels.get(level + 1).copied().unwrap_or(self.boxes.len())
    }

    /// Returns the cones of a leaf block, lane by lane.
    pub(super) fn cones(&self, block: usize) -> &Cones64 {
        &self.cones[block]
    }

    /// Returns the numbers of the clusters of a leaf block, in the order of its lanes.
    pub(super) fn clusters_of(&self, block: usize) -> &[u32] {
        let first = FAN_OUT * block;
        &self.clusters[first..self.clusters.len().min(first + FAN_OUT)]
    }

    /// Returns the greatest magnitude of each coordinate of the finite boxes, in mesh units.
    pub(super) fn reach(&self) -> DVec3 {
        self.reach
    }
}

/// Appends the levels above the leaf blocks until a level has a single block. Returns the index of the first
/// block of each level.
fn add_levels(boxes: &mut Vec<Boxes64>) -> Vec<usize> {
    let mut levels = Vec::new();
    let mut level = 0..boxes.len();
    while !level.is_empty() {
        levels.push(level.start);
        if level.len() == 1 {
            break;
        }
        let next = level.end;
        for first in level.clone().step_by(FAN_OUT) {
            let mut block = Boxes64::EMPTY;
            let children = &boxes[first..level.end.min(first + FAN_OUT)];
            children.iter().enumerate().for_each(|(lane, child)| block.set(lane, &child.hull()));
            boxes.push(block);
        }
        level = next..boxes.len();
    }
    levels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_hold_all_clusters_and_the_reach_is_that_of_the_farthest() {
        let count = FAN_OUT * FAN_OUT + 70;
        let boxes = (0..count).map(|i| Aabb::from_arrays([i as f32 - 9.0, -8.0, 0.5], [i as f32, 3.0, 1.0]));
        let mesh = ClusterMesh::new(boxes.map(|bounds| (bounds, NormalCone::OPEN)));
        assert_eq!(mesh.reach(), DVec3::new(count as f64 - 1.0, 8.0, 1.0), "the greatest coordinates");
        assert_eq!(mesh.level_count(), 3, "levels of {count} clusters");
        let blocks = [count.div_ceil(FAN_OUT), 2, 1];
        for (level, blocks) in blocks.into_iter().enumerate() {
            let used =
                (0..blocks).map(|block| mesh.block(level, block).1.count_ones() as usize).sum::<usize>();
            let below = if level == 0 { count } else { [count.div_ceil(FAN_OUT), 2][level - 1] };
            assert_eq!(used, below, "lanes of level {level}");
        }
        let mut all: Vec<u32> = (0..blocks[0]).flat_map(|block| mesh.clusters_of(block).to_vec()).collect();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..count as u32), "each cluster once");
    }
}
