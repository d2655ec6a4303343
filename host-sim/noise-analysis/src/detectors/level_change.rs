//! A level of the noise that changes once: the logarithms of the levels of some sixty blocks scatter around one mean before a time and
//! around another one after it.

use super::noise_levels::{DIFFERENCES, SquaredDifferences, TRIMMED_MEAN, exceedance, longer_levels};
use super::telegraph_models::{gauss_markov_log_likelihood, independent_log_likelihood};
use crate::bounds::BoundedEstimate;
use crate::distributions::{NORMAL_975, student_tail};
use crate::effects::LevelChange;
use crate::effects::findings::{REFUTED, SIGNIFICANCE};
use crate::samples::series::Series;

/// Blocks of a record, at least.
const LEAST_BLOCKS: usize = 64;
/// Blocks on either side of the change, at least: what is shorter is a knock, or the rest of one.
const LEAST_ON_A_SIDE: usize = 4;
/// Least part of the changes of the level that one change explains: a level that goes up and down all the time has no time at which it
/// changes.
const LEAST_EXPLAINED: f64 = 0.5;
/// Least change of the deviation that is told, as a part of it; as of a level that follows the temperature.
const LEAST_CHANGE: f64 = 0.05;
/// How many times as likely the change has to be as a level that rises or falls evenly, and as one that wanders, as that of a vibration does: a
/// probability of 95 % where two of these are as frequent.
const TOLD_APART: f64 = 19.0;
/// The time of the change is where the ln likelihood has fallen by half of the 95 % quantile of χ² with one degree of freedom.
const LIKELIHOOD_LOSS: f64 = 1.92;
/// Square of a difference, over the larger level, above which it counts as this: a single sample says nothing of a level.
const LARGEST_SQUARE: f64 = 9.0;

/// Blocks with their logarithmic levels, in two groups or along a line.
struct Levels {
    /// Number of the block, and logarithm of the mean square of its differences.
    of_blocks: Vec<(f64, f64)>,
}

/// The best time between two levels.
struct TwoLevels {
    /// Blocks before the change.
    before: usize,
    /// Sum of the squares of what the means of either side leave.
    squares: f64,
}

/// The change of the level of a series; `None` where there is none, or more than one.
pub(crate) fn find(series: &Series) -> Option<LevelChange> {
    let differences = SquaredDifferences::new(series, 1);
    let all = differences.levels(DIFFERENCES, 0);
    let doublings = (all.len() / LEAST_BLOCKS).checked_ilog2()?;
    let levels = Levels::new(&longer_levels(&all, doublings))?;
    let count = levels.of_blocks.len() as f64;
    let two = levels.two()?;
    let (around_mean, around_line) = levels.squares_of_mean_and_line();
    let explained = 1.0 - two.squares / around_mean;
    // Two means and a time, against the slope and the mean of a line: one parameter more.
    let over_line = 0.5 * (count * (around_line / two.squares).ln() - count.ln());
    // Their parameters are as many: a mean, a variance, a ratio of variances and a time.
    let over_wandering = independent_log_likelihood(count, two.squares) - levels.wandering_log_likelihood();
    let gain = over_line.min(over_wandering);
    let sides = levels.without_change(&two).map(Side::of);
    let [before, after] = sides.each_ref().map(|side| side.mean);
    let half = 0.5 * (after - before);
    let variance = two.squares / (count - 3.0).max(1.0);
    let error = 0.5 * (variance * (sides[0].count.recip() + sides[1].count.recip())).sqrt();
    // Any of the blocks may be the first one after the change.
    let p_value = (2.0 * count * student_tail(half.abs() / error, (count - 3.0).max(1.0))).min(1.0);
    let is_shown = explained > LEAST_EXPLAINED && p_value < SIGNIFICANCE && gain > TOLD_APART.ln();
    // A level that is higher and lower on one side alone is constant on none.
    if !is_shown || !Side::scatter_alike(&sides) || half.abs() < LEAST_CHANGE.ln_1p() {
        return None;
    }
    let size = DIFFERENCES << doublings;
    let first_after = levels.of_blocks[two.before].0 as usize * size;
    let [low, value, high] = change_between(&differences, first_after, size, [before, after].map(f64::exp));
    // The difference over the change has a part of each level, and counts as one of the louder.
    let value = value + usize::from(half > 0.0);
    let time = |number: usize| differences.slots(number..number).start as f64 * series.period_s;
    let ratio = |half: f64| half.exp();
    Some(LevelChange {
        time_s: BoundedEstimate::new(time(value), time(low), time(high + 1)),
        ratio: BoundedEstimate::new(ratio(half), ratio(half - NORMAL_975 * error), ratio(half + NORMAL_975 * error)),
        explained,
        p_value,
    })
}

