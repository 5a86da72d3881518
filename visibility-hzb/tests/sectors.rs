//! Occluders of several levels in one z-buffer, added and removed while it runs, as the sectors of a world
//! that is streamed.

use crate::level::{as_faces, triangles, view_within};
use crate::rays::check;
use std::sync::Arc;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::occlusion::Preparation;
use visibility_core::{Aabb, Culler, Object, ObjectId, OcclusionMap, Pose, Scene, View, VisibleSet};
use visibility_hzb::{Hzb, HzbCuller, PreparedLevel};
use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle};
use visibility_testing::allocations::LIVE;
use visibility_testing::{Random, mend_header};

/// Returns the occluders of triangles in the world, relative to an origin of their own.
fn prepared(triangles: &[LevelTriangle], origin: DVec3) -> Arc<PreparedLevel> {
    let settings = LevelSettings::default().with_kept_area(1.0);
    let level = LevelOccluders::new(triangles, settings).unwrap();
    Arc::new(PreparedLevel::new(Arc::new(level), origin))
}

/// Returns the view from `eye` to `target`.
fn view(eye: DVec3, target: DVec3) -> View {
    View::perspective(Pose::look_at(eye, target, DVec3::Z), 1.2, 1.6, 0.1, f64::INFINITY).unwrap()
}

/// Returns the bits of the depth keys of all pixels.
fn pixels(hzb: &Hzb) -> Vec<u32> {
    let at = (0..hzb.height()).flat_map(|row| (0..hzb.width()).map(move |column| (column, row)));
    at.map(|(column, row)| hzb.depth_key(column, row).to_bits()).collect()
}

/// Before each frame, sectors are added and removed. Rays through covered pixels meet a triangle of a present
/// sector, no farther than the pixel's depth key.
#[test]
fn pixels_are_covered_by_the_sectors_that_are_there() {
    let mut random = Random(41);
    let (mut cast, mut covered, mut several) = (0, 0, 0);
    while cast < 1_500_000 {
        // All sectors are parts of one level, so that they have borders in common.
        let all = triangles(&mut random);
        if all.is_empty() {
            continue;
        }
        let count = random.below(4) + 2;
        let sectors: Vec<_> = (0..count)
            .map(|sector| {
                let origin = random.vector([1.0, 100.0][sector % 2]).round();
                let own = all.iter().enumerate().filter(|(i, _)| i * 7 / 3 % count == sector);
                let own: Vec<LevelTriangle> = own
                    .map(|(_, t)| LevelTriangle {
                        corners: t.corners.map(|p| (p.as_dvec3() - origin).as_vec3()),
                        ..*t
                    })
                    .collect();
                let mut faces = as_faces(&own);
                faces.iter_mut().for_each(|face| face.corners = face.corners.map(|p| p + origin));
                (prepared(&own, origin), faces)
            })
            .collect();
        let mut hzb = Hzb::new(120, 72).unwrap().with_min_polygon_area(16.0);
        let mut there = vec![false; count];
        for frame in 0..8 {
            let sector = random.below(count);
            there[sector] = !there[sector];
            if there[sector] {
                hzb.add_level(sectors[sector].0.clone());
            } else {
                assert!(hzb.remove_level(&sectors[sector].0), "frame {frame}: the sector was there");
                assert!(!hzb.remove_level(&sectors[sector].0), "frame {frame}: the sector is removed once");
            }
            let faces: Vec<_> =
                (0..count).filter(|&i| there[i]).flat_map(|i| &sectors[i].1).copied().collect();
            let view = view_within(&mut random, &all);
            hzb.begin(&view, random.vector(1e3));
            hzb.flush();
            let [s, p] = check(&faces, &view, &hzb, &mut random, &format!("{cast} rays, frame {frame}"));
            (cast, covered) = (cast + s, covered + p);
            several += usize::from(there.iter().filter(|&&there| there).count() > 1 && p > 0);
        }
    }
    assert!(covered > 1000 && several > 40, "{covered} pixels, {several} frames with several sectors");
}

