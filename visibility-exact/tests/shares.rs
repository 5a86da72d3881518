//! Certified bounds on visible shares are not below sampled shares, and not far above them.

use crate::common;

use common::{clearance, cuboid, few_rays, prepared, quad};
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_exact::{Effort, ExactCuller, ExactSettings, Verdict};
use visibility_testing::Random;

/// Returns the share of clear segments between the face of the viewcell at x = 0 and the face of the box at x
/// = 10. No other faces face each other.
fn sampled(objects: &[Vec<common::Triangle>]) -> f64 {
    let mut random = Random(6);
    let mut point = |x: f64| DVec3::new(x, random.fine_range(-1.0, 1.0), random.fine_range(-1.0, 1.0));
    let clear = (0..20_000).filter(|_| clearance(objects, 0, point(0.0), point(10.0)) > 0.0).count();
    clear as f64 / 20_000.0
}

#[test]
fn bounds_are_above_samples_and_near() {
    let cell = Viewcell::from_box(DVec3::new(-1.0, -1.0, -1.0), DVec3::new(0.0, 1.0, 1.0));
    for width in [0.02, 0.1, 0.3] {
        let at = |y: f64, z: f64| DVec3::new(5.0, y, z);
        let wall = |a: f64, b: f64| quad(at(a, -9.0), at(b, -9.0), at(b, 9.0), at(a, 9.0));
        let target = cuboid(DVec3::new(10.0, -1.0, -1.0), DVec3::new(10.5, 1.0, 1.0));
        let objects = vec![target, wall(-9.0, 0.0), wall(width, 9.0)];
        let triangles = prepared(&objects);
        let truth = sampled(&objects);
        for (share, is_hardly) in [(truth * 1.4 + 0.02, true), (truth * 0.8, false)] {
            let settings = few_rays(ExactSettings::new(Effort::Share(share)));
            let found = ExactCuller::new(triangles.clone(), settings).verdicts(&cell);
            let verdict = found.iter(&triangles).next().unwrap().1;
            if let Verdict::Hardly(bound) = verdict {
                assert!(bound <= share && bound > truth * 0.9, "{width}: {bound}, sampled {truth}");
            }
            assert_eq!(matches!(verdict, Verdict::Hardly(_)), is_hardly, "{width} {share} {verdict:?}");
        }
    }
}
