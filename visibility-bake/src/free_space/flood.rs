//! Flood fill of free voxels through their faces, box by box of a grid.
//!
//! A path of the camera is in voxels that touch no surface, and passes from voxel to voxel through common
//! faces. Where it passes through an edge or a corner, it touches the voxels beside it too, so these are also
//! free. A flood of free voxels through faces therefore reaches every position that a path of the camera
//! reaches.

use super::solid_triangles::SolidTriangles;
use super::voxel_set::{VoxelSet, voxel_number, voxel_place};
use crate::grid::{Grid, GridError};
use std::collections::hash_map::Entry;
use std::collections::{HashMap, VecDeque};
use visibility_core::glam::DVec3;

/// Greatest number of voxels in all boxes of a flood together. At two bits each they take two gigabytes. A
/// flood that needs more fails with [`GridError::TooMany`].
const ALL_VOXELS: u64 = 1 << 33;

/// A flood fill within the [limits](SolidTriangles::limits) of solid triangles.
pub(super) struct Flood<'a> {
    solids: &'a SolidTriangles<'a>,
    /// State of the voxels of each box that was entered, by the box's [place](crate::grid).
    boxes: HashMap<[i64; 3], BoxVoxels>,
    /// Places of the boxes with [`entered`](BoxVoxels::entered) voxels, in the order in which they are
    /// processed.
    queue: VecDeque<[i64; 3]>,
    /// Places of the boxes that the flood has reached, in the order of reaching them.
    reached: Vec<[i64; 3]>,
}

/// State of the voxels of a box.
struct BoxVoxels {
    /// Voxels where the camera can be and that the flood has not reached yet.
    open: VoxelSet,
    /// Voxels that the flood has reached.
    reached: VoxelSet,
    /// Numbers of the voxels from which the flood is still to spread. They were open when they were added.
    entered: Vec<u32>,
    /// Whether the box is in [`Flood::reached`].
    is_reached: bool,
}

impl<'a> Flood<'a> {
    pub(super) fn new(solids: &'a SolidTriangles<'a>) -> Self {
        Self { solids, boxes: HashMap::new(), queue: VecDeque::new(), reached: Vec::new() }
    }

    /// Starts the flood at the free voxel nearest to `point`, within the limits and within the point's box.
    /// Does nothing if the box has no free voxel.
    ///
    /// # Errors
    /// [`GridError::TooMany`] if the point has no [place](Grid::place), or if the flood has too many boxes or
    /// voxels.
    pub(super) fn start(&mut self, point: DVec3) -> Result<(), GridError> {
        let solids = self.solids;
        let mut place = solids.grid.place(point)?;
        (0..3).for_each(|axis| place[axis] = place[axis].min(solids.limits[1][axis]));
        let (counts, edge) = (solids.counts, solids.voxel_size());
        let corner = solids.grid.cell(place).min;
        let voxels = self.voxels(place)?;
        let distance = |&voxel: &usize| {
            let at = DVec3::from_array(voxel_place(voxel, counts).map(|at| at as f64 + 0.5));
            (corner + at * edge).distance_squared(point)
        };
        let is_free = |&voxel: &usize| voxels.open.contains(voxel) || voxels.reached.contains(voxel);
        let free = voxels.open.all().filter(is_free);
        match free.min_by(|a, b| distance(a).total_cmp(&distance(b))) {
            Some(voxel) => self.enter(place, [voxel as u32]),
            None => Ok(()),
        }
    }

    /// Runs the flood to its end. Returns the places of the reached boxes, in order, with the reached voxels
    /// of each.
    ///
    /// # Errors
    /// [`GridError::TooMany`] if the flood has too many boxes or voxels.
    pub(super) fn run(mut self) -> Result<Vec<([i64; 3], VoxelSet)>, GridError> {
        while let Some(place) = self.queue.pop_front() {
            self.solids.grid.stop.check(0)?;
            self.spread(place)?;
        }
        let voxels = |place| Some((place, self.boxes.remove(&place)?.reached));
        Ok(self.reached.into_iter().filter_map(voxels).collect())
    }

