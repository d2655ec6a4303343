//! Knocks: stretches of some samples to minutes whose noise level the stretches on both sides exclude.
//!
//! Blocks of several lengths are tested at several averaging times. [`SIGNIFICANCE`] is divided equally among all of them. The likeliest
//! stretch around a loud block is the knock; the rest is tested again. The time of a knock is tested in the other channels alone.

use super::change_point::ChangeOfLevel;
use super::noise_levels::{
    BlockLevels, DIFFERENCES, FEW_DIFFERENCES, HALF_EFFICIENCY, LevelScatter, NEIGHBOURS, Neighbourhood,
    SquaredDifferences, TRIMMED_MEAN, Wandering, averaging_factors, doublings, exceedance, ratio_by_chance,
};
use super::spikes::Disturbance;
use crate::bounds::BoundedEstimate;
use crate::distributions::NORMAL_975;
use crate::effects::NoisyInterval;
use crate::effects::findings::SIGNIFICANCE;
use crate::parallel::in_parallel;
use crate::robust::median;
use crate::samples::rounding::dithered_avar;
use crate::samples::series::Series;
use std::ops::Range;

/// Highest p-value of a knock at the time of another channel's knock.
const SIGNIFICANCE_AT_A_KNOWN_TIME: f64 = 1e-3;
/// Highest p-value of the smaller half of the squares of a loud block.
const SIGNIFICANCE_THROUGHOUT: f64 = 1e-3;
/// Largest part of the samples in knocks; beyond it the level wanders all the time, and the channel has none.
const LARGEST_SHARE: f64 = 0.1;
/// Most rounds, each without the knocks that were found.
const PASSES: usize = 8;
const FEWEST_DIFFERENCES: usize = 16;
const SIDE: i64 = 6;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Knock {
    /// Sample periods that may belong to it and are left out.
    pub slots: Range<u64>,
    from: BoundedSlot,
    to: BoundedSlot,
    /// Standard deviation of the differences over that of the neighbours, with 95 % bounds.
    level: f64,
    level_bounds: (f64, f64),
    n: usize,
    /// p-value for anywhere in the record, or for a time known from another channel.
    p_value: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct BoundedSlot {
    value: u64,
    low: u64,
    high: u64,
}

/// The scatter of one channel's noise level without knocks.
#[derive(Debug, Clone)]
pub(crate) struct KnockRule {
    scales: Vec<Scale>,
    /// Least level of the neighbours, against noise below one count.
    floor: f64,
}

#[derive(Debug, Clone)]
struct Scale {
    n: usize,
    /// Blocks of [`FEW_DIFFERENCES`] and of [`DIFFERENCES`].
    blocks: [Blocks; 2],
    moving: Option<[Blocks; 2]>,
}

#[derive(Debug, Clone)]
struct Blocks {
    size: usize,
    freedoms: Vec<BlockFreedom>,
    /// True if levels of one length wander, also without the loudest stretch, which may be a knock.
    moves: bool,
}

/// Lengths at which levels are taken to wander.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Moving {
    /// The length that shows it, and longer ones.
    OwnLength,
    /// All lengths of an averaging time of which one shows it: the noise of shorter ones may hide it.
    AnyLength,
}

#[derive(Debug, Clone, Copy)]
struct BlockFreedom {
    block: f64,
    neighbours: f64,
    wandering: Option<Wandering>,
}

