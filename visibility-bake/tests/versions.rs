//! A set is used only for the level from which it was baked, and results of earlier versions of the bake are
//! refused.

use std::sync::Arc;
use visibility_bake::{
    AssembleError, BakeCache, BakedSet, BakedSetError, SandwichBaker, SandwichSettings, Shard, TiledScene,
    assemble, level_version,
};
use visibility_core::bake::Bake;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::pvs::{PvsCuller, Viewcell, Viewcells};
use visibility_core::scene::Triangle;
use visibility_core::{Aabb, Accuracy, Culler, Object, Pose, Scene, View, VisibleSet};
use visibility_testing::{NOT_ALWAYS_DRAWN, mend_header};

/// Returns a corner of a wall at x = 5 m that is 20 m wide and high.
fn wall(y: f32, z: f32) -> Vec3 {
    Vec3::new(5.0, y, z)
}

fn rectangle([a, b]: [f32; 2], [c, d]: [f32; 2]) -> [Triangle; 2] {
    [[wall(a, c), wall(b, c), wall(b, d)], [wall(a, c), wall(b, d), wall(a, d)]]
}

/// Makes a wall, and a box behind its middle.
fn level() -> (Scene, Viewcells) {
    let mut scene = Scene::new();
    let bounds = [Aabb::new(wall(-10.0, -10.0), wall(10.0, 10.0)), Aabb::from_arrays([9.0; 3], [9.5; 3])];
    let ids = scene.insert_batch(bounds.map(|bounds| Object { occluder: true, ..Object::new(bounds) }));
    scene.set_triangles(ids[0], rectangle([-10.0, 10.0], [-10.0, 10.0])).unwrap();
    scene.set_triangles(ids[1], [[Vec3::splat(9.0), Vec3::splat(9.25), Vec3::new(9.5, 9.0, 9.5)]]).unwrap();
    scene.prepare_occluders(&Default::default());
    let cells = Viewcells::new([Viewcell::from_box(DVec3::ZERO, DVec3::ONE)]);
    (scene, cells)
}

fn baked(scene: &Scene, cells: &Viewcells) -> BakedSet {
    let outcome = Bake::new(SandwichBaker::new(scene, cells, SandwichSettings::default())).run();
    BakedSet::new(scene, cells.clone(), outcome.source, &outcome.cells).unwrap()
}

