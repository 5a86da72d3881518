//! Sections of solids as occluders: what they hide, and that they hide nothing from an eye inside a solid, or
//! where a clip plane has cut away the face in front of the section.

use crate::common::{meets, triangles_of};
use std::sync::Arc;
use visibility_bsp::{
    LargeOccludersCuller, Occluders, OcclusionTreeCuller, ShadowFrusta, ShadowFrustaCuller,
};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{
    Aabb, Culler, Object, ObjectId, Pose, Scene, View, VisibleSet,
    geometry::Plane,
    occlusion::Preparation,
    scene::Triangle,
    view::{Eye, Window},
};
use visibility_testing::{Random, judged, told_enough};

/// Creates a scene with `solids` as occluder objects and `others` as boxes that hide nothing, all in metres
/// relative to `Scene::origin`. Returns the ids of `others`.
fn scene_of(solids: &[Aabb], others: &[Aabb]) -> (Scene, Vec<ObjectId>) {
    let mut scene = Scene::new();
    for &bounds in solids {
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        scene.set_triangles(id, triangles_of(&bounds)).unwrap();
    }
    let ids = others.iter().map(|&bounds| scene.insert(bounds)).collect();
    scene.prepare_occluders(&Preparation::default());
    (scene, ids)
}

/// Creates the three cullers of large polygons, with at most `polygons` polygons each.
fn cullers(scene: &Scene, polygons: usize) -> Vec<Box<dyn Culler>> {
    let occluders = Arc::new(Occluders::new(scene));
    let frusta = ShadowFrusta::new(scene, Occluders::clone(&occluders), 8, polygons);
    vec![
        Box::new(OcclusionTreeCuller::new(occluders.clone()).with_polygons(polygons)),
        Box::new(LargeOccludersCuller::new(occluders).with_polygons(polygons)),
        Box::new(ShadowFrustaCuller::new(frusta.into())),
    ]
}

/// Tests whether a culler removes an object from the set of all objects on the view's layers. False if the
/// object stays visible.
fn hides(scene: &Scene, view: &View, culler: &mut dyn Culler, id: ObjectId) -> bool {
    let mut visible = VisibleSet::new();
    visible.fill(scene, view);
    culler.cull(scene, view, &mut visible);
    !visible.contains(scene, id)
}

/// Boxes in metres relative to `Scene::origin`: two storeys of a wall, the slab between them with its edge
/// set back, and a second wall that ends at the first.
const HOUSE: [Aabb; 4] = [
    Aabb::from_arrays([4.0, -5.0, 0.0], [4.25, 5.0, 3.0]),
    Aabb::from_arrays([4.125, -5.0, 3.0], [12.0, 5.0, 3.25]),
    Aabb::from_arrays([4.0, -5.0, 3.25], [4.25, 5.0, 6.0]),
    Aabb::from_arrays([4.125, 5.0, 0.0], [12.0, 5.25, 6.0]),
];

/// Returns a perspective view from `eye` towards `target` with near distance `near`, in metres.
fn towards(eye: DVec3, target: DVec3, near: f64) -> View {
    View::perspective(Pose::look_at(eye, target, DVec3::Z), 2.0, 1.5, near, f64::INFINITY).unwrap()
}

#[test]
fn one_section_hides_what_no_face_does() {
    let behind = Aabb::from_arrays([9.0, -2.0, 0.5], [10.0, 5.1, 4.5]);
    let (scene, ids) = scene_of(&HOUSE, &[behind]);
    let occluders = Occluders::new(&scene);
    let section = [DVec3::new(4.125, -5.0, 0.0), DVec3::new(4.125, 5.25, 6.0)];
    assert!(
        occluders.polygons().any(|p| section.iter().all(|corner| p.contains(corner))),
        "a polygon spans the house's section"
    );
    for eye in [DVec3::new(-4.0, 0.0, 2.0), DVec3::new(-2.0, 3.0, 4.0)] {
        let view = towards(eye, DVec3::new(4.0, 0.0, 3.0), 0.1);
        // The culler by shadow frusta is left out: its polygons are chosen for regions, and no region
        // contains this eye.
        for mut culler in cullers(&scene, 1).into_iter().take(2) {
            assert!(hides(&scene, &view, &mut *culler, ids[0]), "{}", culler.name());
        }
    }
}

#[test]
fn what_is_before_the_section_within_a_solid_is_not_hidden() {
    // The section is in the plane x = 4.125. It replaces the face of the wall in front of it.
    let inside = Aabb::from_arrays([4.05, -1.0, 1.0], [4.1, 1.0, 2.0]);
    let (scene, ids) = scene_of(&HOUSE, &[inside]);
    let view = towards(DVec3::new(-4.0, 0.0, 2.0), DVec3::new(4.0, 0.0, 3.0), 0.1);
    for mut culler in cullers(&scene, 1) {
        let walls: Vec<ObjectId> = scene.ids().take(4).collect();
        for id in walls.into_iter().chain(ids.iter().copied()) {
            assert!(!hides(&scene, &view, &mut *culler, id), "{} hides {id:?}", culler.name());
        }
    }
}

