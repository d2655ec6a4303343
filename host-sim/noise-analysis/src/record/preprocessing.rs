//! Preprocessing: the findings of the detectors in each channel, and the series without them.
//!
//! Repeated samples become gaps of every channel, knocks and spikes gaps of their own; steps and responses to vibration or temperature are
//! subtracted. Ramps stay in the samples (a noise term), and so do sensitivities to temperature or supply (covariate regression).

use crate::detectors::bias::{self, BiasChanges, BiasSensitivity};
use crate::detectors::bias_response::BiasResponse;
use crate::detectors::knock_search::{KnockSearch, LoudStretches, SearchedChannel};
use crate::detectors::knocks::{Knock, slots_within};
use crate::detectors::output_range::find_noise_below_count;
use crate::detectors::spikes::SpikeRule;
use crate::detectors::vibration_rectification::{Acceleration, largest_sensitivity};
use crate::effects::findings::Correction;
use crate::effects::{Effect, NoisyInterval};
use crate::parallel::{self, per_channel};
use crate::record::condensed_record::CondensedRecord;
use crate::samples::exclusion::Exclusion;
use crate::samples::rounding::NEIGHBOURING_COUNTS;
use crate::samples::series::Series;
use crate::samples::uniform_series::UniformSeries;
use crate::spectra;
use crate::spectra::force_regression::Forces;
use measurement::{ChannelId, Measurement, PerChannel, Quantity};
use std::cell::LazyCell;
use std::sync::Arc;

/// Effects in the samples, and the corrections that remove them.
pub(crate) struct Preprocessing {
    slots: Arc<[u64]>,
    rules: EventRules,
    by_whole: Shown,
    /// Findings of the first half, applied to both halves; `None` if not asked for.
    by_first_half: Option<Shown>,
    effects: PerChannel<Vec<Effect>>,
}

/// The rules by which knocks and spikes are sought in the record, and in what follows it.
struct EventRules {
    /// For the inertial channels.
    knocks: KnockSearch,
    spikes: PerChannel<Option<SpikeRule>>,
}

struct Shown {
    counts_per_step: PerChannel<u32>,
    repeated: Vec<u64>,
    channels: PerChannel<ShownInChannel>,
}

#[derive(Default)]
struct ShownInChannel {
    /// Excluded sample periods, in ascending order.
    knocks: Vec<u64>,
    spikes: Vec<u64>,
    bias: ChannelBias,
}

#[derive(Default, Clone, PartialEq)]
struct ChannelBias {
    /// First sample period with an offset, and the offset in the channel's unit.
    offset: Option<(u64, f64)>,
    has_ramp: bool,
    /// Subtracted responses to temperature and vibration.
    responses: Vec<BiasResponse>,
    /// The temperature, supply or force that the bias depends on, with the sensitivity.
    sensitivities: Vec<(ChannelId, BiasSensitivity)>,
}

impl Preprocessing {
    /// Finds knocks, spikes, steps, ramps and sensitivities in the inertial channels; those of the `first_half` hold in the second too.
    pub(crate) fn detect(record: &CondensedRecord, first_half: Option<&Self>) -> Self {
        let slots: Arc<[u64]> = record.means.slots.as_slice().into();
        let by_first_half = || first_half.map(|half| half.rules.continued(&half.by_whole, record, &slots));
        let (by_first_half, (rules, by_whole, effects)) = parallel::both(by_first_half, || Shown::find(record, &slots));
        Self { slots, rules, by_whole, by_first_half, effects }
    }

    /// Findings of a part; `None` if unused or not asked for.
    fn shown(&self, exclusion: Exclusion) -> Option<&Shown> {
        if exclusion == Exclusion::ByWhole { Some(&self.by_whole) } else { self.by_first_half.as_ref() }
    }

    fn bias(&self, channel: ChannelId, exclusion: Exclusion) -> Option<&ChannelBias> {
        if exclusion == Exclusion::Nothing { None } else { Some(&self.shown(exclusion)?.channels[channel].bias) }
    }

