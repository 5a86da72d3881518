//! Floor plans: what an eye sees of the walls around it, and whether two points see each other.

use crate::error::{Error, border, vis_status};
use crate::handle::Guarded;
use crate::pointer::{array, buffer, create, destroy, out, reference};
use vis_opacity::*;
use visibility_2d::cdt::{Opacity, Plan, PlanView, RegionVisibility, Visibility, Wall};

/// Floor plan: walls, and the triangles between them.
pub struct vis_plan(Guarded<Plan>);

/// Effect of a wall on lines of sight that cross it.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum vis_opacity {
    /// Lines of sight end at the wall: a solid wall, a closed door.
    VIS_OPACITY_OPAQUE = 0,
    /// Lines of sight pass: glass, an open door, or a line that makes the cells of a large room smaller.
    VIS_OPACITY_CLEAR = 1,
    /// Lines of sight pass from the left of the wall to its right, as seen along it from its first end, and
    /// end when they come from the right.
    VIS_OPACITY_ONE_WAY = 2,
}

/// Returns the opacity of a number.
pub(super) fn opacity(number: u32) -> Result<Opacity, Error> {
    const ALL: [(vis_opacity, Opacity); 3] = [
        (VIS_OPACITY_OPAQUE, Opacity::Opaque),
        (VIS_OPACITY_CLEAR, Opacity::Clear),
        (VIS_OPACITY_ONE_WAY, Opacity::OneWay),
    ];
    let known = ALL.iter().find(|(known, _)| *known as u32 == number);
    known.map(|known| known.1).ok_or_else(|| Error::argument(format_args!("{number} is no vis_opacity")))
}

/// Wall of a floor plan: a segment that is as high as the level.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct vis_wall {
    /// First end: the plan's x and y.
    pub from: [f64; 2],
    /// Second end.
    pub to: [f64; 2],
    /// A `vis_opacity`.
    pub opacity: u32,
}

/// Makes the plan of walls.
pub(super) fn plan_of(walls: &[vis_wall]) -> Result<Plan, Error> {
    let wall = |wall: &vis_wall| Ok(Wall::new(wall.from, wall.to).with_opacity(opacity(wall.opacity)?));
    Ok(Plan::new(&walls.iter().map(wall).collect::<Result<Vec<_>, Error>>()?)?)
}

/// Number of no wall: where a ray leaves the plan.
pub const VIS_NO_WALL: u32 = 0xFFFF_FFFF;

/// End of a ray in a plan.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct vis_wall_hit {
    /// Where the ray ends: the plan's x and y. NaN for a ray without a direction, or one that does not enter
    /// the rectangle around the plan.
    pub point: [f64; 2],
    /// Number of the wall that stops the ray. `VIS_NO_WALL` if none does: the point is on the rectangle
    /// around the plan.
    pub wall: u32,
}

/// Makes a plan of walls, which are numbered from 0 in the given order. They may cross and touch. Around them
/// is a rectangle with a margin of a quarter of their extent, at least 1; what an eye sees ends there.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_plan_create(
    walls: *const vis_wall,
    wall_count: usize,
    plan: *mut *mut vis_plan,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (walls, place) = unsafe { (array(walls, wall_count, "walls")?, out(plan, "plan")?) };
        create(place, vis_plan(Guarded::new(plan_of(walls)?)));
        Ok(())
    })
}

/// Destroys a plan. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_plan_destroy(plan: *mut vis_plan) {
    // SAFETY: by rule P3 of `visibility.h`, the handle is null, or made by this library and unused.
    unsafe { destroy(plan) }
}

/// Sets the opacity, a `vis_opacity`, of a wall: a door that opens. Returns `VIS_ERROR_UNKNOWN_ID` for a wall
/// that the plan does not have.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_plan_set_opacity(
    plan: *mut vis_plan,
    wall: u32,
    opacity_of_wall: u32,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, the pointer is null or valid to read.
        let plan = unsafe { reference(plan, "plan") }?;
        let opacity = opacity(opacity_of_wall)?;
        Ok(plan.0.write()?.set_opacity(wall, opacity)?)
    })
}

