//! Lines through sequences of openings.
//!
//! [`Stabber`] answers for segments of a floor plan, for axis-aligned rectangles and for convex polygons in
//! space: with a line that passes all of them, with a certificate that none does, or with *maybe*. Rounding
//! never turns a *maybe* into one of the others. Separating planes answer part of the same question faster:
//! [`antipenumbra`](crate::antipenumbra).
//!
//! In the plane, *maybe* means that lines have less room than rounding takes. In space it can also mean that
//! lines pass any few of the edges but not all together: certificates are of linear programs, and the lines
//! among the points of Pluecker space are those of a quadric.

mod floor_plan;
pub(crate) mod pluecker;
mod radius;
mod rectangle;
mod stab;
mod stabber;

pub use rectangle::Rectangle;
pub use stab::Stab;
pub use stabber::Stabber;
