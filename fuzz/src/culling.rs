//! Arbitrary bytes as a scene with cameras, culled by one of all cullers. No culler may panic,
//! and a conservative culler must hide nothing that an exact ray sees.
use crate::Bytes;
use crate::oracle;
use visibility_core::glam::DVec4;
use visibility_core::{View, VisibleSet, view::Eye};
use visibility_examples::walkthrough::{World, cullers};
use visibility_testing::{Random, cameras};

/// Runs the target on some bytes. Returns whether a culler has culled the scene from some view.
pub fn run(bytes: &[u8]) -> bool {
    let mut bytes = Bytes::new(bytes);
    let Some(culler) = bytes.byte() else { return false };
    let mut views = Vec::new();
    for _ in 0..2 {
        let (Some(depth), Some(matrix)) = (bytes.byte(), bytes.numbers::<16>()) else { return false };
        let view = View::from_clip_from_world(matrix, cameras::DEPTHS[usize::from(depth) % 6]);
        views.extend(view.ok().filter(is_of_a_camera));
    }
    let source = bytes.scene();
    let world = World::with_views(source, views, Vec::new(), (64, 64));
    let names: Vec<_> = cullers::known().collect();
    let known = names[usize::from(culler) % names.len()];
    let dial = known.dials.first().map_or_else(String::new, |dial| format!(":{dial}"));
    let Ok(mut made) = cullers::parse(&format!("{}{dial}", known.name), &world) else { return false };
    let mut pipeline = made.remove(0).1;
    let mut visible = VisibleSet::new();
    for view in &world.views {
        pipeline.cull(&world.scene, view, &mut visible);
        let mut seen = vec![false; world.source.objects.len()];
        visible.iter(&world.scene).for_each(|id| seen[id.index()] = true);
        if !pipeline.accuracy().never_hides() {
            continue;
        }
        for index in (0..seen.len()).filter(|&index| !seen[index]) {
            let point = oracle::seen_point(
                &world,
                view,
                index,
                pipeline.accuracy(),
                &oracle::Rooms::default(),
                &mut Random(1),
                &mut 0,
            );
            assert_eq!(point, None, "{} hides object {index}", known.name);
        }
    }
    !world.views.is_empty()
}

/// Tests whether the near plane is in front of the eye, as the contract of a view requires.
fn is_of_a_camera(view: &View) -> bool {
    let clip = view.clip_from(view.origin());
    let near: DVec4 =
        cameras::clip_planes(view.depth())[4].iter().map(|&(row, sign)| clip.row(row) * sign).sum();
    // A near plane with a zero normal puts everything or nothing in view.
    if near.truncate().abs().max_element() == 0.0 {
        return false;
    }
    match view.eye(view.origin()) {
        Eye::Point(eye) => near.dot(eye.extend(1.0)) < -1e-9 * near.abs().dot(eye.abs().extend(1.0)),
        Eye::Direction(_) => true,
    }
}
