//! The finished set as a frame's result: a list of ids that survives changes of the scene.

use super::{Listing, VisibleSet};
use crate::scene::{NONE, lanes};
use crate::{ObjectId, Scene};
use core::fmt;

/// Number of words of an index bitset per listed object above which sorting the list by comparison is faster
/// than passing through a bitset.
const WORDS_PER_ID: usize = 4;

/// Why [`VisibleSet::write_bits`] failed. The slice is unchanged by a failed call.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum BitsError {
    /// The set is not [finished](VisibleSet::is_finished), so it has no list of ids.
    Unfinished,
    /// The slice is too short.
    TooShort {
        /// Number of `u32` words that the slice must have at least: one per 32 object indices of the scene.
        needed: usize,
    },
}

impl fmt::Display for BitsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unfinished => write!(f, "the set of visible objects is not finished"),
            Self::TooShort { needed } => write!(f, "bits of visible objects need {needed} words"),
        }
    }
}

impl core::error::Error for BitsError {}

impl VisibleSet {
    /// Ends a frame: lists the objects of the set, in the set's order if it has one and otherwise in the
    /// order of the hierarchy with objects that are never culled last. If the set was made [with
    /// changes](Self::with_changes), records them for [`newly_visible`](Self::newly_visible) and
    /// [`newly_hidden`](Self::newly_hidden). [`Pipeline::cull`](crate::Pipeline::cull) calls this itself;
    /// code that calls cullers without a pipeline calls it before the scene changes.
    ///
    /// Takes about a nanosecond per object of the set.
    pub fn finish(&mut self, scene: &Scene) {
        self.list(scene);
        if let Some(changes) = &mut self.changes {
            changes.record(scene, &self.ids);
        }
    }

