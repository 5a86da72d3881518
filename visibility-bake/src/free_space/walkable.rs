//! Viewcells above walkable triangles, such as those of a navigation mesh.

use super::camera_range::CameraRange;
use super::triangle_columns::{Columns, extent};
use crate::grid::{Grid, GridError};
use std::collections::BTreeSet;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;

impl Grid {
    /// Returns the viewcells that contain positions of a camera above walkable triangles, such as those of a
    /// navigation mesh, in world space. The camera is at the [heights](CameraRange::heights) above a point of
    /// a triangle, or on the triangle if it flies. Viewcells are in ascending order of z, y and x. Triangles
    /// that are not finite are ignored.
    ///
    /// # Errors
    /// [`GridError::TooMany`] for more viewcells than [`LIMIT`](Grid::LIMIT), or for a viewcell that is
    /// 4.5e15 or more boxes from the origin; [`GridError::Stopped`] if the function of
    /// [`with_stop`](Grid::with_stop) returned true.
    ///
    /// ```
    /// use visibility_bake::{CameraRange, Grid};
    /// use visibility_core::glam::DVec3;
    /// let grid = Grid::new(DVec3::ZERO, DVec3::new(4.0, 4.0, 2.0))?;
    /// let floor = [[0.5, 0.5, 0.1], [7.5, 0.5, 0.1], [0.5, 1.5, 0.1]].map(DVec3::from_array);
    /// // Two viewcells on the floor, and two above them.
    /// assert_eq!(grid.above(&[floor], &CameraRange::default())?.len(), 4);
    /// # Ok::<(), visibility_bake::GridError>(())
    /// ```
    pub fn above(&self, walkable: &[[DVec3; 3]], camera: &CameraRange) -> Result<Vec<Viewcell>, GridError> {
        let columns = Columns::new(camera.up_axis(), self.size);
        let (slack, height) = (columns.slack, self.size[columns.up]);
        let [lowest, highest] = camera.offsets().unwrap_or([0.0; 2]);
        let (mut found, mut asked) = (BTreeSet::new(), 0);
        for triangle in walkable.iter().filter(|triangle| triangle.iter().all(|p| p.is_finite())) {
            let (min, max) = extent(triangle);
            let limits = [columns.of(self.place(min - slack)?), columns.of(self.place(max + slack)?)];
            let local = triangle.map(|p| p - self.origin);
            if columns.fewest(local) > Self::LIMIT as f64 {
                return Err(GridError::TooMany);
            }
            columns.for_each(local, limits, |column, [low, high]| {
                let first = ((low + lowest - slack) / height).floor();
                let last = ((high + highest + slack) / height).floor();
                if !(last - first < Self::LIMIT as f64 && first.abs().max(last.abs()) < 4.5e15) {
                    return Err(GridError::TooMany);
                }
                asked += 1;
                self.stop.check(asked)?;
                for level in first as i64..=last as i64 {
                    let [x, y, z] = columns.place(column, level);
                    found.insert([z, y, x]);
                }
                if found.len() > Self::LIMIT { Err(GridError::TooMany) } else { Ok(()) }
            })?;
        }
        Ok(found.into_iter().map(|[z, y, x]| self.cell([x, y, z])).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Heights that give too many viewcells, or viewcells too far away, are errors.
    #[test]
    fn heights_are_within_the_places_of_a_grid() {
        let grid = Grid::new(DVec3::ZERO, DVec3::ONE).unwrap();
        let floor = [[0.25, 0.25, 0.0], [0.75, 0.25, 0.0], [0.25, 0.75, 0.0]].map(DVec3::from_array);
        let count = |low: f64, high: f64| {
            let camera = CameraRange { heights: Some([low, high]), ..CameraRange::default() };
            grid.above(&[floor], &camera).map(|cells| cells.len())
        };
        assert_eq!(count(1.5, 3.5), Ok(3), "three levels");
        assert_eq!(count(0.0, 1e9), Err(GridError::TooMany), "too many levels");
        for far in [1e16, -1e16] {
            assert_eq!(count(far, far), Err(GridError::TooMany), "a level {far} m above the floor");
        }
    }
}
