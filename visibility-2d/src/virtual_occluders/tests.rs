//! Tests of the margins at which a hidden point, box or corner is decided.

use super::cell_solids::CellBox;
use super::chain::BackLine;
use super::grow::Grown;
use super::lines::{Point, left_of};
use super::umbra::Umbra;
use visibility_testing::Random;
use visibility_testing::sign_of_sum;

/// Returns the sign of twice the area of a triangle, exactly.
fn exact_turn(a: Point, b: Point, c: Point) -> i32 {
    let products = [(a.x, b.y), (-a.y, b.x), (b.x, c.y), (-b.y, c.x), (c.x, a.y), (-c.y, a.x)];
    sign_of_sum(products)
}

#[test]
fn what_is_left_of_a_line_is_left_of_it_exactly() {
    let mut random = Random(3);
    let (mut doubtful, mut decided) = (0, 0);
    for _ in 0..200_000 {
        let scale = [1e-3, 1.0, 1e6][random.below(3)];
        let mut coordinate = || scale * random.fine_range(0.5, 2.0);
        let (a, b) = (Point::exact(coordinate(), coordinate()), Point::exact(coordinate(), coordinate()));
        let part = random.fine_range(-2.0, 3.0);
        let along = |p: f64, q: f64| p + (q - p) * part;
        let c = Point::exact(along(a.x, b.x), along(a.y, b.y));
        let rounded = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        doubtful += usize::from(rounded >= 0.0 && exact_turn(a, b, c) < 0);
        if left_of(a, b, c) >= 0.0 {
            decided += 1;
            assert!(exact_turn(a, b, c) >= 0, "{a:?} {b:?} {c:?}");
        }
        let beside = Point::exact(c.x - 1e-12 * (b.y - a.y), c.y + 1e-12 * (b.x - a.x));
        if (b.x - a.x).abs() + (b.y - a.y).abs() > 0.1 * scale {
            assert!(left_of(a, b, beside) >= 0.0, "{a:?} {b:?} {beside:?}");
        }
    }
    assert!(doubtful > 1_000 && decided > 0, "{doubtful} {decided}");
}

#[test]
fn points_that_are_known_up_to_an_error_may_be_anywhere_within() {
    let mut random = Random(4);
    let mut decided = 0;
    for round in 0..40_000 {
        let mut errors = [[0.0, 0.05, 0.2], [0.3, 0.0, 0.0], [0.0, 0.3, 0.0], [0.2, 0.2, 0.2]][round % 4];
        errors.rotate_left(random.below(3));
        let points = errors.map(|error| {
            let mut coordinate = || random.fine_range(-1.0, 1.0);
            Point { x: coordinate(), y: coordinate(), error }
        });
        if left_of(points[0], points[1], points[2]) < 0.0 {
            continue;
        }
        decided += 1;
        // Each point is moved by its error along both axes, to either side.
        for corners in 0..64 {
            let mut bit = 0;
            let [a, b, c] = points.map(|p| {
                let mut by = || {
                    bit += 1;
                    if corners >> (bit - 1) & 1 != 0 { p.error } else { -p.error }
                };
                Point::exact(p.x + by(), p.y + by())
            });
            assert!(
                (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x) > -1e-12,
                "the corners {a:?} {b:?} {c:?} turn right"
            );
        }
    }
    assert!(decided > 3_000, "{decided}");
}

#[test]
fn points_are_identical_if_they_are_exact_and_equal() {
    let p = Point::exact(1.0, 2.0);
    assert!(p.is(p), "an exact point");
    assert!(!p.is(Point::exact(1.0, 3.0)) && !p.is(Point::exact(2.0, 2.0)), "points elsewhere");
    let doubtful = Point { error: 1e-9, ..p };
    assert!(!doubtful.is(doubtful) && !p.is(doubtful), "points of which an error is known");
}

