//! The set that goes through the cullers of a frame: candidates in, survivors out.

use crate::scene::{NONE, Tree, lanes};
use crate::{Aabb, CullStats, ObjectId, Scene, View, scene::SceneCursor, stamp::Stamp};
use alloc::vec::Vec;
use smallvec::SmallVec;

/// The objects of a scene that a view may see.
///
/// It holds a mask for each node of the scene's hierarchy, so that cullers work on 64 objects at once and
/// whole branches that are hidden are never touched. The masks belong to the layout of the scene at the time
/// of culling: if objects come, go or are moved to another place in the hierarchy before the set is read, it
/// counts as holding everything.
///
/// Objects that are never culled are always in it, if they are on the view's layers.
///
/// ```
/// use visibility_core::{Aabb, Pipeline, Scene, VisibleSet};
/// # use visibility_core::{glam::DVec3, FrustumCuller, Pose, View};
/// # let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// # let view = View::perspective(pose, 1.0, 1.0, 0.1, 100.0)?;
/// let mut scene = Scene::new();
/// let id = scene.insert(Aabb::from_arrays([5.0, 0.0, 0.0], [6.0, 1.0, 1.0]));
/// let mut visible = VisibleSet::with_changes(); // also tells what appeared and vanished
/// let mut pipeline = Pipeline::new().with(FrustumCuller::new());
/// pipeline.cull(&scene, &view, &mut visible);
/// assert!(visible.contains(&scene, id));
/// assert_eq!(visible.newly_visible().collect::<Vec<_>>(), [id]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct VisibleSet {
    /// By node: which lanes are in the set, or, in inner nodes, have something below them that is. The mask
    /// of a node whose lane above is not set means nothing.
    words: Vec<u64>,
    /// The layout of the scene that `words` belongs to.
    layout: Stamp,
    /// All objects on `layers`, whatever is in `words`.
    everything: bool,
    layers: u32,
    /// Contains at least what `words` contains, if `ordered`.
    order: Vec<ObjectId>,
    ordered: bool,
    /// Memory for making an order: by index, a bit for what is in it, or the masks of it.
    listed: Vec<u64>,
    changes: Option<Changes>,
}

/// What was visible in the last two frames, by id, which outlives changes of layout.
#[derive(Clone, Debug)]
struct Changes {
    now: Vec<ObjectId>,
    before: Vec<ObjectId>,
    /// The scene of `now`, and whether `before` is of another: then the same id names two objects.
    scene: SceneCursor,
    is_other: bool,
    /// By index, the place in the list of the same time; means nothing where the list holds another object
    /// there.
    now_places: Vec<u32>,
    before_places: Vec<u32>,
}

impl Changes {
    const NONE: Self = Self {
        now: Vec::new(),
        before: Vec::new(),
        scene: SceneCursor::START,
        is_other: false,
        now_places: Vec::new(),
        before_places: Vec::new(),
    };

    /// The objects that those of the other frame may be among: none if both frames are of different scenes.
    fn same_scene<'a>(&self, ids: &'a [ObjectId]) -> &'a [ObjectId] {
        if self.is_other { &[] } else { ids }
    }
}

impl Default for VisibleSet {
    fn default() -> Self {
        Self::new()
    }
}

impl VisibleSet {
    /// A set that holds everything, until a culler says otherwise.
    pub const fn new() -> Self {
        Self {
            words: Vec::new(),
            layout: Stamp::NONE,
            everything: true,
            layers: u32::MAX,
            order: Vec::new(),
            ordered: false,
            listed: Vec::new(),
            changes: None,
        }
    }

    /// As [`new`](Self::new), also keeping track of what is [newly visible](Self::newly_visible) and
    /// [newly hidden](Self::newly_hidden), which costs a few nanoseconds for each visible object and frame.
    pub fn with_changes() -> Self {
        Self { changes: Some(Changes::NONE), ..Self::new() }
    }

    /// Makes every object on the view's layers a candidate. [`Pipeline::cull`](crate::Pipeline::cull) does
    /// this by itself.
    pub fn fill(&mut self, scene: &Scene, view: &View) {
        self.layers = view.layers();
        self.everything = true;
        self.ordered = false;
        self.layout = scene.layout();
        self.words.resize(scene.tree().node_count(), 0);
    }

