//! One part of a recording, fitted: the whole, its first half, or curves alone. The noise model of each channel with what its baseline
//! lacks, and the filter that the sensor has once.

use crate::detectors::bias::BiasSensitivity;
use crate::detectors::random_telegraph;
use crate::effects::TelegraphNoise;
use crate::fit::channel_fit::ChannelFit;
use crate::fit::contradiction::Contradiction;
use crate::fit::covariates::CovariateFit;
use crate::fit::part_filter::{self, FilteredChannel, PartFilter, Unidentified};
use crate::fit::quantized_after_filter::quantized_after_filter;
use crate::fit::sample_coefficients::SamplesOfCurve;
use crate::fit::signal_share::SignalShare;
use crate::parallel::{self, per_channel};
use crate::record::condensed_record::CondensedRecord;
use crate::record::estimators::RecordPart;
use crate::rivals::channel_lines::{fit_with_lines, without_leakage};
use crate::rivals::proposal::{ChannelFacts, Origin, Proposal, Signal};
use crate::rivals::proposals::{ChannelFindings, propose};
use crate::rivals::shown_by_samples::ShownBySamples;
use crate::rivals::signals::SpectrumProposals;
use crate::rivals::slow_drift::ChannelsInCommon;
use crate::rivals::table::standing_in_spectrum;
use crate::rivals::unexplained;
use crate::samples::rounding::DITHERED_OCTAVES;
use crate::samples::series::Series;
use crate::samples::uniform_series::UniformSeries;
use crate::spectra::cosine_spectrum::CosineSpectrum;
use crate::spectra::spectral_lines::MergedLine;
use crate::spectra::{Welch, without_sines};
use allan_core::NoiseTerm;
use allan_core::model::FittedTerm;
use allan_core::regression::Sensitivity;
use measurement::{ChannelId, PerChannel, SensorProfile};

pub(crate) struct PartData<'a> {
    pub profile: &'a SensorProfile,
    pub curves: &'a RecordPart,
    /// `None` where the samples are not kept: what they alone show is not looked for.
    pub samples: Option<PartSamples<'a>>,
}

pub(crate) struct PartSamples<'a> {
    pub record: &'a CondensedRecord<'a>,
    pub series: &'a PerChannel<Series>,
    pub biases: PerChannel<BiasByBlocks>,
}

/// Findings in the block means of a channel.
#[derive(Debug, Clone, Default)]
pub(crate) struct BiasByBlocks {
    pub has_ramp: bool,
    /// To temperature and supply.
    pub sensitivities: Vec<(ChannelId, BiasSensitivity)>,
}

pub(crate) struct TracedPart {
    pub channels: PerChannel<ChannelTrace>,
    pub filter: Result<PartFilter, Unidentified>,
}

/// The noise of one channel in one part of a recording.
pub(crate) struct ChannelTrace {
    pub fit: ChannelFit,
    pub lines: Vec<MergedLine>,
    /// The samples less the share of the covariates; `None` where they were not used.
    pub rest: Option<UniformSeries>,
    /// The same less the periodic signal, where there is one.
    noise: Option<UniformSeries>,
    pub telegraph: Option<TelegraphNoise>,
    pub signals: Vec<Signal>,
    slowest: Option<CosineSpectrum>,
    /// The spectrum of the samples where their means alone are kept.
    spectrum: Option<Welch>,
}

impl BiasByBlocks {
    pub(crate) fn sensitivity(&self, regressor: ChannelId) -> Option<BiasSensitivity> {
        self.sensitivities.iter().find(|(to, _)| *to == regressor).map(|(_, sensitivity)| *sensitivity)
    }
}

impl TracedPart {
    /// Fits the baseline model to every channel, and adds to that of the inertial ones what it lacks.
    pub(crate) fn fit(part: &PartData) -> Self {
        let mut channels = per_channel(part.curves.channels.ids(), |channel| ChannelTrace::fit(part, channel));
        if part.samples.is_none() {
            return Self { channels, filter: Err(Unidentified::NotSought) };
        }
        let filter = agree_on_filter(part, &mut channels);
        parallel::for_each(channels.as_mut_slice(), |trace| {
            let ChannelFit { curve, traced, .. } = &trace.fit;
            let quantized = trace.samples_of_noise().and_then(|samples| quantized_after_filter(curve, traced, samples));
            let ChannelTrace { fit, slowest, lines, signals, .. } = trace;
            without_leakage(lines, fit.after());
            quantized.into_iter().for_each(|quantized| fit.traced = quantized);
            // Before the spectrum shows the same process.
            signals.iter().filter_map(Signal::decays).for_each(|decays| fit.add_shot_noise(decays));
            let frequencies = || lines.iter().map(|line| line.frequency.value);
            slowest.iter().for_each(|spectrum| fit.add_markov_of_spectrum(spectrum, frequencies()));
        });
        Self { channels, filter }
    }

