//! Frustum culling: boxes outside one of the planes of the view are hidden. The walk serves any convex volume of planes.
//!
//! The hierarchy is walked from the top, 64 boxes a test. A node passes to each child only those planes that cross it
//! (Assarsson and Möller, "Optimized View Frustum Culling Algorithms for Bounding Boxes", 2000: "masking"); one that
//! no plane crosses is taken whole.

use crate::scene::{Boxes64, lanes};
use crate::view::{MAX_PLANES, ViewPlane};
use crate::walk::{Child, SceneHierarchy, Walk};
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
        ConvexVolume::new(self.simd, view.planes(scene.origin()).as_slice()).retain(scene, visible)
    }
}

/// A convex volume of at most [`MAX_PLANES`] planes, as blocks of 64 boxes are tested against it.
///
/// ```
/// use visibility_core::walk::{BoxHierarchy, SceneHierarchy};
/// use visibility_core::{Aabb, ConvexVolume, Plane, Scene, Simd, ViewPlane, glam::DVec3};
/// let above = ViewPlane { plane: Plane::new(DVec3::Z, -1.0), error: 0.0 };
/// let volume = ConvexVolume::new(Simd::best(), &[above]);
/// let mut scene = Scene::new();
/// scene.insert_batch([-3.0, 0.5, 3.0].map(|z| Aabb::from_arrays([0.0, 0.0, z], [1.0, 1.0, z + 1.0])));
/// SceneHierarchy.for_each_block(&scene, None, |block| {
///     assert_eq!((block.occupied() & !volume.outside(block.boxes(), volume.all())).count_ones(), 2);
/// });
/// ```
#[derive(Clone, Debug)]
pub struct ConvexVolume {
    simd: Simd,
    planes: [TestPlane; MAX_PLANES],
    /// The same planes turned round: boxes outside these are inside those.
    flipped: [TestPlane; MAX_PLANES],
    all: u32,
}

impl ConvexVolume {
    /// The volume inside all of the planes, of which only the first [`MAX_PLANES`] count.
    pub fn new(simd: Simd, view_planes: &[ViewPlane]) -> Self {
        let mut volume = Self {
            simd,
            planes: [TestPlane::ALL; MAX_PLANES],
            flipped: [TestPlane::ALL; MAX_PLANES],
            all: 0,
        };
        for (i, view_plane) in view_planes.iter().take(MAX_PLANES).enumerate() {
            volume.planes[i] = TestPlane::new(view_plane);
            volume.flipped[i] =
                TestPlane::new(&ViewPlane { plane: view_plane.plane.flipped(), ..*view_plane });
            volume.all |= 1 << i;
        }
        volume
    }

    /// A bit for each plane.
    pub fn all(&self) -> u32 {
        self.all
    }

    /// The lanes whose boxes lie surely outside at least one of the `active` planes, given a bit each.
    #[inline]
    pub fn outside(&self, boxes: &Boxes64, active: u32) -> u64 {
        self.simd.any_outside(boxes, &self.planes, active)
    }

    /// The lanes whose boxes lie surely inside one plane, so that it need not be tested below them.
    #[inline]
    pub fn inside(&self, boxes: &Boxes64, plane: usize) -> u64 {
        self.simd.any_outside(boxes, &self.flipped, 1 << (plane % MAX_PLANES))
    }

    /// Removes the objects that lie surely outside one of the planes.
    pub fn retain(&self, scene: &Scene, visible: &mut VisibleSet) -> CullStats {
        let mut walk = Walk::new(scene, &SceneHierarchy, visible);
        self.visit(&mut walk, None, self.all);
        walk.finish()
    }

    /// Tests the children of a node against the planes that cross it, `active`, and goes on below. Whether anything is left.
    fn visit(&self, walk: &mut Walk<SceneHierarchy>, node: Option<usize>, active: u32) -> bool {
        walk.visit(node, |walk, block, candidates| {
            let mut mask = candidates & !self.outside(block.boxes(), active);
            walk.stats.tests += u64::from(candidates.count_ones()) * u64::from(active.count_ones());
            if block.leaf().is_some() {
                return mask;
            }
            let mut inside = [0; MAX_PLANES];
            for plane in lanes(active.into()) {
                inside[plane] = self.inside(block.boxes(), plane);
            }
            for lane in lanes(mask) {
                let Child::Node(child) = block.child(lane) else { continue };
                let crossing = lanes(active.into())
                    .fold(0, |set, plane| set | ((!inside[plane] >> lane & 1) as u32) << plane);
                let any =
                    if crossing == 0 { walk.accept(child) } else { self.visit(walk, Some(child), crossing) };
                mask &= !(u64::from(!any) << lane);
            }
            mask
        })
    }
}
