//! Depth conventions of clip space: which depths are in view, and which way they grow.

use glam::DVec4;

/// Which clip-space depths are in view.
///
/// ```
/// use visibility_core::view::Depth;
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
