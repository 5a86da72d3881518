//! Pixel coordinates of points in homogeneous form, with bounds on their rounding errors.
//!
//! # Coordinates
//! A point `p` of the scene becomes four numbers, each linear in `p`:
//! - `x` and `y`: its pixel coordinates times `w`. Columns run to the right, rows downwards, and the first
//!   pixel lies between 0 and 1.
//! - `w`: positive in front of the eye.
//! - `n`: its *depth key* times `w`. The key falls along every view ray, so nearer is greater, and is linear
//!   on the screen wherever `p` runs over a plane. The key is `1 / w` for perspective views, where `n` is 1.
//!   For parallel views it is clip depth, negated unless depth is reversed.
//!
//! All points are relative to the *anchor*, which for a perspective view is the eye, so that precision does
//! not depend on where in the scene the camera is. The rows and their error bounds come from core's
//! [`ViewProjection`].

use visibility_core::geometry::keeps_orientation;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::view::{ClipRow, ViewProjection};
use visibility_core::{Aabb, View, view::Eye};

/// Unit round-off of `f64`.
pub(crate) const U: f64 = f64::EPSILON / 2.0;

/// A linear function of points relative to the anchor, with error bound: a [`ClipRow`] with its coefficients
/// in an array, as loops over lanes need them.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ScreenRow {
    /// Coefficients of the linear function: the change of its value for each metre along the scene's x, y
    /// and z axis.
    pub(crate) linear: [f64; 3],
    /// Value of the linear function at the anchor (the eye of a perspective view).
    pub(crate) constant: f64,
    /// Upper bound on the absolute error of `constant`, the effect of rounding the anchor included.
    pub(crate) error: f64,
}

impl From<ClipRow> for ScreenRow {
    fn from(row: ClipRow) -> Self {
        Self { linear: row.linear.to_array(), constant: row.constant, error: row.error }
    }
}

/// The projection of one frame's view to pixels, with error bounds. The default stands for no view yet: its
/// `facing` is 0, so no occluder is drawn.
#[derive(Clone, Debug, Default)]
pub(crate) struct ScreenProjection {
    /// Width and height of the buffer in pixels, a multiple of the tile size.
    pub(crate) size: [f64; 2],
    /// Width and height in pixels of the picture, the part of the buffer that shows the view. `size` is this
    /// size rounded up to whole tiles.
    pub(crate) picture: [f64; 2],
    /// Rows (linear functions of a point) that give `x` and `y` (pixel coordinates times `w`), `w`, and `n`
    /// (depth key times `w`).
    pub(crate) rows: [ScreenRow; 4],
    /// Rows (linear functions of a point) that give `width * w - x` and `height * w - y`, with `width` and
    /// `height` of the picture in pixels: negative to the right of the picture and below it.
    pub(crate) right_bottom: [ScreenRow; 2],
    /// Row (linear function of a point) that gives the distance beyond the near plane: positive beyond that
    /// plane, in the unit of clip space.
    pub(crate) near: ScreenRow,
    /// Origin, in scene coordinates, of the points that `rows` and `near` are applied to: the eye of a
    /// perspective view.
    pub(crate) anchor: DVec3,
    /// Sign (1 or -1) of the determinant of the `x`, `y`, `w` of three corners that run counter-clockwise as
    /// seen from the eye. 0 if the computed determinant of the view is exactly 0 or NaN: then nothing is
    /// drawn.
    pub(crate) facing: f64,
    /// True if the view is perspective, so that `n` is always 1. False if it is parallel, so that `w` is the
    /// same for all points and `n` carries the depth.
    pub(crate) perspective: bool,
    /// Projection of points in scene coordinates (identity transform), computed once per view. Its error
    /// bounds hold only for a point at the scene's origin;
    /// [`project_untransformed`](Self::project_untransformed) extends them to other points.
    untransformed: ObjectProjection,
}

