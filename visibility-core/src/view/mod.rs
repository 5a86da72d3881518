//! The camera, in whichever convention the engine has.
//!
//! A [`View`] is a clip matrix in `f64`, the point in the world that the matrix is relative to, and the depth
//! convention. Everything that cullers need (planes, eye) is derived from these, so that what is culled
//! is what the engine's own matrix clips.
//!
//! # Conventions
//! Clip space is that of every graphics API: a point is in view if `-w <= x <= w`, `-w <= y <= w`, and its
//! depth is in the range that [`Depth`] names. Matrices are column-major and multiply column vectors from the
//! left, as in glam. World axes, handedness and units are the caller's own; nothing here depends on them.

mod camera;
mod clip_matrix;
mod cube;
mod depth;
mod error;
mod eye;
mod limits;
mod planes;
mod projection;
mod sight_start;

pub use camera::{Pose, Window};
pub use clip_matrix::ClipMatrix;
pub use depth::Depth;
pub use error::ViewError;
pub use eye::Eye;
pub use limits::{MAX_CLIP_PLANES, MAX_PLANES};
pub use planes::{ViewPlane, ViewPlanes};
pub use projection::{ClipRow, ViewProjection};

use crate::geometry::Plane;
use eye::eye_of;
use glam::{DMat4, DVec3};

/// A point of view: what one camera would see of an empty world.
///
/// Half a kilobyte, `Copy`, and made anew each frame.
///
/// ```
/// use visibility_core::{glam::Mat4, view::Depth, View};
/// // From the engine's own matrix, as a glam type of this crate's version or as an array of any:
/// let matrix = [[1.2, 0.0, 0.0, 0.0], [0.0, 1.6, 0.0, 0.0], [0.0, 0.0, 0.0, -1.0], [0.0, 0.0, 0.1, 0.0f32]];
/// let view = View::from_clip_from_world(matrix, Depth::ReversedInfinite)?;
/// assert!(View::from_clip_from_world(Mat4::ZERO, Depth::ZeroToOne).is_err());
/// # let _ = view;
/// # Ok::<(), visibility_core::view::ViewError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct View {
    clip_from_local: DMat4,
    origin: DVec3,
    depth: Depth,
    layers: u32,
    /// Beyond the count all zero, so that equal views compare equal.
    clip_planes: [Plane; MAX_CLIP_PLANES],
    clip_count: usize,
}

impl View {
    /// A view from the matrix that the engine draws with: clip space from world space.
    ///
    /// `depth` must be the convention that the matrix was made for. Clip-space `w` must not decrease along a
    /// line of sight away from the eye, and the near plane must not lie behind the eye. Neither is
    /// checked: culling by planes is right without it, but occlusion culling takes the nearer of two
    /// surfaces by `w` or depth, and is not.
    ///
    /// The world of an `f32` matrix is small; engines with large worlds pass the matrix of a camera near the
    /// origin and say with [`relative_to`](Self::relative_to) where in the world that origin is.
    ///
    /// # Errors
    /// [`ViewError::NonFinite`], [`ViewError::Singular`] and [`ViewError::NoCamera`].
    pub fn from_clip_from_world(matrix: impl Into<ClipMatrix>, depth: Depth) -> Result<Self, ViewError> {
        let matrix = matrix.into();
        matrix.check()?;
        let view = Self {
            clip_from_local: matrix.0,
            origin: DVec3::ZERO,
            depth,
            layers: u32::MAX,
            clip_planes: [Plane::new(DVec3::ZERO, 0.0); MAX_CLIP_PLANES],
            clip_count: 0,
        };
        // What is nearer is told by w, or where that is the same everywhere, by depth. Here it would be told
        // by neither.
        let is_parallel = matches!(view.eye(DVec3::ZERO), Eye::Direction(_));
        if is_parallel && matrix.0.row(3).truncate() != DVec3::ZERO {
            return Err(ViewError::NoCamera);
        }
        Ok(view)
    }

    /// The same view, with its matrix taken as relative to `origin`, a point of the world in `f64`.
    ///
    /// Only the difference to the origin of the scene counts, so a camera-relative matrix loses no precision
    /// however far the camera is from the origin of the world.
    ///
    /// # Errors
    /// [`ViewError::NonFiniteOrigin`].
    pub fn relative_to(self, origin: DVec3) -> Result<Self, ViewError> {
        if origin.is_finite() { Ok(Self { origin, ..self }) } else { Err(ViewError::NonFiniteOrigin) }
    }

    /// The same view of the objects that share a layer with the given mask only; by default, all layers.
    pub fn with_layers(self, layers: u32) -> Self {
        Self { layers, ..self }
    }

    /// The layers that this view shows, a bit each.
    pub fn layers(&self) -> u32 {
        self.layers
    }

    /// The depth convention of the clip matrix.
    pub fn depth(&self) -> Depth {
        self.depth
    }

    /// The point of the world that the clip matrix is relative to.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Clip space from points relative to `origin`, a point of the world: usually that of the scene.
    ///
    /// The two origins are subtracted in `f64` before anything else happens to them.
    pub fn clip_from(&self, origin: DVec3) -> DMat4 {
        let offset = origin - self.origin;
        let mut matrix = self.clip_from_local;
        matrix.w_axis = self.clip_from_local * offset.extend(1.0);
        matrix
    }

    /// Where the view is seen from, relative to `origin`.
    pub fn eye(&self, origin: DVec3) -> Eye {
        match eye_of(&self.clip_from_local, self.depth) {
            Eye::Point(eye) => Eye::Point(eye + (self.origin - origin)),
            direction => direction,
        }
    }
}

#[cfg(test)]
mod tests;
