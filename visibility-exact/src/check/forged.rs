//! Forged proofs that a target is hidden which a segment sees: each is refused by one condition of the check
//! alone, and accepted without it.
//!
//! | condition | tests |
//! |---|---|
//! | `check`: numbers in range | `numbers_beyond_the_scene_are_refused` |
//! | `check`: clearance over the errors | `clearances_within_the_error_of_positions_are_refused` |
//! | `sights`: viewcell over the clearance | `targets_seen_from_less_than_the_clearance_are_refused` |
//! | `node`: as many steps as nodes, both halves | `nodes_without_a_step_are_refused`, `steps_too_many_are_refused` |
//! | `node`: depth | `deep_proofs_are_refused` |
//! | `node`: as many edges as corners of a loop | `malformed_loops_are_refused` |
//! | `node`: side of a loop | `edges_within_the_error_of_positions_are_not_passed` |
//! | `node`: edges inside | `loops_that_lines_pass_outside_are_refused` |
//! | `node`: edges never passed, sign of the row | `edges_that_lines_pass_outside_are_refused` |
//! | `node`: rows of divided nodes, their signs and ends | `nodes_with_lines_are_not_empty`, `rows_end_with_their_loop` |
//! | `surface_blocks`: triangles occlude | `triangles_that_do_not_occlude_are_refused` |
//! | `is_in`: plane and sides of P and Q | `lines_of_other_nodes_are_refused` |
//! | `surface_blocks`: the line starts before Q's plane | `lines_that_start_behind_the_plane_of_the_target_are_refused` |
//! | `surface_blocks`: the line ends before Q's plane | `lines_that_end_behind_the_plane_of_the_target_are_refused`, `the_target_itself_is_refused` |
//! | `surface_blocks`: triangles apart from P and Q | `surfaces_that_cut_an_end_of_segments_are_refused` |
//! | `touches_beside`: one side of Q's plane, margins | `surfaces_at_a_corner_of_the_target_that_cut_it_are_refused`, `ridges_next_to_the_plane_of_the_target_are_refused` |
//! | `touches_beside`: own plane | `lines_that_end_next_to_a_surface_at_the_target_are_refused` |
//! | `touches_beside`: apart from P | `surfaces_at_the_target_that_cut_the_start_of_segments_are_refused` |
//! | `surface_blocks`: boundary within three clearances | `boundaries_that_move_too_far_are_refused` |
//! | `is_missed`: boundary not met | `boundaries_that_segments_meet_are_refused` |
//! | `is_missed`: edges at corners of the target, behind | `edges_from_a_corner_of_the_target_before_it_are_refused`, `edges_next_to_the_plane_of_the_target_are_met` |
//! | `surface_blocks`: strips apart from P and Q | `strips_that_cut_an_end_of_segments_are_refused` |
//! | `crosses`: unsure | `lines_through_an_edge_of_a_surface_are_refused`, `lines_through_an_edge_of_a_strip_are_refused` |
//! | `crosses`: sides and ends; odd | `surfaces_that_a_line_does_not_cross_are_refused`, `surfaces_that_are_crossed_an_even_number_of_times_are_refused` |
//! | `is_on_piece`: occluders, flat, convex | `pieces_that_are_no_convex_polygon_of_occluders_are_refused` |
//! | `is_on_piece`: near | `loops_away_from_their_occluder_are_refused` |
//! | `is_on_piece`: before P's plane | `loops_beyond_the_ends_of_segments_are_refused`, `loops_just_inside_the_viewcell_are_refused` |
//! | `is_on_piece`: before Q's plane, `in_front` | `corners_that_are_not_the_targets_are_refused`, `corners_next_to_the_plane_of_the_target_are_not_before_it` |
//! | `is_on_piece`: `leaves_plane` | `loops_in_the_plane_of_the_target_are_refused`, `the_ring_of_the_target_is_refused` |
//! | `is_on_piece`: `tags_hold` | `corners_that_are_not_the_targets_are_refused` |
//! | `sides`: exact zeros | `mixtures_of_other_corners_are_not_on_an_edge`, and `edges_in_the_plane_of_a_face_divide_the_lines_that_start_around_them`, `edges_near_the_plane_of_a_face_are_in_it` in `tests` |
//! | `is_on_side`, `separates`: margins | `edges_within_the_error_of_positions_are_not_passed`, and `what_touches_by_less_than_the_error_is_not_apart` in `tests` |
//! | `excludes`: weights, sums, rounding | `edges_that_lines_pass_outside_are_refused`, `weights_that_cancel_are_refused` |
//! | `corner_excludes`: signs, form, rounding | `corners_with_lines_are_refused`, `corners_on_a_line_are_refused` |

use super::ProofError;
use super::context::{Check, Divider};
use super::surface::crosses;
use crate::half::Half;
use crate::polygon::Polygon;
use crate::proof::{LoopEdge, Proof, Step};
use crate::search::{Answer, Budget, Search};
use crate::sight::{CellBox, Sight, Target, position_error, sights};
use crate::triangles::{SceneTriangles, unit_normal};
use std::{vec, vec::Vec};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, Object, Scene};
use visibility_testing::{Random, distance, orientation_sign};

/// A triangle target, number 0, among occluders, numbers from 1 on, and a viewcell.
struct World {
    triangles: SceneTriangles,
    /// The target and the occluders.
    shapes: Vec<[DVec3; 3]>,
    cell: CellBox,
    clearance: f64,
}

type Triangle = [[f32; 3]; 3];

/// A target in the plane x = 80, before the face x = 8 of [`CELL`] and before no other.
const TARGET: Triangle = [[80.0, 2.0, 2.0], [80.0, 6.0, 2.0], [80.0, 4.0, 6.0]];
const CELL: CellBox = CellBox { min: DVec3::ZERO, max: DVec3::splat(8.0) };
/// A wall at x = 40 that hides [`TARGET`] from [`CELL`].
const WALL: Triangle = [[40.0, -300.0, -100.0], [40.0, 300.0, -100.0], [40.0, 0.0, 400.0]];
/// The part of a wall below z = 4.
const HALF_WALL: Triangle = [[40.0, 300.0, 4.0], [40.0, 0.0, -400.0], [40.0, -300.0, 4.0]];

fn scene_of(shapes: &[(Triangle, bool)]) -> SceneTriangles {
    let mut scene = Scene::new();
    for (triangle, occluder) in shapes {
        let triangle = triangle.map(Vec3::from_array);
        let id = scene.insert(Object { occluder: *occluder, ..Object::new(Aabb::from_points(triangle)) });
        scene.set_triangles(id, [triangle]).unwrap();
    }
    SceneTriangles::new(&scene)
}

impl World {
    fn new(target: Triangle, occluders: &[Triangle]) -> Self {
        let all: Vec<(Triangle, bool)> =
            [&[target], occluders].concat().into_iter().map(|triangle| (triangle, true)).collect();
        let shapes = all.iter().map(|(t, _)| t.map(|x| Vec3::from_array(x).as_dvec3())).collect();
        Self { triangles: scene_of(&all), shapes, cell: CELL, clearance: 0.0 }
    }

    fn proof(&self, steps: Vec<Step>) -> Proof {
        Proof { cell: self.cell, target: Target::Triangle(0), clearance: self.clearance, steps }
    }

    /// Returns what is wrong with a proof, in a world in which a segment sees the target.
    fn error(&self, seen: [[f64; 3]; 2], steps: Vec<Step>) -> Option<ProofError> {
        assert!(self.sees(seen.map(DVec3::from_array)), "no segment of this world sees the target");
        self.proof(steps).check(&self.triangles).err()
    }

