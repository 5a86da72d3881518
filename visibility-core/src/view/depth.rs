//! Depth conventions of clip space: the range of depths in view, and the direction in which depth grows.

use glam::DVec4;

/// Depth convention of a clip matrix: which clip-space depths `z` are in view, relative to clip-space `w`.
///
/// ```
/// use visibility_core::view::Depth;
/// assert!(Depth::ReversedInfinite.is_reversed() && Depth::ReversedInfinite.is_infinite());
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum Depth {
    /// `z = -w` at the near plane and `z = w` at the far plane, as in OpenGL.
    NegativeOneToOne,
    /// `z = -w` at the near plane; `z` approaches `w` at infinity, and there is no far plane.
    NegativeOneToOneInfinite,
    /// `z = 0` at the near plane and `z = w` at the far plane, as in Direct3D, Vulkan, Metal and WebGPU.
    ZeroToOne,
    /// `z = 0` at the near plane; `z` approaches `w` at infinity, and there is no far plane.
    ZeroToOneInfinite,
    /// `z = w` at the near plane and `z = 0` at the far plane.
    Reversed,
    /// `z = w` at the near plane; `z / w` approaches 0 at infinity, and there is no far plane.
    ReversedInfinite,
}

impl Depth {
    /// Returns whether nearer points have the greater NDC depth `z / w`. False if nearer points have the
    /// lesser depth.
    pub const fn is_reversed(self) -> bool {
        matches!(self, Self::Reversed | Self::ReversedInfinite)
    }

    /// Returns whether the convention has no far plane. False if depth has a finite far plane.
    pub const fn is_infinite(self) -> bool {
        matches!(self, Self::NegativeOneToOneInfinite | Self::ZeroToOneInfinite | Self::ReversedInfinite)
    }

    /// Returns the NDC depth, clip-space `z / w`, of points on the near plane: -1, 0 or 1.
    pub const fn at_near(self) -> f64 {
        match self {
            Self::NegativeOneToOne | Self::NegativeOneToOneInfinite => -1.0,
            Self::ZeroToOne | Self::ZeroToOneInfinite => 0.0,
            Self::Reversed | Self::ReversedInfinite => 1.0,
        }
    }

    /// Returns the near plane and, unless the convention is infinite, the far plane. `z` and `w` are the rows
    /// of the clip matrix for depth and `w`. The dot product of a returned row and a point `(x, y, z, 1)` is
    /// positive on the side in view and 0 on the plane.
    pub(super) fn rows(self, z: DVec4, w: DVec4) -> (DVec4, Option<DVec4>) {
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
