//! Tests of the item buffer with known pictures, watertight meshes and hostile input.

use crate::common::pixels;
use visibility_core::glam::{DMat4, DVec2, DVec3, DVec4, Vec3};
use visibility_core::{
    Pose, View,
    view::{Depth, Window},
};
use visibility_measure::{Comparison, ItemBuffer, MAX_SIDE, MeasureError, NONE};
use visibility_testing::Random;

/// Returns a triangle at depth z from corners in pixels.
fn flat(points: [[f32; 2]; 3], z: f32) -> [Vec3; 3] {
    points.map(|[x, y]| Vec3::new(x, y, z))
}

/// Returns the two triangles of an axis-aligned rectangle at depth z, in pixels.
fn rectangle(left: f32, top: f32, right: f32, bottom: f32, z: f32) -> [[Vec3; 3]; 2] {
    let (a, b, c, d) = ([left, top], [right, top], [right, bottom], [left, bottom]);
    [flat([a, b, c], z), flat([c, d, a], z)]
}

/// Returns the column and row of each pixel that shows a triangle, row by row.
fn covered(buffer: &ItemBuffer) -> Vec<(usize, usize)> {
    let width = buffer.width() as usize;
    (0..buffer.items().len()).filter(|&p| buffer.items()[p] != NONE).map(|p| (p % width, p / width)).collect()
}

#[test]
fn rectangles_cover_the_centers_inside_half_open() {
    let view = pixels(32.0, 16.0);
    let mut buffer = ItemBuffer::new(32, 16).unwrap();
    // The first rectangle runs from centre to centre: it covers the centres on its left and top sides, not
    // those on its right and bottom sides.
    for (sides, columns, rows) in [
        ([2.5, 3.5, 7.5, 6.5], 2..7, 3..6),
        ([2.51, 3.49, 7.51, 6.51], 3..8, 3..7),
        ([-9.0, -9.0, 99.0, 99.0], 0..32, 0..16),
        ([-900.0, 4.0, 900.0, 5.0], 0..32, 4..5),
        ([1.6, 1.6, 2.4, 9.0], 0..0, 0..0),
        ([31.0, 15.0, 32.0, 16.0], 31..32, 15..16),
    ] {
        let [a, b, c, d] = sides;
        let sampled = buffer.draw(&view, DVec3::ZERO, [(5, &rectangle(a, b, c, d, 0.5)[..])]).unwrap();
        let count = columns.len() * rows.len();
        assert_eq!(sampled.covered_pixels() as usize, count, "{sides:?}");
        assert_eq!(sampled.visible_objects(), u32::from(count > 0), "{sides:?}: objects visible");
        let expected: Vec<_> = rows.flat_map(|y| columns.clone().map(move |x| (x, y))).collect();
        assert_eq!(covered(&buffer), expected, "{sides:?}");
    }
}

#[test]
fn a_triangle_covers_the_centers_below_its_diagonal() {
    let view = pixels(20.0, 20.0);
    let mut buffer = ItemBuffer::new(20, 20).unwrap();
    // Centres with x + y < 10 are inside. Centres with x + y = 10 lie on the right edge, which does not
    // belong to the triangle.
    let triangle = [flat([[0.0, 0.0], [10.0, 0.0], [0.0, 10.0]], 0.5)];
    let sampled = buffer.draw(&view, DVec3::ZERO, [(0, &triangle[..])]).unwrap();
    assert_eq!(sampled.triangle_pixels(), [(0, 45)], "pixels left of the diagonal");
    // The mirrored triangle has its diagonal on the left and covers the centres on it.
    let triangle = [flat([[10.0, 10.0], [10.0, 0.0], [0.0, 10.0]], 0.5)];
    let sampled = buffer.draw(&view, DVec3::ZERO, [(0, &triangle[..])]).unwrap();
    assert_eq!(sampled.triangle_pixels(), [(0, 55)], "pixels right of the diagonal, with those on it");
}

