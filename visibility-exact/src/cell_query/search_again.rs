//! Searches for objects that a change of the scene has made open, in a query whose other verdicts are kept.

use super::prices::GROUP;
use super::{CellQuery, TRIANGLE};
use crate::proof::Proof;
use crate::search::Answer;
use crate::sight::Target;
use crate::triangles::TargetObject;
use visibility_core::glam::DVec3;

impl CellQuery<'_> {
    /// Casts `rays` rays from the viewcell through random points of a box, and marks objects that they meet
    /// first as seen.
    pub(crate) fn look_through(&mut self, [min, max]: [DVec3; 2], rays: u32) {
        for _ in 0..rays {
            if self.search.must_stop() {
                return;
            }
            self.rays += 1;
            let to = min + (max - min) * self.random.point();
            let from = self.search.cell.towards(to, &mut self.random);
            self.see_first(from, to - from);
        }
    }

    /// Searches open objects again after a change of the scene, with `rays` rays aimed at each.
    pub(crate) fn search_again(&mut self, objects: &[u32], rays: u32) {
        let mut open = objects.to_vec();
        open.retain(|&o| {
            let is_asked = self.is_open(o) && !self.search.triangles.objects[o as usize].is_open;
            is_asked && !self.find_inside(o as usize)
        });
        self.aimed_rays(&open, rays);
        open.retain(|&o| self.is_open(o));
        let single = self.groups(open);
        self.triangles(&single, false);
    }

    /// Tries to prove open objects hidden that a thorough search has left open, by a few nodes for the box of
    /// each: enough for a wall that was put up before them.
    pub(crate) fn try_boxes(&mut self, objects: &[u32]) {
        for &o in objects {
            let TargetObject { min, max, is_open, .. } = self.search.triangles.objects[o as usize];
            if is_open || !self.is_open(o) || self.meets_cell(min, max) || self.search.must_stop() {
                continue;
            }
            let target = Target::Box { min, max };
            match self.solve(target, GROUP).0 {
                Answer::Hidden => self.hide(&[o], &[target]),
                Answer::Visible(line) => {
                    self.see_first(line.p, line.q - line.p);
                }
                Answer::Undecided => {}
            }
        }
    }

    /// Proves a target again, of whose proof some steps no longer hold. `fallen` tells which, `objects` is
    /// the number of objects in the target. `None` without a proof; if a line of sight is found instead, the
    /// first object on it is marked as seen.
    pub(crate) fn mend(&mut self, proof: &Proof, fallen: &[bool], objects: usize) -> Option<Proof> {
        if !fallen.contains(&true) {
            return Some(proof.clone());
        }
        let budget = match proof.target {
            Target::Box { .. } => self.prices.budget(objects),
            Target::Triangle(_) => TRIANGLE,
        };
        let (answer, _) = self.search.mend(proof, fallen, budget);
        match self.checked(proof.target, answer) {
            Answer::Hidden => Some(self.proof(proof.target)),
            Answer::Visible(line) => {
                self.see_first(line.p, line.q - line.p);
                None
            }
            Answer::Undecided => None,
        }
    }
}
