//! Tests of the occlusion driver over a plain depth map: what it must hide, and what it must not hide.

mod cost;
mod drawn_depth;
mod late_queries;
mod query_groups;
mod unreliable_card;

use visibility_core::geometry::Plane;
use visibility_core::glam::{Affine3A, DVec3, Quat, Vec3};
use visibility_core::occlusion::{Preparation, prepare};
use visibility_core::scene::{SceneError, Triangle};
use visibility_core::view::Window;
use visibility_core::walk::{BoxHierarchy, Child};
use visibility_core::{
    Aabb, Accuracy, FrustumCuller, Object, ObjectId, OccluderMesh, OcclusionCuller, Pipeline, Pose, Scene,
    View, VisibleSet,
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
        count(&all, Preparation::default().with_sliver(0.0)),
        3,
        "slivers are kept, the NaN is left out"
    );
    assert_eq!(
        count(&all, Preparation::default().with_min_area(0.5)),
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
    // 502 objects are visible: all but the wall, which is out of view.
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
