//! Tests of projections against exact arithmetic.

use super::*;
use visibility_testing::Random;

impl ClipProjection {
    /// Returns the projection of an eye at `x` on the x axis that looks along +z: the direction of a point is
    /// the point itself, relative to that eye. `known_at` is where the eye is believed to be. Rows are off by
    /// `row_error`.
    pub(crate) fn along_z(x: f64, known_at: f64, eye_error: f64, row_error: f64) -> Self {
        let row = |linear, constant, error| ClipRow { linear, constant, error };
        Self {
            rows: DVec3::AXES.map(|axis| row(axis, 0.0, row_error)),
            near: row(DVec3::Z, -0.1, 0.0),
            anchor: x * DVec3::X,
            eye: Eye::Point(known_at * DVec3::X),
            eye_error,
            back: DMat3::IDENTITY,
            back_size: 1.0,
            back_error: 0.0,
            turn: 1.0,
        }
    }
}

/// Generator of pseudo-random whole numbers.
struct Whole(Random);

impl Whole {
    /// Returns a random whole number from -2^bits to 2^bits.
    fn next(&mut self, bits: u32) -> i64 {
        (self.0.bits() >> (63 - bits)) as i64 - (1 << bits)
    }
}

/// Returns the determinant of three integer vectors, computed exactly.
fn determinant(a: [i64; 3], b: [i64; 3], c: [i64; 3]) -> i128 {
    let [a, b, c] = [a, b, c].map(|v| v.map(i128::from));
    (a[1] * b[2] - a[2] * b[1]) * c[0]
        + (a[2] * b[0] - a[0] * b[2]) * c[1]
        + (a[0] * b[1] - a[1] * b[0]) * c[2]
}

/// Random planes through two directions. Components are whole multiples of 2^-40 and the directions are
/// close together, so that products are rounded in `f64` while 128 bits hold the exact determinants.
#[test]
fn planes_through_close_directions_tell_sides_only_where_they_exactly_are() {
    let mut whole = Whole(Random(5));
    let unit = (1i64 << 40) as f64;
    let direction = |v: [i64; 3]| Direction { v: v.map(|x| x as f64 / unit), error: 0.0, size: 1.0 };
    let mut decided = 0;
    for round in 0..100_000 {
        let a = [whole.next(39), whole.next(39), 1 << 40];
        let step = [whole.next(28), whole.next(28)];
        let b = [a[0] + step[0], a[1] + step[1], a[2]];
        let times = whole.next(6);
        // Exactly in the plane, or a little beside it.
        let aside = if round % 2 == 0 { 0 } else { whole.next(round % 12) };
        let c = [a[0] + times * step[0] + aside, a[1] + times * step[1], a[2]];
        let Some(line) = Line::through(&direction(a), &direction(b)) else { continue };
        let at = line.at(direction(c).v);
        if at.abs() > line.slack {
            decided += 1;
            assert_eq!(at.signum() as i128, determinant(a, b, c).signum(), "{a:?} {b:?} {c:?}");
        }
    }
    assert!(decided > 10_000, "{decided}");
}

/// Random planes, and eyes within a few units in the last place of the plane; the oracle is exact 128-bit
/// arithmetic.
#[test]
fn an_eye_is_before_a_plane_only_if_it_exactly_is() {
    let mut whole = Whole(Random(6));
    let (mut before, mut rounded) = (0, 0);
    for round in 0..100_000 {
        let (n, p) = ([(); 3].map(|()| whole.next(50)), [(); 3].map(|()| whole.next(23)));
        let [normal, eye] = [n, p].map(|v| DVec3::from_array(v.map(|x| x as f64)));
        let offset = -normal.dot(eye) * (1.0 + f64::from(round % 64 - 32) * U);
        let view = ClipProjection { eye: Eye::Point(eye), eye_error: 0.0, ..ClipProjection::BLIND };
        let approach = view.approach(normal, offset).unwrap();
        let exact = (0..3).map(|i| i128::from(n[i]) * i128::from(p[i])).sum::<i128>() + offset as i128;
        let off = (approach.height as i128 - exact).abs();
        assert!(
            off as f64 <= approach.height_error,
            "{eye} is {exact} before {normal} {offset}: {approach:?}"
        );
        rounded += usize::from(off > 0);
        if view.is_before(normal, offset) {
            before += 1;
            assert!(exact > 0, "{eye} is {exact} before {normal} {offset}");
        }
    }
    assert!(before > 5_000 && rounded > 5_000, "{before} before planes, {rounded} heights rounded");
}