/// Returns the umbra of a segment 10 m in front of a viewcell of 2 m. Eyes are 1 to 2 m high; lines of sight
/// rise by at most a quarter and stay above half a metre.
fn umbra() -> Umbra {
    let cell = CellBox { min: [-1.0, -2.0, 1.0], max: [1.0, 0.0, 2.0] };
    let ends = [Point::exact(-20.0, 10.0), Point::exact(20.0, 10.0)];
    Umbra::new(&Grown { ends, bottom: 0.5, slope: 0.25, error: 1e-12 }, &cell)
}

#[test]
fn boxes_are_hidden_up_to_the_line_the_ends_the_slope_and_the_bottom() {
    let umbra = umbra();
    let hides = |x: [f64; 2], y: [f64; 2], z: [f64; 2]| umbra.hides([x[0], y[0], z[0]], [x[1], y[1], z[1]]);
    // At 20 m from the viewcell, the slope is 5 m above the highest eye.
    assert!(hides([-1.0, 1.0], [20.0, 21.0], [0.5, 6.999_999]), "a box lower than the slope");
    assert!(!hides([-1.0, 1.0], [20.0, 21.0], [0.5, 7.000_001]), "over the top");
    assert!(hides([-1.0, 1.0], [10.000_001, 21.0], [0.5, 4.0]), "a box just behind the line");
    assert!(!hides([-1.0, 1.0], [9.999_999, 21.0], [0.5, 4.0]), "before the line");
    // The line from the corner (-1, -2) past the end at (-20, 10) is at x = -35.833 where y is 20.
    assert!(hides([-35.83, 1.0], [20.0, 20.0], [0.5, 4.0]), "a box just within the end");
    assert!(!hides([-35.84, 1.0], [20.0, 20.0], [0.5, 4.0]), "beside the end");
    assert!(hides([-1.0, 35.83], [20.0, 20.0], [0.5, 4.0]), "a box just within the other end");
    assert!(!hides([-1.0, 35.84], [20.0, 20.0], [0.5, 4.0]), "beside the other end");
    // Lines of sight from 1 m to the ground far behind the solids are above half a metre where they pass the
    // solids. Lines to the ground close behind them are not.
    assert!(hides([-1.0, 1.0], [24.0, 25.0], [0.1, 4.0]), "a box just above the bottom");
    assert!(!hides([-1.0, 1.0], [10.1, 11.0], [0.1, 4.0]), "below the bottom");
    assert!(!hides([f64::NAN, 1.0], [20.0, 21.0], [0.5, 4.0]), "a box with NaN");
}

#[test]
fn the_rectangle_is_within_the_slope_of_the_nearest_viewpoint() {
    let (ends, bottom, top) = umbra().rectangle();
    assert_eq!((ends, bottom), ([[-20.0, 10.0], [20.0, 10.0]], 0.5), "ends and bottom of the rectangle");
    assert!(top <= 4.5 && top > 4.499_999, "{top}");
}

#[test]
fn posts_on_the_line_or_beyond_it_are_not_before_it() {
    let line = BackLine::new([1e3, 1e3], [0.6, 0.8], 50.0);
    let at = |by: f64, error: f64| Point { x: 1e3 + 0.6 * by, y: 1e3 + 0.8 * by, error };
    assert!(
        line.is_before(at(49.999_999, 0.0)) && !line.is_before(at(49.999_999, 1e-5)),
        "a post before the line, and one known too badly"
    );
    assert!(
        !line.is_before(at(50.0, 0.0)) && !line.is_before(at(50.1, 0.0)),
        "posts on the line and beyond it"
    );
    for position in [-150.0, 0.0, 77.0] {
        let p = line.at(position);
        assert!(
            line.beyond(p.x, p.y).abs() < line.error && !line.is_before(p),
            "{position}: a point of the line"
        );
    }
}