/// The levels on one side of the change.
struct Side {
    count: f64,
    mean: f64,
    variance: f64,
}

impl Side {
    fn of(levels: &[(f64, f64)]) -> Self {
        let count = levels.len() as f64;
        let mean = levels.iter().map(|(_, level)| level).sum::<f64>() / count;
        let squares: f64 = levels.iter().map(|(_, level)| (level - mean).powi(2)).sum();
        Self { count, mean, variance: squares / (count - 1.0) }
    }

    /// Whether chance makes the variances differ as much, by Fisher's F distribution.
    fn scatter_alike([one, other]: &[Self; 2]) -> bool {
        let (more, less) = if one.variance > other.variance { (one, other) } else { (other, one) };
        2.0 * exceedance(more.variance / less.variance, more.count - 1.0, less.count - 1.0) >= REFUTED
    }
}

impl Levels {
    /// `None` where fewer than half of the blocks have a level.
    fn new(levels: &[Option<f64>]) -> Option<Self> {
        let known = levels.iter().enumerate().filter_map(|(at, level)| level.map(|level| (at as f64, level.ln())));
        let of_blocks: Vec<(f64, f64)> = known.filter(|(_, level)| level.is_finite()).collect();
        (2 * of_blocks.len() >= levels.len() && of_blocks.len() >= LEAST_BLOCKS / 2).then_some(Self { of_blocks })
    }

    /// The two groups of neighbouring blocks that scatter least around their means.
    fn two(&self) -> Option<TwoLevels> {
        let levels = self.of_blocks.iter().map(|(_, level)| *level);
        let count = self.of_blocks.len();
        let (sum, squares) = levels.clone().fold((0.0, 0.0), |(sum, squares), of| (sum + of, squares + of * of));
        let mut first = 0.0;
        let groups = levels.enumerate().map(|(at, level)| {
            first += level;
            let (before, after) = ((at + 1) as f64, (count - at - 1) as f64);
            let of_means = first.powi(2) / before + (sum - first).powi(2) / after;
            TwoLevels { before: at + 1, squares: squares - of_means }
        });
        let is_long = |of: &TwoLevels| of.before.min(count - of.before) >= LEAST_ON_A_SIDE;
        groups.take(count - 1).filter(is_long).min_by(|a, b| a.squares.total_cmp(&b.squares))
    }

    /// The highest ln likelihood of levels that are a Gaussian process with exponential autocorrelation, beside independent scatter.
    fn wandering_log_likelihood(&self) -> f64 {
        let mean = self.of_blocks.iter().map(|(_, level)| level).sum::<f64>() / self.of_blocks.len() as f64;
        let first = self.of_blocks.first().map_or(0, |(number, _)| *number as usize);
        let last = self.of_blocks.last().map_or(0, |(number, _)| *number as usize);
        let mut around_mean = vec![f64::NAN; last + 1 - first];
        self.of_blocks.iter().for_each(|(number, level)| around_mean[*number as usize - first] = level - mean);
        gauss_markov_log_likelihood(&around_mean)
    }

    /// The blocks on either side without the two next to the change, one of which has a part of each level.
    fn without_change(&self, two: &TwoLevels) -> [&[(f64, f64)]; 2] {
        let (before, after) = self.of_blocks.split_at(two.before);
        [&before[..before.len() - 1], &after[1..]]
    }

    /// Sums of the squares of what the mean, and what a straight line leaves.
    fn squares_of_mean_and_line(&self) -> (f64, f64) {
        let count = self.of_blocks.len() as f64;
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| self.of_blocks.iter().map(of).sum::<f64>() / count;
        let (time, level) = (mean(&|of| of.0), mean(&|of| of.1));
        let (xx, xy) = (mean(&|of| (of.0 - time).powi(2)), mean(&|of| (of.0 - time) * (of.1 - level)));
        let yy = mean(&|of| (of.1 - level).powi(2));
        (count * yy, count * (yy - xy * xy / xx))
    }
}