/// Writes whether the segment from point `a` to point `b`, 2 coordinates each, meets no wall that stops sight
/// from `a` to `b` before its end. Exact for the given numbers. A point on a wall sees both of its sides.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_plan_sees(
    plan: *const vis_plan,
    a: *const f64,
    b: *const f64,
    sees: *mut bool,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (plan, mut place) = unsafe { (reference(plan, "plan")?, out(sees, "sees")?) };
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 2 numbers each.
        let (a, b) =
            unsafe { (reference(a.cast::<[f64; 2]>(), "a")?, reference(b.cast::<[f64; 2]>(), "b")?) };
        place.set(plan.0.read()?.sees(*a, *b)?);
        Ok(())
    })
}

/// Writes where a ray from `eye` through the point `through`, 2 coordinates each, ends: at the first wall
/// that stops sight, or at the rectangle around the plan.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_plan_ray(
    plan: *const vis_plan,
    eye: *const f64,
    through: *const f64,
    hit: *mut vis_wall_hit,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (plan, mut place) = unsafe { (reference(plan, "plan")?, out(hit, "hit")?) };
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 2 numbers each.
        let (eye, through) = unsafe {
            (reference(eye.cast::<[f64; 2]>(), "eye")?, reference(through.cast::<[f64; 2]>(), "through")?)
        };
        let found = plan.0.read()?.ray(*eye, *through)?;
        place.set(found.map_or(vis_wall_hit { point: [f64::NAN; 2], wall: VIS_NO_WALL }, |found| {
            vis_wall_hit { point: found.point, wall: found.wall.unwrap_or(VIS_NO_WALL) }
        }));
        Ok(())
    })
}

/// Looks around from an eye.
///
/// # Safety
/// By rule P1 of `visibility.h`, each pointer is null, or valid to read: 2 numbers of `eye`.
unsafe fn look(plan: *const vis_plan, eye: *const f64, range: f64) -> Result<Visibility, Error> {
    // SAFETY: the caller promises what is asked for here.
    let (plan, eye) = unsafe { (reference(plan, "plan")?, reference(eye.cast::<[f64; 2]>(), "eye")?) };
    let mut answer = Visibility::new();
    plan.0.read()?.look(&PlanView::new(*eye).with_range(range), &mut answer)?;
    Ok(answer)
}

fn sorted(walls: &[u32]) -> Vec<u32> {
    let mut walls = walls.to_vec();
    walls.sort_unstable();
    walls
}

/// Writes the corners of what an eye sees, counter-clockwise, 2 coordinates each; `capacity` and `count` are
/// numbers of coordinates. `eye` is the plan's x and y, `range` the greatest distance, infinite for none;
/// arcs become chords inside of them. A null or too short buffer is handled as in `vis_visible_ids`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_plan_visibility_polygon(
    plan: *const vis_plan,
    eye: *const f64,
    range: f64,
    coordinates: *mut f64,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (answer, list) = unsafe { (look(plan, eye, range)?, buffer(coordinates, capacity, count)?) };
        let flat = answer.polygon().as_flattened();
        list.fill(flat.len(), flat.iter().copied())
    })
}

/// Writes the numbers of the walls that an eye sees, ascending. Parameters as in
/// `vis_plan_visibility_polygon`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_plan_visible_walls(
    plan: *const vis_plan,
    eye: *const f64,
    range: f64,
    walls: *mut u32,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (answer, list) = unsafe { (look(plan, eye, range)?, buffer(walls, capacity, count)?) };
        let seen = sorted(answer.walls());
        list.fill(seen.len(), seen.into_iter())
    })
}

/// Writes the numbers of the walls that can be seen from somewhere in the convex hull of points, 2
/// coordinates each, ascending. Sight from within the region, on its side of walls that cross it, is exact.
/// Returns `VIS_ERROR_ARGUMENT` if there is no point, if a point is outside the rectangle around the plan, or
/// if lines of sight enter more than 2^24 triangles of the plan.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_plan_walls_seen_from_region(
    plan: *const vis_plan,
    points: *const f64,
    point_count: usize,
    walls: *mut u32,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (plan, list) = unsafe { (reference(plan, "plan")?, buffer(walls, capacity, count)?) };
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 2 numbers for each of `point_count`.
        let points = unsafe { array(points.cast::<[f64; 2]>(), point_count, "points") }?;
        let mut answer = RegionVisibility::new();
        plan.0.read()?.look_from_region(points, &mut answer)?;
        let seen = sorted(answer.walls());
        list.fill(seen.len(), seen.into_iter())
    })
}
