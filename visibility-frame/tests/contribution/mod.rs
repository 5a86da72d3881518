//! Tests of the contribution culler against brute force over all objects, in the terms of cameras rather than
//! of clip matrices, and of what it promises: exact limits, one of parent and children, no flicker.

use std::collections::BTreeSet;
use visibility_core::glam::{DMat4, DQuat, DVec3, DVec4, Vec3};
use visibility_core::scene::{DrawRange, SceneError};
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, FrustumCuller, Object, ObjectId, Pipeline, Pose, Scene, View,
    VisibleSet,
    simd::Simd,
    view::{Depth, Window},
};
use visibility_frame::lod::{ContributionCuller, LodSelector, PixelScale};
use visibility_testing::Random;
use visibility_testing::cameras::{DEPTHS, projection};

/// Camera of a random kind, in the terms that the oracle reckons in.
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

/// Brute force: whether an object is drawn, or `None` if it is too near a limit to tell.
fn is_drawn(scene: &Scene, id: ObjectId, camera: &Camera, rows: f64, least: f64) -> Option<bool> {
    let object = scene.object(id).unwrap();
    let range = scene.draw_range(id).unwrap();
    let away = distance(&object.bounds, camera.eye);
    let diagonal = object.bounds.max.as_dvec3().distance(object.bounds.min.as_dvec3());
    let pixels = diagonal * rows / camera.height / if camera.eye.is_some() { away } else { 1.0 };
    let near = |a: f64, b: f64| a != b && (a - b).abs() <= 1e-9 * (a.abs() + b.abs()).min(f64::MAX);
    let mut undecided = near(pixels, least) || near(away, range.begin.into()) || near(away, range.end.into());
    let mut drawn = pixels >= least && away >= f64::from(range.begin);
    // The end is measured from the box of the parent, if that stands in.
    let mut to_end = away;
    // An object for which one of those above stands in is not drawn.
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
                // A few parents around everything, and parents of these.
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
            // Nodes whose objects all have ranges, so that they have bounds that can be wrong.
            for id in scene.ids().collect::<Vec<_>>() {
                let end = rng.pick(&[20.0, 50.0, 50.0, 1e6]);
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
    println!("{kept} kept, {dropped} dropped, {undecided} undecided");
    assert!(
        kept > 10_000 && dropped > 10_000 && undecided < 20,
        "{kept} kept, {dropped} dropped, {undecided} undecided"
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
    // One object without a range in each tenth node, then ranges in bounded steps instead of a rebuild.
    for &id in ids.iter() {
        scene.set_draw_range(id, DrawRange::ALWAYS).unwrap();
    }
    assert_eq!(
        nodes(&scene, &mut ContributionCuller::new(1080.0, 0.0)),
        all,
        "nodes entered after all ranges were taken back"
    );
    // Every cube of 250 m has a parent, which stands in for its objects from 100 m on.
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

/// Tests the limit where it is exact: boxes and cameras in whole numbers, compared in integers. An object
/// exactly as large as the limit stays; one that is smaller by a millionth goes.
#[test]
fn an_object_exactly_as_large_as_the_limit_stays() {
    let mut rng = Random(5);
    let mut ties = 0;
    for _ in 0..4000 {
        // A window of 2 by 2 and pictures of 2 k rows: k pixels per metre at one metre.
        let (k, least) = (1 + rng.below(2000) as i128, 1 + rng.below(40) as i128);
        let pose = Pose { eye: DVec3::ZERO, right: DVec3::X, up: DVec3::Y, forward: DVec3::NEG_Z };
        let view =
            View::perspective_off_center(pose, Window::centered(1.0, 1.0), 0.1, f64::INFINITY).unwrap();
        // The box of a segment along x that begins straight ahead: length a, at distance b; a k == b least.
        let (a, b) = if rng.one_in(2) {
            let part = 1 + rng.below(30) as i128;
            (least * part, k * part)
        } else {
            (1 + rng.below(2000) as i128, 1 + rng.below(20_000) as i128)
        };
        let scale = 2.0f32.powi(rng.between(-40, 40));
        let mut scene = Scene::new();
        let bounds =
            Aabb::new(Vec3::new(0.0, 0.0, -b as f32) * scale, Vec3::new(a as f32, 0.0, -b as f32) * scale);
        let id = scene.insert(bounds);
        let mut culler = ContributionCuller::new(2.0 * k as f64, least as f64);
        let seen = cull(&mut culler, &scene, &view).0.contains(&id);
        assert_eq!(seen, a * k >= b * least, "{a} m at {b} m with {k}: at least {least} pixels");
        ties += usize::from(a * k == b * least);
        // In a parallel view of k pixels per metre the same box has exactly a k pixels, scaled.
        let flat = View::orthographic(pose, Window::centered(1.0, 1.0), 0.0, 9.0).unwrap();
        let pixels = (a * k) as f64 * f64::from(scale);
        let mut in_flat = ContributionCuller::new(2.0 * k as f64, pixels);
        assert!(
            cull(&mut in_flat, &scene, &flat).0.contains(&id),
            "an object of exactly {pixels} pixels in a parallel view"
        );
        in_flat.set_min_pixels(pixels * (1.0 + 1e-6));
        assert!(
            !cull(&mut in_flat, &scene, &flat).0.contains(&id),
            "an object just below the limit of {pixels} pixels"
        );
        culler.set_min_pixels(least as f64 * (1.0 + 1e-6));
        let seen = cull(&mut culler, &scene, &view).0.contains(&id);
        assert_eq!(seen, a * k > b * least, "{a} m at {b} m with {k}: more than {least} pixels");
    }
    assert!(ties > 1000, "objects exactly at the limit: {ties}");
}

/// Tests the limit for a picture far off the viewing axis, whose matrix rounding nearly makes singular. The
/// rows are whole numbers, from which the scale follows exactly; the directions of the rows of y and w differ
/// by one part in 2^20, so that their cross product loses 20 binary digits.
#[test]
fn a_picture_far_off_the_axis_does_not_lose_an_object() {
    let mut rng = Random(7);
    for _ in 0..500 {
        let m = ((1 << 26) + 2 * rng.below(1 << 20) + 1) as f64;
        let c = ((1 << 20) + 2 * rng.below(1 << 10) + 1) as f64;
        let (u, v, w) = (DVec3::new(2.0, 1.0, -2.0), DVec3::new(2.0, -2.0, 1.0), DVec3::new(1.0, 2.0, 2.0));
        let rows = [v, u + w * c, DVec3::ZERO, w].map(|row| (row * m).extend(0.0));
        let rows = [rows[0], rows[1], DVec4::W * 0.1, rows[3]];
        let matrix = DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
        let view = View::from_clip_from_world(matrix, Depth::ReversedInfinite).unwrap();
        // |y x w| / |w|^2 is 1: with pictures of 2 k rows, k pixels per metre at one metre.
        let (least, k, part) = (1 + rng.below(40), 1 + rng.below(100), 1 + rng.below(30));
        let mut scene = Scene::new();
        let (length, away) = ((least * part) as f32, -((k * part) as f32));
        let id = scene.insert(Aabb::from_arrays([0.0, 0.0, away], [length, 0.0, away]));
        let mut culler = ContributionCuller::new(2.0 * k as f64, least as f64);
        assert!(cull(&mut culler, &scene, &view).0.contains(&id), "{k} {least} {part}");
        culler.set_min_pixels(least as f64 * (1.0 + 1e-5));
        assert!(!cull(&mut culler, &scene, &view).0.contains(&id), "{k} {least} {part}");
    }
}

/// Tests the margin for rounding of an eye far from the scene's origin, in numbers that `f64` cannot
/// subtract: an object exactly as large as the limit, exactly at the begin or at the end of its range, stays.
#[test]
fn a_far_eye_does_not_lose_an_object() {
    let mut rng = Random(6);
    let (mut kept, mut dropped) = ([0; 3], [0; 3]);
    for _ in 0..4000 {
        // The eye is less than a centimetre before the box; both are far from the origin.
        let (origin, near) = (rng.fine_range(-1e6, 1e6), rng.range(-1e6, 1e6) as f32);
        let eye = origin + f64::from(near) - 10.0f64.powf(rng.range(-6.0, -2.0));
        let pose = Pose { eye: DVec3::new(0.0, 0.0, eye), right: DVec3::X, up: DVec3::Y, forward: DVec3::Z };
        let view =
            View::perspective_off_center(pose, Window::centered(1.0, 1.0), 0.1, f64::INFINITY).unwrap();
        let distance = (f64::from(near) - (eye - origin)) as f32;
        let length = rng.pick(&[1.0, 1.0, 0.99, 1.01])
            * rng.pick(&[distance, distance.next_down(), distance.next_up()]);
        let terms = [f64::from(length), -f64::from(near), eye, -origin];
        let sign = visibility_testing::sign_of_sum(terms.map(|term| (term, 1.0)));
        for (number, range) in [
            // One pixel per metre at one metre, and at least one: a segment stays up to its length away.
            DrawRange::ALWAYS,
            DrawRange { begin: length, ..DrawRange::ALWAYS },
            DrawRange { end: length, ..DrawRange::ALWAYS },
        ]
        .into_iter()
        .enumerate()
        {
            let mut scene = Scene::new();
            scene.set_origin(DVec3::new(0.0, 0.0, origin)).unwrap();
            let id = scene.insert(Aabb::from_arrays([0.0, 0.0, near], [length, 0.0, near]));
            scene.set_draw_range(id, range).unwrap();
            let least = f64::from(u8::from(number == 0));
            let seen = cull(&mut ContributionCuller::new(2.0, least), &scene, &view).0.contains(&id);
            let is_in_range = if number == 1 { sign <= 0 } else { sign >= 0 };
            assert!(seen || !is_in_range, "{range:?}: {length} m at {near} m from {origin}, eye at {eye}");
            *if seen { &mut kept[number] } else { &mut dropped[number] } += 1;
        }
    }
    assert!(kept.iter().chain(&dropped).all(|&count| count > 500), "{kept:?} {dropped:?}");
}

/// Returns a scene of parents with children and grandchildren, and the ids of each family: a path from a
/// leaf of the family to its root.
fn families(rng: &mut Random) -> (Scene, Vec<[ObjectId; 3]>) {
    let mut scene = Scene::new();
    let mut paths = Vec::new();
    for _ in 0..12 {
        let at = rng.vector(100.0).as_vec3();
        let block = scene.insert(Aabb::new(at - 40.0, at + 40.0));
        scene.set_draw_range(block, DrawRange { begin: 90.0, ..DrawRange::ALWAYS }).unwrap();
        for _ in 0..3 {
            let at = at + rng.vector(15.0).as_vec3();
            let house = scene.insert(Aabb::new(at - 20.0, at + 20.0));
            scene.set_draw_range(house, DrawRange { begin: 25.0, ..DrawRange::ALWAYS }).unwrap();
            scene.set_hlod_parent(house, Some(block)).unwrap();
            for _ in 0..4 {
                let at = at + rng.vector(10.0).as_vec3();
                let chair = scene.insert(Aabb::new(at, at + 1.0));
                scene.set_hlod_parent(chair, Some(house)).unwrap();
                paths.push([chair, house, block]);
            }
        }
    }
    (scene, paths)
}

fn view_from(eye: DVec3) -> View {
    View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 1.0, 1.6, 0.1, f64::INFINITY).unwrap()
}

#[test]
fn exactly_one_of_a_parent_and_its_children_is_drawn() {
    let mut rng = Random(8);
    let (mut scene, paths) = families(&mut rng);
    let mut culler = ContributionCuller::new(1080.0, 0.0);
    let (mut eye, mut drawn) = (DVec3::ZERO, [0; 3]);
    for frame in 0..3000 {
        eye = (eye + rng.vector(8.0)).clamp(DVec3::splat(-250.0), DVec3::splat(250.0));
        if frame % 500 == 0 {
            scene.rebuild();
        }
        let parallel = View::orthographic(
            Pose::look_at(eye, DVec3::ZERO, DVec3::Z),
            Window::centered(9.0, 9.0),
            0.0,
            99.0,
        );
        let view = if frame % 50 == 0 { parallel.unwrap() } else { view_from(eye) };
        let seen = cull(&mut culler, &scene, &view).0;
        for path in &paths {
            let of_path = path.map(|id| seen.contains(&id));
            assert_eq!(of_path.iter().filter(|&&is| is).count(), 1, "frame {frame}: {of_path:?}");
            (0..3).for_each(|level| drawn[level] += usize::from(of_path[level]));
        }
    }
    assert!(drawn.iter().all(|&count| count > 5_000), "{drawn:?}");
}

/// Tests that two levels of one thing whose boxes differ are drawn one at a time, at every distance and by
/// whatever way the eye comes, as long as one is the parent of the other.
#[test]
fn between_levels_of_different_boxes_nothing_is_missing() {
    // The box of the far level reaches a metre nearer to the eye.
    let boxes = [[1.0, -1.0, 0.0, 3.0, 1.0, 2.0], [0.0, -1.5, 0.0, 3.0, 1.5, 2.5]]
        .map(|[a, b, c, d, e, f]| Aabb::from_arrays([a, b, c], [d, e, f]));
    for (is_linked, has_end) in [(true, true), (true, false), (false, true)] {
        let mut scene = Scene::new();
        let [near, far] = boxes.map(|bounds| scene.insert(bounds));
        // Something else in the way of the walk through the hierarchy.
        scene.insert_batch((0..300).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 0.5; 3])));
        let end = if has_end { 128.0 } else { f32::INFINITY };
        scene.set_draw_range(near, DrawRange { end, margin: 10.0, ..DrawRange::ALWAYS }).unwrap();
        scene.set_draw_range(far, DrawRange { begin: 128.0, ..DrawRange::ALWAYS }).unwrap();
        if is_linked {
            scene.set_hlod_parent(near, Some(far)).unwrap();
        }
        scene.rebuild();
        let mut rng = Random(6);
        let (mut culler, mut missing, mut lods) =
            (ContributionCuller::new(1080.0, 0.0), 0, LodSelector::new(1080.0).with_fade(0.0));
        for frame in 0..4000 {
            let away = if frame % 2 == 0 { rng.range(127.0, 130.0) } else { rng.range(100.0, 140.0) };
            let view = view_from(DVec3::new(-away, 0.0, 1.0));
            let fresh = cull(&mut ContributionCuller::new(1080.0, 0.0), &scene, &view).0;
            let live = cull(&mut culler, &scene, &view).0;
            for seen in [&fresh, &live] {
                let count = usize::from(seen.contains(&near)) + usize::from(seen.contains(&far));
                assert!(!is_linked || count == 1, "{count} of the levels at {away} m");
                missing += usize::from(count == 0);
            }
            let mut visible = VisibleSet::new();
            visible.retain(&scene, |id, _| fresh.contains(&id));
            visible.finish(&scene);
            lods.select(&scene, &view, &visible, 0.1, |_| &[]);
            let opacity = lods.selected().iter().find(|(id, _)| *id == near).map(|(_, lod)| lod.opacity);
            let faded = if is_linked { away } else { away + 1.0 };
            let range = DrawRange { end, margin: 10.0, ..DrawRange::ALWAYS };
            assert!(
                opacity.is_none_or(|opacity| (opacity - range.opacity(faded as f32)).abs() < 1e-3),
                "opacity {opacity:?} at {away} m"
            );
        }
        assert_eq!(missing > 0, !is_linked, "ranges alone leave a gap of a metre");
    }
    // Near levels at the far end of a block that is a level of them all: none is beyond its end.
    let mut scene = Scene::new();
    let block = scene.insert(Aabb::from_arrays([0.0, -5.0, 0.0], [200.0, 5.0, 20.0]));
    scene.set_draw_range(block, DrawRange { begin: 128.0, ..DrawRange::ALWAYS }).unwrap();
    let houses: Vec<_> = (0..300)
        .map(|i| scene.insert(Aabb::from_arrays([190.0, -4.0, i as f32 * 0.05], [199.0, 4.0, 16.0])))
        .collect();
    for &house in &houses {
        scene.set_draw_range(house, DrawRange { end: 128.0, ..DrawRange::ALWAYS }).unwrap();
        scene.set_hlod_parent(house, Some(block)).unwrap();
    }
    scene.rebuild();
    let seen = |away: f64| {
        let view = view_from(DVec3::new(-away, 0.0, 1.0));
        cull(&mut ContributionCuller::new(1080.0, 0.0), &scene, &view).0
    };
    assert_eq!(
        (seen(127.0).len(), seen(127.0).contains(&block)),
        (300, false),
        "before the block begins, its houses are drawn"
    );
    assert_eq!((seen(129.0).len(), seen(129.0).contains(&block)), (1, true), "beyond, the block alone");
}

