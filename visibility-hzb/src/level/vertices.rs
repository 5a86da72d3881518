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
    /// Whether each vertex is plain: in the guard band around the picture and beyond the distance and the
    /// clip coordinate `w` at which outlines are cut, with an error of at most [`MAX_ERROR_PX`].
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
        let (least_near, cut_w, guard) = (up(frame.least_near), up(frame.least_w), frame.guard as f32);
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
                    & (w[i] > cut_w)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coverage::Coverage;
    use crate::level::PreparedLevel;
    use alloc::sync::Arc;
    use visibility_core::glam::{DMat4, DVec3, DVec4};
    use visibility_core::{View, view::Depth};
    use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle};

    /// Outlines are cut at `least_w` beside the near plane. No plain vertex, which no cut affects, is on the
    /// side that is cut away, also if the near plane is oblique and passes close to the eye.
    #[test]
    fn plain_vertices_are_beyond_all_cuts() {
        let corners = [Vec3::ZERO, Vec3::new(1e6, 1e6, 0.0), Vec3::new(1e6, 0.0, 1e6)];
        let triangles = [LevelTriangle { corners, two_sided: true }];
        let level = LevelOccluders::new(&triangles, LevelSettings::default()).unwrap();
        let level = PreparedLevel::new(Arc::new(level), DVec3::ZERO);
        // The eye looks along x. The near plane lies beside the eye: y = 1e-9.
        let rows =
            [[0.0, -0.3, 0.0, 0.0], [0.0, 0.0, 0.3, 0.0], [0.0, 1.0, 0.0, -1e-9], [1.0, 0.0, 0.0, 0.0]];
        let [x, y, z, w] = rows.map(DVec4::from_array);
        let matrix = DMat4::from_cols(x, y, z, w).transpose();
        let view = View::from_clip_from_world(matrix, Depth::ZeroToOne).unwrap();
        let size = [640, 360];
        let frame = LevelFrame::new(&view, &level, size, size, Coverage::Conservative, 16.0).unwrap();
        let mut vertices = Vertices::default();
        let mut plain = 0;
        for i in 0..2_000 {
            let w = frame.least_w * 1.01f64.powi(i - 1_000);
            let positions = [0.0, 1.0, 3.0, 10.0].map(|beside| DVec3::new(w, beside * w, 0.0).as_vec3());
            vertices.project(&positions, &frame);
            for at in (0..positions.len()).filter(|&at| vertices.plain[at]) {
                let (w, least_w) = (vertices.w[0][at], frame.least_w);
                assert!(f64::from(w) > least_w, "{}: w is {w}, cut at {least_w}", positions[at]);
                plain += 1;
            }
        }
        assert!(plain > 1_000, "{plain} vertices are plain");
    }

    /// The error of a cluster is the greatest of its vertices, in whatever lane, and its `w` the least.
    #[test]
    fn a_cluster_has_the_error_of_its_worst_vertex() {
        let frame = crate::level::outline_rule::frame();
        let mut positions: Vec<Vec3> = (0..40)
            .map(|i| Vec3::new(3.0 + 0.2 * i as f32, 0.05 * i as f32 - 1.0, 0.01 * i as f32))
            .collect();
        let mut vertices = Vertices::default();
        let own: Vec<(f32, f32)> = positions
            .iter()
            .map(|&position| {
                vertices.project(&[position], &frame);
                assert!(vertices.plain[0], "{position} is plain");
                (vertices.error, vertices.least_w)
            })
            .collect();
        let (error, w) = own
            .iter()
            .fold((0.0, f32::INFINITY), |(error, w): (f32, f32), own| (error.max(own.0), w.min(own.1)));
        let differ = own.iter().filter(|own| own.0 < error).count();
        assert!(differ > 20, "{differ} vertices have less than the greatest error");
        for turn in 0..40 {
            positions.rotate_left(1);
            vertices.project(&positions, &frame);
            assert_eq!((vertices.error, vertices.least_w), (error, w), "error and w after turn {turn}");
        }
    }
}
