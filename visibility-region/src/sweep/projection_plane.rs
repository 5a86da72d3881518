//! Access to the planes of a sweep and their maps, for pictures and measurements.

use super::culler::ExtendedProjectionCuller;
use super::direction::Direction;
use super::ray_map::{RayMap, SIDE};
use super::window::Window;
use visibility_core::Scene;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;

/// A projection plane of a sweep, with a map of the rays from the viewcell that are blocked in front of the
/// plane. For pictures and measurements.
#[derive(Clone, Copy, Debug)]
pub struct ProjectionPlane<'a> {
    direction: &'a Direction,
    window: &'a Window,
    map: &'a RayMap,
    origin: DVec3,
}

impl ProjectionPlane<'_> {
    /// Width and height of the map, in pixels.
    pub const SIDE: usize = SIDE;

    /// Returns the plane's normal: a unit vector in world space that points away from the viewcell.
    pub fn direction(&self) -> DVec3 {
        self.direction.rows[2]
    }

    /// Returns the distance in metres from the front of the box around the viewcell to the plane, along
    /// [`direction`](Self::direction).
    pub fn distance(&self) -> f64 {
        self.window.d
    }

    /// Returns the corners of the map in world space, in metres and up to rounding. Their pixel coordinates
    /// are (0, 0), (`SIDE`, 0), (`SIDE`, `SIDE`) and (0, `SIDE`).
    pub fn corners(&self) -> [DVec3; 4] {
        let [[left, right], [low, high]] = self.window.ends();
        [[left, low], [right, low], [right, high], [left, high]].map(|[x, y]| {
            let local = DVec3::new(x, y, self.window.d) + DVec3::from_array(self.direction.offset);
            let [a, b, c] = self.direction.rows;
            self.origin + a * local.x + b * local.y + c * local.z
        })
    }

    /// Returns whether all rays from the viewcell through pixel (`x`, `y`) are blocked in front of the plane.
    /// False outside of the map.
    pub fn is_covered(&self, x: usize, y: usize) -> bool {
        x < SIDE && y < SIDE && self.map.get(x, y)
    }
}

impl ExtendedProjectionCuller {
    /// Calls `each` with the planes of a sweep from a viewcell, direction by direction, nearest plane first.
    /// The maps hold all rays from the viewcell to objects of the scene that the sweep can test, and all
    /// occluders of the scene are drawn.
    pub fn for_each_plane(
        &mut self,
        scene: &Scene,
        cell: &Viewcell,
        mut each: impl FnMut(ProjectionPlane<'_>),
    ) {
        let origin = scene.origin();
        self.sweep_open(scene, cell, |direction, window, map| {
            each(ProjectionPlane { direction, window, map, origin });
        });
    }
}
