//! Tests of polygons of a level that are beside the eye, around it, or cut by the near plane.

use super::{as_faces, level, quad};
use crate::rays::check;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::view::Window;
use visibility_core::{OcclusionMap, Pose, View};
use visibility_hzb::Hzb;
use visibility_occluders::{LevelSettings, LevelTriangle};
use visibility_testing::Random;

/// Casts rays from eyes in or beside `levels` grounds whose vertices are up to `bumps` metres off a plane.
/// Views look up or down by up to `tilt` times as far as ahead. Returns the number of covered pixels.
fn cast_beside_bumps(levels: usize, bumps: f64, tilt: f64, near: [f64; 3], settings: LevelSettings) -> u64 {
    let mut random = Random(33);
    let settings = settings.with_kept_area(1.0);
    let mut covered = 0;
    for _ in 0..levels {
        let cells = random.below(5) + 2;
        let bend = random.fine_range(0.0, bumps);
        let at: Vec<Vec3> = (0..(cells + 1) * (cells + 1))
            .map(|k| {
                let [i, j] = [k % (cells + 1), k / (cells + 1)].map(|k| k as f32 / cells as f32 * 8.0 - 4.0);
                Vec3::new(i, j, random.fine_range(-bend, bend) as f32)
            })
            .collect();
        let mut triangles = Vec::new();
        let (mixed, all_two_sided) = (random.one_in(2), random.one_in(2));
        for k in 0..cells * cells {
            let a = k / cells * (cells + 1) + k % cells;
            let two_sided = if mixed { random.one_in(2) } else { all_two_sided };
            let corners = [a, a + 1, a + cells + 2, a + cells + 1].map(|i| at[i]);
            triangles.extend(quad(corners).map(|corners| LevelTriangle { corners, two_sided }));
        }
        let level = level(&triangles, settings);
        let mut hzb = Hzb::new(120, 80).unwrap().with_min_polygon_area(16.0).with_level(level, DVec3::ZERO);
        for _ in 0..4 {
            let eye = DVec3::new(
                random.fine_range(-4.0, 4.0),
                random.fine_range(-4.0, 4.0),
                random.fine_range(-3.0, 3.0) * bend,
            );
            let along = DVec3::new(
                random.fine_unit() - 0.5,
                random.fine_unit() - 0.5,
                tilt * (random.fine_unit() - 0.5),
            );
            let pose = Pose::look_at(eye, eye + along.normalize_or(DVec3::X), DVec3::Z);
            let near = near[random.below(3)];
            let view = if random.one_in(4) {
                let window = Window { left: -2.0, right: 2.0, bottom: -1.5, top: 1.5 };
                View::orthographic(pose, window, near - 1.0, 60.0).unwrap()
            } else {
                View::perspective(pose, 1.2, 1.5, near, f64::INFINITY).unwrap()
            };
            hzb.begin(&view, DVec3::ZERO);
            hzb.flush();
            covered += check(&as_faces(&triangles), &view, &hzb, &mut random, "beside bumps")[1];
        }
    }
    covered
}

/// An eye between the faces of a polygon that is not quite flat sees through it, so the polygon hides
/// nothing. The same holds if the eye is so close that a ray might meet a face nearer than the near plane.
#[test]
fn a_polygon_around_the_eye_hides_nothing() {
    let flat = LevelSettings::default().with_flatness(0.01);
    let covered = cast_beside_bumps(400, 0.05, 0.3, [1e-4, 1e-2, 0.1], flat);
    assert!(covered > 1000, "{covered} pixels are covered");
}

/// A polygon that is far from flat hides nothing where its faces may reach through the near plane, inside its
/// outline or where it is cut.
#[test]
fn the_near_plane_cuts_faces_of_polygons_that_are_not_flat() {
    let bulging = LevelSettings::default().with_bulge(0.3);
    let covered = cast_beside_bumps(150, 1.0, 3.0, [0.1, 0.5, 1.5], bulging);
    assert!(covered > 100_000, "{covered} pixels are covered");
}

