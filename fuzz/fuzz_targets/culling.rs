//! Fuzz target: arbitrary bytes as a scene with cameras, culled by one of all cullers. No culler may panic,
//! and a culler that promises to hide no visible object hides nothing that an exact ray sees.
#![no_main]

#[path = "../../examples/tests/extremes/oracle.rs"]
mod oracle;

use libfuzzer_sys::fuzz_target;
use visibility_core::glam::DVec4;
use visibility_core::{view::Eye, View, VisibleSet};
use visibility_examples::walkthrough::{World, cullers};
use visibility_examples::{SceneSource, SourceObject};
use visibility_testing::{Random, cameras};

/// Reader of numbers from the front of a slice of bytes.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    /// Reads the next byte; `None` at the end of the bytes.
    fn byte(&mut self) -> Option<u8> {
        let (&first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(first)
    }

    /// Reads a number of arbitrary bits, or (for most first bytes) a small number, so that some scenes have
    /// objects in view. `None` at the end.
    fn number(&mut self) -> Option<f32> {
        Some(match self.byte()? {
            0 => f32::from_le_bytes([self.byte()?, self.byte()?, self.byte()?, self.byte()?]),
            small => (f32::from(small) - 128.0) / 16.0,
        })
    }

    /// Reads N numbers one after another; `None` if the bytes end before the last number.
    fn numbers<const N: usize>(&mut self) -> Option<[f32; N]> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.number()?;
        }
        Some(numbers)
    }
}

fuzz_target!(|bytes: &[u8]| {
    let mut bytes = Bytes(bytes);
    let Some(culler) = bytes.byte() else { return };
    let mut views = Vec::new();
    for _ in 0..2 {
        let (Some(depth), Some(matrix)) = (bytes.byte(), bytes.numbers::<16>()) else { return };
        let view = View::from_clip_from_world(matrix, cameras::DEPTHS[usize::from(depth) % 6]);
        views.extend(view.ok().filter(is_of_a_camera));
    }
    let mut objects = vec![SourceObject::new("0", Vec::new())];
    while let Some(triangle) = bytes.numbers::<9>() {
        let corner = |i: usize| triangle[i..i + 3].try_into().map(glam_point).expect("three numbers");
        if bytes.0.first().is_some_and(|byte| byte % 4 == 0) {
            objects.push(SourceObject::new("another", Vec::new()));
        }
        let last = objects.len() - 1;
        objects[last].triangles.push([corner(0), corner(3), corner(6)]);
    }
    let source = SceneSource {
        name: "fuzz".into(),
        up: glam_point([0.0, 0.0, 1.0]),
        near: 0.1,
        objects,
        walks: Vec::new(),
        cells: None,
    };
    let world = World::with_views(source, visibility_core::glam::DVec3::ZERO, views, Vec::new(), (64, 64));
    let names: Vec<_> = cullers::known().collect();
    let known = names[usize::from(culler) % names.len()];
    let dial = known.dials.first().map_or_else(String::new, |dial| format!(":{dial}"));
    let Ok(mut made) = cullers::parse(&format!("{}{dial}", known.name), &world) else { return };
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
});

/// Tests whether the near plane is in front of the eye, which a view requires of its matrix.
fn is_of_a_camera(view: &View) -> bool {
    let clip = view.clip_from(view.origin());
    let near: DVec4 =
        cameras::clip_planes(view.depth())[4].iter().map(|&(row, sign)| clip.row(row) * sign).sum();
    // A near plane without a direction leaves nothing or everything in view.
    if near.truncate().abs().max_element() == 0.0 {
        return false;
    }
    match view.eye(view.origin()) {
        Eye::Point(eye) => near.dot(eye.extend(1.0)) < -1e-9 * near.abs().dot(eye.abs().extend(1.0)),
        Eye::Direction(_) => true,
    }
}

fn glam_point(point: [f32; 3]) -> visibility_core::glam::Vec3 {
    point.into()
}
