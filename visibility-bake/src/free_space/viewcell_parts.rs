//! The viewcells of a box of the grid that walls may divide.
//!
//! A box that crosses a wall contains positions on both sides of the wall, and inside it. Everything seen
//! from any of them would count as visible. So each connected part of the reached free voxels in a box gets
//! its own viewcell: the part's bounding box, extended to the next solid surface.

use super::solid_triangles::SolidTriangles;
use super::triangle_columns::{ClippedTriangle, extent};
use super::voxel_set::VoxelBounds;
use crate::grid::{Grid, GridError};
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;

/// Appends the viewcells of the parts of a box to `all`. A part is a connected set of voxels of the box,
/// given by its bounds. A viewcell that is inside another part's viewcell is left out.
///
/// # Errors
/// [`GridError::TooMany`] if `all` then has more than [`Grid::LIMIT`] viewcells.
pub(super) fn add_viewcells(
    solids: &SolidTriangles<'_>,
    place: [i64; 3],
    parts: impl IntoIterator<Item = VoxelBounds>,
    all: &mut Vec<Viewcell>,
) -> Result<(), GridError> {
    let mut found: Vec<Viewcell> = Vec::new();
    for part in parts {
        let cell = grown(solids, place, &part);
        let is_within = |a: &Viewcell, b: &Viewcell| b.min.cmple(a.min).all() && a.max.cmple(b.max).all();
        if !found.iter().any(|other| is_within(&cell, other)) {
            found.retain(|other| !is_within(other, &cell));
            found.push(cell);
        }
    }
    all.extend(found);
    if all.len() > Grid::LIMIT { Err(GridError::TooMany) } else { Ok(()) }
}

/// Returns the bounding box of a part, extended on each side up to the next solid surface or the side of the
/// grid's box.
fn grown(solids: &SolidTriangles<'_>, place: [i64; 3], part: &VoxelBounds) -> Viewcell {
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
    // The viewcell ends a little before the surface, so that its face is not in the surface. Half of the gap
    // is for rounding.
    let gap = edge.min_element() * 0.01;
    let slack = gap * 0.5;
    // Each side moves outwards to the nearest triangle in its way, tested across the box as extended so far.
    for side in 0..6 {
        let (axis, is_upper) = (side / 2, side % 2 == 1);
        let (from, to) = if is_upper { (high[axis], end[axis]) } else { (start[axis], low[axis]) };
        if from >= to {
            continue;
        }
        let mut limit = if is_upper { to } else { from };
        for triangle in solids.in_column_of(place) {
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
