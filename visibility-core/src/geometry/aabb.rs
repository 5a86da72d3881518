//! Axis-aligned bounding boxes in `f32`.

use crate::geometry::Containment;
use glam::{Affine3A, DAffine3, DVec3, Vec3, Vec3A};

/// An axis-aligned bounding box with closed sides, in metres relative to the origin of its scene.
///
/// A box with `min > max` on an axis or with a NaN is *improper*: it bounds nothing that can be relied on,
/// and cullers never hide its object. An infinite coordinate is allowed: the box has no end on that side. A
/// [`Scene`](crate::Scene) never culls objects whose bounds have an infinite coordinate.
///
/// ```
/// use visibility_core::Aabb;
/// let a = Aabb::from_arrays([0.0, 0.0, 0.0], [1.0, 2.0, 3.0]);
/// assert!(a.is_proper());
/// assert_eq!(a.union(&Aabb::EMPTY), a);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::Pod, bytemuck::Zeroable))]
#[repr(C)]
pub struct Aabb {
    /// Minimum corner: the least x, y and z of the box, inclusive.
    pub min: Vec3,
    /// Maximum corner: the greatest x, y and z of the box, inclusive.
    pub max: Vec3,
}

impl Aabb {
    /// Empty box, with `min` at infinity and `max` at minus infinity: improper, and the neutral element of
    /// [`union`](Self::union).
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// Returns the box with the given minimum and maximum corners, unchecked: with `min > max` on an axis or
    /// a NaN the box is improper.
    pub const fn new(min: Vec3, max: Vec3) -> Self {
        Self { min, max }
    }

    /// Like [`new`](Self::new), with the corners as `[x, y, z]` arrays for engines that use another version
    /// of glam.
    pub const fn from_arrays(min: [f32; 3], max: [f32; 3]) -> Self {
        Self::new(Vec3::from_array(min), Vec3::from_array(max))
    }

