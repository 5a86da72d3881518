//! Clipping of convex polygons against planes (Sutherland and Hodgman, "Reentrant Polygon Clipping", 1974).
//! The vertices of each polygon are a range of one growing list.

use alloc::vec::Vec;
use core::ops::Range;
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;

/// Maximum vertex count of a polygon to be clipped. A polygon with more vertices is returned whole, which is
/// conservative.
const MAX_CLIPPED_VERTICES: usize = 120;

/// Result of clipping a polygon, whose vertices are a range of the list `points`: nothing, the whole polygon,
/// or a part.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Clip {
    Nothing,
    All,
    /// A part of the polygon is left. Its vertices were appended to `points`: they run from this index of
    /// `points` to the end.
    Part(usize),
}

/// Clips the polygon with the vertices `points[polygon]` to the inner side of `plane`, the side that the
/// plane's normal points to; points on the plane are kept. `polygon` must not be empty.
///
/// A result that is smaller than the input is appended to `points`. Of its vertices, neighbours no farther
/// apart than `merge` (in the unit of the coordinates) become one. A result of fewer than three vertices is
/// discarded, and `Clip::Nothing` is returned. A polygon with a vertex whose distance from the plane is NaN
/// or infinite, or with more than `MAX_CLIPPED_VERTICES` vertices, is kept whole, and `Clip::All` is
/// returned.
pub(crate) fn clip(points: &mut Vec<DVec3>, polygon: Range<usize>, plane: &Plane, merge: f64) -> Clip {
    let count = polygon.len();
    if count > MAX_CLIPPED_VERTICES {
        return Clip::All;
    }
    let mut distances = [0.0; MAX_CLIPPED_VERTICES];
    let (mut least, mut most, mut is_known) = (f64::INFINITY, f64::NEG_INFINITY, true);
    for (distance, &p) in distances.iter_mut().zip(&points[polygon.clone()]) {
        *distance = plane.normal.x * p.x + plane.normal.y * p.y + plane.normal.z * p.z + plane.offset;
        least = if *distance < least { *distance } else { least };
        most = if *distance > most { *distance } else { most };
        is_known &= distance.is_finite();
    }
    if least >= 0.0 || !is_known {
        return Clip::All;
    }
    if most < 0.0 {
        return Clip::Nothing;
    }
    let start = points.len();
    // Walks around the polygon, starting at its last vertex. Where an edge crosses the plane, the crossing
    // point is added.
    let (mut a, mut before) = (points[polygon.end - 1], distances[count - 1]);
    let near = merge * merge;
    for (i, &here) in distances[..count].iter().enumerate() {
        let b = points[polygon.start + i];
        if (before < 0.0) != (here < 0.0) {
            let cut = a + (b - a) * (before / (before - here));
            push_apart(points, start, cut, near);
        }
        if here >= 0.0 {
            push_apart(points, start, b, near);
        }
        (a, before) = (b, here);
    }
    // The last vertex of the result may be too close to the first.
    while points.len() > start + 1 && (points[points.len() - 1] - points[start]).length_squared() <= near {
        points.pop();
    }
    if points.len() < start + 3 {
        points.truncate(start);
        return Clip::Nothing;
    }
    Clip::Part(start)
}

/// Appends vertex `p` to the polygon whose vertices are `points[start..]`, unless its squared distance to the
/// last vertex appended is at most `near` (square world units).
fn push_apart(points: &mut Vec<DVec3>, start: usize, p: DVec3, near: f64) {
    if points.len() == start || (points[points.len() - 1] - p).length_squared() > near {
        points.push(p);
    }
}

/// Clips the polygon with the vertices `points[polygon]` like [`clip`]. Returns the range of `points` that
/// holds the vertices of the result: `polygon` itself if nothing was cut off. `None` if nothing is left.
pub(crate) fn clip_range(
    points: &mut Vec<DVec3>,
    polygon: Range<usize>,
    plane: &Plane,
    merge: f64,
) -> Option<Range<usize>> {
    match clip(points, polygon.clone(), plane, merge) {
        Clip::All => Some(polygon),
        Clip::Part(start) => Some(start..points.len()),
        Clip::Nothing => None,
    }
}

