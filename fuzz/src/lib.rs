//! Library of the fuzz targets.

/// Repairs the length and the checksum in the header that baked sets, tessellations and interrupted bakes
/// share. No fuzzed input has both right by chance, so the code behind the checksum would never be reached.
/// Fewer than 40 bytes, the size of a header, are left unchanged.
pub fn mend(bytes: &mut [u8]) {
    if bytes.len() < 40 {
        return;
    }
    let length = bytes.len() as u64;
    bytes[24..32].copy_from_slice(&length.to_le_bytes());
    let all = bytes[..32].iter().chain(&bytes[40..]);
    let sum = all.fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    bytes[32..40].copy_from_slice(&sum.to_le_bytes());
}
