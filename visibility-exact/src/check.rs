//! The check of proofs. It shares the statement with the search (which pairs of polygons hold the segments,
//! how polygons are halved) and nothing else: sides are computed in double-double arithmetic with bounds of
//! their own, boundaries are found anew, and separating planes are looked for among more candidates.

use crate::polygon::Polygon;
use crate::proof::{LoopEdge, Proof, Step};
use crate::sight::{Half, Sight, Target, position_error, sights};
use crate::triangles::{SceneTriangles, unit_normal};
use alloc::collections::BTreeMap;
use alloc::vec::Vec;
use core::fmt;
use visibility_core::geometry::DoubleDouble;
use visibility_core::glam::DVec3;

/// Why a [`Proof`] does not hold.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ProofError {
    /// The proof has too few or too many nodes, numbers that are out of range, or a target that is seen from
    /// less than the clearance over its plane.
    Malformed,
    /// A surface touches an end of segments, has a boundary that segments meet, or is not crossed an odd
    /// number of times.
    Surface,
    /// A loop is not near its occluder, or segments may pass it outside.
    Loop,
    /// Weights of dividing edges do not exclude all segments.
    Weights,
    /// Three edges around a corner do not exclude all segments.
    Corner,
}

impl fmt::Display for ProofError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Malformed => "the proof is malformed",
            Self::Surface => "a surface does not block its node",
            Self::Loop => "a loop does not wind around its node",
            Self::Weights => "weights do not exclude a node",
            Self::Corner => "a corner does not exclude a node",
        })
    }
}

impl core::error::Error for ProofError {}

impl Proof {
    /// Checks the proof against the triangles that it was made for. Takes some 20 times as long as a node of
    /// the search, for each node.
    ///
    /// # Errors
    /// [`ProofError`] if a step does not hold. A proof for other triangles may fail in any way, or hold by
    /// chance.
    pub fn check(&self, triangles: &SceneTriangles) -> Result<(), ProofError> {
        if let Target::Triangle(t) = self.target
            && t as usize >= triangles.len()
        {
            return Err(ProofError::Malformed);
        }
        let delta = position_error(triangles, &self.cell, self.target, self.clearance);
        let delta = delta.ok_or(ProofError::Malformed)?;
        let target_vertices = match self.target {
            Target::Triangle(t) if self.clearance == 0.0 => triangles.vertices(t).to_vec(),
            _ => Vec::new(),
        };
        let mut check =
            Check { triangles, clearance: self.clearance, delta, target_vertices, steps: self.steps.iter() };
        let all = sights(triangles, &self.cell, self.target, self.clearance, 4.0 * delta);
        for sight in all.ok_or(ProofError::Malformed)? {
            check.node(&sight, &mut Vec::new(), 0)?;
        }
        if check.steps.next().is_some() { Err(ProofError::Malformed) } else { Ok(()) }
    }
}

/// Greatest depth of nodes.
const DEPTH: usize = 400;

/// A point, and the corner of the target triangle that it is.
type Corner = (DVec3, Option<usize>);

/// An edge and the sign of the side on which lines pass it.
type Divider = ([Corner; 2], f64);

/// A number with 106 bits.
type D = DoubleDouble;

struct Check<'a> {
    triangles: &'a SceneTriangles,
    clearance: f64,
    delta: f64,
    target_vertices: Vec<u32>,
    steps: core::slice::Iter<'a, Step>,
}

fn difference(a: DVec3, b: DVec3) -> [D; 3] {
    [D::difference(a.x, b.x), D::difference(a.y, b.y), D::difference(a.z, b.z)]
}

fn cross(a: [D; 3], b: [D; 3]) -> [D; 3] {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| a[i].times(b[j]).plus(a[j].times(b[i]).negated()))
}

fn dot(a: [D; 3], b: [D; 3]) -> D {
    a[0].times(b[0]).plus(a[1].times(b[1])).plus(a[2].times(b[2]))
}

