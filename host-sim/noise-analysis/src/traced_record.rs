//! What all of a recording shows: the effects in the samples of each channel, the noise model of each channel with what its
//! baseline lacks, and the filter that the part has once.

use crate::channel_fit::{ChannelFit, DITHERED_OCTAVES, filter_length_s};
use crate::covariates::CovariateFit;
use crate::detectors::noise_grid::NoiseGrids;
use crate::detectors::random_telegraph;
use crate::estimators::RecordEstimators;
use crate::findings::{Detection, Effect};
use crate::motion::{self, PlatformMotion};
use crate::naming::{ChannelFindings, name_effects};
use crate::parallel::in_parallel;
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
use measurement::{ChannelProfile, Measurement, Quantity};

/// A recording with what was found in all of it.
pub(crate) struct TracedRecord<'a> {
    /// The samples, or those of a long record in means.
    pub measurement: &'a Measurement,
    /// Where `measurement` has means, what is known beside them.
    pub condensed: Option<Condensed<'a>>,
    /// The channels in which effects are traced: the inertial ones.
    pub traced: Vec<ChannelProfile>,
    /// Covariances of the block means of each channel's noise, computed once.
    pub noise_grids: NoiseGrids,
    pub preprocessing: Preprocessing,
    pub estimators: RecordEstimators,
    /// After preprocessing: of the traced channels, then of temperature and supply.
    pub series: Vec<Series>,
    /// In the order of the measurement's channels.
    pub channels: Vec<ChannelTrace>,
    /// The filter that the part has, by the whole record.
    pub filter: Result<PartFilter, Unidentified>,
    /// The channels of `series`.
    coupled: Vec<ChannelProfile>,
    motions: Vec<(ChannelProfile, PlatformMotion)>,
}

/// What is known of a long recording beside the means of its samples.
#[derive(Clone, Copy)]
pub(crate) struct Condensed<'a> {
    /// The averaging times that are too short for the means.
    pub shorter: &'a ShorterTimes,
    /// Of each channel of the measurement, the lines that the means do not show.
    pub faster_lines: &'a [Vec<MergedLine>],
}

/// The noise of one channel in all of a recording.
pub(crate) struct ChannelTrace {
    pub channel: ChannelProfile,
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

impl<'a> Condensed<'a> {
    /// The lines of a channel that the means of `measurement` do not show.
    pub(crate) fn faster_lines(&self, measurement: &Measurement, channel: ChannelProfile) -> &'a [MergedLine] {
        let position = measurement.profiles().position(|of| of == channel);
        position.and_then(|position| self.faster_lines.get(position)).map_or(&[], Vec::as_slice)
    }
}

impl<'a> TracedRecord<'a> {
    /// What `measurement` shows; where that has means, with what is known beside them.
    pub(crate) fn new(measurement: &'a Measurement, condensed: Option<Condensed<'a>>) -> Self {
        let shorter = condensed.map(|condensed| condensed.shorter);
        let of = |quantities: [Quantity; 2]| {
            quantities.into_iter().flat_map(|quantity| measurement.of_quantity(quantity)).collect::<Vec<_>>()
        };
        let traced = of([Quantity::AngularRate, Quantity::SpecificForce]);
        let coupled = [traced.clone(), of([Quantity::Temperature, Quantity::SupplyVoltage])].concat();
        let noise_grids = NoiseGrids::default();
        let preprocessing = Preprocessing::detect(measurement, shorter.is_some(), &traced, &noise_grids);
        let estimators = RecordEstimators::estimate(measurement, shorter, &coupled, &preprocessing);
        let moved = in_parallel(&traced, |channel| {
            motion::find(&preprocessing.measured(measurement, *channel), channel).map(|motion| (*channel, motion))
        });
        let series = in_parallel(&coupled, |&channel| preprocessing.series(measurement, channel, Exclusion::ByWhole));
        let recorded: Vec<ChannelProfile> = measurement.profiles().collect();
        let mut channels = in_parallel(&recorded, |&channel| match traced.iter().position(|of| *of == channel) {
            Some(own) => ChannelTrace::trace(measurement, condensed, &preprocessing, &estimators, &series, own),
            None => ChannelTrace::baseline(&estimators, channel),
        });
        let traces = channels.iter_mut().map(|trace| (trace.channel, &mut trace.fit));
        let filter = agree_on_filter(measurement, &estimators, traces.filter(|(channel, _)| traced.contains(channel)));
        for ChannelTrace { fit, slowest, lines, .. } in &mut channels {
            let frequencies = || lines.iter().map(|line| line.frequency.value);
            slowest.iter().for_each(|spectrum| fit.add_markov_of_spectrum(spectrum, frequencies()));
        }
        let distance_of_levels = |channel: ChannelProfile| {
            let telegraph = channels.iter().find(|trace| trace.channel == channel)?.telegraph.as_ref()?;
            telegraph.effect.parameters.get("amplitude").map(|amplitude| amplitude.value)
        };
        let motions = motion::of_platform(moved.into_iter().flatten().collect(), distance_of_levels);
        Self {
            measurement,
            condensed,
            traced,
            noise_grids,
            preprocessing,
            estimators,
            series,
            channels,
            filter,
            coupled,
            motions,
        }
    }

