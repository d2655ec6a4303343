//! Means of equal stretches of a record, and the likelihood of what they do against noise of any mixture of white,
//! flicker and random walk.

use super::Series;
use std::f64::consts::{LN_2, PI};

/// Stretches of a record.
pub(crate) const BLOCKS: usize = 128;
/// A block with fewer than this part of its samples is left out.
const FILLED: f64 = 0.25;
/// Fewest samples that a whole block holds.
const FEWEST: u64 = 16;

/// Variance of flicker noise (B²) and of a walk's step over a block, relative to the white variance of a block's mean.
const FLICKER: [f64; 4] = [0.0, 0.05, 0.5, 5.0];
const WALK: [f64; 6] = [0.0, 1e-4, 1e-3, 1e-2, 1e-1, 1.0];

/// Blocks of a record.
pub(crate) struct Blocks {
    /// Slots in a block.
    pub(crate) width: u64,
    /// The blocks that are filled, by number.
    pub(crate) numbers: Vec<usize>,
    /// Mean of each.
    pub(crate) means: Vec<f64>,
    /// Filled part of each.
    fills: Vec<f64>,
}

impl Blocks {
    /// `None` if the record is too short.
    pub(crate) fn of(series: &Series) -> Option<Self> {
        let width = (series.slots.last()? + 1) / BLOCKS as u64;
        if width < FEWEST {
            return None;
        }
        let (mut sums, mut counts) = (vec![0.0; BLOCKS], vec![0u64; BLOCKS]);
        for (&slot, value) in series.slots.iter().zip(&series.values) {
            // The few samples after the last whole block are left out.
            if let Some(sum) = sums.get_mut((slot / width) as usize) {
                *sum += value;
                counts[(slot / width) as usize] += 1;
            }
        }
        let fill = |number: usize| counts[number] as f64 / width as f64;
        let numbers: Vec<usize> = (0..BLOCKS).filter(|&number| fill(number) >= FILLED).collect();
        Some(Self {
            width,
            means: numbers.iter().map(|&number| sums[number] / counts[number] as f64).collect(),
            fills: numbers.iter().map(|&number| fill(number)).collect(),
            numbers,
        })
    }

    /// The part of each block that lies at or after `slot`.
    pub(crate) fn step_at(&self, slot: u64) -> Vec<f64> {
        let after = |&number: &usize| {
            let start = number as u64 * self.width;
            1.0 - (slot.saturating_sub(start)).min(self.width) as f64 / self.width as f64
        };
        self.numbers.iter().map(after).collect()
    }

    /// The noises that the record is judged by, each with its factored covariance.
    pub(crate) fn noises(&self) -> Vec<Whitening> {
        let mixtures = FLICKER.iter().flat_map(|&flicker| WALK.iter().map(move |&walk| (flicker, walk)));
        mixtures.filter_map(|(flicker, walk)| Whitening::of_noise(&self.numbers, &self.fills, flicker, walk)).collect()
    }
}

/// Covariance of the means of two blocks of flicker noise with B = 1, by their distance.
///
/// Flicker noise is a sum of Gauss-Markov processes an octave of correlation time apart, each of variance B²·ln 2/π. A
/// block is 1 here; processes much faster than a block only add to the white noise.
fn flicker_covariance() -> Vec<f64> {
    let mut covariance = vec![0.0; BLOCKS];
    let mut time = 0.125;
    while time <= 4.0 * BLOCKS as f64 {
        for (distance, entry) in covariance.iter_mut().enumerate() {
            let decay = |blocks: f64| (-blocks / time).exp();
            let mean = if distance == 0 {
                2.0 * time * (1.0 - time * (1.0 - decay(1.0)))
            } else {
                let distance = distance as f64;
                time * time * (decay(distance - 1.0) - 2.0 * decay(distance) + decay(distance + 1.0))
            };
            *entry += LN_2 / PI * mean;
        }
        time *= 2.0;
    }
    covariance
}

/// A covariance `L·Lᵀ` and its inverse at work.
pub(crate) struct Whitening {
    /// Rows of L up to the diagonal.
    rows: Vec<Vec<f64>>,
    log_determinant: f64,
    ones: Vec<f64>,
    /// Of the level, in noise of scale 1.
    level_information: f64,
}

impl Whitening {
    /// For blocks of these numbers and fills, in noise of white variance 1 for the mean of a whole block, of flicker with
    /// `flicker` = B², and of a walk that grows by the variance `walk` over a block.
    pub(crate) fn of_noise(numbers: &[usize], fills: &[f64], flicker: f64, walk: f64) -> Option<Self> {
        let flicker: Vec<f64> = flicker_covariance().iter().map(|covariance| flicker * covariance).collect();
        let entry = |row: usize, column: usize| {
            let (first, second) = (numbers[column], numbers[row]);
            // Means over a block of a walk from the beginning: the middle of the earlier one, a third into a shared one.
            let walked = if row == column { first as f64 + 1.0 / 3.0 } else { first as f64 + 0.5 };
            let white = if row == column { 1.0 / fills[row] } else { 0.0 };
            white + flicker[second - first] + walk * walked
        };
        Self::of(numbers.len(), entry)
    }

