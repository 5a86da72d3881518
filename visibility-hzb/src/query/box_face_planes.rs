//! The faces of a box as bounds on depth keys, linear on the screen.
//!
//! A screen rectangle around a box overestimates the box twice: its corners lie beside the box, and the whole
//! rectangle counts as near as the box's nearest corner. But a box is six half-spaces, and each bounds the
//! depth key `1 / w` of its points by a function that is linear on the screen (Kay and Kajiya, "Ray Tracing
//! Complex Scenes", 1986, cut rays by slabs in this way). A half-space with the eye outside bounds the depth
//! key from above; a half-space with the eye inside bounds it from below. Where the least upper bound is
//! below the greatest lower bound, no view ray meets the box. Elsewhere the box is no nearer than the upper
//! bound. An occluder's depth plane is compared with each upper bound as a difference of two linear
//! functions. So a floor seen at a grazing angle hides what lies below the floor everywhere.
//!
//! # The error bound
//! Let `M` be the 3 x 3 matrix of the linear parts of the projection's rows `x`, `y` and `w`, and `u` the
//! unit round-off 2^-53. A point `q`, relative to the anchor (the eye), at pixel coordinates `s = (x, y, 1)`
//! satisfies `w s = M q + e`, where each component of `e` is at most the row's constant and its error. With
//! the adjugate `C` of `M` and its determinant `D`, `w (C s) = D q + C e`. Entries of `M` are off by `3u` of
//! themselves. So those of `C`, two products each, are off by less than `16u` of the sum `P` of the
//! magnitudes of these products, and `D` by less than `32u` of the sum of magnitudes of its six products. On
//! the plane of a face, where one coordinate of `q` is a constant `t`, the depth key is that coordinate of `C
//! s`, divided by `D t`. The numerator, with scaling and evaluation, is off by less than `64u` of `P s` at
//! the far corner of the picture; some `31u` are needed, even a block of 64 pixels past that corner of a
//! picture a quarter as wide. The denominator is off by less than `P e` plus `32u` of `t` times the six
//! products. `64u` and a thousandth of `P e` more are allowed, for the rounding of the bound and of `t`.
//! Half-spaces whose denominator is not larger than that error are left out, which only makes the box larger.

use crate::lanes::least;
use crate::setup::screen_projection::{ScreenProjection, U};

/// Number of lanes: the six faces of a box and two lanes that bound nothing, since compilers keep eight lanes
/// together. Lanes 0 to 2 are the faces of greatest x, y and z, lanes 3 to 5 those of least x, y and z.
pub(crate) const LANES: usize = 8;