#[test]
fn the_nearest_wins_and_the_image_shows_the_first_of_ties() {
    let view = pixels(8.0, 8.0);
    let mut buffer = ItemBuffer::new(8, 8).unwrap();
    let wall = rectangle(0.0, 0.0, 8.0, 8.0, 0.5);
    let near = rectangle(2.0, 2.0, 4.0, 4.0, 0.25);
    // The wall with its corners in another order is equally near to the last bit.
    let turned = wall.map(|[a, b, c]| [c, a, b]);
    let sampled =
        buffer.draw(&view, DVec3::ZERO, [(9, &turned[..]), (8, &near[..]), (7, &wall[..])]).unwrap();
    let seen: Vec<_> =
        sampled.objects().iter().map(|o| (o.key, o.pixels, o.tied_pixels, o.visible_triangles)).collect();
    assert_eq!(
        seen,
        [(9, 0, 60, 2), (8, 4, 0, 2), (7, 0, 60, 0)],
        "key, pixels, ties and visible triangles by object"
    );
    assert_eq!(buffer.object_at(2, 3), Some(1), "the object at a pixel of the near one");
    assert_eq!(
        (buffer.object_at(0, 0), buffer.object_at(8, 0), buffer.object_at(0, 8)),
        (Some(0), None, None),
        "the object at a corner, and beyond the picture"
    );
    // Tilted walls with reversed corners: the first drawn wins again.
    let tilted = wall.map(|t| t.map(|p| p.with_z(0.1 + p.x * 0.037 + p.y * 0.013)));
    let reversed = tilted.map(|[a, b, c]| [c, b, a]);
    let sampled = buffer.draw(&view, DVec3::ZERO, [(1, &reversed[..]), (2, &tilted[..])]).unwrap();
    assert_eq!(
        sampled.objects().iter().map(|o| o.visible_triangles).collect::<Vec<_>>(),
        [2, 0],
        "of two equal walls the first is seen"
    );
}

/// Returns for each pixel how often it is covered if every triangle is drawn separately.
fn coverage(buffer: &mut ItemBuffer, view: &View, triangles: &[[Vec3; 3]]) -> Vec<u32> {
    let mut counts = vec![0; buffer.items().len()];
    for triangle in triangles {
        buffer.draw(view, DVec3::ZERO, [(0, core::slice::from_ref(triangle))]).unwrap();
        for (count, &item) in counts.iter_mut().zip(buffer.items()) {
            *count += u32::from(item != NONE);
        }
    }
    counts
}

#[test]
fn fans_cover_each_center_once() {
    let mut random = Random(1);
    let size = 48.0;
    let view = pixels(size, size);
    let mut buffer = ItemBuffer::new(48, 48).unwrap();
    for round in 0..60 {
        // The fan's centre is anywhere, on a pixel centre, or on a pixel corner. The spokes end on a ring
        // outside of the image, in some rounds far outside.
        let snap = |v: f64| if round % 2 == 0 { v } else { (v * 2.0).round() / 2.0 };
        let hub = [snap(random.range(0.0, size)), snap(random.range(0.0, size))].map(|v| v as f32);
        let reach = [80.0, 1e5, 1e20][round % 3];
        // At least five spokes, so that no side of the ring comes within 80 pixels of the fan's centre.
        let count = 5 + round % 12;
        let ring: Vec<[f32; 2]> = (0..count)
            .map(|i| {
                let angle = (i as f64 + random.range(-0.3, 0.3)) / count as f64 * core::f64::consts::TAU;
                [angle.cos(), angle.sin()].map(|v| (v * 3.0 * reach) as f32)
            })
            .map(|[x, y]| [hub[0] + x, hub[1] + y])
            .collect();
        let fan: Vec<_> = (0..count)
            .map(|i| {
                let (a, b) = (ring[i], ring[(i + 1) % count]);
                // Corners in a random order.
                let points = [[hub, a, b], [a, hub, b], [b, a, hub]][(random.unit() * 3.0) as usize];
                flat(points, 0.5)
            })
            .collect();
        let counts = coverage(&mut buffer, &view, &fan);
        assert!(counts.iter().all(|&c| c == 1), "round {round}: hub {hub:?}, {count} spokes");
        // Each pixel must show the triangle between whose spokes it lies.
        buffer.draw(&view, DVec3::ZERO, [(0, &fan[..])]).unwrap();
        for (pixel, &item) in buffer.items().iter().enumerate() {
            let center = DVec2::new((pixel % 48) as f64 + 0.5, (pixel / 48) as f64 + 0.5);
            let side = |spoke: usize| {
                let [hub, end] = [hub, ring[spoke % count]].map(|p| DVec2::new(p[0].into(), p[1].into()));
                (end - hub).normalize().perp_dot(center - hub)
            };
            let spoke = item as usize;
            assert!(side(spoke) > -1e-9 && side(spoke + 1) < 1e-9, "round {round}: pixel {pixel} by {item}");
        }
    }
}