    fn of(size: usize, entry: impl Fn(usize, usize) -> f64) -> Option<Self> {
        let mut rows: Vec<Vec<f64>> = Vec::with_capacity(size);
        for row in 0..size {
            let mut line = Vec::with_capacity(row + 1);
            for column in 0..row {
                let above: &Vec<f64> = &rows[column];
                line.push((entry(row, column) - dot(&line, &above[..column])) / above[column]);
            }
            let rest = entry(row, row) - dot(&line, &line);
            if rest <= 0.0 {
                return None;
            }
            line.push(rest.sqrt());
            rows.push(line);
        }
        let log_determinant = 2.0 * rows.iter().enumerate().map(|(at, row)| row[at].ln()).sum::<f64>();
        let mut whitening = Self { rows, log_determinant, ones: Vec::new(), level_information: 1.0 };
        let ones = whitening.whitened(&vec![1.0; size]);
        let norm = dot(&ones, &ones).sqrt();
        whitening.level_information = norm * norm;
        whitening.ones = ones.iter().map(|value| value / norm).collect();
        Some(whitening)
    }

    fn whitened(&self, values: &[f64]) -> Vec<f64> {
        let mut solved = Vec::with_capacity(values.len());
        for (row, value) in self.rows.iter().zip(values) {
            let known = dot(&solved, &row[..solved.len()]);
            solved.push((value - known) / row[solved.len()]);
        }
        solved
    }

    /// White, and without the level that nobody knows.
    pub(crate) fn free(&self, values: &[f64]) -> Vec<f64> {
        without(self.whitened(values), &self.ones)
    }

    /// −2 ln of the highest likelihood of residuals with this sum of squares, the scale of the noise being free.
    pub(crate) fn deviance(&self, squares: f64) -> f64 {
        let count = self.rows.len() as f64;
        count * (squares / count).ln() + self.log_determinant
    }
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// What is left of `values` without its part along `direction`, which need not be of length 1.
pub(crate) fn without(mut values: Vec<f64>, direction: &[f64]) -> Vec<f64> {
    let norm = dot(direction, direction);
    if norm > 0.0 {
        let part = dot(&values, direction) / norm;
        values.iter_mut().zip(direction).for_each(|(value, along)| *value -= part * along);
    }
    values
}

/// Sum of squares of the whitened data less their part along `shapes`.
pub(crate) fn residual(noise: &Whitening, means: &[f64], shapes: &[Vec<f64>]) -> f64 {
    let mut rest = noise.free(means);
    let mut known: Vec<Vec<f64>> = Vec::with_capacity(shapes.len());
    for shape in shapes {
        // What is new in it.
        let shape = known.iter().fold(noise.free(shape), |rest, known| without(rest, known));
        rest = without(rest, &shape);
        known.push(shape);
    }
    dot(&rest, &rest)
}

/// Size of `shape` in the data beside `known` ones and its standard error, over all noises, each as likely as the data
/// make it: which of them it is nobody knows.
///
/// The likelihood is that of what the shapes leave (REML; D. Harville, "Maximum likelihood approaches to variance component
/// estimation", 1977): a ramp takes much of a walk away, and the walk would seem small.
pub(crate) fn size(noises: &[Whitening], means: &[f64], shape: &[f64], known: &[Vec<f64>]) -> (f64, f64) {
    let each: Vec<Fitted> = noises.iter().map(|noise| Fitted::of(noise, means, shape, known)).collect();
    let least = each.iter().map(|fitted| fitted.deviance).fold(f64::INFINITY, f64::min);
    let weight = |fitted: &Fitted| (0.5 * (least - fitted.deviance)).exp();
    let total: f64 = each.iter().map(weight).sum();
    let mean =
        |value: &dyn Fn(&Fitted) -> f64| each.iter().map(|fitted| weight(fitted) * value(fitted)).sum::<f64>() / total;
    let size = mean(&|fitted| fitted.size);
    (size, mean(&|fitted| fitted.error * fitted.error + (fitted.size - size).powi(2)).sqrt())
}

/// A shape in one noise.
struct Fitted {
    size: f64,
    error: f64,
    /// −2 ln of the restricted likelihood.
    deviance: f64,
}

impl Fitted {
    fn of(noise: &Whitening, means: &[f64], shape: &[f64], known: &[Vec<f64>]) -> Self {
        let mut taken: Vec<Vec<f64>> = Vec::with_capacity(known.len() + 1);
        for shape in known.iter().map(Vec::as_slice).chain([shape]) {
            // What is new in it.
            taken.push(taken.iter().fold(noise.free(shape), |rest, known| without(rest, known)));
        }
        let data = taken.iter().take(known.len()).fold(noise.free(means), |rest, known| without(rest, known));
        let shape = &taken[known.len()];
        let norm = dot(shape, shape);
        let size = dot(&data, shape) / norm;
        let rest = dot(&data, &data) - size * size * norm;
        // Free: the level, the shapes.
        let freedom = data.len() as f64 - 1.0 - taken.len() as f64;
        let information: f64 = taken.iter().map(|shape| dot(shape, shape).ln()).sum();
        let deviance =
            freedom * (rest / freedom).ln() + noise.log_determinant + noise.level_information.ln() + information;
        Self { size, error: (rest / freedom / norm).sqrt(), deviance }
    }
}
