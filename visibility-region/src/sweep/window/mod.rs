//! Windows of projection planes: the rectangles that maps cover, and their pixels.

use super::direction::Direction;
use super::occludees::{ACROSS, Item, STEEPEST_BESIDE};
use super::ray_map::{PixelRect, Ranges, SIDE, pixel_at};
use alloc::vec::Vec;
use visibility_core::Aabb;
use visibility_core::glam::Vec3;

/// Margin in pixels of every decision. The error of each pixel coordinate that decides is smaller: see
/// [`Window::fit`] for lateral positions and [`OccluderRaster`](super::occluder_raster::OccluderRaster) for
/// projected vertices.
pub(crate) const SLACK: f64 = 1.0 / 1024.0;

/// Greatest magnitude of a pixel coordinate that is used, 2^30. Its rounding errors are below `SLACK / 2^10`.
pub(crate) const FARTHEST_PIXEL: f64 = 1_073_741_824.0;

/// Least width of a window, in units of the rounding error of positions on it: 2^26.
const WIDTH: f64 = 67_108_864.0;

// Errors of lateral coordinates and depths of occludees, the latter times the steepest slope, take about a
// quarter of the margin. `OccluderRaster::decides` leaves out the occluders whose errors exceed another
// quarter.
const _: () = assert!(
    (1.0 + STEEPEST_BESIDE + ACROSS) * SIDE as f64 / (2.0 * WIDTH) < SLACK / 2.0,
    "the steepest rays must keep errors of positions below half the margin of decisions"
);

/// Distance in pixels from a [`Rim`] to the boundary between pixels that [`Window::fit`] places next to it,
/// on its outer side. Edges at the rim, widened by their margin, then mark pixels on one side of the boundary
/// only.
const BESIDE: f64 = 4.0 * SLACK;

/// A coordinate along a lateral axis at which most objects begin or end, such as the ground that houses stand
/// on. The side of the rim where these objects are is its inner side. If a pixel had rays on both sides of
/// the rim, the lower edge of a house in front would leave the pixel uncovered for all objects behind it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rim {
    at: f64,
    /// 1 if the objects begin at the rim and lie at greater coordinates, -1 if they end there.
    inwards: f64,
    /// Axis of the scene, and exact position of the rim along it, if the whole viewcell is on the inner side
    /// of the rim or touches it. `None` otherwise.
    exact: Option<(usize, f64)>,
}

/// A rim that the viewcell does not cross, as a boundary between the pixels of a window.
///
/// The pixels on the inner side of this boundary represent exactly the points on the inner side of the rim,
/// and the other pixels the points beyond it. In coordinates, the boundary lies [`BESIDE`] pixels off the
/// rim, and every range of pixels is widened by as much. Rays from the viewcell through an inner pixel stay
/// on the inner side of the rim. So an edge on the outer side, or at the rim, does not meet them. (Rays in
/// the plane of the rim do meet an edge at the rim, and its triangle blocks them there. They see no object
/// that rays beside them do not see, since a visible point is visible to an open set of rays.)
#[derive(Clone, Copy, PartialEq, Debug)]
struct ExactRim {
    at: f64,
    inwards: f64,
    exact: (usize, f64),
    /// Index of the column or row of pixels next to the boundary, on the rim's inner side.
    inner: usize,
}

impl ExactRim {
    /// Returns the part of a range of pixel coordinates that is on the inner side of the rim. The caller
    /// knows that all represented points are on that side.
    fn clip_inwards(&self, [low, high]: [f64; 2]) -> [f64; 2] {
        let inner = self.inner as f64;
        if self.inwards > 0.0 { [low.max(inner), high] } else { [low, high.min(inner + 1.0 - SLACK)] }
    }

    /// Returns the part of a range of pixel coordinates that is on the outer side of the rim. The caller
    /// knows that all represented points are on that side or at the rim.
    fn clip_outwards(&self, [low, high]: [f64; 2]) -> [f64; 2] {
        let inner = self.inner as f64;
        if self.inwards > 0.0 {
            let high = high.min(inner - SLACK);
            [low.min(high), high]
        } else {
            let low = low.max(inner + 1.0);
            [low, high.max(low)]
        }
    }

