//! Tests that occluders which surround the eye hide the objects behind them: corners, courtyards, rooms and
//! boxes.

use crate::common::{Occluder, Ray, covered_pixels, draw, faces};
use visibility_core::glam::{Affine3A, Quat, Vec3};
use visibility_core::{OccluderMesh, OcclusionCuller, Pose, View};
use visibility_hzb::{Hom, Hzb, HzbCuller};
use visibility_testing::Random;
use visibility_testing::enclosures::{assert_most_hidden, enclosures};

#[test]
fn the_pyramid_is_filled_by_what_surrounds_the_eye() {
    assert_most_hidden(&|_| Box::new(HzbCuller::new(Hzb::default())), 9, [0.07, 0.015]);
}

#[test]
fn occlusion_maps_are_filled_by_what_surrounds_the_eye() {
    assert_most_hidden(&|_| Box::new(OcclusionCuller::new(Hom::default())), 9, [0.13, 0.02]);
}

/// Tests from inside a closed box that every pixel is covered, however near the eye is to its sides, and that
/// no pixel is farther than its depth key says.
#[test]
fn no_pixel_is_bare_in_a_closed_box() {
    let mut random = Random(3);
    let mut rays = 0;
    for enclosure in enclosures().iter().filter(|enclosure| matches!(enclosure.name, "box" | "tent")) {
        let mesh = OccluderMesh::from_triangles(&enclosure.triangles).unwrap().with_two_sided(true);
        for round in 0..60 {
            let turn = if round % 2 == 0 {
                Quat::IDENTITY
            } else {
                Quat::from_axis_angle(random.direction().as_vec3(), random.range(0.0, 6.0) as f32)
            };
            let transform = Affine3A::from_rotation_translation(turn, random.vec3(-9.0, 9.0));
            let [low, high] = [enclosure.eyes.min + 0.03, enclosure.eyes.max - 0.03];
            let eye = Vec3::from_array(core::array::from_fn(|axis| {
                let inside = random.range(low[axis].into(), high[axis].into()) as f32;
                random.pick(&[low[axis], high[axis], inside, inside])
            }));
            let eye = transform.transform_point3(eye).as_dvec3();
            let pose = Pose::look_at(eye, eye + random.direction(), random.direction());
            let view = View::perspective(pose, random.range(0.5, 1.8), 1.6, 1.0 / 256.0, 200.0).unwrap();
            let occluders = [Occluder { mesh: mesh.clone(), transform }];
            let hzb = draw(Hzb::new(160, 100).unwrap(), &occluders, &view);
            let pixels: Vec<_> = covered_pixels(&hzb).collect();
            assert_eq!(pixels.len(), 16_000, "{}, round {round}, from {eye}, {view:?}", enclosure.name);
            let faces = faces(&occluders);
            for (column, row, stored) in pixels.into_iter().step_by(37) {
                for [x, y] in [[0.0, 0.0], [0.5, 0.5], [1.0, 1.0], [0.0, 1.0]] {
                    let met = Ray::new(&view, [160, 100], column as f64 + x, row as f64 + y).nearest(&faces);
                    rays += 1;
                    assert!(met >= stored - 1e-7 * stored.abs(), "{}: {met} {stored}", enclosure.name);
                }
            }
        }
    }
    assert!(rays > 100_000, "{rays} rays");
}
