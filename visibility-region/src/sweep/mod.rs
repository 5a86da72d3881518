//! The occlusion sweep: in each of six directions, projection planes move away from the viewcell. A map of
//! the rays that are blocked in front of the plane is transferred from plane to plane.

pub(crate) mod cell_extent;
mod coverage;
mod culler;
pub(crate) mod direction;
mod effort;
mod facing;
mod hull_raster;
mod nearest;
mod occludees;
mod occluder;
mod occluder_raster;
mod pieces;
mod pixel_block;
pub(crate) mod planes;
mod polygon;
mod projection_plane;
pub(crate) mod ray_map;
mod surfaces;
pub(crate) mod window;

pub(crate) use culler::Ask;
pub use culler::ExtendedProjectionCuller;
pub(crate) use effort::{Effort, Work};
pub(crate) use occludees::Asked;
pub use projection_plane::ProjectionPlane;
pub(crate) use surfaces::Surfaces;

use alloc::vec::Vec;
use direction::Direction;
use occluder::{Occluder, Source};
use occluder_raster::{Drawn, OccluderRaster};
use planes::{Candidate, Cone};
use ray_map::RayMap;
use window::Window;

/// Depth at which a piece that joins several meshes is cut off, as a fraction of the depth of the plane on
/// which it is drawn. The part of such a long piece in front of this depth was drawn on planes before.
const CUT: f64 = 0.3;

/// Least ratio of the depth of a plane to that of an earlier one, if an occluder that cuts both planes and
/// added no pixel on the earlier one is to be drawn on the later one. What such an occluder covers, the
/// reprojection mostly brings from plane to plane. Leaving out an occluder never hides anything by mistake.
const AFTER_NOTHING: f64 = 1.4;

/// An occluder that a sweep has reached and that is still to be drawn.
#[derive(Clone, Copy, Debug)]
struct Open {
    /// Index among the occluders of the sweep.
    index: usize,
    /// Number of planes behind the occluder's farthest point on which it is still to be drawn.
    again: usize,
    /// Depth in metres of the first plane on which it is to be drawn next, if it cuts that plane. 0 unless it
    /// added no pixel the last time.
    from: f64,
}

/// The map of a sweep along one direction, and scratch memory. One value serves any number of sweeps.
#[derive(Clone, Debug)]
pub(crate) struct Sweep {
    pub(crate) map: RayMap,
    scratch: RayMap,
    raster: OccluderRaster,
    /// Window of the map. `None` before the first plane of a sweep.
    window: Option<Window>,
    open: Vec<Open>,
    /// Number of elements of `open`, from the first on, that have been drawn on the present plane.
    drawn: usize,
    /// Number of drawn elements of `open` that are to be drawn again on the next plane. They are moved to the
    /// front of `open`.
    kept: usize,
    /// Number of occluders that the sweep has reached: their nearest point is in front of the present plane.
    begun: usize,
}

impl Sweep {
    pub(crate) fn new() -> Self {
        Self {
            map: RayMap::new(),
            scratch: RayMap::new(),
            raster: OccluderRaster::new(),
            window: None,
            open: Vec::new(),
            drawn: 0,
            kept: 0,
            begun: 0,
        }
    }

    /// Begins a sweep with an empty map.
    pub(crate) fn begin(&mut self) {
        self.map.clear();
        self.window = None;
        self.open.clear();
        self.begun = 0;
    }

    /// Moves the map to the plane of `window`. Covered pixels are reprojected, and occluders that begin in
    /// front of the plane are added to those to be drawn, until `again` planes behind them. `occluders` are
    /// those of the whole sweep, nearest first. On the plane before, [`draw`](Self::draw) must have returned
    /// true.
    pub(crate) fn move_to(
        &mut self,
        direction: &Direction,
        window: Window,
        occluders: &[Candidate],
        again: usize,
    ) {
        if let Some(before) = &self.window
            && self.map.any_set()
        {
            let [columns, rows] = [0, 1].map(|lat| window.reprojection(direction, before, lat));
            self.map.erode(&columns, &rows, &mut self.scratch);
        }
        self.window = Some(window);
        while occluders.get(self.begun).is_some_and(|c| c.begins < window.d) {
            self.open.push(Open { index: self.begun, again, from: 0.0 });
            self.begun += 1;
        }
        (self.drawn, self.kept) = (0, 0);
    }

    /// Draws occluders on the present plane, until all are drawn or `work` is used up. Returns whether all
    /// are drawn. An occluder that cuts the plane is left out if it has added no pixel on one that is less
    /// than [`AFTER_NOTHING`] times nearer. `place` must return an occluder in local coordinates, given its source. Adds the number of
    /// occluders drawn to `count`.
    pub(crate) fn draw<'a>(
        &mut self,
        direction: &Direction,
        occluders: &[Candidate],
        cone: &Cone,
        place: impl Fn(Source) -> Option<Occluder<'a>>,
        work: &mut Work,
        count: &mut u64,
    ) -> bool {
        let Some(window) = self.window else { return true };
        while let Some(&Open { index, again, mut from }) = self.open.get(self.drawn) {
            if work.is_used_up() {
                return false;
            }
            let candidate = &occluders[index];
            // A long piece is cut closer to the plane, since its nearer part was drawn on the planes before.
            let near = if candidate.joins { cone.near.max(CUT * window.d) } else { cone.near };
            let is_cut = candidate.ends > window.d;
            let is_due = !is_cut || window.d >= from;
            if is_due && let Some(occluder) = place(candidate.source) {
                let drawn = self.raster.draw(&mut self.map, direction, &window, &occluder, near, work);
                *count += u64::from(drawn != Drawn::LeftOut);
                from = if drawn == Drawn::Nothing { AFTER_NOTHING * window.d } else { 0.0 };
            }
            let again = again - usize::from(!is_cut);
            if again > 0 {
                self.open[self.kept] = Open { index, again, from };
                self.kept += 1;
            }
            self.drawn += 1;
        }
        self.open.truncate(self.kept);
        true
    }
}
