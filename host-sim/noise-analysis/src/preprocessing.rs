//! Preprocessing: what the detectors find in the samples of each channel, and the series without it.
//!
//! Repeated samples become gaps of every channel, knocks and spikes gaps of the channel that shows them; a bias step is
//! subtracted, and so is a response to vibration, or to temperature behind a lag or with a curvature. A ramp is reported and
//! stays in the samples, because the noise model has a term for it. A sensitivity to temperature or supply stays in them too,
//! and is kept for the regression on covariates.

use crate::detectors::bias;
use crate::detectors::bias::{BiasChanges, BiasSensitivity};
use crate::detectors::bias_response::BiasResponse;
use crate::detectors::knocks::{self, Knock, KnockRule};
use crate::detectors::noise_grid::NoiseGrids;
use crate::detectors::spikes::{self, SpikeRule};
use crate::detectors::vibration_rectification::{Acceleration, largest_sensitivity};
use crate::findings::{Correction, Detection, Effect};
use crate::parallel::in_parallel;
use crate::sample_effects::SampleEffects;
use crate::series::Series;
use crate::spectra;
use crate::uniform_series::UniformSeries;
use allan_core::NoiseTerm;
use measurement::{ChannelProfile, Measurement, Quantity};
use std::sync::Arc;

/// Which of the samples that the detectors found are left out. Samples that were read twice always are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Exclusion {
    /// None.
    None,
    /// Knocks and spikes by rules that were fitted to the first half of the record, in both halves.
    ByFirstHalf,
    /// The knocks and spikes of the whole record.
    ByWhole,
}

/// Sample periods that one channel does not use, in ascending order.
#[derive(Default)]
struct ChannelExclusion {
    knocks: Vec<u64>,
    spikes: Vec<u64>,
    /// Both, by the rules of the first half.
    by_first_half: Vec<u64>,
}

/// Effects in the samples, and the corrections that remove them.
#[derive(Default)]
pub(crate) struct Preprocessing {
    /// Sample periods of all samples.
    slots: Arc<[u64]>,
    /// What shows in samples alone.
    samples: SampleEffects,
    channel_effects: Vec<(ChannelProfile, Effect)>,
    /// Sample periods that no channel uses: their sample equals the one before in all channels.
    repeated: Vec<u64>,
    exclusions: Vec<(ChannelProfile, ChannelExclusion)>,
    /// By channel: the first sample period from which on an offset is subtracted, and the offset in the channel's unit.
    offsets: Vec<(ChannelProfile, u64, f64)>,
    /// By channel: responses to temperature and vibration that are subtracted, as the first half and as the whole record show
    /// them.
    responses: Vec<(ChannelProfile, [Vec<BiasResponse>; 2])>,
    /// A channel, the temperature or supply that it depends on, and how much.
    sensitivities: Vec<(ChannelProfile, ChannelProfile, BiasSensitivity)>,
}

/// What was found in one channel.
struct ChannelFindings {
    knocks: Vec<Detection>,
    spikes: Option<Detection>,
    bias_changes: BiasChanges,
    /// As the first half shows them, if the whole record shows any.
    responses_of_first_half: Vec<BiasResponse>,
    /// Channels that the bias may depend on, in the order of the sensitivities in `bias_changes`.
    regressors: Vec<ChannelProfile>,
    exclusion: ChannelExclusion,
}

