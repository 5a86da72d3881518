//! What an occluder is on the screen: half-planes that its pixels satisfy, and planes that bound its depth.
//!
//! # Why it is sound
//! Take any set of triangles that all turn the same way round on the screen, and call *contour* those of their edges, with direction, that
//! are not cancelled by the opposite edge of another. If a point lies strictly to the left of the line of every contour edge, each of them
//! sweeps a positive angle about the point; so the contour winds round it at least once, and as every triangle winds in the same sense,
//! at least one triangle covers the point. The same holds on the sphere of directions about the eye, so nothing need be
//! before the eye, and cutting triangles at the near plane adds the cuts to the contour. Nothing here assumes a convex solid; for one, no
//! pixel inside its outline is lost.
//!
//! What covers a point lies on the plane of a drawn triangle, so its depth key is at least the least over all their planes there, and at
//! least that of the farthest corner. (Durand, "A Multidisciplinary Survey of Visibility", 2000, chapter 6, on why conservative maps need both parts: coverage rounded
//! inwards, depth rounded away.)
//!
//! # The error bound
//! Coordinates, edges and planes are computed in `f64` with running bounds ([`ObjectProjection`](crate::projection::Placed)); half-planes and planes
//! are moved inwards and away by these
//! bounds. [`ScreenShape::add_edge`] and [`ScreenShape::add_depth_plane`] then round to `f32`, and derive what that costs. What remains is exact comparison of integers.

use crate::buffer::tile_layout::SIDE;
use crate::coverage::Coverage;
use crate::rounding::{FloorCeil, down, up};

/// A bound on the pixels of a row: `x >= slope * row + offset` or `x <= ...`, with all rounding on the safe side.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RowBound {
    pub(crate) slope: f32,
    pub(crate) offset: f32,
}

impl RowBound {
    /// Where `f32` cannot hold the numbers, or they are none, the bound that lets nothing through.
    #[inline(always)]
    fn new(slope: f64, offset: f64, nothing: f32) -> Self {
        let (slope, offset) = (slope as f32, offset as f32);
        if slope.abs() + offset.abs() < f32::INFINITY {
            Self { slope, offset }
        } else {
            Self { slope: 0.0, offset: nothing }
        }
    }
}

/// The most half-planes that a shape can have.
pub(crate) const MAX_EDGES: usize = 32;
/// The most planes.
pub(crate) const MAX_PLANES: usize = 16;

/// A shape ready to be filled.
#[derive(Clone, Debug)]
pub(crate) struct ScreenShape {
    /// Bounds from the left and from the right.
    pub(crate) left: [RowBound; MAX_EDGES],
    pub(crate) right: [RowBound; MAX_EDGES],
    pub(crate) lefts: usize,
    pub(crate) rights: usize,
    /// For each plane the least depth key in a tile, as a function of its column and row.
    pub(crate) planes: [[f32; 3]; MAX_PLANES],
    pub(crate) plane_count: usize,
    /// Depth keys that all of it has at least.
    pub(crate) floor: f32,
    /// Depth keys that none of it exceeds.
    pub(crate) ceiling: f32,
    /// First and end columns, first and end rows, in pixels of the buffer.
    pub(crate) columns: [f32; 2],
    pub(crate) lines: [usize; 2],
}

/// Where something is on the screen, rounded outwards: first and end columns, first and end rows in pixels, least and greatest depth key.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScreenExtent {
    pub(crate) columns: [usize; 2],
    pub(crate) lines: [usize; 2],
    pub(crate) depth_key: [f32; 2],
}

/// Of `f32`, eight times the unit round-off.
const F32: f64 = 4.0 * f32::EPSILON as f64;

impl ScreenShape {
    pub(crate) const EMPTY: Self = Self {
        left: [RowBound { slope: 0.0, offset: 0.0 }; MAX_EDGES],
        right: [RowBound { slope: 0.0, offset: 0.0 }; MAX_EDGES],
        lefts: 0,
        rights: 0,
        planes: [[0.0; 3]; MAX_PLANES],
        plane_count: 0,
        floor: 0.0,
        ceiling: 0.0,
        columns: [0.0; 2],
        lines: [0; 2],
    };

    /// Starts anew, as the part of the buffer between the given limits in pixels.
    #[inline(always)]
    pub(crate) fn begin(&mut self, columns: [f64; 2], lines: [f64; 2], floor: f64, ceiling: f64) {
        self.lefts = 0;
        self.rights = 0;
        self.plane_count = 0;
        self.columns = columns.map(|x| x as f32);
        // Casts saturate; NaN becomes zero.
        self.lines = lines.map(|y| y as usize);
        self.floor = down(floor);
        self.ceiling = up(ceiling);
    }

