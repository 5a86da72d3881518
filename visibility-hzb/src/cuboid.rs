//! Boxes, the commonest occluders, made into shapes in straight lines of arithmetic.
//!
//! From any point outside a box, at most three faces are seen, and which they are determines the outline (Schmalstieg and Tobler, "Fast
//! Projected Area Computation for Three-Dimensional Bounding Boxes", 1999). The outlines are in a table, made when the crate is compiled.

use crate::lens::{Lens, Placed};
use crate::shape::{Coverage, Extent, Shape, Whole};
use visibility_core::Aabb;

/// The corners of the faces at least x, greatest x, least y and so on, counter-clockwise from outside; corners are numbered by the bits
/// x, y, z.
const FACES: [[u8; 4]; 6] =
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// The directed edges between a seen and an unseen face.
#[derive(Clone, Copy)]
struct Outline {
    edges: [[u8; 2]; 6],
    count: u8,
}

/// By the set of faces that are seen, a bit each.
static OUTLINES: [Outline; 64] = outlines();

const fn outlines() -> [Outline; 64] {
    let mut all = [Outline { edges: [[0; 2]; 6], count: 0 }; 64];
    let mut seen = 0;
    while seen < 64 {
        let mut face = 0;
        let opposites = seen & (seen >> 1) & 0b010101 != 0;
        while face < 6 && !opposites {
            let mut i = 0;
            while i < 4 && seen >> face & 1 != 0 {
                let (a, b) = (FACES[face][i], FACES[face][(i + 1) % 4]);
                if !has_edge(seen, b, a) {
                    let outline = &mut all[seen];
                    outline.edges[outline.count as usize] = [a, b];
                    outline.count += 1;
                }
                i += 1;
            }
            face += 1;
        }
        seen += 1;
    }
    all
}

const fn has_edge(seen: usize, a: u8, b: u8) -> bool {
    let mut face = 0;
    while face < 6 {
        let mut i = 0;
        while i < 4 && seen >> face & 1 != 0 {
            if FACES[face][i] == a && FACES[face][(i + 1) % 4] == b {
                return true;
            }
            i += 1;
        }
        face += 1;
    }
    false
}

/// What became of an occluder.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Made {
    /// The shape is to be filled.
    Shape,
    /// Nothing of it can be seen, or nothing can be said for certain.
    Nothing,
    /// It is too near for this way.
    Near,
}

#[inline(always)]
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The extent on the screen of points before the eye: least and greatest column, least and greatest row, least and greatest nearness,
/// each moved
/// outwards. `None` for points too near.
#[inline(always)]
pub(crate) fn extent<const N: usize>(
    x: &[f64; N],
    y: &[f64; N],
    w: &[f64; N],
    n: &[f64; N],
    placed: &Placed,
) -> Option<[f64; 6]> {
    let mut least_w = f64::INFINITY;
    for i in 0..N {
        least_w = if w[i] < least_w { w[i] } else { least_w };
    }
    // Below this the relative error of w would no longer be small.
    if !(least_w > 1024.0 * placed.error[2]) {
        return None;
    }
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for i in 0..N {
        let over = 1.0 / w[i];
        for (axis, value) in [x[i] * over, y[i] * over, n[i] * over].into_iter().enumerate() {
            low[axis] = if value < low[axis] { value } else { low[axis] };
            high[axis] = if value > high[axis] { value } else { high[axis] };
        }
    }
    // A quotient q = a / w is off by (e_a + |q| e_w) / w, more or less, and by two roundings.
    let [ex, ey, ew, en, _] = placed.error;
    let mut out = [0.0; 6];
    for (axis, error) in [ex, ey, en].into_iter().enumerate() {
        let most = low[axis].abs().max(high[axis].abs());
        let margin = 2.0 * ((error + most * ew) / least_w + 2.0 * f64::EPSILON * most);
        out[2 * axis] = low[axis] - margin;
        out[2 * axis + 1] = high[axis] + margin;
    }
    Some(out)
}

/// The pixels of the buffer that an extent meets; `None` if there is none.
#[inline(always)]
pub(crate) fn pixels(extent: &[f64; 6], lens: &Lens) -> Option<([f64; 2], [f64; 2])> {
    let limit =
        |low: f64, high: f64, size: f64| [low.max(0.0).min(size).floor_(), high.max(0.0).min(size).ceil_()];
    let columns = limit(extent[0], extent[1], lens.size[0]);
    let lines = limit(extent[2], extent[3], lens.size[1]);
    (columns[0] < columns[1] && lines[0] < lines[1]).then_some((columns, lines))
}