/// Tests that what trembles about a limit switches at most once, and that without memory it flickers.
#[test]
fn a_trembling_camera_makes_nothing_flicker() {
    let mut rng = Random(9);
    let mut scene = Scene::new();
    let parent = scene.insert(Aabb::from_arrays([100.0, -10.0, -10.0], [120.0, 10.0, 10.0]));
    let child = scene.insert(Aabb::from_arrays([105.0, 0.0, 0.0], [106.0, 1.0, 1.0]));
    // Lamps in several nodes, so that nodes are dropped too.
    let lamps: Vec<_> = (0..300)
        .map(|i| scene.insert(Aabb::from_arrays([100.0, 30.0, 0.0], [100.0 + i as f32, 31.0, 1.0])))
        .collect();
    scene.set_draw_range(parent, DrawRange { begin: 100.0, ..DrawRange::ALWAYS }).unwrap();
    scene.set_hlod_parent(child, Some(parent)).unwrap();
    for lamp in lamps {
        scene.set_draw_range(lamp, DrawRange { end: 100.0, ..DrawRange::ALWAYS }).unwrap();
    }
    scene.rebuild();
    let (mut live, mut switches) = (ContributionCuller::new(1080.0, 0.0), [0, 0]);
    let mut before = [BTreeSet::new(), BTreeSet::new()];
    for frame in 0..400 {
        let view = view_from(DVec3::new(rng.range(-1.0, 1.0), 30.0 * f64::from(frame / 200), 0.0));
        let mut fresh = ContributionCuller::new(1080.0, 0.0);
        for (number, culler) in [&mut live, &mut fresh].into_iter().enumerate() {
            let seen = cull(culler, &scene, &view).0;
            assert_ne!(
                seen.contains(&parent),
                seen.contains(&child),
                "frame {frame}: one of parent and child is drawn"
            );
            switches[number] += usize::from(frame % 200 > 0 && seen != before[number]);
            before[number] = seen;
        }
    }
    assert!(switches[0] <= 3 && switches[1] > 50, "{switches:?}");
    // Beyond the band the memory ends, and a reset forgets it.
    let band = view_from(DVec3::new(2.0, 0.0, 0.0));
    cull(&mut live, &scene, &view_from(DVec3::new(-20.0, 0.0, 0.0)));
    assert!(cull(&mut live, &scene, &band).0.contains(&parent), "still beyond the lower limit");
    live.reset();
    assert!(!cull(&mut live, &scene, &band).0.contains(&parent), "a reset forgets that the parent was drawn");
    cull(&mut live, &scene, &view_from(DVec3::new(-20.0, 0.0, 0.0)));
    assert!(
        !cull(&mut live, &scene, &view_from(DVec3::new(20.0, 0.0, 0.0))).0.contains(&parent),
        "the parent is drawn though the eye is nearer than the band"
    );
}

