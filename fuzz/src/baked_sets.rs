//! Arbitrary bytes as a baked set or as a shard, and valid ones with changed content and
//! repaired checksums. They must be refused with an error, or be readable to the last row.
use crate::mend;
use miniz_oxide::deflate::compress_to_vec;
use miniz_oxide::inflate::decompress_to_vec;
use std::sync::{Arc, OnceLock};
use visibility_bake::{BakedSet, SandwichBaker, SandwichSettings, Shard, assemble};
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Prefetch, PvsCuller, Viewcell, ViewcellId, Viewcells};
use visibility_core::{Aabb, Pipeline, Pose, Scene, View, VisibleSet};

/// Scene of ten boxes, with a set and a shard for three viewcells, each as header and uncompressed content.
struct Real {
    scene: Scene,
    cells: Viewcells,
    files: [(Vec<u8>, Vec<u8>); 2],
}

fn real() -> &'static Real {
    static REAL: OnceLock<Real> = OnceLock::new();
    REAL.get_or_init(|| {
        let mut scene = Scene::new();
        scene.insert_batch(
            (0..10).map(|i| Aabb::from_arrays([i as f32, 5.0, 0.0], [i as f32 + 0.5, 6.0, 1.0])),
        );
        let cell = |x: f64| Viewcell::from_box(DVec3::splat(x), DVec3::splat(x + 1.0));
        let cells = Viewcells::new([0.0, 1.0, 2.0].map(cell));
        let rows = [vec![0, 1, 2, 3], vec![1, 2, 3, 7], vec![1, 2, 9]];
        let shard = Shard::bake(SandwichBaker::new(&scene, &cells, SandwichSettings::default()));
        let set = BakedSet::from_rows(&scene, cells.clone(), &rows).expect("rows of the scene");
        let parts = |file: Vec<u8>| {
            let content = decompress_to_vec(&file[48..]).expect("own content");
            (file[..40].to_vec(), content)
        };
        Real { scene, cells, files: [set.to_bytes(), shard.to_bytes()].map(parts) }
    })
}

/// Runs the target on some bytes. Returns whether the changed file was accepted as a set or as a shard.
pub fn run(bytes: &[u8]) -> bool {
    let Some((&kind, changes)) = bytes.split_first() else { return false };
    ask(bytes);
    let (header, mut forged) = real().files[usize::from(kind % 2)].clone();
    // Each change is an offset and four new bytes; an offset near or past the end changes the length instead.
    for change in changes.chunks_exact(6) {
        let place = usize::from(u16::from_le_bytes([change[0], change[1]])) % (forged.len() + 2);
        match forged.get_mut(place..place + 4) {
            Some(bytes) => bytes.copy_from_slice(&change[2..]),
            None => forged.resize(usize::from(change[2]) * 4, change[3]),
        }
    }
    // The content of a set contains rows that have a header of their own, after the number of their bytes.
    let starts: Vec<usize> =
        (4..forged.len()).filter(|&start| forged[start..].starts_with(b"VISI-PVS")).collect();
    for start in starts {
        let count =
            forged[start - 4..start].iter().rev().fold(0, |count, &byte| count << 8 | usize::from(byte));
        if let Some(rows) = forged.get_mut(start..start.saturating_add(count)) {
            mend(rows);
        }
    }
    let length = (forged.len() as u64).to_le_bytes();
    let mut file = [&header[..], &length, &compress_to_vec(&forged, 1)].concat();
    mend(&mut file);
    ask(&file)
}

/// Reads bytes as a set and as a shard, and queries what is accepted. Returns whether either was.
fn ask(bytes: &[u8]) -> bool {
    let scene = &real().scene;
    if let Ok(set) = BakedSet::from_bytes(bytes) {
        let stored = set.to_bytes();
        let again = BakedSet::from_bytes(&stored).expect("its own bytes").to_bytes();
        assert_eq!(again, stored, "a set's own bytes, read and stored again");
        for number in 0..=set.viewcells().cells().len() as u32 {
            assert!(
                set.row(ViewcellId(number)).is_sorted_by(|a, b| a < b),
                "viewcell {number}: targets ascend, each once"
            );
        }
        let Ok(sets) = set.for_scene(scene) else { return true };
        let sets = Arc::new(sets);
        Prefetch::new().search(&sets, DVec3::splat(0.5), DVec3::ONE, 0.1, 3.0);
        let pose = Pose::look_at(DVec3::splat(0.5), DVec3::new(5.0, 5.0, 0.0), DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, 0.01, 100.0).expect("a view");
        Pipeline::new().with(PvsCuller::new(sets)).cull(scene, &view, &mut VisibleSet::new());
        return true;
    }
    let Ok(shard) = Shard::from_bytes(bytes) else { return false };
    assert_eq!(Shard::from_bytes(&shard.to_bytes()).as_ref(), Ok(&shard), "a shard's own bytes");
    // The shards may be refused or accepted, but must not cause a panic.
    let Real { scene, cells, .. } = real();
    let baker = SandwichBaker::new(scene, cells, SandwichSettings::default());
    let _ = assemble(&baker, [shard.clone(), shard]);
    true
}
