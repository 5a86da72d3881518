//! Tests of a pipeline's diagnostics: which stage removed an object, and culling for one view while drawing
//! another.
#![allow(missing_docs)]

use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, FrustumCuller, Object, Pipeline, Pose, Scene, View, VisibleSet,
    pipeline::Explanation,
};

fn looking(target: DVec3) -> View {
    View::perspective(Pose::look_at(DVec3::ZERO, target, DVec3::Z), 1.0, 1.0, 0.1, 100.0).unwrap()
}

fn cube(x: f32, y: f32) -> Aabb {
    Aabb::from_arrays([x - 0.5, y - 0.5, -0.5], [x + 0.5, y + 0.5, 0.5])
}

/// A culler that removes the objects with an odd index.
struct Odd;

impl Culler for Odd {
    fn name(&self) -> &str {
        "odd"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Approximate
    }

    fn cull(&mut self, scene: &Scene, _: &View, visible: &mut VisibleSet) -> CullStats {
        visible.retain(scene, |id, _| id.index() % 2 == 0)
    }
}

#[test]
fn each_object_is_explained_by_the_stage_that_removed_it() {
    let mut scene = Scene::new();
    let ahead = scene.insert(cube(10.0, 0.0));
    let odd = scene.insert(cube(12.0, 0.0));
    let behind = scene.insert(cube(-10.0, 0.0));
    let layered = scene.insert(Object { layers: 2, ..Object::new(cube(10.0, 1.0)) });
    let always = scene.insert(Object { never_cull: true, ..Object::new(cube(-20.0, 0.0)) });
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(Odd);
    let mut visible = VisibleSet::new();
    let view = looking(DVec3::X).with_layers(1);
    pipeline.cull(&scene, &view, &mut visible);
    assert_eq!(pipeline.explain(ahead), Explanation::Unknown, "nobody asked");

    pipeline.set_explaining(true);
    pipeline.cull(&scene, &view, &mut visible);
    let explained = [ahead, odd, behind, layered, always].map(|id| pipeline.explain(id).to_string());
    assert_eq!(explained, ["visible", "removed by odd", "removed by frustum", "on other layers", "visible"]);

    // A new object with the same index has no explanation.
    scene.remove(ahead).unwrap();
    let other = scene.insert(cube(10.0, 0.0));
    assert_eq!(other.index(), ahead.index());
    assert_eq!(pipeline.explain(other), Explanation::Unknown);
    pipeline.cull(&scene, &view, &mut visible);
    assert_eq!(pipeline.explain(other), Explanation::Visible);
    assert_eq!(pipeline.explain(ahead), Explanation::Unknown);
    pipeline.set_explaining(false);
    assert_eq!(pipeline.explain(other), Explanation::Unknown);
}

#[test]
fn a_frozen_pipeline_culls_for_the_view_that_it_was_frozen_at() {
    let mut scene = Scene::new();
    let ahead = scene.insert(cube(10.0, 0.0));
    let behind = scene.insert(cube(-10.0, 0.0));
    let mut pipeline = Pipeline::new().with(FrustumCuller::new());
    let mut visible = VisibleSet::new();
    pipeline.freeze();
    assert!(pipeline.frozen().is_none(), "there is no view to freeze at yet");
    pipeline.cull(&scene, &looking(DVec3::X), &mut visible);
    pipeline.freeze();
    for _ in 0..3 {
        pipeline.cull(&scene, &looking(DVec3::NEG_X), &mut visible);
        assert_eq!(visible.iter(&scene).collect::<Vec<_>>(), [ahead]);
    }
    assert_eq!(pipeline.frozen(), Some(&looking(DVec3::X)));
    pipeline.unfreeze();
    pipeline.cull(&scene, &looking(DVec3::NEG_X), &mut visible);
    assert_eq!(visible.iter(&scene).collect::<Vec<_>>(), [behind]);
}
