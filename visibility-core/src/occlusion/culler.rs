//! The driver: chooses occluders, walks a hierarchy of boxes from front to back, and leaves out what a map says is hidden.
//!
//! A node that is hidden prunes all below it; one that nothing can hide is taken whole; only what lies between is looked into
//! (Cohen-Or et al., "A Survey of Visibility for Walkthrough Applications", 2003, section 6: all image-space methods "place a hierarchy on the scene").

use super::selection::{Candidate, choose, is_whole};
use super::{BoxHierarchy, Child, Occlusion, OcclusionMap, SceneHierarchy, Selection};
use crate::scene::{Boxes64, NONE, lanes};
use crate::{
    Aabb, Accuracy, CullStats, Culler, Eye, ObjectId, Scene, SceneCursor, View, ViewPlanes, VisibleSet,
};
use alloc::vec::Vec;
use smallvec::SmallVec;

/// Culls what a map finds hidden behind the scene's occluders.
///
/// Occluders are the objects that are flagged as such and have a mesh ([`Scene::set_mesh`], [`Scene::prepare_occluders`]). Put it after
/// the frustum in a pipeline: only what is still in the set is chosen from, and tested.
///
/// ```
/// # use visibility_core::{glam::{Affine3A, DVec3}, Aabb, Accuracy, Occlusion, OccluderMesh, OcclusionMap, View};
/// # struct Blank;
/// # impl OcclusionMap for Blank {
/// #     fn name(&self) -> &str { "blank" }
/// #     fn accuracy(&self) -> Accuracy { Accuracy::Conservative }
/// #     fn begin(&mut self, _: &View, _: DVec3) {}
/// #     fn add(&mut self, _: &OccluderMesh, _: &Affine3A) {}
/// #     fn flush(&mut self) {}
/// #     fn test(&self, _: &Aabb) -> Occlusion { Occlusion::Partial }
/// # }
/// # let map = Blank;
/// use visibility_core::{FrustumCuller, OcclusionCuller, Pipeline, Selection};
/// let culler = OcclusionCuller::new(map).with_selection(Selection::LastVisible).with_budget(4096);
/// let pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
/// # let _ = pipeline;
/// ```
#[derive(Clone, Debug)]
pub struct OcclusionCuller<M, H = SceneHierarchy> {
    map: M,
    hierarchy: H,
    selection: Selection,
    budget: usize,
    candidates: Vec<Candidate>,
    /// The visible occluders of the last frame, ascending, if they are to be preferred.
    last: Vec<ObjectId>,
    /// The scene of the last frame, which `last` and what the map remembers are of.
    scene: SceneCursor,
    /// By object index, what a walk of a foreign hierarchy found hidden.
    hidden: Vec<u64>,
    /// What a walk of a foreign hierarchy has still to visit.
    queue: Vec<(f32, Child, Aabb)>,
}

impl<M: OcclusionMap> OcclusionCuller<M> {
    /// Walks the scene's own hierarchy. Occluders by solid angle, 8,192 triangles of them.
    pub fn new(map: M) -> Self {
        Self::over(map, SceneHierarchy)
    }
}

impl<M: OcclusionMap, H: BoxHierarchy> OcclusionCuller<M, H> {
    /// Walks another hierarchy.
    pub fn over(map: M, hierarchy: H) -> Self {
        Self {
            map,
            hierarchy,
            selection: Selection::default(),
            budget: 8192,
            candidates: Vec::new(),
            last: Vec::new(),
            scene: SceneCursor::START,
            hidden: Vec::new(),
            queue: Vec::new(),
        }
    }

    /// Chooses occluders otherwise.
    pub fn with_selection(self, selection: Selection) -> Self {
        Self { selection, ..self }
    }

    /// Adds no more than so many triangles of occluders a frame, as the map [counts](OcclusionMap::cost) them.
    pub fn with_budget(self, triangles: usize) -> Self {
        Self { budget: triangles, ..self }
    }

    /// The map, as the last frame left it.
    pub fn map(&self) -> &M {
        &self.map
    }

    /// The map, to change its settings.
    pub fn map_mut(&mut self) -> &mut M {
        &mut self.map
    }

    /// The hierarchy, to bring it up to date.
    pub fn hierarchy_mut(&mut self) -> &mut H {
        &mut self.hierarchy
    }

    /// Fills the map with the best of the candidates.
    fn add_occluders(&mut self, scene: &Scene, eye: &Eye, cuts: &ViewPlanes, visible: &VisibleSet) {
        if self.selection == Selection::Ordered {
            return self.add_in_order(scene, cuts, visible);
        }
        self.candidates.clear();
        visible.for_each_occluder(scene, |id| {
            let candidate = Candidate::new(scene, id, eye, cuts, |mesh| self.map.cost(mesh));
            self.candidates
                .extend(candidate.map(|c| Candidate { seen: self.last.binary_search(&id).is_ok(), ..c }));
        });
        choose(&mut self.candidates, self.budget, self.selection == Selection::Nearest);
        for candidate in &self.candidates {
            if let Some((mesh, transform)) = scene.occluder(candidate.id) {
                self.map.add(mesh, transform);
            }
        }
    }

