//! Forged proofs: each claims that a target is hidden although a segment sees it. One condition of the check
//! refuses the proof, and without this condition the check would accept it.
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
//! | `is_on_piece`: P before one-sided fronts | `loops_that_show_their_back_are_refused` |
//! | `is_on_piece`: near | `loops_away_from_their_occluder_are_refused` |
//! | `is_on_piece`: before P's plane | `loops_beyond_the_ends_of_segments_are_refused`, `loops_just_inside_the_viewcell_are_refused` |
//! | `is_on_piece`: before Q's plane, `in_front` | `corners_that_are_not_the_targets_are_refused`, `corners_next_to_the_plane_of_the_target_are_not_before_it` |
//! | `is_on_piece`: `leaves_plane` | `loops_in_the_plane_of_the_target_are_refused`, `the_ring_of_the_target_is_refused` |
//! | `is_on_piece`: `tags_hold` | `corners_that_are_not_the_targets_are_refused` |
//! | `sides`: exact zeros | `mixtures_of_other_corners_are_not_on_an_edge`, and `edges_in_the_plane_of_a_face_divide_the_lines_that_start_around_them`, `edges_near_the_plane_of_a_face_are_in_it` in `tests` |
//! | `is_in`: corners; the lift of the line's end | `lines_that_end_beyond_a_sharp_corner_are_refused`, `lines_of_proofs_with_a_clearance_are_not_moved` |
//! | `is_inside`: rounding beyond a tip, in `is_in` and `distance` | `lines_that_end_beyond_a_tip_by_rounding_are_refused`, `loops_beyond_the_tip_of_a_sliver_are_refused` |
//! | `distance`: normal of a sliver | `loops_off_the_plane_of_a_sliver_are_refused` |
//! | `ends_are_on_side`: with a clearance, and without | `lines_that_cross_a_triangle_over_which_all_segments_pass_are_refused`, `lines_that_end_beside_a_corner_of_the_target_are_refused` |
//! | `side`: underflow | `sides_that_underflow_are_unsure` |
//! | `is_on_side`, `separates`: margins | `edges_within_the_error_of_positions_are_not_passed`, and `what_touches_by_less_than_the_error_is_not_apart` in `tests` |
//! | `excludes`: weights, sums, rounding, underflow, overflow | `edges_that_lines_pass_outside_are_refused`, `weights_that_cancel_are_refused`, `weights_that_underflow_or_overflow_are_refused` |
//! | `corner_excludes`: signs, form, rounding | `corners_with_lines_are_refused`, `corners_on_a_line_are_refused`, `corners_of_edges_along_each_other_are_refused`, `corners_within_the_errors_of_positions_are_refused`, `corners_at_a_point_within_the_errors_of_positions_are_refused` |
//! | `check`: margin of cuts, tags with a clearance | `targets_seen_from_next_to_their_plane_are_refused`, `corners_of_the_target_have_no_tag_with_a_clearance` |
//! | `node`: cuts by planes | `viewcells_are_split_by_planes_of_one_sided_triangles` |
//!
//! Tests of `rings` and `surface_margins` ask for single conditions just inside and just outside of their
//! margins. Two conditions have only such tests, and no forged proof: that a triangle in `touches_beside` has
//! a corner that is not the target's, and that no end of a line in `crosses` is on the plane of a triangle.

mod loops;
mod margins;
mod rings;
mod steps;
mod surface_margins;
mod surfaces;
mod target_plane;

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

/// A viewcell, a target triangle with number 0, and occluder triangles with numbers from 1 on.
struct World {
    triangles: SceneTriangles,
    /// Corners of the target, then of each occluder, in scene coordinates.
    shapes: Vec<[DVec3; 3]>,
    cell: CellBox,
    clearance: f64,
}

type Triangle = [[f32; 3]; 3];

