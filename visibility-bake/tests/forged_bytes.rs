//! Bytes of sets, shards, states and caches that were changed, before or after compression and with repaired
//! checksums, are refused or can be used completely without a panic.

use miniz_oxide::deflate::compress_to_vec;
use miniz_oxide::inflate::decompress_to_vec;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use visibility_bake::{BakeCache, BakedSet, SandwichBaker, SandwichSettings, Shard, assemble};
use visibility_core::bake::Bake;
use visibility_core::glam::DVec3;
use visibility_core::occlusion::Preparation;
use visibility_core::pvs::{Prefetch, PvsCuller, SampledDegree, Viewcell, ViewcellId, Viewcells};
use visibility_core::{Aabb, Culler, Object, Pipeline, Pose, Scene, View, VisibleSet};
use visibility_testing::{Random, judged, told_enough};

/// Repairs the length and the checksum in a header.
fn mend(bytes: &mut [u8]) {
    if bytes.len() < 40 {
        return;
    }
    let length = bytes.len() as u64;
    bytes[24..32].copy_from_slice(&length.to_le_bytes());
    let sum = bytes[..32]
        .iter()
        .chain(&bytes[40..])
        .fold(0xcbf2_9ce4_8422_2325_u64, |sum, &byte| (sum ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3));
    bytes[32..40].copy_from_slice(&sum.to_le_bytes());
}

/// Returns the content of a compressed file.
fn inflate(file: &[u8]) -> Vec<u8> {
    decompress_to_vec(&file[48..]).unwrap()
}

/// Returns a file with the header of another file and the given content, compressed.
fn deflate(header: &[u8], content: &[u8]) -> Vec<u8> {
    let length = (content.len() as u64).to_le_bytes();
    let mut file = [&header[..40], &length, &compress_to_vec(content, 1)].concat();
    mend(&mut file);
    file
}

/// Changes a file directly or, more often, its content before compression.
fn forge(file: &[u8], random: &mut Random) -> Vec<u8> {
    if random.one_in(4) {
        return changed(file, random);
    }
    deflate(file, &changed(&inflate(file), random))
}

/// Changes a few bytes, removes or duplicates some, and repairs the headers.
fn changed(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut forged = bytes.to_vec();
    for _ in 0..=random.below(3) {
        let place = random.below(forged.len());
        match random.below(8) {
            0 => forged.truncate(place.max(1)),
            1 => forged.extend_from_within(place..),
            // Overwrites four bytes with a number near 0 or near the greatest `u32`.
            2 | 3 => {
                let number = (random.below(5) as u32).wrapping_sub(2);
                let end = forged.len().min(place + 4);
                forged[place..end].copy_from_slice(&number.to_le_bytes()[..end - place]);
            }
            _ => forged[place] ^= 1 << random.below(8),
        }
    }
    // A set contains rows with headers of their own, each after the number of its bytes.
    for start in 4..forged.len().saturating_sub(8) {
        if forged[start..].starts_with(b"VISI-PVS") {
            let length = u32::from_le_bytes(forged[start - 4..start].try_into().unwrap()) as usize;
            let end = start.saturating_add(length).min(forged.len());
            mend(&mut forged[start..end]);
        }
    }
    if forged.starts_with(b"VIS") {
        mend(&mut forged);
    }
    forged
}

