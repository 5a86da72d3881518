//! Tests of levels of detail through the C interface: the answers are those of the Rust crates, for a scene
//! that both are given, frame by frame.

mod common;

use common::{make, message, ok, returns};
use std::ptr::{null, null_mut};
use visibility::vis_status::*;
use visibility::*;
use visibility_core::glam::DVec3;
use visibility_core::scene::DrawRange;
use visibility_core::{Aabb, FrustumCuller, ObjectId, Pose, Scene, View, VisibleSet};
use visibility_frame::lod::{ContributionCuller, LodSelector};
use visibility_testing::Random;

/// Sizes in pixels that divide the levels of each kind of mesh. The last kind has one level.
const KINDS: [&[f32]; 3] = [&[400.0, 90.0, 30.0], &[150.0], &[]];
/// Number of objects; the last is the parent of those before it, from `FIRST_CHILD` on.
const COUNT: usize = 300;
const FIRST_CHILD: usize = 290;

/// Returns the boxes of a street along x, and last the box around the last ones before it.
fn boxes() -> Vec<vis_box> {
    let mut random = Random(7);
    let mut boxes: Vec<vis_box> = (0..COUNT - 1)
        .map(|i| {
            let x = if i < FIRST_CHILD { random.range(-20.0, 120.0) } else { random.range(70.0, 80.0) };
            let at = [x, random.range(-15.0, 15.0), 0.0].map(|x| x as f32);
            let size = random.range(0.2, 4.0) as f32;
            vis_box { min: at, max: at.map(|x| x + size) }
        })
        .collect();
    let around = boxes[FIRST_CHILD..].iter().fold(([f32::MAX; 3], [f32::MIN; 3]), |(min, max), one| {
        let axes = [0, 1, 2];
        (axes.map(|i| min[i].min(one.min[i])), axes.map(|i| max[i].max(one.max[i])))
    });
    boxes.push(vis_box { min: around.0, max: around.1 });
    boxes
}

/// The same street for both: object `i` has sizes of kind `i % 3`, every fifth a draw range with a margin.
struct Street {
    scene: *mut vis_scene,
    ids: Vec<u64>,
    rust: Scene,
}

impl Street {
    fn new() -> Self {
        let boxes = boxes();
        let scene = make(vis_scene_create);
        let descs: Vec<_> = boxes.iter().map(|&bounds| vis_object_default(bounds)).collect();
        let (mut ids, mut rust) = (vec![0; COUNT], Scene::new());
        let own = rust.insert_batch(boxes.iter().map(|&vis_box { min, max }| Aabb::from_arrays(min, max)));
        // SAFETY: handles are live, and arrays as long as said.
        unsafe {
            ok(vis_scene_insert_batch(scene, descs.as_ptr(), COUNT, ids.as_mut_ptr()));
            for (kind, sizes) in KINDS.iter().enumerate() {
                let of: Vec<u64> = ids.iter().copied().skip(kind).step_by(KINDS.len()).collect();
                ok(vis_scene_set_lod_sizes(scene, of.as_ptr(), of.len(), sizes.as_ptr(), sizes.len()));
            }
            for i in (0..FIRST_CHILD).step_by(5) {
                let range = DrawRange { begin: (i % 4) as f32, end: 60.0, margin: 20.0 };
                rust.set_draw_range(own[i], range).expect("a range");
                ok(vis_scene_set_draw_range_with_margin(scene, ids[i], range.begin, range.end, range.margin));
            }
            let parent = COUNT - 1;
            let begin = DrawRange { begin: 40.0, ..DrawRange::ALWAYS };
            rust.set_draw_range(own[parent], begin).expect("a range");
            ok(vis_scene_set_draw_range(scene, ids[parent], 40.0, f32::INFINITY));
            for i in FIRST_CHILD..parent {
                rust.set_hlod_parent(own[i], Some(own[parent])).expect("a parent");
                ok(vis_scene_set_hlod_parent(scene, ids[i], ids[parent]));
            }
        }
        Self { scene, ids, rust }
    }
}

/// Reads the levels of the last frame.
fn selected(lods: *const vis_lods) -> Vec<vis_lod> {
    let mut count = 0;
    let none = vis_lod { object: 0, level: 9, previous: 9, fade: 9.0, opacity: 9.0 };
    // SAFETY: the handle is live, and the list as long as said.
    unsafe {
        ok(vis_lods_selected(lods, null_mut(), 0, &raw mut count));
        let mut list = vec![none; count];
        ok(vis_lods_selected(lods, list.as_mut_ptr(), count, &raw mut count));
        list
    }
}

