//! The driver: chooses occluders, walks a hierarchy of boxes from front to back, and leaves out what a map
//! says is hidden.
//!
//! A node that is hidden prunes all below it; one that nothing can hide is taken whole; only what lies
//! between is looked into (Cohen-Or et al., "A Survey of Visibility for Walkthrough Applications", 2003,
//! section 6: all image-space methods "place a hierarchy on the scene").

use super::selection::{Candidate, choose, distance_key};
use super::{Occlusion, OcclusionMap, Selection};
use crate::scene::{Boxes64, lanes};
use crate::walk::{Block, BoxHierarchy, Child, SceneHierarchy, Walk};
use crate::{
    Accuracy, CullStats, Culler, ObjectId, Scene, View, VisibleSet,
    scene::SceneCursor,
    view::{Eye, ViewPlanes},
};
use alloc::vec::Vec;
use smallvec::SmallVec;

/// Culls what a map finds hidden behind the scene's occluders.
///
/// Occluders are the objects that are flagged as such and have a mesh ([`Scene::set_mesh`],
/// [`Scene::prepare_occluders`]). Put it after the frustum in a pipeline: only what is still in the set is
/// chosen from, and tested.
///
/// ```
/// # use visibility_core::{
/// #     glam::{Affine3A, DVec3}, occlusion::Occlusion, Aabb, Accuracy, OccluderMesh,
/// #     OcclusionMap, View,
/// # };
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
/// use visibility_core::{occlusion::Selection, FrustumCuller, OcclusionCuller, Pipeline};
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
        }
    }

    /// Chooses occluders otherwise.
    pub fn with_selection(self, selection: Selection) -> Self {
        Self { selection, ..self }
    }

    /// Adds no more than so many triangles of occluders a frame, as the map [counts](OcclusionMap::cost)
    /// them.
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
    fn add_occluders(&mut self, scene: &Scene, eye: &Eye, clip_planes: &ViewPlanes, visible: &VisibleSet) {
        if self.selection == Selection::Ordered {
            return self.add_in_order(scene, clip_planes, visible);
        }
        self.candidates.clear();
        visible.for_each_occluder(scene, |id| {
            let candidate = Candidate::new(scene, id, eye, clip_planes, |mesh| self.map.cost(mesh));
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

    /// Fills the map with the first of the candidates. One that does not fit is passed over, since a smaller
    /// one after it may.
    fn add_in_order(&mut self, scene: &Scene, clip_planes: &ViewPlanes, visible: &VisibleSet) {
        let mut left = self.budget;
        for id in visible.iter(scene) {
            if left == 0 {
                return;
            }
            let Some((mesh, transform)) = scene.occluder(id) else { continue };
            let cost = self.map.cost(mesh);
            if cost <= left && mesh.is_inside(clip_planes, transform) {
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
        let clip_planes = view.clip_planes_from(scene.origin());
        if self.selection != Selection::Interleaved {
            self.add_occluders(scene, &eye, &clip_planes, visible);
        }
        // Also where nothing was added: it is now that a map learns what this frame begins with.
        self.map.flush();
        let mut frame = Frame {
            map: &mut self.map,
            eye,
            clip_planes: &clip_planes,
            left: if self.selection == Selection::Interleaved { self.budget } else { 0 },
        };
        let mut walk = Walk::new(scene, &self.hierarchy, visible);
        frame.visit(&mut walk, None);
        let stats = walk.finish();
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

/// What the walk of one frame tests against.
struct Frame<'a, M> {
    map: &'a mut M,
    eye: Eye,
    clip_planes: &'a ViewPlanes,
    /// Triangles that may still be added on the way.
    left: usize,
}

impl<M: OcclusionMap> Frame<'_, M> {
    /// Goes through a node that may be seen. Whether anything below it is left.
    fn visit<H: BoxHierarchy>(&mut self, walk: &mut Walk<H>, node: Option<usize>) -> bool {
        walk.visit(node, |walk, block, candidates| {
            walk.stats.tests += u64::from(candidates.count_ones());
            let answer = self.map.test_64(block.boxes(), candidates);
            let mut mask = candidates & !answer.hidden;
            let objects = block.objects(candidates);
            // Order matters only while the map still grows.
            let order = if self.left > 0 {
                nearest_first(&self.eye, block.boxes(), mask & !objects)
            } else {
                lanes_of(mask & !objects)
            };
            for lane in order {
                let lane = usize::from(lane);
                let Child::Node(child) = block.child(lane) else { continue };
                let any = if answer.visible >> lane & 1 != 0 && self.left == 0 {
                    walk.accept(child)
                } else {
                    // What was added since the node was tested may hide this one.
                    walk.stats.tests += u64::from(self.left > 0);
                    let hidden =
                        self.left > 0 && self.map.test(&block.boxes().get(lane)) == Occlusion::Hidden;
                    !hidden && self.visit(walk, Some(child))
                };
                mask &= !(u64::from(!any) << lane);
            }
            if self.left > 0 && self.add_seen(walk.scene(), block, mask & objects) {
                // What this block has added may hide other objects in it.
                walk.stats.tests += u64::from((mask & objects).count_ones());
                mask &= !(self.map.test_64(block.boxes(), mask & objects).hidden & objects);
            }
            mask
        })
    }

    /// Adds the occluders among the visible objects of a block, nearest first, while the budget lasts.
    /// Whether there was any.
    fn add_seen(&mut self, scene: &Scene, block: &Block<'_>, mask: u64) -> bool {
        let before = self.left;
        for lane in nearest_first(&self.eye, block.boxes(), mask & block.occluders()) {
            let Child::Object(id) = block.child(usize::from(lane)) else { continue };
            let Some((mesh, transform)) = scene.occluder(id) else { continue };
            let cost = self.map.cost(mesh);
            if cost <= self.left && mesh.is_inside(self.clip_planes, transform) {
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
        lanes(mask).map(|lane| (distance_key(eye, &boxes.get(lane)), lane as u8)).collect();
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    order.into_iter().map(|(_, lane)| lane).collect()
}
