//! Telegraph noise: a level that jumps to and fro between two values at random times.
//!
//! Its Allan variance and its spectrum are those of a Markov process, and over a few correlation times those of a random
//! walk. What tells them apart is the likelihood of a hidden chain of two states (L. Baum et al., "A maximization
//! technique occurring in the statistical analysis of probabilistic functions of Markov chains", 1970) against that of a
//! Gaussian process of any size and correlation time.

mod chain;
mod gaussian;

use crate::distributions::NORMAL_975;
use crate::findings::{Effect, Finding, Parameter};
use crate::grid::Grid;
use chain::Chain;

/// Means of so many equal parts of the record are taken, the fewest first: long correlation times show in few.
const PARTS: [usize; 3] = [256, 1024, 4096];
/// Parts of a correlation time that is known.
const RESOLVED: f64 = 20.0;
/// By how much the two levels must be likelier, in ln likelihood: e⁻¹² is the highest probability of as much by chance.
const CONVINCING: f64 = 12.0;
/// Fewest jumps: one or two are steps.
const JUMPS: f64 = 6.0;
/// Fewest parts between two jumps, on average.
const APART: f64 = 4.0;
/// A level is held for at least this part of the record.
const HELD: f64 = 0.05;
/// Largest variance around the levels: so many times that of white noise, and this part of the square of their distance,
/// by which slow noise moves them. Of a clipped wave it is some ten times as much.
const AROUND: f64 = 1.5;
const MOVED: f64 = 0.01;
/// Step of the logarithm of a parameter at which the likelihood's curvature is taken.
const NUDGE: f64 = 0.05;

/// Looks for two levels in a channel in `unit`. `correlated_s` are correlation times, s, that its Allan curve has shown.
#[must_use]
pub fn find(grid: &Grid, unit: &str, correlated_s: &[f64]) -> Option<Finding> {
    let samples = grid.values().len();
    let known = correlated_s.iter().map(|time| ((time / RESOLVED / grid.sample_period()) as usize).max(1));
    let coarse = PARTS.iter().map(|parts| samples / parts).filter(|&size| size > 0);
    let mut sizes: Vec<usize> = coarse.chain(known).collect();
    sizes.sort_unstable();
    sizes.dedup();
    let mut found = None;
    for size in sizes.into_iter().rev() {
        let Some((chain, gain)) = told(&Parts::of(grid, size)) else { continue };
        let part_s = size as f64 * grid.sample_period();
        let resolved = chain.correlation_time() > RESOLVED;
        found = Some(finding(&chain, gain, part_s, unit));
        if resolved {
            break;
        }
    }
    found
}

/// Means of parts of a record, less that of all; `NaN` where half of the samples are missing.
struct Parts {
    means: Vec<f64>,
    /// Of white noise in a mean.
    white: f64,
}

impl Parts {
    fn of(grid: &Grid, size: usize) -> Self {
        let level = grid.mean();
        let mean = |values: &[f64]| {
            let (sum, count) = values
                .iter()
                .filter(|value| value.is_finite())
                .fold((0.0, 0_usize), |(sum, count), value| (sum + value - level, count + 1));
            if 2 * count > values.len() { sum / count as f64 } else { f64::NAN }
        };
        let means: Vec<f64> = grid.values().chunks_exact(size).map(mean).collect();
        // Of halves of a part, or of neighbours: a jump between them is rare.
        let apart: Vec<f64> = if size > 1 {
            let halves = grid.values().chunks_exact(size).map(|part| part.split_at(size / 2));
            halves.map(|(a, b)| 0.5 * (mean(a) - mean(b))).collect()
        } else {
            means.windows(2).map(|pair| (pair[1] - pair[0]) / 2f64.sqrt()).collect()
        };
        Self { means, white: square_of_typical(apart) }
    }
}

/// Variance of a normal number with the median size of these.
fn square_of_typical(values: Vec<f64>) -> f64 {
    /// Median of the size of a standard normal number.
    const MEDIAN: f64 = 0.674_489_75;
    let mut sizes: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).map(f64::abs).collect();
    let middle = sizes.len() / 2;
    if sizes.is_empty() {
        return 0.0;
    }
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    (*median / MEDIAN).powi(2)
}

/// The chain, and by how much it is likelier than any Gaussian process, if it is beyond doubt.
fn told(parts: &Parts) -> Option<(Chain, f64)> {
    let chain = Chain::fit(&parts.means)?;
    let around = square_of_typical(chain.residuals(&parts.means));
    let jumps_often = chain.jumps >= JUMPS && chain.correlation_time() > APART;
    let highest = AROUND * parts.white + MOVED * chain.apart().powi(2);
    if !jumps_often || chain.held().iter().any(|&held| held < HELD) || around > highest {
        return None;
    }
    let gain = chain.log_likelihood - gaussian::log_likelihood(&parts.means);
    (gain > CONVINCING).then_some((chain.with_errors(&parts.means), gain))
}

