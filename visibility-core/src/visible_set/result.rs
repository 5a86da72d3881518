//! The finished set as a frame's result: it survives changes of the scene, and its ids are listed when they
//! are first asked for.

use super::{Listing, VisibleSet};
use crate::scene::{FAN_OUT, NONE, lanes};
use crate::{ObjectId, Scene, stamp::Stamp};
use core::fmt;

/// If an index bitset has more than this number of words for each listed object, sorting the list by
/// comparison is faster than passing through the bitset.
const WORDS_PER_ID: usize = 4;

/// Why [`VisibleSet::write_bits`] failed. The slice is unchanged by a failed call.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum BitsError {
    /// The slice is too short.
    Length {
        /// Number of `u32` words that the slice must have at least: one per 32 object indices of the scene.
        needed: usize,
    },
}

impl fmt::Display for BitsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length { needed } => write!(f, "bits of visible objects need {needed} words"),
        }
    }
}

impl core::error::Error for BitsError {}

impl VisibleSet {
    /// Ends a frame: from now on the set survives changes of the scene. An order that the set was given
    /// stays; a set without one is in the order of the hierarchy, with objects that are never culled last.
    /// [`Pipeline::cull`](crate::Pipeline::cull) calls this itself; code that calls cullers without a
    /// pipeline calls it before the scene changes.
    ///
    /// If the set was made [with changes](Self::with_changes), lists its objects and records them for
    /// [`newly_visible`](Self::newly_visible) and [`newly_hidden`](Self::newly_hidden): about a nanosecond
    /// per object of the set. Otherwise takes constant time, and some nanoseconds per block of 64 objects
    /// that are never culled. A set with an order is listed already.
    pub fn finish(&mut self, scene: &Scene) {
        self.end(scene);
        self.repeat(scene);
    }

    /// Returns the stamp of the set's content: the same as long as the set stays
    /// [finished](Self::is_finished), another each time it is finished anew. `NONE` while it is not finished.
    pub(crate) fn result_stamp(&self) -> Stamp {
        if self.is_finished() { self.result } else { Stamp::NONE }
    }

    /// Ends a frame that shows the finished set once more: nothing became visible or hidden.
    pub(crate) fn repeat(&mut self, scene: &Scene) {
        if self.changes.is_some() {
            self.list_result(scene);
        }
        if let Some(changes) = &mut self.changes {
            changes.record(scene, &self.ids);
        }
    }

    /// Makes the set finished, with its present content and order.
    fn end(&mut self, scene: &Scene) {
        self.refresh(scene);
        if self.is_finished() {
            return;
        }
        let tree = scene.tree();
        let is_ordered = matches!(self.listing, Listing::Order);
        if is_ordered {
            let mut ids = core::mem::take(&mut self.ids);
            ids.retain(|&id| self.contains(scene, id));
            self.ids = ids;
        }
        if self.everything {
            if tree.root != NONE {
                self.keep_below(false, scene, tree.root as usize);
            }
            self.use_masks();
        }
        for &leaf in &tree.unculled {
            self.words[leaf as usize] = scene.lanes_on_layers(leaf as usize, self.layers);
        }
        self.unculled_leaves.clone_from(&tree.unculled);
        self.index_limit = scene.index_limit();
        let token = tree.token();
        let survives = token.is_some();
        self.result = Stamp::new();
        self.listing =
            if is_ordered { Listing::Finished } else { Listing::Unlisted { token, root: tree.root } };
        if !survives {
            self.list_result(scene);
        }
    }

    /// Lists the objects of a finished set. Does nothing if the set is listed already, or not finished.
    pub(super) fn list_result(&mut self, scene: &Scene) {
        let mut ids = core::mem::take(&mut self.ids);
        if let Listing::Unlisted { token, root } = &self.listing {
            ids.clear();
            // Enough for any set of this scene, so that later frames allocate nothing.
            ids.reserve(scene.len());
            let mut block = [ObjectId::PLACEHOLDER; FAN_OUT];
            let mut walk = self.leaves_of_result(scene, token.as_ref(), *root);
            loop {
                if walk.mask == u64::MAX {
                    ids.extend_from_slice(walk.ids);
                } else {
                    let mut count = 0;
                    for lane in lanes(walk.mask) {
                        block[count % FAN_OUT] = walk.ids[lane % FAN_OUT];
                        count += 1;
                    }
                    ids.extend_from_slice(&block[..count.min(FAN_OUT)]);
                }
                if !walk.next_leaf() {
                    break;
                }
            }
            drop(walk);
            ids.extend(self.unculled_of_result(scene, token.as_ref()));
            self.listing = Listing::Finished;
        }
        self.ids = ids;
    }

    /// Returns whether the set is finished: the result of a frame, which survives changes of the scene.
    /// [`Pipeline::cull`](crate::Pipeline::cull), [`finish`](Self::finish), [`ids`](Self::ids) and the
    /// methods that sort finish a set. Filling, clearing or culling it again, or adding another set to it,
    /// ends this.
    pub fn is_finished(&self) -> bool {
        matches!(self.listing, Listing::Finished | Listing::Unlisted { .. })
    }

