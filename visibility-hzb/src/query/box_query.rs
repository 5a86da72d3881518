//! Boxes tested against the buffer, 64 at a time.
//!
//! A box is hidden if it is outside the picture, or if every pixel that it can meet holds a strictly greater
//! depth key than the box can have there. Three tests decide that, each tighter and slower than the one
//! before: up to four texels of the pyramid, all pixels of the rectangle around the box, and the planes of
//! the box's faces.

use super::BoxQuery;
use super::box_projection::{ProjectedBoxes, project};
use super::face_query::FaceTest;
use crate::lanes::{WIDTH, bits};
use visibility_core::occlusion::Occlusion64;
use visibility_core::scene::FAN_OUT;

/// Least x, y, z and greatest x, y, z of 64 boxes, in scene coordinates (metres relative to the scene's
/// origin).
pub(crate) type Boxes = [[f32; FAN_OUT]; 6];

/// Tests the boxes whose bit is set in `candidates`. Bit i stands for box i. Other boxes are in neither mask
/// of the result. A box in neither mask is undecided and counts as partly visible. Improper boxes (NaN, or a
/// least coordinate above the greatest) are visible.
#[inline(always)]
pub(crate) fn test_boxes(query: &BoxQuery, boxes: &Boxes, candidates: u64) -> Occlusion64 {
    let mut answer = Occlusion64::default();
    for chunk in 0..FAN_OUT / WIDTH {
        let lanes = candidates >> (chunk * WIDTH) & ((1 << WIDTH) - 1);
        if lanes == 0 {
            continue;
        }
        let mut part = [[0.0; WIDTH]; 6];
        for row in 0..6 {
            part[row] = boxes[row].as_chunks::<WIDTH>().0[chunk];
        }
        let (hidden, visible) = decide(query, &project(query.projection, &part), lanes, &part);
        answer.hidden |= hidden << (chunk * WIDTH);
        answer.visible |= visible << (chunk * WIDTH);
    }
    answer
}

/// Tests one box, given by its least x, y, z and greatest x, y, z in scene coordinates. Bit 0 of the result's
/// masks tells whether the box is hidden, or visible because no occluder in the buffer can hide any part of
/// it. 0 in both masks means undecided.
#[inline(always)]
pub(crate) fn test_box(query: &BoxQuery, sides: [f32; 6]) -> Occlusion64 {
    let part = sides.map(|side| [side]);
    let projected = project(query.projection, &part);
    let (hidden, visible) = decide(query, &projected, 1, &part);
    Occlusion64 { hidden, visible }
}

/// Packs `N` booleans, at most [`WIDTH`], into a mask: bit i is set if `lanes[i]` is true.
#[inline(always)]
fn gather<const N: usize>(lanes: &[bool; N]) -> u64 {
    let mut bytes = [0; WIDTH];
    for i in 0..N.min(WIDTH) {
        bytes[i] = u8::from(lanes[i]);
    }
    bits(&bytes).into()
}

