//! Tests of the contribution culler with levels of detail: exactly one of a parent and its children is drawn,
//! and nothing flickers.

use super::{cull, view_from};
use std::collections::BTreeSet;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::scene::{DrawRange, SceneError};
use visibility_core::view::Window;
use visibility_core::{Aabb, Culler, Object, ObjectId, Pose, Scene, View, VisibleSet};
use visibility_frame::lod::{ContributionCuller, LodSelector};
use visibility_testing::Random;

/// Returns a scene of parents with children and grandchildren, and the ids of each family: a path from a
/// leaf of the family to its root.
fn families(rng: &mut Random) -> (Scene, Vec<[ObjectId; 3]>) {
    let mut scene = Scene::new();
    let mut paths = Vec::new();
    for _ in 0..12 {
        let at = rng.vector(100.0).as_vec3();
        let block = scene.insert(Aabb::new(at - 40.0, at + 40.0));
        scene.set_draw_range(block, DrawRange { begin: 90.0, ..DrawRange::ALWAYS }).unwrap();
        for _ in 0..3 {
            let at = at + rng.vector(15.0).as_vec3();
            let house = scene.insert(Aabb::new(at - 20.0, at + 20.0));
            scene.set_draw_range(house, DrawRange { begin: 25.0, ..DrawRange::ALWAYS }).unwrap();
            scene.set_hlod_parent(house, Some(block)).unwrap();
            for _ in 0..4 {
                let at = at + rng.vector(10.0).as_vec3();
                let chair = scene.insert(Aabb::new(at, at + 1.0));
                scene.set_hlod_parent(chair, Some(house)).unwrap();
                paths.push([chair, house, block]);
            }
        }
    }
    (scene, paths)
}

#[test]
fn exactly_one_of_a_parent_and_its_children_is_drawn() {
    let mut rng = Random(8);
    let (mut scene, paths) = families(&mut rng);
    let mut culler = ContributionCuller::new(1080.0, 0.0);
    let (mut eye, mut drawn) = (DVec3::ZERO, [0; 3]);
    for frame in 0..3000 {
        eye = (eye + rng.vector(8.0)).clamp(DVec3::splat(-250.0), DVec3::splat(250.0));
        if frame % 500 == 0 {
            scene.rebuild();
        }
        let parallel = View::orthographic(
            Pose::look_at(eye, DVec3::ZERO, DVec3::Z),
            Window::centered(9.0, 9.0),
            0.0,
            99.0,
        );
        let view = if frame % 50 == 0 { parallel.unwrap() } else { view_from(eye) };
        let seen = cull(&mut culler, &scene, &view).0;
        for path in &paths {
            let of_path = path.map(|id| seen.contains(&id));
            assert_eq!(of_path.iter().filter(|&&is| is).count(), 1, "frame {frame}: {of_path:?}");
            (0..3).for_each(|level| drawn[level] += usize::from(of_path[level]));
        }
    }
    assert!(drawn.iter().all(|&count| count > 5_000), "{drawn:?}");
}

