//! Whether separating planes leave a line through a sequence of polygons.

use crate::bake_settings::{BakeError, Settings};
use crate::cell_baker::CellBaker;
use visibility_core::bake::Bake;
use visibility_core::{
    cells::{CellGraph, CellId},
    geometry::ConvexPolygon,
};

/// Whether separating planes leave a line through a sequence of convex polygons: each polygon is clipped to
/// what can be seen of it from the first one through those between, and the first one likewise to what can be
/// seen of it from the other side (Seth Teller and Pat Hanrahan, "Global Visibility Algorithms for
/// Illumination Computations", 1993).
///
/// `false` is certain: no line passes all polygons along their normals, clear of all edges by `clearance`, in
/// the unit of the coordinates. `true` is not. Faster than
/// [`Stabber::polygons`](crate::stabbing::Stabber::polygons), and less tight.
///
/// # Errors
/// As [`CellBaker::new`]; [`BakeError::TooLarge`] also for a polygon without area.
///
/// ```
/// use visibility_core::{geometry::ConvexPolygon, glam::DVec3};
/// use visibility_portals::antipenumbra;
/// let door = |x: f64, y: f64| ConvexPolygon::new(
///     [[y, 0.0], [y + 1.0, 0.0], [y + 1.0, 2.0], [y, 2.0]].map(|[y, z]| DVec3::new(x, y, z)));
/// assert!(antipenumbra(&[door(0.0, 0.0)?, door(1.0, 0.5)?, door(2.0, 1.5)?], 1e-6)?);
/// assert!(!antipenumbra(&[door(0.0, 0.0)?, door(1.0, 0.5)?, door(2.0, 3.5)?], 1e-6)?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn antipenumbra(polygons: &[ConvexPolygon], clearance: f64) -> Result<bool, BakeError> {
    // A chain of cells is a map like any other.
    let cells = |i: usize| [CellId(i as u32), CellId(i as u32 + 1)];
    let portals = polygons.iter().enumerate().map(|(i, polygon)| (polygon.clone(), cells(i)));
    let Ok(graph) = CellGraph::new(polygons.len() + 1, portals) else {
        let (cells, portals) = (polygons.len() + 1, polygons.len());
        return Err(BakeError::TooLarge { cells, portals });
    };
    let outcome = Bake::new(CellBaker::new(&graph, Settings { clearance, ..Settings::default() })?).run();
    Ok(outcome.matrix.sees(CellId(0), CellId(polygons.len() as u32)))
}
