//! What all of a recording shows: the effects in the samples of each channel, and the models of the whole.

use crate::detectors::noise_grid::NoiseGrids;
use crate::detectors::random_telegraph;
use crate::effects::Effect;
use crate::fit::noise_terms::filter_length_s;
use crate::halves::traced_part::{BiasByBlocks, PartData, PartSamples, TracedPart};
use crate::parallel::{in_parallel, per_channel};
use crate::record::condensed_record::CondensedRecord;
use crate::record::estimators::RecordEstimators;
use crate::record::preprocessing::Preprocessing;
use crate::report::Stretch;
use crate::rivals::motion::{self, PlatformMotion};
use crate::rivals::slow_drift::{ChannelsInCommon, common_mode, goes_as_far_as_ramp};
use crate::rivals::unexplained;
use crate::samples::exclusion::Exclusion;
use crate::samples::series::Series;
use crate::samples::uniform_series::UniformSeries;
use crate::spectra::spectral_lines::MergedLine;
use measurement::{ChannelId, Measurement, PerChannel, Quantity};

/// A recording with what was found in all of it.
pub(crate) struct TracedRecord<'a> {
    pub record: &'a CondensedRecord<'a>,
    /// Covariances of the block means of each channel's noise, computed once.
    pub noise_grids: NoiseGrids,
    pub preprocessing: Preprocessing,
    pub estimators: RecordEstimators,
    /// After preprocessing.
    pub series: PerChannel<Series>,
    /// The models of the whole record.
    pub part: TracedPart,
    motions: PerChannel<Option<PlatformMotion>>,
}

impl<'a> TracedRecord<'a> {
    /// What `record` shows.
    pub(crate) fn new(record: &'a CondensedRecord<'a>) -> Self {
        let measurement = record.means.as_ref();
        let noise_grids = NoiseGrids::default();
        let preprocessing = Preprocessing::detect(record, &noise_grids);
        let estimators = RecordEstimators::estimate(record, &preprocessing);
        let moved = per_channel(measurement.ids(), |channel| {
            let find = || motion::find(&preprocessing.measured(measurement, channel), &measurement[channel].profile);
            record.is_traced(channel).then(find).flatten()
        });
        let series =
            per_channel(measurement.ids(), |channel| preprocessing.series(measurement, channel, Exclusion::ByWhole));
        let bias = |channel: ChannelId| BiasByBlocks {
            has_ramp: preprocessing.has_ramp(channel),
            sensitivities: preprocessing.sensitivities(channel).to_vec(),
        };
        let biases = measurement.ids().map(bias).collect();
        let samples = PartSamples { record, series: &series, biases, seeks_signals: true };
        let data = PartData { profile: &measurement.profile, curves: &estimators.both, samples: Some(samples) };
        let part = TracedPart::fit(&data);
        let distance_of_levels = |channel: ChannelId| Some(part.channels[channel].telegraph.as_ref()?.amplitude.value);
        let motions = motion::of_platform(moved, distance_of_levels);
        Self { record, noise_grids, preprocessing, estimators, series, part, motions }
    }

    /// The samples, or their means.
    pub(crate) fn measurement(&self) -> &'a Measurement {
        &self.record.means
    }

    /// The series of the channels, without the samples of `exclusion`.
    pub(crate) fn series_without(&self, exclusion: Exclusion) -> PerChannel<Series> {
        per_channel(self.series.ids(), |channel| {
            let is_same = self.preprocessing.leaves_the_same(channel, exclusion, Exclusion::ByWhole);
            let other = || self.preprocessing.series(self.measurement(), channel, exclusion);
            if is_same { self.series[channel].clone() } else { other() }
        })
    }

    /// Whether the rules of the first half leave out samples of a channel.
    pub(crate) fn has_rules(&self, channel: ChannelId) -> bool {
        let is_screened = self.record.channels[channel].samples.is_screened;
        is_screened || self.preprocessing.excludes(channel, Exclusion::ByFirstHalf)
    }

    /// Stretches in which the platform did not move.
    pub(crate) fn at_rest(&self) -> Vec<Stretch> {
        let duration_s = self.measurement().periods() as f64 * self.measurement().period_s();
        motion::at_rest(self.motions.iter().flatten(), duration_s)
    }

    /// The effects of each channel.
    pub(crate) fn effects(&self) -> PerChannel<Vec<Effect>> {
        let commons = self.common_modes();
        let of = |channel: ChannelId| {
            let common = commons.iter().find(|common| common.channels.contains(&channel));
            if self.record.is_traced(channel) { self.effects_of(channel, common) } else { Vec::new() }
        };
        self.series.ids().map(of).collect()
    }

    fn effects_of(&self, channel: ChannelId, common: Option<&ChannelsInCommon>) -> Vec<Effect> {
        let Self { preprocessing, estimators, .. } = self;
        let measurement = self.measurement();
        let (trace, own) = (&self.part.channels[channel], &self.series[channel]);
        let moved = self.motions[channel].iter().map(|motion| Effect::from(motion.effect));
        let of_samples = self.record.channels[channel].effects.iter().chain(preprocessing.effects(channel));
        let mut effects: Vec<Effect> = moved.chain(of_samples.cloned()).collect();
        // The longest octaves of the curve see a sinusoid of a few periods as a ramp.
        let has_ramp = preprocessing.has_ramp(channel) || trace.lines.iter().any(MergedLine::is_slow);
        let (mut named, by_curve) = self.part.named_effects(&measurement.profile, &estimators.both, channel, common);
        // The response that is not proportional has the sensitivity too.
        let responds = preprocessing.responds_to_temperature(channel);
        named.retain(|effect| !responds || !matches!(effect, Effect::TemperatureSensitivity(_)));
        let is_named = |effect: &Effect| match effect {
            Effect::LinearDrift(of) => !has_ramp && goes_as_far_as_ramp(own, of.slope.value),
            _ => true,
        };
        effects.extend(named.into_iter().filter(is_named));
        if let Some(unexplained) = &by_curve {
            effects.retain(|effect| !unexplained::is_contradicted(effect, unexplained));
        }
        effects.extend(by_curve.map(Effect::from));
        effects.retain(|effect| !trace.signals.has(effect, &trace.lines));
        effects.extend(trace.signals.effects(own.unit));
        let temperature = measurement.of_quantity(Quantity::Temperature).next();
        let level = temperature.and_then(|of| unexplained::level_by_temperature(own, &self.series[of]));
        if level.is_some() {
            // The limit above which a sample is a spike is that of a constant level.
            effects.retain(|effect| !matches!(effect, Effect::Spikes(_)));
        }
        effects.extend(level.map(Effect::from));
        // Jumps to and fro from one sample to the next.
        let telegraph = effects.iter().find_map(|effect| match effect {
            Effect::TelegraphNoise(telegraph) => Some(*telegraph),
            _ => None,
        });
        let is_visit = |effect: &Effect| match (effect, &telegraph) {
            (Effect::Spikes(spikes), Some(telegraph)) => {
                random_telegraph::explains_spikes(telegraph, spikes, measurement.period_s())
            }
            _ => false,
        };
        effects.retain(|effect| !is_visit(effect));
        effects
    }

    /// The drift that the gyroscopes have in common, and that of the accelerometers.
    fn common_modes(&self) -> Vec<ChannelsInCommon> {
        let traces = &self.part.channels;
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
