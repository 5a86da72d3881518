//! Test of a camera that culls by portals, while the game opens and closes a door of the shared culler.

mod common;

use bevy_camera::prelude::*;
use bevy_camera::primitives::Aabb;
use bevy_math::{Vec3, Vec3A};
use bevy_transform::prelude::*;
use common::*;
use visibility_bevy::{CullingPipeline, Shared};
use visibility_core::cells::PortalId;
use visibility_core::geometry::ConvexPolygon;
use visibility_core::glam::{DVec2, DVec3};
use visibility_core::view::Reach;
use visibility_core::{FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
use visibility_portals::from_geometry::{WallSettings, floor_plan, from_walls};
use visibility_portals::{PortalCuller, SceneCells};

const CAMERA: Number = Number(1_000_000);

/// Makes two rooms, z up, with a door between them from y = 1 to 2.
fn two_rooms() -> SceneCells {
    let wall = |a: [f64; 2], b: [f64; 2]| [DVec2::from(a), DVec2::from(b)];
    let plan = [
        wall([0.0, 0.0], [8.0, 0.0]),
        wall([0.0, 4.0], [8.0, 4.0]),
        wall([0.0, 0.0], [0.0, 4.0]),
        wall([8.0, 0.0], [8.0, 4.0]),
        wall([4.0, 0.0], [4.0, 1.0]),
        wall([4.0, 2.0], [4.0, 4.0]),
    ];
    let rooms = from_walls(&floor_plan(&plan, 0.0, 3.0).unwrap(), &WallSettings::default()).unwrap();
    SceneCells::new(rooms.graph, rooms.viewcells, 1e-6).unwrap()
}

/// Opens or shuts all doors between the rooms.
fn set_doors(portals: &mut PortalCuller, open: bool) {
    let is_door = |polygon: &ConvexPolygon| polygon.vertices().iter().all(|vertex| vertex.x == 4.0);
    let all = portals.cells().graph().portals().iter().zip(0..);
    let doors: Vec<_> =
        all.filter(|(portal, _)| is_door(portal.polygon())).map(|(_, i)| PortalId(i)).collect();
    assert!(!doors.is_empty(), "there is a door");
    doors.into_iter().for_each(|door| portals.cells_mut().set_open(door, open).unwrap());
}

#[test]
fn what_is_in_another_room_is_seen_through_the_door_alone() {
    let mut app = app(true);
    let portals = Shared::new(PortalCuller::new(two_rooms()));
    let culling = CullingPipeline::frustum().with(portals.clone());
    let at = Transform::from_xyz(1.0, 1.5, 1.5).looking_at(Vec3::new(7.0, 1.5, 1.0), Vec3::Z);
    let lens = PerspectiveProjection { fov: 1.5, ..Default::default() };
    app.world_mut().spawn((CAMERA, Camera3d::default(), Projection::Perspective(lens), at, culling));
    for (number, x, y) in [(0, 6.25, 1.5), (1, 4.75, 3.25), (2, 2.0, 1.5)] {
        let thing = Aabb { center: Vec3A::ZERO, half_extents: Vec3A::splat(0.25) };
        app.world_mut().spawn((drawn(number, Transform::from_xyz(x, y, 1.0)), thing));
    }
    let seen = |app: &mut bevy_app::App| {
        app.update();
        seen_by(app, CAMERA).into_iter().map(|Number(number)| number).collect::<Vec<_>>()
    };
    assert_eq!(seen(&mut app), [0, 2], "1 is behind the wall beside the door");
    let set_door = |open: bool| set_doors(&mut portals.lock(), open);
    set_door(false);
    assert_eq!(seen(&mut app), [2], "the door is shut");
    set_door(true);
    assert_eq!(seen(&mut app), [0, 2], "the door is open again");
    let two = entity(&mut app, Number(2)).unwrap();
    app.world_mut().entity_mut(two).insert(Transform::from_xyz(4.75, 3.25, 1.0));
    assert_eq!(seen(&mut app), [0], "moved out of sight");
}

/// Cameras with a reach, which keep answers of one culler.
#[test]
fn kept_answers_of_a_shared_culler_end_with_what_they_were_made_of() {
    let mut scene = Scene::new();
    let far = scene.insert(visibility_core::Aabb::from_arrays([6.0, 1.25, 0.75], [6.5, 1.75, 1.25]));
    let pose = Pose::look_at(DVec3::new(1.0, 1.5, 1.5), DVec3::new(7.0, 1.5, 1.0), DVec3::Z);
    let view = View::perspective(pose, 1.5, 1.0, 0.1, 100.0).unwrap();
    let portals = Shared::new(PortalCuller::new(two_rooms()));
    let camera = || {
        let pipeline = Pipeline::new().with(FrustumCuller::new()).with(portals.clone());
        (pipeline.with_reach(Some(Reach::new(0.0, 0.0))), VisibleSet::new())
    };
    let sees = |(pipeline, visible): &mut (Pipeline, VisibleSet)| {
        pipeline.cull(&scene, &view, visible);
        (visible.contains(&scene, far), pipeline.is_kept())
    };
    let mut cameras = [camera(), camera()];
    set_doors(&mut portals.lock(), false);
    for frame in 0..3 {
        assert_eq!(cameras.each_mut().map(sees).map(|seen| seen.0), [false; 2], "shut, frame {frame}");
    }
    set_doors(&mut portals.lock(), true);
    assert_eq!(cameras.each_mut().map(sees).map(|seen| seen.0), [true; 2], "opened for both cameras");

    let [one, _] = &mut cameras;
    assert_eq!(
        [sees(one), sees(one)],
        [(true, false), (true, true)],
        "the other's answer ends, the own is kept"
    );
    let open = portals.lock().clone();
    set_doors(&mut portals.lock(), false);
    assert_eq!([sees(one), sees(one)], [(false, false), (false, true)], "shut");
    let shut = portals.lock().clone();
    *portals.lock() = open.clone();
    assert_eq!(
        sees(one),
        (true, false),
        "a culler with an open door in the place of the one with a shut one"
    );
    *portals.lock() = shut;
    assert!(!sees(one).0, "shut");
    *portals.lock() = open;
    assert!(sees(one).0, "an open one that has an answer, whose stamp is that of its cells");
}
