//! One-sided triangles are not seen from behind, and do not block from behind. The worlds are on an integer
//! grid, with one- and two-sided solids and plates, around a viewcell that many of their planes cross.
//! Segments from the whole viewcell are shot at hidden targets, in exact arithmetic.

use crate::common::grid::{FINE, Point, misses_triangle, on_grid, start_of_segment, triangle_on_grid};
use crate::common::{Triangle, faces, few_rays};
use std::sync::Arc;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Object, OccluderMesh, Scene};
use visibility_exact::{CellVerdicts, Effort, ExactCuller, ExactSettings, SceneTriangles, Verdict};
use visibility_testing::{Random, distance, judged, told_enough};

/// An object: its triangles, and whether they are one-sided.
type Made = (Vec<Triangle>, bool);

/// A viewcell at x from -3 to -2, occluders at x from 0 to 12, and object 0, a triangle at x from 13 to 15.
fn world(number: u64) -> (Viewcell, Vec<Made>) {
    let mut random = Random(number);
    let mut int = |a: i32, b: i32| f64::from(random.between(a, b));
    let cell = Viewcell::from_box(DVec3::new(-3.0, 3.0, 4.0), DVec3::new(-2.0, int(4, 6), int(5, 7)));
    let target = loop {
        let t: [DVec3; 3] = core::array::from_fn(|_| DVec3::new(int(13, 15), int(2, 9), int(2, 9)));
        if (t[1] - t[0]).cross(t[2] - t[0]).length() > 1.0 {
            break t.map(|v| v.as_vec3());
        }
    };
    let mut objects = vec![(vec![target], int(0, 1) == 0.0)];
    for _ in 0..4 + number % 14 {
        let is_large = int(0, 3) == 0.0;
        let side = |int: &mut dyn FnMut(i32, i32) -> f64| if is_large { int(6, 14) } else { int(1, 8) };
        let size = DVec3::new(int(1, 3), side(&mut int), side(&mut int));
        let min = DVec3::new(int(0, 10), int(-4, 9), int(-4, 9));
        let max = (min + size).min(DVec3::new(12.0, 99.0, 99.0));
        let corners = Aabb::new(min.as_vec3(), max.as_vec3()).corners();
        let mut triangles = match int(0, 3) as i32 {
            0 => faces(min, max).swap_remove([0, 0, 2, 4][int(0, 3) as usize]),
            1 => {
                let slant = |v: Vec3| v + Vec3::X * ((v.y + v.z) * 0.25).round();
                let clamped = |v: Vec3| slant(v).clamp(Vec3::splat(-99.0), Vec3::new(12.5, 99.0, 99.0));
                faces(min, max).swap_remove(1).into_iter().map(|t| t.map(clamped)).collect()
            }
            _ => OccluderMesh::CUBOID.map(|t| t.map(|i| corners[i as usize])).to_vec(),
        };
        // A quarter of the objects have reversed winding.
        if int(0, 3) == 0.0 {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        objects.push((triangles, int(0, 3) > 0.0));
    }
    (cell, objects)
}

/// Returns six times the volume of the tetrahedron of a triangle and a point: positive behind the triangle.
fn behind([a, b, c]: &[Point; 3], p: Point) -> i64 {
    let [u, v, w] = [a, b, c].map(|x| core::array::from_fn::<i64, 3, _>(|k| x[k] - p[k]));
    (0..3).map(|k| u[k] * (v[(k + 1) % 3] * w[(k + 2) % 3] - v[(k + 2) % 3] * w[(k + 1) % 3])).sum()
}

/// Returns how far a triangle is from blocking a segment: their distance, or, for a segment that starts
/// behind a one-sided triangle, the depth of its start behind the plane if that is more.
fn clearance(t: &Triangle, one_sided: bool, p: DVec3, q: DVec3) -> f64 {
    let [a, b, c] = t.map(Vec3::as_dvec3);
    let depth = -(b - a).cross(c - a).normalize().dot(p - a);
    if one_sided { distance(p, q, t).max(depth) } else { distance(p, q, t) }
}

/// Shoots segments at the inside of the target, from points in front of it if it is one-sided. Returns the
/// greatest clearance of a segment that is not blocked, and the number of shots.
fn shoot(cell: &Viewcell, objects: &[Made], shots: usize, random: &mut Random) -> (f64, usize) {
    let occluders: Vec<(Triangle, bool)> =
        objects[1..].iter().flat_map(|(of, one_sided)| of.iter().map(|t| (*t, *one_sided))).collect();
    let exact: Vec<_> = occluders.iter().map(|(t, one_sided)| (triangle_on_grid(t), *one_sided)).collect();
    let (target, is_one_sided) = (objects[0].0[0], objects[0].1);
    let (mut greatest, mut judged, mut last) = (0.0f64, 0, 0);
    for k in 0..shots {
        let parts = [random.between(1, 2047), random.between(1, 2047)];
        let parts = [parts[0], parts[1], 4096 - parts[0] - parts[1]];
        let turn = random.below(3);
        let corner = |k: usize| target[k].as_dvec3() * f64::from(parts[(k + turn) % 3]);
        let q = (0..3).map(corner).sum::<DVec3>() / FINE;
        let edge_of = (k % 2 == 0).then(|| random.pick(&occluders).0);
        let p = start_of_segment(random, cell, q, edge_of);
        let (from, to) = (on_grid(p.clamp(DVec3::splat(-64.0), DVec3::splat(64.0))), on_grid(q));
        let is_inside = p.cmpge(cell.min).all() && p.cmple(cell.max).all();
        if !is_inside || is_one_sided && behind(&triangle_on_grid(&target), from) >= 0 {
            continue;
        }
        judged += 1;
        let passes = |(t, one_sided): &([Point; 3], bool)| {
            *one_sided && behind(t, from) >= 0 || misses_triangle(from, to, t)
        };
        if passes(&exact[last])
            && exact.iter().enumerate().all(|(k, t)| {
                last = k;
                passes(t)
            })
        {
            let least = occluders.iter().map(|(t, one_sided)| clearance(t, *one_sided, p, q));
            greatest = greatest.max(least.fold(f64::INFINITY, f64::min));
        }
    }
    (greatest, judged)
}

/// Makes the scene of some objects. With `all_sides`, all objects are two-sided.
fn prepared(objects: &[Made], all_sides: bool) -> Arc<SceneTriangles> {
    let mut scene = Scene::new();
    for (triangles, one_sided) in objects {
        let bounds = Aabb::from_points(triangles.iter().flatten().copied());
        let one_sided = *one_sided && !all_sides;
        let id = scene.insert(Object { occluder: true, one_sided, ..Object::new(bounds) });
        scene.set_triangles(id, triangles.clone()).unwrap();
    }
    Arc::new(SceneTriangles::new(&scene))
}

fn verdicts(cell: &Viewcell, triangles: &Arc<SceneTriangles>, c: f64) -> CellVerdicts {
    ExactCuller::new(triangles.clone(), few_rays(ExactSettings::new(Effort::Exact(c)))).verdicts(cell)
}

fn decide(worlds: std::ops::Range<u64>, c: f64, shots: usize) -> [usize; 5] {
    let mut counts = [0; 5];
    let mut random = Random(77 + worlds.start);
    for number in worlds {
        let (cell, objects) = world(number);
        let triangles = prepared(&objects, false);
        let found = verdicts(&cell, &triangles, c);
        assert_eq!(found.refused, 0, "{number}");
        for proof in found.proofs.iter().flat_map(|hidden| &hidden.proofs) {
            proof.check(&triangles).unwrap();
        }
        for (id, verdict) in found.iter(&triangles) {
            let Verdict::Seen(witness) = verdict else { continue };
            let short = witness.from + (witness.to - witness.from) * (1.0 - 1e-9);
            let one_sided = |(o, made): (usize, &Made)| (o != id.index()).then(|| made.clone());
            for (of, one_sided) in objects.iter().enumerate().filter_map(one_sided) {
                // The line of sight is blocked if its clearance to a triangle is 0.
                let least = of.iter().map(|t| clearance(t, one_sided, witness.from, short));
                let blocked = least.fold(f64::INFINITY, f64::min) == 0.0;
                assert!(!blocked || witness.from == witness.to, "{number}: object {id}: {witness:?}");
            }
        }
        match found.iter(&triangles).next().unwrap().1 {
            Verdict::Seen(_) => counts[0] += 1,
            Verdict::Open | Verdict::Hardly(_) => counts[2] += 1,
            Verdict::Hidden => {
                counts[1] += 1;
                let (greatest, judged) = shoot(&cell, &objects, shots, &mut random);
                counts[3] += judged;
                counts[4] += usize::from(objects[0].1);
                assert!(greatest <= 6.0 * c, "{number}: a segment with a clearance of {greatest}");
            }
        }
    }
    counts
}

#[test]
fn what_is_hidden_is_so_from_before_the_fronts() {
    for (c, most_open) in [(0.0, 4), (1e-4, 0), (1e-2, 0)] {
        let counts = decide(0..120, c, 4000);
        judged(counts[3] as u64);
        told_enough(
            counts[0] > 40 && counts[1] > 70 && counts[4] > 40 && counts[2] <= most_open,
            format_args!("{counts:?}"),
        );
    }
}

#[test]
fn proofs_by_backs_are_refused() {
    let mut refused = 0;
    for number in 0..300 {
        let (cell, objects) = world(number);
        let [all_sides, fronts] = [true, false].map(|all_sides| prepared(&objects, all_sides));
        let [hidden, seen] = [&all_sides, &fronts].map(|triangles| verdicts(&cell, triangles, 1e-4));
        let verdict = |found: &CellVerdicts| found.iter(&all_sides).next().unwrap().1;
        if verdict(&hidden) != Verdict::Hidden || !matches!(verdict(&seen), Verdict::Seen(_)) {
            continue;
        }
        let checks = |triangles: &SceneTriangles| {
            hidden.proofs.iter().flat_map(|hidden| &hidden.proofs).all(|proof| proof.check(triangles).is_ok())
        };
        assert!(checks(&all_sides) && !checks(&fronts), "{number}");
        refused += 1;
    }
    assert!(refused > 10, "{refused}");
}
