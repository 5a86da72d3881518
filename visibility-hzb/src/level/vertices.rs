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
    /// Columns, rows and whether each vertex is plain, [`WIDTH`] at a time. Plain vertices lie in the guard
    /// band and beyond the distance at which outlines are cut, with an error of at most [`MAX_ERROR_PX`].
    points: Vec<([f32; WIDTH], [f32; WIDTH], [bool; WIDTH])>,
    /// Lower and upper bounds on the `w` of plain vertices.
    w: Vec<([f32; WIDTH], [f32; WIDTH])>,
    /// Upper bound on the error of plain vertices in pixels.
    pub(super) error: f32,
    /// Lower bound on the `w` of plain vertices.
    pub(super) least_w: f32,
}

impl Vertices {
    /// Projects the vertices of a cluster.
    #[inline(always)]
    pub(super) fn project(&mut self, positions: &[Vec3], frame: &LevelFrame) {
        self.points.clear();
        self.w.clear();
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
            self.points.push((x, y, plain));
            self.w.push((w, most_w));
        }
        (self.error, self.least_w) = (0.0, f32::INFINITY);
        for i in 0..WIDTH {
            self.error = greatest(most_error[i], self.error);
            self.least_w = least(least_w[i], self.least_w);
        }
    }

    /// Returns a lower and an upper bound on the `w` of a plain vertex.
    #[inline(always)]
    pub(super) fn w(&self, vertex: usize) -> [f32; 2] {
        let (least, most) = &self.w[vertex / WIDTH];
        [least[vertex % WIDTH], most[vertex % WIDTH]]
    }

    /// Returns the column and row of a vertex, if it is plain.
    #[inline(always)]
    pub(super) fn get(&self, vertex: usize) -> Option<[f32; 2]> {
        let (x, y, plain) = self.points.get(vertex / WIDTH)?;
        let lane = vertex % WIDTH;
        plain[lane].then_some([x[lane], y[lane]])
    }
}