/// Rows and points of whole numbers, whose products exceed the precision of a double. The oracle moves a
/// point by the placing error to the worse side of each row.
#[test]
fn a_direction_is_that_of_the_point_wherever_the_point_is_placed() {
    let mut whole = Whole(Random(9));
    let (mut rounded, mut refused) = (0, 0);
    for round in 0..50_000 {
        let mut rows = [(); 3].map(|()| [(); 3].map(|()| whole.next(36)));
        let point = [(); 3].map(|()| whole.next(20));
        if round % 4 == 0 && point[0].abs() > 1 << 10 {
            // The first row nearly vanishes at the point.
            let rest = point[1] * rows[0][1] + point[2] * rows[0][2];
            rows[0][0] = -rest / point[0];
        }
        // In powers of two.
        let placing = [None, Some(-6), Some(-9), Some(6)][round % 7 % 4];
        let placing_error = placing.map_or(0.0, |power| 2f64.powi(power));
        let row = |row: [i64; 3]| ClipRow {
            linear: DVec3::from_array(row.map(|x| x as f64)),
            constant: 0.0,
            error: 0.0,
        };
        let projection = ClipProjection { rows: rows.map(row), ..ClipProjection::BLIND };
        let exact = rows.map(|row| (0..3).map(|i| i128::from(row[i]) * i128::from(point[i])).sum::<i128>());
        let p = DVec3::from_array(point.map(|x| x as f64));
        let Some(direction) = projection.direction(p, placing_error) else {
            refused += 1;
            continue;
        };
        // In multiples of 2^-60.
        let scaled = |x: f64| (x * 2f64.powi(60)) as i128;
        let size = exact.iter().map(|x| x.abs()).max().unwrap_or(0);
        for (i, (row, exact)) in rows.iter().zip(exact).enumerate() {
            let sum = row.iter().map(|&x| i128::from(x.abs())).sum::<i128>();
            let moved = placing.map_or(0, |power| sum << (60 + power));
            let off = (scaled(direction.v[i]) * size - (exact << 60)).abs();
            let most = scaled(direction.error) * size;
            assert!(off + moved <= most, "round {round}: {p}, row {i}: {direction:?}");
            rounded += usize::from(off > 0);
        }
    }
    assert!(
        rounded > 50_000 && refused > 100,
        "components rounded: {rounded}, directions refused: {refused}"
    );
}

#[test]
fn a_box_is_outside_of_the_eye_only_beyond_the_clearance() {
    let eye = DVec3::new(1.0, 2.0, 3.0);
    let at = |eye_error| ClipProjection { eye: Eye::Point(eye), eye_error, ..ClipProjection::BLIND };
    for axis in DVec3::AXES {
        for sign in [1.0, -1.0] {
            let around = |distance: f64| {
                let [a, b] = [distance, distance + 5.0].map(|x| eye + sign * x * axis);
                [a.min(b) - (DVec3::ONE - axis), a.max(b) + (DVec3::ONE - axis)]
            };
            assert!(at(0.0).is_outside(&around(2.0), 1.0), "beyond the clearance");
            assert!(!at(0.6).is_outside(&around(1.5), 1.0), "within the clearance from where the eye may be");
            assert!(at(0.4).is_outside(&around(1.5), 1.0), "beyond the clearance wherever the eye is");
            assert!(!at(0.0).is_outside(&around(1.0), 1.0), "at the clearance");
            assert!(!at(0.0).is_outside(&around(0.0), 0.0), "the eye on a side of the box");
            assert!(!at(0.0).is_outside(&around(-1.0), 0.0), "the eye in the box");
            // The eye may be at the box.
            assert!(!at(1.0).is_outside(&around(1.0), 0.0), "an eye that is known to a metre");
            assert!(!at(1.0).is_outside(&around(2.05), 1.0), "the same eye, with a clearance");
            assert!(!at(0.0).is_outside(&around(f64::NAN), 0.0), "a box that is not a number");
            assert!(!at(f64::INFINITY).is_outside(&around(9.0), 0.0), "an eye that is anywhere");
        }
    }
}

