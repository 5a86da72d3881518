//! Tests of every culler, baker and tessellation at the limits of its settings: zero, one, the type's
//! maximum, negative, NaN. Each setting must be refused with an error or cull a few frames, without a panic
//! and without excessive memory.

use peak_alloc::PeakAlloc;
use std::sync::Arc;
use visibility_2d::horizon::{Horizon, HorizonCuller, HorizonOccluders, UpAxis};
use visibility_2d::view_cdt::ViewCdt;
use visibility_2d::virtual_occluders::VirtualOccluderCuller;
use visibility_bsp::{
    BspOrderCuller, LargeOccludersCuller, Occluders, OcclusionTree, OcclusionTreeCuller, SceneTree,
    ShadowFrusta, ShadowFrustaCuller,
};
use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, Culler, FrustumCuller, OcclusionCuller, Pipeline, Pose, RegionCuller, Scene, View, VisibleSet,
    occlusion::{HardwareQueries, LateAnswers, Preparation, QueryDevice},
    pvs::Viewcell,
    view::Window,
};
use visibility_examples::built_in;
use visibility_examples::walkthrough::World;
use visibility_examples::walkthrough::cullers::{known, parse};
use visibility_frame::{
    backface::BackfaceCuller,
    casters::{CasterCuller, Light},
};
use visibility_hzb::{Coverage, DepthEstimate, Hom, HomCuller, Hzb, HzbCuller};
use visibility_measure::ItemBuffer;
use visibility_plp::{
    Budget, ConservativePlpCuller, DelaunayTessellation, Fineness, OctreeTessellation, PlpCuller,
};
use visibility_portals::from_geometry::{PolygonSettings, WallSettings, from_polygons, from_walls};
use visibility_portals::{BakerSettings, CellBaker, ChainTest, PortalCuller, PortalEye, SceneCells};
use visibility_region::ShrunkCuller;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Maximum memory of a test in megabytes. More would be absurd for these small scenes, whatever the setting.
const MOST_MEGABYTES: f32 = 1500.0;

/// Counts to try. Some are chosen so that their product with a small size overflows.
const COUNTS: [usize; 9] =
    [0, 1, 2, 1 << 31, u32::MAX as usize, 1 << 62, 1 << 63, 1_537_228_672_809_129_302, usize::MAX];
/// Values to try as lengths, shares and tolerances: zeros, denormals, negative, huge and NaN.
const LENGTHS: [f64; 11] =
    [0.0, -0.0, 5e-324, 1e-300, -1.0, 1e30, 1e300, f64::MAX, f64::INFINITY, f64::NEG_INFINITY, f64::NAN];

/// Makes the world of a built-in scene with two frames and pictures of 64 by 36 pixels.
fn world(name: &str) -> World {
    World::new(built_in(name).unwrap(), (64, 36), Some(2)).unwrap()
}

/// Culls two perspective frames, a parallel view, a view of empty space, and the first frame again, with a
/// culler behind the frustum. `what` names the setting in messages.
fn show(what: &str, world: &World, culler: impl Culler + Send + Sync + 'static) {
    run(what, world, &mut Pipeline::new().with(FrustumCuller::new()).with(culler));
}

/// Culls two perspective frames, a parallel view, a view of empty space, and the first frame again before and
/// after a reset. Then checks the memory.
fn run(what: &str, world: &World, pipeline: &mut Pipeline) {
    let pose = Pose::look_at(DVec3::splat(50.0), DVec3::ZERO, DVec3::Z);
    let parallel = View::orthographic(pose, Window::centered(100.0, 60.0), 0.1, 500.0).unwrap();
    let away = Pose::look_at(DVec3::splat(5000.0), DVec3::splat(6000.0), DVec3::Z);
    let nothing = View::perspective(away, 1.0, 1.5, 0.1, f64::INFINITY).unwrap();
    let mut visible = VisibleSet::new();
    for view in [&world.views[0], &world.views[1], &parallel, &nothing, &world.views[0]] {
        pipeline.cull(&world.scene, view, &mut visible);
    }
    pipeline.reset();
    pipeline.cull(&world.scene, &world.views[0], &mut visible);
    check_memory(what);
}

