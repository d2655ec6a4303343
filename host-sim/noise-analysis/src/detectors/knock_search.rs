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

/// A channel in the part of a recording that its rules are fitted to.
pub(crate) struct SearchedChannel {
    pub series: Series,
    pub can_show_spikes: bool,
}

/// The rules of channels, fitted to one part of a recording, by which knocks are sought there and in other parts.
pub(crate) struct KnockSearch {
    knocks: Vec<KnockRule>,
    spikes: Vec<Option<SpikeRule>>,
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

impl KnockSearch {
    /// The rules by a part of a recording, and the loud stretches of each channel there; a first Allan variance of
    /// `dithered_avar_counts2` dithers.
    pub(crate) fn fit(
        channels: &[SearchedChannel],
        repeated: &[u64],
        dithered_avar_counts2: f64,
    ) -> (Self, Vec<LoudStretches>) {
        let knocks = in_parallel(channels, |of| KnockRule::fit(&of.series, dithered_avar_counts2));
        let series: Vec<Series> = channels.iter().map(|of| of.series.clone()).collect();
        let long = find_by(&knocks, &series, BlockSize::Many);
        let places: Vec<usize> = (0..channels.len()).collect();
        let spikes = in_parallel(&places, |&of| {
            let SearchedChannel { series, can_show_spikes } = &channels[of];
            let without = || series.clone().without(&slots_within(series, &long[of])).without(repeated);
            if *can_show_spikes { SpikeRule::fit(&without()) } else { None }
        });
        let search = Self { knocks, spikes };
        let found = search.find_beside(long, &series, repeated);
        (search, found)
    }

    pub(crate) fn find(&self, series: &[Series], repeated: &[u64]) -> Vec<LoudStretches> {
        self.find_beside(find_by(&self.knocks, series, BlockSize::Many), series, repeated)
    }

    fn find_beside(&self, long: Vec<Vec<Knock>>, series: &[Series], repeated: &[u64]) -> Vec<LoudStretches> {
        let Self { knocks: rules, spikes: spike_rules } = self;
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
