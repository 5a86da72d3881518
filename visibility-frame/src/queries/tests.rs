//! Tests of the comparisons and margins of queries: shapes that just touch, or just do not.

use super::region::{BoxRegion, Region, SphereRegion};
use super::*;
use visibility_core::glam::Vec3;
use visibility_testing::Random;

/// Returns a block with a box in lane 0.
fn block(bounds: &Aabb) -> Boxes64 {
    let mut boxes = Boxes64::EMPTY;
    boxes.set(0, bounds);
    boxes
}

/// Returns whether a box is outside of a region, and whether it is inside.
fn is_out_and_in(region: &impl Region, bounds: &Aabb) -> [bool; 2] {
    [region.outside(&block(bounds)), region.inside(&block(bounds))].map(|mask| mask & 1 != 0)
}

#[test]
fn boxes_touch_what_they_have_a_side_in_common_with() {
    let area = BoxRegion::new(&Aabb::from_arrays([-1.0; 3], [2.0; 3]));
    assert_eq!(
        is_out_and_in(&area, &Aabb::from_arrays([-1.0; 3], [2.0; 3])),
        [false, true],
        "the box itself"
    );
    for axis in 0..3 {
        for (min, max) in [(-3.0, -1.0), (2.0, 4.0)] {
            let mut bounds = Aabb::from_arrays([0.0; 3], [1.0; 3]);
            (bounds.min[axis], bounds.max[axis]) = (min, max);
            assert_eq!(is_out_and_in(&area, &bounds), [false, false], "axis {axis}: {min} to {max} touches");
            let by = if max > 2.0 { 1e-6 } else { -1e-6 };
            (bounds.min[axis], bounds.max[axis]) = (min + by, max + by);
            assert_eq!(
                is_out_and_in(&area, &bounds),
                [true, false],
                "axis {axis}: {min} to {max}, off by {by}"
            );
        }
        for (min, max) in [(-1.0f32.next_up(), 0.0), (0.0, 2.0f32.next_up())] {
            let mut bounds = Aabb::from_arrays([0.0; 3], [1.0; 3]);
            (bounds.min[axis], bounds.max[axis]) = (min, max);
            let inside = min >= -1.0 && max <= 2.0;
            assert_eq!(is_out_and_in(&area, &bounds), [false, inside], "axis {axis}: {min} to {max}");
        }
    }
}

/// Boxes of one point at the end of a radius, which is a number of `f32` just above or just below their
/// distance.
#[test]
fn spheres_are_rounded_to_where_they_find_more() {
    let (mut random, mut counts) = (Random(101), [0; 2]);
    for round in 0..20_000 {
        let scale = 2f64.powi(random.between(-30, 30));
        let [center, point] = [(); 2].map(|()| random.fine_vector(scale).as_vec3());
        let exact = (point.as_dvec3() - center.as_dvec3()).length();
        let (mut above, mut below) = (exact as f32, exact as f32);
        if f64::from(above) < exact * (1.0 + 1e-15) {
            above = above.next_up();
        }
        if f64::from(below) > exact * (1.0 - 1e-15) {
            below = below.next_down();
        }
        let bounds = Aabb::new(point, point);
        let [is_out, _] = is_out_and_in(&SphereRegion::new(&Sphere::new(center, above)), &bounds);
        assert!(!is_out, "{round}: {point} is within {above} of {center}");
        let [_, is_in] = is_out_and_in(&SphereRegion::new(&Sphere::new(center, below)), &bounds);
        assert!(!is_in, "{round}: {point} is farther than {below} from {center}");
        let wide = Sphere::new(center, above * (1.0 + 2e-6));
        counts[0] += u32::from(is_out_and_in(&SphereRegion::new(&wide), &bounds)[1]);
        let narrow = Sphere::new(center, below * (1.0 - 2e-6));
        counts[1] += u32::from(is_out_and_in(&SphereRegion::new(&narrow), &bounds)[0]);
    }
    assert_eq!(counts, [20_000; 2], "radii beyond the margin decide");
}

