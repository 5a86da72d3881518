//! Test of culling by a baked set: an entity is hidden if and only if it is at its baked position and the row
//! of the camera's viewcell does not contain it.

mod common;

use bevy_app::{App, PostUpdate};
use bevy_asset::Assets;
use bevy_camera::prelude::*;
use bevy_camera::primitives::Aabb;
use bevy_camera::visibility::{NoAutoAabb, NoCpuCulling, RenderLayers, VisibilityRange};
use bevy_ecs::entity_disabling::Disabled;
use bevy_ecs::prelude::*;
use bevy_ecs::schedule::SingleThreadedExecutor;
use bevy_light::{DirectionalLight, PointLight, RectLight};
use bevy_math::{Vec3, Vec3A};
use bevy_mesh::{Mesh, Mesh3d, MeshBuilder, Meshable};
use bevy_shape::{Cuboid, Rectangle};
use bevy_transform::prelude::*;
use common::*;
use std::collections::{BTreeSet, HashSet};
use visibility_bake::BakedSet;
use visibility_bevy::{BakedLevel, BakedObject, BakedSetError, CullingPipeline, VisibilityScene};
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Viewcell, Viewcells};
use visibility_core::{Aabb as Bounds, Accuracy, Culler, Object, Scene};
use visibility_testing::Random;

/// Number of the camera that culls by the frustum and the baked set.
const BAKED: Number = Number(1_000_000);
/// Number of a camera at the same position that culls only by the frustum.
const PLAIN: Number = Number(1_000_001);
/// Number of baked objects. Entities with smaller numbers are these objects; other entities have greater
/// numbers.
const OBJECTS: u32 = 600;
/// Number of viewcells: cubes of 10 m in a row along x.
const CELLS: usize = 4;

struct Level {
    boxes: Vec<[[f32; 3]; 2]>,
    rows: Vec<Vec<u32>>,
    file: Vec<u8>,
    version: u64,
}

/// Makes a level of random boxes, and a file as `bake` writes it, with random rows.
fn level(random: &mut Random) -> Level {
    let mut scene = Scene::new();
    let boxes: Vec<[[f32; 3]; 2]> = (0..OBJECTS)
        .map(|_| {
            let min = random.vec3(0.0, 60.0) + Vec3::new(20.0, -30.0, -30.0);
            [min.to_array(), (min + random.vec3(0.1, 2.0)).to_array()]
        })
        .collect();
    scene.insert_batch(boxes.iter().map(|&[min, max]| Bounds::from_arrays(min, max)));
    let rows: Vec<Vec<u32>> =
        (0..CELLS).map(|_| (0..OBJECTS).filter(|_| random.one_in(4)).collect()).collect();
    let viewcells = Viewcells::new((0..CELLS).map(|i| {
        let min = DVec3::new(10.0 * i as f64, -5.0, -5.0);
        Viewcell::from_box(min, min + 10.0)
    }));
    let set = BakedSet::from_rows(&scene, viewcells, &rows).unwrap();
    Level { boxes, rows, file: set.to_bytes(), version: set.version() }
}

/// Returns the local box and the transform of an entity with a given world box.
fn placed([min, max]: [[f32; 3]; 2]) -> (Aabb, Transform) {
    let [min, max] = [min, max].map(Vec3::from_array);
    let half_extents = Vec3A::from((max - min) * 0.5);
    (Aabb { center: Vec3A::ZERO, half_extents }, Transform::from_translation((min + max) * 0.5))
}

/// Bevy world with the entities of a level, spawned in random order and among others.
struct World {
    app: App,
    level: Level,
    /// Numbers of entities that are not at their baked position or not in the bake, and so always visible.
    free: HashSet<u32>,
    hidden: usize,
}