/// Tests that two levels of one thing with different boxes are drawn one at a time, at every distance and
/// along any path of the eye, if one is the parent of the other.
#[test]
fn between_levels_of_different_boxes_nothing_is_missing() {
    // The box of the far level reaches a metre nearer to the eye.
    let boxes = [[1.0, -1.0, 0.0, 3.0, 1.0, 2.0], [0.0, -1.5, 0.0, 3.0, 1.5, 2.5]]
        .map(|[a, b, c, d, e, f]| Aabb::from_arrays([a, b, c], [d, e, f]));
    for (is_linked, has_end) in [(true, true), (true, false), (false, true)] {
        let mut scene = Scene::new();
        let [near, far] = boxes.map(|bounds| scene.insert(bounds));
        // Other objects, so that the hierarchy has several nodes.
        scene.insert_batch((0..300).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 0.5; 3])));
        let end = if has_end { 128.0 } else { f32::INFINITY };
        let ranges = [
            DrawRange { end, margin: 10.0, ..DrawRange::ALWAYS },
            DrawRange { begin: 128.0, margin: 10.0, ..DrawRange::ALWAYS },
        ];
        scene.set_draw_range(near, ranges[0]).unwrap();
        scene.set_draw_range(far, ranges[1]).unwrap();
        if is_linked {
            scene.set_hlod_parent(near, Some(far)).unwrap();
        }
        scene.rebuild();
        let mut rng = Random(6);
        let (mut culler, mut missing, mut lods) =
            (ContributionCuller::new(1080.0, 0.0), 0, LodSelector::new(1080.0).with_fade(0.0));
        for frame in 0..4000 {
            let away = if frame % 2 == 0 { rng.range(127.0, 130.0) } else { rng.range(100.0, 140.0) };
            let view = view_from(DVec3::new(-away, 0.0, 1.0));
            let fresh = cull(&mut ContributionCuller::new(1080.0, 0.0), &scene, &view).0;
            let live = cull(&mut culler, &scene, &view).0;
            for seen in [&fresh, &live] {
                let count = usize::from(seen.contains(&near)) + usize::from(seen.contains(&far));
                assert!(!is_linked || count == 1, "{count} of the levels at {away} m");
                missing += usize::from(count == 0);
            }
            let mut opacities = |drawn: &BTreeSet<ObjectId>| {
                let mut visible = VisibleSet::new();
                visible.retain(&scene, |id, _| drawn.contains(&id));
                visible.finish(&scene);
                lods.select(&scene, &view, &visible, 0.1, |_| &[]);
                [near, far].map(|id| lods.lod(id).map(|lod| lod.opacity))
            };
            if is_linked {
                // Hysteresis keeps a level beyond its limit: it is drawn in full, too.
                for drawn in [&fresh, &live] {
                    let sum: f32 = opacities(drawn).into_iter().flatten().sum();
                    assert_eq!(sum, 1.0, "opacity of both levels at {away} m");
                }
            } else {
                let away = [away as f32 + 1.0, away as f32];
                for ((opacity, range), away) in opacities(&fresh).into_iter().zip(ranges).zip(away) {
                    let expected = range.opacity(away);
                    assert!(opacity.is_none_or(|o| (o - expected).abs() < 1e-3), "{opacity:?} at {away} m");
                }
            }
        }
        assert_eq!(missing > 0, !is_linked, "ranges alone leave a gap of a metre");
    }
    // Near levels of detail at the far end of a block that is the parent of all: none of them is beyond its
    // end.
    let mut scene = Scene::new();
    let block = scene.insert(Aabb::from_arrays([0.0, -5.0, 0.0], [200.0, 5.0, 20.0]));
    scene.set_draw_range(block, DrawRange { begin: 128.0, ..DrawRange::ALWAYS }).unwrap();
    let houses: Vec<_> = (0..300)
        .map(|i| scene.insert(Aabb::from_arrays([190.0, -4.0, i as f32 * 0.05], [199.0, 4.0, 16.0])))
        .collect();
    for &house in &houses {
        scene.set_draw_range(house, DrawRange { end: 128.0, ..DrawRange::ALWAYS }).unwrap();
        scene.set_hlod_parent(house, Some(block)).unwrap();
    }
    scene.rebuild();
    let seen = |away: f64| {
        let view = view_from(DVec3::new(-away, 0.0, 1.0));
        cull(&mut ContributionCuller::new(1080.0, 0.0), &scene, &view).0
    };
    assert_eq!(
        (seen(127.0).len(), seen(127.0).contains(&block)),
        (300, false),
        "before the block begins, its houses are drawn"
    );
    assert_eq!((seen(129.0).len(), seen(129.0).contains(&block)), (1, true), "beyond, the block alone");
}

