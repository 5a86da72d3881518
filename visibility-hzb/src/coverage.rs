//! The rule of which pixels an occluder covers.

/// Rule of which pixels an occluder covers. A covered pixel hides objects behind the occluder.
///
/// ```
/// use visibility_core::{Accuracy, OcclusionMap};
/// use visibility_hzb::{Coverage, Hzb};
/// assert_eq!(Hzb::default().accuracy(), Accuracy::Conservative);
/// assert_eq!(Hzb::default().with_coverage(Coverage::Sampled).accuracy(), Accuracy::Approximate);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
pub enum Coverage {
    /// A pixel is covered only if the occluder covers its whole square, corners included. The map is
    /// conservative at any resolution.
    #[default]
    Conservative,
    /// A pixel is covered if the occluder covers its centre, as in graphics hardware. Gaps narrower than a
    /// pixel may close and hide visible objects, so the map is approximate. It culls somewhat more at low
    /// resolutions.
    Sampled,
}
