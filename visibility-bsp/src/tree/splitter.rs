//! Which plane to divide by: one that cuts few polygons and leaves about as many on either side, estimated on
//! a sample.

use super::builder::{Piece, Source};
use visibility_core::{
    geometry::{Plane, PolygonSide, SidePlane},
    glam::DVec3,
};

/// Sets larger than this are first divided by planes across an axis, between objects rather than through
/// them.
const BOXES: usize = 12;
/// Pieces that a candidate is judged by.
const SAMPLE: usize = 96;
/// Candidates among the planes of polygons.
const CANDIDATES: usize = 10;
/// Candidates on each axis.
const PLANES: usize = 12;
/// What a cut costs, in pieces out of balance.
const CUT: f32 = 6.0;

/// Every so-many-th of a set, so that a sample of it is spread over all of it.
fn sample(len: usize, most: usize) -> impl Iterator<Item = usize> + Clone {
    let count = len.min(most);
    (0..count).map(move |i| i * len / count)
}

/// A plane across an axis, along sides of the boxes of pieces; `None` where there are few, or all such planes
/// cut too many.
pub(super) fn box_plane(set: &[Piece]) -> Option<Plane> {
    if set.len() <= BOXES {
        return None;
    }
    let mut best = (f32::INFINITY, 0, 0.0f32);
    for candidate in sample(set.len(), PLANES) {
        let bounds = &set[candidate].bounds;
        for axis in 0..3 {
            for at in [bounds.min[axis], bounds.max[axis]] {
                let (mut front, mut back, mut across) = (0u32, 0u32, 0u32);
                for i in sample(set.len(), SAMPLE) {
                    let (min, max) = (set[i].bounds.min[axis], set[i].bounds.max[axis]);
                    // Boxes are rounded outwards by a step; what only touches is not across.
                    let (is_front, is_back) =
                        (min.next_up() >= at.next_down(), max.next_down() <= at.next_up());
                    front += u32::from(is_front);
                    back += u32::from(is_back && !is_front);
                    across += u32::from(!is_front && !is_back);
                }
                let cost = across as f32 * CUT + front.abs_diff(back) as f32;
                if front > 0 && back > 0 && cost < best.0 {
                    best = (cost, axis, at);
                }
            }
        }
    }
    let (cost, axis, at) = best;
    (cost < set.len().min(SAMPLE) as f32).then(|| Plane::new(DVec3::AXES[axis], -f64::from(at)))
}

/// The piece whose plane divides best.
pub(super) fn polygon<'a>(
    set: &[Piece],
    sources: &[Source],
    vertices: impl Fn(&Piece) -> &'a [DVec3],
    magnitude: DVec3,
) -> usize {
    let mut best = (f32::INFINITY, 0);
    if set.len() == 1 {
        return 0;
    }
    for candidate in sample(set.len(), CANDIDATES) {
        let plane = SidePlane::new(sources[set[candidate].source as usize].plane, magnitude);
        let (mut front, mut back, mut across) = (0u32, 0u32, 0u32);
        for i in sample(set.len(), SAMPLE) {
            match plane.side_of_polygon(vertices(&set[i])) {
                PolygonSide::Front => front += 1,
                PolygonSide::Back => back += 1,
                PolygonSide::Across => across += 1,
                PolygonSide::On => {}
            }
            if across as f32 * CUT > best.0 {
                break;
            }
        }
        let cost = across as f32 * CUT + front.abs_diff(back) as f32;
        if cost < best.0 {
            best = (cost, candidate);
        }
    }
    best.1
}
