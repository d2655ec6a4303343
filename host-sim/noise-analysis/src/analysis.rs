//! The pipeline from a recording to its report.
//!
//! ```text
//! Measurement ─► TracedRecord: preprocessing, curves, models of the whole record ─► effects ─► causes ─► Report
//!                    ├─► FirstHalf: models of the first half, their errors on the second ──────────────────┤
//! first half alone ─► TracedRecord ─► effects, to validate those of the whole ───────────────────────────────┘
//! ```
//!
//! Effects are named on the whole record. The errors before and after come from models of the first half alone, compared
//! with the second half, both by time: as it was recorded, and without what the rules for spikes and knocks exclude that were
//! fitted to the first half.

use crate::OCTAVES;
use crate::assessment::{AssessedModels, Assessment};
use crate::causes;
use crate::figure_data;
use crate::first_half::{FirstHalf, FirstHalfFit};
use crate::nonstationarity::CommonModeRegression;
use crate::parallel::in_parallel;
use crate::part_report;
use crate::report::{
    ChannelReport, CurvePoint, FigureData, MissingSamples, ModelReport, Report, SCHEMA, SlopeMethodReport, term_reports,
};
use crate::series::Series;
use crate::spectra::allan_deviations_by_spectrum;
use crate::traced_record::{ChannelTrace, TracedRecord};
use crate::uniform_series::UniformSeries;
use allan_core::{AllanPoint, Curve};
use measurement::{ChannelProfile, Measurement};
use std::collections::BTreeMap;

