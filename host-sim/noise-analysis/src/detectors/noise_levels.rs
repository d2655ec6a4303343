//! Noise level of a channel over time: mean squares of second differences over blocks, at several averaging times.
//!
//! Levels of neighbouring blocks are compared by Fisher's F distribution, with no more degrees of freedom than the
//! scatter of the levels allows.

use crate::distributions::{mean_ratio_tail, quantile, student_tail};
use crate::effects::findings::REFUTED;
use crate::minimum::end_of;
use crate::robust::median;
use crate::samples::series::Series;
use std::ops::Range;

/// Errors above this many standard deviations are left out of the estimated deviation; 7·10⁻⁶ of normal ones.
pub(super) const CLIP: f64 = 4.5;
pub(super) const DIFFERENCES: usize = 64;
/// Differences of a still shorter block, for knocks that ring a few periods.
pub(super) const FEW_DIFFERENCES: usize = 20;
/// Longest averaging time of the differences, s; slower changes are motion or drift.
const LONGEST_AVERAGE_S: f64 = 0.5;
/// Longest block, s; disturbances last seconds to minutes.
const LONGEST_BLOCK_S: f64 = 128.0;
/// Part of a block's largest squares that its level leaves out, against jumps and spikes.
const TRIMMED: f64 = 0.1;
/// Mean square of standard normal numbers without the largest tenth: P(χ²₃ < q)/0.9 with P(χ²₁ < q) = 0.9.
pub(super) const TRIMMED_MEAN: f64 = 0.6231;
/// Degrees of freedom without the larger half over those without the largest tenth: 0.0330/0.5²/0.1427² = 6.49.
pub(super) const HALF_EFFICIENCY: f64 = 2.56 / 6.49;
/// Relative variance of the mean of all squares over that of the trimmed mean (0.806/0.9²/0.6231² over 2).
const EFFICIENCY: f64 = 1.0 / 1.282;
/// Most blocks compared on either side beyond the next one, and the least number.
pub(super) const NEIGHBOURS: usize = 12;
const FEWEST_NEIGHBOURS: usize = 6;
/// Variance of the median of normal numbers over that of their mean: π/2.
const MEDIAN_LOSS: f64 = std::f64::consts::FRAC_PI_2;
const LEAST_FILL: f64 = 0.9;
/// Fewest blocks whose scatter bounds the degrees of freedom.
const FEWEST_FOR_SCATTER: usize = 24;
/// Stretches of a long record, and differences in each: 65,536 products determine a correlation to 0.004.
const STRETCHES: usize = 64;
const STRETCH: usize = 1024;
/// Degrees of freedom of a level that is taken as exact.
const MOST_FREEDOM: f64 = 1e6;
/// Relative standard deviation times √n of a scatter by the 90 % quantile's distance from the median.
const SCATTER_ERROR: f64 = 1.37;
const RATIO_STEPS: usize = 20;
const NORMAL_90: f64 = 1.2816;

/// Averaging factors, samples: powers of two.
pub(super) fn averaging_factors(period_s: f64) -> impl Iterator<Item = usize> {
    (0..).map(|octave| 1_usize << octave).take_while(move |&n| n == 1 || n as f64 * period_s <= LONGEST_AVERAGE_S)
}

/// Differences of neighbouring averages over `n` samples, numbered by the first average. It has those alone of which both averages
/// have enough samples, so that its memory does not grow with a gap.
pub(super) struct SquaredDifferences {
    pub(super) n: usize,
    start: u64,
    /// Number of differences of the series, with those that are missing.
    count: usize,
    differences: Vec<f64>,
    /// Number and position of the first difference after each gap.
    runs: Vec<(usize, usize)>,
}

impl SquaredDifferences {
    pub(super) fn new(series: &Series, n: usize) -> Self {
        Self::within(series, n, &series.span)
    }

