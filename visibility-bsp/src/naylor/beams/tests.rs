//! Tests of the beam tree.

use super::*;
use visibility_testing::Random;

/// Builds a polygon from pairs of NDC coordinates (x, y).
fn polygon(corners: &[(f64, f64)]) -> Vec<ImageCorner> {
    corners.iter().map(|&(x, y)| ImageCorner::new(x, y)).collect()
}

/// Builds the square with the given least corner and size.
fn square_of([x, y]: [f64; 2], size: f64) -> Vec<ImageCorner> {
    polygon(&[(x, y), (x + size, y), (x + size, y + size), (x, y + size)])
}

/// Bound on the absolute NDC error of the corners in these tests.
const ERROR: f64 = 1e-13;

#[test]
fn a_picture_covered_by_polygons_is_closed_though_their_corners_are_rounded() {
    // Rows of quadrilaterals that are divided at different positions, their common edges slanted. Corners
    // of one row lie on edges of the next, within rounding.
    let mut beams = Beams::default();
    beams.begin(ERROR);
    let (rows, slant) = (9, 0.0371);
    let height = |row: usize, x: f64| -1.2 + 2.4 * row as f64 / rows as f64 + slant * x;
    for row in 0..rows {
        let columns = 5 + row * 3 % 7;
        for column in 0..columns {
            assert!(!beams.is_closed(), "row {row}, column {column}: the picture is not closed yet");
            let at = |c: usize| -1.1 + 2.2 * c as f64 / columns as f64;
            let noise = |c: usize| if (c * 7 + row * 3) % 5 < 2 { 0.5 * ERROR } else { -0.5 * ERROR };
            let (left, right) = (at(column), at(column + 1));
            let quad = polygon(&[
                (left, height(row, left) + noise(column)),
                (right, height(row, right) + noise(column + 1)),
                (right, height(row + 1, right) - noise(column + 1)),
                (left, height(row + 1, left) - noise(column)),
            ]);
            assert_eq!(
                beams.test_and_cover(&quad, ERROR),
                Visibility::Seen,
                "row {row}, column {column}: the quadrilateral is seen before it covers"
            );
        }
    }
    assert!(beams.is_closed(), "the picture is closed");
    assert_eq!(
        beams.test(&polygon(&[(-0.5, -0.5), (0.5, -0.5), (0.0, 0.5)])),
        Visibility::Hidden,
        "a triangle behind the closed picture"
    );
}

#[test]
fn gaps_are_seen_through_down_to_the_tolerance() {
    for (gap, seen) in [(0.1, true), (1e-3, true), (1e-6, true), (1e-9, false)] {
        let mut beams = Beams::default();
        beams.begin(ERROR);
        let half = 0.5 * gap;
        beams.test_and_cover(
            &polygon(&[(-2.0, -2.0), (0.3 - half, -2.0), (0.3 - half, 2.0), (-2.0, 2.0)]),
            ERROR,
        );
        beams.test_and_cover(
            &polygon(&[(0.3 + half, -2.0), (2.0, -2.0), (2.0, 2.0), (0.3 + half, 2.0)]),
            ERROR,
        );
        let visibility = beams.test(&polygon(&[(-0.9, -0.9), (0.9, -0.8), (0.9, 0.9)]));
        assert_eq!(visibility, if seen { Visibility::Seen } else { Visibility::Hidden }, "{gap}");
        let witness = beams.witness;
        assert!(
            !seen || (witness.x - 0.3).abs() <= half && witness.width <= gap,
            "gap {gap}: the witness at {} of width {} is in the gap",
            witness.x,
            witness.width
        );
    }
}