    /// Returns whether a segment starts in the viewcell, ends on the target, and touches no occluder before
    /// its end: by exact determinants, of coordinates of 24 bits. With a clearance no occluder is within 6
    /// clearances.
    fn sees(&self, [from, to]: [DVec3; 2]) -> bool {
        let is_inside = self.cell.min.cmple(from).all() && from.cmple(self.cell.max).all();
        let is_on = |t: &[DVec3; 3]| {
            let apex = from;
            let sides = [0, 1, 2].map(|k| orientation_sign(t[k], t[(k + 1) % 3], apex, to));
            orientation_sign(t[0], t[1], t[2], to) == 0 && !(sides.contains(&1) && sides.contains(&-1))
        };
        let is_far = |t: &[DVec3; 3]| {
            self.clearance == 0.0 || distance(from, to, &t.map(|x| x.as_vec3())) > 6.0 * self.clearance
        };
        let is_free = |t: &[DVec3; 3]| {
            let [start, end] = [from, to].map(|x| orientation_sign(t[0], t[1], t[2], x));
            let sides = [0, 1, 2].map(|k| orientation_sign(t[k], t[(k + 1) % 3], from, to));
            start * end > 0
                || (start != 0 && end == 0)
                || (start * end < 0 && sides.contains(&1) && sides.contains(&-1))
        };
        is_inside && is_on(&self.shapes[0]) && self.shapes[1..].iter().all(|t| is_free(t) && is_far(t))
    }

    /// Returns the state of a check, and the one pair of polygons that sees the target from a side.
    fn node_from(&self, side: DVec3) -> (Check<'_>, Sight) {
        let target = Target::Triangle(0);
        let delta = position_error(&self.triangles, &self.cell, target, self.clearance).unwrap();
        let all = sights(&self.triangles, &self.cell, target, self.clearance, 4.0 * delta).unwrap();
        let mut all = all.into_iter().filter(|sight| sight.before_q.normal.dot(side) > 0.0);
        let sight = all.next().unwrap();
        let target_vertices = self.triangles.vertices(0).to_vec();
        let (triangles, clearance, steps) = (&self.triangles, self.clearance, [].iter());
        (Check { triangles, clearance, delta, target_vertices, steps }, sight)
    }

    fn piece(&self, number: u32) -> u32 {
        self.triangles.piece_of(number)
    }
}

fn surface(triangles: &[u32], line: [[f64; 3]; 2]) -> Step {
    moved_surface(triangles, vec![], line)
}

fn moved_surface(triangles: &[u32], moved: Vec<(u32, DVec3)>, line: [[f64; 3]; 2]) -> Step {
    Step::Surface { triangles: triangles.into(), moved: moved.into(), line: line.map(DVec3::from_array) }
}

/// Returns a loop of three or more corners, that are no corners of the target, around a line.
fn ring(piece: u32, corners: &[DVec3], line: [[f64; 3]; 2], edges: &[LoopEdge]) -> Step {
    let [p, q] = line.map(DVec3::from_array);
    let side = (q - p).dot((corners[0] - p).cross(corners[1] - p)).signum();
    let ring = corners.iter().map(|&x| (x, 3)).collect();
    Step::Loop { piece, ring, side, edges: edges.into() }
}

fn never(weights: &[f64]) -> LoopEdge {
    LoopEdge::Never { weights: weights.into() }
}

fn empty(weights: &[f64]) -> Step {
    Step::Empty { weights: weights.into() }
}

const INSIDE: [LoopEdge; 3] = [LoopEdge::Inside, LoopEdge::Inside, LoopEdge::Inside];
/// A segment of [`CELL`] and [`TARGET`].
const LINE: [[f64; 3]; 2] = [[8.0, 4.0, 4.0], [80.0, 4.0, 3.0]];
/// A segment that passes over [`HALF_WALL`].
const OVER: [[f64; 3]; 2] = [[8.0, 4.0, 7.0], [80.0, 4.0, 4.0]];
const SURFACE: Option<ProofError> = Some(ProofError::Surface);
const LOOP: Option<ProofError> = Some(ProofError::Loop);
const WEIGHTS: Option<ProofError> = Some(ProofError::Weights);
const MALFORMED: Option<ProofError> = Some(ProofError::Malformed);

/// Returns a triangle of integers whose plane holds the origin, which is beyond the side from its second to
/// its third corner: points next to the origin have any small height over the plane.
fn plane_through_the_origin(random: &mut Random) -> Triangle {
    loop {
        let mut int = || -> [f32; 3] { core::array::from_fn(|_| random.between(-900, 900) as f32) };
        let (a, b) = (int(), int());
        let far = core::array::from_fn(|k| 2.0 * (a[k] + b[k]));
        let normal = Vec3::from_array(a).cross(Vec3::from_array(b));
        if normal.x * normal.y * normal.z != 0.0 {
            return [far, a, b];
        }
    }
}

/// The steps that the forgeries are made of hold where they are true.
#[test]
fn true_steps_hold() {
    let world = World::new(TARGET, &[WALL]);
    for step in [surface(&[1], LINE), ring(world.piece(1), &world.shapes[1], LINE, &INSIDE)] {
        assert_eq!(world.proof(vec![step]).check(&world.triangles), Ok(()));
    }
    let never = ring(world.piece(1), &world.shapes[1], LINE, &[never(&[1.0]), never(&[1.0]), never(&[1.0])]);
    assert_eq!(world.proof(vec![never]).check(&world.triangles), Ok(()));
    let divides = [LoopEdge::Divides, LoopEdge::Inside, LoopEdge::Divides];
    let divides = ring(world.piece(1), &world.shapes[1], LINE, &divides);
    let steps = vec![divides, empty(&[1.0]), empty(&[0.0, 1.0])];
    assert_eq!(world.proof(steps).check(&world.triangles), Ok(()));
    // Two triangles of which neither is enough.
    let [a, b, c] = WALL;
    let middle = [40.0, 4.0, -100.0];
    let world = World::new(TARGET, &[[a, middle, c], [middle, b, c]]);
    let line = [[8.0, 4.5, 4.0], [80.0, 4.5, 3.0]];
    assert_eq!(world.proof(vec![surface(&[1, 2], line)]).check(&world.triangles), Ok(()));
    assert_eq!(world.proof(vec![surface(&[1], line)]).check(&world.triangles).err(), SURFACE);
    // A wall whose upper edge is in the way, and moves out of it; the line crosses what it moved over.
    let mut world = World::new(TARGET, &[HALF_WALL.map(|[x, y, z]| [x, y, z + 2.75])]);
    world.clearance = 0.125;
    let [a, _, b] = world.triangles.vertices(1);
    let mut moved = vec![(a, DVec3::new(40.0, 300.0, 7.0625)), (b, DVec3::new(40.0, -300.0, 7.0625))];
    moved.sort_by_key(|entry| entry.0);
    for z in [7.9375, 4.0] {
        let step = moved_surface(&[1], moved.clone(), [[8.0, 4.25, z], [79.875, 4.0, 5.5]]);
        assert_eq!(world.proof(vec![step]).check(&world.triangles), Ok(()), "{z}");
    }
    // An occluder with a side in the target's plane.
    let wall = [[80.0, -300.0, -100.0], [80.0, 300.0, -100.0], [40.0, 0.0, 400.0]];
    let world = World::new(TARGET, &[wall]);
    let step = ring(world.piece(1), &world.shapes[1], LINE, &INSIDE);
    assert_eq!(world.proof(vec![step]).check(&world.triangles), Ok(()));
}

