//! The test in Pluecker space excludes some sequences of polygons that separating planes do not, and never a
//! sequence that has a line.

use super::{Opening, Pluecker, edges_of};
use crate::{BakerSettings, CellBaker};
use std::prelude::v1::*;
use std::println;
use visibility_core::bake::Bake;
use visibility_core::cells::{CellGraph, CellId};
use visibility_core::geometry::ConvexPolygon;
use visibility_core::glam::DVec3;
use visibility_testing::Random;

/// Returns a random integer from `-most` to `most`, both included.
fn whole(random: &mut Random, most: i64) -> i64 {
    (random.bits() % (2 * most as u64 + 1)) as i64 - most
}

/// Returns `count` convex polygons, one behind the other around a random line: triangles or quadrangles, or
/// slits if `slits`. Their edges lie in planes parallel to the line: some at `distance` from the line, the
/// others at 0.5 to 4. Each polygon is displaced across the line by up to `off` along each of two axes.
fn around(count: usize, slits: bool, distance: f64, off: f64, random: &mut Random) -> Vec<Vec<DVec3>> {
    let direction = random.direction();
    let (u, start) = (direction.any_orthonormal_vector(), random.direction() * random.fine_range(0.0, 100.0));
    let v = direction.cross(u);
    let mut at = 0.0;
    let mut polygons = Vec::new();
    while polygons.len() < count {
        let corners = if slits { 4 } else { 3 + random.bits() as usize % 2 };
        let turn = random.fine_range(0.0, 1.0);
        let walls: Vec<(DVec3, f64)> = (0..corners)
            .map(|i| {
                let angle = (i as f64 + turn) / corners as f64 * core::f64::consts::TAU;
                let tight = if slits { i % 2 == 0 } else { random.bits().is_multiple_of(2) };
                let far = if tight { distance } else { random.fine_range(0.5, 4.0) };
                (u * angle.cos() + v * angle.sin(), far)
            })
            .collect();
        let normal = (direction + random.direction() * random.fine_range(0.0, 0.9)).normalize();
        at += random.fine_range(1.0, 10.0);
        let moved = (u * random.fine_range(-1.0, 1.0) + v * random.fine_range(-1.0, 1.0)) * off;
        let vertices: Vec<DVec3> = (0..corners)
            .map(|i| {
                // The corner where two planes intersect: out . a = far_a, out . b = far_b.
                let ((a, far_a), (b, far_b)) = (walls[i], walls[(i + 1) % corners]);
                let (ab, sine) = (a.dot(b), 1.0 - a.dot(b) * a.dot(b));
                let out = a * ((far_a - ab * far_b) / sine) + b * ((far_b - ab * far_a) / sine);
                start + moved + out + direction * (at - normal.dot(out) / normal.dot(direction))
            })
            .collect();
        polygons.push(vertices);
    }
    polygons
}

/// Returns whether separating planes leave a line through all polygons: those of a bake in which polygon i
/// is the portal from cell i to cell i + 1.
fn passes_planes(polygons: &[Vec<DVec3>], clearance: f64) -> bool {
    let last = polygons.len() as u32;
    let portals = polygons.iter().map(|p| ConvexPolygon::new(p.iter().copied()).unwrap());
    let graph = CellGraph::new(
        polygons.len() + 1,
        (0..last).zip(portals).map(|(i, portal)| (portal, [CellId(i), CellId(i + 1)])),
    );
    let (graph, settings) = (graph.unwrap(), BakerSettings::default().with_clearance(clearance));
    let outcome = Bake::new(CellBaker::new(&graph, settings).unwrap()).run();
    outcome.matrix.sees(CellId(0), CellId(last))
}

/// Returns the mean of a polygon's corners.
fn middle(polygon: &[DVec3]) -> DVec3 {
    polygon.iter().fold(DVec3::ZERO, |sum, &v| sum + v) / polygon.len() as f64
}

/// Tests whether the test in Pluecker space excludes all lines through `polygons` that keep `clearance` from
/// their edges.
fn excludes(polygons: &[Vec<DVec3>], clearance: f64) -> bool {
    let openings: Vec<_> = polygons
        .iter()
        .map(|polygon| {
            let plane = ConvexPolygon::new(polygon.iter().copied()).unwrap().plane().unwrap();
            let mut edges = Vec::new();
            edges_of(polygon.iter().copied(), plane.normal, 0.4 * clearance, &mut edges);
            (edges, plane.normal)
        })
        .collect();
    let opening = |i: usize| Opening { edges: &openings[i].0, against: false, normal: openings[i].1 };
    let from = middle(&polygons[0]);
    let direction = (middle(&polygons[polygons.len() - 1]) - from).normalize();
    Pluecker::default().excludes(opening, openings.len(), (from, direction), clearance)
}

