//! Tests of the contribution culler against brute force over all objects, with camera parameters rather than
//! clip matrices, and with other cullers.

mod fading;
mod size_limits;
mod stand_ins;

use std::collections::BTreeSet;
use visibility_core::glam::{DMat4, DQuat, DVec3, Vec3};
use visibility_core::scene::DrawRange;
use visibility_core::simd::Simd;
use visibility_core::view::Window;
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, FrustumCuller, Object, ObjectId, Pipeline, Pose, Scene, View,
    VisibleSet,
};
use visibility_frame::lod::{ContributionCuller, PixelScale};
use visibility_testing::cameras::{DEPTHS, projection};
use visibility_testing::{Random, judged, told_enough};

/// Random camera, by the parameters that the oracle computes with.
struct Camera {
    view: View,
    /// Eye relative to the scene's origin; `None` for a parallel view.
    eye: Option<DVec3>,
    /// Height of the window: a difference of tangents, or in metres for a parallel view.
    height: f64,
}

fn camera(rng: &mut Random, origin: DVec3) -> Camera {
    let depth = rng.pick(&DEPTHS);
    let parallel = !depth.is_infinite() && rng.one_in(3);
    let size = rng.range(0.05, 2.0) * if parallel { 200.0 } else { 1.0 };
    let (dx, dy) =
        if rng.one_in(2) { (0.0, 0.0) } else { (rng.range(-2.0, 2.0) * size, rng.range(-2.0, 2.0) * size) };
    let window = [dx - size * 1.6, dx + size * 1.6, dy - size, dy + size];
    let turn =
        DQuat::from_xyzw(rng.unit() - 0.5, rng.unit() - 0.5, rng.unit() - 0.5, rng.unit() + 0.01).normalize();
    let eye = rng.vector(150.0);
    let look = DMat4::from_quat(turn) * DMat4::from_translation(-eye);
    let scale = rng.pick(&[1.0, -3.0, 1e-30, 1e20]);
    let matrix = projection(depth, window, 0.1, 900.0, parallel) * look * f64::abs(scale);
    let view = View::from_clip_from_world(matrix, depth).unwrap().relative_to(origin).unwrap();
    Camera { view, eye: (!parallel).then_some(eye), height: 2.0 * size }
}

fn distance(bounds: &Aabb, eye: Option<DVec3>) -> f64 {
    let Some(eye) = eye else { return 0.0 };
    eye.clamp(bounds.min.as_dvec3(), bounds.max.as_dvec3()).distance(eye)
}

/// Returns whether an object is drawn, by brute force. `None` if the object is too near to a limit to tell.
fn is_drawn(scene: &Scene, id: ObjectId, camera: &Camera, rows: f64, least: f64) -> Option<bool> {
    let object = scene.object(id).unwrap();
    let range = scene.draw_range(id).unwrap();
    let away = distance(&object.bounds, camera.eye);
    let diagonal = object.bounds.max.as_dvec3().distance(object.bounds.min.as_dvec3());
    let pixels = diagonal * rows / camera.height / if camera.eye.is_some() { away } else { 1.0 };
    let near = |a: f64, b: f64| a != b && (a - b).abs() <= 1e-9 * (a.abs() + b.abs()).min(f64::MAX);
    let mut undecided = near(pixels, least) || near(away, range.begin.into()) || near(away, range.end.into());
    let mut drawn = pixels >= least && away >= f64::from(range.begin);
    // The end of the range is measured to the box of the parent, if the parent can replace the object.
    let mut to_end = away;
    // An object is not drawn if one of its ancestors replaces it.
    let (mut below, mut next) = (object, scene.hlod_parent(id).unwrap());
    while let Some(parent) = next {
        let above = scene.object(parent).unwrap();
        let contains = above.bounds.union(&below.bounds) == above.bounds;
        if above.never_cull || !above.bounds.is_finite() || !contains || below.layers & !above.layers != 0 {
            break;
        }
        let (away, begin) =
            (distance(&above.bounds, camera.eye), f64::from(scene.draw_range(parent).unwrap().begin));
        undecided |= near(away, begin);
        drawn &= away < begin;
        if below == object {
            to_end = away;
        }
        (below, next) = (above, scene.hlod_parent(parent).unwrap());
    }
    undecided |= near(to_end, range.end.into());
    (!undecided).then_some(drawn && to_end <= f64::from(range.end))
}

fn cull(culler: &mut ContributionCuller, scene: &Scene, view: &View) -> (BTreeSet<ObjectId>, CullStats) {
    let mut visible = VisibleSet::new();
    visible.fill(scene, view);
    let stats = culler.cull(scene, view, &mut visible);
    let ids: BTreeSet<_> = visible.iter(scene).collect();
    assert_eq!(stats.visible as usize, ids.len(), "objects counted and in the set");
    (ids, stats)
}

