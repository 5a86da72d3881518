//! Tests of the occlusion driver over a plain depth map: what it must hide, what it must not hide, and its
//! cost.

use std::cell::Cell;
use visibility_core::glam::{Affine3A, DVec3, Quat, Vec3};
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, FrustumCuller, Object, ObjectId, OccluderMesh, OcclusionCuller,
    OcclusionMap, Pipeline, Pose, Scene, View, VisibleSet,
    geometry::Plane,
    occlusion::{HardwareQueries, LateAnswers, Occlusion, Preparation, QueryDevice, prepare},
    scene::{SceneError, Triangle},
    view::Window,
    walk::{BoxHierarchy, Child, SceneHierarchy},
};
use visibility_testing::{Octree, PlainMap, Random};

fn view_from(eye: DVec3, target: DVec3) -> View {
    View::perspective(Pose::look_at(eye, target, DVec3::Z), 1.0, 1.6, 0.1, f64::INFINITY).unwrap()
}

fn along_x() -> View {
    view_from(DVec3::ZERO, DVec3::X)
}

/// A scene with a wall across the view at x = 10, and boxes before, behind and beside the wall.
struct Street {
    scene: Scene,
    wall: ObjectId,
    before: ObjectId,
    beside: ObjectId,
}

fn street() -> Street {
    let mut scene = Scene::new();
    let bounds = Aabb::from_arrays([10.0, -4.0, -4.0], [10.5, 4.0, 4.0]);
    let wall = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
    scene.set_mesh(wall, mesh, Affine3A::IDENTITY).unwrap();
    let small = |x: f32, y: f32| Aabb::from_arrays([x, y - 0.2, -0.2], [x + 0.4, y + 0.2, 0.2]);
    let before = scene.insert(small(5.0, 0.0));
    scene.insert_batch((0..500).map(|i| small(12.0 + (i / 25) as f32, (i % 25) as f32 * 0.25 - 3.0)));
    let beside = scene.insert(small(12.0, 7.0));
    Street { scene, wall, before, beside }
}

fn visible(pipeline: &mut Pipeline, scene: &Scene, view: &View) -> Vec<ObjectId> {
    let mut visible = VisibleSet::new();
    pipeline.cull(scene, view, &mut visible);
    let mut ids: Vec<_> = visible.iter(scene).collect();
    ids.sort_unstable();
    ids
}

/// Makes a pipeline of frustum culling and occlusion culling over a plain map of 96 x 60 pixels.
fn pipeline() -> Pipeline {
    let culler = OcclusionCuller::new(PlainMap::new(96, 60));
    Pipeline::new().with(FrustumCuller::new()).with(culler)
}

#[test]
fn a_wall_hides_what_is_behind_it_and_nothing_else() {
    let Street { scene, wall, before, beside, .. } = street();
    let mut pipeline = pipeline();
    for frame in 0..3 {
        let seen = visible(&mut pipeline, &scene, &along_x());
        assert_eq!(seen, [wall, before, beside], "frame {frame}");
    }
    assert_eq!(pipeline.accuracy(), Accuracy::Conservative, "an occlusion culler is conservative");
}

#[test]
fn a_door_that_opens_hides_nothing() {
    let Street { mut scene, wall, .. } = street();
    let mut pipeline = pipeline();
    assert_eq!(visible(&mut pipeline, &scene, &along_x()).len(), 3, "the door is shut at first");
    let before = scene.revision();
    scene.set_occluder(wall, false).unwrap();
    assert!(
        matches!(scene.changes_since(before), visibility_core::scene::Changes::Objects([_])),
        "one object has changed"
    );
    assert_eq!(visible(&mut pipeline, &scene, &along_x()).len(), 503, "open");
    scene.set_occluder(wall, true).unwrap();
    assert_eq!(visible(&mut pipeline, &scene, &along_x()).len(), 3, "shut");
}

#[test]
fn meshes_hide_only_while_their_object_is_flagged() {
    let Street { mut scene, wall, before, .. } = street();
    assert!(
        scene.occluder(wall).is_some() && scene.occluder(before).is_none(),
        "the wall has a mesh, the thing before it none"
    );
    scene.set_occluder(wall, false).unwrap();
    assert!(
        scene.occluder(wall).is_none() && scene.has_mesh(wall),
        "without its flag the wall is no occluder, but keeps its mesh"
    );
    let foreign =
        street().scene.add_mesh(OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [1.0; 3])).unwrap());
    assert_eq!(
        scene.set_mesh(before, foreign, Affine3A::IDENTITY),
        Err(SceneError::UnknownMesh(foreign)),
        "a mesh of another scene"
    );
}

#[test]
fn occluders_are_made_of_what_is_worth_it() {
    let p = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    let good = [p(0.0, 0.0), p(1.0, 0.0), p(0.0, 1.0)];
    let sliver = [p(0.0, 0.0), p(0.0, 1.0), p(-5e-4, 0.5)];
    let broken = [p(0.0, 0.0), Vec3::NAN, p(0.0, 1.0)];
    let small = [p(1.0, 0.0), p(1.1, 0.0), p(1.0, 0.1)];
    let count = |triangles: &[Triangle], preparation| {
        prepare(triangles, &preparation).map_or(0, |mesh| mesh.triangles().len())
    };
    let all = [good, sliver, broken, small];
    assert_eq!(count(&all, Preparation::default()), 2, "the sliver and the NaN are left out");
    assert_eq!(
        count(&all, Preparation { sliver: 0.0, ..Preparation::default() }),
        3,
        "slivers are kept, the NaN is left out"
    );
    assert_eq!(
        count(&all, Preparation { min_area: 0.5, ..Preparation::default() }),
        1,
        "triangles of at least half a square metre"
    );
    assert_eq!(count(&[broken], Preparation::default()), 0, "no triangle is left");

    let mut scene = Scene::new();
    let bounds = Aabb::from_arrays([-1.0; 3], [2.0; 3]);
    let opaque = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    let glass = scene.insert(bounds);
    for id in [opaque, glass] {
        scene.set_triangles(id, [good]).unwrap();
    }
    assert_eq!(
        scene.prepare_occluders(&Preparation::default()),
        1,
        "occluders prepared: the opaque object's"
    );
    assert!(scene.has_mesh(opaque) && !scene.has_mesh(glass), "the opaque object has a mesh, glass has none");
    assert_eq!(scene.prepare_occluders(&Preparation::default()), 0, "each once");
}

