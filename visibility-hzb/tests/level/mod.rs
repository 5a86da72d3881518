//! Occluders of a level: the view ray through every sampled point of a covered pixel meets a triangle of the
//! level no farther than the pixel's depth key; and what a wall of many pieces hides.

use crate::common::{Face, faces, occluder, scene, view};
use crate::rays::{check, room, sheets};
use std::sync::Arc;
use visibility_core::glam::{Affine3A, DMat4, DVec3, Vec3};
use visibility_core::{
    Aabb, FrustumCuller, Object, ObjectId, OccluderMesh, OcclusionMap, Pipeline, Pose, Scene, View,
    VisibleSet, geometry::Plane, occlusion::Preparation, simd::Simd, view::Window,
};
use visibility_hzb::{Hzb, HzbCuller};
use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle};
use visibility_testing::Random;
use visibility_testing::allocations::ALLOCATIONS;
use visibility_testing::job_systems::{Reversed, for_each_job_system};

/// Returns the two triangles of the quadrilateral `a`, `b`, `c`, `d`.
fn quad([a, b, c, d]: [Vec3; 4]) -> [[Vec3; 3]; 2] {
    [[a, b, c], [a, c, d]]
}

/// Returns the triangles of a box, or of a room if `inwards`: with their fronts inside.
fn cuboid(bounds: &Aabb, inwards: bool) -> Vec<[Vec3; 3]> {
    let mesh = OccluderMesh::cuboid(bounds).unwrap();
    let mut triangles: Vec<_> =
        mesh.triangles().iter().map(|t| t.map(|i| mesh.positions()[i as usize])).collect();
    if inwards {
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    triangles
}

/// Returns a floor of `cells` x `cells` squares around the origin, `size` metres wide, some of which are
/// divided in two strips (T-junctions) or missing, or have a corner a little off the plane. Walls stand on
/// some of their sides.
fn ground(random: &mut Random, cells: usize, size: f32) -> Vec<[Vec3; 3]> {
    let step = size / cells as f32;
    let at = |i: usize, j: usize| Vec3::new(i as f32 * step - size * 0.5, j as f32 * step - size * 0.5, 0.0);
    let mut triangles = Vec::new();
    for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
        let [a, b, c, mut d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        match random.below(8) {
            0 => continue,
            1 => {
                let (p, q) = ((a + b) * 0.5, (d + c) * 0.5);
                triangles.extend(quad([a, p, q, d]));
                triangles.extend(quad([p, b, c, q]));
                continue;
            }
            2 => d.z += [1e-6, 1e-4, 0.3][random.below(3)],
            3 => triangles.extend(quad([b, c, c + Vec3::Z * 2.0, b + Vec3::Z * 2.0])),
            _ => {}
        }
        triangles.extend(quad([a, b, c, d]));
    }
    triangles
}

/// Returns a bumpy ground around the origin, or one that is bent round an axis as the walls of towers and
/// tunnels are: `cells` x `cells` quadrilaterals that share their corners, some of them missing.
fn bumpy(random: &mut Random, cells: usize, size: f32) -> Vec<[Vec3; 3]> {
    let bumps = random.fine_range(0.0, 1.5) as f32 * size / cells as f32;
    let turn = if random.one_in(2) { 0.0 } else { random.fine_range(-6.0, 6.0) as f32 / size };
    let at: Vec<Vec3> = (0..(cells + 1) * (cells + 1))
        .map(|k| {
            let [x, y] = [k % (cells + 1), k / (cells + 1)].map(|i| (i as f32 / cells as f32 - 0.5) * size);
            let z = random.fine_range(-0.5, 0.5) as f32 * bumps;
            if turn == 0.0 {
                return Vec3::new(x, y, z);
            }
            let radius = 1.0 / turn + z;
            Vec3::new(radius * (x * turn).sin(), y, 1.0 / turn - radius * (x * turn).cos())
        })
        .collect();
    (0..cells * cells)
        .filter(|_| !random.one_in(12))
        .flat_map(|k| {
            let a = k / cells * (cells + 1) + k % cells;
            quad([a, a + 1, a + cells + 2, a + cells + 1].map(|i| at[i]))
        })
        .collect()
}

/// Returns a random level: rooms, boxes that touch, sheets, grounds, curved walls. Triangles of the same
/// level hide from one side or from both.
pub(crate) fn triangles(random: &mut Random) -> Vec<LevelTriangle> {
    let mut out = Vec::new();
    let mut add = |random: &mut Random, triangles: Vec<[Vec3; 3]>| {
        let sides = random.below(3);
        for corners in triangles {
            let two_sided = if sides == 2 { random.one_in(2) } else { sides == 1 };
            out.push(LevelTriangle { corners, two_sided });
        }
    };
    for _ in 0..random.below(3) + 1 {
        let of = |occluders: Vec<crate::common::Occluder>| {
            let faces = faces(&occluders);
            faces.iter().map(|face| face.corners.map(|p| p.as_vec3())).collect::<Vec<_>>()
        };
        let own = match random.below(9) {
            0 => of(sheets(random)),
            1 => of(room(random)),
            2 => {
                let middle = random.vec3(-3.0, 3.0);
                cuboid(
                    &Aabb::new(middle - random.vec3(0.5, 12.0), middle + random.vec3(0.5, 12.0)),
                    random.one_in(2),
                )
            }
            3 => {
                let (cells, size) = (random.below(6) + 1, random.fine_range(2.0, 60.0) as f32);
                ground(random, cells, size)
            }
            4..=6 => {
                let (cells, size) = (random.below(12) + 1, random.fine_range(2.0, 60.0) as f32);
                bumpy(random, cells, size)
            }
            _ => of((0..random.below(4) + 1).map(|_| occluder(random)).collect()),
        };
        add(random, own);
    }
    out
}

/// Returns triangles as faces to cast rays at.
pub(crate) fn as_faces(triangles: &[LevelTriangle]) -> Vec<Face> {
    let face = |t: &LevelTriangle| Face { corners: t.corners.map(|p| p.as_dvec3()), one_sided: !t.two_sided };
    triangles.iter().map(face).collect()
}

fn level(triangles: &[LevelTriangle], settings: LevelSettings) -> Arc<LevelOccluders> {
    Arc::new(LevelOccluders::new(triangles, settings).unwrap())
}

/// Returns a view from a place among the triangles: in the corner of a room, on the ground, beside a wall.
/// Some pictures are mirrored.
pub(crate) fn view_within(random: &mut Random, triangles: &[LevelTriangle]) -> View {
    let view = upright_view_within(random, triangles);
    if !random.one_in(4) {
        return view;
    }
    let m = view.clip_from(view.origin());
    let m = DMat4::from_cols(-m.row(0), m.row(1), m.row(2), m.row(3)).transpose();
    View::from_clip_from_world(m, view.depth()).unwrap().relative_to(view.origin()).unwrap()
}

fn upright_view_within(random: &mut Random, triangles: &[LevelTriangle]) -> View {
    let [a, b, c] = triangles[random.below(triangles.len())].corners.map(|p| p.as_dvec3());
    let normal = (b - a).cross(c - a).normalize_or(DVec3::Z);
    let beside = random.fine_range(-2.0, 2.0) * [1.0, 1e-2, 1e-4][random.below(3)];
    let eye = a + (b - a) * random.fine_unit() + (c - a) * 0.5 * random.fine_unit() + normal * beside;
    let towards =
        if random.one_in(2) { random.direction() } else { b - a + normal * 0.1 * random.fine_unit() };
    let mut pose = Pose::look_at(eye, eye + towards.normalize_or(DVec3::X), random.direction());
    if random.one_in(4) {
        // Along an axis, so that some edges are level and some upright.
        pose = Pose::look_at(eye, eye + random.pick(&[DVec3::X, DVec3::NEG_Y]), DVec3::Z);
    }
    let near = [1e-3, 0.02, 0.3][random.below(3)];
    if random.one_in(5) {
        let window = Window { left: -4.0, right: 5.0, bottom: -3.0, top: 2.5 };
        return View::orthographic(pose, window, near - 1.0, 60.0).unwrap();
    }
    let view = View::perspective(pose, random.fine_range(0.3, 2.4), 1.6, near, f64::INFINITY).unwrap();
    if random.one_in(6) {
        // A near plane that is tilted, as for mirrors: some points beyond it, beside the picture, are behind
        // the eye.
        let m = view.clip_from(view.origin());
        let [x, y, z, w] = [m.row(0), m.row(1), m.row(2), m.row(3)];
        let tilted = z + x * random.fine_range(-0.3, 0.3) + y * random.fine_range(-0.15, 0.15);
        let m = DMat4::from_cols(x, y, tilted, w).transpose();
        let oblique = View::from_clip_from_world(m, view.depth()).unwrap();
        return oblique.relative_to(view.origin()).unwrap();
    }
    view
}

/// Casts rays at random levels until `samples` rays are cast.
fn cast(seed: u64, samples: u64) {
    let mut random = Random(seed);
    let (mut cast, mut pixels, mut rounds) = (0, 0, 0);
    while cast < samples {
        let triangles = triangles(&mut random);
        if triangles.is_empty() {
            continue;
        }
        let bulge = [0.0, 0.03, 0.1, 0.3][random.below(4)];
        let settings = LevelSettings::default().with_bulge(bulge);
        let settings = match random.below(3) {
            0 => settings.with_max_cluster_edges(8),
            1 => settings.with_flatness([1e-5, 1e-3][random.below(2)]),
            _ => settings,
        };
        let level = level(&triangles, settings.with_kept_area(1.0));
        let shift = if random.one_in(4) { random.vector(1e5).round() } else { DVec3::ZERO };
        let size = [[64, 36], [33, 57], [200, 120], [400, 48]][random.below(4)];
        let mut hzb = Hzb::new(size[0], size[1]).unwrap().with_level(level, shift);
        let faces = as_faces(&triangles);
        for _ in 0..4 {
            let view =
                if random.one_in(3) { view(&mut random) } else { view_within(&mut random, &triangles) };
            // The level stays where it is in the world, wherever the scene's origin is.
            let origin = if random.one_in(2) { shift } else { shift + random.vector(1e3) };
            let shifted = view.relative_to(view.origin() + shift).unwrap();
            if random.one_in(2) {
                hzb.begin_within(&shifted, origin, f32::INFINITY, Some(&Reversed));
            } else {
                hzb.begin(&shifted, origin);
            }
            hzb.flush();
            let [s, p] = check(&faces, &view, &hzb, &mut random, &format!("seed {seed}, round {rounds}"));
            cast += s;
            pixels += p;
        }
        rounds += 1;
        assert!(rounds < 100_000, "too little is covered: {pixels} pixels");
    }
    println!("{rounds} levels, {pixels} covered pixels, {cast} rays");
}

#[test]
fn pixels_that_a_level_covers_are_covered_and_no_farther_than_they_say() {
    cast(31, 3_000_000);
}

#[test]
#[ignore = "takes minutes"]
fn pixels_that_many_levels_cover_are_covered() {
    for seed in 100..110 {
        cast(seed, 50_000_000);
    }
}

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
        let mut hzb = Hzb::new(120, 80).unwrap().with_level(level, DVec3::ZERO);
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

/// The eye between the faces of a polygon that is not quite flat sees through it: the polygon hides nothing.
/// Nor does it so close to the polygon that a ray might meet a face before the near plane.
#[test]
fn a_polygon_around_the_eye_hides_nothing() {
    let flat = LevelSettings::default().with_flatness(0.01);
    let covered = cast_beside_bumps(400, 0.05, 0.3, [1e-4, 1e-2, 0.1], flat);
    assert!(covered > 1000, "{covered} pixels are covered");
}

/// Returns the bits of the depth keys of a buffer of `width` by `height` pixels.
fn pixels(map: &Hzb, width: usize, height: usize) -> Vec<u32> {
    let at = (0..height).flat_map(|row| (0..width).map(move |column| (column, row)));
    at.map(|(column, row)| map.depth_key(column, row).to_bits()).collect()
}

/// A level that is drawn in bands gives the same pixels, and a pipeline the same objects, with any job
/// system, and nearly the pixels of a level that is drawn as a whole. Occluders of the scene are drawn over
/// it. A warm frame allocates nothing.
#[test]
fn job_systems_agree_and_bands_lose_next_to_nothing() {
    let mut random = Random(35);
    let is_covered = |&&key: &&u32| f32::from_bits(key) > f32::NEG_INFINITY;
    let (mut whole, mut banded, mut hidden) = (0, 0, 0);
    for round in 0..30 {
        let triangles = triangles(&mut random);
        let level = level(&triangles, LevelSettings::default());
        let mut scene = scene(&mut random, 20);
        for _ in 0..6000 {
            let middle = random.vec3(-20.0, 20.0);
            scene.insert(Aabb::new(middle - 0.1, middle + 0.1));
        }
        let size = [[200, 120], [64, 16], [90, 333]][round % 3];
        let mut map = Hzb::new(size[0], size[1]).unwrap().with_level(level, DVec3::ZERO);
        let pixels = |map: &Hzb| pixels(map, size[0], size[1]);
        let make = |map: &Hzb| {
            let culler = HzbCuller::new(map.clone()).with_price(if round % 2 == 0 { 0 } else { 24 });
            (Pipeline::new().with(FrustumCuller::new()).with(culler), VisibleSet::new())
        };
        for _ in 0..3 {
            let view = view_within(&mut random, &triangles);
            map.begin(&view, DVec3::ZERO);
            whole += pixels(&map).iter().filter(is_covered).count();
            map.begin_within(&view, DVec3::ZERO, f32::INFINITY, Some(&Reversed));
            let before = ALLOCATIONS.get();
            map.begin_within(&view, DVec3::ZERO, f32::INFINITY, Some(&Reversed));
            assert_eq!(ALLOCATIONS.get(), before, "round {round}");
            let first = pixels(&map);
            banded += first.iter().filter(is_covered).count();
            let mut answer = None;
            for_each_job_system(|name, jobs| {
                map.begin_within(&view, DVec3::ZERO, f32::INFINITY, Some(jobs));
                assert!(pixels(&map) == first, "round {round}: other pixels with {name}");
                let (mut pipeline, mut visible) = make(&map);
                let stats = pipeline.cull_on(jobs, &scene, &view, &mut visible);
                let own = (stats, visible.ids(&scene).to_vec());
                hidden += pipeline.stages().next().unwrap().1.visible - stats.visible;
                assert!(
                    *answer.get_or_insert(own.clone()) == own,
                    "round {round}: other objects with {name}"
                );
            });
        }
    }
    assert!(banded * 1000 >= whole * 995, "{banded} pixels in bands, {whole} as a whole");
    assert!(whole > 100_000 && hidden > 10_000, "{whole} pixels are covered, {hidden} objects hidden");
}

/// A polygon that is far from flat hides nothing where its faces may reach through the near plane, inside its
/// outline or where it is cut.
#[test]
fn the_near_plane_cuts_faces_of_polygons_that_are_not_flat() {
    let bulging = LevelSettings::default().with_bulge(0.3);
    let covered = cast_beside_bumps(150, 1.0, 3.0, [0.1, 0.5, 1.5], bulging);
    assert!(covered > 100_000, "{covered} pixels are covered");
}

/// The back of a ramp that is one polygon with the level ground beside it, which hides from its front alone,
/// hides nothing from an eye above all of the ground. The ramp leads up to a terrace, and is seen past the
/// terrace's near edge; or it rises towards the eye, wider than the ground behind it.
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
        let mut hzb = Hzb::new(200, 120).unwrap().with_level(level, DVec3::ZERO);
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

/// The peak of a low pyramid that is one polygon reaches through the near plane. All of the outline is beyond
/// it.
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
        let mut hzb = Hzb::new(64, 64).unwrap().with_level(level, DVec3::ZERO);
        // The near plane above the peak, then through it, with an outline beyond the guard band and within.
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

/// All instruction sets give the same pixels, and a warm frame allocates nothing.
#[test]
fn instruction_sets_agree_and_warm_frames_allocate_nothing() {
    let mut random = Random(34);
    let mut covered = 0;
    let pixels = |map: &Hzb| pixels(map, 200, 120);
    for round in 0..40 {
        let triangles = triangles(&mut random);
        let level = level(&triangles, LevelSettings::default().with_max_cluster_edges([16, 96][round % 2]));
        let new = Hzb::new(200, 120).unwrap().with_level(level, DVec3::ZERO);
        let mut maps: Vec<Hzb> = Simd::available().map(|simd| new.clone().with_simd(simd)).collect();
        let views: [View; 3] = std::array::from_fn(|_| view_within(&mut random, &triangles));
        for pass in 0..2 {
            for view in &views {
                for map in &mut maps {
                    let before = ALLOCATIONS.get();
                    map.begin(view, DVec3::ZERO);
                    map.flush();
                    assert!(pass == 0 || ALLOCATIONS.get() == before, "round {round}");
                }
                let first = pixels(&maps[0]);
                covered += first.iter().filter(|&&key| f32::from_bits(key) > f32::NEG_INFINITY).count();
                assert!(maps.iter().all(|map| pixels(map) == first), "round {round}");
            }
        }
    }
    assert!(covered > 100_000, "{covered} pixels are covered");
}

/// Returns the number of `hidden` boxes that a pipeline with a level of `triangles` reports from `view`.
fn reported(triangles: &[LevelTriangle], boxes: &[Aabb], view: &View) -> usize {
    let mut scene = Scene::new();
    let ids: Vec<ObjectId> = scene.insert_batch(boxes.iter().copied());
    let hzb = Hzb::default().with_level(level(triangles, LevelSettings::default()), DVec3::ZERO);
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(HzbCuller::new(hzb));
    let mut visible = VisibleSet::new();
    pipeline.cull(&scene, view, &mut visible);
    ids.iter().filter(|&&id| visible.contains(&scene, id)).count()
}

/// A wall of closed panels side by side, as kits have it, hides what one wall hides, whatever its panels'
/// width.
#[test]
fn a_wall_of_panels_hides_what_one_wall_hides() {
    let boxes: Vec<Aabb> = (0..50)
        .map(|i| {
            let middle = Vec3::new(20.0 + (i / 10) as f32 * 4.0, (i % 10) as f32 * 2.0 - 9.0, 0.0);
            Aabb::new(middle - 0.9, middle + 0.9)
        })
        .collect();
    let pose = Pose::look_at(DVec3::new(-5.0, 0.3, 0.2), DVec3::new(10.0, 0.0, 0.0), DVec3::Z);
    let view = View::perspective(pose, 1.2, 16.0 / 9.0, 0.1, f64::INFINITY).unwrap();
    for panels in [1, 2, 5, 16, 40, 80] {
        let width = 40.0 / panels as f32;
        let triangles: Vec<LevelTriangle> = (0..panels)
            .flat_map(|i| {
                let y = i as f32 * width - 20.0;
                cuboid(&Aabb::from_arrays([10.0, y, -10.0], [10.3, y + width, 10.0]), false)
            })
            .map(|corners| LevelTriangle { corners, two_sided: false })
            .collect();
        assert_eq!(reported(&triangles, &boxes, &view), 0, "{panels} panels");
    }
}

/// A house of one mesh with thick walls hides what is in it, seen from the street: the far walls of the house
/// hold no pixel of its front back. At the corner where three of its sides meet, a pixel stays bare, and what
/// is behind that may be reported.
#[test]
fn a_house_of_one_mesh_hides_what_is_in_it() {
    let wall = |low: [f32; 3], high: [f32; 3]| cuboid(&Aabb::from_arrays(low, high), false);
    let walls = [
        wall([0.0, 0.0, 0.0], [8.0, 0.3, 3.0]),
        wall([0.0, 5.7, 0.0], [8.0, 6.0, 3.0]),
        wall([0.0, 0.3, 0.0], [0.3, 5.7, 3.0]),
        wall([7.7, 0.3, 0.0], [8.0, 5.7, 3.0]),
        wall([0.0, 0.0, 3.0], [8.0, 6.0, 3.2]),
    ];
    let triangles: Vec<LevelTriangle> =
        walls.concat().into_iter().map(|corners| LevelTriangle { corners, two_sided: false }).collect();
    let boxes: Vec<Aabb> = (0..20)
        .map(|i| {
            let low = Vec3::new(0.6 + (i % 5) as f32 * 1.4, 0.6 + (i / 5) as f32 * 1.2, 0.1);
            Aabb::new(low, low + Vec3::new(1.0, 1.0, 2.5))
        })
        .collect();
    let eyes = [[4.0, -9.0, 1.7], [-7.0, -5.0, 1.7], [14.0, 3.0, 1.0], [-4.0, 12.0, 6.0]];
    for (eye, most) in eyes.into_iter().zip([0, 0, 0, 6]) {
        let eye = DVec3::from_array(eye);
        let view = View::perspective(
            Pose::look_at(eye, DVec3::new(4.0, 3.0, 1.5), DVec3::Z),
            1.1,
            16.0 / 9.0,
            0.1,
            f64::INFINITY,
        );
        let reported = reported(&triangles, &boxes, &view.unwrap());
        assert!(reported <= most, "from {eye}: {reported} of 20 boxes are reported, expected at most {most}");
    }
}

/// What a clip plane of the view cuts hides nothing.
#[test]
fn what_a_clip_plane_cuts_hides_nothing() {
    let triangles: Vec<LevelTriangle> = quad([
        Vec3::new(10.0, -20.0, -20.0),
        Vec3::new(10.0, 20.0, -20.0),
        Vec3::new(10.0, 20.0, 20.0),
        Vec3::new(10.0, -20.0, 20.0),
    ])
    .map(|corners| LevelTriangle { corners, two_sided: true })
    .to_vec();
    let boxes = [Aabb::from_arrays([20.0, -1.0, -1.0], [21.0, 1.0, 1.0])];
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    assert_eq!(reported(&triangles, &boxes, &view), 0, "boxes reported behind the uncut wall");
    for (x, count) in [(9.0, 0), (11.0, 1), (10.0, 1)] {
        let plane = Plane::through(DVec3::X * x, DVec3::X);
        let cut = view.with_clip_planes(&[plane]).unwrap();
        assert_eq!(reported(&triangles, &boxes, &cut), count, "cut at {x}");
    }
}

/// Beside a level, occluders that are not in it are drawn, and those in it are not drawn again.
#[test]
fn a_door_beside_a_level_is_drawn_and_the_level_is_not_drawn_again() {
    let mut scene = Scene::new();
    let mut add = |bounds: Aabb| {
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        scene.set_triangles(id, cuboid(&bounds, false)).unwrap();
        id
    };
    add(Aabb::from_arrays([10.0, -20.0, -20.0], [10.3, -1.0, 20.0]));
    add(Aabb::from_arrays([10.0, 1.0, -20.0], [10.3, 20.0, 20.0]));
    let door = add(Aabb::from_arrays([10.0, -1.0, -20.0], [10.2, 1.0, 20.0]));
    let behind = scene.insert_batch((0..40).map(|i| {
        let middle = Vec3::new(20.0 + i as f32, (i % 8) as f32 * 0.2 - 0.8, 0.0);
        Aabb::new(middle - 0.1, middle + 0.1)
    }));
    scene.prepare_occluders(&Preparation { two_sided: true, ..Preparation::default() });
    let level = LevelOccluders::of_scene(&scene, |id| id != door, LevelSettings::default()).unwrap();
    assert_eq!(level.objects().len(), 2, "objects of the level: two walls without the door");
    let hzb = Hzb::default().with_level(Arc::new(level), DVec3::ZERO);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(HzbCuller::new(hzb));
    let mut visible = VisibleSet::new();
    for (shut, drawn) in [(true, 1), (false, 0), (true, 1)] {
        scene.set_occluder(door, shut).unwrap();
        pipeline.cull(&scene, &view, &mut visible);
        assert_eq!(pipeline.stages().last().unwrap().1.occluders, drawn, "shut: {shut}");
        let seen = behind.iter().filter(|&&id| visible.contains(&scene, id)).count();
        assert_eq!(seen == 0, shut, "{seen} of 40 objects behind the door are reported");
    }
}

/// A level is drawn nearest first as far as the work of a frame allows. What is not drawn hides nothing.
#[test]
fn a_level_is_drawn_as_far_as_its_work_is_paid() {
    let wall = |i: usize| {
        let (x, y) = (10.0 + i as f32 * 5.0, i as f32 * 3.0 - 15.0);
        cuboid(&Aabb::from_arrays([x, y, -1.0], [x + 0.3, y + 2.5, 1.0]), false)
    };
    let triangles: Vec<LevelTriangle> =
        (0..10).flat_map(wall).map(|corners| LevelTriangle { corners, two_sided: true }).collect();
    let level = level(&triangles, LevelSettings::default().with_max_cluster_edges(4));
    let mut hzb = Hzb::default().with_level(level, DVec3::ZERO);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, f64::INFINITY).unwrap();
    let mut covered = |work: f32| {
        let spent = hzb.begin_within(&view, DVec3::ZERO, work, None);
        let pixels = (0..512).flat_map(|x| (0..288).map(move |y| (x, y)));
        let count = pixels.filter(|&(x, y)| hzb.depth_key(x, y) > f32::NEG_INFINITY).count();
        // The last cluster is drawn as a whole: here one face.
        assert!(spent <= work + 100.0, "{spent} of {work}");
        (count, spent)
    };
    assert_eq!(covered(0.0), (0, 0.0), "nothing is drawn for no work");
    let (all, most) = covered(f32::INFINITY);
    let some: Vec<usize> = (1..5).map(|i| covered(most * i as f32 / 5.0).0).collect();
    assert!(0 < some[0] && some.is_sorted() && some[3] <= all && some[0] < all, "{some:?} of {all}");
}

