//! Bit maps of blocked rays: one bit for each pixel of a projection plane.
//!
//! The reprojection of extended projections is an erosion of such a map by a rectangle that varies with the
//! pixel (Durand, Drettakis, Thollot and Puech, "Conservative Visibility Preprocessing Using Extended
//! Projections", 2000, section 5.1). It works on rows of words and on runs of bits, never on single pixels.

use alloc::vec::Vec;

/// Width and height of a map, in pixels.
pub(crate) const SIDE: usize = 512;
/// Number of 64-bit words in a row.
const WORDS: usize = SIDE / 64;

pub(super) type Row = [u64; WORDS];

/// A rectangle of pixels. Both ends of each range are included.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct PixelRect {
    /// First and last column.
    pub(crate) x: [usize; 2],
    /// First and last row.
    pub(crate) y: [usize; 2],
}

/// A map of `SIDE` by `SIDE` pixels with one bit each.
#[derive(Clone, Debug)]
pub(crate) struct RayMap {
    rows: Vec<Row>,
}

/// For each column (or row) of pixels of a new map, the first and last column (or row) of the former map that
/// rays through it may meet. Both never decrease from one pixel to the next.
pub(crate) type Ranges = [[u16; 2]; SIDE];

impl RayMap {
    pub(crate) fn new() -> Self {
        Self { rows: alloc::vec![[0; WORDS]; SIDE] }
    }

    pub(crate) fn clear(&mut self) {
        self.rows.fill([0; WORDS]);
    }

    /// Sets the pixels `first` to `last`, both included, of a row.
    #[cfg(test)]
    pub(crate) fn set_span(&mut self, row: usize, first: usize, last: usize) {
        set_span(&mut self.rows[row], first, last);
    }

    /// Tests whether all pixels of `rect` are set.
    pub(crate) fn all_set(&self, rect: PixelRect) -> bool {
        let [a, b] = rect.x.map(|x| x / 64);
        let (first, last) = (u64::MAX << (rect.x[0] % 64), u64::MAX >> (63 - rect.x[1] % 64));
        self.rows[rect.y[0]..=rect.y[1]].iter().all(|row| {
            if a == b {
                return !row[a] & first & last == 0;
            }
            !row[a] & first == 0 && !row[b] & last == 0 && row[a + 1..b].iter().all(|&word| word == u64::MAX)
        })
    }

    /// Returns whether `rect` may contain a rectangle of set pixels that has at least `least[0]` columns and
    /// `least[1]` rows. False is certain; true may also mean unknown. If `least` is more than half of `rect`,
    /// all such rectangles contain the middle of `rect`, which is tested.
    pub(crate) fn may_hold(&self, rect: PixelRect, least: [usize; 2]) -> bool {
        let middle = |[first, last]: [usize; 2], least: usize| {
            let middle = [(last + 1).saturating_sub(least).max(first), (first + least - 1).min(last)];
            (middle[0] <= middle[1]).then_some(middle)
        };
        let columns = middle(rect.x, least[0]);
        let row = |y: usize| match columns {
            Some(x) => self.all_set(PixelRect { x, y: [y; 2] }),
            None => self.rows[y][rect.x[0] / 64..=rect.x[1] / 64].iter().any(|&word| word != 0),
        };
        match middle(rect.y, least[1]) {
            Some([first, last]) => (first..=last).all(row),
            None => (rect.y[0]..=rect.y[1]).any(row),
        }
    }

    /// Tests whether any pixel is set.
    pub(crate) fn any_set(&self) -> bool {
        self.rows.iter().flatten().any(|&word| word != 0)
    }

    /// Returns the words of the rows from `first` on. A word holds 64 pixels.
    pub(super) fn rows(&self, first: usize) -> &[Row] {
        &self.rows[first..]
    }

    /// Returns the words of the rows from `first` on, to be changed.
    pub(super) fn rows_mut(&mut self, first: usize) -> &mut [Row] {
        &mut self.rows[first..]
    }