#[test]
fn an_occluder_moves_with_its_transform() {
    let Street { mut scene, wall, .. } = street();
    let away = Vec3::new(0.0, 30.0, 0.0);
    let (mesh, _) = scene.occluder(wall).unwrap();
    let mesh = mesh.clone();
    let mesh = scene.add_mesh(mesh);
    scene.set_mesh(wall, mesh, Affine3A::from_translation(away)).unwrap();
    let old = scene.bounds(wall).unwrap();
    scene.set_bounds(wall, Aabb::new(old.min + away, old.max + away)).unwrap();
    // The wall itself is out of view.
    assert_eq!(visible(&mut pipeline(), &scene, &along_x()).len(), 502, "the wall moved aside hides nothing");
}

#[test]
fn every_hierarchy_gives_the_same_answer() {
    let Street { scene, .. } = street();
    for view in [along_x(), view_from(DVec3::new(3.0, 8.0, 2.0), DVec3::new(14.0, 0.0, 0.0))] {
        let own = visible(&mut pipeline(), &scene, &view);
        for depth in [0, 2, 6] {
            let culler = OcclusionCuller::over(PlainMap::new(96, 60), Octree::new(&scene, depth));
            let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
            assert_eq!(visible(&mut pipeline, &scene, &view), own, "octree of depth {depth}");
        }
    }
}

#[test]
fn objects_that_a_hierarchy_does_not_list_are_visible() {
    let Street { mut scene, .. } = street();
    let octree = Octree::new(&scene, 4);
    let late = scene.insert(Aabb::from_arrays([14.0, -0.1, -0.1], [14.2, 0.1, 0.1]));
    let culler = OcclusionCuller::over(PlainMap::new(96, 60), octree);
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
    assert!(
        visible(&mut pipeline, &scene, &along_x()).contains(&late),
        "the object added after the octree was built"
    );
}

#[test]
fn a_hidden_node_is_not_looked_into() {
    // Thousands of objects behind the wall, far from everything else.
    let Street { mut scene, .. } = street();
    let heap = (0..20_000).map(|i| {
        let min =
            Vec3::new(40.0 + (i % 20) as f32, (i / 20 % 20) as f32 * 0.2 - 2.0, (i / 400) as f32 * 0.1 - 2.0);
        Aabb::new(min, min + 0.05)
    });
    scene.insert_batch(heap.collect::<Vec<_>>());
    let mut pipeline = pipeline();
    let mut set = VisibleSet::new();
    pipeline.cull(&scene, &along_x(), &mut set);
    assert_eq!(set.count(&scene), 3, "objects in view, of 20,503");
    let (_, stats) = pipeline.stages().nth(1).unwrap();
    assert!(stats.tests < 2_000, "{stats:?}: 20,500 boxes are hidden by a few nodes");
}

#[test]
fn at_a_price_of_nothing_nothing_is_drawn() {
    let Street { scene, .. } = street();
    let culler = OcclusionCuller::new(PlainMap::new(96, 60)).with_price(0);
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
    assert_eq!(visible(&mut pipeline, &scene, &along_x()).len(), 503, "nothing is hidden");
    assert_eq!(pipeline.stages().nth(1).unwrap().1.occluders, 0, "occluders drawn");
}

/// A wall of 12 triangles that covers a fiftieth of the view, before three boxes. At a price of 1 it is too
/// expensive, even though as many as 256 objects are taken to wait behind it.
#[test]
fn an_occluder_is_drawn_if_what_it_may_hide_is_worth_its_cost() {
    let mut scene = Scene::new();
    let bounds = Aabb::from_arrays([10.0, -1.0, -1.0], [10.5, 1.0, 1.0]);
    let wall = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
    scene.set_mesh(wall, mesh, Affine3A::IDENTITY).unwrap();
    let behind = |x: f32| Aabb::from_arrays([x, -0.5, -0.5], [x + 0.5, 0.5, 0.5]);
    scene.insert_batch([20.0, 21.0, 22.0].map(behind));
    for (price, left) in [(1, 4), (4, 1), (24, 1), (u32::MAX, 1)] {
        let culler = OcclusionCuller::new(PlainMap::new(96, 60)).with_price(price);
        let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
        assert_eq!(visible(&mut pipeline, &scene, &along_x()).len(), left, "price {price}");
    }
}

#[test]
fn a_box_around_the_eye_or_through_the_near_plane_is_visible() {
    let Street { mut scene, .. } = street();
    let around = scene.insert(Aabb::from_arrays([-5.0; 3], [50.0, 1.0, 1.0]));
    let nan = scene.insert(Aabb::from_arrays([f32::NAN; 3], [1.0; 3]));
    let seen = visible(&mut pipeline(), &scene, &along_x());
    assert!(seen.contains(&around) && seen.contains(&nan), "the box around the eye and the NaN are visible");
}

