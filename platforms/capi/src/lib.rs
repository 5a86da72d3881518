//! The C library of the `visibility` crates, declared in `include/visibility.h`. The header states the rules
//! for callers; the README shows a program.
//!
//! # Safety
//! Every function that takes a pointer relies on the rules P1 to P3 of the header: a pointer is null, or
//! points to a value of its type, or to as many values as the function's description says. During the call,
//! the values are not moved and not changed (memory for results: not used) by anyone else. A handle was made
//! by this library and is not destroyed. The library checks what it can: null, alignment, sizes, enumerators,
//! ids, and two threads that use one handle in ways that exclude each other. All code that dereferences a
//! pointer is in [`pointer`].
//!
//! Every function runs its body in [`error::border`], which turns errors into codes and stops panics. Handles
//! are behind the locks of [`handle`].

mod contribution;
mod draw_list;
#[macro_use]
mod error;
mod handle;
mod lods;
mod moves;
mod numbers;
mod object_data;
mod occluders;
mod pipeline;
mod pointer;
mod scene;
mod stats;
mod view;
mod visible;
#[cfg(feature = "whole")]
mod whole;

pub use draw_list::*;
pub use error::*;
pub use lods::*;
pub use moves::*;
pub use occluders::*;
pub use pipeline::*;
pub use scene::*;
pub use stats::*;
pub use view::*;
pub use visible::*;
#[cfg(feature = "whole")]
pub use whole::*;

/// The header allows any thread to use any handle, so compilation fails if a handle's type is not `Send` and
/// `Sync`.
const _: () = {
    const fn any_thread<T: Send + Sync>() {}
    any_thread::<vis_draw_list>();
    any_thread::<vis_lods>();
    any_thread::<vis_pipeline>();
    any_thread::<vis_scene>();
    any_thread::<vis_view>();
    any_thread::<vis_visible>();
};

/// Version of the interface. It increases when a change breaks programs that were compiled before.
pub const VIS_ABI_VERSION: u32 = 1;

/// Returns the `VIS_ABI_VERSION` that the library was built with, for comparison by programs that load the
/// library at run time.
#[unsafe(no_mangle)]
pub extern "C" fn vis_abi_version() -> u32 {
    VIS_ABI_VERSION
}
