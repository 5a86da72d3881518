//! Objects on a plan: points, boxes and other convex outlines. Each is listed in the triangles that it
//! overlaps.

use super::error::PlanError;
use super::plan::Plan;
use super::predicates::{Point, checked, orient};
use super::range::Disc;
use super::region::{RegionVisibility, convex_hull};
use super::triangulation::NONE;
use alloc::vec::Vec;
use visibility_core::stamp::Stamp;

/// Pair of an object and a triangle, in two linked lists: the objects of the triangle, and the triangles of
/// the object.
#[derive(Clone, Copy, Debug)]
struct Item {
    /// Number of the object.
    object: u32,
    /// Index of the triangle in the plan.
    triangle: u32,
    /// Index in `PlanObjects::items` of the next item of the same triangle, [`NONE`] for the last.
    next: u32,
    /// Index in `PlanObjects::items` of the next item of the same object, [`NONE`] for the last. For an
    /// unused item: of the next unused item.
    next_of_object: u32,
}

/// Objects on a plan. [`Plan::look_at`] finds the visible ones in time proportional to the triangles and
/// objects seen.
///
/// Each object is the convex hull of some points: a point, a segment, a box, a polygon. Objects do not
/// occlude. They belong to the plan that they were put on, and to its clones. Doors may open and close
/// meanwhile.
///
/// ```
/// use visibility_2d::cdt::{Plan, PlanObjects, PlanView, Visibility, Wall};
/// let plan = Plan::from_walls(&[Wall::new([2.0, -1.0], [2.0, 1.0])], 10.0)?;
/// let mut objects = PlanObjects::new(&plan);
/// let hidden = objects.insert(&plan, &[[3.0, 0.0]])?;
/// let crate_beside = objects.insert(&plan, &[[1.0, 2.0], [2.0, 2.0], [2.0, 3.0], [1.0, 3.0]])?;
/// let mut answer = Visibility::new();
/// plan.look_at(&PlanView::new([0.0, 0.0]), &objects, &mut answer)?;
/// assert_eq!(answer.objects(), [crate_beside]);
/// objects.set(&plan, hidden, &[[1.0, 0.0]])?; // comes before the wall
/// plan.look_at(&PlanView::new([0.0, 0.0]), &objects, &mut answer)?;
/// assert!(answer.objects().contains(&hidden));
/// # Ok::<(), visibility_2d::cdt::PlanError>(())
/// ```
#[derive(Clone, Debug)]
pub struct PlanObjects {
    /// Stamp of the triangulation on which the objects are listed.
    pub(super) of: Stamp,
    /// For each triangle of the plan, the index in `items` of the first item in the list of its objects.
    /// [`NONE`] without objects.
    of_triangle: Vec<u32>,
    /// For each object, the index in `items` of the first item in the list of its triangles. [`NONE`] for a
    /// removed object.
    of_object: Vec<u32>,
    /// Corners of the hull of each object, counter-clockwise.
    hulls: Vec<Vec<Point>>,
    /// Items of all linked lists, and unused ones.
    items: Vec<Item>,
    /// Index in `items` of the first unused item, which leads to the next. [`NONE`] if all are used.
    free: u32,
    scratch: RegionVisibility,
}

impl PlanObjects {
    /// Makes an empty list of objects on a plan.
    pub fn new(plan: &Plan) -> Self {
        Self {
            of: plan.triangulated,
            of_triangle: alloc::vec![NONE; plan.triangle_count()],
            of_object: Vec::new(),
            hulls: Vec::new(),
            items: Vec::new(),
            free: NONE,
            scratch: RegionVisibility::new(),
        }
    }

    /// Returns the number of objects, removed ones included.
    pub fn len(&self) -> usize {
        self.of_object.len()
    }

    /// Returns whether no object was ever inserted.
    pub fn is_empty(&self) -> bool {
        self.of_object.is_empty()
    }

    /// Adds the object that is the convex hull of some points in world units, and returns its number, counted
    /// from 0. Takes time proportional to the number of triangles that the object overlaps.
    ///
    /// # Errors
    /// Returns the errors of [`set`](Self::set). No object is then added.
    pub fn insert(&mut self, plan: &Plan, outline: &[[f64; 2]]) -> Result<u32, PlanError> {
        let object = self.of_object.len() as u32;
        self.place(plan, outline)?;
        self.of_object.push(NONE);
        self.hulls.push(Vec::new());
        self.list(object);
        Ok(object)
    }