/// Returns the least distance of the line through `from` and `to` from all edges of `polygons`; negative if
/// the line passes outside one of the polygons. All points are in one space of any unit.
fn clearance_of(polygons: &[Vec<DVec3>], from: DVec3, to: DVec3) -> f64 {
    let d = to - from;
    let mut least = f64::INFINITY;
    for polygon in polygons {
        for (i, &a) in polygon.iter().enumerate() {
            let e = polygon[(i + 1) % polygon.len()] - a;
            let across = d.cross(e);
            least = least.min(across.dot(from - a) / across.length());
        }
    }
    least
}

/// Returns the greatest clearance of a line from all edges that hill climbing from several random starts
/// finds; a lower bound of the true maximum. Uses neither Pluecker coordinates nor separating planes.
fn best_line(polygons: &[Vec<DVec3>], random: &mut Random) -> f64 {
    let ends = [&polygons[0], &polygons[polygons.len() - 1]].map(|p| {
        let middle = middle(p);
        let radius = p.iter().fold(0.0, |r: f64, v| r.max(v.distance(middle)));
        let n = (p[1] - p[0]).cross(p[2] - p[0]).normalize();
        let u = n.any_orthonormal_vector();
        (middle, radius, u, n.cross(u))
    });
    let at = |x: &[f64; 4]| {
        let [a, b] = [0, 1].map(|i| {
            let (middle, radius, u, v) = ends[i];
            middle + (u * x[2 * i] + v * x[2 * i + 1]) * radius
        });
        clearance_of(polygons, a, b)
    };
    let mut best_of_all = f64::NEG_INFINITY;
    for _ in 0..6 {
        let mut x = [0; 4].map(|_| random.fine_range(-0.6, 0.6));
        let (mut best, mut step) = (at(&x), 0.5);
        while step > 1e-10 {
            let mut better = false;
            for _ in 0..24 {
                let y: [f64; 4] = core::array::from_fn(|k| x[k] + step * random.fine_range(-1.0, 1.0));
                let there = at(&y);
                if there > best {
                    (x, best, better) = (y, there, true);
                }
            }
            step *= if better { 1.3 } else { 0.5 };
        }
        best_of_all = best_of_all.max(best);
    }
    best_of_all
}

#[test]
fn no_line_that_is_just_clear_is_excluded() {
    let mut random = Random(1);
    for i in 0..60_000 {
        let clearance = 2e-6 * 500f64.powf(random.fine_range(0.0, 1.0));
        let polygons = around(2 + i % 5, i % 2 == 0, clearance * 1.0001, 0.0, &mut random);
        assert!(!excludes(&polygons, clearance), "case {i}, clearance {clearance}: {polygons:?}");
        if i % 50 == 0 {
            assert!(passes_planes(&polygons, clearance), "case {i}, clearance {clearance}: {polygons:?}");
        }
    }
}

/// Vertices off the planes of their portals, by up to 10^-6 of the size, take their distance from the
/// clearance of lines.
#[test]
fn lines_through_bent_portals_are_not_excluded() {
    let (mut random, mut bent, mut tried) = (Random(5), 0, 0);
    for i in 0..3_000 {
        let clearance = 2e-6 * 500f64.powf(random.fine_range(0.0, 1.0));
        let mut polygons = around(2 + i % 3, true, clearance, 0.0, &mut random);
        let line = [middle(&polygons[0]), middle(&polygons[polygons.len() - 1])];
        let mut off: f64 = 0.0;
        for polygon in &mut polygons {
            let plane = ConvexPolygon::new(polygon.iter().copied()).unwrap().plane().unwrap();
            let by = 5e-7 * polygon.iter().fold(0.0, |size: f64, v| size.max((*v - polygon[0]).length()));
            polygon.iter_mut().for_each(|v| *v += plane.normal * random.fine_range(-by, by));
            let Ok(moved) = ConvexPolygon::new(polygon.iter().copied()) else { continue };
            let plane = moved.plane().unwrap();
            off = polygon.iter().fold(off, |off, &v| off.max(plane.signed_distance(v).abs()));
        }
        if polygons.iter().any(|polygon| ConvexPolygon::new(polygon.iter().copied()).is_err()) {
            continue;
        }
        let clear = (clearance_of(&polygons, line[0], line[1]) - off) * 0.9999;
        if clear > 1e-6 {
            assert!(passes_planes(&polygons, clear), "case {i}, clearance {clear}: {polygons:?}");
            assert!(!excludes(&polygons, clear), "case {i}, clearance {clear}: {polygons:?}");
            tried += 1;
            bent += u32::from(off > 0.1 * clear);
        }
    }
    assert!(
        tried > 100 && bent > 20,
        "{tried} lines, {bent} through portals bent by a tenth of the clearance"
    );
}

