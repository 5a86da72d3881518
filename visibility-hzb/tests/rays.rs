//! Contract 2 by rays: the view ray through every sampled point of a covered pixel, corners included, meets
//! an occluder no farther than the pixel's depth key.

use crate::common::{Face, Occluder, Ray, covered_pixels, draw, faces, occluder, view};
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{Aabb, OccluderMesh, Pose, View};
use visibility_hzb::Hzb;
use visibility_testing::{Random, judged};

/// Returns sample points of a pixel, relative to its upper left corner in pixels: the four corners moved
/// inwards by 1e-6, the centre, and a random point.
fn points(random: &mut Random) -> [[f64; 2]; 6] {
    let (low, high) = (1e-6, 1.0 - 1e-6);
    [
        [low, low],
        [high, low],
        [low, high],
        [high, high],
        [0.5, 0.5],
        [random.fine_range(low, high), random.fine_range(low, high)],
    ]
}

/// Asserts that view rays through covered pixels of `hzb` meet one of `faces` no farther than the pixel's
/// depth key. Returns the number of rays and the number of covered pixels. `what` names the case in messages.
pub(crate) fn check(faces: &[Face], view: &View, hzb: &Hzb, random: &mut Random, what: &str) -> [u64; 2] {
    let size = [hzb.width(), hzb.height()];
    let [mut samples, mut pixels] = [0; 2];
    for (column, row, stored) in covered_pixels(hzb) {
        pixels += 1;
        // Pixels whose neighbours hold the same depth key say little, so only one in eight of these is
        // tested.
        let lonely = column == 0
            || row == 0
            || [(column - 1, row), (column + 1, row), (column, row - 1), (column, row + 1)]
                .iter()
                .any(|&(c, r)| f64::from(hzb.depth_key(c, r)) != stored);
        if !lonely && random.below(8) != 0 {
            continue;
        }
        for [x, y] in points(random) {
            let met = Ray::new(view, size, column as f64 + x, row as f64 + y).nearest(faces);
            samples += 1;
            assert!(
                met >= stored - 1e-7 * stored.abs() - 1e-12,
                "{what}: pixel {column},{row} at +{x},+{y}: stored {stored}, met {met}, {} faces, {view:?}",
                faces.len(),
            );
        }
    }
    [samples, pixels]
}

/// Returns boxes side by side and end to end, with the same transform. Some touch, some overlap a little, and
/// some leave gaps narrower than a pixel.
pub(crate) fn room(random: &mut Random) -> Vec<Occluder> {
    let transform = if random.below(2) == 0 { Affine3A::IDENTITY } else { occluder(random).transform };
    let mut low = random.vec3(-2.0, 0.0);
    (0..random.below(6) + 2)
        .filter_map(|_| {
            let high = low + random.vec3(0.1, 2.5);
            let mesh = OccluderMesh::cuboid(&Aabb::new(low, high)).ok()?;
            let axis = random.below(3);
            let gap = [0.0, 0.0, -0.05, 0.003, 0.03][random.below(5)] as f32;
            low[axis] = high[axis] + gap;
            Some(Occluder { mesh, transform })
        })
        .collect()
}

/// Returns meshes made of triangulated sheets, one behind the other, whose triangles are distributed at
/// random. Most edges are shared, within a mesh or between meshes. Some corners are moved a little, and some
/// triangles are missing, repeated or reversed.
pub(crate) fn sheets(random: &mut Random) -> Vec<Occluder> {
    let transform = if random.below(3) == 0 { occluder(random).transform } else { Affine3A::IDENTITY };
    let mut meshes = vec![Vec::new(); random.below(4) + 1];
    let count = meshes.len();
    for sheet in 0..random.below(3) + 1 {
        let (cells, height) = (random.below(4) + 1, [0.0, 0.02, 0.3, 1.5][random.below(4)]);
        let middle = random.vec3(-1.0, 1.0) - Vec3::Z * sheet as f32;
        let folded = random.below(3) == 0;
        let corners: Vec<_> = (0..(cells + 1) * (cells + 1))
            .map(|k| {
                let [i, j] = [k % (cells + 1), k / (cells + 1)].map(|k| k as f32 / cells as f32 - 0.5);
                let up = random.fine_range(-height, height) as f32;
                // A folded sheet goes back and forth in depth, so that folds are seen; other sheets are
                // nearly flat.
                let across = if folded { (k % (cells + 1) % 2) as f32 * 4.0 + up - 2.0 } else { i * 5.0 };
                middle + Vec3::new(across, j * 5.0, if folded { i * 2.0 } else { up })
            })
            .collect();
        for k in 0..cells * cells {
            let a = k / cells * (cells + 1) + k % cells;
            let quad = [a, a + 1, a + cells + 2, a + cells + 1].map(|i| corners[i]);
            for mut t in [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]] {
                if random.below(12) == 0 {
                    t[random.below(3)] += random.vec3(-1.0, 1.0) * [1e-4, 1e-2][random.below(2)];
                }
                if random.below(10) == 0 {
                    t.swap(0, 1);
                }
                for _ in 0..[0, 2, 3, 1, 1, 1, 1, 1, 1, 1, 1, 1][random.below(12)] {
                    meshes[random.below(count)].push(t);
                }
            }
        }
    }
    let two_sided = random.below(2) == 0;
    meshes
        .iter()
        .filter_map(|triangles| OccluderMesh::from_triangles(triangles).ok())
        .map(|mesh| Occluder { mesh: mesh.with_two_sided(two_sided), transform })
        .collect()
}

#[test]
fn covered_pixels_are_covered_and_no_farther_than_they_say() {
    let mut random = Random(7);
    let (mut samples, mut pixels, mut rounds) = (0, 0, 0);
    while samples < 6_000_000 {
        let sizes = [[64, 36], [33, 57], [16, 16], [120, 40]];
        let size = sizes[random.below(4)];
        let mut view = view(&mut random);
        let mut occluders: Vec<_> = (0..random.below(4) + 1).map(|_| occluder(&mut random)).collect();
        if random.below(3) == 0 {
            occluders = sheets(&mut random);
        } else if random.below(2) == 0 {
            occluders = room(&mut random);
            // Views along an axis, in which some edges are horizontal and some vertical.
            if random.below(3) == 0 {
                let eye = random.vec3(-1.0, 1.0).as_dvec3() - 4.0 * DVec3::X;
                let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
                view = View::perspective(pose, 1.0, size[0] as f64 / size[1] as f64, 0.1, f64::INFINITY)
                    .unwrap();
            }
        }
        let hzb = draw(Hzb::new(size[0], size[1]).unwrap(), &occluders, &view);
        let kinds = occluders.iter().map(|o| (o.mesh.is_convex(), o.mesh.is_two_sided(), o.transform));
        let what = format!("round {rounds}, convex, two-sided and transform {:?}", kinds.collect::<Vec<_>>());
        let [s, p] = check(&faces(&occluders), &view, &hzb, &mut random, &what);
        samples += s;
        pixels += p;
        rounds += 1;
        assert!(rounds < 40_000, "too little is covered: {pixels} pixels");
    }
    judged(samples);
}
