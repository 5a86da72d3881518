//! The occlusion tree with large polygons made in advance.

use super::map::OcclusionTree;
use crate::clip_projection::ClipProjection;
use crate::occluders::{Occluders, Selector, sides_of};
use alloc::sync::Arc;
use visibility_core::{
    Accuracy, CullStats, Culler, OcclusionCuller, Scene, View, VisibleSet,
    geometry::Plane,
    glam::DVec3,
    occlusion::Selection,
    view::{Eye, MAX_PLANES},
};

/// Culls what is behind the large polygons of a scene, by an [`OcclusionTree`] that is built anew each frame.
///
/// Put it after the frustum. Costs for each polygon that the scene has a few nanoseconds, for each of those
/// used about a microsecond, and for each box tested a few hundred nanoseconds.
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
    occluders: Arc<Occluders>,
    selector: Selector,
    inner: OcclusionCuller<OcclusionTree>,
}

/// So many times more polygons than are used are looked at, by where they are, and so many of these closely.
const LOOKED_AT: usize = 6;
const CLOSER: usize = 2;
/// What is close by is worth more than anything else, and among itself by its solid angle.
const CERTAIN: f32 = 1e30;

impl OcclusionTreeCuller {
    /// Uses the 64 polygons that cover most of the picture.
    pub fn new(occluders: Arc<Occluders>) -> Self {
        // What is in the meshes is in the polygons, so none are added, nor looked for.
        let inner =
            OcclusionCuller::new(OcclusionTree::new()).with_selection(Selection::Interleaved).with_budget(0);
        Self { occluders, selector: Selector::default(), inner }
    }

    /// Sets the maximum number of polygons used a frame, 0 for none; any number is allowed.
    pub fn with_polygons(mut self, most: usize) -> Self {
        self.inner.map_mut().most = most;
        self
    }

    /// Replaces the polygons, by those of another scene or by the same ones brought up to date. What was
    /// remembered of others is dropped in the next frame.
    pub fn set_occluders(&mut self, occluders: Arc<Occluders>) {
        self.occluders = occluders;
    }

    /// The tree of the last frame.
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

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let occluders = &self.occluders;
        self.selector.follow(occluders, scene);
        let mut sides = [Plane::new(DVec3::ZERO, 0.0); MAX_PLANES];
        let count = sides_of(view, scene, &mut sides);
        let sides = &sides[..count];
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
            Some(sides),
            tree.most.saturating_mul(LOOKED_AT),
        );
        self.selector.keep_worthy(tree.most.saturating_mul(CLOSER), |polygon, bound| {
            let (middle, radius) = occluders.about(polygon);
            // A solid angle is an area at a distance of one; of a parallel view it is one as it is.
            let area = if let Eye::Point(eye) = projection.eye {
                f64::from(bound) * eye.distance_squared(middle)
            } else {
                f64::from(bound)
            };
            density.about(&projection, middle, radius, area).unwrap_or(CERTAIN * bound)
        });
        self.selector.keep_usable(occluders, scene, view, &projection, visible, sides);
        tree.waiting.clear();
        tree.vertices.clear();
        for chosen in &self.selector.chosen {
            tree.wait(&occluders.occluder_polygon(chosen.polygon));
        }
        self.inner.cull(scene, view, visible)
    }

    fn reset(&mut self) {
        self.selector.reset();
        self.inner.reset();
    }
}
