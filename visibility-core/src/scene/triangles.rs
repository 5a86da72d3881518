//! Triangles of objects: those of one object, or those of a mesh that many objects share, each with a
//! transform of its own, so that a mesh is kept once however often a level repeats it.

use super::Triangle;
use crate::Aabb;
use alloc::{boxed::Box, sync::Arc, vec::Vec};
use core::slice;
use glam::{DAffine3, DVec3, Vec3};

/// Triangles that objects share. A clone refers to the same triangles.
///
/// Triangles with a [transform](Self::placed) are placed one by one as they are read, in `f64`, and then
/// rounded to `f32`: they are the same to the last bit as triangles that were placed so beforehand. Memory:
/// 36 bytes for each triangle of the mesh, once, and about 150 bytes for each transform.
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
    mesh: Arc<Mesh>,
    instance: Option<Arc<Instance>>,
}

/// Triangles in coordinates of their own, with the box around them.
#[derive(Debug)]
struct Mesh {
    triangles: Box<[Triangle]>,
    bounds: Aabb,
}

/// Transform from mesh to scene coordinates, with the box around the triangles in scene coordinates.
#[derive(Debug)]
struct Instance {
    transform: DAffine3,
    bounds: Aabb,
}

impl SharedTriangles {
    /// Returns triangles of the same mesh, placed by a transform from the coordinates of the mesh to those of
    /// the scene. It takes the place of a former transform. Visits every triangle once, for their bounds.
    ///
    /// A transform that mirrors (with a negative determinant) turns triangles inside out. Two of their
    /// corners are then exchanged, so that the front of each stays its front.
    #[must_use]
    pub fn placed(&self, transform: DAffine3) -> Self {
        let view = Triangles { transform: Some(&transform), ..self.mesh.view() };
        let bounds = Aabb::from_points(view.iter().flatten());
        Self { mesh: self.mesh.clone(), instance: Some(Arc::new(Instance { transform, bounds })) }
    }

    /// Returns the triangles in scene coordinates.
    pub fn view(&self) -> Triangles<'_> {
        match &self.instance {
            None => self.mesh.view(),
            Some(instance) => Triangles {
                mesh: &self.mesh.triangles,
                transform: Some(&instance.transform),
                bounds: Some(&instance.bounds),
            },
        }
    }

    /// Returns the number of triangles.
    pub fn len(&self) -> usize {
        self.mesh.triangles.len()
    }

    /// Returns whether there are no triangles.
    pub fn is_empty(&self) -> bool {
        self.mesh.triangles.is_empty()
    }

    /// Returns all triangles in scene coordinates, in their order.
    pub fn iter(&self) -> TriangleIter<'_> {
        self.view().iter()
    }

    /// Returns the box around the triangles in scene coordinates, [empty](Aabb::EMPTY) without triangles, NaN
    /// if a coordinate is. Takes constant time.
    pub fn bounds(&self) -> Aabb {
        self.instance.as_ref().map_or(self.mesh.bounds, |instance| instance.bounds)
    }

    /// Returns whether the triangles are those of the same mesh in memory.
    pub fn shares_mesh(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.mesh, &other.mesh)
    }

    /// Returns the number of bytes of the mesh, which all that share it have together.
    pub fn mesh_memory(&self) -> usize {
        size_of::<Mesh>() + size_of_val(&self.mesh.triangles[..])
    }

    /// Returns the box around the triangles in the coordinates of the mesh.
    pub(crate) fn mesh_bounds(&self) -> &Aabb {
        &self.mesh.bounds
    }

    /// Returns the address of the mesh, by which objects that share it are told from others.
    pub(crate) fn mesh_address(&self) -> usize {
        Arc::as_ptr(&self.mesh).addr()
    }
}

impl PartialEq for SharedTriangles {
    /// Compares the triangles in scene coordinates.
    fn eq(&self, other: &Self) -> bool {
        self.view() == other.view()
    }
}

impl Mesh {
    fn view(&self) -> Triangles<'_> {
        Triangles { mesh: &self.triangles, transform: None, bounds: Some(&self.bounds) }
    }
}

impl From<Box<[Triangle]>> for SharedTriangles {
    /// Takes triangles in scene coordinates, or in those of a mesh that is to be [placed](Self::placed).
    fn from(triangles: Box<[Triangle]>) -> Self {
        let bounds = Aabb::from_points(triangles.as_flattened().iter().copied());
        Self { mesh: Arc::new(Mesh { triangles, bounds }), instance: None }
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
    transform: Option<&'a DAffine3>,
    /// Box around the placed triangles, if it is known.
    bounds: Option<&'a Aabb>,
}

impl<'a> Triangles<'a> {
    /// Returns the number of triangles.
    pub fn len(&self) -> usize {
        self.mesh.len()
    }

    /// Returns whether there are no triangles.
    pub fn is_empty(&self) -> bool {
        self.mesh.is_empty()
    }

    /// Returns the triangle at an index, in scene coordinates. `None` beyond the last.
    pub fn get(&self, index: usize) -> Option<Triangle> {
        self.mesh.get(index).map(|triangle| Placement::of(self.transform).place(triangle))
    }

    /// Returns the first triangle, in scene coordinates. `None` without triangles.
    pub fn first(&self) -> Option<Triangle> {
        self.get(0)
    }

    /// Returns all triangles in scene coordinates, in their order.
    pub fn iter(&self) -> TriangleIter<'a> {
        TriangleIter { rest: self.mesh.iter(), placement: Placement::of(self.transform) }
    }

    /// Returns a copy of all triangles in scene coordinates.
    pub fn to_vec(&self) -> Vec<Triangle> {
        self.iter().collect()
    }

    /// Returns the box around the triangles in scene coordinates, if it is known without visiting them: for
    /// those of [`SharedTriangles`], and so of all objects of a scene. NaN if a coordinate is.
    pub fn known_bounds(&self) -> Option<&'a Aabb> {
        self.bounds
    }

    /// Returns the triangles in the coordinates of their mesh, and the transform from these to scene
    /// coordinates, which is `None` where both are the same.
    pub fn mesh(&self) -> (&'a [Triangle], Option<&'a DAffine3>) {
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
        Self { mesh, transform: None, bounds: None }
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

    fn into_iter(self) -> TriangleIter<'a> {
        self.iter()
    }
}

impl<'a> IntoIterator for &'a SharedTriangles {
    type Item = Triangle;
    type IntoIter = TriangleIter<'a>;

    fn into_iter(self) -> TriangleIter<'a> {
        self.view().iter()
    }
}

/// Iterator over the triangles of an object, in scene coordinates.
#[derive(Clone, Debug)]
pub struct TriangleIter<'a> {
    rest: slice::Iter<'a, Triangle>,
    placement: Placement<'a>,
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

/// How the triangles of a mesh are placed in the scene as they are read.
#[derive(Clone, Copy, Debug)]
enum Placement<'a> {
    InScene,
    Moved(&'a DAffine3),
    Mirrored(&'a DAffine3),
}

impl<'a> Placement<'a> {
    fn of(transform: Option<&'a DAffine3>) -> Self {
        match transform {
            None => Self::InScene,
            Some(transform) if transform.matrix3.determinant() < 0.0 => Self::Mirrored(transform),
            Some(transform) => Self::Moved(transform),
        }
    }

    #[inline]
    fn place(self, triangle: &Triangle) -> Triangle {
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
    let DAffine3 { matrix3: m, translation } = transform;
    let p: DVec3 = point.as_dvec3();
    (m.x_axis * p.x + m.y_axis * p.y + m.z_axis * p.z + *translation).as_vec3()
}
