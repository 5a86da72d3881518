//! The visible zone of a moving eye, updated from frame to frame: the tangent segments at the eye, each with
//! its equivalence class.
//!
//! ("Visible Zone Maintenance for Real-Time Occlusion Culling", 2002.) A tangent segment begins at the eye,
//! touches one disc (its pivot), and ends at the next disc beyond (its front), or never. Its class is the set
//! of all segments that result from rolling it along the pivot without touching another disc. As long as each
//! tangent segment at the moving eye stays in its class, the same discs are seen. A class ends where the
//! segment touches a second disc, on one of two fixed lines, which are bitangents of the pivot and another
//! disc. So two tests, linear in the position of the eye, tell whether a segment is still in its class. If
//! nothing changes in a frame, only these tests are made.
//!
//! The paper also stores tangent segments of hidden discs, and updates them recursively when needed. This
//! module only stores the segments at the eye. When classes end, it looks again from scratch between the
//! nearest segments on both sides that are still in their classes. The classes of new segments are derived by
//! a search of the tree of [`Discs`] along the segment.
//!
//! # Why the discs between two held segments are the same
//! Between two neighbouring segments at the eye, one disc is seen, or none. Another disc could only appear
//! across one of the segments, which would touch it then, or at the eye, by the eye leaving the disc. An eye
//! so close to a disc ends the classes of that disc's own segments first. The set of eyes that keep a segment
//! in its class is convex, so this holds on the whole way between two frames.

use super::gaps::cut_list;
use super::tree::{Disc, Discs, FAN};
use super::zone::{DiscView, DiscZone, WIDEST_ERROR};
use crate::cdt::predicates::MAX_MAGNITUDE;
use crate::directions::disc_span;
use crate::median_order::LEAF;
use alloc::vec::Vec;
use smallvec::SmallVec;
use visibility_core::geometry::sqrt;

/// Index that no disc has.
const NONE: u32 = u32::MAX;

/// Margin for the rounding error of a distance from a bitangent (a line that touches two discs), as a
/// fraction of the sum of the lengths from which the distance is computed. The rounding error itself is about
/// `1e-12` of that sum for bitangents that pass the test of [`MIN_SINE`].
const MARGIN: f64 = 1e-9;

/// Least sine of the angle between a bitangent and the perpendicular to the line through both centres. Below
/// this value, the rounding error of the bitangent is too large.
const MIN_SINE: f64 = 1e-4;

/// Counters of the work of a [`KineticZone`]'s last move.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
#[non_exhaustive]
pub struct ZoneWork {
    /// Number of tangent segments at the eye after the move.
    pub segments: usize,
    /// Number of tangent segments that touch another disc than before, or end at another disc (elementary
    /// steps of the zone).
    pub steps: usize,
    /// Number of tangent segments that may have changed their discs, because the eye has left the region
    /// where they certainly keep them, or moved beyond the zone's reach.
    pub ended: usize,
    /// Whether all segments were rebuilt: in the first move, for an eye that touches a disc or has moved far,
    /// and if rounding is undecided. If false, only segments that may have changed their discs were rebuilt.
    pub rebuilt: bool,
}

/// Half-plane of eye positions with `normal . (eye - anchor) + offset > 0`.
#[derive(Clone, Copy, Debug, Default)]
struct HalfPlane {
    normal: [f64; 2],
    offset: f64,
}

/// Eye positions for which a tangent segment certainly keeps its class: the disc that it touches (pivot), and
/// the disc where it ends (front).
#[derive(Clone, Copy, Debug, Default)]
struct Class {
    anchor: [f64; 2],
    /// Square of the distance in metres of an eye from `anchor`, up to which the segment's class is known.
    /// Negative if it is unknown.
    reach_squared: f64,
    bounds: [HalfPlane; 2],
}

impl Class {
    const ENDED: Self = Self {
        anchor: [0.0; 2],
        reach_squared: -1.0,
        bounds: [HalfPlane { normal: [0.0; 2], offset: 0.0 }; 2],
    };

