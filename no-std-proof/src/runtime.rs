//! Runtime that replaces the standard library and the C runtime: an entry point, an allocator, memory
//! functions and a panic handler.

use core::alloc::{GlobalAlloc, Layout};
use core::arch::{asm, global_asm};
use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicUsize, Ordering};

// The kernel leaves the stack pointer aligned differently from what the ABI requires of a function.
#[cfg(target_arch = "x86_64")]
global_asm!(".globl _start", "_start:", "and rsp, -16", "call {main}", "ud2", main = sym start);

extern "C" fn start() -> ! {
    exit(if crate::the_answer_is_right() { 0 } else { 1 })
}

/// Ends the process with an exit code, by Linux system call 60.
#[cfg(target_arch = "x86_64")]
fn exit(code: i32) -> ! {
    // SAFETY: this system call takes a number and does not return.
    unsafe { asm!("syscall", in("rax") 60, in("rdi") code, options(noreturn)) }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    exit(101)
}

/// Size of the allocator's array in bytes: 16 MiB.
const HEAP: usize = 16 << 20;

/// Allocator that takes blocks from one array and never frees any. Returns null when the array is full.
struct Bump {
    memory: UnsafeCell<[u8; HEAP]>,
    used: AtomicUsize,
}

// SAFETY: each byte is handed out once, by an atomic counter.
unsafe impl Sync for Bump {}

// SAFETY: blocks are aligned as asked, lie within the memory and do not overlap.
unsafe impl GlobalAlloc for Bump {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let base = self.memory.get() as usize;
        let mut used = self.used.load(Ordering::Relaxed);
        loop {
            let start = (base + used).next_multiple_of(layout.align()) - base;
            let Some(end) = start.checked_add(layout.size()).filter(|&end| end <= HEAP) else {
                return core::ptr::null_mut();
            };
            match self.used.compare_exchange(used, end, Ordering::Relaxed, Ordering::Relaxed) {
                // SAFETY: `start` is within the memory.
                Ok(_) => return unsafe { self.memory.get().cast::<u8>().add(start) },
                Err(now) => used = now,
            }
        }
    }

    unsafe fn dealloc(&self, _: *mut u8, _: Layout) {}
}

#[global_allocator]
static ALLOCATOR: Bump = Bump { memory: UnsafeCell::new([0; HEAP]), used: AtomicUsize::new(0) };

// The compiler calls the following functions by name. They use volatile reads or string instructions, because
// the compiler would recognize plain loops and replace them by calls of these very functions.

/// Copies `count` bytes between two regions that do not overlap, and returns `to`.
///
/// # Safety
///
/// As for C's `memcpy`: both pointers must be valid for `count` bytes.
#[unsafe(no_mangle)]
unsafe extern "C" fn memcpy(to: *mut u8, from: *const u8, count: usize) -> *mut u8 {
    // SAFETY: copies `count` bytes upwards, as the caller asks.
    unsafe { asm!("rep movsb", inout("rcx") count => _, inout("rdi") to => _, inout("rsi") from => _) }
    to
}

/// Copies `count` bytes between two regions that may overlap, and returns `to`.
///
/// # Safety
///
/// As for C's `memmove`: both pointers must be valid for `count` bytes.
#[unsafe(no_mangle)]
unsafe extern "C" fn memmove(to: *mut u8, from: *const u8, count: usize) -> *mut u8 {
    if (to as usize).wrapping_sub(from as usize) >= count {
        // SAFETY: copying upwards does not overwrite what is still to be read.
        return unsafe { memcpy(to, from, count) };
    }
    if count > 0 {
        // SAFETY: copies downwards, from the last byte on; the direction flag is restored.
        unsafe {
            let (last_to, last_from) = (to.add(count - 1), from.add(count - 1));
            asm!("std", "rep movsb", "cld", inout("rcx") count => _, inout("rdi") last_to => _, inout("rsi") last_from => _);
        }
    }
    to
}

/// Sets `count` bytes to the low byte of `value`, and returns `to`.
///
/// # Safety
///
/// As for C's `memset`: the pointer must be valid for `count` bytes.
#[unsafe(no_mangle)]
unsafe extern "C" fn memset(to: *mut u8, value: i32, count: usize) -> *mut u8 {
    // SAFETY: writes `count` bytes upwards, as the caller asks.
    unsafe { asm!("rep stosb", inout("rcx") count => _, inout("rdi") to => _, in("al") value as u8) }
    to
}

/// Compares `count` bytes: negative, zero or positive as `a` is less than, equal to or greater than `b`.
///
/// # Safety
///
/// As for C's `memcmp`: both pointers must be valid for `count` bytes.
#[unsafe(no_mangle)]
unsafe extern "C" fn memcmp(a: *const u8, b: *const u8, count: usize) -> i32 {
    for i in 0..count {
        // SAFETY: the caller grants `count` bytes behind both pointers.
        let (a, b) = unsafe { (a.add(i).read_volatile(), b.add(i).read_volatile()) };
        if a != b {
            return i32::from(a) - i32::from(b);
        }
    }
    0
}

/// Compares `count` bytes; zero if and only if they are equal.
///
/// # Safety
///
/// As for C's `bcmp`: both pointers must be valid for `count` bytes.
#[unsafe(no_mangle)]
unsafe extern "C" fn bcmp(a: *const u8, b: *const u8, count: usize) -> i32 {
    // SAFETY: as the caller grants.
    unsafe { memcmp(a, b, count) }
}

// The prebuilt `alloc` refers to these two functions, but nothing unwinds here.
#[unsafe(no_mangle)]
extern "C" fn rust_eh_personality() {}

#[unsafe(no_mangle)]
extern "C" fn _Unwind_Resume() -> ! {
    exit(102)
}
