//! Tests of all code that turns a range of real numbers into pixels, rows, tiles or words of masks: on, just
//! before and just after each border and quarter of a pixel, against integers. Ends of ranges have integer
//! *ranks*, of which `UNIT` make a pixel.

use crate::buffer::pyramid::Pyramid;
use crate::buffer::tile_layout::{Rectangle, SIDE, mask};
use crate::buffer::tiles::Tiles;
use crate::coverage::Coverage;
use crate::hom::depth_estimate::{DepthBoundary, DepthEstimate};
use crate::hom::opacity_pyramid::OpacityPyramid;
use crate::hom::overlap::is_opaque;
use crate::hom::tile_range::TileRange;
use crate::query::box_projection::{ScreenProjection32, project};
use crate::query::occluder_query::rectangle_may_be_seen;
use crate::raster::contour_raster::{ContourRaster, ContourTiles, ScreenVertex};
use crate::raster::shape_fill::fill_shape;
use crate::setup::screen_bounds::pixels;
use crate::setup::screen_projection::ScreenProjection;
use crate::setup::screen_shape::ScreenShape;
use std::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{Pose, View, view::Window};
use visibility_testing::{End, UNIT, ends, ends_f32};

/// Width and height of the buffer in pixels: three tiles by two.
const SIZE: [usize; 2] = [24, 16];

/// Tolerance of the tests, in ranks (`UNIT` ranks are a pixel). The tested code has margins for rounding, so
/// where an end of a range is this close to the border of a pixel, either result is accepted. Less than a
/// quarter of a pixel.
const HAIR: i64 = 2;

/// Returns whether a closed range contains a whole pixel after both of its ends are moved inwards by
/// `inwards` ranks (`UNIT` ranks are a pixel).
fn holds([low, high]: [i64; 2], pixel: usize, inwards: i64) -> bool {
    let start = UNIT * pixel as i64;
    low + inwards <= start && start + UNIT <= high - inwards
}

/// Returns whether a closed range meets the inside of a pixel.
fn meets([low, high]: [i64; 2], pixel: usize) -> bool {
    let start = UNIT * pixel as i64;
    low < start + UNIT && high > start && low <= high
}

/// Returns whether a closed range meets a pixel or its border, or comes within [`HAIR`] of it.
fn touches([low, high]: [i64; 2], pixel: usize) -> bool {
    let start = UNIT * pixel as i64;
    low - HAIR <= start + UNIT && high + HAIR >= start
}

/// Checks that the covered pixels of a column or row are those that the range contains, up to [`HAIR`].
fn check_covered(tiles: &Tiles, axis: usize, across: usize, range: [i64; 2], what: &str) {
    for pixel in 0..SIZE[axis] {
        let at = if axis == 0 { [pixel, across] } else { [across, pixel] };
        let is_covered = tiles.pixel(at[0], at[1]) > 0.0;
        assert!(
            !is_covered || holds(range, pixel, 0),
            "{what}: axis {axis}, {range:?} does not hold {pixel}"
        );
        assert!(is_covered || !holds(range, pixel, HAIR), "{what}: axis {axis}, {range:?} holds {pixel}");
    }
}

/// Calls `each` with all ranges along an axis, given by their low and high ends. The ends lie from before the
/// first pixel of the axis to beyond its last; empty and inverted ranges are included.
fn for_each_range(axis: usize, mut each: impl FnMut(&End<f64>, &End<f64>)) {
    let all = ends(-1, SIZE[axis] as i32 + 1);
    all.iter().for_each(|low| all.iter().for_each(|high| each(low, high)));
}

