//! Test of the exact culler on stored scenes: its check refuses none of the proofs found, and no object is
//! hidden that an item buffer shows, or that a ray reaches at a distance from all occluders.

use crate::shared_scenes::scene;
use std::sync::Arc;
use visibility_core::{RegionCuller, VisibleSet};
use visibility_exact::{Effort::Exact, ExactCuller, ExactSettings, SceneTriangles, Verdict};
use visibility_examples::region::judge::{Effort, Judge};
use visibility_examples::region::{cells, world};
use visibility_examples::walkthrough::World;
use visibility_region::{SamplingCuller, SightLine};
use visibility_testing::distance;

/// Clearance in metres. An object may be hidden if each segment to it is within six clearances of occluders.
const CLEARANCE: f64 = 1e-4;

/// Returns the least distance in metres between a line of sight and the occluders, without the object that it
/// reaches.
fn clearance(world: &World, line: &SightLine) -> f64 {
    let ids = (0..world.source.objects.len()).filter_map(|index| world.scene.id_at(index));
    let occluders = ids.filter(|&id| id != line.id && world.scene.object(id).unwrap().occluder);
    let triangles = occluders.flat_map(|id| &world.source.objects[id.index()].triangles);
    triangles.map(|t| distance(line.eye, line.point, &t)).fold(f64::INFINITY, f64::min)
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn proofs_in_stored_scenes_pass_their_check() {
    for name in ["oa_dm2", "denhaag", "alpine1"] {
        let world = world(scene(name));
        let triangles = Arc::new(SceneTriangles::new(&world.scene));
        let settings = ExactSettings::new(Exact(CLEARANCE)).with_rays(20_000).with_aimed_rays(20);
        let mut culler = ExactCuller::new(triangles.clone(), settings);
        let mut judge = Judge::new(&world, Effort { eyes: 5, side: 96, rays: 0 }).unwrap();
        let mut rays = SamplingCuller::new().with_rays(20_000).with_seed(7);
        let (mut cells, mut hidden, mut sampled) = (0, 0, 0);
        for cell in [0.3, 1.0].into_iter().flat_map(|size| cells::along_walks(&world, 2, [size; 3])) {
            let found = culler.verdicts(&cell);
            assert_eq!(found.refused, 0, "{name}: {cell:?}: proofs that their check refused");
            let mut is_hidden = vec![false; world.source.objects.len()];
            for (id, verdict) in found.iter(&triangles) {
                is_hidden[id.index()] = verdict == Verdict::Hidden;
            }
            let mut drawn = vec![false; is_hidden.len()];
            judge.cubes(&cell, &mut drawn).unwrap();
            for (object, drawn) in drawn.iter().enumerate() {
                assert!(!(*drawn && is_hidden[object]), "{name}: object {object} is drawn from {cell:?}");
            }
            rays.cull(&world.scene, &cell, &mut VisibleSet::new());
            for line in rays.sight_lines().iter().filter(|line| is_hidden[line.id.index()]) {
                let far = clearance(&world, line);
                assert!(far < 6.0 * CLEARANCE, "{name}: object {}: {line:?} is {far} m away", line.id);
            }
            cells += 1;
            hidden += is_hidden.iter().filter(|hidden| **hidden).count();
            sampled += rays.sight_lines().len() + drawn.iter().filter(|drawn| **drawn).count();
        }
        println!("{name}: {cells} viewcells, {hidden} hidden, {sampled} sampled");
        assert!(cells > 2 && hidden > 2000 && sampled > 200, "{name}: {cells}, {hidden}, {sampled}");
    }
}
