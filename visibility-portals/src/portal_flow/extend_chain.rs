//! Extension of the current chain of portals, and the set of candidates that lines through the chain can
//! still reach.

use super::flow_input::{FlowInput, FlowResult};
use super::flow_scratch::FlowScratch;
use crate::portal_chain::{ChainFrame, is_outside};
use core::ops::Range;
use visibility_core::scene::lanes;

impl FlowScratch {
    /// Begins the chain of portals with directed portal `source`. The reachable portals of this first frame
    /// are all candidates of the source.
    pub(crate) fn enter_source(&mut self, input: &FlowInput, source: u32) {
        let portal = &input.portals.all[source as usize];
        let chain = &mut self.chain;
        chain.points.extend_from_slice(input.portals.vertices_of(portal));
        let all = 0..chain.points.len();
        chain.sets.resize(self.words, u64::MAX);
        if !self.count.is_multiple_of(64) {
            chain.sets[self.words - 1] = u64::MAX >> (64 - self.count % 64);
        }
        let children = self.of_cell[portal.to as usize].clone();
        let (portal, source, pass) = (source, all.clone(), all);
        chain.frames.push(ChainFrame { portal, source, pass, planes: 0..0, set: 0, children, points: 0 });
    }

    /// Extends the chain by the candidate with index `child` if lines can pass it and then reach a goal (a
    /// candidate that leads to a cell not yet known to be seen). Adds to `result` the cells found to be seen,
    /// and counts there a chain that only the test in Pluecker space excluded; `first` is the index of the
    /// source portal.
    pub(crate) fn visit(&mut self, input: &FlowInput, first: u32, child: usize, result: &mut FlowResult) {
        let Some(frame) = self.chain.frames.last().cloned() else { return };
        let row = self.row(input, child);
        let is_goal = self.goals.contains(child);
        if !is_goal && !self.leads_to_goal(frame.set, row) {
            // No cell behind this portal remains to be found, so all portals that may be reached stay marked
            // as reached.
            self.reached.insert(child);
            self.reach_all(frame.set, row);
            return;
        }
        // First test: the portals clipped against each other. An empty part means that no line passes.
        let points = self.chain.points.len();
        let portal = self.candidates[child];
        let Some((source, pass)) = self.chain.narrow(input.portals, first, &frame, portal, self.cut[child])
        else {
            self.chain.points.truncate(points);
            return;
        };
        let cell = self.to[child];
        let mut proven = false;
        // Second test, of goals alone, as it costs more: a line found proves the cell seen, a certificate in
        // Pluecker space proves that the chain has none.
        if is_goal {
            let line = self.middle_line(&source, &pass);
            proven = self.witness(input, portal, line);
            if !proven && self.is_excluded(input, portal, line) {
                result.rejected += 1;
                self.chain.points.truncate(points);
                return;
            }
        }
        self.reached.insert(child);
        if is_goal {
            result.cells.push((cell, proven));
            self.drop_goals(cell);
        }
        if !self.leads_to_goal(frame.set, row) {
            self.reach_all(frame.set, row);
            self.chain.points.truncate(points);
            return;
        }
        // The chain goes on if goals are left behind this portal that the new planes let through.
        let (planes, set) = (self.chain.planes.len(), self.chain.sets.len());
        self.chain.push_planes(input.portals, (first, &source), (portal, &pass));
        let planes = planes..self.chain.planes.len();
        self.push_reachable_set(input, frame.set, row, cell, planes.clone());
        if self.chain.frames.len() >= input.depth as usize {
            self.show_goals(set, result);
        }
        let after = &self.chain.sets[set..];
        if after.iter().zip(self.goals.words()).all(|(a, b)| a & b == 0) {
            self.reached.unite_words(after.iter().copied());
            self.chain.sets.truncate(set);
            self.chain.planes.truncate(planes.start);
            self.chain.points.truncate(points);
            return;
        }
        let children = self.of_cell[cell as usize].clone();
        self.chain.frames.push(ChainFrame { portal, source, pass, planes, set, children, points });
    }

    /// Tests whether some goal (a candidate that leads to a cell not yet known to be seen) can still be
    /// reached. True if three bitsets over the candidates have a bit in common, namely the set at offset
    /// `set` in the chain's sets, the row at offset `row` in `rows`, and `goals`. `false` if no goal can be
    /// reached.
    fn leads_to_goal(&self, set: usize, row: usize) -> bool {
        let sets = self.chain.sets[set..].iter().zip(self.row_words(row)).zip(self.goals.words());
        sets.into_iter().any(|((a, b), c)| a & b & c != 0)
    }

    /// Marks in `reached` the candidates (portals that may be seen through the source) that are both in the
    /// set at offset `set` in the chain's sets and in the row at offset `row` in `rows`.
    fn reach_all(&mut self, set: usize, row: usize) {
        let sets = self.chain.sets[set..].iter().zip(&self.rows[row..row + self.words]);
        self.reached.unite_words(sets.map(|(a, b)| a & b));
    }

    /// Removes the candidates that lead to `cell` from `goals`, the bitset of candidates whose cell is still
    /// to be found. Called once the cell is known to be seen.
    fn drop_goals(&mut self, cell: u32) {
        for (i, _) in self.to.iter().enumerate().filter(|(_, to)| **to == cell) {
            self.goals.remove(i);
        }
    }

    /// Adds to `result` the cells of the goals in the set at offset `set` in the chain's sets: they count as
    /// seen without proof, and are no goals any more.
    fn show_goals(&mut self, set: usize, result: &mut FlowResult) {
        for word in 0..self.words {
            while let Some(bit) = lanes(self.chain.sets[set + word] & self.goals.words()[word]).next() {
                let cell = self.to[word * 64 + bit];
                result.cells.push((cell, false));
                self.drop_goals(cell);
            }
        }
    }

    /// Appends to the chain's sets the bitset of the candidates that meet all of these conditions: they are
    /// in the set at offset `from` of the chain's sets; they are in the row at offset `row` of `rows`; a
    /// flood fill through cells reaches them from `cell`; and their portals are not outside any of `planes`.
    /// `planes` is a range of the chain's planes, whose normals point inside.
    fn push_reachable_set(
        &mut self,
        input: &FlowInput,
        from: usize,
        row: usize,
        cell: u32,
        planes: Range<usize>,
    ) {
        let set = self.chain.sets.len();
        self.chain.sets.resize(set + self.words, 0);
        let (before, after) = self.chain.sets.split_at_mut(set);
        let before = &before[from..];
        let planes = &self.chain.planes[planes];
        self.flood.begin(self.of_cell.len(), cell);
        let row = &self.rows[row..row + self.words];
        while let Some(cell) = self.flood.next_cell() {
            let (start, end) = (self.of_cell[cell as usize].start, self.of_cell[cell as usize].end as usize);
            let mut word = start as usize / 64;
            while word * 64 < end {
                let mut mask = before[word] & row[word];
                if word == start as usize / 64 {
                    mask &= u64::MAX << (start % 64);
                }
                if end - word * 64 < 64 {
                    mask &= (1 << (end - word * 64)) - 1;
                }
                for bit in lanes(mask) {
                    let i = word * 64 + bit;
                    if is_outside(input.portals, planes, self.candidates[i], self.balls[i]) {
                        continue;
                    }
                    after[word] |= 1 << bit;
                    self.flood.reach(self.to[i]);
                }
                word += 1;
            }
        }
    }
}
