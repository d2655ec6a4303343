//! The pipeline from a recording to its report.
//!
//! Effects are named on the whole record. The errors before and after come from models of the first half alone, compared
//! with the second half, both by time: as it was recorded, and without what the rules for spikes and knocks exclude that were
//! fitted to the first half.

use crate::OCTAVES;
use crate::assessment::Assessment;
use crate::channel_fit::{ChannelFit, DITHERED_OCTAVES, agree_on_filter};
use crate::covariates::CovariateFit;
use crate::detectors::block_means::NoiseGrids;
use crate::detectors::{bias, random_telegraph};
use crate::estimators::{RecordEstimators, RecordPart};
use crate::findings::{Detection, Effect, Finding, Validation};
use crate::naming::{ChannelFindings, name_effects};
use crate::preprocessing::{Exclusion, Preprocessing, in_parallel};
use crate::report::{
    ChannelReport, CurvePoint, MissingSamples, ModelErrorReport, ModelReport, PartReport, Report, SCHEMA,
    SlopeMethodReport, Stretch, TermReport,
};
use crate::series::Series;
use crate::slow_drift::{ChannelsInCommon, common_mode};
use crate::spectra::allan_deviations_by_spectrum;
use crate::spectral_lines::{MergedLine, fit_with_lines};
use crate::uniform_series::UniformSeries;
use allan_core::{AllanPoint, Curve, Model, NoiseTerm};
use measurement::{ChannelProfile, Measurement, Quantity, SensorProfile};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Analyses every channel of a measurement. Effects are traced in the inertial channels only; the others get the baseline
/// model.
#[must_use]
pub fn analyze(measurement: &Measurement) -> Report {
    let mut channels = analyze_channels(measurement);
    let findings = findings_of(&mut channels);
    Report {
        schema: SCHEMA,
        sample_rate_hz: measurement.sample_rate_hz,
        samples: measurement.len() as u64,
        dropped: by_cause(&measurement.dropped),
        flagged: by_cause(&measurement.flagged),
        part: PartReport { name: measurement.profile.name.to_owned(), ..PartReport::default() },
        findings,
        channels,
    }
}

/// One finding for each effect of each channel; every effect is given the position of its finding.
fn findings_of(channels: &mut [ChannelReport]) -> Vec<Finding> {
    let mut findings = Vec::new();
    for channel in channels {
        for effect in &mut channel.effects {
            effect.finding = findings.len();
            findings.push(Finding {
                kind: effect.kind.clone(),
                channels: vec![channel.name.clone()],
                parameters: effect.parameters.clone(),
                evidence: effect.evidence.clone(),
                validated: Validation::Untestable,
                share_percent: BTreeMap::new(),
            });
        }
    }
    findings
}

fn by_cause(counts: &BTreeMap<&'static str, u64>) -> BTreeMap<String, u64> {
    counts.iter().map(|(&cause, &count)| (cause.to_owned(), count)).collect()
}

