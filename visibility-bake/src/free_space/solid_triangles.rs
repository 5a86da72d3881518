//! The solid triangles around the boxes of a grid, and the voxels of a box where a camera can be.
//!
//! The diagonal of a voxel is less than the radius that the camera keeps free around itself. A voxel that
//! touches a solid surface therefore contains no position of the camera: each point of the voxel is closer to
//! that surface than the radius.

use super::camera_range::CameraRange;
use super::triangle_columns::{Columns, extent};
use super::voxel_set::{VoxelSet, voxel_number};
use crate::grid::{Grid, GridError};
use std::collections::HashMap;
use std::convert::Infallible;
use visibility_core::Scene;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::level_version::level_object;
use visibility_core::scene::Triangle;

/// Greatest number of pairs of a triangle and a column of boxes that it touches. This many pairs take at most
/// four gigabytes, which is 64 bytes for each pair, reached if each column has a single triangle.
const MAX_ENTRIES: usize = 1 << 26;

/// Greatest number of voxels of a box of the grid.
const BOX_VOXELS: usize = 1 << 21;

/// The triangles of a scene's occluders, in a range of columns of a grid.
pub(super) struct SolidTriangles<'a> {
    pub grid: &'a Grid,
    /// [Places](crate::grid) of the first and the last box of the range in which triangles are known, each as
    /// x, y and z. Both are in the range.
    pub limits: [[i64; 3]; 2],
    /// Number of voxels of a box on each axis.
    pub counts: [usize; 3],
    /// Axis that points up or down: 0, 1 or 2.
    pub up: usize,
    /// Least and greatest coordinate of the camera on the axis `up`, in metres relative to the floor below.
    /// `None` for a camera that flies.
    offsets: Option<[f64; 2]>,
    triangles: Vec<SolidTriangle>,
    /// Indices of the triangles that touch each column of boxes, by the column's position on the two other
    /// axes.
    by_column: HashMap<[i64; 2], Vec<u32>>,
}

/// A triangle that blocks the camera.
pub(super) struct SolidTriangle {
    /// Corners in metres relative to the grid's origin.
    pub corners: [DVec3; 3],
    /// Whether the triangle is flat enough to be a floor, above which a camera can be.
    is_floor: bool,
}

impl<'a> SolidTriangles<'a> {
    /// Collects the triangles in the columns of boxes that contain the region between two corners. Triangles
    /// that are not finite are ignored.
    ///
    /// # Errors
    /// [`GridError::Radius`] if the radius is not positive or a box would have too many voxels,
    /// [`GridError::TooMany`] if a corner has no [place](Grid::place) or there are more than [`MAX_ENTRIES`]
    /// pairs of triangle and column, [`GridError::Stopped`] if the grid's stop function returned true.
    pub(super) fn new(
        grid: &'a Grid,
        scene: &Scene,
        camera: &CameraRange,
        bounds: [DVec3; 2],
    ) -> Result<Self, GridError> {
        // The edge is chosen so that a voxel's diagonal is a little less than the radius.
        let edge = camera.radius * 0.99 / 3f64.sqrt();
        let counts = (grid.size / edge).ceil();
        if !(camera.radius > 0.0 && counts.element_product() <= BOX_VOXELS as f64) {
            return Err(GridError::Radius);
        }
        let counts = counts.to_array().map(|count| count.max(1.0) as usize);
        let [first, last] = grid.places(bounds)?;
        let (up, offsets) = (camera.up_axis(), camera.offsets());
        let columns = Columns::new(up, grid.size);
        // Triangles are sorted by column, since a camera above a floor depends on all triangles below and
        // above it.
        let mut triangles: Vec<SolidTriangle> = Vec::new();
        let mut by_column: HashMap<[i64; 2], Vec<u32>> = HashMap::new();
        let mut entries = 0;
        let is_solid = |&id: &_| level_object(scene, id).is_some_and(|(object, _)| object.occluder);
        for id in scene.ids().filter(is_solid) {
            for triangle in scene.triangles(id).unwrap_or_default() {
                if !triangle.iter().all(|p| p.is_finite()) {
                    continue;
                }
                let corners = triangle.map(|p| p.as_dvec3() + (scene.origin() - grid.origin));
                let before = entries;
                columns.for_each(corners, [columns.of(first), columns.of(last)], |column, _| {
                    by_column.entry(column).or_default().push(triangles.len() as u32);
                    entries += 1;
                    grid.stop.check(entries)?;
                    if entries > MAX_ENTRIES { Err(GridError::TooMany) } else { Ok(()) }
                })?;
                if entries > before {
                    triangles.push(SolidTriangle { corners, is_floor: is_floor(&triangle, up) });
                }
            }
        }
        Ok(Self { grid, limits: [first, last], counts, up, offsets, triangles, by_column })
    }

