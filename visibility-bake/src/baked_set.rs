//! The file that a game loads: viewcells, and for each viewcell the objects that count as visible.
//!
//! Objects that are seen from the same viewcells form a class. The rows of viewcells list classes, which are
//! a tenth to a half as many as the objects in the tested scenes. Classes that are seen from nearly the same
//! viewcells have consecutive numbers, so that rows consist of few runs.
//!
//! The format of the file is described in `docs/formats.md` of the repository.

use crate::cell_sandwich::CellSandwich;
use crate::deflated::{deflated, inflated};
use crate::fingerprints::BakeSource;
use crate::object_classes::{class_bytes, classes, count_classes, for_each_in_classes};
use crate::object_facts::bounds_fingerprint;
use crate::tiled_scene::TiledScene;
use std::borrow::Cow;
use std::fmt;
use visibility_core::binary_format::{Format, FormatError, Reader, Writer};
use visibility_core::bits::Bits;
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;
use visibility_core::level_version::level_object;
use visibility_core::pvs::{
    Pvs, PvsError, PvsTargets, SampledDegree, SampledDegrees, ScenePvs, Viewcell, ViewcellId, Viewcells,
    check_rows,
};
use visibility_core::{Aabb, Object, ObjectId, Scene, level_version};

const FORMAT: Format = Format { magic: *b"VISI-SET", version: 10 };

/// Exclusive upper limit of the object indices that the classes can store.
const INDEX_LIMIT: usize = 1 << 29;

/// Greatest number of planes of a viewcell. A search for the viewcells at a near plane clips by all of them.
const PLANES: usize = 1 << 12;

/// Greatest number of touching viewcells whose rows are tried as the base from which a viewcell's row is
/// stored as a difference.
const BASES: usize = 12;

/// Viewcells and their potentially visible sets, for scenes with the objects of the bake.
///
/// A set is valid for one [version](Self::version) of its level, a hash of all objects with their triangles:
/// a wall that gets a door has another version, also if its bounding box stays the same.
/// [`for_scene`](Self::for_scene) compares the version of a whole scene. A game whose scene has only boxes
/// stores the version in its level, as `bake` prints it, and passes it to [`for_level`](Self::for_level) or
/// [`compared`](Self::compared). Cullers of a set that was not compared with a version are
/// [approximate](visibility_core::Accuracy::Approximate).
///
/// ```
/// use std::sync::Arc;
/// use visibility_bake::BakedSet;
/// use visibility_core::{glam::DVec3, pvs::{PvsCuller, Viewcell, Viewcells}, Aabb, Scene};
/// let mut scene = Scene::new();
/// scene.insert(Aabb::from_arrays([5.0; 3], [6.0; 3]));
/// let cells = Viewcells::new([Viewcell::from_box(DVec3::ZERO, DVec3::ONE)]);
/// let bytes = BakedSet::from_rows(&scene, cells, &[vec![0]])?.to_bytes();
/// let culler = PvsCuller::new(Arc::new(BakedSet::from_bytes(&bytes)?.for_scene(&scene)?));
/// # let _ = culler;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Debug)]
pub struct BakedSet {
    /// Hash of the level's data that the bake depends on, see [`level_version`].
    version: u64,
    /// Hash of the origin of the scene, and of the indices and bounds of its objects.
    bounds: u64,
    /// Whether the set was compared with the version of the level that it is used for. If not, its cullers
    /// are approximate.
    is_checked: bool,
    /// Greatest index of an object plus 1.
    index_limit: usize,
    /// Indices of the objects that occluded in the bake.
    occluders: Bits,
    viewcells: Viewcells,
    /// Indices of the objects of each class, ascending, as encoded by [`class_bytes`]: a class of one object
    /// takes one or two bytes. Objects that no viewcell sees are in no class.
    classes: Vec<u8>,
    class_count: usize,
    /// For each viewcell, the numbers of the classes seen from it. The number after the last class stands for
    /// all objects of no class, and is seen from no viewcell.
    pvs: Pvs,
    /// Degrees in which the viewcells see the classes. `None` if they were not sampled.
    degrees: Option<SampledDegrees>,
}

