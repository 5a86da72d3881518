//! The description of an object that a scene stores, the ids of objects and meshes, and the errors of a
//! scene.

use crate::Aabb;
use core::fmt;
use glam::Vec3;

/// The three corners of a triangle in scene coordinates, counter-clockwise as seen from the front side.
pub type Triangle = [Vec3; 3];

/// Identifies an object of a [`Scene`](crate::Scene) for as long as the object is in the scene.
///
/// An id consists of an index and a generation. Indices are small and dense (objects inserted one after
/// another into a new scene get 0, 1, 2, ...), so engines can keep their own data in arrays. After removal,
/// an index may be reused with another generation; an outdated id is therefore rejected instead of naming
/// another object.
///
/// Generations of each scene start at another number, so an id of another scene is rejected too. The starts
/// of the first 1,000 scenes of a process are more than a million apart: an id of another scene could be
/// taken for one of this scene only after its index was reused a million times. A clone of a scene has the
/// objects of the original under the same ids; after that, objects that reuse the same index in the original
/// and in the clone get equal ids.
///
/// ```
/// use visibility_core::{Aabb, Scene};
/// let mut scene = Scene::new();
/// let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
/// assert_eq!(id.index(), 0);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Hash)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::Pod, bytemuck::Zeroable))]
#[repr(C)]
pub struct ObjectId {
    pub(crate) index: u32,
    pub(crate) generation: u32,
}

impl ObjectId {
    /// The id of no object in any scene, for fields that are set later.
    pub const PLACEHOLDER: Self = Self { index: u32::MAX, generation: 0 };

    /// Returns the id as a number for engines and files that store numbers: the index in the lower half, the
    /// generation in the upper.
    ///
    /// ```
    /// use visibility_core::ObjectId;
    /// assert_eq!(ObjectId::from_bits(ObjectId::PLACEHOLDER.to_bits()), ObjectId::PLACEHOLDER);
    /// ```
    pub const fn to_bits(self) -> u64 {
        (self.generation as u64) << 32 | self.index as u64
    }

    /// Returns the id that [`to_bits`](Self::to_bits) made `bits` of. Any other number gives an id that a
    /// scene may not know, or may know as another object.
    pub const fn from_bits(bits: u64) -> Self {
        Self { index: bits as u32, generation: (bits >> 32) as u32 }
    }

    /// Returns the object's index, which is below [`Scene::index_limit`](crate::Scene::index_limit), for
    /// arrays indexed by object.
    pub const fn index(self) -> usize {
        self.index as usize
    }

    /// Returns the number that tells apart the objects that have the same index one after another. Differs
    /// from scene to scene and from run to run, so nothing that is stored may depend on it.
    pub const fn generation(self) -> u32 {
        self.generation
    }
}

impl fmt::Display for ObjectId {
    /// Writes the index alone, so that output is the same in every run.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.index)
    }
}

/// Identifies an occluder mesh stored in a [`Scene`](crate::Scene); any number of objects can use the mesh.
///
/// An id consists of an index and a generation, as an [`ObjectId`] does. The id of a mesh that was
/// [removed](crate::Scene::remove_mesh) is rejected, even if another mesh has reused the index. An id of
/// another scene is rejected within the limits that [`ObjectId`] states.
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
pub struct MeshId {
    pub(crate) index: u32,
    pub(crate) generation: u32,
}

impl MeshId {
    /// Returns the id as a number for engines that store numbers: the index in the lower half, the
    /// generation in the upper.
    ///
    /// ```
    /// use visibility_core::{Aabb, OccluderMesh, Scene, scene::MeshId};
    /// let mut scene = Scene::new();
    /// let mesh = scene.add_mesh(OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [1.0; 3]))?);
    /// assert_eq!(MeshId::from_bits(mesh.to_bits()), mesh);
    /// # Ok::<(), visibility_core::occlusion::MeshError>(())
    /// ```
    pub const fn to_bits(self) -> u64 {
        (self.generation as u64) << 32 | self.index as u64
    }

    /// Returns the id that [`to_bits`](Self::to_bits) made `bits` of. Any other number gives an id that a
    /// scene may not know, or may know as another mesh.
    pub const fn from_bits(bits: u64) -> Self {
        Self { index: bits as u32, generation: (bits >> 32) as u32 }
    }
}

