//! Boxes looked at more closely where the rectangle around them does not decide: by the planes of their faces.
//!
//! The rectangle claims too much twice: its corners lie beside the box, and all of it is taken to be as near as the nearest corner. But a
//! box is six half-spaces, and each bounds the nearness `1 / w` of its points by a function that is linear on the screen (Kay and Kajiya,
//! "Ray Tracing Complex Scenes", 1986, cut rays by slabs in this way): those with the eye outside from above, those with the eye inside
//! from below. Where the least upper bound is below the greatest lower bound, no line of sight meets the box; elsewhere the upper bound is all
//! that it may be near. What is known to cover a tile by the plane of a surface is compared with each upper bound as a difference of two linear
//! functions, so that a floor seen at a grazing angle hides what lies below it throughout.
//!
//! # The error bound
//! A point `q`, relative to the anchor, is at `w s = M q + e` with `s = (x, y, 1)`, where `e` is at most a row's constant and its error. With
//! the adjugate `C` of `M` and its determinant `D`, `w (C s) = D q + C e`. Entries of `M` are off by `3u` of themselves, so those of `C`, two
//! products each, by less than `16u` of the sum `P` of the magnitudes of these, and `D` by less than `32u` of the sum of magnitudes of its six
//! products. So on `q = t`, nearness is `(C s) / (D t)`, where the numerator is off by less than `64u` of `P s`, taken at the picture's far corner,
//! scaling, evaluation and all, and the denominator by less than `2 P e` and `64u` of `t` times the six products, where half would do but for its own
//! rounding and that of `t`. Half-spaces whose denominator is not twice as large as that are left out, which only makes the box larger.

use crate::lens::{Lens, U};
use crate::pyramid::{Rectangle, mask};
use crate::shape::up;
use crate::tiles::{SIDE, Tiles};

/// Boxes that lie in more tiles than this are not looked at: they mostly hold others, which are.
const MOST: u32 = 64;

/// The sides of a box, greatest first, and two that are none: so many lanes that the compiler keeps them together.
pub(crate) const LANES: usize = 8;

/// Which way is out.
const SIGNS: [f64; LANES] = [1.0, 1.0, 1.0, -1.0, -1.0, -1.0, 0.0, 0.0];

/// What all boxes of a frame have in common, by side.
#[derive(Clone, Debug, Default)]
pub(crate) struct Faces {
    anchor: [f64; LANES],
    /// What times `x`, `y` and 1 is the way a line of sight goes in.
    along: [[f64; LANES]; 3],
    /// How far that may be off.
    error: [f64; LANES],
    /// The determinant, made positive; zero if nothing can be said.
    scale: f64,
    /// By how much denominators may be off: by axis, and by distance.
    shift: [f64; LANES],
    spread: f64,
}

/// The bounds of one box on nearness, linear on the screen: those from above, and those from below with the opposite sign.
pub(crate) struct Slabs {
    slope: [[f64; LANES]; 2],
    constant: [f64; LANES],
    /// Zero for a bound of this kind, infinite for others.
    upper: [f64; LANES],
    lower: [f64; LANES],
}

