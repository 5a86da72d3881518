//! Tests of all types that keep coordinates between calls: the origin of the scene moves between any two
//! calls, and no object that is certainly visible in the world may be hidden.
//!
//! Scene coordinates are relative to an origin, so when the origin moves, equal coordinates mean another
//! place in the world. Trials move the origin, move it and back, move it by amounts that lose bits, move it
//! in a clone with the same ids, set all coordinates again unchanged, and set coordinates so that the world
//! stays in place. The cullers come from the table of `walkthrough`, the methods for viewcells from the table
//! of `region`; types that those tables do not sync are in `live`.

mod live;
mod maps;
mod rooms;
mod world;

use glam::Vec3;
use live::Live;
use visibility_core::pvs::Viewcell;
use visibility_core::{Culler, FrustumCuller, Scene, VisibleSet};
use visibility_examples::region::methods::{self, METHODS};
use visibility_examples::walkthrough::{World, cullers};
use visibility_examples::{SceneSource, SourceObject};
use visibility_testing::Random;
use world::{Camera, disturb, move_origin, surely_seen, triangles_of, world_boxes};

/// Counts of a trial's comparisons.
#[derive(Default, Debug)]
struct Count {
    /// Number of certainly visible objects, all of which were in the culler's set.
    seen: usize,
    hidden: usize,
    /// Number of objects that the frustum leaves and the culler hides.
    occluded: usize,
}

/// Culls one view with the frustum and then a culler. In a quarter of the frames the origin moves between
/// these two. Panics if a certainly visible object is missing.
fn judge(live: &mut dyn Live, scene: &mut Scene, frame: usize, rng: &mut Random, count: &mut Count) {
    let camera = Camera::random(scene, live.reach(), rng);
    let name = live.name().to_owned();
    let culler = live.culler();
    let (mut visible, mut frustum) = (VisibleSet::new(), FrustumCuller::new());
    visible.fill(scene, &camera.view);
    frustum.cull(scene, &camera.view, &mut visible);
    if rng.one_in(4) {
        move_origin(scene, rng);
    }
    let before = visible.count(scene);
    culler.cull(scene, &camera.view, &mut visible);
    visible.finish(scene);
    count.hidden += scene.len() - visible.count(scene);
    count.occluded += before - visible.count(scene);
    if !culler.accuracy().never_hides() {
        return;
    }
    for id in camera.surely_seen(scene, rng) {
        count.seen += 1;
        assert!(
            visible.contains(scene, id),
            "{name}: object {id} is seen in frame {frame} from {}, with the origin at {}, and was hidden",
            camera.eye,
            scene.origin()
        );
    }
}

/// Runs a culler, and syncs it in half of the frames.
fn run(live: &mut dyn Live, seed: u64, frames: usize, count: &mut Count) {
    let mut rng = Random(seed);
    let mut scene = world::scene(&mut rng);
    live.sync(&scene);
    for frame in 0..frames {
        if rng.one_in(3) {
            disturb(&mut scene, &mut rng);
        }
        if rng.one_in(2) {
            live.sync(&scene);
        }
        if rng.one_in(6) {
            disturb(&mut scene, &mut rng);
        }
        judge(live, &mut scene, frame, &mut rng, count);
    }
}

fn run_all(seeds: std::ops::Range<u64>, frames: usize) {
    for make in live::ALL {
        let mut count = Count::default();
        for seed in seeds.clone() {
            run(&mut *make(), seed, frames, &mut count);
        }
        let name = make().name().to_owned();
        println!("{name}: {count:?}");
        assert!(count.seen > frames && count.hidden > frames, "{name}: {count:?} is no test");
        assert!(count.occluded > 0, "{name} hides nothing that the frustum leaves: {count:?}");
    }
}

#[test]
fn live_cullers_hide_nothing_seen_wherever_the_origin_moves() {
    run_all(0..2, 60);
}

