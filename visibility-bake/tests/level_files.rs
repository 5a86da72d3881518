//! Levels in files: the results have the same bytes as from a scene in memory, for any limit of memory, on
//! threads and in shards. Damage, and too low a limit, are errors that say what is wrong and where.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use visibility_bake::{
    BakeCache, BakedSet, CellSandwich, Grid, LevelError, SandwichBaker, SandwichOutcome, SandwichSettings,
    Shard, TiledScene, assemble,
};
use visibility_core::bake::Bake;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::occlusion::{OccluderMesh, Preparation};
use visibility_core::pvs::Viewcells;
use visibility_core::{Aabb, Object, Scene};
use visibility_testing::Random;

const MIB: u64 = 1 << 20;

/// Makes a town of blocks of houses that is too heavy to be swept as a whole, with viewcells along a street.
fn town() -> (Scene, Viewcells) {
    let mut random = Random(19);
    let mut scene = Scene::new();
    scene.set_origin(DVec3::new(1000.0, -500.0, 20.0)).unwrap();
    let mut number = |low: f64, high: f64| (low + (high - low) * random.unit()) as f32;
    let mut ids = Vec::new();
    for at in 0..130 * 130 {
        let (x, y) = ((at / 130) as f32 * 10.0 - 640.0, (at % 130) as f32 * 10.0 - 650.0);
        let high = if at % 400 == 7 { 40.0 } else { number(6.0, 9.0) };
        let bounds = Aabb::from_arrays([x, y, 0.0], [x + number(6.0, 9.9), y + number(6.0, 9.9), high]);
        let id = scene.insert(Object { occluder: at % 50 > 0, cost: 12, ..Object::new(bounds) });
        let corners = bounds.corners();
        scene.set_triangles(id, OccluderMesh::CUBOID.map(|t| t.map(|i| corners[i as usize]))).unwrap();
        ids.push(id);
    }
    scene.prepare_occluders(&Preparation::default().with_two_sided(true));
    // Some objects have meshes with other mesh coordinates. One object is never culled.
    for &id in ids.iter().skip(3).step_by(40) {
        let bounds = scene.bounds(id).unwrap();
        let mesh = OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [1.0; 3])).unwrap();
        let mesh = scene.add_mesh(mesh);
        let turn = Affine3A::from_scale(bounds.half_extent());
        scene.set_mesh(id, mesh, Affine3A::from_translation(bounds.min) * turn).unwrap();
    }
    scene.set_never_cull(ids[5], true).unwrap();
    let corner = scene.origin() + DVec3::new(-0.5, -40.0, 1.0);
    let grid = Grid::new(corner, DVec3::new(0.4, 8.0, 1.0)).unwrap();
    (scene, Viewcells::new(grid.over(corner, corner + DVec3::new(0.4, 160.0, 1.0)).unwrap()))
}

/// Returns the same town with a few viewcells, which are in one group.
fn town_from_one_place() -> (Scene, Viewcells) {
    let (scene, cells) = town();
    (scene, Viewcells::new(cells.cells()[8..10].iter().cloned()))
}

fn path(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("visibility-level-{}-{name}", std::process::id()))
}

fn in_file(scene: &Scene, name: &str, memory: u64) -> Result<TiledScene<'static>, LevelError> {
    let mut writer = TiledScene::writer(path(name), scene.origin())?;
    for id in scene.ids() {
        let triangles = scene.triangles(id).unwrap();
        writer.push(&scene.object(id).unwrap(), triangles, scene.occluder(id))?;
    }
    writer.finish(memory, 0)
}

fn settings() -> SandwichSettings {
    SandwichSettings::default().with_gap(1.0).with_rays(4)
}

fn bytes(outcome: &SandwichOutcome) -> Vec<u8> {
    Shard::new(0, outcome.clone()).to_bytes()
}

