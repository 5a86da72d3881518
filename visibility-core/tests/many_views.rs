//! Tests with many views of one scene: clip planes, cube map faces, unions of two eyes, cullers on threads.

use std::collections::BTreeSet;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{
    Aabb, Culler, FrustumCuller, Object, ObjectId, Pipeline, Pose, Scene, View, VisibleSet,
    geometry::Plane,
    view::{MAX_CLIP_PLANES, ViewError, Window},
};
use visibility_testing::Random;
use visibility_testing::cameras::power_of_two;

fn random_box(rng: &mut Random, spread: f64) -> Aabb {
    let min = rng.vector(spread).as_vec3();
    Aabb::new(min, min + rng.vector(3.0).abs().as_vec3())
}

/// Returns a scene of random boxes within `spread` metres, on random layers; some are never culled.
fn random_scene(rng: &mut Random, count: usize, spread: f64) -> Scene {
    let mut scene = Scene::new();
    let objects: Vec<Object> = (0..count)
        .map(|_| {
            let mut object = Object::new(random_box(rng, spread));
            object.never_cull = rng.one_in(50);
            object.layers = if rng.one_in(2) { u32::MAX } else { 1 << rng.below(4) };
            object
        })
        .collect();
    scene.insert_batch(objects);
    scene
}

fn random_view(rng: &mut Random) -> View {
    let eye = rng.vector(60.0);
    let pose = Pose::look_at(eye, eye + rng.vector(1.0), DVec3::Z);
    let view = match rng.below(3) {
        0 => View::orthographic(pose, Window::centered(rng.range(5.0, 60.0), 20.0), -10.0, 90.0),
        1 => View::perspective(pose, rng.range(0.2, 2.0), 1.5, 0.1, f64::INFINITY),
        _ => View::perspective(pose, rng.range(0.2, 2.0), 1.5, 0.1, 80.0),
    };
    let layers = if rng.one_in(3) { u32::MAX } else { 1 << rng.below(4) | 1 << rng.below(4) };
    view.unwrap().with_layers(layers)
}

fn cull(scene: &Scene, view: &View) -> VisibleSet {
    let mut visible = VisibleSet::new();
    Pipeline::new().with(FrustumCuller::new()).cull(scene, view, &mut visible);
    visible
}

fn ids(scene: &Scene, set: &VisibleSet) -> BTreeSet<ObjectId> {
    let ids: BTreeSet<_> = set.iter(scene).collect();
    assert_eq!(ids.len(), set.count(scene), "ids listed and counted");
    assert!(
        scene.ids().all(|id| set.contains(scene, id) == ids.contains(&id)),
        "listed ids and those that the set contains"
    );
    ids
}

/// Returns whether a corner of the box is inside all planes, and whether the whole box is outside one plane
/// by more than a millimetre. `origin` is the point that the planes are relative to.
fn against(planes: &[Plane], origin: DVec3, bounds: &Aabb) -> (bool, bool) {
    let at = |plane: &Plane, p: Vec3| {
        plane.normal.normalize().dot(p.as_dvec3() - origin) + plane.offset / plane.normal.length()
    };
    let corners = bounds.corners();
    let touches = corners.iter().any(|&p| planes.iter().all(|plane| at(plane, p) >= 0.0));
    let clear = planes.iter().any(|plane| corners.iter().all(|&p| at(plane, p) < -1e-3));
    (touches, clear)
}

