//! Tests of temporal coherence: cached answers change no result, no answer outlives a change of the scene,
//! and warm frames allocate nothing.

use crate::common::{Soup, triangles_of};
use std::sync::Arc;
use visibility_bsp::{
    LargeOccludersCuller, Occluders, OcclusionTree, OcclusionTreeCuller, ShadowFrusta, ShadowFrustaCuller,
};
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{
    Aabb, Culler, FrustumCuller, Object, ObjectId, OccluderMesh, OcclusionCuller, Pipeline, Pose, Scene,
    View, VisibleSet, occlusion::Preparation,
};
use visibility_testing::allocations::ALLOCATIONS;
use visibility_testing::{NOT_ALWAYS_DRAWN, Random};

/// Returns the objects that remain after the frustum culler and then `culler`.
fn reported(scene: &Scene, view: &View, culler: &mut dyn Culler) -> Vec<ObjectId> {
    let mut visible = VisibleSet::new();
    visible.fill(scene, view);
    FrustumCuller::new().cull(scene, view, &mut visible);
    culler.cull(scene, view, &mut visible);
    visible.iter(scene).collect()
}

/// Returns the view of a frame on a path of slow movement (26 frames of 40), standstill, and a cut every 40
/// frames.
fn walk(frame: usize) -> View {
    let cut = (frame / 40) as f64;
    let step = (frame % 40).min(25) as f64 * 0.01;
    let eye = DVec3::new(cut.sin() * 13.0 + step, cut.cos() * 13.0, cut % 5.0 - 2.0);
    let target = DVec3::new(step * 0.3, cut % 3.0 - 1.0, 0.0);
    View::perspective(Pose::look_at(eye, target, DVec3::Z), 1.2, 1.6, 0.05, f64::INFINITY).unwrap()
}

#[test]
fn memory_changes_no_answer_and_saves_most_of_the_work() {
    let mut random = Random(11);
    for occluders in [20, 60, 150] {
        let soup = Soup::new(&mut random, 1.0, occluders);
        let polygons = Arc::new(Occluders::new(&soup.scene));
        let mut with = LargeOccludersCuller::new(polygons.clone());
        let mut without = LargeOccludersCuller::new(polygons).without_coherence();
        let (mut computed, mut all) = (0, 0);
        for frame in 0..400 {
            let view = walk(frame);
            let answer = reported(&soup.scene, &view, &mut with);
            assert_eq!(answer, reported(&soup.scene, &view, &mut without), "frame {frame}");
            if frame % 40 > 0 {
                (computed, all) = (computed + with.computed(), all + without.computed());
            }
            if frame % 40 > 27 {
                assert_eq!(with.computed(), 0, "nothing moves");
            }
        }
        println!("{occluders}: {computed} of {all} boxes computed");
        assert!(computed * 2 < all, "{computed} of {all}");
    }
}

#[test]
fn what_is_remembered_outlives_a_turn_of_the_camera() {
    let soup = Soup::new(&mut Random(14), 1.0, 60);
    let mut culler = LargeOccludersCuller::new(Arc::new(Occluders::new(&soup.scene)));
    let eye = DVec3::new(13.0, 1.0, 0.5);
    let turned = |step: u32| {
        let target = DVec3::new(0.0, f64::from(step) * 0.37 - 5.0, f64::from(step) * 0.11);
        View::perspective(Pose::look_at(eye, target, DVec3::Z), 1.2, 1.6, 0.05, f64::INFINITY).unwrap()
    };
    let mut computed = [0, 0];
    for sum in &mut computed {
        for step in 0..30 {
            reported(&soup.scene, &turned(step), &mut culler);
            *sum += culler.computed();
        }
    }
    assert!(computed[0] > 0, "the first turn computes answers");
    assert_eq!(computed[1], 0, "the eye is where it was");
}

#[test]
fn answers_depend_on_nothing_before_a_reset() {
    let soup = Soup::new(&mut Random(12), 1.0, 80);
    let polygons = Arc::new(Occluders::new(&soup.scene));
    let mut worn = LargeOccludersCuller::new(polygons.clone());
    (0..100).for_each(|frame| drop(reported(&soup.scene, &walk(frame), &mut worn)));
    worn.reset();
    let mut new = LargeOccludersCuller::new(polygons);
    for frame in 60..180 {
        let view = walk(frame);
        assert_eq!(
            reported(&soup.scene, &view, &mut worn),
            reported(&soup.scene, &view, &mut new),
            "frame {frame}: objects reported by a culler that was reset, and by a new one"
        );
    }
}