    fn holds(&self, eye: [f64; 2]) -> bool {
        let [x, y] = minus(eye, self.anchor);
        x * x + y * y <= self.reach_squared
            && self.bounds.iter().all(|b| b.normal[0] * x + b.normal[1] * y + b.offset > 0.0)
    }
}

/// Range of directions in which the same disc is seen, and the tangent segment at its clockwise end.
#[derive(Clone, Copy, Debug)]
struct Arc {
    /// Index in `Discs::discs` of the disc seen in the arc, [`NONE`] if there is none.
    disc: u32,
    pivot: u32,
    front: u32,
    /// Which of the two tangents from the eye to the pivot (the disc that the segment touches) the segment
    /// lies on: true for the first one counter-clockwise, false for the second.
    is_first: bool,
    class: Class,
}

/// Set of the discs that a moving eye sees, updated from frame to frame.
///
/// # Exactness
/// The discs reported are those that [`DiscZone::look`] reports for the same eye, in another order. Nothing
/// visible is left out: if rounding leaves undecided whether the discs seen have changed, they are computed
/// from scratch. If any discs overlap or touch, or have radius 0, each move computes the discs from scratch.
///
/// ```
/// use visibility_2d::discs::{Disc, Discs, KineticZone};
/// let disc = |x: f64, y: f64| Disc { center: [x, y], radius: 1.0 };
/// let discs = Discs::new(&[disc(5.0, 0.0), disc(10.0, 0.5), disc(0.0, 7.0)])?;
/// let mut zone = KineticZone::new(&discs, 2.0);
/// assert_eq!(zone.move_to([0.0, 0.0]).len(), 2);
/// assert_eq!(zone.move_to([0.1, 0.0]).len(), 2);
/// assert!(!zone.work().rebuilt && zone.work().steps == 0);
/// # Ok::<(), visibility_2d::discs::DiscError>(())
/// ```
#[derive(Clone, Debug)]
pub struct KineticZone<'a> {
    discs: &'a Discs,
    reach: f64,
    /// For each disc, by the caller's index, its index in `discs.discs`.
    places: Vec<u32>,
    zone: DiscZone,
    /// Arcs around the eye, counter-clockwise. Empty if the zone must be rebuilt.
    arcs: Vec<Arc>,
    next_arcs: Vec<Arc>,
    is_held: Vec<bool>,
    painter: Painter,
    looked: Vec<u32>,
    seen: Vec<u32>,
    /// For each disc, by its index in `discs.discs`, the number of the last move that reported it.
    marks: Vec<u32>,
    mark: u32,
    work: ZoneWork,
}

/// Assigns each direction to the first disc that covers it, in front-to-back order.
#[derive(Clone, Debug, Default)]
struct Painter {
    /// Direction ranges not covered by any disc so far, ascending, as direction numbers.
    open: Vec<(f64, f64)>,
    /// Direction number at which a disc starts to be visible, the disc's index in `Discs::discs` or [`NONE`],
    /// and its place among the discs that were painted.
    runs: Vec<(f64, u32, usize)>,
}

impl Painter {
    fn begin(&mut self, first: f64, last: f64) {
        self.runs.clear();
        self.open.clear();
        self.open.push((first, last));
    }

    /// Assigns the open directions from `first` to `last` to a disc. Returns whether there were any.
    fn paint(&mut self, first: f64, last: f64, disc: u32) -> bool {
        let wrapped = [(first, last + 4.0), (first - 4.0, last), (first + 4.0, last + 8.0)];
        let plain = [(first, last), (first + 4.0, last + 4.0)];
        let spans = if first > last { &wrapped[..] } else { &plain[..] };
        let before = self.runs.len();
        for &(first, last) in spans {
            let begin = self.open.partition_point(|gap| gap.1 <= first);
            let end = begin + self.open[begin..].partition_point(|gap| gap.0 < last);
            if begin == end {
                continue;
            }
            self.runs.extend(self.open[begin..end].iter().map(|gap| (gap.0.max(first), disc, before)));
            cut_list(&mut self.open, first, last);
        }
        self.runs.len() > before
    }

