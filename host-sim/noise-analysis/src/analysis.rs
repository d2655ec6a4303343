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
use crate::long_record::LongRecord;
use crate::nonstationarity::CommonModeRegression;
use crate::parallel::per_channel;
use crate::part_report;
use crate::report::{
    ChannelReport, CurvePoint, FigureData, MissingSamples, ModelReport, Report, SCHEMA, SlopeMethodReport, by_cause,
    term_reports,
};
use crate::series::Series;
use crate::spectra::allan_deviations_by_spectrum;
use crate::traced_record::{Condensed, TracedRecord};
use crate::uniform_series::UniformSeries;
use allan_core::AllanPoint;
use measurement::{ChannelId, Measurement, RecordingDescription};
use std::collections::BTreeMap;
use std::fmt;

/// What an analysis does, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Fits the models of the whole record.
    WholeRecord,
    /// Fits the models of the first half, and compares them with the second.
    FirstHalf,
    /// Names the effects, in the whole record and in its first half alone.
    Effects,
    /// Assesses the models, and gathers the figures of the report.
    Assessment,
}

impl Stage {
    /// How many there are.
    pub const COUNT: usize = 4;
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::WholeRecord => "models of the whole record",
            Self::FirstHalf => "models of the first half",
            Self::Effects => "effects",
            Self::Assessment => "assessment",
        })
    }
}

/// Analyses every channel of a measurement, condensed if it has more than [`MOST_SAMPLES`](crate::long_record::MOST_SAMPLES)
/// samples, or [`MOST_SAMPLES_WITH_LOSSES`](crate::long_record::MOST_SAMPLES_WITH_LOSSES).
/// Effects are traced in the inertial channels only; the others get the baseline model.
#[must_use]
pub fn analyze(measurement: &Measurement) -> Report {
    match LongRecord::condensed_from(measurement) {
        Some(long) => analyze_long(&long, &|_| {}),
        None => analyze_samples(measurement),
    }
}

/// As [`analyze`], of a measurement that is not needed afterwards: the samples of a long one are released when it is condensed. Calls
/// `watch` with each stage when it begins.
#[must_use]
pub fn analyze_and_release(measurement: Measurement, watch: &dyn Fn(Stage)) -> Report {
    match LongRecord::condensed_from(&measurement) {
        Some(long) => {
            drop(measurement);
            analyze_long(&long, watch)
        }
        None => Recorded::of_samples(&measurement, &RecordingDescription::from(&measurement)).report(watch),
    }
}

/// Analyses all samples of every channel of a measurement, however many there are.
#[must_use]
pub fn analyze_samples(measurement: &Measurement) -> Report {
    Recorded::of_samples(measurement, &RecordingDescription::from(measurement)).report(&|_| {})
}

/// Analyses a recording of which not all samples are kept. Calls `watch` with each stage when it begins.
#[must_use]
pub fn analyze_long(record: &LongRecord, watch: &dyn Fn(Stage)) -> Report {
    let LongRecord { description, first, means, .. } = record;
    Recorded { description, measurement: means, first, long: Some(record) }.report(watch)
}

/// What a report is made of.
struct Recorded<'a> {
    description: &'a RecordingDescription,
    /// The samples, or those of a long record in means.
    measurement: &'a Measurement,
    /// The samples, or the first of them.
    first: &'a Measurement,
    long: Option<&'a LongRecord>,
}

impl<'a> Recorded<'a> {
    fn of_samples(measurement: &'a Measurement, description: &'a RecordingDescription) -> Self {
        Self { description, measurement, first: measurement, long: None }
    }

