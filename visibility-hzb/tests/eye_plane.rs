//! Boxes that reach the plane of the eye, beside the eye, are hidden if an occluder covers the whole part of
//! them that is in the picture.

use crate::common::boxes::assert_hidden;
use crate::common::{Occluder, convention, draw, faces};
use visibility_core::glam::{Affine3A, DMat4, DVec3, DVec4, Vec3};
use visibility_core::occlusion::Occlusion;
use visibility_core::{Aabb, OccluderMesh, OcclusionMap, Pose, View, view::Depth};
use visibility_hzb::{Hom, Hzb};
use visibility_testing::{Random, judged, told_enough};

/// A wall stands beside the eye: to the right, above or below. Boxes behind it begin behind the eye; some
/// surround the eye instead, or have the eye on a face. View rays to points of a hidden box must meet the
/// wall first, and nearly all boxes that the wall covers must be hidden.
#[test]
fn boxes_beside_the_eye_are_hidden_behind_a_wall() {
    let mut random = Random(17);
    let (mut behind, mut missed, mut rays) = (0, 0, 0);
    for trial in 0..8_000 {
        let size = random.pick(&[[192, 128], [17, 33], [130, 50], [333, 77]]);
        let turn = random.range(-0.5, 0.5);
        let along = DVec3::new(turn.sin(), turn.cos(), random.range(-0.2, 0.2));
        let eye = random.vector(0.5);
        let pose = Pose::look_at(eye, eye + along, DVec3::Z);
        let view = View::perspective(pose, random.range(0.6, 1.8), 1.5, 0.05, f64::INFINITY).unwrap();
        let view = convention(&view, random.below(6));
        let wall_end = random.range(3.0, 30.0) as f32;
        let top = if random.one_in(2) { 40.0 } else { random.range(-0.5, 1.5) as f32 };
        let wall = Aabb::new(Vec3::new(2.0, -9.0, -40.0), Vec3::new(2.3, wall_end, top));
        let wall = Occluder { mesh: OccluderMesh::cuboid(&wall).unwrap(), transform: Affine3A::IDENTITY };
        let hzb = draw(Hzb::new(size[0], size[1]).unwrap(), core::slice::from_ref(&wall), &view);
        let all = faces(core::slice::from_ref(&wall));
        let is_around_eye = random.one_in(4);
        let left = if is_around_eye { eye.x as f32 - 1.0 } else { random.range(2.4, 6.0) as f32 };
        let near = Vec3::new(left, random.range(-5.0, -1.0) as f32, -1.0);
        let right = if is_around_eye && random.one_in(2) { eye.x as f32 } else { left + 3.0 };
        let far = Vec3::new(right, random.range(1.0, 60.0) as f32, 1.0);
        let bounds = Aabb::new(near, far);
        // Position, seen from above, at which the last ray to the box passes the plane of the wall.
        let passes = eye.y + (f64::from(far.y) - eye.y) * (2.3 - eye.x) / (f64::from(near.x) - eye.x);
        let is_behind = !is_around_eye && top == 40.0 && passes + 1.0 < f64::from(wall_end);
        behind += u64::from(is_behind);
        missed += u64::from(is_behind && hzb.test(&bounds) != Occlusion::Hidden);
        if hzb.test(&bounds) == Occlusion::Hidden {
            rays += assert_hidden(&mut random, &view, size, &bounds, &all, &format!("trial {trial}"));
        }
    }
    judged(rays);
    // Some boxes are missed, since a pixel of the smallest picture is wide.
    told_enough(
        missed * 8 < behind,
        format_args!("{missed} of {behind} boxes behind the wall are not hidden"),
    );
    told_enough(rays > 10_000, format_args!("{rays} rays prove little"));
}

/// Boxes with sides at infinity in a view along an axis: coefficients of 0 times infinity must not lose a
/// side. A wall fills the picture, or its middle.
#[test]
fn boxes_with_infinite_sides_are_hidden_only_as_a_whole() {
    // The eye looks along x.
    let rows = [[0.0, -1.2, 0.0, 0.0], [0.0, 0.0, 1.8, 0.0], [0.0, 0.0, 0.0, 0.05], [1.0, 0.0, 0.0, 0.0]];
    let [x, y, z, w] = rows.map(DVec4::from_array);
    let matrix = DMat4::from_cols(x, y, z, w).transpose();
    let view = View::from_clip_from_world(matrix, Depth::ReversedInfinite).unwrap();
    let sides = [f32::NEG_INFINITY, -1e3, -1.0, 1.0, 7.0, 1e3, f32::INFINITY];
    let (mut infinite, mut hidden) = (0, 0);
    for half in [1.0, 100.0] {
        let wall = OccluderMesh::cuboid(&Aabb::from_arrays([5.0, -half, -half], [6.0, half, half])).unwrap();
        let (mut hzb, mut hom) = (Hzb::new(96, 64).unwrap(), Hom::new(96, 64).unwrap());
        for map in [&mut hzb as &mut dyn OcclusionMap, &mut hom] {
            map.begin(&view, DVec3::ZERO);
            map.add(&wall, &Affine3A::IDENTITY);
            map.flush();
        }
        for number in 0..sides.len().pow(6) {
            let at = |place: u32| sides[number / sides.len().pow(place) % sides.len()];
            let bounds = Aabb::from_arrays([at(0), at(1), at(2)], [at(3), at(4), at(5)]);
            if !bounds.is_proper() || bounds.is_finite() {
                continue;
            }
            infinite += 1;
            // Points in the picture before the wall, and beside it if it does not fill the picture.
            let shows = (0..4 * 121).any(|i| {
                let x = [1.0, 3.0, 20.0, 900.0][i / 121];
                let [y, z] = [i % 11, i / 11 % 11].map(|step| x * 0.1 * (step as f32 - 5.0));
                let is_behind = x > 5.0 && 5.0 * y.abs().max(z.abs()) < half * x;
                let p = Vec3::new(x, y, z);
                !is_behind && p.cmpge(bounds.min).all() && p.cmple(bounds.max).all()
            });
            for map in [&hzb as &dyn OcclusionMap, &hom] {
                let is_hidden = map.test(&bounds) == Occlusion::Hidden;
                assert!(!(shows && is_hidden), "{} hides {bounds:?}, wall of {half}", map.name());
                hidden += usize::from(is_hidden);
            }
        }
    }
    assert!(infinite > 10_000 && hidden > 100, "{infinite} boxes have an infinite side, {hidden} are hidden");
}
