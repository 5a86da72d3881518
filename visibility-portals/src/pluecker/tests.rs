//! Each row of a certificate holds for lines that keep only just the clearance.

use super::*;
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
