//! Which power law rules where on a curve.

use crate::confidence::Shares;
use crate::math::coarse_log2;

/// A power law of the noise of a rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Noise {
    /// Angle quantization, σ² ∝ τ⁻².
    Quantization,
    /// Angle random walk, white rate noise, σ² ∝ τ⁻¹.
    White,
    /// Bias instability, flicker rate noise, σ² constant.
    Flicker,
    /// Rate random walk, σ² ∝ τ.
    RandomWalk,
}

impl Noise {
    const ALL: [Self; 4] = [Self::Quantization, Self::White, Self::Flicker, Self::RandomWalk];

    /// All of the variance due to this noise.
    #[must_use]
    pub const fn shares(self) -> Shares {
        match self {
            Self::Quantization => Shares::QUANTIZATION,
            Self::White => Shares::WHITE,
            Self::Flicker => Shares::FLICKER,
            Self::RandomWalk => Shares::RANDOM_WALK,
        }
    }

    /// Binary logarithm of its Allan variance at `n = 2^octave` samples, but for a constant.
    fn log2_avar(self, octave: f64) -> f64 {
        match self {
            Self::Quantization => -2.0 * octave,
            Self::White => -octave,
            Self::Flicker => 0.0,
            // A sampled walk has (2n² + 1)/(6n): at n = 1 half as much again as n/3, at n = 2 an eighth.
            Self::RandomWalk => octave + [0.585, 0.17, 0.04].get(octave as usize).copied().unwrap_or(0.0),
        }
    }
}

/// An octave of a curve, as far as the noise type needs it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Level {
    /// `log2 n`.
    pub(crate) octave: f64,
    pub(crate) variance: f64,
    /// Stretches of `n` samples that the differences covered: about the degrees of freedom of any noise.
    pub(crate) weight: f64,
}

/// Standard deviation of the slope `d log σ²/d log τ` that a window of octaves must reach: power laws are 1 apart,
/// so it leaves ½ three deviations away; less in truth, as neighbouring octaves are correlated.
const SLOPE_DEVIATION: f64 = 0.16;

/// The power law that explains the octaves around `at` best, by least squares of the logarithm.
///
/// The window starts with the neighbours of the octave and grows towards shorter times, which are better known, until
/// it can tell one power law from the next.
pub(crate) fn identify(levels: &[Level], at: usize) -> Noise {
    let last = (at + 1).min(levels.len() - 1);
    let mut first = at.saturating_sub(1);
    while first > 0 && slope_variance(&levels[first..=last]) > SLOPE_DEVIATION * SLOPE_DEVIATION {
        first -= 1;
    }
    let window = &levels[first..=last];
    let misfit = |noise: Noise| {
        let residual = |level: &Level| {
            let ratio = level.variance / window[0].variance;
            coarse_log2(ratio) - noise.log2_avar(level.octave)
        };
        let mean = weighted_mean(window, residual);
        weighted_mean(window, |level| (residual(level) - mean) * (residual(level) - mean))
    };
    let mut best = (Noise::White, misfit(Noise::White));
    for noise in Noise::ALL {
        let misfit = misfit(noise);
        if misfit < best.1 {
            best = (noise, misfit);
        }
    }
    best.0
}

fn weighted_mean(levels: &[Level], of: impl Fn(&Level) -> f64) -> f64 {
    let weight: f64 = levels.iter().map(|level| level.weight).sum();
    levels.iter().map(|level| level.weight * of(level)).sum::<f64>() / weight
}

/// Of the weighted least-squares line through the octaves, each with a variance of `2/weight` in the natural logarithm.
fn slope_variance(levels: &[Level]) -> f64 {
    let mean = weighted_mean(levels, |level| level.octave);
    let spread: f64 = levels.iter().map(|level| level.weight * (level.octave - mean) * (level.octave - mean)).sum();
    2.0 / (core::f64::consts::LN_2 * core::f64::consts::LN_2 * spread)
}
