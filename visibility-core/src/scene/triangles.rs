//! Triangles of objects: those of one object, or those of a mesh that many objects share. Each of these
//! objects has a transform of its own, so that a mesh is kept once however often a level repeats it.

use super::Triangle;
use crate::Aabb;
use crate::geometry::keeps_orientation_64;
use alloc::{boxed::Box, sync::Arc, vec::Vec};
use core::slice;
use glam::{Affine3, Affine3A, DAffine3, DMat3, DVec3, Vec3};

/// Triangles that objects share. A clone refers to the same triangles.
///
/// Triangles with a [transform](Self::placed) are placed one by one as they are read: in `f64`, and then
/// rounded to `f32`. The transform is kept in `f32`, as renderers have it, if that is precise enough: it must
/// move no vertex along an axis by more than `2^-22` of the greatest coordinate of the placed mesh's box on
/// that axis. Otherwise the transform is kept in `f64`.
///
/// Memory: 36 bytes for each triangle of the mesh, once, and 48 bytes for each of the transforms that are
/// [given together](Self::placed_each), or 192 for one kept in `f64`.
///
/// ```
/// use visibility_core::glam::{DAffine3, DVec3, Vec3};
/// use visibility_core::scene::SharedTriangles;
/// let leaf = SharedTriangles::from([[Vec3::ZERO, Vec3::X, Vec3::Y]]);
/// let moved = leaf.placed(DAffine3::from_translation(DVec3::Z));
/// assert!(moved.view().iter().eq([[Vec3::Z, Vec3::X + Vec3::Z, Vec3::Y + Vec3::Z]]));
/// assert!(leaf.shares_mesh(&moved));
/// ```
#[derive(Clone, Debug)]
pub struct SharedTriangles {
    source: Source,
}

/// Storage of an object's triangles.
#[derive(Clone, Debug)]
enum Source {
    /// A mesh in scene coordinates.
    InScene(Arc<Mesh>),
    /// A mesh, and the index of the rounded transform that places it.
    Rounded(Arc<Instances>, u32),
    /// A mesh, and a transform kept in `f64` because `f32` is not precise enough for it.
    Exact(Arc<(Arc<Mesh>, DAffine3)>),
}

/// Triangles in coordinates of their own, with the box around them.
#[derive(Debug)]
struct Mesh {
    triangles: Box<[Triangle]>,
    bounds: Aabb,
}

/// A mesh with the transforms from the mesh's coordinates to those of the scene, [rounded] to `f32`.
#[derive(Debug)]
struct Instances {
    mesh: Arc<Mesh>,
    transforms: Box<[Affine3]>,
}

impl SharedTriangles {
    /// Returns triangles of the same mesh, placed by a transform from the coordinates of the mesh to those of
    /// the scene. `transform` replaces a former transform.
    ///
    /// A transform that mirrors (with a negative determinant) turns triangles inside out. Two of their
    /// corners are then exchanged, so that the front of each stays its front. A transform may be so flat that
    /// rounding hides whether it mirrors: see [`Triangles::has_certain_fronts`].
    #[must_use]
    pub fn placed(&self, transform: DAffine3) -> Self {
        self.instances(&[transform]).placed(0, &transform)
    }

    /// Returns one value for each transform: triangles of the same mesh, [placed](Self::placed) by this
    /// transform. Takes less memory than a call of `placed` for each. This memory is freed with the last of
    /// the returned values. At most 2^32 - 1 transforms are taken.
    ///
    /// ```
    /// use visibility_core::glam::{DAffine3, DVec3, Vec3};
    /// use visibility_core::scene::SharedTriangles;
    /// let leaf = SharedTriangles::from([[Vec3::ZERO, Vec3::X, Vec3::Y]]);
    /// let row = [0.0, 4.0, 8.0].map(|x| DAffine3::from_translation(DVec3::X * x));
    /// assert_eq!(leaf.placed_each(&row)[2].bounds().min, Vec3::X * 8.0);
    /// ```
    #[must_use]
    pub fn placed_each(&self, transforms: &[DAffine3]) -> Vec<Self> {
        let instances = self.instances(transforms);
        (0..u32::MAX).zip(transforms).map(|(index, transform)| instances.placed(index, transform)).collect()
    }

