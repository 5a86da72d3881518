//! Whether triangles meet cells, by separating axes (Akenine-Möller, "Fast 3D Triangle-Box Overlap Testing", 2001).

use visibility_core::glam::DVec3;

/// Whether a triangle meets a box, given by its centre and half its size. True where rounding could tell otherwise.
pub(crate) fn triangle_meets_box(triangle: &[DVec3; 3], center: DVec3, half: DVec3) -> bool {
    let [a, b, c] = triangle.map(|p| p - center);
    // Coordinates come from f32 and the box from a grid in f64: each subtraction rounds by 2^-53 of its result, each product and
    // sum below a few times more, of magnitudes no greater than `size` squared. 1e-12 is two thousand times as much as all of it.
    let size = a.abs().max(b.abs()).max(c.abs()).max(half).max_element() + center.abs().max_element();
    let slack = 1e-12 * size;
    let half = half + DVec3::splat(slack);
    let (least, most) = (a.min(b).min(c), a.max(b).max(c));
    if least.cmpgt(half).any() || most.cmplt(-half).any() {
        return false;
    }
    let edges = [b - a, c - b, a - c];
    let normal = edges[0].cross(edges[1]);
    let reach = normal.abs().dot(half) + slack * size;
    if normal.dot(a).abs() > reach {
        return false;
    }
    for (i, edge) in edges.iter().enumerate() {
        // The edge's third corner, and one of its own: their products are all that differ.
        let (on, off) = ([a, b, c][i], [c, a, b][i]);
        let e = edge.abs();
        let axes = [
            (DVec3::new(0.0, -edge.z, edge.y), e.z * half.y + e.y * half.z),
            (DVec3::new(edge.z, 0.0, -edge.x), e.z * half.x + e.x * half.z),
            (DVec3::new(-edge.y, edge.x, 0.0), e.y * half.x + e.x * half.y),
        ];
        for (axis, reach) in axes {
            let (p, q) = (axis.dot(on), axis.dot(off));
            let reach = reach + slack * size;
            if p.min(q) > reach || p.max(q) < -reach {
                return false;
            }
        }
    }
    // Also where something is NaN: every comparison above was false.
    true
}
