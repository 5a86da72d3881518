//! The objects of a level without their triangles, and hashes of what a bake depends on.

use visibility_core::binary_format::Fingerprint;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::scene::Triangle;
use visibility_core::{Aabb, Object, ObjectId, OccluderMesh, Scene};

/// An object without its triangles and its occluder mesh.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct ObjectFacts {
    pub bounds: Aabb,
    /// Hash of the object with its triangles and occluder mesh, without the index.
    pub hash: u64,
    /// Index of the object in its scene.
    pub index: u32,
    pub cost: u32,
    pub layers: u32,
    /// Number of triangles.
    pub triangles: u32,
    pub never_cull: bool,
    pub occluder: bool,
    pub one_sided: bool,
}

impl ObjectFacts {
    pub(crate) fn new(
        index: u32,
        object: &Object,
        triangles: &[Triangle],
        mesh: Option<(&OccluderMesh, &Affine3A)>,
    ) -> Self {
        let Object { bounds, layers, cost, never_cull, occluder, one_sided, .. } = *object;
        let hash = object_hash(object, triangles, mesh);
        let triangles = triangles.len() as u32;
        Self { bounds, hash, index, cost, layers, triangles, never_cull, occluder, one_sided }
    }

    /// Returns the facts of an object of a scene. `None` if the scene has no such object.
    pub(crate) fn of(scene: &Scene, id: ObjectId) -> Option<Self> {
        let object = scene.object(id).ok()?;
        let triangles = scene.triangles(id).unwrap_or_default();
        Some(Self::new(id.index() as u32, &object, triangles, scene.occluder(id)))
    }

    pub(crate) fn object(&self) -> Object {
        let Self { bounds, layers, cost, never_cull, occluder, one_sided, .. } = *self;
        Object { layers, cost, never_cull, occluder, one_sided, ..Object::new(bounds) }
    }

    /// Returns whether the object counts as visible from everywhere.
    pub(crate) fn is_unculled(&self) -> bool {
        self.never_cull || !self.bounds.is_finite()
    }

    /// Returns the weight of the object, which estimates time and memory of a sweep: its triangles and 4.
    pub(crate) fn weight(&self) -> u64 {
        4 + u64::from(self.triangles)
    }
}

/// Returns a hash of all that a bake depends on: bounds, layers, cost, flags, triangles and occluder mesh,
/// but not the index, and not whether the object is see-through: a bake asks whether it is an occluder.
fn object_hash(object: &Object, triangles: &[Triangle], mesh: Option<(&OccluderMesh, &Affine3A)>) -> u64 {
    let flags =
        u32::from(object.never_cull) | u32::from(object.occluder) << 1 | u32::from(object.one_sided) << 2;
    let hash = point(point(Fingerprint::new(), object.bounds.min), object.bounds.max);
    let hash = hash.with(object.layers).with(object.cost).with(flags).with(triangles.len() as u32);
    let mut hash = triangles.as_flattened().iter().fold(hash, |hash, &p| point(hash, p));
    if let Some((mesh, transform)) = mesh {
        hash = hash.with(u32::from(mesh.is_two_sided())).with(mesh.positions().len() as u32);
        hash = mesh.positions().iter().fold(hash, |hash, &p| point(hash, p));
        hash = mesh.triangles().as_flattened().iter().fold(hash, |hash, &corner| hash.with(corner));
        hash = transform.to_cols_array().iter().fold(hash, |hash, x| hash.with(x.to_bits()));
    }
    hash.value()
}

/// Returns the version of a level: a hash of the origin, and of the index and the [content
/// hash](ObjectFacts::hash) of each object.
pub(crate) fn version(origin: DVec3, objects: impl IntoIterator<Item = (u32, u64)>) -> u64 {
    let with = |hash: Fingerprint, (index, content): (u32, u64)| hash.with(index).with_u64(content);
    objects.into_iter().fold(with_origin(origin), with).value()
}

/// Returns the version of a scene as a level: a hash of its origin, and of all objects with their indices,
/// bounds, layers, costs, flags, triangles, occluder meshes and transforms. A [`BakedSet`](crate::BakedSet)
/// of the scene has the same [version](crate::BakedSet::version). Draw ranges and HLOD parents are not part
/// of it, since bakes do not look at them. Time is linear in the number of triangles.
///
/// ```
/// use visibility_bake::{BakedSet, level_version};
/// use visibility_core::{Aabb, Object, Scene, pvs::Viewcells};
/// let mut scene = Scene::new();
/// let wall = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_arrays([5.0; 3], [6.0; 3])) });
/// let version = level_version(&scene);
/// assert_eq!(BakedSet::new(&scene, Viewcells::new([]), &[[0; 0]; 0])?.version(), version);
/// scene.set_occluder(wall, false)?;
/// assert_ne!(level_version(&scene), version);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn level_version(scene: &Scene) -> u64 {
    let object = |id: ObjectId| ObjectFacts::of(scene, id).map(|facts| (facts.index, facts.hash));
    version(scene.origin(), scene.ids().filter_map(object))
}

