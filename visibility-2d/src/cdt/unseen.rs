//! Parts of a plan that given eyes do not see, exactly: hiding places, and where an evader may be.
//!
//! Within a triangle of the plan there is no wall, so an eye sees of it what lies in the cones of sight that
//! enter. The rest is kept as convex pieces ([`ConvexPiece`]), cut by the bounds of the cones of eye after
//! eye.
//!
//! Related to: Leonidas Guibas, Jean-Claude Latombe, Steven LaValle, David Lin and Rajeev Motwani,
//! "Visibility-Based Pursuit-Evasion in a Polygonal Environment", 1997 (regions that may hold an evader).

use super::convex_piece::{ConvexPiece, Wedge};
use super::error::PlanError;
use super::expand::{Cone, Expansion};
use super::line_crossing::Line;
use super::plan::{BLOCKS, Plan};
use super::predicates::{Point, checked};
use super::triangulation::{NONE, Place};
use alloc::vec::Vec;
use visibility_core::stamp::Stamp;
use visibility_core::union_find::root;

/// Cones of sight of an eye by triangle. Reuses its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct SeenCones {
    /// Triangles at the eye, seen as a whole.
    pub(super) whole: Vec<u32>,
    /// Other triangles, each with a cone that enters it. A triangle may occur several times; its cones do not
    /// overlap.
    pub(super) cones: Vec<(u32, Wedge)>,
    stack: Vec<Cone>,
}

impl SeenCones {
    /// Returns each triangle seen, with the cone that enters it; `None` for a triangle at the eye.
    pub(super) fn parts(&self) -> impl Iterator<Item = (u32, Option<Wedge>)> + '_ {
        let whole = self.whole.iter().map(|&t| (t, None));
        whole.chain(self.cones.iter().map(|&(t, wedge)| (t, Some(wedge))))
    }

    /// Replaces the cones by those of an eye at `place`. One-way walls stop lines of sight from their right
    /// side, or none if `both_ways` is true.
    pub(super) fn look(&mut self, plan: &Plan, eye: Point, place: Place, both_ways: bool) {
        let Self { whole, cones, stack } = self;
        whole.clear();
        cones.clear();
        let from = Expansion { plan, eye, sector: &[] };
        from.start(place, 0, stack);
        whole.extend(stack.iter().filter_map(|cone| cone.inside().map(|(triangle, ..)| triangle)));
        whole.dedup();
        let stops = |edge: u32| {
            let twin = plan.edges[edge as usize].twin();
            !both_ways || twin.is_none_or(|twin| plan.edges[twin as usize].twin & BLOCKS != 0)
        };
        from.run(
            stack,
            |_| true,
            stops,
            |triangle, right, left| {
                cones.push((triangle, [right, left].map(|ray| Line(eye, from.point(ray.point)))));
            },
            |_, _, _, _| (),
        );
    }
}

/// Part of a plan that given eyes have not seen: at first all of a region, and after each
/// [`look`](Self::look) what is left of it.
///
/// Which points are left is exact, apart from boundaries: what is seen counts as seen with its boundary, so a
/// part without an area is never left. Only the corners of [`polygons`](Self::polygons) are rounded.
/// Cones of sight are those of [`Plan::look`].
///
/// ```
/// use visibility_2d::cdt::{Plan, UnseenRegion, Wall};
/// // A square room with a wall across half of it.
/// let corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
/// let mut walls: Vec<_> = (0..4).map(|i| Wall::new(corners[i], corners[(i + 1) % 4])).collect();
/// walls.push(Wall::new([2.0, 0.0], [2.0, 2.0]));
/// let plan = Plan::new(&walls)?;
/// let mut unseen = UnseenRegion::reachable(&plan, &[[1.0, 1.0]])?;
/// assert_eq!(unseen.area(), 16.0);
/// unseen.look(&plan, [1.0, 1.0])?;
/// assert_eq!(unseen.area(), 6.0); // behind the wall
/// assert!(unseen.contains(&plan, [3.0, 1.0])?);
/// unseen.look(&plan, [3.0, 3.0])?;
/// assert!(unseen.is_empty()); // proven: no point of the room is hidden from both
/// # Ok::<(), visibility_2d::cdt::PlanError>(())
/// ```
#[derive(Clone, Debug)]
pub struct UnseenRegion {
    /// Stamp of the plan's walls and opacities.
    of: Stamp,
    /// Stamp of `pieces`, renewed when pieces are removed.
    content: Stamp,
    /// For each triangle of the plan, the pieces not seen. They do not overlap.
    pub(super) pieces: Vec<Vec<ConvexPiece>>,
    scratch: SeenCones,
}

