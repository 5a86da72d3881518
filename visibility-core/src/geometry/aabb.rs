//! Axis-aligned boxes.

use crate::geometry::Containment;
use glam::{DVec3, Vec3};

/// An axis-aligned box, both corners included, in metres relative to the origin of its scene.
///
/// A box with `min > max` on an axis or with a NaN is *improper*: it bounds nothing that can be relied on,
/// so cullers never hide it. An infinite coordinate is allowed and has its plain meaning here; a
/// [`Scene`](crate::Scene) treats objects with such bounds as never culled.
///
/// ```
/// use visibility_core::Aabb;
/// let a = Aabb::from_arrays([0.0, 0.0, 0.0], [1.0, 2.0, 3.0]);
/// assert!(a.is_proper());
/// assert_eq!(a.union(&Aabb::EMPTY), a);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Aabb {
    /// The corner with the least coordinates.
    pub min: Vec3,
    /// The corner with the greatest coordinates.
    pub max: Vec3,
}

impl Aabb {
    /// The neutral element of [`union`](Self::union): bounds nothing, and is improper.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// A box between two corners, taken as they are.
    pub const fn new(min: Vec3, max: Vec3) -> Self {
        Self { min, max }
    }

    /// As [`new`](Self::new), from arrays, for engines with another version of glam.
    pub const fn from_arrays(min: [f32; 3], max: [f32; 3]) -> Self {
        Self::new(Vec3::from_array(min), Vec3::from_array(max))
    }

    /// The smallest box around points. With no point, [`EMPTY`](Self::EMPTY); with a NaN anywhere, a box
    /// that is improper, so that the object is drawn rather than lost.
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

    /// The smallest `f32` box, relative to `origin`, around a world-space box in `f64`: rounded outwards.
    pub fn from_world(min: DVec3, max: DVec3, origin: DVec3) -> Self {
        // `min - origin` is itself rounded (half a unit in the last place of f64), which the step to the
        // neighbouring f32 covers: that step is at least 2^28 times as wide.
        Self::new(
            Vec3::from_array((min - origin).to_array().map(|x| (x as f32).next_down())),
            Vec3::from_array((max - origin).to_array().map(|x| (x as f32).next_up())),
        )
    }

    /// Whether the box bounds something: no NaN, and `min <= max` on each axis.
    pub fn is_proper(&self) -> bool {
        self.min.cmple(self.max).all()
    }

    /// Whether the box is proper and all its coordinates are finite.
    pub fn is_finite(&self) -> bool {
        self.is_proper() && self.min.is_finite() && self.max.is_finite()
    }

    /// The middle. Halves before it adds, so that it does not overflow for any finite box.
    pub fn center(&self) -> Vec3 {
        self.min * 0.5 + self.max * 0.5
    }

    /// Half the size on each axis; does not overflow for any finite box.
    pub fn half_extent(&self) -> Vec3 {
        self.max * 0.5 - self.min * 0.5
    }

    /// The smallest box around both. NaN coordinates are ignored.
    pub fn union(&self, other: &Self) -> Self {
        Self::new(self.min.min(other.min), self.max.max(other.max))
    }

    /// Whether the point lies in the box, boundary included. False for NaN.
    pub fn contains_point(&self, p: Vec3) -> bool {
        self.min.cmple(p).all() && p.cmple(self.max).all()
    }

    /// Where `other` lies with respect to this box. Exact, since it only compares; `Crossing` when either
    /// box is improper.
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

    /// The eight corners; bit 0 of the index chooses max x, bit 1 max y, bit 2 max z.
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
