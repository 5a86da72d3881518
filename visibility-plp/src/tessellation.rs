//! The trait of a space cut into convex cells, which both cullers walk through.

use crate::content::Content;
use visibility_core::Aabb;
use visibility_core::glam::DVec3;

/// Face of a cell: the part of its surface that it shares with one other cell.
///
/// ```
/// use visibility_core::glam::DVec3;
/// let face = visibility_plp::Face { neighbour: 7, point: DVec3::X * 3.0, normal: DVec3::X, area: 2.5 };
/// assert!(face.normal.dot(DVec3::X) > 0.0); // light along x leaves the cell here
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Face {
    /// Number of the cell on the other side.
    pub neighbour: u32,
    /// A point of the face's plane, relative to the scene's origin, in metres. It need not lie in the face.
    pub point: DVec3,
    /// Unit normal, pointing out of the cell that was asked and into the neighbour.
    pub normal: DVec3,
    /// Area of the shared part in square metres, greater than 0.
    pub area: f64,
}

/// Convex cells that fill a box around a scene without gaps, and the objects in each.
///
/// Cells have the numbers from 0 to [`Content::cell_count`] - 1; the methods may panic for other numbers. All
/// coordinates are relative to the scene's origin, in metres. Cullers call each method thousands of times a
/// frame, so it should take nanoseconds and must not allocate.
///
/// Implement it for an engine's own cells to use the cullers with them. What must hold, or visible objects
/// are lost: the cells leave no gap inside [`bounds`](Self::bounds), two cells that touch in more than an
/// edge are neighbours of each other, and [`content`](Self::content) names every object in all cells that it
/// meets.
///
/// Klosowski and Silva, "The Prioritized-Layered Projection Algorithm for Visible Set Estimation", 2000,
/// section 3.1.
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
    /// The objects in each cell.
    fn content(&self) -> &Content;

    /// Box around all cells, rounded outwards.
    fn bounds(&self) -> Aabb;

    /// Number of a cell that contains a point. `None` outside of all cells and for NaN. On a face, either of
    /// its cells.
    fn locate(&self, point: DVec3) -> Option<u32>;

    /// Box around a cell, rounded outwards.
    fn cell_bounds(&self, cell: u32) -> Aabb;

    /// A point well inside a cell.
    fn center(&self, cell: u32) -> DVec3;

    /// Area of a cell's silhouette as seen along a unit direction, in square metres. The same along the
    /// opposite direction.
    fn projected_area(&self, cell: u32, direction: DVec3) -> f64;

    /// Calls `each` for every face of a cell whose neighbour `wanted` accepts, always in the same order.
    /// Faces on the outer surface have no neighbour and are left out.
    fn for_each_face(&self, cell: u32, wanted: &dyn Fn(u32) -> bool, each: &mut dyn FnMut(&Face));

    /// Whether a cell contains a point. True for points so near to the cell that rounding cannot tell.
    fn contains(&self, cell: u32, point: DVec3) -> bool;

    /// Cells with a part of the outer surface, each once: lines of sight from an eye outside of all cells
    /// enter here.
    fn boundary(&self) -> &[u32];
}
