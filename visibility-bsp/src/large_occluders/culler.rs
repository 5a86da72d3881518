//! The culler: chooses the polygons in use and decides when that choice must be repeated.

use super::cached_occlusion_map::GroupMap;
use crate::clip_projection::ClipProjection;
use crate::occluders::{Chosen, Occluders, Selector, is_drawn};
use crate::view_volume::ViewVolume;
use alloc::sync::Arc;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{
    Accuracy, CullStats, Culler, ObjectId, OcclusionCuller, Scene, View, VisibleSet, view::Eye,
};

/// Culls boxes that are behind a single large polygon, or behind two that share an edge. Answers are cached
/// while the eye stays within a ball in which they cannot change. Conservative: a box for which rounding
/// leaves the answer open stays visible.
///
/// Put it after the frustum culler. It culls less than an
/// [`OcclusionTreeCuller`](crate::OcclusionTreeCuller), since at most two occluders fuse. It costs less while
/// the camera stands still or moves slowly.
///
/// ```
/// use visibility_bsp::{LargeOccludersCuller, Occluders};
/// use visibility_core::{FrustumCuller, Pipeline, Scene};
/// let mut scene = Scene::new();
/// // insert objects, give them triangles, flag the opaque ones, then:
/// scene.prepare_occluders(&Default::default());
/// let culler = LargeOccludersCuller::new(Occluders::new(&scene).into()).with_polygons(32);
/// let pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
/// # let _ = pipeline;
/// ```
#[derive(Clone, Debug)]
pub struct LargeOccludersCuller {
    /// All occluder polygons of the scene, from which the culler chooses.
    occluders: Arc<Occluders>,
    /// Chooses polygons by solid angle from the eye, and tracks which objects have changed since the
    /// polygons were made.
    selector: Selector,
    /// Maximum number of occluder polygons in use at a time.
    most: usize,
    /// Spacing in metres of the grid that the eye is rounded to for choosing polygons.
    pitch: f64,
    /// Eye of the last choice, rounded to the grid; `None` if the polygons must be chosen again in the next
    /// frame.
    chosen_at: Option<Eye>,
    /// Indices in `Occluders` of the polygons chosen at `chosen_at`, whether they may hide in this frame or
    /// not.
    selected: Vec<u32>,
    /// Indices in `Occluders` of the `selected` polygons that may hide in this frame: their objects are
    /// unchanged and drawn in this view (see `Selector::keep_usable`).
    active: Vec<u32>,
    /// Objects that the `active` polygons were made from, each once, in ascending order.
    sources: Vec<ObjectId>,
    /// Indices in `Occluders` of the `active` polygons that are sections: rectangles inside closed boxes,
    /// which hide only for eyes outside these boxes.
    sections: Vec<u32>,
    /// Layers of the view for which `active` was found.
    layers: u32,
    /// Whether every polygon of `selected` is in `active`. If false, the next frame tests again which of
    /// them may hide.
    all_active: bool,
    /// Driver that tests the scene's hierarchy of boxes against the occlusion map.
    inner: OcclusionCuller<GroupMap>,
}

impl LargeOccludersCuller {
    /// Creates the culler of one view. It uses up to 64 polygons at a time and caches answers.
    pub fn new(occluders: Arc<Occluders>) -> Self {
        let inner = OcclusionCuller::new(GroupMap::new()).with_price(0);
        let pitch = pitch_of(&occluders);
        Self {
            occluders,
            selector: Selector::default(),
            most: 64,
            pitch,
            chosen_at: None,
            selected: Vec::new(),
            active: Vec::new(),
            sources: Vec::new(),
            sections: Vec::new(),
            layers: 0,
            all_active: false,
            inner,
        }
    }

    /// Sets the maximum number of occluder polygons in use; 0 disables culling. The cost of a test whose
    /// answer is not cached grows in proportion.
    #[must_use]
    pub fn with_polygons(self, most: usize) -> Self {
        Self { most, chosen_at: None, ..self }
    }

    /// Turns the answer cache off. Every frame then computes all answers anew; they are the same but for
    /// rounding.
    #[must_use]
    pub fn without_coherence(mut self) -> Self {
        self.inner.map_mut().coherent = false;
        self
    }

    /// Replaces the occluder polygons, by those of another scene or an updated copy. Cached answers are
    /// dropped in the next frame.
    pub fn set_occluders(&mut self, occluders: Arc<Occluders>) {
        self.pitch = pitch_of(&occluders);
        self.occluders = occluders;
        self.chosen_at = None;
    }

