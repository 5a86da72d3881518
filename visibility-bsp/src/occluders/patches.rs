//! Joining of triangles in any orientation, across shared edges, into convex polygons.
//!
//! Two polygons are joined if they run along one edge in opposite directions, with bit-identical ends, lie in
//! one plane up to what rounding of the vertices explains, and form a convex polygon. Small deviations from
//! flatness and convexity are harmless; see `shadow`.

use super::outline::{OccluderTriangle, Outline};
use crate::shadow::{MAX_EDGES, plane_of};
use alloc::collections::BTreeMap;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// Maximum deviation of vertices from the plane, as a fraction of the joined polygon's size.
const FLAT: f64 = 1e-6;
/// Tolerance of the test for convexity. In a polygon of size `s`, a vertex may lie outside the line of an
/// edge of length `l` by this number times `s^2 / l`: for the longest edges about a thousandth of [`FLAT`]
/// times `s`.
const CORNER_ROUNDING: f64 = 1e-9;
/// Maximum number of vertices of a joined polygon. Each edge costs a plane through the eye in every frame.
const MAX_VERTICES: usize = if MAX_EDGES < 10 { MAX_EDGES } else { 10 };
/// Maximum number of vertices that a joined polygon surrounds. Each costs time with every further triangle
/// that is joined, and in frames with clip planes.
const MAX_INNER: usize = 64;

/// A polygon under construction, with vertices as indices of the distinct positions that [`weld`] returns.
struct Polygon {
    /// Indices of the vertices in the positions that [`weld`] returns, counter-clockwise as seen from the
    /// front.
    vertices: Vec<u32>,
    /// Indices of the vertices that joins have surrounded, so that `vertices` lacks them.
    inner: Vec<u32>,
    /// Indices of the polygon's objects in the list given to `Occluders::add_from`, ascending.
    sources: Vec<u32>,
    /// Whether the polygon also hides for eyes behind its front; if false, only for eyes in front.
    two_sided: bool,
}

/// Joins triangles greedily into nearly flat and convex polygons of at most [`MAX_VERTICES`] vertices. Each
/// triangle ends up in exactly one polygon; one that joins with no other becomes a polygon of its own.
pub(super) fn join(triangles: &[OccluderTriangle]) -> Vec<Outline> {
    // `edges` maps each directed edge to the polygon that runs along it: the neighbour runs along it in the
    // other direction.
    let (positions, corners) = weld(triangles);
    let mut polygons: Vec<Option<Polygon>> = Vec::with_capacity(triangles.len());
    let mut edges: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for ((triangle, corners), number) in triangles.iter().zip(&corners).zip(0..) {
        polygons.push(Some(Polygon {
            vertices: corners.to_vec(),
            inner: Vec::new(),
            sources: alloc::vec![triangle.source],
            two_sided: triangle.two_sided,
        }));
        for i in 0..3 {
            edges.insert((corners[i], corners[(i + 1) % 3]), number);
        }
    }
    // Each polygon grows across its edges while the union stays convex and flat. After a join all of its
    // edges are tried again. The number of tries is limited, since polygons with more vertices are of no use.
    for number in 0..polygons.len() {
        let Some(mut polygon) = polygons[number].take() else { continue };
        let mut i = 0;
        let mut tries = 0;
        while i < polygon.vertices.len() && tries < 4 * MAX_VERTICES {
            tries += 1;
            let (a, b) = (polygon.vertices[i], polygon.vertices[(i + 1) % polygon.vertices.len()]);
            let other = edges.get(&(b, a)).copied().filter(|&other| other as usize != number);
            let joined = other.and_then(|other| {
                let theirs = polygons[other as usize].as_ref()?;
                Some((other, joined(&positions, &polygon, i, theirs)?))
            });
            if let Some((other, joined)) = joined {
                polygons[other as usize] = None;
                polygon = joined;
                let count = polygon.vertices.len();
                for k in 0..count {
                    edges.insert((polygon.vertices[k], polygon.vertices[(k + 1) % count]), number as u32);
                }
                i = 0;
            } else {
                i += 1;
            }
        }
        polygons[number] = Some(polygon);
    }
    let position = |v: u32| positions[v as usize];
    polygons
        .into_iter()
        .flatten()
        .map(|polygon| Outline {
            vertices: polygon.vertices.into_iter().map(position).collect(),
            inner: polygon.inner.into_iter().map(position).collect(),
            sources: polygon.sources,
            solids: Vec::new(),
            two_sided: polygon.two_sided,
        })
        .collect()
}

