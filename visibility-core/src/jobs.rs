//! The engine's own job system, on whose threads one view is culled.
//!
//! A frame is split into a fixed number of parts, which does not depend on the number of threads. Each part
//! writes only memory of its own, and parts are joined in a fixed order. So the answer is the same bit for
//! bit with any job system, on any number of threads.

#[cfg(target_has_atomic = "ptr")]
use atomic_refcell::AtomicRefCell;

/// A job system: something that calls a function several times, on several threads if it has them.
///
/// An engine implements the trait over its own threads and passes it to
/// [`Pipeline::cull_on`](crate::Pipeline::cull_on), which has an example. [`OneThread`] is the plainest
/// implementation, and `RayonJobs` (feature `rayon`) uses the current pool of `rayon`. A frame calls
/// [`run`](Self::run) once or twice for each culler, with up to 16 jobs of some microseconds each.
pub trait Jobs {
    /// Calls `job` once with each number below `count`, in any order and on any threads, and returns when all
    /// calls have ended. Jobs never wait for each other. If an implementation leaves a number out, the culler
    /// that called `run` does that job itself afterwards. If it calls `job` twice with a number, the second
    /// call does nothing.
    fn run(&self, count: usize, job: &(dyn Fn(usize) + Sync));
}

/// A job system without threads: jobs run one after the other on the calling thread.
///
/// ```
/// use visibility_core::jobs::{Jobs, OneThread};
/// let done = std::sync::Mutex::new(Vec::new());
/// OneThread.run(3, &|index| done.lock().unwrap().push(index));
/// assert_eq!(done.into_inner().unwrap(), [0, 1, 2]);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct OneThread;

impl Jobs for OneThread {
    fn run(&self, count: usize, job: &(dyn Fn(usize) + Sync)) {
        (0..count).for_each(job);
    }
}

/// The current thread pool of `rayon`. A call from outside of a pool wakes its threads and waits, which takes
/// some 10 microseconds; a call within [`rayon::ThreadPool::install`] does not.
///
/// ```
/// use std::sync::atomic::{AtomicUsize, Ordering};
/// use visibility_core::jobs::{Jobs, RayonJobs};
/// let sum = AtomicUsize::new(0);
/// RayonJobs.run(4, &|index| {
///     sum.fetch_add(index, Ordering::Relaxed);
/// });
/// assert_eq!(sum.into_inner(), 6);
/// ```
#[cfg(feature = "rayon")]
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct RayonJobs;

#[cfg(feature = "rayon")]
impl Jobs for RayonJobs {
    fn run(&self, count: usize, job: &(dyn Fn(usize) + Sync)) {
        use rayon::prelude::*;
        (0..count).into_par_iter().for_each(job);
    }
}

/// Calls `work` once with each of the parts, on the threads of a job system: for maps and cullers that split
/// their own work. Allocates nothing, and takes one atomic exchange a part.
///
/// ```
/// use visibility_core::jobs::{OneThread, for_each_part};
/// let mut squares = [1, 2, 3, 4];
/// let (first, second) = squares.split_at_mut(2);
/// for_each_part(&OneThread, [first, second], |part| part.iter_mut().for_each(|x| *x *= *x));
/// assert_eq!(squares, [1, 4, 9, 16]);
/// ```
pub fn for_each_part<T: Send + Sync, const COUNT: usize>(
    jobs: &dyn Jobs,
    parts: [T; COUNT],
    work: impl Fn(T) + Sync,
) {
    #[cfg(target_has_atomic = "ptr")]
    {
        let parts = parts.map(|part| AtomicRefCell::new(Some(part)));
        // Only the first call for a part takes the part. Its cell is borrowed only while the part is taken.
        let run = |index: usize| {
            let part = parts.get(index).and_then(|cell| cell.try_borrow_mut().ok()?.take());
            part.into_iter().for_each(&work);
        };
        jobs.run(COUNT, &run);
        (0..COUNT).for_each(run);
    }
    #[cfg(not(target_has_atomic = "ptr"))]
    {
        let _ = jobs;
        parts.into_iter().for_each(work);
    }
}
