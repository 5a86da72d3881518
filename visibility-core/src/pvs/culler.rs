//! Culling by a potentially visible set.

use super::degrees::DegreesOfViewcells;
use super::{HiddenSets, Pvs, PvsError, PvsTargets, SampledDegree, SampledDegrees, Viewcells};
use crate::{
    Aabb, Accuracy, CullStats, Culler, Object, ObjectId, Scene, View, VisibleSet,
    binary_format::Fingerprint,
    bits::Bits,
    culler::Lack,
    level_version::{level_object, object_hash},
    pvs::ViewcellId,
    scene::{Changes, SceneCursor, SharedTriangles, Triangles, lanes},
    stamp::Stamp,
    view::Eye,
    visible_set::add_to_masks,
};
use alloc::vec::Vec;
use core::borrow::Borrow;
use glam::{Affine3A, DVec3};

/// A PVS prepared for a scene: the PVS, the regions of its viewcells, and the targets of each object. Shared
/// by the cullers of all views.
#[derive(Clone, Debug)]
pub struct ScenePvs {
    pvs: Pvs,
    /// Degrees of visibility of the targets of `pvs`. `None` if they are not known.
    degrees: Option<SampledDegrees>,
    viewcells: Viewcells,
    /// Entry of each object, indexed by [`ObjectId::index`]: the object's id, or `None` if the object is
    /// never hidden, and the start of its target numbers in `targets`. Its target numbers end at the start
    /// of the next entry. A sentinel entry ends the list.
    objects: Vec<(Option<ObjectId>, u32)>,
    targets: Vec<u32>,
    /// Pairs of a target and an object that has it, sorted by target, then object.
    by_target: Vec<(u32, ObjectId)>,
    /// Greatest target of an object that may be hidden, plus 1. Used in place of the PVS's own number of
    /// targets, which may be forged.
    target_limit: usize,
    /// Objects of the scene that are never hidden, by ascending index.
    never_hidden: Vec<ObjectId>,
    /// Indices of the objects that hide others by the PVS.
    occluders: Bits,
    /// What the same objects were like when the PVS was prepared, by ascending index.
    occluder_states: Vec<OccluderState>,
    /// Distinct layer masks of the objects that hide others by the PVS: 0, which no view shows, for an object
    /// that may be absent from a frame, or elsewhere.
    occluder_layers: Vec<u32>,
    /// Revision of the scene for which this value was made. Objects that changed later count as visible.
    cursor: SceneCursor,
    /// Whether the PVS is known to be of this scene: it was compared, or the caller promises it.
    is_checked: bool,
    stamp: Stamp,
}

/// What an occluder of a PVS was like when the PVS was prepared.
#[derive(Clone, Debug)]
struct OccluderState {
    id: ObjectId,
    /// Hash of bounds, layers, all flags, the object's own transform, and occluder mesh with its transform
    /// (also of an object that is not flagged as an occluder), and of whether the object is always drawn.
    hash: u64,
    triangles: Option<SharedTriangles>,
}

impl OccluderState {
    fn of(scene: &Scene, id: ObjectId) -> Self {
        let mut hash = Fingerprint::new().with(scene.is_always_drawn(id).into());
        let with_transform = |hash: Fingerprint, transform: Affine3A| {
            transform.to_cols_array().into_iter().map(f32::to_bits).fold(hash, Fingerprint::with)
        };
        if let Some((object, _)) = level_object(scene, id) {
            hash = hash.with_u64(object_hash(&Object { cost: 0, ..object }, Triangles::default(), None));
            // A caller may name an object that has no flag of an occluder, without which the hash above
            // leaves glass out, and no triangles that tell how it is turned within its bounds.
            hash = hash.with(object.see_through.into());
            hash = with_transform(hash, scene.own_transform(id.index() as u32));
            if let Some((mesh, transform)) = scene.mesh_of_occluder(id) {
                hash = with_transform(hash.with_u64(mesh.fingerprint().value()), transform);
            }
        }
        Self { id, hash: hash.value(), triangles: scene.shared_triangles(id).cloned() }
    }

