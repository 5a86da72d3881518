//! Does a line pass through all these portals?
//!
//! [`Stabber`] answers for segments of a floor plan, for axis-aligned rectangles and for convex polygons in
//! space, each time with a line that does, a certificate that none does, or *maybe*; rounding never makes one
//! of the first two out of the third. The planes that separate portals answer a part of the same question
//! faster, as a [`CellBaker`](crate::CellBaker) does: [`antipenumbra`](crate::antipenumbra).
//!
//! In the plane, *maybe* means that lines have less room than rounding takes. In space it can mean, too, that
//! any few edges leave a line but all together do not: certificates are of linear programs, and the lines
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
