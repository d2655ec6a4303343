//! The report of the curves alone: measured Allan deviation, models, errors on the unseen half, and what the trace of the curves
//! finds. The samples come in blocks and are not kept.
//!
//! Curves and gaps, the halves and the errors are those of [`analysis`](crate::analysis). What needs the samples themselves is not
//! looked for: lines of the spectrum, spikes, steps, motion, telegraph noise, covariates, a filter or a drift that channels have in
//! common, and changes of the noise. So a model may have a Markov process where the whole analysis has a temperature.

use crate::analysis::missing;
use crate::effects::Effect;
use crate::halves::first_half::FirstHalf;
use crate::halves::traced_part::{PartData, TracedPart};
use crate::parallel::{self, per_channel};
use crate::record::estimators::{HalfEstimators, RecordEstimators, RecordPart};
use crate::report::assessment::Assessment;
use crate::report::figure_data;
use crate::report::{ChannelReport, FigureData, PartNote, PartReport, Report, SCHEMA, by_cause};
use crate::rivals::causes;
use crate::rivals::table;
use crate::samples::gapped_cascade::GappedCascade;
use crate::samples::streamed_curves::StreamedCurves;
use measurement::{ChannelId, ChannelProfile, Measurement, PerChannel, RecordingDescription, SampleBlock};

/// The estimators of a recording whose samples come in blocks.
pub struct CurveEstimators {
    description: RecordingDescription,
    channels: PerChannel<StreamedCurves>,
}

/// The report of a recording in memory.
#[must_use]
pub fn analyze(measurement: &Measurement) -> Report {
    let mut estimators = CurveEstimators::new(RecordingDescription::from(measurement));
    estimators.push(&SampleBlock { slots: measurement.slots.clone(), channels: measurement.channels.clone() });
    estimators.report(&|| {})
}

impl CurveEstimators {
    /// Begins for a recording with this description, without samples.
    #[must_use]
    pub fn new(description: RecordingDescription) -> Self {
        let channel = |_: &ChannelProfile| StreamedCurves::new(&[description.middle()]);
        Self { channels: description.channels.iter().map(channel).collect(), description }
    }

    /// Takes the next samples, the channels on as many threads as there are cores.
    pub fn push(&mut self, block: &SampleBlock) {
        parallel::for_each_pair(self.channels.as_mut_slice(), &block.channels, |curves, channel| {
            curves.push(&block.slots, channel);
        });
    }

    /// The report; `done` is called for each channel that is fitted.
    #[must_use]
    pub fn report(&self, done: &(dyn Fn() + Sync)) -> Report {
        let Self { description, channels, .. } = self;
        let profile = &description.profile;
        let (estimators, halves) = record_estimators(description, channels);
        let mut whole = TracedPart::fit(&PartData { profile, curves: &estimators.both, samples: None });
        let first_half = FirstHalf::fit_curves(profile, &halves);
        whole.take_terms_that_held(&first_half.part, &estimators.second);
        let effects = |part: &TracedPart| -> Vec<Vec<Effect>> {
            let of = |channel: ChannelId| {
                if !estimators.both.channels[channel].quantity.is_inertial() {
                    return Vec::new();
                }
                let (proposals, facts) = part.proposals(profile, &estimators.both, channel, None);
                table::standing(proposals, &facts)
            };
            part.channels.ids().map(of).collect()
        };
        let duration_s = description.periods as f64 * description.period_s();
        let report = |channel: ChannelId| {
            let report = first_half.report(&whole, (&estimators, &halves), channel, false);
            let refused = channels[channel].refused.iter().map(|(&cause, &count)| (cause, count));
            let model = whole.channels[channel].fit.after();
            let has_samples = estimators.measured[channel].samples() > 0;
            let resolution = estimators.both.resolution(channel);
            let data_sheet = figure_data::data_sheet(&estimators.both.channels[channel].data_sheet);
            done();
            ChannelReport {
                samples: description.samples,
                missing: missing(description, refused, estimators.both.replaced(channel)),
                assessment: Assessment::of_model(model, (&report.unit, resolution), duration_s, has_samples),
                figure_data: FigureData { data_sheet, ..FigureData::default() },
                ..report
            }
        };
        let mut reports = per_channel(channels.ids(), report).into_vec();
        let findings = causes::find(&mut reports, &effects(&whole), &effects(&first_half.part), profile, duration_s);
        Report {
            schema: SCHEMA,
            quick: true,
            sample_rate_hz: description.sample_rate_hz,
            samples: description.samples,
            dropped: by_cause(&description.dropped),
            flagged: by_cause(&description.flagged),
            part: PartReport {
                name: profile.name.to_owned(),
                notes: vec![PartNote::NotSought],
                ..PartReport::default()
            },
            findings,
            common_mode: None,
            longest_at_rest: None,
            channels: reports,
        }
    }
}

/// The curves of the halves and of both together; nothing is excluded.
fn record_estimators(
    description: &RecordingDescription,
    channels: &PerChannel<StreamedCurves>,
) -> (RecordEstimators, HalfEstimators) {
    let profiles: PerChannel<ChannelProfile> = description.channels.iter().copied().collect();
    let part = |cascades: Vec<GappedCascade>| RecordPart::new(profiles.clone(), cascades, description.period_s());
    let half = |number: usize| part(channels.iter().map(|curves| curves.part(number)).collect());
    let halves = [half(0), half(1)];
    let measured = |(curves, profile): (&StreamedCurves, &ChannelProfile)| {
        curves.whole().curve(description.period_s()).scaled(profile.lsb)
    };
    let whole = RecordEstimators {
        measured: channels.iter().zip(&profiles).map(measured).collect(),
        both: halves[0].followed_by(&halves[1]),
        second: halves[1].clone(),
    };
    (whole, HalfEstimators { recorded: halves.clone(), foretold: halves.clone(), ruled: halves })
}
