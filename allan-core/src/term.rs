//! The terms of a noise model in the nomenclature of IEEE Std 952: Allan variance, spectrum and correlation of second
//! differences, all for *samples* of the process.

mod exponential;
mod filter;
mod low_pass;
mod process;
mod set;
mod shape;

pub use exponential::{Markov, Resonance};
pub use filter::MovingAverageFilter;
pub use low_pass::LowPass;
pub use process::{AngleRandomWalk, BiasInstability, Process, Quantization, RateRamp, RateRandomWalk, Sinusoid};
pub(crate) use set::{AllTerms, PowerLawTerms, TermSet};
pub(crate) use shape::MAX_SHAPE;
pub use shape::Shape;

use crate::math::clamp;
use crate::noise_type::VarianceFractions;
use core::f64::consts::PI;

/// A term of a noise model: a [`Process`] with an unknown coefficient; "unit" is that of the channel.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum NoiseTerm {
    /// Q: white noise of the angle, in unit·s.
    Quantization,
    /// N: white rate noise, in unit·√s; IEEE 952 angle random walk.
    AngleRandomWalk,
    /// B: flicker rate noise, in the unit itself; σ = 0.664·B.
    BiasInstability,
    /// K: random walk of the rate, in unit/√s.
    RateRandomWalk,
    /// R: a linear trend, in unit/s.
    RateRamp,
    /// N after a digital low-pass filter, in unit·√s, through which B, K and Markov processes have passed too.
    Filtered(MovingAverageFilter),
    /// Exponentially correlated noise; its standard deviation, in the unit itself.
    Markov(Markov),
    /// A damped oscillation driven by white noise; its standard deviation, in the unit itself.
    Resonance(Resonance),
    /// A sinusoid; its amplitude, in the unit itself.
    Sinusoid(Sinusoid),
    /// N after an analog low-pass filter of the second order, in unit·√s, through which nothing else passes.
    LowPass(LowPass),
}

/// Frequency over bandwidth above which a curve cannot distinguish a resonance from a sinusoid.
const SHARPEST: f64 = 200.0;
/// Frequency over bandwidth below which a curve cannot distinguish a resonance from a Markov process.
const BROADEST: f64 = 1.5;

/// Averaging time over time constant up to which a Gauss–Markov process counts as a random walk, and from which on as
/// white noise: the slopes are +½ and −½ there.
const WALK_UP_TO: f64 = 0.769;
const WHITE_FROM: f64 = 4.145;

/// The unit of a coefficient in terms of the unit of the channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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

/// Evaluates an expression with the process of a term; methods that are never called are not linked.
macro_rules! with_process {
    (@one $power_law:ident, $process:ident => $expression:expr) => {{
        let $process = &$power_law;
        $expression
    }};
    ($kind:expr, $process:ident => $expression:expr) => {
        match $kind {
            NoiseTerm::Quantization => with_process!(@one Quantization, $process => $expression),
            NoiseTerm::AngleRandomWalk => with_process!(@one AngleRandomWalk, $process => $expression),
            NoiseTerm::BiasInstability => with_process!(@one BiasInstability, $process => $expression),
            NoiseTerm::RateRandomWalk => with_process!(@one RateRandomWalk, $process => $expression),
            NoiseTerm::RateRamp => with_process!(@one RateRamp, $process => $expression),
            NoiseTerm::Filtered($process) => $expression,
            NoiseTerm::LowPass($process) => $expression,
            NoiseTerm::Markov($process) => $expression,
            NoiseTerm::Resonance($process) => $expression,
            NoiseTerm::Sinusoid($process) => $expression,
        }
    };
}

impl NoiseTerm {
    /// The terms of the baseline model: N, B, K.
    pub const BASELINE: [Self; 3] = [Self::AngleRandomWalk, Self::BiasInstability, Self::RateRandomWalk];

