//! Visibility from a region by sample points and shrunk occluders. If occluders that are shrunk by a distance
//! `e` hide an object from a point, the occluders themselves hide it from all viewpoints within `e` of the
//! point.
//!
//! This work is based on: Wonka, Wimmer and Schmalstieg, "Visibility Preprocessing with Occluder Fusion for
//! Urban Walkthroughs", 2000. If the segment from the point `p` to `x` meets the shrunk occluder at `c`, then
//! the segment from `q`, with `|p - q| <= e`, to `x` passes within `e` of `c`, inside the occluder itself.
//! The points cover the boundary of the viewcell's box, since every line of sight from within crosses the
//! boundary. Any culler from a point can be used; its occluder fusion carries over to the viewcell.
//!
//! Occluders thinner than `2 e` vanish, so thin walls hide nothing from a viewcell of metres.

use crate::remove::cell_box;
use crate::solids::occluding;
use crate::solids::{Solid, Solids};
use crate::umbra::is_closed_from;
use alloc::vec::Vec;
use visibility_core::glam::{Affine3A, DMat3, DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::scene::Triangle;
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, FrustumCuller, Object, ObjectId, OccluderMesh, RegionCuller, Scene,
    View, VisibleSet,
};

/// Distance of the near plane in the views from a sample point, as a fraction of the viewcell's greatest
/// extent. Depths in such a view are then within the range of `f32` at every scale. Any distance is sound:
/// objects in front of a near plane are within this distance of the viewcell, and all such objects are kept.
const NEAR: f64 = 1e-6;

/// Least distance of the near plane in metres, used for a viewcell that is a point.
const MIN_NEAR: f64 = 1e-30;

/// Bound on the rounding of sample points and of the distance between them, as a fraction of the greatest
/// coordinate M. With U the round-off of `f64`: an extent is at most 2 M and wrong by 2 U M, a patch and its
/// multiple by another 2 U M each, and the sum with the corner by U M. A point is wrong by 7 U M on each of
/// two axes, 10 U M in all. The distance is wrong by 4 U of itself, 6 U M. The sum, 16 U M, is 8 epsilon of
/// M: twice as much is taken.
const POINT_ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Margin of lengths for rounding to `f32`, as a fraction of the sum of the magnitudes of the terms that add
/// up to a transformed coordinate. A vertex of the shrunk mesh rounds by half an epsilon of itself, and its
/// transformation in `f32` by four roundings, 2 epsilon of the sum: 2.5 would be enough. The rest covers the
/// rounding of [`shrink`] in `f64`: the distance of a face is wrong by some 10 roundings over the sharpness
/// of its triangle (an area of 1e-4 of the longest side squared at least, see `solids.rs`), below 1e-11 of
/// the sum.
const ROUNDING: f64 = 8.0 * f32::EPSILON as f64;

/// Greatest number of sample points along a side of the viewcell.
const MAX_POINTS_PER_SIDE: usize = 64;

/// Removes objects that a culler from points finds hidden from each sample point on a viewcell's boundary.
/// The scene's occluders are shrunk in proportion to the distance between sample points. Conservative if the
/// culler from points is.
///
/// `C` must take its occluders from the occluder meshes of the scene that it is given, as
/// [`OcclusionCuller`](visibility_core::OcclusionCuller) does with any map. Only the convex solids of a mesh
/// occlude, and only those that the viewcell does not meet. Other triangles are left out.
///
/// # Cost
/// Each viewcell takes a copy of the scene's bounds, and six views from each point. With `n` points along a
/// side there are up to `6 n n` points.
#[derive(Clone, Debug)]
pub struct ShrunkCuller<C> {
    culler: C,
    points_per_side: usize,
    points: Vec<DVec3>,
    solids: Solids,
}

impl<C: Culler> ShrunkCuller<C> {
    /// Makes a culler that calls `culler` for sample points. `points_per_side` is their number along the
    /// longest side of the viewcell; on the other sides they are equally dense. 0 counts as 1, and more than
    /// 64 as 64. Occluders shrink by about 0.7 of the longest side divided by `points_per_side`.
    pub const fn new(culler: C, points_per_side: usize) -> Self {
        Self { culler, points_per_side, points: Vec::new(), solids: Solids::new() }
    }

    /// Returns the sample points of the last call, in world space. Empty before the first call.
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }
}

