//! Naylor's exact culling against an item buffer: no object with a pixel is hidden, and an object reported
//! without a pixel is found in a close-up of its witness.

use crate::shapes;

use std::collections::HashSet;
use visibility_bsp::{BspOrderCuller, NaylorCuller, SceneTree, TraversalStack, VisiblePoint};
use visibility_core::glam::{DMat4, DQuat, DVec3, Mat4, Vec3};
use visibility_core::{
    Aabb, Culler, Object, ObjectId, Pipeline, Pose, Scene, View, VisibleSet,
    scene::{DrawRange, Triangle},
    view::{Depth, Eye, Window},
};
use visibility_measure::{DrawnObject, ItemBuffer};
use visibility_testing::{Random, judged, told_enough};

/// Returns a scene of `count` objects with a few triangles each: random scraps, boxes on a grid, and slanted
/// walls. One in five is no occluder, and every second is one-sided.
fn scene(random: &mut Random, count: usize) -> Scene {
    let mut scene = Scene::new();
    for _ in 0..count {
        let triangles: Vec<Triangle> = match random.below(3) {
            0 => {
                let center = random.fine_vector(9.0);
                let reach = random.fine_range(0.05, 3.0);
                (0..2).map(|_| [(); 3].map(|()| (center + random.fine_vector(reach)).as_vec3())).collect()
            }
            1 => {
                let min = shapes::grid_point(random, 8.0);
                let max = min + shapes::grid_point(random, 2.0).abs() + 1.0;
                let faces = shapes::box_faces(min, max);
                faces.iter().flat_map(|f| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]).map(corners).collect()
            }
            _ => {
                let [p, u, v] =
                    [shapes::grid_point(random, 8.0), random.fine_vector(4.0), random.fine_vector(4.0)];
                [[p, p + u, p + u + v], [p, p + u + v, p + v]].map(corners).into()
            }
        };
        let id = add(&mut scene, &triangles, random.below(5) > 0);
        scene.set_one_sided(id, random.one_in(2)).unwrap();
    }
    scene
}

/// Rounds the corners of a triangle to `f32`, in metres relative to `Scene::origin`.
fn corners(t: [DVec3; 3]) -> Triangle {
    t.map(|v| v.as_vec3())
}

/// Inserts an object with the given triangles and a box around them. `occluder` flags it as opaque. Returns
/// its id.
fn add(scene: &mut Scene, triangles: &[Triangle], occluder: bool) -> ObjectId {
    let bounds = Aabb::from_points(triangles.iter().flatten().copied());
    let id = scene.insert(Object { occluder, ..Object::new(bounds) });
    scene.set_triangles(id, triangles).unwrap();
    id
}

/// Returns the two triangles of a square of half-width `r` metres in the plane at `x`, centred on the x axis.
fn square(x: f32, r: f32) -> [Triangle; 2] {
    let [a, b, c, d] = [(-r, -r), (r, -r), (r, r), (-r, r)].map(|(y, z)| Vec3::new(x, y, z));
    [[a, b, c], [a, c, d]]
}

/// Returns a random view: orthographic, or perspective with a finite or an infinite far distance.
fn view(random: &mut Random) -> View {
    let pose = Pose::look_at(random.fine_vector(12.0), random.fine_vector(6.0), DVec3::Z);
    match random.below(3) {
        0 => View::orthographic(pose, Window { left: -8.0, right: 8.0, bottom: -8.0, top: 8.0 }, 0.0, 40.0)
            .unwrap(),
        1 => View::perspective(pose, 1.2, 1.0, 0.01, 30.0).unwrap(),
        _ => View::perspective(pose, 0.8, 1.0, 0.1, f64::INFINITY).unwrap(),
    }
}

/// Returns the indices of the objects that a culler leaves visible.
fn reported(culler: &mut impl Culler, scene: &Scene, view: &View) -> HashSet<u32> {
    let mut set = VisibleSet::new();
    set.fill(scene, view);
    culler.cull(scene, view, &mut set);
    set.iter(scene).map(|id| id.index() as u32).collect()
}

