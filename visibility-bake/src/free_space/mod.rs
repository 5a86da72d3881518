//! Viewcells where a camera can be: by a flood of free space from given points, in the free space along
//! walks, or above walkable triangles.
//!
//! Free space consists of voxels ([`solid_triangles`]), and a flood goes from box to box of the grid
//! ([`flood`]). A box that walls divide has a viewcell for each part that is reached ([`viewcell_parts`]).

mod camera_range;
mod flood;
mod solid_triangles;
mod triangle_columns;
mod viewcell_parts;
mod voxel_set;
mod walkable;

pub use camera_range::CameraRange;

use crate::grid::{Grid, GridError};
use flood::Flood;
use solid_triangles::SolidTriangles;
use std::collections::HashMap;
use viewcell_parts::add_viewcells;
use visibility_core::Scene;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use voxel_set::{voxel_number, voxel_place};

impl Grid {
    /// Returns the viewcells that a camera can reach from some points. They are boxes of the grid. Where
    /// solid surfaces separate a part of a box from the positions of the camera, that part is cut off. The
    /// viewcells of the points come first, then the others in the order in which a flood from the points
    /// reaches them. The triangles of objects flagged as occluders, [as a
    /// level](visibility_core::level_version::level_object) has them, are solid. The flood does not leave the
    /// box from `min` to `max`; points outside it are ignored. A point where the camera cannot be is replaced
    /// by the nearest point in the same box of the grid where it can be. A point in a box without any
    /// position for the camera is ignored.
    ///
    /// The viewcells contain every position in the box that the camera can reach without coming closer to a
    /// solid surface than the [radius](CameraRange::radius) and without leaving the
    /// [heights](CameraRange::heights). Time and memory are proportional to the flooded volume divided by the
    /// cube of the radius.
    ///
    /// # Errors
    /// [`GridError::Radius`] if the radius is not positive, or less than about a hundredth of a viewcell;
    /// [`GridError::TooMany`] if `min` or `max` is not finite, or if too much memory would be needed;
    /// [`GridError::Stopped`] if the function of [`with_stop`](Grid::with_stop) returned true.
    ///
    /// ```
    /// use visibility_bake::{CameraRange, Grid};
    /// use visibility_core::{glam::{DVec3, Vec3}, Aabb, Object, Scene};
    /// // A floor of 12 m, and a wall across it.
    /// let floor = [[0.0, 0.0, 0.0], [12.0, 0.0, 0.0], [12.0, 2.0, 0.0], [0.0, 2.0, 0.0]];
    /// let wall = [[7.0, 0.0, 0.0], [7.0, 2.0, 0.0], [7.0, 2.0, 4.0], [7.0, 0.0, 4.0]];
    /// let mut scene = Scene::new();
    /// for corners in [floor, wall] {
    ///     let [a, b, c, d] = corners.map(Vec3::from_array);
    ///     let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_points([a, b, c, d])) });
    ///     scene.set_triangles(id, [[a, b, c], [a, c, d]])?;
    /// }
    /// let grid = Grid::new(DVec3::ZERO, DVec3::new(2.0, 2.0, 2.0))?;
    /// let eye = DVec3::new(1.0, 1.0, 1.7);
    /// let box_of_all = (DVec3::ZERO, DVec3::new(12.0, 2.0, 4.0));
    /// let cells = grid.free(&scene, &[eye], &CameraRange::default(), box_of_all.0, box_of_all.1)?;
    /// // Four along the floor up to the wall, on each of two storeys of viewcells.
    /// assert_eq!(cells.len(), 8);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn free(
        &self,
        scene: &Scene,
        from: &[DVec3],
        camera: &CameraRange,
        min: DVec3,
        max: DVec3,
    ) -> Result<Vec<Viewcell>, GridError> {
        if !min.is_finite() || !max.is_finite() {
            return Err(GridError::TooMany);
        }
        if !min.cmple(max).all() {
            return Ok(Vec::new());
        }
        let solids = SolidTriangles::new(self, scene, camera, [min, max])?;
        let mut flood = Flood::new(&solids);
        for &point in from {
            if min.cmple(point).all() && point.cmple(max).all() {
                flood.start(point)?;
            }
        }
        let mut all = Vec::new();
        for (place, mut reached) in flood.run()? {
            let parts = reached.all().filter_map(|voxel| reached.take_part(voxel));
            add_viewcells(&solids, place, parts, &mut all)?;
        }
        Ok(all)
    }

    /// Returns the viewcells through which walks pass, those of the first walk first. A walk goes in straight
    /// lines from point to point. A viewcell is a box of the grid, cut off at solid surfaces that separate
    /// the rest of the box from the walks. Solid is what it is for [`free`](Self::free). Every point of a box
    /// within the [radius](CameraRange::radius) of the part of a walk in that box stays in the viewcell, also
    /// where the walk passes through a solid. The heights of the camera do not count. A radius below a 40th
    /// of the longest side of a box counts as a 40th.
    ///
    /// # Errors
    /// [`GridError::Count`] for more viewcells than [`LIMIT`](Grid::LIMIT), where a viewcell counts as often
    /// as it is passed; [`GridError::TooMany`] if a walk is not finite, or if too much memory would be
    /// needed; [`GridError::Stopped`] if the function of [`with_stop`](Grid::with_stop) returned true.
    ///
    /// ```
    /// use visibility_bake::{CameraRange, Grid};
    /// use visibility_core::{glam::{DVec3, Vec3}, Aabb, Object, Scene};
    /// // A wall across the box of the grid.
    /// let ends = [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)];
    /// let [a, b, c, d] = ends.map(|(y, z)| Vec3::new(3.0, y, z));
    /// let mut scene = Scene::new();
    /// let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_points([a, b, c, d])) });
    /// scene.set_triangles(id, [[a, b, c], [a, c, d]])?;
    /// let grid = Grid::new(DVec3::ZERO, DVec3::splat(4.0))?;
    /// let cells = grid.along_free(&scene, [&[DVec3::ONE][..]], &CameraRange::default())?;
    /// assert!(cells[0].min == DVec3::ZERO && (2.99..3.0).contains(&cells[0].max.x));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn along_free<'a>(
        &self,
        scene: &Scene,
        walks: impl IntoIterator<Item = &'a [DVec3]>,
        camera: &CameraRange,
    ) -> Result<Vec<Viewcell>, GridError> {
        let least = self.size.max_element() / 40.0;
        let camera = CameraRange { radius: camera.radius.max(least), heights: None, ..*camera };
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let walks: Vec<&[DVec3]> = walks.into_iter().collect();
        for &point in walks.iter().copied().flatten() {
            (min, max) = (min.min(point), max.max(point));
        }
        if walks.iter().all(|walk| walk.is_empty()) {
            return Ok(Vec::new());
        }
        // Checked first, before anything takes time: a walk may pass through more boxes than can be kept.
        let counted = walks.iter().try_fold(0, |sum, walk| Ok(sum + self.count_passed(walk)?))?;
        Self::check_count(counted)?;
        let solids = SolidTriangles::new(self, scene, &camera, [min, max])?;
        let (counts, voxel_size) = (solids.counts, solids.voxel_size());
        let fine = Grid { size: voxel_size, ..*self };
        // Places of the boxes through which walks pass, and for each place the numbers of the voxels passed.
        let (mut places, mut passed) = (Vec::new(), HashMap::new());
        for walk in walks {
            for place in self.passed(walk)? {
                passed.entry(place).or_insert_with(|| {
                    places.push(place);
                    Vec::new()
                });
            }
            let is_too_many = |error| matches!(error, GridError::Count { .. });
            let voxels = fine.passed(walk);
            for voxel in
                voxels.map_err(|error| if is_too_many(error) { GridError::TooMany } else { error })?
            {
                let axes = [0, 1, 2];
                let place = axes.map(|axis| voxel[axis].div_euclid(counts[axis] as i64));
                let inside = axes.map(|axis| voxel[axis].rem_euclid(counts[axis] as i64) as usize);
                // Voxels of other boxes only touch the walk from outside, and are not recorded.
                if let Some(voxels) = passed.get_mut(&place) {
                    voxels.push(voxel_number(inside, counts));
                }
            }
        }
        // Number of voxels that the radius spans on each axis.
        let around = (camera.radius / voxel_size).ceil().to_array().map(|count| count as usize);
        let mut all = Vec::new();
        for place in places {
            self.stop.check(0)?;
            let mut left = passed.remove(&place).unwrap_or_default();
            if left.is_empty() {
                all.push(self.cell(place));
                continue;
            }
            let mut free = solids.free_voxels(place);
            // The camera is where a walk passes, so these voxels count as free.
            left.iter().for_each(|&voxel| free.insert(voxel));
            let mut parts = Vec::new();
            while let Some(mut part) = left.first().and_then(|&voxel| free.take_part(voxel)) {
                left.retain(|&voxel| {
                    let is_of_part = !free.contains(voxel);
                    if is_of_part {
                        part.add_around(voxel_place(voxel, counts), around, counts);
                    }
                    !is_of_part
                });
                parts.push(part);
            }
            add_viewcells(&solids, place, parts, &mut all)?;
        }
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU32, Ordering};
    use visibility_core::glam::Vec3;
    use visibility_core::{Aabb, Object};

    /// Number of calls of [`stop`] so far.
    static CALLS: AtomicU32 = AtomicU32::new(0);
    /// Number of calls of [`stop`] that return false.
    static ALLOWED: AtomicU32 = AtomicU32::new(u32::MAX);

    fn stop() -> bool {
        CALLS.fetch_add(1, Ordering::Relaxed) >= ALLOWED.load(Ordering::Relaxed)
    }

    /// The stop function is asked for each box after the flood too.
    #[test]
    fn viewcells_are_stopped_after_the_flood() {
        let corners = [[-99.0, -99.0], [99.0, -99.0], [0.0, 99.0]].map(|[x, y]| Vec3::new(x, y, 0.0));
        let mut scene = Scene::new();
        let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_points(corners)) });
        scene.set_triangles(id, [corners]).unwrap();
        let grid = Grid::new(DVec3::ZERO, DVec3::splat(2.0)).unwrap().with_stop(stop);
        let (eye, camera, ends) =
            (DVec3::new(1.0, 1.0, 1.7), CameraRange::default(), [DVec3::ZERO, DVec3::new(8.0, 2.0, 2.0)]);
        let solids = SolidTriangles::new(&grid, &scene, &camera, ends).unwrap();
        let mut flood = Flood::new(&solids);
        flood.start(eye).unwrap();
        let boxes = flood.run().unwrap().len() as u32;
        assert_eq!(boxes, 4, "boxes of the flood");
        let of_flood = CALLS.swap(0, Ordering::Relaxed);
        let free = || grid.free(&scene, &[eye], &camera, ends[0], ends[1]).map(|cells| cells.len() as u32);
        assert_eq!(free(), Ok(boxes), "viewcells");
        assert_eq!(CALLS.swap(0, Ordering::Relaxed), of_flood + boxes, "calls with those after the flood");
        ALLOWED.store(of_flood + 1, Ordering::Relaxed);
        assert_eq!(free(), Err(GridError::Stopped), "stopped at the second box after the flood");
    }

    /// Points on the border of a region are in it, also if it is flat, and points outside are ignored.
    #[test]
    fn floods_begin_within_the_region_and_its_border() {
        let grid = Grid::new(DVec3::ZERO, DVec3::splat(2.0)).unwrap();
        let (scene, camera) = (Scene::new(), CameraRange { heights: None, ..CameraRange::default() });
        let count = |point: DVec3, min: DVec3, max: DVec3| {
            grid.free(&scene, &[point], &camera, min, max).map(|cells| cells.len())
        };
        let (low, high) = (DVec3::ZERO, DVec3::splat(2.0));
        for (x, expected) in [(0.0, 1), (1.0, 1), (2.0, 1), (2.001, 0), (-0.001, 0)] {
            assert_eq!(count(DVec3::new(x, 1.0, 1.0), low, high), Ok(expected), "a point at {x}");
        }
        assert_eq!(count(DVec3::ONE, DVec3::ONE, DVec3::ONE), Ok(1), "a region that is a point");
        assert_eq!(count(DVec3::ONE, DVec3::NAN, high), Err(GridError::TooMany), "a least corner of NaN");
        assert_eq!(count(DVec3::ONE, low, DVec3::NAN), Err(GridError::TooMany), "a greatest corner of NaN");
    }
}
