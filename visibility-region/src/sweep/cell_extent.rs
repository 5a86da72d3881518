//! The extent of a viewcell along any axis, and the axes along which the box around it is smallest. For a
//! viewcell that planes make an oriented box, these are the axes of that box.

use alloc::vec::Vec;
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;

/// Greatest number of planes of a viewcell whose normals are tried as axes, in pairs.
const MAX_AXES: usize = 16;

/// Axes other than the scene's are used if the box around the viewcell along them has less than this fraction
/// of the surface of the box along the scene's axes. Bounds of objects are boxes along the scene's axes, and
/// grow when turned: with a smaller gain, more objects are found visible (measured).
const SMALLER: f64 = 0.3;

/// A viewcell with its planes, in metres relative to the scene's origin.
#[derive(Clone, Debug)]
pub(crate) struct CellExtent {
    pub(crate) min: DVec3,
    pub(crate) max: DVec3,
    /// Bound on the rounding errors of `min` and `max` on each axis, in metres.
    error: DVec3,
    /// Half-spaces with unit normals that contain the viewcell. Each has a bound in metres on the rounding of
    /// its offset.
    planes: Vec<(Plane, f64)>,
}

impl CellExtent {
    /// Returns the extent of a viewcell. `None` if its box is inverted or not finite. Planes that cannot be
    /// normalized are left out.
    pub(crate) fn new(cell: &Viewcell, origin: DVec3) -> Option<Self> {
        let (min, max) = (cell.min - origin, cell.max - origin);
        if !(min.is_finite() && max.is_finite() && cell.min.cmple(cell.max).all()) {
            return None;
        }
        let relative = |plane: Plane| {
            let offset = plane.signed_distance(origin);
            // Normals of unit length round by 4 EPSILON, and the sum of four terms by 4 EPSILON of their
            // magnitudes.
            let error = 8.0 * f64::EPSILON * (origin.abs().element_sum() + plane.offset.abs());
            (Plane::new(plane.normal, offset), error)
        };
        // A plane whose offset or error is not finite has a margin in `least` that is not finite either, and
        // so a bound of minus infinity or NaN, which bounds nothing.
        let planes = cell.planes.iter().filter_map(Plane::normalized).map(relative);
        // With an origin of zero, the differences are exact. Otherwise they round by half an EPSILON of their
        // result.
        let error = DVec3::select(origin.cmpeq(DVec3::ZERO), DVec3::ZERO, min.abs().max(max.abs()));
        let error = error * f64::EPSILON;
        Some(Self { min, max, error, planes: planes.collect() })
    }

    /// Returns the ends, in metres, of the viewcell's box along a scene axis (0 to 2), rounded outwards.
    pub(crate) fn ends(&self, axis: usize) -> [f64; 2] {
        [self.min[axis] - self.error[axis], self.max[axis] + self.error[axis]]
    }

    /// Returns a lower bound, in metres, of the positions of the viewcell's points along an axis of about
    /// unit length. It is correct up to the rounding of three products and two sums.
    ///
    /// The result is the greatest of several bounds: that of the viewcell's box, and one for each half-space
    /// `m . x >= -d` of the viewcell with `axis . m > 0`. With `s = axis - (axis . m) m`, each point `x` of
    /// the half-space has `axis . x >= (axis . m) (-d) + s . x`, and the box bounds `s . x`.
    pub(crate) fn least(&self, axis: DVec3) -> f64 {
        let of_box = |axis: DVec3| (axis * self.min).min(axis * self.max).element_sum();
        let reach = self.min.abs().max(self.max.abs()).element_sum();
        let of_plane = |&(plane, error): &(Plane, f64)| {
            let part = axis.dot(plane.normal);
            // The remainder of the axis rounds by less than 4 EPSILON on each axis.
            let margin = error + 16.0 * f64::EPSILON * (reach + plane.offset.abs());
            (part > 0.0).then(|| of_box(axis - part * plane.normal) - part * plane.offset - margin)
        };
        self.planes.iter().filter_map(of_plane).fold(of_box(axis), f64::max)
    }

    /// Returns lower and upper bounds, in metres, of the positions of the viewcell's points along three axes
    /// of about unit length. For an empty viewcell, a lower bound may exceed the upper one.
    pub(crate) fn along(&self, axes: [DVec3; 3]) -> (DVec3, DVec3) {
        let least = DVec3::from_array(axes.map(|axis| self.least(axis)));
        (least, -DVec3::from_array(axes.map(|axis| self.least(-axis))))
    }

