//! Prefetch: the objects that become visible along a path of the eye, in the order in which they become
//! visible.
//!
//! Based on: the prediction of viewcells ahead in Thomas Funkhouser, Carlo Sequin and Seth Teller,
//! "Management of Large Amounts of Data in Interactive Building Walkthroughs", 1992.

use super::{ScenePvs, Viewcell, ViewcellId, Viewcells, reached};
use crate::ObjectId;
use alloc::vec::Vec;
use glam::DVec3;

/// Margin for rounding by which each bound of a viewcell is moved outwards, as a fraction of the greatest
/// absolute coordinate of path and viewcell. The margin covers four roundings. The moved bound, its distance
/// from the start of the path, and the caller's own point of the path err by at most `EPSILON` of that
/// coordinate each. The parameter that [`cut`] computes as a quotient errs by `EPSILON` of itself, which
/// moves the point of the path by at most `EPSILON` of twice that coordinate.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// An object that becomes visible along a path.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub struct Arrival {
    /// Seconds from now until the eye reaches the first viewcell from which the object is seen. Greater than
    /// 0.
    pub seconds: f64,
    /// Object that may become visible.
    pub object: ObjectId,
}

/// Finds the objects that become visible while the eye keeps its velocity, so that they are loaded in time.
/// Holds scratch memory; once this memory is large enough, searches allocate nothing.
///
/// ```
/// use visibility_core::pvs::{Prefetch, Pvs, PvsTargets, ScenePvs, Viewcell, Viewcells};
/// use visibility_core::{glam::DVec3, Aabb, Scene};
/// let mut scene = Scene::new();
/// let [here, there] = [5.0, 15.0].map(|x| scene.insert(Aabb::from_arrays([x, 0.0, 0.0], [x + 1.0,
///     1.0, 1.0])));
/// // From the first room only the first object is seen.
/// let pvs = Pvs::new(PvsTargets::Objects, 2, &[vec![0], vec![0, 1]], |_| [])?;
/// let rooms = [0.0, 10.0].map(|x| Viewcell::from_box(DVec3::new(x, -5.0, -5.0), DVec3::new(x + 10.0,
///     5.0, 5.0)));
/// let sets = ScenePvs::new(&scene, pvs, Viewcells::new(rooms), [(here, 0), (there, 1)]);
/// let mut prefetch = Prefetch::new();
/// // The eye moves at 2 metres a second from x = 6, so it reaches the second room in 2 seconds.
/// let ahead = prefetch.search(&sets, DVec3::new(6.0, 0.0, 0.0), DVec3::X * 2.0, 0.0, 10.0);
/// assert_eq!((ahead.len(), ahead[0].object), (1, there));
/// assert!((ahead[0].seconds - 2.0).abs() < 1e-9);
/// assert!((prefetch.covered_seconds() - 7.0).abs() < 1e-9, "the rooms end at x = 20");
/// # Ok::<(), visibility_core::pvs::PvsError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Prefetch {
    /// Viewcells near the path, with the parameter of the path (0 at its start, 1 at its end) at which each
    /// is reached.
    reached: Vec<(f64, ViewcellId)>,
    /// First and last parameter (0 to 1) of each part of the path on which the eye is in some viewcell.
    inside: Vec<[f64; 2]>,
    /// Indexed by target: parameter (0 to 1) of the path at which the target is first seen; infinity if it is
    /// never seen.
    first: Vec<f64>,
    seen: Vec<u64>,
    row: Vec<u64>,
    arrivals: Vec<Arrival>,
    covered: f64,
}

