//! Counts of values in a unit.

use crate::status::allan_status::{self, *};
use crate::status::status;
use crate::storage::store;
use allan_core::Quantizer;

/// Sets `count` to the count of a value in a unit: `(value - origin)/lsb`, rounded to nearest, ties up.
///
/// `origin` is best near the mean of the values: the Allan variance does not depend on it. An `lsb` of a quarter of the
/// standard deviation of the noise, or less, costs nothing that matters; give it to the functions that make a curve.
/// `ALLAN_ERROR_RANGE` if the value is not finite or more than 2^31 counts from the origin, or `lsb` is not positive.
///
/// # Safety
/// `count` is null or points to a number that the caller may write.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_count(value: f64, origin: f64, lsb: f64, count: *mut i32) -> allan_status {
    status(|| {
        let quantizer = Quantizer::new(origin, lsb).ok_or(ALLAN_ERROR_RANGE)?;
        let found = quantizer.count(value).map_err(|_| ALLAN_ERROR_RANGE)?;
        // SAFETY: as the caller promises.
        unsafe { store(count, found) }
    })
}
