//! Camera walks: key frames, interpolated frames, and keys made from a route on the ground.
//!
//! A walk is a list of keys with linear interpolation between consecutive keys. A route becomes keys by
//! moving along a polyline at constant speed and looking at the point a few metres further along the
//! polyline, as a walking person does: the view turns into a corner before the feet do.

use glam::{DVec3, Vec3};
use visibility_core::{Pose, View, view::ViewError};

/// Key of a walk: the positions of the eye and of the point it looks at, in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraKey {
    /// Position of the eye in world space, in metres.
    pub eye: DVec3,
    /// Point in world space that the eye looks at, in metres; must differ from `eye`.
    pub target: DVec3,
}

/// Camera walk through a scene: key frames with a fixed field of view.
#[derive(Debug, Clone, PartialEq)]
pub struct Walk {
    /// Name of the walk, for people.
    pub name: String,
    /// Vertical field of view, in degrees.
    pub fov_y_degrees: f32,
    /// Unit vector in world space that points up in the picture.
    pub up: Vec3,
    /// Camera keys in order, at least one.
    pub keys: Vec<CameraKey>,
}

impl Walk {
    /// Returns the pose of a camera of this walk, and its view: a picture of `size` pixels, a near plane
    /// `near` metres ahead and no far plane.
    ///
    /// # Errors
    ///
    /// Returns [`ViewError`] for a camera that is no view.
    pub fn view(&self, camera: CameraKey, near: f32, size: (u32, u32)) -> Result<(Pose, View), ViewError> {
        let pose = Pose::look_at(camera.eye, camera.target, self.up.as_dvec3());
        let fov_y = f64::from(self.fov_y_degrees).to_radians();
        let aspect = f64::from(size.0) / f64::from(size.1);
        Ok((pose, View::perspective(pose, fov_y, aspect, f64::from(near), f64::INFINITY)?))
    }

    /// Moves all eyes and targets by a vector in metres.
    pub fn translate(&mut self, by: DVec3) {
        self.map(|point| point + by);
    }

    /// Applies a function to the positions of all eyes and targets.
    pub fn map(&mut self, place: impl Fn(DVec3) -> DVec3) {
        for key in &mut self.keys {
            *key = CameraKey { eye: place(key.eye), target: place(key.target) };
        }
    }

    /// Returns the interpolated camera at a position along the keys: 0 is the first key, and 1.5 is halfway
    /// from the second to the third key. Positions beyond the ends give the first or last key, and NaN the
    /// first. `None` for a walk without keys.
    pub fn at(&self, position: f64) -> Option<CameraKey> {
        let last = self.keys.len().checked_sub(1)?;
        // `max` returns the other operand for NaN, so NaN becomes position 0.
        let position = position.max(0.0).min(last as f64);
        let index = position.floor() as usize;
        let part = position - index as f64;
        let here = self.keys[index];
        let next = self.keys[(index + 1).min(last)];
        // Exactly at a key, interpolation would let a non-finite next key or rounding change the answer.
        if part == 0.0 {
            return Some(here);
        }
        Some(CameraKey { eye: here.eye.lerp(next.eye, part), target: here.target.lerp(next.target, part) })
    }
}

/// One frame of a sequence of walks: the walk and the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Index of the frame's walk in the list of walks.
    pub walk: usize,
    /// Interpolated camera of the frame.
    pub camera: CameraKey,
}

/// Distributes `count` frames over all walks in proportion to their numbers of keys. The frames of a walk are
/// evenly spaced from its first to its last key.
///
/// With as many frames as keys, the frames are the keys. A walk with a share of one frame shows its first
/// key. The result has `count` frames, or none when there are no keys.
pub fn frames(walks: &[Walk], count: usize) -> Vec<Frame> {
    let total: u128 = walks.iter().map(|w| w.keys.len() as u128).sum();
    let mut frames = Vec::new();
    let mut keys_before = 0_u128;
    for (index, walk) in walks.iter().enumerate() {
        // Shares are differences of rounded running totals, so their sum is exactly `count`.
        let start = count as u128 * keys_before / total.max(1);
        keys_before += walk.keys.len() as u128;
        let share = (count as u128 * keys_before / total.max(1) - start) as usize;
        let steps = share.saturating_sub(1).max(1) as f64;
        let last = walk.keys.len().saturating_sub(1) as f64;
        frames.extend((0..share).filter_map(|i| {
            let camera = walk.at(i as f64 * last / steps)?;
            Some(Frame { walk: index, camera })
        }));
    }
    frames
}