    /// Returns whether both are states of one object, with the same content. Triangles that are stored anew
    /// count as others.
    fn is_same(&self, other: &Self) -> bool {
        let is_same = match (&self.triangles, &other.triangles) {
            (Some(own), Some(other)) => own.is_same(other),
            (own, other) => own.is_none() && other.is_none(),
        };
        is_same && (self.id, self.hash) == (other.id, other.hash)
    }
}

impl ScenePvs {
    /// Prepares a PVS for the present state of a scene. Each pair assigns a target to an object: the object's
    /// own target number, or the number of a cell that contains the object. An object is visible if any of
    /// its targets is visible. An object is never hidden if it has no target, has a target that is not below
    /// [`Pvs::target_count`], or changes in the scene later. Pairs of unknown objects are ignored. Time is
    /// O(n log n) in the number of pairs.
    ///
    /// Changes are read from the scene's log, which holds the last 1,024 (or as many as a quarter of the
    /// objects). A culler that runs for the first time after more changes cannot know what has changed, hides
    /// nothing, and [says so](crate::Pipeline::for_each_lack). So insert the level's objects before this
    /// call, and for a view that is opened later clone a culler that has run since.
    ///
    /// The objects by which the PVS hides others (its occluders) must stay unchanged and be drawn. If the
    /// targets are [objects](PvsTargets::Objects), these are all objects of the scene that bakes [count as
    /// occluders](level_object), on any layer, unless [`with_occluders`](Self::with_occluders) names others.
    /// If the targets are cells, the PVS has no occluders.
    ///
    /// The caller promises that the PVS is of this scene as it is now: nothing is compared, not even the
    /// [`source`](Pvs::source) of the PVS. For example, a new door in a wall changes the PVS, though the
    /// wall's box stays the same. Call [`unchecked`](Self::unchecked) for bytes whose scene is not known for
    /// certain.
    pub fn new(
        scene: &Scene,
        pvs: Pvs,
        viewcells: Viewcells,
        pairs: impl IntoIterator<Item = (ObjectId, u32)>,
    ) -> Self {
        let mut pairs: Vec<_> = pairs.into_iter().filter(|(id, _)| scene.contains(*id)).collect();
        pairs.sort_unstable_by_key(|&(id, target)| (id.index(), target));
        // For each index the object, or `None` if it is never hidden, and the start of its targets in
        // `targets`.
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
        let never_hidden = scene.ids().filter(|id| objects[id.index()].0.is_none()).collect();
        let targets = pairs.iter().map(|&(_, target)| target).collect();
        // The same pairs sorted by target, so that the objects that have one target are contiguous.
        let mut by_target: Vec<_> = pairs.into_iter().map(|(id, target)| (target, id)).collect();
        by_target.sort_unstable();
        let known = by_target.partition_point(|&(target, _)| (target as usize) < pvs.target_count());
        let target_limit = by_target[..known].last().map_or(0, |&(target, _)| target as usize + 1);
        let is_of_objects = pvs.targets() == PvsTargets::Objects;
        let hides = |(object, _): (Object, _)| is_of_objects && object.occluder && object.layers != 0;
        let occluders = scene.ids().filter(|&id| level_object(scene, id).is_some_and(hides));
        let made = Self {
            pvs,
            degrees: None,
            viewcells,
            objects,
            targets,
            by_target,
            target_limit,
            never_hidden,
            occluders: Bits::EMPTY,
            occluder_states: Vec::new(),
            occluder_layers: Vec::new(),
            cursor: SceneCursor::at(scene),
            is_checked: true,
            stamp: Stamp::new(),
        };
        made.with_occluders(scene, occluders)
    }

    /// Names the objects by which the PVS hides others, in place of the occluders that [`new`](Self::new)
    /// chose. Nothing is hidden any more once one of them changes in the scene (a wall is taken away), and in
    /// views whose layers leave out one of them. A change that leaves bounds, transform, layers, flags,
    /// mesh, triangles and draw range as they were, such as one of the cost, does not count. Nothing is
    /// hidden at all if one of them is not [always drawn](Scene::is_always_drawn) or is [never
    /// culled](Object::is_unculled). `scene` is the scene given to [`new`](Self::new), unchanged since.
    /// Unknown objects are ignored.
    #[must_use]
    pub fn with_occluders(mut self, scene: &Scene, occluders: impl IntoIterator<Item = ObjectId>) -> Self {
        self.occluders = Bits::new(scene.index_limit());
        self.occluder_layers.clear();
        self.occluder_states.clear();
        for id in occluders {
            if let Ok(object) = scene.object(id) {
                let hides = scene.is_always_drawn(id) && !object.is_unculled();
                self.occluders.insert(id.index());
                self.occluder_states.push(OccluderState::of(scene, id));
                self.occluder_layers.push(if hides { object.layers } else { 0 });
            }
        }
        self.occluder_layers.sort_unstable();
        self.occluder_layers.dedup();
        self.occluder_states.sort_unstable_by_key(|state| state.id.index());
        // A culler that knows the set before has asked about other occluders.
        self.stamp = Stamp::new();
        self
    }

