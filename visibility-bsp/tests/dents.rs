//! Patches whose surface leaves the plane of their outline by what counts as flat, and meshes whose placed
//! vertices are rounded: an object in the dent, or beside the true edge, must not be hidden.

use crate::common::meets;
use crate::rims::cullers;
use visibility_bsp::OcclusionTree;
use visibility_core::glam::{Affine3A, DVec3, Mat3, Vec3};
use visibility_core::{
    Aabb, Object, ObjectId, OccluderMesh, OcclusionMap, Pose, Scene, View, VisibleSet,
    geometry::Plane,
    occlusion::{Occlusion, Preparation},
    scene::Triangle,
    view::{Eye, Window},
};
use visibility_testing::{Random, judged, told_enough};

/// Returns a scene of four one-sided triangles around a hub, seen counter-clockwise, and the boxes of
/// objects, each rotated by `placed`. The rim is the square of half-width 500 m at z = 0, the hub is at
/// height `hub` over its centre.
fn fan(hub: f32, boxes: &[Aabb], placed: Mat3) -> (Scene, Vec<ObjectId>) {
    let rim = [[500.0, 500.0], [-500.0, 500.0], [-500.0, -500.0], [500.0, -500.0]];
    let [a, b, c, d] = rim.map(|[x, y]| placed * Vec3::new(x, y, 0.0));
    let v = placed * Vec3::new(0.0, 0.0, hub);
    let triangles = [[a, b, v], [b, c, v], [c, d, v], [d, a, v]];
    let mut scene = Scene::new();
    let ground = Aabb::from_points(triangles.iter().flatten().copied());
    let ground = scene.insert(Object { occluder: true, ..Object::new(ground) });
    scene.set_triangles(ground, triangles).unwrap();
    scene.set_one_sided(ground, true).unwrap();
    let moved = |bounds: &Aabb| Aabb::from_points(bounds.corners().map(|p| placed * p));
    let ids = boxes.iter().map(|bounds| scene.insert(moved(bounds))).collect();
    // Regions of eyes reach up to it.
    scene.insert(moved(&slab(1.0, 5.0, 6.0)));
    scene.prepare_occluders(&Preparation::default().with_sliver(0.0));
    (scene, ids)
}

/// Asserts that no culler hides the objects `shown`, and that all of them hide the objects `hidden`.
fn assert_answers(scene: &Scene, view: &View, shown: &[ObjectId], hidden: &[ObjectId], what: &str) {
    for culler in &mut cullers(scene) {
        let mut visible = VisibleSet::new();
        visible.fill(scene, view);
        culler.cull(scene, view, &mut visible);
        let name = culler.name();
        let is_visible = |&id: &ObjectId| visible.contains(scene, id);
        assert!(shown.iter().all(is_visible), "{what}, {name}: {shown:?} are visible");
        assert!(!hidden.iter().any(is_visible), "{what}, {name}: {hidden:?} are hidden");
    }
}

/// Returns a box of half-width `half` around (x, y) = (0, 0) between two heights.
fn slab(half: f32, low: f32, high: f32) -> Aabb {
    Aabb::from_arrays([-half, -half, low], [half, half, high])
}

/// Returns a perspective view from `eye` along `to`, with the near plane at `near` metres.
fn view(eye: DVec3, to: DVec3, near: f64) -> View {
    View::perspective(Pose::look_at(eye, eye + to, DVec3::new(0.1, 0.9, 0.3)), 1.0, 1.0, near, f64::INFINITY)
        .unwrap()
}

#[test]
fn what_lies_in_the_dent_of_a_fan_is_not_hidden() {
    // Above the surface and below the plane of the rim; and far below both.
    let boxes = [slab(1.0, -0.0005, -0.0003), slab(1.0, -3.0, -2.0)];
    for placed in [Mat3::IDENTITY, Mat3::from_cols(Vec3::Z, Vec3::X, Vec3::Y)] {
        let (scene, ids) = fan(-0.0008, &boxes, placed);
        let at = |p: Vec3| (placed * p).as_dvec3();
        let from = view(at(2.0 * Vec3::Z), at(Vec3::NEG_Z), 0.1);
        assert_answers(&scene, &from, &ids[..1], &ids[1..], "dent");
    }
}

