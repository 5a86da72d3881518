//! What only the whole library has: cells, portals and mirrors, baked and online sets, plans, regions and
//! proofs, who sees whom, queries, casters, occluders of levels, the horizon and the judge. This module is
//! the only one behind the feature `whole`.

mod cells;
mod errors;
mod horizon;
mod level;
mod measure;
mod online;
mod plan;
mod pvs;
mod queries;
mod reflections;
mod region;
mod stages;
mod volume;
mod who_sees;

pub use cells::*;
pub use level::*;
pub use measure::*;
pub use online::*;
pub use plan::*;
pub use pvs::*;
pub use queries::*;
pub use reflections::*;
pub use region::*;
pub use stages::*;
pub use volume::*;
pub use who_sees::*;

/// As in the crate's root: any thread may use any handle.
const _: () = {
    const fn any_thread<T: Send + Sync>() {}
    any_thread::<vis_cells>();
    any_thread::<vis_graph>();
    any_thread::<vis_level>();
    any_thread::<vis_measure>();
    any_thread::<vis_online>();
    any_thread::<vis_plan>();
    any_thread::<vis_pvs>();
    any_thread::<vis_reflections>();
    any_thread::<vis_scene_pvs>();
    any_thread::<vis_sight_cells>();
    any_thread::<vis_who_sees>();
};
