//! Tests of viewsheds: every sample against all edges of the surface in exact arithmetic, ties, holes,
//! distances, curvature and hostile numbers.

use std::cell::Cell;
use visibility_2d::viewshed::{HeightRaster, Observer, Viewshed, ViewshedError};
use visibility_testing::Random;
use visibility_testing::allocations::ALLOCATIONS;

/// Units of the oracle's integers in one column, and in one unit of height: positions are in quarters.
const QUARTERS: i128 = 4;

/// Heights as integers, `None` where missing.
struct World {
    rows: usize,
    columns: usize,
    heights: Vec<Option<i128>>,
}

/// A point of the oracle: row, column and height, in quarters.
type Point = [i128; 3];

impl World {
    fn random(random: &mut Random, relief: i32, holes: bool) -> Self {
        let (rows, columns) = (2 + random.below(8), 2 + random.below(8));
        let tilt = [random.between(-2, 2), random.between(-2, 2)];
        let heights = (0..rows * columns)
            .map(|sample| {
                let (row, column) = ((sample / columns) as i32, (sample % columns) as i32);
                let height = tilt[0] * row + tilt[1] * column + random.between(0, relief);
                (!(holes && random.one_in(7))).then_some(i128::from(height))
            })
            .collect();
        Self { rows, columns, heights }
    }

    /// Lowers each height by the curvature times its squared distance from an eye, in cells of 3 by 2.
    fn lowered(mut self, eye: [i128; 2], curvature: i128) -> Self {
        for (sample, height) in self.heights.iter_mut().enumerate() {
            let (down, across) =
                ((sample / self.columns) as i128 - eye[0], (sample % self.columns) as i128 - eye[1]);
            *height = height.map(|height| height - curvature * (9 * down * down + 4 * across * across));
        }
        self
    }

    fn floats(&self) -> Vec<f32> {
        self.heights.iter().map(|height| height.map_or(f32::NAN, |height| height as f32)).collect()
    }

    fn point(&self, row: usize, column: usize) -> Option<Point> {
        let height = (*self.heights.get(row * self.columns + column)?)?;
        (column < self.columns).then_some([
            QUARTERS * row as i128,
            QUARTERS * column as i128,
            QUARTERS * height,
        ])
    }

    /// Returns all edges of the surface.
    fn edges(&self) -> Vec<[Point; 2]> {
        let mut edges = Vec::new();
        for row in 0..self.rows {
            for column in 0..self.columns {
                for [down, right] in [[0, 1], [1, 0], [1, 1]] {
                    if let (Some(a), Some(b)) =
                        (self.point(row, column), self.point(row + down, column + right))
                    {
                        edges.push([a, b]);
                    }
                }
            }
        }
        edges
    }

    /// Returns the height of the surface at a point in quarters: the plane through the triangle that contains
    /// it.
    fn surface(&self, row: i128, column: i128) -> Option<i128> {
        let (r, c) = ((row / QUARTERS) as usize, (column / QUARTERS) as usize);
        let (down, across) = (row % QUARTERS, column % QUARTERS);
        let at = |r, c| self.point(r, c).map(|point| point[2]);
        let share = |share: i128, of: Option<i128>| if share == 0 { Some(0) } else { Some(share * of?) };
        let parts = if across >= down {
            [
                share(QUARTERS - across, at(r, c)),
                share(across - down, at(r, c + 1)),
                share(down, at(r + 1, c + 1)),
            ]
        } else {
            [
                share(QUARTERS - down, at(r, c)),
                share(down - across, at(r + 1, c)),
                share(across, at(r + 1, c + 1)),
            ]
        };
        let sum = parts[0]? + parts[1]? + parts[2]?;
        // Heights of samples are whole, so that the sum of four quarter shares of them is a multiple of 4.
        assert_eq!(sum % QUARTERS, 0, "the height of the surface is in quarters");
        Some(sum / QUARTERS)
    }
}

