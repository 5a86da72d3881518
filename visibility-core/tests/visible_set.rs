//! Tests of [`VisibleSet`]: its content, its changes between frames, its order, and the composition of
//! cullers.

use std::collections::HashSet;
use visibility_core::glam::DVec3;
use visibility_core::scene::DrawRange;
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, FrustumCuller, Object, ObjectId, Pipeline, Pose, Scene, View,
    VisibleSet,
};
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
    View::perspective(Pose::look_at(DVec3::ZERO, target, DVec3::Z), 0.9, 1.3, 0.1, f64::INFINITY).unwrap()
}

fn frustum() -> Pipeline {
    Pipeline::new().with(FrustumCuller::new())
}

fn set_of(ids: impl Iterator<Item = ObjectId>) -> HashSet<ObjectId> {
    let list: Vec<ObjectId> = ids.collect();
    let set: HashSet<ObjectId> = list.iter().copied().collect();
    assert_eq!(list.len(), set.len(), "each object once");
    set
}

/// Returns the objects of the set, after asserting that all ways to read the set agree.
fn read(scene: &Scene, visible: &VisibleSet) -> HashSet<ObjectId> {
    let set = set_of(visible.iter(scene));
    assert_eq!(set.len(), visible.count(scene), "objects listed and counted");
    for id in scene.ids() {
        assert_eq!(visible.contains(scene, id), set.contains(&id), "{id}");
    }
    set
}

/// A culler that removes the objects whose index is a multiple of the first field, and claims the accuracy of
/// the second field.
struct Every(usize, Accuracy);

impl Culler for Every {
    fn name(&self) -> &str {
        "every"
    }

    fn accuracy(&self) -> Accuracy {
        self.1
    }

    fn cull(&mut self, scene: &Scene, _: &View, visible: &mut VisibleSet) -> CullStats {
        visible.retain(scene, |id, _| !id.index().is_multiple_of(self.0))
    }
}

#[test]
fn a_view_shows_what_shares_a_layer_with_it() {
    let mut rng = Random(1);
    for count in [1, 50, 3000] {
        let mut scene = Scene::new();
        let layers: Vec<u32> = (0..count)
            .map(|_| rng.pick(&[u32::MAX, 0, 1, 2, 3, 1 << 31, rng.clone().bits() as u32]))
            .collect();
        let ids = scene.insert_batch(layers.iter().map(|&layers| Object {
            layers,
            never_cull: layers % 3 == 1,
            ..Object::new(random_box(&mut rng))
        }));
        let mut all = VisibleSet::new();
        frustum().cull(&scene, &looking_at(DVec3::X), &mut all);
        let all = read(&scene, &all);
        for mask in [u32::MAX, 0, 1, 2, 4, 1 << 31] {
            let view = looking_at(DVec3::X).with_layers(mask);
            assert_eq!(view.layers(), mask, "the layers that the view was given");
            let mut visible = VisibleSet::new();
            let stats = frustum().cull(&scene, &view, &mut visible);
            let expected: HashSet<_> = ids
                .iter()
                .zip(&layers)
                .filter(|&(id, layers)| layers & mask != 0 && all.contains(id))
                .map(|(&id, _)| id)
                .collect();
            // An object on no layer is in no view, and `all` does not contain it either.
            assert_eq!(read(&scene, &visible), expected, "layers {mask:#x}");
            assert_eq!(
                stats.visible,
                expected.len() as u64,
                "layers {mask:#x}: objects counted and in the set"
            );

            let mut visible = VisibleSet::new();
            let stats = Pipeline::new().cull(&scene, &view, &mut visible);
            let expected = layers.iter().filter(|&layers| layers & mask != 0).count();
            assert_eq!(read(&scene, &visible).len(), expected, "no stage: all on layers {mask:#x}");
            assert_eq!(stats.visible, expected as u64, "objects left in the set, without a stage");
        }
    }
}

