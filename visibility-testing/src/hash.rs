//! The hash by which tests pin answers.

/// The hash of some bytes, continued from an earlier hash or [`FNV_START`]: FNV-1a (Fowler, Noll and Vo).
pub fn fnv(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// The hash of no bytes.
pub const FNV_START: u64 = 0xcbf2_9ce4_8422_2325;
