//! Tests of the objects that a level hides in a scene: behind walls of many pieces, beside doors, and within
//! a limit of work.

use super::{cuboid, level, quad};
use std::sync::Arc;
use visibility_core::geometry::Plane;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::occlusion::{Occlusion, Preparation};
use visibility_core::{
    Aabb, Culler, FrustumCuller, Object, ObjectId, OccluderMesh, OcclusionMap, Pipeline, Pose, Scene, View,
    VisibleSet,
};
use visibility_hzb::{Hzb, HzbCuller};
use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle};

/// Returns the number of `hidden` boxes that a pipeline with a level of `triangles` reports from `view`.
fn reported(triangles: &[LevelTriangle], boxes: &[Aabb], view: &View) -> usize {
    let mut scene = Scene::new();
    let ids: Vec<ObjectId> = scene.insert_batch(boxes.iter().copied());
    let hzb = Hzb::default().with_level(level(triangles, LevelSettings::default()), DVec3::ZERO);
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(HzbCuller::new(hzb));
    let mut visible = VisibleSet::new();
    pipeline.cull(&scene, view, &mut visible);
    ids.iter().filter(|&&id| visible.contains(&scene, id)).count()
}

/// Tests that a wall of closed panels side by side, as modular kits have it, hides the same objects as one
/// wall, whatever the panels' width.
#[test]
fn a_wall_of_panels_hides_what_one_wall_hides() {
    let boxes: Vec<Aabb> = (0..50)
        .map(|i| {
            let middle = Vec3::new(20.0 + (i / 10) as f32 * 4.0, (i % 10) as f32 * 2.0 - 9.0, 0.0);
            Aabb::new(middle - 0.9, middle + 0.9)
        })
        .collect();
    let pose = Pose::look_at(DVec3::new(-5.0, 0.3, 0.2), DVec3::new(10.0, 0.0, 0.0), DVec3::Z);
    let view = View::perspective(pose, 1.2, 16.0 / 9.0, 0.1, f64::INFINITY).unwrap();
    for panels in [1, 2, 5, 16, 40, 80] {
        let width = 40.0 / panels as f32;
        let triangles: Vec<LevelTriangle> = (0..panels)
            .flat_map(|i| {
                let y = i as f32 * width - 20.0;
                cuboid(&Aabb::from_arrays([10.0, y, -10.0], [10.3, y + width, 10.0]), false)
            })
            .map(|corners| LevelTriangle { corners, two_sided: false })
            .collect();
        assert_eq!(reported(&triangles, &boxes, &view), 0, "{panels} panels");
    }
}

/// Seen from the street, a house of one mesh with thick walls hides the objects inside: the far walls of the
/// house do not make any pixel of its front farther. At the corner where three of its sides meet, a pixel
/// stays uncovered, and objects behind that pixel may be reported.
#[test]
fn a_house_of_one_mesh_hides_what_is_in_it() {
    let wall = |low: [f32; 3], high: [f32; 3]| cuboid(&Aabb::from_arrays(low, high), false);
    let walls = [
        wall([0.0, 0.0, 0.0], [8.0, 0.3, 3.0]),
        wall([0.0, 5.7, 0.0], [8.0, 6.0, 3.0]),
        wall([0.0, 0.3, 0.0], [0.3, 5.7, 3.0]),
        wall([7.7, 0.3, 0.0], [8.0, 5.7, 3.0]),
        wall([0.0, 0.0, 3.0], [8.0, 6.0, 3.2]),
    ];
    let triangles: Vec<LevelTriangle> =
        walls.concat().into_iter().map(|corners| LevelTriangle { corners, two_sided: false }).collect();
    let boxes: Vec<Aabb> = (0..20)
        .map(|i| {
            let low = Vec3::new(0.6 + (i % 5) as f32 * 1.4, 0.6 + (i / 5) as f32 * 1.2, 0.1);
            Aabb::new(low, low + Vec3::new(1.0, 1.0, 2.5))
        })
        .collect();
    let eyes = [[4.0, -9.0, 1.7], [-7.0, -5.0, 1.7], [14.0, 3.0, 1.0], [-4.0, 12.0, 6.0]];
    for (eye, most) in eyes.into_iter().zip([0, 0, 0, 6]) {
        let eye = DVec3::from_array(eye);
        let view = View::perspective(
            Pose::look_at(eye, DVec3::new(4.0, 3.0, 1.5), DVec3::Z),
            1.1,
            16.0 / 9.0,
            0.1,
            f64::INFINITY,
        );
        let reported = reported(&triangles, &boxes, &view.unwrap());
        assert!(reported <= most, "from {eye}: {reported} of 20 boxes are reported, expected at most {most}");
    }
}

