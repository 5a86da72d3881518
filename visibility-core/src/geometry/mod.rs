//! Geometric shapes and their three-way tests.
//!
//! Bounds ([`Aabb`]) are `f32`, in metres relative to the origin of their [`Scene`](crate::Scene), the form
//! in which engines keep bounds. Planes and polygons are results of computation (intersections, clips) and
//! are `f64`.
//!
//! Every classification returns a [`Containment`]. The answer is `Crossing` whenever rounding or a non-finite
//! number leaves the question open, so that a caller who culls on `Outside` alone never hides a visible
//! object.

mod aabb;
mod clip_outward;
mod convex_polygon;
mod double_double;
mod handedness;
mod plane;
mod side;
mod solid_angle;
mod sphere;

pub use crate::float::{sqrt, tan};
pub use aabb::Aabb;
pub(crate) use clip_outward::{Corners, clip_outward};
pub use convex_polygon::{ConvexPolygon, PolygonError};
pub use double_double::DoubleDouble;
pub use handedness::keeps_orientation;
pub(crate) use handedness::keeps_orientation_64;
pub use plane::Plane;
pub use side::{PolygonSide, Side, SidePlane, orientation};
pub use solid_angle::solid_angle;
pub use sphere::Sphere;

/// Returns the index (0 to 2) of the greatest of three extents, the first of equal ones.
pub(crate) fn longest_axis<T: PartialOrd>([x, y, z]: [T; 3]) -> usize {
    if x >= y && x >= z { 0 } else { 1 + usize::from(z > y) }
}

/// Position of a shape with respect to a closed half-space or volume, decided conservatively.
///
/// ```
/// use visibility_core::{geometry::{Containment, Plane}, glam::DVec3, Aabb};
/// let floor = Plane::new(DVec3::Z, 0.0); // keeps z >= 0
/// assert_eq!(floor.classify_aabb(&Aabb::from_arrays([0.0, 0.0, 1.0], [1.0, 1.0, 2.0])),
///     Containment::Inside);
/// assert_eq!(floor.classify_aabb(&Aabb::from_arrays([0.0, 0.0, -1.0], [1.0, 1.0, 2.0])),
///     Containment::Crossing);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum Containment {
    /// All points of the shape are certainly inside the volume or on its boundary.
    Inside,
    /// The shape has points on both sides of the boundary, or lies within the rounding error of the boundary,
    /// or shape or volume has a NaN coordinate. Cullers keep such shapes.
    Crossing,
    /// All points of the shape are certainly outside the volume.
    Outside,
}
