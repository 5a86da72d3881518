//! View-volume culling with a scene's BSP tree, and front-to-back ordering of the objects.

use crate::scene_tree::{SceneTree, StaleObjects};
use crate::tree::{Fragments, Subtree, TraversalStack, TreeVisitor};
use crate::view_volume::ViewVolume;
use alloc::vec::Vec;
use core::borrow::Borrow;
use visibility_core::{Accuracy, CullStats, Culler, Scene, View, VisibleSet};

/// Removes objects without a polygon in view and sorts the others front to back, by their nearest fragment in
/// view.
///
/// The culler walks the tree front to back and ranks an object where the walk meets the object's first
/// fragment in view. The walk skips subtrees outside the view volume, and subtrees of a single object that
/// has its rank already. An object stays visible and comes last if it has no triangles, has a triangle that
/// is not in the tree, or has changed since the tree was last synchronized. For the full order of all
/// fragments, walk the [tree](SceneTree::tree) itself.
///
/// Costs some tens of nanoseconds per node in view whose subtree belongs to several objects. The walk stops
/// after 65,536 nodes, or the number given to [`with_nodes`](Self::with_nodes). Objects not reached by then
/// stay visible and come last.
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
    /// The tree of the scene's triangles, usually shared by the cullers of several views.
    shared: S,
    /// Objects that have changed since the tree was last synchronized with the scene; they stay visible.
    stale: StaleObjects,
    /// Stack of the walk through the BSP tree, kept between frames to avoid allocation.
    stack: TraversalStack,
    /// Maximum number of BSP nodes visited per frame.
    most: u64,
    /// By object index: rank in the front-to-back order from 0, [`NOT_MET`] for an object to be ranked that
    /// the walk has not reached, [`NONE`] for an object that gets no rank.
    ranks: Vec<u32>,
}

/// Rank value of an object that the walk has not reached, though it is in the incoming visible set and all
/// its triangles in the tree are up to date. The object is removed unless the walk was cut short by the node
/// limit.
const NOT_MET: u32 = u32::MAX;
/// Rank value of an object that is not in the incoming visible set, or whose triangles in the tree are
/// missing or out of date. Such objects are sorted last.
const NONE: u32 = u32::MAX - 1;

impl<S: Borrow<SceneTree>> BspOrderCuller<S> {
    /// Creates the culler of one view. `shared` is the tree itself or a shared pointer to it. Up to 65,536
    /// nodes are visited per frame.
    pub fn new(shared: S) -> Self {
        Self {
            shared,
            stale: StaleObjects::default(),
            stack: TraversalStack::new(),
            most: 1 << 16,
            ranks: Vec::new(),
        }
    }

    /// Returns a mutable reference to the tree, or to the pointer to it, that [`new`](Self::new) was given.
    /// Assign through it to use another tree. If this culler owns the tree, call [`sync`](SceneTree::sync) on
    /// it. The change takes effect in the next frame.
    pub fn shared_mut(&mut self) -> &mut S {
        &mut self.shared
    }

    /// Sets the maximum number of tree nodes visited per frame. Objects not reached within it stay visible
    /// and come last; 0 visits none.
    #[must_use]
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
        let Self { shared, stale, stack, most, ranks } = self;
        let shared = (*shared).borrow();
        stale.begin(shared, scene);
        ranks.clear();
        ranks.resize(scene.index_limit(), NONE);
        let mut left = 0;
        for id in visible.iter(scene).filter(|&id| stale.is_known(shared, id)) {
            ranks[id.index()] = NOT_MET;
            left += 1;
        }
        // The visible part of a polygon may lie beside all of its fragments, since cut points are rounded.
        let volume = ViewVolume::new(view, scene, shared.tree().cut_error());
        let mut frame = Frame { volume, ranks, met: 0, left, most: *most, stats: CullStats::default() };
        shared.tree().walk(view.eye(scene.origin()), stack, &mut frame);
        let mut stats = frame.stats;
        let cut_short = stats.nodes > *most;
        let kept = visible.retain(scene, |id, _| cut_short || ranks[id.index()] != NOT_MET);
        stats.visible = kept.visible;
        visible.sort_by_key(scene, |id| ranks[id.index()]);
        stats
    }
}

