//! Job systems for tests: which thread runs a job, and when, must not matter.

use visibility_core::jobs::Jobs;

/// Job system of several threads: job `i` runs on thread `i % threads`.
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

/// Job system of one thread that runs the jobs from last to first.
pub struct Reversed;

impl Jobs for Reversed {
    fn run(&self, count: usize, job: &(dyn Fn(usize) + Sync)) {
        (0..count).rev().for_each(job);
    }
}

/// Faulty job system, which skips every third job and runs every second one twice.
pub struct Careless;

impl Jobs for Careless {
    fn run(&self, count: usize, job: &(dyn Fn(usize) + Sync)) {
        (0..count)
            .filter(|index| index % 3 != 0)
            .chain((0..count).filter(|index| index % 2 != 0))
            .for_each(job);
    }
}

/// Calls `check` with each of several job systems and its name.
pub fn for_each_job_system(mut check: impl FnMut(&str, &dyn Jobs)) {
    for threads in [1, 2, 3, 8] {
        check(&format!("{threads} threads"), &Threads(threads));
    }
    check("jobs from last to first", &Reversed);
    check("a faulty job system", &Careless);
}