/// Tests that an object whose distance trembles around a limit switches at most once, and that it would
/// flicker without hysteresis.
#[test]
fn a_trembling_camera_makes_nothing_flicker() {
    let mut rng = Random(9);
    let mut scene = Scene::new();
    let parent = scene.insert(Aabb::from_arrays([100.0, -10.0, -10.0], [120.0, 10.0, 10.0]));
    let child = scene.insert(Aabb::from_arrays([105.0, 0.0, 0.0], [106.0, 1.0, 1.0]));
    // Lamps in several nodes, so that nodes are dropped too.
    let lamps: Vec<_> = (0..300)
        .map(|i| scene.insert(Aabb::from_arrays([100.0, 30.0, 0.0], [100.0 + i as f32, 31.0, 1.0])))
        .collect();
    scene.set_draw_range(parent, DrawRange { begin: 100.0, ..DrawRange::ALWAYS }).unwrap();
    scene.set_hlod_parent(child, Some(parent)).unwrap();
    for lamp in lamps {
        scene.set_draw_range(lamp, DrawRange { end: 100.0, ..DrawRange::ALWAYS }).unwrap();
    }
    scene.rebuild();
    let (mut live, mut switches) = (ContributionCuller::new(1080.0, 0.0), [0, 0]);
    let mut before = [BTreeSet::new(), BTreeSet::new()];
    for frame in 0..400 {
        let view = view_from(DVec3::new(rng.range(-1.0, 1.0), 30.0 * f64::from(frame / 200), 0.0));
        let mut fresh = ContributionCuller::new(1080.0, 0.0);
        for (number, culler) in [&mut live, &mut fresh].into_iter().enumerate() {
            let seen = cull(culler, &scene, &view).0;
            assert_ne!(
                seen.contains(&parent),
                seen.contains(&child),
                "frame {frame}: one of parent and child is drawn"
            );
            switches[number] += usize::from(frame % 200 > 0 && seen != before[number]);
            before[number] = seen;
        }
    }
    assert!(switches[0] <= 3 && switches[1] > 50, "{switches:?}");
    // Distances outside the hysteresis band, and a reset, end the influence of earlier frames.
    let band = view_from(DVec3::new(2.0, 0.0, 0.0));
    cull(&mut live, &scene, &view_from(DVec3::new(-20.0, 0.0, 0.0)));
    assert!(cull(&mut live, &scene, &band).0.contains(&parent), "still beyond the lower limit");
    live.reset();
    assert!(!cull(&mut live, &scene, &band).0.contains(&parent), "a reset forgets that the parent was drawn");
    cull(&mut live, &scene, &view_from(DVec3::new(-20.0, 0.0, 0.0)));
    assert!(
        !cull(&mut live, &scene, &view_from(DVec3::new(20.0, 0.0, 0.0))).0.contains(&parent),
        "the parent is drawn though the eye is nearer than the band"
    );
}

#[test]
fn children_whose_parent_cannot_stand_in_are_drawn() {
    let whole = Aabb::from_arrays([100.0, -10.0, -10.0], [120.0, 10.0, 10.0]);
    let mut scene = Scene::new();
    let parent = scene.insert(whole);
    let child = scene.insert(Aabb::from_arrays([105.0, 0.0, 0.0], [106.0, 1.0, 1.0]));
    let begin = DrawRange { begin: 50.0, ..DrawRange::ALWAYS };
    scene.set_draw_range(parent, begin).unwrap();
    scene.set_hlod_parent(child, Some(parent)).unwrap();
    scene.rebuild();
    let view = view_from(DVec3::ZERO);
    let seen = |scene: &Scene, view: &View| cull(&mut ContributionCuller::new(1080.0, 0.0), scene, view).0;
    let is = |ids: &[ObjectId]| ids.iter().copied().collect::<BTreeSet<_>>();
    assert_eq!(seen(&scene, &view), is(&[parent]), "the parent stands in for the child");
    // The child drives away; the parent shrinks, changes its layer, is never culled, becomes NaN, or is
    // removed.
    let (home, far) =
        (scene.bounds(child).unwrap(), Aabb::from_arrays([105.0, 0.0, 9.5], [106.0, 1.0, 10.5]));
    scene.set_bounds(child, far).unwrap();
    assert_eq!(seen(&scene, &view), is(&[parent, child]), "the child has left the parent's bounds");
    scene.set_bounds(child, home).unwrap();
    assert_eq!(seen(&scene, &view), is(&[parent]), "the child is back");
    scene.set_bounds(parent, far).unwrap();
    assert_eq!(seen(&scene, &view), is(&[parent, child]), "the parent has left the child");
    scene.set_bounds(parent, Aabb::new(Vec3::NAN, Vec3::NAN)).unwrap();
    assert_eq!(seen(&scene, &view), is(&[parent, child]), "the parent is NaN");
    scene.set_bounds(parent, whole).unwrap();
    scene.set_never_cull(parent, true).unwrap();
    assert_eq!(seen(&scene, &view), is(&[parent, child]), "the parent is never culled");
    scene.set_never_cull(parent, false).unwrap();
    scene.set_layers(parent, 1).unwrap();
    assert_eq!(seen(&scene, &view), is(&[parent, child]), "the parent is on fewer layers than the child");
    assert_eq!(seen(&scene, &view.with_layers(2)), is(&[child]), "a view of the child's layers alone");
    scene.set_layers(child, 1).unwrap();
    assert_eq!(seen(&scene, &view), is(&[parent]), "the child is on the parent's layer");
    // Distances are measured from another eye, as for a shadow map of the main camera.
    let light =
        View::orthographic(Pose::look_at(DVec3::Z, DVec3::X, DVec3::Z), Window::centered(9.0, 9.0), 0.0, 9.0);
    let light = light.unwrap();
    assert_eq!(seen(&scene, &light), is(&[child]), "the light is near, so the child is drawn");
    let mut culler = ContributionCuller::new(1080.0, 0.0);
    culler.set_distance_eye(Some(DVec3::ZERO));
    assert_eq!(cull(&mut culler, &scene, &light).0, is(&[parent]), "the distance is that of another eye");
    scene.remove(parent).unwrap();
    assert_eq!(seen(&scene, &view), is(&[child]), "the parent was removed");
    assert_eq!(scene.hlod_parent(child), Ok(None), "a removed parent is forgotten");
}