/// Fails if the test program has allocated more than [`MOST_MEGABYTES`] at any time.
fn check_memory(what: &str) {
    let peak = MEMORY.peak_usage_as_mb();
    assert!(peak < MOST_MEGABYTES, "{what}: {peak} MB");
}

#[test]
fn dials_on_the_command_line() {
    let dials = [
        "",
        "0",
        "1",
        "-1",
        "0.5",
        "4294967296",
        "9223372036854775808",
        "1537228672809129302",
        "18446744073709551615",
        "18446744073709551616",
        "NaN",
        "inf",
        "-inf",
        "1e308",
        "0%",
        "1e-300%",
        "100%",
        "-5%",
        "NaN%",
        "inf%",
        "0x0",
        "1x1",
        "16x16",
        "4096x4096",
        "1e-300px",
        "1e300px",
        "NaNpx",
        "px",
        "65536x65536",
        "18446744073709551615x18446744073709551615",
        "x",
        ":",
        "%",
    ];
    let world = world("office:1,1");
    for culler in known() {
        for dial in dials {
            let entry = format!("{}:{dial}", culler.name);
            if let Ok(mut made) = parse(&entry, &world) {
                run(&entry, &world, &mut made[0].1);
            }
        }
    }
}

#[test]
fn object_space() {
    let world = world("office:1,1");
    let occluders = Arc::new(Occluders::new(&world.scene));
    let tree = Arc::new(SceneTree::new(&world.scene).unwrap());
    for count in COUNTS {
        let what = format!("{count} polygons");
        show(&what, &world, OcclusionTreeCuller::new(occluders.clone()).with_polygons(count));
        show(
            &what,
            &world,
            OcclusionCuller::new(OcclusionTree::new().with_polygons(count)).with_price(count as u32),
        );
        let coherent = LargeOccludersCuller::new(occluders.clone()).with_polygons(count);
        show(&what, &world, coherent.clone().without_coherence());
        show(&what, &world, coherent);
        for regions in [0, 1, 5] {
            let frusta = ShadowFrusta::new(&world.scene, (*occluders).clone(), regions, count);
            show(&what, &world, ShadowFrustaCuller::new(frusta.into()));
        }
        show(&what, &world, BspOrderCuller::new(tree.clone()).with_nodes(count as u64));
    }
    let empty = Scene::new();
    for regions in COUNTS {
        let frusta = ShadowFrusta::new(&empty, Occluders::new(&empty), regions, 8);
        show("regions of nothing", &world, ShadowFrustaCuller::new(frusta.into()));
    }
    // The number of regions is above the limit. The scene has only one box because each region takes time.
    let mut small = Scene::new();
    small.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
    assert!(
        ShadowFrusta::new(&small, Occluders::new(&small), usize::MAX, usize::MAX).regions() <= 1 << 16,
        "at most 65536 regions"
    );
}

/// Device for hardware occlusion queries that never answers.
struct Silent;

impl QueryDevice for Silent {
    fn ask(&mut self, _: u64, _: &[Aabb]) {}
    fn answers(&mut self, _: &mut dyn FnMut(u64, u32)) {}
}

