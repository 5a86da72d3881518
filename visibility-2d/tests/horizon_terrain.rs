//! Tests of ground as an occluder: what hills hide, what holes, tunnels and missing tiles leave visible, and
//! rays cast at hidden boxes, triangle by triangle.

use crate::common::{faces, is_blocked};
use visibility_2d::horizon::{HorizonCuller, HorizonOccluders, UpAxis};
use visibility_core::glam::{Affine3A, DVec3, Mat3, Quat, Vec3};
use visibility_core::scene::Triangle;
use visibility_core::{Aabb, Culler, Object, ObjectId, OccluderMesh, Pose, Scene, View, VisibleSet};
use visibility_testing::{Random, judged, told_enough};

/// Side of a quadrilateral of the ground, in metres.
const STEP: f32 = 2.0;

/// Makes ground with columns `columns` and rows from -`rows` to `rows` of quadrilaterals, two triangles each.
fn ground(columns: core::ops::Range<i16>, rows: i16, height: impl Fn(f32, f32) -> f32) -> Vec<Triangle> {
    let at = |x: i16, y: i16| {
        let (x, y) = (STEP * f32::from(x), STEP * f32::from(y));
        Vec3::new(x, y, height(x, y))
    };
    let quad = |x: i16, y: i16| {
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
        [[a, b, c], [a, c, d]]
    };
    columns.flat_map(|x| (-rows..rows).flat_map(move |y| quad(x, y))).collect()
}

/// Returns the height of a hill across the view, 6 m high at x = 20 m.
fn hill(x: f32, _: f32) -> f32 {
    (6.0 - 0.6 * (x - 20.0).abs()).max(0.0)
}

fn insert(scene: &mut Scene, triangles: &[Triangle], two_sided: bool, transform: Affine3A) -> ObjectId {
    let mesh = OccluderMesh::from_triangles(triangles).unwrap().with_two_sided(two_sided);
    let bounds = mesh.bounds().transformed(&transform);
    let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    let mesh = scene.add_mesh(mesh);
    scene.set_mesh(id, mesh, transform).unwrap();
    id
}

/// Boxes: behind the hill and lower, behind it and higher, in front of it.
const BOXES: [[[f32; 3]; 2]; 3] = [
    [[36.0, -1.0, 0.1], [38.0, 1.0, 3.0]],
    [[36.0, -1.0, 0.1], [38.0, 1.0, 14.0]],
    [[8.0, -1.0, 0.1], [9.0, 1.0, 1.0]],
];

/// Returns which of the boxes are seen by an eye at a height of 1.7 m that looks along x.
fn seen(
    tiles: &[Vec<Triangle>],
    two_sided: bool,
    near: f64,
    candidates: impl Fn(usize) -> bool,
) -> [bool; 3] {
    let mut scene = Scene::new();
    let boxes = BOXES.map(|[min, max]| scene.insert(Aabb::from_arrays(min, max)));
    let ids: Vec<ObjectId> =
        tiles.iter().map(|t| insert(&mut scene, t, two_sided, Affine3A::IDENTITY)).collect();
    let occluders = HorizonOccluders::new(&scene, UpAxis::Z);
    let view = view([0.0, 0.0, 1.7], near);
    let mut visible = VisibleSet::new();
    visible.retain(&scene, |id, _| ids.iter().position(|&tile| tile == id).is_none_or(&candidates));
    HorizonCuller::new(occluders.into()).cull(&scene, &view, &mut visible);
    boxes.map(|id| visible.contains(&scene, id))
}

fn view(eye: [f64; 3], near: f64) -> View {
    let eye = DVec3::from_array(eye);
    View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 1.0, 1.5, near, f64::INFINITY).unwrap()
}

const HIDDEN: [bool; 3] = [false, true, true];
const OPEN: [bool; 3] = [true; 3];

#[test]
fn a_hill_hides_what_is_behind_and_lower() {
    for two_sided in [false, true] {
        assert_eq!(
            seen(&[ground(-5..25, 20, hill)], two_sided, 0.1, |_| true),
            HIDDEN,
            "two-sided: {two_sided}: boxes behind the hill"
        );
    }
    assert_eq!(seen(&[ground(-5..25, 20, |_, _| 0.0)], true, 0.1, |_| true), OPEN, "a plain");
}

