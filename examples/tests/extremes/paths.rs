//! Tests that all instruction sets give equal answers at the extremes. Only bounds tests and the two
//! occlusion maps have more than one implementation.

use super::shown;
use super::strategies::{World, random};
use visibility_core::{Culler, FrustumCuller, Pipeline, VisibleSet, simd::Simd};
use visibility_hzb::{Hom, HomCuller, Hzb, HzbCuller};
use visibility_testing::Random;

/// Returns for each view and object whether `culler`, behind the frustum culler `after`, reports the object,
/// view after view.
fn answers(world: &World, culler: impl Culler + Send + Sync + 'static, after: FrustumCuller) -> Vec<bool> {
    let mut pipeline = Pipeline::new().with(after).with(culler);
    let mut visible = VisibleSet::new();
    world.views.iter().flat_map(|view| shown(world, &mut pipeline, view, &mut visible)).collect()
}

#[test]
fn every_path_gives_the_same_answers() {
    let (mut hidden, mut paths) = (0, 0);
    for seed in 0..200 {
        let world = random(&mut Random(seed)).world;
        let frustum = |simd| {
            answers(&world, FrustumCuller::new().with_simd(simd), FrustumCuller::new().with_simd(simd))
        };
        let narrow = frustum(Simd::PORTABLE);
        for simd in Simd::available() {
            assert_eq!(frustum(simd), narrow, "frustum, {simd:?}, world {seed}");
        }
        let hzb = |simd| {
            let map = Hzb::new(128, 72).expect("a size within bounds").with_simd(simd);
            answers(&world, HzbCuller::new(map), FrustumCuller::new())
        };
        let hom = |simd| {
            let map = Hom::new(128, 128).expect("a size within bounds").with_simd(simd);
            answers(&world, HomCuller::new(map), FrustumCuller::new())
        };
        let narrow = [hzb(visibility_core::simd::Simd::PORTABLE), hom(visibility_core::simd::Simd::PORTABLE)];
        hidden += narrow.iter().flatten().filter(|&&seen| !seen).count();
        paths = 0;
        for simd in visibility_core::simd::Simd::available() {
            assert_eq!([hzb(simd), hom(simd)], narrow, "{simd:?}, world {seed}");
            paths += 1;
        }
    }
    println!("{hidden} answers of hidden, {paths} paths");
    assert!(hidden > 10_000, "{hidden} answers of hidden: too easy");
}