/// Clips `polygon` to the side of `plane` that its normal points to, merging vertices no farther apart than
/// `merge` like [`clip`], and replaces the content of `out` with the result. `out` is empty afterwards if the
/// polygon is empty or lies outside the plane.
pub(crate) fn clip_into(polygon: &[DVec3], plane: &Plane, merge: f64, out: &mut Vec<DVec3>) {
    out.clear();
    if polygon.is_empty() {
        return;
    }
    out.extend_from_slice(polygon);
    match clip(out, 0..polygon.len(), plane, merge) {
        Clip::Nothing => out.clear(),
        Clip::All => {}
        Clip::Part(start) => {
            out.drain(..start);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(corners: &[[f64; 2]]) -> Vec<DVec3> {
        corners.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect()
    }

    /// Clips to the points with x of at least 0, merging vertices up to 0.5 apart. Returns the result for a
    /// list that holds another point before the polygon.
    fn right_of_zero(corners: &[[f64; 2]]) -> (Clip, Vec<DVec3>) {
        let mut points = at(&[[7.0, 7.0]]);
        points.extend(at(corners));
        let count = points.len();
        let result = clip(&mut points, 1..count, &Plane::new(DVec3::X, 0.0), 0.5);
        (result, points.split_off(count))
    }

    #[test]
    fn vertices_on_the_plane_are_kept() {
        // Whole: inside, and touching the plane from inside by a vertex or an edge.
        for inside in [[[1.0, 0.0], [4.0, 0.0], [4.0, 4.0]], [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0]]] {
            assert_eq!(right_of_zero(&inside), (Clip::All, at(&[])), "{inside:?}");
        }
        // Nothing: outside, and touching the plane from outside by a vertex or an edge.
        for outside in [
            [[-1.0, 0.0], [-4.0, 4.0], [-4.0, 0.0]],
            [[0.0, 0.0], [-4.0, 4.0], [-4.0, 0.0]],
            [[0.0, 0.0], [0.0, 4.0], [-4.0, 0.0]],
        ] {
            assert_eq!(right_of_zero(&outside), (Clip::Nothing, at(&[])), "{outside:?}");
        }
        // A part: cut at two edges, at an edge and a vertex, and along a diagonal.
        let square = [[-2.0, 0.0], [2.0, 0.0], [2.0, 4.0], [-2.0, 4.0]];
        let half = at(&[[0.0, 0.0], [2.0, 0.0], [2.0, 4.0], [0.0, 4.0]]);
        assert_eq!(right_of_zero(&square), (Clip::Part(5), half), "a square");
        let triangle = [[-2.0, 0.0], [2.0, 2.0], [0.0, 4.0]];
        let part = at(&[[0.0, 4.0], [0.0, 1.0], [2.0, 2.0]]);
        assert_eq!(right_of_zero(&triangle), (Clip::Part(4), part), "a triangle with a vertex on the plane");
        let diamond = [[0.0, -2.0], [2.0, 0.0], [0.0, 2.0], [-2.0, 0.0]];
        let part = at(&[[0.0, -2.0], [2.0, 0.0], [0.0, 2.0]]);
        assert_eq!(right_of_zero(&diamond), (Clip::Part(5), part), "a square along its diagonal");
    }

    #[test]
    fn neighbours_within_the_distance_to_merge_become_one() {
        // The edge from (2, 0) to (2, 0.5) is as long as the distance to merge, and the other is longer.
        let polygon = [[-2.0, 0.0], [2.0, 0.0], [2.0, 0.5], [2.0, 1.25], [-2.0, 4.0]];
        let part = at(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.25], [0.0, 2.625]]);
        assert_eq!(right_of_zero(&polygon), (Clip::Part(6), part), "a short edge within");
        // The last vertex, and the first, which is cut, are as near.
        let polygon = [[-2.0, 0.0], [2.0, 0.0], [2.0, 4.0], [0.5, 4.0], [-0.5, 4.0]];
        let part = at(&[[0.0, 0.0], [2.0, 0.0], [2.0, 4.0], [0.5, 4.0]]);
        assert_eq!(right_of_zero(&polygon), (Clip::Part(6), part), "a short edge at the plane");
        let polygon = [[0.25, 0.0], [2.0, 0.0], [2.0, 4.0], [-2.0, 4.0], [-1.75, 0.0]];
        let part = at(&[[0.0, 0.0], [2.0, 0.0], [2.0, 4.0], [0.0, 4.0]]);
        assert_eq!(right_of_zero(&polygon), (Clip::Part(6), part), "a short edge at the first vertex");
        let polygon = [[2.0, 0.0], [2.0, 4.0], [-2.0, 4.0], [-1.5, 0.5], [1.5, 0.0]];
        let part = at(&[[2.0, 0.0], [2.0, 4.0], [0.0, 4.0], [0.0, 0.25]]);
        assert_eq!(right_of_zero(&polygon), (Clip::Part(6), part), "a short edge at the last vertex");
        // The first crossing is near to the last vertex, which is cut off.
        let polygon = [[1.75, 0.0], [2.0, 4.0], [-2.0, 4.0], [-0.25, 0.0]];
        let part = at(&[[0.0, 0.0], [1.75, 0.0], [2.0, 4.0], [0.0, 4.0]]);
        assert_eq!(
            right_of_zero(&polygon),
            (Clip::Part(5), part),
            "a crossing near a vertex that is cut off"
        );
        let polygon = [[2.0, 0.0], [2.0, 0.25], [-2.0, 0.25], [-2.0, 0.0]];
        assert_eq!(right_of_zero(&polygon), (Clip::Nothing, at(&[])), "a narrow strip");
        let polygon = [[-2.0, 0.0], [0.25, 0.0], [-2.0, 0.25]];
        assert_eq!(right_of_zero(&polygon), (Clip::Nothing, at(&[])), "a small tip");
    }

    #[test]
    fn polygons_of_up_to_120_vertices_are_clipped() {
        for (count, is_clipped) in [(120, true), (121, false)] {
            let mut points: Vec<DVec3> = (0..count)
                .map(|i| f64::from(i) / f64::from(count) * core::f64::consts::TAU)
                .map(|angle| DVec3::new(angle.cos(), angle.sin(), 0.0))
                .collect();
            let result = clip(&mut points, 0..count as usize, &Plane::new(DVec3::X, 0.0), 1e-9);
            assert_eq!(matches!(result, Clip::Part(_)), is_clipped, "{count} vertices: {result:?}");
        }
    }

    #[test]
    fn clipping_into_a_list_replaces_its_content() {
        let square = at(&[[-2.0, 0.0], [2.0, 0.0], [2.0, 4.0], [-2.0, 4.0]]);
        let mut out = at(&[[9.0, 9.0]]);
        clip_into(&square, &Plane::new(DVec3::X, 5.0), 0.5, &mut out);
        assert_eq!(out, square, "a polygon inside");
        clip_into(&square, &Plane::new(DVec3::X, 0.0), 0.5, &mut out);
        assert_eq!(out, at(&[[0.0, 0.0], [2.0, 0.0], [2.0, 4.0], [0.0, 4.0]]), "half of a polygon");
        clip_into(&square, &Plane::new(DVec3::X, -5.0), 0.5, &mut out);
        assert_eq!(out, [], "a polygon outside");
        out.push(DVec3::ONE);
        clip_into(&[], &Plane::new(DVec3::X, 0.0), 0.5, &mut out);
        assert_eq!(out, [], "no polygon");
    }

    #[test]
    fn a_polygon_with_a_nan_or_infinite_vertex_is_kept_whole() {
        // A square outside the plane, across it, and inside it.
        for x in [-2.0, -0.5, 1.0] {
            for (i, bad) in (0..8).zip([f64::NAN, f64::NEG_INFINITY].into_iter().cycle()) {
                let square = [[x, 0.0], [x + 1.0, 0.0], [x + 1.0, 1.0], [x, 1.0]];
                let mut points = square.map(|[x, y]| DVec3::new(x, y, 0.0)).to_vec();
                points[i / 2].x = bad;
                let plane = Plane::new(DVec3::X, 0.0);
                assert_eq!(clip(&mut points, 0..4, &plane, 1e-9), Clip::All, "{points:?}");
                assert_eq!(points.len(), 4, "{points:?}: no vertex is added or left out");
            }
        }
    }
}
