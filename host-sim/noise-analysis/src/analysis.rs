//! The pipeline from a recording to its report.
//!
//! Effects are named on the whole record. The errors before and after come from models of the first half alone, compared
//! with the second half, both by time: as it was recorded, and without what the rules for spikes and knocks exclude that were
//! fitted to the first half.

use crate::OCTAVES;
use crate::assessment::{AssessedModels, Assessment};
use crate::causes;
use crate::channel_fit::{ChannelFit, DITHERED_OCTAVES};
use crate::contradiction::Contradiction;
use crate::covariates::CovariateFit;
use crate::detectors::block_means::NoiseGrids;
use crate::detectors::{bias, random_telegraph};
use crate::estimators::{RecordEstimators, RecordPart};
use crate::figure_data;
use crate::findings::{Detection, Effect};
use crate::motion::{self, PlatformMotion};
use crate::naming::{ChannelFindings, name_effects};
use crate::nonstationarity::{self, ChannelEpochs, CommonModeRegression, EpochCurves, Nonstationarity, TracedChannel};
use crate::part_filter::{self, FilteredChannel, PartFilter, Unidentified};
use crate::part_report;
use crate::preprocessing::{Exclusion, Preprocessing, in_parallel};
use crate::report::{
    ChannelReport, CurvePoint, FigureData, MissingSamples, ModelErrorReport, ModelReport, PartReport, Report, SCHEMA,
    SlopeMethodReport, term_reports,
};
use crate::series::Series;
use crate::slow_drift::{ChannelsInCommon, common_mode, goes_as_far_as_ramp};
use crate::spectra::allan_deviations_by_spectrum;
use crate::spectral_lines::{MergedLine, fit_with_lines};
use crate::unexplained;
use crate::uniform_series::UniformSeries;
use allan_core::{AllanPoint, Curve, Model, NoiseTerm};
use measurement::{ChannelProfile, Measurement, Quantity, SensorProfile};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Analyses every channel of a measurement. Effects are traced in the inertial channels only; the others get the baseline
/// model.
#[must_use]
pub fn analyze(measurement: &Measurement) -> Report {
    let (mut channels, part) = analyze_channels(measurement, Extent::Report);
    // What the first half shows by itself, to compare with what the whole record shows.
    let has_effects = channels.iter().any(|channel| !channel.effects.is_empty());
    let first_half = if has_effects {
        analyze_channels(&measurement.before(measurement.middle()), Extent::Effects).0
    } else {
        Vec::new()
    };
    let duration_s = measurement.periods() as f64 * measurement.period_s();
    let findings = causes::find(&mut channels, &first_half, &measurement.profile, duration_s);
    let mut report = Report {
        schema: SCHEMA,
        sample_rate_hz: measurement.sample_rate_hz,
        samples: measurement.len() as u64,
        dropped: by_cause(&measurement.dropped),
        flagged: by_cause(&measurement.flagged),
        part,
        findings,
        common_mode: common_mode_regression(measurement, &channels),
        channels,
    };
    figure_data::set(&mut report, measurement);
    report
}

fn by_cause(counts: &BTreeMap<&'static str, u64>) -> BTreeMap<String, u64> {
    counts.iter().map(|(&cause, &count)| (cause.to_owned(), count)).collect()
}

/// What an analysis is for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Extent {
    /// Everything that a report has.
    Report,
    /// The effects alone.
    Effects,
}

/// The drift that the channels whose noise was followed have in common.
fn common_mode_regression(measurement: &Measurement, channels: &[ChannelReport]) -> Option<CommonModeRegression> {
    let is_followed =
        |profile: &ChannelProfile| channels.iter().any(|of| of.name == profile.name && of.nonstationarity.is_some());
    let followed: Vec<ChannelProfile> = measurement.profiles().filter(is_followed).collect();
    CommonModeRegression::estimate(measurement, &followed)
}

