//! The set of visible objects that a frame's cullers reduce: it starts with all candidates and ends with the
//! objects to draw.

mod frame_changes;
mod leaf_walk;
mod result;
mod split_scratch;

pub use result::BitsError;
pub(crate) use split_scratch::{NewMasks, Part, SplitScratch};

use crate::binary_format::Fingerprint;
use crate::bits::Bits;
use crate::scene::{NONE, Token, Tree, lanes};
use crate::{Aabb, CullStats, ObjectId, Scene, View, stamp::Stamp};
use alloc::vec::Vec;
use frame_changes::Changes;
use leaf_walk::{LeafWalk, lanes_on_layers};

/// The objects of a scene that a view may see.
///
/// The set holds a mask for each node of the scene's hierarchy, so that cullers work on 64 objects at once
/// and never touch hidden subtrees. The [list](Self::ids) of its objects is made when it is first asked for;
/// [`iter`](Self::iter), [`write_bits`](Self::write_bits) and a `DrawList` need no list.
///
/// [`Pipeline::cull`](crate::Pipeline::cull) leaves a *finished* set, which survives every change of the
/// scene, listed or not. Objects that are removed after culling are left out; objects that are inserted after
/// culling are not in the set, and are drawn from the next frame on. Once listed, the set can be read without
/// the scene ([`listed`](Self::listed)), so that a render thread can hold it, or a clone of it, while the
/// scene changes.
///
/// The masks belong to the [layout](Scene::layout) of the scene at the time of culling. As long as a finished
/// set has no list, the scene keeps a copy of each node that it changes, 8 bytes per object of the node,
/// until the set is listed, filled again or dropped. A set that was not finished, because its cullers were
/// called without a pipeline, counts as holding every object on its layers once the layout has changed. For a
/// scene other than the one it was culled for, a clone included, any set counts as holding every object on
/// its layers.
///
/// Objects that are never culled are always in the set if they are on the view's layers. Layers are no more
/// than 32 bits per object and view, because every frame reads them for all objects in each block of 64 that
/// it reaches. For finer groups, write a [`Culler`](crate::Culler) that [retains](Self::retain) the objects
/// of the groups shown.
///
/// ```
/// use visibility_core::{Aabb, Pipeline, Scene, VisibleSet};
/// # use visibility_core::{glam::DVec3, FrustumCuller, Pose, View};
/// # let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// # let view = View::perspective(pose, 1.0, 1.0, 0.1, 100.0)?;
/// let mut scene = Scene::new();
/// let id = scene.insert(Aabb::from_arrays([5.0, 0.0, 0.0], [6.0, 1.0, 1.0]));
/// let mut visible = VisibleSet::new().with_changes(); // also tells what appeared and vanished
/// let mut pipeline = Pipeline::new().with(FrustumCuller::new());
/// pipeline.cull(&scene, &view, &mut visible);
/// assert!(visible.contains(&scene, id));
/// assert_eq!(visible.newly_visible().collect::<Vec<_>>(), [id]);
/// // The result stays the same when the scene changes.
/// scene.insert(Aabb::from_arrays([7.0, 0.0, 0.0], [8.0, 1.0, 1.0]));
/// assert_eq!(visible.ids(&scene), [id]);
/// // While the scene changes, another thread can read a listed result.
/// std::thread::scope(|scope| {
///     scope.spawn(|| visible.listed().into_iter().flatten().for_each(|id| println!("draw object {id}")));
///     scene.insert(Aabb::from_arrays([8.0, 0.0, 0.0], [9.0, 1.0, 1.0]));
/// });
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct VisibleSet {
    /// Masks indexed by node: bit i tells whether lane i is in the set (leaves) or has something in the set
    /// below it (inner nodes). Masks of nodes whose bit in the parent is 0 are stale and must not be read.
    words: Vec<u64>,
    /// Layout of the scene (assignment of objects to lanes) that `words` belongs to.
    layout: Stamp,
    /// If true, the set holds every object on `layers` and `words` is ignored.
    everything: bool,
    layers: u32,
    /// Layers that all views of the set draw: those of `layers` that all sets of a union have.
    common_layers: u32,
    /// List of the set's objects; `listing` tells whether it is made and what it holds.
    ids: Vec<ObjectId>,
    listing: Listing,
    /// Number of object indices of the scene when the set was finished.
    index_limit: usize,
    /// Numbers of the leaves outside the tree, which hold the objects that are never culled, as they were
    /// when the set was finished. Meaningful while the set is finished and not listed.
    unculled_leaves: Vec<u32>,
    /// Scratch memory for walks: one mask per node.
    scratch_masks: Vec<u64>,
    /// Scratch memory: indices of objects that are to be dropped, or that are listed already.
    marked: Bits,
    /// Scratch memory of walks on several threads.
    pub(crate) split_scratch: SplitScratch,
    changes: Option<Changes>,
    /// Stamp of the content that the set was last finished with.
    result: Stamp,
}

