//! Whether an occluder may still be seen, by the box around it. Hidden occluders need not be drawn.

use super::box_projection::{ProjectedBoxes, ScreenProjection32, project};
use crate::buffer::pyramid::Pyramid;
use crate::buffer::tile_layout::{Rectangle, SIDE, mask as mask_of};
use crate::buffer::tiles::Tiles;
use crate::lanes::{WIDTH, any_below};

/// Whether box `i` may be in view, wider than a pixel, and not hidden by what has been drawn. An occluder
/// within a box that is not covers no pixel, or changes none.
#[inline(always)]
pub(crate) fn may_be_seen<const N: usize>(tiles: &Tiles, seen: &ProjectedBoxes<N>, i: usize) -> bool {
    let i = i % N;
    let rectangle = seen.rectangle(i);
    // A shape no wider than a pixel, rounded outwards, covers no pixel entirely.
    let small =
        rectangle.columns[1] - rectangle.columns[0] <= 1 || rectangle.lines[1] - rectangle.lines[0] <= 1;
    !seen.outside[i]
        && (!seen.known[i] || (!small && rectangle_may_be_seen(tiles, &rectangle, seen.nearest[i])))
}

/// A bit for each of the first `count` boxes that is neither outside the picture nor hidden by up to four
/// texels of the pyramid. The pyramid may be older than the tiles: what it hides is hidden.
#[inline(always)]
pub(crate) fn boxes_not_hidden(
    pyramid: &Pyramid,
    tiles: &Tiles,
    boxes: &ProjectedBoxes<WIDTH>,
    count: usize,
) -> u32 {
    let mut seen = 0;
    for i in 0..count.min(WIDTH) {
        let hidden = pyramid.hides_coarsely(tiles, &boxes.rectangle(i), boxes.nearest[i]);
        seen |= u32::from(!boxes.outside[i] & !(boxes.known[i] & hidden)) << i;
    }
    seen
}

/// As [`may_be_seen`], for a box that is not projected yet: least x, y, z and greatest x, y, z in scene
/// coordinates.
#[inline(always)]
pub(crate) fn box_may_be_seen(projection: &ScreenProjection32, tiles: &Tiles, sides: [f32; 6]) -> bool {
    let mut boxes = [[0.0; 1]; 6];
    for i in 0..6 {
        boxes[i][0] = sides[i];
    }
    may_be_seen(tiles, &project(projection, &boxes), 0)
}

/// Whether something of the given depth key could be in front of what has been drawn, in any pixel of a
/// rectangle. Equal keys count as in front.
#[inline(always)]
pub(crate) fn rectangle_may_be_seen(tiles: &Tiles, rectangle: &Rectangle, depth_key: f32) -> bool {
    let [x0, x1] = [rectangle.columns[0] as usize / SIDE, (rectangle.columns[1] as usize).div_ceil(SIDE)];
    let [y0, y1] = [rectangle.lines[0] as usize / SIDE, (rectangle.lines[1] as usize).div_ceil(SIDE)];
    let x1 = x1.min(tiles.columns);
    // Plain loops: a closure handed to an iterator is compiled apart, for the narrowest instructions.
    for y in y0..y1.min(tiles.rows) {
        let base = y * tiles.columns;
        if any_below(&tiles.tile_min[base + x0..base + x1], depth_key) {
            for x in x0..x1 {
                if tiles.tile_min[base + x] <= depth_key
                    && !tiles.hides(base + x, mask_of(rectangle, x, y), depth_key)
                {
                    return true;
                }
            }
        }
    }
    false
}
