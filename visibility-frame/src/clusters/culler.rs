//! The walk over the clusters of each visible instance: tests clusters against planes, then cones, then the
//! occlusion map.

use super::ClusterMesh;
use super::local_view::{LocalView, Placement};
use crate::backface::SplitEye;
use crate::simd_dispatch::Kernels;
use alloc::vec::Vec;
use visibility_core::glam::Affine3A;
use visibility_core::scene::{Boxes64, FAN_OUT, lanes};
use visibility_core::simd::Simd;
use visibility_core::view::{Eye, MAX_PLANES, ViewPlanes, ViewProjection};
use visibility_core::{CullStats, ObjectId, OcclusionMap, Scene, View, VisibleSet};

/// The mesh that an object is drawn with, its transform, and whether its back faces are drawn.
///
/// ```
/// use visibility_frame::clusters::{ClusterInstance, ClusterMesh};
/// use visibility_core::glam::{Affine3A, Vec3};
/// let rock = ClusterMesh::new([]);
/// let instance = ClusterInstance::new(&rock, Affine3A::from_translation(Vec3::X));
/// assert!(!instance.two_sided);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ClusterInstance<'m> {
    /// Clusters of the instance's mesh.
    pub mesh: &'m ClusterMesh,
    /// Maps mesh coordinates to coordinates relative to the scene's origin. May mirror, shear and scale. All
    /// clusters are listed if the transform is flat or not finite.
    pub transform: Affine3A,
    /// Whether back faces are drawn too; normal cones are then not used. False by default.
    /// [`ClusterView::cull`] uses no cones either for an object that is not
    /// [one-sided](visibility_core::Object::one_sided).
    ///
    /// The mesh alone decides which side of a triangle is its front, also under a mirroring transform, which
    /// makes the corners of fronts run clockwise. An engine that does not reverse its winding rule for
    /// mirrored instances must set `two_sided` for these.
    pub two_sided: bool,
}

impl<'m> ClusterInstance<'m> {
    /// Returns a one-sided instance of a mesh. `transform` maps mesh coordinates to coordinates relative to
    /// the scene's origin.
    pub const fn new(mesh: &'m ClusterMesh, transform: Affine3A) -> Self {
        Self { mesh, transform, two_sided: false }
    }
}

/// A cluster of an instance that a view may see.
///
/// ```
/// # use visibility_core::{Aabb, Scene};
/// # use visibility_frame::clusters::VisibleCluster;
/// # let mut scene = Scene::new();
/// # let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
/// let listed = VisibleCluster { instance: id, cluster: 7 };
/// assert_eq!(listed.cluster, 7);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Hash)]
pub struct VisibleCluster {
    /// Object that has the cluster.
    pub instance: ObjectId,
    /// Number of the cluster, in the order in which [`ClusterMesh::new`] was given the clusters.
    pub cluster: u32,
}

