//! Tests of columns, in units of a part of a column.

use super::*;
use crate::horizon::column_query::QueryEye;
use visibility_core::Aabb;
use visibility_testing::{End, UNIT, ends, ends_f32};

/// Number of columns of each face.
const COUNT: usize = 16;

/// Greatest distance in ranks from a border at which margins may decide either way.
const HAIR: i64 = 2;

/// Returns columns of which only a part of face 0 is in view, from `begin` to `end`, in columns.
fn columns(begin: f64, end: f64) -> Columns {
    let mut columns = Columns::new(COUNT);
    let mut seen = [const { 0.0..0.0 }; FACES];
    seen[0] = begin / COUNT as f64..end / COUNT as f64;
    let mut frame = Frame::BLIND;
    frame.seen = seen;
    columns.begin(&frame);
    columns
}

fn start(column: usize) -> i64 {
    UNIT * column as i64
}

#[test]
fn columns_in_view_are_those_that_the_view_meets() {
    let all = ends(1, COUNT as i32 - 1);
    for (i, begin) in all.iter().enumerate() {
        for end in &all[i + 1..] {
            let seen = columns(begin.value, end.value).seen(0);
            for column in 0..COUNT {
                let is_met = begin.rank < start(column + 1) && end.rank > start(column);
                let is_near = begin.rank - HAIR <= start(column + 1) && end.rank + HAIR >= start(column);
                let is_seen = seen.contains(&column);
                assert!(is_seen || !is_met, "{begin:?} to {end:?} meets {column}");
                assert!(!is_seen || is_near, "{begin:?} to {end:?} is far from {column}");
            }
        }
    }
}

/// A step whose top is below its bottom leaves the block as it was, also if its top is the highest.
#[test]
fn inverted_steps_are_left_out() {
    let mut columns = columns(0.0, COUNT as f64);
    let step = |low, high| Step { inverse_depth: 0.5, low, high };
    columns.add_step(0, 0, step(0.0, 1.0));
    for (low, high) in [(3.0, 2.0), (2.0, 2.0)] {
        columns.add_step(0, 0, step(low, high));
        let block = &columns.face(0)[0];
        assert_eq!(block.common, step(0.0, 1.0), "the common step, after one from {low} to {high}");
        assert!((0..BLOCK).all(|column| block.step(1, column) == Step::OPEN), "steps from {low} to {high}");
    }
}

/// Returns an outline from height -1 up to the given corners (column and height), at depth 1.
fn outline(upper: &[(f64, f64)], error: f64) -> Outline {
    let corner = |&(column, height): &(f64, f64)| Corner { column, height, inverse_depth: 1.0 };
    let lower = [upper[0].0, upper[upper.len() - 1].0].map(|column| (column, -1.0));
    let mut outline = Outline::default();
    outline.upper.extend(upper.iter().map(corner));
    outline.lower.extend(lower.iter().map(corner));
    outline.error.column = error;
    outline
}

/// Returns whether a column hides a surface at a height, slightly behind the outlines.
fn hides(columns: &Columns, column: usize, height: f32) -> bool {
    columns.face(0)[column / BLOCK].hides(0.9, -0.9, height) >> (column % BLOCK) & 1 == 1
}

#[test]
fn outlines_hide_the_columns_between_their_ends() {
    let all = ends(-2, COUNT as i32 + 2);
    for (error, ranks) in [(0.0, 0), (0.25, 3)] {
        for (low, high) in all.iter().flat_map(|low| all.iter().map(move |high| (low, high))) {
            let mut columns = columns(2.5, 12.5);
            columns.draw(0, &outline(&[(low.value, 1.0), (high.value, 1.0)], error), false);
            for column in 0..COUNT {
                let holds = |hair: i64| {
                    low.rank + ranks + hair <= start(column) && start(column + 1) <= high.rank - ranks - hair
                };
                let is_hidden = hides(&columns, column, 0.9);
                // The sum of an end and an error is rounded to the next number, for which errors allow.
                let is_held = holds(-i64::from(error > 0.0));
                assert!(!is_hidden || is_held, "{low:?} to {high:?}, {error}: not all of {column}");
                let is_seen = (2..=12).contains(&column);
                assert_eq!(
                    is_hidden,
                    is_hidden && is_seen,
                    "{low:?} to {high:?}: column {column} is hidden out of view"
                );
                assert!(is_hidden || !is_seen || !holds(HAIR), "{low:?} to {high:?}, {error}: {column}");
            }
        }
    }
}

