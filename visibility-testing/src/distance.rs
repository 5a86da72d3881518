//! Distances between segments and triangles.

use visibility_core::glam::{DVec3, Vec3};

/// Returns the distance between a segment and a triangle, 0 if they meet, in ordinary floating point.
pub fn distance(p: DVec3, q: DVec3, t: &[Vec3; 3]) -> f64 {
    let t = t.map(Vec3::as_dvec3);
    let n = (t[1] - t[0]).cross(t[2] - t[0]);
    let (hp, hq) = (n.dot(p - t[0]), n.dot(q - t[0]));
    if hp * hq <= 0.0 && hp != hq {
        let x = p + (q - p) * (hp / (hp - hq));
        if (0..3).all(|k| n.cross(t[(k + 1) % 3] - t[k]).dot(x - t[k]) >= 0.0) {
            return 0.0;
        }
    }
    let edges = (0..3).map(|k| segments(p, q, t[k], t[(k + 1) % 3]));
    edges.chain([p, q].map(|x| point(x, &t))).fold(f64::INFINITY, f64::min)
}

fn point(x: DVec3, t: &[DVec3; 3]) -> f64 {
    let n = (t[1] - t[0]).cross(t[2] - t[0]);
    if n != DVec3::ZERO && (0..3).all(|k| n.cross(t[(k + 1) % 3] - t[k]).dot(x - t[k]) >= 0.0) {
        return n.normalize().dot(x - t[0]).abs();
    }
    (0..3).map(|k| segments(x, x, t[k], t[(k + 1) % 3])).fold(f64::INFINITY, f64::min)
}

/// Returns the distance between two segments (Ericson, "Real-Time Collision Detection", 2005).
fn segments(p: DVec3, q: DVec3, a: DVec3, b: DVec3) -> f64 {
    let (d, e, r) = (q - p, b - a, p - a);
    let (dd, ee, de) = (d.dot(d), e.dot(e), d.dot(e));
    let (c, f) = (d.dot(r), e.dot(r));
    let across = dd * ee - de * de;
    let s = if across > 0.0 { ((de * f - c * ee) / across).clamp(0.0, 1.0) } else { 0.0 };
    let t = if ee > 0.0 { ((de * s + f) / ee).clamp(0.0, 1.0) } else { 0.0 };
    let s = if dd > 0.0 { ((de * t - c) / dd).clamp(0.0, 1.0) } else { 0.0 };
    (p + d * s).distance(a + e * t)
}
