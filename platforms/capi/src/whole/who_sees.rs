//! Who sees whom: observers and targets that move, many of each, in one call.

use super::cells::vis_graph;
use super::online::{lock, vis_online};
use super::plan::{opacity, plan_of, vis_wall};
use super::pvs::vis_pvs;
use super::region::viewcell;
use super::volume::{vis_volume, volumes};
use crate::error::{Error, border, vis_status, vis_status::*};
use crate::handle::Guarded;
use crate::numbers::not_negative;
use crate::pointer::{array, buffer, create, destroy, out, reference};
use crate::scene::vis_scene;
use std::sync::{Arc, Mutex};
use visibility_2d::cdt::PlanCells;
use visibility_core::ObjectId;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcells;
use visibility_core::who_sees::{Reach, ViewcellMatrix, WhoSees};
use visibility_region::{ExtendedProjectionCuller, OnlineCells, OnlinePvs};

/// The level in which movers see each other, as cells that cover it.
pub struct vis_sight_cells(Guarded<Cells>);

/// Sight cells by the kind of level.
enum Cells {
    Plan(Box<PlanCells>),
    Matrix(Box<ViewcellMatrix>),
    /// Viewcells that are objects of a scene, with the sets that tell which of them are hidden.
    Online(OnlineCells, Arc<Mutex<OnlinePvs>>),
}

/// Observers and targets of one tick, with the answer which of them see which. Keeps what it can for the
/// next.
pub struct vis_who_sees(Guarded<WhoSees>);

/// Where a mover may be until the answer is used.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct vis_reach {
    /// Minimum corner, in world space, of the box that holds the mover's body, or its eyes: x, y, z.
    pub min: [f64; 3],
    /// Maximum corner of the box.
    pub max: [f64; 3],
    /// Greatest distance that a point of the body moves until the answer is used: its greatest speed, times
    /// half a round trip on the network and the time until the next answer. Not negative.
    pub margin: f64,
}

/// Returns the reaches of movers. An error that names the first that is not proper.
fn reaches(given: &[vis_reach], what: &str) -> Result<Vec<Reach>, Error> {
    let reach = |(index, given): (usize, &vis_reach)| {
        let [min, max] = [given.min, given.max].map(DVec3::from_array);
        let reach = Reach { min, max, margin: given.margin };
        let message = "needs a finite box that is not inverted, and a margin that is finite and not negative";
        let improper = || Error::argument(format_args!("{what} {index} {message}"));
        reach.is_proper().then_some(reach).ok_or_else(improper)
    };
    given.iter().enumerate().map(reach).collect()
}

/// Returns boxes of 6 numbers each as viewcells. An error that names the first that is not finite, or
/// inverted.
fn viewcells(boxes: &[[f64; 6]]) -> Result<Viewcells, Error> {
    let numbered = |(index, given): (usize, &[f64; 6])| {
        let [min, max] = [&given[..3], &given[3..]].map(DVec3::from_slice);
        viewcell(min, max, format_args!("box {index}"))
    };
    Ok(Viewcells::new(boxes.iter().enumerate().map(numbered).collect::<Result<Vec<_>, Error>>()?))
}

/// Makes sight cells from the walls of a floor plan: its triangles are the cells. `x_axis` and `y_axis` are
/// the axes of the world, 0 to 2, that are the plan's x and y: 0 and 1 if z is up. Movers do not pass opaque
/// walls. Outside the rectangle around the plan a mover sees and is seen by all. Leave out walls that one can
/// look over. Clear walls along a grid of some metres make large rooms hide more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_sight_cells_create_of_plan(
    walls: *const vis_wall,
    wall_count: usize,
    x_axis: u32,
    y_axis: u32,
    cells: *mut *mut vis_sight_cells,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (walls, place) = unsafe { (array(walls, wall_count, "walls")?, out(cells, "cells")?) };
        let made = PlanCells::new(plan_of(walls)?, [x_axis as usize, y_axis as usize])?;
        create(place, vis_sight_cells(Guarded::new(Cells::Plan(Box::new(made)))));
        Ok(())
    })
}

