//! The overlap test: whether all of a screen rectangle is opaque.
//!
//! The test starts on the level where the rectangle meets two or three texels along its longer side, and
//! descends only below texels that do not decide. An opaque texel settles its part of the rectangle. If all
//! texels of the first level are opaque, the test ends at once (Zhang's conservative rejection). If a texel
//! has fewer covered pixels than its part of the rectangle needs, the test ends with "not opaque" (predictive
//! rejection). No finer texel could make that part opaque, so prediction changes no answer.

use super::opacity_pyramid::OpacityPyramid;
use super::opacity_thresholds::TILE;
use super::tile_range::TileRange;
use crate::buffer::tile_layout::{Rectangle, mask};

/// State of the recursive descent of [`is_opaque`].
pub(crate) struct Overlap<'a> {
    /// Pyramid against which the rectangle is tested: covered pixels, their counts on each level, and
    /// opacity thresholds.
    opacity: &'a OpacityPyramid,
    /// The tested rectangle, in pixels of the picture.
    rectangle: &'a Rectangle,
    /// Inclusive range of the tiles that the rectangle meets.
    region: TileRange,
    /// If true, the test ends with "not opaque" at a texel that has too few covered pixels for its part of
    /// the rectangle (predictive rejection). If false, the test descends below such a texel. Changes speed,
    /// never the answer.
    predictive: bool,
}

/// Returns whether all of a rectangle of pixels is opaque: whether every pixel is covered or lies in an
/// opaque texel. `predictive` turns on predictive rejection, which changes speed and never the answer.
#[inline(always)]
pub(crate) fn is_opaque(opacity: &OpacityPyramid, rectangle: &Rectangle, predictive: bool) -> bool {
    let region = TileRange::of(rectangle);
    let [x0, x1, y0, y1] = region.0;
    // The coarsest level on which the longer side still meets at least two texels.
    let size = (x1 - x0).max(y1 - y0);
    let above = (size.max(1).ilog2() as usize).min(opacity.levels.len() - 1);
    let walk = Overlap { opacity, rectangle, region, predictive };
    for y in y0 >> above..=y1 >> above {
        for x in x0 >> above..=x1 >> above {
            if !walk.texel(above, x, y) {
                return false;
            }
        }
    }
    true
}

impl Overlap<'_> {
    /// Returns whether the part of the rectangle within one texel is opaque. The texel is at column `x` and
    /// row `y` of the level that is `above` levels above that of tiles (0 for tiles themselves).
    fn texel(&self, above: usize, x: usize, y: usize) -> bool {
        let level = &self.opacity.levels[above];
        let (count, opaque) = level.texel(x, y);
        if opaque {
            return true;
        }
        if above == 0 {
            let part = mask(self.rectangle, x, y);
            let covered = if self.opacity.thresholds.is_fine() {
                self.opacity.opaque_pixels(x, y)
            } else {
                self.opacity.covered[y * level.columns + x]
            };
            return part & !covered == 0;
        }
        let side = TILE + above;
        let part = within(self.rectangle.columns, x, side) * within(self.rectangle.lines, y, side);
        if self.predictive && self.opacity.thresholds.rules_out(side, count, part) {
            return false;
        }
        let [x0, x1, y0, y1] = self.region.0.map(|limit| limit >> (above - 1));
        for y in (2 * y).max(y0)..=(2 * y + 1).min(y1) {
            for x in (2 * x).max(x0)..=(2 * x + 1).min(x1) {
                if !self.texel(above - 1, x, y) {
                    return false;
                }
            }
        }
        true
    }
}

