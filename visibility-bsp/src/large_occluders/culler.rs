//! The culler: which polygons are in use, and when that must be looked at again.

use super::group_map::GroupMap;
use crate::clip_projection::ClipProjection;
use crate::occluders::{Chosen, Occluders, Selector, is_drawn, sides_of};
use alloc::sync::Arc;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{
    Accuracy, CullStats, Culler, ObjectId, OcclusionCuller, Scene, View, VisibleSet,
    geometry::Plane,
    occlusion::Selection,
    view::{Eye, MAX_PLANES},
};

/// Culls boxes behind a single large polygon, or behind two that share an edge, and keeps each answer while
/// the eye moves within a ball in which it cannot change.
///
/// Put it after the frustum. It hides less than an [`OcclusionTreeCuller`](crate::OcclusionTreeCuller), since
/// more than two occluders do not fuse; while the camera stands still or moves slowly, it costs less.
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
    occluders: Arc<Occluders>,
    selector: Selector,
    most: usize,
    /// Spacing in metres of the grid that the eye is rounded to for choosing occluders, and the rounded eye
    /// of the last choice.
    pitch: f64,
    chosen_at: Option<Eye>,
    selected: Vec<u32>,
    active: Vec<u32>,
    /// The objects of all active polygons, each once.
    sources: Vec<ObjectId>,
    /// Numbers of the active polygons that are sections of boxes.
    sections: Vec<u32>,
    /// Whether all selected polygons are active.
    all_active: bool,
    inner: OcclusionCuller<GroupMap>,
}

impl LargeOccludersCuller {
    /// Uses 64 polygons at a time, with coherence.
    pub fn new(occluders: Arc<Occluders>) -> Self {
        let inner =
            OcclusionCuller::new(GroupMap::new()).with_selection(Selection::Interleaved).with_budget(0);
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
            all_active: false,
            inner,
        }
    }

    /// Sets the maximum number of polygons in use, 0 for none; any number is allowed. The cost of a test that
    /// is not remembered grows in proportion.
    pub fn with_polygons(self, most: usize) -> Self {
        Self { most, chosen_at: None, ..self }
    }

    /// Turns the memory of answers on (the default) or off. Off, each frame computes everything; the answers
    /// are the same.
    pub fn with_coherence(mut self, coherent: bool) -> Self {
        self.inner.map_mut().coherent = coherent;
        self
    }

    /// Replaces the polygons, by those of another scene or by the same ones brought up to date. What was
    /// remembered of others is dropped in the next frame.
    pub fn set_occluders(&mut self, occluders: Arc<Occluders>) {
        self.pitch = pitch_of(&occluders);
        self.occluders = occluders;
        self.chosen_at = None;
    }

    /// Number of boxes that the last frame tested against polygons; those answered from memory do not count.
    pub fn computed(&self) -> u64 {
        self.inner.map().computed()
    }

    /// The eye rounded to the grid, so that eyes near one another choose the same polygons.
    fn place(&self, eye: Eye) -> Eye {
        let pitch = self.pitch;
        let whole = |x: f64| {
            let cells = x / pitch;
            // Past this, numbers are whole anyway.
            if cells.abs() < 2e15 { ((cells + WHOLE) - WHOLE) * pitch } else { x }
        };
        match eye {
            Eye::Point(p) => Eye::Point(DVec3::from_array(p.to_array().map(whole))),
            Eye::Direction(along) => Eye::Direction(along),
        }
    }
}

/// 1.5 times 2^52: a number of magnitude below 2^51 loses its fraction when this is added.
const WHOLE: f64 = 1.5 * (1u64 << 52) as f64;

/// Spacing of the grid in metres: the greatest power of two that is at most 1/32 of the largest polygon's
/// radius, 1 if there is none.
fn pitch_of(occluders: &Occluders) -> f64 {
    let size = occluders.largest_radius() / 32.0;
    // The bits above the mantissa are the power of two.
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

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let news = self.selector.follow(&self.occluders, scene);
        let place = self.place(view.eye(scene.origin()));
        let chosen = news || self.chosen_at != Some(place) || !self.inner.map().coherent;
        if chosen {
            self.selector.choose(&self.occluders, &place, None, self.most);
            self.selected.clear();
            self.selected.extend(self.selector.chosen.iter().map(|chosen| chosen.polygon));
            self.chosen_at = Some(place);
        }
        let map = self.inner.map_mut();
        let mut sides = [Plane::new(DVec3::ZERO, 0.0); MAX_PLANES];
        let count = sides_of(view, scene, &mut sides);
        let sides = &sides[..count];
        // While neither the scene nor the choice has changed, what remains to be tested is that the occluders
        // are still drawn, in this view's layers too, and that the eye is outside of the boxes of sections.
        let settled = map.coherent
            && !chosen
            && self.all_active
            && view.clip_planes().is_empty()
            && self.sources.iter().all(|&id| is_drawn(scene, visible, sides, id))
            && (self.sections.is_empty() || {
                let projection = ClipProjection::new(view, scene.origin());
                let clear = projection.clearance();
                let mut solids = self.sections.iter().flat_map(|&polygon| self.occluders.solids_of(polygon));
                solids.all(|solid| projection.is_outside(solid, clear))
            });
        if !settled {
            let projection = ClipProjection::new(view, scene.origin());
            self.selector.chosen.clear();
            let all = self.selected.iter().map(|&polygon| Chosen { polygon, bound: 0.0 });
            self.selector.chosen.extend(all);
            self.selector.keep_usable(&self.occluders, scene, view, &projection, visible, sides);
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
            // Those that were left out may be of use in the next frame.
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
