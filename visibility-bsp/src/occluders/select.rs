//! Which polygons hide most from where the eye is, by solid angle (Coorg and Teller, "Real-Time Occlusion
//! Culling for Models with Large Occluders", 1997): first by a bound that costs a few operations, then, of
//! the best, by what is in the picture.

use super::polygons::{Block, Occluders, Polygon};
use crate::clip_projection::{ClipProjection, corners_of};
use crate::shadow::Corner;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{
    ObjectId, Scene, View, VisibleSet,
    geometry::Plane,
    scene::{Changes, SceneCursor},
    stamp::Stamp,
    view::Eye,
};

/// Solid angle of half of all directions, in steradians.
const MOST_ANGLE: f32 = core::f32::consts::TAU;

/// A polygon that is chosen for this frame, unless it turns out to be unusable.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chosen {
    pub(crate) polygon: u32,
    /// Upper bound on its solid angle in steradians; later its worth.
    pub(crate) bound: f32,
}

/// Chooses polygons for one view, and knows which objects have changed since the polygons were made.
#[derive(Clone, Debug)]
pub(crate) struct Selector {
    pub(crate) chosen: Vec<Chosen>,
    blocks: Vec<(f32, u32)>,
    /// Stamp of the polygons that the other fields are about; `Stamp::NONE` before the first frame and after
    /// a reset.
    occluders: Stamp,
    /// The scene and revision up to which changes are in `stale`.
    seen: SceneCursor,
    /// By object index, one bit: whether the object has changed since the polygons were made.
    stale: Vec<u64>,
    /// The polygons are of another scene, or more has changed than was listed: none of them can be trusted.
    lost: bool,
}

impl Default for Selector {
    fn default() -> Self {
        Self {
            chosen: Vec::new(),
            blocks: Vec::new(),
            occluders: Stamp::NONE,
            seen: SceneCursor::START,
            stale: Vec::new(),
            lost: false,
        }
    }
}

impl Selector {
    /// Takes in changes of the scene and of the polygons. Returns whether any polygon may be another, or has
    /// become usable or unusable, since the last call.
    pub(crate) fn follow(&mut self, occluders: &Occluders, scene: &Scene) -> bool {
        let mut news = self.occluders != occluders.stamp;
        let mut changes = self.seen.peek(scene);
        if news || self.lost || changes == Changes::Everything {
            // Other polygons, or another scene than in the last frame: what has changed is counted again from
            // where the polygons were made.
            self.occluders = occluders.stamp;
            self.stale.clear();
            changes = occluders.cursor.peek(scene);
            let lost = changes == Changes::Everything;
            news |= !(lost && self.lost);
            self.lost = lost;
        }
        if self.stale.len() * 64 < scene.index_limit() {
            self.stale.resize(scene.index_limit().div_ceil(64), 0);
        }
        if let Changes::Objects(changed) = changes {
            for id in changed {
                if occluders.of_object.contains_key(&(id.index() as u32)) {
                    news = true;
                    self.stale[id.index() / 64] |= 1 << (id.index() % 64);
                }
            }
            self.seen = SceneCursor::at(scene);
        }
        news
    }

    /// Forgets which polygons the memory is about: the next call of `follow` begins anew.
    pub(crate) fn reset(&mut self) {
        self.occluders = Stamp::NONE;
    }

    /// Whether an object is in the scene and has not changed since the polygons were made.
    fn is_fresh(&self, scene: &Scene, id: ObjectId) -> bool {
        let stale = self.stale.get(id.index() / 64).is_none_or(|word| word >> (id.index() % 64) & 1 != 0);
        !stale && !self.lost && scene.contains(id)
    }

    /// Whether all objects that a polygon was made from are unchanged, flagged as occluders, and on a layer
    /// of the view.
    pub(crate) fn is_usable(&self, occluders: &Occluders, polygon: u32, scene: &Scene, view: &View) -> bool {
        occluders.sources_of(polygon).iter().all(|&id| {
            self.is_fresh(scene, id)
                && scene.object(id).is_ok_and(|o| o.occluder && o.layers & view.layers() != 0)
        })
    }

