//! Views from the parameters of a camera, for programs that have no clip matrix of their own.

use super::{ClipMatrix, Depth, View, ViewError};
use crate::float;
use glam::{DMat4, DVec3, DVec4};

/// Where a camera stands and how it is turned, in world coordinates.
///
/// ```
/// use visibility_core::{glam::DVec3, Pose};
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::new(0.0, 5.0, 0.0), DVec3::Z);
/// assert_eq!(pose.forward, DVec3::Y);
/// assert_eq!(pose.right, DVec3::X);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Pose {
    /// The eye.
    pub eye: DVec3,
    /// Unit vector to the right of the picture.
    pub right: DVec3,
    /// Unit vector to the top of the picture.
    pub up: DVec3,
    /// Unit vector into the picture.
    pub forward: DVec3,
}

impl Pose {
    /// Looks from `eye` towards `target`, with `up` pointing to the top of the picture as far as it can.
    ///
    /// Always defined: where `up` is parallel to the line of sight, any vector across it serves, and where
    /// `target` is the eye itself, it looks along x.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3) -> Self {
        let forward = (target - eye).normalize_or(DVec3::X);
        let right = forward.cross(up.normalize_or(DVec3::Z));
        // Below this length the direction across is rounding noise.
        let right = if right.length() > 1e-9 { right.normalize() } else { forward.any_orthonormal_vector() };
        Self { eye, right, up: right.cross(forward), forward }
    }
}

/// The sides of a picture: for perspective, as tangents, on a plane at distance 1 before the eye; for
/// orthographic projection, in metres.
///
/// ```
/// use visibility_core::view::Window;
/// let window = Window::centered(1.0, 0.5);
/// assert_eq!((window.left, window.top), (-1.0, 0.5));
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Window {
    /// Negative to the left of the line of sight.
    pub left: f64,
    /// Positive to the right of the line of sight.
    pub right: f64,
    /// Negative below the line of sight.
    pub bottom: f64,
    /// Positive above the line of sight.
    pub top: f64,
}

impl Window {
    /// A window about the line of sight, of the given half sizes.
    pub const fn centered(half_width: f64, half_height: f64) -> Self {
        Self { left: -half_width, right: half_width, bottom: -half_height, top: half_height }
    }

    fn check(&self) -> Result<(), ViewError> {
        let extent = |name, least: f64, most: f64| {
            let value = most - least;
            if value > 0.0 && value.is_finite() { Ok(()) } else { Err(ViewError::Parameter { name, value }) }
        };
        extent("width", self.left, self.right)?;
        extent("height", self.bottom, self.top)
    }
}

impl View {
    /// A symmetric perspective view: vertical field of view in radians, width over height, and the distances
    /// of the near and far planes, where `far` may be infinite. Its clip matrix is
    /// [reversed](Depth::Reversed) and relative to the eye.
    ///
    /// # Errors
    /// [`ViewError::Parameter`] names what is out of range.
    pub fn perspective(pose: Pose, fov_y: f64, aspect: f64, near: f64, far: f64) -> Result<Self, ViewError> {
        if !(fov_y > 0.0 && fov_y < core::f64::consts::PI) {
            return Err(ViewError::Parameter { name: "fov_y", value: fov_y });
        }
        if !(aspect > 0.0 && aspect.is_finite()) {
            return Err(ViewError::Parameter { name: "aspect", value: aspect });
        }
        let half_height = float::tan(fov_y * 0.5);
        Self::perspective_off_center(pose, Window::centered(half_height * aspect, half_height), near, far)
    }

    /// A perspective view through any window: one eye of a headset, one tile of a picture.
    ///
    /// # Errors
    /// [`ViewError::Parameter`] names what is out of range.
    pub fn perspective_off_center(
        pose: Pose,
        window: Window,
        near: f64,
        far: f64,
    ) -> Result<Self, ViewError> {
        window.check()?;
        if !(near > 0.0 && near.is_finite()) {
            return Err(ViewError::Parameter { name: "near", value: near });
        }
        if far.is_nan() || far <= near {
            return Err(ViewError::Parameter { name: "far", value: far });
        }
        let (width, height) = (window.right - window.left, window.top - window.bottom);
        let (x, y, z) = (pose.right, pose.up, pose.forward);
        let center_x = (window.right + window.left) / width;
        let center_y = (window.top + window.bottom) / height;
        // Depth is (far - z) near / (far - near), over w = z: w at the near plane, 0 at the far one.
        let (slope, depth_at_eye, depth) = if far.is_finite() {
            (-near / (far - near), near * (far / (far - near)), Depth::Reversed)
        } else {
            (0.0, near, Depth::ReversedInfinite)
        };
        let rows = [
            (x * (2.0 / width) - z * center_x).extend(0.0),
            (y * (2.0 / height) - z * center_y).extend(0.0),
            (z * slope).extend(depth_at_eye),
            z.extend(0.0),
        ];
        Self::from_rows(rows, depth, pose.eye)
    }

    /// An orthographic view. `near` and `far` are distances along the line of sight and may be negative.
    /// Its clip matrix is [reversed](Depth::Reversed) and relative to the eye.
    ///
    /// # Errors
    /// [`ViewError::Parameter`] names what is out of range.
    pub fn orthographic(pose: Pose, window: Window, near: f64, far: f64) -> Result<Self, ViewError> {
        window.check()?;
        if !near.is_finite() {
            return Err(ViewError::Parameter { name: "near", value: near });
        }
        if !(far > near && (far - near).is_finite()) {
            return Err(ViewError::Parameter { name: "far", value: far });
        }
        let (width, height, length) = (window.right - window.left, window.top - window.bottom, far - near);
        let rows = [
            (pose.right * (2.0 / width)).extend(-(window.right + window.left) / width),
            (pose.up * (2.0 / height)).extend(-(window.top + window.bottom) / height),
            (pose.forward * (-1.0 / length)).extend(far / length),
            DVec4::W,
        ];
        Self::from_rows(rows, Depth::Reversed, pose.eye)
    }

    fn from_rows(rows: [DVec4; 4], depth: Depth, eye: DVec3) -> Result<Self, ViewError> {
        let [x, y, z, w] = rows;
        let matrix = DMat4::from_cols(x, y, z, w).transpose();
        Self::from_clip_from_world(ClipMatrix::from(matrix), depth)?.relative_to(eye)
    }
}