#[test]
fn an_open_mesh_hides_only_from_its_front_unless_two_sided() {
    let bounds = Aabb::from_arrays([10.0, -4.0, -4.0], [10.0, 4.0, 4.0]);
    let quad =
        [[10.0, -4.0, -4.0], [10.0, 4.0, -4.0], [10.0, 4.0, 4.0], [10.0, -4.0, 4.0]].map(Vec3::from_array);
    for (order, two_sided, hides) in
        [([0, 1, 2, 3], false, false), ([3, 2, 1, 0], false, true), ([0, 1, 2, 3], true, true)]
    {
        let p = order.map(|i: usize| quad[i]);
        let mesh = OccluderMesh::from_triangles(&[[p[0], p[1], p[2]], [p[0], p[2], p[3]]]).unwrap();
        let mut scene = Scene::new();
        let wall = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        let mesh = scene.add_mesh(mesh.with_two_sided(two_sided));
        scene.set_mesh(wall, mesh, Affine3A::IDENTITY).unwrap();
        let behind = scene.insert(Aabb::from_arrays([20.0, -1.0, -1.0], [21.0, 1.0, 1.0]));
        let seen = visible(&mut pipeline(), &scene, &along_x());
        assert_eq!(!seen.contains(&behind), hides, "{order:?}, two-sided {two_sided}");
    }
}

/// A simulated GPU whose query answers arrive some frames late: a plain depth map and a queue of answers.
struct SimulatedCard {
    map: PlainMap,
    /// Occluders that the engine draws itself at the start of each frame.
    own: Vec<OccluderMesh>,
    latency: u32,
    frame: u32,
    view: View,
    under_way: Vec<(u32, u64, bool)>,
    asked: usize,
}

impl SimulatedCard {
    fn new(latency: u32) -> Self {
        Self {
            map: PlainMap::new(96, 60),
            own: Vec::new(),
            latency,
            frame: 0,
            view: along_x(),
            under_way: Vec::new(),
            asked: 0,
        }
    }
}

impl QueryDevice for SimulatedCard {
    fn ask(&mut self, query: u64, bounds: &Aabb) {
        self.map.flush();
        self.asked += 1;
        self.under_way.push((self.frame, query, self.map.test(bounds) != Occlusion::Hidden));
    }

    fn answers(&mut self, each: &mut dyn FnMut(u64, bool)) {
        let (frame, latency) = (self.frame, self.latency);
        self.under_way.retain(|&(asked, query, passed)| {
            let due = frame >= asked + latency;
            if due {
                each(query, passed);
            }
            !due
        });
        // The driver asks for answers once per frame, before it draws anything.
        self.frame += 1;
        self.map.begin(&self.view, DVec3::ZERO);
        self.own.iter().for_each(|mesh| self.map.add(mesh, &Affine3A::IDENTITY));
    }

    fn draw(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        self.map.add(occluder, transform);
    }
}

/// Culls one frame from each eye by late queries alone. Returns, for each frame, the number of objects
/// reported and whether a visible object was missing.
fn by_queries(latency: u32, late: LateAnswers, eyes: &[DVec3]) -> Vec<(usize, bool)> {
    let Street { scene, .. } = street();
    let mut culler = OcclusionCuller::new(HardwareQueries::new(SimulatedCard::new(latency), late));
    let mut visible_set = VisibleSet::new();
    let mut result = Vec::new();
    for &eye in eyes {
        let view = view_from(eye, eye + DVec3::X);
        culler.map_mut().device_mut().view = view;
        visible_set.fill(&scene, &view);
        FrustumCuller::new().cull(&scene, &view, &mut visible_set);
        culler.cull(&scene, &view, &mut visible_set);
        let exact = visible(&mut pipeline(), &scene, &view);
        let lost = exact.iter().any(|&id| !visible_set.contains(&scene, id));
        result.push((visible_set.count(&scene), lost));
    }
    result
}

#[test]
fn late_answers_count_as_visible_until_they_are_there() {
    for latency in [1, 3] {
        let frames = by_queries(latency, LateAnswers::Visible, &[DVec3::ZERO; 24]);
        assert_eq!(frames[0], (503, false), "nothing is answered yet");
        assert_eq!(frames[23], (3, false), "a still camera culls all in the end, latency {latency}");
        assert!(
            frames.windows(2).all(|pair| pair[0].0 >= pair[1].0),
            "latency {latency}: objects visible by frame, never more than before: {frames:?}"
        );
    }
}

#[test]
fn answers_about_other_occluders_do_not_count() {
    let Street { mut scene, wall, .. } = street();
    let map = HardwareQueries::new(SimulatedCard::new(2), LateAnswers::Visible);
    let mut culler = OcclusionCuller::new(map);
    let mut visible = VisibleSet::new();
    let mut frame = |scene: &Scene| {
        visible.fill(scene, &along_x());
        FrustumCuller::new().cull(scene, &along_x(), &mut visible);
        culler.cull(scene, &along_x(), &mut visible);
        visible.count(scene)
    };
    let still = (0..20).map(|_| frame(&scene)).last();
    assert_eq!(still, Some(3), "objects visible after 20 still frames");
    // The wall stops being an occluder between two frames; all known and pending answers are about the
    // old state.
    scene.set_occluder(wall, false).unwrap();
    assert!((0..20).all(|_| frame(&scene) == 503), "the wall's old answers hide objects");
}

/// Tests a change of scene where the engine draws its occluders itself, so that the occluders given to the
/// map do not reveal the change: answers about the old scene must not be used.
#[test]
fn answers_about_another_scene_do_not_count() {
    let Street { mut scene, wall, .. } = street();
    let mut card = SimulatedCard::new(1);
    card.own.push(scene.occluder(wall).unwrap().0.clone());
    scene.set_occluder(wall, false).unwrap();
    let mut culler = OcclusionCuller::new(HardwareQueries::new(card, LateAnswers::Visible));
    let mut visible = VisibleSet::new();
    let mut frame = |scene: &Scene| {
        visible.fill(scene, &along_x());
        FrustumCuller::new().cull(scene, &along_x(), &mut visible);
        culler.cull(scene, &along_x(), &mut visible);
        visible.count(scene)
    };
    assert_eq!((0..20).map(|_| frame(&scene)).last(), Some(3), "objects visible after 20 still frames");
    let copy = scene.clone();
    assert_eq!(frame(&copy), 503, "no answer is about the other scene");
}

