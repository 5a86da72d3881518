//! Tests of tiles against records of single pixels: what occluders cover, at which depth keys, and what they
//! hide.

use super::depth_planes::DepthPlanes;
use super::tile_layout::{EMPTY_DEPTH, Rectangle, SIDE};
use super::tiles::{LAYERS, Tiles, UNCHANGED};
use crate::query::box_face_planes::{BoxFacePlanes, FacePlaneSetup};
use crate::setup::screen_projection::ScreenProjection;
use crate::setup::screen_shape::ScreenShape;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{Pose, View};
use visibility_testing::Random;

/// Returns depth planes whose value is `depth_key` everywhere.
fn flat(depth_key: f32) -> DepthPlanes {
    DepthPlanes::one([0.0, 0.0, depth_key])
}

/// Returns the face planes of a box in a perspective view of one tile, and the upper bound that they give on
/// its depth keys there.
fn box_planes() -> (BoxFacePlanes, f64) {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, 900.0).unwrap();
    let projection = ScreenProjection::new(&view, DVec3::ZERO, [SIDE; 2], [SIDE; 2]);
    let planes = FacePlaneSetup::new(&projection).of_box([5.0, -9.0, -9.0, 6.0, 9.0, 9.0]);
    let [upper, _] = planes.range(TILE);
    assert!(upper.is_finite(), "the front face bounds the keys of the box");
    (planes, upper)
}

/// Left, right, top and bottom of the only tile, in pixels.
const TILE: [f64; 4] = [0.0, 8.0, 0.0, 8.0];

/// Returns the masks of the layers in use.
fn masks(tiles: &Tiles) -> Vec<u64> {
    tiles.layers[0].masks[..usize::from(tiles.counts[0])].to_vec()
}

/// Pixels have the greatest key of the occluders that cover them as long as no layers are merged, and no
/// greater one afterwards. Layers are disjoint, none is empty, and all hold more than the whole tile does.
/// What layers held before the tile was emptied is forgotten.
#[test]
fn pixels_have_the_nearest_key_of_what_covers_them() {
    let (mut random, mut tiles, mut merged) = (Random(1), Tiles::new(SIDE, SIDE), 0);
    for round in 0..4_000 {
        let few = round % 2 == 0;
        tiles.clear();
        let mut keys = [EMPTY_DEPTH; 64];
        for step in 0..if few { LAYERS } else { 3 * LAYERS } {
            let rows = |random: &mut Random| u64::MAX << (8 * random.below(8)) >> (8 * random.below(8));
            let mask = match if round % 4 == 3 { 2 } else { random.below(6) } {
                0 => u64::MAX,
                1 => random.bits(),
                2 => random.bits() & random.bits() & random.bits(),
                3 => 0,
                4 => !keys.iter().rev().fold(0, |all, &key| all << 1 | u64::from(key > EMPTY_DEPTH)),
                _ => rows(&mut random),
            };
            let key = 1.0 + random.below(if few { 5 } else { 20 }) as f32;
            let (least_before, before) = (tiles.tile_min[0], masks(&tiles));
            tiles.changed[0] = UNCHANGED;
            tiles.changed_rows = UNCHANGED;
            tiles.cover(0, mask, key, 0);
            let case = (round, step, mask, key);
            let is_changed = tiles.changed[0] != UNCHANGED;
            assert_eq!(is_changed, tiles.tile_min[0] > least_before, "{case:?}: the tile is marked");
            assert_eq!(is_changed, tiles.changed_rows != UNCHANGED, "{case:?}: the row is marked");
            if mask == 0 || key <= least_before {
                assert_eq!(masks(&tiles), before, "{case:?}: nothing is new");
            }
            for (pixel, own) in keys.iter_mut().enumerate().filter(|(pixel, _)| mask >> pixel & 1 != 0) {
                let is_new = key > *own;
                *own = if is_new { key } else { *own };
                assert!(tiles.pixel(pixel % SIDE, pixel / SIDE) > EMPTY_DEPTH, "{case:?}: {pixel} is bare");
            }
            let own: Vec<f32> = (0..64).map(|pixel| tiles.pixel(pixel % SIDE, pixel / SIDE)).collect();
            let is_merged = own != keys;
            merged += usize::from(is_merged);
            assert!(!(few && is_merged), "{case:?}: {own:?} instead of {keys:?}");
            for pixel in 0..64 {
                assert!(own[pixel] <= keys[pixel], "{case:?}: {pixel} has {}", own[pixel]);
                assert_eq!(own[pixel] > EMPTY_DEPTH, keys[pixel] > EMPTY_DEPTH, "{case:?}: {pixel}");
            }
            let bits = |is_in: &dyn Fn(usize) -> bool| {
                (0..64).fold(0, |all, pixel| all | u64::from(is_in(pixel)) << pixel)
            };
            let least = own.iter().copied().fold(f32::INFINITY, f32::min);
            assert!(tiles.tile_min[0] <= least, "{case:?}: the tile has {}", tiles.tile_min[0]);
            assert!(!few || tiles.tile_min[0] == least, "{case:?}: the tile has less than {least}");
            assert_eq!(tiles.covered(0), bits(&|pixel| own[pixel] > EMPTY_DEPTH), "{case:?}: covered");
            let farthest = own.iter().copied().filter(|&key| key > EMPTY_DEPTH).fold(f32::INFINITY, f32::min);
            assert_eq!(tiles.farthest(0).max(least), farthest, "{case:?}: farthest");
            let mut union = 0;
            for (i, mask) in masks(&tiles).into_iter().enumerate() {
                assert!(mask != 0 && mask & union == 0, "{case:?}: layer {i} is empty or not disjoint");
                assert!(tiles.layers[0].depth_key[i] > tiles.tile_min[0], "{case:?}: layer {i} is behind");
                union |= mask;
            }
            for depth_key in [0.5, 1.0, 2.0, 3.0, 4.5, 5.0, 12.0] {
                let nearer = bits(&|pixel| own[pixel] > depth_key);
                for mask in [nearer, u64::MAX, random.bits()] {
                    let wanted = mask & !nearer == 0;
                    assert_eq!(tiles.hides(0, mask, depth_key), wanted, "{case:?}: {mask} at {depth_key}");
                    let is_hidden = tiles.hides_partly(0, mask, depth_key) || tiles.tile_min[0] > depth_key;
                    assert_eq!(is_hidden, wanted, "{case:?}: {mask} at {depth_key}, by layers");
                    let planes = FacePlaneSetup::default().of_box([0.0; 6]);
                    let left = tiles.undecided(0, mask, TILE, depth_key, &planes);
                    assert_eq!(left, mask & !nearer, "{case:?}: undecided of {mask} at {depth_key}");
                }
            }
        }
    }
    assert!(merged > 1_000, "layers were merged in {merged} steps");
}

