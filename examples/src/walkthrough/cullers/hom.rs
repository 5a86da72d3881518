//! Command-line entries of the hierarchical occlusion maps, whose setting is the opacity threshold.

use super::known::{Known, Made};
use crate::walkthrough::World;
use visibility_hzb::{DepthEstimate, Hom, HomCuller};

pub(super) const KNOWN: &[Known] = &[
    Known {
        name: "hom",
        what: "boxes behind the scene's own opaque triangles are hidden, by occlusion maps of 512x288 pixels; \
               hom:0.9 counts 8x8 pixels as opaque if 90% of them are covered",
        dials: &["1", "0.95", "0.9", "0.8", "0.7"],
        make: |dial, world| made(dial, world, DepthEstimate::NoBackground),
    },
    Known {
        name: "hom-buffer",
        what: "as hom, with a depth-estimation buffer",
        dials: &[],
        make: |dial, world| made(dial, world, DepthEstimate::Buffer),
    },
    Known {
        name: "hom-plane",
        what: "as hom, with one plane behind all occluders",
        dials: &[],
        make: |dial, world| made(dial, world, DepthEstimate::Plane),
    },
];

/// Makes a culler with an occlusion map of 512 x 288 pixels. The setting (dial) is an opacity threshold from
/// 0 to 1, and other text is an error; without a setting, the threshold is 1.
fn made(dial: Option<&str>, world: &World, estimate: DepthEstimate) -> Made {
    let refused = |dial: &str| format!("its dial is an opacity threshold from 0 to 1, not `{dial}`");
    let threshold = match dial {
        None => 1.0,
        Some(dial) => dial
            .parse()
            .ok()
            .filter(|threshold| (0.0..=1.0f32).contains(threshold))
            .ok_or_else(|| refused(dial))?,
    };
    let map = Hom::new(512, 288).map_err(|error| error.to_string())?.with_simd(world.simd);
    Ok(Box::new(HomCuller::new(map.with_threshold(threshold).with_depth_estimate(estimate))))
}
