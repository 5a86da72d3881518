//! Choice of occluders for each region, made in advance.

use crate::occluders::{Occluders, Selector};
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{Scene, view::Eye};

/// Number of sample eyes per region: its centre, and points near four of its corners.
const SAMPLES: usize = 5;
/// Limits the cost of the bake: for each sample eye of a region, at most half as many polygons are
/// considered, those with the greatest solid angle from that eye.
const CANDIDATES: usize = 96;
/// Maximum number of objects whose centres are sampled to count hidden objects.
const OBJECTS: usize = 512;
/// Number of 64-bit words of a bitset with one bit for each pair of a sample eye and a sampled object.
const WORDS: usize = SAMPLES * OBJECTS / 64;

/// A node of the kd-tree that divides the scene's bounds into regions of eye positions.
#[derive(Clone, Copy, Debug)]
enum Region {
    /// An inner node: the axis (0 to 2) and the coordinate of the dividing plane in metres relative to
    /// `Scene::origin`, and the indices of the children below it and at or above it.
    Split { axis: usize, at: f64, children: [u32; 2] },
    /// A region of eye positions. Its chosen polygons are `count` entries of `ShadowFrusta::chosen` from
    /// index `first`.
    Leaf { first: u32, count: u32 },
}

/// The occluder polygons that hide most objects from eyes in each region of space.
///
/// Made when a scene is loaded, and shared by the cullers of all views. An eye outside the scene's bounds
/// uses the nearest region. Polygons of objects that have changed since are not used until the frusta are
/// made anew.
///
/// Takes about a millisecond per region.
///
/// ```
/// use visibility_bsp::{Occluders, ShadowFrusta};
/// use visibility_core::Scene;
/// let scene = Scene::new();
/// let frusta = ShadowFrusta::new(&scene, Occluders::new(&scene), 64, 16);
/// assert_eq!(frusta.regions(), 1);
/// ```
#[derive(Clone, Debug)]
pub struct ShadowFrusta {
    /// Occluder polygons of the scene, to which the indices in `chosen` refer.
    pub(super) occluders: Occluders,
    /// Nodes of the kd-tree over eye positions, whose leaves are the regions. The root is at index 0.
    regions: Vec<Region>,
    /// Indices in `occluders` of the polygons chosen for all regions; best first within each region.
    chosen: Vec<u32>,
    /// Maximum number of polygons chosen per region.
    pub(super) most: usize,
}

/// Data used to choose the polygons of every region, and settings of the choice.
struct Bake<'a> {
    /// Occluder polygons to choose from.
    occluders: &'a Occluders,
    /// Centres of the sampled objects, in metres relative to `Scene::origin`.
    objects: Vec<DVec3>,
    /// Finds the polygons with the greatest solid angle from a sample eye, among which a region's polygons
    /// are chosen.
    selector: Selector,
    /// Maximum number of polygons chosen per region.
    most: usize,
}

impl ShadowFrusta {
    /// Chooses up to `polygons` of the `occluders` of a scene for each of `regions` regions of the scene's
    /// bounds. `regions` is clamped to 1 to 65,536. A scene without finite bounds gets one region without
    /// occluders.
    pub fn new(scene: &Scene, occluders: Occluders, regions: usize, polygons: usize) -> Self {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let mut objects = Vec::new();
        for id in scene.ids() {
            if let Ok(bounds) = scene.bounds(id)
                && bounds.is_finite()
            {
                (min, max) = (min.min(bounds.min.as_dvec3()), max.max(bounds.max.as_dvec3()));
                objects.push(bounds.center().as_dvec3());
            }
        }
        // An even sample: neighbours in the list are neighbours in the scene.
        let step = objects.len().div_ceil(OBJECTS).max(1);
        let objects: Vec<DVec3> = objects.into_iter().step_by(step).take(OBJECTS).collect();
        let mut made = Self { occluders, regions: Vec::new(), chosen: Vec::new(), most: polygons };
        if !(min.is_finite() && max.is_finite()) {
            made.regions.push(Region::Leaf { first: 0, count: 0 });
            return made;
        }
        let occluders = core::mem::take(&mut made.occluders);
        let mut bake = Bake { occluders: &occluders, objects, selector: Selector::default(), most: polygons };
        made.divide(&mut bake, min, max, regions.clamp(1, 1 << 16));
        made.occluders = occluders;
        made
    }

    /// Returns the number of regions of eye positions, at least 1.
    pub fn regions(&self) -> usize {
        self.regions.iter().filter(|region| matches!(region, Region::Leaf { .. })).count()
    }

    /// Returns the indices in `Occluders::polygons` of the polygons chosen for the region that contains the
    /// eye, in metres relative to `Scene::origin`; for an eye outside the bounds, those of the nearest
    /// region.
    pub(super) fn chosen_at(&self, eye: DVec3) -> &[u32] {
        let mut region = 0;
        loop {
            match self.regions[region] {
                Region::Split { axis, at, children } => {
                    region = children[usize::from(eye[axis] >= at)] as usize;
                }
                Region::Leaf { first, count } => {
                    return &self.chosen[first as usize..(first + count) as usize];
                }
            }
        }
    }

