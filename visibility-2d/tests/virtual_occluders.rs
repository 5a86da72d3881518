//! Tests that no line of sight from a viewcell meets an object hidden by virtual occluders. Lines are aimed
//! past corners of houses and over their roofs, and tested against prisms by clipping to half-spaces, with
//! code independent of chains of solids.

use visibility_2d::horizon::UpAxis;
use visibility_2d::virtual_occluders::{VirtualOccluder, VirtualOccluderCuller};
use visibility_core::glam::{Affine3A, DVec2, DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Object, ObjectId, OccluderMesh, RegionCuller, Scene, VisibleSet};
use visibility_testing::{NOT_ALWAYS_DRAWN, Random, judged, told_enough};

/// A house: a convex plan, counter-clockwise, between two heights.
#[derive(Clone, Debug)]
struct House {
    plan: Vec<DVec2>,
    low: f64,
    high: f64,
}

impl House {
    /// Returns whether a segment meets the house, or comes within `slack` of it.
    fn blocks(&self, from: DVec3, to: DVec3, slack: f64) -> bool {
        let (mut begin, mut end) = (0.0f64, 1.0f64);
        let mut cut = |at_from: f64, at_to: f64| {
            // Clips the segment to the part where the linear function is at least `-slack`.
            let (a, b) = (at_from + slack, at_to + slack);
            match (a < 0.0, b < 0.0) {
                (true, true) => end = -1.0,
                (true, false) => begin = begin.max(a / (a - b)),
                (false, true) => end = end.min(a / (a - b)),
                (false, false) => {}
            }
        };
        for i in 0..self.plan.len() {
            let (p, q) = (self.plan[i], self.plan[(i + 1) % self.plan.len()]);
            let inwards = (q - p).perp().normalize();
            cut(inwards.dot(from.truncate() - p), inwards.dot(to.truncate() - p));
        }
        cut(from.z - self.low, to.z - self.low);
        cut(self.high - from.z, self.high - to.z);
        begin <= end
    }

    fn mesh(&self, floor: bool) -> OccluderMesh {
        let count = self.plan.len();
        let at = |i: usize, z: f64| self.plan[i % count].extend(z).as_vec3();
        let mut triangles: Vec<[Vec3; 3]> = Vec::new();
        for i in 0..count {
            let [a, b, c, d] = [at(i, self.low), at(i + 1, self.low), at(i + 1, self.high), at(i, self.high)];
            triangles.extend([[a, b, c], [a, c, d]]);
            if i > 0 && i + 1 < count {
                triangles.push([at(0, self.high), at(i, self.high), at(i + 1, self.high)]);
                if floor {
                    triangles.push([at(0, self.low), at(i + 1, self.low), at(i, self.low)]);
                }
            }
        }
        OccluderMesh::from_triangles(&triangles).unwrap()
    }
}

/// Makes houses in rows that share corners, and others at random places, with coordinates representable in
/// `f32`.
fn town(random: &mut Random) -> Vec<House> {
    let fine = |p: DVec2| p.as_vec2().as_dvec2();
    let mut houses = Vec::new();
    for _ in 0..2 + random.below(5) {
        let angle = random.fine_range(0.0, 7.0);
        let along = if random.one_in(2) { DVec2::X } else { DVec2::from_angle(angle) };
        let start = DVec2::new(random.fine_range(-60.0, 60.0), random.fine_range(-60.0, 60.0));
        let (mut at, lots) = (0.0, 2 + random.below(9));
        for _ in 0..lots {
            let (width, depth) = (random.fine_range(3.0, 14.0), random.fine_range(2.0, 9.0));
            let place = |x: f64, y: f64| fine(start + along * x + along.perp() * y);
            let plan =
                vec![place(at, 0.0), place(at + width, 0.0), place(at + width, depth), place(at, depth)];
            let low = [0.0, -0.25, 0.125][random.below(3)];
            let high = f64::from(random.fine_range(3.0, 16.0) as f32);
            houses.push(House { plan, low, high });
            at += width + [0.0, 0.0, 0.0, 0.01, 3.0][random.below(5)];
        }
    }
    for _ in 0..random.below(12) {
        let middle = DVec2::new(random.fine_range(-80.0, 80.0), random.fine_range(-80.0, 80.0));
        let radius = random.fine_range(1.0, 9.0);
        let corners = 3 + random.below(5);
        let corner = |i: usize| {
            DVec2::from_angle(i as f64 / corners as f64 * std::f64::consts::TAU + 0.1) * radius + middle
        };
        houses.push(House {
            plan: (0..corners).map(|i| fine(corner(i))).collect(),
            low: 0.0,
            high: f64::from(random.fine_range(4.0, 30.0) as f32),
        });
    }
    houses
}