/// Occluders without a depth key change nothing.
#[test]
fn keys_that_are_no_numbers_cover_nothing() {
    let mut tiles = Tiles::new(SIDE, SIDE);
    for mask in [1, u64::MAX] {
        tiles.cover(0, mask, f32::NAN, 0);
        assert_eq!((tiles.covered(0), tiles.tile_min[0]), (0, EMPTY_DEPTH), "mask {mask}");
    }
}

/// Depth planes of what covers pixels are kept: those of layers as near as the whole tile, those of equally
/// near occluders that were there first, and those of the whole tile.
#[test]
fn planes_of_covered_pixels_are_kept() {
    let left: u64 = 0x0f0f_0f0f_0f0f_0f0f;
    let mut tiles = Tiles::new(SIDE, SIDE);
    let [first, second] = [flat(5.0), flat(7.0)].map(|planes| tiles.add_depth_planes(planes));
    tiles.cover(0, left, 1.0, first);
    tiles.cover(0, left | 1 << 7, 1.0, second);
    assert_eq!(masks(&tiles), [left, 1 << 7], "an equally near occluder has the other pixels alone");
    tiles.cover(0, !left, 1.0, 0);
    assert_eq!(tiles.tile_min[0], 1.0, "the tile is covered");
    assert_eq!(masks(&tiles), [left, 1 << 7], "layers as near as the tile are kept for their planes alone");
    tiles.cover(0, 1, 3.0, 0);
    let keys = [0, 1, 4, 7].map(|column| tiles.pixel_closely(column, 0));
    assert_eq!(keys, [3.0, 5.0, 1.0, 7.0], "keys of pixels by the planes of their layers");
    tiles.clear();
    assert_eq!(tiles.pixel_closely(1, 0), EMPTY_DEPTH, "planes are forgotten");
    let [_, _, whole] = [9.0, 9.0, 4.0].map(|key| tiles.add_depth_planes(flat(key)));
    tiles.cover(0, 1, 3.0, 0);
    assert_eq!([1, 4, 7].map(|column| tiles.pixel_closely(column, 0)), [EMPTY_DEPTH; 3], "so are layers");
    tiles.cover_tile(0, 0, 2.0, whole);
    assert_eq!([0, 1].map(|column| tiles.pixel(column, 0)), [3.0, 2.0], "layers stay as they are");
    assert_eq!([0, 1].map(|column| tiles.pixel_closely(column, 0)), [4.0, 4.0], "planes of the tile");
    tiles.cover_tile(0, 0, 6.0, 0);
    assert_eq!(tiles.pixel(0, 0), 6.0, "a layer behind the whole tile does not count");
    assert!(tiles.hides(0, 1, 5.0), "nor for what is hidden");
    let mut tiles = Tiles::new(SIDE, SIDE);
    for (mask, key) in [(1, 1.0), (2, 2.0), (4, 3.0), (8, 4.0)] {
        tiles.cover(0, mask, key, 0);
    }
    tiles.cover(0, 1 << 4, 4.5, 0);
    let keys = [0, 1, 2, 3, 4].map(|column| tiles.pixel(column, 0));
    assert_eq!(keys, [1.0, 2.0, 3.0, 4.0, 4.0], "the two layers that differ least are merged");
}

