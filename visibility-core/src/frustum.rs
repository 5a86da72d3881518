//! Frustum culling: boxes outside one of the planes of the view are hidden. The walk serves any convex volume of planes.
//!
//! The hierarchy is walked from the top, 64 boxes a test. A node passes to each child only those planes that cross it
//! (Assarsson and Möller, "Optimized View Frustum Culling Algorithms for Bounding Boxes", 2000: "masking"); one that
//! no plane crosses is taken whole.

use crate::scene::{NONE, lanes};
use crate::view::{MAX_PLANES, ViewPlane};
use crate::{Accuracy, CullStats, Culler, Scene, Simd, View, VisibleSet};

/// A plane of a view as the kernel tests it in `f32`: an upper bound on the signed distance of a box.
///
/// The plane is scaled to a normal `n` of length 1/4, so that no sum of three products overflows, and its offset `d` with it. The box reaches farthest along `n` in the corner `p` that has the greater coordinate
/// where `n` is positive and the least elsewhere. The kernel computes
/// `S = ((X + Y) + Z) + offset`, where `X = max(p.x high.x, p.x low.x)` and so on, and must never find less than the exact
/// `n . p + d`. With `u = 2^-24`:
///
/// - `high` and `low` are `n +- (8u |n| + 2^-125)`, rounded once, so `X >= n.x p.x + |p.x| (7u |n.x| + 2^-125)` but for the
///   rounding of the product, `u |X|`. The second term stands in for components that `f32` cannot hold or flushes to zero.
/// - The three sums round by at most `u` each of what they add up: `3u (|X| + |Y| + |Z|) + 3u |offset|`.
/// - So `4u` of each product's magnitude are needed and `7u` are there.
/// - `offset` is `d + 8u |d|` plus the error of `d` itself, rounded once: `7u |d|` are there and `3u |d|` are needed.
/// - Numbers below `2^-126` may be flushed to zero: three coordinates (times at most 1), three products, three sums. `2^-122`,
///   which is 16 times as much, covers these nine.
///
/// An infinite coordinate gives an infinite `X` of the right sign, or a NaN, which the kernel takes as undecided.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TestPlane {
    pub(crate) high: [f32; 3],
    pub(crate) low: [f32; 3],
    pub(crate) offset: f32,
    /// For each axis, whether the greatest coordinate of a box reaches farther than the least.
    pub(crate) greatest: [bool; 3],
}

/// Eight times the unit round-off of `f32`: the relative margin.
const MARGIN: f64 = 4.0 * f32::EPSILON as f64;

impl TestPlane {
    const ALL: Self = Self { high: [0.0; 3], low: [0.0; 3], offset: f32::INFINITY, greatest: [true; 3] };

    fn new(view_plane: &ViewPlane) -> Self {
        let ViewPlane { plane, error } = view_plane;
        let least = f64::from(f32::MIN_POSITIVE);
        let n = (plane.normal * 0.25).to_array();
        let (d, error) = (plane.offset * 0.25, error * 0.25);
        Self {
            high: n.map(|n| (n + (MARGIN * n.abs() + 2.0 * least)) as f32),
            low: n.map(|n| (n - (MARGIN * n.abs() + 2.0 * least)) as f32),
            offset: (d + (MARGIN * d.abs() + error + 16.0 * least)) as f32,
            greatest: n.map(|n| n >= 0.0),
        }
    }
}

/// Removes what lies outside the planes of the view. Conservative: a box near an edge of the view may lie outside
/// without being outside any one plane.
///
/// Cost follows what is in view: some 20 ns for 64 objects on the boundary, 1 ns for 64 that are inside, nothing for the rest.
///
/// ```
/// use visibility_core::{FrustumCuller, Pipeline};
/// let pipeline = Pipeline::new().with(FrustumCuller::new());
/// # let _ = pipeline;
/// ```
#[derive(Clone, Debug)]
pub struct FrustumCuller {
    simd: Simd,
}

