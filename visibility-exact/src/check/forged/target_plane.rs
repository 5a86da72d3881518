//! Forged proofs about points that are off the target's plane by less than the errors of heights and
//! positions.

use super::*;

/// A target whose plane cuts the viewcell, and a plate that hangs from the target's front edge. The viewcell
/// polygon has points behind the plane, by less than the error of heights; a line from such a point passes
/// under the edge.
#[test]
fn lines_that_start_behind_the_plane_of_the_target_are_refused() {
    let [a, b, c] = [[16.0, 2.0, 2.25], [16.0, 6.0, 2.25], [80.0, 4.0, 4.25]];
    let world = World::new([a, b, c], &[[a, b, [16.0, 4.0, -400.0]]]);
    assert!(world.sees([DVec3::new(8.0, 4.0, 6.0), DVec3::new(48.0, 4.0, 3.25)]), "the target is seen");
    let (check, sight) = world.node_from(DVec3::Z);
    let line = |z: f64| [DVec3::new(8.0, 4.0, z), DVec3::new(48.0, 4.0, 3.25)];
    let below = line(2.0 - 3.5 * check.delta);
    assert_eq!(
        crosses(below, &world.shapes[1]),
        Some(true),
        "the line from below the plane crosses the surface"
    );
    assert!(!check.surface_blocks(&sight, &[1], &[], below), "the line from below the plane is not blocked");
    // A line that starts in front of the target's plane passes over the edge.
    assert_eq!(
        crosses(line(4.0), &world.shapes[1]),
        Some(false),
        "the line from before the plane passes over the edge"
    );
    assert!(
        !check.surface_blocks(&sight, &[1], &[], line(4.0)),
        "the line from before the plane is not blocked"
    );
}

/// A sill in front of the target, over the target's plane by less than the error of heights. Lines that start
/// and end below the sill's height meet the sill, as the sample line does; all other lines pass over it, so
/// the sill must not count as blocking.
#[test]
fn edges_next_to_the_plane_of_the_target_are_met() {
    let target = [[8.0, 2.0, 0.25], [8.0, 6.0, 0.25], [72.0, 4.0, 2.25]];
    for height in [2.5, 2.0] {
        let delta = 400.0 * 2f64.powi(-46);
        let top = (height * delta) as f32;
        let mut world = World::new(target, &[[[0.0, -100.0, top], [0.0, 100.0, top], [0.0, 0.0, -400.0]]]);
        let (min, max) = (DVec3::new(-80.0, 0.0, -6.0), DVec3::new(-72.0, 8.0, 2.0));
        world.cell = CellBox { min, max };
        assert!(
            world.sees([DVec3::new(-72.0, 4.0, 0.0), DVec3::new(56.0, 4.0, 1.75)]),
            "{height}: the target is seen"
        );
        let (check, sight) = world.node_from(DVec3::Z);
        assert_eq!(check.delta, delta, "{height}: the error of positions");
        let line = [DVec3::new(-72.0, 4.0, -2.25 + 3.2 * delta), DVec3::new(56.0, 4.0, 1.75)];
        let lifted = [line[0], line[1] + sight.before_q.normal * (1.25 * delta)];
        assert_eq!(
            crosses(lifted, &world.shapes[1]),
            Some(height > 2.25),
            "{height}: the lifted line crosses the surface, or passes over it"
        );
        assert!(!check.surface_blocks(&sight, &[1], &[], line), "{height}: the line is not blocked");
    }
}

/// A plate that hangs from the target's lower side, behind the target. The sample line ends behind the target
/// by less than the error of positions.
#[test]
fn lines_that_end_behind_the_plane_of_the_target_are_refused() {
    let [a, b, _] = TARGET;
    for (low, part) in [([400.0, 4.0, -400.0], 0.5), ([80.5, 4.0, -400.0], 0.5), ([80.5, 4.0, -400.0], 0.95)]
    {
        let world = World::new(TARGET, &[[a, b, low]]);
        let delta = position_error(&world.triangles, &world.cell, Target::Triangle(0), 0.0).unwrap();
        let line = [LINE[0], [80.0 + part * delta, 4.0, 2.0 - part * delta]];
        world.refuses_surface(1, line, LINE, format_args!("{low:?}, {part} errors behind the target"));
    }
}

