//! Unit tests of what must hold in a frame for an object to hide others, of all cullers of the crate, by
//! their answers about a box behind a wall of two halves.

use crate::{NaylorCuller, Occluders, OcclusionTreeCuller, SceneTree, ShadowFrusta, ShadowFrustaCuller};
use alloc::sync::Arc;
use std::borrow::ToOwned;
use std::boxed::Box;
use std::vec::Vec;
use visibility_core::geometry::Plane;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{
    Aabb, Culler, Object, ObjectId, OccluderMesh, Pose, Scene, View, VisibleSet, occlusion::Preparation,
    view::Window,
};
use visibility_testing::NOT_ALWAYS_DRAWN;

/// Inserts an object with the twelve triangles of its bounds.
fn insert(scene: &mut Scene, object: Object) -> ObjectId {
    let corners = object.bounds.corners();
    let triangles: Vec<[Vec3; 3]> =
        OccluderMesh::CUBOID.iter().map(|t| t.map(|i| corners[i as usize])).collect();
    let id = scene.insert(object);
    scene.set_triangles(id, triangles).unwrap();
    id
}

/// A wall of two halves across the x axis, which meet at y = 0, and a box behind both.
struct World {
    scene: Scene,
    halves: [ObjectId; 2],
    target: ObjectId,
}

impl World {
    fn new() -> Self {
        let mut scene = Scene::new();
        let halves = [(-8.0, 0.0), (0.0, 8.0)].map(|(from, to)| {
            let bounds = Aabb::from_arrays([4.0, from, -8.0], [4.5, to, 8.0]);
            insert(&mut scene, Object { occluder: true, layers: 1, ..Object::new(bounds) })
        });
        let target = insert(&mut scene, Object::new(Aabb::from_arrays([6.0, -1.0, -0.5], [7.0, 0.5, 0.5])));
        // Shadow frusta are chosen for eyes among the objects.
        insert(&mut scene, Object::new(Aabb::from_arrays([-9.0, -4.0, -4.0], [-8.0, 4.0, 4.0])));
        scene.prepare_occluders(&Preparation::default());
        scene.rebuild();
        Self { scene, halves, target }
    }

    /// Returns one of each culler, with data of the scene as it is.
    fn cullers(&self) -> Vec<Box<dyn Culler>> {
        let occluders = Arc::new(Occluders::new(&self.scene));
        let frusta = ShadowFrusta::new(&self.scene, Occluders::clone(&occluders), 1, 16);
        std::vec![
            #[cfg(feature = "papers")]
            Box::new(crate::LargeOccludersCuller::new(occluders.clone())),
            Box::new(OcclusionTreeCuller::new(occluders)),
            Box::new(ShadowFrustaCuller::new(frusta.into())),
            Box::new(NaylorCuller::new(SceneTree::new(&self.scene).unwrap())),
        ]
    }

    /// Tests whether a culler removes the target from the set of all objects on the view's layers but
    /// `removed`.
    fn hides(&self, culler: &mut dyn Culler, view: &View, removed: &[ObjectId]) -> bool {
        self.hides_from(culler, view, view, removed)
    }

    /// As [`hides`](Self::hides), from the set of all objects on the layers of another view.
    fn hides_from(&self, culler: &mut dyn Culler, view: &View, of: &View, removed: &[ObjectId]) -> bool {
        let mut visible = VisibleSet::new();
        visible.fill(&self.scene, of);
        visible.retain(&self.scene, |id, _| !removed.contains(&id));
        culler.cull(&self.scene, view, &mut visible);
        !visible.contains(&self.scene, self.target)
    }
}

fn pose() -> Pose {
    Pose::look_at(DVec3::new(0.125, 0.25, 0.0), DVec3::new(4.0, 0.25, 0.0), DVec3::Z)
}

/// Views along the x axis: in perspective, and parallel.
fn views() -> [View; 2] {
    [
        View::perspective(pose(), 1.0, 1.5, 0.1, f64::INFINITY).unwrap(),
        View::orthographic(pose(), Window::centered(12.0, 12.0), 0.1, 99.0).unwrap(),
    ]
}

type Change = Box<dyn Fn(&mut World, ObjectId)>;

