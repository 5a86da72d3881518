//! A ray reflected by mirrors never reaches an object that the reflection hides. What mirrors show can be
//! culled further.

use crate::maze::{Camera, Maze, Style};
use crate::room_row::{along, boxes, row_of_rooms, seen};
use visibility_core::cells::{CellGraph, CellId};
use visibility_core::geometry::ConvexPolygon;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::{Viewcell, Viewcells};
use visibility_core::view::Window;
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, FrustumCuller, ObjectId, Pose, Scene, View, VisibleSet,
};
use visibility_portals::{MirrorId, PortalEye, SceneCells};
use visibility_testing::Random;

#[test]
fn no_reflected_ray_reaches_what_its_reflection_hides() {
    let mut random = Random(11);
    let (mut reached, mut twice, mut hidden, mut seen) = (0, 0, 0u64, 0u64);
    for number in 0..40 {
        let style =
            Style { turned: number % 2 == 1, slivers: false, mirrors: true, shift: 10.0, tolerance: 1e-9 };
        let mut maze = Maze::new(&mut random, [4, 4, 2], style);
        let mut eye = PortalEye::new().with_reflections(64, 2);
        let mut visible = VisibleSet::new();
        for view in 0..60 {
            if view % 10 == 0 {
                maze.shuffle_doors(&mut random);
            }
            let room = random.below(maze.rooms());
            let at = maze.to_world(maze.point_in(&mut random, room));
            let toward =
                Maze::near(&mut random, at, &maze.mirror_targets).map_or(DVec3::X, |target| target - at);
            let camera = Camera::toward(&mut random, at, toward, view % 6 == 5);
            visible.fill(&maze.scene, &camera.view);
            FrustumCuller::new().cull(&maze.scene, &camera.view, &mut visible);
            eye.cull(&maze.cells, &maze.scene, &camera.view, &mut visible);
            if eye.stats().reflections_left_out > 0 {
                // Reflections may be left out only for more than two mirrors along a line of sight.
                assert!(
                    eye.reflections().len() < 64 && eye.reflections().iter().any(|one| one.depth() == 2),
                    "maze {number}, view {view}: a reflection is left out before the limits of 64 and depth 2"
                );
            }
            for one in eye.reflections() {
                let count = one.visible().count(&maze.scene) as u64;
                (seen, hidden) = (seen + count, hidden + maze.objects.len() as u64 - count);
            }
            // Returns the index of the reflection for a chain of mirrors. `None` if there is no such
            // reflection.
            let find = |chain: &[MirrorId]| {
                let mut place = None;
                for &mirror in chain {
                    let of = |(_, one): &(usize, &visibility_portals::Reflection)| {
                        one.mirror() == mirror && one.parent() == place
                    };
                    place = Some(eye.reflections().iter().enumerate().find(of)?.0);
                }
                place
            };
            for _ in 0..300 {
                let target = if random.below(2) == 0 { &maze.mirror_targets } else { &maze.targets };
                let aimed = Maze::near(&mut random, at, target).and_then(|target| camera.project(target));
                let (x, y) =
                    aimed.unwrap_or_else(|| (random.fine_range(-1.0, 1.0), random.fine_range(-1.0, 1.0)));
                let (from, along) = camera.ray(x, y);
                maze.follow(from, along, |object, mirrors| {
                    // The ray does not report the distance at which it meets an object, so views with a near
                    // far plane are skipped.
                    if mirrors.is_empty() || mirrors.len() > 2 || camera.far < 100.0 {
                        return;
                    }
                    let place = find(mirrors);
                    let shown = place.is_some_and(|place| {
                        eye.reflections()[place].visible().contains(&maze.scene, maze.objects[object].0)
                    });
                    assert!(
                        shown,
                        "maze {number}, view {view}: object {object} in {mirrors:?}, {place:?}; {:?}",
                        eye.stats()
                    );
                    reached += 1;
                    twice += u32::from(mirrors.len() == 2);
                });
            }
        }
    }
    println!(
        "{reached} objects reached, {twice} of them in mirrors in mirrors; {seen} shown, {hidden} hidden"
    );
    assert!(reached > 2_000 && twice > 60, "{reached} {twice}");
    assert!(hidden > 5 * seen, "{hidden} {seen}");
}

