//! Cells and portals of a scene: those that the scene brings, or cells made from its opaque triangles.

use super::solids::boxes;
use crate::SceneSource;
use crate::source::SourceCells;
use glam::DVec3;
use visibility_core::{geometry::ConvexPolygon, pvs::Viewcells};
use visibility_portals::from_geometry::{
    PolygonSettings, Solid, Subdivision, WallSettings, from_polygons, from_walls,
};

/// Origin of a scene's cells: given, or made from its geometry.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Origin {
    /// Cells that the scene brings; an error if there are none.
    Given,
    /// Cells between the axis-aligned boxes among the scene's opaque objects, found by a kd-tree.
    Walls,
    /// Cells between the scene's opaque triangles, found by a BSP tree.
    Polygons,
}

/// Returns the cells and portals of a scene. Cells made from geometry have no doorway cells, and names ending
/// in `outside` where they lie outside the building.
///
/// # Errors
///
/// Returns a message when the scene brings no cells and `origin` is [`Origin::Given`], or when cells cannot
/// be made from the geometry.
pub fn cells(source: &SceneSource, origin: Origin) -> Result<SourceCells, String> {
    let made = match origin {
        Origin::Given => {
            return source.cells.clone().ok_or_else(|| "this scene has no cells and portals".to_owned());
        }
        Origin::Walls => from_walls(&boxes(source), &WallSettings::default()),
        Origin::Polygons => {
            // Space that no camera of the walks can reach counts as solid.
            let eyes: Vec<DVec3> =
                source.walks.iter().flat_map(|walk| &walk.keys).map(|key| key.eye).collect();
            let settings = PolygonSettings { solid: Solid::Unreached(&eyes), ..PolygonSettings::default() };
            from_polygons(&polygons(source), &settings)
        }
    };
    let Subdivision { graph, viewcells, outside } = made.map_err(|error| error.to_string())?;
    let name = |i: usize| {
        let cell = visibility_core::cells::CellId(i as u32);
        format!("cell {i}{}", if outside.binary_search(&cell).is_ok() { ", outside" } else { "" })
    };
    let names = (0..viewcells.len()).map(name).collect();
    Ok(SourceCells { graph, viewcells: Viewcells::new(viewcells), names, depth: 0.0, with_doorways: None })
}

/// Returns the opaque triangles of a scene in f64, without door leaves and without degenerate triangles.
pub fn polygons(source: &SceneSource) -> Vec<ConvexPolygon> {
    let opaque = source.objects.iter().filter(|object| object.opaque && !object.door);
    let triangles = opaque.flat_map(|object| &object.triangles);
    triangles.filter_map(|triangle| ConvexPolygon::new(triangle.map(|p| p.as_dvec3())).ok()).collect()
}