#[test]
fn polygons_with_short_edges_hide_what_is_behind_them() {
    // A spike without its tip, and a strip. The direction of their short edges is undetermined.
    for shape in [
        &[(-0.9, -0.5), (0.9, 1e-9), (0.9, 2e-9), (-0.9, 0.5)][..],
        &[(-0.9, 0.0), (0.9, 0.0), (0.9, 1e-6), (-0.9, 1e-6)],
    ] {
        let mut beams = Beams::default();
        beams.begin(ERROR);
        let shape = polygon(shape);
        assert_eq!(beams.test_and_cover(&shape, ERROR), Visibility::Seen, "the first polygon is seen");
        assert_eq!(beams.test(&shape), Visibility::Hidden, "the same polygon again");
        // Polygons beside the shape stay visible.
        assert_eq!(
            beams.test(&polygon(&[(0.91, -0.1), (0.95, -0.1), (0.95, 0.1), (0.91, 0.1)])),
            Visibility::Seen,
            "a polygon beyond the short edge"
        );
        assert_eq!(
            beams.test(&polygon(&[(-0.5, 0.6), (0.5, 0.6), (0.0, 0.7)])),
            Visibility::Seen,
            "a polygon beside the shape"
        );
    }
    // A polygon that is hardly more than a point hides nothing.
    let mut beams = Beams::default();
    beams.begin(ERROR);
    beams.test_and_cover(&polygon(&[(0.3, 0.3), (0.3 + 1e-13, 0.3), (0.3, 0.3 + 1e-13)]), ERROR);
    assert_eq!(
        beams.test(&polygon(&[(0.2, 0.2), (0.4, 0.2), (0.3, 0.4)])),
        Visibility::Seen,
        "a point hides nothing"
    );
}

/// A tip a few errors wide reaches across a line of the tree, or lies where two lines cross. The part
/// beyond has edges that are short or lie on lines of the tree, and closes no more of its leaf than the
/// polygon covers.
#[test]
fn a_tip_beyond_a_line_of_the_tree_closes_no_leaf() {
    for e in [1e-15, 1e-13, 1e-10, 1e-8] {
        let spike = [(0.3, 0.3), (6.0 * e, 20.0 * e), (-6.0 * e, 0.0), (0.3, -0.1)];
        let crossing = [(-2.6 * e, 0.8 * e), (3.4 * e, -10.5 * e), (-0.1, 0.2)];
        for (shape, beyond) in [
            (&spike[..], square_of([-0.1, 0.12], 0.08)),
            (&spike[..3], square_of([-0.1, 0.12], 0.08)),
            (&crossing, square_of([-0.2, -0.2], 0.15)),
        ] {
            let mut beams = Beams::default();
            beams.begin(e);
            beams.test_and_cover(&polygon(shape), e);
            assert_eq!(beams.test(&beyond), Visibility::Seen, "beyond the tip of {shape:?}");
        }
    }
}

/// The line of an edge of 5e-4 is known to 2.5e-8 far from it. A tip some 1e-8 wide that lies on that line
/// and reaches across another has no edge along the line, and closes no more than the polygon covers.
#[test]
fn a_tip_within_the_margin_of_a_line_is_not_along_it() {
    let mut beams = Beams::default();
    beams.begin(1e-12);
    for shape in [
        &[(0.0, -0.2), (0.1, -0.20025), (0.1, -0.19975)][..],
        &[(0.1, -0.3), (0.24, -0.3), (0.24, -0.2), (0.1, -0.2)],
        &[(0.1 + 5.2e-9, -0.2 - 1.6e-9), (0.1 - 6.8e-9, -0.2 + 21e-9), (0.2, -0.4)],
    ] {
        beams.test_and_cover(&polygon(shape), 1e-12);
    }
    assert_eq!(beams.test(&square_of([0.2, -0.19995], 1e-4)), Visibility::Seen, "a square beside the tip");
}