#[test]
fn a_prepared_mesh_does_not_outlive_its_triangles() {
    let (mut scene, bounds) = (Scene::new(), Aabb::from_arrays([0.0; 3], [1.0; 3]));
    let triangle = |x: f32| [[Vec3::X * x, Vec3::new(x, 1.0, 0.0), Vec3::new(x, 0.0, 1.0)]];
    let [own, given] = [(); 2].map(|()| {
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        scene.set_triangles(id, triangle(0.0)).unwrap();
        id
    });
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
    scene.set_mesh(given, mesh, Affine3A::IDENTITY).unwrap();
    assert_eq!(
        scene.prepare_occluders(&Preparation::default()),
        1,
        "occluders prepared: the given mesh is kept"
    );
    assert!(scene.occluder(own).is_some(), "the object with triangles alone got a mesh");
    for id in [own, given] {
        scene.set_triangles(id, triangle(0.5)).unwrap();
    }
    assert!(scene.occluder(own).is_none(), "the mesh was made of other triangles");
    assert!(scene.occluder(given).is_some(), "the caller's own");
    assert_eq!(
        scene.prepare_occluders(&Preparation::default()),
        1,
        "occluders prepared after the triangles changed"
    );
    assert_eq!(scene.occluder(own).unwrap().0.bounds().min.x, 0.5, "the mesh is of the new triangles");
}

#[test]
fn a_device_that_loses_queries_is_asked_again() {
    struct Deaf {
        asked: Vec<u64>,
    }
    impl QueryDevice for Deaf {
        fn ask(&mut self, query: u64, _: &Aabb) {
            self.asked.push(query);
        }

        fn answers(&mut self, _: &mut dyn FnMut(u64, bool)) {}
    }
    let mut map = HardwareQueries::new(Deaf { asked: Vec::new() }, LateAnswers::Visible);
    let far = Aabb::from_arrays([20.0, 0.0, 0.0], [21.0, 1.0, 1.0]);
    let at_the_eye = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
    for _ in 0..200 {
        map.begin(&along_x(), DVec3::ZERO);
        map.flush();
        assert_eq!(map.test_mut(&far), Occlusion::Visible, "a query without an answer");
        assert_eq!(map.test_mut(&at_the_eye), Occlusion::Partial, "never asked about");
    }
    let asked = &map.device_mut().asked;
    assert!((3..=5).contains(&asked.len()), "{asked:?}");
    assert!(
        asked.windows(2).all(|pair| pair[0] != pair[1]),
        "late answers to the first are not taken for the second's"
    );
}

#[test]
fn what_a_clip_plane_cuts_hides_nothing() {
    let Street { scene, .. } = street();
    // Clip planes: one that cuts the wall, one that does not touch it.
    let section = |z: f64| along_x().with_clip_planes(&[Plane::new(DVec3::NEG_Z, z)]).unwrap();
    assert_eq!(visible(&mut pipeline(), &scene, &section(0.0)).len(), 503, "cut");
    assert_eq!(visible(&mut pipeline(), &scene, &section(5.0)).len(), 3, "whole");
    let culler = OcclusionCuller::over(PlainMap::new(96, 60), Octree::new(&scene, 4));
    let mut foreign = Pipeline::new().with(FrustumCuller::new()).with(culler);
    assert_eq!(visible(&mut foreign, &scene, &section(0.0)).len(), 503, "cut, octree");
}

#[test]
fn an_orthographic_eye_sees_past_no_wall() {
    let Street { scene, wall, before, beside } = street();
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::orthographic(pose, Window::centered(8.0, 5.0), 0.0, 100.0).unwrap();
    assert_eq!(visible(&mut pipeline(), &scene, &view), [wall, before, beside], "objects seen past the wall");
}

#[test]
fn a_door_that_swings_or_is_mirrored_hides_where_it_is() {
    let Street { mut scene, wall, .. } = street();
    let door = Aabb::from_arrays([0.0, -4.0, -4.0], [0.5, 4.0, 4.0]);
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&door).unwrap());
    scene.set_local_bounds(wall, door).unwrap();
    let hinge = Vec3::new(10.0, 0.0, 0.0);
    for (turn, hides) in [(0.0f32, true), (std::f32::consts::FRAC_PI_2, false), (std::f32::consts::PI, true)]
    {
        for mirror in [1.0f32, -1.0] {
            let turned = Affine3A::from_translation(hinge)
                * Affine3A::from_rotation_z(turn)
                * Affine3A::from_scale(Vec3::new(1.0, mirror, 1.0));
            scene.set_mesh(wall, mesh, turned).unwrap();
            let seen = visible(&mut pipeline(), &scene, &along_x()).len();
            assert_eq!(seen < 50, hides, "turned by {turn}, mirrored {mirror}: {seen}");
        }
    }
    assert_eq!(
        scene.set_mesh(wall, mesh, Affine3A::from_translation(Vec3::NAN)),
        Err(SceneError::Transform(wall)),
        "a transform that is NaN"
    );
}

#[test]
fn an_object_with_the_index_of_one_that_is_gone_is_not_taken_for_it() {
    let Street { mut scene, .. } = street();
    let octree = Octree::new(&scene, 4);
    let gone = scene.ids().nth(100).unwrap();
    scene.remove(gone).unwrap();
    let other = scene.insert(Aabb::from_arrays([5.0, 1.0, 1.0], [5.2, 1.2, 1.2]));
    assert_eq!(other.index(), gone.index(), "the new object takes the index of the old");
    let culler = OcclusionCuller::over(PlainMap::new(96, 60), Stale(octree, gone));
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
    assert!(
        visible(&mut pipeline, &scene, &along_x()).contains(&other),
        "the new object is not listed by the octree, so visible"
    );
}

