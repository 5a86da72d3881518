//! The sweep of a viewshed: four quarters of the plan, each column by column away from the eye.

use super::envelope::{Envelope, REACH, Segment};
use super::observer::{Eye, Observer};
use super::raster::{HeightRaster, ViewshedError};
use alloc::vec::Vec;

/// Finds viewsheds. Keeps memory from call to call, so that a warm call does not allocate.
#[derive(Clone, Debug, Default)]
pub struct Viewshed {
    skyline: Envelope,
    near: Column,
    far: Column,
}

/// Samples of a column of a quarter, with what the skyline needs of them.
#[derive(Clone, Debug, Default)]
struct Column {
    /// Distance from the eye along the quarter's main axis, in columns. Not above 0 for a column at or behind
    /// the eye.
    ahead: f64,
    /// Index across the quarter of the first sample kept.
    first: usize,
    /// Height of each sample above the eye, in world units; NaN if missing.
    above_eye: Vec<f64>,
    /// Direction and slope at which the eye sees each sample. Without meaning for a column that is not ahead.
    images: Vec<(f64, f64)>,
}

/// A quarter of the plan: the directions within an eighth of a turn of its main axis. Samples have an index
/// along the main axis, and one across it.
#[derive(Clone, Copy)]
struct Quarter {
    /// Whether the main axis goes along rows, from column to column.
    along_row: bool,
    /// Whether the main axis goes towards greater indices.
    forward: bool,
}

const QUARTERS: [Quarter; 4] = [
    Quarter { along_row: true, forward: true },
    Quarter { along_row: true, forward: false },
    Quarter { along_row: false, forward: true },
    Quarter { along_row: false, forward: false },
];

/// Bound on the relative rounding of a target's and the eye's height: each is a sum of at most seven terms.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

impl Viewshed {
    /// Makes an empty workspace.
    pub fn new() -> Self {
        Self::default()
    }

    /// Writes to `visible`, by sample and row after row, whether the observer sees the sample's target. False
    /// for samples beyond the greatest distance, and for those without a height. Takes time in proportion to
    /// the samples within the greatest distance: see the [module](super).
    ///
    /// # Errors
    /// [`ViewshedError::Count`] if `visible` is not as long as the raster has samples,
    /// [`ViewshedError::Observer`] if the observer is not over the raster or over a hole in it, and
    /// [`ViewshedError::Height`] or [`ViewshedError::Distance`] for numbers that are none. `visible` is as it
    /// was then.
    pub fn look<T: Copy + Into<f64>>(
        &mut self,
        raster: &HeightRaster<'_, T>,
        observer: &Observer,
        visible: &mut [bool],
    ) -> Result<(), ViewshedError> {
        let eye = checked(raster, observer, visible.len())?;
        visible.fill(false);
        let target_height = observer.target_height();
        self.sweep(raster, observer, eye, |sample, hidden, rounding| {
            if let Some(visible) = visible.get_mut(sample) {
                *visible = hidden - target_height <= rounding + ROUNDING * target_height.abs();
            }
        });
        Ok(())
    }

    /// Writes to `heights`, by sample and row after row, up to which height above its ground the terrain
    /// hides
    /// a target, in world units: 0 where the ground is visible. The observer's target height is not used. NaN
    /// for samples beyond the greatest distance, and for those without a height. Takes as long as
    /// [`look`](Self::look).
    ///
    /// # Errors
    /// As of [`look`](Self::look).
    pub fn hidden_heights<T: Copy + Into<f64>>(
        &mut self,
        raster: &HeightRaster<'_, T>,
        observer: &Observer,
        heights: &mut [f64],
    ) -> Result<(), ViewshedError> {
        let eye = checked(raster, observer, heights.len())?;
        heights.fill(f64::NAN);
        self.sweep(raster, observer, eye, |sample, hidden, rounding| {
            if let Some(height) = heights.get_mut(sample) {
                *height = if hidden <= rounding { 0.0 } else { hidden };
            }
        });
        Ok(())
    }