/// Reasons why a set cannot be made, read or used.
#[derive(Clone, PartialEq, Debug)]
#[non_exhaustive]
pub enum BakedSetError {
    /// The bytes are damaged, or are not those of a baked set.
    Format(FormatError),
    /// The rows cannot be stored, or the stored rows are invalid.
    Pvs(PvsError),
    /// The number of viewcells differs from the number of rows.
    Rows {
        /// Number of viewcells that were passed, or that the file has.
        viewcells: usize,
        /// Number of rows that were passed, or that the file has.
        rows: usize,
    },
    /// A viewcell has more than 4,096 planes.
    Planes {
        /// The first such viewcell.
        viewcell: ViewcellId,
    },
    /// The degrees of visibility of a viewcell are not one for each object of its row.
    Degrees {
        /// The first such viewcell.
        viewcell: ViewcellId,
    },
    /// The scene has other objects than the bake, or objects at other places; or the results of a bake are of
    /// another version of the scene.
    OtherScene,
    /// The results of a bake are of other viewcells.
    OtherViewcells,
    /// The set was baked from another version of the level.
    OtherVersion {
        /// Version from which the set was baked.
        baked: u64,
        /// Version of the level with which the set was compared.
        level: u64,
    },
}

impl fmt::Display for BakedSetError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Format(error) => write!(f, "{error}"),
            Self::Pvs(error) => write!(f, "{error}"),
            Self::Rows { viewcells, rows } => write!(f, "{viewcells} viewcells, but {rows} rows"),
            Self::Planes { viewcell } => {
                write!(f, "viewcell {} has more than {PLANES} planes", viewcell.0)
            }
            Self::Degrees { viewcell } => {
                write!(f, "viewcell {} has not one degree for each object of its row", viewcell.0)
            }
            Self::OtherScene => write!(
                f,
                "the set was baked from a scene with other objects, or with other triangles, occluders, flags \
                 or places of objects: bake again"
            ),
            Self::OtherViewcells => write!(f, "the results are of other viewcells"),
            Self::OtherVersion { baked, level } => write!(
                f,
                "the set was baked from version {baked:016x} of the level, which is now {level:016x}: bake \
                 again"
            ),
        }
    }
}

impl std::error::Error for BakedSetError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Format(error) => Some(error),
            Self::Pvs(error) => Some(error),
            _ => None,
        }
    }
}

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

/// Returns the indices and bounds of the objects of a scene.
fn boxes(scene: &Scene) -> impl Iterator<Item = (u32, Aabb)> {
    scene.ids().filter_map(|id| Some((id.index() as u32, scene.object(id).ok()?.bounds)))
}

/// Returns the indices of the objects that are flagged as occluders and are on some layer, as a set for
/// indices below `index_limit`. `objects` are all objects of the level with their indices.
fn occluders(index_limit: usize, objects: impl Iterator<Item = (u32, Object)>) -> Bits {
    let mut bits = Bits::new(index_limit);
    for (index, object) in objects {
        if object.occluder && object.layers != 0 {
            bits.insert(index as usize);
        }
    }
    bits
}

/// Returns the rows of the results of a bake.
fn reported(found: &[CellSandwich]) -> Vec<Cow<'_, [u32]>> {
    found.iter().map(CellSandwich::reported).collect()
}

/// Checks that results of a bake are of the level with a version, and of viewcells.
fn check_source(source: BakeSource, version: u64, viewcells: &Viewcells) -> Result<(), BakedSetError> {
    let present = BakeSource::new(version, viewcells);
    if source.level != present.level {
        return Err(BakedSetError::OtherScene);
    }
    if source == present { Ok(()) } else { Err(BakedSetError::OtherViewcells) }
}

