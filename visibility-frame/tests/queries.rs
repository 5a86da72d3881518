//! Tests of queries against plain loops over all objects, under random changes, with exact arithmetic where a
//! margin decides.

use visibility_core::frustum::ConvexVolume;
use visibility_core::geometry::{Plane, Sphere};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::simd::Simd;
use visibility_core::view::ViewPlane;
use visibility_core::{Aabb, Object, ObjectId, Scene};
use visibility_frame::queries::{Ray, SceneQuery};
use visibility_testing::allocations::ALLOCATIONS;
use visibility_testing::{Random, sign_of_sum};

fn random_box(rng: &mut Random, reach: f64) -> Aabb {
    // Whole numbers, so that shapes often touch exactly.
    let whole = |v: DVec3| v.round().as_vec3();
    let min = whole(rng.vector(reach));
    Aabb::new(min, min + whole(rng.vector(4.0).abs()))
}

fn random_object(rng: &mut Random) -> Object {
    let bounds = random_box(rng, 60.0);
    let bounds = match rng.below(60) {
        0 => Aabb::new(Vec3::NAN, bounds.max),
        1 => Aabb::new(bounds.max + Vec3::ONE, bounds.min),
        2 => Aabb::new(bounds.min, Vec3::new(bounds.max.x, f32::INFINITY, bounds.max.z)),
        _ => bounds,
    };
    let layers = if rng.one_in(4) { 1 << rng.below(4) } else { u32::MAX };
    Object { layers, never_cull: rng.one_in(50), ..Object::new(bounds) }
}

/// Returns, by a plain loop, the objects on `layers` for which `touches` is true and all objects with
/// improper bounds.
fn plain(scene: &Scene, layers: u32, touches: impl Fn(&Aabb) -> bool) -> Vec<ObjectId> {
    let is_found = |id: &ObjectId| {
        let object = scene.object(*id).unwrap();
        object.layers & layers != 0 && (!object.bounds.is_proper() || touches(&object.bounds))
    };
    scene.ids().filter(is_found).collect()
}

fn sorted(mut ids: Vec<ObjectId>) -> Vec<ObjectId> {
    ids.sort_unstable();
    ids
}

/// Squared distance of a point from a box, by clamping: exact for small whole numbers.
fn squared_distance(p: Vec3, b: &Aabb) -> f64 {
    let p = p.as_dvec3();
    (p.clamp(b.min.as_dvec3(), b.max.as_dvec3()) - p).length_squared()
}

/// Parameter at which a ray enters a box, by clipping in f64. `None` if the ray misses the box.
fn enters(o: Vec3, d: Vec3, b: &Aabb, end: f64) -> Option<f64> {
    let (mut first, mut last) = (0.0f64, end);
    for axis in 0..3 {
        let (o, d) = (f64::from(o[axis]), f64::from(d[axis]));
        let (min, max) = (f64::from(b.min[axis]), f64::from(b.max[axis]));
        if d == 0.0 {
            if o < min || o > max {
                return None;
            }
            continue;
        }
        let (a, b) = ((min - o) / d, (max - o) / d);
        first = first.max(a.min(b));
        last = last.min(a.max(b));
    }
    (first <= last).then_some(first)
}

fn change(rng: &mut Random, scene: &mut Scene) {
    let ids: Vec<ObjectId> = scene.ids().collect();
    for _ in 0..30 {
        let id = rng.pick(&ids);
        match rng.below(4) {
            0 => drop(scene.remove(id)),
            1 => drop(scene.insert(random_object(rng))),
            2 => drop(scene.set_never_cull(id, rng.one_in(9))),
            _ => drop(scene.set_bounds(id, random_object(rng).bounds)),
        }
    }
    if rng.one_in(3) {
        scene.maintain(10);
    }
}