#[derive(Clone)]
struct LoudBlock {
    scale: usize,
    differences: Range<usize>,
    quiet: f64,
    ratio: f64,
    freedom: BlockFreedom,
    p_value: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum BlockSize {
    /// Tested only where there is neither a longer knock nor a spike.
    Few,
    Many,
}

/// Knocks by channel, in the order of time, with one rule a channel.
pub(crate) fn find_by(rules: &[KnockRule], channels: &[Series], size: BlockSize) -> Vec<Vec<Knock>> {
    let pairs: Vec<(&KnockRule, &Series)> = rules.iter().zip(channels).collect();
    let mut found: Vec<Vec<Knock>> = in_parallel(&pairs, |(rule, series)| rule.find(series, size, Moving::OwnLength));
    let all: Vec<Knock> = found.iter().flatten().cloned().collect();
    for ((rule, series), own) in rules.iter().zip(channels).zip(&mut found) {
        for known in &all {
            if !own.iter().any(|own| own.overlaps(known)) {
                own.extend(rule.at_known_time(series, known));
            }
        }
        own.sort_by_key(|knock| knock.slots.start);
    }
    leave_out_movements(&pairs, size, &mut found);
    found
}

/// Drops a knock of one channel alone that a wandering level, seen at other lengths of blocks, may explain.
fn leave_out_movements(channels: &[(&KnockRule, &Series)], size: BlockSize, found: &mut [Vec<Knock>]) {
    let sought: Vec<_> = channels.iter().zip(found.iter()).collect();
    let standing = in_parallel(&sought, |((rule, series), own)| {
        let may_move = !own.is_empty() && rule.moves_at_other_lengths();
        may_move.then(|| rule.find(series, size, Moving::AnyLength))
    });
    let all = found.to_vec();
    for (at, (own, standing)) in found.iter_mut().zip(standing).enumerate() {
        let Some(standing) = standing else { continue };
        own.retain(|knock| {
            let mut others = all.iter().enumerate().filter(|(other, _)| *other != at).flat_map(|(_, other)| other);
            standing.iter().any(|of| of.overlaps(knock)) || others.any(|other| other.overlaps(knock))
        });
    }
}

impl KnockRule {
    pub(crate) fn fit(series: &Series, dithered_avar_counts2: f64) -> Self {
        let count = series.resolution * series.resolution;
        let mut is_dithered = false;
        let mut scales = Vec::new();
        for n in averaging_factors(series.period_s) {
            let differences = SquaredDifferences::new(series, n);
            let [few_noise, noise] = differences.freedoms();
            let of_half = scales.last().and_then(|half: &Scale| half.blocks[0].freedoms.last()?.wandering);
            let unknown = BlockFreedom { block: f64::INFINITY, neighbours: f64::INFINITY, wandering: of_half };
            let few_levels = differences.levels(FEW_DIFFERENCES, 0);
            let levels = differences.levels(DIFFERENCES, 0);
            let fit = |moves: bool| {
                let fit_to = |levels, of_noise, shorter| {
                    Blocks::fit(&differences, (levels, moves), series.period_s, of_noise, shorter)
                };
                let few = fit_to(&few_levels, (FEW_DIFFERENCES, few_noise), unknown);
                let shorter = few.freedoms.last().map_or(unknown, |last| {
                    last.times(DIFFERENCES as f64 / (FEW_DIFFERENCES << (few.freedoms.len() - 1)) as f64)
                });
                [few, fit_to(&levels, (DIFFERENCES, noise), shorter)]
            };
            let blocks = fit(false);
            let moving = blocks.iter().any(|of| of.moves).then(|| fit(true));
            let typical = median(&mut levels.levels()) / TRIMMED_MEAN;
            // The Allan variance is half the mean square of the differences.
            is_dithered |= 0.5 * typical > dithered_avar(dithered_avar_counts2, n as u64) * count;
            if blocks[0].freedoms.is_empty() {
                break;
            }
            scales.push(Scale { n, blocks, moving });
        }
        let floor = if is_dithered { 0.0 } else { count };
        Self { scales, floor }
    }

    fn moves_at_other_lengths(&self) -> bool {
        self.scales.iter().any(|scale| scale.moving.is_some())
    }

    fn find(&self, series: &Series, size: BlockSize, moving: Moving) -> Vec<Knock> {
        let mut rest = series.clone();
        let mut knocks: Vec<Knock> = Vec::new();
        for _ in 0..PASSES {
            let next = self.loudest(&rest, size, moving);
            if next.is_empty() {
                break;
            }
            let excluded = slots_within(&rest, &next);
            rest = rest.without(&excluded);
            next.into_iter().for_each(|knock| join(&mut knocks, knock));
            if (series.values.len() - rest.values.len()) as f64 > LARGEST_SHARE * series.values.len() as f64 {
                return Vec::new();
            }
        }
        knocks
    }