    /// Returns whether a view of some layers draws all objects that hide others by the PVS.
    fn is_drawn_whole(&self, view: u32) -> bool {
        self.occluder_layers.iter().all(|layers| layers & view != 0)
    }

    /// Returns whether an object hides others by the PVS, and is as it was when the PVS was prepared.
    fn is_unchanged_occluder(&self, scene: &Scene, id: ObjectId) -> bool {
        let states = &self.occluder_states;
        let place = states.partition_point(|state| state.id.index() < id.index());
        states.get(place).is_some_and(|state| state.is_same(&OccluderState::of(scene, id)))
    }

    /// Marks the PVS as possibly made from another scene, or from an earlier state of this one. Its cullers
    /// hide objects as before, but are [approximate](Accuracy::Approximate) and report this as a
    /// [lack](Culler::for_each_lack).
    #[must_use]
    pub fn unchecked(self) -> Self {
        Self { is_checked: false, ..self }
    }

    /// Returns false if the PVS may be of another scene: see [`unchecked`](Self::unchecked).
    pub fn is_checked(&self) -> bool {
        self.is_checked
    }

    /// Sets the degrees of visibility of the targets. They change no culler's answer unless the culler is
    /// [told to](PvsCuller::with_least_degree).
    ///
    /// # Errors
    /// [`PvsError::Degrees`] if they are those of a PVS with other numbers of viewcells or targets. The value
    /// is then unchanged.
    pub fn set_degrees(&mut self, degrees: SampledDegrees) -> Result<(), PvsError> {
        if !degrees.fit(&self.pvs) {
            return Err(PvsError::Degrees { problem: "they are those of another PVS" });
        }
        self.degrees = Some(degrees);
        // A culler that knows the set before has read other degrees.
        self.stamp = Stamp::new();
        Ok(())
    }

    /// Returns the degrees of visibility of the targets. `None` if none were set.
    pub fn degrees(&self) -> Option<&SampledDegrees> {
        self.degrees.as_ref()
    }

    /// Returns the targets that stay for a culler with a least degree, and whether they are the PVS itself.
    fn kept(&self, least: SampledDegree) -> (&Pvs, bool) {
        match self.degrees.as_ref().and_then(|degrees| degrees.at_least(least)) {
            Some(kept) => (kept, false),
            None => (&self.pvs, true),
        }
    }

    /// Returns the targets of an object that may be hidden. `None` for an object that is never hidden, and
    /// for an unknown one.
    fn targets_of(&self, id: ObjectId) -> Option<&[u32]> {
        let [(known, start), (_, end)] = *self.objects.get(id.index()..)?.first_chunk()?;
        let targets = self.targets.get(start as usize..end as usize)?;
        (known == Some(id)).then_some(targets)
    }

    /// Returns the PVS that was passed to the constructor.
    pub fn pvs(&self) -> &Pvs {
        &self.pvs
    }

    /// Returns the regions of the PVS's viewcells, in world space.
    pub fn viewcells(&self) -> &Viewcells {
        &self.viewcells
    }

    /// Returns the greatest target of an object that may be hidden, plus 1: bits of the PVS from this number
    /// on are not needed.
    pub(super) fn target_limit(&self) -> usize {
        self.target_limit
    }

    /// Returns the objects that may be hidden, by ascending index, each with its targets.
    pub(super) fn objects(&self) -> impl Iterator<Item = (ObjectId, &[u32])> {
        self.objects.windows(2).filter_map(|pair| {
            let targets = &self.targets[pair[0].1 as usize..pair[1].1 as usize];
            pair[0].0.map(|id| (id, targets))
        })
    }

