//! Verdicts that are kept while objects change in every way that a scene offers: flags, layers, draw ranges,
//! parents, transforms, batches, and objects that take the index of others. They are held against queries
//! from the start, the check of proofs, and lines of sight in exact arithmetic.

use crate::common::{Triangle, cuboid, faces, is_clear};
use std::sync::Arc;
use visibility_core::glam::{Affine3A, DAffine3, DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::scene::{DrawRange, SharedTriangles};
use visibility_core::{Aabb, Object, ObjectId, Scene};
use visibility_exact::{DynamicCell, Effort, ExactCuller, ExactSettings, SceneTriangles, Verdict};
use visibility_testing::Random;

fn settings() -> ExactSettings {
    ExactSettings::new(Effort::Exact(0.0)).with_rays(200).with_aimed_rays(10)
}

fn bounds(triangles: &[Triangle]) -> Aabb {
    Aabb::from_points(triangles.iter().flatten().copied())
}

fn insert(scene: &mut Scene, triangles: Vec<Triangle>, object: Object) {
    let id = scene.insert(Object { bounds: bounds(&triangles), ..object });
    scene.set_triangles(id, triangles).unwrap();
}

fn reshape(scene: &mut Scene, id: ObjectId, triangles: Vec<Triangle>) {
    scene.set_bounds(id, bounds(&triangles)).unwrap();
    scene.set_triangles(id, triangles).unwrap();
}

/// A plate that does not occlude at x = 14, or an occluder at x from 0 to 12: a box, or a tile of the walls
/// at x = 3 and x = 7. Tiles of a wall join to convex polygons.
fn shape(random: &mut Random, is_target: bool) -> Vec<Triangle> {
    let mut int = |a: i32, b: i32| f64::from(random.between(a, b));
    if is_target {
        let min = DVec3::new(14.0, int(0, 8), int(0, 8));
        return faces(min, min + DVec3::new(0.0, int(1, 3), int(1, 3))).swap_remove(0);
    }
    if int(0, 4) == 0.0 {
        let min = DVec3::new(int(0, 10), int(-4, 9), int(-4, 9));
        return cuboid(min, min + DVec3::new(int(1, 2), int(1, 8), int(1, 8)));
    }
    let tile = DVec3::new([3.0, 7.0][int(0, 1) as usize], int(-1, 3) * 6.0 - 3.0, int(-1, 3) * 6.0 - 3.0);
    let triangles = faces(tile, tile + DVec3::new(0.0, 6.0, 6.0)).swap_remove(0);
    if int(0, 1) == 0.0 { triangles } else { triangles.into_iter().map(|[a, b, c]| [a, c, b]).collect() }
}

fn change(random: &mut Random, scene: &mut Scene) {
    let ids: Vec<ObjectId> = scene.ids().collect();
    let id = random.pick(&ids);
    let object = scene.object(id).unwrap();
    let triangles = scene.triangles(id).unwrap().to_vec();
    let other = shape(random, !object.occluder);
    let by = Vec3::new(0.0, random.between(-3, 3) as f32, random.between(-3, 3) as f32);
    let moved = |triangles: &[Triangle]| triangles.iter().map(|t| t.map(|v| v + by)).collect::<Vec<_>>();
    match random.below(14) {
        0 if ids.len() > 8 => scene.remove(id).unwrap(),
        1 if ids.len() < 40 => insert(scene, other, object),
        2 => scene.set_one_sided(id, !object.one_sided).unwrap(),
        3 => scene.set_never_cull(id, !object.never_cull).unwrap(),
        4 => scene.set_occluder(id, !object.occluder).unwrap(),
        5 => scene.set_layers(id, [0, 1, 2, u32::MAX][random.below(4)]).unwrap(),
        6 => {
            let end = if random.one_in(2) { f32::INFINITY } else { 50.0 };
            scene.set_draw_range(id, DrawRange { end, ..DrawRange::ALWAYS }).unwrap();
        }
        7 => {
            let parent = random.pick(&ids);
            // Fails if the parent is below the object.
            let _ = scene.set_hlod_parent(id, (parent != id && random.one_in(3)).then_some(parent));
        }
        8 => {
            // Another object at the same index: the same to look at, or not.
            scene.remove(id).unwrap();
            insert(scene, if random.one_in(2) && !triangles.is_empty() { triangles } else { other }, object);
        }
        9 => {
            // A transform takes the triangles away. A shared mesh is put there, or nothing.
            scene.set_local_bounds(id, object.bounds).unwrap();
            scene.set_transform(id, Affine3A::from_translation(by)).unwrap();
            let mesh = SharedTriangles::from(triangles).placed(DAffine3::from_translation(by.as_dvec3()));
            if random.one_in(2) {
                let _ = scene.set_triangles(id, mesh);
            }
        }
        10 => {
            let some: Vec<ObjectId> = ids.into_iter().filter(|_| random.one_in(5)).collect();
            let shapes: Vec<_> =
                some.iter().map(|&id| moved(&scene.triangles(id).unwrap().to_vec())).collect();
            let boxes: Vec<_> = some.iter().zip(&shapes).map(|(&id, shape)| (id, bounds(shape))).collect();
            scene.set_bounds_batch(&boxes).unwrap();
            for (id, shape) in some.into_iter().zip(shapes) {
                scene.set_triangles(id, shape).unwrap();
            }
        }
        11 => {
            // There and back.
            reshape(scene, id, other);
            reshape(scene, id, triangles);
        }
        12 => {
            // Through the viewcell.
            reshape(scene, id, faces(DVec3::new(-4.0, 3.0, 4.0), DVec3::new(-1.0, 5.0, 6.0)).swap_remove(4));
        }
        _ => reshape(scene, id, other),
    }
}

/// Returns the triangles that stop segments from a viewpoint, by object.
fn stopping(scene: &Scene, from: DVec3) -> Vec<Vec<Triangle>> {
    let mut all = vec![Vec::new(); scene.index_limit()];
    for id in scene.ids() {
        let object = scene.object(id).unwrap();
        let is_before = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).dot(from - a) > 0.0;
        if object.occluder && object.layers != 0 && scene.is_always_drawn(id) && !object.is_unculled() {
            let triangles = scene.triangles(id).unwrap();
            let stops = |t: &Triangle| !object.one_sided || is_before(t.map(Vec3::as_dvec3));
            all[id.index()] = triangles.iter().filter(stops).collect();
        }
    }
    all
}

