//! Deadlines of motion volumes.

use alloc::vec::Vec;

/// Number of movers in a block.
const BLOCK: usize = 64;

/// Deadlines of motion volumes by the position of the mover in the list of movers, with a lower bound for
/// each block of 64 movers. A frame looks only into blocks in which a deadline may have passed. A heap took
/// longer, since its entries lie all over the memory.
#[derive(Clone, Debug)]
pub(super) struct Deadlines {
    /// Deadlines, infinite for movers whose volume has ended.
    by_place: Vec<f64>,
    /// Lower bound of the deadlines of each block.
    least: Vec<f64>,
}

impl Deadlines {
    pub(super) const fn new() -> Self {
        Self { by_place: Vec::new(), least: Vec::new() }
    }

    /// Makes room for `movers` movers.
    pub(super) fn grow(&mut self, movers: usize) {
        self.by_place.resize(movers, f64::INFINITY);
        self.least.resize(movers.div_ceil(BLOCK), f64::INFINITY);
    }

    /// Sets the deadline of a mover that got a volume.
    pub(super) fn set(&mut self, place: u32, deadline: f64) {
        let place = place as usize;
        self.by_place[place] = deadline;
        self.least[place / BLOCK] = self.least[place / BLOCK].min(deadline);
    }

    /// Calls `ended` with the position of each mover whose deadline is before `time`, once for each deadline.
    /// The mover may have lost its volume since.
    pub(super) fn take_before(&mut self, time: f64, mut ended: impl FnMut(u32)) {
        for (block, least) in self.least.iter_mut().enumerate().filter(|(_, least)| **least < time) {
            *least = f64::INFINITY;
            for (deadline, place) in
                self.by_place[block * BLOCK..].iter_mut().take(BLOCK).zip(block * BLOCK..)
            {
                if *deadline < time {
                    *deadline = f64::INFINITY;
                    ended(place as u32);
                }
                *least = least.min(*deadline);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::Random;

    /// Deadlines that are whole numbers, so that many are equal to the time asked for.
    #[test]
    fn each_deadline_before_the_time_is_told_once() {
        let (mut random, mut deadlines) = (Random(91), Deadlines::new());
        let mut plain = alloc::vec![f64::INFINITY; 300];
        deadlines.grow(plain.len());
        for time in 0..300 {
            for _ in 0..3 {
                let (place, deadline) = (random.below(plain.len()), f64::from(time + random.between(0, 40)));
                deadlines.set(place as u32, deadline);
                plain[place] = deadline;
            }
            let mut ended = Vec::new();
            deadlines.take_before(f64::from(time), |place| ended.push(place as usize));
            let wanted: Vec<usize> =
                (0..plain.len()).filter(|&place| plain[place] < f64::from(time)).collect();
            assert_eq!(ended, wanted, "before {time}");
            wanted.iter().for_each(|&place| plain[place] = f64::INFINITY);
        }
    }
}