fn scene_of(houses: &[House], random: &mut Random) -> Scene {
    let mut scene = Scene::new();
    for house in houses {
        let mesh = house.mesh(random.one_in(2));
        let id = scene.insert(Object { occluder: true, ..Object::new(*mesh.bounds()) });
        let mesh = scene.add_mesh(mesh);
        scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
    }
    // Objects on the ground, slightly below it, and in the air.
    for _ in 0..150 {
        let at = Vec3::new(
            random.fine_range(-120.0, 120.0) as f32,
            random.fine_range(-120.0, 120.0) as f32,
            [0.0, -0.1, 5.0][random.below(3)],
        );
        let size = Vec3::new(random.fine_unit() as f32, random.fine_unit() as f32, random.fine_unit() as f32);
        scene.insert(Aabb::new(at, at + size * 4.0));
    }
    scene
}

/// Returns a random point in the box between two corners, often on one of its sides.
fn point_in(random: &mut Random, min: DVec3, max: DVec3) -> DVec3 {
    let mut part = || [0.0, 1.0, random.fine_unit(), random.fine_unit()][random.below(4)];
    min + (max - min) * DVec3::new(part(), part(), part())
}

fn hunt(rounds: u64, first_seed: u64, lines: usize) -> usize {
    let mut hidden_count = 0;
    for seed in first_seed..first_seed + rounds {
        let mut random = Random(seed);
        let houses = town(&mut random);
        let scene = scene_of(&houses, &mut random);
        let min =
            DVec3::new(random.fine_range(-40.0, 40.0), random.fine_range(-40.0, 40.0), 0.25 + random.unit());
        let size = [0.5, 6.0, 25.0][random.below(3)];
        let max = min + DVec3::new(size * random.fine_unit(), size * random.fine_unit(), 1.5);
        let mut visible = VisibleSet::new();
        let mut culler = VirtualOccluderCuller::new(UpAxis::Z).with_max(64);
        culler.cull(&scene, &Viewcell::from_box(min, max), &mut visible);
        visible.finish(&scene);
        let is_blocked = |from: DVec3, to: DVec3| houses.iter().any(|house| house.blocks(from, to, 1e-9));
        for id in scene.ids().filter(|&id| !visible.contains(&scene, id)) {
            hidden_count += 1;
            let bounds = scene.bounds(id).unwrap();
            let (low, high) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
            for _ in 0..lines {
                let (eye, mut target) = (point_in(&mut random, min, max), point_in(&mut random, low, high));
                // Aims past a corner of a house in the way, by moving the line sideways on the plan.
                let house = &houses[random.below(houses.len())];
                let corner = house.plan[random.below(house.plan.len())];
                let across = (corner - eye.truncate()).perp().normalize_or_zero();
                if across != DVec2::ZERO && random.one_in(2) {
                    let aside = corner + across * [1e-7, -1e-7][random.below(2)];
                    let along = aside - eye.truncate();
                    for part in [1.2, 1.7, 2.5, 4.0, 8.0] {
                        let p = eye.truncate() + along * part;
                        let is_in = p.cmpge(low.truncate()).all() && p.cmple(high.truncate()).all();
                        if is_in {
                            target = p.extend(target.z);
                        }
                    }
                }
                assert!(
                    is_blocked(eye, target),
                    "seed {seed}: {id:?} at {low} is seen from {eye} at {target}, {:?}",
                    culler.occluders()
                );
            }
        }
        for occluder in culler.occluders() {
            let corners = occluder.corners();
            for _ in 0..lines {
                let (u, v) = (random.fine_unit(), random.fine_unit());
                let target = corners[0] + (corners[1] - corners[0]) * u + (corners[3] - corners[0]) * v;
                let eye = point_in(&mut random, min, max);
                assert!(is_blocked(eye, target), "seed {seed}: {occluder:?} is seen from {eye} at {target}");
            }
        }
    }
    judged((hidden_count * lines) as u64);
    hidden_count
}

#[test]
fn nothing_hidden_is_met_by_a_line_of_sight() {
    let hidden = hunt(60, 1, 60);
    told_enough(hidden > 1_000, format_args!("{hidden}"));
}

