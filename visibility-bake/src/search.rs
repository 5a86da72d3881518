//! The search from one viewcell: rays find visible objects, then proofs find hidden objects among the others.
//! An object is *open* while it is neither seen nor proven hidden.

use crate::bake_cache::{HIDDEN, OPEN, SEEN};
use crate::settings::SandwichSettings;
use visibility_core::Scene;
use visibility_core::pvs::Viewcell;
use visibility_exact::{CellQuery, Effort, ExactSettings, SceneTriangles, Verdict};

/// The search from one viewcell, in the scene of the objects that the viewcell's sweep has left. The objects
/// of this scene have consecutive indices from 0.
pub(crate) struct Search<'a> {
    /// Query from the viewcell. `None` if the viewcell cannot be used, in which case all objects stay open.
    query: Option<CellQuery<'a>>,
    /// Cost of each object in triangles, at least 0.001, by the object's index.
    costs: Vec<f64>,
    /// Greatest allowed ratio of the cost of open objects to the cost of seen and open objects.
    gap: f64,
    /// Answer for each object, by the object's index: [`SEEN`], [`HIDDEN`] or [`OPEN`].
    pub answers: Vec<u8>,
}

/// Methods by which objects are proven hidden.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Method {
    /// Proofs for boxes: of groups of objects first, then of single objects.
    Boxes,
    /// Proofs for all triangles of an object. Gives the object up at the first triangle that is not decided
    /// quickly.
    QuickTriangles,
    /// Proofs for all triangles of an object, which take a hundred times as long as proofs for boxes.
    Triangles,
}

impl<'a> Search<'a> {
    /// Prepares the search. `answers` are the answers known so far, by object index. The search ends once
    /// `stop` returns true.
    pub(crate) fn new(
        scene: &Scene,
        cell: &Viewcell,
        triangles: &'a SceneTriangles,
        settings: &SandwichSettings,
        mut answers: Vec<u8>,
        stop: &'a dyn Fn() -> bool,
    ) -> Self {
        let exact = ExactSettings::new(Effort::Exact(settings.clearance));
        let (rays, aimed_rays) = (settings.rays.saturating_mul(64), settings.rays);
        let query = CellQuery::new(triangles, cell, exact.with_rays(rays).with_aimed_rays(aimed_rays));
        let mut costs = Vec::new();
        for (id, answer) in scene.ids().zip(&mut answers) {
            let Ok(object) = scene.object(id) else { continue };
            // An object without cost gets a small cost, so that it is not left open for free.
            costs.push(f64::from(object.cost).max(1e-3));
            // Objects that are never culled, such as moving objects, must not be hidden by their present
            // position.
            if object.never_cull || !object.bounds.is_finite() {
                *answer = SEEN;
            }
        }
        let gap = if settings.gap > 0.0 { settings.gap } else { 0.0 };
        Self { query: query.map(|query| query.with_stop(stop)), costs, gap, answers }
    }

    /// Returns whether the search has ended because `stop` returned true.
    pub(crate) fn is_stopped(&self) -> bool {
        self.query.as_ref().is_some_and(CellQuery::is_stopped)
    }

    /// Returns the work done: the number of rays plus the number of nodes of the search for proofs.
    pub(crate) fn steps(&self) -> u64 {
        self.query.as_ref().map_or(0, CellQuery::steps)
    }

    /// Casts rays at all open objects, and records those that are seen.
    pub(crate) fn aim_rays(&mut self) {
        if let Some(query) = &mut self.query {
            query.look(&|_| true);
        }
        self.read();
    }

    /// Returns whether the cost of the open objects is within the gap, so that no further proof is needed.
    pub(crate) fn is_met(&self) -> bool {
        self.cost(OPEN) <= self.allowed()
    }

    /// Returns the greatest sum of the costs of open objects that the gap allows.
    fn allowed(&self) -> f64 {
        self.gap * (self.cost(SEEN) + self.cost(OPEN))
    }

    /// Tries to prove open objects hidden, the most costly first, until the gap is met.
    pub(crate) fn prove(&mut self, method: Method) {
        let mut untried: Vec<usize> = (0..self.costs.len()).filter(|&at| self.answers[at] == OPEN).collect();
        untried.sort_by(|&a, &b| self.costs[b].total_cmp(&self.costs[a]).then(a.cmp(&b)));
        while !untried.is_empty() && !self.is_stopped() && !self.is_met() {
            let (mut open, allowed) = (self.cost(OPEN), self.allowed());
            let enough = match method {
                // The number of objects that must be decided to meet the gap. They are proven in groups.
                Method::Boxes => untried.iter().position(|&at| {
                    open -= self.costs[at];
                    open <= allowed
                }),
                Method::QuickTriangles | Method::Triangles => Some(0),
            };
            let mut is_asked = vec![false; self.costs.len()];
            let asked = untried.drain(..enough.map_or(untried.len(), |last| last + 1));
            asked.for_each(|at| is_asked[at] = self.answers[at] == OPEN);
            let Some(query) = &mut self.query else { return };
            match method {
                Method::Boxes => query.prove_boxes(&|id| is_asked[id.index()]),
                Method::QuickTriangles => query.try_triangles(&|id| is_asked[id.index()]),
                Method::Triangles => query.prove_triangles(&|id| is_asked[id.index()]),
            }
            self.read();
        }
    }