/// The properties of an object, as given to [`Scene::insert`](crate::Scene::insert).
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
    /// Bounding box relative to the scene's origin. It must contain the whole object in every pose until the
    /// bounds are set again. An inverted box, or one with NaN or infinite coordinates, is accepted: the
    /// object is then never culled.
    pub bounds: Aabb,
    /// The layers that the object is on, one bit per layer. A view shows objects that share a layer with it;
    /// an object with mask 0 is in no view.
    pub layers: u32,
    /// Cost of drawing the object, in triangles or any other unit, for cullers that have a budget.
    pub cost: u32,
    /// Whether the object is exempt from culling: visible in every view that shares a layer with it,
    /// whatever the cullers find. Such an object hides nothing, even if flagged as an
    /// [`occluder`](Self::occluder): it may be elsewhere than its bounds, mesh and triangles say.
    pub never_cull: bool,
    /// Whether the object is opaque and may hide others. False by default, because a transparent object used
    /// as an occluder hides visible objects. An object that [fades](crate::scene::DrawRange::fades) hides
    /// nothing, even if flagged.
    pub occluder: bool,
    /// Whether objects behind the object are drawn through it: glass, blended and alpha-tested surfaces.
    /// False by default. Such an object must not be an [`occluder`](Self::occluder): cullers do not read
    /// `see_through` and would let it hide others. Only code that makes levels leaves out see-through
    /// occluders. Reference renderers of the [triangles](crate::Scene::set_triangles) read `see_through`,
    /// since an opaque object that is no occluder still covers pixels.
    pub see_through: bool,
    /// Whether the object's [triangles](crate::Scene::set_triangles) are drawn from their front alone, as
    /// with backface culling: from behind they are invisible and occlude nothing. False by default: triangles
    /// of unknown orientation are drawn from both sides.
    pub one_sided: bool,
}

impl Object {
    /// Creates an object with the given bounds on all layers, with cost 1, that can be culled, is no
    /// occluder, and is drawn opaque from both sides.
    pub const fn new(bounds: Aabb) -> Self {
        Self {
            bounds,
            layers: u32::MAX,
            cost: 1,
            never_cull: false,
            occluder: false,
            see_through: false,
            one_sided: false,
        }
    }

    /// Returns whether no culler may remove the object: because it is flagged as never culled, or because its
    /// bounds are inverted, NaN or infinite. Such an object hides nothing.
    pub fn is_unculled(&self) -> bool {
        is_unculled(&self.bounds, self.never_cull)
    }
}

/// Returns whether no culler may remove an object with bounds `bounds`: because its flag `never_cull` is
/// true, or because the bounds are inverted, NaN or infinite.
pub(super) fn is_unculled(bounds: &Aabb, never_cull: bool) -> bool {
    never_cull || !bounds.is_finite()
}

impl From<Aabb> for Object {
    fn from(bounds: Aabb) -> Self {
        Self::new(bounds)
    }
}

/// Why a call to a [`Scene`](crate::Scene) failed. The scene is unchanged by a failed call.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum SceneError {
    /// The scene has no object with this id: the object was removed, or the id is of another scene.
    UnknownObject(ObjectId),
    /// The scene has no occluder mesh with this id: the mesh was removed, or the id is of another scene.
    UnknownMesh(MeshId),
    /// The transform for this object has a NaN or infinite element.
    Transform(ObjectId),
    /// The bounds of this object are given in scene coordinates, so that no transform can move them:
    /// [`Scene::set_local_bounds`](crate::Scene::set_local_bounds) was not called, or
    /// [`Scene::set_bounds`](crate::Scene::set_bounds) was called after it.
    NoLocalBounds(ObjectId),
    /// A triangle for this object reaches out of the object's bounds by more than rounding: the triangles or
    /// the bounds are in other coordinates than those of the scene, or belong to another object.
    Triangles(ObjectId),
    /// The origin for the scene has a NaN or infinite coordinate.
    Origin,
    /// The draw range for this object has a NaN, a negative or infinite `begin`, an `end` less than `begin`,
    /// or a negative `margin`.
    DrawRange(ObjectId),
    /// The HLOD parent given for this object is the object itself or one of its descendants.
    Parent(ObjectId),
    /// With the HLOD parent given for this object, the object or one of its descendants would have more than
    /// 64 parents above it.
    TooManyParents(ObjectId),
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownObject(id) => write!(f, "object {id} is not, or no longer, in the scene"),
            Self::UnknownMesh(mesh) => write!(f, "mesh {} is not, or no longer, in the scene", mesh.index),
            Self::Transform(id) => write!(f, "the transform of object {id} is not finite"),
            Self::NoLocalBounds(id) => {
                write!(f, "object {id} has no local bounds that a transform could move")
            }
            Self::Triangles(id) => {
                write!(f, "the triangles of object {id} reach out of its bounds, in scene coordinates")
            }
            Self::Origin => write!(f, "the origin of the scene is not finite"),
            Self::DrawRange(id) => write!(f, "the draw range of object {id} is not a range"),
            Self::Parent(id) => write!(f, "the HLOD parent of object {id} is below the object itself"),
            Self::TooManyParents(id) => {
                write!(f, "object {id} or one below it would have more than 64 HLOD parents above it")
            }
        }
    }
}

impl core::error::Error for SceneError {}