/// The least of all lanes, found in halves.
#[inline(always)]
fn lowest(values: &[f64; LANES]) -> f64 {
    let mut low = [0.0; LANES / 2];
    for i in 0..LANES / 2 {
        let (a, b) = (values[i], values[i + LANES / 2]);
        low[i] = if a < b { a } else { b };
    }
    let a = if low[0] < low[2] { low[0] } else { low[2] };
    let b = if low[1] < low[3] { low[1] } else { low[3] };
    if a < b { a } else { b }
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
        let mut faces = Self::default();
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
        for lane in 0..6 {
            let axis = lane % 3;
            faces.anchor[lane] = lens.anchor[axis];
            for (i, row) in [x, y, w].iter().enumerate() {
                let (value, size) = (columns[i].0[axis], columns[i].1[axis]);
                faces.along[i][lane] = -SIGNS[lane] * sign * value;
                faces.error[lane] += 64.0 * U * size * reach[i];
                faces.shift[lane] += 2.0 * size * (row.constant.abs() + row.error);
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
    fn slabs(&self, [x0, y0, z0, x1, y1, z1]: [f32; 6]) -> Slabs {
        let sides = [x1, y1, z1, x0, y0, z0, 0.0, 0.0];
        const NONE: [f64; LANES] = [f64::INFINITY; LANES];
        let mut slabs = Slabs { slope: [[0.0; LANES]; 2], constant: [0.0; LANES], upper: NONE, lower: NONE };
        for i in 0..LANES {
            let distance = SIGNS[i] * (f64::from(sides[i]) - self.anchor[i]);
            let size = self.scale * distance.abs();
            let off = self.shift[i] + self.spread * distance.abs();
            // Written so that NaN bounds nothing.
            let known = (size > 2.0 * off) & (size < f64::INFINITY);
            let inside = distance > 0.0;
            let over = 1.0 / (size + if inside { off } else { -off });
            let over = if known { over } else { 0.0 };
            slabs.slope[0][i] = self.along[0][i] * over;
            slabs.slope[1][i] = self.along[1][i] * over;
            slabs.constant[i] = self.along[2][i] * over + self.error[i] * over;
            slabs.upper[i] = if known & !inside { 0.0 } else { f64::INFINITY };
            slabs.lower[i] = if known & inside { 0.0 } else { f64::INFINITY };
        }
        slabs
    }

    /// Whether all of a box within a rectangle around it is behind what the tiles hold. `nearest` is a nearness that no point of it exceeds; it
    /// is before the eye as a whole.
    #[inline(always)]
    pub(crate) fn hides(&self, tiles: &Tiles, rectangle: &Rectangle, sides: [f32; 6], nearest: f32) -> bool {
        const STEP: u32 = SIDE as u32;
        let ([x0, x1], [y0, y1]) = (rectangle.columns, rectangle.lines);
        let (across, down) = ((x1 - 1) / STEP + 1 - x0 / STEP, (y1 - 1) / STEP + 1 - y0 / STEP);
        if !(self.scale > 0.0) || across * down > MOST {
            return false;
        }
        let look = Look { slabs: &self.slabs(sides), tiles, nearest };
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
                let pixels = look.slabs.undecided(tiles, tile, pixels, [left, right, top, bottom], nearest);
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
                    let mut own = look.slabs.undecided(tiles, tile, own, [left, right, y, end], nearest);
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
}

/// A box that is looked for in pixels.
struct Look<'a> {
    slabs: &'a Slabs,
    tiles: &'a Tiles,
    /// Nearness that no point of it exceeds.
    nearest: f32,
}

impl Look<'_> {
    /// Whether it may be seen in a pixel, given by its bit in a tile and its place.
    #[inline(always)]
    fn sees(&self, tile: usize, pixel: u64, [x, y]: [u32; 2]) -> bool {
        self.slabs.undecided(self.tiles, tile, pixel, [x, x + 1, y, y + 1], self.nearest) != 0
    }
}

impl Slabs {
    /// Whether some bound from above is below a plane, given by slopes and constant, in all of a rectangle; by side. Both are linear, so their
    /// difference is least at a corner.
    #[inline(always)]
    pub(crate) fn below(&self, [a, b, c]: [f64; 3], [left, right, top, bottom]: [f64; 4]) -> [bool; LANES] {
        let mut below = [false; LANES];
        for i in 0..LANES {
            let (x, y) = (a - self.slope[0][i], b - self.slope[1][i]);
            let least = x * if x > 0.0 { left } else { right } + y * if y > 0.0 { top } else { bottom };
            below[i] = least + (c - self.constant[i]) > self.upper[i];
        }
        below
    }

    /// In which of some pixels, those within the given sides, the box may be and is not hidden.
    #[inline(always)]
    fn undecided(&self, tiles: &Tiles, tile: usize, pixels: u64, sides: [u32; 4], nearest: f32) -> u64 {
        let [left, right, top, bottom] = sides.map(f64::from);
        let (mut above, mut below) = ([0.0; LANES], [0.0; LANES]);
        let [a, b] = &self.slope;
        for i in 0..LANES {
            let x = a[i] * if a[i] > 0.0 { right } else { left };
            let value = x + b[i] * if b[i] > 0.0 { bottom } else { top } + self.constant[i];
            (above[i], below[i]) = (value + self.upper[i], value + self.lower[i]);
        }
        let (most, least) = (lowest(&above), -lowest(&below));
        let nearest = f64::from(nearest);
        let most = if most < nearest { most } else { nearest };
        // Nothing in view has less than none.
        let least = if least > 0.0 { least } else { 0.0 };
        let most = up(most);
        if f64::from(most) < least {
            return 0;
        }
        tiles.undecided(tile, pixels, [left, right, top, bottom], most, self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::random;
    use crate::twice::{on_screen, product, sum};
    use visibility_core::glam::{DMat3, DVec3};
    use visibility_core::{Pose, View};

    /// Points on the faces themselves are on the right side of the bounds, also where the eye is almost in the plane of a face.
    #[test]
    fn bounds_hold_on_the_faces() {
        let mut random = random(5);
        let (mut above, mut below) = (0, 0);
        for trial in 0..20_000 {
            // At the origin all rounding is that of the determinant.
            let far = if trial % 2 == 0 { 0.0 } else { 10f64.powf(random(0.0, 6.0)) };
            let eye = DVec3::from_array([0; 3].map(|_| far * random(-1.0, 1.0)));
            let target = eye + DVec3::from_array([0; 3].map(|_| random(-1.0, 1.0)));
            let pose = Pose::look_at(eye, target, DVec3::Z);
            let view = View::perspective(pose, random(0.3, 2.0), 1.5, 0.01, f64::INFINITY).unwrap();
            // By its matrix alone, the eye is not known so well, the less the farther it is from the origin. And far off the middle of a picture,
            // its determinant is the difference of large products.
            let mut matrix = view.clip_from(DVec3::ZERO);
            let aside = random(0.0, 1.0).powi(9) * 1e7;
            for axis in 0..4 {
                let column = matrix.col_mut(axis);
                column.x += aside * column.w;
            }
            let rows = [0, 1, 3].map(|row| matrix.row(row));
            let inverse =
                DMat3::from_cols_array_2d(&rows.map(|row| row.truncate().to_array())).transpose().inverse();
            let apex = -(inverse * DVec3::from_array(rows.map(|row| row.w)));
            let view = View::from_clip_from_world(matrix, view.depth()).unwrap();
            let lens = Lens::new(&view, DVec3::ZERO, [192, 128], [192, 128]);
            let faces = Faces::new(&lens);
            let mut sides = [0.0f32; 6];
            for axis in 0..3 {
                let near = eye[axis] + random(-1.0, 1.0).powi(9);
                let (a, b) = (near as f32, (near + random(-40.0, 40.0)) as f32);
                (sides[axis], sides[axis + 3]) = (a.min(b), a.max(b));
            }
            let slabs = faces.slabs(sides);
            for lane in 0..6 {
                let axis = lane % 3;
                // A point of the face that shows somewhere in the picture.
                let side = f64::from(if lane < 3 { sides[axis + 3] } else { sides[axis] });
                let (x, y) = (random(-1.0, 1.0), random(-1.0, 1.0));
                let way = inverse * DVec3::new(x, y, 1.0);
                let mut q = (apex + way * ((side - apex[axis]) / way[axis])).to_array();
                q[axis] = side;
                let at = on_screen(rows, q, [192.0, 128.0]);
                let [x, y, w] = at.map(|value| value[0]);
                if !(w > 0.0 && x >= 0.0 && x <= 192.0 * w && y >= 0.0 && y <= 128.0 * w) {
                    continue;
                }
                let factors = [slabs.slope[0][lane], slabs.slope[1][lane], slabs.constant[lane]];
                let value = (0..3).fold([0.0; 2], |all, i| sum(all, product(at[i], factors[i])));
                // Nearness is 1 / w: the bounds times w are compared with 1.
                if slabs.upper[lane] == 0.0 {
                    above += 1;
                    assert!(sum(value, [-1.0, 0.0])[0] >= 0.0, "{lane} {q:?} {sides:?} {value:?}");
                }
                if slabs.lower[lane] == 0.0 {
                    below += 1;
                    assert!(sum(value, [1.0, 0.0])[0] >= 0.0, "{lane} {q:?} {sides:?} {value:?}");
                }
            }
        }
        assert!(above > 2_000 && below > 2_000, "{above} {below}");
    }

    #[test]
    fn a_plane_is_before_a_bound_where_it_is_at_all_corners() {
        let mut slabs = Slabs {
            slope: [[0.0; LANES]; 2],
            constant: [0.5; LANES],
            upper: [0.0; LANES],
            lower: [f64::INFINITY; LANES],
        };
        slabs.slope = [
            [0.25, -0.25, 0.125, -0.125, 0.0, 0.5, -0.5, 0.0],
            [0.125, 0.25, -0.25, -0.5, 0.0, -0.25, 0.5, 0.25],
        ];
        slabs.upper[7] = f64::INFINITY;
        let sides @ [left, right, top, bottom] = [8.0, 13.0, 16.0, 24.0];
        let (mut yes, mut no) = (0, 0);
        for i in 0..625 {
            let [a, b, c] = [i % 5, i / 5 % 5, i / 25].map(|k| f64::from(k) * 0.25 - 0.5);
            let below = slabs.below([a, b, c * 4.0], sides);
            for lane in 0..LANES {
                let at = |x: f64, y: f64| {
                    (a - slabs.slope[0][lane]) * x + (b - slabs.slope[1][lane]) * y + c * 4.0 - 0.5
                };
                let all = [(left, top), (right, top), (left, bottom), (right, bottom)];
                let before = all.iter().all(|&(x, y)| at(x, y) > slabs.upper[lane]);
                assert_eq!(below[lane], before, "{a} {b} {c}, side {lane}");
                *(if before { &mut yes } else { &mut no }) += 1;
            }
        }
        assert!(yes > 500 && no > 500, "{yes} {no}");
    }
}
