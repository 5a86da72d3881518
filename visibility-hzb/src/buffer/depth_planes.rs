//! What is kept of an occluder beside its coverage: the planes of its faces, which bound its depth key in any pixel.

use super::tile_layout::SIDE;
use crate::query::box_face_planes::{BoxFacePlanes, LANES};
use crate::setup::screen_shape::ScreenShape;

/// What bounds the depth key of a shape from below: the least of up to three planes, where that is greater than the floor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DepthPlanes {
    /// Slopes along columns and rows, and the value at the upper left corner of the buffer.
    planes: [[f32; 3]; 3],
    count: usize,
}

impl DepthPlanes {
    pub(crate) const NONE: Self = Self { planes: [[0.0; 3]; 3], count: 0 };

    /// Of the planes of a shape; none if there are too many.
    #[inline(always)]
    pub(crate) fn of(shape: &ScreenShape) -> Self {
        let [p, q, r, ..] = shape.planes;
        // All three whatever their number: a copy of known length.
        Self { planes: [p, q, r], count: if shape.plane_count <= 3 { shape.plane_count } else { 0 } }
    }

    /// The least depth key within a rectangle; [`EMPTY_DEPTH`] if this is no surface.
    ///
    /// In `f64`, where what this rounds is far below what the planes were lowered by ([`ScreenShape::bound`](crate::shape::Shape::bound)).
    #[inline(always)]
    pub(crate) fn least(&self, [left, right, top, bottom]: [f64; 4]) -> f64 {
        const SHARE: f64 = 1.0 / SIDE as f64;
        let mut least = if self.count > 0 { f64::INFINITY } else { f64::NEG_INFINITY };
        for &[a, b, c] in &self.planes[..self.count] {
            let [a, b, c] = [f64::from(a), f64::from(b), f64::from(c)];
            // The value in a tile is that of its farthest corner: where the plane falls to the right, its right border.
            let x = if a < 0.0 { right * SHARE - 1.0 } else { left * SHARE };
            let y = if b < 0.0 { bottom * SHARE - 1.0 } else { top * SHARE };
            let value = a * x + b * y + c;
            // A NaN is the least of all.
            least = if value >= least { least } else { value };
        }
        least
    }

    /// Whether within a rectangle it is before all of one and the same side of a box. As in [`least`](Self::least), what is rounded is far below
    /// what either was moved by.
    #[inline(always)]
    pub(crate) fn is_before(&self, sides: [f64; 4], box_planes: &BoxFacePlanes) -> bool {
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

    /// Whether all within a rectangle is nearer. A NaN hides nothing.
    #[inline(always)]
    pub(crate) fn hides(&self, sides: [f64; 4], depth_key: f32) -> bool {
        self.least(sides) > f64::from(depth_key)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_are_no_nearer_than_their_planes_and_hardly_farther() {
        for (a, b) in [(0.01, 0.02), (-0.01, 0.02), (0.01, -0.02), (-0.01, -0.02)] {
            let plane = [a, b, 5.0];
            let mut shape = ScreenShape::EMPTY;
            assert!(shape.add_depth_plane(plane, [64.0, 64.0]));
            let planes_id = DepthPlanes::of(&shape);
            for (left, top, size) in [(8.0, 16.0, 8.0), (11.0, 19.0, 1.0), (40.0, 50.0, 3.0), (0.0, 0.0, 1.0)]
            {
                let sides = [left, left + size, top, top + size];
                let at = |x: f64, y: f64| a * x + b * y + 5.0;
                let corners =
                    [at(left, top), at(left + size, top), at(left, top + size), at(left + size, top + size)];
                let least = corners.into_iter().fold(f64::INFINITY, f64::min);
                assert!(!planes_id.hides(sides, least as f32), "{a} {b} {sides:?}");
                assert!(planes_id.hides(sides, (least - 1e-4) as f32), "{a} {b} {sides:?}");
            }
        }
        assert!(!DepthPlanes::NONE.hides([0.0, 1.0, 0.0, 1.0], f32::NEG_INFINITY));
    }
}
