//! Tests that no object whose shadow falls into a view is culled. The oracle shoots segments from points of
//! the view to the light and shares nothing with the culler's planes, hulls and silhouettes.

use visibility_core::glam::{DMat4, DQuat, DVec3};
use visibility_core::{
    Aabb, ObjectId, Pipeline, Pose, Scene, View, VisibleSet, geometry::Plane, simd::Simd, view::Depth,
};
use visibility_frame::casters::{CasterCuller, Light, LightError};
use visibility_testing::cameras::{
    Camera, DEPTHS, power_of_two, projection, random_camera, random_projection,
};
use visibility_testing::{Random, judged, told_enough};

/// A view given by its parameters, from which points in view are computed without the crate's code.
#[derive(Clone, Copy, Debug)]
struct Eye {
    turn: DQuat,
    place: DVec3,
    window: [f64; 4],
    near: f64,
    far: f64,
    parallel: bool,
    depth: Depth,
}

impl Eye {
    fn random(rng: &mut Random) -> Self {
        let depth = rng.pick(&DEPTHS);
        let parallel = !depth.is_infinite() && rng.one_in(3);
        let size = if parallel { rng.range(1.0, 30.0) } else { rng.range(0.1, 1.5) };
        let shift = if rng.one_in(2) { [0.0; 2] } else { [(); 2].map(|_| rng.range(-1.5, 1.5) * size) };
        let [x, y] = shift;
        let near = if parallel { rng.range(-20.0, 5.0) } else { rng.range(0.05, 3.0) };
        Self {
            turn: DQuat::from_scaled_axis(rng.vector(3.0)),
            place: rng.vector(30.0),
            window: [x - size, x + size, y - size * 0.6, y + size * 0.6],
            near,
            far: near + rng.range(10.0, 120.0),
            parallel,
            depth,
        }
    }

    fn view(&self) -> View {
        let look = DMat4::from_quat(self.turn) * DMat4::from_translation(-self.place);
        let matrix = projection(self.depth, self.window, self.near, self.far, self.parallel) * look;
        View::from_clip_from_world(matrix, self.depth).unwrap()
    }

    /// Returns the world point at `x` and `y`, fractions of the window from 0 to 1, and view depth `z` in
    /// metres.
    fn point(&self, x: f64, y: f64, z: f64) -> DVec3 {
        let [left, right, bottom, top] = self.window;
        let widen = if self.parallel { 1.0 } else { z };
        let p = DVec3::new((left + (right - left) * x) * widen, (bottom + (top - bottom) * y) * widen, z);
        self.turn.inverse() * p + self.place
    }

    /// Returns a random world point in view, often at its edges, but inside by a relative 1e-9 for the
    /// rounding of the clip matrix.
    fn sample(&self, rng: &mut Random) -> DVec3 {
        let mut place = || match rng.below(4) {
            0 => 1e-9,
            1 => 1.0 - 1e-9,
            _ => rng.range(1e-9, 1.0 - 1e-9),
        };
        let (x, y, z) = (place(), place(), place());
        let far = if self.depth.is_infinite() { self.far * 10.0 } else { self.far };
        self.point(x, y, self.near + (far - self.near) * z)
    }
}

fn random_light(rng: &mut Random, eye: &Eye) -> Light {
    let position = match rng.below(6) {
        0 => eye.place,
        1 => eye.sample(rng),
        2 => eye.place + rng.vector(5.0),
        _ => rng.vector(80.0),
    };
    let range = if rng.one_in(3) { f64::INFINITY } else { rng.range(20.0, 200.0) };
    match rng.below(4) {
        0 => Light::Point { position, range },
        1 => {
            let direction = (eye.sample(rng) - position) * rng.range(0.01, 100.0);
            let half_angle = if rng.one_in(6) { rng.range(1.5, 3.1) } else { rng.range(0.05, 1.5) };
            Light::Spot { position, direction, half_angle, range }
        }
        _ => {
            let toward_light = match rng.below(3) {
                // A light that shines along a plane of the view, up to rounding.
                0 => eye.point(0.0, rng.unit(), eye.far) - eye.point(0.0, rng.unit(), eye.near),
                1 => eye.turn.inverse() * rng.pick(&[DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_Z]),
                _ => rng.vector(1.0),
            };
            Light::Directional { toward_light: toward_light * rng.range(0.1, 10.0) }
        }
    }
}