/// Returns twice the signed area of a triangle on the plan.
fn area(a: Point, b: Point, c: Point) -> i128 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Tells whether the segment from eye to target passes below an edge that it crosses on the plan. `closed`:
/// ends of edges count.
fn is_hidden_by(eye: Point, target: Point, [a, b]: [Point; 2], closed: bool) -> bool {
    let (side_a, side_b) = (area(eye, target, a), area(eye, target, b));
    let (side_eye, side_target) = (area(a, b, eye), area(a, b, target));
    if side_a == side_b || side_eye == side_target {
        return false;
    }
    // Shares along the edge and along the segment, as fractions with positive denominators.
    let fraction = |from: i128, to: i128| {
        let (over, under) = (from, from - to);
        if under < 0 { (-over, -under) } else { (over, under) }
    };
    let (on_edge, edge_unit) = fraction(side_a, side_b);
    let (on_segment, segment_unit) = fraction(side_eye, side_target);
    let inside = if closed { (0..=edge_unit).contains(&on_edge) } else { on_edge > 0 && on_edge < edge_unit };
    if !inside || on_segment <= 0 || on_segment >= segment_unit {
        return false;
    }
    let edge = a[2] * edge_unit + (b[2] - a[2]) * on_edge;
    let segment = eye[2] * segment_unit + (target[2] - eye[2]) * on_segment;
    segment * edge_unit < edge * segment_unit
}

/// Compares worlds of a kind; returns how many samples were visible and how many hidden.
fn compare(seed: u64, worlds: usize, relief: i32, holes: bool, curvature: i32) -> [usize; 2] {
    let mut random = Random(seed);
    let mut viewshed = Viewshed::new();
    let mut counts = [0; 2];
    for number in 0..worlds {
        let world = World::random(&mut random, relief, holes);
        let row = random.below(4 * (world.rows - 1) + 1) as i128;
        let column = random.below(4 * (world.columns - 1) + 1) as i128;
        // Half of all observers stand on a sample.
        let whole = random.one_in(2) || curvature != 0;
        let [row, column] = [row, column].map(|at| if whole { at / QUARTERS * QUARTERS } else { at });
        let (height, target_height) = (random.between(0, 5) as i128, random.between(0, 3) as i128);
        let floats = world.floats();
        let raster = HeightRaster::new(&floats, world.rows, world.columns, [3.0, 2.0]).expect("a raster");
        let world = world.lowered([row / QUARTERS, column / QUARTERS], i128::from(curvature));
        let observer = Observer::new(row as f64 / 4.0, column as f64 / 4.0)
            .with_height(height as f64 / 4.0)
            .with_target_height(target_height as f64)
            .with_curvature(f64::from(curvature));
        let mut visible = vec![false; floats.len()];
        let mut hidden = vec![0.0; floats.len()];
        let Some(surface) = world.surface(row, column) else {
            let refused = viewshed.look(&raster, &observer, &mut visible);
            assert!(matches!(refused, Err(ViewshedError::Observer { .. })), "world {number}: {refused:?}");
            continue;
        };
        viewshed.look(&raster, &observer, &mut visible).expect("an observer over the raster");
        viewshed.hidden_heights(&raster, &observer, &mut hidden).expect("an observer over the raster");
        let (eye, edges) = ([row, column, surface + height], world.edges());
        for (sample, &seen) in visible.iter().enumerate() {
            let (r, c) = (sample / world.columns, sample % world.columns);
            let what = format!("seed {seed}, world {number}, sample {r}, {c}");
            let Some(mut target) = world.point(r, c) else {
                assert!(!seen && hidden[sample].is_nan(), "{what}: without height");
                continue;
            };
            target[2] += target_height * QUARTERS;
            let is_hidden = |closed| edges.iter().any(|&edge| is_hidden_by(eye, target, edge, closed));
            // At a hole a line of sight exactly over the end of an edge is between hidden and visible.
            if is_hidden(true) == is_hidden(false) || !holes {
                assert_eq!(seen, !is_hidden(true), "{what}: visible");
            }
            // Both questions have one answer.
            assert_eq!(seen, hidden[sample] <= target_height as f64 + 1e-9, "{what}: {}", hidden[sample]);
            counts[usize::from(!seen)] += 1;
        }
    }
    counts
}

#[test]
fn every_sample_agrees_with_all_edges_in_exact_arithmetic() {
    for (seed, relief) in [(1, 1), (2, 3), (3, 20)] {
        let [visible, hidden] = compare(seed, 600, relief, false, 0);
        assert!(visible > 3000 && hidden > 1000, "relief {relief}: {visible} visible, {hidden} hidden");
    }
}

