//! View volume culling with a scene's BSP tree, and the objects in the order of depth.

use crate::scene_tree::{SceneTree, StaleObjects};
use crate::tree::{Fragments, Order, Subtree, Walk};
use crate::view_volume::ViewVolume;
use alloc::vec::Vec;
use core::borrow::Borrow;
use visibility_core::{Accuracy, CullStats, Culler, Scene, View, VisibleSet};

/// Hides objects of which no polygon is in view, and puts the others in order: by their nearest part, front
/// to back.
///
/// Subtrees outside the view volume are not entered, nor those of one object that has its place already. The
/// order is that of the first fragment of each object on the walk; objects that the tree does not know as
/// they are come last. Fragments in full order are had from the [tree](SceneTree::tree) itself.
///
/// Costs some tens of nanoseconds for each node in view whose polygons are of several objects. After 65,536
/// nodes, or as many as [`with_nodes`](Self::with_nodes) says, it goes no further: objects that were not met
/// by then are visible, and come last.
///
/// ```
/// use visibility_bsp::{BspOrderCuller, SceneTree};
/// use visibility_core::{glam::{DVec3, Vec3}, Aabb, Pipeline, Pose, Scene, View, VisibleSet};
/// let mut scene = Scene::new();
/// let [far, near] = [8.0, 4.0].map(|x: f32| {
///     let id = scene.insert(Aabb::from_arrays([x, 0.0, 0.0], [x, 1.0, 1.0]));
///     let triangle = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|[y, z]| Vec3::new(x, y, z));
///     scene.set_triangles(id, [triangle]).unwrap();
///     id
/// });
/// let tree = SceneTree::new(&scene)?;
/// let mut pipeline = Pipeline::new().with(BspOrderCuller::new(std::sync::Arc::new(tree)));
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let mut visible = VisibleSet::new();
/// pipeline.cull(&scene, &View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY)?, &mut visible);
/// assert_eq!(visible.iter(&scene).collect::<Vec<_>>(), [near, far]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct BspOrderCuller<S> {
    shared: S,
    stale: StaleObjects,
    order: Order,
    most: u64,
    /// By index: when the object was first met, of those that matter.
    ranks: Vec<u32>,
}

const NOT_MET: u32 = u32::MAX;
/// Not a candidate, or none that the tree knows as it is: it comes last.
const NONE: u32 = u32::MAX - 1;

impl<S: Borrow<SceneTree>> BspOrderCuller<S> {
    /// For one view.
    pub fn new(shared: S) -> Self {
        Self { shared, stale: StaleObjects::default(), order: Order::new(), most: 1 << 16, ranks: Vec::new() }
    }

    /// The tree, to replace it, or to bring it up to date if it is this culler's own.
    pub fn shared_mut(&mut self) -> &mut S {
        &mut self.shared
    }

    /// Looks at no more nodes of the tree than so many.
    pub fn with_nodes(self, most: u64) -> Self {
        Self { most, ..self }
    }
}

impl<S: Borrow<SceneTree>> Culler for BspOrderCuller<S> {
    fn name(&self) -> &str {
        "bsp-order"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let Self { shared, stale, order, most, ranks } = self;
        let shared = (*shared).borrow();
        stale.begin(shared, scene);
        ranks.clear();
        ranks.resize(scene.index_limit(), NONE);
        let mut left = 0;
        for id in visible.iter(scene).filter(|&id| stale.is_known(shared, id)) {
            ranks[id.index()] = NOT_MET;
            left += 1;
        }
        let volume = ViewVolume::new(view, scene);
        let mut frame = Frame { volume, ranks, met: 0, left, most: *most, stats: CullStats::default() };
        shared.tree().walk(view.eye(scene.origin()), order, &mut frame);
        let mut stats = frame.stats;
        let cut_short = stats.nodes > *most;
        let kept = visible.retain(scene, |id, _| cut_short || ranks[id.index()] != NOT_MET);
        stats.visible = kept.visible;
        visible.sort_by_key(scene, |id| ranks[id.index()]);
        stats
    }
}

struct Frame<'a> {
    volume: ViewVolume,
    ranks: &'a mut [u32],
    met: u32,
    /// Candidates not met.
    left: u32,
    /// How many nodes may be looked at.
    most: u64,
    stats: CullStats,
}

impl Frame<'_> {
    /// Whether the rank of an owner is still to be found. One that was removed from the scene may be in the
    /// tree still.
    #[inline]
    fn is_wanted(&self, owner: u32) -> bool {
        self.ranks.get(owner as usize) == Some(&NOT_MET)
    }

    fn meet(&mut self, owner: u32) {
        self.ranks[owner as usize] = self.met;
        self.met += 1;
        self.left -= 1;
    }
}

impl Walk for Frame<'_> {
    /// The marks of a node are the planes that all of it is inside of.
    fn enter(&mut self, subtree: &Subtree, inside: u32) -> Option<u32> {
        if self.left == 0 || self.stats.nodes > self.most {
            return None;
        }
        self.stats.nodes += 1;
        if self.stats.nodes > self.most {
            return None;
        }
        let owner = subtree.owner();
        if owner.is_some_and(|owner| !self.is_wanted(owner)) {
            return None;
        }
        let inside = self.volume.inside_of(inside, subtree.bounds())?;
        match owner {
            // All of it is in view, and comes before all that is still to come.
            Some(owner) if self.volume.is_inside(inside) => {
                self.meet(owner);
                None
            }
            _ => Some(inside),
        }
    }

    fn visit(&mut self, fragments: Fragments<'_>, inside: u32) {
        let is_inside = self.volume.is_inside(inside);
        for fragment in fragments {
            let owner = fragment.owner();
            if !self.is_wanted(owner) {
                continue;
            }
            self.stats.tests += 1;
            if is_inside || !self.volume.is_polygon_outside(fragment.vertices()) {
                self.meet(owner);
            }
        }
    }
}
