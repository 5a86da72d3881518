//! Tests of the error bounds of [`ViewProjection`] against arithmetic of twice the precision.

use visibility_core::glam::{DMat4, DVec3, DVec4};
use visibility_core::view::{ClipRow, ViewProjection};
use visibility_core::{
    View,
    view::{Depth, Eye},
};
use visibility_testing::cameras::DEPTHS;
use visibility_testing::{Random, judged, told_enough};

/// A number as an unevaluated sum of two floats, precise to about 100 bits (Dekker, "A Floating-Point
/// Technique for Extending the Available Precision", 1971).
#[derive(Clone, Copy, Debug)]
struct Twice(f64, f64);

impl Twice {
    fn sum(a: f64, b: f64) -> Self {
        let s = a + b;
        let t = s - a;
        Self(s, (a - (s - t)) + (b - t))
    }

    fn product(a: f64, b: f64) -> Self {
        let p = a * b;
        Self(p, a.mul_add(b, -p))
    }

    fn plus(self, other: Self) -> Self {
        let (high, low) = (Self::sum(self.0, other.0), Self::sum(self.1, other.1));
        let first = Self::sum(high.0, high.1 + low.0);
        Self::sum(first.0, first.1 + low.1)
    }

    fn times(self, other: Self) -> Self {
        let p = Self::product(self.0, other.0);
        Self::sum(p.0, p.1 + self.0 * other.1 + self.1 * other.0)
    }

    fn minus(self, value: f64) -> f64 {
        self.plus(Self(-value, 0.0)).0
    }
}

/// Returns the value of a sum of clip matrix rows, times `factor`, at `point`, which is relative to `origin`:
/// in twice the precision of `f64`, as the reference for error bounds.
fn exact(rows: &[DVec4], factor: f64, view: &View, origin: DVec3, point: DVec3) -> Twice {
    let mut value = Twice(0.0, 0.0);
    for row in rows {
        for axis in 0..3 {
            let shift = Twice::sum(origin[axis], -view.origin()[axis]);
            let local = Twice(point[axis], 0.0).plus(shift);
            value = value.plus(local.times(Twice(row[axis], 0.0)));
        }
        value = value.plus(Twice(row.w, 0.0));
    }
    value.times(Twice(factor, 0.0))
}

/// Returns a view with a random clip matrix whose eye is within some metres of `near`, and that matrix.
/// `None` if the matrix is singular or the view is parallel.
fn random_view(random: &mut Random, near: DVec3, origin: DVec3) -> Option<(View, DMat4)> {
    let vector = |random: &mut Random| DVec3::from_array([(); 3].map(|()| random.fine_unit() * 2.0 - 1.0));
    let eye = near + vector(random);
    let mut rows = [(); 4].map(|()| {
        let linear = vector(random) * 2f64.powi((random.fine_unit() * 24.0) as i32 - 12);
        linear.extend(-linear.dot(eye))
    });
    rows[2].w += random.fine_unit();
    let matrix = DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
    let depth = DEPTHS[(random.fine_unit() * 6.0) as usize];
    let view = View::from_clip_from_world(matrix, depth).ok()?.relative_to(origin).ok()?;
    matches!(view.eye(origin), Eye::Point(_)).then_some((view, matrix))
}

