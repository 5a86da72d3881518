//! Tests of both cullers: budgets and order, and that the conservative culler loses no visible object.

use crate::common::{Blank, Walls, looking_along_x, rooms, run, triangles, views};
use std::collections::BTreeSet;
use std::sync::Arc;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{
    Aabb, Accuracy, Culler, FrustumCuller, ObjectId, OccluderMesh, OcclusionMap, Pose, Scene, View,
    VisibleSet,
    geometry::{Containment, Plane},
    occlusion::{HardwareQueries, LateAnswers, Occlusion, QueryDevice},
};
use visibility_plp::{
    Budget, ConservativePlpCuller, DelaunayTessellation, Fineness, OctreeTessellation, PlpCuller, Solidity,
    Tessellation,
};
use visibility_testing::PlainMap;

/// Small leaves, so that small test scenes have many cells.
const FINE: Fineness = Fineness { vertices: 24, halvings: 7 };

/// Returns the objects that have a triangle with a corner, edge midpoint or centre in view, at least a
/// millimetre inside of all view planes.
fn surely_in_view(scene: &Scene, view: &View) -> Vec<ObjectId> {
    let planes = view.planes(scene.origin());
    let inside = |p: DVec3| planes.as_slice().iter().all(|plane| plane.plane.signed_distance(p) > 1e-3);
    let shows = |id: &ObjectId| {
        scene.triangles(*id).unwrap().iter().any(|t| {
            let [a, b, c] = t.map(|p| p.as_dvec3());
            [a, b, c, (a + b) * 0.5, (b + c) * 0.5, (a + b + c) / 3.0].into_iter().any(inside)
        })
    };
    scene.ids().filter(shows).collect()
}

#[test]
fn without_a_budget_everything_in_view_is_reached() {
    let scene = triangles(7, 1200);
    let octree = Arc::new(OctreeTessellation::from_scene(&scene, FINE));
    let delaunay = Arc::new(DelaunayTessellation::from_scene(&scene, FINE));
    let mut found = 0;
    for view in views() {
        let near = Plane::through(DVec3::new(0.0, 0.0, -5.0), DVec3::new(0.1, 0.2, 1.0));
        for view in [view, view.with_clip_planes(&[near]).unwrap()] {
            let wanted = surely_in_view(&scene, &view);
            let all = Budget::Objects(usize::MAX);
            let cullers: [Box<dyn Culler>; 5] = [
                Box::new(PlpCuller::new(octree.clone(), all)),
                Box::new(PlpCuller::new(octree.clone(), all).with_solidity(Solidity::Count)),
                Box::new(PlpCuller::new(delaunay.clone(), all)),
                Box::new(ConservativePlpCuller::new(octree.clone(), Budget::Objects(20), Blank)),
                Box::new(ConservativePlpCuller::new(delaunay.clone(), Budget::Objects(20), Blank)),
            ];
            for (number, mut culler) in cullers.into_iter().enumerate() {
                let set: BTreeSet<_> = run(&mut *culler, &scene, &view).into_iter().collect();
                let lost: Vec<_> = wanted.iter().filter(|id| !set.contains(id)).collect();
                assert!(lost.is_empty(), "culler {number} lost {lost:?}");
            }
            found += wanted.len();
        }
    }
    assert!(found > 3000, "{found}");
}

