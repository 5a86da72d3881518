//! Worlds on an integer grid, where everything touches, lies in one plane or meets in a corner. Hidden
//! targets are shot at past edges; proofs and lines of sight are checked.

mod common;

use common::{Triangle, check, clearance, cuboid, faces, few_rays, prepared};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_exact::{Effort, ExactCuller, Settings, Verdict};
use visibility_testing::Random;

#[derive(Clone, Copy, PartialEq, Debug)]
enum Kind {
    Solids,
    Plates,
    Slanted,
}

/// A viewcell at x from -3 to -2, occluders at x from 0 to 12, and object 0, a triangle at x from 13 to 15.
fn world(kind: Kind, number: u64) -> (Viewcell, Vec<Vec<Triangle>>) {
    let mut random = Random(number * 3 + kind as u64);
    let mut int = |a: i32, b: i32| f64::from(random.between(a, b));
    let cell = Viewcell::from_box(DVec3::new(-3.0, 3.0, 4.0), DVec3::new(-2.0, int(4, 6), int(5, 7)));
    let target = loop {
        let t: [DVec3; 3] = core::array::from_fn(|_| DVec3::new(int(13, 15), int(2, 9), int(2, 9)));
        if (t[1] - t[0]).cross(t[2] - t[0]).length() > 1.0 {
            break t.map(|v| v.as_vec3());
        }
    };
    let mut objects = vec![vec![target]];
    for _ in 0..4 + number % 14 {
        let size = if int(0, 3) == 0.0 {
            DVec3::new(int(1, 2), int(6, 14), int(6, 14))
        } else {
            DVec3::new(int(1, 3), int(1, 8), int(1, 8))
        };
        let min = DVec3::new(int(0, 10), int(-4, 9), int(-4, 9));
        let max = (min + size).min(DVec3::new(12.0, 99.0, 99.0));
        objects.push(match kind {
            Kind::Solids => cuboid(min, max),
            Kind::Plates => faces(min, max).swap_remove([0, 0, 0, 2, 4][int(0, 4) as usize]),
            Kind::Slanted => {
                let slant = |v: Vec3| v + Vec3::X * ((v.y + v.z) * 0.25).round();
                let plate = faces(min, max).swap_remove(1);
                plate
                    .into_iter()
                    .map(|t| t.map(|v| slant(v).clamp(Vec3::splat(-99.0), Vec3::new(12.5, 99.0, 99.0))))
                    .collect()
            }
        });
        // A duplicate now and then.
        if number.is_multiple_of(5) {
            objects.push(objects[objects.len() - 1].clone());
        }
    }
    (cell, objects)
}

/// Shoots at the target past edges of occluders, from the cell and back. Returns the greatest clearance of a
/// segment that reaches the target, and the number of shots that were judged.
fn shoot(cell: &Viewcell, objects: &[Vec<Triangle>], shots: usize, random: &mut Random) -> (f64, usize) {
    let target = objects[0][0].map(Vec3::as_dvec3);
    let normal = (target[1] - target[0]).cross(target[2] - target[0]);
    let (mut greatest, mut judged) = (0.0f64, 0);
    let occluders: Vec<&Triangle> = objects[1..].iter().flatten().collect();
    for k in 0..shots {
        let t = random.pick(&occluders).map(Vec3::as_dvec3);
        let side = random.below(3);
        let beside = random.direction() * 10f64.powf(random.fine_range(-5.5, -0.5));
        let edge = t[side] + (t[(side + 1) % 3] - t[side]) * random.fine_unit() + beside;
        let (p, q);
        if k % 2 == 0 {
            p = cell.min + (cell.max - cell.min) * (random.fine_vector(0.5) + 0.5);
            let along = normal.dot(target[0] - p) / normal.dot(edge - p);
            q = p + (edge - p) * along;
            let inside =
                (0..3).all(|k| (target[(k + 1) % 3] - target[k]).cross(q - target[k]).dot(normal) > 0.0);
            if !(along > 1.0 && inside) {
                continue;
            }
        } else {
            let (a, b) = (random.fine_unit(), random.fine_unit());
            let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
            q = target[0] + (target[1] - target[0]) * a + (target[2] - target[0]) * b;
            let x = random.fine_range(cell.min.x, cell.max.x);
            p = q + (edge - q) * ((x - q.x) / (edge.x - q.x));
            if !(p.cmpge(cell.min).all() && p.cmple(cell.max).all()) {
                continue;
            }
        }
        judged += 1;
        greatest = greatest.max(clearance(objects, 0, p, q));
    }
    (greatest, judged)
}

/// Decides worlds; returns how many targets were seen, hidden and open.
fn decide(kind: Kind, worlds: std::ops::Range<u64>, c: f64, shots: usize) -> [usize; 3] {
    let mut counts = [0; 3];
    let mut random = Random(77);
    for number in worlds {
        let (cell, objects) = world(kind, number);
        let triangles = prepared(&objects);
        let mut culler = ExactCuller::new(triangles.clone(), few_rays(Settings::new(Effort::Exact(c))));
        let found = culler.verdicts(&cell);
        check(&objects, &triangles, &found);
        let (_, verdict) = found.iter(&triangles).next().unwrap();
        match verdict {
            Verdict::Seen(_) => counts[0] += 1,
            Verdict::Open | Verdict::Hardly(_) => counts[2] += 1,
            Verdict::Hidden => {
                counts[1] += 1;
                let (greatest, _) = shoot(&cell, &objects, shots, &mut random);
                let allowed = if c > 0.0 { 6.0 * c } else { 1e-12 };
                assert!(greatest <= allowed, "{kind:?} {number}: a segment with a clearance of {greatest}");
            }
        }
    }
    counts
}

#[test]
fn hidden_targets_are_not_hit_and_few_are_open() {
    for kind in [Kind::Solids, Kind::Plates, Kind::Slanted] {
        let counts = decide(kind, 0..40, 1e-4, 200);
        println!("{kind:?}: seen, hidden, open {counts:?}");
        assert!(counts[0] > 5 && counts[1] > 5 && counts[2] <= 3, "{kind:?} {counts:?}");
    }
}

#[test]
fn without_clearance_no_segment_at_all_passes() {
    for kind in [Kind::Solids, Kind::Plates, Kind::Slanted] {
        let counts = decide(kind, 0..25, 0.0, 200);
        println!("{kind:?}: seen, hidden, open {counts:?}");
        assert!(counts[1] > 2, "{kind:?} {counts:?}");
    }
}

#[test]
#[ignore = "long: 100,000 worlds"]
fn many_worlds() {
    for kind in [Kind::Solids, Kind::Plates, Kind::Slanted] {
        for c in [1e-4, 0.0] {
            println!("{kind:?}, c = {c}: seen, hidden, open {:?}", decide(kind, 0..17_000, c, 3000));
        }
    }
}
