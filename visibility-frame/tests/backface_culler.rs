//! Tests of the backface culler in scenes that change: an object that changed after its cone was built counts
//! as visible, and no object with a visible front is hidden.

use visibility_core::glam::{DAffine3, DMat3, DVec3, Vec3};
use visibility_core::{
    Aabb, Accuracy, Culler, Object, ObjectId, Pose, Scene, View, VisibleSet, geometry::DoubleDouble,
    scene::SharedTriangles, scene::Triangle, simd::Simd, view::Eye,
};
use visibility_frame::backface::{BackfaceCuller, Facing, NormalCone, facing};
use visibility_testing::{Random, judged, told_enough};

fn triangle(rng: &mut Random) -> Triangle {
    let at = rng.vector(50.0);
    core::array::from_fn(|_| (at + rng.vector(1.0)).as_vec3())
}

fn one_sided(triangle: Triangle) -> Object {
    Object { one_sided: true, ..Object::new(Aabb::from_points(triangle)) }
}

fn insert(scene: &mut Scene, triangle: Triangle) -> ObjectId {
    let id = scene.insert(one_sided(triangle));
    scene.set_triangles(id, [triangle]).unwrap();
    id
}

fn cull(culler: &mut BackfaceCuller, scene: &Scene, view: &View) -> VisibleSet {
    let mut visible = VisibleSet::new();
    visible.fill(scene, view);
    let stats = culler.cull(scene, view, &mut visible);
    assert_eq!(stats.visible, visible.count(scene) as u64, "objects counted and in the set");
    visible
}

fn view_from(eye: DVec3) -> View {
    let pose = Pose::look_at(eye, DVec3::ZERO, DVec3::Z);
    View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY).unwrap()
}

/// Tests a scene with triangles under random changes: the culler may hide an object only if no triangle of
/// the object, tested by itself, faces the eye.
#[test]
fn a_scene_under_random_changes_hides_backs_only() {
    let mut rng = Random(1);
    let (mut scene, mut culler) = (Scene::new(), BackfaceCuller::new());
    assert_eq!(culler.accuracy(), Accuracy::Conservative, "backface culling is conservative");
    let mut other = BackfaceCuller::new().with_simd(Simd::PORTABLE);
    let mut objects: Vec<(ObjectId, Triangle)> = Vec::new();
    let (mut hidden, mut kept) = (0, 0);
    for frame in 0..200 {
        for _ in 0..rng.below(if frame % 10 == 0 { 400 } else { 12 }) {
            let t = triangle(&mut rng);
            objects.push((insert(&mut scene, t), t));
        }
        for _ in 0..rng.below(12) {
            if objects.len() < 2 {
                break;
            }
            let which = rng.below(objects.len());
            match rng.below(3) {
                0 => scene.remove(objects.swap_remove(which).0).unwrap(),
                1 => {
                    // Replaces the triangle by another at a new place.
                    let (id, old) = &mut objects[which];
                    *old = triangle(&mut rng);
                    scene.set_bounds(*id, Aabb::from_points(*old)).unwrap();
                    scene.set_triangles(*id, [*old]).unwrap();
                }
                _ => {
                    // Reverses the winding of the triangle, at the same place.
                    let (id, old) = &mut objects[which];
                    old.swap(1, 2);
                    scene.set_triangles(*id, [*old]).unwrap();
                }
            }
        }
        match rng.below(8) {
            0 => scene.rebuild(),
            1 => scene.set_origin(rng.vector(10.0)).unwrap(),
            2..5 => drop(scene.maintain(4)),
            _ => {}
        }
        let late = rng.one_in(3);
        if !late {
            culler.sync(&scene);
        }
        other.sync(&scene);
        let eye = rng.vector(80.0);
        let view = view_from(eye);
        let visible = cull(&mut culler, &scene, &view);
        let all = cull(&mut other, &scene, &view);
        for &(id, t) in &objects {
            let side = facing(&t, &Eye::Point(eye - scene.origin()));
            if !visible.contains(&scene, id) {
                hidden += 1;
                assert_eq!(side, Facing::Back, "frame {frame}: {t:?} is hidden");
                assert!(!all.contains(&scene, id), "another culler knows as much");
            } else if side == Facing::Back {
                kept += 1;
                let reason = late || culler.cone(&scene, id).is_some();
                assert!(reason, "it has a cone");
            }
        }
        if !late {
            assert_eq!(visible.count(&scene), all.count(&scene), "all paths and histories agree");
        }
    }
    judged((hidden + kept) as u64);
    told_enough(
        hidden > 10 * kept / 4 && hidden > 10_000,
        format_args!("hidden {hidden}, backs kept {kept}"),
    );
}

