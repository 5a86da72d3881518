//! Visibility from an eye on a plan: the visibility polygon, and the walls and objects seen.

use super::error::PlanError;
use super::expand::{Cone, Expansion, Met, Ray};
use super::objects::PlanObjects;
use super::plan::Plan;
use super::predicates::{Point, are_heights};
use super::range::{Disc, chord};
use super::triangulation::{NONE, Place};
use super::view::PlanView;
use super::wall::add_walls;
use alloc::vec::Vec;
use visibility_core::stamp::Stamp;

/// Result of [`Plan::look`]: visibility polygon, its area, and the walls seen. Reuses its memory, so that a
/// warm query does not allocate.
#[derive(Clone, Debug)]
pub struct Visibility {
    polygon: Vec<Point>,
    walls: Vec<u32>,
    objects: Vec<u32>,
    /// Twice the area of `polygon`, in square world units.
    twice_area: f64,
    /// Stack of the cones of sight that are still to be followed.
    cones: Vec<Cone>,
    /// Scratch: points that divide the view's sector, see [`PlanView::sector_points`].
    sector: Vec<Point>,
    /// For each wall, the number of the last query that saw it.
    marks: Vec<u32>,
    /// For each object, the number of the last query that saw it.
    object_marks: Vec<u32>,
    /// Number of the present query, with which walls and objects are marked. 0 before the first query.
    query: u32,
    /// Half-edge of the triangle that held the last eye, where the walk to the next eye begins: its index in
    /// `Plan::edges`, and the stamp of the triangulation.
    last: (u32, Stamp),
}

impl Visibility {
    /// Makes an empty result, without polygon and walls.
    pub fn new() -> Self {
        Self {
            polygon: Vec::new(),
            walls: Vec::new(),
            objects: Vec::new(),
            twice_area: 0.0,
            cones: Vec::new(),
            sector: Vec::new(),
            marks: Vec::new(),
            object_marks: Vec::new(),
            query: 0,
            last: (0, Stamp::NONE),
        }
    }

    /// Returns the numbers of the objects seen by [`Plan::look_at`], each once, in no particular order.
    pub fn objects(&self) -> &[u32] {
        &self.objects
    }

    /// Returns the corners of the visibility polygon in world units, counter-clockwise. Corners at wall ends
    /// are exact. Corners where a line of sight past a wall end hits another wall are rounded. With a range,
    /// arcs become chords of at most a 64th of a turn. The eye is a corner if it does not see all around.
    /// Empty if nothing is seen.
    pub fn polygon(&self) -> &[[f64; 2]] {
        &self.polygon
    }

    /// Returns the area of the polygon in square world units, rounded.
    pub fn area(&self) -> f64 {
        0.5 * self.twice_area
    }

    /// Returns the numbers of the walls seen, each once, in the order in which cones of sight first meet
    /// them, counter-clockwise. A wall is seen if lines of sight meet more than one point of it, or if the
    /// eye is on it. A wall seen exactly edge-on is not listed. With a range, a wall is listed if a piece of
    /// it with a visible part comes within the range, even if the visible part does not.
    pub fn walls(&self) -> &[u32] {
        &self.walls
    }

    fn begin(&mut self, walls: usize, objects: usize) {
        self.polygon.clear();
        self.walls.clear();
        self.objects.clear();
        self.twice_area = 0.0;
        self.query = self.query.wrapping_add(1);
        if self.query == 0 || self.marks.len() != walls {
            self.object_marks.clear();
            self.marks.clear();
            self.marks.resize(walls, 0);
            self.query = 1;
        }
        if self.object_marks.len() < objects {
            self.object_marks.resize(objects, 0);
        }
    }
}

impl Default for Visibility {
    fn default() -> Self {
        Self::new()
    }
}

impl Plan {
    /// Finds the walls that a view sees, and its visibility polygon. Takes time proportional to the number of
    /// triangles seen, plus the location of the eye.
    ///
    /// # Errors
    /// [`PlanError::Coordinate`] if a coordinate of the eye (index 0) or of a point of the sector (index 1 or
    /// 2) is NaN, infinite or above 1e60 in absolute value, and [`PlanError::Heights`] if a height is. The
    /// result is then empty.
    pub fn look(&self, view: &PlanView, answer: &mut Visibility) -> Result<(), PlanError> {
        self.look_for(view, None, answer)
    }

