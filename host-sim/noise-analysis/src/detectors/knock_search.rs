//! The search for knocks in channels that were recorded together.
//!
//! ```text
//! channels ─► long knocks ─► without them ─┬► single samples that stand out
//!                                          ├► short knocks, found again without the single samples that chance puts into them
//!                                          ├► disturbances that are no single sample, but for those in noise that is louder by itself
//!                                          └► what single samples show of the knocks of other channels
//! ```

use super::knocks::{BlockSize, Knock, KnockRule, find_by, join, slots_within};
use super::spikes::{Disturbance, FoundSpikes, SpikeRule};
use crate::parallel::in_parallel;
use crate::samples::series::Series;
use std::ops::Range;

pub(crate) struct SearchedChannel<'a> {
    /// The first of `parts`, by which the channel's rules are fitted.
    pub fitted: &'a Series,
    /// The parts in which knocks are sought, in the order of time; none affects another one.
    pub parts: Vec<&'a Series>,
    pub can_show_spikes: bool,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct LoudStretches {
    pub knocks: Vec<Knock>,
    /// Sample periods in which the wandering level of the noise is high: outliers there are no spikes.
    pub by_itself: Vec<Range<u64>>,
}

struct StandingOut<'a> {
    rule: &'a SpikeRule,
    disturbances: Vec<Disturbance>,
    by_itself: Vec<Range<u64>>,
    singles: FoundSpikes,
    samples: u64,
}

/// The loud stretches of each channel, for each part; a first Allan variance of `dithered_avar_counts2` dithers.
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

impl<'a> StandingOut<'a> {
    /// Applies a rule to a part of a channel; a wandering level that explains louder noise is no disturbance.
    fn find(rule: &'a SpikeRule, levels: &KnockRule, part: &Series) -> Self {
        let samples = part.values.len() as u64;
        let (singles, disturbed) = rule.separate(rule.find(part), samples);
        let certain: Vec<Range<u64>> = disturbed.iter().map(|of| of.certain.clone()).collect();
        let mut moves = levels.move_by_themselves(part, &certain).into_iter();
        let (moving, disturbances): (Vec<Disturbance>, Vec<Disturbance>) =
            disturbed.into_iter().partition(|_| moves.next().unwrap_or(false));
        let by_itself = moving.into_iter().map(|of| of.slots).collect();
        Self { rule, disturbances, by_itself, singles, samples }
    }

    fn by_chance_in(&self, knock: &Knock) -> Vec<u64> {
        self.singles.by_chance_within(&knock.slots, self.samples)
    }

    /// Evidence of the `known` knocks in its single samples.
    fn parts_of(&self, known: &[Range<u64>]) -> Vec<Disturbance> {
        self.rule.parts_of(&self.singles, known, self.samples)
    }
}
