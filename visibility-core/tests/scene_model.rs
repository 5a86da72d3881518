//! Tests of random changes to a scene, compared with a hash map as the model.

use std::collections::{HashMap, HashSet};
use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, FrustumCuller, Object, ObjectId, Pipeline, Scene, View, VisibleSet,
    scene::{Changes, SceneError},
};
use visibility_testing::Random;
use visibility_testing::cameras::random_camera;

struct Model {
    rng: Random,
    scene: Scene,
    objects: HashMap<ObjectId, Object>,
    /// The keys of `objects`, to pick from at random.
    ids: Vec<ObjectId>,
    stale: Vec<ObjectId>,
    /// A revision of the scene; `changed` holds the objects that have changed since.
    revision: u64,
    changed: HashSet<ObjectId>,
    /// Number of objects found in change lists, to make sure that the test covered such lists.
    listed: usize,
    hidden: usize,
    /// Whether to leave out boxes so large or so far away that they would keep the bounds of whole blocks in
    /// view.
    calm: bool,
}

fn same_object(a: &Object, b: &Object) -> bool {
    // Compared by bits, since NaN is not equal to itself.
    let bits = |o: &Object| [o.bounds.min, o.bounds.max].map(|v| v.to_array().map(f32::to_bits));
    bits(a) == bits(b) && Object { bounds: Aabb::EMPTY, ..*a } == Object { bounds: Aabb::EMPTY, ..*b }
}

impl Model {
    fn new(seed: u64) -> Self {
        Self {
            rng: Random(seed),
            scene: Scene::new(),
            objects: HashMap::new(),
            ids: Vec::new(),
            stale: Vec::new(),
            revision: 0,
            changed: HashSet::new(),
            listed: 0,
            hidden: 0,
            calm: seed.is_multiple_of(2),
        }
    }

    fn random_bounds(&mut self) -> Aabb {
        let rng = &mut self.rng;
        let spread = if self.calm { 300.0 } else { rng.pick(&[20.0, 300.0, 300.0, 5000.0]) };
        let min = rng.vector(spread).as_vec3();
        let mut max = min + rng.vector(2.0).abs().as_vec3();
        let axis = rng.below(3);
        match rng.below(40) {
            0 => max[axis] = f32::NAN,
            1 => max[axis] = f32::INFINITY,
            2 => max[axis] = min[axis] - 1.0,
            3 if !self.calm => max[axis] = min[axis] + 1e20,
            4 => max = min,
            _ => {}
        }
        Aabb::new(min, max)
    }

    fn random_object(&mut self) -> Object {
        let bounds = self.random_bounds();
        let rng = &mut self.rng;
        Object {
            bounds,
            layers: if rng.one_in(5) { rng.bits() as u32 & 0xf } else { u32::MAX },
            cost: rng.bits() as u32,
            never_cull: rng.one_in(40),
            occluder: rng.one_in(3),
            see_through: rng.one_in(4),
            one_sided: rng.one_in(2),
        }
    }

    fn some(&mut self) -> ObjectId {
        self.rng.pick(&self.ids)
    }

    fn added(&mut self, id: ObjectId, object: Object) {
        assert!(self.objects.insert(id, object).is_none(), "{id} is new");
        self.ids.push(id);
        self.changed.insert(id);
    }

    fn removed(&mut self, id: ObjectId) {
        self.objects.remove(&id).unwrap();
        self.stale.push(id);
        self.changed.insert(id);
    }

