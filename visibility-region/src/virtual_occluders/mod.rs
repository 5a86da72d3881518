//! Virtual occluders: a few large rectangles that stand for all that the occluders of a scene together hide
//! from a viewcell.
//!
//! This work is based on: Koltun, Chrysanthou and Cohen-Or, "Virtual Occluders: An Efficient Intermediate PVS
//! Representation", 2000. A virtual occluder lies within the umbra that a viewcell has behind many occluders:
//! every ray from the cell through it is blocked before it. The paper builds candidates from the supporting
//! and separating lines of seeds. Here they are rectangles of the maps of an occlusion sweep, and a greedy
//! choice, as in the paper, keeps those that hide most.

mod choose;
mod culler;
mod rectangles;

pub use culler::VirtualSweepCuller;

use crate::sight_start::sight_start;
use crate::sweep::cell_extent::CellExtent;
use crate::sweep::direction::{CellBox, Direction};
use alloc::vec::Vec;
use visibility_core::bits::Bits;
use visibility_core::geometry::Plane;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::occlusion::Occlusion;
use visibility_core::pvs::Viewcell;
use visibility_core::scene::{Changes, SceneCursor};
use visibility_core::{Aabb, Accuracy, OccluderMesh, OcclusionMap, Scene, View};

/// A rectangle in world space that no ray from its viewcell reaches: occluders block all of them before it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct VirtualOccluder {
    /// Axes of the rectangle in world space: along its sides, then the direction that leaves the viewcell.
    axes: [DVec3; 3],
    /// Point of the world that positions are relative to: the scene's origin when the rectangle was made.
    anchor: DVec3,
    /// Position of the rectangle's plane along the last axis, relative to the anchor.
    distance: f64,
    /// Least and greatest coordinate of the rectangle along the first two axes, relative to the anchor.
    ends: [[f64; 2]; 2],
}

impl VirtualOccluder {
    /// Returns the corners in world space, in metres, in order around the rectangle.
    pub fn corners(&self) -> [DVec3; 4] {
        let [[left, right], [low, high]] = self.ends;
        let at = |x: f64, y: f64| {
            self.anchor + (self.axes[0] * x + self.axes[1] * y + self.axes[2] * self.distance)
        };
        [at(left, low), at(right, low), at(right, high), at(left, high)]
    }
}

/// The virtual occluders of one viewcell, at most [`MAX`](Self::MAX), as an occlusion map: they hide, from
/// an eye in the viewcell, whatever moves behind them. Objects need not have been there when the virtual
/// occluders were made.
///
/// Made by [`virtual_occluders`](crate::ExtendedProjectionCuller::virtual_occluders). They reach as far aside
/// as the objects of the scene, seen from the viewcell, and are chosen to hide most of these.
///
/// The scene's occluders are in them already, so occluders [added](OcclusionMap::add) to the map are ignored.
/// The map hides nothing
/// - unless [`sync`](Self::sync) has found since the frame before that the scene's occluders are as they
///   were;
/// - in a frame of which lines of sight begin outside of the viewcell;
/// - in a view whose layers leave out one of the scene's occluders.
///
/// Cost: a test takes some 20 nanoseconds for each virtual occluder, and a frame as much to begin.
///
/// ```
/// use visibility_core::{glam::{Affine3A, DVec3}, occlusion::Occlusion, pvs::Viewcell};
/// use visibility_core::{Aabb, Object, OccluderMesh, OcclusionMap, Pose, Scene, View};
/// use visibility_region::ExtendedProjectionCuller;
/// let wall = Aabb::from_arrays([5.0, -9.0, -9.0], [5.2, 9.0, 9.0]);
/// let mut scene = Scene::new();
/// let id = scene.insert(Object { occluder: true, ..Object::new(wall) });
/// let mesh = scene.add_mesh(OccluderMesh::cuboid(&wall)?);
/// scene.set_mesh(id, mesh, Affine3A::IDENTITY)?;
/// let post = |x: f32| Aabb::from_arrays([x, -1.0, -1.0], [x + 1.0, 1.0, 1.0]);
/// scene.insert(Aabb::from_arrays([30.0, -9.0, -9.0], [31.0, 9.0, 9.0]));
/// let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
/// let mut map = ExtendedProjectionCuller::new().virtual_occluders(&scene, &cell);
///
/// map.sync(&scene); // before each frame
/// let eye = DVec3::splat(0.5);
/// let view = View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 100.0)?;
/// map.begin(&view, scene.origin());
/// assert_eq!(map.test(&post(15.0)), Occlusion::Hidden);
/// assert_eq!(map.test(&post(3.0)), Occlusion::Partial);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct VirtualOccluders {
    cell: Viewcell,
    occluders: Vec<VirtualOccluder>,
    /// State of the scene up to which no change has made the virtual occluders wrong.
    cursor: SceneCursor,
    /// Indices of the objects that occluded when the virtual occluders were made.
    occluding: Bits,
    /// Layer masks of these objects, each mask once. A view draws all of these objects if it shares a layer
    /// with each mask.
    layers: Vec<u32>,
    /// Whether [`sync`](Self::sync) has been called since the last frame began, and has found the occluders
    /// unchanged.
    confirmed: bool,
    /// Virtual occluders relative to the starts of this frame's lines of sight.
    active: Vec<Active>,
}

/// A virtual occluder in local coordinates of the box in which lines of sight begin.
#[derive(Clone, Copy, Debug)]
struct Active {
    direction: Direction,
    /// Distance in metres of the rectangle's plane from the front of the box.
    d: f64,
    /// Least and greatest coordinate of the rectangle along local x, then along local y, in metres.
    ends: [[f64; 2]; 2],
}

