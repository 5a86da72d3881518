//! Tests of a [`VisibleSet`] as the result of a frame: its list of ids survives changes of the scene.

use std::collections::BTreeSet;
use visibility_core::glam::DVec3;
use visibility_core::visible_set::BitsError;
use visibility_core::{Aabb, FrustumCuller, Object, ObjectId, Pipeline, Pose, Scene, View, VisibleSet};
use visibility_testing::Random;

fn at(x: f32, y: f32, z: f32) -> Aabb {
    Aabb::from_arrays([x, y, z], [x + 0.5, y + 0.5, z + 0.5])
}

fn random_box(rng: &mut Random) -> Aabb {
    let p = rng.vector(100.0).as_vec3();
    at(p.x, p.y, p.z)
}

/// Returns a perspective view from the origin of the world towards `target`, without far plane.
fn looking_at(target: DVec3) -> View {
    View::perspective(Pose::look_at(DVec3::ZERO, target, DVec3::Z), 0.3, 1.3, 0.1, f64::INFINITY).unwrap()
}

fn frustum() -> Pipeline {
    Pipeline::new().with(FrustumCuller::new())
}

fn random_scene(rng: &mut Random, count: usize) -> Scene {
    let mut scene = Scene::new();
    scene.insert_batch((0..count).map(|_| Object {
        layers: if rng.one_in(5) { 1 << rng.below(4) } else { u32::MAX },
        never_cull: rng.one_in(40),
        ..Object::new(random_box(rng))
    }));
    scene
}

/// A result that is kept without being listed, while another result is culled in every frame, makes the scene
/// keep one content of each node at most, and is read as it was culled.
#[test]
fn what_a_scene_keeps_for_an_old_result_does_not_grow() {
    let mut rng = Random(10);
    let mut scene = random_scene(&mut rng, 5000);
    let ids: Vec<_> = scene.ids().collect();
    let (mut pipeline, mut kept, mut set) = (frustum(), VisibleSet::new(), VisibleSet::new());
    let view = looking_at(DVec3::X);
    pipeline.cull(&scene, &view, &mut kept);
    let mut expected = kept.clone();
    let expected = expected.ids(&scene).to_vec();
    assert!(expected.len() > 100, "too few objects in view: {}", expected.len());
    let mut greatest = [0; 2];
    for frame in 0..2000 {
        pipeline.cull(&scene, &view, &mut set);
        for _ in 0..20 {
            scene.set_bounds(rng.pick(&ids), random_box(&mut rng)).unwrap();
        }
        scene.maintain(50);
        let greatest = &mut greatest[usize::from(frame >= 500)];
        *greatest = (*greatest).max(scene.memory());
    }
    let [first, later] = greatest;
    assert!(later < first + first / 4, "{later} bytes after 500 frames, {first} before");
    assert_eq!(kept.ids(&scene), expected, "the objects of the old result");
}

/// Regression test: one spawn, or one call of `maintain`, between culling and drawing leaves the result
/// unchanged.
#[test]
fn a_spawn_or_maintenance_between_culling_and_drawing_leaves_the_result_as_it_was() {
    let mut rng = Random(1);
    let mut scene = Scene::new();
    let ids = scene.insert_batch((0..50_000).map(|_| random_box(&mut rng)));
    let mut visible = VisibleSet::new();
    frustum().cull(&scene, &looking_at(DVec3::X), &mut visible);
    let before: Vec<ObjectId> = visible.iter(&scene).collect();
    assert!((100..5000).contains(&before.len()), "{}", before.len());
    let spawned = scene.insert(at(5.0, 0.0, 0.0));
    assert_eq!(visible.iter(&scene).collect::<Vec<_>>(), before, "after a spawn");
    assert_eq!(visible.count(&scene), before.len(), "objects after a spawn");
    assert!(!visible.contains(&scene, spawned), "drawn from the next frame on");
    for &id in &ids[..2000] {
        scene.set_bounds(id, random_box(&mut rng)).unwrap();
    }
    let layout = scene.layout();
    while scene.maintain(1000).waiting > 0 {}
    assert_ne!(scene.layout(), layout, "maintenance changes the layout");
    assert_eq!(visible.iter(&scene).collect::<Vec<_>>(), before, "after maintenance");
    assert_eq!(visible.count(&scene), before.len(), "objects after maintenance");
}