/// Returns the vector from `p` to the light, or 10 km towards a directional light. `None` if `p` is not lit.
fn ray(light: &Light, p: DVec3) -> Option<DVec3> {
    match *light {
        Light::Directional { toward_light } => Some(toward_light.normalize() * 1e4),
        Light::Point { position, range } => {
            (position.distance(p) <= range * (1.0 - 1e-9)).then_some(position - p)
        }
        Light::Spot { position, direction, half_angle, range } => {
            let inside = (p - position).angle_between(direction) <= half_angle * (1.0 - 1e-7) - 1e-7;
            (inside && position.distance(p) <= range * (1.0 - 1e-9)).then_some(position - p)
        }
    }
}

/// Returns at most 10,000 pairs of a lit point in view that is `wanted` and the vector from this point to the
/// light. Fewer if 100,000 samples do not yield that many.
fn rays(rng: &mut Random, eye: &Eye, light: &Light, wanted: impl Fn(DVec3) -> bool) -> Vec<(DVec3, DVec3)> {
    let points = (0..100_000).map(|_| eye.sample(rng)).filter(|&p| wanted(p));
    points.filter_map(|p| Some((p, ray(light, p)?))).take(10_000).collect()
}

/// Returns whether the segment from `p` to `p + ray` meets the closed box, by the slab method (Kay and
/// Kajiya, "Ray Tracing Complex Scenes", 1986).
fn hits(min: DVec3, max: DVec3, p: DVec3, ray: DVec3) -> bool {
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for axis in 0..3 {
        let inverse = 1.0 / ray[axis];
        let (a, b) = ((min[axis] - p[axis]) * inverse, (max[axis] - p[axis]) * inverse);
        // `max` and `min` ignore NaN, which occurs where a ray runs along a side; the ray is then inside or
        // on the slab.
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    enter <= leave
}

/// Returns `count` random boxes of many sizes within `spread` metres of the origin.
fn crowd(rng: &mut Random, count: usize, spread: f64) -> Vec<Aabb> {
    let mut boxes = Vec::new();
    for _ in 0..count {
        let min = rng.vector(spread);
        let size = rng.vector(1.0).abs() * power_of_two(rng.between(-2, 4));
        boxes.push(Aabb::new(min.as_vec3(), (min + size).as_vec3()));
    }
    boxes
}

fn cull(scene: &Scene, view: &View, culler: CasterCuller) -> VisibleSet {
    let mut casters = VisibleSet::new();
    Pipeline::new().with(culler).cull(scene, view, &mut casters);
    casters
}

struct Shadows {
    kept: usize,
    needed: usize,
    all: usize,
    rays: usize,
}

/// Asserts that every box hit by a ray is among the casters. Returns how many boxes were kept and how many
/// were hit.
fn shoot(
    boxes: &[Aabb],
    scene: &Scene,
    ids: &[ObjectId],
    casters: &VisibleSet,
    rays: &[(DVec3, DVec3)],
    what: &dyn Fn() -> String,
) -> Shadows {
    let mut sum = Shadows { kept: 0, needed: 0, all: boxes.len(), rays: rays.len() };
    for (bounds, &id) in boxes.iter().zip(ids) {
        // The box is shrunk by more than the rounding error of the rays.
        let slack = (bounds.min.abs().max(bounds.max.abs()).as_dvec3() + 1e3) * 1e-12;
        let (min, max) = (bounds.min.as_dvec3() + slack, bounds.max.as_dvec3() - slack);
        let hit = rays.iter().find(|&&(p, ray)| hits(min, max, p, ray));
        let kept = casters.contains(scene, id);
        sum.kept += usize::from(kept);
        sum.needed += usize::from(hit.is_some());
        assert!(kept || hit.is_none(), "{bounds:?} shadows {hit:?} and is left out: {}", what());
    }
    sum
}

/// Tests 72 random views with all kinds of lights: no box that blocks one of up to 10,000 rays per view is
/// culled.
#[test]
fn no_blocker_of_ten_thousand_rays_is_left_out() {
    let mut rng = Random(1);
    let mut total = [(); 3].map(|_| Shadows { kept: 0, needed: 0, all: 0, rays: 0 });
    for _ in 0..72 {
        let eye = Eye::random(&mut rng);
        let light = random_light(&mut rng, &eye);
        let boxes = crowd(&mut rng, 600, 40.0);
        let mut scene = Scene::new();
        let ids = scene.insert_batch(boxes.iter().copied());
        let casters = cull(&scene, &eye.view(), CasterCuller::new(light).unwrap());
        let rays = rays(&mut rng, &eye, &light, |_| true);
        let found = shoot(&boxes, &scene, &ids, &casters, &rays, &|| format!("{light:?} {eye:?}"));
        let sum = &mut total[match light {
            Light::Directional { .. } => 0,
            Light::Point { .. } => 1,
            Light::Spot { .. } => 2,
        }];
        sum.kept += found.kept;
        sum.needed += found.needed;
        sum.all += found.all;
        sum.rays += found.rays;
    }
    for Shadows { kept, needed, all, rays } in total {
        judged(rays as u64);
        told_enough(
            rays > 50_000 && needed > 250,
            format_args!("too easy: {rays} rays, {needed} of {all} hit"),
        );
        told_enough(kept * 3 < all * 2, format_args!("too little is culled: {kept} of {all} kept"));
    }
}

/// Tests tightness in a scene typical of games, a plain full of houses with a camera looking along it: at
/// most a third of the kept objects casts no shadow into the view.
#[test]
fn in_a_town_at_most_a_third_of_what_is_kept_is_not_needed() {
    let mut rng = Random(2);
    let mut boxes = Vec::new();
    for i in 0..2500 {
        let (x, y) = ((i % 50) as f64 * 12.0 - 300.0, (i / 50) as f64 * 12.0 - 300.0);
        let size = DVec3::new(rng.range(4.0, 9.0), rng.range(4.0, 9.0), rng.range(3.0, 25.0));
        boxes.push(Aabb::new(DVec3::new(x, y, 0.0).as_vec3(), (DVec3::new(x, y, 0.0) + size).as_vec3()));
    }
    let mut scene = Scene::new();
    let ids = scene.insert_batch(boxes.iter().copied());
    let lights = [
        Light::Directional { toward_light: DVec3::new(0.5, 0.3, 0.8) },
        Light::Directional { toward_light: DVec3::new(-1.0, 0.2, 0.25) },
        Light::Point { position: DVec3::new(-40.0, 30.0, 20.0), range: 60.0 },
        Light::Spot {
            position: DVec3::new(-30.0, 20.0, 30.0),
            direction: DVec3::new(1.0, 0.0, -0.7),
            half_angle: 0.5,
            range: 120.0,
        },
    ];
    for (light, least_culled) in lights.into_iter().zip([0.8, 0.6, 0.97, 0.97]) {
        let eye = Eye {
            // The camera looks along x, with z up; its third axis points forward.
            turn: DQuat::from_mat3(&visibility_core::glam::DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X))
                .inverse(),
            place: DVec3::new(-50.0, 3.0, 2.0),
            window: [-0.8, 0.8, -0.45, 0.45],
            near: 0.1,
            far: 200.0,
            parallel: false,
            depth: Depth::Reversed,
        };
        assert!(
            (eye.point(0.5, 0.5, 9.0) - eye.place - DVec3::X * 9.0).length() < 1e-9,
            "the eye looks along x"
        );
        let casters = cull(&scene, &eye.view(), CasterCuller::new(light).unwrap());
        let rays = rays(&mut rng, &eye, &light, |_| true);
        let found = shoot(&boxes, &scene, &ids, &casters, &rays, &|| format!("{light:?}"));
        eprintln!("{light:?}: {} of {} kept, {} needed", found.kept, found.all, found.needed);
        let culled = 1.0 - found.kept as f64 / found.all as f64;
        assert!(culled > least_culled, "{light:?}: {culled} culled");
        assert!(
            found.needed * 3 >= found.kept * 2,
            "{light:?}: {} kept, {} needed",
            found.kept,
            found.needed
        );
    }
}

