//! The trait of all kinds of effects: name, parameters, share of the variance.

use crate::bounds::{BoundedEstimate, Parameter};
use allan_core::NoiseTerm;
use allan_core::term::Markov;
use measurement::Quantity;

/// A kind of effect. Its name stands in the list of [`Effect`](super::Effect).
pub(crate) trait Kind {
    fn parameters(&self) -> Vec<NamedParameter>;

    fn occurrence(&self) -> Occurrence {
        Occurrence::InChannel
    }

    /// The Allan variance that it adds to its channel, at one averaging time.
    fn avar(&self, _at: &AveragingTime) -> AddedVariance {
        AddedVariance::NONE
    }

    /// Its part of the channel's bias in each block: factors, each with the values that it multiplies. Empty for noise.
    fn course(&self, _blocks: &BiasBlocks) -> Vec<(f64, Vec<f64>)> {
        Vec::new()
    }
}

/// A parameter of an effect, and what it is for.
pub(crate) struct NamedParameter {
    /// In tables and files.
    pub name: &'static str,
    pub parameter: Parameter,
    /// True if it says how large the effect is.
    pub is_size: bool,
    /// True if any two stretches of a record have it alike where the effect lasts: it describes the samples' distribution, no single event.
    pub lasts: bool,
}

/// A parameter that is neither a size nor lasting.
pub(super) fn named(name: &'static str, parameter: Parameter) -> NamedParameter {
    NamedParameter { name, parameter, is_size: false, lasts: false }
}

impl NamedParameter {
    pub(super) fn size(self) -> Self {
        Self { is_size: true, ..self }
    }

    pub(super) fn lasting(self) -> Self {
        Self { lasts: true, ..self }
    }
}

/// How often a part has an effect, which decides whether two channels show the same one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Occurrence {
    /// The part, its bus or its environment has it once: whatever channels show it show the same cause.
    Once,
    /// The channels of one unit have it once.
    OnceAUnit,
    /// At a time, between the earliest and the latest possible one in s: one cause where these overlap.
    AtTime { from_s: f64, to_s: f64 },
    /// At a frequency, Hz: one cause where each is within the bounds of the other.
    AtFrequency(BoundedEstimate),
    /// In each channel by itself.
    InChannel,
}

impl Occurrence {
    pub(super) fn is_one_cause(self, other: Self, is_same_unit: bool) -> bool {
        match (self, other) {
            (Self::Once, Self::Once) => true,
            (Self::OnceAUnit, Self::OnceAUnit) => is_same_unit,
            (Self::AtTime { from_s, to_s }, Self::AtTime { from_s: other_from_s, to_s: other_to_s }) => {
                from_s <= other_to_s && other_from_s <= to_s
            }
            (Self::AtFrequency(one), Self::AtFrequency(other)) => {
                let has = |of: BoundedEstimate, value: f64| (of.low..=of.high).contains(&value);
                has(one, other.value) && has(other, one.value)
            }
            _ => false,
        }
    }
}

/// The Allan variance that an effect adds to a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AddedVariance {
    /// The part that the channel's model has.
    pub modelled: f64,
    /// The part that the model lacks: the samples are corrected for it, or are left out.
    pub corrected: f64,
}

impl AddedVariance {
    /// For an effect that adds no variance: a filter, a clock, lost samples.
    pub(crate) const NONE: Self = Self { modelled: 0.0, corrected: 0.0 };

    /// For an effect that the model has.
    pub(crate) const fn modelled(modelled: f64) -> Self {
        Self { modelled, ..Self::NONE }
    }

    /// For an effect that the samples are corrected for, or whose samples are left out.
    pub(crate) const fn corrected(corrected: f64) -> Self {
        Self { corrected, ..Self::NONE }
    }
}

impl std::iter::Sum for AddedVariance {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::NONE, |sum, of| Self {
            modelled: sum.modelled + of.modelled,
            corrected: sum.corrected + of.corrected,
        })
    }
}

pub(crate) struct AveragingTime<'a> {
    /// Averaging factor, samples.
    pub n: u64,
    pub period_s: f64,
    pub samples: u64,
    pub model_avar: f64,
    /// Allan deviation of the channel of this quantity and axis, where there is one.
    pub adev_of: &'a dyn Fn(Quantity, &str) -> Option<f64>,
}

impl AveragingTime<'_> {
    pub(crate) fn tau_s(&self) -> f64 {
        self.n as f64 * self.period_s
    }

    /// The variance of a term of the noise model with this coefficient.
    pub(crate) fn of_term(&self, term: &NoiseTerm, coefficient: f64) -> AddedVariance {
        AddedVariance::modelled(coefficient * coefficient * term.avar(self.n, self.period_s))
    }

    /// The variance of exponentially correlated noise with this time constant, in s, and this standard deviation.
    pub(crate) fn of_markov(&self, time_constant: f64, deviation: f64) -> AddedVariance {
        self.of_term(&NoiseTerm::Markov(Markov { time_constant }), deviation)
    }

    /// The variance of `sensitivity` times a channel; none if there is no such channel.
    pub(crate) fn followed(&self, quantity: Quantity, axis: &str, sensitivity: f64) -> AddedVariance {
        let adev = (self.adev_of)(quantity, axis).unwrap_or(0.0);
        AddedVariance::modelled((sensitivity * adev).powi(2))
    }
}

/// The blocks in which a bias is shown over time.
pub(crate) struct BiasBlocks<'a> {
    /// Middle of each block, s.
    pub time_s: &'a [f64],
    /// Means of the channel of this quantity and axis at these times, less the mean of them all, where there is one.
    pub of: &'a dyn Fn(Quantity, &str) -> Option<Vec<f64>>,
}

impl BiasBlocks<'_> {
    /// `sensitivity` times the means of a channel.
    pub(crate) fn followed(&self, quantity: Quantity, axis: &str, sensitivity: f64) -> Vec<(f64, Vec<f64>)> {
        (self.of)(quantity, axis).map(|means| (sensitivity, means)).into_iter().collect()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::{AveragingTime, Kind};

    /// Asserts that the Allan variance of `kind` at these averaging factors is that of `samples`, by definition, within a `tolerance`.
    pub(in crate::effects) fn assert_avar(
        kind: &dyn Kind,
        samples: &[f64],
        period_s: f64,
        factors: &[usize],
        tolerance: f64,
    ) {
        let mut sums = vec![0.0];
        samples.iter().for_each(|sample| sums.push(sums[sums.len() - 1] + sample));
        for &n in factors {
            let differences = sums.windows(2 * n + 1).map(|at| (at[2 * n] - 2.0 * at[n] + at[0]) / n as f64);
            let count = (samples.len() + 1 - 2 * n) as f64;
            let expected = 0.5 * differences.map(|difference| difference * difference).sum::<f64>() / count;
            let (n, samples) = (n as u64, samples.len() as u64);
            let at = AveragingTime { n, period_s, samples, model_avar: 0.0, adev_of: &|_, _| None };
            let added = kind.avar(&at);
            let ratio = (added.modelled + added.corrected) / expected;
            assert!((ratio - 1.0).abs() < tolerance, "{n}: {ratio}");
        }
    }
}
