//! Samples with time stamps: which of them are missing.

use crate::cascade::Cascade;
use core::fmt;

/// Finds missing samples by their time stamps.
///
/// A stamp belongs to the nearest expected time, one `period` of ticks after the other; those without a stamp are
/// missing samples. Expected times follow the stamps by a sixteenth of each deviation: a clock may be off by 1 %, and
/// jitter by a quarter of a period.
///
/// ```
/// use allan_core::{Cascade, TimeStamps};
///
/// let mut stamps = TimeStamps::new(10_000).unwrap(); // ticks of 1 µs, a sample every 10 ms
/// let mut cascade = Cascade::<16, 8>::new();
/// for (time, sample) in [(3, 7), (10_090, 8), (40_010, 6)] {
///     stamps.push(&mut cascade, time, sample).unwrap();
/// }
/// assert_eq!((cascade.len(), cascade.missing()), (3, 2));
/// assert!(stamps.push(&mut cascade, 40_012, 6).is_err()); // the same sample twice
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TimeStamps {
    period: u64,
    last: Option<u64>,
}

/// The reason for which a sample with this time stamp cannot be added.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TimeStampError {
    /// It is nearest to the expected time of the sample before, or to an earlier one.
    NotLater,
    /// 2³² or more samples are missing before it.
    TooLate,
}

impl fmt::Display for TimeStampError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::NotLater => "the time stamp is not later than that of the sample before",
            Self::TooLate => "the time stamp is 2^32 or more samples later than the one before",
        })
    }
}

impl core::error::Error for TimeStampError {}

/// The part of a deviation by which the expected times move.
const FOLLOWED: i64 = 16;

impl TimeStamps {
    /// `period` is the number of ticks between samples. `None` unless it is 1 to 2⁶².
    #[must_use]
    pub const fn new(period: u64) -> Option<Self> {
        if period > 0 && period <= 1 << 62 { Some(Self { period, last: None }) } else { None }
    }

    /// Number of samples missing before the one with the time stamp `time`, which becomes the last one; a counter of 64
    /// bits may wrap.
    ///
    /// # Errors
    /// The stamp is not later than the one before by half a period, or too late. The last sample stays the same.
    pub fn missing(&mut self, time: u64) -> Result<u32, TimeStampError> {
        let Some(last) = self.last else {
            self.last = Some(time);
            return Ok(0);
        };
        let elapsed = time.wrapping_sub(last);
        // Later by more than half the range means earlier.
        let half = self.period / 2;
        if elapsed > u64::MAX / 2 || elapsed < self.period - half {
            return Err(TimeStampError::NotLater);
        }
        let periods = (elapsed + half) / self.period;
        let missing = u32::try_from(periods - 1).map_err(|_| TimeStampError::TooLate)?;
        let expected = last.wrapping_add(periods * self.period);
        let deviation = time.wrapping_sub(expected) as i64;
        self.last = Some(expected.wrapping_add_signed(deviation / FOLLOWED));
        Ok(missing)
    }

    /// Adds a sample with its time stamp to `cascade`, after the [`gap`](Cascade::gap) of those that are missing before it; returns
    /// their number.
    ///
    /// # Cost
    /// | `TimeStamps::push` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions on average | 321 | 794 |
    /// | stack, bytes | 188 | 316 |
    /// | flash, bytes | 5,200 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    ///
    /// # Errors
    /// Those of [`missing`](Self::missing); the sample is not added.
    pub fn push<const OCTAVES: usize, const OVERLAP: usize>(
        &mut self,
        cascade: &mut Cascade<OCTAVES, OVERLAP>,
        time: u64,
        sample: i32,
    ) -> Result<u32, TimeStampError> {
        let missing = self.missing(time)?;
        cascade.gap(missing);
        cascade.push(sample);
        Ok(missing)
    }

    /// The time at which the last sample was expected; `None` before the first sample.
    #[must_use]
    pub const fn last(&self) -> Option<u64> {
        self.last
    }

    /// Forgets the last sample: the next one has none missing before it.
    pub fn restart(&mut self) {
        self.last = None;
    }
}
