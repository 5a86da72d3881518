//! A plane as the box test takes it: in `f32`, with a margin that outweighs every rounding.

use crate::view::ViewPlane;

/// A plane of a view as the kernel tests it in `f32`: an upper bound on the signed distance of a box.
///
/// The plane is scaled to a normal `n` of length 1/4, so that no sum of three products overflows, and its
/// offset `d` with it. The box reaches farthest along `n` in the corner `p` that has the greater coordinate
/// where `n` is positive and the least elsewhere. The kernel computes
/// `S = ((X + Y) + Z) + offset`, where `X = max(p.x high.x, p.x low.x)` and so on, and must never find less
/// than the exact `n . p + d`. With `u = 2^-24`:
///
/// - `high` and `low` are `n +- (8u |n| + 2^-125)`, rounded once, so `X >= n.x p.x + |p.x| (7u |n.x| +
///   2^-125)` but for the rounding of the product, `u |X|`. The second term stands in for components that
///   `f32` cannot hold or flushes to zero.
/// - The three sums round by at most `u` each of what they add up: `3u (|X| + |Y| + |Z|) + 3u |offset|`.
/// - So `4u` of each product's magnitude are needed and `7u` are there.
/// - `offset` is `d + 8u |d|` plus the error of `d` itself, rounded once: `7u |d|` are there and `3u |d|` are
///   needed.
/// - Numbers below `2^-126` may be flushed to zero: three coordinates (times at most 1), three products,
///   three sums. `2^-122`, which is 16 times as much, covers these nine.
///
/// An infinite coordinate gives an infinite `X` of the right sign, or a NaN, which the kernel takes as
/// undecided.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TestPlane {
    pub(crate) high: [f32; 3],
    pub(crate) low: [f32; 3],
    pub(crate) offset: f32,
    /// For each axis, whether the greatest coordinate of a box reaches farther than the least.
    pub(crate) greatest: [bool; 3],
}

/// Eight times the unit round-off of `f32`: the relative margin.
const MARGIN: f64 = 4.0 * f32::EPSILON as f64;

impl TestPlane {
    pub(crate) const ALL: Self =
        Self { high: [0.0; 3], low: [0.0; 3], offset: f32::INFINITY, greatest: [true; 3] };

    pub(crate) fn new(view_plane: &ViewPlane) -> Self {
        let ViewPlane { plane, error } = view_plane;
        let least = f64::from(f32::MIN_POSITIVE);
        let n = (plane.normal * 0.25).to_array();
        let (d, error) = (plane.offset * 0.25, error * 0.25);
        Self {
            high: n.map(|n| (n + (MARGIN * n.abs() + 2.0 * least)) as f32),
            low: n.map(|n| (n - (MARGIN * n.abs() + 2.0 * least)) as f32),
            offset: (d + (MARGIN * d.abs() + error + 16.0 * least)) as f32,
            greatest: n.map(|n| n >= 0.0),
        }
    }
}
