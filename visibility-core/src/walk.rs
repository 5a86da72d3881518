//! The one walk of a frame: down a hierarchy of boxes, 64 siblings at a time, from a set of candidates to
//! those that are left.
//!
//! A culler brings the test of a block of siblings; the walk brings the candidates among them and takes back
//! a mask of those to keep. What is dropped is never looked into. The scene's own hierarchy hands out its
//! nodes as they are, and its masks are those of the [`VisibleSet`]; any other [`BoxHierarchy`] is copied
//! into blocks as it is walked, and its dropped objects are taken out at the end.

use crate::scene::{Boxes64, Tree, lanes};
use crate::{Aabb, CullStats, ObjectId, Scene, VisibleSet};

/// What is below a node of a [`BoxHierarchy`].
///
/// ```
/// use visibility_core::walk::Child;
/// let child = Child::Node(3);
/// assert!(matches!(child, Child::Node(3)));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Child {
    /// Another node, by the hierarchy's own number.
    Node(usize),
    /// An object of the scene.
    Object(ObjectId),
}

/// A hierarchy of boxes over the objects of a scene: an octree, a BSP tree, the scene's own.
///
/// A box must contain everything below it. Objects that have moved since the hierarchy was brought up to date
/// must not be listed, unless they are still within the boxes above them; what is not listed counts as
/// visible.
///
/// ```
/// use visibility_core::walk::{BoxHierarchy, Child};
/// use visibility_core::{Aabb, ObjectId, Scene};
/// /// Every object by itself.
/// struct Flat(Vec<ObjectId>);
/// impl BoxHierarchy for Flat {
///     fn for_each_child(&self, scene: &Scene, node: Option<usize>, each: &mut dyn FnMut(Child, Aabb)) {
///         for &id in self.0.iter().filter(|_| node.is_none()) {
///             if let Ok(bounds) = scene.bounds(id) {
///                 each(Child::Object(id), bounds);
///             }
///         }
///     }
/// }
/// ```
pub trait BoxHierarchy {
    /// Calls `each` for everything directly below a node, or, for `None`, for what is at the top.
    fn for_each_child(&self, scene: &Scene, node: Option<usize>, each: &mut dyn FnMut(Child, Aabb));

    /// Whether this is the [`SceneHierarchy`], whose nodes have masks in a [`VisibleSet`]. No other hierarchy
    /// may say so.
    #[doc(hidden)]
    const IS_OF_SCENE: bool = false;

