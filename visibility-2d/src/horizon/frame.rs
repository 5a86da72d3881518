//! Four faces of the horizon's picture, relative to the eye, and the columns of each that the view can see.

use core::ops::Range;
use visibility_core::View;
use visibility_core::glam::{DMat3, DVec3, Vec3};
use visibility_core::view::{ClipRow, Eye, ViewProjection};

/// Unit round-off of `f64`: 2^-53.
const U: f64 = f64::EPSILON / 2.0;

/// Axis of a scene that points up.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
pub enum UpAxis {
    /// The y axis points up, as in most engines.
    Y,
    /// The z axis points up, as in maps, CAD and Unreal.
    #[default]
    Z,
}

impl UpAxis {
    /// Returns a point as its two coordinates on the plan and its height, in a right-handed system.
    pub(crate) fn split(self, p: DVec3) -> [f64; 3] {
        match self {
            Self::Y => [p.z, p.x, p.y],
            Self::Z => [p.x, p.y, p.z],
        }
    }

    /// Returns the point of the scene with the given two coordinates on the plan and the given height.
    pub(crate) fn join(self, [x, y, height]: [f64; 3]) -> DVec3 {
        match self {
            Self::Y => DVec3::new(y, height, x),
            Self::Z => DVec3::new(x, y, height),
        }
    }

    /// Returns the indices of the plan's x, the plan's y and the height: of rows in a
    /// [`Boxes64`](visibility_core::scene::Boxes64), or of components in a vector.
    pub(crate) const fn rows(self) -> [usize; 3] {
        match self {
            Self::Y => [2, 0, 1],
            Self::Z => [0, 1, 2],
        }
    }

    /// Returns a vector in `f32` as its two coordinates on the plan, then its height.
    pub(crate) fn split_f32(self, p: Vec3) -> [f32; 3] {
        self.rows().map(|row| p[row])
    }
}

/// Number of faces of the picture: towards +x, +y, -x and -y of the plan.
pub(crate) const FACES: usize = 4;

/// Returns the depth of a point in a face of the picture, and its lateral coordinate, which grows
/// counter-clockwise. The point is on the plan, relative to the eye. Exact.
pub(crate) fn turned<T: core::ops::Neg<Output = T>>(face: usize, x: T, y: T) -> (T, T) {
    match face {
        0 => (x, y),
        1 => (y, -x),
        2 => (-x, -y),
        _ => (-y, x),
    }
}

/// Eye of a view on the plan, and the part of each face that the view sees.
#[derive(Clone, Debug)]
pub(crate) struct Frame {
    pub(crate) up: UpAxis,
    /// Eye in metres relative to the scene's origin: two coordinates on the plan and the height.
    pub(crate) eye: [f64; 3],
    /// Bound in metres on the distance between the exact eye and `eye`. Infinite if nothing can be hidden:
    /// before the first frame, in parallel views, and if rounding leaves the eye undecided.
    pub(crate) error: f64,
    /// Linear function of points relative to `anchor`, positive beyond the near plane.
    near: ClipRow,
    /// The rounded eye, in metres relative to the scene's origin.
    anchor: DVec3,
    /// Range of each face that the view can see, from 0 to 1 across the face. Empty if none.
    pub(crate) seen: [Range<f64>; FACES],
}

impl Frame {
    /// Frame in which nothing can be hidden.
    pub(crate) const BLIND: Self = Self {
        up: UpAxis::Z,
        eye: [0.0; 3],
        error: f64::INFINITY,
        near: ClipRow { linear: DVec3::ZERO, constant: 0.0, error: 0.0 },
        anchor: DVec3::ZERO,
        seen: [const { 0.0..1.0 }; FACES],
    };

    /// Makes the frame of a view for points relative to `origin`, a point of the world.
    pub(crate) fn new(view: &View, origin: DVec3, up: UpAxis) -> Self {
        let projection = ViewProjection::new(view, origin);
        let Eye::Point(eye) = projection.eye() else { return Self { up, ..Self::BLIND } };
        let error = projection.eye_error();
        if !(error.is_finite() && eye.is_finite()) {
            return Self { up, ..Self::BLIND };
        }
        let seen = seen_columns(&projection, up).unwrap_or([const { 0.0..1.0 }; FACES]);
        Self { up, eye: up.split(eye), error, near: projection.near(), anchor: projection.anchor(), seen }
    }