/// An octree that still lists a removed object, behind the wall.
struct Stale(Octree, ObjectId);

impl BoxHierarchy for Stale {
    fn for_each_child(&self, scene: &Scene, node: Option<usize>, each: &mut dyn FnMut(Child, Aabb)) {
        self.0.for_each_child(scene, node, each);
        if node.is_none() {
            each(Child::Object(self.1), Aabb::from_arrays([14.0, 0.0, 0.0], [14.2, 0.2, 0.2]));
        }
    }
}

#[test]
fn eight_cullers_on_threads_answer_as_one_after_another() {
    let Street { scene, .. } = street();
    let views: Vec<View> = (0..8)
        .map(|i| view_from(DVec3::new(0.0, f64::from(i) - 4.0, 0.5), DVec3::new(12.0, 0.0, 0.0)))
        .collect();
    let alone = |view: &View| visible(&mut pipeline(), &scene, view);
    let expected: Vec<_> = views.iter().map(alone).collect();
    let together: Vec<_> = std::thread::scope(|scope| {
        let running: Vec<_> = views.iter().map(|view| scope.spawn(|| alone(view))).collect();
        running.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert_eq!(together, expected, "objects visible by thread, and alone");
}

#[test]
fn a_moving_camera_loses_nothing_unless_old_answers_are_trusted() {
    let eyes: Vec<DVec3> = (0..40).map(|i| DVec3::new(0.0, f64::from(i) * 0.4, 0.0)).collect();
    let safe = by_queries(2, LateAnswers::Visible, &eyes);
    assert!(safe.iter().all(|(_, lost)| !lost), "frames in which a visible thing is lost: {safe:?}");
    let trusting = by_queries(2, LateAnswers::Trusted { frames: 4 }, &eyes);
    assert!(trusting.iter().any(|(_, lost)| *lost), "what comes into view pops in late");
    let sum = |frames: &[(usize, bool)]| frames.iter().map(|(count, _)| count).sum::<usize>();
    assert!(sum(&trusting) < sum(&safe), "and that is what it gains");
}

/// A map that counts how often the driver asks what an occluder costs, adds one and tests a box.
struct Counting {
    map: PlainMap,
    costs: Cell<u64>,
    added: u64,
    tests: Cell<u64>,
}

impl Counting {
    fn new() -> Self {
        Self { map: PlainMap::new(96, 60), costs: Cell::new(0), added: 0, tests: Cell::new(0) }
    }
}

impl OcclusionMap for Counting {
    fn name(&self) -> &str {
        "counting"
    }

    fn accuracy(&self) -> Accuracy {
        self.map.accuracy()
    }

    fn begin(&mut self, view: &View, origin: DVec3) {
        self.map.begin(view, origin);
    }

    fn cost(&self, occluder: &OccluderMesh) -> usize {
        self.costs.set(self.costs.get() + 1);
        self.map.cost(occluder)
    }

    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        self.added += 1;
        self.map.add(occluder, transform);
    }

    fn flush(&mut self) {
        self.map.flush();
    }

    fn test(&self, bounds: &Aabb) -> Occlusion {
        self.tests.set(self.tests.get() + 1);
        self.map.test(bounds)
    }
}

/// A city of `side` x `side` solid houses, 10 m x 10 m, at 16 m from each other, from x = 0 on.
fn city(side: usize) -> Scene {
    let mut random = Random(7);
    let mut scene = Scene::new();
    let cube = scene.add_mesh(OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [1.0; 3])).unwrap());
    for i in 0..side * side {
        let min = Vec3::new((i / side) as f32 * 16.0, ((i % side) as f32 - side as f32 / 2.0) * 16.0, 0.0);
        let size = Vec3::new(10.0, 10.0, random.range(6.0, 12.0) as f32);
        let house = scene.insert(Object { occluder: true, ..Object::new(Aabb::new(min, min + size)) });
        let place = Affine3A::from_scale_rotation_translation(size, Quat::IDENTITY, min);
        scene.set_mesh(house, cube, place).unwrap();
    }
    scene.rebuild();
    scene
}

/// Culls one frame over a hierarchy. Returns the objects in the frustum, the counters of the driver and what
/// the map counted.
fn count(
    scene: &Scene,
    hierarchy: impl BoxHierarchy,
    eye: DVec3,
    target: DVec3,
) -> (usize, CullStats, Counting) {
    let view = view_from(eye, target);
    let mut visible = VisibleSet::new();
    visible.fill(scene, &view);
    let in_view = FrustumCuller::new().cull(scene, &view, &mut visible).visible as usize;
    let mut culler = OcclusionCuller::over(Counting::new(), hierarchy);
    let stats = culler.cull(scene, &view, &mut visible);
    (in_view, stats, std::mem::replace(culler.map_mut(), Counting::new()))
}

/// In the street the first houses hide the city, whose size must not matter: neither are all occluders in the
/// frustum looked at, nor all boxes tested.
#[test]
fn the_cost_of_a_frame_follows_what_is_seen() {
    let street = (DVec3::new(-8.0, 3.0, 1.7), DVec3::new(100.0, 30.0, 1.7));
    let mut small_tests = 0;
    for (side, least_in_view) in [(40, 700), (600, 150_000)] {
        let scene = city(side);
        let (in_view, stats, map) = count(&scene, SceneHierarchy, street.0, street.1);
        assert!(in_view > least_in_view, "{side}: {in_view} in view are no test");
        assert!(stats.visible < 100, "{side}: {stats:?}");
        assert!(map.costs.get() < 150, "{side}: {} occluders were looked at", map.costs.get());
        assert_eq!(stats.occluders, map.added, "{side}: occluders counted and drawn");
        assert!(map.added < 100, "{side}: {} occluders were drawn", map.added);
        assert_eq!(stats.tests, map.tests.get(), "{side}: tests counted and made");
        small_tests = if small_tests == 0 { stats.tests } else { small_tests };
        assert!(stats.tests < 4 * small_tests, "{side}: {stats:?}, {small_tests} tests in the small city");
    }
}