    /// As [`begin`](Self::begin), with what has been found before.
    #[inline(always)]
    pub(crate) fn begin_within(&mut self, extent: &ScreenExtent) {
        (self.lefts, self.rights, self.plane_count) = (0, 0, 0);
        (self.columns, self.lines) = (extent.columns.map(|x| x as f32), extent.lines);
        [self.floor, self.ceiling] = extent.depth_key;
    }

    /// Keeps only pixels where `a x + b y + c >= 0`, in pixel coordinates. False if there is no room for one more.
    ///
    /// Dividing by `a` gives the bound `x >= s y + t` on the points of a row, where `s = -b / a` and `t = -c / a`; the row's worst
    /// point is at
    /// its top or bottom. In `f32`, `s`, `t`, the product and the sum are each rounded once, so the result is off by at most `4u (|s| H
    /// + |t|)` or so; the
    /// offset is moved by `8u` of that, and by another `16u (W + 2)` for what rounding to whole pixels adds.
    #[inline(always)]
    pub(crate) fn add_edge(&mut self, [a, b, c]: [f64; 3], size: [f64; 2], coverage: Coverage) -> bool {
        if a == 0.0 {
            // A level edge bounds rows instead.
            let (mut first, mut end) = (self.lines[0] as f64, self.lines[1] as f64);
            let y = -c / b;
            let half = if coverage == Coverage::Sampled { 0.5 } else { 0.0 };
            if b > 0.0 {
                let y = y * (1.0 + 8.0 * f64::EPSILON.copysign(y));
                first = first.max((y - half).ceil_());
            } else if b < 0.0 {
                let y = y * (1.0 - 8.0 * f64::EPSILON.copysign(y));
                end = end.min((y + half).floor_());
            } else if !(c >= 0.0) {
                end = 0.0;
            }
            self.lines = [first as usize, end as usize];
            return true;
        }
        let over = -1.0 / a;
        let (s, t) = (b * over, c * over);
        let slack =
            F32 * (s.abs() * size[1] + t.abs()) + 2.0 * F32 * (size[0] + 2.0) + f64::from(f32::MIN_POSITIVE);
        if a > 0.0 {
            if self.lefts == MAX_EDGES {
                return false;
            }
            let worst = if coverage == Coverage::Sampled { 0.5 * s - 0.5 } else { s.max(0.0) };
            self.left[self.lefts] = RowBound::new(s, t + worst + slack, f32::INFINITY);
            self.lefts += 1;
        } else {
            if self.rights == MAX_EDGES {
                return false;
            }
            // NaN ends here too.
            let worst = if coverage == Coverage::Sampled { 0.5 * s + 0.5 } else { s.min(0.0) };
            self.right[self.rights] = RowBound::new(s, t + worst - slack, f32::NEG_INFINITY);
            self.rights += 1;
        }
        true
    }

    /// Bounds depth key from below by a plane `a x + b y + c` in pixel coordinates, already moved by the error of its coefficients. False if
    /// there is no room for one more.
    #[inline(always)]
    pub(crate) fn add_depth_plane(&mut self, [a, b, c]: [f64; 3], size: [f64; 2]) -> bool {
        if self.plane_count == MAX_PLANES {
            return false;
        }
        self.planes[self.plane_count] = tile_minimum_plane([a, b, c], size);
        self.plane_count += 1;
        true
    }
}

/// The least depth key in a tile as a function of its column and row, of a plane `a x + b y + c` in pixel coordinates.
///
/// In `f32`, three coefficients, two products and two sums are rounded: `4u` of the magnitudes' sum at most, and `8u` are taken off.
#[inline(always)]
fn tile_minimum_plane([a, b, c]: [f64; 3], size: [f64; 2]) -> [f32; 3] {
    let side = SIDE as f64;
    let worst = c + side * (a.min(0.0) + b.min(0.0));
    let slack = F32 * (a.abs() * (size[0] + side) + b.abs() * (size[1] + side) + c.abs())
        + f64::from(f32::MIN_POSITIVE);
    [(a * side) as f32, (b * side) as f32, (worst - slack) as f32]
}

/// What became of an occluder.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum ShapeResult {
    /// The shape is to be filled.
    Ready,
    /// Nothing of it can be seen, or nothing can be said for certain.
    Nothing,
    /// It is too near for this way.
    TooNear,
}
