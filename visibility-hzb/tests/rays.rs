//! Contract 2 by rays: through every sampled point of a covered pixel, its corners first of all, a ray meets an occluder no farther than the pixel says.

mod common;

use common::{Occluder, Random, Ray, faces, occluder, view};
use visibility_core::glam::DVec3;
use visibility_core::{OcclusionMap, View};
use visibility_hzb::Hzb;

/// Points of a pixel: corners, a hair inside, the middle, and one anywhere.
fn points(random: &mut Random) -> [[f64; 2]; 6] {
    let (low, high) = (1e-6, 1.0 - 1e-6);
    [
        [low, low],
        [high, low],
        [low, high],
        [high, high],
        [0.5, 0.5],
        [random.within(low, high), random.within(low, high)],
    ]
}

fn check(occluders: &[Occluder], view: &View, hzb: &Hzb, random: &mut Random, what: &str) -> (u64, u64) {
    let size = [hzb.width(), hzb.height()];
    let faces = faces(occluders);
    let (mut samples, mut pixels) = (0, 0);
    for row in 0..size[1] {
        for column in 0..size[0] {
            let stored = f64::from(hzb.nearness(column, row));
            if stored == f64::NEG_INFINITY {
                continue;
            }
            pixels += 1;
            // Pixels within an area of their like say little.
            let lonely = column == 0
                || row == 0
                || [(column - 1, row), (column + 1, row), (column, row - 1), (column, row + 1)]
                    .iter()
                    .any(|&(c, r)| f64::from(hzb.nearness(c, r)) != stored);
            if !lonely && random.below(8) != 0 {
                continue;
            }
            for [x, y] in points(random) {
                let met = Ray::new(view, size, column as f64 + x, row as f64 + y).nearest(&faces);
                samples += 1;
                assert!(
                    met >= stored - 1e-7 * stored.abs() - 1e-12,
                    "{what}: pixel {column},{row} at +{x},+{y}: stored {stored}, met {met}, {:?} triangles {:?}, transforms {:?}, {view:?}",
                    occluders.iter().map(|o| o.mesh.triangles().len()).collect::<Vec<_>>(),
                    occluders.iter().map(|o| (o.mesh.is_convex(), o.mesh.is_two_sided())).collect::<Vec<_>>(),
                    occluders.iter().map(|o| o.transform).collect::<Vec<_>>()
                );
            }
        }
    }
    (samples, pixels)
}

#[test]
fn covered_pixels_are_covered_and_no_farther_than_they_say() {
    let mut random = Random(7);
    let (mut samples, mut pixels, mut rounds) = (0, 0, 0);
    while samples < 1_200_000 {
        let sizes = [[64, 36], [33, 57], [16, 16], [120, 40]];
        let size = sizes[random.below(4) as usize];
        let view = view(&mut random);
        let occluders: Vec<_> = (0..random.below(4) + 1).map(|_| occluder(&mut random)).collect();
        let mut hzb = Hzb::new(size[0], size[1]).unwrap();
        hzb.begin(&view, DVec3::ZERO);
        for o in &occluders {
            hzb.add(&o.mesh, &o.transform);
        }
        hzb.flush();
        let (s, p) = check(&occluders, &view, &hzb, &mut random, &format!("round {rounds}"));
        samples += s;
        pixels += p;
        rounds += 1;
        assert!(rounds < 40_000, "too little is covered: {pixels} pixels");
    }
    println!("{rounds} scenes, {pixels} covered pixels, {samples} rays");
}
