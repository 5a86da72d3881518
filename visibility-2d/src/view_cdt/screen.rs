//! Projection to the grid of the image, with bounds on rounding.
//!
//! Corners are homogeneous: `x`, `y` and `w`, where `x / w` and `y / w` are grid coordinates; `n`, where `n /
//! w` is the depth key (greater is nearer); and the distance beyond the near plane. Each of the five is a
//! linear function of points, a [`ClipRow`] of core, which comes with a bound on its error.

use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::view::{ClipRow, ViewProjection};
use visibility_core::{Aabb, View};

/// Unit round-off of `f64`: 2^-53.
pub(crate) const U: f64 = f64::EPSILON / 2.0;

/// Width and height of the image in units of the grid.
pub(crate) const GRID: f64 = 1_048_576.0;

/// Width in grid units of the rim around the image that is triangulated too. Outlines are clipped in the
/// middle of the rim, so that no vertex lies on the border of the triangulation.
pub(crate) const RIM: f64 = 8.0;

/// Greatest magnitude of a grid coordinate in the triangulated rectangle.
pub(crate) const REACH: f64 = GRID + RIM;

/// Homogeneous corner: `x`, `y`, `w`, `n` and the distance beyond the near plane. `x / w` and `y / w` are
/// grid coordinates, and `n / w` is the depth key (greater is nearer).
pub(crate) type Corner = [f64; 5];

/// Projection of a view to the grid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Screen {
    /// Linear functions of a point relative to `anchor` that give the five values of a [`Corner`].
    rows: [ClipRow; 5],
    /// Origin of the points that `rows` take, in metres relative to the scene's origin.
    anchor: DVec3,
    /// Sign of the determinant of a triangle's corners `(x, y, w)` if the triangle faces the eye and its
    /// transform does not mirror. 0 if this sign is unknown.
    facing: f64,
}

/// Projected corners of an object, with one error bound for all.
#[derive(Clone, Debug, Default)]
pub(crate) struct Projected {
    /// Projected points, in the order in which they were given to [`Screen::project`].
    pub(crate) corners: alloc::vec::Vec<Corner>,
    /// Bound on the absolute error of each of the five values of a corner. It also holds for points
    /// interpolated between two corners with up to four roundings.
    pub(crate) error: Corner,
    /// Upper bound on the magnitude of each of the five values, errors included.
    pub(crate) size: Corner,
}

/// Grid rectangle and depth of a box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ProjectedBox {
    /// Column and row of each corner in grid units, in the order of [`Aabb::corners`]. Each value has an
    /// error of at most a quarter of a grid unit.
    pub(crate) corners: [[f64; 2]; 8],
    /// Least column and row that the box may reach, in grid units, rounded outwards.
    pub(crate) low: [f64; 2],
    /// Greatest column and row that the box may reach, in grid units, rounded outwards.
    pub(crate) high: [f64; 2],
    /// Upper bound on the depth key (greater is nearer) of each corner, in the order of `corners`.
    pub(crate) keys: [f64; 8],
    /// Upper bound on the depth keys (greater is nearer) of all points of the box.
    pub(crate) nearest: f64,
}

/// Position of a box relative to the view.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::large_enum_variant, reason = "matched at once, never stored")]
pub(crate) enum BoxPlace {
    /// The box certainly misses the image.
    Outside,
    /// The box may reach the near plane, or rounding leaves its position on the image undecided.
    Unknown,
    /// The box is certainly beyond the near plane and may meet the image.
    Inside(ProjectedBox),
}

impl Screen {
    /// Screen on which every box is [`BoxPlace::Unknown`] and no triangle faces the eye.
    pub(crate) const BLIND: Self = Self {
        rows: [ClipRow { linear: DVec3::ZERO, constant: 0.0, error: f64::INFINITY }; 5],
        anchor: DVec3::ZERO,
        facing: 0.0,
    };