    /// Assigns the directions that are still open to [`NONE`], and orders all arcs by direction.
    fn finish(&mut self) {
        self.runs.extend(self.open.iter().map(|gap| (gap.0, NONE, usize::MAX)));
        // A disc thinner than rounding begins where it ends, and stays before what is behind it.
        self.runs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
        self.runs.dedup_by_key(|run| run.1);
    }
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn left_of([x, y]: [f64; 2]) -> [f64; 2] {
    [-y, x]
}

impl<'a> KineticZone<'a> {
    /// Makes a zone without an eye. The regions in which the tangent segments at the eye stay the same are
    /// derived for eyes within `reach` metres of the present one. A good reach is some tens of times the
    /// distance that the eye moves in a frame; a greater one makes the derivation slower. NaN and negative
    /// numbers count as 0, with which each move starts from scratch.
    pub fn new(discs: &'a Discs, reach: f64) -> Self {
        let mut places = alloc::vec![0; discs.len()];
        for (place, &index) in (0..).zip(&discs.indices) {
            places[index as usize] = place;
        }
        Self {
            discs,
            reach: reach.max(0.0),
            places,
            zone: DiscZone::new(),
            arcs: Vec::new(),
            next_arcs: Vec::new(),
            is_held: Vec::new(),
            painter: Painter::default(),
            looked: Vec::new(),
            seen: Vec::new(),
            marks: alloc::vec![0; discs.len()],
            mark: 0,
            work: ZoneWork::default(),
        }
    }

    /// Returns the counters of the last move.
    pub fn work(&self) -> ZoneWork {
        self.work
    }

    /// Moves the eye in a straight line to `eye`, and returns the discs visible from there, each once, as
    /// indices into the list given to [`Discs::new`]. Returns all discs if `eye` is not finite.
    pub fn move_to(&mut self, eye: [f64; 2]) -> &[u32] {
        self.is_held.clear();
        self.is_held.extend(self.arcs.iter().map(|arc| arc.class.holds(eye)));
        let held = self.is_held.iter().filter(|&&held| held).count();
        let ended = self.arcs.len() - held;
        self.work = ZoneWork { ended, segments: self.arcs.len(), ..ZoneWork::default() };
        if held < 2 || ended > held || (ended > 0 && self.mend(eye).is_none()) {
            self.rebuild(eye);
        } else if ended > 0 {
            core::mem::swap(&mut self.arcs, &mut self.next_arcs);
            self.list();
        }
        self.work.segments = self.arcs.len();
        &self.seen
    }

    /// Replaces `seen` with the discs of all arcs.
    fn list(&mut self) {
        self.seen.clear();
        self.mark = self.mark.wrapping_add(1);
        if self.mark == 0 {
            self.marks.fill(0);
            self.mark = 1;
        }
        for arc in &self.arcs {
            if arc.disc != NONE
                && core::mem::replace(&mut self.marks[arc.disc as usize], self.mark) != self.mark
            {
                self.seen.push(self.discs.indices[arc.disc as usize]);
            }
        }
    }

    /// Computes the arcs from scratch. Leaves them empty if rounding makes them undecided.
    fn rebuild(&mut self, eye: [f64; 2]) {
        self.work.rebuilt = true;
        self.arcs.clear();
        self.zone.look(self.discs, &DiscView::new(eye), &mut self.looked);
        self.seen.clear();
        self.seen.extend_from_slice(&self.looked);
        if !self.discs.are_disjoint || self.reach == 0.0 || !eye.iter().all(|x| x.abs() <= MAX_MAGNITUDE) {
            return;
        }
        if self.paint(eye, (0.0, 4.0), &[]).is_none() {
            return;
        }
        // The runs before and after direction 0 are one.
        let runs = &mut self.painter.runs;
        if runs.len() > 1 && runs[0].1 == runs[runs.len() - 1].1 {
            runs.pop();
        }
        let count = self.painter.runs.len();
        for at in 0..if count > 1 { count } else { 0 } {
            let [before, disc] = [(at + count - 1) % count, at].map(|k| self.painter.runs[k].1);
            let arc = self.arc(eye, before, disc);
            self.arcs.push(arc);
        }
    }

