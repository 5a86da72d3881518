//! Counter of the elementary steps of making polygons, for tests only. Tests of cost assert how the steps
//! grow with the input.

/// Adds one to the counter of elementary steps in tests of this crate; does nothing otherwise.
#[inline]
pub(super) fn step() {
    #[cfg(test)]
    visibility_testing::step();
}

#[cfg(test)]
mod tests {
    use crate::Occluders;
    use alloc::vec::Vec;
    use visibility_core::glam::Vec3;
    use visibility_core::{Aabb, Object, OccluderMesh, Scene, occlusion::Preparation};
    use visibility_testing::steps_of;

    /// Creates a scene with one occluder object for each box, made of its twelve triangles, and prepares the
    /// occluders.
    fn scene(boxes: impl Iterator<Item = Aabb>) -> Scene {
        let mut scene = Scene::new();
        for bounds in boxes {
            let corners = bounds.corners();
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            let triangles: Vec<[Vec3; 3]> =
                OccluderMesh::CUBOID.iter().map(|t| t.map(|i| corners[i as usize])).collect();
            scene.set_triangles(id, triangles).unwrap();
        }
        scene.prepare_occluders(&Preparation::default());
        scene
    }

    /// The steps for twice the boxes may be a little more than twice as many. Comparing each box with each
    /// would take four times as many.
    #[test]
    fn steps_grow_as_boxes_do() {
        type Input = (&'static str, fn(usize, usize) -> Aabb);
        let inputs: [Input; 6] = [
            ("coincident", |_, _| Aabb::from_arrays([0.0; 3], [1.0, 2.0, 3.0])),
            ("nested", |i, _| {
                let half = Vec3::splat(1.0 + i as f32 / 1024.0);
                Aabb::new(-half, half)
            }),
            ("abutting", |i, _| Aabb::from_arrays([i as f32, 0.0, 0.0], [i as f32 + 1.0, 8.0, 0.5])),
            ("overlapping", |i, all| Aabb::from_arrays([i as f32, 0.0, 0.0], [(i + all) as f32, 8.0, 0.5])),
            ("crossing", |i, all| {
                let (at, half) = ((i / 2) as f32, all as f32 / 2.0);
                let turn = |x: f32, y: f32, z: f32| if i % 2 == 0 { [x, y, z] } else { [y, x, z] };
                Aabb::from_arrays(turn(0.0, at, 0.0), turn(half, at + 0.5, 0.5))
            }),
            ("tiles", |i, _| {
                let at = Vec3::new((i % 32) as f32, (i / 32) as f32, 0.0);
                Aabb::new(at, at + Vec3::new(0.75, 0.75, 0.5))
            }),
        ];
        for (what, input) in inputs {
            let steps = [1000, 2000, 4000].map(|all| {
                let scene = scene((0..all).map(|i| input(i, all)));
                steps_of(|| drop(Occluders::new(&scene))) as f64
            });
            std::println!("{what}: {steps:?}");
            // Where a limit is passed between two sizes, the growth is even smaller.
            assert!(steps[1] < 2.6 * steps[0] && steps[2] < 2.6 * steps[1], "{what}: {steps:?}");
            assert!(steps[2] < 4000.0 * 3000.0, "{what}: {steps:?}");
        }
    }

    /// A floor of tiles is one rectangle, which has all of them as its objects.
    #[test]
    fn a_tile_of_a_floor_is_taken_in_once_however_often_it_changed() {
        let tile = |i: usize| {
            let at = Vec3::new((i % 30) as f32, (i / 30) as f32, 0.0);
            Aabb::new(at, at + Vec3::new(1.0, 1.0, 0.5))
        };
        let mut scene = scene((0..900).map(tile));
        let mut occluders = Occluders::new(&scene);
        let ids: Vec<_> = scene.ids().collect();
        let mut change = |ids: &[visibility_core::ObjectId], times| {
            for number in 0..times * ids.len() {
                let id = ids[number % ids.len()];
                scene.set_layers(id, 1 + number as u32 / ids.len() as u32).unwrap();
            }
            let steps = steps_of(|| occluders.sync(&scene));
            std::println!("{times} changes of {} tiles: {steps} steps", ids.len());
            steps
        };
        // The floor falls into its tiles.
        let first = change(&ids[..1], 500);
        assert!(first < 200 * 900, "{first} steps for 500 changes of a tile");
        // Each tile is on its own.
        for round in 0..8 {
            let again = change(&ids[..1], 500);
            assert!(again < 400, "round {round}: {again} steps for 500 more changes of a tile");
        }
        let mut occluders = Occluders::new(&scene);
        scene.set_layers(ids[0], 77).unwrap();
        let one = steps_of(|| occluders.sync(&scene));
        let mut occluders = Occluders::new(&scene);
        ids[..300].iter().for_each(|&id| scene.set_layers(id, 78).unwrap());
        let many = steps_of(|| occluders.sync(&scene));
        let anew = steps_of(|| drop(Occluders::new(&scene)));
        assert!(many < 2 * anew, "{many} steps for 300 changed tiles, {one} for one, {anew} for all anew");
    }
}
