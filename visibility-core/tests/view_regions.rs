//! Regions of views: which views they contain, that their planes hold all that these views see, and that a
//! pipeline keeps an answer only while everything that it depends on stays the same.

use visibility_core::glam::{DMat4, DQuat, DVec3, DVec4, Vec3};
use visibility_core::view::{Depth, Eye, Reach, ViewRegion, Window};
use visibility_core::{Aabb, Culler, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
use visibility_testing::{Random, judged, told_enough};

fn perspective(random: &mut Random) -> View {
    let eye = random.vector(50.0);
    let pose = Pose::look_at(eye, eye + random.direction(), random.direction());
    let window = Window {
        left: -random.fine_range(-0.2, 1.2),
        right: random.fine_range(0.3, 1.2),
        bottom: -random.fine_range(0.1, 1.0),
        top: random.fine_range(0.1, 1.0),
    };
    // A third of the windows are narrow, of 1 to 10 degrees.
    let (wide, high) = (random.fine_range(0.01, 0.1), random.fine_range(0.01, 0.1));
    let narrow = Window::centered(2.0 * wide, 2.0 * high);
    let window = if random.one_in(3) { narrow } else { window };
    let near = random.pick(&[0.01, 0.1, 1.0]);
    let far = if random.one_in(2) { f64::INFINITY } else { near * random.fine_range(2.0, 200.0) };
    View::perspective_off_center(pose, window, near, far).unwrap()
}

/// Returns a view moved by a vector and turned about its own eye.
fn moved(view: &View, by: DVec3, turn: DQuat) -> View {
    let Eye::Point(eye) = view.eye(view.origin()) else { return *view };
    let about = |at: DVec3, by: DMat4| DMat4::from_translation(at) * by * DMat4::from_translation(-at);
    let matrix = view.clip_from(view.origin()) * about(eye, DMat4::from_quat(turn.inverse()));
    View::from_clip_from_world(matrix, view.depth()).unwrap().relative_to(view.origin() + by).unwrap()
}

#[test]
fn a_region_contains_the_views_within_its_reach_and_no_others() {
    let mut random = Random(1);
    for trial in 0..20_000 {
        let view = perspective(&mut random);
        let reach = Reach::new(random.pick(&[0.0, 0.05, 2.0]), random.pick(&[0.0, 0.02, 0.2]));
        let Some(region) = ViewRegion::around(&view, reach) else { continue };
        let (direction, axis) = (random.direction(), random.direction());
        let at = |metres: f64, radians: f64| {
            moved(&view, direction * metres, DQuat::from_axis_angle(axis, radians))
        };
        let (metres, radians) = (reach.metres(), reach.radians());
        assert!(region.contains(&at(metres * 0.9999, radians * 0.9999)), "trial {trial}: within");
        assert!(!region.contains(&at(metres * 1.001 + 1e-6, 0.0)), "trial {trial}: moved too far");
        assert!(!region.contains(&at(0.0, radians * 1.001 + 1e-5)), "trial {trial}: turned too far");
    }
}

/// A point that a view of the region sees is inside the region's planes. If it is outside the picture, the
/// region's margin holds it.
#[test]
fn planes_and_margin_hold_what_the_views_see() {
    let mut random = Random(2);
    let (mut seen, mut beside, mut outside_halved) = (0, 0, 0);
    for trial in 0..6_000 {
        let view = perspective(&mut random);
        let reach = Reach::new(random.pick(&[0.0, 0.05, 0.5]), random.pick(&[0.0, 0.05, 0.3, 0.9]));
        let Some(region) = ViewRegion::around(&view, reach) else { continue };
        let halved =
            ViewRegion::around(&view, Reach::new(0.5 * reach.metres(), 0.5 * reach.radians())).unwrap();
        let origin = random.vector(9.0);
        let (planes, of_halved, margin) =
            (region.planes(origin), halved.planes(origin), region.margin(origin));
        for _ in 0..40 {
            let part = if random.one_in(3) { random.fine_unit() } else { 1.0 - 1e-7 };
            let turn = DQuat::from_axis_angle(random.direction(), reach.radians() * part);
            let other = moved(&view, random.direction() * (reach.metres() * (1.0 - 1e-7)), turn);
            let inverse = other.clip_from(origin).inverse();
            // Mostly on the sides of the picture. Depth of views without a far plane, and of others,
            // reversed.
            let side = random.pick(&[-1.0, 1.0]);
            let along = random.fine_range(-1.0, 1.0);
            let depth = [1.0, 0.0, random.fine_unit().powi(4), random.fine_unit()][random.below(4)];
            let depth = if view.depth() == Depth::ReversedInfinite { f64::max(depth, 1e-4) } else { depth };
            let [x, y] = if random.one_in(2) { [side, along] } else { [along, side] };
            let p = inverse * DVec4::new(x, y, depth, 1.0);
            let p = p.truncate() / p.w;
            let tolerance = 1e-9 * (1.0 + p.length() + view.origin().length());
            let inside = |planes: &[visibility_core::view::ViewPlane]| {
                planes.iter().all(|plane| plane.plane.signed_distance(p) > -tolerance)
            };
            seen += 1;
            assert!(inside(&planes), "trial {trial}: {p} is outside of the volume of {reach:?}");
            outside_halved += usize::from(!inside(&of_halved));
            let picture = region.picture().planes(origin);
            if !picture.as_slice().iter().all(|plane| plane.plane.signed_distance(p) > 1e-5) {
                beside += 1;
                let p = p.as_vec3();
                let about = Aabb::new(p - Vec3::splat(1e-4), p + Vec3::splat(1e-4));
                assert!(margin.may_meet(&about), "trial {trial}: {p} is beside the picture of {reach:?}");
            }
        }
    }
    judged(seen);
    told_enough(
        seen > 100_000 && beside > 1_000 && outside_halved > 1_000,
        format_args!("{seen}, {beside}, {outside_halved}"),
    );
}

#[test]
fn views_without_regions() {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let parallel = View::orthographic(pose, Window::centered(1.0, 1.0), 0.1, 9.0).unwrap();
    let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY).unwrap();
    let plane = visibility_core::geometry::Plane::new(DVec3::X, -1.0);
    let clipped = view.with_clip_planes(&[plane]).unwrap();
    let wide = View::perspective(pose, 2.9, 1.5, 0.1, f64::INFINITY).unwrap();
    for (what, view) in [("parallel", parallel), ("with a clip plane", clipped), ("wide", wide)] {
        assert!(ViewRegion::around(&view, Reach::new(0.1, 0.1)).is_none(), "a view {what} has no region");
    }
    for reach in [Reach::new(f64::INFINITY, 0.0), Reach::new(0.1, f64::INFINITY), Reach::new(0.1, 3.0)] {
        assert!(ViewRegion::around(&view, reach).is_none(), "{reach:?} makes no region");
    }
}

