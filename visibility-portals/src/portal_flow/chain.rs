//! The current chain of portals: how it is extended, and the set of candidates that lines through it can
//! still reach.

use super::known::{Found, Known};
use super::scratch::{Frame, Scratch};
use crate::cell_matrix::bits;
use crate::clip_polygon::{Clip, clip};
use crate::separating_planes::{Facing, push_separating_planes};
use core::ops::Range;
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;

impl Scratch {
    /// Begins the chain with portal `source`. All candidates of the source may be reached from it.
    pub(crate) fn enter_source(&mut self, known: &Known, source: u32) {
        let portal = &known.portals.all[source as usize];
        self.points.extend_from_slice(known.portals.vertices_of(portal));
        let whole = 0..self.points.len();
        self.sets.resize(self.words, u64::MAX);
        if !self.count.is_multiple_of(64) {
            self.sets[self.words - 1] = u64::MAX >> (64 - self.count % 64);
        }
        self.push(portal.to, source, whole.clone(), whole, 0..0, 0, 0);
    }

    #[allow(clippy::too_many_arguments)]
    fn push(
        &mut self,
        cell: u32,
        portal: u32,
        source: Range<usize>,
        pass: Range<usize>,
        planes: Range<usize>,
        set: usize,
        points: usize,
    ) {
        let next = self.of_cell[cell as usize].0;
        self.frames.push(Frame { portal, cell, source, pass, planes, set, next, points });
    }

    /// Returns the next candidate by which to extend the chain, and pops the frames that have none left.
    /// `None` when the chain is empty.
    pub(crate) fn next_child(&mut self) -> Option<usize> {
        while let Some(frame) = self.frames.last_mut() {
            let end = self.of_cell[frame.cell as usize].1;
            let set = &self.sets[frame.set..];
            while frame.next < end {
                let child = frame.next as usize;
                frame.next += 1;
                if set[child / 64] >> (child % 64) & 1 != 0 {
                    return Some(child);
                }
            }
            self.points.truncate(frame.points);
            self.planes.truncate(frame.planes.start);
            self.sets.truncate(frame.set);
            self.frames.pop();
        }
        None
    }

    /// Extends the chain by candidate `child` if lines can pass it and then reach a goal. Records in `found`
    /// the cells that are seen and the chains excluded; `first` is the index of the source portal.
    pub(crate) fn visit(&mut self, known: &Known, first: u32, child: usize, found: &mut Found) {
        let Some(frame) = self.frames.last().cloned() else { return };
        let row = self.row(known, child);
        let is_goal = self.goals[child / 64] >> (child % 64) & 1 != 0;
        if !is_goal && !self.leads_to_goal(frame.set, row) {
            // No cell behind this portal remains to be found, so all portals that may be reached stay marked
            // as reached.
            self.reached[child / 64] |= 1 << (child % 64);
            self.reach_all(frame.set, row);
            return;
        }
        let points = self.points.len();
        let number = self.candidates[child];
        let Some((source, pass)) = self.narrow(known, first, &frame, child) else {
            self.points.truncate(points);
            return;
        };
        let cell = self.to[child];
        let mut proven = false;
        if is_goal {
            let line = self.middle_line(&source, &pass);
            proven = self.witness(known, number, line);
            if !proven && self.is_excluded(known, number, line) {
                found.rejected += 1;
                self.points.truncate(points);
                return;
            }
        }
        self.reached[child / 64] |= 1 << (child % 64);
        if is_goal {
            found.cells.push((cell, proven));
            self.drop_goals(cell);
        }
        if !self.leads_to_goal(frame.set, row) {
            self.reach_all(frame.set, row);
            self.points.truncate(points);
            return;
        }
        let (a, b) = (&known.portals.all[first as usize], &known.portals.all[number as usize]);
        let planes = self.planes.len();
        let [from, through] = [(a, &source), (b, &pass)].map(|(portal, place)| Facing {
            vertices: &self.points[place.clone()],
            normal: portal.plane.normal,
            sense: 1.0,
        });
        push_separating_planes(from, through, &known.portals.margins, &mut self.planes);
        let planes = planes..self.planes.len();
        let set = self.sets.len();
        self.flood_again(known, frame.set, row, cell, planes.clone());
        let after = &self.sets[set..];
        if after.iter().zip(&self.goals).all(|(a, b)| a & b == 0) {
            self.reached.iter_mut().zip(after).for_each(|(reached, after)| *reached |= after);
            self.sets.truncate(set);
            self.planes.truncate(planes.start);
            self.points.truncate(points);
            return;
        }
        self.push(cell, number, source, pass, planes, set, points);
    }

    /// Tests whether three bitsets over the candidates have a bit in common: the set at offset `set` in
    /// `sets`, the row at offset `row` in `rows`, and `goals`.
    fn leads_to_goal(&self, set: usize, row: usize) -> bool {
        let sets = self.sets[set..].iter().zip(self.row_words(row)).zip(&self.goals);
        sets.into_iter().any(|((a, b), c)| a & b & c != 0)
    }

    /// Marks as reached the candidates that are both in the set at offset `set` in `sets` and in the row at
    /// offset `row` in `rows`.
    fn reach_all(&mut self, set: usize, row: usize) {
        let words = self.words;
        for i in 0..words {
            self.reached[i] |= self.sets[set + i] & self.row_words(row)[i];
        }
    }

