//! Entry of the potentially visible sets of cells, which are baked when they are first asked for.

use super::known::{Known, Made};
use crate::pvs::built::Origin;
use crate::region::read_sets;
use crate::walkthrough::World;
use crate::walkthrough::cell_sets::{Detail, sets_of};
use std::path::Path;
use std::sync::Arc;
use visibility_core::pvs::PvsCuller;

pub(super) const KNOWN: &[Known] = &[
    Known {
        name: "pvs",
        what: "what no line through portals from the eye's cell reaches is hidden; `pvs:cells` goes by whole cells instead of objects, \
           `pvs:walls` and `pvs:bsp` make the cells from the scene's boxes or triangles",
        dials: &["objects", "cells"],
        make,
    },
    Known {
        name: "region-pvs",
        what: "what the file of `region-pvs:FILE`, written by the program `region`, does not list for the eye's viewcell is hidden; \
           eyes outside of its viewcells see everything",
        dials: &[],
        make: |dial, world| baked(dial.ok_or("it needs a file, as in `region-pvs:FILE`")?, world),
    },
    Known {
        name: "baked",
        what: "what the file of `baked:FILE`, written by the program `bake`, does not list for the eye's viewcell is hidden; \
           eyes outside of its viewcells see everything",
        dials: &[],
        make: |dial, world| baked(dial.ok_or("it needs a file, as in `baked:FILE`")?, world),
    },
];

/// Reads the sets of a file for the scene of a world.
fn baked(file: &str, world: &World) -> Made {
    Ok(Box::new(PvsCuller::new(Arc::new(read_sets(Path::new(file), world)?))))
}

fn make(dial: Option<&str>, world: &World) -> Made {
    let (origin, detail) = match dial {
        None | Some("objects") => (Origin::Given, Detail::Objects),
        Some("cells") => (Origin::Given, Detail::Cells),
        Some("walls") => (Origin::Walls, Detail::Objects),
        Some("bsp") => (Origin::Polygons, Detail::Objects),
        Some(other) => {
            return Err(format!("its dial is `objects`, `cells`, `walls` or `bsp`, not `{other}`"));
        }
    };
    Ok(Box::new(PvsCuller::new(sets_of(world, origin, detail)?)))
}