#[test]
fn tiles_of_one_ground_hide_together() {
    let tiles = [ground(-5..7, 20, hill), ground(7..9, 20, hill), ground(9..25, 20, hill)];
    assert_eq!(seen(&tiles, false, 0.1, |_| true), HIDDEN, "boxes behind the hill, in three tiles");
    // If the tile of the slope is missing, or was removed by an earlier stage, the eye looks below the crest.
    assert_eq!(
        seen(&[tiles[0].clone(), tiles[2].clone()], false, 0.1, |_| true),
        OPEN,
        "boxes behind the hill, without the tile of its slope"
    );
    assert_eq!(
        seen(&tiles, false, 0.1, |tile| tile != 1),
        OPEN,
        "boxes behind the hill, whose slope was taken out"
    );
    // The slope alone hides its own picture: the box is visible, since it stands above the slope's foot.
    let tiles = [ground(5..9, 20, hill), ground(9..10, 20, hill)];
    assert_eq!(seen(&tiles, false, 0.1, |_| true), OPEN, "from the middle of a slope");
}

#[test]
fn holes_and_turned_triangles_are_open() {
    let all = ground(-5..25, 20, hill);
    let at = |x: f32, y: f32| {
        let is_at = |t: &Triangle| {
            let middle = (t[0] + t[1] + t[2]) / 3.0;
            (middle.x - x).abs() < 1.0 && (middle.y - y).abs() < 1.0
        };
        all.iter().position(is_at).unwrap()
    };
    let hole = at(15.0, 0.5);
    let mut open = all.clone();
    open.remove(hole);
    assert_eq!(seen(&[open], true, 0.1, |_| true), OPEN, "a hole in the slope");
    let mut turned = all.clone();
    turned[hole].swap(0, 1);
    assert_eq!(seen(&[turned.clone()], false, 0.1, |_| true), OPEN, "a triangle that faces down");
    assert_eq!(seen(&[turned], true, 0.1, |_| true), HIDDEN, "both sides hide");
    let mut torn = all.clone();
    torn[hole] = torn[hole].map(|p| if p.z > 3.0 { p - Vec3::Z * 1e-3 } else { p });
    assert_eq!(seen(&[torn], true, 0.1, |_| true), OPEN, "a crack");
    // A hole far from the hill changes nothing.
    let mut open = all.clone();
    open.remove(at(15.0, 30.5));
    assert_eq!(seen(&[open], true, 0.1, |_| true), HIDDEN, "a hole beside what hides");
}

/// A mirroring transform keeps the fronts of triangles.
#[test]
fn mirrored_ground_hides_from_its_front() {
    let mirrored = Affine3A::from_mat3(Mat3::from_diagonal(Vec3::new(1.0, -1.0, 1.0)));
    let down: Vec<Triangle> = ground(-5..25, 20, hill).iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    for (two_sided, is_seen) in [(false, true), (true, false)] {
        let mut scene = Scene::new();
        let behind = scene.insert(Aabb::from_arrays(BOXES[0][0], BOXES[0][1]));
        insert(&mut scene, &down, two_sided, mirrored);
        let occluders = HorizonOccluders::new(&scene, UpAxis::Z);
        let mut visible = VisibleSet::new();
        HorizonCuller::new(occluders.into()).cull(&scene, &view([0.0, 0.0, 1.7], 0.1), &mut visible);
        assert_eq!(visible.contains(&scene, behind), is_seen, "two-sided: {two_sided}");
    }
}

/// A hill before the near plane is cut away, so it hides nothing.
#[test]
fn a_hill_before_the_near_plane_hides_nothing() {
    let tiles = [ground(-5..25, 20, hill)];
    assert_eq!(seen(&tiles, true, 4.0, |_| true), [false, true, true], "a near plane at 4 m");
    assert_eq!(seen(&tiles, true, 21.0, |_| true), OPEN, "a near plane behind the crest");
}

#[test]
fn from_below_and_behind_a_change_nothing_is_hidden() {
    let mut scene = Scene::new();
    let tile = insert(&mut scene, &ground(-5..25, 20, hill), true, Affine3A::IDENTITY);
    let cave = scene.insert(Aabb::from_arrays([36.0, -1.0, -4.0], [38.0, 1.0, -3.0]));
    let behind = scene.insert(Aabb::from_arrays(BOXES[0][0], BOXES[0][1]));
    let mut occluders = HorizonOccluders::new(&scene, UpAxis::Z);
    let is_seen = |scene: &Scene, occluders: &HorizonOccluders, height: f64| {
        let mut visible = VisibleSet::new();
        let view = view([0.0, 0.0, height], 0.1);
        HorizonCuller::new(occluders.clone().into()).cull(scene, &view, &mut visible);
        [cave, behind].map(|id| visible.contains(scene, id))
    };
    assert!(!is_seen(&scene, &occluders, 1.7)[1], "the box behind the hill, from above");
    assert!(is_seen(&scene, &occluders, -2.0)[0], "the box in the cave, from below");
    // The ground moves: before and after the occluders are synchronized.
    let (mesh, _) = scene.occluder(tile).unwrap();
    let mesh = mesh.clone();
    scene.set_local_bounds(tile, *mesh.bounds()).unwrap();
    let mesh = scene.add_mesh(mesh);
    scene.set_mesh(tile, mesh, Affine3A::from_translation(Vec3::Z * -20.0)).unwrap();
    assert_eq!(
        is_seen(&scene, &occluders, 1.7),
        [true; 2],
        "the ground has moved, and the occluders do not know"
    );
    occluders.sync(&scene);
    assert_eq!(is_seen(&scene, &occluders, 1.7), [true; 2], "the ground is 20 m lower");
}

