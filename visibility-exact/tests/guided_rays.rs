//! When a ray finds an object, further rays are aimed beside that object.

use crate::common::{cuboid, prepared};
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_exact::{Effort, ExactCuller, ExactSettings};

/// A far cluster of 400 boxes fills a two-thousandth of all directions. Of twenty thousand rays in all
/// directions only a few meet a box, and further rays past the boxes found see most of the others.
#[test]
fn few_rays_find_most_of_a_far_cluster() {
    let boxes = (0..400).map(|k| {
        let min = DVec3::new(100.0, f64::from(k % 20) * 0.35, f64::from(k / 20) * 0.35);
        cuboid(min, min + 0.25)
    });
    let triangles = prepared(&boxes.collect::<Vec<_>>());
    let settings = ExactSettings::new(Effort::Rays(0)).with_rays(20_000);
    let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
    let [seen, _, open] = ExactCuller::new(triangles, settings).verdicts(&cell).counts();
    assert!(seen > 200 && seen + open == 400, "{seen}");
}
