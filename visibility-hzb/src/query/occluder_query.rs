//! Tests whether an occluder may cover pixels that nearer occluders do not cover yet, by the box around the
//! occluder. Hidden occluders need not be drawn.

use super::box_projection::{ProjectedBoxes, ScreenProjection32, project};
use crate::buffer::pyramid::Pyramid;
use crate::buffer::tile_layout::{Rectangle, SIDE, mask as mask_of};
use crate::buffer::tiles::Tiles;
use crate::lanes::{WIDTH, any_below};

/// Returns whether box `i` of the projected boxes `seen` may be in view, wider and higher than a pixel, and
/// not hidden by drawn occluders. True if undecided. If false, an occluder within the box need not be drawn:
/// it would cover no pixel, or only pixels that hold occluders at least as near.
#[inline(always)]
pub(crate) fn may_be_seen<const N: usize>(tiles: &Tiles, seen: &ProjectedBoxes<N>, i: usize) -> bool {
    let i = i % N;
    let rectangle = seen.rectangle(i);
    !seen.outside[i]
        && (!seen.known[i]
            || (!rectangle.is_thin() && rectangle_may_be_seen(tiles, &rectangle, seen.nearest[i])))
}

/// Returns the mask of the boxes, among the first `count`, that are neither certainly out of view nor hidden
/// by up to four texels of the pyramid. Bit i stands for box i. Undecided boxes are set. The pyramid may be
/// older than the tiles, which is conservative.
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

/// Returns whether a box, given by its least x, y, z and greatest x, y, z in scene coordinates, may be in
/// view, wider and higher than a pixel, and not hidden by drawn occluders. True if undecided.
#[inline(always)]
pub(crate) fn box_may_be_seen(projection: &ScreenProjection32, tiles: &Tiles, sides: [f32; 6]) -> bool {
    let mut boxes = [[0.0; 1]; 6];
    for i in 0..6 {
        boxes[i][0] = sides[i];
    }
    may_be_seen(tiles, &project(projection, &boxes), 0)
}

/// Returns whether a point with the depth key `depth_key` (greater is nearer) may be nearer than the drawn
/// occluders in some pixel of a rectangle. If false, all pixels of the rectangle hold at least this key.
#[inline(always)]
pub(crate) fn rectangle_may_be_seen(tiles: &Tiles, rectangle: &Rectangle, depth_key: f32) -> bool {
    let [x0, x1] = [rectangle.columns[0] as usize / SIDE, (rectangle.columns[1] as usize).div_ceil(SIDE)];
    let [y0, y1] = [rectangle.lines[0] as usize / SIDE, (rectangle.lines[1] as usize).div_ceil(SIDE)];
    let x1 = x1.min(tiles.columns);
    // Plain loops, since closures passed to iterators would be compiled for the baseline instruction set.
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