/// Returns the indices of the objects that have a pixel. Each object that is no occluder is drawn on its own
/// together with all occluders, so that such objects do not hide each other.
fn pixels(buffer: &mut ItemBuffer, scene: &Scene, view: &View) -> HashSet<u32> {
    let opaque = |id: &ObjectId| scene.object(*id).unwrap().occluder;
    let item = |id: ObjectId| DrawnObject::of_scene(scene, id, view).unwrap();
    let walls: Vec<_> = scene.ids().filter(opaque).map(item).collect();
    let mut seen = HashSet::new();
    let mut draw = |glass: Option<ObjectId>| {
        let items = glass.map(item).into_iter().chain(walls.iter().copied());
        let exact = buffer.draw(view, scene.origin(), items).unwrap();
        seen.extend(exact.objects().iter().filter(|o| o.pixels > 0).map(|o| o.key));
    };
    draw(None);
    scene.ids().filter(|id| !opaque(id)).for_each(|id| draw(Some(id)));
    seen
}

/// Tests whether an object is visible in a 63 by 63 pixel image zoomed to its witness. False if the image has
/// no pixel of the object.
fn is_confirmed(scene: &Scene, view: &View, id: ObjectId, witness: VisiblePoint) -> bool {
    let scale = 0.3 / witness.width;
    let zoom = DMat4::from_scale_rotation_translation(
        DVec3::new(scale, scale, 1.0),
        DQuat::IDENTITY,
        DVec3::new(-witness.x * scale, -witness.y * scale, 0.0),
    );
    let close = View::from_clip_from_world(zoom * view.clip_from(scene.origin()), view.depth()).unwrap();
    let mut crop = ItemBuffer::new(63, 63).unwrap();
    let others = scene.ids().filter(|&o| o != id && scene.object(o).unwrap().occluder);
    let items = core::iter::once(id).chain(others).filter_map(|id| DrawnObject::of_scene(scene, id, &close));
    let exact = crop.draw(&close, DVec3::ZERO, items).unwrap();
    exact.objects()[0].is_visible()
}

#[test]
fn what_is_reported_is_what_is_seen() {
    let mut random = Random(21);
    let mut buffer = ItemBuffer::new(512, 512).unwrap();
    let (mut hidden, mut beyond_pixels, mut disputed) = (0, 0, 0);
    for _ in 0..20 {
        let scene = scene(&mut random, 60);
        let tree = SceneTree::new(&scene).unwrap();
        let mut culler = NaylorCuller::new(&tree);
        for _ in 0..4 {
            let view = view(&mut random);
            let reported = reported(&mut culler, &scene, &view);
            let seen = pixels(&mut buffer, &scene, &view);
            let missing: Vec<_> = seen.difference(&reported).collect();
            assert!(missing.is_empty(), "hidden: {missing:?} from {:?}", view.eye(DVec3::ZERO));
            hidden += scene.len() - reported.len();
            for id in scene.ids().filter(|id| reported.contains(&(id.index() as u32))) {
                if !seen.contains(&(id.index() as u32)) {
                    let witness = culler.witness(id).unwrap();
                    beyond_pixels += 1;
                    disputed += usize::from(!is_confirmed(&scene, &view, id, witness));
                }
            }
        }
    }
    judged(hidden as u64);
    told_enough(hidden > 1500, format_args!("objects hidden: {hidden}"));
    assert_eq!(disputed, 0, "of {beyond_pixels}");
}

