//! The candidate terms of a trace, by families that differ in their shape parameters alone.

use crate::curve::CurveView;
use crate::fit::FreeShapes;
use crate::term::{Markov, MovingAverageFilter, NoiseTerm, Resonance, Sinusoid};

/// Largest number of starting shapes of a family.
const MAX_SHAPES: usize = 64;

/// Source of candidate spectral lines.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LineCandidates<'a> {
    /// Lines are sought in the curve itself, which shows only strong ones.
    Curve,
    /// The candidates are only these terms, which were found in a spectrum.
    Spectrum(&'a [NoiseTerm]),
}

impl<'a> LineCandidates<'a> {
    /// All shapes are adjusted except frequencies from a spectrum.
    pub(super) fn free(self) -> FreeShapes<'a> {
        FreeShapes::AllExcept(match self {
            Self::Curve => &[],
            Self::Spectrum(lines) => lines,
        })
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Family {
    Quantization,
    RateRamp,
    /// A filter at its own rate, added to the white noise.
    Filter,
    /// A filter whose output is read at a lower rate, in place of the white noise.
    DecimatedFilter,
    Markov,
    Sinusoid,
    Resonance,
    SpectralLine,
}

impl Family {
    pub(super) fn replaces_a_term(self) -> bool {
        matches!(self, Self::DecimatedFilter)
    }

    pub(super) fn parameters(self) -> u32 {
        match self {
            Self::Quantization | Self::RateRamp => 1,
            Self::Filter | Self::DecimatedFilter | Self::Markov | Self::Sinusoid | Self::SpectralLine => 2,
            Self::Resonance => 3,
        }
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Families<'a> {
    lines: LineCandidates<'a>,
    filters: &'a [MovingAverageFilter],
    sample_period: f64,
    longest_tau: f64,
}

impl<'a> Families<'a> {
    pub(super) fn new(curve: CurveView, lines: LineCandidates<'a>, filters: &'a [MovingAverageFilter]) -> Self {
        let sample_period = curve.sample_period();
        let longest_tau = curve.points().last().map_or(sample_period, |point| point.tau);
        Self { lines, filters, sample_period, longest_tau }
    }

    /// All families, the simplest first.
    pub(super) fn all(&self) -> impl Iterator<Item = Family> {
        use Family::{DecimatedFilter, Filter, Markov, Quantization, RateRamp, Resonance, Sinusoid, SpectralLine};
        let lines: &[Family] = match self.lines {
            LineCandidates::Spectrum(_) => &[SpectralLine],
            LineCandidates::Curve => &[Sinusoid, Resonance],
        };
        [Quantization, RateRamp, Filter, DecimatedFilter, Markov].iter().chain(lines).copied()
    }

    /// The starting shapes of a family, one at a time, as a list would take too much stack.
    pub(super) fn shapes(&self, family: Family) -> impl Iterator<Item = NoiseTerm> {
        (0..MAX_SHAPES).map_while(move |index| self.shape(family, index))
    }

    fn shape(&self, family: Family, index: usize) -> Option<NoiseTerm> {
        let frequency = || octaves(0.4 / self.longest_tau, 0.45 / self.sample_period, 3.0, index);
        match family {
            Family::Quantization => (index == 0).then_some(NoiseTerm::Quantization),
            Family::RateRamp => (index == 0).then_some(NoiseTerm::RateRamp),
            Family::Filter => self.filter(|filter| filter.decimation == 1.0, index),
            Family::DecimatedFilter => self.filter(|filter| filter.decimation != 1.0, index),
            Family::Markov => octaves(2.0 * self.sample_period, self.longest_tau, 1.0, index)
                .map(|time_constant| NoiseTerm::Markov(Markov { time_constant })),
            Family::Sinusoid => frequency().map(|frequency| NoiseTerm::Sinusoid(Sinusoid { frequency })),
            Family::Resonance => {
                frequency().map(|frequency| NoiseTerm::Resonance(Resonance { frequency, bandwidth: frequency / 5.0 }))
            }
            Family::SpectralLine => match self.lines {
                LineCandidates::Spectrum(lines) => lines.get(index).copied(),
                LineCandidates::Curve => None,
            },
        }
    }

    fn filter(&self, is_member: impl Fn(&MovingAverageFilter) -> bool, index: usize) -> Option<NoiseTerm> {
        self.filters.iter().copied().filter(is_member).nth(index).map(NoiseTerm::Filtered)
    }
}

/// Value `index` of a geometric series from `low` to `high` with `density` values per octave.
fn octaves(low: f64, high: f64, density: f64, index: usize) -> Option<f64> {
    let value = low * crate::math::exp(core::f64::consts::LN_2 / density * index as f64);
    (value <= high).then_some(value)
}