#[test]
fn levels_are_those_of_the_crates_frame_by_frame() {
    let Street { scene, ids, rust } = Street::new();
    let (view, pipeline) = (make(vis_view_create), make(vis_pipeline_create));
    let (mut lods, mut visible) = (null_mut(), null_mut());
    // SAFETY: handles are live.
    unsafe {
        ok(vis_visible_create(false, &raw mut visible));
        ok(vis_lods_create(1080.0, 0.2, 0.1, &raw mut lods));
        ok(vis_pipeline_add_frustum(pipeline));
        ok(vis_pipeline_add_contribution(pipeline, 1080.0, 9.0));
    }
    let mut selector = LodSelector::new(1080.0).with_hysteresis(0.2).with_fade(0.1);
    let (mut frustum, mut contribution) = (FrustumCuller::new(), ContributionCuller::new(1080.0, 9.0));
    let mut set = VisibleSet::new();
    let (mut levels, mut fades, mut transparent, mut parents, mut hidden) = ([0; 4], 0, 0, 0, 0);
    for frame in 0..120 {
        let x = f64::from(frame) * 0.6;
        let pose = vis_pose { eye: [x, 0.0, 1.7], target: [x + 1.0, 0.1, 1.7], up: [0.0, 0.0, 1.0] };
        let [eye, target, up] = [pose.eye, pose.target, pose.up].map(DVec3::from_array);
        let own = View::perspective(Pose::look_at(eye, target, up), 1.0, 1.5, 0.1, 500.0).expect("a view");
        // Some frames are of a smaller window, some of the light that stands 30 m behind the camera.
        let (height, pixels) = if (40..60).contains(&frame) { (500.0, 4.0) } else { (1080.0, 9.0) };
        let far = (80..100).contains(&frame).then_some([x - 30.0, 0.0, 9.0]);
        let point = far.as_ref().map_or(null(), |point| point.as_ptr());
        let seconds = 0.02;
        // SAFETY: handles are live, and arrays as long as said.
        unsafe {
            ok(vis_view_set_perspective(view, &raw const pose, 1.0, 1.5, 0.1, 500.0));
            ok(vis_lods_set_picture_height(lods, height));
            ok(vis_lods_set_distance_eye(lods, point));
            ok(vis_pipeline_set_contribution(pipeline, height, pixels, point));
            if frame == 30 {
                ok(vis_lods_reset(lods));
            }
            ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
            ok(vis_lods_select(lods, scene, view, visible, seconds));
        }
        let far = far.map(DVec3::from_array);
        selector.set_picture_height(height);
        selector.set_distance_eye(far);
        contribution.set_picture_height(height);
        contribution.set_min_pixels(pixels);
        contribution.set_distance_eye(far);
        if frame == 30 {
            selector.reset();
        }
        set.fill(&rust, &own);
        for culler in [&mut frustum as &mut dyn visibility_core::Culler, &mut contribution] {
            culler.cull(&rust, &own, &mut set);
        }
        set.finish(&rust);
        selector.select(&rust, &own, &set, seconds, |id| KINDS[id.index() % KINDS.len()]);
        let list = selected(lods);
        let found: Vec<_> = list
            .iter()
            .map(|lod| {
                (ObjectId::from_bits(lod.object).index(), lod.level, lod.previous, lod.fade, lod.opacity)
            })
            .collect();
        let expected: Vec<_> = selector
            .selected()
            .iter()
            .map(|(id, lod)| (id.index(), lod.level.into(), lod.previous.into(), lod.fade, lod.opacity))
            .collect();
        assert_eq!(found, expected, "frame {frame}: index, level, previous, fade and opacity");
        for lod in &list {
            let mut one = *lod;
            one.level = 9;
            // SAFETY: handles are live.
            ok(unsafe { vis_lods_lod(lods, lod.object, &raw mut one) });
            assert_eq!(one, *lod, "frame {frame}: an object by its id and in the list");
            levels[lod.level as usize] += 1;
            fades += usize::from(lod.fade < 1.0);
            transparent += usize::from(lod.opacity < 1.0);
            parents += usize::from(lod.object == ids[COUNT - 1]);
        }
        let mut none = list.first().copied().expect("something is visible");
        for &id in ids.iter().filter(|&&id| list.iter().all(|lod| lod.object != id)) {
            // SAFETY: handles are live.
            ok(unsafe { vis_lods_lod(lods, id, &raw mut none) });
            assert_eq!(none.object, VIS_NO_OBJECT, "frame {frame}: an object that is not visible");
            hidden += 1;
        }
    }
    assert!(levels.iter().all(|&level| level > 50), "objects of each level: {levels:?}");
    assert!(fades > 50 && transparent > 50, "{fades} in a fade, {transparent} transparent");
    assert!((10..110).contains(&parents), "the parent was drawn in {parents} of 120 frames");
    assert!(hidden > 1000, "{hidden} hidden");
    // SAFETY: handles are live.
    unsafe {
        vis_lods_destroy(lods);
        vis_visible_destroy(visible);
        vis_pipeline_destroy(pipeline);
        vis_view_destroy(view);
        vis_scene_destroy(scene);
    }
}

/// Asserts that a call was refused with a message.
#[track_caller]
fn refused(status: vis_status, expected: vis_status, said: &str) {
    returns(status, expected);
    assert_eq!(message(), said, "message of a call that was refused with {expected:?}");
}

