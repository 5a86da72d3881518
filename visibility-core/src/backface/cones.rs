//! Arrays of normal cones in blocks of 64, and a hierarchy of cones over cones.

use super::NormalCone;
use super::cones64::Cones64;
use super::split_eye::SplitEye;
use crate::scene::lanes;
use crate::{Aabb, simd::Simd, view::Eye};
use alloc::vec::Vec;

/// An array of normal cones that are tested 64 at a time, for callers with a hierarchy of their own. Only the
/// back-facing half of each cone is stored.
///
/// Cost: a fraction of a nanosecond and 52 bytes per cone.
///
/// ```
/// use visibility_core::backface::{Cones, NormalCone};
/// use visibility_core::{glam::{DVec3, Vec3}, view::Eye};
/// let floor = NormalCone::from_triangles(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]);
/// let ceiling = floor.flipped();
/// let cones = Cones::new([floor, ceiling, NormalCone::OPEN]);
/// let mut masks = [0; 1];
/// cones.back_facing(&Eye::Point(DVec3::Z), &mut masks);
/// assert_eq!(masks[0], 0b010);
/// ```
#[derive(Clone, Debug)]
pub struct Cones {
    blocks: Vec<Cones64>,
    count: usize,
    simd: Simd,
}

impl Cones {
    /// Stores the cones in the given order and selects the widest SIMD instructions that the processor
    /// supports.
    pub fn new(cones: impl IntoIterator<Item = NormalCone>) -> Self {
        Self::with_simd(cones, Simd::best())
    }

    /// Like [`new`](Self::new), with the given SIMD instructions, for tests and comparisons.
    pub fn with_simd(cones: impl IntoIterator<Item = NormalCone>, simd: Simd) -> Self {
        let mut this = Self { blocks: Vec::new(), count: 0, simd };
        for cone in cones {
            let lane = this.count % 64;
            if lane == 0 {
                this.blocks.push(Cones64::OPEN);
            }
            if let Some(block) = this.blocks.last_mut() {
                block.set(lane, &cone);
            }
            this.count += 1;
        }
        this
    }

    /// Returns the number of cones.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Tests whether the array holds no cones.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Sets one bit for each cone whose triangles the eye certainly sees from behind, and clears all other
    /// bits of `masks`. Cone `i` is bit `i % 64` of word `i / 64`. Words beyond the last cone become 0; cones
    /// beyond the last word are not tested. The eye is in the coordinates of the cones.
    pub fn back_facing(&self, eye: &Eye, masks: &mut [u64]) {
        let eye = SplitEye::new(eye);
        masks.fill(0);
        for (block, mask) in self.blocks.iter().zip(masks) {
            *mask = self.simd.inside_cones(block, &eye);
        }
    }

    /// Like [`back_facing`](Self::back_facing), for all eyes in a viewcell: a bit is set if every eye in the
    /// box certainly sees only backs. An improper box sets no bit. Cost: up to eight times that of one eye.
    pub fn back_facing_from_aabb(&self, viewcell: &Aabb, masks: &mut [u64]) {
        masks.fill(0);
        if !viewcell.is_proper() {
            return;
        }
        // Cones are convex: a cone contains a box if it contains the box's corners.
        let eyes = viewcell.corners().map(|corner| SplitEye::new(&Eye::Point(corner.as_dvec3())));
        for (block, mask) in self.blocks.iter().zip(masks) {
            *mask = u64::MAX;
            for eye in &eyes {
                if *mask != 0 {
                    *mask &= self.simd.inside_cones(block, eye);
                }
            }
        }
    }
}