/// Tests that the z-buffer reports the occluders of a wall of panels, and not once a level joins them.
#[test]
fn seams_are_reported_unless_a_level_closes_them() {
    let mut scene = Scene::new();
    let mut add = |[x, y, z]: [f32; 3], [dx, dy, dz]: [f32; 3]| {
        let bounds = Aabb::from_arrays([x, y, z], [x + dx, y + dy, z + dz]);
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
        scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
    };
    // Twelve panels of a wall. A floor that only touches them, and boxes on it: a house, its copy in the same
    // place, one a hand away, and a wall that stands flush at a right angle.
    (0..12).for_each(|i| add([10.0, (i % 6) as f32 * 2.0, (i / 6) as f32 * 3.0], [0.2, 2.0, 3.0]));
    add([0.0, 0.0, -0.1], [10.2, 12.0, 0.1]);
    add([2.0, 2.0, 0.0], [2.0, 2.0, 3.0]);
    add([2.0, 2.0, 0.0], [2.0, 2.0, 3.0]);
    add([4.1, 2.0, 0.0], [2.0, 2.0, 3.0]);
    add([7.0, 0.0, 0.0], [3.0, 0.2, 6.0]);
    let lacks = |hzb: Hzb| {
        let mut lacks = Vec::new();
        Pipeline::new().with(HzbCuller::new(hzb)).for_each_lack(&scene, |_, lack| lacks.push(lack));
        lacks
    };
    let seams = lacks(Hzb::default());
    assert!(seams.len() == 1 && seams[0].count == 12, "{seams:?}");
    let nothing = level(&[], LevelSettings::default());
    assert_eq!(
        lacks(Hzb::default().with_level(nothing.clone(), DVec3::ZERO)),
        seams,
        "an empty level closes no seam"
    );
    let wall = quad([[0.0, 0.0], [2.0, 0.0], [2.0, 3.0], [0.0, 3.0]].map(|[y, z]| Vec3::new(9.0, y, z)));
    let wall = wall.map(|corners| LevelTriangle { corners, two_sided: true });
    let level = level(&wall, LevelSettings::default());
    assert!(
        lacks(Hzb::default().with_level(level.clone(), DVec3::ZERO)).is_empty(),
        "a level closes the seams"
    );
    // A level is occluders enough.
    let lack_of = |hzb: Hzb, scene: &Scene| {
        let mut count = 0;
        hzb.for_each_lack(scene, &mut |_| count += 1);
        count
    };
    let mut bare = Scene::new();
    bare.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
    assert_eq!(lack_of(Hzb::default(), &bare), 1, "the scene lacks occluders");
    assert_eq!(
        lack_of(Hzb::default().with_level(nothing, DVec3::ZERO), &bare),
        1,
        "an empty level is no occluder"
    );
    assert_eq!(
        lack_of(Hzb::default().with_level(level, DVec3::ZERO), &bare),
        0,
        "the level's wall is an occluder"
    );
}

