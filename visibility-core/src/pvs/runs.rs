//! Encoding of the lists of PVS rows: as lengths of runs, or as bits.

use crate::binary_format::{push_number, take_number};
use alloc::vec::Vec;

/// Appends the runs of a strictly ascending row: alternating lengths of absent and of present numbers,
/// beginning with absent ones (maybe 0) and ending with present ones.
pub(super) fn write_runs(row: impl Iterator<Item = u32>, out: &mut Vec<u8>) {
    // `start..end` is the run of present numbers being collected, `before` the end of the run before it.
    let (mut start, mut end, mut before) = (0, 0, 0);
    let mut flush = |start: u32, end: u32| {
        push_number(start - before, out);
        push_number(end - start, out);
        before = end;
    };
    for number in row {
        if number != end {
            if start != end {
                flush(start, end);
            }
            start = number;
        }
        end = number + 1;
    }
    if start != end {
        flush(start, end);
    }
}

/// Appends a strictly ascending row as bits, least significant first, up to the byte of its last number.
/// Stops and returns false if `out` would get `limit` bytes or more: a row of one great number has as many
/// bits.
pub(super) fn write_bits(row: impl Iterator<Item = u32>, limit: usize, out: &mut Vec<u8>) -> bool {
    let start = out.len();
    for number in row {
        let at = start + number as usize / 8;
        if at + 1 >= limit {
            return false;
        }
        if at >= out.len() {
            out.resize(at + 1, 0);
        }
        out[at] |= 1 << (number % 8);
    }
    out.len() < limit
}

/// Iterator over the encoded runs of present numbers, as half-open ranges `(start, end)`. Yields `Err` with a
/// description if the bytes are malformed, and then ends.
pub(super) struct Runs<'a> {
    bytes: &'a [u8],
    at: u32,
    is_bits: bool,
}

impl<'a> Runs<'a> {
    pub(super) fn new(bytes: &'a [u8], is_bits: bool) -> Self {
        Self { bytes, at: 0, is_bits }
    }

    fn number(&mut self) -> Result<u32, &'static str> {
        take_number(&mut self.bytes).ok_or("a number is cut off, too large or longer than it need be")
    }

    fn run(&mut self) -> Result<(u32, u32), &'static str> {
        let (skip, take) = (self.number()?, self.number()?);
        let start = self.at.checked_add(skip).ok_or("a run begins too far")?;
        self.at = start.checked_add(take).ok_or("a run ends too far")?;
        Ok((start, self.at))
    }

    /// Moves `at` past the bits equal to `value` that begin there, up to the first other bit or the end of
    /// the bytes. Returns the number of these bits.
    fn bits(&mut self, value: bool) -> u32 {
        let start = self.at;
        while let Some(byte) = self.bytes.get(self.at as usize / 8) {
            let rest = (if value { !byte } else { *byte }) >> (self.at % 8);
            let equal = rest.trailing_zeros().min(8 - self.at % 8);
            self.at += equal;
            if !self.at.is_multiple_of(8) || equal == 0 {
                break;
            }
        }
        self.at - start
    }
}

impl Iterator for Runs<'_> {
    type Item = Result<(u32, u32), &'static str>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.is_bits {
            self.bits(false);
            let start = self.at;
            return (self.bits(true) > 0).then_some(Ok((start, self.at)));
        }
        if self.bytes.is_empty() {
            return None;
        }
        let run = self.run();
        if run.is_err() {
            self.bytes = &[];
        }
        Some(run)
    }
}

/// Returns the little-endian `u32` at byte offset `place`; 0 if fewer than four bytes are there.
pub(super) fn word(bytes: &[u8], place: usize) -> u32 {
    match bytes.get(place..).and_then(|rest| rest.first_chunk()) {
        Some(&word) => u32::from_le_bytes(word),
        None => 0,
    }
}