fn finding(chain: &Chain, gain: f64, part_s: f64, unit: &str) -> Finding {
    let bounded = |value: f64, error: f64, unit: &str| {
        let factor = (NORMAL_975 * error).exp();
        Parameter::new(value, value / factor, value * factor, unit)
    };
    let steps = chain.correlation_time();
    let time = part_s * steps;
    // One part in 2·steps holds a jump and is a quarter of the distance off its level on average, at either level.
    let blurred = 0.25 / steps;
    let apart = chain.apart() / (1.0 - blurred);
    let error_of_apart = chain.error_of_apart.hypot(0.5 * blurred);
    let evidence = format!(
        "two levels {:.3e} {unit} apart with {:.0} jumps between them, e^{gain:.0} times as likely as a Gaussian process of \
         any correlation time; charges that are caught and let go in a transistor or a crystal",
        apart, chain.jumps,
    );
    Finding {
        effect: Effect::new(
            "telegraph",
            [
                ("time_constant", bounded(time, chain.error_of_time, "s")),
                ("amplitude", bounded(apart, error_of_apart, unit)),
            ],
            evidence,
        ),
        repair: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use std::f64::consts::TAU;

    const SAMPLES: usize = 40_000;
    const PERIOD_S: f64 = 0.01;

    /// White noise of deviation 1 with what `next` adds.
    fn grid(seed: u64, mut next: impl FnMut(&mut ChaCha8Rng, usize) -> f64) -> Grid {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let value = |at| next(&mut random, at) + random.sample::<f64, _>(StandardNormal);
        Grid::new(PERIOD_S, (0..SAMPLES).map(value).collect())
    }

    /// Levels `amplitude` apart, correlated over `time_s`.
    fn telegraph(amplitude: f64, time_s: f64) -> impl FnMut(&mut ChaCha8Rng, usize) -> f64 {
        let mut up = false;
        move |random, _| {
            up ^= random.random_bool(0.5 * PERIOD_S / time_s);
            if up { amplitude } else { 0.0 }
        }
    }

    #[test]
    fn two_levels_are_found_with_their_distance_and_pace() {
        let (mut covered, mut all) = (0, 0);
        for (seed, (amplitude, time_s)) in [(1.0, 4.0), (0.7, 8.0), (50.0, 5.0), (1.5, 1.0)].into_iter().enumerate() {
            let mut grid = grid(seed as u64, telegraph(amplitude, time_s));
            if seed == 1 {
                let values = grid.values().iter().enumerate();
                let gap = |(at, value): (usize, &f64)| if (5_000..9_000).contains(&at) { f64::NAN } else { *value };
                grid = Grid::new(PERIOD_S, values.map(gap).collect());
            }
            let finding = find(&grid, "g", &[]).unwrap_or_else(|| panic!("{amplitude} {time_s}"));
            for (name, truth) in [("amplitude", amplitude), ("time_constant", time_s)] {
                let parameter = &finding.effect.parameters[name];
                assert!((parameter.value / truth).ln().abs() < 0.5, "{name} {truth}: {parameter:?}");
                covered += usize::from((parameter.low..=parameter.high).contains(&truth));
                all += 1;
            }
        }
        // 95 % each: two misses of eight are one in twenty.
        assert!(covered >= all - 2, "{covered} of {all}");
    }

    #[test]
    fn short_correlation_times_are_found_where_the_curve_shows_them() {
        let grid = grid(20, telegraph(3.0, 0.1));
        let finding = find(&grid, "g", &[0.1]).unwrap();
        assert!((finding.effect.parameters["time_constant"].value / 0.1 - 1.0).abs() < 0.2, "{finding:?}");
    }

    #[test]
    fn what_jumps_once_waves_or_wanders_has_no_two_levels() {
        let step = grid(30, |_, at| if at < 15_000 { 0.0 } else { 1.0 });
        let wave = grid(31, |_, at| (TAU * at as f64 * PERIOD_S / 20.0).sin());
        let mut level = 0.0;
        let walk = grid(32, move |random, _| {
            level += 0.02 * random.sample::<f64, _>(StandardNormal);
            level
        });
        let mut state = 0.0;
        let kept = (-PERIOD_S / 4.0f64).exp();
        let markov = grid(33, move |random, _| {
            state = kept * state + (1.0 - kept * kept).sqrt() * random.sample::<f64, _>(StandardNormal);
            state
        });
        for grid in [step, wave, walk, markov, grid(34, |_, _| 0.0)] {
            assert_eq!(find(&grid, "g", &[1.0, 4.0]), None);
        }
        assert_eq!(find(&Grid::new(PERIOD_S, vec![1.0; 10]), "g", &[]), None);
        assert_eq!(find(&Grid::new(PERIOD_S, vec![1.0; 10_000]), "g", &[]), None);
    }
}