    /// Returns three orthogonal axes of unit length, right-handed, along which the box around the viewcell is
    /// small.
    pub(crate) fn axes(&self) -> [DVec3; 3] {
        let surface = |axes: [DVec3; 3]| {
            let (low, high) = self.along(axes);
            let size = (high - low).max(DVec3::ZERO);
            size.x * size.y + size.y * size.z + size.z * size.x
        };
        let normals = self.planes.iter().take(MAX_AXES).map(|(plane, _)| plane.normal);
        let normals: Vec<DVec3> = DVec3::AXES.into_iter().chain(normals).collect();
        let (mut best, mut least) = (DVec3::AXES, surface(DVec3::AXES) * SMALLER);
        for (i, &first) in normals.iter().enumerate().skip(3) {
            for &other in &normals[..i] {
                let across = other - other.dot(first) * first;
                let second = across.normalize_or_zero();
                let axes = [first, second, first.cross(second)];
                // Normals that are nearly parallel give no axes.
                if across.length() > 0.1 && surface(axes) < least {
                    (best, least) = (axes, surface(axes));
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;
    use visibility_core::geometry::DoubleDouble;
    use visibility_core::glam::DQuat;

    /// Makes a viewcell that is an oriented box, given by its rotation, middle and half sizes.
    fn oriented(turn: DQuat, middle: DVec3, half: DVec3) -> Viewcell {
        let axes = DVec3::AXES.map(|axis| turn * axis);
        let reach = (0..3).map(|i| axes[i].abs() * half[i]).sum::<DVec3>();
        let mut cell = Viewcell::from_box(middle - reach, middle + reach);
        cell.planes = (0..3)
            .flat_map(|i| [axes[i], -axes[i]].map(|normal| Plane::through(middle - normal * half[i], normal)))
            .collect();
        cell
    }

    #[test]
    fn boxes_around_oriented_viewcells_contain_them_and_are_tight() {
        for far in [0.0, 1e6] {
            for turn in [0.1, 0.8, 1.3].map(|angle| DQuat::from_axis_angle(DVec3::new(0.0, 0.6, 0.8), angle))
            {
                let (middle, half) = (DVec3::splat(far), DVec3::new(5.0, 1.0, 0.5));
                let origin = DVec3::new(far, 0.0, far);
                let cell = oriented(turn, middle, half);
                let extent = CellExtent::new(&cell, origin).unwrap();
                let axes = extent.axes();
                let (low, high) = extent.along(axes);
                let corners = (0..8).map(|i: i32| {
                    let sign = |bit: i32| if i >> bit & 1 != 0 { 1.0 } else { -1.0 };
                    middle - origin + turn * (half * DVec3::new(sign(0), sign(1), sign(2)))
                });
                for corner in corners {
                    let p = DVec3::from_array(axes.map(|axis| axis.dot(corner)));
                    let error = 1e-15 * (1.0 + corner.abs().element_sum());
                    assert!((low - error).cmple(p).all() && p.cmple(high + error).all(), "{p} {low} {high}");
                }
                let mut size = (high - low).to_array();
                size.sort_by(f64::total_cmp);
                let error = (DVec3::from_array(size) - DVec3::new(1.0, 2.0, 10.0)).abs().max_element();
                assert!(error < 1e-7 || turn.to_axis_angle().1 < 0.2, "{size:?}");
            }
        }
        let plain = Viewcell::from_box(-DVec3::ONE, DVec3::ONE);
        let cut = Viewcell { planes: vec![Plane::new(DVec3::new(1.0, 1.0, 0.0), 0.0)], ..plain.clone() };
        for cell in [plain, cut] {
            assert_eq!(
                CellExtent::new(&cell, DVec3::ZERO).unwrap().axes(),
                DVec3::AXES,
                "{cell:?} has the axes of the world"
            );
        }
    }

    /// Bounds along the normal of a plane hold the points of that plane, far from the origin of the world,
    /// where the plane's offset cancels. Compared in double-double numbers.
    #[test]
    fn bounds_by_planes_are_right_up_to_rounding() {
        let mut random = visibility_testing::Random(1);
        for trial in 0..20_000 {
            // The origin and a point of the plane are integers, and so is the plane.
            let far = [1e3, 1e9][trial % 2];
            let integers = |random: &mut visibility_testing::Random, size| random.vector(size).round();
            let (origin, local) = (integers(&mut random, far), integers(&mut random, 8.0));
            let (point, normal) = (origin + local, integers(&mut random, 1e3));
            if normal == DVec3::ZERO {
                continue;
            }
            let mut cell = Viewcell::from_box(origin - 8.0, origin + 8.0);
            cell.planes = vec![Plane::new(normal, -normal.dot(point))];
            let extent = CellExtent::new(&cell, origin).unwrap();
            for axis in [normal.normalize(), random.direction()] {
                let least = extent.least(axis);
                let [x, y, z] = [0, 1, 2].map(|k| DoubleDouble::product(axis[k], local[k]));
                let exact = x.plus(y).plus(z).plus(DoubleDouble::from(-least)).hi;
                // The rounding of three products and two sums is left to the caller.
                let allowed = 4.0 * f64::EPSILON * local.abs().element_sum();
                assert!(exact >= -allowed, "trial {trial}: {local} is {exact} above {least}, {normal}");
            }
        }
    }

    /// Planes through the origin, where neither offsets nor their errors are anything: their normals round.
    /// The bound along a normal holds without what is left to the caller, since the box adds nothing to it.
    /// The viewcell begins or ends at the origin along each axis.
    #[test]
    fn bounds_by_planes_hold_for_points_far_along_them() {
        let mut random = visibility_testing::Random(3);
        let mut bounded = 0;
        for trial in 0..20_000 {
            let mut integers = |size: f64| random.vector(size).round();
            // The points `u` and `v` are in the plane, and so is their sum.
            let (u, v) = (integers(1e3), integers(1e3));
            let (normal, point) = (u.cross(v), (u + v) * 1e6);
            if normal == DVec3::ZERO {
                continue;
            }
            let zero = DVec3::ZERO;
            let mut cell = Viewcell::from_box(point.min(zero), point.max(zero));
            cell.planes = vec![Plane::new(normal, 0.0)];
            let extent = CellExtent::new(&cell, zero).unwrap();
            let axis = normal.normalize();
            let least = extent.least(axis);
            // The bound by the plane, not by the box.
            if least < -1e-3 {
                continue;
            }
            bounded += 1;
            let [x, y, z] = [0, 1, 2].map(|k| DoubleDouble::product(axis[k], point[k]));
            let exact = x.plus(y).plus(z).plus(DoubleDouble::from(-least)).hi;
            assert!(exact >= 0.0, "trial {trial}: {point} is {exact} above {least}, {normal}");
        }
        assert!(bounded > 10_000, "{bounded} bounds by planes");
    }

    #[test]
    fn boxes_that_are_inverted_or_not_finite_have_no_extent() {
        let (min, max) = (DVec3::ZERO, DVec3::ONE);
        let extent = |min, max| CellExtent::new(&Viewcell::from_box(min, max), DVec3::ZERO);
        assert!(extent(min, max).is_some() && extent(min, min).is_some(), "a box, and a point");
        for axis in DVec3::AXES {
            assert!(extent(max, max - 2.0 * axis).is_none(), "inverted along {axis}");
            for infinite in [axis * f64::INFINITY, axis * f64::NAN] {
                let infinite = DVec3::select(axis.cmpeq(DVec3::ONE), infinite, DVec3::ZERO);
                assert!(extent(min - infinite, max).is_none(), "from {infinite}");
                assert!(extent(min, max + infinite).is_none(), "to {infinite}");
            }
        }
    }

    /// A plane whose offset overflows leaves the box as it is.
    #[test]
    fn planes_that_overflow_bound_nothing() {
        let far = 1.7e308;
        for (offset, origin) in [(far, far), (-far, -far), (far, -far), (-far, far), (f64::MAX, 0.0)] {
            let origin = DVec3::new(origin, 0.0, 0.0);
            let mut cell = Viewcell::from_box(origin, origin);
            let plain = CellExtent::new(&cell, origin).unwrap();
            cell.planes = vec![Plane::new(DVec3::X, offset), Plane::new(DVec3::NEG_X, offset)];
            let extent = CellExtent::new(&cell, origin).unwrap();
            assert_eq!(extent.along(DVec3::AXES), plain.along(DVec3::AXES), "{offset} from {origin}");
        }
    }

    /// Ends of a viewcell, rounded outwards, hold the exact ones, where the difference to the origin is a
    /// tie between two numbers.
    #[test]
    fn ends_hold_the_exact_ends() {
        let tie = f64::EPSILON / 2.0;
        let off = [-3.0 * tie, -tie, -tie / 2.0, tie / 2.0, tie, 3.0 * tie];
        for (end, by) in [-3.0, -1.0, 1.0, 3.0].into_iter().flat_map(|end| off.map(|by| (end, by))) {
            for other in [0.0, 1.0] {
                let origin = DVec3::splat(-by);
                let (low, high) = (f64::min(end, other), f64::max(end, other));
                let cell = Viewcell::from_box(DVec3::splat(low), DVec3::splat(high));
                let extent = CellExtent::new(&cell, origin).unwrap();
                for axis in 0..3 {
                    let [least, most] = extent.ends(axis);
                    let beyond =
                        |a: f64, end: f64| DoubleDouble::from(a).plus((-end).into()).plus((-by).into()).hi;
                    assert!(beyond(least, low) <= 0.0, "{least} for {low} + {by}");
                    assert!(beyond(most, high) >= 0.0, "{most} for {high} + {by}");
                }
            }
        }
    }
}