    /// Those of the averages that lie in `slots`.
    pub(super) fn within(series: &Series, n: usize, slots: &Range<u64>) -> Self {
        let start = series.span.start;
        let shift = n.trailing_zeros();
        let averages = (series.span.end.saturating_sub(start) >> shift) as usize;
        let [first, end] = [slots.start, slots.end].map(|end| series.slots.partition_point(|slot| *slot < end));
        #[cfg(test)]
        tests::count(end - first);
        let mut all = Self {
            n,
            start,
            count: averages.saturating_sub(1),
            differences: Vec::with_capacity((end - first) >> shift),
            runs: Vec::new(),
        };
        let number_of = |slot: &u64| ((slot - start) >> shift) as usize;
        let (full, mut last, mut position) = (n as f64, None::<(usize, f64, f64)>, first);
        for slots in series.slots[first..end].chunk_by(|one, other| number_of(one) == number_of(other)) {
            let (number, filled) = (number_of(&slots[0]), slots.len() as f64);
            let sum = series.values[position..position + slots.len()].iter().sum::<f64>();
            position += slots.len();
            if number == averages || filled < (LEAST_FILL * full).max(1.0) {
                continue;
            }
            if let Some((before, last_sum, last_filled)) = last
                && before + 1 == number
            {
                let difference = sum / filled - last_sum / last_filled;
                // Normalised: white noise has the same variance in every difference, whatever is missing.
                let excess = 0.5 * full * (1.0 / last_filled + 1.0 / filled);
                all.push(before, if excess == 1.0 { difference } else { difference / excess.sqrt() });
            }
            last = Some((number, sum, filled));
        }
        all
    }

    fn push(&mut self, number: usize, difference: f64) {
        let follows = |&(first, position): &(usize, usize)| first + self.differences.len() - position == number;
        if !self.runs.last().is_some_and(follows) {
            self.runs.push((number, self.differences.len()));
        }
        self.differences.push(difference);
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// Position of the first difference with this number or a later one.
    fn position(&self, number: usize) -> usize {
        let later = self.runs.partition_point(|(first, _)| *first <= number);
        let end = self.runs.get(later).map_or(self.differences.len(), |(_, position)| *position);
        later.checked_sub(1).map_or(0, |run| (self.runs[run].1 + number - self.runs[run].0).min(end))
    }

    fn number_at(&self, position: usize) -> usize {
        let (first, from) = self.runs[self.runs.partition_point(|(_, from)| *from <= position) - 1];
        first + position - from
    }

    /// The square of each of these differences; `NaN` of a missing one.
    pub(super) fn squares(&self, differences: Range<usize>) -> Vec<f64> {
        let mut squares = vec![f64::NAN; differences.len()];
        for position in self.position(differences.start)..self.position(differences.end) {
            squares[self.number_at(position) - differences.start] = self.differences[position].powi(2);
        }
        squares
    }

    /// Number of the first difference that begins in this sample period or later.
    pub(super) fn number(&self, slot: u64) -> usize {
        (slot.saturating_sub(self.start)).div_ceil(self.n as u64) as usize
    }

    pub(super) fn slots(&self, differences: Range<usize>) -> Range<u64> {
        let at = |number: usize| self.start + number as u64 * self.n as u64;
        at(differences.start)..at(differences.end + 1)
    }

    /// Mean of the squares without the largest tenth; `None` if half of them are missing.
    pub(super) fn trimmed_level(&self, differences: Range<usize>) -> Option<f64> {
        self.level_without(TRIMMED, differences, &mut Vec::new())
    }

    fn level_without(&self, left_out: f64, differences: Range<usize>, squares: &mut Vec<f64>) -> Option<f64> {
        let present = self.position(differences.start)..self.position(differences.end);
        if differences.end > self.count || present.is_empty() || 2 * present.len() < differences.len() {
            return None;
        }
        squares.clear();
        squares.extend(self.differences[present].iter().map(|difference| difference * difference));
        let kept = (squares.len() as f64 * (1.0 - left_out)).ceil() as usize;
        if kept < squares.len() {
            squares.select_nth_unstable_by(kept, f64::total_cmp);
        }
        Some(squares[..kept].iter().sum::<f64>() / kept as f64)
    }

    /// Levels of the blocks of `size` differences from the difference `from` on.
    pub(super) fn levels(&self, size: usize, from: usize) -> BlockLevels {
        let count = self.count.saturating_sub(from) / size;
        self.levels_without(TRIMMED, size, from, 0..count)
    }

    /// The same, of the smaller half of the squares, of these blocks alone.
    pub(super) fn half_levels(&self, size: usize, from: usize, blocks: Range<usize>) -> BlockLevels {
        self.levels_without(0.5, size, from, blocks)
    }

    fn levels_without(&self, left_out: f64, size: usize, from: usize, blocks: Range<usize>) -> BlockLevels {
        let start = |block: usize| from + block * size;
        let (mut known, mut squares) = (Vec::new(), Vec::with_capacity(size));
        let (mut position, end) = (self.position(start(blocks.start)), self.position(start(blocks.end)));
        while position < end {
            let block = (self.number_at(position) - from) / size;
            known.extend(
                self.level_without(left_out, start(block)..start(block + 1), &mut squares).map(|level| (block, level)),
            );
            position = self.position(start(block + 1));
        }
        BlockLevels { count: blocks.end, known }
    }

    /// Degrees of freedom of blocks of [`FEW_DIFFERENCES`] and of [`DIFFERENCES`]: `m/(1 + 2 Σ (1 − k/m) ρ_k²)`.
    pub(super) fn freedoms(&self) -> [f64; 2] {
        let covariances = Covariances::new(self);
        let variance = covariances.at(0).0;
        let square = |lag: usize| {
            let (covariance, count) = covariances.at(lag);
            // The square of an estimated correlation is too large by about 1/count.
            ((covariance / variance).powi(2) - f64::max(count, 1.0).recip()).max(0.0)
        };
        let squares: Vec<f64> = (1..DIFFERENCES).map(|lag| if variance > 0.0 { square(lag) } else { 0.0 }).collect();
        [FEW_DIFFERENCES, DIFFERENCES].map(|size| {
            let m = size as f64;
            let weighted = |(lag, square): (usize, &f64)| (1.0 - (lag + 1) as f64 / m) * square;
            EFFICIENCY * m / (1.0 + 2.0 * squares[..size - 1].iter().enumerate().map(weighted).sum::<f64>())
        })
    }
}

/// Mean products of differences at a lag.
struct Covariances {
    /// 0 where a difference is missing.
    values: Vec<f64>,
    /// 1 or 0 per difference.
    present: Vec<f64>,
}

impl Covariances {
    /// From all `differences`, or [`STRETCHES`] of a long record; a gap or a stretch's end is as long as the longest lag at most.
    fn new(differences: &SquaredDifferences) -> Self {
        let of = &differences.differences;
        let (stretches, length) = if of.len() > 2 * STRETCHES * STRETCH { (STRETCHES, STRETCH) } else { (1, of.len()) };
        let (mut values, mut present, mut next) = (Vec::new(), Vec::new(), None);
        for stretch in 0..stretches {
            let from = stretch * (of.len() - length) / (stretches - 1).max(1);
            for (position, difference) in of.iter().enumerate().skip(from).take(length) {
                let number = differences.number_at(position);
                let missing = next.map_or(0, |next: usize| number.abs_diff(next).min(DIFFERENCES));
                values.extend(std::iter::repeat_n(0.0, missing).chain([*difference]));
                present.extend(std::iter::repeat_n(0.0, missing).chain([1.0]));
                next = Some(number + 1);
            }
        }
        Self { values, present }
    }