#[test]
fn queries_find_what_plain_loops_find_under_random_changes() {
    let mut rng = Random(7);
    let mut scene = Scene::new();
    scene.insert_batch((0..3000).map(|_| random_object(&mut rng)).collect::<Vec<_>>());
    let (mut found, mut hits, mut near) = (Vec::new(), Vec::new(), Vec::new());
    let mut counts = [0; 5];
    for _ in 0..150 {
        change(&mut rng, &mut scene);
        let layers = rng.pick(&[u32::MAX, 2, 12, 0]);
        let query = SceneQuery::new(&scene).on_layers(layers);
        let center = rng.vector(60.0).round().as_vec3();

        let sphere = Sphere::new(center, rng.below(30) as f32);
        let stats = query.in_sphere(&sphere, &mut found);
        assert_eq!(stats.visible, found.len() as u64, "{sphere:?}: objects counted and found");
        let radius = f64::from(sphere.radius);
        let expected = plain(&scene, layers, |b| squared_distance(center, b) <= radius * radius);
        assert_eq!(sorted(found.clone()), expected, "{sphere:?}");
        counts[0] += found.len();

        let area = random_box(&mut rng, 60.0);
        query.in_box(&area, &mut found);
        let touches = |b: &Aabb| b.min.cmple(area.max).all() && area.min.cmple(b.max).all();
        assert_eq!(sorted(found.clone()), plain(&scene, layers, touches), "{area:?}");
        counts[1] += found.len();

        let planes: Vec<ViewPlane> = (0..rng.below(5))
            .map(|_| {
                let plane = Plane::through(rng.vector(40.0), rng.direction());
                ViewPlane { plane, error: 0.0 }
            })
            .collect();
        query.in_convex(&ConvexVolume::new(Simd::best(), &planes), &mut found);
        // Infinite bounds give NaN in the plain loop and count as inside.
        let inside = |b: &Aabb, slack: f64| {
            !planes.iter().any(|p| {
                let far =
                    DVec3::select(p.plane.normal.cmpge(DVec3::ZERO), b.max.as_dvec3(), b.min.as_dvec3());
                p.plane.signed_distance(far) < -slack
            })
        };
        let found_ids = sorted(found.clone());
        assert!(contains_all(&found_ids, &plain(&scene, layers, |b| inside(b, 0.0))), "{planes:?}");
        assert!(contains_all(&plain(&scene, layers, |b| inside(b, 1e-3)), &found_ids), "{planes:?}");
        counts[2] += found.len();

        // Directions are whole numbers with few bits, so that the plain loop is exact but for ties in
        // divisions, which another test covers.
        let direction = rng.vector(2.0).round().as_vec3();
        let end = if rng.one_in(2) { f32::INFINITY } else { 20.25 };
        let Ok(ray) = Ray::new(center, direction, end) else { continue };
        let length = direction.as_dvec3().length();
        query.all_hits(&ray, &mut hits);
        let exact = |b: &Aabb| enters(center, direction, b, f64::from(end) / length);
        let ids = sorted(hits.iter().map(|hit| hit.id).collect());
        let nearly = |b: &Aabb| enters(center, direction, &grown(b, 1e-3), f64::from(end) / length + 1e-3);
        assert!(contains_all(&ids, &plain(&scene, layers, |b| exact(b).is_some())), "{ray:?}");
        assert!(contains_all(&plain(&scene, layers, |b| nearly(b).is_some()), &ids), "{ray:?}");
        for hit in &hits {
            let bounds = scene.bounds(hit.id).unwrap();
            let distance = exact(&bounds).filter(|_| bounds.is_proper()).map_or(0.0, |t| t * length);
            let given = f64::from(hit.distance);
            assert!(given <= distance && given >= distance * (1.0 - 1e-6), "{given} {distance}");
        }
        assert!(hits.is_sorted(), "{ray:?}: hits are sorted by distance");
        assert_eq!(query.first_hit(&ray), hits.first().copied(), "{ray:?}: the first of all hits");
        // Along an axis many objects are hit at equal distances.
        for axis in [Vec3::X, Vec3::NEG_Y, Vec3::Z] {
            let ray = Ray::new(rng.vector(40.0).round().as_vec3(), axis, f32::INFINITY).unwrap();
            query.all_hits(&ray, &mut hits);
            assert_eq!(
                query.first_hit(&ray),
                hits.first().copied(),
                "{ray:?}: the first of many hits at equal distances"
            );
        }
        counts[3] += hits.len();

        let count = rng.pick(&[0, 1, 7, 100, 5000]);
        query.nearest(center, count, &mut near);
        let mut expected: Vec<(f64, ObjectId)> = plain(&scene, layers, |_| true)
            .into_iter()
            .map(|id| (scene.bounds(id).unwrap(), id))
            .map(|(b, id)| (if b.is_proper() { squared_distance(center, &b) } else { 0.0 }, id))
            .collect();
        expected.sort_by(|a, b| a.partial_cmp(b).unwrap());
        expected.truncate(count);
        assert_eq!(
            near.iter().map(|n| (n.distance_squared, n.id)).collect::<Vec<_>>(),
            expected,
            "{count} nearest to {center}"
        );
        counts[4] += near.len();
    }
    assert!(counts.iter().all(|&count| count > 1000), "{counts:?}");
}