    /// Makes the terms of `first_half` those of this part, the whole, where the second half, `unseen`, does not contradict them.
    pub(crate) fn take_terms_that_held(&mut self, first_half: &Self, unseen: &RecordPart) {
        let filter = self.filter.as_ref().ok();
        let of_half: Vec<(ChannelId, &ChannelTrace)> = first_half.channels.with_ids().collect();
        parallel::for_each_pair(self.channels.as_mut_slice(), &of_half, |own, (channel, ChannelTrace { fit, .. })| {
            let held = || {
                let (model, signals) = (fit.after(), fit.signals.within([1.0, 2.0]));
                let curve = fit.covariates.compensated(unseen, *channel);
                Contradiction::find_by(model, &curve, |point| signals.predicted(model, point)).is_none()
            };
            if unseen.channels[*channel].quantity.is_inertial() && held() {
                own.fit.take_terms_that_held(&fit.traced, filter);
            }
        });
    }

    /// Completes the models with the lines of the spectrum that the curve does not resolve.
    pub(crate) fn add_lines_of_spectrum(&mut self) {
        parallel::for_each(self.channels.as_mut_slice(), |trace| {
            let lines: Vec<FittedTerm> = trace.lines.iter().map(MergedLine::fitted_term).collect();
            trace.fit.add_lines_of_spectrum(&lines);
        });
    }

    /// Gives the models the coefficients by all samples.
    pub(crate) fn take_coefficients_of_samples(&mut self) {
        let of = |channel: ChannelId| {
            let trace = &self.channels[channel];
            trace.samples().map(|samples| trace.fit.by_samples(samples, trace.samples_of_noise()))
        };
        let models = per_channel(self.channels.ids(), of);
        for (trace, models) in self.channels.iter_mut().zip(models) {
            models.into_iter().for_each(|models| trace.fit.take(models));
        }
    }

    /// Proposals of a channel's model, and the part of the curve that they leave unexplained; `common` is the drift shared with others.
    pub(crate) fn proposals(
        &self,
        profile: &SensorProfile,
        curves: &RecordPart,
        channel: ChannelId,
        common: Option<&ChannelsInCommon>,
    ) -> (Vec<Proposal>, ChannelFacts) {
        let ChannelTrace { fit, lines, rest, telegraph, .. } = &self.channels[channel];
        let sensitivities = || fit.covariates.sensitivities();
        let findings = ChannelFindings {
            channel: curves.channels[channel],
            resolution: curves.resolution(channel),
            fit,
            sensitivities: sensitivities().map(|(covariate, of)| (curves.channels[covariate], *of)).collect(),
            lines: rest.is_some().then_some(lines),
            telegraph: telegraph.as_ref(),
            common,
            rest: rest.as_ref(),
        };
        let in_steps = |(covariate, of): (ChannelId, &Sensitivity)| (of.value * curves.resolution(covariate)).powi(2);
        let of_covariates = sensitivities().map(in_steps).sum();
        let unexplained = unexplained::by_curve(fit, profile, curves.resolution(channel), of_covariates);
        let (mut proposals, facts) = propose(profile, &findings);
        proposals.extend(unexplained.map(|found| Proposal::new(found, Origin::Residual)));
        (proposals, facts)
    }
}

impl ChannelTrace {
    fn fit(part: &PartData, channel: ChannelId) -> Self {
        let PartData { profile, curves, samples } = part;
        let by_curve = || CovariateFit::estimate(curves, channel, false, |_| None);
        match samples {
            _ if !curves.channels[channel].quantity.is_inertial() => {
                Self::without_samples(ChannelFit::fit_baseline(by_curve()))
            }
            None => Self::without_samples(ChannelFit::fit_curve(by_curve(), &profile.filters)),
            Some(samples) => Self::fit_with_samples(profile, curves, samples, channel),
        }
    }

    /// The samples of the curve; `None` where they were not used.
    fn samples(&self) -> Option<SamplesOfCurve<'_>> {
        self.rest.as_ref().map(|rest| SamplesOfCurve { rest, spectrum: self.spectrum.as_ref() })
    }

    /// The same without signals; `None` where a line's frequency runs, which is in many of their frequencies.
    fn samples_of_noise(&self) -> Option<SamplesOfCurve<'_>> {
        let samples = self.samples().filter(|_| !self.fit.signals.has_run())?;
        Some(SamplesOfCurve { rest: self.noise.as_ref().unwrap_or(samples.rest), ..samples })
    }

    fn without_samples(fit: ChannelFit) -> Self {
        Self {
            fit,
            lines: Vec::new(),
            rest: None,
            noise: None,
            telegraph: None,
            signals: Vec::new(),
            slowest: None,
            spectrum: None,
        }
    }

    fn fit_with_samples(
        profile: &SensorProfile,
        curves: &RecordPart,
        samples: &PartSamples,
        channel: ChannelId,
    ) -> Self {
        let (own, bias) = (&samples.series[channel], &samples.biases[channel]);
        let covariates = CovariateFit::estimate(curves, channel, bias.has_ramp, |to| bias.sensitivity(to));
        let compensated = covariates.compensated_series(own, samples.series, own.span.end);
        let rest = UniformSeries::from_series(compensated.as_ref().unwrap_or(own));
        let rest = rest.with_rounding(covariates.rounding().clone());
        let samples_per_mean = samples.record.samples_per_mean;
        let shown = ShownBySamples::find(own, compensated.as_ref(), &rest, (profile, samples_per_mean));
        let faster = &samples.record.channels[channel].faster_lines;
        let (mut fit, lines) = fit_with_lines(covariates, &shown, profile, (samples_per_mean, faster));
        let correlation_times = || fit.correlation_times().collect::<Vec<f64>>();
        let telegraph = telegraph_noise(&rest, own.unit, &correlation_times());
        let found = SpectrumProposals::new(shown.signals, rest.duration(), lines, fit.bands());
        let found = standing_in_spectrum(found);
        let share = SignalShare::new(found.periodic.as_ref(), found.track.as_ref());
        let noise = found.periodic.as_ref().map(|periodic| periodic.subtracted_from(&rest));
        let (lines, signals) = found.into_lines_and_signals();
        if !share.is_empty() {
            let kinds: Vec<NoiseTerm> = lines.iter().map(MergedLine::kind).collect();
            let filters = profile.filters_read_at(1.0 / fit.curve.sample_period());
            fit = fit.beside(&share, &kinds, &filters);
        }
        let slowest = CosineSpectrum::new(noise.as_ref().unwrap_or(&rest));
        let spectrum = samples.record.spectrum_within(channel, own.span.clone());
        Self { fit, lines, rest: Some(rest), noise, telegraph, signals, slowest, spectrum }
    }
}

