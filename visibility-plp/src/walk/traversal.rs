//! The rendering loop of figure 4 of Klosowski and Silva, 2000: cells are visited from the eye outwards. The
//! next cell is always the one with the least solidity in the front, the queue of cells to project.

use super::state::{CellState, FrameContext, Keep, Projected, UNOPENED, Walk};
use crate::cell_frustum::CellPlace;
use crate::solidity::{
    Solidity, SourceCell, count_solidity, entering_share, solid_angle_per_area, stopped_share,
    visibility_chance,
};
use crate::tessellation::Tessellation;
use visibility_core::{Aabb, scene::Changes, view::Eye};

impl Walk {
    /// Begins a frame: keeps the objects that are in no cell (strays and objects changed since the last
    /// `sync`) and puts the first cells into the front, the queue of cells to project. Returns true if the
    /// frame can go on. Returns false, with no object kept, if the tessellation was made from another scene,
    /// the scene's change log no longer reaches back to the last `sync`, or the eye is not known well enough
    /// to tell its cell. `keep` is told of the objects that are in no cell, with the priority 1; its answers
    /// are ignored.
    pub(crate) fn begin<T: Tessellation + ?Sized>(
        &mut self,
        frame: &FrameContext<'_, T>,
        keep: Keep<'_>,
    ) -> bool {
        let content = frame.tessellation.content();
        self.clear(frame);
        if frame.settings.one_sided {
            let bounds = frame.tessellation.bounds();
            let (eye, eye_error) = (frame.frustum.eye, frame.frustum.eye_error);
            content.normals.eye_offsets(eye, eye_error, &bounds, &mut self.eye_offsets);
        }
        self.spent = 0;
        if !frame.frustum.knows_eye() {
            return false;
        }
        let Changes::Objects(changed) = content.changes(frame.scene) else { return false };
        for &id in content.strays().iter().chain(changed) {
            if frame.scene.contains(id) && !self.taken.contains(id.index()) {
                self.taken.insert(id.index());
                if frame.visible.contains(frame.scene, id) {
                    self.order.push(id);
                    keep(id, 1.0);
                    self.spent = self.spent.saturating_add(frame.cost(id));
                }
            }
        }
        self.seed(frame);
        true
    }

    /// Puts the eye's cell into the front. For an eye outside of all cells and for parallel views, puts all
    /// boundary cells that may be in view into the front.
    fn seed<T: Tessellation + ?Sized>(&mut self, frame: &FrameContext<'_, T>) {
        // The error of the eye loses nothing where the near plane is more than twice that error away, as
        // `CellFrustum::knows_eye` tells. The computed eye and all visible points are on the inner side of
        // the side planes, so no cell between them is outside. The exact eye's cell is reached from this one
        // by `exit_margin`. The walk propagates the first cell before any test against a map, and maps are
        // not asked about cells that cross the near plane, as cells between both eyes do.
        if let Eye::Point(eye) = frame.frustum.eye
            && let Some(cell) = frame.tessellation.locate(eye)
        {
            // The eye's cell is visited whatever the view planes say, since all view rays start there.
            if !self.reach(frame, cell) {
                self.init_state(frame, cell, u16::MAX, &frame.tessellation.cell_bounds(cell));
                self.closed.remove(cell as usize);
            }
            let first = match frame.settings.solidity {
                Solidity::Coverage => 1.0,
                Solidity::Count => 0.0,
            };
            self.put(frame, cell, first);
            return;
        }
        for &cell in frame.tessellation.boundary() {
            if self.reach(frame, cell) {
                let value = match frame.settings.solidity {
                    Solidity::Coverage => share_from_outside(frame, cell, &self.cells[cell as usize]) as f32,
                    Solidity::Count => 0.0,
                };
                self.put(frame, cell, value);
            }
        }
    }

    /// Classifies a cell against the view planes when the frame first reaches the cell. Returns true if view
    /// rays may pass through the cell and the cell's neighbours have not been put into the front yet.
    #[inline]
    fn reach<T: Tessellation + ?Sized>(&mut self, frame: &FrameContext<'_, T>, cell: u32) -> bool {
        if self.reached_bits.contains(cell as usize) {
            return !self.is_closed(cell);
        }
        self.reached_bits.insert(cell as usize);
        let bounds = frame.tessellation.cell_bounds(cell);
        let CellPlace::Crossing(crossed) = frame.frustum.classify(&bounds) else {
            self.closed.insert(cell as usize);
            return false;
        };
        self.init_state(frame, cell, crossed, &bounds);
        true
    }

