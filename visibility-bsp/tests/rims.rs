//! Tests at the boundaries of shadows, where rounding could decide: a point that lies outside every shadow by
//! a few units of round-off must not be hidden. The oracle decides sides in exact arithmetic on the elements
//! of the view's matrix.

use crate::common::exact::{Cone, Exact, clip};
use std::sync::Arc;
use visibility_bsp::{
    LargeOccludersCuller, Occluders, OcclusionTree, OcclusionTreeCuller, ShadowFrusta, ShadowFrustaCuller,
};
use visibility_core::glam::{Affine3A, DVec3, DVec4};
use visibility_core::{
    Aabb, Culler, Object, OccluderMesh, OcclusionMap, Pose, Scene, View, VisibleSet,
    occlusion::{Occlusion, Preparation},
    scene::Triangle,
    view::Depth,
};
use visibility_testing::{Random, judged, told_enough};

/// Position of the smaller triangle relative to the larger one.
#[derive(Clone, Copy)]
enum Kind {
    /// The triangles share an edge.
    Joined,
    /// An edge of each triangle lies in one plane through the eye; the triangles are on opposite sides of
    /// that plane.
    Beside,
    /// A corner of the smaller triangle lies in the plane through the eye and an edge of the larger one; its
    /// other two corners are on opposite sides of that plane.
    Across,
}

/// All relative positions of the two triangles.
const KINDS: [Kind; 3] = [Kind::Joined, Kind::Beside, Kind::Across];

/// Two occluder triangles whose edges lie in one plane through a point, boxes with a corner in that plane,
/// and a view from nearly that point.
struct Rim {
    /// The larger and the smaller triangle, in world coordinates.
    triangles: Vec<Triangle>,
    /// Boxes to be tested, in world coordinates.
    boxes: Vec<Aabb>,
    /// A perspective view whose eye is a few round-off units away from the common point.
    view: View,
}

impl Rim {
    /// Creates a random case. All coordinates are whole numbers times `scale`, a power of two, so only the
    /// eye is rounded. The smaller triangle is in front of the larger one or behind it. `None` if the random
    /// axes are too close to one plane, or the view is invalid.
    fn new(random: &mut Random, scale: f64, kind: Kind) -> Option<Self> {
        let whole = |random: &mut Random, reach: f64| random.fine_vector(reach).round();
        let eye = whole(random, 2000.0);
        let [u, v, w] = [(); 3].map(|()| whole(random, 500.0));
        if u.cross(v).dot(w).abs() < 1e6 {
            return None;
        }
        let at = |i: f64, j: f64, k: f64| eye + u * i + v * j + w * k;
        let share = |random: &mut Random, least: f64, most: f64| random.fine_range(least, most).round();
        let large = [at(16.0, 0.0, 0.0), at(0.0, 16.0, 0.0), at(2.0, 2.0, 16.0)];
        let along = [share(random, 1.0, 3.0), share(random, 1.0, 3.0)];
        let small = match kind {
            Kind::Joined => {
                let depth = share(random, 6.0, 20.0);
                [large[1], large[0], at(depth, depth, -share(random, 2.0, 8.0))]
            }
            Kind::Beside => {
                let size = share(random, 5.0, 22.0);
                let (i, j) = (share(random, 0.0, 2.0), share(random, 0.0, 2.0));
                [at(i, size - i, 0.0), at(size - j, j, 0.0), at(3.0, 3.0, -share(random, 2.0, 8.0))]
            }
            Kind::Across => {
                let depth = share(random, 1.0, 4.0);
                let mut far = |side: f64| at(share(random, 0.0, 9.0), share(random, 0.0, 9.0), side);
                [at(along[0] * depth, along[1] * depth, 0.0), far(3.0), far(-3.0)]
            }
        };
        let mut boxes = Vec::new();
        for number in 0..24 {
            let (mut i, mut j) = (share(random, 1.0, 24.0), share(random, 1.0, 24.0));
            if number % 2 == 0 {
                // The box has a corner on the view ray through the smaller triangle's corner.
                let depth = share(random, 3.0, 12.0);
                (i, j) = (along[0] * depth, along[1] * depth);
            }
            let p = at(i, j, 0.0);
            // The box is the point `p`, or extends from it to any side.
            let reach = if number % 3 == 0 { DVec3::ZERO } else { whole(random, 9.0) };
            boxes.push(Aabb::from_points([p, p + reach].map(|p| (p * scale).as_vec3())));
        }
        let nudge = random.fine_vector(1.0) * 8000.0 * f64::EPSILON * 2f64.powi(random.below(15) as i32 - 2);
        let pose = Pose::look_at((eye + nudge) * scale, at(6.0, 6.0, 2.0) * scale, DVec3::new(0.1, 0.2, 1.0));
        let view = View::perspective(pose, 2.2, 1.5, scale, f64::INFINITY).ok()?;
        let triangles = [large, small].map(|t| t.map(|p| (p * scale).as_vec3())).to_vec();
        Some(Self { triangles, boxes, view })
    }