impl UnseenRegion {
    /// Makes the region of all points to which a mover can get from any of `starts`, in world units, without
    /// crossing a wall that stops lines of sight, from one side or both. A start on a wall counts for both
    /// sides of the wall. Takes time in proportion to the number of triangles of the plan.
    ///
    /// # Errors
    /// - [`PlanError::Coordinate`] with the start's index if a coordinate is NaN, infinite or above 1e60 in
    ///   absolute value.
    /// - [`PlanError::Region`] if a start is outside the rectangle around the plan, or there is no start.
    pub fn reachable(plan: &Plan, starts: &[[f64; 2]]) -> Result<Self, PlanError> {
        let mut pieces = alloc::vec![Vec::new(); plan.triangle_count()];
        let mut stack = Vec::new();
        for (index, &start) in starts.iter().enumerate() {
            let start = checked(start, index)?;
            let place = plan.locate_near(start, NONE);
            if place == Place::Outside {
                return Err(PlanError::Region);
            }
            plan.push_triangles_at(place, &mut stack);
        }
        if stack.is_empty() {
            return Err(PlanError::Region);
        }
        while let Some(t) = stack.pop() {
            let of = &mut pieces[t as usize];
            if !of.is_empty() {
                continue;
            }
            of.push(ConvexPiece::triangle(plan.corners(t)));
            for h in 3 * t..3 * t + 3 {
                stack
                    .extend(plan.edges[h as usize].twin().filter(|_| !plan.is_solid(h)).map(|twin| twin / 3));
            }
        }
        Ok(Self { of: plan.stamp(), content: Stamp::new(), pieces, scratch: SeenCones::default() })
    }

    /// Removes what an eye sees, in world units. An eye on a wall sees both sides of it. Takes time in
    /// proportion to the triangles seen, and to the pieces left in them.
    ///
    /// # Errors
    /// - [`PlanError::VisibilityGraph`] if the plan is not the one of the region, or a wall's opacity has
    ///   changed since.
    /// - [`PlanError::Coordinate`] with index 0 if a coordinate of the eye is NaN, infinite or above 1e60 in
    ///   absolute value.
    ///
    /// The region is then unchanged.
    pub fn look(&mut self, plan: &Plan, eye: impl Into<[f64; 2]>) -> Result<(), PlanError> {
        self.check(plan)?;
        let eye = checked(eye.into(), 0)?;
        let mut seen = core::mem::take(&mut self.scratch);
        seen.look(plan, eye, plan.locate_near(eye, NONE), false);
        self.remove(&seen);
        self.scratch = seen;
        Ok(())
    }

    fn check(&self, plan: &Plan) -> Result<(), PlanError> {
        if self.of == plan.stamp() { Ok(()) } else { Err(PlanError::VisibilityGraph) }
    }

    pub(super) fn remove(&mut self, seen: &SeenCones) {
        self.content = Stamp::new();
        for &triangle in &seen.whole {
            self.pieces[triangle as usize].clear();
        }
        for &(triangle, wedge) in &seen.cones {
            let pieces = &mut self.pieces[triangle as usize];
            for piece in core::mem::take(pieces) {
                piece.cut(wedge, pieces);
            }
        }
    }

    /// Returns the area that an eye with these cones would remove, in square world units, rounded.
    pub(super) fn gain(&self, seen: &SeenCones) -> f64 {
        let whole = seen.whole.iter().flat_map(|&t| &self.pieces[t as usize]).map(ConvexPiece::area);
        let parts = seen.cones.iter().flat_map(|&(triangle, wedge)| {
            self.pieces[triangle as usize].iter().filter_map(move |piece| piece.inside(wedge))
        });
        whole.sum::<f64>() + parts.map(|part| part.area()).sum::<f64>()
    }

    /// Returns whether nothing is left: whether the eyes together have seen all of the region.
    pub fn is_empty(&self) -> bool {
        self.pieces.iter().all(Vec::is_empty)
    }

    /// Returns the area left, in square world units, rounded.
    pub fn area(&self) -> f64 {
        self.pieces.iter().flatten().map(ConvexPiece::area).fold(0.0, |sum, area| sum + area)
    }