impl World {
    /// Creates the world. `level_first` tells whether the level is inserted before the entities and cameras.
    fn new(level: Level, random: &mut Random, baked: BakedLevel, level_first: bool) -> Self {
        let mut app = app(true);
        let lens = || Projection::Perspective(PerspectiveProjection { fov: 1.5, ..Default::default() });
        let culling = CullingPipeline::frustum().with(baked.culler());
        let mut late = Some(baked);
        if level_first {
            app.world_mut().insert_resource(late.take().unwrap());
        }
        app.world_mut().spawn((BAKED, Camera3d::default(), lens(), culling));
        app.world_mut().spawn((PLAIN, Camera3d::default(), lens(), CullingPipeline::frustum()));
        let mut free = HashSet::new();
        let mut order: Vec<u32> = (0..OBJECTS).collect();
        for last in (1..order.len()).rev() {
            order.swap(last, random.below(last + 1));
        }
        for number in order {
            let (aabb, at) = placed(level.boxes[number as usize]);
            let mut entity = app.world_mut().spawn((drawn(number, at), aabb));
            // Some of the bake's objects get no `BakedObject` component.
            if random.one_in(20) {
                free.insert(number);
            } else {
                entity.insert(BakedObject(number));
            }
            if random.one_in(5) {
                let other = number + OBJECTS;
                free.insert(other);
                app.world_mut().spawn((drawn(other, at), aabb));
            }
        }
        if let Some(baked) = late {
            app.update();
            app.world_mut().insert_resource(baked);
        }
        Self { app, level, free, hidden: 0 }
    }

    /// Runs a frame with both cameras at `x`, and asserts which entities the baked set leaves visible. `cell`
    /// is the viewcell at `x`, `None` outside of all.
    fn check(&mut self, x: f32, cell: Option<usize>) {
        for camera in [BAKED, PLAIN] {
            let camera = entity(&mut self.app, camera).unwrap();
            let at = Transform::from_xyz(x, 0.0, 0.0).looking_at(Vec3::X * 100.0, Vec3::Y);
            self.app.world_mut().entity_mut(camera).insert(at);
        }
        self.app.update();
        let [seen, all] = [BAKED, PLAIN].map(|camera| seen_by(&mut self.app, camera));
        let row = cell.map(|cell| &self.level.rows[cell]);
        let is_shown = |&Number(number): &Number| {
            self.free.contains(&number) || row.is_none_or(|row| row.contains(&number))
        };
        let expected: BTreeSet<Number> = all.iter().copied().filter(is_shown).collect();
        assert_eq!(seen, expected, "from x = {x}");
        self.hidden += all.len() - seen.len();
    }

    fn change(&mut self, number: u32, change: impl FnOnce(EntityWorldMut)) {
        let entity = entity(&mut self.app, Number(number)).unwrap();
        change(self.app.world_mut().entity_mut(entity));
    }

    fn placed_count(&self) -> usize {
        self.app.world().resource::<BakedLevel>().placed_count()
    }
}

fn walk(world: &mut World) {
    for (x, cell) in [(5.0, Some(0)), (5.5, Some(0)), (15.0, Some(1)), (-9.0, None), (35.0, Some(3))] {
        world.check(x, cell);
    }
    let known = OBJECTS as usize - world.free.iter().filter(|&&number| number < OBJECTS).count();
    assert_eq!(world.placed_count(), known, "entities at the places of the bake");
}

#[test]
fn entities_are_hidden_as_the_rows_say() {
    for (seed, level_first) in [(1, true), (2, false)] {
        let random = &mut Random(seed);
        let level = level(random);
        let checked =
            BakedLevel::read(&level.file, Some(level.version), level.boxes.iter().copied()).unwrap();
        let mut world = World::new(level, random, checked, level_first);
        walk(&mut world);
        assert!(world.hidden > 500, "{}", world.hidden);
    }
}

#[test]
fn without_boxes_the_game_is_taken_at_its_word() {
    let random = &mut Random(3);
    let level = level(random);
    let unchecked = BakedLevel::read_unchecked(&level.file).unwrap();
    walk(&mut World::new(level, random, unchecked, true));
}

