//! Random and hostile input never panics, and objects that cannot be decided stay visible.

use crate::common;

use common::{cuboid, few_rays, prepared, quad, scene};
use std::sync::Arc;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Accuracy, Object, Pose, RegionCuller, Scene, View, VisibleSet, geometry::Plane};
use visibility_exact::{DynamicCell, Effort, ExactCuller, ExactSettings, SceneTriangles, Verdict};
use visibility_testing::Random;

fn all(scene: &Scene) -> VisibleSet {
    let mut visible = VisibleSet::new();
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    visible.fill(scene, &View::perspective(pose, 1.0, 1.0, 0.1, 10.0).unwrap());
    visible
}

fn unit_cell() -> Viewcell {
    Viewcell::from_box(DVec3::ZERO, DVec3::ONE)
}

/// Makes a wall at x = 5 and a plate at x = 9.
fn wall_and_plate() -> Vec<Vec<common::Triangle>> {
    let square = |x: f64, r: f64| {
        let at = |y: f64, z: f64| DVec3::new(x, y * r, z * r);
        quad(at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0))
    };
    vec![square(5.0, 10.0), square(9.0, 1.0)]
}

#[test]
fn bits_of_any_kind_are_decided_or_open() {
    let mut random = Random(9);
    for round in 0..300 {
        let value = |random: &mut Random| match random.below(6) {
            0 => random.bits32(),
            1 => 0.0,
            2 => random.range(-1e-30, 1e-30) as f32,
            3 => random.range(-1e30, 1e30) as f32,
            _ => random.between(-3, 3) as f32,
        };
        let point = |random: &mut Random| Vec3::new(value(random), value(random), value(random));
        let objects: Vec<Vec<common::Triangle>> = (0..random.below(12))
            .map(|_| (0..random.below(4)).map(|_| core::array::from_fn(|_| point(&mut random))).collect())
            .collect();
        let scene = scene(&objects);
        let triangles = Arc::new(SceneTriangles::new(&scene));
        let (a, b) = (point(&mut random).as_dvec3(), point(&mut random).as_dvec3());
        let mut cell = if round % 3 == 0 { unit_cell() } else { Viewcell::from_box(a.min(b), a.max(b)) };
        if round % 7 == 0 {
            cell.max.x = f64::from_bits(random.bits());
            cell.planes.push(Plane { normal: DVec3::splat(f64::NAN), offset: 0.0 });
        }
        let effort = match round % 4 {
            0 => Effort::Rays(5),
            1 => Effort::Exact(0.0),
            2 => Effort::Exact(1e-4),
            _ => Effort::Exact(f64::from_bits(random.bits())),
        };
        let mut culler = ExactCuller::new(triangles.clone(), few_rays(ExactSettings::new(effort)));
        for proof in culler.verdicts(&cell).proofs.iter().flat_map(|hidden| &hidden.proofs) {
            proof.check(&triangles).unwrap();
        }
        culler.cull(&scene, &cell, &mut all(&scene));
    }
}

#[test]
fn settings_at_their_limits_decide_nothing_wrong() {
    let triangles = prepared(&wall_and_plate());
    for c in [f64::NAN, -1.0, f64::INFINITY, 0.0, 1e-300, 1e-7, 1e-2] {
        let settings = ExactSettings::new(Effort::Exact(c)).with_rays(0).with_aimed_rays(0);
        let found = ExactCuller::new(triangles.clone(), settings).verdicts(&unit_cell());
        assert_eq!(found.counts(), [1, 1, 0], "{c}");
    }
    // With a clearance as wide as the world nothing can be said, but nothing fails.
    for c in [3.0, 1e10, 1e300] {
        let settings = few_rays(ExactSettings::new(Effort::Exact(c)));
        let found = ExactCuller::new(triangles.clone(), settings).verdicts(&unit_cell());
        assert_eq!(found.counts().iter().sum::<usize>(), 2, "clearance {c}: verdicts in all");
    }
    let rays = ExactSettings::new(Effort::Rays(0));
    assert_eq!(
        ExactCuller::new(triangles, rays).verdicts(&unit_cell()).counts(),
        [0, 0, 2],
        "no rays leave both targets open"
    );
}