    /// Takes everything out of the set: where a [`union`](Self::union) of several starts.
    pub fn clear(&mut self, scene: &Scene) {
        self.layers = 0;
        self.everything = false;
        self.ordered = false;
        self.layout = scene.layout();
        self.words.resize(scene.tree().node_count(), 0);
        if scene.tree().root != NONE {
            self.words[scene.tree().root as usize] = 0;
        }
    }

    /// Adds what is in another set of the same scene: afterwards an object is in this set if it was in
    /// either. So the sets of two eyes, whatever pipelines they come from, become the one that both are
    /// drawn from; it hides nothing that either eye sees.
    ///
    /// A set of an earlier layout of the scene holds everything on its layers, and so then does the union.
    /// The order is dropped. Changes are told when the frame is ended by [`finish`](Self::finish), which is
    /// up to the caller. Costs a few nanoseconds for each block of 64 objects in the sets.
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
    /// // A pipeline and a set an eye, kept from frame to frame, and a set for both.
    /// let mut pipelines = [(); 2].map(|_| Pipeline::new().with(FrustumCuller::new()));
    /// let mut sets = [(); 2].map(|_| VisibleSet::new());
    /// let mut both = VisibleSet::with_changes();
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
        self.prepare(scene);
        // Two that hold everything on their layers hold everything on the layers of either.
        if !(self.everything && other.everything) {
            if scene.tree().root != NONE {
                self.add_below(scene, other, scene.tree().root as usize, true, true);
            }
            self.commit();
        }
        self.layers |= other.layers;
        self.ordered = false;
    }

    /// Unites the masks of a node and below, which either set reaches or does not.
    fn add_below(&mut self, scene: &Scene, other: &Self, node: usize, ours: bool, theirs: bool) {
        if !theirs && !self.everything {
            return;
        }
        let ours = if ours { self.mask(scene, node) } else { 0 };
        let theirs = if theirs { other.mask(scene, node) } else { 0 };
        self.words[node] = ours | theirs;
        if scene.tree().levels[node] > 0 {
            for lane in lanes(ours | theirs) {
                let [ours, theirs] = [ours, theirs].map(|mask| mask >> lane & 1 != 0);
                self.add_below(scene, other, scene.tree().child(node, lane), ours, theirs);
            }
        }
    }

    /// Ends a frame: notes what is visible, if changes are asked for.
    /// [`Pipeline::cull`](crate::Pipeline::cull) does this by itself.
    pub fn finish(&mut self, scene: &Scene) {
        let Some(mut changes) = self.changes.take() else { return };
        changes.is_other = !changes.scene.is_in(scene);
        changes.scene = SceneCursor::at(scene);
        core::mem::swap(&mut changes.now, &mut changes.before);
        core::mem::swap(&mut changes.now_places, &mut changes.before_places);
        changes.now.clear();
        changes.now.reserve(scene.len());
        changes.now_places.resize(scene.index_limit(), 0);
        for id in self.iter(scene) {
            changes.now_places[id.index()] = changes.now.len() as u32;
            changes.now.push(id);
        }
        self.changes = Some(changes);
    }

    /// What is visible now and was not in the frame before, if the set was made [with
    /// changes](Self::with_changes).
    ///
    /// In the first frame of another scene, a clone included, that is everything visible.
    pub fn newly_visible(&self) -> impl Iterator<Item = ObjectId> + '_ {
        self.changes.iter().flat_map(|c| difference(&c.now, c.same_scene(&c.before), &c.before_places))
    }

    /// What was visible in the frame before and is not now, if the set was made [with
    /// changes](Self::with_changes); also what was removed from the scene meanwhile.
    ///
    /// In the first frame of another scene that is everything visible in the scene before, by the ids of
    /// that.
    pub fn newly_hidden(&self) -> impl Iterator<Item = ObjectId> + '_ {
        self.changes.iter().flat_map(|c| difference(&c.before, c.same_scene(&c.now), &c.now_places))
    }

    /// Whether the masks can be used for this scene as it is.
    pub(crate) fn is_current(&self, scene: &Scene) -> bool {
        !self.everything && self.is_of_layout(scene)
    }

    /// Whether the masks belong to the layout of the scene, which no other scene has.
    fn is_of_layout(&self, scene: &Scene) -> bool {
        self.layout == scene.layout()
    }

    /// Brings the set to the layout of the scene: if that has changed, everything is a candidate again.
    pub(crate) fn prepare(&mut self, scene: &Scene) {
        if !self.is_of_layout(scene) {
            self.everything = true;
            self.ordered = false;
            self.layout = scene.layout();
            self.words.resize(scene.tree().node_count(), 0);
        }
    }

    /// The lanes of a node in the set, when those above it are.
    pub(crate) fn mask(&self, scene: &Scene, node: usize) -> u64 {
        self.mask_if(self.is_current(scene), scene, node)
    }

    /// The same where it is known whether the masks are current, as it is throughout a walk.
    #[inline(always)]
    pub(crate) fn mask_if(&self, is_current: bool, scene: &Scene, node: usize) -> u64 {
        if is_current {
            self.words[node]
        } else if scene.tree().levels[node] == 0 {
            scene.lanes_on_layers(node, self.layers)
        } else {
            scene.tree().occupied[node]
        }
    }

    pub(crate) fn set_mask(&mut self, node: usize, mask: u64) {
        self.words[node] = mask;
    }

    /// Ends the walk of a culler that has set the mask of every node that it reached: from now on those masks
    /// count.
    pub(crate) fn commit(&mut self) {
        self.everything = false;
    }

    /// Takes a node and all below it as it is. Returns how many objects that are.
    pub(crate) fn keep_below(&mut self, is_current: bool, scene: &Scene, node: usize) -> u64 {
        let mask = self.mask_if(is_current, scene, node);
        self.words[node] = mask;
        if scene.tree().levels[node] == 0 {
            return mask.count_ones().into();
        }
        lanes(mask).map(|lane| self.keep_below(is_current, scene, scene.tree().child(node, lane))).sum()
    }

    /// Notes an object to be taken out by [`drop_now`](Self::drop_now).
    pub(crate) fn drop_later(&mut self, id: ObjectId) {
        self.listed[id.index() / 64] |= 1 << (id.index() % 64);
    }

    /// Removes the objects that [`drop_later`](Self::drop_later) was told of since
    /// [`begin_drops`](Self::begin_drops). Returns how many objects are left in the set.
    pub(crate) fn drop_now(&mut self, scene: &Scene) -> u64 {
        let dropped = core::mem::take(&mut self.listed);
        let kept = self.retain(scene, |id, _| dropped[id.index() / 64] >> (id.index() % 64) & 1 == 0);
        self.listed = dropped;
        kept.visible
    }

    /// Begins to note what to take out.
    pub(crate) fn begin_drops(&mut self, scene: &Scene) {
        self.listed.clear();
        self.listed.resize(scene.index_limit().div_ceil(64), 0);
    }

    /// Keeps the objects for which `keep` is true: the simplest way to write a culler. Objects that are never
    /// culled are not asked for.
    pub fn retain(&mut self, scene: &Scene, mut keep: impl FnMut(ObjectId, &Aabb) -> bool) -> CullStats {
        self.prepare(scene);
        let mut stats = CullStats::default();
        if scene.tree().root != NONE {
            self.retain_below(scene, scene.tree().root as usize, &mut keep, &mut stats);
        }
        self.commit();
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

    /// Sorts what is in the set, by ascending key; [`iter`](Self::iter) then follows that order.
    pub fn sort_by_key<K: Ord>(&mut self, scene: &Scene, mut key: impl FnMut(ObjectId) -> K) {
        self.prepare(scene);
        let mut order = core::mem::take(&mut self.order);
        self.ordered = false;
        order.clear();
        // For any set of this scene, so that later frames allocate nothing.
        order.reserve(scene.len());
        order.extend(self.iter(scene));
        // Equal keys by index, so that the order depends on nothing else.
        order.sort_unstable_by_key(|&id| (key(id), id));
        self.order = order;
        self.ordered = true;
    }

    /// Keeps those objects in the set that are listed, in the order of the list, which [`iter`](Self::iter)
    /// then follows: the way of cullers that have a budget, whose order is that of importance. Objects
    /// that are never culled stay and come first; what is listed but not in the set stays out, and what
    /// is listed twice counts once, at its first place. Takes time in proportion to the list.
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
        self.prepare(scene);
        let mut order = core::mem::take(&mut self.order);
        order.clear();
        order.reserve(scene.len());
        order.extend(self.unculled(scene));
        // The masks of the new set, grown from an empty one.
        let tree = scene.tree();
        let mut grown = core::mem::take(&mut self.listed);
        grown.clear();
        grown.resize(tree.node_count(), 0);
        for &id in ids {
            let Some((leaf, lane)) = scene.leaf_of(id) else { continue };
            let is_new = if grown[leaf] != 0 {
                // What lies above the leaf is in both sets, then.
                let new = self.mask(scene, leaf) & !grown[leaf] & 1 << lane;
                grown[leaf] |= new;
                new != 0
            } else {
                !tree.is_unculled_leaf(leaf)
                    && self.holds(scene, leaf, lane)
                    && add(&mut grown, tree, leaf, lane)
            };
            if is_new {
                order.push(id);
            }
        }
        self.everything = false;
        self.listed = core::mem::replace(&mut self.words, grown);
        self.order = order;
        self.ordered = true;
    }

    /// Gives the set an order in which the listed objects come first, after those that are never culled, and
    /// the others follow in that of the hierarchy. Takes nothing out; what is listed but not in the set
    /// does not matter. Takes time in proportion to the set.
    pub fn put_first(&mut self, scene: &Scene, ids: &[ObjectId]) {
        self.prepare(scene);
        self.ordered = false;
        let mut listed = core::mem::take(&mut self.listed);
        listed.clear();
        listed.resize(scene.index_limit().div_ceil(64), 0);
        let mut take = |id: &ObjectId| {
            let (word, bit) = (&mut listed[id.index() / 64], 1 << (id.index() % 64));
            let new = *word & bit == 0;
            *word |= bit;
            new
        };
        let mut order = core::mem::take(&mut self.order);
        order.clear();
        order.reserve(scene.len());
        order.extend(self.unculled(scene).filter(&mut take));
        order.extend(ids.iter().copied().filter(|&id| self.contains(scene, id)).filter(&mut take));
        order.extend(self.iter(scene).filter(&mut take));
        self.listed = listed;
        self.order = order;
        self.ordered = true;
    }

    /// The objects in the set, in its order if it has one, otherwise in that of the hierarchy.
    pub fn iter<'a>(&'a self, scene: &'a Scene) -> impl Iterator<Item = ObjectId> + 'a {
        let ordered = self.ordered && self.is_of_layout(scene);
        let in_order =
            self.order.iter().copied().filter(move |_| ordered).filter(|&id| self.contains(scene, id));
        let walk = Walk::new(self, scene, !ordered);
        in_order.chain(walk).chain(self.unculled(scene).filter(move |_| !ordered))
    }

    /// The objects that are never culled, on the layers of the view.
    fn unculled<'a>(&'a self, scene: &'a Scene) -> impl Iterator<Item = ObjectId> + 'a {
        let (tree, layers) = (scene.tree(), self.layers);
        tree.unculled.iter().flat_map(move |&leaf| {
            let leaf = leaf as usize;
            lanes(scene.lanes_on_layers(leaf, layers)).map(move |lane| tree.ids[leaf][lane])
        })
    }

    pub(crate) fn unculled_count(&self, scene: &Scene) -> u64 {
        let leaves = scene.tree().unculled.iter();
        leaves.map(|&leaf| u64::from(scene.lanes_on_layers(leaf as usize, self.layers).count_ones())).sum()
    }

    /// Calls `each` for the objects in the set that are flagged as occluders and can be culled, in the order
    /// of the hierarchy.
    pub fn for_each_occluder(&self, scene: &Scene, mut each: impl FnMut(ObjectId)) {
        let mut walk = Walk::new(self, scene, true);
        loop {
            if scene.tree().root != NONE {
                for lane in lanes(walk.mask & scene.tree().occluders[walk.leaf]) {
                    each(scene.tree().ids[walk.leaf][lane]);
                }
            }
            if !walk.next_leaf() {
                return;
            }
        }
    }

    /// How many objects are in the set.
    pub fn count(&self, scene: &Scene) -> usize {
        let mut walk = Walk::new(self, scene, true);
        let mut count = walk.mask.count_ones() as usize;
        while walk.next_leaf() {
            count += walk.mask.count_ones() as usize;
        }
        count + self.unculled_count(scene) as usize
    }

    /// Whether an object is in the set. False for an unknown one.
    #[inline]
    pub fn contains(&self, scene: &Scene, id: ObjectId) -> bool {
        scene.leaf_of(id).is_some_and(|(leaf, lane)| self.holds(scene, leaf, lane))
    }

    #[inline]
    fn holds(&self, scene: &Scene, leaf: usize, lane: usize) -> bool {
        let tree = scene.tree();
        if !self.is_current(scene) || tree.is_unculled_leaf(leaf) {
            return scene.lanes_on_layers(leaf, self.layers) >> lane & 1 != 0;
        }
        tree.path(leaf, lane).all(|(node, lane)| self.words[node] >> lane & 1 != 0)
    }
}

