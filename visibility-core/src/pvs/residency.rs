//! `Residency`: which objects a streaming engine keeps in memory, and what it loads and drops next.
//!
//! Based on: the ordering of what to read by when and how large it is seen in Thomas Funkhouser, Carlo Sequin
//! and Seth Teller, "Management of Large Amounts of Data in Interactive Building Walkthroughs", 1992.

use super::{HiddenSets, importance};
use crate::bits::Bits;
use crate::{ObjectId, Scene};
use alloc::collections::BinaryHeap;
use alloc::vec::Vec;
use core::cmp::Ordering;
use glam::DVec3;

/// An object that is to be loaded or dropped.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub struct Transfer {
    /// Object to be loaded or dropped.
    pub object: ObjectId,
    /// Size of the object in bytes. For an object that is dropped, its size when it was loaded.
    pub bytes: u64,
}

/// Place of an object that is hidden from all places of an update.
const NOWHERE: u32 = u32::MAX;

/// The objects that a streaming engine has in memory. Tells which objects to load, most important first, and
/// which to drop for them, so that loads keep to a budget of bytes for each update, and what is in memory
/// keeps to a limit.
///
/// An update is given *places*: the box that the eye is in, then boxes that it may be in later, soonest
/// first. Each box must hold all points at which lines of sight begin, since what is seen from these is
/// drawn: the eye, and the corners of the near plane. An object is needed at the first place from which it is
/// not hidden, if a view that is served shows one of its layers. Objects needed sooner are loaded before
/// objects needed later, and among these the one with the greatest [`importance`] from the place comes first.
/// Equal ones come by [index](ObjectId::index).
///
/// An object is dropped only for the memory of a more urgent one that is loaded in the same update: first the
/// objects that are hidden from all places, the least important one first, then those needed last. An object
/// that may be visible from the first place is never dropped. If the sets do not know what is hidden from a
/// place, all objects may be needed there: from the first place this loads objects that no set asks for, by
/// their importance, and drops none. An unknown later place loads nothing, and lets an object be dropped only
/// for one that is needed sooner.
///
/// # Cost
/// An update takes some nanoseconds for each object of the scene and each place, besides what the sets take,
/// and a logarithmic time and a question for its size for each object that is loaded. While memory is full,
/// an update also takes that for each object that is needed and missing, and sorts the objects in memory that
/// may be dropped. Whatever the sizes, the time is O(n log n). Once its scratch memory is large enough, an
/// update allocates nothing, besides what the sets allocate.
///
/// ```
/// use visibility_core::pvs::{Pvs, PvsCuller, PvsTargets, Residency, ScenePvs, Viewcell, Viewcells};
/// use visibility_core::{glam::DVec3, Aabb, Scene};
/// let mut scene = Scene::new();
/// let [here, there] = [5.0, 15.0].map(|x| scene.insert(Aabb::from_arrays([x, 0.0, 0.0], [x + 1.0,
///     1.0, 1.0])));
/// // From the first room only the first object is seen.
/// let pvs = Pvs::new(PvsTargets::Objects, 2, &[vec![0], vec![0, 1]], |_| [])?;
/// let rooms = [0.0, 10.0].map(|x| Viewcell::from_box(DVec3::new(x, -5.0, -5.0), DVec3::new(x + 10.0,
///     5.0, 5.0)));
/// let mut sets = PvsCuller::new(ScenePvs::new(&scene, pvs, Viewcells::new(rooms), [(here, 0), (there, 1)]));
/// // Room for 100 bytes; each update may load 60. Every object has 40.
/// let mut residency = Residency::new(100);
/// let around = |x: f64| [DVec3::new(x - 0.3, 0.0, 0.0), DVec3::new(x + 0.3, 0.6, 0.6)];
/// let layers = [u32::MAX];
/// residency.update(&scene, &mut sets, &layers, &[around(6.0)], |_| 40, 60);
/// assert_eq!((residency.loads().len(), residency.loads()[0].object), (1, here));
/// // The eye will be in the second room soon.
/// residency.update(&scene, &mut sets, &layers, &[around(6.0), around(12.0)], |_| 40, 60);
/// assert_eq!((residency.loads()[0].object, residency.bytes()), (there, 80));
/// # Ok::<(), visibility_core::pvs::PvsError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Residency {
    /// Greatest number of bytes in memory.
    limit: u64,
    /// Objects in memory with their bytes, indexed by [`ObjectId::index`].
    resident: Vec<Option<Transfer>>,
    /// Sum of the bytes in `resident`.
    bytes: u64,
    /// Bytes by which earlier updates have exceeded their budgets.
    debt: u64,
    loads: Vec<Transfer>,
    drops: Vec<Transfer>,
    is_complete: bool,
    /// Indexed by [`ObjectId::index`]: number of the first place from which the object is not hidden, or
    /// [`NOWHERE`].
    needed: Vec<u32>,
    /// Scratch: the objects hidden from a place.
    hidden: Bits,
    /// Scratch: objects to load.
    missing: BinaryHeap<Ranked>,
    /// Scratch: objects in memory that may be dropped, most urgent first, each with the sum of the bytes of
    /// all objects up to and including it. Empty until memory is short.
    droppable: Vec<(Ranked, u64)>,
}

