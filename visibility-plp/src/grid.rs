//! The grid of the octree: a cube around the scene, divided into 2^10 steps per side, and Morton codes of its
//! voxels.
//!
//! A voxel is a cube of one step. Its index is three integers, the steps from the grid's minimum corner along
//! x, y and z, 0 to 1023 each.

use visibility_core::Aabb;
use visibility_core::glam::DVec3;

/// Number of times that the grid's side can be halved down to one step.
pub(crate) const DEPTH: u32 = 10;

/// Number of steps along each side of the grid.
pub(crate) const STEPS: u32 = 1 << DEPTH;

/// Cube in scene-relative coordinates (metres, relative to `Scene::origin`), divided into [`STEPS`] steps per
/// side.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Grid {
    /// Minimum corner of the cube, relative to the scene's origin, in metres.
    pub(crate) min: DVec3,
    /// Length of one step, the side of a voxel, in metres.
    pub(crate) step: f64,
}

impl Grid {
    /// Returns a grid around a box. The grid's cube extends beyond the box in each direction by at least a
    /// hundredth of the box's longest side, so that no corner of the box lies in a face of the cube. The unit
    /// cube centred at the origin for a box that is empty, infinite or NaN.
    pub(crate) fn around(bounds: &Aabb) -> Self {
        if !bounds.is_finite() {
            return Self { min: DVec3::splat(-0.5), step: 1.0 / f64::from(STEPS) };
        }
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        // For a box that is a point far from the origin, the side is no less than the spacing of f32 there.
        let far = min.abs().max(max.abs()).max_element();
        let side = ((max - min).max_element() * 1.02).max(far * 1e-5).max(1e-30);
        Self { min: (min + max) * 0.5 - DVec3::splat(side * 0.5), step: side / f64::from(STEPS) }
    }

    /// Returns the indices along x, y and z, each 0 to 1023, of the voxel (smallest cube of the grid) that
    /// contains a scene-relative point. A point outside of the grid gives the nearest voxel. A NaN coordinate
    /// gives index 0 on its axis.
    pub(crate) fn voxel(&self, point: DVec3) -> [u32; 3] {
        // Casts of NaN and of numbers out of range are defined: 0 and the nearest number.
        ((point - self.min) / self.step).to_array().map(|x| (x as u32).min(STEPS - 1))
    }

    /// Returns the minimum corner of a voxel in metres, relative to the scene's origin. Indices of [`STEPS`]
    /// give the far faces.
    #[inline]
    pub(crate) fn corner(&self, voxel: [u32; 3]) -> DVec3 {
        self.min + DVec3::from_array(voxel.map(f64::from)) * self.step
    }

    /// Tests whether the grid contains a scene-relative point. Half-open: true on the lower faces, false on
    /// the upper faces and for NaN.
    pub(crate) fn contains(&self, point: DVec3) -> bool {
        let local = (point - self.min) / self.step;
        local.cmpge(DVec3::ZERO).all() && local.cmplt(DVec3::splat(f64::from(STEPS))).all()
    }

    /// Returns the scene-relative box of the cube that is `side` voxels wide and has the minimum corner of
    /// voxel `voxel`, rounded outwards to f32.
    #[inline]
    pub(crate) fn bounds(&self, voxel: [u32; 3], side: u32) -> Aabb {
        Aabb::from_world(self.corner(voxel), self.corner(voxel.map(|x| x + side)), DVec3::ZERO)
    }
}

/// Moves the lowest ten bits of `x` to every third bit position, bit i to bit 3i.
fn spread(x: u32) -> u32 {
    let x = (x | x << 16) & 0x0300_00ff;
    let x = (x | x << 8) & 0x0300_f00f;
    let x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}

/// Inverse of [`spread`]: gathers every third bit into the lowest ten. Ignores all other bits.
fn gather(x: u32) -> u32 {
    let x = x & 0x0924_9249;
    let x = (x | x >> 2) & 0x030c_30c3;
    let x = (x | x >> 4) & 0x0300_f00f;
    let x = (x | x >> 8) & 0x0300_00ff;
    (x | x >> 16) & 0x3ff
}

