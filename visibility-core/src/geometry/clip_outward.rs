//! Clipping of convex polygons by half-spaces enlarged by a margin, so that rounding cuts no true part off.

use crate::geometry::Plane;
use glam::DVec3;
use smallvec::SmallVec;

/// Corners of a convex polygon, in metres in the space of the planes that clip it, in order around its
/// boundary. A single point, or the two ends of an edge, also count as a polygon. Up to 16 corners are stored
/// inline without allocation.
pub(crate) type Corners = SmallVec<[DVec3; 16]>;

/// Returns the corners, in order, of the part of a convex polygon that is in a half-space. The half-space is
/// the side that the unit normal of `plane` points to, with its boundary moved by `margin` metres against the
/// normal.
///
/// A positive margin enlarges the half-space, a negative margin shrinks it. Corners on the moved boundary are
/// kept. The result is empty if all corners are outside.
pub(crate) fn clip_outward(corners: &[DVec3], plane: &Plane, margin: f64) -> Corners {
    let mut kept = Corners::new();
    let height = |at: DVec3| plane.signed_distance(at) + margin;
    for (i, &a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        let (height_a, height_b) = (height(a), height(b));
        if height_a >= 0.0 {
            kept.push(a);
        }
        if (height_a >= 0.0) != (height_b >= 0.0) {
            kept.push(a + (b - a) * (height_a / (height_a - height_b)));
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners on the boundary are kept, also where both of their neighbours are inside, and once at least.
    #[test]
    fn corners_on_the_boundary_are_kept() {
        let plane = Plane::new(DVec3::Z, -1.0);
        let at = |heights: &[f64]| -> Corners {
            let around = heights.iter().zip(0..).map(|(&z, i)| DVec3::new(f64::from(i * i), f64::from(i), z));
            around.collect()
        };
        for (heights, margin, expected) in [
            (&[2.0, 2.0, 1.0][..], 0.0, &[2.0, 2.0, 1.0][..]),
            (&[1.0, 1.0, 1.0], 0.0, &[1.0, 1.0, 1.0]),
            (&[2.0, 2.0, 0.5], 0.5, &[2.0, 2.0, 0.5]),
            (&[1.0], 0.0, &[1.0]),
            (&[0.9], 0.0, &[]),
            (&[0.0, 2.0], 0.0, &[1.0, 2.0, 1.0]),
            (&[0.0, 3.0], -1.0, &[2.0, 3.0, 2.0]),
        ] {
            let kept = clip_outward(&at(heights), &plane, margin);
            let kept: alloc::vec::Vec<f64> = kept.iter().map(|corner| corner.z).collect();
            assert_eq!(kept, expected, "{heights:?}, {margin}");
        }
    }
}
