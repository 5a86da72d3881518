//! Each row of a certificate holds for lines that keep only just the clearance.

use super::*;
use crate::integer_vectors::{IntegerVector, Random as Exact};
use visibility_testing::Random;

/// A line (point and unit direction), and a polygon with unit normal `normal` around the line. The lines
/// through the polygon's edges all have the same distance from the given line.
struct Around {
    point: DVec3,
    direction: DVec3,
    normal: DVec3,
    vertices: Vec<DVec3>,
}

fn around(corners: usize, distance: f64, random: &mut Random) -> Around {
    let (point, direction) = (random.direction() * 5.0, random.direction());
    let normal = (direction * [1.0, 1e-3, 0.3][corners % 3] + random.direction() * 1e-6).normalize();
    let normal = if corners % 3 == 2 { (normal + random.direction() * 0.7).normalize() } else { normal };
    let u = direction.any_orthonormal_vector();
    let v = direction.cross(u);
    let turn = random.fine_unit();
    // The circumradius at which the planes along the line that touch the cylinder intersect; the vertices lie
    // there, in the plane of the polygon.
    let radius = distance / (core::f64::consts::PI / corners as f64).cos();
    let vertices = (0..corners).map(|i| {
        let angle = (i as f64 + turn) / corners as f64 * core::f64::consts::TAU;
        let out = (u * angle.cos() + v * angle.sin()) * radius;
        point + out - direction * (normal.dot(out) / normal.dot(direction))
    });
    Around { point, direction, normal, vertices: vertices.collect() }
}

/// Returns `row.normal . x` for the Pluecker coordinates `x` (direction and moment) of a line through `point`
/// along `direction`. The moment is about `origin`, with lengths in units of `unit` world units.
fn value(row: &Row<6>, origin: DVec3, unit: f64, point: DVec3, direction: DVec3) -> f64 {
    let m = (point - origin).cross(direction) / unit;
    let x = [direction.x, direction.y, direction.z, m.x, m.y, m.z];
    row.normal.iter().zip(x).map(|(h, x)| h.hi * x).sum()
}

#[test]
fn edges_moved_by_less_than_the_clearance_are_still_passed() {
    let mut random = Random(1);
    let (clearance, inset) = (1e-2, 0.99e-2);
    let mut tight = 0;
    for i in 0..20_000 {
        let it = around(3 + i % 6, clearance, &mut random);
        if it.normal.dot(it.direction) < 0.05 {
            continue;
        }
        let mut edges = Vec::new();
        edges_of(it.vertices.iter().copied(), it.normal, inset, &mut edges);
        let (origin, unit) = (random.direction(), 4.0);
        let forth = Opening { edges: &edges, against: false, normal: it.normal };
        let back = Opening { edges: &edges, against: true, normal: -it.normal };
        for (j, edge) in edges.iter().enumerate().filter(|(_, edge)| edge.bounds) {
            let row = edge_row(&forth.edge(j), origin, unit);
            let across = it.direction.cross(edge.b - edge.a);
            let at = value(&row, origin, unit, it.point, it.direction);
            // The expected value is proportional to the distance between the line and the edge after the edge
            // was shifted.
            let moved = edge.shift.dot(across.normalize());
            let right = (clearance - moved) * across.length();
            assert!((at - right).abs() < 1e-12 && at > 0.0, "{at} {right}");
            tight += u32::from(at < 0.02 * clearance * across.length());
            // A line in the opposite direction, with the edges reversed.
            let at = value(&edge_row(&back.edge(j), origin, unit), origin, unit, it.point, -it.direction);
            assert!((at - right).abs() < 1e-12, "{at} {right}");
        }
    }
    assert!(tight > 10_000, "{tight}");
}

#[test]
fn no_line_sees_less_of_a_portal_than_the_disc_around_it() {
    let (mut random, mut least) = (Random(2), f64::INFINITY);
    let clearance = 1e-2;
    for i in 0..20_000 {
        let it = around(3 + i % 60, clearance, &mut random);
        let mut edges = Vec::new();
        edges_of(it.vertices.iter().copied(), it.normal, 0.4 * clearance, &mut edges);
        let origin = random.direction();
        for (against, sense) in [(false, 1.0), (true, -1.0)] {
            let opening = Opening { edges: &edges, against, normal: it.normal * sense };
            let row = area_row(&opening, origin, clearance);
            let at = value(&row, origin, 1.0, it.point, it.direction * sense);
            assert!(at > row.least, "{at} {}", row.least);
            least = least.min(at / row.least);
        }
    }
    // The constraint `N . d >= 6 c^2` is nearly tight, since 2 pi c^2 is possible.
    assert!(least < 1.06, "{least}");
}

fn exact(x: DoubleDouble) -> i128 {
    x.hi as i128 + x.lo as i128
}