#[test]
fn a_view_of_no_layer_shows_nothing() {
    let mut scene = Scene::new();
    scene.insert_batch((0..100).map(|i| Object { never_cull: i % 2 == 0, ..Object::new(at(5.0, 0.0, 0.0)) }));
    let mut visible = VisibleSet::new();
    frustum().cull(&scene, &looking_at(DVec3::X).with_layers(0), &mut visible);
    assert_eq!(read(&scene, &visible).len(), 0, "objects on no layer of the view");
}

/// Tests the cost of culling by counters: objects out of view cost nothing, and objects entirely in view are
/// not tested one by one.
#[test]
fn cost_follows_what_is_seen() {
    let mut scene = Scene::new();
    let grid = |i: usize| [i % 64, i / 64 % 64, i / 4096].map(|x| x as f32);
    scene.insert_batch((0..64 * 64 * 64).map(|i| {
        let [x, y, z] = grid(i);
        at(10.0 + x, y - 32.0, z - 32.0)
    }));
    let mut visible = VisibleSet::new();
    let away = frustum().cull(&scene, &looking_at(DVec3::NEG_X), &mut visible);
    assert!(away.nodes <= 1 && away.visible == 0, "{away:?}");
    let eye = Pose::look_at(DVec3::new(-200.0, 0.0, 0.0), DVec3::ZERO, DVec3::Z);
    let all = View::perspective(eye, 0.9, 1.3, 0.1, f64::INFINITY).unwrap();
    let all = frustum().cull(&scene, &all, &mut visible);
    assert_eq!(
        (all.nodes, all.visible, visible.count(&scene)),
        (1, 262_144, 262_144),
        "nodes entered, and objects accepted with the root"
    );
    // A narrow frustum with some hundred objects.
    let narrow =
        View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 0.05, 1.0, 0.1, f64::INFINITY);
    let pencil = frustum().cull(&scene, &narrow.unwrap(), &mut visible);
    assert!((100..2000).contains(&pencil.visible), "{pencil:?}");
    assert!(pencil.nodes < 200 && pencil.tests < 60_000, "{pencil:?}");
}

#[test]
fn layers_can_change_between_frames() {
    let mut scene = Scene::new();
    let ids = scene.insert_batch((0..200).map(|i| at(5.0, 0.0, i as f32 * 0.01)));
    let view = looking_at(DVec3::X).with_layers(2);
    let mut visible = VisibleSet::new();
    for (round, &id) in ids.iter().enumerate() {
        frustum().cull(&scene, &view, &mut visible);
        assert_eq!(
            visible.count(&scene),
            200 - round,
            "objects left on the layers after {round} have changed"
        );
        scene.set_layers(id, 5).unwrap();
    }
    ids.iter().for_each(|&id| scene.set_layers(id, u32::MAX).unwrap());
    frustum().cull(&scene, &view, &mut visible);
    assert_eq!(visible.count(&scene), 200, "objects back on all layers");
}

/// Tests that a change of layers after culling affects the next frame's set, and that until then all ways to
/// read the set agree.
#[test]
fn a_set_whose_objects_change_layers_still_agrees_with_itself() {
    let mut scene = Scene::new();
    let ids = scene.insert_batch((0..300).map(|i| Object {
        layers: 1 + i as u32 % 2,
        never_cull: i % 7 == 0,
        ..Object::new(at(if i % 3 == 0 { -5.0 } else { 5.0 }, 0.0, 0.0))
    }));
    let mut visible = VisibleSet::new();
    frustum().cull(&scene, &looking_at(DVec3::X).with_layers(1), &mut visible);
    for &id in &ids {
        scene.set_layers(id, 3 - scene.object(id).unwrap().layers).unwrap();
    }
    read(&scene, &visible);
}

