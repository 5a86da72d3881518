//! Tests of backface culling on the stored scenes: no triangle whose front is visible is in a culled cluster,
//! and enough of the car is culled.
//!
//! `BACKFACE_EYES=1000000 cargo test --release -p visibility-examples backface_scenes` tries a million
//! eyes per scene.

use crate::shared_scenes;

use glam::{DVec3, Vec3};
use std::collections::HashMap;
use visibility_core::{scene::Triangle, view::Eye};
use visibility_frame::backface::{Cluster, Cones, Facing, NormalCone, cluster_mesh, facing};
use visibility_testing::Random;

/// Number of eyes per scene unless the environment variable `BACKFACE_EYES` gives another number.
const EYES: usize = 400;

/// Merges bit-identical vertices. Returns the distinct positions, and the triangles as indices into the
/// positions.
fn weld(triangles: &[Triangle]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut numbers = HashMap::new();
    let mut positions = Vec::new();
    let mut number = |p: Vec3| {
        *numbers.entry(p.to_array().map(f32::to_bits)).or_insert_with(|| {
            positions.push(p);
            positions.len() as u32 - 1
        })
    };
    let indices = triangles.iter().map(|t| t.map(&mut number)).collect();
    (positions, indices)
}

/// Clusters of a scene with their triangles, cones and planes, and the minimum and maximum corner of the
/// scene.
struct Judge {
    clusters: Vec<(Cluster, Vec<Triangle>)>,
    cones: Cones,
    /// Plane of each triangle of each cluster as structure of arrays: x, y and z of the unit normals, then
    /// offsets.
    planes: Vec<[Vec<f64>; 4]>,
    bounds: [DVec3; 2],
}

impl Judge {
    fn new(name: &str) -> Self {
        let scene = shared_scenes::scene(name);
        let (low, high) = scene.bounds().expect("a scene");
        let mut clusters = Vec::new();
        for object in &scene.objects {
            let (positions, indices) = weld(&object.triangles.view().to_vec());
            for cluster in cluster_mesh(&positions, &indices).expect("its own indices") {
                let triangles: Vec<_> = cluster
                    .triangles
                    .iter()
                    .map(|&t| object.triangles.view().get(t as usize).unwrap())
                    .collect();
                clusters.push((cluster, triangles));
            }
        }
        assert_eq!(
            clusters.iter().map(|(_, t)| t.len()).sum::<usize>(),
            scene.triangle_count(),
            "clusters hold all triangles"
        );
        let planes = clusters.iter().map(|(_, triangles)| planes(triangles)).collect();
        let cones = Cones::new(clusters.iter().map(|(cluster, _)| cluster.cone));
        Self { clusters, cones, planes, bounds: [low.as_dvec3(), high.as_dvec3()] }
    }

    /// Returns a random eye: with even chance inside the scene's box, or around it, at most four times the
    /// box's greatest half-size away from its centre on each axis.
    fn eye(&self, rng: &mut Random) -> DVec3 {
        let [low, high] = self.bounds;
        let (center, half) = ((low + high) * 0.5, (high - low) * 0.5);
        if rng.unit() < 0.5 {
            center + half * rng.vector(1.0)
        } else {
            center + rng.vector(1.0) * half.max_element() * 4.0 * rng.unit()
        }
    }

    /// Adds to `culled` the number of triangles in culled clusters for an eye, and asserts that [`facing`]
    /// finds no front-facing triangle among these. `masks` is overwritten: bit i % 64 of word i / 64 stands
    /// for cluster i, 1 for culled.
    fn check(&self, eye: DVec3, masks: &mut [u64], culled: &mut u64) {
        self.cones.back_facing(&Eye::Point(eye), masks);
        for (i, (cluster, triangles)) in self.clusters.iter().enumerate() {
            if masks[i / 64] >> (i % 64) & 1 == 0 {
                continue;
            }
            *culled += triangles.len() as u64;
            // If all triangles are clearly back-facing by their rounded planes, no exact test is needed.
            let [x, y, z, d] = &self.planes[i];
            let mut worst = f64::NEG_INFINITY;
            for j in 0..x.len() {
                let distance = ((x[j] * eye.x + y[j] * eye.y) + z[j] * eye.z) + d[j];
                worst = if distance < worst { worst } else { distance };
            }
            if worst < -1e-6 {
                continue;
            }
            for triangle in triangles {
                assert_ne!(
                    facing(triangle, &Eye::Point(eye)),
                    Facing::Front,
                    "{eye}, cluster {:?}",
                    cluster.bounds
                );
            }
        }
    }
}

