//! Tests of the box limit in scenes where it is known, and against boxes drawn as triangles, or boxes met by
//! points along rays of a camera without a matrix.

use crate::common::pixels;
use crate::rays::{Camera, camera};
use visibility_core::geometry::Plane;
use visibility_core::glam::{DMat4, DVec3, DVec4, Vec3};
use visibility_core::view::{Depth, Window};
use visibility_core::{Aabb, Object, Pose, Scene, View};
use visibility_measure::ItemBuffer;
use visibility_testing::Random;

/// Returns the two triangles of a rectangle in world coordinates of [`pixels`], at depth `z`.
fn rectangle(x: [f32; 2], y: [f32; 2], z: f32) -> [[Vec3; 3]; 2] {
    let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| Vec3::new(x[i], y[j], z));
    [[a, b, c], [a, c, d]]
}

/// Returns the 12 triangles of a box.
fn triangles(bounds: &Aabb) -> Vec<[Vec3; 3]> {
    let c = |i: usize| {
        let of = |axis: usize| [bounds.min, bounds.max][i >> axis & 1][axis];
        Vec3::new(of(0), of(1), of(2))
    };
    let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    faces.iter().flat_map(|&[a, b, d, e]| [[c(a), c(b), c(d)], [c(a), c(d), c(e)]]).collect()
}

/// Returns for each box whether it is in the box limit behind the surfaces of an image of 12 x 9 pixels.
fn limit(view: &View, surfaces: &[[Vec3; 3]], boxes: &[Aabb]) -> Vec<bool> {
    let mut buffer = ItemBuffer::new(12, 9).unwrap();
    buffer.draw(view, DVec3::ZERO, [(0, surfaces)]).unwrap();
    in_limit(&buffer, boxes)
}

/// Returns for each box whether it is in the box limit behind the surfaces of a buffer.
fn in_limit(buffer: &ItemBuffer, boxes: &[Aabb]) -> Vec<bool> {
    let mut scene = Scene::new();
    let ids = scene.insert_batch(boxes.iter().copied().map(Object::new));
    let within: Vec<_> = buffer.box_limit(&scene, |_| false).collect();
    ids.iter().map(|id| within.contains(id)).collect()
}

/// Makes a box over the pixels `x` and `y`, half-open, from depth 0.5 to 0.75.
fn block(x: [f32; 2], y: [f32; 2]) -> Aabb {
    Aabb::from_arrays([x[0], y[0], 0.5], [x[1], y[1], 0.75])
}

#[test]
fn a_wall_hides_the_box_that_it_covers_to_the_pixel() {
    let view = pixels(12.0, 9.0);
    let wall = rectangle([3.0, 8.0], [2.0, 6.0], 0.4);
    let boxes = [
        block([3.0, 8.0], [2.0, 6.0]),
        block([2.0, 8.0], [2.0, 6.0]),
        block([3.0, 9.0], [2.0, 6.0]),
        block([3.0, 8.0], [1.0, 6.0]),
        block([3.0, 8.0], [2.0, 7.0]),
        // Half a column wider than the wall: the outline only touches the centres of a column.
        block([2.5, 8.5], [1.5, 6.5]),
        block([2.499, 8.0], [2.0, 6.0]),
        block([3.0, 8.501], [2.0, 6.0]),
    ];
    let expected = [false, true, true, true, true, false, true, true];
    assert_eq!(limit(&view, &wall, &boxes), expected, "boxes behind a wall, to the pixel");
}

#[test]
fn a_wall_whose_outline_meets_centers_hides_a_box_of_the_same_outline() {
    // Rounding and the edge rule decide whether the wall covers these centres.
    let view = pixels(12.0, 9.0);
    let wall = rectangle([2.5, 8.5], [1.5, 6.5], 0.4);
    assert_eq!(limit(&view, &wall, &[block([2.5, 8.5], [1.5, 6.5])]), [false], "a box of the wall's outline");
}