/// Many sectors overlap in the picture, more than a tile has layers. The nearest clusters of all sectors are
/// drawn first, so the pixels do not depend on the order in which sectors were added.
#[test]
fn the_order_of_adding_makes_no_difference() {
    let mut random = Random(42);
    let mut differ = 0;
    for round in 0..20 {
        let sectors: Vec<_> = (0..60)
            .map(|_| {
                let middle = random.vec3(-14.0, 14.0);
                let fins = (0..3).map(|_| LevelTriangle {
                    corners: [(); 3].map(|()| middle + random.vec3(-9.0, 9.0)),
                    two_sided: true,
                });
                prepared(&fins.collect::<Vec<_>>(), DVec3::ZERO)
            })
            .collect();
        let view = view(random.direction() * 70.0, random.vector(3.0));
        let with = |order: &mut dyn Iterator<Item = usize>| {
            let mut hzb = Hzb::new(128, 72).unwrap().with_min_polygon_area(16.0);
            order.for_each(|i| hzb.add_level(sectors[i].clone()));
            hzb.begin(&view, DVec3::ZERO);
            hzb.flush();
            pixels(&hzb)
        };
        let all = with(&mut (0..60));
        assert!(all == with(&mut (0..60).rev()), "round {round}");
        differ += usize::from(all != with(&mut (0..30)));
    }
    assert_eq!(differ, 20, "rounds in which half of the sectors covers other pixels");
}

/// A sector whose middle is out of view hides objects behind its part in view, whatever the origins of sector
/// and scene are. Tested with the map alone and through a culler.
#[test]
fn a_sector_hides_wherever_origins_are() {
    let view = view(DVec3::ZERO, DVec3::X);
    for place in [DVec3::ZERO, DVec3::new(3e3, -7e3, 20.0)] {
        let corners = [[-9.0, -9.0], [600.0, -9.0], [600.0, 9.0], [-9.0, 9.0]];
        let corners = corners.map(|[y, z]| (DVec3::new(10.0, y, z) - place).as_vec3());
        let wall = [[0, 1, 2], [0, 2, 3]]
            .map(|corner| LevelTriangle { corners: corner.map(|i| corners[i]), two_sided: true });
        let sector = prepared(&wall, place);
        let mut culler = HzbCuller::new(Hzb::default());
        for origin in [DVec3::ZERO, DVec3::new(1e4, -2e4, 50.0)] {
            let mut scene = Scene::new();
            scene.set_origin(origin).unwrap();
            let corners = [DVec3::new(20.0, -1.0, -1.0), DVec3::new(21.0, 1.0, 1.0)];
            let [low, high] = corners.map(|corner| (corner - origin).as_vec3());
            let behind = scene.insert(Aabb::new(low, high));
            for is_there in [true, false] {
                if is_there {
                    culler.map_mut().add_level(sector.clone());
                } else {
                    assert!(
                        culler.map_mut().remove_level(&sector),
                        "{place}, {origin}: the sector was there"
                    );
                }
                let mut visible = VisibleSet::new();
                visible.fill(&scene, &view);
                culler.cull(&scene, &view, &mut visible);
                assert_eq!(visible.contains(&scene, behind), !is_there, "{place}, {origin}");
            }
        }
    }
}

