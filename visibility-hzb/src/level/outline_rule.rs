//! Tests of the rule by which outlines cover pixels, and of the depth keys there, in exact arithmetic.

use super::edges::Edges;
use super::fill::{FillScratch, fill};
use super::frame::LevelFrame;
use super::open_tiles::{DepthBound, TileKeys, find_open_tiles};
use super::prepared::{NO_EDGE, PreparedEdge, PreparedLevel};
use super::seams::Seams;
use crate::buffer::tile_layout::SIDE;
use crate::buffer::tiles::Tiles;
use crate::coverage::Coverage;
use crate::exact_outline::{
    Spot, UNITS, along_borders, centre, coordinate, edges, in_pixels, is_near, meets, winding,
};
use crate::random::random;
use crate::setup::screen_shape::tile_minimum_plane;
use alloc::format;
use alloc::sync::Arc;
use alloc::vec::Vec;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Pose, View};
use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle};

/// Width and height of the buffer in pixels: 18 columns of tiles, more than are processed together.
const SIZE: [usize; 2] = [144, 16];

/// Rounding that the slack of these tests allows for, in pixels: 64 units of round-off of the greatest
/// coordinate.
const ROUNDING: f32 = 0.003;

/// Units by which a pixel may be nearer to an edge than the slack and still be covered or not: rounding, and
/// the height of edges that count as horizontal.
const UNCERTAIN: i128 = 8;

/// Returns a frame whose slack and columns are replaced by each test.
pub(super) fn frame() -> LevelFrame {
    let corners = [Vec3::ZERO, Vec3::new(9.0, 9.0, 0.0), Vec3::new(9.0, 0.0, 9.0)];
    let triangles = [LevelTriangle { corners, two_sided: true }];
    let level = LevelOccluders::new(&triangles, LevelSettings::default()).unwrap();
    let level = PreparedLevel::new(Arc::new(level), DVec3::ZERO);
    let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 900.0);
    LevelFrame::new(&view.unwrap(), &level, SIZE, SIZE, Coverage::Conservative, 16.0).unwrap()
}

/// Returns the outline of a polygon. `shared` is the index of its first edge if another polygon has it too.
fn outline(polygon: &[Spot], shared: u32) -> Edges {
    let mut outline = Edges::default();
    for (i, ends) in edges(polygon).enumerate() {
        let [a, b] = ends.map(|end| in_pixels(end).map(|v| v as f32));
        outline.push(a, b, if i == 0 { shared } else { NO_EDGE });
    }
    outline.finish();
    outline
}

/// Returns a spot within `reach` pixels of `middle`, in pixels.
fn spot(random: &mut impl FnMut(f64, f64) -> f64, middle: [f64; 2], reach: f64) -> Spot {
    middle.map(|at| coordinate(random, at - reach, at + reach))
}

/// Draws an outline with the depth keys of `plane`, in pixel coordinates.
fn draw(
    outline: &Edges,
    frame: &LevelFrame,
    coverage: Coverage,
    plane: [f64; 3],
    seams: &mut Seams,
    tiles: &mut Tiles,
) {
    let plane = tile_minimum_plane(plane, SIZE.map(|side| side as f64));
    let bound = DepthBound { plane, floor: f32::NEG_INFINITY };
    let Some(keys) = TileKeys::new(outline, frame, &bound, tiles) else { return };
    let mut scratch = FillScratch::default();
    find_open_tiles(&keys, tiles, &mut scratch.open);
    fill(outline, frame.slack, &keys, coverage, &mut scratch, seams, tiles);
}

/// A pixel of the frame's columns is covered if and only if an odd number of edges is to the left of its
/// centre, and no edge comes within the slack of it.
#[test]
fn pixels_are_covered_up_to_the_slack_from_an_outline() {
    let (mut random, mut frame, mut counts) = (random(41), frame(), [0; 2]);
    for trial in 0..400 {
        let slack = random(0.0, 200.0) as i128 * i128::from(trial % 3 != 0);
        frame.slack = slack as f32 / UNITS as f32 + ROUNDING;
        frame.columns = if trial % 5 == 0 { [7, 15] } else { [0, 18] };
        let reach = [4.0, 30.0, 300.0][random(0.0, 3.0) as usize];
        let middle = [random(-40.0, 184.0), random(-10.0, 26.0)];
        let polygon: [Spot; 4] = if trial % 5 < 2 {
            along_borders(&mut random, [18, 2])
        } else {
            core::array::from_fn(|_| spot(&mut random, middle, reach))
        };
        let coverage = if trial % 4 == 0 { Coverage::Sampled } else { Coverage::Conservative };
        let (mut tiles, mut seams) = (Tiles::new(SIZE[0], SIZE[1]), Seams::default());
        draw(&outline(&polygon, NO_EDGE), &frame, coverage, [0.0, 0.0, 1.0], &mut seams, &mut tiles);
        for pixel in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| [x, y])) {
            let is_covered = tiles.pixel(pixel[0], pixel[1]) > f32::NEG_INFINITY;
            let near = |by: i128| edges(&polygon).any(|edge| is_near(edge, pixel, by));
            let at = centre(pixel);
            let is_in = (frame.columns[0]..frame.columns[1]).contains(&(pixel[0] / SIDE));
            let is_odd = is_in && winding(&polygon, at) % 2 != 0;
            let [low, high] = [-UNCERTAIN, UNCERTAIN].map(|by| at.map(|v| v + by));
            let is_unknown = edges(&polygon).any(|[a, b]| meets(a, b, low, high));
            let (within, around) = match coverage {
                Coverage::Sampled => (false, is_unknown),
                Coverage::Conservative => (near(slack), near(slack + UNCERTAIN)),
            };
            let case = || format!("trial {trial}, pixel {pixel:?} of {polygon:?}, slack {slack}");
            let is_wrong = within || !is_in || !is_odd && !is_unknown;
            assert!(!is_covered || !is_wrong, "{} is covered", case());
            assert!(is_covered || around || !is_odd, "{} is bare", case());
            counts[usize::from(is_covered)] += 1;
        }
    }
    assert!(counts.iter().all(|&count| count > 25_000), "{counts:?} pixels are bare and covered");
}

