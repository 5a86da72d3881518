//! Outlines of regions: the edges at which a region ends, as closed loops in no particular order.

use crate::faces::Faces;
use crate::regions::{Region, Regions};
use crate::t_junctions::is_between;
use alloc::vec::Vec;
use visibility_core::glam::Vec3;

/// An edge of an outline: the region lies to its left, seen from the region's front. Start and end vertex.
pub(crate) type OutlineEdge = [u32; 2];

/// Returns the outline of a region: the sides of its faces, without those that cancel out. An edge that is
/// traversed n times more often in one direction than in the other is listed n times.
///
/// The outline is the boundary of the sum of all faces. So its winding number about a line is the number of
/// faces that the line passes through from front to back, less the number that it passes through from back to
/// front. Each of several overlapping faces counts.
pub(crate) fn outline(faces: &Faces, regions: &Regions, region: &Region) -> Vec<OutlineEdge> {
    let mut sides: Vec<([u32; 2], bool)> = Vec::new();
    for member in &regions.members[region.members[0] as usize..region.members[1] as usize] {
        let corners = faces.corners_of(&faces.faces[member.face as usize]);
        for (&a, &b) in corners.iter().zip(corners.iter().cycle().skip(1)) {
            sides.push(([a.min(b), a.max(b)], (a < b) != member.turned));
        }
    }
    sides.sort_unstable();
    let mut edges = Vec::new();
    for same in sides.chunk_by(|a, b| a.0 == b.0) {
        let [low, high] = same[0].0;
        let forward = same.iter().filter(|side| side.1).count();
        let backward = same.len() - forward;
        let edge = if forward > backward { [low, high] } else { [high, low] };
        edges.extend(core::iter::repeat_n(edge, forward.abs_diff(backward)));
    }
    edges
}

/// A vertex at which exactly one edge of an outline ends and exactly one begins.
#[derive(Clone, Copy)]
struct Passage {
    vertex: u32,
    outline: u32,
    /// Indices of the edge that ends and of the edge that begins at the vertex, among all edges.
    edges: [u32; 2],
}

/// Maximum number of outlines that pass a vertex, for the vertex to be removed from outlines.
const MAX_PASSAGES: usize = 64;