/// After thousands of sectors were added and removed, a z-buffer uses as much memory as at the start, and
/// answers as a new z-buffer does.
#[test]
fn ten_thousand_sectors_that_come_and_go_leave_no_memory() {
    let mut random = Random(43);
    let kinds: Vec<Arc<LevelOccluders>> = (0..7)
        .map(|_| Arc::new(LevelOccluders::new(&triangles(&mut random), LevelSettings::default()).unwrap()))
        .collect();
    let place = |number: usize| DVec3::new((number % 5) as f64 * 20.0, (number % 3) as f64 * 20.0, 0.0);
    let sector =
        |number: usize| Arc::new(PreparedLevel::new(kinds[number * 13 % kinds.len()].clone(), place(number)));
    let eyes = [DVec3::new(-9.0, 3.0, 1.0), DVec3::new(50.0, 12.0, 2.0)];
    let views = eyes.map(|eye| view(eye, DVec3::new(40.0, 15.0, 0.0)));
    let mut hzb = Hzb::new(64, 36).unwrap().with_min_polygon_area(16.0);
    let mut there: std::collections::VecDeque<_> = (0..16).map(sector).collect();
    there.iter().for_each(|sector| hzb.add_level(sector.clone()));
    let mut live = Vec::with_capacity(16);
    for number in 16..10_016 {
        let gone = there.pop_front().unwrap();
        assert!(hzb.remove_level(&gone), "sector {number} was there");
        drop(gone);
        there.push_back(sector(number));
        hzb.add_level(there.back().unwrap().clone());
        if number % 5 == 0 {
            hzb.begin(&views[number % 2], DVec3::ZERO);
            hzb.flush();
        }
        // Every 105 steps the same sectors are present, so memory can be compared.
        if number % 1050 == 0 {
            live.push(LIVE.get());
        }
    }
    assert!(live[1..].iter().all(|&bytes| bytes == live[1]), "{live:?}");
    // Adding a level that is present already does not add it a second time.
    let before = LIVE.get();
    (0..1000).for_each(|_| hzb.add_level(there[0].clone()));
    assert_eq!(LIVE.get(), before, "adding a level that is there takes memory");
    let mut new = Hzb::new(64, 36).unwrap().with_min_polygon_area(16.0);
    there.iter().for_each(|sector| new.add_level(sector.clone()));
    for view in &views {
        for hzb in [&mut hzb, &mut new] {
            hzb.begin(view, DVec3::ZERO);
            hzb.flush();
        }
        assert!(pixels(&hzb) == pixels(&new), "the used map and a new one with the same sectors");
        assert!(pixels(&hzb).iter().any(|&key| f32::from_bits(key) > 0.0), "the sectors cover a pixel");
    }
    there.iter().for_each(|sector| assert!(hzb.remove_level(sector), "a sector was there"));
    hzb.begin(&views[0], DVec3::ZERO);
    hzb.flush();
    assert!(
        pixels(&hzb).iter().all(|&key| f32::from_bits(key) == f32::NEG_INFINITY),
        "a pixel is covered without sectors"
    );
}

/// Tests that sectors can be prepared on another thread, beside the frames.
#[test]
fn prepared_levels_go_from_thread_to_thread() {
    fn is_shared<T: Send + Sync>() {}
    is_shared::<PreparedLevel>();
}

/// Tests that a level loaded from forged bytes is drawn without panic, or refused when loaded.
#[test]
fn forged_files_are_drawn_or_refused() {
    let mut random = Random(44);
    let (mut drawn, mut refused) = (0, 0);
    while drawn < 300 {
        let triangles = triangles(&mut random);
        let settings = LevelSettings::default().with_max_cluster_edges(24);
        let file = LevelOccluders::new(&triangles, settings).unwrap().to_bytes();
        for _ in 0..20 {
            let mut file = file.clone();
            for _ in 0..random.below(4) + 1 {
                let at = 40 + random.below(file.len() - 40);
                file[at] = random.below(256) as u8;
            }
            mend_header(&mut file, 0);
            let Ok(level) = LevelOccluders::from_bytes(&file, None) else {
                refused += 1;
                continue;
            };
            let mut hzb = Hzb::new(64, 36)
                .unwrap()
                .with_min_polygon_area(16.0)
                .with_level(Arc::new(level), DVec3::ZERO);
            for _ in 0..3 {
                hzb.begin(&view(random.vector(20.0), random.vector(3.0)), DVec3::ZERO);
                hzb.flush();
            }
            drawn += 1;
        }
    }
    assert!(refused > 100, "{refused} are refused");
}