impl BakedSet {
    /// Makes the set of a bake: `found` is the result for each viewcell, in order, and `source` the level and
    /// the viewcells that it is of. Both come from a [`SandwichOutcome`](crate::SandwichOutcome), or from
    /// [`assemble`](crate::assemble) and its baker.
    ///
    /// # Errors
    /// [`BakedSetError::OtherScene`] if `source` has another [version](crate::level_version) of the level
    /// than `scene`, as after an edit. [`BakedSetError::OtherViewcells`] if it has other viewcells. Otherwise
    /// the errors of [`from_rows`](Self::from_rows).
    pub fn new(
        scene: &Scene,
        viewcells: Viewcells,
        source: BakeSource,
        found: &[CellSandwich],
    ) -> Result<Self, BakedSetError> {
        let version = level_version(scene);
        check_source(source, version, &viewcells)?;
        Self::of_scene(scene, version, viewcells, &reported(found))
    }

    /// Makes the set of a bake, as [`new`](Self::new) does, for a level whose scene is not in memory.
    ///
    /// # Errors
    /// The errors of [`new`](Self::new).
    pub fn of_level(
        level: &TiledScene<'_>,
        viewcells: Viewcells,
        source: BakeSource,
        found: &[CellSandwich],
    ) -> Result<Self, BakedSetError> {
        check_source(source, level.version(), &viewcells)?;
        let hashes = [level.version(), level.bounds_fingerprint()];
        let occluders = occluders(level.index_limit(), level.objects());
        Self::compress(level.index_limit(), hashes, occluders, viewcells, &reported(found))
    }

    /// Compresses the rows of viewcells that were found by other means than a
    /// [`SandwichBaker`](crate::SandwichBaker). A row lists the indices of the objects that count as visible,
    /// ascending. It may be stored as the difference from the row of another viewcell that touches the row's
    /// viewcell.
    ///
    /// The caller promises that the rows are of the scene as it is now: nothing shows it, and the set takes
    /// the version of this scene. Rows from before an edit hide what the edit has brought into view.
    ///
    /// # Errors
    /// [`BakedSetError::Rows`] if there is not one row for each viewcell. [`BakedSetError::Pvs`] if a row is
    /// not strictly ascending or contains an index without an object, or if the sizes exceed 32 bits.
    /// [`BakedSetError::Planes`] if a viewcell has too many planes.
    pub fn from_rows<R: AsRef<[u32]>>(
        scene: &Scene,
        viewcells: Viewcells,
        rows: &[R],
    ) -> Result<Self, BakedSetError> {
        Self::of_scene(scene, level_version(scene), viewcells, rows)
    }

    /// Compresses rows for a scene with the version `version`.
    fn of_scene<R: AsRef<[u32]>>(
        scene: &Scene,
        version: u64,
        viewcells: Viewcells,
        rows: &[R],
    ) -> Result<Self, BakedSetError> {
        let hashes = [version, bounds_fingerprint(scene.origin(), boxes(scene))];
        let objects = scene.ids().filter_map(|id| Some((id.index() as u32, level_object(scene, id)?.0)));
        let occluders = occluders(scene.index_limit(), objects);
        Self::compress(scene.index_limit(), hashes, occluders, viewcells, rows)
    }