/// Changes that make an object of the wall one that must not hide, by name. The first six hold for all
/// cullers; the others for those whose answer must hold in frames that do not draw the object.
fn changes() -> Vec<(&'static str, Change)> {
    let mut changes: Vec<(&str, Change)> = std::vec![
        ("no occluder", Box::new(|world, id| world.scene.set_occluder(id, false).unwrap())),
        ("on another layer", Box::new(|world, id| world.scene.set_layers(id, 2).unwrap())),
        ("gone", Box::new(|world, id| world.scene.remove(id).unwrap())),
        (
            "elsewhere",
            Box::new(|world, id| {
                let bounds = Aabb::from_arrays([4.0, 90.0, -8.0], [4.5, 98.0, 8.0]);
                world.scene.set_bounds(id, bounds).unwrap();
            }),
        ),
        (
            "replaced by another",
            Box::new(|world, id| {
                let object = world.scene.object(id).unwrap();
                world.scene.remove(id).unwrap();
                let other = insert(&mut world.scene, object);
                assert_eq!(other.index(), id.index(), "the index is used again");
                world.scene.prepare_occluders(&Preparation::default());
            }),
        ),
        ("of another scene", Box::new(|world, _| world.scene = world.scene.clone())),
    ];
    let names = ["with a draw range", "an HLOD parent", "an HLOD child", "never culled"];
    for (name, change) in names.into_iter().zip(NOT_ALWAYS_DRAWN) {
        changes.push((name, Box::new(move |world, id| change(&mut world.scene, id))));
    }
    changes
}

/// A half of the wall is changed between two frames of which all else is the same.
#[test]
fn a_wall_hides_while_all_of_it_is_as_it_was() {
    for (number, view) in views().into_iter().enumerate() {
        for (k, (what, change)) in changes().iter().enumerate() {
            for (half, position) in (0..8).map(|i| (i % 2, i / 2)) {
                let mut world = World::new();
                let Some(mut culler) = world.cullers().into_iter().nth(position) else { continue };
                if culler.name() == "naylor" && k >= 6 {
                    continue;
                }
                let what = std::format!("view {number}, {}, half {half} is {what}", culler.name());
                for frame in 0..2 {
                    assert!(world.hides(&mut *culler, &view, &[]), "{what}: frame {frame} before");
                }
                let id = world.halves[half];
                change(&mut world, id);
                for frame in 0..3 {
                    assert!(!world.hides(&mut *culler, &view, &[]), "{what}: frame {frame} after");
                }
            }
        }
    }
}

/// Views and incoming sets in which the wall is not drawn, between frames in which it is.
#[test]
fn a_wall_hides_in_frames_that_draw_all_of_it() {
    let world = World::new();
    for (number, view) in views().into_iter().enumerate() {
        let clipped = |x: f64| {
            // The half-space beyond x.
            view.with_clip_planes(&[Plane::new(DVec3::X, -x)]).unwrap()
        };
        let [low, high] = world.halves;
        // The second view has the target and half of the wall in it, up to y = 0.
        let narrow = Pose::look_at(DVec3::new(0.0, -4.0, 0.0), DVec3::new(4.0, -4.0, 0.0), DVec3::Z);
        let narrow = View::orthographic(narrow, Window::centered(3.5, 3.5), 0.1, 99.0).unwrap();
        for mut culler in world.cullers() {
            let name = std::format!("view {number}, {}", culler.name());
            let frames: [(&str, View, &[ObjectId], bool); 16] = [
                ("all is drawn", view, &[], true),
                ("a half is removed", view, &[low], false),
                ("all is drawn again", view, &[], true),
                ("the other half is removed", view, &[high], false),
                ("all is drawn again", view, &[], true),
                ("a layer of the target alone", view.with_layers(2), &[], false),
                ("on the wall's layer", view.with_layers(1), &[], true),
                ("a plane before the wall", clipped(3.0), &[], true),
                ("a plane behind the wall", clipped(5.0), &[], false),
                ("without planes", view, &[], true),
                ("a plane behind the wall", clipped(5.0), &[], false),
                ("a plane through the wall", clipped(4.25), &[], culler.name() == "naylor"),
                ("without planes", view, &[], true),
                ("a half is in view, both in the set", narrow, &[], true),
                ("a half is in view, and in the set", narrow, &[high], true),
                ("a half is in view, and not in the set", narrow, &[low], false),
            ];
            for (what, view, removed, is) in frames {
                let is_hidden = world.hides(&mut *culler, &view, removed);
                assert_eq!(is_hidden, is, "{name}: {what}");
            }
        }
    }
}

