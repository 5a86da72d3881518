//! Tests that the PVS culler keeps the same objects as a test of each object by itself, through changes of
//! the scene, rebuilds, other viewcells, other sets and other scenes; and that its work follows what is seen.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{
    Aabb, Culler, FrustumCuller, Object, ObjectId, Pose, Scene, View, VisibleSet,
    pvs::{Pvs, PvsCuller, PvsTargets, ScenePvs, Viewcell, ViewcellId, Viewcells},
    scene::{Changes, SceneCursor},
};
use visibility_testing::{Random, judged, told_enough};

/// Number of viewcells: cubes of `SIDE` metres in a row along x, from the origin on.
const CELLS: usize = 6;
const SIDE: f64 = 10.0;
/// Distance of the near plane in metres.
const NEAR: f64 = 0.1;

/// A PVS prepared for a scene, the data that it was made from, and all changes of the scene since.
struct Set {
    shared: Arc<ScenePvs>,
    rows: Vec<Vec<u32>>,
    target_count: u32,
    /// Targets of each object that was given any.
    targets: BTreeMap<ObjectId, Vec<u32>>,
    changed: BTreeSet<ObjectId>,
    /// Whether the origin of the scene was moved, which counts as a change of all objects.
    is_void: bool,
    made: SceneCursor,
    followed: SceneCursor,
}

impl Set {
    fn new(scene: &Scene, rng: &mut Random) -> Self {
        let target_count = rng.pick(&[1, 7, 64, 65, 1 + scene.index_limit() as u32]);
        let density = rng.pick(&[1, 3, 60, 1000]);
        let rows: Vec<Vec<u32>> =
            (0..CELLS).map(|_| (0..target_count).filter(|_| rng.one_in(density)).collect()).collect();
        let mut targets = BTreeMap::new();
        let (unlisted, unknown) = (rng.pick(&[20, 500]), rng.pick(&[20, 500]));
        for id in scene.ids().filter(|_| !rng.one_in(unlisted)).collect::<Vec<_>>() {
            let one = |rng: &mut Random| rng.below(target_count as usize) as u32;
            let mut of: Vec<u32> = (0..1 + rng.below(2)).map(|_| one(rng)).collect();
            of.extend(rng.one_in(unknown).then_some(target_count + 5));
            targets.insert(id, of);
        }
        let pvs = Pvs::new(PvsTargets::Objects, target_count as usize, &rows, |_| []).unwrap();
        let viewcells = Viewcells::new((0..CELLS).map(|i| {
            let min = DVec3::X * SIDE * i as f64;
            Viewcell::from_box(min, min + SIDE)
        }));
        let pairs = targets.iter().flat_map(|(&id, of)| of.iter().map(move |&target| (id, target)));
        let shared = Arc::new(ScenePvs::new(scene, pvs, viewcells, pairs));
        let (made, followed) = (SceneCursor::at(scene), SceneCursor::at(scene));
        Self { shared, rows, target_count, targets, changed: BTreeSet::new(), is_void: false, made, followed }
    }

    fn follow(&mut self, scene: &Scene) {
        match self.followed.follow(scene) {
            Changes::Objects(ids) => self.changed.extend(ids),
            Changes::Everything => self.is_void = true,
        }
    }

    /// Returns whether an object counts as visible from the viewcells `cells`; `None` stands for an eye
    /// outside of all viewcells.
    fn shows(&self, object: &Object, id: ObjectId, cells: Option<&[usize]>) -> bool {
        let Some(cells) = cells else { return true };
        let Some(targets) = self.targets.get(&id) else { return true };
        let is_unculled = object.never_cull || !object.bounds.is_finite();
        let sees = |target: u32| cells.iter().any(|&cell| self.rows[cell].contains(&target));
        self.is_void
            || is_unculled
            || self.changed.contains(&id)
            || targets.iter().any(|&target| target >= self.target_count || sees(target))
    }
}

struct World {
    scene: Scene,
    sets: Vec<Set>,
}

fn random_object(rng: &mut Random) -> Object {
    let min = Vec3::new(rng.unit() as f32 * 60.0, rng.unit() as f32 * 20.0 - 5.0, rng.unit() as f32 * 10.0);
    let mut max = min + rng.vec3(0.1, 1.0);
    if rng.one_in(200) {
        max.x = f32::NAN;
    }
    Object {
        layers: if rng.one_in(10) { rng.below(4) as u32 } else { u32::MAX },
        never_cull: rng.one_in(100),
        ..Object::new(Aabb::new(min, max))
    }
}