impl Preprocessing {
    /// Looks for knocks, spikes, steps, ramps, sensitivities and a coarse resolution in the channels `traced`, and for lost or
    /// repeated samples and a wrong sample rate in the whole recording. Where that has `means` of samples, what shows in samples
    /// alone is not looked for.
    pub(crate) fn detect(
        measurement: &Measurement,
        means: bool,
        traced: &[ChannelProfile],
        noise_grids: &NoiseGrids,
    ) -> Self {
        let samples = if means { SampleEffects::default() } else { SampleEffects::detect(measurement, traced) };
        let repeated = samples.repeated();
        let slots = measurement.slots.as_slice().into();
        let mut preprocessing = Self { slots, samples, repeated, ..Self::default() };
        let recorded: Vec<ChannelProfile> = measurement.profiles().collect();
        let series_of = |channel: ChannelProfile| preprocessing.measured(measurement, channel);
        let series: Vec<Series> = in_parallel(traced, |&channel| series_of(channel));
        let knocks = KnocksInChannels::find(&series, measurement.middle(), measurement.profile.dithered_avar_counts2);
        // What a channel may depend on, without its own knocks.
        let regressors: Vec<(ChannelProfile, Series)> = recorded
            .iter()
            .map(|&channel| match traced.iter().position(|of| *of == channel) {
                Some(at) => (channel, knocks.removed_from(&series[at], at)),
                None => (channel, series_of(channel)),
            })
            .collect();
        let numbered: Vec<usize> = (0..traced.len()).collect();
        let found = in_parallel(&numbered, |&at| {
            let quiet = knocks.removed_from(&series[at], at);
            let has_spikes = !means && !preprocessing.samples.is_saturated(traced[at]);
            let spikes = if has_spikes { spikes::find(&quiet) } else { None };
            let mut exclusion = ChannelExclusion {
                spikes: spikes.as_ref().map(|found| found.excluded().to_vec()).unwrap_or_default(),
                knocks: slots_within(&series[at], &knocks.by_whole[at]),
                by_first_half: Vec::new(),
            };
            exclusion.by_first_half =
                excluded_by_first_half(&series[at], &knocks.by_first_half[at], measurement.middle());
            let (profiles, others): (Vec<ChannelProfile>, Vec<&Series>) = regressors
                .iter()
                .filter(|(regressor, _)| may_depend(traced[at], *regressor))
                .map(|(regressor, series)| (*regressor, series))
                .unzip();
            let quiet = without_slow_lines(quiet.without(&exclusion.spikes));
            let bias_changes = bias::find(&quiet, &others, &accelerations(traced, &series, traced[at]), noise_grids);
            let responses_of_first_half = if bias_changes.responses.is_empty() {
                Vec::new()
            } else {
                let first_half = |of: &Series| of.before(measurement.middle());
                let others: Vec<Series> = others.iter().copied().map(first_half).collect();
                let others: Vec<&Series> = others.iter().collect();
                let all: Vec<Series> = series.iter().map(first_half).collect();
                let own = all[at].clone().without(&exclusion.by_first_half);
                bias::find(&own, &others, &accelerations(traced, &all, traced[at]), noise_grids).responses
            };
            ChannelFindings {
                knocks: knocks.detections(&series[at], at, traced),
                responses_of_first_half,
                bias_changes,
                regressors: profiles,
                spikes,
                exclusion,
            }
        });
        for (&channel, found) in traced.iter().zip(found) {
            let ChannelFindings { knocks, spikes, bias_changes, responses_of_first_half, regressors, exclusion } =
                found;
            let BiasChanges { step, ramp, sensitivities, responses } = bias_changes;
            if !responses.is_empty() {
                preprocessing.channel_effects.extend(responses.iter().map(|of| (channel, of.effect.clone())));
                preprocessing.responses.push((channel, [responses_of_first_half, responses]));
            }
            if let Some(Detection { correction: Some(Correction::Offset { from, size }), .. }) = &step {
                preprocessing.offsets.push((channel, *from, *size));
            }
            // The differences measure a sensitivity to motion better; the slow part of an accelerometer's signal is its
            // own drift.
            let slow = sensitivities.into_iter().map(|(place, sensitivity)| (channel, regressors[place], sensitivity));
            preprocessing.sensitivities.extend(slow.filter(|(_, regressor, _)| regressor.quantity.is_environment()));
            preprocessing.exclusions.push((channel, exclusion));
            let findings = knocks.into_iter().chain(spikes).chain(step).chain(ramp);
            preprocessing.channel_effects.extend(findings.map(|finding| (channel, finding.effect)));
        }
        preprocessing
    }

    /// How many counts the smallest step of a channel's values has.
    pub(crate) fn counts_per_step(&self, channel: ChannelProfile) -> u32 {
        self.samples.counts_per_step(channel)
    }

    /// Whether `exclusion` leaves out a sample of a channel, beyond those that were read twice.
    pub(crate) fn excludes(&self, channel: ChannelProfile, exclusion: Exclusion) -> bool {
        self.exclusion(channel).is_some_and(|own| !own.slots(exclusion).is_empty())
    }

    /// Whether `exclusion` leaves out a sample of any channel, beyond those that were read twice.
    pub(crate) fn excludes_any(&self, exclusion: Exclusion) -> bool {
        self.exclusions.iter().any(|(_, own)| !own.slots(exclusion).is_empty())
    }

    /// Whether the series of a channel is the same for two exclusions.
    pub(crate) fn leaves_the_same(&self, channel: ChannelProfile, one: Exclusion, other: Exclusion) -> bool {
        let has_responses = self.responses.iter().any(|(of, _)| *of == channel);
        !has_responses && self.excluded(channel, one) == self.excluded(channel, other)
    }

    /// Sample periods that a channel does not use, in ascending order.
    pub(crate) fn excluded(&self, channel: ChannelProfile, exclusion: Exclusion) -> Vec<u64> {
        let own = self.exclusion(channel).map(|own| own.slots(exclusion)).unwrap_or_default();
        merged([&self.repeated, &own])
    }

