//! Models of the first half of a recording, fitted to be compared with the second half, which they have not seen, and their errors on it.

use crate::OCTAVES;
use crate::fit::channel_fit::ChannelFit;
use crate::fit::covariates::CovariateFit;
use crate::fit::event_share::EventShare;
use crate::fit::sample_coefficients::{SamplesOfCurve, by_samples};
use crate::fit::signal_share::SignalShare;
use crate::halves::preprocessed_record::PreprocessedRecord;
use crate::halves::traced_part::{PartData, TracedPart};
use crate::nonstationarity::{self, ChannelEpochs, EpochCurves, Nonstationarity, TracedChannel};
use crate::parallel::{self, per_channel};
use crate::record::estimators::{HalfEstimators, RecordEstimators, RecordPart};
use crate::report::assessment::Assessment;
use crate::report::{
    ChannelReport, CurvePoint, FigureData, MissingSamples, ModelErrorReport, ModelReport, SlopeMethodReport,
    TermReport, term_reports,
};
use crate::samples::exclusion::Exclusion;
use crate::samples::rounding::Rounding;
use crate::samples::series::Series;
use crate::samples::uniform_series::UniformSeries;
use allan_core::{AllanPoint, Curve, Model};
use measurement::{ChannelId, PerChannel, SensorProfile};

/// The models of every channel by the first half alone.
pub(crate) struct FirstHalf {
    /// Without what the rules of the first half exclude. Of noise that changes, the model is fitted to the later quarter.
    pub part: TracedPart,
    /// The baseline models of the first half as it was recorded, with its spikes and knocks.
    raw: PerChannel<Model>,
    /// The share of these in the models of `part`.
    events: PerChannel<EventShare>,
}

/// Changes of each channel's noise.
pub(crate) struct Epochs {
    /// The series of [`PreprocessedRecord::series`] without what the rules of the first half exclude, in both halves.
    series: PerChannel<Series>,
    /// Curves of the channel's epochs, with the part of the first half that its model is fitted to; `None` of a record that is too
    /// short for them, and of a channel that is not traced.
    channels: PerChannel<Option<ChannelEpochs>>,
}

impl FirstHalf {
    /// Prepares the models of the `half` for the rest of the `whole`, and tells how the noise changes; `estimators` are of both halves.
    pub(crate) fn new(
        whole: &PreprocessedRecord,
        half: &PreprocessedRecord,
        mut part: TracedPart,
        estimators: &HalfEstimators,
    ) -> (Self, Epochs) {
        let PreprocessedRecord { preprocessing, record, .. } = whole;
        let series = whole.series_by_first_half();
        let middle = whole.measurement().middle();
        let events = per_channel(series.ids(), |channel| {
            let excluded = preprocessing.excluded_events(channel, middle);
            let screened = &half.record.channels[channel].screened;
            if excluded.is_empty() && screened.is_empty() {
                return EventShare::default();
            }
            let fit = &part.channels[channel].fit;
            let [with, without] = [&estimators.foretold[0], &estimators.ruled[0]]
                .map(|of| fit.signals.left_of(&fit.covariates.compensated(of, channel)));
            let recorded = preprocessing.series(whole.measurement(), channel, Exclusion::BiasOfFirstHalf);
            EventShare::of_first_half((&recorded.before(middle), &excluded), screened, (&with, &without))
        });
        let channels = per_channel(series.ids(), |channel| {
            let (fit, own) = (&part.channels[channel].fit, &series[channel]);
            let followed = fit.covariates.compensated_series(own, &series, middle);
            let curves = || EpochCurves::from_series(followed.as_ref().unwrap_or(own), middle);
            let curves = record.is_traced(channel).then(curves).flatten()?;
            let curves = curves.in_samples(&record.channels[channel].samples).without(&fit.signals);
            Some(ChannelEpochs::compare(curves, fit.after()))
        });
        let of_channels: Vec<&Option<ChannelEpochs>> = channels.iter().collect();
        parallel::for_each_pair(part.channels.as_mut_slice(), &of_channels, |trace, epochs| {
            if let Some(epochs) = epochs {
                trace.fit.take_terms_that_foretell(epochs.quarter_curves());
            }
            if let Some(recent) = epochs.as_ref().and_then(ChannelEpochs::recent_curve) {
                trace.fit.fit_to(&recent);
            }
        });
        part.take_coefficients_of_samples();
        let raw = per_channel(series.ids(), |channel| {
            let (bias, curves) = (half.bias(channel), &estimators.recorded[0]);
            let covariates = CovariateFit::estimate(curves, channel, bias.has_ramp, |to| bias.sensitivity(to));
            let own = preprocessing.series(whole.measurement(), channel, Exclusion::Nothing).before(middle);
            let rest = covariates.compensated_series(&own, &half.series, middle).unwrap_or(own);
            let ChannelFit { covariates, before, .. } = ChannelFit::fit_baseline(covariates);
            let is_screened = half.record.channels[channel].samples.is_screened;
            let spectrum = half.record.spectrum_within(channel, 0..middle).filter(|_| !is_screened);
            let rest = UniformSeries::from_series(&rest).with_rounding(covariates.rounding().clone());
            let samples = SamplesOfCurve { rest: &rest, spectrum: spectrum.as_ref() };
            by_samples(&covariates.curve, &before, samples).unwrap_or(before)
        });
        (Self { part, raw, events }, Epochs { series, channels })
    }