/// Tests boxes with a corner exactly on a segment from a point of the view to the light. Points, lights and
/// corners have so few bits that all of this is exact.
#[test]
fn corners_exactly_on_segments_from_the_edges_of_the_view_are_kept() {
    let mut rng = Random(3);
    let (mut checked, mut culled) = (0, 0);
    let grid = |v: DVec3| (v * 65536.0).round() / 65536.0;
    for case in 0..1500 {
        let depth = rng.pick(&DEPTHS);
        let base = random_projection(&mut rng, depth, 3.0);
        let camera = Camera::new(base.to_cols_array().map(|x| f64::from(x as f32)), depth);
        let Ok(view) = View::from_clip_from_world(camera.matrix, depth) else { continue };
        let inverse = DMat4::from_cols_array(&camera.matrix).inverse();
        let infinite = case % 2 == 0;
        // Light directions and positions have at most one decimal digit.
        let light = grid(match rng.below(4) {
            0 => rng.vector(0.0) + rng.pick(&[DVec3::X, DVec3::NEG_Y, DVec3::Z]),
            1 => inverse.project_point3(rng.vector(0.9)).clamp_length_max(500.0),
            _ => rng.vector(8.0),
        });
        if light == DVec3::ZERO {
            continue;
        }
        let (mut boxes, mut onto) = (Vec::new(), Vec::new());
        for _ in 0..100 {
            let mut place = || rng.pick(&[-1.0, 1.0, -1.0, 1.0, 0.3]);
            let (x, y, z) = (place(), place(), rng.range(0.001, 0.999));
            let p = grid(inverse.project_point3(DVec3::new(x, y, z)));
            if p.is_nan() || p.abs().max_element() > 1e4 || !camera.sees(p) {
                // A box anywhere, so that there is something to cull.
                boxes.push(rng.small_box(30.0));
                continue;
            }
            let way = if infinite { light * 64.0 } else { light - p };
            let q = p + way * (rng.below(65) as f64 / 64.0);
            let (mut min, mut max) = (q.as_vec3(), q.as_vec3());
            for axis in 0..3 {
                if f64::from(min[axis]) > q[axis] {
                    min[axis] = min[axis].next_down();
                } else if f64::from(max[axis]) < q[axis] {
                    max[axis] = max[axis].next_up();
                }
                let size = rng.unit() as f32;
                if rng.one_in(2) { min[axis] -= size } else { max[axis] += size }
            }
            onto.push((boxes.len(), p));
            boxes.push(Aabb::new(min, max));
        }
        let mut scene = Scene::new();
        let ids = scene.insert_batch(boxes.iter().copied());
        let light = if infinite {
            Light::Directional { toward_light: light }
        } else {
            Light::Point { position: light, range: f64::INFINITY }
        };
        let casters = cull(&scene, &view, CasterCuller::new(light).unwrap());
        for &(number, p) in &onto {
            checked += 1;
            let bounds = &boxes[number];
            assert!(
                casters.contains(&scene, ids[number]),
                "{bounds:?} shadows {p} from {light:?} in {camera:?}"
            );
        }
        culled += boxes.len() - casters.count(&scene);
    }
    assert!(checked > 20_000 && culled > 10_000, "too easy: {checked} {culled}");
}

