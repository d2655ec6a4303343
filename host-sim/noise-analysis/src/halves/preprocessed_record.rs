//! A recording before and after models are fitted to all of it: what the samples of each channel show, and the effects by both.

use crate::detectors::level_change;
use crate::effects::{Effect, NoisyInterval};
use crate::fit::noise_terms::filter_length_s;
use crate::halves::traced_part::{BiasByBlocks, PartData, PartSamples, TracedPart};
use crate::parallel::{in_parallel, per_channel};
use crate::record::condensed_record::CondensedRecord;
use crate::record::estimators::{HalfEstimators, RecordEstimators};
use crate::record::preprocessing::Preprocessing;
use crate::report::Stretch;
use crate::rivals::motion::{self, PlatformMotion};
use crate::rivals::proposal::{ChannelFacts, Origin, Proposal};
use crate::rivals::slow_drift::{ChannelsInCommon, common_mode, slope_of_ends};
use crate::rivals::{signals, table, unexplained};
use crate::samples::exclusion::Exclusion;
use crate::samples::series::Series;
use crate::samples::uniform_series::UniformSeries;
use measurement::{ChannelId, Measurement, PerChannel, Quantity};

/// A recording with what its samples show before models are fitted to them.
pub(crate) struct PreprocessedRecord<'a> {
    pub record: &'a CondensedRecord<'a>,
    pub preprocessing: Preprocessing,
    pub estimators: RecordEstimators,
    /// After preprocessing.
    pub series: PerChannel<Series>,
    motions: PerChannel<Option<PlatformMotion>>,
}

impl<'a> PreprocessedRecord<'a> {
    /// Collects the evidence in the samples of `record`.
    pub(crate) fn new(record: &'a CondensedRecord<'a>) -> Self {
        let preprocessing = Preprocessing::detect(record, None);
        let estimators = RecordEstimators::estimate(record, &preprocessing);
        Self::with(record, preprocessing, estimators)
    }

    /// The same, and the estimators of both halves by what the `first_half` shows.
    pub(crate) fn with_halves(
        record: &'a CondensedRecord<'a>,
        first_half: &PreprocessedRecord,
    ) -> (Self, HalfEstimators) {
        let preprocessing = Preprocessing::detect(record, Some(&first_half.preprocessing));
        let (estimators, halves) = RecordEstimators::estimate_with_halves(record, first_half.record, &preprocessing);
        (Self::with(record, preprocessing, estimators), halves)
    }

    fn with(record: &'a CondensedRecord<'a>, preprocessing: Preprocessing, estimators: RecordEstimators) -> Self {
        let measurement = record.means.as_ref();
        let motions = per_channel(measurement.ids(), |channel| {
            let find = || motion::find(&preprocessing.measured(measurement, channel), &measurement[channel].profile);
            record.is_traced(channel).then(find).flatten()
        });
        let motions = motion::told_by_two(motions);
        let series =
            per_channel(measurement.ids(), |channel| preprocessing.series(measurement, channel, Exclusion::ByWhole));
        Self { record, preprocessing, estimators, series, motions }
    }

    pub(crate) fn fit(&self) -> TracedPart {
        let measurement = self.measurement();
        let biases = measurement.ids().map(|channel| self.bias(channel)).collect();
        let samples = PartSamples { record: self.record, series: &self.series, biases };
        let data = PartData { profile: &measurement.profile, curves: &self.estimators.both, samples: Some(samples) };
        TracedPart::fit(&data)
    }

    pub(crate) fn bias(&self, channel: ChannelId) -> BiasByBlocks {
        BiasByBlocks {
            has_ramp: self.preprocessing.has_ramp(channel),
            sensitivities: self.preprocessing.sensitivities(channel).to_vec(),
        }
    }

