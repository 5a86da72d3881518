//! The camera, in the convention of any engine.
//!
//! A [`View`] consists of a clip matrix in `f64`, the point of the world that the matrix is relative to, and
//! the depth convention. Planes and eye are derived from these, so that cullers use exactly the frustum that
//! the engine's own matrix clips to.
//!
//! # Conventions
//! Clip space is that of all graphics APIs: a point is in view if `-w <= x <= w`, `-w <= y <= w`, and its
//! depth `z` is in the range that [`Depth`] defines. Matrices are column-major and multiply column vectors
//! from the left, as in glam. World axes, handedness and units are the caller's choice; where this
//! documentation says metres, any unit of length serves.

mod camera;
mod clip_matrix;
mod cube;
mod depth;
mod display;
mod error;
mod eye;
mod limits;
mod planes;
mod projection_rounding;
mod region;
mod sight_start;

pub use camera::{Pose, Window};
pub use clip_matrix::ClipMatrix;
pub use depth::Depth;
pub use error::ViewError;
pub use eye::Eye;
pub use limits::{MAX_CLIP_PLANES, MAX_PLANES};
pub use planes::{ViewPlane, ViewPlanes};
pub use projection_rounding::{ClipRow, ViewProjection};
pub use region::{PictureMargin, Reach, ViewRegion};

use crate::geometry::Plane;
use eye::eye_of;
use glam::{DMat4, DVec3};

/// A point of view: the frustum of one camera, its eye and its layers. A `View` knows nothing of the scene.
///
/// A view takes half a kilobyte, is `Copy`, and is cheap to make anew each frame.
///
/// ```
/// use visibility_core::{glam::Mat4, view::Depth, View};
/// // From the engine's own matrix: a glam type of this crate's version, or an array.
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
    /// Clip planes relative to `origin`, of which the first `clip_count` are in use. All others are zero, so
    /// that equal views compare equal.
    clip_planes: [Plane; MAX_CLIP_PLANES],
    clip_count: usize,
}

impl View {
    /// Builds a view from the matrix that the engine draws with, which maps world space to clip space.
    ///
    /// The matrix is column-major and multiplies column vectors: as an array, `matrix[column][row]`, so that
    /// `matrix[3]` holds the translation. An engine that multiplies row vectors, as DirectXMath does, stores
    /// the same 16 numbers in the same order. A matrix in row-major order must be transposed first. To check
    /// this, [print](#impl-Display-for-View) the view: it tells which camera its matrix stands for.
    ///
    /// `depth` must be the convention that the matrix was made for. Clip-space `w` must not decrease along a
    /// view ray away from the eye, and the near plane must not be behind the eye. These two conditions are
    /// not checked. Frustum culling is correct without them, but occlusion culling compares surfaces by `w`
    /// or depth and may then hide visible objects.
    ///
    /// An `f32` matrix is precise only near the origin of the world. Engines with large worlds pass a
    /// camera-relative matrix, and then call [`relative_to`](Self::relative_to) with the point of the world
    /// that the matrix is relative to.
    ///
    /// # Errors
    /// [`ViewError::Matrix`] for NaN or infinite elements, [`ViewError::NotInvertible`] for a matrix without
    /// inverse, and [`ViewError::NoCamera`] for parallel view rays with different `w`.
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
        // Cullers tell which surface is nearer by `w`, or by depth if `w` is constant. A parallel view with
        // varying `w` allows neither.
        let is_parallel = matches!(view.eye(DVec3::ZERO), Eye::Direction(_));
        if is_parallel && matrix.0.row(3).truncate() != DVec3::ZERO {
            return Err(ViewError::NoCamera);
        }
        Ok(view)
    }

    /// Returns this view with its matrix and clip planes taken as relative to `origin`, a point of the world
    /// in `f64`.
    ///
    /// Only the difference between this origin and the scene's origin enters the computations, so a
    /// camera-relative matrix loses no precision however far the camera is from the origin of the world.
    ///
    /// # Errors
    /// [`ViewError::Origin`] if `origin` has a NaN or infinite coordinate.
    pub fn relative_to(self, origin: DVec3) -> Result<Self, ViewError> {
        if origin.is_finite() { Ok(Self { origin, ..self }) } else { Err(ViewError::Origin) }
    }

    /// Returns this view restricted to objects that share a layer with `layers`, one bit per layer. Views
    /// show all layers (`u32::MAX`) by default.
    #[must_use]
    pub fn with_layers(self, layers: u32) -> Self {
        Self { layers, ..self }
    }

    /// Returns the layers that this view shows, one bit per layer.
    pub fn layers(&self) -> u32 {
        self.layers
    }

    /// Returns the depth convention of the clip matrix.
    pub fn depth(&self) -> Depth {
        self.depth
    }

    /// Returns the point of the world that the clip matrix and the clip planes are relative to.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Returns the matrix that maps points in metres relative to `origin` (a point of the world, such as the
    /// scene's origin) to clip space. The view's own origin is subtracted from `origin` in `f64` first.
    pub fn clip_from(&self, origin: DVec3) -> DMat4 {
        let offset = origin - self.origin;
        let mut matrix = self.clip_from_local;
        matrix.w_axis = self.clip_from_local * offset.extend(1.0);
        matrix
    }

    /// Returns the eye of this view: a point in metres relative to `origin`, which is a point of the world,
    /// or the unit direction of a parallel view, away from the viewer.
    pub fn eye(&self, origin: DVec3) -> Eye {
        match eye_of(&self.clip_from_local, self.depth) {
            Eye::Point(eye) => Eye::Point(eye + (self.origin - origin)),
            direction => direction,
        }
    }
}

#[cfg(test)]
mod tests;