#[test]
fn numbers_beyond_the_scene_are_refused() {
    let world = World::new(TARGET, &[]);
    for t in [1, u32::MAX] {
        let proof = Proof { target: Target::Triangle(t), ..world.proof(vec![]) };
        assert_eq!(proof.check(&world.triangles).err(), MALFORMED);
    }
    assert_eq!(world.error(LINE, vec![surface(&[1], LINE)]), SURFACE);
    let corners = WALL.map(|x| Vec3::from_array(x).as_dvec3());
    assert_eq!(world.error(LINE, vec![ring(1, &corners, LINE, &INSIDE)]), LOOP);
    let world = World::new(TARGET, &[HALF_WALL]);
    let edges = [LoopEdge::Inside, LoopEdge::Inside, LoopEdge::Divides];
    let divides = ring(world.piece(1), &world.shapes[1], LINE, &edges);
    assert_eq!(world.error(OVER, vec![divides, Step::Corner { edges: [0, 0, 1] }]), MALFORMED);
}

/// A proof of a depth that the stack would not hold.
#[test]
fn deep_proofs_are_refused() {
    let world = World::new(TARGET, &[]);
    let halves = vec![Step::Halves { of_p: true, across: false }; 200_000];
    assert_eq!(world.error(LINE, halves), MALFORMED);
}

#[test]
fn nodes_without_a_step_are_refused() {
    let world = World::new(TARGET, &[HALF_WALL]);
    assert_eq!(world.error(OVER, vec![]), MALFORMED);
    // The lower half of P does not see the target's lower part: only one half has a step.
    let [below, above] = [[[8.0, 4.0, 2.0], [80.0, 4.0, 2.5]], OVER];
    let edges = [LoopEdge::Inside, LoopEdge::Inside, LoopEdge::Divides];
    let divides = ring(world.piece(1), &world.shapes[1], below, &edges);
    assert_eq!(world.error(above, vec![divides]), MALFORMED);
    let halves = |across| Step::Halves { of_p: false, across };
    let world = World::new(TARGET, &[[[40.0, -300.0, -9.0], [40.0, 0.0, 9000.0], [40.0, 4.0, -9.0]]]);
    let line = [[8.0, 2.0, 4.0], [80.0, 3.0, 2.5]];
    assert_eq!(
        world.error([[8.0, 7.0, 4.0], [80.0, 5.0, 2.5]], vec![halves(false), surface(&[1], line)]),
        SURFACE
    );
}

#[test]
fn steps_too_many_are_refused() {
    let world = World::new(TARGET, &[WALL]);
    let steps = vec![surface(&[1], LINE), surface(&[1], LINE)];
    assert_eq!(world.proof(steps).check(&world.triangles).err(), MALFORMED);
}

/// A viewcell lower than the clearance over the target's plane, of which nothing is said.
#[test]
fn targets_seen_from_less_than_the_clearance_are_refused() {
    let mut world = World::new(TARGET, &[]);
    world.clearance = 0.125;
    for (height, error) in [(1.0 / 16.0, MALFORMED), (1.0 / 64.0, MALFORMED), (0.0, None)] {
        let max = DVec3::new(80.0 - height, 8.0, 8.0);
        world.cell = CellBox { min: max - DVec3::splat(1.0 / 256.0), max };
        let from = [max.x, max.y, max.z];
        let to = [80.0, 4.0, 3.0];
        match error {
            None => assert_eq!(world.proof(vec![]).check(&world.triangles), Ok(())),
            _ => assert_eq!(world.error([from, to], vec![]), error, "{height}"),
        }
    }
}

/// A viewcell over the target's plane by less than the errors of heights, but by more than a clearance that
/// is as small.
#[test]
fn clearances_within_the_error_of_positions_are_refused() {
    let mut random = Random(1);
    for round in 0..3000 {
        let [_, a, b] = plane_through_the_origin(&mut random);
        let target = [a, b, core::array::from_fn(|k| -a[k] - b[k])];
        let mut world = World::new(target, &[]);
        let normal = unit_normal(&world.shapes[0]).unwrap();
        let unit = world.triangles.position_error(0.0) / 128.0;
        world.clearance = 1.5 * unit;
        // Its farthest corner from the plane is 1.6 units over it.
        let corner = normal.signum() * f64::from((1.6 * unit / normal.abs().element_sum()) as f32);
        world.cell = CellBox { min: corner.min(DVec3::ZERO), max: corner.max(DVec3::ZERO) };
        let seen = [corner, world.shapes[0][0]].map(|x| x.to_array());
        assert_eq!(world.error(seen, vec![]), MALFORMED, "{round}");
    }
}

#[test]
fn triangles_that_do_not_occlude_are_refused() {
    let mut world = World::new(TARGET, &[]);
    world.triangles = scene_of(&[(TARGET, true), (WALL, false)]);
    assert_eq!(world.error(LINE, vec![surface(&[1], LINE)]), SURFACE);
}

/// Segments that start before P's plane or beside P, or end behind Q's plane or beside Q, and cross what is
/// there.
#[test]
fn lines_of_other_nodes_are_refused() {
    let behind = [[-4.0, -30.0, -30.0], [-4.0, 30.0, -30.0], [-4.0, 4.0, 90.0]];
    let beyond = [[90.0, -30.0, -30.0], [90.0, 30.0, -30.0], [90.0, 4.0, 90.0]];
    let beside = |x: f32, y: f32| [[x, y - 20.0, -30.0], [x, y + 20.0, -30.0], [x, y, 90.0]];
    let tries = [
        (behind, [[-16.0, 4.0, 4.0], LINE[1]]),
        (beyond, [LINE[0], [96.0, 4.0, 3.0]]),
        (beside(16.0, 88.0), [[8.0, 100.0, 4.0], LINE[1]]),
        (beside(16.0, -78.0), [[8.0, -100.0, 4.0], LINE[1]]),
        (beside(72.0, 88.0), [LINE[0], [80.0, 100.0, 3.0]]),
        (beside(72.0, -78.0), [LINE[0], [80.0, -100.0, 3.0]]),
    ];
    for (occluder, line) in tries {
        let world = World::new(TARGET, &[occluder]);
        assert_eq!(crosses(line.map(DVec3::from_array), &world.shapes[1]), Some(true), "{line:?}");
        assert_eq!(world.error(LINE, vec![surface(&[1], line)]), SURFACE, "{line:?}");
    }
}

/// A plane through P or Q, beyond the segments on all sides: it blocks the segments to one part.
#[test]
fn surfaces_that_cut_an_end_of_segments_are_refused() {
    // In the planes y - x = -4 and y - x = -76.
    let through_p = [[-92.0, -96.0, -400.0], [-92.0, -96.0, 400.0], [204.0, 200.0, 0.0]];
    let through_q = [[16.0, -60.0, -400.0], [16.0, -60.0, 400.0], [476.0, 400.0, 0.0]];
    let world = World::new(TARGET, &[through_p]);
    let [hidden, seen] = [6.0, 2.0].map(|y| [[8.0, y, 4.0], [80.0, 4.0, 3.0]]);
    assert_eq!(world.error(seen, vec![surface(&[1], hidden)]), SURFACE);
    let world = World::new(TARGET, &[through_q]);
    let [hidden, seen] = [3.0, 5.0].map(|y| [[8.0, 4.0, 4.0], [80.0, y, 2.5]]);
    assert_eq!(world.error(seen, vec![surface(&[1], hidden)]), SURFACE);
}

/// A wall with a corner in the middle of the segments, which is moved by more than three clearances; the
/// vertex of the lowest number, the vertex of the highest number.
#[test]
fn boundaries_that_move_too_far_are_refused() {
    for x in [39.0, 41.0] {
        let wall = [[40.0, -100.0, -100.0], [40.0, 100.0, -100.0], [x, 4.0, 5.0]];
        let mut world = World::new(TARGET, &[wall]);
        world.clearance = 1.0 / 128.0;
        let number = world.triangles.vertices(1)[2];
        for z in [500.0, f64::NAN] {
            let moved = vec![(number, DVec3::new(x.into(), 4.0, z))];
            let line = [[8.0, 4.25, 4.0], [80.0 - world.clearance, 4.0, 3.0]];
            assert_eq!(world.error(OVER, vec![moved_surface(&[1], moved, line)]), SURFACE);
        }
    }
}

