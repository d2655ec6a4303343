//! Curves of a channel's samples at averaging times too short for its means.

use crate::samples::exclusion::Exclusion;
use crate::samples::gapped_cascade::GappedCascade;
use crate::samples::streamed_curves::{STEPS_PER_COUNT, joined};
use crate::spectra::Welch;
use crate::spectra::epoch_spectra::PartSpectra;
use crate::{OCTAVES, OVERLAP};
use allan_core::Curve;
use measurement::{ChannelId, Measurement};
use std::ops::Range;

/// Averaging factor, in means, from which the means' curve has as many differences ([`OVERLAP`]).
const LEAST_FACTOR: u64 = OVERLAP as u64;

/// Estimators of consecutive parts, each with its first sample period.
pub(crate) type Parts = Vec<(u64, GappedCascade)>;

/// The curves of a channel's samples; only the whole curve if all samples are kept.
#[derive(Clone)]
pub(crate) struct SampleCurves {
    pub samples_per_mean: u64,
    /// Smallest distance of two values, in the channel's unit.
    pub resolution: f64,
    pub measured: Curve<OCTAVES>,
    /// With all samples; `screened` lacks those that the screen drops.
    pub recorded: Parts,
    pub screened: Parts,
    pub middle: u64,
    pub spectra: PartSpectra,
    /// True if the screen drops a sample of the whole record, and of its first half.
    pub is_screened: bool,
    pub is_first_half_screened: bool,
    pub period_s: f64,
    pub lsb: f64,
}

impl SampleCurves {
    /// For a channel all of whose samples are kept.
    pub(crate) fn of_all(measurement: &Measurement, channel: ChannelId, resolution: f64) -> Self {
        let (period_s, lsb) = (measurement.period_s(), measurement[channel].profile.lsb);
        let cascade = GappedCascade::of_channel(&measurement.slots, &measurement[channel]);
        Self {
            samples_per_mean: 1,
            resolution,
            measured: cascade.curve(period_s).scaled(lsb),
            recorded: Parts::new(),
            screened: Parts::new(),
            middle: measurement.middle(),
            spectra: PartSpectra::default(),
            is_screened: false,
            is_first_half_screened: false,
            period_s,
            lsb,
        }
    }

    pub(crate) fn of_first_half(&self) -> Self {
        let first = |parts: &Parts| parts.iter().filter(|(start, _)| *start < self.middle).cloned().collect();
        let middle = self.slots_of(0..self.middle / self.samples_per_mean / 2).end;
        Self {
            recorded: first(&self.recorded),
            screened: first(&self.screened),
            is_screened: self.is_first_half_screened,
            middle,
            ..self.clone()
        }
    }

    pub(crate) fn slots_of(&self, means: Range<u64>) -> Range<u64> {
        means.start * self.samples_per_mean..means.end * self.samples_per_mean
    }

    /// Averaging factor from which the curve is that of the means, samples.
    pub(crate) fn until(&self) -> u64 {
        if self.samples_per_mean == 1 { 1 } else { LEAST_FACTOR * self.samples_per_mean }
    }

    /// The curve of `means`, with `shorter` averaging times by the samples.
    pub(crate) fn continued(&self, shorter: Curve<OCTAVES>, means: &Curve<OCTAVES>) -> Curve<OCTAVES> {
        shorter.continued_by_means(means, self.samples_per_mean, self.until())
    }

    /// The curve of `means` by averaging factors in samples.
    pub(crate) fn in_samples(&self, means: &Curve<OCTAVES>) -> Curve<OCTAVES> {
        Curve::empty().continued_by_means(means, self.samples_per_mean, 0)
    }

    /// The curve of a half (0 is the first), as recorded or screened.
    pub(crate) fn half(&self, half: usize, exclusion: Exclusion) -> Curve<OCTAVES> {
        let slots = if half == 0 { 0..self.middle } else { self.middle..u64::MAX };
        self.curve(self.parts(exclusion).iter().filter(|(start, _)| slots.contains(start)))
    }

    pub(crate) fn both(&self, exclusion: Exclusion) -> Curve<OCTAVES> {
        self.curve(self.parts(exclusion))
    }

    /// The curve of some sample periods; `None` unless they are whole parts.
    pub(crate) fn within(&self, slots: Range<u64>, exclusion: Exclusion) -> Option<Curve<OCTAVES>> {
        let parts = self.parts(exclusion);
        let from = parts.iter().position(|(start, _)| *start == slots.start)?;
        let to = parts.iter().position(|(start, _)| *start >= slots.end).unwrap_or(parts.len());
        let is_whole = parts.get(to).is_none_or(|(start, _)| *start == slots.end);
        is_whole.then(|| self.curve(&parts[from..to]))
    }

    /// Spectrum of the parts that begin in some sample periods; `None` without samples.
    pub(crate) fn spectrum_within(&self, slots: Range<u64>) -> Option<Welch> {
        Welch::joined(self.spectra.iter().filter(|(start, _)| slots.contains(start)).map(|(_, spectrum)| spectrum))
    }

    pub(crate) fn replaced(&self, exclusion: Exclusion) -> u64 {
        self.parts(exclusion).iter().map(|(_, part)| part.cascade().replaced()).sum()
    }

    fn parts(&self, exclusion: Exclusion) -> &Parts {
        if exclusion.keeps_events() { &self.recorded } else { &self.screened }
    }

    fn curve<'p>(&self, parts: impl IntoIterator<Item = &'p (u64, GappedCascade)>) -> Curve<OCTAVES> {
        joined(parts.into_iter().map(|(_, part)| part)).curve(self.period_s).scaled(self.lsb / STEPS_PER_COUNT)
    }
}