/// Returns every row of a projection, with the rows of the clip matrix that it is a sum of and the factor by
/// which that sum is scaled.
fn rows(projection: &ViewProjection, view: &View, m: &DMat4) -> Vec<(ClipRow, Vec<DVec4>, f64)> {
    let [x, y, z, w] = [0, 1, 2, 3].map(|i| m.row(i));
    let near = match view.depth() {
        Depth::NegativeOneToOne | Depth::NegativeOneToOneInfinite => vec![w, z],
        Depth::ZeroToOne | Depth::ZeroToOneInfinite => vec![z],
        Depth::Reversed | Depth::ReversedInfinite => vec![w, -z],
    };
    let [columns, lines] = projection.pixels(1270.0, 718.0);
    // Rows are scaled by a common power of two, and the near plane's row by one of its own.
    let factor = |row: ClipRow, of: DVec4| {
        let axis = (0..3).max_by(|&a, &b| of[a].abs().total_cmp(&of[b].abs())).unwrap();
        2f64.powi((row.linear[axis] / of[axis]).log2().round() as i32)
    };
    let scale = factor(projection.w(), w);
    let near_scale = factor(projection.near(), near.iter().sum());
    vec![
        (projection.x(), vec![x], scale),
        (projection.y(), vec![y], scale),
        (projection.w(), vec![w], scale),
        (projection.near(), near, near_scale),
        (columns, vec![x, w], scale * 635.0),
        (lines, vec![w, -y], scale * 359.0),
    ]
}

#[test]
fn rows_are_within_their_error_of_the_exact_value() {
    let mut random = Random(11);
    let mut closest: f64 = 0.0;
    for case in 0..20_000 {
        let scale = |random: &mut Random| 10f64.powi((random.fine_unit() * 12.0) as i32 - 3);
        let vector =
            |random: &mut Random| DVec3::from_array([(); 3].map(|()| random.fine_unit() * 2.0 - 1.0));
        // The greatest error is that of the constant far from the view's origin, of the anchor far from the
        // scene's origin, and of the products far from the eye.
        let (local, view_origin, origin, reach) = match case % 4 {
            0 => (vector(&mut random) * scale(&mut random), DVec3::ZERO, DVec3::ZERO, 0.0),
            1 => {
                let origin = vector(&mut random) * scale(&mut random) * 1e3;
                (vector(&mut random) * 1e-3, origin, vector(&mut random), 0.0)
            }
            2 => (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO, scale(&mut random)),
            _ => {
                let [a, b, c] = [(); 3].map(|()| vector(&mut random) * scale(&mut random));
                (a, b, c, scale(&mut random))
            }
        };
        let Some((view, matrix)) = random_view(&mut random, local, view_origin) else { continue };
        let projection = ViewProjection::new(&view, origin);
        let point = projection.anchor() + vector(&mut random) * reach;
        for (number, (row, parts, factor)) in rows(&projection, &view, &matrix).into_iter().enumerate() {
            let (value, error) = row.at(point - projection.anchor());
            let off = exact(&parts, factor, &view, origin, point).minus(value).abs();
            assert!(off <= error, "case {case}, row {number}: {off:e} off, {error:e} allowed");
            closest = closest.max(off / error);
        }
    }
    judged(20_000);
    told_enough(closest > 0.1, format_args!("bounds are several times too wide: {closest} of one is needed"));
}

#[test]
fn the_eye_is_within_its_error_of_the_exact_one() {
    let mut random = Random(3);
    let (mut found, mut off) = (0, 0);
    for case in 0..4000 {
        let most = if case % 2 == 0 { 9_000_000.0 } else { 90.0 };
        // In one case of four, origins far apart, whose difference is rounded.
        let far = if case % 4 == 1 { 1e9 } else { 0.0 };
        let [view_origin, origin] =
            [(); 2].map(|()| DVec3::from_array([(); 3].map(|()| random.fine_unit() * far)));
        let mut whole = |most: f64| ((random.fine_unit() * 2.0 - 1.0) * most).round();
        // Rows and eye are whole numbers, so that the matrix has exactly this eye.
        let eye = DVec3::new(whole(most), whole(most), whole(most));
        let rows = [(); 4].map(|()| DVec3::new(whole(1e6), whole(1e6), whole(1e6)));
        let mut rows = rows.map(|row| row.extend(-row.dot(eye)));
        rows[2].w -= 1e6;
        let matrix = DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
        let Ok(view) = View::from_clip_from_world(matrix, Depth::ZeroToOne) else { continue };
        let view = view.relative_to(view_origin).expect("a finite origin");
        let projection = ViewProjection::new(&view, origin);
        let (Eye::Point(found_eye), error) = (projection.eye(), projection.eye_error()) else { continue };
        if !error.is_finite() {
            continue;
        }
        let distance = DVec3::from_array([0, 1, 2].map(|axis| {
            let exact = Twice::sum(view_origin[axis], -origin[axis]).plus(Twice(eye[axis], 0.0));
            exact.minus(found_eye[axis])
        }));
        let distance = distance.length();
        assert!(distance <= error, "{eye}: {distance} off, {error} allowed");
        assert!(error < 1.0, "{eye}: {error}");
        (found, off) = (found + 1, off + u32::from(distance > 0.0));
    }
    judged(found);
    told_enough(found > 3000 && off > 500, format_args!("{off} of {found}"));
}