    /// True if `exclusion` drops samples of a channel beyond repeated ones.
    pub(crate) fn excludes(&self, channel: ChannelId, exclusion: Exclusion) -> bool {
        !self.events(channel, exclusion).is_empty()
    }

    fn events(&self, channel: ChannelId, exclusion: Exclusion) -> Vec<u64> {
        let shown = self.shown(exclusion).filter(|_| !exclusion.keeps_events());
        shown.map(|shown| shown.channels[channel].events()).unwrap_or_default()
    }

    pub(crate) fn leaves_the_same(&self, channel: ChannelId, one: Exclusion, other: Exclusion) -> bool {
        let subtracted = |exclusion| {
            let bias = self.bias(channel, exclusion);
            (bias.and_then(|of| of.offset), bias.map_or(&[][..], |of| &of.responses))
        };
        let is_same = subtracted(one) == subtracted(other);
        is_same
            && self.counts_per_step(channel, one) == self.counts_per_step(channel, other)
            && self.excluded(channel, one) == self.excluded(channel, other)
    }

    pub(crate) fn excluded(&self, channel: ChannelId, exclusion: Exclusion) -> Vec<u64> {
        let repeated = self.shown(exclusion).map_or(&[][..], |shown| &shown.repeated);
        merged([repeated, &self.events(channel, exclusion)])
    }

    /// Sample periods of a channel's spikes and knocks before `middle`, by the rules of the first half.
    pub(crate) fn excluded_events(&self, channel: ChannelId, middle: u64) -> Vec<u64> {
        let mut slots = self.events(channel, Exclusion::ByFirstHalf);
        slots.truncate(slots.partition_point(|&slot| slot < middle));
        slots
    }

    /// Unused samples of a channel that arrived, by cause.
    pub(crate) fn refused(&self, channel: ChannelId) -> impl Iterator<Item = (&'static str, u64)> {
        let Shown { repeated, channels, .. } = &self.by_whole;
        let own = &channels[channel];
        let causes = [("repeated", repeated), ("knock", &own.knocks), ("spikes", &own.spikes)];
        causes.map(|(cause, slots)| (cause, slots.len() as u64)).into_iter().filter(|(_, count)| *count > 0)
    }

    pub(crate) fn corrects(&self, channel: ChannelId, exclusion: Exclusion) -> bool {
        self.bias(channel, exclusion).is_some_and(|bias| bias.offset.is_some() || !bias.responses.is_empty())
    }

    /// Correction of the sample in `slot`, in the channel's unit.
    pub(crate) fn offset(&self, channel: ChannelId, exclusion: Exclusion, slot: u64) -> f64 {
        let Some(ChannelBias { offset, responses, .. }) = self.bias(channel, exclusion) else { return 0.0 };
        let step = offset.iter().filter(|(from, _)| slot >= *from).map(|(_, size)| *size);
        step.chain(responses.iter().map(|response| response.bias(slot))).sum()
    }

    fn counts_per_step(&self, channel: ChannelId, exclusion: Exclusion) -> u32 {
        self.shown(exclusion).map_or(1, |shown| shown.counts_per_step[channel])
    }

    pub(crate) fn measured(&self, measurement: &Measurement, channel: ChannelId) -> Series {
        measured(measurement, channel, &self.slots, self.by_whole.counts_per_step[channel])
    }

    pub(crate) fn series(&self, measurement: &Measurement, channel: ChannelId, exclusion: Exclusion) -> Series {
        let mut series = measured(measurement, channel, &self.slots, self.counts_per_step(channel, exclusion));
        if let Some(ChannelBias { offset, responses, .. }) = self.bias(channel, exclusion) {
            if let Some((from, size)) = *offset {
                series = series.lowered_from(from, size);
            }
            for response in responses {
                let values = Arc::make_mut(&mut series.values);
                values.iter_mut().zip(series.slots.iter()).for_each(|(value, slot)| *value -= response.bias(*slot));
            }
        }
        series.without(&self.excluded(channel, exclusion))
    }

