//! What hides: large convex polygons, made in advance from the occluder meshes of a scene.
//!
//! A wall of a model is many triangles, often of several objects; what it hides is best described by few
//! large polygons. So triangles are joined wherever they surely lie in one plane and leave nothing open:
//! along the axes into all the largest rectangles of which every point is covered (`rectangles`), in other
//! directions across shared edges (`patches`). Where closed boxes abut or overlap, rectangles inside of them
//! are larger than any face (`sections`). Faces of closed meshes count from outside only; their backs hide
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
pub(crate) use select::{Chosen, Selector, angle_of, is_drawn, sides_of};
