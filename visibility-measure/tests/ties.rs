//! Tests of ties: if two objects tie for a pixel, a culler that reports one of them makes no error.

use crate::common::pixels;
use visibility_core::glam::{DMat4, DVec3, DVec4, Vec3};
use visibility_core::{Pose, View, view::Depth};
use visibility_measure::{Comparison, ItemBuffer};

/// Returns a box with two sides parallel to the vertical plane through the origin and `along`. It spans
/// `near` to `far` along that horizontal direction, `right` to `left` across it, both in units of the length
/// of `along`, and -`height` to `height` vertically, in metres.
fn slab(along: [f32; 2], near: f32, far: f32, right: f32, left: f32, height: f32) -> Vec<[Vec3; 3]> {
    let [x, y] = along;
    let at = |t: f32, s: f32, z: f32| Vec3::new(t * x - s * y, t * y + s * x, z);
    let corner = |i: usize| at([near, far][i & 1], [right, left][i >> 1 & 1], [-height, height][i >> 2]);
    let faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let triangles = |[a, b, c, d]: [usize; 4]| [[a, b, c], [a, c, d]].map(|t| t.map(corner));
    faces.into_iter().flat_map(triangles).collect()
}

/// Draws the objects, with their indices as keys, and compares with a culler that reports the keys
/// `reported`.
fn judge(buffer: &mut ItemBuffer, view: &View, objects: &[&[[Vec3; 3]]], reported: &[u32]) -> Comparison {
    let objects = (0..).zip(objects).map(|(key, triangles)| (key, *triangles));
    let sampled = buffer.draw(view, DVec3::ZERO, objects).unwrap();
    let mut comparison = Comparison::default();
    sampled.compare(|_, key| reported.contains(&key), &mut comparison);
    comparison
}

/// Returns a view from the origin along a horizontal direction. The vertical plane through that direction
/// passes through pixel centres of a square image with an odd number of columns: the middle column or, with
/// the camera rolled by 45 degrees, a diagonal.
fn along(direction: [f32; 2], rolled: bool) -> View {
    let [x, y] = direction.map(f64::from);
    let across = DVec3::new(-y, x, 0.0).normalize();
    let up = if rolled { DVec3::Z + across } else { DVec3::Z };
    let pose = Pose::look_at(DVec3::ZERO, DVec3::new(x, y, 0.0), up);
    View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap()
}

/// Two boxes, one behind the other, with coplanar sides in a plane through the eye. The plane passes through
/// pixel centres, which rounding assigns to one box, to the other, or to neither. The rear box is hidden, and
/// hiding it is never an error.
#[test]
fn an_edge_behind_an_edge_is_no_error() {
    let mut buffer = ItemBuffer::new(63, 63).unwrap();
    let mut ties = 0;
    for i in 1..40u8 {
        for j in 1..40u8 {
            let direction = [f32::from(i), f32::from(j)];
            for (touching, rolled) in [(false, false), (false, true), (true, false), (true, true)] {
                let front = slab(direction, 3.0, 4.0, 0.0, 1.0, 1.0);
                let behind = slab(direction, if touching { 4.0 } else { 5.0 }, 6.0, 0.0, 0.5, 0.5);
                let comparison = judge(&mut buffer, &along(direction, rolled), &[&front, &behind], &[0]);
                assert!(comparison.is_exact(), "{direction:?}, touching: {touching}: {comparison:?}");
                assert_eq!(comparison.wrong_pixels, 0, "{direction:?}, touching: {touching}: wrong pixels");
                assert!(
                    comparison.tied_pixels == 0 || comparison.tied_hidden_objects == 1,
                    "{direction:?}, touching: {touching}: {comparison:?}"
                );
                ties += usize::from(comparison.tied_pixels > 0);
            }
        }
    }
    assert!(ties > 20, "{ties} pictures show the box behind");
}

/// Two boxes, one behind the other. The rear box protrudes by a ten-thousandth of its width: it is visible,
/// and hiding it is an error.
#[test]
fn an_edge_beyond_an_edge_is_an_error() {
    let mut buffer = ItemBuffer::new(63, 63).unwrap();
    for i in 1..10u8 {
        let direction = [f32::from(i), 3.0];
        let front = slab(direction, 3.0, 4.0, 1e-4, 1.0, 1.0);
        let behind = slab(direction, 5.0, 6.0, -1e-4, 0.5, 0.5);
        let comparison = judge(&mut buffer, &along(direction, false), &[&front, &behind], &[0]);
        assert_eq!(comparison.false_hidden_keys, [1], "{direction:?}: the box beyond the edge is missed");
        assert!(comparison.wrong_pixels > 0 && comparison.tied_pixels == 0, "{comparison:?}");
    }
}