    fn step(&mut self) {
        match self.rng.below(if self.ids.is_empty() { 3 } else { 40 }) {
            0..3 => {
                let object = self.random_object();
                let id = self.scene.insert(object);
                self.added(id, object);
            }
            3 => {
                let count = self.rng.pick(&[0, 1, 20, 200]);
                let objects: Vec<Object> = (0..count).map(|_| self.random_object()).collect();
                let ids = self.scene.insert_batch(objects.iter().copied());
                assert_eq!(ids.len(), objects.len(), "ids of the batch");
                ids.into_iter().zip(objects).for_each(|(id, object)| self.added(id, object));
            }
            4..7 => {
                let place = self.rng.below(self.ids.len());
                let id = self.ids.swap_remove(place);
                self.scene.remove(id).unwrap();
                self.removed(id);
            }
            7 => {
                let kept = self.ids.len() - self.rng.pick(&[0, 1, 20, 150]).min(self.ids.len());
                let gone = self.ids.split_off(kept);
                self.scene.remove_batch(&gone).unwrap();
                gone.into_iter().for_each(|id| self.removed(id));
                // An unknown or repeated id makes the batch fail as a whole, without any change.
                if let (Some(&stale), Some(&valid)) = (self.stale.last(), self.ids.last()) {
                    let unknown = Err(SceneError::UnknownObject(stale));
                    assert_eq!(
                        self.scene.remove_batch(&[valid, stale]),
                        unknown,
                        "a batch with an unknown id"
                    );
                    let twice = Err(SceneError::UnknownObject(valid));
                    assert_eq!(self.scene.remove_batch(&[valid, valid]), twice, "a batch with an id twice");
                    let moved = [(valid, Aabb::EMPTY), (stale, Aabb::EMPTY)];
                    assert_eq!(self.scene.set_bounds_batch(&moved), unknown, "moves with an unknown id");
                }
            }
            8..20 => {
                // Many small moves at once, as in a frame.
                let count = 1 + self.rng.below(20);
                let size = self.rng.pick(&[0.01, 1.0, 30.0]);
                let mut moved = Vec::new();
                for _ in 0..count {
                    let (id, step) = (self.some(), self.rng.vector(size).as_vec3());
                    let old = self.objects[&id].bounds;
                    let bounds = Aabb::new(old.min + step, old.max + step);
                    self.objects.get_mut(&id).unwrap().bounds = bounds;
                    self.changed.insert(id);
                    moved.push((id, bounds));
                }
                self.scene.set_bounds_batch(&moved).unwrap();
            }
            20..28 => {
                let (id, bounds) = (self.some(), self.random_bounds());
                self.scene.set_bounds(id, bounds).unwrap();
                self.set(id, |object| object.bounds = bounds);
            }
            28..30 => {
                let (id, layers) = (self.some(), self.rng.pick(&[0, 1, 2, 7, u32::MAX]));
                self.scene.set_layers(id, layers).unwrap();
                self.set(id, |object| object.layers = layers);
            }
            30..32 => {
                let (id, never_cull) = (self.some(), self.rng.one_in(3));
                self.scene.set_never_cull(id, never_cull).unwrap();
                self.set(id, |object| object.never_cull = never_cull);
                let (id, [see_through, one_sided]) = (self.some(), [self.rng.one_in(2), self.rng.one_in(2)]);
                self.scene.set_see_through(id, see_through).unwrap();
                self.scene.set_one_sided(id, one_sided).unwrap();
                self.set(id, |object| (object.see_through, object.one_sided) = (see_through, one_sided));
            }
            32 => {
                let (id, occluder) = (self.some(), self.rng.one_in(2));
                self.scene.set_occluder(id, occluder).unwrap();
                self.set(id, |object| object.occluder = occluder);
            }
            33 => {
                let (id, cost) = (self.some(), self.rng.bits() as u32);
                self.scene.set_cost(id, cost).unwrap();
                self.set(id, |object| object.cost = cost);
            }
            34 if self.rng.one_in(60) => self.scene.rebuild(),
            _ => {
                let budget = self.rng.below(30);
                let done = self.scene.maintain(budget);
                assert!(
                    done.budget_used <= budget,
                    "{} blocks of work, the budget is {budget}",
                    done.budget_used
                );
            }
        }
        if self.rng.one_in(200) {
            self.revision = self.scene.revision();
            self.changed.clear();
        }
    }

    fn set(&mut self, id: ObjectId, change: impl Fn(&mut Object)) {
        change(self.objects.get_mut(&id).unwrap());
        self.changed.insert(id);
    }