/// A scene with objects around the eye, a pipeline with a reach, and a view that looks along an angle.
struct World {
    scene: Scene,
    pipeline: Pipeline,
    visible: VisibleSet,
}

fn ahead(angle: f64, far: f64) -> View {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::new(angle.cos(), angle.sin(), 0.0), DVec3::Z);
    View::perspective(pose, 1.0, 1.5, 0.1, far).unwrap()
}

impl World {
    fn new(reach: Reach) -> Self {
        let mut scene = Scene::new();
        for i in 0..500 {
            let angle = f64::from(i) * 0.0126;
            let p = (DVec3::new(angle.cos(), angle.sin(), 0.0) * 10.0).as_vec3();
            scene.insert(Aabb::new(p - 0.01, p + 0.01));
        }
        let pipeline = Pipeline::new().with(FrustumCuller::new()).with_reach(Some(reach));
        let mut world = Self { scene, pipeline, visible: VisibleSet::new() };
        // From the second frame on, the camera's speed is known.
        world.cull(&ahead(0.0, 50.0));
        world.cull(&ahead(0.0, 50.0));
        world
    }

    /// Culls, checks that all in view is reported, and returns whether the answer was kept.
    fn cull(&mut self, view: &View) -> bool {
        self.pipeline.cull(&self.scene, view, &mut self.visible);
        let mut fresh = VisibleSet::new();
        Pipeline::new().with(FrustumCuller::new()).cull(&self.scene, view, &mut fresh);
        for id in fresh.iter(&self.scene) {
            assert!(self.visible.contains(&self.scene, id), "{id} is in view and reported");
        }
        self.pipeline.is_kept()
    }
}

#[test]
fn answers_are_kept_within_the_reach() {
    let mut world = World::new(Reach::new(0.1, 0.1));
    assert!(world.cull(&ahead(0.09, 50.0)), "within the angle");
    assert!(world.cull(&ahead(-0.09, 50.0)), "to the other side");
    assert!(!world.cull(&ahead(0.11, 50.0)), "beyond the angle");
    assert!(!world.cull(&ahead(1.0, 50.0)), "a cut");
    assert!(!world.cull(&ahead(1.0, 50.0)), "the answer after a cut is for one view");
    assert!(world.cull(&ahead(1.09, 50.0)), "kept again");
}

