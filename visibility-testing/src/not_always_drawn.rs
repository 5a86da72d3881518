//! Objects that are not drawn in some frames.

use visibility_core::scene::DrawRange;
use visibility_core::{Object, ObjectId, Scene};

/// Functions that make an object not always drawn: by a draw range, as an HLOD parent, and as the child of
/// one. The last two insert another object with the same bounds that does not occlude.
pub const NOT_ALWAYS_DRAWN: [fn(&mut Scene, ObjectId); 3] = [
    |scene, id| scene.set_draw_range(id, DrawRange { begin: 100.0, ..DrawRange::ALWAYS }).unwrap(),
    |scene, id| {
        let other = insert_around(scene, id);
        scene.set_hlod_parent(other, Some(id)).unwrap();
    },
    |scene, id| {
        let other = insert_around(scene, id);
        scene.set_hlod_parent(id, Some(other)).unwrap();
    },
];

fn insert_around(scene: &mut Scene, id: ObjectId) -> ObjectId {
    let bounds = scene.bounds(id).unwrap();
    scene.insert(Object::new(bounds))
}