/// Returns the sum of the magnitudes.
fn norm(a: [D; 3]) -> f64 {
    a.iter().map(|x| x.hi.abs()).sum()
}

/// Returns det(q - p, a - p, b - p), and by how much it may change if each coordinate changes by `delta`.
///
/// To first order the change is delta times the sum of the magnitudes of the derivatives, which for each
/// point are the cross product of two differences of the others; twice that covers higher orders where the
/// value is not smaller than the bound. Rounding of double-double arithmetic is below 2^-90 of the products.
fn side(p: DVec3, q: DVec3, a: DVec3, b: DVec3, delta: f64) -> (f64, f64) {
    let (r, u, w) = (difference(q, p), difference(a, p), difference(b, p));
    let normal = cross(u, w);
    let value = dot(r, normal).hi;
    let opposite = cross(difference(a, q), difference(b, q));
    let slopes = norm(normal) + norm(opposite) + norm(cross(r, w)) + norm(cross(r, u));
    let rounding = norm(r) * norm(u) * norm(w) * 1e-27;
    (value, 2.0 * delta * slopes + rounding)
}

impl Check<'_> {
    fn node(&mut self, sight: &Sight, rows: &mut Vec<Divider>, depth: usize) -> Result<(), ProofError> {
        let step = self.steps.next().ok_or(ProofError::Malformed)?;
        if depth > DEPTH {
            return Err(ProofError::Malformed);
        }
        match step {
            Step::Halves { of_p, across } => {
                for half in sight.halves(*of_p, *across) {
                    self.node(&half, rows, depth + 1)?;
                }
                Ok(())
            }
            Step::Surface { triangles, moved, line } => {
                let holds = self.surface_blocks(sight, triangles, moved, *line);
                holds.then_some(()).ok_or(ProofError::Surface)
            }
            Step::Empty { weights } => {
                self.excludes(sight, rows, weights).then_some(()).ok_or(ProofError::Weights)
            }
            Step::Corner { edges } => {
                let three = edges.map(|k| rows.get(k as usize));
                let [Some(a), Some(b), Some(c)] = three else { return Err(ProofError::Malformed) };
                self.corner_excludes(sight, [a, b, c]).then_some(()).ok_or(ProofError::Corner)
            }
            Step::Loop { piece, ring, side, edges } => {
                let ring: Vec<Corner> =
                    ring.iter().map(|&(x, tag)| (x, (tag < 3).then_some(usize::from(tag)))).collect();
                if ring.len() < 3 || ring.len() != edges.len() || side.abs() != 1.0 {
                    return Err(ProofError::Malformed);
                }
                if !self.is_on_piece(sight, *piece, &ring) {
                    return Err(ProofError::Loop);
                }
                let base = rows.len();
                let mut inside: Vec<Divider> = Vec::new();
                for (k, found) in edges.iter().enumerate() {
                    let edge = [ring[k], ring[(k + 1) % ring.len()]];
                    match found {
                        LoopEdge::Inside if self.is_on_side(sight, &edge, *side) => {}
                        LoopEdge::Inside => return Err(ProofError::Loop),
                        LoopEdge::Never { weights } => {
                            rows.push((edge, -side));
                            let holds = self.excludes(sight, rows, weights);
                            rows.truncate(base);
                            if !holds {
                                return Err(ProofError::Weights);
                            }
                        }
                        LoopEdge::Divides => inside.push((edge, *side)),
                    }
                }
                for k in 0..inside.len() {
                    rows.truncate(base);
                    rows.extend_from_slice(&inside[..k]);
                    rows.push((inside[k].0, -side));
                    self.node(sight, rows, depth + 1)?;
                }
                rows.truncate(base);
                Ok(())
            }
        }
    }

    fn tag(&self, vertex: u32) -> Option<usize> {
        self.target_vertices.iter().position(|&v| v == vertex)
    }

    /// Returns the sides of an edge, with errors, at the pairs of corners. A side is exactly 0 where the
    /// corner of Q is a mixture of ends of the edge.
    fn sides<'b>(&'b self, sight: &'b Sight, edge: &'b [Corner; 2]) -> impl Iterator<Item = (f64, f64)> + 'b {
        let [(a, tag_a), (b, tag_b)] = *edge;
        let ends = tag_a.map_or(0, |k| 1u8 << k) | tag_b.map_or(0, |k| 1 << k);
        sight.p.corners().iter().flat_map(move |&p| {
            sight.q.corners().iter().zip(&sight.q.zero).map(move |(&q, &zero)| {
                let support = 0b111 ^ zero;
                let is_mixture = zero != 0 && support & !ends == 0;
                if is_mixture { (0.0, 0.0) } else { side(p, q, a, b, self.delta) }
            })
        })
    }

    /// Returns whether all segments pass an edge on one side, apart from those to the boundary of Q that meet
    /// it there.
    fn is_on_side(&self, sight: &Sight, edge: &[Corner; 2], sign: f64) -> bool {
        let mut some = false;
        let all = self.sides(sight, edge).all(|(value, error)| {
            some |= value != 0.0;
            (value == 0.0 && error == 0.0) || value * sign > error
        });
        all && some
    }

    /// Returns whether no segment meets an edge, by its side or by a plane that separates it from both
    /// polygons.
    fn is_missed(&self, sight: &Sight, edge: &[Corner; 2]) -> bool {
        let ends = [edge[0].0, edge[1].0];
        let behind = |(x, tag): Corner| tag.is_some() || sight.before_q.height(x) < -3.0 * self.delta;
        self.is_outside(sight, &ends)
            || (edge.iter().any(|end| end.1.is_some()) && edge.iter().all(|&end| behind(end)))
            || self.is_on_side(sight, edge, 1.0)
            || self.is_on_side(sight, edge, -1.0)
    }

    /// Returns whether a plane separates some points from the convex hull of both polygons.
    fn is_outside(&self, sight: &Sight, points: &[DVec3]) -> bool {
        let (p, q) = (sight.p.corners(), sight.q.corners());
        let hull: Vec<DVec3> = p.iter().chain(q).copied().collect();
        let separates = |normal: DVec3| self.separates(normal, points, &hull);
        if separates(sight.p.normal()) || separates(sight.q.normal()) {
            return true;
        }
        [(p, q), (q, p)].into_iter().any(|(one, other)| {
            (0..one.len()).any(|i| {
                let (u, v) = (one[i], one[(i + 1) % one.len()]);
                other.iter().any(|&w| separates((v - u).cross(w - u)))
            })
        })
    }

    /// Returns whether points and others have heights over a plane that are apart by more than three times
    /// the error of positions.
    fn separates(&self, normal: DVec3, points: &[DVec3], others: &[DVec3]) -> bool {
        let normal = normal.normalize_or_zero();
        let direction = normal.to_array().map(D::from);
        let range = |points: &[DVec3]| {
            let heights = points.iter().map(|x| dot(direction, x.to_array().map(D::from)).hi);
            heights.fold((f64::MAX, f64::MIN), |(a, b), h| (a.min(h), b.max(h)))
        };
        let ((a, b), (c, d)) = (range(points), range(others));
        let margin = 3.0 * self.delta;
        a > d + margin || b < c - margin
    }

    /// Returns whether a polygon of points touches neither P nor Q.
    fn is_apart(&self, sight: &Sight, points: &[DVec3]) -> bool {
        let apart = |polygon: &Polygon, plane: &Half| {
            let (n, corners) = (points.len(), polygon.corners());
            let side = |k: usize| points[(k + 1) % n] - points[k % n];
            let separates = |normal: DVec3| self.separates(normal, points, corners);
            separates(plane.normal)
                || separates(side(0).normalize_or_zero().cross(side(1).normalize_or_zero()))
                || (0..corners.len()).any(|i| {
                    let along = (corners[(i + 1) % corners.len()] - corners[i]).normalize_or_zero();
                    separates(plane.normal.cross(along))
                        || (0..n).any(|k| separates(along.cross(side(k).normalize_or_zero())))
                })
        };
        apart(&sight.p, &sight.before_p) && apart(&sight.q, &sight.before_q)
    }

    fn surface_blocks(
        &self,
        sight: &Sight,
        surface: &[u32],
        moved: &[(u32, DVec3)],
        line: [DVec3; 2],
    ) -> bool {
        let all = self.triangles;
        let is_usable = |t: u32| (t as usize) < all.len() && all.occludes(t);
        if !surface.iter().all(|&t| is_usable(t))
            || !is_in(&sight.p, line[0], self.delta)
            || !is_in(&sight.q, line[1], self.delta)
        {
            return false;
        }
        let moved: BTreeMap<u32, DVec3> = moved.iter().copied().collect();
        let mut boundary: BTreeMap<[u32; 2], [DVec3; 2]> = BTreeMap::new();
        let mut crossings = 0;
        for &t in surface {
            let (numbers, corners) = (all.vertices(t), all.corners(t));
            for k in 0..3 {
                let (a, b) = ((numbers[k], corners[k]), (numbers[(k + 1) % 3], corners[(k + 1) % 3]));
                let (a, b) = if a.0 < b.0 { (a, b) } else { (b, a) };
                if boundary.remove(&[a.0, b.0]).is_none() {
                    boundary.insert([a.0, b.0], [a.1, b.1]);
                }
            }
            let tags = numbers.map(|v| self.tag(v));
            if !(self.is_outside(sight, &corners)
                || self.is_apart(sight, &corners)
                || self.touches_beside(sight, &corners, tags))
            {
                return false;
            }
            match crosses(line, &corners) {
                Some(crosses) => crossings += u32::from(crosses),
                None => return false,
            }
        }
        for (&[v, w], &[a, b]) in &boundary {
            let place = |v: u32, x: DVec3| moved.get(&v).copied().unwrap_or(x);
            let (c, d) = (place(v, a), place(w, b));
            // A NaN must fail.
            let near = |x: DVec3, y: DVec3| x.distance(y) <= 3.0 * self.clearance;
            if !near(a, c) || !near(b, d) || !self.is_missed(sight, &[(c, self.tag(v)), (d, self.tag(w))]) {
                return false;
            }
            if (a, b) == (c, d) {
                continue;
            }
            if (c != a && self.tag(v).is_some()) || (d != b && self.tag(w).is_some()) {
                return false;
            }
            let strip = [a, b, d, c];
            if !(self.is_outside(sight, &strip) || self.is_apart(sight, &strip)) {
                return false;
            }
            for t in [[a, b, d], [a, d, c]] {
                if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
                    continue;
                }
                match crosses(line, &t) {
                    Some(crosses) => crossings += u32::from(crosses),
                    None => return false,
                }
            }
        }
        crossings % 2 == 1
    }

    /// Returns whether a triangle touches Q at most at its boundary: it has corners of the target triangle,
    /// its other corners are on one side of Q's plane, and it is apart from P.
    fn touches_beside(&self, sight: &Sight, corners: &[DVec3; 3], tags: [Option<usize>; 3]) -> bool {
        let heights: Vec<f64> =
            (0..3).filter(|&k| tags[k].is_none()).map(|k| sight.before_q.height(corners[k])).collect();
        let margin = 3.0 * self.delta;
        let on_one_side = heights.iter().all(|h| *h > margin) || heights.iter().all(|h| *h < -margin);
        let apart_from_p = self.is_apart(&Sight { q: sight.p, before_q: sight.before_p, ..*sight }, corners);
        (1..3).contains(&heights.len()) && on_one_side && apart_from_p
    }

    /// Returns whether weights of rows make the sum of their sides negative at all pairs of corners.
    fn excludes(&self, sight: &Sight, rows: &[Divider], weights: &[f64]) -> bool {
        if weights.len() != rows.len() || weights.iter().any(|w| w.is_nan() || *w < 0.0) {
            return false;
        }
        let pairs = sight.p.corners().len() * sight.q.corners().len();
        let mut sums = alloc::vec![(0.0, 0.0); pairs];
        for ((edge, sign), weight) in rows.iter().zip(weights) {
            for (sum, (value, error)) in sums.iter_mut().zip(self.sides(sight, edge)) {
                let term = value * sign * weight;
                sum.0 += term;
                sum.1 += error * weight + term.abs() * 1e-15;
            }
        }
        sums.iter().all(|(value, error)| *value < -*error)
    }

    /// Returns whether three edges exclude all lines, by the form of degree two. With directions t_k times
    /// signs, and without division: det d = sum of L_k t_k for L_k = (t_i x t_j) . d. The sum of
    /// L_k (side on edge k) is then, up to the common factor, the form at d, whatever p is.
    fn corner_excludes(&self, sight: &Sight, rows: [&Divider; 3]) -> bool {
        let sign = |x: f64| D::from(x);
        let t = rows.map(|([a, b], s)| difference(b.0, a.0).map(|x| x.times(sign(*s))));
        let c = [cross(t[1], t[2]), cross(t[2], t[0]), cross(t[0], t[1])];
        let determinant = dot(t[0], c[0]).hi;
        let orientation = if determinant > 0.0 { 1.0 } else { -1.0 };
        let v = rows[0].0[0].0;
        let e = rows.map(|([a, _], _)| difference(a.0, v));
        let w: [[D; 3]; 3] = core::array::from_fn(|k| cross(e[k], t[k]));
        let directions: Vec<[D; 3]> = sight
            .p
            .corners()
            .iter()
            .flat_map(|&p| sight.q.corners().iter().map(move |&q| difference(q, p)))
            .collect();
        let (Some(first), true) = (directions.first(), determinant.abs() > 0.0) else { return false };
        // Changes of directions by 2 delta on each axis.
        let change = 2.0 * self.delta;
        let level = dot(c[0], *first).hi * orientation;
        let sense = if level > 0.0 { 1.0 } else { -1.0 };
        let positive = directions
            .iter()
            .all(|d| c.iter().all(|c| dot(*c, *d).hi * orientation * sense > norm(*c) * change));
        let rounding: f64 = (0..3).map(|k| norm(c[k]) * norm(w[k])).sum::<f64>() * 1e-24;
        positive
            && directions.iter().enumerate().all(|(i, x)| {
                directions[i..].iter().all(|y| {
                    let (mut form, mut error) = (0.0, rounding * norm(*x) * norm(*y));
                    for k in 0..3 {
                        let both =
                            dot(c[k], *x).times(dot(w[k], *y)).plus(dot(c[k], *y).times(dot(w[k], *x)));
                        form += both.hi * orientation * sense;
                        error += both.hi.abs() * 1e-15
                            + 2.0 * change * norm(c[k]) * norm(w[k]) * (norm(*x) + norm(*y) + change);
                    }
                    form < -error
                })
            })
    }

    /// Returns whether the corners of a loop are between the planes of P and Q and within three clearances of
    /// a convex polygon of occluding triangles: then a surface that the loop bounds is. Corners that are not
    /// the target triangle's, at least one, must certainly be before Q's plane.
    fn is_on_piece(&self, sight: &Sight, number: u32, ring: &[Corner]) -> bool {
        let Some(triangles) = self.triangles.piece_triangles(number) else { return false };
        let corners: Vec<[DVec3; 3]> = triangles.iter().map(|&t| self.triangles.corners(t)).collect();
        let [first, ..] = corners.as_slice() else { return false };
        if !triangles.iter().all(|&t| self.triangles.occludes(t)) {
            return false;
        }
        let Some(normal) = unit_normal(first) else { return false };
        let flat = corners.iter().flatten().all(|x| normal.dot(*x - first[0]).abs() <= 3.0 * self.delta);
        // Sides of one triangle alone have all corners on their inner side.
        let mut sides: BTreeMap<[u32; 2], [DVec3; 2]> = BTreeMap::new();
        for (&t, x) in triangles.iter().zip(&corners) {
            let v = self.triangles.vertices(t);
            for k in 0..3 {
                let (key, ends) = ([v[k], v[(k + 1) % 3]], [x[k], x[(k + 1) % 3]]);
                if sides.remove(&[key[1], key[0]]).is_none() {
                    sides.insert(key, ends);
                }
            }
        }
        let is_convex = sides.values().all(|[a, b]| {
            let inwards = normal.cross(*b - *a).normalize_or_zero();
            corners.iter().flatten().all(|x| inwards.dot(*x - *a) >= -3.0 * self.delta)
        });
        let reach = 3.0 * self.clearance + 2.0 * self.delta;
        let is_near = |x: DVec3| corners.iter().any(|t| distance(x, t) <= reach);
        let in_slab = |(x, tag): Corner| {
            sight.before_p.height(x) >= -4.0 * self.delta
                && (tag.is_some() || sight.before_q.height(x) > 3.0 * self.delta)
        };
        // What is coplanar with Q blocks nothing.
        let leaves_plane = ring.iter().any(|corner| corner.1.is_none());
        let tags_hold = |(x, tag): Corner| {
            tag.is_none_or(|k| {
                let vertex = self.target_vertices.get(k);
                triangles.iter().any(|&t| {
                    (0..3).any(|j| {
                        Some(&self.triangles.vertices(t)[j]) == vertex && self.triangles.corners(t)[j] == x
                    })
                })
            })
        };
        flat && is_convex
            && leaves_plane
            && ring.iter().all(|&corner| is_near(corner.0) && in_slab(corner) && tags_hold(corner))
    }
}

