//! Chains of solids that together hide a point behind them from all of a viewcell.
//!
//! A *chord* is a segment between two posts of a solid. Seen from the point, the viewcell and each chord span
//! an angle. The viewcell is hidden if chords, each overlapping the one before, together span its angle, the
//! whole viewcell is beyond the lines of the chords, and the solids are high enough. For fixed chords, each
//! of these conditions says that the point is to the left of a line. So they hold on a segment if they hold
//! at both of its ends, and the position where chords only just meet is found by a division.

use super::cell_solids::{CellSolids, Post};
use super::lines::{Point, U, all_left_of, left_of};
use alloc::vec::Vec;

/// Maximum number of solids of a chain.
const MAX_LINKS: usize = 64;

/// Number of solids of the previous chain that are tried as the next link before all solids along the line of
/// sight are.
const AHEAD: usize = 3;

/// Greatest extent of a virtual occluder to each side, as a multiple of the line's distance from the
/// viewcell's middle. Farther out, lines of sight are almost parallel to the line.
pub(crate) const WIDEST: f64 = 4.0;

/// Line on the plan along which a virtual occluder is grown. The viewcell is on its near side; the virtual
/// occluder hides objects on its far side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BackLine {
    /// Point on the plan, in metres, from which `distance` is measured: the middle of the viewcell.
    origin: [f64; 2],
    /// Unit vector that points away from the viewcell.
    normal: [f64; 2],
    pub(crate) distance: f64,
    /// Bound in metres on the distance between the line and points computed on it, and between the line and a
    /// line through two such points.
    pub(crate) error: f64,
}

impl BackLine {
    /// Makes the line at `distance` metres from a point in a unit direction.
    pub(crate) fn new(origin: [f64; 2], normal: [f64; 2], distance: f64) -> Self {
        // A point is a sum of three terms with three roundings, and the normal has unit length up to 4u.
        let size = origin[0].abs() + origin[1].abs() + (1.0 + WIDEST) * distance;
        Self { origin, normal, distance, error: 64.0 * U * size }
    }

    /// Returns the point at a position along the line, in metres from the point nearest to `origin`.
    /// Positions grow clockwise around the viewcell.
    pub(crate) fn at(&self, position: f64) -> Point {
        let ([ox, oy], [nx, ny], d) = (self.origin, self.normal, self.distance);
        Point::exact(ox + nx * d + ny * position, oy + ny * d - nx * position)
    }

    /// Returns the distance in metres of a point beyond the line; negative on the near side. The rounding
    /// error is less than `error` for points of the line up to [`WIDEST`] times `distance` to each side, and
    /// for points no farther from `origin`.
    pub(crate) fn beyond(&self, x: f64, y: f64) -> f64 {
        (x - self.origin[0]) * self.normal[0] + (y - self.origin[1]) * self.normal[1] - self.distance
    }

    /// Returns whether a point is certainly on the near side of the line.
    pub(crate) fn is_before(&self, point: Point) -> bool {
        let size = point.x.abs() + point.y.abs();
        self.beyond(point.x, point.y) + 2.0 * point.error + 4.0 * self.error + 16.0 * U * size < 0.0
    }
}

/// Solid in a chain.
#[derive(Clone, Copy, Debug)]
struct Link {
    solid: u32,
    /// End of the chord that comes first counter-clockwise, as seen from the hidden point. The other end is
    /// `to`.
    from: Point,
    to: Point,
    /// Height in metres above which the chord occludes: at least the lower end of each of its posts.
    low: f64,
    /// Point that lies in this solid and in the solid of the previous link. The chord of the previous link
    /// then ends at this point. `None` if that chord ends at a post of its own solid.
    joint: Option<Point>,
}