    /// Removes the candidates that lead to `cell` from `goals`, since the cell is now known to be seen.
    fn drop_goals(&mut self, cell: u32) {
        for (i, _) in self.to.iter().enumerate().filter(|(_, to)| **to == cell) {
            self.goals[i / 64] &= !(1 << (i % 64));
        }
    }

    /// Returns the part of the source and the part of candidate `child` between which lines can pass the last
    /// portal of the chain, as ranges of `points`. `None` if either part is empty. Clipped polygons are
    /// appended to `points`, also if the result is `None`.
    fn narrow(
        &mut self,
        known: &Known,
        first: u32,
        frame: &Frame,
        child: usize,
    ) -> Option<(Range<usize>, Range<usize>)> {
        let (all, margins) = (&known.portals.all, &known.portals.margins);
        let portal = &all[self.candidates[child] as usize];
        let start = self.points.len();
        self.points.extend_from_slice(known.portals.vertices_of(portal));
        let mut pass = start..self.points.len();
        if self.cut[child] {
            let plane = outward(&all[first as usize].plane, margins.keep);
            pass = self.clipped(pass, &plane, margins.merge)?;
        }
        for i in frame.planes.clone() {
            let plane = self.planes[i];
            pass = self.clipped(pass, &plane, margins.merge)?;
        }
        let behind = outward(&portal.plane.flipped(), margins.keep);
        let mut source = self.clipped(frame.source.clone(), &behind, margins.merge)?;
        if frame.portal != first {
            let back =
                |vertices, of: u32| Facing { vertices, normal: all[of as usize].plane.normal, sense: -1.0 };
            let planes = self.planes.len();
            let target = back(&self.points[pass.clone()], self.candidates[child]);
            let middle = back(&self.points[frame.pass.clone()], frame.portal);
            push_separating_planes(target, middle, margins, &mut self.planes);
            for i in planes..self.planes.len() {
                let plane = self.planes[i];
                let Some(part) = self.clipped(source, &plane, margins.merge) else {
                    self.planes.truncate(planes);
                    return None;
                };
                source = part;
            }
            self.planes.truncate(planes);
        }
        Some((source, pass))
    }

    fn clipped(&mut self, polygon: Range<usize>, plane: &Plane, merge: f64) -> Option<Range<usize>> {
        match clip(&mut self.points, polygon.clone(), plane, merge) {
            Clip::All => Some(polygon),
            Clip::Part(start) => Some(start..self.points.len()),
            Clip::Nothing => None,
        }
    }

    /// Appends to `sets` the bitset of the candidates that are in the set at offset `from` in `sets` and in
    /// the row at offset `row` in `rows`, can be reached from `cell` by a flood fill through cells, and are
    /// not outside any of `planes`.
    fn flood_again(&mut self, known: &Known, from: usize, row: usize, cell: u32, planes: Range<usize>) {
        let set = self.sets.len();
        self.sets.resize(set + self.words, 0);
        let (before, after) = self.sets.split_at_mut(set);
        let before = &before[from..];
        let planes = &self.planes[planes];
        if self.stamp == u32::MAX {
            self.stamps.fill(0);
            self.stamp = 0;
        }
        self.stamp += 1;
        self.queue.clear();
        self.queue.push(cell);
        self.stamps[cell as usize] = self.stamp;
        let row = &self.rows[row..row + self.words];
        while let Some(cell) = self.queue.pop() {
            let (start, end) = self.of_cell[cell as usize];
            let mut word = start as usize / 64;
            while word * 64 < end as usize {
                let mut mask = before[word] & row[word];
                if word == start as usize / 64 {
                    mask &= u64::MAX << (start % 64);
                }
                if end as usize - word * 64 < 64 {
                    mask &= (1 << (end as usize - word * 64)) - 1;
                }
                for bit in bits(mask) {
                    let i = word * 64 + bit as usize;
                    if outside(known, planes, self.balls[i], self.candidates[i]) {
                        continue;
                    }
                    after[word] |= 1 << bit;
                    let to = self.to[i] as usize;
                    if self.stamps[to] != self.stamp {
                        self.stamps[to] = self.stamp;
                        self.queue.push(to as u32);
                    }
                }
                word += 1;
            }
        }
    }
}

/// Tests whether all vertices of a portal are outside one of the planes. `ball` is the centre and the radius
/// of a ball that contains the portal. `false` without planes.
fn outside(known: &Known, planes: &[Plane], ball: (DVec3, f64), portal: u32) -> bool {
    // The least distance over all planes decides nearly always. Without branches the loop handles several
    // planes at once.
    let (center, radius) = ball;
    let distance = |plane: &Plane| {
        plane.normal.x * center.x + plane.normal.y * center.y + plane.normal.z * center.z + plane.offset
    };
    let least = planes.iter().fold(f64::INFINITY, |least, plane| {
        let distance = distance(plane);
        if distance < least { distance } else { least }
    });
    // At least one vertex is as far inside as the mean of the vertices.
    if least >= 0.0 || least < -radius {
        return least < 0.0;
    }
    let vertices = known.portals.vertices_of(&known.portals.all[portal as usize]);
    planes
        .iter()
        .any(|plane| distance(plane) < 0.0 && vertices.iter().all(|&v| plane.signed_distance(v) < 0.0))
}

/// Returns the half-space enlarged: its boundary moved by `by` world units against its unit normal.
fn outward(plane: &Plane, by: f64) -> Plane {
    Plane::new(plane.normal, plane.offset + by)
}
