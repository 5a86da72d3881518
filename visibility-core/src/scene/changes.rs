//! The log of changes of a scene. Structures that derive state from a scene read the log, and update their
//! state in time proportional to the number of changes. The design follows VISAPI, whose visibility modules
//! keep the scene and are notified of changes.

use crate::ObjectId;
use crate::serial::{is_same_range, next_range};
use alloc::vec::Vec;

/// The objects of a scene that changed since a given revision.
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
    /// The objects that were inserted, removed or changed, oldest change first; empty if nothing changed. An
    /// object may be listed several times. A listed object that the scene no longer contains was removed.
    Objects(&'a [ObjectId]),
    /// The changes are unknown, so every object must be treated as changed: there were more changes than the
    /// log holds, the origin moved, or the revision is of another scene.
    Everything,
}

/// A bounded list of changed objects. A revision is a starting number, unique to the scene, plus the number
/// of changes before it.
#[derive(Debug)]
pub(crate) struct ChangeLog {
    /// The revision before the change that `entries[0]` records; without entries, the present revision.
    start: u64,
    entries: Vec<ObjectId>,
    /// The revision right after the origin last moved; the first revision of the scene if the origin never
    /// moved.
    moved: u64,
}

impl ChangeLog {
    /// Creates an empty log whose revisions differ from those of every other scene.
    pub(crate) fn new() -> Self {
        let start = next_range();
        Self { start, entries: Vec::new(), moved: start }
    }

    /// Least number of changes that the log holds at any time, however few objects the scene has.
    const MIN_CAPACITY: usize = 1024;

    pub(crate) fn revision(&self) -> u64 {
        self.start + self.entries.len() as u64
    }

    /// Returns whether `changes` changes at once exceed the log's capacity for a scene with `objects`
    /// objects, so that the log should be [invalidated](Self::invalidate) instead.
    pub(crate) fn is_too_much(changes: usize, objects: usize) -> bool {
        changes > Self::limit(objects)
    }

    fn limit(objects: usize) -> usize {
        Self::MIN_CAPACITY.max(objects / 4)
    }

    /// Records a change of one object. `objects` is the number of object indices of the scene. The log holds
    /// the last [`MIN_CAPACITY`](Self::MIN_CAPACITY) changes or, if that is more, a quarter of `objects`:
    /// following a longer log would cost a reader about as much as processing all objects. It drops older
    /// changes when it holds twice as many. Takes amortised constant time.
    pub(crate) fn push(&mut self, id: ObjectId, objects: usize) {
        let limit = Self::limit(objects);
        if self.entries.len() >= 2 * limit {
            let dropped = self.entries.len() - limit + 1;
            self.entries.drain(..dropped);
            self.start += dropped as u64;
        }
        if self.entries.len() == self.entries.capacity() {
            // Reserves the full capacity at once. Growing step by step, a scene in which little moves would
            // allocate now and then for thousands of frames.
            self.entries.reserve_exact(2 * limit - self.entries.len());
        }
        self.entries.push(id);
    }

    pub(crate) fn memory(&self) -> usize {
        size_of_val(&self.entries[..])
    }

    /// Records that everything may have changed: all earlier revisions now give [`Changes::Everything`].
    pub(crate) fn invalidate(&mut self) {
        self.start = self.revision() + 1;
        self.entries.clear();
    }

    /// Records that the origin moved, so that equal numbers in scene coordinates now stand for other points
    /// of the world.
    pub(crate) fn move_origin(&mut self) {
        self.invalidate();
        self.moved = self.start;
    }

    /// Returns whether `revision` is of this scene and the origin has not moved since.
    pub(crate) fn is_origin_of(&self, revision: u64) -> bool {
        is_same_range(self.start, revision) && revision >= self.moved
    }

    /// Returns the objects changed since `revision`, or [`Changes::Everything`] if the log does not reach
    /// back to that revision or the revision is of another scene.
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
            let kept = (i + 1).min(1024);
            let changes = log.since(log.revision() - u64::from(kept));
            let count = if let Changes::Objects(ids) = changes { ids.len() } else { 0 };
            assert_eq!(count, kept as usize, "of {} changes, the last 1,024 are kept", i + 1);
        }
        assert!(
            log.entries.capacity() <= 2048,
            "the log has room for {} changes, however many were made",
            log.entries.capacity()
        );
        assert_eq!(log.revision(), start + 5000, "each change makes a revision");
        assert_eq!(log.since(start), Changes::Everything, "the first changes are forgotten");
        assert_eq!(log.since(start + 5001), Changes::Everything, "a revision of the future");
        assert_eq!(
            log.since(start + 5000),
            Changes::Objects(&[]),
            "nothing has changed since the last revision"
        );
        assert_eq!(
            log.since(start + 4999),
            Changes::Objects(&[ObjectId { index: 4999, generation: 0 }]),
            "the last change is kept"
        );
        log.invalidate();
        assert_eq!(log.since(start + 5000), Changes::Everything, "invalidating forgets all changes");
        assert_eq!(
            log.since(log.revision()),
            Changes::Objects(&[]),
            "nothing has changed since the invalidation"
        );
        assert_eq!(ChangeLog::new().since(start), Changes::Everything, "a revision of another log");
    }
}