    /// Assigns directions to the discs that the last look found (`looked`), nearest first. `None` if rounding
    /// cannot tell that the eye is outside a disc. Also `None` if no direction is left for a disc, except for
    /// those in `beside`, a list of indices into `Discs::discs`. `between` has the first and the last
    /// direction number; the last may exceed 4.
    fn paint(&mut self, eye: [f64; 2], between: (f64, f64), beside: &[u32]) -> Option<()> {
        self.painter.begin(between.0, between.1);
        for &index in &self.looked {
            let place = self.places[index as usize];
            let (first, last) = span(&self.discs.discs[place as usize], eye)?;
            if !self.painter.paint(first, last, place) && !beside.contains(&place) {
                return None;
            }
        }
        self.painter.finish();
        Some(())
    }

    /// Makes `next_arcs` from the present arcs, and recomputes the arcs beside tangent segments whose class
    /// has ended. `None` if the zone must be rebuilt.
    fn mend(&mut self, eye: [f64; 2]) -> Option<()> {
        self.next_arcs.clear();
        let count = self.arcs.len();
        let start = self.is_held.iter().position(|&held| held)?;
        let mut at = start;
        while at < start + count {
            let end = (at + 1..=start + count).find(|k| self.is_held[k % count])?;
            let [begin, old_last, stop] = [at, end - 1, end].map(|k| self.arcs[k % count]);
            self.next_arcs.push(begin);
            if end > at + 1 {
                let (first, last) = (self.number(begin, eye)?, self.number(stop, eye)?);
                let view = DiscView::new(eye).with_directions(first, last);
                self.zone.look(self.discs, &view, &mut self.looked);
                let beside = [begin.pivot, begin.front, stop.pivot, stop.front];
                self.paint(eye, (first, if first < last { last } else { last + 4.0 }), &beside)?;
                let runs = &self.painter.runs;
                // Beside segments that are still in their classes, the same discs must be seen as before.
                if runs.first()?.1 != begin.disc || runs.last()?.1 != old_last.disc {
                    return None;
                }
                for k in 1..runs.len() {
                    let arc = self.arc(eye, self.painter.runs[k - 1].1, self.painter.runs[k].1);
                    let is_same = |old: &Arc| {
                        (old.pivot, old.front, old.is_first) == (arc.pivot, arc.front, arc.is_first)
                    };
                    let is_old = (at + 1..end).any(|k| is_same(&self.arcs[k % count]));
                    self.work.steps += usize::from(!is_old);
                    self.next_arcs.push(arc);
                }
            }
            at = end;
        }
        Some(())
    }

    /// Returns the direction number of an arc's tangent segment. `None` for an eye inside the arc's pivot, or
    /// too near to it for the rounding.
    fn number(&self, arc: Arc, eye: [f64; 2]) -> Option<f64> {
        let (first, last) = span(&self.discs.discs[arc.pivot as usize], eye)?;
        Some(if arc.is_first { first } else { last })
    }

    /// Makes the arc in which `disc` is seen. `before` is the disc of the previous arc counter-clockwise. One
    /// of the two may be [`NONE`].
    fn arc(&self, eye: [f64; 2], before: u32, disc: u32) -> Arc {
        let power = |index: u32| {
            let Some(disc) = self.discs.discs.get(index as usize) else { return f64::INFINITY };
            let away = minus(disc.center, eye);
            dot(away, away) - disc.radius * disc.radius
        };
        let is_first = power(disc) < power(before);
        let (pivot, front) = if is_first { (disc, before) } else { (before, disc) };
        let class = self.class(eye, pivot, front, is_first).unwrap_or(Class::ENDED);
        Arc { disc, pivot, front, is_first, class }
    }

