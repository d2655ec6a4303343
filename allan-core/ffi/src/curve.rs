//! The measured curve.

use crate::status::allan_status::{self, *};
use crate::status::{contained, status};
use crate::storage::{Object, initialise, object, object_mut, store};
use allan_core::{Curve, PowerLaw};

/// The curve of both types of estimator.
pub(crate) struct Points;

impl Points {
    /// Octaves of the larger estimator.
    pub(crate) const OCTAVES: usize = 24;
}

type This = Curve<{ Points::OCTAVES }>;

/// Bytes of an `allan_curve`.
pub const ALLAN_CURVE_SIZE: usize = 2720;

/// A curve with up to 24 points. The content is the library's; `allan_curve_point` reads it.
#[repr(C)]
pub struct allan_curve {
    words: [u64; 340],
}

const _: () = assert!(ALLAN_CURVE_SIZE == size_of::<allan_curve>());

impl Object for This {
    type Memory = allan_curve;
    const MARK: u64 = u64::from_le_bytes(*b"allancrv");
}

/// The noise that dominates around an averaging time.
#[repr(C)]
pub enum allan_power_law {
    /** Variance proportional to 1/tau^2. */
    ALLAN_QUANTIZATION_NOISE = 0,
    /** Variance proportional to 1/tau. */
    ALLAN_WHITE_NOISE = 1,
    /** Constant variance. */
    ALLAN_FLICKER_NOISE = 2,
    /** Variance proportional to tau. */
    ALLAN_RANDOM_WALK_NOISE = 3,
}

/// One averaging time of a curve.
#[repr(C)]
pub struct allan_point {
    /// Averaging factor, samples.
    pub n: u64,
    /// Averaging time, s.
    pub tau: f64,
    /// Allan variance, in the square of the unit.
    pub avar: f64,
    /// Lower 95 % bound of `avar`.
    pub low: f64,
    /// Upper 95 % bound of `avar`.
    pub high: f64,
    /// Equivalent degrees of freedom of `avar`.
    pub edf: f64,
    /// Number of differences that `avar` is the mean of.
    pub count: u64,
    /// Share of the samples that was replaced because it was missing.
    pub replaced: f64,
    /// Excess kurtosis of the differences; NaN where it is not known.
    pub kurtosis: f64,
    /// The noise that dominates.
    pub power_law: allan_power_law,
}

impl From<PowerLaw> for allan_power_law {
    fn from(law: PowerLaw) -> Self {
        match law {
            PowerLaw::Quantization => Self::ALLAN_QUANTIZATION_NOISE,
            PowerLaw::White => Self::ALLAN_WHITE_NOISE,
            PowerLaw::Flicker => Self::ALLAN_FLICKER_NOISE,
            PowerLaw::RandomWalk => Self::ALLAN_RANDOM_WALK_NOISE,
        }
    }
}

/// The curve in `memory`, which is empty at first.
///
/// # Safety
/// As [`object_mut`].
pub(crate) unsafe fn put_curve<'a>(memory: *mut allan_curve) -> Result<&'a mut This, allan_status> {
    // SAFETY: as the caller promises.
    unsafe {
        initialise(memory, This::empty())?;
        object_mut(memory)
    }
}

/// The curve in `memory`, to be read.
///
/// # Safety
/// As [`object`].
pub(crate) unsafe fn curve<'a>(memory: *const allan_curve) -> Result<&'a This, allan_status> {
    // SAFETY: as the caller promises.
    unsafe { object(memory) }
}

/// Number of points; 0 if `curve` is not a curve.
///
/// # Safety
/// `curve` is null or points to memory of its type, which no other code writes during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_curve_len(curve: *const allan_curve) -> usize {
    // SAFETY: as the caller promises.
    contained(|| unsafe { self::curve(curve) }.map_or(0, |curve| curve.points().len()), 0)
}

/// Copies the point with this index, 0 for the shortest averaging time, into `point`.
///
/// # Safety
/// As `allan_curve_len`; `point` is null or points to memory of its type that the caller may write.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn allan_curve_point(
    curve: *const allan_curve,
    index: usize,
    point: *mut allan_point,
) -> allan_status {
    status(|| {
        // SAFETY: as the caller promises.
        let curve = unsafe { self::curve(curve)? };
        let found = curve.points().get(index).ok_or(ALLAN_ERROR_INDEX)?;
        let copy = allan_point {
            n: found.n,
            tau: found.tau,
            avar: found.avar,
            low: found.low,
            high: found.high,
            edf: found.edf,
            count: found.count,
            replaced: found.replaced,
            kurtosis: found.kurtosis.unwrap_or(f64::NAN),
            power_law: found.power_law.into(),
        };
        // SAFETY: as the caller promises.
        unsafe { store(point, copy) }
    })
}
