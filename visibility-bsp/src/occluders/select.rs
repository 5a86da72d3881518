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
        // The bits reach as far as the indices of the scene, which the polygons need not be of.
        !self.lost && scene.contains(id) && !self.stale.contains(id.index())
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

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::Vec3;
    use visibility_core::{Aabb, Object, Pose, occlusion::Preparation, view::Window};
    use visibility_testing::Random;

    /// Returns a scene of random triangles, each an occluder of its own, and their polygons.
    fn triangles(count: usize) -> (Scene, Occluders) {
        let (mut scene, mut random) = (Scene::new(), Random(51));
        for number in 0..count {
            let center = random.fine_vector(20.0);
            let size = [0.2, 1.0, 6.0][number % 3];
            let triangle: [Vec3; 3] = [(); 3].map(|()| (center + random.fine_vector(size)).as_vec3());
            let bounds = Aabb::from_points(triangle);
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            scene.set_triangles(id, [triangle]).unwrap();
        }
        let two_sided = Preparation::default().with_sliver(0.0).with_two_sided(count.is_multiple_of(2));
        scene.prepare_occluders(&two_sided);
        let occluders = Occluders::new(&scene);
        (scene, occluders)
    }

    /// Eyes far from all polygons and among them, and directions.
    fn eyes() -> Vec<Eye> {
        let mut random = Random(52);
        (0..30)
            .map(|i| match i % 3 {
                0 => Eye::Direction(random.direction()),
                _ => Eye::Point(random.fine_vector([5.0, 60.0][i % 2])),
            })
            .collect()
    }

    #[test]
    fn the_polygons_with_the_greatest_bounds_are_chosen() {
        for triangles_of in [200, 201, 5] {
            let (scene, occluders) = triangles(triangles_of);
            assert_eq!(occluders.len(), triangles_of, "a polygon for each triangle");
            let mut selector = Selector::default();
            assert!(selector.follow(&occluders, &scene), "new polygons");
            assert!(!selector.follow(&occluders, &scene), "nothing new");
            let pose = Pose::look_at(DVec3::new(-9.0, 2.0, 1.0), DVec3::ZERO, DVec3::Z);
            let view = View::perspective(pose, 0.7, 1.0, 0.1, 30.0).unwrap();
            let volume = ViewVolume::new(&view, &scene, 0.0);
            for eye in eyes() {
                for (volume, count) in
                    [None, Some(&volume)].into_iter().flat_map(|v| [0, 1, 7, 40, 1000].map(|c| (v, c)))
                {
                    selector.choose(&occluders, &eye, false, volume, count);
                    let point = if let Eye::Point(eye) = eye { Some(eye) } else { None };
                    let mut expected: Vec<(f32, u32)> = (0..)
                        .zip(&occluders.polygons)
                        .filter(|(_, p)| volume.is_none_or(|volume| volume.meets_sphere(p.center, p.radius)))
                        .map(|(number, p)| (bound(p, occluders.hides_behind(p, point), &eye), number))
                        .filter(|(bound, _)| *bound > 0.0)
                        .collect();
                    expected.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
                    expected.truncate(count);
                    let found: Vec<(f32, u32)> =
                        selector.chosen.iter().map(|c| (c.bound, c.polygon)).collect();
                    assert_eq!(found, expected, "{count} of {triangles_of}, from {eye:?}");
                }
            }
        }
    }

    /// The bound of a polygon is not below its solid angle, which is known to 6 %, or its projected area.
    /// That of a block is not below those of its polygons.
    #[test]
    fn bounds_on_solid_angles_hold() {
        let (_, occluders) = triangles(200);
        let mut near = 0;
        for eye in eyes() {
            for block in &occluders.blocks {
                let bound_of_block = block.bound(&eye);
                for polygon in &occluders.polygons[block.first as usize..][..block.count as usize] {
                    let bound = [true, false].map(|behind| bound(polygon, behind, &eye));
                    assert!(bound[0] <= bound_of_block, "{} of {bound_of_block}", bound[0]);
                    assert!(bound[0] >= 0.0 && bound[0] <= MAX_ANGLE.max(bound_of_block), "{bound:?}");
                    assert!(bound[1] == bound[0] || bound[1] <= 0.0, "{bound:?}");
                    let corners = &occluders.vertices[polygon.first as usize..][..3];
                    let (angle, is_front) = match eye {
                        Eye::Point(eye) => {
                            let height = polygon.normal.dot(eye - corners[0]);
                            let unit = |k: usize| (corners[k] - eye).normalize();
                            (solid_angle([unit(0), unit(1), unit(2)]), height > 0.0)
                        }
                        Eye::Direction(along) => {
                            let rise = polygon.normal.dot(along);
                            (polygon.area * rise.abs(), rise < 0.0)
                        }
                    };
                    assert!(f64::from(bound[0]) >= angle * 0.94, "{} for {angle} from {eye:?}", bound[0]);
                    assert!(bound[0] < 1e-6 || (bound[1] > 0.0) == is_front, "{bound:?} from {eye:?}");
                    if matches!(eye, Eye::Direction(_)) {
                        assert!((f64::from(bound[0]) - angle).abs() <= 1e-6 * angle, "an area is exact");
                    }
                    near += usize::from(bound[0] == MAX_ANGLE);
                }
            }
        }
        assert!(near > 10, "eyes near a polygon: {near}");
        // Eyes inside of a sphere, and in the plane of a polygon.
        let block = Block { center: DVec3::ZERO, radius: 2.0, area: 1.0, first: 0, count: 0 };
        for (x, expected) in [(0.0, MAX_ANGLE), (2.0, MAX_ANGLE), (3.0, 1.0), (4.0, 0.25)] {
            assert_eq!(block.bound(&Eye::Point(DVec3::X * x)), expected, "a block from {x} m");
        }
        assert_eq!(block.bound(&Eye::Direction(DVec3::X)), 1.0, "the area of a block");
    }

    #[test]
    fn the_polygons_of_the_greatest_worth_are_kept() {
        let chosen =
            |count: u32| (0..count).map(|polygon| Chosen { polygon, bound: 1.0 + polygon as f32 }).collect();
        for (count, all, expected) in [
            // Worth is 7 for polygons 0 and 3 of each 5; of equal ones, those of lower numbers are kept.
            (3, 10, &[0, 3, 5][..]),
            (1, 10, &[0]),
            (10, 10, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
            (0, 3, &[0, 1, 2]),
            (4, 3, &[0, 1, 2]),
        ] {
            let mut selector = Selector { chosen: chosen(all), ..Selector::default() };
            let mut asked = 0;
            selector.keep_worthy(count, |polygon, bound| {
                asked += 1;
                assert_eq!(bound, 1.0 + polygon as f32, "bound of polygon {polygon}");
                if polygon % 5 % 3 == 0 { 7.0 } else { 1.0 }
            });
            let mut found: Vec<u32> = selector.chosen.iter().map(|chosen| chosen.polygon).collect();
            found.sort_unstable();
            assert_eq!(found, expected, "{count} of {all}");
            let is_ranked = count > 0 && (all as usize) > count;
            assert_eq!(asked, if is_ranked { all } else { 0 }, "worths asked for, {count} of {all}");
        }
    }

    /// A square of 2 m, 10 m away in the middle of the image: an image 2 wide has an area of 4.
    #[test]
    fn angles_of_projections_are_those_of_their_corners() {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        for (view, expected) in [
            (View::perspective_off_center(pose, Window::centered(1.0, 1.0), 0.1, 99.0).unwrap(), 0.04),
            (View::orthographic(pose, Window::centered(4.0, 2.0), 0.1, 99.0).unwrap(), 0.5),
        ] {
            let projection = ClipProjection::new(&view, DVec3::ZERO);
            let corner = |[y, z]: [f64; 2]| {
                let p = DVec3::new(10.0, y, z);
                let [x, y, w] = projection.values(p);
                let size = x.abs().max(y.abs()).max(w.abs());
                ShadowCorner { p, v: [x / size, y / size, w / size], size, edge: 0 }
            };
            let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(corner);
            for first in 0..4 {
                let mut corners = corners;
                corners.rotate_left(first);
                let angle = angle_of(&projection, &corners);
                assert!(
                    (angle - expected).abs() < 0.06 * expected,
                    "{angle} of {expected}, from corner {first}"
                );
            }
            let half = angle_of(&projection, &corners[..3]);
            assert!((half - 0.5 * expected).abs() < 0.03 * expected, "{half} of {expected}, of a triangle");
            assert_eq!(angle_of(&projection, &corners[..2]), 0.0, "of an edge");
            assert_eq!(angle_of(&projection, &[]), 0.0, "of nothing");
        }
    }
}
