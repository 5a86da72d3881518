//! Verdicts on the objects of a scene from one viewcell that follow the scene's changes: occluders that are
//! taken away, that are put up, and objects that move.
//!
//! A line of sight stays clear until an occluder is put up across it. A proof stays true until an occluder
//! that it names is taken away or moves. So a change leaves all other verdicts as they are, and of a proof
//! that has lost an occluder only the nodes that named it are searched again.
//!
//! The question is that of Frédo Durand, "3D Visibility: Analytical Study and Applications", 1999, chapter
//! "Dynamic scenes": to identify the calculations which actually need to be performed after the movement of
//! objects.

use crate::cell_query::CellQuery;
use crate::proof::{Proof, Step};
use crate::settings::{Effort, ExactSettings};
use crate::sight::CellBox;
use crate::triangles::SceneTriangles;
use crate::verdict::{Verdict, Witness, count};
use alloc::collections::BTreeMap;
use alloc::{boxed::Box, vec, vec::Vec};
use visibility_core::ObjectId;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::stamp::Stamp;

/// Number of rays that are cast through the place of each occluder that is gone, if proofs rested on it.
const THROUGH: u32 = 64;
/// Number of rays aimed at each object whose proof has fallen, before it is searched. Most of these objects
/// are still hidden, by other occluders.
const FALLEN_RAYS: u32 = 8;

/// Objects that were proven hidden together.
#[derive(Clone, Debug)]
struct HiddenSet {
    /// Positions of the objects in the list of objects.
    objects: Vec<u32>,
    /// Proofs that together cover all parts of the objects.
    proofs: Vec<Proof>,
    /// Positions of the objects whose triangles the proofs name, ascending.
    occluders: Box<[u32]>,
}

impl HiddenSet {
    fn new(objects: Vec<u32>, proofs: Vec<Proof>, triangles: &SceneTriangles) -> Self {
        let mut occluders = Vec::new();
        proofs.iter().for_each(|proof| proof.occluders(triangles, |place| occluders.push(place)));
        occluders.sort_unstable();
        occluders.dedup();
        Self { objects, proofs, occluders: occluders.into() }
    }
}

/// Work of one [`DynamicCell::update`].
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
#[non_exhaustive]
pub struct UpdateStats {
    /// Number of objects that changed since the last update. 0 if all verdicts were found anew.
    pub changed: usize,
    /// Number of hidden objects whose proof named a changed occluder.
    pub unproven: usize,
    /// Number of these objects that are hidden by a mended proof.
    pub mended: usize,
    /// Number of seen objects whose line of sight a changed occluder blocks.
    pub blocked: usize,
    /// Number of objects that were searched anew: those without a mended proof, those whose line of sight was
    /// blocked, the changed objects, and open objects before which an occluder was put up.
    pub searched: usize,
    /// Number of objects left for the next update, since the stop function returned true. They are open.
    pub pending: usize,
    /// Number of rays plus the number of nodes of the search for proofs.
    pub steps: u64,
}