    /// Name in reports, for example `angle_random_walk`.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Quantization => "quantization",
            Self::AngleRandomWalk => "angle_random_walk",
            Self::BiasInstability => "bias_instability",
            Self::RateRandomWalk => "rate_random_walk",
            Self::RateRamp => "rate_ramp",
            Self::Filtered(_) => "filter_bandwidth",
            Self::LowPass(_) => "low_pass",
            Self::Markov(_) => "markov",
            Self::Resonance(_) => "resonance",
            Self::Sinusoid(_) => "sinusoid",
        }
    }

    /// Name of the coefficient in reports: `value`, `slope`, `deviation` or `amplitude`.
    #[must_use]
    pub const fn coefficient(&self) -> &'static str {
        match self {
            Self::RateRamp => "slope",
            Self::Markov(_) | Self::Resonance(_) => "deviation",
            Self::Sinusoid(_) => "amplitude",
            _ => "value",
        }
    }

    /// Unit of the coefficient.
    #[must_use]
    pub const fn unit(&self) -> CoefficientUnit {
        match self {
            Self::Quantization => CoefficientUnit::TimesSecond,
            Self::AngleRandomWalk | Self::Filtered(_) | Self::LowPass(_) => CoefficientUnit::TimesRootSecond,
            Self::RateRandomWalk => CoefficientUnit::PerRootSecond,
            Self::RateRamp => CoefficientUnit::PerSecond,
            Self::BiasInstability | Self::Markov(_) | Self::Resonance(_) | Self::Sinusoid(_) => CoefficientUnit::Itself,
        }
    }

    /// Shape parameters of the term, times in s and frequencies in Hz.
    #[must_use]
    pub const fn shape(&self) -> Shape {
        match self {
            Self::Markov(markov) => Shape::Markov { time_constant: markov.time_constant },
            Self::Resonance(resonance) => {
                Shape::Resonance { frequency: resonance.frequency, bandwidth: resonance.bandwidth }
            }
            Self::Sinusoid(sinusoid) => Shape::Sinusoid { frequency: sinusoid.frequency },
            Self::Filtered(filter) => Shape::Filtered { taps: filter.taps as f64, decimation: filter.decimation },
            Self::LowPass(filter) => Shape::LowPass { frequency: filter.frequency, damping: filter.damping },
            _ => Shape::PowerLaw,
        }
    }

    /// Returns the term with other shape parameters, in the order of [`shape`](Self::shape).
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
            Self::Filtered(filter) => Self::Filtered(MovingAverageFilter { decimation: shape[1].max(1.0), ..filter }),
            Self::LowPass(filter) => Self::LowPass(LowPass { frequency: shape[0], ..filter }),
            other => other,
        }
    }

    /// Indices of the shape parameters that a fit can adjust.
    pub(crate) const fn free_parameters(&self) -> core::ops::Range<usize> {
        match self {
            Self::Markov(_) | Self::Sinusoid(_) | Self::LowPass(_) => 0..1,
            Self::Resonance(_) => 0..2,
            Self::Filtered(filter) if filter.decimation != 1.0 => 1..2,
            _ => 0..0,
        }
    }

    /// The process of the term.
    #[must_use]
    pub fn process(&self) -> &dyn Process {
        with_process!(self, process => process)
    }

    /// Allan variance at averaging factor `n` and `sample_period` seconds for a coefficient of 1, by the formula of the
    /// term's [process](Self::process).
    #[must_use]
    pub fn avar(&self, n: u64, sample_period: f64) -> f64 {
        with_process!(self, process => process.avar(n, sample_period))
    }

    /// True if noise of this kind passes the filter of a model: flicker noise, random walks and Gauss–Markov processes.
    #[must_use]
    pub const fn passes_filter(&self) -> bool {
        matches!(self, Self::BiasInstability | Self::RateRandomWalk | Self::Markov(_))
    }

    /// [`avar`](Self::avar) behind the model's `filter`, if the term [passes it](Self::passes_filter).
    #[inline(never)] // linked once
    pub(crate) fn avar_behind(&self, filter: Option<&MovingAverageFilter>, n: u64, sample_period: f64) -> f64 {
        match (self, filter) {
            (_, None) => self.avar(n, sample_period),
            (Self::Markov(markov), Some(filter)) => filter.avar_of_markov(n, markov, sample_period),
            (_, Some(filter)) if filter.is_short_against(n) => self.avar(n, sample_period),
            (Self::BiasInstability, Some(filter)) => filter.avar_of_flicker(n),
            (Self::RateRandomWalk, Some(filter)) => filter.avar_of_walk(n, sample_period),
            _ => self.avar(n, sample_period),
        }
    }

    pub(crate) fn sum_variances(&self, stride: f64, sample_period: f64, table: &mut [f64]) {
        with_process!(self, process => process.sum_variances(stride, sample_period, table));
    }

    /// [`Process::squared_covariance_tail`] in units of the square of the Allan variance.
    pub(crate) fn squared_covariance_tail(&self, n: u64, stride: f64, sample_period: f64) -> f64 {
        match self {
            Self::Markov(_) | Self::Resonance(_) | Self::LowPass(_) => {
                let avar = self.avar(n, sample_period);
                with_process!(self, process => process.squared_covariance_tail(n, stride, sample_period))
                    / (avar * avar)
            }
            _ => 0.0,
        }
    }

    pub(crate) fn phase_variance(&self, count: u64, stride: f64, sample_period: f64) -> f64 {
        match self {
            Self::Sinusoid(sinusoid) => sinusoid.phase_variance(count, stride, sample_period),
            _ => 0.0,
        }
    }

    /// True if the term contributes the same to every record, without scatter.
    pub(crate) const fn is_deterministic(&self) -> bool {
        matches!(self, Self::RateRamp | Self::Sinusoid(_))
    }

    /// The power laws that the term resembles at averaging factor `n`, as fractions that sum to `fraction`.
    pub(crate) fn share(&self, fraction: f64, n: u64, sample_period: f64) -> VarianceFractions {
        let none = VarianceFractions { quantization: 0.0, white: 0.0, flicker: 0.0, random_walk: 0.0 };
        match self {
            Self::Quantization => VarianceFractions { quantization: fraction, ..none },
            Self::AngleRandomWalk | Self::Resonance(_) | Self::Sinusoid(_) => {
                VarianceFractions { white: fraction, ..none }
            }
            Self::BiasInstability => VarianceFractions { flicker: fraction, ..none },
            Self::RateRandomWalk | Self::RateRamp => VarianceFractions { random_walk: fraction, ..none },
            Self::Filtered(filter) if (n as f64) * filter.decimation < f64::from(filter.taps) => {
                VarianceFractions { random_walk: fraction, ..none }
            }
            Self::LowPass(filter) if PI * filter.frequency * n as f64 * sample_period < filter.damping => {
                // The averaging time is below the mean of the impulse response, 2ζ/ω₀ (for a moving average: half its length).
                VarianceFractions { random_walk: fraction, ..none }
            }
            Self::Filtered(_) | Self::LowPass(_) => VarianceFractions { white: fraction, ..none },
            Self::Markov(markov) => {
                let averaged = n as f64 * sample_period / markov.time_constant;
                match averaged {
                    short if short < WALK_UP_TO => VarianceFractions { random_walk: fraction, ..none },
                    long if long > WHITE_FROM => VarianceFractions { white: fraction, ..none },
                    _ => VarianceFractions { flicker: fraction, ..none },
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Markov, NoiseTerm, WALK_UP_TO, WHITE_FROM};

    /// The slopes are taken from the process's own curve, with a time constant of a million samples.
    #[test]
    fn a_gauss_markov_process_has_the_slopes_that_it_is_classified_by() {
        let process = NoiseTerm::Markov(Markov { time_constant: 1e6 }).process();
        let slope = |x: f64| {
            let avar = |x: f64| process.avar((x * 1e6) as u64, 1.0);
            (avar(1.01 * x) / avar(x / 1.01)).ln() / (2.0 * 1.01_f64.ln())
        };
        assert!((slope(WALK_UP_TO) - 0.5).abs() < 1e-3, "{}", slope(WALK_UP_TO));
        assert!((slope(WHITE_FROM) + 0.5).abs() < 1e-3, "{}", slope(WHITE_FROM));
    }
}
