//! Inputs from which a fuzz target begins, made by the writers of the crates, so that they are always of the
//! present version of a format.

use crate::{
    baked_sets, bakes, culling, level_occluders, plans, prt, pvs, regions, sandwich_bakes, scene_files,
};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::{Pvs, PvsTargets, ViewcellId};
use visibility_core::{Pose, View};
use visibility_examples::visc::{scene_file as visc_scene_file, visibility_file};
use visibility_examples::{built_in, vscn};
use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle};
use visibility_testing::Random;
use visibility_testing::cameras::DEPTHS;

/// A fuzz target.
pub struct Target {
    /// Name of the module, of the program for cargo-fuzz, and of the folder in `corpus`.
    pub name: &'static str,
    /// Runs the target on some bytes. Returns whether they were accepted.
    pub run: fn(&[u8]) -> bool,
    /// Returns the inputs to begin with, besides the files in the target's folder.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

/// All targets.
pub const TARGETS: [Target; 10] = [
    // The first byte chooses a set or a shard, which is then left as it is.
    Target { name: "baked_sets", run: baked_sets::run, seeds: || vec![vec![0], vec![1]] },
    // Number of rounds before the state is saved, and the settings; no change of the state.
    Target { name: "bakes", run: bakes::run, seeds: || (0..4).map(|at| vec![at, at]).collect() },
    Target { name: "culling", run: culling::run, seeds: culled_scenes },
    Target { name: "level_occluders", run: level_occluders::run, seeds: levels },
    Target { name: "plans", run: plans::run, seeds: walls_and_discs },
    Target { name: "prt", run: prt::run, seeds: maps },
    Target { name: "pvs", run: pvs::run, seeds: sets },
    Target { name: "regions", run: regions::run, seeds: scenes_with_a_viewcell },
    // The level, and a state or the cache, which is then left as it is.
    Target {
        name: "sandwich_bakes",
        run: sandwich_bakes::run,
        seeds: || (0..16).map(|at| vec![at]).collect(),
    },
    Target { name: "scene_files", run: scene_files::run, seeds: files },
];

/// Appends a number in the form that [`Bytes::number`](crate::Bytes::number) reads exactly.
fn push(number: f32, out: &mut Vec<u8>) {
    out.push(0);
    out.extend(number.to_le_bytes());
}

/// Appends a wall at x = 2 m, which faces the origin, and small triangles before and behind it, each an
/// object.
fn push_scene(random: &mut Random, out: &mut Vec<u8>) {
    let mut triangle = |corners: [Vec3; 3]| {
        // A first byte of 0 begins an object.
        corners.iter().flat_map(|corner| corner.to_array()).for_each(|x| push(x, out));
    };
    let [a, b, c, d] =
        [(-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0)].map(|(y, z)| Vec3::new(2.0, y, z));
    triangle([a, b, c]);
    triangle([a, c, d]);
    for _ in 0..6 {
        let mut at = || random.below(64) as f32 / 16.0 - 2.0;
        let (corner, x) = (Vec3::new(0.0, at(), at()), 3.0 + at());
        triangle([Vec3::X, Vec3::Y, Vec3::Z].map(|side| corner + Vec3::X * x + side * 0.5));
    }
}

fn culled_scenes() -> Vec<Vec<u8>> {
    (0..32u8)
        .map(|culler| {
            let mut bytes = vec![culler];
            for eye in [DVec3::ZERO, DVec3::new(-1.0, 0.5, 0.25)] {
                let pose = Pose::look_at(eye, DVec3::X * 5.0, DVec3::Z);
                let view = View::perspective(pose, 1.0, 1.0, 0.25, 64.0).expect("a view");
                let depth = DEPTHS.iter().position(|&depth| depth == view.depth());
                bytes.push(depth.expect("a known range of depths") as u8);
                let clip = view.clip_from(DVec3::ZERO).as_mat4();
                clip.to_cols_array().into_iter().for_each(|x| push(x, &mut bytes));
            }
            push_scene(&mut Random(culler.into()), &mut bytes);
            bytes
        })
        .collect()
}

fn scenes_with_a_viewcell() -> Vec<Vec<u8>> {
    (0..24u8)
        .map(|method| {
            // A box without planes.
            let mut bytes = vec![method, 16];
            [-0.5, -0.5, -0.5, 1.0, 1.0, 1.0].into_iter().for_each(|x| push(x, &mut bytes));
            push_scene(&mut Random(method.into()), &mut bytes);
            bytes
        })
        .collect()
}

fn levels() -> Vec<Vec<u8>> {
    let corners = [Vec3::ZERO, Vec3::Y, Vec3::Z];
    let level = LevelOccluders::new(&[LevelTriangle { corners, two_sided: false }], LevelSettings::default());
    let file = level.expect("a triangle").to_bytes();
    vec![vec![1], [&[0], &file[..]].concat()]
}

fn walls_and_discs() -> Vec<Vec<u8>> {
    let mut random = Random(3);
    (0..8)
        .map(|at| (0..60).map(|place| if place == 0 { at } else { random.below(255) as u8 }).collect())
        .collect()
}

fn maps() -> Vec<Vec<u8>> {
    let map = "PRT1\n2\n1\n4 0 1 (4 1 0) (4 2 0) (4 2 3) (4 1 3)\n";
    let mut row = "PRT1\n5\n4\n".to_owned();
    for room in 0..4 {
        let (x, y) = (4 * room + 4, room % 3);
        row += &format!("4 {room} {} ({x} {y} 0) ({x} {}.8 0) ({x} {}.8 2) ({x} {y} 2)\n", room + 1, y, y);
    }
    let leaves = map.replace("PRT1\n2\n", "PRT2\n3\n2\n") + "0 1 -1\n2 -1\n";
    [map.to_owned(), row, leaves].map(String::into_bytes).to_vec()
}

fn sets() -> Vec<Vec<u8>> {
    let mut random = Random(7);
    let rows: Vec<Vec<u32>> = (0..40).map(|_| (0..200).filter(|_| random.one_in(3)).collect()).collect();
    let near: Vec<Vec<u32>> = (0..20).map(|cell| (cell..cell + 30).chain([190]).collect()).collect();
    let before = |viewcell: ViewcellId| viewcell.0.checked_sub(1).map(ViewcellId);
    let set = |rows: &[Vec<u32>], of| Pvs::new(of, 300, rows, before).expect("rows of known targets");
    let set = [set(&rows, PvsTargets::Objects), set(&near, PvsTargets::Cells).with_source(5)];
    set.map(|set| set.as_bytes().to_vec()).to_vec()
}

fn files() -> Vec<Vec<u8>> {
    let mut scene = built_in("town:1").expect("a built-in scene");
    scene.objects.truncate(3);
    let vscn = vscn::write(&scene).expect("a few objects");
    let visb = visibility_file::write(&vec![vec![true, false, true]; 4]);
    vec![
        [&[0], &vscn[..]].concat(),
        [&[1], &occlusion_query()[..]].concat(),
        [&[2], &visb[..]].concat(),
        binary_gltf(),
    ]
}

/// Returns a VISC file of a triangle, a box, and a view in one pixel.
fn occlusion_query() -> Vec<u8> {
    let mut file = visc_scene_file::MAGIC.to_le_bytes().to_vec();
    let mut push = |counts: &[u32], numbers: &[f32]| {
        file.extend(counts.iter().flat_map(|x| x.to_le_bytes()));
        file.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
    };
    let projection = [1.8, 0., 0., 0., 0., 1.8, 0., 0., 0., 0., -1.01, -1., 0., 0., -0.5, 0.];
    push(&[1], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    push(&[1], &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
    push(&[1, 1, 1], &projection);
    push(&[], &[0.0; 3]);
    file
}

/// Returns a glTF file in binary form, of a triangle with an index, after the byte that chooses its kind.
fn binary_gltf() -> Vec<u8> {
    let mut text = br#"{"asset":{"version":"2.0"},"buffers":[{"byteLength":44}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
"nodes":[{"mesh":0,"translation":[1,2,3],"scale":[2,1,1]}],"scenes":[{"nodes":[0]}]}"#
        .to_vec();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut content: Vec<u8> =
        [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    content.extend([0, 0, 1, 0, 2, 0, 0, 0]);
    let length = 12 + 8 + text.len() + 8 + content.len();
    let number = |number: usize| (number as u32).to_le_bytes();
    let parts = [&[3], &b"glTF"[..], &number(2), &number(length), &number(text.len()), b"JSON", &text];
    [&parts.concat()[..], &number(content.len()), b"BIN\0", &content].concat()
}
