//! What all of a recording shows: the effects in the samples of each channel, the noise model of each channel with what its
//! baseline lacks, and the filter that the part has once.

use crate::channel_fit::{ChannelFit, DITHERED_OCTAVES};
use crate::covariates::CovariateFit;
use crate::detectors::noise_grid::NoiseGrids;
use crate::detectors::random_telegraph;
use crate::estimators::RecordEstimators;
use crate::findings::{Detection, Effect};
use crate::motion::{self, PlatformMotion};
use crate::naming::{ChannelFindings, name_effects};
use crate::noise_terms::filter_length_s;
use crate::parallel::{in_parallel, per_channel};
use crate::part_filter::{self, FilteredChannel, PartFilter, Unidentified};
use crate::preprocessing::{Exclusion, Preprocessing};
use crate::report::Stretch;
use crate::series::Series;
use crate::shorter_times::ShorterTimes;
use crate::slow_drift::{ChannelsInCommon, common_mode, goes_as_far_as_ramp};
use crate::spectra::cosine_spectrum::CosineSpectrum;
use crate::spectral_lines::{MergedLine, fit_with_lines};
use crate::unexplained;
use crate::unexplained_signals::UnexplainedSignals;
use crate::uniform_series::UniformSeries;
use allan_core::NoiseTerm;
use allan_core::model::FittedTerm;
use allan_core::regression::Sensitivity;
use measurement::{ChannelId, Measurement, PerChannel, Quantity};

/// A recording with what was found in all of it.
pub(crate) struct TracedRecord<'a> {
    /// The samples, or those of a long record in means.
    pub measurement: &'a Measurement,
    /// Where `measurement` has means, what is known beside them.
    pub condensed: Option<Condensed<'a>>,
    /// Covariances of the block means of each channel's noise, computed once.
    pub noise_grids: NoiseGrids,
    pub preprocessing: Preprocessing,
    pub estimators: RecordEstimators,
    /// After preprocessing.
    pub series: PerChannel<Series>,
    pub channels: PerChannel<ChannelTrace>,
    /// The filter that the part has, by the whole record.
    pub filter: Result<PartFilter, Unidentified>,
    motions: PerChannel<Option<PlatformMotion>>,
}

/// What is known of a long recording beside the means of its samples.
#[derive(Clone, Copy)]
pub(crate) struct Condensed<'a> {
    /// The averaging times that are too short for the means.
    pub shorter: &'a ShorterTimes,
    /// The lines that the means do not show.
    pub faster_lines: &'a PerChannel<Vec<MergedLine>>,
}

/// The noise of one channel in all of a recording.
pub(crate) struct ChannelTrace {
    pub fit: ChannelFit,
    /// Lines in the spectrum.
    pub lines: Vec<MergedLine>,
    /// Random telegraph noise.
    telegraph: Option<Detection>,
    /// The samples less the share of the covariates; of a traced channel only.
    rest: Option<UniformSeries>,
    slowest: Option<CosineSpectrum>,
    /// Signals that have no name.
    signals: UnexplainedSignals,
}

impl<'a> TracedRecord<'a> {
    /// What `measurement` shows; where that has means, with what is known beside them.
    pub(crate) fn new(measurement: &'a Measurement, condensed: Option<Condensed<'a>>) -> Self {
        let shorter = condensed.map(|condensed| condensed.shorter);
        let environment = measurement.ids().filter(|&channel| measurement[channel].profile.quantity.is_environment());
        let coupled: Vec<ChannelId> = measurement.inertial().chain(environment).collect();
        let noise_grids = NoiseGrids::default();
        let preprocessing = Preprocessing::detect(measurement, shorter.is_some(), &noise_grids);
        let estimators = RecordEstimators::estimate(measurement, shorter, &coupled, &preprocessing);
        let moved = per_channel(measurement.ids(), |channel| {
            let profile = &measurement[channel].profile;
            let is_traced = profile.quantity.is_inertial();
            is_traced.then(|| motion::find(&preprocessing.measured(measurement, channel), profile)).flatten()
        });
        let series =
            per_channel(measurement.ids(), |channel| preprocessing.series(measurement, channel, Exclusion::ByWhole));
        let mut channels = per_channel(measurement.ids(), |channel| {
            if measurement[channel].profile.quantity.is_inertial() {
                ChannelTrace::trace(measurement, condensed, &preprocessing, &estimators, &series, channel)
            } else {
                ChannelTrace::baseline(&estimators, channel)
            }
        });
        let fits = measurement.ids().zip(channels.iter_mut().map(|trace| &mut trace.fit));
        let filter = agree_on_filter(measurement, &estimators, fits);
        for ChannelTrace { fit, slowest, lines, .. } in &mut channels {
            let frequencies = || lines.iter().map(|line| line.frequency.value);
            slowest.iter().for_each(|spectrum| fit.add_markov_of_spectrum(spectrum, frequencies()));
        }
        let distance_of_levels = |channel: ChannelId| {
            let telegraph = channels[channel].telegraph.as_ref()?;
            telegraph.effect.parameters.get("amplitude").map(|amplitude| amplitude.value)
        };
        let motions = motion::of_platform(moved, distance_of_levels);
        Self { measurement, condensed, noise_grids, preprocessing, estimators, series, channels, filter, motions }
    }

