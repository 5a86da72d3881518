//! Triangle rasterization, row by row, with the nearest triangle at each pixel centre.
//!
//! Coverage is decided by the edges' crossings with each row of pixel centres. An edge is always evaluated
//! from its upper to its lower end, whichever triangle it belongs to. Two triangles that share an edge
//! therefore get the same crossing to the last bit: one ends where the other begins. A centre is covered if
//! `left <= x < right`, and a row is met if `top <= y < bottom`: the top-left rule of graphics APIs. The
//! crossings of one row cut it into half-open intervals without gaps, so a mesh has no cracks whatever the
//! rounding. If rounding swaps two crossings less than 1e-12 pixels apart, a centre between them is covered
//! twice, and the nearer triangle wins.
//!
//! A *claim* records a triangle that ties for a pixel with the triangle that the pixel shows: it comes within
//! [`EDGE_TIE`] of the pixel's centre, is at least as near there up to [`DEPTH_TIE`], and belongs to another
//! object. Only rounding decides which of the two the pixel shows.

use alloc::vec::Vec;

/// Triangle number of a pixel that shows no triangle.
pub const NONE: u32 = u32::MAX;

/// Maximum distance of an edge from a pixel's centre, in columns and in rows, at which the edge counts as
/// meeting the centre. Rounding moves an edge by less than this, unless coordinates are 10 million times as
/// large as the distance to the eye: in an image of 1000 columns, 1e7 * 1e3 * 2^-53 is about a millionth.
pub(crate) const EDGE_TIE: f64 = 1e-6;

/// Maximum mean number of claims per pixel. A claim records a triangle that ties with the triangle that the
/// pixel shows. At this number, claims of triangles that have since been hidden are dropped. If more than
/// half of the claims remain, no further claims are recorded. This bounds the memory if thousands of objects
/// coincide.
const MAX_CLAIMS: usize = 16;

/// Maximum relative difference of two depth keys that count as equal.
pub(crate) const DEPTH_TIE: f64 = 1e-10;

/// Corner of a triangle in image coordinates: columns from the left, rows from the top, and a depth key.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Corner {
    /// Columns from the left side of the image; pixel centres are at half-integers.
    pub(crate) x: f64,
    /// Rows from the top of the image; pixel centres are at half-integers.
    pub(crate) y: f64,
    /// Depth key, greater for nearer points and linear on the screen: `1 / w` for perspective views; for
    /// parallel views `z / w`, negated unless depth is reversed.
    pub(crate) depth_key: f64,
}

impl Corner {
    /// Tests whether x, y and the depth key are all finite.
    pub(crate) fn is_finite(&self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.depth_key.is_finite()
    }

    /// Tests whether this corner comes before `other` from top to bottom. Ties are ordered by x, then depth
    /// key, so that the order of corners in a triangle does not matter.
    fn is_above(&self, other: &Self) -> bool {
        (self.y, self.x, self.depth_key) < (other.y, other.x, other.depth_key)
    }
}

/// Claim of a triangle to a pixel: the triangle ties with the one that the pixel shows, because only rounding
/// decides which of the two is nearest at the pixel's centre.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct TieClaim {
    /// Index of the pixel: `row * width + column`.
    pub(crate) pixel: u32,
    /// Number of the triangle that ties with the shown one, counted through all objects in the order drawn.
    pub(crate) item: u32,
    /// Depth key of the triangle at the pixel's centre; greater is nearer.
    depth_key: f64,
}

/// State of a pixel for see-through objects in front of its opaque triangle.
#[derive(Clone, Copy, Debug)]
struct Veil {
    /// Number of the nearest see-through triangle that certainly shows in the pixel, or [`NONE`].
    nearest: u32,
    /// Depth key of the triangle `nearest`; negative infinity if there is none.
    depth_key: f64,
    /// Index of the see-through object to which `shows` refers.
    object: u32,
    /// True if `object` certainly shows in the pixel, false if only rounding decides.
    shows: bool,
    /// Greatest depth key of the opaque triangles that tie for the pixel; negative infinity if none does.
    /// Only what is in front of all of them certainly shows.
    opaque_key: f64,
}

