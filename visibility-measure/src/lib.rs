//! The answer against which cullers are judged: what a camera sees, pixel by pixel.
//!
//! For tests, tools and loading screens; an engine that ships need not link it. [`ItemBuffer`] finds what is
//! seen, [`Comparison`] holds a culler's answer against it, [`Advisor`] chooses the culler for a scene by
//! both and the clock.
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
//! - Triangles are cut in homogeneous coordinates, before any division, so that points behind the eye, on it,
//!   or 1e30 m away need no special cases.
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
//! No projection, clipping or raster code is shared with the cullers: they test boxes against planes or
//! conservative depth, this draws triangles. Values are plain data and `Send`; to measure several views at
//! once, give each thread a buffer.
//!
//! ```
//! use visibility_core::{glam::{DVec3, Vec3}, Pose, View};
//! use visibility_measure::{Comparison, ItemBuffer};
//! // A wall 5 m before the eye, and a tile behind it.
//! let square = |distance: f32, r: f32| {
//!     let [a, b, c, d] = [(-r, -r), (r, -r), (r, r), (-r, r)].map(|(y, z)| Vec3::new(distance, y, z));
//!     [[a, b, c], [a, c, d]]
//! };
//! let (wall, tile) = (square(5.0, 4.0), square(8.0, 1.0));
//! let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
//! let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, f64::INFINITY)?;
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
//!
//! # Features
//! `std` (default) and `libm` are passed on to `visibility-core`, which needs one of them.
#![no_std]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod advisor;
mod clip;
mod compare;
mod error;
mod exact;
mod item_buffer;
mod raster;

pub use advisor::{Advisor, CullerTrial, DrawCost, SceneFacts};
pub use compare::Comparison;
pub use error::MeasureError;
pub use exact::{ExactVisibility, ObjectPixels};
pub use item_buffer::{ItemBuffer, MAX_SIDE};
pub use raster::NONE;
