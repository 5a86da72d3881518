//! The state of an interrupted bake with arbitrary changes and a repaired checksum. It must be
//! refused with an error, or resume and run to its end.
use crate::mend;
use visibility_core::bake::Bake;
use visibility_core::{
    cells::{CellGraph, CellId},
    geometry::ConvexPolygon,
    glam::DVec3,
};
use visibility_portals::{BakerSettings, CellBaker, ChainTest};

/// Makes nine rooms in a row, with doors alternately to the left and to the right.
fn rooms() -> CellGraph {
    let door = |room: u32| {
        let (x, y) = (f64::from(room + 1) * 4.0, f64::from(room % 3));
        let corners = [[y, 0.0], [y + 0.8, 0.0], [y + 0.8, 2.0], [y, 2.0]];
        let polygon = ConvexPolygon::new(corners.map(|[y, z]| DVec3::new(x, y, z)));
        (polygon.expect("a rectangle"), [CellId(room), CellId(room + 1)])
    };
    CellGraph::new(9, (0..8).map(door)).expect("doors between rooms")
}

/// Runs the target on some bytes. Returns whether the changed state was resumed.
pub fn run(bytes: &[u8]) -> bool {
    let Some((&[rounds, settings], changes)) = bytes.split_first_chunk::<2>() else { return false };
    let steps_per_cell = if settings & 1 == 0 { u64::MAX } else { 20 };
    let chain_test = if settings & 2 != 0 { ChainTest::Pluecker } else { ChainTest::Separators };
    let settings = BakerSettings::default().with_steps_per_cell(steps_per_cell).with_chain_test(chain_test);
    let graph = rooms();
    let mut bake = Bake::new(CellBaker::new(&graph, settings).expect("rooms that can be baked"));
    for _ in 0..rounds % 4 {
        bake.advance();
    }
    let mut saved = bake.save();
    // Each change is an offset and eight new bytes; an offset near or past the end changes the length
    // instead.
    for change in changes.chunks_exact(10) {
        let place = usize::from(u16::from_le_bytes([change[0], change[1]])) % (saved.len() + 2);
        match saved.get_mut(place..place + 8) {
            Some(bytes) => bytes.copy_from_slice(&change[2..]),
            None => saved.resize(usize::from(change[2]) * 8, change[3]),
        }
    }
    mend(&mut saved);
    let baker = CellBaker::new(&graph, settings).expect("rooms that can be baked");
    let Ok(mut bake) = Bake::resume(baker, &saved) else { return false };
    for _ in 0..1000 {
        if bake.advance().is_none() {
            bake.finish().matrix.to_pvs(&graph).expect("as many cells as the graph");
            return true;
        }
    }
    panic!("no end in a thousand rounds");
}
