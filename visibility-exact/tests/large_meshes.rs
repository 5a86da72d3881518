//! Parts of a mesh of many triangles are proven hidden by boxes around them.

mod common;

use common::{Triangle, check, cuboid, prepared, quad};
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_exact::{Effort, ExactCuller, Settings, Verdict};

/// Crumpled sheets of a thousand triangles each behind both wings of a wall, which are one object, and a
/// viewcell that looks through the gap between the wings: at no sheet, but at the box around both.
fn world(with_corner_in_gap: bool) -> Vec<Vec<Triangle>> {
    let mut mesh = Vec::new();
    for side in [-1.0, 1.0] {
        for k in 0..500 {
            let (y, z) = (f64::from(k % 25) * 0.2 + 3.0, f64::from(k / 25) * 0.2 - 2.0);
            let corner = |i: u32, j: u32| {
                let x = 12.0 + 0.3 * f64::from((k % 25 + i) * 7 % 5) + 0.2 * f64::from((k / 25 + j) * 3 % 4);
                DVec3::new(x, side * (y + f64::from(i) * 0.2), z + f64::from(j) * 0.2)
            };
            mesh.extend(quad(corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)));
        }
    }
    if with_corner_in_gap {
        let tip = [(12.0, 3.0, 0.0), (12.0, 0.0, 0.1), (12.1, 3.0, 0.1)];
        mesh.push(tip.map(|(x, y, z)| DVec3::new(x, y, z).as_vec3()));
    }
    let wing = |from: f64, to: f64| cuboid(DVec3::new(6.0, from, -9.0), DVec3::new(6.5, to, 9.0));
    vec![mesh, wing(-20.0, -0.5), wing(0.5, 20.0)]
}

fn verdict(objects: &[Vec<Triangle>]) -> (Verdict, u64, usize) {
    let triangles = prepared(objects);
    let settings =
        Settings { rays: 0, aimed_rays: 0, keep_proofs: true, ..Settings::new(Effort::Exact(1e-4)) };
    let mut culler = ExactCuller::new(triangles.clone(), settings);
    let found = culler.verdicts(&Viewcell::from_box(DVec3::splat(-0.2), DVec3::splat(0.2)));
    let proofs = check(objects, &triangles, &found);
    let (_, verdict) = found.iter(&triangles).next().unwrap();
    (verdict, found.nodes, proofs)
}

#[test]
fn a_mesh_in_two_hidden_parts_takes_fewer_nodes_than_it_has_triangles() {
    let objects = world(false);
    let (verdict, nodes, proofs) = verdict(&objects);
    assert_eq!(verdict, Verdict::Hidden);
    assert!(nodes < objects[0].len() as u64 / 4, "{nodes} nodes for {} triangles", objects[0].len());
    assert!((2..40).contains(&proofs), "{proofs}");
}

#[test]
fn one_triangle_of_a_large_mesh_that_is_seen_is_found() {
    let (verdict, ..) = verdict(&world(true));
    assert!(matches!(verdict, Verdict::Seen(witness) if witness.triangle == 2000), "{verdict:?}");
}