impl Veil {
    /// Pixel that no see-through object has reached.
    const NONE: Self = Self {
        nearest: NONE,
        depth_key: f64::NEG_INFINITY,
        object: u32::MAX,
        shows: false,
        opaque_key: f64::NEG_INFINITY,
    };
}

/// Pixel counts of one see-through object.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(crate) struct VeilPixels {
    /// Number of pixels in which the object certainly shows.
    pub(crate) pixels: u32,
    /// Number of other pixels in which only rounding decides whether the object shows.
    pub(crate) tied: u32,
    /// Number of pixels in which the object certainly shows, and no triangle drawn earlier certainly shows.
    pub(crate) newly_covered: u32,
}

/// Image under construction: the nearest triangle so far at each pixel and its depth key, row by row from the
/// top.
#[derive(Clone, Debug, Default)]
pub(crate) struct Image {
    /// Number of pixel columns of the image.
    pub(crate) width: usize,
    /// Number of pixel rows of the image.
    pub(crate) height: usize,
    /// Number of the triangle that each pixel shows, or [`NONE`].
    pub(crate) items: Vec<u32>,
    /// Depth key of the triangle that each pixel shows, greater for nearer; negative infinity without a
    /// triangle.
    pub(crate) depth_keys: Vec<f64>,
    /// Sum over all pixels of the number of triangles drawn that cover the pixel.
    pub(crate) layers: u64,
    /// Claims recorded so far, in no order: triangles that tie with the triangle that a pixel shows.
    /// Includes claims that triangles drawn later have hidden, until
    /// [`drop_hidden_claims`](Self::drop_hidden_claims).
    pub(crate) claims: Vec<TieClaim>,
    /// True if new claims (records of a triangle that ties with the triangle that a pixel shows) are
    /// discarded, because there are already about [`MAX_CLAIMS`] per pixel, as when thousands of objects
    /// coincide.
    claims_full: bool,
    /// Number of the first triangle of the object being drawn. Triangles of one object never claim pixels
    /// from each other, however near they are.
    pub(crate) object_start: u32,
    /// Absolute difference of two depth keys up to which they count as equal. Zero for perspective views,
    /// where only the relative [`DEPTH_TIE`] counts.
    pub(crate) least_difference: f64,
    /// See-through state of each pixel, by pixel index. Empty while opaque triangles are drawn.
    veils: Vec<Veil>,
    /// Index of the see-through object being drawn.
    veil_object: u32,
    /// Pixel counts so far of the see-through object being drawn.
    veil_pixels: VeilPixels,
    /// Number of pixels in which the see-through triangle being drawn shows.
    veil_triangle: u32,
}

impl Image {
    /// Makes an empty image of `width` columns and `height` rows. `None` if memory for the pixels cannot be
    /// allocated.
    pub(crate) fn new(width: usize, height: usize) -> Option<Self> {
        let mut image = Self { width, height, ..Self::default() };
        image.items.try_reserve_exact(width * height).ok()?;
        image.depth_keys.try_reserve_exact(width * height).ok()?;
        image.clear();
        Some(image)
    }

    /// Removes all triangles and claims (triangles that tie for a pixel) from the image. The size of the
    /// image and the allocated capacity stay.
    pub(crate) fn clear(&mut self) {
        self.items.clear();
        self.items.resize(self.width * self.height, NONE);
        self.depth_keys.clear();
        self.depth_keys.resize(self.width * self.height, f64::NEG_INFINITY);
        self.claims.clear();
        self.veils.clear();
        (self.layers, self.claims_full) = (0, false);
    }

    /// Ends the opaque triangles. All triangles drawn until [`clear`](Self::clear) are see-through: they hide
    /// nothing, and show in each pixel in which they are in front of the opaque triangle.
    pub(crate) fn begin_see_through(&mut self) {
        self.veils.resize(self.width * self.height, Veil::NONE);
        for claim in &self.claims {
            let veil = &mut self.veils[claim.pixel as usize];
            veil.opaque_key = veil.opaque_key.max(claim.depth_key);
        }
    }

    /// Begins the see-through object with the index `object`, and returns the pixel counts of the previous
    /// one.
    pub(crate) fn next_see_through(&mut self, object: u32) -> VeilPixels {
        self.veil_object = object;
        core::mem::take(&mut self.veil_pixels)
    }

