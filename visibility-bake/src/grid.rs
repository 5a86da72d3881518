//! Grids of viewcells: boxes of equal size, that fill a region or follow a walk. The *place* of a box is its
//! position in the grid as x, y and z: the number of boxes between the origin and the box on each axis,
//! negative below the origin.

use std::collections::BTreeSet;
use std::fmt;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;

/// A grid of equal boxes in world space, some of which become viewcells. Neighbours share their faces
/// exactly, so that no eye is between two viewcells.
///
/// ```
/// use visibility_bake::Grid;
/// use visibility_core::glam::DVec3;
/// let grid = Grid::new(DVec3::ZERO, DVec3::new(4.0, 4.0, 2.0))?;
/// assert_eq!(grid.over(DVec3::ZERO, DVec3::new(8.0, 4.0, 2.0))?.len(), 2);
/// let walk = [DVec3::new(1.0, 1.0, 1.7), DVec3::new(9.0, 1.0, 1.7)];
/// assert_eq!(grid.along(&walk)?.len(), 3);
/// # Ok::<(), visibility_bake::GridError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Grid {
    /// Corner of the box at place 0, 0, 0, in metres in world space.
    pub(crate) origin: DVec3,
    /// Size of a box in metres.
    pub(crate) size: DVec3,
    pub(crate) stop: Stop,
}

/// Function that returns whether the computation of viewcells should stop. It is ignored when grids are
/// compared.
#[derive(Clone, Copy)]
pub(crate) struct Stop(fn() -> bool);

impl PartialEq for Stop {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Stop")
    }
}

impl Stop {
    /// Calls the function if `number` is a multiple of 1024. Returns [`GridError::Stopped`] if the function
    /// then returns true.
    pub(crate) fn check(self, number: usize) -> Result<(), GridError> {
        if number.is_multiple_of(1024) && (self.0)() { Err(GridError::Stopped) } else { Ok(()) }
    }
}

/// Reasons why a grid or its viewcells cannot be made.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum GridError {
    /// The size of a box is not positive and finite on each axis, or the origin is not finite.
    Size,
    /// The viewcells would be more than [`Grid::LIMIT`].
    Count {
        /// Number of viewcells in the region or along the walk. A viewcell that is passed twice counts twice.
        /// `u128::MAX` also stands for any larger number.
        count: u128,
    },
    /// The region or the walk is not finite, or would give more viewcells than [`Grid::LIMIT`]; or more than
    /// four gigabytes would be needed for a flood of free space or for the triangles around it.
    TooMany,
    /// The function of [`Grid::with_stop`] has returned true.
    Stopped,
    /// The [radius](crate::CameraRange::radius) of a camera is not positive, or is less than about a
    /// hundredth of a viewcell.
    Radius,
}

impl fmt::Display for GridError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size => write!(f, "the size of viewcells must be positive and finite"),
            Self::Count { count } => write!(f, "{count} viewcells, where at most {} are kept", Grid::LIMIT),
            Self::Stopped => write!(f, "the viewcells were not made in time"),
            Self::TooMany => write!(
                f,
                "more than {} viewcells, or more memory than a flood may take, or a place that is not finite",
                Grid::LIMIT
            ),
            Self::Radius => write!(
                f,
                "the distance to surfaces must be positive, and not less than about a hundredth of a viewcell"
            ),
        }
    }
}

impl std::error::Error for GridError {}

impl Grid {
    /// Greatest number of viewcells that a call may return.
    pub const LIMIT: usize = 1 << 24;

    /// Makes a grid of boxes that are `size` metres large. One of them has its least corner at `origin`.
    ///
    /// # Errors
    /// [`GridError::Size`] if `size` is not positive and finite on each axis, or `origin` is not finite.
    pub fn new(origin: DVec3, size: DVec3) -> Result<Self, GridError> {
        let is_positive = size.is_finite() && size.cmpgt(DVec3::ZERO).all();
        let stop = Stop(|| false);
        if is_positive && origin.is_finite() { Ok(Self { origin, size, stop }) } else { Err(GridError::Size) }
    }

    /// Sets a function that is called now and then while viewcells are computed. Once it returns true, the
    /// call fails with [`GridError::Stopped`].
    #[must_use]
    pub fn with_stop(self, stop: fn() -> bool) -> Self {
        Self { stop: Stop(stop), ..self }
    }

