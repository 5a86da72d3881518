//! Frustum culling: removes boxes outside a plane of the view. The same walk serves any convex volume bounded
//! by planes.
//!
//! The hierarchy is walked from the root, 64 boxes per test. A node passes on to each child only the planes
//! that cross the child's box (Assarsson and Möller, "Optimized View Frustum Culling Algorithms for Bounding
//! Boxes", 2000: "masking"). A child that no plane crosses is accepted with its whole subtree, without
//! further tests.

use crate::scene::{Boxes64, lanes};
use crate::test_plane::TestPlane;
use crate::view::{MAX_PLANES, ViewPlane};
use crate::walk::{Block, Child, NodeTest, SceneHierarchy, Walk, retain_on};
use crate::{
    Accuracy, CullStats, Culler, Scene, View, VisibleSet,
    jobs::Jobs,
    simd::{Kernels, Simd},
    view::ViewRegion,
};

/// Removes the objects whose bounds are outside at least one plane of the view, clip planes included.
/// Conservative: a box near an edge of the frustum may be outside the frustum without being outside any
/// single plane, and is kept.
///
/// Cost grows with the number of objects in view: about 20 ns per 64 objects that cross the boundary, 1 ns
/// per 64 objects entirely inside, and nothing for objects in rejected nodes.
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
    /// Creates a culler that uses the widest SIMD instructions that the processor has.
    pub fn new() -> Self {
        Self { simd: Simd::best() }
    }

    /// Sets the SIMD instructions, for tests and comparisons. Results are the same with all.
    #[must_use]
    pub const fn with_simd(self, simd: Simd) -> Self {
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

    fn cull_on(
        &mut self,
        jobs: &dyn Jobs,
        scene: &Scene,
        view: &View,
        visible: &mut VisibleSet,
    ) -> CullStats {
        let volume = ConvexVolume::new(self.simd, view.planes(scene.origin()).as_slice());
        volume.retain_on(jobs, scene, visible)
    }

    fn cull_region(
        &mut self,
        jobs: Option<&dyn Jobs>,
        scene: &Scene,
        region: &ViewRegion,
        visible: &mut VisibleSet,
    ) -> Option<CullStats> {
        let volume = ConvexVolume::new(self.simd, &region.planes(scene.origin()));
        Some(match jobs {
            Some(jobs) => volume.retain_on(jobs, scene, visible),
            None => volume.retain(scene, visible),
        })
    }
}

/// A convex volume, the intersection of at most [`MAX_PLANES`] half-spaces on the positive side of their
/// planes (the side that the normal points to), prepared for testing blocks of 64 boxes. Planes and boxes are
/// in the same coordinates, usually relative to the scene's origin. Planes are numbered from 0 in the order
/// given to [`new`](Self::new).
///
/// ```
/// use visibility_core::walk::{BoxHierarchy, SceneHierarchy};
/// use visibility_core::{
///     frustum::ConvexVolume, geometry::Plane, glam::DVec3, simd::Simd, view::ViewPlane, Aabb,
///     Scene,
/// };
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
    /// The planes with normals and offsets negated, in the order of the volume's planes. A box certainly
    /// outside `flipped[i]` is certainly inside `planes[i]`.
    flipped: [TestPlane; MAX_PLANES],
    all: u32,
}