#[test]
fn what_changes_is_visible_from_then_on() {
    let random = &mut Random(4);
    let level = level(random);
    let baked = BakedLevel::read(&level.file, Some(level.version), level.boxes.iter().copied()).unwrap();
    let mut world = World::new(level, random, baked, true);
    world.check(5.0, Some(0));
    let known: Vec<u32> = (0..OBJECTS).filter(|number| !world.free.contains(number)).collect();
    for (change, &number) in known.iter().step_by(7).enumerate().take(60) {
        world.free.insert(number);
        let (aabb, at) = placed(world.level.boxes[number as usize]);
        match change % 6 {
            // Moves the entity by 1 mm and back. It stays visible, since it counts as changed.
            0 => {
                let moved = at.with_translation(at.translation + Vec3::Y * 1e-3);
                world.change(number, |mut entity| {
                    entity.insert(moved);
                });
                world.check(5.0, Some(0));
                world.change(number, |mut entity| {
                    entity.insert(at);
                });
            }
            1 => world.change(number, |mut entity| {
                let wider = Aabb { half_extents: aabb.half_extents * 1.5, ..aabb };
                entity.insert(wider);
            }),
            2 => world.change(number, |mut entity| {
                entity.insert(Mesh3d::default());
            }),
            3 => world.change(number, |mut entity| {
                entity.remove::<BakedObject>();
            }),
            4 => {
                // Replaces the entity by one without a `BakedObject`.
                world.change(number, |entity| entity.despawn());
                world.app.world_mut().spawn((drawn(number, at), aabb));
            }
            _ => {
                // Returns the entity to its baked position, with a new `BakedObject`.
                world.change(number, |mut entity| {
                    entity.insert((at, BakedObject(number)));
                });
                world.free.remove(&number);
            }
        }
        world.check(5.0 + (change % 3) as f32, Some(0));
        world.check(15.0, Some(1));
    }
    // The scene's change log overflows by as many moves as follow. Moved objects must stay visible, and
    // objects that have not moved must stay hidden.
    for number in 10 * OBJECTS..13 * OBJECTS {
        world.free.insert(number);
        let (aabb, at) = placed(world.level.boxes[number as usize % 100]);
        world.app.world_mut().spawn((drawn(number, at), aabb));
    }
    let hidden = world.hidden;
    world.check(5.0, Some(0));
    world.check(25.0, Some(2));
    assert!(world.hidden > hidden + 50, "{} are hidden, {hidden} were before", world.hidden);
    // While the level is removed, entities move without being recorded.
    let baked = world.app.world_mut().remove_resource::<BakedLevel>().unwrap();
    world.app.update();
    world.app.world_mut().insert_resource(baked);
    world.free.extend(0..OBJECTS);
    world.check(5.0, Some(0));
    assert_eq!(world.placed_count(), 0, "entities at their places after the level came back");
}

#[test]
fn entities_elsewhere_than_in_the_bake_are_visible() {
    let random = &mut Random(5);
    let level = level(random);
    let baked = BakedLevel::read(&level.file, Some(level.version), level.boxes.iter().copied()).unwrap();
    let mut world = World::new(level, random, baked, true);
    let known: Vec<u32> = (0..OBJECTS).filter(|number| !world.free.contains(number)).collect();
    // Indices of wrong objects, and of no object.
    for (&number, wrong) in known.iter().zip([known[50], known[51], OBJECTS, u32::MAX]) {
        world.free.insert(number);
        world.change(number, |mut entity| {
            entity.insert(BakedObject(wrong));
        });
    }
    // An entity larger than its object, one that has moved, and one that is a part of its object.
    for (&number, scale, shift, is_there) in
        [(&known[10], 3.0, 0.0, false), (&known[11], 1.0, 0.01, false), (&known[12], 0.5, 0.01, true)]
    {
        let (_, at) = placed(world.level.boxes[number as usize]);
        let at = Transform { translation: at.translation + shift, scale: Vec3::splat(scale), ..at };
        world.change(number, |mut entity| {
            entity.insert((at, BakedObject(number)));
        });
        if !is_there {
            world.free.insert(number);
        }
    }
    // An entity whose box only becomes known later.
    let (aabb, _) = placed(world.level.boxes[known[9] as usize]);
    world.change(known[9], |mut entity| {
        entity.remove::<Aabb>();
    });
    world.free.insert(known[9]);
    world.check(5.0, Some(0));
    world.change(known[9], |mut entity| {
        entity.insert(aabb);
    });
    world.free.remove(&known[9]);
    world.check(5.0, Some(0));
    walk(&mut world);
}