/// Eyes in the plane of a cell's face, up to rounding, and one f64 step beside it: no object in view is lost
/// on either side of the face.
#[test]
fn an_eye_in_the_plane_of_a_face_sees_both_sides_of_it() {
    let scene = triangles(7, 600);
    let octree = OctreeTessellation::from_scene(&scene, FINE);
    let delaunay = DelaunayTessellation::from_scene(&scene, FINE);
    let all = Budget::Objects(usize::MAX);
    let mut found = 0;
    for cells in [&octree as &dyn Tessellation, &delaunay] {
        let mut culler = PlpCuller::new(cells, all);
        for cell in (0..cells.content().cell_count() as u32).step_by(37) {
            let mut faces = Vec::new();
            cells.for_each_face(cell, &|_| true, &mut |face| faces.push(*face));
            for (number, face) in faces.iter().enumerate().take(3) {
                let center = cells.center(cell);
                let eye = center - face.normal * face.normal.dot(center - face.point);
                let up = DVec3::from_array(eye.to_array().map(f64::next_up));
                let down = DVec3::from_array(eye.to_array().map(f64::next_down));
                for eye in [eye, up, down] {
                    let along = if number % 2 == 0 { face.normal } else { -face.normal };
                    let pose = Pose::look_at(eye, eye + along, DVec3::new(0.3, 0.4, 0.5));
                    let view = View::perspective(pose, 1.0, 1.3, 0.01, f64::INFINITY).unwrap();
                    let set: BTreeSet<_> = run(&mut culler, &scene, &view).into_iter().collect();
                    let wanted = surely_in_view(&scene, &view);
                    let lost: Vec<_> = wanted.iter().filter(|id| !set.contains(id)).collect();
                    assert!(lost.is_empty(), "from {eye} along {along}: {lost:?}");
                    found += wanted.len();
                }
            }
        }
    }
    assert!(found > 10_000, "{found}");
}

#[test]
fn budgets_are_kept_and_more_is_a_longer_list() {
    let scene = triangles(8, 2000);
    let cells = Arc::new(OctreeTessellation::from_scene(&scene, FINE));
    for solidity in [Solidity::Coverage, Solidity::Count] {
        for view in views() {
            let order = |budget| {
                run(&mut PlpCuller::new(cells.clone(), budget).with_solidity(solidity), &scene, &view)
            };
            let all = order(Budget::Objects(usize::MAX));
            for budget in [0, 1, 17, 300] {
                let some = order(Budget::Objects(budget));
                assert_eq!(some, all[..budget.min(all.len())], "{solidity:?}: the first {budget} objects");
                assert_eq!(
                    some,
                    order(Budget::Cost(budget as u64)),
                    "{solidity:?}: a cost of {budget}, at one each"
                );
            }
            assert_eq!(all.len(), all.iter().collect::<BTreeSet<_>>().len(), "each object once");
        }
    }
}

#[test]
fn backs_and_what_is_out_of_view_cost_nothing() {
    let scene = triangles(9, 2000);
    let cells = Arc::new(OctreeTessellation::from_scene(&scene, FINE));
    let (mut backs, mut kept) = (0, 0);
    for view in views() {
        let planes = view.planes(DVec3::ZERO);
        let all = run(&mut PlpCuller::new(cells.clone(), Budget::Objects(usize::MAX)), &scene, &view);
        for id in &all {
            let bounds = Aabb::from_points(scene.triangles(*id).unwrap().get(0).unwrap());
            let outside =
                |p: &visibility_core::view::ViewPlane| p.plane.classify_aabb(&bounds) == Containment::Outside;
            assert!(!planes.as_slice().iter().any(outside), "{id} is out of view");
        }
        let mut culler = PlpCuller::new(cells.clone(), Budget::Objects(usize::MAX)).with_one_sided();
        let fronts: BTreeSet<_> = run(&mut culler, &scene, &view).into_iter().collect();
        for id in all {
            let [a, b, c] = scene.triangles(id).unwrap().get(0).unwrap().map(|p| p.as_dvec3());
            let toward = match view.eye(DVec3::ZERO) {
                visibility_core::view::Eye::Point(eye) => eye - a,
                visibility_core::view::Eye::Direction(along) => -along,
            };
            let facing = (b - a).cross(c - a).normalize().dot(toward.normalize());
            if facing.abs() > 1e-6 {
                assert_eq!(fronts.contains(&id), facing > 0.0, "{id}: {facing}");
            }
            (backs, kept) = (backs + usize::from(facing < 0.0), kept + 1);
        }
    }
    assert!(backs * 3 > kept && backs * 3 < kept * 2, "{backs} of {kept}");
}