/// Removes vertices in the middle of straight lines. A vertex is removed from an outline if it lies exactly
/// between its two neighbours there, unless some other outline has one of the two edges at the vertex and not
/// the other. So outlines that share an edge before also share it afterwards. Returns the number of vertices
/// removed, counted for each outline.
pub(crate) fn straighten(vertices: &[Vec3], outlines: &mut [Vec<OutlineEdge>]) -> usize {
    // All edges of all outlines. `alive` is false for an edge that was joined to the edge before it.
    let mut edges: Vec<OutlineEdge> = outlines.iter().flatten().copied().collect();
    let mut alive = alloc::vec![true; edges.len()];
    // Both ends of all edges: vertex, outline, whether the edge begins at the vertex, and index of the edge.
    let mut ends: Vec<(u32, u32, bool, u32)> = Vec::with_capacity(edges.len() * 2);
    let mut edge = 0;
    for (outline, of) in (0..).zip(outlines.iter()) {
        for [start, end] in of {
            ends.extend([(*start, outline, true, edge), (*end, outline, false, edge)]);
            edge += 1;
        }
    }
    ends.sort_unstable();
    // By edge: where in `ends` its end is.
    let mut end_at = alloc::vec![0; edge as usize];
    for (at, &(_, _, begins, edge)) in ends.iter().enumerate() {
        if !begins {
            end_at[edge as usize] = at;
        }
    }
    let mut passages: Vec<Passage> = Vec::new();
    // Vertices that an outline passes exactly once: the range of the ends at the vertex, and the range of the
    // passages.
    let mut candidates: Vec<[usize; 4]> = Vec::new();
    let mut first_end = 0;
    for at_vertex in ends.chunk_by(|a, b| a.0 == b.0) {
        let first = passages.len();
        for at in at_vertex.chunk_by(|a, b| a.1 == b.1) {
            if let [(vertex, outline, false, ends), (_, _, true, begins)] = at {
                passages.push(Passage { vertex: *vertex, outline: *outline, edges: [*ends, *begins] });
            }
        }
        if first < passages.len() {
            candidates.push([first_end, first_end + at_vertex.len(), first, passages.len()]);
        }
        first_end += at_vertex.len();
    }
    let mut count = 0;
    let mut joined: Vec<usize> = Vec::new();
    for [first_end, end_end, first, end] in candidates {
        // Where many outlines pass a vertex, the vertex stays: time is quadratic in their number.
        if end - first > MAX_PASSAGES {
            continue;
        }
        let vertex = passages[first].vertex;
        for seed in first..end {
            let neighbours = |passage: &Passage| {
                let [before, after] = passage.edges.map(|edge| edges[edge as usize]);
                [before[0], after[1]]
            };
            let [a, b] = neighbours(&passages[seed]);
            let [from, to, middle] = [a, b, vertex].map(|vertex| vertices[vertex as usize]);
            if !is_between(from, to, middle) {
                continue;
            }
            joined.clear();
            joined.extend((seed..end).filter(|&i| {
                let own = neighbours(&passages[i]);
                own == [a, b] || own == [b, a]
            }));
            // Number of edges at the vertex that lead to one of the two neighbours: two for each of these
            // passages, unless another outline has such an edge too.
            let mut shared = 0;
            for passage in &passages[first..end] {
                shared += neighbours(passage).iter().filter(|&&n| n == a || n == b).count();
            }
            for &(_, outline, begins, edge) in &ends[first_end..end_end] {
                let [start, stop] = edges[edge as usize];
                let other = if begins { stop } else { start };
                if other == a || other == b {
                    let passage = passages[first..end].binary_search_by_key(&outline, |p| p.outline);
                    shared += usize::from(passage.is_err());
                }
            }
            if shared != 2 * joined.len() {
                continue;
            }
            count += joined.len();
            for &i in &joined {
                let Passage { outline, edges: [before, after], .. } = passages[i];
                let end = edges[after as usize][1];
                edges[before as usize][1] = end;
                alive[after as usize] = false;
                // The outline no longer passes this vertex.
                passages[i].edges = [after, after];
                // At the end of the joined edge, the edge that ends there is another one now.
                let at = end_at[after as usize];
                ends[at].3 = before;
                end_at[before as usize] = at;
                if let Ok(next) = passages.binary_search_by_key(&(end, outline), |p| (p.vertex, p.outline)) {
                    passages[next].edges[0] = before;
                }
            }
        }
    }
    let mut at = 0;
    for outline in outlines {
        let range = at..at + outline.len();
        at = range.end;
        outline.clear();
        outline.extend(range.filter(|&edge| alive[edge]).map(|edge| edges[edge]));
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faces::LevelTriangle;

    #[test]
    fn an_edge_that_was_straightened_is_still_known_where_its_outline_passes_twice() {
        // A line of four vertices. One outline runs along the first three and then turns off, and touches
        // the third again with another loop. The other outline runs back along all four.
        let at = [[0, 0], [1, 0], [2, 0], [3, 0], [2, 1], [0, 1], [1, 2], [3, 2], [2, -3]];
        let vertices = at.map(|[x, y]| Vec3::new(x as f32, y as f32, 0.0));
        let outlines = [
            alloc::vec![[0, 1], [1, 2], [2, 4], [4, 5], [5, 0], [2, 6], [6, 7], [7, 2]],
            alloc::vec![[3, 2], [2, 1], [1, 0], [0, 8], [8, 3]],
        ];
        // Both ways round: the edge that both have leads to the neighbour before or to the one behind.
        for turned in [false, true] {
            let directed = |[a, b]: OutlineEdge| if turned { [b, a] } else { [a, b] };
            let mut outlines = outlines.clone().map(|outline| outline.into_iter().map(directed).collect());
            assert_eq!(straighten(&vertices, &mut outlines), 2, "the second vertex goes, in both outlines");
            let [first, second]: &[Vec<OutlineEdge>; 2] = &outlines;
            assert!(first.contains(&directed([0, 2])), "the first outline turns off at the third vertex");
            let shared = directed([2, 0]);
            assert!(second.contains(&shared), "the second outline shares the edge up to the third vertex");
        }
    }

    /// A region of two faces that share an edge, one of which is turned, and a face twice as large on top.
    #[test]
    fn outlines_are_sides_that_do_not_cancel_out() {
        let at = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[x, y]| Vec3::new(x as f32, y as f32, 0.0));
        let face = |corners: [usize; 3]| LevelTriangle { corners: corners.map(|i| at[i]), two_sided: true };
        let faces = Faces::weld(&[face([0, 1, 2]), face([0, 3, 2]), face([1, 2, 3])]);
        let number =
            |[x, y]: [f32; 2]| faces.vertices.iter().position(|v| [v.x, v.y] == [x, y]).unwrap() as u32;
        let [a, b, c, d] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(number);
        let members = [(0, false), (1, true), (2, false)];
        let members = members.map(|(face, turned)| crate::regions::Member { face, turned }).to_vec();
        let regions = Regions { members, ..Regions::default() };
        let outline_of = |members: [u32; 2]| {
            let region = Region {
                members,
                normal: visibility_core::glam::DVec3::Z,
                extent: [0.0; 2],
                area: 1.0,
                min_cosine: 1.0,
                two_sided: true,
            };
            let mut edges = outline(&faces, &regions, &region);
            edges.sort_unstable();
            edges
        };
        let mut square = [[a, b], [b, c], [c, d], [d, a]];
        square.sort_unstable();
        assert_eq!(outline_of([0, 2]), square, "two halves of a square");
        let mut all = [[a, b], [b, c], [b, c], [c, d], [c, d], [d, a], [d, b]];
        all.sort_unstable();
        assert_eq!(outline_of([0, 3]), all, "sides that two faces have in one direction are there twice");
    }

    /// Outlines that pass a vertex in a straight line, up to 64 of them. A vertex that an outline passes
    /// twice, and which is the last of all, stays.
    #[test]
    fn vertices_that_up_to_64_outlines_pass_are_removed() {
        for (count, expected) in [(64, 64), (65, 0)] {
            let mut vertices = alloc::vec![Vec3::ZERO, Vec3::X, Vec3::X * 2.0];
            let mut outlines = Vec::new();
            for i in 0..count {
                vertices.push(Vec3::new(i as f32, (i * i) as f32 + 1.0, 1.0));
                outlines.push(alloc::vec![[0, 1], [1, 2], [2, 3 + i], [3 + i, 0]]);
            }
            assert_eq!(straighten(&vertices, &mut outlines), expected, "vertices of {count} outlines");
        }
        let at = [[0, 0], [1, 1], [2, 2], [0, 2], [1, 1]].map(|[x, y]| Vec3::new(x as f32, y as f32, 0.0));
        let mut twice = [alloc::vec![[0, 4], [4, 2], [2, 3], [3, 4], [4, 1], [1, 0]]];
        assert_eq!(straighten(&at, &mut twice), 0, "a vertex that an outline passes twice");
    }

    #[test]
    fn many_outlines_at_one_vertex_take_no_cube_of_their_number() {
        // Triangles that share a corner and no edge. For each pair, a look at every third took hours.
        let count = 20_000;
        let point = |i: u32, z: f32| Vec3::new(i as f32, (i * i % 1009) as f32 + 1.0, z);
        let mut vertices = alloc::vec![Vec3::ZERO];
        let mut outlines = Vec::new();
        for i in 0..count {
            vertices.extend([point(i, 0.0), point(i, 1.0)]);
            outlines.push(alloc::vec![[0, 2 * i + 1], [2 * i + 1, 2 * i + 2], [2 * i + 2, 0]]);
        }
        let before = outlines.clone();
        assert_eq!(straighten(&vertices, &mut outlines), 0, "no vertex lies between its neighbours");
        assert_eq!(outlines, before, "outlines without straight vertices stay as they are");
    }

    #[test]
    fn an_outline_that_passes_a_vertex_often_takes_no_square_of_its_number() {
        // A wheel of one outline: each spoke leads out to a vertex and on in the same line to the next. A
        // look at all edges that end at the hub, for each spoke, took seconds.
        let count = 100_000;
        let mut vertices = alloc::vec![Vec3::ZERO];
        let mut outline = Vec::new();
        for i in 0..count {
            let out = Vec3::new(i as f32, 1.0, 0.0);
            vertices.extend([out, out * 2.0]);
            outline.extend([[0, 2 * i + 2], [2 * i + 2, 2 * i + 1], [2 * i + 1, 0]]);
        }
        let mut outlines = [outline];
        assert_eq!(straighten(&vertices, &mut outlines), count as usize, "one vertex of each spoke");
        assert_eq!(outlines[0].len(), 2 * count as usize, "edges out and back");
    }
}