impl ScreenProjection {
    /// Computes the projection of points in scene coordinates, relative to `origin`. `picture` is the width
    /// and height of the picture in pixels, `size` that of the buffer of whole tiles.
    pub(crate) fn new(view: &View, origin: DVec3, picture: [usize; 2], size: [usize; 2]) -> Self {
        let picture = picture.map(|side| side as f64);
        let projection = ViewProjection::new(view, origin);
        let [x, y] = projection.pixels(picture[0], picture[1]);
        let rows = [x, y, projection.w(), projection.depth_key()].map(ScreenRow::from);
        let right_bottom = projection.pixels_to_end(picture[0], picture[1]).map(ScreenRow::from);
        let near = projection.near().into();
        let anchor = projection.anchor();
        let perspective = matches!(projection.eye(), Eye::Point(_));
        // Rows of pixels run downwards, which mirrors clip space; a normal towards the eye instead of away
        // from it mirrors the sign back.
        let facing = projection.orientation();
        let size = size.map(|side| side as f64);
        let untransformed = ObjectProjection::default();
        let mut projection =
            Self { size, picture, rows, right_bottom, near, anchor, facing, perspective, untransformed };
        projection.untransformed = projection.project_object(&Affine3A::IDENTITY, [0.0; 3]);
        projection
    }

    /// Returns the projection of points in the coordinates of an object, which `transform` maps to the scene,
    /// with error bounds. `reach` is the greatest magnitude of the points' x, of their y and of their z. The
    /// error bounds do not hold for points beyond `reach`.
    #[inline(always)]
    pub(crate) fn project_object(&self, transform: &Affine3A, reach: [f64; 3]) -> ObjectProjection {
        if *transform == Affine3A::IDENTITY && self.untransformed.error[0] > 0.0 {
            return self.project_untransformed(reach);
        }
        let axes = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis]
            .map(|axis| axis.to_array().map(f64::from));
        let shift = transform.translation.to_array().map(f64::from);
        let anchor = self.anchor.to_array();
        let moved = [shift[0] - anchor[0], shift[1] - anchor[1], shift[2] - anchor[2]];
        let mut object = ObjectProjection::default();
        for i in 0..5 {
            let row = if i < 4 { &self.rows[i] } else { &self.near };
            let l = row.linear;
            let mut size =
                l[0].abs() * moved[0].abs() + l[1].abs() * moved[1].abs() + l[2].abs() * moved[2].abs();
            size += row.constant.abs();
            for axis in 0..3 {
                let a = axes[axis];
                object.linear[axis][i] = l[0] * a[0] + l[1] * a[1] + l[2] * a[2];
                size += (l[0].abs() * a[0].abs() + l[1].abs() * a[1].abs() + l[2].abs() * a[2].abs())
                    * reach[axis];
            }
            object.constant[i] = l[0] * moved[0] + l[1] * moved[1] + l[2] * moved[2] + row.constant;
            object.size[i] = size;
            // Each term passes at most nine roundings on its way into the sum, and each factor of a term
            // brings one more.
            object.error[i] = 16.0 * U * size + row.error + f64::MIN_POSITIVE;
        }
        object
    }

    /// Returns the projection, with error bounds, of points of an object without a transform, which are in
    /// scene coordinates. `reach` is the greatest magnitude of the points' x, of their y and of their z.
    #[inline(always)]
    fn project_untransformed(&self, reach: [f64; 3]) -> ObjectProjection {
        let mut object = self.untransformed;
        for i in 0..5 {
            let row = if i < 4 { &self.rows[i] } else { &self.near };
            for axis in 0..3 {
                object.size[i] += row.linear[axis].abs() * reach[axis];
            }
            object.error[i] = 16.0 * U * object.size[i] + row.error + f64::MIN_POSITIVE;
        }
        object
    }
}

