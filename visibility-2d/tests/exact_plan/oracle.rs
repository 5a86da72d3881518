//! Oracle of an eye's view, by brute force in fractions: between two neighbouring directions to wall ends and
//! crossings, one wall is nearest.

use super::UNIT;
use std::cmp::Ordering;

pub(crate) type Vector = [i128; 2];

pub(crate) struct Oracle {
    /// Walls, and the four sides of the rectangle, in integer units.
    pub(crate) walls: Vec<[Vector; 2]>,
    pub(crate) count: usize,
}

pub(crate) fn cross(a: Vector, b: Vector) -> i128 {
    a[0] * b[1] - a[1] * b[0]
}

pub(crate) fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1]]
}

pub(crate) fn dot(a: Vector, b: Vector) -> i128 {
    a[0] * b[0] + a[1] * b[1]
}

/// Orders directions counter-clockwise from the direction +x.
pub(crate) fn by_angle(a: &Vector, b: &Vector) -> Ordering {
    let lower = |v: &Vector| v[1] < 0 || v[1] == 0 && v[0] < 0;
    lower(a).cmp(&lower(b)).then(0.cmp(&cross(*a, *b)))
}

/// Returns `t` and `d` of the crossing of the lines through two walls: `a[0] + t / d (a[1] - a[0])`. `None`
/// if the lines are parallel.
pub(crate) fn crossing(a: [Vector; 2], b: [Vector; 2]) -> Option<[i128; 2]> {
    let v = minus(b[1], b[0]);
    let d = cross(minus(a[1], a[0]), v);
    (d != 0).then(|| [cross(minus(b[0], a[0]), v), d])
}

impl Oracle {
    pub(crate) fn new(walls: &[[[i32; 2]; 2]], [low, high]: [[i32; 2]; 2]) -> Self {
        let count = walls.len();
        let scaled = |p: [i32; 2]| p.map(|x| i128::from(x) * UNIT as i128);
        let mut all: Vec<_> = walls.iter().map(|ends| ends.map(scaled)).collect();
        let corners = [low, [high[0], low[1]], high, [low[0], high[1]]].map(|p| p.map(i128::from));
        all.extend((0..4).map(|k| [corners[k], corners[(k + 1) % 4]]));
        Self { walls: all, count }
    }

    /// Returns the walls seen, ascending, and the area of the visibility polygon in world units.
    pub(crate) fn look(&self, eye: [i32; 2]) -> (Vec<u32>, f64) {
        let eye = eye.map(i128::from);
        let walls: Vec<_> = self.walls.iter().map(|ends| ends.map(|end| minus(end, eye))).collect();
        let mut directions: Vec<Vector> = walls.iter().flatten().copied().collect();
        for (i, a) in walls.iter().enumerate() {
            for b in &walls[..i] {
                if let Some([t, d]) = crossing(*a, *b) {
                    // The crossing, multiplied by |d|.
                    let (u, sign) = (minus(a[1], a[0]), d.signum());
                    directions.push([0, 1].map(|k| (a[0][k] * d + t * u[k]) * sign));
                }
            }
        }
        directions.retain(|d| *d != [0, 0]);
        directions.sort_by(by_angle);
        directions.dedup_by(|a, b| by_angle(a, b) == Ordering::Equal);

        let mut seen = Vec::new();
        let mut area = 0.0;
        for (i, &first) in directions.iter().enumerate() {
            let second = directions[(i + 1) % directions.len()];
            assert!(cross(first, second) > 0, "the rectangle surrounds the eye");
            let middle = [first[0] + second[0], first[1] + second[1]];
            // Distance along the middle direction between two neighbours, as a fraction with a positive
            // denominator.
            let mut nearest: Option<(i128, i128)> = None;
            let mut hits = Vec::new();
            for (index, wall) in walls.iter().enumerate() {
                let along = minus(wall[1], wall[0]);
                let across = cross(middle, along);
                if across == 0 || cross(middle, wall[0]).signum() * cross(middle, wall[1]).signum() != -1 {
                    continue;
                }
                let (n, d) = (cross(wall[0], along) * across.signum(), across.abs());
                if n <= 0 {
                    continue;
                }
                let order = nearest.map_or(Ordering::Less, |(m, e)| (n * e).cmp(&(m * d)));
                if order == Ordering::Less {
                    nearest = Some((n, d));
                    hits.clear();
                }
                if order != Ordering::Greater {
                    hits.push(index);
                }
            }
            let wall = walls[hits[0]];
            let along = minus(wall[1], wall[0]);
            let distance = |d: Vector| cross(wall[0], along) as f64 / cross(d, along) as f64;
            area += 0.5 * distance(first) * distance(second) * cross(first, second) as f64;
            seen.extend(hits);
        }
        // Walls through the eye are also seen.
        seen.extend((0..walls.len()).filter(|&i| {
            let [a, b] = walls[i];
            a != b && cross(a, b) == 0 && dot(a, b) <= 0
        }));
        seen.sort_unstable();
        seen.dedup();
        let seen = seen.into_iter().filter(|&i| i < self.count).map(|i| i as u32).collect();
        (seen, area / (UNIT * UNIT))
    }

    /// Returns whether no wall stops the segment between two points.
    pub(crate) fn sees(&self, a: [i32; 2], b: [i32; 2]) -> bool {
        let (a, b) = (a.map(i128::from), b.map(i128::from));
        let along = minus(b, a);
        let end = dot(along, along);
        // Positions along the segment from 0 to `end`: where a wall begins to the left or to the right, and
        // ranges of walls along the segment.
        let (mut left, mut right, mut runs) = (Vec::new(), Vec::new(), Vec::new());
        for wall in &self.walls[..self.count] {
            let sides = wall.map(|w| cross(along, minus(w, a)).signum());
            let places = wall.map(|w| dot(along, minus(w, a)));
            if wall[0] == wall[1] {
                continue;
            }
            if sides == [0, 0] {
                runs.push((places[0].min(places[1]), places[0].max(places[1])));
            } else if sides[0] * sides[1] < 0 {
                // The segment's ends are on different sides of the wall.
                let w = minus(wall[1], wall[0]);
                if cross(w, minus(a, wall[0])).signum() * cross(w, minus(b, wall[0])).signum() < 0 {
                    return false;
                }
            } else {
                for k in 0..2 {
                    if sides[k] == 0 && 0 < places[k] && places[k] < end {
                        if sides[1 - k] > 0 { &mut left } else { &mut right }.push(places[k]);
                    }
                }
            }
        }
        runs.sort_unstable();
        let mut joined: Vec<(i128, i128)> = Vec::new();
        for (from, to) in runs {
            match joined.last_mut() {
                Some(last) if from <= last.1 => last.1 = last.1.max(to),
                _ => joined.push((from, to)),
            }
        }
        joined.extend(left.iter().map(|&place| (place, place)));
        !joined.iter().any(|&(from, to)| {
            let within = |place: &i128| (from..=to).contains(place);
            left.iter().any(within) && right.iter().any(within)
        })
    }
}