type Edit = (&'static str, fn(&mut Scene));

/// Returns edits that do not change any object's box.
fn edits() -> [Edit; 6] {
    [
        ("a door", |scene| {
            let id = scene.id_at(0).unwrap();
            let parts = [rectangle([-10.0, -1.0], [-10.0, 10.0]), rectangle([1.0, 10.0], [-10.0, 10.0])];
            scene.set_triangles(id, parts.concat()).unwrap();
        }),
        ("glass", |scene| scene.set_occluder(scene.id_at(0).unwrap(), false).unwrap()),
        ("a mover", |scene| scene.set_never_cull(scene.id_at(0).unwrap(), true).unwrap()),
        ("another mesh", |scene| {
            let id = scene.id_at(0).unwrap();
            let mesh = visibility_core::OccluderMesh::from_indexed(
                &[wall(-10.0, -10.0), wall(-1.0, -10.0), wall(-1.0, 10.0)],
                &[[0, 1, 2]],
            );
            let mesh = scene.add_mesh(mesh.unwrap());
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        }),
        ("another layer", |scene| scene.set_layers(scene.id_at(0).unwrap(), 2).unwrap()),
        ("another cost", |scene| scene.set_cost(scene.id_at(1).unwrap(), 99).unwrap()),
    ]
}

#[test]
fn a_set_is_refused_after_an_edit_that_leaves_all_boxes() {
    let (scene, cells) = level();
    let set = baked(&scene, &cells);
    assert!(set.row(visibility_core::pvs::ViewcellId(0)).len() == 1, "the wall hides the box");
    let set = BakedSet::from_bytes(&set.to_bytes()).unwrap();
    let version = set.version();
    assert_eq!(
        (level_version(&scene), TiledScene::new(&scene).version()),
        (version, version),
        "versions of the scene, of the level and of the set"
    );
    let sets = set.clone().for_scene(&scene).unwrap();
    assert!(
        sets.is_checked() && PvsCuller::new(&sets).accuracy() == Accuracy::Conservative,
        "a set that was compared keeps its promise"
    );
    for (name, edit) in edits() {
        let mut edited = scene.clone();
        edit(&mut edited);
        let level = level_version(&edited);
        assert!(matches!(set.clone().for_scene(&edited), Err(BakedSetError::OtherScene)), "{name}");
        let refused = set.clone().for_level(&edited, Some(level));
        assert_eq!(refused.err(), Some(BakedSetError::OtherVersion { baked: version, level }), "{name}");
        let baker = |scene| SandwichBaker::new(scene, &cells, SandwichSettings::default());
        let whole = |scene| baker(scene).whole_fingerprint();
        assert_ne!(whole(&edited), whole(&scene), "{name}: shards are of another bake");
        // The state belongs to a bake of the scene before the edit, so it is refused.
        assert!(Bake::resume(baker(&edited), &Bake::new(baker(&scene)).save()).is_err(), "{name}");
    }
}

/// With a cache of the level before an edit, the result equals that of a bake without a cache.
#[test]
fn a_cache_gives_nothing_that_an_edit_has_changed() {
    let (scene, cells) = level();
    let cache =
        Arc::new(Bake::new(SandwichBaker::new(&scene, &cells, SandwichSettings::default())).run().cache);
    for (name, edit) in edits() {
        let mut edited = scene.clone();
        edit(&mut edited);
        let baker = || SandwichBaker::new(&edited, &cells, SandwichSettings::default());
        let cached = Bake::new(baker().with_cache(cache.clone())).run();
        assert_eq!(cached.cells, Bake::new(baker()).run().cells, "{name}");
    }
}

/// A wall that occluded in the bake no longer hides the box behind it once it is removed or not drawn,
/// however the set was assigned to the scene.
#[test]
fn a_wall_that_is_not_drawn_hides_nothing() {
    let (scene, cells) = level();
    let set = BakedSet::from_bytes(&baked(&scene, &cells).to_bytes()).unwrap();
    let pose = Pose::look_at(DVec3::splat(0.5), DVec3::splat(9.25), DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.01, 100.0).unwrap();
    for by_index in [false, true] {
        // A scene of boxes only, without the flags of the bake. The wall is on a layer of its own.
        let mut boxes = Scene::new();
        boxes.insert_batch(scene.ids().map(|id| scene.bounds(id).unwrap()).collect::<Vec<_>>());
        let [wall, behind] = [0, 1].map(|index| boxes.id_at(index).unwrap());
        boxes.set_layers(wall, 1).unwrap();
        let sets = match by_index {
            true => set.clone().for_level(&boxes, Some(set.version())).unwrap(),
            false => set.for_objects(&boxes, [(behind, 1), (wall, 0)]),
        };
        let (mut culler, mut visible) = (PvsCuller::new(&sets), VisibleSet::new());
        let mut sees = |scene: &Scene, layers: u32| {
            let view = view.with_layers(layers);
            visible.fill(scene, &view);
            culler.cull(scene, &view, &mut visible);
            visible.contains(scene, behind)
        };
        assert!(!sees(&boxes, u32::MAX), "by index {by_index}: the wall hides the box");
        assert!(sees(&boxes, 2), "by index {by_index}: the wall is on no layer of the view");
        assert!(!sees(&boxes, 3), "by index {by_index}: the wall is on a layer of the view");
        boxes.remove(wall).unwrap();
        assert!(sees(&boxes, u32::MAX), "by index {by_index}: the wall is gone");
    }
    // The wall may be absent or elsewhere already when the set is assigned.
    for (way, edit) in NOT_ALWAYS_DRAWN.into_iter().enumerate() {
        let mut boxes = Scene::new();
        boxes.insert_batch(scene.ids().map(|id| scene.bounds(id).unwrap()).collect::<Vec<_>>());
        let [wall, behind] = [0, 1].map(|index| boxes.id_at(index).unwrap());
        edit(&mut boxes, wall);
        let sets = set.for_objects(&boxes, [(behind, 1), (wall, 0)]);
        let (mut culler, mut visible) = (PvsCuller::new(&sets), VisibleSet::new());
        visible.fill(&boxes, &view);
        culler.cull(&boxes, &view, &mut visible);
        assert!(visible.contains(&boxes, behind), "way {way}: the wall may be absent");
        let mut lacks = Vec::new();
        culler.for_each_lack(&boxes, &mut |lack| lacks.push(lack.what));
        assert!(lacks[0].ends_with("or not always drawn"), "way {way}: {lacks:?}");
    }
}

/// The level editor has removed its last object, whose index no game knows of.
#[test]
fn a_set_is_for_every_scene_of_its_version() {
    let (mut scene, cells) = level();
    let game = scene.clone();
    let removed = scene.insert(Aabb::from_arrays([20.0; 3], [21.0; 3]));
    scene.remove(removed).unwrap();
    let set = baked(&scene, &cells);
    assert!(set.index_limit() > game.index_limit(), "the removed object leaves an index");
    let version = Some(level_version(&game));
    assert!(set.clone().for_level(&game, version).is_ok(), "the objects and the version of the level");
    assert!(set.for_scene(&game).is_ok(), "the objects of the scene");
}

#[test]
fn what_was_not_compared_is_not_promised() {
    let (scene, cells) = level();
    let set = baked(&scene, &cells);
    let view = View::perspective(
        Pose::look_at(DVec3::splat(0.5), DVec3::splat(9.25), DVec3::Z),
        1.0,
        1.0,
        0.01,
        100.0,
    )
    .unwrap();
    // A scene of boxes only, with the version that the level stores or without a version.
    let mut boxes = Scene::new();
    let ids = boxes.insert_batch(scene.ids().map(|id| scene.bounds(id).unwrap()).collect::<Vec<_>>());
    assert!(
        matches!(set.clone().for_scene(&boxes), Err(BakedSetError::OtherScene)),
        "a scene without the triangles"
    );
    let bounds = || (0..).zip(scene.ids().map(|id| scene.bounds(id).unwrap()).collect::<Vec<_>>());
    let pairs = || ids.iter().map(|&id| (id, id.index() as u32));
    let compared = |version| set.clone().compared(version, DVec3::ZERO, bounds()).unwrap();
    let version = Some(set.version());
    for (sets, is_checked) in [
        (set.clone().for_level(&boxes, version).unwrap(), true),
        (set.clone().for_level(&boxes, None).unwrap(), false),
        (set.for_objects(&boxes, pairs()), false),
        (compared(version).for_objects(&boxes, pairs()), true),
        (compared(None).for_objects(&boxes, pairs()), false),
    ] {
        let mut culler = PvsCuller::new(&sets);
        let mut visible = VisibleSet::new();
        visible.fill(&boxes, &view);
        culler.cull(&boxes, &view, &mut visible);
        assert!(
            visible.contains(&boxes, ids[0]) && !visible.contains(&boxes, ids[1]),
            "the wall is seen, and hides the box"
        );
        assert_eq!(culler.accuracy().never_hides(), is_checked, "checked: {is_checked}");
        let mut lacks = Vec::new();
        culler.for_each_lack(&boxes, &mut |lack| lacks.push(lack.to_string()));
        let expected: &[&str] =
            if is_checked { &[] } else { &["objects hidden by a PVS that may be of another level: 2"] };
        assert_eq!(lacks, expected, "checked: {is_checked}: what the set lacks");
    }
    let level = set.version() ^ 1;
    let wrong = BakedSetError::OtherVersion { baked: set.version(), level };
    assert!(wrong.to_string().ends_with("bake again"), "the error says what to do");
    let wrong = Some(wrong);
    assert_eq!(set.clone().for_level(&boxes, Some(level)).err(), wrong, "a level of another version");
    assert_eq!(
        set.clone().compared(Some(level), DVec3::ZERO, bounds()).err(),
        wrong,
        "boxes with another version"
    );
    boxes.set_bounds(ids[0], Aabb::from_arrays([1.0; 3], [2.0; 3])).unwrap();
    assert_eq!(
        set.for_level(&boxes, version).err(),
        Some(BakedSetError::OtherScene),
        "the version is right, but a box is another"
    );
}

/// If a wall of the bake is no object of the scene, it is unknown whether it is drawn, so cullers are
/// approximate.
#[test]
fn a_set_without_a_wall_of_the_bake_is_not_promised() {
    let (mut scene, cells) = level();
    let [wall, behind] = [0, 1].map(|index| scene.id_at(index).unwrap());
    scene.set_occluder(behind, false).unwrap();
    let set = baked(&scene, &cells);
    let are_occluders = [0, 1, 2, u32::MAX].map(|index| set.is_occluder(index));
    assert_eq!(are_occluders, [true, false, false, false], "the wall alone hid others in the bake");
    let bounds = [wall, behind].map(|id| (id.index() as u32, scene.bounds(id).unwrap()));
    let set = set.clone().compared(Some(set.version()), DVec3::ZERO, bounds).unwrap();
    let is_promised = |scene: &Scene, pairs: &[(_, u32)]| set.for_objects(scene, pairs.to_vec()).is_checked();
    assert!(is_promised(&scene, &[(wall, 0), (behind, 1)]), "all objects of the bake");
    assert!(is_promised(&scene, &[(wall, 0)]), "without the box behind, which hid nothing");
    assert!(!is_promised(&scene, &[(behind, 1)]), "without the wall");
    scene.remove(wall).unwrap();
    assert!(!is_promised(&scene, &[(wall, 0), (behind, 1)]), "with the id of a wall that is gone");
}

/// The sweep of earlier versions of the formats could hide visible objects.
#[test]
fn results_of_earlier_versions_are_refused_with_a_word() {
    let (scene, cells) = level();
    let baker = || SandwichBaker::new(&scene, &cells, SandwichSettings::default());
    let mut bake = Bake::new(baker());
    bake.advance();
    let state = bake.save();
    let cache = bake.run().cache.to_bytes();
    let (set, shard) = (baked(&scene, &cells).to_bytes(), Shard::bake(baker()).to_bytes());
    let text = |error: Option<&dyn std::fmt::Display>| error.expect("it is refused").to_string();
    let read = |file: &[u8], name: &str| match name {
        "set" => text(BakedSet::from_bytes(file).err().as_ref().map(|e| e as _)),
        "shard" => text(Shard::from_bytes(file).err().as_ref().map(|e| e as _)),
        "state" => text(Bake::resume(baker(), file).err().as_ref().map(|e| e as _)),
        _ => text(BakeCache::from_bytes(file).err().as_ref().map(|e| e as _)),
    };
    for (name, file, last) in [("set", set, 4), ("shard", shard, 2), ("state", state, 3), ("cache", cache, 2)]
    {
        for version in 0..=last {
            let mut earlier = file.clone();
            earlier[8] = version;
            mend_header(&mut earlier, 0);
            let said = read(&earlier, name);
            assert!(
                said.starts_with(&format!("version {version} of")) && said.ends_with("bake again"),
                "{said}"
            );
        }
    }
}

/// Results of a bake are of the level that was baked, not of the level at hand.
#[test]
fn results_of_another_level_make_no_set() {
    let (mut scene, cells) = level();
    fn baker<'a>(scene: &'a Scene, cells: &'a Viewcells) -> SandwichBaker<'a> {
        SandwichBaker::new(scene, cells, SandwichSettings::default())
    }
    let found = Bake::new(baker(&scene, &cells)).run();
    let shard = Shard::from_bytes(&Shard::bake(baker(&scene, &cells)).to_bytes()).unwrap();
    assert_eq!(*found.cells[0].reported(), [0], "the wall hides the box");
    let of = |scene: &Scene, cells: &Viewcells| {
        BakedSet::new(scene, cells.clone(), found.source, &found.cells).map(|set| set.version())
    };
    assert_eq!(of(&scene, &cells), Ok(level_version(&scene)), "the level that was baked");
    assert_eq!(
        assemble(&baker(&scene, &cells), [shard.clone()]).as_ref(),
        Ok(&found.cells),
        "shards of the level"
    );
    let others = Viewcells::new([Viewcell::from_box(DVec3::ZERO, DVec3::splat(1.5))]);
    assert_eq!(of(&scene, &others), Err(BakedSetError::OtherViewcells), "other viewcells");
    let divided = |max: f64, misplacement: f64| {
        Viewcells::of_divided_box(cells.cells().to_vec(), DVec3::ZERO, DVec3::splat(max), misplacement)
    };
    for (max, misplacement) in [(1.0, 0.0), (2.0, 0.0), (1.0, 0.25)] {
        let of_divided = Bake::new(baker(&scene, &divided(max, misplacement))).run().source;
        let made = |cells: Viewcells| BakedSet::new(&scene, cells, of_divided, &found.cells).is_ok();
        assert!(made(divided(max, misplacement)), "of a box up to {max}, misplaced by {misplacement}");
        assert!(!made(cells.clone()), "the same viewcells, of no box");
        assert!(!made(divided(3.0, misplacement)) && !made(divided(max, 0.5)), "of another box");
    }
    for (name, edit) in edits() {
        let mut edited = scene.clone();
        edit(&mut edited);
        assert_eq!(
            of(&edited, &cells),
            Err(BakedSetError::OtherScene),
            "{name}: results of the level before"
        );
        let shards = assemble(&baker(&edited, &cells), [shard.clone()]);
        assert_eq!(shards, Err(AssembleError::OtherBake(0)), "{name}: a shard of the level before");
    }
    scene.remove(scene.id_at(0).unwrap()).unwrap();
    assert_eq!(of(&scene, &cells), Err(BakedSetError::OtherScene), "without the wall");
    assert_eq!(
        assemble(&baker(&scene, &cells), [shard]),
        Err(AssembleError::OtherBake(0)),
        "without the wall"
    );
}