fn change(scene: &mut Scene, rng: &mut Random) {
    let ids: Vec<ObjectId> = scene.ids().collect();
    for _ in 0..rng.below(6) {
        let (number, object) = (rng.below(ids.len().max(1)), random_object(rng));
        let Some(&id) = ids.get(number).filter(|&&id| scene.contains(id)) else {
            scene.insert(object);
            continue;
        };
        let bounds = scene.bounds(id).unwrap();
        match rng.below(12) {
            0 => drop(scene.insert(object)),
            1 => scene.remove(id).unwrap(),
            2 => {
                // The new object gets the index of the removed one.
                scene.remove(id).unwrap();
                scene.insert(object);
            }
            3..6 => {
                let step = rng.vec3(-0.01, 0.01);
                scene.set_bounds(id, Aabb::new(bounds.min + step, bounds.max + step)).unwrap();
            }
            6 => scene.set_bounds(id, object.bounds).unwrap(),
            7 => scene.set_never_cull(id, rng.one_in(2)).unwrap(),
            8 => scene.set_layers(id, object.layers).unwrap(),
            9 => scene.set_cost(id, 7).unwrap(),
            10 => scene.set_bounds_batch(&[(id, object.bounds), (id, bounds)]).unwrap(),
            _ => drop(scene.insert_batch([object; 3])),
        }
    }
    match rng.below(60) {
        0 => scene.rebuild(),
        1..20 => drop(scene.maintain(rng.below(30))),
        20 if rng.one_in(4) => scene.set_origin(rng.vector(0.01)).unwrap(),
        _ => {}
    }
}

/// Returns a view, and the viewcells in which its lines of sight begin on the near plane: one viewcell, or
/// two if the near plane crosses a border. `None` for an eye or a near plane outside all viewcells.
fn random_view(rng: &mut Random) -> (View, Option<Vec<usize>>) {
    let cell = rng.below(CELLS);
    let border = SIDE * (cell + 1) as f64;
    let (x, toward, cells) = match rng.below(9) {
        0 => (-5.0, DVec3::X, None),
        // The near plane is beyond the border, or the border goes through it.
        1 if cell + 1 < CELLS => (border - NEAR / 2.0, DVec3::X, Some(vec![cell + 1])),
        2 if cell + 1 < CELLS => {
            (border - NEAR * 0.5f64.sqrt(), DVec3::new(1.0, 1.0, 0.0), Some(vec![cell, cell + 1]))
        }
        1 | 2 => (border - NEAR / 2.0, DVec3::X, None),
        _ => (border - rng.range(2.0, 8.0), DVec3::X, Some(vec![cell])),
    };
    let eye = DVec3::new(x, SIDE / 2.0, SIDE / 2.0);
    let view = View::perspective(Pose::look_at(eye, eye + toward, DVec3::Z), 1.5, 1.5, NEAR, 1e3).unwrap();
    (view.with_layers(rng.pick(&[u32::MAX, u32::MAX, 1, 2])), cells)
}

fn ids_of(visible: &VisibleSet, scene: &Scene) -> BTreeSet<ObjectId> {
    visible.iter(scene).collect()
}