/// Rays through boxes of one point, by whole numbers: origin, direction and point are exact.
#[test]
fn rays_hit_the_points_that_they_go_through() {
    let (mut random, mut rounded) = (Random(102), 0);
    for round in 0..20_000 {
        let mut whole = |size: i32| Vec3::from_array([(); 3].map(|()| random.between(-size, size) as f32));
        let (origin, mut direction) = (whole(4096), whole(1000));
        if round % 4 == 0 {
            direction[round / 4 % 3] = 0.0;
        }
        let steps = 1 + round % 2000;
        if direction == Vec3::ZERO {
            continue;
        }
        let point = origin + direction * steps as f32;
        let distance = direction.as_dvec3().length() * steps as f64;
        let mut end = distance as f32;
        if f64::from(end) < distance * (1.0 + 1e-15) {
            end = end.next_up();
        }
        let ray = Ray::new(origin, direction, end).unwrap();
        let mut enter = [0.0; FAN_OUT];
        let hits = ray.hits(&block(&Aabb::new(point, point)), &mut enter);
        assert!(hits & 1 != 0, "{round}: {ray:?} goes through {point}");
        // The parameter counts steps of the greatest component.
        let exact = f64::from(direction.abs().max_element()) * steps as f64;
        assert!(f64::from(enter[0]) <= exact, "{round}: {point} at {} of {exact}", enter[0]);
        rounded += u32::from(f64::from(enter[0]) < exact);
        let short = Ray::new(origin, direction, end * (1.0 - 2e-6)).unwrap();
        let hits = short.hits(&block(&Aabb::new(point, point)), &mut enter);
        assert!(hits & 1 == 0, "{round}: {short:?} ends before {point}");
    }
    assert!(rounded > 10_000, "{rounded} parameters are rounded down");
    // Along a side of a box, on it and beside it, and at a parameter that overflows.
    let unit = block(&Aabb::from_arrays([0.0; 3], [1.0; 3]));
    for (y, is) in [(0.0, true), (1.0, true), (-1e-6, false), (1.0f32.next_up(), false)] {
        let ray = Ray::new(Vec3::new(-3.0, y, 0.5), Vec3::X, f32::INFINITY).unwrap();
        assert_eq!(ray.hits(&unit, &mut [0.0; FAN_OUT]) & 1 != 0, is, "along a side, at {y}");
        let ray = Ray::new(Vec3::new(3.0, y, 0.5), Vec3::NEG_X, f32::INFINITY).unwrap();
        assert_eq!(ray.hits(&unit, &mut [0.0; FAN_OUT]) & 1 != 0, is, "back along a side, at {y}");
    }
    let far = Aabb::from_arrays([3.3e38, 0.0, 0.0], [3.4e38, 1.0, 1.0]);
    let ray = Ray::new(Vec3::new(-3.3e38, 0.5, 0.5), Vec3::X, f32::INFINITY).unwrap();
    assert!(ray.hits(&block(&far), &mut [0.0; FAN_OUT]) & 1 != 0, "at a distance that overflows");
}

#[test]
fn rays_of_no_direction_or_length_are_refused() {
    let new = |direction: Vec3, length: f32| Ray::new(Vec3::ZERO, direction, length).err();
    for direction in [Vec3::ZERO, Vec3::NAN, Vec3::X * f32::INFINITY, Vec3::new(1.0, f32::NAN, 0.0)] {
        assert_eq!(new(direction, 1.0), Some(RayError::Direction), "along {direction}");
    }
    assert_eq!(new(Vec3::X, -1.0), Some(RayError::MaxDistance { max_distance: -1.0 }), "a negative length");
    assert!(matches!(new(Vec3::X, f32::NAN), Some(RayError::MaxDistance { .. })), "a length of NaN");
    assert_eq!([0.0, f32::INFINITY].map(|length| new(Vec3::X, length)), [None; 2], "no length, any length");
}

/// Boxes of different lengths that begin at one plane: of those at equal distances, the least ids are found,
/// whichever nodes they are in.
#[test]
fn of_equal_distances_the_least_ids_are_found() {
    let mut scene = Scene::new();
    let boxes = (0..500).map(|i| Aabb::from_arrays([0.0; 3], [((i * 37) % 500) as f32 + 1.0, 1.0, 1.0]));
    let ids = scene.insert_batch(boxes);
    let query = SceneQuery::new(&scene);
    let ray = Ray::new(Vec3::new(-2.0, 0.5, 0.5), Vec3::X, f32::INFINITY).unwrap();
    assert_eq!(query.first_hit(&ray).map(|hit| hit.id), Some(ids[0]), "the first hit");
    let mut near = Vec::new();
    for count in [0, 1, 5, 499, usize::MAX] {
        query.nearest(Vec3::new(-2.0, 0.5, 0.5), count, &mut near);
        let found: Vec<ObjectId> = near.iter().map(|neighbor| neighbor.id).collect();
        assert_eq!(found, ids[..count.min(500)], "the {count} nearest");
    }
}

/// Objects within a sphere and nearest to a point, by plain loops.
#[test]
fn many_boxes_are_found_as_by_a_plain_loop() {
    let (mut random, mut scene) = (Random(103), Scene::new());
    let boxes: Vec<Aabb> = (0..1000)
        .map(|_| {
            let at = random.vec3(-50.0, 50.0).round();
            Aabb::new(at, at + Vec3::ONE)
        })
        .collect();
    let ids = scene.insert_batch(boxes.iter().copied());
    let query = SceneQuery::new(&scene);
    for round in 0..30 {
        let point = random.vec3(-50.0, 50.0).round();
        let squares = boxes.iter().map(|bounds| {
            let p = point.as_dvec3();
            (p.clamp(bounds.min.as_dvec3(), bounds.max.as_dvec3()) - p).length_squared()
        });
        let mut all: Vec<(f64, ObjectId)> = squares.zip(ids.iter().copied()).collect();
        let (mut found, mut near) = (Vec::new(), Vec::new());
        query.in_sphere(&Sphere::new(point, 30.0), &mut found);
        found.sort_unstable();
        let wanted: Vec<ObjectId> =
            all.iter().filter(|(square, _)| *square <= 900.0).map(|of| of.1).collect();
        assert_eq!(found, wanted, "{round}: within 30 m of {point}");
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        query.nearest(point, 20, &mut near);
        let near: Vec<_> = near.iter().map(|neighbor| (neighbor.distance_squared, neighbor.id)).collect();
        assert_eq!(near, all[..20], "{round}: nearest to {point}");
    }
}
