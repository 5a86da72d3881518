//! Viewcells that fit a budget: halved where the visible set costs more than the budget, and merged with
//! neighbours where the sets agree.
//!
//! This work is based on: Fredo Durand, George Drettakis, Joelle Thollot and Claude Puech, "Conservative
//! Visibility Preprocessing using Extended Projections", 2000, section 6.1: the adaptive preprocess. There a
//! viewcell whose set has more polygons than a budget is subdivided down to a least size.
//!
//! # Why nothing visible is lost
//! A line of sight from a part of a viewcell is one from the viewcell. So what is hidden from a viewcell is
//! hidden from its halves, and an object that is open in a half is dropped if the whole viewcell does not
//! report it. A viewpoint in two merged viewcells lies in one of the two, whose set is part of the union.

use crate::cell_sandwich::CellSandwich;
use crate::grid::Grid;
use std::collections::BTreeMap;
use std::sync::Arc;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;

/// Greatest number of times that a viewcell is halved.
const MAX_DEPTH: u32 = 32;

/// Greatest number of viewcells that halving may lead to. More that are given to [`ViewcellFit::new`] are
/// kept, and not halved.
const MAX_VIEWCELLS: usize = Grid::LIMIT;

/// Budget that viewcells are fitted to.
#[derive(Clone, Copy, PartialEq, Debug)]
#[must_use]
pub struct ViewcellBudget {
    pub(crate) cost: u64,
    pub(crate) least: DVec3,
    pub(crate) agreement: f64,
}

impl ViewcellBudget {
    /// Makes a budget: the greatest [cost](visibility_core::Object::cost), in triangles, of the objects that
    /// a viewcell may report. Viewcells that cost more are halved, as long as their halves are at least
    /// `least` metres large on each axis in world space. A size that is not positive, or NaN, forbids
    /// division of that axis.
    pub fn new(cost: u64, least: DVec3) -> Self {
        Self { cost, least, agreement: 0.0 }
    }

    /// Sets when neighbours are merged: if their common set costs at most this share more than the set of
    /// each viewcell that is part of the merged one, and no more than the budget unless each of these does.
    /// The default is 0: only sets that are equal, up to objects that cost nothing, are merged. NaN and
    /// negative numbers count as 0.
    pub fn with_agreement(self, agreement: f64) -> Self {
        Self { agreement: agreement.max(0.0), ..self }
    }

    /// Returns the two halves of a viewcell, divided across the longest axis that may be divided. `None` if
    /// there is no such axis.
    pub fn halves(&self, cell: &Viewcell) -> Option<[Viewcell; 2]> {
        let size = cell.max - cell.min;
        let middle = cell.min + size * 0.5;
        let may_be_divided = |&axis: &usize| {
            // Halves of halves of a size that is not a power of two are off by some roundings.
            let is_large = size[axis] * 0.5 >= self.least[axis] * (1.0 - 1e-9);
            self.least[axis] > 0.0
                && is_large
                && cell.min[axis] < middle[axis]
                && middle[axis] < cell.max[axis]
        };
        let axis = (0..3)
            .filter(may_be_divided)
            .reduce(|most, axis| if size[axis] > size[most] { axis } else { most })?;
        let (mut low, mut high) = (cell.clone(), cell.clone());
        low.max[axis] = middle[axis];
        high.min[axis] = middle[axis];
        Some([low, high])
    }
}

/// A viewcell among those that are being fitted.
#[derive(Clone, Debug)]
struct Part {
    cell: Viewcell,
    /// Number of the viewcell that this one is a part of, as given to [`ViewcellFit::new`].
    root: usize,
    /// Number of halvings that have led to the viewcell.
    depth: u32,
    /// The halvings, as bits from the most significant on: 1 for the half at greater coordinates.
    path: u32,
}

