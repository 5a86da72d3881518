//! Tests of the occlusion driver over a plain depth map: what it must hide, what it must not hide, and its
//! cost.

use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{
    Aabb, Accuracy, Culler, FrustumCuller, Object, ObjectId, OccluderMesh, OcclusionCuller, OcclusionMap,
    Pipeline, Pose, Scene, View, VisibleSet,
    geometry::Plane,
    occlusion::{HardwareQueries, LateAnswers, Occlusion, Preparation, QueryDevice, Selection, prepare},
    scene::{SceneError, Triangle},
    view::Window,
    walk::{BoxHierarchy, Child},
};
use visibility_testing::{Octree, PlainMap};

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

fn pipeline(selection: Selection) -> Pipeline {
    let culler = OcclusionCuller::new(PlainMap::new(96, 60)).with_selection(selection);
    Pipeline::new().with(FrustumCuller::new()).with(culler)
}

const SELECTIONS: [Selection; 4] =
    [Selection::SolidAngle, Selection::LastVisible, Selection::Nearest, Selection::Interleaved];

#[test]
fn a_wall_hides_what_is_behind_it_and_nothing_else() {
    let Street { scene, wall, before, beside, .. } = street();
    for selection in SELECTIONS {
        let mut pipeline = pipeline(selection);
        for frame in 0..3 {
            let seen = visible(&mut pipeline, &scene, &along_x());
            assert_eq!(seen, [wall, before, beside], "{selection:?}, frame {frame}");
        }
        assert_eq!(pipeline.accuracy(), Accuracy::Conservative);
    }
}

#[test]
fn a_door_that_opens_hides_nothing() {
    let Street { mut scene, wall, .. } = street();
    for selection in SELECTIONS {
        let mut pipeline = pipeline(selection);
        assert_eq!(visible(&mut pipeline, &scene, &along_x()).len(), 3);
        let before = scene.revision();
        scene.set_occluder(wall, false).unwrap();
        assert!(matches!(scene.changes_since(before), visibility_core::scene::Changes::Objects([_])));
        assert_eq!(visible(&mut pipeline, &scene, &along_x()).len(), 503, "{selection:?}: open");
        scene.set_occluder(wall, true).unwrap();
        assert_eq!(visible(&mut pipeline, &scene, &along_x()).len(), 3, "{selection:?}: shut");
    }
}

#[test]
fn meshes_hide_only_while_their_object_is_flagged() {
    let Street { mut scene, wall, before, .. } = street();
    assert!(scene.occluder(wall).is_some() && scene.occluder(before).is_none());
    scene.set_occluder(wall, false).unwrap();
    assert!(scene.occluder(wall).is_none() && scene.has_mesh(wall));
    let foreign =
        street().scene.add_mesh(OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [1.0; 3])).unwrap());
    assert_eq!(scene.set_mesh(before, foreign, Affine3A::IDENTITY), Err(SceneError::UnknownMesh(foreign)));
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
    assert_eq!(count(&all, Preparation::default()), 2);
    assert_eq!(count(&all, Preparation { sliver: 0.0, ..Preparation::default() }), 3);
    assert_eq!(count(&all, Preparation { least_area: 0.5, ..Preparation::default() }), 1);
    assert_eq!(count(&[broken], Preparation::default()), 0);

    let mut scene = Scene::new();
    let bounds = Aabb::from_arrays([-1.0; 3], [2.0; 3]);
    let opaque = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    let glass = scene.insert(bounds);
    for id in [opaque, glass] {
        scene.set_triangles(id, [good]).unwrap();
    }
    assert_eq!(scene.prepare_occluders(&Preparation::default()), 1);
    assert!(scene.has_mesh(opaque) && !scene.has_mesh(glass));
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
    for selection in SELECTIONS {
        // The wall itself is out of view.
        assert_eq!(visible(&mut pipeline(selection), &scene, &along_x()).len(), 502, "{selection:?}");
    }
}

#[test]
fn every_hierarchy_gives_the_same_answer() {
    let Street { scene, .. } = street();
    for view in [along_x(), view_from(DVec3::new(3.0, 8.0, 2.0), DVec3::new(14.0, 0.0, 0.0))] {
        let own = visible(&mut pipeline(Selection::SolidAngle), &scene, &view);
        for depth in [0, 2, 6] {
            let culler = OcclusionCuller::over(PlainMap::new(96, 60), Octree::new(&scene, depth));
            let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
            assert_eq!(visible(&mut pipeline, &scene, &view), own, "octree of depth {depth}");
        }
        let greene = visible(&mut pipeline(Selection::Interleaved), &scene, &view);
        let culler = OcclusionCuller::over(PlainMap::new(96, 60), Octree::new(&scene, 6));
        let mut foreign =
            Pipeline::new().with(FrustumCuller::new()).with(culler.with_selection(Selection::Interleaved));
        // Occluders are added in different orders, so different hidden objects are found; visible objects
        // must be in every result.
        let foreign = visible(&mut foreign, &scene, &view);
        assert!(own.iter().all(|id| greene.contains(id) && foreign.contains(id)));
    }
}

