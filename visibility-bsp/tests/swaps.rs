//! A culler must answer as a new one does, after its scene, occluders or trees have been swapped, cloned,
//! reverted or dropped.

use crate::common::triangles_of;
use std::sync::Arc;
use visibility_bsp::{
    BspOrderCuller, LargeOccludersCuller, NaylorCuller, Occluders, OcclusionTree, OcclusionTreeCuller,
    SceneTree, ShadowFrusta, ShadowFrustaCuller,
};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, FrustumCuller, Object, ObjectId, OcclusionCuller, Pipeline, Pose,
    Scene, View, VisibleSet, occlusion::Preparation,
};
use visibility_testing::{Random, judged, told_enough};

/// Inserts an occluder box, in metres relative to `Scene::origin`, with its twelve triangles, on the layers
/// of the mask `layers`. Returns its id.
fn insert_wall(scene: &mut Scene, bounds: Aabb, layers: u32) -> ObjectId {
    let id = scene.insert(Object { occluder: true, layers, ..Object::new(bounds) });
    scene.set_triangles(id, triangles_of(&bounds)).unwrap();
    id
}

/// Prepares the occluders of a scene and rebuilds its hierarchy.
fn prepared(mut scene: Scene) -> Scene {
    scene.prepare_occluders(&Preparation::default());
    scene.rebuild();
    scene
}

/// Tests whether a culler removes an object from the set of all objects on the view's layers. False if the
/// object stays visible.
fn hides(culler: &mut dyn Culler, scene: &Scene, view: &View, id: ObjectId) -> bool {
    let mut visible = VisibleSet::new();
    visible.fill(scene, view);
    culler.cull(scene, view, &mut visible);
    !visible.contains(scene, id)
}

/// Two sets of polygons for the same scene revision. A polygon index stands for the near wall in one set and
/// for the far wall in the other.
#[test]
fn other_occluders_of_the_same_revision_are_taken_in() {
    let mut scene = Scene::new();
    let near = insert_wall(&mut scene, Aabb::from_arrays([4.0, -2.0, -2.0], [4.5, 2.0, 2.0]), 1);
    let far = insert_wall(&mut scene, Aabb::from_arrays([9.0, -2.0, -2.0], [9.5, 2.0, 2.0]), 2);
    let target = scene.insert(Aabb::from_arrays([6.0, -0.5, -0.5], [7.0, 0.5, 0.5]));
    let mut scene = prepared(scene);
    let old = Occluders::new(&scene);
    let touch =
        |scene: &mut Scene, id| scene.set_occluder(id, false).and(scene.set_occluder(id, true)).unwrap();
    // Polygons that are made again get the next indices: those of the far wall first, or those of the near
    // wall.
    let mut far_first = old.clone();
    touch(&mut scene, far);
    far_first.sync(&scene);
    touch(&mut scene, near);
    far_first.sync(&scene);
    let mut near_first = old;
    near_first.sync(&scene);

    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY).unwrap();
    // The far wall has the same indices in one set as the near wall in the other.
    for (first, second) in [(&near_first, &far_first), (&far_first, &near_first)] {
        assert_eq!((first.len(), second.len()), (12, 12), "polygons of both sets");
        let mut culler = LargeOccludersCuller::new(Arc::new(first.clone()));
        assert!(
            hides(&mut culler, &scene, &view.with_layers(1), target),
            "the near wall is drawn, and hides the target"
        );
        culler.set_occluders(Arc::new(second.clone()));
        let far_only = view.with_layers(2);
        assert!(!hides(&mut culler, &scene, &far_only, target), "behind a wall that is not drawn");
    }
}

/// Returns a small scene of walls on whole coordinates, some of which abut, and of boxes.
fn world(random: &mut Random) -> Scene {
    let mut scene = Scene::new();
    for _ in 0..24 {
        let at = random.fine_vector(10.0).round().as_vec3();
        let mut size = Vec3::new(2.0, 2.0, 2.0) + random.fine_vector(3.0).round().abs().as_vec3();
        size[random.below(3)] = 0.5;
        insert_wall(&mut scene, Aabb::new(at, at + size), [u32::MAX, 1, 2][random.below(3)]);
    }
    for _ in 0..120 {
        let min = random.fine_vector(12.0).as_vec3();
        let bounds = Aabb::new(min, min + random.fine_vector(0.5).abs().as_vec3() + 0.01);
        let id = scene.insert(bounds);
        // The trees know only objects with triangles.
        scene.set_triangles(id, triangles_of(&bounds)).unwrap();
    }
    prepared(scene)
}

/// A scene and the data made from it, possibly at earlier revisions.
#[derive(Clone)]
struct Place {
    scene: Scene,
    occluders: Arc<Occluders>,
    frusta: Arc<ShadowFrusta>,
    tree: Arc<SceneTree>,
}