/// Tests half-planes on both sides of a shape: vertical, at slopes of 1 and 1/2, and horizontal.
#[test]
fn shapes_cover_the_pixels_between_their_ends() {
    let size = SIZE.map(|side| side as f64);
    for axis in [0, 1] {
        for twice_slope in if axis == 0 { &[0, 1, -1, 2][..] } else { &[0] } {
            let mut tiles = Tiles::new(SIZE[0], SIZE[1]);
            for_each_range(axis, |low, high| {
                let slope = 0.5 * *twice_slope as f64;
                let mut shape = ScreenShape::default();
                shape.begin([0.0, size[0]], [0.0, size[1]], 1.0, 1.0);
                let sides = match axis {
                    0 => [[1.0, -slope, -low.value], [-1.0, slope, high.value]],
                    _ => [[0.0, 1.0, -low.value], [0.0, -1.0, high.value]],
                };
                for side in sides {
                    assert!(
                        shape.add_edge(side, size, Coverage::Conservative),
                        "the shape is not outside the picture"
                    );
                }
                tiles.clear();
                fill_shape(&shape, &mut tiles);
                for across in [0, 1, 7, 8, 15] {
                    // Columns by which the slope moves the upper and the lower border of the row, in ranks.
                    let at = |y: usize| twice_slope * UNIT / 2 * y as i64;
                    let (top, bottom) = (at(across), at(across + 1));
                    let range = [low.rank + top.max(bottom), high.rank + top.min(bottom)];
                    check_covered(&tiles, axis, across, range, "shape");
                }
            });
        }
    }
}

/// A half-plane with a NaN coefficient leaves no pixel in the shape, on whichever side it is.
#[test]
fn edges_that_are_not_numbers_leave_no_pixel() {
    let size = SIZE.map(|side| side as f64);
    for axis in 0..3 {
        for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for level in [1.0, -1.0, 0.0] {
                for coverage in [Coverage::Conservative, Coverage::Sampled] {
                    let mut line = [0.0, level, number];
                    line[axis] = f64::NAN;
                    let (mut shape, mut tiles) = (ScreenShape::default(), Tiles::new(SIZE[0], SIZE[1]));
                    shape.begin([0.0, size[0]], [0.0, size[1]], 1.0, 1.0);
                    assert!(shape.add_edge(line, size, coverage), "{line:?} is kept");
                    fill_shape(&shape, &mut tiles);
                    let covered = (0..6).any(|tile| tiles.covered(tile) != 0);
                    assert!(!covered, "{line:?} leaves pixels");
                }
            }
        }
    }
}

/// Tests the contour of one rectangle, without slack: the pixels wholly in the rectangle are covered, and no
/// pixel that an edge of the contour enters.
#[test]
fn contours_cover_the_pixels_between_their_ends() {
    let size = SIZE.map(|side| side as f64);
    for axis in [0, 1] {
        let mut tiles = Tiles::new(SIZE[0], SIZE[1]);
        let mut cells = ContourTiles::new(&tiles);
        for_each_range(axis, |low, high| {
            if low.rank >= high.rank {
                return;
            }
            let mut to = size;
            let mut from = [0.0; 2];
            (from[axis], to[axis]) = (low.value, high.value);
            let corners = [from, [from[0], to[1]], to, [to[0], from[1]]];
            let corners = corners.map(|[x, y]| ScreenVertex { x, y, far: 1.0 });
            let mut raster = ContourRaster::new(&mut cells, tiles.columns, size, 0.0);
            raster.lower_depth_keys(&corners, || [0.0, 0.0, 1.0]);
            for i in 0..4 {
                raster.contour(&corners[i], &corners[(i + 1) % 4], 1, true);
            }
            tiles.clear();
            raster.merge(&mut tiles);
            for across in [1, 6, 9, 14] {
                check_covered(&tiles, axis, across, [low.rank, high.rank], "contour");
            }
        });
    }
}

/// The projection of a view in which a metre is a pixel, with the origin in the upper left corner and rows
/// along -y.
fn pixel_view() -> ScreenProjection {
    let [width, height] = SIZE.map(|side| side as f64);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y);
    let window = Window { left: 0.0, right: width, bottom: -height, top: 0.0 };
    let view = View::orthographic(pose, window, -10.0, 10.0).unwrap();
    ScreenProjection::new(&view, DVec3::ZERO, SIZE, SIZE)
}