/// State of a set's list of ids relative to its masks.
#[derive(Clone, Debug)]
enum Listing {
    /// The list is not made: the masks alone define the set.
    Masks,
    /// The list has the order that `iter` follows. It contains every object of the set, and maybe objects
    /// that are no longer in the set.
    Order,
    /// The set is finished, and its list is not made. The masks, including those of the leaves outside the
    /// tree, hold the set for the layout that it was finished at, when the tree had the root `root`. With
    /// `token`, nodes are read as they were then. `token` is `None` only on processors without atomic counts,
    /// where finishing a set lists it at once.
    Unlisted { token: Option<Token>, root: u32 },
    /// The set is finished, and its list is the set, each object once. Until the layout changes, the masks
    /// hold the same objects, including the masks of the leaves outside the tree.
    Finished,
}

impl Default for VisibleSet {
    fn default() -> Self {
        Self::new()
    }
}

impl VisibleSet {
    /// Creates a set that counts as holding every object on all layers until it is [filled](Self::fill),
    /// cleared or culled.
    pub const fn new() -> Self {
        Self {
            words: Vec::new(),
            layout: Stamp::NONE,
            everything: true,
            layers: u32::MAX,
            common_layers: u32::MAX,
            ids: Vec::new(),
            listing: Listing::Masks,
            index_limit: 0,
            unculled_leaves: Vec::new(),
            scratch_masks: Vec::new(),
            marked: Bits::EMPTY,
            split_scratch: SplitScratch::EMPTY,
            changes: None,
            result: Stamp::NONE,
        }
    }

    /// Returns the set with recording turned on: from now on it tells which objects became
    /// [visible](Self::newly_visible) and [hidden](Self::newly_hidden) since the frame before. This costs a
    /// few nanoseconds per visible object and frame.
    #[must_use]
    pub fn with_changes(self) -> Self {
        Self { changes: Some(Changes::NONE), ..self }
    }

    /// Replaces the content of the set with every object on the view's layers and drops the order. Takes
    /// constant time once the set's memory has grown. [`Pipeline::cull`](crate::Pipeline::cull) calls this
    /// itself.
    pub fn fill(&mut self, scene: &Scene, view: &View) {
        self.layers = view.layers();
        self.common_layers = view.layers();
        self.everything = true;
        self.listing = Listing::Masks;
        self.layout = scene.layout();
        self.words.resize(scene.tree().node_count(), 0);
    }

    /// Removes every object from the set, including objects that are never culled: the initial value for a
    /// [`union`](Self::union) of several sets. Takes constant time once the set's memory has grown.
    pub fn clear(&mut self, scene: &Scene) {
        self.layers = 0;
        self.common_layers = u32::MAX;
        self.everything = false;
        self.listing = Listing::Masks;
        self.layout = scene.layout();
        self.words.resize(scene.tree().node_count(), 0);
        if scene.tree().root != NONE {
            self.words[scene.tree().root as usize] = 0;
        }
    }