    /// Asserts that each corner inside the image of a hidden box (world coordinates) is in the exact shadow
    /// of one of the two triangles. `what` names the culler.
    fn check(&self, bounds: &Aabb, what: &str) {
        let view = &self.view;
        let cones: Vec<Cone> =
            self.triangles.iter().map(|t| Cone::new(view, t.map(|p| p.as_dvec3()))).collect();
        for corner in bounds.corners() {
            let p = corner.as_dvec3();
            let at = view.clip_from(DVec3::ZERO) * p.extend(1.0);
            if at.x.abs().max(at.y.abs()) > at.w * (1.0 - 1e-9) {
                continue;
            }
            let exact = clip(view, p);
            assert!(
                cones.iter().any(|cone| cone.holds(&exact)),
                "{what}: {p} of {bounds:?} sticks out of the shadows of {:?} in {view:?}",
                self.triangles
            );
        }
    }
}

/// Binary exponents of the factors by which test scenes are scaled.
const SCALES: [i32; 5] = [-45, -13, 0, 17, 45];

#[test]
fn what_sticks_out_of_a_shadow_by_rounding_is_not_hidden_by_the_tree() {
    let mut random = Random(31);
    let (mut hidden, mut shown) = (0, 0);
    for number in 0..4_000 {
        let scale = 2f64.powi(SCALES[number % SCALES.len()]);
        let Some(rim) = Rim::new(&mut random, scale, KINDS[number % 3]) else { continue };
        let mut tree = OcclusionTree::new();
        tree.begin(&rim.view, DVec3::ZERO);
        for triangle in &rim.triangles {
            let Ok(mesh) = OccluderMesh::from_triangles(&[*triangle]) else { continue };
            tree.add(&mesh.with_two_sided(true), &Affine3A::IDENTITY);
        }
        tree.flush();
        for bounds in &rim.boxes {
            if tree.test(bounds) == Occlusion::Hidden {
                hidden += 1;
                rim.check(bounds, "tree");
            } else {
                shown += 1;
            }
        }
    }
    judged((hidden + shown) as u64);
    told_enough(hidden > 5_000 && shown > 10_000, format_args!("{hidden} hidden, {shown} not"));
}

/// Creates a scene with triangles as two-sided occluders and boxes as occludees, all in world coordinates.
/// Returns the scene and the ids of the boxes.
fn scene_of(triangles: &[Triangle], boxes: &[Aabb]) -> (Scene, Vec<visibility_core::ObjectId>) {
    let mut scene = Scene::new();
    for triangle in triangles {
        let bounds = Aabb::from_points(*triangle);
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        scene.set_triangles(id, vec![*triangle]).unwrap();
    }
    let ids = boxes.iter().map(|&bounds| scene.insert(bounds)).collect();
    scene.prepare_occluders(&Preparation::default().with_sliver(0.0).with_two_sided(true));
    (scene, ids)
}

/// Creates the cullers that use polygons made in advance.
pub(crate) fn cullers(scene: &Scene) -> Vec<Box<dyn Culler>> {
    let occluders = Arc::new(Occluders::new(scene));
    let frusta = ShadowFrusta::new(scene, Occluders::clone(&occluders), 1, 4);
    vec![
        Box::new(OcclusionTreeCuller::new(occluders.clone())),
        Box::new(LargeOccludersCuller::new(occluders)),
        Box::new(ShadowFrustaCuller::new(frusta.into())),
    ]
}

