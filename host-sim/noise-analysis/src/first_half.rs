//! Models of the first half of a recording, and their errors on the second half, which they have not seen.

use crate::OCTAVES;
use crate::channel_fit::ChannelFit;
use crate::contradiction::Contradiction;
use crate::covariates::CovariateFit;
use crate::detectors::bias;
use crate::estimators::RecordPart;
use crate::nonstationarity::{self, ChannelEpochs, EpochCurves, Nonstationarity, TracedChannel};
use crate::parallel::per_channel;
use crate::preprocessing::Exclusion;
use crate::report::{ModelErrorReport, ModelReport, term_reports};
use crate::series::Series;
use crate::spectra::cosine_spectrum::CosineSpectrum;
use crate::spectral_lines::{MergedLine, fit_with_lines};
use crate::traced_record::{Condensed, TracedRecord, agree_on_filter};
use crate::uniform_series::UniformSeries;
use allan_core::{Curve, Model};
use measurement::{ChannelId, PerChannel};

/// The models of every channel by the first half alone.
pub(crate) struct FirstHalf {
    pub channels: PerChannel<FirstHalfFit>,
    /// The series of [`TracedRecord::series`] without what the rules of the first half exclude, in both halves.
    series: PerChannel<Series>,
}

/// The models of one channel by the first half alone.
pub(crate) struct FirstHalfFit {
    /// The baseline model of the first half as it was recorded, with its spikes and knocks.
    raw: Model,
    pub fit: ChannelFit,
    slowest: Option<CosineSpectrum>,
    /// Lines in the spectrum.
    lines: Vec<MergedLine>,
    /// Curves of the channel's epochs; `None` of a record that is too short for them, and of a channel that is not traced.
    epoch_curves: Option<EpochCurves>,
    /// The same, with the part of the first half that `fit` is fitted to.
    epochs: Option<ChannelEpochs>,
}

impl FirstHalf {
    pub(crate) fn fit(record: &TracedRecord) -> Self {
        let series = record.series_without(Exclusion::ByFirstHalf);
        let middle = record.measurement.middle();
        let halves = series.map(|series| series.before(middle));
        let mut channels = per_channel(record.channels.ids(), |channel| {
            if record.is_traced(channel) {
                FirstHalfFit::trace(record, channel, &series, &halves)
            } else {
                FirstHalfFit::baseline(record, channel)
            }
        });
        let fits = record.channels.ids().zip(channels.iter_mut().map(|of| &mut of.fit));
        // The filter of the whole record is the one that is reported.
        let _of_first_half = agree_on_filter(record.measurement, &record.estimators, fits);
        for FirstHalfFit { fit, slowest, lines, .. } in &mut channels {
            let frequencies = || lines.iter().map(|line| line.frequency.value);
            slowest.iter().for_each(|spectrum| fit.add_markov_of_spectrum(spectrum, frequencies()));
        }
        channels.iter_mut().for_each(FirstHalfFit::fit_to_recent);
        Self { channels, series }
    }

    /// How the noise of each traced channel changes.
    pub(crate) fn nonstationarities(&self, record: &TracedRecord) -> PerChannel<Option<Nonstationarity>> {
        let traced: Vec<ChannelId> = record.measurement.inertial().collect();
        let of = |&channel: &ChannelId| {
            let half = &self.channels[channel];
            TracedChannel {
                name: record.measurement[channel].profile.name,
                series: &self.series[channel],
                shorter: record.condensed.map(|of| (of.shorter, &of.shorter.channels[channel])),
                epochs: half.epochs.as_ref(),
                baseline: &half.fit.before,
                model: half.fit.after(),
            }
        };
        let channels: Vec<TracedChannel> = traced.iter().map(of).collect();
        per_channel(record.channels.ids(), |channel| {
            nonstationarity::describe(&channels, traced.iter().position(|of| *of == channel)?)
        })
    }
}

impl FirstHalfFit {
    /// The baseline model alone.
    fn baseline(record: &TracedRecord, channel: ChannelId) -> Self {
        let covariates = CovariateFit::estimate(&record.estimators.ruled[0], channel, false, |_| None);
        let fit = ChannelFit::fit_baseline(covariates);
        Self { raw: fit.before.clone(), fit, slowest: None, lines: Vec::new(), epoch_curves: None, epochs: None }
    }