/// A wall that is lower at one corner, as a notch or as a step. The column of the corner must not hide
/// above the lower height.
#[test]
fn corners_lower_the_columns_that_they_are_in() {
    for End { value, rank } in ends(1, 15) {
        let notch = [(0.0, 1.0), (value, 0.25), (16.0, 1.0)];
        let down = [(0.0, 1.0), (value, 1.0), (value, 0.25), (16.0, 0.25)];
        let up = [(0.0, 0.25), (value, 0.25), (value, 1.0), (16.0, 1.0)];
        for (shape, upper) in [&notch[..], &down, &up].into_iter().enumerate() {
            let mut columns = columns(0.0, 16.0);
            columns.draw(0, &outline(upper, 0.0), true);
            for column in 0..COUNT {
                let is_before = start(column + 1) <= rank;
                let is_behind = start(column) > rank;
                let is_low = match shape {
                    0 => !is_before && !is_behind,
                    1 => !is_before,
                    _ => !is_behind,
                };
                let what = || std::format!("shape {shape}, corner {value}, column {column}");
                assert!(!is_low || !hides(&columns, column, 0.26), "{}", what());
                assert!(hides(&columns, column, 0.24), "{}", what());
                // The boundary before the corner is lowered, and with it the column before that.
                let is_clear = start(column + 2) + HAIR < rank || start(column) - HAIR > rank;
                assert!(is_low || !is_clear || shape == 0 || hides(&columns, column, 0.9), "{}", what());
            }
        }
    }
}

/// A flat box behind columns, all of which hide it except one.
#[test]
fn boxes_are_hidden_unless_they_meet_the_only_open_column() {
    let mut frame = Frame::BLIND;
    frame.error = 0.0;
    let eye = QueryEye::new(&frame);
    // At a depth of half the number of columns, a column is a metre wide.
    let (half, all) = (COUNT as i16 / 2, ends_f32(-9, 9));
    let depth = f32::from(half);
    for open in 0..COUNT {
        let mut columns = columns(1.5, 14.5);
        for column in (0..COUNT).filter(|&column| column != open) {
            let step = Step { inverse_depth: 9.0, low: -9.0, high: 9.0 };
            insert(&mut columns.face_mut(0)[column / BLOCK], column % BLOCK, step);
        }
        columns.face_mut(0).iter_mut().for_each(Block::summarize);
        for (i, low) in all.iter().enumerate() {
            for high in &all[i..] {
                let bounds = Aabb::from_arrays([depth, low.value, -1.0], [depth, high.value, 1.0]);
                let [from, to] = [low, high].map(|end| end.rank + UNIT * i64::from(half));
                let meets =
                    |column: usize, hair: i64| from - hair < start(column + 1) && to + hair > start(column);
                let is_hidden = columns.hides_box(&eye, [0, 1, 2], &bounds);
                let is_open = (1..=14).contains(&open) && meets(open, 0);
                assert!(!is_hidden || !is_open, "{low:?} to {high:?}, open {open}");
                let is_in_view = (1..=14).any(|column| meets(column, 0));
                assert!(is_hidden || !is_in_view || meets(open, HAIR), "{low:?} to {high:?}, open {open}");
                let mut parts = Vec::new();
                columns.for_each_part(&eye, [0, 1, 2], &bounds, |face, first, last, _| {
                    parts.push((face, first, last));
                    true
                });
                let in_part = |column| parts.iter().any(|&(_, first, last)| (first..=last).contains(&column));
                for column in 1..=14 {
                    assert!(in_part(column) || !meets(column, 0), "{low:?} to {high:?}: {parts:?}");
                    assert!(!in_part(column) || meets(column, HAIR), "{low:?} to {high:?}: {parts:?}");
                }
                assert!(
                    parts.iter().all(|&(face, first, last)| face == 0 && 1 <= first && last <= 14),
                    "{low:?} to {high:?}: parts in view: {parts:?}"
                );
            }
        }
    }
}