/// The verdicts from one viewcell, kept up to date with a scene in which occluders move.
///
/// After a change of the scene, [`SceneTriangles::sync`] takes it in once, and [`update`](Self::update) of
/// each viewcell decides again only what the change can have altered. The verdicts then bound the visible
/// objects as those of a new query do, with the same promise: *seen* has a clear line of sight in the present
/// scene, *hidden* has a proof in the present scene, and open counts as visible. Where both decide an object,
/// they agree, but for objects that are seen only through gaps narrower than six clearances, which either
/// query may see or hide. Without a clearance they always agree. Which objects are left open can differ,
/// since a search ends after a number of nodes, and depends on the searches before it. Occluders count on
/// whatever layers they are.
///
/// Memory is mostly that of the proofs. [`Effort::Rays`] and [`Effort::Share`] have no proofs: settings made
/// of them count as [`Effort::Exact`] with their clearance.
///
/// ```
/// use visibility_core::{glam::{DVec3, Vec3}, pvs::Viewcell, Aabb, Object, Scene};
/// use visibility_exact::{DynamicCell, Effort, ExactSettings, SceneTriangles};
/// // A door, and a plate behind it.
/// let square = |x: f32, r: f32| {
///     let [a, b, c, d] = [(-r, -r), (r, -r), (r, r), (-r, r)].map(|(y, z)| Vec3::new(x, y, z));
///     [[a, b, c], [a, c, d]]
/// };
/// let mut scene = Scene::new();
/// for triangles in [square(5.0, 10.0), square(9.0, 1.0)] {
///     let bounds = Aabb::from_points(triangles.as_flattened().iter().copied());
///     let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
///     scene.set_triangles(id, triangles)?;
/// }
/// let mut triangles = SceneTriangles::new(&scene);
/// let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
/// let mut found = DynamicCell::new(cell, ExactSettings::new(Effort::Exact(1e-4)));
/// found.update(&triangles, &|| false);
/// assert_eq!(found.counts(), [1, 1, 0]);
/// // The door is taken away, and the plate is seen.
/// scene.remove(scene.id_at(0).unwrap())?;
/// triangles.sync(&scene);
/// found.update(&triangles, &|| false);
/// assert_eq!(found.counts(), [1, 0, 0]);
/// # Ok::<(), visibility_core::scene::SceneError>(())
/// ```
#[derive(Clone, Debug)]
pub struct DynamicCell {
    cell: Viewcell,
    settings: ExactSettings,
    /// State of the triangles that the verdicts are of.
    stamp: Stamp,
    /// Number of that state.
    serial: u64,
    /// Verdict on each object, in the order of the list of objects. `None` for removed objects.
    verdicts: Vec<Option<(ObjectId, Verdict)>>,
    hidden: Vec<HiddenSet>,
    /// Positions of open objects that are still to be searched.
    pending: Vec<u32>,
}

impl DynamicCell {
    /// Makes a value without verdicts for a viewcell. The first [`update`](Self::update) finds them all.
    pub fn new(cell: Viewcell, settings: ExactSettings) -> Self {
        let exact = ExactSettings::new(Effort::Exact(settings.clearance()));
        let settings = exact.with_rays(settings.rays).with_aimed_rays(settings.aimed_rays).with_kept_proofs();
        Self {
            cell,
            settings,
            stamp: Stamp::NONE,
            serial: 0,
            verdicts: Vec::new(),
            hidden: Vec::new(),
            pending: Vec::new(),
        }
    }

    /// Brings the verdicts up to date with `triangles`, and goes on with objects that the last update left.
    /// The search ends once `stop` returns true; what is undecided by then is open, and left for the next
    /// update. The verdicts are right then too.
    ///
    /// All verdicts are found anew in the first update, for other triangles than those of the last update,
    /// after [`sync`](SceneTriangles::sync) has collected all triangles anew, and after more than 1,024
    /// changes, or a quarter of the objects. A viewcell that is empty, not finite or beyond 1e30 metres from
    /// the scene's origin leaves all objects open.
    pub fn update(&mut self, triangles: &SceneTriangles, stop: &dyn Fn() -> bool) -> UpdateStats {
        let Some(cell) = CellBox::new(&self.cell, triangles.origin) else {
            self.stamp = Stamp::NONE;
            (self.hidden, self.pending) = (Vec::new(), Vec::new());
            self.keep(triangles, vec![Verdict::Open; triangles.objects.len()]);
            return UpdateStats::default();
        };
        let query = CellQuery::with_scratch(triangles, cell, self.settings, None).with_stop(stop);
        let changes = triangles.changes_since(self.stamp).map(|changes| {
            // For each changed object, the box around the places where it occluded before.
            let mut changed: BTreeMap<u32, [DVec3; 2]> = BTreeMap::new();
            for change in changes {
                let [min, max] = change.was;
                let was = changed.entry(change.place).or_insert(change.was);
                *was = [was[0].min(min), was[1].max(max)];
            }
            changed
        });
        self.stamp = triangles.stamp();
        let stats = match changes {
            Some(changed) => self.follow(query, triangles, &changed),
            None => self.start(query, triangles),
        };
        self.serial = triangles.serial();
        stats
    }