#[test]
fn children_whose_parent_cannot_stand_in_are_drawn() {
    let whole = Aabb::from_arrays([100.0, -10.0, -10.0], [120.0, 10.0, 10.0]);
    let mut scene = Scene::new();
    let parent = scene.insert(whole);
    let child = scene.insert(Aabb::from_arrays([105.0, 0.0, 0.0], [106.0, 1.0, 1.0]));
    let begin = DrawRange { begin: 50.0, ..DrawRange::ALWAYS };
    scene.set_draw_range(parent, begin).unwrap();
    scene.set_hlod_parent(child, Some(parent)).unwrap();
    scene.rebuild();
    let view = view_from(DVec3::ZERO);
    let seen = |scene: &Scene, view: &View| cull(&mut ContributionCuller::new(1080.0, 0.0), scene, view).0;
    let is = |ids: &[ObjectId]| ids.iter().copied().collect::<BTreeSet<_>>();
    assert_eq!(seen(&scene, &view), is(&[parent]), "the parent stands in for the child");
    // The child drives away, the parent shrinks, is on another layer, is never culled, is NaN, is removed.
    let (home, far) =
        (scene.bounds(child).unwrap(), Aabb::from_arrays([105.0, 0.0, 9.5], [106.0, 1.0, 10.5]));
    scene.set_bounds(child, far).unwrap();
    assert_eq!(seen(&scene, &view), is(&[parent, child]), "the child has left the parent's bounds");
    scene.set_bounds(child, home).unwrap();
    assert_eq!(seen(&scene, &view), is(&[parent]), "the child is back");
    scene.set_bounds(parent, far).unwrap();
    assert_eq!(seen(&scene, &view), is(&[parent, child]), "the parent has left the child");
    scene.set_bounds(parent, Aabb::new(Vec3::NAN, Vec3::NAN)).unwrap();
    assert_eq!(seen(&scene, &view), is(&[parent, child]), "the parent is NaN");
    scene.set_bounds(parent, whole).unwrap();
    scene.set_never_cull(parent, true).unwrap();
    assert_eq!(seen(&scene, &view), is(&[parent, child]), "the parent is never culled");
    scene.set_never_cull(parent, false).unwrap();
    scene.set_layers(parent, 1).unwrap();
    assert_eq!(seen(&scene, &view), is(&[parent, child]), "the parent is on fewer layers than the child");
    assert_eq!(seen(&scene, &view.with_layers(2)), is(&[child]), "a view of the child's layers alone");
    scene.set_layers(child, 1).unwrap();
    assert_eq!(seen(&scene, &view), is(&[parent]), "the child is on the parent's layer");
    // The distance of another eye, as for a shadow map of the main camera.
    let light =
        View::orthographic(Pose::look_at(DVec3::Z, DVec3::X, DVec3::Z), Window::centered(9.0, 9.0), 0.0, 9.0);
    let light = light.unwrap();
    assert_eq!(seen(&scene, &light), is(&[child]), "the light is near, so the child is drawn");
    let mut culler = ContributionCuller::new(1080.0, 0.0);
    culler.set_distance_eye(Some(DVec3::ZERO));
    assert_eq!(cull(&mut culler, &scene, &light).0, is(&[parent]), "the distance is that of another eye");
    scene.remove(parent).unwrap();
    assert_eq!(seen(&scene, &view), is(&[child]), "the parent was removed");
    assert_eq!(scene.hlod_parent(child), Ok(None), "a removed parent is forgotten");
}