#[test]
fn a_moved_object_is_visible_until_it_is_set_again() {
    let floor: Triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let cone = NormalCone::from_triangles(&[floor]);
    let below = view_from(DVec3::new(0.3, 0.2, -5.0));
    let (mut scene, mut culler) = (Scene::new(), BackfaceCuller::new());
    let one = scene.insert(one_sided(floor));
    let two = scene.insert(one_sided(floor));
    culler.set(&scene, one, cone).unwrap();
    let three = scene.insert(one_sided(floor));
    culler.set(&scene, two, cone).unwrap();
    let seen = |culler: &mut BackfaceCuller, scene: &Scene| {
        let visible = cull(culler, scene, &below);
        [one, two, three].map(|id| visible.contains(scene, id))
    };
    assert_eq!(seen(&mut culler, &scene), [false, false, true], "the third has no cone");
    scene.set_bounds(one, Aabb::from_points(floor)).unwrap();
    assert_eq!(culler.cone(&scene, one), None, "a moved object has no cone");
    assert_eq!(seen(&mut culler, &scene), [true, false, true], "the first object has moved, and is visible");
    culler.sync(&scene);
    assert_eq!(seen(&mut culler, &scene), [true, false, true], "nothing to build a cone from");
    culler.set(&scene, one, cone).unwrap();
    assert_eq!(culler.cone(&scene, one), Some(cone), "the cone that was set again");
    assert_eq!(seen(&mut culler, &scene), [false, false, true], "the first object is culled again");
    // A new object that reuses the index of the removed one.
    scene.remove(two).unwrap();
    let four = scene.insert(one_sided(floor));
    assert_eq!(four.index(), two.index(), "the new object takes the index of the old");
    assert!(cull(&mut culler, &scene, &below).contains(&scene, four), "the new object has no cone");
    assert!(culler.set(&scene, two, cone).is_err(), "the object was removed");
    // Triangles outside of the object's bounds are outdated, so the object counts as visible.
    scene.set_triangles(four, [floor]).unwrap();
    culler.sync(&scene);
    assert!(
        !cull(&mut culler, &scene, &below).contains(&scene, four),
        "the triangles of the new object face away"
    );
    scene.set_bounds(four, Aabb::from_arrays([0.5; 3], [2.0; 3])).unwrap();
    culler.sync(&scene);
    assert!(
        cull(&mut culler, &scene, &below).contains(&scene, four),
        "triangles outside of the bounds do not count"
    );
}

#[test]
fn an_open_cone_that_was_set_stays_until_the_object_changes() {
    let floor: Triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let (mut scene, mut culler) = (Scene::new(), BackfaceCuller::new());
    let id = insert(&mut scene, floor);
    let below = view_from(DVec3::new(0.3, 0.2, -5.0));
    // The caller's open cone must count although the triangles have a cone: a shader may move the triangles,
    // for instance.
    culler.set(&scene, id, NormalCone::OPEN).unwrap();
    culler.sync(&scene);
    assert!(cull(&mut culler, &scene, &below).contains(&scene, id), "the caller's cone is open");
    scene.set_triangles(id, [floor]).unwrap();
    culler.sync(&scene);
    assert!(!cull(&mut culler, &scene, &below).contains(&scene, id), "the changed triangles face away");
}

#[test]
fn objects_drawn_from_both_sides_and_never_culled_ones_are_kept() {
    let floor: Triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let (mut scene, mut culler) = (Scene::new(), BackfaceCuller::new());
    // Objects are drawn from both sides by default.
    let leaf = scene.insert(Aabb::from_points(floor));
    scene.set_triangles(leaf, [floor]).unwrap();
    let wall = insert(&mut scene, floor);
    let sign = scene.insert(Object { never_cull: true, ..one_sided(floor) });
    scene.set_triangles(sign, [floor]).unwrap();
    culler.sync(&scene);
    let below = view_from(DVec3::new(0.3, 0.2, -5.0));
    let seen = |culler: &mut BackfaceCuller, scene: &Scene| {
        let visible = cull(culler, scene, &below);
        [leaf, wall, sign].map(|id| visible.contains(scene, id))
    };
    let (kept, backs) = ([true, false, true], [false, false, true]);
    assert_eq!(seen(&mut culler, &scene), kept, "a leaf with both sides, a wall, and a sign never culled");
    let cone = NormalCone::from_triangles(&[floor]);
    culler.set(&scene, leaf, cone).unwrap();
    assert_eq!(seen(&mut culler, &scene), kept, "a cone given for what has both sides is ignored");
    scene.set_one_sided(leaf, true).unwrap();
    assert_eq!(seen(&mut culler, &scene), kept, "the leaf has changed since the last sync");
    culler.sync(&scene);
    assert_eq!(seen(&mut culler, &scene), backs, "the leaf has a front alone");
    scene.set_one_sided(leaf, false).unwrap();
    assert_eq!(seen(&mut culler, &scene), kept, "the leaf has both sides, before the sync");
    culler.sync(&scene);
    assert_eq!(seen(&mut culler, &scene), kept, "the leaf has both sides, after the sync");
}