#[test]
fn boxes_meet_the_pixels_of_their_rectangle() {
    let projection = ScreenProjection32::new(&pixel_view());
    for axis in [0, 1] {
        let all = ends_f32(-1, SIZE[axis] as i16 + 1);
        for (i, low) in all.iter().enumerate() {
            for high in &all[i..] {
                let mut sides = [[3.5], [-3.5], [-1.0], [3.5], [-3.5], [-1.0]];
                let [from, to] = if axis == 0 { [low.value, high.value] } else { [-high.value, -low.value] };
                (sides[axis], sides[axis + 3]) = ([from], [to]);
                let seen = project(&projection, &sides);
                let range = [low.rank, high.rank];
                assert!(seen.known[0], "axis {axis}: the box {range:?} is projected");
                let (before, behind) = (high.rank < 0, low.rank > UNIT * SIZE[axis] as i64);
                assert!(!seen.outside[0] || before || behind, "axis {axis}: {range:?} is in the picture");
                assert!(
                    seen.outside[0]
                        || (!before && !behind)
                        || touches(range, 0)
                        || touches(range, SIZE[axis] - 1),
                    "axis {axis}: {range:?} is told outside, or touches the picture"
                );
                let is_inside = low.rank >= 0 && high.rank <= UNIT * SIZE[axis] as i64;
                assert!(!seen.inside[0] || is_inside, "axis {axis}: {range:?} leaves the picture");
                if before || behind {
                    continue;
                }
                let rectangle = seen.rectangle(0);
                let [first, end] = if axis == 0 { rectangle.columns } else { rectangle.lines };
                assert!(first < end && end as usize <= SIZE[axis], "axis {axis}: {range:?}");
                for pixel in 0..SIZE[axis] {
                    let is_in = (first..end).contains(&(pixel as u32));
                    assert!(is_in || !meets(range, pixel), "axis {axis}: {range:?} meets {pixel}");
                    // A box in the last pixel may also meet the pixel before it.
                    let is_near =
                        touches(range, pixel) || pixel + 2 == SIZE[axis] && touches(range, pixel + 1);
                    assert!(!is_in || is_near, "axis {axis}: {range:?} is far from {pixel}");
                }
            }
        }
    }
}

#[test]
fn bounds_of_occluders_meet_the_pixels_of_their_ranges() {
    let projection = pixel_view();
    for axis in [0, 1] {
        for_each_range(axis, |low, high| {
            let mut extent = [3.5, 4.5, 3.5, 4.5, 0.0, 1.0];
            (extent[2 * axis], extent[2 * axis + 1]) = (low.value, high.value);
            let met =
                pixels(&extent, &projection).map_or([0, 0], |met| [met.0, met.1][axis].map(|x| x as usize));
            for pixel in 0..SIZE[axis] {
                let (is_in, range) = ((met[0]..met[1]).contains(&pixel), [low.rank, high.rank]);
                assert!(is_in || !meets(range, pixel), "axis {axis}: {range:?} meets {pixel}");
                assert!(
                    !is_in || low.rank > high.rank || touches(range, pixel),
                    "axis {axis}: {range:?}, {pixel}"
                );
            }
        });
    }
}

/// Returns all half-open ranges of pixels of an axis that are not empty.
fn ranges(size: usize) -> Vec<[u32; 2]> {
    let size = size as u32;
    (0..size).flat_map(|first| (first + 1..=size).map(move |end| [first, end])).collect()
}