fn random_bounds(rng: &mut Random) -> Aabb {
    let at = rng.vector(200.0).as_vec3();
    let size = 2.0f32.powf(rng.range(-6.0, 6.0) as f32);
    let half = rng.vec3(0.0, 1.0) * size;
    Aabb::new(at - half, at + half)
}

fn random_scene(rng: &mut Random, count: usize) -> Scene {
    let mut scene = Scene::new();
    let object = |rng: &mut Random| Object {
        never_cull: rng.one_in(50),
        layers: rng.pick(&[u32::MAX, u32::MAX, 3]),
        ..Object::new(if rng.one_in(60) { Aabb::new(Vec3::NAN, Vec3::NAN) } else { random_bounds(rng) })
    };
    scene.insert_batch((0..count).map(|_| object(rng)).collect::<Vec<_>>());
    scene
}

fn random_range(rng: &mut Random) -> DrawRange {
    let begin = rng.pick(&[0.0, 0.0, 10.0, 100.0]);
    DrawRange { begin, end: rng.pick(&[f32::INFINITY, begin, begin + 50.0, 300.0]), margin: 5.0 }
}

/// Makes some random changes of boxes, ranges, parents, layers and flags.
fn change(rng: &mut Random, scene: &mut Scene) {
    let ids: Vec<_> = scene.ids().collect();
    for _ in 0..rng.below(60) {
        if ids.is_empty() {
            break;
        }
        let id = rng.pick(&ids);
        if !scene.contains(id) {
            continue;
        }
        match rng.below(12) {
            0 => scene.remove(id).unwrap(),
            1 => {
                scene.insert(random_bounds(rng));
            }
            2..4 => scene.set_bounds(id, random_bounds(rng)).unwrap(),
            4..6 => scene.set_draw_range(id, random_range(rng)).unwrap(),
            6 => scene.set_layers(id, rng.pick(&[u32::MAX, 1, 3])).unwrap(),
            7 => scene.set_never_cull(id, rng.one_in(2)).unwrap(),
            _ => {
                // A few parents contain everything, and have parents of their own.
                let parent = ids[rng.below(ids.len().min(8))];
                if scene.contains(parent) && parent < id {
                    let half = Vec3::splat(rng.range(20.0, 300.0) as f32);
                    let around = scene.bounds(id).unwrap();
                    scene
                        .set_bounds(parent, Aabb::new(around.center() - half, around.center() + half))
                        .unwrap();
                    scene.set_draw_range(parent, random_range(rng)).unwrap();
                    scene.set_hlod_parent(id, Some(parent)).unwrap();
                }
            }
        }
    }
    match rng.below(6) {
        0 => scene.rebuild(),
        1 => scene.set_origin(rng.vector(1e6)).unwrap(),
        _ => {
            scene.maintain(rng.below(30));
        }
    }
}

#[test]
fn it_equals_brute_force_over_all_objects() {
    let (mut kept, mut dropped, mut undecided) = (0, 0, 0);
    for seed in 0..12 {
        let mut rng = Random(seed);
        let count = [5, 300, 6000][seed as usize % 3];
        let mut scene = random_scene(&mut rng, count);
        if seed % 2 == 0 {
            // Gives every object a range with an end. Objects on one side have near ends, so that nodes have
            // near ends as well, which could be wrong.
            for id in scene.ids().collect::<Vec<_>>() {
                let is_far = scene.bounds(id).unwrap().min.x > 0.0;
                let end = if is_far { 1e6 } else { rng.pick(&[20.0, 50.0, 50.0]) };
                scene.set_draw_range(id, DrawRange { end, ..DrawRange::ALWAYS }).unwrap();
            }
            scene.rebuild();
        }
        for _ in 0..12 {
            change(&mut rng, &mut scene);
            let camera = camera(&mut rng, scene.origin());
            let least = rng.pick(&[0.0, 1.0, 2.5, 20.0, 300.0]);
            let mut answers = Simd::available().map(|simd| {
                let mut culler = ContributionCuller::new(1080.0, least).with_simd(simd);
                cull(&mut culler, &scene, &camera.view).0
            });
            let seen = answers.next().unwrap();
            assert!(
                answers.all(|other| other == seen),
                "seed {seed}: two instruction sets find other objects"
            );
            for id in scene.ids() {
                let object = scene.object(id).unwrap();
                let expected = if object.never_cull || !object.bounds.is_finite() {
                    Some(true)
                } else {
                    is_drawn(&scene, id, &camera, 1080.0, least)
                };
                match expected {
                    Some(drawn) => {
                        assert_eq!(seen.contains(&id), drawn, "seed {seed}, least {least}, {object:?}");
                        *if drawn { &mut kept } else { &mut dropped } += 1;
                    }
                    None => undecided += 1,
                }
            }
        }
    }
    judged((kept + dropped) as u64);
    told_enough(
        kept > 10_000 && dropped > 10_000 && undecided < 20,
        format_args!("{kept} kept, {dropped} dropped, {undecided} undecided"),
    );
}

