//! Command-line entries of the object-space cullers: BSP trees, occlusion trees, shadow frusta, large
//! occluders.

use super::known::{Known, no_dial};
use crate::walkthrough::World;
use std::sync::Arc;
use visibility_bsp::{
    BspOrderCuller, LargeOccludersCuller, NaylorCuller, Occluders, OcclusionTreeCuller, SceneTree,
    ShadowFrusta, ShadowFrustaCuller,
};

pub(super) const KNOWN: &[Known] = &[
    Known {
        name: "bsp-order",
        what: "polygons outside the view volume are hidden, by a BSP tree of all triangles; objects in the order of depth; `:N` looks at N nodes of it at most, 65,536 if not set",
        dials: &["65536", "4096"],
        make: |dial, world| {
            let most = number(dial, 1 << 16)? as u64;
            Ok(Box::new(BspOrderCuller::new(tree_of(world)?).with_nodes(most)))
        },
    },
    Known {
        name: "naylor",
        what: "exact: triangles entirely behind others are hidden, by a BSP tree of the picture grown front to back",
        dials: &[],
        make: |dial, world| {
            no_dial(dial)?;
            Ok(Box::new(NaylorCuller::new(tree_of(world)?)))
        },
    },
    Known {
        name: "occlusion-tree",
        what: "boxes behind the largest walls are hidden, by a tree of their shadows; `:N` uses N polygons a frame, 64 if not set",
        dials: &["512", "64", "16"],
        make: |dial, world| {
            let most = number(dial, 64)?;
            Ok(Box::new(OcclusionTreeCuller::new(occluders_of(world)?).with_polygons(most)))
        },
    },
    Known {
        name: "shadow-frusta",
        what: "boxes in the shadow of one wall are hidden, of those chosen in advance for 256 regions; `:N` uses N walls a region, 32 if not set",
        dials: &["64", "32", "8"],
        make: |dial, world| {
            let most = number(dial, 32)?;
            world.check_copies()?;
            let make = || Ok(ShadowFrusta::new(&world.scene, Occluders::new(&world.scene), 256, most));
            let frusta = world.prepared.get(&format!("shadow frusta of {most} occluders"), make)?;
            Ok(Box::new(ShadowFrustaCuller::new(frusta)))
        },
    },
    Known {
        name: "large-occluders",
        what: "boxes in the shadow of one wall or of two that share an edge are hidden, and why is remembered; `:N` uses N walls, 64 if not set",
        dials: &["128", "64", "16"],
        make: |dial, world| {
            let most = number(dial, 64)?;
            Ok(Box::new(LargeOccludersCuller::new(occluders_of(world)?).with_polygons(most)))
        },
    },
];

/// Returns the BSP tree of the world's triangles, built on the first call. Returns a message as the error
/// when the tree cannot be built.
fn tree_of(world: &World) -> Result<Arc<SceneTree>, String> {
    world.check_copies()?;
    let make = || SceneTree::new(&world.scene).map_err(|error| error.to_string());
    world.prepared.get("a BSP tree", make)
}

/// Returns the large polygons among the world's occluders, gathered on the first call. Never returns an
/// error.
fn occluders_of(world: &World) -> Result<Arc<Occluders>, String> {
    world.check_copies()?;
    world.prepared.get("large occluders", || Ok(Occluders::new(&world.scene)))
}

/// Reads the setting (dial) as a whole number of at least one; other text is an error. Without a setting, the
/// number is `unset`.
fn number(dial: Option<&str>, unset: usize) -> Result<usize, String> {
    let Some(dial) = dial else { return Ok(unset) };
    dial.parse().ok().filter(|&n| n > 0).ok_or_else(|| format!("`{dial}` is no number of one or more"))
}
