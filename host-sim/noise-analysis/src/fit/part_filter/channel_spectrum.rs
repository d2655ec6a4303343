//! The deviance of the spectrum of one channel behind a filter.

use crate::OCTAVES;
use crate::fit::noise_terms::{is_white, sinusoids};
use crate::fit::sample_coefficients::SamplesOfCurve;
use crate::fit::traced_model::COST_OF_A_TERM;
use crate::spectra::{SampleSpectrum, SpectrumBehindFilter};
use allan_core::{Curve, Model, NoiseTerm};

/// An inertial channel and what it says of the filter.
pub(crate) struct FilteredChannel<'a> {
    pub name: &'static str,
    /// Without the share of its covariates.
    pub curve: &'a Curve<OCTAVES>,
    /// Its own model, whose terms beside the white noise it keeps.
    pub model: &'a Model,
    /// True if rounding adds white noise and nothing else. A channel that is not dithered says nothing of the filter.
    pub is_dithered: bool,
    pub samples: SamplesOfCurve<'a>,
    /// Frequencies of lines in the spectrum, Hz.
    pub lines: Vec<f64>,
}

/// The spectrum of a channel, with the terms that it may have beside its white noise.
pub(super) struct ChannelSpectrum {
    pub(super) name: &'static str,
    spectrum: SampleSpectrum,
    /// Sets of terms, and what each must take off the deviance.
    others: Vec<(Vec<NoiseTerm>, f64)>,
}

/// The spectrum of a channel behind one filter, with each set of other terms.
pub(super) struct ChannelBehindFilter<'a> {
    spectrum: &'a SampleSpectrum,
    behind: Vec<(SpectrumBehindFilter, f64)>,
}

impl ChannelSpectrum {
    /// `None` where the means of the samples alone are kept.
    pub(super) fn new(channel: &FilteredChannel) -> Option<Self> {
        let kinds = || channel.model.terms().iter().map(|term| term.kind);
        let lines =
            [channel.lines.as_slice(), &sinusoids(channel.model.terms().iter().map(|term| &term.kind))].concat();
        // A ramp is slower than any band, and no density.
        let others: Vec<NoiseTerm> = kinds().filter(|kind| !is_white(kind) && *kind != NoiseTerm::RateRamp).collect();
        let stands_in = |kind: &NoiseTerm| matches!(kind, NoiseTerm::Markov(_) | NoiseTerm::Quantization);
        let fewer: Vec<NoiseTerm> = others.iter().filter(|kind| !stands_in(kind)).copied().collect();
        let others = if fewer == others { vec![others] } else { vec![others, fewer] };
        let cost = |of: &Vec<NoiseTerm>| {
            COST_OF_A_TERM * of.iter().filter(|kind| !NoiseTerm::BASELINE.contains(kind)).count() as f64
        };
        Some(Self {
            name: channel.name,
            spectrum: channel.samples.averaged_spectrum(channel.curve, &lines)?,
            others: others.into_iter().map(|of| (cost(&of), of)).map(|(cost, of)| (of, cost)).collect(),
        })
    }

    pub(super) fn bands(&self) -> f64 {
        self.spectrum.bands() as f64
    }

    pub(super) fn unfiltered(&self) -> f64 {
        self.behind(NoiseTerm::AngleRandomWalk).deviance(&self.spectrum.shape(NoiseTerm::AngleRandomWalk))
    }

    /// Behind a filter, or one that is not much different.
    pub(super) fn behind(&self, filtered: NoiseTerm) -> ChannelBehindFilter<'_> {
        let behind = |(others, cost): &(Vec<NoiseTerm>, f64)| (self.spectrum.behind(&kinds(filtered, others)), *cost);
        ChannelBehindFilter { spectrum: &self.spectrum, behind: self.others.iter().map(behind).collect() }
    }
}

impl ChannelBehindFilter<'_> {
    /// The deviance with white noise behind a filter of this shape, and with the other terms of the channel or without those of them that may
    /// stand in for another filter, with what the terms cost, whichever is least.
    fn deviance(&self, filtered: &[f64]) -> f64 {
        self.behind.iter().map(|(spectrum, cost)| spectrum.deviance(filtered) + cost).fold(f64::INFINITY, f64::min)
    }
}

/// The deviance of each channel with white noise behind the filter `filtered`, whose shape neighbours with the same bands share.
pub(super) fn deviances<'a>(
    channels: impl Iterator<Item = &'a ChannelBehindFilter<'a>>,
    filtered: NoiseTerm,
) -> impl Iterator<Item = f64> {
    let mut last: Option<(&SampleSpectrum, Vec<f64>)> = None;
    channels.map(move |channel| {
        let shared = last.take().filter(|(spectrum, _)| spectrum.has_bands_of(channel.spectrum));
        let (_, shape) = last.insert(shared.unwrap_or_else(|| (channel.spectrum, channel.spectrum.shape(filtered))));
        channel.deviance(shape)
    })
}

/// White noise behind a filter, `filtered`, or of none, with the terms `others`. At the filter's own rate white noise after the filter is told
/// from what passed it; read slowly it is not.
fn kinds(filtered: NoiseTerm, others: &[NoiseTerm]) -> Vec<NoiseTerm> {
    let is_alone = match filtered {
        NoiseTerm::Filtered(filter) => filter.decimation != 1.0,
        filtered => filtered == NoiseTerm::AngleRandomWalk,
    };
    let after = (!is_alone).then_some(NoiseTerm::AngleRandomWalk);
    std::iter::once(filtered).chain(others.iter().copied()).chain(after).collect()
}