/// One view of one scene, prepared to list the visible clusters of instances. Holds no state between frames:
/// make one for each view and frame.
///
/// Conservative: no cluster is dropped that has a front-facing triangle in view, unless the occlusion map
/// hides the cluster's whole box.
///
/// # Cost
/// Some 5 us for an instance of 1,000 clusters in view, half of which are listed. Planes and eye are
/// transformed once for each instance; blocks of 64 clusters out of view cost nothing. The occlusion map is
/// tested last, only with clusters that planes and cones have left.
///
/// ```
/// use visibility_frame::clusters::{ClusterInstance, ClusterMesh, ClusterView, VisibleCluster};
/// use visibility_core::glam::{Affine3A, DVec3, Vec3};
/// use visibility_frame::backface::cluster_mesh;
/// use visibility_core::{FrustumCuller, Aabb, Object, Pipeline, Pose, Scene, View, VisibleSet};
/// // A roof, seen from above and from below.
/// let (positions, indices) = ([Vec3::ZERO, Vec3::X, Vec3::Y], [[0, 1, 2]]);
/// let clusters = cluster_mesh(&positions, &indices)?;
/// let roof = ClusterMesh::new(clusters.iter().map(|cluster| (cluster.bounds, cluster.cone)));
/// let mut scene = Scene::new();
/// let heights = [-3.0f32, 3.0];
/// let ids = heights.map(|z| {
///     let bounds = Aabb::from_arrays([9.0, 0.0, z], [10.0, 1.0, z]);
///     scene.insert(Object { one_sided: true, ..Object::new(bounds) })
/// });
///
/// // Each frame: cull objects, then the clusters of the remaining objects.
/// let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 100.0)?;
/// let (mut visible, mut list) = (VisibleSet::new(), Vec::new());
/// Pipeline::new().with(FrustumCuller::new()).cull(&scene, &view, &mut visible);
/// list.clear();
/// let place = |z| Affine3A::from_translation(Vec3::new(9.0, 0.0, z));
/// ClusterView::new(&scene, &view).cull(
///     &visible,
///     |id| Some(ClusterInstance::new(&roof, place(heights[id.index()]))),
///     &mut list,
/// );
/// assert_eq!(list, [VisibleCluster { instance: ids[0], cluster: 0 }], "the other shows its back");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy)]
pub struct ClusterView<'a> {
    scene: &'a Scene,
    simd: Simd,
    planes: ViewPlanes,
    /// Eye relative to the scene's origin.
    eye: Eye,
    /// Bound on the error of `eye`: in metres for a point; for a direction, the length of the difference of
    /// unit vectors. Infinite if the eye is unknown.
    eye_error: f64,
    /// Occlusion map that clusters are tested against last. `None` if they are not tested for occlusion.
    map: Option<&'a dyn OcclusionMap>,
}

impl core::fmt::Debug for ClusterView<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("ClusterView")
            .field("eye", &self.eye)
            .field("map", &self.map.map(OcclusionMap::name))
            .finish()
    }
}

impl<'a> ClusterView<'a> {
    /// Prepares a view of a scene, without an occlusion map.
    pub fn new(scene: &'a Scene, view: &View) -> Self {
        let projection = ViewProjection::new(view, scene.origin());
        Self {
            scene,
            simd: Simd::best(),
            planes: view.planes(scene.origin()),
            eye: projection.eye(),
            eye_error: projection.eye_error(),
            map: None,
        }
    }

    /// Returns the view with an occlusion map, against which clusters are tested last. The map must have been
    /// filled for this view, scene and frame, with all occluders flushed, such as the
    /// [map](visibility_core::OcclusionCuller::map) of an `OcclusionCuller` that has culled this frame. The
    /// occluder of an object can hide clusters of the same object, so no part of it may be in front of the
    /// drawn surface.
    #[must_use]
    pub fn with_map(self, map: &'a dyn OcclusionMap) -> Self {
        Self { map: Some(map), ..self }
    }

    /// Returns the view with the given SIMD instructions, for tests and comparisons. Answers are the same
    /// with all.
    #[must_use]
    pub fn with_simd(self, simd: Simd) -> Self {
        Self { simd, ..self }
    }