#[test]
fn plans() {
    let world = world("town:2");
    let occluders = Arc::new(HorizonOccluders::new(&world.scene, UpAxis::Z));
    for count in COUNTS {
        show("columns", &world, HorizonCuller::new(occluders.clone()).with_columns(count));
        let map = Horizon::new(UpAxis::Y).with_columns(count);
        show("columns of a map", &world, OcclusionCuller::new(map));
        let all = HorizonCuller::new(occluders.clone()).with_crowns(world.scene.ids(), count as u8);
        show("crossings", &world, all);
        let cell = Viewcell::from_box(DVec3::new(-2.0, -2.0, 1.0), DVec3::new(2.0, 2.0, 2.0));
        let mut culler = VirtualOccluderCuller::new(UpAxis::Z).with_max(count);
        culler.cull(&world.scene, &cell, &mut VisibleSet::new());
        assert!(culler.occluders().len() <= count, "{count}: virtual occluders");
        check_memory("virtual occluders");
        // Viewpoints along one axis only, since in a cube of viewpoints the greatest number takes minutes.
        let line = Viewcell::from_box(cell.min, cell.min + DVec3::X);
        let mut culler = ShrunkCuller::new(HzbCuller::new(Hzb::new(64, 64).unwrap()), count);
        culler.cull(&world.scene, &line, &mut VisibleSet::new());
        assert!(culler.points().len() <= 6 * 64, "{count}: at most 64 points a side");
        check_memory("methods of regions");
    }
}

#[test]
fn core_and_image_space() {
    let mut world = world("town:1");
    for count in COUNTS {
        let what = format!("a price of {}", count as u32);
        show(&what, &world, HzbCuller::new(Hzb::new(64, 64).unwrap()).with_price(count as u32));
        let frames = count as u32;
        let device = HardwareQueries::new(Silent, LateAnswers::Trusted { frames });
        show(&what, &world, OcclusionCuller::new(device).with_price(count as u32));
        assert!(
            Hzb::new(count, 64).is_err() || Hzb::new(count, 64).is_ok_and(|map| map.width() == count),
            "{count}: a width is accepted or refused"
        );
        assert!(
            Hom::new(64, count).is_err() || Hom::new(64, count).is_ok_and(|map| map.height() == count),
            "{count}: a height is accepted or refused"
        );
        check_memory(&what);
    }
    for share in LENGTHS {
        let what = format!("a share of {share}");
        for estimate in [DepthEstimate::NoBackground, DepthEstimate::Buffer, DepthEstimate::Plane] {
            let mut map =
                Hom::new(64, 64).unwrap().with_threshold(share as f32).with_depth_estimate(estimate);
            for level in COUNTS {
                map = map.with_level_threshold(level, share as f32);
            }
            show(&what, &world, HomCuller::new(map.with_coverage(Coverage::Sampled)));
        }
        let receivers = Aabb::from_arrays([share as f32; 3], [-share as f32; 3]);
        for light in [
            Light::Directional { toward_light: DVec3::new(share, 1.0, -1.0) },
            Light::Point { position: DVec3::splat(share), range: share },
            Light::Spot {
                position: DVec3::ZERO,
                direction: DVec3::new(1.0, 0.0, share),
                half_angle: share,
                range: 50.0,
            },
        ] {
            if let Ok(culler) = CasterCuller::new(light) {
                show(&what, &world, culler.with_receivers(receivers, world.scene.origin()));
            }
        }
        for two_sided in [false, true] {
            let preparation = Preparation::default()
                .with_sliver(share as f32)
                .with_min_area(share as f32)
                .with_two_sided(two_sided);
            world.scene.prepare_occluders(&preparation);
            show(&what, &world, HzbCuller::new(Hzb::new(64, 64).unwrap()));
        }
        show(&what, &world, BackfaceCuller::new());
    }
    for budget in COUNTS {
        world.scene.maintain(budget);
        for (width, height) in [(budget as u32, 1), (1, budget as u32), (budget as u32, budget as u32)] {
            drop(ItemBuffer::new(width, height));
        }
        check_memory("an item buffer");
    }
}

#[test]
fn triangulated_images() {
    let world = world("office:1,1");
    for count in COUNTS {
        let map = OcclusionCuller::new(ViewCdt::new().with_vertices(count)).with_price(count as u32);
        show(&format!("{count} vertices"), &world, map);
    }
}