/// Tests a light along an axis with blockers far along that axis. In the planes through the silhouette the
/// axis component cancels, and its rounding error is significant at these distances.
#[test]
fn blockers_are_kept_however_far_along_an_axis_they_are() {
    let mut rng = Random(4);
    let mut checked = 0;
    for _ in 0..400 {
        let depth = rng.pick(&[Depth::ZeroToOne, Depth::Reversed, Depth::NegativeOneToOne]);
        let base = random_projection(&mut rng, depth, 3.0);
        let camera = Camera::new(base.to_cols_array().map(|x| f64::from(x as f32)), depth);
        let Ok(view) = View::from_clip_from_world(camera.matrix, depth) else { continue };
        let inverse = DMat4::from_cols_array(&camera.matrix).inverse();
        let axis = rng.below(3);
        let mut toward_light = DVec3::ZERO;
        toward_light[axis] = rng.pick(&[-1.0, 1.0]);
        let mut boxes = Vec::new();
        for _ in 0..64 {
            let mut place = || rng.pick(&[-1.0, 1.0, -1.0, 1.0, 0.3]);
            let (x, y, z) = (place(), place(), rng.pick(&[0.001, 0.5, 0.999]));
            let p = inverse.project_point3(DVec3::new(x, y, z)).as_vec3();
            if !p.is_finite() || !camera.sees(p.as_dvec3()) {
                continue;
            }
            // The blocker is so far away that the light is beyond the box; rounding the far end moves it only
            // along the ray.
            let mut q = p;
            q[axis] += (toward_light[axis] * power_of_two(rng.between(20, 60))) as f32;
            boxes.push(Aabb::new(q, q));
        }
        let mut scene = Scene::new();
        let ids = scene.insert_batch(boxes.iter().copied());
        let light = Light::Directional { toward_light };
        let casters = cull(&scene, &view, CasterCuller::new(light).unwrap());
        for (bounds, &id) in boxes.iter().zip(&ids) {
            checked += 1;
            assert!(casters.contains(&scene, id), "{bounds:?} shadows {camera:?} from {light:?}");
        }
    }
    assert!(checked > 5_000, "too easy: {checked}");
}