    /// Finds all verdicts.
    fn start(&mut self, query: CellQuery<'_>, triangles: &SceneTriangles) -> UpdateStats {
        let (found, _) = query.run(&|_| true);
        let sets = found.proofs.into_iter();
        self.hidden = sets.map(|set| HiddenSet::new(set.objects.into(), set.proofs, triangles)).collect();
        self.pending.clear();
        if !found.is_decided {
            let open = (0..).zip(&found.verdicts).filter(|(_, verdict)| **verdict == Verdict::Open);
            self.pending.extend(open.map(|(place, _)| place));
        }
        let steps = found.rays + found.nodes;
        let (searched, pending) = (found.verdicts.len(), self.pending.len());
        self.keep(triangles, found.verdicts);
        UpdateStats { searched, pending, steps, ..Default::default() }
    }

    /// Stores verdicts, in the order of the list of objects.
    fn keep(&mut self, triangles: &SceneTriangles, verdicts: Vec<Verdict>) {
        let verdicts = triangles.objects.iter().zip(verdicts);
        let present = verdicts.map(|(object, verdict)| (!object.is_removed).then_some((object.id, verdict)));
        self.verdicts = present.collect();
    }

    /// Brings the verdicts up to date after a change of some objects, each with the box around the places
    /// where it occluded before.
    fn follow(
        &mut self,
        mut query: CellQuery<'_>,
        triangles: &SceneTriangles,
        changed: &BTreeMap<u32, [DVec3; 2]>,
    ) -> UpdateStats {
        let mut stats = UpdateStats { changed: changed.len(), ..Default::default() };
        for (verdict, kept) in query.verdicts.iter_mut().zip(&self.verdicts) {
            *verdict = kept.map_or(Verdict::Open, |(_, verdict)| verdict);
        }
        // First, all that the change can have made wrong becomes open, however little time is left.
        let mut open = core::mem::take(&mut self.pending);
        let reopened = reopened(&query, triangles, changed);
        for &place in changed.keys() {
            query.verdicts[place as usize] = Verdict::Open;
            open.push(place);
        }
        let fallen = self.take_fallen(changed);
        for &place in fallen.iter().flat_map(|set| &set.objects) {
            query.verdicts[place as usize] = Verdict::Open;
            stats.unproven += 1;
        }
        let blocked = blocked(&query.verdicts, triangles, changed);
        for &place in &blocked {
            query.verdicts[place as usize] = Verdict::Open;
        }
        stats.blocked = blocked.len();
        open.extend(blocked);
        open.sort_unstable();
        open.dedup();
        // Then, the open objects are searched.
        if !fallen.is_empty() {
            let gaps = changed.values().filter(|was| was[0].cmple(was[1]).all());
            gaps.for_each(|was| query.look_through(*was, THROUGH));
        }
        let mut unproven = Vec::new();
        for set in fallen {
            match self.mended(&mut query, triangles, &set, changed) {
                Some(proofs) => {
                    stats.mended += set.objects.len();
                    set.objects.iter().for_each(|&place| query.verdicts[place as usize] = Verdict::Hidden);
                    self.hidden.push(HiddenSet::new(set.objects, proofs, triangles));
                }
                None => unproven.extend(set.objects),
            }
        }
        stats.searched = open.len() + unproven.len() + reopened.len();
        query.search_again(&open, self.settings.aimed_rays);
        query.search_again(&unproven, FALLEN_RAYS);
        query.try_boxes(&reopened);
        if query.is_stopped() {
            self.pending = open;
            self.pending.extend(unproven);
            self.pending.retain(|&place| query.verdicts[place as usize] == Verdict::Open);
            stats.pending = self.pending.len();
        }
        stats.steps = query.steps();
        let CellQuery { verdicts, proofs, .. } = query;
        let sets = proofs.into_iter();
        self.hidden.extend(sets.map(|set| HiddenSet::new(set.objects.into(), set.proofs, triangles)));
        self.keep(triangles, verdicts);
        stats
    }

    /// Removes changed objects from the sets of hidden objects, and returns the sets whose proofs name a
    /// changed object.
    fn take_fallen(&mut self, changed: &BTreeMap<u32, [DVec3; 2]>) -> Vec<HiddenSet> {
        for set in &mut self.hidden {
            set.objects.retain(|place| !changed.contains_key(place));
        }
        self.hidden.retain(|set| !set.objects.is_empty());
        let names =
            |set: &mut HiddenSet| changed.keys().any(|place| set.occluders.binary_search(place).is_ok());
        self.hidden.extract_if(.., names).collect()
    }