    /// Calls `each` for the same children in blocks of at most 64. To be written by a hierarchy that keeps
    /// its boxes in such blocks; all others inherit this, which copies 28 bytes a child.
    fn for_each_block(&self, scene: &Scene, node: Option<usize>, mut each: impl FnMut(&Block<'_>))
    where
        Self: Sized,
    {
        let (mut boxes, mut children, mut count) = (Boxes64::EMPTY, [Child::Node(usize::MAX); 64], 0);
        self.for_each_child(scene, node, &mut |child, bounds| {
            if count == 64 {
                each(&Block { boxes: &boxes, children: Children::Listed(&children) });
                (boxes, count) = (Boxes64::EMPTY, 0);
            }
            boxes.set(count, &bounds);
            children[count] = child;
            count += 1;
        });
        if count > 0 {
            each(&Block { boxes: &boxes, children: Children::Listed(&children[..count]) });
        }
    }
}

/// The hierarchy that every scene has.
///
/// ```
/// use visibility_core::walk::{BoxHierarchy, Child, SceneHierarchy};
/// use visibility_core::{Aabb, Scene};
/// let mut scene = Scene::new();
/// let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
/// SceneHierarchy.for_each_child(&scene, None, &mut |child, _| assert_eq!(child, Child::Object(id)));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct SceneHierarchy;

impl BoxHierarchy for SceneHierarchy {
    const IS_OF_SCENE: bool = true;

    fn for_each_child(&self, scene: &Scene, node: Option<usize>, each: &mut dyn FnMut(Child, Aabb)) {
        self.for_each_block(scene, node, |block| {
            for lane in lanes(block.occupied()) {
                each(block.child(lane), block.boxes.get(lane));
            }
        });
    }

    #[inline(always)]
    fn for_each_block(&self, scene: &Scene, node: Option<usize>, mut each: impl FnMut(&Block<'_>)) {
        let tree = scene.tree();
        let node = node.unwrap_or(tree.root as usize);
        // Also false for the root of an empty tree.
        if let (Some(boxes), Some(&level)) = (tree.bounds.get(node), tree.levels.get(node)) {
            each(&Block { boxes, children: Children::Node { tree, node, leaf: level == 0 } });
        }
    }
}

/// At most 64 siblings in a hierarchy of boxes, a lane each.
pub struct Block<'a> {
    boxes: &'a Boxes64,
    children: Children<'a>,
}

enum Children<'a> {
    /// A node of the scene's own hierarchy. What is kept beside its boxes is fetched when it is asked for:
    /// most tests need none of it.
    Node { tree: &'a Tree, node: usize, leaf: bool },
    /// Children listed by a hierarchy that is not the scene's own, copied for this block.
    Listed(&'a [Child]),
}

impl Block<'_> {
    /// The boxes of the children; [`Aabb::EMPTY`] in free lanes.
    #[inline(always)]
    pub fn boxes(&self) -> &Boxes64 {
        self.boxes
    }

    /// The lanes that hold a child, a bit each.
    pub fn occupied(&self) -> u64 {
        match self.children {
            Children::Node { tree, node, .. } => tree.occupied[node],
            Children::Listed(children) => first_lanes(children.len()),
        }
    }

    /// The lanes that may hold an occluder, a bit each: in a leaf of the scene's own hierarchy, the objects
    /// that are flagged as such.
    pub fn occluders(&self) -> u64 {
        match self.children {
            Children::Node { tree, node, .. } => tree.occluders[node],
            Children::Listed(children) => first_lanes(children.len()),
        }
    }

    /// The child in an occupied lane; any node in a free one.
    #[inline(always)]
    pub fn child(&self, lane: usize) -> Child {
        match self.children {
            Children::Node { tree, node, leaf: true } => Child::Object(tree.ids[node][lane % 64]),
            Children::Node { tree, node, leaf: false } => Child::Node(tree.child(node, lane % 64)),
            Children::Listed(children) => children.get(lane).copied().unwrap_or(Child::Node(usize::MAX)),
        }
    }

    /// The number of a leaf of the scene's own hierarchy and the objects in its lanes, for cullers that keep
    /// data beside the leaves; any id in a free lane. `None` for other blocks.
    #[inline(always)]
    pub fn leaf(&self) -> Option<(usize, &[ObjectId; 64])> {
        match self.children {
            Children::Node { tree, node, leaf: true } => Some((node, &tree.ids[node])),
            _ => None,
        }
    }

    /// The lanes among `mask` that hold objects.
    #[inline(always)]
    pub fn objects(&self, mask: u64) -> u64 {
        match self.children {
            Children::Node { leaf, .. } => mask * u64::from(leaf),
            Children::Listed(children) => {
                let is_object = |&lane: &usize| matches!(children.get(lane), Some(Child::Object(_)));
                lanes(mask).filter(is_object).fold(0, |mask, lane| mask | 1 << lane)
            }
        }
    }
}

/// A mask of the first `count` lanes.
fn first_lanes(count: usize) -> u64 {
    u64::MAX.checked_shr(64 - count.min(64) as u32).unwrap_or(0)
}

/// A walk under way: the candidates of one set over one hierarchy, and counters of the work done.
///
/// ```
/// use visibility_core::walk::{Block, Child, SceneHierarchy, Walk};
/// use visibility_core::{Aabb, Scene, VisibleSet};
/// /// Keeps what reaches above the ground.
/// fn above(walk: &mut Walk<SceneHierarchy>, node: Option<usize>) -> bool {
///     walk.visit(node, |walk, block, candidates| {
///         let highest = &block.boxes().coordinates()[5];
///         let mut mask = (0..64).filter(|&lane| highest[lane] > 0.0).fold(0, |mask,
///             lane| mask | 1 << lane) & candidates;
///         for lane in 0..64 {
///             if let (1, Child::Node(below)) = (mask >> lane & 1, block.child(lane)) {
///                 mask &= !(u64::from(!above(walk, Some(below))) << lane);
///             }
///         }
///         mask
///     })
/// }
/// let mut scene = Scene::new();
/// let boxes = (0..100).map(|i| Aabb::from_arrays([i as f32, 0.0, -2.0], [i as f32, 1.0,
///     if i < 40 { -1.0 } else { 1.0 }]));
/// scene.insert_batch(boxes);
/// let mut visible = VisibleSet::new();
/// let mut walk = Walk::new(&scene, &SceneHierarchy, &mut visible);
/// above(&mut walk, None);
/// assert_eq!(walk.finish().visible, 60);
/// ```
pub struct Walk<'a, H> {
    scene: &'a Scene,
    hierarchy: &'a H,
    visible: &'a mut VisibleSet,
    /// Whether the set has masks of its own, as opposed to holding everything.
    is_current: bool,
    /// The work so far. [`visit`](Self::visit) counts nodes and what is left; tests and accepted subtrees
    /// are the culler's to count.
    pub stats: CullStats,
}

impl<'a, H: BoxHierarchy> Walk<'a, H> {
    /// Begins a walk. If the layout of the scene has changed since the set was filled, everything is a
    /// candidate again.
    pub fn new(scene: &'a Scene, hierarchy: &'a H, visible: &'a mut VisibleSet) -> Self {
        visible.prepare(scene);
        if !H::IS_OF_SCENE {
            visible.begin_drops(scene);
        }
        let is_current = visible.is_current(scene);
        Self { scene, hierarchy, visible, is_current, stats: CullStats::default() }
    }