/// Change of a scene, given a parent, its children and a box elsewhere.
type Change = fn(&mut Scene, ObjectId, &[ObjectId], Aabb);

/// Tests that nodes which were dropped because a parent stood in for all their objects are looked into again
/// at once, whatever has happened to the parent.
#[test]
fn nodes_of_children_whose_parent_has_changed_are_looked_into() {
    let whole = Aabb::from_arrays([490.0; 3], [530.0; 3]);
    let elsewhere = Aabb::from_arrays([-530.0; 3], [-490.0; 3]);
    let from = DrawRange { begin: 10.0, ..DrawRange::ALWAYS };
    let all_layers = u32::MAX;
    let changes: [(&str, Change); 9] = [
        ("moved", |scene, parent, _, to| scene.set_bounds(parent, to).unwrap()),
        ("moved with all others", |scene, parent, children, to| {
            let still = children.iter().map(|&id| (id, scene.bounds(id).unwrap()));
            let moved: Vec<_> = still.chain([(parent, to)]).collect();
            scene.set_bounds_batch(&moved).unwrap();
        }),
        ("moved a little with all others, after them", |scene, parent, children, _| {
            let bounds = |id: ObjectId| scene.bounds(id).unwrap();
            let to = Aabb::new(bounds(parent).min + 30.0, bounds(parent).max + 30.0);
            let moved: Vec<_> = children.iter().map(|&id| (id, bounds(id))).chain([(parent, to)]).collect();
            scene.set_bounds_batch(&moved).unwrap();
        }),
        ("on another layer", |scene, parent, _, _| scene.set_layers(parent, 2).unwrap()),
        ("removed", |scene, parent, _, _| scene.remove(parent).unwrap()),
        ("never culled", |scene, parent, _, _| scene.set_never_cull(parent, true).unwrap()),
        ("farther", |scene, parent, _, _| {
            let begin = DrawRange { begin: 1e5, ..DrawRange::ALWAYS };
            scene.set_draw_range(parent, begin).unwrap();
        }),
        ("children on more layers", |scene, _, children, _| {
            children.iter().for_each(|&id| scene.set_layers(id, u32::MAX).unwrap());
        }),
        ("children without parent", |scene, _, children, _| {
            children.iter().for_each(|&id| scene.set_hlod_parent(id, None).unwrap());
        }),
    ];
    for (what, change) in changes {
        let mut rng = Random(12);
        let mut scene = Scene::new();
        let parent = scene.insert(Object { layers: all_layers >> 1, ..Object::new(whole) });
        scene.set_draw_range(parent, from).unwrap();
        let child = |rng: &mut Random| {
            let at = rng.vec3(495.0, 520.0);
            Object { layers: 5, ..Object::new(Aabb::new(at, at + 1.0)) }
        };
        let children = scene.insert_batch((0..600).map(|_| child(&mut rng)).collect::<Vec<_>>());
        for &id in &children {
            scene.set_hlod_parent(id, Some(parent)).unwrap();
        }
        scene.rebuild();
        let view = view_from(DVec3::ZERO);
        let (seen, stats) = cull(&mut ContributionCuller::new(1080.0, 0.0), &scene, &view);
        assert!(seen.len() == 1 && stats.nodes <= 2, "{what}: {} nodes", stats.nodes);
        change(&mut scene, parent, &children, elsewhere);
        let seen = cull(&mut ContributionCuller::new(1080.0, 0.0), &scene, &view).0;
        assert!(children.iter().all(|id| seen.contains(id)), "{what}: {} seen", seen.len());
    }
}

