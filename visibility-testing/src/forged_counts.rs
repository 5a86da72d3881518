//! Files with forged counts, for tests of how much memory their readers allocate.

use crate::allocations::{LIVE, PEAK};
use crate::hash::{FNV_START, fnv};

/// Length in bytes of the header of the crates' binary formats, described in `docs/formats.md`.
const HEADER: usize = 40;

/// Byte patterns written over each position of a file: the greatest counts in four and eight bytes, half of
/// these, some that a reader might still accept as a count, and the greatest count in seven bits per byte.
const FORGED: [&[u8]; 6] = [
    &[0xff; 4],
    &[0xff; 8],
    &[0xff, 0xff, 0xff, 0x7f],
    &[0xff, 0xff, 0xff, 0x1f],
    &[0, 0, 0, 0x10],
    &[0xff, 0xff, 0xff, 0xff, 0x0f],
];

/// Repairs length and checksum of the header at `start` of a file.
pub fn mend_header(file: &mut [u8], start: usize) {
    let Some(file) = file.get_mut(start..).filter(|file| file.len() >= HEADER) else { return };
    let length = file.len() as u64;
    file[24..32].copy_from_slice(&length.to_le_bytes());
    let sum = fnv(fnv(FNV_START, &file[..32]), &file[HEADER..]);
    file[32..HEADER].copy_from_slice(&sum.to_le_bytes());
}

/// Calls `read` with copies of some bytes. In each copy another position, from offset `first` on, is
/// overwritten by a large count. Asserts that no call holds more than `limit` bytes of memory at once. The
/// test program must install the [`CountingAllocator`](crate::allocations::CountingAllocator).
///
/// # Panics
/// Panics if a call holds more, or if the allocator does not count.
pub fn forge_counts(bytes: &[u8], first: usize, limit: usize, mut read: impl FnMut(Vec<u8>)) {
    let counted = LIVE.get();
    let kept = vec![0u8; 64];
    assert!(LIVE.get() > counted, "the allocator does not count");
    drop(kept);
    for (at, forged) in (first..bytes.len()).flat_map(|at| FORGED.map(|forged| (at, forged))) {
        let mut file = bytes.to_vec();
        let end = bytes.len().min(at + forged.len());
        file[at..end].copy_from_slice(&forged[..end - at]);
        let before = LIVE.get();
        PEAK.set(before);
        read(file);
        let peak = PEAK.get() - before;
        assert!(peak <= limit as isize, "{forged:x?} at byte {at} takes {peak} bytes of memory");
    }
}