    /// Replaces an object's outline: the object becomes the convex hull of `outline`. Takes as long as
    /// [`remove`](Self::remove) and [`insert`](Self::insert) together.
    ///
    /// # Errors
    /// - [`PlanError::Coordinate`] if a coordinate of a point is NaN, infinite or above 1e60 in absolute
    ///   value.
    /// - [`PlanError::Region`] if there is no point, or a point is outside the rectangle around the plan.
    /// - [`PlanError::Objects`] if the objects are of another plan, or if no object has that number.
    ///
    /// After an error the object is unchanged.
    pub fn set(&mut self, plan: &Plan, object: u32, outline: &[[f64; 2]]) -> Result<(), PlanError> {
        if object as usize >= self.of_object.len() {
            return Err(PlanError::Objects);
        }
        self.place(plan, outline)?;
        self.remove(object);
        self.list(object);
        Ok(())
    }

    /// Removes an object. It is not seen until it is [set](Self::set) again. Its number is not given to
    /// another object. Does nothing for an unknown number. Takes time proportional to the number of objects
    /// in the triangles that the object overlaps.
    pub fn remove(&mut self, object: u32) {
        let Some(first) = self.of_object.get_mut(object as usize) else { return };
        let mut item = core::mem::replace(first, NONE);
        while item != NONE {
            let Item { triangle, next, next_of_object, .. } = self.items[item as usize];
            let mut before = self.of_triangle[triangle as usize];
            if before == item {
                self.of_triangle[triangle as usize] = next;
            } else {
                while self.items[before as usize].next != item {
                    before = self.items[before as usize].next;
                }
                self.items[before as usize].next = next;
            }
            self.items[item as usize].next_of_object = self.free;
            self.free = item;
            item = next_of_object;
        }
    }

    /// Computes the hull of an outline and the triangles that it overlaps, into scratch memory.
    fn place(&mut self, plan: &Plan, outline: &[[f64; 2]]) -> Result<(), PlanError> {
        if self.of != plan.triangulated {
            return Err(PlanError::Objects);
        }
        let scratch = &mut self.scratch;
        scratch.begin(plan);
        for (index, &point) in outline.iter().enumerate() {
            scratch.points.push(checked(point, index)?);
        }
        convex_hull(&mut scratch.points, &mut scratch.hull);
        plan.overlapped(scratch)
    }

    /// Adds an object to the lists of the triangles that [`place`](Self::place) has found.
    fn list(&mut self, object: u32) {
        let Self { scratch, hulls, items, of_triangle, of_object, free, .. } = self;
        let hull = &mut hulls[object as usize];
        hull.clear();
        hull.extend_from_slice(&scratch.hull);
        for &triangle in scratch.triangles() {
            let (first, first_of_object) =
                (&mut of_triangle[triangle as usize], &mut of_object[object as usize]);
            let item = Item { object, triangle, next: *first, next_of_object: *first_of_object };
            let mut index = *free;
            if index == NONE {
                index = items.len() as u32;
                items.push(item);
            } else {
                *free = items[index as usize].next_of_object;
                items[index as usize] = item;
            }
            (*first, *first_of_object) = (index, index);
        }
    }

    /// Calls `each` with each object of a triangle.
    pub(super) fn for_each_in(&self, triangle: u32, mut each: impl FnMut(u32)) {
        let mut item = self.of_triangle[triangle as usize];
        while item != NONE {
            let Item { object, next, .. } = self.items[item as usize];
            each(object);
            item = next;
        }
    }

    /// Returns whether an object meets the closed cone between the rays from an eye through `right` and
    /// `left`. Exact for points. For other objects, possibly true without a common point.
    pub(super) fn is_in_cone(&self, object: u32, eye: Point, [right, left]: [Point; 2]) -> bool {
        let hull = &self.hulls[object as usize];
        hull.iter().any(|&p| orient(eye, right, p) >= 0.0)
            && hull.iter().any(|&p| orient(eye, left, p) <= 0.0)
    }

    /// Returns whether an object has a point within a disc around the eye. Possibly true without such a
    /// point.
    pub(super) fn is_near(&self, object: u32, eye: Point, disc: &Disc) -> bool {
        let hull = &self.hulls[object as usize];
        let sides = || (0..hull.len()).map(|k| [hull[k], hull[(k + 1) % hull.len()]]);
        sides().any(|side| disc.is_near(side))
            || hull.len() > 2 && sides().all(|[a, b]| orient(a, b, eye) >= 0.0)
    }
}
