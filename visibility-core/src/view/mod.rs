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
mod error;
mod limits;
mod planes;
mod projection;
mod sight_start;

pub use camera::{Pose, Window};
pub use clip_matrix::ClipMatrix;
pub use error::ViewError;
pub use limits::{MAX_CLIP_PLANES, MAX_PLANES};
pub use planes::{ViewPlane, ViewPlanes};
pub use projection::{ClipRow, ViewProjection};

use crate::Plane;
use glam::{DMat4, DVec3, DVec4};

/// Which clip-space depths are in view.
///
/// ```
/// use visibility_core::Depth;
/// assert!(Depth::ReversedInfinite.is_reversed() && Depth::ReversedInfinite.is_infinite());
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum Depth {
    /// `-w` at the near plane, `w` at the far plane: OpenGL.
    NegativeOneToOne,
    /// As [`NegativeOneToOne`](Self::NegativeOneToOne) with the far plane at infinity.
    NegativeOneToOneInfinite,
    /// `0` at the near plane, `w` at the far plane: Direct3D, Vulkan, Metal, WebGPU.
    ZeroToOne,
    /// As [`ZeroToOne`](Self::ZeroToOne) with the far plane at infinity.
    ZeroToOneInfinite,
    /// `w` at the near plane, `0` at the far plane.
    Reversed,
    /// `w` at the near plane, `0` at infinity.
    ReversedInfinite,
}

impl Depth {
    /// Whether nearer points have the greater depth.
    pub const fn is_reversed(self) -> bool {
        matches!(self, Self::Reversed | Self::ReversedInfinite)
    }

    /// Whether there is no far plane.
    pub const fn is_infinite(self) -> bool {
        matches!(self, Self::NegativeOneToOneInfinite | Self::ZeroToOneInfinite | Self::ReversedInfinite)
    }

    /// Clip depth over `w` on the near plane.
    pub const fn at_near(self) -> f64 {
        match self {
            Self::NegativeOneToOne | Self::NegativeOneToOneInfinite => -1.0,
            Self::ZeroToOne | Self::ZeroToOneInfinite => 0.0,
            Self::Reversed | Self::ReversedInfinite => 1.0,
        }
    }

    /// The near plane and, if there is one, the far plane, from the rows of the clip matrix for depth and
    /// `w`, as rows that are positive for what is in view.
    fn rows(self, z: DVec4, w: DVec4) -> (DVec4, Option<DVec4>) {
        match self {
            Self::NegativeOneToOne => (w + z, Some(w - z)),
            Self::NegativeOneToOneInfinite => (w + z, None),
            Self::ZeroToOne => (z, Some(w - z)),
            Self::ZeroToOneInfinite => (z, None),
            Self::Reversed => (w - z, Some(z)),
            Self::ReversedInfinite => (w - z, None),
        }
    }
}

/// Where a view is seen from, relative to some origin.
///
/// ```
/// use visibility_core::{glam::DVec3, Eye, Pose, View};
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY)?;
/// assert!(matches!(view.eye(DVec3::ZERO), Eye::Point(_)));
/// # Ok::<(), visibility_core::ViewError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Eye {
    /// Perspective: all lines of sight start in this point.
    Point(DVec3),
    /// Orthographic: all lines of sight run along this unit direction, away from the viewer.
    Direction(DVec3),
}

/// A point of view: what one camera would see of an empty world.
///
/// Half a kilobyte, `Copy`, and made anew each frame.
///
/// ```
/// use visibility_core::{glam::Mat4, Depth, View};
/// // From the engine's own matrix, as a glam type of this crate's version or as an array of any:
/// let matrix = [[1.2, 0.0, 0.0, 0.0], [0.0, 1.6, 0.0, 0.0], [0.0, 0.0, 0.0, -1.0], [0.0, 0.0, 0.1, 0.0f32]];
/// let view = View::from_clip_from_world(matrix, Depth::ReversedInfinite)?;
/// assert!(View::from_clip_from_world(Mat4::ZERO, Depth::ZeroToOne).is_err());
/// # let _ = view;
/// # Ok::<(), visibility_core::ViewError>(())
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
    /// `depth` must be the convention that the matrix was made for, `w` must not fall along the lines of
    /// sight, and the near plane must lie before the eye: what is nearer is told by them. None of this is
    /// checked, since bounds are tested right without it; occlusion is not.
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
        // The eye is what the matrix maps to x = y = w = 0: the vector orthogonal to those three rows, which
        // exists for every projection, whatever its depth row holds.
        let m = &self.clip_from_local;
        let rows = [m.row(0), m.row(1), m.row(3)].map(scaled_by_power_of_two);
        let eye = orthogonal(rows, |a, b| a - b);
        let position = eye.truncate() / eye.w;
        if eye.w != 0.0 && position.is_finite() {
            return Eye::Point(position + (self.origin - origin));
        }
        // A parallel projection sees along the null direction; of its two senses, the one in which depth
        // grows (shrinks, if reversed) leads away from the viewer.
        let scale = eye.truncate().abs().max_element();
        let direction = (eye.truncate() / scale).normalize_or_zero();
        let depth = m.row(2).truncate().dot(direction) * if self.depth.is_reversed() { -1.0 } else { 1.0 };
        Eye::Direction(if depth < 0.0 { -direction } else { direction })
    }
}

/// A row of the clip matrix divided by the power of two in its largest element. Rows may differ by many
/// orders of magnitude, and only their directions matter to the eye; nothing is rounded, so the eye of a
/// scaled view is the scaled eye.
fn scaled_by_power_of_two(row: DVec4) -> DVec4 {
    let most = row.abs().max_element();
    let power = f64::from_bits(most.to_bits() & (0x7ff << 52));
    row / if power.is_normal() { power } else { most }
}

/// The vector orthogonal to three others in four dimensions, by cofactors; with a sum of magnitudes in place
/// of `subtract`, the sum of the magnitudes of all terms of each component.
fn orthogonal([a, b, c]: [DVec4; 3], subtract: impl Fn(f64, f64) -> f64) -> DVec4 {
    let minor = |i: usize, j: usize, k: usize| {
        let x = subtract(b[j] * c[k], b[k] * c[j]);
        let y = subtract(b[i] * c[k], b[k] * c[i]);
        let z = subtract(b[i] * c[j], b[j] * c[i]);
        subtract(a[i] * x, a[j] * y) + a[k] * z
    };
    let negative = subtract(0.0, 1.0);
    DVec4::new(minor(1, 2, 3), negative * minor(0, 2, 3), minor(0, 1, 3), negative * minor(0, 1, 2))
}

#[cfg(test)]
mod tests;
