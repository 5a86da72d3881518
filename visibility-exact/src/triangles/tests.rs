//! Convex polygons of coplanar triangles.

use super::*;
use visibility_core::{Aabb, Object};
use visibility_testing::Random;

fn prepared(triangles: [[Vec3; 3]; 2]) -> SceneTriangles {
    let mut scene = Scene::new();
    let bounds = Aabb::from_points(triangles.into_iter().flatten());
    let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    scene.set_triangles(id, triangles).unwrap();
    SceneTriangles::new(&scene)
}

/// Two slivers that share their longest side are one piece if both are in the plane x = y + z, exactly,
/// and two if the second is off this plane but in the plane that `f64` finds for the first.
#[test]
fn slivers_in_one_plane_are_one_piece() {
    let mut random = Random(7);
    let (mut merged, mut off) = (0, 0);
    for round in 0..500 {
        // Multiples of 2^-52 near the origin, and of 2^-20 elsewhere: sums are single-precision numbers.
        let mut int = |r: i32, unit: i32| f64::from(random.between(-r, r)) * 2f64.powi(unit);
        let (near, half) = ([int(1 << 22, -52), int(1 << 22, -52)], [int(1 << 21, -20), int(1 << 21, -20)]);
        let across = [int(4, -20), int(4, -20)];
        if half[0] * across[1] == half[1] * across[0] {
            continue;
        }
        let beside = |s: f64| [0, 1].map(|k| half[k] + s * across[k]);
        let corners = [near, half.map(|x| 2.0 * x), beside(1.0), beside(-1.0)];
        let [a, b, c, d] = corners.map(|[y, z]| DVec3::new(y + z, y, z));
        let single = |t: [DVec3; 3]| t.map(DVec3::as_vec3);
        let all = single([a, b, c]).into_iter().chain([d.as_vec3()]);
        assert!(all.zip([a, b, c, d]).all(|(x, y)| x.as_dvec3() == y), "{round}");
        merged += usize::from(prepared([single([a, b, c]), single([b, a, d])]).pieces.len() == 1);
        // Near a, at the other side of a-b than c.
        let inexact = (c - b).cross(a - b).normalize();
        let mut e = (a - DVec3::new(across[0] + across[1], across[0], across[1]) * 1e-3).as_vec3();
        e.x = (b.x - ((e.y as f64 - b.y) * inexact.y + (e.z as f64 - b.z) * inexact.z) / inexact.x) as f32;
        let height = (f64::from(e.x) - f64::from(e.y) - f64::from(e.z)) / 3f64.sqrt();
        let apart = prepared([single([b, c, a]), [a.as_vec3(), e, b.as_vec3()]]);
        if height.abs() > 4.0 * apart.position_error(0.0) {
            off += 1;
            assert_eq!(apart.pieces.len(), 2, "{round}: {height} m off the plane");
        }
    }
    assert!(merged > 450 && off > 250, "{merged} {off}");
}
