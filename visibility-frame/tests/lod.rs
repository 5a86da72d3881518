//! Tests of the selector of levels of detail: levels by size, hysteresis, cross-fades, and resets.

use visibility_core::glam::{DVec3, Vec3};
use visibility_core::scene::DrawRange;
use visibility_core::{Aabb, ObjectId, Pipeline, Pose, Scene, View, VisibleSet, view::Window};
use visibility_frame::lod::{Lod, LodSelector, PixelScale};
use visibility_testing::Random;

/// Sizes in pixels that divide the levels of all objects of this file.
const SIZES: &[f32] = &[400.0, 100.0, 25.0];

/// Returns a view from a point on the x axis, along it. With pictures of 1000 rows, an object of one metre
/// has 500 pixels at one metre.
fn view_from(x: f64) -> View {
    let pose = Pose::look_at(DVec3::X * x, DVec3::X * (x + 1.0), DVec3::Z);
    View::perspective(pose, 90f64.to_radians(), 1.0, 0.01, f64::INFINITY).unwrap()
}

/// Returns the box of a pole of one metre, `x` metres from the origin.
fn pole(x: f32) -> Aabb {
    Aabb::from_arrays([x, 0.0, 0.0], [x, 0.0, 1.0])
}

/// World with one pole at the origin and the selector under test.
struct World {
    scene: Scene,
    pole: ObjectId,
    visible: VisibleSet,
    lods: LodSelector,
}

impl World {
    fn new(lods: LodSelector) -> Self {
        let mut scene = Scene::new();
        let pole = scene.insert(pole(0.0));
        Self { scene, pole, visible: VisibleSet::new(), lods }
    }

    /// Runs a frame of a tenth of a second in which the pole has the given size in pixels.
    fn frame(&mut self, pixels: f64) -> Lod {
        self.see(&view_from(-500.0 / pixels))
    }

    fn see(&mut self, view: &View) -> Lod {
        self.visible.fill(&self.scene, view);
        self.lods.select(&self.scene, view, &self.visible, 0.1, |_| SIZES);
        let found = self.lods.selected().iter().find(|(id, _)| *id == self.pole);
        let found = found.expect("the pole is visible").1;
        assert_eq!(self.lods.lod(self.pole), Some(found), "the level of the pole by its id");
        found
    }
}

fn steady(level: u8) -> Lod {
    Lod { level, previous: level, fade: 1.0, opacity: 1.0 }
}

#[test]
fn levels_follow_the_size_in_pixels() {
    for (pixels, level) in
        [(1e9, 0), (401.0, 0), (399.0, 1), (101.0, 1), (99.0, 2), (26.0, 2), (24.0, 3), (0.01, 3)]
    {
        assert_eq!(World::new(LodSelector::new(1000.0)).frame(pixels), steady(level), "{pixels}");
    }
    let mut world = World::new(LodSelector::new(1000.0));
    assert_eq!(world.see(&view_from(0.0)), steady(0), "the eye is at the pole");
    // A parallel view ten metres high has 100 pixels per metre, wherever the eye is.
    let parallel = |x: f64, height: f64| {
        let pose = Pose::look_at(DVec3::X * x, DVec3::X * (x + 1.0), DVec3::Z);
        View::orthographic(pose, Window::centered(height, height), 0.0, 1e6).unwrap()
    };
    for x in [-1.0, -1e5] {
        let mut world = World::new(LodSelector::new(1000.0));
        assert_eq!(world.see(&parallel(x, 4.9)).level, 1, "4.9 m of the world in 1000 rows, from {x}");
        world.lods.reset();
        assert_eq!(world.see(&parallel(x, 5.1)).level, 2, "5.1 m of the world in 1000 rows, from {x}");
    }
}

#[test]
fn a_switch_fades_from_one_level_to_the_other() {
    let mut world = World::new(LodSelector::new(1000.0).with_fade(0.4));
    assert_eq!(world.frame(200.0), steady(1), "the first frame does not fade");
    let mut fades = Vec::new();
    for _ in 0..6 {
        let lod = world.frame(60.0);
        fades.push((lod.previous, lod.level, (lod.fade * 100.0).round()));
    }
    assert_eq!(
        fades,
        [(1, 2, 0.0), (1, 2, 25.0), (1, 2, 50.0), (1, 2, 75.0), (2, 2, 100.0), (2, 2, 100.0)],
        "previous level, level and percent of the fade, by frame"
    );
    // During a fade the level stays. Afterwards it changes to that of the size, even across several levels at
    // once.
    assert_eq!(world.frame(200.0).level, 1, "the fade begins: the level it began with");
    assert_eq!(
        (world.frame(1000.0).level, world.frame(10.0).level),
        (1, 1),
        "the fade goes on, whatever the size"
    );
    assert_eq!(
        (world.frame(10.0).level, world.frame(10.0).level),
        (1, 3),
        "after the fade the level jumps to the size"
    );
    // Without fades, the level changes at once.
    let mut world = World::new(LodSelector::new(1000.0).with_fade(0.0));
    world.frame(200.0);
    assert_eq!(world.frame(10.0), steady(3), "without a fade the level switches at once");
}