    fn report(&self, watch: &dyn Fn(Stage)) -> Report {
        let &Self { description, measurement, first, long } = self;
        let condensed = long.map(LongRecord::condensed);
        watch(Stage::WholeRecord);
        let mut record = TracedRecord::new(measurement, condensed);
        watch(Stage::FirstHalf);
        let first_half = FirstHalf::fit(&record);
        keep_terms_that_held(&mut record, &first_half);
        record.add_lines_of_spectrum();
        watch(Stage::Effects);
        let mut effects = record.effects();
        // What the first half shows by itself, to compare with what the whole record shows.
        let mut effects_of_half = if effects.iter().all(Vec::is_empty) {
            effects.clone()
        } else {
            let half = measurement.before(measurement.middle());
            let shorter = condensed.map(|condensed| condensed.shorter.of_first_half());
            let of_half = condensed.zip(shorter.as_ref()).map(|(of, shorter)| Condensed { shorter, ..of });
            TracedRecord::new(&half, of_half).effects()
        };
        if let Some(long) = long {
            for (effects, of_samples) in
                [(&mut effects, &long.effects), (&mut effects_of_half, &long.effects_of_first_half)]
            {
                for (effects, of_samples) in effects.iter_mut().zip(of_samples) {
                    effects.splice(0..0, of_samples.iter().cloned());
                }
            }
        }
        watch(Stage::Assessment);
        let mut channels = self.channel_reports(&record, &first_half);
        let duration_s = description.periods as f64 * description.period_s();
        let findings = causes::find(
            &mut channels,
            &effects.into_vec(),
            &effects_of_half.into_vec(),
            &description.profile,
            duration_s,
        );
        let part = part_report::report(first, description.samples, &record.filter);
        // The samples are transformed once more for the figures: what is not needed then is released.
        drop((record, first_half));
        let mut report = Report {
            schema: SCHEMA,
            quick: false,
            sample_rate_hz: description.sample_rate_hz,
            samples: description.samples,
            dropped: by_cause(&description.dropped),
            flagged: by_cause(&description.flagged),
            part,
            findings,
            common_mode: common_mode_regression(measurement, &channels),
            channels,
        };
        figure_data::set(&mut report, measurement, long.map(|long| &long.first));
        report
    }

    /// The report of every channel, in the order of the channels, without its effects.
    fn channel_reports(&self, record: &TracedRecord, first_half: &FirstHalf) -> Vec<ChannelReport> {
        let TracedRecord { estimators, measurement, .. } = record;
        let assessments =
            per_channel(measurement.ids(), |channel| Assessed::new(record, channel, &first_half.channels[channel]));
        let nonstationarities = first_half.nonstationarities(record);
        let at_rest = record.at_rest();
        let avar_of = |of: ChannelId, n: u64| {
            estimators.measured[of].points().iter().find(|point| point.n == n).map(|point| point.avar)
        };
        let report = |(channel, assessed): (ChannelId, Assessed)| {
            let profile = &measurement[channel].profile;
            let (trace, half) = (&record.channels[channel], &first_half.channels[channel]);
            let whole = estimators.measured[channel]
                .clone()
                .with_confidence(|point| half.fit.before.variance_fractions(point.n));
            let after = half.after(record, channel, &whole, avar_of);
            // The model with the added terms, fitted to the whole record, with the errors of `after`.
            let refitted = ModelReport {
                terms: term_reports(trace.fit.after(), profile.unit),
                adev: trace.fit.deviations(&estimators.both, channel, &whole, avar_of),
                ..after.clone()
            };
            let points = whole.points().iter();
            ChannelReport {
                name: profile.name.to_owned(),
                unit: profile.unit.to_owned(),
                samples: self.description.samples,
                missing: self.missing_samples(record, channel),
                curve: points.map(|point| curve_point(point, whole.samples(), &assessed.by_spectrum)).collect(),
                read_off: SlopeMethodReport::from_curve(&whole, profile.unit),
                before: half.before(record, channel, &whole),
                first_half_curve: half.curve_error(record, channel),
                after,
                refitted,
                nonstationarity: nonstationarities[channel].clone(),
                at_rest: at_rest.clone(),
                effects: Vec::new(),
                assessment: assessed.assessment,
                figure_data: FigureData::default(),
            }
        };
        measurement.ids().zip(assessments).map(report).collect()
    }