    pub(crate) fn new(view: &View, origin: DVec3) -> Self {
        let projection = ViewProjection::new(view, origin);
        let [x, y] = projection.pixels(GRID, GRID);
        Self {
            rows: [x, y, projection.w(), projection.depth_key(), projection.near()],
            anchor: projection.anchor(),
            // Rows run downwards, which mirrors. Normals of visible triangles point towards the eye, which
            // mirrors again.
            facing: projection.orientation(),
        }
    }

    /// Returns the sign of the determinant of a triangle's corners `(x, y, w)` if the triangle, placed by
    /// `transform`, faces the eye. `None` if rounding leaves open whether the transform mirrors.
    pub(crate) fn facing(&self, transform: &Affine3A) -> Option<f64> {
        let [x, y, z] = axes(transform);
        let determinant = x.cross(y).dot(z);
        let size = x.abs().element_sum() * y.abs().element_sum() * z.abs().element_sum();
        (determinant.abs() > 16.0 * U * size && self.facing != 0.0)
            .then_some(determinant.signum() * self.facing)
    }

    /// Projects points under a transform. Returns false, and an invalid result, if a value is not finite.
    ///
    /// Products of two `f32` are exact in `f64`, and three sums round, so a coordinate has an error below `4
    /// u` of the sum of magnitudes. Another `4 u` of each value allows for the interpolation of points.
    pub(crate) fn project(&self, points: &[Vec3], transform: &Affine3A, out: &mut Projected) -> bool {
        let mut is_finite = true;
        out.corners.clear();
        (out.error, out.size) = ([0.0; 5], [0.0; 5]);
        let axes = axes(transform);
        let shift = Vec3::from(transform.translation).as_dvec3();
        for p in points {
            let p = p.as_dvec3();
            let place = axes[0] * p.x + axes[1] * p.y + axes[2] * p.z + shift;
            let size = axes[0].abs() * p.x.abs()
                + axes[1].abs() * p.y.abs()
                + axes[2].abs() * p.z.abs()
                + shift.abs();
            let mut corner = [0.0; 5];
            for (i, row) in self.rows.iter().enumerate() {
                let (value, error) = row.at(place - self.anchor);
                let error = error + 4.0 * U * (row.linear.abs().dot(size) + value.abs());
                corner[i] = value;
                out.error[i] = out.error[i].max(error);
                out.size[i] = out.size[i].max(value.abs() + error);
                is_finite &= error.is_finite() && value.is_finite();
            }
            out.corners.push(corner);
        }
        is_finite
    }

