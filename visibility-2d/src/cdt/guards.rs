//! Few guards that together see all of a region, and witnesses that tell how many guards are needed.
//!
//! Guards are chosen greedily by the area that they add, and each is dropped again if the others see all that
//! it sees. A least set is NP-hard to find (Der-Tsai Lee and Arthur Lin, "Computational Complexity of Art
//! Gallery Problems", 1986; the survey of Durand's thesis, chapter 2). Witnesses bound it from below: no
//! guard sees two of them (Yoav Amit, Joseph Mitchell and Eli Packer, "Locating Guards for Visibility
//! Coverage of Polygons", 2010).

use super::convex_piece::{ConvexPiece, Wedge};
use super::error::PlanError;
use super::plan::Plan;
use super::predicates::{Point, checked, orient};
use super::triangulation::{NONE, Place};
use super::unseen::{SeenCones, UnseenRegion};
use alloc::collections::{BTreeSet, BinaryHeap};
use alloc::vec::Vec;

/// Share of a triangle's corner in the place of a witness near the corner; the other two corners share the
/// rest.
const NEAR_CORNER: f64 = 0.9;

/// Guards that together see all of a region of a plan, and a lower bound on their number.
///
/// What is guaranteed:
/// - Coverage is proven, not sampled: the guards together see all points of the region but those
///   [`uncovered`](Self::uncovered), which is empty unless the plan has triangles too thin for a point
///   inside. Boundaries count as seen, as in [`UnseenRegion`].
/// - No guard inside the rectangle around the plan, and on no wall, sees two of the
///   [`witnesses`](Self::witnesses). So no set of such guards that covers the region has fewer guards than
///   there are witnesses.
///
/// How far the number of guards is above the least is not bounded otherwise.
///
/// ```
/// use visibility_2d::cdt::{Guards, Plan, Wall};
/// // A square room with a wall across half of it.
/// let corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
/// let mut walls: Vec<_> = (0..4).map(|i| Wall::new(corners[i], corners[(i + 1) % 4])).collect();
/// walls.push(Wall::new([2.0, 0.0], [2.0, 2.0]));
/// let plan = Plan::new(&walls)?;
/// let guards = Guards::new(&plan, &[[1.0, 1.0]])?;
/// assert!(guards.uncovered().is_empty());
/// assert_eq!(guards.positions().len(), 1); // above the wall's end, it sees both halves
/// assert_eq!(guards.witnesses().len(), 1); // so one is needed, and one is enough
/// # Ok::<(), visibility_2d::cdt::PlanError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Guards {
    positions: Vec<Point>,
    witnesses: Vec<Point>,
    uncovered: UnseenRegion,
}

impl Guards {
    /// Finds guards for the region that is [reachable](UnseenRegion::reachable) from `starts`, in world
    /// units. Guards stand in the region and on no wall. Walls count with their present opacities.
    ///
    /// Takes time in proportion to the triangles that all places for guards and witnesses see together:
    /// `n s` for `n` triangles in the region that see `s` triangles each, quadratic where all see all. Two
    /// terms come on top. What a place sees is found again when a chosen guard may have taken a part of it,
    /// at most once for each guard: `n s g` for `g` guards at worst. And in each triangle, what a possible
    /// witness sees is compared with what each chosen one sees.
    ///
    /// # Errors
    /// Those of [`UnseenRegion::reachable`].
    pub fn new(plan: &Plan, starts: &[[f64; 2]]) -> Result<Self, PlanError> {
        let region = UnseenRegion::reachable(plan, starts)?;
        let (chosen, uncovered) = cover(plan, region.clone());
        let kept = without_needless(&region, &chosen);
        let positions = kept.into_iter().map(|index| chosen[index].0).collect();
        Ok(Self { positions, witnesses: witnesses(plan, &region), uncovered })
    }

    /// Returns the positions of the guards, in world units, about in the order of the area that they add.
    pub fn positions(&self) -> &[[f64; 2]] {
        &self.positions
    }

    /// Returns points of the region of which no guard sees two, in world units. Their number is a lower bound
    /// on the number of guards that stand on no wall.
    pub fn witnesses(&self) -> &[[f64; 2]] {
        &self.witnesses
    }

    /// Returns the part of the region that the guards are not proven to cover.
    pub fn uncovered(&self) -> &UnseenRegion {
        &self.uncovered
    }
}

