//! Test of which side of one triangle an eye sees.

use visibility_core::glam::DVec3;
use visibility_core::{scene::Triangle, view::Eye};

/// Unit round-off of `f64`, 2^-53.
pub(super) const U: f64 = f64::EPSILON / 2.0;

/// Side of a triangle, or of all triangles of a cone, that an eye sees.
///
/// The front is the side from which the corners `a`, `b`, `c` run counter-clockwise in a right-handed world:
/// the side that `(b - a) x (c - a)` points to. Engines with a left-handed world, or with clockwise fronts,
/// call the opposite side the front and use [`flipped`](Self::flipped).
///
/// ```
/// use visibility_frame::backface::Facing;
/// assert_eq!(Facing::Front.flipped(), Facing::Back);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum Facing {
    /// The eye certainly sees the front of the triangle, or the fronts of all triangles of the cone.
    Front,
    /// The eye certainly sees the back of the triangle, or the backs of all triangles of the cone.
    Back,
    /// The eye sees the triangle edge-on, or the rounding error is too large to decide, or a coordinate is
    /// NaN. For several triangles also: the eye sees some fronts and some backs. Counts as visible.
    Undecided,
}

impl Facing {
    /// Returns the side under the opposite winding rule: exchanges `Front` and `Back`, keeps `Undecided`.
    #[must_use]
    pub const fn flipped(self) -> Self {
        match self {
            Self::Front => Self::Back,
            Self::Back => Self::Front,
            Self::Undecided => Self::Undecided,
        }
    }
}

/// Returns the side of a triangle that is seen from a point, or along the direction of a parallel view.
/// Triangle and eye must be in the same coordinates.
///
/// `Front` and `Back` are certain, whatever the rounding. The bound, with `u = 2^-53`: the sign is that of
/// the determinant of `b - a`, `c - a` and `eye - a` (or the reversed direction), a sum of six products of
/// three factors. Each product is rounded once in each of three differences, twice as a product, once in its
/// component of the cross product and twice in the sum: eight times. The error is therefore less than `10u`
/// times the sum of the products' magnitudes, where `10u` also covers the rounding of that sum. Products of
/// differences of `f32` do not underflow in `f64`. Products with the eye may underflow and then lose less
/// than `2^-1020` in each of three components.
///
/// Cost: some 14 ns.
///
/// ```
/// use visibility_frame::backface::{facing, Facing};
/// use visibility_core::{glam::{DVec3, Vec3}, view::Eye};
/// let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
/// assert_eq!(facing(&triangle, &Eye::Point(DVec3::Z)), Facing::Front);
/// assert_eq!(facing(&triangle, &Eye::Direction(DVec3::Z)), Facing::Back);
/// assert_eq!(facing(&triangle, &Eye::Point(DVec3::X)), Facing::Undecided);
/// ```
pub fn facing(triangle: &Triangle, eye: &Eye) -> Facing {
    let [a, b, c] = triangle.map(|p| p.as_dvec3());
    let (p, q) = (b - a, c - a);
    let to_eye = match *eye {
        Eye::Point(eye) => eye - a,
        Eye::Direction(direction) => -direction,
    };
    let products = [[p.y * q.z, p.z * q.y], [p.z * q.x, p.x * q.z], [p.x * q.y, p.y * q.x]];
    let normal = DVec3::from_array(products.map(|[x, y]| x - y));
    let size = DVec3::from_array(products.map(|[x, y]| x.abs() + y.abs()));
    let determinant = normal.x * to_eye.x + normal.y * to_eye.y + normal.z * to_eye.z;
    let far = to_eye.abs();
    let error = 10.0 * U * (size.x * far.x + size.y * far.y + size.z * far.z) + 16.0 * f64::MIN_POSITIVE;
    // An infinite or NaN error decides nothing: both comparisons are false.
    if determinant > error {
        Facing::Front
    } else if determinant < -error {
        Facing::Back
    } else {
        Facing::Undecided
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::Vec3;
    use visibility_testing::Random;

    /// Eyes in the plane of a triangle, at integers whose products take more digits than `f64` has.
    #[test]
    fn an_eye_in_the_plane_of_a_triangle_is_undecided() {
        let mut random = Random(41);
        let mut rounded = 0;
        for round in 0..10_000 {
            let mut whole =
                |size: i32| DVec3::from_array([(); 3].map(|()| f64::from(random.between(-size, size))));
            let (a, p, q) = (whole(1 << 22), whole(1 << 22), whole(1 << 22));
            let parts = whole(1 << 20);
            let along = p * parts.x + q * parts.y;
            let triangle = [a, a + p, a + q].map(|corner| corner.as_vec3());
            rounded += u32::from(p.cross(q).dot(along) != 0.0);
            for eye in [Eye::Point(a + along), Eye::Direction(along)] {
                assert_eq!(facing(&triangle, &eye), Facing::Undecided, "{round}: {triangle:?} from {eye:?}");
            }
        }
        assert!(rounded > 3000, "{rounded} eyes that rounding takes off the plane");
    }

    /// A determinant and a bound that overflow, on either side of the triangle, say nothing.
    #[test]
    fn an_infinite_bound_is_undecided() {
        let triangle = [Vec3::ZERO, Vec3::X * 1e38, Vec3::Y * 1e38];
        for height in [1e300, -1e300] {
            let eye = Eye::Point(DVec3::Z * height);
            assert_eq!(facing(&triangle, &eye), Facing::Undecided, "from {height}");
        }
    }
}