/// Tests lights that run exactly along one or two planes of the view. The origin is exactly on an edge of the
/// view, where the planes meet, and blockers are exactly between the origin and the light. All numbers are
/// small integers and powers of two, so only the rounding of the planes matters.
#[test]
fn blockers_are_kept_where_the_light_runs_along_planes_of_the_view() {
    let mut rng = Random(8);
    let mut checked = 0;
    let integers = |rng: &mut Random, size: i32| {
        DVec3::from_array(core::array::from_fn(|_| f64::from(rng.between(-size, size))))
    };
    for _ in 0..3000 {
        let toward_light = integers(&mut rng, 60);
        let across = |rng: &mut Random| toward_light.cross(integers(rng, 1000));
        let right = if rng.one_in(4) { integers(&mut rng, 1000) } else { across(&mut rng) };
        let top = if rng.one_in(2) { integers(&mut rng, 1000) } else { across(&mut rng) };
        let w = integers(&mut rng, 1000);
        let rows =
            [(w - right).extend(100.0), (w - top).extend(100.0), integers(&mut rng, 1000).extend(30.0)];
        let matrix = DMat4::from_cols(rows[0], rows[1], rows[2], w.extend(100.0)).transpose();
        let depth = rng.pick(&DEPTHS);
        let camera = Camera::new(matrix.to_cols_array(), depth);
        let (Ok(view), true) = (View::from_clip_from_world(matrix, depth), toward_light != DVec3::ZERO)
        else {
            continue;
        };
        assert!(camera.sees(DVec3::ZERO), "the origin is in view of {camera:?}");
        // In some cases the view is a thin wedge: two nearly opposite planes, whose sum cancels almost
        // completely.
        let thin = integers(&mut rng, 1000) * 67108864.0 + integers(&mut rng, 1000);
        let wedge = [thin, integers(&mut rng, 3) - thin].map(|normal| Plane::new(normal, 0.0));
        let view = match view.with_clip_planes(&wedge) {
            Ok(clipped) if rng.one_in(2) => clipped,
            _ => view,
        };
        // Rounding errors grow with the distance of blockers, so near blockers are tested alone and with far
        // ones.
        let most = rng.pick(&[0, 20, 60]);
        let ways = (-10..=most).map(|exponent| (toward_light * power_of_two(exponent)).as_vec3());
        let boxes: Vec<Aabb> = ways.map(|q| Aabb::new(q, q)).collect();
        let mut scene = Scene::new();
        let ids = scene.insert_batch(boxes.iter().copied());
        let place = toward_light * power_of_two(most);
        for light in
            [Light::Directional { toward_light }, Light::Point { position: place, range: f64::INFINITY }]
        {
            let casters = cull(&scene, &view, CasterCuller::new(light).unwrap());
            for (bounds, &id) in boxes.iter().zip(&ids) {
                checked += 1;
                assert!(
                    casters.contains(&scene, id),
                    "{bounds:?} shadows the origin of {camera:?} from {light:?}"
                );
            }
        }
    }
    assert!(checked > 100_000, "too easy: {checked}");
}

/// Tests a lamp behind a view with an infinite far plane: casters are limited by planes through the lamp
/// parallel to those of the view. Without these planes every object would be kept.
#[test]
fn a_lamp_behind_a_view_without_end_has_casters_in_a_cone() {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    let lamp = Light::Point { position: DVec3::new(-20.0, 0.0, 0.0), range: f64::INFINITY };
    let mut scene = Scene::new();
    let at = |x: f32, y: f32| Aabb::from_arrays([x, y, 0.0], [x + 0.5, y + 0.5, 0.5]);
    let ids =
        scene.insert_batch([at(-10.0, 0.0), at(-10.0, 5.0), at(-10.0, 6.0), at(-10.0, -9.0), at(-22.0, 0.0)]);
    let casters = cull(&scene, &view, CasterCuller::new(lamp).unwrap());
    // At 10 m from the lamp, the cone is 5.46 m wide.
    let kept: Vec<bool> = ids.iter().map(|&id| casters.contains(&scene, id)).collect();
    assert_eq!(
        kept,
        [true, true, false, false, false],
        "boxes in the cone of the lamp, at its border, outside, and behind the lamp"
    );
}

