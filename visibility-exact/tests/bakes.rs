//! Bakes: rows of a PVS, the same however often a bake is interrupted; damaged state is refused.

use crate::common::{cuboid, scene};
use std::cell::Cell;
use visibility_core::bake::{Bake, Baker};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::{Viewcell, ViewcellId, Viewcells};
use visibility_core::{Aabb, Scene};
use visibility_exact::{BakeScratch, CellQuery, Effort, ExactBaker, ExactSettings, SceneTriangles, Verdict};
use visibility_testing::{Random, forge_counts, mend_header};

/// Blocks on a plain, and viewcells between them.
fn town() -> (SceneTriangles, Viewcells) {
    let mut random = Random(4);
    let mut objects = Vec::new();
    for x in 0..7 {
        for y in 0..7 {
            let min = DVec3::new(f64::from(x) * 4.0, f64::from(y) * 4.0, 0.0);
            objects.push(cuboid(min, min + DVec3::new(3.0, 3.0, f64::from(random.between(2, 6)))));
        }
    }
    let cell = |k: u32| {
        let min = DVec3::new(3.2 + f64::from(k % 6) * 4.0, 3.2 + f64::from(k / 6) * 4.0, 0.5);
        Viewcell::from_box(min, min + DVec3::new(0.6, 0.6, 1.0))
    };
    (SceneTriangles::new(&scene(&objects)), Viewcells::new((0..20).map(cell)))
}

fn settings() -> ExactSettings {
    ExactSettings { rays: 300, aimed_rays: 5, ..ExactSettings::new(Effort::Exact(1e-4)) }
}

#[test]
fn an_interrupted_bake_comes_to_the_same_pvs() {
    let (triangles, cells) = town();
    let baker = || ExactBaker::new(&triangles, &cells, settings());
    let whole = Bake::new(baker()).run();
    let mut bake = Bake::new(baker());
    loop {
        bake = Bake::resume(baker(), &bake.save()).unwrap();
        if bake.advance().is_none() {
            break;
        }
    }
    let parts = bake.finish();
    assert!(whole.complete && parts == whole, "the interrupted bake, complete as the whole one");
    let pvs = whole.to_pvs().unwrap();
    assert_eq!(pvs.as_bytes(), parts.to_pvs().unwrap().as_bytes(), "the PVS of the interrupted bake");
    for (number, cell) in (0..).zip(&whole.cells) {
        for target in 0..49 {
            let kept = cell.seen.contains(&target) || cell.open.contains(&target);
            assert_eq!(
                pvs.sees(ViewcellId(number), target),
                kept,
                "viewcell {number}, target {target}: seen or open"
            );
        }
        assert!(cell.seen.len() < 45, "{} objects are seen", cell.seen.len());
    }
    assert!(whole.gap() < 0.02, "{}", whole.gap());
}

#[test]
fn a_query_that_gives_up_has_no_other_answers() {
    let (triangles, cells) = town();
    let cell = &cells.cells()[7];
    let baker = ExactBaker::new(&triangles, &cells, settings());
    let asked = Cell::new(0);
    let run = |most: usize| {
        asked.set(0);
        let stop = || asked.replace(asked.get() + 1) >= most;
        let mut query = CellQuery::new(&triangles, cell, settings()).unwrap().with_stop(&stop);
        query.look(&|_| true);
        query.prove_boxes(&|_| true);
        query.prove_triangles(&|_| true);
        assert_eq!(query.is_stopped(), asked.get() > most, "asked {most} times, then stopped");
        query.verdicts().map(|(_, verdict)| verdict).collect::<Vec<_>>()
    };
    let whole = run(usize::MAX);
    let all = asked.get();
    let mut open = Vec::new();
    for most in [0, 1, all / 4, all / 2, all - 1] {
        let found = run(most);
        assert_eq!(asked.get(), most + 1, "it asks no more once it is to stop");
        assert!(
            found.iter().zip(&whole).all(|(a, b)| a == b || *a == Verdict::Open),
            "asked {most} times: an answer is another than that of the whole query"
        );
        open.push(found.iter().filter(|verdict| **verdict == Verdict::Open).count());
    }
    assert!(open.is_sorted_by(|a, b| a >= b) && open[0] > 40 && open[4] < 10, "{open:?}");
    let mut scratch = BakeScratch::default();
    assert_eq!(baker.work(7, &mut scratch, &|| true), None, "work that is stopped at once");
    assert_eq!(
        baker.work(7, &mut scratch, &|| false),
        baker.work(7, &mut BakeScratch::default(), &|| false),
        "work with used memory and with new"
    );
}