/// A target in the plane x = 80. Of the faces of [`CELL`] only x = 8 faces it.
const TARGET: Triangle = [[80.0, 2.0, 2.0], [80.0, 6.0, 2.0], [80.0, 4.0, 6.0]];
const CELL: CellBox = CellBox { min: DVec3::ZERO, max: DVec3::splat(8.0) };
/// A wall at x = 40 that hides [`TARGET`] from [`CELL`].
const WALL: Triangle = [[40.0, -300.0, -100.0], [40.0, 300.0, -100.0], [40.0, 0.0, 400.0]];
/// The part below z = 4 of a wall at x = 40.
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

    /// Returns the error that the check reports for a forged proof, `None` if the check accepts it. Asserts
    /// that the segment `seen` sees the target.
    fn error(&self, seen: [[f64; 3]; 2], steps: Vec<Step>) -> Option<ProofError> {
        assert!(self.sees(seen.map(DVec3::from_array)), "no segment of this world sees the target");
        self.proof(steps).check(&self.triangles).err()
    }

    /// Returns whether a segment starts in the viewcell, ends on the target, and touches no occluder before
    /// its end. Exact, by determinants of coordinates of 24 bits. With a clearance, no occluder may be within
    /// 6 clearances.
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

    /// Returns the state of a check, and the one pair of viewcell polygon and target polygon that face each
    /// other along `side`.
    fn node_from(&self, side: DVec3) -> (Check<'_>, Sight) {
        let target = Target::Triangle(0);
        let delta = position_error(&self.triangles, &self.cell, target, self.clearance).unwrap();
        let all = sights(&self.triangles, &self.cell, target, self.clearance, 4.0 * delta).unwrap();
        let mut all = all.into_iter().filter(|sight| sight.before_q.normal.dot(side) > 0.0);
        let sight = all.next().unwrap();
        let target_vertices = self.triangles.vertices(0).to_vec();
        let (triangles, clearance, steps) = (&self.triangles, self.clearance, [].iter());
        (Check { triangles, clearance, delta, target_vertices, steps, splits: 0 }, sight)
    }

    /// Asserts that a line crosses triangle `number`, and that the check refuses a proof with this triangle
    /// as its only surface, since the segment `seen` sees the target.
    fn refuses_surface(
        &self,
        number: u32,
        line: [[f64; 3]; 2],
        seen: [[f64; 3]; 2],
        case: impl core::fmt::Display,
    ) {
        let crossed = crosses(line.map(DVec3::from_array), &self.shapes[number as usize]);
        assert_eq!(crossed, Some(true), "{case}: the line crosses the surface");
        assert_eq!(self.error(seen, vec![surface(&[number], line)]), SURFACE, "{case}");
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

/// Returns a loop around a line. It has three or more corners, none of them a corner of the target.
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
const MALFORMED: Option<ProofError> = Some(ProofError::Form);

/// Returns a triangle with integer coordinates whose plane contains the origin. The origin is beyond the side
/// from the second to the third corner, outside of the triangle. Coordinates of points near the origin are
/// finely spaced, so such points can have any small height over the plane.
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

/// Correct steps of the same kinds as the forged ones are accepted.
#[test]
fn true_steps_hold() {
    let world = World::new(TARGET, &[WALL]);
    for step in [surface(&[1], LINE), ring(world.piece(1), &world.shapes[1], LINE, &INSIDE)] {
        assert_eq!(world.proof(vec![step]).check(&world.triangles), Ok(()), "one true step");
    }
    let never = ring(world.piece(1), &world.shapes[1], LINE, &[never(&[1.0]), never(&[1.0]), never(&[1.0])]);
    assert_eq!(world.proof(vec![never]).check(&world.triangles), Ok(()), "a loop whose edges each exclude");
    let divides = [LoopEdge::Divides, LoopEdge::Inside, LoopEdge::Divides];
    let divides = ring(world.piece(1), &world.shapes[1], LINE, &divides);
    let steps = vec![divides, empty(&[1.0]), empty(&[0.0, 1.0])];
    assert_eq!(world.proof(steps).check(&world.triangles), Ok(()), "a loop that divides, with its parts");
    // Two triangles that hide the target together, but not alone.
    let [a, b, c] = WALL;
    let middle = [40.0, 4.0, -100.0];
    let world = World::new(TARGET, &[[a, middle, c], [middle, b, c]]);
    let line = [[8.0, 4.5, 4.0], [80.0, 4.5, 3.0]];
    assert_eq!(
        world.proof(vec![surface(&[1, 2], line)]).check(&world.triangles),
        Ok(()),
        "a surface of two triangles"
    );
    assert_eq!(
        world.proof(vec![surface(&[1], line)]).check(&world.triangles).err(),
        SURFACE,
        "one of the two triangles"
    );
    // A wall whose upper edge is in the way until the clearance moves it. The line crosses the strip that the
    // edge moved over.
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
    assert_eq!(
        world.proof(vec![step]).check(&world.triangles),
        Ok(()),
        "an occluder with a side in the target's plane"
    );
}