/// Tests the boxes whose bit is set in `lanes` (bit i for box i). `boxes` holds their least x, y, z and
/// greatest x, y, z in scene coordinates, `projected` their screen bounds. Returns the mask of hidden boxes
/// and the mask of visible boxes: those that no occluder in the buffer can hide any part of, and improper
/// (NaN or inverted) ones. A bit in neither mask means undecided.
#[inline(always)]
fn decide<const N: usize>(
    query: &BoxQuery,
    projected: &ProjectedBoxes<N>,
    lanes: u64,
    boxes: &[[f32; N]; 6],
) -> (u64, u64) {
    // The comparisons are false for NaN, so a NaN box is neither proper nor behind.
    let (mut proper, mut behind, mut before) = ([false; N], [false; N], [false; N]);
    for i in 0..N {
        proper[i] =
            (boxes[0][i] <= boxes[3][i]) & (boxes[1][i] <= boxes[4][i]) & (boxes[2][i] <= boxes[5][i]);
        behind[i] = projected.nearest[i] < query.nearest;
        before[i] = projected.farthest[i] >= query.nearest;
    }
    let proper = gather(&proper);
    let outside = gather(&projected.outside) & proper & lanes;
    let visible = (gather(&projected.inside) & gather(&before) | !proper) & lanes & !outside;
    let mut hidden = outside;
    let rest = lanes & !outside & !visible & gather(&projected.known) & gather(&behind);
    // Most boxes are hidden by the first test, so it is made for all boxes, without branches, before any
    // second test.
    let mut left = rest;
    while left != 0 {
        let i = left.trailing_zeros() as usize % N;
        left &= left - 1;
        let nearest = projected.nearest[i];
        let coarsely = query.pyramid.hides_coarsely(query.tiles, &projected.rectangle(i), nearest);
        hidden |= u64::from(coarsely) << i;
    }
    let sides_of = |i: usize| boxes.each_ref().map(|side| side[i]);
    let mut left = rest & !hidden;
    while left != 0 {
        let i = left.trailing_zeros() as usize % N;
        left &= left - 1;
        let (rectangle, nearest) = (projected.rectangle(i), projected.nearest[i]);
        // The pixel in the middle decides most visible boxes: if it is no nearer than the farthest point of
        // the box, no test can hide the box there.
        let behind = query.tiles.pixel_around(&rectangle);
        if !(behind > projected.farthest[i]) {
            continue;
        }
        if behind > nearest && query.pyramid.hides(query.tiles, &rectangle, nearest)
            || FaceTest::new(query, rectangle, sides_of(i), nearest).is_some_and(|test| test.is_hidden())
        {
            hidden |= 1 << i;
        }
    }
    // Boxes that reach the plane of the eye, such as a wall beside a corridor or objects behind that wall.
    let mut left = lanes & !outside & !visible & !gather(&projected.known);
    while left != 0 {
        let i = left.trailing_zeros() as usize % N;
        left &= left - 1;
        let test = FaceTest::at_eye(query, sides_of(i));
        hidden |= u64::from(test.is_some_and(|test| test.is_hidden())) << i;
    }
    (hidden, visible)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::buffer::{pyramid::Pyramid, tiles::Tiles};
    use crate::query::box_face_planes::FacePlaneSetup;
    use crate::query::box_projection::ScreenProjection32;
    use crate::setup::screen_projection::ScreenProjection;
    use visibility_core::glam::DVec3;
    use visibility_core::{Pose, View};

    /// Boxes of no thickness are proper: those outside of the picture are hidden, as are those behind covered
    /// tiles. Boxes whose least coordinate is above the greatest are visible.
    #[test]
    fn flat_boxes_are_proper() {
        let size = [64, 64];
        let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 100.0);
        let projection = ScreenProjection::new(&view.unwrap(), DVec3::ZERO, size, size);
        let (faces, projection) = (FacePlaneSetup::new(&projection), ScreenProjection32::new(&projection));
        let mut tiles = Tiles::new(size[0], size[1]);
        (0..64).for_each(|tile| tiles.cover_tile(tile / 8, tile % 8, 1.0, 0));
        let mut pyramid = Pyramid::new(&tiles);
        pyramid.update(&mut tiles);
        let query = BoxQuery {
            projection: &projection,
            tiles: &tiles,
            pyramid: &pyramid,
            faces: &faces,
            nearest: 1.0,
        };
        for aside in [0.0, 50.0] {
            for axis in 0..3 {
                let mut sides = [10.0, aside - 1.0, -1.0, 11.0, aside + 1.0, 1.0];
                sides[axis + 3] = sides[axis];
                let answer = test_box(&query, sides);
                assert_eq!((answer.hidden, answer.visible), (1, 0), "flat along axis {axis}: {sides:?}");
                sides[axis + 3] -= 0.5;
                let answer = test_box(&query, sides);
                assert_eq!((answer.hidden, answer.visible), (0, 1), "inverted along axis {axis}: {sides:?}");
            }
        }
    }
}
