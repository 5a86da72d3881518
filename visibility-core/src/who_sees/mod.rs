//! Who sees whom: observers and targets that move, many of each, in one call. For servers that tell a player
//! only of what the player can see.
//!
//! A mover is given as a [`Reach`]: the box that its body is in, and how far it may get until the answer is
//! used. The level is given as [`SightCells`]: cells that cover its space, with what is seen from where. A
//! target is reported unless all cells that its reach touches are hidden from all of the observer's reach.
//! Each target is put into its cells, and each observer visits only the targets in the cells that it sees, so
//! that time is in proportion to what is seen.
//!
//! | level | type |
//! |---|---|
//! | cells and portals, or any scene of which each viewcell's visible set is computed | [`ViewcellMatrix`] |
//! | floor plans with doors | `visibility_2d::cdt::PlanCells` |
//! | scenes that change | `visibility_region::OnlineCells` |

mod matrix;
mod reach;

pub use matrix::{OfPortalsError, ViewcellMatrix};
pub use reach::Reach;

use crate::bits::Bits;
use crate::stamp::Stamp;
use alloc::vec::Vec;

/// Cells that cover a level, and the cells that are seen from each. Cells are numbered from 0.
///
/// Each answer must be conservative. If a line of sight runs from a point of a [reach](Reach) A to a point of
/// a reach B, then [`seen_from`](Self::seen_from) of A must give at least one of the cells that
/// [`cells_of`](Self::cells_of) of B gives, unless one of these two functions returns false.
pub trait SightCells {
    /// Returns the number of cells.
    fn cell_count(&self) -> usize;

    /// Returns a stamp of the data that [`cells_of`](Self::cells_of) depends on. As long as the stamp is the
    /// same, equal reaches get equal cells.
    fn stamp(&self) -> Stamp;

    /// Appends the cells that a mover may be in, all below [`cell_count`](Self::cell_count). Returns false if
    /// the mover may be outside all cells: then every observer counts as seeing the mover, whatever cells
    /// were appended. The same holds if a number is appended that is not below `cell_count`. A reach that is
    /// not [proper](Reach::is_proper) is never asked for.
    fn cells_of(&mut self, reach: &Reach, cells: &mut Vec<u32>) -> bool;

    /// Adds to the set `seen` every cell that may be seen, at least in part, from some point that the
    /// observer, a mover, may be at. The limit of `seen` is at least the number of cells. Returns false if
    /// the cells are not known: then the observer counts as seeing every target. A reach that is not
    /// [proper](Reach::is_proper) is never asked for.
    fn seen_from(&mut self, reach: &Reach, seen: &mut Bits) -> bool;
}

/// Finds and holds which observers may see which targets. Conservative: a target is reported if a straight
/// line runs from any point of the observer's reach to any point of the target's reach without crossing what
/// the [`SightCells`] know as opaque. Targets hide nothing from each other.
///
/// Keeps the cells of targets from call to call: a target that has the same number and the same reach as
/// before is not looked up again.
///
/// # Cost
/// Each target is put into its cells, each observer asks for the cells that it sees, and each reported pair
/// costs some nanoseconds for each cell of the target that the observer sees. Memory is one bit for each
/// pair.
///
/// ```
/// use visibility_core::glam::DVec3;
/// use visibility_core::pvs::{Viewcell, Viewcells};
/// use visibility_core::who_sees::{Reach, ViewcellMatrix, WhoSees};
/// // Three rooms in a row; nobody sees from the first into the third.
/// let room = |x: f64| Viewcell::from_box(DVec3::new(x, 0.0, -1.0), DVec3::new(x + 4.0, 4.0, 3.0));
/// let rooms = Viewcells::new([room(0.0), room(4.0), room(8.0)]);
/// let mut level = ViewcellMatrix::new(rooms, &[[0, 1].as_slice(), &[0, 1, 2], &[1, 2]]);
/// let mut who = WhoSees::new();
/// // Each tick: where players are, and how far they get in 100 ms at 6 m/s; then things at rest.
/// let at = |x: f64| Reach::new(DVec3::new(x, 1.0, 0.5), DVec3::new(x + 0.6, 1.6, 2.3));
/// let players = [at(1.0), at(10.0), at(5.0)].map(|player| player.within(0.1, 6.0));
/// let targets = [players.as_slice(), &[at(9.0)]].concat();
/// who.look(&mut level, &players, &targets);
/// assert!(!who.sees(0, 1) && who.sees(0, 2));
/// for player in 0..players.len() {
///     for target in who.seen_by(player) {
///         println!("tell player {player} about {target}");
///     }
/// }
/// assert!(who.seen_by(0).eq([0, 2]) && who.seen_by(1).eq([1, 2, 3]));
/// ```
#[derive(Clone, Debug, Default)]
pub struct WhoSees {
    target_count: usize,
    observer_count: usize,
    /// Number of 64-bit words in one observer's row of `rows`.
    words: usize,
    /// One row of bits per observer, one after another. Bit `t` of a row is set if the observer may see
    /// target `t`.
    rows: Vec<u64>,
    /// Set of the targets that every observer counts as seeing.
    unplaced: Bits,
    /// Cells that at least one target may be in.
    occupied: Bits,
    /// Indexed by cell: start of the cell's targets in `targets_by_cell`. One more entry holds the end of the
    /// last cell's targets.
    first_target: Vec<u32>,
    targets_by_cell: Vec<u32>,
    /// Targets of this call, and of the call before.
    placed: Placed,
    before: Placed,
    /// [Stamp](SightCells::stamp) of the cells that `placed` refers to. `None` before the first call.
    stamp: Option<Stamp>,
    /// Scratch: the cells that the present observer sees.
    seen: Bits,
}

