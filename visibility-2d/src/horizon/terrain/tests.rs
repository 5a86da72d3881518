//! Tests of sheets of ground, with large errors.

use super::*;
use visibility_testing::{Random, UNIT, ends};

/// Triangles that end at or next to borders of squares, with squares of 0.25, 0.5 or 1 m and a grid that
/// begins at 1 m.
#[test]
fn squares_are_those_that_a_triangle_meets() {
    for (side, per_square) in [(0.25, UNIT / 4), (0.5, UNIT / 2), (1.0, UNIT)] {
        let grid = Grid { corner: [1.0; 2], side, columns: 4, rows: 4 };
        for (axis, low) in (0..2).flat_map(|axis| ends(1, 5).into_iter().map(move |low| (axis, low))) {
            for high in ends(1, 5).iter().filter(|high| high.rank >= low.rank) {
                let corner = |along: f64, across: f64| match axis {
                    0 => [along, 1.0 + across * side, 0.0],
                    _ => [1.0 + across * side, along, 0.0],
                };
                let a = corner(low.value, 1.5);
                let triangle = [a, corner(high.value, 1.25), corner(high.value, 1.75)];
                let triangle = if axis == 0 { triangle } else { [a, triangle[2], triangle[1]] };
                let border = [a, corner(high.value, 1.5), corner(high.value, 1.5)];
                for corners in [triangle, border] {
                    let mut met = [None; 4];
                    grid.for_each_met(&corners, PAD, |index, from, to| {
                        let place = [index % 4, index / 4];
                        assert_eq!(place[1 - axis], 1, "the square's place across the axis");
                        met[place[axis]] = Some((from[axis], to[axis]));
                    });
                    for (place, met) in met.into_iter().enumerate() {
                        let start = UNIT + per_square * place as i64;
                        let end = start + per_square;
                        let meets = low.rank <= end && high.rank >= start;
                        assert!(met.is_some() || !meets, "{low:?} to {high:?} meets {place} of {side}");
                        let is_near = low.rank - 1 <= end && high.rank + 1 >= start;
                        // Points beyond the grid count as in its last square.
                        let is_beyond = place == 3 && high.rank >= end;
                        assert!(met.is_none() || is_near || is_beyond, "{low:?} to {high:?}, {place}");
                        if let Some((from, to)) = met {
                            let [start, end] = [start, end].map(|rank| rank as f64 / UNIT as f64);
                            assert!(
                                from < start && end < to && to - from < side * 1.001,
                                "square {place} from {start} to {end}: reached from {from} to {to}"
                            );
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn numbers_are_rounded_down() {
    for end in ends(-3, 3) {
        assert_eq!(floor(end.value), end.rank.div_euclid(UNIT), "{end:?}");
    }
}

/// A triangle of the ground, turned counter-clockwise.
fn ground([a, b, c]: [[f64; 3]; 3], error: f64) -> Triangle {
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let corners = if area > 0.0 { [a, b, c] } else { [a, c, b] };
    Triangle { corners, vertices: [0; 3], error, object: 0 }
}

/// Heights of a triangle over a rectangle hold those of exact triangles, whose corners are off by the
/// error, which is large here.
#[test]
fn heights_hold_those_of_triangles_off_by_the_error() {
    let mut random = Random(1);
    let mut planes = 0;
    for trial in 0..30_000 {
        let error = [0.0, 0.5][trial % 2];
        let size = [3.0, 100.0][trial / 2 % 2];
        let triangle = ground([0; 3].map(|_| random.fine_vector(size).to_array()), error);
        let range = HeightRange::new(&triangle, error);
        planes += usize::from(range.plane.is_some());
        let exact = triangle.corners.map(|p| p.map(|x| x + error * random.pick(&[-1.0, 0.0, 1.0])));
        // A point of the exact triangle, often a corner, and a rectangle around it.
        let (p, q) = if random.one_in(2) { (random.unit(), random.unit()) } else { (0.0, 0.0) };
        let weights = [(1.0 - p) * (1.0 - q), p * (1.0 - q), q];
        let at = [0, 1, 2].map(|k| (0..3).map(|i| weights[i] * exact[i][k]).sum::<f64>());
        let mut reach = || [0.0, random.range(0.0, 2.0 * size)][random.below(2)];
        let from = [at[0] - reach(), at[1] - reach()];
        let to = [at[0] + reach(), at[1] + reach()];
        let [low, high] = range.over(from, to);
        assert!(
            low <= at[2] + 1e-9 && at[2] <= high + 1e-9,
            "trial {trial}: {at:?} over {from:?} to {to:?}, {low} to {high}, {triangle:?} as {exact:?}"
        );
    }
    assert!(planes > 10_000, "{planes} triangles with planes");
}

/// Heights over a rectangle are those of the triangle's plane over the part within the triangle's bounds,
/// and within its own heights.
#[test]
fn heights_over_a_rectangle_are_those_of_the_plane_there() {
    let slope = |x: f64, y: f64| {
        let corner = |px: f64, py: f64| [px, py, px * x + py * y];
        HeightRange::new(&ground([corner(0.0, 0.0), corner(4.0, 0.0), corner(0.0, 4.0)], 0.0), 0.0)
    };
    let (along, both) = (slope(1.0, 0.0), slope(1.0, 1.0));
    for (range, from, to, expected) in [
        (&along, [1.0, 1.0], [2.0, 2.0], [1.0, 2.0]),
        (&along, [-9.0, -9.0], [9.0, 1.0], [0.0, 4.0]),
        (&along, [3.0, -9.0], [9.0, 1.0], [3.0, 4.0]),
        (&along, [-9.0, 0.0], [1.0, 9.0], [0.0, 1.0]),
        (&both, [2.0, 2.0], [4.0, 4.0], [4.0, 4.0]),
        (&both, [0.5, 0.25], [1.0, 1.0], [0.75, 2.0]),
    ] {
        assert_eq!(range.over(from, to), expected, "heights over {from:?} to {to:?}");
    }
    // Triangles that are narrow or steep have no plane.
    let has_plane = |corners| HeightRange::new(&ground(corners, 0.0), 0.0).plane.is_some();
    for (width, height, expected) in [(1.0, 1.0, true), (0.3, 1.0, true), (0.1, 1.0, false)] {
        let corners = [[0.0, 0.0, 0.0], [100.0, 0.0, height], [50.0, width, height]];
        assert_eq!(has_plane(corners), expected, "a triangle of 100 by {width} metres");
        let turned = corners.map(|[x, y, z]| [y, x, z]);
        assert_eq!(has_plane(turned), expected, "a triangle of {width} by 100 metres");
    }
    for (height, expected) in [(3990.0, true), (4010.0, false)] {
        let corners = [[0.0, 0.0, 0.0], [4.0, 0.0, height], [0.0, 4.0, 0.0]];
        assert_eq!(has_plane(corners), expected, "a triangle of {height} metres over 4");
    }
}

/// A sheet of `count` by `count` squares, two triangles each, with heights given by whole coordinates.
/// `error` is that of the first triangle's corners. Returns the sheet and its triangles.
fn hill(
    count: i32,
    error: f64,
    height: impl Fn(i32, i32) -> f64,
    [from, scale]: [[f64; 2]; 2],
) -> (Option<Sheet>, Vec<Triangle>) {
    let mut triangles = Vec::new();
    let at =
        |x: i32, y: i32| [from[0] + scale[0] * f64::from(x), from[1] + scale[1] * f64::from(y), height(x, y)];
    let number = |x: i32, y: i32| (y * (count + 1) + x) as u32;
    for (x, y) in (0..count).flat_map(|y| (0..count).map(move |x| (x, y))) {
        for corners in [[(x, y), (x + 1, y), (x + 1, y + 1)], [(x, y), (x + 1, y + 1), (x, y + 1)]] {
            triangles.push(Triangle {
                corners: corners.map(|(x, y)| at(x, y)),
                vertices: corners.map(|(x, y)| number(x, y)),
                error: if triangles.is_empty() { error } else { 0.0 },
                object: 0,
            });
        }
    }
    let borders = join(&triangles);
    let members: Vec<u32> = (0..triangles.len() as u32).collect();
    (Sheet::new(&triangles, &borders.sides, &members), triangles)
}

/// A sheet is refused if its coordinates are off by more than a millionth of a square's side: by the
/// greatest error of its triangles, and by 16 roundings of the greatest coordinate.
#[test]
fn sheets_whose_coordinates_are_off_too_much_are_refused() {
    let height = |x: i32, y: i32| f64::from((x * y) % 5);
    let side = hill(8, 0.0, height, [[0.0; 2], [1.0; 2]]).0.unwrap().side;
    let limit = 0.01 * PAD * side;
    for (part, is_some) in [(0.9, true), (1.1, false), (1.9, false)] {
        let found = hill(8, part * limit, height, [[0.0; 2], [1.0; 2]]).0;
        assert_eq!(found.is_some(), is_some, "a corner off by {part} of the limit");
        let far = (part * limit / (16.0 * f64::EPSILON)).round();
        for from in [[far, 0.0], [0.0, far], [-far, 0.0]] {
            let found = hill(8, 0.0, height, [from, [1.0; 2]]).0;
            assert_eq!(found.is_some(), is_some, "{far} metres away, {part} of the limit");
        }
    }
}

/// Squares hold the heights of the ground over them, rounded outwards to `f32`, unless a border of the
/// ground meets them. Joined squares hold those of all four.
#[test]
fn squares_hold_the_heights_over_them() {
    let height = |x: i32, y: i32| 0.1 * f64::from((x * 7 + y * 3) % 5) + 0.3;
    let error = 0.9 * 0.01 * PAD * 0.25;
    let (sheet, triangles) = hill(16, error, height, [[0.0; 2], [2.0; 2]]);
    let sheet = sheet.unwrap();
    assert_eq!(sheet.side, 0.25, "the side of a square");
    assert!(sheet.levels.len() > 2, "{} levels", sheet.levels.len());
    let mut unbroken = 0;
    for (number, level) in sheet.levels.iter().enumerate() {
        let side = sheet.side * f64::from(1 << number);
        for (index, square) in level.squares.iter().enumerate() {
            let place = [index % level.columns, index / level.columns];
            let from = [0, 1].map(|k| sheet.corner[k] + place[k] as f64 * side);
            let to = from.map(|x| x + side);
            let is_within = from.iter().all(|&x| x > 0.0) && to.iter().all(|&x| x < 32.0);
            let meets = from.iter().all(|&x| x <= 32.0) && to.iter().all(|&x| x >= 0.0);
            let is_unbroken = square.owners != BROKEN;
            assert!(!is_unbroken || is_within, "level {number}: {from:?} to {to:?} has a border");
            let clear = 0.01 * side;
            let is_clear = from.iter().all(|&x| x > clear) && to.iter().all(|&x| x < 32.0 - clear);
            assert!(is_unbroken || number > 0 || !is_clear, "{from:?} to {to:?} has no border");
            if !is_unbroken || !meets {
                continue;
            }
            unbroken += 1;
            assert_eq!(sheet.owners(square.owners), [0], "the owner of {from:?} to {to:?}");
            for corner in triangles.iter().flat_map(|t| t.corners) {
                if (0..2).all(|k| from[k] <= corner[k] && corner[k] <= to[k]) {
                    let [low, high] = [square.low, square.high].map(f64::from);
                    assert!(
                        low <= corner[2] - error && corner[2] + error <= high,
                        "{corner:?} in {low} to {high}"
                    );
                }
            }
        }
    }
    assert!(unbroken > 100, "{unbroken} squares without a border");
}

/// A square that joins four others is owned by the owners of all.
#[test]
fn joined_squares_have_the_owners_of_all_four() {
    for pattern in 1..15 {
        let mut lists = Lists::default();
        let numbers = [lists.number(vec![3]), lists.number(vec![5])];
        let square =
            |i: usize| Square { low: i as f32, high: i as f32 + 1.0, owners: numbers[pattern >> i & 1] };
        let level = Level { columns: 2, squares: (0..4).map(square).collect() };
        let joined = level.joined(&mut lists);
        let [one] = joined.squares[..] else { panic!("{} squares of four", joined.squares.len()) };
        let sheet_objects: Vec<u32> = {
            let end = lists.ends[one.owners as usize] as usize;
            let begin = if one.owners == 0 { 0 } else { lists.ends[one.owners as usize - 1] as usize };
            lists.objects[begin..end].to_vec()
        };
        assert_eq!(sheet_objects, [3, 5], "owners of four squares, pattern {pattern}");
        assert_eq!([one.low, one.high], [0.0, 4.0], "heights of all four");
    }
}