fn analyze_channels(measurement: &Measurement) -> Vec<ChannelReport> {
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
    let series = series_without(Exclusion::ByWhole);
    let first_half: Vec<Series> =
        series_without(Exclusion::ByFirstHalf).iter().map(|series| series.before(measurement.middle())).collect();
    let preprocessed = Preprocessed {
        profile,
        estimators: &estimators,
        preprocessing: &preprocessing,
        series: &series,
        first_half: &first_half,
    };
    let analyses = in_parallel(&recorded, |&channel| {
        let traced = traced.iter().position(|of| *of == channel);
        let analysis = match traced {
            Some(position) => ChannelAnalysis::trace(&preprocessed, channel, position, &noise_grids),
            None => ChannelAnalysis::baseline(&preprocessed, channel),
        };
        let own = match traced {
            Some(position) => Cow::Borrowed(&series[position]),
            None => Cow::Owned(Series::from_measurement(measurement, &channel)),
        };
        // The series still holds the share of the covariates, which the model with added terms does not describe.
        let trace = &analysis.first.trace;
        let model = if analysis.first.covariates.is_empty() { &trace.after } else { &trace.before };
        let assessment = Assessment::new(&own, model, [&trace.after, &analysis.both.trace.after]);
        (analysis, Assessed { assessment, by_spectrum: by_spectrum(measurement, &channel) })
    });
    let (analyses, assessments): (Vec<ChannelAnalysis>, Vec<Assessed>) = analyses.into_iter().unzip();
    let mut analyses: Vec<(ChannelProfile, ChannelAnalysis)> = recorded.into_iter().zip(analyses).collect();
    let inertial = analyses.iter_mut().filter(|(channel, _)| traced.contains(channel)).map(|(channel, analysis)| {
        let fit = &mut analysis.both;
        let is_dithered = fit.is_dithered(profile, estimators.both.resolution_of(*channel), DITHERED_OCTAVES);
        (fit, is_dithered)
    });
    agree_on_filter(&mut inertial.collect::<Vec<_>>());
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
            effects.extend(preprocessing.effects(*channel));
            let has_ramp = preprocessing.has_ramp(*channel);
            let common = commons.iter().find(|common| common.channels.contains(channel));
            let named = name_effects(profile, &analysis.findings(&estimators.both, *channel, common));
            effects.extend(named.into_iter().filter(|effect| !has_ramp || effect.kind != NoiseTerm::RateRamp.name()));
        }
        let whole = measured.clone().with_confidence(|point| analysis.first.trace.before.variance_fractions(point.n));
        let after = analysis.after(&estimators, &preprocessing, *channel, &whole, &avar_of);
        let refitted = analysis.refitted(&estimators, *channel, &whole, &after, &avar_of);
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
            after,
            refitted,
            at_rest: vec![Stretch { from_s: 0.0, to_s: measurement.periods() as f64 * measurement.period_s() }],
            effects,
            assessment: assessed.assessment,
        }
    };
    analyses.iter().zip(&estimators.measured).zip(assessments).map(report).collect()
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
        Self { raw: first.trace.before.clone(), first, both, lines: Vec::new(), telegraph: None, rest: None }
    }

    /// The baseline model and what it lacks; `own` is the position of the channel's series.
    fn trace(record: &Preprocessed, channel: ChannelProfile, own: usize, noise_grids: &NoiseGrids) -> Self {
        let &Preprocessed { profile, estimators, preprocessing, series, first_half } = record;
        let position = estimators.both.position(channel).unwrap_or_default();
        let (own, own_half) = (&series[own], &first_half[own]);
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
        let whole = both.compensated_series(own, series);
        let (first, _) = fit_with_lines(first, own_half, half.as_ref(), profile);
        let (both, lines) = fit_with_lines(both, own, whole.as_ref(), profile);
        let correlation_times: Vec<f64> = both.correlation_times().collect();
        let rest = UniformSeries::from_series(whole.as_ref().unwrap_or(own));
        let telegraph = random_telegraph::find(&rest, channel.unit, &correlation_times);
        let raw = raw.unwrap_or_else(|| first.trace.before.clone());
        Self { raw, first, both, lines, telegraph, rest: Some(rest) }
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
            terms: terms(model, channel.unit),
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
            terms: terms(model, channel.unit),
            adev: self.first.deviations(&estimators.both, position, whole, avar_of),
            fitted: ModelErrorReport::new(model, &covariates.curve),
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
            terms: terms(&self.both.trace.after, channel.unit),
            adev: self.both.deviations(&estimators.both, position, whole, avar_of),
            ..after.clone()
        }
    }
}

/// Whether rules of the first half exclude samples of a channel.
fn has_rules(preprocessing: &Preprocessing, channel: ChannelProfile) -> bool {
    preprocessing.excludes(channel, Exclusion::ByFirstHalf)
}

fn terms(model: &Model, unit: &str) -> Vec<TermReport> {
    model.terms().iter().map(|term| TermReport::new(term, unit)).collect()
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
