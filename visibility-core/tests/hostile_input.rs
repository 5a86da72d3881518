//! Tests that no input panics, finite or not: invalid input gives an error, or an object that is never
//! culled.

use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, FrustumCuller, Object, ObjectId, Pipeline, Pose, Scene, View, VisibleSet,
    scene::SceneError,
    view::{Depth, Eye, ViewError, Window},
};
use visibility_testing::Random;
use visibility_testing::cameras::DEPTHS;

/// Returns an `f64` of random bits, often one of the special values: zeros, extremes, denormals, infinity,
/// NaN.
fn any64(rng: &mut Random) -> f64 {
    let special =
        [0.0, -0.0, 1.0, f64::MAX, f64::MIN, f64::MIN_POSITIVE, 5e-324, f64::INFINITY, f64::NAN, 1e-310];
    match rng.below(4) {
        0 => rng.pick(&special) * rng.pick(&[1.0, -1.0]),
        1 => rng.range(-2.0, 2.0),
        // A finite number of any magnitude.
        2 => f64::from_bits(rng.bits() & !(1 << 62)) * rng.pick(&[1.0, 1e150, 1e300]),
        _ => rng.bits64(),
    }
}

fn any32(rng: &mut Random) -> f32 {
    if rng.one_in(2) { rng.bits32() } else { any64(rng) as f32 }
}

fn any_box(rng: &mut Random) -> Aabb {
    let mut corner = || core::array::from_fn(|_| any32(rng));
    let (a, b): ([f32; 3], [f32; 3]) = (corner(), corner());
    if rng.one_in(3) {
        return Aabb::from_arrays(a, b);
    }
    Aabb::from_arrays(core::array::from_fn(|i| a[i].min(b[i])), core::array::from_fn(|i| a[i].max(b[i])))
}

fn any_vector(rng: &mut Random) -> DVec3 {
    DVec3::from_array(core::array::from_fn(|_| any64(rng)))
}

fn is_bounded(bounds: &Aabb) -> bool {
    (0..3).all(|i| bounds.min[i] <= bounds.max[i] && bounds.min[i].is_finite() && bounds.max[i].is_finite())
}

#[test]
fn boxes_matrices_and_origins_of_any_bits_cause_no_panic() {
    let mut rng = Random(8);
    let mut accepted = 0;
    let mut culled = 0;
    for _ in 0..300 {
        let mut scene = Scene::new();
        let count = rng.below(400);
        let boxes: Vec<Aabb> = (0..count).map(|_| any_box(&mut rng)).collect();
        let ids: Vec<ObjectId> = if rng.one_in(2) {
            boxes.iter().map(|&bounds| scene.insert(bounds)).collect()
        } else {
            scene.insert_batch(boxes.iter().copied())
        };
        for _ in 0..rng.below(200) {
            if let Some(&id) = ids.get(rng.below(count.max(1))) {
                scene.set_bounds(id, any_box(&mut rng)).unwrap();
            }
        }
        scene.maintain(rng.below(5));
        if rng.one_in(3) {
            scene.rebuild();
        }
        let origin = any_vector(&mut rng);
        assert_eq!(scene.set_origin(origin).is_ok(), origin.is_finite(), "an origin of {origin}");
        let mut visible = VisibleSet::new().with_changes();
        let mut pipeline = Pipeline::new().with(FrustumCuller::new());
        for _ in 0..10 {
            let depth = rng.pick(&DEPTHS);
            let made = match rng.below(3) {
                0 => {
                    View::from_clip_from_world(core::array::from_fn::<f32, 16, _>(|_| any32(&mut rng)), depth)
                }
                1 => {
                    View::from_clip_from_world(core::array::from_fn::<f64, 16, _>(|_| any64(&mut rng)), depth)
                }
                _ => View::from_clip_from_world(
                    core::array::from_fn::<f64, 16, _>(|_| rng.range(-1.0, 1.0) * 1e300),
                    depth,
                ),
            };
            let Ok(view) = made else { continue };
            let origin = any_vector(&mut rng);
            let Ok(view) = view.relative_to(origin) else {
                assert!(!origin.is_finite(), "a finite origin is refused: {origin}");
                continue;
            };
            assert!(origin.is_finite(), "an origin that is not finite is accepted: {origin}");
            accepted += 1;
            pipeline.cull(&scene, &view, &mut visible);
            let found: Vec<ObjectId> = visible.iter(&scene).collect();
            culled += usize::from(found.len() < ids.len());
            assert_eq!(found.len(), visible.count(&scene), "objects listed and counted");
            for &id in &ids {
                let bounds = scene.bounds(id).unwrap();
                assert!(is_bounded(&bounds) || visible.contains(&scene, id), "{bounds:?} hidden");
            }
            for plane in view.planes(scene.origin()).as_slice() {
                assert!(
                    plane.plane.normal.is_finite()
                        && plane.plane.offset.is_finite()
                        && plane.error.is_finite(),
                    "a plane that is not finite: {plane:?}"
                );
            }
            let _ = (view.eye(scene.origin()), view.clip_from(scene.origin()));
            let (fresh, gone) = (visible.newly_visible().count(), visible.newly_hidden().count());
            assert!(
                fresh <= ids.len() && gone <= ids.len(),
                "{fresh} objects appeared and {gone} vanished, of {}",
                ids.len()
            );
        }
    }
    assert!(accepted > 300 && culled > 50, "too easy: {accepted} {culled}");
}