/// An occluder that a clip plane of the view cuts hides nothing.
#[test]
fn what_a_clip_plane_cuts_hides_nothing() {
    let triangles: Vec<LevelTriangle> = quad([
        Vec3::new(10.0, -20.0, -20.0),
        Vec3::new(10.0, 20.0, -20.0),
        Vec3::new(10.0, 20.0, 20.0),
        Vec3::new(10.0, -20.0, 20.0),
    ])
    .map(|corners| LevelTriangle { corners, two_sided: true })
    .to_vec();
    let boxes = [Aabb::from_arrays([20.0, -1.0, -1.0], [21.0, 1.0, 1.0])];
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    assert_eq!(reported(&triangles, &boxes, &view), 0, "boxes reported behind the uncut wall");
    for (x, count) in [(9.0, 0), (11.0, 1), (10.0, 1)] {
        let plane = Plane::through(DVec3::X * x, DVec3::X);
        let cut = view.with_clip_planes(&[plane]).unwrap();
        assert_eq!(reported(&triangles, &boxes, &cut), count, "cut at {x}");
    }
}

/// With a level, occluders of the scene that are not in the level are drawn too, and those in the level are
/// not drawn again.
#[test]
fn a_door_beside_a_level_is_drawn_and_the_level_is_not_drawn_again() {
    let mut scene = Scene::new();
    let mut add = |bounds: Aabb| {
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        scene.set_triangles(id, cuboid(&bounds, false)).unwrap();
        id
    };
    add(Aabb::from_arrays([10.0, -20.0, -20.0], [10.3, -1.0, 20.0]));
    add(Aabb::from_arrays([10.0, 1.0, -20.0], [10.3, 20.0, 20.0]));
    let door = add(Aabb::from_arrays([10.0, -1.0, -20.0], [10.2, 1.0, 20.0]));
    let behind = scene.insert_batch((0..40).map(|i| {
        let middle = Vec3::new(20.0 + i as f32, (i % 8) as f32 * 0.2 - 0.8, 0.0);
        Aabb::new(middle - 0.1, middle + 0.1)
    }));
    scene.prepare_occluders(&Preparation::default().with_two_sided(true));
    let level = LevelOccluders::of_scene(&scene, |id| id != door, LevelSettings::default()).unwrap();
    assert_eq!(level.objects().len(), 2, "objects of the level: two walls without the door");
    let hzb = Hzb::default().with_level(Arc::new(level), DVec3::ZERO);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(HzbCuller::new(hzb));
    let mut visible = VisibleSet::new();
    for (shut, drawn) in [(true, 1), (false, 0), (true, 1)] {
        scene.set_occluder(door, shut).unwrap();
        pipeline.cull(&scene, &view, &mut visible);
        assert_eq!(pipeline.stages().last().unwrap().1.occluders, drawn, "shut: {shut}");
        let seen = behind.iter().filter(|&&id| visible.contains(&scene, id)).count();
        assert_eq!(seen == 0, shut, "{seen} of 40 objects behind the door are reported");
    }
}

/// A wall of 10 by 10 pixels is drawn if its area is at least the required least area. A NaN least area
/// counts as 0.
#[test]
fn polygons_below_the_least_area_are_not_drawn() {
    let [a, b, c, d] =
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[y, z]| Vec3::new(10.0, y, z));
    let wall = quad([a, b, c, d]).map(|corners| LevelTriangle { corners, two_sided: true });
    let level = level(&wall, LevelSettings::default());
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 2.0 * 0.5f64.atan(), 1.0, 0.1, f64::INFINITY).unwrap();
    for (area, drawn) in [(0.0, true), (95.0, true), (105.0, false), (f32::NAN, true), (-1.0, true)] {
        let mut hzb =
            Hzb::new(50, 50).unwrap().with_level(level.clone(), DVec3::ZERO).with_min_polygon_area(area);
        hzb.begin(&view, DVec3::ZERO);
        hzb.flush();
        let behind = hzb.test(&Aabb::from_arrays([12.0, -0.1, -0.1], [12.2, 0.1, 0.1]));
        assert_eq!(behind == Occlusion::Hidden, drawn, "a least area of {area} pixels");
    }
}

