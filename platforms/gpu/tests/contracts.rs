//! Tests that each culler reports every object that the card shows without culling.
//!
//! The judge is the card's item buffer, which shares no projection, clipping or raster code with the cullers
//! on the processor. Without an adapter the tests print a note and pass; with the environment variable
//! `VISIBILITY_GPU=required` they fail.

use glam::{DVec3, Vec3};
use visibility_core::occlusion::{HardwareQueries, LateAnswers};
use visibility_core::{
    Aabb, Culler, FrustumCuller, Object, ObjectId, OcclusionCuller, Pipeline, Pose, Scene, View, VisibleSet,
};
use visibility_gpu::{
    CardMap, CardQueries, Delay, Gpu, GpuError, Meshes, NO_ITEM, Painter, Target, TwoPhaseCuller, Viewer,
};
use visibility_hzb::{Hzb, HzbCuller};
use visibility_measure::ItemBuffer;
use visibility_testing::Random;

const SCENES: [&str; 5] = ["plpcity:2,2", "london:12,12", "town:3", "forest:200,84", "office:2,16"];
const SIZE: [u32; 2] = [320, 180];

/// Opens the card; `None` without one.
fn gpu() -> Option<Gpu> {
    match Gpu::open() {
        Ok(gpu) => Some(gpu),
        Err(GpuError::NoAdapter(cause)) if std::env::var_os("VISIBILITY_GPU").is_none() => {
            eprintln!("no graphics adapter, nothing tested: {cause}");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

fn viewer(gpu: &Gpu, scene: &str) -> Viewer {
    Viewer::new(gpu.clone(), scene, SIZE).unwrap()
}

/// Returns the indices of the objects that the card shows without culling.
fn shown(viewer: &mut Viewer, view: &View) -> Vec<usize> {
    viewer.draw_all(view);
    viewer.target.visible(&viewer.gpu).unwrap()
}

#[test]
fn the_item_buffer_of_the_card_is_that_of_the_software() {
    let Some(gpu) = gpu() else { return };
    let mut software = ItemBuffer::new(SIZE[0], SIZE[1]).unwrap();
    for name in SCENES {
        let mut viewer = viewer(&gpu, name);
        for view in viewer.views(4).unwrap() {
            viewer.draw_all(&view);
            let items = viewer.target.items(&gpu).unwrap();
            let scene = &viewer.world.scene;
            let objects = scene.ids().map(|id| (id.index() as u32, scene.triangles(id).unwrap()));
            software.draw(&view, scene.origin(), objects).unwrap();
            let objects = software.visible().objects();
            let key = |row: u32, column: u32| {
                software.object_at(column, row).map_or(NO_ITEM, |object| objects[object].key + 1)
            };
            let positions = (0..SIZE[1]).flat_map(|row| (0..SIZE[0]).map(move |column| (row, column)));
            let other = items
                .iter()
                .zip(positions)
                .filter(|&(&item, (row, column))| item != key(row, column))
                .count();
            // Where surfaces coincide, either object may be shown; at edges, a sample may fall on either
            // side.
            let tied = software.visible().tied_pixels() as usize;
            println!("{name}: {other} other pixels of {}, {tied} are ties", items.len());
            assert!(other <= tied + items.len() / 100, "{name}");
        }
    }
}

#[test]
fn cullers_report_all_that_the_card_shows() {
    let Some(gpu) = gpu() else { return };
    for scene in SCENES {
        let mut viewer = viewer(&gpu, scene);
        let frustum = || Pipeline::new().with(FrustumCuller::new());
        // Occlusion map on the card with the size of the picture.
        let on_card = OcclusionCuller::new(CardMap::new(&gpu, SIZE[0], SIZE[1]));
        let mut pipelines =
            [frustum(), frustum().with(HzbCuller::new(Hzb::default())), frustum().with(on_card)];
        let mut visible = VisibleSet::new();
        let (mut seen, mut reported) = (0, [0; 3]);
        for view in viewer.views(40).unwrap() {
            let shown = shown(&mut viewer, &view);
            seen += shown.len();
            for (number, (pipeline, reported)) in (1..).zip(pipelines.iter_mut().zip(&mut reported)) {
                pipeline.cull(&viewer.world.scene, &view, &mut visible);
                *reported += visible.count(&viewer.world.scene);
                let missing = Viewer::missing(&viewer.world.scene, &shown, &visible);
                assert_eq!(missing, 0, "{scene}, pipeline {number}");
                // The picture drawn after culling equals the picture of all objects.
                let ids = visible.ids(&viewer.world.scene).to_vec();
                viewer.draw(&view, &ids);
                assert_eq!(viewer.target.visible(&gpu).unwrap(), shown, "{scene}");
            }
        }
        let [in_frustum, software, card] = reported;
        println!(
            "{scene}: {seen} shown, {in_frustum} in the frustum, {software} after the z-buffer, {card} after the \
             card's"
        );
        assert!(seen > 0 && software < in_frustum && card < in_frustum, "{scene}");
    }
}

/// Culler by the frustum and by the card's queries.
struct ByQueries {
    culler: OcclusionCuller<HardwareQueries<CardQueries>>,
    visible: VisibleSet,
}

impl ByQueries {
    fn new(viewer: &Viewer, delay: Delay, late: LateAnswers) -> Self {
        let card = CardQueries::new(&viewer.gpu, &viewer.painter, delay);
        // Price 0, since everything drawn is in the depth buffer and no other occluders are needed.
        let culler = OcclusionCuller::new(HardwareQueries::new(card, late)).with_price(0);
        Self { culler, visible: VisibleSet::new() }
    }

    /// Culls, draws the remaining objects, and submits queries. Returns the number of objects in the frustum.
    fn frame(&mut self, viewer: &mut Viewer, view: &View) -> usize {
        let Self { culler, visible } = self;
        let scene = &viewer.world.scene;
        visible.fill(scene, view);
        FrustumCuller::new().cull(scene, view, visible);
        let in_frustum = visible.count(scene);
        culler.cull(scene, view, visible);
        visible.finish(scene);
        let ids: Vec<ObjectId> = visible.ids(scene).to_vec();
        viewer.draw(view, &ids);
        culler.map_mut().device_mut().submit(&viewer.target);
        in_frustum
    }
}

#[test]
fn late_answers_that_count_as_visible_hide_nothing() {
    let Some(gpu) = gpu() else { return };
    for (scene, delay) in SCENES.into_iter().zip([
        Delay::Frames(1),
        Delay::Frames(2),
        Delay::Frames(3),
        Delay::Frames(1),
        Delay::Arrival,
    ]) {
        let mut viewer = viewer(&gpu, scene);
        let mut queries = ByQueries::new(&viewer, delay, LateAnswers::Visible);
        let (mut in_frustum, mut left) = (0, 0);
        for view in viewer.views(6).unwrap() {
            let shown = shown(&mut viewer, &view);
            // The camera stands still until answers have arrived for each level of the hierarchy.
            for frame in 0..12 {
                let all = queries.frame(&mut viewer, &view);
                let missing = Viewer::missing(&viewer.world.scene, &shown, &queries.visible);
                assert_eq!(missing, 0, "{scene}, {delay:?}, frame {frame}");
                let now = queries.visible.count(&viewer.world.scene);
                if frame == 0 {
                    assert_eq!(now, all, "{scene}: no answers are known in a new view");
                } else if frame == 11 {
                    (in_frustum, left) = (in_frustum + all, left + now);
                }
            }
        }
        println!("{scene}, {delay:?}: {in_frustum} in the frustum, {left} left when the camera stands still");
        assert!(left < in_frustum, "{scene}: queries hide something");
    }
}

#[test]
fn trusted_answers_are_right_once_the_camera_stands_still() {
    let Some(gpu) = gpu() else { return };
    for (scene, delay) in [
        ("plpcity:2,2", Delay::Frames(1)),
        ("london:12,12", Delay::Frames(3)),
        ("office:2,16", Delay::Arrival),
    ] {
        let mut viewer = viewer(&gpu, scene);
        let trusted = 4;
        let late = LateAnswers::Trusted { frames: trusted };
        let mut queries = ByQueries::new(&viewer, delay, late);
        let (mut in_frustum, mut left, mut late_objects, mut seen) = (0, 0, 0, 0);
        for view in viewer.views(60).unwrap() {
            let shown = shown(&mut viewer, &view);
            in_frustum += queries.frame(&mut viewer, &view);
            left += queries.visible.count(&viewer.world.scene);
            late_objects += Viewer::missing(&viewer.world.scene, &shown, &queries.visible);
            seen += shown.len();
        }
        println!(
            "{scene}, {delay:?}: {in_frustum} in the frustum, {left} left, {seen} shown, {late_objects} late"
        );
        assert!(left < in_frustum, "{scene}: a moving camera hides, too");
        let last = viewer.views(60).unwrap()[59];
        for frame in 0..20 {
            queries.frame(&mut viewer, &last);
            if frame >= trusted {
                let shown = shown(&mut viewer, &last);
                let missing = Viewer::missing(&viewer.world.scene, &shown, &queries.visible);
                assert_eq!(missing, 0, "{scene}, {delay:?}, frame {frame}");
            }
        }
    }
}

#[test]
fn two_phases_draw_all_that_the_card_shows() {
    let Some(gpu) = gpu() else { return };
    for scene in SCENES {
        let mut viewer = viewer(&gpu, scene);
        let Viewer { world, meshes, painter, target, .. } = &viewer;
        let mut culler = TwoPhaseCuller::new(&gpu, &world.scene, meshes, painter, target);
        let mut frustum = Pipeline::new().with(FrustumCuller::new());
        let mut visible = VisibleSet::new();
        let (mut in_frustum, mut found, mut drawn, mut seen, mut other_pixels) = (0, 0, 0, 0, 0);
        // Each view is drawn twice: first with the visible objects of another view, as after a camera cut,
        // then with those of the same view.
        let views = viewer.views(20).unwrap();
        for (frame, view) in views.into_iter().flat_map(|view| [view, view]).enumerate() {
            let shown = shown(&mut viewer, &view);
            let whole = viewer.target.items(&gpu).unwrap();
            if frame == 20 {
                culler.reset(&gpu);
            }
            frustum.cull(&viewer.world.scene, &view, &mut visible);
            let Viewer { world, meshes, painter, target, .. } = &viewer;
            culler.draw(&gpu, target, meshes, painter, &world.scene, &visible).unwrap();
            let states = culler.states(&gpu).unwrap();
            for &object in &shown {
                assert!(states[object].0, "{scene}, frame {frame}: object {object} is hidden");
            }
            let items = viewer.target.items(&gpu).unwrap();
            other_pixels += items.iter().zip(&whole).filter(|(a, b)| a != b).count();
            assert_eq!(viewer.target.visible(&gpu).unwrap(), shown, "{scene}, frame {frame}");
            if frame % 2 == 1 {
                in_frustum += visible.count(&viewer.world.scene);
                found += states.iter().filter(|state| state.0).count();
                drawn += states.iter().filter(|state| state.1).count();
                seen += shown.len();
            }
        }
        println!(
            "{scene}: {in_frustum} in the frustum, {drawn} drawn, {found} visible, {seen} shown, \
             {other_pixels} other pixels"
        );
        assert!(found < in_frustum && found <= drawn, "{scene}: something is hidden");
        // The order of drawing only matters where surfaces coincide.
        assert!(other_pixels * 1000 < 40 * (SIZE[0] * SIZE[1]) as usize, "{scene}");
    }
}

#[test]
fn pictures_of_any_size_are_read_back_whole() {
    let Some(gpu) = gpu() else { return };
    let mut viewer = viewer(&gpu, "plpcity:1,1");
    let view = viewer.views(1).unwrap()[0];
    for [width, height] in [[1, 1], [61, 7], [64, 64], [65, 3]] {
        viewer.target = Target::new(&gpu, width, height);
        viewer.draw_all(&view);
        assert_eq!(
            viewer.target.items(&gpu).unwrap().len(),
            (width * height) as usize,
            "{width} x {height}: pixels read"
        );
        let Viewer { world, meshes, painter, target, .. } = &viewer;
        let mut culler = TwoPhaseCuller::new(&gpu, &world.scene, meshes, painter, target);
        let shown = target.visible(&gpu).unwrap();
        let mut visible = VisibleSet::new();
        Pipeline::new().with(FrustumCuller::new()).cull(&world.scene, &view, &mut visible);
        for _ in 0..2 {
            culler.draw(&gpu, target, meshes, painter, &world.scene, &visible).unwrap();
            assert_eq!(
                target.visible(&gpu).unwrap(),
                shown,
                "{width} x {height}: objects shown by two phases"
            );
        }
    }
}

#[test]
fn an_empty_scene_is_drawn() {
    let Some(gpu) = gpu() else { return };
    let scene = Scene::new();
    let meshes = Meshes::new(&gpu, &scene);
    let mut painter = Painter::new(&gpu, &meshes);
    let target = Target::new(&gpu, 8, 8);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    painter.look(&gpu, &target, view.clip_from(scene.origin()).as_mat4());
    painter.draw(&gpu, &target, &meshes, &[]);
    assert_eq!(target.visible(&gpu).unwrap(), [0; 0], "an empty scene shows nothing");
}

/// Adds an object: a rectangle perpendicular to the x axis.
fn add_rectangle(scene: &mut Scene, x: f32, [y0, z0]: [f32; 2], [y1, z1]: [f32; 2]) {
    let corners = [[y0, z0], [y1, z0], [y1, z1], [y0, z1]].map(|[y, z]| Vec3::new(x, y, z));
    let id = scene.insert(Object::new(Aabb::from_points(corners)));
    let [a, b, c, d] = corners;
    scene.set_triangles(id, [[a, b, c], [a, c, d]].as_slice()).unwrap();
}

#[test]
fn what_is_never_culled_is_drawn_behind_walls_and_more_objects_are_refused() {
    let Some(gpu) = gpu() else { return };
    let target = Target::new(&gpu, 64, 64);
    let mut scene = Scene::new();
    add_rectangle(&mut scene, 5.0, [-9.0, -9.0], [9.0, 9.0]);
    for x in [8.0, 8.0, 8.0] {
        add_rectangle(&mut scene, x, [-1.0, -1.0], [1.0, 1.0]);
    }
    let ids: Vec<ObjectId> = scene.ids().collect();
    scene.set_never_cull(ids[2], true).unwrap();
    scene.set_bounds(ids[3], Aabb::from_arrays([f32::NEG_INFINITY; 3], [f32::INFINITY; 3])).unwrap();
    let meshes = Meshes::new(&gpu, &scene);
    let painter = Painter::new(&gpu, &meshes);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    painter.look(&gpu, &target, view.clip_from(scene.origin()).as_mat4());
    let mut culler = TwoPhaseCuller::new(&gpu, &scene, &meshes, &painter, &target);
    let mut visible = VisibleSet::new();
    for _ in 0..2 {
        visible.fill(&scene, &view);
        culler.draw(&gpu, &target, &meshes, &painter, &scene, &visible).unwrap();
    }
    let seen: Vec<bool> = culler.states(&gpu).unwrap().into_iter().map(|(is_seen, _)| is_seen).collect();
    assert_eq!(seen, [true, false, true, true], "the wall, what it hides, and what is never culled");
    add_rectangle(&mut scene, 3.0, [-1.0, -1.0], [1.0, 1.0]);
    visible.fill(&scene, &view);
    let refused = culler.draw(&gpu, &target, &meshes, &painter, &scene, &visible);
    assert!(matches!(refused, Err(GpuError::MoreObjects { made_for: 4, found: 5 })), "{refused:?}");
    let mut painter = painter;
    painter.draw(&gpu, &target, &meshes, &scene.ids().collect::<Vec<_>>());
}

/// Posters directly on a wall, with equal depth up to rounding. The first frame only draws the wall, so the
/// second frame tests the posters against the wall.
#[test]
fn a_poster_on_a_wall_is_not_hidden() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(1);
    let target = Target::new(&gpu, 256, 256);
    let mut judged = 0;
    for round in 0..24 {
        // Coordinates are up to a hundred thousand times the distance to the wall.
        let distance = 10.0_f64.powf(random.range(0.0, 2.0));
        let spread = distance * 10.0_f64.powf(random.range(0.0, 5.0));
        let eye = random.vector(spread);
        let wall = (eye.x + distance) as f32;
        let mut scene = Scene::new();
        for _ in 0..60 {
            let middle = [eye.y, eye.z].map(|at| at + random.range(-0.5, 0.5) * distance);
            let half = [(); 2].map(|()| distance * 10.0_f64.powf(random.range(-2.3, -1.0)));
            let corner = |sign: f64| [0, 1].map(|axis: usize| (middle[axis] + sign * half[axis]) as f32);
            add_rectangle(&mut scene, wall, corner(-1.0), corner(1.0));
        }
        let corner = |sign: f64| [eye.y, eye.z].map(|at| (at + sign * 3.0 * distance) as f32);
        add_rectangle(&mut scene, wall, corner(-1.0), corner(1.0));
        let meshes = Meshes::new(&gpu, &scene);
        let mut painter = Painter::new(&gpu, &meshes);
        // Often the view direction is almost perpendicular to the wall, so that the slope of the depth does
        // not cover rounding errors.
        let turn = 10.0_f64.powf(random.range(-6.0, 0.5));
        let target_point = eye + DVec3::new(1.0, random.range(-turn, turn), random.range(-turn, turn));
        let pose = Pose::look_at(eye, target_point, DVec3::Z);
        let view = View::perspective(pose, 1.2, 1.0, 0.1, f64::INFINITY).unwrap();
        painter.look(&gpu, &target, view.clip_from(scene.origin()).as_mat4());
        let all: Vec<ObjectId> = scene.ids().collect();
        painter.draw(&gpu, &target, &meshes, &all);
        let shown = target.visible(&gpu).unwrap();
        let mut culler = TwoPhaseCuller::new(&gpu, &scene, &meshes, &painter, &target);
        let mut visible = VisibleSet::new();
        for only_the_wall in [true, false] {
            visible.fill(&scene, &view);
            visible.retain(&scene, |id, _| !only_the_wall || id.index() == 60);
            visible.finish(&scene);
            culler.draw(&gpu, &target, &meshes, &painter, &scene, &visible).unwrap();
        }
        let states = culler.states(&gpu).unwrap();
        for object in shown {
            assert!(states[object].0, "round {round}: object {object} is hidden");
            judged += 1;
        }
    }
    assert!(judged > 300, "{judged}");
}
