//! The logarithms of the levels of blocks, and the change that fits them best.

use super::noise_levels::BlockLevels;
use super::telegraph_models::independent_log_likelihood;

/// Fewest blocks of a record.
pub(super) const LEAST_BLOCKS: usize = 64;
/// Fewest blocks on either side; a shorter stretch is a knock.
const LEAST_ON_A_SIDE: usize = 4;

pub(super) struct LogLevels {
    /// Number of each block, and logarithm of its mean square of differences.
    pub(super) of_blocks: Vec<(f64, f64)>,
}

pub(super) struct TwoLevels {
    /// Number of blocks before the change.
    pub(super) before: usize,
    /// Sum of the squares around the two means.
    pub(super) squares: f64,
}

impl TwoLevels {
    pub(super) fn log_likelihood(&self, count: f64) -> f64 {
        independent_log_likelihood(count, self.squares)
    }
}

impl LogLevels {
    /// `None` where too few are known.
    pub(super) fn new(levels: &BlockLevels) -> Option<Self> {
        let known = levels.known.iter().map(|(at, level)| (*at as f64, level.ln()));
        let of_blocks: Vec<(f64, f64)> = known.filter(|(_, level)| level.is_finite()).collect();
        (2 * of_blocks.len() >= levels.count && of_blocks.len() >= LEAST_BLOCKS / 2).then_some(Self { of_blocks })
    }

    /// The split with the least scatter around the two means.
    pub(super) fn two(&self) -> Option<TwoLevels> {
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

    /// From the first block of a known level to the last, less the mean of all; `NaN` where it is not known.
    pub(super) fn around_mean(&self) -> Vec<f64> {
        let mean = self.of_blocks.iter().map(|(_, level)| level).sum::<f64>() / self.of_blocks.len() as f64;
        let first = self.of_blocks.first().map_or(0, |(number, _)| *number as usize);
        let last = self.of_blocks.last().map_or(0, |(number, _)| *number as usize);
        let mut around_mean = vec![f64::NAN; last + 1 - first];
        self.of_blocks.iter().for_each(|(number, level)| around_mean[*number as usize - first] = level - mean);
        around_mean
    }

    pub(super) fn log_likelihood_of_change(&self) -> Option<f64> {
        Some(self.two()?.log_likelihood(self.of_blocks.len() as f64))
    }

    pub(super) fn without_change(&self, two: &TwoLevels) -> [&[(f64, f64)]; 2] {
        let (before, after) = self.of_blocks.split_at(two.before);
        [&before[..before.len() - 1], &after[1..]]
    }

    pub(super) fn squares_of_mean_and_line(&self) -> (f64, f64) {
        let count = self.of_blocks.len() as f64;
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| self.of_blocks.iter().map(of).sum::<f64>() / count;
        let (time, level) = (mean(&|of| of.0), mean(&|of| of.1));
        let (xx, xy) = (mean(&|of| (of.0 - time).powi(2)), mean(&|of| (of.0 - time) * (of.1 - level)));
        let yy = mean(&|of| (of.1 - level).powi(2));
        (count * yy, count * (yy - xy * xy / xx))
    }
}