/// Tests whether all of `some` are in `all`, which is sorted.
fn contains_all(all: &[ObjectId], some: &[ObjectId]) -> bool {
    some.iter().all(|id| all.binary_search(id).is_ok())
}

fn grown(b: &Aabb, by: f32) -> Aabb {
    Aabb::new(b.min - by, b.max + by)
}

/// Tests spheres around random `f32` points that exactly touch a corner of a box: the box is found at every
/// scale. A sphere with a radius smaller by 16 error bounds does not touch it.
#[test]
fn spheres_decide_at_every_scale() {
    let mut rng = Random(11);
    let (mut found, mut touching) = (Vec::new(), 0);
    for case in 0..4000 {
        let scale = 10f64.powi(rng.between(-15, 15));
        let corner = (rng.fine_vector(1.0) * scale).as_vec3();
        let center = (rng.fine_vector(1.0) * scale).as_vec3();
        // The box lies beyond the corner, as seen from the centre.
        let far = corner + (corner - center);
        let bounds = Aabb::new(corner.min(far), corner.max(far));
        let exact = (corner.as_dvec3() - center.as_dvec3()).length();
        let mut scene = Scene::new();
        scene.insert(bounds);
        let query = SceneQuery::new(&scene);
        let nearest = exact as f32;
        for radius in [nearest.next_down(), nearest, nearest.next_up()] {
            let d = (corner.as_dvec3() - center.as_dvec3()).to_array();
            let r = f64::from(radius);
            let touches = sign_of_sum([(r, r), (-d[0], d[0]), (-d[1], d[1]), (-d[2], d[2])]) >= 0;
            query.in_sphere(&Sphere::new(center, radius), &mut found);
            assert!(!touches || found.len() == 1, "case {case}: {bounds:?}, {center} and {radius}");
            touching += usize::from(touches);
        }
        let clear = (exact * (1.0 - 1e-5)) as f32;
        query.in_sphere(&Sphere::new(center, clear), &mut found);
        assert!(found.is_empty(), "case {case}: {bounds:?} is clear of {center} and {clear}");
    }
    assert!(touching > 4000, "spheres that touch: {touching}");
}

