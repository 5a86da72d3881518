//! Command-line entry of the potentially visible sets of cells, which are baked when they are first asked
//! for.

use super::known::{Known, Made};
use crate::eprintln;
use crate::pvs::built::Origin;
use crate::region::read_sets;
use crate::walkthrough::World;
use crate::walkthrough::cell_sets::{Detail, sets_of};
use std::path::Path;
use std::sync::Arc;
use visibility_core::View;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{PvsCuller, SampledDegree, ScenePvs};
use visibility_core::view::Eye;

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
    Known {
        name: "baked-hardly",
        what: "as `baked:FILE`, and what no eye sampled by `bake --degrees` saw is hidden: approximate",
        dials: &[],
        make: |dial, world| by_degree(dial, world, SampledDegree::Hardly),
    },
    Known {
        name: "baked-partly",
        what: "as `baked:FILE`, and what shows to sampled eyes in less than about 50 pixels of a picture of 640x360 \
           is hidden: approximate",
        dials: &[],
        make: |dial, world| by_degree(dial, world, SampledDegree::Partly),
    },
];

fn baked(file: &str, world: &World) -> Made {
    Ok(Box::new(of_file(file, world)?))
}

/// Makes the culler of a file that hides objects of less than a degree of visibility.
fn by_degree(file: Option<&str>, world: &World, least: SampledDegree) -> Made {
    let file = file.ok_or("it needs a file, as in `baked-partly:FILE`")?;
    let mut culler = of_file(file, world)?;
    if culler.shared_mut().degrees().is_none() {
        return Err(format!("{file} has no degrees of visibility: bake with --degrees"));
    }
    Ok(Box::new(culler.with_least_degree(least)))
}

/// Reads the visible sets of a file for the scene of a world. If cameras are outside all viewcells, prints
/// their number on standard error once.
fn of_file(file: &str, world: &World) -> Result<PvsCuller<Arc<ScenePvs>>, String> {
    let sets = world.prepared.get(&format!("sets of the file {file}"), || {
        let sets = read_sets(Path::new(file), world)?;
        let is_outside = |view: &&View| match view.eye(DVec3::ZERO) {
            Eye::Point(eye) => sets.viewcells().locate(eye).is_none(),
            Eye::Direction(_) => true,
        };
        let (outside, all) = (world.views.iter().filter(is_outside).count(), world.views.len());
        if outside > 0 {
            eprintln!(
                "{file}: {outside} of {all} cameras are outside all viewcells, and see everything there: \
                 bake with the same --cameras, or with --cells, --over or --from where the cameras are"
            );
        }
        Ok(sets)
    })?;
    Ok(PvsCuller::new(sets))
}

fn make(dial: Option<&str>, world: &World) -> Made {
    let (origin, detail) = match dial {
        None | Some("objects") => (Origin::Given, Detail::Objects),
        Some("cells") => (Origin::Given, Detail::Cells),
        Some("walls") => (Origin::Walls, Detail::Objects),
        Some("bsp") => (Origin::Polygons, Detail::Objects),
        Some(other) => {
            let dials = "its dial is `objects`, `cells`, `walls` or `bsp`";
            return Err(format!("{dials}, not `{other}`; for the file of a bake, write `baked:{other}`"));
        }
    };
    Ok(Box::new(PvsCuller::new(sets_of(world, origin, detail)?)))
}
