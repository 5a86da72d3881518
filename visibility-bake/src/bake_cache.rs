//! What a bake has found, by what it was found from: with it, a bake of an edited level works on those
//! viewcells alone whose input has changed.

use crate::near_to_far::Trace;
use std::collections::HashMap;
use std::sync::Arc;
use visibility_core::binary_format::{Format, FormatError, Reader, Writer};

const FORMAT: Format = Format { magic: *b"VISCACHE", version: 2 };

/// An object that a sweep left was seen.
pub(crate) const SEEN: u8 = 0;
/// An object that a sweep left was proven hidden.
pub(crate) const HIDDEN: u8 = 1;
/// An object that a sweep left is neither seen nor proven hidden.
pub(crate) const OPEN: u8 = 2;

/// The results of a viewcell, in terms of its group: objects are numbered in the order of the objects that
/// the sweep of the group has left.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct CellRecord {
    /// Hash of all that the answers depend on, but for the objects' numbers.
    pub key: u64,
    /// Objects that the sweep of the viewcell has left, ascending.
    pub left: Vec<u32>,
    /// By object of `left`: seen, hidden or open.
    pub answers: Vec<u8>,
    /// Work done after the sweep.
    pub steps: u64,
}

impl CellRecord {
    /// Returns whether the record can be of a group whose sweep has left some objects.
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

    /// Reads what [`save`](Self::save) has written.
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

/// What the viewcells of a group have in common.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct GroupRecord {
    /// Hash of the viewcells and the settings.
    pub question: u64,
    /// Hash of the viewcells, the settings, and the objects that the sweep of the group has left.
    pub key: u64,
    /// What the sweep of the group has opened and left.
    pub trace: Trace,
}

impl GroupRecord {
    pub(crate) fn save(&self, to: &mut Writer) {
        to.u64(self.question);
        to.u64(self.key);
        self.trace.save(to);
    }

    /// Reads what [`save`](Self::save) has written.
    pub(crate) fn load(from: &mut Reader<'_>) -> Result<Self, FormatError> {
        Ok(Self { question: from.u64()?, key: from.u64()?, trace: Trace::load(from)? })
    }
}

/// The results of a bake, each with a hash of all that it depends on. A bake of the same level after an edit
/// takes from it what the edit cannot have changed
/// ([`SandwichBaker::with_cache`](crate::SandwichBaker::with_cache)), and has the same result as without.
///
/// A result depends on its viewcell, the viewcells in its group (up to 16 neighbours), the settings, and a
/// part of the objects. A group for which all *tiles* that its sweep has opened, the parts of the level that
/// are seen from it or near, are as they were costs nothing. If a tile has changed, the group is swept again;
/// if that leaves the same objects as before, its viewcells cost nothing, and otherwise a viewcell costs a
/// sweep if that leaves the same. Objects may be inserted, removed or renumbered, and viewcells too.
///
/// ```
/// use visibility_bake::{BakeCache, SandwichBaker, Settings};
/// use visibility_core::{bake::Bake, glam::DVec3, pvs::{Viewcell, Viewcells}, Aabb, Scene};
/// let mut scene = Scene::new();
/// let id = scene.insert(Aabb::from_arrays([5.0; 3], [6.0; 3]));
/// let cells = Viewcells::new([Viewcell::from_box(DVec3::ZERO, DVec3::ONE)]);
/// let first = Bake::new(SandwichBaker::new(&scene, &cells, Settings::default())).run();
/// let kept: Vec<u8> = first.cache.to_bytes();
///
/// scene.set_bounds(id, Aabb::from_arrays([7.0; 3], [8.0; 3]))?;
/// let cache = BakeCache::from_bytes(&kept)?;
/// let second = Bake::new(SandwichBaker::new(&scene, &cells, Settings::default()).with_cache(cache)).run();
/// assert_eq!((first.reused, second.reused), (0, 0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct BakeCache {
    /// Groups in any order, with what was found for their viewcells.
    groups: Vec<(Arc<GroupRecord>, Vec<CellRecord>)>,
    /// Index of a group by the hash of its viewcells and settings.
    by_question: HashMap<u64, usize>,
    /// Index of a group by its key.
    by_key: HashMap<u64, usize>,
    /// Indices of a group and of a viewcell in it, by the hash of the viewcell.
    by_cell: HashMap<u64, (usize, usize)>,
}

impl BakeCache {
    /// Adds a group. Of two with the same viewcells and settings, the first stays.
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

    /// Returns what was found for some viewcells with some settings, by a hash of both.
    pub(crate) fn answer(&self, question: u64) -> Option<(&Arc<GroupRecord>, &[CellRecord])> {
        let (group, cells) = &self.groups[*self.by_question.get(&question)?];
        Some((group, cells))
    }

    /// Returns what was found for the viewcells of a group.
    pub(crate) fn group(&self, key: u64) -> Option<&[CellRecord]> {
        self.by_key.get(&key).map(|&number| &self.groups[number].1[..])
    }

    /// Returns what was found for a viewcell. The numbers of its objects are those of another group.
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
    /// [`FormatError`] if they are damaged or something else. Forged bytes are not detected: a bake is as
    /// trustworthy as the results that it takes.
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
