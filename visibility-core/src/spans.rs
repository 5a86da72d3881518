//! Spans of the crate `tracing` around frames and bakes, with their counts as fields. Without the feature
//! `tracing` a span is an empty value, and every call here compiles to the call of its closure.

#[cfg(not(feature = "tracing"))]
pub(crate) use off::{Span, frame, round, stage};
#[cfg(feature = "tracing")]
pub(crate) use on::{Span, frame, round, stage};

#[cfg(feature = "tracing")]
mod on {
    use crate::{CullStats, bake::Progress};
    use tracing::{debug_span, field::Empty};

    /// A span that is entered by [`within`](Self::within), on any thread.
    pub(crate) struct Span(tracing::Span);

    /// Opens the span of a call of [`Pipeline::cull`](crate::Pipeline::cull).
    pub(crate) fn frame() -> Span {
        Span(debug_span!(target: "visibility", "cull", kept = Empty, visible = Empty))
    }

    /// Opens the span of one stage of a pipeline, in the span of the frame. `name` is the culler's name.
    pub(crate) fn stage(name: &str) -> Span {
        Span(debug_span!(
            target: "visibility", "stage", name, nodes = Empty, accepted_subtrees = Empty, tests = Empty,
            occluders = Empty, visible = Empty
        ))
    }

    /// Opens the span of a round of a bake over `items` items.
    pub(crate) fn round(items: usize) -> Span {
        Span(debug_span!(
            target: "visibility", "bake_round", items, done = Empty, total = Empty, steps = Empty
        ))
    }

    impl Span {
        /// Calls `work` within the span.
        pub(crate) fn within<T>(&self, work: impl FnOnce() -> T) -> T {
            self.0.in_scope(work)
        }

        /// Calls `work` within a span of one item of this round, on whichever thread works on the item.
        pub(crate) fn item<T>(&self, item: u32, work: impl FnOnce() -> T) -> T {
            debug_span!(target: "visibility", parent: &self.0, "bake_item", item).in_scope(work)
        }

        /// Records the result of a frame: whether it kept an earlier answer, and the objects left in the set.
        pub(crate) fn record_frame(&self, kept: bool, visible: u64) {
            self.0.record("kept", kept).record("visible", visible);
        }

        /// Records the counters of a stage.
        pub(crate) fn record_stage(&self, stats: &CullStats) {
            let CullStats { nodes, accepted_subtrees, tests, occluders, visible } = *stats;
            self.0.record("nodes", nodes).record("accepted_subtrees", accepted_subtrees);
            self.0.record("tests", tests).record("occluders", occluders).record("visible", visible);
        }

        /// Records the progress of a bake after a round.
        pub(crate) fn record_round(&self, progress: Progress) {
            let Progress { done, total, steps } = progress;
            self.0.record("done", done).record("total", total).record("steps", steps);
        }
    }
}

#[cfg(not(feature = "tracing"))]
mod off {
    use crate::{CullStats, bake::Progress};

    /// No span.
    pub(crate) struct Span;

    #[inline(always)]
    pub(crate) fn frame() -> Span {
        Span
    }

    #[inline(always)]
    pub(crate) fn stage(_: &str) -> Span {
        Span
    }

    #[inline(always)]
    pub(crate) fn round(_: usize) -> Span {
        Span
    }

    impl Span {
        #[inline(always)]
        pub(crate) fn within<T>(&self, work: impl FnOnce() -> T) -> T {
            work()
        }

        #[inline(always)]
        pub(crate) fn item<T>(&self, _: u32, work: impl FnOnce() -> T) -> T {
            work()
        }

        #[inline(always)]
        pub(crate) fn record_frame(&self, _: bool, _: u64) {}

        #[inline(always)]
        pub(crate) fn record_stage(&self, _: &CullStats) {}

        #[inline(always)]
        pub(crate) fn record_round(&self, _: Progress) {}
    }
}