/// A post whose coordinates err may be farther along both axes; and a line may be off by its own error.
#[test]
fn posts_are_before_a_line_by_all_errors() {
    let line = BackLine::new([1e3, 1e3], [0.6, 0.8], 50.0);
    let at = |by: f64, error: f64| Point { x: 1e3 + 0.6 * by, y: 1e3 + 0.8 * by, error };
    // An error of 1e-5 along both axes is 1.4e-5 along the normal.
    assert!(!line.is_before(at(50.0 - 1.39e-5, 1e-5)), "a post that may be on the line");
    assert!(line.is_before(at(50.0 - 3e-5, 1e-5)), "a post before the line by three times its error");
    let mut doubtful = line;
    doubtful.error = 0.1;
    assert!(!doubtful.is_before(at(49.91, 0.0)), "a line that may be behind the post");
    assert!(doubtful.is_before(at(49.5, 0.0)), "a post before the line by five times its error");
    // Far along the line, a post's own coordinates round by more than the line is off.
    let mut random = Random(5);
    let mut rounded = 0;
    for _ in 0..20_000 {
        let [nx, ny] = {
            let angle = random.fine_range(0.0, 6.3);
            [angle.cos(), angle.sin()]
        };
        let ([ox, oy], d) = ([random.fine_range(-9.0, 9.0), random.fine_range(-9.0, 9.0)], 5.0);
        let line = BackLine::new([ox, oy], [nx, ny], d);
        let position = random.fine_range(-1.0, 1.0) * 1e9;
        let post = Point::exact(ox + nx * d + ny * position, oy + ny * d - nx * position);
        let products = [(post.x, nx), (-ox, nx), (post.y, ny), (-oy, ny), (-d, 1.0)];
        if sign_of_sum(products) >= 0 {
            rounded += usize::from(line.beyond(post.x, post.y) < -line.error);
            assert!(!line.is_before(post), "{post:?} is on {line:?} or beyond it");
        }
    }
    assert!(rounded > 100, "{rounded} posts beyond the line seem to be before it");
}

/// The hidden segment may be off the line between its ends by an error: boxes are behind that as well.
#[test]
fn boxes_are_behind_the_segment_by_its_error() {
    let mut umbra = umbra();
    let hides = |umbra: &Umbra, y: f64| umbra.hides([-1.0, y, 0.5], [1.0, 21.0, 4.0]);
    assert!(hides(&umbra, 10.05), "a box behind the line");
    let cell = CellBox { min: [-1.0, -2.0, 1.0], max: [1.0, 0.0, 2.0] };
    let ends = [Point::exact(-20.0, 10.0), Point::exact(20.0, 10.0)];
    let grown = Grown { ends, bottom: 0.5, slope: 0.25, error: 0.1 };
    let (_, _, exact_top) = umbra.rectangle();
    umbra = Umbra::new(&grown, &cell);
    assert!(!hides(&umbra, 10.05) && !hides(&umbra, 10.09), "a box that may be before the segment");
    assert!(hides(&umbra, 10.5), "a box behind it by more");
    let (_, _, top) = umbra.rectangle();
    assert!(top < exact_top - 0.02, "{top}: the segment may be nearer by 0.1 m, a rise of 0.025 m");
}

/// Segments in all directions, with boxes at the line through their ends: exactly beyond it, or not hidden.
#[test]
fn hidden_boxes_are_beyond_the_segment_exactly() {
    let mut random = Random(6);
    let (mut hidden, mut doubtful) = (0, 0);
    for _ in 0..40_000 {
        let angle = random.fine_range(0.0, 6.3);
        let normal = [angle.cos(), angle.sin()];
        let d = random.fine_range(50.0, 200.0);
        let at = |along: f64, beside: f64| {
            [normal[0] * along + normal[1] * beside, normal[1] * along - normal[0] * beside]
        };
        let ends = [at(d, -4.0 * d), at(d, 4.0 * d)].map(|[x, y]| Point::exact(x, y));
        let cell = CellBox { min: [-0.1, -0.1, 1.0], max: [0.1, 0.1, 2.0] };
        let umbra = Umbra::new(&Grown { ends, bottom: 0.5, slope: 0.25, error: 0.0 }, &cell);
        let beyond = [0.0, 1e-14, 1e-13, 2e-13][random.below(4)];
        let [x, y] = at(d * (1.0 + beyond), random.fine_range(-1.0, 1.0) * d);
        let side = exact_turn(ends[1], ends[0], Point::exact(x, y));
        let [nx, ny] = normal;
        doubtful += usize::from(side >= 0 && x * nx + y * ny > d);
        if umbra.hides([x, y, 1.0], [x, y, 1.5]) {
            hidden += 1;
            assert!(side < 0, "the point {x} {y} is not beyond {ends:?}");
        }
    }
    assert!(hidden > 1_000 && doubtful > 100, "{hidden} {doubtful}");
}