impl<C: Culler> RegionCuller for ShrunkCuller<C> {
    /// Returns [`Accuracy::Conservative`] if the culler from a point is conservative or exact, otherwise
    /// [`Accuracy::Approximate`].
    fn accuracy(&self) -> Accuracy {
        match self.culler.accuracy() {
            Accuracy::Exact | Accuracy::Conservative => Accuracy::Conservative,
            _ => Accuracy::Approximate,
        }
    }

    /// Removes the candidates that are hidden from all sample points. For a viewcell with planes, its whole
    /// box counts. A viewcell that is inverted or not finite removes nothing.
    fn cull(&mut self, scene: &Scene, cell: &Viewcell, visible: &mut VisibleSet) -> CullStats {
        self.points.clear();
        let Some((min, max)) = cell_box(cell, scene.origin()) else {
            return visible.retain(scene, |_, _| true);
        };
        let distance =
            sample_points(min, max, self.points_per_side.clamp(1, MAX_POINTS_PER_SIDE), &mut self.points);
        // Distance of the near plane of each view. Objects close enough to the viewcell to be cut by it are
        // kept below.
        let near = ((max - min).max_element() * NEAR).max(MIN_NEAR);
        self.solids.sync(scene);
        // A solid does not occlude from all viewpoints if the viewcell meets it or may look into its hole.
        let usable = |solid: &&Solid| !solid.meets(min, max) && is_closed_from(&solid.blocker, min, max);
        let usable: Vec<&Solid> = self.solids.list.iter().filter(usable).collect();
        let (shrunk, ids) = shrunk_scene(scene, visible, &usable, distance);
        // An object that is hidden from all sample points, by occluders shrunk by the distance between
        // points, is hidden from all points of the viewcell.
        let mut seen = alloc::vec![false; scene.index_limit()];
        let (mut left, mut stats) = (ids.len(), CullStats::default());
        let mut set = VisibleSet::new();
        let mut frustum = FrustumCuller::new();
        for &point in &self.points {
            let Ok(faces) = View::cube_faces(point, near, f64::INFINITY) else {
                return visible.retain(scene, |_, _| true);
            };
            for view in &faces {
                if left == 0 {
                    break;
                }
                set.fill(&shrunk, view);
                stats += frustum.cull(&shrunk, view, &mut set);
                stats += self.culler.cull(&shrunk, view, &mut set);
                for id in set.iter(&shrunk) {
                    let seen = &mut seen[ids[id.index()].index()];
                    left -= usize::from(!*seen);
                    *seen = true;
                }
            }
        }
        self.points.iter_mut().for_each(|point| *point += scene.origin());
        // Sample points are within the box: sums are rounded, but not beyond the box's corners, which are
        // representable. An object beyond the box and nearer to a point than `near` is within these bounds.
        // Twice `near` covers the rounding of the bounds, unless `near` is below the spacing of numbers
        // there: then no number lies within `near` beyond the box.
        let (low, high) = (min - 2.0 * near, max + 2.0 * near);
        let meets =
            |bounds: &Aabb| bounds.min.as_dvec3().cmple(high).all() && low.cmple(bounds.max.as_dvec3()).all();
        let kept = visible.retain(scene, |id, bounds| seen[id.index()] || meets(bounds));
        stats.with_visible(kept.visible)
    }
}

/// Puts sample points on the sides of a box. Returns an upper bound on the distance in metres from any point
/// of a side to the nearest sample point.
fn sample_points(min: DVec3, max: DVec3, per_side: usize, points: &mut Vec<DVec3>) -> f64 {
    let size = max - min;
    let step = size.max_element() / per_side as f64;
    // A quotient is at most `per_side`, and NaN counts as 0. A whole quotient that rounding made greater
    // needs no further point.
    let counts = size.to_array().map(|size| ((size / step - 1e-9) as usize + 1).min(per_side));
    let mut distance = 0.0f64;
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let patch = DVec3::new(size[u] / counts[u] as f64, size[v] / counts[v] as f64, 0.0);
        distance = distance.max(0.5 * patch.length());
        for side in [min[axis], max[axis]] {
            for (i, j) in (0..counts[u]).flat_map(|i| (0..counts[v]).map(move |j| (i, j))) {
                let mut point = DVec3::ZERO;
                point[axis] = side;
                point[u] = min[u] + patch.x * (i as f64 + 0.5);
                point[v] = min[v] + patch.y * (j as f64 + 0.5);
                points.push(point);
            }
        }
    }
    distance + min.abs().max(max.abs()).max_element() * POINT_ROUNDING
}