    /// Removes the first inner pixel from a range of pixel coordinates that begins on the outer side and ends
    /// at the rim, up to rounding. The boundary between pixels is a little beside the rim, so the end of the
    /// range is in that pixel, but the range contains none of the points that the pixel represents. Other
    /// ranges are unchanged.
    fn clip_at_rim(&self, [low, high]: [f64; 2]) -> [f64; 2] {
        let inner = self.inner as f64;
        if self.inwards > 0.0 {
            let ends_there = high <= inner + BESIDE + SLACK;
            [low, if ends_there { high.min(inner - SLACK) } else { high }]
        } else {
            let begins_there = low >= inner + 1.0 - BESIDE - SLACK;
            [if begins_there { low.max(inner + 1.0) } else { low }, high]
        }
    }
}

impl Rim {
    /// Returns the rim along lateral axis `lat` (0 or 1): the coordinate, up to rounding, at which most items
    /// begin, or that at which most end. `None` if no two items share such a coordinate.
    pub(crate) fn of(
        items: &[Item],
        lat: usize,
        direction: &Direction,
        scratch: &mut Vec<f64>,
    ) -> Option<Self> {
        let (mut best, mut most) = (None, 1);
        // Lower coordinates first, then upper ones: the longest run of equal coordinates wins.
        for inwards in [1.0, -1.0] {
            scratch.clear();
            scratch.extend(items.iter().map(
                |Item { bounds, .. }| {
                    if inwards > 0.0 { bounds.lo[lat] } else { bounds.hi[lat] }
                },
            ));
            scratch.sort_unstable_by(f64::total_cmp);
            for equal in scratch.chunk_by(|a, b| b - a <= direction.error) {
                if equal.len() > most {
                    let range = [equal[0], equal[equal.len() - 1]];
                    (best, most) = (Some((range, inwards)), equal.len());
                }
            }
        }
        let (range, inwards) = best?;
        // If the lateral axis is an axis of the world, the coordinate is exact, and can be compared with the
        // cell's face without error.
        let exact = direction.exact[lat].and_then(|(axis, cell)| {
            let outermost = items
                .iter()
                .map(|Item { bounds, scene_bounds, .. }| {
                    let (local, scene) = if inwards > 0.0 {
                        (bounds.lo[lat], scene_bounds.min[axis])
                    } else {
                        (bounds.hi[lat], scene_bounds.max[axis])
                    };
                    (local, f64::from(scene))
                })
                .filter(|(local, _)| (range[0]..=range[1]).contains(local))
                .min_by(|a, b| (a.1 * inwards).total_cmp(&(b.1 * inwards)))?;
            let is_within = if inwards > 0.0 { cell[0] >= outermost.1 } else { cell[1] <= outermost.1 };
            is_within.then_some((outermost.0, axis, outermost.1))
        });
        let at = exact.map_or(range[0], |(at, ..)| at);
        Some(Self { at, inwards, exact: exact.map(|(_, axis, scene)| (axis, scene)) })
    }
}

/// A projection plane, with the rectangle on it that its map covers.
///
/// A set bit of the map says that every *asked* ray through the closed pixel is blocked in front of the
/// plane. A ray is asked if it passes through the windows of this plane and of all earlier planes of the
/// sweep.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window {
    /// Distance of the plane in metres from the front of the viewcell.
    pub(crate) d: f64,
    /// Least and greatest coordinate of the window along x, then along y, in metres.
    pub(crate) ends: [[f64; 2]; 2],
    /// Pixels per metre along x and y.
    scale: [f64; 2],
    /// Rims along x and y that the viewcell does not cross. `None` along an axis without one.
    rims: [Option<ExactRim>; 2],
}

