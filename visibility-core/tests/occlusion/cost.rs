//! Tests of the cost of the occlusion driver: how many objects it considers, draws and tests, and in which
//! frames it skips the search for hidden objects.

use super::{Street, along_x, pipeline, street, view_from, visible};
use std::cell::Cell;
use visibility_core::glam::{Affine3A, DVec3, Quat, Vec3};
use visibility_core::occlusion::Occlusion;
use visibility_core::scene::Triangle;
use visibility_core::walk::{BoxHierarchy, SceneHierarchy};
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, FrustumCuller, Object, OccluderMesh, OcclusionCuller, OcclusionMap,
    Pipeline, Scene, View, VisibleSet,
};
use visibility_testing::{Octree, PlainMap, Random};

#[test]
fn at_a_price_of_nothing_nothing_is_drawn() {
    let Street { scene, .. } = street();
    let culler = OcclusionCuller::new(PlainMap::new(96, 60)).with_price(0);
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
    assert_eq!(visible(&mut pipeline, &scene, &along_x()).len(), 503, "nothing is hidden");
    assert_eq!(pipeline.stages().nth(1).unwrap().1.occluders, 0, "occluders drawn");
}

/// A wall of 12 triangles that covers a fiftieth of the view, before three boxes. At a price of one triangle
/// per object, the wall is too expensive, even though 256 objects are assumed behind it.
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

/// From a street, the first houses hide the rest of the city. The cost must not depend on the city's size:
/// the driver considers few occluders and tests few boxes.
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

/// A bird's-eye view of all roofs: no occluder hides anything, so only few are drawn.
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
    // Triangles of the sides between the wall's two faces.
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

/// Even the first occluder may be expensive if enough objects are behind it: a mesh of 5,000 triangles is
/// drawn in front of 20,000 objects, but not of 200, which are cheaper to draw.
#[test]
fn an_expensive_mesh_is_drawn_before_many_objects() {
    for (count, left) in [(20_000, 1), (200, 201)] {
        let (scene, triangles) = behind_one_mesh(count);
        assert!(triangles > 5_000, "{triangles}");
        let seen = visible(&mut pipeline(), &scene, &along_x());
        assert_eq!(seen.len(), left, "{count} objects behind the wall");
    }
}

/// A frame keeps to its limit of work: it draws no occluder that costs more, and tests no more boxes than the
/// limit pays for.
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
        // The limit may be exceeded by the last node tested and the last batch drawn.
        assert!(work <= f64::from(limit) + 20.0, "{work} of {limit}: {stats:?}");
        assert!(stats.tests >= last, "more work is of no use: {stats:?}");
        last = stats.tests;
    }
}

/// A map in which each occluder costs one triangle, and which hides all boxes farther than 100 m.
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

/// An occluder costs three triangles of the limit (tested again, considered, drawn), and eight more from the
/// 1025th on. A frame's occluders may use half of the limit.
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
    // Hiding the objects in the fog is worth the cost of all occluders.
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
    // Tests of boxes count towards the limit too.
    assert_eq!(drawn(u32::MAX), 4000, "occluders drawn without a limit");
    assert!((700..=900).contains(&drawn(6 * 900)), "{}", drawn(6 * 900));
    let all = drawn(6 * 1024 + 22 * 1000);
    assert!((1950..=2024).contains(&all), "{all}");
}

/// A map that begins each frame with a wall of its own: occluders hidden by this wall are neither considered
/// nor drawn.
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

/// Frames whose search finds nothing hidden are skipped after a while, but never many in a row. Once
/// searching pays again, every frame searches, with the answers of a new culler.
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

    // A camera that turns by more than 30 degrees makes the culler search again.
    let alone = visible(&mut pipeline(), &scene, &street);
    for frame in 0..20 {
        assert_eq!(works(&mut kept, &street).1, alone, "frame {frame} of the street");
    }
    // A camera that turns less makes it search again only if twice as many objects are in view.
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

/// The answer for a view does not depend on earlier frames as long as some of them pay: sampling of leaves is
/// decided within each frame.
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

/// Over another hierarchy of the same objects, with other nodes, the driver considers no more objects.
#[test]
fn over_another_hierarchy_the_cost_follows_what_is_seen_too() {
    let scene = city(200);
    let octree = Octree::new(&scene, 8);
    let (in_view, stats, map) =
        count(&scene, octree, DVec3::new(-8.0, 3.0, 1.7), DVec3::new(100.0, 30.0, 1.7));
    assert!(in_view > 15_000 && stats.visible < 100, "{in_view} in view, {stats:?}");
    assert!(map.costs.get() < 150 && stats.tests < 10_000, "{} looked at, {stats:?}", map.costs.get());
}
