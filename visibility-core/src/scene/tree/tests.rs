//! Invariants of the hierarchy, checked from the inside after random sequences of changes.

use super::*;
use crate::scene::DrawRange;
use crate::{Object, Scene};
use std::collections::HashSet;
use std::vec::Vec;
use visibility_testing::Random;

/// Greatest values that occurred in a tree during a test, to make sure that the test reached the cases it is
/// about: levels of the tree, free nodes, and leaves of objects that are never culled.
#[derive(Default)]
struct Seen {
    height: u8,
    free: usize,
    unculled: usize,
    /// Number of objects whose HLOD parent may be drawn in their place.
    substituted: usize,
}

/// Asserts that the tree is internally consistent and holds exactly the scene's objects. Raises the
/// maxima in `seen` to those of this tree.
fn check(scene: &Scene, seen: &mut Seen) {
    let tree = scene.tree();
    let nodes = tree.node_count();
    for length in [tree.bounds.len(), tree.ids.len(), tree.layers.len(), tree.occluders.len()] {
        assert_eq!(length, nodes, "each array of the tree has an entry for each of {nodes} nodes");
    }
    assert_eq!(
        (tree.parents.len(), tree.levels.len()),
        (nodes, nodes),
        "each array of the tree has an entry for each of {nodes} nodes"
    );
    assert_eq!(
        (tree.detail_bounds.len(), tree.detailed.len()),
        (nodes, nodes),
        "each array of the tree has an entry for each of {nodes} nodes"
    );

    let mut reached: HashSet<usize> = HashSet::new();
    let mut objects: HashSet<ObjectId> = HashSet::new();
    let check_leaf = |leaf: usize, objects: &mut HashSet<ObjectId>, seen: &mut Seen| {
        assert_ne!(tree.occupied[leaf], 0, "leaf {leaf} is empty and not free");
        for lane in 0..FAN_OUT {
            if tree.occupied[leaf] >> lane & 1 == 0 {
                check_lane_is_free(tree, leaf, lane);
                continue;
            }
            let id = tree.ids[leaf][lane];
            assert_eq!(tree.slots[id.index()], Slot::new(leaf as u32, lane), "{id} points back");
            assert!(scene.contains(id), "{id} is in the scene");
            assert!(objects.insert(id), "{id} is there once");
            let object = scene.object(id).unwrap();
            seen.substituted += usize::from(check_detail(scene, leaf, lane, id));
            assert_eq!(
                object.is_unculled(),
                tree.is_unculled_leaf(leaf),
                "{id} is in the right kind of leaf"
            );
        }
    };

    let mut stack = Vec::new();
    if tree.root != NONE {
        assert_eq!(tree.parents[tree.root as usize], Slot::NONE, "the root has no parent");
        assert!(
            tree.levels[tree.root as usize] < 10,
            "the root's level is {}",
            tree.levels[tree.root as usize]
        );
        stack.push(tree.root as usize);
        seen.height = seen.height.max(tree.levels[tree.root as usize]);
    }
    while let Some(node) = stack.pop() {
        assert!(reached.insert(node), "node {node} is reached once");
        if tree.levels[node] == 0 {
            check_leaf(node, &mut objects, seen);
            continue;
        }
        assert_ne!(tree.occupied[node], 0, "inner node {node} is empty and not free");
        assert_eq!(
            (tree.occluders[node], tree.detailed[node]),
            (0, 0),
            "inner node {node} has marks that only leaves have"
        );
        for lane in 0..FAN_OUT {
            if tree.occupied[node] >> lane & 1 == 0 {
                check_lane_is_free(tree, node, lane);
                continue;
            }
            let child = tree.child(node, lane);
            assert_eq!(
                tree.levels[child] + 1,
                tree.levels[node],
                "the level of node {child} is one below that of its parent {node}"
            );
            assert_eq!(tree.parents[child], Slot::new(node as u32, lane), "node {child} points up");
            let (bounds, hull) = (tree.bounds[node].get(lane), tree.bounds[child].hull());
            assert!(
                hull.is_finite() && bounds.min.cmple(hull.min).all() && bounds.max.cmpge(hull.max).all(),
                "{bounds:?} above node {child} contains {hull:?}"
            );
            let (above, below) = (tree.detail_bounds[node], tree.detail_bounds[child]);
            assert!(
                above.diagonal_squared >= below.diagonal_squared && above.end >= below.end,
                "the limits of node {node} cover those of its child {child}"
            );
            stack.push(child);
        }
    }

    for (place, &leaf) in tree.unculled.iter().enumerate() {
        let leaf = leaf as usize;
        assert!(reached.insert(leaf), "leaf {leaf} is in the tree or outside");
        assert_eq!(
            (tree.levels[leaf], tree.parents[leaf].0 as usize),
            (UNCULLED, place),
            "leaf {leaf} of unculled objects knows its place"
        );
        let is_full = tree.occupied[leaf] == u64::MAX;
        assert_eq!(is_full, place < tree.full_unculled, "leaf {leaf} at {place} is full");
        check_leaf(leaf, &mut objects, seen);
    }
    let free: HashSet<usize> = tree.free.iter().map(|&node| node as usize).collect();
    assert_eq!(free.len(), tree.free.len(), "a node is freed once");
    for &node in &free {
        assert!(reached.insert(node), "node {node} is free or used");
        assert_eq!((tree.occupied[node], tree.parents[node]), (0, Slot::NONE), "free node {node} is empty");
        (0..FAN_OUT).for_each(|lane| check_lane_is_free(tree, node, lane));
    }
    assert_eq!(reached.len(), nodes, "no node is lost");
    assert_eq!(objects.len(), scene.len(), "objects in the tree and in the scene");
    assert!(scene.ids().all(|id| objects.contains(&id)), "all ids of the scene are in the tree");
    let layered = objects.iter().filter(|&&id| scene.object(id).unwrap().layers != u32::MAX).count();
    assert_eq!(scene.layered, layered, "objects that are not on all layers");
    (seen.free, seen.unculled) = (seen.free.max(free.len()), seen.unculled.max(tree.unculled.len()));
}