/// Returns a scene and its clone, whose objects have equal ids but opposite winding, the object's id, and a
/// view of either side.
fn opposite_scenes() -> ([Scene; 2], ObjectId, [View; 2]) {
    let mut a = Scene::new();
    let id = insert(&mut a, [Vec3::ZERO, Vec3::X, Vec3::Y]);
    let mut b = a.clone();
    b.set_triangles(id, [[Vec3::ZERO, Vec3::Y, Vec3::X]]).unwrap();
    ([a, b], id, [5.0, -5.0].map(|z| view_from(DVec3::new(0.3, 0.2, z))))
}

#[test]
fn cones_of_one_scene_hide_nothing_in_another() {
    // Tests both orders: the scene made later has the greater revisions.
    for order in [[0, 1], [1, 0]] {
        let (scenes, id, views) = opposite_scenes();
        let [a, b] = order.map(|i| &scenes[i]);
        let [front_of_a, front_of_b] = order.map(|i| &views[i]);
        let mut culler = BackfaceCuller::new();
        culler.sync(b);
        assert!(!cull(&mut culler, b, front_of_a).contains(b, id), "its back is seen");
        assert!(cull(&mut culler, a, front_of_a).contains(a, id), "its front is seen");
        assert_eq!(culler.cone(a, id), None, "the cone of {id} is of the other scene");
        culler.sync(a);
        assert!(cull(&mut culler, a, front_of_a).contains(a, id), "the front of {id} in the synced scene");
        assert!(!cull(&mut culler, a, front_of_b).contains(a, id), "the back of {id} in the synced scene");
        assert!(cull(&mut culler, b, front_of_b).contains(b, id), "the culler is synced to the other scene");
    }
}

/// Tests that the culler rebuilds its blocks of cones when it returns to a scene. That scene's layout has not
/// changed while the culler was used with another scene.
#[test]
fn blocks_of_a_scene_are_made_anew_after_another() {
    let ([mut a, _], id, [front, back]) = opposite_scenes();
    let b = Scene::new();
    let mut culler = BackfaceCuller::new();
    culler.sync(&a);
    assert!(!cull(&mut culler, &a, &back).contains(&a, id), "the back before the winding is reversed");
    // The winding is reversed while the culler is used with the other scene.
    culler.sync(&b);
    a.set_triangles(id, [[Vec3::ZERO, Vec3::Y, Vec3::X]]).unwrap();
    assert!(
        cull(&mut culler, &a, &back).contains(&a, id),
        "the front after the winding is reversed, before the sync"
    );
    culler.sync(&a);
    assert!(cull(&mut culler, &a, &back).contains(&a, id), "the front after the winding is reversed");
    assert!(!cull(&mut culler, &a, &front).contains(&a, id), "the back after the winding is reversed");
}

/// A triangle placed by a transform that nearly flattens is never hidden from the side of its front, which
/// the exact sign of the determinant tells.
#[test]
fn fronts_under_flat_transforms_are_visible() {
    let (mut random, mut hidden, mut wrong) = (Random(9), 0, 0);
    let mesh = SharedTriangles::from([[Vec3::ZERO, Vec3::X, Vec3::Y]]);
    for round in 0..2_000 {
        let [x, y, off] = [(); 3].map(|()| random.vector(1.0));
        let away = [1e-16, 1e-9, 1.0][round % 3];
        let m = DMat3::from_cols(x, y, x / 3.0 + y / 7.0 + off * away);
        let columns = [m.x_axis, m.y_axis, m.z_axis].map(|axis| axis.to_array().map(DoubleDouble::from));
        let terms = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [1, 0, 2], [2, 1, 0]].map(|[i, j, k]| {
            let term = columns[0][i].times(columns[1][j]).times(columns[2][k]);
            if (j + 3 - i) % 3 == 1 { term } else { term.negated() }
        });
        let exact = terms.into_iter().fold(DoubleDouble::ZERO, |sum, term| sum.plus(term)).hi;
        wrong += usize::from(exact != 0.0 && (m.determinant() > 0.0) != (exact > 0.0));
        let triangles = mesh.placed(DAffine3::from_mat3(m));
        let mut scene = Scene::new();
        let id = scene.insert(Object { one_sided: true, ..Object::new(triangles.bounds()) });
        scene.set_triangles(id, triangles).unwrap();
        let mut culler = BackfaceCuller::new();
        culler.sync(&scene);
        // The normal of the triangle that is not turned points along x times y.
        let (normal, middle) = (x.cross(y).normalize_or_zero(), (x + y) / 3.0);
        for side in [1.0, -1.0] {
            let pose = Pose::look_at(middle + 5.0 * side * normal, middle, off.normalize_or(DVec3::Z));
            let view = View::perspective(pose, 1.5, 1.5, 0.1, f64::INFINITY).unwrap();
            let is_front = (exact > 0.0) == (side > 0.0);
            let is_visible = cull(&mut culler, &scene, &view).contains(&scene, id);
            assert!(is_visible || !is_front, "round {round}: front of {m} from side {side}");
            hidden += usize::from(!is_visible);
        }
    }
    assert!(hidden > 500 && wrong > 50, "{hidden} backs are hidden, {wrong} determinants have a wrong sign");
}