/// A half of the wall is such that it must not hide when the polygons are made. The set has objects of all
/// layers, and the view is of those on another layer than the wall.
#[test]
fn a_wall_hides_nothing_that_it_must_not_hide_when_the_polygons_are_made() {
    for (number, view) in views().into_iter().enumerate() {
        for (k, (what, change)) in changes().iter().enumerate() {
            if k == 4 {
                // The other object hides as the one before did.
                continue;
            }
            for half in [0, 1] {
                let mut world = World::new();
                let id = world.halves[half];
                change(&mut world, id);
                for mut culler in world.cullers() {
                    if culler.name() == "naylor" && k >= 6 {
                        continue;
                    }
                    let name = culler.name().to_owned();
                    for frame in 0..2 {
                        let is_hidden = world.hides_from(&mut *culler, &view.with_layers(1), &view, &[]);
                        let is = what == &"of another scene";
                        assert_eq!(
                            is_hidden, is,
                            "view {number}, {name}, half {half} is {what}, frame {frame}"
                        );
                    }
                }
            }
        }
        let world = World::new();
        for mut culler in world.cullers() {
            for (layers, is) in [(1, true), (2, false), (3, true), (2, false)] {
                let is_hidden = world.hides_from(&mut *culler, &view.with_layers(layers), &view, &[]);
                assert_eq!(is_hidden, is, "view {number}, {}, layers {layers}", culler.name());
            }
        }
    }
}

/// The wall moves aside, so that it hides half of the target, and polygons are synced or made anew; or those
/// of before are given back.
#[test]
fn polygons_hide_where_their_objects_are_now() {
    for view in views() {
        for synced in [false, true] {
            let mut world = World::new();
            let before = Arc::new(Occluders::new(&world.scene));
            let mut aside = |id: ObjectId, from: f32, to: f32| {
                let bounds = Aabb::from_arrays([4.0, from, -8.0], [4.5, to, 8.0]);
                world.scene.set_bounds(id, bounds).unwrap();
                let corners = bounds.corners();
                let triangles = OccluderMesh::CUBOID.map(|t| t.map(|i| corners[i as usize]));
                world.scene.set_triangles(id, triangles).unwrap();
            };
            aside(world.halves[0], -0.25, 8.0);
            aside(world.halves[1], 8.0, 16.0);
            world.scene.prepare_occluders(&Preparation::default());
            let now = if synced {
                let mut now = Occluders::clone(&before);
                now.sync(&world.scene);
                now
            } else {
                Occluders::new(&world.scene)
            };
            let now = Arc::new(now);
            let frusta =
                |polygons: &Occluders| Arc::new(ShadowFrusta::new(&world.scene, polygons.clone(), 1, 16));
            let (mut tree, mut shadows) =
                (OcclusionTreeCuller::new(now.clone()), ShadowFrustaCuller::new(frusta(&now)));
            assert!(!world.hides(&mut tree, &view, &[]), "occlusion tree, synced: {synced}");
            assert!(!world.hides(&mut shadows, &view, &[]), "shadow frusta, synced: {synced}");
            tree.set_occluders(before.clone());
            shadows.set_frusta(frusta(&before));
            for frame in 0..2 {
                assert!(!world.hides(&mut tree, &view, &[]), "occlusion tree of before, frame {frame}");
                assert!(!world.hides(&mut shadows, &view, &[]), "shadow frusta of before, frame {frame}");
            }
            #[cfg(feature = "papers")]
            {
                let mut large = crate::LargeOccludersCuller::new(now.clone());
                for frame in 0..2 {
                    assert!(!world.hides(&mut large, &view, &[]), "synced: {synced}, frame {frame}");
                }
                large.set_occluders(before);
                for frame in 0..2 {
                    assert!(!world.hides(&mut large, &view, &[]), "polygons of before, frame {frame}");
                }
            }
        }
    }
}

/// Polygons of one number, of a wall that hides the target and of one that has moved aside.
#[cfg(feature = "papers")]
#[test]
fn other_polygons_of_the_same_numbers_are_taken_in() {
    let of = |from: f32, to: f32| {
        let mut scene = Scene::new();
        let target = insert(&mut scene, Object::new(Aabb::from_arrays([6.0, -1.0, -0.5], [7.0, 0.5, 0.5])));
        let bounds = Aabb::from_arrays([4.0, from, -8.0], [4.5, to, 8.0]);
        insert(&mut scene, Object { occluder: true, ..Object::new(bounds) });
        scene.prepare_occluders(&Preparation::default());
        World { halves: [target; 2], target, scene }
    };
    let (before, aside) = (of(-8.0, 8.0), of(-0.25, 16.0));
    let mut culler = crate::LargeOccludersCuller::new(Arc::new(Occluders::new(&before.scene)));
    for view in views() {
        for round in 0..2 {
            culler.set_occluders(Arc::new(Occluders::new(&before.scene)));
            assert!(before.hides(&mut culler, &view, &[]), "behind the wall, round {round}");
            culler.set_occluders(Arc::new(Occluders::new(&aside.scene)));
            assert!(!aside.hides(&mut culler, &view, &[]), "beside the wall, round {round}");
        }
    }
}