#[test]
fn holes_hide_nothing() {
    let [visible, hidden] = compare(4, 1500, 6, true, 0);
    assert!(visible > 3000 && hidden > 3000, "{visible} visible, {hidden} hidden");
}

#[test]
fn an_edge_beside_a_hole_hides_nothing_exactly_at_its_end() {
    // A peak between the eye and the last sample of its row. With land all around it hides; if the land on
    // one side is missing, the line of sight over the peak itself is seen, and one that meets the slope
    // beside the peak is not.
    let seen = |holes: &[[usize; 2]]| {
        let mut heights = [[0.0; 5]; 5];
        (heights[2][2], heights[1][2]) = (10.0, 10.0);
        for &[row, column] in holes {
            heights[row][column] = f64::NAN;
        }
        let raster = HeightRaster::new(heights.as_flattened(), 5, 5, [1.0, 1.0]).expect("a raster");
        let mut visible = [false; 25];
        let observer = Observer::new(2.0, 0.0).with_height(1.0);
        Viewshed::new().look(&raster, &observer, &mut visible).expect("over the raster");
        [visible[2 * 5 + 4], visible[5 + 4]]
    };
    assert_eq!(seen(&[]), [false, false], "land all around the peak");
    assert_eq!(seen(&[[3, 2], [3, 3]]), [true, false], "holes on one side");
}

#[test]
fn an_edge_beside_a_hole_hides_nothing_at_its_end_on_a_diagonal() {
    // A triangle that touches the diagonal in one corner, on either side of it; and both, which close it.
    let sides = [vec![[1, 2], [2, 2], [2, 3]], vec![[2, 1], [2, 2], [3, 2]]];
    for (raised, is_seen) in [(sides[0].clone(), true), (sides[1].clone(), true), (sides.concat(), false)] {
        let mut heights = [[f64::NAN; 5]; 5];
        for &[row, column] in &raised {
            heights[row][column] = 10.0;
        }
        (heights[0][0], heights[4][4]) = (0.0, 1.0);
        let raster = HeightRaster::new(heights.as_flattened(), 5, 5, [1.0, 1.0]).expect("a raster");
        let mut visible = [false; 25];
        Viewshed::new().look(&raster, &Observer::new(0.0, 0.0), &mut visible).expect("over the raster");
        assert_eq!(visible[4 * 5 + 4], is_seen, "behind {raised:?}");
    }
}

#[test]
fn directions_to_the_end_of_an_edge_beside_a_hole_may_round_either_way() {
    // The line of sight to the last sample passes exactly over the end (1, 3) of an edge, since the column of
    // the eye is three times its row: (1 - q) / (3 - 3 q) = (2 - q) / (6 - 3 q).
    let mut heights = [[f64::NAN; 7]; 4];
    for (row, column, height) in
        [(0, 0, 0.0), (0, 1, 0.0), (1, 1, 0.0), (0, 3, 10.0), (1, 3, 10.0), (2, 6, 1.0)]
    {
        heights[row][column] = height;
    }
    let raster = HeightRaster::new(heights.as_flattened(), 4, 7, [1.0, 1.0]).expect("a raster");
    let mut eyes = Random(6);
    for row in std::iter::once(0.1994286912291222).chain((0..2000).map(|_| eyes.unit() / 3.0)) {
        // A row of few digits, so that its triple is exact.
        let row = (row * 9007199254740992.0_f64).round() / 9007199254740992.0;
        let mut visible = [false; 28];
        Viewshed::new().look(&raster, &Observer::new(row, 3.0 * row), &mut visible).expect("over the raster");
        assert!(visible[2 * 7 + 6], "from {row}, {}", 3.0 * row);
    }
}

