//! Spans of the crate `tracing` around the stages of viewcells. Without the feature `tracing`, every call
//! here compiles to the call of its closure.

#[cfg(not(feature = "tracing"))]
pub(crate) use off::stage;
#[cfg(feature = "tracing")]
pub(crate) use on::stage;

#[cfg(feature = "tracing")]
mod on {
    use crate::found_cell::FoundCell;
    use crate::level_error::LevelError;
    use tracing::{debug_span, field::Empty};

    /// Names of the stages of a viewcell, in their order.
    const STAGES: [&str; crate::time_plan::STAGES] = ["group sweep", "sweep", "rays", "boxes", "triangles"];

    /// Calls `work`, which does one stage of a viewcell, within a span. Records the viewcell's counts so far:
    /// objects swept, seen, proven hidden and open, and the work of its searches. Records none if the stage
    /// was not done.
    pub(crate) fn stage(
        viewcell: usize,
        stage: u32,
        work: impl FnOnce() -> Result<Option<Option<FoundCell>>, LevelError>,
    ) -> Result<Option<Option<FoundCell>>, LevelError> {
        let name = STAGES.get(stage as usize).copied().unwrap_or_default();
        let span = debug_span!(
            target: "visibility", "viewcell", viewcell, stage = name, swept = Empty, seen = Empty,
            proven = Empty, open = Empty, steps = Empty
        );
        let found = span.in_scope(work);
        if let Ok(Some(Some(found))) = &found {
            let cell = &found.sandwich;
            span.record("swept", cell.swept).record("proven", cell.proven).record("steps", cell.steps);
            span.record("seen", cell.seen.len()).record("open", cell.open.len());
        }
        found
    }
}

#[cfg(not(feature = "tracing"))]
mod off {
    #[inline(always)]
    pub(crate) fn stage<T>(_: usize, _: u32, work: impl FnOnce() -> T) -> T {
        work()
    }
}
