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

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Mat3A, Quat};
    use visibility_testing::Random;

    const U: f32 = f32::EPSILON / 2.0;

    fn turned(angle: f32, translation: Vec3) -> Affine3A {
        Affine3A::from_rotation_translation(Quat::from_rotation_z(angle), translation)
    }

    fn placed(transform: &Affine3A, p: Vec3) -> DVec3 {
        let Mat3A { x_axis, y_axis, z_axis } = transform.matrix3;
        let at = x_axis.as_dvec3() * f64::from(p.x) + y_axis.as_dvec3() * f64::from(p.y);
        at + z_axis.as_dvec3() * f64::from(p.z) + transform.translation.as_dvec3()
    }

    /// Bounds that a caller computes in `f32` as middle and half extent of the placed vertices, or by a
    /// transform of a box.
    #[test]
    fn meshes_are_within_bounds_that_are_computed_from_them() {
        let mut random = Random(21);
        for round in 0..3000 {
            let reach = random.pick(&[1.0, 1000.0]);
            let low = random.vec3(-reach, reach);
            let mesh = OccluderMesh::cuboid(&Aabb::new(low, low + random.vec3(0.1, 2.0))).unwrap();
            let mut transform = turned(random.range(-3.0, 3.0) as f32, random.vec3(-reach, reach));
            if round % 2 == 0 {
                // The mesh is taken back to the origin: terms cancel.
                transform.translation = -(transform.matrix3 * glam::Vec3A::from(mesh.bounds().center()));
            }
            let points: alloc::vec::Vec<DVec3> =
                mesh.positions().iter().map(|&p| placed(&transform, p)).collect();
            let rounded = Aabb::from_points(points.iter().map(|p| p.as_vec3()));
            let (middle, half) = (rounded.center(), rounded.half_extent());
            let computed = Aabb::from_points(mesh.positions().iter().map(|&p| transform.transform_point3(p)));
            for bounds in [rounded, Aabb::new(middle - half, middle + half), computed] {
                assert!(is_within(&mesh, &transform, &bounds), "round {round}: {bounds:?}");
            }
            // The turned mesh fits, where its transformed box does not; without a side it does not fit.
            for axis in 0..3 {
                let by = 0.05;
                let (mut from, mut to) = (rounded, rounded);
                from.min[axis] += by;
                to.max[axis] -= by;
                for bounds in [from, to] {
                    assert!(!is_within(&mesh, &transform, &bounds), "round {round}: {bounds:?}");
                }
            }
        }
    }

    #[test]
    fn bounds_that_are_none_hold_no_mesh() {
        let mesh = OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [1.0; 3])).unwrap();
        let still = Affine3A::IDENTITY;
        let all = Aabb::new(Vec3::NEG_INFINITY, Vec3::INFINITY);
        assert!(is_within(&mesh, &still, mesh.bounds()) && is_within(&mesh, &still, &all), "its own box");
        // Inverted by less than the slack that great coordinates have.
        let far = Affine3A::from_translation(Vec3::splat(1e6));
        let thin = OccluderMesh::from_indexed(
            &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Vec3::from_array),
            &[[0, 1, 2]],
        )
        .unwrap();
        let inverted = Aabb::from_arrays([1e6, 1e6, 1e6 + 0.125], [1e6 + 1.0, 1e6 + 1.0, 1e6]);
        assert!(!is_within(&thin, &far, &inverted), "an inverted box");
        let endless = Affine3A::from_translation(Vec3::splat(f32::INFINITY));
        assert!(!is_within(&mesh, &endless, &all), "a transform without end");
        // The transformed box fits although each vertex, of the same, does not: of no vertex is more asked.
        let scaled = Affine3A::from_scale(Vec3::splat(3e38));
        let wide = OccluderMesh::cuboid(&Aabb::from_arrays([-1.0; 3], [2.0; 3])).unwrap();
        assert!(!is_within(&wide, &scaled, mesh.bounds()), "an image that overflows");
    }

    /// The margin of 16 u of what the vertices are computed of, and of the side itself.
    #[test]
    fn what_reaches_out_by_rounding_is_within() {
        let unit = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
        // The box with one side at another place, and that place.
        let unit_to = |to: f32, axis: usize| {
            let mut reach = unit;
            *(if to < 0.0 { &mut reach.min[axis] } else { &mut reach.max[axis] }) = to;
            (to, reach)
        };
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                for (units, is_inside) in [(0.0, true), (28.0, true), (40.0, false)] {
                    let (to, reach) = unit_to(side * (1.0 + units * U), axis);
                    let mesh = OccluderMesh::cuboid(&reach).unwrap();
                    let name = (axis, side, units);
                    assert_eq!(is_within(&mesh, &Affine3A::IDENTITY, &unit), is_inside, "{name:?}");
                    let p = Vec3::splat(0.5);
                    let mut corner = p;
                    corner[axis] = to;
                    let triangles = [[p, corner, p]];
                    assert_eq!(is_any_outside((&triangles[..]).into(), &unit), !is_inside, "{name:?}");
                }
                for (units, is_inside) in [(0.0, true), (60.0, true), (68.0, false)] {
                    let (_, reach) = unit_to(side * (1.0 + units * U), axis);
                    assert_eq!(holds_nearly(&unit, &reach), is_inside, "{axis}, {side}, {units}");
                }
            }
        }
        // The slack is that of the greater corner of the box.
        let aside = Aabb::from_arrays([0.0; 3], [1.0; 3]);
        assert_eq!(slack(&aside), Vec3::splat(64.0 * U), "of the greater coordinate");
        assert!(holds_nearly(&aside, &Aabb::from_arrays([-60.0 * U; 3], [1.0; 3])), "below a side at 0");
        let own = Aabb::from_arrays([0.0; 3], [0.0; 3]);
        assert!(holds_nearly(&own, &own), "a box that is a point");
        // Terms of 1000 m that cancel: 16 u of these.
        let mesh = OccluderMesh::cuboid(&Aabb::from_arrays([1000.0; 3], [1001.0; 3])).unwrap();
        let back = Affine3A::from_translation(Vec3::splat(-1000.0));
        for (units, is_inside) in [(24.0, true), (44.0, false)] {
            let off = units * U * 1000.0;
            let [low, high] = [[off, 0.0, 0.0], [0.0, 0.0, off]].map(Vec3::from_array);
            for bounds in [Aabb::new(low, Vec3::ONE), Aabb::new(Vec3::ZERO, Vec3::ONE - high)] {
                assert_eq!(is_within(&mesh, &back, &bounds), is_inside, "{bounds:?}");
            }
        }
        let aside = OccluderMesh::cuboid(&Aabb::from_arrays([-1000.0; 3], [0.0; 3])).unwrap();
        let forth = Affine3A::from_translation(Vec3::splat(1000.0));
        let bounds = Aabb::new(Vec3::ZERO, Vec3::splat(1000.0 - 40.0 * U * 1000.0));
        assert!(is_within(&aside, &forth, &bounds), "of the greater coordinates of the mesh");
    }

    #[test]
    fn triangles_are_outside_with_one_corner() {
        let unit = Aabb::from_arrays([0.0; 3], [1.0; 3]);
        let [p, far, near] = [0.5, 2.0, -1.0].map(Vec3::splat);
        let outside = |corners: [Vec3; 3], bounds: &Aabb| is_any_outside((&[corners][..]).into(), bounds);
        assert!(
            !outside([p; 3], &unit) && outside([p, far, p], &unit) && outside([near, p, p], &unit),
            "corners"
        );
        assert!(!outside([p, Vec3::NAN, p], &unit), "a corner of NaN is not outside");
        let inverted = Aabb::from_arrays([1.0; 3], [0.0; 3]);
        assert!(!outside([far; 3], &inverted), "an improper box has no outside");
        assert!(outside([Vec3::INFINITY, p, p], &unit), "an infinite corner");
        let all = Aabb::new(Vec3::NEG_INFINITY, Vec3::INFINITY);
        assert!(!outside([far; 3], &all), "a box without end");
        // Triangles whose box is known: of its corners, neither may be outside.
        for corner in [far, near] {
            let shared = crate::scene::SharedTriangles::from([[p, corner, p]]);
            assert!(is_any_outside(shared.view(), &unit), "a corner at {corner}");
        }
        let shared = crate::scene::SharedTriangles::from([[p; 3]]);
        assert!(!is_any_outside(shared.view(), &unit), "triangles inside");
    }

    /// Placed triangles are moved by the rounding of their transform: 4 u of their greatest coordinate.
    #[test]
    fn placed_triangles_reach_out_by_the_rounding_of_their_transform() {
        let bounds = Aabb::from_arrays([-1000.0, -1.0, -1.0], [0.0, 1.0, 1.0]);
        for (units, is_inside) in [(0.0, true), (3.0, true), (6.0, false)] {
            let out = 1000.0 + units * U * 1000.0;
            let mesh = crate::scene::SharedTriangles::from([[Vec3::ZERO, Vec3::X * out, Vec3::Y * 0.5]]);
            let placed = mesh.placed(glam::DAffine3::from_translation(DVec3::X * -1000.0));
            assert!(placed.view().mesh().1.is_some(), "a transform");
            assert_eq!(is_any_outside(placed.view(), &bounds), !is_inside, "{units} units out");
        }
    }
}