    fn compress<R: AsRef<[u32]>>(
        index_limit: usize,
        [version, bounds]: [u64; 2],
        occluders: Bits,
        viewcells: Viewcells,
        rows: &[R],
    ) -> Result<Self, BakedSetError> {
        let cells = viewcells.cells();
        if cells.len() != rows.len() {
            return Err(BakedSetError::Rows { viewcells: cells.len(), rows: rows.len() });
        }
        if let Some(viewcell) = cells.iter().position(|cell| cell.planes.len() > PLANES) {
            return Err(BakedSetError::Planes { viewcell: ViewcellId(viewcell as u32) });
        }
        check_rows(rows, index_limit)?;
        if index_limit > INDEX_LIMIT {
            return Err(PvsError::Size.into());
        }
        let (classes, rows) = classes(rows, index_limit);
        let pvs = stored_rows(&viewcells, classes.len(), &rows)?;
        let (class_count, classes) = (classes.len(), class_bytes(&classes));
        let (is_checked, degrees) = (false, None);
        Ok(Self {
            version,
            bounds,
            is_checked,
            index_limit,
            occluders,
            viewcells,
            classes,
            class_count,
            pvs,
            degrees,
        })
    }

    /// Adds degrees of visibility, in place of those that the set has: for each viewcell, the degree of each
    /// object of its [row](Self::row), which a [`DegreeSampler`](crate::DegreeSampler) with `eyes` eyes
    /// estimated. They hide nothing, unless a culler is [told
    /// to](visibility_core::pvs::PvsCuller::with_least_degree). Time is linear in the lengths of the rows,
    /// plus the sorting of classes.
    ///
    /// # Errors
    /// [`BakedSetError::Rows`] if there is not one list for each viewcell, [`BakedSetError::Degrees`] if a
    /// list has not one degree for each object, [`BakedSetError::Pvs`] if `eyes` is 0 or the sizes exceed 32
    /// bits.
    pub fn with_degrees(self, degrees: &[Vec<SampledDegree>], eyes: u32) -> Result<Self, BakedSetError> {
        let count = self.viewcells.cells().len();
        if degrees.len() != count {
            return Err(BakedSetError::Rows { viewcells: count, rows: degrees.len() });
        }
        let mut objects = vec![Vec::new(); self.class_count];
        for_each_in_classes(&self.classes, self.index_limit, |class, index| objects[class].push(index));
        // For each degree, the rows of the objects with that degree or a greater one. Objects of one class
        // have the same degrees everywhere.
        let mut rows: [Vec<Vec<u32>>; 4] = Default::default();
        let mut bits = Vec::new();
        for (viewcell, degrees) in (0..).map(ViewcellId).zip(degrees) {
            self.pvs.write_bits(viewcell, &mut bits);
            let bits = Bits::from(std::mem::take(&mut bits));
            let classes = bits.iter().filter_map(|class| objects.get(class));
            let mut row: Vec<u32> = classes.flatten().copied().collect();
            row.sort_unstable();
            if row.len() != degrees.len() {
                return Err(BakedSetError::Degrees { viewcell });
            }
            for (least, rows) in SampledDegree::ALL.into_iter().zip(&mut rows) {
                let of = row.iter().zip(degrees).filter(|&(_, &degree)| degree >= least);
                rows.push(of.map(|(&index, _)| index).collect());
            }
        }
        let all: Vec<&Vec<u32>> = rows.iter().flatten().collect();
        let (classes, rows) = classes(&all, self.index_limit);
        let stored =
            |at: usize| stored_rows(&self.viewcells, classes.len(), &rows[at * count..(at + 1) * count]);
        let pvs = stored(0)?;
        let degrees = Some(SampledDegrees::new(&pvs, eyes, [stored(1)?, stored(2)?, stored(3)?])?);
        let (class_count, classes) = (classes.len(), class_bytes(&classes));
        Ok(Self { classes, class_count, pvs, degrees, ..self })
    }

    /// Returns the degrees of visibility of the set. `None` if they were not
    /// [sampled](crate::DegreeSampler).
    pub fn degrees(&self) -> Option<&SampledDegrees> {
        self.degrees.as_ref()
    }

    /// Returns the version of the level from which the set was baked: its
    /// [`level_version`](crate::level_version) at that time.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Returns whether the set was [compared](Self::compared) with a version of the level. If not, its
    /// cullers are approximate.
    pub fn is_checked(&self) -> bool {
        self.is_checked
    }