    pub(crate) fn has_ramp(&self, channel: ChannelId) -> bool {
        self.by_whole.channels[channel].bias.has_ramp
    }

    pub(crate) fn sensitivities(&self, channel: ChannelId) -> &[(ChannelId, BiasSensitivity)] {
        &self.by_whole.channels[channel].bias.sensitivities
    }

    pub(crate) fn effects(&self, channel: ChannelId) -> &[Effect] {
        &self.effects[channel]
    }
}

fn measured(measurement: &Measurement, channel: ChannelId, slots: &Arc<[u64]>, counts_per_step: u32) -> Series {
    let series = Series::with_shared_slots(measurement, channel, || Arc::clone(slots));
    series.with_counts_per_step(counts_per_step)
}

fn all_measured(
    measurement: &Measurement,
    slots: &Arc<[u64]>,
    counts_per_step: &PerChannel<u32>,
) -> PerChannel<Series> {
    per_channel(measurement.ids(), |channel| measured(measurement, channel, slots, counts_per_step[channel]))
}

impl Shown {
    /// The findings in a record, after the rules for its events, and the effects of each channel.
    fn find(record: &CondensedRecord, slots: &Arc<[u64]>) -> (EventRules, Self, PerChannel<Vec<Effect>>) {
        let measurement = record.means.as_ref();
        let counts_per_step = record.channels.map(|of| of.counts_per_step);
        let series = all_measured(measurement, slots, &counts_per_step);
        let (knock_rules, loud) = loud_stretches(record, &series);
        let once = series.map(|of| of.clone().without(&record.repeated));
        // Covariates, without their own knocks.
        let quiet = without_knocks(&once, &loud);
        let forces = forces(measurement, &quiet);
        let of_channel = |channel: ChannelId| {
            if !record.is_traced(channel) {
                return ((ShownInChannel::default(), None), Vec::new());
            }
            let LoudStretches { knocks, by_itself } = &loud[channel];
            let can_show_spikes = record.channels[channel].can_show_spikes;
            let spike_rule = can_show_spikes.then(|| SpikeRule::fit(&quiet[channel])).flatten();
            let spikes = spike_rule.as_ref().and_then(|rule| rule.detect(&quiet[channel], by_itself));
            let excluded = spikes.as_ref().map(|found| found.excluded().to_vec()).unwrap_or_default();
            let (bias, found) = bias_of(record, channel, (&once, &quiet), &forces, &excluded);
            let BiasChanges { step, ramp, responses, .. } = found;
            let changes = spikes.into_iter().chain(step).chain(ramp).map(|detection| detection.effect);
            let knocked = intervals(measurement, &loud, channel).into_iter().map(Effect::from);
            let effects = responses.iter().map(|of| of.effect.clone()).chain(knocked).chain(changes).collect();
            let knocks = slots_within(&once[channel], knocks);
            ((ShownInChannel { knocks, spikes: excluded, bias }, spike_rule), effects)
        };
        let ((channels, spikes), effects): ((Vec<_>, Vec<_>), Vec<_>) =
            per_channel(measurement.ids(), of_channel).into_iter().unzip();
        let rules = EventRules { knocks: knock_rules, spikes: spikes.into() };
        (rules, Self { counts_per_step, repeated: record.repeated.clone(), channels: channels.into() }, effects.into())
    }
}

