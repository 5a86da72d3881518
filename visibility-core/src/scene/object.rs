//! What a scene keeps of an object, and how objects are named.

use crate::Aabb;
use core::fmt;
use glam::Vec3;

/// Three corners in scene coordinates, counter-clockwise as seen from the front.
pub type Triangle = [Vec3; 3];

/// Names an object of a [`Scene`](crate::Scene), for as long as the object is in it.
///
/// The index is small and dense (objects inserted one after another into a new scene get 0, 1, 2, ...), so
/// that engines can keep their own data in arrays. An index is used again after removal, with another
/// generation, so that an id kept too long is refused rather than taken for another object.
///
/// ```
/// use visibility_core::{Aabb, Scene};
/// let mut scene = Scene::new();
/// let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
/// assert_eq!(id.index(), 0);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Hash)]
pub struct ObjectId {
    pub(crate) index: u32,
    pub(crate) generation: u32,
}

impl ObjectId {
    pub(crate) const NONE: Self = Self { index: u32::MAX, generation: 0 };

    /// The index of the object, for arrays beside the scene.
    pub const fn index(self) -> usize {
        self.index as usize
    }

    /// How often the index was used before.
    pub const fn generation(self) -> u32 {
        self.generation
    }
}

impl fmt::Display for ObjectId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.index)?;
        if self.generation != 0 { write!(f, "#{}", self.generation) } else { Ok(()) }
    }
}

/// Names a mesh that a [`Scene`](crate::Scene) keeps for its occluders.
///
/// ```
/// use visibility_core::{glam::Affine3A, Aabb, OccluderMesh, Scene};
/// let bounds = Aabb::from_arrays([0.0; 3], [4.0, 0.2, 3.0]);
/// let mut scene = Scene::new();
/// let (wall, mesh) = (scene.insert(bounds), scene.add_mesh(OccluderMesh::cuboid(&bounds)?));
/// scene.set_mesh(wall, mesh, Affine3A::IDENTITY)?;
/// scene.set_occluder(wall, true)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub struct MeshId(pub(crate) u32);

/// What a scene is told of an object when it is inserted.
///
/// ```
/// use visibility_core::{Aabb, Object, Scene};
/// let mut scene = Scene::new();
/// let wall = Object { cost: 12, occluder: true, ..Object::new(Aabb::from_arrays([0.0; 3], [4.0, 0.2,
///     3.0])) };
/// let id = scene.insert(wall);
/// assert_eq!(scene.object(id), Ok(wall));
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Object {
    /// Contains the object entirely, in every pose until the bounds are set again. Bounds that are not
    /// finite or are inverted are allowed: the object is then never culled.
    pub bounds: Aabb,
    /// The layers that the object is on, a bit each. A view shows objects that share a layer with it.
    pub layers: u32,
    /// What drawing the object costs, in triangles or any other unit, for cullers that have a budget.
    pub cost: u32,
    /// Visible in every view of its layers, whatever any culler finds.
    pub never_cull: bool,
    /// Opaque and solid enough to hide others. Off unless set: glass that is taken for a wall hides what can
    /// be seen.
    pub occluder: bool,
}

impl Object {
    /// An object on all layers, of cost 1, that may be culled and hides nothing.
    pub const fn new(bounds: Aabb) -> Self {
        Self { bounds, layers: u32::MAX, cost: 1, never_cull: false, occluder: false }
    }

    /// Whether no culler may hide the object: on request, or because its bounds bound nothing.
    pub(crate) fn is_unculled(&self) -> bool {
        self.never_cull || !self.bounds.is_finite()
    }
}

impl From<Aabb> for Object {
    fn from(bounds: Aabb) -> Self {
        Self::new(bounds)
    }
}

/// Why a call to a scene was refused; the scene is then unchanged.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SceneError {
    /// There is no such object: it was removed, or belongs to another scene.
    UnknownObject(ObjectId),
    /// There is no such mesh in the scene.
    UnknownMesh(MeshId),
    /// The transform given to an object's mesh is not finite.
    NonFiniteTransform(ObjectId),
    /// The origin is NaN or infinite.
    NonFiniteOrigin,
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownObject(id) => write!(f, "object {id} is not, or no longer, in the scene"),
            Self::UnknownMesh(mesh) => write!(f, "mesh {} is not in the scene", mesh.0),
            Self::NonFiniteTransform(id) => write!(f, "the transform of object {id} is not finite"),
            Self::NonFiniteOrigin => write!(f, "the origin of the scene is not finite"),
        }
    }
}

impl core::error::Error for SceneError {}