/// Analyses every channel of a measurement. Effects are traced in the inertial channels only; the others get the baseline
/// model.
#[must_use]
pub fn analyze(measurement: &Measurement) -> Report {
    let mut record = TracedRecord::new(measurement);
    let first_half = FirstHalf::fit(&record);
    keep_terms_that_held(&mut record, &first_half);
    let effects = record.effects();
    // What the first half shows by itself, to compare with what the whole record shows.
    let effects_of_half = if effects.iter().all(Vec::is_empty) {
        vec![Vec::new(); effects.len()]
    } else {
        TracedRecord::new(&measurement.before(measurement.middle())).effects()
    };
    let mut channels = channel_reports(&record, &first_half);
    let duration_s = measurement.periods() as f64 * measurement.period_s();
    let findings = causes::find(&mut channels, &effects, &effects_of_half, &measurement.profile, duration_s);
    let part = part_report::report(measurement, &record.filter);
    // The samples are transformed once more for the figures: what is not needed then is released.
    drop((record, first_half));
    let mut report = Report {
        schema: SCHEMA,
        quick: false,
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

/// The drift that the channels whose noise was followed have in common.
fn common_mode_regression(measurement: &Measurement, channels: &[ChannelReport]) -> Option<CommonModeRegression> {
    let is_followed =
        |profile: &ChannelProfile| channels.iter().any(|of| of.name == profile.name && of.nonstationarity.is_some());
    let followed: Vec<ChannelProfile> = measurement.profiles().filter(is_followed).collect();
    CommonModeRegression::estimate(measurement, &followed)
}

/// Makes the terms of the first half's model those of the whole record's where the second half does not contradict it.
fn keep_terms_that_held(record: &mut TracedRecord, first_half: &FirstHalf) {
    let held: Vec<bool> = record
        .channels
        .iter()
        .zip(&first_half.channels)
        .map(|(trace, half)| record.traced.contains(&trace.channel) && half.held(record, trace.channel))
        .collect();
    let filter = record.filter.as_ref().ok();
    let fits = record.channels.iter_mut().zip(&first_half.channels).zip(held).filter(|(_, held)| *held);
    for ((trace, half), _) in fits {
        trace.fit.take_terms_that_held(&half.fit.trace, filter);
    }
}

/// The report of every channel, in the order of the channels, without its effects.
fn channel_reports(record: &TracedRecord, first_half: &FirstHalf) -> Vec<ChannelReport> {
    let TracedRecord { measurement, estimators, traced, .. } = record;
    let models: Vec<(&ChannelTrace, &FirstHalfFit)> = record.channels.iter().zip(&first_half.channels).collect();
    let assessments = in_parallel(&models, |(trace, half)| Assessed::new(record, trace, half));
    let nonstationarities = first_half.nonstationarities(record);
    let at_rest = record.at_rest();
    let avar_of = |of: ChannelProfile, n: u64| {
        let position = record.channels.iter().position(|trace| trace.channel == of)?;
        estimators.measured[position].points().iter().find(|point| point.n == n).map(|point| point.avar)
    };
    let report = |((trace, half), measured): (&(&ChannelTrace, &FirstHalfFit), &Curve<OCTAVES>), assessed: Assessed| {
        let channel = trace.channel;
        let whole = measured.clone().with_confidence(|point| half.fit.trace.before.variance_fractions(point.n));
        let after = half.after(record, channel, &whole, avar_of);
        // The model with the added terms, fitted to the whole record, with the errors of `after`.
        let position = estimators.both.position(channel).unwrap_or_default();
        let refitted = ModelReport {
            terms: term_reports(&trace.fit.trace.after, channel.unit),
            adev: trace.fit.deviations(&estimators.both, position, &whole, avar_of),
            ..after.clone()
        };
        let nonstationarity = traced.iter().position(|of| *of == channel);
        let points = whole.points().iter();
        ChannelReport {
            name: channel.name.to_owned(),
            unit: channel.unit.to_owned(),
            samples: measurement.len() as u64,
            missing: missing_samples(record, channel),
            curve: points.map(|point| curve_point(point, whole.samples(), &assessed.by_spectrum)).collect(),
            read_off: SlopeMethodReport::from_curve(&whole, channel.unit),
            before: half.before(record, channel, &whole),
            first_half_curve: half.curve_error(record, channel),
            after,
            refitted,
            nonstationarity: nonstationarity.and_then(|position| nonstationarities.get(position)?.clone()),
            at_rest: at_rest.clone(),
            effects: Vec::new(),
            assessment: assessed.assessment,
            figure_data: FigureData::default(),
        }
    };
    let channels = models.iter().zip(&estimators.measured).zip(assessments);
    channels.map(|(models, assessed)| report(models, assessed)).collect()
}

/// What the samples of a channel say beside its fits.
struct Assessed {
    assessment: Assessment,
    /// The Allan deviation by the measured spectrum at each octave.
    by_spectrum: Vec<Option<f64>>,
}

impl Assessed {
    fn new(record: &TracedRecord, trace: &ChannelTrace, half: &FirstHalfFit) -> Self {
        let channel = trace.channel;
        let recorded = Series::from_measurement(record.measurement, &channel);
        let is_traced = record.traced.contains(&channel);
        let own = record.series_of(channel).filter(|_| is_traced).unwrap_or(&recorded);
        // Models that are assessed by samples that still have the share of the covariates.
        let models = AssessedModels {
            refitted: &trace.fit.trace.after,
            uncompensated: trace.fit.with_covariates(),
            of_first_half: half.fit.with_covariates(),
        };
        // By the spectrum of the samples as they were recorded, as the measured curve is.
        let factors: Vec<u64> = (0..OCTAVES).map(|octave| 1 << octave).collect();
        let by_spectrum = allan_deviations_by_spectrum(&UniformSeries::from_series(&recorded), &factors);
        Self { assessment: Assessment::new(own, models), by_spectrum }
    }
}

fn curve_point(point: &AllanPoint, samples: u64, by_spectrum: &[Option<f64>]) -> CurvePoint {
    let adev_by_spectrum = by_spectrum.get(point.n.ilog2() as usize).copied().flatten();
    CurvePoint { adev_by_spectrum, ..CurvePoint::new(point, samples) }
}

/// Samples of a channel that are missing in its model.
fn missing_samples(record: &TracedRecord, channel: ChannelProfile) -> MissingSamples {
    let TracedRecord { measurement, preprocessing, estimators, .. } = record;
    let lost = measurement.dropped.get("gap").copied().unwrap_or(0);
    let of_all =
        measurement.dropped.iter().filter(|(cause, _)| **cause != "gap").map(|(&cause, &count)| (cause, count));
    let own = measurement.channel(&channel).into_iter().flat_map(|channel| &channel.refused);
    let own = own.map(|(&cause, positions)| (cause, positions.len() as u64));
    let mut refused: BTreeMap<String, u64> = BTreeMap::new();
    for (cause, count) in of_all.chain(own).chain(preprocessing.refused(channel)).filter(|(_, count)| *count > 0) {
        *refused.entry(cause.to_owned()).or_insert(0) += count;
    }
    let replaced = estimators.both.position(channel).map_or(0, |position| estimators.both.replaced(position));
    MissingSamples { lost, refused, replaced }
}
