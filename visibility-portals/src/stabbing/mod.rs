//! Lines through sequences of openings.
//!
//! [`Stabber`] takes segments of a floor plan, axis-aligned rectangles or convex polygons in space. The
//! answer is a line that passes all openings, a certificate that no line does, or *maybe*. Rounding never
//! turns a *maybe* into another answer.
//!
//! In a floor plan, *maybe* means that the set of lines is smaller than the rounding. In space it can also
//! mean that lines pass any few of the edges but not all together. Certificates are of linear programs, which
//! ignore that the coordinates of a line satisfy a quadratic equation.

mod floor_plan;
pub(crate) mod pluecker;
mod radius;
mod rectangle;
mod stab;
mod stabber;

pub use rectangle::Rectangle;
pub use stab::Stab;
pub use stabber::Stabber;