    /// Knocks around the loudest blocks, by chance in half of [`SIGNIFICANCE`]; none overlaps another.
    fn loudest(&self, series: &Series, size: BlockSize, moving: Moving) -> Vec<Knock> {
        let scales: Vec<SquaredDifferences> =
            self.scales.iter().map(|scale| SquaredDifferences::new(series, scale.n)).collect();
        let (mut blocks, mut tests) = (Vec::<LoudBlock>::new(), 0_usize);
        for (scale, differences) in scales.iter().enumerate() {
            let [few, many] = self.scales[scale].blocks_by(moving);
            // A short knock may lie in halves of two blocks.
            let (of_size, from) = match size {
                BlockSize::Few => (few, [0, FEW_DIFFERENCES / 2].as_slice()),
                BlockSize::Many => (many, [0].as_slice()),
            };
            for &from in from {
                let (found, tested) = self.loud_blocks((scale, of_size), differences, from, series.period_s);
                blocks.extend(found);
                tests += tested;
            }
        }
        let limit = 0.5 * SIGNIFICANCE / tests.max(1) as f64;
        let slots_of = |block: &LoudBlock| scales[block.scale].slots(block.differences.clone());
        // Probability by the wandering level, at the scale that shows it most.
        let by_itself = |block: &LoudBlock| {
            let own = slots_of(block);
            let is_around = |other: &Range<u64>| {
                other.start < own.end && own.start < other.end && other.end - other.start >= own.end - own.start
            };
            let loudest =
                blocks.iter().filter(|other| is_around(&slots_of(other))).max_by(|a, b| a.ratio.total_cmp(&b.ratio));
            loudest.and_then(|of| Some(of.freedom.wandering?.exceedance(of.ratio))).unwrap_or(0.0)
        };
        let is_knock = |block: &&LoudBlock| {
            block.p_value < limit && self.is_loud_throughout(block, &scales[block.scale]) && by_itself(block) < limit
        };
        let mut blocks: Vec<&LoudBlock> = blocks.iter().filter(is_knock).collect();
        // Probabilities that underflow are equal; the higher level is then the better located one.
        blocks.sort_by(|a, b| a.p_value.total_cmp(&b.p_value).then(b.ratio.total_cmp(&a.ratio)));
        let mut knocks: Vec<Knock> = Vec::new();
        for block in blocks {
            let slots = slots_of(block);
            let reach = 2 * (slots.end - slots.start);
            let is_near = |other: &Knock| {
                slots.start < other.slots.end + reach && other.slots.start < slots.end.saturating_add(reach)
            };
            // Blocks near a louder one are tested in the next round.
            if !knocks.iter().any(is_near) {
                knocks.push(knock_around(block, &scales[block.scale], 2.0 * block.p_value * tests as f64));
            }
        }
        knocks
    }

    /// Loud blocks of one averaging time and size from `from` on with p-values, and the number tested.
    fn loud_blocks(
        &self,
        (scale, Blocks { size, freedoms, .. }): (usize, &Blocks),
        differences: &SquaredDifferences,
        from: usize,
        period_s: f64,
    ) -> (Vec<LoudBlock>, usize) {
        let (mut loud, mut tested) = (Vec::new(), 0);
        let levels = differences.levels(*size, from);
        for doublings in doublings(differences, *size, period_s) {
            let longer = levels.doubled(doublings);
            let Some(&freedom) = freedoms.get(doublings as usize).or(freedoms.last()) else { continue };
            let size = size << doublings;
            let neighbourhood = Neighbourhood::new(&longer);
            let least = ratio_by_chance(SIGNIFICANCE, freedom.block, freedom.neighbours);
            for (position, (at, level)) in longer.known.iter().enumerate() {
                let Some(quiet) = neighbourhood.level(position, freedom.block) else { continue };
                tested += 1;
                let quiet = quiet.max(self.floor);
                let ratio = level / quiet;
                if ratio > 1.0 && ratio.is_finite() {
                    // Skips the costly tail where the result is not needed.
                    let p_value =
                        if ratio < least { 1.0 } else { exceedance(ratio, freedom.block, freedom.neighbours) };
                    let differences = from + at * size..from + (at + 1) * size;
                    loud.push(LoudBlock { scale, differences, quiet, ratio, freedom, p_value });
                }
            }
        }
        (loud, tested)
    }