    /// Fills the map with the first of the candidates. One that does not fit is passed over, since a smaller one after it may.
    fn add_in_order(&mut self, scene: &Scene, cuts: &ViewPlanes, visible: &VisibleSet) {
        let mut left = self.budget;
        for id in visible.iter(scene) {
            if left == 0 {
                return;
            }
            let Some((mesh, transform)) = scene.occluder(id) else { continue };
            let cost = self.map.cost(mesh);
            if cost <= left && is_whole(mesh, transform, cuts) {
                left -= cost;
                self.map.add(mesh, transform);
            }
        }
    }
}

impl<M: OcclusionMap, H: BoxHierarchy> Culler for OcclusionCuller<M, H> {
    fn name(&self) -> &str {
        self.map.name()
    }

    fn accuracy(&self) -> Accuracy {
        self.map.accuracy()
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        visible.prepare(scene);
        if !self.scene.is_in(scene) {
            self.reset();
        }
        self.scene = SceneCursor::at(scene);
        self.map.begin(view, scene.origin());
        let eye = view.eye(scene.origin());
        let cuts = view.clip_planes_from(scene.origin());
        if self.selection != Selection::Interleaved {
            self.add_occluders(scene, &eye, &cuts, visible);
        }
        // Also where nothing was added: it is now that a map learns what this frame begins with.
        self.map.flush();
        let mut stats = if self.hierarchy.is_of_scene() {
            let mut walk = Walk {
                map: &mut self.map,
                scene,
                eye,
                cuts: &cuts,
                visible: &mut *visible,
                left: if self.selection == Selection::Interleaved { self.budget } else { 0 },
                stats: CullStats::default(),
            };
            let root = scene.tree().root;
            if root != NONE {
                walk.visit(root as usize);
            }
            let stats = walk.stats;
            visible.commit();
            stats
        } else {
            self.walk_foreign(scene, &eye, &cuts, visible)
        };
        stats.visible += visible.unculled_count(scene);
        if self.selection == Selection::LastVisible {
            self.last.clear();
            visible.for_each_occluder(scene, |id| self.last.push(id));
            self.last.sort_unstable();
        }
        stats
    }

    fn reset(&mut self) {
        self.last.clear();
        self.map.reset();
    }
}

/// A walk of the scene's own hierarchy, 64 boxes at a time.
struct Walk<'a, M> {
    map: &'a mut M,
    scene: &'a Scene,
    eye: Eye,
    cuts: &'a ViewPlanes,
    visible: &'a mut VisibleSet,
    /// Triangles that may still be added on the way.
    left: usize,
    stats: CullStats,
}

impl<M: OcclusionMap> Walk<'_, M> {
    /// Goes through a node that may be seen. Whether anything below it is left.
    fn visit(&mut self, node: usize) -> bool {
        let tree = self.scene.tree();
        let candidates = self.visible.mask(self.scene, node);
        self.stats.nodes += 1;
        self.stats.tests += u64::from(candidates.count_ones());
        let boxes = &tree.bounds[node];
        if tree.levels[node] == 0 {
            let mut mask = candidates & !self.map.test_64(boxes, candidates).hidden;
            if self.left > 0 && self.add_seen(node, mask) {
                // What this leaf has added may hide others in it.
                self.stats.tests += u64::from(mask.count_ones());
                mask &= !self.map.test_64(boxes, mask).hidden;
            }
            self.visible.set_mask(node, mask);
            self.stats.visible += u64::from(mask.count_ones());
            return mask != 0;
        }
        let answer = self.map.test_64(boxes, candidates);
        let mut mask = candidates & !answer.hidden;
        // Order matters only while the map still grows.
        let order = if self.left > 0 { nearest_first(&self.eye, boxes, mask) } else { lanes_of(mask) };
        for lane in order {
            let lane = usize::from(lane);
            let child = tree.child(node, lane);
            let some = if answer.visible >> lane & 1 != 0 && self.left == 0 {
                let kept = self.visible.keep_below(self.scene, child);
                self.stats.whole += 1;
                self.stats.visible += kept;
                kept != 0
            } else {
                // What was added since the node was tested may hide this one.
                self.stats.tests += u64::from(self.left > 0);
                let hidden = self.left > 0 && self.map.test(&boxes.get(lane)) == Occlusion::Hidden;
                !hidden && self.visit(child)
            };
            if !some {
                mask &= !(1 << lane);
            }
        }
        self.visible.set_mask(node, mask);
        mask != 0
    }

    /// Adds the occluders among the visible objects of a leaf, nearest first, while the budget lasts. Whether there was any.
    fn add_seen(&mut self, leaf: usize, mask: u64) -> bool {
        let before = self.left;
        let tree = self.scene.tree();
        for lane in nearest_first(&self.eye, &tree.bounds[leaf], mask & tree.occluders[leaf]) {
            let Some((mesh, transform)) = self.scene.occluder(tree.ids[leaf][usize::from(lane)]) else {
                continue;
            };
            let cost = self.map.cost(mesh);
            if cost <= self.left && is_whole(mesh, transform, self.cuts) {
                self.left -= cost;
                self.map.add(mesh, transform);
            }
        }
        if self.left < before {
            self.map.flush();
        }
        self.left < before
    }
}

