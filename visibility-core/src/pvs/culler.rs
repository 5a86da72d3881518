//! Potentially visible sets applied to a frame.

use super::{Pvs, Viewcells};
use crate::{
    Accuracy, CullStats, Culler, ObjectId, Scene, View, VisibleSet,
    pvs::ViewcellId,
    scene::{Changes, SceneCursor},
    stamp::Stamp,
    view::Eye,
};
use alloc::vec::Vec;
use core::borrow::Borrow;
use glam::DVec3;

/// What all eyes in a scene share: the sets, where their viewcells are, and which objects their targets stand
/// for.
#[derive(Clone, Debug)]
pub struct ScenePvs {
    pvs: Pvs,
    viewcells: Viewcells,
    /// Objects by their index, each with where its targets begin in `targets`; ends with one that is no
    /// object.
    objects: Vec<(Option<ObjectId>, u32)>,
    targets: Vec<u32>,
    /// The scene as it was when the sets were given to it.
    cursor: SceneCursor,
    stamp: Stamp,
}

impl ScenePvs {
    /// Sets for a scene as it is now. `pairs` says which targets show an object: the object itself or the
    /// cells that it is in. It is visible where any of them is. An object without a target, or with one that
    /// the sets do not know, is never hidden; nor is one that changes later on.
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

    /// The sets.
    pub fn pvs(&self) -> &Pvs {
        &self.pvs
    }

    /// Their viewcells.
    pub fn viewcells(&self) -> &Viewcells {
        &self.viewcells
    }
}

/// Hides what cannot be seen from the viewcells in which the lines of sight of a view begin.
///
/// These are the viewcells that its near plane reaches into, since nothing before that is drawn: an eye close
/// to a wall sees through it, and then sees what the viewcells beyond see. Clip planes and parallel views are
/// told apart by [`View::for_each_sight_start`]. Where that cannot tell, or where lines of sight begin in no
/// viewcell, everything is seen.
///
/// Owns one view's memory; the [`ScenePvs`] is shared, by reference or by `Arc`. In a scene other than the
/// one that the sets were made for, a clone of it included, everything is seen.
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
    /// The sets that everything below was derived from.
    made_from: Stamp,
    /// The viewcell that the eye is in.
    viewcell: Option<ViewcellId>,
    /// The viewcells that lines of sight begin in, ascending: those that `hidden` is for, if it is for any.
    entered: Vec<ViewcellId>,
    is_entered: bool,
    /// Memory for the viewcells of the next frame, and for those of one polygon.
    entering: Vec<ViewcellId>,
    reached: Vec<ViewcellId>,
    /// The targets seen from `entered`, and memory for those of one of several viewcells.
    seen: Vec<u64>,
    seen_from_one: Vec<u64>,
    /// Objects, by index, that cannot be seen from `entered`.
    hidden: Vec<bool>,
    /// Objects, by index, that have changed since the sets were made.
    changed: Vec<bool>,
    /// Whether changes were too many to follow.
    lost: bool,
    cursor: SceneCursor,
}

impl<S: Borrow<ScenePvs>> PvsCuller<S> {
    /// For one view.
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

    /// What is shared, to be replaced by other sets; the next frame takes them in.
    pub fn shared_mut(&mut self) -> &mut S {
        &mut self.shared
    }

    /// The viewcell that the eye was in, in the last frame; `None` if it was in none, or nowhere.
    pub fn viewcell(&self) -> Option<ViewcellId> {
        self.viewcell
    }

    /// Takes in other sets than those of the frame before, and what has changed in the scene since they were
    /// made.
    fn follow(&mut self, scene: &Scene) {
        let shared = self.shared.borrow();
        if self.made_from != shared.stamp {
            self.made_from = shared.stamp;
            self.is_entered = false;
            self.cursor = SceneCursor::START;
        }
        let mut changes = self.cursor.follow(scene);
        if changes == Changes::Everything {
            // Another scene, or one that the culler has not seen for long. The sets themselves may know more.
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

    /// Brings `hidden` up to date with `entered`.
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
}