fn analyze_channels(measurement: &Measurement, extent: Extent) -> (Vec<ChannelReport>, PartReport) {
    let of = |quantities: [Quantity; 2]| {
        quantities.into_iter().flat_map(|quantity| measurement.of_quantity(quantity)).collect::<Vec<_>>()
    };
    let traced = of([Quantity::AngularRate, Quantity::SpecificForce]);
    let coupled = [traced.clone(), of([Quantity::Temperature, Quantity::SupplyVoltage])].concat();
    let profile = &measurement.profile;
    let noise_grids = NoiseGrids::default();
    let preprocessing = Preprocessing::detect(measurement, &traced, &noise_grids);
    let recorded: Vec<ChannelProfile> = measurement.profiles().collect();
    let estimators = RecordEstimators::estimate(measurement, &coupled, &preprocessing);
    let series_without =
        |exclusion: Exclusion| in_parallel(&coupled, |&channel| preprocessing.series(measurement, channel, exclusion));
    let motions: Vec<(ChannelProfile, PlatformMotion)> = traced
        .iter()
        .filter_map(|channel| Some((*channel, motion::find(&Series::from_measurement(measurement, channel), channel)?)))
        .collect();
    let duration_s = measurement.periods() as f64 * measurement.period_s();
    let at_rest = motion::at_rest(motions.iter().map(|(_, motion)| motion), duration_s);
    let series = series_without(Exclusion::ByWhole);
    let by_first_half = series_without(Exclusion::ByFirstHalf);
    let first_half: Vec<Series> = by_first_half.iter().map(|series| series.before(measurement.middle())).collect();
    let preprocessed = Preprocessed {
        profile,
        estimators: &estimators,
        preprocessing: &preprocessing,
        series: &series,
        first_half: &first_half,
        by_first_half: &by_first_half,
        middle: measurement.middle(),
    };
    let analyses = in_parallel(&recorded, |&channel| match traced.iter().position(|of| *of == channel) {
        Some(position) => ChannelAnalysis::trace(&preprocessed, channel, position, &noise_grids),
        None => ChannelAnalysis::baseline(&preprocessed, channel),
    });
    let mut analyses: Vec<(ChannelProfile, ChannelAnalysis)> = recorded.into_iter().zip(analyses).collect();
    let common = agree_on_filter(measurement, &estimators, &traced, &mut analyses);
    let assessments = in_parallel(&analyses, |(channel, analysis)| {
        let own = match traced.iter().position(|of| of == channel) {
            Some(position) => Cow::Borrowed(&series[position]),
            None => Cow::Owned(Series::from_measurement(measurement, channel)),
        };
        Assessed {
            assessment: Assessment::new(&own, analysis.assessed_models()),
            by_spectrum: by_spectrum(measurement, channel),
        }
    });
    let nonstationarities = match extent {
        Extent::Report => nonstationarities(&traced, &by_first_half, &analyses),
        Extent::Effects => Vec::new(),
    };
    let commons = common_modes(&analyses);
    let avar_of = |of: ChannelProfile, n: u64| {
        let position = analyses.iter().position(|(channel, _)| *channel == of)?;
        estimators.measured[position].points().iter().find(|point| point.n == n).map(|point| point.avar)
    };
    let report = |(((channel, analysis), measured), assessed): (
        (&(ChannelProfile, ChannelAnalysis), &Curve<OCTAVES>),
        Assessed,
    )| {
        let unit = channel.unit;
        let mut effects: Vec<Effect> = Vec::new();
        if traced.contains(channel) {
            let moved = motions.iter().filter(|(of, _)| of == channel);
            effects.extend(moved.map(|(_, motion)| motion.effect.clone()));
            effects.extend(preprocessing.effects(*channel));
            // The longest octaves of the curve see a sinusoid of a few periods as a ramp.
            let has_ramp = preprocessing.has_ramp(*channel) || analysis.lines.iter().any(MergedLine::is_slow);
            let common = commons.iter().find(|common| common.channels.contains(channel));
            let mut named = name_effects(profile, &analysis.findings(&estimators.both, *channel, common));
            // The response that is not proportional has the sensitivity too.
            let responds = preprocessing.responds_to_temperature(*channel);
            named.retain(|effect| !responds || effect.kind != "temperature");
            let own = traced.iter().position(|of| of == channel).map(|position| &series[position]);
            let is_ramp = |effect: &Effect| {
                let slope = effect.parameters.get("slope").map_or(0.0, |slope| slope.value);
                !has_ramp && own.is_some_and(|own| goes_as_far_as_ramp(own, slope))
            };
            let is_named = |effect: &Effect| effect.kind != NoiseTerm::RateRamp.name() || is_ramp(effect);
            effects.extend(named.into_iter().filter(is_named));
            effects.extend(unexplained::by_curve(&analysis.both, profile, estimators.both.resolution_of(*channel)));
        }
        let whole = measured.clone().with_confidence(|point| analysis.first.trace.before.variance_fractions(point.n));
        let after = analysis.after(&estimators, &preprocessing, *channel, &whole, avar_of);
        let refitted = analysis.refitted(&estimators, *channel, &whole, &after, avar_of);
        ChannelReport {
            name: channel.name.to_owned(),
            unit: unit.to_owned(),
            samples: measurement.len() as u64,
            missing: missing_samples(measurement, &preprocessing, &estimators.both, *channel),
            curve: whole
                .points()
                .iter()
                .map(|point| curve_point(point, whole.samples(), &assessed.by_spectrum))
                .collect(),
            read_off: SlopeMethodReport::from_curve(&whole, unit),
            before: analysis.before(&estimators, &preprocessing, *channel, &whole),
            first_half_curve: analysis.first_half_curve(&estimators, *channel),
            after,
            refitted,
            nonstationarity: traced
                .iter()
                .position(|of| of == channel)
                .and_then(|position| nonstationarities.get(position)?.clone()),
            at_rest: at_rest.clone(),
            effects,
            assessment: assessed.assessment,
            figure_data: FigureData::default(),
        }
    };
    let channels = analyses.iter().zip(&estimators.measured).zip(assessments).map(report).collect();
    (channels, part_report::report(measurement, &common))
}

