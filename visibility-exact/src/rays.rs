//! Sampling: rays that find visible objects before anything is proven.
//!
//! Uniform rays leave the viewcell from random points of its faces in random directions. Aimed rays run from
//! random viewpoints to random points of one object.

use crate::sight::CellBox;
use visibility_core::glam::DVec3;

/// Pseudorandom numbers: SplitMix64 (Steele, Lea and Flood, "Fast Splittable Pseudorandom Number Generators",
/// 2014).
#[derive(Clone, Debug)]
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// Returns a number from 0 to 1, exclusive.
    pub(crate) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns an index below `limit`, which must not be 0.
    pub(crate) fn below(&mut self, limit: usize) -> usize {
        (self.bits() % limit as u64) as usize
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit())
    }

    /// Returns a unit vector of uniform direction.
    pub(crate) fn direction(&mut self) -> DVec3 {
        loop {
            let v = self.vector() * 2.0 - 1.0;
            let square = v.length_squared();
            if square > 0.01 && square <= 1.0 {
                return v.normalize();
            }
        }
    }

    /// Returns a point on the cube from -1 to 1.
    pub(crate) fn on_cube(&mut self) -> DVec3 {
        let mut x = self.vector() * 2.0 - 1.0;
        let side = self.below(6);
        x[side / 2] = if side % 2 == 1 { 1.0 } else { -1.0 };
        x
    }

    /// Returns a point of a triangle, uniform by area.
    pub(crate) fn in_triangle(&mut self, t: &[DVec3; 3]) -> DVec3 {
        let (a, b) = (self.unit(), self.unit());
        let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
        t[0] + (t[1] - t[0]) * a + (t[2] - t[0]) * b
    }
}

impl CellBox {
    /// Returns a random point on a face of the box, faces chosen by area, and a random direction outwards.
    pub(crate) fn uniform_ray(&self, random: &mut Random) -> (DVec3, DVec3) {
        let size = self.max - self.min;
        let areas = DVec3::new(size.y * size.z, size.z * size.x, size.x * size.y);
        let mut left = random.unit() * areas.element_sum();
        let mut axis = 2;
        for k in 0..2 {
            if left < areas[k] {
                axis = k;
                break;
            }
            left -= areas[k];
        }
        let is_upper = random.bits() & 1 == 1;
        let mut p = (self.min + size * random.vector()).clamp(self.min, self.max);
        p[axis] = if is_upper { self.max[axis] } else { self.min[axis] };
        let mut d = random.direction();
        if (d[axis] > 0.0) != is_upper {
            d = -d;
        }
        (p, d)
    }

    /// Returns where a segment from a random point of the box to a point q leaves the box.
    pub(crate) fn towards(&self, q: DVec3, random: &mut Random) -> DVec3 {
        let p = self.min + (self.max - self.min) * random.vector();
        self.exit(p, q)
    }

    /// Returns where the segment from a point p of the box to q leaves the box, in the box.
    pub(crate) fn exit(&self, p: DVec3, q: DVec3) -> DVec3 {
        let d = q - p;
        let wall = DVec3::select(d.cmpgt(DVec3::ZERO), self.max, self.min);
        let times = DVec3::select(d.cmpeq(DVec3::ZERO), DVec3::ONE, (wall - p) / d);
        (p + d * times.min_element().clamp(0.0, 1.0)).clamp(self.min, self.max)
    }
}