    fn at(&self, lag: usize) -> (f64, f64) {
        let of_lag = |of: &[f64]| sum_of_products(of, &of[lag.min(of.len())..]);
        let count = of_lag(&self.present);
        (of_lag(&self.values) / f64::max(count, 1.0), count)
    }
}

/// Sum of products up to the end of the shorter slice, in eight sums for SIMD.
fn sum_of_products(a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 8;
    let length = a.len().min(b.len());
    let ((a, a_rest), (b, b_rest)) = (a[..length].as_chunks::<LANES>(), b[..length].as_chunks::<LANES>());
    let mut sums = [0.0; LANES];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}

pub(super) struct BlockLevels {
    /// Number of blocks, with those that have no level.
    pub(super) count: usize,
    /// Number and level of each block that has enough differences, in ascending order.
    pub(super) known: Vec<(usize, f64)>,
}

impl BlockLevels {
    /// The levels of blocks of so many times twice the length, of most of which the level is known.
    pub(super) fn doubled(&self, doublings: u32) -> Self {
        let size = 1_usize << doublings;
        let count = self.count >> doublings;
        let blocks = self.known.chunk_by(|one, other| one.0 >> doublings == other.0 >> doublings);
        let mean = |blocks: &[(usize, f64)]| {
            let number = blocks[0].0 >> doublings;
            let is_known = number < count && (2 * blocks.len() > size || blocks.len() == size);
            is_known.then(|| (number, blocks.iter().map(|(_, level)| level).sum::<f64>() / blocks.len() as f64))
        };
        Self { count, known: blocks.filter_map(mean).collect() }
    }

    pub(super) fn levels(&self) -> Vec<f64> {
        self.known.iter().map(|(_, level)| *level).collect()
    }