    /// Returns whether a pixel is set.
    pub(crate) fn get(&self, x: usize, y: usize) -> bool {
        self.rows[y][x / 64] >> (x % 64) & 1 != 0
    }

    /// Replaces the map with its erosion. A pixel of the result is set if all former pixels in its column's
    /// range of `columns` and its row's range of `rows` were set. Takes time linear in the number of words
    /// and of runs of bits.
    pub(crate) fn erode(&mut self, columns: &Ranges, rows: &Ranges, scratch: &mut RayMap) {
        self.and_rows(rows, scratch);
        // Of a run of set bits, the pixels remain whose ranges are within the run: from the first pixel whose
        // range begins in the run to the last whose range ends in it.
        let (mut begins, mut ends) = ([0u16; SIDE + 1], [0u16; SIDE + 1]);
        let (mut first, mut last) = (0, 0);
        for at in 0..SIDE {
            while first < SIDE && usize::from(columns[first][0]) < at {
                first += 1;
            }
            while last < SIDE && usize::from(columns[last][1]) <= at {
                last += 1;
            }
            begins[at] = first as u16;
            // One past the last pixel whose range ends at or before column `at`.
            ends[at] = last as u16;
        }
        for (row, out) in scratch.rows.iter().zip(&mut self.rows) {
            *out = [0; WORDS];
            let mut at = 0;
            while let Some(start) = next(row, at, 0) {
                let end = next(row, start, u64::MAX).unwrap_or(SIDE);
                let (a, b) = (usize::from(begins[start]), usize::from(ends[end - 1]));
                if a < b {
                    set_span(out, a, b - 1);
                }
                at = end;
            }
        }
    }

    /// Writes to row `j` of `out` the bitwise AND of the rows of this map from `ranges[j][0]` to
    /// `ranges[j][1]`. Ends of ranges never decrease, so a queue of two stacks needs three AND operations for
    /// each row.
    fn and_rows(&self, ranges: &Ranges, out: &mut RayMap) {
        // `suffix[r]` is the AND of rows r to `middle`; `back` is the AND of the rows after `middle` up to
        // `end`.
        let mut suffix = [[0; WORDS]; SIDE];
        let (mut middle, mut end, mut back) = (None, None, [u64::MAX; WORDS]);
        for (range, out) in ranges.iter().zip(&mut out.rows) {
            let [low, high] = range.map(usize::from);
            while end.is_none_or(|end| end < high) {
                let next = end.map_or(0, |end| end + 1);
                back = and(&back, &self.rows[next]);
                end = Some(next);
            }
            if middle.is_none_or(|middle| middle < low) {
                let mut all = [u64::MAX; WORDS];
                for r in (low..=high).rev() {
                    all = and(&all, &self.rows[r]);
                    suffix[r] = all;
                }
                (middle, back) = (Some(high), [u64::MAX; WORDS]);
            }
            *out = and(&suffix[low], &back);
        }
    }
}

fn and(a: &Row, b: &Row) -> Row {
    core::array::from_fn(|i| a[i] & b[i])
}

/// Returns the index of the pixel that holds a pixel coordinate, which must be from 0 to less than 2^20. A
/// coordinate less than 2^-32 before the next pixel may count as in that one.
#[inline]
pub(super) fn pixel_at(x: f64) -> usize {
    // The last place of the sum is 2^-32, and 20 bits of its mantissa are before the point.
    ((x + 1_048_576.0).to_bits() >> 32) as usize & 0xf_ffff
}

#[inline]
pub(super) fn set_span(row: &mut [u64], first: usize, last: usize) {
    let (a, b) = (first / 64, last / 64);
    let (begin, end) = (u64::MAX << (first % 64), u64::MAX >> (63 - last % 64));
    if a == b {
        row[a] |= begin & end;
    } else {
        row[a] |= begin;
        // Most spans end in the next word. For an empty range, `fill` would be a call all the same.
        if b - a > 1 {
            row[a + 1..b].fill(u64::MAX);
        }
        row[b] |= end;
    }
}