#[test]
fn objects_that_a_hierarchy_does_not_list_are_visible() {
    let Street { mut scene, .. } = street();
    let octree = Octree::new(&scene, 4);
    let late = scene.insert(Aabb::from_arrays([14.0, -0.1, -0.1], [14.2, 0.1, 0.1]));
    let culler = OcclusionCuller::over(PlainMap::new(96, 60), octree);
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
    assert!(visible(&mut pipeline, &scene, &along_x()).contains(&late));
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
    let mut pipeline = pipeline(Selection::SolidAngle);
    let mut set = VisibleSet::new();
    pipeline.cull(&scene, &along_x(), &mut set);
    assert_eq!(set.count(&scene), 3);
    let (_, stats) = pipeline.stages().nth(1).unwrap();
    assert!(stats.tests < 2_000, "{stats:?}: 20,500 boxes are hidden by a few nodes");
}

#[test]
fn a_budget_of_nothing_hides_nothing() {
    let Street { scene, .. } = street();
    let culler = OcclusionCuller::new(PlainMap::new(96, 60)).with_budget(11);
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
    assert_eq!(visible(&mut pipeline, &scene, &along_x()).len(), 503, "the wall has 12 triangles");
}

/// Tests two walls with a box behind each and a budget of one occluder: the set's order decides which wall is
/// drawn.
#[test]
fn occluders_are_taken_in_the_order_of_the_set() {
    let mut scene = Scene::new();
    let mut side = |y: f32| {
        let bounds = Aabb::from_arrays([10.0, y - 2.0, -2.0], [10.5, y + 2.0, 2.0]);
        let wall = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
        scene.set_mesh(wall, mesh, Affine3A::IDENTITY).unwrap();
        [wall, scene.insert(Aabb::from_arrays([14.0, y - 0.5, -0.5], [15.0, y + 0.5, 0.5]))]
    };
    let sides = [side(-2.5), side(2.5)];
    for first in [0, 1] {
        for budget in [11, 12, 23, 24] {
            let mut culler = OcclusionCuller::new(PlainMap::new(96, 60))
                .with_selection(Selection::Ordered)
                .with_budget(budget);
            let mut visible = VisibleSet::new();
            visible.fill(&scene, &along_x());
            visible.order_first(&scene, &[sides[first][0]]);
            culler.cull(&scene, &along_x(), &mut visible);
            let hidden =
                [sides[first], sides[1 - first]].map(|[_, behind]| !visible.contains(&scene, behind));
            assert_eq!(hidden, [budget >= 12, budget >= 24], "{first} first, {budget} triangles");
        }
    }
}

#[test]
fn a_box_around_the_eye_or_through_the_near_plane_is_visible() {
    let Street { mut scene, .. } = street();
    let around = scene.insert(Aabb::from_arrays([-5.0; 3], [50.0, 1.0, 1.0]));
    let nan = scene.insert(Aabb::from_arrays([f32::NAN; 3], [1.0; 3]));
    for selection in SELECTIONS {
        let seen = visible(&mut pipeline(selection), &scene, &along_x());
        assert!(seen.contains(&around) && seen.contains(&nan), "{selection:?}");
    }
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
        let seen = visible(&mut pipeline(Selection::SolidAngle), &scene, &along_x());
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
        let exact = visible(&mut pipeline(Selection::SolidAngle), &scene, &view);
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
        assert!(frames.windows(2).all(|pair| pair[0].0 >= pair[1].0));
    }
}

