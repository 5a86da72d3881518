//! The seam: a space cut into convex cells.

use crate::Content;
use visibility_core::Aabb;
use visibility_core::glam::DVec3;

/// A part of a cell's surface that it shares with one other cell.
///
/// ```
/// use visibility_core::glam::DVec3;
/// let face = visibility_plp::Face { neighbour: 7, point: DVec3::X * 3.0, normal: DVec3::X, area: 2.5 };
/// assert!(face.normal.dot(DVec3::X) > 0.0); // light along x leaves the cell here
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Face {
    /// The cell on the other side.
    pub neighbour: u32,
    /// A point of its plane.
    pub point: DVec3,
    /// Unit normal, out of the cell that was asked.
    pub normal: DVec3,
    /// Area of what is shared, in square metres.
    pub area: f64,
}

/// Convex cells that fill the padded bounds of a scene without gaps, joined through faces, and what of the scene they hold.
///
/// Cells are numbered from zero. All coordinates are relative to the scene's origin, in metres. Everything that is asked here is asked
/// thousands of times a frame and should take nanoseconds.
///
/// Klosowski and Silva, "The Prioritized-Layered Projection Algorithm for Visible Set Estimation", 2000, section 3.1.
///
/// ```
/// use visibility_core::{glam::DVec3, Aabb, Scene};
/// use visibility_plp::{OctreeTessellation, Tessellation};
/// let mut scene = Scene::new();
/// scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
/// let cells = OctreeTessellation::new(&scene);
/// let cell = cells.locate(DVec3::splat(0.5)).unwrap();
/// assert_eq!(cells.content().primitives(cell).collect::<Vec<_>>(), [0]);
/// assert_eq!(cells.locate(DVec3::splat(9.0)), None);
/// ```
pub trait Tessellation {
    /// What the cells hold.
    fn content(&self) -> &Content;

    /// A box around all cells, rounded outwards.
    fn bounds(&self) -> Aabb;

    /// A cell that a point lies in, or `None` outside all cells. On a face, either of its cells.
    fn locate(&self, point: DVec3) -> Option<u32>;

    /// A box around a cell, rounded outwards.
    fn cell_bounds(&self, cell: u32) -> Aabb;

    /// A point well inside a cell.
    fn center(&self, cell: u32) -> DVec3;

    /// Area of a cell as seen along a unit direction, in square metres.
    fn projected_area(&self, cell: u32, direction: DVec3) -> f64;

    /// Calls `each` for every face of a cell with a cell on its other side that is `wanted`, always in the same order.
    fn for_each_face(&self, cell: u32, wanted: &dyn Fn(u32) -> bool, each: &mut dyn FnMut(&Face));

    /// Whether a point of space lies in a cell, or so near to it that rounding cannot tell.
    fn contains(&self, cell: u32, point: DVec3) -> bool;

    /// The cells on the outer surface of the tessellation.
    fn boundary(&self) -> &[u32];
}