/// Tests that whole nodes are dropped: of a hundred thousand small objects, few nodes are looked into.
#[test]
fn nodes_of_small_far_or_replaced_objects_are_dropped_unseen() {
    let mut rng = Random(3);
    let small = |rng: &mut Random| {
        let at = rng.vector(1000.0).as_vec3();
        Aabb::new(at, at + Vec3::splat(0.5))
    };
    let mut scene = Scene::new();
    let ids = scene.insert_batch((0..100_000).map(|_| small(&mut rng)).collect::<Vec<_>>());
    let pose = Pose::look_at(DVec3::new(900.0, 900.0, 900.0), DVec3::ZERO, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.6, 0.1, f64::INFINITY).unwrap();
    let nodes = |scene: &Scene, culler: &mut ContributionCuller| cull(culler, scene, &view).1.nodes;
    let all = nodes(&scene, &mut ContributionCuller::new(1080.0, 0.0));
    assert!(all > 1500, "{all}");
    assert!(
        nodes(&scene, &mut ContributionCuller::new(1080.0, 10.0)) < 60,
        "nodes entered if objects below 10 pixels are dropped"
    );
    let flat = View::orthographic(pose, Window::centered(500.0, 500.0), 0.0, 3000.0).unwrap();
    assert!(
        cull(&mut ContributionCuller::new(1080.0, 1.0), &scene, &flat).1.nodes < 60,
        "nodes entered in a parallel view of small objects"
    );
    for &id in &ids {
        scene.set_draw_range(id, DrawRange { end: 80.0, ..DrawRange::ALWAYS }).unwrap();
    }
    scene.rebuild();
    assert!(
        nodes(&scene, &mut ContributionCuller::new(1080.0, 0.0)) < 60,
        "nodes entered if objects are drawn up to 80 m"
    );
    // Without draw ranges, all nodes must be entered.
    for &id in ids.iter() {
        scene.set_draw_range(id, DrawRange::ALWAYS).unwrap();
    }
    assert_eq!(
        nodes(&scene, &mut ContributionCuller::new(1080.0, 0.0)),
        all,
        "nodes entered after all ranges were taken back"
    );
    // Every cube of 250 m has a parent, which replaces its objects from 100 m on.
    let cube = |at: Vec3| (at / 250.0).floor();
    let mut parents = std::collections::HashMap::new();
    for &id in &ids {
        let bounds = scene.bounds(id).unwrap();
        let key = cube(bounds.min).to_array().map(|x| x as i32);
        let parent = *parents.entry(key).or_insert_with(|| {
            let min = cube(bounds.min) * 250.0;
            let parent = scene.insert(Aabb::new(min, min + Vec3::splat(251.0)));
            scene.set_draw_range(parent, DrawRange { begin: 100.0, ..DrawRange::ALWAYS }).unwrap();
            parent
        });
        scene.set_hlod_parent(id, Some(parent)).unwrap();
    }
    while scene.maintain(256).waiting > 0 {}
    let mut culler = ContributionCuller::new(1080.0, 0.0);
    let (seen, stats) = cull(&mut culler, &scene, &view);
    println!("{} of {all} nodes, {} seen", stats.nodes, seen.len());
    assert!(
        stats.nodes < all / 4 && seen.len() > parents.len() / 2,
        "{} of {all} nodes, {} seen",
        stats.nodes,
        seen.len()
    );
}

fn view_from(eye: DVec3) -> View {
    View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 1.0, 1.6, 0.1, f64::INFINITY).unwrap()
}