    /// Calls `each` with every object that has a target in `seen`, once for each such target. Bit `t % 64` of
    /// word `t / 64` stands for target `t`. Time is linear in the number of words and of calls, plus a binary
    /// search in the pairs for each target in `seen`.
    fn for_each_seen(&self, seen: &[u64], mut each: impl FnMut(ObjectId)) {
        let mut rest = &self.by_target[..];
        for (number, &word) in seen.iter().enumerate() {
            for bit in lanes(word) {
                let target = (number * 64 + bit) as u32;
                rest = &rest[count_below(rest, target)..];
                while let Some((&(of, id), later)) = rest.split_first()
                    && of == target
                {
                    each(id);
                    rest = later;
                }
            }
        }
    }
}

/// Returns the number of pairs, sorted by target, with a target below `target`. Time is logarithmic in the
/// number of pairs.
fn count_below(pairs: &[(u32, ObjectId)], target: u32) -> usize {
    let is_below = |&(of, _): &(u32, ObjectId)| of < target;
    let mut end = 1;
    while pairs.get(end - 1).is_some_and(is_below) {
        end *= 2;
    }
    pairs[..end.min(pairs.len())].partition_point(is_below)
}

/// Hides objects that the PVS excludes for all viewcells in which lines of sight of the view begin.
/// Conservative if the PVS is; approximate if the PVS is [not known to be of this
/// scene](ScenePvs::unchecked).
///
/// Lines of sight begin on the near plane, since nothing nearer is drawn. The near plane of an eye close to a
/// wall may reach through the wall into the next viewcell, and then the PVS of that viewcell counts too. Clip
/// planes and parallel views are handled by [`View::for_each_sight_start`]. If that function cannot decide,
/// or if lines of sight begin outside all viewcells, every object counts as visible.
///
/// An object that changes in the scene counts as visible. Every object counts as visible once an
/// [occluder](ScenePvs::with_occluders) of the PVS changes, in views whose layers leave out one of these
/// occluders, and if one of them may be absent from a frame.
///
/// A culler holds the state of one view. The [`ScenePvs`] is shared, by reference or by `Arc`. In a scene
/// other than the one that the [`ScenePvs`] was made for, a clone included, every object counts as visible.
///
/// A frame takes a few nanoseconds for each block of 64 objects that has an object both in the set and seen
/// from the viewcells, and no time for other blocks. A frame in which the view enters other viewcells, or the
/// [layout](Scene::layout) of the scene has changed, first makes new masks. That takes a few nanoseconds for
/// each object that is seen from the viewcells (in the frustum or not), is never hidden, or has changed, and
/// as much for every thousand other objects.
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
    /// Least degree of the objects that stay in the set: see [`with_least_degree`](Self::with_least_degree).
    least: SampledDegree,
    /// Whether the last frame's viewcells answer for it. If not, every object counted as visible.
    is_answered: bool,
    /// Degrees of visibility from the viewcells in `entered`.
    degrees: DegreesOfViewcells,
    /// Viewcells in which the view's lines of sight began when `seen` was last computed, ascending.
    entered: Vec<ViewcellId>,
    /// Whether `entered` and `seen` are valid: false before the first frame, and after the [`ScenePvs`] was
    /// replaced.
    is_entered: bool,
    /// Scratch: the viewcells in which this frame's lines of sight begin.
    entering: Vec<ViewcellId>,
    reached: Vec<ViewcellId>,
    /// Union of the PVS rows of the viewcells in `entered`: bit `t % 64` of word `t / 64` stands for target
    /// `t`.
    seen: Vec<u64>,
    seen_from_one: Vec<u64>,
    /// Scratch of [`write_hidden`](HiddenSets::write_hidden): the viewcells that a box touches.
    touched: Vec<u32>,
    /// Viewcells of the last box of [`write_hidden`](HiddenSets::write_hidden) whose answer was known,
    /// ascending. Empty before the first one, and after the [`ScenePvs`] was replaced.
    touched_before: Vec<ViewcellId>,
    /// Union of the PVS rows of the viewcells in `touched_before`, as in `seen`.
    seen_from_box: Vec<u64>,
    /// Mask of each node of the scene's hierarchy, bit i for lane i. In a leaf: whether the object in the
    /// lane counts as visible from the viewcells in `entered`. In an inner node: whether such an object is
    /// below.
    masks: Vec<u64>,
    /// Layout of the scene (assignment of objects to lanes) that `masks` was made for. `NONE` if `masks` must
    /// be made again whatever the layout is, since `seen` has changed.
    masks_layout: Stamp,
    /// Indices of the objects that were changed or inserted since the [`ScenePvs`] was made: the PVS says
    /// nothing about these.
    changed: Bits,
    /// Whether lines of sight of the last frame began outside all viewcells.
    is_outside: bool,
    /// True if an occluder of the PVS has changed since the [`ScenePvs`] was made, or if the changes are
    /// unknown: the scene is another one, or its change log overflowed. Every object then counts as visible.
    /// False if `changed` names exactly the changed objects.
    lost: bool,
    /// Whether the layers of the last view left out an occluder of the PVS.
    is_without_occluders: bool,
    cursor: SceneCursor,
}