#[test]
fn files_of_other_levels_are_refused() {
    let random = &mut Random(6);
    let (one, mut other) = (level(random), level(random));
    let read =
        |level: &Level| BakedLevel::read(&one.file, Some(one.version), level.boxes.iter().copied()).err();
    assert_eq!(read(&one), None, "the level's own file");
    assert_eq!(read(&other), Some(BakedSetError::OtherScene), "a level with other boxes");
    other.boxes.clone_from(&one.boxes);
    other.boxes[7][1][2] += 0.001;
    assert_eq!(read(&other), Some(BakedSetError::OtherScene), "a level with a box 1 mm higher");
    other.boxes.clone_from(&one.boxes);
    other.boxes.pop();
    assert_eq!(read(&other), Some(BakedSetError::OtherScene), "a level with a box less");
    assert!(BakedLevel::read_unchecked(&one.file[1..]).is_err(), "a file without its first byte");
    // The level after an edit inside a box: its boxes are the same, and its version differs.
    let (baked, level) = (one.version, one.version ^ 1);
    other = Level { boxes: one.boxes.clone(), version: level, rows: Vec::new(), file: one.file.clone() };
    let refused = BakedLevel::read(&other.file, Some(other.version), other.boxes.iter().copied()).err();
    assert_eq!(
        refused,
        Some(BakedSetError::OtherVersion { baked, level }),
        "a level that was edited inside of a box"
    );
    let accuracy = |level: BakedLevel| level.culler().accuracy();
    let read = |version| BakedLevel::read(&one.file, version, one.boxes.iter().copied()).unwrap();
    assert_eq!(accuracy(read(Some(baked))), Accuracy::Conservative, "a set of a known version");
    assert_eq!(accuracy(read(None)), Accuracy::Approximate, "a set of an unknown version");
    assert_eq!(
        accuracy(BakedLevel::read_unchecked(&one.file).unwrap()),
        Accuracy::Approximate,
        "a set that was not compared"
    );
}

/// A part of a wall that comes late does not fill the gap of another part that is lost.
#[test]
fn a_part_does_not_replace_another() {
    const WALL: u32 = 0;
    const POST: u32 = 1;
    let boxes = [[[20.0, -9.0, -9.0], [21.0, 9.0, 9.0]], [[30.0, -1.0, -1.0], [31.0, 1.0, 1.0]]];
    let mut scene = Scene::new();
    for (number, [min, max]) in boxes.into_iter().enumerate() {
        let bounds = Bounds::from_arrays(min, max);
        scene.insert(Object { occluder: number == WALL as usize, ..Object::new(bounds) });
    }
    let cells = Viewcells::new([Viewcell::from_box(DVec3::new(0.0, -5.0, -5.0), DVec3::new(10.0, 5.0, 5.0))]);
    let set = BakedSet::from_rows(&scene, cells, &[[WALL]]).unwrap();
    let level = BakedLevel::read(&set.to_bytes(), Some(set.version()), boxes).unwrap();
    let mut app = app(true);
    let culling = CullingPipeline::frustum().with(level.culler());
    app.world_mut().insert_resource(level);
    let at = Transform::from_xyz(5.0, 0.0, 0.0).looking_at(Vec3::X * 100.0, Vec3::Y);
    app.world_mut().spawn((BAKED, Camera3d::default(), culling, at));
    let spawn = |app: &mut App, number: u32, of: [[f32; 3]; 2]| {
        let (aabb, at) = placed(of);
        let mesh = Cuboid::from_size(Vec3::from(aabb.half_extents) * 2.0).mesh().build();
        let mesh = Mesh3d(app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh));
        app.world_mut().spawn((Number(number), mesh, NoAutoAabb, at, aabb, BakedObject(number))).id()
    };
    let [low, high] = [[-9.0, 0.0], [0.0, 9.0]].map(|[from, to]| [[20.0, from, -9.0], [21.0, to, 9.0]]);
    spawn(&mut app, POST, boxes[1]);
    let first = spawn(&mut app, WALL, low);
    let check = |app: &mut App, is_hidden: bool, step: &str| {
        app.update();
        assert_eq!(
            !seen_by(app, BAKED).contains(&Number(POST)),
            is_hidden,
            "{step}: whether the post is hidden"
        );
    };
    check(&mut app, true, "the lower part is there");
    app.world_mut().despawn(first);
    check(&mut app, false, "the lower part is gone");
    spawn(&mut app, WALL, high);
    check(&mut app, false, "the upper part has come");
    spawn(&mut app, WALL, low);
    check(&mut app, true, "the lower part is back");
}

