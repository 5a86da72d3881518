//! Object space: BSP trees, occlusion trees, shadow frusta, large occluders.

use super::{Known, World, no_dial};
use std::sync::Arc;
use visibility_bsp::{BspOrder, Naylor, Occluders, OcclusionTreeCuller, SceneTree};

pub(super) const KNOWN: &[Known] = &[
    Known {
        name: "bsp-order",
        what: "polygons outside the view volume are hidden, by a BSP tree of all triangles; objects in the order of depth",
        dials: &[],
        make: |dial, world| {
            no_dial(dial)?;
            Ok(Box::new(BspOrder::new(tree_of(world)?)))
        },
    },
    Known {
        name: "naylor",
        what: "exact: triangles entirely behind others are hidden, by a BSP tree of the picture grown front to back",
        dials: &[],
        make: |dial, world| {
            no_dial(dial)?;
            Ok(Box::new(Naylor::new(tree_of(world)?)))
        },
    },
    Known {
        name: "occlusion-tree",
        what: "boxes behind the largest walls are hidden, by a tree of their shadows; `:N` uses N polygons a frame, 64 if not set",
        dials: &["512", "64", "16"],
        make: |dial, world| {
            let most = number(dial, 64)?;
            let occluders = Arc::new(Occluders::new(&world.scene));
            Ok(Box::new(OcclusionTreeCuller::new(occluders).with_polygons(most)))
        },
    },
];

fn tree_of(world: &World) -> Result<SceneTree, String> {
    SceneTree::new(&world.scene).map_err(|error| error.to_string())
}

/// The dial as a whole number of at least one.
fn number(dial: Option<&str>, unset: usize) -> Result<usize, String> {
    let Some(dial) = dial else { return Ok(unset) };
    dial.parse().ok().filter(|&n| n > 0).ok_or_else(|| format!("`{dial}` is no number of polygons"))
}