#[test]
fn boundaries_that_segments_meet_are_refused() {
    let world = World::new(TARGET, &[HALF_WALL]);
    let line = [[8.0, 4.0, 2.0], [80.0, 4.0, 2.5]];
    assert_eq!(world.error(OVER, vec![surface(&[1], line)]), SURFACE);
}

/// An occluder that holds a corner of the target and leans over a part of it.
#[test]
fn edges_from_a_corner_of_the_target_before_it_are_refused() {
    let mut random = Random(2);
    let mut tried = 0;
    for _ in 0..20_000 {
        let mut int = |r: i32| -> [f32; 3] { core::array::from_fn(|_| random.between(-r, r) as f32) };
        let (u, v, w) = (int(60), int(400), int(400));
        let wall = [TARGET[0], [79.0 - u[0].abs(), v[1], v[2]], [79.0 - u[1].abs(), w[1], w[2]]];
        let line = [[8.0, 4.0, 4.0], [80.0, 4.0, 3.0]];
        let shape = wall.map(|x| Vec3::from_array(x).as_dvec3());
        let seen = [[8.0, 4.0, 4.0], [80.0, 4.0, 5.0]];
        if crosses(line.map(DVec3::from_array), &shape) != Some(true) {
            continue;
        }
        let world = World::new(TARGET, &[wall]);
        if world.sees(seen.map(DVec3::from_array)) {
            tried += 1;
            assert_eq!(world.error(seen, vec![surface(&[1], line)]), SURFACE);
        }
    }
    assert!(tried > 10, "{tried}");
}

/// A wall half a clearance before Q, of which the edge in the middle of Q moves behind Q.
#[test]
fn strips_that_cut_an_end_of_segments_are_refused() {
    let wall = [[79.75, 4.0, -100.0], [79.75, 4.0, 100.0], [79.75, 200.0, 0.0]];
    let mut world = World::new(TARGET, &[wall]);
    world.clearance = 0.125;
    let [a, b, _] = world.triangles.vertices(1);
    let moved = [(a, -100.0), (b, 100.0)].map(|(v, z)| (v, DVec3::new(79.9375, 4.0, z)));
    let line = [[8.0, 5.0, 4.0], [79.875, 4.5, 3.0]];
    let seen = [[8.0, 2.0, 4.0], [80.0, 3.0, 2.25]];
    assert_eq!(world.error(seen, vec![moved_surface(&[1], moved.into(), line)]), SURFACE);
}

/// A closed tetrahedron among the segments, and a line through one of its edges and one face.
#[test]
fn lines_through_an_edge_of_a_surface_are_refused() {
    let [a, b, c, d] = [[40.0, 3.0, 3.0], [40.0, 5.0, 3.0], [44.0, 4.0, 6.0], [44.0, 8.0, 0.0]];
    let world = World::new(TARGET, &[[a, b, c], [a, b, d], [a, c, d], [b, c, d]]);
    let line = [[8.0, 4.0, 3.0], [80.0, 4.0, 3.0]];
    let found = [1, 2, 3, 4].map(|t| crosses(line.map(DVec3::from_array), &world.triangles.corners(t)));
    assert_eq!(found, [None, None, Some(true), Some(false)]);
    let seen = [[8.0, 0.0, 7.0], [80.0, 4.0, 5.0]];
    assert_eq!(world.error(seen, vec![surface(&[1, 2, 3, 4], line)]), SURFACE);
    // Lines through a corner, of more digits than products have.
    let mut random = Random(3);
    for round in 0..3000 {
        let mut near = |[y, z]: [f32; 2]| {
            let at = random.vec3(-0.5, 0.5);
            [48.0 + at.x, y + at.y, z + at.z]
        };
        let [a, b, c, d] = [[40.0, 4.0, 3.0], near([2.0, 1.0]), near([6.0, 1.0]), near([4.0, 6.0])];
        let world = World::new(TARGET, &[[a, b, c], [a, c, d], [a, d, b], [b, c, d]]);
        let mut slope = || (random.fine_range(-0.01, 0.01) * 2f64.powi(48)).round() / 2f64.powi(48);
        let (u, v) = (slope(), slope());
        let at = |x: f64| [40.0 + x, 4.0 + x * u, 3.0 + x * v];
        let step = surface(&[1, 2, 3, 4], [at(-32.0), at(40.0)]);
        assert_eq!(world.error(seen, vec![step]), SURFACE, "{round}");
    }
}

/// A small triangle among the segments whose boundary moves out of the segments' way below them, and a line
/// through the triangle that leaves through the diagonal of a strip.
#[test]
fn lines_through_an_edge_of_a_strip_are_refused() {
    let target = [[80.0, 0.5, 0.5], [80.0, 7.5, 0.5], [80.0, 0.5, 7.5]];
    let small = [[40.0, 3.0, 0.5], [40.0, 5.0, 0.5], [40.0, 4.0, 0.8125]];
    let mut world = World::new(target, &[small]);
    world.clearance = 0.25;
    let numbers = world.triangles.vertices(1);
    let mut moved: Vec<(u32, DVec3)> =
        (0..3).map(|k| (numbers[k], DVec3::new(40.25, world.shapes[1][k].y, 0.125))).collect();
    moved.sort_by_key(|entry| entry.0);
    let at = |x: f64| [40.0625 + x, 4.25, 0.640625 + x / 128.0];
    let line = [at(-32.0625), at(39.6875)];
    let strip = [small[2], [40.25, 5.0, 0.125], [40.25, 4.0, 0.125]];
    let strip = strip.map(|x| Vec3::from_array(x).as_dvec3());
    let line_ = line.map(DVec3::from_array);
    assert_eq!([&world.shapes[1], &strip].map(|t| crosses(line_, t)), [Some(true), None]);
    let seen = [[8.0, 4.0, 6.0], [80.0, 2.0, 4.0]];
    assert_eq!(world.error(seen, vec![moved_surface(&[1], moved.clone(), line)]), SURFACE);
}

#[test]
fn surfaces_that_are_crossed_an_even_number_of_times_are_refused() {
    let world = World::new(TARGET, &[HALF_WALL]);
    let line = [[8.0, 4.0, 2.0], [80.0, 4.0, 2.5]];
    for triangles in [&[][..], &[1, 1]] {
        assert_eq!(world.error(OVER, vec![surface(triangles, line)]), SURFACE);
    }
}

/// Triangles beside a line, which crosses their planes, and beyond its ends.
#[test]
fn surfaces_that_a_line_does_not_cross_are_refused() {
    let beside = [[40.0, 60.0, -30.0], [40.0, 90.0, -30.0], [40.0, 75.0, 90.0]];
    let behind = [[-4.0, -30.0, -30.0], [-4.0, 30.0, -30.0], [-4.0, 4.0, 90.0]];
    let beyond = [[90.0, -30.0, -30.0], [90.0, 30.0, -30.0], [90.0, 4.0, 90.0]];
    for occluder in [beside, behind, beyond] {
        let world = World::new(TARGET, &[occluder]);
        assert_eq!(world.error(LINE, vec![surface(&[1], LINE)]), SURFACE);
    }
}

/// The target itself, which a line crosses that ends behind it by less than the error of positions.
#[test]
fn the_target_itself_is_refused() {
    let world = World::new(TARGET, &[]);
    let delta = position_error(&world.triangles, &world.cell, Target::Triangle(0), 0.0).unwrap();
    let line = [LINE[0], [80.0 + 0.5 * delta, 4.0, 3.0]];
    assert_eq!(crosses(line.map(DVec3::from_array), &world.shapes[0]), Some(true));
    assert_eq!(world.error(LINE, vec![surface(&[0], line)]), SURFACE);
}