    /// The models by the curves of the halves alone.
    pub(crate) fn fit_curves(profile: &SensorProfile, estimators: &HalfEstimators) -> Self {
        let part = TracedPart::fit(&PartData { profile, curves: &estimators.ruled[0], samples: None });
        let raw = part.channels.map(|trace| trace.fit.before.clone());
        Self { raw, events: part.channels.map(|_| EventShare::default()), part }
    }

    /// Reports a channel by the curves and models of the first half and of the `whole`. If the first half `has_rules` for exclusions,
    /// the errors without the excluded samples are reported too.
    pub(crate) fn report(
        &self,
        whole: &TracedPart,
        (estimators, halves): (&RecordEstimators, &HalfEstimators),
        channel: ChannelId,
        has_rules: bool,
    ) -> ChannelReport {
        let (unit, resolution) = (estimators.both.channels[channel].unit, estimators.both.resolution(channel));
        let fit = &whole.channels[channel].fit;
        let baseline = &self.part.channels[channel].fit.before;
        let curve = estimators.measured[channel].clone();
        let curve = curve.with_confidence(|point| baseline.variance_fractions(point.n));
        let rounding = estimators.both.rounding(channel);
        let after = self.after((estimators, halves), channel, (&curve, &rounding), has_rules);
        // The model with the added terms, fitted to the whole record, with the errors of `after`.
        let refitted = ModelReport {
            terms: term_reports(fit.after(), unit, resolution),
            adev: self.as_recorded((fit, &fit.signals), estimators, channel, (&curve, &rounding)),
            ..after.clone()
        };
        let point = |point: &AllanPoint| CurvePoint {
            rounding: rounding.correlated_avar(point.n).sqrt(),
            ..CurvePoint::new(point, curve.samples())
        };
        ChannelReport {
            name: estimators.both.channels[channel].name.to_owned(),
            unit: unit.to_owned(),
            samples: curve.samples(),
            missing: MissingSamples::default(),
            curve: curve.points().iter().map(point).collect(),
            unseen_adev: unseen_adev(&curve, &halves.recorded[1].curve(channel)),
            read_off: SlopeMethodReport::from_curve(&curve, unit),
            before: self.before(halves, channel, (&curve, &rounding), has_rules),
            effects: Vec::new(),
            first_half_curve: self.curve_error(halves, channel),
            after,
            refitted,
            nonstationarity: None,
            at_rest: Vec::new(),
            assessment: Assessment::default(),
            figure_data: FigureData::default(),
        }
    }

    /// The error on the second half of the curve of the first, both as recorded but for the bias that the first half foretells.
    fn curve_error(&self, halves: &HalfEstimators, channel: ChannelId) -> ModelErrorReport {
        let fit = &self.part.channels[channel].fit;
        let [first, second] = [0, 1].map(|half| fit.covariates.compensated(&halves.foretold[half], channel));
        ModelErrorReport::of_curve(&first, &second, fit.after(), &self.events[channel])
    }