#[test]
fn glass_hides_nothing_and_what_is_not_known_is_visible() {
    let mut scene = Scene::new();
    let glass = add(&mut scene, &square(2.0, 3.0), false);
    let wall = add(&mut scene, &square(4.0, 3.0), true);
    let behind = add(&mut scene, &square(6.0, 2.0), true);
    let empty = scene.insert(Aabb::from_arrays([7.0, 0.0, 0.0], [7.1, 0.1, 0.1]));
    let broken = add(&mut scene, &[[Vec3::NAN; 3], square(6.0, 1.0)[0]], true);
    scene.set_bounds(broken, Aabb::from_arrays([6.0, -1.0, -1.0], [6.0, 1.0, 1.0])).unwrap();
    let beside = add(&mut scene, &square(-6.0, 1.0), true);
    let tree = SceneTree::new(&scene).unwrap();
    let mut culler = NaylorCuller::new(&tree);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    let ids = |ids: &[ObjectId]| ids.iter().map(|id| id.index() as u32).collect::<HashSet<_>>();
    assert_eq!(
        reported(&mut culler, &scene, &view),
        ids(&[glass, wall, empty, broken]),
        "glass, wall, and what has no known triangles"
    );
    assert!(
        culler.witness(glass).is_some()
            && culler.witness(behind).is_none()
            && culler.witness(empty).is_none(),
        "what is seen has a witness, what is hidden or unknown has none"
    );
    // Two objects in one plane do not hide each other.
    let twin = add(&mut scene, &square(4.0, 3.0), true);
    let tree = SceneTree::new(&scene).unwrap();
    assert_eq!(
        reported(&mut NaylorCuller::new(&tree), &scene, &view),
        ids(&[glass, wall, empty, broken, twin]),
        "two objects in one plane are both seen"
    );
    // An object on a layer that the view does not show hides nothing.
    scene.set_layers(wall, 2).unwrap();
    scene.set_layers(twin, 2).unwrap();
    let tree = SceneTree::new(&scene).unwrap();
    let reported = reported(&mut NaylorCuller::new(&tree), &scene, &view.with_layers(1));
    assert_eq!(reported, ids(&[glass, behind, empty, broken]), "a wall on other layers hides nothing");
    assert!(!reported.contains(&(beside.index() as u32)), "an object out of view is reported");
}

#[test]
fn what_is_never_culled_hides_nothing() {
    let mut scene = Scene::new();
    let wall = add(&mut scene, &square(4.0, 3.0), true);
    add(&mut scene, &square(6.0, 2.0), true);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    for (never_cull, count) in [(false, 1), (true, 2)] {
        scene.set_never_cull(wall, never_cull).unwrap();
        let tree = SceneTree::new(&scene).unwrap();
        let found = reported(&mut NaylorCuller::new(&tree), &scene, &view).len();
        assert_eq!(found, count, "never culled {never_cull}: objects reported");
    }
}

#[test]
fn what_fades_hides_nothing() {
    let mut scene = Scene::new();
    let wall = add(&mut scene, &square(4.0, 3.0), true);
    add(&mut scene, &square(6.0, 2.0), true);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    for (margin, count) in [(0.0, 1), (20.0, 2), (0.0, 1)] {
        scene.set_draw_range(wall, DrawRange { end: 100.0, margin, ..DrawRange::ALWAYS }).unwrap();
        let tree = SceneTree::new(&scene).unwrap();
        let found = reported(&mut NaylorCuller::new(&tree), &scene, &view).len();
        assert_eq!(found, count, "objects reported, with a margin of {margin}");
    }
}