#[test]
fn what_is_never_culled_or_unbounded_survives_every_culler() {
    let mut rng = Random(2);
    let mut scene = Scene::new();
    let behind = at(-50.0, 0.0, 0.0);
    let nan = Aabb::from_arrays([f32::NAN; 3], [1.0; 3]);
    let mut always = Vec::new();
    for round in 0..200 {
        scene.insert_batch((0..rng.below(20)).map(|_| behind));
        always.push(scene.insert(match round % 3 {
            0 => Object { never_cull: true, ..Object::new(behind) },
            1 => Object::new(nan),
            _ => Object::new(Aabb::from_arrays([0.0; 3], [f32::INFINITY, 1.0, 1.0])),
        }));
    }
    let mut pipeline = frustum().with(Every(1, Accuracy::Approximate));
    let mut visible = VisibleSet::new();
    let stats = pipeline.cull(&scene, &looking_at(DVec3::X), &mut visible);
    assert_eq!(read(&scene, &visible), set_of(always.iter().copied()), "objects that no culler may remove");
    assert_eq!(stats.visible, 200, "objects counted that no culler may remove");
    // The objects can be culled again when the flag is reset.
    for &id in &always {
        scene.set_never_cull(id, false).unwrap();
        scene.set_bounds(id, behind).unwrap();
    }
    pipeline.cull(&scene, &looking_at(DVec3::X), &mut visible);
    assert_eq!(visible.count(&scene), 0, "objects without the flag, behind the eye");
}

/// Tests that every change which gives an object another slot makes older sets that were not finished count
/// as holding everything on their layers. (`tests/results.rs` has the same changes under finished sets.)
#[test]
fn an_unfinished_set_of_another_layout_holds_everything_on_its_layers() {
    type Change = fn(&mut Scene, &[ObjectId]);
    let changes: [(&str, Change); 8] = [
        ("insert", |scene, _| {
            scene.insert(at(-9.0, 0.0, 0.0));
        }),
        ("insert_batch", |scene, _| {
            scene.insert_batch([at(-9.0, 0.0, 0.0)]);
        }),
        ("insert never culled", |scene, _| {
            scene.insert(Object { never_cull: true, ..Object::new(at(-9.0, 0.0, 0.0)) });
        }),
        ("remove", |scene, ids| scene.remove(ids[5]).unwrap()),
        ("teleport", |scene, ids| scene.set_bounds(ids[5], at(9e5, 0.0, 0.0)).unwrap()),
        ("unbounded", |scene, ids| scene.set_bounds(ids[5], Aabb::EMPTY).unwrap()),
        ("never cull", |scene, ids| scene.set_never_cull(ids[5], true).unwrap()),
        ("rebuild", |scene, _| scene.rebuild()),
    ];
    for (name, change) in changes {
        for count in [60, 1000] {
            let mut scene = Scene::new();
            let mut rng = Random(3);
            let ids = scene.insert_batch((0..count).map(|i| Object {
                layers: if i % 10 == 0 { 4 } else { u32::MAX },
                ..Object::new(random_box(&mut rng))
            }));
            let view = looking_at(DVec3::X).with_layers(3);
            let mut visible = VisibleSet::new();
            visible.fill(&scene, &view);
            FrustumCuller::new().cull(&scene, &view, &mut visible);
            assert!(
                read(&scene, &visible).len() < count / 2,
                "{name}: of {count} objects, half or more are left"
            );
            change(&mut scene, &ids);
            let on_layers = set_of(scene.ids().filter(|&id| scene.object(id).unwrap().layers & 3 != 0));
            if count == 60 && name == "teleport" {
                continue; // 60 objects share one leaf, so no slot changes.
            }
            assert_eq!(read(&scene, &visible), on_layers, "after {name}");
            // Cullers that are called without `fill` then start from everything too.
            FrustumCuller::new().cull(&scene, &view, &mut visible);
            let again = read(&scene, &visible);
            let mut fresh = VisibleSet::new();
            frustum().cull(&scene, &view, &mut fresh);
            assert_eq!(again, read(&scene, &fresh), "after {name}");
        }
    }
}