#[test]
fn bytes_are_the_same_for_any_limit_threads_and_shards() {
    let (scene, cells) = town();
    let whole = Bake::new(SandwichBaker::new(&scene, &cells, settings())).run();
    assert!(
        whole.complete && whole.cells.iter().all(|cell| cell.swept > 16_000),
        "the bake is complete, and hides most objects"
    );
    let set = BakedSet::new(&scene, cells.clone(), whole.source, &whole.cells).unwrap();
    for (number, memory) in [400 * MIB, 4096 * MIB].into_iter().enumerate() {
        let level = Arc::new(in_file(&scene, &format!("same{number}"), memory).unwrap());
        let baker = || SandwichBaker::of_level(level.clone(), &cells, settings());
        assert_eq!(
            baker().whole_fingerprint(),
            SandwichBaker::new(&scene, &cells, settings()).whole_fingerprint(),
            "{memory} bytes: the fingerprint of the level in a file and in memory"
        );
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let found = pool.install(|| Bake::new(baker()).run());
            assert_eq!(found.error, None, "{memory} bytes, {threads} threads");
            assert!(bytes(&found) == bytes(&whole), "{memory} bytes, {threads} threads");
            assert!(found.cache == whole.cache, "{memory} bytes, {threads} threads: the cache");
        }
        let shards = [7..99, 0..7].map(|range| Shard::bake(baker().with_range(range)));
        assert_eq!(
            assemble(&baker(), shards).unwrap(),
            whole.cells,
            "{memory} bytes: rows put together from two shards"
        );
        let of_level = BakedSet::of_level(&level, cells.clone(), whole.source, &whole.cells).unwrap();
        assert!(of_level == set, "{memory} bytes: the set");
        // With the results of the bake in memory as cache, no viewcell needs work.
        let again = Bake::new(baker().with_cache(whole.cache.clone())).run();
        assert!(
            again.reused == cells.cells().len() && bytes(&again) == bytes(&whole),
            "{memory} bytes: {} reused",
            again.reused
        );
    }
}

#[test]
fn a_limit_that_is_too_low_is_an_error_that_tells_one_that_will_do() {
    let (scene, cells) = town_from_one_place();
    let Err(LevelError::Memory { limit, needed }) = in_file(&scene, "few", MIB) else { panic!("enough") };
    assert!(limit == MIB && needed > MIB, "the limit {limit} is too low, {needed} are needed");
    // The limit of memory suffices for the properties of the objects only.
    let mut memory = needed;
    let mut tries = 0;
    loop {
        let level = in_file(&scene, "few", memory).unwrap();
        let outcome = Bake::new(SandwichBaker::of_level(level.into(), &cells, settings())).run();
        let Some(error) = outcome.error else {
            assert!(outcome.complete && tries > 0, "after {tries} tries the bake is complete");
            break;
        };
        let LevelError::Memory { limit, needed } = error else { panic!("{error}") };
        assert!(!outcome.complete && limit == memory && needed > memory, "{error}");
        let seen_from = |cell: &CellSandwich| cell.open.len() == scene.len();
        assert!(outcome.cells.iter().any(seen_from), "what was not worked on counts as visible");
        (memory, tries) = (needed, tries + 1);
        assert!(tries < 40, "{tries} tries at up to {memory} bytes");
    }
}

#[test]
fn what_one_thread_can_do_with_the_memory_many_threads_can_do() {
    // Each viewcell is in a group of its own, so that threads hold memory of different groups.
    let (scene, cells) = town();
    let cells = Viewcells::new(cells.cells().iter().step_by(5).cloned());
    let baked = |memory: u64, threads: usize| {
        let level = Arc::new(in_file(&scene, "threads", memory).unwrap());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Bake::new(SandwichBaker::of_level(level, &cells, settings())).run())
    };
    let (mut memory, mut alone) = (4 * MIB, None);
    while alone.is_none() {
        let outcome = baked(memory, 1);
        match &outcome.error {
            Some(LevelError::Memory { needed, .. }) => memory = *needed,
            Some(error) => panic!("{error}"),
            None => alone = Some(bytes(&outcome)),
        }
    }
    for threads in [2, 4] {
        let outcome = baked(memory, threads);
        assert_eq!(outcome.error, None, "{memory} bytes, {threads} threads");
        assert!(Some(bytes(&outcome)) == alone, "{threads} threads");
    }
}