/// Returns the distinct corner positions in metres relative to `Scene::origin`, and each triangle's corners
/// as indices of these positions. Positions are equal only if bit-identical, but for positive and negative
/// zero, which count as equal.
fn weld(triangles: &[OccluderTriangle]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut indices: BTreeMap<[u64; 3], u32> = BTreeMap::new();
    let mut positions = Vec::new();
    let mut corners = Vec::with_capacity(triangles.len());
    for triangle in triangles {
        corners.push(triangle.corners.map(|p| {
            *indices.entry((p + 0.0).to_array().map(f64::to_bits)).or_insert_with(|| {
                positions.push(p);
                positions.len() as u32 - 1
            })
        }));
    }
    (positions, corners)
}

/// Returns the union of two polygons that share the edge from vertex `i` of `ours`, as one polygon.
/// `positions` are the distinct positions that the polygons' vertices index. `None` if `theirs` does not have
/// that edge in reverse, if only one of the two is two-sided, or if the union is not flat and convex, has
/// more than [`MAX_VERTICES`] vertices, or is of polygons that surround more than [`MAX_INNER`].
fn joined(positions: &[DVec3], ours: &Polygon, i: usize, theirs: &Polygon) -> Option<Polygon> {
    let (n, m) = (ours.vertices.len(), theirs.vertices.len());
    if ours.two_sided != theirs.two_sided {
        return None;
    }
    let (a, b) = (ours.vertices[i], ours.vertices[(i + 1) % n]);
    let j = (0..m).find(|&j| theirs.vertices[j] == b && theirs.vertices[(j + 1) % m] == a)?;
    // From b around `ours` to a, then from the vertex after a around `theirs` to the vertex before b.
    let mut vertices: Vec<u32> = (0..n).map(|k| ours.vertices[(i + 1 + k) % n]).collect();
    vertices.extend((0..m - 2).map(|k| theirs.vertices[(j + 2 + k) % m]));
    // If they share more than one edge, the loop runs there and back; these spikes are removed. The tip of a
    // spike stays a vertex of the surface.
    let mut inner = [&ours.inner[..], &theirs.inner].concat();
    if inner.len() > MAX_INNER {
        return None;
    }
    while vertices.len() > 3 {
        let count = vertices.len();
        let Some(k) = (0..count).find(|&k| vertices[k] == vertices[(k + 2) % count]) else { break };
        let (one, two) = ((k + 1) % count, (k + 2) % count);
        inner.push(vertices[one]);
        vertices.remove(one.max(two));
        vertices.remove(one.min(two));
    }
    let mut sorted = vertices.clone();
    sorted.sort_unstable();
    sorted.dedup();
    if vertices.len() < 3 || vertices.len() > MAX_VERTICES || sorted.len() != vertices.len() {
        return None;
    }
    let [points, inner_points]: [Vec<DVec3>; 2] =
        [&vertices, &inner].map(|list| list.iter().map(|&v| positions[v as usize]).collect());
    is_flat_and_convex(&points, &inner_points).then(|| {
        let mut sources: Vec<u32> = ours.sources.iter().chain(&theirs.sources).copied().collect();
        sources.sort_unstable();
        sources.dedup();
        Polygon { vertices, inner, sources, two_sided: ours.two_sided }
    })
}