    /// Chooses up to `count` polygons by the bound on their solid angle, of those that may be in the picture,
    /// or all around.
    pub(crate) fn choose(&mut self, occluders: &Occluders, eye: &Eye, sides: Option<&[Plane]>, count: usize) {
        self.chosen.clear();
        self.blocks.clear();
        if self.lost || count == 0 {
            return;
        }
        // Only a choice: rounding does no harm.
        let is_in = |center: DVec3, radius: f64| {
            sides.is_none_or(|sides| sides.iter().all(|side| side.signed_distance(center) > -radius))
        };
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
                let bound = bound(polygon, eye);
                if bound > least && polygon.count > 0 && is_in(polygon.center, polygon.radius) {
                    self.chosen.push(Chosen { polygon: number, bound });
                }
            }
            if self.chosen.len() >= count.saturating_mul(2) {
                self.chosen.select_nth_unstable_by(count - 1, by_angle);
                self.chosen.truncate(count);
                least = self.chosen[count - 1].bound;
            }
        }
        self.chosen.sort_unstable_by(by_angle);
        self.chosen.truncate(count);
    }

    /// Keeps the `count` chosen polygons of greatest worth. `worth` is given a polygon and the bound on its
    /// solid angle.
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

    /// Keeps the chosen polygons that may hide in this frame: those whose objects are unchanged and drawn in
    /// this view, on the inner side of its clip planes; and sections only if the eye is outside their boxes.
    pub(crate) fn keep_usable(
        &mut self,
        occluders: &Occluders,
        scene: &Scene,
        view: &View,
        projection: &ClipProjection,
        visible: &VisibleSet,
        sides: &[Plane],
    ) {
        let mut chosen = core::mem::take(&mut self.chosen);
        let clip_planes = view.clip_planes_from(scene.origin());
        let clear = projection.clearance();
        chosen.retain(|chosen| {
            let solids = occluders.solids_of(chosen.polygon);
            // Of a section, what is drawn are the faces of its boxes.
            let within = view.clip_planes().is_empty()
                || occluders
                    .occluder_polygon(chosen.polygon)
                    .vertices
                    .iter()
                    .all(|&v| clip_planes.contain(v))
                    && solids.iter().all(|&solid| corners_of(solid).all(|v| clip_planes.contain(v)));
            within
                && solids.iter().all(|solid| projection.is_outside(solid, clear))
                && self.is_usable(occluders, chosen.polygon, scene, view)
                && occluders.sources_of(chosen.polygon).iter().all(|&id| is_drawn(scene, visible, sides, id))
        });
        self.chosen = chosen;
    }
}

/// Whether an object is in the set, or outside the view. An object in view that an earlier culler removed is
/// not drawn, so it must not hide.
pub(crate) fn is_drawn(scene: &Scene, visible: &VisibleSet, sides: &[Plane], id: ObjectId) -> bool {
    visible.contains(scene, id)
        || scene.bounds(id).is_ok_and(|bounds| {
            sides.iter().any(|s| s.classify_aabb(&bounds) == visibility_core::geometry::Containment::Outside)
        })
}

/// Writes the planes of a view, each moved outwards by its rounding error, to `out`, and returns their
/// number.
pub(crate) fn sides_of(
    view: &View,
    scene: &Scene,
    out: &mut [Plane; visibility_core::view::MAX_PLANES],
) -> usize {
    let planes = view.planes(scene.origin());
    for (out, side) in out.iter_mut().zip(planes.as_slice()) {
        *out = Plane::new(side.plane.normal, side.plane.offset + side.error);
    }
    planes.as_slice().len()
}

impl Block {
    /// Upper bound on the solid angle of any polygon in the block.
    fn bound(&self, eye: &Eye) -> f32 {
        match eye {
            Eye::Point(eye) => {
                let nearest = (eye.distance(self.center) - self.radius).max(0.0);
                ((self.area / (nearest * nearest)) as f32).min(MOST_ANGLE)
            }
            Eye::Direction(_) => self.area as f32,
        }
    }
}

/// No less than the solid angle of a polygon, if it is before the eye: its height over the eye times its area
/// over the cube of the least distance.
fn bound(polygon: &Polygon, eye: &Eye) -> f32 {
    match eye {
        Eye::Point(eye) => {
            let to_eye = *eye - polygon.center;
            let height = polygon.normal.dot(to_eye);
            let shown = if polygon.two_sided { height.abs() } else { height };
            let least = (to_eye.length() - polygon.radius).max(height.abs());
            let angle = shown * polygon.area / (least * least * least);
            // A half-space at most. NaN, of an eye in the plane, is no candidate.
            (angle as f32).min(MOST_ANGLE)
        }
        Eye::Direction(along) => {
            let shown = -polygon.normal.dot(*along);
            ((if polygon.two_sided { shown.abs() } else { shown }) * polygon.area) as f32
        }
    }
}

/// The solid angle of a convex polygon, in steradians; for parallel views its share of the picture, four for
/// all of it. Good to a few percent, which is enough to choose by.
pub(crate) fn angle_of(projection: &ClipProjection, corners: &[Corner]) -> f32 {
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
                    sum += solid_angle(a, b, c);
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

/// Solid angle of a triangle of unit vectors, in steradians (Van Oosterom and Strackee, "The Solid Angle of a
/// Plane Triangle", 1983).
fn solid_angle(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let y = a.dot(b.cross(c)).abs();
    let x = 1.0 + a.dot(b) + b.dot(c) + c.dot(a);
    // The arc tangent to a few thousandths: t (1.0584 - 0.273 t) between 0 and 1.
    let arc = |t: f64| t * (core::f64::consts::FRAC_PI_4 + 0.273 * (1.0 - t));
    let angle = if x >= y {
        arc(y / x)
    } else if x >= -y {
        core::f64::consts::FRAC_PI_2 - (if x >= 0.0 { arc(x / y) } else { -arc(-x / y) })
    } else {
        core::f64::consts::PI - arc(-y / x)
    };
    if angle.is_finite() { 2.0 * angle } else { 0.0 }
}
