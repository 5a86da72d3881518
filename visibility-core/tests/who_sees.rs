//! Tests that `WhoSees` reports exactly the pairs that the cells of its level do not exclude, whatever movers
//! and levels earlier calls had.

use visibility_core::bits::Bits;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Viewcell, Viewcells};
use visibility_core::stamp::Stamp;
use visibility_core::who_sees::{Reach, SightCells, ViewcellMatrix, WhoSees};
use visibility_testing::Random;
use visibility_testing::allocations::ALLOCATIONS;

/// Number of unit boxes along x, y and z.
const SIDES: [i64; 3] = [6, 5, 2];

/// A level of unit boxes in any order, of which some are missing, with the boxes that each box sees.
struct Level {
    boxes: Vec<[i64; 3]>,
    rows: Vec<Vec<u32>>,
    at: DVec3,
}

impl Level {
    fn random(rng: &mut Random) -> Self {
        let all = (0..60).map(|i| [i % 6, i / 6 % 5, i / 30]);
        let mut boxes: Vec<_> = all.filter(|_| !rng.one_in(20)).collect();
        for last in (1..boxes.len()).rev() {
            boxes.swap(last, rng.below(last + 1));
        }
        let row = |_| (0..boxes.len() as u32).filter(|_| rng.one_in(12)).collect();
        let rows = (0..boxes.len()).map(row).collect();
        Self { boxes, rows, at: DVec3::ZERO }
    }

    fn matrix(&self) -> ViewcellMatrix {
        let cell = |&[x, y, z]: &[i64; 3]| {
            let min = self.at + DVec3::new(x as f64, y as f64, z as f64);
            Viewcell::from_box(min, min + 1.0)
        };
        ViewcellMatrix::new(Viewcells::new(self.boxes.iter().map(cell)), &self.rows)
    }

    /// Returns the boxes that a reach is in, by whole numbers. `None` if it may be elsewhere.
    fn cells_of(&self, reach: &Reach) -> Option<Vec<usize>> {
        let [low, high] = [reach.min - reach.margin - self.at, reach.max + reach.margin - self.at];
        if !(reach.min.cmple(reach.max).all() && reach.margin >= 0.0 && low.is_finite() && high.is_finite()) {
            return None;
        }
        let mut cells = Vec::new();
        // A reach that touches the side of a box may be beyond that side, by rounding.
        let range = |axis: usize| low[axis].ceil() as i64 - 1..=high[axis].floor() as i64;
        for x in range(0) {
            for y in range(1) {
                for z in range(2) {
                    cells.push(self.boxes.iter().position(|&cell| cell == [x, y, z])?);
                }
            }
        }
        Some(cells)
    }

    fn sees(&self, observer: &Reach, target: &Reach) -> bool {
        let (Some(from), Some(to)) = (self.cells_of(observer), self.cells_of(target)) else { return true };
        from.iter().any(|&from| to.iter().any(|&to| self.rows[from].contains(&(to as u32))))
    }
}

/// Returns the reach of a random mover, mostly inside the level, with corners at multiples of 1/4.
fn mover(rng: &mut Random) -> Reach {
    let mut side = |axis: usize| {
        let low = rng.below(4 * SIDES[axis] as usize) as f64 / 4.0;
        (low, low + rng.below(4) as f64 / 4.0)
    };
    let [x, y, z] = [side(0), side(1), side(2)];
    let mut reach = Reach::new(DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1));
    if rng.one_in(4) {
        reach = reach.within(0.25, rng.pick(&[0.0, 1.0, 1.0, 2.0, -1.0]));
    }
    match rng.below(40) {
        0 => reach.min.x = f64::NAN,
        1 => reach.max.y = reach.min.y - 1.0,
        2 => reach.margin = f64::INFINITY,
        3 => reach.margin = f64::NAN,
        4 => reach.margin = -0.25,
        _ => {}
    }
    reach
}

#[test]
fn answers_are_those_of_each_pair() {
    let (mut rng, mut who) = (Random(0x77_686f), WhoSees::new());
    let (mut hidden, mut seen, mut unplaced) = (0, 0, 0);
    let levels = [Level::random(&mut rng), Level::random(&mut rng)];
    let mut matrices = levels.each_ref().map(Level::matrix);
    let mut targets: Vec<Reach> = Vec::new();
    for tick in 0..120 {
        let which = usize::from(tick % 40 > 30);
        let level = &levels[which];
        // Most targets stay where they are. Some are added, removed, moved or exchanged.
        targets.resize_with(rng.below(200), || mover(&mut rng));
        for target in &mut targets {
            if rng.one_in(5) {
                *target = mover(&mut rng);
            }
        }
        let observers: Vec<Reach> = (0..rng.below(20)).map(|_| mover(&mut rng)).collect();
        if rng.one_in(3) {
            who.look(&mut matrices[which].clone(), &observers, &targets);
        } else {
            who.look(&mut matrices[which], &observers, &targets);
        }
        assert_eq!((who.observer_count(), who.target_count()), (observers.len(), targets.len()), "counts");
        for (i, observer) in observers.iter().enumerate() {
            let expected: Vec<usize> =
                (0..targets.len()).filter(|&j| level.sees(observer, &targets[j])).collect();
            assert!(who.seen_by(i).eq(expected.iter().copied()), "tick {tick}: seen by {observer:?}");
            assert!(expected.iter().all(|&j| who.sees(i, j)), "tick {tick}: pairs of {observer:?}");
            let count = (0..targets.len()).filter(|&j| who.sees(i, j)).count();
            assert_eq!(count, expected.len(), "tick {tick}: pairs that {observer:?} sees");
            (seen, hidden) = (seen + count, hidden + targets.len() - count);
            unplaced += usize::from(level.cells_of(observer).is_none());
        }
        assert!(who.sees(observers.len(), 0) && who.sees(0, targets.len()), "an unknown pair counts as seen");
        assert!(who.seen_by(observers.len()).eq(0..targets.len()), "targets of an unknown observer");
    }
    assert!(hidden > 5_000 && seen > 10_000 && unplaced > 100, "{hidden} {seen} {unplaced}: too few to tell");
}

