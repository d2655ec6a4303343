//! What the functions of both estimator types have in common.

use crate::curve::{Points, allan_curve, put_curve};
use crate::status::allan_status::{self, *};
use crate::storage::{Object, check, elements, initialise_zeroed, object, object_mut, store};
use allan_core::{Cascade, Curve, OctaveSums};

/// The object behind an estimator.
pub(crate) type Estimator<const OCTAVES: usize, const OVERLAP: usize> = Cascade<OCTAVES, OVERLAP>;

/// # Safety
/// As [`initialise_zeroed`], but for the promise about zeros.
pub(crate) unsafe fn init<const OCTAVES: usize, const OVERLAP: usize, M>(
    memory: *mut M,
    bytes: usize,
) -> Result<(), allan_status>
where
    Estimator<OCTAVES, OVERLAP>: Object<Memory = M>,
{
    // SAFETY: an estimator consists of integers and arrays of them, for which zeros are valid; they are that of
    // `Cascade::new`, which would take the stack of a whole estimator.
    unsafe { initialise_zeroed::<Estimator<OCTAVES, OVERLAP>>(memory, bytes) }
}

/// # Safety
/// As [`object_mut`] for `estimator` and [`object`] for `later`.
pub(crate) unsafe fn merge<const OCTAVES: usize, const OVERLAP: usize, M>(
    estimator: *mut M,
    later: *const M,
) -> Result<(), allan_status>
where
    Estimator<OCTAVES, OVERLAP>: Object<Memory = M>,
{
    if estimator.cast_const() == later && !later.is_null() {
        return Err(ALLAN_ERROR_SAME_OBJECT);
    }
    // SAFETY: as the caller promises. They are different objects.
    let (estimator, later): (&mut Estimator<OCTAVES, OVERLAP>, &Estimator<OCTAVES, OVERLAP>) =
        unsafe { (object_mut(estimator)?, object(later)?) };
    estimator.merge(later);
    Ok(())
}

/// # Safety
/// As [`object`] for `estimator`; `curve` is null or points to memory of its type that the caller may write.
pub(crate) unsafe fn curve<const OCTAVES: usize, const OVERLAP: usize, M>(
    estimator: *const M,
    sample_period: f64,
    lsb: f64,
    curve: *mut allan_curve,
) -> Result<(), allan_status>
where
    Estimator<OCTAVES, OVERLAP>: Object<Memory = M>,
{
    // SAFETY: as the caller promises.
    let (estimator, curve) = unsafe { curve_of(estimator, [sample_period, lsb], curve)? };
    let (samples, sums) = (estimator.len(), octave_sums(estimator));
    Cascade::<{ Points::OCTAVES }, OVERLAP>::rebuild_curve(curve, sample_period, samples, sums);
    curve.scale(lsb);
    Ok(())
}

/// # Safety
/// As [`curve`].
pub(crate) unsafe fn curve_without_confidence<const OCTAVES: usize, const OVERLAP: usize, M>(
    estimator: *const M,
    sample_period: f64,
    lsb: f64,
    curve: *mut allan_curve,
) -> Result<(), allan_status>
where
    Estimator<OCTAVES, OVERLAP>: Object<Memory = M>,
{
    // SAFETY: as the caller promises.
    let (estimator, curve) = unsafe { curve_of(estimator, [sample_period, lsb], curve)? };
    let (samples, sums) = (estimator.len(), octave_sums(estimator));
    Cascade::<{ Points::OCTAVES }, OVERLAP>::rebuild_without_confidence(curve, sample_period, samples, sums);
    curve.scale(lsb);
    Ok(())
}

/// The sums of each octave; those of an octave that the estimator does not have are empty, so that its points are the first ones
/// of a curve with room for more.
fn octave_sums<const OCTAVES: usize, const OVERLAP: usize>(
    estimator: &Estimator<OCTAVES, OVERLAP>,
) -> impl Fn(usize) -> OctaveSums + '_ {
    |octave| estimator.octave_sums(octave).unwrap_or_default()
}

/// The estimator, and the memory of its curve, which is empty at first; an error if a number is not positive.
///
/// # Safety
/// As [`curve`].
unsafe fn curve_of<'a, const OCTAVES: usize, const OVERLAP: usize, M>(
    estimator: *const M,
    numbers: [f64; 2],
    curve: *mut allan_curve,
) -> Result<(&'a Estimator<OCTAVES, OVERLAP>, &'a mut Curve<{ Points::OCTAVES }>), allan_status>
where
    Estimator<OCTAVES, OVERLAP>: Object<Memory = M>,
{
    // SAFETY: as the caller promises.
    let estimator = unsafe { object(estimator)? };
    if !numbers.into_iter().all(|number| number > 0.0 && number.is_finite()) {
        return Err(ALLAN_ERROR_RANGE);
    }
    // SAFETY: as the caller promises.
    Ok((estimator, unsafe { put_curve(curve)? }))
}

/// # Safety
/// As [`object`] for `estimator`; `buffer` is null or points to `capacity` bytes, and `length` to a number, that the caller
/// may write.
pub(crate) unsafe fn save<const OCTAVES: usize, const OVERLAP: usize, M>(
    estimator: *const M,
    buffer: *mut u8,
    capacity: usize,
    length: *mut usize,
) -> Result<(), allan_status>
where
    Estimator<OCTAVES, OVERLAP>: Object<Memory = M>,
{
    // SAFETY: as the caller promises.
    let estimator: &Estimator<OCTAVES, OVERLAP> = unsafe { object(estimator)? };
    check(buffer)?;
    check(length)?;
    if capacity > isize::MAX as usize {
        return Err(ALLAN_ERROR_SIZE);
    }
    // SAFETY: not null and of a possible length, as just checked; the bytes are the caller's to write, and are cleared
    // before they are read as initialised memory.
    let buffer = unsafe {
        buffer.write_bytes(0, capacity);
        core::slice::from_raw_parts_mut(buffer, capacity)
    };
    let written = postcard::to_slice(estimator, buffer).map_err(|_| ALLAN_ERROR_SIZE)?.len();
    // SAFETY: as the caller promises.
    unsafe { store(length, written) }
}

/// # Safety
/// As [`object_mut`] for `estimator`; `state` is null or points to `length` bytes.
pub(crate) unsafe fn restore<const OCTAVES: usize, const OVERLAP: usize, M>(
    estimator: *mut M,
    state: *const u8,
    length: usize,
) -> Result<(), allan_status>
where
    Estimator<OCTAVES, OVERLAP>: Object<Memory = M>,
{
    // SAFETY: as the caller promises.
    let estimator: &mut Estimator<OCTAVES, OVERLAP> = unsafe { object_mut(estimator)? };
    check(state)?;
    // SAFETY: as the caller promises.
    let state = unsafe { elements(state, length)? };
    let words = || postcard::Deserializer::from_bytes(state);
    let refused = |_| ALLAN_ERROR_STATE;
    Estimator::<OCTAVES, OVERLAP>::check_serialized(&mut words()).map_err(refused)?;
    // In place: another estimator on the stack would be too much for many a microcontroller.
    estimator.read_serialized(&mut words()).map_err(refused)
}