    /// Positions in `known` of these blocks.
    pub(super) fn positions(&self, blocks: &Range<usize>) -> Range<usize> {
        let position = |block: usize| self.known.partition_point(|(number, _)| *number < block);
        position(blocks.start)..position(blocks.end)
    }
}

/// Doublings of `size` differences at which a record is examined, as long as a block has neighbours.
pub(super) fn doublings(differences: &SquaredDifferences, size: usize, period_s: f64) -> impl Iterator<Item = u32> {
    let shortest_s = (size * differences.n) as f64 * period_s;
    let blocks = differences.len() / size;
    let is_examined = move |doublings: &u32| {
        let doubled = 1_usize << doublings;
        let is_short = if size < DIFFERENCES {
            size * doubled < DIFFERENCES
        } else {
            doubled as f64 * shortest_s <= LONGEST_BLOCK_S
        };
        blocks / doubled >= 2 * FEWEST_NEIGHBOURS + 3 && (*doublings == 0 || is_short)
    };
    (0..24).take_while(is_examined)
}

/// Medians of up to [`NEIGHBOURS`] known levels before and after that of each block, without those of the next block on either side.
pub(super) struct Neighbourhood {
    sides: Vec<[Option<f64>; 2]>,
}

impl Neighbourhood {
    pub(super) fn new(levels: &BlockLevels) -> Self {
        let (blocks, known) = (&levels.known, levels.levels());
        let medians = running_medians(&known, NEIGHBOURS);
        let side = |side: Range<usize>| match side.len() {
            NEIGHBOURS => medians.get(side.start).copied(),
            FEWEST_NEIGHBOURS.. => Some(median(&mut known[side].to_vec())),
            _ => None,
        };
        let sides = |at: usize| {
            let is_next = |other: usize| blocks.get(other).is_some_and(|of| of.0.abs_diff(blocks[at].0) == 1);
            let until = at - usize::from(at > 0 && is_next(at - 1));
            let from = at + 1 + usize::from(is_next(at + 1));
            [until.saturating_sub(NEIGHBOURS)..until, from..known.len().min(from + NEIGHBOURS)].map(side)
        };
        Self { sides: (0..known.len()).map(sides).collect() }
    }

    /// Level of the neighbours of the block at a position: that of the louder side, or at an end of the record the known one.
    pub(super) fn level(&self, at: usize, freedom: f64) -> Option<f64> {
        let level = self.sides[at].into_iter().flatten().max_by(f64::total_cmp)?;
        // Median of χ²/ν by Wilson and Hilferty.
        Some(level / (1.0 - 2.0 / (9.0 * freedom)).max(0.3).powi(3))
    }

    /// Degrees of freedom of that level: of a median of blocks, and no more than the medians of both sides allow.
    pub(super) fn freedom(&self, freedom: f64) -> f64 {
        let independent = freedom * NEIGHBOURS as f64 / MEDIAN_LOSS;
        let change = |sides: &[Option<f64>; 2]| match *sides {
            [Some(before), Some(after)] => Some((after / before).ln()).filter(|change| change.is_finite()),
            _ => None,
        };
        let Some(changes) = sorted(self.sides.iter().filter_map(change).collect()) else { return independent };
        let deviation = (quantile_of(&changes, 0.9) - quantile_of(&changes, 0.1)) / (2.0 * NORMAL_90);
        // ln of a mean square of ν degrees of freedom has the variance 2/ν; two sides.
        independent.min(4.0 / (deviation * deviation))
    }
}

fn running_medians(values: &[f64], width: usize) -> Vec<f64> {
    let mut window: Vec<f64> = Vec::with_capacity(width);
    let mut medians = Vec::with_capacity(values.len());
    for (at, &value) in values.iter().enumerate() {
        let place = |window: &[f64], value: f64| window.partition_point(|other| other.total_cmp(&value).is_lt());
        if window.len() == width {
            window.remove(place(&window, values[at - width]));
        }
        window.insert(place(&window, value), value);
        if window.len() == width {
            medians.push(window[width / 2]);
        }
    }
    medians
}

pub(super) struct LevelScatter {
    /// Each level over the median around it, in ascending order.
    ratios: Vec<f64>,
}

impl LevelScatter {
    pub(super) fn new(levels: &BlockLevels) -> Option<Self> {
        let known = levels.levels();
        let medians = running_medians(&known, (2 * NEIGHBOURS + 1).min(known.len()));
        let around = |at: usize| medians[at.saturating_sub(NEIGHBOURS).min(medians.len() - 1)];
        let ratio = |(at, level): (usize, &f64)| level / around(at);
        let is_measured = |ratio: &f64| *ratio > 0.0 && ratio.is_finite();
        let ratios = sorted(known.iter().enumerate().map(ratio).filter(is_measured).collect())?;
        Some(Self { ratios })
    }