/// Copies the bounds of a scene, relative to its origin. The copy of a candidate that occludes gets a mesh of
/// the candidate's shrunk `solids`, which are grouped by object. Returns the copy, and the id in `scene` of
/// each object of the copy, by its index.
fn shrunk_scene(
    scene: &Scene,
    visible: &VisibleSet,
    solids: &[&Solid],
    distance: f64,
) -> (Scene, Vec<ObjectId>) {
    let ids: Vec<ObjectId> = scene.ids().collect();
    let mut index = alloc::vec![0; scene.index_limit()];
    (0..).zip(&ids).for_each(|(number, id)| index[id.index()] = number);
    let copy = |&id: &ObjectId| match scene.object(id) {
        Ok(object) => Object {
            bounds: scene.bounds(id).unwrap_or(object.bounds),
            occluder: false,
            layers: u32::MAX,
            ..object
        },
        Err(_) => Object::new(Aabb::EMPTY),
    };
    let mut shrunk = Scene::new();
    let copies = shrunk.insert_batch(ids.iter().map(copy));
    let occluding = occluding(scene, visible);
    for of_object in solids.chunk_by(|a, b| a.id == b.id) {
        let id = of_object[0].id;
        let Some((_, ref transform)) = scene.occluder(id).filter(|_| occluding.contains(id.index())) else {
            continue;
        };
        let shrink = |solid: &&Solid| shrink(&solid.mesh, transform, distance);
        let triangles: Vec<Triangle> = of_object.iter().filter_map(shrink).flatten().collect();
        if let Ok(mesh) = OccluderMesh::from_triangles(&triangles) {
            let (mesh, copy) = (shrunk.add_mesh(mesh.with_two_sided(true)), copies[index[id.index()]]);
            // If the transform is not finite, the object gets no mesh.
            if shrunk.set_mesh(copy, mesh, *transform).is_ok() {
                let _ = shrunk.set_occluder(copy, true);
            }
        }
    }
    (shrunk, ids)
}

