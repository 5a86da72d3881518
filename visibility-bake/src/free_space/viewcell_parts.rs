//! The viewcells of a box of the grid that walls may divide.
//!
//! A box that crosses a wall contains positions on both sides of the wall, and inside it. Everything seen
//! from any of them would count as visible. So each connected part of the reached free voxels in a box gets
//! its own viewcell: the part's bounding box, extended to the next solid surface.

use super::solid_triangles::{SolidTriangle, SolidTriangles};
use super::triangle_columns::{ClippedTriangle, extent};
use super::voxel_set::VoxelBounds;
use crate::grid::{Grid, GridError};
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;

/// Appends the viewcells of the parts of a box to `all`. A part is a connected set of voxels of the box,
/// given by its bounds. A viewcell that is inside another part's viewcell is left out. Time is proportional
/// to the number of parts times that of viewcells and of triangles that meet the box.
///
/// # Errors
/// [`GridError::TooMany`] if `all` then has more than [`Grid::LIMIT`] viewcells, [`GridError::Stopped`] if
/// the grid's stop function returned true, which is asked for each box and for every 1024th part.
pub(super) fn add_viewcells(
    solids: &SolidTriangles<'_>,
    place: [i64; 3],
    parts: impl IntoIterator<Item = VoxelBounds>,
    all: &mut Vec<Viewcell>,
) -> Result<(), GridError> {
    let mut found: Vec<Viewcell> = Vec::new();
    let mut triangles: Option<Vec<&SolidTriangle>> = None;
    for (number, part) in parts.into_iter().enumerate() {
        solids.grid.stop.check(number)?;
        let triangles = triangles.get_or_insert_with(|| triangles_in(solids, place));
        let cell = grown(solids, triangles, place, &part);
        let is_within = |a: &Viewcell, b: &Viewcell| b.min.cmple(a.min).all() && a.max.cmple(b.max).all();
        if !found.iter().any(|other| is_within(&cell, other)) {
            found.retain(|other| !is_within(other, &cell));
            found.push(cell);
        }
    }
    all.extend(found);
    if all.len() > Grid::LIMIT { Err(GridError::TooMany) } else { Ok(()) }
}

/// Returns the distance in metres from a solid surface at which a viewcell ends, so that its face is not in
/// the surface. Half of it is for rounding.
fn gap(solids: &SolidTriangles<'_>) -> f64 {
    solids.voxel_size().min_element() * 0.01
}

/// Returns the triangles whose extents come within half a [`gap`] of a box of the grid.
fn triangles_in<'a>(solids: &'a SolidTriangles<'_>, place: [i64; 3]) -> Vec<&'a SolidTriangle> {
    let (whole, slack) = (solids.grid.cell(place), gap(solids) * 0.5);
    let (start, end) = (whole.min - solids.grid.origin, whole.max - solids.grid.origin);
    let meets = |triangle: &&SolidTriangle| {
        let (least, most) = extent(&triangle.corners);
        least.cmple(end + slack).all() && (start - slack).cmple(most).all()
    };
    solids.in_column_of(place).filter(meets).collect()
}

