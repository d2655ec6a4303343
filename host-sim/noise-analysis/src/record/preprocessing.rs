//! Preprocessing: what the detectors find in the samples of each channel, and the series without it.
//!
//! Repeated samples become gaps of every channel, knocks and spikes gaps of the channel that shows them; a bias step is
//! subtracted, and so is a response to vibration, or to temperature behind a lag or with a curvature. A ramp is reported and
//! stays in the samples, because the noise model has a term for it. A sensitivity to temperature or supply stays in them too,
//! and is kept for the regression on covariates.

use crate::detectors::bias::{self, BiasChanges, BiasSensitivity};
use crate::detectors::bias_response::BiasResponse;
use crate::detectors::knock_search::{self, LoudStretches, SearchedChannel, slots_within};
use crate::detectors::knocks::Knock;
use crate::detectors::noise_grid::NoiseGrids;
use crate::detectors::output_range::find_noise_below_count;
use crate::detectors::spikes::{self, SpikeRule};
use crate::detectors::vibration_rectification::{Acceleration, largest_sensitivity};
use crate::effects::Effect;
use crate::effects::findings::{Correction, Detection};
use crate::parallel::{in_parallel, per_channel};
use crate::record::condensed_record::CondensedRecord;
use crate::samples::exclusion::Exclusion;
use crate::samples::rounding::NEIGHBOURING_COUNTS;
use crate::samples::series::Series;
use crate::samples::uniform_series::UniformSeries;
use crate::spectra;
use crate::spectra::force_regression::force_sensitivities;
use measurement::{ChannelId, Measurement, PerChannel, Quantity};
use std::cell::LazyCell;
use std::sync::Arc;

/// Sample periods that one channel does not use, in ascending order.
#[derive(Default)]
struct ChannelExclusion {
    knocks: Vec<u64>,
    spikes: Vec<u64>,
    /// Both, by the rules of the first half.
    by_first_half: Vec<u64>,
}

/// Effects in the samples, and the corrections that remove them.
pub(crate) struct Preprocessing {
    /// Sample periods of all samples.
    slots: Arc<[u64]>,
    /// How many counts the smallest step of the values of each channel has.
    counts_per_step: PerChannel<u32>,
    /// Sample periods that no channel uses: their sample equals the one before in all channels.
    repeated: Vec<u64>,
    channels: PerChannel<ChannelPreprocessing>,
}

/// What was found in the samples of one channel; nothing in one that is not inertial.
#[derive(Default)]
struct ChannelPreprocessing {
    effects: Vec<Effect>,
    exclusion: ChannelExclusion,
    /// As the first half and as the whole record show it.
    bias: [ChannelBias; 2],
}

/// What changes the bias of a channel, as a part of the recording shows it.
#[derive(Default, PartialEq)]
struct ChannelBias {
    /// The first sample periods from which on offsets are subtracted, and the offsets in the channel's unit.
    offsets: Vec<(u64, f64)>,
    has_ramp: bool,
    /// Responses to temperature and vibration that are subtracted.
    responses: Vec<BiasResponse>,
    /// The temperature, the supply or the specific force that it depends on, and how much.
    sensitivities: Vec<(ChannelId, BiasSensitivity)>,
}

impl Preprocessing {
    /// Looks for knocks, spikes, steps, ramps and sensitivities in the inertial channels.
    pub(crate) fn detect(record: &CondensedRecord, noise_grids: &NoiseGrids) -> Self {
        let measurement = record.means.as_ref();
        let slots = measurement.slots.as_slice().into();
        let channels = measurement.ids().map(|_| ChannelPreprocessing::default()).collect();
        let counts_per_step = record.channels.map(|of| of.counts_per_step);
        let preprocessing = Self { slots, counts_per_step, repeated: record.repeated.clone(), channels };
        let series = per_channel(measurement.ids(), |channel| preprocessing.measured(measurement, channel));
        let middle = measurement.middle();
        let halves = series.map(|of| of.before(middle));
        let knocks = KnocksInChannels::find(record, &series, &halves);
        let once = |series: PerChannel<Series>| series.map(|of| of.clone().without(&record.repeated));
        let (series, halves) = (once(series), once(halves));
        // What a channel may depend on, without its own knocks.
        let quiet: PerChannel<Series> =
            series.with_ids().map(|(channel, series)| knocks.removed_from(series, channel)).collect();
        let found = per_channel(measurement.ids(), |channel| {
            if !record.is_traced(channel) {
                return ChannelPreprocessing::default();
            }
            ChannelPreprocessing::detect(record, channel, (&series, &halves), (&quiet, &knocks), noise_grids)
        });
        Self { channels: found, ..preprocessing }
    }

