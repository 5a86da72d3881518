//! The seam that all cullers share.

use crate::{CullStats, Scene, View, VisibleSet};

/// What a culler promises of the set it leaves, compared with V, the objects to which an unobstructed segment
/// runs from the eye inside the view. (The words are those of Cohen-Or, Chrysanthou, Silva and Durand, "A
/// Survey of Visibility for Walkthrough Applications", 2003.)
///
/// ```
/// use visibility_core::Accuracy;
/// assert_eq!(Accuracy::Conservative.and(Accuracy::Approximate), Accuracy::Approximate);
/// assert_eq!(Accuracy::Conservative.and(Accuracy::Exact), Accuracy::Exact);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum Accuracy {
    /// V itself, up to a tolerance that the culler states.
    Exact,
    /// All of V, and maybe more: never hides what is visible.
    Conservative,
    /// A part of V: never shows what is hidden.
    Aggressive,
    /// May err both ways.
    Approximate,
}

impl Accuracy {
    /// Whether nothing visible is ever hidden.
    pub const fn never_hides(self) -> bool {
        matches!(self, Self::Exact | Self::Conservative)
    }

    /// Whether nothing hidden is ever shown.
    pub const fn never_shows(self) -> bool {
        matches!(self, Self::Exact | Self::Aggressive)
    }

    /// The accuracy of one culler after another, which keeps what both keep: visible objects survive if
    /// neither hides any, hidden ones are gone if either shows none.
    pub const fn and(self, other: Self) -> Self {
        match (self.never_hides() && other.never_hides(), self.never_shows() || other.never_shows()) {
            (true, true) => Self::Exact,
            (true, false) => Self::Conservative,
            (false, true) => Self::Aggressive,
            (false, false) => Self::Approximate,
        }
    }

    /// The word for it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Conservative => "conservative",
            Self::Aggressive => "aggressive",
            Self::Approximate => "approximate",
        }
    }
}

impl core::fmt::Display for Accuracy {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.pad(self.name())
    }
}

/// Removes from a set of objects what a view cannot see.
///
/// A culler owns the scratch memory and the temporal coherence of one view, so stereo, split screen and
/// shadow cascades are several cullers over one `&Scene`, on as many threads as there are. Cullers are
/// combined and called by a [`Pipeline`](crate::Pipeline), which also fills the set with candidates; whoever
/// calls `cull` alone calls [`VisibleSet::fill`] first.
///
/// ```
/// use visibility_core::{Accuracy, CullStats, Culler, ObjectId, Scene, View, VisibleSet};
/// /// Hides every other object: a culler in its smallest form.
/// struct Odd;
/// impl Culler for Odd {
///     fn name(&self) -> &str { "odd" }
///     fn accuracy(&self) -> Accuracy { Accuracy::Approximate }
///     fn cull(&mut self, scene: &Scene, _: &View, visible: &mut VisibleSet) -> CullStats {
///         visible.retain(scene, |id, _bounds| id.index() % 2 == 1)
///     }
/// }
/// ```
pub trait Culler {
    /// A short name, for tables and explanations.
    fn name(&self) -> &str;

    /// What it promises, with its present settings.
    fn accuracy(&self) -> Accuracy;

    /// Removes from `visible`, which holds the candidates, what it can prove hidden.
    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats;

    /// Forgets what it remembers of earlier frames. Needed for nothing but to start anew: camera cuts are
    /// safe.
    fn reset(&mut self) {}
}
