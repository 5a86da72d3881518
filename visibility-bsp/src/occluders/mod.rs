//! Large convex occluder polygons, made in advance from the occluder meshes of a scene.
//!
//! A wall of a model is many triangles, often of several objects, but its shadow is best described by few
//! large polygons. So triangles are joined wherever they surely lie in one plane without gaps between them.
//! Axis-aligned faces are joined into all maximal covered rectangles (`rectangles`), other triangles across
//! shared edges (`patches`). Where closed boxes abut or overlap, rectangles inside them can be larger than
//! any face (`sections`). Faces of closed meshes hide only for eyes in front of them; their backs hide
//! nothing that their fronts do not.

mod blocks;
mod cover;
mod mesh_triangles;
mod outline;
mod overlaps;
mod patches;
mod polygons;
mod rectangles;
mod sections;
mod select;
mod work;

pub(crate) use mesh_triangles::triangles_of;
pub(crate) use outline::OccluderTriangle;
pub use polygons::Occluders;
#[cfg(feature = "papers")]
pub(crate) use select::is_drawn;
pub(crate) use select::{Chosen, Selector, angle_of};
