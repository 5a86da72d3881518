//! Choice of the few virtual occluders that hide most.

use super::umbra::Umbra;
use alloc::vec::Vec;

/// A box as the plan's two coordinates and the height: least and greatest.
pub(crate) type PlanBox = [[f64; 3]; 2];

/// Moves the umbrae that hide most of `boxes` to the front, one by one so that each hides the most that those
/// before do not, and drops those beyond `most` and those that add nothing.
pub(crate) fn choose(umbrae: &mut Vec<Umbra>, boxes: &[PlanBox], most: usize) {
    let words = boxes.len().div_ceil(64);
    let mut hides = alloc::vec![0u64; words * umbrae.len()];
    if words == 0 {
        umbrae.clear();
        return;
    }
    for (umbra, bits) in umbrae.iter().zip(hides.chunks_mut(words)) {
        for (i, [min, max]) in boxes.iter().enumerate() {
            bits[i / 64] |= u64::from(umbra.hides(*min, *max)) << (i % 64);
        }
    }
    let mut hidden = alloc::vec![0u64; words];
    let mut chosen = 0;
    while chosen < most.min(umbrae.len()) {
        let gain = |index: usize| -> u32 {
            let own = &hides[index * words..][..words];
            own.iter().zip(&hidden).map(|(own, hidden)| (own & !hidden).count_ones()).sum()
        };
        // Of equal ones the first: the nearest line of the largest seed.
        let (index, most) = (chosen..umbrae.len())
            .map(|index| (index, gain(index)))
            .fold((chosen, 0), |best, next| if next.1 > best.1 { next } else { best });
        if most == 0 {
            break;
        }
        hidden.iter_mut().zip(&hides[index * words..]).for_each(|(all, own)| *all |= own);
        // The order of the others stays.
        umbrae[chosen..=index].rotate_right(1);
        hides[chosen * words..(index + 1) * words].rotate_right(words);
        chosen += 1;
    }
    umbrae.truncate(chosen);
}
