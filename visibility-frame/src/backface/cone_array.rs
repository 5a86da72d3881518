//! Arrays of normal cones in blocks of 64.

use super::NormalCone;
use super::cones64::Cones64;
use super::split_eye::SplitEye;
use crate::simd_dispatch::Kernels;
use alloc::vec::Vec;
use visibility_core::scene::FAN_OUT;
use visibility_core::{simd::Simd, view::Eye};

/// An array of normal cones that are tested 64 at a time, for callers with a hierarchy of their own. Of each
/// cone it stores only what decides whether an eye sees nothing but back faces.
///
/// Cost: a fraction of a nanosecond and 52 bytes per cone.
///
/// ```
/// use visibility_frame::backface::{Cones, NormalCone};
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
    simd: Simd,
}

impl Cones {
    /// Stores the cones in the given order and selects the widest SIMD instructions that the processor
    /// supports.
    pub fn new(cones: impl IntoIterator<Item = NormalCone>) -> Self {
        let mut blocks = Vec::new();
        for (i, cone) in cones.into_iter().enumerate() {
            if i % FAN_OUT == 0 {
                blocks.push(Cones64::OPEN);
            }
            blocks[i / FAN_OUT].set(i % FAN_OUT, &cone);
        }
        Self { blocks, simd: Simd::best() }
    }

    /// Sets the SIMD instructions, for tests and comparisons. Results are the same with all.
    #[must_use]
    pub fn with_simd(self, simd: Simd) -> Self {
        Self { simd, ..self }
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
}