/// A scene of a wall and a box behind the wall, with a view in which the wall hides the box.
struct Room {
    scene: Scene,
    wall: ObjectId,
    target: ObjectId,
    view: View,
}

impl Room {
    /// Bounds of the wall, in metres relative to `Scene::origin`.
    const WALL: Aabb = Aabb::from_arrays([4.0, -5.0, -5.0], [4.5, 5.0, 5.0]);

    fn new() -> Self {
        let mut scene = Scene::new();
        let wall = scene.insert(Object { occluder: true, ..Object::new(Self::WALL) });
        scene.set_triangles(wall, triangles_of(&Self::WALL)).unwrap();
        let target = scene.insert(Aabb::from_arrays([8.0, -1.0, -1.0], [9.0, 1.0, 1.0]));
        // A box behind the eye makes the scene's bounds, for which regions are made, contain the eye.
        scene.insert(Aabb::from_arrays([-6.0, -1.0, -1.0], [-5.0, 1.0, 1.0]));
        scene.prepare_occluders(&Preparation::default());
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY).unwrap();
        Self { scene, wall, target, view }
    }

    /// Returns one of each culler that must hide the target box behind the wall.
    fn cullers(&self) -> Vec<Box<dyn Culler>> {
        let occluders = Arc::new(Occluders::new(&self.scene));
        let frusta = ShadowFrusta::new(&self.scene, Occluders::new(&self.scene), 8, 8);
        vec![
            Box::new(OcclusionTreeCuller::new(occluders.clone())),
            Box::new(LargeOccludersCuller::new(occluders)),
            Box::new(ShadowFrustaCuller::new(frusta.into())),
            Box::new(OcclusionCuller::new(OcclusionTree::new())),
        ]
    }

    /// Tests whether a culler hides the target box in the room's view. False if the box stays visible.
    fn hides(&self, culler: &mut dyn Culler) -> bool {
        !reported(&self.scene, &self.view, culler).contains(&self.target)
    }
}

#[test]
fn a_wall_that_the_eye_comes_too_close_to_hides_no_longer() {
    let mut room = Room::new();
    let occluders = Arc::new(Occluders::new(&room.scene));
    let mut culler = LargeOccludersCuller::new(occluders);
    let mut hidden = Vec::new();
    // The steps are small, so the same occluders stay selected and the answers for all boxes are cached.
    for step in 0..20 {
        let eye = DVec3::X * (3.94 + 0.003 * f64::from(step));
        let pose = Pose::look_at(eye, DVec3::X * 20.0, DVec3::Z);
        room.view = View::perspective(pose, 1.0, 1.5, 0.02, f64::INFINITY).unwrap();
        hidden.push(room.hides(&mut culler));
        // Beyond x = 3.98, the near plane cuts the wall away.
        assert!(!(eye.x > 3.98 && hidden[step as usize]), "{eye}");
    }
    assert!(hidden[0] && !hidden[19], "hidden by steps from 3.94 m to 3.997 m: {hidden:?}");
}

