//! Counts in files that are forged to be large do not take more memory than the file or the scene justifies.

use miniz_oxide::deflate::compress_to_vec;
use miniz_oxide::inflate::decompress_to_vec;
use std::sync::Arc;
use visibility_bake::{BakeCache, BakedSet, SandwichBaker, SandwichSettings, Shard, assemble};
use visibility_core::bake::Bake;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{
    Prefetch, Pvs, PvsCuller, PvsTargets, SampledDegree, Viewcell, ViewcellId, Viewcells,
};
use visibility_core::{Aabb, Culler, ObjectId, Pose, Scene, View, VisibleSet};
use visibility_testing::{forge_counts, mend_header};

/// Greatest number of bytes of memory that reading and using a file of this test may take. The files have
/// less than 2,000 bytes, and the scenes a few objects.
const LIMIT: usize = 1 << 18;

/// Offset in bytes of the compressed content in a file.
const COMPRESSED: usize = 48;

fn level() -> (Scene, Viewcells) {
    let mut scene = Scene::new();
    scene.insert_batch((0..12).map(|i| Aabb::from_arrays([i as f32, 5.0, 0.0], [i as f32 + 0.5, 6.0, 1.0])));
    let cell = |x: u32| Viewcell::from_box(DVec3::X * f64::from(x), DVec3::X * f64::from(x) + DVec3::ONE);
    (scene, Viewcells::new((0..4).map(cell)))
}

fn view() -> View {
    let pose = Pose::look_at(DVec3::splat(0.5), DVec3::new(5.0, 5.0, 0.0), DVec3::Z);
    View::perspective(pose, 1.0, 1.0, 0.01, 100.0).unwrap()
}

/// Forges the counts of a compressed file: in its header, and in the content before compression.
fn forge_compressed(file: &[u8], mut read: impl FnMut(&[u8])) {
    forge_counts(file, 0, LIMIT, |mut file| {
        mend_header(&mut file, 0);
        read(&file);
    });
    let content = decompress_to_vec(&file[COMPRESSED..]).unwrap();
    let mut files = Vec::new();
    // The compressor needs memory of its own, so memory is not limited here.
    forge_counts(&content, 0, usize::MAX / 2, |mut content| {
        // Sets within the content have headers of their own, each after the number of its bytes.
        for inner in 4..content.len().saturating_sub(8) {
            if content[inner..].starts_with(b"VISI-PVS") {
                let length = u32::from_le_bytes(content[inner - 4..inner].try_into().unwrap()) as usize;
                let end = inner.saturating_add(length).min(content.len());
                mend_header(&mut content[inner..end], 0);
            }
        }
        let length = (content.len() as u64).to_le_bytes();
        let mut file = [&file[..40], &length, &compress_to_vec(&content, 1)].concat();
        mend_header(&mut file, 0);
        files.push(file);
    });
    // A file of one byte is used since it has only one place to forge.
    files.iter().for_each(|file| forge_counts(&[0], 0, LIMIT, |_| read(file)));
}

/// Uses all accessors of a set, and culls with it.
fn use_set(set: BakedSet, scene: &Scene, view: &View) {
    let objects: Vec<(ObjectId, u32)> = scene.ids().map(|id| (id, id.index() as u32)).collect();
    let known = objects.iter().copied().chain([(objects[0].0, u32::MAX), (objects[1].0, u32::MAX / 2)]);
    let sets = [set.for_objects(scene, known)];
    (0..5).for_each(|cell| drop(set.row(ViewcellId(cell))));
    for sets in sets.into_iter().chain(set.for_scene(scene)) {
        let sets = Arc::new(sets);
        Prefetch::new().search(&sets, DVec3::splat(0.5), DVec3::ONE, 0.1, 3.0);
        let mut visible = VisibleSet::new();
        visible.fill(scene, view);
        PvsCuller::new(sets).cull(scene, view, &mut visible);
    }
}

#[test]
fn a_set_takes_the_memory_of_its_bytes_and_its_scene() {
    let (scene, cells) = level();
    let rows: Vec<Vec<u32>> = (0..4).map(|cell| (cell..12).step_by(3).collect()).collect();
    let degrees: Vec<Vec<_>> =
        rows.iter().map(|row| row.iter().map(|&i| SampledDegree::ALL[i as usize % 4]).collect()).collect();
    let set = BakedSet::from_rows(&scene, cells, &rows).unwrap().with_degrees(&degrees, 9).unwrap();
    let file = set.to_bytes();
    let view = view();
    let (mut read, mut refused) = (0, 0);
    forge_compressed(&file, |file| match BakedSet::from_bytes(file) {
        Ok(set) => {
            read += 1;
            use_set(set, &scene, &view);
        }
        Err(_) => refused += 1,
    });
    assert!(read > 100 && refused > 100, "{read} read, {refused} refused");
    // Callers may allocate arrays by the limit of indices. A file has a bit for each index, and at most 2^29
    // bits.
    let whole = decompress_to_vec(&file[COMPRESSED..]).unwrap();
    let cases = [(12, 1, true), (64, 1, true), (65, 1, false), (65, 2, true), (u32::MAX, 1, false)];
    for (limit, words, is_read) in
        cases.into_iter().chain([(1 << 29, 1 << 23, true), ((1 << 29) + 1, (1 << 23) + 1, false)])
    {
        let mut content = whole.clone();
        content[8..12].copy_from_slice(&limit.to_le_bytes());
        content.splice(12..20, std::iter::repeat_n(0, 8 * words));
        let length = (content.len() as u64).to_le_bytes();
        let mut forged = [&file[..40], &length, &compress_to_vec(&content, 1)].concat();
        mend_header(&mut forged, 0);
        assert_eq!(BakedSet::from_bytes(&forged).is_ok(), is_read, "{limit} with {words} words");
    }
}