/// A view rotated by 45 degrees, with the world's origin at the centre of a pixel. An edge of a small box
/// passes the centre closer than a millionth of a column and row, or farther away.
#[test]
fn a_centre_at_an_outline_is_not_met() {
    let h = 0.5f64.sqrt();
    let turned = DMat4::from_cols(
        DVec4::new(h, h, 0.0, 0.0),
        DVec4::new(-h, h, 0.0, 0.0),
        DVec4::Z,
        DVec4::new(5.5, 4.5, 0.0, 1.0),
    );
    let view =
        View::from_clip_from_world(pixels(12.0, 9.0).clip_from(DVec3::ZERO) * turned, Depth::ZeroToOne);
    let far = |axis: usize, sign: f32, edge: f32| {
        let [mut min, mut max] = [Vec3::new(-0.3, -0.3, 0.5), Vec3::new(0.3, 0.3, 0.75)];
        if sign > 0.0 {
            max[axis] = edge
        } else {
            min[axis] = -edge
        }
        Aabb::new(min, max)
    };
    let sides = [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)];
    for (edge, is_met) in [(0.0, false), (7e-7, false), (2e-6, true), (0.2, true)] {
        let boxes = sides.map(|(axis, sign)| far(axis, sign, edge));
        assert_eq!(limit(&view.unwrap(), &[], &boxes), [is_met; 4], "{edge}");
    }
}

/// Cameras in any direction, for which a wall and the coplanar side of a box are rounded differently.
#[test]
fn a_box_flush_with_a_wall_is_free_from_everywhere() {
    let mut random = Random(23);
    let wall = [(-90.0, -90.0), (90.0, -90.0), (0.0, 90.0)].map(|(x, y)| Vec3::new(x, y, 4.7));
    for round in 0..300 {
        let eye = DVec3::new(random.range(-3.0, 3.0), random.range(-3.0, 3.0), random.range(-3.0, 3.0));
        let target = DVec3::new(random.range(-1.0, 1.0), random.range(-1.0, 1.0), 4.7);
        let pose = Pose::look_at(eye, target, DVec3::Y);
        let window = Window::centered(6.0, 5.0);
        let view = match round % 3 {
            0 => View::perspective(pose, 1.0, 4.0 / 3.0, 0.1, f64::INFINITY),
            1 => View::orthographic(pose, window, -5.0, 50.0),
            _ => {
                // The clip depth of the whole wall is 0 up to rounding.
                let pose = Pose::look_at(eye, DVec3::new(eye.x, eye.y, 9.0), DVec3::Y);
                let far = 2.0 * (f64::from(4.7f32) - eye.z) + 5.0;
                let camera = Camera { pose, window, near: -5.0, far, parallel: true };
                let depth = Depth::NegativeOneToOne;
                View::from_clip_from_world(camera.matrix(depth), depth).and_then(|v| v.relative_to(eye))
            }
        };
        let boxes = [4.7, 4.700_01].map(|z| Aabb::from_arrays([-2.0, -2.0, z], [2.0, 2.0, 6.0]));
        assert_eq!(limit(&view.unwrap(), &[wall], &boxes), [true, false], "{round}");
    }
}

#[test]
fn one_free_pixel_is_enough() {
    let view = pixels(12.0, 9.0);
    let all = block([0.0, 12.0], [0.0, 9.0]);
    for (column, row) in [(0, 0), (11, 0), (0, 8), (11, 8), (5, 4)] {
        let (x, y) = (column as f32, row as f32);
        // Four walls around one pixel, and a wall in front of it.
        let around = [
            rectangle([0.0, 12.0], [0.0, y], 0.4),
            rectangle([0.0, 12.0], [y + 1.0, 9.0], 0.4),
            rectangle([0.0, x], [y, y + 1.0], 0.4),
            rectangle([x + 1.0, 12.0], [y, y + 1.0], 0.4),
        ];
        let mut walls: Vec<_> = around.into_iter().flatten().collect();
        assert_eq!(limit(&view, &walls, &[all]), [true], "{column}, {row}");
        walls.extend(rectangle([x, x + 1.0], [y, y + 1.0], 0.45));
        assert_eq!(limit(&view, &walls, &[all]), [false], "{column}, {row}");
    }
}

