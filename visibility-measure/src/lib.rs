//! Reference answers for judging cullers: the objects that a camera sees, sampled pixel by pixel.
//!
//! For tests, tools and loading screens; a shipped engine need not link this crate. [`ItemBuffer`] finds the
//! visible objects, [`Comparison`] compares a culler's answer with them, and [`Advisor`] chooses the culler
//! for a scene by such comparisons and measured time.
//!
//! An *item buffer* holds, for each pixel, the number of the triangle that is seen through the pixel's centre
//! (Weghorst, Hooper and Greenberg, "Improved Computational Methods for Ray Tracing", 1984). Counting these
//! numbers gives the visible triangles and objects and their pixels. Comparing the counts with a culler's
//! answer ([`SampledVisibility::compare`]) gives the culler's errors.
//!
//! # What the numbers mean
//! The buffer samples the visible set V at pixel centres. A triangle that covers no centre is missed: one
//! seen through a gap narrower than a pixel, or one far away. Every *false hidden* object found is therefore
//! a true error, but some may be missed: the count is a lower bound. An object that a culler reports and the
//! buffer misses may belong to V: the *false visible* count is an upper bound. Both counts converge to the
//! truth as the buffer grows.
//!
//! # How far a culler can get
//! The *box limit* ([`ItemBuffer::box_limit`]) counts the objects that a culler must report if it knows all
//! opaque surfaces, but tests each object only by its box: the objects whose box is not behind a surface in
//! at least one pixel. The number of reported objects divided by the box limit tells how far such a culler is
//! from the best of its kind, which has 1. Cullers that test triangles, and sets baked by proofs, may report
//! fewer. The limit is sampled at the same pixel centres as V, and V is part of it.
//!
//! The *ideal* ([`Advisor::min_us`]) draws only the visible triangles and takes no time to cull. The *cost
//! over the ideal* of a culler is the time to cull and to draw the reported objects, divided by the ideal,
//! with the same [`DrawCost`]. This single figure includes both the culling time and needlessly reported
//! objects.
//!
//! # Ties
//! Two objects tie for a pixel if the pixel's centre lies on the edge of one of them, or if their surfaces
//! coincide. Rounding then decides which of them the image shows. Precisely, a triangle ties with the
//! triangle that the image shows if three conditions hold. The two belong to different objects. The triangle
//! comes within a millionth of a column and row of the centre. There it is nearer than the shown triangle, or
//! equally near up to a relative difference of 1e-10 (for parallel views, up to 1e-10 of the depth range).
//! Tied pixels are counted separately from pixels that show one object alone, and they count for all objects
//! of the tie: each of these objects is visible. A culler that reports one object of a tie is not charged
//! with hiding the others. A culler that reports none is charged with one error.
//!
//! # How triangles are drawn
//! The rules of a renderer decide what is visible. Triangles are opaque and drawn from both sides, unless a
//! [`DrawnObject`] says otherwise. A see-through object shows in every pixel in which it is in front of the
//! nearest opaque triangle, and that triangle shows through it. A one-sided object shows, and covers, only
//! where its front faces the eye. All arithmetic is `f64`, starting from the view's own clip matrix:
//! - Triangles are clipped in homogeneous coordinates, before any division. Points behind the eye, in the
//!   eye, or 1e30 m away need no special cases. But of a triangle that crosses the near plane, the cut is
//!   known to its size times 2^-53: from about 1e15 m on, parts beyond the near plane may be missing.
//! - Triangles are filled row by row between edges. A pixel is covered if its centre is. Two triangles that
//!   share an edge compute it identically to the last bit, so no pixel falls between them.
//! - The nearest triangle wins; among equally near triangles, the first drawn. The depth key is `1/w` for
//!   perspective views. For orthographic views, where `w` is constant, it is clip-space `z/w`. Both are
//!   linear on the screen. In a perspective view `1/w` and `z/w` order the points of a view ray alike. But
//!   there `z/w` is a constant of the depth convention (zero, if reversed) plus a multiple of `1/w`. That
//!   multiple shrinks with the distance: at far/near = 1e9 rounding leaves it seven digits. `1/w` keeps the
//!   full relative precision of `f64` at any distance, in all six depth conventions, and is independent of
//!   the near plane.
//!
//! No projection, clipping or raster code is shared with the cullers: cullers test boxes against planes or
//! conservative depth, this crate draws triangles. Values are plain data and `Send`. To measure several views
//! at once, give each thread its own buffer.
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
//! let sampled = buffer.draw(&view, DVec3::ZERO, [(7, &wall[..]), (8, &tile[..])])?;
//! assert_eq!((sampled.visible_objects(), sampled.visible_triangles()), (1, 2));
//! // A culler that reports the tile and forgets the wall errs both ways:
//! let mut comparison = Comparison::default();
//! sampled.compare(|_index, key| key == 8, &mut comparison);
//! assert_eq!(comparison.false_hidden_keys, [7]);
//! assert_eq!(comparison.false_visible_objects, 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Features
//! `std` (default) and `libm` are passed on to `visibility-core`, which needs one of them.
#![no_std]
#![warn(missing_debug_implementations)]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod advisor;
mod box_limit;
mod clip;
mod compare;
mod error;
mod item_buffer;
mod raster;
mod sampled_visibility;
#[cfg(feature = "serde")]
mod serde_records;

pub use advisor::{Advisor, CullerTrial, DrawCost, SceneFacts};
pub use compare::Comparison;
pub use error::MeasureError;
pub use item_buffer::{DrawnObject, ItemBuffer, MAX_SIDE};
pub use raster::NONE;
pub use sampled_visibility::{ObjectPixels, SampledVisibility};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
