//! Tests of windows, in integers and with large errors.

use super::super::cell_extent::CellExtent;
use super::super::direction::CellBox;
use super::*;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;

impl Window {
    /// Returns a window at distance 1 whose pixels are a metre wide, with the first pixel at 0.
    pub(crate) fn unit() -> Self {
        Self::from_zero(1.0, [[0.0, SIDE as f64]; 2])
    }

    /// Returns a window without rims whose ends are exact.
    pub(crate) fn from_zero(d: f64, ends: [[f64; 2]; 2]) -> Self {
        let scale = ends.map(|[low, high]| SIDE as f64 / (high - low));
        Self { d, ends, scale, rims: [None; 2] }
    }
}

/// Compares with integers: all ends of ranges are in units of the slack, 1/1024 of a pixel.
#[test]
fn pixels_of_occludees_are_those_of_integer_arithmetic() {
    let (window, side) = (Window::unit(), SIDE as i64);
    let bounds = Aabb::new(Vec3::ZERO, Vec3::ONE);
    let places = [-1, 0, 1, 2, 63, 64, side / 2, side - 2, side - 1, side, side + 1];
    let around = [-2, -1, 0, 1, 2, 511, 512, 513];
    let ends = places.map(|pixel| around.map(|by| pixel * 1024 + by));
    let ends = ends.as_flattened();
    for (&low, &high) in ends.iter().flat_map(|low| ends.iter().map(move |high| (low, high))) {
        let range = [low as f64 / 1024.0, high as f64 / 1024.0];
        let found = window.pixels([range, [3.5, 4.5]], &bounds).map(|rect| rect.x);
        let turned = window.pixels([[3.5, 4.5], range], &bounds).map(|rect| rect.y);
        assert_eq!(found, turned, "{low} to {high}: pixels along x and along y");
        // Every pixel within a unit of the closed range must be tested, and be within the window.
        let near = [low - 1, high + 1].map(|at| at.div_euclid(1024));
        let is_within = low <= high + 2 && near[0] >= 0 && near[1] < side;
        assert_eq!(found, is_within.then(|| near.map(|at| at as usize)), "{low} to {high}");
    }
}

/// Follows rays from the corners of the cell through the corners of each pixel in integers. Their unit is
/// a 512th of a metre divided by the distance to the viewpoint.
#[test]
fn reprojected_pixels_contain_all_that_rays_through_them_meet() {
    let side = SIDE as i128;
    for (half, depth) in [(0, 0), (1, 0), (2, 7), (16, 1)] {
        let reach = DVec3::new(f64::from(depth) / 2.0, f64::from(half), f64::from(half));
        let cell = CellExtent::new(&Viewcell::from_box(-reach, reach), DVec3::ZERO).unwrap();
        let direction = CellBox::new(&cell, &Aabb::new(Vec3::ZERO, Vec3::ONE), DVec3::AXES).unwrap();
        let direction = direction.direction(0);
        for (from_d, d) in [(1, 2), (7, 8), (3, 40), (64, 65)] {
            for (from, to) in
                [([-8, 8], [-8, 8]), ([-4, 4], [-64, 64]), ([0, 256], [2, 3]), ([5, 9], [-9, 1])]
            {
                let real = |ends: [i32; 2]| [ends.map(f64::from); 2];
                let window = Window::from_zero(f64::from(d), real(to));
                let before = Window::from_zero(f64::from(from_d), real(from));
                let ranges = window.reprojection(&direction, &before, 0);
                let wide = |ends: [i32; 2]| i128::from(ends[1] - ends[0]);
                for (i, range) in ranges.iter().enumerate() {
                    let (mut least, mut most) = (i128::MAX, i128::MIN);
                    for corner in 0..8 {
                        let [right, up, back] = [0, 1, 2].map(|bit| corner >> bit & 1);
                        let p = side * i128::from(to[0]) + (i as i128 + right) * wide(to);
                        let v = side * i128::from(half) * (2 * up - 1);
                        let away = i128::from(d) + back * i128::from(depth);
                        let at = p * away + (v - p) * i128::from(d - from_d);
                        let (at, by) = (at - side * i128::from(from[0]) * away, away * wide(from));
                        // The first and the last pixel that the rays meet, apart from pixels that they
                        // only touch.
                        least = least.min(at.div_euclid(by));
                        most = most.max((at + by - 1).div_euclid(by) - 1);
                    }
                    let clamp = |pixel: i128| pixel.clamp(0, side - 1);
                    let [first, last] = range.map(i128::from);
                    assert!(first <= clamp(least) && clamp(most) <= last, "{i}: {range:?} {least} {most}");
                    assert!(clamp(least - 1) <= first && last <= clamp(most + 1), "{i}: {range:?}");
                    assert!(i == 0 || ranges[i - 1].iter().zip(range).all(|(a, b)| a <= b), "{i}");
                }
            }
        }
    }
}