    /// Completes the models with the lines of the spectrum that the curve does not resolve.
    pub(crate) fn add_lines_of_spectrum(&mut self) {
        for trace in &mut self.channels {
            let lines: Vec<FittedTerm> = trace.lines.iter().map(MergedLine::fitted_term).collect();
            trace.fit.add_lines_of_spectrum(&lines);
        }
    }

    /// The series of the same channels as [`series`](Self::series), without the samples of `exclusion`.
    pub(crate) fn series_without(&self, exclusion: Exclusion) -> Vec<Series> {
        let coupled: Vec<(&ChannelProfile, &Series)> = self.coupled.iter().zip(&self.series).collect();
        in_parallel(&coupled, |&(&channel, whole)| {
            let is_same = self.preprocessing.leaves_the_same(channel, exclusion, Exclusion::ByWhole);
            if is_same { whole.clone() } else { self.preprocessing.series(self.measurement, channel, exclusion) }
        })
    }

    /// Whether the rules of the first half leave out samples of a channel.
    pub(crate) fn has_rules(&self, channel: ChannelProfile) -> bool {
        let shorter = self.condensed.and_then(|condensed| condensed.shorter.of(channel));
        let is_screened = shorter.is_some_and(|of| of.is_screened);
        is_screened || self.preprocessing.excludes(channel, Exclusion::ByFirstHalf)
    }

    /// The series of one channel, if it is among them.
    pub(crate) fn series_of(&self, channel: ChannelProfile) -> Option<&Series> {
        self.coupled.iter().position(|of| *of == channel).map(|position| &self.series[position])
    }

    /// Stretches in which the platform did not move.
    pub(crate) fn at_rest(&self) -> Vec<Stretch> {
        let duration_s = self.measurement.periods() as f64 * self.measurement.period_s();
        motion::at_rest(self.motions.iter().map(|(_, motion)| motion), duration_s)
    }

    /// The effects of each channel, in the order of the channels.
    pub(crate) fn effects(&self) -> Vec<Vec<Effect>> {
        let commons = common_modes(&self.channels);
        self.channels
            .iter()
            .map(|trace| {
                let common = commons.iter().find(|common| common.channels.contains(&trace.channel));
                if self.traced.contains(&trace.channel) { self.effects_of(trace, common) } else { Vec::new() }
            })
            .collect()
    }

    fn effects_of(&self, trace: &ChannelTrace, common: Option<&ChannelsInCommon>) -> Vec<Effect> {
        let Self { preprocessing, estimators, measurement, .. } = self;
        let channel = trace.channel;
        let moved = self.motions.iter().filter(|(of, _)| *of == channel);
        let mut effects: Vec<Effect> = moved.map(|(_, motion)| motion.effect.clone()).collect();
        effects.extend(preprocessing.effects(channel));
        // The longest octaves of the curve see a sinusoid of a few periods as a ramp.
        let has_ramp = preprocessing.has_ramp(channel) || trace.lines.iter().any(MergedLine::is_slow);
        let mut named = name_effects(&measurement.profile, &trace.findings(estimators, common));
        // The response that is not proportional has the sensitivity too.
        let responds = preprocessing.responds_to_temperature(channel);
        named.retain(|effect| !responds || effect.kind != "temperature");
        let is_ramp = |effect: &Effect| {
            let slope = effect.parameters.get("slope").map_or(0.0, |slope| slope.value);
            !has_ramp && self.series_of(channel).is_some_and(|own| goes_as_far_as_ramp(own, slope))
        };
        let is_named = |effect: &Effect| effect.kind != NoiseTerm::RateRamp.name() || is_ramp(effect);
        effects.extend(named.into_iter().filter(is_named));
        let resolution = estimators.both.resolution_of(channel);
        let in_steps =
            |(position, of): (usize, &Sensitivity)| (of.value * estimators.both.resolution(position)).powi(2);
        let of_covariates = trace.fit.covariates.sensitivities().map(in_steps).sum();
        let by_curve = unexplained::by_curve(&trace.fit, &measurement.profile, resolution, of_covariates);
        if let Some(unexplained) = &by_curve {
            effects.retain(|effect| !unexplained::is_contradicted(effect, unexplained));
        }
        effects.extend(by_curve);
        effects.retain(|effect| !trace.signals.has(effect, &trace.lines));
        effects.extend(trace.signals.effects());
        let own = self.series_of(channel);
        let temperature = self.coupled.iter().position(|of| of.quantity == Quantity::Temperature);
        let level = own.zip(temperature).and_then(|(own, at)| unexplained::level_by_temperature(own, &self.series[at]));
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
}

impl ChannelTrace {
    /// The baseline model alone.
    fn baseline(estimators: &RecordEstimators, channel: ChannelProfile) -> Self {
        let position = estimators.both.position(channel).unwrap_or_default();
        let covariates = CovariateFit::estimate(&estimators.both, position, false, |_| None);
        let fit = ChannelFit::fit_baseline(covariates);
        Self {
            channel,
            fit,
            lines: Vec::new(),
            telegraph: None,
            rest: None,
            slowest: None,
            signals: UnexplainedSignals::default(),
        }
    }

