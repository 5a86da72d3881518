//! The vertices of a cluster on the screen, in `f32`.

use super::frame::{LevelFrame, MAX_ERROR_PX};
use crate::lanes::{WIDTH, greatest, least};
use crate::query::box_projection::ScreenPoints;
use crate::rounding::up;
use alloc::vec::Vec;
use visibility_core::glam::Vec3;

/// Vertices of one cluster on the screen.
#[derive(Clone, Debug, Default)]
pub(super) struct Vertices {
    /// Columns and rows of the vertices in the picture, in pixels.
    pub(super) places: [Vec<f32>; 2],
    /// Whether each vertex is plain: in the guard band around the picture and beyond the distance at which
    /// outlines are cut, with an error of at most [`MAX_ERROR_PX`].
    pub(super) plain: Vec<bool>,
    /// Lower bounds on the clip coordinate `w` of the vertices, then upper bounds. Valid for plain vertices
    /// only.
    pub(super) w: [Vec<f32>; 2],
    /// Upper bound on the error of plain vertices in pixels.
    pub(super) error: f32,
    /// Lower bound on the `w` of plain vertices.
    pub(super) least_w: f32,
}

impl Vertices {
    /// Projects the vertices of a cluster.
    #[inline(always)]
    pub(super) fn project(&mut self, positions: &[Vec3], frame: &LevelFrame) {
        self.places.iter_mut().chain(&mut self.w).for_each(Vec::clear);
        self.plain.clear();
        let (least_near, guard) = (up(frame.least_near), frame.guard as f32);
        let (mut most_error, mut least_w) = ([0.0; WIDTH], [f32::INFINITY; WIDTH]);
        let mut rest = positions;
        while !rest.is_empty() {
            let count = rest.len().min(WIDTH);
            let mut p = [[0.0; WIDTH]; 3];
            for i in 0..WIDTH {
                // The remaining lanes repeat the last vertex.
                let position = &rest[if i < count { i } else { count - 1 }];
                (p[0][i], p[1][i], p[2][i]) = (position.x, position.y, position.z);
            }
            rest = &rest[count..];
            let ScreenPoints { x, y, w, most_w, error, near } = frame.projection32.points(&p);
            let mut plain = [false; WIDTH];
            for i in 0..WIDTH {
                plain[i] = (error[i] <= MAX_ERROR_PX)
                    & (near[i] > least_near)
                    & (greatest(x[i].abs(), y[i].abs()) <= guard);
                most_error[i] = if plain[i] { greatest(error[i], most_error[i]) } else { most_error[i] };
                least_w[i] = if plain[i] { least(w[i], least_w[i]) } else { least_w[i] };
            }
            for (all, lanes) in self.places.iter_mut().chain(&mut self.w).zip([x, y, w, most_w]) {
                all.extend_from_slice(&lanes);
            }
            self.plain.extend_from_slice(&plain);
        }
        (self.error, self.least_w) = (0.0, f32::INFINITY);
        for i in 0..WIDTH {
            self.error = greatest(most_error[i], self.error);
            self.least_w = least(least_w[i], self.least_w);
        }
    }
}
