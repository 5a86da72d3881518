//! The pyramid is updated where tiles have changed. It must equal a pyramid that is computed anew.

use visibility_core::glam::{Affine3A, DVec3, Quat, Vec3};
use visibility_core::{Aabb, OccluderMesh, OcclusionMap, Pose, View, occlusion::Occlusion};
use visibility_hzb::Hzb;
use visibility_testing::Random;

/// Returns a random vector, each coordinate between those of `low` and `high`.
fn within(random: &mut Random, low: [f64; 3], high: [f64; 3]) -> Vec3 {
    DVec3::from_array(std::array::from_fn(|i| random.range(low[i], high[i]))).as_vec3()
}

/// Returns a view from the origin along x, with a vertical field of view of 1.2 radians.
fn view() -> View {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    View::perspective(pose, 1.2, 1.5, 0.1, f64::INFINITY).unwrap()
}

/// Asserts that every texel above the finest level is the least of the finer texels below it, bit for bit.
/// Returns the number of texels without uncovered pixels.
fn check(hzb: &Hzb) -> usize {
    let mut covered = 0;
    for level in 1..hzb.levels() {
        let (columns, rows, fine) = hzb.level(level - 1).unwrap();
        let (half, _, coarse) = hzb.level(level).unwrap();
        for (i, texel) in coarse.iter().enumerate() {
            let (x, y) = (i % half * 2, i / half * 2);
            let mut least = f32::INFINITY;
            for (x, y) in [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)] {
                if x < columns && y < rows {
                    least = least.min(fine[y * columns + x]);
                }
            }
            assert_eq!(texel.to_bits(), least.to_bits(), "level {level}, texel {i}: {texel} for {least}");
            covered += usize::from(*texel > f32::NEG_INFINITY);
        }
    }
    covered
}

#[test]
fn updates_leave_nothing_out() {
    let mut random = Random(7);
    let mut covered = 0;
    for _ in 0..48 {
        let size = [random.range(16.0, 700.0) as usize, random.range(16.0, 500.0) as usize];
        let mut hzb = Hzb::new(size[0], size[1]).unwrap();
        for _ in 0..3 {
            hzb.begin(&view(), DVec3::ZERO);
            assert_eq!(check(&hzb), 0, "pixels covered in a new frame");
            for _ in 0..random.range(1.0, 60.0) as usize {
                let half = within(&mut random, [0.1; 3], [3.0, 12.0, 9.0]);
                let mut mesh = OccluderMesh::cuboid(&Aabb::new(-half, half)).unwrap();
                if random.range(0.0, 1.0) < 0.5 {
                    // Without one of its sides, the mesh is no longer a box, and is drawn as a mesh.
                    mesh = OccluderMesh::from_indexed(mesh.positions(), &mesh.triangles()[2..]).unwrap();
                }
                let turn = Quat::from_rotation_z(random.range(0.0, 6.3) as f32);
                let at = within(&mut random, [2.0, -15.0, -10.0], [40.0, 15.0, 10.0]);
                hzb.add(&mesh, &Affine3A::from_rotation_translation(turn, at));
                if random.range(0.0, 1.0) < 0.3 {
                    hzb.flush();
                    covered += check(&hzb);
                }
            }
            hzb.flush();
            covered += check(&hzb);
        }
    }
    assert!(covered > 100_000, "{covered}");
}

#[test]
fn what_covers_everything_reaches_the_top() {
    let mut hzb = Hzb::new(333, 217).unwrap();
    hzb.begin(&view(), DVec3::ZERO);
    for x in [30.0, 20.0, 10.0] {
        let wall = Aabb::from_arrays([x, -90.0, -90.0], [x + 1.0, 90.0, 90.0]);
        hzb.add(&OccluderMesh::cuboid(&wall).unwrap(), &Affine3A::IDENTITY);
        hzb.flush();
        check(&hzb);
        let (_, _, top) = hzb.level(hzb.levels() - 1).unwrap();
        assert!((top[0] - 1.0 / x).abs() < 1e-3, "{top:?}");
    }
}

#[test]
fn what_begins_before_a_wall_is_drawn_though_it_ends_behind_it() {
    let view =
        View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, f64::INFINITY)
            .unwrap();
    let mut hzb = Hzb::new(128, 128).unwrap();
    hzb.begin(&view, DVec3::ZERO);
    let mut add = |min, max| {
        hzb.add(&OccluderMesh::cuboid(&Aabb::from_arrays(min, max)).unwrap(), &Affine3A::IDENTITY);
        // Flush, so that the pyramid contains this occluder when the next one is added.
        hzb.flush();
    };
    add([10.0, -20.0, -20.0], [11.0, 20.0, 20.0]);
    add([5.0, -2.0, -2.0], [20.0, 2.0, 2.0]);
    assert_eq!(
        hzb.test(&Aabb::from_arrays([7.0, -1.0, -1.0], [9.0, 1.0, 1.0])),
        Occlusion::Hidden,
        "a box between the wall and the second occluder's front"
    );
}