/// Two levels of a channel, which are there without its sinusoids too: these are near their extremes for most of the time.
fn telegraph_noise(series: &UniformSeries, unit: &'static str, correlation_times: &[f64]) -> Option<TelegraphNoise> {
    let find = |series: &UniformSeries| random_telegraph::find(series, unit, correlation_times);
    find(series).filter(|_| find(&without_sines(series.clone())).is_some())
}

/// Gives the models of the inertial channels in a part of a recording the filter that the sensor has once, as they show it together.
fn agree_on_filter(part: &PartData, channels: &mut PerChannel<ChannelTrace>) -> Result<PartFilter, Unidentified> {
    let PartData { profile, curves, .. } = part;
    let decimation = profile.internal_rate_hz * curves.sample_period();
    let inertial: Vec<ChannelId> =
        curves.channels.ids().filter(|&channel| curves.channels[channel].quantity.is_inertial()).collect();
    let filtered = |&channel: &ChannelId| {
        let trace = &channels[channel];
        Some(FilteredChannel {
            name: curves.channels[channel].name,
            curve: &trace.fit.curve,
            model: trace.fit.after(),
            is_dithered: trace.fit.is_dithered(profile, curves.resolution(channel), DITHERED_OCTAVES),
            // A line whose frequency runs is in few of the bands at a time.
            samples: trace.samples_of_noise().or_else(|| trace.samples())?,
            lines: trace.lines.iter().map(|line| line.frequency.value).collect(),
        })
    };
    let filtered: Vec<FilteredChannel> = inertial.iter().filter_map(filtered).collect();
    let filter = part_filter::estimate(&filtered, (&profile.filters, profile.may_be_low_pass), decimation);
    let mut dithered = vec![None; curves.channels.iter().len()];
    inertial.iter().zip(&filtered).for_each(|(channel, of)| dithered[channel.position()] = Some(of.is_dithered));
    let common = filter.as_ref().ok();
    parallel::for_each_pair(channels.as_mut_slice(), &dithered, |trace, is_dithered| {
        is_dithered.iter().for_each(|is_dithered| trace.fit.agree(common, *is_dithered));
    });
    filter
}

#[cfg(test)]
mod tests {
    use super::telegraph_noise;
    use crate::detectors::random_telegraph::tests::{PERIOD_S, series, telegraph};
    use std::f64::consts::TAU;

    /// A sinusoid of 108 periods is hidden in the noise of each sample, and between its extremes in that of each part.
    #[test]
    fn a_weak_sinusoid_is_no_telegraph_noise() {
        for amplitude in [0.3, 0.5, 0.8] {
            for seed in 40..60 {
                let sine = series(seed, |_, at| amplitude * (TAU * at as f64 * PERIOD_S / 3.7).sin());
                assert_eq!(telegraph_noise(&sine, "g", &[0.6]), None, "{amplitude} {seed}");
            }
        }
    }

    /// The spectrum of two levels falls with the square of the frequency where sinusoids are sought: of a time constant of 6 s beyond
    /// `400/(2π·6)`, 11 periods in the record, and of 10 s beyond 6.
    #[test]
    fn the_slope_of_a_telegraph_spectrum_is_no_sinusoid() {
        for time_s in [6.0, 10.0] {
            for seed in 60..80 {
                let found = telegraph_noise(&series(seed, telegraph(10.0, time_s)), "g", &[time_s])
                    .expect("levels ten deviations apart");
                // The interval holds half of what the jumps blur, several times the noise of a level, 0.1 % of the amplitude.
                let amplitude = found.amplitude.estimate();
                assert!((amplitude.low..=amplitude.high).contains(&10.0), "{time_s} {seed}: {found:?}");
            }
        }
    }
}
