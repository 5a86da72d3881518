//! Parts of a recipe's scene other than its objects: name, near plane, and camera walks.

use crate::source::SceneSource;
use crate::walk::{Walk, along};
use glam::{DVec3, Vec3};

/// Camera walk as a route on the plan: `waypoints` are (x, y) in metres, and `keys` is the number of camera
/// keys at equal distances along the route.
pub(super) struct Route {
    pub(super) name: &'static str,
    pub(super) fov_y_degrees: f32,
    pub(super) keys: usize,
    /// Distance in metres along the route from the eye to the point that the camera looks at.
    pub(super) look_ahead: f64,
    pub(super) waypoints: &'static [[f64; 2]],
}

/// Height of the camera above the ground, in metres.
const EYE_HEIGHT: f64 = 1.65;

impl Route {
    /// Makes the camera walk, with eyes and targets at eye height above the ground. `ground` maps a point (x,
    /// y) in metres to the height of the ground there, in metres.
    pub(super) fn walk(&self, ground: impl Fn(f64, f64) -> f64) -> Walk {
        let plan: Vec<_> = self.waypoints.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect();
        let mut keys = along(&plan, self.keys, self.look_ahead);
        for point in keys.iter_mut().flat_map(|key| [&mut key.eye, &mut key.target]) {
            point.z = ground(point.x, point.y) + EYE_HEIGHT;
        }
        Walk { name: self.name.to_owned(), fov_y_degrees: self.fov_y_degrees, up: Vec3::Z, keys }
    }
}

/// Makes a recipe's scene without its objects, with walks over level ground at z = 0. `near` is the distance
/// of the near plane in metres.
pub(super) fn scene(name: &str, near: f32, routes: &[Route]) -> SceneSource {
    scene_on(name, near, routes, |_, _| 0.0)
}

/// Makes a recipe's scene without its objects, with walks that follow the ground. `near` is the distance of
/// the near plane, and `ground` maps a point (x, y) to the height of the ground there, in metres.
pub(super) fn scene_on(
    name: &str,
    near: f32,
    routes: &[Route],
    ground: impl Fn(f64, f64) -> f64,
) -> SceneSource {
    let walks = routes.iter().map(|route| route.walk(&ground)).collect();
    SceneSource { walks, ..SceneSource::new(name, Vec3::Z, near) }
}
