//! Degrees of visibility of a bake, held against rays of the test's own, and their file.

use miniz_oxide::deflate::compress_to_vec;
use miniz_oxide::inflate::decompress_to_vec;
use visibility_bake::{BakedSet, BakedSetError, DegreeSampler};
use visibility_core::glam::{DAffine3, DVec3, Vec3};
use visibility_core::pvs::{
    Pvs, PvsCuller, PvsTargets, SampledDegree, SampledDegrees, Viewcell, ViewcellId, Viewcells,
};
use visibility_core::scene::{SharedTriangles, Triangle};
use visibility_core::{Aabb, Accuracy, Culler, Object, Scene};
use visibility_testing::{Random, mend_header};

use SampledDegree::{Hardly, Partly, Unseen, Widely};

/// Offset in bytes of the compressed content in a file.
const COMPRESSED: usize = 48;

/// Returns a rectangle across the x axis, at `x`, from `low` to `high` in y and z.
fn upright(x: f32, low: [f32; 2], high: [f32; 2]) -> Vec<Triangle> {
    let corner = |y: f32, z: f32| Vec3::new(x, y, z);
    let [a, b, c, d] =
        [corner(low[0], low[1]), corner(high[0], low[1]), corner(high[0], high[1]), corner(low[0], high[1])];
    vec![[a, b, c], [a, c, d]]
}

fn insert(scene: &mut Scene, triangles: Vec<Triangle>, occluder: bool) -> u32 {
    let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for corner in triangles.iter().flatten() {
        (min, max) = (min.min(*corner), max.max(*corner));
    }
    let id = scene.insert(Object { occluder, ..Object::new(Aabb::new(min, max)) });
    scene.set_triangles(id, triangles).unwrap();
    id.index() as u32
}

fn cell() -> Viewcell {
    Viewcell::from_box(DVec3::new(0.0, -1.0, -1.0), DVec3::new(2.0, 1.0, 1.0))
}

/// Makes a wall at x = 5 with a slit, and tiles of random sizes at random places behind it.
fn slit(random: &mut Random) -> (Scene, Vec<u32>) {
    let mut scene = Scene::new();
    let wide = 0.06 + 0.26 * random.unit() as f32;
    for [low, high] in [[-40.0, -wide], [wide, 40.0]] {
        insert(&mut scene, upright(5.0, [low, -40.0], [high, 40.0]), true);
    }
    for i in 0..16 {
        let reach = if i % 4 == 0 { 12.0 } else { 3.0 };
        let size = 0.05 + 0.9 * (random.unit() as f32).powi(3);
        let low = [0; 2].map(|_| reach * (random.unit() as f32 - 0.5));
        insert(&mut scene, upright(7.0 + i as f32 * 0.25, low, low.map(|low| low + size)), i % 5 != 0);
    }
    (scene, (0..18).collect())
}

/// Returns the share of the ray from an eye at which it passes a triangle. `None` if it misses.
fn hit(eye: DVec3, ray: DVec3, triangle: &Triangle) -> Option<f64> {
    let [a, b, c] = triangle.map(|corner| corner.as_dvec3());
    let normal = (b - a).cross(c - a);
    let along = (a - eye).dot(normal) / ray.dot(normal);
    let at = eye + ray * along;
    let inside = [[a, b], [b, c], [c, a]].iter().all(|&[p, q]| (q - p).cross(at - p).dot(normal) >= 0.0);
    (along > 0.0 && inside).then_some(along)
}

/// Returns the solid angle in which an eye sees each object of a scene with origin 0: rays through points of
/// each tile, with the foreshortened area that each stands for.
fn solid_angles(scene: &Scene, eye: DVec3, grid: u32) -> Vec<f64> {
    let all: Vec<(usize, bool, Triangle)> = scene
        .ids()
        .flat_map(|id| {
            let occludes = scene.object(id).unwrap().occluder;
            scene.triangles(id).unwrap().iter().map(move |triangle| (id.index(), occludes, triangle))
        })
        .collect();
    let mut sums = vec![0.0; scene.index_limit()];
    for &(object, _, [a, b, c]) in &all {
        let [a, u, v] = [a, b - a, c - a].map(|v| v.as_dvec3());
        // Points of half of the square that the triangle is in.
        for (i, j) in (0..grid).flat_map(|i| (0..grid - i).map(move |j| (i, j))) {
            let at = a + (u * (f64::from(i) + 1.0 / 3.0) + v * (f64::from(j) + 1.0 / 3.0)) / f64::from(grid);
            let ray = at - eye;
            let is_blocked = all.iter().any(|(other, occludes, triangle)| {
                *occludes
                    && *other != object
                    && hit(eye, ray, triangle).is_some_and(|along| along < 1.0 - 1e-9)
            });
            if !is_blocked {
                let count = f64::from(grid * (grid + 1) / 2);
                let area = u.cross(v) * (0.5 / count);
                sums[object] += area.dot(ray).abs() / ray.length().powi(3);
            }
        }
    }
    sums
}