/// Coordinates and transforms at the limits of `f32`: no panic, and a hill beside them still hides.
#[test]
fn hostile_ground_hides_nothing_more() {
    let bad = [f32::NAN, f32::INFINITY, f32::MAX, 1e-44, 1e30, 0.0];
    let eye = DVec3::new(0.0, 0.0, 1.7);
    let hides = |hostile: &[Triangle], transform: Affine3A| {
        let mut scene = Scene::new();
        let boxes = BOXES.map(|[min, max]| scene.insert(Aabb::from_arrays(min, max)));
        insert(&mut scene, &ground(-5..25, 20, hill), true, Affine3A::IDENTITY);
        let mesh = OccluderMesh::from_triangles(hostile).unwrap().with_two_sided(true);
        let bounds = mesh.bounds().transformed(&transform);
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        let mesh = scene.add_mesh(mesh);
        // If the scene refuses a transform, the object has no mesh.
        let _ = scene.set_mesh(id, mesh, transform);
        let occluders = HorizonOccluders::new(&scene, UpAxis::Z);
        let mut visible = VisibleSet::new();
        HorizonCuller::new(occluders.into()).cull(&scene, &view(eye.to_array(), 0.1), &mut visible);
        boxes.map(|id| visible.contains(&scene, id))
    };
    let low = ground(-5..5, 5, |x, y| 0.3 * (x + y).sin() - 9.0);
    for value in bad {
        for entry in 0..12 {
            let mut columns = Affine3A::IDENTITY.to_cols_array();
            columns[entry] = value;
            let seen = hides(&low, Affine3A::from_cols_array(&columns));
            assert!(seen[1] && seen[2], "{value} as entry {entry}");
        }
    }
    for scale in [1e-44, 1e-38, 1e-20, 1e18, 1e36] {
        let scaled: Vec<Triangle> = low.iter().map(|t| t.map(|p| p * scale)).collect();
        if OccluderMesh::from_triangles(&scaled).is_ok() {
            let seen = hides(&scaled, Affine3A::IDENTITY);
            assert!(seen[1] && seen[2], "scaled by {scale}");
        }
    }
}

/// Mesh of a tile with its transform.
struct Tile {
    triangles: Vec<Triangle>,
    two_sided: bool,
    transform: Affine3A,
}

/// Makes hilly ground in tiles with some faults: holes, reversed triangles, torn corners, moved or rotated
/// tiles, a deck above.
fn tiles(random: &mut Random) -> Vec<Tile> {
    let waves: [[f32; 4]; 3] = core::array::from_fn(|i| {
        let [a, b] = [random.range(-0.4, 0.4), random.range(-0.4, 0.4)];
        [a as f32, b as f32, random.range(0.0, 6.0) as f32, (3.0 / (i + 1) as f64 * random.unit()) as f32]
    });
    let rough = [0.0, 0.3, 2.0][random.below(3)];
    let noise: Vec<f32> = (0..64).map(|_| random.range(-rough, rough) as f32).collect();
    let height = |x: f32, y: f32| {
        let index = (x * 7.0 + y * 13.0).abs() as usize % noise.len();
        waves.iter().map(|[a, b, phase, size]| size * (a * x + b * y + phase).sin()).sum::<f32>()
            + noise[index]
    };
    let (half, rows) = (3 + random.below(9) as i16, 3 + random.below(9) as i16);
    let cut = random.below(2 * half as usize) as i16 - half;
    let mut all = vec![ground(-half..cut, rows, height), ground(cut..half, rows, height)];
    if random.below(4) == 0 {
        all.push(ground(-2..2, rows.min(5), |x, y| height(x, y) + 3.0));
    }
    let mirrored = Affine3A::from_mat3(Mat3::from_diagonal(Vec3::new(1.0, -1.0, 1.0)));
    let together = [Affine3A::IDENTITY, Affine3A::from_rotation_z(0.7), mirrored][random.below(3)];
    all.retain(|triangles| !triangles.is_empty());
    all.into_iter()
        .map(|mut triangles| {
            for _ in 0..[0, 0, 1, 4][random.below(4)] {
                let index = random.below(triangles.len());
                match random.below(4) {
                    0 if triangles.len() > 1 => drop(triangles.remove(index)),
                    1 => triangles[index].swap(0, 1),
                    2 => triangles[index][random.below(3)] += random.vec3(-0.5, 0.5),
                    _ => {
                        let [a, b, c] = triangles[index];
                        let middle = (a + b) * 0.5 + Vec3::Z * [0.0, 0.3][random.below(2)];
                        triangles[index] = [a, middle, c];
                        triangles.push([middle, b, c]);
                    }
                }
            }
            let moved = Affine3A::from_translation(random.vec3(-0.3, 0.3));
            let turned = Affine3A::from_quat(Quat::from_rotation_x(0.2));
            let transform = match random.below(6) {
                0 => moved,
                1 => turned,
                _ => together,
            };
            Tile { triangles, two_sided: random.below(2) == 0, transform }
        })
        .collect()
}