    /// Returns the number of pixels that show the see-through triangle drawn last, and resets it to 0.
    pub(crate) fn take_triangle_pixels(&mut self) -> u32 {
        core::mem::take(&mut self.veil_triangle)
    }

    /// Returns the number of the nearest see-through triangle in front of the opaque triangle of a pixel, or
    /// [`NONE`].
    pub(crate) fn veil(&self, pixel: usize) -> u32 {
        self.veils.get(pixel).map_or(NONE, |veil| veil.nearest)
    }

    /// Drops each claim whose triangle is certainly behind the triangle that the claim's pixel now shows.
    pub(crate) fn drop_hidden_claims(&mut self) {
        let Self { depth_keys, least_difference, .. } = self;
        let least = |pixel: u32| least_tied_key(depth_keys[pixel as usize], *least_difference);
        self.claims.retain(|claim| claim.depth_key >= least(claim.pixel));
    }

    /// Draws triangle number `item`, with finite corners of any size and position, and records the pixels for
    /// which it ties. Corners in either orientation; a triangle without area draws nothing.
    pub(crate) fn fill(&mut self, corners: [Corner; 3], item: u32) {
        let [a, b, c] = corners;
        if self.claims.len() >= MAX_CLAIMS * self.items.len().max(64) && !self.claims_full {
            self.drop_hidden_claims();
            self.claims_full = self.claims.len() >= MAX_CLAIMS / 2 * self.items.len().max(64);
        }
        // Most triangles are small and contain no pixel centre, so an early test avoids divisions.
        let left = first_center(a.x.min(b.x).min(c.x) - EDGE_TIE, self.width);
        let right = first_center(a.x.max(b.x).max(c.x) + EDGE_TIE, self.width);
        let upper = first_center(a.y.min(b.y).min(c.y) - EDGE_TIE, self.height);
        let lower = first_center(a.y.max(b.y).max(c.y) + EDGE_TIE, self.height);
        if left >= right || upper >= lower {
            return;
        }
        let [top, middle, bottom] = sorted(corners);
        let Some(plane) = DepthKeyPlane::through(top, middle, bottom) else { return };
        let long = Edge::new(top, bottom);
        let short = [Edge::new(top, middle), Edge::new(middle, bottom)];
        for short in &short {
            let rows = first_center(short.upper.y, self.height)..first_center(short.lower.y, self.height);
            for row in rows {
                let y = row as f64 + 0.5;
                let (a, b) = (long.crossing(y), short.crossing(y));
                let (first, end) = (first_center(a.min(b), self.width), first_center(a.max(b), self.width));
                let (left, right) = if a < b { (&long, short) } else { (short, &long) };
                let errors = [left.crossing_error(), right.crossing_error()];
                if !self.veils.is_empty() {
                    self.layers += (end - first) as u64;
                    let centers = |a: f64, b: f64| [a, b].map(|x| first_center(x, self.width));
                    // In a row that passes close to a corner, no pixel centre is certainly inside.
                    let is_at_corner = corners.iter().any(|corner| (corner.y - y).abs() <= EDGE_TIE);
                    let inner = centers(a.min(b) + errors[0], a.max(b) - errors[1]);
                    let outer = centers(a.min(b) - errors[0], a.max(b) + errors[1]);
                    if !is_at_corner {
                        self.veil_span(row, inner, true, &plane, item);
                    }
                    if is_at_corner || inner != outer {
                        self.veil_span(row, outer, false, &plane, item);
                    }
                    continue;
                }
                self.fill_span(row, first, end, &plane, item);
                let (a, b) = (a.min(b) - errors[0], a.max(b) + errors[1]);
                if first_center(a, self.width) < first || first_center(b, self.width) > end {
                    self.claim_row(row, &[&long, short], &plane, item);
                }
            }
        }
        // Rows close to a corner, near which the edges may cross no row of centres.
        for corner in [top, middle, bottom] {
            let row = first_center(corner.y - EDGE_TIE, self.height);
            if row < first_center(corner.y + EDGE_TIE, self.height) {
                self.claim_row(row, &[&long, &short[0], &short[1]], &plane, item);
            }
        }
    }