    /// Whether effects are traced in a channel: in the inertial ones.
    pub(crate) fn is_traced(&self, channel: ChannelId) -> bool {
        self.measurement[channel].profile.quantity.is_inertial()
    }

    /// Completes the models with the lines of the spectrum that the curve does not resolve.
    pub(crate) fn add_lines_of_spectrum(&mut self) {
        for trace in &mut self.channels {
            let lines: Vec<FittedTerm> = trace.lines.iter().map(MergedLine::fitted_term).collect();
            trace.fit.add_lines_of_spectrum(&lines);
        }
    }

    /// The series of the channels, without the samples of `exclusion`.
    pub(crate) fn series_without(&self, exclusion: Exclusion) -> PerChannel<Series> {
        per_channel(self.series.ids(), |channel| {
            let is_same = self.preprocessing.leaves_the_same(channel, exclusion, Exclusion::ByWhole);
            let other = || self.preprocessing.series(self.measurement, channel, exclusion);
            if is_same { self.series[channel].clone() } else { other() }
        })
    }

    /// Whether the rules of the first half leave out samples of a channel.
    pub(crate) fn has_rules(&self, channel: ChannelId) -> bool {
        let is_screened = self.condensed.is_some_and(|of| of.shorter.channels[channel].is_screened);
        is_screened || self.preprocessing.excludes(channel, Exclusion::ByFirstHalf)
    }

    /// Stretches in which the platform did not move.
    pub(crate) fn at_rest(&self) -> Vec<Stretch> {
        let duration_s = self.measurement.periods() as f64 * self.measurement.period_s();
        motion::at_rest(self.motions.iter().flatten(), duration_s)
    }

    /// The effects of each channel.
    pub(crate) fn effects(&self) -> PerChannel<Vec<Effect>> {
        let commons = self.common_modes();
        let of = |channel: ChannelId| {
            let common = commons.iter().find(|common| common.channels.contains(&channel));
            if self.is_traced(channel) { self.effects_of(channel, common) } else { Vec::new() }
        };
        self.channels.ids().map(of).collect()
    }

    fn effects_of(&self, channel: ChannelId, common: Option<&ChannelsInCommon>) -> Vec<Effect> {
        let Self { preprocessing, estimators, measurement, .. } = self;
        let (trace, own) = (&self.channels[channel], &self.series[channel]);
        let mut effects: Vec<Effect> = self.motions[channel].iter().map(|motion| motion.effect.clone()).collect();
        effects.extend(preprocessing.effects(channel));
        // The longest octaves of the curve see a sinusoid of a few periods as a ramp.
        let has_ramp = preprocessing.has_ramp(channel) || trace.lines.iter().any(MergedLine::is_slow);
        let mut named = name_effects(&measurement.profile, &self.findings(channel, common));
        // The response that is not proportional has the sensitivity too.
        let responds = preprocessing.responds_to_temperature(channel);
        named.retain(|effect| !responds || effect.kind != "temperature");
        let is_ramp = |effect: &Effect| {
            let slope = effect.parameters.get("slope").map_or(0.0, |slope| slope.value);
            !has_ramp && goes_as_far_as_ramp(own, slope)
        };
        let is_named = |effect: &Effect| effect.kind != NoiseTerm::RateRamp.name() || is_ramp(effect);
        effects.extend(named.into_iter().filter(is_named));
        let resolution = estimators.both.resolution(channel);
        let in_steps =
            |(covariate, of): (ChannelId, &Sensitivity)| (of.value * estimators.both.resolution(covariate)).powi(2);
        let of_covariates = trace.fit.covariates.sensitivities().map(in_steps).sum();
        let by_curve = unexplained::by_curve(&trace.fit, &measurement.profile, resolution, of_covariates);
        if let Some(unexplained) = &by_curve {
            effects.retain(|effect| !unexplained::is_contradicted(effect, unexplained));
        }
        effects.extend(by_curve);
        effects.retain(|effect| !trace.signals.has(effect, &trace.lines));
        effects.extend(trace.signals.effects());
        let temperature = measurement.of_quantity(Quantity::Temperature).next();
        let level = temperature.and_then(|of| unexplained::level_by_temperature(own, &self.series[of]));
        if level.is_some() {
            // The limit above which a sample is a spike is that of a constant level.
            effects.retain(|effect| effect.kind != "spikes");
        }
        effects.extend(level);
        // Jumps to and fro from one sample to the next.
        let telegraph = effects.iter().find(|effect| effect.kind == "telegraph").cloned();
        let is_visit = |effect: &Effect| {
            let explains = |telegraph| random_telegraph::explains_spikes(telegraph, effect, measurement.period_s());
            effect.kind == "spikes" && telegraph.as_ref().is_some_and(explains)
        };
        effects.retain(|effect| !is_visit(effect));
        effects
    }