/// A level is drawn nearest first, as far as the work of a frame allows. Clusters that are not drawn hide
/// nothing.
#[test]
fn a_level_is_drawn_as_far_as_its_work_is_paid() {
    let wall = |i: usize| {
        let (x, y) = (10.0 + i as f32 * 5.0, i as f32 * 3.0 - 15.0);
        cuboid(&Aabb::from_arrays([x, y, -1.0], [x + 0.3, y + 2.5, 1.0]), false)
    };
    let triangles: Vec<LevelTriangle> =
        (0..10).flat_map(wall).map(|corners| LevelTriangle { corners, two_sided: true }).collect();
    let level = level(&triangles, LevelSettings::default().with_max_cluster_edges(4));
    let mut hzb = Hzb::default().with_level(level, DVec3::ZERO);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, f64::INFINITY).unwrap();
    let mut covered = |work: f32| {
        let spent = hzb.begin_within(&view, DVec3::ZERO, work, None);
        let pixels = (0..512).flat_map(|x| (0..288).map(move |y| (x, y)));
        let count = pixels.filter(|&(x, y)| hzb.depth_key(x, y) > f32::NEG_INFINITY).count();
        // The limit may be exceeded by the last cluster, here of one face, which is drawn as a whole.
        assert!(spent <= work + 100.0, "{spent} of {work}");
        (count, spent)
    };
    assert_eq!(covered(0.0), (0, 0.0), "nothing is drawn for no work");
    let (all, most) = covered(f32::INFINITY);
    let some: Vec<usize> = (1..5).map(|i| covered(most * i as f32 / 5.0).0).collect();
    assert!(0 < some[0] && some.is_sorted() && some[3] <= all && some[0] < all, "{some:?} of {all}");
}

/// Tests that the z-buffer reports the occluders of a wall of panels, and no longer does once a level joins
/// them.
#[test]
fn seams_are_reported_unless_a_level_closes_them() {
    let mut scene = Scene::new();
    let mut add = |[x, y, z]: [f32; 3], [dx, dy, dz]: [f32; 3]| {
        let bounds = Aabb::from_arrays([x, y, z], [x + dx, y + dy, z + dz]);
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
        scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
    };
    // Twelve panels of a wall, a floor that only touches them, and boxes on the floor: a house, its copy in
    // the same place, a box a hand away, and a wall that stands flush at a right angle.
    (0..12).for_each(|i| add([10.0, (i % 6) as f32 * 2.0, (i / 6) as f32 * 3.0], [0.2, 2.0, 3.0]));
    add([0.0, 0.0, -0.1], [10.2, 12.0, 0.1]);
    add([2.0, 2.0, 0.0], [2.0, 2.0, 3.0]);
    add([2.0, 2.0, 0.0], [2.0, 2.0, 3.0]);
    add([4.1, 2.0, 0.0], [2.0, 2.0, 3.0]);
    add([7.0, 0.0, 0.0], [3.0, 0.2, 6.0]);
    let lacks = |hzb: Hzb| {
        let mut lacks = Vec::new();
        Pipeline::new().with(HzbCuller::new(hzb)).for_each_lack(&scene, |_, lack| lacks.push(lack));
        lacks
    };
    let seams = lacks(Hzb::default());
    assert!(seams.len() == 1 && seams[0].count == 12, "{seams:?}");
    let nothing = level(&[], LevelSettings::default());
    assert_eq!(
        lacks(Hzb::default().with_level(nothing.clone(), DVec3::ZERO)),
        seams,
        "an empty level closes no seam"
    );
    let wall = quad([[0.0, 0.0], [2.0, 0.0], [2.0, 3.0], [0.0, 3.0]].map(|[y, z]| Vec3::new(9.0, y, z)));
    let wall = wall.map(|corners| LevelTriangle { corners, two_sided: true });
    let level = level(&wall, LevelSettings::default());
    assert!(
        lacks(Hzb::default().with_level(level.clone(), DVec3::ZERO)).is_empty(),
        "a level closes the seams"
    );
    let hides_behind_undrawn = |level| {
        let hzb = Hzb::default().with_level(level, DVec3::ZERO);
        HzbCuller::new(hzb).hides_behind_undrawn()
    };
    assert!(!HzbCuller::new(Hzb::default()).hides_behind_undrawn(), "occluders are asked for in the set");
    assert!(!hides_behind_undrawn(nothing.clone()) && hides_behind_undrawn(level.clone()), "a level is not");
    // With a level, a scene without occluders is not reported.
    let lack_of = |hzb: Hzb, scene: &Scene| {
        let mut count = 0;
        hzb.for_each_lack(scene, &mut |_| count += 1);
        count
    };
    let mut bare = Scene::new();
    bare.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
    assert_eq!(lack_of(Hzb::default(), &bare), 1, "the scene lacks occluders");
    assert_eq!(
        lack_of(Hzb::default().with_level(nothing, DVec3::ZERO), &bare),
        1,
        "an empty level is no occluder"
    );
    assert_eq!(
        lack_of(Hzb::default().with_level(level, DVec3::ZERO), &bare),
        0,
        "the level's wall is an occluder"
    );
}
