//! Six views that together see all around: for cube maps of the surroundings and for the shadows of point
//! lights.

use super::{Pose, View, ViewError, Window};
use glam::DVec3;

/// Right, up and forward of each face.
const FACES: [[DVec3; 3]; 6] = [
    [DVec3::NEG_Z, DVec3::Y, DVec3::X],
    [DVec3::Z, DVec3::Y, DVec3::NEG_X],
    [DVec3::X, DVec3::NEG_Z, DVec3::Y],
    [DVec3::X, DVec3::Z, DVec3::NEG_Y],
    [DVec3::X, DVec3::Y, DVec3::Z],
    [DVec3::NEG_X, DVec3::Y, DVec3::NEG_Z],
];

impl View {
    /// The six faces of a cube map around `eye`, each 90 degrees wide and high: +X, -X, +Y, -Y, +Z, -Z.
    ///
    /// Pictures are oriented as GPUs sample cube maps (OpenGL 4.6 specification, table 8.19; the same in
    /// Direct3D, Vulkan, Metal and WebGPU), for a target whose first row is at clip-space `y = w`:
    ///
    /// | face | right | up | forward |
    /// |---|---|---|---|
    /// | +X | -Z | +Y | +X |
    /// | -X | +Z | +Y | -X |
    /// | +Y | +X | -Z | +Y |
    /// | -Y | +X | +Z | -Y |
    /// | +Z | +X | +Y | +Z |
    /// | -Z | -X | +Y | -Z |
    ///
    /// Cube maps are left-handed: in a right-handed world each picture is a mirror image, front faces wind
    /// the other way. OpenGL and Vulkan, whose first row is at `y = -w`, also draw with `y` negated. What
    /// is in view depends on none of this.
    ///
    /// `near` and `far` are distances along the axes, `far` may be infinite. All points between the cubes of
    /// these half sizes are in at least one of the views, with no gap between faces: neighbours share a
    /// plane to the last bit, since the elements of these matrices are zeros and ones, and each keeps
    /// what is on it. Depth is [reversed](crate::view::Depth::Reversed).
    ///
    /// Give each face its own culler and set, as any other view: one walk for all six was built and measured,
    /// and took 7 to 18 % longer than six walks, since no face looks at what the others see but along the
    /// edges.
    ///
    /// # Errors
    /// [`ViewError::Parameter`] names what is out of range; [`ViewError::NonFiniteOrigin`].
    ///
    /// ```
    /// use visibility_core::{glam::DVec3, View};
    /// let faces = View::cube_faces(DVec3::new(1.0, 2.0, 3.0), 0.1, 50.0)?;
    /// let below = DVec3::new(1.1, -7.0, 3.2);
    /// let sees = |view: &View| view.planes(DVec3::ZERO).as_slice().iter()
    ///     .all(|v| v.plane.signed_distance(below) >= 0.0);
    /// assert_eq!(faces.map(|face| sees(&face)), [false, false, false, true, false, false]);
    /// # Ok::<(), visibility_core::view::ViewError>(())
    /// ```
    pub fn cube_faces(eye: DVec3, near: f64, far: f64) -> Result<[Self; 6], ViewError> {
        let face = |i: usize| {
            let [right, up, forward] = FACES[i];
            let pose = Pose { eye, right, up, forward };
            Self::perspective_off_center(pose, Window::centered(1.0, 1.0), near, far)
        };
        Ok([face(0)?, face(1)?, face(2)?, face(3)?, face(4)?, face(5)?])
    }
}
