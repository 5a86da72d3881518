//! Tests of both tessellations: cells fill space, neighbours are mutual, and cells list all objects that meet
//! them.

use crate::common::{Random, rooms, triangles};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, Object, Scene};
use visibility_plp::{Content, DelaunayTessellation, Fineness, OctreeTessellation, Tessellation};

/// Small leaves, so that small test scenes have many cells.
const FINE: Fineness = Fineness { vertices: 24, halvings: 7 };

/// Asserts that points of objects lie in cells that list the objects, that faces are mutual between
/// neighbours and close every inner cell, and that the cells leave no gap.
fn check(scene: &Scene, cells: &dyn Tessellation) {
    let count = cells.content().cell_count() as u32;
    assert!(count > 100, "{count} cells");
    let bounds = cells.bounds();
    let mut random = Random(5);
    for id in scene.ids() {
        let held = |point: DVec3| {
            let cell = cells.locate(point).expect("the padded bounds hold every primitive");
            assert!(cells.cell_bounds(cell).contains_point(point.as_vec3()), "{point}");
            assert!(cells.contains(cell, point), "{point}");
            assert!(
                cells.content().primitives(cell).any(|object| object as usize == id.index()),
                "{id} at {point}"
            );
        };
        for triangle in scene.triangles(id).unwrap() {
            for _ in 0..10 {
                let (mut u, mut v) = (random.fine_unit(), random.fine_unit());
                if u + v > 1.0 {
                    (u, v) = (1.0 - u, 1.0 - v);
                }
                let [a, b, c] = triangle.map(|p| p.as_dvec3());
                held(a + (b - a) * u + (c - a) * v);
            }
            triangle.iter().for_each(|p| held(p.as_dvec3()));
        }
        if scene.triangles(id).unwrap().is_empty() {
            let Aabb { min, max } = scene.bounds(id).unwrap();
            for _ in 0..10 {
                let [u, v, w] =
                    [random.fine_unit(), random.fine_unit(), random.fine_unit()].map(|x| x as f32);
                held((min + (max - min) * Vec3::new(u, v, w)).as_dvec3());
            }
        }
    }
    let boundary = cells.boundary();
    let mut inner = 0;
    for cell in 0..count {
        let mut sum = DVec3::ZERO;
        let mut area = 0.0;
        cells.for_each_face(cell, &|_| true, &mut |face| {
            assert!(
                (face.normal.length() - 1.0).abs() < 1e-9 && face.area > 0.0,
                "cell {cell}: the normal has length {} and the area is {}",
                face.normal.length(),
                face.area
            );
            sum += face.normal * face.area;
            area += face.area;
            let mut back = None;
            cells.for_each_face(face.neighbour, &|_| true, &mut |other| {
                if other.neighbour == cell {
                    back = Some(*other);
                }
            });
            let back = back.expect("neighbours are mutual");
            assert!(
                (back.normal + face.normal).length() < 1e-6
                    && (back.area - face.area).abs() < 1e-6 * area.max(1.0),
                "cell {cell}: the face from the other side is {back:?}"
            );
            assert!(
                (cells.center(face.neighbour) - cells.center(cell)).dot(face.normal) > 0.0,
                "cell {cell}: the face's normal points to its neighbour"
            );
        });
        assert!(cells.contains(cell, cells.center(cell)), "cell {cell} contains its centre");
        assert_eq!(cells.locate(cells.center(cell)), Some(cell), "the cell at the centre of cell {cell}");
        if !boundary.contains(&cell) {
            inner += 1;
            // On a closed surface, the normals weighted by face areas sum to zero.
            assert!(sum.length() < 1e-6 * area, "cell {cell}: {sum} of {area}");
        }
    }
    assert!(inner > 10, "inner cells: {inner}");
    // Random points in the padded bounds must all lie in a cell.
    let size = (bounds.max - bounds.min).as_dvec3() * 0.49;
    for _ in 0..2000 {
        let point = bounds.center().as_dvec3() + random.fine_vector(1.0) * size;
        let cell = cells.locate(point).expect("no gap");
        assert!(cells.contains(cell, point), "cell {cell} contains {point}");
    }
    assert_eq!(cells.locate(bounds.max.as_dvec3() * 2.0 + 1.0), None, "a point outside is in no cell");
    assert_eq!(cells.locate(DVec3::NAN), None, "NaN is in no cell");
}