    fn check_objects(&mut self) {
        let scene = &mut self.scene;
        assert_eq!(
            (scene.len(), scene.is_empty()),
            (self.objects.len(), self.objects.is_empty()),
            "objects of the scene and of the model"
        );
        for (&id, object) in &self.objects {
            let found = scene.object(id).unwrap();
            assert!(same_object(&found, object), "{id}: {found:?} instead of {object:?}");
            assert!(
                scene.contains(id) && id.index() < scene.index_limit(),
                "{id} is in the scene, its index below the limit"
            );
        }
        let listed: Vec<ObjectId> = scene.ids().collect();
        assert!(listed.is_sorted_by(|a, b| a.index() < b.index()), "ids are sorted by index");
        assert_eq!(
            listed.iter().copied().collect::<HashSet<_>>(),
            self.objects.keys().copied().collect(),
            "ids of the scene and of the model"
        );
        for &id in self.stale.iter().rev().take(300) {
            let unknown = SceneError::UnknownObject(id);
            assert!(!scene.contains(id), "{id} was removed");
            assert_eq!(scene.object(id), Err(unknown), "{id} was removed");
            assert_eq!(scene.bounds(id), Err(unknown), "{id} was removed");
            assert_eq!(scene.triangles(id), Err(unknown), "{id} was removed");
            assert_eq!(scene.remove(id), Err(unknown), "{id} was removed");
            assert_eq!(scene.set_bounds(id, Aabb::EMPTY), Err(unknown), "{id} was removed");
            assert_eq!(scene.set_layers(id, 1), Err(unknown), "{id} was removed");
            assert_eq!(scene.set_cost(id, 1), Err(unknown), "{id} was removed");
            assert_eq!(scene.set_occluder(id, true), Err(unknown), "{id} was removed");
            assert_eq!(scene.set_never_cull(id, true), Err(unknown), "{id} was removed");
            assert_eq!(scene.set_see_through(id, true), Err(unknown), "{id} was removed");
            assert_eq!(scene.set_one_sided(id, true), Err(unknown), "{id} was removed");
            assert_eq!(scene.set_triangles(id, []), Err(unknown), "{id} was removed");
        }
    }

    fn check_changes(&mut self) {
        match self.scene.changes_since(self.revision) {
            Changes::Everything => {}
            Changes::Objects(ids) => {
                let listed: HashSet<ObjectId> = ids.iter().copied().collect();
                assert_eq!(listed, self.changed, "what changed since revision {}", self.revision);
                self.listed += listed.len();
            }
        }
        assert_eq!(
            self.scene.changes_since(self.scene.revision()),
            Changes::Objects(&[]),
            "nothing has changed since the last revision"
        );
        assert_eq!(
            self.scene.changes_since(self.scene.revision() + 1),
            Changes::Everything,
            "a revision of the future"
        );
    }

    /// Compares the visible set of a random camera with a test of every object by itself.
    fn check_culling(&mut self) {
        let exponents = [self.rng.between(2, 9); 3];
        let (camera, _) = random_camera(&mut self.rng, exponents);
        let Ok(view) = View::from_clip_from_world(camera.matrix, camera.depth) else { return };
        let layers = self.rng.pick(&[u32::MAX, u32::MAX, 1, 6]);
        let view = view.with_layers(layers);
        let mut visible = VisibleSet::new();
        let stats = Pipeline::new().with(FrustumCuller::new()).cull(&self.scene, &view, &mut visible);
        let set: HashSet<ObjectId> = visible.iter(&self.scene).collect();
        assert_eq!(
            (set.len(), set.len() as u64),
            (visible.count(&self.scene), stats.visible),
            "objects listed, in the set and counted"
        );
        for (&id, object) in &self.objects {
            let found = set.contains(&id);
            assert_eq!(
                found,
                visible.contains(&self.scene, id),
                "{id} is listed, or not, but the set says otherwise"
            );
            let b = &object.bounds;
            let bounded = (0..3).all(|i| b.min[i] <= b.max[i] && (b.max[i] - b.min[i]).is_finite());
            if object.layers & layers == 0 {
                assert!(!found, "{id} is on no layer of the view");
            } else if object.never_cull || !bounded {
                assert!(found, "{id} is never culled: {object:?}");
            } else if camera.error_bounds_outside(b) > 16.0 {
                assert!(!found, "{id} is outside: {b:?} {camera:?}");
                self.hidden += 1;
            } else {
                assert!(found || !camera.sees_a_corner(b), "{id} has a corner in view: {b:?} {camera:?}");
            }
        }
    }