/// A triangle that holds a corner of the target and cuts it in two: one part of the target is behind.
#[test]
fn surfaces_at_a_corner_of_the_target_that_cut_it_are_refused() {
    let cut = [[80.0, 2.0, 2.0], [79.875, 52.0, -48.0], [80.125, 32.0, 92.0]];
    let world = World::new(TARGET, &[cut]);
    let [hidden, seen] = [[5.0, 2.25], [3.0, 3.5]].map(|[y, z]| [[8.0, 4.0, 4.0], [80.0, y, z]]);
    assert_eq!(crosses(hidden.map(DVec3::from_array), &world.shapes[1]), Some(true));
    assert_eq!(world.error(seen, vec![surface(&[1], hidden)]), SURFACE);
}

/// A triangle from a corner of the target through P: it blocks the segments from above.
#[test]
fn surfaces_at_the_target_that_cut_the_start_of_segments_are_refused() {
    let world = World::new(TARGET, &[[TARGET[2], [-64.0, -300.0, 2.0], [-64.0, 300.0, 2.0]]]);
    let [hidden, seen] = [6.0, 2.0].map(|z| [[8.0, 4.25, z], [80.0, 4.0, 3.0]]);
    assert_eq!(crosses(hidden.map(DVec3::from_array), &world.shapes[1]), Some(true));
    assert_eq!(world.error(seen, vec![surface(&[1], hidden)]), SURFACE);
}

/// A ring larger than its occluder.
#[test]
fn loops_away_from_their_occluder_are_refused() {
    let small = [[40.0, 3.0, 3.0], [40.0, 5.0, 3.0], [40.0, 4.0, 5.0]];
    let corners = WALL.map(|x| Vec3::from_array(x).as_dvec3());
    for clearance in [0.0, 1.0 / 128.0] {
        let world = World { clearance, ..World::new(TARGET, &[small]) };
        let seen = [[8.0, 0.0, 7.0], [80.0, 4.0, 5.0]];
        assert_eq!(world.error(seen, vec![ring(world.piece(1), &corners, LINE, &INSIDE)]), LOOP);
    }
}

/// Occluders behind the viewcell, and behind the target.
#[test]
fn loops_beyond_the_ends_of_segments_are_refused() {
    for x in [-4.0, 81.0] {
        let wall = WALL.map(|[_, y, z]| [x, y, z]);
        for clearance in [0.0, 1.0 / 128.0] {
            let world = World { clearance, ..World::new(TARGET, &[wall]) };
            let step = ring(world.piece(1), &world.shapes[1], LINE, &INSIDE);
            assert_eq!(world.error(LINE, vec![step]), LOOP, "{x} {clearance}");
        }
    }
}

/// An occluder inside the viewcell by less than the error of positions: segments start before it.
#[test]
fn loops_just_inside_the_viewcell_are_refused() {
    let wall = WALL.map(|[_, y, z]| [8.0, y, z]);
    let mut world = World::new(TARGET, &[wall]);
    let delta = position_error(&world.triangles, &world.cell, Target::Triangle(0), 0.0).unwrap();
    let loop_ = ring(world.piece(1), &world.shapes[1], [[0.0, 4.0, 4.0], LINE[1]], &INSIDE);
    assert_eq!(world.proof(vec![loop_.clone()]).check(&world.triangles), Ok(()));
    world.cell.max.x += 2.0 * delta;
    assert_eq!(world.proof(vec![loop_]).check(&world.triangles).err(), LOOP);
}

/// A plate in the target's plane, larger than the target.
#[test]
fn loops_in_the_plane_of_the_target_are_refused() {
    let world = World::new(TARGET, &[WALL.map(|[_, y, z]| [80.0, y, z])]);
    let step = ring(world.piece(1), &world.shapes[1], LINE, &INSIDE);
    assert_eq!(world.error(LINE, vec![step]), LOOP);
    // No ring at all.
    let step = Step::Loop { piece: world.piece(1), ring: [].into(), side: 1.0, edges: [].into() };
    assert!(matches!(world.error(LINE, vec![step]), LOOP | MALFORMED));
}

/// Corners that are said to be the target's, and are behind the target: far ones, and one of an occluder that
/// holds another corner of the target.
#[test]
fn corners_that_are_not_the_targets_are_refused() {
    let tilted = [[70.0, 52.0, -48.0], [90.0, 32.0, 92.0], [90.0, -200.0, -90.0]];
    let world = World::new(TARGET, &[tilted]);
    let seen = [[8.0, 4.0, 4.0], [80.0, 3.0, 3.0]];
    for tags in [[3, 3, 3], [3, 0, 1], [3, 1, 2], [3, 0, 0]] {
        let Step::Loop { piece, ring, side, edges } = ring(world.piece(1), &world.shapes[1], LINE, &INSIDE)
        else {
            unreachable!()
        };
        let ring = ring.iter().zip(tags).map(|(&(x, _), tag)| (x, tag)).collect();
        assert_eq!(world.error(seen, vec![Step::Loop { piece, ring, side, edges }]), LOOP);
    }
    let cut = [[80.0, 2.0, 2.0], [79.875, 52.0, -48.0], [80.125, 32.0, 92.0]];
    let world = World::new(TARGET, &[cut]);
    let step = ring(world.piece(1), &world.shapes[1], [LINE[0], [80.0, 5.0, 2.25]], &INSIDE);
    let Step::Loop { piece, ring, side, edges } = step else { unreachable!() };
    let ring = ring.iter().zip([0, 3, 0]).map(|(&(x, _), tag)| (x, tag)).collect();
    assert_eq!(
        world.error([[8.0, 4.0, 4.0], [80.0, 3.0, 3.5]], vec![Step::Loop { piece, ring, side, edges }]),
        LOOP
    );
}

#[test]
fn loops_that_lines_pass_outside_are_refused() {
    let world = World::new(TARGET, &[HALF_WALL]);
    let line = [[8.0, 4.0, 2.0], [80.0, 4.0, 2.5]];
    assert_eq!(world.error(OVER, vec![ring(world.piece(1), &world.shapes[1], line, &INSIDE)]), LOOP);
    // All lines pass outside of the first edge, or the second, inside of the others.
    let above = HALF_WALL.map(|[x, y, z]| [x, y, z - 40.0]);
    let world = World::new(TARGET, &[above]);
    let line = [[8.0, 4.0, -40.0], [80.0, 4.0, -38.0]];
    assert_eq!(world.error(LINE, vec![ring(world.piece(1), &world.shapes[1], line, &INSIDE)]), LOOP);
}

/// A ring of which an edge that lines pass outside of is not asked about, and a side that is no sign.
#[test]
fn malformed_loops_are_refused() {
    let world = World::new(TARGET, &[HALF_WALL]);
    let line = [[8.0, 4.0, 2.0], [80.0, 4.0, 2.5]];
    let step = ring(world.piece(1), &world.shapes[1], line, &INSIDE[..2]);
    assert_eq!(world.error(OVER, vec![step]), MALFORMED);
    let step = ring(world.piece(1), &world.shapes[1], line, &[INSIDE, INSIDE].concat());
    assert_eq!(world.error(OVER, vec![step]), MALFORMED);
}