/// The top of the viewcell is over the plane of the target's upper side by less than the error of heights, so
/// one edge of the viewcell sees that side. A plate hides the target's lower side only, so the target must
/// not be found hidden.
#[test]
fn what_is_seen_from_next_to_its_plane_alone_is_not_hidden() {
    let [a, b, c] = [[76.0, 2.0, -0.125], [76.0, 6.0, -0.125], [84.0, 4.0, -0.375]];
    let world = World::new([a, b, c], &[[a, b, [76.0, 4.0, -400.0]]]);
    let target = Target::Triangle(0);
    let delta = position_error(&world.triangles, &world.cell, target, 0.0).unwrap();
    let solve = |height: f64| {
        // The plane is at z = 2 where x = 8.
        let cell = CellBox { min: DVec3::new(0.0, 0.0, -6.0), max: DVec3::new(8.0, 8.0, 2.0 + height) };
        let mut search = Search::new(&world.triangles, cell, 0.0, None);
        let answer = search.solve_target(target, Budget { nodes: 2000, divided: 200, halvings: 12 }).0;
        let proof = Proof { cell, target, clearance: 0.0, steps: core::mem::take(&mut search.steps) };
        assert!(
            answer != Answer::Hidden || proof.check(&world.triangles) == Ok(()),
            "{height}: the proof holds"
        );
        answer
    };
    assert_eq!(solve(-8.0 * delta), Answer::Hidden, "the viewcell ends below the target's plane");
    for part in [0.01, 0.25, 1.0] {
        assert_ne!(solve(part * delta), Answer::Hidden, "{part}");
    }
}

/// A tetrahedron on a corner of the target. The sample line ends inside the tetrahedron, in front of the
/// target by less than the error of positions.
#[test]
fn lines_that_end_next_to_a_surface_at_the_target_are_refused() {
    let [a, b, c, d] = [TARGET[0], [70.0, 12.0, 10.0], [70.0, 8.0, 12.0], [70.0, 10.0, 7.0]];
    let world = World::new(TARGET, &[[a, b, c], [a, c, d], [a, d, b], [b, c, d]]);
    let delta = position_error(&world.triangles, &world.cell, Target::Triangle(0), 0.0).unwrap();
    let line = [[8.0, 0.0, 0.0], [80.0, 2.0 + delta, 2.0 + delta]];
    assert_eq!(
        world.error(LINE, vec![surface(&[1, 2, 3, 4], line)]),
        SURFACE,
        "a line that ends next to the surface at the target"
    );
}

/// A loop around the target's own triangle: by rounding, its corners are in front of the target's plane.
#[test]
fn the_ring_of_the_target_is_refused() {
    let mut random = Random(4);
    for _ in 0..300 {
        let mut corner = || random.vec3(0.5, 7.5).to_array();
        let [a, b, c] = [corner(), corner(), corner()].map(|[x, y, z]| [70.0 + x, y, z]);
        let world = World::new([a, b, c], &[]);
        let t = world.shapes[0];
        let from = world.cell.max;
        let behind = orientation_sign(t[0], t[1], t[2], from)
            != orientation_sign(t[0], t[1], t[2], DVec3::new(8.0, 0.0, 0.0));
        let line = [[8.0, 4.0, 4.0], ((t[0] + t[1] + t[2]) / 3.0).to_array()];
        let Step::Loop { piece, ring, side, edges } = ring(world.piece(0), &t, line, &INSIDE) else {
            unreachable!()
        };
        let ring = ring.iter().enumerate().map(|(k, &(x, _))| (x, k as u8)).collect();
        let error =
            world.error([from.to_array(), t[0].to_array()], vec![Step::Loop { piece, ring, side, edges }]);
        assert!(
            error == LOOP || behind && error.is_some(),
            "{error:?}: the target's own ring, behind its plane: {behind}"
        );
    }
}