    /// Divides a box in metres relative to `Scene::origin` into `regions` regions, halving it across its
    /// longest side, and chooses the polygons of each. Returns the index of the box's node.
    fn divide(&mut self, bake: &mut Bake<'_>, min: DVec3, max: DVec3, regions: usize) -> u32 {
        let number = self.regions.len();
        self.regions.push(Region::Leaf { first: 0, count: 0 });
        self.regions[number] = if regions <= 1 {
            let first = self.chosen.len() as u32;
            bake.choose(min, max, &mut self.chosen);
            Region::Leaf { first, count: self.chosen.len() as u32 - first }
        } else {
            let axis = (max - min).max_position();
            let at = min[axis] * 0.5 + max[axis] * 0.5;
            let (mut middle_max, mut middle_min) = (max, min);
            (middle_max[axis], middle_min[axis]) = (at, at);
            let lower = self.divide(bake, min, middle_max, regions / 2);
            let upper = self.divide(bake, middle_min, max, regions - regions / 2);
            Region::Split { axis, at, children: [lower, upper] }
        };
        number as u32
    }
}

impl Bake<'_> {
    /// Appends to `out` the indices of the polygons that together hide most sampled objects from eyes in the
    /// region from `min` to `max` (metres relative to `Scene::origin`), best first. Appends at most `most`
    /// indices.
    fn choose(&mut self, min: DVec3, max: DVec3, out: &mut Vec<u32>) {
        let at = |share: [f64; 3]| min + (max - min) * DVec3::from_array(share);
        // The centre, and points near four alternate corners of the region.
        let eyes: [DVec3; SAMPLES] =
            [[0.5, 0.5, 0.5], [0.1, 0.1, 0.1], [0.9, 0.9, 0.1], [0.9, 0.1, 0.9], [0.1, 0.9, 0.9]].map(at);
        // Candidates look large from any of the sample eyes. A polygon that several eyes choose keeps its
        // greatest bound.
        let mut candidates: Vec<(u32, f32)> = Vec::new();
        for eye in eyes {
            self.selector.choose(self.occluders, &Eye::Point(eye), true, None, CANDIDATES / 2);
            candidates.extend(self.selector.chosen.iter().map(|c| (c.polygon, c.bound)));
        }
        candidates.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
        candidates.dedup_by_key(|candidate| candidate.0);
        let mut sets: Vec<(u32, f32, [u64; WORDS])> = candidates
            .into_iter()
            .map(|(polygon, bound)| (polygon, bound, self.hidden_by(polygon, &eyes)))
            .collect();
        // Greedy: the polygon that hides most samples not hidden yet. Ties go to the larger solid angle, then
        // to the lower index.
        let mut hidden = [0u64; WORDS];
        for _ in 0..self.most {
            let gain = |set: &[u64; WORDS]| -> u32 {
                set.iter().zip(&hidden).map(|(a, b)| (a & !b).count_ones()).sum()
            };
            let gains = sets.iter().enumerate().map(|(at, set)| (gain(&set.2), at));
            let best = gains.max_by(|&(gain_a, a), &(gain_b, b)| {
                gain_a.cmp(&gain_b).then(sets[a].1.total_cmp(&sets[b].1)).then(sets[b].0.cmp(&sets[a].0))
            });
            let Some((_, best)) = best else { break };
            let (polygon, _, set) = sets.swap_remove(best);
            // No further candidate hides more. One polygon is chosen even if it hides no sample.
            if set.iter().zip(&hidden).all(|(a, b)| a & !b == 0) && !sets.is_empty() && hidden != [0; WORDS] {
                break;
            }
            hidden.iter_mut().zip(&set).for_each(|(all, one)| *all |= one);
            out.push(polygon);
        }
    }

    /// Returns the bitset of sampled objects whose centres a polygon hides: bit `sample * OBJECTS + object`
    /// is 1 if the polygon hides that sampled object from that sample eye. `polygon` is an index in
    /// `Occluders`, and `eyes` are in metres relative to `Scene::origin`. Not bounded for rounding, since it
    /// only guides the choice.
    fn hidden_by(&self, polygon: u32, eyes: &[DVec3; SAMPLES]) -> [u64; WORDS] {
        let occluder_polygon = self.occluders.outside_polygon(polygon);
        let mut set = [0u64; WORDS];
        // Normals of the planes through the eye and each edge.
        let mut sides = Vec::new();
        let (normal, extent_along_normal) = (occluder_polygon.normal, occluder_polygon.extent_along_normal);
        for (sample, eye) in eyes.iter().enumerate() {
            let height = normal.dot(*eye) - extent_along_normal[1];
            let side = if height > 0.0 {
                1.0
            } else if occluder_polygon.two_sided && normal.dot(*eye) < extent_along_normal[0] {
                -1.0
            } else {
                continue;
            };
            let corners = occluder_polygon.vertices;
            let next = corners.iter().cycle().skip(1);
            sides.clear();
            sides.extend(corners.iter().zip(next).map(|(a, b)| (*a - *eye).cross(*b - *eye)));
            for (object, p) in self.objects.iter().enumerate() {
                let behind = (normal.dot(*p) - extent_along_normal[0]) * side < 0.0;
                if behind && sides.iter().all(|normal| normal.dot(*p - *eye) * side < 0.0) {
                    let bit = sample * OBJECTS + object;
                    set[bit / 64] |= 1 << (bit % 64);
                }
            }
        }
        set
    }
}
