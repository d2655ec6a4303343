//! Power-law noise types, and the classification of each point of a curve by its local slope.

use crate::math::coarse_log2;

/// A power-law noise of a rate signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum PowerLaw {
    /// Angle quantization, σ² ∝ τ⁻².
    Quantization,
    /// Angle random walk, white rate noise, σ² ∝ τ⁻¹.
    White,
    /// Bias instability, flicker rate noise, σ² constant.
    Flicker,
    /// Rate random walk, σ² ∝ τ.
    RandomWalk,
}

impl PowerLaw {
    const ALL: [Self; 4] = [Self::Quantization, Self::White, Self::Flicker, Self::RandomWalk];

    /// The whole variance attributed to this noise.
    #[must_use]
    pub const fn variance_fractions(self) -> VarianceFractions {
        match self {
            Self::Quantization => VarianceFractions::QUANTIZATION,
            Self::White => VarianceFractions::WHITE,
            Self::Flicker => VarianceFractions::FLICKER,
            Self::RandomWalk => VarianceFractions::RANDOM_WALK,
        }
    }

    /// Binary logarithm of its Allan variance at `n = 2^octave` samples, up to a constant.
    fn log2_avar(self, octave: f64) -> f64 {
        match self {
            Self::Quantization => -2.0 * octave,
            Self::White => -octave,
            Self::Flicker => 0.0,
            // A sampled walk has (2n² + 1)/(6n): 1.5 times n/3 at n = 1, 1.125 times at n = 2.
            Self::RandomWalk => octave + [0.585, 0.17, 0.04].get(octave as usize).copied().unwrap_or(0.0),
        }
    }
}

/// The fractions of a variance that are due to each power law; they sum to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VarianceFractions {
    /// Angle quantization, σ² ∝ τ⁻².
    pub quantization: f64,
    /// Angle random walk (white rate noise), σ² ∝ τ⁻¹.
    pub white: f64,
    /// Bias instability (flicker rate noise), σ² constant.
    pub flicker: f64,
    /// Rate random walk and steeper, σ² ∝ τ.
    pub random_walk: f64,
}

impl VarianceFractions {
    /// White rate noise alone.
    pub const WHITE: Self = Self { quantization: 0.0, white: 1.0, flicker: 0.0, random_walk: 0.0 };
    /// Flicker rate noise alone.
    pub const FLICKER: Self = Self { quantization: 0.0, white: 0.0, flicker: 1.0, random_walk: 0.0 };
    /// Random-walk rate noise alone.
    pub const RANDOM_WALK: Self = Self { quantization: 0.0, white: 0.0, flicker: 0.0, random_walk: 1.0 };
    /// Angle quantization alone.
    pub const QUANTIZATION: Self = Self { quantization: 1.0, white: 0.0, flicker: 0.0, random_walk: 0.0 };
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct OctaveVariance {
    /// `log2 n`.
    pub(crate) octave: f64,
    pub(crate) variance: f64,
    /// Number of stretches of `n` samples that the differences cover.
    pub(crate) weight: f64,
}

/// Standard deviation of the slope `d log σ²/d log τ` at which the window of octaves is long enough.
const SLOPE_DEVIATION: f64 = 0.16;

/// The power law with the smallest weighted squared residual in `log σ²` over the octaves around `at`.
///
/// The window grows from two neighbours towards shorter averaging times until the slope is known to
/// [`SLOPE_DEVIATION`].
pub(crate) fn classify(levels: &[OctaveVariance], at: usize) -> PowerLaw {
    let last = (at + 1).min(levels.len() - 1);
    let mut first = at.saturating_sub(1);
    while first > 0 && slope_variance(&levels[first..=last]) > SLOPE_DEVIATION * SLOPE_DEVIATION {
        first -= 1;
    }
    let window = &levels[first..=last];
    let misfit = |noise: PowerLaw| {
        let residual = |level: &OctaveVariance| {
            let ratio = level.variance / window[0].variance;
            coarse_log2(ratio) - noise.log2_avar(level.octave)
        };
        let mean = weighted_mean(window, residual);
        weighted_mean(window, |level| (residual(level) - mean) * (residual(level) - mean))
    };
    let mut best = (PowerLaw::White, misfit(PowerLaw::White));
    for noise in PowerLaw::ALL {
        let misfit = misfit(noise);
        if misfit < best.1 {
            best = (noise, misfit);
        }
    }
    best.0
}

fn weighted_mean(levels: &[OctaveVariance], of: impl Fn(&OctaveVariance) -> f64) -> f64 {
    let weight: f64 = levels.iter().map(|level| level.weight).sum();
    levels.iter().map(|level| level.weight * of(level)).sum::<f64>() / weight
}

/// Variance of the slope of the weighted least-squares line, with `2/weight` for the natural logarithm of an octave.
fn slope_variance(levels: &[OctaveVariance]) -> f64 {
    let mean = weighted_mean(levels, |level| level.octave);
    let spread: f64 = levels.iter().map(|level| level.weight * (level.octave - mean) * (level.octave - mean)).sum();
    2.0 / (core::f64::consts::LN_2 * core::f64::consts::LN_2 * spread)
}