/// Returns the ids of the set in its order, after asserting that all ways to read the set agree: with
/// `expected` being the objects of the list that are still in the scene.
fn assert_reads(scene: &Scene, visible: &VisibleSet, expected: &[ObjectId], what: &str) {
    assert_eq!(visible.iter(scene).collect::<Vec<_>>(), expected, "{what}");
    assert_eq!(visible.count(scene), expected.len(), "{what}");
    let expected: BTreeSet<_> = expected.iter().copied().collect();
    for id in scene.ids() {
        assert_eq!(visible.contains(scene, id), expected.contains(&id), "{what}: {id}");
    }
}

type Change = fn(&mut Scene, &mut Random);

fn any(scene: &Scene, rng: &mut Random) -> ObjectId {
    let ids: Vec<_> = scene.ids().collect();
    ids[rng.below(ids.len())]
}

const CHANGES: [(&str, Change); 11] = [
    ("insert", |scene, rng| {
        scene.insert(random_box(rng));
    }),
    ("insert_batch", |scene, rng| {
        scene.insert_batch((0..100).map(|_| random_box(rng)));
    }),
    ("insert never culled", |scene, rng| {
        scene.insert(Object { never_cull: true, ..Object::new(random_box(rng)) });
    }),
    ("remove", |scene, rng| scene.remove(any(scene, rng)).unwrap()),
    ("reuse", |scene, rng| {
        scene.remove(any(scene, rng)).unwrap();
        scene.insert(random_box(rng));
    }),
    ("teleport", |scene, rng| scene.set_bounds(any(scene, rng), at(9e5, 0.0, 0.0)).unwrap()),
    ("unbounded", |scene, rng| scene.set_bounds(any(scene, rng), Aabb::EMPTY).unwrap()),
    ("never cull", |scene, rng| {
        let id = any(scene, rng);
        let never_cull = !scene.object(id).unwrap().never_cull;
        scene.set_never_cull(id, never_cull).unwrap();
    }),
    ("layers", |scene, rng| {
        for _ in 0..50 {
            let id = any(scene, rng);
            scene.set_layers(id, 1 << rng.below(4)).unwrap();
        }
    }),
    ("maintain", |scene, rng| {
        for _ in 0..50 {
            let id = any(scene, rng);
            scene.set_bounds(id, random_box(rng)).unwrap();
        }
        scene.maintain(500);
    }),
    ("rebuild", |scene, _| scene.rebuild()),
];

/// Returns the objects of a result in its order. Reads a clone, so that an unlisted result stays unlisted.
fn listed(scene: &Scene, visible: &VisibleSet) -> Vec<ObjectId> {
    visible.clone().ids(scene).to_vec()
}