/// Edges in the middle of the segments, of which it is said that no line passes outside.
#[test]
fn edges_that_lines_pass_outside_are_refused() {
    let world = World::new(TARGET, &[HALF_WALL]);
    let line = [[8.0, 4.0, 2.0], [80.0, 4.0, 2.5]];
    let [good, step] = [INSIDE.to_vec(), vec![LoopEdge::Inside, LoopEdge::Inside, never(&[1.0])]]
        .map(|edges| ring(world.piece(1), &world.shapes[1], line, &edges));
    drop(good);
    assert_eq!(world.error(OVER, vec![step]), WEIGHTS);
    // The row of the first edge, which excludes, does not remain.
    let edges = [never(&[1.0]), LoopEdge::Inside, never(&[1.0, 0.0])];
    let step = ring(world.piece(1), &world.shapes[1], line, &edges);
    assert_eq!(world.error(OVER, vec![step]), WEIGHTS);
    // All lines pass above.
    let below = HALF_WALL.map(|[x, y, z]| [x, y, z - 40.0]);
    let world = World::new(TARGET, &[below]);
    let line = [[8.0, 4.0, -40.0], [80.0, 4.0, -38.0]];
    for weight in [1.0, -1.0] {
        let edges = [LoopEdge::Inside, LoopEdge::Inside, never(&[weight])];
        let step = ring(world.piece(1), &world.shapes[1], line, &edges);
        assert_eq!(world.error(LINE, vec![step]), WEIGHTS, "{weight}");
    }
}

/// Nodes of the lines outside of an edge, which are said to be empty.
#[test]
fn nodes_with_lines_are_not_empty() {
    let world = World::new(TARGET, &[HALF_WALL]);
    let line = [[8.0, 4.0, 2.0], [80.0, 4.0, 2.5]];
    let edges = [LoopEdge::Divides, LoopEdge::Inside, LoopEdge::Divides];
    let step = ring(world.piece(1), &world.shapes[1], line, &edges);
    // The first weights hold. With the second the lines would have to be outside of the first edge.
    for weights in [&[1.0, 0.0][..], &[1.0, 0.0, 0.0], &[0.0, 1.0], &[1.0], &[]] {
        let steps = vec![step.clone(), empty(&[1.0]), empty(weights)];
        assert_eq!(world.error(OVER, steps), WEIGHTS, "{weights:?}");
    }
    let steps = vec![step.clone(), empty(&[1.0])];
    assert_eq!(world.error(OVER, steps), MALFORMED);
    let steps = vec![step.clone(), empty(&[1.0]), Step::Corner { edges: [0, 1, 1] }];
    assert_eq!(world.error(OVER, steps), Some(ProofError::Corner));
    let below = HALF_WALL.map(|[x, y, z]| [x, y, z - 40.0]);
    let world = World::new(TARGET, &[below]);
    let line = [[8.0, 4.0, -40.0], [80.0, 4.0, -38.0]];
    let edges = [LoopEdge::Inside, LoopEdge::Inside, LoopEdge::Divides];
    let step = ring(world.piece(1), &world.shapes[1], line, &edges);
    for weight in [1.0, -1.0] {
        assert_eq!(world.error(LINE, vec![step.clone(), empty(&[weight])]), WEIGHTS);
    }
}

/// The rows of one half's loop are not those of the other half, nor of the next pair of polygons.
#[test]
fn rows_end_with_their_loop() {
    let world = World::new(TARGET, &[WALL]);
    let edges = [LoopEdge::Divides, LoopEdge::Inside, LoopEdge::Inside];
    let good = ring(world.piece(1), &world.shapes[1], LINE, &edges);
    let halves = Step::Halves { of_p: true, across: false };
    let steps = vec![halves.clone(), good.clone(), empty(&[1.0]), good.clone(), empty(&[1.0])];
    assert_eq!(world.proof(steps).check(&world.triangles), Ok(()));
    // A wall that is seen past on one half of P.
    let world = World::new(TARGET, &[[[9.0, -300.0, -100.0], [9.0, -300.0, 1000.0], [9.0, 4.0, 4.0]]]);
    let world = World { shapes: world.shapes, ..World::new(TARGET, &[WALL]) };
    let steps = vec![halves, good, empty(&[1.0]), empty(&[1.0])];
    assert_eq!(world.proof(steps).check(&world.triangles).err(), WEIGHTS);
}

/// A target whose plane cuts the viewcell, and a plate that hangs from its front edge. P holds points behind
/// the plane by less than the errors of heights; a line from there passes under the edge.
#[test]
fn lines_that_start_behind_the_plane_of_the_target_are_refused() {
    let [a, b, c] = [[16.0, 2.0, 2.25], [16.0, 6.0, 2.25], [80.0, 4.0, 4.25]];
    let world = World::new([a, b, c], &[[a, b, [16.0, 4.0, -400.0]]]);
    assert!(world.sees([DVec3::new(8.0, 4.0, 6.0), DVec3::new(48.0, 4.0, 3.25)]));
    let (check, sight) = world.node_from(DVec3::Z);
    let line = |z: f64| [DVec3::new(8.0, 4.0, z), DVec3::new(48.0, 4.0, 3.25)];
    let below = line(2.0 - 3.5 * check.delta);
    assert_eq!(crosses(below, &world.shapes[1]), Some(true));
    assert!(!check.surface_blocks(&sight, &[1], &[], below));
    // A line from before the plane passes over the edge.
    assert_eq!(crosses(line(4.0), &world.shapes[1]), Some(false));
    assert!(!check.surface_blocks(&sight, &[1], &[], line(4.0)));
}

/// A sill before the target, over its plane by less than the errors of heights: a line that starts and ends
/// lower meets it, and others do not.
#[test]
fn edges_next_to_the_plane_of_the_target_are_met() {
    let target = [[8.0, 2.0, 0.25], [8.0, 6.0, 0.25], [72.0, 4.0, 2.25]];
    for height in [2.5, 2.0] {
        let delta = 400.0 * 2f64.powi(-46);
        let top = (height * delta) as f32;
        let mut world = World::new(target, &[[[0.0, -100.0, top], [0.0, 100.0, top], [0.0, 0.0, -400.0]]]);
        let (min, max) = (DVec3::new(-80.0, 0.0, -6.0), DVec3::new(-72.0, 8.0, 2.0));
        world.cell = CellBox { min, max };
        assert!(world.sees([DVec3::new(-72.0, 4.0, 0.0), DVec3::new(56.0, 4.0, 1.75)]));
        let (check, sight) = world.node_from(DVec3::Z);
        assert_eq!(check.delta, delta);
        let line = [DVec3::new(-72.0, 4.0, -2.25 + 3.2 * delta), DVec3::new(56.0, 4.0, 1.75)];
        let lifted = [line[0], line[1] + sight.before_q.normal * (1.25 * delta)];
        assert_eq!(crosses(lifted, &world.shapes[1]), Some(height > 2.25));
        assert!(!check.surface_blocks(&sight, &[1], &[], line));
    }
}

/// A plate that hangs from the target's lower side, behind the target, and a line that ends behind the target
/// by less than the errors of positions.
#[test]
fn lines_that_end_behind_the_plane_of_the_target_are_refused() {
    let [a, b, _] = TARGET;
    let world = World::new(TARGET, &[[a, b, [400.0, 4.0, -400.0]]]);
    let delta = position_error(&world.triangles, &world.cell, Target::Triangle(0), 0.0).unwrap();
    let line = [LINE[0], [80.0 + 0.5 * delta, 4.0, 2.0 - 0.5 * delta]];
    assert_eq!(crosses(line.map(DVec3::from_array), &world.shapes[1]), Some(true));
    assert_eq!(world.error(LINE, vec![surface(&[1], line)]), SURFACE);
}

/// A viewcell that is over the plane of the target's upper side by less than the errors of heights, at one
/// edge, and sees this side from there; a plate hides the lower side.
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
        assert!(answer != Answer::Hidden || proof.check(&world.triangles) == Ok(()));
        answer
    };
    assert_eq!(solve(-8.0 * delta), Answer::Hidden);
    for part in [0.01, 0.25, 1.0] {
        assert_ne!(solve(part * delta), Answer::Hidden, "{part}");
    }
}