/// An edge that two polygons share ends exactly as far below the last row of pixels of a row of tiles as
/// edges are near: the lower polygon does not reach these tiles, the upper one comes near the edge there.
#[test]
fn a_shared_edge_beside_a_row_of_tiles_covers_nothing_nearer_than_its_polygons() {
    let row = 64.0 + 7.0 / 128.0;
    let [left, right] = [-100.0, 100.0];
    let seam = [Vec3::new(200.0, left, 128.0 - row), Vec3::new(200.0, right, 128.0 - row)];
    let upper = quad([seam[0], seam[1], Vec3::new(200.0, right, 120.0), Vec3::new(200.0, left, 120.0)]);
    let lower = quad([Vec3::new(150.0, left, 0.0), Vec3::new(150.0, right, 0.0), seam[1], seam[0]]);
    let triangles = [upper, lower].concat().into_iter();
    let triangles: Vec<_> = triangles.map(|corners| LevelTriangle { corners, two_sided: true }).collect();
    let level = level(&triangles, LevelSettings::default().with_bulge(0.0));
    assert_eq!(level.polygons().len(), 2, "the two slopes are two polygons");
    let mut hzb = Hzb::new(512, 256).unwrap().with_level(level, DVec3::ZERO);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let window = Window { left: -256.0, right: 256.0, bottom: -128.0, top: 128.0 };
    let view = View::orthographic(pose, window, 0.0, 1024.0).unwrap();
    hzb.begin(&view, DVec3::ZERO);
    hzb.flush();
    let before = Aabb::from_arrays([180.0, -10.0, 66.0], [190.0, 10.0, 70.0]);
    assert_ne!(hzb.test(&before), visibility_core::occlusion::Occlusion::Hidden, "a box before the seam");
    let [_, pixels] = check(&as_faces(&triangles), &view, &hzb, &mut Random(38), "a seam");
    assert!(pixels > 10_000, "{pixels} pixels are covered");
}