impl<S: Borrow<ScenePvs>> PvsCuller<S> {
    /// Makes a culler for one view, which has not culled a frame yet.
    pub fn new(shared: S) -> Self {
        Self {
            shared,
            made_from: Stamp::NONE,
            viewcell: None,
            least: SampledDegree::Unseen,
            is_answered: false,
            degrees: DegreesOfViewcells::default(),
            entered: Vec::new(),
            is_entered: false,
            entering: Vec::new(),
            reached: Vec::new(),
            seen: Vec::new(),
            seen_from_one: Vec::new(),
            touched: Vec::new(),
            touched_before: Vec::new(),
            seen_from_box: Vec::new(),
            masks: Vec::new(),
            masks_layout: Stamp::NONE,
            changed: Bits::EMPTY,
            is_outside: false,
            lost: false,
            is_without_occluders: false,
            cursor: SceneCursor::START,
        }
    }

    /// Sets the least degree of visibility of the objects that stay in the set. [`SampledDegree::Unseen`] by
    /// default: degrees hide nothing. With any other, objects vanish by an estimate: the culler is
    /// [approximate](Accuracy::Approximate), if its sets [have degrees](ScenePvs::degrees). Objects that are
    /// never hidden by the PVS, or have changed, stay.
    ///
    /// `docs/measurements.md` has the wrong pixels of each.
    #[must_use]
    pub fn with_least_degree(self, least: SampledDegree) -> Self {
        Self { least, is_entered: false, ..self }
    }

    /// Takes in the viewcells of a view as [`cull`](Culler::cull) does, without a set to cull. For a reader
    /// of [degrees](Self::degree) beside a pipeline, which owns its cullers.
    pub fn look(&mut self, scene: &Scene, view: &View) {
        self.enter(scene, view);
    }

