//! Measurement of the processor time of methods.

use std::time::Instant;

/// Runs a function, and returns its result and the seconds that it took.
pub(super) fn timed<T>(run: impl FnOnce() -> T) -> (T, f64) {
    let (clock, processor) = (Instant::now(), processor_seconds());
    let result = run();
    let seconds = match (processor, processor_seconds()) {
        (Some(before), Some(after)) => after - before,
        _ => clock.elapsed().as_secs_f64(),
    };
    (result, seconds)
}

/// Returns the processor time of this thread so far, in seconds. `None` if the operating system does not
/// provide it.
fn processor_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(text.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9)
}