impl VirtualOccluders {
    /// Greatest number of virtual occluders of a viewcell.
    pub const MAX: usize = 16;

    /// Returns the virtual occluders. The one that hides most comes first.
    pub fn occluders(&self) -> &[VirtualOccluder] {
        &self.occluders
    }

    /// Confirms for the next frame, until [`begin`](OcclusionMap::begin), that the scene's occluders are as
    /// they were when the virtual occluders were made. Returns false for another scene, a clone included, and
    /// if an occluder was moved, opened, changed otherwise or removed: the map then hides nothing, and
    /// virtual occluders are to be made anew. Other objects may change, come and go. The scene must be
    /// the one that is culled in that frame.
    ///
    /// Takes time in proportion to the changes since the call before. A scene with so many changes between
    /// two calls that its log does not list them counts as another.
    pub fn sync(&mut self, scene: &Scene) -> bool {
        self.confirmed = match self.cursor.peek(scene) {
            Changes::Everything => false,
            Changes::Objects(ids) => !ids.iter().any(|id| self.occluding.contains(id.index())),
        };
        if self.confirmed {
            self.cursor = SceneCursor::at(scene);
        } else if self.cursor.is_in(scene) {
            // What has changed stays changed: the list need not be read again.
            self.cursor = SceneCursor::START;
        }
        self.confirmed
    }

    /// Returns a box in world space, minimum and maximum corner, that contains the starts of all lines of
    /// sight of a view. `None` if they are not all within the viewcell.
    fn sight_start(&self, view: &View) -> Option<(DVec3, DVec3)> {
        let anchor = self.cell.min * 0.5 + self.cell.max * 0.5;
        let (low, high) = sight_start(view, anchor)?;
        let within = self.cell.min.cmple(low).all() && high.cmple(self.cell.max).all();
        let is_inside = |plane: &Plane| {
            let corners = [low - anchor, high - anchor].map(|corner| plane.normal * corner);
            let least = corners[0].min(corners[1]).element_sum() + plane.signed_distance(anchor);
            // Eight roundings, each of at most half an EPSILON of the terms.
            let terms = (plane.normal.abs() * (anchor.abs() + low.abs().max(high.abs()))).element_sum();
            least >= 8.0 * f64::EPSILON * (terms + plane.offset.abs())
        };
        let within = within && self.cell.planes.iter().all(is_inside);
        within.then_some((low, high))
    }

    /// Prepares the virtual occluders for a frame whose lines of sight begin in `start`. `start` is within
    /// the viewcell and relative to `origin`, as the tested boxes are.
    fn activate(&mut self, start: &CellExtent, origin: DVec3) {
        self.active.clear();
        for occluder in &self.occluders {
            let near = Aabb::from_world(occluder.corners()[0], occluder.corners()[2], origin);
            let Some(start) = CellBox::new(start, &near, occluder.axes) else { continue };
            let direction = start.direction(2);
            let moved = occluder.anchor - origin;
            let [x, y, z] = [0, 1, 2].map(|i| direction.rows[i].dot(moved) - direction.offset[i]);
            let along = |ends: [f64; 2], offset: f64| ends.map(|end| end + offset);
            self.active.push(Active {
                direction,
                d: occluder.distance + z,
                ends: [along(occluder.ends[0], x), along(occluder.ends[1], y)],
            });
        }
    }
}

impl OcclusionMap for VirtualOccluders {
    fn name(&self) -> &str {
        "virtual occluders"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn begin(&mut self, view: &View, origin: DVec3) {
        self.active.clear();
        // The walls are where they were only with the origin that they were relative to.
        let confirmed = core::mem::take(&mut self.confirmed)
            && self.occluders.iter().all(|occluder| occluder.anchor == origin);
        if !(confirmed && self.layers.iter().all(|layers| layers & view.layers() != 0)) {
            return;
        }
        let Some((min, max)) = self.sight_start(view) else { return };
        if let Some(start) = CellExtent::new(&Viewcell::from_box(min, max), origin) {
            self.activate(&start, origin);
        }
    }

    /// Does nothing, since the virtual occluders contain the occluders of the scene already.
    fn add(&mut self, _: &OccluderMesh, _: &Affine3A) {}

    fn flush(&mut self) {}

    fn test(&self, bounds: &Aabb) -> Occlusion {
        if !bounds.is_proper() {
            return Occlusion::Visible;
        }
        let size = bounds.min.abs().max(bounds.max.abs()).as_dvec3().element_sum();
        let hidden = self.active.iter().any(|active| active.hides(bounds, size));
        if hidden { Occlusion::Hidden } else { Occlusion::Partial }
    }
}

impl Active {
    fn hides(&self, bounds: &Aabb, size: f64) -> bool {
        let direction = &self.direction;
        let local = direction.local_box(bounds);
        // Local coordinates of the box round by 16 EPSILON of its size, and those of the rectangle by its own
        // and the origin's, which are within the direction's.
        let error = direction.error + 16.0 * f64::EPSILON * size;
        if !(self.d > 0.0 && local.lo.z > self.d + 8.0 * error) {
            return false;
        }
        let projection = direction.occludee(self.d, &local);
        (0..2).all(|lat| {
            // A projected end is v + (x - v) (d + w) / (z + w), and changes by up to 1 + |x - v| / z with x
            // and z.
            let steep = (local.lo[lat].abs().max(local.hi[lat].abs()) + direction.half[lat]) / local.lo.z;
            let margin = 16.0 * error * (1.0 + steep);
            projection[lat][0] - margin >= self.ends[lat][0]
                && projection[lat][1] + margin <= self.ends[lat][1]
        })
    }
}