/// Sets the bit of an object and those above it in masks of which all above a set bit are set. Whether it was
/// not yet set.
fn add(masks: &mut [u64], tree: &Tree, leaf: usize, lane: usize) -> bool {
    let mut new = None;
    for (node, lane) in tree.path(leaf, lane) {
        let mask = &mut masks[node];
        let (had_any, bit) = (*mask != 0, 1 << lane);
        new.get_or_insert(*mask & bit == 0);
        *mask |= bit;
        if had_any {
            // What lies above knows of this node.
            break;
        }
    }
    new.unwrap_or(false)
}

/// Those of `of` that are not among `others`, of which `places` says by index where to look (a sparse set:
/// Briggs and Torczon, "An Efficient Representation for Sparse Sets", 1993). Ids are compared whole, since an
/// index may have been used again.
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

/// Goes through the leaves of a set.
struct Walk<'a> {
    set: &'a VisibleSet,
    scene: &'a Scene,
    tree: &'a Tree,
    /// Inner nodes on the way down, each with the lanes that are still to be visited.
    path: SmallVec<[(usize, u64); 8]>,
    leaf: usize,
    mask: u64,
}

impl<'a> Walk<'a> {
    fn new(set: &'a VisibleSet, scene: &'a Scene, wanted: bool) -> Self {
        let mut walk = Self { set, scene, tree: scene.tree(), path: SmallVec::new(), leaf: 0, mask: 0 };
        if wanted && walk.tree.root != NONE {
            walk.enter(walk.tree.root as usize);
        }
        walk
    }

