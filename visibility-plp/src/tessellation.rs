//! The trait of a convex cell decomposition of space, which both cullers visit.

use crate::content::Content;
use visibility_core::Aabb;
use visibility_core::glam::DVec3;

/// Face of a cell: the part of the cell's surface shared with one neighbouring cell.
///
/// ```
/// use visibility_core::glam::DVec3;
/// let face = visibility_plp::Face { neighbour: 7, point: DVec3::X * 3.0, normal: DVec3::X, area: 2.5 };
/// assert!(face.normal.dot(DVec3::X) > 0.0); // light along x leaves the cell here
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Face {
    /// Number of the cell on the other side of the face.
    pub neighbour: u32,
    /// Point of the face's plane in metres, relative to the scene's origin. The point may lie outside of the
    /// face.
    pub point: DVec3,
    /// Unit normal of the face, pointing out of the queried cell into the neighbour.
    pub normal: DVec3,
    /// Area in square metres of the face, the part of the boundary that both cells share; greater than 0.
    pub area: f64,
}

/// Convex cells that fill a box around a scene without gaps, with the list of objects in each cell.
///
/// Cells are numbered from 0 to [`Content::cell_count`] - 1. The methods may panic for other numbers. All
/// coordinates are in metres relative to the scene's origin. Cullers call each method thousands of times per
/// frame, so a method should take nanoseconds and must not allocate.
///
/// Implement this trait to use the cullers with an engine's own cells. Three conditions must hold, or visible
/// objects are lost. The cells leave no gap inside [`bounds`](Self::bounds). Two cells that share more than
/// an edge are neighbours of each other. [`content`](Self::content) lists every object in all cells that it
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
    /// Returns the objects in each cell.
    fn content(&self) -> &Content;

    /// Returns the box around all cells, relative to the scene's origin, rounded outwards.
    fn bounds(&self) -> Aabb;

    /// Returns the number of a cell that contains a scene-relative point. Any of the adjacent cells for a
    /// point on a face. `None` outside of all cells and for NaN.
    fn locate(&self, point: DVec3) -> Option<u32>;

    /// Returns the box around a cell, relative to the scene's origin, rounded outwards.
    fn cell_bounds(&self, cell: u32) -> Aabb;

    /// Returns a scene-relative point inside a cell, away from its faces.
    fn center(&self, cell: u32) -> DVec3;

    /// Returns the area in square metres of a cell's silhouette in orthographic projection along the unit
    /// vector `direction`. Equal for opposite directions.
    fn projected_area(&self, cell: u32, direction: DVec3) -> f64;

    /// Calls `each` for every face of a cell for whose neighbour `wanted` returns true, in a fixed order.
    /// `wanted` receives the neighbour's number. Faces on the outer surface have no neighbour and are
    /// skipped.
    fn for_each_face(&self, cell: u32, wanted: &dyn Fn(u32) -> bool, each: &mut dyn FnMut(&Face));

    /// Tests whether a cell contains a scene-relative point. True for points so close to the cell's surface
    /// that rounding leaves the answer undecided.
    fn contains(&self, cell: u32, point: DVec3) -> bool;

    /// Returns the cells with a face on the outer surface, each once. View rays from an eye outside of all
    /// cells enter through these cells.
    fn boundary(&self) -> &[u32];
}