#[test]
fn an_eye_on_a_slope_sees_all_of_it() {
    // Lines of sight along a plane touch every edge; what rounding makes of heights, directions and the eye
    // must not hide them.
    let mut random = Random(5);
    for case in 0..200 {
        let size = 2 + random.below(40);
        let [down, across, level] =
            [random.range(-100.0, 100.0), random.range(-100.0, 100.0), random.range(-1e4, 1e4)];
        // Heights in steps of 2^-20, so that the plane through them is exact.
        let step = |x: f64| (x * 1048576.0).round() / 1048576.0;
        let (down, across, level) = (step(down), step(across), step(level));
        let heights: Vec<f64> = (0..size * size)
            .map(|sample| level + down * (sample / size) as f64 + across * (sample % size) as f64)
            .collect();
        let raster = HeightRaster::new(&heights, size, size, [1.0, 1.0]).expect("a raster");
        let [row, column] = [(); 2].map(|()| random.unit() * (size - 1) as f64);
        let mut visible = vec![false; size * size];
        Viewshed::new().look(&raster, &Observer::new(row, column), &mut visible).expect("over the raster");
        let hidden = visible.iter().filter(|visible| !**visible).count();
        assert_eq!(hidden, 0, "case {case}: samples of a plane hidden from {row}, {column}");
    }
}

#[test]
fn an_eye_on_a_slope_sees_along_level_lines() {
    // The eye and all targets of its level are at height 0, so that nothing but rounding of directions and
    // slopes is left of the heights.
    let mut random = Random(8);
    for case in 0..100 {
        let [row, column] = [(); 2].map(|()| random.below(40) as i32);
        let [down, across] = [(); 2].map(|()| random.between(-9, 9));
        let heights: Vec<f64> = (0..40 * 40)
            .map(|sample| f64::from(down * (sample / 40 - row) + across * (sample % 40 - column)))
            .collect();
        let raster = HeightRaster::new(&heights, 40, 40, [1.0, 1.0]).expect("a raster");
        let observer = Observer::new(f64::from(row), f64::from(column));
        let mut visible = vec![false; heights.len()];
        Viewshed::new().look(&raster, &observer, &mut visible).expect("over the raster");
        let hidden = visible.iter().filter(|visible| !**visible).count();
        assert_eq!(hidden, 0, "case {case}: samples of a plane hidden from {row}, {column}");
    }
}

#[test]
fn a_wall_hides_up_to_its_shadow() {
    // A wall 8 high at column 10 and an eye 2 high at column 0: the shadow at column c is up to 2 + 6 * c /
    // 10.
    let mut heights = vec![0_i16; 41 * 41];
    for row in 0..41 {
        heights[row * 41 + 10] = 8;
    }
    let raster = HeightRaster::new(&heights, 41, 41, [30.0, 30.0]).expect("a raster");
    let mut hidden = vec![0.0; heights.len()];
    let observer = Observer::new(20.0, 0.0).with_height(2.0);
    Viewshed::new().hidden_heights(&raster, &observer, &mut hidden).expect("over the raster");
    for (sample, hidden) in hidden.iter().enumerate() {
        let column = sample % 41;
        let shadow = if column > 10 { 2.0 + 6.0 * column as f64 / 10.0 } else { 0.0 };
        assert!((hidden - shadow).abs() < 1e-9, "sample {sample}: hidden up to {hidden}, not {shadow}");
    }
}

#[test]
fn distance_is_along_the_plan_and_inclusive() {
    let heights = [0.0_f32; 7 * 9];
    let raster = HeightRaster::new(&heights, 7, 9, [10.0, 20.0]).expect("a raster");
    let observer = Observer::new(3.0, 4.0).with_height(1.0).with_max_distance(50.0);
    let mut visible = [false; 7 * 9];
    Viewshed::new().look(&raster, &observer, &mut visible).expect("over the raster");
    for (sample, &seen) in visible.iter().enumerate() {
        let (down, across) = (10 * (sample as i32 / 9 - 3), 20 * (sample as i32 % 9 - 4));
        assert_eq!(seen, down * down + across * across <= 2500, "sample {sample}");
    }
}

#[test]
fn a_sample_at_just_the_greatest_distance_is_seen() {
    // Three and four cells are exact products, and five cells are the distance.
    for cell in [0.79, 1.29, 1.58, 2.33, 2f64.powi(-60), 2f64.powi(60)] {
        assert_eq!(
            [3.0, 4.0].map(|n: f64| n.mul_add(cell, -(n * cell))),
            [0.0; 2],
            "{cell} has exact multiples"
        );
        for end in [[0, 5], [5, 0], [3, 4], [4, 3]] {
            let raster = HeightRaster::new(&[0.0; 36], 6, 6, [cell; 2]).expect("a raster");
            let mut visible = [false; 36];
            let observer = Observer::new(0.0, 0.0).with_height(1.0).with_max_distance(5.0 * cell);
            Viewshed::new().look(&raster, &observer, &mut visible).expect("over the raster");
            assert!(visible[6 * end[0] + end[1]], "cell {cell}, sample {end:?}");
        }
    }
}