/// A tetrahedron on a corner of the target, and a line that ends inside it, by less than the errors of
/// positions before the target.
#[test]
fn lines_that_end_next_to_a_surface_at_the_target_are_refused() {
    let [a, b, c, d] = [TARGET[0], [70.0, 12.0, 10.0], [70.0, 8.0, 12.0], [70.0, 10.0, 7.0]];
    let world = World::new(TARGET, &[[a, b, c], [a, c, d], [a, d, b], [b, c, d]]);
    let delta = position_error(&world.triangles, &world.cell, Target::Triangle(0), 0.0).unwrap();
    let line = [[8.0, 0.0, 0.0], [80.0, 2.0 + delta, 2.0 + delta]];
    assert_eq!(world.error(LINE, vec![surface(&[1, 2, 3, 4], line)]), SURFACE);
}

/// The ring of the target's own triangle: its corners are before its plane by rounding.
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
        assert!(error == LOOP || behind && error.is_some());
    }
}

/// Edges that lines pass by less than the error of positions: whatever the number that says on which side.
#[test]
fn edges_within_the_error_of_positions_are_not_passed() {
    let target = [[72.0, 2.0, 0.5], [72.0, 6.0, 0.5], [72.0, 4.0, 2.0]];
    // The upper edge is on the segments from the upper side of P to the target's upper corner.
    let mut world = World::new(target, &[HALF_WALL.map(|[x, y, z]| [x, y, z + 1.0])]);
    let delta = position_error(&world.triangles, &world.cell, Target::Triangle(0), 0.0).unwrap();
    let line = [[8.0, 4.0, 4.0], [72.0, 4.0, 1.0]];
    let Step::Loop { piece, ring, side, edges } = ring(world.piece(1), &world.shapes[1], line, &INSIDE)
    else {
        unreachable!()
    };
    let with = |side| vec![Step::Loop { piece, ring: ring.clone(), side, edges: edges.clone() }];
    for (lower, error) in [(0.0, LOOP), (0.2, LOOP), (400.0, None)] {
        world.cell.max.z = 8.0 - lower * delta;
        assert_eq!(world.proof(with(side)).check(&world.triangles).err(), error, "{lower}");
        for scale in [1e30, f64::INFINITY, f64::NAN, -1.0, 0.0] {
            assert!(world.proof(with(side * scale)).check(&world.triangles).is_err(), "{lower} {scale}");
        }
    }
}

/// An occluder at a corner of the target that hides all of a half but a part at the middle of its side; the
/// other half is hidden.
#[test]
fn mixtures_of_other_corners_are_not_on_an_edge() {
    let at_corner = [TARGET[2], [79.0, 4.0, -200.0], [79.0, -200.0, 6.5]];
    // Below the line from (2, 2) through (5, 4), and above.
    let below = [[79.0, -298.0, -197.7], [79.0, 302.0, 202.3], [79.0, 300.0, -400.0]];
    let world = World::new(TARGET, &[at_corner, below]);
    let Step::Loop { piece, ring: corners, side, edges } =
        ring(world.piece(1), &world.shapes[1], [LINE[0], [80.0, 3.5, 3.5]], &INSIDE)
    else {
        unreachable!()
    };
    let corners = corners.iter().zip([2, 3, 3]).map(|(&(x, _), tag)| (x, tag)).collect();
    let forged = Step::Loop { piece, ring: corners, side, edges };
    let hidden = ring(world.piece(2), &world.shapes[2], [LINE[0], [80.0, 4.0, 2.5]], &INSIDE);
    let halves = Step::Halves { of_p: false, across: false };
    let seen = [[8.0, 4.0, 4.0], [80.0, 4.5, 4.25]];
    assert_eq!(world.error(seen, vec![halves.clone(), hidden.clone(), forged.clone()]), LOOP);
    // The first half is well.
    assert_eq!(world.proof(vec![halves, hidden]).check(&world.triangles).err(), MALFORMED);
}

/// Polygons that do not occlude, are not convex, or not flat: lines pass between their triangles.
#[test]
fn pieces_that_are_no_convex_polygon_of_occluders_are_refused() {
    let of = |shapes: &[(Triangle, bool)]| {
        let mut world = World::new(TARGET, &[]);
        world.triangles = scene_of(shapes);
        world.shapes = shapes
            .iter()
            .filter(|(_, occluder)| *occluder)
            .map(|(t, _)| t.map(|x| Vec3::from_array(x).as_dvec3()))
            .collect();
        world
    };
    let refused = |world: World, piece: u32, corners: &[DVec3]| {
        let edges = vec![LoopEdge::Inside; corners.len()];
        assert_eq!(world.error(LINE, vec![ring(piece, corners, LINE, &edges)]), LOOP);
    };
    let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z).as_dvec3();
    let mut world = of(&[(TARGET, true), (WALL, false)]);
    let piece = world.triangles.push_piece(&[1]);
    refused(world, piece, &WALL.map(|[x, y, z]| at(x, y, z)));
    // Two triangles in one plane, apart.
    let left = [[40.0, -300.0, -100.0], [40.0, -30.0, 4.0], [40.0, -300.0, 400.0]];
    let right = left.map(|[x, y, z]| [x, -y, z]);
    let mut world = of(&[(TARGET, true), (left, true), (right, true)]);
    let piece = world.triangles.push_piece(&[1, 2]);
    let corners = [left[0], right[0], right[2], left[2]].map(|[x, y, z]| at(x, y, z));
    refused(world, piece, &corners);
    // Two triangles with a side in common, behind the viewcell.
    let (low, high) = ([-50.0, 4.0, -400.0], [-50.0, 4.0, 800.0]);
    let (left, right) = ([40.0, -300.0, 4.0], [40.0, 300.0, 4.0]);
    let mut world = of(&[(TARGET, true), ([left, low, high], true), ([right, high, low], true)]);
    let piece = world.triangles.push_piece(&[1, 2]);
    let between = |[x, y, z]: [f32; 3], b: [f32; 3]| at(x, y, z).lerp(Vec3::from_array(b).as_dvec3(), 0.3);
    let corners = [between(left, low), between(right, low), between(right, high), between(left, high)];
    refused(world, piece, &corners);
}

/// Returns a node in which all pairs of points of two polygons are asked about, without scene.
fn node(p: &[DVec3], q: &[DVec3], near: Option<f64>) -> Sight {
    let half = Half { normal: DVec3::X, offset: 1e9 };
    Sight { p: Polygon::new(p), q: Polygon::new(q), before_p: half, before_q: half, near }
}