/// Boxes that end between 1e-7 and 0.1 m inside the edge of the wall's shadow.
#[test]
fn a_view_that_knows_its_eye_less_well_trusts_no_answer_of_one_that_knew_it_better() {
    let mut random = Random(15);
    let mut room = Room::new();
    let eye = DVec3::new(0.3, 0.2, 0.1);
    let edge = eye.y + (5.0 - eye.y) * (8.0 - eye.x) / (4.0 - eye.x);
    for _ in 0..600 {
        let clear = 10f64.powf(random.fine_range(-7.0, -1.0));
        let min = Vec3::new(8.0, edge as f32 - 2.0, -1.0);
        room.scene.insert(Aabb::new(min, Vec3::new(9.0, (edge - clear) as f32, 1.0)));
    }
    let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
    let sharp = View::perspective(pose, 2.2, 1.5, 0.1, f64::INFINITY).unwrap();
    let occluders = Arc::new(Occluders::new(&room.scene));
    let mut counts = Vec::new();
    for blur in [1e-6, 1e-8, 1e-10, 1e-11, 1e-12] {
        // Rows x and y that are nearly opposite determine the eye's position inexactly along one axis.
        let matrix = sharp.clip_from(DVec3::ZERO);
        let (x, y) = (matrix.row(0), matrix.row(1));
        let mut rows = matrix.transpose();
        rows.x_axis = y / blur + x;
        rows.y_axis = y / blur - x;
        let blurred = View::from_clip_from_world(rows.transpose(), sharp.depth()).unwrap();
        let mut live = LargeOccludersCuller::new(occluders.clone());
        let all = reported(&room.scene, &sharp, &mut live).len();
        let live = reported(&room.scene, &blurred, &mut live);
        let fresh = reported(&room.scene, &blurred, &mut LargeOccludersCuller::new(occluders.clone()));
        println!("{blur}: {all} sharp, {} live, {} fresh", live.len(), fresh.len());
        // An eye that is surely inside the ball of a cached answer keeps that answer, even if a new culler
        // could not compute it.
        assert!(live.len() <= fresh.len(), "blur {blur}: what was remembered reports more objects");
        counts.push(live.len());
    }
    assert!(counts.is_sorted() && counts[2] > counts[0] + 50 && counts[4] > counts[2] + 50, "{counts:?}");
}

/// The polygons are made of all occluders, so the scene tells which of them are always drawn.
#[test]
fn what_is_not_always_drawn_hides_nothing() {
    for (way, set) in NOT_ALWAYS_DRAWN.into_iter().enumerate() {
        let mut room = Room::new();
        set(&mut room.scene, room.wall);
        // The fourth culler takes its occluders from the visible set, which leaves out what is never culled.
        let count = if way == 3 { 4 } else { 3 };
        for culler in &mut room.cullers()[..count] {
            assert!(!room.hides(&mut **culler), "way {way}: {}", culler.name());
        }
    }
}

#[test]
fn an_occluder_that_has_changed_hides_no_longer() {
    type Change = fn(&mut Room);
    let changes: [(&str, Change); 6] = [
        ("moved", |room| {
            let aside = Affine3A::from_translation(Vec3::new(0.0, 30.0, 0.0));
            let mesh = room.scene.add_mesh(OccluderMesh::cuboid(&Room::WALL).unwrap());
            room.scene.set_local_bounds(room.wall, Room::WALL).unwrap();
            room.scene.set_mesh(room.wall, mesh, aside).unwrap();
        }),
        ("opened", |room| room.scene.set_occluder(room.wall, false).unwrap()),
        ("removed", |room| room.scene.remove(room.wall).unwrap()),
        ("other layers", |room| {
            room.scene.set_layers(room.wall, 2).unwrap();
            room.view = room.view.with_layers(1);
        }),
        ("cut away", |room| {
            let plane = visibility_core::geometry::Plane::through(DVec3::new(6.0, 0.0, 0.0), DVec3::X);
            room.view = room.view.with_clip_planes(&[plane]).unwrap();
        }),
        ("before the near plane", |room| {
            let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
            room.view = View::perspective(pose, 1.0, 1.5, 6.0, f64::INFINITY).unwrap();
        }),
    ];
    for (what, change) in changes {
        let mut room = Room::new();
        let mut cullers = room.cullers();
        for culler in &mut cullers {
            assert!(room.hides(&mut **culler), "{}", culler.name());
        }
        change(&mut room);
        for culler in &mut cullers {
            assert!(!room.hides(&mut **culler), "{what}: {}", culler.name());
        }
    }
}

/// Walls that face inwards hide nothing from outside, even if the room is only two units in the last place
/// wide.
#[test]
fn a_room_turned_inside_out_does_not_hide_its_contents() {
    for (at, width) in [(0.0, 2.0), (1e3, 2.0), (1e7, 2.0), (1e7, 4.0)] {
        let at = Vec3::splat(at);
        let walls = Aabb::new(at, at + width);
        let mut scene = Scene::new();
        let room = scene.insert(Object { occluder: true, ..Object::new(walls) });
        let inside_out: Vec<_> = triangles_of(&walls).into_iter().map(|[a, b, c]| [a, c, b]).collect();
        scene.set_triangles(room, inside_out).unwrap();
        let middle = at + width * 0.5;
        let target = scene.insert(Aabb::new(middle, middle));
        scene.prepare_occluders(&Preparation::default());
        let eye = middle.as_dvec3() - DVec3::new(40.0, 1.0, 2.0);
        let pose = Pose::look_at(eye, middle.as_dvec3(), DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY).unwrap();
        let room = Room { scene, wall: room, target, view };
        for culler in &mut room.cullers() {
            assert!(!room.hides(&mut **culler), "{}: {width} at {at}", culler.name());
        }
    }
}

