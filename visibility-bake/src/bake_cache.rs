//! The cache of a bake: results of viewcells, found by hashes of their input. With a cache, a bake of an
//! edited level works only on viewcells whose input has changed.

use crate::near_to_far::Trace;
use std::collections::HashMap;
use std::sync::Arc;
use visibility_core::binary_format::{Format, FormatError, Reader, Writer};

const FORMAT: Format = Format { magic: *b"VISCACHE", version: 4 };

/// Answer for an object that a line of sight reaches.
pub(crate) const SEEN: u8 = 0;
/// Answer for an object that is proven hidden.
pub(crate) const HIDDEN: u8 = 1;
/// Answer for an object that is neither seen nor proven hidden.
pub(crate) const OPEN: u8 = 2;

/// Results for one viewcell. Objects that are *left* after a sweep are those that the sweep did not find
/// hidden. An object is given by its position in the list of objects left after the sweep of the viewcell's
/// group.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct CellRecord {
    /// Hash of the input that determines the answers: the viewcell, the settings, and the content of the
    /// objects listed in `left`, in their order, without their numbers.
    pub key: u64,
    /// Objects left after the sweep of the viewcell, as positions in the list of those left after its group's
    /// sweep, ascending.
    pub left: Vec<u32>,
    /// Answers for the objects listed in `left`, in the same order: each is [`SEEN`], [`HIDDEN`] or [`OPEN`].
    pub answers: Vec<u8>,
    /// Work done after the sweep: the number of rays plus the number of nodes of the search for proofs.
    pub steps: u64,
}

impl CellRecord {
    /// Returns whether all positions in `left` are valid for `objects`, the list of objects that the sweep of
    /// the group has left.
    pub(crate) fn is_of(&self, objects: &[u32]) -> bool {
        self.left.last().is_none_or(|&last| (last as usize) < objects.len())
    }

    pub(crate) fn save(&self, to: &mut Writer) {
        to.u64(self.key);
        to.u64(self.steps);
        to.u32(self.left.len() as u32);
        to.u32s(self.left.iter().copied());
        to.bytes(&self.answers);
    }

    /// Reads a record that [`save`](Self::save) has written.
    pub(crate) fn load(from: &mut Reader<'_>) -> Result<Self, FormatError> {
        let (key, steps) = (from.u64()?, from.u64()?);
        let count = from.u32()? as usize;
        let (left, answers) = (from.u32s(count)?, from.bytes(count)?.to_vec());
        if !left.is_sorted_by(|a, b| a < b) || answers.iter().any(|&answer| answer > OPEN) {
            return Err(from.content_error("answers of a viewcell are unknown or out of order"));
        }
        Ok(Self { key, left, answers, steps })
    }
}

/// Result of sweeping a group of viewcells.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct GroupRecord {
    /// Hash of the viewcells of the group, the settings and the origin of the level: the sweep's whole input
    /// except the objects.
    pub question: u64,
    /// Hash of the viewcells, the settings and the origin, and of the content of the objects that the sweep
    /// has left.
    pub key: u64,
    /// Record of the sweep: the tiles that it has opened, and the objects that it has left.
    pub trace: Trace,
    /// Whether the sweep was skipped or ended early because its time was over.
    pub is_cut: bool,
}

impl GroupRecord {
    pub(crate) fn save(&self, to: &mut Writer) {
        to.u64(self.question);
        to.u64(self.key);
        self.trace.save(to);
        to.u32(u32::from(self.is_cut));
    }

    /// Reads a record that [`save`](Self::save) has written.
    pub(crate) fn load(from: &mut Reader<'_>) -> Result<Self, FormatError> {
        let (question, key) = (from.u64()?, from.u64()?);
        Ok(Self { question, key, trace: Trace::load(from)?, is_cut: from.u32()? != 0 })
    }
}

/// The results of a bake, each with a hash of its whole input. A bake of the same level after an edit takes
/// from the cache the results that the edit cannot have changed
/// ([`SandwichBaker::with_cache`](crate::SandwichBaker::with_cache)). Its outcome is the same as without the
/// cache.
///
/// A result depends on its viewcell, the viewcells in its group (up to 16 neighbours), the settings, and a
/// part of the objects. The *tiles* that a group's sweep opens are the parts of the level that are near the
/// group or seen from it. No work is done for a group whose inputs are all unchanged. If a tile has changed,
/// the group is swept again. If the group's sweep then leaves the same objects as before, no work is done for
/// its viewcells. Otherwise each viewcell is swept again, and its rays and proofs are repeated only if its
/// own sweep leaves other objects than before. Objects and viewcells may be inserted, removed or renumbered.
///
/// ```
/// use visibility_bake::{BakeCache, SandwichBaker, SandwichSettings};
/// use visibility_core::{bake::Bake, glam::DVec3, pvs::{Viewcell, Viewcells}, Aabb, Scene};
/// let mut scene = Scene::new();
/// let id = scene.insert(Aabb::from_arrays([5.0; 3], [6.0; 3]));
/// let cells = Viewcells::new([Viewcell::from_box(DVec3::ZERO, DVec3::ONE)]);
/// let first = Bake::new(SandwichBaker::new(&scene, &cells, SandwichSettings::default())).run();
/// let kept: Vec<u8> = first.cache.to_bytes();
///
/// scene.set_bounds(id, Aabb::from_arrays([7.0; 3], [8.0; 3]))?;
/// let cache = BakeCache::from_bytes(&kept)?;
/// let second = SandwichBaker::new(&scene, &cells, SandwichSettings::default()).with_cache(cache);
/// let second = Bake::new(second).run();
/// assert_eq!((first.reused, second.reused), (0, 0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct BakeCache {
    /// Groups in any order, with the results for their viewcells.
    groups: Vec<(Arc<GroupRecord>, Vec<CellRecord>)>,
    /// Index in `groups` of each group, found by its [question](GroupRecord::question).
    by_question: HashMap<u64, usize>,
    /// Index in `groups` of each group, found by its [key](GroupRecord::key).
    by_key: HashMap<u64, usize>,
    /// For each viewcell, found by its [key](CellRecord::key): the index in `groups` of its group, and its
    /// index in the group.
    by_cell: HashMap<u64, (usize, usize)>,
}

