//! Whether an occluder mesh, or triangles, lie within the bounds of their object.

use super::Triangles;
use crate::{Aabb, OccluderMesh};
use glam::{Affine3A, Vec3, Vec3A};

/// Tests whether the image of `mesh` under `transform` lies within `bounds`, up to rounding. False if
/// `bounds` are improper, or if the image is NaN.
///
/// The transformed box of the mesh decides most calls, in constant time. A turned mesh may fit into bounds
/// that its transformed box does not fit into: then each vertex is tested.
pub(super) fn is_within(mesh: &OccluderMesh, transform: &Affine3A, bounds: &Aabb) -> bool {
    let [x, y, z] = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis];
    let reach = mesh.bounds().min.abs().max(mesh.bounds().max.abs());
    let size = transform.translation.abs() + x.abs() * reach.x + y.abs() * reach.y + z.abs() * reach.z;
    let [least, greatest] = widened(bounds, size);
    let holds = |low: Vec3A, high: Vec3A| least.cmple(low).all() && high.cmple(greatest).all();
    let image = mesh.bounds().transformed(transform);
    let vertex = |p: &Vec3| transform.translation + x * p.x + y * p.y + z * p.z;
    bounds.is_proper()
        && size.is_finite()
        && (holds(image.min.into(), image.max.into())
            || mesh.positions().iter().map(vertex).all(|p| holds(p, p)))
}

/// Returns a box that holds the image of `mesh` under `transform`, up to the rounding of `f64`. The box of
/// the mesh, transformed, is taken if `bounds` hold it; otherwise the box is made of all vertices.
pub(super) fn image(mesh: &OccluderMesh, transform: &Affine3A, bounds: &Aabb) -> Aabb {
    let whole = mesh.bounds().transformed(transform);
    if bounds.union(&whole) == *bounds { whole } else { mesh.placed_bounds(transform) }
}

/// Returns the distance on each axis by which an object's content may reach out of its box `bounds` and count
/// as within it: 64 u (u = 2^-24) of the greatest coordinate of the box.
pub(super) fn slack(bounds: &Aabb) -> Vec3 {
    bounds.min.abs().max(bounds.max.abs()) * (32.0 * f32::EPSILON)
}

/// Tests whether `content` lies within `bounds`, up to 64 units of round-off (2^-24) of the greatest
/// coordinates of `bounds`.
pub fn holds_nearly(bounds: &Aabb, content: &Aabb) -> bool {
    let slack = slack(bounds);
    (bounds.min - slack).cmple(content.min).all() && content.max.cmple(bounds.max + slack).all()
}

/// Tests whether a corner of `triangles` lies outside of `bounds` by more than rounding. False if `bounds`
/// are improper; NaN corners are not outside.
pub(super) fn is_any_outside(triangles: Triangles<'_>, bounds: &Aabb) -> bool {
    let known = triangles.known_bounds().filter(Aabb::is_finite);
    // Rounding a transform moves triangles by at most 4 u of the greatest coordinate; `widened` allows 16 u.
    let placed = known.filter(|_| triangles.mesh().1.is_some());
    let moved = placed.map_or(Vec3::ZERO, |known| known.min.abs().max(known.max.abs()) / 4.0);
    let outside = |p: Vec3| {
        let p = Vec3A::from(p);
        // An infinite corner is outside of finite bounds.
        let size = (p.abs() + Vec3A::from(moved)).min(Vec3A::MAX);
        let [least, greatest] = widened(bounds, size);
        p.cmplt(least).any() || p.cmpgt(greatest).any()
    };
    // On each axis, a coordinate plus or minus its slack grows with the coordinate. So if neither corner of a
    // box is outside, no point of the box is.
    let is_inside = |known: Aabb| !outside(known.min) && !outside(known.max);
    bounds.is_proper() && !known.is_some_and(is_inside) && triangles.iter().flatten().any(outside)
}

/// Returns the minimum and maximum corners of `bounds`, moved outwards by more than the rounding of the
/// bounds and of the points inside them. The coordinates of these points are sums of terms; on each axis,
/// `size` bounds the sum of the terms' magnitudes.
///
/// With u = 2^-24: the image of a vertex errs by less than 4.1 u of `size`, as `Aabb::transformed` derives.
/// The caller has computed `bounds`, rounded to nearest: each side as the middle plus the half extent (two
/// roundings) or by a transform of a box, from numbers of at most `size`, and once more rounded when stored.
/// The side therefore errs by less than 9 u of the sum of `size` and its own magnitude. In all less than 14 u
/// of this sum are needed; 16 u are taken. An underflow loses at most the least normal number, up to eight
/// times. An infinite side admits everything.
fn widened(bounds: &Aabb, size: Vec3A) -> [Vec3A; 2] {
    let slack = |side: Vec3A| (size + side.abs()) * (8.0 * f32::EPSILON) + 8.0 * f32::MIN_POSITIVE;
    let (min, max) = (Vec3A::from(bounds.min), Vec3A::from(bounds.max));
    [min - slack(min), max + slack(max)]
}
