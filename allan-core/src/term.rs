//! The terms of the noise model: what each does to sampled data.
//!
//! Every term knows its Allan variance for *samples* of the process (the continuous forms are 12 to 34 % off at the
//! shortest averaging times), its power spectral density, and how its second differences hang together, which is
//! what decides how much an estimate is worth.

pub mod correlation;
mod exponential;
mod filter;
mod power_law;
mod sinusoid;

pub use exponential::{Markov, Resonance};
pub use filter::Filter;
pub use power_law::{AngleRandomWalk, BiasInstability, Quantization, RateRamp, RateRandomWalk};
pub use sinusoid::Sinusoid;

use crate::confidence::Shares;
use crate::math::clamp;
use crate::model::MAX_SHAPE;

/// A process with a coefficient of 1, sampled every `sample_period` seconds.
pub trait Process {
    /// Variance of the sum of `m` samples, less what second differences do not see (constants, lines, parabolas).
    ///
    /// The Allan variance is `[4V(n) − V(2n)]/(2n²)`.
    fn structure(&self, m: f64, sample_period: f64) -> f64;

    /// Two-sided power spectral density at `frequency` in Hz, aliases included, in unit²/Hz; 0 for what is not noise.
    fn density(&self, frequency: f64, sample_period: f64) -> f64;

    /// The shortest record, in s, that can tell the process from its neighbours.
    fn record_needed(&self, sample_period: f64) -> f64;

    /// Allan variance at averaging factor `n`.
    fn avar(&self, n: u64, sample_period: f64) -> f64 {
        let n = n as f64;
        (4.0 * self.structure(n, sample_period) - self.structure(2.0 * n, sample_period)) / (2.0 * n * n)
    }

    /// [`structure`](Self::structure) of 0, 1, 2 … strides of `stride` samples, up to a factor and an error that does not
    /// matter to how second differences that far apart hang together.
    fn structures(&self, stride: f64, sample_period: f64, structures: &mut [f64]) {
        for (k, structure) in structures.iter_mut().enumerate() {
            *structure = self.structure(k as f64 * stride, sample_period);
        }
    }

    /// Sum of the squares of the halved covariances of second differences at the lags `2n + stride, 2n + 2·stride …`; 0 for what forgets.
    fn memory_beyond(&self, _n: u64, _stride: f64, _sample_period: f64) -> f64 {
        0.0
    }
}

/// A term of the noise model: a [`Process`] whose coefficient is to be estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// Q: white noise of the angle, in unit·s.
    Quantization,
    /// N: white rate noise, in unit·√s; IEEE 952 angle random walk.
    AngleRandomWalk,
    /// B: flicker rate noise, in the unit itself; σ = 0.664·B.
    BiasInstability,
    /// K: random walk of the rate, in unit/√s.
    RateRandomWalk,
    /// R: a steady trend, in unit/s.
    RateRamp,
    /// N behind a digital low-pass filter.
    Filtered(Filter),
    /// Exponentially correlated noise; its standard deviation, in the unit itself.
    Markov(Markov),
    /// A narrow-band, damped oscillation; its standard deviation, in the unit itself.
    Resonance(Resonance),
    /// A pure line; its amplitude, in the unit itself.
    Sinusoid(Sinusoid),
}

/// Frequency over bandwidth from which on a curve cannot tell a resonance from a sinusoid.
const SHARPEST: f64 = 200.0;
/// The same below which it is a Markov process rather than an oscillation.
const BROADEST: f64 = 1.5;

const NONE: (&str, f64) = ("", 0.0);

/// What a coefficient is measured in, the channel's unit being that of a rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CoefficientUnit {
    /// unit·s
    TimesSecond,
    /// unit·√s, the same as unit/√Hz
    TimesRootSecond,
    /// unit
    Itself,
    /// unit/√s
    PerRootSecond,
    /// unit/s
    PerSecond,
}

/// An expression of the process of a kind. What is not called is not linked, as it would be behind a `dyn`.
macro_rules! of {
    ($kind:expr, $process:ident => $expression:expr) => {
        match $kind {
            Kind::Quantization => {
                let $process = &Quantization;
                $expression
            }
            Kind::AngleRandomWalk => {
                let $process = &AngleRandomWalk;
                $expression
            }
            Kind::BiasInstability => {
                let $process = &BiasInstability;
                $expression
            }
            Kind::RateRandomWalk => {
                let $process = &RateRandomWalk;
                $expression
            }
            Kind::RateRamp => {
                let $process = &RateRamp;
                $expression
            }
            Kind::Filtered($process) => $expression,
            Kind::Markov($process) => $expression,
            Kind::Resonance($process) => $expression,
            Kind::Sinusoid($process) => $expression,
        }
    };
}
use of;

impl Kind {
    /// The model that is declared before anything is known: N, B, K.
    pub const DECLARED: [Self; 3] = [Self::AngleRandomWalk, Self::BiasInstability, Self::RateRandomWalk];