    /// True if the smaller half of the squares is too large as well, unlike at jumps of the bias.
    fn is_loud_throughout(&self, block: &LoudBlock, differences: &SquaredDifferences) -> bool {
        let size = block.differences.len();
        let (at, from) = (block.differences.start / size, block.differences.start % size);
        let first = at.saturating_sub(NEIGHBOURS + 1);
        let blocks = first..(at + NEIGHBOURS + 2).min((differences.len() - from) / size);
        let levels = differences.half_levels(size, from, blocks);
        let freedom = HALF_EFFICIENCY * block.freedom.block;
        let Some(position) = levels.positions(&(at..at + 1)).next() else { return false };
        let Some(quiet) = Neighbourhood::new(&levels).level(position, freedom) else { return false };
        let level = levels.known[position].1;
        let others = HALF_EFFICIENCY * block.freedom.neighbours;
        exceedance(level / quiet.max(self.floor), freedom, others) < SIGNIFICANCE_THROUGHOUT
    }

    /// For each of these stretches of sample periods, whether a wandering level explains its loudness.
    pub(crate) fn move_by_themselves(&self, series: &Series, stretches: &[Range<u64>]) -> Vec<bool> {
        let mut loudest = vec![(0.0, 0.0); stretches.len()];
        let scales = if stretches.is_empty() { &[] } else { &self.scales[..] };
        for Scale { n, blocks: [Blocks { size, freedoms, .. }, _], .. } in scales {
            let differences = SquaredDifferences::new(series, *n);
            let levels = differences.levels(*size, 0);
            let of_length = |doublings: usize| {
                let longer = levels.doubled(doublings as u32);
                (Neighbourhood::new(&longer), longer)
            };
            let of_lengths: Vec<(Neighbourhood, BlockLevels)> = (0..freedoms.len()).map(of_length).collect();
            for (slots, loudest) in stretches.iter().zip(&mut loudest) {
                let own = differences.number(slots.start)..differences.number(slots.end);
                let doublings = (own.len() / size).checked_ilog2().unwrap_or(0) as usize;
                let Some(doublings) = freedoms.len().checked_sub(1).map(|last| last.min(doublings)) else { continue };
                let ((neighbourhood, levels), freedom) = (&of_lengths[doublings], freedoms[doublings]);
                let size = size << doublings;
                let ratio =
                    |at: usize| Some(levels.known[at].1 / neighbourhood.level(at, freedom.block)?.max(self.floor));
                let positions = levels.positions(&(own.start / size..own.end.div_ceil(size)));
                let ratio = positions.filter_map(ratio).fold(0.0, f64::max);
                if ratio >= loudest.0 {
                    let chance = freedom.wandering.map_or(0.0, |of| of.exceedance(ratio) * levels.count as f64);
                    *loudest = (ratio, chance);
                }
            }
        }
        loudest.into_iter().map(|(_, chance)| chance >= SIGNIFICANCE).collect()
    }

