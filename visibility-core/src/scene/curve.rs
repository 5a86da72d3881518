//! Order along a space-filling curve, so that neighbours in memory are neighbours in space (Morton, "A
//! Computer Oriented Geodetic Data Base and a New Technique in File Sequencing", 1966).

use crate::Aabb;
use glam::{DVec3, Vec3};

/// Maps points to their place on the Morton curve through a cube.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Curve {
    corner: DVec3,
    scale: f64,
}

impl Curve {
    /// Cells per side of the cube: 21 bits an axis fill 63 bits of a place, the highest one of the word.
    const CELLS: f64 = (1u64 << 21) as f64;
    /// So many points tell where most of them lie.
    const SAMPLE: usize = 4096;

    /// A curve through a cube around most of the points. A few that are far from the rest (a sky, a mistake)
    /// are left outside, or all others would share a few cells. One scale for all axes keeps the pieces
    /// of the curve cubes too.
    pub(crate) fn through(points: impl Iterator<Item = Vec3> + Clone, count: usize) -> Self {
        let sample = || points.clone().step_by((count / Self::SAMPLE).max(1));
        let taken = sample().count().max(1) as f64;
        let mean = sample().map(|p| p.as_dvec3() / taken).sum::<DVec3>();
        // Evenly spread points deviate by a quarter of their extent on average: four times that is ample on
        // each side.
        let reach = sample().map(|p| (p.as_dvec3() - mean).abs() / taken).sum::<DVec3>() * 4.0;
        let hull = Aabb::from_points(sample());
        let corner = hull.min.as_dvec3().max(mean - reach);
        let side = (hull.max.as_dvec3().min(mean + reach) - corner).max_element();
        Self { corner, scale: if side > 0.0 { Self::CELLS / side } else { 0.0 } }
    }

    /// The place of a point, of which the highest bits matter most. Points outside the cube are moved to its
    /// boundary.
    pub(crate) fn place(&self, p: Vec3) -> u64 {
        let cell = (p.as_dvec3() - self.corner) * self.scale;
        // A cast from float saturates, and turns NaN to zero.
        let axis = |x: f64| spread(u64::from((x as u32).min((1 << 21) - 1)));
        axis(cell.x) << 1 | axis(cell.y) << 2 | axis(cell.z) << 3
    }
}

/// Moves bit `i` of a 21-bit number to bit `3 i`.
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
        let place = |x: f32, y: f32, z: f32| curve.place(Vec3::new(x, y, z)) >> 61;
        assert_eq!([place(0.5, 0.5, 0.5), place(1.5, 0.5, 0.5), place(0.5, 1.5, 0.5)], [0, 1, 2]);
        assert_eq!([place(1.5, 1.5, 1.5), place(9.0, 9.0, 9.0), place(f32::NAN, 1.5, -3.0)], [7, 7, 2]);
        let (a, b) = (curve.place(Vec3::splat(1.0)), curve.place(Vec3::splat(1.0 + 2.0 / 2097152.0)));
        assert_eq!((a, b - a), (7 << 61, 14), "the finest cell is a step of one on each axis");
    }

    #[test]
    fn points_far_from_the_rest_do_not_blunt_the_curve() {
        let near = (0..1000).map(|i| Vec3::splat(i as f32 * 1e-3));
        let curve = Curve::through(near.chain([Vec3::splat(1e30)]), 1001);
        assert!(curve.place(Vec3::splat(1e30)) > curve.place(Vec3::splat(0.9)));
        let curve =
            Curve::through((0..10000).map(|i| Vec3::splat(if i == 7 { 1e6 } else { i as f32 })), 10000);
        assert!(curve.place(Vec3::splat(5000.0)) != curve.place(Vec3::splat(5001.0)));
    }
}
