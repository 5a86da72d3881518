//! Scenes of any scale, from 1e-15 to 1e15, with ratios of far to near plane up to 1e9: boxes that are
//! clearly hidden or clearly visible are decided correctly. Clip matrices may have any factor.

use crate::common::{occluder, view};
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{Aabb, OccluderMesh, OcclusionMap, Pose, View, occlusion::Occlusion};
use visibility_hzb::{Coverage, Hom, Hzb};
use visibility_testing::Random;

/// Returns walls that face an eye at the origin looking along x, at a distance of 5 times `scale` metres: a
/// box, a sheet of many triangles, and a sheet of two.
fn walls(scale: f32) -> Vec<OccluderMesh> {
    let at = |i: u32, j: u32, x: f32| Vec3::new(x, i as f32 * 2.0 - 8.0, j as f32 * 2.0 - 8.0) * scale;
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..9 {
        for j in 0..9 {
            positions.push(at(i, j, 5.0 + 0.1 * ((i * j) % 3) as f32));
        }
    }
    for i in 0..8 {
        for j in 0..8 {
            let [a, b, c, d] = [9 * i + j, 9 * (i + 1) + j, 9 * (i + 1) + j + 1, 9 * i + j + 1];
            triangles.extend([[a, c, b], [a, d, c]]);
        }
    }
    let box_ = Aabb::new(Vec3::new(5.0, -8.0, -8.0) * scale, Vec3::new(5.2, 8.0, 8.0) * scale);
    let corners = [at(0, 0, 5.0), at(8, 0, 5.0), at(8, 8, 5.0), at(0, 8, 5.0)];
    [
        OccluderMesh::cuboid(&box_),
        OccluderMesh::from_indexed(&positions, &triangles),
        OccluderMesh::from_indexed(&corners, &[[0, 2, 1], [0, 3, 2]]),
    ]
    .map(|mesh| mesh.unwrap().with_two_sided(true))
    .into()
}

#[test]
fn scenes_of_any_size_are_decided_alike() {
    for exponent in -15..=15 {
        let scale = 10f64.powi(exponent);
        let cube = |x: f32, half: f32| {
            let middle = Vec3::new(x, 0.3, -0.2);
            let (min, max) = (middle - half, middle + half);
            Aabb::new(min * scale as f32, max * scale as f32)
        };
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        for (near, far) in [(0.1, 1e8), (1e-6, 1e3), (1e-4, f64::INFINITY)] {
            let view = View::perspective(pose, 1.2, 1.6, near * scale, far * scale).unwrap();
            for (i, wall) in walls(scale as f32).iter().enumerate() {
                for coverage in [Coverage::Conservative, Coverage::Sampled] {
                    let mut hzb = Hzb::new(64, 40).unwrap().with_coverage(coverage);
                    hzb.begin(&view, DVec3::ZERO);
                    hzb.add(wall, &Affine3A::IDENTITY);
                    hzb.flush();
                    let what = format!("scale 1e{exponent}, near {near}, far {far}, wall {i}, {coverage:?}");
                    assert_eq!(hzb.test(&cube(8.0, 0.5)), Occlusion::Hidden, "{what}");
                    assert_eq!(hzb.test(&cube(900.0, 20.0)), Occlusion::Hidden, "{what}");
                    assert_ne!(hzb.test(&cube(3.0, 0.5)), Occlusion::Hidden, "{what}");
                    assert_ne!(hzb.test(&cube(5.0, 0.5)), Occlusion::Hidden, "{what}");
                }
            }
        }
    }
}

/// A factor of the clip matrix changes no answer. A power of two multiplies without rounding, so it does not
/// even change depth keys.
#[test]
fn a_clip_matrix_times_any_factor_gives_the_same_answers() {
    let mut random = Random(43);
    let mut hidden = 0;
    for round in 0..60 {
        let view = view(&mut random);
        let occluders: Vec<_> = (0..20).map(|_| occluder(&mut random)).collect();
        let boxes: Vec<_> = (0..200)
            .map(|_| (random.vec3(-9.0, 9.0), random.fine_range(0.01, 0.5) as f32))
            .map(|(middle, half)| Aabb::new(middle - half, middle + half))
            .collect();
        let answers = |exponent: i32| {
            let matrix = view.clip_from(DVec3::ZERO) * 2f64.powi(exponent);
            let view = View::from_clip_from_world(matrix, view.depth()).unwrap();
            let (mut hzb, mut hom) = (Hzb::new(64, 40).unwrap(), Hom::new(64, 40).unwrap());
            for map in [&mut hzb as &mut dyn OcclusionMap, &mut hom] {
                map.begin(&view, DVec3::ZERO);
                for o in &occluders {
                    map.add(&o.mesh, &o.transform);
                }
                map.flush();
            }
            let depths: Vec<_> = (0..64 * 40).map(|i| hzb.depth_key(i % 64, i / 64)).collect();
            let answers: Vec<_> = boxes.iter().map(|b| (hzb.test(b), hom.test(b))).collect();
            (answers, depths)
        };
        let expected = answers(0);
        hidden += expected.0.iter().filter(|(hzb, _)| *hzb == Occlusion::Hidden).count();
        for exponent in [-700, -350, -143, -130, 1, 100, 300] {
            assert!(answers(exponent) == expected, "round {round}, times 2^{exponent}");
        }
    }
    assert!(hidden > 1000, "something is hidden: {hidden}");
}