/// Tests every change of a scene, by itself and in random sequences, on results in every order, some listed
/// before the changes and some not.
#[test]
fn results_survive_every_change_of_the_scene() {
    let mut rng = Random(2);
    let mut removed = 0;
    for round in 0..120 {
        let count = rng.pick(&[3, 60, 3000]);
        let mut scene = random_scene(&mut rng, count);
        let view = looking_at(rng.vector(1.0)).with_layers(rng.pick(&[u32::MAX, 3, 4]));
        let (mut visible, mut pipeline) = (VisibleSet::new(), frustum());
        if round % 5 == 0 {
            pipeline = Pipeline::new();
        }
        pipeline.cull(&scene, &view, &mut visible);
        match round % 8 {
            0 => visible.sort_by_key(&scene, |id| id.index() % 7),
            1 => {
                let some: Vec<_> = scene.ids().step_by(3).collect();
                visible.keep_in_order(&scene, &some);
                visible.finish(&scene);
            }
            2 => visible.sort_by_index(&scene),
            3 => _ = visible.ids(&scene),
            _ => assert!(
                visible.is_finished() && visible.listed().is_none(),
                "round {round}: a culled set is finished, without a list"
            ),
        }
        let list = listed(&scene, &visible);
        assert_eq!(list.len(), list.iter().collect::<BTreeSet<_>>().len(), "each object once");
        assert_reads(&scene, &visible, &list, "unchanged");
        for step in 0..6 {
            let (name, change) = if step == 0 { CHANGES[round % CHANGES.len()] } else { rng.pick(&CHANGES) };
            change(&mut scene, &mut rng);
            let left: Vec<_> = list.iter().copied().filter(|&id| scene.contains(id)).collect();
            removed += list.len() - left.len();
            assert_reads(&scene, &visible, &left, name);
            assert_eq!(visible.listed(), (round % 8 < 4).then_some(&list[..]), "{name}");
            // A clone that is finished after the change holds the same objects in the same order.
            let mut copy = visible.clone();
            copy.finish(&scene);
            assert_reads(&scene, &copy, &left, name);
            assert_eq!(copy.ids(&scene), left, "{name}");
            copy.sort_by_index(&scene);
            let mut sorted = left.clone();
            sorted.sort_unstable();
            assert_eq!(copy.listed(), Some(&sorted[..]), "{name}");
            copy.order_first(&scene, &sorted[sorted.len() / 2..]);
            let unculled = |id: &ObjectId| scene.object(*id).unwrap().never_cull;
            let copied: BTreeSet<_> = copy.iter(&scene).filter(|id| !unculled(id)).collect();
            let culled: BTreeSet<_> = left.iter().copied().filter(|id| !unculled(id)).collect();
            assert!(copied.is_superset(&culled), "{name}");
        }
        // The next frame takes all changes into account.
        pipeline.cull(&scene, &view, &mut visible);
        let mut fresh = VisibleSet::new();
        pipeline.cull(&scene, &view, &mut fresh);
        assert_eq!(visible.ids(&scene), fresh.ids(&scene), "round {round}: a used set and a fresh one");
    }
    assert!(removed > 50, "too easy: {removed}");
}

/// Tests results of several frames that live side by side, and of which some are listed, copied or dropped
/// while the scene changes: each keeps its own.
#[test]
fn results_of_several_frames_survive_side_by_side() {
    let mut rng = Random(8);
    let mut outdated = 0;
    for round in 0..30 {
        let mut scene = random_scene(&mut rng, if round % 2 == 0 { 300 } else { 6000 });
        let mut pipeline = frustum();
        let mut results: Vec<(VisibleSet, Vec<ObjectId>, visibility_core::stamp::Stamp)> = Vec::new();
        for _ in 0..25 {
            let at = rng.below(results.len() + 1);
            match rng.below(5) {
                0 | 1 => {
                    // Takes a set from the results for reuse, or makes a new one.
                    let mut set = match results.get_mut(at) {
                        Some((set, ..)) => core::mem::take(set),
                        None => VisibleSet::new(),
                    };
                    results.truncate(at.max(4).min(results.len()));
                    pipeline.cull(&scene, &looking_at(rng.vector(1.0)).with_layers(3), &mut set);
                    results.retain(|(set, ..)| set.is_finished());
                    let list = listed(&scene, &set);
                    results.push((set, list, scene.layout()));
                }
                2 if at < results.len() => results.push(results[at].clone()),
                3 if at < results.len() => {
                    let (set, list, _) = &mut results[at];
                    list.retain(|&id| scene.contains(id));
                    assert_eq!(set.ids(&scene), list, "round {round}: the list that the set makes later");
                }
                _ => rng.pick(&CHANGES).1(&mut scene, &mut rng),
            }
            for (set, list, layout) in &results {
                let left: Vec<_> = list.iter().copied().filter(|&id| scene.contains(id)).collect();
                assert_eq!(
                    set.iter(&scene).collect::<Vec<_>>(),
                    left,
                    "round {round}: objects of a set that are left"
                );
                assert_eq!(
                    set.count(&scene),
                    left.len(),
                    "round {round}: count of the objects that are left"
                );
                let other = any(&scene, &mut rng);
                assert_eq!(
                    set.contains(&scene, other),
                    left.contains(&other),
                    "round {round}: whether {other} is in the set"
                );
                outdated += usize::from(set.listed().is_none() && *layout != scene.layout());
            }
        }
    }
    assert!(outdated > 300, "too easy: {outdated}");
}