    /// Whether `exclusion` leaves out a sample of a channel, beyond those that were read twice.
    pub(crate) fn excludes(&self, channel: ChannelId, exclusion: Exclusion) -> bool {
        !self.channels[channel].exclusion.slots(exclusion).is_empty()
    }

    /// Whether the series of a channel is the same for two exclusions.
    pub(crate) fn leaves_the_same(&self, channel: ChannelId, one: Exclusion, other: Exclusion) -> bool {
        let bias = |exclusion| self.channels[channel].bias(exclusion);
        let is_same = bias(one).offsets == bias(other).offsets && bias(one).responses == bias(other).responses;
        is_same && self.excluded(channel, one) == self.excluded(channel, other)
    }

    /// Sample periods that a channel does not use, in ascending order.
    pub(crate) fn excluded(&self, channel: ChannelId, exclusion: Exclusion) -> Vec<u64> {
        merged([&self.repeated, &self.channels[channel].exclusion.slots(exclusion)])
    }

    /// Sample periods of the spikes and knocks of a channel before that of the `middle`, by the rules of the first half.
    pub(crate) fn excluded_events(&self, channel: ChannelId, middle: u64) -> Vec<u64> {
        let mut slots = self.channels[channel].exclusion.slots(Exclusion::ByFirstHalf);
        slots.truncate(slots.partition_point(|&slot| slot < middle));
        slots
    }

    /// Samples of a channel that arrived and are not used, by cause.
    pub(crate) fn refused(&self, channel: ChannelId) -> impl Iterator<Item = (&'static str, u64)> {
        let own = &self.channels[channel].exclusion;
        let causes = [("repeated", &self.repeated), ("knock", &own.knocks), ("spikes", &own.spikes)];
        causes.map(|(cause, slots)| (cause, slots.len() as u64)).into_iter().filter(|(_, count)| *count > 0)
    }

    /// Whether anything is subtracted from samples of a channel.
    pub(crate) fn corrects(&self, channel: ChannelId, exclusion: Exclusion) -> bool {
        let bias = self.channels[channel].bias(exclusion);
        !bias.offsets.is_empty() || !bias.responses.is_empty()
    }

    /// What is subtracted from the sample of the sample period `slot`, in the channel's unit.
    pub(crate) fn offset(&self, channel: ChannelId, exclusion: Exclusion, slot: u64) -> f64 {
        let bias = self.channels[channel].bias(exclusion);
        let steps = bias.offsets.iter().filter(|(from, _)| slot >= *from).map(|(_, size)| *size);
        steps.chain(bias.responses.iter().map(|response| response.bias(slot))).sum()
    }

    /// A channel's series as measured, with its resolution.
    pub(crate) fn measured(&self, measurement: &Measurement, channel: ChannelId) -> Series {
        let series = Series::with_shared_slots(measurement, channel, || Arc::clone(&self.slots));
        series.with_counts_per_step(self.counts_per_step[channel])
    }

    /// A channel's series after preprocessing.
    pub(crate) fn series(&self, measurement: &Measurement, channel: ChannelId, exclusion: Exclusion) -> Series {
        let mut series = self.measured(measurement, channel);
        let bias = self.channels[channel].bias(exclusion);
        for &(from, size) in &bias.offsets {
            series = series.lowered_from(from, size);
        }
        for response in &bias.responses {
            let values = Arc::make_mut(&mut series.values);
            values.iter_mut().zip(series.slots.iter()).for_each(|(value, slot)| *value -= response.bias(*slot));
        }
        series.without(&self.excluded(channel, exclusion))
    }

    /// Whether a ramp was found in a channel, by the first half or by the whole record.
    pub(crate) fn has_ramp(&self, channel: ChannelId, exclusion: Exclusion) -> bool {
        self.channels[channel].bias(exclusion).has_ramp
    }

    /// The temperature and supply that a channel depends on, and how much, by the first half or by the whole record.
    pub(crate) fn sensitivities(&self, channel: ChannelId, exclusion: Exclusion) -> &[(ChannelId, BiasSensitivity)] {
        &self.channels[channel].bias(exclusion).sensitivities
    }

    /// The effects of a channel.
    pub(crate) fn effects(&self, channel: ChannelId) -> &[Effect] {
        &self.channels[channel].effects
    }
}

