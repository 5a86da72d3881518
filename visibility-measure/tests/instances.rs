//! Tests that shared triangles are drawn like copies of them, although objects whose box contains no pixel
//! centre are skipped.

use crate::common::pixels;
use visibility_core::glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use visibility_core::scene::{SharedTriangles, Triangle};
use visibility_core::{Pose, View, geometry::Plane};
use visibility_measure::{DrawnObject, ItemBuffer};
use visibility_testing::Random;

/// Returns an object with a key for the item buffer, from its triangles and two flags: see-through,
/// one-sided.
fn drawn(key: u32, (triangles, see_through, one_sided): &(SharedTriangles, bool, bool)) -> DrawnObject<'_> {
    let object = DrawnObject::from((key, triangles.view()));
    DrawnObject { see_through: *see_through, one_sided: *one_sided, ..object }
}

/// Draws objects once as given and once as copies without known bounds, and compares all results. Returns the
/// numbers of visible objects and of tied pixels.
fn compare(view: &View, size: [u32; 2], objects: &[(SharedTriangles, bool, bool)]) -> [u32; 2] {
    let copies: Vec<Vec<Triangle>> =
        objects.iter().map(|(triangles, ..)| triangles.iter().collect()).collect();
    let mut buffers = [(); 2].map(|()| ItemBuffer::new(size[0], size[1]).unwrap());
    let shared: Vec<_> = (0..).zip(objects).map(|(key, object)| drawn(key, object)).collect();
    let plain = shared
        .iter()
        .zip(&copies)
        .map(|(object, copy)| DrawnObject { triangles: copy[..].into(), ..*object });
    buffers[0].draw(view, DVec3::ZERO, shared.iter().copied()).unwrap();
    buffers[1].draw(view, DVec3::ZERO, plain).unwrap();
    let [a, b] = &buffers;
    assert!(
        a.visible() == b.visible() && a.items() == b.items() && a.depth_keys() == b.depth_keys(),
        "items and depths of shared triangles and of copies"
    );
    let panes = |buffer: &ItemBuffer| -> Vec<u32> {
        (0..size[1])
            .flat_map(|row| (0..size[0]).map(move |column| (column, row)))
            .map(|(x, y)| buffer.see_through_item(x, y))
            .collect()
    };
    assert_eq!(panes(a), panes(b), "items seen through panes, of shared triangles and of copies");
    [a.visible().visible_objects(), a.visible().tied_pixels()]
}

#[test]
fn shared_triangles_are_drawn_as_copies() {
    let mut random = Random(11);
    let mut seen = 0;
    for round in 0..60 {
        let eye = random.vec3(-1.0, 1.0).as_dvec3() * if round % 4 == 0 { 1e5 } else { 1.0 };
        let pose = Pose::look_at(eye, eye + DVec3::X + random.direction() * 0.2, DVec3::Z);
        let view = View::perspective(pose, 1.2, 1.5, 0.5, if round % 2 == 0 { 30.0 } else { f64::INFINITY })
            .unwrap();
        let planes = [Plane::new(DVec3::Z, -eye.z - 0.3)];
        let view = view.with_clip_planes(if round % 5 == 0 { &planes } else { &[] }).unwrap();
        let triangles: Vec<Triangle> = (0..3).map(|_| [(); 3].map(|()| random.vec3(-1.0, 1.0))).collect();
        let mesh = SharedTriangles::from(triangles);
        let objects: Vec<_> = (0..60)
            .map(|_| {
                let columns = [(); 3].map(|()| random.vec3(-1.0, 1.0).as_dvec3());
                let at = eye + random.vec3(-12.0, 12.0).as_dvec3();
                let transform = DAffine3 {
                    matrix3: DMat3::from_cols_array_2d(&columns.map(DVec3::into)),
                    translation: at,
                };
                (mesh.placed(transform), random.one_in(3), random.one_in(2))
            })
            .collect();
        seen += compare(&view, [45, 30], &objects)[0];
    }
    assert!(seen > 200, "{seen}");
}

/// Squares, on a wall in their plane, that end within the tie tolerance of a pixel's centre, or beyond it.
#[test]
fn what_only_ties_is_not_passed_over() {
    let square = |low: Vec3, high: Vec3| {
        let [a, b, c, d] = [low, Vec3::new(high.x, low.y, low.z), high, Vec3::new(low.x, high.y, low.z)];
        SharedTriangles::from([[a, b, c], [a, c, d]])
    };
    let wall = square(Vec3::new(-9.0, -9.0, 0.5), Vec3::new(30.0, 30.0, 0.5));
    let unit = square(Vec3::ZERO, Vec3::X + Vec3::Y);
    for (axis, side) in [(0, 0.5), (0, 0.25), (1, 0.5), (1, 0.25)] {
        for (beside, ties) in [(0.0, true), (5e-7, true), (5e-6, false)] {
            // The square ends from a quarter of a pixel before a centre up to just before it.
            let mut at = DVec3::new(4.0, 4.0, 0.5);
            let mut scale = DVec3::new(3.0, 3.0, 1.0);
            at[axis] = 4.5 - beside - side;
            scale[axis] = side;
            let transform = DAffine3::from_scale_rotation_translation(scale, DQuat::IDENTITY, at);
            let objects = [(wall.clone(), false, false), (unit.placed(transform), false, false)];
            let [_, tied] = compare(&pixels(16.0, 16.0), [16, 16], &objects);
            assert_eq!(tied > 0, ties, "{axis} {side} {beside}: {tied}");
        }
    }
}