/// A direction of a viewcell of a metre, whose coordinates are off by `error`.
fn direction(error: f64) -> Direction {
    let rows = [DVec3::X, DVec3::Y, DVec3::Z];
    Direction { rows, offset: [0.0; 3], half: [0.5; 2], exact: [None; 2], depth: 1.0, error }
}

/// Positions on a window that holds a single point are off by less than half of the slack.
#[test]
fn windows_are_wide_in_proportion_to_the_errors_of_positions() {
    for (at, error) in [(0.0, 1e-6), (1e6, 0.0), (-1e6, 0.0)] {
        let window = Window::fit(&direction(error), 1.0, [[at; 2]; 2], [None; 2]).unwrap();
        let off = (1.0 + STEEPEST_BESIDE + ACROSS) * error + 16.0 * f64::EPSILON * f64::abs(at);
        for lat in 0..2 {
            let pixels = off * window.scale(lat);
            assert!(pixels < 0.5 * SLACK, "{pixels} pixels at {at}, coordinates off by {error}");
            let middle = window.pixel(at, lat);
            assert!((200.0..300.0).contains(&middle), "{middle}, the pixel of the middle");
        }
    }
}

/// Pixels on either side of a rim are those whose points a range meets: the first on the inner side
/// begins at the rim, and the last on the outer side ends there. Ranges begin and end near the rim and
/// near borders of pixels.
#[test]
fn ranges_beside_a_rim_meet_the_pixels_of_their_side() {
    for inwards in [1.0, -1.0] {
        let rim = Rim { at: 0.25, inwards, exact: Some((0, 0.25)) };
        let window = Window::fit(&direction(1e-12), 1.0, [[-8.0, 8.0]; 2], [Some(rim), None]).unwrap();
        let inner = window.rims[0].unwrap().inner;
        let (border, size) = (if inwards > 0.0 { inner } else { inner + 1 }, window.pixel_size(0));
        let edge = |pixel: usize| {
            if pixel == border { 0.25 } else { window.ends[0][0] + pixel as f64 * size }
        };
        // The border between pixels is on the outer side of the rim, by 4 slacks.
        let off = (window.pixel(0.25, 0) - border as f64) * inwards;
        assert!((BESIDE - 1e-6..BESIDE + 1e-6).contains(&off), "{off} pixels from the border to the rim");
        let near = |at: f64| [-1e-3, -1e-10, 0.0, 1e-10, 1e-3, 0.5].map(|by| at + by * size);
        let ends: Vec<f64> = (border - 2..border + 3).flat_map(|pixel| near(edge(pixel))).collect();
        for (&low, &high) in ends.iter().flat_map(|low| ends.iter().map(move |high| (low, high))) {
            if low > high {
                continue;
            }
            let what = || alloc::format!("{low} to {high}, a rim at 0.25, inwards {inwards}");
            let is_inner = |pixel: usize| (pixel >= border) == (inwards > 0.0);
            let meets = |pixel: usize| low <= edge(pixel + 1) && edge(pixel) <= high;
            let bounds = |min: f32, max: f32| Aabb::new(Vec3::splat(min), Vec3::splat(max));
            let is_within = (low - 0.25).min(high - 0.25) >= -1e-11 && inwards > 0.0
                || (low - 0.25).max(high - 0.25) <= 1e-11 && inwards < 0.0;
            let is_beyond =
                (high - 0.25) <= 1e-11 && inwards > 0.0 || (low - 0.25) >= -1e-11 && inwards < 0.0;
            let found = |bounds: Aabb| window.pixels([[low, high], [0.0; 2]], &bounds).unwrap().x;
            let [first, last] = found(bounds(0.0, 1.0));
            for pixel in border - 3..border + 4 {
                let is_found = (first..=last).contains(&pixel);
                assert!(is_found || !meets(pixel), "{}: {pixel} of {first} to {last}", what());
            }
            if is_within {
                let [first, last] = found(if inwards > 0.0 { bounds(0.25, 1.0) } else { bounds(0.0, 0.25) });
                for pixel in border - 3..border + 4 {
                    let is_found = (first..=last).contains(&pixel);
                    let must = meets(pixel) && is_inner(pixel);
                    assert!(is_found || !must, "{} inside: {pixel} of {first} to {last}", what());
                    assert!(!is_found || is_inner(pixel), "{} inside: {pixel} is outside", what());
                }
            }
            if is_beyond {
                let range = window.clip_outwards(window.widened([low, high], 0), 0);
                let [first, last] = range.map(|at| at as usize);
                for pixel in border - 3..border + 4 {
                    let is_found = (first..=last).contains(&pixel);
                    let must = meets(pixel) && !is_inner(pixel);
                    assert!(is_found || !must, "{} outside: {pixel} of {range:?}", what());
                    assert!(!is_found || !is_inner(pixel), "{} outside: {pixel} is inside", what());
                }
                let [from, to] = [low, high].map(|at| window.pixel(at, 0));
                let [from, to] = window.clip_at_rim([from, to], 0);
                assert!(
                    from > to || !is_inner(from as usize) && !is_inner(to as usize),
                    "{}: filled",
                    what()
                );
            }
            let pixels = [low, high].map(|at| window.pixel(at, 0));
            let passes = if inwards > 0.0 { high > 0.25 + 0.01 * size } else { low < 0.25 - 0.01 * size };
            assert!(!passes || window.clip_at_rim(pixels, 0) == pixels, "{}: passes the rim", what());
        }
        // Points at the rim, and beyond it, are outside; others are not.
        let point = |x: f64| Vec3::splat((0.25 + x * inwards) as f32);
        let inside = |points: &[Vec3]| window.is_outside(points);
        assert_eq!(inside(&[point(0.0), point(-1.0)]), [true, false], "points at the rim and beyond");
        assert_eq!(inside(&[point(-1.0), point(0.125)]), [false; 2], "a point inside");
    }
}

