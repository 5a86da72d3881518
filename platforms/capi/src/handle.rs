//! Value behind an opaque handle, with a lock that refuses conflicting calls.

use crate::error::{Error, vis_status::*};
use std::sync::{RwLock, RwLockReadGuard, RwLockWriteGuard, TryLockError};

/// Value that any number of calls may read at once, or one call may change. A conflicting call does not wait
/// but fails with `VIS_ERROR_BUSY`, because a frame that waits for another thread is a mistake in the
/// caller's schedule.
#[derive(Debug)]
pub(crate) struct Guarded<T>(RwLock<T>);

impl<T> Guarded<T> {
    pub(crate) fn new(value: T) -> Self {
        Self(RwLock::new(value))
    }

    pub(crate) fn read(&self) -> Result<RwLockReadGuard<'_, T>, Error> {
        self.0.try_read().map_err(|error| refused(&error))
    }

    pub(crate) fn write(&self) -> Result<RwLockWriteGuard<'_, T>, Error> {
        self.0.try_write().map_err(|error| refused(&error))
    }
}

fn refused<G>(error: &TryLockError<G>) -> Error {
    match error {
        TryLockError::WouldBlock => Error::new(VIS_ERROR_BUSY, "another thread is using this handle"),
        TryLockError::Poisoned(_) => {
            Error::new(VIS_ERROR_PANIC, "an earlier call with this handle failed inside: destroy the handle")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::border;

    #[test]
    fn what_a_panic_left_half_changed_is_refused() {
        let guarded = Guarded::new(1);
        let status = border(|| {
            let _half = guarded.write()?;
            panic!("planted fault")
        });
        assert_eq!(status, VIS_ERROR_PANIC, "the status of a panic");
        assert_eq!(
            guarded.read().expect_err("poisoned").status,
            VIS_ERROR_PANIC,
            "reading what a panic left"
        );
        assert_eq!(
            guarded.write().expect_err("poisoned").status,
            VIS_ERROR_PANIC,
            "writing what a panic left"
        );
    }

    #[test]
    fn readers_share_and_writers_exclude() {
        let guarded = Guarded::new(1);
        let reading = guarded.read().expect("nobody writes");
        assert_eq!(*guarded.read().expect("readers share"), 1, "the value, read twice at once");
        assert_eq!(guarded.write().expect_err("is read").status, VIS_ERROR_BUSY, "writing while it is read");
        drop(reading);
        let _writing = guarded.write().expect("nobody reads");
        assert_eq!(
            guarded.read().expect_err("is written").status,
            VIS_ERROR_BUSY,
            "reading while it is written"
        );
        assert_eq!(
            guarded.write().expect_err("is written").status,
            VIS_ERROR_BUSY,
            "writing while it is written"
        );
    }
}
