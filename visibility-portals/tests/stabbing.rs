//! Lines through sequences of openings: in the plane against exact arithmetic, in space against planted lines
//! and against separating planes.

use crate::certificates::passes_planes;
use visibility_core::glam::{DVec2, DVec3};
use visibility_portals::stabbing::{Rectangle, Stab, Stabber};
use visibility_testing::Random;

type Ends = [[i64; 2]; 2];

/// Tests in exact arithmetic whether there is a line in the plane that has all left ends on its left or on
/// it, and all right ends on its right or on it. If such a line exists, one passes through two of the ends.
fn has_line(segments: &[Ends]) -> bool {
    let side = |p: [i64; 2], q: [i64; 2], r: [i64; 2]| {
        let [a, b] = [[q[0] - p[0], q[1] - p[1]], [r[0] - p[0], r[1] - p[1]]];
        i128::from(a[0]) * i128::from(b[1]) - i128::from(a[1]) * i128::from(b[0])
    };
    let ends: Vec<[i64; 2]> = segments.iter().flatten().copied().collect();
    ends.iter().any(|&p| {
        ends.iter().filter(|&&q| q != p).any(|&q| {
            // A line along a segment does not pass it.
            let passes = |l: i128, r: i128| l >= 0 && r <= 0 && l != r;
            segments.iter().all(|&[left, right]| passes(side(p, q, left), side(p, q, right)))
        })
    })
}

#[test]
fn doors_of_a_floor_plan_as_exact_arithmetic_has_it() {
    let (mut random, mut stabber) = (Random(1), Stabber::new(1e-7));
    let mut counts = [0; 3];
    for _ in 0..20_000 {
        let mut below = |count| random.below(count) as i64;
        let count = 2 + below(9);
        let segments: Vec<Ends> = (0..count)
            .map(|i| {
                let x = 4 * i + below(3);
                let middle = below(7) - 3;
                let half = 1 + below(5);
                [[x + below(3), middle + half], [x, middle - half]]
            })
            .collect();
        // Coordinates multiplied by 1000, with each segment shortened by a thousandth at both ends.
        let shorter: Vec<Ends> = segments
            .iter()
            .map(|&[l, r]| [[l, r], [r, l]].map(|[a, b]| [999 * a[0] + b[0], 999 * a[1] + b[1]]))
            .collect();
        let as_given = |p: [i64; 2]| DVec2::new(p[0] as f64, p[1] as f64);
        let answer = stabber.segments(&segments.iter().map(|s| s.map(as_given)).collect::<Vec<_>>());
        match answer {
            Stab::Line(_) => {
                assert!(has_line(&segments), "{segments:?}");
                counts[0] += 1;
            }
            Stab::No(certificate) => {
                assert!(!has_line(&shorter), "{segments:?}");
                assert!(
                    certificate.multipliers().all(|(end, _)| end < 2 * segments.len()),
                    "{segments:?}: the certificate names its segments"
                );
                counts[1] += 1;
            }
            Stab::Undecided => {
                assert!(has_line(&segments) && !has_line(&shorter), "{segments:?}");
                counts[2] += 1;
            }
        }
    }
    assert!(counts[0] > 3000 && counts[1] > 3000 && counts[2] < 100, "{counts:?}");
}

/// Returns `count` convex quadrangles around a random line that is clear of their edges by `clearance`, in
/// the unit of the coordinates.
fn around(count: usize, clearance: f64, random: &mut Random) -> Vec<Vec<DVec3>> {
    let (start, direction) = (random.direction() * random.fine_range(0.0, 3000.0), random.direction());
    let mut at = 0.0;
    (0..count)
        .map(|_| {
            at += random.fine_range(0.1, 100.0);
            let normal = loop {
                let normal = random.direction();
                if normal.dot(direction) > 0.1 {
                    break normal;
                }
            };
            let u = normal.any_orthonormal_vector();
            let v = normal.cross(u);
            // The distance within the polygon's plane is at least the distance from the line, so it must be
            // scaled up.
            let least = 1.1 * clearance / normal.dot(direction);
            let mut side = || if random.below(2) == 0 { least } else { random.fine_range(least, 30.0) };
            let middle = start + direction * at;
            let [a, b, c, d] = [side(), side(), side(), side()];
            vec![
                middle - u * a - v * b,
                middle + u * c - v * b,
                middle + u * c + v * d,
                middle - u * a + v * d,
            ]
        })
        .collect()
}

#[test]
fn no_planted_line_is_excluded() {
    let (mut random, mut found) = (Random(2), 0);
    for i in 0..4000 {
        let clearance = [1e-5, 1e-3, 0.1][i % 3];
        let polygons = around(2 + i % 12, clearance, &mut random);
        let answer = Stabber::new(clearance).polygons(&polygons);
        assert!(!answer.is_no(), "{polygons:?}");
        found += u32::from(matches!(answer, Stab::Line(_)));
    }
    assert!(found > 250, "{found}");
}