/// Directions that are off by their errors, to the side on which the error of the plane is greatest. Exact
/// directions are corners of the cube of directions, where errors add up most; a third is exactly in the
/// plane of the first two.
#[test]
fn planes_through_uncertain_directions_leave_the_side_of_what_is_in_the_exact_plane_open() {
    let mut random = Random(10);
    let one = 1i64 << 40;
    let cross = |a: [i64; 3], b: [i64; 3]| {
        [0, 1, 2].map(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
    };
    let mut greatest = [0.0f64; 3];
    for round in 0..30_000 {
        let [a, c] = [(); 2].map(|()| [(); 3].map(|()| i64::from(random.between(-1, 1))));
        let times = 1 << (1 + round % 5);
        let b = [0, 1, 2].map(|i| a[i] * one + (c[i] - a[i]) * (one / times));
        // Errors of the first direction, of the second, and of both, in units of 2^-40.
        let kind = round % 3;
        let [first, second] = [[1024, 0], [0, 1024], [1024, 1024]][kind];
        let turn = random.pick(&[1, -1]);
        let moved = |v: [i64; 3], by: [i64; 3], error: i64| Direction {
            v: [0, 1, 2].map(|i| (v[i] + error * turn * by[i].signum()) as f64 / one as f64),
            error: error as f64 / one as f64,
            size: 1.0,
        };
        // The determinant of `a`, `b` and `c` changes with `a` as `b x c`, and with `b` as `c x a`.
        let (by_a, by_b) = (cross(a, c), cross(c, a));
        let uncertain = moved(a.map(|x| x * one), by_a, first);
        let Some(line) = Line::through(&uncertain, &moved(b, by_b, second)) else { continue };
        assert_eq!(line.n.iter().fold(0.0f64, |most, x| most.max(x.abs())), 1.0, "scale of {line:?}");
        let share = line.at(c.map(|x| x as f64)).abs() / line.slack;
        assert!(share <= 1.0, "round {round}: {a:?} and {c:?} are in the plane: {share} of the slack");
        greatest[kind] = greatest[kind].max(share);
    }
    assert!(greatest.iter().all(|&share| share > 0.6), "parts of the slack that are reached: {greatest:?}");
}

#[test]
fn directions_planes_and_boxes_are_refused_from_an_error_of_2_to_the_minus_24_on() {
    for (share, known) in [(0.99, true), (1.01, false)] {
        let error = share * 2f64.powi(-24);
        // The plane is off by the errors of both directions, in two factors each.
        let [a, b] =
            [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]].map(|v| Direction { v, error: error / 4.0, size: 1.0 });
        assert_eq!(Line::through(&a, &b).is_some(), known, "{share}: a plane");
        let rows = DVec3::AXES.map(|linear| ClipRow { linear, constant: 0.0, error });
        let projection = ClipProjection { rows, ..ClipProjection::BLIND };
        assert_eq!(projection.direction(DVec3::Z, 0.0).is_some(), known, "{share}: a direction");
        let bounds = Aabb::from_arrays([0.0, 0.0, 1.0], [0.0, 0.0, 1.0]);
        assert_eq!(projection.cone(&bounds).is_some(), known, "{share}: a box");
    }
}