    /// Adds the objects of `other`, a set of the same scene. The union of the sets of two eyes, from any
    /// pipelines, is the set to draw both eyes from: it contains everything that either eye sees.
    ///
    /// Finished sets may be older than the scene's present layout. An unfinished set of an earlier layout
    /// counts as holding every object on its layers, and the union then holds these too. The union has no
    /// order and is not finished: [`finish`](Self::finish), called by the caller before the scene changes,
    /// lists it and records changes. Takes a few nanoseconds per block of 64 objects in the sets, and per
    /// object of a finished set of an earlier layout.
    ///
    /// ```
    /// use visibility_core::{
    ///     glam::DVec3, Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet,
    /// };
    /// let mut scene = Scene::new();
    /// scene.insert(Aabb::from_arrays([5.0, 0.0, 0.0], [6.0, 1.0, 1.0]));
    /// let pose = |y: f64| Pose::look_at(DVec3::new(0.0, y, 0.0), DVec3::new(9.0, y, 0.0), DVec3::Z);
    /// let eyes = [View::perspective(pose(0.03), 1.0, 1.0, 0.1, 100.0)?,
    ///     View::perspective(pose(-0.03), 1.0, 1.0, 0.1, 100.0)?];
    /// // One pipeline and one set per eye, kept from frame to frame, and one set for both eyes.
    /// let mut pipelines = [(); 2].map(|_| Pipeline::new().with(FrustumCuller::new()));
    /// let mut sets = [(); 2].map(|_| VisibleSet::new());
    /// let mut both = VisibleSet::new().with_changes();
    /// // Each frame:
    /// both.clear(&scene);
    /// for ((pipeline, eye), set) in pipelines.iter_mut().zip(&eyes).zip(&mut sets) {
    ///     pipeline.cull(&scene, eye, set);
    ///     both.union(&scene, set);
    /// }
    /// both.finish(&scene);
    /// assert_eq!(both.newly_visible().count(), 1);
    /// # Ok::<(), visibility_core::view::ViewError>(())
    /// ```
    pub fn union(&mut self, scene: &Scene, other: &Self) {
        self.refresh(scene);
        if other.is_result_of(scene) && !other.is_of_layout(scene) {
            let mut masks = core::mem::take(&mut self.scratch_masks);
            write_masks(&mut masks, scene, other.iter(scene));
            self.add(scene, &|node| masks[node]);
            self.scratch_masks = masks;
        } else if !(self.everything && other.everything) {
            self.add(scene, &|node| other.mask(scene, node));
        }
        self.layers |= other.layers;
        self.common_layers &= other.common_layers;
        self.listing = Listing::Masks;
    }

    /// Adds the objects of another set, which `other` gives as a mask for each node. The masks of this set
    /// must be of the scene's present layout.
    fn add(&mut self, scene: &Scene, other: &impl Fn(usize) -> u64) {
        if scene.tree().root != NONE {
            self.union_below(scene, other, scene.tree().root as usize, true, true);
        }
        self.use_masks();
    }

    /// Unites the masks of `node` and all nodes below it with those of `other`. `ours` and `theirs` tell
    /// whether the node's bit is set in its parent's mask in this set and in `other`: where false, that set's
    /// masks below are stale and count as empty.
    fn union_below(
        &mut self,
        scene: &Scene,
        other: &impl Fn(usize) -> u64,
        node: usize,
        ours: bool,
        theirs: bool,
    ) {
        if !theirs && !self.everything {
            return;
        }
        let ours = if ours { self.mask(scene, node) } else { 0 };
        let theirs = if theirs { other(node) } else { 0 };
        self.words[node] = ours | theirs;
        if scene.tree().levels[node] > 0 {
            for lane in lanes(ours | theirs) {
                let [ours, theirs] = [ours, theirs].map(|mask| mask >> lane & 1 != 0);
                self.union_below(scene, other, scene.tree().child(node, lane), ours, theirs);
            }
        }
    }