/// Tests that the memory which a scene keeps for unlisted results is bounded by these results, and freed with
/// them.
#[test]
fn what_a_scene_keeps_for_results_goes_with_them() {
    let mut rng = Random(9);
    let mut scene = random_scene(&mut rng, 20_000);
    let ids: Vec<_> = scene.ids().collect();
    let mut change = |scene: &mut Scene| {
        for _ in 0..20 {
            scene.set_bounds(rng.pick(&ids), random_box(&mut rng)).unwrap();
        }
        scene.maintain(50);
    };
    // Greatest memory of the scene over many frames: `[0]` if every result is listed, `[1]` with three
    // unlisted results.
    let mut greatest = [0; 2];
    let (mut pipeline, mut sets) = (frustum(), [(); 3].map(|_| VisibleSet::new()));
    for (keeps, greatest) in greatest.iter_mut().enumerate() {
        for frame in 0..1500 {
            let set = &mut sets[frame % 3];
            pipeline.cull(&scene, &looking_at(DVec3::new(1.0, frame as f64 * 0.01, 0.0)), set);
            if keeps == 0 {
                set.ids(&scene);
            }
            change(&mut scene);
            *greatest = (*greatest).max(scene.memory());
        }
    }
    let [without, with] = greatest;
    assert!(with > without, "too easy: {with}");
    assert!(with < without + without / 3, "{with} bytes with results, {without} without");
    sets.iter_mut().for_each(|set| set.clear(&scene));
    change(&mut scene);
    assert!(scene.memory() <= without + without / 50, "{} of {without}", scene.memory());
}

/// Regression test: cullers called one by one, then the list of the result, without a call of `finish`.
#[test]
fn no_order_of_calls_leaves_a_list_empty() {
    let mut scene = Scene::new();
    scene.insert_batch((0..10).map(|i| at(5.0 + i as f32, -0.2, -0.2)));
    scene.insert(at(-9.0, 0.0, 0.0));
    let view = looking_at(DVec3::X);
    let calls: [fn(&mut VisibleSet, &Scene); 6] = [
        |_, _| {},
        |set, scene| set.finish(scene),
        |set, scene| _ = set.ids(scene),
        |set, scene| set.sort_by_index(scene),
        |set, scene| set.order_first(scene, &[]),
        |set, scene| _ = set.retain(scene, |_, _| true),
    ];
    for first in calls {
        for second in calls {
            let mut visible = VisibleSet::new();
            visible.fill(&scene, &view);
            visibility_core::Culler::cull(&mut FrustumCuller::new(), &scene, &view, &mut visible);
            first(&mut visible, &scene);
            second(&mut visible, &scene);
            let mut bits = [0];
            assert_eq!(visible.iter(&scene).count(), 10, "objects in view");
            visible.write_bits(&scene, &mut bits).unwrap();
            assert_eq!(
                (bits[0].count_ones(), visible.count(&scene)),
                (10, 10),
                "bits written, and objects counted"
            );
            assert_eq!(visible.ids(&scene).len(), 10, "objects listed by `ids`");
            assert_eq!(visible.listed().map(<[_]>::len), Some(10), "objects listed by `listed`");
        }
    }
}

/// Tests that unions of results older than the scene hold the objects of both results, and the objects that
/// are never culled.
#[test]
fn unions_of_results_survive_changes_too() {
    let mut rng = Random(3);
    let mut stale = 0;
    for round in 0..100 {
        let count = rng.pick(&[60, 2000]);
        let mut scene = random_scene(&mut rng, count);
        let mut sets = [(); 2].map(|_| VisibleSet::new());
        let mut expected = BTreeSet::new();
        let layout = scene.layout();
        for set in &mut sets {
            let view = looking_at(rng.vector(1.0)).with_layers(3);
            frustum().cull(&scene, &view, set);
            expected.extend(set.iter(&scene));
            if round % 3 > 0 {
                // A change after each set: the second comes after both sets were culled.
                rng.pick(&CHANGES).1(&mut scene, &mut rng);
            }
        }
        expected.retain(|&id| scene.contains(id));
        stale += usize::from(scene.layout() != layout);
        let mut both = VisibleSet::new();
        if round % 2 == 0 {
            both.clear(&scene);
            both.union(&scene, &sets[0]);
        } else {
            both.clone_from(&sets[0]);
        }
        both.union(&scene, &sets[1]);
        both.finish(&scene);
        let got: BTreeSet<_> = both.iter(&scene).collect();
        let culled = |ids: &BTreeSet<ObjectId>| -> BTreeSet<ObjectId> {
            let can = |id: &ObjectId| {
                let object = scene.object(*id).unwrap();
                !object.never_cull && object.bounds.min.is_finite() && object.bounds.max.is_finite()
            };
            ids.iter().copied().filter(can).collect()
        };
        assert_eq!(culled(&got), culled(&expected), "round {round}");
        let always = scene.ids().filter(|&id| {
            let object = scene.object(id).unwrap();
            object.never_cull && object.layers & 3 != 0
        });
        assert!({ always }.all(|id| got.contains(&id)), "round {round}");
        assert_reads(&scene, &both, &listed(&scene, &both), "union");
    }
    assert!(stale > 30, "too easy: {stale}");
}