/// Rows, boxes and lines of whole numbers, with a constant term for which a corner of the box is on the line
/// up to the errors of the rows, to some ten units in the last place.
#[test]
fn a_box_is_on_one_side_of_a_line_only_if_all_corners_exactly_are() {
    let mut whole = Whole(Random(11));
    let (mut told, mut open) = (0, 0);
    for round in 0..60_000 {
        let bits = [8, 30][round % 2];
        let linear = [(); 3].map(|()| [(); 3].map(|()| whole.next(bits)));
        let [low, side] = [(); 2].map(|()| [(); 3].map(|()| whole.next(16)));
        let side = side.map(i64::abs);
        let n = [(); 3].map(|()| whole.0.pick(&[8i64, 7, -7, -8]));
        // Errors of a row in units, all of which count fully along a line with coefficients near 1.
        let errors = [(); 3].map(|()| if round % 3 == 0 { 0 } else { whole.next(6).abs() });
        let corner = |k: usize| [0, 1, 2].map(|i| low[i] + if k >> i & 1 != 0 { side[i] } else { 0 });
        let value = |row: usize, p: [i64; 3]| -> i128 {
            (0..3).map(|i| i128::from(linear[row][i]) * i128::from(p[i])).sum()
        };
        let along = |p| (0..3).map(|row| i128::from(n[row]) * value(row, p)).sum::<i128>();
        let error: i64 = (0..3).map(|row| n[row].abs() * errors[row]).sum();
        // The constant of the first row moves the corner of the least or greatest value to near the line,
        // by a part of the error.
        let turn = if round % 4 < 2 { 1 } else { -1 };
        let chosen = (0..8).map(corner).min_by_key(|&p| turn * along(p)).unwrap_or_default();
        let wanted = i128::from(whole.next(4)) * i128::from(error) / 10;
        let constant = ((wanted - along(chosen)) / i128::from(n[0])) as f64;
        let row = |i: usize| ClipRow {
            linear: DVec3::from_array(linear[i].map(|x| x as f64)),
            constant: if i == 0 { constant } else { 0.0 },
            error: errors[i] as f64,
        };
        let projection = ClipProjection { rows: [row(0), row(1), row(2)], ..ClipProjection::BLIND };
        let point = |k: usize| DVec3::from_array(corner(k).map(|x| x as f64)).as_vec3();
        let Some(cone) = projection.cone(&Aabb::new(point(0), point(7))) else { continue };
        let line = n.map(|x| x as f64 / 8.0);
        let (least, greatest) = cone.span(line);
        for k in 0..8 {
            let exact = along(corner(k)) + i128::from(n[0]) * constant as i128;
            assert!(
                least <= cone.slack || exact > i128::from(error),
                "round {round}, corner {k}: {least}, {cone:?}"
            );
            assert!(
                greatest >= -cone.slack || exact < -i128::from(error),
                "round {round}, corner {k}: {greatest}, {cone:?}"
            );
            let at = dot(line, cone.corner(k));
            let few = 1e-14;
            assert!(
                (least - few..=greatest + few).contains(&at),
                "round {round}, corner {k}: {at} of {cone:?}"
            );
        }
        if least > cone.slack || greatest < -cone.slack { told += 1 } else { open += 1 }
    }
    assert!(told > 1_000 && open > 3_000, "{told} boxes on one side, {open} undecided");
}

/// Planes that the ray through a corner of the image meets at about the same distance. The oracle moves the
/// eye, the matrix and the direction by their errors, to where the order of the planes changes first.
#[test]
fn a_plane_is_met_first_only_if_it_is_wherever_eye_and_rays_are() {
    let mut random = Random(12);
    let mut told = [0; 3];
    for round in 0..60_000 {
        let kind = round % 3;
        let [eye_error, back_error, error] = core::array::from_fn(|i| if i == kind { 1e-4 } else { 0.0 });
        let eye = random.vector(5.0);
        let back = DMat3::from_cols(random.vector(1.0), random.vector(1.0), random.vector(1.0));
        let rows = [0, 1, 2].map(|i| back.row(i));
        let back_size = rows.iter().fold(0.0f64, |most, row| most.max(row.abs().element_sum()));
        let projection = ClipProjection {
            eye: Eye::Point(eye),
            eye_error,
            back,
            back_size,
            back_error,
            ..ClipProjection::BLIND
        };
        let v = [1.0, random.pick(&[1.0, -1.0]), random.pick(&[1.0, -1.0])];
        let along = projection.in_space(v);
        // Normals that are nearly opposite, and nearly perpendicular to the ray.
        let normal = DVec3::from_array(core::array::from_fn(|_| random.pick(&[1.0, -1.0])));
        let tilt = random.range(0.01, 0.5) * along;
        let [first, second] = [normal, -normal].map(|n| {
            let n = (n - along * (n.dot(along) / along.length_squared()) - tilt).normalize_or_zero();
            (n, -n.dot(along))
        });
        let height = random.range(0.5, 5.0);
        // The second plane's height at which both planes are met at once, and by how much errors change the
        // difference of both sides there.
        let ((n, rate), (m, other_rate)) = (first, second);
        if rate < 1e-3 || other_rate < 1e-3 {
            continue;
        }
        let turn = n * (height * rate.recip() * other_rate) - m * height;
        let worst = eye_error * (m * rate - n * other_rate).length()
            + back_error * turn.abs().element_sum()
            + error * [back.x_axis, back.y_axis, back.z_axis].map(|x| turn.dot(x).abs()).iter().sum::<f64>();
        for (share, may_be) in [(random.range(0.0, 0.98), false), (12.0, true)] {
            let second_height = (height * other_rate + share * worst) / rate;
            let [first, second] = [(n, height), (m, second_height)]
                .map(|(n, height)| projection.approach(n, height - n.dot(eye)).unwrap());
            let is = projection.is_met_first(&first, &second, &[v], error);
            assert!(may_be || !is, "round {round}: {share} of {worst}, {first:?} {second:?}");
            told[kind] += usize::from(is);
        }
    }
    assert!(told.iter().all(|&told| told > 5_000), "planes met first, by kind of error: {told:?}");
    // An eye that may be behind the second plane, along a ray that goes away from the first.
    let eye = Eye::Point(DVec3::ZERO);
    let exact =
        ClipProjection { back: DMat3::IDENTITY, back_size: 1.0, back_error: 0.0, ..ClipProjection::BLIND };
    for (eye_error, is) in [(0.0, false), (0.5, false)] {
        let projection = ClipProjection { eye, eye_error, ..exact };
        let [first, second] = [(DVec3::Z, 1.0), (DVec3::new(0.99f64.sqrt(), 0.0, -0.1), 0.1)]
            .map(|(n, offset)| projection.approach(n, offset).unwrap());
        let found = projection.is_met_first(&first, &second, &[[0.0, 0.0, 1.0]], 0.0);
        assert_eq!(found, is, "an eye known to {eye_error}");
    }
}

