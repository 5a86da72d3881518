//! The grid that cells lie on: the cube around a scene, cut into 2^10 steps a side, and places in it in Morton's order.

use visibility_core::Aabb;
use visibility_core::glam::{DVec3, Vec3};

/// How often the cube may be halved.
pub(crate) const DEPTH: u32 = 10;

/// Steps along a side of the cube.
pub(crate) const STEPS: u32 = 1 << DEPTH;

/// A cube in scene coordinates, and the step of its grid.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Grid {
    pub(crate) min: DVec3,
    pub(crate) step: f64,
}

impl Grid {
    /// A cube around a box, wider than it by a hundredth on each side, so that nothing lies on its faces.
    pub(crate) fn around(bounds: &Aabb) -> Self {
        if !bounds.is_finite() {
            return Self { min: DVec3::splat(-0.5), step: 1.0 / f64::from(STEPS) };
        }
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        // Where the box is a point far from the origin, no less than what f32 can tell apart there.
        let far = min.abs().max(max.abs()).max_element();
        let side = ((max - min).max_element() * 1.02).max(far * 1e-5).max(1e-30);
        Self { min: (min + max) * 0.5 - DVec3::splat(side * 0.5), step: side / f64::from(STEPS) }
    }

    /// The cell of the grid that a point lies in; what lies outside the cube is put at its faces.
    pub(crate) fn place(&self, point: DVec3) -> [u32; 3] {
        // Casts of NaN and of what is out of range are defined: 0 and the nearest number.
        ((point - self.min) / self.step).to_array().map(|x| (x as u32).min(STEPS - 1))
    }

    /// The corner of the grid with the given coordinates.
    #[inline]
    pub(crate) fn corner(&self, place: [u32; 3]) -> DVec3 {
        self.min + DVec3::from_array(place.map(f64::from)) * self.step
    }

    /// Whether a point lies in the cube.
    pub(crate) fn contains(&self, point: DVec3) -> bool {
        let local = (point - self.min) / self.step;
        local.cmpge(DVec3::ZERO).all() && local.cmplt(DVec3::splat(f64::from(STEPS))).all()
    }

    /// The box of a block of the grid, rounded outwards.
    #[inline]
    pub(crate) fn bounds(&self, place: [u32; 3], side: u32) -> Aabb {
        let (min, max) = (self.corner(place), self.corner(place.map(|x| x + side)));
        Aabb::new(
            Vec3::from_array(min.to_array().map(|x| (x as f32).next_down())),
            Vec3::from_array(max.to_array().map(|x| (x as f32).next_up())),
        )
    }
}

/// Ten bits spread to every third place.
fn spread(x: u32) -> u32 {
    let x = (x | x << 16) & 0x0300_00ff;
    let x = (x | x << 8) & 0x0300_f00f;
    let x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}

fn gather(x: u32) -> u32 {
    let x = x & 0x0924_9249;
    let x = (x | x >> 2) & 0x030c_30c3;
    let x = (x | x >> 4) & 0x0300_f00f;
    let x = (x | x >> 8) & 0x0300_00ff;
    (x | x >> 16) & 0x3ff
}

/// The number of a place in Morton's order: its coordinates' bits in turn.
pub(crate) fn morton(place: [u32; 3]) -> u32 {
    spread(place[0]) | spread(place[1]) << 1 | spread(place[2]) << 2
}

/// The place with a number.
pub(crate) fn place_of(code: u32) -> [u32; 3] {
    [gather(code), gather(code >> 1), gather(code >> 2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_have_numbers() {
        for place in [[0, 0, 0], [1, 2, 3], [1023, 0, 512], [1023; 3], [700, 300, 5]] {
            assert_eq!(place_of(morton(place)), place);
        }
        assert_eq!(morton([1, 0, 0]), 1);
        assert_eq!(morton([0, 1, 1]), 6);
        assert_eq!(morton([1023; 3]), (1 << 30) - 1);
    }

    #[test]
    fn cubes_are_wider_than_what_they_surround() {
        for bounds in [
            Aabb::from_arrays([0.0; 3], [10.0, 4.0, 0.0]),
            Aabb::from_arrays([1e6; 3], [1e6; 3]),
            Aabb::from_arrays([-3e38; 3], [3e38; 3]),
            Aabb::from_arrays([0.0; 3], [0.0; 3]),
        ] {
            let grid = Grid::around(&bounds);
            for corner in bounds.corners() {
                let place = grid.place(corner.as_dvec3());
                assert!(grid.contains(corner.as_dvec3()));
                assert!(place.iter().all(|&x| 0 < x && x < STEPS - 1), "{bounds:?} {place:?}");
                assert!(grid.bounds(place, 1).contains_point(corner), "{bounds:?}");
            }
        }
        assert!(!Grid::around(&Aabb::EMPTY).contains(DVec3::NAN));
    }
}
