//! Conversion of pointers from C into references, slices and places for results. All code that dereferences
//! such pointers is here.

use crate::error::{Error, vis_status::*};
use std::marker::PhantomData;
use std::ptr::NonNull;

/// Returns the pointer if it is neither null nor misaligned. `name` is the name of the parameter, for the
/// message.
fn checked<T>(pointer: *const T, name: &str) -> Result<NonNull<T>, Error> {
    let null = || Error::new(VIS_ERROR_NULL, format_args!("the pointer `{name}` is null"));
    let pointer = NonNull::new(pointer.cast_mut()).ok_or_else(null)?;
    if pointer.is_aligned() {
        Ok(pointer)
    } else {
        Err(Error::argument(format_args!("the pointer `{name}` is not aligned")))
    }
}

/// Returns an error if `count` elements would exceed the size of any object in memory. A negative number in C
/// becomes such a count.
fn check_count<T>(count: usize, name: &str) -> Result<(), Error> {
    match count.checked_mul(size_of::<T>()) {
        Some(bytes) if bytes <= isize::MAX as usize => Ok(()),
        _ => Err(Error::argument(format_args!("{count} elements of `{name}` are more than memory holds"))),
    }
}

/// Borrows the value that a pointer points to.
///
/// # Safety
/// The pointer is null, or points to a valid `T` that nobody changes or frees during `'a`.
pub(crate) unsafe fn reference<'a, T>(pointer: *const T, name: &str) -> Result<&'a T, Error> {
    let pointer = checked(pointer, name)?;
    // SAFETY: the pointer is not null and is aligned; the caller promises the rest.
    Ok(unsafe { pointer.as_ref() })
}

/// Borrows an array. A null pointer with `count` 0 is an empty array.
///
/// # Safety
/// The pointer is null, or points to `count` valid elements that nobody changes or frees during `'a`.
pub(crate) unsafe fn array<'a, T>(pointer: *const T, count: usize, name: &str) -> Result<&'a [T], Error> {
    if count == 0 {
        return Ok(&[]);
    }
    let pointer = checked(pointer, name)?;
    check_count::<T>(count, name)?;
    // SAFETY: the pointer is not null, is aligned, and the size passes `check_count`; the caller promises the
    // rest.
    Ok(unsafe { std::slice::from_raw_parts(pointer.as_ptr(), count) })
}

/// Memory for one result, which may be uninitialised.
pub(crate) struct Out<'a, T>(NonNull<T>, PhantomData<&'a mut T>);

impl<T: Copy> Out<'_, T> {
    pub(crate) fn set(&mut self, value: T) {
        // SAFETY: `out` has checked the pointer, and its caller promised that the memory may be written.
        unsafe { self.0.write(value) }
    }
}

/// Checks the pointer to the memory for one result.
///
/// # Safety
/// The pointer is null, or points to memory for a `T` that nobody else uses during `'a`.
pub(crate) unsafe fn out<'a, T: Copy>(pointer: *mut T, name: &str) -> Result<Out<'a, T>, Error> {
    Ok(Out(checked(pointer, name)?, PhantomData))
}

/// Checks the pointer to the memory for one optional result. `None` for a null pointer.
///
/// # Safety
/// The same as for [`out`].
pub(crate) unsafe fn optional_out<'a, T: Copy>(
    pointer: *mut T,
    name: &str,
) -> Result<Option<Out<'a, T>>, Error> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller of this function makes the same promise.
    unsafe { out(pointer, name) }.map(Some)
}

/// Memory for an array of results, which may be uninitialised, and for their number.
pub(crate) struct Buffer<'a, T> {
    /// First element of the caller's array. `None` if the caller only asks for the number of results.
    start: Option<NonNull<T>>,
    capacity: usize,
    count: Out<'a, usize>,
}

impl<'a, T: Copy> Buffer<'a, T> {
    /// Writes the number of results. Returns the start of the array if all results fit, `None` if the caller
    /// only asked for the number. An error if the array is too short.
    fn room(mut self, count: usize) -> Result<Option<NonNull<T>>, Error> {
        self.count.set(count);
        if self.start.is_some() && self.capacity < count {
            let message = format_args!("a buffer of {} elements is too short for {count}", self.capacity);
            return Err(Error::new(VIS_ERROR_TOO_SHORT, message));
        }
        Ok(self.start)
    }

    /// Writes the number of results, and the results if the buffer has room for all of them. `items` yields
    /// `count` results.
    ///
    /// # Errors
    /// `VIS_ERROR_TOO_SHORT` if the results do not fit; the buffer is then unchanged.
    pub(crate) fn fill(self, count: usize, items: impl Iterator<Item = T>) -> Result<(), Error> {
        let Some(start) = self.room(count)? else { return Ok(()) };
        for (place, item) in items.take(count).enumerate() {
            // SAFETY: `place` is below `count`, so below `capacity`. The caller of `buffer` promised memory
            // for `capacity` elements.
            unsafe { start.add(place).write(item) }
        }
        Ok(())
    }
}