#[test]
fn a_clearance_that_is_no_number_counts_as_none() {
    let plate = |y: f64| {
        let at = |y: f64, z: f64| DVec3::new(5.0, y, z);
        quad(at(y, 0.0), at(y + 1.0, 0.0), at(y + 1.0, 1.0), at(y, 1.0))
    };
    let triangles = prepared(&[plate(-2.0), plate(2.0)]);
    for clearance in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0] {
        let settings =
            ExactSettings::new(Effort::Exact(1e-4)).with_clearance(clearance).with_rays(0).with_aimed_rays(0);
        let mut culler = ExactCuller::new(triangles.clone(), settings);
        assert_eq!(culler.verdicts(&unit_cell()).counts()[1], 0, "{clearance}");
        assert_eq!(culler.accuracy(), Accuracy::Conservative, "{clearance}");
    }
}

/// A triangle or cube in front of the viewcell's face by less than the clearance, in an empty world.
#[test]
fn a_target_nearer_than_the_clearance_is_not_hidden() {
    let t = [[1.005, 0.2, 0.2], [1.005, 0.8, 0.2], [1.005, 0.2, 0.8]].map(Vec3::from);
    let settings = ExactSettings::new(Effort::Exact(0.01)).with_rays(0).with_aimed_rays(0);
    // Of the cubes, only the face towards the viewcell can be seen. Moved by the clearance, the second cube's
    // face is as large as the viewcell's and behind it, so that no segment between the two faces is left.
    let cube = |r: f64| cuboid(DVec3::new(1.005, 0.5 - r, 0.5 - r), DVec3::new(1.5, 0.5 + r, 0.5 + r));
    for object in [vec![t], cube(0.3), cube(0.505)] {
        let found = ExactCuller::new(prepared(&[object]), settings).verdicts(&unit_cell());
        assert_eq!(found.counts()[1], 0, "targets hidden though nearer than the clearance");
    }
}

/// The top of a low viewcell is over a table top by less than the clearance, and its bottom is below the
/// table top. The table is seen only at grazing angles, from viewpoints that are behind the table top once it
/// is moved by the clearance.
#[test]
fn a_table_top_at_the_height_of_a_low_viewcell_is_not_hidden() {
    let at = |x: f64, y: f64| DVec3::new(x, y, 0.995);
    let table = quad(at(3.0, -1.0), at(4.0, -1.0), at(4.0, 1.0), at(3.0, 1.0));
    let settings = ExactSettings::new(Effort::Exact(0.01)).with_rays(0).with_aimed_rays(0);
    let cell = Viewcell::from_box(DVec3::new(0.0, 0.0, 0.992), DVec3::ONE);
    let found = ExactCuller::new(prepared(&[table]), settings).verdicts(&cell);
    assert_eq!(found.counts()[1], 0, "the table top is hidden");
}

#[test]
fn an_object_on_no_layer_does_not_occlude() {
    let mut scene = scene(&wall_and_plate());
    scene.set_layers(scene.id_at(0).unwrap(), 0).unwrap();
    for effort in [Effort::Exact(0.0), Effort::Exact(1e-4)] {
        let triangles = Arc::new(SceneTriangles::new(&scene));
        assert_eq!(triangles.occluder_count(), 2, "{effort:?}: triangles that occlude");
        let found = ExactCuller::new(triangles, few_rays(ExactSettings::new(effort))).verdicts(&unit_cell());
        assert_eq!(found.counts()[1], 0, "{effort:?}: targets hidden");
    }
}