    /// Returns proofs that all objects of `set` are hidden: those of the set, in which nodes that named a
    /// changed object are searched again. `None` if an object of the set is seen, or if a node is undecided.
    fn mended(
        &self,
        query: &mut CellQuery<'_>,
        triangles: &SceneTriangles,
        set: &HiddenSet,
        changed: &BTreeMap<u32, [DVec3; 2]>,
    ) -> Option<Vec<Proof>> {
        let mut proofs = Vec::with_capacity(set.proofs.len());
        for proof in &set.proofs {
            if set.objects.iter().any(|&place| query.verdicts[place as usize] != Verdict::Open) {
                return None;
            }
            let is_changed = |t: &u32| changed.contains_key(&(triangles.object_of(*t) as u32));
            let fallen = proof.steps.iter().map(|step| match step {
                Step::Loop { piece, .. } => triangles.is_piece_newer(*piece, self.serial),
                step => step.triangles(triangles).iter().any(is_changed),
            });
            let fallen: Vec<bool> = fallen.collect();
            proofs.push(query.mend(proof, &fallen, set.objects.len())?);
        }
        Some(proofs)
    }

    /// Returns the viewcell.
    pub fn viewcell(&self) -> &Viewcell {
        &self.cell
    }

    /// Returns the objects with their verdicts, in the order of the [`SceneTriangles`] of the last update.
    /// Empty before the first update.
    pub fn iter(&self) -> impl Iterator<Item = (ObjectId, Verdict)> {
        self.verdicts.iter().flatten().copied()
    }

    /// Returns the objects that may be visible, seen or open: the row of the viewcell in a baked set. The row
    /// is of the last update. Nothing is reported before the first, and nothing that was inserted since: such
    /// objects count as visible.
    pub fn reported(&self) -> impl Iterator<Item = ObjectId> {
        self.iter().filter(|(_, verdict)| *verdict != Verdict::Hidden).map(|(id, _)| id)
    }

    /// Returns the numbers of objects seen, hidden and open.
    pub fn counts(&self) -> [usize; 3] {
        count(self.iter().map(|(_, verdict)| verdict))
    }

    /// Returns the proofs of the hidden objects, for [`Proof::check`]. A proof that was made before an object
    /// came far beyond all others holds still, but its check then allows for the errors of positions that far
    /// away, and may refuse it.
    pub fn proofs(&self) -> impl Iterator<Item = &Proof> {
        self.hidden.iter().flat_map(|set| &set.proofs)
    }

    /// Returns the size of the value in bytes.
    pub fn memory(&self) -> usize {
        let proofs: usize = self.proofs().map(Proof::memory).sum();
        let sets = self.hidden.iter().map(|set| 4 * (set.objects.len() + set.occluders.len()));
        proofs + sets.sum::<usize>() + size_of_val(&self.verdicts[..]) + size_of_val(&self.hidden[..])
    }
}

/// Returns the open objects that a change may have hidden: a segment from the viewcell to the object's box
/// passes an occluder that was put up. Where occluders are only taken away, open objects stay open, which
/// counts as visible.
fn reopened(
    query: &CellQuery<'_>,
    triangles: &SceneTriangles,
    changed: &BTreeMap<u32, [DVec3; 2]>,
) -> Vec<u32> {
    let cell = query.search.cell;
    let put_up = changed.keys().map(|&place| &triangles.objects[place as usize]);
    let put_up: Vec<[DVec3; 2]> = put_up
        .filter(|object| (object.first..object.end).any(|t| triangles.occludes(t)))
        .map(|object| [object.min, object.max])
        .collect();
    let is_passed = |place: &u32| {
        let object = &triangles.objects[*place as usize];
        let to = [object.min, object.max];
        !changed.contains_key(place) && put_up.iter().any(|at| meets([cell.min, cell.max], to, *at))
    };
    let open = (0..).zip(&query.verdicts).filter(|(_, verdict)| **verdict == Verdict::Open);
    open.map(|(place, _)| place).filter(is_passed).collect()
}