/// Linear functions of points in the coordinates of one object, with error bounds: the rows of `x` and `y`
/// (pixel coordinates times `w`), `w`, `n` (depth key times `w`), and the distance beyond the near plane
/// (positive beyond, in the unit of clip space).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ObjectProjection {
    /// Change of the five values `x`, `y`, `w`, `n` and near distance for each unit along the object's x, y
    /// and z axis: `linear[axis][value]`.
    pub(crate) linear: [[f64; 5]; 3],
    /// The five values `x`, `y`, `w`, `n` and near distance at the object's own origin.
    pub(crate) constant: [f64; 5],
    /// Upper bound on the magnitude of each of the five values `x`, `y`, `w`, `n` and near distance, and on
    /// the sum of the magnitudes of its terms.
    pub(crate) size: [f64; 5],
    /// Upper bound on the absolute rounding error of each of the five values `x`, `y`, `w`, `n` and near
    /// distance.
    pub(crate) error: [f64; 5],
}

impl ObjectProjection {
    /// Returns the five values at the point `p` in the object's coordinates: `x` and `y` (pixel coordinates
    /// times `w`), `w`, `n` (depth key times `w`), and the distance beyond the near plane.
    #[inline(always)]
    pub(crate) fn at(&self, p: [f64; 3]) -> [f64; 5] {
        let mut out = [0.0; 5];
        for i in 0..5 {
            let [a, b, c] = [self.linear[0][i], self.linear[1][i], self.linear[2][i]];
            out[i] = p[0] * a + p[1] * b + p[2] * c + self.constant[i];
        }
        out
    }

    /// Returns the distance beyond the near plane at which geometry is cut, in the unit of
    /// `ScreenProjection::near`. Nothing nearer is drawn. It is 1024 times the error bound of such distances,
    /// so the rounding of cuts does not matter.
    #[inline(always)]
    pub(crate) fn near_limit(&self) -> f64 {
        1024.0 * self.error[4]
    }

    /// Returns an upper bound on the absolute error of the determinant of three points (`x`, `y`, `w`) of the
    /// object, or of a point and two differences of points. The points must be within the `reach` (greatest
    /// coordinates) given to `project_object`.
    ///
    /// Let `e` be the error bounds (`error`) and `S` the bounds on magnitudes (`size`) of the points' values,
    /// and `u` the unit round-off 2^-53. The determinant is a sum of six products of three values each.
    /// Replacing one value at a time by its error gives at most two products for each value and pair of
    /// others: `2 (e_x S_y S_w + ...)` for each of the three points. Differences of points have twice the
    /// error and twice the magnitude. The sums of the determinant round by a few units, which the errors
    /// (`16u` of `S` at least) exceed. The factor 64 covers all of this.
    #[inline(always)]
    pub(crate) fn determinant_error(&self) -> f64 {
        let ([sx, sy, sw, ..], [ex, ey, ew, ..]) = (self.size, self.error);
        64.0 * (ex * sy * sw + ey * sx * sw + ew * sx * sy)
    }

    /// Returns an upper bound on the absolute error of a line at a pixel: the cross product of two points
    /// (`x`, `y`, `w`), or of two differences of points, times the pixel (`x`, `y`, 1). It holds for all
    /// pixels of a buffer of the given width and height in pixels. The terms are counted as for
    /// [`determinant_error`](Self::determinant_error).
    #[inline(always)]
    pub(crate) fn cross_error(&self, [width, height]: [f64; 2]) -> f64 {
        let ([sx, sy, sw, ..], [ex, ey, ew, ..]) = (self.size, self.error);
        32.0 * (width * (ey * sw + ew * sy) + height * (ew * sx + ex * sw) + (ex * sy + ey * sx))
    }
}

