//! The hierarchy walk that cullers share: from a set of candidates, down a hierarchy of bounding boxes, 64
//! siblings at a time.
//!
//! A culler supplies the test of a block of siblings. The walk supplies the candidates among these siblings
//! as a mask, and takes back the mask of those to keep; it never descends into a dropped node. The scene's
//! own hierarchy exposes its nodes in place, and its masks are those of the [`VisibleSet`]. The children of
//! any other [`BoxHierarchy`] are copied into blocks during the walk, and their dropped objects are removed
//! from the set at the end.

mod check;
mod split;

pub use check::first_misplaced;
pub(crate) use split::{NodeTest, retain_on};

use crate::scene::{Boxes64, FAN_OUT, Tree, lanes};
use crate::{Aabb, CullStats, ObjectId, Scene, VisibleSet};

/// A child of a node of a [`BoxHierarchy`]: an inner node or an object.
///
/// ```
/// use visibility_core::walk::Child;
/// let child = Child::Node(3);
/// assert!(matches!(child, Child::Node(3)));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Child {
    /// Another node of the hierarchy, by the number that the hierarchy itself gave to the node.
    Node(usize),
    /// An object of the scene: a leaf of the hierarchy.
    Object(ObjectId),
}

/// A hierarchy of bounding boxes over the objects of a scene: an octree, a BSP tree, the scene's own.
///
/// The box of a node must contain everything below the node. An object that has moved since the hierarchy was
/// built or updated must not be listed, unless its current bounds are still within the boxes of all nodes
/// above it. An object that is not listed counts as visible. A walk relies on these rules: a hierarchy that
/// breaks one hides visible objects. [`first_misplaced`] checks the rules.
///
/// A walk goes down at most 128 levels, since each level takes 3 to 4 KB of stack. What is further below
/// stays visible. Balanced trees have far fewer levels.
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
    /// Calls `each` with every direct child of a node and the child's box, relative to the scene's origin.
    /// `None` stands for the top of the hierarchy.
    fn for_each_child(&self, scene: &Scene, node: Option<usize>, each: &mut dyn FnMut(Child, Aabb));

    /// `Some` only for [`SceneHierarchy`], whose nodes have masks in a [`VisibleSet`]. `None` for every other
    /// implementation: its dropped objects are removed from the set one by one. The type has no name outside
    /// this module, so that no other implementation can set it:
    ///
    /// ```compile_fail
    /// use visibility_core::walk::{BoxHierarchy, Child, SceneHierarchy, sealed::OfScene};
    /// use visibility_core::{Aabb, Scene};
    /// struct Empty;
    /// impl BoxHierarchy for Empty {
    ///     const OF_SCENE: Option<OfScene> = SceneHierarchy::OF_SCENE;
    ///     fn for_each_child(&self, _: &Scene, _: Option<usize>, _: &mut dyn FnMut(Child, Aabb)) {}
    /// }
    /// ```
    #[doc(hidden)]
    const OF_SCENE: Option<sealed::OfScene> = None;

    /// Calls `each` with the direct children of a node (`None`: the top of the hierarchy) in blocks of at
    /// most 64. The default implementation copies the children that [`for_each_child`](Self::for_each_child)
    /// lists, 28 bytes per child, and does not call `each` for a node without children. A hierarchy that
    /// stores its boxes in such blocks should override it.
    fn for_each_block(&self, scene: &Scene, node: Option<usize>, mut each: impl FnMut(&Block<'_>))
    where
        Self: Sized,
    {
        let (mut boxes, mut children, mut count) = (Boxes64::EMPTY, [Child::Node(usize::MAX); FAN_OUT], 0);
        self.for_each_child(scene, node, &mut |child, bounds| {
            if count == FAN_OUT {
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

/// Greatest number of levels of a hierarchy other than the scene's own that a walk goes down: half a megabyte
/// of stack, which also WebAssembly has.
const MAX_LEVELS: u32 = 128;

mod sealed {
    #[derive(Debug)]
    pub struct OfScene;
}

/// Tells at compile time whether a hierarchy is the [`SceneHierarchy`].
pub(crate) trait IsOfScene {
    const IS_OF_SCENE: bool;
}

impl<H: BoxHierarchy> IsOfScene for H {
    const IS_OF_SCENE: bool = H::OF_SCENE.is_some();
}

/// The hierarchy that every [`Scene`] maintains over the objects that can be culled. Objects that are never
/// culled are not part of it.
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
    const OF_SCENE: Option<sealed::OfScene> = Some(sealed::OfScene);

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
        // There is no box for the root of an empty tree, whose number is `NONE`: `each` is then not called.
        if let (Some(boxes), Some(&level)) = (tree.bounds.get(node), tree.levels.get(node)) {
            each(&Block { boxes, children: Children::Node { tree, node, leaf: level == 0 } });
        }
    }
}

/// Iterates over the objects that are never culled, which [`SceneHierarchy`] does not hold, in blocks of at
/// most 64. Each block is a [leaf](Block::leaf) with a number and lanes, as a leaf of the hierarchy is.
///
/// ```
/// use visibility_core::{walk::unculled_blocks, Aabb, Object, Scene};
/// let mut scene = Scene::new();
/// scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
/// scene.insert(Object { never_cull: true, ..Object::new(Aabb::from_arrays([0.0; 3], [9.0; 3])) });
/// assert!(unculled_blocks(&scene).map(|block| block.boxes().hull().max.x).eq([9.0]));
/// ```
pub fn unculled_blocks(scene: &Scene) -> impl Iterator<Item = Block<'_>> {
    let tree = scene.tree();
    tree.unculled.iter().map(|&leaf| {
        let node = leaf as usize;
        Block { boxes: &tree.bounds[node], children: Children::Node { tree, node, leaf: true } }
    })
}

/// A block of at most 64 sibling boxes of a hierarchy, one per lane.
#[derive(Debug)]
pub struct Block<'a> {
    boxes: &'a Boxes64,
    children: Children<'a>,
}

#[derive(Debug)]
enum Children<'a> {
    /// A node of the scene's own hierarchy: its tree, its index there, and whether it is a leaf, whose lanes
    /// are objects (`leaf` true), or an inner node, whose lanes are nodes (false). Data other than boxes is
    /// fetched from the tree on demand, since most tests need none.
    Node { tree: &'a Tree, node: usize, leaf: bool },
    /// Children listed by a hierarchy other than the scene's own, copied for this block; lane i holds element
    /// i.
    Listed(&'a [Child]),
}

impl Block<'_> {
    /// Returns the boxes of the children relative to the scene's origin, one per lane; [`Aabb::EMPTY`] in
    /// lanes without a child.
    #[inline(always)]
    pub fn boxes(&self) -> &Boxes64 {
        self.boxes
    }

    /// Returns a mask of the lanes that hold a child; bit i stands for lane i.
    pub fn occupied(&self) -> u64 {
        match self.children {
            Children::Node { tree, node, .. } => tree.occupied[node],
            Children::Listed(children) => first_lanes(children.len()),
        }
    }

    /// Returns a mask of the lanes that may hold an occluder; bit i stands for lane i. In a leaf of the
    /// scene's own hierarchy these are exactly the objects that [can occlude](Scene::can_occlude); in its
    /// inner nodes the mask is 0. In blocks of other hierarchies every occupied lane is set.
    pub fn occluders(&self) -> u64 {
        match self.children {
            Children::Node { tree, node, .. } => tree.occluding(node),
            Children::Listed(children) => first_lanes(children.len()),
        }
    }

    /// Returns the child in a lane. For a lane that is not [occupied](Self::occupied), the result is
    /// meaningless.
    #[inline(always)]
    pub fn child(&self, lane: usize) -> Child {
        match self.children {
            Children::Node { tree, node, leaf: true } => Child::Object(tree.ids[node][lane % FAN_OUT]),
            Children::Node { tree, node, leaf: false } => Child::Node(tree.child(node, lane % FAN_OUT)),
            Children::Listed(children) => children.get(lane).copied().unwrap_or(Child::Node(usize::MAX)),
        }
    }

    /// Returns the number of this leaf among the nodes of the scene's own hierarchy and the object in each
    /// lane, for cullers that keep data per leaf. Ids in lanes that are not occupied are meaningless. `None`
    /// for inner nodes and for blocks of other hierarchies.
    #[inline(always)]
    pub fn leaf(&self) -> Option<(usize, &[ObjectId; FAN_OUT])> {
        match self.children {
            Children::Node { tree, node, leaf: true } => Some((node, &tree.ids[node])),
            _ => None,
        }
    }

    /// Returns the lanes of `mask` that hold objects rather than nodes, as a mask with bit i for lane i.
    /// `mask` must contain occupied lanes only.
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

/// Returns a mask with the lowest `count` bits set; all 64 bits for counts of 64 and more.
fn first_lanes(count: usize) -> u64 {
    u64::MAX.checked_shr((FAN_OUT - count.min(FAN_OUT)) as u32).unwrap_or(0)
}

/// A walk in progress over one hierarchy, removing objects from one [`VisibleSet`]. Candidates are the
/// objects that are still in the set, and the nodes that may contain such objects. The walk ends with
/// [`finish`](Self::finish).
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
#[derive(Debug)]
pub struct Walk<'a, H> {
    scene: &'a Scene,
    hierarchy: &'a H,
    visible: &'a mut VisibleSet,
    /// True if the set has masks for the scene's present layout; the candidates are then the objects of
    /// these masks. False if the layout has changed since the set was filled; then every object on the
    /// set's layers is a candidate.
    is_current: bool,
    /// Number of nodes above the node that is visited, in a hierarchy other than the scene's own.
    level: u32,
    /// Work counters so far. [`visit`](Self::visit) and [`accept`](Self::accept) count nodes, accepted
    /// subtrees and kept objects; the culler itself adds to `tests`.
    pub stats: CullStats,
}

impl<'a, H: BoxHierarchy> Walk<'a, H> {
    /// Begins a walk that removes objects from `visible`. If the layout of the scene has changed since the
    /// set was filled, every object on the set's layers becomes a candidate again.
    pub fn new(scene: &'a Scene, hierarchy: &'a H, visible: &'a mut VisibleSet) -> Self {
        visible.prepare(scene);
        if !H::IS_OF_SCENE {
            visible.begin_drops(scene);
        }
        let is_current = visible.is_current(scene);
        Self { scene, hierarchy, visible, is_current, level: 0, stats: CullStats::default() }
    }

    /// Returns the scene whose objects are walked.
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// Returns whether a second visit of a node has only the candidates that the first visit kept. False if
    /// the set was filled for another layout of the scene: each visit then begins with all objects on the
    /// set's layers.
    pub(crate) fn is_current(&self) -> bool {
        self.is_current
    }

    /// Returns the number of leaves with candidates in and below a node that this walk has neither visited
    /// nor accepted. 1 for every node of another hierarchy than the scene's own.
    pub(crate) fn leaves_below(&self, node: usize) -> u32 {
        if H::IS_OF_SCENE { self.visible.leaves_below(self.is_current, self.scene, node) } else { 1 }
    }

    /// Calls `test` with each block of children of `node` (`None`: the top of the hierarchy) and a mask of
    /// the candidates among the children; bit i stands for lane i. `test` returns the mask of the children to
    /// keep; all other candidates are removed, with everything below them. A culler must call `visit` or
    /// [`accept`](Self::accept) for every node of the scene's own hierarchy that it keeps.
    ///
    /// Returns whether any candidate is left below the node, so that the caller can drop an empty child. For
    /// hierarchies other than the scene's own the result is true if the node has any child. It is also true,
    /// without a call of `test`, for a node that is 128 levels below the top or more.
    #[inline(always)]
    pub fn visit(
        &mut self,
        node: Option<usize>,
        mut test: impl FnMut(&mut Self, &Block<'_>, u64) -> u64,
    ) -> bool {
        let mut any = false;
        let (hierarchy, scene) = (self.hierarchy, self.scene);
        if !H::IS_OF_SCENE {
            if self.level >= MAX_LEVELS {
                return true;
            }
            self.level += 1;
        }
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
                    lanes(candidates & !mask).for_each(|lane| self.drop_below(children[lane], 0));
                    any = true;
                }
            }
            self.stats.visible += u64::from(block.objects(mask).count_ones());
            any |= mask != 0;
        });
        if !H::IS_OF_SCENE {
            self.level -= 1;
        }
        any
    }

    /// Removes `child` and everything below it from the visible set, for cullers that decide on a child after
    /// they have seen its siblings. `child` must be in lane `lane` of `node` (`None`: the top of the
    /// hierarchy): in slot `lane`, from 0 to 63, of the block that [`visit`](Self::visit) passes to its test.
    /// An earlier `visit` of the node in this walk must have kept the child. The child itself must not have
    /// been visited or accepted in this walk.
    pub fn drop_child(&mut self, node: Option<usize>, lane: usize, child: Child) {
        self.stats.visible -= u64::from(matches!(child, Child::Object(_)));
        if !H::IS_OF_SCENE {
            return self.drop_below(child, 0);
        }
        let (hierarchy, scene) = (self.hierarchy, self.scene);
        hierarchy.for_each_block(scene, node, |block| {
            if let Children::Node { node, .. } = block.children {
                self.visible.drop_lane(node, lane);
            }
        });
    }

    /// Keeps all candidates below the node `child` without testing them. Returns whether there are any;
    /// always true for hierarchies other than the scene's own.
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

    /// Returns a mask of the candidates among children listed by another hierarchy than the scene's own; bit
    /// i stands for `children[i]`. Nodes are always candidates; objects are candidates if they are in the
    /// set.
    fn listed_candidates(&self, children: &[Child]) -> u64 {
        let is_candidate = |child: &Child| match *child {
            Child::Node(_) => true,
            Child::Object(id) => self.visible.contains(self.scene, id),
        };
        (0..).zip(children).fold(0, |mask, (lane, child)| mask | u64::from(is_candidate(child)) << lane)
    }

    /// Marks an object, or all objects below a node of a hierarchy other than the scene's own, for removal at
    /// the end of the walk. Objects [`MAX_LEVELS`] below the node stay. `level` is the number of levels that
    /// `child` is below the child that is dropped.
    fn drop_below(&mut self, child: Child, level: u32) {
        match child {
            // An unknown id is ignored: its index may belong to another object by now.
            Child::Object(id) if self.scene.contains(id) => self.visible.drop_later(id),
            Child::Object(_) => {}
            Child::Node(_) if level >= MAX_LEVELS => {}
            Child::Node(node) => {
                let (hierarchy, scene) = (self.hierarchy, self.scene);
                hierarchy
                    .for_each_child(scene, Some(node), &mut |child, _| self.drop_below(child, level + 1));
            }
        }
    }

    /// Ends the walk and makes its removals take effect in the set. Returns the counters; their `visible` is
    /// the number of objects left in the set, including objects that are never culled.
    pub fn finish(mut self) -> CullStats {
        if H::IS_OF_SCENE {
            self.visible.use_masks();
            self.stats.visible += self.visible.unculled_count(self.scene);
        } else {
            self.stats.visible = self.visible.drop_now(self.scene);
        }
        self.stats
    }
}