/// Gives the fits of all channels `traced` the filter that the sensor has once: those of the whole record by the whole record,
/// those of the first half by the first half. Returns that of the whole record.
fn agree_on_filter(
    measurement: &Measurement,
    estimators: &RecordEstimators,
    traced: &[ChannelProfile],
    analyses: &mut [(ChannelProfile, ChannelAnalysis)],
) -> Result<PartFilter, Unidentified> {
    let profile = &measurement.profile;
    let decimation = profile.internal_rate_hz / measurement.sample_rate_hz;
    let agree = |analyses: &mut [(ChannelProfile, ChannelAnalysis)],
                 of: fn(&mut ChannelAnalysis) -> &mut ChannelFit| {
        let mut fits: Vec<(&ChannelProfile, &mut ChannelFit)> = analyses
            .iter_mut()
            .filter(|(channel, _)| traced.contains(channel))
            .map(|(channel, analysis)| (&*channel, of(analysis)))
            .collect();
        let resolution = |channel: &ChannelProfile| estimators.both.resolution_of(*channel);
        let filtered = |(channel, fit): &(&'_ ChannelProfile, &mut ChannelFit)| {
            let resolution = resolution(channel);
            fit.is_dithered(profile, resolution, DITHERED_OCTAVES)
        };
        let dithered: Vec<bool> = fits.iter().map(filtered).collect();
        let channels: Vec<FilteredChannel> = fits
            .iter()
            .zip(&dithered)
            .map(|((channel, fit), &is_dithered)| FilteredChannel {
                name: channel.name,
                curve: &fit.covariates.curve,
                model: &fit.trace.after,
                resolution: resolution(channel),
                is_dithered,
            })
            .collect();
        let common = part_filter::estimate(&channels, &profile.filters, decimation);
        for ((_, fit), is_dithered) in fits.iter_mut().zip(dithered) {
            fit.agree(common.as_ref().ok(), is_dithered);
        }
        common
    };
    let _of_first_half = agree(analyses, |analysis| &mut analysis.first);
    for (_, analysis) in analyses.iter_mut() {
        analysis.fit_to_recent();
    }
    let common = agree(analyses, |analysis| &mut analysis.both);
    for (channel, analysis) in analyses.iter_mut().filter(|(channel, _)| traced.contains(channel)) {
        analysis.refit(estimators, *channel, common.as_ref().ok());
    }
    common
}

/// How the noise of each channel of `traced` changes; `series` are theirs, without what the rules of the first half exclude.
fn nonstationarities(
    traced: &[ChannelProfile],
    series: &[Series],
    analyses: &[(ChannelProfile, ChannelAnalysis)],
) -> Vec<Option<Nonstationarity>> {
    let channels: Vec<TracedChannel> = traced
        .iter()
        .zip(series)
        .filter_map(|(profile, series)| {
            let (_, analysis) = analyses.iter().find(|(of, _)| of == profile)?;
            Some(TracedChannel {
                name: profile.name,
                series,
                epochs: analysis.epochs.as_ref(),
                baseline: &analysis.first.trace.before,
                model: &analysis.first.trace.after,
            })
        })
        .collect();
    let positions: Vec<usize> = (0..channels.len()).collect();
    in_parallel(&positions, |&position| nonstationarity::describe(&channels, position))
}