#[test]
fn an_eye_is_before_a_plane_only_beyond_twice_its_error() {
    let at = |eye, eye_error| ClipProjection { eye, eye_error, ..ClipProjection::BLIND };
    for (error, is) in [(0.149, true), (0.151, false)] {
        let eye = Eye::Point(DVec3::new(0.0, 1.3, 0.0));
        assert_eq!(at(eye, error).is_before(DVec3::Y, -1.0), is, "a point known to {error}");
        let along = Eye::Direction(DVec3::new(0.0, -0.3, 0.91f64.sqrt()));
        assert_eq!(at(along, error).is_before(DVec3::Y, -1.0), is, "a direction known to {error}");
    }
    for (units, is) in [(9.0, true), (7.0, false)] {
        let along = Eye::Direction(DVec3::new(0.0, -units * U, 1.0));
        assert_eq!(at(along, 0.0).is_before(DVec3::Y, 0.0), is, "against the normal by {units} units");
    }
}

/// The near-plane function is `x/2 + z - 1` for points, and rays through the corners of the image run along
/// `(+-1, +-1, 1)`.
#[test]
fn beyond_the_clearance_all_that_is_in_the_image_is_beyond_the_near_plane() {
    let near = |x: f64, constant: f64, error| ClipRow { linear: DVec3::new(x, 0.0, 1.0), constant, error };
    let at = |near, eye_error, back_error| {
        let (eye, back) = (Eye::Point(DVec3::ZERO), DMat3::IDENTITY);
        ClipProjection { eye, near, back, eye_error, back_error, back_size: 1.0, ..ClipProjection::BLIND }
            .clearance()
    };
    // The ray along (-1, +-1, 1) rises slowest: 1/2 for each step of its length, 3^(1/2).
    let farthest = 2.0 * 3f64.sqrt();
    let is_about = |clear: f64, least: f64| (least..1.11 * least).contains(&clear);
    for x in [0.5, -0.5] {
        assert!(is_about(at(near(x, -1.0, 0.0), 0.0, 0.0), farthest), "an exact view");
        assert!(is_about(at(near(x, -1.0, 0.5), 0.0, 0.0), 1.5 * farthest), "the function off by a half");
        assert!(is_about(at(near(x, -1.0, 0.0), 1.0, 0.0), 2.5 * farthest), "the eye off by a metre");
        // The slope of 1/2 is off by 3/2 of the error of the ray, whose length grows by twice the error.
        let length = (3f64.sqrt() + 0.4) / 3f64.sqrt();
        assert!(
            is_about(at(near(x, -1.0, 0.0), 0.0, 0.2), 2.5 * length * farthest),
            "the ray off by a fifth"
        );
    }
    assert_eq!(at(near(0.0, 0.0, 0.0), 0.0, 0.0), 0.0, "an eye on the near plane");
    assert_eq!(at(near(0.5, 1.0, 0.0), 0.0, 0.0), f64::INFINITY, "an eye beyond the near plane");
    for x in [1.5, -1.5] {
        assert_eq!(at(near(x, -1.0, 0.0), 0.0, 0.0), f64::INFINITY, "rays that go away from the near plane");
    }
    let back = ClipRow { linear: DVec3::NEG_Z, constant: 1.0, error: 0.0 };
    assert_eq!(at(back, 0.0, 0.0), f64::INFINITY, "a near plane that is met from beyond");
}