#[test]
fn a_box_flush_with_the_surface_is_free_and_one_behind_is_not() {
    // Three views: parallel with nearest depth 0, parallel with nearest depth 1, and perspective.
    let reversed = DMat4::from_cols(DVec4::X / 6.0, DVec4::Y / -4.5, -DVec4::Z, DVec4::new(-1., 1., 1., 1.));
    let reversed = View::from_clip_from_world(reversed, Depth::Reversed).unwrap();
    for (view, name) in [(pixels(12.0, 9.0), "nearest 0"), (reversed, "nearest 1")] {
        let wall = rectangle([0.0, 12.0], [0.0, 9.0], 0.375);
        let from = |z| Aabb::from_arrays([4.0, 4.0, z], [6.0, 6.0, 0.9]);
        let boxes = [0.3749, 0.375, 0.375_000_12].map(from);
        assert_eq!(limit(&view, &wall, &boxes), [true, true, false], "{name}");
        let flat = |z| Aabb::from_arrays([4.0, 4.0, z], [6.0, 6.0, z]);
        assert_eq!(limit(&view, &wall, &[0.375, 0.376].map(flat)), [true, false], "{name}, flat");
    }
    let pose = Pose::look_at(DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.1, 0.2, 9.0), DVec3::Y);
    for far in [50.0, f64::INFINITY] {
        let view = View::perspective(pose, 1.0, 4.0 / 3.0, 0.5, far).unwrap();
        let wall = rectangle([-90.0, 90.0], [-90.0, 90.0], 10.0);
        let from = |z| Aabb::from_arrays([-1.0, -1.0, z], [1.0, 1.0, 12.0]);
        assert_eq!(limit(&view, &wall, &[9.999, 10.0, 10.000_01].map(from)), [true, true, false], "{far}");
    }
}

#[test]
fn near_far_and_clip_planes_bound_a_solid_box() {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 4.0 / 3.0, 2.0, 20.0).unwrap();
    let wall = |x: f32| {
        let [a, b, c, d] = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let [a, b, c, d] = [a, b, c, d].map(|(y, z)| Vec3::new(x, y * 90.0, z * 90.0));
        [[a, b, c], [a, c, d]]
    };
    let along = |from: f32, to: f32| Aabb::from_arrays([from, -1.0, -1.0], [to, 1.0, 1.0]);
    // The wall is a millimetre behind the near plane, so only parts that the near plane cuts off are in front
    // of it.
    let boxes = [
        along(-3.0, -1.0),
        along(-1.0, 1.9),
        along(-1.0, 2.0),
        along(-1.0, 2.1),
        along(1.0, 30.0),
        along(2.0, 2.5),
        along(2.002, 30.0),
    ];
    let expected = [false, false, true, true, true, true, false];
    assert_eq!(
        limit(&view, &wall(2.001), &boxes),
        expected,
        "boxes before, through and behind the near plane"
    );
    // Boxes at the far plane, without a wall.
    let far = [19.9, 20.1].map(|x| Aabb::from_arrays([x, -3.0, -3.0], [30.0, 3.0, 3.0]));
    assert_eq!(limit(&view, &[], &far), [true, false], "boxes at the far plane");
    // A box with a corner in front of the far plane but beside the view. Its part inside the view's sides is
    // behind the far plane.
    let pose = Pose::look_at(DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0), DVec3::Z);
    let diagonal = |far| View::perspective(pose, 1.0, 4.0 / 3.0, 2.0, far).unwrap();
    let corner = Aabb::from_arrays([0.0, 25.0, -9.0], [40.0, 40.0, 9.0]);
    assert_eq!(
        limit(&diagonal(20.0), &[], &[corner]),
        [false],
        "a corner nearer than the far plane, beside the view"
    );
    assert_eq!(limit(&diagonal(22.0), &[], &[corner]), [true], "a corner within the far plane");
    // A box beside the view.
    let beside = Aabb::from_arrays([-5.0, 20.0, -1.0], [5.0, 22.0, 1.0]);
    assert_eq!(limit(&view, &[], &[beside]), [false], "a box beside the view");
    // A clip plane 5 m ahead cuts a box open. The faces of the box are all in front of the plane or behind
    // the wall.
    let view = view.with_clip_planes(&[Plane::new(DVec3::X, -5.0)]).unwrap();
    let boxes = [along(3.0, 4.9), along(3.0, 30.0), along(6.1, 30.0)];
    assert_eq!(limit(&view, &wall(6.0), &boxes), [false, true, false], "boxes that a clip plane cuts");
}