/// Problem for a chain: hide the points beyond a line from a viewcell. The viewcell is given by its corners
/// and by `solids`, whose slopes are as seen from the viewcell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Task<'a> {
    pub(crate) solids: &'a CellSolids,
    pub(crate) corners: &'a [Point; 4],
    pub(crate) line: BackLine,
    pub(crate) slope: f64,
}

/// Chain of solids. One value computes many chains and reuses its memory.
#[derive(Clone, Debug)]
pub(crate) struct Chain {
    links: Vec<Link>,
    former: Vec<Link>,
}

impl Chain {
    pub(crate) const fn new() -> Self {
        Self { links: Vec::new(), former: Vec::new() }
    }

    /// Returns the greatest lower end of all posts in the chain, in metres.
    pub(crate) fn low(&self) -> f64 {
        self.links.iter().map(|link| link.low).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Removes all solids from the chain.
    pub(crate) fn clear(&mut self) {
        self.links.clear();
    }

    /// Makes a chain that hides the viewcell from the point at `position` on the task's line. The chain's
    /// present solids are tried first. Returns whether there is such a chain; if not, the chain is invalid.
    pub(crate) fn cover(&mut self, task: &Task, position: f64) -> bool {
        core::mem::swap(&mut self.links, &mut self.former);
        let is_hidden = self.cover_anew(task, task.line.at(position));
        if !is_hidden {
            // The solids of the previous chain are kept for the next attempt.
            core::mem::swap(&mut self.links, &mut self.former);
        }
        is_hidden
    }

    fn cover_anew(&mut self, task: &Task, at: Point) -> bool {
        let Self { links, former } = self;
        links.clear();
        // Solids of the previous chain come in order, so only the next few have to be tried.
        let mut next = 0;
        while links.len() < MAX_LINKS {
            let last = links.last().copied();
            let mut best: Option<Link> = None;
            let offer = |best: &mut Option<Link>, solid: u32| {
                let link = task.link(at, last.as_ref(), solid);
                let farther = link.filter(|link| best.is_none_or(|best| left_of(at, best.to, link.to) > 0.0));
                *best = farther.or(*best);
                farther.is_some()
            };
            for (index, link) in former.iter().enumerate().skip(next).take(AHEAD) {
                if offer(&mut best, link.solid) {
                    next = index + 1;
                }
            }
            if best.is_none() {
                // Line of sight that is not hidden yet, extended beyond the viewcell.
                let aim = last.map_or_else(|| task.first_corner(at), |link| link.to);
                let (dx, dy) = (aim.x - at.x, aim.y - at.y);
                let length = |x: f64, y: f64| x.abs() + y.abs();
                let reach = |c: &Point| length(c.x - at.x, c.y - at.y);
                let farthest = task.corners.iter().map(reach).fold(0.0, f64::max);
                let by = (farthest / length(dx, dy)).min(1e6);
                let end = [at.x + by * dx, at.y + by * dy];
                task.solids.along([at.x, at.y], end, task.slope, &mut |solid| {
                    offer(&mut best, solid);
                });
            }
            let Some(best) = best else { return false };
            if let (Some(joint), Some(last)) = (best.joint, links.last_mut()) {
                (last.to, last.low) = (joint, last.low.max(best.low));
            }
            links.push(best);
            if all_left_of(best.to, at, task.corners) {
                return true;
            }
        }
        false
    }

    /// Returns whether the chain hides the viewcell from the point at a position.
    pub(crate) fn holds(&self, task: &Task, position: f64) -> bool {
        let at = task.line.at(position);
        !self.links.is_empty() && self.conditions(task).all(|(a, b)| left_of(a, b, at) >= 0.0)
    }

    /// Returns pairs of points. The chain hides the viewcell from every point that is to the left of the
    /// lines through all pairs.
    fn conditions<'a>(&'a self, task: &'a Task) -> impl Iterator<Item = (Point, Point)> + 'a {
        let chords = self.links.iter().map(|link| (link.from, link.to));
        let joints = self
            .links
            .windows(2)
            .filter_map(|pair| (!pair[1].from.is(pair[0].to)).then_some((pair[1].from, pair[0].to)));
        let ends = self.links.first().zip(self.links.last());
        let ends = ends.into_iter().flat_map(move |(first, last)| {
            task.corners.iter().flat_map(move |&c| [(first.from, c), (c, last.to)])
        });
        chords.chain(joints).chain(ends)
    }

    /// Returns the farthest position from `from` towards `to` up to which the chain hides the viewcell. The
    /// chain must hide it at `from`.
    pub(crate) fn reach(&self, task: &Task, from: f64, to: f64) -> f64 {
        if self.holds(task, to) {
            return to;
        }
        let (begin, end) = (task.line.at(from), task.line.at(to));
        let mut part = 1.0f64;
        for (a, b) in self.conditions(task) {
            let (first, last) = (left_of(a, b, begin), left_of(a, b, end));
            if last < 0.0 {
                part = part.min(first / (first - last));
            }
        }
        // The quotient is rounded and error bounds are not linear, so slightly smaller positions are tried.
        for less in [1e-9, 1e-6, 1e-3, 0.1] {
            let position = from + (to - from) * part * (1.0 - less);
            if self.holds(task, position) {
                return position;
            }
        }
        from
    }
}

impl Task<'_> {
    /// Returns the corner of the viewcell that comes first counter-clockwise, seen from a point.
    fn first_corner(&self, at: Point) -> Point {
        let [a, b, c, d] = *self.corners;
        let first = |a: Point, b: Point| if left_of(at, b, a) > 0.0 { b } else { a };
        first(first(a, b), first(c, d))
    }