/// The division of viewcells into viewcells that fit a [`ViewcellBudget`]. The caller bakes the
/// [waiting](Self::waiting) viewcells and [takes the results in](Self::take_in) until none is waiting. The
/// outcome depends on the results alone.
///
/// ```
/// use visibility_bake::{SandwichBaker, SandwichSettings, ViewcellBudget, ViewcellFit};
/// use visibility_core::{bake::Bake, glam::DVec3, pvs::{Viewcell, Viewcells}, Aabb, Scene};
/// let mut scene = Scene::new();
/// scene.insert(Aabb::from_arrays([5.0; 3], [6.0; 3]));
/// let whole = Viewcell::from_box(DVec3::ZERO, DVec3::splat(4.0));
/// let mut fit = ViewcellFit::new(ViewcellBudget::new(0, DVec3::ONE), [whole]);
/// while !fit.is_done() {
///     let cells = Viewcells::new(fit.waiting());
///     let found = Bake::new(SandwichBaker::new(&scene, &cells, SandwichSettings::default())).run();
///     fit.take_in(found.cells, |index| if index == 0 { 12 } else { 0 });
/// }
/// // The object is seen from everywhere: 64 viewcells were tried, and merged again.
/// let (cells, found) = fit.finish(|_| 12);
/// assert_eq!((cells.len(), found[0].reported().as_ref()), (1, &[0][..]));
/// ```
#[derive(Clone, Debug)]
pub struct ViewcellFit {
    budget: ViewcellBudget,
    /// Number of halvings after which a viewcell is not divided, at most [`MAX_DEPTH`].
    max_depth: u32,
    /// Number of viewcells, kept and waiting, from which on none is divided: [`MAX_VIEWCELLS`].
    max_viewcells: usize,
    /// Viewcells that are not divided further, with their results.
    kept: Vec<(Part, CellSandwich)>,
    /// Viewcells without a result, each with the objects that the viewcell of which it is a half reports.
    /// `None` for viewcells that are no halves.
    waiting: Vec<(Part, Option<Arc<[u32]>>)>,
}

impl ViewcellFit {
    /// Begins with all of `cells` waiting.
    pub fn new(budget: ViewcellBudget, cells: impl IntoIterator<Item = Viewcell>) -> Self {
        let part = |(root, cell)| (Part { cell, root, depth: 0, path: 0 }, None);
        let waiting = cells.into_iter().enumerate().map(part).collect();
        Self { budget, max_depth: MAX_DEPTH, max_viewcells: MAX_VIEWCELLS, kept: Vec::new(), waiting }
    }

    /// Returns whether no viewcell is waiting for a result.
    pub fn is_done(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Returns the viewcells that wait for a result, in the order in which [`take_in`](Self::take_in) expects
    /// the results.
    pub fn waiting(&self) -> impl Iterator<Item = Viewcell> + '_ {
        self.waiting.iter().map(|(part, _)| part.cell.clone())
    }

    /// Ends the division: viewcells whose results are taken in from now on are not halved, whatever they
    /// cost.
    pub fn end_division(&mut self) {
        self.max_depth = 0;
    }

    fn halves_of(&self, part: &Part) -> Option<[Viewcell; 2]> {
        if part.depth < self.max_depth { self.budget.halves(&part.cell) } else { None }
    }

    /// Takes in the results of the [waiting](Self::waiting) viewcells, in their order. The halves of those
    /// over budget are waiting afterwards, as long as there are fewer than 2^24 viewcells. `cost` returns the
    /// cost of the object of an index. A viewcell beyond the end of `found` is not divided: it keeps all that
    /// the viewcell reports of which it is a half; if it is no half, it goes on waiting. Results beyond the
    /// last waiting viewcell are ignored.
    pub fn take_in(
        &mut self,
        found: impl IntoIterator<Item = CellSandwich>,
        cost: impl Fn(u32) -> u64,
    ) -> Division {
        let mut division = Division::default();
        let mut results = found.into_iter();
        let mut viewcells = self.kept.len() + self.waiting.len();
        for (part, known) in std::mem::take(&mut self.waiting) {
            let result = results.next();
            // A half without a result reports what the whole does, and so would the halves of this half.
            let may_be_divided = result.is_some() && viewcells < self.max_viewcells;
            let mut found = match (result, &known) {
                (Some(found), _) => found,
                (None, Some(known)) => CellSandwich { open: known.clone(), ..CellSandwich::default() },
                (None, None) => {
                    self.waiting.push((part, None));
                    continue;
                }
            };
            if let Some(known) = known {
                // Objects with a line of sight stay, also if a clearance hides them from the whole viewcell.
                let is_known = |index: &&u32| known.binary_search(index).is_ok();
                found.open = found.open.iter().filter(is_known).copied().collect();
            }
            let sum = cost_of(&found, &cost);
            division.evaluated += 1;
            division.over_budget += usize::from(sum > self.budget.cost);
            match self.halves_of(&part).filter(|_| may_be_divided && sum > self.budget.cost) {
                Some(halves) => {
                    viewcells += 1;
                    let known: Arc<[u32]> = found.reported().as_ref().into();
                    division.divided += 1;
                    for (bit, cell) in (0..).zip(halves) {
                        let path = part.path | bit << (MAX_DEPTH - 1 - part.depth);
                        let half = Part { cell, root: part.root, depth: part.depth + 1, path };
                        self.waiting.push((half, Some(known.clone())));
                    }
                }
                None => self.kept.push((part, found)),
            }
        }
        division
    }