    /// Returns the position of a box relative to the view. The box must be [proper](Aabb::is_proper).
    ///
    /// A quotient `q = a / w` with errors `e_a` and `e_w` has an error of `(e_a + |q| e_w) / w` to first
    /// order, and two roundings. The factor 2 covers higher orders, since `w` exceeds `1024 e_w`.
    pub(crate) fn place(&self, bounds: &Aabb) -> BoxPlace {
        let (mut corners, mut low, mut high) = ([[0.0; 2]; 8], [f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let (mut nearest, mut is_known) = (f64::NEG_INFINITY, true);
        let mut keys = [0.0; 8];
        for ((corner, key), p) in corners.iter_mut().zip(&mut keys).zip(bounds.corners()) {
            let values = self.rows.map(|row| row.at(p.as_dvec3() - self.anchor));
            let (w, of_w) = values[2];
            is_known &= values[4].0 > values[4].1 && w > 1024.0 * of_w;
            let quotient = |(a, of_a): (f64, f64)| {
                let q = a / w;
                (q, 2.0 * ((of_a + q.abs() * of_w) / w + 4.0 * U * q.abs()))
            };
            for axis in 0..2 {
                let (q, margin) = quotient(values[axis]);
                corner[axis] = q;
                low[axis] = low[axis].min(q - margin);
                high[axis] = high[axis].max(q + margin);
                is_known &= margin < 0.25;
            }
            let (q, margin) = quotient(values[3]);
            *key = q + margin;
            nearest = nearest.max(*key);
        }
        if !is_known {
            return BoxPlace::Unknown;
        }
        if (0..2).any(|axis| high[axis] < 0.0 || low[axis] > GRID) {
            return BoxPlace::Outside;
        }
        BoxPlace::Inside(ProjectedBox { corners, low, high, keys, nearest })
    }
}

fn axes(transform: &Affine3A) -> [DVec3; 3] {
    let m = transform.matrix3;
    [m.x_axis, m.y_axis, m.z_axis].map(|axis| Vec3::from(axis).as_dvec3())
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::Mat3A;
    use visibility_testing::{Random, sign_of_sum};

    /// Whole numbers from minus to plus `2^bits`.
    fn number(random: &mut Random, bits: u32) -> i128 {
        i128::from((random.bits() >> (63 - bits)) as i64) - (1 << bits)
    }

    fn vector(random: &mut Random, bits: u32) -> [i128; 3] {
        [0; 3].map(|_| number(random, bits))
    }

    fn row(linear: [i128; 3], constant: i128, error: i128) -> ClipRow {
        let linear = DVec3::from(linear.map(|x| x as f64));
        ClipRow { linear, constant: constant as f64, error: error as f64 }
    }

    fn dot(a: [i128; 3], b: [i128; 3]) -> i128 {
        (0..3).map(|k| a[k] * b[k]).sum()
    }

    fn transform(axes: [[i128; 3]; 3], translation: [i128; 3]) -> Affine3A {
        let vector = |v: [i128; 3]| Vec3::from(v.map(|x| x as f32));
        let [x, y, z] = axes.map(vector);
        Affine3A::from_mat3_translation(
            visibility_core::glam::Mat3::from(Mat3A::from_cols(x.into(), y.into(), z.into())),
            vector(translation),
        )
    }

    /// Whether a transform mirrors is told where it is certain, by exact arithmetic.
    #[test]
    fn the_facing_of_flat_transforms_is_unknown() {
        let mut random = Random(1);
        let mut screen = Screen { facing: 1.0, ..Screen::BLIND };
        let mut counts = [0; 2];
        for trial in 0..20_000 {
            let [x, y] = [vector(&mut random, 21), vector(&mut random, 21)];
            let (i, j, off) = (number(&mut random, 1), number(&mut random, 1), random.below(20) as u32);
            let is_flat = random.one_in(2);
            let z =
                [0, 1, 2].map(|k| i * x[k] + j * y[k] + if is_flat { 0 } else { number(&mut random, off) });
            let exact = (0..3)
                .map(|k| z[k] * (x[(k + 1) % 3] * y[(k + 2) % 3] - x[(k + 2) % 3] * y[(k + 1) % 3]))
                .sum::<i128>();
            for sign in [1.0, -1.0] {
                screen.facing = sign;
                let facing = screen.facing(&transform([x, y, z], [0; 3]));
                assert!(
                    facing.is_none_or(|facing| facing == sign * exact.signum() as f64),
                    "trial {trial}: {x:?}, {y:?}, {z:?}"
                );
                counts[usize::from(facing.is_some())] += 1;
            }
        }
        assert!(counts.iter().all(|&count| count > 5_000), "unknown and known: {counts:?}");
        assert_eq!(screen.facing(&transform([[0; 3]; 3], [0; 3])), None, "a transform to a point");
        assert_eq!(Screen::BLIND.facing(&Affine3A::IDENTITY), None, "a screen before the first frame");
    }

    /// Values of placed points are within their errors of the exact ones, also where positions far from the
    /// origin cancel with that of the eye; and the sizes hold the values and their errors.
    #[test]
    fn values_of_placed_points_are_within_their_errors() {
        let mut random = Random(2);
        let mut projected = Projected::default();
        for trial in 0..10_000 {
            let far = [0, 12, 40][trial % 3];
            let (axes, p) = ([0; 3].map(|_| vector(&mut random, 8)), vector(&mut random, 20));
            let shift = vector(&mut random, 20).map(|x| x << far);
            let exact = [0, 1, 2].map(|k| (0..3).map(|i| axes[i][k] * p[i]).sum::<i128>() + shift[k]);
            let anchor = exact.map(|x| (x as f64) as i128);
            let rows: [(_, _, i128); 5] = core::array::from_fn(|_| {
                (vector(&mut random, 20), number(&mut random, 30), number(&mut random, 4).abs())
            });
            let screen = Screen {
                rows: rows.map(|(linear, constant, error)| row(linear, constant, error)),
                anchor: DVec3::from(anchor.map(|x| x as f64)),
                facing: 1.0,
            };
            let points = [[0; 3], p].map(|p: [i128; 3]| Vec3::from(p.map(|x| x as f32)));
            // The last point alone, and with the origin, whose values are larger or smaller.
            let both = screen.project(&points, &transform(axes, shift), &mut projected);
            let (of_both, size) = (projected.error, projected.size);
            assert!(both && projected.corners.len() == 2, "trial {trial}: both points are finite");
            assert!(screen.project(&points[1..], &transform(axes, shift), &mut projected), "trial {trial}");
            for (i, (linear, constant, error)) in rows.into_iter().enumerate() {
                let value = dot(linear, [0, 1, 2].map(|k| exact[k] - anchor[k])) + constant;
                let off = (projected.corners[0][i] as i128 - value).abs() + error;
                assert!(
                    off as f64 <= projected.error[i],
                    "trial {trial}, value {i}: {} is off by {off}, beyond {}",
                    projected.corners[0][i],
                    projected.error[i]
                );
                let most = projected.corners[0][i].abs() + projected.error[i];
                assert!(projected.size[i] >= most, "trial {trial}: the size of value {i}");
                assert!(of_both[i] >= projected.error[i] && size[i] >= most, "trial {trial}: of both points");
            }
        }
        let points = [Vec3::ONE, Vec3::ZERO];
        assert!(!Screen::BLIND.project(&points, &Affine3A::IDENTITY, &mut projected), "errors are infinite");
    }

    /// Returns a screen on which `x`, `y` and `z` of a point are its `x`, `y` and `w`, and its key is a
    /// constant over `w`, each off by an error.
    fn plain(errors: [i128; 5], near: i128) -> Screen {
        let rows = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0; 3], [0, 0, 1]];
        let constants = [0, 0, 0, 4096, -near];
        let rows = core::array::from_fn(|i| row(rows[i], constants[i], errors[i]));
        Screen { rows, anchor: DVec3::ZERO, facing: 1.0 }
    }

