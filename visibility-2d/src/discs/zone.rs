//! Search for the discs that an eye sees, front to back.

use super::gaps::Gaps;
use super::tree::{Disc, Discs, FAN, Node};
use super::{MAX_NUMBER, ROUNDING};
use crate::directions::{diamond, disc_span, rectangle_span};
use crate::median_order::LEAF;
use alloc::collections::BinaryHeap;
use alloc::vec::Vec;
use core::cmp::{Ordering, Reverse};

/// Number of low bits of a queue entry that hold an index, into a level or into the discs. The level is in
/// the bits above.
const INDEX_BITS: u32 = 27;
/// Level of a queue entry for a disc to be tested.
const DISC: u32 = 31;
/// Level of a queue entry for a disc that overlaps others. It only closes gaps with its solid radius.
const SOLID: u32 = 30;
/// Bound on the error of the direction numbers of a rectangle's corners. They are at most 4 and have a
/// relative error below `4u`, with `u = 2^-53`, so an absolute error below `16u`. The bound is twice that.
const RECTANGLE_ERROR: f64 = 16.0 * f64::EPSILON;

/// Twice the greatest difference of the direction numbers of two vectors whose order rounding may have
/// swapped: each number is off by at most `4u`.
const TIE: f64 = 8.0 * f64::EPSILON;

/// Greatest accepted error of the direction numbers of a disc's tangents. With a larger error, the eye counts
/// as on the disc's circle.
pub(super) const WIDEST_ERROR: f64 = 0.1;

/// Eye among discs: its position, range and directions.
#[derive(Clone, Copy, PartialEq, Debug)]
#[must_use]
pub struct DiscView {
    eye: [f64; 2],
    /// Direction numbers of the first and the last direction seen. `None` for all directions.
    directions: Option<(f64, f64)>,
    range: f64,
    ball: f64,
}

impl DiscView {
    /// Creates a view from a point, in metres, in all directions and without a range.
    pub const fn new(eye: [f64; 2]) -> Self {
        Self { eye, directions: None, range: f64::INFINITY, ball: 0.0 }
    }

    /// Restricts the view to the directions from `right` counter-clockwise to `left`. With vectors of equal
    /// direction, the view sees nothing. Whether `left` is clockwise of `right`, so that the sector is nearly
    /// a full turn, is decided exactly. Vectors may have any length; if one is zero, infinite or NaN, or has
    /// one component so small beside the other that products may underflow, the view sees all directions.
    pub fn with_sector(self, right: [f64; 2], left: [f64; 2]) -> Self {
        let is_known = |v: [f64; 2]| v.iter().all(|x| x.is_finite()) && v != [0.0; 2];
        let number = |[x, y]: [f64; 2]| {
            // Large vectors are halved, since their sum may overflow. Small ones are not, since halving may
            // underflow.
            let by = if x.abs().max(y.abs()) > 1.0 { 0.5 } else { 1.0 };
            diamond(by * x, by * y)
        };
        if !is_known(right) || !is_known(left) {
            return Self { directions: None, ..self };
        }
        let (first, last) = (number(right), number(left));
        let apart = (first - last).abs();
        if apart.min(4.0 - apart) > 2.0 * TIE {
            return Self { directions: Some((first, last)), ..self };
        }
        let directions = match turn(right, left) {
            Some(Ordering::Equal) => Some((first, first)),
            // The numbers may be equal, or in the wrong order.
            Some(Ordering::Greater) => {
                let (first, last) = (first - TIE, last + TIE);
                Some((
                    if first < 0.0 { first + 4.0 } else { first },
                    if last > 4.0 { last - 4.0 } else { last },
                ))
            }
            // Nearly a full turn, or undecided.
            Some(Ordering::Less) | None => None,
        };
        Self { directions, ..self }
    }

    /// Restricts the view to the directions between two direction numbers.
    #[cfg(feature = "papers")]
    pub(super) fn with_directions(self, first: f64, last: f64) -> Self {
        Self { directions: Some((first, last)), ..self }
    }

    /// Restricts the view to discs whose nearest point is within `range` metres of the eye. NaN and negative
    /// numbers count as 0.
    pub fn with_range(self, range: f64) -> Self {
        Self { range: range.max(0.0), ..self }
    }

    /// Widens the view to all eyes within `radius` metres of the point, in all directions. The discs found
    /// are then valid while an eye moves by less than the radius. NaN and negative numbers count as 0.
    pub fn with_ball(self, radius: f64) -> Self {
        Self { ball: radius.max(0.0), ..self }
    }
}