#[test]
fn cells_hold_what_meets_them() {
    let scenes = [triangles(1, 1500), rooms(12).0];
    for scene in &scenes {
        check(scene, &OctreeTessellation::from_scene(scene, FINE));
        check(scene, &DelaunayTessellation::from_scene(scene, FINE));
    }
}

#[test]
fn strange_scenes_are_cut_too() {
    let mut scene = Scene::new();
    let cut = |scene: &Scene| {
        let cells = OctreeTessellation::from_scene(scene, FINE);
        let tetrahedra = DelaunayTessellation::from_scene(scene, FINE);
        (cells.content().strays().len(), tetrahedra.content().strays().len())
    };
    assert_eq!(cut(&scene), (0, 0), "strays of an empty scene");
    let nan = scene.insert(Aabb::from_arrays([f32::NAN; 3], [1.0; 3]));
    assert_eq!(cut(&scene), (1, 1), "strays of a scene of one NaN");
    // An object with finite bounds and a non-finite triangle.
    let odd = scene.insert(Aabb::from_arrays([0.0; 3], [9.0; 3]));
    scene.set_triangles(odd, [[Vec3::ZERO, Vec3::ONE, Vec3::NAN]]).unwrap();
    scene.insert(Object::new(Aabb::from_arrays([3.0; 3], [3.0; 3])));
    for size in [1e-30, 1e30, f32::MAX] {
        scene.insert(Aabb::from_arrays([-size; 3], [size; 3]));
        assert_eq!(cut(&scene), (1, 1), "{size}");
    }
    let cells = OctreeTessellation::new(&scene);
    assert_eq!(cells.content().strays(), [nan], "strays: the object with bounds of NaN");
    assert!(
        cells.content().holds(odd) && !cells.content().holds(nan),
        "the object with a triangle of NaN is in a cell"
    );
}

/// Coincident boxes need no more cells than one box, however many there are, since splitting would not
/// separate them.
#[test]
fn coincident_boxes_make_no_more_cells() {
    let of = |count: usize| {
        let mut scene = Scene::new();
        scene.insert_batch((0..count).map(|_| Aabb::from_arrays([0.0; 3], [1.0; 3])));
        let (octree, delaunay) = (OctreeTessellation::new(&scene), DelaunayTessellation::new(&scene));
        [octree.content(), delaunay.content()].map(|cells| (cells.cell_count(), cells.reference_count()))
    };
    for count in [1000, 5000] {
        let [octree, delaunay] = of(count);
        assert_eq!(octree, (8, 8 * count as u64), "{count} boxes");
        assert!(delaunay.0 < 100 && delaunay.1 <= 100 * count as u64, "{count} boxes: {delaunay:?}");
    }
}

#[test]
fn pairs_of_unknown_cells_or_objects_are_left_out() {
    let mut scene = Scene::new();
    let gone = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
    let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
    scene.remove(gone).unwrap();
    let object = id.index() as u32;
    let pairs = [(0, gone.index() as u32), (0, object), (7, object), (1, 99), (u32::MAX, u32::MAX)];
    let content = Content::new(&scene, &pairs, vec![[0; 4]; 2]);
    assert_eq!(
        (content.primitives(0).collect::<Vec<_>>(), content.reference_count()),
        (vec![object], 1),
        "the object that exists, in the cell that exists"
    );
}

#[test]
fn changed_objects_are_strays() {
    let (mut scene, walls, _) = rooms(12);
    let mut cells = OctreeTessellation::from_scene(&scene, FINE);
    scene.set_bounds(walls[3], Aabb::from_arrays([500.0; 3], [501.0; 3])).unwrap();
    scene.remove(walls[5]).unwrap();
    let new = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
    assert!(cells.sync(&scene), "the cells know the scene");
    let mut strays = [walls[3], new];
    strays.sort_unstable();
    assert_eq!(cells.content().strays(), strays, "the moved object and the new one");
    cells.rebuild(&scene);
    assert!(
        cells.content().strays().is_empty() && cells.locate(DVec3::splat(500.5)).is_some(),
        "cells made anew have no strays, and reach to the moved object"
    );
    assert!(!cells.sync(&Scene::new()), "another scene");
}
