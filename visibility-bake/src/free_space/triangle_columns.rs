//! The columns of a grid that a triangle touches, and the triangle's range of heights in each.

use visibility_core::glam::DVec3;

/// Width of the margin for rounding on each side of a column, as a fraction of the least side of a box.
const SLACK: f64 = 1e-6;

/// The columns of a grid along one of its axes. Column 0 starts at coordinate 0 on both other axes.
pub(super) struct Columns {
    /// Axis along the columns: 0, 1 or 2.
    pub up: usize,
    /// The two axes across the columns.
    across: [usize; 2],
    /// Width in metres of a column on each axis of `across`.
    widths: [f64; 2],
    /// Width in metres of the margin on each side of a column.
    pub slack: f64,
}

impl Columns {
    /// Makes the columns along the axis `up` of a grid whose boxes have the given size in metres.
    pub(super) fn new(up: usize, size: DVec3) -> Self {
        let across = [(up + 1) % 3, (up + 2) % 3];
        Self { up, across, widths: across.map(|axis| size[axis]), slack: SLACK * size.min_element() }
    }

    /// Returns the column that contains the box at a [place](crate::grid): the place's coordinates on the two
    /// axes `across`.
    pub(super) fn of<T: Copy>(&self, place: [T; 3]) -> [T; 2] {
        self.across.map(|axis| place[axis])
    }

    /// Returns the [place](crate::grid) of a box from its column and its position `level` on the axis `up`.
    pub(super) fn place<T: Copy>(&self, column: [T; 2], level: T) -> [T; 3] {
        let mut place = [level; 3];
        (place[self.across[0]], place[self.across[1]]) = (column[0], column[1]);
        place
    }

    /// Returns a number of columns that a triangle touches at least, up to rounding: what its area fills.
    pub(super) fn fewest(&self, [a, b, c]: [DVec3; 3]) -> f64 {
        let [u, v] = self.across;
        let (p, q) = ((b - a), (c - a));
        ((p[u] / self.widths[0]) * (q[v] / self.widths[1])
            - (p[v] / self.widths[1]) * (q[u] / self.widths[0]))
            .abs()
            / 2.0
    }

    /// Calls `each` with each column that a triangle touches, and with the least and greatest coordinate of
    /// the triangle on the axis `up` in that column. Columns before `first` or after `last` on an axis are
    /// skipped. A column is given by its position on the two axes `across`.
    ///
    /// # Errors
    /// The first error of `each`.
    pub(super) fn for_each<E>(
        &self,
        triangle: [DVec3; 3],
        [first, last]: [[i64; 2]; 2],
        mut each: impl FnMut([i64; 2], [f64; 2]) -> Result<(), E>,
    ) -> Result<(), E> {
        let whole = ClippedTriangle::new(triangle);
        let range = |polygon: &ClippedTriangle, side: usize| {
            let [low, high] = polygon.range(self.across[side]);
            let place = |x: f64| (x / self.widths[side]).floor();
            let start = place(low - self.slack).max(first[side] as f64) as i64;
            start..=place(high + self.slack).min(last[side] as f64) as i64
        };
        let within = |polygon: &ClippedTriangle, side: usize, place: i64| {
            let width = self.widths[side];
            let ends = [place as f64 * width - self.slack, (place + 1) as f64 * width + self.slack];
            polygon.clipped(self.across[side], ends)
        };
        if range(&whole, 0).is_empty() {
            return Ok(());
        }
        for row in range(&whole, 1) {
            let strip = within(&whole, 1, row);
            if strip.is_empty() {
                continue;
            }
            for column in range(&strip, 0) {
                let part = within(&strip, 0, column);
                if !part.is_empty() {
                    each([column, row], part.range(self.up))?;
                }
            }
        }
        Ok(())
    }
}

/// Returns the corners of the bounding box of a triangle.
pub(super) fn extent([a, b, c]: &[DVec3; 3]) -> (DVec3, DVec3) {
    (a.min(*b).min(*c), a.max(*b).max(*c))
}

/// Capacity of a [`ClippedTriangle`] in corners. Exact cuts by the six sides of a box give at most 9 corners.
/// The rest allows for corners that rounding adds; corners beyond the capacity are dropped.
const CORNERS: usize = 28;