impl Prefetch {
    /// Makes empty scratch memory. It grows with the first searches.
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns the objects that are not visible now, and become visible within `seconds` while an eye at
    /// `eye` (metres in world space) moves with `velocity` (metres a second). Sorted by the time at which
    /// they become visible, then by [index](ObjectId::index).
    ///
    /// A viewcell counts as reached when the eye is within `reach` metres of it along each axis, plus the
    /// [misplacement](Viewcells::misplacement) of viewcells. `reach` is the distance from the eye at which
    /// lines of sight begin, such as that of the corners of the near plane, or 0. The listed time of an
    /// object is never later than the time at which a [`PvsCuller`](super::PvsCuller) first shows it, with
    /// two exceptions, in which that culler shows every object: where lines of sight begin outside all
    /// viewcells, and in views that do not draw all occluders of the PVS, such as one of other layers, or one
    /// from beyond the draw range of an occluder. Objects that the PVS never hides are not listed. Changes of
    /// objects since the [`ScenePvs`] was made are not taken into account. While the eye is outside all
    /// viewcells every object counts as visible, though not listed: see
    /// [`covered_seconds`](Self::covered_seconds).
    ///
    /// Empty for numbers that are not finite, and for negative `reach` or `seconds`. Time is linear in the
    /// number of objects and, for each viewcell reached, in the bytes of its row and the number of targets.
    pub fn search(
        &mut self,
        sets: &ScenePvs,
        eye: DVec3,
        velocity: DVec3,
        reach: f64,
        seconds: f64,
    ) -> &[Arrival] {
        self.arrivals.clear();
        self.covered = 0.0;
        let path = Path { start: eye, step: velocity * seconds };
        let is_usable = |number: f64| (0.0..f64::INFINITY).contains(&number);
        if !(is_usable(reach) && is_usable(seconds) && path.start.is_finite() && path.step.is_finite()) {
            return &[];
        }
        self.follow(sets.viewcells(), &path, reach);
        self.covered *= seconds;

        let pvs = sets.pvs();
        self.first.clear();
        self.first.resize(sets.target_limit(), f64::INFINITY);
        self.seen.clear();
        for &(part, viewcell) in &self.reached {
            if !pvs.write_first_bits(viewcell, sets.target_limit(), &mut self.row) {
                // A viewcell unknown to the PVS: every target counts as visible from it.
                self.row.fill(u64::MAX);
            }
            self.seen.resize(self.row.len(), 0);
            for (word, (seen, row)) in self.seen.iter_mut().zip(&self.row).enumerate() {
                let mut new = row & !*seen;
                *seen |= row;
                while new != 0 {
                    if let Some(first) = self.first.get_mut(word * 64 + new.trailing_zeros() as usize) {
                        *first = part;
                    }
                    new &= new - 1;
                }
            }
        }
        for (object, targets) in sets.objects() {
            let first = |&target: &u32| self.first.get(target as usize).copied().unwrap_or(0.0);
            let part = targets.iter().map(first).fold(f64::INFINITY, f64::min);
            if part > 0.0 && part <= 1.0 {
                self.arrivals.push(Arrival { seconds: part * seconds, object });
            }
        }
        let key = |arrival: &Arrival| (arrival.seconds, arrival.object.index());
        self.arrivals.sort_unstable_by(|a, b| {
            let ((a, i), (b, j)) = (key(a), key(b));
            a.total_cmp(&b).then(i.cmp(&j))
        });
        &self.arrivals
    }

    /// Returns for how many seconds the eye of the last [search](Self::search) stays inside viewcells, not
    /// more than the seconds of the search. After that every object counts as visible, as it may do already
    /// while the eye is within `reach` of a place outside all viewcells.
    pub fn covered_seconds(&self) -> f64 {
        self.covered
    }

    /// Fills `reached`, soonest first, and sets `covered` to the parameter (0 to 1) of the path up to which
    /// the eye stays inside viewcells.
    fn follow(&mut self, viewcells: &Viewcells, path: &Path, reach: f64) {
        // At least the margin of `Viewcells::reached` for all points of the path, which nothing cuts.
        let magnitude = path.start.abs().max_element() + path.step.abs().max_element() + reach;
        let reach = reach + viewcells.misplacement() + reached::ROUNDING * magnitude;
        let Self { reached, inside, covered, .. } = self;
        reached.clear();
        inside.clear();
        viewcells.for_each_accepted(
            |min, max| path.part_in_box(min, max, reach).is_some(),
            |cell, id| {
                reached.extend(path.part_in_cell(cell, reach).map(|[from, _]| (from, id)));
                inside.extend(path.part_in_cell(cell, 0.0));
            },
        );
        reached.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        inside.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
        for &[from, to] in inside.iter() {
            if from > *covered {
                break;
            }
            *covered = covered.max(to);
        }
    }
}

/// A segment in world space, in metres: the points `start + t * step` for `t` from 0 to 1.
struct Path {
    start: DVec3,
    step: DVec3,
}

impl Path {
    /// Returns the first and the last `t` at which the point of the path is within `reach` of a box along
    /// each axis. `None` if the path misses the box. Rounding can only make the part longer.
    fn part_in_box(&self, min: DVec3, max: DVec3, reach: f64) -> Option<[f64; 2]> {
        let (mut from, mut to) = (0.0f64, 1.0f64);
        for axis in 0..3 {
            let (start, step) = (self.start[axis], self.step[axis]);
            // Signed distances from the two sides of the box, positive inside. Each side has a margin of its
            // own, since the other side may be infinite.
            for (side, height, slope) in
                [(min[axis], start - min[axis], step), (max[axis], max[axis] - start, -step)]
            {
                let margin = reach + ROUNDING * (start.abs() + step.abs() + reach + side.abs());
                (from, to) = cut([from, to], height + margin, slope)?;
            }
        }
        Some([from, to])
    }

