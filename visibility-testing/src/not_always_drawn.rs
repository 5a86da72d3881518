//! Objects that are not drawn in some frames.

use visibility_core::scene::DrawRange;
use visibility_core::{Object, ObjectId, Scene};

/// Functions that make an object not always drawn where its bounds are: by a draw range, as an HLOD parent,
/// as the child of one, and as never culled, so that it may be elsewhere. The second and the third insert
/// another object with the same bounds that does not occlude.
pub const NOT_ALWAYS_DRAWN: [fn(&mut Scene, ObjectId); 4] = [
    |scene, id| scene.set_draw_range(id, DrawRange { begin: 100.0, ..DrawRange::ALWAYS }).unwrap(),
    |scene, id| {
        let other = insert_around(scene, id);
        scene.set_hlod_parent(other, Some(id)).unwrap();
    },
    |scene, id| {
        let other = insert_around(scene, id);
        scene.set_hlod_parent(id, Some(other)).unwrap();
    },
    |scene, id| scene.set_never_cull(id, true).unwrap(),
];

fn insert_around(scene: &mut Scene, id: ObjectId) -> ObjectId {
    let bounds = scene.bounds(id).unwrap();
    scene.insert(Object::new(bounds))
}