    /// Standard deviation of ln ratio by the 90 % quantile, which a tenth of disturbed blocks does not move.
    fn deviation(&self) -> f64 {
        (quantile_of(&self.ratios, 0.9) / quantile_of(&self.ratios, 0.5)).ln() / NORMAL_90
    }

    pub(super) fn freedom(&self) -> f64 {
        2.0 / self.deviation().powi(2)
    }

    /// Wandering beyond noise of `freedom` degrees of freedom; `None` without it, unless `known` from shorter blocks.
    pub(super) fn wandering(&self, freedom: f64, known: bool) -> Option<Wandering> {
        let most = 1.0 + quantile(REFUTED) * SCATTER_ERROR / (self.ratios.len() as f64).sqrt();
        if !known && self.deviation() < most * (2.0 / freedom).sqrt() {
            return None;
        }
        let lowest = quantile_of(&self.ratios, 0.1);
        let excess = |part: f64| (quantile_of(&self.ratios, part) - lowest).ln();
        let deviation = (excess(0.9) - excess(0.5)) / NORMAL_90;
        let freedom = 0.5 * self.ratios.len() as f64 / SCATTER_ERROR.powi(2);
        let median = excess(0.5);
        (deviation > 0.0 && deviation.is_finite()).then_some(Wandering { lowest, median, deviation, freedom })
    }
}

/// In ascending order; `None` if fewer than [`FEWEST_FOR_SCATTER`].
fn sorted(mut values: Vec<f64>) -> Option<Vec<f64>> {
    values.sort_by(f64::total_cmp);
    (values.len() >= FEWEST_FOR_SCATTER).then_some(values)
}

fn quantile_of(values: &[f64], part: f64) -> f64 {
    values[((values.len() - 1) as f64 * part).round() as usize]
}

/// A wandering level, as that of a vibration; log-normal above its lowest tenth, which is steady noise.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wandering {
    /// Level over those around it in the lowest tenth of the blocks.
    lowest: f64,
    /// Median and deviation of the logarithm of the excess.
    median: f64,
    deviation: f64,
    freedom: f64,
}

impl Wandering {
    /// Probability of at least `ratio` times the level around, by Student's distribution.
    pub(super) fn exceedance(&self, ratio: f64) -> f64 {
        let excess = (ratio - self.lowest).max(0.0).ln();
        student_tail((excess - self.median) / self.deviation, self.freedom)
    }
}

/// Upper tail of Fisher's F distribution, for a `ratio` of mean squares with these degrees of freedom.
pub(super) fn exceedance(ratio: f64, freedom: f64, of_other: f64) -> f64 {
    let (freedom, of_other) = (freedom.min(MOST_FREEDOM), of_other.min(MOST_FREEDOM));
    mean_ratio_tail(ratio, 0.5 * freedom, 0.5 * of_other)
}

/// The ratio whose [`exceedance`] is `p_value`, to 10⁻⁶.
pub(super) fn ratio_by_chance(p_value: f64, freedom: f64, of_other: f64) -> f64 {
    let exceeds = |ratio: f64| exceedance(ratio, freedom, of_other) > p_value;
    let (mut low, mut high) = (1.0, 2.0);
    while exceeds(high) && high < f64::MAX / 2.0 {
        (low, high) = (high, 2.0 * high);
    }
    end_of((low, high), RATIO_STEPS, exceeds)
}

/// Standard deviation of the non-zero `errors`, without those above [`CLIP`] deviations.
pub(super) fn clipped_deviation(errors: &[f64]) -> f64 {
    let mut limit = f64::INFINITY;
    let mut deviation = 0.0;
    for _ in 0..12 {
        let kept = errors.iter().filter(|error| **error != 0.0 && error.abs() <= limit);
        let (count, squares) = kept.fold((0u64, 0.0), |(count, sum), error| (count + 1, sum + error * error));
        deviation = (squares / count.max(1) as f64).sqrt();
        limit = CLIP * deviation;
    }
    deviation
}

#[cfg(test)]
pub(super) mod tests {
    use std::cell::Cell;

    thread_local! {
        static SAMPLES_READ: Cell<u64> = const { Cell::new(0) };
    }

    pub(super) fn count(samples: usize) {
        SAMPLES_READ.set(SAMPLES_READ.get() + samples as u64);
    }

    /// Samples of which this thread has taken differences.
    pub(in crate::detectors) fn samples_read() -> u64 {
        SAMPLES_READ.get()
    }
}
