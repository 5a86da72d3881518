//! Bakes that are stopped, saved and resumed give the same result as uninterrupted bakes.

use visibility_core::bake::{Bake, Baker};
use visibility_core::binary_format::{Format, FormatError, HEADER_LENGTH, Writer};
use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, Scene,
    cells::{CellGraph, CellId},
    geometry::ConvexPolygon,
};
use visibility_portals::{BakerSettings, CellBaker, CellMatrix, ObjectBaker};
use visibility_testing::{forge_counts, mend_header};

/// Returns a grid of 7 by 7 rooms with doors at irregular positions, displaced by `shift` along each axis.
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

fn baker(graph: &CellGraph, settings: BakerSettings) -> CellBaker {
    CellBaker::new(graph, settings).unwrap()
}

/// Returns the result of a bake that is saved and resumed after every round, before the first round and after
/// the last.
fn interrupted<B: Baker>(baker: impl Fn() -> B) -> B::Outcome {
    let mut bake = Bake::new(baker());
    loop {
        let progress = bake.progress();
        bake = Bake::resume(baker(), &bake.save()).unwrap();
        assert_eq!(bake.progress(), progress, "progress after resuming");
        if bake.advance().is_none() {
            return bake.finish();
        }
    }
}

#[test]
fn a_saved_bake_goes_on_to_the_same_answer() {
    let graph = rooms(0.0);
    let limits = [BakerSettings::default().with_steps_per_cell(40), BakerSettings::default().with_depth(1)];
    for settings in [BakerSettings::default()].into_iter().chain(limits) {
        let whole = Bake::new(baker(&graph, settings)).run();
        assert!(
            whole.complete && whole.matrix.count() < 49 * 49,
            "{settings:?}: the bake is complete, and hides something"
        );
        assert_eq!(interrupted(|| baker(&graph, settings)), whole, "{settings:?}: the interrupted bake");
    }
}

#[test]
fn a_saved_bake_of_objects_goes_on_to_the_same_answer() {
    let mut graph = rooms(0.0);
    let mut scene = Scene::new();
    let boxes: Vec<[DVec3; 2]> = (0..49u32)
        .map(|i| {
            let min = DVec3::new(f64::from(i / 7) * 4.0 + 0.3, f64::from(i % 7) * 4.0 + 0.3, 0.5);
            [min, min + 0.2]
        })
        .collect();
    let ids = boxes.iter().map(|&[min, max]| scene.insert(Aabb::new(min.as_vec3(), max.as_vec3())));
    graph.set_objects((0..).map(CellId).zip(ids)).unwrap();
    let cells = Bake::new(baker(&graph, BakerSettings::default())).run();
    let bounds = |id: visibility_core::ObjectId| boxes.get(id.index()).copied();
    for steps_per_cell in [u64::MAX, 12] {
        let settings = BakerSettings::default().with_steps_per_cell(steps_per_cell);
        let new = || ObjectBaker::new(&graph, &cells, bounds, settings).unwrap();
        let whole = Bake::new(new()).run();
        assert_eq!(
            whole.fallbacks.is_empty(),
            steps_per_cell == u64::MAX,
            "{steps_per_cell} steps: cells that fall back"
        );
        assert!(
            whole.complete && whole.rows.iter().any(|row| row.len() > 1),
            "{steps_per_cell} steps: the bake is complete, and a cell sees several objects"
        );
        assert_eq!(interrupted(new), whole, "{steps_per_cell} steps: the interrupted bake");
        // A bake that is stopped early keeps at least the objects of the complete bake.
        let mut bake = Bake::new(new());
        bake.advance();
        let stopped = bake.clone().finish();
        assert!(
            !stopped.complete && stopped.fallbacks.len() >= whole.fallbacks.len(),
            "{steps_per_cell} steps: a stopped bake falls back more often"
        );
        for (less, more) in whole.rows.iter().zip(&stopped.rows) {
            assert!(
                less.iter().all(|object| more.binary_search(object).is_ok()),
                "{steps_per_cell} steps: a stopped bake hides more"
            );
        }
        // A row with an object of no cell is refused, and one that lacks the object in its own cell. The
        // first row follows the header, the steps, the list of 33 cells that wait, and its own kind, steps
        // and count.
        let saved = bake.save();
        let row = HEADER_LENGTH + 12 + 33 * 4 + 16;
        let mut unknown = saved.clone();
        let last = row + 4 * (usize::from(saved[row - 4]) - 1);
        unknown[last..last + 4].copy_from_slice(&1000u32.to_le_bytes());
        let mut lacking = saved.clone();
        lacking.drain(row..row + 4);
        lacking[row - 4] -= 1;
        for (mut forged, said) in [(unknown, "an unknown object"), (lacking, "an object that is in it")] {
            mend_header(&mut forged, 0);
            let refused = Bake::resume(new(), &forged).unwrap_err().to_string();
            assert!(refused.contains(said), "{steps_per_cell} steps: {refused}, not {said}");
        }
        // The fingerprint depends on all input of the bake.
        let moved = |id: visibility_core::ObjectId| boxes.get(id.index()).map(|&[min, max]| [min, max + 0.1]);
        let other = ObjectBaker::new(&graph, &cells, moved, settings).unwrap();
        assert_eq!(
            Bake::resume(other, &saved).err(),
            Some(FormatError::Fingerprint),
            "{steps_per_cell} steps: another box of an object"
        );
        let cells = Bake::resume(baker(&graph, settings), &saved);
        assert_eq!(
            cells.err(),
            Some(FormatError::Kind { found: 1, expected: 0 }),
            "{steps_per_cell} steps: a bake of cells from that of objects"
        );
    }
}