#[test]
fn what_is_seen_through_a_bump_before_the_near_plane_is_not_hidden() {
    let (scene, ids) = fan(0.0008, &[slab(0.01, -1.0, -0.5)], Mat3::IDENTITY);
    // The near plane is at a height of 0.4 mm: all of the rim is beyond it, and the bump is cut off.
    let pose = Pose::look_at(0.1004 * DVec3::Z, DVec3::ZERO, DVec3::Y);
    let from = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    assert_answers(&scene, &from, &ids, &[], "bump before the near plane");
    let from = View::orthographic(pose, Window::centered(1.0, 1.0), 0.1, 100.0).unwrap();
    assert_answers(&scene, &from, &ids, &[], "bump before the near plane of a parallel view");
    // The eye is 0.1 mm over the bump, and the near plane stands on the hub: a view ray that passes over the
    // cut rim has entered the bump before.
    let (scene, ids) =
        fan(0.0008, &[Aabb::from_arrays([-0.01, 1.0, -0.008], [0.01, 1.1, -0.006])], Mat3::IDENTITY);
    let from = view(DVec3::new(0.0, -0.1, 0.0009), DVec3::Y, 0.1);
    assert_answers(&scene, &from, &ids, &[], "bump across the near plane");
    // A clip plane cuts the bump off, or passes above it.
    let (scene, ids) = fan(0.0008, &[slab(0.01, -1.0, -0.5)], Mat3::IDENTITY);
    let from = view(2.0 * DVec3::Z, DVec3::NEG_Z, 0.1);
    // Clip planes are relative to the eye.
    let below = |z| from.with_clip_planes(&[Plane::new(DVec3::NEG_Z, z - 2.0)]).unwrap();
    assert_answers(&scene, &below(0.0004), &ids, &[], "bump behind a clip plane");
    assert_answers(&scene, &below(0.001), &[], &ids, "bump before a clip plane");
}

#[test]
fn what_is_beside_the_true_edge_of_a_placed_mesh_is_not_hidden() {
    // The transform takes y = 1,000,000 to a hundredth: f64 rounds that by up to 5.8e-11 m.
    let (stretch, shear) = (0.8f32, 1e-5f32);
    let mut cases = 0;
    for number in 0..200 {
        let z = [-5.0 - 0.01 * number as f32, 5.0 + 0.013 * number as f32];
        // Differences of products that f64 holds exactly.
        let exact = z.map(|z| f64::from(stretch) * 1e6 - 8e5 + f64::from(shear) * f64::from(z));
        let rounded = z.map(|z| f64::from(stretch) * 1e6 + f64::from(shear) * f64::from(z) - 8e5);
        let off = [rounded[0] - exact[0], rounded[1] - exact[1]];
        let Some(least) = (off[0] * off[1] > 0.0).then(|| off[0].abs().min(off[1].abs())) else { continue };
        if least < 1e-11 {
            continue;
        }
        cases += 1;
        let sign = off[0].signum();
        // The wall is on the side of the true edge that the rounded edge is not on.
        let other = if sign > 0.0 { 999_875.0 } else { 1_000_125.0 };
        let [a, b, c, d] =
            [(other, z[0]), (1e6, z[0]), (1e6, z[1]), (other, z[1])].map(|(y, z)| Vec3::new(10.0, y, z));
        let mesh = OccluderMesh::from_triangles(&[[a, b, c], [a, c, d]]).unwrap().with_two_sided(true);
        let place = Affine3A::from_mat3_translation(
            Mat3::from_cols(Vec3::X, stretch * Vec3::Y, Vec3::new(0.0, shear, 1.0)),
            Vec3::new(0.0, -800_000.0, 0.0),
        );
        // A point behind the wall's edge, seen from an eye that is halfway to it as far from the wall as the
        // point: their line passes the true edge at half the rounding.
        let point = Vec3::new(20.0, exact[0] as f32, 0.25);
        let share = (0.125 - f64::from(z[0])) / f64::from(z[1] - z[0]);
        let edge = exact[0] + share * (exact[1] - exact[0]);
        let eye = DVec3::new(0.0, 2.0 * (edge + 0.5 * sign * least) - f64::from(point.y), 0.0);
        let from = view(eye, DVec3::X, 0.1);
        let bounds = Aabb::from_points([point]);
        let inside = Aabb::from_points([point - sign as f32 * Vec3::Y]);
        let mut tree = OcclusionTree::new();
        tree.begin(&from, DVec3::ZERO);
        tree.add(&mesh, &place);
        tree.flush();
        assert!(tree.test(&bounds) != Occlusion::Hidden, "tree: {point} is beside the edge from {eye}");
        assert_eq!(tree.test(&inside), Occlusion::Hidden, "tree: a point behind the wall");
        let mut scene = Scene::new();
        let wall = Aabb::from_arrays([9.0, -200.0, -20.0], [11.0, 200.0, 20.0]);
        let wall = scene.insert(Object { occluder: true, ..Object::new(wall) });
        let mesh = scene.add_mesh(mesh);
        scene.set_mesh(wall, mesh, place).unwrap();
        let ids = [scene.insert(bounds), scene.insert(inside)];
        assert_answers(&scene, &from, &ids[..1], &ids[1..], "beside the edge of a placed mesh");
    }
    assert!(cases > 20, "walls whose edge is rounded to the wrong side: {cases}");
}

