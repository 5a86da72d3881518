//! Choice of the few virtual occluders that hide most.

use super::umbra::Umbra;
use alloc::vec::Vec;
use visibility_core::bits::Bits;

/// A box: least, then greatest values of the plan's two coordinates and the height.
pub(crate) type PlanBox = [[f64; 3]; 2];

/// Moves the umbrae that together hide most of `boxes` to the front, and drops the others. Each is the umbra
/// that hides most of the boxes that no umbra before it hides. At most `most` are kept, and none that hides
/// no further box.
pub(crate) fn choose(umbrae: &mut Vec<Umbra>, boxes: &[PlanBox], most: usize) {
    let hides = |umbra: &Umbra| {
        let mut hidden = Bits::new(boxes.len());
        for (i, [min, max]) in boxes.iter().enumerate() {
            hidden.set(i, umbra.hides(*min, *max));
        }
        hidden
    };
    let mut hides: Vec<Bits> = umbrae.iter().map(hides).collect();
    let mut hidden = Bits::new(boxes.len());
    let mut chosen = 0;
    while chosen < most.min(umbrae.len()) {
        // Of equal ones the first: the nearest line of the largest seed.
        let (index, most) = (chosen..umbrae.len())
            .map(|index| (index, hides[index].count_without(&hidden)))
            .fold((chosen, 0), |best, next| if next.1 > best.1 { next } else { best });
        if most == 0 {
            break;
        }
        hidden.unite(&hides[index]);
        // The order of the others stays.
        umbrae[chosen..=index].rotate_right(1);
        hides[chosen..=index].rotate_right(1);
        chosen += 1;
    }
    umbrae.truncate(chosen);
}