/// In an orthographic view, a small mirror far away shows what is before it, and nothing beside that.
#[test]
fn mirrors_of_orthographic_views_show_no_more_than_is_before_them() {
    let room = Viewcell::from_box(DVec3::splat(-60.0), DVec3::splat(60.0));
    let graph = CellGraph::new(1, []).unwrap();
    let mut cells = SceneCells::new(graph, Viewcells::new([room]), 1e-6).unwrap();
    let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]].map(|[y, z]| DVec3::new(50.0, y, z));
    let mirror = cells.add_mirror(CellId(0), &ConvexPolygon::new(corners).unwrap()).unwrap();
    let mut scene = Scene::new();
    for number in -9..10 {
        let min = Vec3::new(20.0, number as f32 - 0.1, -0.1);
        scene.insert(Aabb::new(min, min + Vec3::splat(0.2)));
    }
    cells.sync(&scene);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::orthographic(pose, Window::centered(20.0, 20.0), 0.0, 100.0).unwrap();
    let (mut eye, mut visible) = (PortalEye::new(), VisibleSet::new());
    visible.fill(&scene, &view);
    eye.cull(&cells, &scene, &view, &mut visible);
    let [one] = eye.reflections() else { panic!("{} reflections of one mirror", eye.reflections().len()) };
    assert_eq!(one.mirror(), mirror, "the mirror of the reflection");
    let shown: Vec<usize> = one.visible().iter(&scene).map(|id| id.index()).collect();
    assert_eq!(shown, [8, 9, 10], "the boxes before the mirror and at its sides");
}

/// Removes all objects but one, and counts the views that it culls.
struct AllButOne(ObjectId, u32);

impl Culler for AllButOne {
    fn name(&self) -> &str {
        "all but one"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Approximate
    }

    fn cull(&mut self, scene: &Scene, _: &View, visible: &mut VisibleSet) -> CullStats {
        self.1 += 1;
        visible.retain(scene, |id, _| id == self.0)
    }
}

/// Another culler takes objects out of each reflection of the last frame, which stay the result of a frame.
/// The next frame begins anew.
#[test]
fn another_culler_culls_what_a_mirror_shows() {
    let (mut cells, (mut scene, ids)) = (row_of_rooms(2), boxes(2));
    cells.sync(&scene);
    let corners = [[1.0, 0.5], [1.0, 2.0], [3.0, 2.0], [3.0, 0.5]];
    let glass = ConvexPolygon::new(corners.map(|[y, z]| DVec3::new(8.0, y, z))).unwrap();
    let mirror = cells.add_mirror(CellId(1), &glass).unwrap();
    let (mut eye, mut culler) = (PortalEye::new(), AllButOne(ids[1], 0));
    let shown = |eye: &PortalEye, scene: &Scene| -> Vec<ObjectId> {
        eye.reflections().iter().flat_map(|one| one.visible().iter(scene)).collect()
    };
    eye.cull_reflections(&scene, &mut culler);
    assert_eq!(culler.1, 0, "views before the first frame");
    seen(&mut eye, &cells, &scene, &along());
    assert_eq!(shown(&eye, &scene), ids, "objects in the mirror");
    eye.cull_reflections(&scene, &mut culler);
    assert_eq!((culler.1, shown(&eye, &scene)), (1, vec![ids[1]]), "views, and objects that are left");
    assert!(eye.reflections().iter().all(|one| one.visible().is_finished()), "the sets of reflections");
    scene.insert(Aabb::from_arrays([1.0, 1.0, 0.0], [3.0, 3.0, 1.0]));
    scene.rebuild();
    assert_eq!(shown(&eye, &scene), [ids[1]], "objects that are left, once others have come");
    cells.sync(&scene);
    seen(&mut eye, &cells, &scene, &along());
    assert!(shown(&eye, &scene).len() > ids.len(), "objects in the next frame");
    cells.set_mirror(mirror, false).unwrap();
    seen(&mut eye, &cells, &scene, &along());
    eye.cull_reflections(&scene, &mut culler);
    assert_eq!((culler.1, shown(&eye, &scene)), (1, vec![]), "views with a covered mirror");
}