#[test]
fn clip_planes_hide_what_is_beyond_them_and_nothing_else() {
    let mut rng = Random(1);
    let (mut kept, mut hidden) = (0, 0);
    for _ in 0..200 {
        let scene = random_scene(&mut rng, 300, 60.0);
        let view = random_view(&mut rng);
        let planes: Vec<Plane> = (0..rng.below(MAX_CLIP_PLANES + 1))
            .map(|_| Plane::new(rng.vector(2.0), rng.range(-10.0, 60.0)))
            .collect();
        let clipped = view.with_clip_planes(&planes).unwrap();
        assert_eq!(clipped.clip_planes(), planes, "the planes that were given");
        let (without, with) = (ids(&scene, &cull(&scene, &view)), ids(&scene, &cull(&scene, &clipped)));
        assert!(with.is_subset(&without), "planes show objects that are hidden without: {planes:?}");
        for &id in &without {
            let object = scene.object(id).unwrap();
            let (touches, clear) = against(&planes, view.origin(), &object.bounds);
            assert!(with.contains(&id) || !touches && !object.never_cull, "{planes:?} {object:?}");
            assert!(!with.contains(&id) || !clear || object.never_cull, "{planes:?} {object:?}");
            kept += usize::from(touches);
            hidden += usize::from(clear);
        }
        assert_eq!(clipped.with_clip_planes(&[]), Ok(view), "no planes give the view that there was before");
    }
    assert!(kept > 1000 && hidden > 1000, "too easy: {kept} {hidden}");
}