/// Two walls side by side in front of a third. The left wall has two parts; where a corner of a part lies on
/// an edge of the right wall, rounding leaves cracks. Hiding the third wall is never an error.
#[test]
fn a_crack_between_two_walls_shows_nothing_behind_them() {
    let mut buffer = ItemBuffer::new(63, 63).unwrap();
    let mut cracks = 0;
    for i in 1..40u8 {
        for j in 1..40u8 {
            let direction = [f32::from(i), f32::from(j)];
            let quad = |t: f32, [s0, s1]: [f32; 2], [z0, z1]: [f32; 2]| {
                let [x, y] = direction;
                let at = |s: f32, z: f32| Vec3::new(t * x - s * y, t * y + s * x, z);
                [[at(s0, z0), at(s1, z0), at(s1, z1)], [at(s0, z0), at(s1, z1), at(s0, z1)]]
            };
            let left: Vec<_> =
                [[-2.0, 0.3], [0.3, 2.0]].iter().flat_map(|&z| quad(3.0, [0.0, 2.0], z)).collect();
            let right = quad(3.0, [-2.0, 0.0], [-2.0, 2.0]);
            let behind = quad(7.0, [-1.0, 1.0], [-1.0, 1.0]);
            let comparison = judge(&mut buffer, &along(direction, true), &[&left, &right, &behind], &[0, 1]);
            assert!(comparison.is_exact(), "{direction:?}: {comparison:?}");
            cracks += usize::from(comparison.tied_hidden_objects > 0);
        }
    }
    assert!(cracks > 0, "pictures in which what is behind ties with a crack: {cracks}");
}

/// Returns the two triangles of an axis-aligned rectangle at depth z, in pixels.
fn rectangle(left: f32, top: f32, right: f32, bottom: f32, z: f32) -> [[Vec3; 3]; 2] {
    let [a, b, c, d] =
        [[left, top], [right, top], [right, bottom], [left, bottom]].map(|[x, y]| Vec3::new(x, y, z));
    [[a, b, c], [c, d, a]]
}

/// An edge through pixel centres counts for the objects on both sides, in any direction.
#[test]
fn an_edge_between_two_objects_counts_for_both() {
    let mut buffer = ItemBuffer::new(8, 8).unwrap();
    let view = pixels(8.0, 8.0);
    let [a, b, c, d] = [[0.0, 0.0], [8.0, 0.0], [8.0, 8.0], [0.0, 8.0]].map(|[x, y]| Vec3::new(x, y, 0.5));
    for (one, other, tied) in [
        (&rectangle(0.0, 0.0, 4.5, 8.0, 0.5)[..], &rectangle(4.5, 0.0, 8.0, 8.0, 0.5)[..], 8),
        (&rectangle(0.0, 0.0, 8.0, 4.5, 0.5), &rectangle(0.0, 4.5, 8.0, 8.0, 0.5), 8),
        (&[[a, b, c]], &[[a, c, d]], 8),
        (&[[b, a, d]], &[[b, c, d]], 8),
        // An edge with a slope of one row in seven columns, through the single centre at (4.5, 3.5).
        (
            &[[a, Vec3::new(8.0, 3.0, 0.5), Vec3::new(1.0, 4.0, 0.5)]],
            &[[Vec3::new(8.0, 3.0, 0.5), Vec3::new(1.0, 4.0, 0.5), c]],
            1,
        ),
        (&rectangle(0.0, 0.0, 4.0, 8.0, 0.5), &rectangle(4.0, 0.0, 8.0, 8.0, 0.5), 0),
    ] {
        for objects in [[one, other], [other, one]] {
            let found = judge(&mut buffer, &view, &objects, &[0, 1]);
            let sampled = buffer.visible();
            assert_eq!(sampled.tied_pixels(), tied, "{objects:?}");
            assert!(sampled.objects().iter().all(|object| object.tied_pixels == tied), "{objects:?}");
            let alone: u32 = sampled.objects().iter().map(|object| object.pixels).sum();
            assert_eq!(alone + tied, sampled.covered_pixels(), "{objects:?}: pixels of one object, and ties");
            assert!(found.is_exact(), "{objects:?}: {found:?}");
        }
    }
}

/// At a pixel centre where the corners of four objects meet, all four objects tie.
#[test]
fn a_corner_between_four_objects_counts_for_all() {
    let mut buffer = ItemBuffer::new(9, 9).unwrap();
    let quarters = [
        rectangle(0.0, 0.0, 4.5, 4.5, 0.5),
        rectangle(4.5, 0.0, 9.0, 4.5, 0.5),
        rectangle(0.0, 4.5, 4.5, 9.0, 0.5),
        rectangle(4.5, 4.5, 9.0, 9.0, 0.5),
    ];
    let quarters = quarters.each_ref().map(|quarter| &quarter[..]);
    let comparison = judge(&mut buffer, &pixels(9.0, 9.0), &quarters, &[0, 1, 2, 3]);
    assert!(comparison.is_exact(), "all four are reported: {comparison:?}");
    let sampled = buffer.visible();
    assert_eq!(
        (sampled.tied_pixels(), sampled.covered_pixels()),
        (17, 81),
        "ties along the cross, and covered pixels"
    );
    assert!(
        sampled.objects().iter().all(|object| (object.pixels, object.tied_pixels) == (16, 9)),
        "pixels and ties of each quarter"
    );
}

