//! The changes of a scene's objects that its triangles have followed.

use alloc::collections::VecDeque;
use alloc::{boxed::Box, vec::Vec};
use visibility_core::glam::DVec3;
use visibility_core::stamp::Stamp;

/// Change of one object.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Change {
    /// Position of the object in the list of objects.
    pub(crate) place: u32,
    /// Box around the triangles by which the object occluded before, in scene coordinates. The least corner
    /// is above the greatest if there were none.
    pub(crate) was: [DVec3; 2],
}

/// Changes of the objects, oldest first, as far as they are known.
#[derive(Clone, Debug)]
pub(super) struct Log {
    /// Stamp of the present state.
    pub(super) stamp: Stamp,
    /// For each call of [`sync`](crate::SceneTriangles::sync) that changed something: the stamp of the state
    /// before, and the changes.
    pub(super) entries: VecDeque<(Stamp, Box<[Change]>)>,
    /// Number of changes in all entries.
    count: usize,
    /// Number of calls of [`SceneTriangles::sync`](crate::SceneTriangles::sync) that changed something.
    pub(super) serial: u64,
}

impl Default for Log {
    fn default() -> Self {
        Self { stamp: Stamp::new(), entries: VecDeque::new(), count: 0, serial: 0 }
    }
}

impl Log {
    /// Least number of changes that are kept. With more, a query from the start takes hardly longer.
    const KEPT: usize = 1024;

    /// Adds the changes of one call. `objects` is the number of objects.
    pub(super) fn push(&mut self, changes: Vec<Change>, objects: usize) {
        self.count += changes.len();
        self.entries.push_back((self.stamp, changes.into()));
        self.stamp = Stamp::new();
        while self.count > Self::KEPT.max(objects / 4)
            && let Some((_, dropped)) = self.entries.pop_front()
        {
            self.count -= dropped.len();
        }
    }
}
