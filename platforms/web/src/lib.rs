//! C library of the `visibility` crates as a WebAssembly module: the functions of
//! `platforms/capi/include/visibility.h`, and memory for their arguments. `package/visibility.js` wraps them.

pub use visibility::*;

use std::alloc::{Layout, alloc, dealloc};

/// Sizes in bytes that `package/visibility.js` relies on. Compilation fails if a structure of the header
/// changes.
const _: () = {
    assert!(
        size_of::<vis_box>() == 24 && size_of::<vis_object_desc>() == 36,
        "sizes in bytes of the header's structures"
    );
    assert!(
        size_of::<vis_pose>() == 72 && size_of::<vis_stats>() == 40,
        "sizes in bytes of the header's structures"
    );
    assert!(
        size_of::<vis_lod>() == 24
            && size_of::<vis_draw_group>() == 12
            && size_of::<vis_draw_command>() == 20,
        "sizes in bytes of the header's structures"
    );
};

/// As above, of what only the whole module has.
#[cfg(feature = "whole")]
const _: () = {
    assert!(
        size_of::<vis_portal>() == 16 && size_of::<vis_volume>() == 56,
        "sizes in bytes of the header's structures"
    );
    assert!(
        size_of::<vis_comparison>() == 16 && size_of::<vis_online_work>() == 48,
        "sizes in bytes of the header's structures"
    );
    assert!(
        size_of::<vis_wall>() == 40 && size_of::<vis_reach>() == 56 && size_of::<vis_wall_hit>() == 24,
        "sizes in bytes of the header's structures"
    );
    assert!(size_of::<vis_reflection>() == 12, "sizes in bytes of the header's structures");
    assert!(
        size_of::<vis_light>() == 72 && size_of::<vis_ray_hit>() == 16,
        "sizes in bytes of the header's structures"
    );
};

/// Alignment of memory for arguments in bytes, which suits every type of the header.
const ALIGNMENT: usize = 8;

/// Returns memory of `size` bytes, aligned for every type of the header. Null if `size` is 0 or memory is
/// exhausted.
#[unsafe(no_mangle)]
pub extern "C" fn vis_alloc(size: usize) -> *mut u8 {
    match Layout::from_size_align(size, ALIGNMENT) {
        // SAFETY: the size of the layout is not 0.
        Ok(layout) if size > 0 => unsafe { alloc(layout) },
        _ => std::ptr::null_mut(),
    }
}

/// Frees memory allocated by [`vis_alloc`]. Does nothing for a null pointer.
///
/// # Safety
/// The pointer is null, or was returned by `vis_alloc(size)` and has not been freed since.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_free(memory: *mut u8, size: usize) {
    if let (false, Ok(layout)) = (memory.is_null(), Layout::from_size_align(size, ALIGNMENT)) {
        // SAFETY: the caller's promise.
        unsafe { dealloc(memory, layout) }
    }
}
