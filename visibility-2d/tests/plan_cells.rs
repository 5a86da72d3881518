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
                assert!(plan.sees(p, q).unwrap(), "seed {seed}: {p:?} and {q:?} in one cell");
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
        assert_eq!(plan.cells(low, high).unwrap_err(), PlanError::Heights, "heights from {low} to {high}");
    }
    assert_eq!(plan.cells(0.0, 1.0).unwrap().graph.cell_count(), 1, "a plan without walls is one cell");
}

/// A portal that is left out would hide what is behind it.
#[test]
fn portals_are_there_at_any_shape() {
    let mut random = Random(11);
    let walls: Vec<_> = (0..40)
        .map(|_| {
            let [x, y] = [0, 1].map(|_| random.range(0.0, 20.0));
            Wall::new([x, y], [x + random.range(-4.0, 4.0), y + random.range(-4.0, 4.0)])
        })
        .collect();
    let count = |scale: f64, low: f64, high: f64| {
        let scaled =
            |wall: &Wall| Wall::new(wall.ends[0].map(|x| x * scale), wall.ends[1].map(|x| x * scale));
        let plan = Plan::new(&walls.iter().map(scaled).collect::<Vec<_>>()).unwrap();
        plan.cells(low, high).map(|cells| cells.graph.portals().len())
    };
    let portals = count(1.0, 0.0, 2.5).unwrap();
    assert!(portals > 40, "{portals} portals are no test");
    for (scale, low, high) in
        [(1.0, 0.0, 1e-13), (1.0, -5e16, 5e16), (2f64.powi(190), 0.0, 3.0), (1.0, 0.0, 1e-300)]
    {
        assert_eq!(count(scale, low, high), Ok(portals), "{scale} {low} {high}");
    }
    // Where no polygon has such corners, the heights are refused.
    for (low, high) in [(-1e308, 1e308), (0.0, 1e300)] {
        assert_eq!(count(1.0, low, high), Err(PlanError::Heights), "heights from {low} to {high}");
    }
}

#[test]
fn a_slit_of_the_last_bit_has_a_portal() {
    // A wall with a slit from 0.3 to 0.1 + 0.2.
    let walls = [
        Wall::new([0.0, 0.0], [1.0, 0.0]),
        Wall::new([1.0, 0.0], [1.0, 1.0]),
        Wall::new([1.0, 1.0], [0.0, 1.0]),
        Wall::new([0.0, 1.0], [0.0, 0.0]),
        Wall::new([0.5, 0.0], [0.5, 0.3]),
        Wall::new([0.5, 0.1 + 0.2], [0.5, 1.0]),
    ];
    let plan = Plan::new(&walls).unwrap();
    let cells = plan.cells(0.0, 3.0).unwrap();
    let slit = cells.graph.portals().iter().find(|portal| {
        portal.polygon().vertices().iter().all(|v| v.x == 0.5) && portal.polygon().vertices()[0].y < 0.4
    });
    let vertices = slit.expect("a portal in the slit").polygon().vertices();
    for y in [0.3, 0.1 + 0.2] {
        let reach = |least: bool| vertices.iter().any(|v| if least { v.y <= y } else { v.y >= y });
        assert!(reach(true) && reach(false), "{vertices:?}");
    }
}