#[test]
fn damage_is_an_error_with_what_and_where() {
    let (scene, cells) = town_from_one_place();
    let mut found = 0;
    for damage in 0..6 {
        let name = format!("damage{damage}");
        let level = in_file(&scene, &name, 4096 * MIB).unwrap();
        let mut content = fs::read(path(&name)).unwrap();
        let length = content.len();
        match damage {
            0 => content.truncate(length / 2),
            1 => content.clear(),
            // Flips the last bit of every coordinate beyond 1 m, but not of counts.
            2 => content.chunks_exact_mut(4).for_each(|word| {
                let is_coordinate = f32::from_le_bytes([word[0], word[1], word[2], word[3]]).abs() > 1.0;
                word[0] ^= u8::from(is_coordinate);
            }),
            // Flips a few bits.
            3 => content.iter_mut().step_by(length / 3 - 1).for_each(|byte| *byte ^= 128),
            4 => content.fill(0xff),
            _ => content.fill(0),
        }
        fs::write(path(&name), &content).unwrap();
        let outcome = Bake::new(SandwichBaker::of_level(level.into(), &cells, settings())).run();
        match outcome.error {
            Some(LevelError::Content { path: named, object, offset }) => {
                assert!(
                    named == path(&name) && (object as usize) < scene.len() && offset < length as u64,
                    "damage {damage}: object {object} at byte {offset} of {named:?}"
                );
                assert!(!outcome.complete, "damage {damage}: the bake is not complete");
                found += 1;
            }
            // The damage may be in content that was never read.
            None => assert!(damage == 3 && outcome.complete, "damage {damage} was not found"),
            Some(error) => panic!("{error}"),
        }
        assert!(!path(&name).exists(), "the file is removed with the level");
    }
    assert!(found >= 5, "{found}");
    let nowhere = TiledScene::writer(path("no/such/folder"), DVec3::ZERO);
    assert!(matches!(nowhere.err(), Some(LevelError::File { .. })), "a file in a folder that does not exist");
    for origin in [DVec3::NAN, DVec3::X * f64::INFINITY] {
        assert_eq!(
            TiledScene::writer(path("origin"), origin).err(),
            Some(LevelError::Origin),
            "an origin of {origin}"
        );
    }
}

#[test]
fn a_level_in_a_file_takes_what_an_edit_of_it_has_left() {
    let (mut scene, cells) = town();
    let before = Bake::new(SandwichBaker::new(&scene, &cells, settings())).run();
    let cache = Arc::new(BakeCache::from_bytes(&before.cache.to_bytes()).unwrap());
    let id = scene.id_at(160).unwrap();
    let bounds = scene.bounds(id).unwrap();
    scene.set_bounds(id, Aabb::new(bounds.min, bounds.max + Vec3::Z)).unwrap();
    let whole = Bake::new(SandwichBaker::new(&scene, &cells, settings())).run();
    let level = in_file(&scene, "edit", 4096 * MIB).unwrap();
    let partly = Bake::new(SandwichBaker::of_level(level.into(), &cells, settings()).with_cache(cache)).run();
    assert!(
        bytes(&partly) == bytes(&whole) && partly.cache == whole.cache,
        "the bake with a cache has the bytes of a whole one"
    );
    assert_eq!(partly.reused, cells.cells().len(), "viewcells reused after an edit out of sight");
}

#[test]
fn a_scene_around_a_box_has_the_objects_that_touch_it() {
    let (scene, _) = town();
    let corners = [DVec3::new(-300.0, -60.5, 0.0), DVec3::new(-210.0, 40.0, 3.0)];
    let [min, max] = corners.map(|corner| scene.origin() + corner);
    let of = |scene: &Scene| {
        let mut all: Vec<String> = scene
            .ids()
            .filter(|&id| {
                let bounds = scene.bounds(id).unwrap();
                let [low, high] = [bounds.min, bounds.max].map(|p| p.as_dvec3() + scene.origin());
                (0..3).all(|axis| low[axis] <= max[axis] && min[axis] <= high[axis])
            })
            .map(|id| format!("{:?} {:?}", scene.object(id), scene.triangles(id)))
            .collect();
        all.sort();
        all
    };
    let expected = of(&scene);
    for level in [TiledScene::new(&scene), in_file(&scene, "around", 4096 * MIB).unwrap()] {
        let (found, count) = level.with_scene_around(min, max, |part| (of(part), part.len())).unwrap();
        assert!(found == expected && count == expected.len() && count > 0, "{count} objects");
    }
    let level = in_file(&scene, "around", 4 * MIB).unwrap();
    let far = DVec3::splat(1e9);
    assert!(
        matches!(level.with_scene_around(-far, far, |_| ()), Err(LevelError::Memory { .. })),
        "all objects at once need more than the limit"
    );
}