    /// Bounds and keys of a box hold whatever its corners are within their errors, and corners are right to a
    /// quarter of a unit. Compared in exact arithmetic.
    #[test]
    fn places_of_boxes_hold_their_corners_within_errors() {
        let mut random = Random(3);
        let mut counts = [0; 3];
        for trial in 0..20_000 {
            let of_w = number(&mut random, 3).abs();
            let errors = [number(&mut random, 6).abs(), number(&mut random, 6).abs(), of_w, of_w, of_w];
            let screen = plain(errors, 10);
            // Often just beyond the least depth that is known.
            let w = 1024 * of_w + if random.one_in(2) { 1 } else { 1 + number(&mut random, 16).abs() };
            let [x, y] = [0; 2].map(|_| number(&mut random, 12) + [0, 1 << 12][random.below(2)]);
            let least = [x, y, w];
            let size = [0; 3].map(|_| number(&mut random, 4).abs());
            let most = [0, 1, 2].map(|k| least[k] + size[k]);
            let bounds = Aabb::from_arrays(least.map(|x| x as f32), most.map(|x| x as f32));
            let place = screen.place(&bounds);
            let BoxPlace::Inside(of) = place else {
                let is_outside = matches!(place, BoxPlace::Outside);
                counts[usize::from(is_outside)] += 1;
                // Whatever is outside is beside the image with all of its corners.
                let is_beside = (0..2).any(|k| most[k] < 0 || least[k] > (most[2] << 20));
                assert!(!is_outside || is_beside, "trial {trial}: {bounds:?}");
                continue;
            };
            counts[2] += 1;
            for (at, p) in bounds.corners().into_iter().enumerate() {
                let p = p.to_array().map(f64::from);
                for signs in 0..8u32 {
                    let off =
                        |k: usize| errors[k] as f64 * if signs >> (k % 3) & 1 == 0 { 1.0 } else { -1.0 };
                    let w = p[2] + off(2);
                    for (k, x) in p.into_iter().enumerate().take(2) {
                        let a = x + off(k);
                        let [low, high, corner] = [of.low[k], of.high[k], of.corners[at][k]];
                        assert!(
                            sign_of_sum([(a, 1.0), (-low, w)]) >= 0
                                && sign_of_sum([(a, 1.0), (-high, w)]) <= 0,
                            "trial {trial}: {a} / {w} in {low} to {high}"
                        );
                        for (by, sign) in [(0.25, 1), (-0.25, -1)] {
                            let side = sign_of_sum([(corner, w), (by, w), (-a, 1.0)]);
                            assert!(side * sign >= 0, "trial {trial}: {a} / {w} at {corner}");
                        }
                    }
                    let n = 4096.0 + if signs & 1 == 0 { errors[3] as f64 } else { -(errors[3] as f64) };
                    for key in [of.keys[at], of.nearest] {
                        assert!(sign_of_sum([(n, 1.0), (-key, w)]) <= 0, "trial {trial}: {n} / {w} is {key}");
                    }
                }
            }
        }
        assert!(counts.iter().all(|&count| count > 400), "unknown, outside and inside: {counts:?}");
    }