/// Returns a vector of whole numbers of up to 48 bits, times 1024 for an even `i`: differences of two that
/// follow each other have 58 bits and more, and their products more than double-double numbers hold.
fn whole(random: &mut Exact, i: usize) -> IntegerVector {
    random.vector((1 << 48) - 1).times(if i.is_multiple_of(2) { 1024 } else { 1 })
}

/// The errors of rows cover what double-double numbers round: of an edge alone, of its shift alone, and of
/// both.
#[test]
fn errors_of_rows_cover_their_rounding() {
    let (mut random, mut rounded) = (Exact(1), [0; 4]);
    let mut check = |row: &Row<6>, right: IntegerVector, kind: usize| {
        for k in 0..3 {
            let off = (exact(row.normal[k]) - right.0[k]).abs();
            assert!(off as f64 <= row.error, "kind {kind}: off by {off}, error {}", row.error);
            rounded[kind] += u32::from(off > 0);
        }
        assert!(row.error < 1e8, "kind {kind}: an error of {} beside 2^110", row.error);
    };
    for i in 0..30_000 {
        let [a, b, o] = [0, 1, 3].map(|i| whole(&mut random, i));
        let kind = i % 3;
        let origin = if kind == 1 { a } else { o };
        let shift = random.vector((1 << 52) - 1).times(i128::from(kind > 0));
        let edge = Edge { a: a.to_f64(), b: b.to_f64(), shift: shift.to_f64(), bounds: true };
        let row = edge_row(&edge, origin.to_f64(), 1.0);
        let e = b.minus(a);
        check(&row, a.minus(origin).cross(e).plus(shift.cross(e)), kind);
        assert_eq!([3, 4, 5].map(|k| exact(row.normal[k])), e.0, "case {i}: the edge itself is exact");
    }
    for _ in 0..10_000 {
        let vertices = [0, 1, 2, 3].map(|i| whole(&mut random, i));
        let origin = whole(&mut random, 1);
        let edges = [0, 1, 2, 3].map(|k| {
            let [a, b] = [vertices[k], vertices[(k + 1) % 4]].map(IntegerVector::to_f64);
            Edge { a, b, shift: DVec3::ZERO, bounds: true }
        });
        for (against, sense) in [(false, 1), (true, -1)] {
            let row = area_row(&Opening { edges: &edges, against, normal: DVec3::Z }, origin.to_f64(), 1.0);
            let sum = (0..4).map(|k| vertices[k].cross(vertices[(k + 1) % 4]));
            check(&row, sum.fold(IntegerVector([0; 3]), IntegerVector::plus).times(sense), 3);
        }
    }
    assert!(rounded.iter().all(|&count| count > 1000), "coordinates that were rounded: {rounded:?}");
}

/// Vertices beyond an edge take their distance from its shift. By more than the inset, the edge is not used.
#[test]
fn edges_that_others_lie_beyond_move_less_or_are_not_used() {
    let dent = |depth: f64| {
        // The vertex between the ends of the upper side lies within, by `depth`.
        let corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 4.0 - depth], [0.0, 4.0]];
        let mut edges = Vec::new();
        let vertices = corners.map(|[x, y]| DVec3::new(x, y, 0.0));
        edges_of(vertices.into_iter(), DVec3::Z, 0.125, &mut edges);
        edges
    };
    let flat = dent(0.0);
    assert!(flat.iter().all(|edge| edge.bounds), "a square with a vertex along a side: {flat:?}");
    assert!(flat.iter().all(|edge| (edge.shift.length() - 0.125).abs() < 1e-15), "{flat:?}");
    assert_eq!(flat[0].shift, DVec3::X * 0.125, "the edge from the last vertex to the first");
    // The lines along both parts of the dented side leave the other end beyond them, by twice the depth.
    let slight = dent(0.03125);
    let part = |edges: &[Edge]| {
        edges.iter().filter(|edge| edge.a.y > 3.0 && edge.b.y > 3.0).copied().collect::<Vec<_>>()
    };
    let beyond = 0.0625 / 1f64.hypot(0.03125 / 2.0);
    for edge in part(&slight) {
        assert!(edge.bounds && (edge.shift.length() - (0.125 - beyond)).abs() < 1e-15, "{edge:?}");
        assert!(edge.shift.y < 0.0, "{edge:?}");
    }
    let deep = part(&dent(0.09375));
    assert!(deep.len() == 2 && deep.iter().all(|edge| !edge.bounds), "{deep:?}");
    let mut none = Vec::new();
    edges_of([DVec3::ONE, DVec3::ONE, DVec3::X].into_iter(), DVec3::Z, 0.125, &mut none);
    assert!(!none[1].bounds && none[0].bounds, "an edge without length: {none:?}");
}