#[test]
fn the_direction_of_a_parallel_view_is_within_its_error_of_the_exact_one() {
    let mut random = Random(5);
    let mut off = 0;
    for _ in 0..4000 {
        let mut whole = || ((random.fine_unit() * 2.0 - 1.0) * 1e5).round();
        // `along` is an exact cross product of whole numbers, and the depth row grows along it.
        let [a, b] = [(); 2].map(|()| DVec3::new(whole(), whole(), whole()));
        let along = a.cross(b);
        if along == DVec3::ZERO {
            continue;
        }
        let depth = (along / along.abs().max_element()).extend(0.25);
        let matrix = DMat4::from_cols(a.extend(3.0), b.extend(-2.0), depth, DVec4::W).transpose();
        let Ok(view) = View::from_clip_from_world(matrix, Depth::ZeroToOne) else { continue };
        let projection = ViewProjection::new(&view, DVec3::ZERO);
        let Eye::Direction(found) = projection.eye() else { panic!("a parallel view has no eye") };
        // The sine of the angle between the two directions; the product is exact but for its last rounding.
        let distance = found.cross(along / along.length()).length();
        let error = projection.eye_error();
        assert!(distance <= error && error < 1e-6, "{distance:e} off, {error:e} allowed");
        off += u32::from(distance > 0.0);
    }
    assert!(off > 500, "directions that are off at all: {off}");
}

#[test]
fn orientation_is_that_of_a_triangle_that_turns_its_back() {
    let mut random = Random(7);
    let (mut plain, mut mirrored) = (0, 0);
    for case in 0..2000 {
        let vector =
            |random: &mut Random| DVec3::from_array([(); 3].map(|()| random.fine_unit() * 2.0 - 1.0));
        let near = vector(&mut random);
        let Some((view, matrix)) = random_view(&mut random, near, DVec3::ZERO) else { continue };
        let projection = ViewProjection::new(&view, DVec3::ZERO);
        let Eye::Point(eye) = projection.eye() else { continue };
        let [a, b, c] = [(); 3].map(|()| vector(&mut random) * 9.0);
        let normal = (b - a).cross(c - a);
        // The determinant of clip-space x, y and w keeps its sign behind the eye.
        if normal.dot(a - eye).abs() < 1e-6 {
            continue;
        }
        let [b, c] = if normal.dot(a - eye) > 0.0 { [b, c] } else { [c, b] };
        let [p, q, r] = [a, b, c].map(|v| {
            let clip = matrix * v.extend(1.0);
            DVec3::new(clip.x, clip.y, clip.w)
        });
        let determinant = p.dot(q.cross(r));
        if determinant.abs() > 1e-9 {
            assert_eq!(projection.orientation(), determinant.signum(), "case {case}");
            *if determinant > 0.0 { &mut plain } else { &mut mirrored } += 1;
        }
    }
    judged(plain + mirrored);
    told_enough(plain > 300 && mirrored > 300, format_args!("{plain} plain, {mirrored} mirrored"));
}