impl ChannelPreprocessing {
    /// What the samples of `channel` show. `series` and their first `halves` are those of all channels, `quiet` without `knocks`.
    fn detect(
        record: &CondensedRecord,
        channel: ChannelId,
        (series, halves): (&PerChannel<Series>, &PerChannel<Series>),
        (quiet, knocks): (&PerChannel<Series>, &KnocksInChannels),
        noise_grids: &NoiseGrids,
    ) -> Self {
        let measurement = record.means.as_ref();
        let middle = measurement.middle();
        let louder = &knocks.by_whole[channel].by_itself;
        let can_show_spikes = record.channels[channel].can_show_spikes;
        let spikes = can_show_spikes.then(|| spikes::find(&quiet[channel], louder)).flatten();
        let exclusion = ChannelExclusion {
            spikes: spikes.as_ref().map(|found| found.excluded().to_vec()).unwrap_or_default(),
            knocks: slots_within(&series[channel], &knocks.by_whole[channel].knocks),
            by_first_half: excluded_by_first_half(&series[channel], &knocks.by_first_half[channel], middle),
        };
        let regressors: Vec<ChannelId> =
            measurement.ids().filter(|&regressor| may_depend(measurement, channel, regressor)).collect();
        let others: Vec<&Series> = regressors.iter().map(|&regressor| &quiet[regressor]).collect();
        // That rounding cannot make of a slow change: any step, where the noise reaches from one count to the next.
        let smallest_step = LazyCell::new(|| {
            find_noise_below_count(&series[channel], measurement.profile.dithered_avar_counts2)
                .map_or(0.0, |_| NEIGHBOURING_COUNTS * series[channel].resolution)
        });
        let least_step = || *smallest_step;
        let forces: Vec<usize> = (0..regressors.len())
            .filter(|&at| measurement[regressors[at]].profile.quantity == Quantity::SpecificForce)
            .collect();
        // The differences, or what follows the force at each frequency, measure a sensitivity to motion better; the slow part of an
        // accelerometer's signal is its own drift.
        let is_slow = |regressor: ChannelId| measurement[regressor].profile.quantity.is_environment();
        let of_part = |own: Series, others: &[&Series], accelerations: &[Acceleration]| {
            let found = bias::find(&without_lines(own.clone()), others, accelerations, noise_grids, &least_step);
            let own = offset(&found).into_iter().fold(own, |own, (from, size)| own.lowered_from(from, size));
            let of_forces: Vec<&Series> = forces.iter().map(|&at| others[at]).collect();
            let by_force = force_sensitivities(&own, &of_forces);
            let slow = found.sensitivities.iter().filter(|(at, _)| is_slow(regressors[*at])).copied();
            let sensitivities = slow.chain(by_force.into_iter().map(|(place, of)| (forces[place], of)));
            let bias = ChannelBias {
                offsets: offset(&found).into_iter().collect(),
                has_ramp: found.ramp.is_some(),
                responses: found.responses.clone(),
                sensitivities: sensitivities.map(|(at, of)| (regressors[at], of)).collect(),
            };
            (bias, found)
        };
        let own = quiet[channel].clone().without(&exclusion.spikes);
        let (by_whole, whole) = of_part(own, &others, &accelerations(measurement, series, channel));
        let (by_half, _) = {
            let quiet = |&of: &ChannelId| {
                halves[of].clone().without(&slots_within(&halves[of], &knocks.by_first_half[of].knocks))
            };
            let others: Vec<Series> = regressors.iter().map(quiet).collect();
            let others: Vec<&Series> = others.iter().collect();
            let own = halves[channel].clone().without(&exclusion.by_first_half);
            of_part(own, &others, &accelerations(measurement, halves, channel))
        };
        let mut bias = [by_half, by_whole];
        // What the second half is compared with has no step that happens in it.
        bias[0].offsets.extend(offset(&whole).filter(|(from, _)| *from >= middle));
        let BiasChanges { step, ramp, responses, .. } = whole;
        let found = knocks.detections(measurement, &series[channel], channel).into_iter();
        let found = found.chain(spikes).chain(step).chain(ramp).map(|detection| detection.effect);
        let effects = responses.iter().map(|of| of.effect.clone()).chain(found).collect();
        Self { effects, exclusion, bias }
    }

    /// What changes the bias, by the whole record or else by its first half.
    fn bias(&self, exclusion: Exclusion) -> &ChannelBias {
        let [first_half, whole] = &self.bias;
        if exclusion == Exclusion::ByWhole { whole } else { first_half }
    }
}

