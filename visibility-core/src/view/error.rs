//! Errors of views: why a clip matrix or camera parameters cannot be used.

use super::limits::MAX_CLIP_PLANES;
use core::fmt;

/// Why a [`View`](crate::View) cannot be made from the given matrix, parameters, origin or clip planes.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum ViewError {
    /// The clip matrix has a NaN or infinite element.
    Matrix {
        /// Row, from 0, of the first NaN or infinite element in row-major order.
        row: usize,
        /// Column, from 0, of the first NaN or infinite element in row-major order.
        column: usize,
    },
    /// The clip matrix is singular within the rounding error of `f64`, so it maps all of space to a plane or
    /// less.
    NotInvertible,
    /// The view rays of the clip matrix are parallel, but `w` differs between them. No camera has such a
    /// matrix, and neither `w` nor depth tells which of two points is nearer.
    NoCamera,
    /// The origin of the view has a NaN or infinite coordinate.
    Origin,
    /// More clip planes were given than [`MAX_CLIP_PLANES`].
    TooManyClipPlanes {
        /// Number of clip planes that were given.
        count: usize,
    },
    /// A clip plane has a NaN or infinite component, or its normal is zero.
    ClipPlane {
        /// Index of the first unusable plane in the slice that was given.
        index: usize,
    },
    /// A camera parameter is out of its range.
    Parameter {
        /// Name of the parameter, such as `"near"`.
        name: &'static str,
        /// Value of the parameter as given: radians for an angle, metres for a distance. For `"width"` and
        /// `"height"`, the distance between the window's edges.
        value: f64,
    },
}

impl fmt::Display for ViewError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Matrix { row, column } => {
                write!(f, "the clip matrix is not finite at row {row}, column {column}")
            }
            Self::NotInvertible => write!(f, "the clip matrix is singular"),
            Self::NoCamera => {
                write!(
                    f,
                    "the clip matrix is of no camera: its lines of sight are parallel, but w is not constant"
                )
            }
            Self::Origin => write!(f, "the origin of the view is not finite"),
            Self::TooManyClipPlanes { count } => {
                write!(f, "{count} clip planes are more than {MAX_CLIP_PLANES}")
            }
            Self::ClipPlane { index } => {
                write!(f, "clip plane {index} is not finite or has no direction")
            }
            Self::Parameter { name, value } => {
                write!(f, "the camera's {name} cannot be {value}: {}", range_of(name, *value))
            }
        }
    }
}

/// Returns the range and the unit of a camera parameter that has an unusable value.
fn range_of(name: &str, value: f64) -> &'static str {
    match name {
        "fov_y" if (core::f64::consts::PI..180.0).contains(&value) => {
            "it is in radians, above 0 and below pi; was it meant in degrees?"
        }
        "fov_y" => "it is in radians, above 0 and below pi",
        "aspect" => "it is width over height, above 0 and finite",
        "near" if !value.is_finite() => "it is a distance in metres, and finite",
        "near" => "it is a distance in metres, above 0",
        "far" => "it is a distance in metres, above near; only a perspective view may have it infinite",
        _ => {
            "the left edge must be less than the right, and the bottom less than the top, by a finite distance"
        }
    }
}

impl core::error::Error for ViewError {}