/// Tests rays through exactly representable points of edges and corners of boxes, which are hit at every
/// scale and direction, and rays that miss by 1e-5 of the distance.
#[test]
fn rays_through_edges_hit_at_every_scale() {
    let mut rng = Random(13);
    let mut hits = Vec::new();
    let mut missed = 0;
    for case in 0..20_000 {
        let scale = 2f32.powi(rng.between(-40, 40));
        let origin = rng.vec3(-1.0, 1.0) * scale;
        let direction = rng.direction().as_vec3()
            * Vec3::from_array(std::array::from_fn(|_| 2f32.powi(rng.pick(&[0, 0, 0, -10, -60, -120]))));
        let direction =
            if rng.one_in(4) { direction * rng.pick(&[Vec3::X, Vec3::Y, Vec3::ONE]) } else { direction };
        let Ok(ray) = Ray::new(origin, direction, f32::INFINITY) else { continue };
        // The product is exact in f64, and the part that the sum loses is known exactly.
        let t = f64::from((f64::from(scale) * rng.range(0.0, 8.0)) as f32);
        let (o, step) = (origin.as_dvec3(), direction.as_dvec3() * t);
        let p = o + step;
        let virtual_step = p - o;
        let rest = (o - (p - virtual_step)) + (step - virtual_step);
        let side = |up| Vec3::from_array(std::array::from_fn(|i| next(p[i], rest[i], up)));
        let (low, high) = (side(false), side(true));
        // One corner of the box is the nearest `f32` point to the ray's point, so p is in the box.
        let size = rng.vec3(0.0, 1.0) * scale;
        let up: [bool; 3] = std::array::from_fn(|_| rng.one_in(2));
        let min = Vec3::from_array(std::array::from_fn(|i| if up[i] { low[i] } else { low[i] - size[i] }));
        let max = Vec3::from_array(std::array::from_fn(|i| if up[i] { high[i] + size[i] } else { high[i] }));
        let mut scene = Scene::new();
        let id = scene.insert(Aabb::new(min, max));
        let query = SceneQuery::new(&scene);
        query.all_hits(&ray, &mut hits);
        assert_eq!(hits.len(), 1, "case {case}: {origin} {direction} misses {min} {max}");
        assert_eq!(query.first_hit(&ray), Some(hits[0]), "case {case}: the first of all hits");
        assert!(
            f64::from(hits[0].distance) <= t * direction.as_dvec3().length() * (1.0 + 1e-12),
            "case {case}: the distance {} is not rounded up",
            hits[0].distance
        );
        // A box moved away from the ray along an axis on which the ray's direction is zero.
        if let Some(axis) = (0..3).find(|&axis| direction[axis] == 0.0) {
            let mut off = Vec3::ZERO;
            off[axis] = 2.0 * (max[axis] - min[axis]).max(1e-6 * scale);
            scene.set_bounds(id, Aabb::new(min + off, max + off)).unwrap();
            if min[axis] + off[axis] > origin[axis] {
                missed += 1;
                assert_eq!(SceneQuery::new(&scene).first_hit(&ray), None, "case {case}");
            }
        }
    }
    assert!(missed > 1000, "{missed}");
}

/// Returns the nearest `f32` number at or above (`up`) or at or below `x + rest`, where `rest` is less than
/// the rounding error of `x`.
fn next(x: f64, rest: f64, up: bool) -> f32 {
    let near = x as f32;
    let over = f64::from(near) - x;
    let over = if over == 0.0 { -rest } else { over };
    match up {
        true if over < 0.0 => near.next_up(),
        false if over > 0.0 => near.next_down(),
        _ => near,
    }
}

#[test]
fn hostile_shapes_find_everything_or_are_refused() {
    let mut scene = Scene::new();
    let ids = scene.insert_batch((0..200).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 0.5; 3])));
    let query = SceneQuery::new(&scene);
    let mut found = Vec::new();
    for sphere in [
        Sphere::new(Vec3::NAN, 1.0),
        Sphere::new(Vec3::ZERO, f32::NAN),
        Sphere::new(Vec3::ZERO, -1.0),
        Sphere::new(Vec3::ZERO, f32::INFINITY),
        Sphere::new(Vec3::ZERO, f32::MAX),
        Sphere::from_world(DVec3::NAN, 1.0, DVec3::ZERO),
        Sphere::from_world(DVec3::ZERO, -1.0, DVec3::ZERO),
    ] {
        query.in_sphere(&sphere, &mut found);
        assert_eq!(found.len(), 200, "{sphere:?}");
    }
    query.in_sphere(&Sphere::new(Vec3::splat(f32::INFINITY), 1.0), &mut found);
    assert_eq!(found, [], "a sphere at infinity touches nothing");
    for area in [Aabb::EMPTY, Aabb::new(Vec3::NAN, Vec3::ONE)] {
        query.in_box(&area, &mut found);
        assert_eq!(found.len(), 200, "{area:?}");
    }
    let mut near = Vec::new();
    for point in [Vec3::NAN, Vec3::INFINITY, Vec3::splat(f32::MAX), Vec3::splat(-f32::MAX)] {
        query.nearest(point, 3, &mut near);
        assert_eq!(near.len(), 3, "{point}");
    }
    query.nearest(Vec3::splat(1e6), usize::MAX, &mut near);
    assert_eq!((near.len(), near[0].id), (200, ids[199]), "all objects are found, the nearest first");
    assert!(
        Ray::new(Vec3::NAN, Vec3::X, 1.0).is_err() && Ray::new(Vec3::ZERO, Vec3::NAN, 1.0).is_err(),
        "a ray from NaN, and one along NaN"
    );
    assert!(
        Ray::new(Vec3::ZERO, Vec3::X, f32::NAN).is_err() && Ray::new(Vec3::ZERO, Vec3::X, -1.0).is_err(),
        "a ray that ends at NaN, and one of negative length"
    );
    for direction in [Vec3::splat(f32::MAX), Vec3::splat(1e-45)] {
        let ray = Ray::new(Vec3::splat(-f32::MAX), direction, f32::INFINITY).unwrap();
        assert_eq!(query.first_hit(&ray).map(|hit| hit.id), Some(ids[0]), "{direction}");
    }
    let point = Ray::new(Vec3::splat(7.25), Vec3::X, 0.0).unwrap();
    assert_eq!(
        query.first_hit(&point).map(|hit| (hit.id, hit.distance)),
        Some((ids[7], 0.0)),
        "a ray of no length hits the box around its origin"
    );
    let empty = Scene::new();
    let query = SceneQuery::new(&empty);
    query.in_sphere(&Sphere::new(Vec3::ZERO, 1.0), &mut found);
    query.nearest(Vec3::ZERO, 3, &mut near);
    assert!(
        found.is_empty() && near.is_empty() && query.first_hit(&point).is_none(),
        "queries of an empty scene"
    );
}

