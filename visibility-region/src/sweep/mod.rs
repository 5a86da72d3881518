//! The occlusion sweep: in each of six directions, projection planes move away from the viewcell. A map of
//! the rays that are blocked before the plane is carried on from plane to plane.

pub(crate) mod cell_extent;
mod coverage;
mod culler;
pub(crate) mod direction;
mod facing;
mod hull_raster;
mod nearest;
mod occludees;
mod occluder;
mod occluder_raster;
mod pieces;
pub(crate) mod planes;
mod polygon;
mod projection_plane;
pub(crate) mod ray_map;
mod surfaces;
pub(crate) mod window;

pub(crate) use culler::Ask;
pub use culler::ExtendedProjectionCuller;
pub(crate) use occludees::Asked;
pub(crate) use planes::Effort;
pub use projection_plane::ProjectionPlane;
pub(crate) use surfaces::Surfaces;

use alloc::vec::Vec;
use direction::Direction;
use occluder::{Occluder, Source};
use occluder_raster::OccluderRaster;
use planes::{Candidate, Cone};
use ray_map::RayMap;
use window::Window;

/// Depth at which the near end of a piece that joins several meshes is cut off, as a fraction of the depth of
/// the plane that the piece is drawn on.
const CUT: f64 = 0.3;

/// The map of a sweep along one direction, and scratch memory. One value serves any number of sweeps.
#[derive(Clone, Debug)]
pub(crate) struct Sweep {
    pub(crate) map: RayMap,
    scratch: RayMap,
    raster: OccluderRaster,
    /// Window of the map. `None` before the first plane of a sweep.
    window: Option<Window>,
    /// Occluders that the sweep has reached and that are still to be drawn: the index of each, and the number
    /// of planes behind it on which it is still to be drawn.
    open: Vec<(usize, usize)>,
    /// Number of occluders that the sweep has reached: those whose nearest point lies before the present
    /// plane.
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

    /// Moves the map on to the plane of `window`: reprojects the covered pixels, and draws the occluders that
    /// end within `again` planes before the plane or reach through it. `occluders` are those of the whole
    /// sweep, nearest first. `place` must return the occluder of a source in local coordinates, or `None` to
    /// skip it. Returns the number of occluders drawn.
    pub(crate) fn advance<'a>(
        &mut self,
        direction: &Direction,
        window: Window,
        occluders: &[Candidate],
        cone: &Cone,
        again: usize,
        place: impl Fn(Source) -> Option<Occluder<'a>>,
    ) -> u64 {
        if let Some(before) = &self.window
            && self.map.any_set()
        {
            let [columns, rows] = [0, 1].map(|lat| window.reprojection(direction, before, lat));
            self.map.erode(&columns, &rows, &mut self.scratch);
        }
        self.window = Some(window);
        while occluders.get(self.begun).is_some_and(|c| c.begins < window.d) {
            self.open.push((self.begun, again));
            self.begun += 1;
        }
        let mut drawn = 0;
        let (raster, map) = (&mut self.raster, &mut self.map);
        self.open.retain_mut(|(index, again)| {
            let candidate = &occluders[*index];
            // A long piece is cut closer to the plane: what is nearer was drawn on the planes before.
            let near = if candidate.joins { cone.near.max(CUT * window.d) } else { cone.near };
            if let Some(occluder) = place(candidate.source) {
                drawn += u64::from(raster.draw(map, direction, &window, &occluder, near));
            }
            *again -= usize::from(candidate.ends <= window.d);
            *again > 0
        });
        drawn
    }
}
