//! The shapes that visibility is computed with.
//!
//! Bounds ([`Aabb`], [`Sphere`]) are `f32`, as engines keep them, relative to the origin of their
//! [`Scene`](crate::Scene). Planes and polygons, which are derived and intersected, are `f64`.
//!
//! Every test is three-way ([`Containment`]), and says `Crossing` whenever rounding or a non-finite
//! number leaves the answer open, so that a caller who culls on `Outside` alone never hides anything by
//! mistake.

mod aabb;
mod clip_outward;
mod convex_polygon;
mod double_double;
mod plane;
mod side;
mod sphere;

pub use aabb::Aabb;
pub(crate) use clip_outward::{Corners, clip_outward};
pub use convex_polygon::{ConvexPolygon, PolygonError};
pub use double_double::DoubleDouble;
pub use plane::Plane;
pub use side::{PolygonSide, Side, SidePlane, orientation};
pub use sphere::Sphere;

/// Where a shape lies with respect to a half-space or a volume.
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
    /// Surely inside, boundary included.
    Inside,
    /// On both sides, or too close to the boundary to tell, or not a number.
    Crossing,
    /// Surely outside.
    Outside,
}