/// What the samples of a channel say beside its fits.
struct Assessed {
    assessment: Assessment,
    /// The Allan deviation by the measured spectrum at each octave.
    by_spectrum: Vec<Option<f64>>,
}

/// The Allan deviation by the spectrum of the samples of a channel as they were recorded, as the measured curve is.
fn by_spectrum(measurement: &Measurement, channel: &ChannelProfile) -> Vec<Option<f64>> {
    let factors: Vec<u64> = (0..OCTAVES).map(|octave| 1 << octave).collect();
    let recorded = UniformSeries::from_series(&Series::from_measurement(measurement, channel));
    allan_deviations_by_spectrum(&recorded, &factors)
}

fn curve_point(point: &AllanPoint, samples: u64, by_spectrum: &[Option<f64>]) -> CurvePoint {
    let adev_by_spectrum = by_spectrum.get(point.n.ilog2() as usize).copied().flatten();
    CurvePoint { adev_by_spectrum, ..CurvePoint::new(point, samples) }
}

/// A recording after preprocessing.
struct Preprocessed<'a> {
    profile: &'a SensorProfile,
    estimators: &'a RecordEstimators,
    preprocessing: &'a Preprocessing,
    /// Of the coupled channels, in their order.
    series: &'a [Series],
    /// Their first half, without what its own rules exclude.
    first_half: &'a [Series],
    /// The whole record, without what these rules exclude.
    by_first_half: &'a [Series],
    /// Sample period that begins the second half.
    middle: u64,
}

/// Samples of a channel that are missing in its model.
fn missing_samples(
    measurement: &Measurement,
    preprocessing: &Preprocessing,
    both: &RecordPart,
    channel: ChannelProfile,
) -> MissingSamples {
    let lost = measurement.dropped.get("gap").copied().unwrap_or(0);
    let of_all =
        measurement.dropped.iter().filter(|(cause, _)| **cause != "gap").map(|(&cause, &count)| (cause, count));
    let own = measurement.channel(&channel).into_iter().flat_map(|channel| &channel.refused);
    let own = own.map(|(&cause, positions)| (cause, positions.len() as u64));
    let mut refused: BTreeMap<String, u64> = BTreeMap::new();
    for (cause, count) in of_all.chain(own).chain(preprocessing.refused(channel)).filter(|(_, count)| *count > 0) {
        *refused.entry(cause.to_owned()).or_insert(0) += count;
    }
    MissingSamples { lost, refused, replaced: both.position(channel).map_or(0, |position| both.replaced(position)) }
}

/// The fits of a channel to the first half, for the errors on the second, and to both, for the effects.
struct ChannelAnalysis {
    /// The baseline model of the first half as it was recorded, with its spikes and knocks.
    raw: Model,
    first: ChannelFit,
    /// Curves of the channel's epochs; `None` of a record that is too short for them, and of a channel that is not traced.
    epoch_curves: Option<EpochCurves>,
    /// The same, with the part of the first half that `first` is fitted to.
    epochs: Option<ChannelEpochs>,
    both: ChannelFit,
    /// Lines in the spectrum of the whole record.
    lines: Vec<MergedLine>,
    /// Random telegraph noise in the whole record.
    telegraph: Option<Detection>,
    /// The samples less the share of the covariates; of a traced channel only.
    rest: Option<UniformSeries>,
}

impl ChannelAnalysis {
    /// The baseline model alone.
    fn baseline(record: &Preprocessed, channel: ChannelProfile) -> Self {
        let estimators = record.estimators;
        let position = estimators.both.position(channel).unwrap_or_default();
        let [first, both] = [&estimators.ruled[0], &estimators.both]
            .map(|part| ChannelFit::fit_baseline(CovariateFit::estimate(part, position, false, |_| None)));
        let raw = first.trace.before.clone();
        Self { raw, first, epoch_curves: None, epochs: None, both, lines: Vec::new(), telegraph: None, rest: None }
    }