/// Tests that a view has the same casters whatever the origins of scene and view are, and with all SIMD
/// instruction sets.
#[test]
fn casters_are_the_same_on_all_instructions_and_wherever_the_origins_are() {
    let mut rng = Random(7);
    let mut kept = 0;
    for _ in 0..200 {
        let eye = Eye::random(&mut rng);
        let light = random_light(&mut rng, &eye);
        let boxes = crowd(&mut rng, 300, 60.0);
        let mut scene = Scene::new();
        let ids = scene.insert_batch(boxes.iter().copied());
        let find = |scene: &Scene, view: &View, culler: CasterCuller| -> Vec<bool> {
            let casters = cull(scene, view, culler);
            ids.iter().map(|&id| casters.contains(scene, id)).collect()
        };
        let culler = CasterCuller::new(light).unwrap();
        let view = eye.view();
        let here = find(&scene, &view, culler.clone());
        kept += here.iter().filter(|&&is_kept| is_kept).count();
        for simd in Simd::available() {
            assert_eq!(
                find(&scene, &view, culler.clone().with_simd(simd)),
                here,
                "{simd:?} finds other casters of {light:?}"
            );
        }
        // Scene and view are moved by whole metres, which rounds a little in `f64`. No box hit before the
        // move may be culled after it.
        let away = rng.vector(1e6).round();
        scene.set_origin(away).unwrap();
        let moved = match light {
            Light::Directional { .. } => light,
            Light::Point { position, range } => Light::Point { position: position + away, range },
            Light::Spot { position, direction, half_angle, range } => {
                Light::Spot { position: position + away, direction, half_angle, range }
            }
        };
        let there = find(&scene, &view.relative_to(away).unwrap(), CasterCuller::new(moved).unwrap());
        let differ = here.iter().zip(&there).filter(|(a, b)| a != b).count();
        assert!(differ <= 1, "{differ} of {} differ", here.len());
    }
    assert!(kept > 1000, "too easy: {kept}");
}

/// Tests culling with a box of receivers: only shadows on the receivers count, and every blocker of such a
/// shadow is kept.
#[test]
fn receivers_leave_fewer_casters_and_no_blocker_out() {
    let mut rng = Random(5);
    let (mut fewer, mut more, mut needed) = (0, 0, 0);
    for _ in 0..24 {
        let eye = Eye::random(&mut rng);
        let light = random_light(&mut rng, &eye);
        let boxes = crowd(&mut rng, 600, 40.0);
        let mut scene = Scene::new();
        let ids = scene.insert_batch(boxes.iter().copied());
        let center = eye.sample(&mut rng).as_vec3();
        let receivers = Aabb::new(center - 25.0, center + 25.0);
        let all = cull(&scene, &eye.view(), CasterCuller::new(light).unwrap());
        let some = cull(
            &scene,
            &eye.view(),
            CasterCuller::new(light).unwrap().with_receivers(receivers, DVec3::ZERO),
        );
        let rays = rays(&mut rng, &eye, &light, |p| receivers.contains_point(p.as_vec3()));
        needed += shoot(&boxes, &scene, &ids, &some, &rays, &|| format!("{light:?} {eye:?}")).needed;
        assert!(some.iter(&scene).all(|id| all.contains(&scene, id)), "{light:?}: receivers add a caster");
        fewer += some.count(&scene);
        more += all.count(&scene);
    }
    judged(needed as u64);
    told_enough(
        fewer * 2 < more && needed * 2 > fewer && needed > 100,
        format_args!("{fewer} of {more}, {needed} needed"),
    );
}