    /// The samples, or their means.
    pub(crate) fn measurement(&self) -> &'a Measurement {
        &self.record.means
    }

    /// The series of the channels by the rules of the first half.
    pub(crate) fn series_by_first_half(&self) -> PerChannel<Series> {
        per_channel(self.series.ids(), |channel| {
            let is_same = self.preprocessing.leaves_the_same(channel, Exclusion::ByFirstHalf, Exclusion::ByWhole);
            let other = || self.preprocessing.series(self.measurement(), channel, Exclusion::ByFirstHalf);
            if is_same { self.series[channel].clone() } else { other() }
        })
    }

    /// True if the rules of the first half leave out samples of a channel.
    pub(crate) fn has_rules(&self, channel: ChannelId) -> bool {
        let is_screened = self.record.channels[channel].samples.is_screened;
        is_screened || self.preprocessing.excludes(channel, Exclusion::ByFirstHalf)
    }

    /// Stretches in which the platform did not move, by the `effects` of each channel.
    pub(crate) fn at_rest(&self, effects: &PerChannel<Vec<Effect>>) -> Vec<Stretch> {
        let duration_s = self.measurement().periods() as f64 * self.measurement().period_s();
        let is_motion = |effect: &Effect| matches!(effect, Effect::MotionInterval(_));
        let moved = self.motions.iter().zip(effects).filter(|(_, effects)| effects.iter().any(is_motion));
        motion::at_rest(moved.filter_map(|(motion, _)| motion.as_ref()), duration_s)
    }

    /// The effects of each channel, by the models of the `whole` record.
    pub(crate) fn effects(&self, whole: &TracedPart) -> PerChannel<Vec<Effect>> {
        let commons = self.common_modes(whole);
        let of = |channel: ChannelId| {
            let common = commons.iter().find(|common| common.channels.contains(&channel));
            if self.record.is_traced(channel) { self.effects_of(whole, channel, common) } else { Vec::new() }
        };
        per_channel(self.series.ids(), of)
    }

    fn effects_of(&self, whole: &TracedPart, channel: ChannelId, common: Option<&ChannelsInCommon>) -> Vec<Effect> {
        let (measurement, trace, own) = (self.measurement(), &whole.channels[channel], &self.series[channel]);
        let moved = self.motions[channel].iter().map(|motion| {
            let mut others = self.motions.with_ids().filter(|(other, _)| *other != channel);
            let is_shared = others.any(|(_, other)| other.as_ref().is_some_and(|other| motion.is_shared_with(other)));
            Proposal::new(motion.effect, Origin::Motion { is_shared, is_sudden: motion.is_sudden })
        });
        let of_samples =
            with_knocks_joined(&self.record.channels[channel].effects, self.preprocessing.effects(channel));
        let of_samples = of_samples.into_iter().map(|effect| Proposal::new(effect, Origin::Samples));
        let (of_model, facts) = whole.proposals(&measurement.profile, &self.estimators.both, channel, common);
        let of_signals = trace.signals.iter().map(|signal| signals::proposal(signal, own.unit));
        let temperature = measurement.of_quantity(Quantity::Temperature).next();
        let level = temperature.and_then(|of| unexplained::level_by_temperature(own, &self.series[of]));
        let level = level.map(|level| Proposal::new(level, Origin::Level));
        let change = level_change::find(own).map(|change| Proposal::new(change, Origin::Level));
        let levels = level.into_iter().chain(change);
        let proposals = moved.chain(of_samples).chain(of_model).chain(of_signals).chain(levels).collect();
        table::standing(proposals, &ChannelFacts { slope_of_ends: Some(slope_of_ends(own)), ..facts })
    }

    /// The drift that the gyroscopes have in common, and that of the accelerometers.
    fn common_modes(&self, whole: &TracedPart) -> Vec<ChannelsInCommon> {
        let traces = &whole.channels;
        let filter_s = traces.iter().map(|trace| filter_length_s(trace.fit.after())).fold(0.0, f64::max);
        let of_quantity = |quantity: &Quantity| {
            let named = |channel: ChannelId| (channel, self.measurement()[channel].profile.name);
            let rest = |channel: ChannelId| Some((named(channel), traces[channel].rest.clone()?));
            let (channels, rests): (Vec<_>, Vec<UniformSeries>) =
                self.measurement().of_quantity(*quantity).filter_map(rest).unzip();
            common_mode(&channels, &rests, filter_s)
        };
        in_parallel(&[Quantity::AngularRate, Quantity::SpecificForce], of_quantity).into_iter().flatten().collect()
    }
}

/// The effects that the samples of a channel show, and their means. Knocks that follow each other at less than the length of the shorter are
/// one: of a condensed record the samples show a long one in pieces, and the means, which lack these, the rest.
fn with_knocks_joined(of_samples: &[Effect], of_means: &[Effect]) -> Vec<Effect> {
    let knock = |effect: &Effect| match effect {
        Effect::NoisyInterval(knock) => Some(knock.clone()),
        _ => None,
    };
    let mut pieces = of_samples.iter().filter_map(knock).peekable();
    if pieces.peek().is_none() {
        return of_samples.iter().chain(of_means).cloned().collect();
    }
    let mut knocks: Vec<NoisyInterval> = Vec::new();
    for mut knock in of_means.iter().filter_map(knock).chain(pieces) {
        while let Some(near) = knocks.iter().position(|of| of.is_near(&knock)) {
            knock = knocks.remove(near).extended_by(&knock);
        }
        knocks.push(knock);
    }
    let others = of_samples.iter().chain(of_means).filter(|effect| knock(effect).is_none()).cloned();
    others.chain(knocks.into_iter().map(Effect::from)).collect()
}