    /// Returns a link of a solid that continues the chain after `last`: its chord begins within the chord of
    /// `last` and reaches farther counter-clockwise, seen from the point `at`. Without `last`, the chord
    /// begins at the clockwise end of the viewcell or beyond. `None` if this is not certain.
    fn link(&self, at: Point, last: Option<&Link>, solid: u32) -> Option<Link> {
        if last.is_some_and(|last| last.solid == solid) {
            return None;
        }
        let ring = self.solids.ring(solid);
        if ring.len() < 2 {
            return None;
        }
        // Rounding may choose wrong posts, which the exact tests below refuse.
        let turn = |a: Point, b: Point| (a.x - at.x) * (b.y - at.y) - (a.y - at.y) * (b.x - at.x);
        let (mut from, mut to) = (0, 0);
        for i in 1..ring.len() {
            if turn(ring[i].at, ring[from].at) > 0.0 {
                from = i;
            }
            if turn(ring[to].at, ring[i].at) > 0.0 {
                to = i;
            }
        }
        // The chord must cover a part of the viewcell that is not hidden yet.
        let seen = last.map_or_else(|| self.first_corner(at), |last| last.to);
        if turn(seen, ring[to].at) <= 0.0 {
            return None;
        }
        let link = |from: usize, to: usize| {
            let low = ring[from].low.max(ring[to].low);
            Link { solid, from: ring[from].at, to: ring[to].at, low, joint: None }
        };
        let begins = |link: &Link| match last {
            None => all_left_of(at, link.from, self.corners),
            Some(last) => link.from.is(last.to) || left_of(at, link.from, last.to) >= 0.0,
        };
        let is_good = |link: &Link| left_of(at, seen, link.to) > 0.0 && self.is_chord(at, link.from, link.to);
        let widest = link(from, to);
        // A joint, a point of both solids, also holds for points beyond the line through it; chords whose
        // ends overlap hold on one side only. So a joint is preferred.
        if let Some(joined) = last.and_then(|last| self.join(at, last, &widest)) {
            return Some(joined);
        }
        if !begins(&widest) {
            return None;
        }
        if is_good(&widest) {
            return Some(widest);
        }
        // Tries other chords, which have the whole viewcell behind them.
        let near = |i: usize| [i.checked_sub(1).unwrap_or(ring.len() - 1), (i + 1) % ring.len()];
        let other = near(from).map(|i| (i, to)).into_iter().chain(near(to).map(|i| (from, i)));
        let mut other = other.filter(|(i, j)| i != j).map(|(i, j)| link(i, j));
        other.find(|link| begins(link) && is_good(link))
    }

