//! Filters that a sensor may have, each but for the one number that is adjusted.

use allan_core::NoiseTerm;
use allan_core::term::{LowPass, MovingAverageFilter};

/// Largest factor between two decimations that are tried, a quarter of an octave, and the part of the distance of the nulls, as a part of the
/// decimation: between neighbours the deviance has one minimum.
const LARGEST_STEP: f64 = 0.19;
const OF_NULLS: f64 = 1.0;
/// Least decimation that is told from 1 (every value read).
const LEAST_DECIMATION: f64 = 1.02;
/// Lowest and highest frequency of a low-pass filter that is tried, in sample rates: as long as the longest moving averages, and so high that
/// neighbouring samples behind two stages correlate by a seventieth, `exp(−2π)·(1 + 2π)`. And the factor between two of them.
const FREQUENCIES: (f64, f64) = (1.0 / 128.0, 1.0);
const FREQUENCY_STEP: f64 = std::f64::consts::SQRT_2;

/// A filter but for its decimation or its frequency.
#[derive(Debug, Clone, Copy)]
pub(super) enum Family {
    /// Moving averages, every value of which is recorded: the decimation is 1.
    EveryValue(MovingAverageFilter),
    /// Moving averages that are read slowly.
    ReadSlowly(MovingAverageFilter),
    /// A low-pass filter of the second order: an analog one, or a digital one whose own rate is high against that of the samples.
    LowPass(fn(f64) -> LowPass),
}

impl Family {
    /// Moving averages whose every value is recorded, or that are read slowly where they are long enough.
    pub(super) fn averages(filters: &[MovingAverageFilter]) -> Vec<Self> {
        filters.iter().flat_map(|&filter| [Self::EveryValue(filter), Self::ReadSlowly(filter)]).collect()
    }

    pub(super) fn low_passes() -> [Self; 2] {
        [LowPass::butterworth, LowPass::two_stages].map(Self::LowPass)
    }

    /// White noise behind the filter of this decimation, or of this frequency in Hz.
    pub(super) fn with(self, adjusted: f64) -> NoiseTerm {
        match self {
            Self::EveryValue(filter) | Self::ReadSlowly(filter) => {
                NoiseTerm::Filtered(MovingAverageFilter { decimation: adjusted, ..filter })
            }
            Self::LowPass(design) => NoiseTerm::LowPass(design(adjusted)),
        }
    }

    pub(super) fn taps(self) -> Option<u16> {
        match self {
            Self::EveryValue(filter) | Self::ReadSlowly(filter) => Some(filter.taps),
            Self::LowPass(_) => None,
        }
    }

    /// The decimations or frequencies that are tried, rising: from just above 1 to the filter's length, where no samples correlate.
    pub(super) fn tried(self, rate_hz: f64) -> Vec<f64> {
        match self {
            Self::EveryValue(_) => vec![1.0],
            Self::ReadSlowly(filter) => {
                let taps = f64::from(filter.taps);
                let next = |decimation: f64| decimation * (1.0 + (OF_NULLS * decimation / taps).min(LARGEST_STEP));
                let length = f64::from(filter.stages) * taps;
                let tried = std::iter::successors(Some(LEAST_DECIMATION), |decimation| Some(next(*decimation)));
                tried.take_while(|decimation| *decimation < length).collect()
            }
            Self::LowPass(_) => {
                let (from, to) = (FREQUENCIES.0 * rate_hz, FREQUENCIES.1 * rate_hz);
                let tried = std::iter::successors(Some(from), |frequency| Some(frequency * FREQUENCY_STEP));
                tried.take_while(|frequency| *frequency <= to).collect()
            }
        }
    }
}
