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