/// Windows whose pixels would be wrong are refused: scales that are zero, infinite or NaN.
#[test]
fn windows_without_a_finite_scale_are_refused() {
    let fit = |error, ends| Window::fit(&direction(error), 1.0, [ends, [0.0, 1.0]], [None; 2]);
    assert!(fit(1e-9, [0.0, 1.0]).is_some(), "a window of a metre");
    let infinite = f64::INFINITY;
    // The ends of the third are finite, and their difference is not.
    for ends in [[0.0, infinite], [-infinite, 0.0], [-8.98e307, 8.98e307], [f64::NAN, 1.0]] {
        assert!(fit(1e-9, ends).is_none(), "a window from {ends:?}");
    }
    let point = Direction { half: [0.0; 2], ..direction(0.0) };
    let none = Window::fit(&point, 1.0, [[0.0; 2], [0.0, 1.0]], [None; 2]);
    assert!(none.is_none(), "a window without a width, in which nothing is off: {none:?}");
}

/// A rim is used if both pixels beside it are in the window, and the border between them is as far from
/// it as all ranges are widened. A rim beside the window changes nothing.
#[test]
fn rims_are_beside_borders_between_pixels_of_the_window() {
    let fit = |rim| Window::fit(&direction(1e-12), 1.0, [[-8.0, 8.0]; 2], [rim, None]).unwrap();
    let plain = fit(None);
    let [low, high] = plain.ends[0];
    let (pixel, mut used) = ((high - low) / (SIDE - 1) as f64, 0);
    for (inwards, from_low) in [(1.0, true), (1.0, false), (-1.0, true), (-1.0, false)] {
        for by in [-1e25, -700.0, -1.5, -1e-3, 1e-3, 3e-3, 5e-3, 0.5, 1.5, 255.5] {
            let at = if from_low { low + by * pixel } else { high - by * pixel };
            let window = fit(Some(Rim { at, inwards, exact: Some((0, 0.0)) }));
            let what = alloc::format!("{by} pixels, inwards {inwards}, from the low end: {from_low}");
            assert!(window.ends[0][0] <= -8.0 && window.ends[0][1] >= 8.0, "{what}: {:?}", window.ends);
            assert!(by > 0.0 || window.ends == plain.ends && window.rims == [None; 2], "{what}");
            let Some(rim) = window.rims[0] else { continue };
            used += 1;
            let (inner, inwards) = (rim.inner as f64, inwards as i64);
            let border = if inwards > 0 { inner } else { inner + 1.0 };
            let beside = (window.pixel(at, 0) - border) * rim.inwards;
            assert!((beside - BESIDE).abs() < 1e-6, "{what}: the border is {beside} pixels beside it");
            let outer = rim.inner as i64 - inwards;
            assert!(rim.inner < SIDE && (0..SIDE as i64).contains(&outer), "{what}: {rim:?}");
        }
    }
    assert!(used > 12, "{used} rims are used");
}

