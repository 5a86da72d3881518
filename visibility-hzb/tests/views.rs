//! Random views of random occluders: no box that a ray reaches is hidden, nothing panics, and pixels and
//! answers are equal on all instruction sets.

mod common;

use common::boxes::{Checked, points};
use common::{Occluder, Ray, faces, occluder, view};
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{
    Aabb, Culler, OccluderMesh, OcclusionCuller, OcclusionMap, Scene, View, VisibleSet, occlusion::Occlusion,
    simd::Simd,
};
use visibility_hzb::{Coverage, Hzb};
use visibility_testing::Random;

/// Returns huge, tiny or nearly degenerate triangles, for which the rays of the pixel tests are too
/// imprecise. `None` if [`OccluderMesh`] rejects the triangles.
fn extreme(random: &mut Random) -> Option<Occluder> {
    let scale = [1e-20, 1e-6, 1e3, 1e6, 1e12, 1e30][random.below(6)] as f32;
    let triangles: Vec<_> = (0..random.below(3) + 1)
        .map(|_| {
            let a = random.vec3(-1.0, 1.0) * scale;
            [a, random.vec3(-1.0, 1.0) * scale, a + random.vec3(-1.0, 1.0) * 1e-7 * scale]
        })
        .collect();
    let mesh = OccluderMesh::from_triangles(&triangles).ok()?;
    Some(Occluder { mesh: mesh.with_two_sided(random.below(2) == 0), transform: Affine3A::IDENTITY })
}

/// Creates a z-buffer of the given width and height in pixels and draws the occluders into it.
fn draw(occluders: &[Occluder], view: &View, size: [usize; 2], simd: Simd, coverage: Coverage) -> Hzb {
    let mut hzb = Hzb::new(size[0], size[1]).unwrap().with_simd(simd).with_coverage(coverage);
    hzb.begin(view, DVec3::ZERO);
    for o in occluders {
        hzb.add(&o.mesh, &o.transform);
    }
    hzb.flush();
    hzb
}

/// Tests random boxes on `views` random views: instruction sets must agree, and view rays to points of a
/// hidden box must meet an occluder in front of the box.
fn run(views: u64, seed: u64) {
    let mut random = Random(seed);
    let (mut hidden, mut rays) = (0u64, 0u64);
    for round in 0..views {
        let size = [[40, 24], [17, 33], [64, 64]][random.below(3)];
        let view = view(&mut random);
        let mut occluders: Vec<_> = (0..random.below(5) + 1).map(|_| occluder(&mut random)).collect();
        let plain = occluders.len();
        if random.below(4) == 0 {
            occluders.extend(extreme(&mut random));
        }
        let coverage = if random.below(8) == 0 { Coverage::Sampled } else { Coverage::Conservative };
        let maps: Vec<_> =
            Simd::available().map(|simd| draw(&occluders, &view, size, simd, coverage)).collect();
        let first = &maps[0];
        for map in &maps[1..] {
            for row in 0..size[1] {
                for column in 0..size[0] {
                    let (a, b) = (first.depth_key(column, row), map.depth_key(column, row));
                    assert_eq!(a.to_bits(), b.to_bits(), "round {round}, pixel {column},{row}");
                }
            }
        }
        let mut scene = Scene::new();
        let boxes: Vec<_> = (0..40)
            .map(|_| {
                let middle = random.vec3(-9.0, 9.0);
                let most = if random.below(4) == 0 { 3.0 } else { 0.4 };
                let half = random.vec3(0.0, most);
                Aabb::new(middle - half, middle + half)
            })
            .collect();
        scene.insert_batch(boxes.iter().copied());
        for map in &maps {
            let mut set = VisibleSet::new();
            set.fill(&scene, &view);
            OcclusionCuller::new(Checked(map.clone())).cull(&scene, &view, &mut set);
        }
        let matrix = view.clip_from(DVec3::ZERO);
        let all = faces(&occluders[..plain]);
        for bounds in &boxes {
            let answer = first.test(bounds);
            for map in &maps[1..] {
                assert_eq!(map.test(bounds), answer, "round {round}, {bounds:?}");
            }
            if answer != Occlusion::Hidden || coverage == Coverage::Sampled {
                continue;
            }
            hidden += 1;
            for p in points(&mut random, bounds) {
                let clip = matrix * p.extend(1.0);
                let (x, y) = (clip.x / clip.w, clip.y / clip.w);
                // Points outside the picture cannot be seen. Points that extreme occluders may hide are
                // skipped, since rays leave out these occluders.
                if clip.w <= 0.0 || x.abs() > 0.999_999 || y.abs() > 0.999_999 || occluders.len() > plain {
                    continue;
                }
                let pixel = [(x + 1.0) * 0.5 * size[0] as f64, (1.0 - y) * 0.5 * size[1] as f64];
                let ray = Ray::new(&view, size, pixel[0], pixel[1]);
                let own = ray.depth_key(p);
                if ray.is_before_near(p) {
                    continue;
                }
                rays += 1;
                let met = ray.nearest(&all);
                assert!(
                    met > own - 1e-6 * own.abs(),
                    "round {round}: {bounds:?} seen at {p}: met {met}, own {own}, {view:?}"
                );
            }
        }
    }
    println!("{views} views, {hidden} hidden boxes, {rays} rays");
    assert!(hidden > views, "too little is hidden to prove anything");
}

#[test]
fn nothing_that_a_ray_reaches_is_hidden() {
    run(4_000, 1);
}

/// Tests 100,000 random views, which takes a minute or two.
#[test]
#[ignore = "the long form of the test above"]
fn nothing_that_a_ray_reaches_is_hidden_in_a_hundred_thousand_views() {
    run(100_000, 2);
}

#[test]
fn improper_boxes_are_visible() {
    let mut random = Random(3);
    let occluders: Vec<_> = (0..20).map(|_| occluder(&mut random)).collect();
    let view = view(&mut random);
    let hzb = draw(&occluders, &view, [64, 36], Simd::best(), Coverage::Conservative);
    for bounds in [Aabb::EMPTY, Aabb::new(Vec3::NAN, Vec3::NAN), Aabb::new(Vec3::ONE, Vec3::ZERO)] {
        assert_eq!(hzb.test(&bounds), Occlusion::Visible);
    }
    let endless = Aabb::new(Vec3::NEG_INFINITY, Vec3::INFINITY);
    assert_ne!(hzb.test(&endless), Occlusion::Hidden);
}

#[test]
fn a_map_that_was_never_begun_hides_nothing() {
    let hzb = Hzb::new(64, 36).unwrap();
    assert_ne!(hzb.test(&Aabb::from_arrays([1.0; 3], [2.0; 3])), Occlusion::Hidden);
    assert!(Hzb::new(15, 36).is_err() && Hzb::new(64, 4097).is_err());
}