#[test]
fn ranges_and_parents_follow_their_objects() {
    let mut scene = Scene::new();
    let ids = scene.insert_batch((0..5).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 1.0; 3])));
    let [a, b, c, d, gone] = ids[..].try_into().unwrap();
    let range = DrawRange { begin: 1.0, end: 9.0, margin: 2.0 };
    scene.set_draw_range(gone, range).unwrap();
    scene.set_hlod_parent(gone, Some(a)).unwrap();
    scene.remove(gone).unwrap();
    for error in [
        scene.set_draw_range(gone, range),
        scene.set_hlod_parent(gone, None),
        scene.set_hlod_parent(a, Some(gone)),
    ] {
        assert_eq!(error, Err(SceneError::UnknownObject(gone)), "the object was removed");
    }
    assert!(
        scene.draw_range(gone).is_err() && scene.hlod_parent(gone).is_err(),
        "an object that was removed has neither range nor parent"
    );
    let new = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
    assert_eq!(
        (new.index(), scene.draw_range(new)),
        (gone.index(), Ok(DrawRange::ALWAYS)),
        "the new object takes the index of the old, without its range"
    );
    assert_eq!(scene.hlod_parent(new), Ok(None), "the new object has no parent");
    let revision = scene.revision();
    for (child, parent) in [(a, b), (b, c), (d, c), (new, c)] {
        scene.set_hlod_parent(child, Some(parent)).unwrap();
        assert_eq!(scene.hlod_parent(child), Ok(Some(parent)), "the parent of {child}");
    }
    assert!(scene.revision() > revision, "a parent is a change of the scene");
    for (child, parent) in [(a, a), (c, a), (b, a)] {
        assert_eq!(
            scene.set_hlod_parent(child, Some(parent)),
            Err(SceneError::Parent(child)),
            "{parent} as the parent of {child} closes a ring"
        );
    }
    scene.set_hlod_parent(b, None).unwrap();
    scene.set_hlod_parent(b, Some(d)).unwrap();
    scene.remove(c).unwrap();
    assert_eq!(
        [a, b, d, new].map(|id| scene.hlod_parent(id).unwrap()),
        [Some(b), Some(d), None, None],
        "parents after one was removed"
    );
    for (begin, end, margin) in [
        (f32::NAN, 1.0, 0.0),
        (0.0, f32::NAN, 0.0),
        (0.0, 1.0, f32::NAN),
        (-1.0, 1.0, 0.0),
        (2.0, 1.0, 0.0),
        (f32::INFINITY, f32::INFINITY, 0.0),
        (0.0, 1.0, -1.0),
    ] {
        let refused = scene.set_draw_range(a, DrawRange { begin, end, margin });
        assert_eq!(refused, Err(SceneError::DrawRange(a)), "a range of {begin} to {end}, margin {margin}");
    }
    assert_eq!(scene.draw_range(a), Ok(DrawRange::ALWAYS), "refused ranges change nothing");
    let copy = scene.clone();
    assert_eq!(copy.hlod_parent(a), Ok(Some(b)), "a clone keeps parents");
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

/// Tests that a pipeline says of draw ranges that no stage follows them.
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
    scene.insert(at(9.0)); // in the place of the removed object, without its range
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