/// Makes `keys` camera keys at equal distances along a polyline, each looking at the point `look_ahead`
/// metres further along the polyline. All lengths are metres.
///
/// Near the end, the point looked at is the end of the polyline. Where the point ahead is closer to the eye
/// than half of `look_ahead`, at the end or because the route turns back on itself, the camera looks along
/// the current leg of the route instead. Repeated waypoints are ignored. The result is empty when there are
/// fewer than two distinct waypoints, or when `look_ahead` is NaN or not positive.
pub fn along(waypoints: &[DVec3], keys: usize, look_ahead: f64) -> Vec<CameraKey> {
    let Some(route) = Route::new(waypoints) else {
        return Vec::new();
    };
    if look_ahead.is_nan() || look_ahead <= 0.0 || keys == 0 {
        return Vec::new();
    }
    let steps = keys.saturating_sub(1).max(1) as f64;
    (0..keys)
        .map(|i| {
            let way = route.length() * i as f64 / steps;
            CameraKey { eye: route.at(way), target: route.ahead(way, look_ahead) }
        })
        .collect()
}

/// Makes camera keys along a polyline: one at each vertex, and more between vertices that are farther than
/// `spacing` metres apart, at equal distances. So a camera that goes straight from key to key stays on the
/// polyline. Each key looks ahead as in [`along`], and repeated waypoints are ignored. Empty if [`along`]
/// would be empty, or if `spacing` is not positive.
pub fn through(waypoints: &[DVec3], spacing: f64, look_ahead: f64) -> Vec<CameraKey> {
    let Some(route) = Route::new(waypoints) else {
        return Vec::new();
    };
    let is_positive = |length: f64| length > 0.0;
    if !is_positive(look_ahead) || !is_positive(spacing) {
        return Vec::new();
    }
    let key = |way| CameraKey { eye: route.at(way), target: route.ahead(way, look_ahead) };
    let mut keys = vec![key(0.0)];
    for leg in route.points.windows(2) {
        let (start, length) = (leg[0].0, leg[1].0 - leg[0].0);
        let count = (length / spacing).ceil().max(1.0) as usize;
        keys.extend((1..=count).map(|i| key(start + length * i as f64 / count as f64)));
    }
    keys
}

/// Polyline parameterized by the distance along it.
struct Route {
    /// Distance from the start, in metres, and position of each vertex. Distances increase strictly, and
    /// there are at least two vertices.
    points: Vec<(f64, DVec3)>,
}

impl Route {
    /// Creates the route without repeated waypoints. `None` with fewer than two distinct waypoints.
    fn new(waypoints: &[DVec3]) -> Option<Self> {
        let mut points: Vec<(f64, DVec3)> = Vec::with_capacity(waypoints.len());
        for &point in waypoints {
            match points.last() {
                None => points.push((0.0, point)),
                Some(&(way, before)) => {
                    let step = point.distance(before);
                    if way + step > way {
                        points.push((way + step, point));
                    }
                }
            }
        }
        (points.len() >= 2).then_some(Self { points })
    }

    /// Returns the length of the whole polyline, in metres.
    fn length(&self) -> f64 {
        self.points.last().map_or(0.0, |&(way, _)| way)
    }

    /// Returns the point that a camera at the distance `way` from the start looks at, as described at
    /// [`along`].
    fn ahead(&self, way: f64, look_ahead: f64) -> DVec3 {
        let eye = self.at(way);
        let target = self.at((way + look_ahead).min(self.length()));
        if target.distance(eye) >= look_ahead * 0.5 {
            return target;
        }
        let leg = self.leg(way);
        let (from, to) = (self.points[leg - 1].1, self.points[leg].1);
        eye + (to - from).normalize_or(DVec3::X) * look_ahead
    }

    /// Returns the index of the end vertex of the leg that contains the distance `way` from the start.
    /// Distances beyond an end give the first or last leg.
    fn leg(&self, way: f64) -> usize {
        self.points.partition_point(|&(start, _)| start <= way).clamp(1, self.points.len() - 1)
    }

    /// Returns the point at the distance `way` from the start, in metres. Distances beyond the ends
    /// extrapolate the first or last leg.
    fn at(&self, way: f64) -> DVec3 {
        let leg = self.leg(way);
        let (start, from) = self.points[leg - 1];
        let (end, to) = self.points[leg];
        from + (to - from) * ((way - start) / (end - start))
    }
}