/// Targets with the cells that each may be in.
#[derive(Clone, Debug, Default)]
struct Placed {
    reaches: Vec<Reach>,
    /// Cells of all targets, one target after another.
    cells: Vec<u32>,
    /// For each target, the end of its cells in `cells`. A target without cells may be anywhere.
    ends: Vec<u32>,
}

impl Placed {
    /// Returns the cells of a target.
    fn cells_of(&self, target: usize) -> &[u32] {
        let start = target.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.cells[start as usize..self.ends[target] as usize]
    }

    fn clear(&mut self) {
        self.reaches.clear();
        self.cells.clear();
        self.ends.clear();
    }
}

impl WhoSees {
    /// Makes an answer without observers and targets.
    pub fn new() -> Self {
        Self::default()
    }

    /// Finds which targets each observer may see, and replaces the former answer. Observers and targets are
    /// numbered from 0, in the order given.
    ///
    /// A reach that is not [proper](Reach::is_proper), or is not in the cells, sees all targets and is seen
    /// by all observers.
    pub fn look(&mut self, cells: &mut dyn SightCells, observers: &[Reach], targets: &[Reach]) {
        self.place(cells, targets);
        self.words = targets.len().div_ceil(64);
        (self.observer_count, self.target_count) = (observers.len(), targets.len());
        self.rows.clear();
        self.rows.reserve(observers.len() * self.words);
        for observer in observers {
            let start = self.rows.len();
            self.seen.reset(cells.cell_count());
            if !observer.is_proper() || !cells.seen_from(observer, &mut self.seen) {
                self.rows.resize(start + self.words, u64::MAX);
                continue;
            }
            self.rows.extend_from_slice(self.unplaced.words());
            let row = &mut self.rows[start..];
            self.seen.intersect(&self.occupied);
            for cell in self.seen.iter() {
                let [first, end] = [cell, cell + 1].map(|cell| self.first_target[cell] as usize);
                for &target in &self.targets_by_cell[first..end] {
                    row[target as usize / 64] |= 1 << (target % 64);
                }
            }
        }
    }

    /// Lists the targets of each cell, and the targets that have no cell.
    fn place(&mut self, cells: &mut dyn SightCells, targets: &[Reach]) {
        core::mem::swap(&mut self.placed, &mut self.before);
        let Self { placed, before, .. } = self;
        placed.clear();
        if self.stamp.replace(cells.stamp()) != Some(cells.stamp()) {
            before.clear();
        }
        let count = cells.cell_count();
        self.unplaced.reset(targets.len());
        self.occupied.reset(count);
        self.first_target.clear();
        self.first_target.resize(count + 1, 0);
        for (index, target) in targets.iter().enumerate() {
            let start = placed.cells.len();
            if before.reaches.get(index) == Some(target) {
                placed.cells.extend_from_slice(before.cells_of(index));
            } else if !target.is_proper() || !cells.cells_of(target, &mut placed.cells) {
                placed.cells.truncate(start);
            }
            if placed.cells[start..].iter().any(|&cell| cell as usize >= count) {
                placed.cells.truncate(start);
            }
            if placed.cells.len() == start {
                self.unplaced.insert(index);
            }
            for &cell in &placed.cells[start..] {
                self.first_target[cell as usize] += 1;
                self.occupied.insert(cell as usize);
            }
            placed.ends.push(placed.cells.len() as u32);
        }
        placed.reaches.extend_from_slice(targets);
        // Prefix sums turn the number of targets of each cell into the end of its list. Filling each list
        // from its end then lowers the ends to starts.
        let mut sum = 0;
        for first in &mut self.first_target {
            sum += *first;
            *first = sum;
        }
        self.targets_by_cell.clear();
        self.targets_by_cell.resize(placed.cells.len(), 0);
        for target in 0..targets.len() {
            for &cell in placed.cells_of(target) {
                let place = &mut self.first_target[cell as usize];
                *place -= 1;
                self.targets_by_cell[*place as usize] = target as u32;
            }
        }
    }

