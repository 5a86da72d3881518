//! Helpers of the C interface's tests: handles, and assertions that show the library's own message.

use std::ffi::CStr;
use std::ptr::null_mut;
use visibility::vis_status::*;
use visibility::*;

/// Returns the message of the last error of this thread.
pub(crate) fn message() -> String {
    // SAFETY: the message ends with a zero byte, and no other call of this thread fails meanwhile.
    unsafe { CStr::from_ptr(vis_last_error()) }.to_str().expect("UTF-8").to_owned()
}

/// Asserts that a call has succeeded.
#[track_caller]
pub(crate) fn ok(status: vis_status) {
    returns(status, VIS_OK);
}

/// Asserts that a call has returned the expected status.
#[track_caller]
pub(crate) fn returns(status: vis_status, expected: vis_status) {
    assert_eq!(status, expected, "the last error of this thread is: {}", message());
}

/// Creates a handle with a function that has no other argument.
pub(crate) fn make<T>(create: unsafe extern "C" fn(*mut *mut T) -> vis_status) -> *mut T {
    let mut handle = null_mut();
    // SAFETY: `handle` is memory for the result.
    ok(unsafe { create(&raw mut handle) });
    handle
}
