//! Why a camera cannot be used.

use super::limits::MAX_CLIP_PLANES;
use core::fmt;

/// Why a camera cannot be used.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum ViewError {
    /// An element of the clip matrix is NaN or infinite.
    NonFinite {
        /// Row of the first such element.
        row: usize,
        /// Column of the first such element.
        column: usize,
    },
    /// The clip matrix has no inverse, as far as `f64` can tell: some direction of space is lost.
    Singular,
    /// The lines of sight are parallel, yet `w` differs from one to another: no camera has such a picture.
    NoCamera,
    /// The origin is NaN or infinite.
    NonFiniteOrigin,
    /// More clip planes than [`MAX_CLIP_PLANES`].
    TooManyClipPlanes {
        /// How many were given.
        count: usize,
    },
    /// A clip plane is NaN or infinite, or its normal is zero.
    ClipPlane {
        /// Index of the first such plane.
        index: usize,
    },
    /// A parameter of the camera is out of its range.
    Parameter {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
    },
}

impl fmt::Display for ViewError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NonFinite { row, column } => {
                write!(f, "the clip matrix is not finite at row {row}, column {column}")
            }
            Self::Singular => write!(f, "the clip matrix is singular"),
            Self::NoCamera => {
                write!(
                    f,
                    "the clip matrix is of no camera: its lines of sight are parallel, but w is not constant"
                )
            }
            Self::NonFiniteOrigin => write!(f, "the origin of the view is not finite"),
            Self::TooManyClipPlanes { count } => {
                write!(f, "{count} clip planes are more than {MAX_CLIP_PLANES}")
            }
            Self::ClipPlane { index } => {
                write!(f, "clip plane {index} is not finite or has no direction")
            }
            Self::Parameter { name, value } => write!(f, "the camera's {name} cannot be {value}"),
        }
    }
}

impl core::error::Error for ViewError {}