    /// The baseline model and what it lacks, of the channel of `series[own]`.
    fn trace(
        measurement: &Measurement,
        condensed: Option<Condensed>,
        preprocessing: &Preprocessing,
        estimators: &RecordEstimators,
        series: &[Series],
        own: usize,
    ) -> Self {
        let channel = estimators.both.channels[own];
        let covariates = CovariateFit::estimate(&estimators.both, own, preprocessing.has_ramp(channel), |regressor| {
            preprocessing.sensitivity(channel, regressor)
        });
        let own = &series[own];
        let rest = covariates.compensated_series(own, series);
        let faster = condensed.map(|condensed| condensed.faster_lines(measurement, channel));
        let (fit, mut lines) = fit_with_lines(covariates, own, rest.as_ref(), &measurement.profile, faster);
        let correlation_times: Vec<f64> = fit.correlation_times().collect();
        let rest = UniformSeries::from_series(rest.as_ref().unwrap_or(own));
        let is_reversible =
            |found: &Detection| random_telegraph::is_reversible(&rest, found.effect.parameters["time_constant"].value);
        let telegraph = random_telegraph::find(&rest, channel.unit, &correlation_times).filter(is_reversible);
        let slowest = CosineSpectrum::new(&rest);
        let signals = UnexplainedSignals::find(&rest, &mut lines, &fit.bands());
        Self { channel, fit, lines, telegraph, rest: Some(rest), slowest, signals }
    }

    fn findings<'a>(
        &'a self,
        estimators: &RecordEstimators,
        common: Option<&'a ChannelsInCommon>,
    ) -> ChannelFindings<'a> {
        let both = &estimators.both;
        let sensitivities = self.fit.covariates.sensitivities();
        ChannelFindings {
            channel: self.channel,
            resolution: both.resolution_of(self.channel),
            fit: &self.fit,
            sensitivities: sensitivities.map(|(position, of)| (both.channels[position], *of)).collect(),
            lines: Some(&self.lines),
            telegraph: self.telegraph.as_ref(),
            common,
            rest: self.rest.as_ref(),
        }
    }
}

/// Gives `fits` of channels in one part of a recording the filter that the part of the sensor has once, as they show it
/// together.
pub(crate) fn agree_on_filter<'f>(
    measurement: &Measurement,
    estimators: &RecordEstimators,
    fits: impl Iterator<Item = (ChannelProfile, &'f mut ChannelFit)>,
) -> Result<PartFilter, Unidentified> {
    let profile = &measurement.profile;
    let decimation = profile.internal_rate_hz * estimators.both.sample_period();
    let mut fits: Vec<(ChannelProfile, &mut ChannelFit)> = fits.collect();
    let channels: Vec<FilteredChannel> = fits
        .iter()
        .map(|(channel, fit)| {
            let resolution = estimators.both.resolution_of(*channel);
            FilteredChannel {
                name: channel.name,
                curve: &fit.covariates.curve,
                model: &fit.trace.after,
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

/// The drift that the gyroscopes have in common, and that of the accelerometers.
fn common_modes(channels: &[ChannelTrace]) -> Vec<ChannelsInCommon> {
    let filter_s = channels.iter().map(|trace| filter_length_s(&trace.fit.trace.after)).fold(0.0, f64::max);
    let of_quantity = |quantity: &Quantity| {
        let members = channels.iter().filter(|trace| trace.channel.quantity == *quantity);
        let (profiles, rests): (Vec<ChannelProfile>, Vec<UniformSeries>) =
            members.filter_map(|trace| Some((trace.channel, trace.rest.clone()?))).unzip();
        common_mode(&profiles, &rests, filter_s)
    };
    in_parallel(&[Quantity::AngularRate, Quantity::SpecificForce], of_quantity).into_iter().flatten().collect()
}