    /// The baseline model and what it lacks; `own_position` is that of the channel's series.
    fn trace(record: &Preprocessed, channel: ChannelProfile, own_position: usize, noise_grids: &NoiseGrids) -> Self {
        let &Preprocessed { profile, estimators, preprocessing, series, first_half, by_first_half, middle } = record;
        let position = estimators.both.position(channel).unwrap_or_default();
        let (own, own_half) = (&series[own_position], &first_half[own_position]);
        // Temperature and supply in the first half.
        let (slow, slow_halves): (Vec<ChannelProfile>, Vec<&Series>) = estimators
            .both
            .channels
            .iter()
            .zip(first_half)
            .filter(|(regressor, _)| regressor.quantity.is_environment())
            .map(|(regressor, series)| (*regressor, series))
            .unzip();
        let bias_changes = bias::find(own_half, &slow_halves, noise_grids);
        let in_half = |regressor: ChannelProfile| {
            let is_of = |(number, _): &&(usize, bias::BiasSensitivity)| slow[*number] == regressor;
            bias_changes.sensitivities.iter().find(is_of).map(|(_, followed)| *followed)
        };
        let has_ramp = preprocessing.has_ramp(channel);
        let raw = preprocessing.excludes_any(Exclusion::ByFirstHalf).then(|| {
            let raw = CovariateFit::estimate(&estimators.raw[0], position, has_ramp, in_half);
            ChannelFit::fit_baseline(raw).trace.before
        });
        let first = CovariateFit::estimate(&estimators.ruled[0], position, has_ramp, in_half);
        let both = CovariateFit::estimate(&estimators.both, position, has_ramp, |regressor| {
            preprocessing.sensitivity(channel, regressor)
        });
        let half = first.compensated_series(own_half, first_half);
        let followed = first.compensated_series(&by_first_half[own_position], by_first_half);
        let epoch_curves = EpochCurves::from_series(followed.as_ref().unwrap_or(&by_first_half[own_position]), middle);
        let whole = both.compensated_series(own, series);
        let (first, _) = fit_with_lines(first, own_half, half.as_ref(), profile);
        let (both, lines) = fit_with_lines(both, own, whole.as_ref(), profile);
        let correlation_times: Vec<f64> = both.correlation_times().collect();
        let rest = UniformSeries::from_series(whole.as_ref().unwrap_or(own));
        let is_reversible =
            |found: &Detection| random_telegraph::is_reversible(&rest, found.effect.parameters["time_constant"].value);
        let telegraph = random_telegraph::find(&rest, channel.unit, &correlation_times).filter(is_reversible);
        let raw = raw.unwrap_or_else(|| first.trace.before.clone());
        Self { raw, first, epoch_curves, epochs: None, both, lines, telegraph, rest: Some(rest) }
    }

    /// Fits the model of the first half to its later quarter where the noise of the first half changes.
    fn fit_to_recent(&mut self) {
        let Some(curves) = self.epoch_curves.take() else { return };
        let epochs = ChannelEpochs::compare(curves, &self.first.trace.after);
        if let Some(recent) = epochs.recent_curve() {
            self.first.fit_to(&recent);
        }
        self.epochs = Some(epochs);
    }

    /// The error on the second half of the curve of the first half itself.
    fn first_half_curve(&self, estimators: &RecordEstimators, channel: ChannelProfile) -> ModelErrorReport {
        let position = estimators.both.position(channel).unwrap_or_default();
        let unseen = self.first.covariates.compensated(&estimators.raw[1], position);
        ModelErrorReport::of_curve(&self.first.covariates.curve, &unseen, &self.first.trace.after)
    }

    /// Makes the terms of the first half's model those of the whole record's where the second half does not contradict it.
    fn refit(&mut self, estimators: &RecordEstimators, channel: ChannelProfile, common: Option<&PartFilter>) {
        let position = estimators.both.position(channel).unwrap_or_default();
        let unseen = self.first.covariates.compensated(&estimators.ruled[1], position);
        if Contradiction::find(&self.first.trace.after, &unseen).is_none() {
            self.both.take_terms_that_held(&self.first.trace, common);
        }
    }

