//! A reader's position in the change log of a scene.

use super::{Changes, Scene};
use crate::serial::is_same_range;

/// The position of a reader in the changes of scenes: which scene was read last, and up to which revision.
///
/// Every structure that derives state from a [`Scene`] keeps one cursor. The cursor reports
/// [`Changes::Everything`] for a scene other than the one read before, a clone included, and when the scene's
/// log no longer reaches back to the cursor.
///
/// ```
/// use visibility_core::{scene::{Changes, SceneCursor}, Aabb, Scene};
/// let mut scene = Scene::new();
/// let mut cursor = SceneCursor::START;
/// assert_eq!(cursor.follow(&scene), Changes::Everything);
/// let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
/// assert_eq!(cursor.follow(&scene), Changes::Objects(&[id]));
/// assert!(cursor.is_current(&scene));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SceneCursor {
    revision: u64,
}

impl SceneCursor {
    /// The cursor of a reader that has not read any scene: the next read reports [`Changes::Everything`].
    pub const START: Self = Self { revision: u64::MAX };

    /// Returns a cursor at the present state of `scene`: all changes so far count as read.
    pub fn at(scene: &Scene) -> Self {
        Self { revision: scene.revision() }
    }

    /// Returns the changes of `scene` since the cursor, without moving the cursor.
    pub fn peek(self, scene: &Scene) -> Changes<'_> {
        scene.changes_since(self.revision)
    }

    /// Returns the changes of `scene` since the cursor and moves the cursor to the scene's present state.
    pub fn follow<'a>(&mut self, scene: &'a Scene) -> Changes<'a> {
        let changes = self.peek(scene);
        *self = Self::at(scene);
        changes
    }

    /// Returns whether nothing of the scene has changed since the cursor. False for a scene other than the
    /// one read last.
    pub fn is_current(self, scene: &Scene) -> bool {
        self == Self::at(scene)
    }

    /// Returns whether `scene` is the scene that the cursor read last, however much has changed there since.
    /// False for a clone of that scene, and for [`START`](Self::START).
    pub fn is_in(self, scene: &Scene) -> bool {
        is_same_range(self.revision, scene.revision())
    }

    /// Returns whether scene coordinates that were read at the cursor are still the same points of the world:
    /// `scene` is the scene that the cursor read last, and its origin was not set since, not even to the same
    /// point.
    pub fn is_at_origin_of(self, scene: &Scene) -> bool {
        scene.log.is_origin_of(self.revision)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;

    #[test]
    fn a_cursor_of_one_scene_sees_everything_in_another() {
        let mut a = Scene::new();
        a.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
        let b = a.clone();
        let cursor = SceneCursor::at(&a);
        assert!(
            cursor.is_current(&a) && !cursor.is_current(&b),
            "a cursor is current in the scene that it was taken of, not in a clone"
        );
        assert!(
            cursor.is_in(&a) && !cursor.is_in(&b) && !SceneCursor::START.is_in(&a),
            "a cursor is in its scene alone, and the start is in none"
        );
        assert_eq!(cursor.peek(&a), Changes::Objects(&[]), "nothing has changed in the cursor's scene");
        assert_eq!(cursor.peek(&b), Changes::Everything, "all is new in another scene");
        assert_eq!(
            SceneCursor::START.peek(&Scene::new()),
            Changes::Everything,
            "all is new to the start, even in an empty scene"
        );
        // After a change of the origin, the scene's log covers no earlier revision.
        a.set_origin(glam::DVec3::ONE).unwrap();
        assert_eq!(cursor.peek(&a), Changes::Everything, "another origin changes all objects");
        assert!(cursor.is_in(&a), "the cursor stays in its scene when the origin moves");
    }

    #[test]
    fn a_cursor_knows_whether_the_origin_was_set() {
        let mut a = Scene::new();
        assert!(!SceneCursor::START.is_at_origin_of(&a), "the start is at no origin");
        let cursor = SceneCursor::at(&a);
        let id = a.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
        (0..5000).for_each(|_| a.set_cost(id, 1).unwrap());
        assert_eq!(cursor.peek(&a), Changes::Everything, "the log does not reach back");
        assert!(
            cursor.is_at_origin_of(&a) && !cursor.is_at_origin_of(&a.clone()),
            "changes of objects leave the origin, and a clone is another scene"
        );
        a.set_origin(glam::DVec3::ONE).unwrap();
        a.set_origin(glam::DVec3::ZERO).unwrap();
        assert!(
            !cursor.is_at_origin_of(&a) && SceneCursor::at(&a).is_at_origin_of(&a),
            "an origin that came back was set all the same"
        );
    }
}