/// Two triangles with a common edge cover the pixels along it together, at the farther of their depth keys in
/// the part of the pixel to which each may extend.
#[test]
fn pixels_along_a_shared_edge_are_covered_by_both() {
    let (mut random, mut frame, mut seam_pixels) = (random(42), frame(), 0);
    let mut seams = Seams::default();
    for trial in 0..400 {
        let slack = random(0.0, 200.0) as i128 * i128::from(trial % 3 != 0);
        frame.slack = slack as f32 / UNITS as f32 + ROUNDING;
        frame.columns = if trial % 5 == 0 { [7, 15] } else { [0, 18] };
        let reach = [10.0, 60.0, 150.0][random(0.0, 3.0) as usize];
        let middle = [random(0.0, 144.0), random(0.0, 16.0)];
        let [a, b, c, d]: [Spot; 4] = if trial % 5 < 2 {
            along_borders(&mut random, [18, 2])
        } else {
            core::array::from_fn(|_| spot(&mut random, middle, reach))
        };
        let polygons = [[a, b, c], [b, a, d]];
        let joined = [b, c, a, d];
        let planes: [[f64; 3]; 2] =
            [0; 2].map(|_| [random(-0.3, 0.3), random(-0.3, 0.3), random(150.0, 300.0)]);
        let mut tiles = Tiles::new(SIZE[0], SIZE[1]);
        // The second of the triangles' levels: its edges begin at 6.
        let pairs = [0, 1].map(|i| PreparedEdge { ends: [0, 1], partner: 3 - 3 * i });
        seams.begin_frame(12);
        for i in 0..2 {
            let first = 3 * i as u32;
            let own = outline(&polygons[i], 6 + first);
            draw(&own, &frame, Coverage::Conservative, planes[i], &mut seams, &mut tiles);
            let none = PreparedEdge { ends: [0, 1], partner: NO_EDGE };
            seams.cover(&[pairs[i], none, none], first, 6, &mut tiles);
        }
        // Least depth key of each plane in the part of a pixel within the slack of the triangle's bounds.
        let least = |i: usize, pixel: [usize; 2]| {
            let side = |axis: usize| {
                let of = polygons[i].map(|spot| spot[axis]);
                let low = (of[0].min(of[1]).min(of[2]) - slack) as f64 / UNITS as f64;
                let high = (of[0].max(of[1]).max(of[2]) + slack) as f64 / UNITS as f64;
                let (first, end) = (pixel[axis] as f64, pixel[axis] as f64 + 1.0);
                let at = if planes[i][axis] > 0.0 { first.max(low) } else { end.min(high) };
                at * planes[i][axis]
            };
            side(0) + side(1) + planes[i][2]
        };
        for pixel in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| [x, y])) {
            let key = tiles.pixel(pixel[0], pixel[1]);
            let is_in = (frame.columns[0]..frame.columns[1]).contains(&(pixel[0] / SIDE));
            let own = |i: usize, by: i128| {
                !edges(&polygons[i]).any(|edge| is_near(edge, pixel, by))
                    && winding(&polygons[i], centre(pixel)) % 2 != 0
            };
            let both = |by: i128| {
                !edges(&joined).any(|edge| is_near(edge, pixel, by))
                    && winding(&joined, centre(pixel)) % 2 != 0
            };
            let case = || format!("trial {trial}, pixel {pixel:?} of {a:?} {b:?} {c:?} {d:?}, slack {slack}");
            if key == f32::NEG_INFINITY {
                let by = slack + UNCERTAIN;
                assert!(!is_in || !(own(0, by) || own(1, by) || both(by)), "{} is bare", case());
                continue;
            }
            let keys = [0, 1].map(|i| least(i, pixel));
            let mut allowed: Vec<f64> = (0..2).filter(|&i| own(i, slack)).map(|i| keys[i]).collect();
            let is_alone = allowed.is_empty();
            allowed.extend(both(slack).then_some(keys[0].min(keys[1])));
            seam_pixels += u32::from(is_alone);
            let most = allowed.into_iter().fold(f64::NEG_INFINITY, f64::max);
            assert!(is_in && f64::from(key) <= most, "{}: {key} above {most}", case());
        }
    }
    assert!(seam_pixels > 1_000, "{seam_pixels} pixels are covered by both");
}