    /// Returns the viewcells, in the order of the bake.
    pub fn viewcells(&self) -> &Viewcells {
        &self.viewcells
    }

    /// Returns the indices of the objects that count as visible from a viewcell, ascending. Empty for an
    /// unknown viewcell. Decodes all classes of objects, in time linear in the number of objects of the set.
    pub fn row(&self, viewcell: ViewcellId) -> Vec<u32> {
        let mut bits = Vec::new();
        self.pvs.write_bits(viewcell, &mut bits);
        let bits = Bits::from(bits);
        let mut row = Vec::new();
        for_each_in_classes(&self.classes, self.index_limit, |class, index| {
            if bits.contains(class) {
                row.push(index);
            }
        });
        row.sort_unstable();
        row
    }

    /// Returns the number of bytes of the sets in memory, without the viewcells.
    pub fn set_bytes(&self) -> usize {
        let of_degrees = |least| Some(self.degrees()?.at_least(least)?.as_bytes().len());
        let degrees: usize = SampledDegree::ALL.into_iter().filter_map(of_degrees).sum();
        self.classes.len() + self.pvs.as_bytes().len() + degrees
    }

    /// Returns an exclusive upper bound on the indices of the objects that the set was baked from.
    pub fn index_limit(&self) -> usize {
        self.index_limit
    }

    /// Returns whether the object with an index occluded in the bake. False for an unknown index.
    pub fn is_occluder(&self, index: u32) -> bool {
        self.occluders.contains(index as usize)
    }

    /// Returns the sets for a [`PvsCuller`](visibility_core::pvs::PvsCuller). Objects that are inserted or
    /// changed from now on count as visible. Once an occluder of the bake has changed, all objects count as
    /// visible. Time is linear in the number of triangles.
    ///
    /// # Errors
    /// [`BakedSetError::OtherScene`] unless the scene has the [version](crate::level_version) from which the
    /// set was baked: exactly the objects of the bake, with the same indices, bounds, flags, triangles and
    /// occluder meshes.
    pub fn for_scene(self, scene: &Scene) -> Result<ScenePvs, BakedSetError> {
        if self.version != level_version(scene) {
            return Err(BakedSetError::OtherScene);
        }
        let version = Some(self.version);
        self.for_level(scene, version)
    }

    /// Returns the sets as [`for_scene`](Self::for_scene) does, for a scene that has only the boxes of the
    /// objects. `version` is the version of the level, which `bake` printed and the level stores. Without a
    /// version, cullers are [approximate](ScenePvs::unchecked): they may hide an object that an edit inside
    /// an unchanged box has made visible.
    ///
    /// # Errors
    /// [`BakedSetError::OtherScene`] unless the scene has exactly the objects of the bake, with the same
    /// indices and bounds. [`BakedSetError::OtherVersion`] if the set was baked from another version.
    pub fn for_level(self, scene: &Scene, version: Option<u64>) -> Result<ScenePvs, BakedSetError> {
        let set = self.compared(version, scene.origin(), boxes(scene))?;
        Ok(set.for_objects(scene, scene.ids().map(|id| (id, id.index() as u32))))
    }

