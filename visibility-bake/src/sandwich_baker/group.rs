//! What the viewcells of a group share while they are worked on, and the scratch memory of a thread.

use crate::bake_cache::{CellRecord, GroupRecord};
use crate::tiled_scene::PreparedScene;
use crate::time_plan::STAGES;
use std::sync::Arc;
use visibility_region::ExtendedProjectionCuller;

/// Scratch memory of one thread of a bake.
#[derive(Default, Debug)]
pub struct BakeScratch {
    /// Culler prepared for the whole level. `None` before the thread's first sweep of a group with all tiles
    /// at once.
    pub(super) whole: Option<ExtendedProjectionCuller>,
    /// Culler for the sweep of a group from near to far, over the tiles around it.
    pub(super) sweep: ExtendedProjectionCuller,
    /// Number of the group whose viewcells the thread swept last, and a culler prepared for its scene. `None`
    /// before the first such sweep, and once other content is made.
    pub(super) local: Option<(u32, ExtendedProjectionCuller)>,
}

/// State of a group while some of its viewcells are worked on.
#[derive(Default)]
pub(super) struct Slot {
    /// Indexed by stage: number of the group's viewcells that are not done with the stage yet.
    pub(super) left: [usize; STAGES],
    /// Content of the group that was made last. `None` before it is made and once it is released. The flag is
    /// true if it is for the sweeps of viewcells, false if it is for another stage. With a limit of time, or
    /// in a resumed bake, viewcells of the group may be in different stages.
    pub(super) group: Option<(bool, Arc<Group>)>,
    /// Result of the group's sweep. `None` until the group is swept, or an earlier result is taken over. It
    /// is kept when the content is released.
    pub(super) record: Option<Arc<GroupRecord>>,
}

/// Data that the viewcells of a group share.
pub(super) struct Group {
    pub(super) record: Arc<GroupRecord>,
    /// Numbers of the objects left after the sweep of the group, tile by tile.
    pub(super) objects: Vec<u32>,
    pub(super) content: Content,
}

/// What a group holds for the stage that its viewcells are in.
pub(super) enum Content {
    /// Records of the group's viewcells from the cache.
    Cached(Vec<CellRecord>),
    /// Scene for the sweeps of the viewcells: the objects that the group's sweep has left, with occluder
    /// meshes, and a prepared sweep.
    Scene(Arc<PreparedScene>),
    /// No scene, for later stages: each viewcell loads the objects that its own sweep has left.
    Objects,
}
