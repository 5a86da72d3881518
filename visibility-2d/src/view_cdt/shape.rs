//! Occluders as shapes in the image: half-planes whose intersection is certainly covered, and depth.
//!
//! A shape consists of triangles of a mesh that certainly face the eye, cut at the near plane. Its contour
//! consists of the edges with only one such triangle, and of the cuts. A point strictly on the inner side of
//! all contour lines is covered: every contour edge runs around the point in the same sense, so the contour
//! winds around it at least once, and the winding number is the number of triangles that cover the point.
//!
//! # Bounds
//! Let `e` be the errors of corners and `S` their sizes with error. A component `a_j b_k - a_k b_j` of a
//! cross product has an error of at most `2 (e_j S_k + S_j e_k)`, and a rounding below `4 u S_j S_k`; the
//! code uses `8 u`. A determinant `a . (b x c)` has the errors of `a` times the size `2 S_j S_k` of the cross
//! product, and the error of the cross product times the size of `a`.

use super::screen::{Corner, Projected, REACH, U};
use alloc::vec::Vec;
use core::ops::Range;
use visibility_core::OccluderMesh;

/// Distance, in grid units, by which the sides of an outline are moved inwards before its vertices are
/// rounded to the grid, so that rounded vertices stay inside the occluder.
const INSET: f64 = 1.0;

/// Maximum number of triangles of a shape that is not a convex solid.
const MAX_JOINED: usize = 16;

/// Linear function `a x + b y + c` of grid coordinates.
pub(crate) type Line = [f64; 3];

pub(crate) fn at([a, b, c]: Line, [x, y]: [f64; 2]) -> f64 {
    a * x + b * y + c
}

/// Area of the image that an occluder covers, and its depth, as ranges of the lists in [`Shapes`].
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    /// Range, in [`Shapes::lines`], of linear functions of grid coordinates. A point at which all of them are
    /// positive is covered by the occluder.
    pub(crate) lines: Range<usize>,
    /// Range, in [`Shapes::planes`], of linear functions of grid coordinates, one for each triangle of the
    /// shape. The least of their values at a point is a lower bound on the occluder's depth key there
    /// (greater is nearer).
    pub(crate) planes: Range<usize>,
    /// Range, in [`Shapes::outlines`], of the vertices of the shape's outline, counter-clockwise, in grid
    /// units.
    pub(crate) outline: Range<usize>,
    /// Lower bound on the occluder's depth keys (greater is nearer) at all points of the shape.
    pub(crate) floor: f64,
}

/// Shapes of the occluders in a frame, and the lists that hold their lines, planes and outlines.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shapes {
    /// Shapes of the frame, in the order in which they were added.
    pub(crate) list: Vec<Shape>,
    /// Half-planes of all shapes, one shape after another: see [`Shape::lines`].
    pub(crate) lines: Vec<Line>,
    /// Bounds on the depth keys of all shapes, one shape after another: see [`Shape::planes`].
    pub(crate) planes: Vec<Line>,
    /// Vertices of the outlines of all shapes in grid units, one shape after another: see [`Shape::outline`].
    pub(crate) outlines: Vec<[f64; 2]>,
    clipped: Vec<[f64; 2]>,
    /// For each triangle of the mesh that is being added, whether it is in a shape.
    states: Vec<State>,
    /// Indices, in the mesh, of the triangles of the shape that is being made.
    joined: Vec<u32>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum State {
    /// The triangle does not occlude, or is in an earlier shape.
    Unused,
    /// The triangle faces the eye and is not in a shape yet.
    Free,
    /// The triangle is in the shape under construction.
    Joined,
}

fn cross(a: &Corner, b: &Corner) -> Line {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(line: Line, a: &Corner) -> f64 {
    line[0] * a[0] + line[1] * a[1] + line[2] * a[2]
}

/// Projected mesh, with bounds that hold for all of its corners.
struct Meshed<'a> {
    mesh: &'a OccluderMesh,
    corners: &'a [Corner],
    /// Upper bound on the magnitude of each of the five values of a corner.
    size: &'a Corner,
    /// Upper bound on the error of each of the five values of a corner.
    error: &'a Corner,
    /// Sign of the determinant of a triangle's corners `(x, y, w)` that triangles of the shape must have: the
    /// sign of those that face the eye.
    facing: f64,
    /// Least distance beyond the near plane (the fifth value of a corner), at which geometry is cut.
    limit: f64,
    /// Bounds on the errors of the components of the cross product of two corners `(x, y, w)`.
    of_cross: Line,
    /// Bound on the error of the determinant of three corners `(x, y, w)`.
    of_determinant: f64,
}

