//! Boxes looked at more closely where the rectangle around them does not decide: by the planes of their faces.
//!
//! The rectangle claims too much twice: its corners lie beside the box, and all of it is taken to be as near as the nearest corner. But a
//! box is six half-spaces, and each bounds the nearness `1 / w` of its points by a function that is linear on the screen (Kay and Kajiya,
//! "Ray Tracing Complex Scenes", 1986, cut rays by slabs in this way): those with the eye outside from above, those with the eye inside
//! from below. Where the least upper bound is below the greatest lower bound, no line of sight meets the box; elsewhere the upper bound is all
//! that it may be near.
//!
//! # The error bound
//! A point `q`, relative to the anchor, is at `w s = M q + e` with `s = (x, y, 1)`, where `e` is at most a row's constant and its error. With
//! the adjugate `C` of `M` and its determinant `D`, `w (C s) = D q + C e`. Entries of `M` are off by `3u` of themselves, so those of `C`, two
//! products each, by less than `16u` of the sum `P` of the magnitudes of these, and `D` by less than `32u` of the sum of magnitudes of its six
//! products. So on `q = t`, nearness is `(C s) / (D t)`, where the numerator is off by less than `64u` of `P s`, taken at the picture's far corner,
//! scaling, evaluation and all, and the denominator by less than `2 P e`, `64u` of `t` times the six products, and `4u` of itself for its own rounding
//! and that of `t`. Half-spaces whose denominator is not twice as large as that are left out, which only makes the box larger.

use crate::lens::{Lens, U};
use crate::pyramid::{Rectangle, mask};
use crate::shape::up;
use crate::tiles::{SIDE, Tiles};

/// Boxes that lie in more tiles than this are not looked at: they mostly hold others, which are.
const MOST: u32 = 64;

/// What all boxes of a frame have in common.
#[derive(Clone, Debug, Default)]
pub(crate) struct Faces {
    anchor: [f64; 3],
    /// By axis, what times `x`, `y` and 1 is the way a line of sight goes along it.
    along: [[f64; 3]; 3],
    /// How far that may be off.
    error: [f64; 3],
    /// The determinant, made positive; zero if nothing can be said.
    scale: f64,
    /// By how much denominators may be off: by axis, and by distance.
    shift: [f64; 3],
    spread: f64,
}

/// A bound on nearness, linear on the screen.
#[derive(Clone, Copy, Default)]
struct Bound {
    slope: [f64; 2],
    constant: f64,
}

/// The bounds of one box.
struct Slabs {
    upper: [Bound; 3],
    uppers: usize,
    lower: [Bound; 6],
    lowers: usize,
}

fn products(a: [f64; 3], b: [f64; 3]) -> ([f64; 3], [f64; 3]) {
    let (mut cross, mut sizes) = ([0.0; 3], [0.0; 3]);
    for i in 0..3 {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let (p, q) = (a[j] * b[k], a[k] * b[j]);
        (cross[i], sizes[i]) = (p - q, p.abs() + q.abs());
    }
    (cross, sizes)
}

impl Faces {
    pub(crate) fn new(lens: &Lens) -> Self {
        let [x, y, w, _] = lens.rows;
        let mut faces = Self { anchor: lens.anchor.to_array(), ..Self::default() };
        if !lens.perspective {
            return faces;
        }
        // Columns of the adjugate belong to `x`, `y` and 1.
        let columns =
            [products(y.linear, w.linear), products(w.linear, x.linear), products(x.linear, y.linear)];
        let mut determinant = 0.0;
        for i in 0..3 {
            determinant += x.linear[i] * columns[0].0[i];
            faces.spread += 64.0 * U * x.linear[i].abs() * columns[0].1[i];
        }
        let sign = if determinant < 0.0 { -1.0 } else { 1.0 };
        let reach = [lens.size[0], lens.size[1], 1.0];
        for axis in 0..3 {
            for (i, row) in [x, y, w].iter().enumerate() {
                let (value, size) = (columns[i].0[axis], columns[i].1[axis]);
                faces.along[axis][i] = sign * value;
                faces.error[axis] += 64.0 * U * size * reach[i];
                faces.shift[axis] += 2.0 * size * (row.constant.abs() + row.error);
            }
        }
        // NaN stays out as well.
        let sum = determinant.abs() + faces.spread + faces.error.iter().sum::<f64>();
        if determinant.abs() > 0.0 && sum + faces.shift.iter().sum::<f64>() < f64::INFINITY {
            faces.scale = sign * determinant;
        }
        faces
    }