/// Cells of which one has a number beyond the last: what is there is seen by all.
#[test]
fn a_cell_beyond_the_last_is_no_cell() {
    struct Wrong;
    impl SightCells for Wrong {
        fn cell_count(&self) -> usize {
            2
        }
        fn stamp(&self) -> Stamp {
            Stamp::NONE
        }
        fn cells_of(&mut self, reach: &Reach, cells: &mut Vec<u32>) -> bool {
            cells.push(reach.min.x as u32);
            true
        }
        fn seen_from(&mut self, _: &Reach, _: &mut Bits) -> bool {
            true
        }
    }
    let targets = [1.0, 2.0, 9.0].map(|x| Reach::new(DVec3::X * x, DVec3::X * x));
    let mut who = WhoSees::new();
    who.look(&mut Wrong, &targets[..1], &targets);
    assert!(who.seen_by(0).eq([1, 2]), "the targets in cells 2 and 9 of two cells");
}

#[test]
fn nobody_and_nowhere() {
    let mut who = WhoSees::new();
    let mut empty = ViewcellMatrix::new(Viewcells::default(), &[] as &[[u32; 0]]);
    who.look(&mut empty, &[], &[]);
    assert_eq!(who.seen_by(0).count(), 0, "targets, where there are none");
    let at = Reach::new(DVec3::ZERO, DVec3::ONE);
    who.look(&mut empty, &[at], &[at; 70]);
    assert_eq!(who.seen_by(0).count(), 70, "targets in no cell count as seen");
    let room = Viewcells::new([Viewcell::from_box(DVec3::splat(-1.0), DVec3::splat(2.0))]);
    who.look(&mut ViewcellMatrix::new(room.clone(), &[] as &[[u32; 0]]), &[at], &[at]);
    assert!(who.sees(0, 0), "a viewcell without a row sees all");
    who.look(&mut ViewcellMatrix::new(room, &[[7, u32::MAX]]), &[at], &[at]);
    assert!(!who.sees(0, 0), "a row that names no viewcell sees nothing");
}

#[test]
fn far_from_the_origin_a_reach_is_rounded_outwards() {
    let mut rng = Random(3);
    for _ in 0..1000 {
        let at = rng.fine_vector(1.0) * 10f64.powi(rng.between(-12, 17));
        let reach = Reach::new(at, at).within(rng.unit(), rng.range(0.0, 10.0));
        let [low, high] = reach.bounds();
        for axis in 0..3 {
            // Differences of two doubles, exact by Dekker's two-sum.
            let error = |a: f64, b: f64, sum: f64| (a - (sum - (sum - a))) + (b - (sum - a));
            let (below, above) = (at[axis] - reach.margin, at[axis] + reach.margin);
            assert!(low[axis] < below || error(at[axis], -reach.margin, below) >= 0.0, "{reach:?}: least");
            assert!(high[axis] > above || error(at[axis], reach.margin, above) <= 0.0, "{reach:?}: greatest");
        }
    }
    // Boxes of a metre at a distance of 10^12 m.
    let level = Level {
        boxes: (0..6).map(|x| [x, 0, 0]).collect(),
        rows: (0..6).map(|x| vec![x]).collect(),
        at: DVec3::splat(2f64.powi(40)),
    };
    let at = |x: f64| Reach::new(level.at + DVec3::new(x, 0.25, 0.25), level.at + DVec3::new(x, 0.5, 0.5));
    let mut who = WhoSees::new();
    who.look(&mut level.matrix(), &[at(0.5), at(1.0), at(4.75)], &[at(0.75), at(1.25), at(5.0)]);
    let seen = [0, 1, 2].map(|i| who.seen_by(i).collect::<Vec<_>>());
    assert_eq!(seen, [vec![0], vec![0, 1], vec![2]], "pairs of the same box, or of boxes that touch");
}

#[test]
fn a_warm_look_allocates_nothing() {
    let mut rng = Random(5);
    let mut matrix = Level::random(&mut rng).matrix();
    let mut who = WhoSees::new();
    let ticks: Vec<[Vec<Reach>; 2]> =
        (0..8).map(|_| [20, 300].map(|count| (0..count).map(|_| mover(&mut rng)).collect())).collect();
    let mut run = || ticks.iter().for_each(|[observers, targets]| who.look(&mut matrix, observers, targets));
    run();
    run();
    let before = ALLOCATIONS.get();
    run();
    assert_eq!(ALLOCATIONS.get(), before, "allocations of looks like those before");
}
