//! Tests of triangles that objects share: they are placed where copies would be, and prepared as occluders
//! once.

use visibility_core::glam::{Affine3A, DAffine3, DMat3, DQuat, DVec3, Vec3};
use visibility_core::scene::{SharedTriangles, Triangle};
use visibility_core::{
    Aabb, Object, ObjectId, OccluderMesh, Scene, geometry::DoubleDouble, level_version::level_object,
    occlusion::Preparation,
};
use visibility_testing::Random;

/// Returns the triangles of a box.
fn solid(bounds: Aabb) -> Vec<Triangle> {
    OccluderMesh::CUBOID.map(|t| t.map(|i| bounds.corners()[i as usize])).to_vec()
}

const UNIT: Aabb = Aabb::from_arrays([0.0; 3], [1.0; 3]);

/// Inserts an occluder with placed triangles.
fn place(scene: &mut Scene, mesh: &SharedTriangles, transform: DAffine3, one_sided: bool) -> ObjectId {
    let triangles = mesh.placed(transform);
    let id = scene.insert(Object { occluder: true, one_sided, ..Object::new(triangles.bounds()) });
    scene.set_triangles(id, triangles).unwrap();
    id
}

#[test]
fn placed_triangles_are_copies_to_the_last_bit() {
    let mut random = Random(7);
    let mut mirrored = 0;
    for _ in 0..200 {
        let mut vector = |reach: f64| random.vec3(-reach, reach);
        let mesh: Vec<Triangle> = (0..5).map(|_| [vector(3.0), vector(3.0), vector(3.0)]).collect();
        let columns = [(); 3].map(|()| vector(2.0).as_dvec3());
        let transform = DAffine3 {
            matrix3: DMat3::from_cols_array_2d(&columns.map(DVec3::into)),
            translation: vector(1e3).as_dvec3(),
        };
        let is_mirrored = columns[0].cross(columns[1]).dot(columns[2]) < 0.0;
        mirrored += usize::from(is_mirrored);
        let copies: Vec<Triangle> = mesh
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.map(|p| transform.transform_point3(p.as_dvec3()).as_vec3());
                if is_mirrored { [a, c, b] } else { [a, b, c] }
            })
            .collect();
        let shared = SharedTriangles::from(&mesh[..]);
        let placed = shared.placed(transform);
        assert!(
            placed.iter().eq(copies.iter().copied()) && placed.shares_mesh(&shared),
            "placed triangles and their copies differ: {transform:?}"
        );
        // The bounds hold the vertices before these are rounded, so a side may be one step farther out.
        let (bounds, rounded) = (placed.bounds(), Aabb::from_points(copies.iter().flatten().copied()));
        let inner = Aabb::new(bounds.min.map(f32::next_up), bounds.max.map(f32::next_down));
        assert!(
            bounds.union(&rounded) == bounds && rounded.union(&inner) == rounded,
            "bounds {bounds:?} of {rounded:?}: {transform:?}"
        );
        assert_eq!(
            (placed.len(), placed.view().get(4), placed.view().get(5)),
            (5, Some(copies[4]), None),
            "placed triangles by number, and beyond the last"
        );
        let mut scene = Scene::new();
        let id = place(&mut scene, &shared, transform, false);
        assert_eq!(scene.triangles(id).unwrap(), copies[..].into(), "triangles of the object: {transform:?}");
    }
    assert!((60..140).contains(&mirrored), "{mirrored}");
}

#[test]
fn triangles_outside_of_the_bounds_are_refused_where_they_are_placed() {
    let mesh = SharedTriangles::from(solid(UNIT));
    let mut scene = Scene::new();
    let id = scene.insert(UNIT);
    scene.set_triangles(id, mesh.clone()).unwrap();
    let moved = mesh.placed(DAffine3::from_translation(DVec3::X * 1e-3));
    assert!(scene.set_triangles(id, moved).is_err(), "triangles moved out of the bounds by 1 mm");
    assert_eq!(scene.triangles(id).unwrap(), mesh.view(), "a refused call changes nothing");
}

