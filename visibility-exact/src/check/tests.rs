//! Proofs that were tampered with are refused.

use crate::proof::{LoopEdge, Proof, Step};
use crate::search::{Answer, Budget, Search};
use crate::sight::{CellBox, Target};
use crate::triangles::SceneTriangles;
use std::{vec, vec::Vec};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Object, Scene};

/// A target behind two walls with slits that are not in line, and its proof.
fn hidden() -> (SceneTriangles, Proof) {
    let plate = |x: f32, y: [f32; 2], r: f32| {
        let [a, b, c, d] = [(y[0], -r), (y[1], -r), (y[1], r), (y[0], r)].map(|(y, z)| Vec3::new(x, y, z));
        vec![[a, b, c], [a, c, d]]
    };
    let slit = |x: f32, y: f32| [plate(x, [-30.0, y - 0.1], 10.0), plate(x, [y + 0.1, 30.0], 10.0)].concat();
    let mut scene = Scene::new();
    for triangles in [plate(20.0, [-0.5, 0.5], 5.0), slit(5.0, 0.0), slit(10.0, 0.5)] {
        let bounds = Aabb::from_points(triangles.iter().flatten().copied());
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        scene.set_triangles(id, triangles).unwrap();
    }
    let triangles = SceneTriangles::new(&scene);
    let cell = Viewcell::from_box(DVec3::new(0.0, -0.5, 1.0), DVec3::new(1.0, 0.5, 2.0));
    let cell = CellBox::new(&cell, DVec3::ZERO).unwrap();
    let target = Target::Triangle(0);
    let mut search = Search::new(&triangles, cell, 1e-4, None);
    assert_eq!(search.solve_target(target, Budget { nodes: 20_000, divided: 200 }).0, Answer::Hidden);
    let steps = core::mem::take(&mut search.steps);
    (triangles, Proof { cell, target, clearance: 1e-4, steps })
}

#[test]
fn proofs_with_a_changed_step_are_refused() {
    let (triangles, proof) = hidden();
    proof.check(&triangles).unwrap();
    let is_refused = |steps: Vec<Step>| Proof { steps, ..proof.clone() }.check(&triangles).is_err();
    assert!(is_refused(proof.steps[1..].to_vec()), "a missing step");
    assert!(is_refused([&proof.steps[..], &proof.steps[..1]].concat()), "a step too many");
    let mut kinds = [0; 3];
    for (at, step) in proof.steps.iter().enumerate() {
        let with = |changed: Step| {
            let mut steps = proof.steps.clone();
            steps[at] = changed;
            steps
        };
        match step.clone() {
            Step::Surface { triangles: surface, moved, line } => {
                kinds[0] += 1;
                for drop in 0..surface.len() {
                    let triangles = surface.iter().enumerate().filter(|(k, _)| *k != drop);
                    let triangles = triangles.map(|(_, t)| *t).collect();
                    let changed = Step::Surface { triangles, moved: moved.clone(), line };
                    // Of larger surfaces, one triangle may be dispensable.
                    assert!(surface.len() > 1 || is_refused(with(changed)), "an empty surface");
                }
                for far in [0.01, 10.0, f64::NAN] {
                    let all = surface
                        .iter()
                        .flat_map(|&t| triangles.vertices(t).into_iter().zip(triangles.corners(t)));
                    let mut moved: Vec<(u32, DVec3)> = all.map(|(v, x)| (v, x + DVec3::splat(far))).collect();
                    moved.sort_by_key(|entry| entry.0);
                    moved.dedup_by_key(|entry| entry.0);
                    let changed = Step::Surface { triangles: surface.clone(), moved: moved.into(), line };
                    assert!(is_refused(with(changed)), "a boundary moved too far");
                }
                let away = line.map(|x| x + DVec3::Y * 100.0);
                let changed = Step::Surface { triangles: surface.clone(), moved: moved.clone(), line: away };
                assert!(is_refused(with(changed)), "a line of another node");
                let twice = [&surface[..], &surface[..]].concat().into();
                assert!(is_refused(with(Step::Surface { triangles: twice, moved, line })), "an even surface");
            }
            Step::Loop { piece, ring, side, edges } => {
                kinds[1] += 1;
                let changed = Step::Loop { piece, ring: ring.clone(), side: -side, edges: edges.clone() };
                assert!(is_refused(with(changed)), "the other side");
                let large = ring.iter().map(|&(x, tag)| (x * 1.01, tag)).collect();
                let changed = Step::Loop { piece, ring: large, side, edges: edges.clone() };
                assert!(is_refused(with(changed)), "a loop away from its occluder");
                let inside = edges.iter().map(|_| LoopEdge::Inside).collect();
                let all_inside = edges.iter().all(|edge| *edge == LoopEdge::Inside);
                let changed = Step::Loop { piece, ring, side, edges: inside };
                assert!(all_inside || is_refused(with(changed)), "edges that divide");
            }
            Step::Empty { weights } => {
                kinds[2] += 1;
                let zero = weights.iter().map(|_| 0.0).collect();
                assert!(is_refused(with(Step::Empty { weights: zero })), "no weights");
                let less = weights.iter().map(|w| -w).collect();
                assert!(is_refused(with(Step::Empty { weights: less })), "negative weights");
            }
            Step::Halves { .. } | Step::Corner { .. } => {}
        }
    }
    assert!(kinds[0] > 0 && kinds[1] > 0, "{kinds:?}");
}