    /// Appends the clusters that the view may see, of all instances in `visible`, to `list`. Clusters of an
    /// instance are adjacent, in no particular order; instances are in the order of the set.
    ///
    /// `instances` returns the mesh and transform that an object is drawn with; for `None` nothing is listed.
    /// For an object that is [never culled](visibility_core::Object::never_cull) or has bounds that are not
    /// finite, all clusters are listed. Allocates only if `list` must grow.
    ///
    /// Returns the counters: `nodes` counts blocks of 64 clusters, `tests` the tests of boxes against planes
    /// and the map and of cones against the eye, and `visible` the clusters listed.
    pub fn cull<'m>(
        &self,
        visible: &VisibleSet,
        mut instances: impl FnMut(ObjectId) -> Option<ClusterInstance<'m>>,
        list: &mut Vec<VisibleCluster>,
    ) -> CullStats {
        let mut sum = CullStats::default();
        for id in visible.iter(self.scene) {
            let Some(instance) = instances(id) else { continue };
            let mut push = |cluster| list.push(VisibleCluster { instance: id, cluster });
            let before = sum.visible;
            let Ok(object) = self.scene.object(id) else { continue };
            if object.is_unculled() {
                (0..instance.mesh.len() as u32).for_each(&mut push);
                sum.visible += instance.mesh.len() as u64;
            } else {
                let two_sided = instance.two_sided || !object.one_sided;
                sum += self.cull_instance(&ClusterInstance { two_sided, ..instance }, push);
                sum.visible += before;
            }
        }
        sum
    }

    /// Calls `each` with the number of every cluster of one instance that the view may see, in no particular
    /// order. For engines with lists of instances of their own, and for several threads. The instance's
    /// [`two_sided`](ClusterInstance::two_sided) alone says whether back faces are drawn. Returns the
    /// counters of this instance.
    pub fn cull_instance(&self, instance: &ClusterInstance<'_>, mut each: impl FnMut(u32)) -> CullStats {
        let ClusterInstance { mesh, transform, two_sided } = *instance;
        let mut stats = CullStats::default();
        let Some(placement) = Placement::new(&transform) else {
            (0..mesh.len() as u32).for_each(each);
            return stats.with_visible(mesh.len() as u64);
        };
        let Some(root) = mesh.level_count().checked_sub(1) else { return stats };
        let volume = placement.volume(self.simd, &self.planes, mesh.reach());
        let eye = if two_sided { SplitEye::UNKNOWN } else { placement.eye(&self.eye, self.eye_error) };
        let walk = InstanceWalk { simd: self.simd, mesh, transform, view: LocalView { volume, eye } };
        walk.visit(root, 0, walk.view.volume.all(), self.map, &mut stats, &mut each);
        stats
    }
}

/// The walk over the clusters of one instance.
struct InstanceWalk<'m> {
    simd: Simd,
    mesh: &'m ClusterMesh,
    transform: Affine3A,
    view: LocalView,
}