/// Place for a guard, and the area it would have added when this was last computed.
struct Candidate {
    gain: f64,
    point: Point,
    place: Place,
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Candidate {}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<core::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Candidate {
    /// Orders by gain, and equal gains by position.
    fn cmp(&self, other: &Self) -> core::cmp::Ordering {
        let by_axis = |axis: usize| self.point[axis].total_cmp(&other.point[axis]);
        self.gain.total_cmp(&other.gain).then(by_axis(0)).then(by_axis(1))
    }
}

/// Returns the place of a point that a guard may take: inside the plan and on no wall.
fn standing(plan: &Plan, point: Point) -> Option<(Point, Place)> {
    let point = checked(point, 0).ok()?;
    let place = plan.locate_near(point, NONE);
    let is_free = match place {
        Place::Triangle(_) => true,
        Place::Edge(h) => plan.edges[h as usize].twin().is_some() && !plan.is_solid(h),
        Place::Vertex(h) => plan.fan(h).all(|h| !plan.is_solid(h)),
        Place::Outside => false,
    };
    is_free.then_some((point, place))
}

/// Returns the mean of a triangle's corners with weights that sum to 1.
fn weighted(corners: [Point; 3], weights: [f64; 3]) -> Point {
    [0, 1].map(|axis| (0..3).map(|k| weights[k] * corners[k][axis]).sum())
}

/// Chooses guards until nothing of the region is left. Returns them with what they see, and what is left.
fn cover(plan: &Plan, mut left: UnseenRegion) -> (Vec<(Point, SeenCones)>, UnseenRegion) {
    let mut chosen = Vec::new();
    let mut seen = SeenCones::default();
    let mut queue = BinaryHeap::new();
    let triangles: Vec<u32> =
        (0..).zip(&left.pieces).filter(|(_, pieces)| !pieces.is_empty()).map(|(t, _)| t).collect();
    for &t in &triangles {
        let middle = weighted(plan.corners(t), [1.0 / 3.0; 3]);
        let edges = (3 * t..3 * t + 3)
            .filter(|&h| plan.edges[h as usize].twin().is_some_and(|twin| h < twin) && !plan.is_solid(h))
            .map(|h| plan.ends(h))
            .map(|[a, b]| [0, 1].map(|axis| 0.5 * a[axis] + 0.5 * b[axis]));
        for (point, place) in core::iter::once(middle).chain(edges).filter_map(|p| standing(plan, p)) {
            // Rounding may have moved the point out of the region.
            let (Place::Triangle(at) | Place::Edge(at) | Place::Vertex(at)) = place else { continue };
            let at = if matches!(place, Place::Triangle(_)) { at } else { at / 3 };
            if left.pieces[at as usize].is_empty() {
                continue;
            }
            seen.look(plan, point, place, false);
            queue.push(Candidate { gain: left.gain(&seen), point, place });
        }
    }
    // What a candidate adds only shrinks while others are chosen, so the first whose present gain is not
    // below the old gain of the next is the best.
    while let Some(best) = queue.pop() {
        seen.look(plan, best.point, best.place, false);
        let gain = left.gain(&seen);
        if gain <= 0.0 {
            continue;
        }
        let candidate = Candidate { gain, ..best };
        if queue.peek().is_some_and(|next| *next > candidate) {
            queue.push(candidate);
            continue;
        }
        left.remove(&seen);
        chosen.push((candidate.point, core::mem::take(&mut seen)));
    }
    // No candidate sees the pieces that are left. A guard inside a piece's triangle sees all of the triangle.
    for &t in &triangles {
        let Some(piece) = left.pieces[t as usize].first() else { continue };
        let all = plan.corners(t);
        let inside = [piece.middle(), weighted(all, [1.0 / 3.0; 3])];
        let inside = inside.map(|point| standing(plan, point));
        if let Some((point, place)) = inside.into_iter().flatten().find(|p| p.1 == Place::Triangle(t)) {
            seen.look(plan, point, place, false);
            left.remove(&seen);
            chosen.push((point, core::mem::take(&mut seen)));
        }
    }
    (chosen, left)
}

/// Returns the indices of guards without those all of whose share the others see. The last ones, which add
/// least, are dropped first.
fn without_needless(region: &UnseenRegion, guards: &[(Point, SeenCones)]) -> Vec<usize> {
    // For each triangle, the guards that see a part of it: index and cone, without a cone for all of it.
    let mut seen_by: Vec<Vec<(usize, Option<Wedge>)>> = alloc::vec![Vec::new(); region.pieces.len()];
    for (index, (_, seen)) in guards.iter().enumerate() {
        seen.parts().for_each(|(t, wedge)| seen_by[t as usize].push((index, wedge)));
    }
    let mut is_kept = alloc::vec![true; guards.len()];
    for (index, (_, seen)) in guards.iter().enumerate().rev() {
        let is_seen_by_others = |t: u32| {
            let mut pieces = region.pieces[t as usize].clone();
            for &(other, wedge) in seen_by[t as usize].iter().filter(|(other, _)| *other != index) {
                if pieces.is_empty() || is_kept[other] && wedge.is_none() {
                    return true;
                }
                if let (true, Some(wedge)) = (is_kept[other], wedge) {
                    core::mem::take(&mut pieces).into_iter().for_each(|piece| piece.cut(wedge, &mut pieces));
                }
            }
            pieces.is_empty()
        };
        is_kept[index] = !seen.parts().all(|(t, _)| is_seen_by_others(t));
    }
    (0..guards.len()).filter(|&index| is_kept[index]).collect()
}

/// Returns points of a region such that no point off the walls sees two of them, as many as a greedy choice
/// finds: those first that are seen from the smallest area.
///
/// A point that sees a witness is seen by it, so the triangles and cones that the witness sees are claimed,
/// and no two witnesses claim a common point. One-way walls count as clear here, since a line of sight may
/// come through them from the witness or to it. A cone does not enter a triangle that its lines only graze,
/// so three kinds of triangle are claimed as a whole:
/// - those at the witness,
/// - those across an edge on whose line the witness lies,
/// - those around a vertex without walls, at which a guard may stand.
///
/// A point on another edge without a wall lies in closed cones on both sides of the edge or on neither.
fn witnesses(plan: &Plan, region: &UnseenRegion) -> Vec<Point> {
    let mut seen = SeenCones::default();
    let mut candidates = Vec::new();
    for (t, _) in (0..).zip(&region.pieces).filter(|(_, pieces)| !pieces.is_empty()) {
        let side = 0.5 - 0.5 * NEAR_CORNER;
        let near = [[NEAR_CORNER, side, side], [side, NEAR_CORNER, side], [side, side, NEAR_CORNER]];
        for weights in near.into_iter().chain([[1.0 / 3.0; 3]]) {
            let point = weighted(plan.corners(t), weights);
            if let Some((point, Place::Triangle(at))) = standing(plan, point)
                && at == t
            {
                seen.look(plan, point, Place::Triangle(t), true);
                let area = region.gain(&seen);
                candidates.push((area, point, t));
            }
        }
    }
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
    let is_free = |h: u32| plan.fan(h).all(|h| !plan.is_solid(h));
    // For each triangle, the parts claimed: a cone, or `None` for all of it.
    let mut claims: Vec<Vec<Option<Wedge>>> = alloc::vec![Vec::new(); plan.triangle_count()];
    let mut witnesses = Vec::new();
    let mut own: Vec<(u32, Option<Wedge>)> = Vec::new();
    // Triangles that the witness claims as a whole, and vertices that it has claimed those around of.
    let (mut whole, mut around) = (BTreeSet::new(), BTreeSet::new());
    for (_, point, t) in candidates {
        if claims[t as usize].iter().any(Option::is_none) {
            continue;
        }
        seen.look(plan, point, Place::Triangle(t), true);
        own.clear();
        whole.clear();
        around.clear();
        own.extend(seen.parts());
        for &(t, _) in &own {
            for h in 3 * t..3 * t + 3 {
                let [a, b] = plan.ends(h);
                let twin = plan.edges[h as usize].twin();
                let is_grazed = !plan.is_solid(h) && orient(a, b, point) == 0.0;
                whole.extend(twin.filter(|_| is_grazed).map(|twin| twin / 3));
                if around.insert(plan.edges[h as usize].origin) && is_free(h) {
                    whole.extend(plan.fan(h).map(|h| h / 3));
                }
            }
        }
        own.extend(whole.iter().map(|&t| (t, None)));
        let is_apart = own.iter().all(|&(t, claim)| {
            claims[t as usize].iter().all(|&other| {
                let both = claim.zip(other);
                both.is_some_and(|(one, other)| !ConvexPiece::triangle(plan.corners(t)).is_common(one, other))
            })
        });
        if is_apart {
            own.iter().for_each(|&(t, claim)| claims[t as usize].push(claim));
            witnesses.push(point);
        }
    }
    witnesses
}

#[cfg(test)]
mod tests {
    use super::super::{Opacity, Wall};
    use super::*;