#[test]
fn maintenance_that_moves_objects_makes_unfinished_sets_stale() {
    let mut rng = Random(4);
    let mut rehomed = 0;
    for _ in 0..60 {
        let mut scene = Scene::new();
        let ids = scene.insert_batch((0..500).map(|_| random_box(&mut rng)));
        // Maintenance merges leaves in which few objects are left.
        let (gone, ids) = ids.split_at(rng.below(500));
        scene.remove_batch(gone).unwrap();
        let view = looking_at(rng.vector(1.0));
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &view);
        FrustumCuller::new().cull(&scene, &view, &mut visible);
        let before = read(&scene, &visible);
        let moved = scene.maintain(rng.below(9)).rehomed;
        rehomed += moved;
        let after = read(&scene, &visible);
        assert!(after.is_superset(&before), "nothing vanishes");
        assert_eq!(
            after.len(),
            if moved > 0 { ids.len() } else { before.len() },
            "{moved} objects moved: all are visible, or as many as before"
        );
    }
    assert!(rehomed > 100, "too easy: {rehomed}");
}

#[test]
fn a_turning_camera_is_told_what_appears_and_what_vanishes() {
    let mut rng = Random(5);
    let mut scene = Scene::new();
    let mut ids = scene.insert_batch((0..3000).map(|_| random_box(&mut rng)));
    let mut visible = VisibleSet::new().with_changes();
    let mut pipeline = frustum();
    let mut before: HashSet<ObjectId> = HashSet::new();
    let (mut appeared, mut removed_while_visible, mut reused_while_visible) = (0, 0, 0);
    for frame in 0..240 {
        let angle = f64::from(frame) * 0.05;
        let target = DVec3::new(angle.cos(), angle.sin(), 0.0);
        // Objects are removed and inserted between frames; the indices of removed ones are reused at once.
        for _ in 0..rng.below(40) {
            let gone = ids.swap_remove(rng.below(ids.len()));
            scene.remove(gone).unwrap();
            removed_while_visible += usize::from(before.contains(&gone));
            if !rng.one_in(3) {
                // New objects are often in view, so that an index is visible in both frames, but for two
                // different objects.
                let p = if rng.one_in(2) { (target * 30.0).as_vec3() } else { rng.vector(100.0).as_vec3() };
                ids.push(scene.insert(at(p.x, p.y, p.z)));
                reused_while_visible +=
                    usize::from(before.contains(&gone) && ids[ids.len() - 1].index() == gone.index());
            }
        }
        if frame % 50 == 49 {
            scene.rebuild();
        }
        pipeline.cull(&scene, &looking_at(target), &mut visible);
        let now = read(&scene, &visible);
        assert_eq!(set_of(visible.newly_visible()), &now - &before, "newly visible in frame {frame}");
        assert_eq!(set_of(visible.newly_hidden()), &before - &now, "newly hidden in frame {frame}");
        appeared += visible.newly_visible().count();
        before = now;
    }
    assert!(
        appeared > 3000 && removed_while_visible > 100 && reused_while_visible > 50,
        "{appeared} appeared, {removed_while_visible} removed and {reused_while_visible} reused while visible"
    );
}

#[test]
fn in_another_scene_everything_is_new() {
    let (mut scene, mut pipeline) = (Scene::new(), frustum());
    let ids = scene.insert_batch([at(5.0, 0.0, 0.0), at(6.0, 0.0, 0.0), at(-5.0, 0.0, 0.0)]);
    let (copy, view) = (scene.clone(), looking_at(DVec3::X));
    let mut visible = VisibleSet::new().with_changes();
    let mut told = |scene: &Scene| {
        pipeline.cull(scene, &view, &mut visible);
        (set_of(visible.newly_visible()), set_of(visible.newly_hidden()))
    };
    let (both, none) = (set_of(ids[..2].iter().copied()), HashSet::new());
    assert_eq!(told(&scene), (both.clone(), none.clone()), "the first frame: both are new");
    assert_eq!(told(&scene), (none.clone(), none.clone()), "the second frame: nothing has changed");
    assert_eq!(told(&copy), (both.clone(), both.clone()), "the same ids name other objects");
    assert_eq!(told(&copy), (none.clone(), none), "the second frame of the clone: nothing has changed");
}

