//! Objects that a ray from the viewcell reaches are not hidden.
//!
//! Rays search for what a culler hides from a viewcell: rays past edges of occluders, intersected with all
//! triangles, and the rays of the sampling culler, which are guided to gaps.

use crate::common::random_world;
use std::cell::Cell;
use std::collections::BTreeSet;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Accuracy, CullStats, Object, Pose, RegionCuller, Scene, View, VisibleSet};
#[cfg(feature = "papers")]
use visibility_region::VolumetricCuller;
use visibility_region::{ConvexBlockersCuller, ExtendedProjectionCuller, SamplingCuller};
use visibility_testing::{Random, judged, told_enough};

/// Searches random worlds until `trials` objects were hidden. Returns the number of worlds, and the number of
/// objects that the sampling culler has seen.
fn search(cullers: &mut [Box<dyn RegionCuller>], seed: u64, trials: usize, rays: usize) -> [usize; 2] {
    let mut rng = Random(seed);
    let (mut worlds, mut seen, mut hidden_objects) = (0, 0, 0);
    let mut sampling = SamplingCuller::new().with_rays(4 * rays);
    while hidden_objects < trials {
        let scale = rng.pick(&[1.0, 1.0, 1.0, 1e-3, 1e4]);
        let (world, cell) = random_world(&mut rng, scale);
        sampling = sampling.with_seed(worlds as u64);
        sampling.cull(&world.scene, &cell, &mut VisibleSet::new());
        seen += sampling.sight_lines().len();
        for (number, culler) in cullers.iter_mut().enumerate() {
            assert_eq!(culler.accuracy(), Accuracy::Conservative, "culler {number} is conservative");
            let hidden = world.hidden(culler.as_mut(), &cell);
            hidden_objects += hidden.len();
            if let Err((id, eye, direction)) = world.search(&mut rng, &cell, &hidden, rays) {
                panic!(
                    "seed {seed}, world {worlds}, culler {number}: {id} is seen from {eye} along {direction}"
                );
            }
            if let Some(line) = sampling.sight_lines().iter().find(|line| hidden.contains(&line.id)) {
                panic!("seed {seed}, world {worlds}, culler {number}: {line:?}");
            }
        }
        worlds += 1;
    }
    judged((rays * worlds * cullers.len()) as u64);
    [worlds, seen]
}

#[test]
fn no_ray_from_the_cell_reaches_a_hidden_object() {
    let [worlds, seen] = search(&mut [Box::new(ExtendedProjectionCuller::new())], 1, 500, 1000);
    told_enough(worlds < 60 && seen > 20 * worlds, format_args!("{worlds} worlds, {seen} objects seen"));
}

#[test]
fn no_ray_from_the_cell_reaches_what_solids_hide() {
    let mut cullers: Vec<Box<dyn RegionCuller>> = vec![Box::new(ConvexBlockersCuller::new())];
    #[cfg(feature = "papers")]
    cullers.push(Box::new(VolumetricCuller::new()));
    let [worlds, seen] = search(&mut cullers, 3, 300, 1000);
    told_enough(worlds > 2 && seen > 10 * worlds, format_args!("{worlds} worlds, {seen} objects seen"));
}

/// The sweep from 3 by 3 parts of the viewcell, as a culler.
struct Parts(ExtendedProjectionCuller);

impl RegionCuller for Parts {
    fn accuracy(&self) -> Accuracy {
        self.0.accuracy()
    }

    fn cull(&mut self, scene: &Scene, cell: &Viewcell, visible: &mut VisibleSet) -> CullStats {
        self.0.cull_in_parts(scene, cell, 3, visible, &|| false)
    }
}

#[test]
fn no_part_is_begun_after_a_stop() {
    let (world, cell) = random_world(&mut Random(3), 1.0);
    let asked = Cell::new(0);
    let stop = || {
        asked.set(asked.get() + 1);
        true
    };
    let mut visible = VisibleSet::new();
    let all = visible.retain(&world.scene, |_, _| true).visible;
    let stats = ExtendedProjectionCuller::new().cull_in_parts(&world.scene, &cell, 1000, &mut visible, &stop);
    assert_eq!(stats.visible, all, "nothing is removed");
    assert!(asked.get() < 100, "asked {} times for a million parts", asked.get());
}