#[test]
fn cameras_with_parameters_of_any_bits_are_refused_or_usable() {
    let mut rng = Random(9);
    let mut scene = Scene::new();
    scene.insert_batch((0..100).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 1.0; 3])));
    let mut accepted = 0;
    for _ in 0..20_000 {
        let pose = if rng.one_in(2) {
            Pose::look_at(any_vector(&mut rng), any_vector(&mut rng), any_vector(&mut rng))
        } else {
            Pose::look_at(rng.vector(9.0), rng.vector(9.0), DVec3::Z)
        };
        let (left, right, bottom, top) = (any64(&mut rng), any64(&mut rng), any64(&mut rng), any64(&mut rng));
        let window = Window { left, right, bottom, top };
        let (near, far) = (any64(&mut rng), any64(&mut rng));
        let made = match rng.below(3) {
            0 => View::perspective(pose, any64(&mut rng), any64(&mut rng), near, far),
            1 => View::perspective_off_center(pose, window, near, far),
            _ => View::orthographic(pose, window, near, far),
        };
        if let Ok(view) = made {
            accepted += 1;
            assert!(
                near < far && near.is_finite() && view.origin().is_finite(),
                "accepted with near {near}, far {far} and the origin {}",
                view.origin()
            );
            let mut visible = VisibleSet::new();
            Pipeline::new().with(FrustumCuller::new()).cull(&scene, &view, &mut visible);
            let (Eye::Point(_) | Eye::Direction(_)) = view.eye(DVec3::ZERO);
        }
    }
    assert!(accepted > 100, "too easy: {accepted}");
}

#[test]
fn errors_say_what_and_where() {
    let mut matrix = [0.0f64; 16];
    matrix[9] = f64::INFINITY;
    let refused = View::from_clip_from_world(matrix, Depth::Reversed).map(|_| ());
    assert_eq!(
        refused,
        Err(ViewError::Matrix { row: 1, column: 2 }),
        "the entry of the matrix that is infinite"
    );
    let mut scene = Scene::new();
    let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
    assert_eq!(
        scene.set_origin(DVec3::new(0.0, f64::NAN, 0.0)),
        Err(SceneError::Origin),
        "an origin that is NaN"
    );
    assert_eq!(scene.origin(), DVec3::ZERO, "a refused origin changes nothing");
    scene.remove(id).unwrap();
    assert_eq!(scene.set_cost(id, 3), Err(SceneError::UnknownObject(id)), "the object that was removed");
}

/// Tests that ids of one scene, used with a smaller or larger scene, cause no panic.
#[test]
fn ids_of_another_scene_cause_no_panic() {
    let unit = Aabb::from_arrays([0.0; 3], [1.0; 3]);
    let (mut small, mut large) = (Scene::new(), Scene::new());
    small.insert(unit);
    let ids = large.insert_batch((0..200).map(|_| Object::new(unit)));
    let (last, visible) = (ids[199], VisibleSet::new());
    let unknown = Err(SceneError::UnknownObject(last));
    assert!(!small.contains(last) && !visible.contains(&small, last), "an id of another scene is known");
    assert_eq!(small.object(last), Err(SceneError::UnknownObject(last)), "an id of another scene");
    assert_eq!(small.set_bounds(last, unit), unknown, "an id of another scene");
    assert_eq!(small.remove(last), unknown, "an id of another scene");
    assert_eq!(small.remove_batch(&[last]), unknown, "an id of another scene");
    assert_eq!(small.len(), 1, "objects after all calls were refused");
}
