//! The search for what is visible from one viewcell: rays, then proofs of what rays have not found.

use crate::bake_cache::{HIDDEN, OPEN, SEEN};
use crate::settings::Settings;
use std::sync::Arc;
use visibility_core::pvs::Viewcell;
use visibility_core::{ObjectId, RegionCuller, Scene, VisibleSet};
use visibility_exact::{Effort, ExactCuller, SceneTriangles, Settings as ExactSettings, Verdict};

/// The search for answers from one viewcell, in the scene of the objects that its sweep has left.
pub(crate) struct Search<'a> {
    scene: &'a Scene,
    cell: &'a Viewcell,
    triangles: Arc<SceneTriangles>,
    ids: Vec<ObjectId>,
    costs: Vec<f64>,
    /// By index of an object.
    pub answers: Vec<u8>,
    /// Work done: rays, and nodes of the search for proofs.
    pub steps: u64,
}

impl<'a> Search<'a> {
    pub(crate) fn new(scene: &'a Scene, cell: &'a Viewcell, triangles: Arc<SceneTriangles>) -> Self {
        let ids: Vec<ObjectId> = scene.ids().collect();
        let cost = |&id: &ObjectId| scene.object(id).map_or(0, |object| object.cost);
        // An object without cost counts a little, so that it is not left open for nothing.
        let costs = ids.iter().map(|id| f64::from(cost(id)).max(1e-3)).collect();
        Self { scene, cell, triangles, answers: vec![OPEN; ids.len()], ids, costs, steps: 0 }
    }

    /// Finds what rays see.
    pub(crate) fn aim_rays(&mut self, settings: &Settings) {
        let mut rays =
            ExactCuller::new(self.triangles.clone(), ExactSettings::new(Effort::Rays(settings.rays)));
        let all: Vec<usize> = (0..self.ids.len()).collect();
        self.decide(&mut rays, &all);
        // Rays prove nothing.
        self.answers.iter_mut().filter(|answer| **answer == HIDDEN).for_each(|answer| *answer = OPEN);
    }

    /// Tries to prove the most costly of the open objects hidden, until the gap is met.
    pub(crate) fn prove(&mut self, settings: &Settings) {
        // What rays can find, the method before has found.
        let effort = ExactSettings::new(Effort::Exact(settings.clearance));
        let effort = ExactSettings { rays: 0, aimed_rays: 0, ..effort };
        let mut proofs = ExactCuller::new(self.triangles.clone(), effort);
        let gap = if settings.gap > 0.0 { settings.gap } else { 0.0 };
        let cost = |some: &[usize], costs: &[f64]| some.iter().map(|&at| costs[at]).sum::<f64>();
        let mut open: Vec<usize> = (0..self.ids.len()).filter(|&at| self.answers[at] == OPEN).collect();
        open.sort_by(|&a, &b| self.costs[b].total_cmp(&self.costs[a]).then(a.cmp(&b)));
        let seen: Vec<usize> = (0..self.ids.len()).filter(|&at| self.answers[at] == SEEN).collect();
        // Costs of objects seen, and of those that proofs were tried for in vain.
        let (mut seen_cost, mut left_cost) = (cost(&seen, &self.costs), 0.0);
        while !open.is_empty() {
            let open_cost = cost(&open, &self.costs);
            let allowed = gap * (seen_cost + left_cost + open_cost);
            if left_cost + open_cost <= allowed {
                break;
            }
            // The most costly objects, as many as must be decided to meet the gap.
            let mut rest = open_cost;
            let enough = open.iter().position(|&at| {
                rest -= self.costs[at];
                left_cost + rest <= allowed
            });
            let asked: Vec<usize> = open.drain(..enough.map_or(open.len(), |last| last + 1)).collect();
            self.decide(&mut proofs, &asked);
            for at in asked {
                match self.answers[at] {
                    SEEN => seen_cost += self.costs[at],
                    OPEN => left_cost += self.costs[at],
                    _ => {}
                }
            }
        }
    }

    /// Asks a culler for some objects, by their indices.
    fn decide(&mut self, culler: &mut ExactCuller, asked: &[usize]) {
        let mut is_asked = vec![false; self.ids.len()];
        asked.iter().for_each(|&at| is_asked[at] = true);
        let mut visible = VisibleSet::new();
        visible.retain(self.scene, |id, _| is_asked[id.index()]);
        culler.cull(self.scene, self.cell, &mut visible);
        let Some(found) = culler.last() else { return };
        self.steps += found.rays + found.nodes;
        for (id, verdict) in found.iter(&self.triangles) {
            if is_asked[id.index()] {
                self.answers[id.index()] = match verdict {
                    Verdict::Seen(_) => SEEN,
                    Verdict::Hidden => HIDDEN,
                    Verdict::Hardly(_) | Verdict::Open => OPEN,
                };
            }
        }
    }
}