/// Bounds computed from the transform in `f64` contain the triangles although their transform is rounded.
/// Also tested where coordinates on one axis are far smaller than on another, and with a corner at 0.
#[test]
fn bounds_computed_in_f64_hold_placed_triangles() {
    let mut random = Random(3);
    let mut rounded = [0; 3];
    for round in 0..300 {
        let far = [0.0, 2.0, 10_000.0][round % 3];
        let mesh = solid(Aabb::from_arrays([far, 0.0, 0.0], [far + 5.0, 1.0, 2.0]));
        let turn = DAffine3::from_rotation_y(if round < 3 { 0.7 } else { random.unit() * 6.0 });
        let corners = || mesh.iter().flatten().map(|p| turn.transform_point3(p.as_dvec3()));
        let greatest = corners().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
        let back = DAffine3::from_translation(DVec3::Z * -greatest) * turn;
        let bounds = Aabb::from_points(corners().map(|p| (p - DVec3::Z * greatest).as_vec3()));
        let placed = SharedTriangles::from(mesh).placed(back);
        rounded[round % 3] += usize::from(placed.view().known_bounds().is_some());
        let mut scene = Scene::new();
        let id = scene.insert(bounds);
        assert_eq!(scene.set_triangles(id, placed.clone()), Ok(()), "{round}: {far} m");
        // A distance of 0.1 mm is more than the rounding error of a few metres.
        scene.set_bounds(id, Aabb::new(bounds.min, bounds.max - Vec3::Z * 1e-4)).unwrap();
        assert!(scene.set_triangles(id, placed).is_err(), "{round}: {far} m");
    }
    assert!(rounded[0] == 100 && rounded[1] > 50 && rounded[2] < 10, "{rounded:?}");
}

#[test]
fn objects_with_the_same_triangles_share_one_prepared_mesh() {
    let (mesh, other) = (SharedTriangles::from(solid(UNIT)), SharedTriangles::from(solid(UNIT)));
    let mut scene = Scene::new();
    let at = |i: i32| {
        let turn = DQuat::from_rotation_z(f64::from(i) * 0.1);
        let scale = DVec3::new(1.0, if i % 2 == 0 { 1.0 } else { -2.0 }, 1.0);
        DAffine3::from_scale_rotation_translation(scale, turn, DVec3::X * f64::from(5 * i))
    };
    let mut ids: Vec<_> = (0..40).map(|i| place(&mut scene, &mesh, at(i), false)).collect();
    assert_eq!(
        (scene.prepare_occluders(&Preparation::default()), scene.mesh_count()),
        (40, 1),
        "objects prepared, and meshes, of the same triangles"
    );
    ids.extend((0..3).map(|i| place(&mut scene, &other, at(i), false)));
    assert_eq!(
        (scene.prepare_occluders(&Preparation::default()), scene.mesh_count()),
        (3, 2),
        "objects prepared, and meshes, with another copy of them"
    );
    for (&id, i) in ids[..40].iter().zip(0..) {
        let (prepared, transform) = scene.occluder(id).expect("within the bounds");
        assert_eq!(prepared.bounds(), &UNIT, "{id}: the mesh is that of the unplaced triangles");
        let (expected, axes) = (at(i), transform.matrix3);
        assert_eq!(
            axes.to_cols_array(),
            expected.matrix3.as_mat3().to_cols_array(),
            "{id}: the axes of its transform"
        );
        assert_eq!(
            Vec3::from(transform.translation),
            expected.translation.as_vec3(),
            "{id}: the translation of its transform"
        );
    }
    // One-sided and two-sided objects with the same triangles get two prepared meshes, of which one is
    // one-sided.
    let mut scene = Scene::new();
    for i in 0..10 {
        place(&mut scene, &mesh, at(i), i % 2 == 0);
    }
    scene.prepare_occluders(&Preparation::default().with_two_sided(true));
    assert_eq!(scene.mesh_count(), 2, "a one-sided mesh and a two-sided one");
    for id in scene.ids() {
        let is_two_sided = scene.occluder(id).expect("a mesh").0.is_two_sided();
        assert_eq!(
            is_two_sided,
            !scene.object(id).unwrap().one_sided,
            "{id}: one-sided objects have the mesh with backs"
        );
    }
    let ids: Vec<_> = scene.ids().collect();
    // A two-sided mesh would hide objects that are visible through the undrawn backs of a one-sided object.
    for (&id, one_sided) in ids.iter().zip([true, false].into_iter().cycle()) {
        scene.set_one_sided(id, true).unwrap();
        assert_eq!(
            scene.has_mesh(id),
            one_sided,
            "{id}: a mesh without backs stays, and one with backs goes"
        );
    }
    scene.remove_batch(&ids).unwrap();
    assert_eq!(scene.mesh_count(), 0, "the meshes go with the last object");
}

