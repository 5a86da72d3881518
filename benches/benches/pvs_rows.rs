//! Benchmark of finding and decoding a row of a potentially visible set: a town of 10,000 objects and 1,024
//! viewcells, of which each sees what is near, and less and less of what is far.

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use visibility_core::glam::DVec2;
use visibility_core::pvs::{Pvs, PvsTargets, Viewcell, ViewcellId, Viewcells};

/// Viewcells and objects on an axis.
const SIDES: [u32; 2] = [32, 100];

fn rows(c: &mut Criterion) {
    let [cells, objects] = SIDES;
    let at = |number: u32, side: u32| {
        DVec2::new(f64::from(number % side) + 0.5, f64::from(number / side) + 0.5) / f64::from(side)
    };
    // Objects are tall or not, and what is seen far away depends on both ends, but not by chance.
    let sees = |cell: u32, object: u32| {
        let tall = f64::from(object.wrapping_mul(2_654_435_761) >> 24) / 256.0;
        at(cell, cells).distance(at(object, objects)) < 0.03 + 0.3 * tall.powi(6)
    };
    let rows: Vec<Vec<u32>> = (0..cells * cells)
        .map(|cell| (0..objects * objects).filter(|&object| sees(cell, object)).collect())
        .collect();
    let viewcells = Viewcells::new((0..cells * cells).map(|cell| {
        let half = DVec2::splat(0.5 / f64::from(cells));
        let (min, max) = (at(cell, cells) - half, at(cell, cells) + half);
        Viewcell::from_box(min.extend(0.0), max.extend(1.0))
    }));
    let before = |ViewcellId(cell): ViewcellId| {
        [1, cells].into_iter().filter_map(move |back| cell.checked_sub(back).map(ViewcellId))
    };
    let pvs =
        Pvs::new(PvsTargets::Objects, (objects * objects) as usize, &rows, before).expect("rows ascend");
    let (mut number, mut bits) = (0, Vec::new());
    c.bench_function("find and decode a row of 10,000 targets", |b| {
        b.iter(|| {
            number = (number + 389) % (cells * cells);
            let eye = at(number, cells).extend(0.5);
            let cell = viewcells.locate(black_box(eye)).expect("a viewcell");
            pvs.write_bits(cell, &mut bits);
            black_box(bits.first().copied())
        });
    });
}

criterion_group!(benches, rows);
criterion_main!(benches);
