//! Selection of the polygons that hide most from the eye, by solid angle (Coorg and Teller, "Real-Time
//! Occlusion Culling for Models with Large Occluders", 1997). A first pass uses a bound that costs a few
//! operations; a second pass ranks the best by their worth in the image.

use super::polygons::{Block, Occluders, Polygon};
use crate::clip_projection::{ClipProjection, corners_of};
use crate::shadow::ShadowCorner;
use crate::view_volume::ViewVolume;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{
    ObjectId, Scene, View, VisibleSet,
    bits::Bits,
    geometry::solid_angle,
    scene::{Changes, SceneCursor},
    stamp::Stamp,
    view::Eye,
};

/// Solid angle of a half-space in steradians (2 pi), the upper limit of all bounds on the solid angle of a
/// polygon.
const MAX_ANGLE: f32 = core::f32::consts::TAU;

/// A polygon chosen by [`Selector::choose`], because the bound on its solid angle seen from the eye is among
/// the greatest. Whether it may hide in this frame is tested later, by [`Selector::keep_usable`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chosen {
    /// Index of the polygon in `Occluders::polygons`.
    pub(crate) polygon: u32,
    /// Upper bound on the polygon's solid angle in steradians; for parallel views, the projected area in
    /// square metres. After [`Selector::keep_worthy`], the polygon's estimated worth.
    pub(crate) bound: f32,
}

/// Selects polygons for one view, and tracks which objects have changed since the polygons were made.
#[derive(Clone, Debug)]
pub(crate) struct Selector {
    /// The polygons that the last `choose` picked, less those that later `keep_` calls removed: greatest
    /// bound first after `choose`, in no particular order after `keep_worthy`.
    pub(crate) chosen: Vec<Chosen>,
    /// Scratch: for each block that may be in view, an upper bound on the solid angle of its polygons (in
    /// steradians; for parallel views, on their area in square metres) and the block's index.
    blocks: Vec<(f32, u32)>,
    /// Stamp of the polygons that the other fields refer to; `Stamp::NONE` before the first frame and after
    /// a reset.
    occluders: Stamp,
    /// The scene whose changes `stale` records, and the last revision of that scene whose changes are
    /// recorded.
    seen: SceneCursor,
    /// Bitset by object index: a bit is 1 if the object has changed since the polygons were made.
    stale: Bits,
    /// True if the polygons belong to another scene, or the scene no longer lists all changes since they
    /// were made. No polygon may then be used. False if `stale` is complete.
    lost: bool,
}

impl Default for Selector {
    fn default() -> Self {
        Self {
            chosen: Vec::new(),
            blocks: Vec::new(),
            occluders: Stamp::NONE,
            seen: SceneCursor::START,
            stale: Bits::EMPTY,
            lost: false,
        }
    }
}

impl Selector {
    /// Records changes of the scene and of the polygons since the last call. Returns true if any polygon may
    /// have changed, or have become usable or unusable. Must be called first in a frame.
    pub(crate) fn follow(&mut self, occluders: &Occluders, scene: &Scene) -> bool {
        let mut news = self.occluders != occluders.stamp;
        let mut changes = self.seen.peek(scene);
        if news || self.lost || changes == Changes::Everything {
            // The polygons or the scene differ from those of the last frame, so changes are collected again
            // from the revision that the polygons represent.
            self.occluders = occluders.stamp;
            self.stale.reset(0);
            changes = occluders.cursor.peek(scene);
            let lost = changes == Changes::Everything;
            news |= !(lost && self.lost);
            self.lost = lost;
        }
        self.stale.grow(scene.index_limit());
        if let Changes::Objects(changed) = changes {
            for id in changed {
                if occluders.of_object.contains_key(&(id.index() as u32)) {
                    news = true;
                    self.stale.insert(id.index());
                }
            }
            self.seen = SceneCursor::at(scene);
        }
        news
    }

    /// Forgets the last polygons, so that the next call of [`follow`](Self::follow) begins anew.
    pub(crate) fn reset(&mut self) {
        self.occluders = Stamp::NONE;
    }

    /// Tests whether an object is in the scene and has not changed since the polygons were made. False if the
    /// object was removed or changed.
    fn is_fresh(&self, scene: &Scene, id: ObjectId) -> bool {
        let is_known = id.index() / 64 < self.stale.words().len();
        is_known && !self.stale.contains(id.index()) && !self.lost && scene.contains(id)
    }