/// Walls so near to the eye that edges of theirs leave the guard band at the right, above and below: what is
/// left of the outline ends far to the left of the pixels that the wall covers.
#[test]
fn a_wall_that_leaves_the_guard_band_is_no_nearer_than_it_is() {
    let mut random = Random(47);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let (mut covered, mut whole) = (0, 0);
    for round in 0..300 {
        // The wall extends to the right from near the axis of the view, mostly to beyond the guard band.
        let normal = DVec3::new(1.0, random.fine_range(-0.3, 0.3), random.fine_range(-0.3, 0.3)).normalize();
        let distance = random.fine_range(0.01, 0.1);
        let along = normal.cross(DVec3::Z).normalize() * distance;
        let [left, right] = [random.fine_range(-1.0, 1.0), random.fine_range(4.0, 100.0)];
        let [below, above] = [0; 2].map(|_| DVec3::Z * distance * random.fine_range(4.0, 100.0));
        let foot = normal * distance;
        let corners = [
            foot + along * left - below,
            foot + along * right - below,
            foot + along * right + above,
            foot + along * left + above,
        ];
        let wall = quad(corners.map(|p| {
            // On the plane, whatever the height.
            (p - normal * (normal.dot(p) - distance)).as_vec3()
        }));
        let triangles: Vec<_> =
            wall.into_iter().map(|corners| LevelTriangle { corners, two_sided: true }).collect();
        let view = View::perspective(pose, 1.57, 1.0, 1e-3, f64::INFINITY).unwrap();
        let mut hzb = Hzb::new(64, 64)
            .unwrap()
            .with_level(level(&triangles, LevelSettings::default().with_kept_area(1.0)), DVec3::ZERO);
        hzb.begin(&view, DVec3::ZERO);
        hzb.flush();
        let [_, pixels] = check(&as_faces(&triangles), &view, &hzb, &mut random, &format!("round {round}"));
        covered += pixels;
        whole += u64::from(hzb.depth_key(63, 32) > 0.0);
    }
    assert!(covered > 300_000 && whole > 150, "{covered} pixels covered, {whole} walls reach the right side");
}