/// The part of a triangle inside some sides of a box: a convex polygon, without corners if it is empty.
pub(super) struct ClippedTriangle {
    corners: [DVec3; CORNERS],
    count: usize,
}

impl ClippedTriangle {
    pub(super) fn new(triangle: [DVec3; 3]) -> Self {
        let mut polygon = Self::empty();
        triangle.into_iter().for_each(|corner| polygon.push(corner));
        polygon
    }

    fn empty() -> Self {
        Self { corners: [DVec3::ZERO; CORNERS], count: 0 }
    }

    fn push(&mut self, corner: DVec3) {
        if let Some(place) = self.corners.get_mut(self.count) {
            *place = corner;
            self.count += 1;
        }
    }

    fn corners(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }

    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Returns the least and greatest coordinate of the polygon on an axis. Infinity and -infinity if it is
    /// empty.
    pub(super) fn range(&self, axis: usize) -> [f64; 2] {
        let start = [f64::INFINITY, f64::NEG_INFINITY];
        self.corners().iter().fold(start, |[low, high], p| [low.min(p[axis]), high.max(p[axis])])
    }

    /// Returns the part of the polygon between two coordinates on an axis, both included. Empty if no point
    /// of the polygon is between them.
    pub(super) fn clipped(&self, axis: usize, [low, high]: [f64; 2]) -> Self {
        self.clipped_by(axis, 1.0, low).clipped_by(axis, -1.0, -high)
    }

    /// Returns the part of the polygon whose coordinate on an axis, times `sign` (1 or -1), is at least
    /// `limit`.
    fn clipped_by(&self, axis: usize, sign: f64, limit: f64) -> Self {
        let inside = |p: DVec3| p[axis] * sign - limit;
        let mut part = Self::empty();
        let Some(&last) = self.corners().last() else { return part };
        let (mut p, mut a) = (last, inside(last));
        for &q in self.corners() {
            let b = inside(q);
            if (a < 0.0) != (b < 0.0) {
                part.push(p + (q - p) * (a / (a - b)));
            }
            if b >= 0.0 {
                part.push(q);
            }
            (p, a) = (q, b);
        }
        part
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::{UNIT, ends};

    /// Triangles between every pair of ends on one axis, rising along the axis, in columns 1 m wide.
    #[test]
    fn columns_are_those_that_a_triangle_touches() {
        let (columns, all) = (Columns::new(2, DVec3::ONE), ends(-1, 5));
        for (axis, low) in (0..2).flat_map(|axis| all.iter().map(move |low| (axis, low))) {
            for high in all.iter().filter(|high| high.rank >= low.rank) {
                let corner = |along: f64, across: f64| match axis {
                    0 => DVec3::new(along, across, along),
                    _ => DVec3::new(across, along, along),
                };
                let triangle = [corner(low.value, 1.5), corner(high.value, 1.25), corner(high.value, 1.75)];
                let mut found = Vec::new();
                let Ok(()) = columns.for_each(triangle, [[0; 2], [3; 2]], |column, heights| {
                    assert_eq!(column[1 - axis], 1, "{low:?} to {high:?}: the column across the axis");
                    found.push((column[axis], heights));
                    Ok::<(), std::convert::Infallible>(())
                });
                for column in 0..4i64 {
                    let [start, end] = [UNIT * column, UNIT * (column + 1)];
                    let of_column = found.iter().find(|(at, _)| *at == column);
                    let touches = |hair: i64| low.rank - hair <= end && high.rank + hair >= start;
                    assert!(of_column.is_some() || !touches(0), "{low:?} to {high:?} touches {column}");
                    assert!(of_column.is_none() || touches(1), "{low:?} to {high:?} is far from {column}");
                    if let Some((_, [least, most])) = of_column {
                        let (from, to) = (low.value.max(column as f64), high.value.min(column as f64 + 1.0));
                        assert!(
                            *least <= from && *most >= to,
                            "{low:?} to {high:?}, {column}: {least} to {most}"
                        );
                        assert!(from - least < 1e-5 && most - to < 1e-5, "{low:?} to {high:?}, {column}");
                    }
                }
                assert!(
                    found.iter().all(|(column, _)| (0..4).contains(column)),
                    "{low:?} to {high:?}: columns within the limits: {found:?}"
                );
            }
        }
    }
}
