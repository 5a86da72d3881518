//! The shaft of two polygons: planes that bound the convex hull of all segments between them. A quick way to
//! tell that an edge or a box is met by none of the segments.

use crate::polygon::{MOST, Polygon};
use visibility_core::glam::DVec3;

/// Most planes of a [`Shaft`]: one for each side of either polygon, and their own two.
const PLANES: usize = 2 * MOST + 2;

/// Planes around two polygons. A point whose height over one of them is below `-pad` is outside.
///
/// Any normal will do, since the offset is the greatest that a corner of either polygon needs. Heights are
/// sums of three products and an offset, with unit normals and coordinates of magnitude M: errors of 12 U M
/// at the corners and 12 U M at the tested point, and 2 delta from the corners' positions. As delta is at
/// least 128 U M, the pad of 4 delta covers this.
pub(crate) struct Shaft {
    planes: [(DVec3, f64); PLANES],
    count: usize,
    pub(crate) pad: f64,
}

impl Shaft {
    pub(crate) fn new(p: &Polygon, q: &Polygon, delta: f64) -> Self {
        let mut shaft = Self { planes: [(DVec3::ZERO, 0.0); PLANES], count: 0, pad: 4.0 * delta };
        for (one, other) in [(p, q), (q, p)] {
            let normal = one.normal().normalize_or_zero();
            let towards = normal.dot(other.center() - one.center()) >= 0.0;
            shaft.add(if towards { normal } else { -normal }, one, other);
            let corners = one.corners();
            for (i, &u) in corners.iter().enumerate() {
                let v = corners[(i + 1) % corners.len()];
                for &w in other.corners() {
                    let normal = (v - u).cross(w - u).normalize_or_zero();
                    let heights = corners.iter().chain(other.corners()).map(|x| normal.dot(*x - u));
                    let (least, greatest) = heights.fold((0.0f64, 0.0f64), |(a, b), h| (a.min(h), b.max(h)));
                    // A plane through an edge of one and a corner of the other that supports both.
                    if least >= -shaft.pad || greatest <= shaft.pad {
                        shaft.add(if least >= -shaft.pad { normal } else { -normal }, one, other);
                        break;
                    }
                }
            }
        }
        shaft
    }

    fn add(&mut self, normal: DVec3, one: &Polygon, other: &Polygon) {
        if self.count < PLANES && normal != DVec3::ZERO {
            let corners = one.corners().iter().chain(other.corners());
            let offset = corners.map(|x| -normal.dot(*x)).fold(f64::NEG_INFINITY, f64::max);
            self.planes[self.count] = (normal, offset);
            self.count += 1;
        }
    }

    /// Returns whether all points are certainly outside of one of the planes.
    #[inline]
    pub(crate) fn misses(&self, points: &[DVec3]) -> bool {
        self.planes().any(|(n, d)| points.iter().all(|x| n.dot(*x) + d < -self.pad))
    }

    #[inline]
    fn planes(&self) -> impl Iterator<Item = &(DVec3, f64)> {
        self.planes[..self.count].iter()
    }
}
