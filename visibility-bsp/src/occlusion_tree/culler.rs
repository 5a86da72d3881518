//! The culler that uses an occlusion tree of large polygons made in advance.

use super::map::OcclusionTree;
use crate::clip_projection::ClipProjection;
use crate::occluders::{Occluders, Selector};
use crate::view_volume::ViewVolume;
use alloc::sync::Arc;
use visibility_core::{Accuracy, CullStats, Culler, OcclusionCuller, Scene, View, VisibleSet, view::Eye};

/// Culls objects behind the large occluder polygons of a scene, with an [`OcclusionTree`] that is rebuilt
/// every frame. Shadows of several polygons fuse. Conservative: an object for which rounding leaves the
/// answer open stays visible.
///
/// Put it after the frustum culler. Costs a few nanoseconds per polygon of the scene, about a microsecond per
/// polygon used, some tens of nanoseconds for each object that a used polygon was made from, and a few
/// hundred nanoseconds per box tested.
///
/// ```
/// use visibility_bsp::{Occluders, OcclusionTreeCuller};
/// use visibility_core::{FrustumCuller, Pipeline, Scene};
/// let mut scene = Scene::new();
/// // insert objects, give them triangles, flag the opaque ones, then:
/// scene.prepare_occluders(&Default::default());
/// let culler = OcclusionTreeCuller::new(Occluders::new(&scene).into());
/// let pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
/// # let _ = pipeline;
/// ```
#[derive(Clone, Debug)]
pub struct OcclusionTreeCuller {
    /// All occluder polygons of the scene, from which the culler chooses.
    occluders: Arc<Occluders>,
    /// Chooses polygons and tracks which objects have changed since the polygons were made.
    selector: Selector,
    /// Driver that tests the scene's hierarchy of boxes against the occlusion tree.
    inner: OcclusionCuller<OcclusionTree>,
}

/// Number of polygons that pass the first ranking, as a multiple of the maximum number of polygons in the
/// frame's occlusion tree. The first ranking orders all polygons by a bound on their solid angle from the
/// eye.
const CANDIDATES_PER_POLYGON: usize = 6;
/// Number of polygons that pass the second ranking, as a multiple of the maximum number of polygons in the
/// frame's occlusion tree. The second ranking orders the polygons that passed the first by estimated worth:
/// the number of objects that a polygon's shadow may hide. Polygons that do not pass are not used in this
/// frame.
const RANKED_PER_POLYGON: usize = 2;
/// Worth in objects per steradian given to a polygon so close or large that its worth cannot be estimated. It
/// ranks such polygons before all others, in the order of their solid angles.
const UNESTIMATED_WORTH: f32 = 1e30;

impl OcclusionTreeCuller {
    /// Creates the culler of one view. It uses up to 64 polygons per frame, those whose shadows cover most
    /// objects in the image.
    pub fn new(occluders: Arc<Occluders>) -> Self {
        // The meshes are represented by the polygons, so the inner culler adds no meshes.
        let inner = OcclusionCuller::new(OcclusionTree::new()).with_price(0);
        Self { occluders, selector: Selector::default(), inner }
    }

    /// Sets the maximum number of occluder polygons used per frame; 0 disables culling.
    #[must_use]
    pub fn with_polygons(mut self, most: usize) -> Self {
        self.inner.map_mut().most = most;
        self
    }

    /// Replaces the occluder polygons, by those of another scene or an updated copy. Takes effect in the next
    /// frame, which drops everything recorded about the previous polygons.
    pub fn set_occluders(&mut self, occluders: Arc<Occluders>) {
        self.occluders = occluders;
    }

    /// Returns the occlusion tree as the last frame left it. Empty before the first frame.
    pub fn tree(&self) -> &OcclusionTree {
        self.inner.map()
    }
}

impl Culler for OcclusionTreeCuller {
    fn name(&self) -> &str {
        "occlusion-tree"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn hides_behind_objects(&self) -> bool {
        true
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let occluders = &self.occluders;
        self.selector.follow(occluders, scene);
        let volume = ViewVolume::new(view, scene, 0.0);
        let tree = self.inner.map_mut();
        let projection = ClipProjection::new(view, scene.origin());
        let density = tree.density.get_or_insert_default();
        density.clear();
        for id in visible.iter(scene) {
            if let Ok(bounds) = scene.bounds(id) {
                density.add(&projection, bounds.center().as_dvec3());
            }
        }
        density.finish();
        self.selector.choose(
            occluders,
            &view.eye(scene.origin()),
            false,
            Some(&volume),
            tree.most.saturating_mul(CANDIDATES_PER_POLYGON),
        );
        self.selector.keep_worthy(tree.most.saturating_mul(RANKED_PER_POLYGON), |polygon, bound| {
            let (middle, radius) = occluders.bounding_sphere(polygon);
            // A solid angle is an area at distance 1. For a parallel view, the bound is the projected area
            // itself.
            let area = if let Eye::Point(eye) = projection.eye {
                f64::from(bound) * eye.distance_squared(middle)
            } else {
                f64::from(bound)
            };
            density.estimate(&projection, middle, radius, area).unwrap_or(UNESTIMATED_WORTH * bound)
        });
        self.selector.keep_usable(occluders, scene, view, &projection, visible, &volume);
        tree.queue.clear();
        tree.vertices.clear();
        tree.is_queued_ahead = true;
        for chosen in &self.selector.chosen {
            tree.enqueue(&occluders.occluder_polygon(chosen.polygon));
        }
        self.inner.cull(scene, view, visible)
    }

    fn reset(&mut self) {
        self.selector.reset();
        self.inner.reset();
    }
}
