//! Observers above a raster of heights.

use super::raster::{GREATEST_HEIGHT, HeightRaster, ViewshedError};

/// Height of an eye in world units, and the sum of the magnitudes of the heights it was computed from.
#[derive(Clone, Copy)]
pub(super) struct Eye {
    pub(super) height: f64,
    pub(super) magnitude: f64,
}

/// An eye above the terrain, and the targets that it looks for.
#[derive(Clone, Copy, PartialEq, Debug)]
#[must_use]
pub struct Observer {
    pub(crate) position: [f64; 2],
    pub(crate) height: f64,
    pub(crate) target_height: f64,
    pub(crate) max_distance: f64,
    pub(crate) curvature: f64,
}

impl Observer {
    /// Makes an observer on the ground, at a fractional row and column: `(2.0, 3.5)` is in the middle between
    /// the samples 3 and 4 of row 2. Its targets are on the ground at any distance.
    pub fn new(row: f64, column: f64) -> Self {
        Self {
            position: [row, column],
            height: 0.0,
            target_height: 0.0,
            max_distance: f64::INFINITY,
            curvature: 0.0,
        }
    }

    /// Returns the observer with its eye `height` above the surface, in world units; 0 by default.
    pub fn with_height(self, height: f64) -> Self {
        Self { height, ..self }
    }

    /// Returns the observer with targets at a height above their samples, in world units; 0 by default.
    pub fn with_target_height(self, height: f64) -> Self {
        Self { target_height: height, ..self }
    }

    /// Returns the observer with a greatest distance in world units, along the plan. A sample at just this
    /// distance is seen. Infinite by default.
    pub fn with_max_distance(self, distance: f64) -> Self {
        Self { max_distance: distance, ..self }
    }

    /// Returns the observer with a curvature of the world: each sample is lowered by `curvature` times the
    /// square of its distance along the plan, in world units, before all else. For a sphere of radius R and a
    /// coefficient of refraction k this is `(1 - k) / (2 * R)`: 6.7e-8 per metre for the earth with its usual
    /// k of 1 / 7. 0 by default.
    pub fn with_curvature(self, curvature: f64) -> Self {
        Self { curvature, ..self }
    }

    /// Returns the target height above the ground, in world units.
    pub(super) fn target_height(&self) -> f64 {
        self.target_height
    }

    /// Returns the greatest distance along the plan, in world units.
    pub(super) fn max_distance(&self) -> f64 {
        self.max_distance
    }

    /// Checks all numbers but the position.
    pub(crate) fn check(&self) -> Result<(), ViewshedError> {
        for height in [self.height, self.target_height] {
            if !(0.0..=GREATEST_HEIGHT).contains(&height) {
                return Err(ViewshedError::Height { height });
            }
        }
        if self.curvature.is_nan() || self.curvature.abs() > GREATEST_HEIGHT {
            return Err(ViewshedError::Height { height: self.curvature });
        }
        if self.max_distance.is_nan() || self.max_distance < 0.0 {
            return Err(ViewshedError::Distance { distance: self.max_distance });
        }
        Ok(())
    }

    /// Returns the square of the distance along the plan to a sample, in square world units.
    pub(super) fn squared_distance(&self, cell: [f64; 2], row: usize, column: usize) -> f64 {
        let down = (row as f64 - self.position[0]) * cell[0];
        let across = (column as f64 - self.position[1]) * cell[1];
        down * down + across * across
    }

    /// Returns the height of a sample, lowered by the curvature; NaN if it is missing.
    pub(super) fn ground<T: Copy + Into<f64>>(
        &self,
        raster: &HeightRaster<'_, T>,
        row: usize,
        column: usize,
    ) -> f64 {
        let Some(height) = raster.height(row, column) else { return f64::NAN };
        if self.curvature == 0.0 {
            return height;
        }
        let lowered = height - self.curvature * self.squared_distance(raster.cell(), row, column);
        if lowered.abs() <= GREATEST_HEIGHT { lowered } else { f64::NAN }
    }

    /// Returns the eye: its height is that of the surface below it and its height above that.
    ///
    /// # Errors
    /// [`ViewshedError::Observer`] if the position is not over the raster, or the surface has no height
    /// there.
    pub(super) fn eye<T: Copy + Into<f64>>(
        &self,
        raster: &HeightRaster<'_, T>,
    ) -> Result<Eye, ViewshedError> {
        let [row, column] = self.position;
        let refused = Err(ViewshedError::Observer { position: self.position });
        let (last_row, last_column) = ((raster.rows() - 1) as f64, (raster.columns() - 1) as f64);
        if !((0.0..=last_row).contains(&row) && (0.0..=last_column).contains(&column)) {
            return refused;
        }
        let (first_row, first_column) = (row as usize, column as usize);
        let (down, across) = (row - first_row as f64, column - first_column as f64);
        // The triangle below the eye goes from the corner `(0, 0)` of the square along one of its sides to a
        // second corner, and on to `(1, 1)`. A corner whose share is 0 may be missing or beyond the raster.
        let (side, along, on) = if across >= down { ([0, 1], across, down) } else { ([1, 0], down, across) };
        // What the curvature lowers a sample by is rounded before the difference, in which it may cancel.
        let far = [(0, 0), (0, raster.columns() - 1), (raster.rows() - 1, 0)];
        let far = far.into_iter().chain([(raster.rows() - 1, raster.columns() - 1)]);
        let far =
            far.map(|(row, column)| self.squared_distance(raster.cell(), row, column)).fold(0.0, f64::max);
        // Samples beyond the greatest distance do not count, but those below the eye do.
        let [down, across] = raster.cell();
        let far = far.min(self.max_distance * self.max_distance).max(down * down + across * across);
        let lowered_by = if self.curvature == 0.0 { 0.0 } else { self.curvature.abs() * far };
        let mut eye = Eye { height: self.height, magnitude: self.height + lowered_by };
        for ([r, c], share) in [([0, 0], 1.0 - along), (side, along - on), ([1, 1], on)] {
            if share != 0.0 {
                let corner = self.ground(raster, first_row + r, first_column + c);
                eye.height += share * corner;
                eye.magnitude += corner.abs();
            }
        }
        if eye.height.is_nan() { refused } else { Ok(eye) }
    }
}