    /// Calls `result` with each sample within the greatest distance that has a height: its index, the height
    /// above its ground below which targets are hidden, and a bound on the rounding of that height.
    fn sweep<T: Copy + Into<f64>>(
        &mut self,
        raster: &HeightRaster<'_, T>,
        observer: &Observer,
        eye: Eye,
        mut result: impl FnMut(usize, f64, f64),
    ) {
        let [row, column] = observer.position.map(|at| at as usize);
        if observer.position == [row as f64, column as f64] {
            result(row * raster.columns() + column, 0.0, 0.0);
        }
        for quarter in QUARTERS {
            self.sweep_quarter(quarter, raster, observer, eye, &mut result);
        }
    }

    fn sweep_quarter<T: Copy + Into<f64>>(
        &mut self,
        quarter: Quarter,
        raster: &HeightRaster<'_, T>,
        observer: &Observer,
        eye: Eye,
        result: &mut impl FnMut(usize, f64, f64),
    ) {
        let (rows, columns, cell) = (raster.rows(), raster.columns(), raster.cell());
        let [row, column] = observer.position;
        let (origin, center, length, width, [step, step_across]) = if quarter.along_row {
            (column, row, columns, rows, [cell[1], cell[0]])
        } else {
            (row, column, rows, columns, cell)
        };
        let sample = |along: usize, across: usize| {
            if quarter.along_row { (across, along) } else { (along, across) }
        };
        // Squares of distances round by up to 3 epsilon, and that of this distance by 1: a sample at just the
        // greatest distance is seen.
        let reach = observer.max_distance() * (1.0 + 4.0 * f64::EPSILON);
        // Products of the least numbers underflow.
        let reach_squared = reach * reach + f64::MIN_POSITIVE;
        let rounding_of_eye = ROUNDING * eye.magnitude + f64::MIN_POSITIVE;
        self.skyline.clear();
        // The column at or behind the eye, then those ahead of it.
        let mut along = origin as usize;
        if !quarter.forward && (along as f64) < origin {
            along += 1;
        }
        let mut is_first = true;
        while along < length {
            let ahead = if quarter.forward { along as f64 - origin } else { origin - along as f64 };
            if ahead * step > reach {
                break;
            }
            // A line of sight to a sample within the greatest distance meets edges whose samples are less
            // than two farther across. A third is for the rounding of the quotient.
            let across = (ahead.max(0.0) + 2.0).min(reach / step_across + 3.0);
            self.far.fill(ahead, [center - across, center + across], center, width, |across| {
                let (row, column) = sample(along, across);
                observer.ground(raster, row, column) - eye.height
            });
            if !is_first {
                self.add_between(quarter, center, rounding_of_eye);
                let mut slopes = self.skyline.slopes();
                let samples = self.far.above_eye.iter().zip(&self.far.images);
                for (across, (above_eye, image)) in (self.far.first..).zip(samples) {
                    let direction = image.0.abs();
                    let (row, column) = sample(along, across);
                    // A sample in a corner direction belongs to the quarters along rows.
                    let inside = if quarter.along_row { direction <= 1.0 } else { direction < 1.0 };
                    if above_eye.is_nan()
                        || !inside
                        || (reach < f64::INFINITY
                            && observer.squared_distance(cell, row, column) > reach_squared)
                    {
                        continue;
                    }
                    let on_border = direction == 0.0 && (across == 0 || across + 1 == width);
                    let hidden = (slopes(image.0, on_border) * ahead - above_eye).max(0.0);
                    let rounding = rounding_of_eye + ROUNDING * (above_eye.abs() + hidden);
                    result(row * columns + column, hidden, rounding);
                }
                drop(slopes);
                self.add_column(rounding_of_eye);
            }
            core::mem::swap(&mut self.near, &mut self.far);
            is_first = false;
            if quarter.forward {
                along += 1;
            } else if along > 0 {
                along -= 1;
            } else {
                break;
            }
        }
    }

    /// Adds the edges along the far column.
    fn add_column(&mut self, rounding_of_eye: f64) {
        let images = &self.far.images;
        let lowered = rounding_of_eye / self.far.ahead;
        let pairs = images.iter().zip(images.iter().skip(1));
        self.skyline.add(pairs.filter_map(|(a, b)| Segment::new(*a, *b, lowered)));
    }