    /// Iterates over the objects that are visible in the last finished frame and were not in the frame
    /// before. Empty unless the set was made [with changes](Self::with_changes).
    ///
    /// In the first frame of another scene, a clone included, these are all visible objects.
    pub fn newly_visible(&self) -> impl Iterator<Item = ObjectId> + '_ {
        self.changes.iter().flat_map(Changes::newly_visible)
    }

    /// Iterates over the objects that were visible in the frame before the last finished one and are not
    /// visible any more, including objects removed from the scene. Empty unless the set was made [with
    /// changes](Self::with_changes).
    ///
    /// In the first frame of another scene these are all objects that were visible in the previous scene,
    /// with their ids of the previous scene.
    pub fn newly_hidden(&self) -> impl Iterator<Item = ObjectId> + '_ {
        self.changes.iter().flat_map(Changes::newly_hidden)
    }

    /// Returns whether the masks describe the set for the scene's present layout. If false, the set counts as
    /// holding every object on its layers.
    pub(crate) fn is_current(&self, scene: &Scene) -> bool {
        !self.everything && self.is_of_layout(scene)
    }

    /// Returns whether the masks were made for the present layout of this scene. Layouts of different scenes
    /// are never equal.
    fn is_of_layout(&self, scene: &Scene) -> bool {
        self.layout == scene.layout()
    }

    /// Adapts the set to the present layout of the scene. If the layout has changed, every object on the
    /// set's layers becomes a candidate again and the order is dropped.
    pub(crate) fn prepare(&mut self, scene: &Scene) {
        if !self.is_of_layout(scene) {
            self.everything = true;
            self.listing = Listing::Masks;
            self.layout = scene.layout();
            self.words.resize(scene.tree().node_count(), 0);
            return;
        }
        match self.listing {
            Listing::Finished => self.listing = Listing::Order,
            Listing::Unlisted { .. } => self.listing = Listing::Masks,
            Listing::Masks | Listing::Order => {}
        }
    }

    /// Adapts the set to the present layout of the scene like [`prepare`](Self::prepare), but keeps the
    /// content of a finished set, without objects removed since.
    fn refresh(&mut self, scene: &Scene) {
        if !self.is_result_of(scene) {
            self.prepare(scene);
        } else if !self.is_of_layout(scene) {
            self.list_result(scene);
            self.ids.retain(|&id| scene.contains(id));
            write_masks(&mut self.words, scene, self.ids.iter().copied());
            self.layout = scene.layout();
            self.index_limit = scene.index_limit();
        }
    }

    /// Returns the mask of a node. Bit i stands for lane i. For a leaf, these are the objects in the set; for
    /// an inner node, the children that may have such objects below. The mask is valid only if the bits that
    /// lead to this node are set in all nodes above it.
    pub(crate) fn mask(&self, scene: &Scene, node: usize) -> u64 {
        self.mask_if(self.is_current(scene), scene, node)
    }

    /// Returns the mask of a node like [`mask`](Self::mask), for callers that have called
    /// [`is_current`](Self::is_current) already. `is_current` must be its result: whether this set's masks
    /// describe the scene's present layout. If false, the mask is that of the set of all objects on the set's
    /// layers.
    #[inline(always)]
    pub(crate) fn mask_if(&self, is_current: bool, scene: &Scene, node: usize) -> u64 {
        if is_current { self.words[node] } else { lanes_on_layers(scene, node, self.layers) }
    }

    /// Replaces the mask of a node, bit i for lane i, during a walk that ends with
    /// [`use_masks`](Self::use_masks).
    pub(crate) fn set_mask(&mut self, node: usize, mask: u64) {
        self.words[node] = mask;
    }

    /// Replaces the masks of consecutive nodes from `first` on, as [`set_mask`](Self::set_mask) does.
    pub(crate) fn set_masks(&mut self, first: usize, masks: &[u64]) {
        self.words[first..first + masks.len()].copy_from_slice(masks);
    }

    /// Clears the bit of a lane in the mask of a node that [`set_mask`](Self::set_mask) has set in this walk.
    pub(crate) fn drop_lane(&mut self, node: usize, lane: usize) {
        self.words[node] &= !(1 << lane);
    }

    /// Ends a walk in which a culler has set the mask of every node that it kept: the set is from now on
    /// defined by its masks.
    pub(crate) fn use_masks(&mut self) {
        self.everything = false;
    }

    /// Keeps all candidates in and below `node`: copies their masks unchanged. `is_current` tells whether
    /// this set's masks were made for the scene's present layout; if not, every object on the set's
    /// layers is a candidate. Returns the number of objects kept.
    pub(crate) fn keep_below(&mut self, is_current: bool, scene: &Scene, node: usize) -> u64 {
        let mask = self.mask_if(is_current, scene, node);
        self.words[node] = mask;
        if scene.tree().levels[node] == 0 {
            return mask.count_ones().into();
        }
        lanes(mask).map(|lane| self.keep_below(is_current, scene, scene.tree().child(node, lane))).sum()
    }

    /// Returns the number of leaves with candidates in and below `node`, whose bit must be set in all nodes
    /// above it. `is_current` tells whether this set's masks were made for the scene's present layout; if
    /// not, every object on the set's layers is a candidate.
    pub(crate) fn leaves_below(&self, is_current: bool, scene: &Scene, node: usize) -> u32 {
        let level = scene.tree().levels[node];
        if level == 0 {
            return 1;
        }
        let mask = self.mask_if(is_current, scene, node);
        if level == 1 {
            return mask.count_ones();
        }
        lanes(mask).map(|lane| self.leaves_below(is_current, scene, scene.tree().child(node, lane))).sum()
    }

    /// Marks an object for removal by [`drop_now`](Self::drop_now). `id` must be in the scene that
    /// [`begin_drops`](Self::begin_drops) was called with.
    pub(crate) fn drop_later(&mut self, id: ObjectId) {
        self.marked.insert(id.index());
    }

    /// Removes the objects marked by [`drop_later`](Self::drop_later) since
    /// [`begin_drops`](Self::begin_drops). Objects that are never culled stay. Returns the number of objects
    /// left in the set.
    pub(crate) fn drop_now(&mut self, scene: &Scene) -> u64 {
        let dropped = core::mem::take(&mut self.marked);
        let kept = self.retain(scene, |id, _| !dropped.contains(id.index()));
        self.marked = dropped;
        kept.visible
    }

    /// Clears the marks that [`drop_later`](Self::drop_later) sets, and makes space for one mark per object
    /// of the scene.
    pub(crate) fn begin_drops(&mut self, scene: &Scene) {
        self.marked.reset(scene.index_limit());
    }

    /// Keeps the objects in the set for which `keep` returns true, and removes all others: the simplest way
    /// to write a culler. `keep` receives an object and its bounds relative to the scene's origin. Objects
    /// that are never culled stay without a call of `keep`. Returns the work counters.
    pub fn retain(&mut self, scene: &Scene, mut keep: impl FnMut(ObjectId, &Aabb) -> bool) -> CullStats {
        self.prepare(scene);
        let mut stats = CullStats::default();
        if scene.tree().root != NONE {
            self.retain_below(scene, scene.tree().root as usize, &mut keep, &mut stats);
        }
        self.use_masks();
        stats.visible += self.unculled_count(scene);
        stats
    }

    fn retain_below(
        &mut self,
        scene: &Scene,
        node: usize,
        keep: &mut impl FnMut(ObjectId, &Aabb) -> bool,
        stats: &mut CullStats,
    ) -> bool {
        let tree = scene.tree();
        let mut mask = self.mask(scene, node);
        stats.nodes += 1;
        if tree.levels[node] == 0 {
            stats.tests += u64::from(mask.count_ones());
            for lane in lanes(mask) {
                if !keep(tree.ids[node][lane], &tree.bounds[node].get(lane)) {
                    mask &= !(1 << lane);
                }
            }
            stats.visible += u64::from(mask.count_ones());
        } else {
            for lane in lanes(mask) {
                if !self.retain_below(scene, tree.child(node, lane), keep, stats) {
                    mask &= !(1 << lane);
                }
            }
        }
        self.words[node] = mask;
        mask != 0
    }

    /// Keeps the objects that are in this set and in another, which `masks` gives as a mask for each node of
    /// the scene's present layout. Bit i of a mask stands for lane i: in a leaf, it is set if the lane's
    /// object is in the other set; in an inner node, if such objects may be below the lane's child. Objects
    /// that are never culled stay. Only nodes that both sets reach are visited, in a few nanoseconds each.
    /// Returns the work counters.
    pub(crate) fn intersect(&mut self, scene: &Scene, masks: &impl Fn(usize) -> u64) -> CullStats {
        self.prepare(scene);
        let mut stats = CullStats::default();
        if scene.tree().root != NONE {
            let is_current = self.is_current(scene);
            self.intersect_below(is_current, scene, masks, scene.tree().root as usize, &mut stats);
        }
        self.use_masks();
        stats.visible += self.unculled_count(scene);
        stats
    }

    /// Intersects the masks of `node` and of all nodes below it with those of `masks`, a function of the
    /// node. `is_current` is the result of [`is_current`](Self::is_current): true if the masks of the set
    /// describe the present layout of the scene. Returns whether any object is left at or below the node.
    fn intersect_below(
        &mut self,
        is_current: bool,
        scene: &Scene,
        masks: &impl Fn(usize) -> u64,
        node: usize,
        stats: &mut CullStats,
    ) -> bool {
        let mut mask = self.mask_if(is_current, scene, node) & masks(node);
        stats.nodes += 1;
        if scene.tree().levels[node] == 0 {
            stats.visible += u64::from(mask.count_ones());
        } else {
            for lane in lanes(mask) {
                let any =
                    self.intersect_below(is_current, scene, masks, scene.tree().child(node, lane), stats);
                mask &= !(u64::from(!any) << lane);
            }
        }
        self.words[node] = mask;
        mask != 0
    }

    /// Keeps only the objects of the set that are in `ids`, and gives the set the order of `ids`, which
    /// [`iter`](Self::iter) then follows. For cullers with a budget, whose order is one of importance.
    ///
    /// Objects that are never culled stay and come first. Ids that are not in the set are ignored, and of
    /// repeated ids the first counts. Takes time in proportion to the length of `ids`.
    ///
    /// ```
    /// use visibility_core::{Aabb, Scene, VisibleSet};
    /// let mut scene = Scene::new();
    /// let ids = scene.insert_batch((0..3).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 0.5; 3])));
    /// let mut visible = VisibleSet::new();
    /// visible.keep_in_order(&scene, &[ids[2], ids[0]]);
    /// assert_eq!(visible.iter(&scene).collect::<Vec<_>>(), [ids[2], ids[0]]);
    /// ```
    pub fn keep_in_order(&mut self, scene: &Scene, ids: &[ObjectId]) {
        self.refresh(scene);
        self.listing = Listing::Masks;
        let mut order = core::mem::take(&mut self.ids);
        order.clear();
        order.reserve(scene.len());
        order.extend(self.unculled(scene));
        // Masks of the new set, which starts empty and receives one object after the other.
        let tree = scene.tree();
        let mut grown = core::mem::take(&mut self.scratch_masks);
        grown.clear();
        grown.resize(tree.node_count(), 0);
        for &id in ids {
            let Some((leaf, lane)) = scene.leaf_of(id) else { continue };
            let is_new = if grown[leaf] != 0 {
                // The leaf has objects in the new set, so all nodes above it are in both sets, and the masks
                // of the leaf decide.
                let new = self.mask(scene, leaf) & !grown[leaf] & 1 << lane;
                grown[leaf] |= new;
                new != 0
            } else {
                !tree.is_unculled_leaf(leaf)
                    && self.holds(scene, leaf, lane)
                    && set_path_bits(&mut grown, tree, leaf, lane)
            };
            if is_new {
                order.push(id);
            }
        }
        self.everything = false;
        self.scratch_masks = core::mem::replace(&mut self.words, grown);
        self.ids = order;
        self.listing = Listing::Order;
    }

    /// Gives the set an order, which [`iter`](Self::iter) then follows: objects that are never culled first,
    /// then the objects of `ids` in their order, then all others in the order of the hierarchy. Removes
    /// nothing from the set. Ids that are not in the set are ignored, and of repeated ids the first counts.
    /// Takes time in proportion to the size of the set.
    pub fn order_first(&mut self, scene: &Scene, ids: &[ObjectId]) {
        self.refresh(scene);
        self.listing = Listing::Masks;
        let mut taken = core::mem::take(&mut self.marked);
        taken.reset(scene.index_limit());
        let mut take = |id: &ObjectId| taken.insert(id.index());
        let mut order = core::mem::take(&mut self.ids);
        order.clear();
        order.reserve(scene.len());
        order.extend(self.unculled(scene).filter(&mut take));
        order.extend(ids.iter().copied().filter(|&id| self.contains(scene, id)).filter(&mut take));
        order.extend(self.iter(scene).filter(&mut take));
        self.marked = taken;
        self.ids = order;
        self.listing = Listing::Order;
    }

    /// Begins a traversal of the leaves that the set reaches by its masks.
    fn leaves<'a>(&'a self, scene: &'a Scene) -> LeafWalk<'a> {
        LeafWalk::new(self.is_current(scene).then_some(&self.words[..]), self.layers, scene)
    }

    /// Begins a traversal of the leaves that a finished set reached at the layout of its masks. `token` and
    /// `root` are those of its [listing](Listing::Unlisted).
    fn leaves_of_result<'a>(&'a self, scene: &'a Scene, token: Option<&'a Token>, root: u32) -> LeafWalk<'a> {
        match token {
            Some(token) if !self.is_of_layout(scene) => LeafWalk::of_state(&self.words, scene, root, token),
            _ => self.leaves(scene),
        }
    }

    /// Iterates over the objects of a finished set that are never culled, as they were at the layout of its
    /// masks. `token` is that of its [listing](Listing::Unlisted).
    fn unculled_of_result<'a>(
        &'a self,
        scene: &'a Scene,
        token: Option<&'a Token>,
    ) -> impl Iterator<Item = ObjectId> + 'a {
        self.unculled_leaves.iter().flat_map(move |&leaf| {
            let (_, ids) = scene.tree().contents_at(leaf as usize, token);
            lanes(self.words[leaf as usize]).map(move |lane| ids[lane])
        })
    }

    /// Iterates over the objects that are never culled and share a layer with the set.
    fn unculled<'a>(&'a self, scene: &'a Scene) -> impl Iterator<Item = ObjectId> + 'a {
        let (tree, layers) = (scene.tree(), self.layers);
        tree.unculled.iter().flat_map(move |&leaf| {
            let leaf = leaf as usize;
            lanes(scene.lanes_on_layers(leaf, layers)).map(move |lane| tree.ids[leaf][lane])
        })
    }

    /// Returns the layers of the view that the set was [filled](Self::fill) for. All layers for a new set,
    /// none for a [cleared](Self::clear) one, those of all sets for a [union](Self::union).
    pub fn layers(&self) -> u32 {
        self.layers
    }

    /// Returns the layers that each view of the set has: [`layers`](Self::layers), but for a
    /// [union](Self::union) only those of all its sets. A view of the set is sure to draw only objects on one
    /// of these, so only they can hide objects from all views of the set. All layers for a cleared set.
    ///
    /// ```
    /// use visibility_core::{Pose, Scene, View, VisibleSet, glam::DVec3};
    /// let (scene, mut both, mut set) = (Scene::new(), VisibleSet::new(), VisibleSet::new());
    /// both.clear(&scene);
    /// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    /// for layers in [0b011, 0b110] {
    ///     set.fill(&scene, &View::perspective(pose, 1.0, 1.0, 0.1, 9.0)?.with_layers(layers));
    ///     both.union(&scene, &set);
    /// }
    /// assert_eq!((both.layers(), both.common_layers()), (0b111, 0b010));
    /// # Ok::<(), visibility_core::view::ViewError>(())
    /// ```
    pub fn common_layers(&self) -> u32 {
        self.common_layers
    }

    /// Returns the number of objects that are never culled and share a layer with the set.
    pub(crate) fn unculled_count(&self, scene: &Scene) -> u64 {
        let leaves = scene.tree().unculled.iter();
        leaves.map(|&leaf| u64::from(scene.lanes_on_layers(leaf as usize, self.layers).count_ones())).sum()
    }

    /// Calls `each` for the objects of the set that [can occlude](Scene::can_occlude), in the order of the
    /// hierarchy: those flagged as occluders, without those that are never culled or fade. Of a union, only
    /// those on a [layer of all its sets](Self::common_layers): other views do not draw them. A set that was
    /// finished at an older layout counts as holding all objects on its layers.
    pub fn for_each_occluder(&self, scene: &Scene, mut each: impl FnMut(ObjectId)) {
        let mut walk = self.leaves(scene);
        loop {
            if scene.tree().root != NONE {
                let drawn = scene.lanes_on_layers(walk.leaf, self.common_layers);
                for lane in lanes(walk.mask & drawn & scene.tree().occluding(walk.leaf)) {
                    each(walk.ids[lane]);
                }
            }
            if !walk.next_leaf() {
                return;
            }
        }
    }

    /// Returns the [layout](Scene::layout) of the scene, and a hash of the set's layers and of the places of
    /// its objects in that layout. Both are equal for two frames of a scene only if the sets hold the same
    /// objects, but for a chance of 2^-64. For cullers with answers to earlier frames. Sets that were
    /// finished at an older layout, and are no clones, have different hashes whatever they hold. Takes some
    /// nanoseconds for each leaf with an object of the set.
    pub fn fingerprint(&self, scene: &Scene) -> (Stamp, u64) {
        let mut hash = Fingerprint::new().with(self.layers);
        // The walk leaves out objects that are never culled.
        for &leaf in &scene.tree().unculled {
            hash = hash.with(leaf).with_u64(self.unculled_mask(scene, leaf as usize));
        }
        if self.is_result_of(scene) && !self.is_of_layout(scene) {
            hash = hash.with_u64(self.result.number());
        }
        let mut walk = self.leaves(scene);
        loop {
            hash = hash.with(walk.leaf as u32).with_u64(walk.mask);
            if !walk.next_leaf() {
                return (scene.layout(), hash.value());
            }
        }
    }

    /// Returns the mask of the set's objects in a leaf outside the tree, which holds objects that are never
    /// culled.
    #[inline]
    fn unculled_mask(&self, scene: &Scene, leaf: usize) -> u64 {
        let is_stored = self.is_current(scene) && self.is_finished();
        if is_stored { self.words[leaf] } else { scene.lanes_on_layers(leaf, self.layers) }
    }

    /// Returns whether the object in a lane of a leaf is in the set, by the masks and layers of the set.
    #[inline]
    fn holds(&self, scene: &Scene, leaf: usize, lane: usize) -> bool {
        let tree = scene.tree();
        if tree.is_unculled_leaf(leaf) {
            return self.unculled_mask(scene, leaf) >> lane & 1 != 0;
        }
        if !self.is_current(scene) {
            return scene.lanes_on_layers(leaf, self.layers) >> lane & 1 != 0;
        }
        tree.path(leaf, lane).all(|(node, lane)| self.words[node] >> lane & 1 != 0)
    }
}

