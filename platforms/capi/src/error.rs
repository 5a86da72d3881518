//! Status codes, the message of the last error, and the wrapper that stops panics.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};
use visibility_core::occlusion::MeshError;
use visibility_core::scene::SceneError;
use visibility_core::view::ViewError;
use visibility_core::visible_set::BitsError;
use visibility_hzb::SizeError;

/// Result of a call. Everything but `VIS_OK` is an error. A failed call has changed nothing, unless its
/// description says otherwise, and `vis_last_error` tells what was wrong with what.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum vis_status {
    /// The call succeeded.
    VIS_OK = 0,
    /// A pointer is null but must not be.
    VIS_ERROR_NULL = 1,
    /// An argument is invalid: a matrix that is not finite, an unknown enumerator, a size out of range, a
    /// misaligned pointer.
    VIS_ERROR_ARGUMENT = 2,
    /// An object, mesh, cell, portal, wall or mover does not exist: it was removed, or belongs to another
    /// scene.
    VIS_ERROR_UNKNOWN_ID = 3,
    /// A buffer is too short. The required length was written.
    VIS_ERROR_TOO_SHORT = 4,
    /// The content of a file or buffer is damaged, or has another format.
    VIS_ERROR_FORMAT = 5,
    /// Another call is needed first: give the view a camera, cull before asking for results, set local bounds
    /// before a transform.
    VIS_ERROR_STATE = 6,
    /// Another thread is using the handle in a way that excludes this call. Nothing was done.
    VIS_ERROR_BUSY = 7,
    /// A fault inside the library. Handles that the call was changing return this status from now on, and can
    /// only be destroyed.
    VIS_ERROR_PANIC = 8,
}

use vis_status::*;

/// Error of a call, with its status code and message.
#[derive(Debug)]
pub(crate) struct Error {
    pub(crate) status: vis_status,
    message: String,
}

impl Error {
    pub(crate) fn new(status: vis_status, message: impl Display) -> Self {
        Self { status, message: message.to_string() }
    }

    pub(crate) fn argument(message: impl Display) -> Self {
        Self::new(VIS_ERROR_ARGUMENT, message)
    }

    fn panicked(panic: &(dyn Any + Send)) -> Self {
        let text = panic.downcast_ref::<&str>().copied();
        let text = text.or(panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message");
        Self::new(VIS_ERROR_PANIC, format_args!("fault inside the library: {text}"))
    }
}

/// Implements conversions from errors of the Rust crates, each to its status code.
macro_rules! codes {
    ($($error:ty, $parameter:pat => $status:expr;)*) => {$(
        impl From<$error> for Error {
            fn from(error: $error) -> Self {
                let $parameter = &error;
                Self::new($status, &error)
            }
        }
    )*};
}

codes! {
    ViewError, _ => VIS_ERROR_ARGUMENT;
    MeshError, _ => VIS_ERROR_ARGUMENT;
    SizeError, _ => VIS_ERROR_ARGUMENT;
    SceneError, kind => match kind {
        SceneError::UnknownObject(_) | SceneError::UnknownMesh(_) => VIS_ERROR_UNKNOWN_ID,
        SceneError::NoLocalBounds(_) => VIS_ERROR_STATE,
        _ => VIS_ERROR_ARGUMENT,
    };
    BitsError, _ => VIS_ERROR_TOO_SHORT;
}

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// Runs the body of a function called from C. Stops panics, and turns errors into status codes.
///
/// After a panic, values that the body was changing may be inconsistent. They are behind the locks of
/// `handle`, which then refuse access, so asserting unwind safety is sound.
pub(crate) fn border(body: impl FnOnce() -> Result<(), Error>) -> vis_status {
    let outcome = catch_unwind(AssertUnwindSafe(body)).unwrap_or_else(|panic| Err(Error::panicked(&*panic)));
    let Err(error) = outcome else { return VIS_OK };
    let message = CString::new(error.message.replace('\0', " ")).unwrap_or_default();
    // A thread that is ending can no longer store a message; the status code is still returned.
    let _ = LAST.try_with(|last| last.replace(message));
    error.status
}

/// Returns the message of the last call that failed on this thread, in English, UTF-8, ending with a zero
/// byte; the empty text if none has failed. Successful calls leave it as it is. The pointer is valid until
/// the next call that fails on this thread; never free it.
#[unsafe(no_mangle)]
pub extern "C" fn vis_last_error() -> *const c_char {
    LAST.try_with(|last| last.borrow().as_ptr()).unwrap_or(c"".as_ptr())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::CStr;

    fn last() -> String {
        // SAFETY: the message ends with a zero byte and no other call of this thread fails meanwhile.
        unsafe { CStr::from_ptr(vis_last_error()) }.to_string_lossy().into_owned()
    }

    #[test]
    fn panics_end_at_the_border() {
        assert_eq!(border(|| panic!("planted\0fault")), VIS_ERROR_PANIC, "the status of a panic");
        assert_eq!(last(), "fault inside the library: planted fault", "the message of a panic");
        assert_eq!(border(|| Ok(())), VIS_OK, "a call that succeeds");
        assert!(last().starts_with("fault"), "successful calls leave the message");
    }

    #[test]
    fn messages_are_of_the_thread() {
        assert_eq!(border(|| Err(Error::argument("ours"))), VIS_ERROR_ARGUMENT, "a call that is refused");
        std::thread::spawn(|| assert_eq!(last(), "", "another thread has no message")).join().unwrap();
        assert_eq!(last(), "ours", "the message of this thread");
    }
}