/// Runs frames with one live culler. Returns the number of objects hidden, and the number of frames in which
/// some but not all objects were hidden though the scene had changed since the bake.
fn run(seed: u64, count: usize, frames: usize) -> (usize, usize) {
    let mut rng = Random(seed);
    let mut worlds: Vec<World> = (0..2)
        .map(|_| {
            let mut scene = Scene::new();
            let objects: Vec<Object> = (0..count).map(|_| random_object(&mut rng)).collect();
            scene.insert_batch(objects);
            let sets = (0..2).map(|_| Set::new(&scene, &mut rng)).collect();
            World { scene, sets }
        })
        .collect();
    let mut live = PvsCuller::new(worlds[0].sets[0].shared.clone());
    // Index of the world that is drawn, and indices of the world and of the set that the culler holds.
    let (mut at, mut given) = (0, (0, 0));
    let (mut view, mut cells) = random_view(&mut rng);
    let (mut hidden, mut mixed) = (0, 0);
    for frame in 0..frames {
        match rng.below(40) {
            0..12 => change(&mut worlds[at].scene, &mut rng),
            12 => change(&mut worlds[1 - at].scene, &mut rng),
            13 => at = 1 - at,
            14 => given.0 = 1 - given.0,
            15..18 => given.1 = 1 - given.1,
            18 => given.0 = at,
            19 => worlds[given.0].sets[given.1] = Set::new(&worlds[given.0].scene, &mut rng),
            20 => worlds[1 - at].scene = worlds[at].scene.clone(),
            21 => {
                // A clone replaces the scene, and counts as another scene.
                let copy = worlds[at].scene.clone();
                worlds[at].scene = copy;
            }
            22 => {
                worlds.swap(0, 1);
            }
            23 => worlds[at].scene.rebuild(),
            24..30 => (view, cells) = random_view(&mut rng),
            30 if rng.one_in(4) => live = live.clone(),
            31 => live.reset(),
            _ => {}
        }
        for world in &mut worlds {
            if world.sets.iter().all(|set| set.is_void) {
                world.sets = (0..2).map(|_| Set::new(&world.scene, &mut rng)).collect();
            }
            world.sets.iter_mut().for_each(|set| set.follow(&world.scene));
        }
        let (set, scene) = (&worlds[given.0].sets[given.1], &worlds[at].scene);
        *live.shared_mut() = set.shared.clone();

        let shows_all = given.0 != at || set.is_void;
        let expect = |start: &BTreeSet<ObjectId>, cells: Option<&[usize]>| -> BTreeSet<ObjectId> {
            let shows = |id: &ObjectId| shows_all || set.shows(&scene.object(*id).unwrap(), *id, cells);
            start.iter().copied().filter(shows).collect()
        };
        // The culler runs after a frustum culler, or alone.
        let is_alone = rng.one_in(2);
        let mut visible = VisibleSet::new();
        visible.fill(scene, &view);
        if !is_alone {
            FrustumCuller::new().cull(scene, &view, &mut visible);
        }
        let start = ids_of(&visible, scene);
        let stats = live.cull(scene, &view, &mut visible);
        let (seen, expected) = (ids_of(&visible, scene), expect(&start, cells.as_deref()));
        let lost: Vec<_> = expected.difference(&seen).collect();
        assert!(lost.is_empty(), "seed {seed}, frame {frame}: hides {lost:?}");
        // The log of the scene may no longer reach back to the bake, if the culler has followed another scene
        // meanwhile.
        if seen != start || set.made.peek(scene) != Changes::Everything {
            let more: Vec<_> = seen.difference(&expected).collect();
            assert!(more.is_empty(), "seed {seed}, frame {frame}: keeps {more:?}");
        }
        assert_eq!(stats.visible as usize, seen.len(), "seed {seed}, frame {frame}");
        visible.finish(scene);
        assert_eq!(ids_of(&visible, scene), seen, "seed {seed}, frame {frame}: finishing changes the set");
        hidden += start.len() - seen.len();
        mixed += usize::from(seen.len() < start.len() && !set.changed.is_empty() && !seen.is_empty());
    }
    (hidden, mixed)
}

#[test]
fn what_is_left_is_what_a_look_at_each_object_leaves() {
    for (count, seeds, frames) in [(0, 4, 200), (40, 30, 400), (700, 12, 400), (5000, 3, 300)] {
        let (mut hidden, mut mixed) = (0, 0);
        for seed in 0..seeds {
            let more = run(seed, count, frames);
            (hidden, mixed) = (hidden + more.0, mixed + more.1);
        }
        let all = seeds as usize * frames;
        judged(hidden as u64);
        told_enough(
            count == 0 || hidden > all * count / 20 && mixed > all / 20,
            format_args!("{hidden} {mixed} of {all}"),
        );
    }
}