    /// Returns the number of observers of the last call.
    pub fn observer_count(&self) -> usize {
        self.observer_count
    }

    /// Returns the number of targets of the last call.
    pub fn target_count(&self) -> usize {
        self.target_count
    }

    /// Returns whether an observer may see a target. True for numbers that the last call did not have.
    pub fn sees(&self, observer: usize, target: usize) -> bool {
        if observer >= self.observer_count || target >= self.target_count {
            return true;
        }
        self.rows[observer * self.words + target / 64] >> (target % 64) & 1 != 0
    }

    /// Returns the targets that an observer may see, ascending. All targets for an observer that the last
    /// call did not have.
    pub fn seen_by(&self, observer: usize) -> impl Iterator<Item = usize> + '_ {
        let start = observer.saturating_mul(self.words);
        let row = self.rows.get(start..start.saturating_add(self.words));
        let word = move |at: usize| row.map_or(u64::MAX, |row| row[at]);
        let targets = (0..self.words).flat_map(move |at| {
            let bits = core::iter::successors(Some(word(at)), |bits| Some(bits & bits.wrapping_sub(1)));
            bits.take_while(|&bits| bits != 0).map(move |bits| at * 64 + bits.trailing_zeros() as usize)
        });
        targets.take_while(|&target| target < self.target_count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// Three cells in a row of a metre each, of which each sees itself. At y = 1 the cells are unknown.
    struct Row;

    impl SightCells for Row {
        fn cell_count(&self) -> usize {
            3
        }

        fn stamp(&self) -> Stamp {
            Stamp::NONE
        }

        fn cells_of(&mut self, reach: &Reach, cells: &mut Vec<u32>) -> bool {
            assert!(reach.is_proper(), "a reach that is not proper is never asked for");
            cells.push(reach.min.x as u32);
            reach.min.y < 1.0
        }

        fn seen_from(&mut self, reach: &Reach, seen: &mut Bits) -> bool {
            assert!(reach.is_proper(), "a reach that is not proper is never asked for");
            seen.insert(reach.min.x as usize);
            reach.min.y < 1.0
        }
    }

    fn at(x: f64, y: f64) -> Reach {
        Reach::new(DVec3::new(x, y, 0.0), DVec3::new(x, y, 0.0))
    }

    #[test]
    fn who_is_unknown_sees_and_is_seen_by_all() {
        // In a cell each, in a cell beyond the last, at an unknown place, and nowhere.
        let movers =
            [at(0.0, 0.0), at(1.0, 0.0), at(2.0, 0.0), at(3.0, 0.0), at(0.0, 1.0), at(f64::NAN, 0.0)];
        let mut who = WhoSees::new();
        let observers = [movers[0], movers[1], movers[2], movers[4], movers[5]];
        // Twice, since cells of targets are kept.
        for look in 0..2 {
            who.look(&mut Row, &observers, &movers);
            let seen = |observer| who.seen_by(observer).collect::<Vec<_>>();
            let expected = [[0, 3, 4, 5], [1, 3, 4, 5], [2, 3, 4, 5]];
            assert_eq!([0, 1, 2].map(seen), expected.map(|seen| seen.to_vec()), "look {look}: from cells");
            for observer in [3, 4, 5, 9] {
                assert_eq!(seen(observer), [0, 1, 2, 3, 4, 5], "look {look}: an unknown observer {observer}");
            }
            assert!(who.sees(0, 0) && !who.sees(0, 1) && !who.sees(2, 0), "look {look}: pairs");
            assert!(who.sees(5, 0) && who.sees(5, 9) && who.sees(0, 6) && who.sees(0, 64), "unknown pairs");
        }
    }
}
