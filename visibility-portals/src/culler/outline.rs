//! What is to be known of a portal or mirror before any eye looks at it.

use visibility_core::glam::DVec3;

/// How exact a polygon is, and how wide.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Outline {
    pub(super) normal: DVec3,
    /// How far the polygon may be from its vertices and edges as they are: the tolerance, and how far a
    /// vertex is off the plane or beyond an edge.
    pub(super) error: f64,
    /// Less than its least extent within its plane.
    pub(super) width: f64,
}

impl Outline {
    pub(super) fn new(vertices: &[DVec3], normal: DVec3, tolerance: f64) -> Self {
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
        // No convex figure is narrower everywhere than its area over its diameter.
        let width = area.length() / diameter * 0.5;
        Self { normal, error: tolerance + 2.0 * defect, width: if width > 0.0 { width } else { 0.0 } }
    }
}
