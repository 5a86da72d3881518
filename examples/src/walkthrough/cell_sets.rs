//! Potentially visible sets of a scene's cells.

use super::World;
use super::world::objects_in_cells;
use crate::eprintln;
use crate::progress::Steps;
use crate::pvs::built::{Origin, cells};
use crate::source::clearance;
use std::sync::Arc;
use std::time::Instant;
use visibility_core::bake::{Bake, Baker};
use visibility_core::glam::DVec3;
use visibility_core::{
    ObjectId, Scene,
    cells::{CellGraph, CellId},
    pvs::{ScenePvs, Viewcells},
};
use visibility_portals::{BakerSettings, CellBaker, ObjectBaker, ObjectOutcome, Outcome};

/// Granularity of a potentially visible set.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Detail {
    /// A viewcell shows all objects in the cells that it sees.
    Cells,
    /// A viewcell shows only the objects that lines through portals reach.
    Objects,
}

/// Returns the potentially visible sets of a world's cells. The sets are baked on the first call and shared
/// with later calls for the same world, origin and detail.
///
/// # Errors
///
/// Returns a message that says why the world has no cells or why the cells cannot be baked.
pub fn sets_of(world: &World, origin: Origin, detail: Detail) -> Result<Arc<ScenePvs>, String> {
    world.prepared.get(&format!("sets of {detail:?}, cells {origin:?}"), || {
        let is_made = || world.makes_cells && world.source.cells.is_none();
        if origin == Origin::Given || origin == Origin::Polygons && is_made() {
            let cells = world.cells()?;
            let start = Instant::now();
            let sets = bake(&world.scene, &cells.graph, &cells.viewcells, detail)?;
            if is_made() {
                let (count, seconds) = (cells.graph.cell_count(), start.elapsed().as_secs_f64());
                eprintln!("{}: sets of {count} cells baked in {seconds:.2} s", world.source.name);
            }
            return Ok(sets);
        }
        let mut cells = cells(&world.source, origin)?;
        let ids: Vec<ObjectId> = world.scene.ids().collect();
        let pairs = objects_in_cells(&world.scene, &ids, &cells.viewcells);
        cells.graph.set_objects(pairs).map_err(|error| error.to_string())?;
        bake(&world.scene, &cells.graph, &cells.viewcells, detail)
    })
}

/// Bakes the potentially visible sets of cells, with the targets that `detail` selects, and binds the sets to
/// `scene`. The graph must list the objects in each cell. A long bake shows its progress on standard error.
///
/// # Errors
///
/// Returns a message when the cells cannot be baked.
pub fn bake(
    scene: &Scene,
    graph: &CellGraph,
    viewcells: &Viewcells,
    detail: Detail,
) -> Result<ScenePvs, String> {
    let baked = cell_rows(graph, settings(viewcells, CELL_STEPS))?;
    let cells = || (0..graph.cell_count() as u32).map(CellId);
    let pairs = cells().flat_map(|cell| graph.objects_in(cell).iter().map(move |&id| (cell, id)));
    let (pvs, pairs): (_, Vec<(ObjectId, u32)>) = match detail {
        Detail::Cells => (baked.matrix.to_pvs(graph), pairs.map(|(cell, id)| (id, cell.0)).collect()),
        Detail::Objects => {
            let mut ids: Vec<ObjectId> = pairs.map(|(_, id)| id).collect();
            ids.sort_unstable();
            ids.dedup();
            let outcome = objects(scene, graph, &baked, settings(viewcells, OBJECT_STEPS))?;
            let pvs = outcome.to_pvs(graph, scene.index_limit());
            (pvs, ids.into_iter().map(|id| (id, id.index() as u32)).collect())
        }
    };
    let pvs = pvs.map_err(|error| error.to_string())?;
    Ok(ScenePvs::new(scene, pvs, viewcells.clone(), pairs))
}

/// Maximum number of chains of portals inspected to find the cells that one cell sees. Few cells of buildings
/// need as many.
pub const CELL_STEPS: u64 = 20_000;
/// Maximum number of chains of portals inspected to find the objects that one cell sees. A chain costs more
/// here than for cells, and most hidden objects are already found by planes through pairs of portals.
pub const OBJECT_STEPS: u64 = 3_000;

/// Returns bake settings with at most `steps` steps for a cell and a clearance proportional to the extent of
/// the cells, as [`clearance`] computes it.
pub fn settings(viewcells: &Viewcells, steps: u64) -> BakerSettings {
    BakerSettings::default().with_clearance(clearance(viewcells)).with_steps_per_cell(steps)
}

/// Runs a bake to its end. Shows its progress under the name `what`.
fn run<B: Baker>(baker: B, what: &str) -> B::Outcome {
    let mut bake = Bake::new(baker);
    let mut steps = Steps::new(what, bake.progress().total, false);
    while let Some(now) = bake.advance() {
        steps.set(now.done, now.total);
    }
    bake.finish()
}

/// Bakes the cell-to-cell visibility of a graph.
///
/// # Errors
///
/// Returns a message when the cells cannot be baked.
pub fn cell_rows(graph: &CellGraph, settings: BakerSettings) -> Result<Outcome, String> {
    let baker = CellBaker::new(graph, settings).map_err(|error| error.to_string())?;
    Ok(run(baker, "portals looked through"))
}

/// Bakes which objects are visible from which cells. `cells` must be the cell-to-cell visibility of `graph`,
/// baked with the same clearance.
///
/// # Errors
///
/// Returns a message when the cells cannot be baked.
pub fn objects(
    scene: &Scene,
    graph: &CellGraph,
    cells: &Outcome,
    settings: BakerSettings,
) -> Result<ObjectOutcome, String> {
    let bounds = |id| -> Option<[DVec3; 2]> {
        let bounds = scene.bounds(id).ok().filter(|bounds| bounds.is_finite())?;
        Some([bounds.min, bounds.max].map(|corner| corner.as_dvec3() + scene.origin()))
    };
    let baker = ObjectBaker::new(graph, cells, bounds, settings).map_err(|error| error.to_string())?;
    Ok(run(baker, "cells whose objects are found"))
}
