//! The answer against which cullers are judged: what a camera sees, pixel by pixel.
//!
//! An *item buffer* holds, for each pixel, the number of the triangle that is seen through the pixel's centre
//! (Weghorst, Hooper and Greenberg, "Improved Computational Methods for Ray Tracing", 1984). Counting numbers
//! tells which triangles and objects are visible, and by how many pixels; setting that against what a culler
//! reported ([`ExactVisibility::compare`]) tells where the culler erred.
//!
//! # What the numbers mean
//! The buffer samples the visible set V at pixel centres. A triangle that covers no centre, through a gap
//! narrower than a pixel or for being far away, is missed. So every *false hidden* object found is a true
//! error, but there may be more of them: the count is a lower bound. And an object reported but not found may
//! be one of V that fell between the samples: the *false visible* count is an upper bound. Both approach the
//! truth as the buffer grows.
//!
//! # Ties
//! Two objects tie for a pixel if the pixel's centre lies on the edge of one of them, or if their surfaces
//! coincide: rounding decides which of them the image shows. To be precise, a triangle ties with the one that
//! the image shows if it belongs to another object, comes within a millionth of a column and row of the
//! centre, and is there nearer, or as near to 1e-10 (of the distance; in parallel views, of the depth). Tied
//! pixels are counted apart from those that show one object alone, and count for all objects of the tie: each
//! of them is visible. A culler that reports one of them is not charged with hiding the others; one that
//! reports none is charged with one error.
//!
//! # How it draws
//! Both faces of every triangle, every triangle opaque, in `f64` from the view's own clip matrix:
//! - Triangles are cut in homogeneous coordinates, before any division, so that points behind the
//!   eye, on it, or 1e30 m away need no special cases.
//! - They are filled row by row between edges, a pixel being covered when its centre is. Triangles that share
//!   an edge compute it in the same way to the last bit, so that no pixel falls between them.
//! - Nearest wins; of equally near triangles the first drawn. For perspective views, nearness is `1/w`; for
//!   orthographic ones, where `w` is constant, it is clip-space `z/w`. Both are linear on the screen. In a
//!   perspective view the two order the points of a line of sight alike, but `z/w` of a distant point is a
//!   constant that the convention adds (zero, if reversed), plus a share of `1/w` that shrinks with the
//!   distance: at far/near = 1e9 rounding leaves seven digits of that share. `1/w` keeps the full relative
//!   precision of `f64` at any distance, in all six conventions, and does not depend on where an engine puts
//!   its near plane.
//!
//! Nothing here is shared with the cullers: they test boxes against planes or conservative depth, this draws
//! triangles. Values are plain data and `Send`; to measure several views at once, give each thread a buffer.
//!
//! ```
//! use visibility_core::{glam::{DVec3, Vec3}, measure::{Comparison, ItemBuffer}, Pose, View};
//! // A wall 5 m before the eye, and a tile behind it.
//! let square = |distance: f32, r: f32| {
//!     let [a, b, c, d] = [(-r, -r), (r, -r), (r, r), (-r, r)].map(|(y, z)| Vec3::new(distance, y, z));
//!     [[a, b, c], [a, c, d]]
//! };
//! let (wall, tile) = (square(5.0, 4.0), square(8.0, 1.0));
//! let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 16.0 / 9.0, 0.1, f64::INFINITY)?;
//! let mut buffer = ItemBuffer::new(640, 360)?;
//! let exact = buffer.draw(&view, DVec3::ZERO, [(7, &wall[..]), (8, &tile[..])])?;
//! assert_eq!((exact.visible_objects(), exact.visible_triangles()), (1, 2));
//! // A culler that reports the tile and forgets the wall errs both ways:
//! let mut comparison = Comparison::default();
//! exact.compare(|_index, key| key == 8, &mut comparison);
//! assert_eq!(comparison.false_hidden_keys, [7]);
//! assert_eq!(comparison.false_visible_objects, 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod advisor;
mod clip;
mod compare;
mod exact;
mod item_buffer;
mod raster;

pub use advisor::{Advisor, CullerTrial, DrawCost, SceneFacts};
pub use compare::Comparison;
pub use exact::{ExactVisibility, ObjectPixels};
pub use item_buffer::{ItemBuffer, MAX_SIDE, NONE};

use core::fmt;

/// Why something cannot be measured.
///
/// ```
/// use visibility_core::measure::{ItemBuffer, MeasureError};
/// let refused = ItemBuffer::new(0, 360).err();
/// assert_eq!(refused, Some(MeasureError::Size { width: 0, height: 360 }));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum MeasureError {
    /// A side is zero or above [`MAX_SIDE`], or there is no memory for so many pixels.
    Size {
        /// Columns asked for.
        width: u32,
        /// Rows asked for.
        height: u32,
    },
    /// There are more triangles or objects than 32-bit numbers for them.
    TooMany {
        /// Index of the object that went beyond.
        object: usize,
    },
}

impl fmt::Display for MeasureError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size { width, height } => {
                write!(f, "cannot make an item buffer of {width} x {height} pixels")
            }
            Self::TooMany { object } => {
                write!(f, "object {object} brings the number of triangles beyond {}", u32::MAX - 1)
            }
        }
    }
}

impl core::error::Error for MeasureError {}

#[cfg(test)]
mod ray_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tie_tests;
