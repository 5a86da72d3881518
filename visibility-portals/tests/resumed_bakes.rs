//! A bake that is stopped, saved and taken up again gives the same answer as one that is not.

use visibility_core::glam::DVec3;
use visibility_core::{CellGraph, CellId, ConvexPolygon};
use visibility_portals::{BakeError, CellBake, Outcome, Settings};

/// A grid of rooms with doors at odd places.
fn rooms(shift: f64) -> CellGraph {
    let (mut portals, mut state) = (Vec::new(), 7u64);
    for (x, y) in (0..7u32).flat_map(|x| (0..7u32).map(move |y| (x, y))) {
        for (axis, next) in [(0, (x + 1, y)), (1, (x, y + 1))] {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let at = (state >> 40) as f64 / 16_777_216.0 * 2.8 + 0.1;
            let corner = DVec3::new(f64::from(x) * 4.0, f64::from(y) * 4.0, 0.0);
            let n = DVec3::AXES[axis];
            let (u, v) = (DVec3::AXES[(axis + 1) % 2], DVec3::Z);
            let (wall, sense) = (corner + n * 4.0 + DVec3::splat(shift), if axis == 0 { 1.0 } else { -1.0 });
            let mut quad =
                [[at, 0.0], [at + 1.0, 0.0], [at + 1.0, 2.0], [at, 2.0]].map(|[a, b]| wall + u * a + v * b);
            if sense < 0.0 {
                quad.reverse();
            }
            if next.0 < 7 && next.1 < 7 {
                portals.push((
                    ConvexPolygon::new(quad).unwrap(),
                    [CellId(x * 7 + y), CellId(next.0 * 7 + next.1)],
                ));
            }
        }
    }
    CellGraph::new(49, portals).unwrap()
}

fn to_the_end(mut bake: CellBake) -> Outcome {
    while bake.advance().is_some() {}
    bake.finish()
}

#[test]
fn a_saved_bake_goes_on_to_the_same_answer() {
    let graph = rooms(0.0);
    for settings in [Settings::default(), Settings { steps_per_cell: 40, ..Settings::default() }] {
        let whole = to_the_end(CellBake::new(&graph, settings).unwrap());
        assert!(whole.complete && whole.matrix.count() < 49 * 49);
        let mut bake = CellBake::new(&graph, settings).unwrap();
        // Saved and loaded after every round; also before the first and after the last.
        loop {
            let progress = bake.progress();
            bake = CellBake::resume(&graph, settings, &bake.save()).unwrap();
            assert_eq!(bake.progress(), progress);
            if bake.advance().is_none() {
                break;
            }
        }
        assert_eq!(bake.finish(), whole);
    }
}

#[test]
fn damaged_and_foreign_bytes_are_refused() {
    let graph = rooms(0.0);
    let mut bake = CellBake::new(&graph, Settings::default()).unwrap();
    bake.advance();
    let good = bake.save();
    let refused = |graph: &CellGraph, settings, bytes: &[u8]| match CellBake::resume(graph, settings, bytes) {
        Err(BakeError::Saved { problem }) => problem,
        other => panic!("{other:?}"),
    };
    let other = Settings { steps_per_cell: 9, ..Settings::default() };
    assert_eq!(refused(&graph, other, &good), "it is of another map or of other settings");
    assert_eq!(refused(&rooms(1.0), Settings::default(), &good), "it is of another map or of other settings");
    for place in (0..good.len()).step_by(101) {
        let mut bytes = good.clone();
        bytes[place] ^= 0x10;
        refused(&graph, Settings::default(), &bytes);
        refused(&graph, Settings::default(), &good[..place]);
    }
}

/// The checksum is no secret: whoever forges a state gets an answer all the same.
#[test]
fn forged_counts_are_counted_on_as_far_as_numbers_go() {
    let graph = rooms(0.0);
    let bake = CellBake::new(&graph, Settings { steps_per_cell: 40, ..Settings::default() }).unwrap();
    let mut words: Vec<u64> =
        bake.save().chunks_exact(8).map(|word| u64::from_le_bytes(word.try_into().unwrap())).collect();
    words.pop();
    // Steps and rejections of all, then, behind the portals that wait, each cell's portals that gave up and its steps.
    let waiting = words[4] as usize;
    for place in (2..4).chain(5 + waiting..5 + waiting + 2 * 49) {
        words[place] = u64::MAX;
    }
    let sum = words.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, word| {
        let mixed = (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3);
        mixed ^ mixed >> 29
    });
    words.push(sum);
    let forged: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let settings = Settings { steps_per_cell: 40, ..Settings::default() };
    let outcome = to_the_end(CellBake::resume(&graph, settings, &forged).unwrap());
    assert!(outcome.complete && outcome.steps.iter().all(|&steps| steps == u64::MAX));
}
