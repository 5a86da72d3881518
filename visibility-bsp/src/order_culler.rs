//! View volume culling with a scene's BSP tree, and the objects in the order of depth.

use crate::scene_tree::{SceneTree, Standing};
use crate::tree::{Fragments, Order, Walk};
use crate::volume::Volume;
use alloc::vec::Vec;
use core::borrow::Borrow;
use visibility_core::{Aabb, Accuracy, CullStats, Culler, Scene, View, VisibleSet};

/// Hides objects of which no polygon is in view, and puts the others in order: by their nearest part, front to back.
///
/// Subtrees outside the view volume are not entered. The order is that of the first fragment of each object on the walk; objects that
/// the tree does not know as they are come last. Fragments in full order are had from the [tree](SceneTree::tree) itself.
///
/// Costs some tens of nanoseconds for each node and fragment in view.
///
/// ```
/// use visibility_bsp::{BspOrder, SceneTree};
/// use visibility_core::{Aabb, Pipeline, Pose, Scene, View, VisibleSet, glam::{DVec3, Vec3}};
/// let mut scene = Scene::new();
/// let [far, near] = [8.0, 4.0].map(|x: f32| {
///     let id = scene.insert(Aabb::from_arrays([x, 0.0, 0.0], [x, 1.0, 1.0]));
///     scene.set_triangles(id, [[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|[y, z]| Vec3::new(x, y, z))]).unwrap();
///     id
/// });
/// let tree = SceneTree::new(&scene)?;
/// let mut pipeline = Pipeline::new().with(BspOrder::new(std::sync::Arc::new(tree)));
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let mut visible = VisibleSet::new();
/// pipeline.cull(&scene, &View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY)?, &mut visible);
/// assert_eq!(visible.iter(&scene).collect::<Vec<_>>(), [near, far]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct BspOrder<S> {
    shared: S,
    standing: Standing,
    order: Order,
    /// By index: when the object was first met.
    ranks: Vec<u32>,
}

const NOT_MET: u32 = u32::MAX;

impl<S: Borrow<SceneTree>> BspOrder<S> {
    /// For one view.
    pub fn new(shared: S) -> Self {
        Self { shared, standing: Standing::default(), order: Order::new(), ranks: Vec::new() }
    }
}

impl<S: Borrow<SceneTree>> Culler for BspOrder<S> {
    fn name(&self) -> &str {
        "bsp-order"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let Self { shared, standing, order, ranks } = self;
        let shared = (*shared).borrow();
        standing.begin(shared, scene);
        ranks.clear();
        ranks.resize(scene.index_limit(), NOT_MET);
        let mut frame =
            Frame { volume: Volume::new(view, scene), ranks, met: 0, stats: CullStats::default() };
        shared.tree().walk(view.eye(scene.origin()), order, &mut frame);
        let mut stats = frame.stats;
        let kept =
            visible.retain(scene, |id, _| ranks[id.index()] != NOT_MET || !standing.is_known(shared, id));
        stats.visible = kept.visible;
        visible.sort_by_key(scene, |id| {
            if standing.is_current(id.index() as u32) { ranks[id.index()] } else { NOT_MET }
        });
        stats
    }
}

struct Frame<'a> {
    volume: Volume,
    ranks: &'a mut [u32],
    met: u32,
    stats: CullStats,
}

impl Walk for Frame<'_> {
    fn enter(&mut self, bounds: &Aabb) -> bool {
        self.stats.nodes += 1;
        !self.volume.is_outside(bounds)
    }

    fn visit(&mut self, fragments: Fragments<'_>) {
        for fragment in fragments {
            self.stats.tests += 1;
            // An object that was removed from the scene may be in the tree still.
            let Some(rank) = self.ranks.get_mut(fragment.owner() as usize) else { continue };
            if *rank == NOT_MET && !self.volume.is_polygon_outside(fragment.vertices()) {
                *rank = self.met;
                self.met += 1;
            }
        }
    }
}