#[test]
fn nor_by_the_cullers() {
    let mut random = Random(32);
    let mut hidden = [0; 3];
    for number in 0..400 {
        let scale = 2f64.powi(SCALES[number % SCALES.len()]);
        let Some(rim) = Rim::new(&mut random, scale, KINDS[number % 3]) else { continue };
        let (scene, ids) = scene_of(&rim.triangles, &rim.boxes);
        for (culler, hidden) in cullers(&scene).iter_mut().zip(&mut hidden) {
            let mut visible = VisibleSet::new();
            visible.fill(&scene, &rim.view);
            culler.cull(&scene, &rim.view, &mut visible);
            for (&id, bounds) in ids.iter().zip(&rim.boxes) {
                if !visible.contains(&scene, id) {
                    *hidden += 1;
                    rim.check(bounds, culler.name());
                }
            }
        }
    }
    judged(hidden.iter().sum::<usize>() as u64);
    told_enough(hidden.iter().all(|&hidden| hidden > 200), format_args!("{hidden:?}"));
}

/// Returns the greatest common divisor `d` of two numbers and the factors `x`, `y` with `a x + b y = d`. The
/// sign of `d` is that of the last remainder.
fn divisor(a: i128, b: i128) -> (i128, i128, i128) {
    if b == 0 {
        return (a, 1, 0);
    }
    let (d, x, y) = divisor(b, a.rem_euclid(b));
    (d, y, x - a.div_euclid(b) * y)
}

/// Returns a point with whole coordinates that projects near a triangle with whole corners, and is in front
/// of its plane by the least possible amount: the determinant is 1. `None` if there is no such point, or if
/// its coordinates exceed 2^24.
fn in_front_by_nothing(t: [[i128; 3]; 3]) -> Option<[i128; 3]> {
    let [u, v] = [1, 2].map(|k| [0, 1, 2].map(|i| t[k][i] - t[0][i]));
    let n = [0, 1, 2].map(|i| u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]);
    let (d, x, y) = divisor(n[0], n[1]);
    let (one, s, z) = divisor(d, n[2]);
    if one.abs() != 1 {
        return None;
    }
    let mut q = [x * s * one, y * s * one, z * one];
    // The point is far away along the plane. Multiples of the triangle's sides bring it back; these
    // determinants give its coordinates along the sides.
    let dot = |a: [i128; 3], b: [i128; 3]| (0..3).map(|i| a[i] as f64 * b[i] as f64).sum::<f64>();
    for _ in 0..8 {
        let (uu, uv, vv, qu, qv) = (dot(u, u), dot(u, v), dot(v, v), dot(q, u), dot(q, v));
        let [i, j] = [qu * vv - qv * uv, qv * uu - qu * uv].map(|x| (x / (uu * vv - uv * uv)).floor());
        q = [0, 1, 2].map(|k| q[k] - i as i128 * u[k] - j as i128 * v[k]);
    }
    let p = [0, 1, 2].map(|k| t[0][k] + q[k]);
    let front = (0..3).map(|i| n[i] * (p[i] - t[0][i])).sum::<i128>();
    (front == 1 && p.iter().all(|x| x.abs() < 1 << 24)).then_some(p)
}