#[test]
fn the_result_of_another_scene_hides_nothing() {
    let mut rng = Random(4);
    let scene = random_scene(&mut rng, 500);
    let mut visible = VisibleSet::new();
    frustum().cull(&scene, &looking_at(DVec3::X), &mut visible);
    let copy = scene.clone();
    let on_layers = scene.ids().filter(|&id| scene.object(id).unwrap().layers != 0).count();
    assert!(visible.count(&scene) < on_layers / 2, "at least half of the {on_layers} objects are culled");
    assert_eq!(
        (visible.count(&copy), visible.iter(&copy).count()),
        (on_layers, on_layers),
        "objects of the clone, counted and listed"
    );
    assert!(copy.ids().all(|id| visible.contains(&copy, id)), "an object of the clone is hidden");
    visible.sort_by_index(&copy);
    assert_eq!(visible.ids(&scene.clone()).len(), on_layers, "a clone is another scene");
    assert_eq!(visible.ids(&copy).len(), on_layers, "and is then a result of that scene");
}

#[test]
fn objects_that_are_never_culled_are_in_the_result_of_another_scene() {
    let never = |layers| Object { never_cull: true, layers, ..Object::new(at(5.0, 0.0, 0.0)) };
    let [mut scene, mut other] = [Scene::new(), Scene::new()];
    scene.insert(never(2));
    let mut visible = VisibleSet::new();
    frustum().cull(&scene, &looking_at(DVec3::X).with_layers(1), &mut visible);
    assert_eq!(visible.count(&scene), 0, "objects of the scene on the layer of the view");
    // More blocks of such objects than the first scene has.
    let ids = other.insert_batch((0..200).map(|_| never(1)));
    assert!(ids.iter().all(|&id| visible.contains(&other, id)), "an object of the other scene is hidden");
    assert_eq!(visible.count(&other), 200, "objects of the other scene");
}

#[test]
fn sets_are_finished_until_they_are_culled_again() {
    let mut scene = Scene::new();
    let id = scene.insert(at(5.0, 0.0, 0.0));
    let view = looking_at(DVec3::X);
    let mut visible = VisibleSet::new();
    assert!(!visible.is_finished() && visible.listed().is_none(), "a new set is not finished");
    visible.finish(&scene);
    assert!(visible.is_finished() && visible.listed().is_none(), "nothing has asked for the list");
    assert_eq!(visible.ids(&scene), [id], "the ids of the finished set");
    assert_eq!(visible.listed(), Some(&[id][..]), "the list, once asked for");
    let unfinish: [fn(&mut VisibleSet, &Scene, &View); 6] = [
        |set, scene, view| set.fill(scene, view),
        |set, scene, _| set.clear(scene),
        |set, scene, view| _ = visibility_core::Culler::cull(&mut FrustumCuller::new(), scene, view, set),
        |set, scene, _| _ = set.retain(scene, |_, _| false),
        |set, scene, _| set.keep_in_order(scene, &[]),
        |set, scene, _| set.union(scene, &VisibleSet::new()),
    ];
    for unfinish in unfinish {
        for is_listed in [false, true] {
            visible.finish(&scene);
            if is_listed {
                visible.ids(&scene);
            }
            assert!(visible.is_finished(), "listed: {is_listed}: the set is finished");
            unfinish(&mut visible, &scene, &view);
            assert!(
                !visible.is_finished() && visible.listed().is_none(),
                "listed: {is_listed}: the set is no longer finished"
            );
            let count = visible.count(&scene);
            assert_eq!(visible.ids(&scene).len(), count, "listed: {is_listed}: ids listed and counted");
        }
    }
}

