//! Opacity thresholds: how much of a texel must be covered for all of it to count as covered.
//!
//! Opacities are counted, never averaged: a texel is opaque if the number of its covered pixels is at least the threshold times the
//! number of its pixels, in whole numbers. With a threshold of one that is so if and only if all four texels below it are opaque, at any
//! size; an average kept in eight bits would call a block of 256 x 256 pixels with a hole of a hundred opaque.

use crate::buffer::tile_layout::SIDE;
use crate::buffer_size::MAX_SIDE;

/// Thresholds are kept in parts of this.
pub(crate) const ONE: u32 = 1 << 16;

/// Levels of the largest map: 4096 pixels, 2048, ... 1.
pub(crate) const LEVELS: usize = MAX_SIDE.ilog2() as usize + 1;

/// The level whose texels are tiles.
pub(crate) const TILE: usize = SIDE.ilog2() as usize;

/// A threshold for each level, pixels first.
#[derive(Clone, Debug)]
pub(crate) struct Thresholds {
    fractions: [u32; LEVELS],
    /// The least of all finer levels.
    loosest: [u32; LEVELS],
}

impl Thresholds {
    pub(crate) const OPAQUE: Self = Self { fractions: [ONE; LEVELS], loosest: [ONE; LEVELS] };

    /// One dial for all levels (Zhang, Manocha, Hudson and Hoff, "Visibility Culling using Hierarchical Occlusion Maps", 1997): the
    /// number of uncovered pixels that a texel may have is the same on all levels, so that holes do not add up on the way to coarser
    /// ones. The dial is the threshold for tiles of 8 x 8 pixels, the size of their finest texel on the screen; what is left open in
    /// a level is a quarter of that in the level below. Finer texels count only if whole.
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

    pub(crate) fn set(&mut self, level: usize, threshold: f32) {
        // A pixel is covered or not.
        if level > 0
            && let Some(fractions) = self.fractions.get_mut(level)
        {
            *fractions = to_fraction(threshold);
            self.find_loosest();
        }
    }

    fn find_loosest(&mut self) {
        let mut least = ONE;
        for level in 0..LEVELS {
            self.loosest[level] = least;
            least = least.min(self.fractions[level]);
        }
    }

    pub(crate) fn get(&self, level: usize) -> f32 {
        self.fractions.get(level).map_or(1.0, |&fractions| fractions as f32 / ONE as f32)
    }

    /// Whether nothing but texels without a hole are opaque.
    pub(crate) fn all_opaque(&self) -> bool {
        self.fractions == [ONE; LEVELS]
    }

    /// Whether texels finer than tiles may have holes.
    pub(crate) fn is_fine(&self) -> bool {
        self.fractions[..TILE] != [ONE; TILE]
    }

    /// How many of the pixels of a texel must be covered for it to be opaque.
    #[inline(always)]
    pub(crate) fn need(&self, level: usize, area: u32) -> u32 {
        let fractions = u64::from(self.fractions[level.min(LEVELS - 1)]);
        // At most 2^24 pixels, and no texel is opaque with nothing in it.
        ((u64::from(area) * fractions).div_ceil(u64::from(ONE)) as u32).max(1)
    }

    /// Whether a part of a texel cannot become opaque, however finely it is looked at: what makes it up are pixels and texels of finer
    /// levels, each with at least the loosest of their thresholds covered, and together no more of them than are covered in all.
    #[inline(always)]
    pub(crate) fn rules_out(&self, level: usize, covered: u32, part: u32) -> bool {
        u64::from(covered) * u64::from(ONE)
            < u64::from(part) * u64::from(self.loosest[level.min(LEVELS - 1)]).max(1)
    }
}

/// Rounded up; NaN is one.
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