#[cfg(feature = "whole")]
impl<T: Copy> Buffer<'_, T> {
    /// Writes the number of results. Makes and writes the results if the buffer has room for all of them:
    /// `make` returns `count` results. The buffer is unchanged until `make` has returned.
    ///
    /// # Errors
    /// `VIS_ERROR_TOO_SHORT` if the results do not fit; they are then not made.
    pub(crate) fn fill_with(self, count: usize, make: impl FnOnce() -> Vec<T>) -> Result<(), Error> {
        let Some(start) = self.room(count)? else { return Ok(()) };
        for (place, item) in make().into_iter().take(count).enumerate() {
            // SAFETY: as in `fill`.
            unsafe { start.add(place).write(item) }
        }
        Ok(())
    }
}

/// Checks a buffer for results. A null pointer only asks for the number of results.
///
/// # Safety
/// Each pointer is null, or points to memory that nobody else uses during `'a`: for `capacity` elements, and
/// for one `count`.
pub(crate) unsafe fn buffer<'a, T: Copy>(
    start: *mut T,
    capacity: usize,
    count: *mut usize,
) -> Result<Buffer<'a, T>, Error> {
    check_count::<T>(capacity, "capacity")?;
    let start = if start.is_null() { None } else { Some(checked(start, "buffer")?) };
    // SAFETY: the caller of this function makes the same promise for `count`.
    Ok(Buffer { start, capacity, count: unsafe { out(count, "count") }? })
}

impl Buffer<'_, std::ffi::c_char> {
    /// Writes a text followed by a zero byte. The number of results is that of the bytes, the zero byte
    /// included.
    pub(crate) fn text(self, text: &str) -> Result<(), Error> {
        self.fill(text.len() + 1, text.bytes().chain([0]).map(|byte| byte as std::ffi::c_char))
    }
}

impl<'a> Buffer<'a, u32> {
    /// Writes the number of words. Returns the words, all set to zero, or `None` if the caller only asks for
    /// the number.
    pub(crate) fn words(self, count: usize) -> Result<Option<&'a mut [u32]>, Error> {
        let Some(start) = self.room(count)? else { return Ok(None) };
        // SAFETY: the caller of `buffer` promised memory for `capacity` words, which is at least `count`,
        // that nobody else uses. They are initialised before the slice is made.
        Ok(Some(unsafe {
            start.write_bytes(0, count);
            std::slice::from_raw_parts_mut(start.as_ptr(), count)
        }))
    }
}

/// Stores a value behind a new handle.
pub(crate) fn create<T>(mut handle: Out<'_, *mut T>, value: T) {
    handle.set(Box::into_raw(Box::new(value)));
}

/// Drops the value behind a handle. Does nothing for a null pointer.
///
/// # Safety
/// The pointer is null, or [`create`] made it, and nobody uses it any more.
pub(crate) unsafe fn destroy<T>(handle: *mut T) {
    // Panics while dropping are stopped too, but cannot be reported, because a destructor returns no status.
    let _ = crate::error::border(|| {
        if !handle.is_null() {
            // SAFETY: `create` made the pointer from a box, and the caller does not use it again.
            drop(unsafe { Box::from_raw(handle) });
        }
        Ok(())
    });
}

#[cfg(all(test, feature = "whole"))]
mod tests {
    use super::*;
    use crate::error::border;

    #[test]
    fn a_panic_amid_the_results_leaves_the_buffer_as_it_was() {
        let mut words = [7_u32; 3];
        let mut count = 0;
        let mut fill = |capacity, make: fn() -> Vec<u32>| {
            // SAFETY: both pointers are to memory of this test, and `capacity` is at most 3.
            border(|| unsafe { buffer(words.as_mut_ptr(), capacity, &raw mut count) }?.fill_with(3, make))
        };
        assert_eq!(fill(3, || panic!("planted")), VIS_ERROR_PANIC, "a panic");
        assert_eq!(
            fill(2, || panic!("not asked")),
            VIS_ERROR_TOO_SHORT,
            "results that do not fit are not made"
        );
        assert_eq!(words, [7; 3], "the buffer after calls that failed");
        let mut fill = |make: fn() -> Vec<u32>| {
            // SAFETY: both pointers are to memory of this test.
            border(|| unsafe { buffer(words.as_mut_ptr(), 3, &raw mut count) }?.fill_with(3, make))
        };
        assert_eq!(fill(|| vec![1, 2, 3]), VIS_OK, "results that fit");
        assert_eq!((words, count), ([1, 2, 3], 3), "the results and their number");
    }
}