#[test]
fn clip_planes_are_relative_to_the_origin_of_the_view() {
    let far = DVec3::new(1e9, -1e9, 1e8);
    let pose = Pose::look_at(far, far + DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    let behind_mirror = view.with_clip_planes(&[Plane::through(DVec3::X * 5.0, DVec3::X * 1e-200)]).unwrap();
    let mut scene = Scene::new();
    scene.set_origin(far).unwrap();
    let [near, beyond] =
        [3.0, 6.0].map(|x| scene.insert(Aabb::from_arrays([x, -0.1, -0.1], [x + 1.0, 0.1, 0.1])));
    assert_eq!(ids(&scene, &cull(&scene, &view)).len(), 2, "objects in view without a clip plane");
    let visible = cull(&scene, &behind_mirror);
    assert!(
        visible.contains(&scene, beyond) && !visible.contains(&scene, near),
        "the object beyond the mirror's plane, and not the one before it"
    );
}

#[test]
fn bad_clip_planes_are_refused_by_number() {
    let view = View::cube_faces(DVec3::ZERO, 0.1, 1.0).unwrap()[0];
    let good = Plane::new(DVec3::X, 1.0);
    assert_eq!(
        view.with_clip_planes(&[good; MAX_CLIP_PLANES + 1]),
        Err(ViewError::TooManyClipPlanes { count: MAX_CLIP_PLANES + 1 }),
        "one plane too many"
    );
    assert_eq!(
        view.with_clip_planes(&[good; MAX_CLIP_PLANES]).unwrap().planes(DVec3::ZERO).as_slice().len(),
        16,
        "6 planes of the view and 10 for clipping"
    );
    for bad in [
        Plane::new(DVec3::ZERO, 1.0),
        Plane::new(DVec3::new(0.0, f64::NAN, 0.0), 1.0),
        Plane::new(DVec3::X, f64::NEG_INFINITY),
    ] {
        assert_eq!(
            view.with_clip_planes(&[good, bad, good]),
            Err(ViewError::ClipPlane { index: 1 }),
            "the index of the bad plane, {bad:?}"
        );
    }
}

/// Tests that neighbouring cube faces share their planes: every point around the eye is in at least one face,
/// and points between faces in several, wherever eye and scene have their origins.
#[test]
fn cube_faces_see_all_around_without_a_gap() {
    let mut rng = Random(2);
    let mut several = 0;
    for case in 0..200 {
        let size = if case % 2 == 0 { 0.0 } else { power_of_two(rng.between(0, 30)) };
        let eye = rng.vector(size);
        let (near, far) = (0.5, if rng.one_in(2) { f64::INFINITY } else { 1000.0 });
        let faces = View::cube_faces(eye, near, far).unwrap();
        let mut scene = Scene::new();
        let size = power_of_two(rng.between(-10, 10));
        let away = rng.vector(size);
        scene.set_origin(eye + away).unwrap();
        let mut boxes = Vec::new();
        for _ in 0..300 {
            // Random points, and points on edges and corners between faces, with two or three equal
            // coordinates.
            let size = power_of_two(rng.between(0, 9));
            let mut p = rng.vector(size);
            if rng.one_in(2) {
                p.y = p.x * rng.pick(&[-1.0, 1.0]);
            }
            if rng.one_in(2) {
                p.z = p.x * rng.pick(&[-1.0, 1.0]);
            }
            let p = (p - (scene.origin() - eye)).as_vec3();
            let axis_distance = (p.as_dvec3() + (scene.origin() - eye)).abs().max_element();
            if axis_distance >= near && axis_distance <= far {
                boxes.push(Aabb::new(p, p));
            }
        }
        let all = scene.insert_batch(boxes.iter().copied());
        let sets = faces.each_ref().map(|face| cull(&scene, face));
        for (&id, bounds) in all.iter().zip(&boxes) {
            let count = sets.iter().filter(|set| set.contains(&scene, id)).count();
            assert!((1..=3).contains(&count), "{bounds:?} is in {count} of the faces around {eye}");
            several += usize::from(count > 1);
        }
    }
    assert!(several > 10_000, "too easy: {several}");
    assert!(
        View::cube_faces(DVec3::NAN, 0.1, 1.0).is_err() && View::cube_faces(DVec3::ZERO, 0.0, 1.0).is_err(),
        "an eye that is NaN, and near of 0, are refused"
    );
}

/// Tests the orientation of cube faces against the table of the OpenGL specification: for each major axis,
/// the directions in which the texture coordinates grow.
#[test]
fn cube_faces_are_oriented_as_gpus_sample_them() {
    let faces = View::cube_faces(DVec3::ZERO, 0.1, 10.0).unwrap();
    let mut rng = Random(3);
    for _ in 0..1000 {
        let r = rng.vector(1.0);
        let axis = (0..3).max_by(|&a, &b| r[a].abs().total_cmp(&r[b].abs())).unwrap();
        let face = 2 * axis + usize::from(r[axis] < 0.0);
        let (sc, tc) = match face {
            0 => (-r.z, -r.y),
            1 => (r.z, -r.y),
            2 => (r.x, r.z),
            3 => (r.x, -r.z),
            4 => (r.x, -r.y),
            _ => (-r.x, -r.y),
        };
        let clip = faces[face].clip_from(DVec3::ZERO) * r.extend(1.0);
        // Rows of the picture count from the top, where clip-space y is w.
        let (s, t) = (sc / r[axis].abs(), tc / r[axis].abs());
        assert!((clip.x / clip.w - s).abs() < 1e-12 && (clip.y / clip.w + t).abs() < 1e-12, "{r} on {face}");
        assert!(clip.w > 0.0, "{r} is behind face {face}");
    }
}

#[test]
fn a_union_holds_what_either_set_holds() {
    let mut rng = Random(5);
    let mut strict = 0;
    for _ in 0..300 {
        let count = rng.pick(&[0, 1, 64, 300, 5000]);
        let scene = random_scene(&mut rng, count, 80.0);
        let set = |rng: &mut Random| {
            let mut set = VisibleSet::new();
            match rng.below(8) {
                0 => set.fill(&scene, &random_view(rng)),
                1 => set.clear(&scene),
                _ => set = cull(&scene, &random_view(rng)),
            }
            if rng.one_in(4) {
                set.sort_by_key(&scene, |id| id.index() % 7);
            }
            set
        };
        let (a, b) = (set(&mut rng), set(&mut rng));
        let expected: BTreeSet<_> = ids(&scene, &a).union(&ids(&scene, &b)).copied().collect();
        strict += usize::from(expected.len() > a.count(&scene).max(b.count(&scene)));
        for (mut both, other) in [(a.clone(), &b), (b.clone(), &a)] {
            both.union(&scene, other);
            assert_eq!(ids(&scene, &both), expected, "the union, whichever set comes first");
        }
        let mut both = VisibleSet::new().with_changes();
        both.clear(&scene);
        assert_eq!(both.count(&scene), 0, "objects of a cleared set");
        both.union(&scene, &a);
        assert_eq!(ids(&scene, &both), ids(&scene, &a), "an empty set with another");
        both.union(&scene, &b);
        both.finish(&scene);
        assert_eq!(
            both.newly_visible().collect::<BTreeSet<_>>(),
            expected,
            "objects that appear are those of the union"
        );
        // Cullers can go on with a set that is a union.
        let view = random_view(&mut rng).with_layers(u32::MAX);
        FrustumCuller::new().cull(&scene, &view, &mut both);
        let in_view = ids(&scene, &cull(&scene, &view));
        assert_eq!(
            ids(&scene, &both),
            expected.intersection(&in_view).copied().collect(),
            "objects of the union that are in view"
        );
    }
    assert!(strict > 100, "too easy: {strict}");
}

#[test]
fn a_union_with_an_unfinished_set_of_another_layout_holds_everything_on_the_layers_of_either() {
    let mut scene = Scene::new();
    let at = |x: f32, layers| Object { layers, ..Object::new(Aabb::from_arrays([x; 3], [x + 1.0; 3])) };
    let first = scene.insert(at(0.0, 1));
    let faces = View::cube_faces(DVec3::splat(-9.0), 0.1, 1.0).unwrap();
    let mut old = VisibleSet::new();
    old.fill(&scene, &faces[0].with_layers(1));
    FrustumCuller::new().cull(&scene, &faces[0], &mut old);
    let finished = cull(&scene, &faces[0].with_layers(1));
    assert_eq!((old.count(&scene), finished.count(&scene)), (0, 0), "objects visible in the first two sets");
    let others = [2, 4].map(|layers| scene.insert(at(3.0, layers)));
    let new = cull(&scene, &faces[0].with_layers(2));
    assert_eq!(new.count(&scene), 0, "objects visible in the third set");
    for (mut both, other) in [(old.clone(), &new), (new.clone(), &old)] {
        both.union(&scene, other);
        assert!(
            both.contains(&scene, first) && !both.contains(&scene, others[1]),
            "the first object is kept, the one on other layers is not"
        );
    }
    // Tests a clone of a finished set: the union holds its objects as they were.
    let mut both = finished.clone();
    both.union(&scene, &new);
    assert_eq!(both.count(&scene), 0, "objects of a finished set with an empty one");
    // A set that was never filled holds everything, so its union with another set does too.
    let mut both = VisibleSet::new();
    both.union(&scene, &new);
    assert_eq!(both.count(&scene), 3, "a set that was never filled holds all objects");
}

/// Tests that eight cullers on threads, each with its own layers, find the same sets as when run one after
/// another.
#[test]
fn eight_cullers_on_threads_find_what_they_find_alone() {
    let mut rng = Random(6);
    let scene = random_scene(&mut rng, 20_000, 100.0);
    let walks: Vec<Vec<View>> = (0..8)
        .map(|thread| {
            let start = random_view(&mut rng).with_layers(1 << (thread % 4) | 1 << (thread % 3));
            let step = rng.vector(2.0);
            let at = |frame| start.relative_to(start.origin() + step * f64::from(frame)).unwrap();
            (0..20).map(at).collect()
        })
        .collect();
    let walk = |thread: usize| {
        let mut pipelines = [
            Pipeline::new().with(FrustumCuller::new()),
            Pipeline::new().with(FrustumCuller::new()).with(FrustumCuller::new()),
        ];
        let mut visible = VisibleSet::new().with_changes();
        let mut seen = Vec::new();
        for view in &walks[thread] {
            for pipeline in &mut pipelines {
                let stats = pipeline.cull(&scene, view, &mut visible);
                let appeared: Vec<ObjectId> = visible.newly_visible().collect();
                seen.push((stats, visible.iter(&scene).collect::<Vec<_>>(), appeared));
            }
        }
        seen
    };
    let alone: Vec<_> = (0..8).map(walk).collect();
    let start = std::sync::Barrier::new(8);
    let together: Vec<_> = std::thread::scope(|scope| {
        let (walk, start) = (&walk, &start);
        let threads: Vec<_> = (0..8)
            .map(|thread| {
                scope.spawn(move || {
                    start.wait();
                    walk(thread)
                })
            })
            .collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert!(together == alone, "a thread finds something else than it does alone");
    assert!(
        alone.iter().all(|seen| seen.iter().any(|(_, visible, _)| !visible.is_empty())),
        "a walk on which nothing is visible"
    );
    assert!((1..8).all(|thread| alone[thread] != alone[0]), "the views differ");
}
