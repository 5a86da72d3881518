//! Greedy choice of the few virtual occluders that hide the most objects.

use super::umbra::Umbra;
use alloc::vec::Vec;
use visibility_core::bits::Bits;

/// Box on the plan with heights: least, then greatest values of the two coordinates and the height.
pub(crate) type PlanBox = [[f64; 3]; 2];

/// Moves the umbrae that together hide the most of `boxes` to the front, and drops the others. Each umbra is
/// the one that hides the most boxes not hidden by the umbrae before it. Keeps at most `most` umbrae, and
/// none that hides no further box.
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
        // Of several umbrae with the same value, the first wins. It has the nearest line of the largest seed.
        let (index, most) = (chosen..umbrae.len())
            .map(|index| (index, hides[index].count_without(&hidden)))
            .fold((chosen, 0), |best, next| if next.1 > best.1 { next } else { best });
        if most == 0 {
            break;
        }
        hidden.unite(&hides[index]);
        // A rotation keeps the order of the others.
        umbrae[chosen..=index].rotate_right(1);
        hides[chosen..=index].rotate_right(1);
        chosen += 1;
    }
    umbrae.truncate(chosen);
}