/// A bird sees all roofs. No occluder hides anything, so only few are tried.
#[test]
fn where_nothing_is_hidden_little_is_drawn() {
    let scene = city(450);
    let (eye, target) = (DVec3::new(-2000.0, 0.0, 5000.0), DVec3::new(3600.0, 0.0, 0.0));
    let (in_view, stats, map) = count(&scene, SceneHierarchy, eye, target);
    assert!(in_view > 150_000, "{in_view} in view are no test");
    assert!(stats.visible as usize * 10 > in_view * 9, "{stats:?}");
    assert!(map.costs.get() < 2_500 && map.added < 250, "{} of {} were drawn", map.added, map.costs.get());
    assert!(stats.tests as usize * 8 < in_view, "{stats:?}: {in_view} objects are not all tested in vain");
}

/// A closed wall of 5,000 triangles across the view, 20 m away.
fn fine_wall() -> OccluderMesh {
    let (columns, rows) = (50, 25);
    let at = |x: f32, column: usize, row: usize| {
        Vec3::new(x, column as f32 / columns as f32 * 60.0 - 30.0, row as f32 / rows as f32 * 40.0 - 20.0)
    };
    let mut triangles: Vec<Triangle> = Vec::new();
    let mut quad = |p: [Vec3; 4]| triangles.extend([[p[0], p[1], p[2]], [p[0], p[2], p[3]]]);
    for column in 0..columns {
        for row in 0..rows {
            let corners = [(0, 0), (0, 1), (1, 1), (1, 0)].map(|(i, j)| (column + i, row + j));
            quad(corners.map(|(i, j)| at(20.0, i, j)));
            let [a, b, c, d] = corners.map(|(i, j)| at(21.0, i, j));
            quad([d, c, b, a]);
        }
    }
    // Sides between the two faces.
    for column in 0..columns {
        let [a, b] = [column, column + 1];
        quad([at(20.0, a, 0), at(20.0, b, 0), at(21.0, b, 0), at(21.0, a, 0)]);
        quad([at(20.0, b, rows), at(20.0, a, rows), at(21.0, a, rows), at(21.0, b, rows)]);
    }
    for row in 0..rows {
        let [a, b] = [row, row + 1];
        quad([at(20.0, 0, b), at(20.0, 0, a), at(21.0, 0, a), at(21.0, 0, b)]);
        quad([at(20.0, columns, a), at(20.0, columns, b), at(21.0, columns, b), at(21.0, columns, a)]);
    }
    OccluderMesh::from_triangles(&triangles).unwrap()
}

/// Makes a scene of a wall of one mesh and `count` objects behind it. Returns it with the number of
/// triangles.
fn behind_one_mesh(count: usize) -> (Scene, usize) {
    let (mut scene, mesh) = (Scene::new(), fine_wall());
    assert!(mesh.is_closed(), "the fine wall is closed");
    let triangles = mesh.triangles().len();
    let wall = scene.insert(Object { occluder: true, ..Object::new(*mesh.bounds()) });
    let mesh = scene.add_mesh(mesh);
    scene.set_mesh(wall, mesh, Affine3A::IDENTITY).unwrap();
    scene.insert_batch((0..count).map(|i| {
        let min =
            Vec3::new(30.0 + (i / 400) as f32, (i % 20) as f32 * 0.5 - 5.0, (i / 20 % 20) as f32 * 0.3 - 3.0);
        Aabb::new(min, min + 0.2)
    }));
    scene.rebuild();
    (scene, triangles)
}

/// No first occluder is too expensive for what is there to hide: a mesh of 5,000 triangles is drawn before
/// 20,000 objects, and not before 200, whose drawing costs less.
#[test]
fn an_expensive_mesh_is_drawn_before_many_objects() {
    for (count, left) in [(20_000, 1), (200, 201)] {
        let (scene, triangles) = behind_one_mesh(count);
        assert!(triangles > 5_000, "{triangles}");
        let seen = visible(&mut pipeline(), &scene, &along_x());
        assert_eq!(seen.len(), left, "{count} objects behind the wall");
    }
}

/// A frame keeps to its limit of work: no occluder that costs more, and no more boxes tested than it pays
/// for.
#[test]
fn a_limit_bounds_the_work_of_a_frame() {
    let (scene, triangles) = behind_one_mesh(20_000);
    for (limit, left) in [(triangles as u32, 20_001), (4 * triangles as u32, 1)] {
        let culler = OcclusionCuller::new(PlainMap::new(96, 60)).with_work_limit(limit);
        let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
        assert_eq!(visible(&mut pipeline, &scene, &along_x()).len(), left, "at most {limit}");
    }
    let city = city(100);
    let view = view_from(DVec3::new(-8.0, 3.0, 40.0), DVec3::new(800.0, 30.0, 0.0));
    let mut last = 0;
    for limit in [0, 50, 500, 5_000] {
        let mut set = VisibleSet::new();
        set.fill(&city, &view);
        FrustumCuller::new().cull(&city, &view, &mut set);
        let mut culler = OcclusionCuller::new(Counting::new()).with_work_limit(limit);
        let stats = culler.cull(&city, &view, &mut set);
        let work = culler.map().added as f64 * 12.0 + culler.map().tests.get() as f64 * 0.1;
        // The last node is tested in full, and the last batch drawn.
        assert!(work <= f64::from(limit) + 20.0, "{work} of {limit}: {stats:?}");
        assert!(stats.tests >= last, "more work is of no use: {stats:?}");
        last = stats.tests;
    }
}