#[test]
fn what_is_before_a_wall_comes_before_what_is_behind_it() {
    let (scene, walls, things) = rooms(12);
    for tessellation in [true, false] {
        let budget = Budget::Objects(22);
        let view = looking_along_x(1.0);
        let kept = if tessellation {
            run(
                &mut PlpCuller::new(Arc::new(OctreeTessellation::from_scene(&scene, FINE)), budget),
                &scene,
                &view,
            )
        } else {
            run(
                &mut PlpCuller::new(Arc::new(DelaunayTessellation::from_scene(&scene, FINE)), budget),
                &scene,
                &view,
            )
        };
        assert!(kept.contains(&walls[0]), "octree: {tessellation}: the wall of the first room");
        let here = kept.iter().filter(|id| things[..20].contains(id)).count();
        assert!(here >= 18, "{here} of the 20 things of the first room, {tessellation}");
    }
}

#[test]
fn the_conservative_form_stops_at_walls_and_loses_nothing_before_them() {
    let (scene, walls, things) = rooms(12);
    let cells = Arc::new(OctreeTessellation::from_scene(&scene, FINE));
    for room in [0, 3, 8] {
        for budget in [0, 100, 1000] {
            let view = looking_along_x(room as f64 * 10.0 + 0.5);
            let mut frustum = VisibleSet::new();
            frustum.fill(&scene, &view);
            FrustumCuller::new().cull(&scene, &view, &mut frustum);
            let mut culler =
                ConservativePlpCuller::new(cells.clone(), Budget::Cost(budget), Walls::default());
            let mut visible = frustum.clone();
            culler.cull(&scene, &view, &mut visible);
            for id in things[room * 20..room * 20 + 20].iter().chain(&walls[room..room + 1]) {
                assert_eq!(visible.contains(&scene, *id), frustum.contains(&scene, *id), "{id}");
            }
            // Some cells beside the wall are visited before the wall is in the map, and lead to a few rooms
            // behind it.
            let (kept, of) = (visible.count(&scene), frustum.count(&scene));
            assert!(kept <= 84 || kept * 2 < of, "room {room}, budget {budget}: {kept} of {of}");
            let stats = culler.stats();
            assert!(
                (stats.front > 0 || budget > 0)
                    && stats.tests > 0
                    && stats.tests < cells.content().cell_count() as u64,
                "room {room}, budget {budget}: {stats:?}"
            );
            assert!(
                stats.visible_cells <= stats.projected_cells && stats.projected_cells > 0,
                "room {room}, budget {budget}: {stats:?}"
            );
        }
    }
}

#[test]
fn what_no_cell_holds_is_kept() {
    let (mut scene, walls, things) = rooms(12);
    let nan = scene.insert(Aabb::from_arrays([f32::NAN; 3], [1.0; 3]));
    let cells = OctreeTessellation::from_scene(&scene, FINE);
    // The object moves to a place where no cell lists it, without a `sync` of the cells.
    scene.set_bounds(things[200], Aabb::from_arrays([30.0, 0.0, 0.0], [31.0, 1.0, 1.0])).unwrap();
    let new = scene.insert(Aabb::from_arrays([55.0, 0.0, 0.0], [56.0, 1.0, 1.0]));
    scene.remove(walls[9]).unwrap();
    let again = scene.insert(Aabb::from_arrays([56.0, 0.0, 0.0], [57.0, 1.0, 1.0]));
    assert_eq!(again.index(), walls[9].index(), "the new object takes the index of the old");
    let mut synced = cells.clone();
    synced.sync(&scene);
    for cells in [cells, synced] {
        let cells = Arc::new(cells);
        let view = looking_along_x(1.0);
        let kept = run(
            &mut ConservativePlpCuller::new(cells.clone(), Budget::Cost(0), Walls::default()),
            &scene,
            &view,
        );
        for id in [nan, things[200], new, again] {
            assert!(kept.contains(&id), "{id}");
        }
        assert!(!kept.contains(&things[199]), "an object behind walls is kept");
        let other = rooms(3).0;
        let all = run(&mut PlpCuller::new(cells, Budget::Cost(0)), &other, &view);
        assert_eq!(all.len(), other.len(), "cells of another scene say nothing");
    }
}