impl BakeCache {
    /// Adds a group with the results of its viewcells. If there is a group with the same question, that one
    /// stays.
    pub(crate) fn insert(&mut self, group: Arc<GroupRecord>, cells: Vec<CellRecord>) {
        let number = self.groups.len();
        if *self.by_question.entry(group.question).or_insert(number) == number {
            self.by_key.entry(group.key).or_insert(number);
            for (place, cell) in cells.iter().enumerate() {
                self.by_cell.entry(cell.key).or_insert((number, place));
            }
            self.groups.push((group, cells));
        }
    }

    /// Returns the group with a [question](GroupRecord::question), and the results of its viewcells. `None`
    /// for an unknown question.
    pub(crate) fn answer(&self, question: u64) -> Option<(&Arc<GroupRecord>, &[CellRecord])> {
        let (group, cells) = &self.groups[*self.by_question.get(&question)?];
        Some((group, cells))
    }

    /// Returns the results of the viewcells of the group with a [key](GroupRecord::key). `None` for an
    /// unknown key.
    pub(crate) fn group(&self, key: u64) -> Option<&[CellRecord]> {
        self.by_key.get(&key).map(|&number| &self.groups[number].1[..])
    }

    /// Returns the results of the viewcell with a [key](CellRecord::key). `None` for an unknown key. The
    /// positions in the record's `left` refer to the group of the bake that made the record, which may have
    /// left other objects than the present group.
    pub(crate) fn cell(&self, key: u64) -> Option<&CellRecord> {
        self.by_cell.get(&key).map(|&(group, place)| &self.groups[group].1[place])
    }

    /// Returns the results as bytes in the [binary format](visibility_core::binary_format).
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut to = Writer::new(FORMAT, 0, 0);
        to.u32(self.groups.len() as u32);
        for (group, cells) in &self.groups {
            group.save(&mut to);
            to.u32(cells.len() as u32);
            cells.iter().for_each(|cell| cell.save(&mut to));
        }
        to.finish()
    }

    /// Reads the bytes of [`to_bytes`](Self::to_bytes).
    ///
    /// # Errors
    /// [`FormatError`] if the bytes are damaged, or are not those of a cache. Forged bytes are not detected:
    /// a bake with forged results is wrong.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FormatError> {
        let mut from = Reader::new(bytes, FORMAT)?;
        from.expect(0, 0)?;
        let mut cache = Self::default();
        for _ in 0..from.u32()? {
            let group = GroupRecord::load(&mut from)?;
            let count = from.u32()?;
            let mut cells = Vec::new();
            for _ in 0..count {
                cells.push(CellRecord::load(&mut from)?);
            }
            cache.insert(Arc::new(group), cells);
        }
        from.end()?;
        Ok(cache)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_read_as_written_and_forged_ones_are_refused() {
        let record = CellRecord { key: 1, left: vec![2, 5, 6], answers: vec![SEEN, HIDDEN, OPEN], steps: 4 };
        let read = |record: &CellRecord| {
            let mut to = Writer::new(FORMAT, 0, 0);
            record.save(&mut to);
            let bytes = to.finish();
            CellRecord::load(&mut Reader::new(&bytes, FORMAT).unwrap()).ok()
        };
        assert_eq!(read(&record).as_ref(), Some(&record), "the record as written");
        let twice = CellRecord { left: vec![2, 5, 5], ..record.clone() };
        assert_eq!(read(&twice), None, "an object listed twice");
        let unknown = CellRecord { answers: vec![SEEN, HIDDEN, OPEN + 1], ..record.clone() };
        assert_eq!(read(&unknown), None, "an unknown answer");
        assert!(record.is_of(&[0; 7]), "a list of seven objects has a position 6");
        assert!(!record.is_of(&[0; 6]), "a list of six objects has no position 6");
        assert!(CellRecord::default().is_of(&[]), "a record that leaves nothing is of any list");
    }
}