/// Asserts that no culler removes the box `target` in a scene with the occluder boxes `solids`. The view's
/// eye must see the target. Boxes are in metres relative to `Scene::origin`.
fn nothing_hides(solids: &[Aabb], view: &View, target: Aabb) {
    let (scene, ids) = scene_of(solids, &[target]);
    for polygons in [1, 64] {
        for mut culler in cullers(&scene, polygons) {
            assert!(!hides(&scene, view, &mut *culler, ids[0]), "{} of {polygons}", culler.name());
        }
    }
}

#[test]
fn an_eye_inside_a_solid_sees_what_is_in_it() {
    // A slab is set back from the face of a larger box below it. Faces are drawn from outside only, so for an
    // eye inside the box nothing is in front of the target.
    let solids = [
        Aabb::from_arrays([0.0, -5.0, -4.0], [9.0, 5.0, 1.0]),
        Aabb::from_arrays([5.0, -5.0, 1.0], [9.0, 5.0, 5.0]),
    ];
    let target = Aabb::from_arrays([7.0, -0.5, -1.0], [7.5, 0.5, -0.5]);
    nothing_hides(&solids, &towards(DVec3::new(2.0, 0.0, -1.0), DVec3::new(7.0, 0.0, 0.0), 0.1), target);
    // From outside the box, the target is hidden.
    let (scene, ids) = scene_of(&solids, &[target]);
    let view = towards(DVec3::new(-4.0, 0.0, -1.0), DVec3::new(7.0, 0.0, 0.0), 0.1);
    assert!(
        hides(&scene, &view, &mut *cullers(&scene, 64).remove(0), ids[0]),
        "from outside the target is hidden"
    );
}

#[test]
fn a_face_before_the_near_plane_does_not_hide() {
    // The eye is outside, but so close that the near plane cuts the wall's face away along the view; the
    // section behind the face is not cut.
    let target = Aabb::from_arrays([9.0, -0.5, 0.5], [9.5, 0.5, 1.5]);
    let eye = DVec3::new(3.95, 0.0, 1.0);
    let window = Window::centered(3.0, 3.0);
    let pose = Pose::look_at(eye, DVec3::new(9.0, 0.0, 1.0), DVec3::Z);
    nothing_hides(&HOUSE, &towards(eye, DVec3::new(9.0, 0.0, 1.0), 0.1), target);
    nothing_hides(&HOUSE, &View::orthographic(pose, window, 0.1, 50.0).unwrap(), target);
    // A face that is removed by a clip plane of the view does not hide anything either.
    let eye = DVec3::new(0.0, 0.0, 1.0);
    let clip = Plane::new(DVec3::X, -4.06);
    let view = towards(eye, DVec3::new(9.0, 0.0, 1.0), 0.1).with_clip_planes(&[clip]).unwrap();
    nothing_hides(&HOUSE, &view, target);
}

#[test]
fn a_box_without_one_of_its_faces_is_no_solid() {
    let behind = Aabb::from_arrays([9.0, -2.0, 0.5], [10.0, 5.1, 4.5]);
    for left_out in 0..12 {
        let mut scene = Scene::new();
        for (number, bounds) in HOUSE.iter().enumerate() {
            let id = scene.insert(Object { occluder: true, ..Object::new(*bounds) });
            let mut triangles = triangles_of(bounds);
            if number < 3 {
                triangles.remove(left_out);
            }
            scene.set_triangles(id, triangles).unwrap();
        }
        scene.insert(behind);
        scene.prepare_occluders(&Preparation::default());
        let occluders = Occluders::new(&scene);
        let is_section = |p: &[DVec3]| {
            let size = (p[2] - p[0]).abs();
            p[0].x == 4.125 && size.x == 0.0 && size.y > 1.0 && size.z > 1.0
        };
        assert!(!occluders.polygons().any(is_section), "{left_out}");
    }
}

#[test]
fn the_near_plane_counts_even_where_no_polygon_is_cut() {
    // All corners of the section are beyond the near plane, which cuts the wall's face away.
    let solids = [
        Aabb::from_arrays([4.0, -1.0, 0.0], [4.5, 1.0, 1.0]),
        Aabb::from_arrays([4.3, -1.0, 1.0], [9.0, 1.0, 2.0]),
    ];
    let target = Aabb::from_arrays([6.0, -0.2, 0.4], [6.5, 0.2, 0.6]);
    nothing_hides(&solids, &towards(DVec3::new(3.9, 0.0, 0.5), DVec3::new(9.0, 0.0, 0.5), 0.2), target);
}

