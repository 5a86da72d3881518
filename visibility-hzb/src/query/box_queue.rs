//! A queue of occluder boxes that are to be drawn, so that several are projected together. Most of them turn
//! out to be hidden by occluders drawn before.

use super::box_projection::ProjectedBoxes;
use crate::lanes::WIDTH;
use visibility_core::Aabb;
use visibility_core::glam::Affine3A;

/// Queue of at most [`WIDTH`] occluder boxes, in the order in which they were added.
#[derive(Clone, Debug)]
pub(crate) struct BoxQueue {
    /// Number of queued boxes. Elements of the arrays at or beyond the count are stale.
    pub(crate) count: usize,
    /// Bounds of each box in its own coordinates.
    pub(crate) bounds: [Aabb; WIDTH],
    /// Transform of each box from its own coordinates to the scene.
    pub(crate) transforms: [Affine3A; WIDTH],
    /// For each box, true if the inner sides of its faces hide objects too (an eye inside the box sees
    /// them), false if only the outer sides do.
    pub(crate) two_sided: [bool; WIDTH],
    /// Axis-aligned bounds of each transformed box in scene coordinates: least x, y, z, then greatest x, y,
    /// z.
    pub(crate) around: [[f32; WIDTH]; 6],
    /// Screen bounds of the boxes in `around`, rounded outwards. Meaningful only while the queue is being
    /// drawn; stale otherwise.
    pub(crate) projected: ProjectedBoxes<WIDTH>,
}

impl BoxQueue {
    /// Queue without boxes.
    pub(crate) const EMPTY: Self = Self {
        count: 0,
        bounds: [Aabb::EMPTY; WIDTH],
        transforms: [Affine3A::IDENTITY; WIDTH],
        two_sided: [false; WIDTH],
        around: [[0.0; WIDTH]; 6],
        projected: ProjectedBoxes::NONE,
    };

    /// Returns axis-aligned bounds, in scene coordinates, of the box `bounds` transformed by `transform`. The
    /// result is rounded outwards, so it contains the transformed box. For the identity transform it is
    /// `bounds`.
    pub(crate) fn around(bounds: &Aabb, transform: &Affine3A) -> Aabb {
        if *transform == Affine3A::IDENTITY { *bounds } else { moved(bounds, transform) }
    }

    /// Appends the box `bounds`, in its own coordinates, which `transform` maps to the scene. `two_sided`:
    /// true if the inner sides of its faces hide objects too, false if only the outer sides do. Returns true
    /// if the queue is now full: the caller must empty it before the next call, which would overwrite the
    /// first box.
    pub(crate) fn push(&mut self, bounds: &Aabb, transform: &Affine3A, two_sided: bool) -> bool {
        let i = self.count % WIDTH;
        self.bounds[i] = *bounds;
        self.transforms[i] = *transform;
        self.two_sided[i] = two_sided;
        let around = Self::around(bounds, transform);
        for axis in 0..3 {
            self.around[axis][i] = around.min[axis];
            self.around[axis + 3][i] = around.max[axis];
        }
        self.count = i + 1;
        self.count == WIDTH
    }
}

/// Returns axis-aligned bounds, in scene coordinates, of the box `bounds` transformed by `transform`, rounded
/// outwards. The sums of four terms are off by less than 16 units of round-off of the sum of the terms'
/// magnitudes.
fn moved(bounds: &Aabb, transform: &Affine3A) -> Aabb {
    let (center, half) = (bounds.center(), bounds.half_extent());
    let m = transform.matrix3.abs();
    let middle = transform.transform_point3(center);
    let reach = m.mul_vec3(half);
    let size =
        m.mul_vec3(center.abs()) + reach + visibility_core::glam::Vec3::from(transform.translation).abs();
    let margin = size * (8.0 * f32::EPSILON) + f32::MIN_POSITIVE;
    Aabb::new(middle - reach - margin, middle + reach + margin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::random;
    use visibility_core::glam::Vec3;

    /// Corners that are transformed in `f64` lie within the box around the transformed box. The rounding of
    /// `f64` is far below that of `f32`.
    #[test]
    fn transformed_corners_are_within_the_box_around_them() {
        let mut random = random(4);
        for trial in 0..20_000 {
            let mut vector = |size: f64| Vec3::from_array([0; 3].map(|_| (size * random(-1.0, 1.0)) as f32));
            let [a, b, c, shift] = [vector(2.0), vector(2.0), vector(2.0), vector(100.0)];
            let transform = Affine3A::from_cols(a.into(), b.into(), c.into(), shift.into());
            let (p, q) = (vector(50.0), vector(50.0));
            let bounds = Aabb::new(p.min(q), p.max(q));
            let around = BoxQueue::around(&bounds, &transform);
            for corner in bounds.corners() {
                let [a, b, c, shift, p] = [a, b, c, shift, corner].map(Vec3::as_dvec3);
                let exact = a * p.x + b * p.y + c * p.z + shift;
                let inside = exact.cmpge(around.min.as_dvec3()) & exact.cmple(around.max.as_dvec3());
                assert!(inside.all(), "trial {trial}: {exact} is not within {around:?}");
            }
        }
    }
}