    /// Records that triangle `item` ties for the pixels of a row whose centres are inside the triangle or
    /// within [`EDGE_TIE`] of it, if it is at least as near there as the triangle shown. `edges` are the
    /// triangle's edges that may meet the row.
    #[cold]
    #[inline(never)]
    fn claim_row(&mut self, row: usize, edges: &[&Edge], plane: &DepthKeyPlane, item: u32) {
        let y = row as f64 + 0.5;
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        for edge in edges {
            if let Some((a, b)) = edge.near_row(y) {
                (left, right) = (left.min(a), right.max(b));
            }
        }
        let (first, end) =
            (first_center(left - EDGE_TIE, self.width), first_center(right + EDGE_TIE, self.width));
        if !self.veils.is_empty() {
            return self.veil_span(row, [first, end], false, plane, item);
        }
        let key_at = plane.along_row(y);
        for column in first..end {
            let pixel = row * self.width + column;
            let here = key_at(column as f64 + 0.5);
            if here >= least_tied_key(self.depth_keys[pixel], self.least_difference) && !self.claims_full {
                add_claim(&mut self.claims, TieClaim { pixel: pixel as u32, item, depth_key: here });
            }
        }
    }

    /// Counts the pixels of columns `first..end` of a row in which the see-through triangle `item` shows in
    /// front of the opaque triangle. A pixel is tied (only rounding decides whether the triangle shows) if
    /// `covers` is false, or one of the opaque triangles that tie for the pixel is as near or nearer.
    fn veil_span(
        &mut self,
        row: usize,
        [first, end]: [usize; 2],
        covers: bool,
        plane: &DepthKeyPlane,
        item: u32,
    ) {
        let key_at = plane.along_row(row as f64 + 0.5);
        for column in first..end {
            let pixel = row * self.width + column;
            let here = key_at(column as f64 + 0.5);
            let (held, veil) = (self.depth_keys[pixel], &mut self.veils[pixel]);
            let tie = here.abs() * DEPTH_TIE + self.least_difference;
            if here - held < -tie {
                continue;
            }
            let shows = covers && here - held.max(veil.opaque_key) > tie;
            let counted = &mut self.veil_pixels;
            if shows {
                self.veil_triangle += 1;
                counted.newly_covered += u32::from(veil.nearest == NONE && self.items[pixel] == NONE);
                if here > veil.depth_key {
                    (veil.nearest, veil.depth_key) = (item, here);
                }
            }
            if veil.object != self.veil_object {
                (veil.object, veil.shows) = (self.veil_object, shows);
                counted.pixels += u32::from(shows);
                counted.tied += u32::from(!shows);
            } else if shows && !veil.shows {
                veil.shows = true;
                counted.pixels += 1;
                counted.tied -= 1;
            }
        }
    }

    /// Draws the pixels of columns `first..end` of a row where triangle `item` is nearer than the triangle
    /// shown, and records a claim for each pixel where the two triangles are equally near.
    #[inline]
    fn fill_span(&mut self, row: usize, first: usize, end: usize, plane: &DepthKeyPlane, item: u32) {
        let span = row * self.width + first..row * self.width + end;
        self.layers += (end - first) as u64;
        let (mut x, key_at) = (first as f64 + 0.5, plane.along_row(row as f64 + 0.5));
        let object_start = if self.claims_full { 0 } else { self.object_start };
        let (items, depth_keys) = (&mut self.items[span.clone()], &mut self.depth_keys[span.clone()]);
        for (i, (held, held_depth_key)) in items.iter_mut().zip(depth_keys).enumerate() {
            let here = key_at(x);
            x += 1.0;
            // The usual case is first and fast: the pixel has no triangle yet, or a farther one.
            let difference = here - *held_depth_key;
            if difference.abs() <= here.abs() * DEPTH_TIE + self.least_difference && *held < object_start {
                let loser = if difference > 0.0 { (*held, *held_depth_key) } else { (item, here) };
                let claim = TieClaim { pixel: (span.start + i) as u32, item: loser.0, depth_key: loser.1 };
                add_claim(&mut self.claims, claim);
            }
            // The comparison is strict, so that the first of equally near triangles stays.
            if difference > 0.0 {
                *held_depth_key = here;
                *held = item;
            }
        }
    }
}