    fn run(&mut self, steps: usize, every: usize) {
        for step in 0..steps {
            self.step();
            if step % 40 == 0 {
                self.check_changes();
            }
            if step % every == 0 {
                self.check_objects();
                (0..4).for_each(|_| self.check_culling());
            }
        }
    }
}

#[test]
fn a_scene_that_grows_from_nothing_equals_its_model() {
    for seed in 0..8 {
        let mut model = Model::new(seed);
        model.run(1500, 20);
        assert!(model.listed > 100 && model.hidden > 1000, "too easy: {} {}", model.listed, model.hidden);
    }
}

#[test]
fn a_scene_of_three_levels_equals_its_model() {
    for seed in 10..14 {
        let mut model = Model::new(seed);
        let objects: Vec<Object> = (0..9000).map(|_| model.random_object()).collect();
        let ids = model.scene.insert_batch(objects.iter().copied());
        ids.into_iter().zip(objects).for_each(|(id, object)| model.added(id, object));
        // The batch is larger than the log, so its changes are not compared.
        model.revision = model.scene.revision();
        model.changed.clear();
        model.run(3000, 150);
        // Removes all objects, which frees nodes on all levels.
        while !model.ids.is_empty() {
            let kept = model.ids.len() - model.ids.len().min(500);
            for id in model.ids.split_off(kept) {
                model.scene.remove(id).unwrap();
                model.removed(id);
            }
            model.scene.maintain(3);
            model.check_objects();
            model.check_culling();
        }
        model.run(300, 20);
    }
}

/// Tests that a scene reports `Changes::Everything` after its origin was moved, or after more changes than
/// its log holds.
#[test]
fn too_many_changes_are_everything() {
    let mut scene = Scene::new();
    let ids = scene.insert_batch((0..2000).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 1.0; 3])));
    let mut revision = scene.revision();
    for round in 0..3000 {
        scene.set_cost(ids[round % 2000], 3).unwrap();
    }
    assert_eq!(scene.changes_since(revision), Changes::Everything, "3000 changes of 2000 objects");
    revision = scene.revision();
    scene.set_origin(DVec3::X).unwrap();
    assert_eq!(scene.changes_since(revision), Changes::Everything, "another origin changes all objects");
    revision = scene.revision();
    scene.rebuild();
    scene.maintain(usize::MAX);
    assert_eq!(scene.changes_since(revision), Changes::Objects(&[]), "where objects are kept is no change");
    scene.set_triangles(ids[7], []).unwrap();
    assert_eq!(scene.changes_since(revision), Changes::Objects(&[ids[7]]), "other triangles are a change");
}

#[test]
fn a_parent_that_loses_its_last_child_has_changed() {
    for removes in [false, true] {
        let mut scene = Scene::new();
        let [parent, child] = [0, 1].map(|_| scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3])));
        scene.set_hlod_parent(child, Some(parent)).unwrap();
        assert!(!scene.is_always_drawn(parent), "a parent is drawn from afar alone");
        let revision = scene.revision();
        if removes {
            scene.remove(child).unwrap();
        } else {
            scene.set_hlod_parent(child, None).unwrap();
        }
        assert!(scene.is_always_drawn(parent), "without children, it is drawn at every distance");
        let Changes::Objects(changed) = scene.changes_since(revision) else { panic!("few changes") };
        assert!(changed.contains(&parent), "child removed: {removes}; changed: {changed:?}");
    }
}

/// Another child of a parent queues the blocks of the two alone for maintenance, however many children there
/// are.
#[test]
fn linking_a_child_leaves_its_siblings_alone() {
    let mut scene = Scene::new();
    let parent = scene.insert(Aabb::from_arrays([0.0; 3], [100.0; 3]));
    let boxes = (0..10_000).map(|i| [(i % 100) as f32, (i / 100) as f32, 0.0]);
    let ids = scene.insert_batch(boxes.map(|at| Aabb::from_arrays(at, at.map(|x| x + 1.0))));
    ids.iter().for_each(|&id| scene.set_hlod_parent(id, Some(parent)).unwrap());
    for to in [None, Some(parent)] {
        scene.maintain(usize::MAX);
        scene.set_hlod_parent(ids[0], to).unwrap();
        let waiting = scene.maintain(0).waiting;
        assert!(waiting <= 2, "{waiting} blocks wait after the parent became {to:?}");
    }
}
