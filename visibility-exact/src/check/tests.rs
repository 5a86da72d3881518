//! Proofs that were changed after they were made are refused.

use super::context::{Check, Divider};
use super::exact_side::side;
use super::surface::crosses;
use crate::half::Half;
use crate::line_side::{Crossing, Edge, segment_triangle};
use crate::polygon::Polygon;
use crate::proof::{LoopEdge, Proof, Step};
use crate::search::{Answer, Budget, Search};
use crate::side_signs::{NEGATIVE, POSITIVE, signs};
use crate::sight::{CellBox, Sight, Target};
use crate::triangles::SceneTriangles;
use std::{vec, vec::Vec};
use visibility_core::glam::{DQuat, DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Object, Scene};
use visibility_testing::Random;

/// A target behind two walls with slits that are not in line, and its proof.
fn hidden() -> (SceneTriangles, Proof) {
    let plate = |x: f32, y: [f32; 2], r: f32| {
        let [a, b, c, d] = [(y[0], -r), (y[1], -r), (y[1], r), (y[0], r)].map(|(y, z)| Vec3::new(x, y, z));
        vec![[a, b, c], [a, c, d]]
    };
    let slit = |x: f32, y: f32| [plate(x, [-30.0, y - 0.1], 10.0), plate(x, [y + 0.1, 30.0], 10.0)].concat();
    let mut scene = Scene::new();
    for triangles in [plate(20.0, [-0.5, 0.5], 5.0), slit(5.0, 0.0), slit(10.0, 0.5)] {
        let bounds = Aabb::from_points(triangles.iter().flatten().copied());
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        scene.set_triangles(id, triangles).unwrap();
    }
    let triangles = SceneTriangles::new(&scene);
    let cell = Viewcell::from_box(DVec3::new(0.0, -0.5, 1.0), DVec3::new(1.0, 0.5, 2.0));
    let cell = CellBox::new(&cell, DVec3::ZERO).unwrap();
    let target = Target::Triangle(0);
    let mut search = Search::new(&triangles, cell, 1e-4, None);
    assert_eq!(
        search.solve_target(target, Budget { nodes: 20_000, divided: 200, halvings: 12 }).0,
        Answer::Hidden,
        "the target is hidden"
    );
    let steps = core::mem::take(&mut search.steps);
    (triangles, Proof { cell, target, clearance: 1e-4, steps })
}

#[test]
fn proofs_with_a_changed_step_are_refused() {
    let (triangles, proof) = hidden();
    proof.check(&triangles).unwrap();
    let is_refused = |steps: Vec<Step>| Proof { steps, ..proof.clone() }.check(&triangles).is_err();
    assert!(is_refused(proof.steps[1..].to_vec()), "a missing step");
    assert!(is_refused([&proof.steps[..], &proof.steps[..1]].concat()), "a step too many");
    let mut kinds = [0; 3];
    for (at, step) in proof.steps.iter().enumerate() {
        let with = |changed: Step| {
            let mut steps = proof.steps.clone();
            steps[at] = changed;
            steps
        };
        match step.clone() {
            Step::Surface { triangles: surface, moved, line } => {
                kinds[0] += 1;
                for drop in 0..surface.len() {
                    let triangles = surface.iter().enumerate().filter(|(k, _)| *k != drop);
                    let triangles = triangles.map(|(_, t)| *t).collect();
                    let changed = Step::Surface { triangles, moved: moved.clone(), line };
                    // Of a surface with several triangles, one may be dispensable.
                    assert!(surface.len() > 1 || is_refused(with(changed)), "an empty surface");
                }
                for far in [0.01, 10.0, f64::NAN] {
                    let all = surface
                        .iter()
                        .flat_map(|&t| triangles.vertices(t).into_iter().zip(triangles.corners(t)));
                    let mut moved: Vec<(u32, DVec3)> = all.map(|(v, x)| (v, x + DVec3::splat(far))).collect();
                    moved.sort_by_key(|entry| entry.0);
                    moved.dedup_by_key(|entry| entry.0);
                    let changed = Step::Surface { triangles: surface.clone(), moved: moved.into(), line };
                    assert!(is_refused(with(changed)), "a boundary moved too far");
                }
                let away = line.map(|x| x + DVec3::Y * 100.0);
                let changed = Step::Surface { triangles: surface.clone(), moved: moved.clone(), line: away };
                assert!(is_refused(with(changed)), "a line of another node");
                let twice = [&surface[..], &surface[..]].concat().into();
                assert!(is_refused(with(Step::Surface { triangles: twice, moved, line })), "an even surface");
            }
            Step::Loop { piece, ring, side, edges } => {
                kinds[1] += 1;
                let changed = Step::Loop { piece, ring: ring.clone(), side: -side, edges: edges.clone() };
                assert!(is_refused(with(changed)), "the other side");
                for part in [1.01, 1.0003] {
                    let large = ring.iter().map(|&(x, tag)| (x * part, tag)).collect();
                    let changed = Step::Loop { piece, ring: large, side, edges: edges.clone() };
                    assert!(is_refused(with(changed)), "a loop away from its occluder");
                }
                let inside = edges.iter().map(|_| LoopEdge::Inside).collect();
                let all_inside = edges.iter().all(|edge| *edge == LoopEdge::Inside);
                let changed = Step::Loop { piece, ring, side, edges: inside };
                assert!(all_inside || is_refused(with(changed)), "edges that divide");
            }
            Step::Empty { weights } => {
                kinds[2] += 1;
                let zero = weights.iter().map(|_| 0.0).collect();
                assert!(is_refused(with(Step::Empty { weights: zero })), "no weights");
                let less = weights.iter().map(|w| -w).collect();
                assert!(is_refused(with(Step::Empty { weights: less })), "negative weights");
            }
            Step::Halves { .. } | Step::Split { .. } | Step::Corner { .. } => {}
        }
    }
    assert!(kinds[0] > 0 && kinds[1] > 0, "{kinds:?}");
}