#[test]
fn a_pipeline_that_is_reset_answers_as_a_new_one() {
    let at = ahead(0.0, 50.0);
    let mut world = World::new(Reach::new(0.1, 0.1));
    let wide = world.visible.count(&world.scene);
    world.pipeline.reset();
    assert!(!world.cull(&at), "no answer is left to keep");
    let first = world.visible.count(&world.scene);
    assert!(first < wide, "{first} objects for the view alone, {wide} for its region");
    assert!(!world.cull(&at) && world.cull(&at), "from the second frame on as ever");
}

#[test]
fn stale_answers_are_never_kept() {
    let at = ahead(0.0, 50.0);
    let mut world = World::new(Reach::new(0.1, 0.1));
    assert!(world.cull(&at), "nothing has changed");
    // The scene.
    let id = world.scene.insert(Aabb::from_arrays([5.0, 0.0, 0.0], [6.0, 1.0, 1.0]));
    assert!(!world.cull(&at), "an object was inserted");
    assert!(world.pipeline.region().is_none(), "no region while the scene changes");
    world.scene.set_bounds(id, Aabb::from_arrays([4.0, 0.0, 0.0], [5.0, 1.0, 1.0])).unwrap();
    assert!(!world.cull(&at), "an object was moved");
    world.scene.set_origin(DVec3::X).unwrap();
    assert!(!world.cull(&at), "the origin was moved");
    assert!(!world.cull(&at) && world.cull(&at), "nothing has changed since");
    let other = world.scene.clone();
    world.pipeline.cull(&other, &at, &mut world.visible);
    assert!(!world.pipeline.is_kept(), "another scene");
    assert!(!world.cull(&at) && !world.cull(&at) && world.cull(&at), "back in the first scene");
    // The projection, the layers and the kind of the view.
    assert!(!world.cull(&ahead(0.0, 60.0)), "another far distance");
    assert!(!world.cull(&ahead(0.0, 60.0)) && world.cull(&ahead(0.0, 60.0)), "kept again");
    assert!(!world.cull(&ahead(0.0, 60.0).with_layers(1)), "other layers");
    let (mut world, pose) =
        (World::new(Reach::new(0.1, 0.1)), Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z));
    assert!(!world.cull(&View::perspective(pose, 1.1, 1.5, 0.1, 50.0).unwrap()), "another field of view");
    let mut world = World::new(Reach::new(0.1, 0.1));
    assert!(!world.cull(&View::perspective(pose, 1.0, 1.5, 0.2, 50.0).unwrap()), "another near distance");
    let mut world = World::new(Reach::new(0.1, 0.1));
    assert!(
        !world.cull(&View::orthographic(pose, Window::centered(3.0, 3.0), 0.1, 50.0).unwrap()),
        "parallel"
    );
    // The set.
    let mut world = World::new(Reach::new(0.1, 0.1));
    world.visible.retain(&world.scene, |_, _| false);
    assert!(!world.cull(&at), "the set was culled by someone else");
    world.visible.finish(&world.scene);
    assert!(world.cull(&at), "finishing a finished set changes nothing");
    world.visible = VisibleSet::new();
    assert!(!world.cull(&at), "another set");
    // The settings and the stages.
    assert!(world.cull(&at) || world.cull(&at) || world.cull(&at), "kept again");
    world.pipeline.set_reach(Some(Reach::new(0.1, 0.1)));
    assert!(world.cull(&at), "the same reach");
    world.pipeline.set_reach(Some(Reach::new(0.2, 0.1)));
    assert!(!world.cull(&at) && !world.cull(&at) && world.cull(&at), "another reach");
    world.pipeline.push(Box::new(FrustumCuller::new()));
    assert!(!world.cull(&at) && !world.cull(&at) && world.cull(&at), "another stage");
    world.pipeline.set_reach(None);
    assert!(!world.cull(&at) && !world.cull(&at), "no reach");
}

/// With a culler that has no answers for regions, every frame culls for its own view.
#[test]
fn a_culler_of_single_views_culls_in_every_frame() {
    struct HidesAll;
    impl Culler for HidesAll {
        fn name(&self) -> &str {
            "all"
        }
        fn accuracy(&self) -> visibility_core::Accuracy {
            visibility_core::Accuracy::Approximate
        }
        fn cull(&mut self, scene: &Scene, _: &View, visible: &mut VisibleSet) -> visibility_core::CullStats {
            visible.retain(scene, |_, _| false)
        }
    }
    let mut world = World::new(Reach::new(0.1, 0.1));
    world.pipeline.push(Box::new(HidesAll));
    for frame in 0..20 {
        world.pipeline.cull(&world.scene, &ahead(0.0, 50.0), &mut world.visible);
        assert!(!world.pipeline.is_kept(), "frame {frame}: an answer for one view was kept");
        assert_eq!(world.visible.count(&world.scene), 0, "frame {frame}: culled for its own view");
    }
}

