//! Viewsheds: which samples of a raster of heights an observer sees over the terrain.
//!
//! **Surface.** A raster holds heights at the points of a grid. Each square of four neighbouring samples is
//! divided into two triangles by the diagonal from its sample `(row, column)` to `(row + 1, column + 1)`. The
//! terrain is these triangles with all that is below them; nothing is interpolated otherwise. Samples without
//! a height (see [`HeightRaster::new`]) and the edges at them hide nothing; beside them an edge hides nothing
//! exactly at its end, unless edges on the other side of that end do.
//!
//! **Target.** The target of a sample is the point above the sample, at the target height above its ground.
//! A target is visible if the segment from the observer's eye to it passes no edge of the surface below that
//! edge. A segment that touches the surface is not hidden. Since the surface is linear between edges, this is
//! visibility over the surface itself, and not over steps or an interpolation along the line of sight.
//!
//! **Rounding.** Answers are exact but for ties: what is hidden by less than some 1e-14 of the heights and
//! slopes involved counts as visible. So nothing visible is reported as hidden.
//!
//! **Method.** A plane one column away from the eye shows every edge of a quarter of the terrain as a
//! straight
//! segment: the direction in the plan along, the slope upwards. The upper envelope of the segments of all
//! columns up to one is the skyline that the samples of the next column are compared with. The envelope is
//! merged column by column, so that a raster of `n` samples takes time in proportion to `n` and the pieces of
//! the skyline; the latter are as many as a column has samples on real terrain. The idea of a skyline that
//! grows from front to back is that of *Reif, Sen: An efficient output-sensitive hidden-surface removal
//! algorithm and its parallelization (1988)*; the sweep by columns instead of single edges is due to the
//! grid.
//!
//! ```
//! use visibility_2d::viewshed::{HeightRaster, Observer, Viewshed};
//!
//! // A valley between two ridges, and the observer on the ground at its left end.
//! let profile = [0.0, 0.0, 30.0, 0.0, 45.0, 80.0_f32];
//! let heights = [profile, profile].concat();
//! let raster = HeightRaster::new(&heights, 2, 6, [10.0, 10.0])?;
//! let mut visible = [false; 12];
//! Viewshed::new().look(&raster, &Observer::new(0.0, 0.0).with_height(2.0), &mut visible)?;
//! assert_eq!(visible[..6], [true, true, true, false, false, true]);
//! # Ok::<(), visibility_2d::viewshed::ViewshedError>(())
//! ```

mod envelope;
mod observer;
mod raster;
mod sector;

pub use observer::Observer;
pub use raster::{HeightRaster, ViewshedError};
pub use sector::Viewshed;