#[test]
fn changes_count_once_they_are_taken_in() {
    let mut scene = Scene::new();
    let wall = add(&mut scene, &square(4.0, 3.0), true);
    let behind = add(&mut scene, &square(6.0, 2.0), true);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    let mut tree = SceneTree::new(&scene).unwrap();
    let both = HashSet::from([wall.index() as u32, behind.index() as u32]);
    assert_eq!(reported(&mut NaylorCuller::new(&tree), &scene, &view).len(), 1, "the wall is seen alone");
    // The wall moves away. It hides nothing at once, even while the tree still contains its old triangles.
    let away = square(20.0, 30.0);
    scene.set_bounds(wall, Aabb::from_points(away.iter().flatten().copied())).unwrap();
    scene.set_triangles(wall, away).unwrap();
    assert_eq!(
        reported(&mut NaylorCuller::new(&tree), &scene, &view),
        both,
        "the wall has moved, and the tree not been told"
    );
    tree.sync(&scene).unwrap();
    assert_eq!(
        reported(&mut NaylorCuller::new(&tree), &scene, &view),
        both,
        "the wall has moved, and the tree been told"
    );
    // The wall moves back.
    scene.set_bounds(wall, Aabb::from_points(square(4.0, 3.0).iter().flatten().copied())).unwrap();
    scene.set_triangles(wall, square(4.0, 3.0)).unwrap();
    assert_eq!(
        reported(&mut NaylorCuller::new(&tree), &scene, &view),
        both,
        "the wall is back, and the tree not been told"
    );
    tree.sync(&scene).unwrap();
    assert_eq!(
        reported(&mut NaylorCuller::new(&tree), &scene, &view),
        HashSet::from([wall.index() as u32]),
        "the wall is back, and the tree been told"
    );
    // The wall is replaced by an object with the same index.
    scene.remove(wall).unwrap();
    let small = add(&mut scene, &square(4.0, 0.5), true);
    assert_eq!(small.index(), wall.index(), "the new object takes the index of the old");
    assert_eq!(
        reported(&mut NaylorCuller::new(&tree), &scene, &view),
        both,
        "a small wall in place of the large one, before the tree is told"
    );
    tree.sync(&scene).unwrap();
    assert_eq!(
        reported(&mut NaylorCuller::new(&tree), &scene, &view),
        both,
        "a small wall in place of the large one"
    );
    assert!(
        reported(&mut BspOrderCuller::new(&tree), &scene, &view) == both,
        "the culler that only orders hides nothing"
    );
    // Nothing is known of another scene, so nothing is hidden.
    let other = scene.clone();
    assert_eq!(
        reported(&mut NaylorCuller::new(&tree), &other, &view),
        both,
        "a copy of the scene is another scene"
    );
}

#[test]
fn synced_and_built_trees_give_the_same_answers() {
    let mut random = Random(22);
    let mut scene = scene(&mut random, 60);
    let mut tree = SceneTree::new(&scene).unwrap();
    let ids: Vec<_> = scene.ids().collect();
    for round in 0..30 {
        if random.one_in(3) {
            let far = 10f64.powf(random.fine_range(2.0, 30.0)) as f32;
            let far = add(&mut scene, &square(far, far), true);
            tree.sync(&scene).unwrap();
            scene.remove(far).unwrap();
        }
        for _ in 0..3 {
            let id = ids[random.below(ids.len())];
            let by = random.fine_vector(3.0).as_vec3();
            let moved: Vec<Triangle> =
                scene.triangles(id).unwrap().iter().map(|t| t.map(|v| v + by)).collect();
            scene.set_bounds(id, Aabb::from_points(moved.iter().flatten().copied())).unwrap();
            scene.set_triangles(id, moved).unwrap();
        }
        tree.sync(&scene).unwrap();
        let fresh = SceneTree::new(&scene).unwrap();
        let view = view(&mut random);
        let mut cullers = [&tree, &fresh].map(NaylorCuller::new);
        let [synced, built] = cullers.each_mut().map(|culler| reported(culler, &scene, &view));
        for &index in synced.symmetric_difference(&built) {
            // Coordinates of moved objects are rounded. Where two of them touch, gaps are about as narrow as
            // the tolerance, and the trees may differ about these gaps.
            let id = scene.ids().find(|id| id.index() == index as usize).unwrap();
            let width = cullers.iter().filter_map(|culler| culler.witness(id)).map(|w| w.width).sum::<f64>();
            assert!(width < 1e-5, "round {round}: object {id}, {width} wide");
        }
        // Every visible object is in view.
        for tree in [&tree, &fresh] {
            let in_view = reported(&mut BspOrderCuller::new(tree), &scene, &view);
            assert!(in_view.is_superset(&synced) && in_view.len() < scene.len(), "round {round}");
        }
    }
}