    /// Merges neighbours whose sets agree, and returns the viewcells with their results. The viewcells
    /// together contain the same points as those given to [`new`](Self::new), and follow in their order.
    /// Viewcells that are still waiting keep all that the viewcell reports of which they are halves; those
    /// that are no halves are left out.
    pub fn finish(mut self, cost: impl Fn(u32) -> u64) -> (Vec<Viewcell>, Vec<CellSandwich>) {
        for (part, known) in std::mem::take(&mut self.waiting) {
            let Some(known) = known else { continue };
            self.kept.push((part, CellSandwich { open: known, ..CellSandwich::default() }));
        }
        self.kept.sort_by_key(|(part, _)| (part.root, part.path));
        let kept = self.kept.into_iter().map(|(part, found)| {
            let cost = cost_of(&found, &cost);
            Some(Merged { cell: part.cell, found, cost, least: cost })
        });
        let mut cells: Vec<Option<Merged>> = kept.collect();
        // Each pass over an axis makes rows of viewcells; rows are then merged across the other axes.
        let mut unchanged = 0;
        for axis in (0..3).cycle() {
            unchanged = if self.budget.merge_along(axis, &mut cells, &cost) { 0 } else { unchanged + 1 };
            if unchanged == 3 {
                break;
            }
        }
        cells.into_iter().flatten().map(|merged| (merged.cell, merged.found)).unzip()
    }
}

/// Numbers of viewcells of one [`ViewcellFit::take_in`].
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
#[non_exhaustive]
pub struct Division {
    /// Number of viewcells whose results were taken in.
    pub evaluated: usize,
    /// Number of these that cost more than the budget.
    pub over_budget: usize,
    /// Number of these that were divided.
    pub divided: usize,
}

/// A viewcell that others were merged into.
struct Merged {
    cell: Viewcell,
    found: CellSandwich,
    /// Cost of the reported objects.
    cost: u64,
    /// Least cost of the viewcells that were merged.
    least: u64,
}

impl ViewcellBudget {
    /// Merges each viewcell with the neighbour that follows it on `axis`, if both have the same extent on the
    /// other axes and their sets agree. The merged viewcell takes the place of the one at lesser coordinates.
    /// Returns whether any were merged.
    fn merge_along(&self, axis: usize, cells: &mut [Option<Merged>], cost: &impl Fn(u32) -> u64) -> bool {
        let others = [(axis + 1) % 3, (axis + 2) % 3];
        let bits = |cell: &Viewcell, at: f64| {
            // Adding zero makes the two zeros one.
            let of = |x: f64| (x + 0.0).to_bits();
            let [a, b] = others;
            [of(at), of(cell.min[a]), of(cell.max[a]), of(cell.min[b]), of(cell.max[b])]
        };
        // Places of the viewcells by the side at which they begin. Of several that begin at the same side, as
        // where walks overlap the grid, the first counts.
        let mut beginning = BTreeMap::new();
        for (place, merged) in cells.iter().enumerate() {
            if let Some(Merged { cell, .. }) = merged {
                beginning.entry(bits(cell, cell.min[axis])).or_insert(place);
            }
        }
        let mut is_merged = false;
        for first in 0..cells.len() {
            let Some(mut one) = cells[first].take() else { continue };
            while let Some(&next) = beginning.get(&bits(&one.cell, one.cell.max[axis]))
                && let Some(other) = &cells[next]
                && let Some(merged) = self.merged(axis, &one, other, cost)
            {
                cells[next] = None;
                (one, is_merged) = (merged, true);
            }
            cells[first] = Some(one);
        }
        is_merged
    }

