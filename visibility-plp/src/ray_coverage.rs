//! Share of rays through a cell that its objects stop, along each axis, by sampling.
//!
//! Eight by eight rays run through the cell's box along each of x, y and z. A ray counts as stopped if any
//! triangle meets the ray inside the cell, so a wall of many triangles counts once.

use visibility_core::glam::DVec3;

/// Sampled rays through a cell that its triangles stop: one word each for rays along x, y and z. Bit `8 * row
/// + column` stands for the ray in that row and column of the eight by eight grid.
#[derive(Clone, Copy, Default)]
pub(crate) struct Cover([u64; 3]);

impl Cover {
    /// Adds the rays that another triangle stops, in the same bit order, from [`stopped_rays`].
    pub(crate) fn add(&mut self, stopped: [u64; 3]) {
        for (mine, more) in self.0.iter_mut().zip(stopped) {
            *mine |= more;
        }
    }

    /// Tests whether all rays along all three axes are stopped.
    pub(crate) fn is_full(&self) -> bool {
        self.0 == [u64::MAX; 3]
    }

    /// Returns the share of stopped rays along x, y and z, 0 to 255, of the rays that pass through the cell.
    /// `filled` is the share of the box's cross-section along each axis that the cell fills, 0 to 1. The
    /// fourth byte is 0.
    pub(crate) fn shares(&self, filled: [f64; 3]) -> [u8; 4] {
        let share = |axis: usize| {
            let stopped = f64::from(self.0[axis].count_ones()) / 64.0;
            (stopped / filled[axis].max(1.0 / 64.0) * 255.0).min(255.0) as u8
        };
        [share(0), share(1), share(2), 0]
    }
}

/// Twice the least area of a projected triangle that stops rays, where the box has a side of 2. Smaller
/// triangles would only meet rays by rounding.
const MIN_AREA: f64 = 1e-9;

/// Returns the rays through a box that meet a triangle inside the box, at a point for which `inside` returns
/// true. One word each for rays along x, y and z; bit `8 * row + column` stands for one of eight by eight
/// rays. `center` and `half` are the box's centre and half size, in the triangle's coordinates.
pub(crate) fn stopped_rays(
    triangle: &[DVec3; 3],
    center: DVec3,
    half: DVec3,
    inside: impl Fn(DVec3) -> bool,
) -> [u64; 3] {
    let corners = triangle.map(|p| (p - center) / half);
    [0, 1, 2].map(|axis| stopped_along(&corners, axis, |p| inside(center + p * half)))
}

