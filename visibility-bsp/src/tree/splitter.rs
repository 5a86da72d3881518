//! Choice of splitting planes: planes that cut few polygons and leave about equal numbers on both sides,
//! estimated on a sample.

use super::build_scratch::{Piece, Source};
use visibility_core::{
    Aabb,
    geometry::{Plane, PolygonSide, SidePlane},
    glam::DVec3,
};

/// Number of pieces above which a set is first split by axis-aligned planes between objects, rather than by
/// planes of polygons.
const BOXES: usize = 12;
/// Maximum number of pieces, of the set to be split, on which the cost of each possible splitting plane is
/// evaluated.
const SAMPLE: usize = 96;
/// Maximum number of polygons whose planes are compared as splitting planes of one set of pieces.
const CANDIDATES: usize = 10;
/// Maximum number of pieces, the sides of whose bounding boxes are compared as axis-aligned splitting planes.
const PLANES: usize = 12;
/// Cost of cutting one piece, in units of one piece of imbalance between the two sides.
const CUT: f32 = 6.0;

/// Returns up to `most` indices below `len` in ascending order, evenly spread over the whole range.
fn sample(len: usize, most: usize) -> impl Iterator<Item = usize> + Clone {
    let count = len.min(most);
    (0..count).map(move |i| i * len / count)
}

/// Returns the best axis-aligned splitting plane along a side of a piece's bounding box. `None` if there are
/// at most [`BOXES`] pieces, or if the best candidate costs as much as leaving all sampled pieces on one
/// side.
pub(super) fn box_plane(set: &[Piece]) -> Option<Plane> {
    if set.len() <= BOXES {
        return None;
    }
    let mut best = (f32::INFINITY, 0, 0.0f32);
    for candidate in sample(set.len(), PLANES) {
        for axis in 0..3 {
            let Aabb { min, max } = set[candidate].bounds;
            for at in [min[axis], max[axis]] {
                let (mut front, mut back, mut across) = (0u32, 0u32, 0u32);
                for i in sample(set.len(), SAMPLE) {
                    // A box that only touches the plane is not cut.
                    let Aabb { min, max } = set[i].bounds;
                    let (is_front, is_back) = (min[axis] >= at, max[axis] <= at);
                    front += u32::from(is_front);
                    back += u32::from(is_back && !is_front);
                    across += u32::from(!is_front && !is_back);
                }
                // A plane with all pieces on one side costs as much as their number.
                let cost = across as f32 * CUT + front.abs_diff(back) as f32;
                if cost < best.0 {
                    best = (cost, axis, at);
                }
            }
        }
    }
    let (cost, axis, at) = best;
    (cost < set.len().min(SAMPLE) as f32).then(|| Plane::new(DVec3::AXES[axis], -f64::from(at)))
}

/// Returns the index in `set` of the piece whose own plane is the cheapest split among the sampled
/// candidates. `vertices` returns a piece's vertices; `magnitude` bounds the absolute coordinates on each
/// axis. `set` must not be empty.
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