    /// Samples of a channel that arrived and are not used, by cause.
    pub(crate) fn refused(&self, channel: ChannelProfile) -> impl Iterator<Item = (&'static str, u64)> {
        let own = self.exclusion(channel);
        let count = |slots: Option<&Vec<u64>>| slots.map_or(0, |slots| slots.len() as u64);
        let counts = [
            ("repeated", self.repeated.len() as u64),
            ("knock", count(own.map(|own| &own.knocks))),
            ("spikes", count(own.map(|own| &own.spikes))),
        ];
        counts.into_iter().filter(|(_, count)| *count > 0)
    }

    fn exclusion(&self, channel: ChannelProfile) -> Option<&ChannelExclusion> {
        self.exclusions.iter().find(|(of, _)| *of == channel).map(|(_, own)| own)
    }

    /// Whether anything is subtracted from samples of a channel.
    pub(crate) fn corrects(&self, channel: ChannelProfile, exclusion: Exclusion) -> bool {
        self.offsets.iter().any(|(of, ..)| *of == channel) || !self.responses(channel, exclusion).is_empty()
    }

    /// What is subtracted from the sample of the sample period `slot`, in the channel's unit.
    pub(crate) fn offset(&self, channel: ChannelProfile, exclusion: Exclusion, slot: u64) -> f64 {
        let steps = self.offsets.iter().filter(|(of, from, _)| *of == channel && slot >= *from);
        let responses = self.responses(channel, exclusion).iter().map(|response| response.bias(slot));
        steps.map(|(.., size)| *size).chain(responses).sum()
    }

    /// The responses of a channel to temperature and vibration that are subtracted from its samples.
    fn responses(&self, channel: ChannelProfile, exclusion: Exclusion) -> &[BiasResponse] {
        let own = self.responses.iter().find(|(of, _)| *of == channel);
        own.map_or(&[], |(_, [first_half, whole])| if exclusion == Exclusion::ByWhole { whole } else { first_half })
    }

    /// Whether the first half may show other responses to temperature and vibration than the whole record.
    pub(crate) fn has_responses(&self) -> bool {
        !self.responses.is_empty()
    }

    /// Whether a channel responds to temperature behind a lag or with a curvature.
    pub(crate) fn responds_to_temperature(&self, channel: ChannelProfile) -> bool {
        self.responses(channel, Exclusion::ByWhole).iter().any(|of| of.effect.kind != "vibration_rectification")
    }

    /// A channel's series as measured, with its resolution.
    pub(crate) fn measured(&self, measurement: &Measurement, channel: ChannelProfile) -> Series {
        let series = Series::with_shared_slots(measurement, &channel, || Arc::clone(&self.slots));
        series.with_counts_per_step(self.samples.counts_per_step(channel))
    }

    /// A channel's series after preprocessing.
    pub(crate) fn series(&self, measurement: &Measurement, channel: ChannelProfile, exclusion: Exclusion) -> Series {
        let mut series = self.measured(measurement, channel);
        for &(_, from, size) in self.offsets.iter().filter(|(of, ..)| *of == channel) {
            series = series.lowered_from(from, size);
        }
        for response in self.responses(channel, exclusion) {
            let values = Arc::make_mut(&mut series.values);
            values.iter_mut().zip(series.slots.iter()).for_each(|(value, slot)| *value -= response.bias(*slot));
        }
        series.without(&self.excluded(channel, exclusion))
    }

    /// Whether a ramp was found in a channel.
    pub(crate) fn has_ramp(&self, channel: ChannelProfile) -> bool {
        self.effects(channel).any(|effect| effect.kind == NoiseTerm::RateRamp.name())
    }

    /// Sensitivity of a channel to a temperature or supply.
    pub(crate) fn sensitivity(&self, channel: ChannelProfile, regressor: ChannelProfile) -> Option<BiasSensitivity> {
        let of = |(of, to, _): &&(ChannelProfile, ChannelProfile, BiasSensitivity)| (*of, *to) == (channel, regressor);
        self.sensitivities.iter().find(of).map(|(.., followed)| *followed)
    }

    /// The effects of a channel, those that concern every channel first.
    pub(crate) fn effects(&self, channel: ChannelProfile) -> impl Iterator<Item = Effect> + '_ {
        let own = self.channel_effects.iter().filter(move |(of, _)| *of == channel).map(|(_, effect)| effect);
        let of_samples = self.samples.recording.iter().chain(self.samples.of(channel));
        of_samples.map(|detection| &detection.effect).chain(own).cloned()
    }
}

impl ChannelExclusion {
    fn slots(&self, exclusion: Exclusion) -> Vec<u64> {
        match exclusion {
            Exclusion::None => Vec::new(),
            Exclusion::ByFirstHalf => self.by_first_half.clone(),
            Exclusion::ByWhole => merged([&self.knocks, &self.spikes]),
        }
    }
}

