//! Tests of viewcells that fit a budget: the budget is kept where division can reach it, merged sets are the
//! unions of the sets of their parts, no point of the viewcells is lost, and no ray reaches an object that is
//! left out.

use crate::sandwiches::street;
use std::collections::BTreeSet;
use visibility_bake::{CellSandwich, SandwichBaker, SandwichSettings, ViewcellBudget, ViewcellFit};
use visibility_core::bake::Bake;
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Viewcell, Viewcells};
use visibility_core::scene::Scene;
use visibility_testing::{Random, is_clear};

/// Number of objects of a made-up visibility.
const OBJECTS: u32 = 40;

/// Boxes in which the objects of a made-up visibility are seen: an object is seen from a viewcell if the
/// viewcell touches the object's box.
fn boxes(random: &mut Random) -> Vec<[DVec3; 2]> {
    (0..OBJECTS)
        .map(|_| {
            let min = random.vector(8.0).abs();
            [min, min + random.vector(6.0).abs()]
        })
        .collect()
}

fn cost(index: u32) -> u64 {
    u64::from(index % 7 * 10)
}

/// Returns the result for a viewcell: every third object that it sees is open, the others are seen.
fn found(cell: &Viewcell, boxes: &[[DVec3; 2]]) -> CellSandwich {
    let touches = |[min, max]: &[DVec3; 2]| min.cmple(cell.max).all() && cell.min.cmple(*max).all();
    let all: Vec<u32> =
        (0..).zip(boxes).filter(|(_, place)| touches(place)).map(|(index, _)| index).collect();
    let (open, seen): (Vec<u32>, Vec<u32>) = all.into_iter().partition(|index| index % 3 == 0);
    let mut found = CellSandwich::default();
    (found.seen, found.open) = (seen, open.into());
    found
}

fn total(found: &CellSandwich) -> u64 {
    found.reported().iter().map(|&index| cost(index)).sum()
}

fn volume(cell: &Viewcell) -> f64 {
    (cell.max - cell.min).element_product()
}

/// Returns the viewcells of a fit with made-up results, and those before neighbours are merged.
fn fitted(
    budget: ViewcellBudget,
    cells: &[Viewcell],
    result: impl Fn(&Viewcell) -> CellSandwich,
) -> (Vec<Viewcell>, Vec<CellSandwich>, usize) {
    let (mut fit, mut leaves) = (ViewcellFit::new(budget, cells.iter().cloned()), 0);
    while !fit.is_done() {
        let waiting: Vec<Viewcell> = fit.waiting().collect();
        let division = fit.take_in(waiting.iter().map(&result), cost);
        assert_eq!(division.evaluated, waiting.len(), "viewcells taken in");
        assert!(division.divided <= division.over_budget, "only viewcells over budget are divided");
        leaves += division.evaluated - division.divided;
    }
    let (cells, found) = fit.finish(cost);
    (cells, found, leaves)
}

#[test]
fn budgets_are_kept_and_merged_sets_are_unions() {
    let (mut divided, mut merged, mut over) = (0, 0, 0);
    for seed in 0..60 {
        let mut random = Random(seed);
        let boxes = boxes(&mut random);
        let grid = |i: usize| DVec3::new((i % 2) as f64, (i / 2 % 2) as f64, (i / 4) as f64) * 4.0;
        let cells: Vec<Viewcell> =
            (0..8).map(|i| Viewcell::from_box(grid(i), grid(i) + DVec3::splat(4.0))).collect();
        let least = DVec3::new(0.5, 1.0, random.pick(&[4.0, 1.0]));
        let limit = random.pick(&[100, 250, 400]);
        let agreement = random.pick(&[0.0, 0.1]);
        let budget = ViewcellBudget::new(limit, least).with_agreement(agreement);
        let (fit, sets, leaves) = fitted(budget, &cells, |cell| found(cell, &boxes));
        divided += leaves - cells.len();
        merged += leaves - fit.len();
        let sum: f64 = fit.iter().map(volume).sum();
        assert!((sum - 512.0).abs() < 1e-9, "seed {seed}: a volume of {sum}");
        let all = Viewcells::new(fit.iter().cloned());
        for _ in 0..200 {
            let p = DVec3::from_array([(); 3].map(|()| random.range(0.0, 8.0)));
            assert!(all.locate(p).is_some(), "seed {seed}: {p} is in no viewcell");
        }
        for (cell, set) in fit.iter().zip(&sets) {
            // The made-up visibility of a union is the union of the visibilities.
            assert_eq!(set, &found_like(cell, &boxes, set), "seed {seed}: {cell:?}");
            let size = cell.max - cell.min;
            let is_over = total(set) > limit;
            over += usize::from(is_over);
            if is_over && agreement == 0.0 {
                // Parts that were merged with an agreement of 0 have equal costs, so each is over budget as
                // well, and could not be divided.
                let parts = grid_parts(cell, least);
                assert!(
                    parts.iter().all(|part| total(&found(part, &boxes)) == total(set)),
                    "seed {seed}: a viewcell of {size} over budget could be divided"
                );
            }
        }
        // No pair of neighbours with equal sets is left, if they form a box.
        for (i, a) in fit.iter().enumerate() {
            for (j, b) in fit.iter().enumerate() {
                let axes = (0..3).filter(|&axis| a.min[axis] != b.min[axis] || a.max[axis] != b.max[axis]);
                let axes: Vec<usize> = axes.collect();
                let is_box = axes.len() == 1 && a.max[axes[0]] == b.min[axes[0]];
                assert!(
                    !is_box || sets[i].reported() != sets[j].reported(),
                    "seed {seed}: {a:?} and {b:?} see the same"
                );
            }
        }
    }
    assert!(divided > 1000 && merged > 100 && over > 50, "{divided} divided, {merged} merged, {over} over");
}

