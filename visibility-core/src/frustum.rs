//! Frustum culling: boxes outside one of the planes of the view are hidden. The walk serves any convex volume
//! of planes.
//!
//! The hierarchy is walked from the top, 64 boxes a test. A node passes to each child only those planes that
//! cross it (Assarsson and Möller, "Optimized View Frustum Culling Algorithms for Bounding Boxes", 2000:
//! "masking"); one that no plane crosses is taken whole.

use crate::scene::{Boxes64, lanes};
use crate::test_plane::TestPlane;
use crate::view::{MAX_PLANES, ViewPlane};
use crate::walk::{Child, SceneHierarchy, Walk};
use crate::{Accuracy, CullStats, Culler, Scene, View, VisibleSet, simd::Simd};

/// Removes what lies outside the planes of the view. Conservative: a box near an edge of the view may lie
/// outside without being outside any one plane.
///
/// Cost follows what is in view: some 20 ns for 64 objects on the boundary, 1 ns for 64 that are inside,
/// nothing for the rest.
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

    /// Tests the children of a node against the planes that cross it, `active`, and goes on below. Whether
    /// anything is left.
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