/// Returns the objects that a culler leaves visible.
fn left(scene: &Scene, cell: &Viewcell, culler: &mut VirtualOccluderCuller) -> Vec<ObjectId> {
    let mut visible = VisibleSet::new();
    culler.cull(scene, cell, &mut visible);
    visible.finish(scene);
    visible.ids(scene).to_vec()
}

fn insert(scene: &mut Scene, min: [f32; 3], max: [f32; 3]) -> ObjectId {
    let bounds = Aabb::from_arrays(min, max);
    let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
    scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
    id
}

#[test]
fn a_row_of_small_houses_hides_what_none_of_them_hides() {
    let mut scene = Scene::new();
    // Houses whose fronts and backs are not aligned with their neighbours'.
    for i in 0..12 {
        let x = -36.0 + 6.0 * i as f32;
        insert(&mut scene, [x, 10.0 - (i % 3) as f32, 0.0], [x + 6.0, 16.0, 8.0]);
    }
    let behind = scene.insert(Aabb::from_arrays([-2.0, 20.0, 0.0], [2.0, 24.0, 3.0]));
    let above = scene.insert(Aabb::from_arrays([-2.0, 20.0, 0.0], [2.0, 24.0, 30.0]));
    let cell = Viewcell::from_box(DVec3::new(-10.0, -10.0, 1.0), DVec3::new(10.0, 5.0, 2.0));
    let mut culler = VirtualOccluderCuller::new(UpAxis::Z);
    let seen = left(&scene, &cell, &mut culler);
    assert!(!seen.contains(&behind) && seen.contains(&above), "{seen:?}");
    // A gap of a millimetre may show objects behind.
    let open = insert(&mut scene, [-0.5, 9.0, 0.0], [0.0, 9.5, 0.01]);
    assert!(
        !left(&scene, &cell, &mut culler).contains(&behind),
        "what is behind a closed row, with a low thing before it"
    );
    scene.remove(open).unwrap();
    for id in scene.ids().collect::<Vec<_>>() {
        let bounds = scene.bounds(id).unwrap();
        if bounds.min.x == 0.0 && bounds.max.y == 16.0 {
            scene.remove(id).unwrap();
            insert(&mut scene, [0.001, bounds.min.y, 0.0], [6.0, 16.0, 8.0]);
        }
    }
    assert!(left(&scene, &cell, &mut culler).contains(&behind), "what is behind a gap of 1 mm");
}

/// Corners rounded by a rotation may no longer touch.
#[test]
fn houses_that_touch_by_rounding_leave_a_gap() {
    for (angle, is_seen) in [(0.0, false), (0.3, true)] {
        let turn = Affine3A::from_rotation_z(angle);
        let mut scene = Scene::new();
        for [from, to] in [[-12.0, 0.0], [0.0, 12.0]] {
            let wall = Aabb::from_arrays([from, 10.0, 0.0], [to, 12.0, 9.0]);
            let id = scene.insert(Object { occluder: true, ..Object::new(wall.transformed(&turn)) });
            let mesh = scene.add_mesh(OccluderMesh::cuboid(&wall).unwrap());
            scene.set_mesh(id, mesh, turn).unwrap();
        }
        let at = turn.transform_point3(Vec3::new(0.0, 40.0, 0.0));
        let behind = scene.insert(Aabb::new(at - Vec3::new(1.0, 1.0, 0.0), at + Vec3::ONE));
        let cell = Viewcell::from_box(DVec3::new(-0.5, -0.5, 1.0), DVec3::new(0.5, 0.5, 2.0));
        let seen = left(&scene, &cell, &mut VirtualOccluderCuller::new(UpAxis::Z));
        assert_eq!(seen.contains(&behind), is_seen, "{angle}");
    }
}

#[test]
fn what_floats_hides_nothing_on_the_ground() {
    let mut scene = Scene::new();
    insert(&mut scene, [-50.0, 10.0, 0.5], [50.0, 11.0, 9.0]);
    let behind = scene.insert(Aabb::from_arrays([-1.0, 20.0, 0.0], [1.0, 21.0, 2.0]));
    let lifted = scene.insert(Aabb::from_arrays([-1.0, 20.0, 0.5], [1.0, 21.0, 2.0]));
    let cell = |z: f64| Viewcell::from_box(DVec3::new(-1.0, -1.0, z), DVec3::new(1.0, 1.0, z + 0.5));
    let mut culler = VirtualOccluderCuller::new(UpAxis::Z);
    let seen = left(&scene, &cell(0.6), &mut culler);
    assert!(seen.contains(&behind) && !seen.contains(&lifted), "{seen:?}");
    assert_eq!(left(&scene, &cell(0.4), &mut culler).len(), 3, "viewpoints below the lower edge");
}