/// Shrinks a convex solid, in mesh coordinates, so that each remaining point has a distance of at least
/// `distance` metres, in scene coordinates, from the outside of the solid. `None` if nothing remains.
fn shrink(solid: &OccluderMesh, transform: &Affine3A, distance: f64) -> Option<Vec<Triangle>> {
    let bounds = solid.bounds();
    let columns = transform.matrix3.to_cols_array_2d().map(|column| DVec3::from_array(column.map(f64::from)));
    let translation = DVec3::from_array(transform.translation.to_array().map(f64::from));
    // Vertices are rounded in mesh coordinates, and the transform may use `f32`. Both errors are relative to
    // the terms that add up to a transformed coordinate; these may cancel.
    let reach = bounds.min.abs().max(bounds.max.abs()).as_dvec3();
    let terms = columns[0].abs() * reach.x + columns[1].abs() * reach.y + columns[2].abs() * reach.z;
    let distance = distance + (terms + translation.abs()).length() * ROUNDING;
    let linear = DMat3::from_cols_array_2d(&columns.map(|column| column.to_array()));
    if solid.is_cuboid() {
        // Each side of the parallelepiped moves inwards along its own axis.
        let volume = linear.determinant().abs();
        let area = |axis: usize| columns[(axis + 1) % 3].cross(columns[(axis + 2) % 3]).length();
        let by = [0, 1, 2].map(|axis| distance * area(axis) / volume);
        let by = DVec3::from_array(by);
        let low = (bounds.min.as_dvec3() + by).as_vec3().to_array().map(f32::next_up);
        let high = (bounds.max.as_dvec3() - by).as_vec3().to_array().map(f32::next_down);
        let inner = [low, high].map(Vec3::from_array);
        // False also for NaN, from a transform without volume: nothing remains.
        if !inner[0].cmplt(inner[1]).all() {
            return None;
        }
        let corners = Aabb::new(inner[0], inner[1]).corners();
        return Some(OccluderMesh::CUBOID.iter().map(|t| t.map(|i| corners[i as usize])).collect());
    }
    // The solid is scaled about its middle. This scales the distances between the middle and the planes of
    // the faces, and so moves each plane inwards by (1 - scale) times its distance.
    let positions = solid.positions();
    let middle = positions.iter().map(|p| p.as_dvec3()).sum::<DVec3>() / positions.len() as f64;
    let depth = solid.triangles().iter().map(|t| {
        let [a, b, c] = t.map(|i| linear * (positions[i as usize].as_dvec3() - middle));
        (b - a).cross(c - a).normalize().dot(a).abs()
    });
    // NaN, from a sliver or a flat transform, is kept in the fold, so that nothing remains.
    let least = depth.fold(f64::INFINITY, |a, b| if b < a || b.is_nan() { b } else { a });
    let scale = 1.0 - distance / least;
    if scale.is_nan() || scale <= 0.0 {
        return None;
    }
    let place = |i: u32| (middle + (positions[i as usize].as_dvec3() - middle) * scale).as_vec3();
    let triangles: Vec<[Vec3; 3]> = solid.triangles().iter().map(|t| t.map(place)).collect();
    Some(triangles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::Vec3Swizzles;
    use visibility_core::view::Eye;

    #[test]
    fn points_cover_the_boundary() {
        for size in [[4.0, 4.0, 2.0], [1.0, 0.0, 3.0], [0.0, 0.0, 0.0]] {
            for per_side in [1, 2, 5] {
                let (min, mut points) = (DVec3::splat(-1.0), Vec::new());
                let max = min + DVec3::from_array(size);
                let distance = sample_points(min, max, per_side, &mut points);
                assert!(
                    distance <= 0.71 * DVec3::from_array(size).max_element() / per_side as f64 + 1e-13,
                    "{size:?}, {per_side} points a side: the distance {distance} is more than half a diagonal"
                );
                let steps = (0..=20).flat_map(|i| (0..=20).map(move |j| (i, j)));
                for (axis, (i, j)) in (0..3).flat_map(|axis| steps.clone().map(move |step| (axis, step))) {
                    let mut part = DVec3::new(1.0, f64::from(i) / 20.0, f64::from(j) / 20.0);
                    part = [part, part.zxy(), part.yzx()][axis];
                    let p = min + (max - min) * part;
                    let nearest = points.iter().map(|q| q.distance(p)).fold(f64::INFINITY, f64::min);
                    assert!(nearest <= distance + 1e-12, "{size:?}: {nearest} of {distance}");
                }
            }
        }
    }

    /// Far from the origin, sample points and patches round by a billionth of the box. The middle of a side
    /// is exact, and as far from the four nearest sample points as any point of the side may be.
    #[test]
    fn points_cover_the_middle_of_sides_far_away() {
        let mut random = visibility_testing::Random(7);
        for round in 0..2000 {
            let step = 2f64.powi(-20);
            let min = (random.fine_vector(1e6) / step).round() * step;
            let size = (1.0 + random.below(2000) as f64) * 4.0 * step;
            let mut points = Vec::new();
            let distance = sample_points(min, min + DVec3::splat(size), 6, &mut points);
            let middle = min + DVec3::new(0.0, 0.5, 0.5) * size;
            // Differences of numbers this close to each other are exact.
            let nearest = points.iter().map(|p| (middle - *p).length()).fold(f64::INFINITY, f64::min);
            assert!(
                nearest <= distance,
                "round {round}: the nearest point to {middle} is at {nearest}, {distance} is claimed"
            );
        }
    }

    /// A side from the origin to far away: points and patches round by its greatest coordinate.
    #[test]
    fn points_cover_the_middle_of_sides_that_begin_at_the_origin() {
        let mut random = visibility_testing::Random(8);
        for round in 0..2000 {
            let size = 4.0 * (f64::from(random.between(1 << 28, 1 << 30)) + 1.0);
            let mut points = Vec::new();
            let sign = if round % 2 == 0 { 1.0 } else { -1.0 };
            let ends = [DVec3::ZERO, DVec3::splat(sign * size)];
            let distance = sample_points(ends[0].min(ends[1]), ends[0].max(ends[1]), 6, &mut points);
            let middle = DVec3::new(0.0, 0.5, 0.5) * sign * size;
            // Differences of numbers within a factor of two are exact, as is the comparison of squares.
            let is_near = |p: &DVec3| {
                let by = middle - *p;
                let squares = by.to_array().map(|x| (x, x));
                visibility_testing::sign_of_sum(squares.into_iter().chain([(-distance, distance)])) <= 0
            };
            assert!(points.iter().any(is_near), "round {round}: {distance} is claimed for {middle}");
        }
    }

    /// What no point sees is hidden, unless it is at the viewcell; what a point sees stays.
    #[test]
    fn objects_at_the_viewcell_stay_and_others_if_they_are_seen() {
        let mut scene = Scene::new();
        let mut insert = |at: Vec3| scene.insert(Aabb::new(at - 0.5, at + 0.5));
        let inside = insert(Vec3::ZERO);
        let touching: Vec<_> =
            Vec3::AXES.into_iter().flat_map(|a| [a, -a]).map(|a| insert(a * 1.5)).collect();
        let far: Vec<_> = Vec3::AXES.into_iter().flat_map(|a| [a, -a]).map(|a| insert(a * 9.0)).collect();
        let cell = Viewcell::from_box(DVec3::NEG_ONE, DVec3::ONE);
        let mut visible = VisibleSet::new();
        ShrunkCuller::new(NearestViews::default(), 1).cull(&scene, &cell, &mut visible);
        assert!(visible.contains(&scene, inside), "an object in the viewcell");
        assert!(touching.iter().all(|&id| visible.contains(&scene, id)), "objects that touch the viewcell");
        assert!(far.iter().all(|&id| !visible.contains(&scene, id)), "objects on all sides that are hidden");
        let mut visible = VisibleSet::new();
        ShrunkCuller::new(BoundsGiven(Vec::new()), 1).cull(&scene, &cell, &mut visible);
        assert!(far.iter().all(|&id| visible.contains(&scene, id)), "objects on all sides that are seen");
    }

    /// A culler that removes nothing, and stores the objects that occlude.
    struct OccludersGiven(usize);

    impl Culler for OccludersGiven {
        fn name(&self) -> &str {
            "occluders given"
        }

        fn accuracy(&self) -> Accuracy {
            Accuracy::Conservative
        }

        fn cull(&mut self, scene: &Scene, _: &View, visible: &mut VisibleSet) -> CullStats {
            self.0 = self.0.max(scene.ids().filter(|&id| scene.occluder(id).is_some()).count());
            visible.retain(scene, |_, _| true)
        }
    }

    /// A box without a side hides from where its hole does not show, and a box around the viewcell not at
    /// all.
    #[test]
    fn solids_at_the_viewcell_and_open_ones_do_not_occlude() {
        let count = |bounds: Aabb, left_out: usize| {
            let corners = bounds.corners();
            let triangles: Vec<Triangle> = OccluderMesh::CUBOID
                .iter()
                .map(|t| t.map(|i| corners[i as usize]))
                .filter(|t| !(left_out == 1 && t.iter().all(|p| p.x == bounds.min.x)))
                .filter(|t| !(left_out == 2 && t.iter().all(|p| p.x == bounds.max.x)))
                .collect();
            let mut scene = Scene::new();
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            let mesh = scene.add_mesh(OccluderMesh::from_triangles(&triangles).unwrap());
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
            let mut culler = ShrunkCuller::new(OccludersGiven(0), 1);
            let cell = Viewcell::from_box(DVec3::splat(-0.1), DVec3::splat(0.1));
            culler.cull(&scene, &cell, &mut VisibleSet::new());
            culler.culler.0
        };
        let apart = Aabb::from_arrays([5.0, -4.0, -4.0], [9.0, 4.0, 4.0]);
        assert_eq!(count(apart, 0), 1, "a closed box");
        assert_eq!(count(apart, 2), 1, "a box open on the far side");
        assert_eq!(count(apart, 1), 0, "a box open towards the viewcell");
        let around = Aabb::from_arrays([-2.0, -4.0, -4.0], [9.0, 4.0, 4.0]);
        assert_eq!(count(around, 0), 0, "a box around the viewcell");
    }

    /// A solid that a transform flattens leaves nothing, and one as wide as the world errs by its own size.
    #[test]
    fn flat_solids_leave_nothing_and_wide_ones_round_by_their_size() {
        let pyramid = |size: f32| {
            let base = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
            let [a, b, c, d] = base.map(|[u, v]| Vec3::new(u, v, 0.0) * size);
            let top = Vec3::new(2.0, 2.0, 4.0) * size;
            let sides = [[a, b, top], [b, c, top], [c, d, top], [d, a, top]];
            OccluderMesh::from_triangles(&[&[[a, c, b], [a, d, c]], &sides[..]].concat()).unwrap()
        };
        for axis in Vec3::AXES {
            let flat = Affine3A::from_scale(Vec3::ONE - axis);
            assert!(shrink(&pyramid(1.0), &flat, 0.1).is_none(), "flat along {axis}");
            let line = Affine3A::from_scale(axis);
            assert!(shrink(&pyramid(1.0), &line, 0.1).is_none(), "a line along {axis}");
        }
        assert!(shrink(&pyramid(1.0), &Affine3A::IDENTITY, 0.1).is_some(), "a solid that is not flat");
        let (size, [left, right]) = (1e6, [2.0, -2.0].map(|x| DVec3::new(x, 0.0, -1.0).normalize()));
        let planes = [(DVec3::Z, 0.0), (left, 0.0), (right, 4.0 * size * left.x)];
        for i in 0..200 {
            let by = 1.0 + 0.37 * f64::from(i);
            let triangles = shrink(&pyramid(1e6), &Affine3A::IDENTITY, by).unwrap();
            for p in triangles.iter().flatten().map(|p| p.as_dvec3()) {
                assert!(planes.iter().all(|(normal, offset)| normal.dot(p) + offset >= by), "{p} for {by}");
            }
        }
    }

    /// A culler that removes all objects, and stores the distance from the eye at which its views begin.
    #[derive(Default)]
    struct NearestViews(f64);

    impl Culler for NearestViews {
        fn name(&self) -> &str {
            "nearest views"
        }

        fn accuracy(&self) -> Accuracy {
            Accuracy::Approximate
        }

        fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
            let Eye::Point(eye) = view.eye(scene.origin()) else { panic!("sample points are eyes") };
            let planes = view.planes(scene.origin());
            let behind = planes.as_slice().iter().map(|plane| -plane.plane.signed_distance(eye));
            self.0 = behind.fold(0.0, f64::max);
            visible.retain(scene, |_, _| false)
        }
    }

    #[test]
    fn views_begin_at_a_millionth_of_the_viewcell_and_hide_at_every_scale() {
        for scale in [1e-15, 1.0, 1e15] {
            for (size, expected) in [(2.0 * scale, 2e-6 * scale), (0.0, MIN_NEAR)] {
                let mut scene = Scene::new();
                let far = DVec3::splat(9.0 * scale).as_vec3();
                let id = scene.insert(Aabb::new(far, far * 2.0));
                let mut culler = ShrunkCuller::new(NearestViews::default(), 1);
                let mut visible = VisibleSet::new();
                let cell = Viewcell::from_box(DVec3::ZERO, DVec3::splat(size));
                culler.cull(&scene, &cell, &mut visible);
                assert!(
                    !visible.contains(&scene, id),
                    "scale {scale}, viewcell of {size}: a culler hides it"
                );
                let near = culler.culler.0;
                assert!((near / expected - 1.0).abs() < 1e-3, "viewcell of {size}: views begin at {near}");
            }
        }
        // A viewcell that is a point far from the origin: its views begin at a distance below the rounding of
        // its coordinates.
        let mut scene = Scene::new();
        let id = scene.insert(Aabb::from_arrays([1e6 + 9.0, 0.0, 0.0], [1e6 + 10.0, 1.0, 1.0]));
        let mut visible = VisibleSet::new();
        let cell = Viewcell::from_box(DVec3::X * 1e6, DVec3::X * 1e6);
        ShrunkCuller::new(NearestViews::default(), 1).cull(&scene, &cell, &mut visible);
        assert!(!visible.contains(&scene, id), "an object is hidden from a point far from the origin");
    }

    /// A culler that removes nothing, and stores the bounds of the objects that it is given.
    struct BoundsGiven(Vec<Aabb>);

    impl Culler for BoundsGiven {
        fn name(&self) -> &str {
            "bounds given"
        }

        fn accuracy(&self) -> Accuracy {
            Accuracy::Conservative
        }

        fn cull(&mut self, scene: &Scene, _: &View, visible: &mut VisibleSet) -> CullStats {
            self.0.extend(visible.iter(scene).filter_map(|id| scene.bounds(id).ok()));
            visible.retain(scene, |_, _| true)
        }
    }

    /// A mesh that reaches out of the bounds of its object by rounding: a box without what reaches out could
    /// be hidden behind another object from all points, although the mesh is seen beside it.
    #[test]
    fn objects_keep_the_bounds_that_hold_their_meshes() {
        let bounds = Aabb::from_arrays([3.0; 3], [4.0; 3]);
        let mesh = OccluderMesh::cuboid(&Aabb::new(bounds.min, bounds.max.map(f32::next_up))).unwrap();
        let mut scene = Scene::new();
        let id = scene.insert(bounds);
        let mesh = scene.add_mesh(mesh);
        scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        let held = scene.bounds(id).unwrap();
        assert!(held.max.cmpgt(bounds.max).all(), "the scene enlarges {held:?} to hold the mesh");
        let mut culler = ShrunkCuller::new(BoundsGiven(Vec::new()), 1);
        let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
        culler.cull(&scene, &cell, &mut VisibleSet::new());
        assert!(!culler.culler.0.is_empty(), "a culler is given the object");
        assert!(
            culler.culler.0.iter().all(|&given| given == held),
            "cullers are given {:?}",
            culler.culler.0
        );
    }

    #[test]
    fn solids_shrink_by_the_distance_at_least() {
        let mesh = OccluderMesh::cuboid(&Aabb::from_arrays([3.0, 0.0, 0.0], [7.0, 4.0, 1.0])).unwrap();
        let shrunk = |by| shrink(&mesh, &Affine3A::IDENTITY, by);
        let bounds = Aabb::from_points(shrunk(0.25).unwrap().into_iter().flatten());
        let inner = Aabb::from_arrays([3.25, 0.25, 0.25], [6.75, 3.75, 0.75]);
        assert!(
            inner.contains_point(bounds.min) && inner.contains_point(bounds.max),
            "{bounds:?} is 0.25 m within the solid"
        );
        assert!(
            (bounds.max - inner.max).abs().max_element() < 1e-4,
            "{bounds:?} has shrunk by more than 0.25 m"
        );
        assert!(shrunk(0.5).is_none(), "as thin as the distance");
        // The transform scales by 2 along x, so half the distance is enough on that axis.
        let wide = Affine3A::from_scale(Vec3::new(2.0, 1.0, 1.0));
        let bounds = Aabb::from_points(shrink(&mesh, &wide, 0.25).unwrap().into_iter().flatten());
        assert!(
            (bounds.min.x - 3.125).abs() < 1e-4 && bounds.min.x >= 3.125,
            "{bounds:?} has shrunk by 0.125 m along x, in coordinates of the mesh"
        );
        let pyramid = |x: f32| {
            let base = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
            let [a, b, c, d] = base.map(|[u, v]| Vec3::new(x + u, v, 0.0));
            let top = Vec3::new(x + 2.0, 2.0, 4.0);
            let sides = [[a, b, top], [b, c, top], [c, d, top], [d, a, top]];
            OccluderMesh::from_triangles(&[&[[a, c, b], [a, d, c]], &sides[..]].concat()).unwrap()
        };
        let [left, right] = [2.0, -2.0].map(|x| DVec3::new(x, 0.0, -1.0).normalize());
        let planes = [(DVec3::Z, 0.0), (left, 0.0), (right, 4.0 * left.x)];
        // A pyramid is scaled about its middle, so that its base rises by at least the distance.
        let triangles = shrink(&pyramid(0.0), &Affine3A::IDENTITY, 0.25).unwrap();
        let points: Vec<DVec3> = triangles.iter().flatten().map(|p| p.as_dvec3()).collect();
        assert!(
            planes.iter().all(|(normal, offset)| points.iter().all(|p| normal.dot(*p) + offset >= 0.25)),
            "a point of the pyramid is less than 0.25 m within: {points:?}"
        );
        // Far from the origin of the mesh, vertices round by 0.03, even if the transform moves the mesh near
        // the scene's origin.
        let far = Affine3A::from_translation(Vec3::new(-1e6, 0.0, 0.0));
        let pyramid = pyramid(1e6);
        for i in 0..50 {
            let by = 0.01 + 0.002 * f64::from(i);
            let Some(triangles) = shrink(&pyramid, &far, by) else { continue };
            for p in triangles.iter().flatten().map(|p| p.as_dvec3() - DVec3::X * 1e6) {
                assert!(planes.iter().all(|(normal, offset)| normal.dot(p) + offset >= by), "{p} for {by}");
            }
        }
    }
}