#[test]
fn masks_hold_the_pixels_of_rectangles() {
    let (columns, lines) = (ranges(SIZE[0]), ranges(SIZE[1]));
    for (&columns, &lines) in columns.iter().flat_map(|x| lines.iter().map(move |y| (x, y))) {
        let rectangle = Rectangle { columns, lines };
        for (x, y) in (0..2).flat_map(|y| (0..3).map(move |x| (x, y))) {
            let mut expected = 0u64;
            for (v, u) in (0..SIDE).flat_map(|v| (0..SIDE).map(move |u| (v, u))) {
                let [column, line] = [x * SIDE + u, y * SIDE + v].map(|at| at as u32);
                let is_in =
                    (columns[0]..columns[1]).contains(&column) && (lines[0]..lines[1]).contains(&line);
                expected |= u64::from(is_in) << (SIDE * v + u);
            }
            assert_eq!(mask(&rectangle, x, y), expected, "{rectangle:?} in tile {x}, {y}");
        }
    }
}

/// In a picture that is covered except for one pixel, a rectangle is hidden if and only if it does not
/// contain that pixel, by every function that tests rectangles.
#[test]
fn rectangles_are_hidden_unless_the_only_hole_is_in_them() {
    let mut coarsely = 0;
    // Pictures of five tiles by two, and of two by five, whose last tiles extend beyond the picture.
    for [width, height] in [[37, 9], [9, 37]] {
        let (columns, lines) = (ranges(width), ranges(height));
        let holes = (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
        for [x, y] in holes.filter(|[x, y]| [0, 1, 7, 8].contains(x.min(y))) {
            let mut tiles = Tiles::new(width, height);
            let hole = 1u64 << (y % SIDE * SIDE + x % SIDE);
            for tile in 0..tiles.columns * tiles.rows {
                let is_here = tile == y / SIDE * tiles.columns + x / SIDE;
                tiles.cover(tile, if is_here { !hole } else { u64::MAX }, 2.0, 0);
            }
            let mut pyramid = Pyramid::new(&tiles);
            pyramid.update(&mut tiles);
            let mut opacity = OpacityPyramid::new([width, height]);
            let all = TileRange([0, tiles.columns - 1, 0, tiles.rows - 1]);
            opacity.update(&tiles, &all);
            let mut boundary = DepthBoundary::new(&tiles);
            boundary.set(DepthEstimate::NoBackground);
            boundary.update(&tiles, &all);
            for (&columns, &lines) in columns.iter().flat_map(|x| lines.iter().map(move |y| (x, y))) {
                let rectangle = Rectangle { columns, lines };
                let is_in = |range: [u32; 2], at: usize| (range[0]..range[1]).contains(&(at as u32));
                let hidden = !(is_in(columns, x) && is_in(lines, y));
                assert_eq!(pyramid.hides(&tiles, &rectangle, 1.0), hidden, "{rectangle:?}, hole {x}, {y}");
                assert_eq!(
                    !rectangle_may_be_seen(&tiles, &rectangle, 1.0),
                    hidden,
                    "{rectangle:?}, hole {x}, {y}"
                );
                assert_eq!(is_opaque(&opacity, &rectangle, true), hidden, "{rectangle:?}, hole {x}, {y}");
                let is_coarsely = pyramid.hides_coarsely(&tiles, &rectangle, 1.0);
                assert!(hidden || !is_coarsely, "{rectangle:?}, hole {x}, {y}");
                coarsely += u64::from(is_coarsely);
                assert!(
                    boundary.is_nearer_than(&opacity, &tiles, &rectangle, 1.0),
                    "the wall at 2 hides what is at 1 around {rectangle:?}"
                );
                let is_hole = columns[0] + 1 == columns[1] && lines[0] + 1 == lines[1] && !hidden;
                assert_eq!(
                    boundary.is_nearer_than(&opacity, &tiles, &rectangle, 2.0),
                    is_hole,
                    "the wall at 2 hides what is as near, but for the hole {x}, {y} alone: {rectangle:?}"
                );
            }
        }
    }
    assert!(coarsely > 1_000_000, "{coarsely}");
}