/// Tests whether the centre of a rectangle is strictly inside one of the boxes `solids`; all in metres
/// relative to `Scene::origin`. False on a boundary.
fn is_inside(polygon: &[DVec3], solids: &[Aabb]) -> bool {
    let middle = (polygon[0] + polygon[2]) * 0.5;
    solids.iter().any(|s| s.min.as_dvec3().cmplt(middle).all() && middle.cmplt(s.max.as_dvec3()).all())
}

/// Tests whether the segment between two points, in metres relative to `Scene::origin`, is blocked by a
/// triangle. Only front faces beyond the near plane block.
fn is_blocked(from: DVec3, to: DVec3, near: &Plane, triangles: &[Triangle]) -> bool {
    triangles.iter().any(|t| {
        let [a, b, c] = t.map(|p| p.as_dvec3());
        let front = (b - a).cross(c - a).dot(to - from) < 0.0;
        front
            && meets(from, to, t).is_some_and(|t| {
                (0.0..=1.0 + 1e-9).contains(&t) && near.signed_distance(from + (to - from) * t) >= -1e-9
            })
    })
}

#[test]
fn hidden_boxes_among_solids_cannot_be_seen_from_outside_or_inside() {
    let mut random = Random(19);
    let (mut rays, mut sections) = (0, 0);
    for _ in 0..60 {
        let mut solids: Vec<Aabb> = Vec::new();
        for _ in 0..14 {
            // Multiples of one half, so that many solids abut, overlap, or have faces in one plane.
            let half = |p: DVec3| (p * 2.0).round().as_vec3() * 0.5;
            let at = half(random.fine_vector(4.0));
            let mut size = half(random.fine_vector(3.5)).abs() + Vec3::splat(0.5);
            size[random.below(3)] = [0.5, 1.0][random.below(2)];
            solids.push(Aabb::new(at, at + size));
        }
        let others: Vec<Aabb> = (0..200)
            .map(|_| {
                let min = random.fine_vector(7.0).as_vec3();
                Aabb::new(min, min + random.fine_vector(0.3).abs().as_vec3())
            })
            .collect();
        let (scene, ids) = scene_of(&solids, &others);
        let triangles: Vec<Triangle> = solids.iter().flat_map(triangles_of).collect();
        sections += Occluders::new(&scene).polygons().filter(|p| is_inside(p, &solids)).count();
        for frame in 0..10 {
            let solid = solids[random.below(solids.len())];
            let share = DVec3::new(random.fine_unit(), random.fine_unit(), random.fine_unit());
            let eye = match frame % 3 {
                // The eye is in a solid, close in front of one, or anywhere.
                0 => solid.min.as_dvec3() + (solid.max - solid.min).as_dvec3() * share,
                1 => {
                    let mut p = solid.min.as_dvec3() + (solid.max - solid.min).as_dvec3() * share;
                    let axis = random.below(3);
                    p[axis] = f64::from(solid.min[axis]) - random.fine_range(0.0, 0.4);
                    p
                }
                _ => random.fine_vector(9.0),
            };
            let pose = Pose::look_at(eye, eye + random.fine_vector(1.0), DVec3::new(0.1, 0.2, 1.0));
            let near = [0.01, 0.3, 0.6][random.below(3)];
            let view = if frame == 9 {
                View::orthographic(pose, Window::centered(9.0, 9.0), near, 60.0).unwrap()
            } else {
                View::perspective(pose, 1.5, 1.3, near, f64::INFINITY).unwrap()
            };
            let planes = view.planes(scene.origin());
            for mut culler in cullers(&scene, 48) {
                let mut visible = VisibleSet::new();
                visible.fill(&scene, &view);
                culler.cull(&scene, &view, &mut visible);
                for (&id, bounds) in ids.iter().zip(&others) {
                    if visible.contains(&scene, id) {
                        continue;
                    }
                    for corner in bounds.corners() {
                        let p = corner.as_dvec3();
                        let inside = |plane: &Plane| plane.signed_distance(p) > 1e-6;
                        if !planes.as_slice().iter().all(|side| inside(&side.plane)) {
                            continue;
                        }
                        let from = match view.eye(scene.origin()) {
                            Eye::Point(eye) => eye,
                            Eye::Direction(along) => p - along * 100.0,
                        };
                        rays += 1;
                        assert!(
                            is_blocked(from, p, &planes.as_slice()[4].plane, &triangles),
                            "{}: {p} is seen from {from} past {solids:?} in {view:?}",
                            culler.name()
                        );
                    }
                }
            }
        }
    }
    judged(rays as u64);
    told_enough(rays > 100_000 && sections > 200, format_args!("{rays} rays, {sections} sections"));
}
