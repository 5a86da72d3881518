//! A tree behind a hedge: no box around a part of the tree is hidden, and the search soon gives up such
//! boxes.

use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::scene::Triangle;
use visibility_core::{Aabb, Object, Scene};
use visibility_exact::{CellQuery, Effort, ExactSettings, SceneTriangles, Verdict};
use visibility_testing::Random;

/// Makes `count` random leaves, triangles of size `size`, within `half` of `middle` on each axis.
fn leaves(random: &mut Random, count: usize, middle: Vec3, half: Vec3, size: f64) -> Vec<Triangle> {
    let leaf = |random: &mut Random| {
        let at = middle + random.vec3(-1.0, 1.0) * half;
        [at, at + random.vec3(-size, size), at + random.vec3(-size, size)]
    };
    (0..count).map(|_| leaf(random)).collect()
}

#[test]
fn boxes_around_parts_of_a_tree_that_hide_nothing_are_given_up() {
    for seed in 10..13 {
        let mut random = Random(seed);
        let mut scene = Scene::new();
        for (count, x, wide, size) in [(1800, 8.0, 3.0, 0.9), (512, 14.0, 1.0, 0.1)] {
            let triangles = leaves(&mut random, count, Vec3::X * x, Vec3::new(1.0, wide, wide), size);
            let bounds = Aabb::from_points(triangles.as_flattened().iter().copied());
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            scene.set_triangles(id, triangles).unwrap();
        }
        let triangles = SceneTriangles::new(&scene);
        let cell = Viewcell::from_box(DVec3::splat(-1.0), DVec3::splat(1.0));
        let tree = scene.id_at(1).unwrap();
        let mut query = CellQuery::new(&triangles, &cell, ExactSettings::new(Effort::Exact(1e-4))).unwrap();
        query.prove_triangles(&|id| id == tree);
        let verdict = query.verdicts().find(|&(id, _)| id == tree).unwrap().1;
        // With 4,000 nodes for boxes of parts, the query took 21,000 to 40,000 steps.
        assert!(matches!(verdict, Verdict::Seen(_)), "seed {seed}");
        assert!(query.steps() < 10_000, "seed {seed}: {} nodes", query.steps());
    }
}