#[test]
fn what_no_culler_may_hide_counts_and_other_layers_do_not() {
    let view = pixels(12.0, 9.0).with_layers(2);
    let wall = rectangle([0.0, 12.0], [0.0, 9.0], 0.4);
    let mut buffer = ItemBuffer::new(12, 9).unwrap();
    let mut scene = Scene::new();
    let behind = Object { layers: 2, ..Object::new(block([1.0, 2.0], [1.0, 2.0])) };
    let before = Object { bounds: Aabb::from_arrays([1.0, 1.0, 0.1], [2.0, 2.0, 0.2]), ..behind };
    let nan = Object { bounds: Aabb::new(Vec3::NAN, Vec3::ONE), ..behind };
    let objects = [
        behind,
        before,
        Object { never_cull: true, ..behind },
        nan,
        Object { bounds: Aabb::EMPTY, ..behind },
        Object { layers: 1, ..before },
        Object { layers: 5, never_cull: true, ..behind },
        behind,
        Object { layers: 4, ..behind },
    ];
    let ids = scene.insert_batch(objects);
    assert_eq!(buffer.box_limit(&scene, |_| true).count(), 0, "nothing is drawn yet");
    buffer.draw(&view, DVec3::ZERO, [(0, &wall[..])]).unwrap();
    let within: Vec<_> = buffer.box_limit(&scene, |id| id == ids[7] || id == ids[8]).collect();
    assert_eq!(within, [1, 2, 3, 4, 7].map(|index: usize| ids[index]), "objects not hidden, in order");
    // The scene's origin moves, and the boxes move with it.
    scene.set_origin(DVec3::new(0.0, 0.0, 0.35)).unwrap();
    assert!(
        !buffer.box_limit(&scene, |_| false).any(|id| id == ids[1]),
        "the box moved behind the wall with the origin"
    );
    scene.set_origin(DVec3::new(0.0, 0.0, -0.15)).unwrap();
    assert!(
        buffer.box_limit(&scene, |_| false).any(|id| id == ids[0]),
        "the box moved before the wall with the origin"
    );
}

/// Boxes of all sizes in front of, behind and between surfaces are also drawn as triangles: a box has a free
/// pixel if a pixel shows one of its triangles that is as near as the surface.
#[test]
fn boxes_clear_of_the_planes_equal_boxes_that_are_drawn() {
    let mut random = Random(21);
    let mut counts = [0; 2];
    for round in 0..60 {
        let parallel = round % 2 == 1;
        let (near, far) = if parallel { (-3.0, 30.0) } else { (0.5, 30.0) };
        let camera = camera(&mut random, round, near, far, parallel);
        let depth = [Depth::NegativeOneToOne, Depth::ZeroToOne, Depth::Reversed][round % 3];
        let view = View::from_clip_from_world(camera.matrix(depth), depth).unwrap();
        let view = view.relative_to(camera.pose.eye).unwrap();
        let place = |random: &mut Random| {
            let at = camera.pose.eye + camera.pose.forward * random.range(4.0, 20.0) + random.vector(5.0);
            at.as_vec3()
        };
        let surfaces: Vec<[Vec3; 3]> = (0..14)
            .map(|_| {
                let at = place(&mut random);
                core::array::from_fn(|_| at + random.vector(6.0).as_vec3())
            })
            .collect();
        let (mut scene, mut alone) = (ItemBuffer::new(24, 18).unwrap(), ItemBuffer::new(24, 18).unwrap());
        scene.draw(&view, DVec3::ZERO, [(0, &surfaces[..])]).unwrap();
        let boxes: Vec<Aabb> = (0..60)
            .map(|_| {
                let (at, size) = (place(&mut random), random.vector(2.0).as_vec3().abs());
                // Every sixth box has no thickness along one axis.
                let size = if random.one_in(6) { size.with_y(0.0) } else { size };
                Aabb::new(at - size, at + size)
            })
            .filter(|bounds| {
                let depth = |p: &Vec3| (p.as_dvec3() - camera.pose.eye).dot(camera.pose.forward);
                bounds.corners().iter().all(|p| depth(p) > near + 0.1 && depth(p) < far - 0.1)
            })
            .collect();
        for (index, is_within) in in_limit(&scene, &boxes).into_iter().enumerate() {
            alone.draw(&view, DVec3::ZERO, [(0, &triangles(&boxes[index])[..])]).unwrap();
            let mut pixels = alone.depth_keys().iter().zip(scene.depth_keys());
            let is_free = pixels.any(|(&of_box, &surface)| of_box > f64::NEG_INFINITY && of_box >= surface);
            assert_eq!(is_within, is_free, "round {round}, box {index}: {:?}", boxes[index]);
            counts[usize::from(is_free)] += 1;
        }
    }
    assert!(counts.iter().all(|&count| count > 800), "{counts:?}");
}