/// Returns a hash of the origin of a scene, and of the indices and bounds of its objects.
pub(crate) fn bounds_fingerprint(origin: DVec3, objects: impl IntoIterator<Item = (u32, Aabb)>) -> u64 {
    let with = |hash: Fingerprint, (index, bounds): (u32, Aabb)| {
        point(point(hash.with(index), bounds.min), bounds.max)
    };
    objects.into_iter().fold(with_origin(origin), with).value()
}

fn with_origin(origin: DVec3) -> Fingerprint {
    origin.to_array().iter().fold(Fingerprint::new(), |hash, x| hash.with_u64(x.to_bits()))
}

fn point(hash: Fingerprint, p: Vec3) -> Fingerprint {
    p.to_array().iter().fold(hash, |hash, x| hash.with(x.to_bits()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes a scene of one object, which `change` may change, and returns its version.
    fn hash(change: impl Fn(&mut Scene, ObjectId)) -> u64 {
        let mut scene = Scene::new();
        let id =
            scene.insert(Object { occluder: true, ..Object::new(Aabb::from_arrays([1.0; 3], [2.0; 3])) });
        scene.set_triangles(id, [[Vec3::ONE, Vec3::ONE + Vec3::X, Vec3::ONE + Vec3::Y]]).unwrap();
        change(&mut scene, id);
        level_version(&scene)
    }

    #[test]
    fn every_change_of_a_level_changes_its_version() {
        let mesh = |scene: &mut Scene, high: f32, two_sided: bool, transform: Affine3A| {
            let mesh = OccluderMesh::cuboid(&Aabb::from_arrays([1.0; 3], [1.5, 1.5, high])).unwrap();
            let mesh = scene.add_mesh(mesh.with_two_sided(two_sided));
            let id = scene.id_at(0).unwrap();
            scene.set_mesh(id, mesh, transform).unwrap();
        };
        let moved = Affine3A::from_translation(Vec3::X * 0.1);
        let bounds = |scene: &mut Scene, id, min: f32, max: f32| {
            scene.set_bounds(id, Aabb::from_arrays([min; 3], [max; 3])).unwrap();
            scene.set_triangles(id, [[Vec3::ONE, Vec3::ONE + Vec3::X, Vec3::ONE + Vec3::Y]]).unwrap();
        };
        let hashes = [
            hash(|_, _| {}),
            hash(|scene, id| bounds(scene, id, 0.5, 2.0)),
            hash(|scene, id| bounds(scene, id, 1.0, 2.5)),
            hash(|scene, id| scene.set_layers(id, 2).unwrap()),
            hash(|scene, id| scene.set_cost(id, 7).unwrap()),
            hash(|scene, id| scene.set_occluder(id, false).unwrap()),
            hash(|scene, id| scene.set_never_cull(id, true).unwrap()),
            hash(|scene, id| scene.set_one_sided(id, true).unwrap()),
            hash(|scene, id| {
                scene.set_triangles(id, [[Vec3::ONE, Vec3::ONE + Vec3::X, Vec3::ONE + Vec3::Z]]).unwrap()
            }),
            hash(|scene, id| scene.set_triangles(id, []).unwrap()),
            hash(|scene, _| mesh(scene, 1.5, false, Affine3A::IDENTITY)),
            hash(|scene, _| mesh(scene, 1.6, false, Affine3A::IDENTITY)),
            hash(|scene, _| mesh(scene, 1.5, true, Affine3A::IDENTITY)),
            hash(|scene, _| mesh(scene, 1.5, false, moved)),
            hash(|scene, _| scene.set_origin(DVec3::X).unwrap()),
            hash(|scene, _| {
                scene.insert(Aabb::from_arrays([1.0; 3], [2.0; 3]));
            }),
            hash(|scene, id| scene.remove(id).unwrap()),
        ];
        for (number, hash) in hashes.iter().enumerate() {
            assert!(!hashes[..number].contains(hash), "change {number}");
        }
    }
}
