//! Culling by a potentially visible set.

use super::{Pvs, Viewcells};
use crate::{
    Accuracy, CullStats, Culler, ObjectId, Scene, View, VisibleSet,
    culler::Lack,
    pvs::ViewcellId,
    scene::{Changes, SceneCursor},
    stamp::Stamp,
    view::Eye,
};
use alloc::vec::Vec;
use core::borrow::Borrow;
use glam::DVec3;

/// A PVS prepared for a scene: the PVS, the regions of its viewcells, and the targets of each object. Shared
/// by the cullers of all views.
#[derive(Clone, Debug)]
pub struct ScenePvs {
    pvs: Pvs,
    viewcells: Viewcells,
    /// Entry of each object, indexed by [`ObjectId::index`]: the object's id, or `None` if the object is
    /// never hidden, and the start of its target numbers in `targets`. Its target numbers end at the start
    /// of the next entry. A sentinel entry ends the list.
    objects: Vec<(Option<ObjectId>, u32)>,
    targets: Vec<u32>,
    /// The revision of the scene for which this value was made. Objects that change later are visible.
    cursor: SceneCursor,
    stamp: Stamp,
}

impl ScenePvs {
    /// Prepares a PVS for the present state of a scene. Each pair assigns a target to an object: the object's
    /// own target number, or the number of a cell that contains the object. An object is visible if any of
    /// its targets is visible. An object is never hidden if it has no target, has a target that is not below
    /// [`Pvs::target_count`], or changes in the scene later. Pairs of unknown objects are ignored. Time is
    /// that of sorting the pairs.
    pub fn new(
        scene: &Scene,
        pvs: Pvs,
        viewcells: Viewcells,
        pairs: impl IntoIterator<Item = (ObjectId, u32)>,
    ) -> Self {
        let mut pairs: Vec<_> = pairs.into_iter().filter(|(id, _)| scene.contains(*id)).collect();
        pairs.sort_unstable_by_key(|&(id, target)| (id.index(), target));
        let mut objects = Vec::with_capacity(scene.index_limit() + 1);
        let mut next = 0;
        for index in 0..scene.index_limit() {
            let start = next;
            while pairs.get(next).is_some_and(|(id, _)| id.index() == index) {
                next += 1;
            }
            let known = pairs[start..next].iter().all(|&(_, target)| (target as usize) < pvs.target_count());
            let id = pairs[start..next].first().map(|&(id, _)| id).filter(|_| known);
            objects.push((id, start as u32));
        }
        objects.push((None, next as u32));
        let targets = pairs.into_iter().map(|(_, target)| target).collect();
        Self { pvs, viewcells, objects, targets, cursor: SceneCursor::at(scene), stamp: Stamp::new() }
    }

    /// Returns the PVS.
    pub fn pvs(&self) -> &Pvs {
        &self.pvs
    }

    /// Returns the regions of the PVS's viewcells, in world space.
    pub fn viewcells(&self) -> &Viewcells {
        &self.viewcells
    }

    /// Returns the objects that may be hidden, by ascending index, each with its targets.
    pub(super) fn objects(&self) -> impl Iterator<Item = (ObjectId, &[u32])> {
        self.objects.windows(2).filter_map(|pair| {
            let targets = &self.targets[pair[0].1 as usize..pair[1].1 as usize];
            pair[0].0.map(|id| (id, targets))
        })
    }
}

/// Hides objects that the PVS excludes for all viewcells in which lines of sight of the view begin.
/// Conservative if the PVS is.
///
/// Lines of sight begin on the near plane, since nothing nearer is drawn. The near plane of an eye close to a
/// wall may reach through the wall into the next viewcell, and then the PVS of that viewcell counts too. Clip
/// planes and parallel views are handled by [`View::for_each_sight_start`]. If that function cannot decide,
/// or if lines of sight begin outside all viewcells, every object counts as visible.
///
/// A culler holds the state of one view. The [`ScenePvs`] is shared, by reference or by `Arc`. In a scene
/// other than the one that the [`ScenePvs`] was made for, a clone included, every object counts as visible.
///
/// ```
/// use visibility_core::{
///     pvs::{Pvs, PvsCuller, PvsTargets, ScenePvs, Viewcell, Viewcells}, Aabb, Pipeline, Pose,
///     Scene, View, VisibleSet,
/// };
/// use visibility_core::glam::DVec3;
/// let mut scene = Scene::new();
/// let [here, there] = [5.0, 15.0].map(|x| scene.insert(Aabb::from_arrays([x, 0.0, 0.0], [x + 1.0,
///     1.0, 1.0])));
/// // From the first room only the first object is seen.
/// let pvs = Pvs::new(PvsTargets::Objects, 2, &[vec![0], vec![0, 1]], |_| [])?;
/// let rooms = [0.0, 10.0].map(|x| Viewcell::from_box(DVec3::new(x, -5.0, -5.0), DVec3::new(x + 10.0,
///     5.0, 5.0)));
/// let shared = ScenePvs::new(&scene, pvs, Viewcells::new(rooms), [(here, 0), (there, 1)]);
/// let mut pipeline = Pipeline::new().with(PvsCuller::new(std::sync::Arc::new(shared)));
/// let pose = Pose::look_at(DVec3::new(1.0, 0.5, 0.5), DVec3::new(9.0, 0.5, 0.5), DVec3::Z);
/// let mut visible = VisibleSet::new();
/// pipeline.cull(&scene, &View::perspective(pose, 1.0, 1.5, 0.1, 100.0)?, &mut visible);
/// assert!(visible.contains(&scene, here) && !visible.contains(&scene, there));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct PvsCuller<S> {
    shared: S,
    /// Stamp of the [`ScenePvs`] from which the other fields were computed. Another stamp means that they
    /// are out of date.
    made_from: Stamp,
    /// Viewcell that contained the eye in the last frame. `None` if no viewcell did, and for parallel views.
    viewcell: Option<ViewcellId>,
    /// Viewcells in which the view's lines of sight began when `hidden` was last computed, ascending.
    entered: Vec<ViewcellId>,
    is_entered: bool,
    /// Scratch: the viewcells in which this frame's lines of sight begin.
    entering: Vec<ViewcellId>,
    reached: Vec<ViewcellId>,
    /// Union of the PVS rows of the viewcells in `entered`: bit `t % 64` of word `t / 64` stands for target
    /// `t`.
    seen: Vec<u64>,
    seen_from_one: Vec<u64>,
    /// For each object index, true if the object cannot be seen from any viewcell of `entered`. False if the
    /// object may be seen, or is never hidden.
    hidden: Vec<bool>,
    /// For each object index, true if the object has changed since the [`ScenePvs`] was made, so that the
    /// PVS no longer says anything about the object. False if the PVS still holds for the object.
    changed: Vec<bool>,
    /// True if it is unknown which objects changed since the [`ScenePvs`] was made: the scene is another
    /// one, or its change log overflowed. Every object then counts as visible. False if `changed` names
    /// exactly the changed objects.
    lost: bool,
    cursor: SceneCursor,
}

