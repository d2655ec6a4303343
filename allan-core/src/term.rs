//! The terms of the noise model: what each does to the Allan variance of sampled data.

use crate::confidence::Shares;
use core::f64::consts::{LN_2, PI};

/// A term of the noise model that is linear in the square of its coefficient.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// N: white rate noise, in unit·√s; IEEE 952 angle random walk.
    AngleRandomWalk,
    /// B: flicker rate noise, in the unit itself; σ = 0.664·B.
    BiasInstability,
    /// K: random walk of the rate, in unit/√s.
    RateRandomWalk,
}

impl Kind {
    /// The model that is declared before anything is known: N, B, K.
    pub const DECLARED: [Self; 3] = [Self::AngleRandomWalk, Self::BiasInstability, Self::RateRandomWalk];

    /// Name in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::AngleRandomWalk => "angle_random_walk",
            Self::BiasInstability => "bias_instability",
            Self::RateRandomWalk => "rate_random_walk",
        }
    }

    /// Allan variance at averaging factor `n` and `sample_period` seconds for a coefficient of 1.
    ///
    /// For data that are samples of the process, not its averages: the random walk's `K²τ/3` is
    /// `K²·dt·(2n²+1)/(6n)`, which at `n = 1` is half as large again. Bias instability is `(2 ln 2/π)·B²`
    /// (IEEE 952, annex C).
    #[must_use]
    pub fn avar(self, n: u64, sample_period: f64) -> f64 {
        let n = n as f64;
        match self {
            Self::AngleRandomWalk => 1.0 / (n * sample_period),
            Self::BiasInstability => 2.0 * LN_2 / PI,
            Self::RateRandomWalk => sample_period * (2.0 * n * n + 1.0) / (6.0 * n),
        }
    }

    pub(crate) fn share(self, share: f64) -> Shares {
        let none = Shares { quantization: 0.0, white: 0.0, flicker: 0.0, random_walk: 0.0 };
        match self {
            Self::AngleRandomWalk => Shares { white: share, ..none },
            Self::BiasInstability => Shares { flicker: share, ..none },
            Self::RateRandomWalk => Shares { random_walk: share, ..none },
        }
    }
}
