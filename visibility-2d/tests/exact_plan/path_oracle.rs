//! Oracle of shortest paths, by brute force in integers: Bellman and Ford's relaxation over all pairs of a
//! vertex and one of the gaps between its walls.
//!
//! Start and goal are vertices of their own, at which a path may begin or end in any gap. All moves between
//! two vertices that see each other count, whether or not a shortest path can use them.

use super::oracle::{Vector, by_angle, cross, crossing, dot, minus};
use std::cmp::Ordering;

/// Returns whether `p` is on the segment between two points, ends included.
fn is_on(p: Vector, [a, b]: [Vector; 2]) -> bool {
    cross(minus(b, a), minus(p, a)) == 0 && dot(minus(a, p), minus(b, p)) <= 0
}

/// Returns the length of the shortest path between two points among walls, in integer units. All crossings
/// of walls must have integer coordinates. `None` without a path.
pub(crate) fn shortest(walls: &[[Vector; 2]], from: Vector, to: Vector) -> Option<f64> {
    let walls: Vec<_> = walls.iter().copied().filter(|[a, b]| a != b).collect();
    let mut vertices: Vec<Vector> = walls.iter().flatten().copied().chain([from, to]).collect();
    for (i, a) in walls.iter().enumerate() {
        for b in &walls[..i] {
            if let Some([t, d]) = crossing(*a, *b) {
                let u = minus(a[1], a[0]);
                let at = [0, 1].map(|k| a[0][k] + t * u[k] / d);
                if is_on(at, *a) && is_on(at, *b) {
                    vertices.push(at);
                }
            }
        }
    }
    vertices.sort_unstable();
    vertices.dedup();
    // Walls between neighbouring vertices along them, as pairs of vertices in both directions.
    let count = vertices.len();
    let is_between = |p: Vector, [a, b]: [Vector; 2]| p != a && p != b && is_on(p, [a, b]);
    let is_wall = |i: usize, j: usize| {
        let ends = [vertices[i], vertices[j]];
        i != j
            && walls.iter().any(|&wall| ends.iter().all(|&end| is_on(end, wall)))
            && !vertices.iter().any(|&p| is_between(p, ends))
    };
    // For each vertex, the vertices at the other ends of its walls, by angle. Gap k is counter-clockwise
    // after wall k. A vertex without walls has a single gap.
    let spokes: Vec<Vec<usize>> = (0..count)
        .map(|i| {
            let mut spokes: Vec<_> = (0..count).filter(|&j| is_wall(i, j)).collect();
            let direction = |&j: &usize| minus(vertices[j], vertices[i]);
            spokes.sort_by(|a, b| by_angle(&direction(a), &direction(b)));
            spokes
        })
        .collect();
    let gap = |i: usize, j: usize| {
        let direction = minus(vertices[j], vertices[i]);
        let before = |&k: &usize| by_angle(&minus(vertices[k], vertices[i]), &direction) != Ordering::Greater;
        let count = spokes[i].len().max(1);
        (spokes[i].iter().filter(|k| before(k)).count() + count - 1) % count
    };
    let is_clear = |i: usize, j: usize| {
        let ends = [vertices[i], vertices[j]];
        let along = minus(ends[1], ends[0]);
        (0..count).all(|k| spokes[k].is_empty() || !is_between(vertices[k], ends))
            && walls.iter().all(|wall| {
                let sides = wall.map(|p| cross(along, minus(p, ends[0])).signum());
                let w = minus(wall[1], wall[0]);
                let others = ends.map(|p| cross(w, minus(p, wall[0])).signum());
                sides[0] * sides[1] >= 0 || others[0] * others[1] >= 0
            })
    };
    // Moves between states (vertex, gap), with their lengths.
    let mut moves = Vec::new();
    for i in 0..count {
        for j in (0..count).filter(|&j| j != i) {
            let along = minus(vertices[j], vertices[i]);
            let length = (dot(along, along) as f64).sqrt();
            if let Some(k) = spokes[i].iter().position(|&k| k == j) {
                let back = spokes[j].iter().position(|&k| k == i).unwrap();
                let [before_k, before_back] =
                    [(k, i), (back, j)].map(|(k, i)| (k + spokes[i].len() - 1) % spokes[i].len());
                moves.push(((i, k), (j, before_back), length));
                moves.push(((i, before_k), (j, back), length));
            } else if is_clear(i, j) {
                moves.push(((i, gap(i, j)), (j, gap(j, i)), length));
            }
        }
    }
    let [from, to] = [from, to].map(|p| vertices.binary_search(&p).unwrap());
    let mut lengths: Vec<Vec<f64>> = spokes
        .iter()
        .enumerate()
        .map(|(i, spokes)| vec![if i == from { 0.0 } else { f64::INFINITY }; spokes.len().max(1)])
        .collect();
    let mut is_changed = true;
    while is_changed {
        is_changed = false;
        for &((i, at), (j, to), length) in &moves {
            if lengths[i][at] + length < lengths[j][to] - 1e-9 {
                lengths[j][to] = lengths[i][at] + length;
                is_changed = true;
            }
        }
    }
    lengths[to].iter().copied().min_by(f64::total_cmp).filter(|length| length.is_finite())
}
