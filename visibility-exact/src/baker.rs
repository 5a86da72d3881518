//! Bakes of visible sets for many viewcells.

use crate::chain_scratch::ChainScratch;
use crate::culler::query;
use crate::settings::ExactSettings;
use crate::triangles::SceneTriangles;
use crate::verdict::{CellVerdicts, Verdict};
use alloc::{vec, vec::Vec};
use visibility_core::bake::Baker;
use visibility_core::binary_format::{Fingerprint, FormatError, Reader, Writer};
use visibility_core::pvs::{Pvs, PvsError, PvsTargets, Viewcell, ViewcellId, Viewcells};

/// Result of a bake for one viewcell: a sandwich of the objects that are visible from it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct BakedCell {
    /// [Indices](visibility_core::ObjectId::index) of the objects that a line of sight reaches, ascending.
    pub seen: Vec<u32>,
    /// Indices of the objects neither seen nor proven hidden, ascending. They count as visible.
    pub open: Vec<u32>,
}

/// Result of a bake of many viewcells.
#[derive(Clone, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub struct ExactOutcome {
    /// Result for each viewcell, in order. In a viewcell that was not worked on, all objects are open.
    pub cells: Vec<BakedCell>,
    /// Greatest index of an object, plus 1.
    pub index_limit: usize,
    /// Whether all viewcells were worked on.
    pub complete: bool,
}

impl ExactOutcome {
    /// Returns the share of the reported objects that are not known to be visible, from 0 to 1, over all
    /// viewcells. With proofs it bounds the share that is reported though hidden. 0 if no object is reported.
    /// Objects that rays alone missed, and objects removed as hardly visible, are not counted.
    pub fn gap(&self) -> f64 {
        let sum = |list: fn(&BakedCell) -> &Vec<u32>| -> usize {
            self.cells.iter().map(|cell| list(cell).len()).sum()
        };
        let (seen, open) = (sum(|cell| &cell.seen), sum(|cell| &cell.open));
        if open == 0 { 0.0 } else { open as f64 / (seen + open) as f64 }
    }

    /// Converts to a compressed PVS of object indices. Rows may be stored as differences from the viewcell
    /// before.
    ///
    /// # Errors
    /// [`PvsError::TooLarge`] if the PVS exceeds its storage limits.
    pub fn to_pvs(&self) -> Result<Pvs, PvsError> {
        let rows: Vec<Vec<u32>> = self
            .cells
            .iter()
            .map(|cell| {
                let mut row = [cell.seen.as_slice(), &cell.open].concat();
                row.sort_unstable();
                row
            })
            .collect();
        let before = |viewcell: ViewcellId| viewcell.0.checked_sub(1).map(ViewcellId);
        Pvs::new(PvsTargets::Objects, self.index_limit, &rows, before)
    }
}

/// Computes the visible sets of viewcells, as a [`Baker`] for a [`Bake`](visibility_core::bake::Bake): with
/// progress, stopping and resuming, on any number of threads with the same result.
///
/// The items of the bake are the viewcells; its steps are rays and nodes of the search.
///
/// ```
/// use visibility_core::{bake::Bake, glam::{DVec3, Vec3}, pvs::{Viewcell, Viewcells}, Aabb, Object, Scene};
/// use visibility_exact::{Effort, ExactBaker, SceneTriangles, ExactSettings};
/// let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|v| v + Vec3::Z * 9.0);
/// let mut scene = Scene::new();
/// let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_points(triangle)) });
/// scene.set_triangles(id, [triangle])?;
/// let triangles = SceneTriangles::new(&scene);
/// let cells = Viewcells::new([Viewcell::from_box(DVec3::ZERO, DVec3::ONE)]);
/// let baker = ExactBaker::new(&triangles, &cells, ExactSettings::new(Effort::Exact(1e-4)));
/// let outcome = Bake::new(baker).run();
/// assert_eq!((outcome.cells[0].seen.as_slice(), outcome.gap()), (&[0][..], 0.0));
/// # Ok::<(), visibility_core::scene::SceneError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ExactBaker<'a> {
    triangles: &'a SceneTriangles,
    viewcells: &'a Viewcells,
    settings: ExactSettings,
    done: Vec<Option<(BakedCell, u64)>>,
}

impl<'a> ExactBaker<'a> {
    /// Prepares a bake of all objects from all viewcells. Proofs are not kept.
    pub fn new(triangles: &'a SceneTriangles, viewcells: &'a Viewcells, settings: ExactSettings) -> Self {
        let settings = ExactSettings { keep_proofs: false, ..settings };
        Self { triangles, viewcells, settings, done: vec![None; viewcells.cells().len()] }
    }

    /// Returns the seen and the open objects of the viewcells done so far, by viewcell.
    pub fn cells(&self) -> impl Iterator<Item = Option<&BakedCell>> {
        self.done.iter().map(|done| done.as_ref().map(|(cell, _)| cell))
    }

