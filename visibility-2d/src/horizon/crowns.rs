//! Number of tree crowns that lines of sight have passed, by direction. A crown is an object that the user
//! has declared to be the crown of a tree
//! ([`HorizonCuller::with_crowns`](super::HorizonCuller::with_crowns)). Picture, face, column and height are
//! defined in the [`horizon`](super) module.
//!
//! A single crown does not occlude, but hardly anything is visible through six. Each column counts the crowns
//! whose inner part meets the column, nearest first, and the mean height of their tops. A box counts as
//! hidden if it is behind the given number of crowns in all its columns, and lower than their mean top.
//! Approximate. ("Visible Zone Maintenance for Real-Time Occlusion Culling", 2002: the aggregate occlusion of
//! trees by direction.)

use super::column_query::QueryEye;
use super::columns::Columns;
use super::frame::FACES;
use alloc::vec;
use alloc::vec::Vec;
use visibility_core::{Aabb, ObjectId};

/// Share of a crown's width that counts: its middle half, because its rim is thin.
const CORE: f32 = 0.5;

/// Tree crowns, and for each column of the picture the number of crowns that it has met in this frame.
#[derive(Clone, Debug)]
pub(crate) struct CrownColumns {
    /// Ids of the objects that are crowns, ascending.
    crowns: Vec<ObjectId>,
    /// Number of crowns, one behind another, that count as opaque. At least 1.
    crossings: u8,
    /// For each column: the number of crowns that the column has met, and the sum of the heights of their
    /// tops in the picture (height above the eye divided by depth). Column `c` of face `f` is at index `f *
    /// per_face + c`, where `per_face` is the number of columns of a face.
    met: Vec<(u8, f32)>,
}

impl CrownColumns {
    pub(crate) fn new(crowns: Vec<ObjectId>, crossings: u8) -> Self {
        let mut crowns = crowns;
        crowns.sort_unstable();
        Self { crowns, crossings: crossings.max(1), met: Vec::new() }
    }

    /// Clears the columns for a new frame, with `per_face` columns in each face.
    pub(crate) fn begin(&mut self, per_face: usize) {
        if self.met.len() != per_face * FACES {
            self.met = vec![(0, 0.0); per_face * FACES];
        }
        self.met.fill((0, 0.0));
    }

    /// Returns whether an object is a crown.
    pub(crate) fn is_crown(&self, id: ObjectId) -> bool {
        self.crowns.binary_search(&id).is_ok()
    }

    /// Returns whether a box is behind enough crowns, and lower than the mean of their tops, in every column
    /// in which the view may see it. False for a box above or below the eye.
    pub(crate) fn hides(&self, columns: &Columns, eye: &QueryEye, rows: [usize; 3], bounds: &Aabb) -> bool {
        let mut any = false;
        columns.for_each_part(eye, rows, bounds, |face, first, last, high| {
            any = true;
            let met = &self.met[face * columns.per_face()..][first..=last];
            met.iter().all(|&(count, tops)| count >= self.crossings && high * f32::from(count) <= tops)
        }) && any
    }

    /// Counts a crown, given by its box, in all columns that the inner part of its width meets.
    pub(crate) fn add(&mut self, columns: &Columns, eye: &QueryEye, rows: [usize; 3], bounds: &Aabb) {
        let (center, half) = (bounds.center(), bounds.half_extent());
        let mut core = *bounds;
        for &row in &rows[..2] {
            core.min[row] = center[row] - CORE * half[row];
            core.max[row] = center[row] + CORE * half[row];
        }
        columns.for_each_part(eye, rows, &core, |face, first, last, high| {
            for (count, tops) in &mut self.met[face * columns.per_face()..][first..=last] {
                *count = count.saturating_add(1);
                *tops += high;
            }
            true
        });
    }
}