impl EventRules {
    /// The findings `of_first` half, whose rules these are, with the knocks and spikes of the second half of `record`.
    fn continued(&self, of_first: &Shown, record: &CondensedRecord, slots: &Arc<[u64]>) -> Shown {
        let measurement = record.means.as_ref();
        let middle = measurement.middle();
        let second = all_measured(measurement, slots, &of_first.counts_per_step).map(|of| of.from(middle));
        // Repeated samples of the second half are dropped by either exclusion.
        let repeated: Vec<u64> = record.repeated.iter().copied().filter(|slot| *slot >= middle).collect();
        let inertial: Vec<ChannelId> = measurement.inertial().collect();
        let searched: Vec<Series> = inertial.iter().map(|&of| second[of].clone()).collect();
        let loud = of_inertial(measurement, self.knocks.find(&searched, &repeated));
        let once = second.map(|of| of.clone().without(&repeated));
        let quiet = without_knocks(&once, &loud);
        let of_channel = |channel: ChannelId| {
            if !record.is_traced(channel) {
                return ShownInChannel::default();
            }
            let ShownInChannel { knocks, spikes, bias } = &of_first.channels[channel];
            let LoudStretches { knocks: later_knocks, by_itself } = &loud[channel];
            let later_spikes = self.spikes[channel].as_ref().map(|rule| rule.slots(&quiet[channel], by_itself));
            ShownInChannel {
                knocks: [&knocks[..], &slots_within(&once[channel], later_knocks)].concat(),
                spikes: [&spikes[..], &later_spikes.unwrap_or_default()].concat(),
                bias: bias.clone(),
            }
        };
        Shown {
            counts_per_step: of_first.counts_per_step.clone(),
            channels: per_channel(measurement.ids(), of_channel),
            repeated: [&of_first.repeated[..], &repeated].concat(),
        }
    }
}

impl ShownInChannel {
    fn events(&self) -> Vec<u64> {
        merged([&self.knocks, &self.spikes])
    }
}

/// Changes of the bias of `channel` without its spikes; `quiet` are all `series` without their knocks.
fn bias_of(
    record: &CondensedRecord,
    channel: ChannelId,
    (series, quiet): (&PerChannel<Series>, &PerChannel<Series>),
    forces: &Forces,
    spikes: &[u64],
) -> (ChannelBias, BiasChanges) {
    let measurement = record.means.as_ref();
    let regressors: Vec<ChannelId> =
        measurement.ids().filter(|&regressor| may_depend(measurement, channel, regressor)).collect();
    let others: Vec<&Series> = regressors.iter().map(|&regressor| &quiet[regressor]).collect();
    // The least step that rounding cannot make of a slow change.
    let smallest_step = LazyCell::new(|| {
        find_noise_below_count(&series[channel], measurement.profile.dithered_avar_counts2)
            .map_or(0.0, |_| NEIGHBOURING_COUNTS * series[channel].resolution)
    });
    let least_step = || *smallest_step;
    let own = quiet[channel].clone().without(spikes);
    let accelerations = accelerations(record, series, channel);
    let found = bias::find(&without_lines(own.clone()), &others, &accelerations, &least_step);
    let own = offset(&found).into_iter().fold(own, |own, (from, size)| own.lowered_from(from, size));
    // Differences, or the force at each frequency, determine a sensitivity to motion better.
    let is_slow = |(regressor, _): &(ChannelId, _)| measurement[*regressor].profile.quantity.is_environment();
    let slow = found.sensitivities.iter().map(|&(at, of)| (regressors[at], of)).filter(is_slow);
    let is_rate = measurement[channel].profile.quantity == Quantity::AngularRate;
    let by_force = if is_rate { forces.sensitivities_of(&own) } else { Vec::new() };
    let accelerometers: Vec<ChannelId> = measurement.of_quantity(Quantity::SpecificForce).collect();
    let sensitivities = slow.chain(by_force.into_iter().map(|(place, of)| (accelerometers[place], of)));
    let bias = ChannelBias {
        offset: offset(&found),
        has_ramp: found.ramp.is_some(),
        responses: found.responses.clone(),
        sensitivities: sensitivities.collect(),
    };
    (bias, found)
}

/// First sample period behind a step, and its size.
fn offset(found: &BiasChanges) -> Option<(u64, f64)> {
    match found.step.as_ref()?.correction {
        Some(Correction::Offset { from, size }) => Some((from, size)),
        _ => None,
    }
}