/// Returns the made-up result for a viewcell, with what a merge adds up taken from `set`.
fn found_like(cell: &Viewcell, boxes: &[[DVec3; 2]], set: &CellSandwich) -> CellSandwich {
    let mut found = found(cell, boxes);
    (found.swept, found.proven, found.steps) = (set.swept, set.proven, set.steps);
    found
}

/// Returns the parts of a viewcell at least as large as allowed, in halves on each axis.
fn grid_parts(cell: &Viewcell, least: DVec3) -> Vec<Viewcell> {
    let mut parts = vec![cell.clone()];
    for axis in 0..3 {
        while parts.iter().all(|part| (part.max[axis] - part.min[axis]) * 0.5 >= least[axis]) {
            parts = parts
                .into_iter()
                .flat_map(|part| {
                    let middle = (part.min[axis] + part.max[axis]) * 0.5;
                    let (mut low, mut high) = (part.clone(), part);
                    (low.max[axis], high.min[axis]) = (middle, middle);
                    [low, high]
                })
                .collect();
        }
    }
    parts
}

#[test]
fn an_agreement_bounds_what_merging_adds() {
    // Eight viewcells in a row. Viewcell i sees objects 0 to i, each of cost 1 but for the first.
    let cost = |index: u32| if index == 0 { 100 } else { 1 };
    let cells: Vec<Viewcell> = (0..8)
        .map(|i| Viewcell::from_box(DVec3::X * f64::from(i), DVec3::new(f64::from(i) + 1.0, 1.0, 1.0)))
        .collect();
    let fit = |limit: u64, agreement: f64| {
        let budget = ViewcellBudget::new(limit, DVec3::ZERO).with_agreement(agreement);
        let mut fit = ViewcellFit::new(budget, cells.iter().cloned());
        let found = |cell: &Viewcell| {
            let mut found = CellSandwich::default();
            found.seen = (0..=cell.min.x as u32).collect();
            found
        };
        let results: Vec<CellSandwich> = cells.iter().map(found).collect();
        fit.take_in(results, cost);
        let (cells, sets) = fit.finish(cost);
        (cells.len(), sets.iter().map(|set| set.seen.len()).collect::<Vec<_>>())
    };
    assert_eq!(fit(1000, 0.0).0, 8, "all sets differ");
    assert_eq!(fit(1000, f64::NAN).0, 8, "NaN is no agreement");
    // Viewcells 0 to 2 cost 100 to 102, then 3 to 5 cost 103 to 105, then 6 and 7 cost 106 and 107.
    assert_eq!(fit(1000, 0.02), (3, vec![3, 6, 8]), "at most 2 % more than each part");
    assert_eq!(fit(1000, 1.0), (1, vec![8]), "all together");
    // Viewcells within the budget are not merged beyond it. Those over budget may be.
    assert_eq!(fit(103, 1.0), (2, vec![4, 8]), "a budget of 103");
}

#[test]
fn halves_report_nothing_that_the_whole_does_not() {
    let whole = Viewcell::from_box(DVec3::ZERO, DVec3::splat(2.0));
    let budget = ViewcellBudget::new(0, DVec3::new(1.0, 0.0, f64::NAN));
    let result = |seen: &[u32], open: &[u32]| {
        let mut found = CellSandwich::default();
        (found.seen, found.open) = (seen.to_vec(), open.into());
        found
    };
    let mut fit = ViewcellFit::new(budget, [whole]);
    fit.take_in([result(&[1], &[2, 5])], cost);
    assert_eq!(fit.waiting().count(), 2, "only x may be divided");
    // Object 3 is open in a half and hidden from the whole. Object 4 has a line of sight, though the whole
    // has a proof with a clearance that it is hidden.
    let unfinished = fit.clone();
    fit.take_in([result(&[], &[1, 3]), result(&[4], &[2, 3])], cost);
    assert!(fit.is_done(), "halves of 1 m are not divided");
    let (cells, sets) = fit.finish(cost);
    let rows: Vec<Vec<u32>> = sets.iter().map(|set| set.reported().to_vec()).collect();
    assert_eq!((cells.len(), rows), (2, vec![vec![1], vec![2, 4]]), "rows of the halves");
    // After the end of the division, the halves of a viewcell over budget are not made.
    let mut ended = unfinished.clone();
    ended.end_division();
    let division = ended.take_in([result(&[], &[1, 2]), result(&[], &[2])], cost);
    assert!(ended.is_done() && division.divided == 0, "{division:?}");
    // Halves without a result keep what the whole reports, and become the whole again.
    let (cells, sets) = unfinished.finish(cost);
    assert_eq!((cells.len(), sets[0].reported().to_vec()), (1, vec![1, 2, 5]), "no half has a result");
}

