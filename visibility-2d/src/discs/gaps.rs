//! Set of the open directions, in which no disc has been met yet: disjoint intervals of direction numbers,
//! stored by sectors.
//!
//! Each sector has its own list of intervals, so that a cut moves little memory: up to m intervals of 16
//! bytes each if m intervals lie in one sector of 1/256 turn.

use alloc::vec::Vec;

/// Number of sectors of the full turn around the eye, all with equal ranges of direction numbers.
const SECTORS: usize = 256;

/// Number of sectors per unit of direction numbers.
const PER_UNIT: f64 = SECTORS as f64 / 4.0;

/// Set of directions in which no disc has been met yet.
#[derive(Clone, Debug)]
pub(crate) struct Gaps {
    /// For each sector, its open intervals as pairs of direction numbers, ascending.
    sectors: Vec<Vec<(f64, f64)>>,
    /// Number of sectors with an open interval.
    open: usize,
}

impl Gaps {
    pub(crate) fn new() -> Self {
        Self { sectors: alloc::vec![Vec::new(); SECTORS], open: 0 }
    }

    /// Opens all directions, or those from `first` counter-clockwise to `last`, and closes all others.
    pub(crate) fn begin(&mut self, directions: Option<(f64, f64)>) {
        self.sectors.iter_mut().for_each(Vec::clear);
        self.open = 0;
        match directions {
            None => self.put(0.0, 4.0),
            Some((first, last)) if first <= last => self.put(first, last),
            Some((first, last)) => {
                self.put(0.0, last);
                self.put(first, 4.0);
            }
        }
    }

    fn put(&mut self, first: f64, last: f64) {
        for sector in sector_of(first)..=sector_of(last) {
            let begin = first.max(sector as f64 / PER_UNIT);
            let end = last.min((sector + 1) as f64 / PER_UNIT);
            if begin < end {
                self.open += usize::from(self.sectors[sector].is_empty());
                self.sectors[sector].push((begin, end));
            }
        }
    }

    /// Returns whether no direction is open.
    pub(crate) fn is_closed(&self) -> bool {
        self.open == 0
    }

    /// Returns whether some direction is open between `first` and `last`, counter-clockwise, after moving
    /// both outwards by `error`.
    #[inline]
    pub(crate) fn any(&self, first: f64, last: f64, error: f64) -> bool {
        let (first, last) = (first - error, last + error);
        if first > last {
            return self.any_between(first, 4.0) || self.any_between(0.0, last);
        }
        // A range moved beyond 0 or 4 continues at the other end.
        self.any_between(first, last)
            || (first < 0.0 && self.any_between(first + 4.0, 4.0))
            || (last > 4.0 && self.any_between(0.0, last - 4.0))
    }

    #[inline]
    fn any_between(&self, first: f64, last: f64) -> bool {
        let (from, to) = (sector_of(first), sector_of(last));
        let meets = |gaps: &[(f64, f64)]| {
            let next = gaps.partition_point(|gap| gap.1 <= first);
            gaps.get(next).is_some_and(|gap| gap.0 < last)
        };
        if from == to {
            return meets(&self.sectors[from]);
        }
        meets(&self.sectors[from])
            || meets(&self.sectors[to])
            || self.sectors[from + 1..to].iter().any(|gaps| !gaps.is_empty())
    }

    /// Closes the directions between `first` and `last`, counter-clockwise and at most half a turn apart,
    /// after moving both inwards by `error`, which is at least `2^-49`.
    #[inline]
    pub(crate) fn cut(&mut self, first: f64, last: f64, error: f64) {
        let width = if first <= last { last - first } else { last + 4.0 - first };
        // If an interval is thinner than its error, its ends may be swapped, which looks like almost a full
        // turn. So intervals up to three errors wide are skipped: two errors are cut off, and the third
        // exceeds the rounding of the width (`2^-51`) and of the moved ends (`2^-51` and `2^-52`), so that
        // they keep their order.
        if width <= 3.0 * error || width > 2.0 {
            return;
        }
        let (first, last) = (first + error, last - error);
        let first = if first >= 4.0 { first - 4.0 } else { first };
        let last = if last < 0.0 { last + 4.0 } else { last };
        if first <= last {
            self.cut_between(first, last);
        } else {
            self.cut_between(first, 4.0);
            self.cut_between(0.0, last);
        }
    }

    fn cut_between(&mut self, first: f64, last: f64) {
        if first >= last {
            return;
        }
        for sector in sector_of(first)..=sector_of(last) {
            let gaps = &mut self.sectors[sector];
            if !gaps.is_empty() {
                cut_list(gaps, first, last);
                self.open -= usize::from(gaps.is_empty());
            }
        }
    }
}