/// Returns the rays along axis `axis` that meet a triangle at a point for which `inside` returns true, in
/// coordinates in which the box spans -1 to 1 on each axis. Bit `8 * row + column` stands for one of eight by
/// eight rays. Rays in the plane of the triangle are not stopped.
fn stopped_along(corners: &[DVec3; 3], axis: usize, inside: impl Fn(DVec3) -> bool) -> u64 {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let [a, b, c] = corners.map(|p| [p[u], p[v], p[axis]]);
    // The triangle lies beyond the near or the far side of the box.
    let depths = [a[2], b[2], c[2]];
    if depths.iter().all(|&depth| depth < -1.0) || depths.iter().all(|&depth| depth > 1.0) {
        return 0;
    }
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if area.abs() <= MIN_AREA {
        return 0;
    }
    // Ray i runs at (2i + 1) / 8 - 1.
    let range = |of: usize| {
        let least = a[of].min(b[of]).min(c[of]);
        let most = a[of].max(b[of]).max(c[of]);
        // Rounds up and down with casts, since `ceil` and `floor` need `std`.
        let from = ((least + 1.0) * 4.0 - 0.5).clamp(0.0, 8.0);
        let first = from as u32 + u32::from(f64::from(from as u32) < from);
        let to = (most + 1.0) * 4.0 - 0.5;
        let end = if to >= 0.0 { to.min(7.0) as u32 + 1 } else { 0 };
        (first, end)
    };
    let (columns, rows) = (range(0), range(1));
    let mut stopped = 0;
    for row in rows.0..rows.1 {
        let y = (2.0 * f64::from(row) + 1.0) / 8.0 - 1.0;
        for column in columns.0..columns.1 {
            let x = (2.0 * f64::from(column) + 1.0) / 8.0 - 1.0;
            let to = |p: [f64; 3]| (p[0] - x, p[1] - y);
            let (pa, pb, pc) = (to(a), to(b), to(c));
            let cross = |p: (f64, f64), q: (f64, f64)| p.0 * q.1 - p.1 * q.0;
            let (wa, wb, wc) = (cross(pb, pc) / area, cross(pc, pa) / area, cross(pa, pb) / area);
            let depth = wa * a[2] + wb * b[2] + wc * c[2];
            if wa < 0.0 || wb < 0.0 || wc < 0.0 || depth.abs() > 1.0 {
                continue;
            }
            let mut point = DVec3::ZERO;
            (point[u], point[v], point[axis]) = (x, y, depth);
            if inside(point) {
                stopped |= 1 << (row * 8 + column);
            }
        }
    }
    stopped
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_exact::{Random, RandomExact};

    /// Returns the rays along `axis` that a triangle stops inside of the box from -16 to 16, by integer
    /// arithmetic. The corners are in sixteenths of half the box, so rays are at odd multiples of 2.
    fn exactly_stopped(t: &[[i64; 3]; 3], axis: usize) -> u64 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut stopped = 0;
        for ray in 0..64 {
            let (x, y) = (4 * (ray % 8) - 14, 4 * (ray / 8) - 14);
            let cross = |p: [i64; 3], q: [i64; 3]| (p[u] - x) * (q[v] - y) - (p[v] - y) * (q[u] - x);
            let weights = [0, 1, 2].map(|i| cross(t[(i + 1) % 3], t[(i + 2) % 3]));
            let area: i64 = weights.iter().sum();
            let depth: i64 = (0..3).map(|i| weights[i] * t[i][axis]).sum();
            let is_within = weights.iter().all(|weight| weight * area >= 0);
            if area != 0 && is_within && depth.abs() <= 16 * area.abs() {
                stopped |= 1 << ray;
            }
        }
        stopped
    }

    /// Triangles stop the rays that integer arithmetic tells. Their corners are on and beside rays and faces
    /// of the box, and some are exactly as deep as a face of the box.
    #[test]
    fn rays_are_stopped_as_whole_numbers_say() {
        let mut random = Random(31);
        let (mut stopped, mut flat) = (0, 0);
        for round in 0..20_000 {
            let mut t = [(); 3].map(|()| random.integers(24));
            if round % 2 == 0 {
                // Legs along two axes of 16 or 32 units: no rounding at all.
                let (axis, legs) = (round / 2 % 3, [16 << (round / 6 % 2), 16 << (round / 12 % 2)]);
                t[0] = t[0].map(|x| x / 2 * 2);
                (t[1], t[2]) = (t[0], t[0]);
                t[1][axis] += legs[0];
                t[2][(axis + 1) % 3] += legs[1];
                t[1][(axis + 2) % 3] += 8 * random.whole(2);
                t[2][(axis + 2) % 3] += 8 * random.whole(2);
            }
            let area = |axis: usize| {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let leg = |i: usize, of: usize| t[i][of] - t[0][of];
                (leg(1, u) * leg(2, v) - leg(1, v) * leg(2, u)).unsigned_abs()
            };
            let triangle = t.map(|p| DVec3::from_array(p.map(|x| x as f64)));
            let found = stopped_rays(&triangle, DVec3::ZERO, DVec3::splat(16.0), |_| true);
            for (axis, &found) in found.iter().enumerate() {
                // Otherwise a depth that is exactly that of the box's face is rounded.
                if area(axis).is_power_of_two() || area(axis) == 0 {
                    assert_eq!(found, exactly_stopped(&t, axis), "axis {axis} of {t:?}");
                    stopped += found.count_ones();
                    flat += u32::from(area(axis) == 0);
                }
            }
        }
        assert!(stopped > 10_000 && flat > 1000, "{stopped} {flat}");
    }

    #[test]
    fn shares_are_of_the_rays_that_pass_through_the_cell() {
        let mut cover = Cover::default();
        cover.add([u64::MAX, 0xffff, 1]);
        cover.add([0, 0xf_0000, 1]);
        assert_eq!(cover.shares([1.0; 3]), [255, 79, 3, 0], "64, 20 and 1 of 64 rays");
        assert_eq!(cover.shares([0.5, 0.5, 0.25]), [255, 159, 15, 0], "rays of a cell that fills less");
        assert_eq!(
            cover.shares([0.0; 3]),
            [255; 3].into_iter().chain([0]).collect::<alloc::vec::Vec<_>>()[..],
            "rays of a cell thinner than the distance of two rays"
        );
    }
}
