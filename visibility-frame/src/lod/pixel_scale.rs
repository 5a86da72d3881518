//! Size in pixels and distance of an object in a view.

use super::eye_box::{EyeBox, MARGIN};
use super::size_threshold::SizeTest;
use visibility_core::glam::DVec3;
use visibility_core::view::{Eye, View, ViewProjection};
use visibility_core::{Aabb, geometry::sqrt};

/// Unit round-off of `f64`.
const U: f64 = f64::EPSILON / 2.0;

/// The size in pixels and the distance at which a view sees boxes, as the [module](super) defines them.
///
/// ```
/// use visibility_core::{glam::DVec3, Aabb, Pose, View};
/// use visibility_frame::lod::PixelScale;
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let view = View::perspective(pose, 90f64.to_radians(), 1.5, 0.1, f64::INFINITY)?;
/// let scale = PixelScale::new(&view, DVec3::ZERO, 1080.0);
/// // At a distance of ten metres, the 1080 rows of the picture span 20 metres.
/// let pole = Aabb::from_arrays([10.0, 0.0, 0.0], [10.0, 0.0, 2.0]);
/// assert!((scale.diameter(&pole) - 108.0).abs() < 1e-9);
/// assert_eq!(scale.distance(&pole), 10.0);
/// # Ok::<(), visibility_core::view::ViewError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PixelScale {
    eye: EyeBox,
    /// Square of the number of pixels that a metre covers at a distance of one metre (in parallel views, at
    /// any distance). Rounding may make it too small, by less than [`MARGIN`].
    squared: f64,
    /// True for a parallel view, false for a perspective one.
    is_parallel: bool,
}

impl PixelScale {
    /// Makes the scale of a view whose picture is `picture_height` pixels high. Boxes are relative to
    /// `origin`, a point of the world, usually the scene's origin.
    pub fn new(view: &View, origin: DVec3, picture_height: f64) -> Self {
        let projection = ViewProjection::new(view, origin);
        let (y, w) = (projection.y(), projection.w());
        // `y / w` in clip space changes by 2 over the height of the picture.
        let half_height = if picture_height > 0.0 { 0.5 * picture_height } else { f64::NAN };
        let (slope_squared, is_parallel) = match projection.eye() {
            // Slope of `y / w` straight ahead at distance 1: the part of row `y` perpendicular to row `w`,
            // over the length of row `w`. That is the length of their cross product over the squared length
            // of row `w`.
            Eye::Point(_) => (
                cross_above(y.linear, w.linear).length_squared()
                    / (w.linear.length_squared() * w.linear.length_squared()),
                false,
            ),
            Eye::Direction(_) => (y.linear.length_squared() / (w.constant * w.constant), true),
        };
        Self {
            eye: EyeBox::of_view(&projection),
            squared: slope_squared * half_height * half_height,
            is_parallel,
        }
    }

    /// Returns the diameter in pixels of the sphere around a box. Infinite if the eye is in the box;
    /// otherwise NaN if the picture height is NaN, zero or negative.
    pub fn diameter(&self, bounds: &Aabb) -> f64 {
        sqrt(self.diameter_squared(bounds))
    }

    /// Returns the square of [`diameter`](Self::diameter).
    pub(super) fn diameter_squared(&self, bounds: &Aabb) -> f64 {
        let size = bounds.diagonal_squared() * self.squared;
        let gap = if self.is_parallel { 1.0 } else { self.eye.gap_squared(bounds) };
        if gap == 0.0 { f64::INFINITY } else { size / gap }
    }

    /// Returns the distance in metres from the eye to the nearest point of a box, 0 if the eye is in the box
    /// or the view is parallel.
    pub fn distance(&self, bounds: &Aabb) -> f64 {
        self.eye.distance(bounds)
    }

    /// Returns the box that certainly contains the eye, from which distances are measured, relative to the
    /// scene's origin.
    pub(super) fn eye(&self) -> &EyeBox {
        &self.eye
    }

    /// Returns the test for objects of less than `least` pixels. `None` if `least` or the picture height is
    /// NaN, zero or negative: no object is then too small.
    pub(super) fn smaller_than(&self, least: f64) -> Option<SizeTest> {
        let limit = self.squared / (least * least) * (1.0 + MARGIN) + f64::MIN_POSITIVE;
        let test = SizeTest { eye: self.eye, limit, is_parallel: self.is_parallel };
        (least > 0.0 && self.squared > 0.0).then_some(test)
    }
}

/// Returns the magnitudes of the components of the cross product of two rows of a matrix, each rounded up.
/// With `u = 2^-53`, the elements of the rows are off by `3u`, a product of two elements by `7u`, and the
/// difference of two products by `8u` of the sum of the products' magnitudes. The code adds `16u`.
fn cross_above(a: DVec3, b: DVec3) -> DVec3 {
    let part = |i: usize, j: usize| {
        let (first, second) = (a[i] * b[j], a[j] * b[i]);
        (first - second).abs() + 16.0 * U * (first.abs() + second.abs())
    };
    DVec3::new(part(1, 2), part(2, 0), part(0, 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Pose;
    use visibility_core::view::Window;
    use visibility_testing::Random;

    /// A box of just the least size, as the scale computes it, is not small, whatever the rounding of its
    /// square root and of the test.
    #[test]
    fn boxes_of_the_least_size_are_not_small() {
        let mut random = Random(81);
        for round in 0..20_000 {
            let pose = Pose::look_at(DVec3::ZERO, random.direction(), DVec3::new(0.3, 0.2, 0.9));
            let view = if round % 4 == 0 {
                View::orthographic(pose, Window::centered(random.range(1.0, 9.0), 5.0), 0.0, 99.0)
            } else {
                View::perspective(pose, random.range(0.1, 2.0), 1.5, 0.1, 99.0)
            };
            let scale = PixelScale::new(&view.unwrap(), DVec3::ZERO, random.range(100.0, 2000.0));
            let min = random.vec3(-9.0, 9.0);
            let bounds = Aabb::new(min, min + random.vec3(0.0, 1.0));
            let least = scale.diameter(&bounds);
            let is_small = |least: f64| {
                scale
                    .smaller_than(least)
                    .is_some_and(|test| test.is_small(&bounds, bounds.diagonal_squared()))
            };
            assert!(!is_small(least), "{round}: {bounds:?} has {least} pixels");
            assert!(least.is_infinite() || is_small(least * (1.0 + 1e-9)), "{round}: {bounds:?} is smaller");
        }
    }

    #[test]
    fn without_a_height_or_a_limit_no_box_is_small() {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.5, 0.1, 99.0).unwrap();
        let pole = Aabb::from_arrays([10.0, 0.0, 0.0], [10.0, 0.0, 2.0]);
        for height in [0.0, -9.0, f64::NAN] {
            let scale = PixelScale::new(&view, DVec3::ZERO, height);
            assert!(scale.diameter(&pole).is_nan(), "{height} rows");
            assert_eq!(scale.smaller_than(2.0), None, "{height} rows");
        }
        let scale = PixelScale::new(&view, DVec3::ZERO, 1000.0);
        let tests = [0.0, -2.0, f64::NAN, 2.0].map(|least| scale.smaller_than(least).is_some());
        assert_eq!(tests, [false, false, false, true], "by limit in pixels");
    }
}