#[test]
fn a_sample_within_the_least_distances_is_seen() {
    // Each of the two squares of the first distance is 0.6 times the least number, and rounds up to it. Both
    // together are 1.2 times the least number, and round down to it.
    let raster = HeightRaster::new(&[0.0; 4], 2, 2, [1.0, 1.0]).expect("a raster");
    for (at, distance, is_seen) in
        [(1.72e-162, 2.44e-162, true), (1e-150, 1.5e-150, true), (1e-150, 1.4e-150, false)]
    {
        let mut visible = [false; 4];
        let observer = Observer::new(at, at).with_height(1.0).with_max_distance(distance);
        Viewshed::new().look(&raster, &observer, &mut visible).expect("over the raster");
        assert_eq!(visible, [is_seen, false, false, false], "within {distance} of {at}, {at}");
    }
}

#[test]
fn curved_terrain_agrees_with_all_edges_in_exact_arithmetic() {
    for (seed, curvature) in [(6, 1), (7, -1), (8, 3)] {
        let [visible, hidden] = compare(seed, 300, 60, false, curvature);
        assert!(visible > 500 && hidden > 300, "{curvature}: {visible} visible, {hidden} hidden");
    }
}

#[test]
fn heights_that_cancel_with_the_curvature_hide_nothing() {
    // Lowered heights of row 0 are 3 at column 1 and 11 at column 3: the line of sight to the latter passes
    // over the former at 11 / 3. Nine times the curvature has three bits too many for an `f64`.
    let curvature = 4503599627370501.0;
    let heights = [0.0, 4503599627370504.0, 0.0, 40532396646334520.0, 0.0, 9007199254741004.0, 0.0, 0.0];
    let raster = HeightRaster::new(&heights, 2, 4, [1.0, 1.0]).expect("a raster");
    let mut visible = [false; 8];
    let observer = Observer::new(0.0, 0.0).with_curvature(curvature);
    Viewshed::new().look(&raster, &observer, &mut visible).expect("over the raster");
    assert!(visible[3], "a sample at 11 behind one at 3");
}

#[test]
fn heights_that_cancel_with_the_curvature_far_away_hide_nothing() {
    // Lowered heights are some roundings of what they are lowered by, and computed with such an error.
    let mut random = Random(9);
    let mut tight = 0;
    for case in 0..1000 {
        let curvature = (1_i64 << 52) + random.magnitude(51);
        let row: Vec<f64> = (0..31)
            .map(|column| match column {
                0 => 0.0,
                20 | 30 => {
                    let lowered_by = (column * column) as f64 * curvature as f64;
                    lowered_by + f64::from(random.between(-3, 3)) * (lowered_by.next_up() - lowered_by)
                }
                _ => f64::NAN,
            })
            .collect();
        let heights = [row.clone(), row.clone()].concat();
        let raster = HeightRaster::new(&heights, 2, 31, [1.0, 1.0]).expect("a raster");
        let exact = |column: i128| row[column as usize] as i128 - column * column * i128::from(curvature);
        if 2 * exact(30) < 3 * exact(20) {
            continue;
        }
        tight += 1;
        // Along the border, and where rows are as close together as numbers allow.
        let mut visible = vec![false; heights.len()];
        let observer = Observer::new(0.0, 0.0).with_curvature(curvature as f64);
        Viewshed::new().look(&raster, &observer, &mut visible).expect("over the raster");
        assert!(visible[30], "case {case}: {} behind {}", exact(30), exact(20));
    }
    assert!(tight > 300, "{tight} samples that are seen");
}

#[test]
fn the_least_heights_hide_nothing_by_rounding() {
    // The line of sight to 5 units in column 3 passes 3 units in column 2 at 10 / 3 units.
    let row = [0, 0, 3, 5].map(f64::from_bits);
    let heights = [row, row];
    let raster = HeightRaster::new(heights.as_flattened(), 2, 4, [1.0, 1.0]).expect("a raster");
    let mut visible = [false; 8];
    Viewshed::new().look(&raster, &Observer::new(0.0, 0.0), &mut visible).expect("over the raster");
    assert!(visible[3], "5 units behind 3");
}