#[test]
fn no_setting_panics_and_none_hides_what_contains_the_eye() {
    let mut scene = Scene::new();
    let around = scene.insert(Aabb::from_arrays([-1.0; 3], [1.0; 3]));
    let point = scene.insert(Aabb::from_arrays([5.0, 0.0, 0.0], [5.0, 0.0, 0.0]));
    let huge = scene.insert(Aabb::from_arrays([-3e38; 3], [3e38; 3]));
    let kept = scene.insert(Object { never_cull: true, ..Object::new(scene.bounds(point).unwrap()) });
    let numbers =
        [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, 1e-310, 5e-324, 0.0, -0.0, -1.0, 1.0];
    for height in numbers {
        for least in numbers {
            let mut culler = ContributionCuller::new(height, least);
            assert_eq!(culler.accuracy(), Accuracy::Approximate, "culling by size is approximate");
            for eye in [None, Some(DVec3::NAN), Some(DVec3::MAX), Some(DVec3::INFINITY)] {
                culler.set_distance_eye(eye);
                let seen = cull(&mut culler, &scene, &view_from(DVec3::ZERO)).0;
                assert!([around, huge, kept].iter().all(|id| seen.contains(id)), "{height} {least}");
                let culls = height > 0.0 && least > 0.0 && height / least > 1e-300;
                assert!(culls || seen.contains(&point) || height > 0.0 && least > 0.0, "{height} {least}");
            }
            cull(&mut culler, &scene, &view_from(DVec3::splat(1e300)));
            let scale = PixelScale::new(&view_from(DVec3::ZERO), DVec3::ZERO, height);
            let _ =
                (scale.diameter(&scene.bounds(point).unwrap()), scale.distance(&scene.bounds(huge).unwrap()));
        }
    }
    let seen = cull(&mut ContributionCuller::new(1080.0, 1e-9), &scene, &view_from(DVec3::ZERO)).0;
    assert!(!seen.contains(&point), "a point has no size");
    cull(&mut ContributionCuller::new(1.0, 1.0), &Scene::new(), &view_from(DVec3::ZERO));
}

/// Tests that the culler only removes from the set, after other stages as well.
#[test]
fn it_composes_with_other_cullers() {
    let mut rng = Random(11);
    let scene = random_scene(&mut rng, 3000);
    let culler = || ContributionCuller::new(1080.0, 8.0);
    let mut both = Pipeline::new().with(FrustumCuller::new()).with(culler());
    let mut frustum = Pipeline::new().with(FrustumCuller::new());
    let mut sets = [VisibleSet::new(), VisibleSet::new()];
    for _ in 0..20 {
        let view = view_from(rng.vector(150.0)).with_layers(rng.pick(&[u32::MAX, 4]));
        both.cull(&scene, &view, &mut sets[0]);
        frustum.cull(&scene, &view, &mut sets[1]);
        let alone = cull(&mut culler(), &scene, &view).0;
        let expected: BTreeSet<_> = sets[1].iter(&scene).filter(|id| alone.contains(id)).collect();
        assert_eq!(
            sets[0].iter(&scene).collect::<BTreeSet<_>>(),
            expected,
            "the frustum, then size, and each by itself"
        );
    }
}

/// Tests that the culler says whether it removes objects by size with its present settings.
#[test]
fn a_limit_above_zero_follows_sizes() {
    for (height, pixels, expected) in
        [(1080.0, 2.0, true), (1080.0, 0.0, false), (0.0, 2.0, false), (1080.0, f64::NAN, false)]
    {
        let culler = ContributionCuller::new(height, pixels);
        assert_eq!(culler.follows_sizes(), expected, "{pixels} of {height} pixels");
    }
}

/// Tests that a pipeline reports draw ranges if none of its stages follows them.
#[test]
fn a_pipeline_reports_draw_ranges_that_it_does_not_follow() {
    let at = |y: f32| Aabb::from_arrays([10.0, y, 0.0], [11.0, y + 0.5, 1.0]);
    let mut scene = Scene::new();
    let ids = scene.insert_batch((0..5).map(|i| at(i as f32)));
    let lacks = |scene: &Scene, pipeline: &Pipeline| {
        let mut lacks = Vec::new();
        pipeline.for_each_lack(scene, |stage, lack| lacks.push(format!("{stage}: {lack}")));
        lacks
    };
    let without = Pipeline::new().with(FrustumCuller::new());
    let with = Pipeline::new().with(FrustumCuller::new()).with(ContributionCuller::new(1080.0, 0.0));
    assert!(lacks(&scene, &without).is_empty(), "no object has a range");
    let range = DrawRange { end: 100.0, ..DrawRange::ALWAYS };
    ids.iter().for_each(|&id| scene.set_draw_range(id, range).unwrap());
    scene.set_draw_range(ids[0], DrawRange { end: 50.0, ..range }).unwrap();
    scene.set_draw_range(ids[1], DrawRange::ALWAYS).unwrap();
    scene.remove(ids[2]).unwrap();
    scene.insert(at(9.0)); // gets the index of the removed object, but not its range
    for scene in [&scene, &scene.clone()] {
        assert_eq!(
            lacks(scene, &without),
            ["pipeline: objects with a draw range that no stage follows: 3"],
            "three objects have ranges"
        );
        assert!(lacks(scene, &with).is_empty(), "the culler follows the ranges");
    }
    [0, 3, 4].into_iter().for_each(|i| scene.set_draw_range(ids[i], DrawRange::ALWAYS).unwrap());
    assert!(lacks(&scene, &without).is_empty(), "no object has a range any more");
}