#[test]
fn what_is_nearer_by_rounding_is_not_hidden() {
    let mut random = Random(33);
    let mut cases = 0;
    for number in 0..1_500 {
        let scale = 2f64.powi(SCALES[number % SCALES.len()] - 20);
        let corners = [(); 3].map(|()| random.fine_vector(8e6).round().to_array().map(|x| x as i128));
        let Some(p) = in_front_by_nothing(corners) else { continue };
        let point = |p: [i128; 3]| DVec3::from_array(p.map(|x| x as f64));
        let triangle = corners.map(|p| (point(p) * scale).as_vec3());
        let [a, b, c] = corners.map(point);
        let normal = (b - a).cross(c - a).normalize();
        let middle = (a + b + c) / 3.0;
        let eye = middle + (normal * random.fine_range(1e6, 1e7) + random.fine_vector(2e6));
        let pose = Pose::look_at(eye * scale, middle * scale, DVec3::new(0.1, 0.2, 1.0));
        let Ok(view) = View::perspective(pose, 2.6, 1.5, scale, f64::INFINITY) else { continue };
        let at = view.clip_from(DVec3::ZERO) * (point(p) * scale).extend(1.0);
        if at.x.abs().max(at.y.abs()) > at.w * (1.0 - 1e-9) {
            continue;
        }
        let boxes = [Aabb::from_points([(point(p) * scale).as_vec3()])];
        let (scene, ids) = scene_of(&[triangle], &boxes);
        cases += 1;
        for culler in &mut cullers(&scene) {
            let mut visible = VisibleSet::new();
            visible.fill(&scene, &view);
            culler.cull(&scene, &view, &mut visible);
            assert!(
                visible.contains(&scene, ids[0]),
                "{}: {boxes:?} is before {triangle:?} in {view:?}",
                culler.name()
            );
        }
    }
    judged(cases as u64);
    told_enough(cases > 400, format_args!("points before a triangle by rounding: {cases}"));
}

/// Boxes with one corner exactly in a side of the image up to rounding. The rest of each box is outside that
/// side.
#[test]
fn what_reaches_into_the_image_by_rounding_is_not_hidden() {
    let mut random = Random(37);
    let (mut inside, mut hidden) = (0, 0);
    for _ in 0..20_000 {
        let corner = random.fine_vector(20.0).as_vec3();
        let p = corner.as_dvec3();
        let pose = Pose::look_at(random.fine_vector(20.0), p + random.fine_vector(1.0), DVec3::Z);
        let Ok(view) = View::perspective(pose, 1.0, 1.0, 0.01, f64::INFINITY) else { continue };
        // The image is moved along an axis until one of its sides passes through the corner.
        let (axis, sign) = (random.below(2), if random.below(2) == 0 { 1.0 } else { -1.0 });
        let mut matrix = view.clip_from(DVec3::ZERO);
        let at = matrix * p.extend(1.0);
        let shift = at[axis] / at.w - sign;
        for column in 0..4 {
            matrix.col_mut(column)[axis] -= shift * matrix.col(column).w;
        }
        let Ok(view) = View::from_clip_from_world(matrix, view.depth()) else { continue };
        let inwards = (matrix.row(3) - matrix.row(axis) * sign).truncate();
        let size = random.fine_vector(8.0).abs();
        let outer = p - size * DVec3::select(inwards.cmpgt(DVec3::ZERO), DVec3::ONE, DVec3::NEG_ONE);
        let bounds = Aabb::from_points([corner, outer.as_vec3()]);
        let mut tree = OcclusionTree::new();
        tree.begin(&view, DVec3::ZERO);
        let answer = tree.test(&bounds);
        let exact = clip(&view, p);
        let [x, w] = [&exact[axis], &exact[2]];
        let height = if sign > 0.0 { w.minus(x) } else { w.minus(&Exact::default().minus(x)) };
        if height.sign() > 0 && exact[2].sign() > 0 {
            inside += 1;
            assert!(answer != Occlusion::Hidden, "{corner} of {bounds:?} is inside {view:?}");
        }
        hidden += usize::from(answer == Occlusion::Hidden);
    }
    assert!(inside > 5_000, "{inside}, {hidden} hidden");
}

/// A matrix with reversed depth that is said to have ordinary depth: all the world is beyond its near plane.
#[test]
fn a_box_around_the_eye_is_not_hidden_by_a_near_plane_at_infinity() {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    let mut rows = view.clip_from(DVec3::ZERO).transpose();
    rows.z_axis = DVec4::new(0.0, 0.0, 0.0, 0.1);
    let Ok(view) = View::from_clip_from_world(rows.transpose(), Depth::ZeroToOneInfinite) else {
        panic!("the matrix has an inverse")
    };
    let mut tree = OcclusionTree::new();
    tree.begin(&view, DVec3::ZERO);
    let around = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
    assert_eq!(tree.test(&around), Occlusion::Partial, "a box around the eye");
    let ahead = Aabb::from_arrays([3.0, -0.1, -0.1], [4.0, 0.1, 0.1]);
    assert_eq!(tree.test(&ahead), Occlusion::Visible, "a box ahead");
}