/// An object with its urgency, which is its order: the sooner place is more urgent, and at one place the
/// greater importance.
#[derive(Clone, Copy, Debug)]
struct Ranked {
    place: u32,
    importance: f64,
    object: ObjectId,
}

impl Ord for Ranked {
    /// The more urgent object is greater.
    fn cmp(&self, other: &Self) -> Ordering {
        let by_place = other.place.cmp(&self.place).then(self.importance.total_cmp(&other.importance));
        by_place.then(other.object.index().cmp(&self.object.index()))
    }
}

impl PartialOrd for Ranked {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Ranked {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Ranked {}

impl Residency {
    /// Makes an empty memory for at most `limit` bytes of objects.
    pub fn new(limit: u64) -> Self {
        Self {
            limit,
            resident: Vec::new(),
            bytes: 0,
            debt: 0,
            loads: Vec::new(),
            drops: Vec::new(),
            is_complete: false,
            needed: Vec::new(),
            hidden: Bits::EMPTY,
            missing: BinaryHeap::new(),
            droppable: Vec::new(),
        }
    }

    /// Finds what to [load](Self::loads) and to [drop](Self::drops) now, and counts it as loaded and dropped.
    /// `layers` are the [layers](crate::View::layers) of all views that draw from this memory, one mask for
    /// each view: of several cameras, not the union of their masks. The sets count as unknown while a view
    /// does not draw all of their occluders. Objects on no layer of a view are not needed; without views
    /// nothing is. `places` are boxes in world space, each given by its minimum and its maximum in metres,
    /// and hold for each view. `size` gives the bytes of an object that is not in memory, and is called at
    /// most once for each object. All updates are for the same scene.
    ///
    /// Loads take up to `budget` bytes in the order of their urgency. The last one may exceed the budget;
    /// what it takes more is subtracted from the next budgets, so that objects of any size are loaded. An
    /// object that finds no room is passed over, and nothing is dropped for it: it is larger than the limit,
    /// or all that may be dropped for it is too little. Less urgent objects that find room are loaded.
    /// Objects that were removed from the scene are always dropped. Without places nothing else is loaded or
    /// dropped.
    pub fn update(
        &mut self,
        scene: &Scene,
        sets: &mut dyn HiddenSets,
        layers: &[u32],
        places: &[[DVec3; 2]],
        mut size: impl FnMut(ObjectId) -> u64,
        budget: u64,
    ) {
        self.loads.clear();
        self.drops.clear();
        self.resident.resize(scene.index_limit().max(self.resident.len()), None);
        for index in 0..self.resident.len() {
            if self.resident[index].is_some_and(|resident| !scene.contains(resident.object)) {
                self.release(index);
            }
        }
        let unknown = self.find_needs(scene, sets, layers, places);
        self.rank_missing(scene, places);
        self.droppable.clear();
        let mut is_ranked = false;
        let paid = self.debt.min(budget);
        self.debt -= paid;
        let mut left = budget - paid;
        self.is_complete = !places.is_empty();
        while let Some(Ranked { place, object, .. }) = self.missing.pop() {
            if left == 0 {
                self.is_complete &= place > 0;
                break;
            }
            let bytes = size(object);
            if bytes > self.limit - self.bytes && !is_ranked {
                self.rank_droppable(scene, places, unknown);
                is_ranked = true;
            }
            if !self.make_room(bytes, place) {
                self.is_complete &= place > 0;
                continue;
            }
            let transfer = Transfer { object, bytes };
            self.resident[object.index()] = Some(transfer);
            self.loads.push(transfer);
            self.bytes += bytes;
            self.debt = self.debt.saturating_add(bytes.saturating_sub(left));
            left = left.saturating_sub(bytes);
        }
    }