    /// Returns the union of a viewcell with the one that follows on `axis`. `None` if their sets do not
    /// agree, or if planes cut them in different ways.
    fn merged(&self, axis: usize, a: &Merged, b: &Merged, cost: &impl Fn(u32) -> u64) -> Option<Merged> {
        if a.cell.planes != b.cell.planes {
            return None;
        }
        let (least, most) = (a.least.min(b.least), a.cost.max(b.cost));
        let allowed = least as f64 * (1.0 + self.agreement);
        // The union costs at least as much as the more costly of the two.
        if most as f64 > allowed {
            return None;
        }
        let seen = union(&a.found.seen, &b.found.seen);
        let mut open = union(&a.found.open, &b.found.open);
        open.retain(|index| seen.binary_search(index).is_err());
        let found = CellSandwich {
            seen,
            open: open.into(),
            swept: a.found.swept.min(b.found.swept),
            proven: a.found.proven.min(b.found.proven),
            steps: a.found.steps.saturating_add(b.found.steps),
        };
        let sum = cost_of(&found, cost);
        let is_within_budget = sum <= self.cost || least > self.cost;
        if sum as f64 > allowed || !is_within_budget {
            return None;
        }
        let mut cell = a.cell.clone();
        cell.max[axis] = b.cell.max[axis];
        Some(Merged { cell, found, cost: sum, least })
    }
}

/// Returns the sum of the costs of the objects that a viewcell reports.
fn cost_of(found: &CellSandwich, cost: &impl Fn(u32) -> u64) -> u64 {
    let all = found.seen.iter().chain(found.open.iter());
    all.fold(0, |sum, &index| sum.saturating_add(cost(index)))
}

