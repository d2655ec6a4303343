//! The estimator with 24 octaves and 8-fold overlap; `build.rs` makes that with 20 octaves and 4-fold overlap of this file.

use crate::curve::allan_curve;
use crate::estimator::{self, Estimator};
use crate::status::{allan_status, contained, status};
use crate::storage::{Object, elements, object, object_mut};

const OCTAVES: usize = 24;
const OVERLAP: usize = 8;
type This = Estimator<OCTAVES, OVERLAP>;

/// Bytes of an `allan_24_8`.
pub const ALLAN_24_8_SIZE: usize = 3592;
/// Bytes that `allan_24_8_save` needs at most.
pub const ALLAN_24_8_SAVED_SIZE: usize = 4500;

/// An estimator of 24 octaves (averaging factors up to 2^23 samples) with 8-fold overlap. The content is the library's.
#[repr(C)]
pub struct allan_24_8 {
    words: [u64; 449],
}

const _: () = assert!(ALLAN_24_8_SIZE == size_of::<allan_24_8>());
// The words of a state, its header and its checksum; postcard takes at most 10 bytes for a word.
const _: () = assert!(ALLAN_24_8_SAVED_SIZE == 10 * (10 + OVERLAP + OCTAVES * (10 + OVERLAP)));

impl Object for This {
    type Memory = allan_24_8;
    const MARK: u64 = u64::from_le_bytes(*b"allan248");
}

/// Makes an estimator without samples in `bytes` bytes of memory, usually `sizeof(allan_24_8)`; it may hold anything, another
/// estimator too.
///
/// # Safety
/// `estimator` is null or points to `bytes` bytes that the caller may write.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_24_8_init(estimator: *mut allan_24_8, bytes: usize) -> allan_status {
    // SAFETY: as the caller promises.
    status(|| unsafe { estimator::init::<OCTAVES, OVERLAP, _>(estimator, bytes) })
}

/// Adds the next sample, in counts.
///
/// # Safety
/// `estimator` is null or points to memory of its type, which no other code uses during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_24_8_push(estimator: *mut allan_24_8, sample: i32) -> allan_status {
    status(|| {
        // SAFETY: as the caller promises.
        let estimator: &mut This = unsafe { object_mut(estimator)? };
        estimator.push(sample);
        Ok(())
    })
}

/// Adds `count` samples in order.
///
/// # Safety
/// As `allan_24_8_push`; `samples` is null or points to `count` samples.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_24_8_push_slice(
    estimator: *mut allan_24_8,
    samples: *const i32,
    count: usize,
) -> allan_status {
    status(|| {
        // SAFETY: as the caller promises.
        let (estimator, samples): (&mut This, _) = unsafe { (object_mut(estimator)?, elements(samples, count)?) };
        estimator.push_slice(samples);
        Ok(())
    })
}

/// Says that `missing` samples are missing before the next one. Calls add up.
///
/// # Safety
/// As `allan_24_8_push`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_24_8_gap(estimator: *mut allan_24_8, missing: u32) -> allan_status {
    status(|| {
        // SAFETY: as the caller promises.
        let estimator: &mut This = unsafe { object_mut(estimator)? };
        estimator.gap(missing);
        Ok(())
    })
}

/// Adds the sums of `later`, which has seen a later stretch of the same channel. They must be different objects.
///
/// # Safety
/// As `allan_24_8_push`; no other code writes `later` during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_24_8_merge(estimator: *mut allan_24_8, later: *const allan_24_8) -> allan_status {
    // SAFETY: as the caller promises.
    status(|| unsafe { estimator::merge::<OCTAVES, OVERLAP, _>(estimator, later) })
}

/// Samples taken; 0 if `estimator` is not an estimator.
///
/// # Safety
/// `estimator` is null or points to memory of its type, which no other code writes during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_24_8_len(estimator: *const allan_24_8) -> u64 {
    // SAFETY: as the caller promises.
    contained(|| unsafe { object::<This>(estimator) }.map_or(0, This::len), 0)
}

/// Samples reported missing; 0 if `estimator` is not an estimator.
///
/// # Safety
/// As `allan_24_8_len`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_24_8_missing(estimator: *const allan_24_8) -> u64 {
    // SAFETY: as the caller promises.
    contained(|| unsafe { object::<This>(estimator) }.map_or(0, This::missing), 0)
}

/// Whether a sum of squares is full, so that the curve is a lower bound there.
///
/// # Safety
/// As `allan_24_8_len`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_24_8_is_saturated(estimator: *const allan_24_8) -> bool {
    // SAFETY: as the caller promises.
    contained(|| unsafe { object::<This>(estimator) }.is_ok_and(This::is_saturated), false)
}

/// Makes `curve` the Allan variance of every octave that has a difference, for samples every `sample_period` seconds, in
/// units of `lsb` units per count.
///
/// # Safety
/// As `allan_24_8_len`; `curve` is null or points to memory of its type that the caller may write.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_24_8_curve(
    estimator: *const allan_24_8,
    sample_period: f64,
    lsb: f64,
    curve: *mut allan_curve,
) -> allan_status {
    // SAFETY: as the caller promises.
    status(|| unsafe { estimator::curve::<OCTAVES, OVERLAP, _>(estimator, sample_period, lsb, curve) })
}

/// As `allan_24_8_curve`, in single precision and without confidence: `low` is 0, `high` infinite, `kurtosis` NaN,
/// `power_law` white noise, and `edf` the number of differences that do not overlap. It takes a small part of the
/// instructions and of the code; the fits give nearly the same coefficients.
///
/// # Safety
/// As `allan_24_8_curve`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_24_8_curve_without_confidence(
    estimator: *const allan_24_8,
    sample_period: f64,
    lsb: f64,
    curve: *mut allan_curve,
) -> allan_status {
    // SAFETY: as the caller promises.
    status(|| unsafe {
        estimator::curve_without_confidence::<OCTAVES, OVERLAP, _>(estimator, sample_period, lsb, curve)
    })
}

/// Writes the whole state, with version and checksum, into `buffer` and its length into `length`.
/// `ALLAN_24_8_SAVED_SIZE` bytes are always enough.
///
/// # Safety
/// As `allan_24_8_len`; `buffer` is null or points to `capacity` bytes, `length` to a number, that the caller may write.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_24_8_save(
    estimator: *const allan_24_8,
    buffer: *mut u8,
    capacity: usize,
    length: *mut usize,
) -> allan_status {
    // SAFETY: as the caller promises.
    status(|| unsafe { estimator::save::<OCTAVES, OVERLAP, _>(estimator, buffer, capacity, length) })
}

/// Replaces the state of an initialised estimator by a saved one, which continues to the bit. The estimator stays as it was
/// if the state is refused, unless it has a correct checksum over sums that no samples lead to: then it is empty.
///
/// # Safety
/// As `allan_24_8_push`; `state` is null or points to `length` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_24_8_restore(
    estimator: *mut allan_24_8,
    state: *const u8,
    length: usize,
) -> allan_status {
    // SAFETY: as the caller promises.
    status(|| unsafe { estimator::restore::<OCTAVES, OVERLAP, _>(estimator, state, length) })
}