/// Returns how many pixels of the half-open range from `first` to `end` lie within texel `texel` of a level
/// along one axis. The texel is `2^level` pixels long.
#[inline(always)]
fn within([first, end]: [u32; 2], texel: usize, level: usize) -> u32 {
    let (start, stop) = ((texel as u32) << level, (texel as u32 + 1) << level);
    end.min(stop).saturating_sub(first.max(start))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::buffer::tile_layout::SIDE;
    use crate::buffer::tiles::Tiles;
    use crate::hom::opacity_thresholds::Thresholds;
    use std::vec::Vec;
    use visibility_testing::Random;

    /// Returns a random half-open range of pixels within `0..size`, never empty. Half of the ranges are at
    /// most 4 pixels long.
    fn range(random: &mut Random, size: usize) -> [u32; 2] {
        let (a, b) = (random.below(size) as u32, random.below(size) as u32);
        let far = if random.below(2) == 0 { a.max(b) } else { (a.min(b) + 3).min(size as u32 - 1) };
        [a.min(b), far + 1]
    }

    /// Returns a random pyramid with large covered areas and a few holes, updated in two steps, and whether
    /// each pixel of the picture is covered, row by row.
    fn map(random: &mut Random, [width, height]: [usize; 2]) -> (OpacityPyramid, Vec<bool>) {
        let mut tiles = Tiles::new(width, height);
        let mut opacity = OpacityPyramid::new([width, height]);
        for _ in 0..2 {
            let mut stale = TileRange::NONE;
            for _ in 0..random.below(6) {
                let area = Rectangle { columns: range(random, width), lines: range(random, height) };
                let holes = [0, 1, 40][random.below(3)];
                let region = TileRange::of(&area);
                let [x0, x1, y0, y1] = region.0;
                for (x, y) in (y0..=y1).flat_map(|y| (x0..=x1).map(move |x| (x, y))) {
                    let mut bits = mask(&area, x, y);
                    if random.below(100) < holes {
                        bits &= !(1 << random.below(64));
                    }
                    tiles.cover(y * tiles.columns + x, bits, 1.0, 0);
                }
                stale.join(&region);
            }
            if !stale.is_empty() {
                opacity.update(&tiles, &stale);
            }
        }
        let pixels = (0..width * height).map(|i| tiles.pixel(i % width, i / width) > 0.0).collect();
        (opacity, pixels)
    }

    #[test]
    fn counts_are_those_of_the_pixels() {
        let mut random = Random(1);
        for round in 0..200 {
            let size = [17 + random.below(300), 16 + random.below(200)];
            let (opacity, pixels) = map(&mut random, size);
            for level in 0..TILE + opacity.levels.len() {
                let [columns, rows] = opacity.size(level).unwrap();
                assert_eq!(
                    [columns, rows],
                    size.map(|side| side.div_ceil(1 << level)),
                    "round {round}, level {level}: texels in each direction"
                );
                for (x, y) in (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y))) {
                    let (mut count, mut area) = (0, 0);
                    for v in (y << level)..((y + 1) << level).min(size[1]) {
                        for u in (x << level)..((x + 1) << level).min(size[0]) {
                            count += u32::from(pixels[v * size[0] + u]);
                            area += 1;
                        }
                    }
                    assert_eq!(opacity.texel(level, x, y), Some([count, area]), "round {round}");
                }
            }
        }
    }

    #[test]
    fn at_a_threshold_of_one_opaque_is_every_pixel_covered() {
        let mut random = Random(2);
        let (mut yes, mut no) = (0, 0);
        for _ in 0..600 {
            let size = [17 + random.below(500), 16 + random.below(300)];
            let (opacity, pixels) = map(&mut random, size);
            for _ in 0..100 {
                let rectangle =
                    Rectangle { columns: range(&mut random, size[0]), lines: range(&mut random, size[1]) };
                let [left, right] = rectangle.columns.map(|side| side as usize);
                let mut rows = rectangle.lines[0] as usize..rectangle.lines[1] as usize;
                let all = rows.all(|y| pixels[y * size[0] + left..y * size[0] + right].iter().all(|p| *p));
                assert_eq!(is_opaque(&opacity, &rectangle, true), all, "{rectangle:?} of {size:?}");
                *if all { &mut yes } else { &mut no } += 1;
            }
        }
        assert!(yes > 2000 && no > 2000, "{yes} opaque, {no} not");
    }

    #[test]
    fn prediction_changes_no_answer_and_lower_thresholds_only_add() {
        let mut random = Random(3);
        let mut more = 0;
        for _ in 0..600 {
            let size = [17 + random.below(500), 16 + random.below(300)];
            let (mut opacity, _) = map(&mut random, size);
            let rectangles: Vec<_> = (0..100)
                .map(|_| Rectangle {
                    columns: range(&mut random, size[0]),
                    lines: range(&mut random, size[1]),
                })
                .collect();
            let mut before: Vec<bool> = std::vec![false; rectangles.len()];
            for threshold in [1.0, 0.95, 0.8, 0.5, 0.1] {
                let mut thresholds = Thresholds::from_tile_threshold(threshold);
                if threshold < 0.9 {
                    thresholds.set(1, threshold);
                    thresholds.set(2, threshold);
                }
                opacity.set(thresholds);
                for (rectangle, before) in rectangles.iter().zip(&mut before) {
                    let opaque = is_opaque(&opacity, rectangle, true);
                    assert_eq!(opaque, is_opaque(&opacity, rectangle, false), "{rectangle:?} of {size:?}");
                    assert!(opaque || !*before, "{rectangle:?} of {size:?}: lost at {threshold}");
                    more += usize::from(opaque && !*before && threshold < 1.0);
                    *before = opaque;
                }
            }
        }
        assert!(more > 500, "the threshold does something: {more}");
    }

    /// A tile is opaque from the number of pixels on that the threshold asks for. Levels end with one texel,
    /// also if the picture is a single column or row of tiles.
    #[test]
    fn texels_are_opaque_from_their_threshold_on() {
        for picture in [[16, 16], [8, 64], [64, 8], [8, 8], [70, 30]] {
            let opacity = OpacityPyramid::new(picture);
            let sizes: Vec<_> = opacity.levels.iter().map(|level| [level.columns, level.rows]).collect();
            let mut size = picture.map(|side| side.div_ceil(SIDE));
            for own in &sizes {
                assert_eq!(*own, size, "texels of a level of {picture:?}");
                size = size.map(|side| side.div_ceil(2));
            }
            assert_eq!(sizes.iter().filter(|&&own| own == [1, 1]).count(), 1, "levels of {picture:?}");
        }
        let whole = Rectangle { columns: [0, 8], lines: [0, 8] };
        for count in 30..35 {
            let mut tiles = Tiles::new(16, 16);
            tiles.cover(0, (1 << count) - 1, 1.0, 0);
            let mut opacity = OpacityPyramid::new([16, 16]);
            opacity.update(&tiles, &TileRange([0, 1, 0, 1]));
            opacity.set(Thresholds::from_tile_threshold(0.5));
            assert_eq!(is_opaque(&opacity, &whole, true), count >= 32, "{count} pixels of 64");
        }
    }

    #[test]
    fn fine_texels_with_few_holes_count_as_opaque() {
        let mut tiles = Tiles::new(16, 16);
        // Covers three pixels of the first block of 2 x 2, and two of the second.
        tiles.cover(0, 0b01 | 0b11 << SIDE | 0b11 << 2, 1.0, 0);
        let mut opacity = OpacityPyramid::new([16, 16]);
        opacity.update(&tiles, &TileRange([0, 1, 0, 1]));
        let block = |left| Rectangle { columns: [left, left + 2], lines: [0, 2] };
        assert!(!is_opaque(&opacity, &block(0), true), "one pixel of the block is open");
        let mut thresholds = Thresholds::OPAQUE;
        thresholds.set(1, 0.75);
        opacity.set(thresholds);
        assert!(
            is_opaque(&opacity, &block(0), true) && !is_opaque(&opacity, &block(2), true),
            "three quarters of a block are enough, a half is not"
        );
    }
}
