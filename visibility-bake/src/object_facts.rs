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
        let mut bounds = given;
        if given.is_finite() {
            let corners = triangles.iter().flatten().filter(|corner| corner.is_finite());
            bounds = bounds.union(&Aabb::from_points(corners));
            // A mesh that reaches out of the given bounds by more than rounding is not used.
            let mesh = mesh.map(|(mesh, transform)| mesh.placed_bounds(&transform));
            if let Some(mesh) = mesh.filter(|mesh| holds_nearly(&given, mesh)) {
                bounds = bounds.union(&mesh);
            }
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::{DAffine3, DMat3, Vec3};
    use visibility_core::scene::{SharedTriangles, Triangle};

    /// A face in the plane y = 0, turned into it by a transform: its rounded corners are some micrometres
    /// before the flat box that was given, and far before it as seen from a box without thickness.
    #[test]
    fn bounds_hold_triangles_that_reach_out_by_the_rounding_of_their_transform() {
        let (cosine, sine) = (13.0 / 493.0f64.sqrt(), 18.0 / 493.0f64.sqrt());
        let columns = [DVec3::new(cosine, -sine, 0.0), DVec3::new(sine, cosine, 0.0), DVec3::Z];
        let turn = DAffine3::from_mat3(DMat3::from_cols(columns[0], columns[1], columns[2]));
        let far = Vec3::new(130.0, 180.0, 0.0);
        let face = SharedTriangles::from([[Vec3::ZERO, far, far + Vec3::Z * 30.0]]).placed(turn);
        let given = Aabb::from_arrays([0.0; 3], [222.04, 0.0, 30.0]);
        let mut scene = Scene::new();
        let id = scene.insert(given);
        scene.set_triangles(id, face).unwrap();
        let facts = ObjectFacts::of(&scene, id).unwrap();
        assert_eq!(facts.given, given, "the bounds that were given");
        for corner in scene.triangles(id).unwrap().iter().flatten() {
            assert!(facts.bounds.contains_point(corner), "{:?} does not hold {corner}", facts.bounds);
        }
        // A part of the level takes the same triangles, with these bounds.
        let mut part = Scene::new();
        let copy = part.insert(facts.enlarged_object());
        let corners: Vec<[Vec3; 3]> = scene.triangles(id).unwrap().iter().collect();
        assert_eq!(part.set_triangles(copy, corners), Ok(()), "the triangles of a part");
    }

    /// Bounds hold triangles and meshes that reach out of those given by rounding. A mesh that reaches out
    /// farther and corners that are not finite count for nothing.
    #[test]
    fn bounds_hold_what_reaches_out_by_rounding() {
        let given = Aabb::from_arrays([0.0; 3], [1.0; 3]);
        let out = 1f32.next_up();
        let facts = |triangles: &[Triangle], size: f32| {
            let mesh = OccluderMesh::from_indexed(&given.corners(), &OccluderMesh::CUBOID).unwrap();
            let transform = Affine3A::from_scale(Vec3::splat(size));
            ObjectFacts::new(0, &Object::new(given), triangles.into(), Some((&mesh, transform)))
        };
        let corners = [Vec3::ZERO, Vec3::X * out, Vec3::Y];
        assert_eq!(facts(&[corners], 1.0).bounds.max.x, out, "a corner outside by rounding");
        assert!(facts(&[], out).bounds.max.cmpge(Vec3::splat(out)).all(), "a mesh outside by rounding");
        assert!(facts(&[], 2.0).bounds.max.cmplt(Vec3::splat(1.5)).all(), "a mesh outside by a metre");
        let wrong = [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY];
        let found = facts(&[wrong], 1.0);
        assert!(found.bounds.is_finite() && found.given == given, "corners that are not finite");
        assert_eq!([found.triangles, found.weight() as u32], [1, 5], "one triangle");
        assert_eq!(found.enlarged_object().bounds, found.bounds, "the bounds of the object");
        let is_unculled =
            |object: Object| ObjectFacts::new(0, &object, Default::default(), None).is_unculled();
        assert!(!is_unculled(Object::new(given)), "an object");
        assert!(
            is_unculled(Object { never_cull: true, ..Object::new(given) }),
            "an object that is never culled"
        );
        let infinite = Aabb::new(Vec3::ZERO, Vec3::INFINITY);
        assert!(is_unculled(Object::new(infinite)), "an object whose bounds are not finite");
    }
}