/// Keeps everything, with an answer that holds while the flag is set: a door that the engine opens.
struct Door(std::sync::Arc<std::sync::atomic::AtomicBool>);

impl Culler for Door {
    fn name(&self) -> &str {
        "door"
    }

    fn accuracy(&self) -> visibility_core::Accuracy {
        visibility_core::Accuracy::Conservative
    }

    fn cull(&mut self, scene: &Scene, _: &View, visible: &mut VisibleSet) -> visibility_core::CullStats {
        visible.retain(scene, |_, _| true)
    }

    fn cull_region(
        &mut self,
        _: Option<&dyn visibility_core::jobs::Jobs>,
        scene: &Scene,
        _: &ViewRegion,
        visible: &mut VisibleSet,
    ) -> Option<visibility_core::CullStats> {
        Some(visible.retain(scene, |_, _| true))
    }

    fn answer_holds(&self) -> bool {
        self.0.load(std::sync::atomic::Ordering::Relaxed)
    }
}

#[test]
fn no_answer_is_kept_once_a_stage_says_that_its_own_does_not_hold() {
    let is_shut = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(true));
    let mut world = World::new(Reach::new(0.1, 0.1));
    world.pipeline.push(Box::new(Door(is_shut.clone())));
    let at = ahead(0.0, 50.0);
    assert!(!world.cull(&at) && !world.cull(&at) && world.cull(&at), "kept while the door is shut");
    is_shut.store(false, std::sync::atomic::Ordering::Relaxed);
    assert!(!world.cull(&at) && !world.cull(&at), "the door is open");
    is_shut.store(true, std::sync::atomic::Ordering::Relaxed);
    assert!(world.cull(&at), "shut again");
}

/// Frames that keep an answer report that nothing appeared or vanished.
#[test]
fn kept_frames_have_no_changes() {
    let mut world = World::new(Reach::new(0.1, 0.1));
    world.visible = VisibleSet::new().with_changes();
    world.cull(&ahead(0.0, 50.0));
    assert!(world.visible.newly_visible().count() > 0, "a new set shows all of its objects");
    assert!(world.cull(&ahead(0.05, 50.0)), "kept");
    assert_eq!(world.visible.newly_visible().count() + world.visible.newly_hidden().count(), 0, "changes");
}

/// Returns a view along x from the origin, through a window from -`x` to `x` and from -`y` to `y` whose upper
/// and lower side rise by `skew` to the right.
fn skewed(x: f64, y: f64, skew: f64) -> View {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let window = Window { left: -x, right: x, bottom: -y, top: y };
    let view = View::perspective_off_center(pose, window, 0.1, f64::INFINITY).unwrap();
    let matrix = view.clip_from(DVec3::ZERO);
    let shear = DMat4::from_cols(DVec4::new(1.0, skew * x / y, 0.0, 0.0), DVec4::Y, DVec4::Z, DVec4::W);
    View::from_clip_from_world(shear * matrix, view.depth()).unwrap()
}

/// A window as wide and low as a slit, whose sides are a little askew, has no region, or one that holds the
/// corners of the window.
#[test]
fn regions_of_windows_that_are_askew_hold_their_corners() {
    let mut regions = 0;
    for (x, y, skew) in [
        (1.0, 1.0, 0.0),
        (3.5, 0.005, 0.0),
        (1.0, 1.0, 9e-6),
        (0.5, 0.005, 9e-6),
        (3.5, 0.05, 9e-6),
        (3.5, 0.005, 9e-6),
        (3.5, 0.005, -9e-6),
        (3.5, 0.0005, 2e-6),
    ] {
        let view = skewed(x, y, skew);
        let Some(region) = ViewRegion::around(&view, Reach::new(0.0, 0.0)) else { continue };
        regions += 1;
        let inverse = view.clip_from(DVec3::ZERO).inverse();
        for (right, up) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            let p = inverse * DVec4::new(right, up, 0.5, 1.0);
            let p = p.truncate() / p.w;
            let planes = region.planes(DVec3::ZERO);
            let least =
                planes.iter().map(|plane| plane.plane.signed_distance(p)).fold(f64::INFINITY, f64::min);
            assert!(least > 0.0, "window {x} by {y}, skew {skew}: {p} is outside by {least}");
        }
    }
    assert!(regions >= 5, "{regions} of the windows have a region");
}