#[test]
fn answers_about_other_occluders_do_not_count() {
    for selection in SELECTIONS {
        let Street { mut scene, wall, .. } = street();
        let map = HardwareQueries::new(SimulatedCard::new(2), LateAnswers::Visible);
        let mut culler = OcclusionCuller::new(map).with_selection(selection);
        let mut visible = VisibleSet::new();
        let mut frame = |scene: &Scene| {
            visible.fill(scene, &along_x());
            FrustumCuller::new().cull(scene, &along_x(), &mut visible);
            culler.cull(scene, &along_x(), &mut visible);
            visible.count(scene)
        };
        let still = (0..20).map(|_| frame(&scene)).last();
        if selection != Selection::Interleaved {
            assert_eq!(still, Some(3), "{selection:?}");
        }
        // The wall stops being an occluder between two frames; all known and pending answers are about the
        // old state.
        scene.set_occluder(wall, false).unwrap();
        assert!((0..20).all(|_| frame(&scene) == 503), "{selection:?}");
    }
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
    assert_eq!((0..20).map(|_| frame(&scene)).last(), Some(3));
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
    assert_eq!(scene.prepare_occluders(&Preparation::default()), 1);
    assert!(scene.occluder(own).is_some());
    for id in [own, given] {
        scene.set_triangles(id, triangle(0.5)).unwrap();
    }
    assert!(scene.occluder(own).is_none(), "the mesh was made of other triangles");
    assert!(scene.occluder(given).is_some(), "the caller's own");
    assert_eq!(scene.prepare_occluders(&Preparation::default()), 1);
    assert_eq!(scene.occluder(own).unwrap().0.bounds().min.x, 0.5);
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
        assert_eq!(map.test(&far), Occlusion::Visible);
        assert_eq!(map.test(&at_the_eye), Occlusion::Partial, "never asked about");
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
    for selection in SELECTIONS {
        assert_eq!(visible(&mut pipeline(selection), &scene, &section(0.0)).len(), 503, "{selection:?}: cut");
        assert_eq!(visible(&mut pipeline(selection), &scene, &section(5.0)).len(), 3, "{selection:?}: whole");
        let culler = OcclusionCuller::over(PlainMap::new(96, 60), Octree::new(&scene, 4));
        let mut foreign = Pipeline::new().with(FrustumCuller::new()).with(culler.with_selection(selection));
        assert_eq!(visible(&mut foreign, &scene, &section(0.0)).len(), 503, "{selection:?}: cut, octree");
    }
}

#[test]
fn an_orthographic_eye_sees_past_no_wall() {
    let Street { scene, wall, before, beside } = street();
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::orthographic(pose, Window::centered(8.0, 5.0), 0.0, 100.0).unwrap();
    for selection in SELECTIONS {
        assert_eq!(visible(&mut pipeline(selection), &scene, &view), [wall, before, beside], "{selection:?}");
    }
}

#[test]
fn a_door_that_swings_or_is_mirrored_hides_where_it_is() {
    let Street { mut scene, wall, .. } = street();
    let mesh =
        scene.add_mesh(OccluderMesh::cuboid(&Aabb::from_arrays([0.0, -4.0, -4.0], [0.5, 4.0, 4.0])).unwrap());
    let hinge = Vec3::new(10.0, 0.0, 0.0);
    for (turn, hides) in [(0.0f32, true), (std::f32::consts::FRAC_PI_2, false), (std::f32::consts::PI, true)]
    {
        for mirror in [1.0f32, -1.0] {
            let turned = Affine3A::from_translation(hinge)
                * Affine3A::from_rotation_z(turn)
                * Affine3A::from_scale(Vec3::new(1.0, mirror, 1.0));
            scene.set_mesh(wall, mesh, turned).unwrap();
            let seen = visible(&mut pipeline(Selection::SolidAngle), &scene, &along_x()).len();
            assert_eq!(seen < 50, hides, "turned by {turn}, mirrored {mirror}: {seen}");
        }
    }
    assert_eq!(
        scene.set_mesh(wall, mesh, Affine3A::from_translation(Vec3::NAN)),
        Err(SceneError::NonFiniteTransform(wall))
    );
}

#[test]
fn an_object_with_the_index_of_one_that_is_gone_is_not_taken_for_it() {
    let Street { mut scene, .. } = street();
    let octree = Octree::new(&scene, 4);
    let gone = scene.ids().nth(100).unwrap();
    scene.remove(gone).unwrap();
    let other = scene.insert(Aabb::from_arrays([5.0, 1.0, 1.0], [5.2, 1.2, 1.2]));
    assert_eq!(other.index(), gone.index());
    let culler = OcclusionCuller::over(PlainMap::new(96, 60), Stale(octree, gone));
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
    assert!(visible(&mut pipeline, &scene, &along_x()).contains(&other));
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
    let alone = |view: &View| SELECTIONS.map(|selection| visible(&mut pipeline(selection), &scene, view));
    let expected: Vec<_> = views.iter().map(alone).collect();
    let together: Vec<_> = std::thread::scope(|scope| {
        let running: Vec<_> = views.iter().map(|view| scope.spawn(|| alone(view))).collect();
        running.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert_eq!(together, expected);
}

#[test]
fn a_moving_camera_loses_nothing_unless_old_answers_are_trusted() {
    let eyes: Vec<DVec3> = (0..40).map(|i| DVec3::new(0.0, f64::from(i) * 0.4, 0.0)).collect();
    let safe = by_queries(2, LateAnswers::Visible, &eyes);
    assert!(safe.iter().all(|(_, lost)| !lost));
    let trusting = by_queries(2, LateAnswers::Trusted { frames: 4 }, &eyes);
    assert!(trusting.iter().any(|(_, lost)| *lost), "what comes into view pops in late");
    let sum = |frames: &[(usize, bool)]| frames.iter().map(|(count, _)| count).sum::<usize>();
    assert!(sum(&trusting) < sum(&safe), "and that is what it gains");
}
