//! Test of a box against the columns of a horizon.
//!
//! In each face that a box meets, the part of the box within the face's wedge (`|y| <= x`) is bounded by its
//! columns, its least depth and its heights in the picture.
//!
//! # Rounding
//! With `u = 2^-24`, the unit round-off of `f32`. The eye is given as `high + low` in `f32`, within `a`
//! metres of the exact one, and `u` of `low`. No number of `f32` is nearer to the eye than `high`, so `low`
//! is at most the result of subtracting `high` and then `low` from a coordinate, up to rounding. The first
//! difference is exact, or the coordinate is not within a factor of two of `high`, and `low` is `2u` of the
//! difference at most; so both subtractions and the rounding of `low` together are `2u` of the result, and
//! terms in `u^2`. Coordinates are moved outwards by `4u` of themselves plus `a`, which rounds once more.
//! Inverses and products with them then round by `u` each, so heights and inverse depths are moved outwards
//! by `8u` of themselves. Positions of columns, at most `2h` if the face has `2h` columns, round by `4u` of
//! this in an inverse, two products and a sum, and are moved by `16u h`. Positions outside of the face have
//! larger errors, but stay on the correct side. Underflow loses less than the least normal number.

use super::columns::{BLOCK, Columns};
use super::frame::{FACES, Frame};
use visibility_core::Aabb;
use visibility_core::scene::Boxes64;

/// Unit round-off of `f32`: 2^-24.
const U: f32 = f32::EPSILON / 2.0;

/// Eye in `f32`, with a bound on its error.
#[derive(Clone, Copy, Debug)]
pub(crate) struct QueryEye {
    /// Eye, rounded to `f32`: two coordinates on the plan and the height, in metres from the scene's origin.
    high: [f32; 3],
    /// Difference between the eye and `high`, rounded to `f32`, in metres.
    low: [f32; 3],
    /// Bound on the error of each coordinate in metres. Infinite if nothing can be hidden.
    error: f32,
}

impl QueryEye {
    pub(crate) const BLIND: Self = Self { high: [0.0; 3], low: [0.0; 3], error: f32::INFINITY };

    pub(crate) fn new(frame: &Frame) -> Self {
        let high = frame.eye.map(|x| x as f32);
        let low: [f32; 3] = core::array::from_fn(|i| (frame.eye[i] - f64::from(high[i])) as f32);
        // Twice the error of the eye holds the rounding to `f32`.
        let error = 2.0 * frame.error + 1e-30;
        let is_finite = high.iter().all(|x| x.is_finite());
        Self { high, low, error: if is_finite { (error as f32).next_up() } else { f32::INFINITY } }
    }
}

/// Number of boxes of a block of 64 that are computed together.
const LANES: usize = 16;

/// Boxes relative to the eye in metres, rounded outwards, one per lane: least and greatest coordinates on the
/// plan and in height.
struct Relative<const N: usize> {
    x: [[f32; N]; 2],
    y: [[f32; N]; 2],
    z: [[f32; N]; 2],
}

/// Bounds of the parts of boxes that lie in the wedge of a face (the quarter of the plan that the face
/// shows), one box per lane.
#[derive(Debug)]
struct Parts<const N: usize> {
    /// Whether each box meets the wedge. If not, the lane's other entries are meaningless.
    meets: [bool; N],
    /// Least position of each part, in columns from the right edge of the face, rounded downwards.
    from: [f32; N],
    /// Greatest position of each part, in columns from the right edge of the face, rounded upwards.
    to: [f32; N],
    /// Greatest inverse depth of each part, at its nearest point, in 1/m, rounded upwards.
    inverse_depth: [f32; N],
    /// Least height of each part in the picture (height above the eye over depth), rounded downwards.
    low: [f32; N],
    /// Greatest height of each part in the picture (height above the eye over depth), rounded upwards.
    high: [f32; N],
}

