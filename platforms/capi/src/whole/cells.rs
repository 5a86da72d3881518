//! Cells and portals of buildings: graphs, doors, and portal culling with cells that pipelines share.

use super::pvs::vis_pvs;
use super::volume::{range, vis_volume, volumes};
use crate::error::{Error, border, vis_status};
use crate::pointer::{array, create, destroy, optional_out, out, reference};
use crate::scene::vis_scene;
use std::sync::{Arc, RwLock, RwLockReadGuard, RwLockWriteGuard};
use visibility_core::bake::Bake;
use visibility_core::cells::{CellGraph, CellId, PortalId};
use visibility_core::geometry::{ConvexPolygon, keeps_orientation};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::level_version::level_object;
use visibility_portals::from_geometry::{PolygonSettings, from_polygons};
use visibility_portals::{BakerSettings, CellBaker, MirrorId, Passage, SceneCells, prt};

/// Graph of convex cells and the portals between them. It never changes.
pub struct vis_graph(pub(crate) CellGraph);

/// Portal of a graph: a convex polygon between two cells.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct vis_portal {
    /// Index of the polygon's first vertex among all vertices. The vertices run counter-clockwise as seen
    /// from the second cell.
    pub first_vertex: u32,
    /// Number of the polygon's vertices.
    pub vertex_count: u32,
    /// The two cells that the portal joins.
    pub cells: [u32; 2],
}

/// Makes a graph of `cell_count` cells from arrays: `portals`, and 3 coordinates for each of `vertices`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_graph_create(
    cell_count: usize,
    portals: *const vis_portal,
    portal_count: usize,
    vertices: *const f64,
    vertex_count: usize,
    graph: *mut *mut vis_graph,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (portals, place) = unsafe { (array(portals, portal_count, "portals")?, out(graph, "graph")?) };
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 3 numbers for each of `vertex_count`.
        let vertices = unsafe { array(vertices.cast::<[f64; 3]>(), vertex_count, "vertices") }?;
        let made = portals.iter().enumerate().map(|(index, portal)| {
            let own = range(vertices, portal.first_vertex, portal.vertex_count, "portal", index)?;
            Ok((own.iter().copied().map(DVec3::from_array), portal.cells.map(CellId)))
        });
        let graph = CellGraph::from_vertices(cell_count, made.collect::<Result<Vec<_>, Error>>()?)?;
        create(place, vis_graph(graph));
        Ok(())
    })
}

/// Makes a graph from the `length` bytes of a map compiler's portal file (`.prt`), in the format PRT1, PRT2
/// or PRT1-AM.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_graph_read_prt(
    text: *const u8,
    length: usize,
    graph: *mut *mut vis_graph,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (text, place) = unsafe { (array(text, length, "text")?, out(graph, "graph")?) };
        create(place, vis_graph(prt::read(&String::from_utf8_lossy(text))?.graph));
        Ok(())
    })
}

/// Destroys a graph. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_graph_destroy(graph: *mut vis_graph) {
    // SAFETY: by rule P3 of `visibility.h`, the handle is null, or made by this library and unused.
    unsafe { destroy(graph) }
}

/// Writes the number of cells and the number of portals.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_graph_counts(
    graph: *const vis_graph,
    cells: *mut usize,
    portals: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (graph, mut cells) = unsafe { (reference(graph, "graph")?, out(cells, "cells")?) };
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let mut portals = unsafe { out(portals, "portals") }?;
        cells.set(graph.0.cell_count());
        portals.set(graph.0.portals().len());
        Ok(())
    })
}

/// Computes which cells may see one another from anywhere inside, with all portals open. Conservative.
/// `clearance` is the least distance in world units between a line of sight and the edges of portals; 0 for
/// the default, which is 1e-6 or, if more, 2^-33 of the greatest coordinate of a portal. Takes from
/// milliseconds to minutes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_graph_bake(
    graph: *const vis_graph,
    clearance: f64,
    pvs: *mut *mut vis_pvs,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (graph, place) = unsafe { (reference(graph, "graph")?, out(pvs, "pvs")?) };
        let clearance = (clearance != 0.0).then_some(clearance);
        let settings = BakerSettings::default().with_clearance(clearance);
        let outcome = Bake::new(CellBaker::new(&graph.0, settings)?).run();
        create(place, vis_pvs(outcome.matrix.to_pvs(&graph.0)?));
        Ok(())
    })
}

