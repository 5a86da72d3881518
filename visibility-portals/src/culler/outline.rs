//! View-independent quantities of the polygon of a portal or mirror.

use visibility_core::glam::DVec3;

/// Normal, error bound and width of the polygon of a portal or mirror, computed once and shared by all views.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Outline {
    /// Unit normal of the polygon's plane, in world axes. The vertices run counter-clockwise as seen from
    /// the side that the normal points to.
    pub(super) normal: DVec3,
    /// Absolute bound, in world units, on the distance between a stored vertex and the exact polygon: the
    /// tolerance of the cells plus twice the greatest distance of a vertex from the stored plane or beyond
    /// an edge, plus the misplacement of the cells.
    pub(super) error: f64,
    /// The part of `error` that may tilt the polygon, without the misplacement, which moves it as a whole.
    pub(super) flaw: f64,
    /// Lower bound on the smallest extent of the polygon within its plane, in world units. 0 if the polygon
    /// has no area.
    pub(super) width: f64,
}

impl Outline {
    /// Measures the polygon of a portal or mirror. Each vertex may be off by `tolerance` world units, and the
    /// polygon as a whole by `misplacement`.
    pub(super) fn new(vertices: &[DVec3], normal: DVec3, tolerance: f64, misplacement: f64) -> Self {
        let mut defect = 0.0f64;
        let mut diameter = 0.0f64;
        let mut area = DVec3::ZERO;
        for (i, &a) in vertices.iter().enumerate() {
            let b = vertices[(i + 1) % vertices.len()];
            area += (a - vertices[0]).cross(b - vertices[0]) * 0.5;
            let inward = normal.cross(b - a).normalize_or_zero();
            for &v in vertices {
                diameter = diameter.max((v - a).length());
                defect = defect.max(normal.dot(v - a).abs()).max(-inward.dot(v - a));
            }
        }
        // The smallest width of a convex figure is at least its area divided by its diameter.
        let width = area.length() / diameter * 0.5;
        let flaw = tolerance + 2.0 * defect;
        Self { normal, error: flaw + misplacement, flaw, width: if width > 0.0 { width } else { 0.0 } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quadrangle with sides of 4 and 1 whose third vertex is lifted, or moved inwards.
    #[test]
    fn errors_hold_what_vertices_are_off_and_the_width_is_not_above_the_least_extent() {
        let measure = |at: [f64; 3], tolerance, misplacement| {
            let vertices = [DVec3::ZERO, DVec3::new(4.0, 0.0, 0.0), DVec3::from(at), DVec3::Y];
            Outline::new(&vertices, DVec3::Z, tolerance, misplacement)
        };
        let flat = measure([4.0, 1.0, 0.0], 0.125, 0.25);
        assert_eq!((flat.flaw, flat.error), (0.125, 0.375), "flaw and error of a flat rectangle");
        assert!((0.4..=1.0).contains(&flat.width), "width of a rectangle of 4 by 1: {}", flat.width);
        let lifted = measure([4.0, 1.0, 0.25], 0.125, 0.25);
        assert_eq!((lifted.flaw, lifted.error), (0.625, 0.875), "a vertex that is lifted by 0.25");
        // The side from (1, 0.25) to (0, 1), extended, has (4, 0) 1.6 outside.
        let dent = measure([1.0, 0.25, 0.0], 0.0, 0.0);
        assert!((dent.flaw - 3.2).abs() < 1e-12, "{dent:?} of a quadrangle with a dent");
        let points = Outline::new(&[DVec3::ONE; 3], DVec3::Z, 0.0, 0.0);
        assert_eq!(points.width, 0.0, "width of a single point");
    }
}