impl<'a> Meshed<'a> {
    fn new(mesh: &'a OccluderMesh, of: &'a Projected, facing: f64) -> Self {
        let (s, e) = (&of.size, &of.error);
        let of_product = |j: usize, k: usize| 2.0 * (e[j] * s[k] + s[j] * e[k]) + 8.0 * U * s[j] * s[k];
        let of_cross = [of_product(1, 2), of_product(2, 0), of_product(0, 1)];
        let of_determinant = (0..3)
            .map(|i| {
                let crossed = 2.0 * s[(i + 1) % 3] * s[(i + 2) % 3];
                e[i] * crossed + s[i] * of_cross[i] + 16.0 * U * s[i] * crossed
            })
            .sum();
        // A cut at the computed distance `limit` is certainly beyond the near plane: its error is `e` plus
        // the rounding of the interpolation.
        let limit = 2.0 * e[4] + 16.0 * U * s[4];
        Self { mesh, corners: &of.corners, size: s, error: e, facing, limit, of_cross, of_determinant }
    }

    fn corner(&self, vertex: u32) -> &Corner {
        &self.corners[vertex as usize]
    }

    fn is_beyond(&self, vertex: u32) -> bool {
        self.corner(vertex)[4] > self.limit
    }

    /// Returns a linear function that is positive only on the inner side of the edge from `a` to `b`: the
    /// edge's line, lowered by a bound on its error in the triangulated rectangle.
    fn line(&self, a: &Corner, b: &Corner) -> Line {
        let line = cross(a, b).map(|x| x * self.facing);
        let size = REACH * (line[0].abs() + line[1].abs()) + line[2].abs();
        let error = REACH * (self.of_cross[0] + self.of_cross[1]) + self.of_cross[2] + 8.0 * U * size;
        [line[0], line[1], line[2] - error]
    }

    /// Returns whether a triangle certainly faces the same way as the shape, and reaches beyond the near
    /// plane.
    fn is_drawn(&self, [a, b, c]: [u32; 3]) -> bool {
        let determinant = dot(cross(self.corner(b), self.corner(c)), self.corner(a));
        determinant * self.facing > self.of_determinant && [a, b, c].iter().any(|&v| self.is_beyond(v))
    }

    /// Returns a linear function of grid coordinates that is a lower bound on the depth key of a triangle's
    /// plane, at all points of the grid. `None` if rounding leaves the plane undecided.
    ///
    /// Let a, b and c be the corners `(x, y, w)`, and `n_a`, `n_b` and `n_c` their values `n`. By Cramer's
    /// rule, the coefficients of the key are `n_a (b x c) + n_b (c x a) + n_c (a x b)` over the determinant.
    fn depth_plane(&self, t: [u32; 3]) -> Option<Line> {
        let [a, b, c] = t.map(|v| self.corner(v));
        let (bc, ca, ab) = (cross(b, c), cross(c, a), cross(a, b));
        let determinant = dot(bc, a);
        let least = determinant.abs() - self.of_determinant;
        let plane: Line =
            core::array::from_fn(|i| (a[3] * bc[i] + b[3] * ca[i] + c[3] * ab[i]) / determinant);
        let (s, e) = (self.size, self.error);
        let numerator = |i: usize| {
            let crossed = 2.0 * s[(i + 1) % 3] * s[(i + 2) % 3];
            3.0 * (s[3] * self.of_cross[i] + e[3] * crossed) + 64.0 * U * s[3] * crossed
        };
        let of_numerator = REACH * (numerator(0) + numerator(1)) + numerator(2);
        let size = REACH * (plane[0].abs() + plane[1].abs()) + plane[2].abs();
        let error = (of_numerator + size * self.of_determinant) / least + 32.0 * U * size;
        (least > 0.0 && error.is_finite()).then_some([plane[0], plane[1], plane[2] - error])
    }

    /// Returns the point where an edge crosses the near limit. Exchanging `a` and `b` gives the bit-identical
    /// result.
    fn cut(&self, a: u32, b: u32) -> Corner {
        let (a, b) = if self.is_beyond(b) { (a, b) } else { (b, a) };
        let (a, b) = (self.corner(a), self.corner(b));
        let share = (self.limit - a[4]) / (b[4] - a[4]);
        core::array::from_fn(|i| a[i] * (1.0 - share) + b[i] * share)
    }
}