/// The cells of a building with their doors, shared by the pipelines of all views. Its functions wait for one
/// another, so they never return `VIS_ERROR_BUSY`.
pub struct vis_cells(Arc<RwLock<SceneCells>>);

fn failed<G>(_: G) -> Error {
    Error::new(vis_status::VIS_ERROR_PANIC, "an earlier call with these cells failed inside: destroy them")
}

impl vis_cells {
    /// Returns a shared handle to the cells, for a pipeline.
    pub(crate) fn shared(&self) -> Arc<RwLock<SceneCells>> {
        self.0.clone()
    }

    fn read(&self) -> Result<RwLockReadGuard<'_, SceneCells>, Error> {
        self.0.read().map_err(failed)
    }

    fn write(&self) -> Result<RwLockWriteGuard<'_, SceneCells>, Error> {
        self.0.write().map_err(failed)
    }
}

/// Makes the cells of a building from a graph and the volume of each cell. `planes` has 4 numbers a, b, c, d
/// each; a volume keeps the side where a x + b y + c z + d >= 0. `tolerance` is the greatest error in the
/// positions of portals and volumes: 1e-6 for metres computed in double precision, the last decimal for
/// coordinates read from text. All portals are open. A portal with the wrong winding is corrected; a portal
/// whose two volumes are not on opposite sides is an error. The graph may be destroyed afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_cells_create(
    graph: *const vis_graph,
    cell_volumes: *const vis_volume,
    volume_count: usize,
    planes: *const f64,
    plane_count: usize,
    tolerance: f64,
    cells: *mut *mut vis_cells,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (graph, place) = unsafe { (reference(graph, "graph")?, out(cells, "cells")?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let given = unsafe { array(cell_volumes, volume_count, "cell_volumes") }?;
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 4 numbers for each of `plane_count`.
        let planes = unsafe { array(planes.cast::<[f64; 4]>(), plane_count, "planes") }?;
        let cells = SceneCells::new(graph.0.clone(), volumes(given, planes)?, tolerance)?;
        create(place, vis_cells(Arc::new(RwLock::new(cells))));
        Ok(())
    })
}

/// Makes cells and portals from the triangles of a scene's occluders that are always drawn, where they are
/// now: space is divided along large walls, and every gap between triangles becomes an open portal, unless it
/// is narrower than 2^-20 of the greatest coordinate relative to the scene's origin, or 2^-36 of that in the
/// world. An occluder with a draw range, an HLOD parent or HLOD children is not always drawn, nor is one on
/// no layer: it is no wall. `max_cells` is the greatest number of cells; 0 for the default, 16,384. Writes
/// the number of cells to `cell_count`, which may be null. It is 0 where all space sees the backs of
/// one-sided triangles: a culler with such cells hides nothing. What an occluder does after this call counts
/// no more, so make cells of what stands still. Occluders of all layers count, so cull with such cells only
/// views that show them all. Takes from milliseconds to minutes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_cells_create_of_scene(
    scene: *const vis_scene,
    max_cells: usize,
    cells: *mut *mut vis_cells,
    cell_count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (scene, place) = unsafe { (reference(scene, "scene")?, out(cells, "cells")?) };
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let count = unsafe { optional_out(cell_count, "cell_count") }?;
        let scene = &scene.read()?.scene;
        let (mut polygons, mut one_sided) = (Vec::new(), Vec::new());
        // An occluder that some frames do not draw is no wall: cells are for many frames, and never ask which
        // objects are drawn.
        let walls = scene.ids().filter_map(|id| {
            let (object, occluder) = level_object(scene, id)?;
            occluder.filter(|_| object.layers != 0)
        });
        for (mesh, transform) in walls {
            // A transform that mirrors turns the winding. One that flattens leaves no side certain.
            let is_mirrored = match keeps_orientation(&transform) {
                _ if mesh.is_two_sided() => false,
                Some(keeps) => !keeps,
                None => continue,
            };
            // In `f64`: what nearly cancels in `f32` would close a gap that cullers see through.
            let transform = transform.as_daffine3();
            let world = |at: &Vec3| scene.origin() + transform.transform_point3(at.as_dvec3());
            let vertices: Vec<DVec3> = mesh.positions().iter().map(world).collect();
            let corners = |triangle: &[u32; 3]| triangle.map(|i| vertices.get(i as usize).copied());
            for [a, b, c] in mesh.triangles().iter().map(corners) {
                // A triangle without area covers nothing.
                let (Some(a), Some(b), Some(c)) = (a, b, c) else { continue };
                let corners = if is_mirrored { [a, c, b] } else { [a, b, c] };
                let Ok(polygon) = ConvexPolygon::new(corners) else { continue };
                polygons.push(polygon);
                one_sided.push(!mesh.is_two_sided());
            }
        }
        let most = if max_cells == 0 {
            PolygonSettings::default()
        } else {
            PolygonSettings::default().with_max_cells(max_cells)
        };
        let settings = most.with_one_sided(&one_sided).with_origin(scene.origin());
        let made = from_polygons(&polygons, &settings)?.into_scene_cells()?;
        let cell_number = made.graph().cell_count();
        create(place, vis_cells(Arc::new(RwLock::new(made))));
        count.into_iter().for_each(|mut count| count.set(cell_number));
        Ok(())
    })
}