    fn index_limit(&self) -> usize {
        self.triangles.objects.iter().map(|object| object.id.index() + 1).max().unwrap_or(0)
    }
}

/// Memory of one thread of a bake.
#[derive(Default)]
pub struct BakeScratch(Option<ChainScratch>);

impl core::fmt::Debug for BakeScratch {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("BakeScratch").finish_non_exhaustive()
    }
}

impl Baker for ExactBaker<'_> {
    type Scratch = BakeScratch;
    type Found = (BakedCell, u64);
    type Outcome = ExactOutcome;

    const ROUND: usize = 16;
    const KIND: u32 = 20;

    fn item_count(&self) -> usize {
        self.done.len()
    }

    fn work(
        &self,
        item: u32,
        scratch: &mut BakeScratch,
        stop: &dyn Fn() -> bool,
    ) -> Option<(BakedCell, u64)> {
        let cell: &Viewcell = &self.viewcells.cells()[item as usize];
        let found = match query(self.triangles, &self.settings, cell, &mut scratch.0) {
            Some(query) => {
                let (found, memory) = query.with_stop(stop).run(&|_| true);
                if !found.is_decided {
                    return None;
                }
                scratch.0 = Some(memory);
                found
            }
            None => CellVerdicts::undecided(self.triangles),
        };
        let mut baked = BakedCell { seen: Vec::new(), open: Vec::new() };
        for (place, object) in self.triangles.objects.iter().enumerate() {
            if found.keeps(place, object, &self.settings) {
                let is_seen = matches!(found.verdicts[place], Verdict::Seen(_));
                let list = if is_seen { &mut baked.seen } else { &mut baked.open };
                list.push(object.id.index() as u32);
            }
        }
        baked.seen.sort_unstable();
        baked.open.sort_unstable();
        Some((baked, found.rays + found.nodes))
    }

    fn take_in(&mut self, item: u32, found: (BakedCell, u64)) -> u64 {
        let steps = found.1;
        self.done[item as usize] = Some(found);
        steps
    }

    fn finish(self, waiting: &[u32]) -> ExactOutcome {
        let mut all: Vec<u32> =
            self.triangles.objects.iter().map(|object| object.id.index() as u32).collect();
        all.sort_unstable();
        let index_limit = self.index_limit();
        let cells = self
            .done
            .into_iter()
            .map(|done| done.map_or(BakedCell { seen: Vec::new(), open: all.clone() }, |(cell, _)| cell))
            .collect();
        ExactOutcome { cells, index_limit, complete: waiting.is_empty() }
    }

    fn fingerprint(&self) -> u64 {
        let ExactSettings { rays, aimed_rays, proves, share, clearance, .. } = self.settings;
        let vector = |v: visibility_core::glam::DVec3| v.to_array().map(f64::to_bits);
        let cells = self.viewcells.cells().iter().flat_map(|cell| {
            let planes = cell
                .planes
                .iter()
                .flat_map(move |plane| vector(plane.normal).into_iter().chain([plane.offset.to_bits()]));
            let count = [cell.planes.len() as u64];
            vector(cell.min).into_iter().chain(vector(cell.max)).chain(count).chain(planes)
        });
        let settings = [rays.into(), aimed_rays.into(), proves.into(), share.to_bits(), clearance.to_bits()];
        let numbers = settings.into_iter().chain(cells).chain(self.triangles.numbers());
        numbers.fold(Fingerprint::new(), Fingerprint::with_u64).value()
    }

    fn save(&self, state: &mut Writer) {
        for done in &self.done {
            state.u32(u32::from(done.is_some()));
            if let Some((BakedCell { seen, open }, steps)) = done {
                state.u64(*steps);
                for list in [seen, open] {
                    state.u32(list.len() as u32);
                    state.u32s(list.iter().copied());
                }
            }
        }
    }

    fn load(&mut self, state: &mut Reader<'_>) -> Result<(), FormatError> {
        let limit = self.index_limit();
        for done in &mut self.done {
            *done = None;
            if state.u32()? == 0 {
                continue;
            }
            let steps = state.u64()?;
            let mut lists = [Vec::new(), Vec::new()];
            for list in &mut lists {
                let count = state.u32()? as usize;
                *list = state.u32s(count)?;
                let ascends = list.windows(2).all(|pair| pair[0] < pair[1]);
                if !ascends || list.last().is_some_and(|&last| last as usize >= limit) {
                    return Err(state.content_error("objects of a viewcell are unknown or out of order"));
                }
            }
            let [seen, open] = lists;
            if seen.iter().any(|index| open.binary_search(index).is_ok()) {
                return Err(state.content_error("an object of a viewcell is both seen and open"));
            }
            *done = Some((BakedCell { seen, open }, steps));
        }
        Ok(())
    }
}