    /// Initialises the state of a cell that the frame has just reached. `crossed` has one bit for each view
    /// plane that the cell crosses. `bounds` is the cell's box, relative to the scene's origin.
    #[inline]
    fn init_state<T: Tessellation + ?Sized>(
        &mut self,
        frame: &FrameContext<'_, T>,
        cell: u32,
        crossed: u16,
        bounds: &Aabb,
    ) {
        let is_empty = frame.tessellation.content().is_empty(cell);
        let end_side = if is_empty { 0 } else { UNOPENED };
        let mut state = CellState { crossed, end_side, ..CellState::UNKNOWN };
        if frame.settings.solidity == Solidity::Coverage {
            let center = frame.tessellation.center(cell);
            let direction = frame.frustum.direction(center);
            let area = frame.tessellation.projected_area(cell, direction);
            state.direction = direction.as_vec3();
            state.area = area as f32;
            state.solid_angle_per_area = solid_angle_per_area(&frame.frustum, center, area);
        }
        self.cells[cell as usize] = state;
        if frame.settings.solidity == Solidity::Coverage {
            self.open(frame, cell, bounds);
            // A cell without objects takes nothing from the budget.
            self.cells[cell as usize].priority = self.best_side(cell).map_or(1.0, |(_, priority)| priority);
        }
    }

    /// Inserts a cell into the front (the queue of cells to project), or changes its key there. `value` is
    /// the cell's transmittance (0 to 1) with [`Solidity::Coverage`], its solidity with [`Solidity::Count`].
    /// Does nothing if the cell already has that value.
    #[inline]
    fn put<T: ?Sized>(&mut self, frame: &FrameContext<'_, T>, cell: u32, value: f32) {
        let state = &mut self.cells[cell as usize];
        if state.transmittance_or_solidity == value {
            return;
        }
        self.reached += u64::from(state.transmittance_or_solidity.is_nan());
        state.transmittance_or_solidity = value;
        let solidity = match frame.settings.solidity {
            Solidity::Coverage => 1.0 - visibility_chance(value) * state.priority,
            Solidity::Count => value,
        };
        self.front.push(solidity, cell);
    }

    /// Removes and returns the cell with the least solidity from the front (the queue of cells to project),
    /// skipping cells with nothing left to do. `None` if no such cell is left.
    #[inline]
    pub(crate) fn next(&mut self) -> Option<u32> {
        while let Some(cell) = self.front.pop() {
            // A neighbour may have put a finished cell into the front again.
            if !self.is_closed(cell) || self.has_content(cell) {
                return Some(cell);
            }
        }
        None
    }

    /// Processes a cell taken from the front. Puts the cell's neighbours into the front unless that was done
    /// before, then looks up the cell's layers of objects, highest priority first, while no cell of the front
    /// is less solid. A cell with layers left returns to the front. Keeps the objects looked up so far that
    /// have at least the priority of all that is left in the front, if `keep` agrees. Returns
    /// [`Projected::OutOfBudget`] if the budget ended or `keep` returned false.
    #[inline]
    pub(crate) fn step<T: Tessellation + ?Sized>(
        &mut self,
        frame: &FrameContext<'_, T>,
        cell: u32,
        keep: Keep<'_>,
    ) -> Projected {
        if !self.is_closed(cell) {
            self.propagate(frame, cell);
        }
        self.open_if_needed(frame, cell);
        let chance = self.cells[cell as usize].chance(frame.settings.solidity);
        while let Some((side, priority)) = self.best_side(cell) {
            let solidity = match frame.settings.solidity {
                Solidity::Coverage => 1.0 - chance * priority,
                // As in the paper, all objects of the cell are projected at once.
                Solidity::Count => 0.0,
            };
            if self.front.least().is_some_and(|least| least < solidity) {
                self.front.push(solidity, cell);
                break;
            }
            if self.emit(frame, 1.0 - solidity, keep) == Projected::OutOfBudget {
                return Projected::OutOfBudget;
            }
            self.project(frame, cell, side);
        }
        self.emit(frame, self.front.least().map_or(0.0, |least| 1.0 - least), keep)
    }

