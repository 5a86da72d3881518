//! The state of an interrupted bake, or its cache, with arbitrary changes and a repaired
//! checksum. It must be refused with an error, or a bake must accept it and run to its end.
use crate::{change, mend};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, OnceLock};
use visibility_bake::{BakeCache, SandwichBaker, SandwichSettings, TiledScene};
use visibility_core::bake::Bake;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::{Viewcell, Viewcells};
use visibility_core::{Aabb, Object, OccluderMesh, Scene};

/// Level with viewcells, and the valid files that bakes of it have stored.
struct Real {
    level: Arc<TiledScene<'static>>,
    viewcells: Viewcells,
    /// States of three interrupted bakes: with some viewcells swept, with all swept, and with rays cast from
    /// some.
    states: [Vec<u8>; 3],
    cache: Vec<u8>,
}

impl Real {
    fn new(scene: Scene, corners: &[[f64; 2]]) -> Self {
        let level = Arc::new(TiledScene::new(Box::leak(Box::new(scene))));
        let cell = |&[x, y]: &[f64; 2]| {
            let corner = DVec3::new(x, y, 0.5);
            Viewcell::from_box(corner, corner + DVec3::ONE)
        };
        let viewcells = Viewcells::new(corners.iter().map(cell));
        let mut real = Self { level, viewcells, states: Default::default(), cache: Vec::new() };
        let count = corners.len();
        let states = [1, count, count + 2].map(|items| {
            let mut bake = Bake::new(real.baker());
            let begun = AtomicUsize::new(0);
            while begun.load(Relaxed) <= items {
                bake.advance_unless(|| begun.fetch_add(1, Relaxed) >= items, || false);
            }
            bake.save()
        });
        let cache = Bake::new(real.baker()).run().cache.to_bytes();
        (real.states, real.cache) = (states, cache);
        real
    }

    fn baker(&self) -> SandwichBaker<'_> {
        let settings = SandwichSettings::default().with_rays(1).with_gap(0.0);
        SandwichBaker::of_level(self.level.clone(), &self.viewcells, settings)
    }
}

/// Inserts a box with its triangles.
fn insert(scene: &mut Scene, min: [f32; 3], max: [f32; 3], occluder: bool) {
    let bounds = Aabb::from_arrays(min, max);
    let id = scene.insert(Object { occluder, cost: 12, ..Object::new(bounds) });
    let corners = bounds.corners();
    let sides = OccluderMesh::CUBOID.map(|corner| corner.map(|i| corners[i as usize]));
    scene.set_triangles(id, sides).expect("triangles of a new object");
}

/// Makes a level of one tile: a wall with boxes on both sides.
fn one_tile() -> Real {
    let mut scene = Scene::new();
    insert(&mut scene, [-3.0, 5.0, 0.0], [6.0, 5.5, 3.0], true);
    for i in 0..10 {
        let (x, y) = (i as f32 - 2.0, if i % 3 == 0 { 3.5 } else { 7.0 });
        insert(&mut scene, [x, y, 0.0], [x + 0.6, y + 1.0, 1.0], i % 2 == 0);
    }
    scene.prepare_occluders(&Default::default());
    Real::new(scene, &[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
}

/// Makes a level of several tiles: two courts with high walls and a few boxes, and behind the walls points
/// with enough triangles to force a division into tiles.
fn many_tiles() -> Real {
    let mut scene = Scene::new();
    for x in [-1.0, 20.0, 41.0] {
        insert(&mut scene, [x, -30.0, -1.0], [x + 0.5, 30.0, 40.0], true);
    }
    for (i, j) in (0..5).flat_map(|i| (0..3).map(move |j| (i, j))) {
        let (x, y) = (1.0 + i as f32 * 8.5, -7.0 + j as f32 * 6.0);
        insert(&mut scene, [x, y, 0.0], [x + 0.5, y + 2.0, 0.8], (i + j) % 3 == 0);
    }
    for i in 0..4 {
        let point = Vec3::new(60.0 + 10.0 * i as f32, 0.0, 0.2);
        let id = scene.insert(Aabb::new(point, point));
        scene.set_triangles(id, vec![[point; 3]; 1 << 16]).expect("triangles of a new object");
    }
    scene.prepare_occluders(&Default::default());
    Real::new(scene, &[[5.0, 0.0], [6.0, 0.0], [30.0, 0.0]])
}

/// Runs the target on some bytes. Returns whether the changed state or cache was accepted.
pub fn run(bytes: &[u8]) -> bool {
    static REAL: OnceLock<[Real; 2]> = OnceLock::new();
    let Some((&kind, changes)) = bytes.split_first() else { return false };
    let real = &REAL.get_or_init(|| [one_tile(), many_tiles()])[usize::from(kind % 2)];
    let kind = kind / 2;
    let state = real.states.get(usize::from(kind % 4));
    let mut forged = state.unwrap_or(&real.cache).clone();
    change(&mut forged, changes);
    mend(&mut forged);
    let bake = if state.is_some() {
        // Every other resumed bake also gets the cache of an earlier bake.
        let cache =
            if kind / 4 % 2 == 0 { BakeCache::default() } else { cache(&real.cache).expect("own bytes") };
        let Ok(bake) = Bake::resume(real.baker().with_cache(cache), &forged) else { return false };
        let saved = bake.save();
        let again = Bake::resume(real.baker(), &saved).expect("its own bytes");
        assert_eq!(again.save(), saved, "a resumed bake, saved again");
        bake
    } else {
        let Some(cache) = cache(&forged) else { return false };
        assert_eq!(BakeCache::from_bytes(&cache.to_bytes()), Ok(cache.clone()), "a cache from its own bytes");
        Bake::new(real.baker().with_cache(cache))
    };
    let outcome = bake.run();
    assert_eq!(outcome.cells.len(), real.viewcells.cells().len(), "a row for each viewcell");
    for cell in &outcome.cells {
        let row = cell.reported();
        assert!(row.is_sorted_by(|a, b| a < b), "ascending, each once");
        let last = row.last();
        let is_known = last.is_none_or(|&last| (last as usize) < real.level.index_limit());
        assert!(is_known, "a row ends with the target {last:?}");
    }
    assert!(
        BakeCache::from_bytes(&outcome.cache.to_bytes()).is_ok(),
        "the cache of a bake from its own bytes"
    );
    true
}

fn cache(bytes: &[u8]) -> Option<BakeCache> {
    BakeCache::from_bytes(bytes).ok()
}
