//! Test of the memory of an additional worker: a clone of a culler for viewcells, without the scene and the
//! data that clones share.

use visibility_core::{RegionCuller, VisibleSet};
use visibility_examples::built_in;
use visibility_examples::region::{cells, world};
use visibility_region::ExtendedProjectionCuller;
use visibility_testing::allocations::{LIVE, PEAK};

#[test]
fn a_worker_beside_the_scene_has_a_few_mebibytes() {
    for (name, size) in [("london", [20.0, 20.0, 3.0]), ("office", [4.0, 4.0, 2.0])] {
        let world = world(built_in(name).unwrap());
        let viewcells = cells::along_walks(&world, 4, size);
        assert!(viewcells.len() > 2, "{name}: {} viewcells", viewcells.len());
        let mut first = ExtendedProjectionCuller::new();
        first.sync(&world.scene);
        let before = LIVE.get();
        PEAK.set(before);
        let mut worker = first.clone();
        for cell in &viewcells {
            worker.cull(&world.scene, cell, &mut VisibleSet::new());
        }
        let (kept, peak) = (LIVE.get() - before, PEAK.get() - before);
        println!("{name}, {} triangles: {kept} bytes kept, {peak} at most", world.source.triangle_count());
        assert!(peak <= 6 << 20 && kept > 1 << 17, "{name}: {kept} bytes kept, {peak} at most");
    }
}