impl<S: Borrow<ScenePvs>> PvsCuller<S> {
    /// Makes a culler for one view, which has not culled a frame yet.
    pub fn new(shared: S) -> Self {
        Self {
            shared,
            made_from: Stamp::NONE,
            viewcell: None,
            entered: Vec::new(),
            is_entered: false,
            entering: Vec::new(),
            reached: Vec::new(),
            seen: Vec::new(),
            seen_from_one: Vec::new(),
            hidden: Vec::new(),
            changed: Vec::new(),
            lost: false,
            cursor: SceneCursor::START,
        }
    }

    /// Returns the shared [`ScenePvs`] for replacement. The next frame takes a new [`ScenePvs`] into account.
    pub fn shared_mut(&mut self) -> &mut S {
        &mut self.shared
    }

    /// Returns the viewcell of the eye in the last frame. `None` before the first frame, for an eye outside
    /// all viewcells, and for parallel views.
    pub fn viewcell(&self) -> Option<ViewcellId> {
        self.viewcell
    }

    /// Resets derived state if the [`ScenePvs`] was replaced, and marks the objects that have changed in the
    /// scene since the [`ScenePvs`] was made.
    fn follow(&mut self, scene: &Scene) {
        let shared = self.shared.borrow();
        if self.made_from != shared.stamp {
            self.made_from = shared.stamp;
            self.is_entered = false;
            self.cursor = SceneCursor::START;
        }
        let mut changes = self.cursor.follow(scene);
        if changes == Changes::Everything {
            // Another scene, or an overflow of the change log since the last frame. The cursor of the
            // `ScenePvs` may still reach back far enough.
            self.changed.clear();
            self.changed.resize(shared.objects.len(), false);
            changes = shared.cursor.peek(scene);
            self.lost = changes == Changes::Everything;
        }
        if let Changes::Objects(ids) = changes {
            for id in ids {
                if let Some(changed) = self.changed.get_mut(id.index()) {
                    *changed = true;
                }
            }
        }
    }

    /// Computes `hidden`, the objects that cannot be seen, from the PVS rows of the viewcells in `entered`.
    fn enter(&mut self) {
        let shared = self.shared.borrow();
        shared.pvs.write_union(&self.entered, &mut self.seen, &mut self.seen_from_one);
        self.hidden.clear();
        for pair in shared.objects.windows(2) {
            let targets = &shared.targets[pair[0].1 as usize..pair[1].1 as usize];
            let seen = |&target: &u32| {
                self.seen.get(target as usize / 64).is_none_or(|word| word >> (target % 64) & 1 != 0)
            };
            self.hidden.push(pair[0].0.is_some() && !targets.iter().any(seen));
        }
    }
}

impl<S: Borrow<ScenePvs>> Culler for PvsCuller<S> {
    fn name(&self) -> &str {
        "pvs"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        self.follow(scene);
        let viewcells = &self.shared.borrow().viewcells;
        let anchor = match view.eye(DVec3::ZERO) {
            Eye::Point(eye) => {
                self.viewcell = viewcells.locate(eye);
                eye
            }
            Eye::Direction(_) => {
                self.viewcell = None;
                view.origin()
            }
        };
        self.entering.clear();
        let mut covered = true;
        let known = view.for_each_sight_start(anchor, |corners, error| {
            covered &= viewcells.reached(corners, anchor, error, &mut self.reached);
            self.entering.extend_from_slice(&self.reached);
        });
        self.entering.sort_unstable();
        self.entering.dedup();
        let idle = !known || !covered || self.lost;
        let is_new = !self.is_entered || self.entering != self.entered;
        if is_new && !idle {
            core::mem::swap(&mut self.entering, &mut self.entered);
            self.is_entered = true;
            self.enter();
        }
        let objects = &self.shared.borrow().objects;
        visible.retain(scene, |id, _| {
            let index = id.index();
            let listed = objects.get(index).is_some_and(|&(listed, _)| listed == Some(id));
            let [changed, hidden] = [&self.changed, &self.hidden].map(|of| of.get(index) == Some(&true));
            idle || !listed || changed || !hidden
        })
    }

    fn for_each_lack(&self, scene: &Scene, each: &mut dyn FnMut(Lack)) {
        let lost = self.lost || !self.shared.borrow().cursor.is_in(scene);
        if lost && !scene.is_empty() {
            each(Lack { what: "objects of a scene that the PVS does not know", count: scene.len() });
        }
    }
}
