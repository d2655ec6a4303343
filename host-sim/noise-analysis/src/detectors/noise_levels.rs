//! Noise level of a channel over time: mean squares of second differences over blocks, at several averaging times.
//!
//! Levels of neighbouring blocks are compared by Fisher's F distribution, with no more degrees of freedom than the
//! scatter of the levels allows.

use crate::distributions::{quantile, student_tail};
use crate::effects::findings::REFUTED;
use crate::minimum::end_of;
use crate::robust::median;
use crate::samples::series::Series;
use statrs::function::beta::checked_beta_reg;
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

/// Squares of the differences of neighbouring averages over `n` samples; one for each average but the last.
pub(super) struct SquaredDifferences {
    pub(super) n: usize,
    start: u64,
    /// `NaN` where an average has too few samples.
    differences: Vec<f64>,
}

impl SquaredDifferences {
    pub(super) fn new(series: &Series, n: usize) -> Self {
        let start = series.span.start;
        let shift = n.trailing_zeros();
        let count = (series.span.end.saturating_sub(start) >> shift) as usize;
        let (mut sums, mut filled) = (vec![0.0; count], vec![0_u32; count]);
        for (&slot, &value) in series.slots.iter().zip(series.values.iter()) {
            let at = ((slot - start) >> shift) as usize;
            if at < count {
                sums[at] += value;
                filled[at] += 1;
            }
        }
        let difference = |at: usize| {
            let [a, b] = [f64::from(filled[at]), f64::from(filled[at + 1])];
            if a.min(b) < (LEAST_FILL * n as f64).max(1.0) {
                return f64::NAN;
            }
            let full = n as f64;
            if a == full && b == full {
                return sums[at + 1] / full - sums[at] / full;
            }
            // Normalised: white noise has the same variance in every difference, whatever is missing.
            (sums[at + 1] / b - sums[at] / a) / (0.5 * n as f64 * (1.0 / a + 1.0 / b)).sqrt()
        };
        Self { n, start, differences: (0..count.saturating_sub(1)).map(difference).collect() }
    }

    pub(super) fn len(&self) -> usize {
        self.differences.len()
    }

    pub(super) fn squares(&self, differences: Range<usize>) -> impl Iterator<Item = f64> + '_ {
        self.differences[differences].iter().map(|value| value * value)
    }

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

    pub(super) fn half_level(&self, differences: Range<usize>) -> Option<f64> {
        self.level_without(0.5, differences, &mut Vec::new())
    }

    fn level_without(&self, left_out: f64, differences: Range<usize>, present: &mut Vec<f64>) -> Option<f64> {
        let all = differences.len();
        let within = self.differences.get(differences)?.iter().map(|value| value * value);
        present.clear();
        present.extend(within.filter(|square| square.is_finite()));
        if present.is_empty() || 2 * present.len() < all {
            return None;
        }
        let kept = (present.len() as f64 * (1.0 - left_out)).ceil() as usize;
        if kept < present.len() {
            present.select_nth_unstable_by(kept, f64::total_cmp);
        }
        Some(present[..kept].iter().sum::<f64>() / kept as f64)
    }

    pub(super) fn levels(&self, size: usize, from: usize) -> Vec<Option<f64>> {
        let mut present = Vec::with_capacity(size);
        let starts = (from..(self.differences.len() + 1).saturating_sub(size)).step_by(size);
        starts.map(|start| self.level_without(TRIMMED, start..start + size, &mut present)).collect()
    }

    /// Degrees of freedom of blocks of [`FEW_DIFFERENCES`] and of [`DIFFERENCES`]: `m/(1 + 2 Σ (1 − k/m) ρ_k²)`.
    pub(super) fn freedoms(&self) -> [f64; 2] {
        let covariances = Covariances::new(&self.differences);
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
    values: Vec<f64>,
    /// 1 or 0 per difference; empty if none is missing.
    present: Vec<f64>,
}

impl Covariances {
    /// From all `differences`, or from [`STRETCHES`] of a long record, separated by missing values.
    fn new(differences: &[f64]) -> Self {
        if differences.len() > 2 * STRETCHES * STRETCH {
            let from = |stretch: usize| stretch * (differences.len() - STRETCH) / (STRETCHES - 1);
            let apart = [f64::NAN; DIFFERENCES];
            let parts = (0..STRETCHES).flat_map(|stretch| {
                differences[from(stretch)..from(stretch) + STRETCH].iter().chain(&apart).copied().collect::<Vec<f64>>()
            });
            return Self::of_all(&parts.collect::<Vec<f64>>());
        }
        Self::of_all(differences)
    }

    fn of_all(differences: &[f64]) -> Self {
        let is_missing = |value: &f64| !value.is_finite();
        let present = if differences.iter().any(is_missing) {
            differences.iter().map(|value| f64::from(u8::from(!is_missing(value)))).collect()
        } else {
            Vec::new()
        };
        let values = differences.iter().map(|value| if is_missing(value) { 0.0 } else { *value }).collect();
        Self { values, present }
    }

    fn at(&self, lag: usize) -> (f64, f64) {
        let later = |of: &'_ [f64]| lag.min(of.len());
        let count = if self.present.is_empty() {
            self.values.len().saturating_sub(lag) as f64
        } else {
            sum_of_products(&self.present, &self.present[later(&self.present)..])
        };
        (sum_of_products(&self.values, &self.values[later(&self.values)..]) / f64::max(count, 1.0), count)
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

pub(super) fn longer_levels(levels: &[Option<f64>], doublings: u32) -> Vec<Option<f64>> {
    let size = 1_usize << doublings;
    let mean = |chunk: &[Option<f64>]| {
        let (sum, count) = chunk.iter().flatten().fold((0.0, 0_usize), |(sum, count), level| (sum + level, count + 1));
        (2 * count > size || count == size).then(|| sum / count as f64)
    };
    levels.chunks_exact(size).map(mean).collect()
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

/// Medians of up to [`NEIGHBOURS`] blocks before and after each block, without the next one on either side.
pub(super) struct Neighbourhood {
    sides: Vec<[Option<f64>; 2]>,
}

impl Neighbourhood {
    pub(super) fn new(levels: &[Option<f64>]) -> Self {
        let known: Vec<f64> = levels.iter().copied().flatten().collect();
        let medians = running_medians(&known, NEIGHBOURS);
        let side = |known_of: Range<usize>| match known_of.len() {
            NEIGHBOURS => medians.get(known_of.start).copied(),
            FEWEST_NEIGHBOURS.. => Some(median(&mut known[known_of].to_vec())),
            _ => None,
        };
        let mut before = vec![0];
        for level in levels {
            before.push(before[before.len() - 1] + usize::from(level.is_some()));
        }
        let sides = |at: usize| {
            let (until, from) = (before[at.saturating_sub(1)], before[(at + 2).min(levels.len())]);
            [until.saturating_sub(NEIGHBOURS)..until, from..known.len().min(from + NEIGHBOURS)].map(side)
        };
        Self { sides: (0..levels.len()).map(sides).collect() }
    }

    /// Level of the neighbours of a block: that of the louder side, or at an end of the record the known one.
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

/// Scatter of the levels of one block length around those nearby.
pub(super) struct LevelScatter {
    /// Each level over the median around it, in ascending order.
    ratios: Vec<f64>,
}

impl LevelScatter {
    pub(super) fn new(levels: &[Option<f64>]) -> Option<Self> {
        let known: Vec<f64> = levels.iter().copied().flatten().collect();
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
    checked_beta_reg(0.5 * of_other, 0.5 * freedom, of_other / (of_other + freedom * ratio)).unwrap_or(1.0)
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
