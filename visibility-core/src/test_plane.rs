//! A plane in the form that the box test of the SIMD kernel uses: in `f32`, with margins greater than all
//! rounding errors of the test.

use crate::view::ViewPlane;

/// A plane of a view prepared for the `f32` box test of the SIMD kernel. The kernel computes an upper bound
/// on the greatest signed distance of any point of a box from the plane, times 1/4; a box whose bound is
/// negative is outside.
///
/// The plane is scaled to a normal `n` of length 1/4, so that no sum of three products overflows, and its
/// offset `d` is scaled alike. The point of the box that is farthest along `n` is its corner `p`, with the
/// greater coordinate where `n` is positive and the least coordinate elsewhere. The kernel computes the sum
/// `S = ((X + Y) + Z) + offset`, where `X = max(p.x high.x, p.x low.x)`, and `Y` and `Z` likewise. `S` must
/// never be less than the exact `n . p + d`. With `u = 2^-24`:
///
/// - `high` and `low` are `n +- (8u |n| + 2^-125)`, rounded once, so `X >= n.x p.x + |p.x| (7u |n.x| +
///   2^-125)` but for the rounding of the product, `u |X|`. The term `2^-125` stands in for components of `n`
///   that `f32` cannot hold or flushes to zero.
/// - Each of the three sums rounds by at most `u` of the magnitudes that it adds up: `3u (|X| + |Y| + |Z|) +
///   3u |offset|` together.
/// - So `4u` of each product's magnitude are needed, and `7u` are provided.
/// - `offset` is `d + 8u |d|` plus the error of `d` itself, rounded once: `7u |d|` are provided and `3u |d|`
///   are needed.
/// - Numbers below `2^-126` may be flushed to zero: three coordinates (times at most 1), three products,
///   three sums. `2^-122`, which is 16 times as much, covers these nine.
///
/// A box with an infinite coordinate gives an infinite `X` of the right sign, or NaN, which the kernel treats
/// as undecided: the box is not outside.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TestPlane {
    /// Upper bound on each component of the normal, scaled to length 1/4.
    pub(crate) high: [f32; 3],
    /// Lower bound on each component of the normal, scaled to length 1/4.
    pub(crate) low: [f32; 3],
    /// Upper bound on the plane's offset, scaled by 1/4, relative to the origin of the tested boxes.
    pub(crate) offset: f32,
    /// For each axis, whether the test uses a box's greatest coordinate (`true`, where the normal's
    /// component is not negative) or its least coordinate (`false`).
    pub(crate) greatest: [bool; 3],
}

/// Margin of `high`, `low` and `offset`, relative to their magnitude: eight times the unit round-off of
/// `f32`.
const MARGIN: f64 = 4.0 * f32::EPSILON as f64;

impl TestPlane {
    /// A plane that has every box on its inner side, for unused elements of arrays.
    pub(crate) const EVERYTHING_INSIDE: Self =
        Self { high: [0.0; 3], low: [0.0; 3], offset: f32::INFINITY, greatest: [true; 3] };

    pub(crate) fn new(view_plane: &ViewPlane) -> Self {
        let ViewPlane { plane, error } = view_plane;
        let least = f64::from(f32::MIN_POSITIVE);
        let n = (plane.normal * 0.25).to_array();
        let (d, error) = (plane.offset * 0.25, error * 0.25);
        Self {
            high: n.map(|n| (n + (MARGIN * n.abs() + 2.0 * least)) as f32),
            low: n.map(|n| (n - (MARGIN * n.abs() + 2.0 * least)) as f32),
            offset: (d + (MARGIN * d.abs() + error + 16.0 * least)) as f32,
            greatest: n.map(|n| n >= 0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;
    use crate::geometry::Plane;
    use crate::scene::Boxes64;
    use crate::simd::{Kernels, Simd};
    use crate::view::MAX_PLANES;
    use glam::{DVec3, Vec3};
    use visibility_testing::{Random, sign_of_sum};

    /// Returns whether the kernel finds the point `p` outside a plane, whose offset may be off by `error`.
    fn is_outside(plane: Plane, error: f64, p: Vec3) -> bool {
        let mut planes = [TestPlane::EVERYTHING_INSIDE; MAX_PLANES];
        planes[0] = TestPlane::new(&ViewPlane { plane, error });
        let mut boxes = Boxes64::EMPTY;
        boxes.set(0, &Aabb::new(p, p));
        Simd::PORTABLE.any_outside(&boxes, &planes, 1) & 1 != 0
    }

    /// Planes that pass a point by less than a rounding of `f64`, of normals and points whose coordinates are
    /// of unlike magnitudes.
    #[test]
    fn a_point_on_a_plane_is_not_outside() {
        let mut rng = Random(1);
        for case in 0..20_000 {
            let mut normal = rng.direction();
            normal[rng.below(3)] *= 2f64.powi(rng.between(-40, 0));
            let normal = normal.normalize();
            let size = 2f64.powi(rng.between(-60, 60));
            let mut p = rng.fine_vector(size);
            p[rng.below(3)] *= 2f64.powi(rng.between(-30, 0));
            let (p, error) = (p.as_vec3(), rng.pick(&[0.0, 1e-3, 1e3]) * size);
            let mut offset = -normal.dot(p.as_dvec3()) - error;
            let side = |offset: f64| {
                let products = normal.to_array().into_iter().zip(p.as_dvec3().to_array());
                sign_of_sum(products.chain([(offset, 1.0), (error, 1.0)]))
            };
            while side(offset) < 0 {
                offset = offset.next_up();
            }
            let plane = Plane::new(normal, offset);
            assert!(!is_outside(plane, error, p), "case {case}: {p} on {plane:?}, error {error}");
            // A point further beyond than all roundings together is outside.
            let beyond = 64.0 * f64::from(f32::EPSILON) * (offset.abs() + error + size * 2.0);
            let plane = Plane::new(normal, offset - beyond);
            assert!(is_outside(plane, error, p), "case {case}: {p} beyond {plane:?}, error {error}");
        }
    }

    /// Components of a normal that `f32` cannot hold, at points so far away that they decide.
    #[test]
    fn tiny_components_of_a_normal_count() {
        let (far, tiny) = (2f32.powi(127), 2f64.powi(-152));
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                let (mut normal, mut p) = (DVec3::ZERO, Vec3::ZERO);
                (normal[axis], p[axis]) = (sign * tiny, sign as f32 * far);
                normal[(axis + 1) % 3] = 1.0;
                // The point is 2^-25 m from the plane without its offset.
                let plane = Plane::new(normal, -2f64.powi(-26));
                assert!(!is_outside(plane, 0.0, p), "{p} is before {plane:?} by 2^-26 m");
            }
        }
    }

    /// Products that underflow: three steps of the least number along each axis are 5.2 of them along the
    /// normal, but each product, a quarter of that, is rounded to zero.
    #[test]
    fn products_that_underflow_count() {
        let least = f64::from(f32::from_bits(1));
        let p = Vec3::splat(f32::from_bits(3));
        let plane = Plane::new(DVec3::splat(1.0 / 3f64.sqrt()), -5.0 * least);
        assert!(plane.normal.dot(p.as_dvec3()) > 5.0 * least, "the point is inside");
        assert!(!is_outside(plane, 0.0, p), "a point before a plane by a fifth of the least number");
    }
}
