//! What is computed of the polygon of a portal or mirror once, for all views.

use visibility_core::glam::DVec3;

/// Normal, error and width of the polygon of a portal or mirror.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Outline {
    /// Unit normal of the plane.
    pub(super) normal: DVec3,
    /// Bound on the distance between a vertex as it is stored and the plane and edges that it stands for:
    /// the tolerance, and twice the most that a vertex is off the plane or beyond an edge.
    pub(super) error: f64,
    /// Lower bound on the least extent of the polygon within its plane, in world units.
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