    /// Finds the walls and the objects that a view sees. An object is seen if a line of sight within the
    /// view's limits meets it, up to and including the line's end. Takes time proportional to the number of
    /// triangles seen and of objects in them.
    ///
    /// Exact for objects that are points, up to rounding of the range. Conservative for others: an object
    /// counts as seen if it overlaps a triangle of which a part is seen, and reaches into the cone of
    /// directions in which that part is seen.
    ///
    /// Cones of sight have a width and end at walls. So three kinds of objects may not be listed although
    /// [`sees`](Self::sees) is true for a point of them: those seen only along one line that touches the ends
    /// of two walls, one on its left and one on its right; those with an area that lie in the shadow of a
    /// wall and only touch the line of sight past the wall's end; and those that touch a wall from behind and
    /// are not seen elsewhere.
    ///
    /// # Errors
    /// The errors of [`look`](Self::look), and [`PlanError::Objects`] if the objects are of another plan. The
    /// result is then empty.
    pub fn look_at(
        &self,
        view: &PlanView,
        objects: &PlanObjects,
        answer: &mut Visibility,
    ) -> Result<(), PlanError> {
        self.look_for(view, Some(objects), answer)
    }

    fn look_for(
        &self,
        view: &PlanView,
        objects: Option<&PlanObjects>,
        answer: &mut Visibility,
    ) -> Result<(), PlanError> {
        answer.begin(self.walls().len(), objects.map_or(0, PlanObjects::len));
        if objects.is_some_and(|objects| objects.of != self.triangulated) {
            return Err(PlanError::Objects);
        }
        let eye = view.checked_eye()?;
        if !view.heights.is_none_or(are_heights) {
            return Err(PlanError::Heights);
        }
        let mut sector = core::mem::take(&mut answer.sector);
        let limited = view.sector_points(eye, &mut sector);
        if let Ok(limited) = limited {
            let from = Expansion { plan: self, eye, sector: &sector };
            self.look_from(&from, view, limited, objects, answer);
        }
        answer.sector = sector;
        limited.map(|_| ())
    }