/// The viewcell is between a plate with a rim below and a parapet that blocks nearly horizontal lines.
/// Between rim and parapet it sees the ocean, a box without triangles as wide as `f32` allows. Points cut
/// from the box's sides are wrong by metres.
#[test]
fn huge_bounds_are_not_proven_hidden_with_the_margins_of_small_triangles() {
    let ring = |r: f64, z0: f64, z1: f64| -> Vec<common::Triangle> {
        let at = |k: usize, z: f64| {
            let (x, y) = [(-r, -r), (r, -r), (r, r), (-r, r)][k % 4];
            DVec3::new(x, y, z)
        };
        (0..4).flat_map(|k| quad(at(k, z0), at(k + 1, z0), at(k + 1, z1), at(k, z1))).collect()
    };
    let at = |x: f64, y: f64| DVec3::new(x * 5.0, y * 5.0, -1.0);
    let plate = quad(at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0));
    let mut scene = scene(&[[plate, ring(5.0, -1.0, 0.01)].concat(), ring(6.0, -0.1, 20.0)]);
    for far in [1e12f32, 1e16, 1e18, 1e24] {
        let ocean = scene.insert(Aabb::from_arrays([-far, -far, -3.0], [far * 0.7, far * 0.7, -2.0]));
        for c in [0.0, 1e-4] {
            let triangles = Arc::new(SceneTriangles::new(&scene));
            let mut culler =
                ExactCuller::new(triangles.clone(), few_rays(ExactSettings::new(Effort::Exact(c))));
            let cell = Viewcell::from_box(DVec3::new(-1.0, -1.0, 0.02), DVec3::ONE);
            let found = culler.verdicts(&cell);
            let verdict = found.iter(&triangles).find(|(id, _)| *id == ocean).unwrap().1;
            assert_ne!(verdict, Verdict::Hidden, "{far}, {c}");
        }
        scene.remove(ocean).unwrap();
    }
}

#[test]
fn viewcells_without_a_box_decide_nothing() {
    let triangles = prepared(&wall_and_plate());
    let mut culler = ExactCuller::new(triangles, few_rays(ExactSettings::new(Effort::Exact(1e-4))));
    let nan = DVec3::splat(f64::NAN);
    for (min, max) in [
        (nan, nan),
        (DVec3::ONE, DVec3::ZERO),
        (DVec3::NEG_INFINITY, DVec3::INFINITY),
        (DVec3::splat(1e40), DVec3::splat(1e40)),
    ] {
        assert_eq!(
            culler.verdicts(&Viewcell::from_box(min, max)).counts(),
            [0, 0, 2],
            "{min} to {max}: all targets are open"
        );
        // Nothing is removed for this viewcell, even with rays alone.
        let (cell, scene) = (Viewcell::from_box(min, max), scene(&wall_and_plate()));
        let triangles = Arc::new(SceneTriangles::new(&scene));
        for effort in [Effort::Rays(100), Effort::Exact(1e-4), Effort::Share(0.5)] {
            let mut visible = all(&scene);
            ExactCuller::new(triangles.clone(), ExactSettings::new(effort)).cull(&scene, &cell, &mut visible);
            visible.finish(&scene);
            assert_eq!(visible.count(&scene), 2, "{effort:?}");
        }
    }
    // Viewcells that are a single point or flat work like others.
    for max in [DVec3::ZERO, DVec3::new(0.0, 1.0, 1.0)] {
        assert_eq!(
            culler.verdicts(&Viewcell::from_box(DVec3::ZERO, max)).counts(),
            [1, 1, 0],
            "up to {max}: one target is seen, one hidden"
        );
    }
}

#[test]
fn what_is_not_known_stays() {
    let mut scene = scene(&wall_and_plate());
    let hidden = scene.id_at(1).unwrap();
    // Three objects behind the wall: one with bounds only, one with NaN triangles, one that is never culled.
    let behind = Aabb::from_arrays([7.0, -1.0, -1.0], [8.0, 1.0, 1.0]);
    let bounds_alone = scene.insert(behind);
    let broken = scene.insert(behind);
    scene.set_triangles(broken, [[Vec3::NAN; 3]]).unwrap();
    let never = scene.insert(Object { never_cull: true, ..Object::new(behind) });
    let before = scene.insert(Aabb::from_arrays([2.0, 0.0, 0.0], [3.0, 1.0, 1.0]));
    for (effort, accuracy) in [
        (Effort::Exact(1e-4), Accuracy::Exact),
        (Effort::Exact(0.0), Accuracy::Conservative),
        (Effort::Rays(100), Accuracy::Aggressive),
    ] {
        let triangles = Arc::new(SceneTriangles::new(&scene));
        let mut culler = ExactCuller::new(triangles, ExactSettings::new(effort));
        assert_eq!(culler.accuracy(), accuracy, "the accuracy of {effort:?}");
        let mut visible = all(&scene);
        culler.cull(&scene, &unit_cell(), &mut visible);
        visible.finish(&scene);
        let sees = |id| visible.contains(&scene, id);
        assert!(!sees(hidden) && sees(broken) && sees(never) && sees(before), "{accuracy}");
        assert_eq!(sees(bounds_alone), accuracy == Accuracy::Aggressive, "{accuracy}");
        // After a change of the scene nothing is removed until its triangles are collected again.
        let mut changed = scene.clone();
        let mut visible = all(&changed);
        culler.cull(&changed, &unit_cell(), &mut visible);
        assert_eq!(visible.count(&changed), changed.len(), "a clone");
        changed.set_occluder(hidden, false).unwrap();
    }
}