    /// Returns the degree in which an object shows from the viewcells of the last view that was
    /// [culled](Culler::cull) or [looked at](Self::look), the greatest if there are several: an estimate, see
    /// [`SampledDegrees`]. `None` if it is not known: the sets have no degrees, the viewcells do not answer
    /// for the view, or the object is never hidden by them or has changed. An object that they hide is
    /// [`Unseen`](SampledDegree::Unseen). Takes constant time for an object with one target.
    pub fn degree(&self, id: ObjectId) -> Option<SampledDegree> {
        let shared = self.shared.borrow();
        let is_known = self.is_answered && self.made_from == shared.stamp;
        if !is_known || self.changed.contains(id.index()) {
            return None;
        }
        self.degrees.of(shared.targets_of(id)?)
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

    /// Resets derived state if the [`ScenePvs`] was replaced, and adds the objects that have changed in the
    /// scene since the [`ScenePvs`] was made to `changed` and `masks`.
    fn follow(&mut self, scene: &Scene) {
        let shared = self.shared.borrow();
        if self.made_from != shared.stamp {
            self.made_from = shared.stamp;
            self.is_entered = false;
            self.touched_before.clear();
            self.degrees.forget();
            self.cursor = SceneCursor::START;
        }
        let mut changes = self.cursor.follow(scene);
        if changes == Changes::Everything {
            // This culler's cursor is of another scene, or the change log overflowed since the last frame.
            // The cursor of the `ScenePvs` may still be covered by the log. Masks of the present layout stay
            // valid: all objects changed since the `ScenePvs` was made are added to them again.
            changes = shared.cursor.peek(scene);
            self.lost = changes == Changes::Everything;
            self.changed.clear();
        }
        let Changes::Objects(ids) = changes else { return };
        self.changed.grow(scene.index_limit());
        let has_masks = self.masks_layout == scene.layout();
        for &id in ids {
            if shared.is_unchanged_occluder(scene, id) {
                continue;
            }
            self.changed.insert(id.index());
            self.lost |= shared.occluders.contains(id.index());
            if has_masks {
                add_to_masks(&mut self.masks, scene, id);
            }
        }
    }

    /// Finds the viewcells in which lines of sight of a view begin, and reads their rows if they are others
    /// than those of the view before. Sets `is_answered` to whether the rows answer for the view.
    fn enter(&mut self, scene: &Scene, view: &View) {
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
        // Lines of sight start on the near plane, whose corners may lie in other viewcells than the eye. The
        // visible set is the union over all viewcells that contain starts.
        let mut covered = true;
        let known = view.for_each_sight_start(anchor, |corners, error| {
            covered &= viewcells.reached(corners, anchor, error, &mut self.reached);
            self.entering.extend_from_slice(&self.reached);
        });
        self.entering.sort_unstable();
        self.entering.dedup();
        self.is_outside = known && !covered;
        self.is_without_occluders = !self.shared.borrow().is_drawn_whole(view.layers());
        // Every object stays if a line of sight starts outside all viewcells, if the scene has changed too
        // often, or if an occluder of the PVS has changed or is not shown.
        let idle = !known || !covered || self.lost || self.is_without_occluders;
        let is_new = !self.is_entered || self.entering != self.entered;
        self.is_answered = !idle;
        // Rows are read only when the viewcells have changed, which is rare.
        if is_new && !idle {
            core::mem::swap(&mut self.entering, &mut self.entered);
            self.is_entered = true;
            let shared = self.shared.borrow();
            let (kept, _) = shared.kept(self.least);
            kept.write_first_union(
                &self.entered,
                shared.target_limit,
                &mut self.seen,
                &mut self.seen_from_one,
            );
            if let Some(degrees) = &shared.degrees {
                self.degrees.read(degrees, &self.entered, shared.target_limit);
            }
            self.masks_layout = Stamp::NONE;
        }
    }

    /// Makes `masks` of the objects that are seen from the viewcells in `entered`, are never hidden, or have
    /// changed. Objects inserted since the [`ScenePvs`] was made are among the changed ones.
    fn make_masks(&mut self, scene: &Scene) {
        let shared = self.shared.borrow();
        self.masks.clear();
        self.masks.resize(scene.leaf_limit(), 0);
        let mut add = |id| add_to_masks(&mut self.masks, scene, id);
        shared.for_each_seen(&self.seen, &mut add);
        shared.never_hidden.iter().copied().for_each(&mut add);
        self.changed.iter().filter_map(|index| scene.id_at(index)).for_each(&mut add);
        self.masks_layout = scene.layout();
    }
}

impl<S: Borrow<ScenePvs>> Culler for PvsCuller<S> {
    fn name(&self) -> &str {
        "pvs"
    }

    fn accuracy(&self) -> Accuracy {
        let shared = self.shared.borrow();
        let is_proven = shared.is_checked && shared.kept(self.least).1;
        if is_proven { Accuracy::Conservative } else { Accuracy::Approximate }
    }

    fn hides_behind_undrawn(&self) -> bool {
        true
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        self.enter(scene, view);
        if !self.is_answered {
            return visible.intersect(scene, &|_| u64::MAX);
        }
        if self.masks_layout != scene.layout() {
            self.make_masks(scene);
        }
        visible.intersect(scene, &|node| self.masks[node])
    }

