//! Several views in one walk of the hierarchy: the faces of a cube, the eyes of a headset, the cascades of a shadow map.
//!
//! Views that share a place cross the same nodes. Walked once, a node's boxes are fetched once and tested against the planes of each
//! view that crosses it, and each view goes on only where it has something to test.

use crate::frustum::TestPlanes;
use crate::scene::{NONE, lanes};
use crate::view::MAX_PLANES;
use crate::{CullStats, Scene, Simd, View, VisibleSet};

/// How many views are walked at once; more are taken in turns.
const AT_ONCE: usize = 8;

/// Removes what lies outside the planes of each of several views: the answers of as many [`FrustumCuller`](crate::FrustumCuller)s.
///
/// Six faces of a cube take no longer than with six cullers one after another; see `benches/RESULTS.md` of the repository.
/// Not a [`Culler`](crate::Culler), which has one view: it stands in the place of the first stage of as many pipelines. Other cullers may follow on
/// each set; [`VisibleSet::finish`] ends the frame for sets that tell of changes, [`VisibleSet::union`] makes one of several.
///
/// ```
/// use visibility_core::{glam::DVec3, Aabb, MultiViewCuller, Scene, View, VisibleSet};
/// let mut scene = Scene::new();
/// let above = scene.insert(Aabb::from_arrays([-1.0, -1.0, 7.0], [1.0, 1.0, 8.0]));
/// let faces = View::cube_faces(DVec3::ZERO, 0.1, 100.0)?;
/// let mut culler = MultiViewCuller::new();
/// let mut sets = [(); 6].map(|_| VisibleSet::new());
/// // Each frame:
/// culler.cull(&scene, &faces, &mut sets);
/// assert_eq!(sets.map(|set| set.contains(&scene, above)), [false, false, false, false, true, false]);
/// # Ok::<(), visibility_core::ViewError>(())
/// ```
#[derive(Clone, Debug)]
pub struct MultiViewCuller {
    simd: Simd,
}

impl Default for MultiViewCuller {
    fn default() -> Self {
        Self::new()
    }
}

impl MultiViewCuller {
    /// Uses the widest instructions that the processor has.
    pub fn new() -> Self {
        Self::with_simd(Simd::best())
    }

    /// Uses the given instructions, for tests and comparisons.
    pub const fn with_simd(simd: Simd) -> Self {
        Self { simd }
    }

    /// Fills each set with the objects on the layers of its view, as [`VisibleSet::fill`] does, and removes what lies outside the view.
    /// Views and sets correspond in order; if there are more of one than of the other, the rest is left as it is.
    ///
    /// Returns the counters of all views together; `nodes` counts a node once however many views cross it.
    pub fn cull(&mut self, scene: &Scene, views: &[View], sets: &mut [VisibleSet]) -> CullStats {
        let mut sum = CullStats::default();
        for (views, sets) in views.chunks(AT_ONCE).zip(sets.chunks_mut(AT_ONCE)) {
            let count = views.len().min(sets.len());
            let visible = sum.visible;
            sum += Frame::walk(self.simd, scene, &views[..count], &mut sets[..count]);
            sum.visible += visible;
        }
        sum
    }
}

/// What one walk of the hierarchy needs.
struct Frame<'a> {
    simd: Simd,
    scene: &'a Scene,
    sets: &'a mut [VisibleSet],
    planes: [TestPlanes; AT_ONCE],
    stats: CullStats,
}

impl<'a> Frame<'a> {
    fn walk(simd: Simd, scene: &'a Scene, views: &[View], sets: &'a mut [VisibleSet]) -> CullStats {
        let mut planes = [const { TestPlanes::NONE }; AT_ONCE];
        let mut active = [0; AT_ONCE];
        for (i, (view, set)) in views.iter().zip(sets.iter_mut()).enumerate() {
            set.fill(scene, view);
            planes[i] = TestPlanes::new(view.planes(scene.origin()).as_slice());
            active[i] = planes[i].all;
        }
        let crossed = (1 << sets.len()) - 1;
        let mut frame = Self { simd, scene, sets, planes, stats: CullStats::default() };
        if scene.tree().root != NONE {
            frame.visit(scene.tree().root as usize, crossed, &active);
        }
        let mut stats = frame.stats;
        for set in frame.sets {
            set.commit();
            stats.visible += set.unculled_count(scene);
        }
        stats
    }

    /// Tests the children of a node, for each view in `crossed`, against the planes of `active` that cross it, and goes on below.
    /// The views that have anything left.
    fn visit(&mut self, node: usize, crossed: u64, active: &[u32; AT_ONCE]) -> u64 {
        let tree = self.scene.tree();
        let boxes = &tree.bounds[node];
        let is_leaf = tree.levels[node] == 0;
        self.stats.nodes += 1;
        let mut masks = [0; AT_ONCE];
        let mut inside = [[0; MAX_PLANES]; AT_ONCE];
        let (mut some, mut any) = (0, 0);
        for view in lanes(crossed) {
            let (planes, active) = (&self.planes[view], active[view]);
            let candidates = self.sets[view].mask(self.scene, node);
            let mask = candidates & !self.simd.any_outside(boxes, &planes.planes, active);
            self.stats.tests += u64::from(candidates.count_ones()) * u64::from(active.count_ones());
            if is_leaf {
                self.stats.visible += u64::from(mask.count_ones());
                self.sets[view].set_mask(node, mask);
                some |= u64::from(mask != 0) << view;
            } else if mask != 0 {
                for plane in lanes(active.into()) {
                    inside[view][plane] = self.simd.any_outside(boxes, &planes.flipped, 1 << plane);
                }
            }
            masks[view] = mask;
            any |= mask;
        }
        if is_leaf {
            return some;
        }
        for lane in lanes(any) {
            let child = tree.child(node, lane);
            let (mut below, mut crossing) = (0, [0; AT_ONCE]);
            for view in lanes(crossed) {
                if masks[view] >> lane & 1 == 0 {
                    continue;
                }
                crossing[view] = lanes(active[view].into())
                    .fold(0, |set, plane| set | ((!inside[view][plane] >> lane & 1) as u32) << plane);
                if crossing[view] != 0 {
                    below |= 1 << view;
                    continue;
                }
                let kept = self.sets[view].keep_below(self.scene, child);
                self.stats.whole += 1;
                self.stats.visible += kept;
                masks[view] &= !(u64::from(kept == 0) << lane);
            }
            let empty = if below == 0 { 0 } else { below & !self.visit(child, below, &crossing) };
            for view in lanes(empty) {
                masks[view] &= !(1 << lane);
            }
        }
        for view in lanes(crossed) {
            self.sets[view].set_mask(node, masks[view]);
            some |= u64::from(masks[view] != 0) << view;
        }
        some
    }
}
