//! Views from camera parameters (pose, field of view, near and far distance), for programs that have no clip
//! matrix of their own.

use super::{ClipMatrix, Depth, View, ViewError};
use crate::float;
use glam::{DMat4, DVec3, DVec4};

/// Position and orientation of a camera, in world coordinates. `right`, `up` and `forward` should be
/// orthonormal; the constructors of [`View`] do not check it.
///
/// ```
/// use visibility_core::{glam::DVec3, Pose};
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::new(0.0, 5.0, 0.0), DVec3::Z);
/// assert_eq!(pose.forward, DVec3::Y);
/// assert_eq!(pose.right, DVec3::X);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Pose {
    /// Position of the eye in the world, in metres.
    pub eye: DVec3,
    /// Unit vector towards the right edge of the picture, in world coordinates.
    pub right: DVec3,
    /// Unit vector towards the top edge of the picture, in world coordinates.
    pub up: DVec3,
    /// Unit vector along the viewing direction, away from the viewer, in world coordinates.
    pub forward: DVec3,
}

impl Pose {
    /// Builds the pose of a camera at `eye` that looks towards the point `target`. The picture's up vector is
    /// the direction nearest to `up` among those perpendicular to the viewing direction.
    ///
    /// Degenerate input has a defined result. If `up` is parallel to the viewing direction, an arbitrary
    /// perpendicular vector is used; if `up` is zero or not finite, z is used; if `target` equals `eye`, the
    /// camera looks along +x.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3) -> Self {
        let forward = (target - eye).normalize_or(DVec3::X);
        let right = forward.cross(up.normalize_or(DVec3::Z));
        // Below this length, the direction of the cross product is rounding noise.
        let right = if right.length() > 1e-9 { right.normalize() } else { forward.any_orthonormal_vector() };
        Self { eye, right, up: right.cross(forward), forward }
    }
}

/// The edges of the picture, as distances from the viewing axis. For perspective views these are tangents of
/// angles: distances on a plane 1 in front of the eye. For orthographic views they are in metres. `left <
/// right` and `bottom < top` are required, and checked by the constructors of [`View`].
///
/// ```
/// use visibility_core::view::Window;
/// let window = Window::centered(1.0, 0.5);
/// assert_eq!((window.left, window.top), (-1.0, 0.5));
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Window {
    /// Horizontal position of the left edge, a tangent or in metres; negative if left of the viewing axis.
    pub left: f64,
    /// Horizontal position of the right edge, a tangent or in metres; positive if right of the viewing axis.
    pub right: f64,
    /// Vertical position of the bottom edge, a tangent or in metres; negative if below the viewing axis.
    pub bottom: f64,
    /// Vertical position of the top edge, a tangent or in metres; positive if above the viewing axis.
    pub top: f64,
}

impl Window {
    /// Builds a window symmetric about the viewing axis, from half its width and half its height: tangents
    /// for perspective views, metres for orthographic ones.
    pub const fn centered(half_width: f64, half_height: f64) -> Self {
        Self { left: -half_width, right: half_width, bottom: -half_height, top: half_height }
    }

    pub(crate) fn check(&self) -> Result<(), ViewError> {
        let extent = |name, least: f64, most: f64| {
            let value = most - least;
            if value > 0.0 && value.is_finite() { Ok(()) } else { Err(ViewError::Parameter { name, value }) }
        };
        extent("width", self.left, self.right)?;
        extent("height", self.bottom, self.top)
    }
}

impl View {
    /// Builds a symmetric perspective view. `fov_y` is the vertical field of view in radians, between 0 and
    /// pi exclusive; `aspect` is width over height; `near` and `far` are distances of the planes in metres,
    /// with `0 < near < far`, and `far` may be infinite. The clip matrix has [reversed](Depth::Reversed)
    /// depth, with 1 at the near plane, and is relative to the eye.
    ///
    /// # Errors
    /// [`ViewError::Parameter`] names the first parameter that is out of range.
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

    /// Builds a perspective view through any window, such as one eye of a headset or one tile of a picture.
    /// `window` holds tangents of angles; `near` and `far` are distances of the planes from the eye in
    /// metres, with `0 < near < far`, and `far` may be infinite. The clip matrix has
    /// [reversed](Depth::Reversed) depth, with 1 at the near plane, and is relative to the eye.
    ///
    /// # Errors
    /// [`ViewError::Parameter`] names the first parameter that is out of range: `width` or `height` if the
    /// window is empty or not finite, `near` or `far`.
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
        // Clip depth is near (far - z) / (far - near) and w = z, so their quotient is 1 at the near and 0 at
        // the far plane.
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

    /// Builds an orthographic view. `window` is in metres. `near` and `far` are signed distances from
    /// `pose.eye` along the viewing direction, in metres; `near` may be negative, and `near < far` is
    /// required. The clip matrix has [reversed](Depth::Reversed) depth and is relative to `pose.eye`.
    ///
    /// # Errors
    /// [`ViewError::Parameter`] names the first parameter that is out of range.
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