    fn enter(&mut self, node: usize) {
        let mask = self.set.mask(self.scene, node);
        if self.tree.levels[node] == 0 {
            (self.leaf, self.mask) = (node, mask);
        } else {
            self.path.push((node, mask));
        }
    }

    /// Moves on to the next leaf, whose mask may be empty. False at the end.
    fn next_leaf(&mut self) -> bool {
        while let Some((node, rest)) = self.path.last_mut() {
            if *rest == 0 {
                self.path.pop();
                continue;
            }
            let lane = rest.trailing_zeros() as usize;
            *rest &= *rest - 1;
            let child = self.tree.child(*node, lane);
            self.enter(child);
            if self.tree.levels[child] == 0 {
                return true;
            }
        }
        self.mask = 0;
        false
    }
}

impl Iterator for Walk<'_> {
    type Item = ObjectId;

    fn next(&mut self) -> Option<ObjectId> {
        while self.mask == 0 {
            if !self.next_leaf() {
                return None;
            }
        }
        let lane = self.mask.trailing_zeros() as usize;
        self.mask &= self.mask - 1;
        Some(self.tree.ids[self.leaf][lane])
    }

    /// As calling `next` to the end, but a leaf at a time: several times as fast, and what `for_each` and
    /// `collect` use.
    fn fold<B, F: FnMut(B, ObjectId) -> B>(mut self, start: B, mut f: F) -> B {
        let mut result = start;
        loop {
            if self.mask == u64::MAX {
                result = self.tree.ids[self.leaf].iter().fold(result, |result, &id| f(result, id));
            } else {
                // An empty tree has no leaf to look at.
                while self.mask != 0 {
                    let lane = self.mask.trailing_zeros() as usize;
                    self.mask &= self.mask - 1;
                    result = f(result, self.tree.ids[self.leaf][lane]);
                }
            }
            if !self.next_leaf() {
                return result;
            }
        }
    }
}