/// Returns the seen objects whose line of sight may meet an occluder that has changed. Such a line is tested
/// against all occluders.
fn blocked(
    verdicts: &[Verdict],
    triangles: &SceneTriangles,
    changed: &BTreeMap<u32, [DVec3; 2]>,
) -> Vec<u32> {
    let mut hits = Vec::new();
    let boxes = changed.keys().map(|&place| &triangles.objects[place as usize]);
    let boxes: Vec<[DVec3; 2]> =
        boxes.filter(|object| !object.is_open).map(|object| [object.min, object.max]).collect();
    let mut blocked = Vec::new();
    for (place, verdict) in (0..).zip(verdicts) {
        let Verdict::Seen(Witness { from, to, triangle }) = *verdict else { continue };
        // An object that reaches into the viewcell is seen whatever stands around it. A search for one
        // crossed triangle that finds it ends early, which counts as unsure.
        if from != to
            && boxes.iter().any(|at| meets([from; 2], [to; 2], *at))
            && triangles.tree.crossed(from, to, triangle, 1, &mut hits)
        {
            blocked.push(place);
        }
    }
    blocked
}

/// Returns whether a segment from the box `from` to the box `to` meets the box `at`, or passes it by less
/// than 1e-9 of its length. Each box is its least and its greatest corner.
///
/// The points at a part s of the segments, from 0 to 1, fill the box between the two. It meets `at` if six
/// linear functions of s are not negative, which leaves a range of s. Each value at an end is one rounded
/// difference, whose sign is exact. An end of the range divides two numbers of unlike sign, whose sum of
/// absolute values does not cancel: it is wrong by at most 4 roundings, of numbers up to 1.
fn meets(from: [DVec3; 2], to: [DVec3; 2], at: [DVec3; 2]) -> bool {
    let (mut least, mut greatest) = (0.0f64, 1.0f64);
    for k in 0..3 {
        // Values at s = 0 and at s = 1.
        for (a, b) in
            [(at[1][k] - from[0][k], at[1][k] - to[0][k]), (from[1][k] - at[0][k], to[1][k] - at[0][k])]
        {
            if a < 0.0 && b < 0.0 {
                return false;
            }
            if a < 0.0 {
                least = least.max(a / (a - b));
            } else if b < 0.0 {
                greatest = greatest.min(a / (a - b));
            }
        }
    }
    least <= greatest + 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::Vec3;
    use visibility_core::{Aabb, Object, Scene};
    use visibility_testing::Random;

    /// A square across the x axis.
    fn square(x: f32, y: f32, r: f32) -> [[Vec3; 3]; 2] {
        let at = |dy: f32, z: f32| Vec3::new(x, y + dy * r, z * r);
        let [a, b, c, d] = [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)];
        [[a, b, c], [a, c, d]]
    }

    fn scene(objects: &[[[Vec3; 3]; 2]]) -> Scene {
        let mut scene = Scene::new();
        for triangles in objects {
            let bounds = Aabb::from_points(triangles.as_flattened().iter().copied());
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            scene.set_triangles(id, triangles.to_vec()).unwrap();
        }
        scene
    }

    /// Puts the first object elsewhere, and returns the objects blocked by that, and the verdicts.
    fn moved(
        scene: &mut Scene,
        to: [[Vec3; 3]; 2],
        triangles: &mut SceneTriangles,
        found: &mut DynamicCell,
    ) -> (usize, [usize; 3]) {
        let id = scene.id_at(0).unwrap();
        scene.set_bounds(id, Aabb::from_points(to.as_flattened().iter().copied())).unwrap();
        scene.set_triangles(id, to.to_vec()).unwrap();
        assert!(triangles.sync(scene), "the object moves to {to:?}");
        let stats = found.update(triangles, &|| false);
        (stats.blocked, found.counts())
    }

    /// A door beside the line of sight to a plate blocks nothing. Before the plate it hides it.
    #[test]
    fn doors_block_what_they_are_put_before() {
        let (far, beside, before) =
            (square(50.0, 30.0, 1.0), square(6.0, 30.0, 20.0), square(6.0, 0.0, 10.0));
        let mut scene = scene(&[far, square(9.0, 0.5, 0.25)]);
        let mut triangles = SceneTriangles::new(&scene);
        let settings = ExactSettings::new(Effort::Exact(1e-3)).with_rays(100).with_aimed_rays(10);
        let mut found = DynamicCell::new(Viewcell::from_box(DVec3::ZERO, DVec3::ONE), settings);
        assert_eq!(found.settings.clearance(), 1e-3, "the clearance of the settings");
        found.update(&triangles, &|| false);
        assert_eq!(found.counts(), [2, 0, 0], "with the door far away");
        for (door, expected) in [
            (beside, (0, [2, 0, 0])),
            (before, (1, [1, 1, 0])),
            (beside, (0, [2, 0, 0])),
            (before, (1, [1, 1, 0])),
        ] {
            let now = moved(&mut scene, door, &mut triangles, &mut found);
            assert_eq!(now, expected, "the door at {door:?}");
        }
    }

    /// What stands in the viewcell stays seen, also where another object is put into its place.
    #[test]
    fn nothing_blocks_what_stands_in_the_viewcell() {
        let inside = square(0.5, 0.5, 0.25);
        let mut scene = scene(&[square(50.0, 30.0, 1.0), inside]);
        let mut triangles = SceneTriangles::new(&scene);
        let settings = ExactSettings::new(Effort::Exact(0.0)).with_rays(100).with_aimed_rays(10);
        let mut found = DynamicCell::new(Viewcell::from_box(DVec3::ZERO, DVec3::ONE), settings);
        found.update(&triangles, &|| false);
        let now = moved(&mut scene, inside, &mut triangles, &mut found);
        assert_eq!(now, (0, [2, 0, 0]), "two objects in one place in the viewcell");
    }

    /// Returns what [`meets`] does, without rounding, for boxes with small integer coordinates: the range of
    /// parts is not empty if it has an end, which is 0, 1 or the zero of one of the functions.
    fn meets_exactly(from: [[i64; 3]; 2], to: [[i64; 3]; 2], at: [[i64; 3]; 2]) -> bool {
        let over = |k: usize| (at[1][k] - from[0][k], at[1][k] - to[0][k]);
        let under = |k: usize| (from[1][k] - at[0][k], to[1][k] - at[0][k]);
        let functions: Vec<(i64, i64)> = (0..3).flat_map(|k| [over(k), under(k)]).collect();
        let zeros = functions.iter().filter(|(a, b)| (*a < 0) != (*b < 0));
        let mut parts = zeros.map(|(a, b)| (a.abs(), (a - b).abs())).chain([(0, 1), (1, 1)]);
        parts.any(|(s, of)| functions.iter().all(|(a, b)| a * (of - s) + b * s >= 0))
    }

    /// Boxes and points with integer coordinates, of which many touch, and the same in other units of length:
    /// the function agrees with integers.
    #[test]
    fn boxes_that_segments_meet_are_those_of_integers() {
        let mut random = Random(3);
        let mut counts = [0; 2];
        for round in 0..20_000 {
            let mut bounds = || {
                let a: [i64; 3] = core::array::from_fn(|_| i64::from(random.between(-3, 3)));
                let size = random.between(0, 4);
                [a, a.map(|x| x + i64::from(random.between(0, size)))]
            };
            let boxes = [bounds(), bounds(), bounds()];
            let expected = meets_exactly(boxes[0], boxes[1], boxes[2]);
            counts[usize::from(expected)] += 1;
            for scale in [1.0, 2f64.powi(-40), 1e30] {
                let [from, to, at] =
                    boxes.map(|ends| ends.map(|x| DVec3::from_array(x.map(|x| x as f64 * scale))));
                assert_eq!(meets(from, to, at), expected, "{round}, times {scale}: {boxes:?}");
            }
        }
        assert!(counts[0] > 2000 && counts[1] > 2000, "missed and met: {counts:?}");
    }

    /// A segment that touches a box at a point of the segment, rounded, meets the box.
    #[test]
    fn rounded_points_of_segments_are_met() {
        let mut random = Random(4);
        for round in 0..20_000 {
            let size = 10f64.powi(random.between(-3, 6));
            let mut point = || DVec3::from_array(core::array::from_fn(|_| random.fine_range(-size, size)));
            let (a, b, far) = (point(), point(), point());
            let x = a + (b - a) * random.unit();
            assert!(meets([a; 2], [b; 2], [x.min(far), x.max(far)]), "{round}: {x} between {a} and {b}");
            assert!(meets([a; 2], [b; 2], [x; 2]), "{round}: {x} itself, between {a} and {b}");
        }
    }
}
