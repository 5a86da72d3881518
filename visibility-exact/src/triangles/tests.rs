//! Joining coplanar triangles into convex polygons.

use super::*;
use visibility_core::{Aabb, Object};
use visibility_testing::Random;

fn prepared(triangles: impl IntoIterator<Item = [Vec3; 3]>) -> SceneTriangles {
    let triangles: Vec<[Vec3; 3]> = triangles.into_iter().collect();
    let mut scene = Scene::new();
    let bounds = Aabb::from_points(triangles.as_flattened().iter().copied());
    let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    scene.set_triangles(id, triangles).unwrap();
    SceneTriangles::new(&scene)
}

/// Two slivers that share their longest side are joined if both are exactly in the plane x = y + z. They are
/// not joined if the second is off this plane, even if it is in the inexact plane that `f64` computes for the
/// first.
#[test]
fn slivers_in_one_plane_are_one_piece() {
    let mut random = Random(7);
    let (mut merged, mut off) = (0, 0);
    for round in 0..500 {
        // Multiples of 2^-52 near the origin, and of 2^-20 elsewhere, so that sums are exact in `f32`.
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
        // A point near a, on the other side of the edge a-b than c.
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

/// Joined polygons are convex: all corners are on the inner side of each edge, or on the edge. The triangles
/// all lie in one plane. Most share an edge with the triangle before them; some are slivers, and some are
/// folded back over that triangle.
#[test]
fn pieces_are_convex() {
    let mut random = Random(9);
    let mut joined = 0;
    for _ in 0..2000 {
        let mut all: Vec<[Vec3; 3]> = Vec::new();
        for _ in 0..8 {
            let mut point = || Vec3::new(random.between(-3, 3) as f32, random.between(-3, 3) as f32, 1.0);
            let (a, b, c) = (point(), point(), point());
            let side = all.last().map(|t| [t[random.below(3)], t[random.below(3)]]);
            // Two neighbours have their common side in opposite directions, also if one is folded back over
            // the other.
            let t = side.map_or([a, b, c], |[x, y]| if x == y { [a, b, c] } else { [y, x, c] });
            all.push(t);
        }
        let scene = prepared(all);
        for piece in scene.pieces.iter().filter(|piece| piece.triangles.len() > 1) {
            joined += usize::from(piece.triangles.len() > 2);
            let n = piece.positions.len();
            for (k, &x) in piece.positions.iter().enumerate() {
                let along = piece.positions[(k + 1) % n] - x;
                let normal = unit_normal(&scene.corners(piece.triangles[0])).unwrap();
                let least =
                    piece.positions.iter().map(|y| along.cross(*y - x).dot(normal)).fold(f64::MAX, f64::min);
                assert!(least >= -1e-9, "{:?}", piece.positions);
            }
        }
    }
    assert!(joined > 10, "{joined}");
}