/// The top of an umbra is linear in the distance. Here the distance is 5 m exactly, and tops round.
#[test]
fn boxes_are_below_the_top_exactly() {
    let mut random = Random(8);
    let (mut hidden, mut doubtful) = (0, 0);
    for _ in 0..40_000 {
        let highest = random.fine_range(0.5, 1.0) * [1.0, 1e3, 1e6][random.below(3)];
        let slope = random.fine_range(0.5, 1.0) * [1.0, 1e-3, 1e-6][random.below(3)];
        let cell = CellBox { min: [0.0, 0.0, 0.25], max: [0.0, 0.0, highest] };
        let ends = [Point::exact(-4.0, 3.0), Point::exact(6.0, -2.0)];
        let umbra = Umbra::new(&Grown { ends, bottom: 0.0, slope, error: 0.0 }, &cell);
        // The nearest corner of the box is at (3, 4).
        let top = slope * 5.0 + highest;
        let high =
            [top, top.next_down(), top - 3e-15 * (top + highest), top - 1e-15 * slope][random.below(4)];
        let side = sign_of_sum([(high, 1.0), (-highest, 1.0), (-slope, 5.0)]);
        doubtful += usize::from(side > 0 && high <= top);
        if umbra.hides([3.0, 4.0, 0.25], [3.5, 4.5, high]) {
            hidden += 1;
            assert!(side <= 0, "{high} is above {slope} * 5 + {highest}");
        }
    }
    assert!(hidden > 5_000 && doubtful > 1_000, "{hidden} {doubtful}");
}

/// Lines of sight stay above the bottom: eyes at 1 m, a box that begins lower, in a tenth of the way.
#[test]
fn lines_of_sight_are_above_the_bottom_exactly() {
    let mut random = Random(9);
    let (mut hidden, mut shown) = (0, 0);
    for _ in 0..40_000 {
        let low = random.fine_range(0.0, 0.5) * [1.0, 1e3][random.below(2)];
        let lowest = low + random.fine_range(0.0, 0.01) * low;
        let cell = CellBox { min: [0.0, 0.0, lowest], max: [0.0, 0.0, lowest] };
        let ends = [Point::exact(-90.0, 9.0), Point::exact(90.0, 9.0)];
        // A line from the eye to (0, 10) is at (0, 9) after nine tenths: low + (lowest - low) / 10 there.
        let bottom = low + (lowest - low) * 0.1 * random.fine_range(0.999_999, 1.000_001);
        let bottom = [bottom, low + (lowest - low) * 0.1, low][random.below(3)];
        let umbra = Umbra::new(&Grown { ends, bottom, slope: 9.0, error: 0.0 }, &cell);
        if umbra.hides([0.0, 10.0, low], [0.0, 10.0, low]) {
            hidden += 1;
            // 10 bottom <= 9 low + lowest
            let side = sign_of_sum([(bottom, 10.0), (-low, 9.0), (-lowest, 1.0)]);
            assert!(side <= 0, "a line from {lowest} to {low} is below {bottom}");
        } else {
            shown += 1;
        }
    }
    assert!(hidden > 5_000 && shown > 5_000, "{hidden} {shown}");
    // Eyes below the box: what counts is the lowest of both.
    let hides = |lowest: f64, bottom: f64| {
        let cell = CellBox { min: [0.0, 0.0, lowest], max: [0.0, 0.0, 3.0] };
        let ends = [Point::exact(-90.0, 9.0), Point::exact(90.0, 9.0)];
        let umbra = Umbra::new(&Grown { ends, bottom, slope: 9.0, error: 0.0 }, &cell);
        umbra.hides([0.0, 10.0, 2.0], [0.0, 10.0, 3.0])
    };
    assert!(hides(1.0, 1.0), "all lines are above the lowest eye");
    assert!(!hides(1.0, 1.01), "a line from the lowest eye is below the bottom");
}
