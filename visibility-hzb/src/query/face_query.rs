//! Whether a box is hidden, by the planes of its faces, tile by tile and pixel by pixel.

use super::box_face_planes::{BoxFacePlanes, FacePlaneSetup};
use crate::buffer::tile_layout::{Rectangle, SIDE, mask};
use crate::buffer::tiles::Tiles;
use crate::rounding::up;

/// Boxes that lie in more tiles than this are not looked at: they mostly hold others, which are.
const MOST: u32 = 64;

/// Whether all of a box within a rectangle around it is behind what the tiles hold. `nearest` is a depth key that no point of it exceeds; it
/// is before the eye as a whole.
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
    if !(faces.scale > 0.0) || across * down > MOST {
        return false;
    }
    let look = FaceQuery { box_planes: &faces.of_box(sides), tiles, nearest };
    // The pixel nearest to the middle of the box is looked at first, everywhere: it finds out most of those that are seen.
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
            // The tile, then what is left of each line, then each pixel of that.
            let pixels = undecided(look.box_planes, tiles, tile, pixels, [left, right, top, bottom], nearest);
            let (x, y) = (middle[0].clamp(left, right - 1), middle[1].clamp(top, bottom - 1));
            let pixel = pixels & 1 << (y % STEP * STEP + x % STEP);
            if pixel != 0 && look.sees(tile, pixel, [x, y]) {
                return false;
            }
            let mut rest = pixels & !pixel;
            while rest != 0 {
                let line = rest.trailing_zeros() / STEP;
                let own = rest & 0xff << (line * STEP);
                rest &= !own;
                let (y, end) = (row * STEP + line, row * STEP + line + 1);
                let mut own = undecided(look.box_planes, tiles, tile, own, [left, right, y, end], nearest);
                while own != 0 {
                    let x = column * STEP + own.trailing_zeros() % STEP;
                    let pixel = own & own.wrapping_neg();
                    own &= own - 1;
                    if look.sees(tile, pixel, [x, y]) {
                        return false;
                    }
                }
            }
        }
    }
    true
}

/// A box that is looked for in pixels.
struct FaceQuery<'a> {
    box_planes: &'a BoxFacePlanes,
    tiles: &'a Tiles,
    /// Depth keys that no point of it exceeds.
    nearest: f32,
}

impl FaceQuery<'_> {
    /// Whether it may be seen in a pixel, given by its bit in a tile and its place.
    #[inline(always)]
    fn sees(&self, tile: usize, pixel: u64, [x, y]: [u32; 2]) -> bool {
        undecided(self.box_planes, self.tiles, tile, pixel, [x, x + 1, y, y + 1], self.nearest) != 0
    }
}

/// In which of some pixels, those within the given sides, the box may be and is not hidden.
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
    // Nothing in view has less than none.
    let least = if least > 0.0 { least } else { 0.0 };
    let most = up(most);
    if f64::from(most) < least {
        return 0;
    }
    tiles.undecided(tile, pixels, sides, most, box_planes)
}
