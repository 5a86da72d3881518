//! Hash function with which tests pin answers across targets.

/// Returns the FNV-1a hash (Fowler, Noll and Vo) of `bytes`, continued from the hash of the bytes before, or
/// from [`FNV_START`].
pub fn fnv(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// FNV-1a hash of an empty sequence.
pub const FNV_START: u64 = 0xcbf2_9ce4_8422_2325;