#[test]
fn a_perspective_mesh_through_the_near_plane_covers_each_center_once() {
    let mut random = Random(7);
    let mut buffer = ItemBuffer::new(64, 48).unwrap();
    for round in 0..10 {
        // A floor of uneven quads that extends from far behind the eye to far beyond it.
        let n = 12;
        let mut grid = Vec::new();
        for i in 0..=n {
            for j in 0..=n {
                let at = |k: usize, r: f64| ((k as f64 - 5.7 + r) * 9.0) as f32;
                grid.push(Vec3::new(at(i, random.range(-0.3, 0.3)), at(j, random.range(-0.3, 0.3)), -1.0));
            }
        }
        let at = |i: usize, j: usize| grid[i * (n + 1) + j];
        let cells = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
        let floor: Vec<_> = cells
            .flat_map(|(i, j)| {
                let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                [[a, b, c], [d, a, c]]
            })
            .collect();
        let eye = DVec3::new(random.range(-3.0, 3.0), random.range(-3.0, 3.0), random.range(-0.9, 1.0));
        let pose = Pose::look_at(eye, eye + DVec3::new(1.0, random.range(-1.0, 1.0), -2.0), DVec3::Z);
        // The near plane cuts into the floor if the eye is low.
        let near = if round % 2 == 0 { 0.001 } else { 0.3 };
        let view = View::perspective(pose, 1.0, 4.0 / 3.0, near, f64::INFINITY).unwrap();
        let counts = coverage(&mut buffer, &view, &floor);
        assert!(counts.iter().all(|&c| c <= 1), "round {round}");
        let bare = counts.iter().filter(|&&c| c == 0).count();
        assert!(near > 0.1 || bare == 0, "round {round}: {bare} of {} bare", counts.len());
    }
}

#[test]
fn only_the_difference_of_origins_counts() {
    let triangle = [flat([[0.0, 0.0], [10.0, 0.0], [0.0, 10.0]], 0.5)];
    let mut buffer = ItemBuffer::new(20, 20).unwrap();
    let far = DVec3::new(1e9, -3e9, 7.0);
    let view = pixels(20.0, 20.0).relative_to(far).unwrap();
    assert_eq!(
        buffer.draw(&view, far, [(0, &triangle[..])]).unwrap().covered_pixels(),
        45,
        "pixels with view and scene far from the origin"
    );
    let beside = far - DVec3::new(8.0, 0.0, 0.0);
    let pixels = buffer.draw(&view, beside, [(0, &triangle[..])]).unwrap().covered_pixels();
    assert_eq!(pixels, 1, "shifted left by 8, only (8, 0) is left of the ten columns");
}

#[test]
fn wrong_pixels_are_those_that_drawing_the_reported_objects_alone_changes() {
    let mut random = Random(3);
    let view = pixels(64.0, 64.0);
    let (mut full, mut partial) = (ItemBuffer::new(64, 64).unwrap(), ItemBuffer::new(64, 64).unwrap());
    for round in 0..30 {
        let objects: Vec<(u32, Vec<[Vec3; 3]>)> = (0..20)
            .map(|key| {
                let center = random.vector(32.0) + DVec3::splat(32.0);
                let corner = |r: &mut Random| (center + r.vector(14.0)).as_vec3().with_z(r.unit() as f32);
                (key, (0..5).map(|_| core::array::from_fn(|_| corner(&mut random))).collect())
            })
            .collect();
        full.draw(&view, DVec3::ZERO, objects.iter().map(|(k, t)| (*k, &t[..]))).unwrap();
        let reported: Vec<bool> = objects.iter().map(|_| random.unit() < 0.7).collect();
        // Replaces the triangles of omitted objects by NaN triangles, which cover no pixel, so that triangle
        // numbers stay the same.
        let nothing = [[Vec3::NAN; 3]; 5];
        let kept =
            objects.iter().map(|(k, t)| (*k, if reported[*k as usize] { &t[..] } else { &nothing[..] }));
        partial.draw(&view, DVec3::ZERO, kept).unwrap();
        let changed = full.items().iter().zip(partial.items()).filter(|(a, b)| a != b).count();
        let mut comparison = Comparison::default();
        full.visible().compare(|index, _| reported[index], &mut comparison);
        assert_eq!(comparison.wrong_pixels as usize, changed, "round {round}");
        assert!(changed > 0, "round {round}: no pixel is wrong");
    }
}