/// The two triangles of a quadrilateral `[w, a, f, b]` that is flat but for the corners `a` and `b`, by less
/// than a millionth of its length, seen counter-clockwise from above.
fn quadrilateral([w, a, f, b]: [Vec3; 4]) -> [Triangle; 2] {
    [[w, a, f], [w, f, b]]
}

/// Returns a scene of a one-sided quadrilateral and the boxes of objects.
fn uneven(corners: [Vec3; 4], boxes: &[Aabb]) -> (Scene, Vec<ObjectId>) {
    let mut scene = Scene::new();
    let ground = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_points(corners)) });
    scene.set_triangles(ground, quadrilateral(corners)).unwrap();
    scene.set_one_sided(ground, true).unwrap();
    let ids = boxes.iter().map(|&bounds| scene.insert(bounds)).collect();
    // Regions of eyes reach up to it.
    scene.insert(slab(1.0, 5.0, 6.0));
    scene.prepare_occluders(&Preparation::default().with_sliver(0.0));
    (scene, ids)
}

/// Seen along the plane of its corners `w`, `f` and the mean of all, the two others are below: the outline
/// winds around nothing.
#[test]
fn what_is_under_a_quadrilateral_that_is_seen_edge_on_is_not_hidden() {
    let low = Aabb::from_arrays([5.0, -0.5, -3.0], [6.0, 0.5, -2.0]);
    let corners = [[1.0, 0.0, 0.0], [1.5, -1.0, -1.8e-6], [3.0, 0.0, 0.0], [1.5, 1.0, -1.8e-6]];
    let (scene, ids) = uneven(corners.map(Vec3::from), &[low]);
    let eye = DVec3::new(-20.0, 0.0, 0.0);
    let pose = Pose::look_at(eye, eye + DVec3::new(1.0, 0.0, -0.9e-6), DVec3::Z);
    let from = View::orthographic(pose, Window::centered(20.0, 20.0), 0.0, 100.0).unwrap();
    assert_answers(&scene, &from, &ids, &[], "parallel view");
    let far = corners.map(|corner| 1000.0 * Vec3::from(corner));
    let (scene, ids) = uneven(far, &[low]);
    let pose = Pose::look_at(DVec3::new(0.0, 0.0, 0.0009), DVec3::new(1.0, 0.0, 0.0009), DVec3::Z);
    let from = View::perspective(pose, 2.0, 1.0, 1e-4, f64::INFINITY).unwrap();
    assert_answers(&scene, &from, &ids, &[], "perspective view");
}

/// The near plane cuts off all corners but `f`. The corner `w` is nearer than the two beside it, which are
/// lower: a ray over the cut may pass below `w`.
#[test]
fn what_is_seen_under_the_near_end_of_an_uneven_quadrilateral_is_not_hidden() {
    let corners = [
        [0.105_828_6, 0.0, 0.0],
        [0.108_023_06, -0.180_964_48, -0.000_368_551_76],
        [428.858_34, 0.0, 0.0],
        [0.108_727_33, 0.180_964_48, -0.000_338_338_96],
    ];
    let seen = Aabb::from_points([Vec3::new(0.553_919_14, -0.000_322_283_62, -0.005_491_297_7)]);
    let (scene, ids) = uneven(corners.map(Vec3::from), &[seen]);
    let eye = DVec3::new(0.0, 0.0, 0.001_183_174_061_825_197);
    let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
    let from = View::perspective(pose, 2.0, 1.0, 0.066_327_762, f64::INFINITY).unwrap();
    assert_answers(&scene, &from, &ids, &[], "under the near end");
    let mut tree = OcclusionTree::new();
    tree.begin(&from, DVec3::ZERO);
    let mesh = OccluderMesh::from_triangles(&quadrilateral(corners.map(Vec3::from))).unwrap();
    tree.add(&mesh, &Affine3A::IDENTITY);
    tree.flush();
    assert_ne!(tree.test(&seen), Occlusion::Hidden, "under the near end, tree of meshes");
}

