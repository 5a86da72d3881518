//! Many cones in blocks of 64, and the tree of cones over cones.

use super::NormalCone;
use super::cones64::Cones64;
use super::split_eye::SplitEye;
use crate::scene::lanes;
use crate::{Aabb, simd::Simd, view::Eye};
use alloc::vec::Vec;

/// Cones in a row, tested 64 at once: the flat form, for those who walk a hierarchy of their own.
///
/// Cost: a fraction of a nanosecond for a cone; 52 bytes.
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
    /// Holds the cones in the order in which they come; uses the widest instructions that the processor has.
    pub fn new(cones: impl IntoIterator<Item = NormalCone>) -> Self {
        Self::with_simd(cones, Simd::best())
    }

    /// As [`new`](Self::new) with the given instructions.
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

    /// Number of cones.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there is no cone.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Sets a bit for each cone of which the eye surely sees backs only: cone `i` in bit `i % 64` of word `i
    /// / 64`. Words beyond the cones are zeroed; cones beyond the words are left out.
    pub fn back_facing(&self, eye: &Eye, masks: &mut [u64]) {
        let eye = SplitEye::new(eye);
        masks.fill(0);
        for (block, mask) in self.blocks.iter().zip(masks) {
            *mask = self.simd.inside_cones(block, &eye);
        }
    }

    /// As [`back_facing`](Self::back_facing) for every eye in a viewcell at once. An improper box sets no
    /// bit. Cost: up to eight times that of one eye.
    pub fn back_facing_from_aabb(&self, viewcell: &Aabb, masks: &mut [u64]) {
        masks.fill(0);
        if !viewcell.is_proper() {
            return;
        }
        // Cones are convex: they hold a box if they hold its corners.
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

/// Cones over cones, 64 below each, so that one test rejects up to thousands (Kumar, Manocha, Garrett and
/// Lin, "Hierarchical Back-Face Computation", 1996).
///
/// Each cone above decides what all below it decide. The order of the cones is the grouping: those of
/// [`cluster_mesh`](super::cluster_mesh) come so that neighbours face alike.
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
    /// The cones first, then those over them, up to a level of at most 64.
    levels: Vec<Cones>,
}

impl ConeTree {
    /// Builds the cones over the given ones. Cost: some 0.6 milliseconds a group of 64.
    pub fn new(cones: &[NormalCone]) -> Self {
        Self::with_simd(cones, Simd::best())
    }

    /// As [`new`](Self::new) with the given instructions.
    pub fn with_simd(cones: &[NormalCone], simd: Simd) -> Self {
        let mut levels = alloc::vec![Cones::with_simd(cones.iter().copied(), simd)];
        let mut below = cones.to_vec();
        while below.len() > 64 {
            below = below.chunks(64).map(NormalCone::from_cones).collect();
            levels.push(Cones::with_simd(below.iter().copied(), simd));
        }
        Self { levels }
    }

    /// Number of cones, without those over them.
    pub fn len(&self) -> usize {
        self.levels[0].len()
    }

    /// Whether there is no cone.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// As [`Cones::back_facing`], with the same guarantee; a cone that is off by rounding may be decided here
    /// and not there, since what is above it decides too. Returns the number of blocks of 64 that were
    /// tested.
    pub fn back_facing(&self, eye: &Eye, masks: &mut [u64]) -> u64 {
        masks.fill(0);
        if self.is_empty() {
            return 0;
        }
        self.visit(self.levels.len() - 1, 0, &SplitEye::new(eye), masks)
    }

    /// Tests one block, and those below it that are not decided.
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

    /// Sets all bits below a block of a level.
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
