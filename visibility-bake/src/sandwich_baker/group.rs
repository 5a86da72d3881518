//! Data that the viewcells of a group share while they are worked on, and scratch memory of a thread.

use crate::bake_cache::{CellRecord, GroupRecord};
use crate::tiled_scene::PreparedScene;
use crate::time_plan::STAGES;
use std::sync::Arc;
use visibility_region::ExtendedProjectionCuller;

/// Scratch memory of one thread of a bake.
#[derive(Default, Debug)]
pub struct BakeScratch {
    /// Culler prepared for the whole level. `None` until the thread sweeps a group with all tiles at once.
    pub(super) whole: Option<ExtendedProjectionCuller>,
    /// Culler for sweeps of groups from near to far, over the tiles around a group.
    pub(super) sweep: ExtendedProjectionCuller,
    /// Number of the group whose viewcells the thread swept last, and a culler prepared for the group's
    /// scene. `None` before the first such sweep. Also `None` after the thread has made the content of a
    /// group, to free the memory of the culler before.
    pub(super) local: Option<(u32, ExtendedProjectionCuller)>,
}

/// State of a group while some of its viewcells are worked on.
#[derive(Default)]
pub(super) struct Slot {
    /// For each stage, the number of the group's viewcells that are not done with the stage.
    pub(super) left: [usize; STAGES],
    /// The content of the group that was made last. `None` before it is made, and after it is released. The
    /// flag says for which stage it was made: true for the sweeps of viewcells, false for any other stage.
    /// Viewcells of one group may need both kinds in turn, with a limit of time or in a resumed bake.
    pub(super) group: Option<(bool, Arc<Group>)>,
    /// Result of the group's sweep. `None` until the group is swept or an earlier result is reused. It is
    /// kept when the content is released.
    pub(super) record: Option<Arc<GroupRecord>>,
}

/// Data that the viewcells of a group share.
pub(super) struct Group {
    pub(super) record: Arc<GroupRecord>,
    /// Numbers of the objects that the sweep of the group has left, tile by tile.
    pub(super) objects: Vec<u32>,
    pub(super) content: Content,
}

/// Data that a group holds for the present stage of its viewcells.
pub(super) enum Content {
    /// Records of the group's viewcells from the cache.
    Cached(Vec<CellRecord>),
    /// Scene for the sweeps of the viewcells: the objects that the group's sweep has left, with occluder
    /// meshes, and a sweep prepared for it.
    Scene(Arc<PreparedScene>),
    /// No scene. In later stages each viewcell loads the objects that its own sweep has left.
    Objects,
}