/// A mesh far from its own origin that a transform brings near. Products rounded to `f32` would be much
/// larger than the coordinates and misplace it by centimetres, even if the transform itself were exact.
#[test]
fn rounding_never_moves_an_occluder() {
    for (far, shares) in [(0.0, true), (2.0, true), (1e5, false), (1e6, false)] {
        let mesh = solid(Aabb::new(Vec3::splat(far), Vec3::splat(far + 1.0)));
        let mut scene = Scene::new();
        let back = DAffine3::from_scale_rotation_translation(
            DVec3::splat(1.5),
            DQuat::from_rotation_z(0.3),
            DQuat::from_rotation_z(0.3) * DVec3::splat(-1.5 * f64::from(far)) + DVec3::new(9.0, 1.0, 2.0),
        );
        let back = DAffine3 {
            matrix3: back.matrix3.as_mat3().as_dmat3(),
            translation: back.translation.as_vec3().as_dvec3(),
        };
        let id = place(&mut scene, &mesh.into(), back, false);
        assert_eq!(scene.prepare_occluders(&Preparation::default()), 1, "occluders prepared, {far} m away");
        let (prepared, transform) = scene.occluder(id).expect("a mesh");
        assert_eq!(transform != Affine3A::IDENTITY, shares, "{far}");
        let drawn = scene.triangles(id).unwrap();
        for corner in prepared.positions() {
            let at = transform.transform_point3(*corner);
            let nearest = drawn.iter().flatten().map(|p| p.distance(at)).fold(f32::INFINITY, f32::min);
            assert!(nearest < 1e-5, "{far}: {nearest} m off");
        }
    }
}

#[test]
fn a_shared_mesh_goes_with_the_triangles() {
    let mesh = SharedTriangles::from(solid(UNIT));
    let moved = DAffine3::from_translation(DVec3::X * 4.0);
    let bounds = mesh.placed(moved).bounds();
    let prepared = || {
        let mut scene = Scene::new();
        let id = place(&mut scene, &mesh, moved, false);
        scene.prepare_occluders(&Preparation::default().with_two_sided(true));
        assert!(scene.has_mesh(id), "the object has a prepared mesh");
        (scene, id)
    };
    let (mut scene, id) = prepared();
    scene.set_triangles(id, []).unwrap();
    assert!(
        !scene.has_mesh(id) && scene.mesh_count() == 0 && scene.transform(id) == Some(Affine3A::IDENTITY),
        "the mesh goes with the triangles, and its transform too"
    );
    let (mut scene, id) = prepared();
    scene.set_bounds(id, UNIT).unwrap();
    assert!(
        !scene.has_mesh(id) && scene.triangles(id).unwrap().is_empty(),
        "the mesh and the triangles go with the bounds"
    );
    // The transform of the triangles is not taken for that of the object.
    let (mut scene, id) = prepared();
    scene.set_local_bounds(id, bounds).unwrap();
    assert_eq!(
        (scene.bounds(id), scene.has_mesh(id)),
        (Ok(bounds), false),
        "local bounds take the mesh away, and keep the bounds"
    );
    scene.prepare_occluders(&Preparation::default().with_two_sided(true));
    assert_eq!(
        scene.occluder(id).map(|(_, transform)| transform),
        Some(Affine3A::IDENTITY),
        "the mesh is prepared anew, of triangles in scene coordinates"
    );
    scene.set_transform(id, Affine3A::from_translation(Vec3::Y)).unwrap();
    assert!(
        !scene.has_mesh(id) && scene.triangles(id).unwrap().is_empty(),
        "a transform takes mesh and triangles away"
    );
}

/// Transforms that are given together are each kept in `f32` or `f64`, as if given alone. Known boxes hold
/// all corners.
#[test]
fn transforms_given_together_place_as_each_does() {
    let mut random = Random(11);
    for (far, is_rounded) in [(0.0, true), (1e6, false)] {
        let mesh = SharedTriangles::from(solid(Aabb::new(Vec3::splat(far), Vec3::splat(far + 1.0))));
        let transforms: Vec<DAffine3> = (0..50)
            .map(|i| {
                let turn = DQuat::from_rotation_z(random.unit() * 6.0);
                let scale = DVec3::new(1.0 + random.unit(), 1.0, if i % 3 == 0 { -1.0 } else { 1.0 });
                let at = random.vec3(-50.0, 50.0).as_dvec3();
                // All meshes far from their own origin are moved back near it, except number 7.
                let back = turn * (scale * -f64::from(far)) * if i == 7 { 0.0 } else { 1.0 };
                DAffine3::from_scale_rotation_translation(scale, turn, at + back)
            })
            .collect();
        let placed = mesh.placed_each(&transforms);
        assert_eq!(placed.len(), 50, "placed copies");
        for (i, (placed, transform)) in placed.iter().zip(&transforms).enumerate() {
            assert!(placed.shares_mesh(&mesh), "{far}, {i}: the copy shares the mesh");
            let bounds = placed.view().known_bounds();
            assert_eq!(bounds.is_some(), is_rounded || i == 7, "{far}, {i}");
            let alone = mesh.placed(*transform);
            for (corner, of_alone) in placed.iter().flatten().zip(alone.iter().flatten()) {
                assert!(bounds.is_none_or(|bounds| bounds.contains_point(corner)), "{far}, {i}: {corner}");
                assert_eq!(corner, of_alone, "{far}, {i}");
            }
            let exact = mesh.iter().flatten().map(|p| transform.transform_point3(p.as_dvec3()).as_vec3());
            let corners: Vec<Vec3> = exact.collect();
            let moved = |p: Vec3| corners.iter().map(|q| p.distance(*q)).fold(f32::INFINITY, f32::min);
            assert!(i == 7 || placed.iter().flatten().all(|p| moved(p) < 2e-5), "{far}, {i}");
        }
    }
}