/// Nothing is hidden after an occluding wall of the bake changes or disappears, whatever else changes later,
/// until the wall is restored.
#[test]
fn a_wall_that_is_not_as_baked_hides_nothing() {
    /// Indices of the baked objects: a wall, a post behind it, and a box in front of it.
    const WALL: u32 = 0;
    const POST: u32 = 1;
    const BOX: u32 = 2;
    let boxes = [
        [[20.0, -9.0, -9.0], [21.0, 9.0, 9.0]],
        [[30.0, -1.0, -1.0], [31.0, 1.0, 1.0]],
        [[15.0, -3.0, -1.0], [16.0, -2.0, 1.0]],
    ];
    let mut scene = Scene::new();
    for (number, [min, max]) in boxes.into_iter().enumerate() {
        let bounds = Bounds::from_arrays(min, max);
        scene.insert(Object { occluder: number == WALL as usize, ..Object::new(bounds) });
    }
    let cells = Viewcells::new([Viewcell::from_box(DVec3::new(0.0, -5.0, -5.0), DVec3::new(10.0, 5.0, 5.0))]);
    let set = BakedSet::from_rows(&scene, cells, &[[WALL, BOX]]).unwrap();
    let (file, version) = (set.to_bytes(), set.version());
    let spawn = |app: &mut App, number: u32| {
        let (aabb, at) = placed(boxes[number as usize]);
        let mesh = Cuboid::from_size(Vec3::from(aabb.half_extents) * 2.0).mesh().build();
        let mesh = Mesh3d(app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh));
        app.world_mut().spawn((Number(number), mesh, NoAutoAabb, at, aabb, BakedObject(number))).id()
    };
    let started_with = |level: BakedLevel| {
        let mut app = app(true);
        // In the order that the schedule gives, whatever the threads do.
        app.edit_schedule(PostUpdate, |schedule| {
            _ = schedule.set_executor(SingleThreadedExecutor::new());
        });
        let culling = CullingPipeline::frustum().with(level.culler());
        app.world_mut().insert_resource(level);
        let at = Transform::from_xyz(5.0, 0.0, 0.0).looking_at(Vec3::X * 100.0, Vec3::Y);
        let layers = RenderLayers::from_layers(&[0, 40]);
        app.world_mut().spawn((BAKED, Camera3d::default(), culling, at, layers));
        let walls = [WALL, WALL, POST, BOX].map(|number| spawn(&mut app, number));
        (app, walls)
    };
    let started = || started_with(BakedLevel::read(&file, Some(version), boxes).unwrap());
    let changes: [(&str, fn(EntityWorldMut)); 10] = [
        ("moved", |mut wall| wall.get_mut::<Transform>().unwrap().translation.y += 30.0),
        ("of an asset that changes", |mut wall| {
            let (mesh, with_door) = (wall.get::<Mesh3d>().unwrap().id(), Rectangle::default().mesh().build());
            wall.world_scope(|w| *w.resource_mut::<Assets<Mesh>>().get_mut(mesh).unwrap() = with_door);
        }),
        ("of an asset that is removed", |mut wall| {
            let mesh = wall.get::<Mesh3d>().unwrap().id();
            wall.world_scope(|w| _ = w.resource_mut::<Assets<Mesh>>().remove(mesh));
        }),
        ("of another mesh", |mut wall| *wall.get_mut().unwrap() = Mesh3d::default()),
        ("without its mesh", |mut wall| _ = wall.remove::<Mesh3d>()),
        ("out of the scene", |mut wall| _ = wall.insert(NoCpuCulling)),
        ("another object", |mut wall| _ = wall.insert(BakedObject(BOX))),
        ("no object of the bake", |mut wall| _ = wall.remove::<BakedObject>()),
        ("disabled", |mut wall| _ = wall.insert(Disabled)),
        ("despawned", |wall| wall.despawn()),
    ];
    let check = |app: &mut App, is_hidden: bool, name: &str, step: &str| {
        app.update();
        let is_seen = seen_by(app, BAKED).contains(&Number(POST));
        assert_eq!(!is_seen, is_hidden, "the wall is {name}, {step}: whether the post is hidden");
        let camera = entity(app, BAKED).unwrap();
        let pipeline = app.world().get::<CullingPipeline>(camera).unwrap().pipeline();
        assert_eq!(pipeline.accuracy(), Accuracy::Conservative, "the wall is {name}, {step}");
        let mut lacks = 0;
        let scene = app.world().resource::<VisibilityScene>().scene();
        pipeline.for_each_lack(scene, |culler, _| lacks += usize::from(culler == "baked"));
        assert_eq!(lacks > 0, !is_hidden, "the wall is {name}, {step}: what the culler lacks");
    };
    for (name, change) in changes {
        let (mut app, [wall, part, _, other]) = started();
        check(&mut app, true, name, "not yet");
        change(app.world_mut().entity_mut(wall));
        check(&mut app, false, name, "one of its parts");
        app.world_mut().entity_mut(other).insert(BakedObject(BOX));
        check(&mut app, false, name, "and the box is found again");
        spawn(&mut app, WALL);
        check(&mut app, true, name, "and another has taken its place");
        app.world_mut().despawn(part);
        check(&mut app, false, name, "and its other part is gone");
    }
    // Without the level, or with another, nobody tells its culler what changes.
    let removals: [(&str, fn(&mut App, BakedLevel)); 2] = [
        ("removed", |app, _| _ = app.world_mut().remove_resource::<BakedLevel>()),
        ("replaced", |app, other| app.insert_resource(other).update()),
    ];
    for (name, remove) in removals {
        let (mut app, [wall, ..]) = started();
        check(&mut app, true, name, "not yet");
        remove(&mut app, BakedLevel::read(&file, Some(version), boxes).unwrap());
        app.world_mut().entity_mut(wall).insert(VisibilityRange::abrupt(0.0, 1.0));
        app.update();
        assert!(seen_by(&mut app, BAKED).contains(&Number(POST)), "the level is {name}");
    }
    // While a part of the wall may not be drawn for the camera, another does not take its place.
    let limits: [(&str, fn(&mut EntityWorldMut), fn(&mut EntityWorldMut)); 2] = [
        (
            "drawn up to 10 m",
            |wall| _ = wall.insert(VisibilityRange::abrupt(0.0, 10.0)),
            |wall| _ = wall.remove::<VisibilityRange>(),
        ),
        // The camera is on a layer above 30 too, but not on this one.
        (
            "on another layer",
            |wall| _ = wall.insert(RenderLayers::layer(32)),
            |wall| _ = wall.remove::<RenderLayers>(),
        ),
    ];
    for (name, limit, unlimit) in limits {
        let (mut app, [wall, part, _, other]) = started();
        limit(&mut app.world_mut().entity_mut(wall));
        check(&mut app, false, name, "from the start");
        unlimit(&mut app.world_mut().entity_mut(wall));
        limit(&mut app.world_mut().entity_mut(other));
        check(&mut app, true, name, "no longer, but the box is, which hides nothing");
        limit(&mut app.world_mut().entity_mut(wall));
        check(&mut app, false, name, "again");
        app.world_mut().entity_mut(other).insert(BakedObject(BOX));
        check(&mut app, false, name, "and the box is found again");
        app.world_mut().entity_mut(part).insert(BakedObject(WALL));
        check(&mut app, false, name, "and its other part is found again");
        app.world_mut().entity_mut(wall).insert(BakedObject(WALL));
        check(&mut app, false, name, "and is found again itself");
        app.world_mut().get_mut::<Transform>(wall).unwrap().translation.y += 30.0;
        spawn(&mut app, WALL);
        check(&mut app, true, name, "but elsewhere, and another has taken its place");
    }
    // A post that is a lamp from now on shines on what is seen.
    let lights: [(&str, fn(&mut EntityWorldMut)); 3] = [
        ("a point light", |post| _ = post.insert(PointLight::default())),
        ("an area light", |post| _ = post.insert(RectLight::default())),
        ("a sun", |post| _ = post.insert(DirectionalLight::default())),
    ];
    for (name, add_light) in lights {
        // Also if the game's word is taken for its place.
        let (mut app, [.., post, other]) = started_with(BakedLevel::read_unchecked(&file).unwrap());
        let is_seen = |app: &mut App| {
            app.update();
            seen_by(app, BAKED).contains(&Number(POST))
        };
        assert!(!is_seen(&mut app), "the wall hides the post");
        add_light(&mut app.world_mut().entity_mut(post));
        assert!(is_seen(&mut app), "the post is {name}");
        app.world_mut().entity_mut(other).insert(BakedObject(BOX));
        assert!(is_seen(&mut app), "the post is {name}, and the box is found again");
        app.world_mut().entity_mut(post).insert(BakedObject(POST));
        assert!(is_seen(&mut app), "the post is {name}, and is found again itself");
    }
    // If the wall was never found, the post is hidden, but the culler is only approximate.
    let (mut app, [wall, part, ..]) = started();
    for entity in [wall, part] {
        app.world_mut().entity_mut(entity).remove::<BakedObject>();
    }
    app.update();
    let accuracy = app.world().resource::<BakedLevel>().culler().accuracy();
    assert_eq!(accuracy, Accuracy::Approximate, "no entity is the wall of the bake");
}