/// The polygons of one scene are used with another scene, whose objects have the same ids.
#[test]
fn a_wall_hides_again_in_the_scene_that_it_is_of() {
    let world = World::new();
    let other = World { scene: world.scene.clone(), halves: world.halves, target: world.target };
    for view in views() {
        for mut culler in world.cullers() {
            for round in 0..3 {
                for frame in 0..2 {
                    let name = culler.name().to_owned();
                    assert!(world.hides(&mut *culler, &view, &[]), "{name}, round {round}, frame {frame}");
                }
                for frame in 0..2 {
                    let name = culler.name().to_owned();
                    assert!(!other.hides(&mut *culler, &view, &[]), "{name}, round {round}, frame {frame}");
                }
            }
        }
    }
}

/// A wall of two storeys with a slab between them that begins inside of the wall: a section of all three, in
/// the plane in which the slab begins, hides what no other polygon does.
#[test]
fn a_section_hides_from_outside_of_its_boxes_alone() {
    let mut scene = Scene::new();
    for (low, high) in [
        ([4.0, -5.0, 0.0], [5.0, 5.0, 3.0]),
        ([4.5, -5.0, 3.0], [12.0, 5.0, 3.25]),
        ([4.0, -5.0, 3.25], [5.0, 5.0, 6.0]),
    ] {
        insert(&mut scene, Object { occluder: true, ..Object::new(Aabb::from_arrays(low, high)) });
    }
    let target = insert(&mut scene, Object::new(Aabb::from_arrays([9.0, -2.0, 0.5], [10.0, 2.0, 4.5])));
    insert(&mut scene, Object::new(Aabb::from_arrays([-9.0, -5.0, 0.0], [-8.0, 5.0, 6.0])));
    scene.prepare_occluders(&Preparation::default());
    let world = World { halves: [target; 2], target, scene };
    let view = |x: f64, near: f64| {
        let pose = Pose::look_at(DVec3::new(x, 0.0, 1.5), DVec3::new(9.0, 0.0, 1.5), DVec3::Z);
        View::perspective(pose, 2.0, 1.5, near, f64::INFINITY).unwrap()
    };
    for mut culler in world.cullers() {
        if culler.name() == "naylor" {
            continue;
        }
        for (x, near, is) in [
            (3.95, 0.01, true),
            (4.03, 0.01, false),
            (3.95, 0.01, true),
            (4.2, 0.01, false),
            (3.96, 0.01, true),
            (4.04, 0.01, false),
            (3.95, 0.01, true),
            // The near plane reaches into the box: 0.09 m at the corners of the image.
            (3.95, 0.04, false),
            (3.95, 0.01, true),
            // Less than that by half, it does not.
            (3.95, 0.02, false),
            (3.95, 0.01, true),
            (3.95, 0.2, false),
        ] {
            let is_hidden = world.hides(&mut *culler, &view(x, near), &[]);
            assert_eq!(is_hidden, is, "{}, from x = {x}, near plane at {near}", culler.name());
        }
    }
}

/// Faces of one-sided objects hide from their front alone, and are seen from there alone.
#[test]
fn a_one_sided_face_is_seen_and_hides_from_its_front() {
    let square = |x: f32, half: f32, turned: bool| {
        let corner = |y: f32, z: f32| Vec3::new(x, y * half, z * half);
        let mut triangle = [corner(-2.0, -1.0), corner(2.0, -1.0), corner(0.0, 2.0)];
        // Seen counter-clockwise from +x.
        if turned {
            triangle.swap(1, 2);
        }
        triangle
    };
    for view in views() {
        // Fronts look to +x, away from the eye, unless turned.
        for (one_sided, turned, hides) in
            [(false, false, true), (false, true, true), (true, false, false), (true, true, true)]
        {
            let mut scene = Scene::new();
            let mut insert = |triangle: [Vec3; 3], occluder, one_sided| {
                let bounds = Aabb::from_points(triangle);
                let id = scene.insert(Object { occluder, one_sided, ..Object::new(bounds) });
                scene.set_triangles(id, [triangle]).unwrap();
                id
            };
            let face = insert(square(4.0, 3.0, turned), true, one_sided);
            let behind = insert(square(5.0, 0.5, true), false, true);
            let tree = SceneTree::new(&scene).unwrap();
            let mut visible = VisibleSet::new();
            visible.fill(&scene, &view);
            NaylorCuller::new(tree).cull(&scene, &view, &mut visible);
            let what = std::format!("one-sided: {one_sided}, turned: {turned}, {:?}", view.eye(DVec3::ZERO));
            assert_eq!(visible.contains(&scene, face), hides, "a face, {what}");
            assert_eq!(!visible.contains(&scene, behind), hides, "behind a face, {what}");
        }
    }
}