impl Place {
    fn new(scene: Scene) -> Self {
        let occluders = Arc::new(Occluders::new(&scene));
        let frusta = Arc::new(ShadowFrusta::new(&scene, (*occluders).clone(), 8, 16));
        let tree = Arc::new(SceneTree::new(&scene).unwrap());
        Self { scene, occluders, frusta, tree }
    }

    /// Changes one random object of the scene: its layers, its occluder flag, its index (the object is
    /// replaced by another with that index) or its position.
    fn mutate(&mut self, random: &mut Random) {
        let ids: Vec<ObjectId> = self.scene.ids().collect();
        let id = ids[random.below(ids.len())];
        let occluder = self.scene.object(id).unwrap().occluder;
        match random.below(4) {
            0 => self.scene.set_layers(id, [u32::MAX, 1, 2][random.below(3)]).unwrap(),
            1 => self.scene.set_occluder(id, !occluder && self.scene.occluder(id).is_some()).unwrap(),
            2 => {
                // Another object takes the removed object's index.
                self.scene.remove(id).unwrap();
                let min = random.fine_vector(10.0).round().as_vec3();
                insert_wall(&mut self.scene, Aabb::new(min, min + Vec3::new(1.0, 3.0, 3.0)), u32::MAX);
            }
            _ => {
                let min = random.fine_vector(10.0).round().as_vec3();
                let bounds = Aabb::new(min, min + 1.5);
                self.scene.set_bounds(id, bounds).unwrap();
                self.scene.set_triangles(id, triangles_of(&bounds)).unwrap();
            }
        }
        if random.below(2) == 0 {
            self.scene.prepare_occluders(&Preparation::default());
        }
    }

    /// Updates one random kind of the data made from the scene, or makes it anew.
    fn sync(&mut self, random: &mut Random) {
        match random.below(5) {
            0 => self.occluders = Arc::new(Occluders::new(&self.scene)),
            1 => Arc::make_mut(&mut self.occluders).sync(&self.scene),
            2 => self.frusta = ShadowFrusta::new(&self.scene, (*self.occluders).clone(), 8, 16).into(),
            3 => self.tree = Arc::new(SceneTree::new(&self.scene).unwrap()),
            _ => Arc::make_mut(&mut self.tree).sync(&self.scene).unwrap(),
        }
    }
}

/// One of each culler of the crate, with the data of some `Place`.
#[derive(Clone)]
struct Cullers {
    tree: OcclusionTreeCuller,
    large: LargeOccludersCuller,
    frusta: ShadowFrustaCuller,
    meshes: OcclusionCuller<OcclusionTree>,
    order: BspOrderCuller<Arc<SceneTree>>,
    naylor: NaylorCuller<Arc<SceneTree>>,
}

impl Cullers {
    fn new(place: &Place) -> Self {
        Self {
            tree: OcclusionTreeCuller::new(place.occluders.clone()),
            large: LargeOccludersCuller::new(place.occluders.clone()),
            frusta: ShadowFrustaCuller::new(place.frusta.clone()),
            meshes: OcclusionCuller::new(OcclusionTree::new()),
            order: BspOrderCuller::new(place.tree.clone()),
            naylor: NaylorCuller::new(place.tree.clone()),
        }
    }

    /// Replaces the cullers' data by those of a place.
    fn give(&mut self, place: &Place) {
        self.tree.set_occluders(place.occluders.clone());
        self.large.set_occluders(place.occluders.clone());
        self.frusta.set_frusta(place.frusta.clone());
        *self.order.shared_mut() = place.tree.clone();
        *self.naylor.shared_mut() = place.tree.clone();
    }

    /// Returns one of each culler.
    fn each(&mut self) -> [&mut dyn Culler; 6] {
        let Self { tree, large, frusta, meshes, order, naylor } = self;
        [tree, large, frusta, meshes, order, naylor]
    }
}

/// Returns the objects that remain after the frustum culler and then `culler`.
fn answer(culler: &mut dyn Culler, scene: &Scene, view: &View) -> Vec<ObjectId> {
    let mut visible = VisibleSet::new();
    visible.fill(scene, view);
    FrustumCuller::new().cull(scene, view, &mut visible);
    culler.cull(scene, view, &mut visible);
    visible.iter(scene).collect()
}

