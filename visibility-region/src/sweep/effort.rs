//! How much a sweep does: in all, and in one call.

/// Limits of a sweep: how many planes it has, how often an occluder is drawn, and how surfaces are divided.
/// Higher numbers hide more objects and take longer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Effort {
    /// Greatest number of planes that are each put right behind an occluder.
    pub(crate) behind: usize,
    /// Least ratio of the distances of successive planes of the geometric series: the planes that are put at
    /// growing distances, wherever occluders are. The ratio is larger where `growing` planes would not reach
    /// the last occludee.
    pub(super) growth: f64,
    /// Greatest number of planes in the geometric series.
    pub(super) growing: usize,
    /// Number of planes on which an occluder is drawn beyond its farthest point, besides the planes that cut
    /// it. Each reprojection loses up to a pixel around a covered area, so that drawing again keeps more.
    pub(crate) again: usize,
    /// Greatest number of triangles of a piece of surfaces. Whole floors and streets could be one piece: such
    /// a piece begins near the cell and ends far away, so it would be drawn on every plane, and its own
    /// contours would cut much of what it covers. Several smaller pieces are drawn faster and cover no less.
    pub(crate) max_triangles: u32,
    /// Whether pieces join the parts of one mesh. Those of several objects that are one cluster they always
    /// join.
    pub(crate) joins: bool,
}

impl Effort {
    /// The effort where a call may take its time, as in bakes.
    pub(crate) const FULL: Self =
        Self { behind: 24, growth: 1.3, growing: 27, again: 6, max_triangles: 256, joins: true };
    /// The effort for a viewcell of an eye on the move: docs/online.md has the times and objects of each.
    pub(crate) const QUICK: Self =
        Self { behind: 12, growth: 1.5, growing: 18, again: 2, max_triangles: 64, joins: false };
}

/// Work that a call may still do, in nanoseconds of a core of 3 GHz, roughly: what is counted are steps of
/// loops, not time, so that a call does the same work on every machine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Work(u64);

impl Work {
    pub(crate) const UNLIMITED: Self = Self(u64::MAX);

    /// Work of some microseconds, at least 1.
    pub(crate) fn microseconds(microseconds: u32) -> Self {
        Self(u64::from(microseconds.max(1)) * 1000)
    }

    pub(crate) fn is_used_up(&self) -> bool {
        self.0 == 0
    }

    /// Uses `count` times `nanoseconds`, at most what is left.
    pub(crate) fn use_up(&mut self, count: usize, nanoseconds: u64) {
        self.0 = self.0.saturating_sub(count as u64 * nanoseconds);
    }
}