    /// Makes the set finished, with its present content and order.
    fn list(&mut self, scene: &Scene) {
        self.refresh(scene);
        if self.listing == Listing::Finished {
            return;
        }
        let tree = scene.tree();
        let mut ids = core::mem::take(&mut self.ids);
        if self.listing == Listing::Order {
            ids.retain(|&id| self.contains(scene, id));
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
        if self.listing == Listing::Masks {
            ids.clear();
            // Enough for any set of this scene, so that later frames allocate nothing.
            ids.reserve(scene.len());
            let mut block = [ObjectId::PLACEHOLDER; 64];
            let mut push = |leaf: usize, mask: u64| {
                let leaf = &tree.ids[leaf];
                if mask == u64::MAX {
                    return ids.extend_from_slice(leaf);
                }
                let mut count = 0;
                for lane in lanes(mask) {
                    block[count % 64] = leaf[lane % 64];
                    count += 1;
                }
                ids.extend_from_slice(&block[..count.min(64)]);
            };
            let mut walk = self.leaves(scene);
            if tree.root != NONE && walk.mask != 0 {
                push(walk.leaf, walk.mask);
            }
            while walk.next_leaf() {
                push(walk.leaf, walk.mask);
            }
            for &leaf in &tree.unculled {
                push(leaf as usize, self.words[leaf as usize]);
            }
        }
        self.ids = ids;
        self.index_limit = scene.index_limit();
        self.listing = Listing::Finished;
    }

    /// Returns whether the set holds the list of a frame's result: true after
    /// [`Pipeline::cull`](crate::Pipeline::cull), [`finish`](Self::finish) and the methods that sort, until
    /// the set is filled, cleared, united or culled again.
    pub fn is_finished(&self) -> bool {
        self.listing == Listing::Finished
    }

    /// Returns whether the set is finished for `scene`, whatever has changed there since. Clones are other
    /// scenes.
    pub(super) fn is_result_of(&self, scene: &Scene) -> bool {
        self.is_finished() && self.layout.is_of_same_range(scene.layout())
    }

    /// Returns the visible objects as of the end of the last frame, each once, in the order that
    /// [`iter`](Self::iter) follows. Objects removed from the scene since are still listed. Empty if the set
    /// is not [finished](Self::is_finished), whatever it holds.
    ///
    /// Needs no scene: a render thread can read the set while the scene changes.
    pub fn ids(&self) -> &[ObjectId] {
        if self.is_finished() { &self.ids } else { &[] }
    }

    /// Iterates over the objects in the set that are still in the scene: in the set's order if it has one,
    /// otherwise in the order of the hierarchy, with objects that are never culled last.
    pub fn iter<'a>(&'a self, scene: &'a Scene) -> impl Iterator<Item = ObjectId> + 'a {
        let (is_current, is_result) = (self.is_of_layout(scene), self.is_result_of(scene));
        // Three sources, of which one is not empty: the list as it is, the list without what has left the set
        // or the scene, and the masks.
        let (mut whole, mut part, mut walk, mut unculled): (&[ObjectId], &[ObjectId], _, _) =
            (&[], &[], None, None);
        if is_result && is_current {
            whole = &self.ids;
        } else if is_result || is_current && self.listing == Listing::Order {
            part = &self.ids;
        } else {
            walk = Some(self.leaves(scene));
            unculled = Some(self.unculled(scene));
        }
        let stays =
            move |id: &ObjectId| if is_result { scene.contains(*id) } else { self.contains(scene, *id) };
        let part = part.iter().copied().filter(stays);
        let masks = walk.into_iter().flatten().chain(unculled.into_iter().flatten());
        Listed { whole: whole.iter(), rest: part.chain(masks) }
    }

    /// Returns the number of objects in the set that are still in the scene. Takes constant time for a
    /// finished set until the [layout](Scene::layout) of the scene changes, and then a few nanoseconds per
    /// object of the set. For an unfinished set, takes time in proportion to the number of blocks of 64
    /// objects that the set reaches.
    pub fn count(&self, scene: &Scene) -> usize {
        if self.is_result_of(scene) {
            return match self.is_of_layout(scene) {
                true => self.ids.len(),
                false => self.ids.iter().filter(|&&id| scene.contains(id)).count(),
            };
        }
        let mut walk = self.leaves(scene);
        let mut count = walk.mask.count_ones() as usize;
        while walk.next_leaf() {
            count += walk.mask.count_ones() as usize;
        }
        count + self.unculled_count(scene) as usize
    }

    /// Returns whether an object is in the set. False for an id that the scene does not know. Takes time in
    /// proportion to the height of the hierarchy; for a finished set, once the [layout](Scene::layout) of the
    /// scene has changed, in proportion to the size of the set, so that many objects are better looked up in
    /// [bits](Self::write_bits).
    #[inline]
    pub fn contains(&self, scene: &Scene, id: ObjectId) -> bool {
        let Some((leaf, lane)) = scene.leaf_of(id) else { return false };
        if self.is_result_of(scene) && !self.is_of_layout(scene) {
            return self.ids.contains(&id);
        }
        self.holds(scene, leaf, lane)
    }

    /// Writes the set as bits for a GPU: bit `i % 32` of word `i / 32` is 1 if the object with
    /// [index](ObjectId::index) `i` is visible. All other bits of the slice become 0. Takes a nanosecond per
    /// object of the set, and the time to fill the slice with 0. An object inserted after culling has the bit
    /// of a removed one whose index it reuses.
    ///
    /// ```
    /// use visibility_core::{Aabb, Scene, VisibleSet};
    /// let mut scene = Scene::new();
    /// scene.insert_batch((0..40).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 0.5; 3])));
    /// let mut visible = VisibleSet::new();
    /// visible.retain(&scene, |id, _| id.index() >= 31);
    /// visible.finish(&scene);
    /// let mut bits = [0; 2];
    /// visible.write_bits(&mut bits)?;
    /// assert_eq!(bits, [1 << 31, 0xff]);
    /// # Ok::<(), visibility_core::visible_set::BitsError>(())
    /// ```
    ///
    /// # Errors
    /// [`BitsError::Unfinished`] if the set is not [finished](Self::is_finished), and
    /// [`BitsError::TooShort`] if the slice has less than one word per 32 object indices that the scene had
    /// [in use](Scene::index_limit) at the end of the frame, rounded up.
    pub fn write_bits(&self, bits: &mut [u32]) -> Result<(), BitsError> {
        if !self.is_finished() {
            return Err(BitsError::Unfinished);
        }
        let needed = self.index_limit.div_ceil(32);
        if bits.len() < needed {
            return Err(BitsError::TooShort { needed });
        }
        bits.fill(0);
        for id in &self.ids {
            bits[id.index() / 32] |= 1 << (id.index() % 32);
        }
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
    /// assert_eq!(visible.ids(), ids);
    /// ```
    pub fn sort_by_index(&mut self, scene: &Scene) {
        self.list(scene);
        let words = scene.index_limit().div_ceil(64);
        if self.ids.len() < words / WORDS_PER_ID {
            self.ids.sort_unstable();
            return;
        }
        self.scratch_masks.clear();
        self.scratch_masks.resize(words, 0);
        for id in &self.ids {
            self.scratch_masks[id.index() / 64] |= 1 << (id.index() % 64);
        }
        self.ids.clear();
        for (&word, first) in self.scratch_masks.iter().zip((0..).step_by(64)) {
            self.ids.extend(lanes(word).filter_map(|bit| scene.id_at(first + bit)));
        }
    }
}

/// Iterates over a list, and then over the rest. Faster than `Iterator::chain`, whose `fold` calls its
/// closure for each object where the rest is a long chain itself.
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
