//! Pointers that C passes, turned into references, slices and places to write to. All but the functions
//! themselves that dereference such a pointer is here.

use crate::error::{Error, vis_status::*};
use std::marker::PhantomData;
use std::ptr::NonNull;

/// Returns the pointer if it is neither null nor misaligned. `name` is the parameter's, for the message.
fn checked<T>(pointer: *const T, name: &str) -> Result<NonNull<T>, Error> {
    let null = || Error::new(VIS_ERROR_NULL, format_args!("the pointer `{name}` is null"));
    let pointer = NonNull::new(pointer.cast_mut()).ok_or_else(null)?;
    if pointer.is_aligned() {
        Ok(pointer)
    } else {
        Err(Error::argument(format_args!("the pointer `{name}` is not aligned")))
    }
}

/// Refuses a count of elements whose bytes no object in memory has: a negative number in disguise.
fn check_count<T>(count: usize, name: &str) -> Result<(), Error> {
    match count.checked_mul(size_of::<T>()) {
        Some(bytes) if bytes <= isize::MAX as usize => Ok(()),
        _ => Err(Error::argument(format_args!("{count} elements of `{name}` are more than memory holds"))),
    }
}

/// Borrows what a pointer points to.
///
/// # Safety
/// The pointer is null, or points to a valid `T` that nobody changes or frees for as long as `'a`.
pub(crate) unsafe fn reference<'a, T>(pointer: *const T, name: &str) -> Result<&'a T, Error> {
    let pointer = checked(pointer, name)?;
    // SAFETY: not null and aligned, and the rest is the caller's promise.
    Ok(unsafe { pointer.as_ref() })
}

/// Borrows an array; a null pointer is the empty array if `count` is 0.
///
/// # Safety
/// The pointer is null, or points to `count` valid elements that nobody changes or frees for as long as `'a`.
pub(crate) unsafe fn array<'a, T>(pointer: *const T, count: usize, name: &str) -> Result<&'a [T], Error> {
    if count == 0 {
        return Ok(&[]);
    }
    let pointer = checked(pointer, name)?;
    check_count::<T>(count, name)?;
    // SAFETY: not null, aligned and of a size that `check_count` accepts; the rest is the caller's promise.
    Ok(unsafe { std::slice::from_raw_parts(pointer.as_ptr(), count) })
}

/// A place for one result, not necessarily initialised.
pub(crate) struct Out<'a, T>(NonNull<T>, PhantomData<&'a mut T>);

impl<T: Copy> Out<'_, T> {
    pub(crate) fn set(&mut self, value: T) {
        // SAFETY: `out` has checked the pointer, and its caller promised that writing to it is sound.
        unsafe { self.0.write(value) }
    }
}

/// Checks the pointer to a place for one result.
///
/// # Safety
/// The pointer is null, or nobody else uses the memory for a `T` that it points to for as long as `'a`.
pub(crate) unsafe fn out<'a, T: Copy>(pointer: *mut T, name: &str) -> Result<Out<'a, T>, Error> {
    Ok(Out(checked(pointer, name)?, PhantomData))
}

/// Checks the pointer to a place for one result that the caller may not want.
///
/// # Safety
/// That of [`out`].
pub(crate) unsafe fn optional_out<'a, T: Copy>(
    pointer: *mut T,
    name: &str,
) -> Result<Option<Out<'a, T>>, Error> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller's promise.
    unsafe { out(pointer, name) }.map(Some)
}

/// A buffer for results, not necessarily initialised, and the place for their number.
pub(crate) struct Buffer<'a, T> {
    /// First element of the caller's array; `None` if the caller asks for the number of results alone.
    start: Option<NonNull<T>>,
    capacity: usize,
    count: Out<'a, usize>,
}

impl<'a, T: Copy> Buffer<'a, T> {
    /// Writes the number of results. Returns the buffer if it has room for them, `None` if there is none.
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
    /// `VIS_ERROR_TOO_SHORT` if the buffer has not; the buffer is unchanged then.
    pub(crate) fn fill(self, count: usize, items: impl Iterator<Item = T>) -> Result<(), Error> {
        let Some(start) = self.room(count)? else { return Ok(()) };
        for (place, item) in items.take(count).enumerate() {
            // SAFETY: `place` is below `count`, so below `capacity`, for which the caller of `buffer`
            // promised memory.
            unsafe { start.add(place).write(item) }
        }
        Ok(())
    }
}

/// Checks a buffer for results. A null pointer asks for the number of results alone.
///
/// # Safety
/// Each pointer is null, or nobody else uses the memory that it points to for as long as `'a`: `capacity`
/// elements, and one `count`.
pub(crate) unsafe fn buffer<'a, T: Copy>(
    start: *mut T,
    capacity: usize,
    count: *mut usize,
) -> Result<Buffer<'a, T>, Error> {
    check_count::<T>(capacity, "capacity")?;
    let start = if start.is_null() { None } else { Some(checked(start, "buffer")?) };
    // SAFETY: the caller's promise.
    Ok(Buffer { start, capacity, count: unsafe { out(count, "count") }? })
}

impl Buffer<'_, std::ffi::c_char> {
    /// Writes a text and a zero byte; the number is that of the bytes, the zero byte included.
    pub(crate) fn text(self, text: &str) -> Result<(), Error> {
        self.fill(text.len() + 1, text.bytes().chain([0]).map(|byte| byte as std::ffi::c_char))
    }
}

impl<'a> Buffer<'a, u32> {
    /// Writes the number of words, and returns the words, all zero, if the caller wants them.
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

/// Drops what a handle stands for. Does nothing for a null pointer.
///
/// # Safety
/// The pointer is null, or [`create`] made it, and nobody uses it any more.
pub(crate) unsafe fn destroy<T>(handle: *mut T) {
    // Dropping runs behind the border, too; a destructor has no status to return.
    let _ = crate::error::border(|| {
        if !handle.is_null() {
            // SAFETY: `create` made the pointer of a box, and the caller gives it up.
            drop(unsafe { Box::from_raw(handle) });
        }
        Ok(())
    });
}