impl Shapes {
    pub(crate) fn clear(&mut self) {
        self.list.clear();
        self.lines.clear();
        self.planes.clear();
        self.outlines.clear();
    }

    /// Adds the shapes of a mesh: one for a convex solid, otherwise one for each group of neighbouring
    /// triangles that together look convex. `facing` is the sign of the determinant of triangles that face
    /// the eye.
    pub(crate) fn add(&mut self, mesh: &OccluderMesh, projected: &Projected, facing: f64) {
        for facing in [facing, -facing] {
            let of = Meshed::new(mesh, projected, facing);
            self.states.clear();
            let state = |t: &[u32; 3]| if of.is_drawn(*t) { State::Free } else { State::Unused };
            self.states.extend(mesh.triangles().iter().map(state));
            for seed in 0..self.states.len() as u32 {
                if self.states[seed as usize] == State::Free {
                    self.join(&of, seed);
                    self.finish(&of);
                }
            }
            if !mesh.is_two_sided() {
                break;
            }
        }
    }

    /// Collects the triangles of a shape, starting with the triangle `seed`.
    fn join(&mut self, of: &Meshed<'_>, seed: u32) {
        self.joined.clear();
        if of.mesh.is_convex() {
            let free = (0u32..).zip(&mut self.states).filter(|(_, state)| **state == State::Free);
            self.joined.extend(free.map(|(t, state)| {
                *state = State::Joined;
                t
            }));
            return;
        }
        self.states[seed as usize] = State::Joined;
        self.joined.push(seed);
        let mut index = 0;
        while index < self.joined.len() {
            for edge in of.mesh.triangle_edges()[self.joined[index] as usize] {
                let edge = of.mesh.edges()[edge as usize];
                let Some(right) = edge.right else { continue };
                let other = if edge.left == self.joined[index] { right } else { edge.left };
                if self.states[other as usize] == State::Free && self.joined.len() < MAX_JOINED {
                    self.states[other as usize] = State::Joined;
                    self.joined.push(other);
                    if !self.looks_convex(of) {
                        self.joined.pop();
                        self.states[other as usize] = State::Free;
                    }
                }
            }
            index += 1;
        }
    }

    /// Returns whether all corners of the shape are on the inner side of its contour. Rounding does no harm,
    /// because this only decides which triangles are joined.
    fn looks_convex(&mut self, of: &Meshed<'_>) -> bool {
        let first = self.lines.len();
        self.push_contour(of);
        let triangles = self.joined.iter().flat_map(|&t| of.mesh.triangles()[t as usize]);
        let is_inside = |vertex: u32| {
            let corner = of.corner(vertex);
            let is_behind = |line: &Line| {
                let scale = corner[2].abs() * (line[0].abs() + line[1].abs()) + f64::MIN_POSITIVE;
                dot(*line, corner) >= -0.25 * scale
            };
            corner[4] > of.limit && self.lines[first..].iter().all(is_behind)
        };
        let convex = triangles.into_iter().all(is_inside);
        self.lines.truncate(first);
        convex
    }

    fn push_contour(&mut self, of: &Meshed<'_>) {
        for &t in &self.joined {
            let triangle = of.mesh.triangles()[t as usize];
            let edges = of.mesh.triangle_edges()[t as usize];
            for k in 0..3 {
                let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                let edge = of.mesh.edges()[edges[k] as usize];
                let other = if edge.left == t { edge.right } else { Some(edge.left) };
                let is_inner = other.is_some_and(|t| self.states[t as usize] == State::Joined);
                if !is_inner && (of.is_beyond(a) || of.is_beyond(b)) {
                    self.lines.push(of.line(of.corner(a), of.corner(b)));
                }
            }
            // Points where the triangle's outline crosses the near limit: leaving the part beyond it, and
            // coming back.
            let find = |leaves: bool| {
                (0..3)
                    .map(|k| (triangle[k], triangle[(k + 1) % 3]))
                    .find(|&(a, b)| of.is_beyond(a) == leaves && of.is_beyond(b) != leaves)
            };
            if let (Some((a, b)), Some((c, d))) = (find(true), find(false)) {
                self.lines.push(of.line(&of.cut(a, b), &of.cut(c, d)));
            }
        }
    }