/// A blade 10 m long and high, of which the end is 2 cm wide and the edge has a notch of 20 cm. Its posts are
/// half a metre inside of it, so a viewcell beside all posts may be in the blade.
#[test]
fn a_viewcell_in_a_solid_sees_what_its_posts_hide() {
    let mesh = visibility_testing::notched_blade(2000.0, 0.01, 10.0, 0.2);
    let mut scene = Scene::new();
    let id = scene.insert(Object { occluder: true, ..Object::new(*mesh.bounds()) });
    let mesh = scene.add_mesh(mesh);
    scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
    let behind = scene.insert(Aabb::from_arrays([1999.95, 3.0, 50.0], [2000.05, 3.2, 50.2]));
    for (z, is_seen) in [(0.1, true), (-0.1, true), (-4.0, false)] {
        let [min, max] = [[1999.999, 3.0, z], [2000.001, 3.1, z + 0.2]].map(DVec3::from_array);
        let cell = Viewcell::from_box(min, max);
        let seen = left(&scene, &cell, &mut VirtualOccluderCuller::new(UpAxis::Y));
        assert_eq!(seen.contains(&behind), is_seen, "seen from {z} on");
    }
}

/// A house whose place is rounded by up to 2e-9 m, 1,000 km away, may touch a viewcell that is nearer than
/// twice that.
#[test]
fn a_house_that_may_touch_the_viewcell_hides_nothing() {
    let at = Affine3A::from_translation(Vec3::new(1e6, 0.0, 0.0));
    let house = Aabb::from_arrays([0.0, -200.0, 0.0], [100.0, 200.0, 60.0]);
    let mut scene = Scene::new();
    let id = scene.insert(Object { occluder: true, ..Object::new(house.transformed(&at)) });
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&house).unwrap());
    scene.set_mesh(id, mesh, at).unwrap();
    let behind = scene.insert(Aabb::from_arrays([1e6 + 250.0, -1.0, 0.0], [1e6 + 251.0, 1.0, 2.0]));
    for (distance, is_seen) in [(0.0, true), (2.5e-9, true), (1e-8, false)] {
        let [min, max] = [DVec3::new(1e6 - 1.0, -0.5, 1.0), DVec3::new(1e6 - distance, 0.5, 2.0)];
        let seen = left(&scene, &Viewcell::from_box(min, max), &mut VirtualOccluderCuller::new(UpAxis::Z));
        assert_eq!(seen.contains(&behind), is_seen, "a viewcell {distance} m before the house");
    }
}

#[test]
fn both_up_axes_and_any_origin_agree() {
    let mut counts = Vec::new();
    for (up, origin) in
        [(UpAxis::Z, DVec3::ZERO), (UpAxis::Y, DVec3::ZERO), (UpAxis::Y, DVec3::splat(1024.0))]
    {
        let mut random = Random(77);
        let mut scene = Scene::new();
        scene.set_origin(origin).unwrap();
        let turn = |p: Vec3| if up == UpAxis::Y { Vec3::new(p.y, p.z, p.x) } else { p };
        for _ in 0..60 {
            let at = Vec3::new(random.range(-80.0, 80.0) as f32, random.range(-80.0, 80.0) as f32, 0.0);
            let (min, max) = (turn(at), turn(at + Vec3::new(12.0, 9.0, 8.0)));
            insert(&mut scene, min.to_array(), max.to_array());
        }
        let (min, max) = (turn(Vec3::new(-2.0, -2.0, 1.0)), turn(Vec3::new(2.0, 2.0, 2.0)));
        let cell = Viewcell::from_box(min.as_dvec3() + origin, max.as_dvec3() + origin);
        let mut culler = VirtualOccluderCuller::new(up);
        counts.push(left(&scene, &cell, &mut culler).len());
        assert!(
            culler.occluders().iter().all(|o: &VirtualOccluder| o.up == up && o.top > o.bottom),
            "{up:?} at {origin}: occluders stand along the up axis"
        );
    }
    assert!(counts[0] < 45 && counts.iter().all(|&count| count == counts[0]), "{counts:?}");
}