/// Lane numbers 0 to 7 as `f64`. In [`BoxFacePlanes::ranges`] the lanes are squares side by side.
const STEPS: [f64; LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// Sign of the outward normal of each face along its axis; 0 in the two unused lanes.
const SIGNS: [f64; LANES] = [1.0, 1.0, 1.0, -1.0, -1.0, -1.0, 0.0, 0.0];

/// View-dependent terms for bounding a box's depth key by the planes of its faces, one lane for each face.
#[derive(Clone, Debug, Default)]
pub(crate) struct FacePlaneSetup {
    /// Coordinate of the projection's anchor (the eye) along the face's axis, in metres in scene
    /// coordinates.
    anchor: [f64; LANES],
    /// Coefficients `a`, `b`, `c`, as `along[0]` to `along[2]`, of a linear function `a x + b y + c` of
    /// pixel coordinates, for each face. Its value is the dot product of the view ray through the pixel
    /// with the inward normal of the face, times the determinant of the linear parts of the projection's
    /// rows `x`, `y` and `w`.
    along: [[f64; LANES]; 3],
    /// Upper bound on the absolute error of the linear function `along` anywhere in the picture, for each
    /// face.
    error: [f64; LANES],
    /// Magnitude of the determinant of the rows `x`, `y`, `w` of the projection. 0 for parallel views and
    /// where rounding leaves the sign of the determinant undetermined: then no box is hidden by its faces.
    pub(crate) scale: f64,
    /// Constant part of the upper bound on the absolute error of the denominator of each face's depth key.
    /// The numerator is the linear function `along`; the denominator is `scale` times the distance between
    /// anchor and face.
    denominator_error: [f64; LANES],
    /// Part of the upper bound on the absolute error of the denominator of a face's depth key (`scale` times
    /// the distance between anchor and face) for each metre of the distance.
    denominator_error_per_metre: f64,
}

/// Bounds of one box's depth key by its faces, one lane for each face. In lane `i` the linear function
/// `slope[0][i] x + slope[1][i] y + constant[i]` of pixel coordinates `x` and `y` bounds the depth key: it is
/// an upper bound if `upper[i]` is 0, and the negative of a lower bound if `lower[i]` is 0. Other lanes are
/// unused.
pub(crate) struct BoxFacePlanes {
    /// Change of each face's bound (on a depth key or its negative): `slope[0]` for each pixel to the right,
    /// `slope[1]` for each pixel downwards.
    slope: [[f64; LANES]; 2],
    /// Value, at the upper left corner of the picture, of each face's linear bound on the depth key or on
    /// its negative. Raised by the error bound, so that the bound stays conservative.
    constant: [f64; LANES],
    /// 0 in lanes whose linear function is an upper bound on the box's depth key, else infinity. Added to
    /// the lanes' values, so that a minimum ignores other lanes.
    upper: [f64; LANES],
    /// 0 in lanes whose linear function is the negative of a lower bound on the box's depth key, else
    /// infinity. Added to the lanes' values, so that a minimum ignores other lanes.
    lower: [f64; LANES],
}

/// Returns the least of the eight values. NaN only if values are NaN.
#[inline(always)]
fn lowest(values: &[f64; LANES]) -> f64 {
    let mut low = [0.0; LANES / 2];
    for i in 0..LANES / 2 {
        low[i] = least(values[i], values[i + LANES / 2]);
    }
    least(least(low[0], low[2]), least(low[1], low[3]))
}

/// Returns the cross product `a x b`, and for each component the sum of the magnitudes of its two products.
fn products(a: [f64; 3], b: [f64; 3]) -> ([f64; 3], [f64; 3]) {
    let (mut cross, mut sizes) = ([0.0; 3], [0.0; 3]);
    for i in 0..3 {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let (p, q) = (a[j] * b[k], a[k] * b[j]);
        (cross[i], sizes[i]) = (p - q, p.abs() + q.abs());
    }
    (cross, sizes)
}

impl FacePlaneSetup {
    /// Computes the setup of a view. For a parallel view, `scale` is 0 and no box is hidden by its faces.
    pub(crate) fn new(projection: &ScreenProjection) -> Self {
        let [x, y, w, _] = projection.rows;
        let mut faces = Self::default();
        if !projection.perspective {
            return faces;
        }
        // Columns of the adjugate matrix: the coefficients of pixel coordinates `x` and `y`, and of 1.
        let columns =
            [products(y.linear, w.linear), products(w.linear, x.linear), products(x.linear, y.linear)];
        let mut determinant = 0.0;
        for i in 0..3 {
            determinant += x.linear[i] * columns[0].0[i];
            faces.denominator_error_per_metre += 64.0 * U * x.linear[i].abs() * columns[0].1[i];
        }
        let sign = determinant.signum();
        let reach = [projection.size[0], projection.size[1], 1.0];
        for lane in 0..6 {
            let axis = lane % 3;
            faces.anchor[lane] = projection.anchor[axis];
            for (i, row) in [x, y, w].iter().enumerate() {
                let (value, size) = (columns[i].0[axis], columns[i].1[axis]);
                faces.along[i][lane] = -SIGNS[lane] * sign * value;
                faces.error[lane] += 64.0 * U * size * reach[i];
                faces.denominator_error[lane] += 1.001 * size * (row.constant.abs() + row.error);
            }
        }
        // The comparison is false for NaN, which leaves `scale` at 0.
        let sum = determinant.abs() + faces.error.iter().chain(&faces.denominator_error).sum::<f64>();
        if sum < f64::INFINITY {
            faces.scale = determinant.abs();
        }
        faces
    }

    /// Computes the bounds on the depth key of a box by the planes of its faces. The box is given by its
    /// least x, y, z and greatest x, y, z in scene coordinates. A face is left without a bound if its
    /// coordinate is NaN, or if the error bound of its distance from the eye exceeds that distance.
    #[inline(always)]
    pub(crate) fn of_box(&self, [x0, y0, z0, x1, y1, z1]: [f32; 6]) -> BoxFacePlanes {
        let sides = [x1, y1, z1, x0, y0, z0, 0.0, 0.0];
        const NONE: [f64; LANES] = [f64::INFINITY; LANES];
        let mut box_planes =
            BoxFacePlanes { slope: [[0.0; LANES]; 2], constant: [0.0; LANES], upper: NONE, lower: NONE };
        for i in 0..LANES {
            let distance = SIGNS[i] * (f64::from(sides[i]) - self.anchor[i]);
            let size = self.scale * distance.abs();
            let off = self.denominator_error[i] + self.denominator_error_per_metre * distance.abs();
            // Written so that a face at a NaN coordinate bounds nothing.
            let known = (size > off) & (size < f64::INFINITY);
            let inside = distance > 0.0;
            let over = 1.0 / (size + if inside { off } else { -off });
            let over = if known { over } else { 0.0 };
            box_planes.slope[0][i] = self.along[0][i] * over;
            box_planes.slope[1][i] = self.along[1][i] * over;
            box_planes.constant[i] = self.along[2][i] * over + self.error[i] * over;
            box_planes.upper[i] = if known & !inside { 0.0 } else { f64::INFINITY };
            box_planes.lower[i] = if known & inside { 0.0 } else { f64::INFINITY };
        }
        box_planes
    }
}

impl BoxFacePlanes {
    /// Returns whether any face bounds the box's depth key from above: whether the eye is certainly outside
    /// the box.
    #[inline(always)]
    pub(crate) fn bounds_from_above(&self) -> bool {
        lowest(&self.upper) < f64::INFINITY
    }

    /// Returns, for each face, whether the face's upper bound on the box's depth key is strictly below the
    /// plane `a x + b y + c` in a whole rectangle. The plane is a function of pixel coordinates `x` and `y`;
    /// the rectangle is given by its left, right, top and bottom in pixels. False for faces that are not
    /// upper bounds. Only a corner is tested, since the difference of two planes is least at a corner of the
    /// rectangle.
    #[inline(always)]
    pub(crate) fn below(&self, [a, b, c]: [f64; 3], [left, right, top, bottom]: [f64; 4]) -> [bool; LANES] {
        let mut below = [false; LANES];
        for i in 0..LANES {
            let (x, y) = (a - self.slope[0][i], b - self.slope[1][i]);
            let least = x * if x > 0.0 { left } else { right } + y * if y > 0.0 { top } else { bottom };
            below[i] = least + (c - self.constant[i]) > self.upper[i];
        }
        below
    }

    /// Returns an upper and a lower bound, in this order, on the box's depth key over a rectangle (left,
    /// right, top, bottom in pixels). The upper bound is the least of the faces' upper bounds, each at its
    /// maximum over the rectangle. The lower bound is the greatest of the faces' lower bounds, each at its
    /// minimum. Infinity if no face gives an upper bound, negative infinity if none gives a lower one. If the
    /// upper bound is less than the lower one, no view ray through the rectangle meets the box.
    #[inline(always)]
    pub(crate) fn range(&self, [left, right, top, bottom]: [f64; 4]) -> [f64; 2] {
        let (mut above, mut below) = ([0.0; LANES], [0.0; LANES]);
        let [a, b] = &self.slope;
        for i in 0..LANES {
            let x = a[i] * if a[i] > 0.0 { right } else { left };
            let value = x + b[i] * if b[i] > 0.0 { bottom } else { top } + self.constant[i];
            (above[i], below[i]) = (value + self.upper[i], value + self.lower[i]);
        }
        [lowest(&above), -lowest(&below)]
    }

    /// Returns what [`range`](Self::range) does for [`LANES`] squares side by side, of which the first has
    /// its upper left corner at `left` and `top`, in pixels. The first array holds the upper bounds, the
    /// second the lower bounds, one lane for each square.
    #[inline(always)]
    pub(crate) fn ranges(&self, [left, top]: [f64; 2], size: f64) -> [[f64; LANES]; 2] {
        let (mut above, mut below) = ([f64::INFINITY; LANES], [f64::INFINITY; LANES]);
        for face in 0..6 {
            let [a, b] = [self.slope[0][face], self.slope[1][face]];
            let row = b * if b > 0.0 { top + size } else { top } + self.constant[face];
            let first = if a > 0.0 { left + size } else { left };
            for i in 0..LANES {
                let value = a * (first + size * STEPS[i]) + row;
                above[i] = least(value + self.upper[face], above[i]);
                below[i] = least(value + self.lower[face], below[i]);
            }
        }
        [above, below.map(|value| -value)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact_screen::on_screen;
    use crate::random::random;
    use alloc::format;
    use visibility_core::geometry::DoubleDouble;
    use visibility_core::glam::{DMat3, DVec3};
    use visibility_core::{Pose, View};

    /// Tests that exact points on the faces of a box satisfy the computed bounds on its depth key, also where
    /// the eye is almost in the plane of a face.
    #[test]
    fn bounds_hold_on_the_faces() {
        let mut random = random(5);
        let (mut above, mut below) = (0, 0);
        for trial in 0..20_000 {
            // With the eye at the origin, only the determinant is rounded.
            let far = if trial % 2 == 0 { 0.0 } else { 10f64.powf(random(0.0, 6.0)) };
            let eye = DVec3::from_array([0; 3].map(|_| far * random(-1.0, 1.0)));
            let target = eye + DVec3::from_array([0; 3].map(|_| random(-1.0, 1.0)));
            let pose = Pose::look_at(eye, target, DVec3::Z);
            let view = View::perspective(pose, random(0.3, 2.0), 1.5, 0.01, f64::INFINITY).unwrap();
            // The farther the eye is from the origin, the less precisely the matrix determines it. Far off
            // the middle of a picture, the determinant is a difference of large products.
            let mut matrix = view.clip_from(DVec3::ZERO);
            let aside = random(0.0, 1.0).powi(9) * 1e7;
            for axis in 0..4 {
                let column = matrix.col_mut(axis);
                column.x += aside * column.w;
            }
            let rows = [0, 1, 3].map(|row| matrix.row(row));
            let inverse =
                DMat3::from_cols_array_2d(&rows.map(|row| row.truncate().to_array())).transpose().inverse();
            let apex = -(inverse * DVec3::from_array(rows.map(|row| row.w)));
            let view = View::from_clip_from_world(matrix, view.depth()).unwrap();
            let projection = ScreenProjection::new(&view, DVec3::ZERO, [192, 128], [192, 128]);
            let faces = FacePlaneSetup::new(&projection);
            let mut sides = [0.0f32; 6];
            for axis in 0..3 {
                let near = eye[axis] + random(-1.0, 1.0).powi(9);
                let (a, b) = (near as f32, (near + random(-40.0, 40.0)) as f32);
                (sides[axis], sides[axis + 3]) = (a.min(b), a.max(b));
            }
            let box_planes = faces.of_box(sides);
            for lane in 0..6 {
                let axis = lane % 3;
                // A point of the face that is somewhere in the picture.
                let side = f64::from(if lane < 3 { sides[axis + 3] } else { sides[axis] });
                let (x, y) = (random(-1.0, 1.0), random(-1.0, 1.0));
                let way = inverse * DVec3::new(x, y, 1.0);
                let mut q = (apex + way * ((side - apex[axis]) / way[axis])).to_array();
                q[axis] = side;
                let at = on_screen(rows, q, [192.0, 128.0]);
                let [x, y, w] = at.map(|value| value.hi);
                if !(w > 0.0 && x >= 0.0 && x <= 192.0 * w && y >= 0.0 && y <= 128.0 * w) {
                    continue;
                }
                let factors =
                    [box_planes.slope[0][lane], box_planes.slope[1][lane], box_planes.constant[lane]];
                let value =
                    (0..3).fold(DoubleDouble::ZERO, |all, i| all.plus(at[i].times(factors[i].into())));
                // The depth key is 1 / w, so the bounds times w are compared with 1.
                if box_planes.upper[lane] == 0.0 {
                    above += 1;
                    assert!(value.plus((-1.0).into()).hi >= 0.0, "{lane} {q:?} {sides:?} {value:?}");
                }
                if box_planes.lower[lane] == 0.0 {
                    below += 1;
                    assert!(value.plus(1.0.into()).hi >= 0.0, "{lane} {q:?} {sides:?} {value:?}");
                }
            }
        }
        assert!(above > 2_000 && below > 2_000, "{above} {below}");
    }

    /// Bounds hold whichever way the rows `x`, `y` and `w` are off by their errors. These errors are made
    /// large here, so that half of one would not do.
    #[test]
    fn bounds_hold_on_the_faces_of_projections_that_are_off_by_their_errors() {
        let mut random = random(6);
        let mut counts = [0; 2];
        for trial in 0..6_000 {
            let mut unit = || random(-1.0, 1.0);
            let turned = DVec3::new(unit(), unit(), unit());
            let along = if trial % 2 == 0 { DVec3::X } else { turned };
            let pose = Pose::look_at(DVec3::ZERO, along, DVec3::Z);
            let view = View::perspective(pose, 1.0, 1.5, 0.01, f64::INFINITY).unwrap();
            let mut projection = ScreenProjection::new(&view, DVec3::ZERO, [192, 128], [192, 128]);
            let off = [192.0, 128.0, 1.0].map(|size| if unit() > 0.0 { size * unit().abs() } else { 0.0 });
            (0..3).for_each(|i| projection.rows[i].error += off[i]);
            let low = [0; 3].map(|_| (4.0 * unit()) as f32);
            let high = low.map(|low| low + unit().abs() as f32);
            let sides = [low[0], low[1], low[2], high[0], high[1], high[2]];
            let planes = FacePlaneSetup::new(&projection).of_box(sides);
            let [x, y, w, _] = projection.rows.map(|row| DVec3::from(row.linear));
            let inverse = DMat3::from_cols(x, y, w).transpose().inverse();
            for (lane, signs) in (0..6).flat_map(|lane| (0..8).map(move |signs| (lane, signs))) {
                let e = DVec3::from([0, 1, 2].map(|i| if signs >> i & 1 == 0 { off[i] } else { -off[i] }));
                let place = DVec3::new(96.0 * (1.0 + unit()), 64.0 * (1.0 + unit()), 1.0);
                // The point of the face at that place: w * place = M q + e.
                let side = f64::from(if lane < 3 { high[lane] } else { low[lane - 3] });
                let w = (side + (inverse * e)[lane % 3]) / (inverse * place)[lane % 3];
                let bound =
                    planes.slope[0][lane] * place.x + planes.slope[1][lane] * place.y + planes.constant[lane];
                let case = format!("trial {trial}, face {lane}, signs {signs:b}: {bound} for {}", 1.0 / w);
                if w > 0.0 && planes.upper[lane] == 0.0 {
                    counts[0] += 1;
                    assert!(bound * w >= 1.0 - 1e-9, "upper bound, {case}");
                }
                if w > 0.0 && planes.lower[lane] == 0.0 {
                    counts[1] += 1;
                    assert!(-bound * w <= 1.0 + 1e-9, "lower bound, {case}");
                }
            }
        }
        assert!(counts[0] > 10_000 && counts[1] > 10_000, "{counts:?}");
    }

    #[test]
    fn faces_bound_nothing_where_numbers_are_too_large_or_too_uncertain() {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0), DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.5, 0.01, f64::INFINITY).unwrap();
        let mut projection = ScreenProjection::new(&view, DVec3::ZERO, [192, 128], [192, 128]);
        assert!(FacePlaneSetup::new(&projection).scale > 0.0, "a view");
        projection.rows[0].error = f64::MAX;
        assert_eq!(FacePlaneSetup::new(&projection).scale, 0.0, "infinite errors of denominators");
        let bounds = |scale: f64, error: f64| {
            let denominator_error = [error; LANES];
            let setup = FacePlaneSetup { scale, denominator_error, ..FacePlaneSetup::default() };
            setup.of_box([2.0, -1.0, -1.0, 3.0, 1.0, 1.0]).bounds_from_above()
        };
        assert!(bounds(1.0, 1.9), "the near face is two metres away, give or take 1.9");
        assert!(!bounds(1.0, 2.0), "the near face may be where the eye is");
        assert!(!bounds(f64::MAX, 0.0), "the near face is too far away");
    }

    #[test]
    fn ranges_of_squares_are_those_of_rectangles() {
        let mut random = random(9);
        for _ in 0..2_000 {
            let mut lanes = |size: f64| [0; LANES].map(|_| random(-size, size));
            let mut box_planes = BoxFacePlanes {
                slope: [lanes(0.1), lanes(0.1)],
                constant: lanes(4.0),
                upper: lanes(1.0).map(|side| if side > 0.0 { 0.0 } else { f64::INFINITY }),
                lower: [0.0; LANES],
            };
            box_planes.lower = box_planes.upper.map(|upper| if upper > 0.0 { 0.0 } else { f64::INFINITY });
            (box_planes.upper[6], box_planes.upper[7]) = (f64::INFINITY, f64::INFINITY);
            (box_planes.lower[6], box_planes.lower[7]) = (f64::INFINITY, f64::INFINITY);
            let [left, top, size] = [40.0, 64.0, 8.0];
            let [most, least] = box_planes.ranges([left, top], size);
            for i in 0..LANES {
                let x = left + size * i as f64;
                let own = box_planes.range([x, x + size, top, top + size]);
                for (a, b) in own.into_iter().zip([most[i], least[i]]) {
                    assert!(a == b || (a - b).abs() < 1e-12, "square {i}: {b} instead of {a}");
                }
            }
        }
    }

    #[test]
    fn a_plane_is_nearer_than_a_bound_where_it_is_at_all_corners() {
        let mut box_planes = BoxFacePlanes {
            slope: [[0.0; LANES]; 2],
            constant: [0.5; LANES],
            upper: [0.0; LANES],
            lower: [f64::INFINITY; LANES],
        };
        box_planes.slope = [
            [0.25, -0.25, 0.125, -0.125, 0.0, 0.5, -0.5, 0.0],
            [0.125, 0.25, -0.25, -0.5, 0.0, -0.25, 0.5, 0.25],
        ];
        box_planes.upper[7] = f64::INFINITY;
        let sides @ [left, right, top, bottom] = [8.0, 13.0, 16.0, 24.0];
        let (mut yes, mut no) = (0, 0);
        for i in 0..625 {
            let [a, b, c] = [i % 5, i / 5 % 5, i / 25].map(|k| f64::from(k) * 0.25 - 0.5);
            let below = box_planes.below([a, b, c * 4.0], sides);
            for lane in 0..LANES {
                let at = |x: f64, y: f64| {
                    (a - box_planes.slope[0][lane]) * x + (b - box_planes.slope[1][lane]) * y + c * 4.0 - 0.5
                };
                let all = [(left, top), (right, top), (left, bottom), (right, bottom)];
                let before = all.iter().all(|&(x, y)| at(x, y) > box_planes.upper[lane]);
                assert_eq!(below[lane], before, "{a} {b} {c}, side {lane}");
                *(if before { &mut yes } else { &mut no }) += 1;
            }
        }
        assert!(yes > 500 && no > 500, "{yes} {no}");
    }
}