/// Returns how `left` is turned against `right`, for finite vectors less than a quarter turn apart: `Greater`
/// for counter-clockwise, `Equal` for equal directions. `None` for different vectors of which one has so
/// small a component, beside its other one, that a product of components may underflow.
fn turn(right: [f64; 2], left: [f64; 2]) -> Option<Ordering> {
    let two_to = |exponent: i64| f64::from_bits(((1023 + exponent) as u64) << 52);
    if right == left {
        return Some(Ordering::Equal);
    }
    // Scaled by a power of two, the larger component is between 2^-474 and 2^424. Products of components
    // are at most 2^848, and at least 2^-954 unless they are 0, so that their lowest bits do not underflow.
    let scaled = |[x, y]: [f64; 2]| {
        let by = match x.abs().max(y.abs()) {
            size if size > two_to(400) => two_to(-600),
            size if size < two_to(-400) => two_to(600),
            _ => 1.0,
        };
        let is_exact = [x, y].iter().all(|&x| x == 0.0 || (by * x).abs() >= two_to(-480));
        is_exact.then_some(robust::Coord { x: by * x, y: by * y })
    };
    robust::orient2d(scaled(right)?, scaled(left)?, robust::Coord { x: 0.0, y: 0.0 }).partial_cmp(&0.0)
}

/// Finds the discs that an eye sees. Only keeps scratch memory between calls. Use one per thread.
///
/// # Exactness
/// Nothing visible is left out. A hidden disc is reported only if rounding seems to leave a gap through which
/// it shows. Such a gap is about `1e-15` of a turn wide, and wider for an eye very close to a disc. Discs
/// that touch or contain the eye are reported. A disc that contains the eye hides nothing. From a ball the
/// answer is conservative: it has all discs that some eye of the ball sees, and some that none sees.
/// (Occluders are shrunk by the radius of the ball: Wonka, Wimmer and Schmalstieg, "Visibility Preprocessing
/// with Occluder Fusion for Urban Walkthroughs", 2000.)
///
/// Of discs that overlap, only the parts that no other disc overlaps occlude.
///
/// ```
/// use visibility_2d::discs::{Disc, Discs, DiscView, DiscZone};
/// let disc = |x: f64, y: f64| Disc { center: [x, y], radius: 1.0 };
/// let discs = Discs::new(&[disc(5.0, 0.0), disc(10.0, 0.5), disc(0.0, 7.0)])?;
/// let (mut zone, mut seen) = (DiscZone::new(), Vec::new());
/// zone.look(&discs, &DiscView::new([0.0, 0.0]), &mut seen);
/// assert_eq!(seen, [0, 2], "nearest first; the second is behind the first");
/// # Ok::<(), visibility_2d::discs::DiscError>(())
/// ```
#[derive(Clone, Debug)]
pub struct DiscZone {
    gaps: Gaps,
    /// Queue of nodes and discs, least power first. The power of an eye is its squared distance from a disc's
    /// centre minus the disc's squared radius; a node has a lower bound for its discs. The first number has
    /// the bits of the power, at least 0, as `f64`. The second number is level and index.
    queue: BinaryHeap<Reverse<(u64, u32)>>,
}

impl Default for DiscZone {
    fn default() -> Self {
        Self::new()
    }
}

impl DiscZone {
    /// Makes a finder. Allocates nothing until the first call of [`look`](Self::look).
    pub fn new() -> Self {
        Self { gaps: Gaps::new(), queue: BinaryHeap::new() }
    }

    /// Replaces `seen` with the discs that a view sees, as indices into the list given to [`Discs::new`],
    /// roughly nearest first. All discs if the eye is not finite. Takes time proportional to the number of
    /// discs seen, times the logarithm of the number of all discs. If m gaps lie within 1/256 of a turn, as
    /// for an eye far from a forest, each disc seen there also moves up to `16 m` bytes.
    pub fn look(&mut self, discs: &Discs, view: &DiscView, seen: &mut Vec<u32>) {
        seen.clear();
        let DiscView { eye, directions, range, ball } = *view;
        if !eye.iter().all(|x| x.abs() <= MAX_NUMBER) {
            seen.extend(0..discs.len() as u32);
            return;
        }
        // Eyes of the ball see farther, and in more directions, than its centre.
        let range = range + ball;
        self.gaps.begin(directions.filter(|_| ball == 0.0));
        self.queue.clear();
        let Some(top) = discs.levels.len().checked_sub(1) else { return };
        // A disc in range has a nearest point at `d - r <= range`, so its power is at most `range (range + 2
        // r)`, and wrong by `4u (d^2 + r^2)`, or by underflow. A disc that contains the eye is in any range.
        let widest = f64::from(discs.levels[top][0].radius);
        let reach = range + widest;
        let farthest = range * (range + 2.0 * widest) + ROUNDING * (reach * reach) + f64::MIN_POSITIVE;
        self.queue.push(Reverse((0, (top as u32) << INDEX_BITS)));
        while let Some(Reverse((power, code))) = self.queue.pop() {
            if self.gaps.is_closed() || f64::from_bits(power) > farthest {
                break;
            }
            let (level, index) = (code >> INDEX_BITS, (code & ((1 << INDEX_BITS) - 1)) as usize);
            match level {
                DISC => self.take(discs, eye, range, ball, index, seen),
                SOLID => self.close(&discs.discs[index], discs.solid_radii[index] - ball, eye),
                0 => self.open_leaf(discs, eye, index),
                _ => self.open_node(&discs.levels[level as usize - 1], level - 1, eye, index),
            }
        }
    }

