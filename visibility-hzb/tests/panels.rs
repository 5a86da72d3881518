//! Tests that a wall of panels hides the same objects as a wall of one piece.

use visibility_core::glam::{Affine3A, DVec3, Quat, Vec3};
use visibility_core::scene::Triangle;
use visibility_core::{
    Aabb, FrustumCuller, Object, ObjectId, OccluderMesh, Pipeline, Pose, Scene, View, VisibleSet,
    view::Window,
};
use visibility_hzb::{Hzb, HzbCuller};
use visibility_testing::Random;

/// Returns the scene bounds of an object: the box `bounds`, in the object's own coordinates, under a
/// transform.
fn around(bounds: &Aabb, transform: &Affine3A) -> Aabb {
    Aabb::from_points(bounds.corners().map(|corner| transform.transform_point3(corner)))
}

/// Returns the panels of a wall of 20 x 8 m, each of `size` metres a side.
fn panels(size: f32) -> Vec<Aabb> {
    let [columns, rows] = [20.0 / size, (8.0 / size).max(1.0)].map(|count| count as usize);
    let at = |i: usize| {
        let [y, z] = [size * (i % columns) as f32 - 10.0, size * (i / columns) as f32 - 4.0];
        Aabb::from_arrays([10.0, y, z], [10.2, y + size, (z + size).min(4.0)])
    };
    (0..columns * rows).map(at).collect()
}

fn add_wall(scene: &mut Scene, panels: &[Aabb], transform: Affine3A, is_one_mesh: bool) {
    let mut add = |bounds: &Aabb, mesh: OccluderMesh| {
        let wall = scene.insert(Object { occluder: true, ..Object::new(around(bounds, &transform)) });
        let mesh = scene.add_mesh(mesh);
        scene.set_mesh(wall, mesh, transform).unwrap();
    };
    if is_one_mesh {
        let triangles = |panel: &Aabb| -> Vec<Triangle> {
            let corners = panel.corners();
            OccluderMesh::CUBOID.iter().map(|t| t.map(|i| corners[i as usize])).collect()
        };
        let all: Vec<Triangle> = panels.iter().flat_map(triangles).collect();
        let bounds = panels.iter().fold(panels[0], |all, panel| all.union(panel));
        add(&bounds, OccluderMesh::from_triangles(&all).unwrap());
    } else {
        panels.iter().for_each(|panel| add(panel, OccluderMesh::cuboid(panel).unwrap()));
    }
}

/// Adds 50 boxes of 2 m and 200 boxes of 0.3 m behind the wall, and returns them.
fn add_things(scene: &mut Scene, transform: &Affine3A) -> Vec<ObjectId> {
    let mut random = Random(77);
    let sizes = [2.0_f32; 50].into_iter().chain([0.3; 200]);
    let boxes = sizes.map(|size| {
        let least = [20.0, random.range(-7.0, 5.0) as f32, random.range(-2.5, 0.5) as f32];
        Aabb::from_arrays(least, least.map(|x| x + size))
    });
    boxes.map(|bounds| scene.insert(around(&bounds, transform))).collect()
}

/// Returns the objects reported from a view.
fn seen(scene: &Scene, view: &View) -> Vec<ObjectId> {
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(HzbCuller::new(Hzb::default()));
    let mut visible = VisibleSet::new();
    pipeline.cull(scene, view, &mut visible);
    visible.iter(scene).collect()
}

/// Returns the objects reported from a point `10 + back` metres before the wall.
fn reported(scene: &Scene, transform: &Affine3A, back: f32) -> Vec<ObjectId> {
    let [eye, target] =
        [-back, 10.0].map(|x| transform.transform_point3(Vec3::new(x, 0.13, 0.07)).as_dvec3());
    let view = View::perspective(Pose::look_at(eye, target, DVec3::Z), 1.0, 1.6, 0.1, 100.0).unwrap();
    seen(scene, &view)
}

#[test]
fn a_wall_of_panels_hides_all_that_is_behind_it() {
    let turned = Affine3A::from_rotation_translation(Quat::from_rotation_z(0.7), Vec3::new(1e3, -2e3, 30.0));
    for transform in [Affine3A::IDENTITY, turned] {
        for (size, is_one_mesh) in
            [20.0, 4.0, 2.0, 1.0].into_iter().flat_map(|size| [(size, false), (size, true)])
        {
            for back in [0.0, 15.0] {
                let mut scene = Scene::new();
                add_wall(&mut scene, &panels(size), transform, is_one_mesh);
                let things = add_things(&mut scene, &transform);
                let reported = reported(&scene, &transform, back);
                let shown = things.iter().filter(|thing| reported.contains(thing)).count();
                assert_eq!(shown, 0, "panels of {size} m, one mesh: {is_one_mesh}, {back} m away");
            }
        }
    }
}

/// Tests that a panel which is removed, or whose side is moved by a millimetre, leaves a gap through which
/// objects are visible.
#[test]
fn a_gap_between_panels_hides_nothing() {
    for is_taken_out in [true, false] {
        let mut boxes = panels(1.0);
        let beside_gap = boxes.iter().position(|b| b.contains_point(Vec3::new(10.1, 0.5, 0.5))).unwrap();
        let y = if is_taken_out {
            boxes.remove(beside_gap);
            0.5
        } else {
            boxes[beside_gap].max.y -= 1e-3;
            0.9995
        };
        let mut scene = Scene::new();
        add_wall(&mut scene, &boxes, Affine3A::IDENTITY, false);
        // The eye looks straight through the gap at an object 10 m behind it.
        let eye = Affine3A::from_translation(Vec3::new(0.0, y - 0.13, 0.5 - 0.07));
        let thing_at = |y: f32| Aabb::from_arrays([20.0, y - 0.05, 0.45], [20.1, y + 0.05, 0.55]);
        let [behind, beside] = [y, y - 2.0].map(|y| scene.insert(thing_at(y)));
        let reported = reported(&scene, &eye, 0.0);
        assert!(reported.contains(&behind), "taken out: {is_taken_out}; the thing is visible");
        assert!(!reported.contains(&beside), "taken out: {is_taken_out}; the other panels hide");
    }
}

/// The near plane of a parallel view cuts the first of three boxes in a row. The second still hides the
/// objects behind the row.
#[test]
fn a_row_that_the_near_plane_cuts_hides_from_its_second_box_on() {
    let mut scene = Scene::new();
    let row = [0.0, 1.0, 2.0].map(|x| Aabb::from_arrays([x, -4.0, -4.0], [x + 1.0, 4.0, 4.0]));
    add_wall(&mut scene, &row, Affine3A::IDENTITY, false);
    let behind = scene.insert(Aabb::from_arrays([5.0, -1.0, -1.0], [6.0, 1.0, 1.0]));
    let pose = Pose::look_at(DVec3::new(-2.0, 0.0, 0.0), DVec3::ZERO, DVec3::Z);
    let window = Window { left: -3.0, right: 3.0, bottom: -2.0, top: 2.0 };
    let view = View::orthographic(pose, window, 2.5, 50.0).unwrap();
    assert!(!seen(&scene, &view).contains(&behind), "hidden by two boxes beyond the near plane");
}
