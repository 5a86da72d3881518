//! Occluders of a level: the view ray through every sampled point of a covered pixel meets a triangle of the
//! level no farther than the pixel's depth key.

mod hidden_boxes;
mod near_plane;
mod same_answers;

use crate::common::{Face, faces, occluder, view};
use crate::rays::{check, room, sheets};
use std::sync::Arc;
use visibility_core::glam::{DMat4, DVec3, Vec3};
use visibility_core::view::Window;
use visibility_core::{Aabb, OccluderMesh, OcclusionMap, Pose, View};
use visibility_hzb::Hzb;
use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle};
use visibility_testing::job_systems::Reversed;
use visibility_testing::{Random, judged};

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

/// Returns a floor of `cells` x `cells` squares around the origin, `size` metres wide, some of them divided
/// into two strips (T-junctions), missing, or with a corner a little off the plane. Walls stand on some sides
/// of the squares.
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

/// Returns a bumpy ground around the origin, or a surface bent round an axis like the wall of a tower or
/// tunnel: `cells` x `cells` quadrilaterals that share their corners, some of them missing.
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

/// Returns a random level: rooms, boxes that touch, sheets, grounds, curved walls. In one level, triangles
/// occlude from one side or from both.
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

/// Returns a view from a place among the triangles: in the corner of a room, on the ground, or beside a wall.
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
        // The camera looks along an axis, so that some edges are horizontal and some vertical.
        pose = Pose::look_at(eye, eye + random.pick(&[DVec3::X, DVec3::NEG_Y]), DVec3::Z);
    }
    let near = [1e-3, 0.02, 0.3][random.below(3)];
    if random.one_in(5) {
        let window = Window { left: -4.0, right: 5.0, bottom: -3.0, top: 2.5 };
        return View::orthographic(pose, window, near - 1.0, 60.0).unwrap();
    }
    let view = View::perspective(pose, random.fine_range(0.3, 2.4), 1.6, near, f64::INFINITY).unwrap();
    if random.one_in(6) {
        // A tilted near plane, as for mirrors: some points beyond it, outside the picture, are behind the
        // eye.
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
        let mut hzb =
            Hzb::new(size[0], size[1]).unwrap().with_min_polygon_area(16.0).with_level(level, shift);
        let faces = as_faces(&triangles);
        for _ in 0..4 {
            let view =
                if random.one_in(3) { view(&mut random) } else { view_within(&mut random, &triangles) };
            // The level stays in its place in the world, wherever the scene's origin is.
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
    judged(cast);
}

#[test]
fn pixels_that_a_level_covers_are_covered_and_no_farther_than_they_say() {
    cast(31, 3_000_000);
}

/// A shared edge ends exactly one slack below the last row of pixels of a row of tiles. The lower polygon
/// does not reach these tiles, while the upper polygon comes near the edge there. The seam must not get a
/// nearer depth key than its polygons have.
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
    let mut hzb = Hzb::new(512, 256).unwrap().with_min_polygon_area(16.0).with_level(level, DVec3::ZERO);
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

/// Walls so near to the eye that their edges leave the guard band at the right, above and below. The
/// remaining outline ends far to the left of the pixels that the wall covers, and must not make them nearer
/// than the wall is.
#[test]
fn a_wall_that_leaves_the_guard_band_is_no_nearer_than_it_is() {
    let mut random = Random(47);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let (mut covered, mut whole) = (0, 0);
    for round in 0..300 {
        // The wall extends to the right from near the axis of the view, mostly beyond the guard band.
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
            // Moves the vertex into the wall's plane along the normal, whatever its height.
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