/// Change of a scene, given a parent, its children and a box elsewhere.
type Change = fn(&mut Scene, ObjectId, &[ObjectId], Aabb);

/// Tests that nodes dropped because a parent replaced all their objects are opened again at once after any
/// change of the parent.
#[test]
fn nodes_of_children_whose_parent_has_changed_are_looked_into() {
    let whole = Aabb::from_arrays([490.0; 3], [530.0; 3]);
    let elsewhere = Aabb::from_arrays([-530.0; 3], [-490.0; 3]);
    let from = DrawRange { begin: 10.0, ..DrawRange::ALWAYS };
    let all_layers = u32::MAX;
    let changes: [(&str, Change); 9] = [
        ("moved", |scene, parent, _, to| scene.set_bounds(parent, to).unwrap()),
        ("moved with all others", |scene, parent, children, to| {
            let still = children.iter().map(|&id| (id, scene.bounds(id).unwrap()));
            let moved: Vec<_> = still.chain([(parent, to)]).collect();
            scene.set_bounds_batch(&moved).unwrap();
        }),
        ("moved a little with all others, after them", |scene, parent, children, _| {
            let bounds = |id: ObjectId| scene.bounds(id).unwrap();
            let to = Aabb::new(bounds(parent).min + 30.0, bounds(parent).max + 30.0);
            let moved: Vec<_> = children.iter().map(|&id| (id, bounds(id))).chain([(parent, to)]).collect();
            scene.set_bounds_batch(&moved).unwrap();
        }),
        ("on another layer", |scene, parent, _, _| scene.set_layers(parent, 2).unwrap()),
        ("removed", |scene, parent, _, _| scene.remove(parent).unwrap()),
        ("never culled", |scene, parent, _, _| scene.set_never_cull(parent, true).unwrap()),
        ("farther", |scene, parent, _, _| {
            let begin = DrawRange { begin: 1e5, ..DrawRange::ALWAYS };
            scene.set_draw_range(parent, begin).unwrap();
        }),
        ("children on more layers", |scene, _, children, _| {
            children.iter().for_each(|&id| scene.set_layers(id, u32::MAX).unwrap());
        }),
        ("children without parent", |scene, _, children, _| {
            children.iter().for_each(|&id| scene.set_hlod_parent(id, None).unwrap());
        }),
    ];
    for (what, change) in changes {
        let mut rng = Random(12);
        let mut scene = Scene::new();
        let parent = scene.insert(Object { layers: all_layers >> 1, ..Object::new(whole) });
        scene.set_draw_range(parent, from).unwrap();
        let child = |rng: &mut Random| {
            let at = rng.vec3(495.0, 520.0);
            Object { layers: 5, ..Object::new(Aabb::new(at, at + 1.0)) }
        };
        let children = scene.insert_batch((0..600).map(|_| child(&mut rng)).collect::<Vec<_>>());
        for &id in &children {
            scene.set_hlod_parent(id, Some(parent)).unwrap();
        }
        scene.rebuild();
        let view = view_from(DVec3::ZERO);
        let (seen, stats) = cull(&mut ContributionCuller::new(1080.0, 0.0), &scene, &view);
        assert!(seen.len() == 1 && stats.nodes <= 2, "{what}: {} nodes", stats.nodes);
        change(&mut scene, parent, &children, elsewhere);
        let seen = cull(&mut ContributionCuller::new(1080.0, 0.0), &scene, &view).0;
        assert!(children.iter().all(|id| seen.contains(id)), "{what}: {} seen", seen.len());
    }
}