    /// Makes a shape of the collected triangles. Does nothing if it has no outline in the image.
    fn finish(&mut self, of: &Meshed<'_>) {
        let starts = [self.lines.len(), self.planes.len(), self.outlines.len()];
        self.push_contour(of);
        let mut floor = f64::INFINITY;
        for &t in &self.joined {
            let triangle = of.mesh.triangles()[t as usize];
            for vertex in triangle {
                let [_, _, w, n, _] = *of.corner(vertex);
                let q = n / w;
                let margin = 2.0 * ((of.error[3] + q.abs() * of.error[2]) / w + 4.0 * U * q.abs());
                if w > 1024.0 * of.error[2] {
                    // A corner before the near plane counts too, since an oblique near plane may cut the
                    // triangle as far away as this corner.
                    floor = floor.min(q - margin);
                } else if w > 0.0 || of.is_beyond(vertex) {
                    floor = f64::NEG_INFINITY;
                }
            }
            // Without a depth plane, only the least key of all corners is used.
            self.planes.push(of.depth_plane(triangle).unwrap_or([0.0, 0.0, f64::NEG_INFINITY]));
        }
        for &t in &self.joined {
            self.states[t as usize] = State::Unused;
        }
        if self.lines.len() > starts[0] && self.push_outline(starts[0]) {
            self.list.push(Shape {
                lines: starts[0]..self.lines.len(),
                planes: starts[1]..self.planes.len(),
                outline: starts[2]..self.outlines.len(),
                floor,
            });
        } else {
            self.lines.truncate(starts[0]);
            self.planes.truncate(starts[1]);
            self.outlines.truncate(starts[2]);
        }
    }

    /// Adds the outline of the points inside all lines from `first` on, moved inwards and rounded to the
    /// grid. Returns false if fewer than three vertices remain. The outline need not be exact, because only
    /// triangles whose corners are inside the lines are filled.
    fn push_outline(&mut self, first: usize) -> bool {
        let begin = self.outlines.len();
        let (low, high) = (-0.5 * super::screen::RIM, REACH - 0.5 * super::screen::RIM);
        self.outlines.extend([[low, low], [high, low], [high, high], [low, high]]);
        // Clips the square around the whole grid by each line in turn (Sutherland-Hodgman).
        for &line in &self.lines[first..] {
            let inset = INSET * (line[0].abs() + line[1].abs());
            let height = |p| at(line, p) - inset;
            self.clipped.clear();
            let count = self.outlines.len() - begin;
            for k in 0..count {
                let [p, q] = [k, (k + 1) % count].map(|k| self.outlines[begin + k]);
                let (of_p, of_q) = (height(p), height(q));
                if of_p >= 0.0 {
                    self.clipped.push(p);
                }
                if (of_p >= 0.0) != (of_q >= 0.0) {
                    let share = of_p / (of_p - of_q);
                    self.clipped.push([0, 1].map(|axis| p[axis] + share * (q[axis] - p[axis])));
                }
            }
            self.outlines.truncate(begin);
            self.outlines.append(&mut self.clipped);
        }
        // Neighbouring vertices that rounding makes equal are dropped.
        for p in &mut self.outlines[begin..] {
            *p = p.map(round);
        }
        let mut kept = begin;
        for index in begin..self.outlines.len() {
            let p = self.outlines[index];
            if kept == begin || self.outlines[kept - 1] != p {
                self.outlines[kept] = p;
                kept += 1;
            }
        }
        while kept > begin + 1 && self.outlines[kept - 1] == self.outlines[begin] {
            kept -= 1;
        }
        self.outlines.truncate(kept);
        kept - begin >= 3 && self.outlines[begin..].iter().flatten().all(|x| x.abs() <= REACH)
    }
}

/// Rounds to the nearest integer, for magnitudes up to 2^51. Numbers from 2^52 to 2^53 have no bits for
/// fractions, so adding a number of this size rounds.
fn round(x: f64) -> f64 {
    const WHOLE: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52
    (x + WHOLE) - WHOLE
}

#[cfg(test)]
mod tests {
    use super::super::screen::{GRID, Screen};
    use super::*;
    use visibility_core::glam::{Affine3A, DVec3, Vec3};
    use visibility_core::{Aabb, Pose, View};
    use visibility_testing::{Random, sign_of_sum};

    /// Corner in whole numbers: `x`, `y`, `w`, `n` and the distance beyond the near plane.
    type Whole = [i128; 5];

    /// Returns the exact determinant of the `x`, `y` and `w` of three corners.
    fn determinant(a: &Whole, b: &Whole, c: &Whole) -> i128 {
        (0..3).map(|i| a[i] * (b[(i + 1) % 3] * c[(i + 2) % 3] - b[(i + 2) % 3] * c[(i + 1) % 3])).sum()
    }