/// Pixels are hidden by the key of the tile or of their layer, or by planes that are nearer than the box, or
/// than its faces.
#[test]
fn pixels_are_decided_by_keys_and_planes() {
    let (faces, upper) = box_planes();
    let (far, near) = (0.5 * upper as f32, 2.0 * upper as f32);
    let none = FacePlaneSetup::default().of_box([0.0; 6]);
    let (part, most) = (0xff_u64, 8.0 * near);
    for (planes, depth_key, box_planes, is_hidden) in [
        (None, 0.5 * far, &none, true),
        (None, far, &none, false),
        (None, most, &faces, false),
        (Some(near), near, &none, false),
        (Some(near), 0.9 * near, &none, true),
        (Some(near), most, &none, false),
        (Some(near), most, &faces, true),
        (Some(far), most, &faces, false),
    ] {
        for mask in [u64::MAX, part] {
            let mut tiles = Tiles::new(SIDE, SIDE);
            let index = planes.map_or(0, |key| tiles.add_depth_planes(flat(key)));
            tiles.cover(0, mask, far, index);
            let left = tiles.undecided(0, u64::MAX, TILE, depth_key, box_planes);
            let wanted = if is_hidden { !mask } else { u64::MAX };
            assert_eq!(left, wanted, "{planes:?} against {depth_key}, mask {mask}");
            let other = tiles.undecided(0, !part, TILE, depth_key, box_planes);
            assert_eq!(other, wanted & !part, "other pixels, {planes:?} against {depth_key}");
        }
    }
    assert!(!DepthPlanes::NONE.is_nearer_than(TILE, &faces), "no planes are nearer than nothing");
}

/// The planes of a shape are kept up to three. The occluder is as near as the least of them.
#[test]
fn up_to_three_planes_bound_a_shape() {
    let mut shape = ScreenShape::default();
    for (count, least) in [(1, 5.0), (2, 4.0), (3, 3.0), (4, f64::NEG_INFINITY)] {
        shape.planes[count - 1] = [0.0, 0.0, 6.0 - count as f32];
        shape.plane_count = count;
        assert_eq!(DepthPlanes::of(&shape).least(TILE), least, "{count} planes");
    }
}

/// A rectangle is thin if no pixel is within it when its sides are rounded inwards. Parts of rectangles are
/// those within tile columns.
#[test]
fn rectangles_are_thin_up_to_a_pixel_and_cut_at_tiles() {
    let of = |columns: [u32; 2], lines: [u32; 2]| Rectangle { columns, lines };
    for (width, height, is_thin) in [(1, 5, true), (5, 1, true), (2, 2, false), (1, 1, true), (2, 5, false)] {
        assert_eq!(of([3, 3 + width], [4, 4 + height]).is_thin(), is_thin, "{width} by {height} pixels");
    }
    for (columns, tiles, wanted) in [
        ([3, 30], [1, 2], Some([8, 16])),
        ([10, 12], [1, 2], Some([10, 12])),
        ([3, 30], [0, 9], Some([3, 30])),
        ([3, 8], [1, 2], None),
        ([16, 30], [1, 2], None),
    ] {
        let part = of(columns, [2, 5]).within_columns(tiles);
        assert_eq!(part.map(|part| part.columns), wanted, "columns {columns:?} in tiles {tiles:?}");
        assert!(part.is_none_or(|part| part.lines == [2, 5]), "rows of {columns:?} stay");
    }
}
