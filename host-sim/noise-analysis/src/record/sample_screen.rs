//! Drops spikes, knocks and repeated samples of a recording that is read in blocks, by known rules.

use crate::detectors::knocks::Knock;
use crate::detectors::spikes::{FoundSpikes, SpikeRule};
use crate::effects::Effect;
use crate::parallel::in_parallel;
use crate::samples::interpolation::REACH;
use crate::samples::series::Series;
use measurement::{ChannelProfile, MeasuredChannel, SampleBlock};
use std::ops::Range;

/// Samples examined together, around whose mean a spike stands out.
const TOGETHER: usize = 1 << 16;

pub(crate) struct SampleScreen {
    /// Per channel, the rule for its spikes, if they are sought.
    rules: Vec<Option<SpikeRule>>,
    found: Vec<FoundSpikes>,
    leaves_out_repeated: bool,
    /// Samples not yet passed on, behind a few that were.
    held: SampleBlock,
    settled: usize,
}

impl SampleScreen {
    pub(crate) fn new(channels: &[ChannelProfile], rules: Vec<Option<SpikeRule>>, leaves_out_repeated: bool) -> Self {
        let empty = |profile: &ChannelProfile| MeasuredChannel::new(*profile, Vec::new());
        let held = SampleBlock { slots: Vec::new(), channels: channels.iter().map(empty).collect() };
        let found = channels.iter().map(|_| FoundSpikes::default()).collect();
        Self { rules, found, leaves_out_repeated, held, settled: 0 }
    }

    /// Takes the next samples; passes on those whose neighbours are known, with spikes, knocks and repeated ones refused.
    pub(crate) fn push(&mut self, block: &SampleBlock, mut pass: impl FnMut(&SampleBlock)) {
        let mut from = 0;
        while from < block.slots.len() {
            let to = (from + TOGETHER - self.held.slots.len()).min(block.slots.len());
            append(&mut self.held, block.part(from..to));
            from = to;
            if self.held.slots.len() == TOGETHER {
                pass(&self.settle(TOGETHER - REACH));
                let kept = TOGETHER - 2 * REACH;
                self.held = self.held.part(kept..TOGETHER);
                self.settled = REACH;
            }
        }
    }

    /// The remaining samples of a part of the record; what follows does not affect them.
    pub(crate) fn finish_part(&mut self) -> SampleBlock {
        let end = self.held.slots.len();
        let settled = self.settle(end);
        self.held = self.held.part(end..end);
        self.settled = 0;
        settled
    }

    /// The spikes and knocks of each channel in the first `periods` sample periods of `period_s` s.
    pub(crate) fn effects(&self, periods: u64, period_s: f64) -> Vec<Vec<Effect>> {
        let hours = periods as f64 * period_s / 3600.0;
        let of_channel = |((rule, found), channel): ((&Option<SpikeRule>, &FoundSpikes), &MeasuredChannel)| {
            let Some(rule) = rule else { return (None, Vec::new()) };
            let (singles, disturbances) = rule.separate(found.before(periods), periods);
            // If they are no spikes in the whole recording, those of a part are none.
            let spikes = rule.detection(&found.out_of_noise(), (hours, periods), channel.profile.unit);
            let in_part = || rule.detection(&singles.out_of_noise(), (hours, periods), channel.profile.unit);
            let spikes = spikes.and_then(|_| in_part());
            (spikes.map(|found| found.effect), disturbances.into_iter().map(Knock::from).collect::<Vec<Knock>>())
        };
        let found: Vec<(Option<Effect>, Vec<Knock>)> =
            self.rules.iter().zip(&self.found).zip(&self.held.channels).map(of_channel).collect();
        let shown = |knock: &Knock| {
            let overlaps = |(_, knocks): &(Option<Effect>, Vec<Knock>)| knocks.iter().any(|of| of.overlaps(knock));
            let all = found.iter().zip(&self.held.channels);
            all.filter(|(of, _)| overlaps(of)).map(|(_, channel)| channel.profile.name).collect::<Vec<_>>()
        };
        let interval = |knock: &Knock| Effect::from(knock.interval(period_s, &shown(knock)));
        found
            .iter()
            .map(|(spikes, knocks)| spikes.iter().cloned().chain(knocks.iter().map(interval)).collect())
            .collect()
    }

    /// The outliers of each channel before the sample period `middle`, with their distances from the neighbours.
    pub(crate) fn found_before(&self, middle: u64) -> impl Iterator<Item = Vec<(u64, f64)>> {
        self.found.iter().map(move |found| found.before(middle).samples().collect())
    }

    /// The samples up to `end`, with the outliers refused.
    fn settle(&mut self, end: usize) -> SampleBlock {
        let mut settled = self.held.part(self.settled..end);
        let numbered: Vec<usize> = (0..self.rules.len()).collect();
        let spikes = in_parallel(&numbered, |&at| {
            let rule = self.rules[at].as_ref()?;
            let own = series(&self.held, at);
            let found = rule.find(&own).within(&(*settled.slots.first()?..settled.slots.last()? + 1));
            Some((rule.separate(found.clone(), own.values.len() as u64), found))
        });
        let is_repeated = |&at: &usize| {
            let at = at + self.settled;
            at > 0 && self.held.channels.iter().all(|channel| channel.counts[at] == channel.counts[at - 1])
        };
        let all = if self.leaves_out_repeated { settled.slots.len() } else { 0 };
        let repeated: Vec<usize> = (0..all).filter(is_repeated).collect();
        for ((channel, found), spikes) in settled.channels.iter_mut().zip(&mut self.found).zip(spikes) {
            let ((singles, disturbances), spikes) = spikes.unwrap_or_default();
            let position = |slot: u64| settled.slots.binary_search(&slot).ok();
            let within = |slots: &Range<u64>| {
                let [from, to] = [slots.start, slots.end].map(|end| settled.slots.partition_point(|slot| *slot < end));
                from..to
            };
            let knocks: Vec<usize> = disturbances.iter().flat_map(|of| within(&of.slots)).collect();
            let spikes_alone: Vec<usize> = singles.out_of_noise().slots().filter_map(position).collect();
            for (cause, positions) in [("spikes", spikes_alone), ("knock", knocks), ("repeated", repeated.clone())] {
                if !positions.is_empty() {
                    channel.refused.insert(cause, positions);
                }
            }
            found.extend(spikes);
        }
        settled
    }
}

fn append(block: &mut SampleBlock, later: SampleBlock) {
    let offset = block.slots.len();
    block.slots.extend(later.slots);
    for (channel, later) in block.channels.iter_mut().zip(later.channels) {
        channel.counts.extend(later.counts);
        for (cause, positions) in later.refused {
            channel.refused.entry(cause).or_default().extend(positions.iter().map(|position| position + offset));
        }
    }
}

fn series(block: &SampleBlock, at: usize) -> Series {
    let channel = &block.channels[at];
    let profile = channel.profile;
    let (slots, values): (Vec<u64>, Vec<f64>) =
        channel.used_samples(&block.slots).map(|(slot, count)| (slot, f64::from(count) * profile.lsb)).unzip();
    let span = block.slots.first().copied().unwrap_or(0)..block.slots.last().map_or(0, |last| last + 1);
    Series {
        slots: slots.into(),
        values: values.into(),
        span,
        // Only the order of the samples counts.
        period_s: 1.0,
        resolution: profile.lsb,
        unit: profile.unit,
    }
}
