//! Properties of a level's objects without their triangles, and hashes of the data that a bake depends on.

use visibility_core::binary_format::Fingerprint;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::level_version::{level_object, object_hash};
use visibility_core::scene::{Triangles, holds_nearly};
use visibility_core::{Aabb, Object, ObjectId, OccluderMesh, Scene};

/// Properties of an object, without its triangles and its occluder mesh.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct ObjectFacts {
    /// Bounds, enlarged to hold the object's triangles and occluder mesh, which may reach out of the given
    /// bounds by rounding.
    pub bounds: Aabb,
    /// Bounds as they were given.
    pub given: Aabb,
    /// Hash of the object with its triangles and occluder mesh, but without its index.
    pub hash: u64,
    /// Index of the object in its scene.
    pub index: u32,
    pub cost: u32,
    pub layers: u32,
    /// Number of the object's triangles.
    pub triangles: u32,
    pub never_cull: bool,
    pub occluder: bool,
    pub one_sided: bool,
    pub see_through: bool,
}

impl ObjectFacts {
    pub(crate) fn new(
        index: u32,
        object: &Object,
        triangles: Triangles<'_>,
        mesh: Option<(&OccluderMesh, Affine3A)>,
    ) -> Self {
        let Object { bounds: given, layers, cost, never_cull, occluder, one_sided, see_through } = *object;
        let hash = object_hash(object, triangles, mesh);
        let content = Aabb::from_points(triangles.iter().flatten().filter(|p| p.is_finite()));
        let content =
            mesh.map_or(content, |(mesh, transform)| content.union(&mesh.placed_bounds(&transform)));
        let is_enlarged = given.is_finite() && holds_nearly(&given, &content);
        let bounds = if is_enlarged { given.union(&content) } else { given };
        let triangles = triangles.len() as u32;
        Self {
            bounds,
            given,
            hash,
            index,
            cost,
            layers,
            triangles,
            never_cull,
            occluder,
            one_sided,
            see_through,
        }
    }

    /// Returns the properties of an object of a scene, [as a level counts it](level_object). `None` if the
    /// scene has no such object.
    pub(crate) fn of(scene: &Scene, id: ObjectId) -> Option<Self> {
        let (object, mesh) = level_object(scene, id)?;
        let triangles = scene.triangles(id).unwrap_or_default();
        Some(Self::new(id.index() as u32, &object, triangles, mesh))
    }

    /// Returns the object with the bounds that were given.
    pub(crate) fn object(&self) -> Object {
        let Self { given, layers, cost, never_cull, occluder, one_sided, see_through, .. } = *self;
        Object { bounds: given, layers, cost, never_cull, occluder, one_sided, see_through }
    }

    /// Returns the object with the enlarged bounds, for scenes without its triangles.
    pub(crate) fn enlarged_object(&self) -> Object {
        Object { bounds: self.bounds, ..self.object() }
    }

    /// Returns whether the object counts as visible from everywhere.
    pub(crate) fn is_unculled(&self) -> bool {
        self.never_cull || !self.bounds.is_finite()
    }

    /// Returns the weight of the object, which estimates the time and memory of a sweep: its number of
    /// triangles plus 4.
    pub(crate) fn weight(&self) -> u64 {
        4 + u64::from(self.triangles)
    }
}

/// Returns a hash of the origin of a scene, and of the indices and bounds of its objects.
pub(crate) fn bounds_fingerprint(origin: DVec3, objects: impl IntoIterator<Item = (u32, Aabb)>) -> u64 {
    let with = |hash: Fingerprint, (index, bounds): (u32, Aabb)| {
        hash.with(index).with_vec3(bounds.min).with_vec3(bounds.max)
    };
    objects.into_iter().fold(Fingerprint::new().with_dvec3(origin), with).value()
}