    fn instances(&self, transforms: &[DAffine3]) -> Arc<Instances> {
        let transforms = transforms.iter().map(rounded).collect();
        Arc::new(Instances { mesh: self.mesh().clone(), transforms })
    }

    #[inline]
    fn mesh(&self) -> &Arc<Mesh> {
        match &self.source {
            Source::InScene(mesh) => mesh,
            Source::Rounded(instances, _) => &instances.mesh,
            Source::Exact(placed) => &placed.0,
        }
    }

    /// Returns the triangles in scene coordinates.
    #[inline]
    pub fn view(&self) -> Triangles<'_> {
        let mesh = self.mesh();
        let (transform, is_rounded) = match &self.source {
            Source::InScene(_) => (None, true),
            Source::Rounded(instances, index) => (Some(exact(instances.transforms[*index as usize])), true),
            Source::Exact(placed) => (Some(placed.1), false),
        };
        Triangles { mesh: &mesh.triangles, transform, mesh_bounds: is_rounded.then_some(&mesh.bounds) }
    }

    /// Returns the transform from mesh to scene coordinates, if it is kept in `f32`. `None` for triangles
    /// without a transform.
    #[inline]
    pub(crate) fn rounded_transform(&self) -> Option<Affine3A> {
        match &self.source {
            Source::Rounded(instances, index) => {
                instances.transforms.get(*index as usize).copied().map(Affine3A::from)
            }
            Source::InScene(_) | Source::Exact(_) => None,
        }
    }

    /// Returns the number of triangles.
    #[inline]
    pub fn len(&self) -> usize {
        self.mesh().triangles.len()
    }

    /// Returns whether there are no triangles.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.mesh().triangles.is_empty()
    }

    /// Returns all triangles in scene coordinates, in their order.
    #[inline]
    pub fn iter(&self) -> TriangleIter<'_> {
        self.view().iter()
    }

    /// Returns the smallest box around the triangles in scene coordinates, rounded outwards, so that it holds
    /// their vertices as they are placed, before these are rounded to `f32`. [Empty](Aabb::EMPTY) without
    /// triangles, NaN if a coordinate is NaN. Takes constant time for triangles without a transform,
    /// otherwise visits all.
    pub fn bounds(&self) -> Aabb {
        let view = self.view();
        match view.transform {
            None => self.mesh().bounds,
            Some(transform) => Aabb::around_placed(view.mesh.as_flattened(), &transform),
        }
    }

    /// Returns the smallest box around the finite corners where they are placed, rounded outwards.
    /// [`Aabb::EMPTY`] without any.
    pub(crate) fn finite_bounds(&self) -> Aabb {
        let view = self.view();
        let transform = view.transform.unwrap_or(DAffine3::IDENTITY);
        let placed = |corner: &Vec3| transform.transform_point3(corner.as_dvec3());
        Aabb::around(view.mesh.as_flattened().iter().map(placed).filter(|corner| corner.is_finite()))
    }

    /// Returns whether two objects' triangles are the same mesh in memory.
    pub fn shares_mesh(&self, other: &Self) -> bool {
        Arc::ptr_eq(self.mesh(), other.mesh())
    }

    /// Returns whether both are the same mesh in memory, at the same place. False for a NaN in a transform.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        self.shares_mesh(other) && self.view().transform == other.view().transform
    }

    /// Returns the number of bytes of the mesh. All objects that share the mesh need these bytes once.
    pub fn mesh_memory(&self) -> usize {
        size_of::<Mesh>() + size_of_val(&self.mesh().triangles[..])
    }

    /// Returns the address of the mesh in memory, equal for all objects that share the mesh.
    pub(crate) fn mesh_address(&self) -> usize {
        Arc::as_ptr(self.mesh()).addr()
    }
}

