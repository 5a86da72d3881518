//! Command-line entry of the culler of small objects, whose setting is a size in pixels.

use super::known::Known;
use visibility_frame::lod::ContributionCuller;

pub(super) const KNOWN: &[Known] = &[Known {
    name: "contribution",
    what: "objects smaller than so many pixels of the picture's rows are hidden, though they may show: \
           contribution:2px, 1px without a dial",
    dials: &["1px", "2px", "4px", "8px"],
    make: |dial, world| {
        let refused = |dial: &str| format!("its dial is a size in pixels such as `2px`, not `{dial}`");
        let pixels = dial.map_or(Ok(1.0), |dial| {
            let number = dial.strip_suffix("px").and_then(|number| number.parse().ok());
            number.filter(|number: &f64| *number > 0.0 && number.is_finite()).ok_or_else(|| refused(dial))
        })?;
        Ok(Box::new(ContributionCuller::new(world.size.1.into(), pixels).with_simd(world.simd)))
    },
}];
