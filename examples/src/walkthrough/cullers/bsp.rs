//! Object space: BSP trees, occlusion trees, shadow frusta, large occluders.

use super::Known;
use std::sync::Arc;
use visibility_bsp::{Occluders, OcclusionTreeCuller};

pub(super) const KNOWN: &[Known] = &[Known {
    name: "occlusion-tree",
    what: "boxes behind the largest walls are hidden, by a tree of their shadows; `:N` uses N polygons a frame, 64 if not set",
    dials: &["512", "64", "16"],
    make: |dial, world| {
        let most = number(dial, 64)?;
        let occluders = Arc::new(Occluders::new(&world.scene));
        Ok(Box::new(OcclusionTreeCuller::new(occluders).with_polygons(most)))
    },
}];

/// The dial as a whole number of at least one.
fn number(dial: Option<&str>, unset: usize) -> Result<usize, String> {
    let Some(dial) = dial else { return Ok(unset) };
    dial.parse().ok().filter(|&n| n > 0).ok_or_else(|| format!("`{dial}` is no number of polygons"))
}