    /// Returns the sets for a scene in which the objects of the bake have other indices or are among other
    /// objects, such as one that an engine fills with its entities. Each pair is an object of the scene and
    /// its index in the bake. Objects without a pair, or with an index not below
    /// [`index_limit`](Self::index_limit), count as visible. Several objects may have the same index, if they
    /// are parts of one baked object.
    ///
    /// The scene is not compared with that of the bake, unlike in [`for_scene`](Self::for_scene): an object
    /// that is elsewhere than in the bake may be hidden though it is visible. Cullers are
    /// [approximate](ScenePvs::unchecked), unless the set was [compared](Self::compared) with the version of
    /// the level; the caller then promises that the objects are those of the level. Cullers are also
    /// approximate if no object has the index of an [occluder](Self::is_occluder) of the bake, since objects
    /// may then be visible where that occluder is missing.
    pub fn for_objects(&self, scene: &Scene, objects: impl IntoIterator<Item = (ObjectId, u32)>) -> ScenePvs {
        let objects: Vec<(ObjectId, u32)> =
            objects.into_iter().filter(|&(id, _)| scene.contains(id)).collect();
        // For each requested index, its target. An object of no class gets the target that no viewcell sees.
        // The set may be forged, so memory must depend on the caller's objects only.
        let mut targets: Vec<(u32, u32)> = objects
            .iter()
            .map(|&(_, index)| index)
            .map(|index| {
                let is_known = (index as usize) < self.index_limit;
                // No set has the target `u32::MAX`, so objects with this target are never hidden.
                (index, if is_known { self.class_count as u32 } else { u32::MAX })
            })
            .collect();
        targets.sort_unstable();
        targets.dedup();
        let place = |targets: &[(u32, u32)], index| targets.binary_search_by_key(&index, |&(of, _)| of).ok();
        for_each_in_classes(&self.classes, self.index_limit, |class, index| {
            if let Some(at) = place(&targets, index) {
                targets[at].1 = class as u32;
            }
        });
        let target = |index| place(&targets, index).map_or(u32::MAX, |at| targets[at].1);
        let pairs = objects.iter().map(|&(id, index)| (id, target(index)));
        let occluders = objects.iter().filter(|&&(_, index)| self.is_occluder(index));
        let mut sets = ScenePvs::new(scene, self.pvs.clone(), self.viewcells.clone(), pairs)
            .with_occluders(scene, occluders.map(|&(id, _)| id));
        if let Some(degrees) = &self.degrees {
            // They are of this PVS: the set was made or read with both.
            let _ = sets.set_degrees(degrees.clone());
        }
        let has_occluders = self.occluders.iter().all(|index| place(&targets, index as u32).is_some());
        if self.is_checked && has_occluders { sets } else { sets.unchecked() }
    }

    /// Compares the set with a level, and returns it for use there. `version` is the version of the level;
    /// without one, only the objects are compared, and cullers stay [approximate](ScenePvs::unchecked).
    /// `bounds` are the index of each object and its bounds relative to the scene's `origin`, by ascending
    /// index.
    ///
    /// # Errors
    /// [`BakedSetError::OtherScene`] if an object is missing, is another one, or has other bounds;
    /// [`BakedSetError::OtherVersion`] if the set was baked from another version.
    pub fn compared(
        self,
        version: Option<u64>,
        origin: DVec3,
        bounds: impl IntoIterator<Item = (u32, Aabb)>,
    ) -> Result<Self, BakedSetError> {
        if bounds_fingerprint(origin, bounds) != self.bounds {
            return Err(BakedSetError::OtherScene);
        }
        match version {
            Some(level) if level != self.version => {
                Err(BakedSetError::OtherVersion { baked: self.version, level })
            }
            _ => Ok(Self { is_checked: version.is_some(), ..self }),
        }
    }