#[test]
fn sets_without_changes_tell_of_none() {
    let mut scene = Scene::new();
    scene.insert(at(5.0, 0.0, 0.0));
    let mut visible = VisibleSet::new();
    frustum().cull(&scene, &looking_at(DVec3::X), &mut visible);
    assert_eq!(
        (visible.count(&scene), visible.newly_visible().count(), visible.newly_hidden().count()),
        (1, 0, 0),
        "objects visible, and none told of"
    );
}

#[test]
fn retained_sorted_and_counted_sets_agree() {
    let mut rng = Random(6);
    for count in [0, 1, 64, 65, 5000] {
        let mut scene = Scene::new();
        scene.insert_batch((0..count).map(|i| Object {
            never_cull: i % 50 == 7,
            cost: rng.below(100) as u32,
            ..Object::new(random_box(&mut rng))
        }));
        let mut visible = VisibleSet::new();
        frustum().cull(&scene, &looking_at(DVec3::Y), &mut visible);
        let before = read(&scene, &visible);
        let mut asked = HashSet::new();
        let stats = visible.retain(&scene, |id, bounds| {
            assert!(asked.insert(id), "each is asked for once");
            assert_eq!(*bounds, scene.bounds(id).unwrap(), "{id}: the bounds that are given with it");
            id.index() % 3 != 0
        });
        let never = |id: ObjectId| scene.object(id).unwrap().never_cull;
        let expected: HashSet<_> =
            before.iter().copied().filter(|&id| never(id) || id.index() % 3 != 0).collect();
        assert_eq!(
            asked,
            before.iter().copied().filter(|&id| !never(id)).collect(),
            "{count}: the objects asked about are those that can be culled"
        );
        assert_eq!(read(&scene, &visible), expected, "{count}: objects retained");
        assert_eq!(
            (stats.visible, stats.tests),
            (expected.len() as u64, asked.len() as u64),
            "{count}: objects visible and tested"
        );

        let key = |id: ObjectId| scene.object(id).unwrap().cost;
        visible.sort_by_key(&scene, key);
        assert_eq!(read(&scene, &visible), expected, "{count}: sorting loses no object");
        let mut in_order: Vec<_> = expected.iter().copied().collect();
        in_order.sort_by_key(|&id| (key(id), id));
        assert_eq!(visible.iter(&scene).collect::<Vec<_>>(), in_order, "{count}: objects by cost, then id");
        // Objects removed by a later stage disappear from the order too.
        visible.retain(&scene, |id, _| id.index() % 2 == 0);
        in_order.retain(|&id| never(id) || id.index() % 2 == 0);
        assert_eq!(
            visible.iter(&scene).collect::<Vec<_>>(),
            in_order,
            "{count}: the order after a later stage"
        );
        read(&scene, &visible);
        // The next frame starts without an order.
        frustum().cull(&scene, &looking_at(DVec3::Y), &mut visible);
        assert_eq!(read(&scene, &visible), before, "{count}: the next frame holds all objects again");
    }
}

#[test]
fn cullers_in_a_pipeline_intersect() {
    let mut rng = Random(7);
    for count in [0, 10, 64, 5000] {
        let mut scene = Scene::new();
        scene.insert_batch((0..count).map(|i| Object {
            never_cull: i % 97 == 5,
            layers: if i % 11 == 0 { 6 } else { 3 },
            ..Object::new(random_box(&mut rng))
        }));
        for _ in 0..20 {
            let view = looking_at(rng.vector(1.0)).with_layers(rng.pick(&[1, 2, 4, 7]));
            let result = |mut pipeline: Pipeline| {
                let mut visible = VisibleSet::new();
                let stats = pipeline.cull(&scene, &view, &mut visible);
                assert_eq!(stats.visible, visible.count(&scene) as u64, "objects counted and in the set");
                assert_eq!(
                    pipeline.stages().last().unwrap().1.visible,
                    stats.visible,
                    "the last stage leaves as many as the pipeline"
                );
                read(&scene, &visible)
            };
            let every = || Every(2 + count % 3, Accuracy::Approximate);
            let (a, b) = (result(frustum()), result(Pipeline::new().with(every())));
            let both: HashSet<_> = a.intersection(&b).copied().collect();
            assert_eq!(result(frustum().with(every())), both, "{count}: the frustum, then every other");
            assert_eq!(
                result(Pipeline::new().with(every()).with(FrustumCuller::new())),
                both,
                "{count}: every other, then the frustum"
            );
            assert_eq!(result(frustum().with(FrustumCuller::new())), a, "the same once more changes nothing");
            assert_eq!(
                result(frustum().with(Every(1, Accuracy::Approximate)).with(FrustumCuller::new())).len(),
                {
                    scene
                        .ids()
                        .map(|id| scene.object(id).unwrap())
                        .filter(|o| o.never_cull && o.layers & view.layers() != 0)
                        .count()
                },
                "{count}: objects that no culler may remove"
            );
        }
    }
}

