//! The search for what is visible from one viewcell: rays, then proofs of what rays have not found.

use crate::bake_cache::{HIDDEN, OPEN, SEEN};
use crate::settings::Settings;
use visibility_core::Scene;
use visibility_core::pvs::Viewcell;
use visibility_exact::{CellQuery, Effort, SceneTriangles, Settings as ExactSettings, Verdict};

/// The search for answers from one viewcell, in the scene of the objects that its sweep has left. The objects
/// of such a scene have consecutive indices from 0.
pub(crate) struct Search<'a> {
    /// `None` if the viewcell cannot be used: then all objects stay open.
    query: Option<CellQuery<'a>>,
    /// By index of an object.
    costs: Vec<f64>,
    /// By index of an object.
    pub answers: Vec<u8>,
}

/// How objects are proven hidden.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Method {
    Boxes,
    Triangles,
}

impl<'a> Search<'a> {
    /// Prepares the search. It gives up when `stop` returns true.
    pub(crate) fn new(
        scene: &Scene,
        cell: &Viewcell,
        triangles: &'a SceneTriangles,
        settings: &Settings,
        stop: &'a dyn Fn() -> bool,
    ) -> Self {
        let exact = ExactSettings::new(Effort::Exact(settings.clearance));
        let (rays, aimed_rays) = (settings.rays.saturating_mul(64), settings.rays);
        let query = CellQuery::new(triangles, cell, ExactSettings { rays, aimed_rays, ..exact });
        let cost = |id| scene.object(id).map_or(0, |object| object.cost);
        // An object without cost counts a little, so that it is not left open for nothing.
        let costs: Vec<f64> = scene.ids().map(|id| f64::from(cost(id)).max(1e-3)).collect();
        // What the frame never culls, a moving object for instance, is not hidden either where it stands now.
        let is_unculled =
            |id| scene.object(id).is_ok_and(|object| object.never_cull || !object.bounds.is_finite());
        let answers = scene.ids().map(|id| if is_unculled(id) { SEEN } else { OPEN }).collect();
        Self { query: query.map(|query| query.with_stop(stop)), costs, answers }
    }

    /// Returns whether the search has given up.
    pub(crate) fn is_stopped(&self) -> bool {
        self.query.as_ref().is_some_and(CellQuery::is_stopped)
    }

    /// Returns the work done: rays, and nodes of the search for proofs.
    pub(crate) fn steps(&self) -> u64 {
        self.query.as_ref().map_or(0, CellQuery::steps)
    }

    /// Finds what rays see.
    pub(crate) fn aim_rays(&mut self) {
        if let Some(query) = &mut self.query {
            query.look(&|_| true);
        }
        self.read();
    }

    /// Tries to prove open objects hidden until the gap is met, the most costly first: all by their boxes,
    /// and only then by their triangles, which takes a hundred times as long.
    pub(crate) fn prove(&mut self, gap: f64) {
        let gap = if gap > 0.0 { gap } else { 0.0 };
        for method in [Method::Boxes, Method::Triangles] {
            let mut untried: Vec<usize> =
                (0..self.costs.len()).filter(|&at| self.answers[at] == OPEN).collect();
            untried.sort_by(|&a, &b| self.costs[b].total_cmp(&self.costs[a]).then(a.cmp(&b)));
            while !untried.is_empty() && !self.is_stopped() {
                let mut open_cost = self.cost(OPEN);
                let allowed = gap * (self.cost(SEEN) + open_cost);
                if open_cost <= allowed {
                    return;
                }
                let enough = match method {
                    // As many as must be decided to meet the gap: they are proven in groups.
                    Method::Boxes => untried.iter().position(|&at| {
                        open_cost -= self.costs[at];
                        open_cost <= allowed
                    }),
                    Method::Triangles => Some(0),
                };
                let mut is_asked = vec![false; self.costs.len()];
                let asked = untried.drain(..enough.map_or(untried.len(), |last| last + 1));
                asked.for_each(|at| is_asked[at] = self.answers[at] == OPEN);
                let Some(query) = &mut self.query else { return };
                match method {
                    Method::Boxes => query.prove_boxes(&|id| is_asked[id.index()]),
                    Method::Triangles => query.prove_triangles(&|id| is_asked[id.index()]),
                }
                self.read();
            }
        }
    }

    /// Returns the cost of all objects with an answer.
    fn cost(&self, answer: u8) -> f64 {
        let some = self.answers.iter().zip(&self.costs).filter(|&(&of, _)| of == answer);
        some.map(|(_, cost)| cost).sum()
    }

    /// Takes the answers from the query.
    fn read(&mut self) {
        let Some(query) = &self.query else { return };
        for (id, verdict) in query.verdicts() {
            let answer = &mut self.answers[id.index()];
            // What is known stays: seen objects that the frame never culls have another verdict.
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