#[test]
fn a_nan_triangle_in_finite_bounds_is_not_lost() {
    let mut scene = triangles(10, 400);
    let odd = scene.insert(Aabb::from_arrays([-3.0; 3], [3.0; 3]));
    scene.set_triangles(odd, [[Vec3::NAN, Vec3::ONE, Vec3::X]]).unwrap();
    let cells = Arc::new(OctreeTessellation::from_scene(&scene, FINE));
    let mut culler = PlpCuller::new(cells, Budget::Objects(usize::MAX)).with_one_sided();
    assert!(
        run(&mut culler, &scene, &looking_along_x(-20.0)).contains(&odd),
        "the object with a triangle of NaN"
    );
}

/// Occlusion map that finds every box hidden from its second frame on, until it is reset, or the scene or the
/// candidates change. It simulates a device whose answers belong to the frame before.
#[derive(Default)]
struct Late {
    frames: u32,
}

impl OcclusionMap for Late {
    fn name(&self) -> &str {
        "late"
    }
    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }
    fn begin(&mut self, _: &View, _: DVec3) {
        self.frames += 1;
    }
    fn add(&mut self, _: &OccluderMesh, _: &Affine3A) {}
    fn flush(&mut self) {}
    fn test(&self, _: &Aabb) -> Occlusion {
        if self.frames > 1 { Occlusion::Hidden } else { Occlusion::Partial }
    }
    fn answers_at_once(&self) -> bool {
        false
    }
    fn scene_changed(&mut self) {
        self.frames = 0;
    }
    fn candidates_changed(&mut self) {
        self.frames = 1;
    }
    fn reset(&mut self) {
        self.frames = 0;
    }
}

#[test]
fn what_the_map_remembers_of_one_scene_hides_nothing_in_another_or_after_a_change() {
    let mut scene = triangles(13, 400);
    let view = looking_along_x(-60.0);
    let cells = |scene: &Scene| Arc::new(OctreeTessellation::from_scene(scene, FINE));
    let mut culler = ConservativePlpCuller::new(cells(&scene), Budget::Cost(0), Late::default());
    let all = run(&mut culler, &scene, &view).len();
    let rest = run(&mut culler, &scene, &view).len();
    assert!(rest * 2 < all, "{rest} of {all} objects are kept in the second frame of a scene");
    let first = scene.ids().next().unwrap();
    scene.set_cost(first, 7).unwrap();
    assert_eq!(run(&mut culler, &scene, &view).len(), all, "objects kept after a change of the scene");
    let rest = run(&mut culler, &scene, &view).len();
    assert!(rest * 2 < all, "{rest} of {all} objects are kept in the second frame after the change");
    // An earlier stage leaves other objects.
    let mut visible = VisibleSet::new();
    visible.fill(&scene, &view);
    visible.retain(&scene, |id, _| id != first);
    culler.cull(&scene, &view, &mut visible);
    let kept = visible.count(&scene);
    assert!(kept + 1 >= all, "{kept} of {all} objects are kept after a change of the candidates");
    let other = scene.clone();
    *culler.shared_mut() = cells(&other);
    assert_eq!(
        run(&mut culler, &other, &view).len(),
        all,
        "objects kept in the first frame of another scene"
    );
}

#[test]
fn the_same_frames_give_the_same_answers_whatever_was_before() {
    let scene = triangles(11, 1500);
    let cells = Arc::new(OctreeTessellation::from_scene(&scene, FINE));
    let mut culler = PlpCuller::new(cells.clone(), Budget::Objects(200));
    let mut hash = 0u64;
    for view in views().into_iter().chain(views()) {
        let fresh = run(&mut PlpCuller::new(cells.clone(), Budget::Objects(200)), &scene, &view);
        assert_eq!(run(&mut culler, &scene, &view), fresh, "objects of a used culler and of a new one");
        for id in fresh {
            hash = (hash ^ id.index() as u64).wrapping_mul(0x0100_0000_01b3);
        }
    }
    assert_ne!(hash, 0, "the frames have objects");
}

#[test]
fn an_order_alone_takes_nothing_out() {
    let scene = triangles(12, 500);
    let cells = Arc::new(OctreeTessellation::from_scene(&scene, FINE));
    for view in views() {
        let first = run(&mut PlpCuller::new(cells.clone(), Budget::Objects(30)), &scene, &view);
        let mut culler = PlpCuller::new(cells.clone(), Budget::Objects(30)).with_all_kept();
        assert!(culler.accuracy().never_hides(), "an order alone hides nothing");
        let all = run(&mut culler, &scene, &view);
        assert_eq!(
            (all.len(), &all[..first.len()]),
            (500, &first[..]),
            "objects in all, and the first of them"
        );
    }
}