/// Pixels along an edge are covered by two triangles of one level that share the edge, never by a triangle of
/// that level together with a triangle of another level whose edge has the same index.
#[test]
fn edges_of_one_level_are_not_those_of_another() {
    let mut random = Random(43);
    let view = view(DVec3::ZERO, DVec3::X);
    let mut covered = 0;
    for round in 0..1_500 {
        let mut hzb = Hzb::new(64, 40).unwrap().with_min_polygon_area(16.0);
        let mut faces = Vec::new();
        for _ in 0..6 {
            let middle = random.vec3(-3.0, 3.0) + Vec3::X * 10.0;
            let [a, b, c, d] = [0; 4].map(|_| middle + random.vec3(-4.0, 4.0));
            let folded = [[a, b, c], [b, a, d]].map(|corners| LevelTriangle { corners, two_sided: true });
            faces.extend(as_faces(&folded));
            hzb.add_level(prepared(&folded, DVec3::ZERO));
        }
        hzb.begin(&view, DVec3::ZERO);
        hzb.flush();
        covered += check(&faces, &view, &hzb, &mut random, &format!("round {round}"))[1];
    }
    assert!(covered > 400_000, "{covered} pixels are covered, expected more");
}

/// A level with a near wall on layer 1 and a far wall on layer 2. Only views of both layers draw the level;
/// other views draw the mesh of the wall that they show.
#[test]
fn a_level_hides_only_in_views_that_show_all_of_it() {
    let mut scene = Scene::new();
    let [wall, _] = [(1, 5.0), (2, 50.0)].map(|(layers, x)| {
        let at = |y: f32, z: f32| Vec3::new(x, y, z);
        let corners = [at(-9.0, -9.0), at(9.0, -9.0), at(9.0, 9.0), at(-9.0, 9.0)];
        let bounds = Aabb::from_points(corners);
        let id = scene.insert(Object { occluder: true, layers, ..Object::new(bounds) });
        scene.set_triangles(id, [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|i: usize| corners[i]))).unwrap();
        id
    });
    let post = scene.insert(Aabb::from_arrays([8.0, -1.0, -1.0], [9.0, 1.0, 1.0]));
    let level = LevelOccluders::of_scene(&scene, |_| true, LevelSettings::default()).unwrap();
    let mut culler = HzbCuller::new(Hzb::default().with_level(level.into(), scene.origin()));
    let mut hides = |scene: &Scene, layers: u32| {
        let view = view(DVec3::ZERO, DVec3::X).with_layers(layers);
        let mut visible = VisibleSet::new();
        visible.fill(scene, &view);
        culler.cull(scene, &view, &mut visible);
        !visible.contains(scene, post)
    };
    assert_eq!(
        [3, 2, 1].map(|layers| hides(&scene, layers)),
        [true, false, false],
        "views of layers 3, 2, 1"
    );
    scene.prepare_occluders(&Preparation::default().with_two_sided(true));
    assert!(scene.has_mesh(wall), "the wall has a mesh now");
    assert_eq!([3, 2, 1].map(|layers| hides(&scene, layers)), [true, false, true], "with the meshes");
}

/// Returns a wall of two triangles in the plane `x`, from -9 to 9 metres in y and z.
fn wall(x: f32) -> [[Vec3; 3]; 2] {
    let corners = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]].map(|[y, z]| Vec3::new(x, y, z));
    [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|i: usize| corners[i]))
}