/// Returns `count` random convex polygons along x, tilted and rotated.
fn sequence(count: usize, random: &mut Random) -> Vec<Vec<DVec3>> {
    (0..count)
        .map(|i| {
            let middle =
                DVec3::new(10.0 * i as f64, random.fine_range(-3.0, 3.0), random.fine_range(-3.0, 3.0));
            let normal = (DVec3::X + random.direction() * 0.7).normalize();
            let u = normal.any_orthonormal_vector();
            let v = normal.cross(u);
            let (turn, long, wide) =
                (random.fine_range(0.0, 6.3), random.fine_range(1.0, 6.0), random.fine_range(0.1, 3.0));
            let (u, v) = (u * turn.cos() + v * turn.sin(), v * turn.cos() - u * turn.sin());
            let corners = 3 + random.below(4);
            (0..corners)
                .map(|k| {
                    let angle = k as f64 / corners as f64 * core::f64::consts::TAU;
                    middle + u * (long * angle.cos()) + v * (wide * angle.sin())
                })
                .collect()
        })
        .collect()
}

#[test]
fn what_separating_planes_exclude_has_no_line_and_some_more_is_excluded() {
    let (mut random, mut stabber) = (Random(3), Stabber::new(1e-6));
    let (mut lines, mut both, mut more, mut open) = (0, 0, 0, 0);
    for i in 0..3000 {
        let polygons = sequence(3 + i % 5, &mut random);
        let passes = passes_planes(&polygons, 1e-6);
        match stabber.polygons(&polygons) {
            Stab::Line(_) => {
                assert!(passes, "{polygons:?}");
                lines += 1;
            }
            Stab::No(certificate) => {
                let edges: usize = polygons.iter().map(Vec::len).sum();
                assert!(
                    certificate.multipliers().count() <= 7,
                    "{polygons:?}: at most seven edges exclude a line"
                );
                assert!(
                    certificate.multipliers().all(|(edge, _)| edge < edges),
                    "{polygons:?}: the certificate names its edges"
                );
                both += u32::from(!passes);
                more += u32::from(passes);
            }
            Stab::Undecided => open += u32::from(passes),
        }
    }
    assert!(lines > 500 && both > 1500 && more > 5 && open < 400, "{lines} {both} {more} {open}");
}

/// Returns `count` axis-aligned rectangles, each beyond the one before. Half of the sequences are centred on
/// the diagonal, the others up to 3 away.
fn rectangles(count: i64, random: &mut Random) -> Vec<Rectangle> {
    let loose = random.below(2) as f64 * 3.0;
    let forward = random.below(2) == 0;
    let mut all: Vec<Rectangle> = (0..count)
        .map(|i| {
            let axis = random.below(3);
            let middle = DVec3::splat(10.0 * i as f64) + random.direction() * loose;
            let (mut low, mut high) =
                ([0; 3].map(|_| random.fine_range(0.2, 5.0)), [0; 3].map(|_| random.fine_range(0.2, 5.0)));
            (low[axis], high[axis]) = (0.0, 0.0);
            Rectangle { min: middle - DVec3::from(low), max: middle + DVec3::from(high), axis, forward }
        })
        .collect();
    if !forward {
        all.reverse();
    }
    all
}

#[test]
fn rectangles_by_three_projections() {
    let (mut random, mut stabber) = (Random(4), Stabber::new(1e-6));
    let (mut lines, mut none, mut open) = (0, 0, 0);
    for i in 0..4000 {
        let all = rectangles(2 + i % 9, &mut random);
        let planted = all.iter().all(|r| {
            // Tests whether the diagonal itself passes the rectangle.
            let p = DVec3::splat(r.min[r.axis]);
            (0..3).all(|k| k == r.axis || p[k] > r.min[k] + 1e-3 && p[k] < r.max[k] - 1e-3)
        });
        match stabber.rectangles(&all) {
            Stab::Line([point, direction]) => {
                for r in &all {
                    let p = point + direction * ((r.min[r.axis] - point[r.axis]) / direction[r.axis]);
                    assert_eq!(
                        direction[r.axis] > 0.0,
                        r.forward,
                        "{all:?}: the line passes each rectangle forwards or not"
                    );
                    assert!((0..3).all(|k| k == r.axis || p[k] > r.min[k] && p[k] < r.max[k]), "{all:?}");
                }
                lines += 1;
            }
            Stab::No(certificate) => {
                assert!(!planted, "{all:?}");
                assert!(
                    certificate.multipliers().count() > 1,
                    "{all:?}: it takes two sides at least to exclude a line"
                );
                none += 1;
            }
            Stab::Undecided => open += 1,
        }
    }
    assert!(lines > 1900 && none > 1200 && open < 800, "{lines} {none} {open}");
}

#[test]
fn what_is_no_sequence_is_not_decided() {
    let mut stabber = Stabber::new(1e-6);
    assert_eq!(stabber.segments(&[]), Stab::Undecided, "no segments");
    assert_eq!(stabber.polygons::<Vec<DVec3>>(&[]), Stab::Undecided, "no polygons");
    for bad in [f64::NAN, f64::INFINITY, 1e300, -1e200] {
        let p = DVec2::splat(bad);
        assert!(!matches!(stabber.segments(&[[p, DVec2::ZERO], [DVec2::X, p]]), Stab::Line(_)), "{bad}");
        let polygon = [DVec3::ZERO, DVec3::X * bad, DVec3::Y];
        assert!(
            !matches!(stabber.polygons(&[polygon, polygon]), Stab::Line(_)),
            "polygons with a vertex at {bad}"
        );
        let r = Rectangle { min: DVec3::ZERO, max: DVec3::splat(bad).with_x(0.0), axis: 0, forward: true };
        assert!(!matches!(stabber.rectangles(&[r, r]), Stab::No(_)), "rectangles with a side at {bad}");
    }
}