    /// Returns the size of a voxel in metres.
    pub(super) fn voxel_size(&self) -> DVec3 {
        self.grid.size / DVec3::from_array(self.counts.map(|count| count as f64))
    }

    /// Returns the triangles that touch the column of a box.
    pub(super) fn in_column_of(&self, place: [i64; 3]) -> impl Iterator<Item = &SolidTriangle> {
        let column = Columns::new(self.up, self.grid.size).of(place);
        self.by_column.get(&column).into_iter().flatten().map(|&at| &self.triangles[at as usize])
    }

    /// Returns the voxels of a box where the camera can be: they touch no triangle, and are at the right
    /// height above a floor unless the camera flies.
    pub(super) fn free_voxels(&self, place: [i64; 3]) -> VoxelSet {
        let (up, edge, size) = (self.up, self.voxel_size(), self.grid.size);
        let columns = Columns::new(up, edge);
        let slack = columns.slack;
        let corner = DVec3::from_array(place.map(|place| place as f64)) * size;
        let limits = [[0; 2], columns.of(self.counts).map(|count| count as i64 - 1)];
        // Difference of the numbers of two voxels, one directly above the other.
        let stride = voxel_number(columns.place([0; 2], 1), self.counts);
        // Marks the voxels of a column that are between two heights, in metres above the bottom of the box.
        let mark = |voxels: &mut VoxelSet, column: [i64; 2], low: f64, high: f64| {
            let last_level = self.counts[up] as f64 - 1.0;
            let [first, last] = [low - slack, high + slack].map(|height| (height / edge[up]).floor());
            if first <= last_level && last >= 0.0 {
                let bottom = voxel_number(columns.place(column.map(|at| at as usize), 0), self.counts);
                for level in first.max(0.0) as usize..=last.min(last_level) as usize {
                    voxels.insert(bottom + level * stride);
                }
            }
        };
        let mut solid = VoxelSet::empty(self.counts);
        // Voxels at one of the camera's heights above a floor.
        let mut at_height = VoxelSet::empty(self.counts);
        for SolidTriangle { corners, is_floor } in self.in_column_of(place) {
            let local = corners.map(|p| p - corner);
            let (least, most) = extent(&local);
            let meets =
                |[low, high]: [f64; 2]| least[up] + low <= size[up] + slack && most[up] + high >= -slack;
            let offsets = self.offsets.filter(|&offsets| *is_floor && meets(offsets));
            if !meets([0.0; 2]) && offsets.is_none() {
                continue;
            }
            let Ok(()) = columns.for_each(local, limits, |column, [low, high]| {
                mark(&mut solid, column, low, high);
                if let Some(offsets) = offsets {
                    mark(&mut at_height, column, low + offsets[0], high + offsets[1]);
                }
                Ok::<(), Infallible>(())
            });
        }
        if self.offsets.is_some() { at_height.without(&solid) } else { solid.complement() }
    }
}