#[test]
fn shards_states_and_caches_take_the_memory_of_their_bytes_and_their_scene() {
    let (scene, cells) = level();
    let baker = || SandwichBaker::new(&scene, &cells, SandwichSettings::default().with_rays(2));
    let (shard, whole) = (Shard::bake(baker()).to_bytes(), baker());
    forge_compressed(&shard, |file| {
        if let Ok(shard) = Shard::from_bytes(file) {
            let _ = assemble(&whole, [shard.clone(), shard]);
        }
    });
    let mut bake = Bake::new(baker());
    bake.advance();
    let state = bake.save();
    let mut resumed = 0;
    forge_counts(&state, 0, LIMIT, |mut state| {
        mend_header(&mut state, 0);
        if let Ok(bake) = Bake::resume(baker(), &state) {
            resumed += 1;
            let _ = Shard::new(1, bake.finish()).to_bytes();
        }
    });
    assert!(resumed > 100, "{resumed}");
    let cache = bake.run().cache.to_bytes();
    forge_counts(&cache, 0, LIMIT, |mut cache| {
        mend_header(&mut cache, 0);
        let _ = BakeCache::from_bytes(&cache);
    });
}

/// A set whose file is compressed a thousandfold has as many objects as it announces, and takes a small
/// multiple of its size before compression.
#[test]
fn a_set_of_many_objects_takes_a_small_multiple_of_its_content() {
    let mut scene = Scene::new();
    let id = scene.insert(Aabb::from_arrays([5.0; 3], [6.0; 3]));
    let cells = Viewcells::new([Viewcell::from_box(DVec3::ZERO, DVec3::ONE)]);
    let file = BakedSet::from_rows(&scene, cells, &[vec![0]]).unwrap().to_bytes();
    let mut content = decompress_to_vec(&file[COMPRESSED..]).unwrap();
    // The classes start after a hash, a number, a word of occluders, two numbers, six coordinates, and the
    // counts of planes and classes. Each appended object is a class of its own, encoded as a step of one.
    let (classes, count) = (8 + 4 + 8 + 4 + 4 + 6 * 8 + 4 + 4, 1u32 << 20);
    assert_eq!(content[classes - 4..=classes], [1, 0, 0, 0, 0], "the count of classes and the first class");
    content[8..12].copy_from_slice(&(count + 1).to_le_bytes());
    content[classes - 4..classes].copy_from_slice(&(count + 1).to_le_bytes());
    content.splice(classes + 1..classes + 1, std::iter::repeat_n(4, count as usize));
    content.splice(20..20, std::iter::repeat_n(0, count as usize / 8));
    let inner = content.windows(8).position(|window| window == b"VISI-PVS").unwrap();
    content[inner + 20..inner + 24].copy_from_slice(&(count + 2).to_le_bytes());
    // The number of eyes follows the set: 0, since degrees were not sampled.
    let end = content.len() - 4;
    mend_header(&mut content[inner..end], 0);
    let length = (content.len() as u64).to_le_bytes();
    let mut file = [&file[..40], &length, &compress_to_vec(&content, 9)].concat();
    mend_header(&mut file, 0);
    assert!(file.len() < 4000, "{}", file.len());
    // Reading takes twice the content, its classes once more, and four to eight bytes for each object, to
    // find objects that are in two classes.
    forge_counts(&[0], 0, 12 * content.len(), |_| {
        let set = BakedSet::from_bytes(&file).unwrap();
        drop(set.for_objects(&scene, [(id, 0), (id, count)]));
    });
}

/// A set of as many viewcells as objects, each object seen from one viewcell, is made in memory proportional
/// to the lengths of the rows.
#[test]
fn a_set_of_many_viewcells_is_made_in_memory_of_its_rows() {
    let count = 1 << 16;
    let mut scene = Scene::new();
    scene.insert_batch((0..count).map(|i| Aabb::from_arrays([i as f32, 0.0, 0.0], [i as f32, 1.0, 1.0])));
    let cell = |x: u32| Viewcell::from_box(DVec3::X * f64::from(x), DVec3::X * f64::from(x) + DVec3::ONE);
    let rows: Vec<[u32; 1]> = (0..count).map(|i| [i]).collect();
    // A bit for each row and object would be 512 MiB.
    forge_counts(&[0], 0, 128 << 20, |_| {
        BakedSet::from_rows(&scene, Viewcells::new((0..count).map(cell)), &rows).unwrap();
    });
}

/// A PVS has at least 32 bits for the number of its targets, and few bytes for rows that see no target. Only
/// [`Pvs::write_bits`] and [`Pvs::write_union`] need a bit for each target.
#[test]
fn a_pvs_takes_the_memory_of_its_bytes_and_its_scene() {
    let (scene, cells) = level();
    let rows: Vec<Vec<u32>> = (0..4).map(|cell| (cell..12).step_by(3).collect()).collect();
    let file = Pvs::new(PvsTargets::Objects, 12, &rows, |_| []).unwrap().as_bytes().to_vec();
    let view = view();
    let mut read = 0;
    forge_counts(&file, 0, LIMIT, |mut file| {
        mend_header(&mut file, 0);
        let Ok(pvs) = Pvs::from_bytes(file) else { return };
        read += 1;
        let pairs = scene.ids().map(|id| (id, id.index() as u32));
        let sets = visibility_core::pvs::ScenePvs::new(&scene, pvs, cells.clone(), pairs);
        Prefetch::new().search(&sets, DVec3::splat(0.5), DVec3::ONE, 0.1, 3.0);
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &view);
        PvsCuller::new(&sets).cull(&scene, &view, &mut visible);
    });
    assert!(read > 4, "{read}");
}
