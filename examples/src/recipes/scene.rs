//! A scene from the parts that a recipe made, with walks through it.

use super::mesh::Parts;
use crate::source::SceneSource;
use crate::walk::{Walk, along};
use glam::{DVec3, Vec3};

/// A camera walk as a route over the ground plan.
pub(super) struct Route {
    pub(super) name: &'static str,
    pub(super) fov_y_degrees: f32,
    pub(super) keys: usize,
    /// How far ahead along the route the camera looks, in metres.
    pub(super) look_ahead: f64,
    pub(super) waypoints: &'static [[f64; 2]],
}

/// The eye height of a person who walks.
const EYE_HEIGHT: f64 = 1.65;

impl Route {
    /// The walk at eye height over ground of the given height.
    pub(super) fn walk(&self, ground: impl Fn(f64, f64) -> f64) -> Walk {
        let plan: Vec<_> = self.waypoints.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect();
        let mut keys = along(&plan, self.keys, self.look_ahead);
        for point in keys.iter_mut().flat_map(|key| [&mut key.eye, &mut key.target]) {
            point.z = ground(point.x, point.y) + EYE_HEIGHT;
        }
        Walk { name: self.name.to_owned(), fov_y_degrees: self.fov_y_degrees, up: Vec3::Z, keys }
    }
}

/// Puts a recipe's parts and walks over level ground together.
pub(super) fn scene(name: &str, near: f32, parts: Parts, routes: &[Route]) -> SceneSource {
    scene_on(name, near, parts, routes, |_, _| 0.0)
}

/// The same with walks that follow the height of the ground.
pub(super) fn scene_on(
    name: &str,
    near: f32,
    parts: Parts,
    routes: &[Route],
    ground: impl Fn(f64, f64) -> f64,
) -> SceneSource {
    SceneSource {
        name: name.to_owned(),
        up: Vec3::Z,
        near,
        objects: parts.into_objects(),
        walks: routes.iter().map(|route| route.walk(&ground)).collect(),
        cells: None,
    }
}