/// Three edges that a line between two corners passes on the given sides, by exact integers.
#[test]
fn corners_with_lines_are_refused() {
    let world = World::new(TARGET, &[]);
    let (steps, target_vertices) = ([].iter(), vec![]);
    let check = Check { triangles: &world.triangles, clearance: 0.0, delta: 1e-13, target_vertices, steps };
    let mut random = Random(5);
    let (mut tried, mut excluded) = (0, 0);
    for round in 0..90_000 {
        let mut int = |r: i32| DVec3::from_array(core::array::from_fn(|_| f64::from(random.between(-r, r))));
        let r = [1, 4, 16, 30][round / 6 % 4];
        let (p, q) = (int(20) * 2.0, int(20) * 2.0);
        let s = if round % 2 == 0 { r } else { 0 };
        let (p, q) = ([p, p + int(s) * 2.0, p + int(s) * 2.0], [q, q + int(r) * 2.0, q + int(r) * 2.0]);
        let edges = [int(12), int(12), int(12)].map(|a| [a, a + int(9)]);
        let sight = node(&p, &q, None);
        let sides = |p: DVec3, q: DVec3| edges.map(|[a, b]| sign((q - p).dot((a - p).cross(b - p))));
        // To a corner, or to the middle of a side.
        let seen = sides(p[round % 2], (q[0] + q[round / 3 % 2]) * 0.5);
        let rows: [Divider; 3] =
            core::array::from_fn(|k| ([(edges[k][0], None), (edges[k][1], None)], seen[k]));
        if seen.iter().all(|x| *x != 0.0) {
            tried += 1;
            assert!(!check.corner_excludes(&sight, [&rows[0], &rows[1], &rows[2]]), "{round}");
        }
        // What is excluded has no line between corners.
        let rows = rows.map(|(edge, sign)| (edge, -sign));
        if seen.iter().all(|x| *x != 0.0) && check.corner_excludes(&sight, [&rows[0], &rows[1], &rows[2]]) {
            excluded += 1;
            let is_inside = |p: DVec3, q: DVec3| sides(p, q).iter().zip(&seen).all(|(x, y)| *x == -*y);
            assert!(!p.iter().any(|p| q.iter().any(|q| is_inside(*p, *q))), "{round}");
        }
    }
    assert!(tried > 60_000 && excluded > 100, "{tried} {excluded}");
}

fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

/// One line that meets three edges, in numbers whose products have more than 106 digits, without errors of
/// positions: the form is 0 up to rounding.
#[test]
fn corners_on_a_line_are_refused() {
    let world = World::new(TARGET, &[]);
    let (steps, target_vertices) = ([].iter(), vec![]);
    let check = Check { triangles: &world.triangles, clearance: 1e-4, delta: 0.0, target_vertices, steps };
    let mut random = Random(6);
    for round in 0..5000 {
        let bits = [30, 46][round % 2];
        let mut int =
            || DVec3::from_array(core::array::from_fn(|_| ((random.bits() as i64) >> (64 - bits)) as f64));
        let (d, t, u) = (int(), int(), int());
        let t = [t, u, d - t - u];
        let (p, q) = (-d * 8.0, d * 8.0);
        let sight = node(&[p; 3], &[q; 3], Some(0.0));
        for sign in [1.0, -1.0] {
            let rows: [Divider; 3] = core::array::from_fn(|k| {
                let x = d * [0.0, 2.0, -1.0][k];
                ([(x - t[k] * 2.0, None), (x + t[k] * 4.0, None)], sign)
            });
            assert!(!check.corner_excludes(&sight, [&rows[0], &rows[1], &rows[2]]), "{round}");
        }
    }
}

/// Lines on both sides of an edge, given three times from different ends: weights for which the sum of sides
/// is 0 up to rounding.
#[test]
fn weights_that_cancel_are_refused() {
    let world = World::new(TARGET, &[]);
    let (steps, target_vertices) = ([].iter(), vec![]);
    let check = Check { triangles: &world.triangles, clearance: 1e-4, delta: 0.0, target_vertices, steps };
    let mut random = Random(7);
    for round in 0..3000 {
        let mut int = || DVec3::from_array(core::array::from_fn(|_| f64::from(random.between(-900, 900))));
        let (p, a, b, c) = (int(), int(), int(), int());
        // Lines through two points at both sides of a point of the edge.
        let q = [1.0, -0.371].map(|side| a + (b - a) * 0.5 - p + a + c * side);
        let sight = node(&[p; 3], &[q[0], q[1], q[1]], Some(0.0));
        let (s, t) = (f64::from(1 + (round % 7)), f64::from(3 + (round % 11)));
        let part = f64::from(round) / 3000.0;
        let edge = |from: f64, to: f64| [(a + (b - a) * from, None), (a + (b - a) * to, None)];
        let rows: [Divider; 3] =
            [(edge(0.0, 1.0), 1.0), (edge(-1.0, s - 1.0), -1.0), (edge(2.0, 2.0 + t), 1.0)];
        let weights = [1.0, (1.0 + part * t) / s, part];
        assert!(!check.excludes(&sight, &rows, &weights), "{round}");
    }
}

/// A loop with a corner behind the target's plane by less than the errors of heights, beside the target, the
/// others before it.
#[test]
fn corners_next_to_the_plane_of_the_target_are_not_before_it() {
    let mut random = Random(8);
    for round in 0..500 {
        let target = plane_through_the_origin(&mut random);
        let normal = unit_normal(&target.map(|x| Vec3::from_array(x).as_dvec3())).unwrap();
        let at = |x: DVec3| x.as_vec3().to_array();
        let far = Vec3::from_array(target[0]).as_dvec3();
        let lateral = normal.cross(far) * 4.0;
        let wall = [at(normal * -1e-20), at(far * 2.0 + lateral + normal), at(far * 2.0 - lateral + normal)];
        let mut world = World::new(target, &[wall]);
        let min = (far * 0.5 + normal * 4000.0).round();
        world.cell = CellBox { min, max: min + DVec3::ONE };
        let (check, sight) = world.node_from(normal);
        let corners = world.shapes[1].map(|x| (x, None));
        assert!(!check.is_on_piece(&sight, world.piece(1), &corners), "{round}");
        // The height over the plane is the target's by rounding.
        assert!(sight.before_q.height(corners[0].0).abs() < check.delta);
    }
}

/// Surfaces of two triangles that meet in a ridge from a corner of the target over the target: one that dips
/// below the plane by less than rounding, and a tent behind the plane whose ridge is over it.
#[test]
fn ridges_next_to_the_plane_of_the_target_are_refused() {
    let mut random = Random(9);
    let mut tried = [0; 2];
    for round in 0..4000 {
        let target = plane_through_the_origin(&mut random);
        let far = Vec3::from_array(target[0]).as_dvec3();
        let normal = unit_normal(&target.map(|x| Vec3::from_array(x).as_dvec3())).unwrap();
        let at = |x: DVec3| x.as_vec3().to_array();
        let lateral = normal.cross(far) * random.fine_range(2.0, 6.0);
        let is_tent = round % 2 == 1;
        let depth = normal * random.fine_range(50.0, 800.0) * if is_tent { -1.0 } else { 1.0 };
        let middle = far * random.fine_range(0.3, 1.2) + depth;
        // The greatest coordinate is that of the viewcell.
        let min = (far * 0.5 + normal * 60_000.0).round();
        let max = min + DVec3::ONE;
        let delta = 128.0 * 2f64.powi(-53) * min.abs().max(max.abs()).max_element();
        let ridge = at(normal * if is_tent { 2.7 * delta } else { -1e-20 });
        let [left, right] = [at(middle + lateral), at(middle - lateral)];
        let mut world = World::new(target, &[[target[0], ridge, left], [target[0], right, ridge]]);
        world.cell = CellBox { min, max };
        let (check, sight) = world.node_from(normal);
        let corners =
            |t: usize, k: usize| (world.shapes[t][k], check.tag(world.triangles.vertices(t as u32)[k]));
        let [far, ridge, left, right] = [corners(1, 0), corners(1, 1), corners(1, 2), corners(2, 1)];
        if [[far, left], [left, ridge], [far, right], [right, ridge]]
            .iter()
            .all(|edge| check.is_missed(&sight, edge, true))
        {
            tried[usize::from(is_tent)] += 1;
            let from = sight.p.center();
            let parts = if is_tent { [0.3, 0.0, 0.0] } else { [0.5, 0.3, 0.2] };
            let t = &world.shapes[0];
            let to = t[0] * parts[0] + t[1] * parts[1] + t[2] * parts[2];
            assert!(!check.surface_blocks(&sight, &[1, 2], &[], [from, to]), "{round}");
        }
    }
    assert!(tried.iter().all(|tried| *tried > 50), "{tried:?}");
}