impl Window {
    /// Fits a window on the plane at distance `d` around the rectangle `ends`, which may be a point but not
    /// empty: least and greatest x, then y, in metres. Along an axis with a rim, a boundary between pixels is
    /// placed next to the rim. `None` if the results are not finite.
    pub(crate) fn fit(
        direction: &Direction,
        d: f64,
        ends: [[f64; 2]; 2],
        rims: [Option<Rim>; 2],
    ) -> Option<Self> {
        let mut exact_rims = [None; 2];
        let ends = [0, 1].map(|lat| {
            let [low, high] = ends[lat];
            // Positions on the plane are sums of three terms within the magnitudes here, each rounded a few
            // times. They are wrong by less than 16 EPSILON of the magnitudes, and by the error of their
            // coordinates: of the lateral one, which the factor (d + depth) / (z + depth) <= 1 does not
            // enlarge, and of the depth, times the slope of a ray. The window is at least 2 WIDTH times as
            // wide as the error of a coordinate: see the assertion below `WIDTH`.
            let magnitude = low.abs() + high.abs() + direction.widest();
            let pad = (high - low) * 1e-3 + (magnitude * f64::EPSILON + direction.error) * WIDTH;
            let (low, high) = (low - pad, high + pad);
            let Some(rim) = rims[lat].filter(|rim| low < rim.at && rim.at < high) else {
                return [low, high];
            };
            // One pixel is reserved for moving the window so that the boundary between pixels is next to the
            // rim.
            let pixel = (high - low) / (SIDE - 1) as f64;
            let side = if rim.exact.is_some() { -rim.inwards } else { rim.inwards };
            let boundary = (rim.at + side * BESIDE * pixel - low) / pixel;
            let is_inside = boundary >= 0.0;
            let boundary = boundary.max(0.0);
            let fraction = boundary - boundary as usize as f64;
            let first = boundary as usize + 1;
            exact_rims[lat] = rim.exact.filter(|_| is_inside && first < SIDE).map(|exact| ExactRim {
                at: rim.at,
                inwards: rim.inwards,
                exact,
                inner: if rim.inwards > 0.0 { first } else { first - 1 },
            });
            let low = low - (1.0 - fraction) * pixel;
            [low, low + pixel * SIDE as f64]
        });
        let scale = ends.map(|[low, high]| SIDE as f64 / (high - low));
        // An end that is not finite gives a scale of zero or NaN.
        let usable = scale.iter().all(|s| s.is_finite() && *s > 0.0);
        usable.then_some(Self { d, ends, scale, rims: exact_rims })
    }

    /// Returns the pixel coordinate of a lateral position in metres along axis `lat` (0 or 1).
    #[inline]
    pub(crate) fn pixel(&self, x: f64, lat: usize) -> f64 {
        (x - self.ends[lat][0]) * self.scale[lat]
    }

    /// Returns the side of a pixel in metres along lateral axis `lat` (0 or 1).
    pub(crate) fn pixel_size(&self, lat: usize) -> f64 {
        1.0 / self.scale[lat]
    }

    pub(crate) fn scale(&self, lat: usize) -> f64 {
        self.scale[lat]
    }

    /// Returns the number of pixels by which each end of a range along lateral axis `lat` (0 or 1) must be
    /// moved outwards.
    fn margin(&self, lat: usize) -> f64 {
        if self.rims[lat].is_some() { SLACK + BESIDE } else { SLACK }
    }

    /// Returns a range of pixel coordinates along axis `lat` (0 or 1) that certainly contains the positions
    /// from `low` to `high`, in metres. Each end is moved outwards by [`margin`](Self::margin).
    pub(crate) fn widened(&self, [low, high]: [f64; 2], lat: usize) -> [f64; 2] {
        [self.pixel(low, lat) - self.margin(lat), self.pixel(high, lat) + self.margin(lat)]
    }

    /// Returns, for lateral axes x and y, whether all points are at the window's rim of that axis or on its
    /// outer side, away from most objects. False for an axis without a rim. The points are exact and relative
    /// to the scene's origin.
    pub(crate) fn is_outside(&self, points: &[Vec3]) -> [bool; 2] {
        self.rims.map(|rim| {
            rim.is_some_and(|ExactRim { inwards, exact: (axis, at), .. }| {
                points.iter().all(|p| (f64::from(p[axis]) - at) * inwards <= 0.0)
            })
        })
    }

    /// Returns the part of a range of pixel coordinates that is on the outer side of the rim of lateral axis
    /// `lat`, see [`is_outside`](Self::is_outside). The caller knows that all points of the range are on the
    /// outer side or at the rim. Unchanged without a rim.
    pub(crate) fn clip_outwards(&self, range: [f64; 2], lat: usize) -> [f64; 2] {
        self.rims[lat].map_or(range, |rim| rim.clip_outwards(range))
    }