    fn findings<'f>(&'f self, channel: ChannelId, common: Option<&'f ChannelsInCommon>) -> ChannelFindings<'f> {
        let (trace, both) = (&self.channels[channel], &self.estimators.both);
        let sensitivities = trace.fit.covariates.sensitivities();
        ChannelFindings {
            channel: both.channels[channel],
            resolution: both.resolution(channel),
            fit: &trace.fit,
            sensitivities: sensitivities.map(|(covariate, of)| (both.channels[covariate], *of)).collect(),
            lines: Some(&trace.lines),
            telegraph: trace.telegraph.as_ref(),
            common,
            rest: trace.rest.as_ref(),
        }
    }

    /// The drift that the gyroscopes have in common, and that of the accelerometers.
    fn common_modes(&self) -> Vec<ChannelsInCommon> {
        let filter_s = self.channels.iter().map(|trace| filter_length_s(trace.fit.after())).fold(0.0, f64::max);
        let of_quantity = |quantity: &Quantity| {
            let named = |channel: ChannelId| (channel, self.measurement[channel].profile.name);
            let rest = |channel: ChannelId| Some((named(channel), self.channels[channel].rest.clone()?));
            let (channels, rests): (Vec<_>, Vec<UniformSeries>) =
                self.measurement.of_quantity(*quantity).filter_map(rest).unzip();
            common_mode(&channels, &rests, filter_s)
        };
        in_parallel(&[Quantity::AngularRate, Quantity::SpecificForce], of_quantity).into_iter().flatten().collect()
    }
}

impl ChannelTrace {
    /// The baseline model alone.
    fn baseline(estimators: &RecordEstimators, channel: ChannelId) -> Self {
        let covariates = CovariateFit::estimate(&estimators.both, channel, false, |_| None);
        let fit = ChannelFit::fit_baseline(covariates);
        Self {
            fit,
            lines: Vec::new(),
            telegraph: None,
            rest: None,
            slowest: None,
            signals: UnexplainedSignals::default(),
        }
    }

    /// The baseline model and what it lacks.
    fn trace(
        measurement: &Measurement,
        condensed: Option<Condensed>,
        preprocessing: &Preprocessing,
        estimators: &RecordEstimators,
        series: &PerChannel<Series>,
        channel: ChannelId,
    ) -> Self {
        let has_ramp = preprocessing.has_ramp(channel);
        let covariates = CovariateFit::estimate(&estimators.both, channel, has_ramp, |regressor| {
            preprocessing.sensitivity(channel, regressor)
        });
        let own = &series[channel];
        let rest = covariates.compensated_series(own, series);
        let faster = condensed.map(|condensed| condensed.faster_lines[channel].as_slice());
        let (fit, mut lines) = fit_with_lines(covariates, own, rest.as_ref(), &measurement.profile, faster);
        let correlation_times: Vec<f64> = fit.correlation_times().collect();
        let rest = UniformSeries::from_series(rest.as_ref().unwrap_or(own));
        let is_reversible =
            |found: &Detection| random_telegraph::is_reversible(&rest, found.effect.parameters["time_constant"].value);
        let telegraph = random_telegraph::find(&rest, own.unit, &correlation_times).filter(is_reversible);
        let slowest = CosineSpectrum::new(&rest);
        let signals = UnexplainedSignals::find(&rest, &mut lines, &fit.bands());
        Self { fit, lines, telegraph, rest: Some(rest), slowest, signals }
    }
}

/// Gives the `fits` of the inertial channels in one part of a recording the filter that the sensor has once, as they show it
/// together.
pub(crate) fn agree_on_filter<'f>(
    measurement: &Measurement,
    estimators: &RecordEstimators,
    fits: impl Iterator<Item = (ChannelId, &'f mut ChannelFit)>,
) -> Result<PartFilter, Unidentified> {
    let profile = &measurement.profile;
    let decimation = profile.internal_rate_hz * estimators.both.sample_period();
    let is_inertial = |channel: ChannelId| measurement[channel].profile.quantity.is_inertial();
    let mut fits: Vec<(ChannelId, &mut ChannelFit)> = fits.filter(|(channel, _)| is_inertial(*channel)).collect();
    let channels: Vec<FilteredChannel> = fits
        .iter()
        .map(|(channel, fit)| {
            let resolution = estimators.both.resolution(*channel);
            FilteredChannel {
                name: measurement[*channel].profile.name,
                curve: &fit.covariates.curve,
                model: fit.after(),
                resolution,
                is_dithered: fit.is_dithered(profile, resolution, DITHERED_OCTAVES),
            }
        })
        .collect();
    let filter = part_filter::estimate(&channels, &profile.filters, decimation);
    let dithered: Vec<bool> = channels.iter().map(|channel| channel.is_dithered).collect();
    for ((_, fit), is_dithered) in fits.iter_mut().zip(dithered) {
        fit.agree(filter.as_ref().ok(), is_dithered);
    }
    filter
}