impl Instances {
    /// Returns the mesh placed by `transform`. If that is [precise enough](can_be_rounded), the rounded
    /// transform at `index` of `transforms` is used.
    fn placed(self: &Arc<Self>, index: u32, transform: &DAffine3) -> SharedTriangles {
        let source = if can_be_rounded(transform, &self.mesh.bounds) {
            Source::Rounded(self.clone(), index)
        } else {
            Source::Exact(Arc::new((self.mesh.clone(), *transform)))
        };
        SharedTriangles { source }
    }
}

/// Returns a transform rounded to `f32`.
fn rounded(transform: &DAffine3) -> Affine3 {
    Affine3 { matrix3: transform.matrix3.as_mat3(), translation: transform.translation.as_vec3() }
}

/// Returns whether a transform may be [rounded] for a mesh with the given box. On each axis, rounding must
/// move vertices by at most `4 u` (`u = 2^-24`) times the greatest coordinate of the box's image on that
/// axis. Bounds computed from the exact transform then still contain the triangles, up to rounding. A
/// transform can always be rounded for a box that contains the mesh's origin, unless rounding changes what is
/// known of whether it mirrors.
///
/// Placing in `f32` adds terms that may cancel, so the sum of their magnitudes must be at most 4 times the
/// greatest coordinate of the image. Returns false if the rounded transform is not finite.
fn can_be_rounded(transform: &DAffine3, mesh_bounds: &Aabb) -> bool {
    let rounded = rounded(transform);
    let of_mesh = mesh_bounds.min.abs().max(mesh_bounds.max.abs()).as_dvec3();
    let sum_of_terms = |translation: DVec3, m: DMat3| {
        let [x, y, z] = [m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs()];
        translation.abs() + x * of_mesh.x + y * of_mesh.y + z * of_mesh.z
    };
    let DAffine3 { matrix3, translation } = exact(rounded);
    let size = sum_of_terms(translation, matrix3);
    let moved = sum_of_terms(transform.translation - translation, transform.matrix3 - matrix3);
    let image = mesh_bounds.transformed(&rounded.into());
    let coordinates = image.min.abs().max(image.max.abs()).as_dvec3();
    rounded.is_finite()
        && keeps_orientation_64(&transform.matrix3) == keeps_orientation_64(&matrix3)
        && size.max_element() <= 4.0 * coordinates.max_element()
        && moved.cmple(2.0 * f64::from(f32::EPSILON) * coordinates).all()
}

/// Returns a transform in `f64`, without rounding.
fn exact(transform: Affine3) -> DAffine3 {
    DAffine3 { matrix3: transform.matrix3.as_dmat3(), translation: transform.translation.as_dvec3() }
}

impl PartialEq for SharedTriangles {
    /// Compares the triangles in scene coordinates.
    fn eq(&self, other: &Self) -> bool {
        self.view() == other.view()
    }
}

impl From<Box<[Triangle]>> for SharedTriangles {
    /// Takes triangles in scene coordinates, or in the coordinates of a mesh that is [placed](Self::placed)
    /// later.
    fn from(triangles: Box<[Triangle]>) -> Self {
        let bounds = Aabb::from_points(triangles.as_flattened().iter().copied());
        Self { source: Source::InScene(Arc::new(Mesh { triangles, bounds })) }
    }
}

impl From<Vec<Triangle>> for SharedTriangles {
    fn from(triangles: Vec<Triangle>) -> Self {
        triangles.into_boxed_slice().into()
    }
}

impl From<&[Triangle]> for SharedTriangles {
    fn from(triangles: &[Triangle]) -> Self {
        Box::<[Triangle]>::from(triangles).into()
    }
}

impl<const N: usize> From<[Triangle; N]> for SharedTriangles {
    fn from(triangles: [Triangle; N]) -> Self {
        triangles[..].into()
    }
}