#[test]
fn halves_without_a_result_are_not_divided() {
    let whole = Viewcell::from_box(DVec3::ZERO, DVec3::splat(2.0));
    let mut fit = ViewcellFit::new(ViewcellBudget::new(0, DVec3::splat(1e-300)), [whole]);
    let mut open = CellSandwich::default();
    open.open = [1].into();
    assert_eq!(fit.take_in([open], cost).divided, 1, "the whole is over budget");
    let division = fit.take_in([], cost);
    assert_eq!((division.evaluated, division.over_budget, division.divided), (2, 2, 0), "both halves");
    assert!(fit.is_done(), "halves without a result are kept");
    let (cells, sets) = fit.finish(cost);
    assert_eq!((cells.len(), sets[0].reported().to_vec()), (1, vec![1]), "the whole again");
}

#[test]
fn viewcells_that_cannot_be_divided_or_merged_stay() {
    let plane = |x: f64| vec![Plane::new(DVec3::X, x)];
    let cell = |x: f64, planes: Vec<Plane>| Viewcell {
        planes,
        ..Viewcell::from_box(DVec3::X * x, DVec3::new(x + 1.0, 1.0, 1.0))
    };
    let odd = [
        Viewcell::from_box(DVec3::ONE, DVec3::ZERO),
        Viewcell::from_box(DVec3::NAN, DVec3::ONE),
        Viewcell::from_box(DVec3::ONE, DVec3::ONE.map(f64::next_up)),
        Viewcell::from_box(DVec3::ZERO, DVec3::INFINITY),
    ];
    let cut = [cell(0.0, plane(0.0)), cell(1.0, plane(0.0)), cell(2.0, plane(1.0))];
    let all: Vec<Viewcell> = odd.into_iter().chain(cut).collect();
    let budget = ViewcellBudget::new(0, DVec3::splat(1e-300));
    let mut fit = ViewcellFit::new(budget, all);
    let mut open = CellSandwich::default();
    open.open = [1].into();
    let waiting = fit.waiting().count();
    // Division ends after 32 halvings at the latest; here after one, as no results follow.
    fit.take_in(vec![open; waiting], cost);
    let (cells, _) = fit.finish(cost);
    let of_planes: Vec<(f64, f64)> =
        cells.iter().filter(|cell| !cell.planes.is_empty()).map(|cell| (cell.min.x, cell.max.x)).collect();
    assert_eq!(of_planes, [(0.0, 2.0), (2.0, 3.0)], "viewcells with equal planes are merged");
    assert_eq!(cells.len(), 6, "{cells:?}");
}

/// Bakes a scene with a budget, with two numbers of threads.
fn bake(scene: &Scene, cells: &Viewcells, budget: ViewcellBudget) -> (Vec<Viewcell>, Vec<CellSandwich>) {
    let triangles = |index: u32| u64::from(scene.object(scene.id_at(index as usize).unwrap()).unwrap().cost);
    let by_threads = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut fit = ViewcellFit::new(budget, cells.cells().iter().cloned());
            while !fit.is_done() {
                let cells = Viewcells::new(fit.waiting());
                let baker = SandwichBaker::new(scene, &cells, SandwichSettings::default());
                fit.take_in(Bake::new(baker).run().cells, triangles);
            }
            fit.finish(triangles)
        })
    });
    let [one, three] = by_threads;
    assert!(one == three, "by one thread and by three");
    one
}

#[test]
fn rays_reach_nothing_that_fitted_viewcells_leave_out() {
    let (scene, cells) = street();
    let least = DVec3::new(1.0, 1.0, 1.0);
    let budget = ViewcellBudget::new(25 * 12, least).with_agreement(0.05);
    let (fit, sets) = bake(&scene, &cells, budget);
    let sizes: BTreeSet<u64> = fit.iter().map(|cell| (volume(cell) * 1000.0) as u64).collect();
    assert!(sizes.len() > 2, "viewcells of several sizes: {sizes:?}");
    let mut random = Random(31);
    let mut hidden = 0;
    for (cell, set) in fit.iter().zip(&sets) {
        let reported = set.reported();
        for id in scene.ids().filter(|id| reported.binary_search(&(id.index() as u32)).is_err()) {
            hidden += 1;
            let bounds = scene.bounds(id).unwrap();
            let mut between =
                |a: DVec3, b: DVec3| a + (b - a) * DVec3::from_array([(); 3].map(|()| random.unit()));
            for _ in 0..100 {
                let from = between(cell.min, cell.max);
                let to = between(bounds.min.as_dvec3(), bounds.max.as_dvec3());
                assert!(!is_clear(&scene, from, to, id.index()), "{id} is seen from {from} at {to}");
            }
        }
    }
    assert!(hidden > 30 * fit.len(), "{hidden} hidden objects in {} viewcells", fit.len());
}