fn without_knocks(series: &PerChannel<Series>, loud: &PerChannel<LoudStretches>) -> PerChannel<Series> {
    let of = |(channel, series): (ChannelId, &Series)| {
        let knocks = &loud[channel].knocks;
        if knocks.is_empty() { series.clone() } else { series.clone().without(&slots_within(series, knocks)) }
    };
    series.with_ids().map(of).collect()
}

/// The knocks of a channel, with the names of the channels that show each.
fn intervals(measurement: &Measurement, loud: &PerChannel<LoudStretches>, channel: ChannelId) -> Vec<NoisyInterval> {
    let interval = |knock: &Knock| {
        let shows = |others: &LoudStretches| others.knocks.iter().any(|other| other.overlaps(knock));
        let shown = loud.with_ids().filter(|(_, others)| shows(others));
        let shown: Vec<&'static str> = shown.map(|(of, _)| measurement[of].profile.name).collect();
        knock.interval(measurement.period_s(), &shown)
    };
    loud[channel].knocks.iter().map(interval).collect()
}

/// The rules for knocks in the inertial channels of a record, and the loud stretches of each channel.
fn loud_stretches(record: &CondensedRecord, series: &PerChannel<Series>) -> (KnockSearch, PerChannel<LoudStretches>) {
    let measurement = record.means.as_ref();
    let searched = |of: ChannelId| SearchedChannel {
        series: series[of].clone(),
        can_show_spikes: record.channels[of].can_show_spikes,
    };
    let searched: Vec<SearchedChannel> = measurement.inertial().map(searched).collect();
    let dithered_avar_counts2 = measurement.profile.dithered_avar_counts2;
    let (search, found) = KnockSearch::fit(&searched, &record.repeated, dithered_avar_counts2);
    (search, of_inertial(measurement, found))
}

/// The loud stretches of every channel: those `found` in the inertial ones, none in the others.
fn of_inertial(measurement: &Measurement, found: Vec<LoudStretches>) -> PerChannel<LoudStretches> {
    let mut loud: PerChannel<LoudStretches> = measurement.ids().map(|_| LoudStretches::default()).collect();
    measurement.inertial().zip(found).for_each(|(of, found)| loud[of] = found);
    loud
}

fn forces(measurement: &Measurement, quiet: &PerChannel<Series>) -> Forces {
    let has_rates = measurement.of_quantity(Quantity::AngularRate).next().is_some();
    let forces = measurement.of_quantity(Quantity::SpecificForce).filter(|_| has_rates).map(|of| &quiet[of]);
    Forces::new(&forces.collect::<Vec<&Series>>())
}

fn accelerations<'s>(
    record: &'s CondensedRecord,
    series: &'s PerChannel<Series>,
    channel: ChannelId,
) -> Vec<Acceleration<'s>> {
    let measurement = record.means.as_ref();
    let acceleration = |of: ChannelId| {
        let profile = &measurement[of].profile;
        let largest = largest_sensitivity(measurement[channel].profile.range, profile.range);
        Acceleration { name: profile.name, series: &series[of], variances: &record.channels[of].variances, largest }
    };
    measurement.of_quantity(Quantity::SpecificForce).map(acceleration).collect()
}

/// Without sinusoids, to regressions ramps, steps or noise; unchanged if a long gap splits the series.
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

/// Merges ascending lists, without duplicates.
fn merged(lists: [&[u64]; 2]) -> Vec<u64> {
    let mut all = lists.concat();
    all.sort_unstable();
    all.dedup();
    all
}

/// True if the bias of `channel` may depend on `regressor`: temperature, supply, force on a gyroscope.
fn may_depend(measurement: &Measurement, channel: ChannelId, regressor: ChannelId) -> bool {
    let [channel, regressor] = [channel, regressor].map(|of| measurement[of].profile.quantity);
    let motion = regressor == Quantity::SpecificForce && channel == Quantity::AngularRate;
    regressor.is_environment() || motion
}