    /// Returns the viewcells that together contain the region from `min` to `max`, ordered along x first. A
    /// box of the grid that only touches the region from outside is left out. Empty if `min` is greater than
    /// `max` on an axis.
    ///
    /// # Errors
    /// [`GridError::Count`] for more viewcells than [`LIMIT`](Self::LIMIT); [`GridError::TooMany`] if a
    /// corner is not finite, or 4.5e15 boxes or more from the origin.
    pub fn over(&self, min: DVec3, max: DVec3) -> Result<Vec<Viewcell>, GridError> {
        if !min.is_finite() || !max.is_finite() {
            return Err(GridError::TooMany);
        }
        if !min.cmple(max).all() {
            return Ok(Vec::new());
        }
        let [first, last] = self.places([min, max])?;
        let counts = [0, 1, 2].map(|axis| last[axis].abs_diff(first[axis]) + 1);
        let count = counts.iter().fold(1u128, |product, &count| product.saturating_mul(count.into()));
        Self::check_count(count)?;
        let [nx, ny, nz] = counts.map(|count| count as i64);
        let places = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])));
        Ok(places.map(|at| self.cell([0, 1, 2].map(|axis| first[axis] + at[axis]))).collect())
    }

    /// Returns the viewcells through which a walk passes, in ascending order of z, y and x. The walk goes in
    /// straight lines from each point of `walk` to the next. Time is proportional to the number of viewcells
    /// passed, where a viewcell counts as often as it is passed.
    ///
    /// # Errors
    /// [`GridError::Count`] for more viewcells than [`LIMIT`](Self::LIMIT), where a viewcell counts as often
    /// as it is passed; [`GridError::TooMany`] if a point is not finite, or is 4.5e15 or more boxes from the
    /// origin; [`GridError::Stopped`] if the function of [`with_stop`](Self::with_stop) returned true.
    pub fn along(&self, walk: &[DVec3]) -> Result<Vec<Viewcell>, GridError> {
        Ok(self.passed(walk)?.into_iter().map(|place| self.cell(place)).collect())
    }

    /// Returns the places of the boxes through which a walk passes, in ascending order of z, y and x. The
    /// walk goes in straight lines from point to point.
    pub(crate) fn passed(&self, walk: &[DVec3]) -> Result<Vec<[i64; 3]>, GridError> {
        Self::check_count(self.count_passed(walk)?)?;
        let (mut found, mut asked) = (BTreeSet::new(), 0);
        let mut add = |[x, y, z]: [i64; 3]| {
            found.insert([z, y, x]);
            asked += 1;
            self.stop.check(asked)
        };
        for (number, &to) in walk.iter().enumerate() {
            let from = walk[number.saturating_sub(1)];
            let (start, end) = (self.place(from)?, self.place(to)?);
            // The parameters at which the segment crosses from one box into the next, on all axes.
            let mut crossings = Vec::new();
            for axis in 0..3 {
                let (a, b) = (start[axis].min(end[axis]), start[axis].max(end[axis]));
                let length = to[axis] - from[axis];
                crossings.extend((a + 1..=b).map(|place| (self.face(axis, place) - from[axis]) / length));
            }
            crossings.push(0.0);
            crossings.push(1.0);
            crossings.sort_by(f64::total_cmp);
            add(start)?;
            add(end)?;
            for pair in crossings.windows(2) {
                add(self.place(from + (to - from) * ((pair[0] + pair[1]) * 0.5))?)?;
            }
        }
        Ok(found.into_iter().map(|[z, y, x]| [x, y, z]).collect())
    }

    /// Returns an upper bound on the number of boxes through which a walk passes. A box counts as often as it
    /// is passed.
    pub(crate) fn count_passed(&self, walk: &[DVec3]) -> Result<u128, GridError> {
        let mut count = 0u128;
        for (number, &to) in walk.iter().enumerate() {
            let (start, end) = (self.place(walk[number.saturating_sub(1)])?, self.place(to)?);
            // A segment passes its first box, and one more box at each face that it crosses.
            count += 1 + (0..3).map(|axis| u128::from(start[axis].abs_diff(end[axis]))).sum::<u128>();
        }
        Ok(count)
    }

    /// Returns [`GridError::Count`] if `count`, a number of viewcells, is more than [`LIMIT`](Self::LIMIT).
    pub(crate) fn check_count(count: u128) -> Result<(), GridError> {
        if count > Self::LIMIT as u128 { Err(GridError::Count { count }) } else { Ok(()) }
    }

    /// Returns the place of the box that contains a point in world space: for each axis, the number of boxes
    /// between the origin and this box, negative below the origin. A point on a face is in the box above the
    /// face.
    ///
    /// # Errors
    /// [`GridError::TooMany`] if a coordinate of the point is NaN or infinite, or 4.5e15 or more boxes from
    /// the origin, where both faces of a box may round to the same coordinate.
    pub(crate) fn place(&self, p: DVec3) -> Result<[i64; 3], GridError> {
        let at = ((p - self.origin) / self.size).floor();
        // Beyond 2^52 boxes, the faces of a box are not distinct.
        if !at.abs().cmplt(DVec3::splat(4.5e15)).all() {
            return Err(GridError::TooMany);
        }
        Ok([0, 1, 2].map(|axis| {
            // Rounding may put the quotient on the other side of a face.
            let place = at[axis] as i64;
            let is_below = p[axis] < self.face(axis, place);
            let is_above = p[axis] >= self.face(axis, place + 1);
            place - i64::from(is_below) + i64::from(is_above)
        }))
    }

    /// Returns the places of the first and the last box of the range that contains the region from `min` to
    /// `max` in world space: `[first, last]`, each as x, y and z, both included. A box that only touches the
    /// region from outside is not in the range.
    ///
    /// `min` must not be greater than `max` on any axis.
    ///
    /// # Errors
    /// [`GridError::TooMany`] if `min` or `max` has no [`place`](Self::place).
    pub(crate) fn places(&self, [min, max]: [DVec3; 2]) -> Result<[[i64; 3]; 2], GridError> {
        let (first, mut last) = (self.place(min)?, self.place(max)?);
        for axis in 0..3 {
            let is_outside = self.face(axis, last[axis]) == max[axis];
            last[axis] = (last[axis] - i64::from(is_outside)).max(first[axis]);
        }
        Ok([first, last])
    }

    /// Returns the coordinate in world space of the lower face of the boxes at position `place` on an axis.
    pub(crate) fn face(&self, axis: usize, place: i64) -> f64 {
        self.origin[axis] + place as f64 * self.size[axis]
    }

    /// Returns the viewcell of the box at a place.
    pub(crate) fn cell(&self, place: [i64; 3]) -> Viewcell {
        let corner = |step: i64| DVec3::from_array([0, 1, 2].map(|axis| self.face(axis, place[axis] + step)));
        Viewcell::from_box(corner(0), corner(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::pvs::Viewcells;
    use visibility_testing::Random;

    #[test]
    fn every_point_of_a_walk_is_in_a_viewcell() {
        let mut random = Random(1);
        let mut point = |reach: f64| DVec3::from_array([(); 3].map(|()| (random.unit() - 0.5) * reach));
        for size in [0.3, 1.0, 7.7] {
            let grid = Grid::new(point(100.0), DVec3::new(size, size * 1.7, size * 0.6)).unwrap();
            let walk = [point(40.0), point(40.0), point(40.0)];
            let cells = Viewcells::new(grid.along(&walk).unwrap());
            for (a, b) in [(walk[0], walk[1]), (walk[1], walk[2])] {
                for step in 0..=10_000 {
                    let p = a.lerp(b, f64::from(step) / 10_000.0);
                    let near = DVec3::splat(1e-9);
                    let mut touching = 0;
                    cells.for_each_touching(p - near, p + near, |_| touching += 1);
                    assert!(touching > 0, "{p} of a walk among boxes of {size} m");
                }
            }
        }
    }

    /// Returns coordinates on, just before and just after each face of some boxes on an axis, and in their
    /// middles.
    fn around_faces(grid: &Grid, axis: usize) -> Vec<f64> {
        let all = (-4..9).flat_map(|place| {
            let face = grid.face(axis, place);
            [face.next_down(), face, face.next_up(), face + 0.5 * grid.size[axis]]
        });
        all.collect()
    }

    /// Points, regions and walks with ends on or next to faces are contained in their viewcells, exactly. A
    /// viewcell that only touches a region from outside is left out.
    #[test]
    fn viewcells_contain_what_ends_at_their_faces() {
        for (origin, size) in [(0.0, 1.0), (0.1, 0.1), (-7.3, 0.3), (1234.567, 0.7), (-1e6, 1.0 / 3.0)] {
            let grid = Grid::new(DVec3::splat(origin), DVec3::splat(size)).unwrap();
            for axis in 0..3 {
                let all = around_faces(&grid, axis);
                let at = |x: f64| {
                    let mut p = DVec3::splat(grid.face((axis + 1) % 3, 0) + 0.5 * size);
                    p[axis] = x;
                    p
                };
                for (i, &low) in all.iter().enumerate() {
                    let place = grid.place(at(low)).unwrap()[axis];
                    assert!(grid.face(axis, place) <= low && low < grid.face(axis, place + 1), "{low}");
                    for &high in &all[i..] {
                        let cells = grid.over(at(low), at(high)).unwrap();
                        let [first, last] = [&cells[0], &cells[cells.len() - 1]];
                        assert!(
                            first.min[axis] <= low && high <= last.max[axis],
                            "{low} to {high}: {cells:?}"
                        );
                        assert!(cells.len() == 1 || first.max[axis] > low, "{low} to {high}");
                        assert!(cells.len() == 1 || last.min[axis] < high, "{low} to {high}");
                        assert!(
                            cells.windows(2).all(|pair| pair[0].max[axis] == pair[1].min[axis]),
                            "{low} to {high}: a viewcell begins where the one before ends"
                        );
                        for walk in [[at(low), at(high)], [at(high), at(low)]] {
                            let cells = grid.along(&walk).unwrap();
                            let [first, last] = [&cells[0], &cells[cells.len() - 1]];
                            assert!(
                                first.min[axis] <= low && high <= last.max[axis],
                                "{low} to {high}: {cells:?}"
                            );
                            assert!(
                                cells.windows(2).all(|pair| pair[0].max[axis] == pair[1].min[axis]),
                                "{low} to {high}: a viewcell along a walk begins where the one before ends"
                            );
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_box_is_filled_without_overlap_and_limits_are_errors() {
        let grid = Grid::new(DVec3::splat(0.1), DVec3::splat(0.1)).unwrap();
        let cells = grid.over(DVec3::ZERO, DVec3::splat(1.0)).unwrap();
        assert_eq!(cells.len(), 1000, "viewcells over a cubic metre, 0.1 m wide");
        let volume: f64 = cells.iter().map(|cell| (cell.max - cell.min).element_product()).sum();
        assert!((volume - 1.0).abs() < 1e-9, "the volume of all viewcells is {volume} m3");
        assert_eq!(grid.over(DVec3::ONE, DVec3::ZERO).unwrap(), [], "an inverted box");
        assert_eq!(grid.over(DVec3::ZERO, DVec3::ZERO).unwrap().len(), 1, "a point");
        for far in [1e300, f64::INFINITY, f64::NAN] {
            assert_eq!(
                grid.over(DVec3::ZERO, DVec3::splat(far)),
                Err(GridError::TooMany),
                "a box up to {far}"
            );
            assert_eq!(
                grid.along(&[DVec3::ZERO, DVec3::splat(far)]),
                Err(GridError::TooMany),
                "a walk to {far}"
            );
        }
        let begun_nowhere = grid.over(DVec3::NAN, DVec3::ZERO);
        assert_eq!(begun_nowhere, Err(GridError::TooMany), "a box from NaN");
        for origin in [f64::NAN, f64::INFINITY] {
            let grid = Grid::new(DVec3::splat(origin), DVec3::ONE);
            assert_eq!(grid, Err(GridError::Size), "an origin at {origin}");
        }
        // Boxes of half a metre, in a cube of 2^25 m that begins at the grid's origin.
        let (grid, far) =
            (Grid::new(DVec3::ZERO, DVec3::splat(0.5)).unwrap(), DVec3::splat(f64::from(1 << 25)));
        assert_eq!(
            grid.over(DVec3::ZERO, far),
            Err(GridError::Count { count: 1 << 78 }),
            "boxes of half a metre over 2^25 m"
        );
        assert_eq!(
            grid.along(&[DVec3::ZERO, far]),
            Err(GridError::Count { count: 2 + 3 * (1 << 26) }),
            "viewcells along a walk of 2^25 m"
        );
        let said = grid.along(&[DVec3::ZERO, far]).unwrap_err().to_string();
        assert_eq!(
            said, "201326594 viewcells, where at most 16777216 are kept",
            "the error names count and limit"
        );
        let stopped = grid.with_stop(|| true).along(&[DVec3::ZERO, DVec3::splat(1024.0)]);
        assert_eq!(stopped, Err(GridError::Stopped), "a walk that is stopped");
        assert_eq!(grid.with_stop(|| true), grid, "a stop is no part of a grid");
        let limit = Grid::LIMIT as u128;
        assert_eq!(Grid::check_count(limit), Ok(()), "as many viewcells as are kept");
        assert!(Grid::check_count(limit + 1).is_err(), "a viewcell too many");
        for size in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(
                Grid::new(DVec3::ZERO, DVec3::splat(size)),
                Err(GridError::Size),
                "boxes {size} m wide"
            );
        }
    }
}