    /// Tests whether every object that a polygon was made from is unchanged since, flagged as an occluder,
    /// [always drawn](Scene::is_always_drawn) and on a layer of the view. If false, the polygon must not hide
    /// in this frame.
    pub(crate) fn is_usable(&self, occluders: &Occluders, polygon: u32, scene: &Scene, view: &View) -> bool {
        occluders.sources_of(polygon).iter().all(|&id| {
            self.is_fresh(scene, id)
                && scene.is_always_drawn(id)
                && scene.object(id).is_ok_and(|o| o.occluder && o.layers & view.layers() != 0)
        })
    }

    /// Replaces `chosen` by the up to `count` polygons with the greatest upper bound on their solid angle
    /// from `eye`, greatest first. Polygons with a bound of 0 or less are left out. If `volume` is given,
    /// only polygons that may be inside it are considered. `samples_region` tells that `eye` is a sample of a
    /// region of eyes: a polygon that hides from behind only for eyes in a box around its object then counts
    /// as one-sided. Chooses none if the changes of the scene are not known (`lost` is true).
    pub(crate) fn choose(
        &mut self,
        occluders: &Occluders,
        eye: &Eye,
        samples_region: bool,
        volume: Option<&ViewVolume>,
        count: usize,
    ) {
        self.chosen.clear();
        self.blocks.clear();
        if self.lost || count == 0 {
            return;
        }
        let eye_point = match eye {
            Eye::Point(eye) if !samples_region => Some(*eye),
            _ => None,
        };
        // Rounding is harmless here, since the test only selects candidates.
        let is_in =
            |center: DVec3, radius: f64| volume.is_none_or(|volume| volume.meets_sphere(center, radius));
        // Blocks in descending order of a bound on their polygons' solid angles: the search ends when no
        // later block can have a polygon among the best.
        for (block, number) in occluders.blocks.iter().zip(0..) {
            if is_in(block.center, block.radius) {
                self.blocks.push((block.bound(eye), number));
            }
        }
        self.blocks.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let by_angle = |a: &Chosen, b: &Chosen| b.bound.total_cmp(&a.bound).then(a.polygon.cmp(&b.polygon));
        let mut least = 0.0;
        for &(most, block) in &self.blocks {
            if most <= least {
                break;
            }
            let block = &occluders.blocks[block as usize];
            for number in block.first..block.first + block.count {
                let polygon = &occluders.polygons[number as usize];
                let bound = bound(polygon, occluders.hides_behind(polygon, eye_point), eye);
                if bound > least && polygon.count > 0 && is_in(polygon.center, polygon.radius) {
                    self.chosen.push(Chosen { polygon: number, bound });
                }
            }
            // Twice as many as needed are collected before the best are picked, which takes linear time in
            // sum.
            if self.chosen.len() >= count.saturating_mul(2) {
                self.chosen.select_nth_unstable_by(count - 1, by_angle);
                self.chosen.truncate(count);
                least = self.chosen[count - 1].bound;
            }
        }
        self.chosen.sort_unstable_by(by_angle);
        self.chosen.truncate(count);
    }

    /// Keeps the `count` chosen polygons with the greatest worth, in no particular order. `worth` receives a
    /// polygon's index and the bound on its solid angle, and its result replaces the bound. Does nothing if
    /// no more than `count` polygons are chosen, or if `count` is 0.
    pub(crate) fn keep_worthy(&mut self, count: usize, mut worth: impl FnMut(u32, f32) -> f32) {
        if self.chosen.len() <= count || count == 0 {
            return;
        }
        for chosen in &mut self.chosen {
            chosen.bound = worth(chosen.polygon, chosen.bound);
        }
        let by_worth = |a: &Chosen, b: &Chosen| b.bound.total_cmp(&a.bound).then(a.polygon.cmp(&b.polygon));
        self.chosen.select_nth_unstable_by(count - 1, by_worth);
        self.chosen.truncate(count);
    }