    /// Adds the edges between the near and the far column: those across the columns, and the diagonals.
    fn add_between(&mut self, quarter: Quarter, center: f64, rounding_of_eye: f64) {
        let (near, far) = (&self.near, &self.far);
        let lowered = rounding_of_eye / near.ahead;
        // The edge from the sample `from` of the near column to the sample `to` of the far one.
        let edge = |from: usize, to: usize| {
            let (from_place, to_place) = (from.checked_sub(near.first)?, to.checked_sub(far.first)?);
            if near.ahead > 0.0 {
                let (a, b) = (near.images.get(from_place)?, far.images.get(to_place)?);
                return Segment::new(*a, *b, lowered);
            }
            let start = [near.ahead, from as f64 - center, *near.above_eye.get(from_place)?];
            let end = [far.ahead, to as f64 - center, *far.above_eye.get(to_place)?];
            beside_eye(start, end, rounding_of_eye)
        };
        let end = near.first + near.above_eye.len();
        self.skyline.add((near.first..end).filter_map(|across| edge(across, across)));
        // Seen along the main axis, diagonals lead to the next sample across if the axis goes towards greater
        // indices, and to the one before otherwise. On the side of the axis that they lead away from, the
        // images of neighbours follow each other. On the other side they overlap, but never those of every
        // other one.
        let low = near.first.saturating_sub(1);
        for second in [false, true] {
            let is_due = |across: &usize| {
                let apart =
                    if quarter.forward { *across as f64 >= center } else { (across + 1) as f64 <= center };
                let is_first = apart || across.is_multiple_of(2);
                is_first != second
            };
            self.skyline.add((low..end).filter(is_due).filter_map(|across| {
                if quarter.forward { edge(across, across + 1) } else { edge(across + 1, across) }
            }));
        }
    }
}

impl Column {
    /// Fills the column, at a distance `ahead` of the eye, with the samples between two places `ends` across
    /// the quarter. These are two samples beyond all that lines of sight meet to either side: a diagonal from
    /// there may lead into the quarter.
    fn fill(
        &mut self,
        ahead: f64,
        [low, high]: [f64; 2],
        center: f64,
        width: usize,
        above_eye: impl FnMut(usize) -> f64,
    ) {
        let first = low.max(0.0) as usize;
        let last = (high as usize).saturating_add(1).min(width);
        self.ahead = ahead;
        self.first = first;
        self.above_eye.clear();
        self.above_eye.extend((first..last).map(above_eye));
        self.images.clear();
        let slope_per_height = 1.0 / ahead;
        let image =
            |(across, above): (usize, &f64)| ((across as f64 - center) / ahead, above * slope_per_height);
        self.images.extend((first..).zip(&self.above_eye).map(image));
    }
}

/// Checks the observer and the number of results, and returns the eye.
fn checked<T: Copy + Into<f64>>(
    raster: &HeightRaster<'_, T>,
    observer: &Observer,
    results: usize,
) -> Result<Eye, ViewshedError> {
    observer.check()?;
    let eye = observer.eye(raster)?;
    if raster.rows() * raster.columns() != results {
        return Err(ViewshedError::Count { given: results, rows: raster.rows(), columns: raster.columns() });
    }
    Ok(eye)
}

