//! Scenes, and how objects come into them.

use crate::cullers::Kept;
use crate::error::refused;
use numpy::PyArray1;
use pyo3::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};
use visibility_core::geometry::DoubleDouble;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::occlusion::{Preparation, prepare};
use visibility_core::scene::Triangle;
use visibility_core::{Aabb, Object, ObjectId, OccluderMesh, scene};
use visibility_occluders::LevelOccluders;

/// Objects with boxes and triangles, of which cameras and regions see some.
///
/// Objects are numbered from 0 in the order in which they are added. Coordinates are in metres, of any axes;
/// they are kept in single precision relative to origin, so choose an origin amid the scene. two_sided:
/// whether triangles show and hide from behind as well, for models whose faces do not all face outwards.
/// Without it, in add_mesh as well, no method lets a triangle hide what is seen past its back.
#[pyclass(module = "visibility", subclass)]
pub(crate) struct Scene {
    pub(crate) scene: scene::Scene,
    pub(crate) two_sided: bool,
    /// Large occluders made of the triangles of many objects.
    pub(crate) level: Option<Arc<LevelOccluders>>,
    /// Pipelines kept from call to call, so that their memory is, and the occluders of their stages.
    pub(crate) kept: Mutex<Kept>,
}

/// Returns the least `f32` that is not below `x - origin`.
fn rounded_up(x: f64, origin: f64) -> f32 {
    let DoubleDouble { hi, lo } = DoubleDouble::difference(x, origin);
    let nearest = hi as f32;
    if f64::from(nearest) - hi < lo { nearest.next_up() } else { nearest }
}

impl Scene {
    pub(crate) fn scene(&self) -> &scene::Scene {
        &self.scene
    }

    /// Returns a box of the scene that contains a box of the world.
    pub(crate) fn bounds_of(&self, [a, b, c, d, e, f]: [f64; 6]) -> Aabb {
        Aabb::from_world(DVec3::new(a, b, c), DVec3::new(d, e, f), self.scene.origin())
    }

    /// Returns a point of the world relative to the scene's origin, rounded to the nearest.
    pub(crate) fn relative(&self, point: [f64; 3]) -> Vec3 {
        (DVec3::from_array(point) - self.scene.origin()).as_vec3()
    }

    /// Returns the triangles of a solid box, and whether it may hide: its corners are rounded inwards, so
    /// that it hides no more than the box as given. A box within which there is no number of `f32` is drawn
    /// with sides rounded to the nearest, and hides nothing. `None` for a box that is turned inside out.
    pub(crate) fn box_triangles(&self, [a, b, c, d, e, f]: [f64; 6]) -> Option<(Vec<Triangle>, bool)> {
        let origin = self.scene.origin().to_array();
        let sides = [(a, d), (b, e), (c, f)];
        let mut hides = true;
        let inwards = [0, 1, 2].map(|axis| {
            let ((min, max), origin) = (sides[axis], origin[axis]);
            let (low, high) = (rounded_up(min, origin), -rounded_up(-max, -origin));
            hides &= low <= high;
            if low <= high { (low, high) } else { ((min - origin) as f32, (max - origin) as f32) }
        });
        let corners = Aabb::from_arrays(inwards.map(|side| side.0), inwards.map(|side| side.1));
        let corners = corners.is_proper().then(|| corners.corners())?;
        let triangle = |indices: [u32; 3]| {
            let [a, b, c] = indices.map(|index| corners.get(index as usize).copied());
            Some([a?, b?, c?])
        };
        Some((OccluderMesh::CUBOID.into_iter().map(triangle).collect::<Option<_>>()?, hides))
    }

    /// Inserts an object. With triangles it may hide others. `two_sided` as for the scene, which `None`
    /// means.
    pub(crate) fn insert(
        &mut self,
        bounds: Aabb,
        triangles: Option<Vec<Triangle>>,
        occluder: bool,
        two_sided: Option<bool>,
    ) -> PyResult<ObjectId> {
        let occluder = occluder && triangles.is_some();
        let two_sided = two_sided.unwrap_or(self.two_sided);
        // Also what joins occluders, proves and bakes reads the flag, beside the mesh that is prepared below.
        let id = self.scene.insert(Object { occluder, one_sided: !two_sided, ..Object::new(bounds) });
        if let Some(triangles) = triangles {
            let settings = Preparation::default().with_two_sided(two_sided);
            let mesh = if occluder { prepare(&triangles, &settings) } else { None };
            let placed = self.scene.set_triangles(id, triangles).and_then(|()| {
                let Some(mesh) = mesh else { return Ok(()) };
                let mesh = self.scene.add_mesh(mesh);
                self.scene.set_mesh(id, mesh, Affine3A::IDENTITY)
            });
            placed.map_err(|error| refused("positions", error))?;
        }
        if occluder {
            self.level = None;
            self.forget_occluders();
        } else {
            self.boxes_changed();
        }
        Ok(id)
    }

    /// Drops the pipelines and occluders that are kept: there are other occluders, or other joined ones.
    pub(crate) fn forget_occluders(&mut self) {
        *self.kept.get_mut().unwrap_or_else(PoisonError::into_inner) = Kept::default();
    }

    /// Notes that objects that hide nothing have come or moved.
    pub(crate) fn boxes_changed(&mut self) {
        self.kept.get_mut().unwrap_or_else(PoisonError::into_inner).scene_changed();
    }

    /// Makes a mask of objects.
    pub(crate) fn mask(&self, ids: impl IntoIterator<Item = ObjectId>) -> Vec<bool> {
        let mut mask = vec![false; self.scene.index_limit()];
        for id in ids {
            if let Some(seen) = mask.get_mut(id.index()) {
                *seen = true;
            }
        }
        mask
    }
}

/// Makes an array of the numbers of objects, ascending.
pub(crate) fn ids_array<'py>(
    py: Python<'py>,
    ids: impl IntoIterator<Item = ObjectId>,
) -> Bound<'py, PyArray1<u32>> {
    let mut numbers: Vec<u32> = ids.into_iter().map(|id| id.index() as u32).collect();
    numbers.sort_unstable();
    PyArray1::from_vec(py, numbers)
}