/// Tests that a box of receivers belongs to the origin that it was given for: after a move of the origin,
/// equal numbers are another place.
#[test]
fn receivers_are_of_the_origin_that_they_were_given_for() {
    let sun = Light::Directional { toward_light: DVec3::Z };
    let pose = Pose::look_at(DVec3::new(-20.0, 0.0, 1.0), DVec3::new(0.0, 0.0, 1.0), DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, 100.0).unwrap();
    // Receivers on the ground around the origin of the world, under a lamp at a height of 5 m.
    let (lamp, ground) = ([DVec3::new(-0.5, -0.5, 5.0), DVec3::new(0.5, 0.5, 5.5)], [-3.0, 3.0]);
    let mut scene = Scene::new();
    let id = scene.insert(Aabb::from_world(lamp[0], lamp[1], DVec3::ZERO));
    let receivers = |origin: DVec3| {
        let [low, high] = ground.map(|side| DVec3::new(side, side, 0.1 * side));
        Aabb::from_world(low, high, origin)
    };
    let mut culler = CasterCuller::new(sun).unwrap().with_receivers(receivers(DVec3::ZERO), DVec3::ZERO);
    let casts = |culler: &mut CasterCuller, scene: &Scene| {
        let mut visible = VisibleSet::new();
        visible.fill(scene, &view);
        visibility_core::Culler::cull(culler, scene, &view, &mut visible);
        visible.contains(scene, id)
    };
    assert!(casts(&mut culler, &scene), "the lamp casts onto the ground");
    let far = DVec3::X * 40.0;
    scene.set_origin(far).unwrap();
    scene.set_bounds(id, Aabb::from_world(lamp[0], lamp[1], far)).unwrap();
    assert!(casts(&mut culler, &scene), "the ground has not moved");
    culler.set_receivers(receivers(far), far);
    assert!(casts(&mut culler, &scene), "the ground is given for the new origin");
    scene.set_bounds(id, Aabb::from_world(lamp[0] + far, lamp[1] + far, far)).unwrap();
    assert!(!casts(&mut culler, &scene), "beside the ground");
    scene.set_origin(DVec3::ZERO).unwrap();
    scene.set_bounds(id, Aabb::from_world(lamp[0], lamp[1], DVec3::ZERO)).unwrap();
    assert!(casts(&mut culler, &scene), "the ground is where it was, after the origin moved back");
}

#[test]
fn the_range_of_a_light_is_a_ball_and_its_cone_a_cone() {
    let at = |x: f32, y: f32, z: f32| Aabb::from_arrays([x, y, z], [x + 0.5, y + 0.5, z + 0.5]);
    let mut scene = Scene::new();
    let ids =
        scene.insert_batch([at(9.0, 0.0, 0.0), at(7.0, 7.0, 7.0), at(5.0, 5.0, 5.0), at(-3.0, 0.0, 0.0)]);
    let view = View::orthographic(
        Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z),
        visibility_core::view::Window::centered(50.0, 50.0),
        -50.0,
        50.0,
    )
    .unwrap();
    let kept = |light| {
        ids.iter()
            .map(|&id| cull(&scene, &view, light_culler(light)).contains(&scene, id))
            .collect::<Vec<_>>()
    };
    fn light_culler(light: Light) -> CasterCuller {
        CasterCuller::new(light).unwrap()
    }
    assert_eq!(
        kept(Light::Point { position: DVec3::ZERO, range: 10.0 }),
        [true, false, true, true],
        "boxes in the ball, in its corner outside, in the ball, behind"
    );
    let spot =
        |half_angle| Light::Spot { position: DVec3::ZERO, direction: DVec3::X, half_angle, range: 10.0 };
    assert_eq!(kept(spot(0.5)), [true, false, false, false], "a cone of 0.5 rad");
    assert_eq!(kept(spot(1.1)), [true, false, true, false], "a cone of 1.1 rad");
    assert_eq!(kept(spot(1.6)), [true, false, true, true], "a cone wider than a half-space");
    // Lit points exactly at the light's range, in numbers without rounding. An object at such a point may be
    // the only blocker of its own shadow.
    let mut scene = Scene::new();
    let touching =
        [[3.0, 4.0, 12.0], [13.0, 0.0, 0.0], [12.0, -4.0, 3.0], [0.0, 5.0, -12.0], [-4.0, -3.0, -12.0]];
    let ids = touching.map(|p| scene.insert(Aabb::from_arrays(p, p)));
    let beyond = touching.map(|p| p.map(|x| x * 1.00001)).map(|p| scene.insert(Aabb::from_arrays(p, p)));
    let casters = cull(&scene, &view, light_culler(Light::Point { position: DVec3::ZERO, range: 13.0 }));
    assert!(ids.iter().all(|&id| casters.contains(&scene, id)), "boxes at exactly the light's range");
    assert!(beyond.iter().all(|&id| !casters.contains(&scene, id)), "boxes beyond the light's range by 1e-5");
}

