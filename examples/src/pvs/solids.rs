//! Axis-aligned boxes among a scene's opaque triangles: walls, slabs and much furniture.

use crate::SceneSource;
use glam::DVec3;
use std::collections::BTreeSet;

/// Number of triangles of a box's surface.
const FACES: usize = 12;

/// Returns the boxes among the triangles of a scene's walls, as minimum and maximum corner in world space. A
/// box is only found if twelve consecutive triangles of one object are its whole surface. The triangles of a
/// one-sided object must face outwards.
pub fn boxes(source: &SceneSource) -> Vec<[DVec3; 2]> {
    let mut found = Vec::new();
    for object in source.objects.iter().filter(|object| object.is_wall()) {
        let triangles = object.triangles.view().to_vec();
        let mut rest = triangles.as_slice();
        while let Some(run) = rest.get(..FACES) {
            let solid = as_box(run).filter(|ends| !object.one_sided || faces_outwards(run, ends));
            rest = &rest[if solid.is_some() { FACES } else { 1 }..];
            found.extend(solid.map(|ends| ends.map(|end| end + source.origin)));
        }
    }
    found
}

/// Returns the box whose surface the given triangles make up, as minimum and maximum corner. `None` for any
/// other triangles. Exactly twelve triangles must be given.
fn as_box(triangles: &[[glam::Vec3; 3]]) -> Option<[DVec3; 2]> {
    let points = || triangles.iter().flatten().map(|p| p.as_dvec3());
    let min = points().fold(DVec3::INFINITY, DVec3::min);
    let max = points().fold(DVec3::NEG_INFINITY, DVec3::max);
    let size = max - min;
    if !size.is_finite() || size.min_element() <= 0.0 {
        return None;
    }
    // Each triangle must lie in a face of the box and have three distinct corners of that face. A set of
    // (face, side, missing corner) detects duplicate triangles.
    let mut halves = BTreeSet::new();
    for triangle in triangles {
        let corners = triangle.map(|p| {
            let p = p.as_dvec3();
            let at = |i: usize| if p[i] == min[i] { Some(0) } else { (p[i] == max[i]).then_some(1 << i) };
            Some(at(0)? | at(1)? | at(2)?)
        });
        let [Some(a), Some(b), Some(c)] = corners else { return None };
        let (shared, any): (u8, u8) = (a & b & c, a | b | c);
        // The face is on the axis in which all three corners agree, while they differ in the other two axes.
        let face = (0..3usize).find(|i| (any ^ shared) == 7 ^ (1 << i))?;
        if a == b || b == c || c == a {
            return None;
        }
        let missing = a ^ b ^ c;
        halves.insert((face, shared & 1 << face, missing));
    }
    // In the sorted set the two halves of a face are neighbours. The missing corners of two halves are
    // diagonally opposite.
    let halves: Vec<(usize, u8, u8)> = halves.into_iter().collect();
    let whole = |pair: &[(usize, u8, u8)]| {
        let [(face, side, a), (other, across, b)] = [pair[0], pair[1]];
        (face, side) == (other, across) && a ^ b == 7 ^ (1 << face)
    };
    (halves.len() == FACES && halves.chunks_exact(2).all(whole)).then_some([min, max])
}

/// Returns whether all triangles of a box turn their fronts away from its middle.
fn faces_outwards(triangles: &[[glam::Vec3; 3]], [min, max]: &[DVec3; 2]) -> bool {
    let middle = (*min + *max) * 0.5;
    triangles.iter().all(|triangle| {
        let [a, b, c] = triangle.map(|p| p.as_dvec3());
        (b - a).cross(c - a).dot(a - middle) > 0.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::built_in;

    #[test]
    fn walls_of_an_office_are_boxes_and_lamps_are_not() {
        let source = built_in("office:1,1").unwrap();
        let boxes = boxes(&source);
        let has = |min: [f64; 3], max: [f64; 3]| {
            boxes.iter().any(|[a, b]| a.distance(min.into()) < 1e-6 && b.distance(max.into()) < 1e-6)
        };
        // Parts of the building: a slab, and the lintel of the doorway to the stair.
        assert!(has([0.0, -5.0, -0.3], [4.0, 8.0, 0.0]), "the slab is a box");
        assert!(has([-0.1, 1.0, 2.1], [0.1, 2.0, 3.2]), "the lintel of the doorway is a box");
        assert!(boxes.len() * FACES < source.triangle_count(), "boxes instead of triangles: {}", boxes.len());
        // A face with the same half twice is incomplete, so the triangles are no box.
        let mut slab = source.objects[0].triangles.view().to_vec();
        assert!(as_box(&slab).is_some(), "twelve triangles of a slab are a box");
        slab[1] = slab[0];
        assert!(as_box(&slab).is_none(), "a slab with a half twice is none");
        // A one-sided object that turns its backs outwards makes no box.
        let mut source = SceneSource { objects: vec![source.objects[0].clone()], ..source };
        source.objects[0].one_sided = true;
        assert_eq!(super::boxes(&source).len(), 1, "a one-sided box that faces outwards");
        source.objects[0].edit_triangles(|triangles| triangles.iter_mut().for_each(|t| t.swap(0, 1)));
        assert!(super::boxes(&source).is_empty(), "a one-sided box that faces inwards");
    }
}
