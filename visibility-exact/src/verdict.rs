//! Verdicts on the objects of a scene from one viewcell: seen, hidden, hardly visible or open.

use crate::proof::Proof;
use crate::triangles::SceneTriangles;
use alloc::{boxed::Box, vec::Vec};
use visibility_core::ObjectId;
use visibility_core::glam::DVec3;

/// A line of sight from a viewcell to an object, in scene coordinates. The segment certainly misses all
/// occluding triangles except the one at which it ends.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub struct Witness {
    /// Viewpoint in the viewcell, where the line of sight begins, in scene coordinates.
    pub from: DVec3,
    /// End of the line of sight: on the seen triangle up to rounding, or, with a clearance, at most the
    /// clearance in front of it. Equal to `from` if the object reaches into the viewcell there.
    pub to: DVec3,
    /// Index of the seen triangle among all triangles of the [`SceneTriangles`].
    pub triangle: u32,
}

/// Verdict on an object from one viewcell.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Verdict {
    /// The object is visible along this line of sight.
    Seen(Witness),
    /// The object is proven hidden, up to the settings' clearance.
    Hidden,
    /// Upper bound on the share of the segments to the object's box, measured by area at both ends, that are
    /// unblocked. From 0 to 1, certified up to the clearance, and at most the share that
    /// [`Effort::Share`](crate::Effort::Share) sets.
    Hardly(f64),
    /// Neither a line of sight nor a proof was found. Counts as visible.
    Open,
}

/// Objects that were proven hidden together, with their proofs: one proof for a box around all of them or,
/// for a single object, proofs for boxes around its parts and for its other triangles.
#[derive(Clone, PartialEq, Debug)]
pub struct ProvenHidden {
    /// Positions of the objects in the list of objects of the [`SceneTriangles`].
    pub(crate) objects: Box<[u32]>,
    /// Proofs that together cover all parts of the objects.
    pub proofs: Vec<Proof>,
}

/// Verdict on each object of a scene from one viewcell. It bounds the exact answer from both sides: the
/// visible objects are at least those seen, and at most those seen and those open.
#[derive(Clone, PartialEq, Debug)]
#[non_exhaustive]
pub struct CellVerdicts {
    /// Verdict on each object, in the order of the objects of the [`SceneTriangles`].
    pub(crate) verdicts: Vec<Verdict>,
    /// Proofs of the hidden objects. Empty unless the settings [keep](crate::ExactSettings::with_kept_proofs)
    /// proofs.
    pub proofs: Vec<ProvenHidden>,
    /// Number of proofs that passed their check, kept or not. It includes proofs for parts of objects that
    /// are not proven hidden as a whole.
    pub proof_count: u64,
    /// Number of rays that were cast.
    pub rays: u64,
    /// Number of nodes of the search for proofs.
    pub nodes: u64,
    /// Number of proofs that [`Proof::check`] refused, whose targets stayed undecided. No scene with such a
    /// proof is known.
    pub refused: u64,
    /// Whether the viewcell could be used and the query ran to its end. If not, objects may be open for this
    /// reason alone.
    pub(crate) is_decided: bool,
}

impl CellVerdicts {
    /// Returns the objects with their verdicts. Objects that were not asked about are open. `triangles` must
    /// be in the state that the verdicts are of. The order is by ascending index, until a
    /// [`sync`](SceneTriangles::sync) has added objects.
    pub fn iter<'a>(
        &'a self,
        triangles: &'a SceneTriangles,
    ) -> impl Iterator<Item = (ObjectId, Verdict)> + 'a {
        let verdicts = triangles.objects.iter().zip(self.verdicts.iter().copied());
        verdicts.filter(|(object, _)| !object.is_removed).map(|(object, verdict)| (object.id, verdict))
    }

    /// Returns the numbers of objects seen, hidden and open. Hardly visible objects count as hidden. Objects
    /// that [`SceneTriangles::sync`] has found removed count as open, though [`iter`](Self::iter) leaves them
    /// out.
    pub fn counts(&self) -> [usize; 3] {
        count(self.verdicts.iter().copied())
    }
}

/// Returns the numbers of verdicts that are seen, hidden and open. Hardly visible counts as hidden.
pub(crate) fn count(verdicts: impl Iterator<Item = Verdict>) -> [usize; 3] {
    let mut counts = [0; 3];
    for verdict in verdicts {
        counts[match verdict {
            Verdict::Seen(_) => 0,
            Verdict::Hidden | Verdict::Hardly(_) => 1,
            Verdict::Open => 2,
        }] += 1;
    }
    counts
}