    /// Returns whether a ball is certainly beyond the near plane. The centre is relative to the scene's
    /// origin, as two coordinates on the plan and a height. False for NaN.
    pub(crate) fn is_beyond_near(&self, point: [f64; 3], radius: f64) -> bool {
        let (value, error) = self.near.at(self.up.join(point) - self.anchor);
        value > error + self.near.linear.length() * 2.0 * radius
    }

    /// Returns whether all points within `radius` metres of a box are certainly beyond the near plane. `min`
    /// and `max` are its least and greatest coordinates relative to the scene's origin: two on the plan, then
    /// the height. False for NaN.
    pub(crate) fn is_box_beyond_near(&self, min: [f64; 3], max: [f64; 3], radius: f64) -> bool {
        let growth = self.up.split(self.near.linear);
        let nearest = core::array::from_fn(|i| if growth[i] > 0.0 { min[i] } else { max[i] });
        self.is_beyond_near(nearest, radius)
    }
}

/// Returns the range of each face, from 0 to 1, that a perspective view can see. `None` if the view sees all
/// directions on the plan, as a camera that looks down does, or if rounding leaves this undecided.
fn seen_columns(projection: &ViewProjection, up: UpAxis) -> Option<[Range<f64>; FACES]> {
    let rows = DMat3::from_cols(projection.x().linear, projection.y().linear, projection.w().linear);
    let forth = rows.transpose();
    let back = forth.inverse();
    let norm = |m: &DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>();
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| {
        // At a corner of the picture, clip-space x and y are `w` or `-w`: it is the direction that `forth`
        // maps to (+-1, +-1, 1). The error of the computed direction is the inverse applied to the residual.
        // The rows are within 3u of the exact ones, and a product with them rounds by 3u of its terms.
        let target = DVec3::new(x, y, 1.0);
        let corner = back * target;
        let left_over = (forth * corner - target).length();
        let size = norm(&forth) * corner.length_squared();
        let off = norm(&back) * (left_over * left_over + 256.0 * U * U * size);
        // Values are squared, to avoid square roots: `off` is the squared error, and 4 `off` the square of
        // twice the error.
        (up.split(corner), 4.0 * off)
    });
    // If all four corners point to one side of a line through the eye, by a good margin, the view is within
    // the sector between the outermost two.
    let middle = corners.iter().fold([0.0; 2], |sum, (c, _)| [sum[0] + c[0], sum[1] + c[1]]);
    let length2 = middle[0] * middle[0] + middle[1] * middle[1];
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for (c, off) in &corners {
        let along = c[0] * middle[0] + c[1] * middle[1];
        let across = middle[0] * c[1] - middle[1] * c[0];
        // The error is at most a millionth of the corner's extent along the middle.
        if !(along > 0.0 && off * length2 <= 1e-12 * along * along) {
            return None;
        }
        (least, most) = (least.min(across / along), most.max(across / along));
    }
    // The tangent of the angle from the middle is off by less than 4e-6 of 1 + its square.
    let widened = |tangent: f64, by: f64| tangent + by * 4e-6 * (1.0 + tangent * tangent);
    let side = |tangent: f64| [middle[0] - middle[1] * tangent, middle[1] + middle[0] * tangent];
    let (right, left) = (side(widened(least, -1.0)), side(widened(most, 1.0)));
    let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    // For NaN the result is `None`.
    (cross(right, left) > 0.0).then(|| {
        core::array::from_fn(|face| {
            // A face spans the directions from (1, -1) to (1, 1), less than half a turn, and so does the
            // sector.
            let turn = |v: [f64; 2]| {
                let (x, y) = turned(face, v[0], v[1]);
                [x, y]
            };
            let (right, left) = (turn(right), turn(left));
            let is_within = |d: [f64; 2]| cross(right, d) >= 0.0 && cross(d, left) >= 0.0;
            let in_face = |v: [f64; 2]| v[0] > 0.0 && v[1].abs() <= v[0];
            let part = |v: [f64; 2]| 0.5 + 0.5 * v[1] / v[0];
            let begin = if is_within([1.0, -1.0]) {
                0.0
            } else if in_face(right) {
                part(right)
            } else {
                return 0.0..0.0;
            };
            let end = if is_within([1.0, 1.0]) {
                1.0
            } else if in_face(left) {
                part(left)
            } else {
                1.0
            };
            begin..end
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::Random;

    /// A ball or a box is beyond the near plane if it is by more than its radius and the errors, which are
    /// large here. Half of an error would not do.
    #[test]
    fn what_is_beyond_the_near_plane_is_so_in_spite_of_errors() {
        let near = |error| ClipRow { linear: DVec3::X, constant: 0.0, error };
        for (error, radius, least) in [(0.0, 0.1, 0.1), (0.1, 0.0, 0.1), (0.1, 0.1, 0.2)] {
            let frame = Frame { near: near(error), ..Frame::BLIND };
            for (x, is_beyond) in [(0.99 * least, false), (3.0 * least, true)] {
                assert_eq!(frame.is_beyond_near([x, 0.0, 0.0], radius), is_beyond, "{x}: {error}, {radius}");
                let [min, max] = [[x, -9.0, -9.0], [9.0; 3]];
                assert_eq!(
                    frame.is_box_beyond_near(min, max, radius),
                    is_beyond,
                    "from {x}: {error}, {radius}"
                );
                let frame = Frame { near: ClipRow { linear: DVec3::NEG_X, ..near(error) }, ..Frame::BLIND };
                let [min, max] = [[-9.0; 3], [-x, 9.0, 9.0]];
                assert_eq!(
                    frame.is_box_beyond_near(min, max, radius),
                    is_beyond,
                    "to {x}: {error}, {radius}"
                );
            }
        }
    }

    /// Directions in the view are in the columns in view, for views whose rows are nearly in one plane as
    /// well.
    #[test]
    fn columns_in_view_hold_all_directions_of_the_view() {
        let mut random = Random(1);
        let (mut known, mut held) = (0, 0);
        for trial in 0..20_000 {
            // Directions of the right and the upper side of the picture, and of its middle.
            let flat = [1.0, 1e-3, 1e-7, 1e-12][trial % 4];
            let middle = random.direction();
            let [right, above] = [(); 2].map(|()| random.direction() * random.range(0.05, 0.9) * flat);
            let columns = DMat3::from_cols(right, above, middle);
            let rows = columns.inverse().transpose();
            let matrix = visibility_core::glam::DMat4::from_cols(
                rows.x_axis.extend(0.0),
                rows.y_axis.extend(0.0),
                (rows.z_axis * 0.5).extend(-0.1),
                rows.z_axis.extend(0.0),
            );
            let Ok(view) =
                View::from_clip_from_world(matrix.transpose(), visibility_core::view::Depth::ZeroToOne)
            else {
                continue;
            };
            let projection = ViewProjection::new(&view, DVec3::ZERO);
            let Some(seen) = seen_columns(&projection, UpAxis::Z) else { continue };
            assert!(flat > 1e-12, "trial {trial}: rows in one plane, up to rounding");
            known += 1;
            // Corners of the picture, the directions that the rows map to them.
            for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                let at = middle + right * x + above * y;
                for (face, seen) in seen.iter().enumerate() {
                    let (depth, lateral) = turned(face, at.x, at.y);
                    if depth > lateral.abs() {
                        let part = 0.5 + 0.5 * lateral / depth;
                        assert!(
                            seen.start <= part && part <= seen.end,
                            "trial {trial}: {at} at {part} of face {face}, {seen:?}"
                        );
                        held += 1;
                    }
                }
            }
        }
        assert!(known > 2_000 && held > 5_000, "{known} views with a sector, {held} directions in it");
    }

    #[test]
    fn the_error_of_a_frame_is_that_of_the_eye() {
        let eye = DVec3::new(1e6, 2e6, 3e6);
        let pose = visibility_core::Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, 0.1, 100.0).unwrap();
        let far = View::from_clip_from_world(view.clip_from(DVec3::ZERO), view.depth()).unwrap();
        let frame = Frame::new(&far, DVec3::ZERO, UpAxis::Z);
        let error = ViewProjection::new(&far, DVec3::ZERO).eye_error();
        assert!(error > 0.0 && frame.error == error, "{} of {error}", frame.error);
    }
}