fn sector_of(number: f64) -> usize {
    ((number.max(0.0) * PER_UNIT) as usize).min(SECTORS - 1)
}

/// Removes the directions from `first` to `last` from an ascending list of disjoint intervals.
pub(super) fn cut_list(gaps: &mut Vec<(f64, f64)>, first: f64, last: f64) {
    let begin = gaps.partition_point(|gap| gap.1 <= first);
    let end = begin + gaps[begin..].partition_point(|gap| gap.0 < last);
    if begin == end {
        return;
    }
    let (left, right) = ((gaps[begin].0, first), (last, gaps[end - 1].1));
    match (left.0 < left.1, right.0 < right.1) {
        (true, true) if end - begin == 1 => {
            gaps[begin] = left;
            gaps.insert(begin + 1, right);
        }
        (true, true) => {
            (gaps[begin], gaps[end - 1]) = (left, right);
            gaps.drain(begin + 1..end - 1);
        }
        (true, false) => {
            gaps[begin] = left;
            gaps.drain(begin + 1..end);
        }
        (false, true) => {
            gaps[end - 1] = right;
            gaps.drain(begin..end - 1);
        }
        (false, false) => drop(gaps.drain(begin..end)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of ranks of a whole turn: three for each border between sectors, just before, on and just after
    /// it.
    const TURN: i64 = 3 * SECTORS as i64;

    /// Error of directions in these tests, greater than the spacing of direction numbers.
    const ERROR: f64 = 4.0 * f64::EPSILON;

    /// Returns the numbers around some borders with their ranks. 4 is the same direction as 0.
    fn around(borders: &[i64]) -> Vec<(f64, i64)> {
        let mut all = Vec::new();
        for &border in borders {
            let number = border as f64 / PER_UNIT;
            let three = [(number.next_down(), -1), (number, 0), (number.next_up(), 1)];
            all.extend(three.map(|(number, side)| (number, 3 * border + side)));
        }
        all.retain(|(number, _)| (0.0..=4.0).contains(number));
        all
    }

    /// Returns the number of ranks counter-clockwise from one direction to another.
    fn width(from: i64, to: i64) -> i64 {
        (to - from).rem_euclid(TURN)
    }

    /// Tries a cut and a query between every two numbers around borders of sectors. Directions outside of the
    /// cut must stay open.
    #[test]
    fn directions_are_open_unless_they_are_within_a_cut() {
        let all = around(&[0, 1, 2, 3, 64, 65, 127, 128, 200, 255, 256]);
        for (&(first, a), &(last, b)) in all.iter().flat_map(|x| all.iter().map(move |y| (x, y))) {
            // The ends of an interval as thin as the error may be swapped.
            let cut = width(a, b);
            if !(3..=TURN / 2 - 3).contains(&cut) {
                continue;
            }
            let mut gaps = Gaps::new();
            gaps.begin(None);
            gaps.cut(first, last, ERROR);
            assert!(!gaps.is_closed(), "{first} to {last}: one cut closes all");
            for (&(from, c), &(to, d)) in all.iter().flat_map(|x| all.iter().map(move |y| (x, y))) {
                let asked = width(c, d);
                if asked > TURN / 2 || asked == 0 && from != to {
                    continue;
                }
                let is_within = |inwards: i64| width(a + inwards, c) + asked <= cut - 2 * inwards;
                let is_open = gaps.any(from, to, ERROR);
                assert!(is_open || is_within(0), "{first} to {last} is cut, {from} to {to} is open");
                // Margins are a few units in the last place of the greatest number, which is less than two
                // ranks.
                let is_far = is_within(3) && width(a, c) >= 3;
                assert!(!is_open || !is_far, "{first} to {last} is cut, {from} to {to} is closed");
            }
        }
    }

    #[test]
    fn only_the_directions_of_a_range_are_open() {
        let all = around(&[0, 1, 63, 64, 128, 255, 256]);
        for (&(first, a), &(last, b)) in all.iter().flat_map(|x| all.iter().map(move |y| (x, y))) {
            let open = width(a, b);
            if open < 3 {
                continue;
            }
            let mut gaps = Gaps::new();
            gaps.begin(Some((first, last)));
            for &(at, rank) in &all {
                let is_in = width(a, rank) <= open;
                assert!(!is_in || gaps.any(at, at, ERROR), "{at} is within {first} to {last}");
                let is_far = (open + 4..TURN - 3).contains(&width(a, rank));
                assert!(!is_far || !gaps.any(at, at, ERROR), "{at} is not within {first} to {last}");
            }
        }
    }
}