/// One transform that cannot be rounded does not take the shared mesh from the other objects.
#[test]
fn one_exact_transform_costs_one_prepared_mesh() {
    let mesh = SharedTriangles::from(solid(Aabb::new(Vec3::splat(1e6), Vec3::splat(1e6 + 4.0))));
    let mut transforms: Vec<_> =
        (0..50).map(|i| DAffine3::from_translation(DVec3::X * f64::from(8 * i))).collect();
    transforms[20] = DAffine3::from_rotation_translation(
        DQuat::from_rotation_z(0.3),
        DQuat::from_rotation_z(0.3) * DVec3::splat(-1e6),
    );
    let mut scene = Scene::new();
    for placed in mesh.placed_each(&transforms) {
        let id = scene.insert(Object { occluder: true, ..Object::new(placed.bounds()) });
        scene.set_triangles(id, placed).unwrap();
    }
    assert_eq!(
        (scene.prepare_occluders(&Preparation::default()), scene.mesh_count()),
        (50, 2),
        "objects prepared, and meshes: a shared one and one of its own"
    );
}

/// Returns the determinant of a matrix in double-double arithmetic.
fn exact_determinant(m: &DMat3) -> f64 {
    let m = [m.x_axis, m.y_axis, m.z_axis].map(|axis| axis.to_array().map(DoubleDouble::from));
    let terms = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [1, 0, 2], [2, 1, 0]].map(|[i, j, k]| {
        let term = m[0][i].times(m[1][j]).times(m[2][k]);
        if (j + 3 - i) % 3 == 1 { term } else { term.negated() }
    });
    terms.into_iter().fold(DoubleDouble::ZERO, |sum, term| sum.plus(term)).hi
}

/// Under transforms that nearly flatten, also by less than rounding to `f32` changes, fronts stay fronts
/// where they are certain. A one-sided object whose fronts are not certain hides nothing and is seen from
/// both sides.
#[test]
fn fronts_stay_fronts_or_are_uncertain() {
    let (mut random, mut counts, mut turned) = (Random(8), [0; 2], 0);
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let mesh = SharedTriangles::from([corners]);
    for round in 0..3_000 {
        let [x, y, off] = [(); 3].map(|()| random.vector(1.0));
        let away = [1e-16, 1e-15, 1e-12, 1e-9, 1e-7][round % 5];
        let flat = DMat3::from_cols(x, y, x / 3.0 + y / 7.0 + off * away);
        let placed = mesh.placed(DAffine3::from_mat3(flat));
        let is_certain = placed.view().has_certain_fronts();
        counts[usize::from(is_certain)] += 1;
        let front: [Vec3; 3] = placed.view().get(0).unwrap();
        let keeps = front[1] == x.as_vec3();
        let rounded = flat.as_mat3().as_dmat3();
        turned += usize::from((exact_determinant(&rounded) > 0.0) != (exact_determinant(&flat) > 0.0));
        assert!(!is_certain || keeps == (exact_determinant(&flat) > 0.0), "round {round}: turned {flat}");
        let mut scene = Scene::new();
        let [one_sided, two_sided] =
            [true, false].map(|sides| place(&mut scene, &mesh, DAffine3::from_mat3(flat), sides));
        let (object, _) = level_object(&scene, one_sided).unwrap();
        assert_eq!([object.one_sided, object.occluder], [is_certain; 2], "round {round}: in a level");
        let (object, _) = level_object(&scene, two_sided).unwrap();
        assert_eq!([object.one_sided, object.occluder], [false, true], "round {round}: two-sided");
        let made = scene.prepare_occluders(&Preparation::default().with_two_sided(true));
        assert_eq!(made, 1 + usize::from(is_certain), "round {round}: meshes made");
    }
    assert!(counts.iter().all(|&count| count > 500), "{counts:?} are uncertain and certain");
    assert!(turned > 500, "rounding to `f32` would turn {turned}");
}
