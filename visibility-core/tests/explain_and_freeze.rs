//! Tests of a pipeline's diagnostics: which stage removed an object, and culling for one view while drawing
//! another.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, FrustumCuller, Object, OccluderMesh, OcclusionCuller, Pipeline, Pose,
    Scene, View, VisibleSet,
    occlusion::{HardwareQueries, LateAnswers, Occlusion, OcclusionMap, QueryDevice},
    pipeline::Explanation,
    pvs::{Pvs, PvsCuller, PvsTargets, ScenePvs, Viewcell, Viewcells},
    scene::DrawRange,
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
    assert_eq!(
        explained,
        ["visible", "removed by odd", "removed by frustum", "on other layers", "visible"],
        "objects ahead, odd, behind, on another layer and never culled"
    );

    // A new object with the same index has no explanation.
    scene.remove(ahead).unwrap();
    let other = scene.insert(cube(10.0, 0.0));
    assert_eq!(other.index(), ahead.index(), "the new object takes the index of the old");
    assert_eq!(pipeline.explain(other), Explanation::Unknown, "the new object before its first frame");
    pipeline.cull(&scene, &view, &mut visible);
    assert_eq!(pipeline.explain(other), Explanation::Visible, "the new object after its first frame");
    assert_eq!(pipeline.explain(ahead), Explanation::Unknown, "the object that is gone");
    pipeline.set_explaining(false);
    assert_eq!(pipeline.explain(other), Explanation::Unknown, "explaining is turned off");
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
        assert_eq!(
            visible.iter(&scene).collect::<Vec<_>>(),
            [ahead],
            "the object ahead of the frozen view, not of the camera's"
        );
    }
    assert_eq!(pipeline.frozen(), Some(&looking(DVec3::X)), "the view that the pipeline is frozen at");
    pipeline.unfreeze();
    pipeline.cull(&scene, &looking(DVec3::NEG_X), &mut visible);
    assert_eq!(visible.iter(&scene).collect::<Vec<_>>(), [behind], "the object ahead of the camera again");
}

/// A device that counts queries and answers none.
#[derive(Default)]
struct Counter(usize);

impl QueryDevice for Counter {
    fn ask(&mut self, _: u64, _: &[Aabb]) {
        self.0 += 1;
    }

    fn answers(&mut self, _: &mut dyn FnMut(u64, u32)) {}
}

#[test]
fn stages_report_what_they_lack() {
    let mut scene = Scene::new();
    let walls: Vec<_> = (0..20)
        .map(|i| scene.insert(Object { occluder: true, ..Object::new(cube(10.0, i as f32)) }))
        .collect();
    let map = HardwareQueries::new(Counter::default(), LateAnswers::Visible);
    let pvs = Pvs::new(PvsTargets::Objects, 0, &[[0; 0]; 0], |_| []).unwrap();
    let shared = ScenePvs::new(&scene, pvs, Viewcells::new([]), []);
    let pipeline = Pipeline::new()
        .with(FrustumCuller::new())
        .with(OcclusionCuller::new(map))
        .with(PvsCuller::new(std::sync::Arc::new(shared)));
    let lacks = |scene: &Scene| {
        let mut lacks = Vec::new();
        pipeline.for_each_lack(scene, |stage, lack| lacks.push(format!("{stage}: {lack}")));
        lacks
    };
    assert_eq!(lacks(&scene), ["hardware queries: occluders without a mesh: 20"], "no wall has a mesh");
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&cube(10.0, 0.0)).unwrap());
    for &wall in &walls[..12] {
        scene.set_mesh(wall, mesh, visibility_core::glam::Affine3A::IDENTITY).unwrap();
    }
    scene.set_occluder(walls[15], false).unwrap();
    let outside = "hardware queries: occluders with a mesh outside their bounds: 11";
    assert_eq!(
        lacks(&scene),
        ["hardware queries: occluders without a mesh: 7", outside],
        "12 walls have a mesh, 11 of them outside their bounds"
    );
    for (i, &wall) in walls[..12].iter().enumerate() {
        let at = visibility_core::glam::Vec3::Y * i as f32;
        scene.set_mesh(wall, mesh, visibility_core::glam::Affine3A::from_translation(at)).unwrap();
    }
    assert_eq!(
        lacks(&scene),
        ["hardware queries: occluders without a mesh: 7"],
        "the meshes were moved into the bounds"
    );
    let copy = scene.clone();
    assert_eq!(
        lacks(&copy)[1..],
        ["pvs: objects not culled, since the PVS does not know the scene or an occluder has changed: 20"],
        "a PVS knows no object of a copied scene"
    );
    walls[12..].iter().for_each(|&wall| scene.remove(wall).unwrap());
    assert!(lacks(&scene).is_empty(), "{:?}", lacks(&scene));
    assert!(lacks(&Scene::new()).is_empty(), "an empty scene lacks nothing");
}

