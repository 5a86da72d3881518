//! Occluders that are absent from some frames or views do not hide anything.

use crate::common::{cuboid, scene};
use std::sync::Arc;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::{Pose, RegionCuller, Scene, View, VisibleSet};
use visibility_exact::{Effort, ExactCuller, ExactSettings, SceneTriangles};
use visibility_testing::NOT_ALWAYS_DRAWN;

/// A scene of a wall, object 0, and a post behind the wall, object 1.
fn wall_and_post() -> Scene {
    let wall = cuboid(DVec3::new(10.0, -5.0, -5.0), DVec3::new(11.0, 5.0, 5.0));
    let post = cuboid(DVec3::new(14.0, -1.0, -1.0), DVec3::new(15.0, 1.0, 1.0));
    scene(&[wall, post])
}

/// Returns whether the culler keeps the post when the visible set is filled for the given layers.
fn keeps_post(scene: &Scene, layers: u32) -> bool {
    keeps_post_of(&SceneTriangles::new(scene), scene, layers)
}

/// Returns whether a culler with these triangles keeps the post when the set is filled for the given layers.
fn keeps_post_of(triangles: &SceneTriangles, scene: &Scene, layers: u32) -> bool {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, 100.0).unwrap().with_layers(layers);
    let mut visible = VisibleSet::new();
    visible.fill(scene, &view);
    let settings = ExactSettings::new(Effort::Exact(1e-4));
    let cell = Viewcell::from_box(DVec3::splat(-0.5), DVec3::splat(0.5));
    ExactCuller::new(Arc::new(triangles.clone()), settings).cull(scene, &cell, &mut visible);
    visible.contains(scene, scene.id_at(1).unwrap())
}

#[test]
fn an_occluder_that_is_not_always_drawn_hides_nothing() {
    assert!(!keeps_post(&wall_and_post(), u32::MAX), "the wall hides the post");
    for (way, set) in NOT_ALWAYS_DRAWN.into_iter().enumerate() {
        let mut scene = wall_and_post();
        let wall = scene.id_at(0).unwrap();
        set(&mut scene, wall);
        assert!(keeps_post(&scene, u32::MAX), "way {way}: the wall may be absent");
    }
}

#[test]
fn an_occluder_on_other_layers_than_the_set_hides_nothing() {
    let mut scene = wall_and_post();
    let wall = scene.id_at(0).unwrap();
    scene.set_layers(wall, 1).unwrap();
    assert!(!keeps_post(&scene, 3), "a view that shows the wall too");
    assert!(keeps_post(&scene, 2), "a view that does not show the wall");
}

/// What counts is the layers that occluders are on now, not those that one has ever been on.
#[test]
fn layers_that_no_occluder_is_on_any_more_do_not_count() {
    let mut scene = wall_and_post();
    let wall = scene.id_at(0).unwrap();
    let mut triangles = SceneTriangles::new(&scene);
    for (layers, keeps) in
        [(1, false), (1 << 31, true), (1, false), (0, true), (3, false), (2, true), (u32::MAX, false)]
    {
        scene.set_layers(wall, layers).unwrap();
        triangles.sync(&scene);
        assert_eq!(keeps_post_of(&triangles, &scene, 1), keeps, "the wall on the layers {layers:#x}");
    }
    // A second wall on a layer that the view does not show, beside the first.
    let other = scene.insert(scene.object(wall).unwrap());
    scene.set_triangles(other, scene.triangles(wall).unwrap().iter().collect::<Vec<_>>()).unwrap();
    for (what, layers, keeps) in [("on another layer", 2, true), ("on the same layers", u32::MAX, false)] {
        scene.set_layers(other, layers).unwrap();
        triangles.sync(&scene);
        assert_eq!(keeps_post_of(&triangles, &scene, 1), keeps, "a second wall {what}");
    }
    scene.set_layers(other, 2).unwrap();
    triangles.sync(&scene);
    scene.remove(other).unwrap();
    triangles.sync(&scene);
    assert!(!keeps_post_of(&triangles, &scene, 1), "the second wall is removed");
}

/// In a union of the sets of two views, an occluder that one of the views does not draw hides nothing.
#[test]
fn an_occluder_that_one_view_of_a_union_does_not_draw_hides_nothing() {
    let mut scene = wall_and_post();
    let (wall, post) = (scene.id_at(0).unwrap(), scene.id_at(1).unwrap());
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let cell = Viewcell::from_box(DVec3::splat(-0.5), DVec3::splat(0.5));
    for (of_wall, keeps) in [(0b01, true), (0b10, true), (0b100, false)] {
        scene.set_layers(wall, of_wall).unwrap();
        let mut both = VisibleSet::new();
        both.clear(&scene);
        for layers in [0b101, 0b110] {
            let view = View::perspective(pose, 1.0, 1.0, 0.1, 100.0).unwrap().with_layers(layers);
            let mut set = VisibleSet::new();
            set.fill(&scene, &view);
            both.union(&scene, &set);
        }
        let settings = ExactSettings::new(Effort::Exact(1e-4));
        let triangles = Arc::new(SceneTriangles::new(&scene));
        ExactCuller::new(triangles, settings).cull(&scene, &cell, &mut both);
        assert_eq!(both.contains(&scene, post), keeps, "a wall on layers {of_wall:#b}");
    }
}