/// The triangles of an object, borrowed: a slice, or a mesh with a transform, whose triangles are placed as
/// they are read.
///
/// ```
/// use visibility_core::{glam::Vec3, scene::Triangles};
/// let slice = [[Vec3::ZERO, Vec3::X, Vec3::Y]];
/// let triangles = Triangles::from(&slice[..]);
/// assert_eq!((triangles.len(), triangles.get(0), triangles.get(1)), (1, Some(slice[0]), None));
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Triangles<'a> {
    mesh: &'a [Triangle],
    transform: Option<DAffine3>,
    /// Box around the triangles in the coordinates of the mesh. `None` if it is unknown, or the transform is
    /// kept in `f64`.
    mesh_bounds: Option<&'a Aabb>,
}

impl<'a> Triangles<'a> {
    /// Returns the number of triangles.
    #[inline]
    pub fn len(&self) -> usize {
        self.mesh.len()
    }

    /// Returns whether there are no triangles.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.mesh.is_empty()
    }

    /// Returns the triangle at an index, in scene coordinates. `None` beyond the last.
    #[inline]
    pub fn get(&self, index: usize) -> Option<Triangle> {
        self.mesh.get(index).map(|triangle| Placement::of(self.transform).place(triangle))
    }

    /// Returns the first triangle, in scene coordinates. `None` without triangles.
    #[inline]
    pub fn first(&self) -> Option<Triangle> {
        self.get(0)
    }

    /// Returns all triangles in scene coordinates, in their order.
    #[inline]
    pub fn iter(&self) -> TriangleIter<'a> {
        TriangleIter { rest: self.mesh.iter(), placement: Placement::of(self.transform) }
    }

    /// Returns a copy of all triangles in scene coordinates.
    pub fn to_vec(&self) -> Vec<Triangle> {
        self.iter().collect()
    }

    /// Returns a box around the triangles in scene coordinates, if one is known without visiting them: for
    /// [`SharedTriangles`], unless their transform is kept in `f64`. Without a transform this is the smallest
    /// box, otherwise the box around the image of the mesh's box. NaN if a coordinate is NaN.
    pub fn known_bounds(&self) -> Option<Aabb> {
        let bounds = self.mesh_bounds?;
        Some(self.transform.map_or(*bounds, |transform| bounds.transformed(&rounded(&transform).into())))
    }

    /// Returns whether it is certain which side of each triangle is its front. False if the triangles are
    /// placed by a transform of which rounding leaves uncertain whether it mirrors, as of one that flattens.
    /// Cullers then count a [one-sided](crate::Object::one_sided) object as seen from both sides, and let it
    /// hide nothing.
    ///
    /// ```
    /// use visibility_core::glam::{DAffine3, DVec3, Vec3};
    /// use visibility_core::scene::SharedTriangles;
    /// let leaf = SharedTriangles::from([[Vec3::ZERO, Vec3::X, Vec3::Y]]);
    /// let scaled = |z| leaf.placed(DAffine3::from_scale(DVec3::new(1.0, 1.0, z)));
    /// assert!(scaled(-1.0).view().has_certain_fronts());
    /// assert!(!scaled(0.0).view().has_certain_fronts());
    /// ```
    #[inline]
    pub fn has_certain_fronts(&self) -> bool {
        self.transform.is_none_or(|transform| keeps_orientation_64(&transform.matrix3).is_some())
    }

    /// Returns the triangles in the coordinates of their mesh, and the transform from these to scene
    /// coordinates, which is `None` where both are the same.
    #[inline]
    pub fn mesh(&self) -> (&'a [Triangle], Option<DAffine3>) {
        (self.mesh, self.transform)
    }
}

impl PartialEq for Triangles<'_> {
    /// Compares the triangles in scene coordinates.
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

impl<'a> From<&'a [Triangle]> for Triangles<'a> {
    fn from(mesh: &'a [Triangle]) -> Self {
        Self { mesh, transform: None, mesh_bounds: None }
    }
}

impl<'a, const N: usize> From<&'a [Triangle; N]> for Triangles<'a> {
    fn from(mesh: &'a [Triangle; N]) -> Self {
        mesh[..].into()
    }
}

impl<'a> From<&'a SharedTriangles> for Triangles<'a> {
    fn from(triangles: &'a SharedTriangles) -> Self {
        triangles.view()
    }
}