    /// Returns whether the set is [finished](Self::is_finished) and was finished with `scene`. Stays true
    /// when `scene` changes. False for any other scene, and for a clone of that scene.
    pub(super) fn is_result_of(&self, scene: &Scene) -> bool {
        self.is_finished() && self.layout.is_of_same_range(scene.layout())
    }

    /// Finishes the set, and returns its objects that are still in the scene, each once, in the order that
    /// [`iter`](Self::iter) follows. Lists them at the first call, in about a nanosecond per object; later
    /// calls take constant time until the [layout](Scene::layout) of the scene changes.
    pub fn ids(&mut self, scene: &Scene) -> &[ObjectId] {
        self.list(scene);
        &self.ids
    }

    /// Makes the set finished and listed, with its present content and order. Drops objects that were removed
    /// from the scene.
    fn list(&mut self, scene: &Scene) {
        self.end(scene);
        self.list_result(scene);
    }

    /// Returns the visible objects as of the end of the last frame, each once, in the order that
    /// [`iter`](Self::iter) follows. Objects removed from the scene since are still listed. `None` if the set
    /// is not finished or has no list yet. A list is made by [`ids`](Self::ids), by a method that sorts, by a
    /// culler that orders the set, and in a set that records [changes](Self::with_changes).
    ///
    /// This function needs no scene: a render thread can read a listed set while the scene changes.
    ///
    /// ```
    /// use visibility_core::{Aabb, Scene, VisibleSet};
    /// let mut scene = Scene::new();
    /// let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
    /// let mut visible = VisibleSet::new();
    /// visible.finish(&scene); // or Pipeline::cull
    /// assert_eq!(visible.listed(), None);
    /// visible.ids(&scene);
    /// scene.remove(id)?;
    /// assert_eq!(visible.listed(), Some(&[id][..]));
    /// # Ok::<(), visibility_core::scene::SceneError>(())
    /// ```
    pub fn listed(&self) -> Option<&[ObjectId]> {
        matches!(self.listing, Listing::Finished).then_some(&self.ids[..])
    }

    /// Iterates over the objects in the set that are still in the scene: in the set's order if it has one,
    /// otherwise in the order of the hierarchy, with objects that are never culled last. Makes no list.
    pub fn iter<'a>(&'a self, scene: &'a Scene) -> impl Iterator<Item = ObjectId> + 'a {
        let (is_current, is_result) = (self.is_of_layout(scene), self.is_result_of(scene));
        // The iterator chains several sources: the list as it is (`whole`), the list without objects that
        // have left the set or the scene (`part`), the masks of the present nodes (`walk`), and the masks of
        // earlier nodes (`old`). All of these but one are empty.
        let (mut whole, mut part, mut walk, mut unculled): (&[ObjectId], &[ObjectId], _, _) =
            (&[], &[], None, None);
        let (mut old, mut own_unculled) = (None, None);
        match &self.listing {
            Listing::Unlisted { .. } if is_current => {
                walk = Some(self.leaves(scene));
                own_unculled = Some(self.unculled_of_result(scene, None));
            }
            Listing::Unlisted { token, root } if is_result => {
                let token = token.as_ref();
                let unculled = self.unculled_of_result(scene, token);
                old = Some(self.leaves_of_result(scene, token, *root).chain(unculled));
            }
            Listing::Finished if is_current => whole = &self.ids,
            Listing::Finished if is_result => part = &self.ids,
            Listing::Order if is_current => part = &self.ids,
            _ => {
                walk = Some(self.leaves(scene));
                unculled = Some(self.unculled(scene));
            }
        }
        let stays =
            move |id: &ObjectId| if is_result { scene.contains(*id) } else { self.contains(scene, *id) };
        let part = part.iter().copied().chain(old.into_iter().flatten()).filter(stays);
        let unculled = unculled.into_iter().flatten().chain(own_unculled.into_iter().flatten());
        Listed { whole: whole.iter(), rest: part.chain(walk.into_iter().flatten()).chain(unculled) }
    }

    /// Returns the number of objects in the set that are still in the scene. Takes constant time for a
    /// listed set until the [layout](Scene::layout) of the scene changes, and then a few nanoseconds per
    /// object of the set. Without a list, takes time in proportion to the number of blocks of 64 objects that
    /// the set reaches, and, once the layout has changed, to the size of the set.
    pub fn count(&self, scene: &Scene) -> usize {
        let (is_current, is_result) = (self.is_of_layout(scene), self.is_result_of(scene));
        if is_result && !is_current {
            return self.iter(scene).count();
        }
        if let Some(ids) = self.listed().filter(|_| is_result) {
            return ids.len();
        }
        let mut walk = self.leaves(scene);
        let mut count = walk.mask.count_ones() as usize;
        while walk.next_leaf() {
            count += walk.mask.count_ones() as usize;
        }
        if is_result {
            return count + self.unculled_of_result(scene, None).count();
        }
        count + self.unculled_count(scene) as usize
    }

