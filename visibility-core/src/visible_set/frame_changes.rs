//! Objects that became visible and objects that became hidden between two frames.

use crate::{ObjectId, Scene, scene::SceneCursor};
use alloc::vec::Vec;

/// Visible objects of the last two frames. Kept as ids, which stay valid when the layout of the scene
/// changes.
#[derive(Clone, Debug)]
pub(super) struct Changes {
    now: Vec<ObjectId>,
    before: Vec<ObjectId>,
    /// Position in the changes of the scene whose objects `now` lists; [`SceneCursor::START`] before the
    /// first frame.
    scene: SceneCursor,
    /// Whether the last two frames showed different scenes. If true, all objects count as changed.
    is_other: bool,
    /// Indexed by object index: the position of the object in `now`. Meaningful only if `now` holds an
    /// object with that index at that position.
    now_places: Vec<u32>,
    before_places: Vec<u32>,
}

impl Changes {
    pub(super) const NONE: Self = Self {
        now: Vec::new(),
        before: Vec::new(),
        scene: SceneCursor::START,
        is_other: false,
        now_places: Vec::new(),
        before_places: Vec::new(),
    };

    /// Returns `ids`, or an empty list if the last two frames showed different scenes, whose ids must not be
    /// compared.
    fn same_scene<'a>(&self, ids: &'a [ObjectId]) -> &'a [ObjectId] {
        if self.is_other { &[] } else { ids }
    }

    /// Iterates over the objects that are visible in the last frame and were not in the frame before it. If
    /// the two frames showed different scenes, these are all objects of the last frame.
    pub(super) fn newly_visible(&self) -> impl Iterator<Item = ObjectId> + '_ {
        difference(&self.now, self.same_scene(&self.before), &self.before_places)
    }

    /// Iterates over the objects that were visible in the frame before the last and are not in the last
    /// frame. If the two frames showed different scenes, these are all objects of the frame before the last.
    pub(super) fn newly_hidden(&self) -> impl Iterator<Item = ObjectId> + '_ {
        difference(&self.before, self.same_scene(&self.now), &self.now_places)
    }

    /// Ends a frame in which the objects `ids` of `scene` were visible.
    pub(super) fn record(&mut self, scene: &Scene, ids: &[ObjectId]) {
        self.is_other = !self.scene.is_in(scene);
        self.scene = SceneCursor::at(scene);
        core::mem::swap(&mut self.now, &mut self.before);
        core::mem::swap(&mut self.now_places, &mut self.before_places);
        self.now.clear();
        self.now.reserve(scene.len());
        self.now.extend_from_slice(ids);
        self.now_places.resize(scene.index_limit(), 0);
        for (place, id) in (0..).zip(ids) {
            self.now_places[id.index()] = place;
        }
    }
}

/// Iterates over the ids of `of` that are not in `others`. `places`, indexed by object index, gives the
/// position in `others` at which an object would be (a sparse set: Briggs and Torczon, "An Efficient
/// Representation for Sparse Sets", 1993). Ids are compared with their generations, since an index may have
/// been reused.
fn difference<'a>(
    of: &'a [ObjectId],
    others: &'a [ObjectId],
    places: &'a [u32],
) -> impl Iterator<Item = ObjectId> + 'a {
    of.iter().copied().filter(move |id| {
        let other = places.get(id.index()).and_then(|&place| others.get(place as usize));
        other != Some(id)
    })
}