/// Compares degrees with the greatest solid angles of rays from other eyes, where these are well inside a
/// class.
#[test]
fn degrees_are_those_of_rays() {
    let mut random = Random(5);
    let mut sampler = DegreeSampler::new(48).unwrap();
    let mut compared = [0; 4];
    for round in 0..20 {
        let (scene, row) = slit(&mut random);
        let degrees = sampler.sample(&scene, &cell(), &row, |_| false);
        let mut most = vec![0f64; row.len()];
        for _ in 0..48 {
            let mut part = || random.unit();
            let eye = cell().min + (cell().max - cell().min) * DVec3::new(part(), part(), part());
            for (most, shown) in most.iter_mut().zip(solid_angles(&scene, eye, 10)) {
                *most = most.max(shown);
            }
        }
        for ((object, degree), most) in row.iter().zip(degrees).zip(most) {
            // The slit is at most .64 m wide and 3 m from the viewcell, which reaches 1 m to its sides: at
            // x = 11, less than 3 m to a side are seen through it.
            let object = scene.object(scene.id_at(*object as usize).unwrap()).unwrap();
            if object.bounds.min.x > 5.0 && (object.bounds.min.y > 3.0 || object.bounds.max.y < -3.0) {
                assert_eq!((degree, most), (Unseen, 0.0), "round {round}, a tile beside {:?}", object.bounds);
                compared[0] += 1;
                continue;
            }
            // A see-through tile counts in full pixels, up to 5.2 times what it shows.
            let [low, high] =
                [most / 2.0, most * if object.occluder { 2.0 } else { 8.0 }].map(SampledDegree::of);
            if most < 1.5 * SampledDegrees::LIMITS[0] {
                // About a pixel: rays and pixels may both miss it.
                assert!(degree <= Partly, "round {round}, {:?}: {degree:?}, {most:e} sr", object.bounds);
                continue;
            }
            assert!(
                low <= degree && degree <= high,
                "round {round}, {:?}: {degree:?}, where rays see {most:e} sr",
                object.bounds
            );
            compared[degree as usize] += usize::from(low == high);
        }
    }
    assert!(compared.iter().all(|&compared| compared >= 5), "well inside of each class: {compared:?}");
}

#[test]
fn what_hides_nothing_in_a_bake_hides_nothing_here() {
    for (occluder, expected) in [(true, Unseen), (false, Widely)] {
        let mut scene = Scene::new();
        let pane = insert(&mut scene, upright(4.0, [-30.0, -30.0], [30.0, 30.0]), occluder);
        let tile = insert(&mut scene, upright(6.0, [-1.0, -1.0], [1.0, 1.0]), true);
        let mover = insert(&mut scene, upright(3.0, [-30.0, -30.0], [30.0, 30.0]), true);
        scene.set_never_cull(scene.id_at(mover as usize).unwrap(), true).unwrap();
        let bare = scene.insert(Aabb::from_arrays([20.0; 3], [21.0; 3])).index() as u32;
        let degrees =
            DegreeSampler::new(8).unwrap().sample(&scene, &cell(), &[pane, tile, mover, bare], |_| false);
        assert_eq!(degrees, [Widely, expected, Widely, Widely], "the pane occludes: {occluder}");
        // What the bake has seen for certain is at least hardly visible.
        let degrees =
            DegreeSampler::new(8).unwrap().sample(&scene, &cell(), &[pane, tile], |index| index == tile);
        assert_eq!(
            degrees[1],
            expected.max(Hardly),
            "the tile is known to be seen, the pane occludes: {occluder}"
        );
    }
}