    /// Returns whether an object is in the set. False for an id that the scene does not know. Takes time in
    /// proportion to the height of the hierarchy; for a finished set, once the [layout](Scene::layout) of the
    /// scene has changed, in proportion to the size of the set. Many objects are better looked up in
    /// [bits](Self::write_bits).
    #[inline]
    pub fn contains(&self, scene: &Scene, id: ObjectId) -> bool {
        let Some((leaf, lane)) = scene.leaf_of(id) else { return false };
        if self.is_result_of(scene) && !self.is_of_layout(scene) {
            return match self.listed() {
                Some(ids) => ids.contains(&id),
                None => self.iter(scene).any(|other| other == id),
            };
        }
        self.holds(scene, leaf, lane)
    }

    /// Writes the set as bits for a GPU: bit `i % 32` of word `i / 32` is 1 if the object with
    /// [index](ObjectId::index) `i` is in the set and still in the scene. All other bits of the slice become
    /// zero. Takes a nanosecond per object of the set, and the time to clear the slice. Makes no list.
    ///
    /// ```
    /// use visibility_core::{Aabb, Scene, VisibleSet};
    /// let mut scene = Scene::new();
    /// scene.insert_batch((0..40).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 0.5; 3])));
    /// let mut visible = VisibleSet::new();
    /// visible.retain(&scene, |id, _| id.index() >= 31);
    /// let mut bits = [0; 2];
    /// visible.write_bits(&scene, &mut bits)?;
    /// assert_eq!(bits, [1 << 31, 0xff]);
    /// # Ok::<(), visibility_core::visible_set::BitsError>(())
    /// ```
    ///
    /// # Errors
    /// [`BitsError::Length`] if the slice has fewer than `limit / 32` words, rounded up, where `limit` is the
    /// scene's [`index_limit`](Scene::index_limit) or, for a [finished](Self::is_finished) set, what that was
    /// when the set was finished. The slice is then unchanged.
    pub fn write_bits(&self, scene: &Scene, bits: &mut [u32]) -> Result<(), BitsError> {
        let limit = if self.is_result_of(scene) { self.index_limit } else { scene.index_limit() };
        let needed = limit.div_ceil(32);
        if bits.len() < needed {
            return Err(BitsError::Length { needed });
        }
        bits.fill(0);
        self.iter(scene).for_each(|id| bits[id.index() / 32] |= 1 << (id.index() % 32));
        Ok(())
    }

    /// Finishes the set, and sorts its objects by ascending key, objects with equal keys by index.
    /// Objects removed since culling are dropped first. Allocates nothing once the set's memory has grown to
    /// the size of the scene.
    pub fn sort_by_key<K: Ord>(&mut self, scene: &Scene, mut key: impl FnMut(ObjectId) -> K) {
        self.list(scene);
        // Equal keys are ordered by id, so that the result is deterministic.
        self.ids.sort_unstable_by_key(|&id| (key(id), id));
    }

    /// Finishes the set, and sorts its objects by ascending [index](ObjectId::index): the order in which
    /// arrays indexed by object are read and written fastest. Objects removed since culling are dropped
    /// first. Takes a few nanoseconds per object. Allocates nothing once the set's memory has grown to the
    /// size of the scene.
    ///
    /// ```
    /// use visibility_core::{Aabb, Scene, VisibleSet};
    /// let mut scene = Scene::new();
    /// let ids = scene.insert_batch((0..3).map(|i| Aabb::from_arrays([-i as f32; 3], [1.0; 3])));
    /// let mut visible = VisibleSet::new();
    /// visible.sort_by_index(&scene);
    /// assert_eq!(visible.ids(&scene), ids);
    /// ```
    pub fn sort_by_index(&mut self, scene: &Scene) {
        self.list(scene);
        if self.ids.len() < scene.index_limit().div_ceil(64) / WORDS_PER_ID {
            self.ids.sort_unstable();
            return;
        }
        self.marked.reset(scene.index_limit());
        for id in &self.ids {
            self.marked.insert(id.index());
        }
        self.ids.clear();
        for (&word, first) in self.marked.words().iter().zip((0..).step_by(64)) {
            self.ids.extend(lanes(word).filter_map(|bit| scene.id_at(first + bit)));
        }
    }
}

/// Iterates over the ids of `whole`, and then over those of `rest`. Faster than `Iterator::chain` where
/// `rest` is itself a chain of several iterators: the `fold` of `chain` then calls its closure for each
/// object.
struct Listed<'a, R> {
    whole: core::slice::Iter<'a, ObjectId>,
    rest: R,
}

impl<R: Iterator<Item = ObjectId>> Iterator for Listed<'_, R> {
    type Item = ObjectId;

    #[inline]
    fn next(&mut self) -> Option<ObjectId> {
        match self.whole.next() {
            Some(&id) => Some(id),
            None => self.rest.next(),
        }
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let (least, most) = self.rest.size_hint();
        (least + self.whole.len(), most.and_then(|most| most.checked_add(self.whole.len())))
    }

    #[inline]
    fn fold<B, F: FnMut(B, ObjectId) -> B>(self, start: B, mut f: F) -> B {
        let mut result = start;
        for &id in self.whole {
            result = f(result, id);
        }
        self.rest.fold(result, f)
    }
}