#[test]
fn objects_come_in_the_order_of_depth() {
    let mut scene = Scene::new();
    for i in 0..50 {
        let x = 2.0 + ((i * 17) % 50) as f32;
        add(&mut scene, &square(x, 0.4 * x), true);
    }
    let tree = SceneTree::new(&scene).unwrap();
    let mut pipeline = Pipeline::new().with(BspOrderCuller::new(Box::new(tree)));
    let mut set = VisibleSet::new();
    let pose = Pose::look_at(DVec3::new(25.5, 0.0, 0.0), DVec3::new(60.0, 0.0, 0.0), DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    pipeline.cull(&scene, &view, &mut set);
    let depths: Vec<f32> = set.iter(&scene).map(|id| scene.bounds(id).unwrap().min.x).collect();
    assert_eq!(
        depths,
        (26..52).map(|x| x as f32).collect::<Vec<_>>(),
        "depths of the objects in order, in metres"
    );
}

#[test]
fn an_order_that_stops_early_hides_nothing_more_and_begins_as_the_whole_one() {
    let mut random = Random(24);
    let scene = scene(&mut random, 150);
    let tree = SceneTree::new(&scene).unwrap();
    let mut stopped = 0;
    for _ in 0..40 {
        let view = view(&mut random);
        let walk = |most: u64| {
            let mut set = VisibleSet::new();
            set.fill(&scene, &view);
            let stats = BspOrderCuller::new(&tree).with_nodes(most).cull(&scene, &view, &mut set);
            (set.iter(&scene).collect::<Vec<_>>(), stats)
        };
        let (whole, all) = walk(u64::MAX);
        for most in [0, 1, 10, all.nodes / 2, all.nodes] {
            let (cut, stats) = walk(most);
            assert!(stats.nodes <= most + 1, "{} nodes visited, at most {most} and the root", stats.nodes);
            assert_eq!(stats.visible as usize, cut.len(), "objects counted and listed");
            let kept: HashSet<ObjectId> = cut.iter().copied().collect();
            assert!(whole.iter().all(|id| kept.contains(id)), "stopping after {most} nodes hides an object");
            stopped += usize::from(cut != whole);
        }
        assert!(walk(all.nodes).0 == whole, "the order with as many nodes as there are");
        // With half of the nodes, the order begins the same.
        let same = walk(all.nodes / 2).0.iter().zip(&whole).take_while(|(a, b)| a == b).count();
        assert!(same * 4 >= whole.len(), "{same} of {}", whole.len());
    }
    assert!(stopped > 100, "{stopped}");
}

#[test]
fn a_flat_world_narrower_than_the_tolerance_hides_only_what_is_covered() {
    // A world only 1e-11 thick relative to its extent in view, seen from within: two boxes beside each other,
    // and one behind the first.
    let block = |x: f64, y: f64| {
        let min = DVec3::new(x, y, 2e-11);
        let faces = shapes::box_faces(min, min + DVec3::new(1.0, 1.0, 3e-11));
        faces.iter().flat_map(|f| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]).map(corners).collect::<Vec<_>>()
    };
    let mut scene = Scene::new();
    let first = add(&mut scene, &block(5.0, -0.5), true);
    let second = add(&mut scene, &block(8.0, 1.0), true);
    // A sliver and a wide triangle of one object; the triangle is hidden.
    let mut mixed = block(9.0, -0.4);
    mixed.push([[20.0, 3.0, 3e-11], [20.0, 5.0, 3e-11], [20.0, 4.0, 4e-11]].map(Vec3::from));
    let third = add(&mut scene, &mixed, true);
    let tree = SceneTree::new(&scene).unwrap();
    for (forward, up) in [(DVec3::X, DVec3::Z), (DVec3::new(1.0, 0.1, 0.0), DVec3::new(0.3, 0.4, 1.0))] {
        let view =
            View::perspective(Pose::look_at(DVec3::ZERO, forward, up), 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
        let found = reported(&mut NaylorCuller::new(&tree), &scene, &view);
        for id in [first, second, third] {
            assert!(found.contains(&(id.index() as u32)), "{id} towards {forward}");
        }
    }
}

#[test]
fn nothing_is_hidden_where_coordinates_are_the_largest_that_there_are() {
    let mut scene = Scene::new();
    let corner = Vec3::new(4.0, 4.0, -4.0);
    let wall = add(&mut scene, &[[Vec3::new(4.0, 2.0, -4.0), Vec3::new(4.0, 4.0, -2.0), corner]], true);
    // Two slivers that extend past everything, behind the wall.
    let slivers = [
        [[2.03, 2.12, -1.918], [2.025, 2.11, -1.92], [2.025, f32::MAX, -1.92]],
        [[2.03, 2.12, -1.918], [-f32::MAX, 2.11, -1.92], [2.025, 2.11, -1.92]],
    ];
    add(&mut scene, &slivers.map(|sliver| sliver.map(Vec3::from)), true);
    let window = Window { left: -2.0, right: 2.0, bottom: -2.0, top: 2.0 };
    let eye = corner.as_dvec3();
    let pose = Pose::look_at(eye, eye + DVec3::new(-4.0, 0.0, 1.0), DVec3::Z);
    let view = View::orthographic(pose, window, 0.0, 40.0).unwrap();
    let mut naylor = NaylorCuller::new(std::sync::Arc::new(SceneTree::new(&scene).unwrap()));
    assert!(
        reported(&mut naylor, &scene, &view).contains(&(wall.index() as u32)),
        "the wall in the eye's corner is reported"
    );
}

#[test]
fn extreme_scenes_and_views_hide_nothing_by_mistake() {
    let mut random = Random(23);
    let values = [0.0f32, 1.0, -1.0, 1e-30, 1e30, -1e30, 3e38, 1e-45, f32::NAN, f32::INFINITY, 5.0];
    for round in 0..200 {
        let mut scene = Scene::new();
        for _ in 0..10 {
            let value = |random: &mut Random| values[random.below(values.len())];
            let triangle: Triangle = [(); 3].map(|()| Vec3::from_array([(); 3].map(|()| value(&mut random))));
            add(&mut scene, &[triangle], true);
        }
        let tree = SceneTree::new(&scene).unwrap();
        let mut views = vec![view(&mut random)];
        for matrix in [Mat4::from_scale(Vec3::splat(1e-30)), Mat4::from_scale(Vec3::splat(1e30))] {
            views.extend(View::from_clip_from_world(matrix, Depth::ZeroToOne));
        }
        for view in views {
            let found = reported(&mut NaylorCuller::new(&tree), &scene, &view);
            reported(&mut BspOrderCuller::new(&tree), &scene, &view);
            for id in scene.ids() {
                if scene.triangles(id).unwrap().iter().flatten().any(|v| !v.is_finite()) {
                    assert!(found.contains(&(id.index() as u32)), "round {round}");
                }
            }
        }
    }
}

/// Ground of squares so small that each triangle is narrower than the tolerance, more than a kilometre away:
/// together they are wider, and are seen. Behind a wall they are hidden.
#[test]
fn triangles_narrower_than_the_tolerance_are_seen_together() {
    let mut scene = Scene::new();
    let tiles: Vec<Triangle> = (0..400)
        .flat_map(|i| {
            let (x, y) = (1500.0 + 0.1 * (i / 20) as f32, 0.1 * (i % 20) as f32 - 1.0);
            let [a, b, c, d] = [(x, y), (x + 0.1, y), (x + 0.1, y + 0.1), (x, y + 0.1)];
            [[a, b, c], [a, c, d]].map(|triangle| triangle.map(|(x, y)| Vec3::new(x, y, -1.7)))
        })
        .collect();
    let ground = add(&mut scene, &tiles, true);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.2, 1.0, 0.1, f64::INFINITY).unwrap();
    let found =
        |scene: &Scene| reported(&mut NaylorCuller::new(SceneTree::new(scene).unwrap()), scene, &view);
    assert!(found(&scene).contains(&(ground.index() as u32)), "the ground, with nothing in front");
    add(&mut scene, &square(50.0, 20.0), true);
    assert_eq!(found(&scene).len(), 1, "the wall alone, which hides all else");
}

