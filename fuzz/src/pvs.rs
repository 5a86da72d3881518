//! Arbitrary bytes as a baked potentially visible set. They must be refused with an error, or be
//! readable to the last row.
use crate::mend;
use visibility_core::pvs::{Pvs, ViewcellId};

/// Runs the target on some bytes. Returns whether they were accepted with a repaired checksum.
pub fn run(bytes: &[u8]) -> bool {
    ask(bytes.to_vec());
    let mut mended = bytes.to_vec();
    mend(&mut mended);
    ask(mended)
}

/// Reads a set from bytes and, if it is accepted, compares single queries with whole rows. Returns whether
/// it is accepted.
fn ask(bytes: Vec<u8>) -> bool {
    let Ok(pvs) = Pvs::from_bytes(bytes) else { return false };
    if pvs.target_count() > 1 << 20 {
        return true;
    }
    let mut words = Vec::new();
    for cell in (0..pvs.viewcell_count() as u32 + 1).map(ViewcellId) {
        pvs.write_bits(cell, &mut words);
        for target in [0, 1, pvs.target_count() as u32 / 2, pvs.target_count() as u32] {
            let bit = words.get(target as usize / 64).is_some_and(|word| word >> (target % 64) & 1 == 1);
            let sees = bit && (target as usize) < pvs.target_count();
            assert_eq!(pvs.sees(cell, target), sees, "{cell:?}: target {target} by itself and in the row");
        }
    }
    true
}