/// Makes the shape of a box. `facing` is that of the lens, turned round for mirrored boxes. Its `extent` on the screen is found anew unless it
/// is known: then all of the box is before the eye.
#[inline(always)]
pub(crate) fn make(
    bounds: &Aabb,
    placed: &Placed,
    lens: &Lens,
    facing: f64,
    known: Option<&Extent>,
    coverage: Coverage,
    shape: &mut Shape,
) -> Made {
    let (min, max) = (bounds.min.to_array().map(f64::from), bounds.max.to_array().map(f64::from));
    let base = placed.at(min);
    let mut steps = [[0.0; 5]; 3];
    for axis in 0..3 {
        for i in 0..5 {
            steps[axis][i] = placed.linear[axis][i] * (max[axis] - min[axis]);
        }
    }
    let mut nearest = base[4];
    for step in &steps {
        nearest += if step[4] < 0.0 { step[4] } else { 0.0 };
    }
    if !(nearest > placed.error[4]) {
        return Made::Near;
    }
    let mut corners = [[0.0; 8]; 4];
    for i in 0..4 {
        for (corner, value) in corners[i].iter_mut().enumerate() {
            let mut sum = base[i];
            sum += if corner & 1 != 0 { steps[0][i] } else { 0.0 };
            sum += if corner & 2 != 0 { steps[1][i] } else { 0.0 };
            sum += if corner & 4 != 0 { steps[2][i] } else { 0.0 };
            *value = sum;
        }
    }
    let [x, y, w, n] = &corners;
    match known {
        Some(extent) => shape.begin_within(extent),
        None => {
            let Some(extent) = extent(x, y, w, n, placed) else { return Made::Near };
            let Some((columns, lines)) = pixels(&extent, lens) else { return Made::Nothing };
            shape.begin(columns, lines, extent[4], extent[5]);
        }
    }

    // Planes and facing. Each pair of faces shares a normal, the product of the two other axes.
    let [u, v, t] = steps.map(|s| [s[0], s[1], s[2]]);
    let origin = [base[0], base[1], base[2]];
    let certain = placed.determinant_error();
    let products = placed.cross_error(lens.size);
    let mut seen = 0usize;
    for axis in 0..3 {
        let (second, third) = match axis {
            0 => (v, t),
            1 => (t, u),
            _ => (u, v),
        };
        let own = [u, v, t][axis];
        let normal = cross(second, third);
        let low = dot(normal, origin);
        let high = low + dot(normal, own);
        let (face, height) = if -low * facing > certain {
            (2 * axis, low)
        } else if high * facing > certain {
            (2 * axis + 1, high)
        } else {
            continue;
        };
        seen |= 1 << face;
        let over = 1.0 / height;
        let plane = if lens.perspective {
            [normal[0] * over, normal[1] * over, normal[2] * over]
        } else {
            // Nearness a x + b y + c such that n agrees at a corner and along both sides: Cramer's rule.
            let (sn, tn) = match axis {
                0 => (steps[1][3], steps[2][3]),
                1 => (steps[2][3], steps[0][3]),
                _ => (steps[0][3], steps[1][3]),
            };
            let (mut corner, mut cn) = (origin, base[3]);
            if face % 2 == 1 {
                corner = core::array::from_fn(|i| origin[i] + own[i]);
                cn += steps[axis][3];
            }
            let (p, q) = (cross(third, corner), cross(corner, second));
            core::array::from_fn(|i| (cn * normal[i] + sn * p[i] + tn * q[i]) * over)
        };
        if !shape.bound(lower(plane, over, placed, lens, certain, products), lens.size) {
            return Made::Near;
        }
    }
    let outline = &OUTLINES[seen];
    if outline.count == 0 {
        return Made::Nothing;
    }
    for edge in &outline.edges[..usize::from(outline.count)] {
        let [a, b] = edge.map(|i| {
            let i = usize::from(i % 8);
            [x[i], y[i], w[i]]
        });
        let line = cross(a, b).map(|v| v * facing);
        if !shape.keep([line[0], line[1], line[2] - products], lens.size, coverage) {
            return Made::Near;
        }
    }
    Made::Shape
}

/// A plane of nearness, moved away by what rounding may have done to it.
///
/// It is a numerator over a determinant, of which `over` is the reciprocal. The numerator's error, over the picture, is that of a cross product times `n` and
/// the like; the
/// determinant's relative error is that of the quotient.
#[inline(always)]
pub(crate) fn lower(
    [a, b, c]: [f64; 3],
    over: f64,
    placed: &Placed,
    lens: &Lens,
    determinant_error: f64,
    cross_error: f64,
) -> [f64; 3] {
    let ([sx, sy, sw, sn, _], [.., en, _]) = (placed.size, placed.error);
    let [width, rows] = lens.size;
    let size = a.abs() * width + b.abs() * rows + c.abs();
    let of_n = if lens.perspective { 0.0 } else { 32.0 * en * (width * sy * sw + rows * sx * sw + sx * sy) };
    let numerator = 4.0 * cross_error * sn + of_n;
    [a, b, c - 2.0 * (numerator + size * determinant_error) * over.abs()]
}