    /// The bounds of a box, given by its least and greatest coordinates.
    #[inline(always)]
    fn slabs(&self, sides: [f32; 6]) -> Slabs {
        let mut slabs =
            Slabs { upper: [Bound::default(); 3], uppers: 0, lower: [Bound::default(); 6], lowers: 0 };
        for axis in 0..3 {
            for (sign, side) in [(1.0, sides[axis + 3]), (-1.0, sides[axis])] {
                let distance = sign * (f64::from(side) - self.anchor[axis]);
                let size = self.scale * distance.abs();
                let off = self.shift[axis] + self.spread * distance.abs() + 4.0 * U * size;
                // Written so that NaN bounds nothing.
                if !(size > 2.0 * off && size < f64::INFINITY) {
                    continue;
                }
                let inside = distance > 0.0;
                let over = 1.0 / if inside { size + off } else { size - off };
                let [a, b, c] = self.along[axis];
                let (factor, error) = (sign * over, self.error[axis] * over);
                if inside {
                    let bound = Bound { slope: [a * factor, b * factor], constant: c * factor - error };
                    slabs.lower[slabs.lowers % 6] = bound;
                    slabs.lowers += 1;
                } else if slabs.uppers < 3 {
                    let bound = Bound { slope: [-a * factor, -b * factor], constant: error - c * factor };
                    slabs.upper[slabs.uppers] = bound;
                    slabs.uppers += 1;
                }
            }
        }
        slabs
    }

    /// Whether all of a box within a rectangle around it is behind what the tiles hold. `nearest` is a nearness that no point of it exceeds; it
    /// is before the eye as a whole.
    #[inline(always)]
    pub(crate) fn hides(
        &self,
        tiles: &Tiles,
        rectangle: &Rectangle,
        sides: [f32; 6],
        nearest: f32,
    ) -> bool {
        const STEP: u32 = SIDE as u32;
        let ([x0, x1], [y0, y1]) = (rectangle.columns, rectangle.lines);
        let (across, down) = ((x1 - 1) / STEP + 1 - x0 / STEP, (y1 - 1) / STEP + 1 - y0 / STEP);
        if !(self.scale > 0.0) || across * down > MOST {
            return false;
        }
        let slabs = self.slabs(sides);
        for row in y0 / STEP..y0 / STEP + down {
            for column in x0 / STEP..x0 / STEP + across {
                let tile = row as usize * tiles.columns + column as usize;
                let pixels = mask(rectangle, column as usize, row as usize);
                if tiles.hides(tile, pixels, nearest) {
                    continue;
                }
                let (left, top) = (x0.max(column * STEP), y0.max(row * STEP));
                let (right, bottom) = (x1.min((column + 1) * STEP), y1.min((row + 1) * STEP));
                if slabs.hidden(tiles, tile, pixels, [left, right, top, bottom], nearest) {
                    continue;
                }
                for line in top..bottom {
                    let own = pixels & 0xff << (line % STEP * STEP);
                    if slabs.hidden(tiles, tile, own, [left, right, line, line + 1], nearest) {
                        continue;
                    }
                    for x in left..right {
                        let pixel = own & 0x0101_0101_0101_0101 << (x % STEP);
                        if !slabs.hidden(tiles, tile, pixel, [x, x + 1, line, line + 1], nearest) {
                            return false;
                        }
                    }
                }
            }
        }
        true
    }
}

impl Slabs {
    /// Whether the part of the box in some pixels, those within the given sides, is hidden or there is none.
    #[inline(always)]
    fn hidden(&self, tiles: &Tiles, tile: usize, pixels: u64, sides: [u32; 4], nearest: f32) -> bool {
        let [left, right, top, bottom] = sides.map(f64::from);
        let (mut most, mut least) = (f64::from(nearest), 0.0);
        for Bound { slope: [a, b], constant } in &self.upper[..self.uppers] {
            let value =
                a * if *a > 0.0 { right } else { left } + b * if *b > 0.0 { bottom } else { top } + constant;
            most = if value < most { value } else { most };
        }
        for Bound { slope: [a, b], constant } in &self.lower[..self.lowers.min(6)] {
            let value =
                a * if *a > 0.0 { left } else { right } + b * if *b > 0.0 { top } else { bottom } + constant;
            least = if value > least { value } else { least };
        }
        let most = up(most);
        f64::from(most) < least
            || tiles.hides(tile, pixels, most)
            || tiles.surface_hides(tile, [left, right, top, bottom], most)
    }
}
