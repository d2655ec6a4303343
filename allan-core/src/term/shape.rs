//! The shape parameters of a term, by name.

pub(crate) const MAX_SHAPE: usize = 2;

/// The shape parameters of a term: their values, or a `T` for each.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Shape<T = f64> {
    /// A power law has no shape parameters.
    PowerLaw,
    /// Parameters of [`NoiseTerm::Filtered`](crate::NoiseTerm::Filtered).
    Filtered {
        /// Number of values that each moving average averages.
        taps: T,
        /// Filter values per sample.
        decimation: T,
    },
    /// Parameter of [`NoiseTerm::Markov`](crate::NoiseTerm::Markov).
    Markov {
        /// Correlation time, s.
        time_constant: T,
    },
    /// Parameters of [`NoiseTerm::Resonance`](crate::NoiseTerm::Resonance).
    Resonance {
        /// Centre frequency, Hz.
        frequency: T,
        /// Full width at half height, Hz.
        bandwidth: T,
    },
    /// Parameter of [`NoiseTerm::Sinusoid`](crate::NoiseTerm::Sinusoid).
    Sinusoid {
        /// Frequency, Hz.
        frequency: T,
    },
    /// Parameters of [`NoiseTerm::LowPass`](crate::NoiseTerm::LowPass).
    LowPass {
        /// Natural frequency, Hz.
        frequency: T,
        /// Damping ratio.
        damping: T,
    },
}

impl<T: Copy> Shape<T> {
    /// The parameters with their names in reports, in the order of the fields.
    pub fn named(&self) -> impl Iterator<Item = (&'static str, T)> + use<T> {
        let (first, second) = match *self {
            Self::PowerLaw => (None, None),
            Self::Filtered { taps, decimation } => (Some(("taps", taps)), Some(("decimation", decimation))),
            Self::LowPass { frequency, damping } => (Some(("frequency", frequency)), Some(("damping", damping))),
            Self::Markov { time_constant } => (Some(("time_constant", time_constant)), None),
            Self::Resonance { frequency, bandwidth } => {
                (Some(("frequency", frequency)), Some(("bandwidth", bandwidth)))
            }
            Self::Sinusoid { frequency } => (Some(("frequency", frequency)), None),
        };
        first.into_iter().chain(second)
    }

    /// The parameters, each changed by `change`.
    pub fn map<U>(&self, mut change: impl FnMut(T) -> U) -> Shape<U> {
        match *self {
            Self::PowerLaw => Shape::PowerLaw,
            Self::Filtered { taps, decimation } => {
                Shape::Filtered { taps: change(taps), decimation: change(decimation) }
            }
            Self::LowPass { frequency, damping } => {
                Shape::LowPass { frequency: change(frequency), damping: change(damping) }
            }
            Self::Markov { time_constant } => Shape::Markov { time_constant: change(time_constant) },
            Self::Resonance { frequency, bandwidth } => {
                Shape::Resonance { frequency: change(frequency), bandwidth: change(bandwidth) }
            }
            Self::Sinusoid { frequency } => Shape::Sinusoid { frequency: change(frequency) },
        }
    }

    /// The parameters in the order of the fields.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut T> {
        let (first, second) = match self {
            Self::PowerLaw => (None, None),
            Self::Filtered { taps, decimation } => (Some(taps), Some(decimation)),
            Self::LowPass { frequency, damping } => (Some(frequency), Some(damping)),
            Self::Markov { time_constant } => (Some(time_constant), None),
            Self::Resonance { frequency, bandwidth } => (Some(frequency), Some(bandwidth)),
            Self::Sinusoid { frequency } => (Some(frequency), None),
        };
        first.into_iter().chain(second)
    }
}

impl Shape {
    /// The values in the order of the fields, and 0 where there is none.
    pub(crate) fn values(&self) -> [f64; MAX_SHAPE] {
        let mut values = [0.0; MAX_SHAPE];
        values.iter_mut().zip(self.named()).for_each(|(slot, (_, value))| *slot = value);
        values
    }
}
