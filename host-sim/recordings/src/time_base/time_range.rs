//! A part of a recording by time.

use crate::counts::recording::Recording;
use crate::time_base::TimeBaseError;

/// A part of a recording, s from its first sample: what comes at `from_s` or later and before `to_s`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeRange {
    /// Its beginning.
    pub from_s: f64,
    /// Its end, which may be infinite.
    pub to_s: f64,
}

impl TimeRange {
    /// The samples of `recording` in this range, by their time stamps; without, by their number and the stated rate.
    ///
    /// # Errors
    /// There is neither a time nor a rate, or no sample in the range.
    pub fn of_recording(self, mut recording: Recording, stated_hz: Option<f64>) -> Result<Recording, TimeBaseError> {
        let samples = &recording.samples;
        let times: Option<Vec<f64>> = samples.iter().map(|sample| sample.time_stamp.time_s).collect();
        let indices: Option<Vec<u64>> = samples.iter().map(|sample| sample.time_stamp.index).collect();
        let kept = self.kept(samples.len(), times.as_deref(), indices.as_deref(), stated_hz)?;
        let mut kept = kept.into_iter();
        recording.samples.retain(|_| kept.next().unwrap_or(false));
        Ok(recording)
    }

    /// Which of some rows are in the range, as [`of_recording`](Self::of_recording).
    pub(crate) fn kept(
        self,
        rows: usize,
        times_s: Option<&[f64]>,
        indices: Option<&[u64]>,
        stated_hz: Option<f64>,
    ) -> Result<Vec<bool>, TimeBaseError> {
        let Self { from_s, to_s } = self;
        let period_s = || match stated_hz {
            Some(rate) if rate.is_finite() && rate > 0.0 => Ok(rate.recip()),
            Some(rate) => Err(TimeBaseError::InvalidRate(rate)),
            None => Err(TimeBaseError::NoRate),
        };
        let elapsed_s: Vec<f64> = match (times_s, indices) {
            (Some(times), _) => times.iter().map(|time| time - times[0]).collect(),
            (None, Some(indices)) => {
                let period_s = period_s()?;
                indices.iter().map(|index| index.saturating_sub(indices[0]) as f64 * period_s).collect()
            }
            (None, None) => {
                let period_s = period_s()?;
                (0..rows).map(|row| row as f64 * period_s).collect()
            }
        };
        let kept: Vec<bool> = elapsed_s.iter().map(|time| (from_s..to_s).contains(time)).collect();
        if kept.contains(&true) {
            return Ok(kept);
        }
        Err(TimeBaseError::EmptyTimeRange { from_s, to_s, recording_s: elapsed_s.last().copied().unwrap_or(0.0) })
    }
}