    /// Samples of a channel that are missing in its model.
    fn missing_samples(&self, record: &TracedRecord, channel: ChannelId) -> MissingSamples {
        let TracedRecord { measurement, preprocessing, estimators, .. } = record;
        let dropped = &self.description.dropped;
        let of_all = dropped.iter().filter(|(cause, _)| **cause != "gap").map(|(&cause, &count)| (cause, count));
        let own: Vec<(&str, u64)> = match self.long {
            // Of means, a knock has all of their samples.
            Some(long) => {
                let samples = |(cause, means)| (cause, means * long.shorter.samples_per_mean);
                let of_means = preprocessing.refused(channel).map(samples);
                long.refused[channel].iter().map(|(&cause, &count)| (cause, count)).chain(of_means).collect()
            }
            None => {
                let refused =
                    measurement[channel].refused.iter().map(|(&cause, positions)| (cause, positions.len() as u64));
                refused.chain(preprocessing.refused(channel)).collect()
            }
        };
        let mut refused: BTreeMap<String, u64> = BTreeMap::new();
        for (cause, count) in of_all.chain(own).filter(|(_, count)| *count > 0) {
            *refused.entry(cause.to_owned()).or_insert(0) += count;
        }
        let lost = dropped.get("gap").copied().unwrap_or(0);
        MissingSamples { lost, refused, replaced: estimators.both.replaced(channel) }
    }
}

/// The drift that the channels whose noise was followed have in common.
fn common_mode_regression(measurement: &Measurement, channels: &[ChannelReport]) -> Option<CommonModeRegression> {
    let all = measurement.ids().zip(channels);
    let followed: Vec<ChannelId> =
        all.filter(|(_, of)| of.nonstationarity.is_some()).map(|(channel, _)| channel).collect();
    CommonModeRegression::estimate(measurement, &followed)
}

/// Makes the terms of the first half's model those of the whole record's where the second half does not contradict it.
fn keep_terms_that_held(record: &mut TracedRecord, first_half: &FirstHalf) {
    let filter = record.filter.clone().ok();
    for (channel, half) in first_half.channels.with_ids() {
        if record.is_traced(channel) && half.held(record, channel) {
            record.channels[channel].fit.take_terms_that_held(&half.fit.traced, filter.as_ref());
        }
    }
}

/// What the samples of a channel say beside its fits.
struct Assessed {
    assessment: Assessment,
    /// The Allan deviation by the measured spectrum at each octave.
    by_spectrum: Vec<Option<f64>>,
}

impl Assessed {
    fn new(record: &TracedRecord, channel: ChannelId, half: &FirstHalfFit) -> Self {
        let trace = &record.channels[channel];
        let recorded = Series::from_measurement(record.measurement, channel);
        let own = if record.is_traced(channel) { &record.series[channel] } else { &recorded };
        // Models that are assessed by samples that still have the share of the covariates.
        let models = AssessedModels {
            refitted: trace.fit.after(),
            uncompensated: trace.fit.with_covariates(),
            of_first_half: half.fit.with_covariates(),
        };
        // By the spectrum of the samples as they were recorded, as the measured curve is.
        let factors: Vec<u64> = (0..OCTAVES).map(|octave| 1 << octave).collect();
        let mut by_spectrum = allan_deviations_by_spectrum(&UniformSeries::from_series(&recorded), &factors);
        // Means tell nothing of the averaging times that are shorter than they are.
        let shorter = record.condensed.map_or(0, |condensed| condensed.shorter.samples_per_mean.ilog2() as usize);
        by_spectrum.splice(0..0, vec![None; shorter]);
        let of_channel = record.condensed.map(|condensed| &condensed.shorter.channels[channel]);
        let samples = of_channel.and_then(|of| Some((of.spectrum_within(0..u64::MAX)?, of.resolution)));
        let samples = samples.as_ref().map(|(spectrum, resolution)| (spectrum, *resolution));
        Self { assessment: Assessment::new(own, samples, models), by_spectrum }
    }
}

fn curve_point(point: &AllanPoint, samples: u64, by_spectrum: &[Option<f64>]) -> CurvePoint {
    let adev_by_spectrum = by_spectrum.get(point.n.ilog2() as usize).copied().flatten();
    CurvePoint { adev_by_spectrum, ..CurvePoint::new(point, samples) }
}