/// State of one frame's walk through the BSP tree.
struct Frame<'a> {
    volume: ViewVolume,
    /// By object index: rank in the front-to-back order from 0, [`NOT_MET`] or [`NONE`].
    ranks: &'a mut [u32],
    /// Number of objects ranked so far in this frame, which is also the next rank.
    met: u32,
    /// Number of objects still at [`NOT_MET`]; the walk ends at 0.
    left: u32,
    /// Maximum number of BSP nodes to visit.
    most: u64,
    stats: CullStats,
}

impl Frame<'_> {
    /// Tests whether the object with index `owner` is at [`NOT_MET`], so that its next fragment gives it a
    /// rank. False for an object that is ranked or gets no rank, and for an index beyond those of the scene,
    /// which may still occur in the tree.
    #[inline]
    fn is_wanted(&self, owner: u32) -> bool {
        self.ranks.get(owner as usize) == Some(&NOT_MET)
    }

    /// Gives the object with index `owner`, which must have no rank yet, the next rank.
    fn meet(&mut self, owner: u32) {
        self.ranks[owner as usize] = self.met;
        self.met += 1;
        self.left -= 1;
    }
}

impl TreeVisitor for Frame<'_> {
    /// Returns a mask of the planes of the view volume that have the whole subtree on their inner side; bit i
    /// stands for plane i. `inside` is the mask of the parent node; its bits stay set. `None` skips the
    /// subtree.
    ///
    /// A subtree is skipped if it is outside the view, if no object needs a rank any more, or if the limit of
    /// nodes is reached. A subtree of a single object is also skipped if that object needs no rank, and if
    /// the subtree is wholly in view; in the latter case this call gives the object the next rank.
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
            // The whole subtree is in view, and everything still to come is farther.
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

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::{DVec3, Vec3};
    use visibility_core::{Aabb, Pose, view::Window};

    /// A triangle of 1e8 m is cut in two, and the cut point of its long edge is rounded by some 1e-8 m. A
    /// corner of the image is on the triangle, and beyond both fragments.
    #[test]
    fn what_is_seen_beside_the_rounded_end_of_a_cut_is_in_view() {
        let mut random = visibility_testing::Random(15);
        let mut found = 0;
        for _ in 0..400 {
            let mut scene = Scene::new();
            let mut insert = |triangle: [Vec3; 3]| {
                let id = scene.insert(Aabb::from_points(triangle));
                scene.set_triangles(id, [triangle]).unwrap();
                id
            };

            // The long edge passes the origin within some metres.
            let [x, y] = [(); 2].map(|()| random.range(0.7e8, 1.3e8) as f32);
            let share = random.range(0.7, 1.3) as f32;
            let [a, b] = [Vec3::new(-x, y, 0.0), Vec3::new(share * x, -share * y, 0.0)];
            let low = Vec3::new(-1e8, -1e8, 0.0);
            let slope = random.range(0.5, 2.0) as f32;
            let shift = random.range(-1.0, 1.0) as f32;
            insert([[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]].map(|[t, z]| Vec3::new(t + shift, t * slope, z)));
            let large = insert([a, low, b]);
            let tree = SceneTree::new(&scene).unwrap();
            // The end of the cut on the long edge, and how far it is inside the triangle.
            let mut cut = DVec3::INFINITY;
            tree.tree().for_each_fragment(large.index() as u32, |fragment| {
                for &v in fragment.vertices() {
                    cut = if v.length() < cut.length() { v } else { cut };
                }
            });
            let [a, b] = [a, b].map(|p| p.as_dvec3());
            // In units of 2^-40 m.
            let whole = |x: f64| (x * 2f64.powi(40)) as i128;
            let area = (b.x - a.x) as i128 * (whole(cut.y) - whole(a.y))
                - (b.y - a.y) as i128 * (whole(cut.x) - whole(a.x));
            let inside = -(area as f64) * 2f64.powi(-40) / (b - a).length();
            if !(1e-9..1.0).contains(&inside) {
                continue;
            }
            found += 1;
            let corner = cut + DVec3::new(0.35, 0.35, 0.0) * inside;
            let middle = corner + DVec3::new(0.5, 0.5, 0.0);
            let pose = Pose::look_at(middle + DVec3::Z, middle, DVec3::Y);
            let view = View::orthographic(pose, Window::centered(0.5, 0.5), 0.1, 9.0).unwrap();
            let mut visible = VisibleSet::new();
            visible.fill(&scene, &view);
            BspOrderCuller::new(tree).cull(&scene, &view, &mut visible);
            assert!(visible.contains(&scene, large), "{inside} m beyond the cut at {cut}");
        }
        assert!(found > 20, "cuts inside their edge: {found}");
    }
}
