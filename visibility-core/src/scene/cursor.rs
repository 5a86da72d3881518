//! The place of a reader in a scene's changes.

use super::{Changes, Scene};
use crate::serial::is_same_range;

/// How far a reader of a scene's changes has come: the scene, and the revision up to which its changes are
/// taken in.
///
/// Every structure that derives state from a [`Scene`] keeps one cursor. A scene that differs from the one
/// read before, a clone of it included, and a scene that no longer lists the changes since then, report
/// [`Changes::Everything`].
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
    /// Before the first change of any scene.
    pub const START: Self = Self { revision: u64::MAX };

    /// The present state of a scene.
    pub fn at(scene: &Scene) -> Self {
        Self { revision: scene.revision() }
    }

    /// The changes since the cursor, which stays where it is.
    pub fn peek(self, scene: &Scene) -> Changes<'_> {
        scene.changes_since(self.revision)
    }

    /// The changes since the cursor, which moves to the present state of the scene.
    pub fn follow<'a>(&mut self, scene: &'a Scene) -> Changes<'a> {
        let changes = self.peek(scene);
        *self = Self::at(scene);
        changes
    }

    /// Whether nothing of the scene has changed since the cursor. False for another scene.
    pub fn is_current(self, scene: &Scene) -> bool {
        self == Self::at(scene)
    }

    /// Whether the cursor is in this scene, however much has changed there since. False for a clone of the
    /// scene.
    pub fn is_in(self, scene: &Scene) -> bool {
        is_same_range(self.revision, scene.revision())
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
        assert!(cursor.is_current(&a) && !cursor.is_current(&b));
        assert!(cursor.is_in(&a) && !cursor.is_in(&b) && !SceneCursor::START.is_in(&a));
        assert_eq!(cursor.peek(&a), Changes::Objects(&[]));
        assert_eq!(cursor.peek(&b), Changes::Everything);
        assert_eq!(SceneCursor::START.peek(&Scene::new()), Changes::Everything);
        // More changes than the scene lists.
        a.set_origin(glam::DVec3::ONE).unwrap();
        assert_eq!(cursor.peek(&a), Changes::Everything);
        assert!(cursor.is_in(&a));
    }
}
