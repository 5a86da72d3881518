//! Sampling: rays that find visible objects before the search for proofs.
//!
//! Uniform rays leave the viewcell from random points of its faces in random directions. Aimed rays go from
//! random viewpoints to random points of one object.

use crate::sight::CellBox;
use visibility_core::glam::DVec3;
use visibility_core::random::Random;

/// Returns a random unit vector, uniformly distributed over all directions.
fn direction(random: &mut Random) -> DVec3 {
    loop {
        let v = random.point() * 2.0 - 1.0;
        let square = v.length_squared();
        if square > 0.01 && square <= 1.0 {
            return v.normalize();
        }
    }
}

/// Returns a random point on the surface of the cube from -1 to 1 on each axis.
pub(crate) fn on_cube(random: &mut Random) -> DVec3 {
    let mut x = random.point() * 2.0 - 1.0;
    let side = random.below(6);
    x[side / 2] = if side % 2 == 1 { 1.0 } else { -1.0 };
    x
}

/// Returns a random point of a triangle, uniformly distributed by area.
pub(crate) fn in_triangle(random: &mut Random, t: &[DVec3; 3]) -> DVec3 {
    let (a, b) = (random.unit(), random.unit());
    let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
    t[0] + (t[1] - t[0]) * a + (t[2] - t[0]) * b
}

impl CellBox {
    /// Returns a random point on a face of the box, and a random direction out of the box. Faces are chosen
    /// by area.
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
        let mut p = (self.min + size * random.point()).clamp(self.min, self.max);
        p[axis] = if is_upper { self.max[axis] } else { self.min[axis] };
        let mut d = direction(random);
        if (d[axis] > 0.0) != is_upper {
            d = -d;
        }
        (p, d)
    }

    /// Returns the point at which the segment from a random point of the box to q leaves the box.
    pub(crate) fn towards(&self, q: DVec3, random: &mut Random) -> DVec3 {
        let p = self.min + (self.max - self.min) * random.point();
        self.exit(p, q)
    }

    /// Returns the point at which the segment from p, in the box, to q leaves the box. Rounding never puts
    /// the point outside of the box.
    pub(crate) fn exit(&self, p: DVec3, q: DVec3) -> DVec3 {
        let d = q - p;
        let wall = DVec3::select(d.cmpgt(DVec3::ZERO), self.max, self.min);
        let times = DVec3::select(d.cmpeq(DVec3::ZERO), DVec3::ONE, (wall - p) / d);
        (p + d * times.min_element().clamp(0.0, 1.0)).clamp(self.min, self.max)
    }
}