/// A hierarchy of normal cones with a fan-out of 64, in which one test can reject thousands of clusters
/// (Kumar, Manocha, Garrett and Lin, "Hierarchical Back-Face Computation", 1996).
///
/// A cone of an upper level decides for an eye only what all 64 cones below it decide. Groups are runs of 64
/// consecutive cones, so similar cones should be adjacent. The clusters of
/// [`cluster_mesh`](super::cluster_mesh) are in such an order.
///
/// ```
/// use visibility_core::backface::{ConeTree, NormalCone};
/// use visibility_core::{glam::{DVec3, Vec3}, view::Eye};
/// let floor = |x: f32| NormalCone::from_triangles(&[[Vec3::ZERO, Vec3::X,
///     Vec3::Y].map(|p| p + Vec3::X * x)]);
/// let cones: Vec<NormalCone> = (0..100).map(|i| floor(i as f32)).collect();
/// let tree = ConeTree::new(&cones);
/// let mut masks = [0; 2];
/// let tests = tree.back_facing(&Eye::Point(DVec3::new(50.0, 0.0, -9.0)), &mut masks);
/// assert_eq!(masks, [u64::MAX, (1 << 36) - 1]);
/// assert_eq!(tests, 1); // one for both groups, none for the cones themselves
/// ```
#[derive(Clone, Debug)]
pub struct ConeTree {
    /// Level 0 holds the given cones. Each further level holds one cone per 64 cones of the level before.
    /// The last level has at most 64 cones.
    levels: Vec<Cones>,
}

impl ConeTree {
    /// Builds the hierarchy over `cones`, which keep their order. Cost: some 0.6 milliseconds a group of 64.
    pub fn new(cones: &[NormalCone]) -> Self {
        Self::with_simd(cones, Simd::best())
    }

    /// Like [`new`](Self::new), with the given SIMD instructions, for tests and comparisons.
    pub fn with_simd(cones: &[NormalCone], simd: Simd) -> Self {
        let mut levels = alloc::vec![Cones::with_simd(cones.iter().copied(), simd)];
        let mut below = cones.to_vec();
        while below.len() > 64 {
            below = below.chunks(64).map(NormalCone::from_cones).collect();
            levels.push(Cones::with_simd(below.iter().copied(), simd));
        }
        Self { levels }
    }

    /// Returns the number of cones given to [`new`](Self::new), without the cones of the upper levels.
    pub fn len(&self) -> usize {
        self.levels[0].len()
    }

    /// Tests whether the hierarchy holds no cones.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sets one bit for each given cone whose triangles the eye certainly sees from behind, and clears all
    /// other bits of `masks`. Cone `i` is bit `i % 64` of word `i / 64`. The eye is in the coordinates of the
    /// cones. Answers can differ from [`Cones::back_facing`] where rounding matters, since upper levels
    /// decide for whole groups. Returns the number of tested blocks of 64 cones.
    pub fn back_facing(&self, eye: &Eye, masks: &mut [u64]) -> u64 {
        masks.fill(0);
        if self.is_empty() {
            return 0;
        }
        self.visit(self.levels.len() - 1, 0, &SplitEye::new(eye), masks)
    }

    /// Tests block `block` of 64 cones on level `level` and, recursively, the blocks below its undecided
    /// cones. Sets the bits of the given cones below the block in `masks`. Returns the number of tested
    /// blocks.
    fn visit(&self, level: usize, block: usize, eye: &SplitEye, masks: &mut [u64]) -> u64 {
        let cones = &self.levels[level];
        let mask = cones.simd.inside_cones(&cones.blocks[block], eye);
        if level == 0 {
            if let Some(word) = masks.get_mut(block) {
                *word = mask;
            }
            return 1;
        }
        for lane in lanes(mask) {
            self.mark(level - 1, block * 64 + lane, masks);
        }
        let here = (cones.count - block * 64).min(64);
        let rest = !mask & (u64::MAX >> (64 - here));
        1 + lanes(rest).map(|lane| self.visit(level - 1, block * 64 + lane, eye, masks)).sum::<u64>()
    }

    /// Sets in `masks` the bits of all given cones (level 0) below block `block` of level `level`.
    fn mark(&self, level: usize, block: usize, masks: &mut [u64]) {
        let each = 64usize.pow(level as u32);
        let words = self.len().div_ceil(64);
        for word in block * each..((block + 1) * each).min(words) {
            let here = (self.len() - word * 64).min(64);
            if let Some(mask) = masks.get_mut(word) {
                *mask = u64::MAX >> (64 - here);
            }
        }
    }
}