#[test]
fn damaged_and_foreign_bytes_are_refused() {
    let graph = rooms(0.0);
    let mut bake = Bake::new(baker(&graph, BakerSettings::default()));
    bake.advance();
    let good = bake.save();
    let refused =
        |graph: &CellGraph, settings, bytes: &[u8]| Bake::resume(baker(graph, settings), bytes).unwrap_err();
    let other = BakerSettings::default().with_steps_per_cell(9);
    assert_eq!(refused(&graph, other, &good), FormatError::Fingerprint, "other settings");
    assert_eq!(
        refused(&rooms(1.0), BakerSettings::default(), &good),
        FormatError::Fingerprint,
        "another graph"
    );
    for place in (0..good.len()).step_by(101) {
        let mut bytes = good.clone();
        bytes[place] ^= 0x10;
        refused(&graph, BakerSettings::default(), &bytes);
        refused(&graph, BakerSettings::default(), &good[..place]);
    }
}

/// A saved state with a valid checksum may be forged; a bake resumed from it must not panic.
#[test]
fn forged_counts_are_counted_on_as_far_as_numbers_go() {
    let graph = rooms(0.0);
    let settings = BakerSettings::default().with_steps_per_cell(40);
    let saved = Bake::new(baker(&graph, settings)).save();
    let forged = |change: &dyn Fn(&mut [u8])| {
        let mut content = saved[HEADER_LENGTH..].to_vec();
        change(&mut content);
        let format = Format { magic: saved[..8].try_into().unwrap(), version: 4 };
        let fingerprint = u64::from_le_bytes(saved[16..24].try_into().unwrap());
        let mut writer = Writer::new(format, 0, fingerprint);
        writer.bytes(&content);
        Bake::resume(baker(&graph, settings), &writer.finish())
    };
    let waiting = u32::from_le_bytes(saved[48..52].try_into().unwrap()) as usize;
    // Offsets of the fallbacks and the steps of each cell. They follow the total of steps, the list of
    // waiting portals and the number of rejections.
    let counts = 12 + 4 * waiting..12 + 4 * waiting + 8 + 49 * 12;
    let outcome = forged(&|content| {
        content[..8].fill(255);
        content[counts.clone()].fill(255);
    });
    let outcome = outcome.unwrap().run();
    assert!(
        outcome.complete && outcome.steps.iter().all(|&steps| steps == u64::MAX),
        "counts at their limits do not overflow"
    );
    // The list of waiting portals has one that does not exist, or one that is listed twice.
    for portal in [u32::MAX, waiting as u32, 0] {
        let error = forged(&|content| content[16..20].copy_from_slice(&portal.to_le_bytes())).unwrap_err();
        assert!(error.to_string().contains("unknown or out of order"), "{error}");
    }
}

#[test]
fn forged_counts_of_states_take_no_memory() {
    let graph = small();
    let mut bake = Bake::new(baker(&graph, BakerSettings::default()));
    let first = bake.save();
    bake.advance();
    for state in [first, bake.save()] {
        forge_counts(&state, 0, 1 << 18, |mut state| {
            mend_header(&mut state, 0);
            let bake = Bake::resume(baker(&graph, BakerSettings::default()), &state);
            drop(bake.map(|bake| bake.finish()));
        });
    }
    let cells = bake.run();
    let objects = || ObjectBaker::new(&graph, &cells, |_| None, BakerSettings::default()).unwrap();
    let mut bake = Bake::new(objects());
    bake.advance();
    forge_counts(&bake.save(), 0, 1 << 18, |mut state| {
        mend_header(&mut state, 0);
        drop(Bake::resume(objects(), &state).map(|bake| bake.finish()));
    });
    // The format of a matrix has no counts: the number of bytes must match the number of cells.
    for cells in [usize::MAX, 1 << 32, 1 << 20, 50] {
        assert!(CellMatrix::from_bytes(cells, &[0; 64]).is_none(), "{cells} cells of 64 bytes");
    }
}

/// Returns three rooms in a row.
fn small() -> CellGraph {
    let door = |x: f64| {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]];
        ConvexPolygon::new(corners.map(|[y, z]| DVec3::new(x, y, z))).unwrap()
    };
    let portals = [(door(4.0), [CellId(0), CellId(1)]), (door(8.0), [CellId(1), CellId(2)])];
    CellGraph::new(3, portals).unwrap()
}
