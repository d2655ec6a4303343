//! The pipeline from a recording to its report.
//!
//! ```text
//! Measurement ─► CondensedRecord ─► PreprocessedRecord: curves ─► TracedPart: models of the whole ─► effects ─► causes ─► Report
//!                     └─► its first half ─► PreprocessedRecord ─► TracedPart ─┬► effects, to validate those of the whole ┤
//!                                                                             └► FirstHalf: errors on the second half ───┘
//! ```
//!
//! Effects are named on the whole record. The errors before and after come from models of the first half alone, compared with the second
//! half, both by time: as it was recorded, and without what the rules for spikes and knocks exclude that were fitted to the first half.

use crate::OCTAVES;
use crate::effects::Effect;
use crate::halves::first_half::{Epochs, FirstHalf};
use crate::halves::preprocessed_record::PreprocessedRecord;
use crate::halves::traced_part::{ChannelTrace, TracedPart};
use crate::nonstationarity::CommonModeRegression;
use crate::parallel::{self, per_channel};
use crate::record::condensed_record::CondensedRecord;
use crate::record::estimators::HalfEstimators;
use crate::record::long_record;
use crate::report::assessment::{AssessedModels, Assessment};
use crate::report::figure_data;
use crate::report::part_report;
use crate::report::{ChannelReport, MissingSamples, Report, SCHEMA, by_cause};
use crate::rivals::causes;
use crate::samples::series::Series;
use crate::samples::uniform_series::UniformSeries;
use crate::spectra::allan_deviations_by_spectrum;
use measurement::{ChannelId, Measurement, PerChannel, RecordingDescription};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

/// The stages of an analysis, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Looks for what the samples show before models are fitted to them.
    Preprocessing,
    /// Fits the models of the whole record, and those of its first half, which are compared with the second; names the effects of the half.
    Models,
    /// Names the effects of the whole record.
    Effects,
    /// Assesses the models, and gathers the figures of the report.
    Assessment,
}

impl Stage {
    pub const COUNT: usize = 4;
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Preprocessing => "preprocessing",
            Self::Models => "models of the whole record and of the first half",
            Self::Effects => "effects",
            Self::Assessment => "assessment",
        })
    }
}

/// Analyses every channel of a measurement, condensed if it has more than [`MOST_SAMPLES`](crate::record::long_record::MOST_SAMPLES)
/// samples, or [`MOST_SAMPLES_WITH_LOSSES`](crate::record::long_record::MOST_SAMPLES_WITH_LOSSES).
/// Effects are traced in the inertial channels only; the others get the baseline model.
#[must_use]
pub fn analyze(measurement: &Measurement) -> Report {
    match long_record::condensed_from(measurement) {
        Some(record) => analyze_condensed(&record, &|_| {}),
        None => analyze_samples(measurement),
    }
}

/// Analyses like [`analyze`] a measurement that is not needed afterwards: the samples of a long one are released when it is condensed.
/// Calls `watch` with each stage when it begins.
#[must_use]
pub fn analyze_and_release(measurement: Measurement, watch: &dyn Fn(Stage)) -> Report {
    let record = match long_record::condensed_from(&measurement) {
        Some(record) => {
            drop(measurement);
            record
        }
        None => CondensedRecord::of_samples(Cow::Owned(measurement)),
    };
    analyze_condensed(&record, watch)
}

/// Analyses all samples of every channel of a measurement, however many there are.
#[must_use]
pub fn analyze_samples(measurement: &Measurement) -> Report {
    analyze_condensed(&CondensedRecord::of_samples(Cow::Borrowed(measurement)), &|_| {})
}

/// Analyses a recording, of which not all samples need be kept. Calls `watch` with each stage when it begins.
#[must_use]
pub fn analyze_condensed(record: &CondensedRecord, watch: &dyn Fn(Stage)) -> Report {
    let CondensedRecord { description, means: measurement, .. } = record;
    watch(Stage::Preprocessing);
    let half = record.first_half();
    let half = PreprocessedRecord::new(&half);
    let (whole, halves) = PreprocessedRecord::with_halves(record, &half);
    watch(Stage::Models);
    let of_half = || {
        let models = half.fit();
        // The findings of the first half alone are compared with those of the whole record.
        let effects = half.effects(&models);
        (effects, FirstHalf::new(&whole, &half, models, &halves))
    };
    // The two run side by side: while one waits for its slowest channel, the other goes on.
    let ((effects_of_half, (first_half, epochs)), mut models) = parallel::both(of_half, || whole.fit());
    models.take_terms_that_held(&first_half.part, &whole.estimators.second);
    models.add_lines_of_spectrum();
    models.take_coefficients_of_samples();
    watch(Stage::Effects);
    let effects = whole.effects(&models);
    watch(Stage::Assessment);
    let mut channels = channel_reports((&whole, &models), (&first_half, &halves), &epochs, &effects);
    let common_mode = common_mode_regression(measurement, &channels);
    let duration_s = description.periods as f64 * description.period_s();
    let (effects, effects_of_half) = (effects.into_vec(), effects_of_half.into_vec());
    let findings = causes::find(&mut channels, &effects, &effects_of_half, &description.profile, duration_s);
    let part = part_report::report(record.first_samples(), &models.filter);
    // The samples are transformed once more for the figures: what is not needed then is released.
    drop((whole, models, first_half, epochs, half, halves));
    let mut report = Report {
        schema: SCHEMA,
        quick: false,
        sample_rate_hz: description.sample_rate_hz,
        samples: description.samples,
        dropped: by_cause(&description.dropped),
        flagged: by_cause(&description.flagged),
        part,
        findings,
        common_mode,
        longest_at_rest: None,
        channels,
    };
    figure_data::set(&mut report, record);
    report
}

