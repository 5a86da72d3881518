//! A bake put aside as bytes, and taken up again.
//!
//! All numbers are `u64`, least significant byte first: a magic word, a fingerprint of map and settings, the state, and a checksum.

use super::{BakeError, CellBake, Settings};
use alloc::vec::Vec;
use visibility_core::CellGraph;

/// `VISBAKE2`: the second form.
const MAGIC: u64 = u64::from_le_bytes(*b"VISBAKE2");

impl CellBake {
    /// The state of the bake, for [`resume`](Self::resume).
    pub fn save(&self) -> Vec<u8> {
        let mut words = alloc::vec![MAGIC, self.fingerprint(), self.total, self.rejected];
        words.push(self.waiting.len() as u64);
        words.extend(self.waiting.iter().map(|&portal| u64::from(portal)));
        words.extend(self.fallbacks.iter().map(|&count| u64::from(count)));
        for part in [&self.steps, &self.rows, &self.seen] {
            words.extend_from_slice(part);
        }
        words.push(hash(words.iter().copied()));
        words.iter().flat_map(|word| word.to_le_bytes()).collect()
    }

    /// Goes on with a bake that was [saved](Self::save): with the same map and settings it gives the same answer as one that was never
    /// interrupted.
    ///
    /// # Errors
    /// As [`new`](Self::new); [`BakeError::Saved`] if the bytes are damaged, or of another map or other settings.
    pub fn resume(graph: &CellGraph, settings: Settings, bytes: &[u8]) -> Result<Self, BakeError> {
        let refused = |problem| Err(BakeError::Saved { problem });
        let mut bake = Self::new(graph, settings)?;
        if !bytes.len().is_multiple_of(8) {
            return refused("it does not end where a number does");
        }
        let words: Vec<u64> =
            bytes.chunks_exact(8).map(|b| b.iter().rev().fold(0, |w, &b| w << 8 | u64::from(b))).collect();
        let Some((&sum, words)) = words.split_last() else { return refused("it is empty") };
        let &[MAGIC, fingerprint, total, rejected, waiting, ref rest @ ..] = words else {
            return refused("it is no saved bake");
        };
        if hash(words.iter().copied()) != sum {
            return refused("the checksum is wrong: it was damaged");
        }
        if fingerprint != bake.fingerprint() {
            return refused("it is of another map or of other settings");
        }
        let directed = bake.portals.all.len();
        let state = bake.fallbacks.len() + bake.steps.len() + bake.rows.len() + bake.seen.len();
        if waiting > directed as u64 || rest.len() != waiting as usize + state {
            return refused("its length is wrong");
        }
        let (portals, mut rest) = rest.split_at(waiting as usize);
        if portals.iter().any(|&portal| portal >= directed as u64) {
            return refused("it names an unknown portal");
        }
        bake.waiting = portals.iter().map(|&portal| portal as u32).collect();
        let mut next = |count: usize| {
            let (part, after) = rest.split_at(count);
            rest = after;
            part
        };
        bake.fallbacks = next(bake.fallbacks.len()).iter().map(|&count| count as u32).collect();
        bake.steps = next(bake.steps.len()).to_vec();
        // What the planes alone exclude stays excluded, so that no bit of no portal comes in.
        for (known, &saved) in bake.rows.iter_mut().zip(next(directed * bake.stride)) {
            *known &= saved;
        }
        bake.seen = next(bake.seen.len()).to_vec();
        for (row, count) in bake.rows.chunks_exact(bake.stride.max(1)).zip(&mut bake.counts) {
            *count = row.iter().map(|word| word.count_ones()).sum();
        }
        (bake.total, bake.rejected) = (total, rejected);
        Ok(bake)
    }

    /// Of all that decides what a bake does.
    fn fingerprint(&self) -> u64 {
        let Settings { clearance, steps_per_cell, exact } = self.settings;
        let settings = [clearance.to_bits(), steps_per_cell, u64::from(exact), self.cells as u64];
        let ends = self.portals.all.iter().map(|portal| u64::from(portal.from) << 32 | u64::from(portal.to));
        let vertices = self.portals.vertices.iter().flat_map(|v| v.to_array()).map(f64::to_bits);
        hash(settings.into_iter().chain(ends).chain(vertices))
    }
}

/// Fowler, Noll and Vo's hash, FNV-1a in 64 bits, of words, with the upper halves turned in.
fn hash(words: impl Iterator<Item = u64>) -> u64 {
    words.fold(0xcbf2_9ce4_8422_2325, |hash: u64, word| {
        let mixed = (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3);
        mixed ^ mixed >> 29
    })
}