/// Computes the planes of triangles in f64: x, y and z of the unit normals, then offsets, in one list each.
/// With coordinates of hundreds of metres a distance is wrong by less than 1e-9 m. Slivers and degenerate
/// triangles get the zero plane, whose distance 0 forces the exact test.
fn planes(triangles: &[Triangle]) -> [Vec<f64>; 4] {
    let mut planes = [vec![], vec![], vec![], vec![]];
    for t in triangles {
        let [a, b, c] = t.map(|p| p.as_dvec3());
        let (p, q) = (b - a, c - a);
        let cross = p.cross(q);
        let plane = if cross.length() > 1e-6 * p.length() * q.length() {
            let n = cross.normalize();
            [n.x, n.y, n.z, -n.dot(a)]
        } else {
            [0.0; 4]
        };
        planes.iter_mut().zip(plane).for_each(|(row, x)| row.push(x));
    }
    planes
}

/// Returns the number of eyes per scene.
fn eyes() -> usize {
    std::env::var("BACKFACE_EYES").ok().and_then(|n| n.parse().ok()).unwrap_or(EYES)
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn no_front_is_culled_on_any_scene() {
    for name in ["clinic", "clinic_mep", "denhaag", "car", "alpine1", "oa_dm2"] {
        let judge = Judge::new(name);
        let (mut rng, mut culled) = (Random(1), 0);
        let mut masks = vec![0; judge.clusters.len().div_ceil(64)];
        let count = eyes();
        for _ in 0..count {
            judge.check(judge.eye(&mut rng), &mut masks, &mut culled);
        }
        let triangles: usize = judge.clusters.iter().map(|(_, t)| t.len()).sum();
        let share = culled as f64 / count as f64 / triangles as f64;
        println!(
            "{name}: {count} eyes, {} clusters, {triangles} triangles, {:.1} % culled, no front among them",
            judge.clusters.len(),
            100.0 * share
        );
    }
}

/// Returns the fraction of triangles in culled clusters, then the fraction of triangles that the test of
/// single triangles finds back-facing, over 24 random eyes. The eyes are `radii` times half the diagonal of
/// `bounds` from its centre.
fn shares(clusters: &[(NormalCone, Vec<Triangle>)], bounds: [DVec3; 2], radii: f64) -> [f64; 2] {
    let [low, high] = bounds;
    let (center, radius) = ((low + high) * 0.5, (high - low).length() * 0.5);
    let (mut rng, mut culled, mut back, mut all) = (Random(7), 0, 0, 0);
    for _ in 0..24 {
        let direction = loop {
            let v = rng.vector(1.0);
            if (0.01..1.0).contains(&v.length()) {
                break v.normalize();
            }
        };
        let eye = Eye::Point(center + direction * radius * radii);
        for (cone, triangles) in clusters {
            all += triangles.len();
            culled += if cone.facing(&eye) == Facing::Back { triangles.len() } else { 0 };
            back += triangles.iter().filter(|t| facing(t, &eye) == Facing::Back).count();
        }
    }
    [culled, back].map(|n| n as f64 / all as f64)
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn a_fifth_of_the_car_is_culled_at_least() {
    let judge = Judge::new("car");
    let parts: Vec<_> = judge.clusters.iter().map(|(c, t)| (c.cone, t.clone())).collect();
    // All parts of the car are merged, so clusters may contain triangles of several parts.
    let all: Vec<Triangle> = parts.iter().flat_map(|(_, t)| t.iter().copied()).collect();
    let (positions, indices) = weld(&all);
    let whole: Vec<_> = cluster_mesh(&positions, &indices)
        .expect("its own indices")
        .into_iter()
        .map(|c| (c.cone, c.triangles.iter().map(|&t| all[t as usize]).collect::<Vec<_>>()))
        .collect();
    for (name, clusters) in [("by part", &parts), ("as one mesh", &whole)] {
        for radii in [0.5, 1.0, 2.0, 4.0, 100.0] {
            let [culled, back] = shares(clusters, judge.bounds, radii);
            println!(
                "car {name}, eyes at {radii} radii: {:.1} % culled, {:.1} % back",
                100.0 * culled,
                100.0 * back
            );
            assert!(culled >= 0.2 && culled <= back, "{name}, {radii} radii: {culled} culled of {back} back");
        }
    }
}