    /// Returns the first and the last `t` at which the point of the path is within `reach` of a viewcell
    /// along each axis, like [`part_in_box`](Self::part_in_box). `None` if the path misses the viewcell.
    fn part_in_cell(&self, cell: &Viewcell, reach: f64) -> Option<[f64; 2]> {
        let [mut from, mut to] = self.part_in_box(cell.min, cell.max, reach)?;
        let magnitude = self.start.abs() + self.step.abs() + reach;
        for plane in &cell.planes {
            // Upper bound on the height above the plane of all points within `reach` of the path's start.
            let more = reach * plane.normal.abs().element_sum() + 4.0 * plane.error_bound(magnitude);
            let height = plane.signed_distance(self.start) + more;
            (from, to) = cut([from, to], height, plane.normal.dot(self.step))?;
        }
        Some([from, to])
    }
}

/// Returns the part of a range of the parameter `t` in which `height + t * slope` is at least 0. `None` if
/// this is empty. If `height` is NaN, returns the whole range.
fn cut([from, to]: [f64; 2], height: f64, slope: f64) -> Option<(f64, f64)> {
    let root = -height / slope;
    let (from, to) = if slope > 0.0 {
        (from.max(root), to)
    } else if slope < 0.0 {
        (from, to.min(root))
    } else if height < 0.0 {
        return None;
    } else {
        (from, to)
    };
    (from <= to).then_some((from, to))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Plane;
    use visibility_testing::Random;

    /// The end of a path as a caller computes it is in a box that begins there, and within `reach` of one
    /// that begins that much farther.
    #[test]
    fn the_callers_own_end_of_a_path_is_in_a_box_that_begins_there() {
        let mut random = Random(4);
        for case in 0..3000 {
            let (start, velocity) = (random.fine_vector(9.0), random.fine_vector(2.0));
            let (seconds, axis) = (random.fine_unit() * 3.0, case % 3);
            let (path, end) = (Path { start, step: velocity * seconds }, start + velocity * seconds);
            for reach in [0.0, random.fine_unit()] {
                let [mut min, mut max] = [DVec3::NEG_INFINITY, DVec3::INFINITY];
                // The sum is rounded, so that a step nearer is within `reach`.
                match (velocity[axis] > 0.0, reach > 0.0) {
                    (true, false) => min[axis] = end[axis],
                    (false, false) => max[axis] = end[axis],
                    (true, true) => min[axis] = (end[axis] + reach).next_down(),
                    (false, true) => max[axis] = (end[axis] - reach).next_up(),
                }
                let part = path.part_in_box(min, max, reach);
                assert!(part.is_some(), "case {case}: {start} to {end}, reach {reach}, from {min} to {max}");
            }
        }
    }

    /// A path that begins or ends in a viewcell, by exact arithmetic with whole numbers, meets it.
    #[test]
    fn a_path_with_an_end_on_a_face_meets_the_viewcell() {
        let mut random = Random(9);
        let (mut kept, mut rounded) = (0, 0);
        for case in 0..4000 {
            let mut whole = |bits: u32| [(); 3].map(|()| i128::from(random.between(-(1 << bits), 1 << bits)));
            let (normal, start, end) = (whole(29), whole(30), whole(30));
            let at = |[x, y, z]: [i128; 3]| DVec3::new(x as f64, y as f64, z as f64);
            let dot = |p: [i128; 3]| normal[0] * p[0] + normal[1] * p[1] + normal[2] * p[2];
            let on_face = if case % 2 == 0 { start } else { end };
            let offset = -dot(on_face) as f64;
            let plane = Plane::new(at(normal), offset);
            if dot(on_face) + (offset as i128) < 0 {
                continue;
            }
            kept += 1;
            rounded += usize::from(plane.signed_distance(at(on_face)) < 0.0);
            let cell = Viewcell {
                planes: alloc::vec![plane],
                ..Viewcell::from_box(DVec3::NEG_INFINITY, DVec3::INFINITY)
            };
            let path = Path { start: at(start), step: at(end) - at(start) };
            assert!(path.part_in_cell(&cell, 0.0).is_some(), "case {case}: {start:?} to {end:?}, {plane:?}");
        }
        assert!(kept > 1000 && rounded > 100, "{kept} ends in the viewcell, {rounded} of them rounded out");
    }
}