    /// Returns convex polygons that make up what is left, without overlap: their corners in world units,
    /// counter-clockwise, rounded where lines of sight cross each other or walls.
    pub fn polygons(&self) -> impl Iterator<Item = Vec<[f64; 2]>> + '_ {
        self.pieces.iter().flatten().map(|piece| piece.corners().collect())
    }

    /// Returns whether a point, in world units, is left, or on the boundary of what is left.
    ///
    /// # Errors
    /// [`PlanError::VisibilityGraph`] and [`PlanError::Coordinate`] as in [`look`](Self::look).
    pub fn contains(&self, plan: &Plan, point: impl Into<[f64; 2]>) -> Result<bool, PlanError> {
        Ok(!self.pieces_at(plan, point.into())?.is_empty())
    }

    /// Returns the pieces that contain a point: the triangle of each, and its index there.
    fn pieces_at(&self, plan: &Plan, point: Point) -> Result<Vec<(u32, usize)>, PlanError> {
        self.check(plan)?;
        let point = checked(point, 0)?;
        let mut triangles = Vec::new();
        plan.push_triangles_at(plan.locate_near(point, NONE), &mut triangles);
        let all = triangles.iter().flat_map(|&t| {
            self.pieces[t as usize].iter().enumerate().map(move |(index, piece)| (t, index, piece))
        });
        Ok(all.filter(|(.., piece)| piece.contains(point)).map(|(t, index, _)| (t, index)).collect())
    }

    /// Finds the hiding places: the largest connected parts of what is left. A mover stays unseen on the way
    /// from a point to another if and only if a place has both, apart from ways through single points. Takes
    /// time in proportion to the pieces left, for few pieces a triangle.
    ///
    /// # Errors
    /// [`PlanError::VisibilityGraph`] if the plan is not the one of the region, or a wall's opacity has
    /// changed since.
    pub fn hiding_places(&self, plan: &Plan) -> Result<HidingPlaces, PlanError> {
        self.check(plan)?;
        let mut first_piece = Vec::with_capacity(self.pieces.len() + 1);
        let mut count = 0;
        for pieces in &self.pieces {
            first_piece.push(count);
            count += pieces.len() as u32;
        }
        first_piece.push(count);
        // A forest of pieces: each points to another piece of its place, and roots to themselves.
        let mut parent: Vec<u32> = (0..count).collect();
        for h in 0..plan.edges.len() as u32 {
            let Some(twin) = plan.edges[h as usize].twin().filter(|&twin| h < twin && !plan.is_solid(h))
            else {
                continue;
            };
            let [a, b] = plan.ends(h);
            let on = |h: u32, line: Line| {
                let first = first_piece[h as usize / 3];
                (first..).zip(&self.pieces[h as usize / 3]).filter_map(move |(number, piece)| {
                    piece.sides().find(|side| side[1] == line).map(|side| (number, side))
                })
            };
            for (one, here) in on(h, Line(a, b)) {
                for (other, there) in on(twin, Line(b, a)) {
                    if share_a_part(here, there) {
                        let (to, from) = (root(&mut parent, one), root(&mut parent, other));
                        parent[from as usize] = to;
                    }
                }
            }
        }
        let mut number = alloc::vec![NONE; count as usize];
        let place_of = Vec::with_capacity(count as usize);
        let mut places = HidingPlaces { of: self.content, place_of, first_piece, areas: Vec::new() };
        for (index, piece) in (0..).zip(self.pieces.iter().flatten()) {
            let root = root(&mut parent, index) as usize;
            if number[root] == NONE {
                number[root] = places.areas.len() as u32;
                places.areas.push(0.0);
            }
            places.place_of.push(number[root]);
            places.areas[number[root] as usize] += piece.area();
        }
        Ok(places)
    }

    /// Keeps only the hiding places of which `evader` has a part.
    ///
    /// This answers where an evader may be when watchers change posts, however fast the evader moves. Let
    /// `evader` be the region where the evader may be under the watch of the old posts. While the watchers of
    /// the new posts have come and the old ones not yet left, the evader is in what a copy of `evader` keeps
    /// after looks from the new posts. When the old ones leave, the evader may spread to those hiding places
    /// of the new posts which have a part of that. If none is left, the evader is caught.
    ///
    /// # Errors
    /// [`PlanError::VisibilityGraph`] if the plan is not the one of both regions, or a wall's opacity has
    /// changed since.
    pub fn spread_from(&mut self, plan: &Plan, evader: &Self) -> Result<(), PlanError> {
        evader.check(plan)?;
        let places = self.hiding_places(plan)?;
        let mut is_kept = alloc::vec![false; places.len()];
        let mut numbers = places.place_of.iter();
        for (pieces, others) in self.pieces.iter().zip(&evader.pieces) {
            for (piece, &place) in pieces.iter().zip(&mut numbers) {
                let is_kept = &mut is_kept[place as usize];
                *is_kept = *is_kept || others.iter().any(|other| piece.overlaps(other));
            }
        }
        self.content = Stamp::new();
        let mut numbers = places.place_of.iter();
        for pieces in &mut self.pieces {
            pieces.retain(|_| numbers.next().is_some_and(|&place| is_kept[place as usize]));
        }
        Ok(())
    }
}