/// Boxes across the near plane, around the eye and beside it, tested at points along rays made without a
/// matrix. A box may be missed between two points of a ray, so an enlarged box is tested as well.
#[test]
fn boxes_across_the_near_plane_equal_points_along_rays() {
    let (width, height, steps) = (12, 9, 400);
    let mut random = Random(22);
    let mut counts = [0; 2];
    for round in 0..80 {
        let parallel = round % 2 == 1;
        let (near, far) = if parallel { (-3.0, 9.0) } else { (0.5, 9.0) };
        let camera = camera(&mut random, round, near, far, parallel);
        let depth = [Depth::NegativeOneToOne, Depth::ZeroToOne, Depth::Reversed][round % 3];
        let view = View::from_clip_from_world(camera.matrix(depth), depth).unwrap();
        let view = view.relative_to(camera.pose.eye).unwrap();
        // A wall that covers most of the view, just behind the near plane.
        let wall = near + 0.1;
        let across = |x: f64, y: f64| {
            let turned = camera.pose.right * x + camera.pose.up * y;
            (camera.pose.eye + camera.pose.forward * wall + turned).as_vec3()
        };
        let surfaces = [[across(-40.0, -40.0), across(40.0, -40.0), across(0.1, 90.0)]];
        let mut buffer = ItemBuffer::new(width as u32, height as u32).unwrap();
        buffer.draw(&view, DVec3::ZERO, [(0, &surfaces[..])]).unwrap();
        for _ in 0..10 {
            let at = (camera.pose.eye + camera.pose.forward * near + random.vector(1.5)).as_vec3();
            let size = random.vector(1.2).as_vec3().abs() + 0.02;
            let bounds = Aabb::new(at - size, at + size);
            let is_within = in_limit(&buffer, &[bounds])[0];
            let meets = |margin: f64| {
                (0..height).any(|row| {
                    (0..width).any(|column| {
                        let (start, direction) = camera.ray(column, row, width, height);
                        (0..=steps).any(|step| {
                            let distance = near + (wall - near) * f64::from(step) / f64::from(steps);
                            let p = start + direction * distance;
                            let (min, max) = (bounds.min.as_dvec3() - margin, bounds.max.as_dvec3() + margin);
                            p.cmpge(min).all() && p.cmple(max).all()
                        })
                    })
                })
            };
            // A step along a ray is 0.00025 m along the viewing direction, and less than 0.0006 m in total.
            let (surely, perhaps) = (meets(-1e-5), meets(1e-3));
            assert!(is_within || !surely, "round {round}: {bounds:?} is met");
            assert!(!is_within || perhaps, "round {round}: {bounds:?} is not met");
            counts[usize::from(is_within)] += 1;
        }
    }
    assert!(counts.iter().all(|&count| count > 150), "{counts:?}");
}