/// The report of every channel, without its `effects`.
fn channel_reports(
    (whole, models): (&PreprocessedRecord, &TracedPart),
    (first_half, halves): (&FirstHalf, &HalfEstimators),
    epochs: &Epochs,
    effects: &PerChannel<Vec<Effect>>,
) -> Vec<ChannelReport> {
    let record = whole.record;
    let assessments = per_channel(record.channels.ids(), |channel| {
        let traces = (&models.channels[channel], &first_half.part.channels[channel]);
        Assessed::new(whole, channel, traces, epochs.series(channel))
    });
    let nonstationarities = epochs.nonstationarities(whole, first_half);
    let at_rest = whole.at_rest(effects);
    let report = |(channel, Assessed { assessment, by_spectrum })| {
        let mut report = first_half.report(models, (&whole.estimators, halves), channel, whole.has_rules(channel));
        for point in &mut report.curve {
            point.adev_by_spectrum = by_spectrum.get(point.n.ilog2() as usize).copied().flatten();
        }
        ChannelReport {
            samples: record.description.samples,
            missing: missing_samples(whole, channel),
            nonstationarity: nonstationarities[channel].clone(),
            at_rest: at_rest.clone(),
            assessment,
            ..report
        }
    };
    record.channels.ids().zip(assessments).map(report).collect()
}

/// Samples of a channel that are missing in its model.
fn missing_samples(whole: &PreprocessedRecord, channel: ChannelId) -> MissingSamples {
    let CondensedRecord { description, samples_per_mean, channels, .. } = whole.record;
    // A knock takes all samples of a mean.
    let by_rules = whole.preprocessing.refused(channel).map(|(cause, means)| (cause, means * samples_per_mean));
    let own = channels[channel].refused.iter().map(|(&cause, &count)| (cause, count));
    missing(description, own.chain(by_rules), whole.estimators.both.replaced(channel))
}

/// The samples that are missing in the model of a channel, of which those of `own` are refused in it alone.
pub(crate) fn missing<'c>(
    description: &RecordingDescription,
    own: impl Iterator<Item = (&'c str, u64)>,
    replaced: u64,
) -> MissingSamples {
    let of_all =
        description.dropped.iter().filter(|(cause, _)| **cause != "gap").map(|(&cause, &count)| (cause, count));
    let mut refused: BTreeMap<String, u64> = BTreeMap::new();
    for (cause, count) in of_all.chain(own).filter(|(_, count)| *count > 0) {
        *refused.entry(cause.to_owned()).or_insert(0) += count;
    }
    MissingSamples { lost: description.dropped.get("gap").copied().unwrap_or(0), refused, replaced }
}

/// The drift that the channels whose noise was followed have in common.
fn common_mode_regression(measurement: &Measurement, channels: &[ChannelReport]) -> Option<CommonModeRegression> {
    let all = measurement.ids().zip(channels);
    let followed: Vec<ChannelId> =
        all.filter(|(_, of)| of.nonstationarity.is_some()).map(|(channel, _)| channel).collect();
    CommonModeRegression::estimate(measurement, &followed)
}

/// Results from the samples of a channel beside its fits.
struct Assessed {
    assessment: Assessment,
    /// The Allan deviation by the measured spectrum at each octave.
    by_spectrum: Vec<Option<f64>>,
}

impl Assessed {
    /// Uses the models of the whole record and of its first half, with the series `by_first_half` of both halves.
    fn new(
        whole: &PreprocessedRecord,
        channel: ChannelId,
        (trace, half): (&ChannelTrace, &ChannelTrace),
        by_first_half: &Series,
    ) -> Self {
        let recorded = Series::from_measurement(whole.measurement(), channel);
        let own = if whole.record.is_traced(channel) { &whole.series[channel] } else { &recorded };
        // Models that are assessed by samples that still have the share of the covariates.
        let models = AssessedModels {
            refitted: trace.fit.after(),
            coefficients_from: trace.fit.coefficients_from,
            uncompensated: trace.fit.with_covariates(),
            of_first_half: half.fit.with_covariates(),
        };
        // The deviation follows from the spectrum of the samples as they were recorded, like the measured curve.
        let factors: Vec<u64> = (0..OCTAVES).map(|octave| 1 << octave).collect();
        let mut by_spectrum = allan_deviations_by_spectrum(&UniformSeries::from_series(&recorded), &factors);
        // Means tell nothing of the averaging times that are shorter than they are.
        let shorter = whole.record.samples_per_mean.ilog2() as usize;
        by_spectrum.splice(0..0, vec![None; shorter]);
        let unseen = by_first_half.from(whole.measurement().middle());
        Self { assessment: Assessment::new(own, &unseen, models), by_spectrum }
    }
}
