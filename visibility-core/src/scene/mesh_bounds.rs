//! Whether an occluder mesh lies within the bounds of its object.

use crate::{Aabb, OccluderMesh};
use glam::{Affine3A, Vec3A};

/// Tests whether the image of `mesh` under `transform` lies within `bounds`, up to rounding. False if `bounds`
/// are improper, or if the image is NaN.
///
/// The box around the transformed box of the mesh decides most calls. A turned mesh fits tighter bounds than
/// that box, so its vertices are tested one by one where the box is too large.
pub(super) fn is_within(mesh: &OccluderMesh, transform: &Affine3A, bounds: &Aabb) -> bool {
    let image = mesh.bounds().transformed(transform);
    if bounds.min.cmple(image.min).all() && image.max.cmple(bounds.max).all() {
        return true;
    }
    let [x, y, z] = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis];
    let reach = mesh.bounds().min.abs().max(mesh.bounds().max.abs());
    let size = transform.translation.abs() + x.abs() * reach.x + y.abs() * reach.y + z.abs() * reach.z;
    // With u = 2^-24: the image of a vertex errs by less than 4.1 u of `size`, as `Aabb::transformed` derives.
    // The bounds were computed elsewhere, to the nearest: two roundings of a side (middle plus half extent), or
    // those of a transform, on numbers of at most `size`, and one where the side is kept: less than 9 u of
    // `size` and the side. In all less than 14 u; 16 u are taken. An underflow loses at most the least normal
    // number, up to eight times. An infinite side admits everything.
    let slack = |side: Vec3A| (size + side.abs()) * (8.0 * f32::EPSILON) + 8.0 * f32::MIN_POSITIVE;
    let (min, max) = (Vec3A::from(bounds.min), Vec3A::from(bounds.max));
    let (least, greatest) = (min - slack(min), max + slack(max));
    bounds.is_proper()
        && mesh.positions().iter().all(|p| {
            let image = transform.translation + x * p.x + y * p.y + z * p.z;
            least.cmple(image).all() && image.cmple(greatest).all()
        })
}
