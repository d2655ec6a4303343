//! The search for knocks in channels that were recorded together, stage by stage.
//!
//! ```text
//! channels ─► long knocks ─► without them ─┬► single samples that stand out
//!                                          ├► short knocks, found again without the single samples that chance puts into them
//!                                          ├► disturbances that are no single sample, but for those in noise that is louder by itself
//!                                          └► what single samples show of the knocks of other channels
//! ```

use super::knocks::{BlockSize, Knock, KnockRule, find_by, join};
use super::spikes::{Disturbance, FoundSpikes, SpikeRule};
use crate::parallel::in_parallel;
use crate::samples::series::Series;
use std::ops::Range;

/// A channel in which knocks are sought.
pub(crate) struct SearchedChannel<'a> {
    /// By which its rules are fitted: the first of `parts`.
    pub fitted: &'a Series,
    /// In which knocks are sought, in the order of time; of every channel as many. None of them decides what another one shows.
    pub parts: Vec<&'a Series>,
    /// Whether single samples are looked at.
    pub can_show_spikes: bool,
}

/// Where one channel is loud.
#[derive(Debug, Clone, Default)]
pub(crate) struct LoudStretches {
    pub knocks: Vec<Knock>,
    /// Sample periods in which the level of its noise, which moves by itself, is high: what stands out in them is no spike.
    pub by_itself: Vec<Range<u64>>,
}

/// What stands out of the noise of one channel by single samples.
struct StandingOut<'a> {
    rule: &'a SpikeRule,
    disturbances: Vec<Disturbance>,
    by_itself: Vec<Range<u64>>,
    singles: FoundSpikes,
    /// Samples that were looked at.
    samples: u64,
}

/// Where each channel is loud, for each part. Noise with a first Allan variance of at least `dithered_avar_counts2` dithers the rounding.
/// Samples in the sample periods `repeated` are loud as their neighbours are, but make spikes of these.
pub(crate) fn find(
    channels: &[SearchedChannel],
    repeated: &[u64],
    dithered_avar_counts2: f64,
) -> Vec<Vec<LoudStretches>> {
    let rules = in_parallel(channels, |of| KnockRule::fit(of.fitted, dithered_avar_counts2));
    let parts = channels.first().map_or(0, |of| of.parts.len());
    let series_of = |part: usize| channels.iter().map(move |of| of.parts[part].clone()).collect::<Vec<Series>>();
    let long: Vec<Vec<Vec<Knock>>> =
        (0..parts).map(|part| find_by(&rules, &series_of(part), BlockSize::Many)).collect();
    let places: Vec<usize> = (0..channels.len()).collect();
    let spike_rules: Vec<Option<SpikeRule>> = in_parallel(&places, |&of| {
        let SearchedChannel { fitted, can_show_spikes, .. } = channels[of];
        let loud = slots_within(fitted, &long.first()?[of]);
        if can_show_spikes { SpikeRule::fit(&fitted.clone().without(&loud).without(repeated)) } else { None }
    });
    (0..parts)
        .zip(long)
        .map(|(part, long)| find_in_part(&series_of(part), (&rules, &spike_rules), long, repeated))
        .collect()
}

/// Where each channel is loud in one part, beside its `long` knocks.
fn find_in_part(
    series: &[Series],
    (rules, spike_rules): (&[KnockRule], &[Option<SpikeRule>]),
    long: Vec<Vec<Knock>>,
    repeated: &[u64],
) -> Vec<LoudStretches> {
    let mut knocks = long;
    let places: Vec<usize> = (0..series.len()).collect();
    let mut quiet: Vec<Series> =
        series.iter().zip(&knocks).map(|(of, knocks)| of.clone().without(&slots_within(of, knocks))).collect();
    let standing_out: Vec<Option<StandingOut>> = in_parallel(&places, |&of| {
        Some(StandingOut::find(spike_rules[of].as_ref()?, &rules[of], &quiet[of].clone().without(repeated)))
    });
    let mut found = find_by(rules, &quiet, BlockSize::Few);
    let by_chance = |(of, found): (&Option<StandingOut>, &Vec<Knock>)| -> Vec<u64> {
        of.iter().flat_map(|of| found.iter().map(move |knock| of.by_chance_in(knock))).flatten().collect()
    };
    let by_chance: Vec<Vec<u64>> = standing_out.iter().zip(&found).map(by_chance).collect();
    if by_chance.iter().any(|of| !of.is_empty()) {
        quiet = quiet.into_iter().zip(by_chance).map(|(series, of)| series.without(&of)).collect();
        found = find_by(rules, &quiet, BlockSize::Few);
    }
    add(&mut knocks, found);
    let mut add_disturbances = |of: &dyn Fn(&StandingOut) -> Vec<Disturbance>| {
        for ((series, found), knocks) in series.iter().zip(&standing_out).zip(&mut knocks) {
            let disturbances = found.as_ref().map(of).unwrap_or_default();
            Knock::add_disturbances(knocks, disturbances, series.values.len());
        }
        knocks.iter().flatten().map(|knock| knock.slots.clone()).collect::<Vec<Range<u64>>>()
    };
    let known = add_disturbances(&|found| found.disturbances.clone());
    add_disturbances(&|found| found.parts_of(&known));
    let by_itself = standing_out.into_iter().map(|found| found.map(|of| of.by_itself).unwrap_or_default());
    knocks.into_iter().zip(by_itself).map(|(knocks, by_itself)| LoudStretches { knocks, by_itself }).collect()
}

fn add(knocks: &mut [Vec<Knock>], found: Vec<Vec<Knock>>) {
    knocks.iter_mut().zip(found).for_each(|(own, found)| found.into_iter().for_each(|knock| join(own, knock)));
}

/// Sample periods of the samples of a series within knocks, in ascending order.
pub(crate) fn slots_within(series: &Series, knocks: &[Knock]) -> Vec<u64> {
    let is_within = |slot: &u64| knocks.iter().any(|knock| knock.slots.contains(slot));
    if knocks.is_empty() { Vec::new() } else { series.slots.iter().copied().filter(is_within).collect() }
}

impl<'a> StandingOut<'a> {
    /// By a rule in a part of a channel. What `levels` explain by a level that moves by itself is no disturbance.
    fn find(rule: &'a SpikeRule, levels: &KnockRule, part: &Series) -> Self {
        let samples = part.values.len() as u64;
        let (singles, disturbed) = rule.separate(rule.find(part), samples);
        let moves = |of: &Disturbance| levels.moves_by_itself(part, &of.certain);
        let (moving, disturbances): (Vec<Disturbance>, Vec<Disturbance>) = disturbed.into_iter().partition(moves);
        let by_itself = moving.into_iter().map(|of| of.slots).collect();
        Self { rule, disturbances, by_itself, singles, samples }
    }

    /// Its single samples in a knock, if chance puts as many there.
    fn by_chance_in(&self, knock: &Knock) -> Vec<u64> {
        self.singles.by_chance_within(&knock.slots, self.samples)
    }

    /// What its single samples show of the `known` knocks.
    fn parts_of(&self, known: &[Range<u64>]) -> Vec<Disturbance> {
        self.rule.parts_of(&self.singles, known, self.samples)
    }
}
