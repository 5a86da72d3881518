//! Tests of the triangulated image's margins: boxes that touch an occluder, or show beside it by some last
//! bits, are visible; boxes clearly behind it are hidden; at all scales. A warm map allocates nothing.

use visibility_2d::view_cdt::ViewCdt;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::occlusion::Occlusion;
use visibility_core::view::Window;
use visibility_core::{Aabb, OccluderMesh, OcclusionMap, Pose, View};
use visibility_testing::allocations::ALLOCATIONS;
use visibility_testing::{Random, sign_of_sum};

const SCALES: [f32; 7] = [1e-12, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e12];

/// Makes a map with a wall across the x axis, seen from `eye` in a random direction.
fn seen(random: &mut Random, eye: DVec3, wall: &Aabb, scale: f64) -> ViewCdt {
    // Half of the views look straight ahead, where the wall's depth has no slope that could hide errors.
    let turn = if random.one_in(2) { DVec3::ZERO } else { random.fine_vector(0.2) };
    let pose = Pose::look_at(eye, eye + DVec3::X + turn, DVec3::Z + turn);
    let near = 1e-3 * scale;
    let view = if random.one_in(4) {
        View::orthographic(pose, Window::centered(9.0 * scale, 6.0 * scale), near, 50.0 * scale)
    } else {
        View::perspective(pose, 1.9, 1.5, near, f64::INFINITY)
    };
    let mut map = ViewCdt::new();
    map.begin(&view.unwrap(), DVec3::ZERO);
    map.add(&OccluderMesh::cuboid(wall).unwrap(), &Affine3A::IDENTITY);
    map.flush();
    map
}

#[test]
fn a_box_that_touches_a_wall_is_visible() {
    let mut random = Random(1);
    let mut hidden = 0;
    for round in 0..14_000 {
        let scale = SCALES[round % SCALES.len()];
        // The eye is not representable in `f32`, so that differences from it are rounded.
        let eye = random.fine_vector(1.0) * f64::from(scale);
        let [x, y, z] = eye.as_vec3().to_array();
        let front = x + random.fine_range(2.0, 5.0) as f32 * scale;
        let wall = Aabb::from_arrays(
            [front, y - 2.0 * scale, z - 2.0 * scale],
            [front + 0.01 * scale, y + 2.0 * scale, z + 2.0 * scale],
        );
        let map = seen(&mut random, eye, &wall, scale.into());
        let middle = random.vec3(-0.4, 0.4) * scale;
        let size = random.fine_range(1e-3, 0.2) as f32 * scale;
        let at = |x: f32| {
            let (y, z) = (y + middle.y, z + middle.z);
            Aabb::from_arrays([x, y - size, z - size], [x + size, y + size, z + size])
        };
        for x in [front, front.next_down()] {
            assert_ne!(map.test(&at(x)), Occlusion::Hidden, "round {round}: {:?} {wall:?} {eye}", at(x));
        }
        hidden += u32::from(map.test(&at(front + 1e-3 * scale)) == Occlusion::Hidden);
    }
    assert!(hidden > 13_900, "{hidden} boxes behind the wall are hidden");
}

#[test]
fn a_box_that_shows_beside_a_wall_by_less_than_rounding_is_visible() {
    let mut random = Random(2);
    let [mut close, mut hidden] = [0; 2];
    for round in 0..14_000 {
        let scale = SCALES[round % SCALES.len()];
        let eye = random.fine_vector(1.0) * f64::from(scale);
        let [x, y, z] = eye.as_vec3().to_array();
        let front = x + random.fine_range(2.0, 5.0) as f32 * scale;
        let side = y + random.fine_range(0.1, 1.0) as f32 * scale;
        let wall = Aabb::from_arrays(
            [front, y - scale, z - 2.0 * scale],
            [front + 0.01 * scale, side, z + 2.0 * scale],
        );
        let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.9, 1.5, 1e-3 * f64::from(scale), f64::INFINITY).unwrap();
        let mut map = ViewCdt::new();
        map.begin(&view, DVec3::ZERO);
        map.add(&OccluderMesh::cuboid(&wall).unwrap(), &Affine3A::IDENTITY);
        map.flush();
        let far = front + random.fine_range(1.0, 3.0) as f32 * scale;
        let behind = (f64::from(far) - eye.x) / (f64::from(front) - eye.x);
        let mut end = (eye.y + (f64::from(side) - eye.y) * behind) as f32;
        for _ in 0..random.below(3) {
            end = end.next_up();
        }
        let bounds = |end: f32| Aabb::from_arrays([far, end - 0.2 * scale, z], [far, end, z + 0.1 * scale]);
        // The side is beside the line from the eye past the wall's end if (end - eye) (front - eye) > (side -
        // eye) (far - eye).
        let [end64, front, side, far] = [end, front, side, far].map(f64::from);
        let products = [
            (end64, front),
            (-end64, eye.x),
            (-eye.y, front),
            (eye.y, eye.x),
            (-side, far),
            (side, eye.x),
            (eye.y, far),
            (-eye.y, eye.x),
        ];
        let beside = sign_of_sum(products) > 0;
        let is_hidden = map.test(&bounds(end)) == Occlusion::Hidden;
        assert!(!(beside && is_hidden), "round {round}: {:?} beside {wall:?} from {eye}", bounds(end));
        close += u32::from(beside);
        hidden += u32::from(map.test(&bounds(end - 1e-4 * scale)) == Occlusion::Hidden);
    }
    assert!(close > 7_000 && hidden > 13_900, "{close} boxes show, {hidden} are hidden");
}

#[test]
fn warm_frames_allocate_nothing_and_odd_boxes_are_visible() {
    let mut random = Random(3);
    let solids: Vec<_> = (0..60)
        .map(|_| {
            let low = random.vec3(-9.0, 9.0);
            OccluderMesh::cuboid(&Aabb::new(low, low + random.vec3(0.1, 3.0))).unwrap()
        })
        .collect();
    let boxes: Vec<_> = (0..200)
        .map(|_| {
            let low = random.vec3(-20.0, 20.0);
            Aabb::new(low, low + random.vec3(0.0, 2.0))
        })
        .collect();
    let mut map = ViewCdt::new();
    let mut frame = |angle: f64| {
        let pose = Pose::look_at(DVec3::splat(15.0), DVec3::new(angle, 0.0, 0.0), DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY).unwrap();
        map.begin(&view, DVec3::ZERO);
        for solid in &solids {
            map.add(solid, &Affine3A::IDENTITY);
        }
        map.flush();
        assert_eq!(map.test(&Aabb::EMPTY), Occlusion::Visible, "the empty box");
        boxes.iter().filter(|bounds| map.test(bounds) == Occlusion::Hidden).count()
    };
    let first = frame(0.0);
    frame(1.0);
    let before = ALLOCATIONS.get();
    assert_eq!(frame(0.0), first, "boxes hidden in a warm frame");
    assert_eq!(ALLOCATIONS.get(), before, "allocations in a warm frame");
    assert!(first > 25, "{first} boxes hidden");
}