/// Stopped, saved and resumed after each round, on one thread, two and four.
#[test]
fn any_number_of_threads_comes_to_the_same_bytes() {
    let (triangles, cells) = town();
    let baker = || ExactBaker::new(&triangles, &cells, settings());
    let bytes = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (mut bake, mut saved) = (Bake::new(baker()), Vec::new());
            while bake.advance().is_some() {
                saved.push(bake.save());
                bake = Bake::resume(baker(), &saved[saved.len() - 1]).unwrap();
            }
            assert!(saved.len() > 1, "rounds of the bake: {}", saved.len());
            (saved, bake.finish().to_pvs().unwrap().as_bytes().to_vec())
        })
    };
    let one = bytes(1);
    assert!(bytes(2) == one && bytes(4) == one, "states and sets by two and by four threads");
}

#[test]
fn memory_of_another_scene_does_not_matter() {
    let (triangles, cells) = town();
    let small = SceneTriangles::new(&scene(&[cuboid(DVec3::ZERO, DVec3::ONE)]));
    let baker = ExactBaker::new(&triangles, &cells, settings());
    let mut scratch = BakeScratch::default();
    ExactBaker::new(&small, &cells, settings()).work(0, &mut scratch, &|| false);
    let found = baker.work(7, &mut scratch, &|| false);
    assert_eq!(
        found,
        baker.work(7, &mut BakeScratch::default(), &|| false),
        "work with memory of a small scene"
    );
}

#[test]
fn a_bake_that_ends_early_leaves_objects_open() {
    let (triangles, cells) = town();
    let mut bake = Bake::new(ExactBaker::new(&triangles, &cells, settings()));
    bake.advance().unwrap();
    let outcome = bake.finish();
    assert!(!outcome.complete && outcome.gap() > 0.0, "a bake of one round is not complete");
    assert_eq!(outcome.cells[19].open.len(), 49, "targets open of a viewcell not worked on");
}

#[test]
fn state_of_another_bake_and_damaged_state_are_refused() {
    let (triangles, cells) = town();
    let mut bake = Bake::new(ExactBaker::new(&triangles, &cells, settings()));
    bake.advance().unwrap();
    let saved = bake.save();
    let other = ExactSettings { clearance: 2e-4, ..settings() };
    assert!(Bake::resume(ExactBaker::new(&triangles, &cells, other), &saved).is_err(), "another clearance");
    let fewer = Viewcells::new(cells.cells()[1..].to_vec());
    assert!(
        Bake::resume(ExactBaker::new(&triangles, &fewer, settings()), &saved).is_err(),
        "one viewcell less"
    );
    let mut random = Random(3);
    for _ in 0..200 {
        let mut bytes = saved.clone();
        let at = random.below(bytes.len());
        bytes[at] ^= 1 << random.below(8);
        assert!(
            Bake::resume(ExactBaker::new(&triangles, &cells, settings()), &bytes).is_err(),
            "bit flipped in byte {at}"
        );
    }
    // Random content under a true checksum: refused or loaded, without panic.
    let baker = ExactBaker::new(&triangles, &cells, settings());
    let format = visibility_core::binary_format::Format { magic: *b"VISIBAKE", version: 4 };
    for _ in 0..300 {
        let mut state =
            visibility_core::binary_format::Writer::new(format, ExactBaker::KIND, baker.fingerprint());
        state.u64(0);
        state.u32(0);
        state.u32s((0..random.below(90)).map(|_| random.below(4) as u32 * random.below(60) as u32));
        let _ = Bake::resume(ExactBaker::new(&triangles, &cells, settings()), &state.finish());
    }
}

#[test]
fn forged_counts_of_states_take_no_memory() {
    let mut scene = Scene::new();
    let id = scene.insert(Aabb::from_arrays([5.0; 3], [6.0; 3]));
    scene.set_triangles(id, [[Vec3::splat(5.0), Vec3::splat(5.5), Vec3::new(6.0, 5.0, 6.0)]]).unwrap();
    let triangles = SceneTriangles::new(&scene);
    let cells = Viewcells::new([Viewcell::from_box(DVec3::ZERO, DVec3::ONE)]);
    let baker = || ExactBaker::new(&triangles, &cells, settings());
    let mut bake = Bake::new(baker());
    bake.advance();
    forge_counts(&bake.save(), 0, 1 << 16, |mut state| {
        mend_header(&mut state, 0);
        drop(Bake::resume(baker(), &state).map(|bake| bake.finish()));
    });
}