/// Tests that an occlusion stage reports a scene without occluders and meshes of objects that are not flagged
/// as occluders, through all changes of their number.
#[test]
fn an_occlusion_stage_reports_a_scene_without_occluders_and_meshes_without_the_flag() {
    let mut scene = Scene::new();
    let map = || HardwareQueries::new(Counter::default(), LateAnswers::Visible);
    let pipeline = Pipeline::new().with(OcclusionCuller::new(map()));
    let otherwise_filled = Pipeline::new().with(OcclusionCuller::new(map()).with_price(0));
    let lacks = |scene: &Scene| {
        let mut lacks = Vec::new();
        pipeline.for_each_lack(scene, |_, lack| lacks.push(lack.to_string()));
        otherwise_filled.for_each_lack(scene, |_, lack| panic!("a map that takes no occluder: {lack}"));
        lacks
    };
    let none = |count| format!("objects of which none is flagged as an occluder: {count}");
    let unflagged = |n| format!("objects with an occluder mesh but without the flag of an occluder: {n}");
    let ids: Vec<_> = (0..3).map(|i| scene.insert(cube(10.0, i as f32))).collect();
    assert_eq!(lacks(&scene), [none(3)], "three objects, no flag and no mesh");
    for (i, &id) in ids.iter().enumerate() {
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&cube(10.0, i as f32)).unwrap());
        scene.set_mesh(id, mesh, visibility_core::glam::Affine3A::IDENTITY).unwrap();
    }
    assert_eq!(lacks(&scene), [none(3), unflagged(3)], "three objects with meshes and no flag");
    scene.set_occluder(ids[0], true).unwrap();
    assert_eq!(lacks(&scene), [unflagged(2)], "the first object is flagged");
    assert_eq!(lacks(&scene.clone()), [unflagged(2)], "a clone counts as the scene does");
    scene.set_never_cull(ids[0], true).unwrap();
    let unculled = "occluders that are never culled, and hide nothing: 1".to_owned();
    assert_eq!(lacks(&scene), [unflagged(2), unculled], "the first object is never culled");
    scene.set_never_cull(ids[0], false).unwrap();
    scene.set_bounds(ids[1], cube(20.0, 0.0)).unwrap(); // loses the mesh
    assert_eq!(lacks(&scene), [unflagged(1)], "the second object lost its mesh");
    scene.remove(ids[2]).unwrap();
    assert!(lacks(&scene).is_empty(), "the third object is gone");
    scene.set_occluder(ids[0], false).unwrap();
    assert_eq!(lacks(&scene), [none(2), unflagged(1)], "the first object lost its flag");
    scene.remove_batch(&ids[..2]).unwrap();
    assert!(lacks(&scene).is_empty(), "no object is left");
}

/// Tests that a pipeline reports objects with improper bounds (NaN or inverted), however they got them, and
/// no other objects.
#[test]
fn a_pipeline_reports_bounds_that_are_no_box() {
    let pipeline = Pipeline::new().with(FrustumCuller::new());
    let lacks = |scene: &Scene| {
        let mut lacks = Vec::new();
        pipeline.for_each_lack(scene, |stage, lack| lacks.push(format!("{stage}: {lack}")));
        lacks
    };
    let report = |n| [format!("pipeline: objects whose bounds are NaN or inverted, never culled: {n}")];
    let nan = Aabb::from_arrays([0.0, f32::NAN, 0.0], [1.0; 3]);
    let inverted = Aabb::from_arrays([1.0; 3], [0.0; 3]);
    let mut scene = Scene::new();
    let ids = scene.insert_batch((0..200).map(|i| if i % 2 == 0 { cube(10.0, i as f32) } else { nan }));
    assert_eq!(lacks(&scene), report(100), "half of the objects have bounds that are NaN");
    scene.rebuild();
    scene.set_bounds(ids[1], cube(10.0, 0.0)).unwrap();
    scene.set_bounds(ids[0], inverted).unwrap();
    scene.remove(ids[3]).unwrap();
    assert_eq!(lacks(&scene), report(99), "a NaN was mended, one removed, and one box inverted");
    assert_eq!(lacks(&scene.clone()), report(99), "a clone counts as the scene does");
    let all: Vec<_> = scene.ids().map(|id| (id, cube(10.0, 0.0))).collect();
    scene.set_bounds_batch(&all).unwrap();
    assert!(lacks(&scene).is_empty(), "all bounds were mended");
    // Infinite bounds and objects flagged as never culled are legitimate and not reported.
    scene.insert(Aabb::from_arrays([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]));
    scene.insert(Object { never_cull: true, ..Object::new(cube(0.0, 0.0)) });
    scene.insert(Object { never_cull: true, ..Object::new(nan) });
    assert!(lacks(&scene).is_empty(), "infinite boxes and objects never culled are reported");
}