    /// Puts a cell that was taken from the front back into the front, with solidity 0 so that it comes out
    /// first.
    #[cfg(feature = "papers")]
    pub(crate) fn put_back(&mut self, cell: u32) {
        self.front.push(0.0, cell);
    }

    /// Keeps all objects that were looked up, without charging the budget.
    #[cfg(feature = "papers")]
    pub(crate) fn keep_ready(&mut self) {
        while let Some(id) = self.ready.pop() {
            self.order.push(id);
        }
    }

    /// Projects all remaining objects of a cell without charging the budget, then puts the cell's neighbours
    /// into the front unless that was done before. Does nothing for a cell that was dropped by
    /// [`drop_cell`](Self::drop_cell).
    #[cfg(feature = "papers")]
    pub(crate) fn finish<T: Tessellation + ?Sized>(&mut self, frame: &FrameContext<'_, T>, cell: u32) {
        self.open_if_needed(frame, cell);
        while let Some((side, _)) = self.best_side(cell) {
            self.project(frame, cell, side);
        }
        self.keep_ready();
        if !self.is_closed(cell) {
            self.propagate(frame, cell);
        }
    }

    /// Computes the transmittance (or solidity) of the neighbours that view rays may enter from `cell`
    /// through a face, and puts those neighbours into the front, the queue of cells to project. Sets the
    /// cell's bit in `closed`.
    #[inline]
    fn propagate<T: Tessellation + ?Sized>(&mut self, frame: &FrameContext<'_, T>, cell: u32) {
        self.closed.insert(cell as usize);
        self.projected += 1;
        let tessellation = frame.tessellation;
        let state = &self.cells[cell as usize];
        let direction = match frame.settings.solidity {
            Solidity::Coverage => state.direction.as_dvec3(),
            Solidity::Count => frame.frustum.direction(tessellation.center(cell)),
        };
        // The share of the cell's view rays that its own triangles do not stop goes on through its faces.
        let stopped = stopped_share(tessellation.content().cover(cell), direction);
        let source =
            SourceCell { cell, direction, transmittance_or_solidity: state.transmittance_or_solidity };
        let through = f64::from(state.transmittance_or_solidity) * (1.0 - stopped);
        let mut faces = core::mem::take(&mut self.faces);
        faces.clear();
        // Faces through which no ray from the eye leaves the cell are skipped.
        let is_open = |neighbour: u32| !self.is_closed(neighbour);
        tessellation.for_each_face(cell, &is_open, &mut |face| {
            if frame.frustum.may_exit_through(face.point, face.normal) {
                faces.push(*face);
            }
        });
        for face in &faces {
            let neighbour = face.neighbour;
            if !self.reach(frame, neighbour) {
                continue;
            }
            let state = &self.cells[neighbour as usize];
            let value = match frame.settings.solidity {
                Solidity::Coverage => {
                    let (area, direction) = (f64::from(state.area), state.direction.as_dvec3());
                    let more = through * entering_share(area, direction, face.normal, face.area);
                    // A neighbour that is not in the front yet has the value NaN, which counts as 0.
                    (state.transmittance_or_solidity.max(0.0) + more as f32).min(1.0)
                }
                Solidity::Count => {
                    let center = tessellation.center(neighbour);
                    count_solidity(tessellation, &frame.frustum, &source, face, center)
                }
            };
            self.put(frame, neighbour, value);
        }
        self.faces = faces;
    }
}

/// Returns the share of a boundary cell's silhouette through which view rays enter from outside of all cells,
/// 0 to 1. `state` supplies the cell's direction and silhouette area.
fn share_from_outside<T: Tessellation + ?Sized>(
    frame: &FrameContext<'_, T>,
    cell: u32,
    state: &CellState,
) -> f64 {
    let mut inner = 0.0;
    let (area, direction) = (f64::from(state.area), state.direction.as_dvec3());
    frame.tessellation.for_each_face(cell, &|_| true, &mut |face| {
        inner += entering_share(area, direction, -face.normal, face.area);
    });
    (1.0 - inner).max(0.0)
}
