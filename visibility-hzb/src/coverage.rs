//! The two rules of when a pixel is covered.

/// Where coverage is sampled.
///
/// ```
/// use visibility_core::{Accuracy, OcclusionMap};
/// use visibility_hzb::{Coverage, Hzb};
/// assert_eq!(Hzb::default().accuracy(), Accuracy::Conservative);
/// assert_eq!(Hzb::default().with_coverage(Coverage::Sampled).accuracy(), Accuracy::Approximate);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
pub enum Coverage {
    /// A pixel counts as covered if all of it is, up to its corners: conservative at any resolution.
    #[default]
    Conservative,
    /// A pixel counts as covered if its centre is, as in graphics hardware: gaps narrower than a pixel may close, so that visible
    /// objects may be
    /// hidden. Somewhat less is reported visible at low resolutions.
    Sampled,
}
