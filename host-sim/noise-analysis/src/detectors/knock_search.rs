//! The search for knocks in channels that were recorded together, stage by stage.
//!
//! ```text
//! channels ─► long knocks ─► without them ─┬► single samples that stand out
//!                                          ├► short knocks, found again without the single samples that chance puts into them
//!                                          ├► disturbances that are no single sample, but for those in noise that is louder by itself
//!                                          └► what single samples show of the knocks of other channels
//! ```

use super::knocks::{BlockSize, Knock, KnockRule, find_by};
use super::spikes::{Disturbance, FoundSpikes, SpikeRule};
use crate::parallel::in_parallel;
use crate::samples::series::Series;
use std::ops::Range;

/// A channel in which knocks are sought.
pub(crate) struct SearchedChannel<'a> {
    /// By which its rules are fitted.
    pub fitted: &'a Series,
    /// In which knocks are sought, in the order of time; of every channel as many.
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
struct StandingOut {
    rule: SpikeRule,
    disturbances: Vec<Disturbance>,
    by_itself: Vec<Range<u64>>,
    singles: FoundSpikes,
    /// Samples that were looked at.
    samples: u64,
}

/// Where each channel is loud. Noise with a first Allan variance of at least `dithered_avar_counts2` dithers the rounding. Samples in the
/// sample periods `repeated` are loud as their neighbours are, but make spikes of these.
pub(crate) fn find(channels: &[SearchedChannel], repeated: &[u64], dithered_avar_counts2: f64) -> Vec<LoudStretches> {
    let rules = in_parallel(channels, |of| KnockRule::fit(of.fitted, dithered_avar_counts2));
    let parts = channels.first().map_or(0, |of| of.parts.len());
    let mut knocks: Vec<Vec<Knock>> = channels.iter().map(|_| Vec::new()).collect();
    for part in 0..parts {
        let part: Vec<Series> = channels.iter().map(|of| of.parts[part].clone()).collect();
        add(&mut knocks, find_by(&rules, &part, BlockSize::Many));
    }
    let long = knocks.clone();
    let quiet = |of: usize, series: &Series| series.clone().without(&slots_within(series, &long[of]));
    let places: Vec<usize> = (0..channels.len()).collect();
    let standing_out: Vec<Option<StandingOut>> = in_parallel(&places, |&of| {
        let SearchedChannel { fitted, parts, can_show_spikes } = &channels[of];
        let once = |series: &Series| quiet(of, series).without(repeated);
        let rule = if *can_show_spikes { SpikeRule::fit(&once(fitted))? } else { return None };
        let parts: Vec<Series> = parts.iter().map(|part| once(part)).collect();
        Some(StandingOut::find(rule, &rules[of], &parts))
    });
    for part in 0..parts {
        let mut part: Vec<Series> = places.iter().map(|&of| quiet(of, channels[of].parts[part])).collect();
        let mut found = find_by(&rules, &part, BlockSize::Few);
        let by_chance = |(of, found): (&Option<StandingOut>, &Vec<Knock>)| -> Vec<u64> {
            of.iter().flat_map(|of| found.iter().map(move |knock| of.by_chance_in(knock))).flatten().collect()
        };
        let by_chance: Vec<Vec<u64>> = standing_out.iter().zip(&found).map(by_chance).collect();
        if by_chance.iter().any(|of| !of.is_empty()) {
            part = part.into_iter().zip(by_chance).map(|(part, of)| part.without(&of)).collect();
            found = find_by(&rules, &part, BlockSize::Few);
        }
        add(&mut knocks, found);
    }
    let mut add_disturbances = |of: &dyn Fn(&StandingOut) -> Vec<Disturbance>| {
        for ((channel, found), knocks) in channels.iter().zip(&standing_out).zip(&mut knocks) {
            let samples = channel.parts.iter().map(|part| part.values.len()).sum();
            Knock::add_disturbances(knocks, found.as_ref().map(of).unwrap_or_default(), samples);
        }
        knocks.iter().flatten().map(|knock| knock.slots.clone()).collect::<Vec<Range<u64>>>()
    };
    let known = add_disturbances(&|found| found.disturbances.clone());
    add_disturbances(&|found| found.parts_of(&known));
    let by_itself = standing_out.into_iter().map(|found| found.map(|of| of.by_itself).unwrap_or_default());
    knocks.into_iter().zip(by_itself).map(|(knocks, by_itself)| LoudStretches { knocks, by_itself }).collect()
}

fn add(knocks: &mut [Vec<Knock>], found: Vec<Vec<Knock>>) {
    knocks.iter_mut().zip(found).for_each(|(own, found)| own.extend(found));
}

/// Sample periods of the samples of a series within knocks, in ascending order.
pub(crate) fn slots_within(series: &Series, knocks: &[Knock]) -> Vec<u64> {
    let is_within = |slot: &u64| knocks.iter().any(|knock| knock.slots.contains(slot));
    if knocks.is_empty() { Vec::new() } else { series.slots.iter().copied().filter(is_within).collect() }
}

impl StandingOut {
    /// By a rule in the parts of a channel, in the order of time. What `levels` explain by a level that moves by itself is no disturbance.
    fn find(rule: SpikeRule, levels: &KnockRule, parts: &[Series]) -> Self {
        let (mut disturbances, mut by_itself) = (Vec::new(), Vec::new());
        let (mut singles, mut samples) = (FoundSpikes::default(), 0);
        for part in parts {
            let of_part = part.values.len() as u64;
            let (single, disturbed) = rule.separate(rule.find(part), of_part);
            singles.extend(single);
            for disturbance in disturbed {
                if levels.moves_by_itself(part, &disturbance.certain) {
                    by_itself.push(disturbance.slots);
                } else {
                    disturbances.push(disturbance);
                }
            }
            samples += of_part;
        }
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