#[test]
fn what_is_wrong_with_levels_is_refused_by_name() {
    let Street { scene, ids, .. } = Street::new();
    let (view, pipeline) = (make(vis_view_create), make(vis_pipeline_create));
    let (mut lods, mut visible, mut lod) =
        (null_mut(), null_mut(), vis_lod { object: 7, level: 7, previous: 7, fade: 7.0, opacity: 7.0 });
    let pose = vis_pose { eye: [0.0, 0.0, 1.7], target: [1.0, 0.0, 1.7], up: [0.0, 0.0, 1.0] };
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        let wrong = VIS_ERROR_ARGUMENT;
        refused(
            vis_lods_create(f64::NAN, 0.1, 0.0, &raw mut lods),
            wrong,
            "the picture height cannot be NaN",
        );
        refused(vis_lods_create(-1.0, 0.1, 0.0, &raw mut lods), wrong, "the picture height cannot be -1");
        refused(vis_lods_create(1.0, 0.91, 0.0, &raw mut lods), wrong, "the hysteresis cannot be 0.91");
        refused(vis_lods_create(1.0, 0.1, f32::INFINITY, &raw mut lods), wrong, "the fade cannot be inf");
        assert!(lods.is_null(), "no handle was made");
        ok(vis_lods_create(1080.0, 0.1, 0.0, &raw mut lods));
        ok(vis_visible_create(false, &raw mut visible));
        let select = |seconds| vis_lods_select(lods, scene, view, visible, seconds);
        refused(select(-1.0), wrong, "the elapsed time cannot be -1");
        refused(select(0.0), VIS_ERROR_STATE, "the view has no camera yet");
        ok(vis_view_set_perspective(view, &raw const pose, 1.0, 1.5, 0.1, 500.0));
        refused(select(0.0), VIS_ERROR_STATE, "no pipeline has culled into the set of visible objects");
        refused(
            vis_pipeline_set_contribution(pipeline, 1.0, 1.0, null()),
            VIS_ERROR_STATE,
            "the pipeline has no contribution culling",
        );
        let eye = [0.0, f64::NAN, 0.0];
        refused(vis_lods_set_distance_eye(lods, eye.as_ptr()), wrong, "`eye` is not finite");
        refused(
            vis_pipeline_set_contribution(pipeline, 1.0, 1.0, eye.as_ptr()),
            wrong,
            "`distance_eye` is not finite",
        );
        refused(vis_lods_set_picture_height(lods, -0.5), wrong, "the picture height cannot be -0.5");
        ok(vis_pipeline_add_frustum(pipeline));
        ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
        ok(select(0.0));
        let before = selected(lods);
        let set = |ids: &[u64], sizes: &[f32]| {
            vis_scene_set_lod_sizes(scene, ids.as_ptr(), ids.len(), sizes.as_ptr(), sizes.len())
        };
        refused(set(&ids, &[1.0, 0.0]), wrong, "size 1 cannot be 0");
        refused(set(&ids, &[f32::NAN]), wrong, "size 0 cannot be NaN");
        refused(set(&ids, &[1.0; 256]), wrong, "256 sizes are more than 255");
        returns(set(&[ids[0], VIS_NO_OBJECT], &[1e9]), VIS_ERROR_UNKNOWN_ID);
        returns(vis_scene_set_draw_range_with_margin(scene, ids[0], 0.0, 9.0, -1.0), wrong);
        ok(select(0.0));
        assert_eq!(selected(lods), before, "refused calls change nothing");
        // All have the greatest number of levels; one object loses its sizes.
        ok(set(&ids, &[1e9; 255]));
        ok(set(&before.iter().map(|lod| lod.object).take(1).collect::<Vec<_>>(), &[]));
        ok(vis_lods_reset(lods));
        ok(select(0.0));
        let levels: Vec<u32> = selected(lods).iter().map(|lod| lod.level).collect();
        let last = levels.iter().filter(|&&level| level == 255).count();
        assert_eq!(levels[0], 0, "the level of an object without sizes");
        assert!(last > levels.len() / 2, "{last} of {} have the last level", levels.len());
        // An object that takes the index of another one does not take its sizes.
        let first = before[0].object;
        ok(set(&[first], &[1e9; 3]));
        let (bounds, mut later) = (boxes()[first as u32 as usize], 0);
        ok(vis_scene_remove(scene, first));
        ok(vis_scene_insert(scene, &vis_object_default(bounds), &raw mut later));
        assert_eq!(later as u32, first as u32, "the index of the removed object");
        ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
        ok(select(0.0));
        ok(vis_lods_lod(lods, later, &raw mut lod));
        assert_eq!((lod.object, lod.level), (later, 0), "the new object has no sizes");
        ok(vis_lods_lod(lods, first, &raw mut lod));
        assert_eq!(lod.object, VIS_NO_OBJECT, "the removed object");
        vis_lods_destroy(lods);
        vis_lods_destroy(null_mut());
        vis_visible_destroy(visible);
        vis_pipeline_destroy(pipeline);
        vis_view_destroy(view);
        vis_scene_destroy(scene);
    }
}