#[test]
fn budgets() {
    let world = world("town:1");
    let octree = Arc::new(OctreeTessellation::new(&world.scene));
    for count in COUNTS {
        for budget in [Budget::Objects(count), Budget::Cost(count as u64)] {
            let what = format!("{budget:?}");
            show(&what, &world, PlpCuller::new(octree.clone(), budget));
            show(&what, &world, PlpCuller::new(octree.clone(), budget).with_all_kept());
            let map = Hzb::new(64, 64).unwrap();
            show(&what, &world, ConservativePlpCuller::new(octree.clone(), budget, map));
        }
    }
    for vertices in [0, 1, usize::MAX] {
        for halvings in [0, 1, 10, 11, 32, u32::MAX] {
            let fineness = Fineness { vertices, halvings };
            let what = format!("{fineness:?}");
            // The finest tessellation, of a scene with few objects.
            let mut scene = Scene::new();
            scene.insert_batch((0..4).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 0.5; 3])));
            assert!(
                OctreeTessellation::from_scene(&scene, fineness).memory() > 0,
                "{fineness:?}: the tessellation has cells"
            );
            assert!(
                DelaunayTessellation::from_scene(&scene, fineness).memory() > 0,
                "{fineness:?}: the tessellation has cells"
            );
            check_memory(&what);
        }
    }
}

#[test]
fn cells_and_portals() {
    let world = world("office:1,1");
    let source = world.cells().unwrap();
    let cells = |tolerance| SceneCells::new(source.graph.clone(), source.viewcells.clone(), tolerance);
    for count in COUNTS {
        let eye = PortalEye::new().with_step_limit(count as u64).with_reflections(count, count as u32);
        let mut cells = cells(1e-4).unwrap();
        cells.sync(&world.scene);
        show(&format!("{count} steps"), &world, PortalCuller::new(cells).with_eye(eye));
    }
    for tolerance in LENGTHS {
        let what = format!("a tolerance of {tolerance}");
        if let Ok(mut cells) = cells(tolerance) {
            cells.sync(&world.scene);
            show(&what, &world, PortalCuller::new(cells));
        }
        for steps in [0, 1, u64::MAX] {
            let chain_test = if steps > 1 { ChainTest::Pluecker } else { ChainTest::Separators };
            let settings = BakerSettings::default()
                .with_clearance(tolerance)
                .with_steps_per_cell(steps)
                .with_chain_test(chain_test);
            if let Ok(baker) = CellBaker::new(&source.graph, settings) {
                let mut bake = visibility_core::bake::Bake::new(baker);
                while bake.advance().is_some() {}
            }
        }
        let walls: Vec<[DVec3; 2]> = (0..6)
            .map(|i| [DVec3::new(f64::from(i), 0.0, 0.0), DVec3::new(f64::from(i) + 0.1, 3.0, 3.0)])
            .collect();
        for max_cells in COUNTS {
            for (min_share, min_area, margin) in
                [(tolerance, None, 1.0), (0.3, Some(tolerance), 1.0), (0.3, None, tolerance)]
            {
                let settings = WallSettings::default()
                    .with_tolerance(1e-4)
                    .with_min_share(min_share)
                    .with_min_area(min_area)
                    .with_margin(margin)
                    .with_max_cells(max_cells);
                drop(from_walls(&walls, &settings));
                drop(from_walls(&walls, &settings.with_tolerance(tolerance)));
                let settings = PolygonSettings::default()
                    .with_min_share(min_share)
                    .with_min_area(min_area)
                    .with_margin(margin)
                    .with_max_cells(max_cells);
                let polygons: Vec<_> = walls
                    .iter()
                    .map(|&[min, max]| {
                        let corners = [[min.y, min.z], [max.y, min.z], [max.y, max.z], [min.y, max.z]];
                        let corners = corners.map(|[y, z]| DVec3::new(min.x, y, z));
                        visibility_core::geometry::ConvexPolygon::new(corners).unwrap()
                    })
                    .collect();
                drop(from_polygons(&polygons, &settings));
                drop(from_polygons(&polygons, &settings.with_tolerance(tolerance)));
            }
        }
        check_memory(&what);
    }
}
