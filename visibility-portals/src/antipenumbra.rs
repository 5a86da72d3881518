//! The antipenumbra test: whether separating planes leave a line through a sequence of convex polygons.

use crate::bake_settings::{BakeError, BakerSettings};
use crate::cell_baker::CellBaker;
use visibility_core::bake::Bake;
use visibility_core::{
    cells::{CellGraph, CellId},
    geometry::ConvexPolygon,
};

/// Tests by separating planes whether a straight line may pass through all of `polygons`, in order, each
/// along its normal. The polygons are in world space.
///
/// Each polygon is clipped to the part that can be seen from the first polygon through the polygons between,
/// and the first polygon is likewise clipped to the part that can be seen from the far side (Seth Teller and
/// Pat Hanrahan, "Global Visibility Algorithms for Illumination Computations", 1993).
///
/// `false` is certain: no line passes all polygons and keeps a distance of `clearance` from all their edges.
/// `clearance` is in the unit of the coordinates. `true` is not certain: such a line may still not exist.
/// `true` for fewer than two polygons. Faster than [`Stabber::polygons`](crate::stabbing::Stabber::polygons),
/// and less tight.
///
/// # Errors
/// [`BakeError::Clearance`] if `clearance` is not positive and finite, or too small for the coordinates.
/// [`BakeError::TooLarge`] for more than 65,535 polygons, or for polygons from which no cell graph can be
/// made (such as a polygon without area).
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
    // The polygons become the portals of a chain of cells: polygon i joins cell i to cell i + 1.
    let cells = |i: usize| [CellId(i as u32), CellId(i as u32 + 1)];
    let portals = polygons.iter().enumerate().map(|(i, polygon)| (polygon.clone(), cells(i)));
    let Ok(graph) = CellGraph::new(polygons.len() + 1, portals) else {
        let (cells, portals) = (polygons.len() + 1, polygons.len());
        return Err(BakeError::TooLarge { cells, portals });
    };
    let settings = BakerSettings { clearance: Some(clearance), ..BakerSettings::default() };
    let outcome = Bake::new(CellBaker::new(&graph, settings)?).run();
    Ok(outcome.matrix.sees(CellId(0), CellId(polygons.len() as u32)))
}
