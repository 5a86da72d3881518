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
    for _ in 0..200_000 {
        let mut point = |error: f64| {
            let mut coordinate = || random.fine_range(-2.0, 2.0);
            Point { x: coordinate(), y: coordinate(), error }
        };
        let points = [point(0.0), point(0.05), point(0.2)];
        if left_of(points[0], points[1], points[2]) < 0.0 {
            continue;
        }
        decided += 1;
        for _ in 0..8 {
            let side = |bit: bool| if bit { 1.0 } else { -1.0 };
            let [a, b, c] = points.map(|p| {
                let (dx, dy) = (p.error * side(random.one_in(2)), p.error * side(random.one_in(2)));
                Point::exact(p.x + dx, p.y + dy)
            });
            assert!(
                (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x) > -1e-12,
                "the corners {a:?} {b:?} {c:?} turn right"
            );
        }
    }
    assert!(decided > 50_000, "{decided}");
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