#[test]
fn ranges_and_parents_follow_their_objects() {
    let mut scene = Scene::new();
    let ids = scene.insert_batch((0..5).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 1.0; 3])));
    let [a, b, c, d, gone] = ids[..].try_into().unwrap();
    let range = DrawRange { begin: 1.0, end: 9.0, margin: 2.0 };
    scene.set_draw_range(gone, range).unwrap();
    scene.set_hlod_parent(gone, Some(a)).unwrap();
    scene.remove(gone).unwrap();
    for error in [
        scene.set_draw_range(gone, range),
        scene.set_hlod_parent(gone, None),
        scene.set_hlod_parent(a, Some(gone)),
    ] {
        assert_eq!(error, Err(SceneError::UnknownObject(gone)), "the object was removed");
    }
    assert!(
        scene.draw_range(gone).is_err() && scene.hlod_parent(gone).is_err(),
        "an object that was removed has neither range nor parent"
    );
    let new = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
    assert_eq!(
        (new.index(), scene.draw_range(new)),
        (gone.index(), Ok(DrawRange::ALWAYS)),
        "the new object takes the index of the old, without its range"
    );
    assert_eq!(scene.hlod_parent(new), Ok(None), "the new object has no parent");
    let revision = scene.revision();
    for (child, parent) in [(a, b), (b, c), (d, c), (new, c)] {
        scene.set_hlod_parent(child, Some(parent)).unwrap();
        assert_eq!(scene.hlod_parent(child), Ok(Some(parent)), "the parent of {child}");
    }
    assert!(scene.revision() > revision, "a parent is a change of the scene");
    for (child, parent) in [(a, a), (c, a), (b, a)] {
        assert_eq!(
            scene.set_hlod_parent(child, Some(parent)),
            Err(SceneError::Parent(child)),
            "{parent} as the parent of {child} closes a ring"
        );
    }
    scene.set_hlod_parent(b, None).unwrap();
    scene.set_hlod_parent(b, Some(d)).unwrap();
    scene.remove(c).unwrap();
    assert_eq!(
        [a, b, d, new].map(|id| scene.hlod_parent(id).unwrap()),
        [Some(b), Some(d), None, None],
        "parents after one was removed"
    );
    for (begin, end, margin) in [
        (f32::NAN, 1.0, 0.0),
        (0.0, f32::NAN, 0.0),
        (0.0, 1.0, f32::NAN),
        (-1.0, 1.0, 0.0),
        (2.0, 1.0, 0.0),
        (f32::INFINITY, f32::INFINITY, 0.0),
        (0.0, 1.0, -1.0),
        (0.0, 1.0, f32::INFINITY),
    ] {
        let refused = scene.set_draw_range(a, DrawRange { begin, end, margin });
        assert_eq!(refused, Err(SceneError::DrawRange(a)), "a range of {begin} to {end}, margin {margin}");
    }
    assert_eq!(scene.draw_range(a), Ok(DrawRange::ALWAYS), "refused ranges change nothing");
    let copy = scene.clone();
    assert_eq!(copy.hlod_parent(a), Ok(Some(b)), "a clone keeps parents");
}

#[test]
fn at_most_64_parents_stand_above_one_another() {
    let mut scene = Scene::new();
    let ids = scene.insert_batch([Aabb::from_arrays([0.0; 3], [1.0; 3]); 200]);
    // A chain made from below, and one made from above.
    for i in 0..64 {
        scene.set_hlod_parent(ids[i], Some(ids[i + 1])).unwrap();
        scene.set_hlod_parent(ids[170 - i - 1], Some(ids[170 - i])).unwrap();
    }
    let too_many = |id| Err(SceneError::TooManyParents(id));
    let revision = scene.revision();
    assert_eq!(scene.set_hlod_parent(ids[64], Some(ids[66])), too_many(ids[64]), "a parent above the chain");
    assert_eq!(scene.set_hlod_parent(ids[67], Some(ids[106])), too_many(ids[67]), "a child below the chain");
    assert_eq!(scene.revision(), revision, "a refused parent changes nothing");
    assert_eq!(scene.set_hlod_parent(ids[67], Some(ids[107])), Ok(()), "a sibling of the last child");
    assert_eq!(scene.set_hlod_parent(ids[106], Some(ids[107])), Ok(()), "the parent that it has");
    // The deepest child counts, whichever was linked first, and no object beside the one that is moved.
    let [top, near, far, below] = [180, 181, 182, 183].map(|i| ids[i]);
    for (child, parent) in [(near, top), (far, top), (below, far)] {
        scene.set_hlod_parent(child, Some(parent)).unwrap();
    }
    assert_eq!(scene.set_hlod_parent(top, Some(ids[3])), Ok(()), "62 parents, and two levels below");
    assert_eq!(scene.set_hlod_parent(top, Some(ids[2])), too_many(top), "63 parents, and two levels below");
    assert_eq!(scene.set_hlod_parent(near, Some(ids[1])), Ok(()), "64 parents, and none below");
    scene.set_hlod_parent(ids[64], None).unwrap();
}