#[test]
fn bits_are_those_of_the_listed_indices() {
    let mut rng = Random(5);
    for count in [0, 1, 31, 32, 33, 64, 2000] {
        let mut scene = random_scene(&mut rng, count);
        let mut visible = VisibleSet::new();
        frustum().cull(&scene, &looking_at(DVec3::X), &mut visible);
        let needed = count.div_ceil(32);
        for len in 0..needed {
            let mut bits = vec![7; len];
            assert_eq!(
                visible.write_bits(&scene, &mut bits),
                Err(BitsError::Length { needed }),
                "{len} words for {count} objects"
            );
            assert!(bits.iter().all(|&word| word == 7), "unchanged");
        }
        // Spawns after culling do not raise the number of words needed.
        scene.insert_batch((0..100).map(|_| random_box(&mut rng)));
        for len in [needed, needed + 3] {
            let mut bits = vec![u32::MAX; len];
            visible.write_bits(&scene, &mut bits).unwrap();
            for i in 0..len * 32 {
                let is_listed = listed(&scene, &visible).iter().any(|id| id.index() == i);
                assert_eq!(bits[i / 32] >> (i % 32) & 1 == 1, is_listed, "{i} of {count}");
            }
        }
    }
}

#[test]
fn a_render_thread_reads_results_while_the_scene_changes() {
    fn is_send_and_sync<T: Send + Sync + 'static>() {}
    is_send_and_sync::<VisibleSet>();
    is_send_and_sync::<Pipeline>();
    let mut rng = Random(6);
    let mut scene = random_scene(&mut rng, 2000);
    let (mut front, mut back) = (VisibleSet::new(), VisibleSet::new());
    let mut pipeline = frustum();
    for _ in 0..20 {
        pipeline.cull(&scene, &looking_at(rng.vector(1.0)), &mut back);
        core::mem::swap(&mut front, &mut back);
        let expected: Vec<_> = front.iter(&scene).collect();
        front.ids(&scene);
        std::thread::scope(|scope| {
            let render = scope.spawn(|| front.listed().map(<[_]>::to_vec));
            scene.remove(any(&scene, &mut rng)).unwrap();
            scene.insert(random_box(&mut rng));
            assert_eq!(render.join().unwrap(), Some(expected), "the list that a render thread reads");
        });
    }
}

#[test]
fn ids_are_numbers_and_one_names_no_object() {
    let mut scene = Scene::new();
    for _ in 0..5 {
        let id = scene.insert(at(0.0, 0.0, 0.0));
        assert_eq!(
            id.to_bits(),
            u64::from(id.generation()) << 32 | id.index() as u64,
            "the bits of {id} are its generation and index"
        );
        assert_eq!(ObjectId::from_bits(id.to_bits()), id, "the id from its bits");
        assert!(
            scene.contains(id) && !scene.contains(ObjectId::PLACEHOLDER),
            "{id} is in the scene, the placeholder never is"
        );
        scene.remove(id).unwrap();
    }
    for bits in [0, u64::MAX, 0x0123_4567_89ab_cdef] {
        assert_eq!(ObjectId::from_bits(bits).to_bits(), bits, "an id from any bits");
    }
}

#[cfg(feature = "bytemuck")]
#[test]
fn ids_and_boxes_are_plain_data() {
    assert_eq!(
        bytemuck::cast::<_, [f32; 6]>(at(1.0, 2.0, 3.0)),
        [1.0, 2.0, 3.0, 1.5, 2.5, 3.5],
        "a box is its six coordinates"
    );
    assert_eq!(
        bytemuck::cast::<_, [u32; 2]>(ObjectId::from_bits(3 << 32 | 4)),
        [4, 3],
        "an id is its index and generation"
    );
}
