//! Depth planes of an occluder: the planes of its faces as linear functions on the screen. They bound the
//! occluder's depth key in a pixel from below, more tightly than one number for the whole tile.

use super::tile_layout::SIDE;
use crate::query::box_face_planes::{BoxFacePlanes, LANES};
use crate::setup::screen_shape::ScreenShape;

/// Up to three depth planes of one occluder. Wherever the occluder covers a pixel, the occluder's depth key
/// (greater is nearer) is at least the least value of these planes at the pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DepthPlanes {
    /// Coefficients `[a, b, c]` of each plane: `a * column + b * row + c` is the least depth key of the
    /// plane in the tile at tile column `column` and tile row `row` (see [`ScreenShape::planes`]). The
    /// first `count` planes are in use.
    planes: [[f32; 3]; 3],
    /// Number of depth planes in use, 0 to 3; later elements of `planes` are stale. With 0 planes the
    /// occluder's depth key is not bounded.
    count: usize,
}

impl DepthPlanes {
    /// No planes: the depth key is bounded by negative infinity, so these planes hide no box.
    pub(crate) const NONE: Self = Self { planes: [[0.0; 3]; 3], count: 0 };

    /// Returns the planes of an occluder that a single plane bounds, with coefficients as in
    /// [`ScreenShape::planes`].
    #[inline(always)]
    pub(crate) fn one(plane: [f32; 3]) -> Self {
        Self { planes: [plane; 3], count: 1 }
    }

    /// Returns the planes of an occluder that two planes bound, with coefficients as in
    /// [`ScreenShape::planes`].
    #[inline(always)]
    pub(crate) fn two([p, q]: [[f32; 3]; 2]) -> Self {
        Self { planes: [p, q, q], count: 2 }
    }

    /// Copies the depth planes of `shape`. Returns no planes if the shape has more than three.
    #[inline(always)]
    pub(crate) fn of(shape: &ScreenShape) -> Self {
        let [p, q, r, ..] = shape.planes;
        // Always copies three planes, whatever their number: a copy of known length is fast.
        Self { planes: [p, q, r], count: if shape.plane_count <= 3 { shape.plane_count } else { 0 } }
    }

    /// Returns the least value of the occluder's depth planes in a rectangle: a lower bound on the occluder's
    /// depth key in that rectangle. The rectangle is given as left, right, top and bottom in pixels of the
    /// buffer. Returns negative infinity if there are no planes.
    ///
    /// Computed in `f64`. Its rounding is far below the amount by which [`ScreenShape::add_depth_plane`] has
    /// lowered the planes.
    #[inline(always)]
    pub(crate) fn least(&self, [left, right, top, bottom]: [f64; 4]) -> f64 {
        const SHARE: f64 = 1.0 / SIDE as f64;
        let mut least = if self.count > 0 { f64::INFINITY } else { f64::NEG_INFINITY };
        for &[a, b, c] in &self.planes[..self.count] {
            let [a, b, c] = [f64::from(a), f64::from(b), f64::from(c)];
            // The constant of a plane is its value at the farthest corner of tile 0. That corner is on the
            // right border of the tile if the plane falls to the right, and on the lower border if it falls
            // downwards.
            let x = if a < 0.0 { right * SHARE - 1.0 } else { left * SHARE };
            let y = if b < 0.0 { bottom * SHARE - 1.0 } else { top * SHARE };
            let value = a * x + b * y + c;
            least = if value < least { value } else { least };
        }
        least
    }

    /// Returns whether the occluder is strictly nearer than a box in a rectangle (left, right, top, bottom in
    /// pixels of the buffer). That is so if the plane of some face of the box (`box_planes`) bounds the box's
    /// depth key from above, and is below all depth planes of the occluder in the whole rectangle. False if
    /// the occluder has no depth planes. Rounding is far below the amounts by which the occluder's planes
    /// were lowered and the box's planes raised.
    #[inline(always)]
    pub(crate) fn is_nearer_than(&self, sides: [f64; 4], box_planes: &BoxFacePlanes) -> bool {
        const SHARE: f64 = 1.0 / SIDE as f64;
        let mut before = [self.count > 0; LANES];
        for &[a, b, c] in &self.planes[..self.count] {
            let [a, b, c] = [f64::from(a), f64::from(b), f64::from(c)];
            let lowest = if a < 0.0 { a } else { 0.0 } + if b < 0.0 { b } else { 0.0 };
            let below = box_planes.below([a * SHARE, b * SHARE, c - lowest], sides);
            for i in 0..LANES {
                before[i] &= below[i];
            }
        }
        let mut any = false;
        for one in before {
            any |= one;
        }
        any
    }

    /// Returns whether [`least`](Self::least) in a rectangle (left, right, top, bottom in pixels of the
    /// buffer) is strictly greater than `depth_key`. False if there are no planes, if the values are equal or
    /// if one is NaN.
    #[inline(always)]
    pub(crate) fn hides(&self, sides: [f64; 4], depth_key: f32) -> bool {
        self.least(sides) > f64::from(depth_key)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn least_values_are_below_the_planes_by_little() {
        for (a, b) in [(0.01, 0.02), (-0.01, 0.02), (0.01, -0.02), (-0.01, -0.02)] {
            let plane = [a, b, 5.0];
            let mut shape = ScreenShape::default();
            assert!(shape.add_depth_plane(plane, [64.0, 64.0]), "the plane {plane:?} is kept");
            let depth_planes = DepthPlanes::of(&shape);
            for (left, top, size) in [(8.0, 16.0, 8.0), (11.0, 19.0, 1.0), (40.0, 50.0, 3.0), (0.0, 0.0, 1.0)]
            {
                let sides = [left, left + size, top, top + size];
                let at = |x: f64, y: f64| a * x + b * y + 5.0;
                let corners =
                    [at(left, top), at(left + size, top), at(left, top + size), at(left + size, top + size)];
                let least = corners.into_iter().fold(f64::INFINITY, f64::min);
                assert!(!depth_planes.hides(sides, least as f32), "{a} {b} {sides:?}");
                assert!(depth_planes.hides(sides, (least - 1e-4) as f32), "{a} {b} {sides:?}");
            }
        }
        assert!(!DepthPlanes::NONE.hides([0.0, 1.0, 0.0, 1.0], f32::NEG_INFINITY), "no planes hide nothing");
    }
}