/// Quadrilaterals that are uneven by up to a millionth of their length, of which the near plane cuts off
/// any corners, with points close to the lines of sight to their corners and cut edges.
#[test]
fn points_that_are_seen_past_uneven_quadrilaterals_are_not_hidden() {
    let mut random = Random(41);
    let (mut hidden, mut shown) = (0, 0);
    for _ in 0..6_000 {
        let long = 10f64.powf(random.fine_range(1.0, 4.0));
        let near = 10f64.powf(random.fine_range(-3.0, -0.5));
        // The near plane's function at which a cut is made, as a distance; corners are on both sides of it.
        let cut = 1e-4 * long;
        let at = |random: &mut Random, y: f64| {
            let share = [1.0, 0.99, 1.01, 3.0][random.below(4)] * random.fine_range(0.9, 1.0);
            [near + cut * share, y, -0.9e-6 * long * [0.0, 1.0, random.fine_unit()][random.below(3)]]
        };
        let side = random.fine_range(0.3, 3.0) * (near + cut);
        let (w, a, b) = (at(&mut random, 0.0), at(&mut random, -side), at(&mut random, side));
        let corners = [w, a, [long, 0.0, 0.0], b].map(|corner| DVec3::from(corner).as_vec3());
        let height = 10f64.powf(random.fine_range(-6.0, -3.0)) * long;
        let pose = Pose::look_at(DVec3::new(0.0, 0.0, height), DVec3::new(1.0, 0.0, height), DVec3::Z);
        let view = if random.one_in(3) {
            View::orthographic(pose, Window::centered(4.0 * side, 4.0 * side), near, 2.0 * long)
        } else {
            View::perspective(pose, 2.0, 1.0, near, f64::INFINITY)
        };
        let view = view.unwrap();
        let triangles = quadrilateral(corners);
        let Ok(mesh) = OccluderMesh::from_triangles(&triangles) else { continue };
        let mut tree = OcclusionTree::new();
        tree.begin(&view, DVec3::ZERO);
        tree.add(&mesh, &Affine3A::IDENTITY);
        tree.flush();
        let plane = view.planes(DVec3::ZERO).as_slice()[4].plane;
        for _ in 0..12 {
            // A point of an edge, of the diagonal or of the triangle of the near corners, and one behind it.
            let (i, j) = (random.below(4), random.below(4));
            let [p, q] = [i, j].map(|i| corners[i].as_dvec3());
            let mut on = p + (q - p) * random.fine_unit().powi(1 + 6 * random.below(2) as i32);
            on.z += random.fine_range(-1.0, 1.0) * 1e-6 * long * [0.0, 1.0][random.below(2)];
            let (from, along) = match view.eye(DVec3::ZERO) {
                Eye::Point(eye) => (eye, on - eye),
                Eye::Direction(along) => (on - along * long, along * long),
            };
            let target = (from + along * random.fine_range(1.2, 8.0)).as_vec3();
            let to = target.as_dvec3();
            if plane.signed_distance(to) <= 0.0 {
                continue;
            }
            if tree.test(&Aabb::from_points([target])) != Occlusion::Hidden {
                shown += 1;
                continue;
            }
            let clip = view.clip_from(DVec3::ZERO) * to.extend(1.0);
            if clip.x.abs().max(clip.y.abs()) > clip.w {
                continue;
            }
            hidden += 1;
            let from = if let Eye::Direction(along) = view.eye(DVec3::ZERO) {
                to - along * 9.0 * long
            } else {
                from
            };
            let blocked = triangles.iter().any(|triangle| {
                meets(from, to, triangle).is_some_and(|t| {
                    (0.0..=1.0).contains(&t) && plane.signed_distance(from + (to - from) * t) >= -1e-12 * long
                })
            });
            assert!(blocked, "{to} is seen from {from} past {corners:?} in {view:?}");
        }
    }
    judged(hidden);
    told_enough(hidden > 2_000 && shown > 10_000, format_args!("{hidden} hidden, {shown} not"));
}
