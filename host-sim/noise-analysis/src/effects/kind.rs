//! What every kind of effect says of itself.

use crate::bounds::{BoundedEstimate, Parameter};
use allan_core::NoiseTerm;
use allan_core::term::Markov;
use measurement::Quantity;

/// A kind of effect.
pub(crate) trait Kind {
    /// In tables and files.
    const NAME: &'static str;

    /// Its parameters by their names in tables and files.
    fn parameters(&self) -> Vec<(&'static str, Parameter)>;

    /// The estimates that say how large it is: the channel with the narrowest of these for their value shows it most clearly.
    fn sizes(&self) -> Vec<BoundedEstimate>;

    /// What two parts of a record have alike where the effect lasts, in one order for the whole kind; nothing of what happens once or is
    /// no statement about the samples' distribution. Of lines the first is the frequency, and then come amplitude, deviation and
    /// bandwidth.
    fn lasting(&self) -> Vec<Option<BoundedEstimate>>;

    /// How often a part has it.
    fn occurrence(&self) -> Occurrence;

    /// The Allan variance that it adds to its channel, at one averaging time.
    fn avar(&self, at: &AveragingTime) -> AddedVariance;

    /// What it adds to the bias of its channel in each block: factors, each with the values that it multiplies. Empty of noise.
    fn course(&self, means: &BiasBlocks) -> Vec<(f64, Vec<f64>)>;
}

/// In a [`Kind`] of noise: [`Kind::course`].
macro_rules! no_course {
    () => {
        fn course(&self, _: &$crate::effects::BiasBlocks) -> Vec<(f64, Vec<f64>)> {
            Vec::new()
        }
    };
}

/// In a [`Kind`] that adds no variance of its own: [`Kind::avar`] and [`Kind::course`].
macro_rules! no_variance {
    () => {
        fn avar(&self, _: &$crate::effects::AveragingTime) -> $crate::effects::AddedVariance {
            $crate::effects::AddedVariance::NONE
        }

        $crate::effects::kind::no_course!();
    };
}

/// In a [`Kind`] with a `frequency_hz` and an `amplitude`, both of which last: [`Kind::sizes`], [`Kind::lasting`] and
/// [`Kind::occurrence`].
macro_rules! amplitude_at_frequency {
    () => {
        fn sizes(&self) -> Vec<$crate::bounds::BoundedEstimate> {
            vec![self.amplitude.estimate()]
        }

        fn lasting(&self) -> Vec<Option<$crate::bounds::BoundedEstimate>> {
            vec![Some(self.frequency_hz), Some(self.amplitude.estimate())]
        }

        fn occurrence(&self) -> $crate::effects::Occurrence {
            $crate::effects::Occurrence::AtFrequency(self.frequency_hz)
        }
    };
}

pub(super) use {amplitude_at_frequency, no_course, no_variance};

/// How often a part has an effect, which decides whether two channels show the same one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Occurrence {
    /// The part, its bus or its environment has it once: whatever channels show it show the same cause.
    Once,
    /// The channels of one unit have it once.
    OnceAUnit,
    /// At a time, between the earliest and the latest possible one in s: one cause where these overlap.
    AtTime {
        /// s
        from_s: f64,
        /// s
        to_s: f64,
    },
    /// At a frequency, Hz: one cause where each is within the bounds of the other.
    AtFrequency(BoundedEstimate),
    /// In each channel by itself.
    InChannel,
}

impl Occurrence {
    /// Whether two effects of one kind are one cause.
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
    /// What the channel's model has of it.
    pub modelled: f64,
    /// What the model lacks: the samples are corrected for it, or are left out.
    pub corrected: f64,
}

impl AddedVariance {
    /// Of an effect that adds none of its own: a filter, a clock, lost samples.
    pub(crate) const NONE: Self = Self { modelled: 0.0, corrected: 0.0 };

    /// Of an effect that the model has.
    pub(crate) const fn modelled(modelled: f64) -> Self {
        Self { modelled, ..Self::NONE }
    }

    /// Of an effect that the samples are corrected for, or whose samples are left out.
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

/// An averaging time of a channel of a record.
pub(crate) struct AveragingTime<'a> {
    /// Averaging factor, samples.
    pub n: u64,
    /// Sample period, s.
    pub period_s: f64,
    /// Samples of the record.
    pub samples: u64,
    /// Allan variance of the channel's model.
    pub model_avar: f64,
    /// Allan deviation of the channel of this quantity and axis, where there is one.
    pub adev_of: &'a dyn Fn(Quantity, &str) -> Option<f64>,
}

impl AveragingTime<'_> {
    /// Of a term of the noise model with this coefficient.
    pub(crate) fn of_term(&self, term: &NoiseTerm, coefficient: f64) -> AddedVariance {
        AddedVariance::modelled(coefficient * coefficient * term.avar(self.n, self.period_s))
    }

    /// Of exponentially correlated noise with this time constant, in s, and this standard deviation.
    pub(crate) fn of_markov(&self, time_constant: f64, deviation: f64) -> AddedVariance {
        self.of_term(&NoiseTerm::Markov(Markov { time_constant }), deviation)
    }

    /// Of `sensitivity` times a channel; none where there is no such channel.
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