/// An edge in the plane of the viewcell polygon P, which the target polygon Q touches with one side. If the
/// edge passes between starting points of lines, lines pass it on both sides. If all lines start on one side
/// of it, all pass it on that side: lines to the touching side of Q are in one plane with the edge and do not
/// count. The same holds with P and Q exchanged.
#[test]
fn edges_in_the_plane_of_a_face_divide_the_lines_that_start_around_them() {
    let (triangles, _) = hidden();
    let quad = |corners: [[f64; 3]; 4]| Polygon::new(&corners.map(DVec3::from_array));
    let floor = quad([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0]]);
    let wall = quad([[10.0, 0.0, 0.0], [10.0, 4.0, 0.0], [10.0, 4.0, 3.0], [10.0, 0.0, 3.0]]);
    let above = Half { normal: DVec3::Z, offset: 0.0 };
    let before = Half { normal: -DVec3::X, offset: 10.0 };
    let from_floor = Sight { p: floor, q: wall, before_p: above, before_q: before, near: None };
    let from_wall = Sight { p: wall, q: floor, before_p: before, before_q: above, near: None };
    let steps = Vec::new();
    let check = Check {
        triangles: &triangles,
        clearance: 0.0,
        delta: 1e-12,
        target_vertices: vec![],
        steps: steps.iter(),
        splits: 0,
    };
    for sight in [from_floor, from_wall] {
        for (x, is_divided) in [(2.0, true), (6.0, false)] {
            let ends = [DVec3::new(x, -5.0, 0.0), DVec3::new(x, 9.0, 0.0)];
            let found = signs(&sight, &Edge::new(ends[0], ends[1]), check.delta);
            assert_eq!(found == POSITIVE || found == NEGATIVE, !is_divided, "{x}: {found}");
            assert_ne!(found, 0, "{x}: a sign is possible");
            let edge = ends.map(|end| (end, None));
            let on_a_side = [1.0, -1.0].map(|side| check.is_on_side(&sight, &edge, side));
            assert_eq!(on_a_side.contains(&true), !is_divided, "{x}: {on_a_side:?}");
        }
    }
}