#[test]
fn thin_triangles_in_one_plane_do_not_hide_each_other() {
    let mut random = Random(38);
    let orders = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
    let mut drawn = 0;
    for (far, height) in
        [0.0, 1e2, 1e4].into_iter().flat_map(|far| (0..8).map(move |n| (far, 10f64.powi(-n))))
    {
        for _ in 0..200 {
            let origin = random.fine_vector(far);
            let [a, b] = [(); 2].map(|()| random.fine_vector(10.0) + origin);
            let thin = corners([a, b, (a + b) * 0.5 + random.direction() * height]);
            let [p, q, r] = thin.map(|v| v.as_dvec3());
            let normal = (q - p).cross(r - p);
            // The nearer the eye, the wider the image of the triangle. Below 1e-7 of half the image it does
            // not count as seen.
            let distance = (normal.length() / (q - p).length() * 1e5).min(15.0);
            if distance < 1e-2 {
                continue;
            }
            let center = (p + q + r) / 3.0;
            let eye = center + (normal.normalize() + random.fine_vector(0.5)).normalize() * distance;
            let mut scene = Scene::new();
            let twins = [orders[0], random.pick(&orders)]
                .map(|order| add(&mut scene, &[order.map(|i: usize| thin[i])], true));
            let pose = Pose::look_at(eye, center, DVec3::Z);
            let view = View::perspective(pose, 1.2, 1.0, 1e-3, f64::INFINITY).unwrap();
            let mut visible = VisibleSet::new();
            visible.fill(&scene, &view);
            NaylorCuller::new(SceneTree::new(&scene).unwrap()).cull(&scene, &view, &mut visible);
            for twin in twins {
                assert!(visible.contains(&scene, twin), "{thin:?} is hidden by its twin from {eye}");
            }
            drawn += 1;
        }
    }
    assert!(drawn > 3_000, "only {drawn} pairs of triangles were wide enough to be drawn");
}