#[test]
fn curvature_hides_what_is_beyond_the_horizon() {
    // From 2 m the horizon of a sphere is at sqrt(2 * R * 2 m) = 5.05 km.
    let heights = [0.0_f32; 202];
    let raster = HeightRaster::new(&heights, 2, 101, [100.0, 100.0]).expect("a raster");
    let observer = Observer::new(0.0, 0.0).with_height(2.0).with_curvature(0.5 / 6.371e6);
    let mut visible = [false; 202];
    Viewshed::new().look(&raster, &observer, &mut visible).expect("over the raster");
    let last = visible[..101].iter().rposition(|seen| *seen).expect("the ground below the observer");
    // The polygon of samples touches the line of sight within a cell of the horizon.
    assert!((50..=51).contains(&last), "last sample seen: {last}");
    assert!(visible[..=last].iter().all(|seen| *seen), "all before the horizon is seen");
}

#[test]
fn bad_input_is_refused_by_name() {
    let heights = [0.0_f32, f32::NAN, 0.0, 0.0];
    let count = |given, rows, columns| ViewshedError::Count { given, rows, columns };
    let raster = |rows, columns| HeightRaster::new(&heights, rows, columns, [1.0, 1.0]).map(|_| ());
    assert_eq!(raster(3, 2), Err(count(4, 3, 2)), "too few heights");
    assert_eq!(raster(usize::MAX, 4), Err(count(4, usize::MAX, 4)), "a product beyond the numbers");
    assert_eq!(raster(1, 4), Err(count(4, 1, 4)), "one row");
    assert_eq!(raster(4, 1), Err(count(4, 4, 1)), "one column");
    assert_eq!(HeightRaster::<f64>::new(&[], 0, 0, [1.0, 1.0]).map(|_| ()), Err(count(0, 0, 0)), "none");
    let cell = HeightRaster::new(&heights, 2, 2, [1.0, 0.0]).map(|_| ());
    assert_eq!(cell, Err(ViewshedError::Cell { cell: [1.0, 0.0] }), "a cell without width");
    let raster = HeightRaster::new(&heights, 2, 2, [1.0, 1.0]).expect("a raster");
    let heights_at = [[0, 0], [0, 1], [0, 2], [1, 0], [2, 0]].map(|[row, column]| raster.height(row, column));
    assert_eq!(
        heights_at,
        [Some(0.0), None, None, Some(0.0), None],
        "samples, a hole, and beyond the raster"
    );
    let mut visible = [true; 4];
    let mut look = |observer: Observer, results: usize| {
        Viewshed::new().look(&raster, &observer, &mut visible[..results]).map_err(|error| error.to_string())
    };
    let on_ground = Observer::new(1.0, 0.0);
    let refusals = [
        (on_ground, 3, "3 values for 2 rows"),
        (Observer::new(0.0, 1.0), 4, "column 1.0 is not over the raster, or there is no ground"),
        (Observer::new(f64::NAN, 0.0), 4, "row NaN"),
        (Observer::new(0.0, -0.5), 4, "column -0.5"),
        (Observer::new(1e300, 0.0), 4, "row 1e300"),
        (on_ground.with_height(-1.0), 4, "-1.0 is negative"),
        (on_ground.with_target_height(f64::INFINITY), 4, "inf is negative, or no number"),
        (on_ground.with_curvature(f64::NAN), 4, "curvature NaN"),
        (on_ground.with_curvature(-2e60), 4, "curvature -2e60"),
        (on_ground.with_max_distance(f64::NAN), 4, "distance NaN"),
        (on_ground.with_max_distance(-1.0), 4, "distance -1.0"),
    ];
    for (observer, results, message) in refusals {
        let refused = look(observer, results).expect_err(message);
        assert!(refused.contains(message), "{refused:?} says {message:?}");
    }
    assert_eq!(visible, [true; 4], "a refused call changes nothing");
}