impl InstanceWalk<'_> {
    /// Tests the boxes of a block, and at level 0 also the cones. At level 0 the lanes are clusters, and
    /// `each` is called with those that pass. At other levels the lanes are blocks of the level below, and
    /// those that pass are visited. Boxes are tested against the planes in the mask `active`; all other
    /// planes have the whole block on their inner side. `map` is `None` if there is no map, or if it hides no
    /// part of the block's box.
    fn visit(
        &self,
        level: usize,
        block: usize,
        active: u32,
        map: Option<&dyn OcclusionMap>,
        stats: &mut CullStats,
        each: &mut impl FnMut(u32),
    ) {
        let (boxes, used) = self.mesh.block(level, block);
        stats.nodes += 1;
        stats.tests += u64::from(used.count_ones()) * u64::from(active.count_ones());
        let volume = &self.view.volume;
        let mut mask = if active == 0 { used } else { used & !volume.outside(boxes, active) };
        if level == 0 && mask != 0 {
            stats.tests += u64::from(mask.count_ones());
            mask &= !self.simd.inside_cones(self.mesh.cones(block), &self.view.eye);
        }
        // `unhidden` are the children whose box the map found wholly visible: their descendants are not
        // tested against it.
        let mut unhidden = 0;
        if let Some(map) = map.filter(|_| mask != 0) {
            let (placed, known) = self.placed(boxes, mask);
            stats.tests += u64::from(known.count_ones());
            let answer = map.test_64(&placed, known);
            mask &= !(answer.hidden & known);
            unhidden = answer.visible;
        }
        if level == 0 {
            stats.visible += u64::from(mask.count_ones());
            let clusters = self.mesh.clusters_of(block);
            lanes(mask).for_each(|lane| each(clusters[lane]));
            return;
        }
        // A child wholly on the inner side of a plane needs no test against that plane below it.
        let mut inside = [0; MAX_PLANES];
        for plane in lanes(active.into()) {
            inside[plane] = volume.inside(boxes, plane);
        }
        for lane in lanes(mask) {
            let crossing = lanes(active.into())
                .fold(0, |set, plane| set | ((!inside[plane] >> lane & 1) as u32) << plane);
            let map = map.filter(|_| unhidden >> lane & 1 == 0);
            self.visit(level - 1, FAN_OUT * block + lane, crossing, map, stats, each);
        }
    }

    /// Returns the boxes of the lanes in `mask` relative to the scene's origin, rounded outwards, and a mask
    /// of those that are finite.
    fn placed(&self, boxes: &Boxes64, mask: u64) -> (Boxes64, u64) {
        let (mut placed, mut known) = (Boxes64::EMPTY, 0);
        for lane in lanes(mask) {
            let bounds = boxes.get(lane).transformed(&self.transform);
            if bounds.is_finite() {
                placed.set(lane, &bounds);
                known |= 1 << lane;
            }
        }
        (placed, known)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backface::NormalCone;
    use visibility_core::glam::{DVec3, Vec3};
    use visibility_core::{Aabb, Object, Pose};

    /// Clusters of a mesh of several levels, half of which show their backs, and of objects that are drawn
    /// from both sides.
    #[test]
    fn backs_are_dropped_of_what_is_one_sided() {
        let clusters = (0..500).map(|i| {
            let at = Vec3::new(i as f32 * 0.1, 0.0, 0.0);
            let floor = [at, at + Vec3::X, at + Vec3::Y];
            let cone = NormalCone::from_triangles(&[floor]);
            (Aabb::from_points(floor), if i % 2 == 0 { cone } else { cone.flipped() })
        });
        let mesh = ClusterMesh::new(clusters);
        let mut scene = Scene::new();
        let bounds = Aabb::from_arrays([0.0; 3], [51.0, 1.0, 0.0]);
        let ids = [false, true].map(|one_sided| scene.insert(Object { one_sided, ..Object::new(bounds) }));
        let pose = Pose::look_at(DVec3::new(25.0, 0.5, -60.0), DVec3::new(25.0, 0.5, 0.0), DVec3::Y);
        let view = View::perspective(pose, 1.5, 1.0, 0.1, 99.0).unwrap();
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &view);
        for two_sided in [false, true] {
            let mut list = Vec::new();
            let instance = ClusterInstance { two_sided, ..ClusterInstance::new(&mesh, Affine3A::IDENTITY) };
            ClusterView::new(&scene, &view).cull(&visible, |_| Some(instance), &mut list);
            let counts = ids.map(|id| list.iter().filter(|of| of.instance == id).count());
            assert_eq!(counts, [500, if two_sided { 500 } else { 250 }], "two-sided instance: {two_sided}");
            let fronts = list.iter().filter(|of| of.instance == ids[1] && of.cluster % 2 == 1).count();
            assert_eq!(fronts, 250, "fronts listed");
        }
    }

    /// A floor that shows its back is listed while the eye may be above it: an eye that is off by `r` changes
    /// what the cone's test compares by less than `4.2 r`, for which the test takes `5 r`.
    #[test]
    fn backs_are_listed_within_the_error_of_the_eye() {
        let floor = [Vec3::new(-9.0, -9.0, 0.0), Vec3::new(9.0, -9.0, 0.0), Vec3::new(0.0, 9.0, 0.0)];
        let cone = NormalCone::from_triangles(&[floor]);
        let mesh = ClusterMesh::new([(Aabb::from_points(floor), cone)]);
        let scene = Scene::new();
        let listed = |below: f64, error: f64| {
            let eye = DVec3::Z * -below;
            let pose = Pose::look_at(eye, DVec3::ZERO, DVec3::X);
            let view = View::perspective(pose, 1.0, 1.0, 0.1, 99.0).unwrap();
            let mut view = ClusterView::new(&scene, &view);
            let mut count = 0;
            view.eye_error += error;
            view.cull_instance(&ClusterInstance::new(&mesh, Affine3A::IDENTITY), |_| count += 1);
            count
        };
        let counts = [0.0, 1.0].map(|error| [4.0, 30.0].map(|below| listed(below, error)));
        assert_eq!(counts, [[0, 0], [1, 0]], "by error of the eye, from 4 and 30 m below");
        let view =
            View::perspective(Pose::look_at(DVec3::X * 1e9, DVec3::ZERO, DVec3::Z), 1.0, 1.0, 0.1, 99.0);
        let view = view.unwrap();
        let error = ViewProjection::new(&view, scene.origin()).eye_error();
        assert!(error > 0.0, "an eye a million kilometres away is off");
        assert_eq!(ClusterView::new(&scene, &view).eye_error, error, "error of the eye in metres");
    }
}