/// Edges in or near the plane of the target polygon, which is tilted, so that points lie on it only up to
/// rounding. An edge in the plane but beside the polygon, and an edge behind the plane, are passed on one
/// side by all lines. An edge across the polygon, or in front of the plane, is passed on both sides.
#[test]
fn edges_near_the_plane_of_a_face_are_in_it() {
    let (triangles, _) = hidden();
    let mut random = Random(12);
    for _ in 0..200 {
        let turn = DQuat::from_axis_angle(random.direction(), random.fine_range(-3.0, 3.0));
        let at = |x: f64, y: f64, z: f64| turn * DVec3::new(x, y, z);
        let floor =
            Polygon::new(&[at(0.0, 0.0, 0.0), at(4.0, 0.0, 0.0), at(4.0, 4.0, 0.0), at(0.0, 4.0, 0.0)]);
        let wall =
            Polygon::new(&[at(10.0, 0.0, 0.0), at(10.0, 4.0, 0.0), at(10.0, 4.0, 3.0), at(10.0, 0.0, 3.0)]);
        let before_p = Half { normal: at(-1.0, 0.0, 0.0), offset: 10.0 };
        let before_q = Half { normal: at(0.0, 0.0, 1.0), offset: 0.0 };
        let sight = Sight { p: wall, q: floor, before_p, before_q, near: Some(1e-13) };
        let (target_vertices, steps) = (vec![], [].iter());
        let check =
            Check { triangles: &triangles, clearance: 1e-4, delta: 8e-13, target_vertices, steps, splits: 0 };
        for (x, height, is_divided) in
            [(2.0, 0.0, true), (6.0, 0.0, false), (6.0, -1e-9, false), (6.0, 1e-9, true), (6.0, 1e-11, true)]
        {
            let ends = [at(x, -5.0, height), at(x, 9.0, height)];
            let found = signs(&sight, &Edge::new(ends[0], ends[1]), sight.side_error(check.delta));
            assert_eq!(found == POSITIVE || found == NEGATIVE, !is_divided, "{x} {height}: {found}");
            let edge = ends.map(|end| (end, None));
            let on_a_side = [1.0, -1.0].map(|side| check.is_on_side(&sight, &edge, side));
            assert_eq!(on_a_side.contains(&true), !is_divided, "{x} {height}: {on_a_side:?}");
        }
        // An edge with only one end in the plane.
        let [a, b] = [(at(6.0, -5.0, 0.0), None), (at(6.0, 9.0, 1e-3), None)];
        assert!(
            [1.0, -1.0]
                .iter()
                .all(|&side| !check.is_on_side(&sight, &[a, b], side)
                    && !check.is_on_side(&sight, &[b, a], side)),
            "an edge of which one end is in the plane"
        );
        // If the edge and all corners of both polygons are in one plane, the lines pass the edge on no side.
        let corners = [at(9.0, 0.0, 0.0), at(10.0, 0.0, 0.0), at(10.0, 4.0, 0.0)];
        let flat = Sight { p: Polygon::new(&corners), ..sight };
        let edge = [(at(2.0, -5.0, 0.0), None), (at(2.0, 9.0, 0.0), None)];
        assert!(
            [1.0, -1.0].iter().all(|&side| !check.is_on_side(&flat, &edge, side)),
            "an edge in the plane of all points"
        );
    }
}

fn moved(v: DVec3, delta: f64, random: &mut Random) -> DVec3 {
    v + DVec3::from_array(core::array::from_fn(|_| if random.one_in(2) { delta } else { -delta }))
}

/// A line that meets an edge counts as on no side of the edge, also after all positions have moved by their
/// error.
#[test]
fn lines_that_meet_an_edge_are_on_no_side() {
    let mut random = Random(3);
    for _ in 0..20_000 {
        let mut int = |r: i32| DVec3::from_array(core::array::from_fn(|_| f64::from(random.between(-r, r))));
        let (p, a, b) = (int(1000), int(1000), int(1000));
        let line = [p, a + (a - p) * 2.0, a, b];
        let delta = 1e-7;
        let [p, q, a, b] = line.map(|v| moved(v, delta, &mut random));
        let (value, error) = side(p, q, a, b, delta * 1.001);
        assert!(value.abs() <= error, "{p} {q} {a} {b}");
    }
}

/// Coordinates are integers of 40 bits. A line that exactly meets the line of an edge counts as on no side of
/// it; a line beside the edge as on the right side or on none.
#[test]
fn sides_have_the_sign_of_exact_ones() {
    let mut random = Random(4);
    for round in 0..20_000 {
        let mut point = || core::array::from_fn::<i64, 3, _>(|_| random.bits() as i64 >> 24);
        let (p, a, b, near) = (point(), point(), point(), point());
        let beside = if round % 2 == 0 { 0 } else { 1 };
        let q = core::array::from_fn(|k| a[k] + b[k] - p[k] + beside * (near[k] % 2));
        let [r, u, w] = [q, a, b].map(|x| core::array::from_fn::<i128, 3, _>(|k| (x[k] - p[k]).into()));
        let exact: i128 =
            (0..3).map(|k| r[k] * (u[(k + 1) % 3] * w[(k + 2) % 3] - u[(k + 2) % 3] * w[(k + 1) % 3])).sum();
        let [p, q, a, b] = [p, q, a, b].map(|x| DVec3::from_array(x.map(|x| x as f64)));
        let (value, error) = side(p, q, a, b, 0.0);
        assert!(value.abs() <= error || (value > 0.0) == (exact > 0) && exact != 0, "{p} {q} {a} {b}");
    }
}