fn check_lane_is_free(tree: &Tree, node: usize, lane: usize) {
    assert_eq!(tree.bounds[node].get(lane), Aabb::EMPTY, "free lane {lane} of node {node} bounds nothing");
    assert_eq!(
        tree.ids[node][lane],
        ObjectId::PLACEHOLDER,
        "free lane {lane} of node {node} names no object"
    );
    assert_eq!(tree.layers[node][lane], u32::MAX, "free lane {lane} of node {node} is on all layers");
    assert_eq!(
        (tree.occluders[node] >> lane & 1, tree.detailed[node] >> lane & 1),
        (0, 0),
        "free lane {lane} of node {node} has no marks"
    );
}

/// Asserts that the bounds of a leaf on size and draw distance cover the object in a lane. Returns whether an
/// HLOD parent may be drawn in place of the object.
fn check_detail(scene: &Scene, leaf: usize, lane: usize, id: ObjectId) -> bool {
    let tree = scene.tree();
    let (range, parent) = (scene.draw_range(id).unwrap(), scene.hlod_parent(id).unwrap());
    if range != DrawRange::ALWAYS || parent.is_some() {
        assert_eq!(tree.detailed[leaf] >> lane & 1, 1, "{id} is marked");
    }
    if tree.is_unculled_leaf(leaf) {
        return false;
    }
    let object = scene.object(id).unwrap();
    let diagonal = |bounds: &Aabb| bounds.max.as_dvec3().distance(bounds.min.as_dvec3());
    let bounds = tree.detail_bounds[leaf];
    assert!(
        bounds.diagonal_squared.sqrt() >= diagonal(&object.bounds) * (1.0 - 1e-12),
        "{id}: the leaf's largest diagonal covers the object's"
    );
    let mut end = f64::from(range.end);
    let parent = parent.map(|parent| (parent, scene.object(parent).unwrap()));
    let parent = parent.filter(|(_, parent)| {
        let joint = parent.bounds.union(&object.bounds);
        !parent.is_unculled() && joint == parent.bounds && object.layers & !parent.layers == 0
    });
    if let Some((parent, above)) = parent {
        end = end.min(f64::from(scene.draw_range(parent).unwrap().begin) + diagonal(&above.bounds));
    }
    assert!(f64::from(bounds.end) >= end, "{id} is drawn up to {end} m, its leaf up to {} m", bounds.end);
    parent.is_some()
}

/// Returns a small random box in a cube of side `spread` metres, or, one time in eight, a degenerate one:
/// inverted, vast, flat, NaN or infinite.
fn random_bounds(rng: &mut Random, spread: f32) -> Aabb {
    let min: [f32; 3] = core::array::from_fn(|_| (rng.unit() as f32 - 0.5) * spread);
    let mut max = min.map(|x| x + rng.unit() as f32);
    match rng.below(40) {
        0 => max[rng.below(3)] = f32::NAN,
        1 => max[rng.below(3)] = f32::INFINITY,
        2 => max = min.map(|x| x - 1.0),
        3 => max = min.map(|x| x + 1e30),
        4 => max = min,
        _ => {}
    }
    Aabb::from_arrays(min, max)
}