    fn look_from(
        &self,
        from: &Expansion<'_>,
        view: &PlanView,
        limited: bool,
        objects: Option<&PlanObjects>,
        answer: &mut Visibility,
    ) {
        let eye = from.eye;
        // Starts at the last eye's position, which is used if it is only some steps away.
        let last = if answer.last.1 == self.triangulated { answer.last.0 } else { NONE };
        let place = self.locate_near(eye, last);
        if let Place::Triangle(t) = place {
            answer.last = (3 * t, self.triangulated);
        }
        let Visibility {
            polygon, walls, objects: seen, twice_area, cones, marks, object_marks, query, ..
        } = answer;
        // Walls on which the eye stands are seen.
        match place {
            Place::Edge(h) if self.piece[h as usize] != NONE => {
                add_walls(walls, marks, *query, self.walls_of(self.piece[h as usize]));
            }
            Place::Vertex(h) => {
                for piece in self.fan(h).map(|h| self.piece[h as usize]).filter(|piece| *piece != NONE) {
                    add_walls(walls, marks, *query, self.walls_of(piece));
                }
            }
            _ => {}
        }
        // Cones around the eye, from right to left. They are taken from the end of the list, so the order is
        // reversed.
        from.start(place, view.through, cones);
        if limited {
            from.limit(cones);
        }
        cones.reverse();
        let disc = (view.range < f64::INFINITY).then(|| Disc::new(eye, view.range));
        // The objects of each triangle that a cone enters are seen if they meet this cone within range.
        let mut enter = |triangle: u32, right: Ray, left: Ray| {
            let Some(objects) = objects else { return };
            let cone = [from.point(right.point), from.point(left.point)];
            objects.for_each_in(triangle, |object| {
                let mark = &mut object_marks[object as usize];
                if *mark != *query
                    && objects.is_in_cone(object, eye, cone)
                    && disc.is_none_or(|disc| objects.is_near(object, eye, &disc))
                {
                    *mark = *query;
                    seen.push(object);
                }
            });
        };
        // The triangles at the eye are not entered through an edge, so they are handled here.
        for cone in cones.iter() {
            if let Some((triangle, right, left)) = cone.inside() {
                enter(triangle, right, left);
            }
        }
        let heights = view.heights.map(|[a, b]| [a.min(b), a.max(b)]);
        let stops = |edge: u32| heights.is_none_or(|heights| self.stops_between(edge, heights));
        // The eye is a corner of the polygon if the view is limited or the eye is on the boundary of the
        // plan. Otherwise the polygon closes around the eye.
        let around = !limited && !self.is_on_boundary(place);
        let mut last = [f64::NAN; 2];
        let mut push = |point: Point| {
            if point != last {
                polygon.push(point);
                last = point;
            }
        };
        let mut wall = |edge: u32, met: Met| {
            let piece = self.piece[edge as usize];
            if met != Met::Far && piece != NONE {
                add_walls(walls, marks, *query, self.walls_of(piece));
            }
        };
        // With a range, the boundary has arcs, and the area is computed from the finished polygon. Otherwise
        // the boundary consists of parts of walls, whose triangles with the eye are summed.
        if let Some(disc) = disc {
            from.run(
                cones,
                |edge| disc.is_near(self.ends(edge)),
                stops,
                enter,
                |edge, right, left, met| {
                    wall(edge, met);
                    if met != Met::Passed {
                        let ends = [from.meet(right, edge), from.meet(left, edge)];
                        disc.clip(ends, [right.offset, left.offset], &mut push);
                    }
                },
            );
            if !around && !polygon.is_empty() {
                polygon.push(eye);
            }
            *twice_area = doubled_area(polygon, eye);
        } else {
            from.run(
                cones,
                |_| true,
                stops,
                enter,
                |edge, right, left, met| {
                    wall(edge, met);
                    if met == Met::Ended {
                        let (a, b) = (from.meet(right, edge), from.meet(left, edge));
                        *twice_area += chord(eye, a, b);
                        push(a);
                        push(b);
                    }
                },
            );
            if !around && !polygon.is_empty() {
                polygon.push(eye);
            }
        }
        if polygon.len() > 1 && polygon.first() == polygon.last() {
            polygon.pop();
        }
    }

    /// Returns whether a [`Place`] is on the boundary of the outer rectangle or outside it.
    fn is_on_boundary(&self, place: Place) -> bool {
        let is_outer = |h: u32| self.edges[h as usize].twin().is_none();
        match place {
            Place::Triangle(_) => false,
            Place::Edge(h) => is_outer(h),
            Place::Vertex(h) => self.fan(h).any(is_outer),
            Place::Outside => true,
        }
    }
}

/// Returns twice the area of a polygon that is star-shaped around the eye.
fn doubled_area(polygon: &[Point], eye: Point) -> f64 {
    let after = polygon.iter().cycle().skip(1);
    polygon.iter().zip(after).map(|(&a, &b)| chord(eye, a, b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Marks of queries before the number of queries wraps count no more.
    #[test]
    fn marks_are_forgotten_when_queries_wrap() {
        let plan = Plan::new(&[super::super::Wall::new([-1.0, 1.0], [1.0, 1.0])]).unwrap();
        let mut objects = PlanObjects::new(&plan);
        objects.insert(&plan, &[[0.0, 0.5]]).unwrap();
        let mut answer = Visibility::new();
        let view = PlanView::new([0.0, 0.0]);
        plan.look_at(&view, &objects, &mut answer).unwrap();
        answer.query = u32::MAX;
        answer.marks.fill(0);
        answer.object_marks.fill(0);
        plan.look_at(&view, &objects, &mut answer).unwrap();
        assert_eq!(
            (answer.walls(), answer.objects()),
            (&[0][..], &[0][..]),
            "wall and object that the eye sees"
        );
    }
}
