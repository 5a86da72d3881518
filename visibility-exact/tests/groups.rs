//! Objects that the same occluders hide are proven hidden together.

use crate::common::{cuboid, prepared};
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_exact::{Effort, ExactCuller, ExactSettings};

/// A fence of overlapping slats, one behind the other, which hide only together, and rows of boxes behind the
/// fence. With sixteen times as many boxes the search takes only a few times as many nodes.
#[test]
fn many_objects_behind_one_fence_cost_little_more_than_few() {
    let nodes = |rows: u32| {
        let slats = (0..14).map(|k| {
            let min = DVec3::new(20.0 + f64::from(k % 2) * 0.5, f64::from(k) * 2.0 - 14.2, -20.0);
            cuboid(min, min + DVec3::new(0.1, 2.3, 40.0))
        });
        let boxes = (0..8 * rows).map(|k| {
            let min = DVec3::new(60.0 + f64::from(k / 8) * 2.0, f64::from(k % 8) * 2.0 - 7.5, -0.5);
            cuboid(min, min + 1.0)
        });
        let triangles = prepared(&slats.chain(boxes).collect::<Vec<_>>());
        let settings = ExactSettings::new(Effort::Exact(1e-4)).with_kept_proofs();
        let mut culler = ExactCuller::new(triangles, settings);
        let found = culler.verdicts(&Viewcell::from_box(DVec3::splat(-1.5), DVec3::splat(1.5)));
        let [_, hidden, open] = found.counts();
        assert!(hidden >= 8 * rows as usize && open == 0, "{:?}", found.counts());
        let kept: usize = found.proofs.iter().map(|hidden| hidden.proofs.len()).sum();
        assert_eq!(found.proof_count, kept as u64, "proofs counted and kept, {rows} rows of boxes");
        found.nodes
    };
    let (few, many) = (nodes(2), nodes(32));
    assert!(many < 5 * few, "{few} nodes for 16 boxes, {many} for 256");
}
