//! Opacity thresholds: the fraction of a texel's pixels that must be covered for the whole texel to count as
//! covered.
//!
//! Opacities are counted, never averaged. A texel is opaque if the number of its covered pixels is at least
//! the threshold times the number of its pixels, in integers. With a threshold of 1 a texel of any size is
//! opaque if and only if all four texels below it are opaque. An average stored in eight bits would call a
//! block of 256 x 256 pixels with a hole of a hundred pixels opaque.

use crate::buffer::tile_layout::SIDE;
use crate::buffer_size::MAX_SIDE;

/// Fixed-point representation of a threshold of 1. Thresholds are stored as integer multiples of 1 / `ONE`.
pub(crate) const ONE: u32 = 1 << 16;

/// Number of levels of the largest map: texels of 1, 2, 4, up to [`MAX_SIDE`] pixels a side.
pub(crate) const LEVELS: usize = MAX_SIDE.ilog2() as usize + 1;

/// Level whose texels are tiles. Level 0 is the pixels.
pub(crate) const TILE: usize = SIDE.ilog2() as usize;

/// An opacity threshold for each level. Level 0 is the pixels.
#[derive(Clone, Debug)]
pub(crate) struct Thresholds {
    /// Threshold of each level, from 0 to [`ONE`], in units of 1 / [`ONE`].
    fractions: [u32; LEVELS],
    /// For each level, the least threshold of all finer levels, in units of 1 / [`ONE`]. [`ONE`] at level 0.
    loosest: [u32; LEVELS],
}

impl Thresholds {
    /// A threshold of 1 on all levels: texels are opaque only if all their pixels are covered.
    pub(crate) const OPAQUE: Self = Self { fractions: [ONE; LEVELS], loosest: [ONE; LEVELS] };

    /// Derives the thresholds of all levels from `threshold`, the one for tiles of 8 x 8 pixels, 0 to 1. NaN
    /// counts as 1. (Zhang, Manocha, Hudson and Hoff, "Visibility Culling using Hierarchical Occlusion Maps",
    /// 1997, whose finest texel has that size on the screen.)
    ///
    /// On all coarser levels an opaque texel may have the same number of uncovered pixels, so that holes do
    /// not add up. The uncovered fraction therefore shrinks to a quarter from level to level. Texels finer
    /// than tiles must be covered entirely.
    pub(crate) fn from_tile_threshold(threshold: f32) -> Self {
        let mut new = Self::OPAQUE;
        let mut fractions = to_fraction(threshold);
        for level in TILE..LEVELS {
            new.fractions[level] = fractions;
            fractions = (3 * ONE + fractions).div_ceil(4);
        }
        new.find_loosest();
        new
    }

    /// Sets the threshold, 0 to 1, of one level. Level 0 and levels beyond the last are ignored. NaN counts
    /// as 1.
    pub(crate) fn set(&mut self, level: usize, threshold: f32) {
        // A pixel has no partial coverage, so level 0 keeps its threshold of 1.
        if level > 0
            && let Some(fractions) = self.fractions.get_mut(level)
        {
            *fractions = to_fraction(threshold);
            self.find_loosest();
        }
    }

    /// Recomputes `loosest` (for each level, the least threshold of all finer levels) from `fractions`.
    fn find_loosest(&mut self) {
        let mut least = ONE;
        for level in 0..LEVELS {
            self.loosest[level] = least;
            least = least.min(self.fractions[level]);
        }
    }

    /// Returns the threshold of a level as a fraction from 0 to 1. 1 beyond the last level.
    pub(crate) fn get(&self, level: usize) -> f32 {
        self.fractions.get(level).map_or(1.0, |&fractions| fractions as f32 / ONE as f32)
    }

    /// Returns whether the thresholds of all levels are 1, which makes the maps conservative. False if a
    /// threshold is below 1, which makes the maps approximate.
    pub(crate) fn all_opaque(&self) -> bool {
        self.fractions == [ONE; LEVELS]
    }

    /// Returns whether some level finer than tiles has a threshold below 1, so that its texels may be opaque
    /// with uncovered pixels.
    pub(crate) fn is_fine(&self) -> bool {
        self.fractions[..TILE] != [ONE; TILE]
    }

    /// Returns the minimum number of covered pixels for which a texel of `area` pixels on a level is opaque.
    /// At least 1.
    #[inline(always)]
    pub(crate) fn need(&self, level: usize, area: u32) -> u32 {
        let fractions = u64::from(self.fractions[level.min(LEVELS - 1)]);
        // A texel has at most 2^24 pixels, so the product fits. A texel without covered pixels is never
        // opaque.
        ((u64::from(area) * fractions).div_ceil(u64::from(ONE)) as u32).max(1)
    }

    /// Returns whether a part of a texel on level `level` has certainly too few covered pixels to be opaque
    /// by finer levels. The part has `part` pixels, the whole texel `covered` covered ones. An opaque part
    /// consists of covered pixels and of opaque texels of finer levels, so at least the least threshold of
    /// those levels, as a fraction of its pixels, is covered. False means undecided.
    #[inline(always)]
    pub(crate) fn rules_out(&self, level: usize, covered: u32, part: u32) -> bool {
        u64::from(covered) * u64::from(ONE)
            < u64::from(part) * u64::from(self.loosest[level.min(LEVELS - 1)]).max(1)
    }
}

/// Converts a threshold, as a fraction from 0 to 1, to units of 1 / [`ONE`], rounded up. NaN and thresholds
/// above 1 become [`ONE`], negative ones 0.
fn to_fraction(threshold: f32) -> u32 {
    if threshold < 1.0 {
        // Float-to-integer casts saturate, so a negative threshold becomes 0.
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
            assert_eq!(
                Thresholds::OPAQUE.need(level, area),
                area,
                "level {level}: pixels needed of {area} at a threshold of 1"
            );
            assert_eq!(
                Thresholds::from_tile_threshold(f32::NAN).need(level, area),
                area,
                "level {level}: pixels needed of {area} at a threshold of NaN"
            );
            // The greatest number below one is rounded up to a threshold of 1, so all pixels must be covered.
            assert_eq!(
                Thresholds::from_tile_threshold(1.0f32.next_down()).need(level, area),
                area,
                "level {level}: pixels needed of {area} just below a threshold of 1"
            );
        }
    }

    #[test]
    fn the_threshold_leaves_holes_of_one_size_on_all_levels() {
        let thresholds = Thresholds::from_tile_threshold(0.75);
        for level in TILE..LEVELS {
            let area = 1 << (2 * level);
            let holes = area - thresholds.need(level, area);
            assert!((15..=16).contains(&holes) || level > 8 && holes < 16, "level {level}: {holes}");
        }
        assert_eq!(thresholds.need(2, 16), 16, "texels finer than a tile have no holes");
        assert!(
            !thresholds.is_fine() && !thresholds.all_opaque(),
            "a threshold of 0.75 allows holes, in whole tiles alone"
        );
        let mut thresholds = Thresholds::OPAQUE;
        thresholds.set(0, 0.5);
        assert!(thresholds.get(0) == 1.0 && thresholds.all_opaque(), "the threshold of pixels stays");
        thresholds.set(1, 0.5);
        assert!(thresholds.get(1) == 0.5 && thresholds.is_fine(), "that of the next level does not");
        assert_eq!(
            Thresholds::from_tile_threshold(-3.0).need(TILE, 64),
            1,
            "a tile needs one pixel, however low the threshold"
        );
    }
}