    /// The scene that is walked.
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// Has `test` look at the children of a node (`None`: those at the top), block by block, with the
    /// candidates among them; it returns those to keep. To be called for every node that is kept and not
    /// [accepted](Self::accept).
    ///
    /// Returns whether anything is left below the node, so that `test` can drop a child in which nothing is.
    /// Of other hierarchies than the scene's own it returns true, since their nodes have no masks to
    /// save.
    #[inline(always)]
    pub fn visit(
        &mut self,
        node: Option<usize>,
        mut test: impl FnMut(&mut Self, &Block<'_>, u64) -> u64,
    ) -> bool {
        let mut any = false;
        let (hierarchy, scene) = (self.hierarchy, self.scene);
        hierarchy.for_each_block(scene, node, |block| {
            let candidates = match block.children {
                Children::Node { node, .. } => self.visible.mask_if(self.is_current, scene, node),
                Children::Listed(children) => self.listed_candidates(children),
            };
            self.stats.nodes += 1;
            let mask = candidates & test(self, block, candidates);
            match block.children {
                Children::Node { node, .. } => self.visible.set_mask(node, mask),
                Children::Listed(children) => {
                    lanes(candidates & !mask).for_each(|lane| self.drop_below(children[lane]));
                    any = true;
                }
            }
            self.stats.visible += u64::from(block.objects(mask).count_ones());
            any |= mask != 0;
        });
        any
    }

    /// Keeps all candidates below a child, without a test. Whether there are any; true for other hierarchies
    /// than the scene's own.
    #[inline(always)]
    pub fn accept(&mut self, child: usize) -> bool {
        self.stats.accepted_subtrees += 1;
        if !H::IS_OF_SCENE {
            return true;
        }
        let kept = self.visible.keep_below(self.is_current, self.scene, child);
        self.stats.visible += kept;
        kept != 0
    }

    /// The lanes of a block of another hierarchy that are candidates: its nodes, and those of its objects
    /// that are in the set.
    fn listed_candidates(&self, children: &[Child]) -> u64 {
        let is_candidate = |child: &Child| match *child {
            Child::Node(_) => true,
            Child::Object(id) => self.visible.contains(self.scene, id),
        };
        (0..).zip(children).fold(0, |mask, (lane, child)| mask | u64::from(is_candidate(child)) << lane)
    }

    /// Notes an object, or all below a node of another hierarchy, to be taken out at the end.
    fn drop_below(&mut self, child: Child) {
        match child {
            // Another object may have the index of one that is gone.
            Child::Object(id) if self.scene.contains(id) => self.visible.drop_later(id),
            Child::Object(_) => {}
            Child::Node(node) => {
                let (hierarchy, scene) = (self.hierarchy, self.scene);
                hierarchy.for_each_child(scene, Some(node), &mut |child, _| self.drop_below(child));
            }
        }
    }

    /// Ends the walk: what was dropped is no longer in the set. The counters, with the objects that are never
    /// culled among the visible.
    pub fn finish(mut self) -> CullStats {
        if H::IS_OF_SCENE {
            self.visible.commit();
            self.stats.visible += self.visible.unculled_count(self.scene);
        } else {
            self.stats.visible = self.visible.drop_now(self.scene);
        }
        self.stats
    }
}