#[test]
#[ignore = "minutes"]
fn live_cullers_hide_nothing_seen_in_long_runs() {
    run_all(10..40, 1000);
}

/// Makes a world from a scene, as source for the cullers of the table.
fn source_world(scene: &Scene) -> World {
    let objects = world_objects(scene);
    let origin = scene.origin();
    let source = SceneSource { objects, origin, ..SceneSource::new("moved", Vec3::Z, 0.05) };
    World::with_views(source, Vec::new(), Vec::new(), (64, 36))
}

fn world_objects(scene: &Scene) -> Vec<SourceObject> {
    let triangles = |id: visibility_core::ObjectId| triangles_of(id.index(), &scene.bounds(id).unwrap());
    scene.ids().map(|id| SourceObject::new(format!("object {}", id.index()), triangles(id))).collect()
}

/// Cullers made from a world whose scene then moves, without a sync of their precomputed data.
#[test]
fn known_cullers_hide_nothing_seen_after_the_origin_moved() {
    // The occluders of a level are promised to stand still in the world. Here all objects move, so
    // `hzb-level` is left out.
    let moves = |entry: &String| !entry.contains('+') && !entry.starts_with("hzb-level");
    for entry in cullers::entries().into_iter().filter(moves) {
        let mut count = Count::default();
        for seed in 0..2 {
            let mut rng = Random(seed);
            let mut world = source_world(&world::scene(&mut rng));
            let Ok(mut made) = cullers::parse(&entry, &world) else { continue };
            let mut pipeline = Some(made.remove(0).1).filter(|pipeline| pipeline.accuracy().never_hides());
            let Some(pipeline) = &mut pipeline else { continue };
            for frame in 0..16 {
                if rng.one_in(3) {
                    disturb(&mut world.scene, &mut rng);
                }
                let camera = Camera::random(&world.scene, 12.0, &mut rng);
                let mut visible = VisibleSet::new();
                pipeline.cull(&world.scene, &camera.view, &mut visible);
                count.hidden += world.scene.len() - visible.count(&world.scene);
                for id in camera.surely_seen(&world.scene, &mut rng) {
                    count.seen += 1;
                    assert!(visible.contains(&world.scene, id), "{entry}: object {id} in frame {frame}");
                }
            }
        }
        assert!(count.seen == 0 || count.hidden > 60, "{entry}: {count:?} is no test");
    }
}

#[test]
fn methods_for_viewcells_hide_nothing_seen_wherever_the_origin_moves() {
    for entry in METHODS {
        let name = match entry.name {
            "rays" => "rays:2000",
            "shrink" => "shrink:1",
            name => name,
        };
        let is_slow = ["exact", "share", "volume", "shrink"].contains(&entry.name);
        let mut rng = Random(5);
        let mut world = source_world(&world::scene(&mut rng));
        let mut method = methods::parse(name, &world).unwrap().remove(0).1;
        let mut count = Count::default();
        for frame in 0..if is_slow { 5 } else { 40 } {
            if rng.one_in(2) {
                disturb(&mut world.scene, &mut rng);
            }
            let eye = world.scene.origin() + rng.vector(10.0);
            let half = rng.vector(0.3).abs();
            let cell = Viewcell::from_box(eye - half, eye + half);
            let trial = visibility_examples::region::trial::run(name, method.as_mut(), &world.scene, &cell);
            count.hidden += world.scene.len() - trial.reported.len();
            if !trial.accuracy.never_hides() {
                continue;
            }
            let boxes = world_boxes(&world.scene);
            for _ in 0..4 {
                let eye = eye + half * rng.vector(0.99);
                for id in surely_seen(&boxes, eye, |_| true, &mut rng) {
                    count.seen += 1;
                    let is_reported = trial.reported.binary_search(&(id.index() as u32)).is_ok();
                    assert!(is_reported, "{name}: object {id} is seen from {cell:?} in frame {frame}");
                }
            }
        }
        println!("{name}: {count:?}");
    }
}
