//! Processes with an exponential autocovariance: Gauss-Markov, and what has its Allan variance and is not Gaussian or not of one channel.

use super::evidence::CurveEvidence;
use super::kind::{AddedVariance, AveragingTime, Kind, NamedParameter, Occurrence, named};
use crate::bounds::{BoundedEstimate, ChannelEstimate};
use serde::Serialize;

/// Exponentially correlated noise: a first-order Gauss-Markov process.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MarkovProcess {
    #[serde(skip)]
    pub deviation: ChannelEstimate,
    #[serde(skip)]
    pub time_constant_s: BoundedEstimate,
    pub evidence: MarkovEvidence,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MarkovEvidence {
    Curve(CurveEvidence),
    /// The spectrum, which is flat below a corner where a random walk would rise. The gain is in ln likelihood.
    Spectrum {
        corner_hz: f64,
        gain: f64,
    },
}

impl MarkovProcess {
    /// Averaging time of the largest Allan deviation, in time constants (IEEE Std 952, annex C).
    pub(crate) const PEAK: f64 = 1.89;
}

impl Kind for MarkovProcess {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![
            named("deviation", self.deviation.parameter()).size().lasting(),
            named("time_constant", self.time_constant_s.parameter("s")).lasting(),
        ]
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        at.of_markov(self.time_constant_s.value, self.deviation.value)
    }
}

/// Random telegraph noise: jumps to and fro between two levels at random times.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TelegraphNoise {
    /// Time constant of the autocorrelation, s: half of the mean time between two jumps, where the levels are as frequent.
    #[serde(skip)]
    pub time_constant_s: BoundedEstimate,
    /// Distance of the levels.
    #[serde(skip)]
    pub amplitude: ChannelEstimate,
    pub evidence: TelegraphEvidence,
}

/// Evidence of random telegraph noise against a Gaussian process of the same spectrum.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TelegraphEvidence {
    /// The excess kurtosis behind the term of the curve: its ratio to that of two equally frequent levels, and the error of that.
    Kurtosis { ratio: f64, error: f64, curve: CurveEvidence },
    /// The levels in the samples: the number of jumps, and the gain in ln likelihood over a Gaussian process of any correlation time.
    Levels { jumps: f64, gain: f64 },
}

impl Kind for TelegraphNoise {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![
            named("time_constant", self.time_constant_s.parameter("s")).lasting(),
            named("amplitude", self.amplitude.parameter()).size().lasting(),
        ]
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        // Two levels that are equally frequent are two standard deviations apart.
        at.of_markov(self.time_constant_s.value, 0.5 * self.amplitude.value)
    }
}

/// Shot noise: disturbances of one direction that begin at once and decay, at random times.
///
/// Disturbances at the rate λ (a Poisson process) with sizes A that decay as `exp(−t/T)` have the autocovariance
/// `λ·E[A²]·T/2·exp(−|τ|/T)` (Campbell's theorem; S. Rice, "Mathematical analysis of random noise", Bell Syst. Tech. J. 23, 1944, section
/// 1.5), that of a first-order Markov process.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ShotNoise {
    /// Rate of disturbances of one size that make up the same, 1/h.
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
    pub p_value: f64,
}

impl Kind for ShotNoise {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![
            named("rate", self.rate_per_hour.parameter("1/h")).lasting(),
            named("size", self.size.parameter()).size().lasting(),
            named("time_constant", self.time_constant_s.parameter("s")).lasting(),
            named("deviation", self.deviation.parameter()).size().lasting(),
        ]
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        at.of_markov(self.time_constant_s.value, self.deviation.value)
    }
}

/// Slow drift that channels have in common, without a measured cause.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CommonMode {
    #[serde(skip)]
    pub deviation: ChannelEstimate,
    #[serde(skip)]
    pub time_constant_s: BoundedEstimate,
    pub others: Vec<&'static str>,
    /// Gain in ln likelihood over channels with nothing in common.
    pub gain: f64,
}

impl Kind for CommonMode {
    fn parameters(&self) -> Vec<NamedParameter> {
        vec![
            named("deviation", self.deviation.parameter()).size().lasting(),
            named("time_constant", self.time_constant_s.parameter("s")).lasting(),
        ]
    }

    fn occurrence(&self) -> Occurrence {
        Occurrence::OnceAUnit
    }

    fn avar(&self, at: &AveragingTime) -> AddedVariance {
        at.of_markov(self.time_constant_s.value, self.deviation.value)
    }
}

#[cfg(test)]
mod tests {
    use super::ShotNoise;
    use crate::bounds::BoundedEstimate;
    use crate::effects::kind::tests::assert_avar;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Disturbances of 3 units, one a second on average, that decay with 0.5 s.
    #[test]
    fn the_variance_of_shot_noise_is_that_of_its_samples() {
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
        let mut samples = vec![];
        for at in 0..SAMPLES {
            level *= kept;
            let time_s = at as f64 * PERIOD_S;
            while next_s <= time_s {
                level += SIZE * (-(time_s - next_s) / TIME_CONSTANT_S).exp();
                next_s -= (1.0 - random.random::<f64>()).ln();
            }
            samples.push(level);
        }
        // 40,000 disturbances, or 1,560 independent differences at the longest averaging time: √(2/1,560) is 3.6 %.
        assert_avar(&shot_noise, &samples, PERIOD_S, &[1, 4, 16, 64, 256], 3.0 * 0.036);
    }
}