    /// Returns the smallest box around `points`. Without points the result is [`EMPTY`](Self::EMPTY). If any
    /// coordinate is NaN, the result is an improper box of NaN, whose object is never culled.
    pub fn from_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        let mut bounds = Self::EMPTY;
        for p in points {
            if p.is_nan() {
                return Self::new(Vec3::NAN, Vec3::NAN);
            }
            bounds.min = bounds.min.min(p);
            bounds.max = bounds.max.max(p);
        }
        bounds
    }

    /// Returns the smallest box that contains points given in `f64`: each side is that of the points where
    /// `f32` has its coordinate, and is rounded outwards elsewhere. [`EMPTY`](Self::EMPTY) without points,
    /// NaN if a coordinate is NaN.
    pub fn around(points: impl IntoIterator<Item = DVec3>) -> Self {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for at in points {
            if at.is_nan() {
                return Self::new(Vec3::NAN, Vec3::NAN);
            }
            (min, max) = (min.min(at), max.max(at));
        }
        let low = |exact: f64| {
            let nearest = exact as f32;
            if f64::from(nearest) <= exact { nearest } else { nearest.next_down() }
        };
        // A number is rounded up by rounding its negative down.
        let low = |corner: DVec3| Vec3::from_array(corner.to_array().map(low));
        Self::new(low(min), -low(-max))
    }

    /// Returns the box [around](Self::around) `points` where `transform` places them, computed in `f64`.
    pub(crate) fn around_placed(points: &[Vec3], transform: &DAffine3) -> Self {
        Self::around(points.iter().map(|point| transform.transform_point3(point.as_dvec3())))
    }

    /// Converts a world-space `f64` box to an `f32` box relative to `origin` that certainly contains it.
    /// Every coordinate is rounded to `f32` and then moved outwards by one step, also where the rounding was
    /// exact. A NaN coordinate stays NaN.
    #[inline]
    pub fn from_world(min: DVec3, max: DVec3, origin: DVec3) -> Self {
        // `min - origin` is itself rounded (half a unit in the last place of f64), which the step to the
        // neighbouring f32 covers: that step is at least 2^28 times as wide.
        Self::new(
            Vec3::from_array((min - origin).to_array().map(|x| (x as f32).next_down())),
            Vec3::from_array((max - origin).to_array().map(|x| (x as f32).next_up())),
        )
    }

    /// Tests whether the box is proper: no coordinate is NaN, and `min <= max` on each axis. A single point
    /// is proper.
    pub fn is_proper(&self) -> bool {
        self.min.cmple(self.max).all()
    }

    /// Tests whether the box is proper and all its coordinates are finite.
    pub fn is_finite(&self) -> bool {
        self.is_proper() && self.min.is_finite() && self.max.is_finite()
    }

    /// Returns the centre of the box. Both corners are halved before the addition, so that no finite box
    /// overflows.
    pub fn center(&self) -> Vec3 {
        self.min * 0.5 + self.max * 0.5
    }

    /// Returns half the size of the box on each axis, in metres. No finite box overflows.
    pub fn half_extent(&self) -> Vec3 {
        self.max * 0.5 - self.min * 0.5
    }

    /// Returns the squared diagonal of the box in square metres; an axis with `min > max` or NaN counts as 0.
    /// Computed in `f64`: the result never overflows, and despite rounding is never less than the result for
    /// a box inside this one.
    pub fn diagonal_squared(&self) -> f64 {
        let side = |axis: usize| {
            let side = f64::from(self.max[axis]) - f64::from(self.min[axis]);
            if side > 0.0 { side } else { 0.0 }
        };
        side(0) * side(0) + side(1) * side(1) + side(2) * side(2)
    }

    /// Returns the smallest box that contains `self` and `other`. Where a coordinate of `self` or `other` is
    /// NaN, the coordinate of the result is unspecified: NaN, or the coordinate of the box without NaN.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self::new(self.min.min(other.min), self.max.max(other.max))
    }

    /// Returns a box that certainly contains the image of this box under `transform`: every point of the box,
    /// mapped without rounding. On the axis with matrix row `(a, b, c)` and translation `t`, the result
    /// exceeds the smallest such box on each side by less than a millionth of the sum `|t| + |a min.x| + |a
    /// max.x| + |b min.y| + |b max.y| + |c min.z| + |c max.z|`. For a rotation, the result is the box around
    /// the rotated box, and thus larger than the rotated box.
    ///
    /// The identity returns the box unchanged. An improper box is returned unchanged. A NaN in `transform`,
    /// or an infinite side of the box that `transform` multiplies by 0, makes an improper box. Sides beyond
    /// the range of `f32` become infinite.
    ///
    /// ```
    /// use visibility_core::{glam::{Affine3A, Vec3}, Aabb};
    /// let moved = Affine3A::from_translation(Vec3::X);
    /// let bounds = Aabb::from_arrays([0.0; 3], [1.0; 3]).transformed(&moved);
    /// assert!(bounds.contains_point(Vec3::X) && bounds.contains_point(Vec3::new(2.0, 1.0, 1.0)));
    /// ```
    #[inline]
    #[must_use]
    pub fn transformed(&self, transform: &Affine3A) -> Self {
        if !self.is_proper() || *transform == Affine3A::IDENTITY {
            return *self;
        }
        let columns = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis];
        let mut low = transform.translation;
        let (mut high, mut size) = (low, low.abs());
        for (column, (min, max)) in
            columns.iter().zip(self.min.to_array().into_iter().zip(self.max.to_array()))
        {
            let (a, b) = (*column * min, *column * max);
            low += a.min(b);
            high += a.max(b);
            // The two magnitudes are added, where their maximum would do, because the sum is NaN if either is
            // NaN.
            size += a.abs() + b.abs();
        }
        // With u = 2^-24: each product errs by u of its magnitude and each of the three additions by u of its
        // result, which is at most the sum of the magnitudes, rounded: less than 4.1 u of that sum. The
        // subtraction below errs by u of its result, and `size`, which is at least that sum, by 5 u of
        // itself: less than 6 u in all. A product that underflows, also one flushed to zero, errs by at most
        // the least normal number.
        let margin = size * (3.0 * f32::EPSILON) + Vec3A::splat(4.0 * f32::MIN_POSITIVE);
        Self::new((low - margin).into(), (high + margin).into())
    }

    /// Tests whether `p` lies in the box or on its boundary. Returns false if `p` or the box has a NaN.
    pub fn contains_point(&self, p: Vec3) -> bool {
        self.min.cmple(p).all() && p.cmple(self.max).all()
    }

    /// Classifies the box `other` against this box: `Inside` if contained (shared sides included), `Outside`
    /// if separated by a gap on some axis, otherwise `Crossing`. Boxes that touch from outside are
    /// `Crossing`. The test only compares coordinates and is therefore exact. `Crossing` if `self` or `other`
    /// is improper.
    pub fn classify_aabb(&self, other: &Self) -> Containment {
        if !self.is_proper() || !other.is_proper() {
            return Containment::Crossing;
        }
        if other.max.cmplt(self.min).any() || other.min.cmpgt(self.max).any() {
            return Containment::Outside;
        }
        if self.min.cmple(other.min).all() && other.max.cmple(self.max).all() {
            return Containment::Inside;
        }
        Containment::Crossing
    }

    /// Returns the eight corners. Corner `i` has the maximum x if bit 0 of `i` is set, the maximum y if bit 1
    /// is set and the maximum z if bit 2 is set, otherwise the minimum.
    pub fn corners(&self) -> [Vec3; 8] {
        core::array::from_fn(|i| {
            Vec3::new(
                if i & 1 == 0 { self.min.x } else { self.max.x },
                if i & 2 == 0 { self.min.y } else { self.max.y },
                if i & 4 == 0 { self.min.z } else { self.max.z },
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, Mat3A};
    use visibility_testing::Random;

    #[test]
    fn boxes_around_points_are_the_smallest_that_hold_them() {
        let mut random = Random(91);
        for round in 0..1000 {
            let points = [(); 4].map(|()| random.fine_vector(1e3));
            let around = Aabb::around(points);
            let (min, max) = points.iter().fold((points[0], points[0]), |(a, b), p| (a.min(*p), b.max(*p)));
            for axis in 0..3 {
                let [low, high] = [around.min[axis], around.max[axis]].map(f64::from);
                assert!(low <= min[axis] && max[axis] <= high, "{round}: {points:?} in {around:?}");
                let next = [around.min[axis].next_up(), around.max[axis].next_down()].map(f64::from);
                assert!(next[0] > min[axis] && next[1] < max[axis], "{round}: {around:?} is too large");
            }
        }
        let whole = [DVec3::new(1.0, -2.0, 3.0), DVec3::new(4.0, 5.0, -6.0)];
        let expected = Aabb::from_arrays([1.0, -2.0, -6.0], [4.0, 5.0, 3.0]);
        assert_eq!(Aabb::around(whole), expected, "numbers that `f32` has");
        assert_eq!(Aabb::around([]), Aabb::EMPTY, "no points");
        assert!(!Aabb::around([DVec3::NAN, DVec3::ONE]).is_proper(), "a point of NaN");
    }

    #[test]
    fn bounds_of_points_are_rounded_outwards() {
        let [near, far] = [DVec3::new(1.0, 4.0, -3.0), DVec3::new(2.0, 5.0, 3.0)];
        let exact = Aabb::new(near.as_vec3(), far.as_vec3());
        let mixed = [DVec3::new(1.0, 5.0, -3.0), DVec3::new(2.0, 4.0, 3.0)];
        assert_eq!(Aabb::around(mixed), exact, "points of `f32`");
        let step = |v: Vec3, up: bool| v.to_array().map(|x| if up { x.next_up() } else { x.next_down() });
        let beside = Aabb::around([near - 1e-12, far + 1e-12]);
        assert_eq!(
            beside,
            Aabb::from_arrays(step(exact.min, false), step(exact.max, true)),
            "points beside them"
        );
        assert_eq!(Aabb::around([near + 1e-12, far - 1e-12]), exact, "points just inside");
    }

    #[test]
    fn boxes_of_the_world_hold_theirs() {
        let mut random = Random(92);
        for round in 0..1000 {
            let (origin, min) = (random.fine_vector(1e6), random.fine_vector(1e6));
            let max = min + random.fine_vector(5.0).abs();
            let bounds = Aabb::from_world(min, max, origin);
            let [low, high] = [bounds.min, bounds.max].map(|corner| corner.as_dvec3());
            assert!(low.cmplt(min - origin).all() && high.cmpgt(max - origin).all(), "{round}: {bounds:?}");
        }
    }

    #[test]
    fn boxes_are_finite_with_both_corners() {
        let end = f32::INFINITY;
        for (bounds, is_finite) in [
            (Aabb::from_arrays([0.0; 3], [1.0; 3]), true),
            (Aabb::from_arrays([0.0, -end, 0.0], [1.0; 3]), false),
            (Aabb::from_arrays([0.0; 3], [1.0, 1.0, end]), false),
            (Aabb::from_arrays([2.0, 0.0, 0.0], [1.0; 3]), false),
        ] {
            assert_eq!(bounds.is_finite(), is_finite, "{bounds:?}");
        }
    }

    /// Images of corners, in double precision: of random affine maps, and of maps whose terms cancel.
    #[test]
    fn transformed_boxes_hold_the_images_of_their_corners() {
        let mut random = Random(93);
        let mut nearly_off = 0;
        for round in 0..20_000 {
            let a = random.vec3(-9.0, 9.0);
            let bounds = Aabb::new(a, a + random.vec3(0.0, if round % 3 == 0 { 1e-6 } else { 2.0 }));
            let columns = [(); 3].map(|()| random.vec3(-1.0, 1.0));
            let mut transform = Affine3A::from_mat3_translation(
                glam::Mat3::from_cols(columns[0], columns[1], columns[2]),
                random.vec3(-9.0, 9.0),
            );
            if round % 2 == 0 {
                // The middle of the box is taken nearly to the origin.
                transform.translation = -(transform.matrix3 * Vec3A::from(bounds.center()));
            }
            let image = bounds.transformed(&transform);
            let Mat3A { x_axis, y_axis, z_axis } = transform.matrix3;
            let matrix = DMat3::from_cols(x_axis.as_dvec3(), y_axis.as_dvec3(), z_axis.as_dvec3());
            for corner in bounds.corners() {
                let at = matrix * corner.as_dvec3() + transform.translation.as_dvec3();
                let (low, high) = (image.min.as_dvec3(), image.max.as_dvec3());
                assert!(low.cmple(at).all() && at.cmple(high).all(), "{round}: {at} is outside of {image:?}");
                // Without a margin some corners are outside.
                let size = x_axis.abs() * corner.x.abs() + y_axis.abs() * corner.y.abs();
                let size = size + z_axis.abs() * corner.z.abs() + transform.translation.abs();
                let margin = size.as_dvec3() * (6.0 * f64::from(f32::EPSILON));
                nearly_off += usize::from((low + margin).cmpgt(at).any() || (high - margin).cmplt(at).any());
            }
        }
        assert!(nearly_off > 100, "{nearly_off} corners need a margin");
        // Products that underflow, also where they are flushed to zero.
        let tiny = Affine3A::from_scale(glam::Vec3::splat(1e-30));
        let image = Aabb::from_arrays([-1e-9; 3], [1e-9; 3]).transformed(&tiny);
        assert!(image.min.x < -f32::MIN_POSITIVE && image.max.x > f32::MIN_POSITIVE, "{image:?}");
        let bounds = Aabb::from_arrays([0.1; 3], [0.7; 3]);
        assert_eq!(bounds.transformed(&Affine3A::IDENTITY), bounds, "the identity");
        let inverted = Aabb::from_arrays([1.0; 3], [0.0; 3]);
        let moved = Affine3A::from_translation(Vec3::X);
        assert_eq!(inverted.transformed(&moved), inverted, "an improper box");
    }

    #[test]
    fn boxes_are_closed() {
        let unit = Aabb::from_arrays([0.0; 3], [1.0; 3]);
        for axis in 0..3 {
            let at = |x: f32| Vec3::splat(0.5).with_axis(axis, x);
            let inside = [0.0, 1.0].map(|x| unit.contains_point(at(x)));
            assert_eq!(inside, [true; 2], "axis {axis}: points of sides");
            let outside = [-0.1, 1.1].map(|x| unit.contains_point(at(x)));
            assert_eq!(outside, [false; 2], "axis {axis}: points beyond sides");
            let spanning = |from: f32, to: f32| {
                let [min, max] =
                    [Vec3::splat(0.25).with_axis(axis, from), Vec3::splat(0.75).with_axis(axis, to)];
                unit.classify_aabb(&Aabb::new(min, max))
            };
            for (from, to, expected) in [
                (0.0, 1.0, Containment::Inside),
                (-0.5, 1.0, Containment::Crossing),
                (0.0, 1.5, Containment::Crossing),
                (-1.0, 0.0, Containment::Crossing),
                (1.0, 2.0, Containment::Crossing),
                (-1.0, -0.1, Containment::Outside),
                (1.1, 2.0, Containment::Outside),
            ] {
                assert_eq!(spanning(from, to), expected, "axis {axis}: from {from} to {to}");
            }
        }
        let inverted = Aabb::from_arrays([9.0; 3], [8.0; 3]);
        assert_eq!(unit.classify_aabb(&inverted), Containment::Crossing, "an improper box");
        assert_eq!(inverted.classify_aabb(&unit), Containment::Crossing, "against an improper box");
    }

    trait WithAxis {
        fn with_axis(self, axis: usize, x: f32) -> Self;
    }

    impl WithAxis for Vec3 {
        fn with_axis(mut self, axis: usize, x: f32) -> Self {
            self[axis] = x;
            self
        }
    }
}