/// Returns the 30-bit Morton code of a voxel index: the bits of x, y and z interleaved, x lowest. The codes
/// of an aligned cube of 2^n steps per side are consecutive.
pub(crate) fn morton(voxel: [u32; 3]) -> u32 {
    spread(voxel[0]) | spread(voxel[1]) << 1 | spread(voxel[2]) << 2
}

/// Returns the voxel index (x, y, z) of a Morton code: the inverse of [`morton`]. Ignores bits 30 and 31.
pub(crate) fn voxel_of(code: u32) -> [u32; 3] {
    [gather(code), gather(code >> 1), gather(code >> 2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voxels_have_numbers() {
        for voxel in [[0, 0, 0], [1, 2, 3], [1023, 0, 512], [1023; 3], [700, 300, 5]] {
            assert_eq!(voxel_of(morton(voxel)), voxel, "the voxel from its number");
        }
        assert_eq!(morton([1, 0, 0]), 1, "the number of the next voxel along x");
        assert_eq!(morton([0, 1, 1]), 6, "bits of z, y and x in turn");
        assert_eq!(morton([1023; 3]), (1 << 30) - 1, "the last voxel's number");
    }

    /// Points on and next to every face of voxels: the voxel found contains the point, up to an error far
    /// below the margin at which view rays leave a cell (1e-9 of the coordinates).
    #[test]
    fn voxels_hold_the_points_at_their_faces() {
        for bounds in [
            Aabb::from_arrays([0.0; 3], [10.0, 4.0, 0.0]),
            Aabb::from_arrays([-3e4, 1.0, 2.0], [3e4, 1.5, 7.0]),
            Aabb::from_arrays([1e6; 3], [1e6 + 1.0; 3]),
        ] {
            let grid = Grid::around(&bounds);
            let error = 1e-12 * (grid.min.abs().max_element() + grid.step * f64::from(STEPS));
            for (axis, face) in (0..3).flat_map(|axis| (0..=STEPS).map(move |face| (axis, face))) {
                let at = grid.corner([face; 3])[axis];
                for x in [at.next_down(), at, at.next_up(), at + 0.5 * grid.step] {
                    let mut point = grid.corner([7; 3]);
                    point[axis] = x;
                    let voxel = grid.voxel(point);
                    assert!(
                        voxel[axis] == face.min(STEPS - 1) || voxel[axis] + 1 == face,
                        "{face} of {bounds:?}"
                    );
                    if grid.contains(point) {
                        let [low, high] = [voxel, voxel.map(|x| x + 1)].map(|voxel| grid.corner(voxel)[axis]);
                        assert!(low - error <= x && x <= high + error, "{x} in {low} to {high}");
                    } else {
                        assert!(face == 0 || face == STEPS, "{x} of {bounds:?} is in the grid");
                    }
                }
            }
        }
    }

    /// A grid contains its lower faces, not its upper ones, and nothing outside.
    #[test]
    fn grids_contain_their_lower_faces() {
        let grid = Grid { min: DVec3::ZERO, step: 1.0 };
        let most = f64::from(STEPS);
        for axis in 0..3 {
            for (x, expected) in [(-1e-300, false), (0.0, true), (5.0, true), (most.next_down(), true)]
                .into_iter()
                .chain([(most, false), (2.0 * most, false), (f64::NAN, false)])
            {
                let mut point = DVec3::ONE;
                point[axis] = x;
                assert_eq!(grid.contains(point), expected, "{point}");
            }
        }
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
                let voxel = grid.voxel(corner.as_dvec3());
                assert!(grid.contains(corner.as_dvec3()), "{bounds:?}: the cube contains {corner}");
                assert!(voxel.iter().all(|&x| 0 < x && x < STEPS - 1), "{bounds:?} {voxel:?}");
                assert!(grid.bounds(voxel, 1).contains_point(corner), "{bounds:?}");
            }
        }
        assert!(!Grid::around(&Aabb::EMPTY).contains(DVec3::NAN), "NaN is in no cube");
    }
}