/// Returns whether two pieces on either side of an edge have a common part of it, more than a point. Of each,
/// the lines before, along and after the edge are given.
fn share_a_part([before, _, after]: [Line; 3], [other_before, along, other_after]: [Line; 3]) -> bool {
    // Along the edge, the other piece begins where `other_after` crosses, and ends where `other_before` does.
    before.side_of_crossing(other_before, along) > 0 && after.side_of_crossing(along, other_after) > 0
}

/// Hiding places of an [`UnseenRegion`], numbered from 0. They belong to the region as it was when they were
/// found: find them anew after [`look`](UnseenRegion::look) and [`spread_from`](UnseenRegion::spread_from).
#[derive(Clone, Debug)]
pub struct HidingPlaces {
    /// Stamp of the pieces of the region.
    of: Stamp,
    /// For each piece of the region, the number of its place.
    place_of: Vec<u32>,
    /// For each triangle of the plan, the number of its first piece. One more entry is the number of pieces.
    first_piece: Vec<u32>,
    /// Area of each place, in square world units.
    areas: Vec<f64>,
}

impl HidingPlaces {
    /// Returns the number of places.
    pub fn len(&self) -> usize {
        self.areas.len()
    }

    /// Returns whether there is no place to hide.
    pub fn is_empty(&self) -> bool {
        self.areas.is_empty()
    }

    /// Returns the area of each place in square world units, rounded.
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// Returns the number of the place of each of the [polygons](UnseenRegion::polygons) of the region, in
    /// their order.
    pub fn of_polygons(&self) -> &[u32] {
        &self.place_of
    }

    /// Returns the number of a place that has a point, in world units, inside or on its boundary; the least
    /// if several meet there. `None` if the point is seen. `region` is the one whose places these are, or an
    /// unchanged copy.
    ///
    /// # Errors
    /// Those of [`UnseenRegion::contains`], and [`PlanError::VisibilityGraph`] if these are the places of
    /// another region, or if the region has changed since.
    pub fn at(
        &self,
        plan: &Plan,
        region: &UnseenRegion,
        point: impl Into<[f64; 2]>,
    ) -> Result<Option<u32>, PlanError> {
        if self.of != region.content {
            return Err(PlanError::VisibilityGraph);
        }
        let pieces = region.pieces_at(plan, point.into())?;
        let number = |&(t, index): &(u32, usize)| {
            self.place_of.get(*self.first_piece.get(t as usize)? as usize + index).copied()
        };
        Ok(pieces.iter().filter_map(number).min())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pieces on either side of the x axis, from and up to given places, share a part if that is no point.
    #[test]
    fn pieces_that_touch_at_a_point_share_no_part() {
        let up = |x: f64| Line([x, -1.0], [x, 1.0]);
        let axis = Line([0.0, 0.0], [8.0, 0.0]);
        let share = |[a, b]: [f64; 2], [c, d]: [f64; 2]| {
            share_a_part([up(a).reversed(), axis, up(b)], [up(d), axis.reversed(), up(c).reversed()])
        };
        for (one, other, is_shared) in [
            ([0.0, 2.0], [1.0, 3.0], true),
            ([0.0, 2.0], [0.0, 2.0], true),
            ([0.0, 2.0], [2.0, 3.0], false),
            ([2.0, 3.0], [0.0, 2.0], false),
            ([0.0, 1.0], [2.0, 3.0], false),
        ] {
            assert_eq!(share(one, other), is_shared, "{one:?} and {other:?}");
        }
    }
}