#[test]
fn bad_lights_are_refused_and_the_one_before_stays() {
    let (nan, inf) = (f64::NAN, f64::INFINITY);
    let sun = Light::Directional { toward_light: DVec3::Z };
    let mut culler = CasterCuller::new(sun).unwrap();
    let spot =
        |direction, half_angle| Light::Spot { position: DVec3::ZERO, direction, half_angle, range: 1.0 };
    for (light, error) in [
        (Light::Directional { toward_light: DVec3::ZERO }, LightError::Direction),
        (Light::Directional { toward_light: DVec3::new(0.0, nan, 1.0) }, LightError::Direction),
        (Light::Point { position: DVec3::splat(inf), range: 1.0 }, LightError::Position),
        (Light::Point { position: DVec3::ZERO, range: -1.0 }, LightError::Range { range: -1.0 }),
        (spot(DVec3::ZERO, 1.0), LightError::Direction),
        (spot(DVec3::X, 0.0), LightError::HalfAngle { half_angle: 0.0 }),
        (spot(DVec3::X, 3.2), LightError::HalfAngle { half_angle: 3.2 }),
    ] {
        assert_eq!(culler.set_light(light), Err(error), "{light:?} is refused");
        assert_eq!(culler.light(), sun, "the sun stays after {light:?} was refused");
    }
    assert!(
        matches!(
            culler.set_light(Light::Point { position: DVec3::ZERO, range: nan }),
            Err(LightError::Range { .. })
        ),
        "a range that is NaN"
    );
}

/// Tests lights and views of arbitrary bit patterns: nothing panics, and objects that are never culled stay.
#[test]
fn hostile_lights_and_views_do_no_harm() {
    let mut rng = Random(6);
    let mut culled = 0;
    for _ in 0..20_000 {
        let wild = |rng: &mut Random| {
            let any = |rng: &mut Random| match rng.below(4) {
                0 => rng.bits64(),
                1 => power_of_two(rng.between(-1070, 1020)),
                2 => 0.0,
                _ => rng.range(-10.0, 10.0),
            };
            DVec3::new(any(rng), any(rng), any(rng))
        };
        let (position, direction) = (wild(&mut rng), wild(&mut rng));
        let (range, half_angle) = (wild(&mut rng).x.abs(), rng.range(0.0, 3.5));
        let light = match rng.below(3) {
            0 => Light::Directional { toward_light: direction },
            1 => Light::Point { position, range },
            _ => Light::Spot { position, direction, half_angle, range },
        };
        let Ok(culler) = CasterCuller::new(light) else { continue };
        let exponents = [rng.between(-100, 100); 3];
        let (camera, _) = random_camera(&mut rng, exponents);
        let Ok(view) = View::from_clip_from_world(camera.matrix, camera.depth) else { continue };
        let mut scene = Scene::new();
        let always = scene.insert(Aabb::from_arrays([f32::NAN; 3], [1.0; 3]));
        for _ in 0..4 {
            let (a, b) = (wild(&mut rng).as_vec3(), wild(&mut rng).as_vec3());
            scene.insert(Aabb::new(a.min(b), a.max(b)));
        }
        let receivers = Aabb::new(wild(&mut rng).as_vec3(), wild(&mut rng).as_vec3());
        let culler = if rng.one_in(2) { culler.with_receivers(receivers, DVec3::ZERO) } else { culler };
        let casters = cull(&scene, &view, culler);
        assert!(casters.contains(&scene, always), "{light:?} culls an object that is never culled");
        culled += 5 - casters.count(&scene);
    }
    assert!(culled > 1000, "too easy: {culled}");
    // Hostile input also meets an empty scene.
    let culler = CasterCuller::new(Light::Directional { toward_light: DVec3::Z }).unwrap();
    let view = View::from_clip_from_world(DMat4::IDENTITY, Depth::ZeroToOne).unwrap();
    assert_eq!(cull(&Scene::new(), &view, culler).count(&Scene::new()), 0, "casters of an empty scene");
}

/// The difference of the light and the origin of the scene is infinite: all casters stay.
#[test]
fn a_light_at_no_finite_distance_keeps_all_casters() {
    let mut scene = Scene::new();
    scene.set_origin(DVec3::X * -1.7e308).unwrap();
    scene.insert_batch([-9.0, 9.0].map(|y| Aabb::from_arrays([0.0, y, 5.0], [1.0, y + 0.5, 6.0])));
    let light = Light::Point { position: DVec3::X * 1.7e308, range: f64::INFINITY };
    let pose = Pose::look_at(scene.origin(), scene.origin() + DVec3::Z, DVec3::Y);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    assert_eq!(cull(&scene, &view, CasterCuller::new(light).unwrap()).count(&scene), 2, "both casters");
}