/// A ramp and the level ground beside it are one polygon that occludes from its front alone. Seen from an eye
/// above all of the ground, the back of the ramp hides nothing. The ramp leads up to a terrace, and is seen
/// past the terrace's near edge; or it rises towards the eye, wider than the ground behind it.
#[test]
fn the_back_of_a_ramp_hides_nothing() {
    let corner = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let terrace = [[7.0, -5.0], [12.0, -5.0], [12.0, 5.0], [7.0, 5.0]].map(|[x, y]| corner(x, y, 1.0));
    let to_terrace = [corner(5.0, -5.0, 0.0), terrace[0], terrace[3], corner(5.0, 5.0, 0.0)];
    let floor = [[0.0, -5.0], [10.0, -5.0], [10.0, 5.0], [0.0, 5.0]].map(|[x, y]| corner(x, y, 0.0));
    let wide = [corner(0.0, 3.0, 0.0), floor[3], corner(-2.0, 9.0, 1.0), corner(-2.0, 3.0, 1.0)];
    let mut random = Random(39);
    for (ground, ramp, y, distances) in [
        (terrace, to_terrace, 0.5, [14.0, 30.0, 40.0, 60.0]),
        (floor, wide, 6.5, [-8.0, -14.0, -20.0, -26.0]),
    ] {
        let triangles: Vec<LevelTriangle> = [quad(ground), quad(ramp)]
            .concat()
            .into_iter()
            .map(|corners| LevelTriangle { corners, two_sided: false })
            .collect();
        let level = level(&triangles, LevelSettings::default().with_bulge(0.5));
        assert_eq!(level.polygons().len(), 1, "ground and ramp are one polygon");
        let mut hzb = Hzb::new(200, 120).unwrap().with_min_polygon_area(16.0).with_level(level, DVec3::ZERO);
        let mut covered = 0;
        for height in [1.3, 2.2, 3.0, 4.0, 9.0, 14.0] {
            for x in distances {
                let pose = Pose::look_at(DVec3::new(x, y, height), DVec3::new(8.0, 0.0, 0.6), DVec3::Z);
                let view = View::perspective(pose, 6.0 / x.abs(), 1.6, 0.01, f64::INFINITY).unwrap();
                hzb.begin(&view, DVec3::ZERO);
                hzb.flush();
                covered += check(&as_faces(&triangles), &view, &hzb, &mut random, "a ramp")[1];
            }
        }
        assert!(covered > 1_000, "{covered} pixels are covered");
    }
}

/// The peak of a low pyramid, which is one polygon, reaches through the near plane, while its whole outline
/// is beyond that plane: the polygon must not be drawn.
#[test]
fn a_peak_through_the_near_plane_leaves_a_hole() {
    let at = |k: usize| {
        let [i, j] = [k % 3, k / 3].map(|k| 2.0 * k as f32 - 2.0);
        Vec3::new(i, j, if k == 4 { 0.25 } else { 0.0 })
    };
    let corners = [0, 1, 3, 4].map(|a| quad([a, a + 1, a + 4, a + 3].map(at))).concat();
    let window = Window { left: -1.0, right: 1.0, bottom: -1.0, top: 1.0 };
    let mut random = Random(37);
    for two_sided in [false, true] {
        let triangles: Vec<LevelTriangle> =
            corners.iter().map(|&corners| LevelTriangle { corners, two_sided }).collect();
        let level = level(&triangles, LevelSettings::default().with_bulge(0.5));
        assert_eq!(level.polygons().len(), 1, "two-sided: {two_sided}: the four slopes are one polygon");
        let mut hzb = Hzb::new(64, 64).unwrap().with_min_polygon_area(16.0).with_level(level, DVec3::ZERO);
        // The near plane is in front of the peak, or cuts the peak: once with the outline beyond the guard
        // band, once within.
        for (height, near, angle, is_whole) in
            [(3.0, 0.2, 0.8, true), (0.35, 0.15, 0.8, false), (0.35, 0.15, 2.0, false)]
        {
            let pose = Pose::look_at(DVec3::Z * height, DVec3::ZERO, DVec3::X);
            let before = height - if is_whole { 0.6 } else { 0.15 };
            for view in [
                View::perspective(pose, angle, 1.0, near, f64::INFINITY).unwrap(),
                View::orthographic(pose, window, before, 60.0).unwrap(),
            ] {
                hzb.begin(&view, DVec3::ZERO);
                hzb.flush();
                let [_, pixels] = check(&as_faces(&triangles), &view, &hzb, &mut random, "a peak");
                assert!(!is_whole || pixels == 64 * 64, "{pixels} pixels are covered, {two_sided}");
            }
        }
    }
}