    /// The baseline model and what it lacks; `halves` are the first halves of `series`.
    fn trace(
        record: &TracedRecord,
        channel: ChannelId,
        series: &PerChannel<Series>,
        halves: &PerChannel<Series>,
    ) -> Self {
        let (estimators, preprocessing) = (&record.estimators, &record.preprocessing);
        let quantity = |of: ChannelId| record.measurement[of].profile.quantity;
        let slow: Vec<ChannelId> = halves.ids().filter(|&of| quantity(of).is_environment()).collect();
        let slow_halves: Vec<&Series> = slow.iter().map(|&of| &halves[of]).collect();
        let own = &halves[channel];
        let bias_changes = bias::find(own, &slow_halves, &[], &record.noise_grids);
        let sensitivity = |regressor: ChannelId| {
            let is_of = |(number, _): &&(usize, bias::BiasSensitivity)| slow[*number] == regressor;
            bias_changes.sensitivities.iter().find(is_of).map(|(_, followed)| *followed)
        };
        let has_ramp = preprocessing.has_ramp(channel);
        let has_rules = halves.ids().any(|of| record.has_rules(of));
        let raw = has_rules.then(|| {
            let raw = CovariateFit::estimate(&estimators.raw[0], channel, has_ramp, sensitivity);
            ChannelFit::fit_baseline(raw).before
        });
        let covariates = CovariateFit::estimate(&estimators.ruled[0], channel, has_ramp, sensitivity);
        let followed = covariates.compensated_series(&series[channel], series);
        let middle = record.measurement.middle();
        let epoch_curves = EpochCurves::from_series(followed.as_ref().unwrap_or(&series[channel]), middle);
        let epoch_curves = match record.condensed {
            Some(Condensed { shorter, .. }) => {
                epoch_curves.map(|curves| curves.in_samples(shorter, &shorter.channels[channel]))
            }
            None => epoch_curves,
        };
        let rest = covariates.compensated_series(own, halves);
        let faster = record.condensed.map(|condensed| condensed.faster_lines[channel].as_slice());
        let (fit, lines) = fit_with_lines(covariates, own, rest.as_ref(), &record.measurement.profile, faster);
        let raw = raw.unwrap_or_else(|| fit.before.clone());
        let rest = UniformSeries::from_series(rest.as_ref().unwrap_or(own));
        Self { raw, fit, slowest: CosineSpectrum::new(&rest), lines, epoch_curves, epochs: None }
    }

    /// Fits the model to the later quarter of the first half where its noise changes.
    fn fit_to_recent(&mut self) {
        let Some(curves) = self.epoch_curves.take() else { return };
        let epochs = ChannelEpochs::compare(curves, self.fit.after());
        if let Some(recent) = epochs.recent_curve() {
            self.fit.fit_to(&recent);
        }
        self.epochs = Some(epochs);
    }

    /// The error on the second half of the curve of the first half itself.
    pub(crate) fn curve_error(&self, record: &TracedRecord, channel: ChannelId) -> ModelErrorReport {
        let unseen = self.fit.covariates.compensated(&record.estimators.raw[1], channel);
        ModelErrorReport::of_curve(&self.fit.covariates.curve, &unseen, self.fit.after())
    }

    /// Whether the second half does not contradict the model with the added terms.
    pub(crate) fn held(&self, record: &TracedRecord, channel: ChannelId) -> bool {
        let unseen = self.fit.covariates.compensated(&record.estimators.ruled[1], channel);
        Contradiction::find(self.fit.after(), &unseen).is_none()
    }

    /// The baseline model of the first half as it was recorded.
    pub(crate) fn before(&self, record: &TracedRecord, channel: ChannelId, whole: &Curve<OCTAVES>) -> ModelReport {
        let estimators = &record.estimators;
        let error = |part: &RecordPart| ModelErrorReport::new(&self.raw, &part.curve(channel));
        ModelReport {
            terms: term_reports(&self.raw, record.measurement[channel].profile.unit),
            adev: whole.points().iter().map(|point| self.raw.avar(point.n).sqrt()).collect(),
            fitted: error(&estimators.raw[0]),
            unseen: error(&estimators.raw[1]),
            unseen_excluding: record.has_rules(channel).then(|| error(&estimators.ruled[1])),
        }
    }

    /// The model with the added terms, without what the rules of the first half exclude. `avar_of` is the Allan variance of a
    /// channel of the whole record at an averaging factor.
    pub(crate) fn after(
        &self,
        record: &TracedRecord,
        channel: ChannelId,
        whole: &Curve<OCTAVES>,
        avar_of: impl Fn(ChannelId, u64) -> Option<f64>,
    ) -> ModelReport {
        let estimators = &record.estimators;
        let (model, covariates) = (self.fit.after(), &self.fit.covariates);
        let unseen = |part: &RecordPart| ModelErrorReport::new(model, &covariates.compensated(part, channel));
        ModelReport {
            terms: term_reports(model, record.measurement[channel].profile.unit),
            adev: self.fit.deviations(&estimators.both, channel, whole, avar_of),
            fitted: ModelErrorReport::new(model, self.fit.fitted_curve()),
            unseen: unseen(&estimators.raw[1]),
            unseen_excluding: record.has_rules(channel).then(|| unseen(&estimators.ruled[1])),
        }
    }
}
