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
    // Within the margin, some 3.7e-12, on the covered side.
    for inside in [2e-12, 3.2e-12] {
        assert_eq!(
            beams.test(&needle(0.4 - inside, -0.5, 0.0)),
            Visibility::Glimpsed,
            "a needle {inside} beyond the edge"
        );
    }
    assert_eq!(beams.test(&needle(0.4 - 6e-12, -0.5, 0.0)), Visibility::Hidden, "a needle beyond the margin");
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

/// Ends of an edge that are off by their error to both sides move the line by so much at the far end of the
/// image, 2.9 from the edge.
#[test]
fn the_margin_of_a_line_is_four_times_what_the_errors_of_its_ends_are_far_away() {
    for (length, error) in
        [(0.5, 1e-12), (0.01, 1e-13), (2.0, 1e-9), (0.001, 1e-11), (0.001, 1.5e-12), (0.3, 1e-9)]
    {
        let [p, q] = [(0.0, error), (length, -error)].map(|(x, y)| ImageCorner::new(x, y));
        let (line, sure) = Line::through(p, q, error).unwrap();
        let moved = line.distance(ImageCorner::new(length + 2.9, 0.0)).abs();
        let wanted = 4.0 * moved;
        assert!(
            (line.margin / wanted.min(2.5e-8) - 1.0).abs() < 0.01,
            "{} for {wanted}: {length}",
            line.margin
        );
        assert_eq!(sure, wanted <= 2.5e-8, "{length} long, off by {error}: the margin holds everywhere");
        // Edges along the line are eight margins long, in either direction.
        for (share, is) in [(1.02, true), (0.98, false)] {
            let reach = share * 8.0 * line.margin;
            for (x, y) in [(reach, 0.0), (0.0, -reach)] {
                let [p, q] = [(0.0, 0.0), (x, y)].map(|(x, y)| ImageCorner::new(x, y));
                assert_eq!(line.is_along(p, q), is, "{share} of eight margins");
            }
            let q = ImageCorner::new(share * 64.0 * error, 0.0);
            assert_eq!(
                Line::through(ImageCorner::new(0.0, 0.0), q, error).is_some(),
                is,
                "{share} of 64 errors"
            );
        }
    }
    let [origin, bad] = [0.0, f64::NAN].map(|x| ImageCorner::new(x, 0.0));
    assert!(Line::through(origin, bad, 1e-12).is_none(), "a corner that is not a number");
}

#[test]
fn lines_of_the_grid_have_the_error_of_four_corners() {
    let mut beams = Beams::default();
    beams.begin(1e-10);
    assert_eq!(beams.nodes.len(), 4 + 63, "sides of the image and lines of the grid");
    assert!(beams.nodes.iter().all(|node| node.line.margin == 4e-10), "margins: {:?}", beams.nodes);
}

/// The substitute of an edge that is too short for a line is perpendicular to the edge before, and passes
/// through the end that comes first along it.
#[test]
fn a_short_edge_is_bounded_where_it_begins_along_the_edge_before() {
    let (mut beams, error) = (Beams::default(), 1e-10);
    beams.begin(error);
    for shift in [3e-9, -3e-9] {
        let shape = polygon(&[(0.1, 0.1), (0.4, 0.1), (0.4 + shift, 0.1 + 4e-9), (0.1, 0.3)]);
        beams.test_and_cover(&shape, error);
        let (line, sure) = beams.lines[1].expect("a substitute");
        let first = shift.min(0.0) + 0.4;
        assert!(!sure && line.distance(ImageCorner::new(first, 0.2)).abs() < 1e-15, "{line:?}");
        assert!(
            (line.distance(ImageCorner::new(0.1, 0.2)) - 0.3).abs() < 1e-8,
            "{line:?} has the shape inside"
        );
        assert!((line.margin / (4.0 * error * (1.0 + 5.8 / 0.3)) - 1.0).abs() < 1e-9, "margin of {line:?}");
    }
}

#[test]
fn what_narrow_parts_show_together_is_wide_by_their_area_and_extent() {
    for axis in 0..2 {
        let at = |along: f64, across: f64| if axis == 0 { (along, across) } else { (across, along) };
        // Two parts, each a half long, side by side or one after the other.
        let part = |along: f64, width: f64| {
            polygon(&[at(along, 0.0), at(along + 0.5, 0.0), at(along + 0.5, width), at(along, width)])
        };
        for (second, width, wide) in [(0.0, 0.6e-7, true), (0.5, 0.6e-7, false), (0.5, 1.1e-7, true)] {
            for apart in [false, true] {
                let (mut one, mut two) = (Glimpse::default(), Glimpse::default());
                one.add_part(&part(0.0, width), 0.5 * width);
                let last = if apart { &mut two } else { &mut one };
                last.add_part(&part(second, width), 0.5 * width);
                one.add(&two);
                assert_eq!(one.is_wide(), wide, "{width} at {second}, axis {axis}, of two polygons: {apart}");
                let mut other = Glimpse::default();
                other.add(&one);
                assert_eq!(other.is_wide(), wide, "the same, added to none");
            }
        }
    }
}

#[test]
fn a_needle_on_a_line_of_the_tree_closes_nothing() {
    for x in [0.0, 1e-13, -2e-13] {
        let mut beams = Beams::default();
        beams.begin(ERROR);
        let needle = polygon(&[(x, -0.2), (x + 1e-13, -0.2), (x + 1e-13, -0.05), (x, -0.05)]);
        assert_eq!(beams.test_and_cover(&needle, ERROR * 1e-3), Visibility::Glimpsed, "the needle at {x}");
        for beside in [-0.1, 0.05] {
            assert_eq!(
                beams.test(&square_of([beside, -0.15], 0.05)),
                Visibility::Seen,
                "{beside} beside {x}"
            );
        }
    }
}

/// The base of a flat triangle is within the margin of a line of the tree, and its apex hardly beyond on the
/// other side. Closed on the wrong side, it would cover the wedge between its other edges.
#[test]
fn a_flat_triangle_across_a_line_covers_on_the_side_of_its_apex_alone() {
    let error = 1e-10;
    for side in [1.0, -1.0] {
        let mut beams = Beams::default();
        beams.begin(error);
        let [base, apex] = [0.9, -1.1].map(|share| side * share * 4.0 * error);
        let mut shape = polygon(&[(base, -0.2), (base, -0.1), (apex, -0.15)]);
        if side < 0.0 {
            shape.reverse();
        }
        beams.test_and_cover(&shape, error);
        for beside in [-0.1, 0.05] {
            let square = square_of([beside, -0.16], 0.02);
            assert_eq!(beams.test(&square), Visibility::Seen, "{beside} beside it, base at {base}");
        }
    }
}

#[test]
fn a_tip_in_another_leaf_does_not_end_the_search_for_what_is_seen() {
    let mut beams = Beams::default();
    beams.begin(ERROR);
    let tip = polygon(&[(-0.2, -0.2), (5e-8, -0.1), (-0.2, -0.05)]);
    assert_eq!(beams.test(&tip), Visibility::Seen, "the part before the line");
    let point = ImageCorner::new(0.3, 0.2);
    assert_eq!(witness(&[point; 3]).0.width, 0.0, "width of a point");
}
