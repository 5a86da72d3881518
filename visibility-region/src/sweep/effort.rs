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

    /// Returns the effort for objects that are asked [beside](super::Asked::Beside) their farthest direction,
    /// where few large occluders hide most: fewer planes.
    pub(crate) fn beside(self) -> Self {
        Self { behind: 4, growth: 2.0, growing: 6, ..self }
    }
}

/// Work that a call may still do, and that it has done, in nanoseconds of a core of 3 GHz, roughly: what is
/// counted are steps of loops, not time, so that a call does the same work on every machine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Work {
    left: u64,
    done: u64,
}

impl Work {
    pub(crate) const UNLIMITED: Self = Self { left: u64::MAX, done: 0 };

    /// Work of some microseconds, at least 1.
    pub(crate) fn microseconds(microseconds: u32) -> Self {
        Self { left: u64::from(microseconds.max(1)) * 1000, done: 0 }
    }

    pub(crate) fn is_used_up(&self) -> bool {
        self.left == 0
    }

    /// Returns the nanoseconds done: more than there were at first if the last lump was larger than what was
    /// left.
    pub(crate) fn done(&self) -> u64 {
        self.done
    }

    /// Does `count` times `nanoseconds`.
    pub(crate) fn use_up(&mut self, count: usize, nanoseconds: u64) {
        let nanoseconds = count as u64 * nanoseconds;
        self.left = self.left.saturating_sub(nanoseconds);
        self.done += nanoseconds;
    }
}