    pub(super) fn at_known_time(&self, series: &Series, known: &Knock) -> Option<Knock> {
        let tests = self.scales.len() as f64;
        let of_scale = |scale: &Scale| {
            // Blocks of the known length, up to one beyond SIDE of them on either side.
            let reach = (SIDE as u64 + 2) * (known.slots.end - known.slots.start + 2 * scale.n as u64);
            let around = known.slots.start.saturating_sub(reach)..known.slots.end.saturating_add(reach);
            let differences = SquaredDifferences::within(series, scale.n, &around);
            let from = differences.number(known.slots.start);
            let length = differences.number(known.slots.end).checked_sub(from + 1)?;
            if length < FEWEST_DIFFERENCES {
                return None;
            }
            let level = differences.trimmed_level(from..from + length)?;
            let [few, more] = &scale.blocks;
            let of_length = if more.size <= length && !more.freedoms.is_empty() { more } else { few };
            let freedom = of_length.freedoms.first()?.block * length as f64 / of_length.size as f64;
            let beside = (2..2 + SIDE).flat_map(|distance| [-distance, distance]).filter_map(|distance| {
                let start = from as i64 + distance * length as i64;
                let start = usize::try_from(start).ok()?;
                differences.trimmed_level(start..start + length)
            });
            let mut beside: Vec<f64> = beside.collect();
            let others = beside.len() as f64 * freedom / std::f64::consts::FRAC_PI_2;
            if beside.len() < SIDE as usize {
                return None;
            }
            let ratio = level / median(&mut beside).max(self.floor);
            let p_value = tests * exceedance(ratio, freedom, others);
            (p_value < SIGNIFICANCE_AT_A_KNOWN_TIME).then(|| {
                let half = NORMAL_975 * (2.0 / freedom + 2.0 / others).sqrt();
                let bound = |half: f64| (ratio.ln() + half).exp().sqrt();
                Knock {
                    level: ratio.sqrt(),
                    level_bounds: (bound(-half), bound(half)),
                    n: scale.n,
                    p_value,
                    ..known.clone()
                }
            })
        };
        self.scales.iter().filter_map(of_scale).min_by(|a, b| a.p_value.total_cmp(&b.p_value))
    }
}

impl Scale {
    fn blocks_by(&self, moving: Moving) -> &[Blocks; 2] {
        self.moving.as_ref().filter(|_| moving == Moving::AnyLength).unwrap_or(&self.blocks)
    }
}

impl Blocks {
    /// Degrees of freedom of `levels`: `noise` in steady noise, at most `shorter`, less if they wander.
    fn fit(
        differences: &SquaredDifferences,
        (levels, mut moves): (&BlockLevels, bool),
        period_s: f64,
        (size, noise): (usize, f64),
        shorter: BlockFreedom,
    ) -> Self {
        let mut freedoms: Vec<BlockFreedom> = Vec::new();
        for doublings in doublings(differences, size, period_s) {
            let mut longer = levels.doubled(doublings);
            let of_noise = noise * f64::from(1_u32 << doublings);
            // Levels that wander at a short length do so at a longer one, which may have too few blocks to show it.
            let shorter = freedoms.last().map_or(shorter, |freedom| freedom.times(2.0));
            let scatter = LevelScatter::new(&longer);
            let by_scatter = scatter.as_ref().map_or(f64::INFINITY, LevelScatter::freedom);
            let block = of_noise.min(shorter.block).min(by_scatter);
            let neighbours = Neighbourhood::new(&longer).freedom(block).min(shorter.neighbours);
            let wandering = scatter.and_then(|of| of.wandering(of_noise, moves || shorter.wandering.is_some()));
            if wandering.is_some() && !moves {
                remove_loudest(&mut longer.known);
                moves = LevelScatter::new(&longer).is_some_and(|rest| rest.wandering(of_noise, false).is_some());
            }
            freedoms.push(BlockFreedom { block, neighbours, wandering: wandering.or(shorter.wandering) });
        }
        Self { size, freedoms, moves }
    }
}

/// Removes the levels of the loudest stretch, as long as all knocks of a channel may be together.
fn remove_loudest(levels: &mut Vec<(usize, f64)>) {
    let length = ((LARGEST_SHARE * levels.len() as f64).ceil() as usize).max(1);
    let mut sums = vec![0.0];
    levels.iter().for_each(|(_, level)| sums.push(sums[sums.len() - 1] + level));
    let sum = |from: &usize| sums[from + length] - sums[*from];
    let loudest = (0..(levels.len() + 1).saturating_sub(length)).max_by(|a, b| sum(a).total_cmp(&sum(b)));
    if let Some(from) = loudest {
        levels.drain(from..from + length);
    }
}

impl BlockFreedom {
    /// Upper bound for blocks `longer` times the length.
    fn times(self, longer: f64) -> Self {
        Self { block: longer * self.block, neighbours: longer * self.neighbours, ..self }
    }
}

/// Sample periods of the samples within knocks, in ascending order.
pub(crate) fn slots_within(series: &Series, knocks: &[Knock]) -> Vec<u64> {
    let position = |end: u64| series.slots.partition_point(|slot| *slot < end);
    let of_knock = |knock: &Knock| &series.slots[position(knock.slots.start)..position(knock.slots.end)];
    let mut slots: Vec<u64> = knocks.iter().flat_map(of_knock).copied().collect();
    slots.sort_unstable();
    slots.dedup();
    slots
}

/// Adds a knock, or merges it with those at less distance than the length of the shorter.
pub(super) fn join(knocks: &mut Vec<Knock>, mut knock: Knock) {
    while let Some(near) = knocks.iter().position(|other| other.is_near(&knock)) {
        // The first one found is louder and keeps its level.
        knock = knocks.remove(near).extended_by(&knock);
    }
    knocks.push(knock);
}

/// The likeliest stretch of a raised level around a block, tried at the root of the block's ratio.
fn knock_around(block: &LoudBlock, differences: &SquaredDifferences, p_value: f64) -> Knock {
    let quiet = block.quiet / TRIMMED_MEAN;
    let length = block.differences.len();
    let window =
        block.differences.start.saturating_sub(4 * length)..(block.differences.end + 4 * length).min(differences.len());
    let squares = differences.squares(window.clone());
    let levels = [quiet, block.ratio.sqrt() * quiet];
    let change = ChangeOfLevel::new(&squares, levels, block.ratio * quiet, block.freedom.block / length as f64);
    let middle = (block.differences.start + block.differences.end) / 2 - window.start;
    let [start_low, start, start_high] = change.place(0..middle + 1);
    let [end_low, end, end_high] = change.place_of_return(middle + 1..change.len());
    let certain = if end_low > start_high + FEWEST_DIFFERENCES { start_high..end_low } else { start..end };
    let inside = squares[certain].iter().filter(|square| square.is_finite());
    let (sum, count) = inside.fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
    let ratio = sum / f64::max(count, 1.0) / quiet;
    let freedom = block.freedom.block * count / length as f64;
    let half = NORMAL_975 * (2.0 / freedom + 2.0 / block.freedom.neighbours).sqrt();
    // A difference spans its average and the next one, so the first loud one begins one average early.
    let n = differences.n as u64;
    let at = |number: usize| differences.slots(window.start + number..window.start + number).start;
    let from = BoundedSlot { value: at(start) + n, low: at(start_low), high: at(start_high) + 2 * n };
    let to = BoundedSlot { value: at(end), low: at(end_low).saturating_sub(n), high: at(end_high) + n };
    Knock {
        slots: from.low..to.high,
        from,
        to,
        level: ratio.sqrt(),
        level_bounds: ((ratio.ln() - half).exp().sqrt(), (ratio.ln() + half).exp().sqrt()),
        n: differences.n,
        p_value,
    }
}

impl From<Disturbance> for Knock {
    fn from(of: Disturbance) -> Self {
        let bounded = |value: u64, low: u64, high: u64| BoundedSlot { value, low, high };
        // Half interval of a mean square with `count` degrees of freedom.
        let half = NORMAL_975 * (0.5 / of.count as f64).sqrt();
        Self {
            from: bounded(of.certain.start, of.slots.start, of.certain.start),
            to: bounded(of.certain.end, of.certain.end, of.slots.end),
            slots: of.slots,
            level: of.level,
            level_bounds: (of.level * (-half).exp(), of.level * half.exp()),
            n: 1,
            p_value: of.p_value,
        }
    }
}

impl Knock {
    /// Adds disturbances to a channel's knocks, up to [`LARGEST_SHARE`], in the order of time.
    pub(crate) fn add_disturbances(knocks: &mut Vec<Self>, disturbances: Vec<Disturbance>, samples: usize) {
        let mut with = knocks.clone();
        disturbances.into_iter().for_each(|disturbance| join(&mut with, disturbance.into()));
        let share: u64 = with.iter().map(|knock| knock.slots.end - knock.slots.start).sum();
        if share as f64 <= LARGEST_SHARE * samples as f64 {
            *knocks = with;
        }
        knocks.sort_by_key(|knock| knock.slots.start);
    }