impl<const N: usize> Relative<N> {
    /// Makes boxes relative to an eye. `boxes` are the rows of least and of greatest coordinates: the plan's
    /// x, the plan's y and the height.
    #[inline(always)]
    fn new(eye: &QueryEye, boxes: [[&[f32; N]; 2]; 3]) -> Self {
        let around = |axis: usize| {
            let (high, low, error) = (eye.high[axis], eye.low[axis], eye.error);
            let [min, max] = boxes[axis];
            let mut out = [[0.0; N]; 2];
            for lane in 0..N {
                let (a, b) = (min[lane] - high - low, max[lane] - high - low);
                out[0][lane] = a - (a.abs() * (4.0 * U) + error);
                out[1][lane] = b + (b.abs() * (4.0 * U) + error);
            }
            out
        };
        Self { x: around(0), y: around(1), z: around(2) }
    }

    /// Returns the coordinates of the boxes in the face `FACE`: depth, then lateral coordinate, each as least
    /// and greatest value.
    #[inline(always)]
    fn turned<const FACE: usize>(&self) -> [[[f32; N]; 2]; 2] {
        let negated = |of: &[[f32; N]; 2]| {
            let mut out = [[0.0; N]; 2];
            for lane in 0..N {
                (out[0][lane], out[1][lane]) = (-of[1][lane], -of[0][lane]);
            }
            out
        };
        match FACE {
            0 => [self.x, self.y],
            1 => [self.y, negated(&self.x)],
            2 => [negated(&self.x), negated(&self.y)],
            _ => [negated(&self.y), self.x],
        }
    }

    #[inline(always)]
    fn parts<const FACE: usize>(&self, half: f32) -> Parts<N> {
        let [[near, far], [right, left]] = self.turned::<FACE>();
        let mut parts = Parts {
            meets: [false; N],
            from: [0.0; N],
            to: [0.0; N],
            inverse_depth: [0.0; N],
            low: [0.0; N],
            high: [0.0; N],
        };
        let slack = 16.0 * U * half;
        for lane in 0..N {
            // Inside the wedge, depth is at least the lateral distance from the middle of the face.
            let (right, left, far) = (right[lane], left[lane], far[lane]);
            let aside = if right > -left { right } else { -left };
            let near = if near[lane] > aside { near[lane] } else { aside };
            // A box above or below the eye is in every column at any height. A NaN box does not meet the
            // wedge.
            parts.meets[lane] = (near > 0.0) & (near <= far);
            let inverse = 1.0 / near;
            let inverse_far = 1.0 / far;
            let least = right * if right > 0.0 { inverse_far } else { inverse };
            let most = left * if left > 0.0 { inverse } else { inverse_far };
            parts.from[lane] = half + half * least - slack;
            parts.to[lane] = half + half * most + slack;
            let (low, high) = (self.z[0][lane], self.z[1][lane]);
            let high = high * if high > 0.0 { inverse } else { inverse_far };
            let low = low * if low > 0.0 { inverse_far } else { inverse };
            parts.inverse_depth[lane] = inverse * (1.0 + 8.0 * U);
            parts.high[lane] = high + high.abs() * (8.0 * U) + f32::MIN_POSITIVE;
            parts.low[lane] = low - low.abs() * (8.0 * U) - f32::MIN_POSITIVE;
        }
        parts
    }
}

impl Columns {
    /// Tests boxes, one per lane, in the face `FACE`. `state.0` is the mask of the lanes whose boxes were
    /// hidden in all faces so far; lanes not hidden in this face are removed from it. Lanes whose boxes meet
    /// the columns in view of this face are added to the mask `state.1`.
    #[inline(always)]
    fn hidden_in_face<const FACE: usize, const N: usize>(
        &self,
        relative: &Relative<N>,
        state: &mut (u64, u64),
    ) {
        let (hidden, met) = state;
        let seen = self.seen(FACE);
        let (begin, last) = (seen.start as f32, seen.end as f32 - 1.0);
        let parts = relative.parts::<FACE>(0.5 * self.per_face() as f32);
        let mut left = *hidden;
        while left != 0 {
            let lane = left.trailing_zeros() as usize % N;
            left &= left - 1;
            // The box is outside of the wedge, or outside of the columns in view.
            if !parts.meets[lane] || parts.to[lane] < begin || parts.from[lane] >= last + 1.0 {
                continue;
            }
            *met |= 1 << lane;
            let first = parts.from[lane].max(begin) as i32 as usize;
            let last = parts.to[lane].min(last) as i32 as usize;
            let (w, low, high) = (parts.inverse_depth[lane], parts.low[lane], parts.high[lane]);
            if !self.is_behind(FACE, first, last, w, low, high) {
                *hidden &= !(1 << lane);
            }
        }
    }