    /// Returns the bytes of the file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut to = Writer::new(FORMAT, 0, self.version);
        to.u64(self.bounds);
        to.u32(self.index_limit as u32);
        to.u64s(self.occluders.words().iter().copied());
        let divided = self.viewcells.divided_box();
        to.u32(divided.is_some().into());
        if let Some([min, max]) = divided {
            let numbers = [min.to_array(), max.to_array()].concat().into_iter();
            to.u64s(numbers.chain([self.viewcells.misplacement()]).map(f64::to_bits));
        }
        to.u32(self.viewcells.cells().len() as u32);
        // One coordinate of all viewcells is stored after another, so that equal numbers are close together.
        for axis in 0..3 {
            to.u64s(self.viewcells.cells().iter().map(|cell| cell.min[axis].to_bits()));
            to.u64s(self.viewcells.cells().iter().map(|cell| cell.max[axis].to_bits()));
        }
        for cell in self.viewcells.cells() {
            to.u32(cell.planes.len() as u32);
            for plane in &cell.planes {
                to.u64s(plane.normal.to_array().into_iter().chain([plane.offset]).map(f64::to_bits));
            }
        }
        to.u32(self.classes.len() as u32);
        to.bytes(&self.classes);
        to.u32(self.pvs.as_bytes().len() as u32);
        to.bytes(self.pvs.as_bytes());
        to.u32(self.degrees.as_ref().map_or(0, SampledDegrees::eyes));
        if let Some(degrees) = &self.degrees {
            to.u64s(SampledDegrees::LIMITS.map(f64::to_bits));
            for set in SampledDegree::ALL.into_iter().filter_map(|least| degrees.at_least(least)) {
                to.u32(set.as_bytes().len() as u32);
                to.bytes(set.as_bytes());
            }
        }
        deflated(FORMAT, self.version, to)
    }

    /// Reads the bytes of a baked set's file.
    ///
    /// # Errors
    /// [`BakedSetError`] if the bytes are damaged, inconsistent, or not those of a baked set. Forged bytes
    /// are safe to read. Offsets in errors refer to the content before compression.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, BakedSetError> {
        let plain = inflated(bytes, FORMAT)?;
        let mut from = Reader::new(&plain, FORMAT)?;
        let version = from.fingerprint();
        from.expect(0, version)?;
        let (bounds, index_limit) = (from.u64()?, from.u32()? as usize);
        if index_limit > INDEX_LIMIT {
            return Err(from
                .content_error("the greatest index of an object is beyond those of any set")
                .into());
        }
        let occluders = Bits::from(from.u64s(index_limit.div_ceil(64))?);
        let floats = |from: &mut Reader<'_>, count| -> Result<Vec<f64>, FormatError> {
            Ok(from.u64s(count)?.into_iter().map(f64::from_bits).collect())
        };
        let divided = match from.u32()? {
            0 => None,
            1 => Some(floats(&mut from, 7)?),
            _ => return Err(from.content_error("the flag of a divided box is neither 0 nor 1").into()),
        };
        let count = from.u32()? as usize;
        // Coordinates are stored by axis and corner, which compresses better than viewcell by viewcell.
        let corners = floats(&mut from, count.saturating_mul(6))?;
        let mut cells = Vec::new();
        for number in 0..count {
            let corner =
                |first: usize| DVec3::from_array([0, 2, 4].map(|at| corners[(first + at) * count + number]));
            let mut cell = Viewcell::from_box(corner(0), corner(1));
            let planes = from.u32()?;
            if planes as usize > PLANES {
                return Err(BakedSetError::Planes { viewcell: ViewcellId(number as u32) });
            }
            for _ in 0..planes {
                let plane = floats(&mut from, 4)?;
                cell.planes.push(Plane::new(DVec3::from_slice(&plane), plane[3]));
            }
            cells.push(cell);
        }
        let length = from.u32()? as usize;
        let classes = from.bytes(length)?.to_vec();
        let class_count = count_classes(&classes, index_limit)
            .ok_or_else(|| from.content_error("classes of objects are out of order, repeated or cut off"))?;
        let length = from.u32()? as usize;
        let pvs = Pvs::from_bytes(from.bytes(length)?.to_vec())?;
        let eyes = from.u32()?;
        let mut sets = None;
        if eyes > 0 {
            if floats(&mut from, 3)? != SampledDegrees::LIMITS {
                return Err(from
                    .content_error("the limits of the degrees are not those of this release")
                    .into());
            }
            let mut next = || -> Result<Pvs, BakedSetError> {
                let length = from.u32()? as usize;
                Ok(Pvs::from_bytes(from.bytes(length)?.to_vec())?)
            };
            sets = Some([next()?, next()?, next()?]);
        }
        from.end()?;
        // The parts of the file must agree, or a query would read beyond the end of one.
        if pvs.viewcell_count() != cells.len() {
            return Err(BakedSetError::Rows { viewcells: cells.len(), rows: pvs.viewcell_count() });
        }
        if pvs.target_count() != class_count + 1 {
            return Err(from.content_error("the numbers of classes and of targets differ").into());
        }
        let degrees = sets.map(|sets| SampledDegrees::new(&pvs, eyes, sets)).transpose()?;
        let viewcells = match divided.as_deref() {
            Some(&[a, b, c, d, e, f, misplacement]) => {
                Viewcells::of_divided_box(cells, DVec3::new(a, b, c), DVec3::new(d, e, f), misplacement)
            }
            _ => Viewcells::new(cells),
        };
        let is_checked = false;
        Ok(Self {
            version,
            bounds,
            is_checked,
            index_limit,
            occluders,
            viewcells,
            classes,
            class_count,
            pvs,
            degrees,
        })
    }
}