/// A triangle 1e30 m away comes and goes. While it was there, planes had margins of 1e15 m.
#[test]
fn an_object_far_away_that_has_gone_hides_nothing_nearby() {
    for (far, [front, x]) in [(1e30, [15.0, 20.0]), (1e15, [11.0, 12.0]), (1e12, [10.001, 10.002])] {
        let mut scene = Scene::new();
        let low = [[10.0, 3.0, 0.0], [10.0, 3.2, 0.0], [10.0, 3.0, 0.2]].map(Vec3::from);
        add(&mut scene, &[low], true);
        let [near, _] = square(front, 0.5);
        let near = add(&mut scene, &[near], true);
        let mut tree = SceneTree::new(&scene).unwrap();
        let distant = add(&mut scene, &square(far, 0.1 * far), true);
        tree.sync(&scene).unwrap();
        scene.remove(distant).unwrap();
        tree.sync(&scene).unwrap();
        let cover = [[x, -99.0, -99.0], [x, 99.0, -99.0], [x, 0.0, 99.0]].map(Vec3::from);
        let cover = add(&mut scene, &[cover], true);
        tree.sync(&scene).unwrap();
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
        let indices = |culler: &mut NaylorCuller<&SceneTree>| reported(culler, &scene, &view);
        let seen = indices(&mut NaylorCuller::new(&tree));
        assert!(seen.contains(&(near.index() as u32)), "{far:e}: the object in front is visible: {seen:?}");
        let mut first = None;
        let mut stack = TraversalStack::new();
        tree.tree().front_to_back(Eye::Point(DVec3::ZERO), &mut stack, |mut fragments| {
            let owner = fragments.find(|fragment| fragment.owner() != 0).map(|fragment| fragment.owner());
            first = first.or(owner);
        });
        assert_eq!(first, Some(near.index() as u32), "{far:e}: the object in front comes first");
        tree.tree().for_each_fragment(cover.index() as u32, |fragment| {
            let distance = fragment.plane().signed_distance(DVec3::X * f64::from(x));
            assert!(distance.abs() < 1e-9, "{far:e}: the plane of the object behind is {distance} m off");
        });
    }
}