/// Tests whether a loop of points, in metres and in boundary order, has an area, is convex up to rounding,
/// and deviates, together with the points `inner` of the surface inside, from its plane by at most [`FLAT`]
/// of its size. False for NaN and for a loop without area.
fn is_flat_and_convex(points: &[DVec3], inner: &[DVec3]) -> bool {
    let Some((normal, extent_along_normal, _)) = plane_of(points, inner, 0.0) else { return false };
    let size = points.iter().map(|p| p.distance(points[0])).fold(0.0, f64::max);
    if extent_along_normal[1] - extent_along_normal[0] > FLAT * size {
        return false;
    }
    let count = points.len();
    (0..count).all(|i| {
        let (a, b) = (points[i], points[(i + 1) % count]);
        let inwards = normal.cross(b - a);
        points.iter().all(|p| inwards.dot(*p - a) >= -CORNER_ROUNDING * size * size)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slanted_fan_becomes_one_polygon_and_a_step_does_not() {
        let around = [[0.0, 0.0], [2.0, 0.0], [3.0, 1.0], [2.0, 2.0], [0.0, 2.0]];
        let p = |k: usize| DVec3::new(around[k][0], around[k][1], around[k][0] * 0.5);
        let triangle =
            |a, b, c, source| OccluderTriangle { corners: [p(a), p(b), p(c)], source, two_sided: false };
        let flat = [triangle(0, 1, 2, 0), triangle(0, 2, 3, 1), triangle(0, 3, 4, 2)];
        let outlines = join(&flat);
        assert_eq!(outlines.len(), 1, "a flat fan is one polygon");
        assert_eq!(
            (outlines[0].vertices.len(), &outlines[0].sources[..]),
            (5, &[0, 1, 2][..]),
            "its vertices, and the triangles that it is of"
        );
        let mut bent = flat;
        bent[2].corners[2].z += 0.1;
        assert_eq!(join(&bent).len(), 2, "a bent fan is two polygons");
    }

    /// Two fans that meet along a line of three edges. Neither takes in a triangle of the other alone, which
    /// would make an inward corner.
    #[test]
    fn fans_that_share_several_edges_are_one_polygon() {
        let line = |k: i32| DVec3::new(f64::from(k), 0.0, 0.0);
        let tips = [1.0, -1.0].map(|y| DVec3::new(1.5, y, 0.0));
        let [above, below] = tips;
        let triangle = |corners, source| OccluderTriangle { corners, source, two_sided: false };
        for shift in 0..3 {
            let turned = |mut corners: [DVec3; 3]| {
                corners.rotate_left(shift);
                corners
            };
            let below = (0..3).map(|k| triangle([below, line(k + 1), line(k)], k as u32));
            let above = (0..3).map(|k| triangle(turned([above, line(k), line(k + 1)]), 3 + k as u32));
            let outlines = join(&below.chain(above).collect::<Vec<_>>());
            assert_eq!(outlines.len(), 1, "both fans, turned by {shift}");
            let mut corners = outlines[0].vertices.clone();
            let first = corners.iter().position(|&v| v == line(0)).expect("an end of the line");
            corners.rotate_left(first);
            assert_eq!(corners, [line(0), tips[1], line(3), tips[0]], "corners, turned by {shift}");
            let mut inner = outlines[0].inner.clone();
            inner.sort_by(|a, b| a.x.total_cmp(&b.x));
            assert_eq!(inner, [line(1), line(2)], "points inside, turned by {shift}");
            assert_eq!(outlines[0].sources, [0, 1, 2, 3, 4, 5], "triangles");
        }
    }

    #[test]
    fn a_fan_around_a_point_is_one_polygon_with_the_point_inside() {
        let around = [[2, 0], [1, 2], [-1, 2], [-2, 0], [-1, -2], [1, -2]];
        let p = |[x, y]: [i32; 2]| DVec3::new(f64::from(x), f64::from(y), f64::from(x + y));
        for first in 0..6 {
            let corner = |k: usize| p(around[(first + k) % 6]);
            let triangle = |k: usize| OccluderTriangle {
                corners: [p([0, 0]), corner(k), corner(k + 1)],
                source: k as u32,
                two_sided: false,
            };
            for count in [2, 3, 4, 5, 6] {
                let triangles: Vec<_> = (0..count).map(triangle).collect();
                let outlines = join(&triangles);
                // Triangles that turn by more than a half around the point fill no convex polygon until the
                // fan is closed.
                let whole = count <= 3 || count == 6;
                assert_eq!(outlines.len() == 1, whole, "{count} triangles from {first}: {outlines:?}");
                if count == 6 {
                    assert_eq!(outlines[0].inner, [DVec3::ZERO], "inside the fan from {first}");
                    let mut vertices: Vec<_> = outlines[0].vertices.clone();
                    let start = vertices.iter().position(|&v| v == corner(0)).expect("a corner");
                    vertices.rotate_left(start);
                    assert!((0..6).all(|k| vertices[k] == corner(k)), "{vertices:?}");
                }
            }
        }
    }
}