fn random_object(rng: &mut Random, spread: f32) -> Object {
    Object {
        layers: if rng.below(8) == 0 { rng.below(1 << 20) as u32 } else { u32::MAX },
        never_cull: rng.below(30) == 0,
        occluder: rng.below(3) == 0,
        ..Object::new(random_bounds(rng, spread))
    }
}

/// Applies one random change to the scene and to `ids`, the list of its objects. The greater `grow` is, the
/// more of the changes are insertions.
fn step(rng: &mut Random, scene: &mut Scene, ids: &mut Vec<ObjectId>, grow: usize) {
    let spread = [10.0, 1000.0, 1e6][rng.below(3)];
    let some = |rng: &mut Random| rng.below(ids.len().max(1));
    match rng.below(20 + grow) {
        0..4 if !ids.is_empty() => scene.remove(ids.swap_remove(some(rng))).unwrap(),
        4..9 if !ids.is_empty() => {
            let id = ids[some(rng)];
            let bounds = scene.bounds(id).unwrap();
            let step = (rng.unit() as f32 - 0.5) * [0.1, 3.0, 100.0][rng.below(3)];
            scene.set_bounds(id, Aabb::new(bounds.min + step, bounds.max + step)).unwrap();
        }
        9..12 if !ids.is_empty() => {
            let (id, bounds) = (ids[some(rng)], random_bounds(rng, spread));
            scene.set_bounds(id, bounds).unwrap();
        }
        12 if !ids.is_empty() => {
            let (id, value) = (ids[some(rng)], rng.below(4) == 0);
            scene.set_never_cull(id, value).unwrap();
        }
        13 if !ids.is_empty() => scene.set_layers(ids[some(rng)], rng.below(3) as u32).unwrap(),
        14 if !ids.is_empty() => scene.set_occluder(ids[some(rng)], rng.below(2) == 0).unwrap(),
        15 => {
            scene.maintain(rng.below(20));
        }
        17 if !ids.is_empty() => {
            let (begin, margin) = (rng.pick(&[0.0, 1.0, 20.0]), rng.pick(&[0.0, 3.0]));
            let end = if rng.below(50) == 0 { f32::INFINITY } else { rng.pick(&[begin, 30.0, 1e6]) };
            scene.set_draw_range(ids[some(rng)], DrawRange { begin, end, margin }).unwrap();
        }
        18 if !ids.is_empty() => {
            // Parents are few and large, so that they contain other objects and have many children.
            let (id, parent) = (ids[some(rng)], ids[rng.below(ids.len().min(20))]);
            if rng.below(4) == 0 {
                let half = glam::Vec3::splat([5.0, 500.0, 1e6][rng.below(3)]);
                scene.set_bounds(parent, Aabb::new(-half, half)).unwrap();
            }
            let _cycle = scene.set_hlod_parent(id, (rng.below(4) > 0).then_some(parent));
        }
        16 if rng.below(100) == 0 => scene.rebuild(),
        _ => {
            ids.push(scene.insert(random_object(rng, spread)));
            limit(rng, scene, &ids[ids.len() - 1..]);
        }
    }
}

/// Gives each object a draw range that ends at 5 m, for one object in fifty at 1,000 km. A leaf has a finite
/// bound on the draw distance only if the draw ranges of all its objects end.
fn limit(rng: &mut Random, scene: &mut Scene, ids: &[ObjectId]) {
    for &id in ids {
        let end = if rng.below(50) == 0 { 1e6 } else { 5.0 };
        scene.set_draw_range(id, DrawRange { end, ..DrawRange::ALWAYS }).unwrap();
    }
}

#[test]
fn the_tree_stays_consistent_from_empty_to_three_levels_and_back() {
    let mut rng = Random(1);
    let (mut scene, mut seen) = (Scene::new(), Seen::default());
    let mut ids = Vec::new();
    check(&scene, &mut seen);
    while ids.len() < 6000 {
        for _ in 0..250 {
            step(&mut rng, &mut scene, &mut ids, 10);
        }
        check(&scene, &mut seen);
    }
    assert!(seen.height >= 2 && seen.unculled >= 4, "{} {}", seen.height, seen.unculled);
    assert!(seen.substituted > 100, "{}", seen.substituted);
    while !ids.is_empty() {
        for _ in 0..400.min(ids.len()) {
            scene.remove(ids.swap_remove(rng.below(ids.len()))).unwrap();
            if rng.below(10) == 0 {
                scene.maintain(4);
            }
        }
        check(&scene, &mut seen);
    }
    assert!(seen.free > 100 && scene.tree().root == NONE, "{}", seen.free);
}