#[test]
fn what_is_nearly_passed_is_rejected_and_no_search_finds_a_line() {
    let mut random = Random(2);
    let (mut rejected, mut more, mut lines) = (0, 0, 0);
    for i in 0..2_500 {
        let clearance = 2e-6 * 500f64.powf(random.fine_range(0.0, 1.0));
        let off = clearance * 1e5f64.powf(random.fine_range(0.0, 1.0));
        let polygons = around(3 + i % 6, i % 4 > 0, clearance * 1.5, off, &mut random);
        let middle_line = [&polygons[0], &polygons[polygons.len() - 1]].map(|polygon| middle(polygon));
        if excludes(&polygons, clearance) {
            rejected += 1;
            let is_more = passes_planes(&polygons, clearance);
            more += u32::from(is_more);
            if is_more || i % 50 == 0 {
                let best = best_line(&polygons, &mut random);
                assert!(best < clearance, "case {i}: a line keeps {best} of {clearance}: {polygons:?}");
            }
        } else if i % 8 == 0 && clearance_of(&polygons, middle_line[0], middle_line[1]) > clearance {
            // Checks the hill climbing itself: it must find a line where one is known to exist.
            lines += 1;
            let best = best_line(&polygons, &mut random);
            assert!(best >= clearance, "case {i}: the climb ends at {best} of {clearance}: {polygons:?}");
        }
    }
    println!("{rejected} rejected, {more} past planes, {lines} lines");
    assert!(rejected > 800 && more > 200 && lines > 10, "{rejected} {more} {lines}");
}

/// No line is excluded far from the origin, for triangles of integers around the third axis that are rotated
/// and moved without any rounding. At these positions the linear program in `f64` reports contradictions that
/// do not exist.
#[test]
fn far_from_the_origin_nothing_with_a_line_is_excluded() {
    let mut random = Random(3);
    let turns = [[1, 2, 2], [2, 1, -2], [2, -2, 1]];
    for i in 0..40_000 {
        let far = 1i64 << (20 + i % 26);
        let shift = [0; 3].map(|_| whole(&mut random, far));
        let mut least = f64::INFINITY;
        let mut z = 0;
        let polygons: Vec<Vec<DVec3>> = (0..2 + i % 5)
            .map(|_| {
                z += 200 + whole(&mut random, 100);
                let corners = loop {
                    let mut corners: [[i64; 3]; 3] = core::array::from_fn(|_| {
                        [whole(&mut random, 40), whole(&mut random, 40), z + whole(&mut random, 20)]
                    });
                    let side = |a: [i64; 3], b: [i64; 3]| a[0] * b[1] - a[1] * b[0];
                    let mut sides = [0, 1, 2].map(|k| side(corners[k], corners[(k + 1) % 3]));
                    if sides.iter().all(|&s| s < 0) {
                        corners.swap(1, 2);
                        sides = [0, 1, 2].map(|k| side(corners[k], corners[(k + 1) % 3]));
                    }
                    if sides.iter().all(|&s| s > 0) {
                        for k in 0..3 {
                            let (a, b) = (corners[k], corners[(k + 1) % 3]);
                            let length = ((b[0] - a[0]) as f64).hypot((b[1] - a[1]) as f64);
                            least = least.min(3.0 * sides[k] as f64 / length);
                        }
                        break corners;
                    }
                };
                let placed = |c: [i64; 3]| {
                    let turned = |t: [i64; 3]| t[0] * c[0] + t[1] * c[1] + t[2] * c[2];
                    // The rotation includes a reflection, so the order of the corners is reversed.
                    DVec3::from_array([0, 1, 2].map(|k| (turned(turns[k]) + shift[k]) as f64))
                };
                let mut polygon = corners.map(placed).to_vec();
                polygon.reverse();
                polygon
            })
            .collect();
        assert!(!excludes(&polygons, 0.99 * least), "case {i}, clearance {least}: {polygons:?}");
    }
}