#[test]
fn eyes_are_in_the_viewcell_and_viewcells_without_eyes_know_nothing() {
    let mut scene = Scene::new();
    // The tile is behind a wall that reaches from y = 0 on. Only eyes with less y see much of it.
    insert(&mut scene, upright(3.0, [0.0, -90.0], [90.0, 90.0]), true);
    let tile = insert(&mut scene, upright(90.0, [0.0, -50.0], [50.0, 50.0]), true);
    let of = |viewcell: &Viewcell| {
        DegreeSampler::new(16).unwrap().sample(&scene, viewcell, &[0, tile], |_| false)[1]
    };
    let cut = |normal: DVec3, offset: f64| {
        let plane = visibility_core::geometry::Plane::new(normal, offset);
        Viewcell { planes: vec![plane], ..cell() }
    };
    assert_eq!(of(&cell()), Widely, "the whole box");
    assert_eq!(of(&cut(DVec3::Y, -0.2)), Unseen, "the part of the box where y is .2 or more");
    assert_eq!(of(&cut(DVec3::Y, -2.0)), Widely, "an empty viewcell");
    assert_eq!(of(&Viewcell::from_box(DVec3::NAN, DVec3::ONE)), Widely, "a viewcell that is not finite");
    let far = DVec3::splat(1e300);
    assert_eq!(of(&Viewcell::from_box(-far, far)), Widely, "a viewcell too large for pictures");
}

/// Few eyes come near a small object within the viewcell, and an eye beside it sees it widely.
#[test]
fn objects_that_meet_the_viewcell_show_widely() {
    let room = Viewcell::from_box(DVec3::ZERO, DVec3::splat(10.0));
    for (x, expected) in [(5.0, true), (10.0, true), (10.5, false)] {
        let mut scene = Scene::new();
        let tile = insert(&mut scene, upright(x, [5.0, 5.0], [5.05, 5.05]), true);
        let degrees = DegreeSampler::new(4).unwrap().sample(&scene, &room, &[tile], |_| false);
        assert_eq!(degrees[0] == Widely, expected, "a tile of 5 cm at x = {x}: {degrees:?}");
    }
}

fn set() -> (Scene, BakedSet, Vec<Vec<SampledDegree>>) {
    let mut scene = Scene::new();
    scene.insert_batch((0..6).map(|i| Aabb::from_arrays([i as f32, 5.0, 0.0], [i as f32 + 0.5, 6.0, 1.0])));
    let room = |x: f64| Viewcell::from_box(DVec3::new(x, 0.0, 0.0), DVec3::new(x + 1.0, 1.0, 1.0));
    let rows = [vec![0, 1, 2, 4], vec![1, 2, 3], vec![]];
    let cells = Viewcells::new([room(0.0), room(1.0), room(2.0)]);
    let degrees = vec![vec![Widely, Hardly, Unseen, Partly], vec![Hardly, Widely, Partly], vec![]];
    let set = BakedSet::from_rows(&scene, cells, &rows).unwrap();
    (scene, set, degrees)
}

#[test]
fn a_set_keeps_its_rows_and_its_degrees_in_its_file() {
    let (scene, plain, degrees) = set();
    let with = plain.clone().with_degrees(&degrees, 40).unwrap();
    let read = BakedSet::from_bytes(&with.to_bytes()).unwrap();
    assert_eq!(read, with, "the set from its file");
    assert_eq!(BakedSet::from_bytes(&plain.to_bytes()).unwrap().degrees(), None, "a set without degrees");
    assert_eq!(read.degrees().map(SampledDegrees::eyes), Some(40), "eyes");
    for cell in (0..3).map(ViewcellId) {
        assert_eq!(read.row(cell), plain.row(cell), "the row of {cell:?} is that without degrees");
    }
    let sets = read.for_scene(&scene).unwrap();
    let mut reader = PvsCuller::new(sets);
    assert_eq!(reader.accuracy(), Accuracy::Conservative, "sets with degrees");
    for (number, degrees) in degrees.iter().enumerate() {
        let eye = DVec3::new(number as f64 + 0.5, 0.5, 0.5);
        let pose = visibility_core::Pose::look_at(eye, eye + DVec3::Y, DVec3::Z);
        reader.look(&scene, &visibility_core::View::perspective(pose, 1.0, 1.0, 0.1, 100.0).unwrap());
        let row = plain.row(ViewcellId(number as u32));
        for id in scene.ids() {
            let at = row.binary_search(&(id.index() as u32));
            let expected = at.map_or(Unseen, |at| degrees[at]);
            assert_eq!(reader.degree(id), Some(expected), "viewcell {number}, {id:?}");
        }
    }
    let again = with.clone().with_degrees(&degrees, 40).unwrap();
    assert_eq!(again, with, "the same degrees once more");
    let few = plain.clone().with_degrees(&degrees[..2], 40);
    assert_eq!(few, Err(BakedSetError::Rows { viewcells: 3, rows: 2 }), "lists of two viewcells");
    let mut short = degrees.clone();
    short[1].pop();
    let refused = Err(BakedSetError::Degrees { viewcell: ViewcellId(1) });
    assert_eq!(plain.clone().with_degrees(&short, 40), refused, "a degree too few");
    assert!(plain.with_degrees(&degrees, 0).is_err(), "no eyes");
}