    /// Derives the eye positions for which a tangent segment keeps its pivot (the disc that it touches) and
    /// its front (the disc where it ends). `None` if rounding makes them undecided.
    fn class(&self, eye: [f64; 2], pivot: u32, front: u32, is_first: bool) -> Option<Class> {
        let mut search = Search::new(self.discs, eye, pivot, front, is_first, self.reach)?;
        let mut stack: SmallVec<[(usize, usize); 64]> = SmallVec::new();
        stack.push((self.discs.levels.len() - 1, 0));
        if front != NONE {
            search.limit_by(front)?;
        }
        while let Some((level, index)) = stack.pop() {
            if level > 0 {
                let below = &self.discs.levels[level - 1];
                for (child, node) in (index * FAN..).zip(below.iter().skip(index * FAN).take(FAN)) {
                    if search.may_touch(node.around(eye)) {
                        stack.push((level - 1, child));
                    }
                }
                continue;
            }
            for at in index * LEAF..self.discs.len().min(index * LEAF + LEAF) {
                let Disc { center: [x, y], radius } = self.discs.discs[at];
                let (x, y) = (x - eye[0], y - eye[1]);
                let is_other = at as u32 != pivot && at as u32 != front;
                if is_other && search.may_touch([x - radius, y - radius, x + radius, y + radius]) {
                    search.limit_by(at as u32)?;
                }
            }
        }
        search.finish()
    }
}

/// Returns the direction numbers of a disc's tangents. `None` for an eye inside the disc, or too near to it
/// for the rounding.
fn span(disc: &Disc, eye: [f64; 2]) -> Option<(f64, f64)> {
    let [x, y] = minus(disc.center, eye);
    let power = x * x + y * y - disc.radius * disc.radius;
    let (first, last, error) = (power > 0.0).then(|| disc_span(x, y, disc.radius, power))?;
    (error <= WIDEST_ERROR).then_some((first, last))
}

/// Last position to which a tangent segment can roll along the disc that it touches: the segment's unit
/// direction in that position, and the sine of the angle to it from the present direction.
#[derive(Clone, Copy, Debug)]
struct Bound {
    along: [f64; 2],
    sine: f64,
}

/// Search for the bitangents up to which a tangent segment can roll along its pivot, the disc that it
/// touches.
struct Search<'a> {
    discs: &'a [Disc],
    eye: [f64; 2],
    pivot: Disc,
    front: Option<Disc>,
    /// Signed distance of the centre of the pivot (the disc that the segment touches) to the left of the
    /// segment: plus or minus the pivot's radius.
    aside: f64,
    /// Unit direction of the segment.
    along: [f64; 2],
    /// Length of the segment from the eye to the pivot, the disc that the segment touches, in metres.
    length: f64,
    reach: f64,
    /// Greatest distance from the eye, in metres along the segment, at which the segment may meet `front`,
    /// the disc that stops it. Infinite if no disc stops it.
    farthest: f64,
    /// Nearest bitangents found so far on the clockwise and on the counter-clockwise side of the segment.
    bounds: [Bound; 2],
}

impl<'a> Search<'a> {
    fn new(
        discs: &'a Discs,
        eye: [f64; 2],
        pivot: u32,
        front: u32,
        is_first: bool,
        reach: f64,
    ) -> Option<Self> {
        let discs = &discs.discs[..];
        let pivot = *discs.get(pivot as usize)?;
        let front = discs.get(front as usize).copied();
        let [x, y] = minus(pivot.center, eye);
        let squared = x * x + y * y;
        let length = sqrt(squared - pivot.radius * pivot.radius);
        let aside = if is_first { pivot.radius } else { -pivot.radius };
        let along = [(x * length + y * aside) / squared, (y * length - x * aside) / squared];
        // Eyes of the class are outside of the pivot, before the point of contact.
        let reach = reach.min(0.5 * (sqrt(squared) - pivot.radius));
        let sine = (1.5 * reach / length).min(0.5);
        let cosine = sqrt(1.0 - sine * sine);
        let bounds = [-sine, sine].map(|sine| {
            let along = [along[0] * cosine - along[1] * sine, along[1] * cosine + along[0] * sine];
            Bound { along, sine }
        });
        let farthest = front.map_or(f64::INFINITY, |front| {
            let away = minus(front.center, eye);
            sqrt(dot(away, away)) + 2.0 * reach
        });
        // The square of a lesser reach underflows, and would hold eyes beyond it.
        let is_good = reach > 0.0 && reach * reach >= f64::MIN_POSITIVE && sine > 0.0;
        is_good.then_some(Self { discs, eye, pivot, front, aside, along, length, reach, farthest, bounds })
    }