/// Returns the least depth key that ties with (counts as equal to) `depth_key`: lower by `least_difference`,
/// the absolute tolerance, plus the relative tolerance [`DEPTH_TIE`] times `depth_key`.
#[inline]
pub(crate) fn least_tied_key(depth_key: f64, least_difference: f64) -> f64 {
    depth_key - (depth_key.abs() * DEPTH_TIE + least_difference)
}

/// Appends a claim (a triangle that ties for a pixel). A separate cold function, since ties are rare.
#[cold]
#[inline(never)]
fn add_claim(claims: &mut Vec<TieClaim>, claim: TieClaim) {
    claims.push(claim);
}

/// Returns the number of pixel centres `0.5, 1.5, ..` less than `v`, at most `limit`: the index of the first
/// centre not less than `v`. 0 for NaN.
#[inline]
pub(crate) fn first_center(v: f64, limit: usize) -> usize {
    // The subtraction is exact for v >= 0.25. For smaller v the result is negative anyway.
    let t = v - 0.5;
    if t >= limit as f64 {
        limit
    } else if t > 0.0 {
        let whole = t as usize;
        whole + usize::from((whole as f64) < t)
    } else {
        0
    }
}

/// Returns the corners from top to bottom, in the order of [`Corner::is_above`].
fn sorted([mut a, mut b, mut c]: [Corner; 3]) -> [Corner; 3] {
    if b.is_above(&a) {
        (a, b) = (b, a);
    }
    if c.is_above(&b) {
        (b, c) = (c, b);
        if b.is_above(&a) {
            (a, b) = (b, a);
        }
    }
    [a, b, c]
}

/// Edge of a triangle from its upper to its lower end, in columns and rows of the image.
struct Edge {
    upper: Corner,
    lower: Corner,
    /// Change of x, in columns, per row. NaN or infinite for a level edge.
    slope: f64,
}

impl Edge {
    fn new(upper: Corner, lower: Corner) -> Self {
        // A level edge's slope is never used, since no row of centres lies between its ends.
        Self { upper, lower, slope: (lower.x - upper.x) / (lower.y - upper.y) }
    }

    /// Returns the x coordinate, in columns, at which the edge crosses height `y`, which must lie between its
    /// ends.
    fn crossing(&self, y: f64) -> f64 {
        self.upper.x + (y - self.upper.y) * self.slope
    }

    /// Returns by how many columns the edge's crossing with a row of pixel centres moves if the edge moves by
    /// [`EDGE_TIE`] in columns and in rows.
    #[inline]
    fn crossing_error(&self) -> f64 {
        EDGE_TIE * (1.0 + self.slope.abs())
    }

    /// Returns the least and greatest column in which the edge is at most [`EDGE_TIE`] above or below height
    /// `y`. `None` if no part of the edge is so near to this height.
    fn near_row(&self, y: f64) -> Option<(f64, f64)> {
        if self.upper.y > y + EDGE_TIE || self.lower.y < y - EDGE_TIE {
            return None;
        }
        let (least, greatest) = (self.upper.x.min(self.lower.x), self.upper.x.max(self.lower.x));
        let ends = [y - EDGE_TIE, y + EDGE_TIE].map(|y| self.crossing(y.clamp(self.upper.y, self.lower.y)));
        // A level edge has no crossing.
        if ends.iter().any(|x| x.is_nan()) {
            return Some((least, greatest));
        }
        Some((ends[0].min(ends[1]).max(least), ends[0].max(ends[1]).min(greatest)))
    }
}

/// Depth key of a triangle as a linear function on the screen, clamped to the range of its corners.
struct DepthKeyPlane {
    /// Corner with the least depth key, from which the linear function starts.
    reference: Corner,
    /// Change of the depth key for each column to the right.
    slope_x: f64,
    /// Change of the depth key for each row downwards.
    slope_y: f64,
    /// Least depth key of the three corners, at the farthest corner.
    least: f64,
    /// Greatest depth key of the three corners, at the nearest corner.
    greatest: f64,
}

