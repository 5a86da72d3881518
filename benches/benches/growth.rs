//! Growth of the construction time of each structure with the size of its input, for difficult inputs: boxes
//! that coincide, are nested, lie side by side in one plane, or are scattered.
//!
//! `cargo bench --bench growth` prints, for 2,000, 4,000, ... 32,000 boxes, the time in milliseconds and its
//! ratio to the time for half as many boxes: about 2 for linear, 4 for quadratic growth. A series ends after
//! the first build that takes more than two seconds. A word after `--` selects the lines whose structure or
//! input contains it: `cargo bench --bench growth -- occluders`.

use std::hint::black_box;
use std::time::Instant;
use visibility_benches::workload::Random;
use visibility_bsp::{Occluders, SceneTree, ShadowFrusta};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{
    Aabb, Object, OccluderMesh, Scene, geometry::ConvexPolygon, occlusion::Preparation, scene::Triangle,
};
use visibility_frame::backface::BackfaceCuller;
use visibility_plp::{DelaunayTessellation, OctreeTessellation};
use visibility_portals::from_geometry::{PolygonSettings, WallSettings, from_polygons, from_walls};

/// Number of boxes in the first build of a series; later builds double it.
const FIRST: usize = 2000;
/// Number of doublings of the number of boxes in a series: the last build has 16 times the boxes of the
/// first.
const DOUBLINGS: usize = 4;
/// Time of one build, in seconds, after which a series ends.
const ENOUGH: f64 = 2.0;

