//! Stamps beside an index: rate, and contradictions.

use crate::lateness_track::{MIN_RATE_ERROR, RateEstimate, minimum_ahead, range_of_blocks, slope};

const MAX_QUEUE: usize = 64;
/// Window lengths for a first period.
const WINDOWS: [usize; 4] = [4096, 256, 16, 1];
/// Periods and seconds of a clock's step, above ticks and stalls.
pub(crate) const STEP_PERIODS: f64 = 16.0;
pub(crate) const STEP_S: f64 = 0.25;
/// Per sample.
const PHASE_TRACKING: f64 = 1.0 / 64.0;

/// A jump of the host's clock against the index.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockStep {
    pub before: usize,
    /// Stamps less index, s.
    pub seconds: f64,
}

pub(crate) struct IndexedClock {
    /// `None` without a time span.
    pub(crate) rate: Option<RateEstimate>,
    pub(crate) steps: Vec<ClockStep>,
}

impl IndexedClock {
    /// `indices` strictly growing, `times` in s not decreasing.
    pub(crate) fn new(indices: &[u64], times: &[f64]) -> Self {
        let none = Self { rate: None, steps: Vec::new() };
        let Some(mut period_s) = first_period(indices, times) else { return none };
        let mut steps = steps(indices, times, period_s);
        let mut corrected = without(times, &steps);
        // The line is more precise.
        if let Some(refined_s) = slope(indices, &corrected, |_| true) {
            period_s = refined_s;
            steps = self::steps(indices, times, period_s);
            corrected = without(times, &steps);
        }
        let Some(slope_s) = slope(indices, &corrected, |_| true) else { return none };
        let residual = |at: usize| (corrected[at] - corrected[0]) / slope_s - (indices[at] - indices[0]) as f64;
        let positions: Vec<usize> = (0..times.len()).collect();
        let span = (indices[indices.len() - 1] - indices[0]).max(1) as f64;
        let error = range_of_blocks(&positions, residual) / span + MIN_RATE_ERROR;
        let hz = slope_s.recip();
        Self { rate: RateEstimate::new(hz, hz * (1.0 - error), hz * (1.0 + error)), steps }
    }
}

/// s.
fn first_period(indices: &[u64], times: &[f64]) -> Option<f64> {
    let window = WINDOWS.into_iter().find(|window| 4 * window <= times.len()).unwrap_or(1);
    let mut periods: Vec<f64> = (window..times.len())
        .map(|at| (times[at] - times[at - window]) / (indices[at] - indices[at - window]) as f64)
        .collect();
    if periods.is_empty() {
        return None;
    }
    let middle = periods.len() / 2;
    let median = *periods.select_nth_unstable_by(middle, f64::total_cmp).1;
    (median.is_finite() && median > 0.0).then_some(median)
}

fn steps(indices: &[u64], times: &[f64], period_s: f64) -> Vec<ClockStep> {
    let lateness: Vec<f64> = indices
        .iter()
        .zip(times)
        .map(|(index, time)| (time - times[0]) / period_s - (index - indices[0]) as f64)
        .collect();
    let least = STEP_PERIODS.max(STEP_S / period_s);
    let envelope = minimum_ahead(&lateness, MAX_QUEUE);
    let mut phase = envelope.first().copied().unwrap_or(0.0);
    let mut steps = Vec::new();
    for at in 0..lateness.len() {
        // Steps back and leaps of the index show at once.
        let excess = if lateness[at] - phase < -least { lateness[at] - phase } else { envelope[at] - phase };
        if excess >= least || lateness[at] - phase < -least {
            steps.push(ClockStep { before: at, seconds: excess * period_s });
            phase += excess;
        } else if excess.is_finite() && excess > -least {
            phase += excess * PHASE_TRACKING;
        }
    }
    steps
}

fn without(times: &[f64], steps: &[ClockStep]) -> Vec<f64> {
    let mut steps = steps.iter().peekable();
    let mut offset = 0.0;
    let shifted = times.iter().enumerate().map(|(at, time)| {
        while let Some(step) = steps.next_if(|step| step.before <= at) {
            offset += step.seconds;
        }
        time - offset
    });
    shifted.collect()
}