/// Tests that a frame visits only nodes with visible objects, whatever else the scene contains, and that a
/// culler that has just entered a viewcell visits no more.
#[test]
fn nodes_visited_follow_what_is_seen() {
    let mut scene = Scene::new();
    let boxes = (0..100_000).map(|i| {
        let min = Vec3::new((i % 300) as f32, (i / 300) as f32, 1.0);
        Aabb::new(min, min + 0.5)
    });
    let ids = scene.insert_batch(boxes);
    let rows = [(0..30).map(|i| i * 3001).collect::<Vec<u32>>(), vec![4]];
    let pvs = Pvs::new(PvsTargets::Objects, ids.len(), &rows, |_| []).unwrap();
    let viewcells = Viewcells::new([0.0, 10.0].map(|x| {
        let min = DVec3::new(x, 0.0, 0.0);
        Viewcell::from_box(min, min + 10.0)
    }));
    let shared = ScenePvs::new(&scene, pvs, viewcells, ids.iter().copied().zip(0..));
    let mut culler = PvsCuller::new(&shared);
    let mut frame = |scene: &Scene, x: f64| {
        let eye = DVec3::new(x, 5.0, 5.0);
        let view = View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 1.5, 1.5, 0.1, 1e3);
        let mut visible = VisibleSet::new();
        visible.fill(scene, &view.unwrap());
        let stats = culler.cull(scene, &view.unwrap(), &mut visible);
        assert_eq!(stats.visible, visible.count(scene) as u64, "x {x}: objects counted and in the set");
        (stats.visible, stats.nodes)
    };
    for (x, seen) in [(5.0, 30), (5.0, 30), (15.0, 1), (5.0, 30)] {
        let (visible, nodes) = frame(&scene, x);
        assert_eq!(visible, seen, "x {x}: objects that the viewcell sees");
        // At most the root, and one inner node and one leaf for each object.
        assert!(nodes <= 1 + 2 * seen, "{nodes} nodes for {seen} objects");
    }
    // A changed object counts as one more object that is seen.
    let at = scene.bounds(ids[70_000]).unwrap();
    scene.set_bounds(ids[70_000], at).unwrap();
    assert_eq!(frame(&scene, 5.0).0, 31, "objects visible after one has moved");
    scene.rebuild();
    let (visible, nodes) = frame(&scene, 5.0);
    assert!(visible == 31 && nodes <= 1 + 2 * 31, "{visible} {nodes}");
    assert_eq!(culler.viewcell(), Some(ViewcellId(0)), "the viewcell of the eye");
}

/// Tests a set that was filled before the layout of the scene changed, and a set that shares blocks with what
/// is seen, but no object: later stages visit nothing below the root.
#[test]
fn sets_of_earlier_layouts_and_of_other_objects_are_intersected() {
    let mut scene = Scene::new();
    let at = |i: usize| {
        let min = Vec3::new((i % 100) as f32, (i / 100) as f32, 1.0);
        Aabb::new(min, min + 0.5)
    };
    let ids = scene.insert_batch((0..6000).map(at));
    let row: Vec<u32> = (0..6000).step_by(2).collect();
    let pvs = Pvs::new(PvsTargets::Objects, ids.len(), &[&row], |_| []).unwrap();
    let viewcells = Viewcells::new([Viewcell::from_box(DVec3::ZERO, DVec3::splat(SIDE))]);
    let shared = ScenePvs::new(&scene, pvs, viewcells, ids.iter().copied().zip(0..));
    let mut culler = PvsCuller::new(&shared);
    let eye = DVec3::splat(SIDE / 2.0);
    let view = View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 1.5, 1.5, NEAR, 1e3).unwrap();

    let mut visible = VisibleSet::new();
    visible.fill(&scene, &view);
    visible.retain(&scene, |id, _| id.index() % 2 == 1);
    assert_eq!(
        culler.cull(&scene, &view, &mut visible).visible,
        0,
        "the set holds odd objects, the PVS even ones"
    );
    assert_eq!(visible.retain(&scene, |_, _| true).nodes, 1, "nodes left of an empty set: the root");

    // The scene has more nodes than the set was filled for.
    visible.fill(&scene, &view);
    scene.insert_batch((0..1000).map(at));
    assert_eq!(
        culler.cull(&scene, &view, &mut visible).visible,
        3000 + 1000,
        "objects visible: those of the PVS, and those inserted since"
    );
    assert_eq!(visible.count(&scene), 3000 + 1000, "objects in the set");
    assert!(
        !visible.contains(&scene, ids[1]) && visible.contains(&scene, ids[2]),
        "object 1 is hidden by the PVS, object 2 is not"
    );
}