/// Name of an input, and the function that makes a given number of boxes of it.
type Input = (&'static str, fn(usize) -> Vec<Aabb>);

/// Inputs of every structure: arrangements of boxes that are difficult to build from.
const INPUTS: &[Input] = &[
    ("coincident", |count| vec![Aabb::from_arrays([0.0; 3], [1.0, 2.0, 3.0]); count]),
    ("nested", |count| {
        // Sizes that are multiples of a power of two are exact and all different.
        (0..count).map(|i| Vec3::splat(1.0 + i as f32 / 1024.0)).map(|half| Aabb::new(-half, half)).collect()
    }),
    ("abutting slabs", |count| {
        (0..count).map(|i| Aabb::from_arrays([i as f32, 0.0, 0.0], [i as f32 + 1.0, 8.0, 0.5])).collect()
    }),
    ("overlapping slabs", |count| {
        (0..count).map(|i| Aabb::from_arrays([i as f32, 0.0, 0.0], [(i + count) as f32, 8.0, 0.5])).collect()
    }),
    ("crossing slabs", |count| {
        // Half of the slabs run along x, half along y, in one plane: their sides form a grid.
        let half = count as f32 / 2.0;
        (0..count)
            .map(|i| {
                let at = (i / 2) as f32;
                let (low, high) = ([0.0, at, 0.0], [half, at + 0.5, 0.5]);
                let turn = |[x, y, z]: [f32; 3]| if i % 2 == 0 { [x, y, z] } else { [y, x, z] };
                Aabb::from_arrays(turn(low), turn(high))
            })
            .collect()
    }),
    ("tiles", |count| {
        // Separate tiles, all in one plane.
        let side = (count as f64).sqrt().ceil() as usize;
        let at = |i: usize| Vec3::new((i % side) as f32, (i / side) as f32, 0.0);
        (0..count).map(|i| Aabb::new(at(i), at(i) + Vec3::new(0.75, 0.75, 0.5))).collect()
    }),
    ("scattered", |count| {
        let (mut random, reach) = (Random(1), (count as f32).cbrt());
        let min = std::iter::repeat_with(|| random.point(-reach, reach)).take(count);
        min.map(|min| Aabb::new(min, min + 0.5)).collect()
    }),
];

/// Returns the twelve triangles of the box's surface, counter-clockwise as seen from outside.
fn triangles(bounds: &Aabb) -> Vec<Triangle> {
    let corners = bounds.corners();
    OccluderMesh::CUBOID.iter().map(|t| t.map(|i| corners[i as usize])).collect()
}

/// Makes a scene with one object per box; each is an occluder with the box's surface as its mesh.
fn scene(boxes: &[Aabb]) -> Scene {
    let mut scene = Scene::new();
    let ids = scene.insert_batch(boxes.iter().map(|&b| Object { occluder: true, ..Object::new(b) }));
    for (id, bounds) in ids.into_iter().zip(boxes) {
        scene.set_triangles(id, triangles(bounds)).expect("of this scene");
    }
    scene.prepare_occluders(&Preparation::default());
    scene
}

/// Returns the surfaces of all boxes as one triangle soup, twelve triangles per box.
fn mesh(boxes: &[Aabb]) -> Vec<Triangle> {
    boxes.iter().flat_map(triangles).collect()
}

/// Returns the wall-clock time of `make` in seconds. Dropping its result is not measured.
fn timed<T>(make: impl FnOnce() -> T) -> f64 {
    let start = Instant::now();
    let made = black_box(make());
    let seconds = start.elapsed().as_secs_f64();
    drop(made);
    seconds
}

/// Name of a structure, and the function that builds it from boxes and returns the time in seconds.
type Structure = (&'static str, fn(&[Aabb]) -> f64);

/// Structures to build, with their build functions. Preparing the input is not measured.
const STRUCTURES: &[Structure] = &[
    ("scene", |boxes| timed(|| Scene::new().insert_batch(boxes.iter().copied()))),
    ("occluder mesh", |boxes| {
        let triangles = mesh(boxes);
        timed(|| OccluderMesh::from_triangles(&triangles).ok().map(|mesh| mesh.parts().len()))
    }),
    ("occluder polygons", |boxes| {
        let scene = scene(boxes);
        timed(|| Occluders::new(&scene))
    }),
    ("shadow frusta", |boxes| {
        let scene = scene(boxes);
        let occluders = Occluders::new(&scene);
        timed(|| ShadowFrusta::new(&scene, occluders, 16, 16))
    }),
    ("scene tree", |boxes| {
        let scene = scene(boxes);
        timed(|| SceneTree::new(&scene).map(|tree| tree.tree().node_count()))
    }),
    ("cells from walls", |boxes| {
        let walls: Vec<[DVec3; 2]> = boxes.iter().map(|b| [b.min.as_dvec3(), b.max.as_dvec3()]).collect();
        timed(|| from_walls(&walls, &WallSettings::default()).map(|cells| cells.graph.cell_count()))
    }),
    ("cells from polygons", |boxes| {
        let polygons: Vec<ConvexPolygon> =
            mesh(boxes).iter().filter_map(|t| ConvexPolygon::new(t.map(|p| p.as_dvec3())).ok()).collect();
        timed(|| from_polygons(&polygons, &PolygonSettings::default()).map(|cells| cells.graph.cell_count()))
    }),
    ("octree tessellation", |boxes| {
        let scene = scene(boxes);
        timed(|| OctreeTessellation::new(&scene))
    }),
    ("tetrahedra", |boxes| {
        let scene = scene(boxes);
        timed(|| DelaunayTessellation::new(&scene))
    }),
    ("backface cones", |boxes| {
        let mut scene = scene(boxes);
        for id in scene.ids().collect::<Vec<_>>() {
            scene.set_one_sided(id, true).expect("of this scene");
        }
        let mut culler = BackfaceCuller::new();
        timed(|| culler.sync(&scene))
    }),
    ("backface clusters", |boxes| {
        let triangles = mesh(boxes);
        let positions: Vec<Vec3> = triangles.iter().flatten().copied().collect();
        let indices: Vec<[u32; 3]> =
            (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        timed(|| {
            visibility_frame::backface::cluster_mesh(&positions, &indices).map(|clusters| clusters.len())
        })
    }),
];

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    // Without `--bench`, which `cargo bench` adds, the program runs as a test with small inputs.
    let brief = !std::env::args().any(|word| word == "--bench");
    let (first, doublings) = if brief { (64, 0) } else { (FIRST, DOUBLINGS) };
    for &(structure, build) in STRUCTURES {
        for &(input, boxes) in INPUTS {
            if !words.iter().all(|word| structure.contains(word.as_str()) || input.contains(word.as_str())) {
                continue;
            }
            print!("{structure:20} {input:18}");
            let mut last = None;
            for doubling in 0..=doublings {
                let boxes = boxes(first << doubling);
                let seconds = build(&boxes);
                let factor = last.map_or(String::new(), |last: f64| format!(" x{:.1}", seconds / last));
                print!(" {:9.1}{factor:6}", seconds * 1000.0);
                last = Some(seconds);
                if seconds > ENOUGH {
                    break;
                }
            }
            println!();
        }
    }
}