/// Returns whether a segment crosses the inside of a triangle; `None` if it may touch the boundary, or the
/// plane at an end.
fn crosses([p, q]: [DVec3; 2], t: &[DVec3; 3]) -> Option<bool> {
    let sign = |(value, error): (f64, f64)| i32::from(value > error) - i32::from(value < -error);
    let s: [i32; 3] = core::array::from_fn(|k| sign(side(p, q, t[k], t[(k + 1) % 3], 0.0)));
    let ends = [p, q].map(|x| sign(side(x, t[0], t[1], t[2], 0.0)));
    let winds = s[0] != 0 && s[0] == s[1] && s[1] == s[2];
    if (s.contains(&1) && s.contains(&-1)) || ends[0] * ends[1] > 0 {
        Some(false)
    } else if winds && ends[0] * ends[1] < 0 {
        Some(true)
    } else {
        None
    }
}

/// Returns whether a point is in a convex polygon, up to `delta`.
fn is_in(polygon: &Polygon, x: DVec3, delta: f64) -> bool {
    let (normal, corners) = (polygon.normal().normalize_or_zero(), polygon.corners());
    normal.dot(x - corners[0]).abs() <= delta
        && (0..corners.len()).all(|k| {
            let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
            normal.cross(b - a).normalize_or_zero().dot(x - a) >= -delta
        })
}

/// Returns the distance of a point from a triangle.
fn distance(x: DVec3, t: &[DVec3; 3]) -> f64 {
    let normal = (t[1] - t[0]).cross(t[2] - t[0]);
    let inside = (0..3).all(|k| normal.cross(t[(k + 1) % 3] - t[k]).dot(x - t[k]) >= 0.0);
    if inside {
        return normal.normalize_or_zero().dot(x - t[0]).abs();
    }
    (0..3).fold(f64::INFINITY, |least, k| {
        let (a, along) = (t[k], t[(k + 1) % 3] - t[k]);
        let part = ((x - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        least.min(x.distance(a + along * part))
    })
}