    /// Removes from `chosen` the polygons that must not hide in this frame. All objects of a polygon must be
    /// unchanged since the polygons were made, drawn in this view, and surely on the inner side of the view's
    /// clip planes. For a section (a rectangle inside closed boxes), the eye must also be surely outside all
    /// these boxes. `volume` is the view's.
    pub(crate) fn keep_usable(
        &mut self,
        occluders: &Occluders,
        scene: &Scene,
        view: &View,
        projection: &ClipProjection,
        visible: &VisibleSet,
        volume: &ViewVolume,
    ) {
        let mut chosen = core::mem::take(&mut self.chosen);
        let clip_planes = view.clip_planes_from(scene.origin());
        let clear = projection.clearance();
        chosen.retain(|chosen| {
            let solids = occluders.solids_of(chosen.polygon);
            // The drawn geometry of a section is the faces of its boxes.
            let within = view.clip_planes().is_empty()
                || occluders
                    .surface_of(chosen.polygon)
                    .chain(solids.iter().copied())
                    .all(|around| corners_of(around).all(|v| clip_planes.contains(v)));
            within
                && solids.iter().all(|solid| projection.is_outside(solid, clear))
                && self.is_usable(occluders, chosen.polygon, scene, view)
                && occluders.sources_of(chosen.polygon).iter().all(|&id| is_drawn(scene, visible, volume, id))
        });
        self.chosen = chosen;
    }
}

/// Tests whether an object is in the visible set, or surely outside the view's `volume`. False for an object
/// in view that an earlier culler has removed: that object is not drawn, so it must not hide.
pub(crate) fn is_drawn(scene: &Scene, visible: &VisibleSet, volume: &ViewVolume, id: ObjectId) -> bool {
    visible.contains(scene, id) || scene.bounds(id).is_ok_and(|bounds| volume.is_outside(&bounds))
}

impl Block {
    /// Returns an upper bound on the solid angle of any polygon in the block, in steradians; for parallel
    /// views, on the area in square metres.
    fn bound(&self, eye: &Eye) -> f32 {
        match eye {
            Eye::Point(eye) => {
                let nearest = (eye.distance(self.center) - self.radius).max(0.0);
                ((self.area / (nearest * nearest)) as f32).min(MAX_ANGLE)
            }
            Eye::Direction(_) => self.area as f32,
        }
    }
}

/// Returns an upper bound on the solid angle of a polygon seen from `eye`, in steradians: the height of the
/// eye above the polygon's plane times the polygon's area, divided by the cube of the least distance of the
/// eye from the polygon. For parallel views, the projected area in square metres. `hides_behind` tells
/// whether the polygon hides for eyes behind it; if not, the bound is negative for such eyes.
fn bound(polygon: &Polygon, hides_behind: bool, eye: &Eye) -> f32 {
    match eye {
        Eye::Point(eye) => {
            let to_eye = *eye - polygon.center;
            let height = polygon.normal.dot(to_eye);
            let shown = if hides_behind { height.abs() } else { height };
            let least = (to_eye.length() - polygon.radius).max(height.abs());
            let angle = shown * polygon.area / (least * least * least);
            // Limited to a half-space. NaN, from an eye in the polygon's plane, makes the polygon no
            // candidate.
            (angle as f32).min(MAX_ANGLE)
        }
        Eye::Direction(along) => {
            let shown = -polygon.normal.dot(*along);
            ((if hides_behind { shown.abs() } else { shown }) * polygon.area) as f32
        }
    }
}

/// Returns the solid angle of a convex polygon in steradians, given the corners of its projection; for
/// parallel views, its area in square NDC units (4 for the whole image). Accurate to a few percent, which is
/// enough for ranking. 0 without corners.
pub(crate) fn angle_of(projection: &ClipProjection, corners: &[ShadowCorner]) -> f32 {
    let Some((first, rest)) = corners.split_first() else { return 0.0 };
    let mut sum = 0.0;
    match projection.eye {
        Eye::Point(_) => {
            let unit = |v: [f64; 3]| projection.in_space(v).normalize_or_zero();
            let a = unit(first.v);
            let mut b = DVec3::ZERO;
            for (i, corner) in rest.iter().enumerate() {
                let c = unit(corner.v);
                if i > 0 {
                    sum += solid_angle([a, b, c]);
                }
                b = c;
            }
        }
        Eye::Direction(_) => {
            let flat = |v: [f64; 3]| [v[0] / v[2], v[1] / v[2]];
            let a = flat(first.v);
            for pair in rest.windows(2) {
                let (b, c) = (flat(pair[0].v), flat(pair[1].v));
                sum += 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs();
            }
        }
    }
    sum as f32
}
