//! Degrees of visibility: how much of each object shows from a viewcell, estimated from sampled eyes.
//!
//! A PVS says whether an object may be seen. A degree says how much of the object shows: the greatest solid
//! angle in which any sampled eye of the viewcell sees it, in four classes. Degrees are *estimates*: an eye
//! between the sampled ones may see more. Nothing is hidden by them unless a culler is [told
//! to](super::PvsCuller::with_least_degree).
//!
//! Based on: the hardly visible sets of Carlos Andújar, Carlos Saona-Vázquez, Isabel Navazo and Pere Brunet,
//! "Integrating Occlusion Culling and Levels of Detail through Hardly-Visible Sets", 2000; and the
//! semi-quantitative occlusion that Fredo Durand, George Drettakis, Joelle Thollot and Claude Puech ask for
//! in "Conservative Visibility Preprocessing using Extended Projections", 2000.

use super::{Pvs, PvsError, ViewcellId};
use alloc::vec::Vec;

/// How much of an object shows from a viewcell, estimated from sampled eyes. Lesser degrees come first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum SampledDegree {
    /// No sampled eye saw the object in a pixel of the sampled pictures. It may be visible nonetheless.
    Unseen,
    /// Some sampled eye saw the object, none of them in more than the second of the
    /// [limits](SampledDegrees::LIMITS).
    Hardly,
    /// Some sampled eye saw the object in more than the second limit, none of them in more than the third.
    Partly,
    /// Some sampled eye saw the object in more than the third limit. Also the degree of an object that could
    /// not be sampled.
    Widely,
}

impl SampledDegree {
    /// All degrees, ascending.
    pub const ALL: [Self; 4] = [Self::Unseen, Self::Hardly, Self::Partly, Self::Widely];

    /// Returns the degree of an object of which the sampled eyes see at most `solid_angle` steradians. 0 is
    /// [`Unseen`](Self::Unseen); NaN is [`Widely`](Self::Widely).
    ///
    /// ```
    /// use visibility_core::pvs::SampledDegree;
    /// assert_eq!([0.0, 1e-5, 1e-3, 1.0].map(SampledDegree::of), SampledDegree::ALL);
    /// ```
    pub fn of(solid_angle: f64) -> Self {
        let [_, hardly, partly] = SampledDegrees::LIMITS;
        match solid_angle {
            none if none <= 0.0 => Self::Unseen,
            little if little <= hardly => Self::Hardly,
            part if part <= partly => Self::Partly,
            _ => Self::Widely,
        }
    }

    /// Returns the solid angle in steradians that no sampled eye exceeded: infinity for
    /// [`Widely`](Self::Widely).
    pub fn most_shown(self) -> f64 {
        let [unseen, hardly, partly] = SampledDegrees::LIMITS;
        match self {
            Self::Unseen => unseen,
            Self::Hardly => hardly,
            Self::Partly => partly,
            Self::Widely => f64::INFINITY,
        }
    }
}

/// The degrees in which each viewcell of a [`Pvs`] sees each target, estimated from sampled eyes.
///
/// The eyes of a viewcell are drawn evenly and independently. If all of n eyes see an object in at most its
/// degree, then with a confidence of 95 % at most the share 3 / n of the viewcell's volume sees more of it.
/// This holds for one object and one viewcell, as far as the pixels of the sampled pictures tell. An object
/// that shows through a slit narrower than such a pixel may be missed.
#[derive(Clone, PartialEq, Debug)]
pub struct SampledDegrees {
    eyes: u32,
    /// For each degree above [`SampledDegree::Unseen`], the targets of that degree or a greater one: a PVS
    /// with the viewcells and targets of the PVS that the degrees belong to.
    at_least: [Pvs; 3],
}

impl SampledDegrees {
    /// Solid angles in steradians that bound the classes: 2^-14, the greatest pixel of the sampled pictures;
    /// 2^-11, some 50 pixels of a picture of 640x360 at 60 degrees upwards; 2^-8, some 380 such pixels.
    pub const LIMITS: [f64; 3] = [1.0 / 16384.0, 1.0 / 2048.0, 1.0 / 256.0];