/// A segment that crosses a triangle 2e-27 m from one of its edges, which integers in units of 2^-51 m show
/// exactly. The search is certain of the crossing: its error bound depends on the terms of the determinant,
/// which are far smaller here than the product of the distances. The check must find the same crossing, here
/// and for random segments near an edge.
#[test]
fn what_the_search_is_sure_to_cross_is_crossed() {
    let t = [[8.0, 3.0, 4.0], [8.0, 13.0, 18.0], [8.0, 3.0, 18.0]];
    let line = [[-2.5, 3.000_000_000_000_511_6, 4.0], [8.000_000_000_000_048, 3.0, 4.000_000_000_000_682]];
    let exact = |x: f64| {
        let scaled = x * (1u64 << 51) as f64;
        assert_eq!(scaled, scaled.trunc(), "{x} has more digits than integers of the test");
        scaled as i128
    };
    let minus = |a: [f64; 3], b: [f64; 3]| core::array::from_fn::<i128, 3, _>(|k| exact(a[k]) - exact(b[k]));
    let sign = |r: [i128; 3], u: [i128; 3], w: [i128; 3]| {
        let cross = |k: usize| u[(k + 1) % 3] * w[(k + 2) % 3] - u[(k + 2) % 3] * w[(k + 1) % 3];
        (0..3).map(|k| r[k] * cross(k)).sum::<i128>().signum()
    };
    // Sides of the triangle in whole metres, so that their products fit into the integer type.
    let edge = |k: usize| minus(t[(k + 1) % 3], t[k]).map(|x| x >> 51);
    let sides = [0, 1, 2].map(|k| sign(minus(line[1], line[0]), minus(t[k], line[0]), edge(k)));
    assert!(sides[0] != 0 && sides == [sides[0]; 3], "{sides:?}");
    assert_eq!(
        line.map(|x| sign(minus(x, t[0]), edge(0), edge(1))).iter().product::<i128>(),
        -1,
        "the segment's ends are on both sides of the triangle's plane"
    );
    let (line, t) = (line.map(DVec3::from_array), t.map(DVec3::from_array));
    assert_eq!(segment_triangle(line[0], line[1], &t), Crossing::Yes, "the search is sure of the crossing");
    assert_eq!(crosses(line, &t), Some(true), "the check finds the same crossing");
    // Segments that pass near an edge, with a random scale on each axis.
    let mut random = Random(8);
    let mut sure = 0;
    for round in 0..50_000 {
        let tiny = |random: &mut Random| {
            let part = |random: &mut Random| match random.below(3) {
                0 => 0.0,
                _ => random.fine_range(-1.0, 1.0) * 10f64.powf(random.fine_range(-16.0, -8.0)),
            };
            DVec3::from_array(core::array::from_fn(|_| part(random)))
        };
        let mut int = |r: i32| DVec3::from_array(core::array::from_fn(|_| f64::from(random.between(-r, r))));
        let (t, p) = ([int(9), int(9), int(9)], int(9));
        let part = f64::from(round % 3) * 0.5;
        let q = t[0] + (t[1] - t[0]) * part + tiny(&mut random);
        let line = [p + tiny(&mut random), q];
        let expected = match segment_triangle(line[0], line[1], &t) {
            Crossing::Yes => true,
            Crossing::No => false,
            Crossing::Unsure => continue,
        };
        sure += 1;
        assert_eq!(crosses(line, &t), Some(expected), "{round}");
    }
    assert!(sure > 10_000, "{sure}");
}