/// Returns a box to test: at a random place, or behind a corner of the ground.
fn target(random: &mut Random, eye: DVec3, tiles: &[Tile]) -> Aabb {
    let tile = &tiles[random.below(tiles.len())];
    let corner = tile.triangles[random.below(tile.triangles.len())][random.below(3)];
    let corner = tile.transform.transform_point3(corner).as_dvec3();
    let behind = if random.below(4) == 0 {
        random.vector(24.0) * DVec3::new(1.0, 1.0, 0.3)
    } else {
        corner + (corner - eye) * random.fine_range(0.0, 1.0)
    };
    let size = [1e-3f32, 0.1, 0.5][random.below(3)];
    let middle = behind.as_vec3() + random.vec3(-2.0, 2.0) * size;
    Aabb::new(middle - size, middle + size)
}

fn run(rounds: usize, seed: u64) -> [u64; 2] {
    let mut random = Random(seed);
    let [mut hidden, mut rays] = [0; 2];
    for round in 0..rounds {
        let all = tiles(&mut random);
        let eye = random.vec3(-20.0, 20.0).as_dvec3() * DVec3::new(1.0, 1.0, 0.3) + DVec3::Z * 2.0;
        let mut scene = Scene::new();
        let ids: Vec<ObjectId> =
            all.iter().map(|t| insert(&mut scene, &t.triangles, t.two_sided, t.transform)).collect();
        let targets: Vec<(ObjectId, Aabb)> = (0..40)
            .map(|_| target(&mut random, eye, &all))
            .map(|bounds| (scene.insert(bounds), bounds))
            .collect();
        // A tile that an earlier stage has removed is not drawn, so it must not occlude.
        let out = if random.below(4) == 0 { Some(random.below(all.len())) } else { None };
        let drawn = all.iter().enumerate().filter(|(i, _)| Some(*i) != out).map(|(_, tile)| tile);
        let drawn: Vec<_> = drawn
            .flat_map(|tile| faces(tile.triangles.iter().copied(), &tile.transform, tile.two_sided))
            .collect();
        let ahead = DVec3::new(random.unit() - 0.5, random.unit() - 0.5, 0.3 * (random.unit() - 0.5));
        let near = [0.01, 0.5, 3.0][random.below(3)];
        let fov = random.fine_range(0.3, 2.6);
        let pose = Pose::look_at(eye, eye + ahead, DVec3::Z);
        let view = View::perspective(pose, fov, 1.5, near, f64::INFINITY).unwrap();
        let columns = [8, 64, 360][random.below(3)];
        let occluders = HorizonOccluders::new(&scene, UpAxis::Z);
        let mut visible = VisibleSet::new();
        visible.retain(&scene, |id, _| out.is_none_or(|tile| ids[tile] != id));
        HorizonCuller::new(occluders.into()).with_columns(columns).cull(&scene, &view, &mut visible);
        let planes = view.planes(DVec3::ZERO);
        let near = (planes.as_slice()[4].plane.normal, planes.as_slice()[4].plane.offset);
        for (id, bounds) in targets {
            if visible.contains(&scene, id) {
                continue;
            }
            hidden += 1;
            for p in random.points_of(&bounds) {
                if planes.contains(p) {
                    rays += 1;
                    let is_blocked = is_blocked(eye, p, near, &drawn);
                    assert!(is_blocked, "seed {seed}, round {round}: {p} of {bounds:?} is seen from {eye}");
                }
            }
        }
    }
    [hidden, rays]
}

#[test]
fn what_the_ground_hides_no_ray_reaches() {
    let [hidden, rays] = run(1_000, 1);
    judged(rays);
    told_enough(hidden > 400 && rays > 5_000, format_args!("{hidden} boxes, {rays} rays are no test"));
}
