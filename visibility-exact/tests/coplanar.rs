//! Occluders in the plane of a target do not hide it, at coordinates where rounding puts points off the
//! plane.

use crate::common::{Triangle, check, clearance, cuboid, few_rays, prepared, quad};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_exact::{Effort, ExactCuller, ExactSettings, Verdict};
use visibility_testing::Random;

/// Makes a wall of four planks at x = 6, around a hole of half width `h` metres through which p sees q.
fn wall_with_hole(p: DVec3, q: DVec3, h: f64) -> Vec<Triangle> {
    let (at, r) = (p + (q - p) * ((6.0 - p.x) / (q.x - p.x)), 40.0);
    let plank = |[y0, y1, z0, z1]: [f64; 4], x: f64| {
        let corner = |y: f64, z: f64| at + DVec3::new(x, y, z);
        quad(corner(y0, z0), corner(y1, z0), corner(y1, z1), corner(y0, z1))
    };
    let planks = [[-r, -h, -r, r], [h, r, -r, r], [-2.0, 2.0, -r, -h], [-2.0, 2.0, h, r]];
    (0..).zip(planks).flat_map(|(k, sides)| plank(sides, f64::from(k) * 0.01)).collect()
}

fn cell() -> Viewcell {
    Viewcell::from_box(DVec3::new(-1.0, -2.0, -2.0), DVec3::new(1.0, 2.0, 2.0))
}

/// Panics if object 0 is proven hidden, though p sees its point q through the hole. Returns whether it is
/// seen.
fn decide(objects: &[Vec<Triangle>], p: DVec3, q: DVec3) -> bool {
    assert!(clearance(objects, 0, p, q) > 1e-3, "the target is seen from {p} at {q}");
    let triangles = prepared(objects);
    let settings = ExactSettings::new(Effort::Exact(0.0)).with_rays(0).with_aimed_rays(0).with_kept_proofs();
    let found = ExactCuller::new(triangles.clone(), settings).verdicts(&cell());
    check(objects, &triangles, &found);
    let (_, verdict) = found.iter(&triangles).next().unwrap();
    assert_ne!(verdict, Verdict::Hidden, "{:?}", objects[0]);
    matches!(verdict, Verdict::Seen(_))
}

/// A small card far from the origin: two triangles with the same corners and opposite winding.
#[test]
fn the_two_sides_of_a_card_do_not_hide_each_other() {
    let mut random = Random(5);
    for _ in 0..30 {
        let center = DVec3::new(30.0, random.range(-4.0, 4.0), random.range(-4.0, 4.0));
        let shifts = [DVec3::Y, DVec3::Z - DVec3::Y, -DVec3::Z];
        let t = shifts.map(|shift| (center + (shift + random.vector(0.7)) * 0.1).as_vec3());
        let p = DVec3::new(1.0, random.range(-1.5, 1.5), random.range(-1.5, 1.5));
        let q = t.map(Vec3::as_dvec3).iter().sum::<DVec3>() / 3.0;
        decide(&[vec![t, [t[0], t[2], t[1]]], wall_with_hole(p, q, 0.2)], p, q);
    }
}

/// Only a part in the middle of a crate's front is seen, through a hole.
#[test]
fn the_front_of_a_crate_does_not_hide_the_crate() {
    let mut random = Random(6);
    for k in 0..30 {
        let min = DVec3::new(f64::from(9.1 + 0.1 * k as f32), -1.1, -1.3);
        let p = DVec3::new(1.0, random.range(-1.5, 1.5), random.range(-1.5, 1.5));
        let q = DVec3::new(min.x, random.range(-0.4, 0.4), random.range(-0.4, 0.4));
        decide(&[cuboid(min, min + 2.3), wall_with_hole(p, q, 0.05)], p, q);
    }
}

/// A triangle seen edge-on from a point of the viewcell, behind two overlapping planks. Both planks cross the
/// triangle's plane, which is perpendicular to no axis.
#[test]
fn planks_through_the_plane_of_a_target_hide_it() {
    let mut random = Random(8);
    let mut hidden = 0;
    for _ in 0..40 {
        let center = DVec3::new(30.0, random.range(-4.0, 4.0), random.range(-4.0, 4.0));
        let along = (center - DVec3::new(0.9, random.range(-1.5, 1.5), random.range(-1.5, 1.5))) * 0.05;
        let t = [along, random.vector(1.0), random.vector(1.0)].map(|shift| (center + shift).as_vec3());
        let plank = |x: f64, y: [f64; 2]| {
            let corner = |y: f64, z: f64| DVec3::new(x, y, z);
            quad(corner(y[0], -40.0), corner(y[1], -40.0), corner(y[1], 40.0), corner(y[0], 40.0))
        };
        let objects = [vec![t], plank(5.0, [-40.0, 0.2]), plank(6.0, [-0.2, 40.0])];
        let triangles = prepared(&objects);
        let settings = few_rays(ExactSettings::new(Effort::Exact(1e-4))).with_kept_proofs();
        let found = ExactCuller::new(triangles.clone(), settings).verdicts(&cell());
        check(&objects, &triangles, &found);
        let (_, verdict) = found.iter(&triangles).next().unwrap();
        hidden += u32::from(verdict == Verdict::Hidden);
    }
    assert_eq!(hidden, 40, "targets hidden, of 40");
}