    /// The models that are assessed by samples that still have the share of the covariates.
    fn assessed_models(&self) -> AssessedModels<'_> {
        AssessedModels {
            refitted: &self.both.trace.after,
            uncompensated: self.both.with_covariates(),
            of_first_half: self.first.with_covariates(),
        }
    }

    /// What was found in the channel over the whole record.
    fn findings<'a>(
        &'a self,
        both: &RecordPart,
        channel: ChannelProfile,
        common: Option<&'a ChannelsInCommon>,
    ) -> ChannelFindings<'a> {
        let sensitivities = self.both.covariates.sensitivities();
        ChannelFindings {
            channel,
            resolution: both.resolution_of(channel),
            fit: &self.both,
            sensitivities: sensitivities.map(|(position, of)| (both.channels[position], *of)).collect(),
            lines: &self.lines,
            telegraph: self.telegraph.as_ref(),
            common,
            rest: self.rest.as_ref(),
        }
    }

    /// The baseline model of the first half as it was recorded.
    fn before(
        &self,
        estimators: &RecordEstimators,
        preprocessing: &Preprocessing,
        channel: ChannelProfile,
        whole: &Curve<OCTAVES>,
    ) -> ModelReport {
        let position = estimators.both.position(channel).unwrap_or_default();
        let model = &self.raw;
        let error = |part: &RecordPart| ModelErrorReport::new(model, &part.curve(position));
        ModelReport {
            terms: term_reports(model, channel.unit),
            adev: whole.points().iter().map(|point| model.avar(point.n).sqrt()).collect(),
            fitted: error(&estimators.raw[0]),
            unseen: error(&estimators.raw[1]),
            unseen_excluding: has_rules(preprocessing, channel).then(|| error(&estimators.ruled[1])),
        }
    }

    /// The model of the first half with the added terms, without what the rules of the first half exclude. `avar_of` is the
    /// Allan variance of a channel of the whole record at an averaging factor.
    fn after(
        &self,
        estimators: &RecordEstimators,
        preprocessing: &Preprocessing,
        channel: ChannelProfile,
        whole: &Curve<OCTAVES>,
        avar_of: impl Fn(ChannelProfile, u64) -> Option<f64>,
    ) -> ModelReport {
        let position = estimators.both.position(channel).unwrap_or_default();
        let (model, covariates) = (&self.first.trace.after, &self.first.covariates);
        let unseen = |part: &RecordPart| ModelErrorReport::new(model, &covariates.compensated(part, position));
        ModelReport {
            terms: term_reports(model, channel.unit),
            adev: self.first.deviations(&estimators.both, position, whole, avar_of),
            fitted: ModelErrorReport::new(model, self.first.fitted_curve()),
            unseen: unseen(&estimators.raw[1]),
            unseen_excluding: has_rules(preprocessing, channel).then(|| unseen(&estimators.ruled[1])),
        }
    }

    /// The model with the added terms, fitted to the whole record, with the errors of `after`.
    fn refitted(
        &self,
        estimators: &RecordEstimators,
        channel: ChannelProfile,
        whole: &Curve<OCTAVES>,
        after: &ModelReport,
        avar_of: impl Fn(ChannelProfile, u64) -> Option<f64>,
    ) -> ModelReport {
        let position = estimators.both.position(channel).unwrap_or_default();
        ModelReport {
            terms: term_reports(&self.both.trace.after, channel.unit),
            adev: self.both.deviations(&estimators.both, position, whole, avar_of),
            ..after.clone()
        }
    }
}

/// Whether rules of the first half exclude samples of a channel.
fn has_rules(preprocessing: &Preprocessing, channel: ChannelProfile) -> bool {
    preprocessing.excludes(channel, Exclusion::ByFirstHalf)
}

/// The drift that the gyroscopes have in common, and that of the accelerometers.
fn common_modes(analyses: &[(ChannelProfile, ChannelAnalysis)]) -> Vec<ChannelsInCommon> {
    let of_quantity = |quantity: &Quantity| {
        let members = analyses.iter().filter(|(channel, _)| channel.quantity == *quantity);
        let (channels, rests): (Vec<ChannelProfile>, Vec<UniformSeries>) =
            members.filter_map(|(channel, own)| Some((*channel, own.rest.clone()?))).unzip();
        common_mode(&channels, &rests)
    };
    in_parallel(&[Quantity::AngularRate, Quantity::SpecificForce], of_quantity).into_iter().flatten().collect()
}