    /// Removes the first pixel on the inner side of the rim from a range of pixel coordinates along axis
    /// `lat` (0 or 1), if the range comes from the outer side and does not pass the rim. Unchanged without a
    /// rim. The range may then be empty, with its end below its start.
    pub(super) fn clip_at_rim(&self, range: [f64; 2], lat: usize) -> [f64; 2] {
        self.rims[lat].map_or(range, |rim| rim.clip_at_rim(range))
    }

    /// Returns the pixels that the projection of an occludee onto the plane may meet. The projection is its
    /// least and greatest coordinate along x, then along y, in metres. `bounds` are the occludee's bounds in
    /// scene coordinates. `None` if the projection is not within the window.
    pub(crate) fn pixels(&self, [x, y]: [[f64; 2]; 2], bounds: &Aabb) -> Option<PixelRect> {
        let along = |range: [f64; 2], lat| {
            let [mut low, mut high] = self.widened(range, lat);
            if let Some(rim) = &self.rims[lat] {
                let (axis, at) = rim.exact;
                let is_inside = if rim.inwards > 0.0 {
                    f64::from(bounds.min[axis]) >= at
                } else {
                    f64::from(bounds.max[axis]) <= at
                };
                if is_inside {
                    [low, high] = rim.clip_inwards([low, high]);
                }
            }
            (low >= 0.0 && high < SIDE as f64 && low <= high).then_some([low as usize, high as usize])
        };
        Some(PixelRect { x: along(x, 0)?, y: along(y, 1)? })
    }

    /// Returns, for each lateral axis, the least number of pixels that the projection of an occludee with a
    /// depth of at least `z` metres meets. At least 1.
    pub(crate) fn min_pixels(&self, direction: &Direction, z: f64) -> [usize; 2] {
        [0, 1].map(|lat| match self.rims[lat] {
            // Ranges may be cut off at the rim.
            Some(_) => 1,
            None => ((direction.least_width(self.d, z, lat) * self.scale[lat]) as usize).max(1),
        })
    }

    /// Returns the least and greatest coordinate of the window along x, then along y, in metres.
    pub(crate) fn ends(&self) -> [[f64; 2]; 2] {
        self.ends
    }

    /// Returns for each column (`lat` 0) or row (`lat` 1) of pixels of this window the first and last one of
    /// the earlier window `from` that asked rays through it may meet. This is the reprojection for rays from
    /// the viewcell.
    pub(crate) fn reprojection(&self, direction: &Direction, from: &Self, lat: usize) -> Ranges {
        // A ray from v, at depth w behind the front, to p on this plane meets the earlier plane at the
        // position p (1 - t) + v t with t = (d - from.d) / (d + w).
        let (h, gap) = (direction.half[lat], self.d - from.d);
        let t = [gap / self.d, gap / (self.d + direction.depth)];
        let size = self.pixel_size(lat);
        let mut ranges = [[0; 2]; SIDE];
        let (mut first, mut last) = (0, 0);
        for (i, range) in ranges.iter_mut().enumerate() {
            let mut a = self.ends[lat][0] + i as f64 * size;
            let mut b = self.ends[lat][0] + (i + 1) as f64 * size;
            if let Some(rim) = &self.rims[lat] {
                // The pixels on both sides of the rim end at the rim.
                let first_above = if rim.inwards > 0.0 { rim.inner } else { rim.inner + 1 };
                a = if i == first_above { rim.at } else { a };
                b = if i + 1 == first_above { rim.at } else { b };
            }
            let low = t.map(|t| a * (1.0 - t) - h * t);
            let high = t.map(|t| b * (1.0 - t) + h * t);
            // Asked rays stay within the earlier window, so pixels beyond its rim need not be blocked.
            let [mut low, mut high] = from.widened([low[0].min(low[1]), high[0].max(high[1])], lat);
            if let (Some(own), Some(other)) = (&self.rims[lat], &from.rims[lat])
                && own.exact == other.exact
                && own.inwards == other.inwards
                && (if own.inwards > 0.0 { i >= own.inner } else { i <= own.inner })
            {
                [low, high] = other.clip_inwards([low, high]);
            }
            let clamp = |x: f64| pixel_at(x.max(0.0).min((SIDE - 1) as f64));
            // In exact arithmetic the ends never decrease. Rounding must not make them decrease.
            first = clamp(low).max(first);
            last = clamp(high).max(last);
            *range = [first.min(last) as u16, last as u16];
        }
        ranges
    }
}

#[cfg(test)]
mod tests;