/// Sectors that share objects, on several layers, come and go. An object is drawn by a level if any sector
/// that has it is present and on in the view.
#[test]
fn objects_are_drawn_by_the_sectors_that_have_them() {
    let mut random = Random(45);
    let mut scene = Scene::new();
    let ids: Vec<ObjectId> = (0..40)
        .map(|i| {
            let triangles = wall(5.0 + i as f32);
            let bounds = Aabb::from_points(triangles.into_iter().flatten());
            let layers = [1, 2, 4, 3][random.below(4)];
            let id = scene.insert(Object { occluder: true, layers, ..Object::new(bounds) });
            scene.set_triangles(id, triangles).unwrap();
            id
        })
        .collect();
    let sectors: Vec<_> = (0..24)
        .map(|_| {
            let own: Vec<ObjectId> = ids.iter().copied().filter(|_| random.one_in(8)).collect();
            let settings = LevelSettings::default();
            let level = LevelOccluders::of_scene(&scene, |id| own.contains(&id), settings).unwrap();
            (Arc::new(PreparedLevel::new(Arc::new(level), DVec3::ZERO)), own)
        })
        .collect();
    let mut hzb = Hzb::new(64, 36).unwrap();
    let mut there = vec![false; sectors.len()];
    let mut counts = [0; 2];
    for step in 0..300 {
        let sector = random.below(sectors.len());
        there[sector] = !there[sector];
        if there[sector] {
            hzb.add_level(sectors[sector].0.clone());
        } else {
            assert!(hzb.remove_level(&sectors[sector].0), "step {step}: the sector was there");
        }
        let layers = random.below(8) as u32;
        hzb.begin(&view(DVec3::ZERO, DVec3::X).with_layers(layers), DVec3::ZERO);
        for &id in &ids {
            let is_on =
                |own: &[ObjectId]| own.iter().all(|&id| scene.object(id).unwrap().layers & layers != 0);
            let expected =
                (0..sectors.len()).any(|i| there[i] && sectors[i].1.contains(&id) && is_on(&sectors[i].1));
            assert_eq!(hzb.draws(id), expected, "step {step}, object {id}, layers {layers}");
            counts[usize::from(expected)] += 1;
        }
        let other = ObjectId::from_bits(ids[0].to_bits() + (1 << 32));
        assert!(!hzb.draws(other), "another object with the index of one that is drawn");
    }
    assert!(counts.iter().all(|&count| count > 1_000), "{counts:?} objects are not drawn and drawn");
}

/// A sector of one object takes little memory, also if the world has many other objects. So do frames in
/// which all other sectors are out of view.
#[test]
fn a_sector_takes_memory_for_what_it_has() {
    let mut scene = Scene::new();
    scene.insert_batch((0..20_000).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 1.0; 3])));
    let bounds = Aabb::from_points(wall(5.0).into_iter().flatten());
    let last = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    scene.set_triangles(last, wall(5.0)).unwrap();
    let level = LevelOccluders::of_scene(&scene, |_| true, LevelSettings::default()).unwrap();
    let level = Arc::new(level);
    let mut hzb = Hzb::new(64, 36).unwrap();
    let before = LIVE.get();
    hzb.add_level(Arc::new(PreparedLevel::new(level, DVec3::ZERO)));
    let bytes = LIVE.get() - before;
    assert!(hzb.draws(last) && bytes < 4_000, "{bytes} bytes for the sector of object {last}");
    // Sectors behind the eye, of separate triangles.
    let fins: Vec<_> = (0..2_000)
        .map(|i| 3.0 * Vec3::new((i % 20) as f32, (i / 20 % 20) as f32, (i / 400) as f32) - Vec3::X * 200.0)
        .map(|p| LevelTriangle { corners: [p, p + Vec3::X, p + Vec3::Y], two_sided: true })
        .collect();
    let behind = prepared(&fins, DVec3::ZERO);
    for _ in 0..100 {
        hzb.add_level(Arc::new(PreparedLevel::clone(&behind)));
    }
    let before = LIVE.get();
    hzb.begin(&view(DVec3::ZERO, DVec3::X), DVec3::ZERO);
    hzb.flush();
    let bytes = LIVE.get() - before;
    // Each level in the z-buffer takes memory for its view, 2 KB.
    assert!(bytes < 1_000_000, "{bytes} bytes for a frame with 600,000 edges out of view");
}
