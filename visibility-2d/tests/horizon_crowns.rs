//! Tests of crowns: they hide what is behind the given number of crowns, and lower, and nothing else.

use visibility_2d::horizon::{HorizonCuller, HorizonOccluders, UpAxis};
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, Accuracy, Culler, ObjectId, Pose, Scene, View, VisibleSet};

/// Makes a row of trees along x, a hut behind them and a tower behind that.
fn scene(trees: usize) -> (Scene, Vec<ObjectId>, [ObjectId; 2]) {
    let mut scene = Scene::new();
    let tree = |i: usize| {
        let x = 10.0 + 8.0 * i as f32;
        Aabb::from_arrays([x, -3.0, 0.0], [x + 6.0, 3.0, 9.0])
    };
    let trees: Vec<_> = (0..trees).map(|i| scene.insert(tree(i))).collect();
    let hut = scene.insert(Aabb::from_arrays([150.0, -1.0, 0.0], [152.0, 1.0, 3.0]));
    let tower = scene.insert(Aabb::from_arrays([160.0, -1.0, 0.0], [162.0, 1.0, 150.0]));
    (scene, trees, [hut, tower])
}

fn visible(scene: &Scene, culler: &mut HorizonCuller, ids: [ObjectId; 2]) -> [bool; 2] {
    let eye = DVec3::Z * 1.7;
    let view = View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 1.5, 1.5, 0.1, 1e4).unwrap();
    let mut visible = VisibleSet::new();
    visible.fill(scene, &view);
    culler.cull(scene, &view, &mut visible);
    ids.map(|id| visible.contains(scene, id))
}

#[test]
fn a_hut_behind_enough_trees_is_hidden_and_a_tower_is_not() {
    for count in 1..8 {
        let (scene, trees, ids) = scene(count);
        for crossings in [0, 1, 2, 3, 5, 7, 255] {
            let occluders = HorizonOccluders::new(&scene, UpAxis::Z);
            let mut culler = HorizonCuller::new(occluders.into()).with_crowns(trees.clone(), crossings);
            assert_eq!(culler.accuracy(), Accuracy::Approximate, "crowns are approximate");
            let is_hidden = count >= usize::from(crossings.max(1));
            assert_eq!(visible(&scene, &mut culler, ids), [!is_hidden, true], "{crossings} of {count} trees");
            // A second, equal frame: nothing of the first frame remains.
            assert_eq!(
                visible(&scene, &mut culler, ids),
                [!is_hidden, true],
                "{crossings} of {count} trees, in a second frame"
            );
        }
    }
}

#[test]
fn without_crowns_trees_hide_nothing() {
    let (scene, _, ids) = scene(7);
    let occluders = HorizonOccluders::new(&scene, UpAxis::Z);
    let mut culler = HorizonCuller::new(occluders.into());
    assert_eq!(visible(&scene, &mut culler, ids), [true, true], "hut and tower without crowns");
    // Ids of another scene's objects are ignored.
    let foreign = scene.clone().ids().collect::<Vec<_>>();
    let mut other = Scene::new();
    let foreign_ids: Vec<_> =
        foreign.iter().map(|_| other.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]))).collect();
    let mut culler = culler.with_crowns(foreign_ids, 1);
    assert_eq!(visible(&scene, &mut culler, ids), [true, true], "hut and tower with crowns of another scene");
}
