//! The terms that a model may lack, each from where its shape can be searched for.

use super::Lines;
use crate::term::{Filter, Markov, Resonance, Sinusoid};
use crate::{Curve, Kind};

/// Shapes of one family: what lies between them is reached by the search.
const MAX_SHAPES: usize = 64;

/// Terms that differ in their shape alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Family {
    Quantization,
    RateRamp,
    /// Behind the filter the converter's rounding adds white noise.
    Filter,
    /// It takes the place of the white noise: the rate is all that it adds.
    SlowlyReadFilter,
    Markov,
    Sinusoid,
    Resonance,
    KnownLine,
}

impl Family {
    /// Whether it stands for a term that is there already: in the wrong shape, however near, it is much worse.
    pub(super) fn takes_a_place(self) -> bool {
        matches!(self, Self::SlowlyReadFilter)
    }

    /// Parameters that it adds to the model.
    pub(super) fn parameters(self) -> u32 {
        match self {
            Self::Quantization | Self::RateRamp => 1,
            Self::Filter | Self::SlowlyReadFilter | Self::Markov | Self::Sinusoid | Self::KnownLine => 2,
            Self::Resonance => 3,
        }
    }
}

/// Every family for a curve.
#[derive(Debug, Clone, Copy)]
pub(super) struct Families<'a> {
    lines: Lines<'a>,
    sample_period: f64,
    longest_tau: f64,
}

impl<'a> Families<'a> {
    pub(super) fn new<const POINTS: usize>(curve: &Curve<POINTS>, lines: Lines<'a>) -> Self {
        let sample_period = curve.sample_period();
        Self { lines, sample_period, longest_tau: curve.points().last().map_or(sample_period, |point| point.tau) }
    }

    /// The simplest first.
    pub(super) fn all(&self) -> impl Iterator<Item = Family> {
        use Family::{Filter, KnownLine, Markov, Quantization, RateRamp, Resonance, Sinusoid, SlowlyReadFilter};
        let lines: &[Family] = match self.lines {
            Lines::Known(_) => &[KnownLine],
            Lines::InTheCurve => &[Sinusoid, Resonance],
        };
        [Quantization, RateRamp, Filter, SlowlyReadFilter, Markov].iter().chain(lines).copied()
    }

    /// The shapes of a family, one at a time: all of them would fill a small stack.
    pub(super) fn shapes(&self, family: Family) -> impl Iterator<Item = Kind> {
        (0..MAX_SHAPES).map_while(move |index| self.shape(family, index))
    }

    fn shape(&self, family: Family, index: usize) -> Option<Kind> {
        let frequency = || octaves(0.4 / self.longest_tau, 0.45 / self.sample_period, 3.0, index);
        match family {
            Family::Quantization => (index == 0).then_some(Kind::Quantization),
            Family::RateRamp => (index == 0).then_some(Kind::RateRamp),
            Family::Filter => (index < 6).then(|| Kind::Filtered(Filter::bartlett(2 << index))),
            Family::SlowlyReadFilter => [6.1, 8.1, 10.1, 12.1]
                .get(index)
                .map(|&decimation| Kind::Filtered(Filter { stages: 2, taps: 8, decimation })),
            Family::Markov => octaves(2.0 * self.sample_period, self.longest_tau, 1.0, index)
                .map(|time_constant| Kind::Markov(Markov { time_constant })),
            Family::Sinusoid => frequency().map(|frequency| Kind::Sinusoid(Sinusoid { frequency })),
            Family::Resonance => {
                frequency().map(|frequency| Kind::Resonance(Resonance { frequency, bandwidth: frequency / 5.0 }))
            }
            Family::KnownLine => match self.lines {
                Lines::Known(lines) => lines.get(index).copied(),
                Lines::InTheCurve => None,
            },
        }
    }
}

/// One of the values from `low` to `high`, `density` to an octave.
fn octaves(low: f64, high: f64, density: f64, index: usize) -> Option<f64> {
    let value = low * crate::math::exp(core::f64::consts::LN_2 / density * index as f64);
    (value <= high).then_some(value)
}