/// Beyond an oblique near plane, depths beside the image are less than any in the image. The occluder has a
/// corner there, and its image ends beside that of the object.
#[test]
fn corners_beside_an_oblique_near_plane_cover_what_they_cover() {
    let rows = [[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [1.0, 0.9, 0.0, -1.0], [1.0, 0.0, 0.0, 0.0]];
    let matrix = DMat4::from_cols_array_2d(&rows).transpose();
    let view = View::from_clip_from_world(matrix, Depth::ZeroToOneInfinite).unwrap();
    let mut scene = Scene::new();
    add(&mut scene, &[[[2.0, 0.0, 1.8], [0.25, 0.9375, 0.5], [2.0, 0.0, 7.0]].map(Vec3::from)], true);
    let behind = [[10.0, 9.0, 9.5], [10.0, 9.01, 9.5], [10.0, 9.0, 9.51]].map(Vec3::from);
    let behind = add(&mut scene, &[behind], false);
    let found = reported(&mut NaylorCuller::new(SceneTree::new(&scene).unwrap()), &scene, &view);
    assert!(found.contains(&(behind.index() as u32)), "the triangle beside the occluder: {found:?}");
}

/// Surfaces nearer to the near plane than rounding tells, in a world that is 1e5 m wide: what is a tenth of a
/// nanometre before the near plane hides nothing, and what is as much beyond it is seen.
#[test]
fn what_may_be_on_either_side_of_the_near_plane_hides_nothing_and_is_seen() {
    let near = |eye: f64| {
        let eye = DVec3::X * eye;
        View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, f64::INFINITY).unwrap()
    };
    for wall in [square(0.1, 9.0), square(0.1, 9.0).map(|t| [t[0], t[2], t[1]])] {
        let mut scene = Scene::new();
        add(&mut scene, &wall, true);
        let far = add(&mut scene, &square(1e5, 1e4), true);
        let found = reported(&mut NaylorCuller::new(SceneTree::new(&scene).unwrap()), &scene, &near(1.6e-9));
        assert!(found.contains(&(far.index() as u32)), "what is behind a wall before the near plane");
        let found = reported(&mut NaylorCuller::new(SceneTree::new(&scene).unwrap()), &scene, &near(-1e-9));
        assert!(!found.contains(&(far.index() as u32)), "what is behind a wall 2 nm beyond the near plane");
    }
    let mut scene = Scene::new();
    let below = 0.1f32.next_down();
    let tip = [[0.1, 0.0, 0.02], [below, -0.02, -0.02], [below, 0.02, -0.02]].map(Vec3::from);
    let tip = add(&mut scene, &[tip], true);
    add(&mut scene, &square(1e5, 1e4), true);
    let found = reported(&mut NaylorCuller::new(SceneTree::new(&scene).unwrap()), &scene, &near(1.39e-9));
    assert!(found.contains(&(tip.index() as u32)), "a tip beyond the near plane: {found:?}");
}

/// A sheared parallel camera, whose image is known to 5e-9 and whose direction is not: which of two walls
/// comes first is decided by a plane almost along the rays, on the wrong side of which the computed direction
/// is.
#[test]
fn an_eye_less_certain_than_the_image_hides_nothing() {
    let (large, unit) = (f64::from(1 << 27), 1.0 / 1024.0);
    let rows = DMat4::from_cols_array_2d(&[
        [large + 1.0, large, large, 0.0],
        [large, large + 1.0, large, 0.0],
        [0.0, 0.0, 50.0, 0.5],
        [0.0, 0.0, 0.0, 1.0],
    ]);
    let view = View::from_clip_from_world(rows.transpose(), Depth::ZeroToOne).unwrap();
    let triangle = |corners: [[f64; 3]; 3]| corners.map(|p| (DVec3::from(p) * unit).as_vec3());
    let sliver = 0.5_f64.powi(28);
    let mut scene = Scene::new();
    add(&mut scene, &[triangle([[-1.0, 1.0, -sliver], [1.0, -1.0, sliver], [-0.5, 0.0, 0.5]])], false);
    add(&mut scene, &[triangle([[-0.5, -2.0, 3.0], [-0.5, -2.0, 2.0], [-0.5, -0.25, 0.75]])], true);
    let near =
        add(&mut scene, &[triangle([[0.25, -0.5, 0.25], [0.5, -0.5, 0.0], [0.25, -0.25, 0.0]])], false);
    let found = reported(&mut NaylorCuller::new(SceneTree::new(&scene).unwrap()), &scene, &view);
    assert!(found.contains(&(near.index() as u32)), "what is in front of all: {found:?}");
}
