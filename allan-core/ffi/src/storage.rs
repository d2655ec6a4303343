//! Objects in the caller's memory: a mark that says which object lies there, and the object itself.

use crate::status::allan_status::{self, *};

/// Alignment of every object in bytes.
pub const ALLAN_ALIGNMENT: usize = 8;

/// What lies in the memory of an object after its initialisation.
#[repr(C, align(8))]
pub(crate) struct Marked<T> {
    mark: u64,
    object: T,
}

/// An object whose memory the caller owns, as `Memory`.
pub(crate) trait Object: Sized {
    /// The memory in C: as large as [`Marked<Self>`](Marked) or larger.
    type Memory;
    /// Distinguishes this type from others and from memory that was not initialised.
    const MARK: u64;
    /// Checks at compile time that the object fits into its memory.
    const FITS: () = assert!(
        size_of::<Marked<Self>>() <= size_of::<Self::Memory>() && align_of::<Marked<Self>>() <= ALLAN_ALIGNMENT
    );
}

/// An error if `pointer` is null or not aligned.
pub(crate) fn check<T>(pointer: *const T) -> Result<(), allan_status> {
    if pointer.is_null() {
        Err(ALLAN_ERROR_NULL)
    } else if !pointer.is_aligned() {
        Err(ALLAN_ERROR_ALIGNMENT)
    } else {
        Ok(())
    }
}

/// The place of the object in `memory`, if that is not null and aligned.
fn place<T: Object>(memory: *const T::Memory) -> Result<*mut Marked<T>, allan_status> {
    const { T::FITS };
    let place = memory.cast_mut().cast::<Marked<T>>();
    check(place)?;
    Ok(place)
}

/// Puts an object whose bytes are all zero into `memory`, in place.
///
/// # Safety
/// `memory` is null or points to `bytes` bytes that the caller may write. A `T` of zero bytes is valid.
pub(crate) unsafe fn initialise_zeroed<T: Object>(memory: *mut T::Memory, bytes: usize) -> Result<(), allan_status> {
    let place = place::<T>(memory)?;
    if bytes < size_of::<T::Memory>() {
        return Err(ALLAN_ERROR_SIZE);
    }
    // SAFETY: not null, aligned, and with room for the object, as just checked; zeros are a valid object, as the caller
    // promises, and a valid mark.
    unsafe {
        place.write_bytes(0, 1);
        (*place).mark = T::MARK;
    }
    Ok(())
}

/// Puts `object` into `memory`, whatever lay there.
///
/// # Safety
/// `memory` is null or points to memory of its type that the caller may write.
pub(crate) unsafe fn initialise<T: Object>(memory: *mut T::Memory, object: T) -> Result<(), allan_status> {
    let place = place::<T>(memory)?;
    // SAFETY: not null and aligned, as just checked, and large enough by `Object::FITS`. What lay there is not dropped: no
    // object owns anything.
    unsafe { place.write(Marked { mark: T::MARK, object }) };
    Ok(())
}

/// The object in `memory`, to be read.
///
/// # Safety
/// `memory` is null or points to memory of its type, which no other code writes during `'a`.
pub(crate) unsafe fn object<'a, T: Object>(memory: *const T::Memory) -> Result<&'a T, allan_status> {
    let place = place::<T>(memory)?;
    // SAFETY: not null and aligned, as just checked; the mark is a number, of which every value is valid.
    if unsafe { (&raw const (*place).mark).read() } != T::MARK {
        return Err(ALLAN_ERROR_UNINITIALISED);
    }
    // SAFETY: with its mark, an object was put there by this library. No other code writes it, as the caller promises.
    Ok(unsafe { &(*place).object })
}

/// The object in `memory`, to be written.
///
/// # Safety
/// `memory` is null or points to memory of its type, which no other code reads or writes during `'a`.
pub(crate) unsafe fn object_mut<'a, T: Object>(memory: *mut T::Memory) -> Result<&'a mut T, allan_status> {
    let place = place::<T>(memory)?;
    // SAFETY: as in `object`.
    if unsafe { (&raw const (*place).mark).read() } != T::MARK {
        return Err(ALLAN_ERROR_UNINITIALISED);
    }
    // SAFETY: as in `object`; no other code reads or writes it, as the caller promises.
    Ok(unsafe { &mut (*place).object })
}

/// The `count` elements at `first`; null is allowed if there are none.
///
/// # Safety
/// `first` is null or points to `count` initialised elements, which no other code writes during `'a`.
pub(crate) unsafe fn elements<'a, T>(first: *const T, count: usize) -> Result<&'a [T], allan_status> {
    if count == 0 {
        return Ok(&[]);
    }
    check(first)?;
    if count > isize::MAX as usize / size_of::<T>() {
        return Err(ALLAN_ERROR_SIZE);
    }
    // SAFETY: not null, aligned and not longer than the address space, as just checked; initialised and not written, as the
    // caller promises.
    Ok(unsafe { core::slice::from_raw_parts(first, count) })
}

/// Writes `value` to where `place` points.
///
/// # Safety
/// `place` is null or points to memory of its type that the caller may write.
pub(crate) unsafe fn store<T>(place: *mut T, value: T) -> Result<(), allan_status> {
    check(place)?;
    // SAFETY: not null and aligned, as just checked, and writable, as the caller promises.
    unsafe { place.write(value) };
    Ok(())
}

/// What `place` points to.
///
/// # Safety
/// `place` is null or points to an initialised value, which no other code writes during `'a`.
pub(crate) unsafe fn object_ref<'a, T>(place: *const T) -> Result<&'a T, allan_status> {
    check(place)?;
    // SAFETY: not null and aligned, as just checked; initialised and not written, as the caller promises.
    Ok(unsafe { &*place })
}