    /// Marks voxels of a box as reached from outside: adds each voxel of `entered` that is
    /// [open](BoxVoxels::open) to the box's [`entered`](BoxVoxels::entered) list, and puts the box into the
    /// queue.
    fn enter(&mut self, place: [i64; 3], entered: impl IntoIterator<Item = u32>) -> Result<(), GridError> {
        let voxels = self.voxels(place)?;
        let is_queued = !voxels.entered.is_empty();
        let is_open = |voxel: &u32| voxels.open.contains(*voxel as usize);
        voxels.entered.extend(entered.into_iter().filter(is_open));
        if !is_queued && !voxels.entered.is_empty() {
            if !voxels.is_reached {
                voxels.is_reached = true;
                self.reached.push(place);
            }
            self.queue.push_back(place);
        }
        Ok(())
    }

    /// Floods a box from its entered voxels, and enters the voxels beyond the box's faces.
    fn spread(&mut self, place: [i64; 3]) -> Result<(), GridError> {
        let counts = self.solids.counts;
        let Some(voxels) = self.boxes.get_mut(&place) else { return Ok(()) };
        // For each side of the box (lower and upper x, y and z), the voxels to enter beyond it.
        let mut beyond: [Vec<u32>; 6] = Default::default();
        let entered = std::mem::take(&mut voxels.entered);
        // Connected voxels come as runs along x, from `at` to `last`.
        voxels.open.take_connected(entered, |at, last| {
            let run = voxel_number(at, counts)..=voxel_number([last, at[1], at[2]], counts);
            run.for_each(|voxel| voxels.reached.insert(voxel));
            if at[0] == 0 {
                beyond[0].push(voxel_number([counts[0] - 1, at[1], at[2]], counts) as u32);
            }
            if last + 1 == counts[0] {
                beyond[1].push(voxel_number([0, at[1], at[2]], counts) as u32);
            }
            for axis in 1..3 {
                let mut add = |side: usize, opposite: usize| {
                    let mut other = at;
                    other[axis] = opposite;
                    let first = voxel_number(other, counts) as u32;
                    beyond[axis * 2 + side].extend(first..=first + (last - at[0]) as u32);
                };
                if at[axis] == 0 {
                    add(0, counts[axis] - 1);
                }
                if at[axis] + 1 == counts[axis] {
                    add(1, 0);
                }
            }
        });
        // Boxes beyond the grid's limits are not flooded.
        let [first, last] = self.solids.limits;
        for (side, entered) in beyond.into_iter().enumerate() {
            let (axis, mut other) = (side / 2, place);
            other[axis] += if side % 2 == 0 { -1 } else { 1 };
            if (first[axis]..=last[axis]).contains(&other[axis]) && !entered.is_empty() {
                self.enter(other, entered)?;
            }
        }
        Ok(())
    }

    /// Returns the state of a box's voxels, which is created at the first call for the box.
    fn voxels(&mut self, place: [i64; 3]) -> Result<&mut BoxVoxels, GridError> {
        let (solids, box_count) = (self.solids, self.boxes.len());
        match self.boxes.entry(place) {
            Entry::Occupied(known) => Ok(known.into_mut()),
            Entry::Vacant(new) => {
                let voxels =
                    (box_count as u64 + 1).saturating_mul(solids.counts.iter().product::<usize>() as u64);
                if voxels > ALL_VOXELS || box_count >= Grid::LIMIT {
                    return Err(GridError::TooMany);
                }
                let open = solids.free_voxels(place);
                let reached = VoxelSet::empty(solids.counts);
                Ok(new.insert(BoxVoxels { open, reached, entered: Vec::new(), is_reached: false }))
            }
        }
    }
}
