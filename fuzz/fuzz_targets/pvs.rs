//! Any bytes as a baked set: refused with a reason, or usable to the last row.
#![no_main]

use libfuzzer_sys::fuzz_target;
use visibility_core::{CellId, Pvs};

fuzz_target!(|bytes: &[u8]| {
    ask(bytes.to_vec());
    // No input has the right checksum by chance: mend it, so that what lies behind it is reached too.
    let mut mended = bytes.to_vec();
    if mended.len() >= 40 {
        let length = mended.len() as u64;
        mended[24..32].copy_from_slice(&length.to_le_bytes());
        let all = mended[..32].iter().chain(&mended[40..]);
        let sum = all.fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
        mended[32..40].copy_from_slice(&sum.to_le_bytes());
        ask(mended);
    }
});

fn ask(bytes: Vec<u8>) {
    let Ok(pvs) = Pvs::from_bytes(bytes) else { return };
    if pvs.target_count() > 1 << 20 {
        return;
    }
    let mut words = Vec::new();
    for cell in (0..pvs.viewcell_count() as u32 + 1).map(CellId) {
        pvs.write_bits(cell, &mut words);
        for target in [0, 1, pvs.target_count() as u32 / 2, pvs.target_count() as u32] {
            let bit = words.get(target as usize / 64).is_some_and(|word| word >> (target % 64) & 1 == 1);
            assert_eq!(pvs.sees(cell, target), bit && (target as usize) < pvs.target_count());
        }
    }
}
