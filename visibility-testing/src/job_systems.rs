//! Job systems for tests: what runs which job, and when, must not matter.

use visibility_core::jobs::Jobs;

/// Threads that share the jobs: job `i` runs on thread `i % threads`.
pub struct Threads(pub usize);

impl Jobs for Threads {
    fn run(&self, count: usize, job: &(dyn Fn(usize) + Sync)) {
        std::thread::scope(|scope| {
            for first in 0..self.0 {
                scope.spawn(move || (first..count).step_by(self.0).for_each(job));
            }
        });
    }
}

/// One thread that runs the jobs from last to first.
pub struct Reversed;

impl Jobs for Reversed {
    fn run(&self, count: usize, job: &(dyn Fn(usize) + Sync)) {
        (0..count).rev().for_each(job);
    }
}

/// A faulty job system, which leaves out every third job, and runs every second one twice.
pub struct Careless;

impl Jobs for Careless {
    fn run(&self, count: usize, job: &(dyn Fn(usize) + Sync)) {
        (0..count)
            .filter(|index| index % 3 != 0)
            .chain((0..count).filter(|index| index % 2 != 0))
            .for_each(job);
    }
}

/// Calls `check` with the name of each of several job systems and the system.
pub fn for_each_job_system(mut check: impl FnMut(&str, &dyn Jobs)) {
    for threads in [1, 2, 3, 8] {
        check(&format!("{threads} threads"), &Threads(threads));
    }
    check("jobs from last to first", &Reversed);
    check("a faulty job system", &Careless);
}