/// A row of small panels across the view. Every second panel is close behind a plate that faces away from the
/// eye. The panels without a plate must come first in the order.
#[test]
fn what_has_something_close_before_it_comes_last() {
    let mut scene = visibility_core::Scene::new();
    let mut add = |x: f32, y: f32, size: f32, flip: bool| {
        let (v, w) = (Vec3::Y * size, Vec3::Z * size);
        let p = Vec3::new(x, y, 0.0);
        let t = if flip { [p - v, p + v, p + w] } else { [p - v, p + w, p + v] };
        let id = scene.insert(Aabb::from_points(t));
        scene.set_triangles(id, [t]).unwrap();
        id
    };
    let (mut open, mut covered) = (Vec::new(), Vec::new());
    for i in 0..40 {
        let y = (i as f32 - 20.0) * 0.4;
        covered.push(add(10.0, y, 0.1, false));
        add(9.98, y, 0.15, true);
        open.push(add(10.0, y + 0.2, 0.1, false));
    }
    // Large cells, each with many panels of both kinds.
    const COARSE: Fineness = Fineness { vertices: 10_000, halvings: 0 };
    let view = looking_along_x(0.0);
    let octree = Arc::new(OctreeTessellation::from_scene(&scene, COARSE));
    let delaunay = Arc::new(DelaunayTessellation::from_scene(&scene, COARSE));
    let all = Budget::Objects(usize::MAX);
    let cullers: [Box<dyn Culler>; 2] = [
        Box::new(PlpCuller::new(octree, all).with_one_sided()),
        Box::new(PlpCuller::new(delaunay, all).with_one_sided()),
    ];
    for mut culler in cullers {
        let order = run(&mut *culler, &scene, &view);
        let shown = order.iter().filter(|id| open.contains(id)).count();
        assert_eq!(order.iter().filter(|id| covered.contains(id)).count(), shown, "nothing is left out");
        let first = order[..shown].iter().filter(|id| open.contains(id)).count();
        assert!(first * 10 >= shown * 7, "{first} of {shown}");
    }
}

/// A device that answers in the next frame, from the picture of the occluders that the culler has added.
struct NextFrame {
    picture: PlainMap,
    view: View,
    answers: Vec<(u64, u32)>,
}

impl QueryDevice for NextFrame {
    fn ask(&mut self, query: u64, boxes: &[Aabb]) {
        self.picture.flush();
        let passes = boxes.iter().any(|bounds| self.picture.test(bounds) != Occlusion::Hidden);
        self.answers.push((query, u32::from(passes)));
    }

    fn answers(&mut self, each: &mut dyn FnMut(u64, u32)) {
        self.answers.drain(..).for_each(|(query, samples)| each(query, samples));
        self.picture.begin(&self.view, DVec3::ZERO);
    }

    fn draw(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        self.picture.add(occluder, transform);
    }
}

/// A still camera in front of a row of rooms: once the answers have arrived, the rooms behind the first wall
/// are hidden in each frame, and nothing of the first room ever is.
#[test]
fn a_still_camera_hides_by_delayed_answers() {
    let (scene, walls, things) = rooms(6);
    let view = looking_along_x(-1.0);
    let cells = Arc::new(OctreeTessellation::new(&scene));
    let device = NextFrame { picture: PlainMap::new(96, 60), view, answers: Vec::new() };
    let map = HardwareQueries::new(device, LateAnswers::Visible);
    let mut culler = ConservativePlpCuller::new(cells, Budget::Objects(30), map);
    let mut kept = Vec::new();
    for frame in 0..12 {
        let seen = run(&mut culler, &scene, &view);
        assert!(seen.contains(&walls[0]), "frame {frame}: the first wall");
        assert!(things[..20].iter().all(|id| seen.contains(id)), "frame {frame}: the first room");
        kept.push(seen.len());
    }
    assert!(kept[6..].iter().all(|&count| count < 60 && count == kept[6]), "objects by frame: {kept:?}");
}
