//! Range of a camera: its distance from surfaces, and its height above the ground.

use visibility_core::glam::DVec3;

/// Range of a camera's positions, for [`Grid::free`](crate::Grid::free) and
/// [`Grid::above`](crate::Grid::above).
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CameraRange {
    /// Least distance in metres that the camera keeps from every solid surface.
    pub radius: f64,
    /// Least and greatest height in metres of the camera above a surface that is less steep than 60 degrees,
    /// on the vertical line through the camera. `None` for a camera that flies.
    pub heights: Option<[f64; 2]>,
    /// Direction that points up, of any length. The nearest coordinate axis is used.
    pub up: DVec3,
}

impl Default for CameraRange {
    /// The range of a walking person: 0.25 m from every surface, 1 to 3 m above the ground, with z up.
    fn default() -> Self {
        Self { radius: 0.25, heights: Some([1.0, 3.0]), up: DVec3::Z }
    }
}

impl CameraRange {
    /// Returns the axis (0 to 2) closest to the direction [`up`](Self::up), whether it points up or down. Of
    /// equally close axes, z comes before x, and x before y.
    pub(super) fn up_axis(&self) -> usize {
        let up = self.up.abs();
        (0..2).fold(2, |most, axis| if up[axis] > up[most] { axis } else { most })
    }

    /// Returns the least and greatest coordinate of the camera on the [up axis](Self::up_axis), in metres
    /// relative to the surface below it. `None` for a camera that flies.
    pub(super) fn offsets(&self) -> Option<[f64; 2]> {
        let is_downwards = self.up[self.up_axis()] < 0.0;
        self.heights.map(|[low, high]| if is_downwards { [-high, -low] } else { [low, high] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_axis_is_up_and_heights_are_turned_with_it() {
        let range = |up: [f64; 3]| CameraRange { up: DVec3::from_array(up), ..CameraRange::default() };
        for (up, axis, is_down) in [
            ([0.0, 0.0, 1.0], 2, false),
            ([1.0, 1.0, 1.0], 2, false),
            ([2.0, -2.0, 1.0], 0, false),
            ([-2.0, 2.0, 1.0], 0, true),
            ([0.5, -2.0, 1.0], 1, true),
            ([0.0; 3], 2, false),
        ] {
            assert_eq!(range(up).up_axis(), axis, "axis of {up:?}");
            let expected = if is_down { [-3.0, -1.0] } else { [1.0, 3.0] };
            assert_eq!(range(up).offsets(), Some(expected), "heights along {up:?}");
        }
    }
}