/// Ranges that end at the rim up to the slack end on its outer side.
#[test]
fn ranges_that_end_at_a_rim_up_to_the_slack_leave_the_pixel_within() {
    for inwards in [1.0, -1.0] {
        let rim = ExactRim { at: 0.0, inwards, exact: (0, 0.0), inner: 100 };
        let border = if inwards > 0.0 { 100.0 } else { 101.0 };
        for (by, is_cut) in [(-0.75, true), (0.75, true), (1.5, false)] {
            let end = border + inwards * (BESIDE + by * SLACK);
            let range = if inwards > 0.0 { [90.0, end] } else { [end, 110.0] };
            let [low, high] = rim.clip_at_rim(range);
            let is_outside = if inwards > 0.0 { high < border } else { low >= border };
            assert_eq!(is_outside, is_cut, "{range:?}, inwards {inwards}");
            assert!(is_cut || [low, high] == range, "{range:?} passes the rim, inwards {inwards}");
        }
    }
}

/// Ends of ranges are moved by the slack, and beside a rim also by the distance of its border.
#[test]
fn ranges_are_widened_by_the_slack_and_the_distance_of_a_border() {
    let rim = ExactRim { at: 0.0, inwards: 1.0, exact: (0, 0.0), inner: 100 };
    let window = Window { rims: [Some(rim), None], ..Window::unit() };
    let bounds = Aabb::new(Vec3::splat(-1.0), Vec3::ONE);
    for (off, is_met) in [(BESIDE + 0.75 * SLACK, true), (BESIDE + 1.5 * SLACK, false)] {
        let rect = window.pixels([[200.0 + off, 201.0 - off], [3.5, 4.5]], &bounds).unwrap();
        let expected = if is_met { [199, 201] } else { [200, 200] };
        assert_eq!(rect.x, expected, "a range that ends {off} from the borders of pixel 200");
    }
}

/// The least number of pixels that projections meet: that of a point at the least depth.
#[test]
fn projections_meet_at_least_the_pixels_of_a_point() {
    let direction = direction(1e-12);
    for (d, z, pixels) in [(1.0, 2.0, 256.0), (1.0, 4.0, 256.0), (1.0, 1.001, 256.0), (2.0, 9.0, 0.25)] {
        let window = Window::from_zero(d, [[0.0, SIDE as f64 / pixels]; 2]);
        let exact = (z - d) / z * pixels;
        let expected = if exact < 1.0 { 1 } else { exact as usize };
        assert_eq!(window.min_pixels(&direction, z), [expected; 2], "a plane at {d}, a point at {z}");
    }
}

