//! Order along a space-filling curve, so that neighbours in memory are neighbours in space (Morton, "A Computer Oriented
//! Geodetic Data Base and a New Technique in File Sequencing", 1966).

use crate::Aabb;
use glam::{DVec3, Vec3};

/// Maps points to their place on the Morton curve through a cube.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Curve {
    corner: DVec3,
    scale: f64,
}

impl Curve {
    /// Cells per side of the cube: 21 bits an axis fill 63 bits of the key.
    const CELLS: f64 = (1u64 << 21) as f64;

    /// A curve through the least cube that holds `bounds`. One scale for all axes keeps its pieces cubes too.
    pub(crate) fn through(bounds: &Aabb) -> Self {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let side = (max - min).max_element();
        Self { corner: min, scale: if side > 0.0 { Self::CELLS / side } else { 0.0 } }
    }

    /// The place of a point. Points outside are moved to the boundary, NaN to the start.
    pub(crate) fn place(&self, p: Vec3) -> u64 {
        let cell = (p.as_dvec3() - self.corner) * self.scale;
        // A cast from float saturates, and turns NaN to zero.
        let axis = |x: f64| spread((x as u64).min((1 << 21) - 1));
        axis(cell.x) | axis(cell.y) << 1 | axis(cell.z) << 2
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
        let curve = Curve::through(&Aabb::from_arrays([0.0; 3], [2.0; 3]));
        let place = |x: f32, y: f32, z: f32| curve.place(Vec3::new(x, y, z)) >> 60;
        assert_eq!([place(0.5, 0.5, 0.5), place(1.5, 0.5, 0.5), place(0.5, 1.5, 0.5)], [0, 1, 2]);
        assert_eq!([place(1.5, 1.5, 1.5), place(9.0, 9.0, 9.0), place(f32::NAN, 1.5, -3.0)], [7, 7, 2]);
        let (a, b) = (curve.place(Vec3::splat(1.0)), curve.place(Vec3::splat(1.0 + 2.0 / 2097152.0)));
        assert_eq!((a, b - a), (7 << 60, 7), "the finest cell is a step of one on each axis");
    }
}
