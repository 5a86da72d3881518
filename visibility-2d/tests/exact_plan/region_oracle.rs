//! Oracle of what is seen from a triangle without walls inside, by brute force: lines next to lines through
//! two vertices.
//!
//! Everything seen from the triangle is seen along a set of lines, which is bounded by lines through two
//! vertices. A line slightly off one of these, to one side at each of the two vertices, is in the set.

use super::oracle::{Vector, cross, minus};
use std::cmp::Ordering;

/// Number of units of the shifted lines per unit of the vertices.
const FINE: i128 = 1 << 20;

/// Position along a line: numerator and positive denominator.
type Place = (i128, i128);

fn order(a: Place, b: Place) -> Ordering {
    (a.0 * b.1).cmp(&(b.0 * a.1))
}

/// Returns where a line crosses a segment between its ends. `None` if it does not, or if it meets an end.
fn crossing(at: Vector, along: Vector, segment: [Vector; 2]) -> Option<Place> {
    let sides = segment.map(|p| cross(along, minus(p, at)).signum());
    let w = minus(segment[1], segment[0]);
    let across = cross(along, w);
    (sides[0] * sides[1] < 0).then(|| (cross(minus(segment[0], at), w) * across.signum(), across.abs()))
}

/// Returns the walls seen from a triangle, ascending. `vertices` has all ends and crossings of walls and the
/// corners of the triangle.
pub(crate) fn seen_from(triangle: [Vector; 3], walls: &[[Vector; 2]], vertices: &[Vector]) -> Vec<u32> {
    let fine = |p: Vector| p.map(|x| x * FINE);
    let fine_walls: Vec<_> = walls.iter().map(|wall| wall.map(fine)).collect();
    let triangle = triangle.map(fine);
    let mut seen = vec![false; walls.len()];
    for (index, &u) in vertices.iter().enumerate() {
        for &v in &vertices[..index] {
            let [x, y] = minus(v, u);
            for (at_u, at_v) in [(1, 1), (-1, -1), (1, -3), (-1, 3)] {
                let moved = |p: Vector, by: i128| [p[0] * FINE - y * by, p[1] * FINE + x * by];
                let at = moved(u, at_u);
                let along = minus(moved(v, at_v), at);
                // A line through a wall end is not inside a set of lines of sight.
                if fine_walls.iter().flatten().any(|&end| cross(along, minus(end, at)) == 0) {
                    continue;
                }
                let mut inside: Vec<_> = (0..3)
                    .filter_map(|k| crossing(at, along, [triangle[k], triangle[(k + 1) % 3]]))
                    .collect();
                inside.sort_by(|a, b| order(*a, *b));
                let [from, to] = inside[..] else { continue };
                let hits: Vec<_> = fine_walls.iter().map(|&wall| crossing(at, along, wall)).collect();
                for is_ahead in [false, true] {
                    let beyond = |place: &Place| {
                        if is_ahead {
                            order(*place, to) != Ordering::Less
                        } else {
                            order(*place, from) != Ordering::Greater
                        }
                    };
                    let all = hits.iter().flatten().copied().filter(beyond);
                    let nearest = if is_ahead {
                        all.min_by(|a, b| order(*a, *b))
                    } else {
                        all.max_by(|a, b| order(*a, *b))
                    };
                    let is_hit = |&i: &usize| {
                        hits[i].zip(nearest).is_some_and(|(a, b)| order(a, b) == Ordering::Equal)
                    };
                    let hit: Vec<usize> = (0..walls.len()).filter(is_hit).collect();
                    // A line through the point where walls cross is not inside a set of lines either.
                    let direction = |i: usize| minus(walls[i][1], walls[i][0]);
                    if hit.iter().all(|&i| cross(direction(i), direction(hit[0])) == 0) {
                        hit.into_iter().for_each(|i| seen[i] = true);
                    }
                }
            }
        }
    }
    (0..walls.len()).filter(|&i| seen[i]).map(|i| i as u32).collect()
}