#[test]
fn a_trembling_camera_does_not_switch_levels_to_and_fro() {
    let mut rng = Random(1);
    for limit in [400.0, 100.0, 25.0] {
        let mut levels = [Vec::new(), Vec::new()];
        let mut worlds = [0.1, 0.0]
            .map(|share| World::new(LodSelector::new(1000.0).with_hysteresis(share).with_fade(0.05)));
        for _ in 0..300 {
            let pixels = limit * rng.range(0.95, 1.05);
            for (world, levels) in worlds.iter_mut().zip(&mut levels) {
                levels.push(world.frame(pixels).level);
            }
        }
        let switches = levels.map(|levels| levels.windows(2).filter(|pair| pair[0] != pair[1]).count());
        assert!(switches[0] == 0 && switches[1] > 50, "{switches:?}");
    }
}

#[test]
fn hysteresis_ends_at_its_share_of_the_limit() {
    let mut world = World::new(LodSelector::new(1000.0).with_fade(0.0));
    world.frame(200.0);
    assert_eq!(
        [91.0, 89.0, 109.0, 111.0].map(|pixels| world.frame(pixels).level),
        [1, 2, 2, 1],
        "the level switches 10 % beyond the limit of 100 pixels"
    );
}

#[test]
fn an_object_that_becomes_visible_does_not_fade() {
    let mut world = World::new(LodSelector::new(1000.0));
    world.frame(200.0);
    // A frame in which the pole is not in the set.
    let elsewhere = view_from(-500.0).with_layers(0);
    world.visible.fill(&world.scene, &elsewhere);
    world.lods.select(&world.scene, &elsewhere, &world.visible, 0.1, |_| SIZES);
    assert!(
        world.lods.selected().is_empty() && world.lods.lod(world.pole).is_none(),
        "a pole that is not in the set has no level"
    );
    assert_eq!(world.frame(10.0), steady(3), "the pole is back, and does not fade");
    // A reset, a clone of the scene and another object with the same index have no earlier level.
    world.lods.reset();
    assert!(world.lods.lod(world.pole).is_none(), "a reset forgets the level");
    assert_eq!(world.frame(1000.0), steady(0), "the first frame after a reset");
    world.scene = world.scene.clone();
    assert_eq!(world.frame(10.0), steady(3), "the first frame of a clone");
    world.scene.remove(world.pole).unwrap();
    let former = std::mem::replace(&mut world.pole, world.scene.insert(pole(0.0)));
    assert_eq!(
        (world.pole.index(), world.frame(1000.0)),
        (0, steady(0)),
        "the first frame of another object with the same index"
    );
    assert!(
        world.lods.lod(former).is_none() && world.lods.lod(ObjectId::PLACEHOLDER).is_none(),
        "ids that name no object have no level"
    );
}

#[test]
fn opacity_follows_the_draw_range() {
    let mut world = World::new(LodSelector::new(1000.0));
    let range = DrawRange { begin: 10.0, end: 50.0, margin: 10.0 };
    world.scene.set_draw_range(world.pole, range).unwrap();
    for (distance, opacity) in
        [(5.0, 0.0), (10.0, 0.0), (15.0, 0.5), (20.0, 1.0), (40.0, 1.0), (45.0, 0.5), (51.0, 0.0)]
    {
        let found = world.see(&view_from(-distance)).opacity;
        assert!((found - opacity).abs() < 1e-6, "{distance}: {found}");
        assert_eq!(range.opacity(distance as f32), opacity, "the opacity of the range at {distance} m");
    }
    world.lods.set_distance_eye(Some(DVec3::X * 15.0));
    assert!(
        (world.see(&view_from(-1.0)).opacity - 0.5).abs() < 1e-6,
        "15 m from another eye the pole is half opaque"
    );
}

