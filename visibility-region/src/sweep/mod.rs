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
    /// Occluders that the sweep has reached and that are still to be drawn.
    open: Vec<Open>,
    /// Number of elements of `open`, from the first on, that have been drawn on the present plane.
    drawn: usize,
    /// Number of drawn elements of `open` that are to be drawn again on the next plane. They are moved to the
    /// front of `open`.
    kept: usize,
    /// Number of occluders that the sweep has reached: their nearest point is in front of the present plane.
    begun: usize,
    /// [`Effort::after_nothing`] of the present sweep.
    after_nothing: f64,
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
            after_nothing: 0.0,
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
    /// front of the plane are added to those to be drawn, until [`Effort::again`] planes behind them.
    /// `occluders` are those of the whole sweep, nearest first. On the plane before, [`draw`](Self::draw)
    /// must have returned true.
    pub(crate) fn move_to(
        &mut self,
        direction: &Direction,
        window: Window,
        occluders: &[Candidate],
        effort: &Effort,
    ) {
        self.after_nothing = effort.after_nothing;
        if let Some(before) = &self.window
            && self.map.any_set()
        {
            let [columns, rows] = [0, 1].map(|lat| window.reprojection(direction, before, lat));
            self.map.erode(&columns, &rows, &mut self.scratch);
        }
        self.window = Some(window);
        while occluders.get(self.begun).is_some_and(|c| c.begins < window.d) {
            self.open.push(Open { index: self.begun, again: effort.again, from: 0.0 });
            self.begun += 1;
        }
        (self.drawn, self.kept) = (0, 0);
    }

    /// Draws occluders on the present plane, until all are drawn or `work` is used up. Returns whether all
    /// are drawn. An occluder that cuts the plane is left out if it has added no pixel on one that is less
    /// than [`Effort::after_nothing`] times nearer: what it covers, the reprojection mostly brings from plane
    /// to plane, and leaving out an occluder never hides anything by mistake. `place` must return an occluder
    /// in local coordinates, given its source. Adds the number of occluders drawn to `count`.
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
                from = if drawn == Drawn::Nothing { self.after_nothing * window.d } else { 0.0 };
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

#[cfg(test)]
mod tests {
    use super::cell_extent::CellExtent;
    use super::direction::CellBox;
    use super::occludees::Item;
    use super::*;
    use visibility_core::glam::{Affine3A, DVec3, Vec3};
    use visibility_core::pvs::Viewcell;
    use visibility_core::scene::Triangle;
    use visibility_core::walk::Child;
    use visibility_core::{Aabb, OccluderMesh, Scene};

    /// Sweeps a mesh along x, from a viewcell of a metre that ends at x = 0. Returns, for each plane, whether
    /// the mesh was drawn and whether the map has pixels then.
    fn sweep(triangles: &[Triangle], planes: &[f64], effort: &Effort) -> Vec<(bool, bool)> {
        let bounds = Aabb::from_arrays([200.0, -9.0, -9.0], [201.0, 9.0, 9.0]);
        let viewcell = Viewcell::from_box(DVec3::new(-1.0, -0.5, -0.5), DVec3::new(0.0, 0.5, 0.5));
        let extent = CellExtent::new(&viewcell, DVec3::ZERO).unwrap();
        let direction = CellBox::new(&extent, &bounds, DVec3::AXES).unwrap().direction(0);
        let id = Scene::new().insert(bounds);
        let item =
            Item { child: Child::Object(id), bounds: direction.local_box(&bounds), scene_bounds: bounds };
        let cone = Cone::around(&direction, &[item]).unwrap();
        let mesh = OccluderMesh::from_triangles(triangles).unwrap();
        let local = direction.local_box(mesh.bounds());
        let occluders = [Candidate::of_mesh(id, [local.lo.z, local.hi.z])];
        let place = |_| Occluder::new(&direction, &mesh, &Affine3A::IDENTITY);
        let mut sweep = Sweep::new();
        sweep.begin();
        let mut on = |d: f64| {
            let window = Window::fit(&direction, d, [[-2.0 * d, 2.0 * d]; 2], [None; 2]).unwrap();
            let mut count = 0;
            sweep.move_to(&direction, window, &occluders, effort);
            let mut work = Work::UNLIMITED;
            let is_done = sweep.draw(&direction, &occluders, &cone, place, &mut work, &mut count);
            assert!(is_done, "the plane at {d} is done with work left");
            (count > 0, sweep.map.any_set())
        };
        planes.iter().map(|&d| on(d)).collect()
    }

    /// A quadrangle in the plane x = `x`, that faces the viewcell.
    fn wall(x: f32, half: f32) -> [Triangle; 2] {
        let [a, b, c, d] = [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]]
            .map(|[y, z]| Vec3::new(x, y * half, z * half));
        [[a, b, c], [a, c, d]]
    }

    /// The near wall is narrower than the viewcell and covers nothing. The far one is what hides.
    #[test]
    fn an_occluder_that_added_nothing_is_drawn_again_when_the_plane_is_far_or_behind_it() {
        let mesh = [wall(1.5, 0.1), wall(100.0, 50.0)].concat();
        let planes = [2.0, 2.5, 2.7, 3.0, 4.1, 4.3, 90.0, 101.0, 110.0];
        let drawn = [true, false, false, true, false, true, true, true, false];
        let set = [false, false, false, false, false, false, false, true, true];
        let expected: Vec<_> = drawn.into_iter().zip(set).collect();
        assert_eq!(sweep(&mesh, &planes, &Effort::QUICK), expected, "drawn and set, on planes at {planes:?}");
        let every = sweep(&mesh, &planes, &Effort::FULL);
        assert_eq!(every, set.map(|set| (true, set)), "a sweep for bakes, on planes at {planes:?}");
    }

    #[test]
    fn an_occluder_that_adds_pixels_is_drawn_on_the_next_plane() {
        let at = |x: f32, y: f32| Vec3::new(x, y, -2.0);
        let [a, b, c, d] = [at(0.5, -90.0), at(100.0, -90.0), at(100.0, 90.0), at(0.5, 90.0)];
        let planes: Vec<f64> = (2..20).map(|i| 1.2f64.powi(i)).collect();
        let expected = alloc::vec![(true, true); planes.len()];
        assert_eq!(
            sweep(&[[a, b, c], [a, c, d]], &planes, &Effort::QUICK),
            expected,
            "a floor, on planes at {planes:?}"
        );
    }
}