/// Steps of a column hide, at each height, no more than the steps that were added to it. The first ones,
/// as many as there is room for, hide all that they hid alone.
#[test]
fn steps_of_a_column_hide_what_was_added() {
    let mut random = visibility_testing::Random(1);
    for trial in 0..1_000 {
        let (mut block, mut added) = (Block::OPEN, Vec::new());
        for _ in 0..6 {
            let [a, b] = [(); 2].map(|()| random.below(7) as f32);
            let step =
                Step { inverse_depth: 1.0 + random.below(4) as f32, low: a.min(b), high: a.max(b) + 1.0 };
            insert(&mut block, 3, step);
            added.push(step);
            // At half of each height and inverse depth, so that no two numbers are equal.
            for (low, high) in
                (0..8).flat_map(|low| (low..8).map(move |high| (low as f32 + 0.5, high as f32 + 0.5)))
            {
                for behind in [0.5, 1.5, 2.5, 3.5] {
                    let is_hidden = block.hides(behind, low, high) == 1 << 3;
                    let holds = |at: f32| {
                        added
                            .iter()
                            .any(|step| step.inverse_depth > behind && step.low <= at && at <= step.high)
                    };
                    let is_held = (0..=14).map(|i| low + 0.5 * i as f32).filter(|at| *at <= high).all(holds);
                    assert!(!is_hidden || is_held, "trial {trial}: {low} to {high}, {behind} by {added:?}");
                    let alone =
                        |step: &Step| step.inverse_depth > behind && step.low < low && high < step.high;
                    let is_own = added.len() <= STEPS && added.iter().any(alone);
                    assert!(is_hidden || !is_own, "trial {trial}: {low} to {high}, {behind} by {added:?}");
                }
            }
        }
    }
}

/// Corners beside the columns in view lower none of them. A corner that is deeper than both boundaries
/// beside it lowers the inverse depth of its column.
#[test]
fn corners_lower_the_inverse_depth_of_the_columns_that_they_are_in() {
    for End { value, rank } in ends(1, 15) {
        let mut columns = columns(5.5, 10.5);
        let mut outline = outline(&[(0.0, 1.0), (value, 1.0), (16.0, 1.0)], 0.0);
        outline.upper[1].inverse_depth = 0.25;
        columns.draw(0, &outline, true);
        for column in 5..=10 {
            let hides = |inverse_depth: f32| {
                columns.face(0)[column / BLOCK].hides(inverse_depth, -0.9, 0.9) >> (column % BLOCK) & 1 == 1
            };
            let is_in = start(column + 1) > rank && start(column) <= rank;
            assert!(!is_in || !hides(0.26), "corner {value}: column {column} hides what is before it");
            assert!(hides(0.24), "corner {value}: column {column} hides what is behind it");
        }
    }
}

/// Outlines whose top is below their bottom, and those so far away that inverse depths are no normal
/// numbers, leave the columns open.
#[test]
fn outlines_that_hide_nothing_leave_columns_open() {
    for (high, inverse_depth, is_open) in [(1.0, 1.0, false), (-2.0, 1.0, true), (1.0, 1e-39, true)] {
        let mut columns = columns(0.0, 16.0);
        let mut outline = outline(&[(0.0, high), (16.0, high)], 0.0);
        let Outline { upper, lower, .. } = &mut outline;
        upper.iter_mut().chain(lower).for_each(|corner| corner.inverse_depth = inverse_depth);
        columns.draw(0, &outline, false);
        let all = (0..BLOCK).all(|column| columns.face(0)[0].step(0, column) == Step::OPEN);
        assert_eq!(all, is_open, "from -1 to {high} at an inverse depth of {inverse_depth}");
    }
}