#[test]
fn what_the_contribution_culler_keeps_is_not_transparent() {
    let mut world = World::new(LodSelector::new(1000.0));
    // Without a margin the culler decides, which keeps an object for 5 % beyond its range.
    let ranges = [(0.0, 50.0, [49.9, 50.1]), (10.0, f32::INFINITY, [10.1, 9.9])];
    for (begin, end, distances) in ranges {
        world.scene.set_draw_range(world.pole, DrawRange { begin, end, margin: 0.0 }).unwrap();
        for distance in distances {
            let opacity = world.see(&view_from(-distance)).opacity;
            assert_eq!(opacity, 1.0, "opacity at {distance} m of a range from {begin} to {end} m");
        }
    }
    let faded = DrawRange { begin: 10.0, end: 50.0, margin: 10.0 };
    world.scene.set_draw_range(world.pole, faded).unwrap();
    world.scene.set_never_cull(world.pole, true).unwrap();
    assert_eq!(world.see(&view_from(-5.0)).opacity, 1.0, "opacity of an object that is never culled");
    world.scene.set_never_cull(world.pole, false).unwrap();
    world.scene.set_bounds(world.pole, Aabb::new(Vec3::NAN, Vec3::NAN)).unwrap();
    assert_eq!(world.see(&view_from(-5.0)).opacity, 1.0, "opacity of an object with NaN bounds");
}

/// Tests many objects in random motion against brute force: each level is allowed by the hysteresis, and
/// changes only when it must.
#[test]
fn levels_of_many_objects_are_within_the_hysteresis_of_their_size() {
    let mut rng = Random(2);
    let mut scene = Scene::new();
    let ids = scene.insert_batch((0..500).map(|_| pole(rng.range(2.0, 100.0) as f32)).collect::<Vec<_>>());
    let (mut visible, mut pipeline) = (VisibleSet::new(), Pipeline::new());
    let mut lods = LodSelector::new(1000.0).with_fade(0.0);
    let mut before = vec![None; ids.len()];
    let mut x = 0.0;
    for _ in 0..200 {
        x = f64::clamp(x + rng.range(-1.0, 1.0), -20.0, 1.0);
        pipeline.cull(&scene, &view_from(x), &mut visible);
        lods.select(&scene, &view_from(x), &visible, 0.02, |_| SIZES);
        assert_eq!(lods.selected().len(), ids.len(), "objects with a level");
        for &(id, lod) in lods.selected() {
            let pixels = 500.0 / (f64::from(scene.bounds(id).unwrap().min.x) - x);
            let level = |pixels: f64| SIZES.iter().filter(|&&size| pixels < f64::from(size)).count() as u8;
            let admitted = level(pixels / 0.9)..=level(pixels / 1.1);
            assert!(admitted.contains(&lod.level), "{pixels} {lod:?}");
            if let Some(before) = before[id.index()].replace(lod.level) {
                assert!(
                    before == lod.level || !admitted.contains(&before),
                    "{id}: the level was {before}, is {}, and {admitted:?} are admitted",
                    lod.level
                );
            }
        }
    }
}

#[test]
fn no_setting_panics() {
    let numbers = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, 5e-324, 0.0, -1.0, 1.0];
    let odd = [f32::NAN, f32::INFINITY, -1.0, 0.0, 1e-45, f32::MAX];
    let many = [10.0; 1000];
    for height in numbers {
        for share in numbers {
            for fade in numbers {
                let mut world =
                    World::new(LodSelector::new(height).with_hysteresis(share).with_fade(fade as f32));
                for (x, elapsed) in
                    [(-1.0, 0.1), (-100.0, f32::NAN), (-1e200, -1.0), (0.0, f32::INFINITY), (-3.0, 0.0)]
                {
                    let view = view_from(x);
                    world.visible.fill(&world.scene, &view);
                    world.lods.select(&world.scene, &view, &world.visible, elapsed, |_| {
                        if x < -50.0 { &many } else { &odd }
                    });
                    let lod = world.lods.selected()[0].1;
                    assert!((0.0..=1.0).contains(&lod.fade) && (0.0..=1.0).contains(&lod.opacity), "{lod:?}");
                }
            }
        }
    }
    let scale = PixelScale::new(&view_from(-2.0), DVec3::ZERO, 1000.0);
    assert!(
        (scale.diameter(&pole(0.0)) - 250.0).abs() < 1e-9 && scale.diameter(&pole(-2.0)) == f64::INFINITY,
        "250 pixels for a pole at 2 m, and no bound around the eye"
    );
}