    /// Returns whether the segment may meet a rectangle while it rolls from one bound to the other. The
    /// rectangle is given by its least x and y and its greatest x and y, relative to the eye.
    fn may_touch(&self, [x0, y0, x1, y1]: [f64; 4]) -> bool {
        let [u, v] = self.along;
        let (x, y) = (0.5 * (x0 + x1), 0.5 * (y0 + y1));
        let (half_x, half_y) = (0.5 * (x1 - x0), 0.5 * (y1 - y0));
        // Coordinates along the segment and to its left.
        let (ahead, half_ahead) = (x * u + y * v, half_x * u.abs() + half_y * v.abs());
        let (left, half_left) = (y * u - x * v, half_y * u.abs() + half_x * v.abs());
        if ahead + half_ahead < -2.0 * self.reach || ahead - half_ahead > self.farthest {
            return false;
        }
        // A segment rotated by angle d is at height (x - length) tan d. Rolling shifts it sideways by up to r
        // (1 / cos d - 1) <= r sin^2 d, for sines up to 1/2.
        let (mut low, mut high, mut roll) = (f64::INFINITY, f64::NEG_INFINITY, 0.0f64);
        for Bound { sine, .. } in self.bounds {
            let tangent = sine / sqrt(1.0 - sine * sine);
            for x in [ahead - half_ahead, ahead + half_ahead] {
                let height = (x - self.length) * tangent;
                (low, high) = (low.min(height), high.max(height));
            }
            roll = roll.max(sine * sine);
        }
        let slack = self.pivot.radius * roll + MARGIN * (ahead.abs() + half_ahead + self.length + self.reach);
        let misses = left - half_left > high + slack || left + half_left < low - slack;
        !misses
    }

    /// Narrows the bounds to the directions before the segment first touches a disc. `None` if rounding makes
    /// this undecided.
    fn limit_by(&mut self, index: u32) -> Option<()> {
        let disc = self.discs[index as usize];
        let between = minus(disc.center, self.pivot.center);
        let squared = dot(between, between);
        let to_disc = minus(disc.center, self.eye);
        // A segment with left normal n touches the disc where n . between + aside is radius or -radius.
        for height in [disc.radius - self.aside, -disc.radius - self.aside] {
            let root = sqrt(squared - height * height);
            // Negated comparison, so that NaN, which overlapping discs can give, is refused. The products of
            // a lesser square underflow, and the bitangent may point anywhere.
            let is_known = root > MIN_SINE * sqrt(squared) && squared >= f64::MIN_POSITIVE;
            if !is_known {
                return None;
            }
            for root in [root, -root] {
                let across = left_of(between);
                let normal = [0, 1].map(|k| (height * between[k] + root * across[k]) / squared);
                let along = [normal[1], -normal[0]];
                if dot(along, self.along) <= 0.0 {
                    continue;
                }
                // The point of contact is behind the eye, or beyond the front.
                let at = dot(to_disc, along);
                let slack = MARGIN * (at.abs() + self.length);
                let is_beyond =
                    self.front.is_some_and(|front| at > dot(minus(front.center, self.eye), along) + slack);
                if at < -self.reach - slack || is_beyond {
                    continue;
                }
                let sine = cross(self.along, along);
                let bound = &mut self.bounds[usize::from(sine > 0.0)];
                if sine.abs() < bound.sine.abs() {
                    *bound = Bound { along, sine };
                }
            }
        }
        Some(())
    }