/// Two walls in one plane are both visible. Hiding one of them is no error, hiding both is one error.
#[test]
fn walls_in_one_plane_are_both_visible() {
    let mut buffer = ItemBuffer::new(8, 8).unwrap();
    let perspective =
        View::perspective(Pose::look_at(DVec3::ZERO, DVec3::Z, DVec3::Y), 1.0, 1.0, 0.1, f64::INFINITY)
            .unwrap();
    for (view, depth, size) in [(pixels(8.0, 8.0), 0.5, 8.0), (perspective, 1e6, 1e7)] {
        let wall = rectangle(-size, -size, size, size, depth);
        let turned = wall.map(|[a, b, c]| [c, a, b]);
        let nearer = wall.map(|t| t.map(|p| p.with_z(depth * (1.0 - 1e-6))));
        let mut with = |reported: &[u32]| judge(&mut buffer, &view, &[&wall, &turned], reported);
        assert!(with(&[0, 1]).is_exact(), "{depth}: both walls are reported");
        for reported in [[0], [1]] {
            let one = with(&reported);
            assert!(one.is_exact(), "{depth}: {one:?}");
            assert_eq!(
                (one.tied_hidden_objects, one.wrong_pixels),
                (1, 0),
                "{depth}: the other wall ties everywhere"
            );
            assert_eq!(
                one.tied_pixels,
                if reported == [0] { 0 } else { 64 },
                "{depth}: ties if {reported:?} is reported"
            );
        }
        let none = with(&[]);
        assert_eq!(
            (none.false_hidden_objects, none.wrong_pixels, none.tied_hidden_objects),
            (1, 64, 1),
            "{depth}: no wall is reported"
        );
        assert_eq!(none.false_hidden_keys, [0], "the one that the image shows");
        // A wall nearer by a millionth takes all pixels from both walls, in any drawing order.
        for objects in [[&wall[..], &turned, &nearer], [&nearer, &wall, &turned]] {
            let nearest = objects.iter().position(|object| *object == nearer).unwrap() as u32;
            let all = judge(&mut buffer, &view, &objects, &[0, 1, 2]);
            assert_eq!(
                (all.false_visible_objects, buffer.visible().tied_pixels()),
                (2, 0),
                "{depth}: two walls behind a nearer one"
            );
            assert_eq!(
                buffer.visible().objects()[nearest as usize].pixels,
                64,
                "{depth}: pixels of the nearer wall"
            );
        }
    }
}

/// Two coincident walls at depth zero of a parallel view, where rounding is as large as elsewhere although
/// depth itself is almost zero: both are visible.
#[test]
fn walls_at_depth_zero_of_a_parallel_view_are_both_visible() {
    let mut buffer = ItemBuffer::new(8, 8).unwrap();
    for i in 1..20u8 {
        let direction = DVec3::new(f64::from(i), 7.0, 0.0).normalize();
        let rows = [direction.cross(DVec3::Z), DVec3::Z, direction].map(|row| row.extend(0.0) / 100.0);
        let matrix = DMat4::from_cols(rows[0], rows[1], rows[2], DVec4::W).transpose();
        let view = View::from_clip_from_world(matrix, Depth::NegativeOneToOne).unwrap();
        let wall = |s: f32| {
            let at = |s: f32, z: f32| Vec3::new(7.0 * s, -f32::from(i) * s, z);
            [[at(-s, -300.0), at(s, -200.0), at(s, 400.0)], [at(-s, -300.0), at(s, 400.0), at(-s, 500.0)]]
        };
        let (one, other) = (wall(30.0), wall(47.0));
        let comparison = judge(&mut buffer, &view, &[&one, &other], &[0, 1]);
        assert!(comparison.is_exact(), "{direction}: {comparison:?}");
        assert_eq!(buffer.visible().tied_pixels(), 64, "{direction}");
    }
}

/// A buffer with so many coincident walls that it stops recording ties must record the ties of the next
/// frame.
#[test]
fn a_frame_full_of_ties_leaves_the_next_frame_its_ties() {
    let mut buffer = ItemBuffer::new(8, 8).unwrap();
    let wall = rectangle(0.0, 0.0, 8.0, 8.0, 0.5);
    judge(&mut buffer, &pixels(8.0, 8.0), &[&wall[..]; 5000], &[0]);
    let comparison = judge(&mut buffer, &pixels(8.0, 8.0), &[&wall[..]; 2], &[0, 1]);
    assert!(comparison.is_exact() && buffer.visible().tied_pixels() == 64, "{comparison:?}");
}