/// Makes sight cells from the cells of a building, their volumes and planes as in `vis_cells_create`, and the
/// set that `vis_graph_bake` made of their graph. Outside the cells all is solid; doors count as open. Graph
/// and set may be destroyed afterwards. Returns `VIS_ERROR_ARGUMENT` for a set of another graph.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_sight_cells_create_of_portals(
    graph: *const vis_graph,
    cell_volumes: *const vis_volume,
    volume_count: usize,
    planes: *const f64,
    plane_count: usize,
    tolerance: f64,
    pvs: *const vis_pvs,
    cells: *mut *mut vis_sight_cells,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (graph, pvs) = unsafe { (reference(graph, "graph")?, reference(pvs, "pvs")?) };
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (given, place) =
            unsafe { (array(cell_volumes, volume_count, "cell_volumes")?, out(cells, "cells")?) };
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 4 numbers for each of `plane_count`.
        let planes = unsafe { array(planes.cast::<[f64; 4]>(), plane_count, "planes") }?;
        not_negative(tolerance, "the tolerance")?;
        let made = ViewcellMatrix::of_portals(&graph.0, volumes(given, planes)?, &pvs.0, tolerance)?;
        create(place, vis_sight_cells(Guarded::new(Cells::Matrix(Box::new(made)))));
        Ok(())
    })
}

/// Makes sight cells for a scene whose occluders stand still, from boxes of the world, 6 numbers each
/// (minimum, then maximum corner), finite and not inverted. Finds which boxes are seen from which by a sweep
/// of each, in milliseconds to a second a box. A box that a wall cuts sees both sides of the wall. Outside
/// the boxes a mover sees and is seen by all.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_sight_cells_create_of_scene(
    scene: *const vis_scene,
    boxes: *const f64,
    box_count: usize,
    cells: *mut *mut vis_sight_cells,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (scene, place) = unsafe { (reference(scene, "scene")?, out(cells, "cells")?) };
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 6 numbers for each of `box_count`.
        let boxes = unsafe { array(boxes.cast::<[f64; 6]>(), box_count, "boxes") }?;
        let viewcells = viewcells(boxes)?;
        let scene = &scene.read()?.scene;
        let made = ViewcellMatrix::of_scene::<ExtendedProjectionCuller>(scene, viewcells);
        create(place, vis_sight_cells(Guarded::new(Cells::Matrix(Box::new(made)))));
        Ok(())
    })
}

/// Makes sight cells for a scene that changes, from boxes as in `vis_sight_cells_create_of_scene`. Adds an
/// object to the scene for each box, which hides nothing and no view shows. While a mover is not in the
/// boxes, all see it; while no box of the online sets holds its reach, it sees all. So the margin of the sets
/// should be at least half the greatest extent of a reach, and `vis_online_step` should get the middles of
/// the reaches as places. The sets live as long as the cells.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_sight_cells_create_online(
    scene: *mut vis_scene,
    online: *const vis_online,
    boxes: *const f64,
    box_count: usize,
    cells: *mut *mut vis_sight_cells,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (scene, online) = unsafe { (reference(scene, "scene")?, reference(online, "online")?) };
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 6 numbers for each of `box_count`.
        let boxes = unsafe { array(boxes.cast::<[f64; 6]>(), box_count, "boxes") }?;
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let place = unsafe { out(cells, "cells") }?;
        let viewcells = viewcells(boxes)?;
        let made = OnlineCells::new(&mut scene.write()?.scene, viewcells);
        create(place, vis_sight_cells(Guarded::new(Cells::Online(made, online.shared()))));
        Ok(())
    })
}

/// Destroys sight cells. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_sight_cells_destroy(cells: *mut vis_sight_cells) {
    // SAFETY: by rule P3 of `visibility.h`, the handle is null, or made by this library and unused.
    unsafe { destroy(cells) }
}

/// Sets the opacity (a `vis_opacity`) of a wall of a plan, for example a door; walls count from 0. Returns
/// `VIS_ERROR_UNKNOWN_ID` if the cells have no such wall.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_sight_cells_set_opacity(
    cells: *mut vis_sight_cells,
    wall: u32,
    wall_opacity: u32,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let cells = unsafe { reference(cells, "cells") }?;
        let opacity = opacity(wall_opacity)?;
        match &mut *cells.0.write()? {
            Cells::Plan(cells) => Ok(cells.set_opacity(wall, opacity)?),
            _ => Err(Error::new(VIS_ERROR_UNKNOWN_ID, "the sight cells are of no plan, and have no walls")),
        }
    })
}