    fn for_each_lack(&self, scene: &Scene, each: &mut dyn FnMut(Lack)) {
        let shared = self.shared.borrow();
        let lost = self.lost || !shared.cursor.is_in(scene);
        if lost && !scene.is_empty() {
            let what = "objects not culled, since the PVS does not know the scene or an occluder has changed";
            each(Lack { what, count: scene.len() });
        }
        if self.is_without_occluders && !scene.is_empty() {
            let what = "objects not culled, an occluder of the PVS being on no layer of the view, or not \
                        always drawn";
            each(Lack { what, count: scene.len() });
        }
        if self.is_outside && !scene.is_empty() {
            each(Lack {
                what: "objects not culled, the eye being outside all viewcells",
                count: scene.len(),
            });
        }
        let unchecked = shared.objects.iter().filter(|(id, _)| id.is_some()).count();
        if !shared.is_checked && unchecked > 0 {
            each(Lack { what: "objects hidden by a PVS that may be of another level", count: unchecked });
        }
    }
}

impl<S: Borrow<ScenePvs>> HiddenSets for PvsCuller<S> {
    /// Takes the union of the rows of all viewcells that the box touches. Frames are not affected. The answer
    /// is as accurate as the PVS: an [`unchecked`](ScenePvs::unchecked) PVS answers alike.
    ///
    /// The answer is not known where [`cull`](Culler::cull) hides nothing in every view, and if viewcells
    /// cover neither the [box](Viewcells::cover) nor its [sides](Viewcells::reached). Sides suffice: a line
    /// of sight from a gap inside leaves the box through a side, or ends at an object in the box, and objects
    /// in the box are not hidden. The rows of viewcells inside the box add nothing to an exact PVS. They are
    /// taken for the sake of sampled ones, which may lack at the sides what was found from inside.
    ///
    /// A box over hundreds of viewcells of irregular shapes may count as not covered although it is. Boxes of
    /// a grid are covered by any number of viewcells, in time that grows with the square of this number.
    ///
    /// Reads the rows only if the viewcells are not those of the call before. Always reads the bounds of each
    /// object that the PVS may hide: some nanoseconds for each, seen or not.
    fn write_hidden(
        &mut self,
        scene: &Scene,
        layers: &[u32],
        min: DVec3,
        max: DVec3,
        hidden: &mut Bits,
    ) -> bool {
        self.follow(scene);
        let shared = self.shared.borrow();
        let is_usable = min.cmple(max).all() && min.is_finite() && max.is_finite();
        let is_drawn = [u32::MAX].iter().chain(layers).all(|&view| shared.is_drawn_whole(view));
        if !is_usable || self.lost || !is_drawn {
            return false;
        }
        self.entering.clear();
        self.touched.clear();
        let is_covered = shared.viewcells.cover(min, max, &mut self.touched);
        self.entering.extend(self.touched.iter().map(|&cell| ViewcellId(cell)));
        let sides = (0..3).flat_map(|axis| [(axis, min), (axis, max)]);
        for (axis, side) in sides.filter(|_| !is_covered) {
            // A corner relative to `min` is rounded by `u r` in the terms of `reached::ROUNDING`, which
            // leaves room for it.
            let corner = |i: usize, j: usize| {
                let mut corner = side;
                let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
                (corner[u], corner[v]) = ([min[u], max[u]][i], [min[v], max[v]][j]);
                corner - min
            };
            let corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            if !shared.viewcells.reached(&corners, min, 0.0, &mut self.reached) {
                return false;
            }
            self.entering.extend_from_slice(&self.reached);
        }
        self.entering.sort_unstable();
        self.entering.dedup();
        if self.entering != self.touched_before {
            let ScenePvs { pvs, target_limit, .. } = shared;
            pvs.write_first_union(
                &self.entering,
                *target_limit,
                &mut self.seen_from_box,
                &mut self.seen_from_one,
            );
            core::mem::swap(&mut self.entering, &mut self.touched_before);
        }
        hidden.reset(scene.index_limit());
        let around = Aabb::from_world(min, max, scene.origin());
        let is_apart = |bounds: &Aabb| !(bounds.min.cmple(around.max) & around.min.cmple(bounds.max)).all();
        for (id, _) in shared.objects() {
            if scene.bounds(id).is_ok_and(|bounds| is_apart(&bounds)) {
                hidden.insert(id.index());
            }
        }
        shared.for_each_seen(&self.seen_from_box, |id| _ = hidden.remove(id.index()));
        self.changed.iter().for_each(|index| _ = hidden.remove(index));
        true
    }
}
