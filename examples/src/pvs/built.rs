//! Cells and portals of a scene: its own, or made from its opaque triangles.

use super::solids::boxes;
use crate::source::SourceCells;
use crate::{SceneSource, SourceObject};
use glam::{DVec3, Vec3};
use visibility_core::geometry::ConvexPolygon;
use visibility_portals::from_geometry::{
    PolygonSettings, SolidRule, Subdivision, WallSettings, from_polygons, from_walls,
};

/// Source of a scene's cells.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Origin {
    /// The scene's own cells; an error if there are none.
    Given,
    /// Cells between the axis-aligned boxes among the scene's opaque objects, found by a kd-tree.
    Walls,
    /// Cells between the scene's opaque triangles, found by a BSP tree.
    Polygons,
}

/// Returns the cells and portals of a scene. Cells made from geometry have no doorway cells; the names of
/// cells outside the building end in `outside`.
///
/// # Errors
///
/// Returns a message when the scene has no cells and `origin` is [`Origin::Given`], or when cells cannot be
/// made from the geometry: also if instances have too many triangles to copy, or if walls far from the origin
/// of the world are rounded by more than the gaps between them may be wide.
pub fn cells(source: &SceneSource, origin: Origin) -> Result<SourceCells, String> {
    if origin != Origin::Given {
        source.check_copies()?;
    }
    let made = match origin {
        Origin::Given => {
            return source.cells.clone().ok_or_else(|| "this scene has no cells and portals".to_owned());
        }
        Origin::Walls => {
            // Gaps of a tenth of a millimetre stay open: see `WallSettings::with_tolerance`.
            if source.origin.abs().max_element() > 1e10 {
                return Err("the scene's origin is too far away for cells between boxes".to_owned());
            }
            from_walls(&boxes(source), &WallSettings::default())
        }
        Origin::Polygons => {
            // Space that no camera of the walks can reach counts as solid.
            let eyes: Vec<DVec3> =
                source.walks.iter().flat_map(|walk| &walk.keys).map(|key| key.eye).collect();
            let (polygons, one_sided) = polygons(source);
            let solid = SolidRule::Unreached(&eyes);
            let settings = PolygonSettings::default().with_solid(solid).with_one_sided(&one_sided);
            from_polygons(&polygons, &settings.with_origin(source.origin))
        }
    };
    let Subdivision { graph, viewcells, outside } = made.map_err(|error| error.to_string())?;
    if viewcells.cells().is_empty() && source.surfaces().one_sided > 0 {
        return Err("from all places where a camera can be, lines of sight pass walls through the backs of \
                    one-sided faces; with --two-sided, backs are drawn and cells can be made"
            .to_owned());
    }
    let name = |i: usize| {
        let cell = visibility_core::cells::CellId(i as u32);
        format!("cell {i}{}", if outside.binary_search(&cell).is_ok() { ", outside" } else { "" })
    };
    let names = (0..viewcells.cells().len()).map(name).collect();
    Ok(SourceCells { graph, viewcells, names, depth: 0.0, with_doorways: None })
}

/// Returns the triangles of a scene's walls in world space, without degenerate ones, and for each triangle
/// whether it is drawn only from its front.
pub fn polygons(source: &SceneSource) -> (Vec<ConvexPolygon>, Vec<bool>) {
    let opaque = source.objects.iter().filter(|object| object.is_wall());
    let polygon =
        |triangle: [Vec3; 3]| ConvexPolygon::new(triangle.map(|p| p.as_dvec3() + source.origin)).ok();
    let of = |object: &SourceObject| {
        let one_sided = object.one_sided;
        object
            .triangles
            .view()
            .iter()
            .filter_map(polygon)
            .map(move |polygon| (polygon, one_sided))
            .collect::<Vec<_>>()
    };
    opaque.flat_map(of).unzip()
}
