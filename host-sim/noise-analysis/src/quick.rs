//! The report of the curves alone: measured Allan deviation, models, errors on the unseen half, and what the trace of the curves
//! finds. The samples come in blocks and are not kept.
//!
//! Curves and gaps, the halves and the errors are those of [`analysis`](crate::analysis). What needs the samples themselves is not
//! looked for: lines of the spectrum, spikes, steps, motion, telegraph noise, covariates, a filter or a drift that channels have in
//! common, and changes of the noise. So a model may have a Markov process where the whole analysis has a temperature.

use crate::assessment::Assessment;
use crate::causes;
use crate::channel_fit::ChannelFit;
use crate::contradiction::Contradiction;
use crate::covariates::CovariateFit;
use crate::estimators::RecordPart;
use crate::figure_data;
use crate::findings::Effect;
use crate::naming::{ChannelFindings, name_effects};
use crate::parallel::{self, per_channel};
use crate::report::{
    ChannelReport, CurvePoint, FigureData, MissingSamples, ModelErrorReport, ModelReport, PartReport, Report, SCHEMA,
    SlopeMethodReport, by_cause, term_reports,
};
use crate::streamed_curves::{StreamedCurves, joined};
use crate::unexplained;
use allan_core::{Cascade, Model};
use measurement::{ChannelId, ChannelProfile, Measurement, PerChannel, RecordingDescription, SampleBlock};
use std::collections::BTreeMap;

/// Why there is neither clock nor filter.
const PART_NOTE: &str = "clock and filter of the part are not estimated in a quick report";

/// The estimators of a recording whose samples come in blocks.
pub struct CurveEstimators {
    description: RecordingDescription,
    channels: Vec<StreamedCurves>,
}

/// The report of a recording in memory.
#[must_use]
pub fn analyze(measurement: &Measurement) -> Report {
    let mut estimators = CurveEstimators::new(RecordingDescription::from(measurement));
    estimators.push(&SampleBlock { slots: measurement.slots.clone(), channels: measurement.channels.clone() });
    estimators.report(&|| {})
}

impl CurveEstimators {
    /// Of the recording of this description, without samples.
    #[must_use]
    pub fn new(description: RecordingDescription) -> Self {
        let channel = |_: &ChannelProfile| StreamedCurves::new(&[description.middle()]);
        Self { channels: description.channels.iter().map(channel).collect(), description }
    }

    /// Takes the next samples, the channels on as many threads as there are cores.
    pub fn push(&mut self, block: &SampleBlock) {
        parallel::for_each_pair(&mut self.channels, &block.channels, |curves, channel| {
            curves.push(&block.slots, channel);
        });
    }

    /// The report; `done` is called for each channel that is fitted.
    #[must_use]
    pub fn report(&self, done: &(dyn Fn() + Sync)) -> Report {
        let Self { description, channels, .. } = self;
        let parts = Parts::new(description, channels);
        let fitted = per_channel(parts.both.channels.ids(), |channel| {
            let fitted = FittedChannel::fit(description, channel, &parts);
            done();
            fitted
        });
        let (effects, of_half): (Vec<Vec<Effect>>, Vec<Vec<Effect>>) =
            fitted.iter().map(|channel| channel.effects(description, &parts)).unzip();
        let mut channels: Vec<ChannelReport> =
            fitted.iter().zip(channels).map(|(fitted, of)| fitted.report(description, &parts, of)).collect();
        let duration_s = description.periods as f64 * description.period_s();
        let findings = causes::find(&mut channels, &effects, &of_half, &description.profile, duration_s);
        Report {
            schema: SCHEMA,
            quick: true,
            sample_rate_hz: description.sample_rate_hz,
            samples: description.samples,
            dropped: by_cause(&description.dropped),
            flagged: by_cause(&description.flagged),
            part: PartReport {
                name: description.profile.name.to_owned(),
                note: Some(PART_NOTE.to_owned()),
                ..PartReport::default()
            },
            findings,
            common_mode: None,
            channels,
        }
    }
}

/// The curves of all channels in the parts of the recording.
struct Parts {
    first: RecordPart,
    second: RecordPart,
    both: RecordPart,
}

impl Parts {
    fn new(description: &RecordingDescription, channels: &[StreamedCurves]) -> Self {
        let profiles: PerChannel<ChannelProfile> = description.channels.iter().copied().collect();
        let part = |cascades| RecordPart::new(profiles.clone(), cascades, description.period_s());
        let half = |number: usize| {
            let of = |curves: &StreamedCurves| {
                curves.parts().nth(number).map_or_else(Cascade::new, |(_, half)| half.clone())
            };
            part(channels.iter().map(of).collect())
        };
        let all = |curves: &StreamedCurves| joined(curves.parts().map(|(_, part)| part));
        Self { first: half(0), second: half(1), both: part(channels.iter().map(all).collect()) }
    }
}