#[test]
fn points_are_beyond_the_near_plane_only_beyond_its_error_and_their_own() {
    let near = ClipRow { linear: DVec3::new(1.0, -2.0, 0.5), constant: 0.0, error: 0.25 };
    let projection = ClipProjection { near, ..ClipProjection::BLIND };
    for (x, is) in [(0.251, true), (0.25, false), (0.249, false)] {
        assert_eq!(projection.is_point_beyond_near(DVec3::X * x), is, "at {x}");
    }
    // Each coordinate may be off by an eighth of a metre.
    let (value, error) = projection.beyond_near(DVec3::X, 0.125);
    assert!(value == 1.0 && (error - 0.25 - 3.5 / 8.0).abs() < 1e-12, "error of a placed point: {error}");
}

/// Matrices of whole numbers, of which the exact inverse is a matrix of whole numbers divided by the
/// determinant.
#[test]
fn bounds_on_an_inverse_hold_the_exact_one() {
    let mut whole = Whole(Random(13));
    let (mut rounded, mut loose) = (0, 0);
    for round in 0..20_000 {
        let bits = [2, 8, 16][round % 3];
        let columns = [(); 3].map(|()| [(); 3].map(|()| whole.next(bits)));
        let forth = DMat3::from_cols_array_2d(&columns.map(|column| column.map(|x| x as f64)));
        let [a, b, c] = columns;
        let exact = determinant(a, b, c);
        if exact == 0 {
            continue;
        }
        let back = forth.inverse();
        let (size, error) = inverse_error_bounds(forth, back);
        if error == f64::INFINITY {
            loose += 1;
            continue;
        }
        let v = [(); 3].map(|()| whole.next(1).signum());
        let product = back * DVec3::from_array(v.map(|x| x as f64));
        for (axis, product) in product.to_array().into_iter().enumerate() {
            // Cramer's rule, in multiples of 2^-60.
            let mut replaced = columns;
            replaced[axis] = v;
            let cramer = determinant(replaced[0], replaced[1], replaced[2]);
            let scaled = |x: f64| (x * 2f64.powi(60)) as i128;
            let off = (scaled(product) * exact - (cramer << 60)).abs();
            assert!(off <= (scaled(error) + 1) * exact.abs(), "round {round}: {product} of {forth}, {error}");
            assert!(product.abs() <= size, "round {round}: {product} of {forth}, at most {size}");
            rounded += usize::from(off > scaled(1e-17) * exact.abs());
        }
        assert!(error < 1e-3 * size, "round {round}: {error} of {size} for {forth}");
    }
    assert!(rounded > 1_000, "components that are rounded: {rounded}, matrices without a bound: {loose}");
    let nearly = DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.4));
    assert_eq!(inverse_error_bounds(nearly, DMat3::IDENTITY).1, f64::INFINITY, "a matrix that is no inverse");
}

#[test]
fn a_projection_has_the_errors_of_its_view() {
    let pose = visibility_core::Pose::look_at(DVec3::splat(1e6), DVec3::splat(1e6) + DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.5, 0.1, 100.0).unwrap();
    let (exact, own) = (ViewProjection::new(&view, DVec3::ZERO), ClipProjection::new(&view, DVec3::ZERO));
    assert_eq!(own.eye_error, exact.eye_error(), "error of the eye");
    assert!(own.eye_error > 0.0, "error of the eye: {own:?}");
    let forth = DMat3::from_cols_array_2d(&own.rows.map(|row| row.linear.to_array())).transpose();
    let bounds = inverse_error_bounds(forth, own.back);
    assert_eq!((own.back_size, own.back_error), bounds, "bounds on rays");
    assert!(own.back_error > 0.0 && own.back_error < 1e-12, "error of rays: {own:?}");
}