impl DepthKeyPlane {
    /// Interpolates the depth keys of three corners. `None` for triangles without area. Values are clamped to
    /// the corners' range, because the slopes of a triangle seen almost edge-on are mostly rounding errors.
    fn through(a: Corner, b: Corner, c: Corner) -> Option<Self> {
        let (bx, by, bn) = (b.x - a.x, b.y - a.y, b.depth_key - a.depth_key);
        let (cx, cy, cn) = (c.x - a.x, c.y - a.y, c.depth_key - a.depth_key);
        let area = bx * cy - cx * by;
        if area == 0.0 {
            return None;
        }
        // The depth key grows from the farthest corner. If evaluation starts there, its error grows with the
        // key, so a triangle that extends from close to the eye to the horizon is precise at the horizon.
        let reference =
            [b, c].into_iter().fold(a, |far, v| if v.depth_key < far.depth_key { v } else { far });
        Some(Self {
            reference,
            slope_x: (bn * cy - cn * by) / area,
            slope_y: (bx * cn - cx * bn) / area,
            least: reference.depth_key,
            greatest: a.depth_key.max(b.depth_key).max(c.depth_key),
        })
    }

    /// Returns the depth key as a function of x (in columns) along the line of height `y` (in rows), clamped
    /// to the range of the corners' depth keys.
    #[inline]
    fn along_row(&self, y: f64) -> impl Fn(f64) -> f64 {
        let Self { reference, slope_x, least, greatest, .. } = *self;
        let in_row = self.slope_y * (y - reference.y);
        move |x| (reference.depth_key + (slope_x * (x - reference.x) + in_row)).max(least).min(greatest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::{UNIT, ends};

    #[test]
    fn centers_are_counted_half_open() {
        let count = |v| first_center(v, 10);
        assert_eq!(
            [-1e300, -0.5, 0.0, 0.5, 1.5, 9.5, 1e300].map(count),
            [0, 0, 0, 0, 1, 9, 10],
            "centres before a position, in a row of 10"
        );
        assert_eq!(
            [0.5f64.next_up(), 1.5f64.next_down(), 1.5f64.next_up()].map(count),
            [1, 1, 2],
            "centres before positions next to a centre"
        );
        assert_eq!(
            (count(f64::NAN), count(f64::INFINITY)),
            (0, 10),
            "centres before NaN, and before infinity"
        );
    }

    /// Returns the rank of a pixel's centre.
    fn center(pixel: usize) -> i64 {
        UNIT * pixel as i64 + UNIT / 2
    }

    #[test]
    fn centers_are_counted_around_every_border() {
        for limit in 0..5 {
            for end in ends(-1, 6) {
                let expected = (0..limit).filter(|&pixel| center(pixel) < end.rank).count();
                assert_eq!(first_center(end.value, limit), expected, "{end:?} of {limit}");
            }
        }
    }

    /// Nearer rectangles with every pair of ends, in front of a covered image. A rectangle covers the centres
    /// from its left or upper end (inclusive) to its other end (exclusive). Where an end is at most the next
    /// number away from a centre, the rectangle shows or ties.
    #[test]
    fn rectangles_show_and_tie_at_the_centers_between_their_ends() {
        let (size, all) = (3, ends(-1, 4));
        for (axis, low) in (0..2).flat_map(|axis| all.iter().map(move |low| (axis, low))) {
            for high in all.iter().filter(|high| high.rank > low.rank) {
                let mut image = Image::new(size, size).unwrap();
                image.fill([at(-9.0, -9.0, 1.0), at(30.0, -9.0, 1.0), at(-9.0, 30.0, 1.0)], 0);
                image.object_start = 1;
                let corner = |along: f64, across: f64| match axis {
                    0 => at(along, across, 2.0),
                    _ => at(across, along, 2.0),
                };
                let [a, b] = [-1.0, 4.0].map(|across| corner(low.value, across));
                let [c, d] = [4.0, -1.0].map(|across| corner(high.value, across));
                image.fill([a, b, c], 1);
                image.fill([a, c, d], 2);
                for pixel in 0..size * size {
                    let center = center(if axis == 0 { pixel % size } else { pixel / size });
                    let shows = image.items[pixel] > 0;
                    assert_eq!(
                        shows,
                        (low.rank..high.rank).contains(&center),
                        "{low:?} to {high:?}, {pixel}"
                    );
                    let ties = image.claims.iter().any(|claim| claim.pixel == pixel as u32 && claim.item > 0);
                    let is_near = (low.rank - 1..=high.rank + 1).contains(&center);
                    assert_eq!(shows || ties, is_near, "{low:?} to {high:?}, {pixel}");
                }
            }
        }
    }

    fn image() -> Image {
        Image::new(32, 32).unwrap()
    }

    fn at(x: f64, y: f64, depth_key: f64) -> Corner {
        Corner { x, y, depth_key }
    }

    #[test]
    fn the_order_of_corners_changes_nothing() {
        let slanted = [at(1.3, 2.7, 0.1), at(30.1, 9.9, 3.0), at(12.2, 31.4, 0.7)];
        let level = [at(1.3, 2.7, 0.1), at(30.1, 2.7, 3.0), at(12.2, 31.4, 0.7)];
        for c in [slanted, level] {
            let draw = |order: [usize; 3]| {
                let mut image = image();
                image.fill(order.map(|i| c[i]), 1);
                image
            };
            let first = draw([0, 1, 2]);
            assert!(first.items.iter().filter(|&&i| i == 1).count() > 300, "the triangle covers its pixels");
            for order in [[0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
                assert_eq!(draw(order).depth_keys, first.depth_keys, "{order:?}");
            }
        }
    }

    #[test]
    fn slivers_are_as_near_as_their_corners() {
        // A triangle a few units in the last place wide. A centre one triangle width outside may count as
        // inside, where the linear function could have any value.
        let mut random = visibility_testing::Random(2);
        let mut drawn = 0;
        for _ in 0..2000 {
            let corners: [Corner; 3] = core::array::from_fn(|_| {
                let steps = random.range(-4.0, 4.0).round();
                at(10.5 + steps * 2e-15, random.range(0.0, 32.0), random.range(1.0, 2.0))
            });
            let mut image = image();
            image.fill(corners, 1);
            for &depth_key in image.depth_keys.iter().filter(|n| n.is_finite()) {
                assert!((1.0..=2.0).contains(&depth_key), "{depth_key} of {corners:?}");
                drawn += 1;
            }
        }
        assert!(drawn > 1000, "{drawn}");
    }

    #[test]
    fn thousands_of_coincident_objects_take_bounded_memory() {
        let mut image = Image::new(8, 8).unwrap();
        let corner = |x, y| Corner { x, y, depth_key: 1.0 };
        for item in 0..5000 {
            image.object_start = item;
            image.fill([corner(-9.0, -9.0), corner(30.0, -9.0), corner(-9.0, 30.0)], item);
        }
        assert!(image.claims.len() > 64 && image.claims.len() <= 17 * 64, "{}", image.claims.len());
    }

    /// Edges in all directions that pass a pixel's centre at a given multiple of [`EDGE_TIE`]. An edge closer
    /// than this limit claims the pixel, an edge beyond it does not.
    #[test]
    fn a_claim_reaches_as_far_as_a_tie() {
        for step in 0..200 {
            let angle = f64::from(step) * 0.0314;
            let (sin, cos) = (angle.sin(), angle.cos());
            // Distance between centre and edge after moving the edge by one column and one row.
            let reach = sin.abs() + cos.abs();
            for (shift, claims) in [(0.9, 1), (0.5, 1), (-0.5, 1), (1.1, 0)] {
                let shift = shift * reach * EDGE_TIE;
                let corner = |along: f64, inwards: f64, depth_key: f64| {
                    let inwards = inwards + shift;
                    at(16.5 + along * cos - inwards * sin, 16.5 + along * sin + inwards * cos, depth_key)
                };
                let mut image = image();
                image.fill([at(-100.0, -100.0, 1.0), at(100.0, -100.0, 1.0), at(0.0, 200.0, 1.0)], 1);
                image.object_start = 2;
                image.fill([corner(-7.3, 0.0, 1.0), corner(9.1, 0.0, 1.0), corner(0.7, 11.0, 1.0)], 2);
                let claimed = image.claims.iter().filter(|claim| claim.pixel == 16 * 32 + 16).count();
                assert_eq!(claimed.min(1), claims, "{step}, {shift:e}");
            }
        }
    }
}