    /// Returns whether a segment is a chord as seen from the point `at`: `to` is certainly to the left of
    /// `from` or in line with it, and the whole viewcell is certainly beyond the line through both.
    fn is_chord(&self, at: Point, from: Point, to: Point) -> bool {
        left_of(at, from, to) >= 0.0 && all_left_of(to, from, self.corners)
    }

    /// Returns `link` with a chord that begins at a joint: a corner of the solid of `last` or of `link` that
    /// is certainly inside the other solid. No line of sight passes between solids that touch. `None` if
    /// there is no such corner.
    fn join(&self, at: Point, last: &Link, link: &Link) -> Option<Link> {
        let (a, b) = (self.solids.ring(last.solid), self.solids.ring(link.solid));
        let is_exact = |solid: u32, ring: &[Post]| {
            self.solids.is_whole(solid) && ring.iter().all(|post| post.at.error == 0.0)
        };
        if !self.solids.bounds_meet(last.solid, link.solid)
            || !is_exact(last.solid, a)
            || !is_exact(link.solid, b)
        {
            return None;
        }
        let low = a.iter().chain(b).map(|post| post.low).fold(link.low, f64::max);
        let in_b = a.iter().filter(|post| is_in(post.at, b));
        let in_a = b.iter().filter(|post| is_in(post.at, a));
        in_b.chain(in_a).map(|post| post.at).find_map(|joint| {
            let is_joint = self.is_chord(at, last.from, joint)
                && self.is_chord(at, joint, link.to)
                && left_of(at, last.to, link.to) > 0.0;
            is_joint.then_some(Link { from: joint, low, joint: Some(joint), ..*link })
        })
    }
}

