//! The file that a game loads: viewcells, and for each the objects that count as visible.
//!
//! # Format
//! The header of the [binary format](visibility_core::binary_format), `VISI-SET`, version 1, with a hash of
//! the bounds of the scene's objects as its fingerprint; the greatest index of an object plus 1 and the
//! number of viewcells (`u32` each); for each viewcell six `f64` of its corners, the number of its planes
//! (`u32`) and four `f64` for each; the number of bytes of the sets (`u32`), and these as a
//! [`Pvs`](visibility_core::pvs) of objects.

use crate::fingerprint::bounds_fingerprint;
use std::fmt;
use visibility_core::Scene;
use visibility_core::binary_format::{Format, FormatError, Reader, Writer};
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Pvs, PvsError, PvsTargets, ScenePvs, Viewcell, ViewcellId, Viewcells};

const FORMAT: Format = Format { magic: *b"VISI-SET", version: 1 };

/// Most neighbours of a viewcell whose rows are tried as bases of its own.
const BASES: usize = 12;

/// Viewcells and their potentially visible sets, for a scene with the objects that it was baked from.
///
/// ```
/// use std::sync::Arc;
/// use visibility_bake::BakedSet;
/// use visibility_core::{glam::DVec3, pvs::{PvsCuller, Viewcell, Viewcells}, Aabb, Scene};
/// let mut scene = Scene::new();
/// scene.insert(Aabb::from_arrays([5.0; 3], [6.0; 3]));
/// let cells = Viewcells::new([Viewcell::from_box(DVec3::ZERO, DVec3::ONE)]);
/// let bytes = BakedSet::new(&scene, cells, &[vec![0]])?.to_bytes();
/// let culler = PvsCuller::new(Arc::new(BakedSet::from_bytes(&bytes)?.for_scene(&scene)?));
/// # let _ = culler;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Debug)]
pub struct BakedSet {
    fingerprint: u64,
    index_limit: usize,
    viewcells: Viewcells,
    pvs: Pvs,
}

/// Why a set cannot be made, read or used.
#[derive(Clone, PartialEq, Debug)]
pub enum BakedSetError {
    /// The bytes are damaged, or something else.
    Format(FormatError),
    /// The rows cannot be stored, or were stored wrongly.
    Pvs(PvsError),
    /// The numbers of viewcells and of rows differ.
    Rows {
        /// Number of viewcells.
        viewcells: usize,
        /// Number of rows.
        rows: usize,
    },
    /// The objects of the scene are not, or not where, they were when the set was baked.
    OtherScene,
}

impl fmt::Display for BakedSetError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Format(error) => write!(f, "{error}"),
            Self::Pvs(error) => write!(f, "{error}"),
            Self::Rows { viewcells, rows } => write!(f, "{viewcells} viewcells, but {rows} rows"),
            Self::OtherScene => {
                write!(f, "the set was baked from a scene with other objects, or objects in other places")
            }
        }
    }
}

impl std::error::Error for BakedSetError {}

impl From<FormatError> for BakedSetError {
    fn from(error: FormatError) -> Self {
        Self::Format(error)
    }
}

impl From<PvsError> for BakedSetError {
    fn from(error: PvsError) -> Self {
        Self::Pvs(error)
    }
}

impl BakedSet {
    /// Compresses the rows of viewcells: the indices of the objects that count as visible, ascending. A row
    /// may be stored as the difference from the row of a viewcell that touches its own.
    ///
    /// # Errors
    /// [`BakedSetError::Rows`], [`BakedSetError::Pvs`].
    pub fn new<R: AsRef<[u32]>>(
        scene: &Scene,
        viewcells: Viewcells,
        rows: &[R],
    ) -> Result<Self, BakedSetError> {
        let (cells, index_limit) = (viewcells.cells(), scene.index_limit());
        if cells.len() != rows.len() {
            return Err(BakedSetError::Rows { viewcells: cells.len(), rows: rows.len() });
        }
        let pvs = Pvs::new(PvsTargets::Objects, index_limit, rows, |ViewcellId(number)| {
            let cell = &cells[number as usize];
            let mut bases = Vec::new();
            viewcells.for_each_touching(cell.min, cell.max, |other| {
                if other.0 < number && bases.len() < BASES {
                    bases.push(other);
                }
            });
            bases
        })?;
        Ok(Self { fingerprint: bounds_fingerprint(scene), index_limit, viewcells, pvs })
    }

    /// Returns the viewcells.
    pub fn viewcells(&self) -> &Viewcells {
        &self.viewcells
    }

    /// Returns the sets, of object indices, by viewcell.
    pub fn pvs(&self) -> &Pvs {
        &self.pvs
    }

    /// Returns the sets for a [`PvsCuller`](visibility_core::pvs::PvsCuller). Objects that were inserted
    /// since the bake count as visible.
    ///
    /// # Errors
    /// [`BakedSetError::OtherScene`] unless the scene has just the objects of the bake, with the same indices
    /// and bounds.
    pub fn for_scene(self, scene: &Scene) -> Result<ScenePvs, BakedSetError> {
        if self.index_limit != scene.index_limit() || self.fingerprint != bounds_fingerprint(scene) {
            return Err(BakedSetError::OtherScene);
        }
        let pairs: Vec<_> = scene.ids().map(|id| (id, id.index() as u32)).collect();
        Ok(ScenePvs::new(scene, self.pvs, self.viewcells, pairs))
    }

    /// Returns the bytes of the file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut to = Writer::new(FORMAT, 0, self.fingerprint);
        to.u32(self.index_limit as u32);
        to.u32(self.viewcells.cells().len() as u32);
        for cell in self.viewcells.cells() {
            let corners = cell.min.to_array().into_iter().chain(cell.max.to_array());
            to.u64s(corners.map(f64::to_bits));
            to.u32(cell.planes.len() as u32);
            for plane in &cell.planes {
                to.u64s(plane.normal.to_array().into_iter().chain([plane.offset]).map(f64::to_bits));
            }
        }
        to.u32(self.pvs.as_bytes().len() as u32);
        to.bytes(self.pvs.as_bytes());
        to.finish()
    }

    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// [`BakedSetError`] if they are damaged or something else. The bytes may be forged.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, BakedSetError> {
        let mut from = Reader::new(bytes, FORMAT)?;
        let fingerprint = from.fingerprint();
        from.expect(0, fingerprint)?;
        let (index_limit, count) = (from.u32()? as usize, from.u32()?);
        let floats = |from: &mut Reader<'_>, count| -> Result<Vec<f64>, FormatError> {
            Ok(from.u64s(count)?.into_iter().map(f64::from_bits).collect())
        };
        let mut cells = Vec::new();
        for _ in 0..count {
            let corners = floats(&mut from, 6)?;
            let mut cell =
                Viewcell::from_box(DVec3::from_slice(&corners[..3]), DVec3::from_slice(&corners[3..]));
            for _ in 0..from.u32()? {
                let plane = floats(&mut from, 4)?;
                cell.planes.push(Plane::new(DVec3::from_slice(&plane), plane[3]));
            }
            cells.push(cell);
        }
        let length = from.u32()? as usize;
        let pvs = Pvs::from_bytes(from.bytes(length)?.to_vec())?;
        from.end()?;
        if pvs.viewcell_count() != cells.len() {
            return Err(BakedSetError::Rows { viewcells: cells.len(), rows: pvs.viewcell_count() });
        }
        Ok(Self { fingerprint, index_limit, viewcells: Viewcells::new(cells), pvs })
    }
}