/// Numbers of the first difference with the later of two `levels`, the likeliest one between its 95 % bounds, near the block of so many
/// that begins at `around`.
fn change_between(differences: &SquaredDifferences, around: usize, block: usize, levels: [f64; 2]) -> [usize; 3] {
    let levels = levels.map(|level| level / TRIMMED_MEAN);
    let window = around.saturating_sub(2 * block)..(around + 2 * block).min(differences.len());
    let largest = LARGEST_SQUARE * levels[0].max(levels[1]);
    // Neighbouring differences of white noise share a sample: their squares have the correlation 1/4 and count as two thirds.
    let gain = |square: f64| {
        if !square.is_finite() {
            return 0.0;
        }
        let square = square.min(largest);
        0.5 * (2.0 / 3.0) * (square / levels[1] - square / levels[0] + (levels[1] / levels[0]).ln())
    };
    // The ln likelihood that the change is behind so many differences of the window.
    let mut sums = vec![0.0];
    for square in differences.squares(window.clone()) {
        sums.push(sums[sums.len() - 1] + gain(square));
    }
    let likeliest = (0..sums.len()).max_by(|a, b| sums[*a].total_cmp(&sums[*b])).unwrap_or(0);
    let possible = || (0..sums.len()).filter(|&at| sums[at] > sums[likeliest] - LIKELIHOOD_LOSS);
    let low = possible().next().unwrap_or(likeliest);
    [low, likeliest, possible().next_back().unwrap_or(likeliest)].map(|at| window.start + at)
}

#[cfg(test)]
mod tests {
    use super::find;
    use crate::samples::series::Series;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const SAMPLES: usize = 40_000;

    /// By the part of the record that has passed.
    type Level = fn(f64) -> f64;

    fn noise(seed: u64, level: impl Fn(f64) -> f64) -> Series {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let slots = 0..SAMPLES as u64;
        let value = |at: usize| level(at as f64 / SAMPLES as f64) * random.sample::<f64, _>(StandardNormal);
        let values = (0..SAMPLES).map(value).collect();
        Series { slots: slots.clone().collect(), values, span: slots, period_s: 0.01, resolution: 1e-6, unit: "deg/s" }
    }

    /// At 0.3 of 400 s. Of 20 recordings 19 intervals hold, at three standard deviations less 16.
    #[test]
    fn the_time_and_the_ratio_of_a_change_are_within_their_bounds() {
        for ratio in [1.2, 1.5, 4.0, 0.25] {
            let mut held = [0, 0];
            for seed in 0..20 {
                let found = find(&noise(seed, |time| if time < 0.3 { 1.0 } else { ratio })).expect("a change");
                let holds = [(found.ratio, ratio), (found.time_s, 120.0)];
                for (held, (of, truth)) in held.iter_mut().zip(holds) {
                    *held += usize::from((of.low..=of.high).contains(&truth));
                }
                assert!((found.ratio.value / ratio - 1.0).abs() < 0.05, "{found:?}");
            }
            assert!(held[0] >= 16 && held[1] >= 16, "{held:?} of 20 at {ratio}");
        }
    }

    /// The logarithm of the level is a Markov process of a hundredth to a tenth of the record: by two levels alone, without one that wanders beside
    /// them, 83 of 500 would have a change at a tenth.
    #[test]
    fn a_level_that_wanders_seldom_changes_once() {
        for part in [0.01, 0.03, 0.1] {
            let found = (0..500).filter(|&seed| {
                let mut random = ChaCha8Rng::seed_from_u64(1_000 + seed);
                let kept = (-1.0 / (part * SAMPLES as f64)).exp();
                let mut level = 0.3 * random.sample::<f64, _>(StandardNormal);
                let next = |_| {
                    level = kept * level + 0.3 * (1.0 - kept * kept).sqrt() * random.sample::<f64, _>(StandardNormal);
                    level.exp()
                };
                let levels: Vec<f64> = (0..SAMPLES).map(next).collect();
                find(&noise(seed, |time| levels[(time * SAMPLES as f64).round() as usize])).is_some()
            });
            let found = found.count();
            assert!(found <= 2, "{found} of 500, {part}");
        }
    }

    /// A level that is constant, rises evenly, is higher for a while, or goes up and down.
    #[test]
    fn other_courses_of_the_level_are_no_change() {
        for seed in 0..20 {
            let courses: [(&str, Level); 4] = [
                ("constant", |_| 1.0),
                ("rising", |time| 1.0 + time),
                ("higher for a while", |time| if (0.4..0.6).contains(&time) { 3.0 } else { 1.0 }),
                ("up and down", |time| 1.0 + 0.3 * (std::f64::consts::TAU * 3.0 * time).sin()),
            ];
            for (what, level) in courses {
                assert_eq!(find(&noise(seed, level)), None, "{what}, seed {seed}");
            }
        }
    }
}