    #[test]
    fn guards_stand_on_no_wall() {
        let glass = Wall::new([0.0, 2.0], [4.0, 2.0]).with_opacity(Opacity::Clear);
        let plan = Plan::from_walls(&[Wall::new([0.0, 0.0], [4.0, 0.0]), glass], 2.0).unwrap();
        for (point, stands) in [
            ([1.0, 0.0], false),
            ([0.0, 0.0], false),
            ([1.0, 2.0], true),
            ([0.0, 2.0], true),
            ([1.0, 1.0], true),
            ([1.0, -2.0], false),
            ([1.0, -3.0], false),
            ([f64::NAN, 1.0], false),
        ] {
            assert_eq!(standing(&plan, point).is_some(), stands, "{point:?}");
        }
    }

    /// Two guards who each see all of a room: one guard is left out, not both.
    #[test]
    fn a_guard_that_was_dropped_sees_nothing() {
        let corners = [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]];
        let plan = Plan::new(&[0, 1, 2].map(|k| Wall::new(corners[k], corners[(k + 1) % 3]))).unwrap();
        let region = UnseenRegion::reachable(&plan, &[[1.0, 1.0]]).unwrap();
        let guards = [[1.0, 1.0], [1.0, 2.0], [2.0, 1.0]].map(|point| {
            let mut seen = SeenCones::default();
            seen.look(&plan, point, plan.locate_near(point, NONE), false);
            (point, seen)
        });
        assert_eq!(without_needless(&region, &guards), [0], "the first of three guards");
    }
}
