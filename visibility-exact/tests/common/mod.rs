//! Worlds for tests, and an oracle of distances that shares no code with the exact culler.
#![allow(dead_code, unreachable_pub, reason = "each test uses a part")]

pub mod grid;

use std::sync::Arc;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, Object, Scene};
use visibility_exact::{ExactSettings, SceneTriangles, Verdict, Witness};
use visibility_testing::{distance, sign_of_sum};

pub type Triangle = [Vec3; 3];

/// Makes a scene of objects given by their triangles. All objects occlude.
pub fn scene(objects: &[Vec<Triangle>]) -> Scene {
    let mut scene = Scene::new();
    for triangles in objects {
        let bounds = Aabb::from_points(triangles.iter().flatten().copied());
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        scene.set_triangles(id, triangles.clone()).unwrap();
    }
    scene
}

pub fn prepared(objects: &[Vec<Triangle>]) -> Arc<SceneTriangles> {
    Arc::new(SceneTriangles::new(&scene(objects)))
}

/// Changes settings to few rays, so that proofs have to decide, and to keep proofs.
pub fn few_rays(settings: ExactSettings) -> ExactSettings {
    settings.with_rays(200).with_aimed_rays(10).with_kept_proofs()
}

pub fn quad(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> Vec<Triangle> {
    let [a, b, c, d] = [a, b, c, d].map(|v| v.as_vec3());
    vec![[a, b, c], [a, c, d]]
}

/// Returns the six faces of a box, as two triangles each.
pub fn faces(min: DVec3, max: DVec3) -> Vec<Vec<Triangle>> {
    let corner = |i: usize| {
        let at = |axis: usize| if i >> axis & 1 == 1 { max[axis] } else { min[axis] };
        DVec3::new(at(0), at(1), at(2))
    };
    [[0, 2, 6, 4], [1, 3, 7, 5], [0, 1, 5, 4], [2, 3, 7, 6], [0, 1, 3, 2], [4, 5, 7, 6]]
        .map(|[a, b, c, d]| quad(corner(a), corner(b), corner(c), corner(d)))
        .to_vec()
}

pub fn cuboid(min: DVec3, max: DVec3) -> Vec<Triangle> {
    faces(min, max).concat()
}

/// Returns the sign of det(q - p, a - p, b - p), exactly.
fn orientation(p: DVec3, q: DVec3, a: DVec3, b: DVec3) -> i32 {
    let triples = [(q, a, b, 1.0), (p, a, b, -1.0), (q, p, b, -1.0), (q, a, p, -1.0)];
    let orders =
        [(0, 1, 2, 1.0), (1, 2, 0, 1.0), (2, 0, 1, 1.0), (0, 2, 1, -1.0), (2, 1, 0, -1.0), (1, 0, 2, -1.0)];
    sign_of_sum(triples.into_iter().flat_map(|(x, y, z, sign)| {
        orders.into_iter().flat_map(move |(i, j, k, order)| {
            let high = x[i] * y[j];
            let low = x[i].mul_add(y[j], -high);
            [high, low].map(|part| (part, z[k] * sign * order))
        })
    }))
}

/// Returns whether a closed segment and a closed triangle do not touch, exactly. For a segment in the
/// triangle's plane the answer is false unless their bounding boxes are apart.
fn misses_exactly(p: DVec3, q: DVec3, t: &Triangle) -> bool {
    let t = t.map(Vec3::as_dvec3);
    let (min, max) = (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));
    if p.max(q).cmplt(min).any() || p.min(q).cmpgt(max).any() {
        return true;
    }
    let heights = [p, q].map(|x| orientation(x, t[0], t[1], t[2]));
    if heights[0] * heights[1] > 0 {
        return true;
    }
    let sides = [(0, 1), (1, 2), (2, 0)].map(|(i, j)| orientation(p, q, t[i], t[j]));
    heights != [0, 0] && sides.contains(&1) && sides.contains(&-1)
}

/// Returns the least distance of a segment from all triangles that do not belong to object `target`.
pub fn clearance(objects: &[Vec<Triangle>], target: usize, p: DVec3, q: DVec3) -> f64 {
    let others = objects.iter().enumerate().filter(|(o, _)| *o != target);
    others.flat_map(|(_, t)| t).map(|t| distance(p, q, t)).fold(f64::INFINITY, f64::min)
}

/// Panics unless each seen object's line of sight misses the triangles of all other objects, and each kept
/// proof holds. Returns the number of proofs.
pub fn check(
    objects: &[Vec<Triangle>],
    triangles: &SceneTriangles,
    found: &visibility_exact::CellVerdicts,
) -> usize {
    assert_eq!(found.refused, 0, "proofs that their check refused");
    let mut proofs = 0;
    for proof in found.proofs.iter().flat_map(|hidden| &hidden.proofs) {
        proof.check(triangles).unwrap();
        proofs += 1;
    }
    for (id, verdict) in found.iter(triangles) {
        if let Verdict::Seen(witness) = verdict {
            assert!(is_clear(objects, id.index(), &witness), "object {id}: {witness:?}");
        }
    }
    proofs
}

/// Returns whether a line of sight misses the triangles of all objects but `target`, or has no length.
pub fn is_clear(objects: &[Vec<Triangle>], target: usize, witness: &Witness) -> bool {
    // Two segments are tested, since either may touch by rounding. The whole segment ends on the triangle up
    // to rounding, and other triangles may lie in its plane. The shortened segment misses these, but is
    // rounded off the line, perhaps onto edges that the whole segment passes closely.
    let short = witness.from + (witness.to - witness.from) * (1.0 - 1e-12);
    let others = objects.iter().enumerate().filter(|(o, _)| *o != target);
    let clear = others.flat_map(|(_, t)| t).all(|t| {
        [witness.to, short]
            .into_iter()
            .any(|to| distance(witness.from, to, t) > 1e-9 || misses_exactly(witness.from, to, t))
    });
    clear || witness.from == witness.to
}
