//! Which pixels count as covered by an occluder.

/// When a pixel counts as covered.
///
/// ```
/// use visibility_core::{Accuracy, OcclusionMap};
/// use visibility_hzb::{Coverage, Hzb};
/// assert_eq!(Hzb::default().accuracy(), Accuracy::Conservative);
/// assert_eq!(Hzb::default().with_coverage(Coverage::Sampled).accuracy(), Accuracy::Approximate);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
pub enum Coverage {
    /// A pixel is covered if all of its square is, up to the corners: conservative at any resolution.
    #[default]
    Conservative,
    /// A pixel is covered if its centre is, as in graphics hardware. Gaps narrower than a pixel may close, so
    /// that visible objects may be hidden: the map is approximate. At low resolutions it hides somewhat more.
    Sampled,
}