    /// Returns the sum of the costs of the objects whose answer is `answer`.
    fn cost(&self, answer: u8) -> f64 {
        let some = self.answers.iter().zip(&self.costs).filter(|&(&of, _)| of == answer);
        some.map(|(_, cost)| cost).sum()
    }

    /// Copies new verdicts of the query to `answers`.
    fn read(&mut self) {
        let Some(query) = &self.query else { return };
        for (id, verdict) in query.verdicts() {
            let answer = &mut self.answers[id.index()];
            // Known answers stay: the query has other verdicts for objects that are never culled.
            if *answer == OPEN {
                *answer = match verdict {
                    Verdict::Seen(_) => SEEN,
                    Verdict::Hidden => HIDDEN,
                    Verdict::Hardly(_) | Verdict::Open => OPEN,
                };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::DVec3;
    use visibility_core::{Aabb, Object};

    /// What is never culled counts as seen, whatever is known of it, and costs are at least a thousandth.
    #[test]
    fn what_is_never_culled_is_seen_and_a_gap_is_met_by_equal_costs() {
        let mut scene = Scene::new();
        let bounds = Aabb::from_arrays([5.0; 3], [6.0; 3]);
        let infinite = Aabb::from_arrays([5.0; 3], [f32::INFINITY; 3]);
        for object in [
            Object { cost: 3, ..Object::new(bounds) },
            Object { cost: 4, never_cull: true, ..Object::new(bounds) },
            Object { cost: 5, ..Object::new(infinite) },
            Object { cost: 0, ..Object::new(bounds) },
        ] {
            scene.insert(object);
        }
        let (cell, triangles) = (Viewcell::from_box(DVec3::ZERO, DVec3::ONE), SceneTriangles::new(&scene));
        let search = |gap: f64, answers: [u8; 4]| {
            let settings = SandwichSettings::default().with_gap(gap);
            Search::new(&scene, &cell, &triangles, &settings, answers.to_vec(), &|| false)
        };
        let new = search(0.0, [OPEN; 4]);
        assert_eq!(new.answers, [OPEN, SEEN, SEEN, OPEN], "before any ray");
        assert_eq!(search(0.0, [HIDDEN; 4]).answers, [HIDDEN, SEEN, SEEN, HIDDEN], "forged answers");
        assert_eq!(new.costs, [3.0, 4.0, 5.0, 1e-3], "costs");
        for (gap, is_met) in [(0.25, true), (0.24, false), (0.0, false), (-1.0, false), (f64::NAN, false)] {
            let search = search(gap, [OPEN, SEEN, SEEN, HIDDEN]);
            assert_eq!(search.is_met(), is_met, "3 of 12 triangles are open, a gap of {gap}");
        }
        assert!(search(0.0, [SEEN; 4]).is_met(), "nothing is open");
    }

    /// A wall hides two boxes. Proofs end when the gap is met.
    #[test]
    fn proofs_end_when_the_gap_is_met() {
        let mut scene = Scene::new();
        let mut add = |min: [f32; 3], max: [f32; 3], cost: u32| {
            let bounds = Aabb::from_arrays(min, max);
            let corners = bounds.corners();
            let sides = visibility_core::OccluderMesh::CUBOID.map(|side| side.map(|at| corners[at as usize]));
            let id = scene.insert(Object { occluder: true, cost, ..Object::new(bounds) });
            scene.set_triangles(id, sides).unwrap();
        };
        add([3.0, -9.0, -9.0], [3.5, 9.0, 9.0], 96);
        add([5.0, 0.0, 0.0], [6.0, 1.0, 1.0], 4);
        add([7.0, 0.0, 0.0], [8.0, 1.0, 1.0], 2);
        let (cell, triangles) = (Viewcell::from_box(DVec3::ZERO, DVec3::ONE), SceneTriangles::new(&scene));
        let proven = |gap: f64, method: Method, is_stopped: bool| {
            let settings = SandwichSettings::default().with_gap(gap).with_rays(4);
            let stop = move || is_stopped;
            let mut search = Search::new(&scene, &cell, &triangles, &settings, vec![OPEN; 3], &stop);
            search.aim_rays();
            search.prove(method);
            search.answers.clone()
        };
        for method in [Method::Boxes, Method::QuickTriangles, Method::Triangles] {
            assert_eq!(proven(0.0, method, false), [SEEN, HIDDEN, HIDDEN], "no gap");
            // 2 of 98 triangles, 2.04 %, are open once the more costly box is proven hidden.
            assert_eq!(proven(0.0205, method, false), [SEEN, HIDDEN, OPEN], "a gap of the second box");
            assert_eq!(proven(1.0, method, false), [SEEN, OPEN, OPEN], "everything may stay open");
            assert_eq!(proven(0.0, method, true)[1..], [OPEN; 2], "a search that is stopped");
        }
    }
}