impl<'a> IntoIterator for Triangles<'a> {
    type Item = Triangle;
    type IntoIter = TriangleIter<'a>;

    #[inline]
    fn into_iter(self) -> TriangleIter<'a> {
        self.iter()
    }
}

impl<'a> IntoIterator for &'a SharedTriangles {
    type Item = Triangle;
    type IntoIter = TriangleIter<'a>;

    #[inline]
    fn into_iter(self) -> TriangleIter<'a> {
        self.view().iter()
    }
}

/// Iterator over the triangles of an object, in scene coordinates.
#[derive(Clone, Debug)]
pub struct TriangleIter<'a> {
    rest: slice::Iter<'a, Triangle>,
    placement: Placement,
}

impl Iterator for TriangleIter<'_> {
    type Item = Triangle;

    #[inline]
    fn next(&mut self) -> Option<Triangle> {
        self.rest.next().map(|triangle| self.placement.place(triangle))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.rest.size_hint()
    }
}

impl ExactSizeIterator for TriangleIter<'_> {}

/// Way in which the triangles of a mesh are transformed to the scene as they are read.
#[derive(Clone, Copy, Debug)]
enum Placement {
    InScene,
    Moved(DAffine3),
    Mirrored(DAffine3),
}

impl Placement {
    #[inline]
    fn of(transform: Option<DAffine3>) -> Self {
        match transform {
            None => Self::InScene,
            Some(transform) if keeps_orientation_64(&transform.matrix3) == Some(false) => {
                Self::Mirrored(transform)
            }
            Some(transform) => Self::Moved(transform),
        }
    }

    #[inline]
    fn place(&self, triangle: &Triangle) -> Triangle {
        match self {
            Self::InScene => *triangle,
            Self::Moved(transform) => triangle.map(|p| place(transform, p)),
            Self::Mirrored(transform) => {
                let [a, b, c] = triangle.map(|p| place(transform, p));
                [a, c, b]
            }
        }
    }
}