/// Returns the number of forged sets that were accepted, and that of forged shards.
fn ask(rounds: usize) -> [usize; 2] {
    let mut random = Random(41);
    let mut scene = Scene::new();
    scene.insert_batch((0..40).map(|i| Aabb::from_arrays([i as f32, 5.0, 0.0], [i as f32 + 0.5, 6.0, 1.0])));
    let cell = |x: u32| Viewcell::from_box(DVec3::splat(x.into()), DVec3::splat(f64::from(x) + 1.0));
    let cells = Viewcells::new((0..6).map(cell));
    let rows: Vec<Vec<u32>> = (0..6).map(|_| (0..40).filter(|_| random.one_in(3)).collect()).collect();
    let degrees: Vec<Vec<_>> =
        rows.iter().map(|row| row.iter().map(|_| SampledDegree::ALL[random.below(4)]).collect()).collect();
    let of_set = cells.clone();
    let baker = || SandwichBaker::new(&scene, &cells, SandwichSettings::default());
    let shard = Shard::bake(baker()).to_bytes();
    let set = BakedSet::from_rows(&scene, of_set, &rows).unwrap();
    let set = set.with_degrees(&degrees, 9).unwrap().to_bytes();
    let pose = Pose::look_at(DVec3::splat(0.5), DVec3::new(5.0, 5.0, 0.0), DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.01, 100.0).unwrap();
    let (mut accepted, whole) = ([0; 2], baker());
    for _ in 0..rounds {
        if let Ok(set) = BakedSet::from_bytes(&forge(&set, &mut random)) {
            accepted[0] += 1;
            let stored = set.to_bytes();
            assert_eq!(
                BakedSet::from_bytes(&stored).unwrap().to_bytes(),
                stored,
                "the set's own bytes, read and stored again"
            );
            for number in 0..=set.viewcells().cells().len() as u32 {
                assert!(
                    set.row(ViewcellId(number)).is_sorted_by(|a, b| a < b),
                    "viewcell {number}: targets ascend, each once"
                );
            }
            if let Ok(sets) = set.for_scene(&scene) {
                let sets = Arc::new(sets);
                Prefetch::new().search(&sets, DVec3::splat(0.5), DVec3::ONE, 0.1, 3.0);
                let mut by_degree = PvsCuller::new(sets.clone()).with_least_degree(SampledDegree::Partly);
                by_degree.cull(&scene, &view, &mut VisibleSet::new());
                scene.ids().for_each(|id| _ = by_degree.degree(id));
                Pipeline::new().with(PvsCuller::new(sets)).cull(&scene, &view, &mut VisibleSet::new());
            }
        }
        if let Ok(shard) = Shard::from_bytes(&forge(&shard, &mut random)) {
            accepted[1] += 1;
            assert_eq!(
                Shard::from_bytes(&shard.to_bytes()),
                Ok(shard.clone()),
                "the shard from its own bytes"
            );
            // The shards may be refused or accepted, but without a panic.
            let _ = assemble(&whole, [shard.clone(), shard]);
        }
    }
    accepted
}

/// Returns the number of forged states of a bake that were accepted, and that of forged caches.
fn go_on(rounds: usize) -> [usize; 2] {
    let mut random = Random(43);
    let mut scene = Scene::new();
    let bounds = |i: usize| Aabb::from_arrays([i as f32, 5.0, 0.0], [i as f32 + 0.5, 6.0, 1.0]);
    scene.insert_batch((0..12).map(|i| Object { occluder: i % 2 == 0, ..Object::new(bounds(i)) }));
    scene.prepare_occluders(&Preparation::default());
    // These viewcells are in one group.
    let cell = |x: u32| Viewcell::from_box(DVec3::X * f64::from(x), DVec3::X * f64::from(x) + DVec3::ONE);
    let cells = Viewcells::new((0..4).map(cell));
    let baker = || SandwichBaker::new(&scene, &cells, SandwichSettings::default().with_rays(2).with_gap(0.0));
    let mut bake = Bake::new(baker());
    let begun = AtomicUsize::new(0);
    bake.advance_unless(|| begun.fetch_add(1, Relaxed) == 2, || false);
    let some_swept = bake.save();
    bake.advance();
    let states = [some_swept, bake.save()];
    let cache = bake.run().cache.to_bytes();
    let mut accepted = [0; 2];
    for _ in 0..rounds {
        let state = Bake::resume(baker(), &changed(&states[random.below(2)], &mut random));
        let cache = BakeCache::from_bytes(&changed(&cache, &mut random));
        accepted[0] += usize::from(state.is_ok());
        accepted[1] += usize::from(cache.is_ok());
        let cached = cache.map(|cache| Bake::new(baker().with_cache(cache)));
        for bake in state.into_iter().chain(cached) {
            let _ = Bake::resume(baker(), &bake.save());
            for cell in bake.run().cells {
                assert!(
                    cell.reported().last().is_none_or(|&last| last < 12),
                    "a row ends with {:?} of 12 objects",
                    cell.reported().last()
                );
            }
        }
    }
    accepted
}

#[test]
fn forged_states_and_caches_are_refused_or_can_be_used() {
    let accepted = go_on(2000);
    judged(4000);
    told_enough(
        accepted.iter().all(|&accepted| accepted > 40 && accepted < 1960),
        format_args!("{accepted:?}"),
    );
}

#[test]
fn forged_bytes_are_refused_or_can_be_used() {
    let accepted = ask(5000);
    judged(5000);
    told_enough(
        accepted.iter().all(|&accepted| accepted > 100 && accepted < 4900),
        format_args!("{accepted:?}"),
    );
}
