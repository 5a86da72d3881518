//! Arbitrary text as a map of cells and portals. It must be refused with the number of the line,
//! or be baked to a symmetric matrix.
use visibility_core::bake::Bake;
use visibility_core::cells::CellId;
use visibility_portals::{BakerSettings, CellBaker, CellMatrix, prt};

/// Runs the target on some bytes. Returns whether they were accepted as a map.
pub fn run(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    let Ok(map) = prt::read(text) else { return false };
    let cells = map.graph.cell_count();
    if cells > 300 {
        return true;
    }
    let _ = CellMatrix::from_bytes(cells, bytes);
    let settings = BakerSettings::default().with_steps_per_cell(2_000);
    let Ok(baker) = CellBaker::new(&map.graph, settings) else { return false };
    let mut bake = Bake::new(baker);
    while bake.advance().is_some() {}
    let matrix = bake.finish().matrix;
    let cell = |index: usize| CellId(index as u32);
    for (a, b) in (0..cells).flat_map(|a| (0..a).map(move |b| (cell(a), cell(b)))) {
        assert_eq!(matrix.sees(a, b), matrix.sees(b, a), "whether {a:?} and {b:?} see each other");
    }
    true
}