/// A polygon with a short edge that covers the image closes it: lines that are clear of a leaf do not divide
/// the leaf.
#[test]
fn a_polygon_with_a_short_edge_closes_the_leaves_within_it() {
    let mut beams = Beams::default();
    beams.begin(ERROR);
    let all = polygon(&[(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (2.0 - 1e-13, 2.0), (-2.0, 2.0)]);
    assert_eq!(beams.test_and_cover(&all, ERROR), Visibility::Seen, "a polygon over the open image");
    assert!(beams.is_closed(), "the polygon covers the image");
}

/// Shapes whose corners cluster within some margins of crossings of lines of the tree hide no square that
/// is clear of them all.
#[test]
fn what_is_clear_of_all_polygons_is_seen_whatever_their_tips() {
    let mut random = Random(1);
    let mut told = 0;
    for _ in 0..20_000 {
        let e = random.pick(&[1e-12, 1e-10, 1e-8]);
        let mut beams = Beams::default();
        beams.begin(e);
        let mut shapes: Vec<[(f64, f64); 3]> = Vec::new();
        for _ in 0..random.between(1, 3) {
            let center = [(); 2].map(|()| random.pick(&[-0.25, 0.0, 0.25]));
            let mut corner = || {
                let reach = random.pick(&[1.0, 8.0, 64.0, 0.3 / e]) * e;
                (center[0] + random.range(-reach, reach), center[1] + random.range(-reach, reach))
            };
            let [a, b, c] = core::array::from_fn(|_| corner());
            let turn = (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0);
            let shape = if turn < 0.0 { [a, c, b] } else { [a, b, c] };
            beams.test_and_cover(&polygon(&shape), e);
            shapes.push(shape);
        }
        let probe = [(); 2].map(|()| random.range(-0.5, 0.5));
        let probe_polygon = square_of(probe, 1e-5);
        // Clear of a shape: beyond one of its sides, by more than all margins.
        let is_clear = shapes.iter().all(|shape| {
            (0..3).any(|i| {
                let (p, q) = (shape[i], shape[(i + 1) % 3]);
                let (dx, dy) = (q.0 - p.0, q.1 - p.1);
                let length = dx.hypot(dy);
                let over = |x: f64, y: f64| (dx * (y - p.1) - dy * (x - p.0)) / length;
                probe_polygon.iter().all(|at| over(at.x, at.y) < -1e-6 - 200.0 * e)
            })
        });
        if is_clear {
            told += 1;
            assert_eq!(
                beams.test(&probe_polygon),
                Visibility::Seen,
                "a square at {probe:?} behind {shapes:?}, error {e}"
            );
        }
    }
    assert!(told > 5_000, "{told} squares were clear");
}

#[test]
fn what_is_narrow_itself_is_glimpsed_unless_it_is_covered_for_sure() {
    let mut beams = Beams::default();
    beams.begin(ERROR);
    // With nothing in front: a needle in the middle of the image, and one on a line of the tree.
    let needle =
        |x: f64, low: f64, high: f64| polygon(&[(x, low), (x + 1e-12, low), (x + 1e-12, high), (x, high)]);
    assert_eq!(beams.test(&needle(0.3, -0.5, 0.5)), Visibility::Glimpsed, "a needle with nothing in front");
    assert_eq!(beams.test(&needle(0.0, -0.5, 0.5)), Visibility::Glimpsed, "a needle on a line of the tree");
    // Half of the needle is covered, or all of it, or the needle is within the margin of the covering
    // polygon's edge.
    assert_eq!(
        beams.test_and_cover(&polygon(&[(0.2, -0.6), (0.4, -0.6), (0.4, 0.1), (0.2, 0.1)]), ERROR),
        Visibility::Seen,
        "the covering polygon is seen"
    );
    assert_eq!(beams.test(&needle(0.3, -0.5, 0.5)), Visibility::Glimpsed, "half of the needle is covered");
    assert_eq!(beams.test(&needle(0.3, -0.5, 0.0)), Visibility::Hidden, "all of the needle is covered");
    assert_eq!(
        beams.test(&needle(0.4, -0.5, 0.0)),
        Visibility::Glimpsed,
        "a needle on the covering polygon's edge"
    );
    assert_eq!(
        beams.test(&needle(0.4 - 5e-13, -0.5, 0.0)),
        Visibility::Glimpsed,
        "a needle within the margin of the edge"
    );
    // A needle covers its own area, but not a needle beside it.
    assert_eq!(
        beams.test_and_cover(&needle(-0.3, -0.5, 0.5), 1e-16),
        Visibility::Glimpsed,
        "the first needle is narrow itself"
    );
    assert_eq!(
        beams.test(&needle(-0.3 + 2e-12, -0.5, 0.5)),
        Visibility::Glimpsed,
        "a needle beside the first"
    );
}

#[test]
fn strips_end_where_their_edge_is_too_short_for_a_line() {
    let (error, width) = (1e-8, 3e-7);
    let strip = |left: f64, right: f64| {
        polygon(&[(left, 0.3), (right, 0.3), (right, 0.3 + width), (left, 0.3 + width)])
    };
    for flip in [false, true] {
        let mut beams = Beams::default();
        beams.begin(error);
        let mut before = strip(-0.4, 0.4);
        if flip {
            before.rotate_left(2);
        }
        assert_eq!(
            beams.test_and_cover(&before, error),
            Visibility::Seen,
            "flipped: {flip}: the strip is seen"
        );
        for (left, right) in [(0.41, 0.49), (-0.49, -0.41)] {
            assert_eq!(
                beams.test(&strip(left, right)),
                Visibility::Seen,
                "flipped: {flip}: the strip's continuation from {left} to {right}"
            );
        }
    }
}