#[test]
fn no_ray_from_the_cell_reaches_what_is_hidden_from_its_parts() {
    search(&mut [Box::new(Parts(ExtendedProjectionCuller::new()))], 7, 200, 500);
    let (mut rng, mut sweep) = (Random(8), ExtendedProjectionCuller::new());
    let (world, cell) = random_world(&mut rng, 1.0);
    let mut left = |parts: Option<u32>, is_over: bool| {
        let mut visible = VisibleSet::new();
        let stats = match parts {
            Some(parts) => sweep.cull_in_parts(&world.scene, &cell, parts, &mut visible, &|| is_over),
            None => sweep.cull(&world.scene, &cell, &mut visible),
        };
        assert_eq!(stats.visible, visible.count(&world.scene) as u64, "{parts:?} parts");
        visible.count(&world.scene)
    };
    let (all, whole) = (world.scene.len(), left(None, false));
    assert!(whole < all && left(Some(1), false) == whole, "one part is the whole");
    assert_eq!(
        (left(Some(0), false), left(Some(2), true)),
        (all, all),
        "no parts, and a sweep that is over, hide nothing"
    );
}

/// Unions of the sets of two views with different layers: what a culler removes, no ray of either view
/// reaches past the occluders that this view draws.
#[test]
fn no_ray_of_a_view_reaches_what_is_hidden_in_a_union_of_layers() {
    let (mut rng, mut removed) = (Random(21), 0);
    let mut cullers: [Box<dyn RegionCuller>; 2] =
        [Box::new(ExtendedProjectionCuller::new()), Box::new(ConvexBlockersCuller::new())];
    for round in 0..16 {
        let (mut world, cell) = random_world(&mut rng, 1.0);
        for (id, _) in world.bounds.clone() {
            world.scene.set_layers(id, rng.pick(&[0b001, 0b010, 0b011, 0b100, 0b100, 0b111])).unwrap();
        }
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let views = [0b101, 0b110]
            .map(|layers| View::perspective(pose, 1.0, 1.0, 0.1, 100.0).unwrap().with_layers(layers));
        for (number, culler) in cullers.iter_mut().enumerate() {
            let mut both = VisibleSet::new();
            both.clear(&world.scene);
            for view in &views {
                let mut set = VisibleSet::new();
                set.fill(&world.scene, view);
                both.union(&world.scene, &set);
            }
            culler.cull(&world.scene, &cell, &mut both);
            for view in &views {
                let drawn = world.on_layers(view.layers());
                let ids = drawn.bounds.iter().map(|&(id, _)| id);
                let hidden: BTreeSet<_> = ids.filter(|&id| !both.contains(&world.scene, id)).collect();
                removed += hidden.len();
                if let Err((id, eye, direction)) = drawn.search(&mut rng, &cell, &hidden, 500) {
                    panic!("round {round}, culler {number}: {id} is seen from {eye} along {direction}");
                }
            }
        }
    }
    judged(removed as u64);
    told_enough(removed > 100, format_args!("{removed} objects are no test"));
}

/// Sweeps from parts end once no object is found hidden, whether or not the scene has an object that is never
/// culled.
#[test]
fn objects_that_are_never_culled_do_not_make_more_parts() {
    let mut scene = Scene::new();
    scene.insert(Aabb::from_arrays([5.0, -1.0, -1.0], [6.0, 1.0, 1.0]));
    let cell = Viewcell::from_box(DVec3::splat(-0.5), DVec3::splat(0.5));
    let calls = |scene: &Scene| {
        let calls = Cell::new(0);
        let stop = || {
            calls.set(calls.get() + 1);
            false
        };
        ExtendedProjectionCuller::new().cull_in_parts(scene, &cell, 20, &mut VisibleSet::new(), &stop);
        calls.get()
    };
    let without = calls(&scene);
    scene.insert(Object { never_cull: true, ..Object::new(Aabb::from_arrays([8.0; 3], [9.0; 3])) });
    assert_eq!(calls(&scene), without, "calls of the function that may stop the sweeps");
    assert!(without < 40, "{without} calls for an object that the first part sees");
}
