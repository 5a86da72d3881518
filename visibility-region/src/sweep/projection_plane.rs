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

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::Affine3A;
    use visibility_core::{Aabb, Object, OccluderMesh};

    /// A wall that covers the middle of a map: pixels beyond the ends of rows and columns are not covered.
    #[test]
    fn pixels_outside_of_the_map_are_not_covered() {
        const SIDE: usize = ProjectionPlane::SIDE;
        let mut scene = Scene::new();
        let wall = Aabb::from_arrays([4.0, -30.0, -30.0], [4.5, 30.0, 30.0]);
        let id = scene.insert(Object { occluder: true, ..Object::new(wall) });
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&wall).unwrap());
        scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        scene.insert(Aabb::from_arrays([40.0, -90.0, -90.0], [41.0, 90.0, 90.0]));
        let cell = Viewcell::from_box(DVec3::splat(-0.5), DVec3::splat(0.5));
        let (mut covered, mut open) = (0, 0);
        ExtendedProjectionCuller::new().for_each_plane(&scene, &cell, |plane| {
            let pixels = (0..SIDE).step_by(16).flat_map(|y| (0..SIDE).step_by(16).map(move |x| (x, y)));
            for (x, y) in pixels {
                assert_eq!(plane.is_covered(x, y), plane.map.get(x, y), "pixel {x}, {y}");
                covered += usize::from(plane.is_covered(x, y));
                open += usize::from(!plane.is_covered(x, y));
            }
            for at in 0..SIDE {
                for beyond in [SIDE, SIDE + 1, usize::MAX] {
                    assert!(!plane.is_covered(beyond, at), "column {beyond} of row {at}");
                    assert!(!plane.is_covered(at, beyond), "row {beyond} of column {at}");
                }
            }
        });
        assert!(covered > 100 && open > 100, "{covered} covered, {open} open");
    }
}