/// Stores rows of classes. A row may be stored as the difference from that of another viewcell that touches
/// its own. The last target, the number of classes, stands for objects of no class, which no viewcell sees.
fn stored_rows(viewcells: &Viewcells, class_count: usize, rows: &[Vec<u32>]) -> Result<Pvs, PvsError> {
    Pvs::new(PvsTargets::Objects, class_count + 1, rows, |ViewcellId(number)| {
        let cell = &viewcells.cells()[number as usize];
        let mut bases = Vec::new();
        viewcells.for_each_touching(cell.min, cell.max, |other| {
            if other.0 < number && bases.len() < BASES {
                bases.push(other);
            }
        });
        bases
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn viewcells_are_read_as_they_were_written_unless_they_have_too_many_planes() {
        let mut scene = Scene::new();
        scene.insert(Aabb::from_arrays([5.0; 3], [6.0; 3]));
        let rooms = |planes: usize| {
            let planes = vec![Plane::new(DVec3::X, 1.0); planes];
            let [a, b] = [0.0, 10.0].map(|x| DVec3::new(x, 0.0, 0.0));
            [Viewcell::from_box(a, a + 10.0), Viewcell { planes, ..Viewcell::from_box(b, b + 10.0) }]
        };
        let (min, max) = (DVec3::new(-1.0, -2.0, -3.0), DVec3::new(21.0, 12.0, 13.0));
        let divided = |planes| Viewcells::of_divided_box(rooms(planes), min, max, 0.25);
        let made = |viewcells| BakedSet::from_rows(&scene, viewcells, &[vec![0], vec![]]);
        for viewcells in [Viewcells::new(rooms(PLANES)), divided(1)] {
            let set = made(viewcells.clone()).unwrap();
            let read = BakedSet::from_bytes(&set.to_bytes());
            assert_eq!(read.as_ref(), Ok(&set), "the set from its file");
            assert_eq!(read.map(|read| read.viewcells), Ok(viewcells), "the viewcells from the file");
        }
        let refused = Err(BakedSetError::Planes { viewcell: ViewcellId(1) });
        assert_eq!(made(divided(PLANES + 1)), refused, "a plane too many");
        let forged = BakedSet { viewcells: divided(PLANES + 1), ..made(divided(1)).unwrap() };
        assert_eq!(BakedSet::from_bytes(&forged.to_bytes()), refused, "a plane too many in a file");
    }

    #[test]
    fn occluders_are_flagged_and_on_a_layer() {
        let plain = Object { occluder: true, ..Object::new(Aabb::from_arrays([0.0; 3], [1.0; 3])) };
        let all = [plain, Object { layers: 0, ..plain }, Object { occluder: false, ..plain }];
        let bits = occluders(3, (0..).zip(all));
        assert_eq!([0, 1, 2].map(|index| bits.contains(index)), [true, false, false], "occluders");
    }
}