    /// Boxes at the near plane, and so near that errors matter, are not known; nor are places off by more
    /// than a quarter of a unit.
    #[test]
    fn places_are_unknown_where_errors_are_large() {
        let place = |errors: [i128; 5], near: i128, z: f32| {
            plain(errors, near).place(&Aabb::from_arrays([2.0, 2.0, z], [3.0, 3.0, z + 1.0]))
        };
        let is_known = |errors, near, z| matches!(place(errors, near, z), BoxPlace::Inside(_));
        assert!(is_known([0; 5], 9, 10.0), "beyond the near plane");
        assert!(!is_known([0; 5], 10, 10.0) && !is_known([0; 5], 11, 10.0), "at the near plane");
        assert!(is_known([0, 0, 0, 0, 2], 7, 10.0), "beyond the near plane by more than the error");
        assert!(!is_known([0, 0, 0, 0, 2], 8, 10.0), "beyond the near plane by the error");
        assert!(is_known([0, 0, 1, 0, 0], 1, 1025.0), "1025 errors before the eye");
        assert!(!is_known([0, 0, 1, 0, 0], 1, 1023.0), "1023 errors before the eye");
        for k in 0..2 {
            let mut errors = [0; 5];
            errors[k] = 100;
            assert!(
                is_known(errors, 9, 801.0) && !is_known(errors, 9, 799.0),
                "an error of an eighth of a unit"
            );
        }
        let outside = |low: [f32; 2], high: [f32; 2]| {
            let [[a, b], [c, d]] = [low, high];
            matches!(plain([0; 5], 0).place(&Aabb::from_arrays([a, b, 1.0], [c, d, 1.0])), BoxPlace::Outside)
        };
        let end = GRID as f32;
        for k in 0..2 {
            let at = |low: f32, high: f32| {
                if k == 0 { ([low, 5.0], [high, 6.0]) } else { ([5.0, low], [6.0, high]) }
            };
            for (low, high, is_outside) in [
                (-3.0, -1.0, true),
                (-3.0, 1.0, false),
                (end + 1.0, end + 3.0, true),
                (end - 1.0, end + 3.0, false),
            ] {
                let (a, b) = at(low, high);
                assert_eq!(outside(a, b), is_outside, "from {low} to {high} along axis {k}");
            }
        }
    }
}