/// A mover whose bounds are not reported is elsewhere than behind the wall where its triangles are.
#[test]
fn what_is_never_culled_is_left_open() {
    let mut scene = scene(&wall_and_plate());
    let [wall, plate] = [0, 1].map(|index| scene.id_at(index).unwrap());
    let unbounded = Aabb { max: Vec3::INFINITY, ..scene.bounds(plate).unwrap() };
    let mut triangles = SceneTriangles::new(&scene);
    let mut kept = DynamicCell::new(unit_cell(), ExactSettings::new(Effort::Exact(0.0)));
    for (what, never_cull, bounds, reported) in [
        ("a plate behind a wall", false, scene.bounds(plate).unwrap(), vec![wall]),
        ("a plate that is never culled", true, scene.bounds(plate).unwrap(), vec![wall, plate]),
        ("a plate that is culled again", false, scene.bounds(plate).unwrap(), vec![wall]),
        ("a plate of unknown bounds", false, unbounded, vec![wall, plate]),
    ] {
        scene.set_never_cull(plate, never_cull).unwrap();
        scene.set_bounds(plate, bounds).unwrap();
        triangles.sync(&scene);
        kept.update(&triangles, &|| false);
        assert_eq!(kept.reported().collect::<Vec<_>>(), reported, "{what}, after a change");
        let fresh = SceneTriangles::new(&scene);
        let verdicts = ExactCuller::new(Arc::new(fresh.clone()), ExactSettings::new(Effort::Exact(0.0)))
            .verdicts(&unit_cell());
        let hidden = |(id, verdict)| (verdict == Verdict::Hidden).then_some(id);
        let expected = if reported.contains(&plate) { vec![] } else { vec![plate] };
        assert_eq!(verdicts.iter(&fresh).filter_map(hidden).collect::<Vec<_>>(), expected, "{what}, anew");
    }
}

#[test]
fn glass_does_not_occlude() {
    let objects = wall_and_plate();
    let mut scene = scene(&objects);
    scene.set_occluder(scene.id_at(0).unwrap(), false).unwrap();
    let triangles = Arc::new(SceneTriangles::new(&scene));
    let mut culler = ExactCuller::new(triangles.clone(), ExactSettings::new(Effort::Exact(1e-4)));
    assert_eq!(culler.verdicts(&unit_cell()).counts()[1], 0, "targets hidden behind glass");
    assert_eq!(triangles.occluder_count(), 2, "triangles that occlude");
}

#[test]
fn an_object_in_the_viewcell_is_seen() {
    let inside = DVec3::splat(0.4);
    let objects = vec![cuboid(inside, inside + 0.1), cuboid(-DVec3::ONE * 3.0, DVec3::ONE * 3.0)];
    let triangles = prepared(&objects);
    let mut culler = ExactCuller::new(triangles.clone(), ExactSettings::new(Effort::Exact(1e-4)));
    let found = culler.verdicts(&unit_cell());
    assert!(
        found.iter(&triangles).all(|(_, verdict)| matches!(verdict, Verdict::Seen(_))),
        "an object in the viewcell is seen"
    );
    // A triangle that passes through the viewcell without a corner inside.
    let across = vec![quad(
        DVec3::new(0.5, -9.0, -9.0),
        DVec3::new(0.5, 9.0, -9.0),
        DVec3::new(0.5, 9.0, 9.0),
        DVec3::new(0.5, -9.0, 9.0),
    )];
    let triangles = prepared(&across);
    let mut culler = ExactCuller::new(triangles, ExactSettings::new(Effort::Exact(0.0)));
    assert_eq!(culler.verdicts(&unit_cell()).counts(), [1, 0, 0], "a triangle through the viewcell is seen");
}