/// A map that takes an occluder for a triangle each, and hides all that is farther than 100 m.
struct Fog {
    added: u32,
}

impl OcclusionMap for Fog {
    fn name(&self) -> &str {
        "fog"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn begin(&mut self, _: &View, _: DVec3) {
        self.added = 0;
    }

    fn cost(&self, _: &OccluderMesh) -> usize {
        1
    }

    fn add(&mut self, _: &OccluderMesh, _: &Affine3A) {
        self.added += 1;
    }

    fn flush(&mut self) {}

    fn test(&self, bounds: &Aabb) -> Occlusion {
        if bounds.min.x > 100.0 { Occlusion::Hidden } else { Occlusion::Visible }
    }
}

/// An occluder takes three triangles of the limit: it is tested again, looked at and drawn. From the 1025th
/// on it takes eight more. A frame's occluders may take half of the limit.
#[test]
fn the_thousandth_occluder_takes_more_of_the_limit_than_the_first() {
    let mut scene = Scene::new();
    let unit = Aabb::from_arrays([0.0; 3], [0.1; 3]);
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&unit).unwrap());
    for i in 0..4000 {
        let min = Vec3::new(20.0, (i % 64) as f32 * 0.15 - 4.8, (i / 64) as f32 * 0.15 - 4.8);
        let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::new(min, min + 0.1)) });
        scene.set_mesh(id, mesh, Affine3A::from_translation(min)).unwrap();
    }
    // What the fog hides pays for all.
    scene.insert_batch((0..4000).map(|i| {
        let y = (i % 64) as f32 - 32.0;
        Aabb::from_arrays([110.0, y, (i / 64) as f32 - 32.0], [111.0, y + 0.5, (i / 64) as f32 - 31.5])
    }));
    scene.rebuild();
    let drawn = |limit: u32| {
        let culler = OcclusionCuller::new(Fog { added: 0 }).with_price(1000);
        let mut culler = culler.with_work_limit(limit);
        let mut set = VisibleSet::new();
        set.fill(&scene, &along_x());
        FrustumCuller::new().cull(&scene, &along_x(), &mut set);
        culler.cull(&scene, &along_x(), &mut set);
        culler.map().added
    };
    // Tests of boxes take some as well.
    assert_eq!(drawn(u32::MAX), 4000, "occluders drawn without a limit");
    assert!((700..=900).contains(&drawn(6 * 900)), "{}", drawn(6 * 900));
    let all = drawn(6 * 1024 + 22 * 1000);
    assert!((1950..=2024).contains(&all), "{all}");
}

/// A map that begins each frame with a wall of its own: what the wall hides is neither offered nor drawn.
#[test]
fn occluders_behind_what_the_map_holds_already_are_not_looked_at() {
    struct Walled(Counting);
    impl OcclusionMap for Walled {
        fn name(&self) -> &str {
            "walled"
        }

        fn accuracy(&self) -> Accuracy {
            self.0.accuracy()
        }

        fn begin(&mut self, view: &View, origin: DVec3) {
            self.0.begin(view, origin);
            let wall = Aabb::from_arrays([-2.0, -90.0, -90.0], [-1.0, 90.0, 90.0]);
            self.0.map.add(&OccluderMesh::cuboid(&wall).unwrap(), &Affine3A::IDENTITY);
        }

        fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
            self.0.add(occluder, transform);
        }

        fn cost(&self, occluder: &OccluderMesh) -> usize {
            self.0.cost(occluder)
        }

        fn flush(&mut self) {
            self.0.flush();
        }

        fn test(&self, bounds: &Aabb) -> Occlusion {
            self.0.test(bounds)
        }
    }
    let scene = city(40);
    let view = view_from(DVec3::new(-8.0, 3.0, 1.7), DVec3::new(100.0, 3.0, 1.7));
    let mut set = VisibleSet::new();
    set.fill(&scene, &view);
    FrustumCuller::new().cull(&scene, &view, &mut set);
    let mut culler = OcclusionCuller::new(Walled(Counting::new()));
    let stats = culler.cull(&scene, &view, &mut set);
    assert_eq!((stats.visible, stats.occluders), (0, 0), "{stats:?}");
    let map = &culler.map().0;
    assert_eq!(
        (map.costs.get(), map.added),
        (0, 0),
        "occluders looked at and drawn behind the map's own wall"
    );
    assert!(stats.tests < 200, "{stats:?}");
}

/// Frames from which nothing is hidden are left out after some, but never for long, and what was left out
/// does not last: where frames pay, all are worked on, with the answers of a new culler.
#[test]
fn frames_that_do_not_pay_are_left_out_for_a_while() {
    let scene = city(100);
    let bird = view_from(DVec3::new(-400.0, 0.0, 1000.0), DVec3::new(800.0, 0.0, 0.0));
    let street = view_from(DVec3::new(-8.0, 3.0, 1.7), DVec3::new(100.0, 30.0, 1.7));
    let mut kept = pipeline();
    let in_view = visible(&mut Pipeline::new().with(FrustumCuller::new()), &scene, &bird);
    let works = |kept: &mut Pipeline, view: &View| {
        let seen = visible(kept, &scene, view);
        (kept.stages().last().unwrap().1.tests > 0, seen)
    };
    let frames: Vec<bool> = (0..300)
        .map(|frame| {
            let (worked, seen) = works(&mut kept, &bird);
            assert!(worked || seen == in_view, "frame {frame} is left out, but {} objects of it", seen.len());
            worked
        })
        .collect();
    assert!(frames[..8].iter().all(|&worked| worked), "frames are left out at once");
    let worked = frames[8..].iter().filter(|&&worked| worked).count();
    assert!((4..40).contains(&worked), "{worked} of 292 frames that do not pay are worked on");
    let left_out = frames.split(|&worked| worked).map(<[bool]>::len).max();
    assert!(left_out.is_some_and(|most| most <= 64), "{left_out:?} frames are left out in a row");

    // A camera that turns by more than 30 degrees sees something else.
    let alone = visible(&mut pipeline(), &scene, &street);
    for frame in 0..20 {
        assert_eq!(works(&mut kept, &street).1, alone, "frame {frame} of the street");
    }
    // One that turns less does not, unless twice as many objects are in view.
    let low = view_from(DVec3::new(400.0, 300.0, 150.0), DVec3::new(580.0, 300.0, 0.0));
    let turned = view_from(DVec3::new(400.0, 300.0, 150.0), DVec3::new(580.0, 380.0, 0.0));
    (0..12).for_each(|_| drop(works(&mut kept, &low)));
    let (worked, seen) = works(&mut kept, &turned);
    assert!(!worked && 2 * seen.len() < in_view.len(), "{} of {} objects", seen.len(), in_view.len());
    assert!(works(&mut kept, &bird).0, "the crowd below the bird is left out");

    (0..12).for_each(|_| drop(works(&mut kept, &bird)));
    assert!(!works(&mut kept, &bird).0, "the bird's frame does not pay, but is worked on");
    kept.reset();
    visible(&mut kept, &scene, &bird);
    assert!(kept.stages().last().unwrap().1.tests > 0, "not forgotten");
}

