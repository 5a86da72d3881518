//! The order of points along a space-filling curve, which makes neighbours in memory neighbours in space
//! (Morton, "A Computer Oriented Geodetic Data Base and a New Technique in File Sequencing", 1966).

use crate::Aabb;
use alloc::vec::Vec;
use glam::{DVec3, Vec3};

/// Maps points to their position on the Morton curve through a cube. Points are in scene coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Curve {
    corner: DVec3,
    scale: f64,
}

impl Curve {
    /// Number of cells per side of the cube: 21 bits per axis, so that the position on the curve has 63 bits.
    const CELLS: f64 = (1u64 << 21) as f64;
    /// Approximate number of points that are sampled to find where most of the points are.
    const SAMPLE: usize = 4096;

    /// Builds a curve through a cube around most of `points`, of which there are `count`. A few points far
    /// from the rest (a sky dome, a mistake) are left outside, because the others would otherwise share a few
    /// cells. All axes have one scale, so pieces of the curve are compact on each. Without points, or with
    /// all in one place, every position on the curve is 0.
    pub(crate) fn through(points: impl Iterator<Item = Vec3> + Clone, count: usize) -> Self {
        let sample = || points.clone().step_by((count / Self::SAMPLE).max(1));
        let taken = sample().count().max(1) as f64;
        let mean = sample().map(|p| p.as_dvec3() / taken).sum::<DVec3>();
        // Evenly spread points deviate from the mean by a quarter of their extent on average; four times that
        // is ample on each side.
        let reach = sample().map(|p| (p.as_dvec3() - mean).abs() / taken).sum::<DVec3>() * 4.0;
        let hull = Aabb::from_points(sample());
        let corner = hull.min.as_dvec3().max(mean - reach);
        let side = (hull.max.as_dvec3().min(mean + reach) - corner).max_element();
        Self { corner, scale: if side > 0.0 { Self::CELLS / side } else { 0.0 } }
    }

    /// Returns the Morton code of a point: its position on the curve. Bits 1 to 63 interleave the 21-bit cell
    /// coordinates of the point, x in the lowest of each three bits, then y, then z; bit 0 is 0. A point
    /// outside the cube counts as the nearest point of the cube, and a NaN coordinate as the least.
    pub(crate) fn code(&self, p: Vec3) -> u64 {
        let cell = (p.as_dvec3() - self.corner) * self.scale;
        // A cast from float to integer saturates, and turns NaN to zero.
        let axis = |x: f64| spread(u64::from((x as u32).min((1 << 21) - 1)));
        axis(cell.x) << 1 | axis(cell.y) << 2 | axis(cell.z) << 3
    }
}

/// Returns the numbers of `points`, which are in metres relative to one origin, in the order of their
/// positions on a Morton curve: neighbours in the result are neighbours in space. Points in one cell of the
/// curve keep their order. There must be fewer than 2^32 points, all finite. Takes `n log n` steps.
///
/// ```
/// use visibility_core::{glam::Vec3, scene::morton_order};
/// assert_eq!(morton_order([Vec3::ONE, Vec3::ZERO, Vec3::X].into_iter()), [1, 2, 0]);
/// ```
pub fn morton_order(points: impl ExactSizeIterator<Item = Vec3> + Clone) -> Vec<u32> {
    let curve = Curve::through(points.clone(), points.len());
    let codes: Vec<u64> = points.map(|p| curve.code(p)).collect();
    let mut order: Vec<u32> = (0..codes.len() as u32).collect();
    order.sort_by_key(|&point| codes[point as usize]);
    order
}

/// Moves bit i of a 21-bit number to bit 3i, leaving zeros between.
fn spread(x: u64) -> u64 {
    let x = (x | x << 32) & 0x001f_0000_0000_ffff;
    let x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    let x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    let x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_visits_octants_in_order() {
        let corners = Aabb::from_arrays([0.0; 3], [2.0; 3]).corners();
        let curve = Curve::through(corners.into_iter(), 8);
        let code = |x: f32, y: f32, z: f32| curve.code(Vec3::new(x, y, z)) >> 61;
        assert_eq!(
            [code(0.5, 0.5, 0.5), code(1.5, 0.5, 0.5), code(0.5, 1.5, 0.5)],
            [0, 1, 2],
            "octants are numbered along x first, then y"
        );
        assert_eq!(
            [code(1.5, 1.5, 1.5), code(9.0, 9.0, 9.0), code(f32::NAN, 1.5, -3.0)],
            [7, 7, 2],
            "the last octant, a point outside the bounds, and one with a NaN"
        );
        let (a, b) = (curve.code(Vec3::splat(1.0)), curve.code(Vec3::splat(1.0 + 2.0 / 2097152.0)));
        assert_eq!((a, b - a), (7 << 61, 14), "the finest cell is a step of one on each axis");
    }

    #[test]
    fn points_far_from_the_rest_do_not_blunt_the_curve() {
        let near = (0..1000).map(|i| Vec3::splat(i as f32 * 1e-3));
        let curve = Curve::through(near.chain([Vec3::splat(1e30)]), 1001);
        assert!(
            curve.code(Vec3::splat(1e30)) > curve.code(Vec3::splat(0.9)),
            "the point at 1e30 comes after the others"
        );
        let curve =
            Curve::through((0..10000).map(|i| Vec3::splat(if i == 7 { 1e6 } else { i as f32 })), 10000);
        assert!(
            curve.code(Vec3::splat(5000.0)) != curve.code(Vec3::splat(5001.0)),
            "points 1 m apart keep codes of their own beside one at 1000 km"
        );
    }
}
