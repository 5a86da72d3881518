//! Cells of plans: convex, without gaps or overlaps, with portals exactly where sight may pass.

use visibility_2d::cdt::{Opacity, Plan, PlanError, Wall};
use visibility_core::cells::CellId;
use visibility_core::glam::DVec3;
use visibility_testing::Random;

fn random_plan(random: &mut Random) -> Plan {
    let count = random.below(25);
    let size = random.between(2, 9);
    let walls: Vec<_> = (0..count)
        .map(|_| {
            // Parallel to an axis or a diagonal, so that no crossing is rounded and no sliver arises.
            let a = [0, 1].map(|_| f64::from(random.between(0, size)));
            let direction = random.pick(&[[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]]);
            let length = f64::from(random.between(1, size));
            let b = [0, 1].map(|k| a[k] + length * direction[k]);
            Wall::new(a, b).with_opacity(random.pick(&[Opacity::Opaque, Opacity::Clear, Opacity::OneWay]))
        })
        .collect();
    Plan::new(&walls).unwrap()
}

fn area(corners: &[[f64; 2]]) -> f64 {
    let after = corners.iter().cycle().skip(1);
    corners.iter().zip(after).map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0])).sum()
}

#[test]
fn cells_divide_the_plan() {
    let (mut triangles, mut count) = (0, 0);
    for seed in 0..200 {
        let plan = random_plan(&mut Random(seed));
        let cells = plan.cells(0.0, 2.5).unwrap();
        cells.graph.validate(1e-9).unwrap();
        cells.graph.validate_bodies(cells.viewcells.cells(), 1e-9).unwrap();
        let mut areas = vec![0.0; cells.graph.cell_count()];
        for t in 0..plan.triangle_count() as u32 {
            areas[cells.cell_of(t).unwrap().index()] += area(&plan.triangle(t).unwrap());
        }
        for (i, sum) in areas.iter().enumerate() {
            let outline = cells.outline(CellId(i as u32));
            assert!((area(outline) - sum).abs() < 1e-9 * sum, "seed {seed}: cell {i}, {outline:?}");
            for k in 0..outline.len() {
                let [a, b, c] = [0, 1, 2].map(|j| outline[(k + j) % outline.len()]);
                let turn = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
                assert!(turn > -1e-9, "seed {seed}: cell {i}, {outline:?}");
            }
        }
        triangles += plan.triangle_count();
        count += areas.len();
    }
    assert!(count * 2 < triangles, "{count} cells of {triangles} triangles");
}

#[test]
fn portals_are_where_sight_passes() {
    for seed in 0..200 {
        let mut random = Random(seed);
        let plan = random_plan(&mut random);
        let cells = plan.cells(0.0, 2.5).unwrap();
        for portal in cells.graph.portals() {
            let [a, b, ..] = portal.polygon().vertices() else { panic!("four corners") };
            let (middle, across) = ((*a + *b) * 0.5, portal.plane().normal * 1e-6);
            let [from, to] = [middle - across, middle + across].map(|p| [p.x, p.y]);
            assert!(plan.sees(from, to).unwrap() || plan.sees(to, from).unwrap(), "seed {seed}: {portal:?}");
        }
        // Two near points in different cells see each other only through a portal between the cells, or
        // around a corner where several cells meet.
        let locate = |[x, y]: [f64; 2]| cells.viewcells.locate(DVec3::new(x, y, 1.0)).unwrap();
        let [low, high] = plan.bounds();
        for _ in 0..200 {
            let p = [0, 1].map(|k| random.fine_range(low[k] + 0.1, high[k] - 0.1));
            let q = p.map(|x| x + random.fine_range(-1e-3, 1e-3));
            let (a, b) = (CellId(locate(p).0), CellId(locate(q).0));
            if a == b {
                assert!(plan.sees(p, q).unwrap());
            } else if plan.sees(p, q).unwrap() {
                let portals = cells.graph.portals_of(a);
                let is_next = portals.iter().any(|&id| cells.graph.portal(id).unwrap().other(a) == b);
                let corner =
                    |c: CellId| cells.outline(c).iter().any(|v| (v[0] - p[0]).hypot(v[1] - p[1]) < 3e-3);
                assert!(is_next || corner(a) || corner(b), "seed {seed}: {p:?} {q:?}");
            }
        }
    }
}

#[test]
fn heights_must_be_in_order() {
    let plan = Plan::new(&[]).unwrap();
    for (low, high) in [(1.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (0.0, f64::INFINITY)] {
        assert_eq!(plan.cells(low, high).unwrap_err(), PlanError::Heights);
    }
    assert_eq!(plan.cells(0.0, 1.0).unwrap().graph.cell_count(), 1);
}