/// The answer to a view does not depend on the frames before, as long as some pay: backing off within a frame
/// is a matter of that frame.
#[test]
fn the_same_view_has_the_same_answer_after_any_frames() {
    let scene = city(100);
    let views = [
        view_from(DVec3::new(-8.0, 3.0, 1.7), DVec3::new(100.0, 30.0, 1.7)),
        view_from(DVec3::new(-400.0, 0.0, 1000.0), DVec3::new(800.0, 0.0, 0.0)),
        view_from(DVec3::new(500.0, 5.0, 20.0), DVec3::new(900.0, 30.0, 1.7)),
    ];
    let alone = views.map(|view| visible(&mut pipeline(), &scene, &view));
    let mut kept = pipeline();
    for frame in [1, 1, 1, 0, 2, 0, 1, 2] {
        assert_eq!(visible(&mut kept, &scene, &views[frame]), alone[frame], "view {frame}");
    }
}

/// Another hierarchy over the same objects: the nodes differ, what is looked at does not grow.
#[test]
fn over_another_hierarchy_the_cost_follows_what_is_seen_too() {
    let scene = city(200);
    let octree = Octree::new(&scene, 8);
    let (in_view, stats, map) =
        count(&scene, octree, DVec3::new(-8.0, 3.0, 1.7), DVec3::new(100.0, 30.0, 1.7));
    assert!(in_view > 15_000 && stats.visible < 100, "{in_view} in view, {stats:?}");
    assert!(map.costs.get() < 150 && stats.tests < 10_000, "{} looked at, {stats:?}", map.costs.get());
}

/// Sound at every price: an object that a ray from the eye hits first is never hidden.
#[test]
fn what_a_ray_meets_first_is_never_hidden() {
    let mut random = Random(3);
    let (mut hits, mut hidden) = (0, 0);
    for _ in 0..40 {
        let mut scene = Scene::new();
        let cube = scene.add_mesh(OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [1.0; 3])).unwrap());
        let mut boxes = Vec::new();
        for _ in 0..600 {
            let (min, size) = (random.vec3(-30.0, 30.0), random.vec3(0.2, 6.0));
            let bounds = Aabb::new(min, min + size);
            let id = scene.insert(Object { occluder: random.below(3) > 0, ..Object::new(bounds) });
            let place = Affine3A::from_scale_rotation_translation(size, Quat::IDENTITY, min);
            scene.set_mesh(id, cube, place).unwrap();
            boxes.push((id, bounds));
        }
        let eye = random.vector(30.0);
        let target = eye + random.direction();
        let view = view_from(eye, target);
        let exits: Vec<(ObjectId, DVec3)> = boxes
            .iter()
            .filter_map(|(id, bounds)| {
                let corner = |t: f64| bounds.min.as_dvec3().lerp(bounds.max.as_dvec3(), t);
                let [x, y, z] = [(); 3].map(|()| corner(random.range(0.01, 0.99)));
                let point = DVec3::new(x.x, y.y, z.z);
                let clip = view.clip_from(DVec3::ZERO) * point.extend(1.0);
                let in_view = clip.w > 0.2 && clip.x.abs() < clip.w && clip.y.abs() < clip.w;
                let is_first = boxes.iter().all(|other| other.0 == *id || !meets(eye, point, &other.1));
                (in_view && is_first).then_some((*id, point))
            })
            .collect();
        for price in [1, 24, u32::MAX] {
            let culler = OcclusionCuller::new(PlainMap::new(96, 60)).with_price(price);
            let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
            let mut set = VisibleSet::new();
            pipeline.cull(&scene, &view, &mut set);
            for (id, point) in &exits {
                assert!(set.contains(&scene, *id), "price {price}: {point} of {id} is seen from {eye}");
                hits += 1;
            }
            let stats: Vec<_> = pipeline.stages().map(|(_, stats)| stats.visible).collect();
            hidden += stats[0] - stats[1];
        }
    }
    assert!(hits > 1_000 && hidden > 1_000, "{hits} hits and {hidden} hidden are no test");
}

/// Returns whether a segment meets a box that is enlarged by a micrometre.
fn meets(from: DVec3, to: DVec3, bounds: &Aabb) -> bool {
    let (min, max) = (bounds.min.as_dvec3() - 1e-6, bounds.max.as_dvec3() + 1e-6);
    let (a, b) = ((min - from) / (to - from), (max - from) / (to - from));
    a.min(b).max_element().max(0.0) <= a.max(b).min_element().min(1.0)
}
