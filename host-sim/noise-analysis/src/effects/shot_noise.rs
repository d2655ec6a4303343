//! Shot noise: disturbances that begin at once and decay, at random times.
//!
//! Of disturbances at the rate λ (a Poisson process) with sizes A that decay as `exp(−t/T)` the autocovariance is
//! `λ·E[A²]·T/2·exp(−|τ|/T)` (Campbell's theorem; S. Rice, "Mathematical analysis of random noise", Bell Syst. Tech. J. 23, 1944, section
//! 1.5), that of a first-order Markov process. So is their Allan variance.

use super::kind::{AddedVariance, AveragingTime, Kind, Occurrence, no_course};
use crate::bounds::{BoundedEstimate, ChannelEstimate, Parameter};
use serde::Serialize;

/// Disturbances of one direction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ShotNoise {
    /// Of disturbances of one size that make up the same, 1/h.
    #[serde(skip)]
    pub rate_per_hour: BoundedEstimate,
    /// Their size, at the beginning of each; below 0 where they go downwards.
    #[serde(skip)]
    pub size: ChannelEstimate,
    /// Time in which each falls to 1/e of its size, s.
    #[serde(skip)]
    pub time_constant_s: BoundedEstimate,
    /// Standard deviation of the sum of all.
    #[serde(skip)]
    pub deviation: ChannelEstimate,
    /// Third moment behind a filter for such disturbances, in standard deviations of that of a Gaussian process.
    pub sum: f64,
    /// The same behind the filter in reversed time.
    pub reversed: f64,
    /// Probability by chance.
    pub p_value: f64,
}

impl Kind for ShotNoise {
    const NAME: &'static str = "shot_noise";

    fn parameters(&self) -> Vec<(&'static str, Parameter)> {
        vec![
            ("rate", self.rate_per_hour.parameter("1/h")),
            ("size", self.size.parameter()),
            ("time_constant", self.time_constant_s.parameter("s")),
            ("deviation", self.deviation.parameter()),
        ]
    }

    fn sizes(&self) -> Vec<BoundedEstimate> {
        vec![self.size.estimate(), self.deviation.estimate()]
    }

    fn lasting(&self) -> Vec<Option<BoundedEstimate>> {
        let sizes = [self.size, self.deviation].map(|of| Some(of.estimate()));
        [Some(self.rate_per_hour), Some(self.time_constant_s)].into_iter().chain(sizes).collect()
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::InChannel
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        at.of_markov(self.time_constant_s.value, self.deviation.value)
    }

    no_course!();
}

#[cfg(test)]
mod tests {
    use super::ShotNoise;
    use crate::bounds::BoundedEstimate;
    use crate::effects::{AveragingTime, Kind};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// The Allan variance of disturbances of 3 units, one a second on average, that decay with 0.5 s, by its definition.
    #[test]
    fn the_variance_is_that_of_its_samples() {
        const SAMPLES: usize = 800_000;
        const PERIOD_S: f64 = 0.05;
        const TIME_CONSTANT_S: f64 = 0.5;
        const SIZE: f64 = 3.0;
        let exact = BoundedEstimate::exact;
        let shot_noise = ShotNoise {
            rate_per_hour: exact(3600.0),
            size: exact(SIZE).in_unit("g"),
            time_constant_s: exact(TIME_CONSTANT_S),
            deviation: exact((0.5 * SIZE * SIZE * TIME_CONSTANT_S).sqrt()).in_unit("g"),
            sum: 9.0,
            reversed: 1.0,
            p_value: 1e-9,
        };
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let (mut level, mut next_s, kept) = (0.0, 0.0, (-PERIOD_S / TIME_CONSTANT_S).exp());
        let mut sums = vec![0.0];
        for at in 0..SAMPLES {
            level *= kept;
            let time_s = at as f64 * PERIOD_S;
            while next_s <= time_s {
                level += SIZE * (-(time_s - next_s) / TIME_CONSTANT_S).exp();
                next_s -= (1.0 - random.random::<f64>()).ln();
            }
            sums.push(sums[at] + level);
        }
        for n in [1_usize, 4, 16, 64, 256] {
            let differences = sums.windows(2 * n + 1).map(|of| (of[2 * n] - 2.0 * of[n] + of[0]) / n as f64);
            let count = (SAMPLES + 1 - 2 * n) as f64;
            let expected = 0.5 * differences.map(|of| of * of).sum::<f64>() / count;
            let (n, samples) = (n as u64, SAMPLES as u64);
            let at = AveragingTime { n, period_s: PERIOD_S, samples, model_avar: 0.0, adev_of: &|_, _| None };
            let found = shot_noise.avar(&at).modelled;
            // 40,000 disturbances, or 1,560 independent differences at the longest averaging time: √(2/1,560) is 3.6 %.
            assert!((found / expected - 1.0).abs() < 3.0 * 0.036, "{n}: {found} {expected}");
        }
    }
}