    /// True if the gap is less than the length of the shorter.
    fn is_near(&self, other: &Self) -> bool {
        let length = |knock: &Self| knock.slots.end - knock.slots.start;
        let reach = length(self).min(length(other));
        self.slots.start <= other.slots.end.saturating_add(reach)
            && other.slots.start <= self.slots.end.saturating_add(reach)
    }

    fn extended_by(mut self, other: &Self) -> Self {
        if other.slots.start < self.slots.start {
            (self.slots.start, self.from) = (other.slots.start, other.from);
        }
        if other.slots.end > self.slots.end {
            (self.slots.end, self.to) = (other.slots.end, other.to);
        }
        self
    }

    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        self.slots.start < other.slots.end && other.slots.start < self.slots.end
    }

    /// The reported knock; `channels` names all channels that show it, this one included.
    pub(crate) fn interval(&self, period_s: f64, channels: &[&'static str]) -> NoisyInterval {
        let time = |slot: u64| slot as f64 * period_s;
        let bounded = |of: BoundedSlot| BoundedEstimate::new(time(of.value), time(of.low), time(of.high));
        let (low, high) = self.level_bounds;
        NoisyInterval {
            from_s: bounded(self.from),
            to_s: bounded(self.to),
            level: BoundedEstimate::new(self.level, low, high),
            tau_s: self.n as f64 * period_s,
            p_value: self.p_value,
            channels: channels.to_vec(),
        }
    }
}