/// A channel with its models.
struct FittedChannel {
    channel: ChannelId,
    profile: ChannelProfile,
    /// Of the first half.
    half: ChannelFit,
    /// Of the whole record.
    fit: ChannelFit,
}

impl FittedChannel {
    fn fit(description: &RecordingDescription, channel: ChannelId, parts: &Parts) -> Self {
        let profile = parts.both.channels[channel];
        let filters = &description.profile.filters;
        let fit = |part: &RecordPart| {
            let curve = CovariateFit::estimate(part, channel, false, |_| None);
            if profile.quantity.is_inertial() {
                ChannelFit::fit_curve(curve, filters)
            } else {
                ChannelFit::fit_baseline(curve)
            }
        };
        let (half, mut fit) = (fit(&parts.first), fit(&parts.both));
        // The terms that held on the second half are those of the whole record, as in the whole analysis.
        let held = || Contradiction::find(half.after(), &parts.second.curve(channel)).is_none();
        if profile.quantity.is_inertial() && held() {
            fit.take_terms_that_held(&half.traced, None);
        }
        Self { channel, profile, half, fit }
    }

    /// The effects of the channel in the whole record and in its first half.
    fn effects(&self, description: &RecordingDescription, parts: &Parts) -> (Vec<Effect>, Vec<Effect>) {
        if !self.profile.quantity.is_inertial() {
            return (Vec::new(), Vec::new());
        }
        let (profile, resolution) = (&description.profile, parts.both.resolution(self.channel));
        let of = |fit: &ChannelFit| {
            let findings = ChannelFindings {
                channel: self.profile,
                resolution,
                fit,
                sensitivities: Vec::new(),
                lines: None,
                telegraph: None,
                common: None,
                rest: None,
            };
            let mut effects = name_effects(profile, &findings);
            effects.extend(unexplained::by_curve(fit, profile, resolution, 0.0));
            effects
        };
        (of(&self.fit), of(&self.half))
    }

    fn report(&self, description: &RecordingDescription, parts: &Parts, estimators: &StreamedCurves) -> ChannelReport {
        let unit = self.profile.unit;
        let (before, after) = (&self.half.before, self.half.after());
        let [first, second] = [&parts.first, &parts.second].map(|part| part.curve(self.channel));
        let whole = estimators.whole().curve(description.period_s()).scaled(self.profile.lsb);
        let whole = whole.with_confidence(|point| before.variance_fractions(point.n));
        let deviations = |model: &Model| whole.points().iter().map(|point| model.avar(point.n).sqrt()).collect();
        let of_half = |model: &Model| ModelReport {
            terms: term_reports(model, unit),
            adev: deviations(model),
            fitted: ModelErrorReport::new(model, &first),
            unseen: ModelErrorReport::new(model, &second),
            unseen_excluding: None,
        };
        let (refitted, after_report) = (self.fit.after(), of_half(after));
        let duration_s = description.periods as f64 * description.period_s();
        let has_samples = whole.samples() > 0;
        ChannelReport {
            name: self.profile.name.to_owned(),
            unit: unit.to_owned(),
            samples: description.samples,
            missing: missing_samples(description, parts.both.replaced(self.channel), estimators),
            curve: whole.points().iter().map(|point| CurvePoint::new(point, whole.samples())).collect(),
            read_off: SlopeMethodReport::from_curve(&whole, unit),
            before: of_half(before),
            effects: Vec::new(),
            first_half_curve: ModelErrorReport::of_curve(&first, &second, after),
            refitted: ModelReport {
                terms: term_reports(refitted, unit),
                adev: deviations(refitted),
                ..after_report.clone()
            },
            after: after_report,
            nonstationarity: None,
            at_rest: Vec::new(),
            assessment: Assessment::of_model(refitted, unit, duration_s, has_samples),
            figure_data: FigureData {
                data_sheet: figure_data::data_sheet(&self.profile.data_sheet),
                ..FigureData::default()
            },
        }
    }
}

/// Samples of a channel that are missing in its model.
fn missing_samples(description: &RecordingDescription, replaced: u64, estimators: &StreamedCurves) -> MissingSamples {
    let mut refused: BTreeMap<String, u64> = BTreeMap::new();
    let of_all = description.dropped.iter().filter(|(cause, _)| **cause != "gap");
    for (&cause, &count) in of_all.chain(&estimators.refused).filter(|(_, count)| **count > 0) {
        *refused.entry(cause.to_owned()).or_insert(0) += count;
    }
    let lost = description.dropped.get("gap").copied().unwrap_or(0);
    MissingSamples { lost, refused, replaced }
}