/// Returns the first position from `at` on whose bit differs from `than`, a word of all zeros or all ones.
/// `None` if all bits are equal to it.
fn next(row: &Row, at: usize, than: u64) -> Option<usize> {
    let mut word = at / 64;
    let mut bits = (*row.get(word)? ^ than) & u64::MAX << (at % 64);
    while bits == 0 {
        word += 1;
        bits = row.get(word)? ^ than;
    }
    Some(word * 64 + bits.trailing_zeros() as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::Random;

    #[test]
    fn erosion_keeps_a_pixel_if_all_pixels_of_its_ranges_are_set() {
        let mut rng = Random(7);
        for density in [2, 8, 40] {
            let mut map = RayMap::new();
            for y in 0..SIDE {
                for _ in 0..density {
                    let x = rng.below(SIDE);
                    map.set_span(y, x, (x + rng.below(120)).min(SIDE - 1));
                }
            }
            let mut ranges = |reach: usize| {
                let mut all = [[0; 2]; SIDE];
                let (mut low, mut high) = (0, 0);
                for (i, range) in all.iter_mut().enumerate() {
                    low = low.max(i.saturating_sub(rng.below(reach)));
                    high = high.max((i + rng.below(reach)).min(SIDE - 1)).max(low);
                    *range = [low as u16, high as u16];
                }
                all
            };
            let (columns, rows) = (ranges(4), ranges(3));
            let mut eroded = map.clone();
            eroded.erode(&columns, &rows, &mut RayMap::new());
            let mut kept = 0;
            for y in (0..SIDE).step_by(3) {
                for (x, column) in columns.iter().enumerate() {
                    let rect = PixelRect { x: column.map(usize::from), y: rows[y].map(usize::from) };
                    let all = (rect.y[0]..=rect.y[1]).all(|y| (rect.x[0]..=rect.x[1]).all(|x| map.get(x, y)));
                    assert_eq!(eroded.get(x, y), all, "{x} {y}");
                    assert_eq!(map.all_set(rect), all, "{rect:?} as a whole");
                    kept += usize::from(all);
                }
            }
            assert!(density == 2 || kept > 100, "{density} {kept}");
        }
    }

    /// Returns columns at the borders and in the middle of words.
    fn columns() -> impl Iterator<Item = usize> + Clone {
        (0..SIDE).filter(|x| matches!(x % 64, 0..=1 | 31 | 62..=63))
    }

    /// Spans and rectangles that begin and end at borders of words, compared bit by bit.
    #[test]
    fn spans_hold_their_pixels_and_no_others() {
        let mut map = RayMap::new();
        for (first, last) in columns().flat_map(|a| columns().map(move |b| (a, b))).filter(|(a, b)| a <= b) {
            let rect = PixelRect { x: [first, last], y: [2, 2] };
            map.set_span(2, first, last);
            assert!((0..SIDE).all(|x| map.get(x, 2) == (first..=last).contains(&x)), "{first} to {last}");
            assert!(
                (0..SIDE).all(|x| !map.get(x, 1) && !map.get(x, 3)),
                "{first} to {last}: rows above and below"
            );
            assert!(
                map.all_set(rect) && map.may_hold(rect, [last + 1 - first, 1]),
                "{first} to {last}: the span is set, and holds itself"
            );
            let wider = [first.saturating_sub(1), (last + 1).min(SIDE - 1)];
            for x in [[wider[0], last], [first, wider[1]]] {
                assert_eq!(map.all_set(PixelRect { x, y: [2, 2] }), x == rect.x, "{first} to {last}");
            }
            assert!(
                !map.all_set(PixelRect { y: [2, 3], ..rect })
                    && !map.all_set(PixelRect { y: [1, 2], ..rect }),
                "{first} to {last}: the rows above and below are not set"
            );
            // A single cleared pixel, in the first, the last, or a column between.
            for hole in [first, last, (first + last) / 2] {
                let mut other = map.clone();
                other.rows[2][hole / 64] &= !(1 << (hole % 64));
                assert!(!other.all_set(rect), "{first} to {last}: with a hole at {hole}");
            }
            map.clear();
        }
    }

    /// Runs that begin and end at borders of words, eroded by ranges that end at the sides of the map.
    #[test]
    fn erosion_of_a_run_is_what_its_ranges_say() {
        let mut scratch = RayMap::new();
        for [before, after] in [[0, 0], [1, 0], [0, 1], [1, 2], [70, 70]] {
            let ranges: Ranges =
                core::array::from_fn(|i| [i.saturating_sub(before) as u16, (i + after).min(SIDE - 1) as u16]);
            let own: Ranges = core::array::from_fn(|i| [i as u16; 2]);
            let mut runs = columns().flat_map(|a| columns().map(move |b| [a, b])).filter(|[a, b]| a <= b);
            let mut next_run = || runs.next();
            while let Some(run) = next_run() {
                // One run in each row.
                let mut all = alloc::vec![run];
                all.extend(core::iter::from_fn(&mut next_run).take(SIDE - 1));
                let mut map = RayMap::new();
                all.iter().enumerate().for_each(|(y, run)| map.set_span(y, run[0], run[1]));
                map.erode(&ranges, &own, &mut scratch);
                for (y, run) in all.iter().enumerate() {
                    for (x, range) in ranges.iter().enumerate() {
                        let [a, b] = range.map(usize::from);
                        assert_eq!(map.get(x, y), run[0] <= a && b <= run[1], "{x} of {run:?}");
                    }
                }
            }
        }
    }

    /// Compares `may_hold` with a test of every rectangle of the least size within `rect`, pixel by pixel.
    #[test]
    fn a_rectangle_that_holds_no_covered_one_is_found_out_often() {
        let mut rng = Random(9);
        let mut map = RayMap::new();
        // Random rectangles of set pixels within the first columns, with a few holes.
        const MAX: usize = 80;
        for _ in 0..40 {
            let (x, y) = (rng.below(MAX), rng.below(MAX));
            let (width, height) = (rng.below(30), rng.below(30));
            (y..y + height).for_each(|y| map.set_span(y, x, x + width));
        }
        let (mut holding, mut empty, mut refused) = ([0; 4], [0; 4], [0; 4]);
        for _ in 0..40_000 {
            let mut side = || {
                // The range may begin beyond all set pixels.
                let (first, size) = (rng.below(MAX) + rng.pick(&[0, 0, 128]), 1 + rng.below(12));
                ([first, first + size - 1], 1 + rng.below(size))
            };
            let ((x, width), (y, height)) = (side(), side());
            let rect = |x: usize, y: usize| (y..y + height).all(|y| (x..x + width).all(|x| map.get(x, y)));
            let holds = (y[0]..=y[1] + 1 - height).any(|y| (x[0]..=x[1] + 1 - width).any(|x| rect(x, y)));
            let may_hold = map.may_hold(PixelRect { x, y }, [width, height]);
            assert!(may_hold || !holds, "{width} by {height} in {x:?} {y:?}");
            // Whether all rectangles of the least size have a pixel in common, along x and along y.
            let [wide, high] = [(x, width), (y, height)].map(|([a, b], least)| 2 * least > b - a + 1);
            let kind = usize::from(wide) + 2 * usize::from(high);
            holding[kind] += usize::from(holds);
            empty[kind] += usize::from(!holds);
            refused[kind] += usize::from(!may_hold);
        }
        // A span across the border between two words.
        map.clear();
        map.set_span(3, 61, 63);
        assert!(map.may_hold(PixelRect { x: [58, 69], y: [3, 3] }, [3, 1]), "a span that ends with a word");
        // At least this fraction of the tests without a set rectangle must return false, by whether all
        // rectangles have a pixel in common.
        for (kind, part) in [0.8, 0.9, 0.75, 0.97].into_iter().enumerate() {
            assert!(holding[kind] > 1000 && empty[kind] > 500, "{holding:?} {empty:?}");
            let found = refused[kind] as f64 / empty[kind] as f64;
            assert!(found > part, "{kind}: {found}");
        }
    }
}
