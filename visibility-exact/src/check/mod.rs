//! The check of proofs. It shares with the search only the statement to be proven (which pairs of polygons
//! hold the segments, how polygons are halved). Sides are computed in double-double arithmetic with error
//! bounds of their own, boundaries of surfaces are found anew, and more candidates for separating planes are
//! tried.

mod context;
mod exact_side;
mod exclusion;
#[cfg(test)]
mod forged;
mod ring;
mod separation;
mod surface;
#[cfg(test)]
mod tests;

use crate::proof::{LoopEdge, Proof, Step};
use crate::search::SPLITS;
use crate::sight::{Sight, Target, position_error, sights};
use crate::triangles::SceneTriangles;
use alloc::vec::Vec;
use context::{Check, Corner, Divider};
use core::fmt;

/// Reasons why a [`Proof`] does not hold.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum ProofError {
    /// The proof has too few or too many nodes, numbers out of range, or a target that it cannot cover: some
    /// viewpoint is over the plane of a target face by more than a sixteenth of the clearance, but none by
    /// more than the clearance.
    Form,
    /// A surface touches the viewcell or the target, segments meet its boundary, or its sample line does not
    /// cross it an odd number of times.
    Surface,
    /// A loop is not near its occluder, or segments may pass outside the loop.
    Loop,
    /// Weights of dividing edges that are given as a reason do not exclude all segments.
    Weights,
    /// Three edges around a corner that are given as a reason do not exclude all segments.
    Corner,
}

impl fmt::Display for ProofError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Form => "the proof is malformed",
            Self::Surface => "a surface does not block its node",
            Self::Loop => "a loop does not wind around its node",
            Self::Weights => "weights do not exclude a node",
            Self::Corner => "a corner does not exclude a node",
        })
    }
}

impl core::error::Error for ProofError {}

impl Proof {
    /// Checks the proof against the triangles that it was made for. A culler has checked each proof by which
    /// it calls an object hidden, which takes 30 to 50 % of the time of the search.
    ///
    /// # Errors
    /// [`ProofError`] if a step does not hold. A proof for other triangles may fail in any way, or hold by
    /// chance.
    pub fn check(&self, triangles: &SceneTriangles) -> Result<(), ProofError> {
        if let Target::Triangle(t) = self.target
            && t as usize >= triangles.index_limit()
        {
            return Err(ProofError::Form);
        }
        let delta = position_error(triangles, &self.cell, self.target, self.clearance);
        let delta = delta.ok_or(ProofError::Form)?;
        let target_vertices = match self.target {
            Target::Triangle(t) if self.clearance == 0.0 => triangles.vertices(t).to_vec(),
            _ => Vec::new(),
        };
        let clearance = self.clearance;
        let (steps, splits) = (self.steps.iter(), 0);
        let mut check = Check { triangles, clearance, delta, target_vertices, steps, splits };
        let all = sights(triangles, &self.cell, self.target, self.clearance, 4.0 * delta);
        for sight in all.ok_or(ProofError::Form)? {
            check.node(&sight, &mut Vec::new(), 0)?;
        }
        if check.steps.next().is_some() { Err(ProofError::Form) } else { Ok(()) }
    }
}

/// Greatest depth of a node in the tree of nodes that belongs to a pair of polygons, whose root has depth 0.
/// A proof with a deeper node is refused.
pub(crate) const DEPTH: usize = 400;

impl Check<'_> {
    fn node(&mut self, sight: &Sight, rows: &mut Vec<Divider>, depth: usize) -> Result<(), ProofError> {
        let step = self.steps.next().ok_or(ProofError::Form)?;
        if depth > DEPTH {
            return Err(ProofError::Form);
        }
        match step {
            Step::Halves { of_p, across } => {
                for half in sight.halves(*of_p, *across) {
                    self.node(&half, rows, depth + 1)?;
                }
                Ok(())
            }
            Step::Split { triangle } => {
                // The parts of the viewcell polygon in front of and behind the triangle's plane. Both must be
                // proven.
                let front = (*triangle as usize) < self.triangles.index_limit() && self.splits < SPLITS;
                let front = front.then(|| self.triangles.front(*triangle)).flatten();
                let parts = front.and_then(|front| sight.split(front, self.clearance, 4.0 * self.delta));
                self.splits += 1;
                for part in parts.ok_or(ProofError::Form)? {
                    self.node(&part, rows, depth + 1)?;
                }
                self.splits -= 1;
                Ok(())
            }
            Step::Surface { triangles, moved, line } => {
                let holds = self.surface_blocks(sight, triangles, moved, *line);
                holds.then_some(()).ok_or(ProofError::Surface)
            }
            Step::Empty { weights } => {
                self.excludes(sight, rows, weights).then_some(()).ok_or(ProofError::Weights)
            }
            Step::Corner { edges } => {
                let three = edges.map(|k| rows.get(k as usize));
                let [Some(a), Some(b), Some(c)] = three else { return Err(ProofError::Form) };
                self.corner_excludes(sight, [a, b, c]).then_some(()).ok_or(ProofError::Corner)
            }
            Step::Loop { piece, ring, side, edges } => {
                // Segments inside all edges of the loop are blocked, since the loop lies on an occluding
                // polygon. For each dividing edge, the segments outside of the edge are a part that must be
                // proven.
                let ring: Vec<Corner> =
                    ring.iter().map(|&(x, tag)| (x, (tag < 3).then_some(usize::from(tag)))).collect();
                if ring.len() != edges.len() || side.abs() != 1.0 {
                    return Err(ProofError::Form);
                }
                if !self.is_on_piece(sight, *piece, &ring) {
                    return Err(ProofError::Loop);
                }
                let base = rows.len();
                let mut inside: Vec<Divider> = Vec::new();
                for (k, found) in edges.iter().enumerate() {
                    let edge = [ring[k], ring[(k + 1) % ring.len()]];
                    match found {
                        LoopEdge::Inside if self.is_on_side(sight, &edge, *side) => {}
                        LoopEdge::Inside => return Err(ProofError::Loop),
                        LoopEdge::Never { weights } => {
                            rows.push((edge, -side));
                            let holds = self.excludes(sight, rows, weights);
                            rows.truncate(base);
                            if !holds {
                                return Err(ProofError::Weights);
                            }
                        }
                        LoopEdge::Divides => inside.push((edge, *side)),
                    }
                }
                // Part k holds the segments inside the edges before k and outside edge k. So no two parts
                // share a segment, and no segment is left out.
                for k in 0..inside.len() {
                    rows.truncate(base);
                    rows.extend_from_slice(&inside[..k]);
                    rows.push((inside[k].0, -side));
                    self.node(sight, rows, depth + 1)?;
                }
                rows.truncate(base);
                Ok(())
            }
        }
    }
}