#[test]
fn a_live_culler_answers_as_a_new_one_whatever_is_swapped() {
    let (mut hidden, mut frames) = (0, 0);
    for seed in 0..12 {
        let mut random = Random(seed);
        let mut places = vec![Place::new(world(&mut random)), Place::new(world(&mut random))];
        // Two copies of the same scene, with equal ids and counts, are the hardest to tell apart.
        places.push(Place::new(places[0].scene.clone()));
        places.push(places[0].clone());
        // A culler's data and the scene that it is used with need not belong together.
        let mut live: Vec<(Cullers, Place)> =
            places.iter().map(|place| (Cullers::new(place), place.clone())).collect();
        let (mut eye, mut at) = (random.fine_vector(14.0), 0);
        for _ in 0..80 {
            let (i, j) = (random.below(places.len()), random.below(places.len()));
            let k = random.below(live.len());
            match random.below(12) {
                0 | 1 => places[i].mutate(&mut random),
                2 | 3 => places[i].sync(&mut random),
                // Reverts to an earlier or another state and drops the present one.
                4 => places[i] = places[j].clone(),
                5 => {
                    live[k].1 = places[i].clone();
                    let Some((cullers, place)) = live.get_mut(k) else { unreachable!() };
                    cullers.give(place);
                }
                6 => {
                    // The cullers get the polygons of one place and the tree of another.
                    let mixed = Place { tree: places[j].tree.clone(), ..places[i].clone() };
                    live[k].0.give(&mixed);
                    live[k].1 = mixed;
                }
                7 => live[k] = live[random.below(live.len())].clone(),
                8 => live[k].0.each().into_iter().for_each(|culler| culler.reset()),
                // Only the view changes.
                _ => {}
            }
            eye =
                if random.below(3) == 0 { random.fine_vector(14.0) } else { eye + random.fine_vector(0.02) };
            let pose = Pose::look_at(eye, random.fine_vector(4.0), DVec3::new(0.1, 0.2, 1.0));
            let view = View::perspective(pose, 1.3, 1.5, 0.05, f64::INFINITY).unwrap();
            let view = view.with_layers([u32::MAX, u32::MAX, 1, 2][random.below(4)]);
            at = if random.below(3) == 0 { random.below(places.len()) } else { at };
            let scene = &places[at].scene;
            let in_view = answer(&mut FrustumCuller::new(), scene, &view).len();
            for (cullers, given) in &mut live {
                let mut fresh = Cullers::new(given);
                for (culler, fresh) in cullers.each().into_iter().zip(fresh.each()) {
                    let (live, new) = (answer(culler, scene, &view), answer(fresh, scene, &view));
                    assert_eq!(live, new, "seed {seed}: {}", culler.name());
                    hidden += in_view - live.len();
                    frames += 1;
                }
            }
        }
    }
    judged(hidden as u64);
    told_enough(hidden > frames, format_args!("{hidden} in {frames}"));
}

/// A later stage that removes objects by distance, which removes none here.
struct ByDistance;

impl Culler for ByDistance {
    fn name(&self) -> &str {
        "by distance"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Approximate
    }

    fn follows_draw_ranges(&self) -> bool {
        true
    }

    fn cull(&mut self, scene: &Scene, _: &View, visible: &mut VisibleSet) -> CullStats {
        visible.retain(scene, |_, _| true)
    }
}

#[test]
fn each_culler_that_hides_behind_a_wall_is_named_before_a_stage_that_may_remove_the_wall() {
    let mut scene = Scene::new();
    insert_wall(&mut scene, Aabb::from_arrays([4.0, -4.0, -4.0], [4.5, 4.0, 4.0]), 1);
    let bounds = Aabb::from_arrays([6.0, -0.5, -0.5], [7.0, 0.5, 0.5]);
    let target = scene.insert(bounds);
    scene.set_triangles(target, triangles_of(&bounds)).unwrap();
    // Shadow frusta are baked for eyes among the objects.
    scene.insert(Aabb::from_arrays([-9.0, -4.0, -4.0], [-8.0, 4.0, 4.0]));
    let place = Place::new(prepared(scene));
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY).unwrap();
    let cullers: [Box<dyn Culler + Send + Sync>; 5] = [
        Box::new(OcclusionCuller::new(OcclusionTree::new())),
        Box::new(OcclusionTreeCuller::new(place.occluders.clone())),
        Box::new(LargeOccludersCuller::new(place.occluders.clone())),
        Box::new(ShadowFrustaCuller::new(place.frusta.clone())),
        Box::new(NaylorCuller::new(place.tree.clone())),
    ];
    for mut culler in cullers {
        let name = culler.name().to_owned();
        assert!(hides(&mut *culler, &place.scene, &view, target), "{name} hides the target behind the wall");
        let mut named = Vec::new();
        let mut pipeline = Pipeline::new();
        pipeline.push(culler);
        pipeline.push(Box::new(ByDistance));
        pipeline.for_each_lack(&place.scene, |stage, lack| named.push((stage.to_owned(), lack.count)));
        assert!(named.contains(&(name.clone(), 1)), "{name}: {named:?}");
    }
}