    /// Returns a grid point as a corner.
    fn point([x, y]: [i128; 2]) -> Whole {
        [x, y, 1, 0, 0]
    }

    /// Returns a corner with each of its values moved up or down by its error, as the bits of `signs` say.
    fn moved(corner: &Whole, error: &Whole, signs: u64) -> Whole {
        core::array::from_fn(|i| corner[i] + if signs >> i & 1 == 0 { error[i] } else { -error[i] })
    }

    fn triangle() -> OccluderMesh {
        OccluderMesh::from_triangles(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]).unwrap()
    }

    /// Returns corners with an error, and the sizes that they have with it. Errors may be nothing, which
    /// leaves rounding alone.
    fn projected(corners: &[Whole], error: &Whole) -> Projected {
        let float = |values: &Whole| values.map(|x| x as f64);
        let size = core::array::from_fn(|i| {
            corners.iter().map(|corner| (corner[i].abs() + error[i]) as f64).fold(0.0, f64::max)
        });
        Projected { corners: corners.iter().map(float).collect(), error: float(error), size }
    }

    /// Whole numbers from minus to plus `2^bits`.
    fn number(random: &mut Random, bits: u32) -> i128 {
        i128::from((random.bits() >> (63 - bits)) as i64) - (1 << bits)
    }

    /// Returns errors of up to `2^bits` each, or none.
    fn errors(random: &mut Random, bits: u32) -> Whole {
        if bits == 0 { [0; 5] } else { [0; 5].map(|_| number(random, bits).abs()) }
    }

    /// Whatever the corners of an edge are within their errors, a point on the inner side of its line is on
    /// the inner side of the edge. Points are on the exact edge or next to it. Compared in whole numbers.
    #[test]
    fn lines_are_on_the_inner_side_of_their_edges() {
        let (mut random, mesh) = (Random(1), triangle());
        let mut counts = [0; 2];
        for trial in 0..20_000 {
            let bits = [0, 1, 4, 12][trial % 4];
            // With errors, corners are small, so that the errors matter more than rounding.
            let scale = if bits == 0 { random.below(30) as u32 } else { bits + random.below(4) as u32 };
            let step = [0; 2].map(|_| number(&mut random, 8));
            let base = [0; 2].map(|_| (1 << 20) - (1 << 18) + number(&mut random, 17));
            let along = |by: i128| [base[0] + by * step[0], base[1] + by * step[1]];
            let mut places = [0; 3].map(|_| along(number(&mut random, 9)));
            let beside = random.below(18) as u32;
            if bits > 0 || random.one_in(2) {
                places[2] = places[2].map(|x| x - number(&mut random, beside).abs());
            }
            let [a, b] = [places[0], places[1]].map(|[x, y]| {
                let w = (1 << scale) + number(&mut random, scale).abs();
                [x * w, y * w, w, 0, 0]
            });
            let (error, facing) = (errors(&mut random, bits), if random.one_in(2) { 1 } else { -1 });
            let of = projected(&[a, b], &error);
            let meshed = Meshed::new(&mesh, &of, facing as f64);
            let line = meshed.line(&of.corners[0], &of.corners[1]);
            let p = point(places[2]);
            let is_inside = at(line, places[2].map(|x| x as f64)) > 0.0;
            let least = (0..64)
                .map(|signs| {
                    facing * determinant(&moved(&a, &error, signs), &moved(&b, &error, signs >> 3), &p)
                })
                .min();
            assert!(
                !is_inside || least > Some(0),
                "trial {trial}: {a:?} to {b:?} off by {error:?}, at {p:?}: {least:?}"
            );
            counts[usize::from(is_inside)] += 1;
        }
        assert!(counts.iter().all(|&count| count > 500), "points outside and inside: {counts:?}");
    }

    /// Returns three corners that are nearly in one line as the eye sees them.
    fn flat(random: &mut Random, bits: u32, most: u32) -> [Whole; 3] {
        let [a, b] = [0; 2].map(|_| [0; 5].map(|_| number(random, most)));
        let [i, j] = [0; 2].map(|_| number(random, 1));
        let near = bits + 2 + random.below(10) as u32;
        let off = core::array::from_fn::<_, 5, _>(|_| if bits == 0 { 0 } else { number(random, near) });
        [a, b, core::array::from_fn(|k| i * a[k] + j * b[k] + off[k])]
    }

    /// A triangle that is drawn faces the eye wherever its corners are within their errors.
    #[test]
    fn triangles_that_are_drawn_face_the_eye() {
        let (mut random, mesh) = (Random(2), triangle());
        let mut counts = [0; 2];
        for trial in 0..20_000 {
            let bits = [0, 1, 4, 10][trial % 4];
            let most = if bits == 0 { 34 } else { bits + 8 };
            let mut corners = flat(&mut random, bits, most);
            let error = errors(&mut random, bits);
            corners.iter_mut().for_each(|corner| corner[4] = 1 << 40);
            let facing = if random.one_in(2) { 1 } else { -1 };
            let of = projected(&corners, &error);
            let is_drawn = Meshed::new(&mesh, &of, facing as f64).is_drawn([0, 1, 2]);
            for signs in (0..if bits == 0 { 1 } else { 60 }).map(|_| random.bits()) {
                let [a, b, c] = core::array::from_fn(|k| moved(&corners[k], &error, signs >> (3 * k)));
                let exact = facing * determinant(&a, &b, &c);
                assert!(!is_drawn || exact > 0, "trial {trial}: {corners:?} off by {error:?}: {exact}");
            }
            counts[usize::from(is_drawn)] += 1;
        }
        assert!(counts.iter().all(|&count| count > 500), "triangles left out and drawn: {counts:?}");
    }

    /// Returns numbers of 26 bits whose sum is a whole number.
    fn split(whole: i128) -> impl Iterator<Item = f64> {
        let sign = if whole < 0 { -1.0 } else { 1.0 };
        (0..5).map(move |k| {
            let part = (whole.unsigned_abs() >> (26 * k)) as u64 & ((1 << 26) - 1);
            sign * part as f64 * (1u64 << (13 * k)) as f64 * (1u64 << (13 * k)) as f64
        })
    }

    /// The depth plane of a triangle is nowhere nearer than the triangle's own plane, wherever its corners
    /// are within their errors.
    #[test]
    fn depth_planes_are_behind_their_triangles() {
        let (mut random, mesh) = (Random(3), triangle());
        let mut counts = [0; 2];
        for trial in 0..6_000 {
            let bits = [0, 1, 2][trial % 3];
            let places = [0; 3].map(|_| [0; 2].map(|_| (1 << 19) + number(&mut random, 18)));
            let corners = places.map(|[x, y]| {
                let w = 1 + number(&mut random, 8).abs();
                [x * w, y * w, w, number(&mut random, 8), 1]
            });
            let error = errors(&mut random, bits).map(|error| error.min(1 << 1));
            let error = [error[0], error[1], error[2].min(i128::from(bits > 1)), error[3], 0];
            let of = projected(&corners, &error);
            let plane = Meshed::new(&mesh, &of, 1.0).depth_plane([0, 1, 2]);
            counts[usize::from(plane.is_some())] += 1;
            let Some([x, y, c]) = plane else { continue };
            for turn in 0..8 {
                let p = [0; 2].map(|_| 1 + number(&mut random, 20).abs().min((1 << 20) - 1));
                let signs = random.bits();
                let [a, b, c3] = core::array::from_fn(|k| moved(&corners[k], &error, signs >> (4 * k)));
                let all = determinant(&a, &b, &c3);
                let at = point(p);
                let key = a[3] * determinant(&at, &b, &c3)
                    + b[3] * determinant(&a, &at, &c3)
                    + c3[3] * determinant(&a, &b, &at);
                // The plane's value times the determinant, less the numerator of the key.
                let (all, key) = if all < 0 { (-all, -key) } else { (all, key) };
                let [px, py] = p.map(|x| x as f64);
                let products = split(all)
                    .flat_map(|part| [(x, part * px), (y, part * py), (c, part)])
                    .chain(split(-key).map(|part| (1.0, part)));
                assert!(
                    sign_of_sum(products) <= 0,
                    "trial {trial}, {turn}: {corners:?} off by {error:?}, at {p:?}"
                );
            }
        }
        assert!(counts[1] > 3_000, "triangles without and with a plane: {counts:?}");
    }

    /// Where an edge is cut, and at its ends that are drawn, it is beyond the near plane.
    #[test]
    fn cuts_are_beyond_the_near_plane() {
        let (mut random, mesh) = (Random(4), triangle());
        let mut cuts = 0;
        for trial in 0..20_000 {
            let bits = [0, 4][trial % 2];
            let error = errors(&mut random, bits);
            let [a, b] = [0; 2].map(|_| {
                let most = 1 + random.below(if bits == 0 { 50 } else { 8 }) as u32;
                [0, 0, 1, 0, number(&mut random, most)]
            });
            let of = projected(&[a, b], &error);
            let meshed = Meshed::new(&mesh, &of, 1.0);
            for (vertex, corner) in [(0, a), (1, b)] {
                let is_beyond = meshed.is_beyond(vertex);
                assert!(!is_beyond || corner[4] > error[4], "trial {trial}: {corner:?} off by {error:?}");
            }
            if meshed.is_beyond(0) == meshed.is_beyond(1) {
                continue;
            }
            assert_eq!(meshed.cut(0, 1), meshed.cut(1, 0), "trial {trial}: the cut from either end");
            // Both ends are an error nearer than computed.
            let (a, b) = if meshed.is_beyond(1) { (a, b) } else { (b, a) };
            let [near_a, near_b] = [a, b].map(|corner| corner[4] as f64);
            let share = (meshed.limit - near_a) / (near_b - near_a);
            let (rest, off) = (1.0 - share, error[4] as f64);
            let products = [(rest, near_a), (rest, -off), (share, near_b), (share, -off)];
            assert!(sign_of_sum(products) > 0, "trial {trial}: {a:?} to {b:?} off by {error:?}");
            cuts += 1;
        }
        assert!(cuts > 2_000, "{cuts} edges are cut");
    }

    /// A plane whose coefficients overflow is no plane.
    #[test]
    fn planes_that_overflow_are_left_out() {
        let mesh = triangle();
        for key in [1.0, 1e300] {
            let corners = [[9.0, 1.0, 1.0, key], [1.0, 9.0, 1.0, -key], [1.0, 1.0, 1.0, key]];
            let corners = corners.map(|[x, y, w, n]| [x * 1e10, y * 1e10, w, n, 1.0]);
            let of =
                Projected { corners: corners.to_vec(), error: [0.0; 5], size: [9e10, 9e10, 1.0, key, 1.0] };
            let plane = Meshed::new(&mesh, &of, 1.0).depth_plane([0, 1, 2]);
            assert_eq!(plane.is_some(), key == 1.0, "keys of {key}: {plane:?}");
        }
    }

    /// The floor of a shape is no more than the least depth key of a corner, wherever corners are within
    /// their errors, and nothing where a corner's `w` is uncertain. A corner behind the eye does not count.
    #[test]
    fn floors_are_below_the_keys_of_all_corners() {
        let (mut random, mesh) = (Random(5), triangle());
        let mut counts = [0; 2];
        for trial in 0..4_000 {
            let [of_n, of_w] = [0; 2].map(|_| number(&mut random, 4).abs() * i128::from(trial % 2 != 0));
            let mut corners = [[1, 1], [900, 1], [1, 900]].map(|[x, y]| {
                let w = 1025 * of_w + 1 + number(&mut random, 6).abs();
                [1000 * x * w, 1000 * y * w, w, number(&mut random, 30), 1 << 40]
            });
            let is_known = trial % 3 != 0;
            if !is_known {
                let w = 1 + number(&mut random, 20).abs() % (1024 * of_w).max(1);
                corners[0] = [1000 * w, 1000 * w, w, corners[0][3], 1 << 40];
            }
            let error = [0, 0, of_w, of_n, 0];
            let mut of = projected(&corners, &error);
            // The bounds on determinants, which have another test, are not to decide.
            of.size[3] = 1e300;
            let mut shapes = Shapes::default();
            shapes.add(&mesh, &of, 1.0);
            shapes.add(&mesh, &of, -1.0);
            for shape in &shapes.list {
                counts[usize::from(shape.floor > f64::NEG_INFINITY)] += 1;
                for corner in &corners {
                    let (n, w) = ((corner[3] - of_n) as f64, [corner[2] - of_w, corner[2] + of_w]);
                    for w in w.map(|w| w as f64) {
                        let is_below = shape.floor == f64::NEG_INFINITY
                            || w > 0.0 && sign_of_sum([(shape.floor, w), (-n, 1.0)]) <= 0;
                        assert!(is_below, "trial {trial}: {} and {n} / {w}", shape.floor);
                    }
                }
            }
        }
        assert!(counts.iter().all(|&count| count > 300), "floors without and with a bound: {counts:?}");
    }

    /// Points that a shape covers are behind a triangle of the mesh that faces the eye, beyond the near
    /// plane, and no deeper than the shape says; also where the near plane cuts the mesh, or the mesh is
    /// concave or open. A solid before the eye has one shape, which covers nearly all of its outline.
    #[test]
    fn shapes_cover_what_their_triangles_cover() {
        let mut random = Random(6);
        let (mut covered, mut bare, mut projected) = (0, 0, Projected::default());
        for trial in 0..600 {
            let reach = [2.0, 9.0][trial % 2];
            let mut corner = || (random.vector(reach) + DVec3::X * 4.0).as_vec3();
            let is_solid = trial % 3 == 0;
            let mesh = if is_solid {
                let low = corner();
                OccluderMesh::cuboid(&Aabb::new(low, low + (corner() - low).abs() * 0.5))
            } else {
                let points = [0; 6].map(|_| corner());
                OccluderMesh::from_indexed(&points, &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [1, 5, 2], [4, 5, 0]])
            };
            let Ok(mesh) = mesh else { continue };
            let mesh = mesh.with_two_sided(trial % 4 == 1);
            let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
            let near = [0.1, 2.0][trial / 2 % 2];
            let view = View::perspective(pose, 1.0, 1.0, near, f64::INFINITY).unwrap();
            let screen = Screen::new(&view, DVec3::ZERO);
            let facing = screen.facing(&Affine3A::IDENTITY).unwrap();
            assert!(screen.project(mesh.positions(), &Affine3A::IDENTITY, &mut projected), "finite numbers");
            let mut shapes = Shapes::default();
            shapes.add(&mesh, &projected, facing);
            let slope = 0.5f64.tan();
            // Points of the grid near the middles of triangles, at their corners, and anywhere.
            let places = mesh.positions().iter().map(|p| p.as_dvec3()).collect::<Vec<_>>();
            for turn in 0..60 {
                let [a, b, c] = mesh.triangles()[turn % mesh.triangles().len()].map(|i| places[i as usize]);
                let [s, t] = [random.fine_range(-0.1, 1.1), random.fine_range(-0.1, 1.1)];
                let p = a + (b - a) * s + (c - a) * t * (1.0 - s);
                let at_p = [0.5 - 0.5 * p.y / p.x / slope, 0.5 - 0.5 * p.z / p.x / slope].map(|x| x * GRID);
                if !(p.x > near && at_p.iter().all(|x| (0.0..GRID).contains(x))) {
                    continue;
                }
                let ray = DVec3::new(1.0, p.y / p.x, p.z / p.x);
                // Keys at which the line of sight meets triangles; `None` close to an edge.
                let mut keys = Vec::new();
                for &[i, j, k] in mesh.triangles() {
                    let [a, b, c] = [i, j, k].map(|i| places[i as usize]);
                    let normal = (b - a).cross(c - a);
                    let x = normal.dot(a) / normal.dot(ray);
                    let sides = [(a, b), (b, c), (c, a)].map(|(a, b)| {
                        (b - a).cross(ray * x - a).dot(normal) / (normal.length() * (b - a).length())
                    });
                    let is_front = normal.dot(ray) < 0.0 || mesh.is_two_sided();
                    if is_front && x > near * (1.0 - 1e-9) && sides.iter().all(|&side| side > -1e-4) {
                        keys.push(1.0 / x);
                    }
                }
                let nearest = keys.iter().copied().fold(0.0, f64::max);
                let mut is_covered = false;
                for shape in &shapes.list {
                    if !shapes.lines[shape.lines.clone()].iter().all(|&line| at(line, at_p) > 0.0) {
                        continue;
                    }
                    is_covered = true;
                    let least = shapes.planes[shape.planes.clone()]
                        .iter()
                        .map(|&plane| at(plane, at_p))
                        .fold(f64::INFINITY, f64::min);
                    let key = least.max(shape.floor);
                    assert!(
                        key <= nearest * (1.0 + 1e-6),
                        "trial {trial}, {turn}: {p} has a key of {key}, and {keys:?} of {mesh:?}"
                    );
                }
                covered += usize::from(is_covered);
                let is_clear = is_solid && mesh.bounds().min.x > near as f32 && (0.01..0.99).contains(&s);
                bare += usize::from(!is_covered && is_clear && (0.01..0.99).contains(&t) && !keys.is_empty());
            }
        }
        assert!(covered > 2_000 && bare == 0, "{covered} points covered, {bare} of solids bare");
    }
}