/// Replaces `masks`, indexed by node, by those of a set that holds the objects `ids`. Ids that the scene does
/// not know are ignored.
fn write_masks(masks: &mut Vec<u64>, scene: &Scene, ids: impl Iterator<Item = ObjectId>) {
    masks.clear();
    masks.resize(scene.tree().node_count(), 0);
    ids.for_each(|id| add_to_masks(masks, scene, id));
}

/// Adds an object to the set that `masks` holds, indexed by node and [consistent](set_path_bits). Does
/// nothing for an object that the scene does not know.
pub(crate) fn add_to_masks(masks: &mut [u64], scene: &Scene, id: ObjectId) {
    if let Some((leaf, lane)) = scene.leaf_of(id) {
        set_path_bits(masks, scene.tree(), leaf, lane);
    }
}

/// Sets the bit of lane `lane` of leaf `leaf`, and in each node above it the bit of the lane that leads to
/// this leaf. `masks` holds one mask per node, indexed by node; bit i of a mask stands for lane i of the
/// node. Returns true if the bit of the leaf's lane was not set before.
///
/// `masks` must be consistent before the call, and is so after it: if the mask of a node is not 0, then the
/// bit of the lane that leads to this node is set in its parent, and so on up to the root.
fn set_path_bits(masks: &mut [u64], tree: &Tree, leaf: usize, lane: usize) -> bool {
    let mut new = None;
    for (node, lane) in tree.path(leaf, lane) {
        let mask = &mut masks[node];
        let (had_any, bit) = (*mask != 0, 1 << lane);
        new.get_or_insert(*mask & bit == 0);
        *mask |= bit;
        if had_any {
            // The node was not empty, so the bits above it are set already.
            break;
        }
    }
    new.unwrap_or(false)
}
