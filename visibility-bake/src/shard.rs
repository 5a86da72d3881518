//! Parts of a bake that were computed separately, by threads or machines, and their assembly.

use crate::cell_sandwich::CellSandwich;
use crate::deflated::{deflated, inflated};
use crate::sandwich_baker::SandwichBaker;
use crate::sandwich_outcome::SandwichOutcome;
use std::collections::BTreeMap;
use std::fmt;
use visibility_core::bake::Bake;
use visibility_core::binary_format::{Format, FormatError, Reader, Writer};

const FORMAT: Format = Format { magic: *b"VISSHARD", version: 3 };

/// The sandwiches of a range of viewcells: a pure function of the scene, all viewcells, the settings and the
/// range. Its bytes carry a checksum and the
/// [fingerprint of the whole bake](SandwichBaker::whole_fingerprint).
///
/// ```
/// use visibility_bake::{SandwichBaker, SandwichSettings, Shard, assemble};
/// use visibility_core::{glam::DVec3, pvs::{Viewcell, Viewcells}, Aabb, Scene};
/// let mut scene = Scene::new();
/// scene.insert(Aabb::from_arrays([5.0; 3], [6.0; 3]));
/// let cell = |x: f64| Viewcell::from_box(DVec3::splat(x), DVec3::splat(x + 1.0));
/// let cells = Viewcells::new([cell(0.0), cell(1.0), cell(2.0)]);
/// let baker = || SandwichBaker::new(&scene, &cells, SandwichSettings::default());
/// let shard = |range| Shard::bake(baker().with_range(range));
/// let stored = [shard(2..3).to_bytes(), shard(0..2).to_bytes()];
/// let shards = stored.iter().map(|bytes| Shard::from_bytes(bytes)).collect::<Result<Vec<_>, _>>()?;
/// assert_eq!(assemble(&baker(), shards)?.len(), 3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Shard {
    /// [Fingerprint](SandwichBaker::whole_fingerprint) of the whole bake.
    pub fingerprint: u64,
    /// Number, in the whole bake, of the first viewcell of the shard.
    pub first: usize,
    /// Result for each viewcell of the range, from viewcell `first` on.
    pub cells: Vec<CellSandwich>,
}

impl Shard {
    /// Runs the bake for the range of a baker. For a level in a file, run the [`Bake`] yourself and check
    /// [`SandwichOutcome::error`] before you make a shard with [`new`](Self::new).
    pub fn bake(baker: SandwichBaker<'_>) -> Self {
        let fingerprint = baker.whole_fingerprint();
        Self::new(fingerprint, Bake::new(baker).run())
    }

    /// Makes a shard from the outcome of a bake and the bake's
    /// [fingerprint](SandwichBaker::whole_fingerprint).
    pub fn new(fingerprint: u64, outcome: SandwichOutcome) -> Self {
        Self { fingerprint, first: outcome.first, cells: outcome.cells }
    }

    /// Returns the shard as bytes in the [binary format](visibility_core::binary_format).
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut to = Writer::new(FORMAT, 0, self.fingerprint);
        to.u64(self.first as u64);
        to.u32(self.cells.len() as u32);
        for cell in &self.cells {
            cell.save(&mut to);
        }
        deflated(FORMAT, self.fingerprint, to)
    }

    /// Reads the bytes of a shard.
    ///
    /// # Errors
    /// [`FormatError`] if the bytes are damaged, or are not those of a shard.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FormatError> {
        let plain = inflated(bytes, FORMAT)?;
        let mut from = Reader::new(&plain, FORMAT)?;
        let fingerprint = from.fingerprint();
        from.expect(0, fingerprint)?;
        let first = usize::try_from(from.u64()?).unwrap_or(usize::MAX);
        let count = from.u32()?;
        let mut cells = Vec::new();
        for _ in 0..count {
            cells.push(CellSandwich::load(&mut from, usize::MAX)?);
        }
        from.end()?;
        Ok(Self { fingerprint, first, cells })
    }
}

/// Reasons why shards cannot be assembled to a whole bake.
#[derive(Clone, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum AssembleError {
    /// The shard at this position of the list is of another bake than that of the baker: of another scene,
    /// other viewcells or other settings.
    OtherBake(usize),
    /// The shard at this position of the list has viewcells beyond the last viewcell of the bake.
    Range(usize),
    /// The shard at this position of the list has another result for a viewcell than an earlier shard.
    Contradiction(usize),
    /// No shard contains the viewcells from the first number up to, but not including, the second.
    Missing(usize, usize),
}

impl fmt::Display for AssembleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OtherBake(at) => {
                write!(f, "shard {at} is of another scene, other viewcells or other settings")
            }
            Self::Range(at) => write!(f, "shard {at} has viewcells beyond the last"),
            Self::Contradiction(at) => write!(f, "shard {at} contradicts an earlier shard"),
            Self::Missing(from, to) => write!(f, "viewcells {from} to {} are in no shard", to - 1),
        }
    }
}

impl std::error::Error for AssembleError {}

/// Assembles the shards of the bake of a baker, given in any order. The baker is one of the level as it is
/// now; its range does not count. Several shards may contain a viewcell, for example after a part of a bake
/// was repeated on another machine. They must then have the same result for it. The results are for
/// [`BakedSet::new`](crate::BakedSet::new), with the [source](SandwichBaker::source) of the baker.
///
/// # Errors
/// [`AssembleError`] if a shard is of another bake than that of the baker, as after an edit of the level, has
/// viewcells beyond the last, or contradicts another, or if a viewcell is in no shard.
pub fn assemble(
    baker: &SandwichBaker<'_>,
    shards: impl IntoIterator<Item = Shard>,
) -> Result<Vec<CellSandwich>, AssembleError> {
    let (count, whole) = (baker.whole_count(), baker.whole_fingerprint());
    let mut cells = BTreeMap::new();
    for (at, shard) in shards.into_iter().enumerate() {
        if shard.fingerprint != whole {
            return Err(AssembleError::OtherBake(at));
        }
        let end = shard.first.checked_add(shard.cells.len()).filter(|&end| end <= count);
        let range = shard.first..end.ok_or(AssembleError::Range(at))?;
        for (number, cell) in range.zip(shard.cells) {
            if *cells.entry(number).or_insert_with(|| cell.clone()) != cell {
                return Err(AssembleError::Contradiction(at));
            }
        }
    }
    let mut next = 0;
    for &number in cells.keys().chain([&count]) {
        if number > next {
            return Err(AssembleError::Missing(next, number));
        }
        next = number + 1;
    }
    Ok(cells.into_values().collect())
}