#[test]
fn the_accuracy_of_two_cullers_is_what_their_intersection_promises() {
    use Accuracy::*;
    // The two guarantees of each accuracy: never hides visible objects, never shows hidden ones.
    let promises = |a| match a {
        Exact => (true, true),
        Conservative => (true, false),
        Aggressive => (false, true),
        Approximate => (false, false),
    };
    let all = [Exact, Conservative, Aggressive, Approximate];
    for a in all {
        assert_eq!(a.never_hides(), promises(a).0, "{a}: whether visible objects stay");
        for b in all {
            // Sets over four objects, two of them visible. All sets that the accuracies of a and b allow are
            // intersected; the accuracy of the sequence must hold for every intersection.
            const V: u8 = 0b0011;
            let allowed = |accuracy, set: u8| {
                let (never_hides, never_shows) = promises(accuracy);
                (!never_hides || set & V == V) && (!never_shows || set & !V == 0)
            };
            let sets = |accuracy| (0..16u8).filter(move |&set| allowed(accuracy, set));
            let results = || sets(a).flat_map(|x| sets(b).map(move |y| x & y));
            let expected = (results().all(|set| set & V == V), results().all(|set| set & !V == 0));
            assert_eq!(promises(a.and(b)), expected, "{a} and {b}");
            let pipeline = Pipeline::new().with(Every(2, a)).with(Every(3, b));
            assert_eq!(pipeline.accuracy(), a.and(b), "the accuracy of a pipeline of {a} and {b}");
        }
    }
    assert_eq!(Pipeline::new().accuracy(), Conservative, "the accuracy of a pipeline without stages");
}

/// Tests a set that is used with another scene, as when a level is loaded: it holds everything of that scene.
#[test]
fn a_set_of_another_scene_causes_no_panic_and_hides_nothing() {
    let mut rng = Random(8);
    let mut build = |count: usize| {
        let mut scene = Scene::new();
        scene.insert_batch((0..count).map(|_| random_box(&mut rng)));
        scene
    };
    let (small, large) = (build(100), build(5000));
    for (first, second) in [(&small, &large), (&large, &small)] {
        let mut visible = VisibleSet::new().with_changes();
        frustum().cull(first, &looking_at(DVec3::X), &mut visible);
        let second_set = read(second, &visible);
        assert_eq!(second_set.len(), second.len(), "nothing of another scene is hidden");
        FrustumCuller::new().cull(second, &looking_at(DVec3::X), &mut visible);
        visible.finish(second);
        let mut fresh = VisibleSet::new();
        frustum().cull(second, &looking_at(DVec3::X), &mut fresh);
        assert_eq!(
            read(second, &visible),
            read(second, &fresh),
            "a used set and a fresh one, in the second scene"
        );
    }
}

