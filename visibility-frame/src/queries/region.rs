//! Regions that area queries test 64 boxes against.

use visibility_core::Aabb;
use visibility_core::frustum::ConvexVolume;
use visibility_core::geometry::Sphere;
use visibility_core::scene::{Boxes64, FAN_OUT, lanes};

/// A part of space that 64 boxes are tested against. In the masks that it returns, bit i stands for lane i;
/// lanes without a box may have any value.
pub(crate) trait Region {
    /// False if [`outside`](Self::outside) always returns 0, as for the region of all space.
    const EXCLUDES: bool = true;

    /// Returns the lanes whose box certainly does not touch the region.
    fn outside(&self, boxes: &Boxes64) -> u64;

    /// Returns the lanes whose box is certainly inside the region, so that every box within the lane's box
    /// touches the region.
    fn inside(&self, boxes: &Boxes64) -> u64;
}

/// Region that is all of space.
pub(super) struct Everywhere;

impl Region for Everywhere {
    const EXCLUDES: bool = false;

    fn outside(&self, _: &Boxes64) -> u64 {
        0
    }

    fn inside(&self, _: &Boxes64) -> u64 {
        u64::MAX
    }
}

impl Region for ConvexVolume {
    fn outside(&self, boxes: &Boxes64) -> u64 {
        self.outside(boxes, self.all())
    }

    fn inside(&self, boxes: &Boxes64) -> u64 {
        lanes(self.all().into()).fold(u64::MAX, |mask, plane| mask & self.inside(boxes, plane))
    }
}

/// A closed box, or all of space instead of an improper one.
pub(super) struct BoxRegion(Aabb);

impl BoxRegion {
    pub(super) fn new(area: &Aabb) -> Self {
        let infinite = Aabb::from_arrays([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]);
        Self(if area.is_proper() { *area } else { infinite })
    }
}

impl Region for BoxRegion {
    fn outside(&self, boxes: &Boxes64) -> u64 {
        let (c, Aabb { min, max }) = (boxes.coordinates(), self.0);
        mask_of(|i| {
            (c[0][i] > max.x)
                | (c[1][i] > max.y)
                | (c[2][i] > max.z)
                | (c[3][i] < min.x)
                | (c[4][i] < min.y)
                | (c[5][i] < min.z)
        })
    }

    fn inside(&self, boxes: &Boxes64) -> u64 {
        let (c, Aabb { min, max }) = (boxes.coordinates(), self.0);
        mask_of(|i| {
            (c[0][i] >= min.x)
                & (c[1][i] >= min.y)
                & (c[2][i] >= min.z)
                & (c[3][i] <= max.x)
                & (c[4][i] <= max.y)
                & (c[5][i] <= max.z)
        })
    }
}

/// A ball, as a centre and bounds on its squared radius with margins for all rounding in `f32`.
///
/// The squared distance `D` of a box is computed as the sum of the squares of three gaps. With `u = 2^-24`, a
/// gap is a difference, rounded by `u` of itself; a square doubles that and adds `u`; two sums add `2u`. All
/// terms are positive, so `D` is off by less than `6u` of itself, and by 2^-122 where gaps below 2^-125 are
/// flushed to zero or rounded: such gaps matter only if `D` is below 2^-150. A `D` that overflows stands for
/// at least 2^128 (1 - 6u).
///
/// - A box is outside if `D` exceeds `greatest`, the squared radius times `1 + 16u` plus 2^-122: `10u` are
///   left for the conversion of the radius and of the sum to `f32`, which need `2u`. Where underflow makes
///   `D` too small, more boxes are found.
/// - A box is inside if `D` of its farthest corner is at most `least`, the squared radius times `1 - 16u`
///   minus 2^-122.
pub(crate) struct SphereRegion {
    center: [f32; 3],
    greatest: f32,
    least: f32,
}

/// Relative margin of squared radii, sixteen times the unit round-off of `f32`.
const MARGIN: f64 = 8.0 * f32::EPSILON as f64;

impl SphereRegion {
    pub(crate) fn new(sphere: &Sphere) -> Self {
        let center = sphere.center.to_array();
        if !sphere.is_proper() {
            return Self { center, greatest: f32::INFINITY, least: -1.0 };
        }
        let squared = f64::from(sphere.radius) * f64::from(sphere.radius);
        let absolute = 16.0 * f64::from(f32::MIN_POSITIVE);
        Self {
            center,
            greatest: (squared * (1.0 + MARGIN) + absolute) as f32,
            // An infinite radius gives an infinite bound, and every finite box is within that bound.
            least: (squared * (1.0 - MARGIN) - absolute) as f32,
        }
    }

    /// For each box, returns the squares of `gap(c, min, max)` summed over the axes, where `c` is the
    /// centre's coordinate on the axis, `min` and `max` those of the box.
    #[inline(always)]
    fn squares(&self, boxes: &Boxes64, gap: impl Fn(f32, f32, f32) -> f32) -> [f32; FAN_OUT] {
        let mut sums = [0.0; FAN_OUT];
        for (axis, &center) in self.center.iter().enumerate() {
            let (min, max) = (&boxes.coordinates()[axis], &boxes.coordinates()[axis + 3]);
            for ((sum, &min), &max) in sums.iter_mut().zip(min).zip(max) {
                let gap = gap(center, min, max);
                *sum += gap * gap;
            }
        }
        sums
    }
}

impl Region for SphereRegion {
    fn outside(&self, boxes: &Boxes64) -> u64 {
        let squares = self.squares(boxes, |c, min, max| greater(greater(min - c, c - max), 0.0));
        mask_of(|i| squares[i] > self.greatest)
    }

    fn inside(&self, boxes: &Boxes64) -> u64 {
        let squares = self.squares(boxes, |c, min, max| greater(c - min, max - c));
        mask_of(|i| squares[i] <= self.least)
    }
}

/// Returns the greater of two numbers, `b` if either is NaN.
#[inline(always)]
pub(super) fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Returns the mask of the lanes for which `test` holds; bit i stands for lane i.
#[inline(always)]
pub(super) fn mask_of(test: impl Fn(usize) -> bool) -> u64 {
    // Bytes are written first, since these comparisons compile to SIMD.
    let mut bits = [0u8; FAN_OUT];
    for (i, bit) in bits.iter_mut().enumerate() {
        *bit = u8::from(test(i));
    }
    (0..8).fold(0, |mask, byte| {
        let eight = (0..8).fold(0, |eight, i| eight | u64::from(bits[byte * 8 + i]) << i);
        mask | eight << (byte * 8)
    })
}