#[test]
fn sizes_are_checked() {
    for (width, height) in [(0, 1), (1, 0), (MAX_SIDE + 1, 1), (1, u32::MAX)] {
        assert_eq!(
            ItemBuffer::new(width, height).err(),
            Some(MeasureError::Size { width, height }),
            "a picture of {width} by {height}"
        );
    }
    assert!(
        ItemBuffer::new(MAX_SIDE, 1).is_ok() && ItemBuffer::new(1, 1).is_ok(),
        "the largest width, and a single pixel"
    );
    fn is_send<T: Send>(_: &T) {}
    is_send(&ItemBuffer::new(1, 1).unwrap());
}

#[test]
fn hostile_triangles_cover_nothing_and_break_nothing() {
    let mut random = Random(11);
    let mut buffer = ItemBuffer::new(40, 30).unwrap();
    let pose = Pose::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(2.0, 2.5, 3.1), DVec3::Z);
    let views = [
        View::perspective(pose, 1.0, 4.0 / 3.0, 0.1, f64::INFINITY).unwrap(),
        View::perspective(pose, 1.0, 4.0 / 3.0, 1e-30, 1e30).unwrap(),
        View::orthographic(pose, Window::centered(4.0, 3.0), -10.0, 10.0).unwrap(),
        pixels(40.0, 30.0),
        // A finite matrix, for which products overflow.
        View::from_clip_from_world(DMat4::from_diagonal(DVec4::splat(1e300)), Depth::ZeroToOne).unwrap(),
        // A matrix without a near plane in front of the eye: w may be zero together with all other
        // coordinates.
        View::from_clip_from_world(
            DMat4::from_cols(DVec4::X, DVec4::Y, DVec4::new(0.0, 0.0, 1.0, 1.0), DVec4::Z * 1e-30),
            Depth::ZeroToOne,
        )
        .unwrap(),
    ];
    let eye = pose.eye.as_vec3();
    let special = [
        0.0,
        -0.0,
        1.0,
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        1e30,
        -1e30,
        f32::MAX,
        f32::MIN,
        1e-45,
        1e-30,
    ];
    let not_finite = |t: &[Vec3; 3]| t.iter().any(|p| !p.is_finite());
    for _ in 0..4000 {
        let coordinate = |r: &mut Random| match (r.unit() * 4.0) as usize {
            0 => r.range(-5.0, 5.0) as f32,
            _ => special[(r.unit() * special.len() as f64) as usize],
        };
        let mut triangle: [Vec3; 3] =
            core::array::from_fn(|_| Vec3::from_array(core::array::from_fn(|_| coordinate(&mut random))));
        match (random.unit() * 5.0) as usize {
            0 => triangle[1] = eye,
            1 => triangle[2] = triangle[0],
            2 => triangle[2] = (triangle[0] + triangle[1]) * 0.5,
            _ => {}
        }
        for view in &views {
            let sampled = buffer.draw(view, DVec3::ZERO, [(0, core::slice::from_ref(&triangle))]).unwrap();
            assert!(sampled.covered_pixels() == 0 || !not_finite(&triangle), "{triangle:?}");
            assert!(sampled.covered_pixels() == 0 || triangle[0] != triangle[2], "{triangle:?}");
        }
    }
}

#[test]
fn walls_of_any_size_fill_the_image() {
    let mut buffer = ItemBuffer::new(40, 30).unwrap();
    let mut pixels = |direction: DVec3, size: f32, lateral: f32| {
        let pose = Pose::look_at(DVec3::ZERO, direction, DVec3::Z);
        let view = View::perspective(pose, 1.0, 4.0 / 3.0, 0.1, f64::INFINITY).unwrap();
        let wall =
            [Vec3::new(9.0, -size, -size), Vec3::new(9.0, size, -size), Vec3::new(9.0, lateral * size, size)];
        buffer.draw(&view, DVec3::ZERO, [(0, &[wall][..])]).unwrap().covered_pixels()
    };
    for size in [1e3, 1e6, 1e12, 1e20, 1e30, 3e38] {
        for lateral in [0.0, 0.3, -0.4] {
            assert_eq!(pixels(DVec3::X, size, lateral), 40 * 30, "{size} {lateral}");
            // In an oblique view, corners farther than 1e15 m are rounded by more than the 9 m to the wall.
            let askew = pixels(DVec3::new(1.0, 0.3, 0.2), size, lateral);
            assert!(askew == 40 * 30 || size > 1e13, "{size} {lateral}: {askew}");
        }
    }
}