#[test]
fn the_tree_stays_consistent_under_batches_and_churn() {
    for seed in 0..6 {
        let mut rng = Random(seed);
        let (mut scene, mut seen) = (Scene::new(), Seen::default());
        let count = [0, 1, 64, 65, 4097, 8000][seed as usize];
        let mut ids =
            scene.insert_batch((0..count).map(|_| random_object(&mut rng, 300.0)).collect::<Vec<_>>());
        limit(&mut rng, &mut scene, &ids);
        check(&scene, &mut seen);
        for round in 0..12 {
            for _ in 0..150 {
                step(&mut rng, &mut scene, &mut ids, 0);
            }
            check(&scene, &mut seen);
            // Batches of a few objects, which may move parents before or after their children, and batches of
            // most objects at once.
            let moved: Vec<_> = (0..rng.pick(&[5, 1000]).min(ids.len()))
                .map(|_| (ids[rng.below(ids.len())], random_bounds(&mut rng, 300.0)))
                .collect();
            scene.set_bounds_batch(&moved).unwrap();
            check(&scene, &mut seen);
            let added = [0, 3, 200, 9000][if round == 5 { 3 } else { rng.below(3) }];
            ids.extend(
                scene.insert_batch((0..added).map(|_| random_object(&mut rng, 300.0)).collect::<Vec<_>>()),
            );
            let new = &ids[ids.len() - added..];
            limit(&mut rng, &mut scene, new);
            check(&scene, &mut seen);
            let from = rng.below(ids.len() + 1);
            let gone = ids.split_off(ids.len() - (ids.len() - from).min([5, 500, 5000][rng.below(3)]));
            scene.remove_batch(&gone).unwrap();
            check(&scene, &mut seen);
            scene.maintain(usize::MAX);
            check(&scene, &mut seen);
        }
        assert!(
            seen.height >= 2,
            "seed {seed}: the tree had {} levels above its leaves; 2 are wanted",
            seen.height
        );
    }
}

/// Tests that splitting nodes terminates for thousands of identical boxes, which no axis separates.
#[test]
fn the_tree_stays_consistent_with_all_objects_in_one_place() {
    let (mut scene, mut seen) = (Scene::new(), Seen::default());
    let point = Aabb::from_arrays([1.0; 3], [1.0; 3]);
    let ids: Vec<ObjectId> = (0..5000).map(|_| scene.insert(point)).collect();
    check(&scene, &mut seen);
    let moved: Vec<_> = ids.iter().map(|&id| (id, Aabb::from_arrays([2.0; 3], [2.0; 3]))).collect();
    scene.set_bounds_batch(&moved).unwrap();
    check(&scene, &mut seen);
    scene.maintain(usize::MAX);
    check(&scene, &mut seen);
    scene.rebuild();
    check(&scene, &mut seen);
    let huge = Aabb::from_arrays([-f32::MAX; 3], [f32::MAX; 3]);
    for &id in &ids[..700] {
        scene.set_bounds(id, huge).unwrap();
    }
    check(&scene, &mut seen);
    scene.maintain(usize::MAX);
    check(&scene, &mut seen);
}

/// Tests that a change of any object's slot changes the layout. A node that is freed and reused under the
/// same number holds other objects, so masks made before must become invalid even if the moved object has its
/// old slot again.
#[test]
fn a_change_of_any_slot_is_a_change_of_layout() {
    let at = |x: f32| Aabb::from_arrays([x, 0.0, 0.0], [x + 0.5, 1.0, 1.0]);
    for kept in 0..FAN_OUT {
        // Two full blocks far from each other; all objects but one are removed from the second.
        let mut scene = Scene::new();
        let ids = scene.insert_batch((0..128).map(|i| at(if i < 64 { i as f32 } else { 1000.0 + i as f32 })));
        for &id in &ids[64..] {
            if scene.tree().slots[id.index()].lane() != kept {
                scene.remove(id).unwrap();
            }
        }
        let before = (scene.layout(), scene.tree().slots.clone());
        scene.maintain(8);
        assert!(
            scene.layout() != before.0 || scene.tree().slots == before.1,
            "slots changed and the layout did not, with lane {kept} kept"
        );
    }
}

/// Tests for random changes that the layout stamp differs whenever an object's slot does.
#[test]
fn whoever_moves_an_object_changes_the_layout() {
    let mut rng = Random(5);
    let mut scene = Scene::new();
    let mut ids = scene.insert_batch((0..600).map(|_| random_object(&mut rng, 100.0)).collect::<Vec<_>>());
    for _ in 0..20_000 {
        let before = (scene.layout(), scene.tree().slots.clone());
        step(&mut rng, &mut scene, &mut ids, 0);
        assert!(
            scene.layout() != before.0 || scene.tree().slots == before.1,
            "an object has moved to another slot, and the layout is the same"
        );
        if ids.len() > 700 {
            scene.remove_batch(&ids.split_off(500)).unwrap();
        }
    }
}