    /// The baseline model of the first half as it was recorded, at the points of the curve of the `whole` record.
    fn before(
        &self,
        halves: &HalfEstimators,
        channel: ChannelId,
        (whole, rounding): (&Curve<OCTAVES>, &Rounding),
        has_rules: bool,
    ) -> ModelReport {
        let model = &self.raw[channel];
        let with_rounding = |point: &AllanPoint| (model.avar(point.n) + rounding.correlated_avar(point.n)).sqrt();
        let error = |part: &RecordPart| ModelErrorReport::new(model, &part.curve_before_rounding(channel));
        ModelReport {
            terms: terms_of(model, &halves.recorded[0], channel),
            adev: whole.points().iter().map(with_rounding).collect(),
            fitted: error(&halves.recorded[0]),
            unseen: error(&halves.recorded[1]),
            unseen_excluding: has_rules.then(|| error(&halves.ruled[1])),
            events: None,
        }
    }

    /// The same of the model with the added terms.
    fn after(
        &self,
        (estimators, halves): (&RecordEstimators, &HalfEstimators),
        channel: ChannelId,
        (whole, rounding): (&Curve<OCTAVES>, &Rounding),
        has_rules: bool,
    ) -> ModelReport {
        let fit = &self.part.channels[channel].fit;
        let model = fit.after();
        let events = &self.events[channel];
        // The second half has the frequencies that follow those of the first.
        let [signals, of_both] = [[1.0, 2.0], [0.0, 2.0]].map(|times| fit.signals.within(times));
        let error = |events: &EventShare, part: &RecordPart| {
            ModelErrorReport::with_shares(model, (&signals, events), &fit.covariates.compensated(part, channel))
        };
        let (fitted, of_fitted) = fit.fitted_curve();
        let none = EventShare::default();
        ModelReport {
            terms: terms_of(model, &halves.foretold[0], channel),
            adev: self.as_recorded((fit, &of_both), estimators, channel, (whole, rounding)),
            fitted: ModelErrorReport::with_shares(model, (&of_fitted, &none), fitted),
            unseen: error(events, &halves.foretold[1]),
            unseen_excluding: has_rules.then(|| error(&none, &halves.ruled[1])),
            events: events.report(whole.points().iter().map(|point| point.n)),
        }
    }

    /// The Allan deviations that the model of `fit` foretells at the points of the curve of the `whole` record: with the shares of the
    /// covariates, of the `signals`, of the events and of correlated rounding errors.
    fn as_recorded(
        &self,
        (fit, signals): (&ChannelFit, &SignalShare),
        estimators: &RecordEstimators,
        channel: ChannelId,
        (whole, rounding): (&Curve<OCTAVES>, &Rounding),
    ) -> Vec<f64> {
        let events = &self.events[channel];
        let added = |n: u64| events.avar(n) + rounding.correlated_avar(n) + signals.avar(n, whole.sample_period());
        let with = |(point, deviation): (&AllanPoint, f64)| (deviation * deviation + added(point.n)).sqrt();
        whole.points().iter().zip(fit.deviations(estimators, channel, whole)).map(with).collect()
    }
}

impl Epochs {
    pub(crate) fn series(&self, channel: ChannelId) -> &Series {
        &self.series[channel]
    }

    pub(crate) fn nonstationarities(
        &self,
        record: &PreprocessedRecord,
        first_half: &FirstHalf,
    ) -> PerChannel<Option<Nonstationarity>> {
        let traced: Vec<ChannelId> = record.measurement().inertial().collect();
        let of = |&channel: &ChannelId| {
            let fit = &first_half.part.channels[channel].fit;
            TracedChannel {
                name: record.measurement()[channel].profile.name,
                series: &self.series[channel],
                samples: &record.record.channels[channel].samples,
                epochs: self.channels[channel].as_ref(),
                baseline: &fit.before,
                model: fit.after(),
            }
        };
        let channels: Vec<TracedChannel> = traced.iter().map(of).collect();
        per_channel(self.series.ids(), |channel| {
            nonstationarity::describe(&channels, traced.iter().position(|of| *of == channel)?)
        })
    }
}

fn terms_of(model: &Model, part: &RecordPart, channel: ChannelId) -> Vec<TermReport> {
    term_reports(model, part.channels[channel].unit, part.resolution(channel))
}

/// Allan deviations of the `second` half at the first averaging times of the `whole` record.
fn unseen_adev(whole: &Curve<OCTAVES>, second: &Curve<OCTAVES>) -> Vec<f64> {
    let pairs = whole.points().iter().zip(second.points());
    pairs.take_while(|(whole, second)| whole.n == second.n).map(|(_, second)| second.avar.sqrt()).collect()
}