impl ConvexVolume {
    /// Builds the intersection of the half-spaces on the positive side of the planes, each moved outwards by
    /// its error bound. Normals have unit length, up to rounding. Planes after the first [`MAX_PLANES`] are
    /// ignored, which makes the volume larger. Without planes the volume is all of space.
    pub fn new(simd: Simd, view_planes: &[ViewPlane]) -> Self {
        let mut volume = Self {
            simd,
            planes: [TestPlane::EVERYTHING_INSIDE; MAX_PLANES],
            flipped: [TestPlane::EVERYTHING_INSIDE; MAX_PLANES],
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

    /// Returns the mask with one bit set for each plane of the volume: bit i stands for plane i. To be passed
    /// as `active` to [`outside`](Self::outside) at the root.
    pub fn all(&self) -> u32 {
        self.all
    }

    /// Returns a mask of the lanes whose box is certainly outside at least one plane of `active`; bit i of
    /// the result stands for lane i, bit p of `active` for plane p. Boxes that touch a plane, undecided boxes
    /// and NaN count as not outside.
    #[inline]
    pub fn outside(&self, boxes: &Boxes64, active: u32) -> u64 {
        self.simd.any_outside(boxes, &self.planes, active)
    }

    /// Returns a mask of the lanes whose box is certainly on the inner side of a plane, the side that its
    /// normal points to. Descendants of these boxes need no test against that plane. The plane has the number
    /// `plane` modulo [`MAX_PLANES`]. Bit i of the mask stands for lane i. Undecided lanes are 0. If the
    /// volume has no plane of this number, all lanes are 0.
    #[inline]
    pub fn inside(&self, boxes: &Boxes64, plane: usize) -> u64 {
        self.simd.any_outside(boxes, &self.flipped, 1 << (plane % MAX_PLANES))
    }

    /// Removes from `visible` the objects whose bounds are certainly outside at least one plane. The planes
    /// must be relative to the scene's origin. Returns the work counters.
    pub fn retain(&self, scene: &Scene, visible: &mut VisibleSet) -> CullStats {
        let mut walk = Walk::new(scene, &SceneHierarchy, visible);
        self.visit(&mut walk, None, self.all);
        walk.finish()
    }

    /// Removes objects like [`retain`](Self::retain), on the threads of a job system. The answer is the same.
    pub(crate) fn retain_on(&self, jobs: &dyn Jobs, scene: &Scene, visible: &mut VisibleSet) -> CullStats {
        retain_on(jobs, scene, visible, self, self.all)
    }

    /// Tests the children of `node`, or of the root for `None`, against the planes in the mask `active`, and
    /// recurses into undecided children. Bit i of the mask stands for plane i. The node must be on the inner
    /// side of all planes that are not in the mask. Returns whether any candidate (object of the visible set)
    /// is left below the node.
    fn visit(&self, walk: &mut Walk<SceneHierarchy>, node: Option<usize>, active: u32) -> bool {
        walk.visit(node, |walk, block, candidates| {
            let (mut mask, inside) = self.test(block, candidates, active, &mut walk.stats);
            if block.leaf().is_some() {
                return mask;
            }
            for lane in lanes(mask) {
                let Child::Node(child) = block.child(lane) else { continue };
                let any = match self.below(&inside, active, lane) {
                    0 => walk.accept(child),
                    crossing => self.visit(walk, Some(child), crossing),
                };
                mask &= !(u64::from(!any) << lane);
            }
            mask
        })
    }
}

/// The number that the walk passes down to a node (`active` in `test`) is a mask of the planes that the node
/// may cross, bit i for plane i. Only these planes are tested.
impl NodeTest for ConvexVolume {
    /// Indexed by plane: a mask of the lanes whose boxes are wholly on the inner side of the plane, bit i for
    /// lane i. 0 for planes that were not tested, and in leaves, below which nothing is left to test.
    type Found = [u64; MAX_PLANES];

    #[inline(always)]
    fn test(
        &self,
        block: &Block<'_>,
        candidates: u64,
        active: u32,
        stats: &mut CullStats,
    ) -> (u64, Self::Found) {
        let mask = candidates & !self.outside(block.boxes(), active);
        stats.tests += u64::from(candidates.count_ones()) * u64::from(active.count_ones());
        let mut inside = [0; MAX_PLANES];
        if block.leaf().is_none() {
            for plane in lanes(active.into()) {
                inside[plane] = self.inside(block.boxes(), plane);
            }
        }
        (mask, inside)
    }

    #[inline(always)]
    fn below(&self, inside: &Self::Found, active: u32, lane: usize) -> u32 {
        lanes(active.into()).fold(0, |set, plane| set | ((!inside[plane] >> lane & 1) as u32) << plane)
    }
}