/// The knocks in the traced channels, by channel.
struct KnocksInChannels {
    by_whole: Vec<Vec<Knock>>,
    /// By the rules of the first half, in both halves.
    by_first_half: Vec<Vec<Knock>>,
}

impl KnocksInChannels {
    fn find(series: &[Series], middle: u64, dithered_avar_counts2: f64) -> Self {
        let first: Vec<Series> = series.iter().map(|of| of.before(middle)).collect();
        let second: Vec<Series> = series.iter().map(|of| of.from(middle)).collect();
        let rules = in_parallel(&first, |first| KnockRule::fit(first, dithered_avar_counts2));
        let parts = in_parallel(&[first, second], |part| knocks::find_by(&rules, part));
        let in_both = |channel: usize| parts.iter().flat_map(|part| part[channel].clone()).collect();
        Self {
            by_whole: knocks::find(series, dithered_avar_counts2),
            by_first_half: (0..series.len()).map(in_both).collect(),
        }
    }

    /// The series of channel `at` without the knocks of the whole record.
    fn removed_from(&self, series: &Series, at: usize) -> Series {
        let knocks = &self.by_whole[at];
        if knocks.is_empty() { series.clone() } else { series.clone().without(&slots_within(series, knocks)) }
    }

    /// The knocks of channel `at` as they are reported.
    fn detections(&self, series: &Series, at: usize, channels: &[ChannelProfile]) -> Vec<Detection> {
        let detection = |knock: &Knock| {
            let shows = |others: &&Vec<Knock>| others.iter().any(|other| other.overlaps(knock));
            let shown: Vec<&str> = channels
                .iter()
                .zip(&self.by_whole)
                .filter(|(_, others)| shows(others))
                .map(|(of, _)| of.name)
                .collect();
            knock.detection(series, &shown)
        };
        self.by_whole[at].iter().map(detection).collect()
    }
}

/// The accelerometers of `series`, of the channels `traced`, as what may shake `channel`.
fn accelerations<'s>(
    traced: &[ChannelProfile],
    series: &'s [Series],
    channel: ChannelProfile,
) -> Vec<Acceleration<'s>> {
    let all = traced.iter().zip(series).filter(|(of, _)| of.quantity == Quantity::SpecificForce);
    let acceleration = |(of, series): (&ChannelProfile, &'s Series)| Acceleration {
        name: of.name,
        series,
        largest: largest_sensitivity(channel.range, of.range),
    };
    all.map(acceleration).collect()
}

/// A series without sinusoids of a few periods, which the regressions on its block means would take for ramps and steps; the
/// series itself where there are none, or where a long gap splits it.
fn without_slow_lines(series: Series) -> Series {
    let uniform = UniformSeries::from_series(&series);
    if uniform.values().len() as u64 != series.span.end.saturating_sub(series.span.start) {
        return series;
    }
    let (without, lines) = spectra::without_slow_sines(uniform);
    if lines.is_empty() {
        return series;
    }
    let value = |slot: &u64| without.values()[(slot - series.span.start) as usize];
    let values = series.slots.iter().map(value).collect();
    Series { values, ..series }
}

/// Sample periods of the samples of a series within knocks, in ascending order.
fn slots_within(series: &Series, knocks: &[Knock]) -> Vec<u64> {
    let is_within = |slot: &u64| knocks.iter().any(|knock| knock.slots.contains(slot));
    if knocks.is_empty() { Vec::new() } else { series.slots.iter().copied().filter(is_within).collect() }
}

/// Sample periods within `knocks`, and those of spikes by the rule of the samples before `middle`, in ascending order.
fn excluded_by_first_half(series: &Series, knocks: &[Knock], middle: u64) -> Vec<u64> {
    let loud = slots_within(series, knocks);
    let quiet = series.clone().without(&loud);
    let (first, second) = (quiet.before(middle), quiet.from(middle));
    let spikes = SpikeRule::fit(&first).map(|rule| [rule.slots(&first), rule.slots(&second)].concat());
    merged([&loud, &spikes.unwrap_or_default()])
}

/// Both lists in ascending order, without duplicates.
fn merged(lists: [&[u64]; 2]) -> Vec<u64> {
    let mut all = lists.concat();
    all.sort_unstable();
    all.dedup();
    all
}

/// Whether the bias of `channel` may depend on `regressor`: on temperature and supply, and that of a gyroscope on the
/// specific force.
fn may_depend(channel: ChannelProfile, regressor: ChannelProfile) -> bool {
    let motion = regressor.quantity == Quantity::SpecificForce && channel.quantity == Quantity::AngularRate;
    regressor.quantity.is_environment() || motion
}
