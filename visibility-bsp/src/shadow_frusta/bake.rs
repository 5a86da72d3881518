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

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::Vec3;
    use visibility_core::{Aabb, Object, occlusion::Preparation};

    /// Inserts a square across the x axis, an occluder whose front is seen from the origin.
    fn insert_square(scene: &mut Scene, x: f32, half: f32) {
        let corner = |y: f32, z: f32| Vec3::new(x, y * half, z * half);
        let [a, b, c, d] = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
        let bounds = Aabb::from_points([a, b, c, d]);
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        scene.set_triangles(id, [[a, b, c], [a, c, d]]).unwrap();
    }

    /// Centres of objects, beside the shadow of a square 4 m away with sides of 2 m, and in it.
    #[test]
    fn a_polygon_hides_the_centres_in_its_shadow() {
        for two_sided in [false, true] {
            let mut scene = Scene::new();
            insert_square(&mut scene, 4.0, 1.0);
            scene.prepare_occluders(&Preparation::default().with_two_sided(two_sided));
            let occluders = Occluders::new(&scene);
            assert_eq!(occluders.len(), 1, "a polygon of two triangles");
            let points: [([f64; 3], bool); 9] = [
                ([8.0, 0.0, 0.0], true),
                ([8.0, 1.9, -1.9], true),
                ([8.0, 2.1, 0.0], false),
                ([8.0, -2.1, 0.0], false),
                ([8.0, 0.0, 2.1], false),
                ([8.0, 0.0, -2.1], false),
                ([4.1, 0.9, 0.9], true),
                ([3.9, 0.0, 0.0], false),
                ([-1.0, 0.0, 0.0], false),
            ];
            let objects = points.map(|(p, _)| DVec3::from_array(p)).to_vec();
            let bake = Bake { occluders: &occluders, objects, selector: Selector::default(), most: 1 };
            // From the front, in the plane, from behind, far to a side, and again from the front.
            let eyes = [[0.0, 0.0, 0.0], [4.0, 0.0, 9.0], [12.0, 0.0, 0.0], [3.0, 90.0, 0.0], [0.0; 3]];
            let set = bake.hidden_by(0, &eyes.map(DVec3::from_array));
            let is_hidden = |sample: usize, object: usize| {
                let bit = sample * OBJECTS + object;
                set[bit / 64] >> (bit % 64) & 1 == 1
            };
            for (object, (point, is)) in points.iter().enumerate() {
                let found = [0, 1, 2, 3, 4].map(|sample| is_hidden(sample, object));
                // From behind, those before the square are hidden.
                let from_behind = two_sided && point[0] < 4.0;
                assert_eq!(found, [*is, false, from_behind, false, *is], "{point:?}, two-sided: {two_sided}");
            }
            let count: u32 = set.iter().map(|word| word.count_ones()).sum();
            assert_eq!(count, 2 * 3 + 2 * u32::from(two_sided), "pairs of eyes and objects");
        }
    }

    /// Squares along the x axis, each hiding what is between it and the next.
    #[test]
    fn regions_have_the_polygons_that_hide_most_from_there() {
        let mut scene = Scene::new();
        insert_square(&mut scene, 8.0, 6.0);
        insert_square(&mut scene, 24.0, 6.0);
        for x in [10.0f32, 11.0, 12.0, 26.0] {
            scene.insert(Aabb::from_arrays([x, -0.5, -0.5], [x + 0.5, 0.5, 0.5]));
        }
        scene.insert(Aabb::from_arrays([0.0, -0.5, -0.5], [32.0, 0.5, 0.5]));
        scene.prepare_occluders(&Preparation::default());
        let occluders = Occluders::new(&scene);
        let at = |polygon: u32| occluders.bounding_sphere(polygon).0.x;
        for (regions, polygons) in [(0, 1), (1, 1), (2, 1), (4, 1), (7, 2), (64, 2)] {
            let frusta = ShadowFrusta::new(&scene, occluders.clone(), regions, polygons);
            assert_eq!(frusta.regions(), regions.max(1), "regions");
            let chosen = |x: f64| -> Vec<f64> {
                frusta.chosen_at(DVec3::new(x, 0.0, 0.0)).iter().map(|&polygon| at(polygon)).collect()
            };
            if regions < 2 {
                // In the middle of the scene, and near its ends.
                assert_eq!(chosen(1.0), chosen(31.0), "one region");
                continue;
            }
            for x in [-99.0, 0.0, 1.0, 3.9] {
                assert_eq!(chosen(x)[0], 8.0, "from {x}, {regions} regions");
            }
            for x in [16.0, 17.0, 19.9] {
                assert_eq!(chosen(x)[0], 24.0, "from {x}, {regions} regions");
            }
        }
        // The whole of the second half hides nothing, and has a polygon all the same.
        let two = ShadowFrusta::new(&scene, occluders.clone(), 2, 3);
        assert!(!two.chosen_at(DVec3::X * 31.0).is_empty(), "polygons of the second half");
        assert_eq!(two.chosen_at(DVec3::X * 16.0), two.chosen_at(DVec3::X * 99.0), "from the middle on");
        assert_ne!(two.chosen_at(DVec3::X * 15.9), two.chosen_at(DVec3::X * 16.0), "before the middle");
    }

    #[test]
    fn a_scene_without_finite_bounds_has_one_region() {
        let mut scene = Scene::new();
        for number in 0..2 {
            let frusta = ShadowFrusta::new(&scene, Occluders::new(&scene), 64, 16);
            assert_eq!(frusta.regions(), 1, "{number} objects");
            assert_eq!(frusta.chosen_at(DVec3::ZERO), &[] as &[u32], "{number} objects");
            scene.insert(Aabb::from_arrays([f32::NEG_INFINITY; 3], [1.0; 3]));
        }
    }
}