/// The lanes of a mask.
fn lanes_of(mask: u64) -> SmallVec<[u8; 64]> {
    lanes(mask).map(|lane| lane as u8).collect()
}

/// The lanes of a mask by the distance of their boxes.
fn nearest_first(eye: &Eye, boxes: &Boxes64, mask: u64) -> SmallVec<[u8; 64]> {
    let mut order: SmallVec<[(f32, u8); 64]> =
        lanes(mask).map(|lane| (nearness(eye, &boxes.get(lane)), lane as u8)).collect();
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    order.into_iter().map(|(_, lane)| lane).collect()
}

/// Grows with the distance of a box from the eye. Only an order: rounding does no harm.
pub(super) fn nearness(eye: &Eye, bounds: &Aabb) -> f32 {
    match eye {
        Eye::Point(eye) => {
            let eye = eye.as_vec3();
            eye.clamp(bounds.min, bounds.max.max(bounds.min)).distance_squared(eye)
        }
        Eye::Direction(along) => {
            let along = along.as_vec3();
            let nearest = glam::Vec3::select(along.cmpge(glam::Vec3::ZERO), bounds.min, bounds.max);
            nearest.dot(along)
        }
    }
}

impl<M: OcclusionMap, H: BoxHierarchy> OcclusionCuller<M, H> {
    /// A walk of another hierarchy, a box at a time. Objects that it finds hidden are taken out at the end; those that it does not list
    /// stay.
    fn walk_foreign(
        &mut self,
        scene: &Scene,
        eye: &Eye,
        cuts: &ViewPlanes,
        visible: &mut VisibleSet,
    ) -> CullStats {
        self.hidden.clear();
        self.hidden.resize(scene.index_limit().div_ceil(64), 0);
        let mut queue = core::mem::take(&mut self.queue);
        queue.clear();
        let mut stats = CullStats::default();
        let mut left = if self.selection == Selection::Interleaved { self.budget } else { 0 };
        self.push_children(scene, eye, None, &mut queue);
        while let Some((_, child, bounds)) = queue.pop() {
            stats.tests += 1;
            let answer = self.map.test(&bounds);
            match child {
                Child::Node(node) if answer == Occlusion::Hidden => self.hide_below(scene, node, &mut queue),
                Child::Node(_) if answer == Occlusion::Visible && left == 0 => stats.whole += 1,
                Child::Node(node) => {
                    stats.nodes += 1;
                    self.push_children(scene, eye, Some(node), &mut queue);
                }
                Child::Object(id) if answer == Occlusion::Hidden => self.hide(scene, id),
                Child::Object(id) if left > 0 && visible.contains(scene, id) => {
                    let occluder = scene.occluder(id).filter(|(mesh, transform)| {
                        self.map.cost(mesh) <= left && is_whole(mesh, transform, cuts)
                    });
                    if let Some((mesh, transform)) = occluder {
                        left -= self.map.cost(mesh);
                        self.map.add(mesh, transform);
                        self.map.flush();
                    }
                }
                Child::Object(_) => {}
            }
        }
        self.queue = queue;
        let hidden = &self.hidden;
        let is_hidden = |id: ObjectId| hidden[id.index() / 64] >> (id.index() % 64) & 1 != 0;
        let kept = visible.retain(scene, |id, _| !is_hidden(id));
        stats.visible = kept.visible - visible.unculled_count(scene);
        stats
    }

    /// Notes an object as hidden, unless it is gone: another may have its index now.
    fn hide(&mut self, scene: &Scene, id: ObjectId) {
        if !scene.contains(id) {
            return;
        }
        if let Some(word) = self.hidden.get_mut(id.index() / 64) {
            *word |= 1 << (id.index() % 64);
        }
    }

    /// Everything below a node is hidden with it. The queue serves as a stack above what it holds.
    fn hide_below(&mut self, scene: &Scene, node: usize, queue: &mut Vec<(f32, Child, Aabb)>) {
        let floor = queue.len();
        queue.push((0.0, Child::Node(node), Aabb::EMPTY));
        while queue.len() > floor {
            match queue.pop() {
                Some((_, Child::Node(node), _)) => {
                    self.hierarchy.for_each_child(scene, Some(node), &mut |child, bounds| {
                        queue.push((0.0, child, bounds));
                    });
                }
                Some((_, Child::Object(id), _)) => self.hide(scene, id),
                None => {}
            }
        }
    }

    /// Puts the children of a node on top of the stack, the nearest uppermost.
    fn push_children(
        &self,
        scene: &Scene,
        eye: &Eye,
        node: Option<usize>,
        queue: &mut Vec<(f32, Child, Aabb)>,
    ) {
        let first = queue.len();
        self.hierarchy.for_each_child(scene, node, &mut |child, bounds| {
            queue.push((nearness(eye, &bounds), child, bounds));
        });
        queue[first..].sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
    }
}