    /// Joins the sets of a bake. `at_least` are the sets of targets with the degrees
    /// [`Hardly`](SampledDegree::Hardly), [`Partly`](SampledDegree::Partly) and
    /// [`Widely`](SampledDegree::Widely) or greater ones, for the viewcells and targets of `pvs`. `eyes` is
    /// the number of eyes sampled in each viewcell. The caller promises that each set sees only targets that
    /// the set before (first `pvs`) sees: rows are not compared, which would take a time that the size of a
    /// file does not bound. A target that one of the sets before lacks has the degree before that set.
    /// [`at_least`](Self::at_least) returns the sets as they are, so that a culler with a [least
    /// degree](super::PvsCuller::with_least_degree) keeps such a target too. Takes constant time.
    ///
    /// # Errors
    /// [`PvsError::Degrees`] if `eyes` is 0, or if a set has other numbers of viewcells or targets than
    /// `pvs`.
    pub fn new(pvs: &Pvs, eyes: u32, at_least: [Pvs; 3]) -> Result<Self, PvsError> {
        let fault = |problem| Err(PvsError::Degrees { problem });
        if eyes == 0 {
            return fault("no eyes were sampled");
        }
        let degrees = Self { eyes, at_least };
        if !degrees.fit(pvs) {
            return fault("the numbers of viewcells or targets differ from those of the PVS");
        }
        Ok(degrees)
    }

    /// Returns whether all sets have the numbers of viewcells and targets of `pvs`.
    pub(super) fn fit(&self, pvs: &Pvs) -> bool {
        let counts = |of: &Pvs| (of.viewcell_count(), of.target_count(), of.targets());
        self.at_least.iter().all(|set| counts(set) == counts(pvs))
    }

    /// Returns the number of eyes that were sampled in each viewcell.
    pub fn eyes(&self) -> u32 {
        self.eyes
    }

    /// Returns the targets that a viewcell sees in a degree or a greater one. `None` for
    /// [`Unseen`](SampledDegree::Unseen), which all targets have at least.
    pub fn at_least(&self, degree: SampledDegree) -> Option<&Pvs> {
        self.at_least.get((degree as usize).checked_sub(1)?)
    }

    /// Returns the degree in which a viewcell sees a target: [`Unseen`](SampledDegree::Unseen) if viewcell or
    /// target is unknown. Time is linear in the bytes of the rows.
    pub fn degree(&self, viewcell: ViewcellId, target: u32) -> SampledDegree {
        let count = self.at_least.iter().take_while(|set| set.sees(viewcell, target)).count();
        SampledDegree::ALL[count.min(3)]
    }
}

/// The targets of each degree from some viewcells together: what is asked for object by object.
#[derive(Clone, Debug, Default)]
pub(super) struct DegreesOfViewcells {
    /// For each degree above the least, a bit for each target of that degree or a greater one. Empty if the
    /// degrees are not known.
    at_least: [Vec<u64>; 3],
    /// Scratch: the bits of one viewcell.
    row: Vec<u64>,
    is_known: bool,
}

impl DegreesOfViewcells {
    /// Takes the greatest degree of each of the first `count` targets over `viewcells`.
    pub(super) fn read(&mut self, degrees: &SampledDegrees, viewcells: &[ViewcellId], count: usize) {
        for (words, set) in self.at_least.iter_mut().zip(&degrees.at_least) {
            set.write_first_union(viewcells, count, words, &mut self.row);
        }
        self.is_known = true;
    }

    /// Forgets the degrees.
    pub(super) fn forget(&mut self) {
        self.is_known = false;
    }

    /// Returns the greatest degree of some targets. `None` if the degrees are not known.
    pub(super) fn of(&self, targets: &[u32]) -> Option<SampledDegree> {
        let is_in = |words: &Vec<u64>, &target: &u32| {
            words.get(target as usize / 64).is_some_and(|word| word >> (target % 64) & 1 != 0)
        };
        let count =
            self.at_least.iter().take_while(|words| targets.iter().any(|target| is_in(words, target)));
        self.is_known.then(|| SampledDegree::ALL[count.count().min(3)])
    }
}
