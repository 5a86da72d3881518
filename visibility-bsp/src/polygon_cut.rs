//! Cutting of a convex polygon in two by a plane.

use alloc::vec::Vec;
use visibility_core::{
    geometry::{Side, SidePlane},
    glam::DVec3,
};

/// Replaces `front` and `back` by the parts of a convex polygon in front of and behind a plane, in the
/// polygon's own space. A vertex within the plane's margin goes to both parts, so a part may have fewer than
/// three vertices or none. Cut points depend only on the plane and the ends of an edge, so polygons that
/// share the edge are cut in bit-identical points.
pub(crate) fn cut(polygon: &[DVec3], plane: &SidePlane, front: &mut Vec<DVec3>, back: &mut Vec<DVec3>) {
    front.clear();
    back.clear();
    let Some(&(mut a)) = polygon.last() else { return };
    let mut a_side = plane.side(a);
    for &b in polygon {
        let b_side = plane.side(b);
        if matches!((a_side, b_side), (Side::Front, Side::Back) | (Side::Back, Side::Front)) {
            let point = plane.crossing(a, b);
            front.push(point);
            back.push(point);
        }
        if b_side != Side::Back {
            front.push(b);
        }
        if b_side != Side::Front {
            back.push(b);
        }
        (a, a_side) = (b, b_side);
    }
}