#[test]
fn hostile_heights_neither_panic_nor_hide() {
    let mut random = Random(6);
    let values = [0.0, -0.0, 1.0, 1e60, -1e60, 1e61, f64::MAX, f64::INFINITY, f64::NAN, 5e-324, 1e-300];
    for case in 0..500 {
        let (rows, columns) = (2 + random.below(5), 2 + random.below(5));
        let heights: Vec<f64> = (0..rows * columns).map(|_| random.pick(&values)).collect();
        let raster = HeightRaster::new(&heights, rows, columns, [1e-30, 1e30]).expect("a raster");
        let observer = Observer::new(random.unit() * (rows - 1) as f64, random.unit() * (columns - 1) as f64)
            .with_height(1e60)
            .with_curvature(random.pick(&[0.0, 1e60, -1e-20]));
        let mut visible = vec![false; heights.len()];
        let mut hidden = vec![0.0; heights.len()];
        if Viewshed::new().look(&raster, &observer, &mut visible).is_ok() {
            Viewshed::new().hidden_heights(&raster, &observer, &mut hidden).expect("as before");
            assert!(
                hidden.iter().all(|hidden| hidden.is_nan() || *hidden >= 0.0),
                "case {case}: no negative height"
            );
        }
    }
}

#[test]
fn a_warm_viewshed_allocates_nothing() {
    let mut random = Random(7);
    let heights: Vec<f32> = (0..60 * 60).map(|_| random.range(0.0, 10.0) as f32).collect();
    let raster = HeightRaster::new(&heights, 60, 60, [1.0, 1.0]).expect("a raster");
    let (mut viewshed, mut visible) = (Viewshed::new(), vec![false; heights.len()]);
    let observer = Observer::new(30.5, 20.25).with_height(3.0);
    let before = ALLOCATIONS.get();
    viewshed.look(&raster, &observer, &mut visible).expect("over the raster");
    assert!(ALLOCATIONS.get() > before, "allocations are counted");
    let before = ALLOCATIONS.get();
    viewshed.look(&raster, &observer, &mut visible).expect("as before");
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations of a warm call");
}

thread_local! {
    /// Number of heights read on this thread.
    static READS: Cell<usize> = const { Cell::new(0) };
}

/// A height that counts how often it is read.
#[derive(Clone, Copy)]
struct Counted(f64);

impl From<Counted> for f64 {
    fn from(height: Counted) -> Self {
        READS.set(READS.get() + 1);
        height.0
    }
}

/// With cells much longer than wide, the samples that are read are those within the greatest distance and a
/// few beside them, and the answers are those without a greatest distance.
#[test]
fn a_greatest_distance_bounds_the_samples_read_along_both_axes() {
    let mut random = Random(12);
    let side = 240;
    let heights: Vec<Counted> = (0..side * side).map(|_| Counted(f64::from(random.between(0, 30)))).collect();
    for (cell, distance) in [
        ([1000.0, 1.0], 90.0),
        ([1.0, 1000.0], 90.0),
        ([7.0, 1.0], 60.0),
        ([1.0, 6.5], 60.0),
        ([1.0, 1.0], 40.0),
        ([0.7, 0.9], 0.0),
    ] {
        let raster = HeightRaster::new(&heights, side, side, cell).expect("a raster");
        for _ in 0..3 {
            let [row, column] = [(); 2].map(|()| random.fine_range(100.0, 140.0));
            let observer = Observer::new(row, column).with_height(2.0);
            let [mut all, mut near] = [(); 2].map(|()| vec![false; heights.len()]);
            Viewshed::new().look(&raster, &observer, &mut all).expect("over the raster");
            READS.set(0);
            let limited = observer.with_max_distance(distance);
            Viewshed::new().look(&raster, &limited, &mut near).expect("over the raster");
            let reads = READS.get();
            let mut within = 0;
            for sample in 0..heights.len() {
                let down = ((sample / side) as f64 - row) * cell[0];
                let across = ((sample % side) as f64 - column) * cell[1];
                let is_within = down.hypot(across) <= distance;
                within += usize::from(is_within);
                assert_eq!(near[sample], is_within && all[sample], "sample {sample}, cells {cell:?}");
            }
            assert!(reads < 4 * within + 20 * side, "{reads} reads for {within} samples, cells {cell:?}");
        }
    }
}