    /// Returns the number of boxes that the last frame tested against polygons. Boxes answered from the cache
    /// do not count. 0 before the first frame.
    pub fn computed(&self) -> u64 {
        self.inner.map().computed()
    }

    /// Returns the eye point rounded to a grid of `pitch` metres, so that nearby eyes choose the same
    /// polygons. The direction of a parallel view is returned unchanged.
    fn rounded_eye(&self, eye: Eye) -> Eye {
        let pitch = self.pitch;
        let whole = |x: f64| {
            let cells = x / pitch;
            // Beyond this magnitude, adding `WHOLE` no longer rounds to whole cells.
            if cells.abs() < 2e15 { ((cells + WHOLE) - WHOLE) * pitch } else { x }
        };
        match eye {
            Eye::Point(p) => Eye::Point(DVec3::from_array(p.to_array().map(whole))),
            Eye::Direction(along) => Eye::Direction(along),
        }
    }
}

/// 1.5 times 2^52. Adding and subtracting it rounds a number of magnitude below 2^51 to a whole number.
const WHOLE: f64 = 1.5 * (1u64 << 52) as f64;

/// Returns the grid spacing in metres: the greatest power of two that is at most 1/32 of the largest
/// polygon's radius; 1 without polygons.
fn pitch_of(occluders: &Occluders) -> f64 {
    let size = occluders.largest_radius() / 32.0;
    // The exponent bits alone are the power of two.
    let power = f64::from_bits(size.to_bits() & (0x7ff << 52));
    if power.is_normal() { power } else { 1.0 }
}

impl Culler for LargeOccludersCuller {
    fn name(&self) -> &str {
        "large-occluders"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn hides_behind_objects(&self) -> bool {
        true
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let news = self.selector.follow(&self.occluders, scene);
        let rounded_eye = self.rounded_eye(view.eye(scene.origin()));
        // The choice depends on the eye alone, rounded to a grid so that it lasts for several frames.
        let chosen = news || self.chosen_at != Some(rounded_eye) || !self.inner.map().coherent;
        if chosen {
            self.selector.choose(&self.occluders, &rounded_eye, false, None, self.most);
            self.selected.clear();
            self.selected.extend(self.selector.chosen.iter().map(|chosen| chosen.polygon));
            self.chosen_at = Some(rounded_eye);
        }
        let map = self.inner.map_mut();
        let volume = ViewVolume::new(view, scene, 0.0);
        // If neither the scene nor the choice nor the view's layers have changed, two conditions remain to be
        // tested: the occluders are still drawn, and the eye is outside the boxes of all sections.
        let settled = map.coherent
            && !chosen
            && self.all_active
            && self.layers == view.layers()
            && view.clip_planes().is_empty()
            && self.sources.iter().all(|&id| is_drawn(scene, visible, &volume, id))
            && (self.sections.is_empty() || {
                let projection = ClipProjection::new(view, scene.origin());
                let clear = projection.clearance();
                let mut solids = self.sections.iter().flat_map(|&polygon| self.occluders.solids_of(polygon));
                solids.all(|solid| projection.is_outside(solid, clear))
            });
        // The map takes the chosen polygons whose objects are drawn and that hide from this eye. It groups
        // them anew only if this set has changed.
        if !settled {
            let projection = ClipProjection::new(view, scene.origin());
            self.selector.chosen.clear();
            let all = self.selected.iter().map(|&polygon| Chosen { polygon, bound: 0.0 });
            self.selector.chosen.extend(all);
            self.selector.keep_usable(&self.occluders, scene, view, &projection, visible, &volume);
            let usable = self.selector.chosen.iter().map(|chosen| chosen.polygon);
            let same = !news && self.active.iter().copied().eq(usable.clone());
            if !same || !map.coherent {
                self.active.clear();
                self.active.extend(usable);
                map.group(&self.occluders, &self.active);
            }
            self.sources.clear();
            for &polygon in &self.active {
                self.sources.extend_from_slice(self.occluders.sources_of(polygon));
            }
            self.sources.sort_unstable();
            self.sources.dedup();
            self.sections.clear();
            let is_section = |&polygon: &u32| !self.occluders.solids_of(polygon).is_empty();
            self.sections.extend(self.active.iter().copied().filter(is_section));
            self.layers = view.layers();
            // Polygons left out now may be usable in the next frame.
            self.all_active = self.active.len() == self.selected.len();
        }
        self.inner.cull(scene, view, visible)
    }

    fn reset(&mut self) {
        self.selector.reset();
        self.chosen_at = None;
        self.all_active = false;
        self.active.clear();
        self.inner.map_mut().forget();
        self.inner.reset();
    }
}