    /// Returns the mask of the lanes among `candidates` whose box is certainly hidden wherever the view may
    /// see it. Bit i stands for lane i, which holds box i of `boxes`.
    #[inline(always)]
    fn hidden_lanes<const N: usize>(
        &self,
        eye: &QueryEye,
        boxes: [[&[f32; N]; 2]; 3],
        candidates: u64,
    ) -> u64 {
        let relative = Relative::new(eye, boxes);
        let mut open = 0;
        for lane in 0..N {
            let (x, y, z) = (&relative.x, &relative.y, &relative.z);
            let is_beside = (x[0][lane] > 0.0) | (x[1][lane] < 0.0) | (y[0][lane] > 0.0) | (y[1][lane] < 0.0);
            // Validity is tested on the original box: `relative` is widened, so a slightly inverted box would
            // be valid there.
            let is_proper = boxes.iter().fold(true, |all, [min, max]| all & (min[lane] <= max[lane]));
            let is_number =
                (x[0][lane] <= x[1][lane]) & (y[0][lane] <= y[1][lane]) & (z[0][lane] <= z[1][lane]);
            open |= u64::from(!(is_beside & is_proper & is_number)) << lane;
        }
        // Lanes that are hidden in all faces so far, and lanes that meet some face.
        let mut state = (candidates & !open, 0);
        let is_seen = |face: usize| !self.seen(face).is_empty();
        if is_seen(0) {
            self.hidden_in_face::<0, N>(&relative, &mut state);
        }
        if is_seen(1) {
            self.hidden_in_face::<1, N>(&relative, &mut state);
        }
        if is_seen(2) {
            self.hidden_in_face::<2, N>(&relative, &mut state);
        }
        if is_seen(3) {
            self.hidden_in_face::<3, N>(&relative, &mut state);
        }
        state.0 & state.1
    }

    /// Returns whether each column from `first` to `last` of a face has a step that hides a surface between
    /// the heights `low` and `high`, at inverse depth `inverse_depth` or less.
    #[inline(always)]
    fn is_behind(
        &self,
        face: usize,
        first: usize,
        last: usize,
        inverse_depth: f32,
        low: f32,
        high: f32,
    ) -> bool {
        let Some(blocks) = self.face(face).get(first / BLOCK..=last / BLOCK) else { return false };
        let all = (1 << BLOCK) - 1;
        // In the first and last block, columns outside of the range need not hide the surface.
        let (mut before, behind) = ((1 << (first % BLOCK)) - 1, all & !((2 << (last % BLOCK)) - 1));
        let count = blocks.len();
        for (index, block) in blocks.iter().enumerate() {
            let spared = before | if index + 1 == count { behind } else { 0 };
            if !block.is_hidden_throughout(inverse_depth, low, high)
                && block.hides(inverse_depth, low, high) | spared != all
            {
                return false;
            }
            before = 0;
        }
        true
    }

    /// Returns the lanes of `candidates` whose boxes are certainly hidden wherever the view may see them, as
    /// a mask. `rows` are the rows of the plan's x, y and the height.
    pub(crate) fn hidden_64(
        &self,
        eye: &QueryEye,
        rows: [usize; 3],
        boxes: &Boxes64,
        candidates: u64,
    ) -> u64 {
        let c = boxes.coordinates();
        let mut hidden = 0;
        for begin in (0..64).step_by(LANES) {
            let some = candidates >> begin & ((1 << LANES) - 1);
            if some == 0 {
                continue;
            }
            let row = |row: usize| -> &[f32; LANES] {
                let (chunks, _) = c[row].as_chunks();
                &chunks[begin / LANES]
            };
            let [x, y, z] = rows;
            let boxes = [[row(x), row(x + 3)], [row(y), row(y + 3)], [row(z), row(z + 3)]];
            hidden |= self.hidden_lanes(eye, boxes, some) << begin;
        }
        hidden
    }

