//! Opacity thresholds: how much of a texel must be covered for all of it to count as covered.
//!
//! Opacities are counted, never averaged: a texel is opaque if the number of its covered pixels is at least
//! the threshold times the number of its pixels, in integers. With a threshold of 1 that is so if and only if
//! all four texels below it are opaque, at any size. An average kept in eight bits would call a block of 256
//! x 256 pixels with a hole of a hundred opaque.

use crate::buffer::tile_layout::SIDE;
use crate::buffer_size::MAX_SIDE;

/// A threshold of 1. Thresholds are kept as multiples of 1 / `ONE`.
pub(crate) const ONE: u32 = 1 << 16;

/// Number of levels of the largest map: 4096 pixels, 2048, ... 1.
pub(crate) const LEVELS: usize = MAX_SIDE.ilog2() as usize + 1;

/// The level whose texels are tiles.
pub(crate) const TILE: usize = SIDE.ilog2() as usize;

/// A threshold for each level; level 0 is that of pixels.
#[derive(Clone, Debug)]
pub(crate) struct Thresholds {
    /// By level, as a multiple of 1 / [`ONE`].
    fractions: [u32; LEVELS],
    /// By level, the least threshold of all finer levels.
    loosest: [u32; LEVELS],
}

impl Thresholds {
    /// A threshold of 1 on all levels.
    pub(crate) const OPAQUE: Self = Self { fractions: [ONE; LEVELS], loosest: [ONE; LEVELS] };

    /// Thresholds for all levels from one dial, the threshold of tiles of 8 x 8 pixels (Zhang, Manocha,
    /// Hudson and Hoff, "Visibility Culling using Hierarchical Occlusion Maps", 1997, whose finest texel has
    /// that size on the screen). The number of uncovered pixels that an opaque texel may have is the same on
    /// all coarser levels, so that holes do not add up: their share is a quarter of that on the level below.
    /// Texels finer than tiles must be covered entirely.
    pub(crate) fn from_dial(threshold: f32) -> Self {
        let mut new = Self::OPAQUE;
        let mut fractions = to_fraction(threshold);
        for level in TILE..LEVELS {
            new.fractions[level] = fractions;
            fractions = (3 * ONE + fractions).div_ceil(4);
        }
        new.find_loosest();
        new
    }

    /// Sets the threshold of one level. That of pixels, and levels beyond the last, are left as they are.
    pub(crate) fn set(&mut self, level: usize, threshold: f32) {
        // A pixel is covered or not.
        if level > 0
            && let Some(fractions) = self.fractions.get_mut(level)
        {
            *fractions = to_fraction(threshold);
            self.find_loosest();
        }
    }

    /// Brings `loosest` up to date.
    fn find_loosest(&mut self) {
        let mut least = ONE;
        for level in 0..LEVELS {
            self.loosest[level] = least;
            least = least.min(self.fractions[level]);
        }
    }

    /// The threshold of a level; 1 beyond the last.
    pub(crate) fn get(&self, level: usize) -> f32 {
        self.fractions.get(level).map_or(1.0, |&fractions| fractions as f32 / ONE as f32)
    }

    /// Whether all thresholds are 1.
    pub(crate) fn all_opaque(&self) -> bool {
        self.fractions == [ONE; LEVELS]
    }

    /// Whether texels finer than tiles may be opaque with uncovered pixels.
    pub(crate) fn is_fine(&self) -> bool {
        self.fractions[..TILE] != [ONE; TILE]
    }

    /// Number of covered pixels from which a texel of `area` pixels is opaque; at least 1.
    #[inline(always)]
    pub(crate) fn need(&self, level: usize, area: u32) -> u32 {
        let fractions = u64::from(self.fractions[level.min(LEVELS - 1)]);
        // At most 2^24 pixels, and no texel is opaque with nothing in it.
        ((u64::from(area) * fractions).div_ceil(u64::from(ONE)) as u32).max(1)
    }

    /// Whether `part` pixels of a texel with `covered` covered ones cannot be opaque, however finely they are
    /// looked at. They would consist of pixels and texels of finer levels, each covered to at least the
    /// loosest threshold, and together have at most `covered` covered pixels.
    #[inline(always)]
    pub(crate) fn rules_out(&self, level: usize, covered: u32, part: u32) -> bool {
        u64::from(covered) * u64::from(ONE)
            < u64::from(part) * u64::from(self.loosest[level.min(LEVELS - 1)]).max(1)
    }
}

/// A threshold as a multiple of 1 / [`ONE`], rounded up. NaN becomes 1; below 0 becomes 0.
fn to_fraction(threshold: f32) -> u32 {
    if threshold < 1.0 {
        // Casts saturate.
        let fractions = threshold * ONE as f32;
        fractions as u32 + u32::from((fractions as u32 as f32) < fractions)
    } else {
        ONE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_whole_texels_are_opaque_at_a_threshold_of_one() {
        for level in 0..LEVELS {
            let area = 1 << (2 * level);
            assert_eq!(Thresholds::OPAQUE.need(level, area), area);
            assert_eq!(Thresholds::from_dial(f32::NAN).need(level, area), area);
            // The greatest number below one leaves nothing out either: it rounds to no fewer pixels than all.
            assert_eq!(Thresholds::from_dial(1.0f32.next_down()).need(level, area), area);
        }
    }

    #[test]
    fn the_dial_leaves_holes_of_one_size_on_all_levels() {
        let thresholds = Thresholds::from_dial(0.75);
        for level in TILE..LEVELS {
            let area = 1 << (2 * level);
            let holes = area - thresholds.need(level, area);
            assert!((15..=16).contains(&holes) || level > 8 && holes < 16, "level {level}: {holes}");
        }
        assert_eq!(thresholds.need(2, 16), 16);
        assert!(!thresholds.is_fine() && !thresholds.all_opaque());
        assert_eq!(Thresholds::from_dial(-3.0).need(TILE, 64), 1);
    }
}