/// Destroys cells; pipelines that use them keep them alive. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_cells_destroy(cells: *mut vis_cells) {
    // SAFETY: by rule P3 of `visibility.h`, the handle is null, or made by this library and unused.
    unsafe { destroy(cells) }
}

/// Restricts what is seen from a cell to its row in a baked set, whose targets must be the cells of the
/// graph. The set may be destroyed afterwards. Returns `VIS_ERROR_ARGUMENT` for a set baked from another
/// graph. For a set made by `vis_pvs_create` the graph is unknown, so pipelines with the cells become
/// `VIS_ACCURACY_APPROXIMATE`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_cells_set_pvs(cells: *mut vis_cells, pvs: *const vis_pvs) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (cells, pvs) = unsafe { (reference(cells, "cells")?, reference(pvs, "pvs")?) };
        let mut cells = cells.write()?;
        let limited = cells.clone().with_pvs(pvs.0.clone())?;
        *cells = limited;
        Ok(())
    })
}

/// Opens or closes a portal, for example a door.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_cells_set_open(cells: *mut vis_cells, portal: u32, open: bool) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let cells = unsafe { reference(cells, "cells") }?;
        Ok(cells.write()?.set_open(PortalId(portal), open)?)
    })
}

/// Sets the directions in which an open portal can be seen through: from its first cell into the second
/// (`forward`), from the second into the first (`backward`), or both. To allow neither, close the portal.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_cells_set_passage(
    cells: *mut vis_cells,
    portal: u32,
    forward: bool,
    backward: bool,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let cells = unsafe { reference(cells, "cells") }?;
        let passage = match (forward, backward) {
            (true, true) => Passage::BothWays,
            (true, false) => Passage::Forward,
            (false, true) => Passage::Backward,
            (false, false) => return Err(Error::argument("a portal without a direction is a closed one")),
        };
        Ok(cells.write()?.set_passage(PortalId(portal), passage)?)
    })
}

/// Adds a mirror on the boundary of a cell and writes its number, counted from 0. Its `vertex_count`
/// vertices, 3 coordinates each, make a convex polygon in a plane, counter-clockwise as seen from within the
/// cell. Views with `vis_reflections` then find what is seen in the mirror. If the glass itself is drawn, it
/// is an object of the scene.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_cells_add_mirror(
    cells: *mut vis_cells,
    cell: u32,
    vertices: *const f64,
    vertex_count: usize,
    mirror: *mut u32,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (cells, mut place) = unsafe { (reference(cells, "cells")?, out(mirror, "mirror")?) };
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 3 numbers for each of `vertex_count`.
        let vertices = unsafe { array(vertices.cast::<[f64; 3]>(), vertex_count, "vertices") }?;
        let polygon = ConvexPolygon::new(vertices.iter().copied().map(DVec3::from_array))?;
        let MirrorId(number) = cells.write()?.add_mirror(CellId(cell), &polygon)?;
        place.set(number);
        Ok(())
    })
}

/// Sets whether a mirror reflects (`uncovered`), as new mirrors do, or is covered and shows nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_cells_set_mirror(
    cells: *mut vis_cells,
    mirror: u32,
    uncovered: bool,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let cells = unsafe { reference(cells, "cells") }?;
        Ok(cells.write()?.set_mirror(MirrorId(mirror), uncovered)?)
    })
}

/// Writes whether one cell may see another, from anywhere inside, through the portals that are open now.
/// Useful for sound and for the AI of guards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_cells_can_see(
    cells: *const vis_cells,
    from: u32,
    to: u32,
    sees: *mut bool,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (cells, mut sees) = unsafe { (reference(cells, "cells")?, out(sees, "sees")?) };
        sees.set(cells.read()?.can_see_now(CellId(from), CellId(to)));
        Ok(())
    })
}
