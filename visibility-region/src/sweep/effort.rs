//! Limits of a sweep's work: for a whole sweep, and for one call.

/// Limits of a sweep: how many planes it has, how often an occluder is drawn, and how surfaces are divided.
/// Higher numbers hide more objects and take longer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Effort {
    /// Greatest number of planes that are placed right behind an occluder.
    pub(crate) behind: usize,
    /// Least ratio of the distances of successive planes in the *geometric series*: the planes that are
    /// placed at growing distances, independent of occluders. If `growing` planes with this ratio do not
    /// reach the last occludee, the ratio is increased until they do.
    pub(super) growth: f64,
    /// Greatest number of planes in the geometric series.
    pub(super) growing: usize,
    /// Number of planes behind an occluder's farthest point on which the occluder is drawn again, besides the
    /// planes that cut it. Each reprojection of the map loses up to a pixel around a covered area; drawing
    /// the occluder again restores it.
    pub(crate) again: usize,
    /// Least ratio of the distance of a plane to that of an earlier one, if an occluder that cuts both and
    /// added no pixel on the earlier one is to be drawn on the later one. At most 1: on every plane.
    pub(super) after_nothing: f64,
    /// Greatest number of triangles in a piece of joined surfaces. A whole floor or street could be one
    /// piece: it would begin near the cell and end far away, so it would be drawn on every plane, and its own
    /// contours would cut much of what it covers. Several smaller pieces are drawn faster and cover as much.
    pub(crate) max_triangles: u32,
    /// Whether pieces join triangles of different parts of a mesh, also in clusters of a single object. In
    /// clusters of several objects, they always do.
    pub(crate) joins: bool,
}

impl Effort {
    /// The effort for bakes, where a call may take long.
    pub(crate) const FULL: Self = Self {
        behind: 24,
        growth: 1.3,
        growing: 27,
        again: 6,
        after_nothing: 1.0,
        max_triangles: 256,
        joins: true,
    };
    /// The effort for a viewcell around a moving eye. docs/online.md compares its times and results with
    /// those of `FULL`.
    pub(crate) const QUICK: Self = Self {
        behind: 8,
        growth: 1.25,
        growing: 60,
        again: 1,
        after_nothing: 1.4,
        max_triangles: 64,
        joins: false,
    };

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