/// Returns the numbers in either of two ascending lists, ascending.
fn union(a: &[u32], b: &[u32]) -> Vec<u32> {
    let mut all = [a, b].concat();
    all.sort_unstable();
    all.dedup();
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn division_ends_at_the_greatest_number_of_viewcells() {
        let cells = [0.0, 2.0].map(|x| Viewcell::from_box(DVec3::X * x, DVec3::new(x + 2.0, 2.0, 2.0)));
        let budget = ViewcellBudget::new(0, DVec3::splat(1e-300));
        let mut fit = ViewcellFit { max_viewcells: 7, ..ViewcellFit::new(budget, cells) };
        let divided = [(); 4].map(|()| {
            let open = CellSandwich { open: [0].into(), ..CellSandwich::default() };
            fit.take_in(vec![open; fit.waiting().count()], |_| 1).divided
        });
        assert_eq!(divided, [2, 3, 0, 0], "viewcells divided at each depth: 2 become 4, then 7");
        assert!(fit.is_done(), "no viewcell is waiting");
    }

    /// Returns a result that reports the objects 0, 1 and so on up to `count`.
    fn open(count: u32) -> CellSandwich {
        CellSandwich { open: (0..count).collect(), ..CellSandwich::default() }
    }

    /// The viewcell at the origin is over budget each time, and halved 32 times.
    #[test]
    fn division_ends_at_the_greatest_depth() {
        let cell = Viewcell::from_box(DVec3::ZERO, DVec3::new(2f64.powi(40), 1.0, 1.0));
        let mut fit = ViewcellFit::new(ViewcellBudget::new(1, DVec3::X * 1e-300), [cell]);
        let mut divided = 0;
        while !fit.is_done() {
            let found: Vec<_> = fit.waiting().map(|cell| open(1 + u32::from(cell.min.x == 0.0))).collect();
            divided += fit.take_in(found, |_| 1).divided;
        }
        assert_eq!(divided, MAX_DEPTH as usize, "halvings of the viewcell at the origin");
        let (cells, found) = fit.finish(|_| 1);
        let ends: Vec<f64> = cells.iter().map(|cell| cell.min.x).collect();
        // The halves that are within the budget see the same, and are merged.
        assert_eq!(ends, [0.0, 256.0], "viewcells from low to high");
        assert_eq!((&found[0].open[..], &found[1].open[..]), (&[0, 1][..], &[0][..]), "their sets");
    }

    /// Costs equal to the budget are within it, and halves as large as the least size are allowed.
    #[test]
    fn limits_are_included() {
        let cell = |x: f64| Viewcell::from_box(DVec3::X * x, DVec3::new(x + 2.0, 2.0, 2.0));
        let budget = ViewcellBudget::new(2, DVec3::new(1.0, 0.0, -1.0));
        let mut fit = ViewcellFit::new(budget, [cell(0.0), cell(2.0)]);
        let division = fit.take_in([open(2), open(3)], |_| 1);
        assert_eq!((division.over_budget, division.divided), (1, 1), "costs of 2 and of 3");
        let halves: Vec<Viewcell> = fit.waiting().collect();
        assert_eq!([halves[0].max.x, halves[1].min.x], [3.0; 2], "divided across x alone");
        assert_eq!(fit.take_in([open(3), open(3)], |_| 1).divided, 0, "halves of 1 m");
        for (size, axis) in [([4.0, 4.0, 4.0], 0), ([4.0, 5.0, 5.0], 1), ([4.0, 4.0, 5.0], 2)] {
            let cell = Viewcell::from_box(DVec3::ZERO, DVec3::from_array(size));
            let [low, _] = ViewcellBudget::new(0, DVec3::ONE).halves(&cell).unwrap();
            assert!(low.max[axis] < size[axis], "a box of {size:?} is divided across axis {axis}");
        }
        assert_eq!(budget.halves(&cell(0.0)).map(|[low, _]| low.max.x), Some(1.0), "exactly 1 m");
        let flat = Viewcell::from_box(DVec3::ONE, DVec3::ONE);
        assert_eq!(ViewcellBudget::new(0, DVec3::splat(1e-300)).halves(&flat), None, "a point");
    }

    /// Pairs of viewcells with the numbers of their objects, each of cost 1, a budget and an agreement.
    #[test]
    fn neighbours_are_merged_up_to_budget_and_agreement() {
        let cells = [0.0, 1.0].map(|x| Viewcell::from_box(DVec3::X * x, DVec3::new(x + 1.0, 1.0, 1.0)));
        for (counts, budget, agreement, is_merged) in [
            ([4, 4], 9, 0.0, true),
            ([4, 5], 9, 0.0, false),
            ([4, 5], 9, -1.0, false),
            ([4, 4], 9, -1.0, true),
            ([4, 5], 9, 0.25, true),
            ([5, 4], 9, 0.25, true),
            ([4, 5], 9, 0.24, false),
            ([4, 6], 9, 0.25, false),
            ([4, 5], 5, 0.25, true),
            // The common set is over budget, of which one viewcell is not.
            ([4, 5], 4, 0.25, false),
            ([4, 5], 3, 0.25, true),
        ] {
            let limits = ViewcellBudget::new(budget, DVec3::ZERO).with_agreement(agreement);
            let mut fit = ViewcellFit::new(limits, cells.clone());
            let of = |count: u32, swept: u32| CellSandwich { swept, proven: swept, ..open(count) };
            fit.take_in([of(counts[0], 7), of(counts[1], 3)], |_| 1);
            let (cells, found) = fit.finish(|_| 1);
            assert_eq!(cells.len() == 1, is_merged, "{counts:?}, {budget}, {agreement}");
            if is_merged {
                assert_eq!([cells[0].min.x, cells[0].max.x], [0.0, 2.0], "the union of the boxes");
                assert_eq!(found[0].open.len() as u32, counts[0].max(counts[1]), "the union of the sets");
                assert_eq!([found[0].swept, found[0].proven], [3; 2], "objects hidden from both at most");
            }
        }
        // Four objects are seen from each viewcell, and five from both together.
        for (agreement, count) in [(0.24, 2), (0.25, 1)] {
            let limits = ViewcellBudget::new(9, DVec3::ZERO).with_agreement(agreement);
            let mut fit = ViewcellFit::new(limits, cells.clone());
            let other = CellSandwich { open: (1..5).collect(), ..CellSandwich::default() };
            fit.take_in([open(4), other], |_| 1);
            assert_eq!(fit.finish(|_| 1).0.len(), count, "sets of four, with an agreement of {agreement}");
        }
        // An object that is seen in one and open in the other is seen.
        let mut fit = ViewcellFit::new(ViewcellBudget::new(9, DVec3::ZERO), cells);
        let seen = CellSandwich { seen: vec![0, 1], ..CellSandwich::default() };
        fit.take_in([open(2), seen], |_| 1);
        let (_, found) = fit.finish(|_| 1);
        assert_eq!((&found[0].seen[..], found[0].open.len()), (&[0, 1][..], 0), "seen and open");
    }
}
