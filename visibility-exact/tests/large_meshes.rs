//! Parts of a mesh of many triangles are proven hidden by boxes around them.

use crate::common::{Triangle, check, clearance, cuboid, prepared, quad};
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_exact::{CellQuery, Effort, ExactCuller, ExactSettings, Verdict};
use visibility_testing::Random;

/// Makes a mesh of two crumpled sheets of a thousand triangles each, one behind either wing of a wall. The
/// viewcell looks through the gap between the wings, past both sheets, but at the box around both.
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
    let settings = ExactSettings::new(Effort::Exact(1e-4)).with_rays(0).with_aimed_rays(0).with_kept_proofs();
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
    assert_eq!(verdict, Verdict::Hidden, "the mesh in two parts is hidden");
    assert!(nodes < objects[0].len() as u64 / 4, "{nodes} nodes for {} triangles", objects[0].len());
    assert!((2..40).contains(&proofs), "{proofs}");
}

#[test]
fn one_triangle_of_a_large_mesh_that_is_seen_is_found() {
    let (verdict, ..) = verdict(&world(true));
    assert!(matches!(verdict, Verdict::Seen(witness) if witness.triangle == 2000), "{verdict:?}");
}

/// Meshes of three clusters of triangles, behind a wall with one gap, through which some meshes are seen.
#[test]
fn no_segment_reaches_a_large_mesh_that_is_proven_hidden() {
    let mut random = Random(23);
    let (mut hidden, mut seen) = (0, 0);
    for world in 0..60 {
        let mut number = |low: f64, high: f64| low + (high - low) * random.unit();
        let mut mesh = Vec::new();
        for _ in 0..3 {
            let center = DVec3::new(number(10.0, 16.0), number(-6.0, 6.0), number(-2.0, 2.0));
            for _ in 0..24 {
                let mut corner = || center + DVec3::from_array([0; 3].map(|_| number(-0.7, 0.7)));
                mesh.push([corner(), corner(), corner()].map(|p| p.as_vec3()));
            }
        }
        let (gap, width) = (number(-3.0, 3.0), number(0.2, 1.5));
        let wing = |from: f64, to: f64| cuboid(DVec3::new(6.0, from, -30.0), DVec3::new(6.5, to, 30.0));
        let objects = [mesh, wing(-40.0, gap), wing(gap + width, 40.0)];
        let found = verdict(&objects).0;
        match found {
            Verdict::Hidden => hidden += 1,
            _ => seen += usize::from(matches!(found, Verdict::Seen(_))),
        }
        for _ in 0..if found == Verdict::Hidden { 20_000 } else { 0 } {
            let from = DVec3::from_array([0; 3].map(|_| number(-0.2, 0.2)));
            let triangle = objects[0][(number(0.0, 72.0) as usize).min(71)].map(|p| p.as_dvec3());
            let (a, b) = (number(0.0, 1.0), number(0.0, 1.0));
            let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
            let to = triangle[0] + (triangle[1] - triangle[0]) * a + (triangle[2] - triangle[0]) * b;
            assert!(clearance(&objects, 0, from, to) <= 1e-3, "world {world}: {from} to {to}");
        }
    }
    assert!(hidden >= 10 && seen >= 10, "{hidden} hidden, {seen} seen");
}

/// A wall of 40 by 40 overlapping plates, one of which is missing, and a sheet of triangles behind it. Boxes
/// around large parts of the sheet cannot be decided.
#[test]
fn a_mesh_seen_through_a_missing_plate_is_not_hidden() {
    let square = |x: f64, y: f64, z: f64, size: f64| {
        let at = |y: f64, z: f64| DVec3::new(x, y, z);
        quad(at(y, z), at(y + size, z), at(y + size, z + size), at(y, z + size))
    };
    let sheet = (0..361)
        .flat_map(|k| square(0.5, f64::from(k % 19) * 2.0 - 19.0, f64::from(k / 19) * 2.0 - 19.0, 2.0));
    let plates = (0..1600).filter(|&k| k != 933).map(|k| {
        let x = f64::from((k / 40 + k % 40) % 2) * 0.05;
        square(x, f64::from(k % 40) - 20.05, f64::from(k / 40) - 20.05, 1.1)
    });
    let objects: Vec<Vec<Triangle>> = [sheet.collect()].into_iter().chain(plates).collect();
    let triangles = prepared(&objects);
    let settings = ExactSettings::new(Effort::Exact(1e-4)).with_rays(0).with_aimed_rays(0);
    let cell = Viewcell::from_box(DVec3::new(-40.0, -0.1, -0.1), DVec3::new(-39.9, 0.1, 0.1));
    let mut query = CellQuery::new(&triangles, &cell, settings).unwrap();
    query.prove_triangles(&|id| id.index() == 0);
    let (_, verdict) = query.verdicts().next().unwrap();
    assert!(!matches!(verdict, Verdict::Hidden), "{verdict:?}");
    assert!(query.steps() > 100, "{} nodes decide the first part", query.steps());
}