#[test]
fn verdicts_follow_all_changes_of_a_scene() {
    let (mut unproven, mut mended, mut blocked) = (0, 0, 0);
    for number in 0..10 {
        let mut random = Random(number);
        let cell = Viewcell::from_box(DVec3::new(-3.0, 3.0, 4.0), DVec3::new(-2.0, 5.0, 6.0));
        let mut scene = Scene::new();
        for k in 0..28 {
            let triangles = shape(&mut random, k < 6);
            let one_sided = random.one_in(4);
            insert(&mut scene, triangles, Object { occluder: k >= 6, one_sided, ..Object::new(Aabb::EMPTY) });
        }
        let mut triangles = SceneTriangles::new(&scene);
        let mut kept = DynamicCell::new(cell, settings());
        kept.update(&triangles, &|| false);
        for step in 0..12 {
            let what = format!("world {number}, step {step}");
            for _ in 0..1 + random.below(3) {
                change(&mut random, &mut scene);
            }
            if triangles.sync(&scene) {
                let stats = kept.update(&triangles, &|| false);
                (unproven, mended) = (unproven + stats.unproven, mended + stats.mended);
                blocked += stats.blocked;
            }
            for proof in kept.proofs() {
                proof.check(&triangles).unwrap_or_else(|error| panic!("{what}: {error}"));
            }
            let mut verdicts: Vec<(ObjectId, Verdict)> = kept.iter().collect();
            verdicts.sort_by_key(|(id, _)| id.index());
            assert!(verdicts.iter().map(|(id, _)| *id).eq(scene.ids()), "{what}: all objects, once each");
            let fresh_triangles = Arc::new(SceneTriangles::new(&scene));
            let fresh = ExactCuller::new(fresh_triangles.clone(), settings()).verdicts(kept.viewcell());
            for ((id, verdict), (_, fresh)) in verdicts.into_iter().zip(fresh.iter(&fresh_triangles)) {
                if let Verdict::Seen(line) = verdict {
                    let occluders = stopping(&scene, line.from);
                    assert!(is_clear(&occluders, id.index(), &line), "{what}: {id} is seen along {line:?}");
                }
                let is_contradiction = matches!(
                    (verdict, fresh),
                    (Verdict::Seen(_), Verdict::Hidden) | (Verdict::Hidden, Verdict::Seen(_))
                );
                assert!(!is_contradiction, "{what}: {id} is {verdict:?}, and {fresh:?} from the start");
            }
        }
    }
    assert!(
        unproven > 30 && mended > 5 && blocked > 10,
        "{unproven} unproven, {mended} mended, {blocked} blocked"
    );
}

/// An object that takes the index of a removed one, and looks the same, is another object: `sync` says so,
/// and the new id is reported.
#[test]
fn an_object_in_place_of_another_is_reported() {
    let mut scene = Scene::new();
    let plate = faces(DVec3::new(9.0, 0.0, 0.0), DVec3::new(9.0, 1.0, 1.0)).swap_remove(0);
    insert(&mut scene, plate.clone(), Object::new(Aabb::EMPTY));
    let mut triangles = SceneTriangles::new(&scene);
    let mut kept = DynamicCell::new(Viewcell::from_box(DVec3::ZERO, DVec3::ONE), settings());
    kept.update(&triangles, &|| false);
    scene.remove(scene.id_at(0).unwrap()).unwrap();
    insert(&mut scene, plate, Object::new(Aabb::EMPTY));
    assert!(triangles.sync(&scene), "another object");
    assert_eq!(kept.update(&triangles, &|| false).changed, 1, "objects changed");
    assert!(kept.reported().eq(scene.ids()), "the object in place of the other is reported");
}