/// The first sample period behind a step, and its size.
fn offset(found: &BiasChanges) -> Option<(u64, f64)> {
    match found.step.as_ref()?.correction {
        Some(Correction::Offset { from, size }) => Some((from, size)),
        _ => None,
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

/// The knocks in the inertial channels.
struct KnocksInChannels {
    by_whole: PerChannel<LoudStretches>,
    /// By the rules of the first half, in both halves.
    by_first_half: PerChannel<LoudStretches>,
}

impl KnocksInChannels {
    fn find(record: &CondensedRecord, series: &PerChannel<Series>, halves: &PerChannel<Series>) -> Self {
        let middle = record.means.as_ref().middle();
        let second = series.map(|of| of.from(middle));
        let searches = [(series, vec![series]), (halves, vec![halves, &second])];
        let mut found = in_parallel(&searches, |(fitted, parts)| loud_stretches(record, fitted, parts)).into_iter();
        let mut next = || found.next().unwrap_or_else(|| series.map(|_| LoudStretches::default()));
        Self { by_whole: next(), by_first_half: next() }
    }

    /// The series of a channel without the knocks of the whole record.
    fn removed_from(&self, series: &Series, channel: ChannelId) -> Series {
        let knocks = &self.by_whole[channel].knocks;
        if knocks.is_empty() { series.clone() } else { series.clone().without(&slots_within(series, knocks)) }
    }

    /// The knocks of a channel as they are reported.
    fn detections(&self, measurement: &Measurement, series: &Series, channel: ChannelId) -> Vec<Detection> {
        let detection = |knock: &Knock| {
            let shows = |others: &LoudStretches| others.knocks.iter().any(|other| other.overlaps(knock));
            let shown: Vec<&'static str> = self
                .by_whole
                .with_ids()
                .filter(|(_, others)| shows(others))
                .map(|(of, _)| measurement[of].profile.name)
                .collect();
            knock.detection(series, &shown)
        };
        self.by_whole[channel].knocks.iter().map(detection).collect()
    }
}

/// Where channels are loud in the `parts` of a record, in the order of time, by the rules of the series that are `fitted`; nowhere in one that
/// is not inertial.
fn loud_stretches(
    record: &CondensedRecord,
    fitted: &PerChannel<Series>,
    parts: &[&PerChannel<Series>],
) -> PerChannel<LoudStretches> {
    let measurement = record.means.as_ref();
    let inertial: Vec<ChannelId> = measurement.inertial().collect();
    let searched = |&of: &ChannelId| SearchedChannel {
        fitted: &fitted[of],
        parts: parts.iter().map(|part| &part[of]).collect(),
        can_show_spikes: record.channels[of].can_show_spikes,
    };
    let searched: Vec<SearchedChannel> = inertial.iter().map(searched).collect();
    let found = knock_search::find(&searched, &record.repeated, measurement.profile.dithered_avar_counts2);
    let mut loud: PerChannel<LoudStretches> = fitted.map(|_| LoudStretches::default());
    inertial.iter().zip(found).for_each(|(&of, found)| loud[of] = found);
    loud
}

/// The accelerometers, of which these are the `series`, as what may shake `channel`.
fn accelerations<'s>(
    measurement: &Measurement,
    series: &'s PerChannel<Series>,
    channel: ChannelId,
) -> Vec<Acceleration<'s>> {
    let acceleration = |of: ChannelId| {
        let profile = &measurement[of].profile;
        let largest = largest_sensitivity(measurement[channel].profile.range, profile.range);
        Acceleration { name: profile.name, series: &series[of], largest }
    };
    measurement.of_quantity(Quantity::SpecificForce).map(acceleration).collect()
}

/// A series without sinusoids, of which those of a few periods are ramps and steps to the regressions on its block means, and faster
/// ones are noise; the series itself where a long gap splits it.
fn without_lines(series: Series) -> Series {
    let uniform = UniformSeries::from_series(&series);
    if uniform.values().len() as u64 != series.span.end.saturating_sub(series.span.start) {
        return series;
    }
    let (without, _) = spectra::without_slow_sines(uniform);
    let without = spectra::without_sines(without);
    let value = |slot: &u64| without.values()[(slot - series.span.start) as usize];
    let values = series.slots.iter().map(value).collect();
    Series { values, ..series }
}

/// Sample periods within `knocks`, and those of spikes by the rule of the samples before `middle`, in ascending order.
fn excluded_by_first_half(series: &Series, loud: &LoudStretches, middle: u64) -> Vec<u64> {
    let LoudStretches { knocks, by_itself } = loud;
    let loud = slots_within(series, knocks);
    let quiet = series.clone().without(&loud);
    let (first, second) = (quiet.before(middle), quiet.from(middle));
    let spikes =
        SpikeRule::fit(&first).map(|rule| [rule.slots(&first, by_itself), rule.slots(&second, by_itself)].concat());
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
fn may_depend(measurement: &Measurement, channel: ChannelId, regressor: ChannelId) -> bool {
    let [channel, regressor] = [channel, regressor].map(|of| measurement[of].profile.quantity);
    let motion = regressor == Quantity::SpecificForce && channel == Quantity::AngularRate;
    regressor.is_environment() || motion
}