    /// Fills `needed`. Returns the number of the first place of which the sets do not know what is hidden;
    /// [`NOWHERE`] if they know all.
    fn find_needs(
        &mut self,
        scene: &Scene,
        sets: &mut dyn HiddenSets,
        layers: &[u32],
        places: &[[DVec3; 2]],
    ) -> u32 {
        let shown = layers.iter().fold(0, |all, view| all | view);
        self.needed.clear();
        self.needed.resize(scene.index_limit(), NOWHERE);
        let mut unknown = NOWHERE;
        for (place, &[min, max]) in (0..).zip(places) {
            let is_known = sets.write_hidden(scene, layers, min, max, &mut self.hidden);
            if !is_known {
                unknown = unknown.min(place);
            }
            if !is_known && place > 0 {
                continue;
            }
            for id in scene.ids() {
                let needed = &mut self.needed[id.index()];
                let Some(object) = scene.object(id).ok().filter(|_| *needed == NOWHERE) else { continue };
                let is_hidden = is_known && self.hidden.contains(id.index()) && !object.is_unculled();
                if !is_hidden && object.layers & shown != 0 {
                    *needed = place;
                }
            }
        }
        unknown
    }

    /// Fills `missing` with the objects that are needed and not in memory.
    fn rank_missing(&mut self, scene: &Scene, places: &[[DVec3; 2]]) {
        self.missing.clear();
        let (resident, needed) = (&self.resident, &self.needed);
        self.missing.extend(scene.ids().filter_map(|id| {
            let place = needed[id.index()];
            let &[min, max] = places.get(place as usize).filter(|_| resident[id.index()].is_none())?;
            let importance = importance(scene, id, min, max);
            Some(Ranked { place, importance, object: id })
        }));
    }

    /// Fills `droppable` with the objects in memory that are not needed at the first place. `unknown` is the
    /// result of [`find_needs`](Self::find_needs): at that place every object may be needed.
    fn rank_droppable(&mut self, scene: &Scene, places: &[[DVec3; 2]], unknown: u32) {
        let Some(&first) = places.first() else { return };
        for id in scene.ids().filter(|id| self.resident[id.index()].is_some()) {
            let place = self.needed[id.index()].min(unknown);
            if place > 0 {
                let [min, max] = places.get(place as usize).copied().unwrap_or(first);
                let importance = importance(scene, id, min, max);
                self.droppable.push((Ranked { place, importance, object: id }, 0));
            }
        }
        self.droppable.sort_unstable_by(|(a, _), (b, _)| b.cmp(a));
        let mut sum = 0;
        for (ranked, up_to) in &mut self.droppable {
            // Resident objects fit into the limit together, so the sum does not overflow.
            sum += self.resident[ranked.object.index()].map_or(0, |resident| resident.bytes);
            *up_to = sum;
        }
    }

    /// Drops objects needed later than `place`, the least urgent first, until `bytes` more bytes fit into
    /// memory. If dropping all of these objects does not suffice, drops none, and returns false. Takes
    /// logarithmic time, besides that for each object dropped.
    fn make_room(&mut self, bytes: u64, place: u32) -> bool {
        let free = self.limit - self.bytes;
        let up_to = |count: usize| count.checked_sub(1).map_or(0, |last| self.droppable[last].1);
        let needed = self.droppable.partition_point(|(ranked, _)| ranked.place <= place);
        let later = up_to(self.droppable.len()) - up_to(needed);
        if bytes > free + later {
            return false;
        }
        while bytes > self.limit - self.bytes
            && let Some((last, _)) = self.droppable.pop()
        {
            self.release(last.object.index());
        }
        true
    }

    /// Takes an object out of memory.
    fn release(&mut self, index: usize) {
        if let Some(dropped) = self.resident.get_mut(index).and_then(Option::take) {
            self.bytes -= dropped.bytes;
            self.drops.push(dropped);
        }
    }

    /// Returns the objects to be loaded by the last [update](Self::update), most urgent first.
    pub fn loads(&self) -> &[Transfer] {
        &self.loads
    }

    /// Returns the objects to be dropped by the last [update](Self::update), least urgent first, after those
    /// that were removed from the scene.
    pub fn drops(&self) -> &[Transfer] {
        &self.drops
    }

    /// Returns whether an object is in memory.
    pub fn contains(&self, id: ObjectId) -> bool {
        let resident = self.resident.get(id.index());
        resident.is_some_and(|resident| resident.is_some_and(|resident| resident.object == id))
    }

    /// Returns the number of bytes in memory, at most the limit.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Returns whether all objects that may be visible from the first place of the last
    /// [update](Self::update) are in memory. False before the first update, and after one without places.
    pub fn is_complete(&self) -> bool {
        self.is_complete
    }
}
