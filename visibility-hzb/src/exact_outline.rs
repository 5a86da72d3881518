//! Exact geometry of outlines on the screen, for tests of what rasters cover. Coordinates are whole numbers
//! of [`UNITS`] in a pixel.

/// Units in a pixel.
pub(crate) const UNITS: i128 = 256;

/// A point in units: column and row.
pub(crate) type Spot = [i128; 2];

/// Returns a point in pixels. The result is exact below 2^45 pixels.
pub(crate) fn in_pixels(spot: Spot) -> [f64; 2] {
    spot.map(|v| v as f64 / UNITS as f64)
}

/// Returns a coordinate in units between `low` and `high` pixels: any, a half pixel, or a whole one.
pub(crate) fn coordinate(random: &mut impl FnMut(f64, f64) -> f64, low: f64, high: f64) -> i128 {
    let step = [1, UNITS / 2, UNITS][random(0.0, 3.0) as usize];
    (random(low, high) * UNITS as f64) as i128 / step * step
}

/// Returns twice the area of the triangle `a`, `b`, `c`, in square units.
pub(crate) fn area(a: Spot, b: Spot, c: Spot) -> i128 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Returns whether the segment from `a` to `b` meets the open rectangle from `low` to `high`.
pub(crate) fn meets(a: Spot, b: Spot, low: Spot, high: Spot) -> bool {
    let overlaps = |axis: usize| a[axis].min(b[axis]) < high[axis] && a[axis].max(b[axis]) > low[axis];
    let corners = [low, [low[0], high[1]], [high[0], low[1]], high].map(|corner| area(a, b, corner));
    let is_apart = corners.iter().all(|&side| side >= 0) || corners.iter().all(|&side| side <= 0);
    overlaps(0) && overlaps(1) && !(is_apart && a != b)
}

/// Returns whether the segment from `a` to `b` meets the open square around the pixel at `x` and `y` that is
/// larger by `by` units on each side.
pub(crate) fn is_near([a, b]: [Spot; 2], [x, y]: [usize; 2], by: i128) -> bool {
    let [low, high] = [-by, UNITS + by].map(|by| [x, y].map(|v| v as i128 * UNITS + by));
    meets(a, b, low, high)
}

/// Returns the centre of the pixel at `x` and `y`.
pub(crate) fn centre([x, y]: [usize; 2]) -> Spot {
    [x, y].map(|v| v as i128 * UNITS + UNITS / 2)
}

/// Returns how often a closed polygon winds round the point `p`, which is on none of its edges.
pub(crate) fn winding(polygon: &[Spot], p: Spot) -> i128 {
    let turn = |[a, b]: [Spot; 2]| match (a[1] <= p[1], b[1] <= p[1]) {
        (true, false) => i128::from(area(a, b, p) > 0),
        (false, true) => -i128::from(area(a, b, p) < 0),
        _ => 0,
    };
    edges(polygon).map(turn).sum()
}

/// Returns the edges of a closed polygon, in order.
pub(crate) fn edges(polygon: &[Spot]) -> impl Iterator<Item = [Spot; 2]> {
    polygon.iter().zip(polygon.iter().cycle().skip(1)).map(|(&a, &b)| [a, b])
}

/// Returns four spots of which the first two are within a pixel of one border between tiles, and the third
/// and fourth of one each, in a buffer of the given columns and rows of tiles.
pub(crate) fn along_borders(random: &mut impl FnMut(f64, f64) -> f64, tiles: [usize; 2]) -> [Spot; 4] {
    let axis = random(0.0, 2.0) as usize;
    let borders = [0; 3].map(|_| random(0.0, tiles[axis] as f64 + 1.0) as i128 * 8 * UNITS);
    core::array::from_fn(|i| {
        let mut spot = [0; 2];
        spot[axis] = borders[i.saturating_sub(1)] + (random(-1.0, 1.0) * UNITS as f64) as i128;
        spot[1 - axis] = coordinate(random, -8.0, tiles[1 - axis] as f64 * 8.0 + 8.0);
        spot
    })
}