#[test]
fn odd_viewcells_and_settings_are_taken() {
    let mut scene = Scene::new();
    let wall = insert(&mut scene, [-50.0, 10.0, 0.0], [50.0, 11.0, 9.0]);
    scene.insert(Aabb::from_arrays([-1.0, 20.0, 0.0], [1.0, 21.0, 2.0]));
    scene.insert(Aabb { min: Vec3::NAN, max: Vec3::NAN });
    let mut culler = VirtualOccluderCuller::new(UpAxis::Z);
    let good = [DVec3::new(-1.0, -1.0, 1.0), DVec3::new(1.0, 1.0, 2.0)];
    let cell = |min: DVec3, max: DVec3| Viewcell::from_box(min, max);
    assert_eq!(
        left(&scene, &cell(good[0], good[1]), &mut culler).len(),
        2,
        "wall, box with NaN; the box behind is hidden"
    );
    assert_eq!(left(&scene, &cell(good[0], good[0]), &mut culler).len(), 2, "a point");
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, 1e99] {
        for corner in 0..6 {
            let mut corners = good;
            corners[corner / 3][corner % 3] = bad;
            left(&scene, &cell(corners[0], corners[1]), &mut culler);
        }
    }
    assert_eq!(left(&scene, &cell(good[1], good[0]), &mut culler).len(), 3, "inverted");
    // Viewcells inside the wall, around it, and touching it.
    for (min, max) in [([0.0, 10.5, 1.0], [1.0, 10.6, 2.0]), ([-99.0, 0.0, 1.0], [99.0, 12.0, 2.0])] {
        assert_eq!(
            left(&scene, &cell(min.into(), max.into()), &mut culler).len(),
            3,
            "{min:?} to {max:?}: a viewcell that meets the wall"
        );
    }
    assert_eq!(
        left(&scene, &cell([0.0, 5.0, 1.0].into(), [1.0, 10.0, 2.0].into()), &mut culler).len(),
        3,
        "a viewcell that touches the wall"
    );
    let mut none = VirtualOccluderCuller::new(UpAxis::Z).with_max(0);
    assert_eq!(left(&scene, &cell(good[0], good[1]), &mut none).len(), 3, "no virtual occluders");
    // An occluder that is not a candidate hides nothing; neither does a removed one.
    scene.remove(wall).unwrap();
    assert_eq!(left(&scene, &cell(good[0], good[1]), &mut culler).len(), 2, "the wall was removed");
}

/// A culler that has seen other scenes, states and viewcells gives the same answers as a new one.
#[test]
fn nothing_is_kept_from_other_scenes_and_viewcells() {
    let mut random = Random(5);
    let mut scenes: Vec<Scene> = (0..3)
        .map(|_| {
            let houses = town(&mut random);
            scene_of(&houses, &mut random)
        })
        .collect();
    let mut culler = VirtualOccluderCuller::new(UpAxis::Z);
    let mut hidden = 0;
    for _ in 0..40 {
        let index = random.below(scenes.len());
        match random.below(4) {
            0 => {
                let id = scenes[index].ids().nth(random.below(5)).unwrap();
                let _ = scenes[index].set_occluder(id, random.one_in(2));
            }
            1 => scenes[index] = scenes[random.below(3)].clone(),
            _ => {}
        }
        let scene = &scenes[index];
        let min = DVec3::new(random.fine_range(-9.0, 9.0), random.fine_range(-9.0, 9.0), 1.0);
        let cell = Viewcell::from_box(min, min + DVec3::new(4.0, 4.0, 1.0));
        let found = left(scene, &cell, &mut culler);
        assert_eq!(
            found,
            left(scene, &cell, &mut VirtualOccluderCuller::new(UpAxis::Z)),
            "a used culler and a new one"
        );
        hidden += scene.len() - found.len();
    }
    assert!(hidden > 100, "{hidden}");
}

#[test]
fn what_is_not_always_drawn_hides_nothing() {
    let cell = Viewcell::from_box(DVec3::new(-1.0, -1.0, 1.0), DVec3::new(1.0, 1.0, 2.0));
    for (way, set) in NOT_ALWAYS_DRAWN.into_iter().enumerate() {
        let mut scene = Scene::new();
        let house = insert(&mut scene, [-20.0, 10.0, 0.0], [20.0, 16.0, 8.0]);
        let behind = scene.insert(Aabb::from_arrays([-1.0, 20.0, 0.0], [1.0, 22.0, 3.0]));
        let mut culler = VirtualOccluderCuller::new(UpAxis::Z);
        assert!(!left(&scene, &cell, &mut culler).contains(&behind), "the house hides");
        set(&mut scene, house);
        assert!(left(&scene, &cell, &mut culler).contains(&behind), "way {way}: the house may be absent");
    }
}
