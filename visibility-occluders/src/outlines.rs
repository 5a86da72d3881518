//! Outlines of regions: the edges at which a region ends, as closed loops in no particular order.

use crate::faces::Faces;
use crate::regions::{Region, Regions};
use crate::t_junctions::is_between;
use alloc::vec::Vec;
use visibility_core::glam::Vec3;

/// An edge of an outline: the region lies to its left, seen from the region's front. Start and end vertex.
pub(crate) type OutlineEdge = [u32; 2];

/// Returns the outline of a region: the sides of its faces, without those that cancel out. An edge that is
/// run through n times more often in one direction than in the other is listed n times.
///
/// The outline is the boundary of the sum of all faces, so that its winding number about a line is the number
/// of faces that the line goes through from front to back, less the number of those that it goes through from
/// back to front. Faces that overlap count each.
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

/// A vertex where exactly one edge of an outline ends and one begins.
#[derive(Clone, Copy)]
struct Passage {
    vertex: u32,
    outline: u32,
    /// Indices of the edge that ends and of the edge that begins at the vertex, among all edges.
    edges: [u32; 2],
}

/// Removes vertices in the middle of straight lines: those that lie, exactly, between their two neighbours in
/// every outline that contains them, and have the same two neighbours in all. So outlines that share an edge
/// share it afterwards too. Returns the number of vertices removed.
pub(crate) fn straighten(vertices: &[Vec3], outlines: &mut [Vec<OutlineEdge>]) -> usize {
    // All edges of all outlines; an edge that was joined to the one before has `alive` false.
    let mut edges: Vec<OutlineEdge> = outlines.iter().flatten().copied().collect();
    let mut alive = alloc::vec![true; edges.len()];
    // Ends and starts of all edges: vertex, outline, edge, and whether the edge begins at the vertex.
    let mut ends: Vec<(u32, u32, bool, u32)> = Vec::with_capacity(edges.len() * 2);
    let mut edge = 0;
    for (outline, of) in (0..).zip(outlines.iter()) {
        for [start, end] in of {
            ends.extend([(*start, outline, true, edge), (*end, outline, false, edge)]);
            edge += 1;
        }
    }
    ends.sort_unstable();
    let mut passages: Vec<Passage> = Vec::new();
    // Vertices of which every outline passes once: the range of their passages.
    let mut candidates: Vec<[usize; 2]> = Vec::new();
    for at_vertex in ends.chunk_by(|a, b| a.0 == b.0) {
        let first = passages.len();
        let mut simple = true;
        for at in at_vertex.chunk_by(|a, b| a.1 == b.1) {
            match at {
                [(vertex, outline, false, ends), (_, _, true, begins)] => {
                    passages.push(Passage { vertex: *vertex, outline: *outline, edges: [*ends, *begins] });
                }
                _ => simple = false,
            }
        }
        if simple {
            candidates.push([first, passages.len()]);
        }
    }
    let mut count = 0;
    for [first, end] in candidates {
        let vertex = passages[first].vertex;
        let neighbours = |passage: &Passage| {
            let [before, after] = passage.edges.map(|edge| edges[edge as usize]);
            [before[0], after[1]]
        };
        let [a, b] = neighbours(&passages[first]);
        let same = passages[first..end].iter().map(neighbours).all(|n| n == [a, b] || n == [b, a]);
        let [from, to, middle] = [a, b, vertex].map(|vertex| vertices[vertex as usize]);
        if !same || a == b || !is_between(from, to, middle) {
            continue;
        }
        count += 1;
        for i in first..end {
            let Passage { outline, edges: [before, after], .. } = passages[i];
            let end = edges[after as usize][1];
            edges[before as usize][1] = end;
            alive[after as usize] = false;
            // At the end of the joined edge, the edge that ends there is another one now.
            if let Ok(next) = passages.binary_search_by_key(&(end, outline), |p| (p.vertex, p.outline)) {
                passages[next].edges[0] = before;
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