/// Returns a near-plane distance for a scene that has none: 1/2000 of the diagonal of its bounds, clamped to
/// 0.0001 to 1 scene units. Without bounds the diagonal counts as 1.
pub fn made_up_near(bounds: Option<(Vec3, Vec3)>) -> f32 {
    let diagonal = bounds.map_or(1.0, |(low, high)| (high.as_dvec3() - low.as_dvec3()).length());
    ((diagonal * 5e-4) as f32).clamp(1e-4, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes a walk whose key `i` is at (i, 0, 0) and looks towards +y.
    fn walk(keys: usize) -> Walk {
        let keys = (0..keys).map(|i| CameraKey {
            eye: DVec3::new(i as f64, 0.0, 0.0),
            target: DVec3::new(i as f64, 1.0, 0.0),
        });
        Walk { name: "test".into(), fov_y_degrees: 60.0, up: Vec3::Z, keys: keys.collect() }
    }

    #[test]
    fn as_many_frames_as_keys_are_the_keys() {
        let walks = [walk(5), walk(1), walk(7)];
        let frames = frames(&walks, 13);
        let keys: Vec<_> = walks.iter().flat_map(|w| &w.keys).copied().collect();
        assert_eq!(
            frames.iter().map(|f| f.camera).collect::<Vec<_>>(),
            keys,
            "as many frames as keys are the keys"
        );
    }

    #[test]
    fn any_number_of_frames_is_met_and_ends_are_shown() {
        let walks = [walk(4), walk(9)];
        for count in [0, 1, 2, 26, 1000] {
            assert_eq!(frames(&walks, count).len(), count, "{count} frames");
        }
        let many = frames(&walks, 260);
        assert_eq!(many[0].camera, walks[0].keys[0], "the first frame is the first key");
        assert_eq!(many[79].camera, walks[0].keys[3], "the last frame of the first walk is its last key");
        assert_eq!(many[80].camera, walks[1].keys[0], "the first frame of the second walk is its first key");
        assert_eq!(many[259].camera, walks[1].keys[8], "the last frame is the last key");
        assert_eq!(many[259].walk, 1, "the walk of the last frame");
        assert!(frames(&[], 10).is_empty(), "frames of no walks");
    }

    #[test]
    fn positions_outside_stay_at_the_ends() {
        let walk = walk(3);
        assert_eq!(walk.at(-1.0), Some(walk.keys[0]), "a position before the walk");
        assert_eq!(walk.at(f64::NAN), Some(walk.keys[0]), "a position of NaN");
        assert_eq!(walk.at(f64::INFINITY), Some(walk.keys[2]), "a position after the walk");
        assert_eq!(walk.at(0.5).expect("keys").eye.x, 0.5, "halfway to the second key");
    }

    #[test]
    fn a_route_that_turns_back_is_not_looked_at_from_on_top() {
        let back = [DVec3::ZERO, DVec3::new(4.0, 0.0, 0.0), DVec3::new(0.0, 0.1, 0.0)];
        for key in along(&back, 50, 2.0) {
            assert!(
                key.eye.distance(key.target) >= 1.0 - 1e-9,
                "the eye {} looks at {} from on top",
                key.eye,
                key.target
            );
        }
    }

    #[test]
    fn keys_through_a_corner_have_its_vertices_and_are_near_one_another() {
        let corner = [DVec3::ZERO, DVec3::new(4.0, 0.0, 0.0), DVec3::new(4.0, 1.0, 0.0)];
        let keys = through(&corner, 1.5, 1.0);
        let eyes: Vec<[f64; 2]> = keys.iter().map(|key| [key.eye.x, key.eye.y]).collect();
        assert_eq!(
            eyes,
            [[0.0, 0.0], [4.0 / 3.0, 0.0], [8.0 / 3.0, 0.0], [4.0, 0.0], [4.0, 1.0]],
            "eyes along a corner, at most 1.5 m apart"
        );
        assert_eq!(keys[3].target, corner[2], "the target at the corner is the next vertex");
        assert!(
            through(&corner, 0.0, 1.0).is_empty() && through(&corner[..1], 1.0, 1.0).is_empty(),
            "a step of 0, and a route of one point"
        );
    }

    #[test]
    fn keys_along_a_corner_look_ahead_and_past_the_end() {
        let corner = [DVec3::ZERO, DVec3::ZERO, DVec3::new(4.0, 0.0, 0.0), DVec3::new(4.0, 4.0, 0.0)];
        let keys = along(&corner, 5, 1.0);
        assert_eq!(keys[1].eye, DVec3::new(2.0, 0.0, 0.0), "a quarter of the way");
        assert_eq!(keys[2].eye, DVec3::new(4.0, 0.0, 0.0), "half of the way, the corner");
        assert_eq!(keys[2].target, DVec3::new(4.0, 1.0, 0.0), "from the corner, 1 m ahead");
        assert_eq!(keys[4].target, DVec3::new(4.0, 5.0, 0.0), "from the end, 1 m past it");
        assert!(along(&[DVec3::ZERO], 5, 1.0).is_empty(), "a route without length");
        assert!(along(&corner, 5, f64::NAN).is_empty(), "a distance ahead of NaN");
    }
}