/// Tests that a baked set says when the eye of the last frame was outside all of its viewcells.
#[test]
fn a_pvs_stage_reports_an_eye_outside_all_viewcells() {
    let mut scene = Scene::new();
    let id = scene.insert(cube(10.0, 0.0));
    let pvs = Pvs::new(PvsTargets::Objects, 1, &[[0; 0]], |_| []).unwrap();
    let cell = Viewcell::from_box(DVec3::splat(-1.0), DVec3::ONE);
    let shared = ScenePvs::new(&scene, pvs, Viewcells::new([cell]), [(id, 0)]);
    let mut pipeline = Pipeline::new().with(PvsCuller::new(std::sync::Arc::new(shared)));
    let mut visible = VisibleSet::new();
    let mut cull_at = |scene: &Scene, x: f64| {
        let pose = Pose::look_at(DVec3::X * x, DVec3::X * (x + 1.0), DVec3::Z);
        pipeline.cull(scene, &View::perspective(pose, 1.0, 1.0, 0.1, 100.0).unwrap(), &mut visible);
        let mut lacks = Vec::new();
        pipeline.for_each_lack(scene, |_, lack| lacks.push(lack.to_string()));
        lacks
    };
    let outside = "objects not culled, the eye being outside all viewcells: 1";
    assert!(cull_at(&scene, 0.0).is_empty(), "the eye is in the viewcell");
    assert_eq!(cull_at(&scene, 3.0), [outside], "the eye is 2 m outside");
    assert!(cull_at(&scene, 0.5).is_empty(), "the eye is back in the viewcell");
}

/// Tests that a shared map issues no queries, while the map of the culler does.
#[test]
fn only_the_owner_of_a_map_asks_its_device() {
    let mut map = HardwareQueries::new(Counter::default(), LateAnswers::Visible);
    map.begin(&looking(DVec3::X), DVec3::ZERO);
    map.flush();
    assert_eq!(
        map.test(&cube(10.0, 0.0)),
        Occlusion::Visible,
        "a map that was shared answers without its device"
    );
    assert_eq!(map.device_mut().0, 0, "`test` asked the device");
    assert_eq!(map.test_mut(&cube(10.0, 0.0)), Occlusion::Visible, "the query has no answer yet");
    assert_eq!(map.device_mut().0, 1, "queries that the device was asked");
    assert_eq!(map.test(&cube(10.0, 0.0)), Occlusion::Visible, "the query is pending");
}

/// A culler that removes objects by size if it is told to.
struct BySize(bool);

impl Culler for BySize {
    fn name(&self) -> &str {
        "by size"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Approximate
    }

    fn follows_sizes(&self) -> bool {
        self.0
    }

    fn cull(&mut self, scene: &Scene, _: &View, visible: &mut VisibleSet) -> CullStats {
        visible.retain(scene, |_, _| true)
    }
}

/// Tests that a pipeline says which stage hides behind objects that another stage removes as too small, in
/// either order.
#[test]
fn a_pipeline_reports_stages_that_hide_behind_what_is_too_small() {
    let mut scene = Scene::new();
    let ids = scene.insert_batch([cube(10.0, 0.0), cube(20.0, 0.0)]);
    let pvs = Pvs::new(PvsTargets::Objects, 1, &[[0; 0]], |_| []).unwrap();
    let cell = Viewcell::from_box(DVec3::splat(-1.0), DVec3::ONE);
    let shared = std::sync::Arc::new(ScenePvs::new(&scene, pvs, Viewcells::new([cell]), [(ids[1], 0)]));
    let lacks = |scene: &Scene, cullers: Vec<Box<dyn Culler + Send + Sync>>| {
        let mut pipeline = Pipeline::new();
        cullers.into_iter().for_each(|culler| pipeline.push(culler));
        let mut lacks = Vec::new();
        pipeline.for_each_lack(scene, |stage, lack| lacks.push(format!("{stage}: {lack}")));
        lacks
    };
    let baked = || -> Box<dyn Culler + Send + Sync> { Box::new(PvsCuller::new(shared.clone())) };
    let by_size = |follows| -> Box<dyn Culler + Send + Sync> { Box::new(BySize(follows)) };
    let lack =
        ["pvs: objects that may be hidden behind others that a stage removes as too small: 2".to_owned()];
    assert_eq!(lacks(&scene, vec![by_size(true), baked()]), lack, "sizes first");
    assert_eq!(lacks(&scene, vec![baked(), by_size(true)]), lack, "sizes last");
    for (what, cullers) in [
        ("no object is too small", vec![by_size(false), baked()]),
        ("no stage for sizes", vec![baked()]),
        ("no stage that hides", vec![by_size(true), Box::new(FrustumCuller::new())]),
    ] {
        assert!(lacks(&scene, cullers).is_empty(), "{what}");
    }
    let shut = lacks(&Scene::new(), vec![by_size(true), baked()]);
    assert!(shut.iter().all(|line| !line.contains("too small")), "an empty scene: {shut:?}");
}

