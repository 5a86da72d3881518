//! The log of changes, by which whoever derives state from a scene keeps it up to date in time proportional
//! to what changed (after the design of VISAPI, whose visibility modules keep the scene and are told of
//! changes).

use crate::ObjectId;
use crate::serial::next_range;
use alloc::vec::Vec;

/// What changed in a scene since some revision.
///
/// ```
/// use visibility_core::{scene::Changes, Aabb, Scene};
/// let mut scene = Scene::new();
/// let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
/// let seen = scene.revision();
/// scene.set_bounds(id, Aabb::from_arrays([1.0; 3], [2.0; 3]))?;
/// assert_eq!(scene.changes_since(seen), Changes::Objects(&[id]));
/// # Ok::<(), visibility_core::scene::SceneError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Changes<'a> {
    /// These objects were inserted, removed or changed, oldest change first; an object may be listed more
    /// than once. One that is no longer in the scene was removed.
    Objects(&'a [ObjectId]),
    /// More than the log holds, or the revision is of another scene: look at every object.
    Everything,
}

/// A bounded list of changed objects. A revision counts the changes before it.
#[derive(Debug)]
pub(crate) struct ChangeLog {
    /// The revision before the first entry.
    start: u64,
    entries: Vec<ObjectId>,
}

impl ChangeLog {
    /// An empty log, whose revisions are no other scene's.
    pub(crate) fn new() -> Self {
        Self { start: next_range(), entries: Vec::new() }
    }

    /// Fewer entries than this are always kept.
    const LEAST: usize = 1024;

    pub(crate) fn revision(&self) -> u64 {
        self.start + self.entries.len() as u64
    }

    /// Whether so many changes at once are too many to list.
    pub(crate) fn is_too_much(changes: usize, objects: usize) -> bool {
        changes > Self::limit(objects)
    }

    fn limit(objects: usize) -> usize {
        Self::LEAST.max(objects / 4)
    }

    /// Records a change. Past a quarter as many entries as there are objects, looking at every object costs
    /// little more than following the log, so the older half is dropped: amortised constant time, no
    /// growth.
    pub(crate) fn push(&mut self, id: ObjectId, objects: usize) {
        let limit = Self::limit(objects);
        if self.entries.len() >= limit {
            let dropped = self.entries.len() - limit / 2;
            self.entries.drain(..dropped);
            self.start += dropped as u64;
        }
        if self.entries.len() == self.entries.capacity() {
            // All at once, or a scene in which little moves would allocate now and then for thousands of
            // frames.
            self.entries.reserve_exact(limit - self.entries.len());
        }
        self.entries.push(id);
    }

    pub(crate) fn memory(&self) -> usize {
        size_of_val(&self.entries[..])
    }

    /// Records that everything may have changed.
    pub(crate) fn invalidate(&mut self) {
        self.start = self.revision() + 1;
        self.entries.clear();
    }

    pub(crate) fn since(&self, revision: u64) -> Changes<'_> {
        match revision.checked_sub(self.start).and_then(|n| self.entries.get(usize::try_from(n).ok()?..)) {
            Some(entries) => Changes::Objects(entries),
            None => Changes::Everything,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_changes_are_forgotten_as_everything() {
        let mut log = ChangeLog::new();
        let start = log.revision();
        for i in 0..5000 {
            log.push(ObjectId { index: i, generation: 0 }, 10);
        }
        assert!(log.entries.capacity() <= 2048);
        assert_eq!(log.revision(), start + 5000);
        assert_eq!(log.since(start), Changes::Everything);
        assert_eq!(log.since(start + 5001), Changes::Everything);
        assert_eq!(log.since(start + 5000), Changes::Objects(&[]));
        assert_eq!(log.since(start + 4999), Changes::Objects(&[ObjectId { index: 4999, generation: 0 }]));
        log.invalidate();
        assert_eq!(log.since(start + 5000), Changes::Everything);
        assert_eq!(log.since(log.revision()), Changes::Objects(&[]));
        assert_eq!(ChangeLog::new().since(start), Changes::Everything, "a revision of another log");
    }
}
