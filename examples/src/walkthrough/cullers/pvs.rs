//! Potentially visible sets of cells, baked when they are first asked for.

use super::{Known, Made};
use crate::walkthrough::World;
use crate::walkthrough::cell_sets::Detail;
use visibility_core::PvsCuller;

pub(super) const KNOWN: &[Known] = &[Known {
    name: "pvs",
    what: "what no line through portals from the eye's cell reaches is hidden; `pvs:cells` goes by whole cells instead of objects",
    dials: &["objects", "cells"],
    make,
}];

fn make(dial: Option<&str>, world: &World) -> Made {
    let detail = match dial {
        None | Some("objects") => Detail::Objects,
        Some("cells") => Detail::Cells,
        Some(other) => return Err(format!("its dial is `objects` or `cells`, not `{other}`")),
    };
    Ok(Box::new(PvsCuller::new(world.sets.of(world, detail)?)))
}
