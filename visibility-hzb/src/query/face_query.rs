//! Tests whether drawn occluders hide a box, by bounds on the box's depth from the planes of its faces: tile
//! by tile, then row by row, then pixel by pixel.

use super::box_face_planes::{BoxFacePlanes, FacePlaneSetup};
use crate::buffer::tile_layout::{Rectangle, SIDE, mask};
use crate::buffer::tiles::Tiles;
use crate::rounding::up;

/// Maximum number of tiles that a tested box may meet. Larger boxes are not tested by their faces: most are
/// nodes of a hierarchy, whose children are tested anyway.
const MAX_FACE_TEST_TILES: u32 = 64;

/// Returns whether the tiles hide a box in every pixel of `rectangle`, the rectangle around the box. `sides`
/// are the box's least x, y, z and greatest x, y, z in scene coordinates. `nearest` is an upper bound on the
/// box's depth keys (greater is nearer). The caller guarantees that the whole box is in front of the eye.
/// False for parallel views, and for boxes that meet more than [`MAX_FACE_TEST_TILES`] tiles.
#[inline(always)]
pub(crate) fn faces_hide(
    faces: &FacePlaneSetup,
    tiles: &Tiles,
    rectangle: &Rectangle,
    sides: [f32; 6],
    nearest: f32,
) -> bool {
    const STEP: u32 = SIDE as u32;
    let ([x0, x1], [y0, y1]) = (rectangle.columns, rectangle.lines);
    let (across, down) = ((x1 - 1) / STEP + 1 - x0 / STEP, (y1 - 1) / STEP + 1 - y0 / STEP);
    if !(faces.scale > 0.0) || across * down > MAX_FACE_TEST_TILES {
        return false;
    }
    let planes = &faces.of_box(sides);
    let sees = |tile: usize, pixel: u64, [x, y]: [u32; 2]| {
        undecided(planes, tiles, tile, pixel, [x, x + 1, y, y + 1], nearest) != 0
    };
    // In each tile, the pixel nearest to the middle of the box is tested first: it decides most visible
    // boxes.
    let middle = [(x0 + x1) / 2, (y0 + y1) / 2];
    for row in y0 / STEP..y0 / STEP + down {
        for column in x0 / STEP..x0 / STEP + across {
            let tile = row as usize * tiles.columns + column as usize;
            let pixels = mask(rectangle, column as usize, row as usize);
            if tiles.hides(tile, pixels, nearest) {
                continue;
            }
            let (left, top) = (x0.max(column * STEP), y0.max(row * STEP));
            let (right, bottom) = (x1.min((column + 1) * STEP), y1.min((row + 1) * STEP));
            // First the whole tile, then each row of the undecided pixels, then each undecided pixel of the
            // row.
            let pixels = undecided(planes, tiles, tile, pixels, [left, right, top, bottom], nearest);
            let (x, y) = (middle[0].clamp(left, right - 1), middle[1].clamp(top, bottom - 1));
            let pixel = pixels & 1 << (y % STEP * STEP + x % STEP);
            if pixel != 0 && sees(tile, pixel, [x, y]) {
                return false;
            }
            let mut rest = pixels & !pixel;
            while rest != 0 {
                let line = rest.trailing_zeros() / STEP;
                let own = rest & 0xff << (line * STEP);
                rest &= !own;
                let (y, end) = (row * STEP + line, row * STEP + line + 1);
                let mut own = undecided(planes, tiles, tile, own, [left, right, y, end], nearest);
                while own != 0 {
                    let x = column * STEP + own.trailing_zeros() % STEP;
                    let pixel = own & own.wrapping_neg();
                    own &= own - 1;
                    if sees(tile, pixel, [x, y]) {
                        return false;
                    }
                }
            }
        }
    }
    true
}

/// Returns the subset of the mask `pixels` in which a box may be and is not certainly hidden. `tile` is the
/// index of the tile, row by row, and bit `8 * y + x` stands for the pixel at column `x` and row `y` of the
/// tile. All of `pixels` must lie within `sides` (first column, end column, first row, end row in pixels of
/// the buffer). `nearest` is an upper bound on the box's depth keys.
#[inline(always)]
fn undecided(
    box_planes: &BoxFacePlanes,
    tiles: &Tiles,
    tile: usize,
    pixels: u64,
    sides: [u32; 4],
    nearest: f32,
) -> u64 {
    let sides = sides.map(f64::from);
    let [most, least] = box_planes.range(sides);
    let nearest = f64::from(nearest);
    let most = if most < nearest { most } else { nearest };
    // Points in view have no depth key below 0 in perspective views.
    let least = if least > 0.0 { least } else { 0.0 };
    let most = up(most);
    if f64::from(most) < least {
        return 0;
    }
    tiles.undecided(tile, pixels, sides, most, box_planes)
}