/// Writes the ids of the objects that `vis_sight_cells_create_online` has added, like `vis_visible_ids`, in
/// the order of the boxes; none for other sight cells. Remove them after the cells. All movers see one
/// another while one is missing, or has other bounds than its box: once the origin of the scene has moved,
/// set them anew.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_sight_cells_objects(
    cells: *const vis_sight_cells,
    ids: *mut u64,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (cells, ids) = unsafe { (reference(cells, "cells")?, buffer(ids, capacity, count)?) };
        let cells = cells.0.read()?;
        let objects = if let Cells::Online(cells, _) = &*cells { cells.objects() } else { &[] };
        ids.fill(objects.len(), objects.iter().copied().map(ObjectId::to_bits))
    })
}

/// Creates an answer without observers and targets.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_who_sees_create(who_sees: *mut *mut vis_who_sees) -> vis_status {
    border(|| {
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let place = unsafe { out(who_sees, "who_sees") }?;
        create(place, vis_who_sees(Guarded::new(WhoSees::new())));
        Ok(())
    })
}

/// Destroys an answer. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_who_sees_destroy(who_sees: *mut vis_who_sees) {
    // SAFETY: by rule P3 of `visibility.h`, the handle is null, or made by this library and unused.
    unsafe { destroy(who_sees) }
}

/// Finds which targets each observer may see, once per tick, and replaces the former answer. Conservative: a
/// target is left out only if no straight line leads from anywhere the observer may be to anywhere the target
/// may be. Targets hide nothing from each other. Observers and targets count from 0 in the order given.
/// `scene` is the scene of online sight cells; null for all others. On an error, the former answer stays.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_who_sees_look(
    who_sees: *mut vis_who_sees,
    cells: *mut vis_sight_cells,
    scene: *const vis_scene,
    observers: *const vis_reach,
    observer_count: usize,
    targets: *const vis_reach,
    target_count: usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (who_sees, cells) = unsafe { (reference(who_sees, "who_sees")?, reference(cells, "cells")?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let observers = unsafe { array(observers, observer_count, "observers") }?;
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let targets = unsafe { array(targets, target_count, "targets") }?;
        let (observers, targets) = (reaches(observers, "observer")?, reaches(targets, "target")?);
        let (mut who_sees, mut cells) = (who_sees.0.write()?, cells.0.write()?);
        match &mut *cells {
            Cells::Plan(cells) => who_sees.look(&mut **cells, &observers, &targets),
            Cells::Matrix(cells) => who_sees.look(&mut **cells, &observers, &targets),
            Cells::Online(cells, online) => {
                // SAFETY: by rule P1 of `visibility.h`, the pointer is null or valid to read.
                let scene = unsafe { reference(scene, "scene") }?;
                let (scene, mut online) = (scene.read()?, lock(online)?);
                who_sees.look(&mut cells.with(&scene.scene, &mut online), &observers, &targets);
            }
        }
        Ok(())
    })
}

/// Returns an error unless the last answer has an observer or target of that number.
fn check_number(number: usize, count: usize, what: &str) -> Result<(), Error> {
    let message = format_args!("the answer has {count} {what}s, and no {what} {number}");
    if number < count { Ok(()) } else { Err(Error::new(VIS_ERROR_UNKNOWN_ID, message)) }
}

/// Writes whether an observer may see a target. Returns `VIS_ERROR_UNKNOWN_ID` for numbers that the last call
/// of `vis_who_sees_look` did not have.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_who_sees_sees(
    who_sees: *const vis_who_sees,
    observer: usize,
    target: usize,
    sees: *mut bool,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (who_sees, mut sees) = unsafe { (reference(who_sees, "who_sees")?, out(sees, "sees")?) };
        let who_sees = who_sees.0.read()?;
        check_number(observer, who_sees.observer_count(), "observer")?;
        check_number(target, who_sees.target_count(), "target")?;
        sees.set(who_sees.sees(observer, target));
        Ok(())
    })
}

/// Writes the numbers of the targets that an observer may see, ascending, like `vis_visible_ids`. Returns
/// `VIS_ERROR_UNKNOWN_ID` for an observer that the last call of `vis_who_sees_look` did not have.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_who_sees_seen_by(
    who_sees: *const vis_who_sees,
    observer: usize,
    targets: *mut u32,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (who_sees, targets) =
            unsafe { (reference(who_sees, "who_sees")?, buffer(targets, capacity, count)?) };
        let who_sees = who_sees.0.read()?;
        check_number(observer, who_sees.observer_count(), "observer")?;
        let seen = who_sees.seen_by(observer).map(|target| target as u32);
        targets.fill(who_sees.seen_by(observer).count(), seen)
    })
}