#[test]
fn queries_skip_what_is_outside_and_accept_what_is_inside() {
    let mut rng = Random(3);
    let mut scene = Scene::new();
    scene.insert_batch((0..100_000).map(|_| random_box(&mut rng, 1000.0)).collect::<Vec<_>>());
    let query = SceneQuery::new(&scene);
    let mut found = Vec::new();
    let small = query.in_sphere(&Sphere::new(Vec3::ZERO, 20.0), &mut found);
    assert!(small.nodes < 80 && !found.is_empty(), "{small:?}");
    let all = query.in_sphere(&Sphere::new(Vec3::ZERO, 1e5), &mut found);
    assert_eq!((found.len(), all.tests <= 64), (100_000, true), "{all:?}");
}

#[test]
fn queries_allocate_nothing_once_warm() {
    let mut rng = Random(9);
    let mut scene = Scene::new();
    scene.insert_batch((0..20_000).map(|_| random_object(&mut rng)).collect::<Vec<_>>());
    let (mut found, mut hits, mut near) = (Vec::new(), Vec::new(), Vec::new());
    let mut before = 0;
    let mut sum = 0;
    for round in 0..3 {
        before = ALLOCATIONS.get();
        let mut rng = Random(1);
        let query = SceneQuery::new(&scene);
        for _ in 0..50 {
            let p = rng.vec3(-60.0, 60.0);
            query.in_sphere(&Sphere::new(p, 20.0), &mut found);
            sum += found.len();
            query.in_box(&Aabb::new(p, p + 9.0), &mut found);
            query.all_hits(&Ray::new(p, Vec3::X, 90.0).unwrap(), &mut hits);
            query.nearest(p, 32, &mut near);
            sum += hits.len() + near.len();
        }
        if round == 2 {
            assert_eq!(ALLOCATIONS.get(), before, "allocations in 50 warm queries of each kind");
        }
    }
    assert!(sum > 0 && before > 0, "{sum} found, {before} allocations before the last round");
}

#[test]
fn of_objects_hit_at_the_same_distance_the_least_id_is_first() {
    let mut rng = Random(21);
    let mut scene = Scene::new();
    // A wall of overlapping tiles, in random order.
    let tile = |rng: &mut Random| {
        let min = Vec3::new(rng.below(3) as f32, rng.below(60) as f32, rng.below(60) as f32);
        Aabb::new(min, min + 2.0)
    };
    scene.insert_batch((0..4000).map(|_| tile(&mut rng)).collect::<Vec<_>>());
    let mut hits = Vec::new();
    for _ in 0..2000 {
        let origin = Vec3::new(-9.0, rng.below(60) as f32, rng.below(60) as f32);
        let ray = Ray::new(origin, Vec3::X, f32::INFINITY).unwrap();
        let query = SceneQuery::new(&scene);
        query.all_hits(&ray, &mut hits);
        assert_eq!(
            query.first_hit(&ray),
            hits.first().copied(),
            "from {origin}: the least id of those at the same distance"
        );
    }
}