    /// Returns the eye positions between the two bounds. `None` if the eye lies on one of them.
    fn finish(&self) -> Option<Class> {
        let from_pivot = minus(self.eye, self.pivot.center);
        let size = from_pivot[0].abs() + from_pivot[1].abs() + self.reach;
        let mut bounds = [HalfPlane::default(); 2];
        for (k, sign) in [(0, -1.0), (1, 1.0)] {
            // Eyes of the class are to the right of the clockwise bound, and to the left of the
            // counter-clockwise one.
            let normal = left_of(self.bounds[k].along).map(|x| sign * x);
            let offset = dot(normal, from_pivot) + sign * self.aside - MARGIN * size;
            let is_inside = offset > 0.0;
            if !is_inside {
                return None;
            }
            bounds[k] = HalfPlane { normal, offset };
        }
        Some(Class { anchor: self.eye, reach_squared: self.reach * self.reach, bounds })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::Random;

    /// A disc whose tangents have one direction number shows there, and covers nothing of what is behind it.
    /// A disc around the direction 0, whose first direction number exceeds its last, covers both ends.
    #[test]
    fn a_disc_thinner_than_rounding_covers_nothing() {
        let mut painter = Painter::default();
        painter.begin(0.0, 4.0);
        let painted = [(1.0, 1.0, 7), (0.5, 1.5, 8), (3.5, 0.25, 9)]
            .map(|(first, last, disc)| painter.paint(first, last, disc));
        assert_eq!(painted, [true; 3], "a thin disc, one behind it, and one around the direction 0");
        painter.finish();
        let runs: Vec<_> = painter.runs.iter().map(|run| (run.0, run.1)).collect();
        let expected = [(0.0, 9), (0.25, NONE), (0.5, 8), (1.0, 7), (1.0, 8), (1.5, NONE), (3.5, 9)];
        assert_eq!(runs, expected, "first directions and discs");
    }

    /// Points on the segment in any position that it rolls to are not left out, nor are those it nearly
    /// touches; points behind the eye, beyond the front and to either side are.
    #[test]
    fn segments_touch_what_they_roll_over() {
        let mut random = Random(27);
        for round in 0..2_000 {
            let turn = random.fine_range(0.0, 7.0);
            let at = |ahead: f64| [ahead * turn.cos(), ahead * turn.sin()];
            let pivot = Disc { center: at(random.fine_range(1.5, 4.0)), radius: 1.0 };
            let made = Discs::new(&[pivot, Disc { center: at(30.0), radius: 1.0 }]).unwrap();
            let of =
                |center: [f64; 2]| made.discs.iter().position(|disc| disc.center == center).unwrap() as u32;
            let (is_first, reach) = (random.one_in(2), random.fine_range(0.01, 2.0));
            let search =
                Search::new(&made, [0.0; 2], of(pivot.center), of(at(30.0)), is_first, reach).unwrap();
            for share in [-1.0, 1.0, random.fine_range(-1.0, 1.0)] {
                let sine = share * search.bounds[1].sine;
                let cosine = sqrt(1.0 - sine * sine);
                let [u, v] = search.along;
                let along = [u * cosine - v * sine, v * cosine + u * sine];
                let foot = [0, 1].map(|k| pivot.center[k] - search.aside * left_of(along)[k]);
                let by = random.fine_range(-search.length, 20.0);
                let [x, y] = [0, 1].map(|k| foot[k] + by * along[k]);
                assert!(search.may_touch([x, y, x, y]), "round {round}: {x}, {y} on the segment, {share}");
            }
            let point = |ahead: f64, aside: f64| {
                let [x, y] = [0, 1].map(|k| ahead * search.along[k] + aside * left_of(search.along)[k]);
                search.may_touch([x, y, x, y])
            };
            let reach = search.reach;
            assert!(!point(-2.1 * reach, 0.0), "round {round}: behind the eye");
            assert!(!point(search.farthest + 1e-6, 0.0), "round {round}: beyond the front");
            assert!(
                !point(search.length, 0.3) && !point(search.length, -0.3),
                "round {round}: beside the pivot"
            );
        }
    }
}