/// Returns a file with the header of another and other content, and the place in the content where the
/// degrees begin.
fn with_content(file: &[u8], change: impl FnOnce(&mut Vec<u8>, usize)) -> Vec<u8> {
    let mut content = decompress_to_vec(&file[COMPRESSED..]).unwrap();
    let pvs = content.windows(8).position(|window| window == b"VISI-PVS").unwrap();
    let length = u32::from_le_bytes(content[pvs - 4..pvs].try_into().unwrap());
    change(&mut content, pvs + length as usize);
    let length = (content.len() as u64).to_le_bytes();
    let mut forged = [&file[..40], &length, &compress_to_vec(&content, 1)].concat();
    mend_header(&mut forged, 0);
    forged
}

#[test]
fn forged_degrees_are_refused() {
    let (_, plain, degrees) = set();
    let with = plain.clone().with_degrees(&degrees, 40).unwrap();
    let file = with.to_bytes();
    let read = |change: fn(&mut Vec<u8>, usize)| BakedSet::from_bytes(&with_content(&file, change));
    assert!(read(|_, _| {}).is_ok(), "an unchanged file");
    assert!(read(|content, at| content[at..at + 4].fill(0)).is_err(), "sets without eyes");
    assert!(read(|content, at| content[at + 4 + 7] ^= 1).is_err(), "another limit");
    assert!(read(|content, at| content.truncate(at + 28)).is_err(), "limits without sets");
    assert!(read(|content, at| content.truncate(at)).is_err(), "no number of eyes");
    assert!(read(|content, _| content.push(0)).is_err(), "a byte after the sets");
    // The last set lists all classes everywhere.
    let classes = plain
        .with_degrees(&degrees, 40)
        .unwrap()
        .degrees()
        .map_or(0, |degrees| degrees.at_least(Widely).map_or(0, Pvs::target_count)) as u32;
    let all =
        Pvs::new(PvsTargets::Objects, classes as usize, &vec![(0..classes).collect::<Vec<_>>(); 3], |_| []);
    let all = all.unwrap();
    let forged = with_content(&file, |content, _| {
        let last = content.windows(8).rposition(|window| window == b"VISI-PVS").unwrap();
        content.truncate(last - 4);
        content.extend_from_slice(&(all.as_bytes().len() as u32).to_le_bytes());
        content.extend_from_slice(all.as_bytes());
    });
    // Rows are not compared, since a small file may stand for very many.
    let forged = BakedSet::from_bytes(&forged).unwrap();
    for (cell, class) in (0..3).flat_map(|cell| (0..classes).map(move |class| (ViewcellId(cell), class))) {
        let degree = |set: &BakedSet| set.degrees().map(|degrees| degrees.degree(cell, class));
        let (given, found) = (degree(&with), degree(&forged));
        let expected = given.map(|given| if given == Partly { Widely } else { given });
        assert_eq!(found, expected, "{cell:?}, class {class}: a greater degree counts with the lesser ones");
    }
}

/// A one-sided leaf that a transform flattens may show either side: it counts as seen from both, and hides
/// nothing.
#[test]
fn leaves_of_uncertain_fronts_are_seen_from_both_sides() {
    let leaf = SharedTriangles::from(&upright(0.0, [-1.0; 2], [1.0; 2])[..]);
    let place =
        |x: f64| DAffine3::from_translation(DVec3::X * x) * DAffine3::from_scale(DVec3::new(0.0, 1.0, 1.0));
    let mut scene = Scene::new();
    for (x, turned) in [(5.0, false), (6.0, true)] {
        let bounds = Aabb::from_arrays([x, -1.0, -1.0], [x, 1.0, 1.0]);
        let id = scene.insert(Object { occluder: true, one_sided: true, ..Object::new(bounds) });
        let turn = DAffine3::from_rotation_z(if turned { std::f64::consts::PI } else { 0.0 });
        scene.set_triangles(id, leaf.placed(place(f64::from(x)) * turn)).unwrap();
    }
    let degrees = DegreeSampler::new(4).unwrap().sample(&scene, &cell(), &[0, 1], |_| false);
    assert_eq!(degrees, [Widely; 2], "the leaf before, and the one behind it");
}