#[inline]
fn place(transform: &DAffine3, point: Vec3) -> Vec3 {
    transform.transform_point3(point.as_dvec3()).as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;
    use visibility_testing::Random;

    /// Returns a box that spans a range along x, and ten metres along y and z.
    fn along_x(least: f32, most: f32) -> Aabb {
        Aabb::from_arrays([least, 0.0, 0.0], [most, 10.0, 10.0])
    }

    /// Returns a transform that scales along x and moves along it.
    fn by_x(scale: f64, shift: f64) -> DAffine3 {
        DAffine3 { matrix3: DMat3::from_diagonal(DVec3::new(scale, 1.0, 1.0)), translation: DVec3::X * shift }
    }

    /// Steps of `f64` beside 1 that `f32` rounds to 1.
    const U: f64 = 1.0 / (1 << 24) as f64;

    /// A transform is rounded if that moves vertices by at most four units of round-off of the greatest
    /// coordinate on each axis.
    #[test]
    fn transforms_are_rounded_where_coordinates_are_large_enough() {
        // The image is from 0 to the box's end, and moves by a unit.
        for (end, is_rounded) in [(-0.7, true), (-0.75, true), (-0.8, false)] {
            let bounds = along_x(-1.0, end);
            assert_eq!(can_be_rounded(&by_x(1.0, 1.0 + U), &bounds), is_rounded, "an image to {}", end + 1.0);
        }
        // The image is within 0.45, and moves by as many units as the vertices' greatest coordinate.
        for (scale, is_rounded) in [(1.0, true), (1.0 + U, false)] {
            let bounds = along_x(1.0625, 1.9375);
            assert_eq!(can_be_rounded(&by_x(scale, -1.5), &bounds), is_rounded, "scaled by {scale}");
            let bounds = along_x(-1.9375, -1.0625);
            assert_eq!(can_be_rounded(&by_x(scale, 1.5), &bounds), is_rounded, "scaled by {scale}, turned");
        }
    }

    /// Terms that cancel in `f32` are at most four times the greatest coordinate.
    #[test]
    fn transforms_whose_terms_cancel_are_kept() {
        for (end, is_rounded) in [(-0.5, true), (-0.51, false)] {
            let bounds = Aabb::from_arrays([-1.0, 0.0, 0.0], [end, 0.1, 0.1]);
            assert_eq!(can_be_rounded(&by_x(1.0, 1.0), &bounds), is_rounded, "an image to {}", end + 1.0);
        }
    }

    /// Transforms that `f32` does not hold, or of which it does not tell whether they mirror, are kept.
    #[test]
    fn transforms_that_rounding_changes_in_kind_are_kept() {
        let bounds = along_x(0.0, 1.0);
        for scale in [1e39, 1e300, f64::INFINITY, f64::NAN] {
            assert!(!can_be_rounded(&by_x(1.0, scale), &bounds), "moved by {scale}");
            assert!(!can_be_rounded(&by_x(scale, 0.0), &bounds), "scaled by {scale}");
        }
        assert!(can_be_rounded(&by_x(1.0, 1e30), &bounds), "moved by a number of single precision");
        // Columns that are as good as parallel in single precision, and are not.
        let [x, y] = [DVec3::new(1.0, 1.0, 0.0), DVec3::new(1.0, 1.0 + 1e-9, 0.0)];
        for columns in [[x, y, DVec3::Z], [y, x, DVec3::Z]] {
            let transform = DAffine3::from_mat3(DMat3::from_cols(columns[0], columns[1], columns[2]));
            assert!(keeps_orientation_64(&transform.matrix3).is_some(), "it is known whether it mirrors");
            assert!(!can_be_rounded(&transform, &bounds), "{columns:?} is not rounded");
        }
    }

    /// Rounding moves the corners of a box no more than it says, however the box is turned and moved.
    #[test]
    fn rounded_transforms_move_vertices_little() {
        let mut random = Random(1);
        let mut counts = [0; 2];
        for trial in 0..20_000 {
            let far = [0.0, 1.0, 10.0, 1e3][trial % 4];
            let middle = random.vector(far);
            let half = random.fine_vector(1.0).abs();
            let bounds = Aabb::new((middle - half).as_vec3(), (middle + half).as_vec3());
            let turn = DQuat::from_axis_angle(random.direction(), random.fine_unit() * 7.0);
            let scale = random.fine_vector(2.0);
            let turned = DAffine3::from_scale_rotation_translation(scale, turn, DVec3::ZERO);
            let shift = random.fine_vector(1.0) - turned.transform_point3(middle);
            let transform = DAffine3 { translation: shift, ..turned };
            let is_rounded = can_be_rounded(&transform, &bounds);
            counts[usize::from(is_rounded)] += 1;
            if !is_rounded {
                continue;
            }
            let near = exact(rounded(&transform));
            let corners = bounds.corners().map(|p| p.as_dvec3());
            let images = corners.map(|p| transform.transform_point3(p));
            let most = images.into_iter().fold(DVec3::ZERO, |most, p| most.max(p.abs()));
            for (corner, image) in corners.into_iter().zip(images) {
                let moved = (near.transform_point3(corner) - image).abs();
                assert!(
                    moved.cmple(most * (4.0001 * U)).all(),
                    "trial {trial}: {corner} moves by {moved}, of {most}"
                );
            }
        }
        assert!(counts.iter().all(|&count| count > 3_000), "kept and rounded: {counts:?}");
    }

    #[test]
    fn triangles_are_the_same_if_mesh_and_place_are() {
        let mesh = || SharedTriangles::from([[Vec3::ZERO, Vec3::X, Vec3::Y]]);
        let (a, b, moved) = (mesh(), mesh(), DAffine3::from_translation(DVec3::Z));
        assert!(a.is_same(&a.clone()) && a.placed(moved).is_same(&a.placed(moved)), "one mesh at one place");
        assert!(!a.is_same(&a.placed(moved)), "one mesh at two places");
        assert!(!a.is_same(&b) && !a.placed(moved).is_same(&b.placed(moved)), "two meshes at one place");
    }
}