/// Returns the bounding box of a part, extended on each side up to the next solid surface or the side of the
/// grid's box. `triangles` are those [in the box](triangles_in).
fn grown(
    solids: &SolidTriangles<'_>,
    triangles: &[&SolidTriangle],
    place: [i64; 3],
    part: &VoxelBounds,
) -> Viewcell {
    let (origin, whole) = (solids.grid.origin, solids.grid.cell(place));
    let (start, end) = (whole.min - origin, whole.max - origin);
    let (mut low, mut high, edge) = (start, end, solids.voxel_size());
    // Starts with the bounding box of the part. A side at the grid box's own side keeps its exact coordinate.
    for axis in 0..3 {
        if part.first[axis] > 0 {
            low[axis] = start[axis] + part.first[axis] as f64 * edge[axis];
        }
        if part.last[axis] + 1 < solids.counts[axis] {
            high[axis] = start[axis] + (part.last[axis] + 1) as f64 * edge[axis];
        }
    }
    let gap = gap(solids);
    let slack = gap * 0.5;
    // Each side moves outwards to the nearest triangle in its way, tested across the box as extended so far.
    for side in 0..6 {
        let (axis, is_upper) = (side / 2, side % 2 == 1);
        let (from, to) = if is_upper { (high[axis], end[axis]) } else { (start[axis], low[axis]) };
        if from >= to {
            continue;
        }
        let mut limit = if is_upper { to } else { from };
        for triangle in triangles {
            let (least, most) = extent(&triangle.corners);
            let meets = |k: usize, a: f64, b: f64| least[k] <= b + slack && a - slack <= most[k];
            if !(meets(axis, from, to) && (0..3).all(|k| k == axis || meets(k, low[k], high[k]))) {
                continue;
            }
            let beyond = (0..3).fold(ClippedTriangle::new(triangle.corners), |polygon, k| {
                let ends = if k == axis { [from, to] } else { [low[k], high[k]] };
                polygon.clipped(k, [ends[0] - slack, ends[1] + slack])
            });
            if !beyond.is_empty() {
                let [least, most] = beyond.range(axis);
                limit = if is_upper { limit.min(least - gap) } else { limit.max(most + gap) };
            }
        }
        if is_upper {
            high[axis] = limit.max(from);
        } else {
            low[axis] = limit.min(to);
        }
    }
    // Sides of the grid's box keep their exact coordinates.
    let min = DVec3::select(low.cmpeq(start), whole.min, origin + low);
    Viewcell::from_box(min, DVec3::select(high.cmpeq(end), whole.max, origin + high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::free_space::camera_range::CameraRange;
    use visibility_core::glam::Vec3;
    use visibility_core::{Aabb, Object, Scene};

    /// Returns the two triangles of a rectangle that lies across `axis` at `at`, between the coordinates `u`
    /// and `v` on the two following axes.
    fn rectangle(axis: usize, at: f64, u: [f64; 2], v: [f64; 2]) -> [[Vec3; 3]; 2] {
        let corner = |u: f64, v: f64| {
            let mut p = DVec3::splat(at);
            (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (u, v);
            p.as_vec3()
        };
        let [a, b, c, d] = [corner(u[0], v[0]), corner(u[1], v[0]), corner(u[1], v[1]), corner(u[0], v[1])];
        [[a, b, c], [a, c, d]]
    }

    /// Returns the viewcells of parts of a box of 4 m, in voxels of half a metre, among walls. A part is
    /// given by its first and last voxel.
    fn viewcells(walls: &[[[Vec3; 3]; 2]], parts: &[[[usize; 3]; 2]]) -> Vec<Viewcell> {
        let mut scene = Scene::new();
        for wall in walls {
            let bounds = Aabb::from_points(wall.as_flattened().iter().copied());
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            scene.set_triangles(id, *wall).unwrap();
        }
        let grid = Grid::new(DVec3::ZERO, DVec3::splat(4.0)).unwrap();
        let camera = CameraRange { radius: 0.52 * 3f64.sqrt() / 0.99, ..CameraRange::default() };
        let solids = SolidTriangles::new(&grid, &scene, &camera, [DVec3::ZERO, DVec3::splat(4.0)]).unwrap();
        assert_eq!(solids.counts, [8; 3], "voxels along each axis");
        let (mut all, parts) = (Vec::new(), parts.iter().map(|&[first, last]| VoxelBounds { first, last }));
        add_viewcells(&solids, [0; 3], parts, &mut all).unwrap();
        all
    }

    /// A part is extended up to 5 mm before a wall, the gap of voxels of half a metre, and no wall moves a
    /// side into the part. A wall that the extended part misses by less than half of the gap is in its way.
    #[test]
    fn parts_end_a_gap_before_walls() {
        let all = [-9.0, 9.0];
        for axis in 0..3 {
            let turned = |mut place: [usize; 3]| {
                place.rotate_right(axis);
                place
            };
            let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
            // The lower half of the box along `axis`, in the lower half on the next axis too.
            let low = [turned([0, 0, 0]), turned([3, 3, 7])];
            for (at, expected) in [(3.0, 2.995), (2.003, 2.0), (9.0, 4.0)] {
                let found = viewcells(&[rectangle(axis, at, all, all)], &[low]);
                let [cell] = &found[..] else { panic!("{found:?}") };
                assert!((cell.max[axis] - expected).abs() < 1e-6, "axis {axis}: a wall at {at}: {cell:?}");
                assert_eq!(cell.min, DVec3::ZERO, "axis {axis}: the lower sides are those of the box");
                assert_eq!([cell.max[u], cell.max[v]], [4.0; 2], "axis {axis}: the other sides");
            }
            let high = [turned([4, 4, 0]), turned([7, 7, 7])];
            for (at, expected) in [(1.0, 1.005), (1.997, 2.0), (-9.0, 0.0)] {
                let found = viewcells(&[rectangle(axis, at, all, all)], &[high]);
                let [cell] = &found[..] else { panic!("{found:?}") };
                assert!((cell.min[axis] - expected).abs() < 1e-6, "axis {axis}: a wall at {at}: {cell:?}");
                assert_eq!(cell.max, DVec3::splat(4.0), "axis {axis}: the upper sides are those of the box");
            }
        }
        // Walls along x beside the part, which is extended along x first.
        let low = [[0; 3], [3, 3, 7]];
        for (begin, expected) in [(2.002, 2.995), (2.003, 4.0)] {
            let found = viewcells(&[rectangle(0, 3.0, [begin, 9.0], all)], &[low]);
            assert!((found[0].max.x - expected).abs() < 1e-6, "a wall from y = {begin}: {found:?}");
        }
        // A ceiling above the box is in the way if it is nearer than half of the gap.
        for (at, expected) in [(4.002, 3.997), (4.003, 4.0)] {
            let found = viewcells(&[rectangle(2, at, all, all)], &[[[0; 3], [7, 7, 3]]]);
            assert!((found[0].max.z - expected).abs() < 1e-6, "a ceiling at {at}: {found:?}");
        }
    }

    #[test]
    fn viewcells_inside_another_are_left_out() {
        let wall = rectangle(0, 3.0, [-9.0, 1.0], [-9.0, 9.0]);
        let (before, beside, whole) = ([[0; 3], [3, 1, 7]], [[0, 4, 0], [3, 7, 7]], [[0; 3], [7; 3]]);
        assert_eq!(viewcells(&[wall], &[before, before]).len(), 1, "equal viewcells");
        assert_eq!(viewcells(&[wall], &[before, beside]).len(), 2, "viewcells that overlap");
        let all = Viewcell::from_box(DVec3::ZERO, DVec3::splat(4.0));
        for parts in [[before, whole], [whole, before]] {
            assert_eq!(viewcells(&[wall], &parts), std::slice::from_ref(&all), "one inside the other");
        }
    }
}