/// After all positions have moved by their error, points that touch a polygon are still not apart from it,
/// points that touch a segment between polygons are not outside, and a line that meets the dividing edges is
/// not excluded.
#[test]
fn what_touches_by_less_than_the_error_is_not_apart() {
    let (triangles, proof) = hidden();
    let mut random = Random(9);
    let delta = 1e-9;
    let check = Check {
        triangles: &triangles,
        clearance: 0.0,
        delta,
        target_vertices: vec![],
        steps: [].iter(),
        splits: 0,
    };
    for round in 0..4000 {
        let mut int = |r: i32| DVec3::from_array(core::array::from_fn(|_| f64::from(random.between(-r, r))));
        let (a, b) = (int(40), int(40) + DVec3::X * 100.0);
        let (u, v, w, x) = (int(8), int(8), int(8), int(8));
        let ends = [int(9), int(9), int(9)];
        if u.cross(v) == DVec3::ZERO || w.cross(x) == DVec3::ZERO {
            continue;
        }
        let exact = [[a, a + u, a + u + v, a + v], [b, b + w, b + w + x, b + x]];
        let [p, q] = exact.map(|corners| Polygon::new(&corners.map(|v| moved(v, delta, &mut random))));
        let plane = |polygon: &Polygon| {
            let normal = polygon.normal().normalize();
            let offset = polygon.corners().iter().map(|v| -normal.dot(*v)).fold(f64::MIN, f64::max);
            Half { normal, offset }
        };
        let sight = Sight { p, q, before_p: plane(&p), before_q: plane(&q), near: None };
        let (x, y) = (exact[0][round % 4], exact[1][round / 4 % 4]);
        for part in [0.0, 0.25, 0.5, 1.0] {
            assert!(!check.is_outside(&sight, &[x + (y - x) * part]), "{round}");
        }
        let touching = [y, y + random.fine_vector(5.0), y + random.fine_vector(5.0)];
        assert!(!check.is_apart(&sight, &touching), "{round}");
        // Edges that meet the line between two corners in one point.
        let middle = (x + y) * 0.5;
        let edges =
            ends.map(|end| [middle - end, middle + end].map(|x| (moved(x, delta, &mut random), None)));
        let rows: [Divider; 3] = edges.map(|edge| (edge, 1.0));
        for row in &rows {
            assert!(!check.excludes(&sight, &[*row], &[1.0]), "{round}");
        }
        assert!(!check.corner_excludes(&sight, [&rows[0], &rows[1], &rows[2]]), "{round}");
    }
    assert!(proof.len() > 1, "the proof has several steps");
}

/// Without a clearance, a line that passes an edge within the error of positions is on neither side of it. A
/// proof that holds in a scene of small coordinates is refused if one far triangle makes the error larger.
#[test]
fn without_clearance_edges_within_the_error_of_positions_are_met() {
    let scene = |far: f32| {
        let mut scene = Scene::new();
        let [a, b, c, d] = [(-8.0, -8.0), (1.0, -8.0), (1.0, 8.0), (-8.0, 8.0)];
        let wall = [[a, b, c], [a, c, d]].map(|t| t.map(|(x, y)| Vec3::new(x, y, 5.0)));
        let away = [[Vec3::splat(far), Vec3::splat(far) + Vec3::X, Vec3::splat(far) + Vec3::Y]];
        for triangles in [wall.to_vec(), away.to_vec()] {
            let id = scene.insert(Object {
                occluder: true,
                ..Object::new(Aabb::from_points(triangles.iter().flatten().copied()))
            });
            scene.set_triangles(id, triangles).unwrap();
        }
        SceneTriangles::new(&scene)
    };
    // The viewcell ends 5e-9 m beside the wall's edge at 1. The error of positions is 1.5e-8 m for
    // coordinates of a million.
    let (min, max) = (DVec3::new(0.0, -1.0, 0.0), DVec3::new(1.0 - 5e-9, 1.0, 1.0));
    let cell = CellBox { min, max };
    let target = Target::Box { min: DVec3::new(0.0, -1.0, 9.0), max: DVec3::new(max.x, 1.0, 10.0) };
    let solve = |triangles: &SceneTriangles| {
        let mut search = Search::new(triangles, cell, 0.0, None);
        let budget = Budget { nodes: 2000, divided: 200, halvings: 12 };
        (search.solve_target(target, budget).0, Proof { cell, target, clearance: 0.0, steps: search.steps })
    };
    let [near, far] = [20.0, 1e6].map(scene);
    let (answer, proof) = solve(&near);
    assert_eq!(answer, Answer::Hidden, "the target is hidden where errors are small");
    proof.check(&near).unwrap();
    assert!(proof.check(&far).is_err(), "the proof is refused where errors are large");
    assert_ne!(solve(&far).0, Answer::Hidden, "the target is not hidden where errors are large");
}