    /// Name in reports.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Quantization => "quantization",
            Self::AngleRandomWalk => "angle_random_walk",
            Self::BiasInstability => "bias_instability",
            Self::RateRandomWalk => "rate_random_walk",
            Self::RateRamp => "rate_ramp",
            Self::Filtered(_) => "filter_bandwidth",
            Self::Markov(_) => "markov",
            Self::Resonance(_) => "resonance",
            Self::Sinusoid(_) => "sinusoid",
        }
    }

    /// What the coefficient is called in reports.
    #[must_use]
    pub const fn coefficient(&self) -> &'static str {
        match self {
            Self::RateRamp => "slope",
            Self::Markov(_) | Self::Resonance(_) => "deviation",
            Self::Sinusoid(_) => "amplitude",
            _ => "value",
        }
    }

    /// What the coefficient is measured in.
    #[must_use]
    pub const fn unit(&self) -> CoefficientUnit {
        match self {
            Self::Quantization => CoefficientUnit::TimesSecond,
            Self::AngleRandomWalk | Self::Filtered(_) => CoefficientUnit::TimesRootSecond,
            Self::RateRandomWalk => CoefficientUnit::PerRootSecond,
            Self::RateRamp => CoefficientUnit::PerSecond,
            Self::BiasInstability | Self::Markov(_) | Self::Resonance(_) | Self::Sinusoid(_) => CoefficientUnit::Itself,
        }
    }

    /// Names and values of the parameters of its shape; the unused ones are nameless.
    #[must_use]
    pub const fn shape(&self) -> [(&'static str, f64); MAX_SHAPE] {
        match self {
            Self::Markov(markov) => [("time_constant", markov.time_constant), NONE],
            Self::Resonance(resonance) => [("frequency", resonance.frequency), ("bandwidth", resonance.bandwidth)],
            Self::Sinusoid(sinusoid) => [("frequency", sinusoid.frequency), NONE],
            Self::Filtered(filter) => [("taps", filter.taps as f64), ("decimation", filter.decimation)],
            _ => [NONE, NONE],
        }
    }

    /// The same term with another shape, in the order of [`shape`](Self::shape).
    #[must_use]
    pub(crate) fn with_shape(self, shape: [f64; MAX_SHAPE]) -> Self {
        match self {
            Self::Markov(_) => Self::Markov(Markov { time_constant: shape[0] }),
            Self::Resonance(_) => {
                let [frequency, bandwidth] = shape;
                Self::Resonance(Resonance {
                    frequency,
                    bandwidth: clamp(bandwidth, frequency / SHARPEST, frequency / BROADEST),
                })
            }
            Self::Sinusoid(_) => Self::Sinusoid(Sinusoid { frequency: shape[0] }),
            Self::Filtered(filter) => Self::Filtered(Filter { decimation: shape[1], ..filter }),
            other => other,
        }
    }

    /// Which parameters of the shape can be searched for: real numbers, and not a decimation of 1 that is built in.
    pub(crate) const fn freedom(&self) -> core::ops::Range<usize> {
        match self {
            Self::Markov(_) | Self::Sinusoid(_) => 0..1,
            Self::Resonance(_) => 0..2,
            Self::Filtered(filter) if filter.decimation != 1.0 => 1..2,
            _ => 0..0,
        }
    }

    /// What it does to samples.
    #[must_use]
    pub fn process(&self) -> &dyn Process {
        of!(self, process => process)
    }

    /// Allan variance at averaging factor `n` and `sample_period` seconds for a coefficient of 1.
    #[must_use]
    pub fn avar(&self, n: u64, sample_period: f64) -> f64 {
        of!(self, process => process.avar(n, sample_period))
    }

    /// [`Process::memory_beyond`] in units of the square of the Allan variance.
    pub(crate) fn memory_beyond(&self, n: u64, stride: f64, sample_period: f64) -> f64 {
        match self {
            Self::Markov(_) | Self::Resonance(_) => {
                let avar = self.avar(n, sample_period);
                of!(self, process => process.memory_beyond(n, stride, sample_period)) / (avar * avar)
            }
            _ => 0.0,
        }
    }

    /// Whether it adds the same to every record, so that it blurs no estimate.
    pub(crate) const fn is_deterministic(&self) -> bool {
        matches!(self, Self::RateRamp | Self::Sinusoid(_))
    }

    /// The power laws that it resembles at averaging factor `n`, in parts that sum to `share`.
    pub(crate) fn share(&self, share: f64, n: u64, sample_period: f64) -> Shares {
        let none = Shares { quantization: 0.0, white: 0.0, flicker: 0.0, random_walk: 0.0 };
        match self {
            Self::Quantization => Shares { quantization: share, ..none },
            Self::AngleRandomWalk | Self::Resonance(_) | Self::Sinusoid(_) => Shares { white: share, ..none },
            Self::BiasInstability => Shares { flicker: share, ..none },
            Self::RateRandomWalk | Self::RateRamp => Shares { random_walk: share, ..none },
            Self::Filtered(filter) if (n as f64) * filter.decimation < f64::from(filter.taps) => {
                Shares { random_walk: share, ..none }
            }
            Self::Filtered(_) => Shares { white: share, ..none },
            Self::Markov(markov) => {
                let averaged = n as f64 * sample_period / markov.time_constant;
                match averaged {
                    short if short < 0.7 => Shares { random_walk: share, ..none },
                    long if long > 4.0 => Shares { white: share, ..none },
                    _ => Shares { flicker: share, ..none },
                }
            }
        }
    }
}