#[test]
fn a_set_is_cut_down_to_a_list_and_keeps_its_order() {
    let mut scene = Scene::new();
    let ids = scene.insert_batch((0..5000).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 0.5; 3])));
    let always = scene.insert(Aabb::from_arrays([f32::NAN; 3], [1.0; 3]));
    let mut visible = VisibleSet::new();
    visible.retain(&scene, |id, _| id.index() % 2 == 0);
    let list: Vec<_> = [4000, 7, 12, 4998, 12, 0].map(|i| ids[i]).to_vec();
    visible.keep_in_order(&scene, &list);
    let kept: Vec<_> = visible.iter(&scene).collect();
    assert_eq!(
        kept,
        [always, ids[4000], ids[12], ids[4998], ids[0]],
        "objects of the list that were visible, in its order, and the one never culled"
    );
    assert_eq!(visible.count(&scene), 5, "objects kept");
    assert!(
        !visible.contains(&scene, ids[7]) && !visible.contains(&scene, ids[14]),
        "neither object 7, hidden before, nor object 14, not listed"
    );
    // Once more, on a set from which objects have been removed.
    visible.keep_in_order(&scene, &[ids[0], always, ids[14]]);
    assert_eq!(
        visible.iter(&scene).collect::<Vec<_>>(),
        [always, ids[0]],
        "objects kept of a set cut down before"
    );
    visible.keep_in_order(&scene, &[]);
    assert_eq!(visible.count(&scene), 1, "the object that is never culled");
}

#[test]
fn some_are_put_first_and_none_is_lost() {
    let mut scene = Scene::new();
    let ids = scene.insert_batch((0..300).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 0.5; 3])));
    let always = scene.insert(Aabb::EMPTY);
    let mut visible = VisibleSet::new();
    visible.retain(&scene, |id, _| id != ids[5]);
    visible.order_first(&scene, &[ids[200], ids[5], ids[3], ids[200]]);
    let order: Vec<_> = visible.iter(&scene).collect();
    assert_eq!(
        order[..3],
        [always, ids[200], ids[3]],
        "the object never culled, then those put first that are visible"
    );
    let mut sorted = order.clone();
    sorted.sort_unstable();
    sorted.dedup();
    assert_eq!((order.len(), sorted.len()), (300, 300), "objects in the order, all and distinct");
    assert_eq!(scene.id_at(ids[5].index()), Some(ids[5]), "the object with this index");
    scene.remove(ids[5]).unwrap();
    assert_eq!(
        (scene.id_at(ids[5].index()), scene.id_at(9999)),
        (None, None),
        "an index of a removed object, and one beyond all"
    );
}

#[test]
fn occluders_of_a_set_are_those_that_can_occlude() {
    let mut scene = Scene::new();
    let flagged = |i: usize| Object { occluder: i.is_multiple_of(2), ..Object::new(at(i as f32, 0.0, 0.0)) };
    let ids = scene.insert_batch((0..200).map(flagged));
    scene.set_never_cull(ids[4], true).unwrap();
    let range = |margin: f32| DrawRange { end: 100.0, margin, ..DrawRange::ALWAYS };
    scene.set_draw_range(ids[6], range(0.0)).unwrap();
    scene.set_draw_range(ids[8], range(1.0)).unwrap();
    for step in 0..2 {
        let mut found = HashSet::new();
        let mut visible = VisibleSet::new();
        visible.retain(&scene, |id, _| id != ids[10]);
        visible.for_each_occluder(&scene, |id| assert!(found.insert(id), "step {step}: {id} twice"));
        let expected = (0..200).filter(|i| i % 2 == 0 && ![4, 8, 10].contains(i));
        assert_eq!(found, expected.map(|i| ids[i]).collect::<HashSet<_>>(), "step {step}: occluders");
        let can = |&i: &usize| scene.can_occlude(ids[i]);
        assert!(
            (0..200).filter(can).eq((0..200).filter(|i| i % 2 == 0 && ![4, 8].contains(i))),
            "step {step}"
        );
        scene.rebuild();
    }
    scene.remove(ids[0]).unwrap();
    assert!(!scene.can_occlude(ids[0]), "an unknown object");
}

