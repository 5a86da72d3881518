//! Command-line entries of the horizon culler, whose setting (dial) is the number of columns.

use super::known::Known;
use crate::walkthrough::World;
use std::sync::Arc;
use visibility_2d::horizon::{HorizonCuller, HorizonOccluders, UpAxis};
use visibility_core::ObjectId;

pub(super) const KNOWN: &[Known] = &[
    Known {
        name: "horizon",
        what: "what is behind upright solids, lower than they reach in each direction of the plan, is hidden; \
               `:N` looks in N directions for each quarter turn, 360 if not set",
        dials: &["1024", "360", "128"],
        make: |dial, world| {
            let columns = columns(dial)?;
            Ok(Box::new(HorizonCuller::new(occluders_of(world)?).with_columns(columns)))
        },
    },
    Known {
        name: "leaves",
        what: "as horizon, and what is behind so many trees in each direction is hidden, though it may show \
               through leaves: leaves:10 if not set; for scenes with objects named tree",
        dials: &["16", "10", "6", "4", "3", "2"],
        make: |dial, world| {
            let refused = |dial: &str| format!("its dial is a number of trees from 1 to 255, not `{dial}`");
            let crossings = dial.map_or(Ok(10), |dial| {
                dial.parse().ok().filter(|&count: &u8| count > 0).ok_or_else(|| refused(dial))
            })?;
            let is_tree =
                |id: &ObjectId| world.source.objects[id.index()].name.to_string().starts_with("tree");
            let trees: Vec<ObjectId> = world.scene.ids().filter(is_tree).collect();
            if trees.is_empty() {
                return Err("this scene has no objects named tree".to_owned());
            }
            Ok(Box::new(HorizonCuller::new(occluders_of(world)?).with_crowns(trees, crossings)))
        },
    },
];

/// Reads the setting (dial) as a number of columns of a face, from 1 to 16,384; other text is an error.
/// Without a setting, the number is 360.
fn columns(dial: Option<&str>) -> Result<usize, String> {
    let Some(dial) = dial else { return Ok(360) };
    let number = dial.parse().ok().filter(|n| (1..=16_384).contains(n));
    number.ok_or_else(|| format!("`{dial}` is no number of directions from 1 to 16384"))
}

/// Returns the axis that points up in the world. An oblique axis is an error.
fn up_of(world: &World) -> Result<UpAxis, String> {
    let up = world.source.up.to_array();
    match up {
        [0.0, y, 0.0] if y > 0.0 => Ok(UpAxis::Y),
        [0.0, 0.0, z] if z > 0.0 => Ok(UpAxis::Z),
        _ => Err("neither the y nor the z axis of the scene points up".to_owned()),
    }
}

/// Returns the upright solids of the world's occluders, made on the first call.
fn occluders_of(world: &World) -> Result<Arc<HorizonOccluders>, String> {
    let up = up_of(world)?;
    world.check_copies()?;
    let make = || Ok(HorizonOccluders::new(&world.scene, up));
    world.prepared.get("upright solids", make)
}