/// A culler that follows draw ranges.
struct ByRange;

impl Culler for ByRange {
    fn name(&self) -> &str {
        "by range"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn follows_draw_ranges(&self) -> bool {
        true
    }

    fn cull(&mut self, scene: &Scene, _: &View, visible: &mut VisibleSet) -> CullStats {
        visible.retain(scene, |_, _| true)
    }
}

/// Tests that a pipeline says which stage hides behind objects before a later one removes them by their draw
/// range, and that no stage follows draw ranges.
#[test]
fn a_pipeline_reports_stages_that_hide_before_draw_ranges_are_followed() {
    type Stage = fn() -> Box<dyn Culler + Send + Sync>;
    let occlusion: Stage = || {
        let map = HardwareQueries::new(Counter::default(), LateAnswers::Visible);
        Box::new(OcclusionCuller::new(map))
    };
    let (frustum, by_range): (Stage, Stage) = (|| Box::new(FrustumCuller::new()), || Box::new(ByRange));
    let early = "hardware queries: occluders that hide others before a later stage may remove them by draw \
                 range or size: 1";
    let none = "pipeline: objects with a draw range that no stage follows: 1";
    for (occluder, stages, expected) in [
        (true, &[occlusion, by_range][..], &[early][..]),
        (true, &[by_range, occlusion, by_range], &[early]),
        (true, &[by_range, occlusion], &[]),
        (true, &[frustum, by_range], &[]),
        (false, &[occlusion, by_range], &[]),
        (true, &[occlusion], &[none]),
        (true, &[], &[none]),
    ] {
        let mut scene = Scene::new();
        scene.insert(Object { occluder, ..Object::new(cube(10.0, 0.0)) });
        let ranged = scene.insert(cube(20.0, 0.0));
        scene.set_draw_range(ranged, DrawRange { end: 9.0, ..DrawRange::ALWAYS }).unwrap();
        let mut pipeline = Pipeline::new();
        stages.iter().for_each(|stage| pipeline.push(stage()));
        let mut lacks = Vec::new();
        pipeline.for_each_lack(&scene, |stage, lack| lacks.push(format!("{stage}: {lack}")));
        lacks.retain(|lack| lack.contains("range"));
        assert_eq!(lacks, expected, "{pipeline:?}, occluder {occluder}");
    }
}

/// A device that answers in the next frame whether a box is on the side of x that the camera looks to.
struct OneSide {
    /// Whether the camera that draws looks along +x. Shared with the test.
    forward: Arc<AtomicBool>,
    answers: Vec<(u64, u32)>,
}

impl QueryDevice for OneSide {
    fn ask(&mut self, query: u64, boxes: &[Aabb]) {
        let forward = self.forward.load(Ordering::Relaxed);
        let shows = boxes.iter().any(|bounds| (bounds.center().x > 0.0) == forward);
        self.answers.push((query, u32::from(shows)));
    }

    fn answers(&mut self, each: &mut dyn FnMut(u64, u32)) {
        self.answers.drain(..).for_each(|(query, samples)| each(query, samples));
    }
}

/// Answers from frames in which the camera looked elsewhere hide nothing, neither while the pipeline is
/// frozen nor afterwards.
#[test]
fn answers_about_another_view_than_the_frozen_one_hide_nothing() {
    for late in [LateAnswers::Visible, LateAnswers::Trusted { frames: 4 }] {
        let mut scene = Scene::new();
        let ahead = scene.insert(cube(10.0, 0.0));
        let forward = Arc::new(AtomicBool::new(true));
        let device = OneSide { forward: forward.clone(), answers: Vec::new() };
        let map = HardwareQueries::new(device, late);
        let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(OcclusionCuller::new(map));
        let mut visible = VisibleSet::new();
        let mut frame = |pipeline: &mut Pipeline, is_forward: bool, what: &str| {
            forward.store(is_forward, Ordering::Relaxed);
            let target = if is_forward { DVec3::X } else { DVec3::NEG_X };
            pipeline.cull(&scene, &looking(target), &mut visible);
            assert!(visible.contains(&scene, ahead), "{late:?}: {what}");
        };
        (0..5).for_each(|_| frame(&mut pipeline, true, "before the freeze"));
        pipeline.freeze();
        (0..10).for_each(|_| frame(&mut pipeline, false, "frozen"));
        pipeline.unfreeze();
        (0..10).for_each(|_| frame(&mut pipeline, true, "after the freeze"));
    }
}