    fn open_node(&mut self, below: &[Node], level: u32, eye: [f64; 2], index: usize) {
        let begin = index * FAN;
        for (child, node) in (begin..).zip(below.iter().skip(begin).take(FAN)) {
            let [x0, y0, x1, y1] = node.around(eye);
            let is_open = rectangle_span(x0, y0, x1, y1)
                .is_none_or(|(first, last)| self.gaps.any(first, last, RECTANGLE_ERROR));
            if is_open {
                let power = node.least_power(eye).max(0.0).to_bits();
                self.queue.push(Reverse((power, level << INDEX_BITS | child as u32)));
            }
        }
    }

    fn open_leaf(&mut self, discs: &Discs, eye: [f64; 2], index: usize) {
        let begin = index * LEAF;
        for (index, disc) in (begin..).zip(discs.discs.iter().skip(begin).take(LEAF)) {
            let (x, y) = (disc.center[0] - eye[0], disc.center[1] - eye[1]);
            let power = x * x + y * y - disc.radius * disc.radius;
            if self.shows(x, y, disc.radius, power) {
                self.queue.push(Reverse((power.max(0.0).to_bits(), DISC << INDEX_BITS | index as u32)));
            }
        }
    }

    /// Returns whether a disc shows in a gap or may contain the eye. Its centre is at `(x, y)` relative to
    /// the eye; `power` is `x^2 + y^2 - radius^2`.
    #[inline]
    fn shows(&self, x: f64, y: f64, radius: f64, power: f64) -> bool {
        if power <= 0.0 {
            return true;
        }
        let (first, last, error) = disc_span(x, y, radius, power);
        error > WIDEST_ERROR || self.gaps.any(first, last, error)
    }

    /// Reports the disc `index` if it shows in a gap, and closes the directions that it covers.
    fn take(
        &mut self,
        discs: &Discs,
        eye: [f64; 2],
        range: f64,
        ball: f64,
        index: usize,
        seen: &mut Vec<u32>,
    ) {
        let disc = &discs.discs[index];
        let (x, y) = (disc.center[0] - eye[0], disc.center[1] - eye[1]);
        let squared = x * x + y * y;
        let power = squared - disc.radius * disc.radius;
        let span = (power > 0.0).then(|| disc_span(x, y, disc.radius, power));
        if let Some((first, last, error)) = span
            && error <= WIDEST_ERROR
            && !self.gaps.any(first, last, error)
        {
            return;
        }
        let reach = (range + disc.radius) * (1.0 + ROUNDING);
        if squared <= reach * reach + f64::MIN_POSITIVE {
            seen.push(discs.indices[index]);
        }
        // A disc that contains an eye of the ball hides nothing.
        let clear = (disc.radius + ball) * (1.0 + ROUNDING);
        let Some((first, last, error)) = span.filter(|_| squared > clear * clear) else { return };
        let solid = discs.solid_radii[index];
        if solid < disc.radius {
            // The disc only occludes with its solid radius, so it is queued again with the larger power of
            // this radius.
            let power = (squared - solid * solid).max(0.0).to_bits();
            self.queue.push(Reverse((power, SOLID << INDEX_BITS | index as u32)));
        } else if ball == 0.0 {
            self.gaps.cut(first, last, error);
        } else {
            self.close(disc, solid - ball, eye);
        }
    }

    /// Closes the directions in which a disc with the given radius would be seen. Closes none if the radius
    /// is not positive, or if the eye is inside it.
    fn close(&mut self, disc: &Disc, radius: f64, eye: [f64; 2]) {
        let (x, y) = (disc.center[0] - eye[0], disc.center[1] - eye[1]);
        let power = x * x + y * y - radius * radius;
        if radius > 0.0 && power > 0.0 {
            let (first, last, error) = disc_span(x, y, radius, power);
            self.gaps.cut(first, last, error);
        }
    }
}