/// Occluders of a union are those on a layer that all of its sets draw.
#[test]
fn occluders_that_one_view_of_a_union_does_not_draw_are_left_out() {
    let mut scene = Scene::new();
    let all = [0b001, 0b010, 0b100, 0b011, 0b111, 0].map(|layers| {
        scene.insert(Object { occluder: true, layers, ..Object::new(at(layers as f32, 0.0, 0.0)) })
    });
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let set_of = |layers: u32| {
        let view = View::perspective(pose, 1.0, 1.0, 0.1, 100.0).unwrap().with_layers(layers);
        let mut set = VisibleSet::new();
        set.fill(&scene, &view);
        set
    };
    let occluders = |set: &VisibleSet| {
        let mut found = Vec::new();
        set.for_each_occluder(&scene, |id| found.push(all.iter().position(|&other| other == id).unwrap()));
        found.sort_unstable();
        found
    };
    let union = |layers: &[u32]| {
        let mut both = VisibleSet::new();
        both.clear(&scene);
        layers.iter().for_each(|&layers| both.union(&scene, &set_of(layers)));
        both
    };
    assert_eq!(occluders(&set_of(0b011)), [0, 1, 3, 4], "of one view");
    assert_eq!(occluders(&union(&[0b011])), [0, 1, 3, 4], "of a union of one view");
    let both = union(&[0b011, 0b110]);
    assert_eq!(
        (both.count(&scene), occluders(&both)),
        (5, vec![1, 3, 4]),
        "of two views with a layer in common"
    );
    assert_eq!(occluders(&union(&[0b001, 0b010])), [0; 0], "of two views without one");
    let mut nested = union(&[0b111]);
    nested.union(&scene, &both);
    assert_eq!((nested.layers(), nested.common_layers()), (0b111, 0b010), "layers of a union with a union");
    let mut again = both.clone();
    let view = View::perspective(pose, 1.0, 1.0, 0.1, 100.0).unwrap().with_layers(0b100);
    again.fill(&scene, &view);
    assert_eq!(again.common_layers(), 0b100, "layers of a set that is filled again");
}

/// The fingerprint tells sets apart that differ in an object that is never culled alone.
#[test]
fn fingerprints_include_objects_that_are_never_culled() {
    let mut scene = Scene::new();
    scene.insert(at(1.0, 0.0, 0.0));
    let never = scene.insert(Object { never_cull: true, ..Object::new(at(2.0, 0.0, 0.0)) });
    let mut of_layers = |layers: u32| {
        scene.set_layers(never, layers).unwrap();
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, 0.1, 100.0).unwrap().with_layers(1);
        let mut set = VisibleSet::new();
        set.fill(&scene, &view);
        let unfinished = (set.count(&scene), set.fingerprint(&scene).1);
        set.finish(&scene);
        assert_eq!(set.fingerprint(&scene).1, unfinished.1, "layers {layers}: the finished set");
        unfinished
    };
    let [one, two, three] = [1, 2, 3].map(&mut of_layers);
    assert_eq!([one.0, two.0, three.0], [2, 1, 2], "objects of the sets");
    assert_ne!(one.1, two.1, "sets with and without the object");
    assert_eq!(one.1, three.1, "equal sets");
}

/// Sets that were finished before the layout changed keep what they hold, so different ones have different
/// fingerprints.
#[test]
fn fingerprints_of_finished_sets_of_an_older_layout_differ() {
    let mut scene = Scene::new();
    let ids = scene.insert_batch([1.0, 2.0].map(|x| at(x, 0.0, 0.0)));
    let [mut both, mut one] = [VisibleSet::new(), VisibleSet::new()];
    both.keep_in_order(&scene, &ids);
    one.keep_in_order(&scene, &ids[..1]);
    both.finish(&scene);
    one.finish(&scene);
    scene.insert(at(3.0, 0.0, 0.0));
    assert_ne!(both.fingerprint(&scene), one.fingerprint(&scene), "sets of two and of one object");
    assert_eq!(both.fingerprint(&scene), both.clone().fingerprint(&scene), "a set and its clone");
}
