//! Potentially visible sets applied to a frame.

use super::{Pvs, Viewcells};
use crate::{
    Accuracy, Changes, CullStats, Culler, Eye, ObjectId, Plane, Scene, View, ViewcellId, VisibleSet,
};
use alloc::vec::Vec;
use core::borrow::Borrow;
use glam::DVec3;

/// What all eyes in a scene share: the sets, where their viewcells are, and which objects their targets stand for.
#[derive(Clone, Debug)]
pub struct ScenePvs {
    pvs: Pvs,
    viewcells: Viewcells,
    /// Objects by their index, each with where its targets begin in `targets`; ends with one that is no object.
    objects: Vec<(Option<ObjectId>, u32)>,
    targets: Vec<u32>,
    revision: u64,
}

impl ScenePvs {
    /// Sets for a scene as it is now. `pairs` says which targets show an object: the object itself or the cells that it is in. It is visible
    /// where any of them is. An object without a target, or with one that the sets do not know, is never hidden; nor is one that changes
    /// later on.
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
        Self { pvs, viewcells, objects, targets, revision: scene.revision() }
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

/// Hides what the viewcell of the eye cannot see.
///
/// Nothing before the near plane is drawn, so lines of sight begin there: an eye close to a wall sees through it, and then sees what the
/// viewcells beyond see.
///
/// Owns one view's memory; the [`ScenePvs`] is shared, by reference or by `Arc`. An eye in no viewcell, one whose near plane is partly in
/// none, one at infinity, and one that a clip plane cuts away sees everything.
///
/// ```
/// use visibility_core::{Aabb, Pipeline, Pose, Pvs, PvsCuller, PvsTargets, Scene, ScenePvs, View, Viewcell, Viewcells, VisibleSet};
/// use visibility_core::glam::DVec3;
/// let mut scene = Scene::new();
/// let [here, there] = [5.0, 15.0].map(|x| scene.insert(Aabb::from_arrays([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0])));
/// // From the first room only the first object is seen.
/// let pvs = Pvs::new(PvsTargets::Objects, 2, &[vec![0], vec![0, 1]], |_| [])?;
/// let rooms = [0.0, 10.0].map(|x| Viewcell::from_box(DVec3::new(x, -5.0, -5.0), DVec3::new(x + 10.0, 5.0, 5.0)));
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
    /// The viewcell that the eye is in.
    viewcell: Option<ViewcellId>,
    /// The viewcells that lines of sight begin in: those that `hidden` is for, and memory for those of the next frame.
    entered: Vec<ViewcellId>,
    entering: Vec<ViewcellId>,
    /// The targets seen from there, and memory for those of one of several.
    seen: Vec<u64>,
    seen_from_one: Vec<u64>,
    /// Objects, by index, that cannot be seen from there.
    hidden: Vec<bool>,
    /// Objects, by index, that have changed since the sets were made.
    changed: Vec<bool>,
    /// Whether changes were too many to follow.
    lost: bool,
    revision: u64,
}

impl<S: Borrow<ScenePvs>> PvsCuller<S> {
    /// For one view.
    pub fn new(shared: S) -> Self {
        let (objects, revision) = (shared.borrow().objects.len(), shared.borrow().revision);
        Self {
            shared,
            viewcell: None,
            entered: Vec::new(),
            entering: Vec::new(),
            seen: Vec::new(),
            seen_from_one: Vec::new(),
            hidden: alloc::vec![false; objects],
            changed: alloc::vec![false; objects],
            lost: false,
            revision,
        }
    }

    /// The viewcell that the eye was in, in the last frame; `None` if it was in none, or nowhere.
    pub fn viewcell(&self) -> Option<ViewcellId> {
        self.viewcell
    }

    fn follow(&mut self, scene: &Scene) {
        match scene.changes_since(self.revision) {
            Changes::Everything => self.lost = true,
            Changes::Objects(ids) => {
                for id in ids {
                    if let Some(changed) = self.changed.get_mut(id.index()) {
                        *changed = true;
                    }
                }
            }
        }
        self.revision = scene.revision();
    }

    /// Brings `hidden` up to date with `entered`.
    fn enter(&mut self) {
        let shared = self.shared.borrow();
        shared.pvs.write_union(&self.entered, &mut self.seen, &mut self.seen_from_one);
        for (index, pair) in shared.objects.windows(2).enumerate() {
            let targets = &shared.targets[pair[0].1 as usize..pair[1].1 as usize];
            let seen = |&target: &u32| {
                self.seen.get(target as usize / 64).is_none_or(|word| word >> (target % 64) & 1 != 0)
            };
            self.hidden[index] = pair[0].0.is_some() && !targets.iter().any(seen);
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
        self.viewcell = None;
        let mut inside = false;
        if let Eye::Point(eye) = view.eye(DVec3::ZERO) {
            let viewcells = &self.shared.borrow().viewcells;
            self.viewcell = viewcells.locate(eye);
            if let (Some(_), Some((corners, margin))) = (self.viewcell, front(view, eye)) {
                inside = viewcells.reached(&corners, eye, margin, &mut self.entering);
            }
        }
        if inside && self.entering != self.entered {
            core::mem::swap(&mut self.entering, &mut self.entered);
            self.enter();
        }
        let idle = !inside || self.lost;
        let objects = &self.shared.borrow().objects;
        visible.retain(scene, |id, _| {
            let index = id.index();
            let listed = objects.get(index).is_some_and(|&(listed, _)| listed == Some(id));
            idle || !listed || self.changed[index] || !self.hidden[index]
        })
    }
}

/// The corners of the rectangle on the near plane that a view begins on, relative to the eye, in order, and how far they may be off. `None` where that has no bounds, or where a clip plane cuts the eye away, so that lines of sight begin elsewhere.
fn front(view: &View, eye: DVec3) -> Option<([DVec3; 4], f64)> {
    let planes = view.planes(eye);
    let mut first = [None; 5];
    for (slot, plane) in planes.with_slots() {
        match slot {
            0..=4 => first[usize::from(slot)] = Some(plane.plane),
            5 => {}
            _ if plane.plane.offset <= plane.error => return None,
            _ => {}
        }
    }
    let [left, right, bottom, top, near] = first;
    let [left, right, bottom, top, near] = [left?, right?, bottom?, top?, near?];
    let mut corners = [DVec3::ZERO; 4];
    let mut reach: f64 = 0.0;
    for (corner, [side, other]) in
        corners.iter_mut().zip([[left, bottom], [right, bottom], [right, top], [left, top]])
    {
        *corner = meet(near, side, other).filter(|corner| corner.is_finite())?;
        reach = reach.max(corner.abs().max_element());
    }
    // Rounding, with much to spare: one viewcell too many costs little.
    Some((corners, 1e-6 * reach + 1e-14 * eye.abs().max_element()))
}

/// Where three planes meet.
fn meet(a: Plane, b: Plane, c: Plane) -> Option<DVec3> {
    let (bc, ca, ab) = (b.normal.cross(c.normal), c.normal.cross(a.normal), a.normal.cross(b.normal));
    let determinant = a.normal.dot(bc);
    (determinant != 0.0).then(|| -(bc * a.offset + ca * b.offset + ab * c.offset) / determinant)
}