/// Returns whether a triangle is less steep than 60 degrees. False for a triangle without area.
fn is_floor(triangle: &Triangle, up: usize) -> bool {
    let [a, b, c]: [DVec3; 3] = triangle.map(Vec3::as_dvec3);
    let normal = (b - a).cross(c - a);
    normal[up].abs() > 0.5 * normal.length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::free_space::voxel_set::voxel_place;
    use visibility_core::{Aabb, Object};
    use visibility_testing::ends_f32;

    /// A level triangle on and next to every border between voxels of 0.25 m. All voxels that it touches are
    /// solid, and those at the camera's heights above it are free unless they are solid.
    #[test]
    fn voxels_are_solid_where_a_triangle_touches_them() {
        let grid = Grid::new(DVec3::ZERO, DVec3::ONE).unwrap();
        let radius = 0.26 * 3f64.sqrt() / 0.99;
        for end in ends_f32(-1, 2) {
            let corners = [[-9.0, -9.0], [9.0, -9.0], [0.0, 9.0]].map(|[x, y]| Vec3::new(x, y, end.value));
            let mut scene = Scene::new();
            let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_points(corners)) });
            scene.set_triangles(id, [corners]).unwrap();
            // Heights in units of a third of a voxel.
            for heights in [None, Some([3, 6]), Some([-6, -3])] {
                let up = if heights == Some([-6, -3]) { DVec3::NEG_Z } else { DVec3::Z };
                let own = heights.map(|_| [0.25, 0.5]);
                let camera = CameraRange { radius, heights: own, up };
                let solids = SolidTriangles::new(&grid, &scene, &camera, [DVec3::ZERO, DVec3::ONE]).unwrap();
                assert_eq!(solids.counts, [4; 3], "voxels along each axis");
                let free = solids.free_voxels([0; 3]);
                for voxel in free.all() {
                    let start = 3 * voxel_place(voxel, solids.counts)[2] as i64;
                    let touches =
                        |low: i64, high: i64, hair: i64| low - hair <= start + 3 && high + hair >= start;
                    let is_free = free.contains(voxel);
                    let is_solid = touches(end.rank, end.rank, 0);
                    assert!(!is_free || !is_solid, "{end:?}: {voxel} is solid");
                    let [low, high] =
                        heights.map_or([-99, 99], |range| range.map(|height| end.rank + height));
                    let may_be_free = touches(low, high, 1);
                    assert!(!is_free || may_be_free, "{end:?}: {voxel} is not within {heights:?}");
                    let must_be_free = touches(low, high, 0) && !touches(end.rank, end.rank, 1);
                    assert!(is_free || !must_be_free, "{end:?}: {voxel} is free, {heights:?}");
                }
            }
        }
    }

    #[test]
    fn floors_are_less_steep_than_60_degrees() {
        for up in 0..3 {
            // A triangle that rises by `rise` on 1 m, along the axis `up`.
            let triangle = |rise: f32, width: f32| {
                [[0.0, 0.0, 0.0], [1.0, 0.0, rise], [0.0, width, 0.0]].map(|mut p: [f32; 3]| {
                    p.rotate_left(2 - up);
                    Vec3::from_array(p)
                })
            };
            for (rise, expected) in [(0.0, true), (1.0, true), (-1.7, true), (1.74, false), (-1e6, false)] {
                assert_eq!(is_floor(&triangle(rise, 1.0), up), expected, "axis {up}: a rise of {rise}");
            }
            assert!(!is_floor(&triangle(0.0, 0.0), up), "axis {up}: a triangle without area");
        }
    }

    /// A camera stands on no wall: above one, no voxel is at its heights.
    #[test]
    fn walls_are_no_floors() {
        let grid = Grid::new(DVec3::ZERO, DVec3::ONE).unwrap();
        let corners = [[0.5, -9.0, 0.1], [0.5, 9.0, 0.1], [0.5, 0.0, -9.0]].map(Vec3::from_array);
        let mut scene = Scene::new();
        let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_points(corners)) });
        scene.set_triangles(id, [corners]).unwrap();
        let radius = 0.26 * 3f64.sqrt() / 0.99;
        let camera = CameraRange { radius, heights: Some([0.25, 0.5]), up: DVec3::Z };
        let solids = SolidTriangles::new(&grid, &scene, &camera, [DVec3::ZERO, DVec3::ONE]).unwrap();
        let free = solids.free_voxels([0; 3]);
        assert!(free.all().all(|voxel| !free.contains(voxel)), "voxels above a wall");
    }
}