/// Returns the projection of an occluder to homogeneous screen coordinates, and the sign of the determinant
/// of triangles that face the eye, which a mirroring transform reverses. `bounds` are in the occluder's own
/// coordinates, which `transform` maps to the scene. `None` if the transform is flat, the view's `facing` is
/// 0, or a value might overflow or is NaN: then the occluder is not drawn.
#[inline(always)]
pub(crate) fn project_object(
    projection: &ScreenProjection,
    bounds: &Aabb,
    transform: &Affine3A,
) -> Option<(ObjectProjection, f64)> {
    let reach = bounds.min.abs().max(bounds.max.abs()).to_array().map(f64::from);
    let object = projection.project_object(transform, reach);
    let mut finite = projection.facing != 0.0;
    for i in 0..5 {
        // The factor leaves room for sums of a few values without overflow.
        finite &= object.size[i] + object.error[i] < f64::MAX / 64.0;
    }
    if *transform == Affine3A::IDENTITY {
        return finite.then_some((object, projection.facing));
    }
    // A flat transform has no inside and outside to tell apart.
    let keeps = keeps_orientation(transform)?;
    finite.then_some((object, if keeps { projection.facing } else { -projection.facing }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact_screen::exact_values as exact;
    use crate::random::random;
    use crate::vector::{cross, dot, less, point};
    use visibility_core::geometry::DoubleDouble;
    use visibility_core::glam::Vec3;
    use visibility_core::{Aabb, Pose};

    const SIZE: [f64; 2] = [640.0, 360.0];

    /// Returns the cross product `a x b` in double-double arithmetic.
    fn exact_cross(a: [DoubleDouble; 3], b: [DoubleDouble; 3]) -> [DoubleDouble; 3] {
        core::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            a[j].times(b[k]).plus(a[k].times(b[j]).negated())
        })
    }

    /// Returns the dot product of `a` and `b` in double-double arithmetic.
    fn exact_dot(a: [DoubleDouble; 3], b: [DoubleDouble; 3]) -> DoubleDouble {
        (0..3).fold(DoubleDouble::ZERO, |sum, i| sum.plus(a[i].times(b[i])))
    }

    /// Tests that projected values of points, determinants of three points, and lines through two points are
    /// within their error bounds. The eye is at the origin, so that the rows of the projection have no error
    /// of their own, which could hide too small a bound.
    #[test]
    fn values_determinants_and_lines_are_within_their_errors() {
        let mut random = random(8);
        for trial in 0..20_000 {
            let mut vector = |size: f64| Vec3::from_array([0; 3].map(|_| (size * random(-1.0, 1.0)) as f32));
            let (target, transform) = (
                vector(1.0).as_dvec3(),
                match trial % 2 {
                    0 => Affine3A::IDENTITY,
                    _ => Affine3A::from_cols(
                        vector(2.0).into(),
                        vector(2.0).into(),
                        vector(2.0).into(),
                        vector(9.0).into(),
                    ),
                },
            );
            let points = [vector(20.0), vector(20.0), vector(20.0)];
            let view = View::perspective(Pose::look_at(DVec3::ZERO, target, DVec3::Z), 1.0, 1.7, 0.1, 900.0);
            let projection = ScreenProjection::new(&view.unwrap(), DVec3::ZERO, [640, 360], [640, 360]);
            let reach =
                points.into_iter().fold(Vec3::ZERO, |most, p| most.max(p.abs())).to_array().map(f64::from);
            let object = projection.project_object(&transform, reach);
            let computed = points.map(|p| object.at(p.to_array().map(f64::from)));
            let wanted = points.map(|p| exact(&projection, &transform, p.to_array()));
            let off = |value: f64, exact: DoubleDouble| exact.plus((-value).into()).hi.abs();
            for (computed, wanted) in computed.iter().zip(&wanted) {
                for i in 0..5 {
                    assert!(off(computed[i], wanted[i]) <= object.error[i], "trial {trial}, row {i}");
                }
            }
            let [a, b, c] = &computed;
            let [p, q, r] = wanted.map(|[x, y, w, ..]| [x, y, w]);
            let determinant = dot(cross(point(&less(b, a)), point(&less(c, a))), point(a));
            let wanted = exact_dot(exact_cross(q, r), p);
            assert!(off(determinant, wanted) <= object.determinant_error(), "trial {trial}: determinant");
            let pixel = [random(0.0, SIZE[0]), random(0.0, SIZE[1]), 1.0];
            let line = dot(cross(point(a), point(b)), pixel);
            let wanted = exact_dot(exact_cross(p, q), pixel.map(DoubleDouble::from));
            assert!(off(line, wanted) <= object.cross_error(SIZE), "trial {trial}: line");
        }
    }

    /// The errors of an occluder hold at the corner of its bounds that is farthest from its origin, on
    /// whichever side of the origin.
    #[test]
    fn errors_of_occluders_hold_at_the_farthest_corner() {
        let mut random = random(10);
        let view = View::perspective(
            Pose::look_at(DVec3::ZERO, DVec3::new(1.0, 0.3, -0.2), DVec3::Z),
            1.0,
            1.7,
            0.1,
            900.0,
        );
        let projection = ScreenProjection::new(&view.unwrap(), DVec3::ZERO, [640, 360], [640, 360]);
        for trial in 0..200 {
            let far = Vec3::from_array([0; 3].map(|_| random(1e6, 2e6) as f32));
            let corner = if trial % 4 < 2 { far } else { -far };
            let bounds = Aabb::new(corner.min(corner * -1e-6), corner.max(corner * -1e-6));
            let mut axis = || Vec3::from_array([0; 3].map(|_| random(-1.0, 1.0) as f32));
            let transform = match trial % 2 {
                0 => Affine3A::IDENTITY,
                _ => Affine3A::from_cols(axis().into(), axis().into(), axis().into(), axis().into()),
            };
            let (object, _) = project_object(&projection, &bounds, &transform).unwrap();
            let computed = object.at(corner.to_array().map(f64::from));
            let wanted = exact(&projection, &transform, corner.to_array());
            for i in 0..5 {
                let off = wanted[i].plus((-computed[i]).into()).hi.abs();
                let error = object.error[i];
                assert!(off <= error, "trial {trial}, row {i}: off by {off}, with an error of {error}");
            }
        }
    }

    /// Errors of the projection's own rows are part of those of an object, and are those of core. They are
    /// made large here, so that half of one would not do.
    #[test]
    fn objects_have_the_errors_of_the_projection() {
        let pose = Pose::look_at(DVec3::new(1e6, -2e6, 3e6), DVec3::ZERO, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.7, 0.1, 900.0).unwrap();
        let mut projection = ScreenProjection::new(&view, DVec3::ZERO, [640, 360], [640, 360]);
        let of_core = ViewProjection::new(&view, DVec3::ZERO);
        let [x, y] = of_core.pixels(640.0, 360.0);
        for (row, of_core) in projection.rows.iter().zip([x, y, of_core.w(), of_core.depth_key()]) {
            assert_eq!(row.error, of_core.error, "the error of a row of core");
        }
        assert_eq!(projection.near.error, of_core.near().error, "the error of the distance");
        for i in 0..5 {
            (if i < 4 { &mut projection.rows[i] } else { &mut projection.near }).error = 1e9 * (i + 1) as f64;
        }
        let transforms = [Affine3A::IDENTITY, Affine3A::from_scale(Vec3::splat(3.0))];
        for (object, transform) in transforms.map(|of| (projection.project_object(&of, [1.0; 3]), of)) {
            for (i, error) in object.error.into_iter().enumerate() {
                assert!(error >= 1e9 * (i + 1) as f64, "row {i} under {transform:?}: {error}");
            }
        }
    }

    /// Tests that occluders under flat transforms are not drawn. Entries of the transforms have 22 bits, so
    /// that the exact determinant is zero but the one computed in `f64` is not.
    #[test]
    fn flat_transforms_have_no_front() {
        let mut random = random(9);
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.7, 0.1, 900.0).unwrap();
        let projection = ScreenProjection::new(&view, DVec3::ZERO, [640, 360], [640, 360]);
        let bounds = Aabb::new(Vec3::NEG_ONE, Vec3::ONE);
        for _ in 0..5_000 {
            let mut axis =
                || Vec3::from_array([0; 3].map(|_| (random(-1.0, 1.0) * 4_194_304.0) as i32 as f32));
            let (a, b) = (axis(), axis());
            let flat = Affine3A::from_cols(a.into(), b.into(), (a - b).into(), (Vec3::X * 5.0).into());
            assert!(project_object(&projection, &bounds, &flat).is_none(), "{a} {b}");
        }
        assert!(
            project_object(&projection, &bounds, &Affine3A::from_scale(Vec3::splat(3.0))).is_some(),
            "a transform that is not flat is projected"
        );
    }
}