/// Reprojection between windows with the same rim: a pixel on the inner side of the rim leads to pixels
/// on the inner side, and all pixels lead to those that rays through their points meet, the points of a
/// pixel beside the rim beginning or ending there. Rims that differ do not count.
#[test]
fn reprojected_pixels_stay_on_their_side_of_a_rim() {
    for inwards in [1.0, -1.0] {
        // The viewcell is on the inner side of the rim, and touches it.
        let at = -0.5 * inwards;
        let rim = |exact| Some(Rim { at, inwards, exact: Some((0, exact)) });
        let direction = direction(1e-12);
        let fit = |d, reach: f64, rim| Window::fit(&direction, d, [[-reach, reach]; 2], [rim, None]).unwrap();
        let from = fit(2.0, 5.0, rim(at));
        for (d, reach, other) in [(3.0, 7.0, at), (2.5, 40.0, at), (4.0, 3.0, 0.25)] {
            let window = fit(d, reach, rim(other));
            let ranges = window.reprojection(&direction, &from, 0);
            let side = |window: &Window| {
                let rim = window.rims[0].unwrap();
                (rim.inner, if inwards > 0.0 { rim.inner } else { rim.inner + 1 })
            };
            let ((inner, border), (from_inner, from_border)) = (side(&window), side(&from));
            let edge = |window: &Window, border: usize, pixel: usize| {
                let plain = window.ends[0][0] + pixel as f64 / window.scale[0];
                if pixel == border { at } else { plain }
            };
            for (i, range) in ranges.iter().enumerate() {
                let [first, last] = range.map(usize::from);
                let what = alloc::format!("pixel {i} at {d}: {range:?}, inwards {inwards}, {other}");
                let is_inner = if inwards > 0.0 { i >= inner } else { i <= inner };
                let is_same = other == at;
                if is_inner && is_same {
                    let is_kept = if inwards > 0.0 { first >= from_inner } else { last <= from_inner };
                    assert!(is_kept, "{what}: leaves the inner side");
                }
                let begin = edge(&window, border, i);
                let end = edge(&window, border, i + 1);
                for p in [begin, end] {
                    for (v, w) in [(-0.5, 0.0), (0.5, 0.0), (-0.5, 1.0), (0.5, 1.0)] {
                        let x = v + (p - v) * (2.0 + w) / (d + w);
                        // Pixels of the earlier window that hold the point, without those that end there.
                        let tiny = 1e-9;
                        let holds = |pixel: usize| {
                            edge(&from, from_border, pixel) < x - tiny
                                && x + tiny < edge(&from, from_border, pixel + 1)
                        };
                        if let Some(pixel) = (0..SIDE).find(|&pixel| holds(pixel)) {
                            assert!((first..=last).contains(&pixel), "{what}: {x} is in {pixel}");
                        }
                    }
                }
                // No pixel more than two beside those that are met.
                let low = [0.0, 1.0].map(|w| -0.5 + (begin + 0.5) * (2.0 + w) / (d + w));
                let least = from.pixel(low[0].min(low[1]), 0) - 2.0;
                assert!(first as f64 >= least.min((SIDE - 1) as f64).floor(), "{what}: begins too early");
            }
        }
    }
}

/// Most items begin at one height. The rim is there, and is exact if the viewcell does not cross it.
#[test]
fn a_rim_that_the_viewcell_touches_is_exact() {
    for (end, is_exact) in [(0.0, true), (1e-12, true), (-1e-12, false)] {
        for inwards in [1.0, -1.0] {
            let mut direction = direction(1e-9);
            direction.exact[0] = Some((0, if inwards > 0.0 { [end, 9.0] } else { [-9.0, -end] }));
            let item = |from: f32, to: f32| {
                let (from, to) = if inwards > 0.0 { (from, to) } else { (-to, -from) };
                let scene_bounds = Aabb::from_arrays([from, 0.0, 5.0], [to, 1.0, 6.0]);
                let bounds = direction.local_box(&scene_bounds);
                let id = visibility_core::Scene::new().insert(scene_bounds);
                Item { child: visibility_core::walk::Child::Object(id), bounds, scene_bounds }
            };
            let items = [item(0.0, 1.0), item(0.0, 2.0), item(0.0, 3.0), item(-1.0, 2.0)];
            let rim = Rim::of(&items, 0, &direction, &mut Vec::new()).unwrap();
            assert_eq!((rim.at, rim.inwards), (0.0, inwards), "the rim, where three items begin");
            assert_eq!(rim.exact, is_exact.then_some((0, 0.0)), "the viewcell ends at {end}");
        }
    }
}