    /// Returns whether a box is certainly hidden wherever the view may see it: see
    /// [`hidden_64`](Self::hidden_64).
    pub(crate) fn hides_box(&self, eye: &QueryEye, rows: [usize; 3], bounds: &Aabb) -> bool {
        let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
        let lanes = |x: f32| [x; 1];
        let [x, y, z] = rows;
        let [a, b, c] = [lanes(min[x]), lanes(min[y]), lanes(min[z])];
        let [d, e, f] = [lanes(max[x]), lanes(max[y]), lanes(max[z])];
        self.hidden_lanes(eye, [[&a, &d], [&b, &e], [&c, &f]], 1) != 0
    }

    /// Calls `each` with the part of a box in each face in view (the face, the first and the last column, and
    /// the greatest height in the picture), until `each` returns false. Returns true if it never did. False
    /// for a box above or below the eye and for NaN.
    pub(crate) fn for_each_part(
        &self,
        eye: &QueryEye,
        rows: [usize; 3],
        bounds: &Aabb,
        mut each: impl FnMut(usize, usize, usize, f32) -> bool,
    ) -> bool {
        let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
        let lanes = |row: usize| [[min[row]], [max[row]]];
        let [x, y, z] = rows.map(lanes);
        let relative = Relative::<1>::new(eye, [[&x[0], &x[1]], [&y[0], &y[1]], [&z[0], &z[1]]]);
        let ([x0, x1], [y0, y1]) = (relative.x, relative.y);
        if !(x0[0] > 0.0 || x1[0] < 0.0 || y0[0] > 0.0 || y1[0] < 0.0) {
            return false;
        }
        let half = 0.5 * self.per_face() as f32;
        (0..FACES).all(|face| {
            let seen = self.seen(face);
            let parts = match face {
                0 => relative.parts::<0>(half),
                1 => relative.parts::<1>(half),
                2 => relative.parts::<2>(half),
                _ => relative.parts::<3>(half),
            };
            let (from, to) = (parts.from[0].max(seen.start as f32), parts.to[0].min(seen.end as f32 - 1.0));
            let is_seen = parts.meets[0] && to >= 0.0 && from <= to + 1.0 && !seen.is_empty();
            let (first, last) = (from as usize, to.max(0.0) as usize);
            !is_seen || first > last || each(face, first, last, parts.high[0])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::Random;

    /// Bounds of a box's part in a face hold each point of the box there, relative to the exact eye, far from
    /// the origin and with errors of the eye, which are large here. Compared in `f64`, whose rounding is
    /// 2^-29 of that of `f32`.
    #[test]
    fn parts_of_boxes_hold_their_points() {
        let mut random = Random(1);
        let (half, mut met) = (8192.0, 0);
        for trial in 0..30_000 {
            let far = [0.0, 1e2, 1e5][trial % 3];
            let mut frame = Frame::BLIND;
            let eye = random.fine_vector(far);
            frame.eye = eye.to_array();
            frame.error = [0.0, 0.01][random.below(2)];
            let around = 10f64.powf(random.range(-1.0, 2.0));
            let min = (eye + random.fine_vector(around)).as_vec3();
            let size = if random.one_in(2) { 0.0 } else { around * 0.2 };
            let max = min + random.vec3(0.0, size);
            let query = QueryEye::new(&frame);
            let [x, y, z] = [0, 1, 2].map(|axis| [[min[axis]], [max[axis]]]);
            let relative = Relative::<1>::new(&query, [[&x[0], &x[1]], [&y[0], &y[1]], [&z[0], &z[1]]]);
            let parts = [
                relative.parts::<0>(half),
                relative.parts::<1>(half),
                relative.parts::<2>(half),
                relative.parts::<3>(half),
            ];
            let exact_eye = eye + random.direction() * frame.error;
            for corner in 0..8 {
                let at = [0, 1, 2]
                    .map(|k| f64::from(if corner >> k & 1 == 0 { min[k] } else { max[k] }) - exact_eye[k]);
                for (face, part) in parts.iter().enumerate() {
                    let (depth, lateral) = crate::horizon::frame::turned(face, at[0], at[1]);
                    if depth <= lateral.abs() {
                        continue;
                    }
                    let what = || std::format!("trial {trial}: {at:?} in face {face}, {part:?}");
                    // A box that reaches above or below the eye is tested before.
                    let is_beside = relative.x[0][0] > 0.0
                        || relative.x[1][0] < 0.0
                        || relative.y[0][0] > 0.0
                        || relative.y[1][0] < 0.0;
                    if !is_beside {
                        continue;
                    }
                    assert!(part.meets[0], "{}: meets the face", what());
                    let half = f64::from(half);
                    let column = half + half * lateral / depth;
                    let (from, to) = (f64::from(part.from[0]), f64::from(part.to[0]));
                    assert!(from <= column && column <= to, "{}: columns", what());
                    let (low, high) = (f64::from(part.low[0]), f64::from(part.high[0]));
                    assert!(low <= at[2] / depth && at[2] / depth <= high, "{}: heights", what());
                    assert!(f64::from(part.inverse_depth[0]) >= 1.0 / depth, "{}: depth", what());
                    met += 1;
                }
            }
        }
        assert!(met > 30_000, "{met} points are in faces");
    }

    /// Coordinates relative to the eye hold the exact ones, also of what is so near to an eye far away that
    /// the eye's rounding in `f32` matters.
    #[test]
    fn coordinates_relative_to_the_eye_are_rounded_outwards() {
        let mut random = Random(2);
        for trial in 0..100_000 {
            let far = [1.0, 1e5, 1e9][trial % 3];
            let own = random.fine_range(-far, far) as f32;
            let near = 10f64.powf(random.range(-6.0, 3.0)) * if random.one_in(2) { 1.0 } else { -1.0 };
            let mut frame = Frame::BLIND;
            let axis = trial % 3;
            frame.eye = [0.0; 3];
            frame.eye[axis] = f64::from(own) - near * random.fine_unit();
            frame.error = [0.0, 1e-3][random.below(2)];
            let query = QueryEye::new(&frame);
            let relative = Relative::<1>::new(&query, [[&[own], &[own]]; 3]);
            let [least, most] = [relative.x, relative.y, relative.z][axis].map(|x| f64::from(x[0]));
            for error in [-frame.error, frame.error] {
                // The difference of a number of `f32` and one near by is exact, or rounds by a 2^-29th of U.
                let exact = f64::from(own) - frame.eye[axis] + error;
                assert!(least <= exact && exact <= most, "trial {trial}: {exact} from {least} to {most}");
            }
        }
        let mut frame = Frame::BLIND;
        (frame.eye, frame.error) = ([1e39, 0.0, 0.0], 0.0);
        assert_eq!(QueryEye::new(&frame).error, f32::INFINITY, "an eye beyond `f32`");
    }

    /// Boxes on each side of the eye have parts in the faces there; one around the eye has none.
    #[test]
    fn boxes_on_each_side_have_parts() {
        let mut frame = Frame::BLIND;
        frame.error = 0.0;
        let (eye, mut columns) = (QueryEye::new(&frame), Columns::new(16));
        columns.begin(&frame);
        let parts = |min: [f32; 3], max: [f32; 3]| {
            let mut faces = std::vec::Vec::new();
            let is_beside =
                columns.for_each_part(&eye, [0, 1, 2], &Aabb::from_arrays(min, max), |face, _, _, _| {
                    faces.push(face);
                    true
                });
            (is_beside, faces)
        };
        for (face, [x, y]) in [[5.0, 0.0], [0.0, 5.0], [-5.0, 0.0], [0.0, -5.0]].into_iter().enumerate() {
            let found = parts([x - 1.0, y - 1.0, 0.0], [x + 1.0, y + 1.0, 1.0]);
            assert_eq!(found, (true, std::vec![face]), "a box at {x}, {y}");
        }
        assert_eq!(parts([-1.0, -1.0, 3.0], [1.0, 1.0, 4.0]), (false, std::vec![]), "a box above the eye");
    }
}