/// Returns whether a point is certainly inside or on a ring of exact points.
fn is_in(point: Point, ring: &[Post]) -> bool {
    let coordinate = |p: Point| robust::Coord { x: p.x, y: p.y };
    (0..ring.len()).all(|i| {
        let next = if i + 1 == ring.len() { 0 } else { i + 1 };
        robust::orient2d(coordinate(ring[i].at), coordinate(ring[next].at), coordinate(point)) >= 0.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::horizon::UpAxis;
    use crate::virtual_occluders::cell_solids::CellBox;
    use crate::virtual_occluders::solids::PlanSolids;
    use visibility_core::glam::Affine3A;
    use visibility_core::{Aabb, Object, OccluderMesh, Scene};
    use visibility_testing::Random;

    /// Returns the solids of houses 30 m high, given by least and greatest coordinates on the plan.
    fn houses(plans: &[[f32; 4]], cell: &CellBox) -> CellSolids {
        let mut scene = Scene::new();
        for &[x, y, to_x, to_y] in plans {
            let bounds = Aabb::from_arrays([x, y, 0.0], [to_x, to_y, 30.0]);
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        }
        let mut all = PlanSolids::new(UpAxis::Z);
        all.sync(&scene);
        let mut solids = CellSolids::new();
        solids.fill(&all, cell, |_| true);
        solids.restrict(0.1, |_| true);
        solids
    }

    /// Returns the index of the solid around a point.
    fn solid_at(solids: &CellSolids, x: f64, y: f64) -> u32 {
        let at = |i: &u32| solids.solids()[*i as usize].middle == [x, y];
        (0..solids.solids().len() as u32).find(at).unwrap()
    }

    const ROW: [[f32; 4]; 3] = [[-4.0, 10.0, -1.0, 11.0], [-1.0, 10.0, 2.0, 11.0], [2.0, 10.0, 5.0, 11.0]];

    /// Three houses in a row that share corners: of each, the lower ends of all posts count, also of those
    /// that are no ends of chords. Of one house, those of both ends of its chord do.
    #[test]
    fn the_lower_ends_of_all_posts_of_a_chain_count() {
        let cell = CellBox { min: [-6.0, -2.0, 1.0], max: [6.0, 2.0, 2.0] };
        let corners = cell.corners();
        let line = BackLine::new([0.5, 0.0], [0.0, 1.0], 20.0);
        let wide = [[-20.0, 10.0, 20.0, 11.0]];
        for (plans, raised) in [
            (&ROW[..], [-4.0, 10.0]),
            (&ROW[..], [-4.0, 11.0]),
            (&ROW[..], [-1.0, 10.0]),
            (&ROW[..], [2.0, 11.0]),
            (&ROW[..], [5.0, 10.0]),
            (&ROW[..], [5.0, 11.0]),
            (&wide[..], [-20.0, 11.0]),
            (&wide[..], [20.0, 11.0]),
        ] {
            let mut solids = houses(plans, &cell);
            solids.change_posts(|post| post.low = if [post.at.x, post.at.y] == raised { 0.5 } else { 0.0 });
            solids.restrict(0.1, |_| true);
            let task = Task { solids: &solids, corners: &corners, line, slope: 0.1 };
            let mut chain = Chain::new();
            assert!(!chain.holds(&task, 0.0), "a chain without links");
            assert!(chain.cover(&task, 0.0) && chain.holds(&task, 0.0), "a chain of {plans:?}");
            assert_eq!(chain.links.len(), plans.len(), "links of the chain");
            assert_eq!(chain.low(), 0.5, "the post at {raised:?} begins higher");
        }
    }

    #[test]
    fn chords_have_the_viewcell_behind_them() {
        let cell = CellBox { min: [-6.0, -2.0, 1.0], max: [6.0, 2.0, 2.0] };
        let (solids, corners) = (houses(&ROW, &cell), cell.corners());
        let line = BackLine::new([0.5, 0.0], [0.0, 1.0], 20.0);
        let task = Task { solids: &solids, corners: &corners, line, slope: 0.1 };
        let is_chord = |y: f64, chord: f64| {
            let [from, to] = [-4.0, 4.0].map(|x| Point::exact(x, chord));
            [task.is_chord(Point::exact(0.0, y), from, to), task.is_chord(Point::exact(0.0, y), to, from)]
        };
        assert_eq!(is_chord(20.0, 10.0), [true, false], "a chord between the point and the viewcell");
        assert_eq!(is_chord(20.0, -10.0), [false, false], "a chord beyond the viewcell");
        assert_eq!(is_chord(20.0, 1.0), [false, false], "a chord across the viewcell");
        assert_eq!(is_chord(5.0, 10.0), [false, false], "a point on the viewcell's side of the chord");
    }

    /// Solids whose posts are not all in use or not exact are not known to touch.
    #[test]
    fn joints_are_of_exact_solids_that_are_wholly_in_use() {
        let line = BackLine::new([0.5, 0.0], [0.0, 1.0], 20.0);
        let at = Point::exact(0.5, 20.0);
        let link_of = |solid: u32, from: [f64; 2], to: [f64; 2]| {
            let [from, to] = [from, to].map(|[x, y]| Point::exact(x, y));
            Link { solid, from, to, low: 0.0, joint: None }
        };
        for (min, max) in [([-6.0, -2.0], [6.0, 2.0]), ([-6.0, -2.0], [6.0, 8.0]), ([-9.0, -2.0], [0.0, 8.0])]
        {
            let cell = CellBox { min: [min[0], min[1], 1.0], max: [max[0], max[1], 2.0] };
            let corners = cell.corners();
            let mut solids = houses(&ROW, &cell);
            let [a, b] = [-2.5, 0.5].map(|x| solid_at(&solids, x, 10.5));
            let (last, next) =
                (link_of(a, [-4.0, 11.0], [-1.0, 10.0]), link_of(b, [-1.0, 10.0], [2.0, 11.0]));
            let task = Task { solids: &solids, corners: &corners, line, slope: 0.1 };
            let joined = task.join(at, &last, &next).unwrap();
            let joint = joined.joint.unwrap();
            assert!(task.is_chord(at, last.from, joint), "{joint:?} ends a chord, cell {min:?} to {max:?}");
            assert!(task.is_chord(at, joint, next.to), "{joint:?} begins a chord, cell {min:?} to {max:?}");
            for unused in [[-4.0, 10.0], [2.0, 10.0]] {
                // The neighbour beyond has a post there too, which does not matter.
                solids.restrict(0.1, |post| [post.at.x, post.at.y] != unused);
                let task = Task { solids: &solids, corners: &corners, line, slope: 0.1 };
                assert!(task.join(at, &last, &next).is_none(), "the post at {unused:?} is not in use");
            }
            for inexact in [[-4.0, 10.0], [2.0, 10.0]] {
                let error = |post: &Post| if [post.at.x, post.at.y] == inexact { 1e-9 } else { 0.0 };
                solids.change_posts(|post| post.at.error = error(post));
                solids.restrict(0.1, |_| true);
                let task = Task { solids: &solids, corners: &corners, line, slope: 0.1 };
                assert!(task.join(at, &last, &next).is_none(), "the post at {inexact:?} is not exact");
            }
        }
    }

    /// Links of random houses near random viewcells: chords have the viewcell behind them, and continue what
    /// the chord before has hidden.
    #[test]
    fn links_are_chords_that_continue_the_chain() {
        let mut random = Random(40);
        let mut counts = [0; 3];
        for round in 0..3000 {
            let plans: [[f32; 4]; 4] = core::array::from_fn(|_| {
                let [x, y] = [random.between(-9, 9), random.between(4, 12)].map(|x| x as f32);
                [x, y, x + random.between(1, 6) as f32, y + random.between(1, 5) as f32]
            });
            let min = [f64::from(random.between(-9, 6)), f64::from(random.between(-4, 2))];
            let max = [min[0] + f64::from(random.between(1, 4)), min[1] + f64::from(random.between(1, 8))];
            let cell = CellBox { min: [min[0], min[1], 1.0], max: [max[0], max[1], 2.0] };
            let (solids, corners) = (houses(&plans, &cell), cell.corners());
            let line = BackLine::new([0.0, 0.0], [0.0, 1.0], 20.0);
            let task = Task { solids: &solids, corners: &corners, line, slope: 0.1 };
            let at = Point::exact(random.fine_range(-9.0, 9.0), 20.0);
            let count = solids.solids().len() as u32;
            for first in 0..count {
                let Some(last) = task.link(at, None, first) else { continue };
                counts[0] += 1;
                assert!(task.is_chord(at, last.from, last.to), "round {round}: {last:?} is a chord");
                assert!(all_left_of(at, last.from, &corners), "round {round}: {last:?} begins the chain");
                for second in 0..count {
                    let Some(link) = task.link(at, Some(&last), second) else { continue };
                    counts[1 + usize::from(link.joint.is_some())] += 1;
                    assert!(task.is_chord(at, link.from, link.to), "round {round}: {link:?} is a chord");
                    let end = link.joint.unwrap_or(last.to);
                    assert!(task.is_chord(at, last.from, end), "round {round}: {last:?} ends at {end:?}");
                    let is_continued = link.from.is(end) || left_of(at, link.from, end) >= 0.0;
                    assert!(is_continued, "round {round}: {link:?} continues {last:?}");
                }
            }
        }
        assert!(counts.iter().all(|&count| count > 50), "{counts:?}");
    }
}