/// Makes the segment of an edge that begins at or behind the eye, and ends a column farther ahead of it: its
/// part inside the quarter. Points are ahead of the eye, aside of it and above it. The part may begin at any
/// distance from the eye, however small, so that the bound on rounding grows as that distance shrinks.
///
/// An edge goes aside by a column at most, and the quarter's sides by more than the edge: it enters the
/// quarter and does not leave it.
fn beside_eye(start: [f64; 3], end: [f64; 3], rounding_of_eye: f64) -> Option<Segment> {
    // Share of the edge before it is inside. More than 1 for an edge that ends outside.
    let mut low = 0.0_f64;
    for side in [1.0, -1.0] {
        let [from, to] = [start, end].map(|[ahead, aside, _]| REACH * ahead + side * aside);
        if from < 0.0 {
            low = low.max(from / (from - to));
        }
    }
    let ([ahead, aside, above], [far, far_aside, far_above]) = (start, end);
    let at = |from: f64, to: f64| from + low * (to - from);
    let near = at(ahead, far);
    let is_inside = low < 1.0 && near > 0.0;
    if !is_inside {
        return None;
    }
    let a = (at(aside, far_aside) / near, at(above, far_above) / near);
    let b = (far_aside / far, far_above / far);
    // The far end is an image as others are, whose rounding `Segment::line` takes off.
    let lowered = (rounding_of_eye + ROUNDING * (above.abs() + far_above.abs() + a.1.abs())) / near;
    // Directions of clipped ends are off by as much as their distances are short, too.
    let rise = ((b.1 - a.1) / (b.0 - a.0)).abs();
    Segment::new(a, b, lowered + ROUNDING * rise / near)
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::iter::once;
    use visibility_testing::{Random, sign_of_sum};

    /// Edges that pass beside the eye are nowhere higher on the skyline than they are themselves, in exact
    /// arithmetic, where each of their ends is too high by the rounding of the eye. On directions that they
    /// do not have, nothing is.
    #[test]
    fn edges_beside_the_eye_are_no_higher_than_they_are() {
        let mut random = Random(31);
        let mut counts = [0; 3];
        for trial in 0..60_000 {
            // Products are exact: for edges across columns, directions are powers of two; for diagonals, all
            // coordinates have few digits. Every third edge passes very close to the eye.
            let turn = f64::from(random.between(-1, 1));
            let behind = if turn == 0.0 { random.bits() >> 11 } else { random.bits() >> 56 << 45 };
            let ahead = -(behind as f64) / 9007199254740992.0;
            let far = ahead + 1.0;
            let tiny = trial % 3 == 0;
            let power = random.between(5, if turn == 0.0 { 60 } else { 40 });
            let by = if tiny { 2f64.powi(-power) } else { f64::from(random.between(1, 512)) / 256.0 };
            // The area that the edge spans with the eye: its sign tells on which side of the eye it passes.
            let area = if random.one_in(2) { by } else { -by };
            let aside = area + turn * ahead;
            let far_aside = aside + turn;
            let error = if random.one_in(2) { 0.0 } else { f64::from(random.between(1, 1 << 20)) };
            let [above, mut far_above] = [(); 2].map(|()| f64::from(random.between(-1 << 26, 1 << 26)));
            if random.one_in(2) && ahead < -0.01 {
                // The edge is level with the eye where it enters the quarter, so that heights cancel.
                far_above = (above * far / ahead).round();
            }
            let segment = beside_eye([ahead, aside, above], [far, far_aside, far_above], error);
            let Some(segment) = segment else {
                assert!(
                    tiny || far_aside.abs() >= far,
                    "trial {trial}: an edge that ends inside is left out"
                );
                counts[0] += 1;
                continue;
            };
            let mut skyline = Envelope::default();
            skyline.clear();
            skyline.add(once(segment));
            for _ in 0..4 {
                // Directions near that of the end of an edge that passes close to the eye.
                let scale = (random.between(0, 30) - if tiny { power } else { 22 }).min(0);
                let part = f64::from(random.between(-256, 256)) / 256.0;
                let direction = if turn == 0.0 { part.signum() * 2f64.powi(scale) } else { part };
                let slope = skyline.slopes()(direction, false);
                let [from, to] = [[aside, ahead], [far_aside, far]]
                    .map(|[aside, ahead]| [(aside, 1.0), (-direction, ahead)]);
                let is_met =
                    [sign_of_sum(from), sign_of_sum(to)] == if area > 0.0 { [1, -1] } else { [-1, 1] };
                if slope == f64::NEG_INFINITY {
                    counts[1] += usize::from(is_met);
                    continue;
                }
                counts[2] += 1;
                let what = std::format!("{ahead}, {aside}, {above} to {far}, {far_aside}, {far_above}");
                assert!(is_met || sign_of_sum(to) == 0, "trial {trial}: {direction} is beside {what}");
                let [start, end] = [above - error, far_above - error];
                let from = from.map(|(a, b)| (a * b, end));
                let to = to.map(|(a, b)| (-(a * b), start));
                let above_slope = sign_of_sum(from.into_iter().chain(to).chain([(-slope, area)]));
                assert!(
                    above_slope * area.signum() as i32 >= 0,
                    "trial {trial}: {slope} in direction {direction}, error {error}: {what}"
                );
            }
        }
        let [left_out, missing, compared] = counts;
        assert!(left_out > 1_000 && missing < compared / 10 && compared > 50_000, "{counts:?}");
    }
}