impl Default for FrustumCuller {
    fn default() -> Self {
        Self::new()
    }
}

impl FrustumCuller {
    /// Uses the widest instructions that the processor has.
    pub fn new() -> Self {
        Self::with_simd(Simd::best())
    }

    /// Uses the given instructions, for tests and comparisons.
    pub const fn with_simd(simd: Simd) -> Self {
        Self { simd }
    }
}

impl Culler for FrustumCuller {
    fn name(&self) -> &str {
        "frustum"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        cull_outside(self.simd, scene, view.planes(scene.origin()).as_slice(), visible)
    }
}

/// Removes what lies outside any of the planes, of which the first [`MAX_PLANES`] are looked at.
pub(crate) fn cull_outside(
    simd: Simd,
    scene: &Scene,
    planes: &[ViewPlane],
    visible: &mut VisibleSet,
) -> CullStats {
    visible.prepare(scene);
    let mut frame = Frame::new(simd, scene, planes, visible);
    let root = scene.tree().root;
    if root != NONE {
        frame.visit(root as usize, frame.all);
    }
    let mut stats = frame.stats;
    visible.commit();
    stats.visible += visible.unculled_count(scene);
    stats
}

/// What one walk of the hierarchy needs.
struct Frame<'a> {
    simd: Simd,
    scene: &'a Scene,
    visible: &'a mut VisibleSet,
    /// Boxes outside these are hidden.
    planes: [TestPlane; MAX_PLANES],
    /// The same planes turned round: boxes outside these are inside those.
    flipped: [TestPlane; MAX_PLANES],
    /// A bit for each plane that there is.
    all: u32,
    stats: CullStats,
}

impl<'a> Frame<'a> {
    fn new(simd: Simd, scene: &'a Scene, view_planes: &[ViewPlane], visible: &'a mut VisibleSet) -> Self {
        let mut planes = [TestPlane::ALL; MAX_PLANES];
        let mut flipped = [TestPlane::ALL; MAX_PLANES];
        let mut all = 0;
        for (i, view_plane) in view_planes.iter().take(MAX_PLANES).enumerate() {
            planes[i] = TestPlane::new(view_plane);
            flipped[i] = TestPlane::new(&ViewPlane { plane: view_plane.plane.flipped(), ..*view_plane });
            all |= 1 << i;
        }
        Self { simd, scene, visible, planes, flipped, all, stats: CullStats::default() }
    }

    /// Tests the children of a node against those planes that cross it, and goes on below. Whether anything is left.
    fn visit(&mut self, node: usize, active: u32) -> bool {
        let tree = self.scene.tree();
        let boxes = &tree.bounds[node];
        let candidates = self.visible.mask(self.scene, node);
        let mut mask = candidates & !self.simd.any_outside(boxes, &self.planes, active);
        self.stats.nodes += 1;
        self.stats.tests += u64::from(candidates.count_ones()) * u64::from(active.count_ones());
        if tree.levels[node] == 0 {
            self.stats.visible += u64::from(mask.count_ones());
            self.visible.set_mask(node, mask);
            return mask != 0;
        }
        let mut inside = [0; MAX_PLANES];
        for plane in lanes(active.into()) {
            inside[plane] = self.simd.any_outside(boxes, &self.flipped, 1 << plane);
        }
        for lane in lanes(mask) {
            let child = tree.child(node, lane);
            let crossing = lanes(active.into())
                .fold(0, |set, plane| set | ((!inside[plane] >> lane & 1) as u32) << plane);
            let some = if crossing == 0 {
                let kept = self.visible.keep_below(self.scene, child);
                self.stats.whole += 1;
                self.stats.visible += kept;
                kept != 0
            } else {
                self.visit(child, crossing)
            };
            if !some {
                mask &= !(1 << lane);
            }
        }
        self.visible.set_mask(node, mask);
        mask != 0
    }
}