#[test]
fn an_object_that_is_not_drawn_does_not_hide() {
    let room = Room::new();
    for culler in &mut room.cullers() {
        let mut visible = VisibleSet::new();
        visible.fill(&room.scene, &room.view);
        visible.retain(&room.scene, |id, _| id != room.wall);
        culler.cull(&room.scene, &room.view, &mut visible);
        assert!(visible.contains(&room.scene, room.target), "{}", culler.name());
    }
}

#[test]
fn an_object_that_moves_is_judged_where_it_is() {
    let mut room = Room::new();
    for culler in &mut room.cullers() {
        let hidden = Aabb::from_arrays([8.0, -1.0, -1.0], [9.0, 1.0, 1.0]);
        for bounds in [hidden, Aabb::from_arrays([2.0, -1.0, -1.0], [3.0, 1.0, 1.0]), hidden] {
            room.scene.set_bounds(room.target, bounds).unwrap();
            assert_eq!(room.hides(&mut **culler), bounds == hidden, "{}", culler.name());
        }
    }
}

#[test]
fn polygons_follow_their_objects_when_brought_up_to_date() {
    let mut room = Room::new();
    let mut occluders = Occluders::new(&room.scene);
    let count = occluders.len();
    let mesh = room.scene.add_mesh(OccluderMesh::cuboid(&Room::WALL).unwrap());
    room.scene.set_local_bounds(room.wall, Room::WALL).unwrap();
    for step in 0..20 {
        let shift = Affine3A::from_translation(Vec3::new(0.0, [0.0, 0.5, 30.0][step % 3], 0.0));
        room.scene.set_mesh(room.wall, mesh, shift).unwrap();
        occluders.sync(&room.scene);
        assert_eq!(occluders.len(), count, "step {step}: polygons of the moved wall");
        let current = Arc::new(occluders.clone());
        for culler in [
            &mut OcclusionTreeCuller::new(current.clone()) as &mut dyn Culler,
            &mut LargeOccludersCuller::new(current.clone()),
        ] {
            assert_eq!(room.hides(culler), step % 3 < 2, "step {step}: {}", culler.name());
        }
    }
    room.scene.remove(room.wall).unwrap();
    occluders.sync(&room.scene);
    assert!(occluders.is_empty(), "no polygons are left of the removed wall");
}

#[test]
fn nothing_is_allocated_once_warm() {
    let soup = Soup::new(&mut Random(13), 1.0, 120);
    let polygons = Arc::new(Occluders::new(&soup.scene));
    let frusta = Arc::new(ShadowFrusta::new(&soup.scene, Occluders::new(&soup.scene), 16, 24));
    let cullers: Vec<Box<dyn Culler + Send + Sync>> = vec![
        Box::new(OcclusionTreeCuller::new(polygons.clone())),
        Box::new(LargeOccludersCuller::new(polygons)),
        Box::new(ShadowFrustaCuller::new(frusta)),
        Box::new(OcclusionCuller::new(OcclusionTree::new())),
    ];
    for culler in cullers {
        let name = culler.name().to_owned();
        let mut pipeline = Pipeline::new().with(FrustumCuller::new());
        pipeline.push(culler);
        let mut visible = VisibleSet::new();
        let views: Vec<View> = (0..240).map(walk).collect();
        for _ in 0..2 {
            for view in &views {
                pipeline.cull(&soup.scene, view, &mut visible);
            }
        }
        let before = ALLOCATIONS.get();
        for view in &views {
            pipeline.cull(&soup.scene, view, &mut visible);
        }
        assert_eq!(ALLOCATIONS.get() - before, 0, "{name}");
    }
}
