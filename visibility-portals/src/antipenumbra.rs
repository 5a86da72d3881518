//! Whether separating planes leave a way through a sequence of polygons.

use crate::bake_settings::{BakeError, Settings};
use crate::cell_baker::CellBaker;
use visibility_core::bake::Bake;
use visibility_core::{CellGraph, CellId, ConvexPolygon};

/// Whether the planes that separate the polygons of a sequence leave a way through all of them: each polygon
/// clips what is seen of the first one through those before it, and the other way round (Seth Teller and Pat
/// Hanrahan, "Global Visibility Algorithms for Illumination Computations", 1993). `false` is certain for
/// lines that stay clear of all edges by the clearance.
///
/// # Errors
/// As [`CellBaker::new`].
///
/// ```
/// use visibility_core::{ConvexPolygon, glam::DVec3};
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
